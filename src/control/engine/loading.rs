//! The static load before t = 0: it is applied in small parts and held.
//!
//! In each part the displacement moves by K⁻¹·(unbalanced force). K is an upper bound of the tangent, so for yielding and
//! softening laws the approach is monotone, and no specimen is driven back and forth. A correction that turns back and is no
//! smaller than the one before shows that K is too small: the test ends there. Corrections use forces that were measured
//! where the specimens stand: while a reply stays away they hold, and while one is on its way ([`Rest`]) the others wait for
//! it. A specimen that does not go where it is sent ([`MotionCheck`]) ends the test. Each correction is an accepted motion along half
//! a cosine. The ramp's time is shared over the parts, and no speed limit is used beyond the ramp's share of it.
//! The initial displacement counts from the position under the static load; it and the initial velocities come after it.

use super::cycle::{Engine, Maneuver};
use super::numerical::Side;
use super::order::Order;
use super::phase::Phase;
use super::ramping::Ramp;
use super::standing::Listening;
use super::static_load::StaticLoad;
use super::stop::part_at;
use super::tick::Tick;
use super::{Ending, Stop};
use crate::port::{MotionCheck, Port, Rest, UNBOUNDED_RAMP_S};
use gusset_numerics::integrate::State;
use gusset_numerics::model::Base;
use gusset_record::Event;
use gusset_record::rt::timing::TickStamps;

/// Relative unbalance at which all parts but the last are taken for carried.
const ROUGHLY: f64 = 1e-3;
/// Ratio of a correction to one part of the load above which the load alone does not explain it.
const MORE_THAN_LOAD: f64 = 2.0;
/// Relative unbalance that cannot get better.
const ROUNDOFF: f64 = 4.0 * f64::EPSILON;
/// Corrections in a row without a better balance that count as noise of sensors or the resolution of an actuator: the load
/// counts as carried if the best of them was at this relative unbalance at most.
const NO_BETTER: u32 = 8;
const NO_BETTER_THAN: f64 = 1e-2;
/// A balance of the forces to this share of the load is one, too, if it does not get better: what is soft goes far beside what
/// carries the load for the noise of its load cell.
const NO_BETTER_FORCE: f64 = 1e-3;
/// Longest sum of all waits for specimens to come to rest, as a multiple of the longest single wait.
const WAITS: u64 = 30;

/// What one correction has found.
struct Unbalance {
    /// How far it goes, and the displacement that it leads to.
    correction: f64,
    largest: f64,
    /// Unbalanced force, N.
    force: f64,
    /// It turns back, and is no smaller than the correction before.
    diverges: bool,
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
    /// The specimens are sent to their next commands.
    fn send(&mut self, ports: &[Port]) {
        for (port, rest) in ports.iter().zip(&mut self.rests) {
            let raw = port
                .exchange()
                .has_answered()
                .then(|| port.feedback().raw());
            rest.sent([port.path().sent(), port.command()], raw);
        }
    }

    /// Those that were led there have answered their last command once.
    fn note_led(&mut self, ports: &[Port]) {
        for (port, rest) in ports.iter().zip(&mut self.rests) {
            if port.feedback().is_fresh() && port.path().sent() == port.command() {
                rest.led(port.feedback().raw());
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
                    sent: value(&port.path().sent()),
                    read: value(&port.feedback().raw().disp),
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

/// Exchanges of the next command until every specimen is at rest there: one exchange if all of them rest at once.
struct Resting<'a> {
    waits: &'a mut Waits,
    exchanges: u64,
    state: RestState,
}

/// The purpose of the next tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RestState {
    /// The command leaves.
    Sends,
    /// A reply stayed away: with it the same force would be taken off the load twice.
    Refreshes,
    /// The operator holds the test before the command leaves.
    Held,
}

impl Resting<'_> {
    /// Takes the replies; the specimen that is not at rest, if one is not.
    fn take(&mut self, ports: &[Port]) -> Option<usize> {
        for (port, rest) in ports.iter().zip(&mut self.waits.rests) {
            rest.take(port.feedback().raw());
        }
        self.waits.rests.iter().position(|rest| !rest.rests())
    }

    /// One more exchange of a specimen that is not at rest.
    fn count(&mut self, port: usize, period_s: f64) -> Result<(), Stop> {
        self.exchanges += 1;
        self.waits.waited += 1;
        let rest = part_at(&mut self.waits.rests, port, "specimen at rest")?;
        if self.exchanges > rest.patience() {
            return Err(Stop::NotAtRest {
                port,
                seconds: self.exchanges as f64 * period_s,
            });
        }
        Ok(())
    }
}

impl Maneuver for Resting<'_> {
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        if self.state == RestState::Refreshes {
            if !engine.ports.iter().all(|port| port.feedback().is_fresh()) {
                return Ok(Some(engine.still(Phase::Settling)));
            }
            let Some(port) = self.take(engine.ports) else {
                return Ok(None);
            };
            self.count(port, engine.environment.pace.period_s())?;
        }
        if engine.environment.supervision.is_held() {
            self.state = RestState::Held;
            return Ok(Some(engine.still(Phase::Settling)));
        }
        self.state = RestState::Sends;
        engine.judge_commands()?;
        let tick = Tick::before_start(engine.tick_passes());
        Ok(Some(Order::moving(tick, Phase::Settling)))
    }

    fn measured(
        &mut self,
        engine: &mut Engine<'_>,
        order: &mut Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        if order.is_still() {
            return Ok(());
        }
        engine.resolve_poses()
    }

    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        order: &Order,
        _: &mut TickStamps,
    ) -> Result<(), Stop> {
        if !order.is_still() {
            self.state = RestState::Refreshes;
            return engine.accept();
        }
        engine.reuse_number();
        if self.state == RestState::Refreshes {
            engine.resolve_poses()?;
        }
        Ok(())
    }
}

/// How near the load is to equilibrium in one of its parts.
struct Balance {
    before: f64,
    best: f64,
    best_force: f64,
    /// Corrections in a row without a better balance.
    no_better: u32,
}

impl Balance {
    const fn new() -> Self {
        Self {
            before: f64::INFINITY,
            best: f64::INFINITY,
            best_force: f64::INFINITY,
            no_better: 0,
        }
    }

    /// True if the part is carried: its `tolerance` is reached, or the balance does not get better.
    fn is_reached(&mut self, found: &Unbalance, tolerance: Option<f64>, enough_force: f64) -> bool {
        let unbalance = found.relative();
        let enough = match tolerance {
            Some(tolerance) => {
                unbalance <= tolerance && (unbalance <= ROUNDOFF || unbalance >= self.before)
            }
            None => unbalance <= ROUGHLY,
        };
        self.no_better = if unbalance < self.best {
            0
        } else {
            self.no_better + 1
        };
        self.best = self.best.min(unbalance);
        self.best_force = self.best_force.min(found.force);
        self.before = unbalance;
        let carried = self.best <= NO_BETTER_THAN || self.best_force <= enough_force;
        enough || (self.no_better >= NO_BETTER && carried)
    }
}

/// The static load on its way.
pub(super) struct Loading {
    settling: StaticLoad,
    waits: Waits,
    exchanges: u32,
    /// How far the load alone takes the structure, which is what the ramp's time is meant for.
    whole: f64,
    /// Longest correction, and largest displacement.
    longest: f64,
    largest: f64,
    /// Smallest relative unbalance of the part.
    nearest: f64,
    /// The last correction of the part; empty before the first.
    before: Vec<f64>,
}

impl Loading {
    /// Applies the static load, if there is one.
    ///
    /// # Errors
    /// The load found no equilibrium, or the test ends.
    pub(crate) fn perform(engine: &mut Engine<'_>) -> Result<(), Stop> {
        let Some(settling) = engine.settling.take() else {
            return Ok(());
        };
        let Side::Structure(numerical) = &mut *engine.side else {
            return Ok(());
        };
        let at_rest = State::at_rest(settling.load.len());
        let initial = std::mem::replace(&mut numerical.state, at_rest);
        let (state, base) = (&numerical.state, numerical.base(0));
        for port in &mut *engine.ports {
            port.aim(&state.disp, &state.vel, base.disp, 0.0);
        }
        let mut load = Self::new(settling, engine);
        load.come_to_where_nothing_is_deformed(engine)?;
        load.apply(engine)?;
        if let Side::Structure(numerical) = &mut *engine.side {
            let settled = std::mem::replace(&mut numerical.state, initial).disp;
            for (disp, settled) in numerical.state.disp.iter_mut().zip(settled) {
                *disp += settled;
            }
        }
        Self::report_unshown(engine);
        engine.aim_at_start();
        // Exchanges before t = 0 are no ticks of the test.
        engine.environment.deadlines.forget_timing();
        Ok(())
    }

    fn new(mut settling: StaticLoad, engine: &Engine<'_>) -> Self {
        let period = engine.environment.pace.period_s();
        let rests = engine.ports.iter();
        let rests = rests.map(|port| Rest::new(port.axes(), period));
        let mut whole = settling.load.clone();
        settling.stiffness.solve_in_place(&mut whole);
        Self {
            waits: Waits {
                rests: rests.collect(),
                follows: (engine.ports.iter())
                    .map(|port| MotionCheck::new(port.axes()))
                    .collect(),
                waited: 0,
            },
            settling,
            exchanges: 0,
            whole: size(&whole),
            longest: 0.0,
            largest: 0.0,
            nearest: f64::INFINITY,
            before: Vec::new(),
        }
    }

    fn come_to_where_nothing_is_deformed(&mut self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        self.waits.send(engine.ports);
        Ramp::perform(engine)?;
        self.waits.note_led(engine.ports);
        engine.environment.enter(Phase::Settling, Ending::Completed);
        let listened = engine
            .ports
            .iter()
            .any(|port| port.startup().wiring().is_by_static_load());
        if listened && !self.waits.rests.iter().all(Rest::rests) {
            self.come_to_rest(engine)?;
        }
        let mut listening = Listening::new(engine);
        engine.perform(&mut listening)
    }

    /// Applies the load part by part.
    fn apply(&mut self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        let parts = self.settling.parts;
        let enough_force = NO_BETTER_FORCE * size(&self.settling.load);
        for part in 1..=parts {
            let share = f64::from(part) / f64::from(parts);
            let tolerance = (part == parts).then_some(self.settling.tolerance);
            let mut balance = Balance::new();
            self.before.clear();
            loop {
                let found = self.correct(share, engine)?;
                let reached = balance.is_reached(&found, tolerance, enough_force);
                self.nearest = balance.best;
                if reached {
                    break;
                }
            }
        }
        Ok(())
    }

    /// One correction from the forces at rest, and the motion to it.
    fn correct(&mut self, share: f64, engine: &mut Engine<'_>) -> Result<Unbalance, Stop> {
        self.exchanges += 1;
        let rests = self.waits.rests.iter();
        let most = rests.map(Rest::patience).max().unwrap_or(0);
        if self.exchanges > self.settling.most_exchanges || self.waits.waited > WAITS * most {
            return Err(self.not_settled());
        }
        self.come_to_rest(engine)?;
        self.waits
            .judge(engine.ports, NO_BETTER_THAN * self.largest)?;
        let found = self.balance(share, engine)?;
        if found.diverges {
            return Err(self.not_settled());
        }
        self.largest = found.largest;
        self.longest = self.longest.max(found.correction);
        if found.correction > 0.0 {
            self.approach(found.correction, engine)?;
        }
        Ok(found)
    }

    fn not_settled(&self) -> Stop {
        Stop::NotSettled {
            exchanges: self.exchanges.saturating_add(self.waits.waited as u32),
            unbalance: self.nearest,
            port: self.waits.farthest(),
        }
    }

    /// Leads the specimens to the corrected position. A way that one tick can go is the next exchange itself.
    fn approach(&mut self, correction: f64, engine: &mut Engine<'_>) -> Result<(), Stop> {
        let (ramp_s, parts) = (engine.plan.opening.ramp_s, f64::from(self.settling.parts));
        // A specimen that began under a force moves further: not faster for that, but no slower than any way from a standstill,
        // however small the load is.
        let unbounded = if correction > MORE_THAN_LOAD * self.whole / parts {
            (ramp_s * (correction / self.whole)).min(ramp_s.max(UNBOUNDED_RAMP_S))
        } else {
            0.0
        };
        let shortest = ramp_s / parts * (correction / self.longest);
        self.waits.send(engine.ports);
        let tick = engine.environment.pace.period_s();
        let ticks = Ramp::ticks(engine, |port, share| {
            port.way_time(share, tick, shortest, unbounded)
        });
        if ticks > 1 {
            let mut ramp = Ramp::of(ticks, Phase::Settling, engine)?;
            engine.perform(&mut ramp)?;
            engine.ports.iter_mut().for_each(Port::stand_still);
        }
        self.waits.note_led(engine.ports);
        Ok(())
    }

    /// Exchanges the next command until every specimen is at rest there.
    fn come_to_rest(&mut self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        let mut resting = Resting {
            waits: &mut self.waits,
            exchanges: 0,
            state: RestState::Sends,
        };
        engine.perform(&mut resting)?;
        let mut is_known_better = false;
        for (port, rest) in engine.ports.iter_mut().zip(&self.waits.rests) {
            is_known_better |= port.take_rest(rest);
        }
        if is_known_better {
            engine.resolve_poses()?;
        }
        Ok(())
    }

    /// The unbalance of a share of the load, and the place that corrects it.
    fn balance(&mut self, share: f64, engine: &mut Engine<'_>) -> Result<Unbalance, Stop> {
        for (index, port) in engine.ports.iter_mut().enumerate() {
            port.check_by_static_load().map_err(|misfit| Stop::Misfit {
                port: index,
                misfit,
            })?;
        }
        let mut found = Unbalance {
            correction: 0.0,
            largest: 0.0,
            force: 0.0,
            diverges: false,
        };
        let Side::Structure(numerical) = &mut *engine.side else {
            return Ok(found);
        };
        let load = self.settling.load.iter();
        let mut residual: Vec<f64> = load.map(|load| share * load).collect();
        let base = Base {
            disp: numerical.base(0).disp,
            vel: 0.0,
        };
        let still = vec![0.0; residual.len()];
        numerical.structure.subtract_internal(
            &numerical.state.disp,
            &still,
            base,
            engine.plan.dt,
            &mut residual,
        );
        for port in &mut *engine.ports {
            port.subtract_force(0..residual.len(), &mut residual);
        }
        found.force = size(&residual);
        self.settling.stiffness.solve_in_place(&mut residual);
        for (disp, change) in numerical.state.disp.iter_mut().zip(&residual) {
            *disp += change;
        }
        found.correction = size(&residual);
        found.largest = size(&numerical.state.disp);
        let turns_back = self.before.iter().zip(&residual);
        let turns_back = turns_back.map(|(before, now)| before * now).sum::<f64>() < 0.0;
        // A smaller unbalance may be noise.
        let part = size(&self.settling.load) / f64::from(self.settling.parts);
        let grows = found.correction >= size(&self.before);
        found.diverges = turns_back && grows && found.force >= part;
        self.before.clone_from(&residual);
        for port in &mut *engine.ports {
            port.aim(&numerical.state.disp, &still, base.disp, base.vel);
        }
        Ok(found)
    }

    /// Reports the axes whose direction the static load did not show.
    fn report_unshown(engine: &mut Engine<'_>) {
        for (index, port) in engine.ports.iter().enumerate() {
            for axis in port.startup().wiring().unshown() {
                engine.environment.report_now(Event::DirectionUnknown {
                    port: index as u32,
                    axis: axis as u32,
                });
            }
        }
    }
}
