//! Before t = 0: the static load is brought on and held, then the loop runs warm on the first command.
//!
//! The load rises in small parts. After each exchange the displacement moves by K⁻¹·(unbalanced force), K an upper
//! bound of the tangent: for yielding and softening laws the approach is monotone, so that a specimen is
//! never driven back and forth. Each exchange is an accepted motion of the specimen, one tick of the grid apart.

use super::columns::state;
use super::numerical::Side;
use super::run::Control;
use super::step::Tick;
use super::{Engine, Stop};
use crate::linalg::Spd;
use crate::rt::timing::TickStamps;

/// How the static load is brought on.
#[derive(Debug)]
pub struct Settling {
    /// Factor of an upper bound of the total tangent stiffness at the start.
    pub stiffness: Spd,
    /// Static load in N, one entry per DOF; it acts from here to the end of the test.
    pub load: Vec<f64>,
    /// Number of equal parts.
    pub parts: u32,
    /// Unbalanced displacement, relative to the largest displacement, at which a part is in equilibrium.
    pub tolerance: f64,
    /// Exchanges after which the load counts as impossible to carry.
    pub most_exchanges: u32,
}

impl Engine {
    /// Brings the static load on. Does nothing if there is none.
    pub(super) fn settle(&mut self, control: &Control) -> Result<(), Stop> {
        let Some(mut settling) = self.settling.take() else {
            return Ok(());
        };
        let mut exchanges = 0;
        for part in 1..=settling.parts {
            let share = f64::from(part) / f64::from(settling.parts);
            let tolerance = if part == settling.parts {
                settling.tolerance
            } else {
                1e-3
            };
            loop {
                exchanges += 1;
                if exchanges > settling.most_exchanges {
                    return Err(Stop::NotSettled { exchanges });
                }
                if self.settle_once(&mut settling, share, control)? <= tolerance {
                    break;
                }
            }
        }
        if let Side::Structure(numerical) = &self.side {
            self.peaks.start(&numerical.state.disp);
        }
        Ok(())
    }

    /// One exchange and one correction; the size of the correction relative to the displacement.
    fn settle_once(
        &mut self,
        settling: &mut Settling,
        share: f64,
        control: &Control,
    ) -> Result<f64, Stop> {
        let tick = Tick {
            step: 0,
            sub_tick: 0,
            time: 0.0,
            dt: self.dt,
        };
        let mut stamps = TickStamps::default();
        self.wait_for_edge(&mut stamps, control)?;
        self.exchange(&tick, &mut stamps)?;
        self.row
            .exchange(&tick, state::SETTLING, &self.side, &self.ports);
        let Side::Structure(numerical) = &mut self.side else {
            return Ok(0.0);
        };
        let mut residual: Vec<f64> = settling.load.iter().map(|load| share * load).collect();
        let base = numerical.base(0);
        let still = vec![0.0; residual.len()];
        numerical.structure.subtract_internal(
            &numerical.state.disp,
            &still,
            base,
            self.dt,
            &mut residual,
        );
        for port in &mut self.ports {
            port.subtract_force(&mut residual);
        }
        settling.stiffness.solve_in_place(&mut residual);
        let mut largest = 0.0f64;
        let mut correction = 0.0f64;
        for (disp, change) in numerical.state.disp.iter_mut().zip(&residual) {
            *disp += change;
            largest = largest.max(disp.abs());
            correction = correction.max(change.abs());
        }
        for port in &mut self.ports {
            port.note_peak();
            port.aim(&numerical.state.disp, &still, base.disp, base.vel);
        }
        self.accept()?;
        self.row.outputs(&self.side);
        self.row
            .timing(&stamps, self.first_edge, self.schedule.stretched());
        if !self.recorder.row(self.row.values()) {
            self.rows_lost += 1;
        }
        if let Some(port) = self.ports.iter().position(|port| !port.command_is_finite()) {
            return Err(Stop::NotFinite { port });
        }
        Ok(if largest > 0.0 {
            correction / largest
        } else {
            0.0
        })
    }
}
