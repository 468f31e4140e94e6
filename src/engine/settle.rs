//! Before t = 0: the static load is brought on and held, then the loop runs warm on the first command.
//!
//! The load rises in small parts. In each the displacement moves by K⁻¹·(unbalanced force), K an upper
//! bound of the tangent: for yielding and softening laws the approach is monotone, so that a specimen is
//! never driven back and forth. Corrections are made of forces that were measured where the specimens stand: while an answer
//! stays away they hold, and while one of them is still on its way ([`Rest`]) the others wait for it. Who does not go where it is
//! sent ([`MotionCheck`]) ends the test. Each correction is an
//! accepted motion of the specimen, along half a cosine: the ramp's time
//! is shared over the parts, and no speed limit is used beyond the ramp's share of it.
//! Nothing moves meanwhile: the initial displacement, which counts from the position under the static load, and the
//! initial velocities of structure and base come after it.

use super::numerical::Side;
use super::operator::Control;
use super::phase::Phase;
use super::tick::Tick;
use super::{Ending, Engine, Stop};
use crate::integrate::State;
use crate::linalg::Spd;
use crate::model::Base;
use crate::port::{MotionCheck, Port, Rest, UNBOUNDED_RAMP_S};
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
    /// Corrections after which the load counts as impossible to carry.
    pub most_exchanges: u32,
}

/// Relative unbalance at which all parts but the last are taken for carried.
const ROUGHLY: f64 = 1e-3;
/// A correction is not of the load alone if it is so many times as large as one part of it.
const MORE_THAN_LOAD: f64 = 2.0;
/// Relative unbalance that cannot get better.
const ROUNDOFF: f64 = 4.0 * f64::EPSILON;
/// So many corrections in a row without a better balance are the noise of sensors, their quantum, or what an actuator cannot
/// resolve: the load counts as carried if the best of them was at this relative unbalance at most. Longer ones must be gone.
const NO_BETTER: u32 = 8;
const NO_BETTER_THAN: f64 = 1e-2;
/// A balance of the forces to this share of the load is one, too, if it does not get better: what is soft goes far beside what
/// carries the load for the noise of its load cell.
const NO_BETTER_FORCE: f64 = 1e-3;
/// All waits for specimens to come to rest take so many times as long as one of them may, at most.
const WAITS: u64 = 30;

/// What one correction has found.
struct Unbalance {
    /// How far it goes, and the displacement that it leads to.
    correction: f64,
    largest: f64,
    /// What was left of the load, N.
    force: f64,
}

impl Unbalance {
    fn relative(&self) -> f64 {
        if self.largest > 0.0 {
            self.correction / self.largest
        } else {
            0.0
        }
    }
}

/// Largest size of a vector's entries.
fn size(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}

/// The specimens on their way, one entry per port, and the exchanges in which they were waited for.
struct Waits {
    rests: Vec<Rest>,
    follows: Vec<MotionCheck>,
    waited: u64,
}

impl Waits {
    /// The commands that stand ready are where they are sent.
    fn send(&mut self, ports: &[Port]) {
        for (port, rest) in ports.iter().zip(&mut self.rests) {
            let raw = port.has_answered().then(|| port.raw());
            rest.sent(port.sent(), port.command(), raw);
        }
    }

    /// Those that were led there have answered their last command once.
    fn note_led(&mut self, ports: &[Port]) {
        for (port, rest) in ports.iter().zip(&mut self.rests) {
            if port.is_fresh() && port.sent() == port.command() {
                rest.led(port.raw());
            }
        }
    }

    /// Those that came to rest went where they were sent, or near; ways shorter than `least` are not judged.
    fn judge(&mut self, ports: &[Port], least: f64) -> Result<(), Stop> {
        for (index, (port, follows)) in ports.iter().zip(&mut self.follows).enumerate() {
            if let Some(axis) = port.check_motion(follows, least) {
                let value = |values: &[f64]| values.get(axis).copied().unwrap_or(f64::NAN);
                return Err(Stop::DoesNotFollow {
                    port: index,
                    axis,
                    sent: value(port.sent()),
                    read: value(&port.raw().disp),
                });
            }
        }
        Ok(())
    }

    /// The port that was sent farthest by the last correction.
    fn farthest(&self) -> Option<usize> {
        let ways = self
            .follows
            .iter()
            .map(MotionCheck::longest_way)
            .enumerate();
        ways.max_by(|one, two| one.1.total_cmp(&two.1))
            .map(|(port, _)| port)
    }
}

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
        let period = self.period.value();
        let rests = self.ports.iter().map(|port| Rest::new(port.axes(), period));
        let mut waits = Waits {
            rests: rests.collect(),
            follows: (self.ports.iter().map(|port| MotionCheck::new(port.axes()))).collect(),
            waited: 0,
        };
        waits.send(&self.ports);
        self.ramp(control)?;
        waits.note_led(&self.ports);
        self.enter(Phase::Settling, Ending::Completed);
        if self.ports.iter().any(Port::is_checked_by_static_load)
            && !waits.rests.iter().all(Rest::rests)
        {
            self.come_to_rest(&mut waits, control)?;
        }
        self.read_before_static_load(control)?;
        let mut exchanges = 0;
        let (ramp_s, parts) = (self.opening.ramp_s, f64::from(settling.parts));
        let (shortest, mut longest) = (ramp_s / parts, 0.0f64);
        // How far the load alone takes the structure, which is what the ramp's time is meant for.
        let mut whole = settling.load.clone();
        settling.stiffness.solve_in_place(&mut whole);
        let whole = size(&whole);
        let enough_force = NO_BETTER_FORCE * size(&settling.load);
        let (mut largest, mut nearest) = (0.0, f64::INFINITY);
        for part in 1..=settling.parts {
            let share = f64::from(part) / f64::from(settling.parts);
            let (mut before, mut best, mut no_better) = (f64::INFINITY, f64::INFINITY, 0);
            let mut best_force = f64::INFINITY;
            loop {
                exchanges += 1;
                let most = waits.rests.iter().map(Rest::patience).max().unwrap_or(0);
                if exchanges > settling.most_exchanges || waits.waited > WAITS * most {
                    return Err(Stop::NotSettled {
                        exchanges: exchanges.saturating_add(waits.waited as u32),
                        unbalance: nearest,
                        port: waits.farthest(),
                    });
                }
                self.come_to_rest(&mut waits, control)?;
                waits.judge(&self.ports, NO_BETTER_THAN * largest)?;
                let found = self.settle_once(&mut settling, share)?;
                let (correction, unbalance) = (found.correction, found.relative());
                largest = found.largest;
                longest = longest.max(correction);
                if correction > 0.0 {
                    // A specimen that was found under a force of its own moves further: not faster for that, but no slower
                    // than any way from where one stands, however small the load is.
                    let of_load = if correction > MORE_THAN_LOAD * whole / parts {
                        (ramp_s * (correction / whole)).min(ramp_s.max(UNBOUNDED_RAMP_S))
                    } else {
                        0.0
                    };
                    waits.send(&self.ports);
                    self.approach([shortest * (correction / longest), of_load], control)?;
                    waits.note_led(&self.ports);
                }
                let enough = if part == settling.parts {
                    unbalance <= settling.tolerance
                        && (unbalance <= ROUNDOFF || unbalance >= before)
                } else {
                    unbalance <= ROUGHLY
                };
                no_better = if unbalance < best { 0 } else { no_better + 1 };
                best = best.min(unbalance);
                best_force = best_force.min(found.force);
                nearest = best;
                let carried = best <= NO_BETTER_THAN || best_force <= enough_force;
                if enough || (no_better >= NO_BETTER && carried) {
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

    /// Exchanges of the command that stands ready, until every specimen has come to rest there: one, where all of them do so at
    /// once.
    fn come_to_rest(&mut self, waits: &mut Waits, control: &Control) -> Result<(), Stop> {
        let mut exchanges = 0;
        loop {
            self.settling_tick(control)?;
            // The same force would be taken off the load twice.
            while !self.ports.iter().all(Port::is_fresh) {
                self.still_tick(Phase::Settling, control)?;
                self.resolve_poses()?;
            }
            let answers = self.ports.iter().zip(&mut waits.rests);
            for (port, rest) in answers {
                rest.take(port.raw());
            }
            let Some(port) = waits.rests.iter().position(|rest| !rest.rests()) else {
                break;
            };
            exchanges += 1;
            waits.waited += 1;
            if waits
                .rests
                .get(port)
                .is_some_and(|rest| exchanges > rest.patience())
            {
                return Err(Stop::NotAtRest {
                    port,
                    seconds: exchanges as f64 * self.period.value(),
                });
            }
        }
        let mut is_known_better = false;
        for (port, rest) in self.ports.iter_mut().zip(&waits.rests) {
            is_known_better |= port.take_rest(rest);
        }
        if is_known_better {
            self.resolve_poses()?;
        }
        Ok(())
    }

    /// One exchange of the command that stands ready, which is accepted. While the operator wants a hold the last one leaves
    /// again.
    fn settling_tick(&mut self, control: &Control) -> Result<(), Stop> {
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
        self.accept()
    }

    /// One correction by what was measured at rest.
    fn settle_once(&mut self, settling: &mut Settling, share: f64) -> Result<Unbalance, Stop> {
        self.listen()?;
        let mut found = Unbalance {
            correction: 0.0,
            largest: 0.0,
            force: 0.0,
        };
        let Side::Structure(numerical) = &mut self.side else {
            return Ok(found);
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
        found.force = size(&residual);
        settling.stiffness.solve_in_place(&mut residual);
        for (disp, change) in numerical.state.disp.iter_mut().zip(&residual) {
            *disp += change;
        }
        found.correction = size(&residual);
        found.largest = size(&numerical.state.disp);
        for port in &mut self.ports {
            port.aim(&numerical.state.disp, &still, base.disp, base.vel);
        }
        Ok(found)
    }
}
