//! Whatever ends a test, every specimen is retired once and gets no command after that. While the test runs, the order of the calls
//! is: issue to all, collect from all, accept.

use crate::common::engine::{Run, prepare, run_on, run_under};
use crate::common::rig::{
    self, Act, Call, Log, Phase, attach, attach_of, attach_storey, storey, two_floors,
};
use gusset_control::engine::{Control, EndPosition, Ending, Experiment, Operator, Stop};
use gusset_control::port::{Axis, Exit};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::{Coupling, LinkFault, Retirement, Status};
use gusset_quantity::time::SimClock;
use gusset_record::{Event, RunFolder};
use gusset_session::{self as session, Watches};

const STEPS: u32 = 12;
/// Warm-up and a static load, so that faults before t = 0 are covered.
const BEFORE: &str = "structure.static_load_n = [100.0, 50.0]\ntiming.warmup_ticks = 3";

/// The two floors with their startup; the static load comes in few parts.
fn floors() -> Experiment {
    let mut experiment = two_floors(STEPS, BEFORE);
    experiment.settling.as_mut().unwrap().parts = 2;
    experiment
}

/// Runs with two rigs, of which rig `faulty` does what `act` returns.
fn run_with(
    faulty: usize,
    act: impl Fn(Phase, u64) -> Act + Send + Clone + 'static,
) -> (Run, Vec<(usize, Call)>) {
    let log = Log::default();
    let mut experiment = floors();
    for number in 0..2 {
        let act = act.clone();
        attach_storey(
            &mut experiment,
            Coupling::Lockstep,
            &log,
            move |phase, sequence| {
                if number == faulty {
                    act(phase, sequence)
                } else {
                    Act::Serve
                }
            },
        );
    }
    let run = run_on(experiment, SimClock::new());
    let calls = log.lock().unwrap().clone();
    (run, calls)
}

/// Both rigs were retired in this way, as their last call, and never received a command that is not finite.
fn assert_retired(calls: &[(usize, Call)], how: Retirement) {
    for rig in 0..2 {
        let own: Vec<Call> = calls.iter().filter(|c| c.0 == rig).map(|c| c.1).collect();
        let retired = own.iter().filter(|call| matches!(call, Call::Retire(_)));
        assert_eq!(retired.count(), 1, "{own:?}");
        assert_eq!(own.last(), Some(&Call::Retire(how)));
        for call in own {
            if let Call::Issue { disp, vel, .. } = call {
                assert!(disp.is_finite() && vel.is_finite());
            }
        }
    }
}

/// Sequence numbers of the commands that were issued, and of those accepted, in a run without faults.
fn clean() -> (u64, Vec<u64>) {
    let (run, calls) = run_with(0, |_, _| Act::Serve);
    assert_eq!(run.outcome.ending, Ending::Completed);
    assert_eq!(run.column("x1").len(), STEPS as usize + 1);
    assert_retired(&calls, Retirement::Orderly);
    let of_first = |pick: fn(Call) -> Option<u64>| {
        let calls = calls.iter().filter(|c| c.0 == 0);
        calls.filter_map(|c| pick(c.1)).collect::<Vec<_>>()
    };
    let issued = of_first(|call| match call {
        Call::Issue { sequence, .. } => Some(sequence),
        _ => None,
    });
    let accepted = of_first(|call| match call {
        Call::Accepted(sequence) => Some(sequence),
        _ => None,
    });
    // Numbered from 0 without a gap; all accepted but the three of the warm-up, which move nothing.
    assert!(issued.iter().copied().eq(0..issued.len() as u64));
    assert_eq!(accepted.len(), issued.len() - 3);
    (issued.len() as u64, accepted)
}

#[test]
fn loop_issues_then_collects_then_accepts() {
    let (_, calls) = run_with(0, |_, _| Act::Serve);
    let kinds: Vec<(usize, char)> = calls
        .iter()
        .map(|(rig, call)| match call {
            Call::Issue { .. } => (*rig, 'i'),
            Call::Collect { .. } => (*rig, 'c'),
            Call::Accepted(_) => (*rig, 'a'),
            Call::Retire(_) => (*rig, 'r'),
        })
        .collect();
    let exchange = [(0, 'i'), (1, 'i'), (0, 'c'), (1, 'c')];
    let mut rest = kinds.as_slice();
    let mut held = 0;
    while let Some(after) = rest.strip_prefix(&exchange) {
        rest = match after.strip_prefix(&[(0, 'a'), (1, 'a')]) {
            Some(accepted) => accepted,
            None => {
                held += 1;
                after
            }
        };
    }
    assert_eq!((rest, held), (&[(0, 'r'), (1, 'r')][..], 3));
}

#[test]
fn link_failure_at_any_call_retires_all() {
    let faults = [
        LinkFault::Closed,
        LinkFault::Timeout,
        LinkFault::Malformed,
        LinkFault::Refused,
        LinkFault::Backpressure,
    ];
    let (issued, accepted) = clean();
    for phase in [Phase::Issue, Phase::Collect, Phase::Accepted] {
        for at in 0..issued {
            if phase == Phase::Accepted && !accepted.contains(&at) {
                continue;
            }
            for faulty in 0..2 {
                let fault = faults[at as usize % faults.len()];
                let (run, calls) = run_with(faulty, move |now, sequence| {
                    if (now, sequence) == (phase, at) {
                        Act::Fail(fault)
                    } else {
                        Act::Serve
                    }
                });
                let wanted = Ending::Stopped(Stop::Link {
                    port: faulty,
                    fault,
                });
                assert_eq!(run.outcome.ending, wanted, "{phase:?} {at}");
                assert_retired(&calls, Retirement::Tripped);
                assert_nothing_after(&calls, faulty, phase, at);
                // Its position follows from whether its last command has left.
                let status = run.all(&format!("status_{}", faulty + 1));
                let unsent = status
                    .last()
                    .map(|status| Status(*status as u32).has(Status::UNSENT));
                assert_eq!(unsent, Some(phase == Phase::Issue), "{phase:?} {at}");
                // Only steps that were closed have rows.
                let rows = run.column("x1").len() as u64;
                assert_eq!(rows, (at + STEPS as u64 + 1).saturating_sub(issued));
                assert_eq!(run.outcome.steps, rows.saturating_sub(1));
            }
        }
    }
}

/// After the call that failed the loop only retires the specimens, once those with a pending command have answered.
fn assert_nothing_after(calls: &[(usize, Call)], faulty: usize, phase: Phase, at: u64) {
    let mut sequence = None;
    let failed = calls.iter().position(|(rig, call)| {
        if let (true, Call::Issue { sequence: now, .. }) = (*rig == faulty, call) {
            sequence = Some(*now);
        }
        let is_phase = match call {
            Call::Issue { .. } => phase == Phase::Issue,
            Call::Collect { .. } => phase == Phase::Collect,
            Call::Accepted(_) => phase == Phase::Accepted,
            Call::Retire(_) => phase == Phase::Retire,
        };
        *rig == faulty && is_phase && sequence == Some(at)
    });
    let mut after = &calls[failed.unwrap() + 1..];
    let answers = |call: &(usize, Call)| call.0 != faulty && matches!(call.1, Call::Collect { .. });
    while phase != Phase::Accepted && after.first().is_some_and(answers) {
        after = &after[1..];
    }
    assert!(
        after
            .iter()
            .all(|(_, call)| matches!(call, Call::Retire(_))),
        "{after:?}"
    );
}

#[test]
fn nonfinite_force_is_a_fault_of_its_link() {
    let (issued, _) = clean();
    for at in 0..issued {
        for (faulty, force) in [(0, f64::NAN), (1, f64::INFINITY)] {
            let (run, calls) = run_with(faulty, move |phase, sequence| {
                if (phase, sequence) == (Phase::Collect, at) {
                    Act::Force(force)
                } else {
                    Act::Serve
                }
            });
            let fault = LinkFault::NotFinite;
            assert_eq!(
                run.outcome.ending,
                Ending::Stopped(Stop::Link {
                    port: faulty,
                    fault
                })
            );
            assert_retired(&calls, Retirement::Tripped);
            assert_nothing_after(&calls, faulty, Phase::Collect, at);
        }
    }
}

/// A finite force so large that the next command overflows or is out of bounds: no such command leaves.
#[test]
fn overflowing_response_is_never_sent() {
    let (issued, _) = clean();
    let first = issued - STEPS as u64 - 1;
    for step in 0..STEPS as u64 {
        let act = move |phase, sequence| {
            let hit = (phase, sequence) == (Phase::Collect, first + step);
            if hit { Act::Force(1.7e308) } else { Act::Serve }
        };
        let log = Log::default();
        let mut experiment = floors();
        attach_storey(&mut experiment, Coupling::Lockstep, &log, act);
        attach_storey(&mut experiment, Coupling::Lockstep, &log, |_, _| Act::Serve);
        experiment.limits.divergence = 1.0;
        let run = run_on(experiment, SimClock::new());
        let Ending::Stopped(Stop::Diverged {
            dof: 0,
            value,
            bound: 1.0,
        }) = run.outcome.ending
        else {
            panic!("{:?}", run.outcome.ending);
        };
        assert!(value < -1.0);
        let calls = log.lock().unwrap().clone();
        assert_retired(&calls, Retirement::Tripped);
        // The record contains the row of the step that overflowed, and after it that of the step that diverged.
        let rows = run.column("x1").len() as u64;
        assert_eq!((run.outcome.steps, rows), (step, step + 1));
        assert_eq!(run.all("x1").last(), Some(&value));
        assert_eq!(
            run.all("state").last(),
            Some(&gusset_control::engine::Phase::Tripped.code())
        );
        for (_, call) in calls {
            assert!(!matches!(call, Call::Issue { disp, .. } if disp.abs() > 1.0));
        }
    }
}

/// Where the specimen's own units overflow before the structure does. On the last step nothing is left to be sent.
#[test]
fn a_command_that_is_no_number_is_not_sent() {
    for step in 0..=STEPS {
        let log = Log::default();
        let mut experiment = two_floors(STEPS, "timing.warmup_ticks = 0");
        experiment.limits.divergence = f64::MAX;
        let hit = u64::from(step);
        attach_storey(
            &mut experiment,
            Coupling::Lockstep,
            &log,
            move |phase, sequence| {
                if (phase, sequence) == (Phase::Collect, hit) {
                    Act::Force(-1e306)
                } else {
                    Act::Serve
                }
            },
        );
        let mut axis = Axis::plain(vec![(1, 1.0)]);
        axis.disp_gain = 1e18;
        attach(&mut experiment, axis, Coupling::Lockstep, &log, |_, _| {
            Act::Force(0.0)
        });
        let run = run_on(experiment, SimClock::new());
        let calls = log.lock().unwrap().clone();
        if step == STEPS {
            assert_eq!(run.outcome.ending, Ending::Completed);
            assert_retired(&calls, Retirement::Orderly);
        } else {
            assert_eq!(
                run.outcome.ending,
                Ending::Stopped(Stop::NotFinite { port: 1 }),
                "{step}"
            );
            assert_retired(&calls, Retirement::Tripped);
            assert_eq!(run.outcome.steps, hit);
            // It is reported as the trip of the limit of that command.
            let told = run.events.iter().any(|event| {
                matches!(&event.kind, Event::LimitTrip(reached) if reached.port == Some(1) && !reached.value.is_finite())
            });
            assert!(told, "{:?}", run.events);
        }
    }
}

#[test]
fn stop_at_any_tick_ends_cleanly() {
    let (issued, _) = clean();
    for at in 0..issued {
        let log = Log::default();
        let (ask, requests) = crossbeam_channel::bounded(1);
        let mut experiment = floors();
        attach_storey(
            &mut experiment,
            Coupling::Lockstep,
            &log,
            move |phase, sequence| {
                if (phase, sequence) == (Phase::Issue, at) {
                    ask.send(Operator::Stop).unwrap();
                }
                Act::Serve
            },
        );
        attach_storey(&mut experiment, Coupling::Lockstep, &log, |_, _| Act::Serve);
        let run = run_under(experiment, SimClock::new(), &Control::from(requests));
        let calls = log.lock().unwrap().clone();
        let (wanted, how) = if at + 1 == issued {
            (Ending::Completed, Retirement::Orderly)
        } else {
            (Ending::Stopped(Stop::Operator), Retirement::Operator)
        };
        assert_retired(&calls, how);
        // Polled once a tick: the tick in which it came is finished, the next one does not begin.
        let sent = calls
            .iter()
            .filter(|c| matches!(c, (0, Call::Issue { .. })))
            .count() as u64;
        assert_eq!(sent, at + 1);
        assert_eq!(run.outcome.ending, wanted);
    }
}

/// The link is lost after the test, but during the shutdown: the test failed, and no specimen moves any more.
#[test]
fn link_failure_in_shutdown_fails_the_test() {
    let log = Log::default();
    let mut experiment = two_floors(STEPS, "timing.warmup_ticks = 3");
    for number in 0..2 {
        let act = move |phase, sequence| {
            if (number, phase, sequence) == (1, Phase::Collect, u64::from(STEPS) + 3 + 10) {
                Act::Fail(LinkFault::Closed)
            } else {
                Act::Serve
            }
        };
        let mut spec = rig::spec(number, storey(number), Coupling::Lockstep, &log, act);
        spec.exits.at_end = Exit::ZeroDisp;
        spec.exits.speed = 1e-6;
        experiment.ports.push(spec.build().unwrap());
    }
    let run = run_on(experiment, SimClock::new());
    let lost = Stop::Link {
        port: 1,
        fault: LinkFault::Closed,
    };
    assert_eq!(run.outcome.ending, Ending::Stopped(lost));
    assert_retired(&log.lock().unwrap(), Retirement::Tripped);
    assert_eq!(
        run.outcome.left,
        [EndPosition::NotReached(None), EndPosition::Lost]
    );
    assert_eq!(session::ending(&run.outcome).0, Cause::Link);
    let told = run.events.iter().any(|event| {
        let kind = &event.kind;
        matches!(kind, Event::Link { port: 1, .. })
    });
    assert!(told);
}

/// A panic in the loop is caught and named, and all specimens are retired, also after one that panics in its own retirement.
#[test]
fn a_panic_in_the_loop_retires_all() {
    for at in [0, 5, 9] {
        let log = Log::default();
        let mut prepared = prepare(
            "timing.warmup_ticks = 0\n[time]\nrate_hz = 1000\nduration_s = 0.012\nclock = \"simulated\"\n\
             [structure.shear_building]\nmass_kg = [2e3, 2e3]\nstiffness_n_per_m = [3e5, 3e5]\n",
        );
        let mut experiment = two_floors(STEPS, "timing.warmup_ticks = 0");
        attach_storey(&mut experiment, Coupling::Lockstep, &log, |phase, _| {
            assert!(phase != Phase::Retire, "no final message");
            Act::Serve
        });
        attach_storey(
            &mut experiment,
            Coupling::Lockstep,
            &log,
            move |phase, sequence| {
                assert!((phase, sequence) != (Phase::Collect, at), "out of order");
                Act::Serve
            },
        );
        let place = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(&place.path().join("run")).unwrap();
        prepared.experiment = experiment;
        let requests = crossbeam_channel::never();
        let finished =
            session::run(prepared, folder, requests, Watches::default(), &mut |_| {}).unwrap();
        assert_eq!(finished.cause, Cause::Internal);
        assert!(
            finished.summary.reason.contains("of order"),
            "{}",
            finished.summary.reason
        );
        assert_retired(&log.lock().unwrap(), Retirement::Tripped);
    }
}

#[test]
fn row_beyond_the_structure_is_refused() {
    let log = Log::default();
    let mut experiment = floors();
    for number in 0..2 {
        let act = |_, _| Act::Serve;
        let axis = storey(number);
        attach(&mut experiment, axis, Coupling::Lockstep, &log, act);
    }
    // A specimen of another structure: it hangs on the eighth of two degrees of freedom.
    let axis = Axis::plain(vec![(0, 1.0), (7, 1.0)]);
    let coupling = Coupling::Lockstep;
    attach_of(&mut experiment, (axis, 8), coupling, &log, |_, _| {
        Act::Serve
    });
    let run = run_on(experiment, SimClock::new());
    let not_finite = Ending::Stopped(Stop::NotFinite { port: 2 });
    assert_eq!(run.outcome.ending, not_finite);
    let calls = log.lock().unwrap().clone();
    assert_retired(&calls, Retirement::Tripped);
    let issued = calls.iter().filter(|(rig, call)| {
        let is_issue = matches!(call, Call::Issue { .. });
        *rig == 2 && is_issue
    });
    assert_eq!(issued.count(), 0);
}
