//! Late by a period or more: the grid is stretched or caught up, or the test stops, as configured. No step is skipped, no computed
//! value changes, and every tick lost in a stall is counted.
//!
//! The simulated clock jumps where the test says: during the wait for an edge, or while a specimen answers.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::common::engine::{Run, run_on};
use crate::common::rig::{Act, Call, Log, Phase, attach_storey, two_floors};
use gusset_control::engine::{Ending, Gaps, OnMiss, Stop, TestHit};
use gusset_control::port::limits::Bound;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::substructure::{Coupling, Retirement};
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_record::Event;
use gusset_record::rt::timing::Quantity;

const STEPS: u32 = 40;
/// One tick, ns.
const T: u64 = 1_000_000;

/// Where the clock jumps, and by how much.
#[derive(Clone, Copy)]
enum Stall {
    /// In the wait for the n-th edge (from 0).
    Waiting(u64, u64),
    /// While the specimen answers command n.
    Answering(u64, u64),
}
use Stall::{Answering, Waiting};

/// A simulated clock that oversleeps.
struct Jumpy {
    clock: SimClock,
    waits: Arc<AtomicU64>,
    stalls: Vec<Stall>,
}

impl Clock for Jumpy {
    fn now(&self) -> Nanos {
        self.clock.now()
    }

    fn sleep_until(&self, at: Nanos) {
        self.clock.sleep_until(at);
        let wait = self.waits.fetch_add(1, Ordering::Relaxed);
        for stall in &self.stalls {
            if let Waiting(at, ns) = *stall
                && at == wait
            {
                self.clock.advance(ns);
            }
        }
    }
}

fn run_warm(
    warmup: u64,
    on_miss: OnMiss,
    stalls: &[Stall],
    more: impl Fn(&mut gusset_control::engine::Limits),
) -> (Run, Log) {
    let (clock, log) = (SimClock::new(), Log::default());
    let mut experiment = two_floors(STEPS, &format!("timing.warmup_ticks = {warmup}"));
    experiment.limits.on_miss = on_miss;
    more(&mut experiment.limits);
    let (present, answering) = (clock.clone(), stalls.to_vec());
    attach_storey(
        &mut experiment,
        Coupling::Lockstep,
        &log,
        move |phase, sequence| {
            for stall in &answering {
                if let Answering(at, ns) = *stall
                    && (phase, sequence) == (Phase::Collect, at)
                {
                    present.advance(ns);
                }
            }
            Act::Serve
        },
    );
    let jumpy = Jumpy {
        clock,
        waits: Arc::default(),
        stalls: stalls.to_vec(),
    };
    (run_on(experiment, jumpy), log)
}

fn run(on_miss: OnMiss, stalls: &[Stall]) -> Run {
    run_warm(0, on_miss, stalls, |_| {}).0
}

/// (tick, size, ticks by which the grid was moved) of every miss.
fn misses(run: &Run) -> Vec<(u64, u64, u64)> {
    let found = run.events.iter().filter_map(|event| match event.kind {
        Event::Miss {
            late_ns, stretched, ..
        } => Some((event.tick, late_ns, stretched)),
        _ => None,
    });
    found.collect()
}

/// Edge of every tick in periods from the first one.
fn edges(run: &Run) -> Vec<u64> {
    let edges = run.column("release_s").into_iter();
    edges.map(|s| (s * 1e9 / T as f64).round() as u64).collect()
}

/// Every step once, in order, with the numbers of a run without lateness.
fn assert_whole(run: &Run) {
    let calm = self::run(OnMiss::Stretch, &[]);
    assert!(misses(&calm).is_empty() && calm.outcome.pace.misses == 0);
    assert_eq!(run.outcome.ending, Ending::Completed);
    assert_eq!(run.rows.len(), calm.rows.len());
    for (a, b) in run.rows.iter().zip(&calm.rows) {
        for ((a, b), column) in a.iter().zip(b).zip(&run.columns) {
            assert!(
                column.timing || a.to_bits() == b.to_bits(),
                "{}",
                column.name
            );
        }
    }
}

/// The histograms of lateness must have counted the ticks that ran late and those lost in a stall.
fn assert_counted(run: &Run, swallowed: u64) {
    let counts = run.outcome.pace.timing.counts();
    assert_eq!(
        (counts.ticks, counts.swallowed),
        (u64::from(STEPS) + 1, swallowed)
    );
    for quantity in [Quantity::WakeupLateness, Quantity::CommandLateness] {
        assert_eq!(
            run.outcome.pace.timing.histogram(quantity).len(),
            counts.ticks + swallowed
        );
    }
    let missed = run.outcome.pace.timing.histogram(Quantity::Miss).len();
    assert_eq!(
        (missed, counts.misses),
        (run.outcome.pace.misses, run.outcome.pace.misses)
    );
}

/// Asleep for 3.4 periods: the tick misses its deadline by 2.4, the grid moves by 3 and the specimen sees slower time.
#[test]
fn stall_in_the_wait_moves_the_grid() {
    let run = run(OnMiss::Stretch, &[Waiting(10, 3_400_000)]);
    assert_whole(&run);
    assert_eq!(misses(&run), [(10, 2_400_000, 3)]);
    assert_eq!(
        (run.outcome.pace.misses, run.outcome.pace.stretched),
        (1, 3)
    );
    let wanted: Vec<u64> = (0..=10).chain(14..=43).collect();
    assert_eq!(edges(&run), wanted);
    assert_eq!(run.column("stretched")[9..12], [0.0, 3.0, 3.0]);
    assert_eq!(run.column("skipped_by_wakeup")[9..12], [0.0, 3.0, 0.0]);
    // A miss is known only after its tick, so the next row contains it.
    assert_eq!(run.column("misses_in_a_row")[10..13], [0.0, 1.0, 0.0]);
    assert_eq!(run.column("misses_in_total")[10..13], [0.0, 1.0, 1.0]);
    assert_counted(&run, 3);
    // 3.4 of the tick itself, then 2.4, 1.4 and 0.4 of the ticks lost in the stall (3 significant digits).
    let late = run.outcome.pace.timing.histogram(Quantity::WakeupLateness);
    for j in 0..4 {
        let middle = 400_000 + j * T;
        assert_eq!(
            late.count_between(middle - T / 10, middle + T / 10),
            1,
            "{j}"
        );
    }
    assert!((run.column("wakeup_lateness_s")[10] - 3.4e-3).abs() < 1e-12);
}

/// A stall of 2.5 periods in the answer: the next edge is 1.5 periods late, so the grid moves by one; the next tick is late by half
/// a period and keeps its edge.
#[test]
fn stall_in_the_answer_moves_the_next_edge() {
    let run = run(OnMiss::Stretch, &[Answering(30, 2_500_000)]);
    assert_whole(&run);
    assert_eq!(misses(&run), [(30, 1_500_000, 1)]);
    let wanted: Vec<u64> = (0..=30).chain(32..=41).collect();
    assert_eq!(edges(&run), wanted);
    assert_counted(&run, 1);
    assert!((run.column("wakeup_lateness_s")[31] - 0.5e-3).abs() < 1e-12);
}

/// Both in one tick add up, and two stalls in a row are two misses.
#[test]
fn several_stalls_add_up() {
    let stalls = [
        Waiting(10, 1_200_000),
        Answering(10, 2_000_000),
        Waiting(11, 5_100_000),
    ];
    let run = run(OnMiss::Stretch, &stalls);
    assert_whole(&run);
    // Tick 10 wakes 1.2 late (moved by 1), ends at 3.2, that is 1.2 after the edge at 2 (moved by 1 more).
    // Tick 11 is due at 3 and begins at 3.2; asleep until 8.3 it is 5.3 late: moved by 5.
    assert_eq!(misses(&run), [(10, 2_200_000, 2), (11, 4_300_000, 5)]);
    assert_eq!(run.outcome.pace.stretched, 7);
    assert_eq!(edges(&run)[9..14], [9, 10, 13, 19, 20]);
    assert_eq!(run.column("skipped_by_wakeup")[9..13], [0.0, 1.0, 5.0, 0.0]);
    assert_eq!(run.column("skipped_by_work")[9..13], [0.0, 0.0, 1.0, 0.0]);
    let overrun = run.column("overrun_s");
    assert!((overrun[11] - 2.2e-3).abs() < 1e-12 && overrun[12] == 0.0);
    assert_eq!(run.column("misses_in_a_row")[10..14], [0.0, 1.0, 2.0, 0.0]);
    assert_counted(&run, 7);
}

#[test]
fn short_lateness_keeps_the_next_edge() {
    let catch_up = OnMiss::CatchUp { at_most: 5 };
    for policy in [OnMiss::Stretch, catch_up, OnMiss::Stop] {
        // Late in waking, but done before its own deadline: no miss. Done after it: a counted miss, and the edge keeps its time.
        let run = run(policy, &[Waiting(10, 900_000), Answering(20, 1_900_000)]);
        assert_whole(&run);
        assert_eq!(misses(&run), [(20, 900_000, 0)], "{policy:?}");
        assert!(edges(&run).into_iter().eq(0..=u64::from(STEPS)));
        assert_counted(&run, 0);
    }
}

/// 3.4 periods late with the grid kept: ticks 10, 11 and 12 end after their deadlines, 13 does not.
#[test]
fn catching_up_runs_missed_ticks_at_once() {
    let run = run(OnMiss::CatchUp { at_most: 5 }, &[Waiting(10, 3_400_000)]);
    assert_whole(&run);
    assert_eq!(
        misses(&run),
        [(10, 2_400_000, 0), (11, 1_400_000, 0), (12, 400_000, 0)]
    );
    assert!(edges(&run).into_iter().eq(0..=u64::from(STEPS)));
    assert_eq!(
        (run.outcome.pace.misses, run.outcome.pace.stretched),
        (3, 0)
    );
    assert_counted(&run, 0);
}

/// 20.5 periods late, at most 5 back to back: the grid moves by 15, the other five are made up for.
#[test]
fn catching_up_is_bounded() {
    let run = run(OnMiss::CatchUp { at_most: 5 }, &[Waiting(10, 20_500_000)]);
    assert_whole(&run);
    let sizes: Vec<(u64, u64)> = misses(&run).iter().map(|m| (m.0, m.1)).collect();
    let wanted = [
        (10, 19_500_000),
        (11, 3_500_000),
        (12, 2_500_000),
        (13, 1_500_000),
        (14, 500_000),
    ];
    assert_eq!(sizes, wanted);
    assert_eq!(run.outcome.pace.stretched, 15);
    let wanted: Vec<u64> = (0..=10).chain(26..=55).collect();
    assert_eq!(edges(&run), wanted);
    assert_counted(&run, 15);
}

#[test]
fn stopping_ends_the_test_and_retires() {
    for stall in [Waiting(10, 1_200_000), Answering(10, 2_200_000)] {
        let (run, log) = run_warm(0, OnMiss::Stop, &[stall], |_| {});
        let Ending::Stopped(Stop::Late {
            total: 1,
            in_a_row: 1,
            late_ns,
        }) = run.outcome.ending
        else {
            panic!("{:?}", run.outcome.ending);
        };
        assert_eq!(misses(&run), [(10, late_ns, 0)]);
        // The tick in which it showed is whole; the next one is not begun.
        assert_eq!((run.outcome.steps, run.rows.len()), (10, 11));
        let calls = log.lock().unwrap();
        assert_eq!(calls.last(), Some(&(0, Call::Retire(Retirement::Tripped))));
        assert!(
            !calls
                .iter()
                .any(|c| matches!(c.1, Call::Issue { sequence: 11.., .. }))
        );
    }
}

#[test]
fn misses_have_bounds_in_a_row_and_in_all() {
    let every: Vec<Stall> = (10..16).map(|at| Answering(at, 1_100_000)).collect();
    let apart: Vec<Stall> = (5..15).map(|at| Answering(2 * at, 1_100_000)).collect();
    let run = |stalls: &[Stall], in_a_row, in_total| {
        let bounds = |limits: &mut gusset_control::engine::Limits| {
            for (limit, most) in [(Limit::MissesInARow, in_a_row), (Limit::Misses, in_total)] {
                limits.test.set(limit, Bound::trip(most));
            }
        };
        run_warm(0, OnMiss::Stretch, stalls, bounds).0
    };
    let ending =
        |stalls: &[Stall], in_a_row, in_total| run(stalls, in_a_row, in_total).outcome.ending;
    let trip = |run: &Run| match run.events.iter().rev().find_map(|event| match &event.kind {
        Event::LimitTrip(reached) => {
            Some((reached.limit.to_string(), reached.value, reached.bound))
        }
        _ => None,
    }) {
        Some(trip) => trip,
        None => panic!("no event says what tripped"),
    };
    let late = |found| match found {
        Ending::Stopped(Stop::Late {
            total, in_a_row, ..
        }) => (total, in_a_row),
        other => panic!("{other:?}"),
    };
    assert_eq!(late(ending(&every, 3.0, 100.0)), (4, 4));
    assert_eq!(ending(&apart, 3.0, 100.0), Ending::Completed);
    assert_eq!(late(ending(&apart, 3.0, 6.0)), (7, 1));
    let in_a_row = trip(&run(&every, 3.0, 100.0));
    assert_eq!(in_a_row, ("max_consecutive_misses".to_owned(), 4.0, 3.0));
    let in_all = trip(&run(&apart, 3.0, 6.0));
    assert_eq!(in_all, ("max_total_misses".to_owned(), 7.0, 6.0));
}

#[test]
fn misses_in_a_row_warn_once_each_time() {
    let stalls = [10, 11, 12, 20, 21, 22].map(|at| Answering(at, 1_100_000));
    let levels = |limits: &mut gusset_control::engine::Limits| {
        let mut levels = limits.test.of_test(Limit::MissesInARow);
        levels.warn = 1.0;
        limits.test.set(Limit::MissesInARow, levels);
    };
    let (run, _) = run_warm(0, OnMiss::Stretch, &stalls, levels);
    assert_eq!(run.outcome.ending, Ending::Completed);
    let warned = run.events.iter().filter_map(|event| match &event.kind {
        Event::LimitWarning(reached) if reached.limit == "max_consecutive_misses" => {
            Some((event.tick, reached.value))
        }
        _ => None,
    });
    assert_eq!(warned.collect::<Vec<_>>(), [(11, 2.0), (21, 2.0)]);
}

/// A loop that cannot keep its ticks when it is warm would not keep them in the test: it does not begin.
#[test]
fn warm_up_with_misses_ends_before_the_test() {
    const WARMUP: u64 = 60;
    let late = |which: &dyn Fn(u64) -> bool| {
        let stalls: Vec<Stall> = (0..WARMUP)
            .filter(|k| which(*k))
            .map(|k| Answering(k, 1_100_000))
            .collect();
        let bounds = |limits: &mut gusset_control::engine::Limits| {
            for (limit, most) in [(Limit::MissesInARow, 10.0), (Limit::Misses, 20.0)] {
                limits.test.set(limit, Bound::trip(most));
            }
        };
        let (run, log) = run_warm(WARMUP, OnMiss::Stretch, &stalls, bounds);
        let told = run.events.iter().find_map(|event| match event.kind {
            Event::Go(found) => Some((true, found.ticks, found.missed, found.in_a_row)),
            Event::NoGo(found) => Some((false, found.ticks, found.missed, found.in_a_row)),
            _ => None,
        });
        let went = log
            .lock()
            .unwrap()
            .iter()
            .any(|call| matches!(call.1, Call::Issue { sequence, .. } if sequence >= WARMUP));
        let started = run.events.iter().any(|e| e.kind == Event::Started);
        assert_eq!((went, started), (told.unwrap().0, told.unwrap().0));
        (run.outcome.ending, told.unwrap())
    };
    let of = |quantity, value, bound| {
        Ending::Stopped(Stop::TestLimit(TestHit {
            quantity,
            value,
            bound,
            worst: None,
            in_warm_up: true,
        }))
    };
    let (ending, told) = late(&|_| true);
    assert_eq!(ending, of(Limit::MissesInARow, 30.0, 10.0));
    assert_eq!(told, (false, 30, 30, 30));
    let Ending::Stopped(stop) = ending else {
        unreachable!()
    };
    assert!(
        stop.to_string().contains("max_consecutive_misses"),
        "{stop}"
    );
    // 24 of 30, of which 24 − 3 √24 are no chance: in 41 ticks 12 at least.
    let (ending, told) = late(&|k| k % 5 != 0);
    assert_eq!((ending, told), (Ending::Completed, (true, 30, 24, 4)));
    let cold = late(&|k| k < WARMUP / 2);
    assert_eq!(cold, (Ending::Completed, (true, 30, 0, 0)));
    let hiccup = late(&|k| (40..50).contains(&k));
    assert_eq!(hiccup, (Ending::Completed, (true, 30, 10, 10)));
    let longer = late(&|k| (40..51).contains(&k));
    assert_eq!(longer.0, of(Limit::MissesInARow, 11.0, 10.0));
}

/// Before t = 0 nothing is integrated. A stall there moves the grid, whatever the policy, and is no miss. The first command of the
/// test leaves at its own edge, never in a burst.
#[test]
fn stall_in_warm_up_is_no_miss_and_no_burst() {
    for policy in [
        OnMiss::Stretch,
        OnMiss::CatchUp { at_most: 5 },
        OnMiss::Stop,
    ] {
        for stall in [
            Waiting(1, 7_300_000),
            Waiting(3, 7_300_000),
            Answering(3, 7_300_000),
        ] {
            let (run, _) = run_warm(4, policy, &[stall], |_| {});
            assert_eq!(run.outcome.ending, Ending::Completed);
            assert!(misses(&run).is_empty(), "{:?}", misses(&run));
            assert_eq!(
                (run.outcome.pace.misses, run.outcome.pace.stretched),
                (0, 0)
            );
            assert!(edges(&run).into_iter().eq(0..=u64::from(STEPS)));
            assert!(
                run.column("wakeup_lateness_s")
                    .iter()
                    .all(|late| *late == 0.0)
            );
            assert_counted(&run, 0);
        }
    }
}

/// A clock that advances by a microsecond whenever it is read, and only then.
struct Reluctant(SimClock);

impl Clock for Reluctant {
    fn now(&self) -> Nanos {
        self.0.advance(1_000);
        self.0.now()
    }

    fn sleep_until(&self, at: Nanos) {
        self.0.sleep_until(at);
    }
}

/// Between the ready command and the recorded row the clock is read once: the next row contains that reading.
#[test]
fn next_row_has_the_time_to_record_a_tick() {
    let clock = SimClock::new();
    let run = run_on(
        two_floors(STEPS, "timing.warmup_ticks = 3"),
        Reluctant(clock),
    );
    let record = run.column("record_before_s");
    assert_eq!(record.len(), STEPS as usize + 1);
    assert!(record[0].is_nan());
    for (k, seconds) in record.iter().enumerate().skip(1) {
        assert!((seconds - 1e-6).abs() < 1e-12, "row {k}: {seconds}");
    }
    let column = run.columns.iter().find(|c| c.name == "record_before_s");
    let column = column.unwrap();
    assert_eq!((column.unit.as_str(), column.timing), ("s", true));
}

/// Before the test no tick is missed, but a quarter of a second without a command is reported; a few ticks are not.
#[test]
fn pause_before_the_test_is_a_reported_gap() {
    let stalls = [Waiting(3, 250 * T), Waiting(6, 50 * T)];
    let (run, _) = run_warm(20, OnMiss::Stretch, &stalls, |_| {});
    assert_eq!(run.outcome.ending, Ending::Completed);
    let gaps: Vec<Event> = (run.events.iter())
        .map(|event| event.kind.clone())
        .filter(|kind| matches!(kind, Event::Gap { .. }))
        .collect();
    let gap = Event::Gap {
        late_ns: 250 * T,
        ticks: 249,
    };
    assert_eq!(gaps, [gap]);
    let longest_ns = 250 * T;
    assert_eq!(
        run.outcome.pace.gaps,
        Gaps {
            times: 1,
            longest_ns
        }
    );
    assert_eq!(
        (run.outcome.pace.misses, run.outcome.pace.stretched),
        (0, 0)
    );
}
