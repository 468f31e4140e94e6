//! The warm-up: the loop runs, and the specimens hold the first command.
//!
//! Nothing is counted as a miss. The first half is for caches and branch predictors. In the second half each step costs what it
//! will cost in the test, so deadlines that are missed there would be missed there, too: they are held against the test's own
//! bounds, and a loop that cannot keep its ticks does not begin. The expected share of misses is the observed one less three standard
//! deviations of their count, so that a hiccup stops nothing.

use super::commanding::Recordings;
use super::cycle::{Engine, Maneuver};
use super::numerical::{Scratch, Side};
use super::order::{Kind, Order, Sends};
use super::phase::Phase;
use super::test_hit::TestHit;
use super::{Ending, Stop};
use crate::port::Port;
use gusset_quantity::catalog::limit::Limit;
use gusset_record::rt::timing::TickStamps;
use gusset_record::{Event, WarmUp as WarmUpEvent, WarmUpRows};

/// Standard deviations of a count by which it may be too large by chance.
const CHANCE: f64 = 3.0;

/// How the ticks of the second half of a warm-up were kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Readiness {
    ticks: u64,
    missed: u64,
    now_in_a_row: u64,
    most_in_a_row: u64,
    /// From wake-up to the end of the tick's work, in all and at most.
    sum_ns: u64,
    longest_ns: u64,
}

impl Readiness {
    /// Takes note of a tick in which `waited_ns` were waited that the test does not wait. Real-time: yes.
    pub(crate) fn note(&mut self, stamps: &TickStamps, waited_ns: u64) {
        let pushed = stamps.pushed.minus(waited_ns);
        let took_ns = pushed.since(stamps.woke);
        self.ticks += 1;
        self.sum_ns += took_ns;
        self.longest_ns = self.longest_ns.max(took_ns);
        if pushed > stamps.deadline {
            self.missed += 1;
            self.now_in_a_row += 1;
            self.most_in_a_row = self.most_in_a_row.max(self.now_in_a_row);
        } else {
            self.now_in_a_row = 0;
        }
    }

    /// Misses to be expected at least among this number of ticks.
    fn expected(&self, ticks: u64) -> f64 {
        let missed = self.missed as f64;
        let surely = (missed - CHANCE * missed.sqrt()).max(0.0);
        surely / self.ticks.max(1) as f64 * ticks as f64
    }
}

/// The ticks of the warm-up.
pub(super) struct WarmUp {
    rows: WarmUpRows,
    tick: u64,
    ticks_per_step: u64,
    /// What each tick goes back to after it did the work of a step.
    scratch: Option<Scratch>,
    readiness: Readiness,
}

impl WarmUp {
    /// Performs the warm-up, after which commands belong to the test.
    ///
    /// # Errors
    /// The loop is not ready, or the test ends.
    pub(crate) fn perform(engine: &mut Engine<'_>) -> Result<(), Stop> {
        engine.environment.enter(Phase::Armed, Ending::Completed);
        let journal = &mut engine.environment.journal;
        let rows = journal.begin_warm_up(engine.plan.limits.warmup_ticks);
        // A replay without these rows has neither requests nor replies.
        let is_silent = rows == WarmUpRows::Never;
        if is_silent {
            engine.exchanges.recordings = Recordings::AreSilent;
            engine.environment.supervision.hears(false);
            // A specimen that never replied before the test, and is late in its first tick, ends it there: then these rows are
            // kept.
            for port in &mut *engine.ports {
                port.exchange_mut().take_for_answered();
            }
        }
        let held_before = engine.environment.supervision.is_held();
        let outcome = Self::new(rows, engine).run(engine);
        engine.exchanges.recordings = Recordings::Reply;
        engine.environment.supervision.hears(true);
        if engine.environment.supervision.is_held() != held_before {
            engine.environment.journal.keep_warm_up();
        }
        outcome
    }

    fn new(rows: WarmUpRows, engine: &mut Engine<'_>) -> Self {
        Self {
            rows,
            tick: 0,
            ticks_per_step: engine.progress.pacer().ticks_per_step() as u64,
            // A processor that only waited is slow in its first steps: each tick does the work of one.
            scratch: match &mut *engine.side {
                Side::Structure(numerical) => numerical.scratch(),
                Side::Prescribed(_) | Side::Received(_) => None,
            },
            readiness: Readiness::default(),
        }
    }

    fn run(mut self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        engine.ports.iter_mut().for_each(Port::pause_estimates);
        engine.judge_commands()?;
        engine.perform(&mut self)?;
        engine.environment.hear_if_given_up()?;
        self.judge_readiness(engine)?;
        for port in &mut *engine.ports {
            port.begin_test();
            port.guard_mut().is_told_by_steps(true);
            // Warm-up ticks do not count, but for a specimen that has not replied yet.
            if port.exchange().has_answered() {
                port.exchange_mut().forget_stale();
                port.exchange_mut().set_holding_in_a_row(0);
            }
        }
        engine.judge_commands()
    }

    /// Says that the test may begin, or ends it. What a simulated clock shows is no time.
    fn judge_readiness(&self, engine: &mut Engine<'_>) -> Result<(), Stop> {
        let found = &self.readiness;
        if found.ticks == 0 || engine.environment.pace.is_simulated() {
            return Ok(());
        }
        let hit = self.what_is_missed_too_often(engine);
        let warm_up = WarmUpEvent {
            ticks: found.ticks,
            missed: found.missed,
            in_a_row: found.most_in_a_row,
            mean_ns: found.sum_ns / found.ticks,
            longest_ns: found.longest_ns,
        };
        engine.environment.report_now(match hit {
            None => Event::Go(warm_up),
            Some(_) => Event::NoGo(warm_up),
        });
        hit.map_or(Ok(()), |hit| Err(Stop::TestLimit(hit)))
    }

    fn what_is_missed_too_often(&self, engine: &Engine<'_>) -> Option<TestHit> {
        let (found, limits) = (&self.readiness, engine.judge.limits());
        let ticks_per_step = engine.progress.pacer().ticks_per_step();
        let steps_left = engine.plan.steps - engine.environment.place.steps_done();
        let left = steps_left as f64 * ticks_per_step;
        let [in_window, in_all] =
            [limits.window_ticks, left as u64].map(|ticks| found.expected(ticks));
        [
            (Limit::MissesInARow, found.most_in_a_row as f64),
            (Limit::MissesInWindow, in_window.min(in_all).floor()),
            (Limit::Misses, in_all.floor()),
        ]
        .map(|(quantity, value)| (quantity, value, limits.of_test(quantity).trip))
        .into_iter()
        .find(|(_, value, most)| value > most)
        .map(|(quantity, value, bound)| TestHit {
            quantity,
            value,
            bound,
            worst: None,
            in_warm_up: true,
        })
    }
}

impl Maneuver for WarmUp {
    fn next(&mut self, engine: &mut Engine<'_>) -> Result<Option<Order>, Stop> {
        if self.tick >= engine.plan.limits.warmup_ticks {
            return Ok(None);
        }
        let tick = engine.environment.place.at_rest(0.0);
        let sends = if self.tick == 0 {
            Sends::Next
        } else {
            Sends::Last
        };
        Ok(Some(Order::new(tick, sends, Kind::WarmUp(self.rows))))
    }

    fn recorded(
        &mut self,
        engine: &mut Engine<'_>,
        _: &Order,
        stamps: &mut TickStamps,
    ) -> Result<(), Stop> {
        engine.exchanges.count();
        let judged_from = engine.plan.limits.warmup_ticks / 2;
        let judged = self.tick.checked_sub(judged_from);
        self.tick += 1;
        // Judged is what the test will do: a step in one of its ticks.
        let steps = judged.is_none_or(|tick| tick.is_multiple_of(self.ticks_per_step));
        let scratch = self.scratch.as_ref().filter(|_| steps);
        if let (Side::Structure(numerical), Some(_)) = (&mut *engine.side, scratch) {
            numerical.try_step(engine.ports);
        }
        let pace = &mut engine.environment.pace;
        stamps.ready = stamps.decoded;
        stamps.pushed = pace.read();
        engine.environment.deadlines.warm_up_tick(stamps);
        // A specimen that the test commands once a step is not waited for in it.
        let waits = engine.ports.iter().any(|port| port.path().is_per_step());
        if judged.is_some() {
            let waited_ns = u64::from(waits) * stamps.decoded.since(stamps.sent);
            self.readiness.note(stamps, waited_ns);
        }
        if let (Side::Structure(numerical), Some(scratch)) = (&mut *engine.side, scratch) {
            numerical.undo(scratch);
        }
        if scratch.is_some() || waits {
            // The test will not do this: no tick is late for it.
            let now = pace.read();
            pace.skip_edges_before(now);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::time::Nanos;

    fn found(lates: impl Iterator<Item = bool>, waited_ns: u64) -> Readiness {
        let mut found = Readiness::default();
        for late in lates {
            let stamps = TickStamps {
                woke: Nanos(1000),
                pushed: Nanos(if late { 2500 } else { 1500 }),
                deadline: Nanos(2000),
                ..TickStamps::default()
            };
            found.note(&stamps, waited_ns);
        }
        found
    }

    #[test]
    fn one_late_tick_predicts_no_misses() {
        assert_eq!(found((0..100).map(|k| k < 9), 0).expected(1_000_000), 0.0);
        let always = found((0..100).map(|_| true), 0);
        assert_eq!(always.expected(1000), 700.0);
        assert_eq!((always.most_in_a_row, always.longest_ns), (100, 1500));
        let often = found((0..100).map(|k| k % 4 < 3), 0);
        assert_eq!((often.missed, often.most_in_a_row), (75, 3));
        assert_eq!(Readiness::default().expected(1000), 0.0);
        // A wait for a specimen that the test does not wait for.
        let waited = found((0..100).map(|_| true), 600);
        assert_eq!((waited.missed, waited.longest_ns), (0, 900));
    }
}
