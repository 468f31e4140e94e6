//! A specimen with its own clock may be late. Its measurement is held or extrapolated, a bounded number of times in a row, each
//! time with a report. A late reply never replaces a newer one.

use std::collections::BTreeMap;

use crate::common::engine::{Run, run_on};
use crate::common::rig::{
    self, Act, Call, Log, Phase, STIFFNESS, attach_storey, storey, two_floors,
};
use gusset_control::engine::{EndPosition, Ending, Phase as Ended, Stop};
use gusset_control::port::{Exit, Exits, Pace, WiringCheck, Zero};
use gusset_quantity::substructure::{Coupling, Retirement, Status};
use gusset_quantity::time::{Clock, SimClock};
use gusset_record::Event;

const STEPS: u32 = 40;

/// One sampled rig in storey 1 that serves but for the commands in `script`; without warm-up, so that command k is step k.
fn run(script: &[(u64, Act)], extrapolate: bool, bound: u64) -> (Run, Vec<(usize, Call)>) {
    let script: BTreeMap<u64, Act> = script.iter().copied().collect();
    let log = Log::default();
    let mut experiment = two_floors(STEPS, "timing.warmup_ticks = 0");
    experiment.limits.extrapolate_stale = extrapolate;
    experiment.limits.stale_in_a_row = bound;
    attach_storey(
        &mut experiment,
        Coupling::Sampled,
        &log,
        move |phase, sequence| match script.get(&sequence) {
            Some(act) if phase == Phase::Collect => *act,
            _ => Act::Serve,
        },
    );
    let run = run_on(experiment, SimClock::new());
    let calls = log.lock().unwrap().clone();
    (run, calls)
}

/// Tick and age of every stale measurement.
fn stale(run: &Run) -> Vec<(u64, u64)> {
    let found = run.events.iter().filter_map(|event| match event.kind {
        Event::Stale { port: 0, age } => Some((event.tick, age)),
        _ => None,
    });
    found.collect()
}

const GAPS: [(u64, Act); 4] = [
    (7, Act::Miss),
    (20, Act::Miss),
    (21, Act::Miss),
    (22, Act::Miss),
];

#[test]
fn missing_measurement_is_held_and_reported() {
    let (run, _) = run(&GAPS, false, 10);
    assert_eq!(run.outcome.ending, Ending::Completed);
    assert_eq!(stale(&run), [(7, 1), (20, 1), (21, 2), (22, 3)]);
    let (force, target) = (run.column("force_1_1"), run.column("target_1_1"));
    let (measured, sequence) = (run.column("meas_1_1"), run.column("seq_1"));
    for step in 0..=STEPS as usize {
        let of = match step {
            7 => 6,
            20..=22 => 19,
            step => step,
        };
        assert_eq!(force[step], STIFFNESS * target[of], "{step}");
        assert_eq!((measured[step], sequence[step]), (target[of], of as f64));
    }
    let (name, _, link) = &run.outcome.ports[0];
    assert_eq!(
        (name.as_str(), link.sent, link.received, link.stale),
        ("rig-1", 41, 37, 4)
    );
}

/// Along the tangent from the measured displacement to the commanded one: for a spring this is exact, except for the roundoff of an
/// estimate from differences.
#[test]
fn missing_measurement_is_extrapolated() {
    let (run, _) = run(&GAPS, true, 10);
    assert_eq!(stale(&run).len(), 4);
    let (force, target) = (run.column("force_1_1"), run.column("target_1_1"));
    for (force, target) in force.iter().zip(&target) {
        assert!((force - STIFFNESS * target).abs() <= 1e-9 * force.abs());
    }
    // The raw column keeps the raw value.
    assert_eq!(run.column("raw_force_1_1")[22], STIFFNESS * target[19]);
}

/// At the peak of the force the answer stays away: the loop extrapolates to a force above all measured ones.
#[test]
fn an_estimate_is_no_peak() {
    let (whole, _) = run(&[], true, 10);
    let force = whole.column("force_1_1");
    let largest = |force: &[f64]| force.iter().fold(0.0f64, |most, f| most.max(f.abs()));
    assert_eq!(whole.outcome.ports[0].1, [largest(&force)]);
    let peak = force.iter().position(|f| f.abs() == largest(&force));
    let peak = peak.unwrap() as u64;
    let (run, _) = run(&[(peak, Act::Miss)], true, 10);
    let (force, status) = (run.column("force_1_1"), run.column("status_1"));
    assert!(status[peak as usize] >= 262_144.0);
    let answered: Vec<f64> = force
        .iter()
        .zip(&status)
        .filter(|(_, s)| **s < 262_144.0)
        .map(|(f, _)| *f)
        .collect();
    assert!(largest(&answered) < largest(&force));
    assert_eq!(run.outcome.ports[0].1, [largest(&answered)]);
}

#[test]
fn more_in_a_row_than_allowed_end_the_test() {
    let three: Vec<_> = (20..23).map(|at| (at, Act::Miss)).collect();
    let (kept, _) = run(&three, false, 3);
    assert_eq!(kept.outcome.ending, Ending::Completed);
    let (stopped, calls) = run(&three, false, 2);
    let wanted = Stop::Stale { port: 0, ticks: 3 };
    assert_eq!(stopped.outcome.ending, Ending::Stopped(wanted));
    assert_eq!(calls.last(), Some(&(0, Call::Retire(Retirement::Tripped))));
    // Its row is that of its step, which has one tick.
    let [step, sub_tick, state] = ["step", "sub_tick", "state"].map(|name| stopped.all(name));
    let row = state
        .iter()
        .position(|s| *s == Ended::Tripped.code())
        .unwrap();
    assert_eq!((step[row], sub_tick[row]), (22.0, 0.0));
    assert!(
        !calls
            .iter()
            .any(|c| matches!(c.1, Call::Issue { sequence: 23.., .. }))
    );
    // A fresh one in between restarts the count.
    let apart = [
        (20, Act::Miss),
        (21, Act::Miss),
        (23, Act::Miss),
        (24, Act::Miss),
    ];
    assert_eq!(run(&apart, false, 2).0.outcome.ending, Ending::Completed);
}

/// Ticks that report that a specimen holds by its own watchdog.
fn holds(run: &Run) -> Vec<u64> {
    let told = run.events.iter();
    let told = told.filter(|event| event.kind == Event::SpecimenHolds { port: 0 });
    told.map(|event| event.tick).collect()
}

/// After a pause of the commands its watchdog has stopped it: its first answers report this once more.
#[test]
fn holding_specimen_is_reported() {
    let at = |held: &[u64]| -> Vec<_> { held.iter().map(|at| (*at, Act::Holds)).collect() };
    let (kept, _) = run(&at(&[7, 20, 21]), false, 2);
    assert_eq!(kept.outcome.ending, Ending::Completed);
    assert_eq!(holds(&kept), [7, 20]);
    assert_eq!(kept.outcome.ports[0].2.holds, 2);
    assert!(kept.column("status_1")[20] == 2.0 && kept.column("status_1")[22] == 0.0);
    // A stale answer in between reports nothing new.
    for stale in [Act::Miss, Act::MissSays(Status::HOLDING)] {
        ends_at_the_third(&[at(&[20, 21, 23, 24]), vec![(22, stale)]].concat());
    }
}

fn ends_at_the_third(script: &[(u64, Act)]) {
    let (stopped, calls) = run(script, false, 2);
    let wanted = Stop::HoldsOn {
        port: 0,
        answers: 3,
    };
    assert_eq!(stopped.outcome.ending, Ending::Stopped(wanted));
    assert_eq!(holds(&stopped), [20]);
    let last = stopped.events.iter().map(|event| &event.kind);
    assert!(
        last.clone()
            .any(|kind| *kind == Event::SpecimenHoldsOn { port: 0 })
    );
    assert!(
        !calls
            .iter()
            .any(|c| matches!(c.1, Call::Issue { sequence: 24.., .. })),
        "no command after that"
    );
    assert_eq!(stopped.outcome.steps, 22, "and not before");
}

/// Its heartbeat reports it, too.
#[test]
fn status_counts_when_the_answer_is_late() {
    for (status, stop) in [
        (Status::INTERLOCK, Stop::Interlock { port: 0 }),
        (Status::SATURATED, Stop::Saturated { port: 0 }),
    ] {
        let (run, calls) = run(&[(20, Act::MissSays(status))], false, 10);
        assert_eq!(run.outcome.ending, Ending::Stopped(stop));
        let issued = |call: &(usize, Call)| matches!(call.1, Call::Issue { sequence: 21.., .. });
        assert!(!calls.iter().any(issued), "no command after that");
    }
}

/// A specimen that no longer answers, or whose answers have no value, gets no more commands. The others still move to their end
/// positions.
#[test]
fn silent_specimen_stays_others_return() {
    for (ill, last) in [(Act::Miss, 22), (Act::Saturated, 20)] {
        for port in 0..2 {
            let log = Log::default();
            let mut experiment = two_floors(STEPS, "timing.warmup_ticks = 0");
            experiment.limits.stale_in_a_row = 2;
            for number in 0..2 {
                let act = move |phase, sequence| match phase {
                    Phase::Collect if number == port && sequence >= 20 => ill,
                    _ => Act::Serve,
                };
                let exits = Exits {
                    on_trip: Exit::ZeroDisp,
                    speed: 0.05,
                    ..Exits::default()
                };
                rig::attach_leaving(&mut experiment, storey(number), exits, &log, act);
            }
            let run = run_on(experiment, SimClock::new());
            let wanted = match ill {
                Act::Miss => Stop::Stale { port, ticks: 3 },
                _ => Stop::Saturated { port },
            };
            assert_eq!(run.outcome.ending, Ending::Stopped(wanted));
            assert_eq!(run.outcome.unfinished, None);
            let mut left = [EndPosition::Reached; 2];
            left[port] = EndPosition::NotReached(None);
            assert_eq!(run.outcome.left, left);
            let told = |rig: usize| -> Vec<(u64, f64)> {
                let calls = log.lock().unwrap();
                let issued = calls.iter().filter_map(|call| match *call {
                    (of, Call::Issue { sequence, disp, .. }) if of == rig => Some((sequence, disp)),
                    _ => None,
                });
                issued.collect()
            };
            let (of_ill, of_other) = (told(port), told(1 - port));
            assert_eq!(of_ill.last().unwrap().0, last, "no command after the trip");
            assert_eq!(of_other.last().unwrap().1, 0.0);
            // The cause of the end and its consequences are reported at the tick of the cause.
            let (tick, time) = (last, last as f64 * 1e-3);
            let follows = run.events.iter().skip_while(|event| event.tick < tick);
            let mut follows = follows.peekable();
            assert!(follows.peek().is_some());
            assert!(follows.all(|event| (event.tick, event.time) == (tick, time)));
        }
    }
}

/// Reply 20 is lost, reply 21 is there, and at 22 reply 20 arrives, marked as fresh, with a force that would throw the structure
/// out. It changes nothing, and the measurement of 22 counts as missing.
#[test]
fn a_late_reply_never_replaces_a_newer_one() {
    let late = [(20, Act::Miss), (22, Act::Late(2))];
    let (run, _) = run(&late, false, 10);
    assert_eq!(run.outcome.ending, Ending::Completed);
    assert_eq!(stale(&run), [(20, 1), (22, 1)]);
    let (force, target) = (run.column("force_1_1"), run.column("target_1_1"));
    assert_eq!(force[20], STIFFNESS * target[19]);
    assert_eq!(force[21], STIFFNESS * target[21]);
    assert_eq!(force[22], STIFFNESS * target[21]);
    assert_eq!(force[23], STIFFNESS * target[23]);
    assert_eq!(run.column("seq_1")[20..24], [19.0, 21.0, 21.0, 23.0]);
}

/// The deadline of a reply is within the tick: after the command, before the next edge, with time for the remaining work.
#[test]
fn sampled_specimen_has_until_the_next_edge() {
    let clock = SimClock::new();
    let log = Log::default();
    let mut experiment = two_floors(STEPS, "timing.warmup_ticks = 2");
    let present = clock.clone();
    let edges = Log::default();
    let noted = edges.clone();
    attach_storey(&mut experiment, Coupling::Sampled, &log, move |phase, _| {
        if phase == Phase::Issue {
            let deadline = present.now();
            noted.lock().unwrap().push((0, Call::Collect { deadline }));
        }
        Act::Serve
    });
    run_on(experiment, clock);
    let deadlines = |log: &Log| -> Vec<u64> {
        let calls = log.lock().unwrap();
        let found = calls.iter().filter_map(|call| match call.1 {
            Call::Collect { deadline } => Some(deadline.0),
            _ => None,
        });
        found.collect()
    };
    let (edges, deadlines) = (deadlines(&edges), deadlines(&log));
    assert_eq!((edges.len(), deadlines.len()), (43, 43));
    for (edge, deadline) in edges.iter().zip(&deadlines) {
        assert_eq!(deadline - edge, 875_000, "7/8 of a tick of 1 ms");
    }
}

/// A rig whose first `lost` answers are missing, under a constant 30 kN, with these ticks of zeroing and of warm-up.
fn begins_late(zero_ticks: u32, warmup_ticks: u64, lost: u64) -> (Run, usize) {
    let log = Log::default();
    let mut experiment = two_floors(STEPS, "");
    experiment.opening.zero_ticks = zero_ticks;
    experiment.limits.warmup_ticks = warmup_ticks;
    experiment.limits.stale_in_a_row = 10;
    let act = move |phase, sequence| match phase {
        Phase::Collect if sequence < lost => Act::Miss,
        _ => Act::Force(3e4),
    };
    let mut spec = rig::spec(0, storey(0), Coupling::Sampled, &log, act);
    spec.axes[0].reference.force = Zero::Relative;
    experiment.ports.push(spec.build().unwrap());
    let run = run_on(experiment, SimClock::new());
    let calls = log.lock().unwrap();
    let issued = calls
        .iter()
        .filter(|call| matches!(call.1, Call::Issue { .. }));
    (run, issued.count())
}

#[test]
fn zero_uses_the_configured_answers() {
    for lost in [0, 1, 8] {
        let (run, issued) = begins_late(20, 3, lost);
        assert_eq!(run.outcome.ending, Ending::Completed, "{lost}");
        let zeroed = run.events.iter().find_map(|event| match event.kind {
            Event::Zeroed {
                disp,
                force,
                disp_noise_rms,
                force_noise_rms,
                ..
            } => Some([disp, force, disp_noise_rms, force_noise_rms]),
            _ => None,
        });
        assert_eq!(zeroed, Some([0.0, 3e4, 0.0, 0.0]), "{lost}");
        assert!(run.column("force_1_1").iter().all(|force| *force == 0.0));
        assert_eq!(issued as u64, 20 + lost + 3 + u64::from(STEPS) + 1);
    }
    // Not for ever.
    let (run, _) = begins_late(20, 3, 11);
    let wanted = Stop::Stale { port: 0, ticks: 11 };
    assert_eq!(run.outcome.ending, Ending::Stopped(wanted));
}

/// Without a reading before the test, a specimen that has not answered yet does not enter equilibrium with a force of zero.
#[test]
fn nothing_is_integrated_before_an_answer() {
    for (warmup_ticks, lost) in [(1, 9), (1, 2), (0, 1)] {
        let (run, _) = begins_late(0, warmup_ticks, lost);
        let ticks = warmup_ticks + 1;
        let wanted = Stop::Stale { port: 0, ticks };
        assert_eq!(run.outcome.ending, Ending::Stopped(wanted), "{lost}");
        assert!(run.column("x1").is_empty());
    }
    // It is time enough with the first step.
    let (run, _) = begins_late(0, 9, 9);
    assert_eq!(run.outcome.ending, Ending::Completed);
}

/// No answers arrive from the middle of the loading half until half of the readings at its top are over: those are taken later.
#[test]
fn wiring_check_uses_the_right_answers() {
    let amplitude = 1e-3;
    let pace = Pace {
        ramp: 10,
        hold: 16,
        period_ns: 1_000_000,
    };
    let probed = |lost: std::ops::Range<u64>| {
        let log = Log::default();
        let mut experiment = two_floors(STEPS, "timing.warmup_ticks = 3");
        experiment.limits.stale_in_a_row = 20;
        attach_storey(
            &mut experiment,
            Coupling::Sampled,
            &log,
            move |phase, sequence| match phase {
                Phase::Collect if lost.contains(&sequence) => Act::Miss,
                _ => Act::Serve,
            },
        );
        *experiment.ports[0].startup_mut().wiring_mut() = WiringCheck::Probe {
            amplitude: vec![amplitude],
            stiffness: vec![STIFFNESS],
            accepted: None,
            pace,
            units: Vec::new(),
        };
        let run = run_on(experiment, SimClock::new());
        assert_eq!(run.outcome.ending, Ending::Completed);
        let found = run.events.iter().find_map(|event| match event.kind {
            Event::Direction { disp, force, .. } => Some([disp, force]),
            _ => None,
        });
        (found, run.rows.len())
    };
    let (whole, rows) = probed(0..0);
    let [disp, force] = whole.unwrap();
    assert!((disp - amplitude).abs() < 1e-15 && (force - STIFFNESS * amplitude).abs() < 1e-9);
    // The readings at the top begin with command 16 + 10 + 8.
    assert_eq!(probed(21..38), (whole, rows + 4));
}
