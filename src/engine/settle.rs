//! Before t = 0: the static load is brought on and held, then the loop runs warm on the first command.
//!
//! The load rises in small parts. After each exchange the displacement moves by K⁻¹·(unbalanced force), K an upper
//! bound of the tangent: for yielding and softening laws the approach is monotone, so that a specimen is
//! never driven back and forth. Corrections are made of forces that were measured where the specimens stand: while an answer
//! stays away they hold. Each correction is an accepted motion of the specimen, along half a cosine: the ramp's time
//! is shared over the parts, and no speed limit is used beyond the ramp's share of it.
//! Nothing moves meanwhile: the initial displacement, which counts from the position under the static load, and the
//! initial velocities of structure and base come after it.

use super::numerical::Side;
use super::operator::Control;
use super::phase::{Cause, Phase};
use super::tick::Tick;
use super::{Engine, Stop};
use crate::control::{Port, UNBOUNDED_RAMP_S};
use crate::integrate::State;
use crate::linalg::Spd;
use crate::model::Base;
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
    /// Unbalanced displacement, relative to the largest displacement, at which the load is in equilibrium. The last part
    /// goes on beyond it as long as the balance still gets better, down to roundoff.
    pub tolerance: f64,
    /// Exchanges after which the load counts as impossible to carry.
    pub most_exchanges: u32,
}

/// Relative unbalance at which all parts but the last are taken for carried.
const ROUGHLY: f64 = 1e-3;
/// A correction is not of the load alone if it is so many times as large as one part of it.
const MORE_THAN_LOAD: f64 = 2.0;
/// Relative unbalance that cannot get better.
const ROUNDOFF: f64 = 4.0 * f64::EPSILON;

impl Engine {
    /// Brings the static load on. Does nothing if there is none.
    pub(super) fn settle(&mut self, control: &Control) -> Result<(), Stop> {
        let Some(mut settling) = self.settling.take() else {
            return Ok(());
        };
        let Side::Structure(numerical) = &mut self.side else {
            return Ok(());
        };
        let at_rest = State::at_rest(settling.load.len());
        let initial = std::mem::replace(&mut numerical.state, at_rest);
        let (state, base) = (&numerical.state, numerical.base(0));
        for port in &mut self.ports {
            port.aim(&state.disp, &state.vel, base.disp, 0.0);
        }
        self.ramp(control)?;
        self.enter(Phase::Settling, Cause::Done);
        self.listen_at_rest(control)?;
        let mut exchanges = 0;
        let (ramp_s, parts) = (self.opening.ramp_s, f64::from(settling.parts));
        let (shortest, mut longest) = (ramp_s / parts, 0.0f64);
        // How far the load alone takes the structure, which is what the ramp's time is meant for.
        let mut whole = settling.load.clone();
        settling.stiffness.solve_in_place(&mut whole);
        let whole = whole.iter().fold(0.0f64, |most, disp| most.max(disp.abs()));
        for part in 1..=settling.parts {
            let share = f64::from(part) / f64::from(settling.parts);
            let mut before = f64::INFINITY;
            loop {
                exchanges += 1;
                if exchanges > settling.most_exchanges {
                    return Err(Stop::NotSettled { exchanges });
                }
                let (correction, largest) = self.settle_once(&mut settling, share, control)?;
                let unbalance = if largest > 0.0 {
                    correction / largest
                } else {
                    0.0
                };
                longest = longest.max(correction);
                if correction > 0.0 {
                    // A specimen that was found under a force of its own moves further: not faster for that, but no slower
                    // than any way from where one stands, however small the load is.
                    let of_load = if correction > MORE_THAN_LOAD * whole / parts {
                        (ramp_s * (correction / whole)).min(ramp_s.max(UNBOUNDED_RAMP_S))
                    } else {
                        0.0
                    };
                    self.approach([shortest * (correction / longest), of_load], control)?;
                }
                let enough = if part == settling.parts {
                    unbalance <= settling.tolerance
                        && (unbalance <= ROUNDOFF || unbalance >= before)
                } else {
                    unbalance <= ROUGHLY
                };
                if enough {
                    break;
                }
                before = unbalance;
            }
        }
        if let Side::Structure(numerical) = &mut self.side {
            let settled = std::mem::replace(&mut numerical.state, initial).disp;
            for (disp, settled) in numerical.state.disp.iter_mut().zip(settled) {
                *disp += settled;
            }
        }
        self.report_unshown();
        self.aim_at_start();
        // Exchanges before t = 0 are no ticks of the test.
        self.timing.reset();
        Ok(())
    }

    /// Leads the specimens to the corrected place that stands ready, in `shortest` s or longer, and in `unbounded` s where no
    /// limit of speed bounds one that stood anywhere. What is no further than one tick goes is the next exchange itself.
    fn approach(&mut self, [shortest, unbounded]: [f64; 2], control: &Control) -> Result<(), Stop> {
        let tick = self.period.value();
        let ticks = self.ramp_ticks(|port, share| port.way_time(share, tick, shortest, unbounded));
        if ticks > 1 {
            self.lead(ticks, Phase::Settling, control)?;
            for port in &mut self.ports {
                port.stand_still();
            }
        }
        Ok(())
    }

    /// One exchange, and one correction when everybody has answered; the sizes of the correction and of the displacement.
    fn settle_once(
        &mut self,
        settling: &mut Settling,
        share: f64,
        control: &Control,
    ) -> Result<(f64, f64), Stop> {
        while self.hold_wanted {
            self.still_tick(Phase::Settling, control)?;
        }
        self.clear_commands()?;
        let tick = Tick::before_start(self.tick_passes());
        let mut stamps = TickStamps::default();
        self.wait_before_start(&mut stamps, control)?;
        self.exchange(&tick, &mut stamps, control)?;
        self.resolve_poses()?;
        self.row_before_start(&tick, Phase::Settling, &stamps);
        self.accept()?;
        // The same force would be taken off the load twice.
        while !self.ports.iter().all(Port::is_fresh) {
            self.still_tick(Phase::Settling, control)?;
            self.resolve_poses()?;
        }
        self.listen()?;
        let Side::Structure(numerical) = &mut self.side else {
            return Ok((0.0, 0.0));
        };
        let mut residual: Vec<f64> = settling.load.iter().map(|load| share * load).collect();
        let base = Base {
            disp: numerical.base(0).disp,
            vel: 0.0,
        };
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
        Ok((correction, largest))
    }
}
