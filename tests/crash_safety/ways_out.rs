//! Every ending retires the specimens in one place: over real links and after a panic on the loop's thread, too.

use crate::common::test_file::TestFile;
use std::path::Path;

use gusset_control::engine::{Control, Ending, Operator};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::{Coupling, LinkFault};
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_record::RunFolder;
use gusset_record::summary::Status;
use gusset_session::{self as session, Watches};

use crate::common::engine::{prepare, run_on};
use crate::common::rig::{Act, Log, Phase, attach_storey, two_floors};
use crate::link_common::{ONE_AXIS, ONE_AXIS_LAW, Served, linked, test_file, write};

const STEPS: u32 = 60;

/// How a test is ended.
#[derive(Debug, Clone, Copy)]
enum Way {
    LastStep,
    Operator,
    Limit,
    Divergence,
    OtherLink,
    Panic,
    PanicOfLastWords,
}

/// Runs a test with a specimen behind a real link, and beside it a rig of ours that misbehaves.
fn leave(
    folder: &Path,
    number: usize,
    address: &str,
    transport: &str,
    way: Way,
) -> session::Finished {
    let text = linked(
        STEPS,
        address,
        &format!("transport = \"{transport}\"\nprobe = \"none\"\n"),
    );
    let text = text.with(match way {
        Way::Limit => "specimen.limits.command_disp_m.trip = [-1e-4, 1e-4]",
        Way::Divergence => "safety.divergence_m = 1e-4",
        _ => "",
    });
    let file = write(folder, &format!("{number}.toml"), &text);
    let loaded = gusset_config::load(&file, &[]).unwrap_or_else(|error| panic!("{error}"));
    let mut test = gusset_setup::build(&loaded).unwrap_or_else(|error| panic!("{error}"));
    attach_storey(
        &mut test.experiment,
        Coupling::Lockstep,
        &Log::default(),
        move |phase, sequence| match (way, phase) {
            (Way::OtherLink, Phase::Collect) if sequence == 20 => Act::Fail(LinkFault::Closed),
            (Way::Panic | Way::PanicOfLastWords, Phase::Collect) if sequence == 20 => {
                panic!("the bug of command 20")
            }
            (Way::PanicOfLastWords, Phase::Retire) => panic!("the bug at the goodbye"),
            _ => Act::Serve,
        },
    );
    // The rig is first in the list to be retired, so that its retirement comes before the others'.
    test.experiment.ports.reverse();
    test.facts.specimens.push("rig".into());
    let (says, requests) = crossbeam_channel::bounded(1);
    if matches!(way, Way::Operator) {
        says.send(Operator::Stop).unwrap();
    }
    let run = RunFolder::create(&folder.join(format!("run-{number}"))).unwrap();
    session::run(
        test,
        run,
        Control::from(requests),
        Watches::default(),
        &mut |_| {},
    )
    .unwrap()
}

#[test]
fn every_ending_says_goodbye_on_every_link() {
    let ways = [
        (
            Way::LastStep,
            Cause::Done,
            Status::Completed,
            "at the end of the test",
        ),
        (
            Way::Operator,
            Cause::Operator,
            Status::Interrupted,
            "by the operator",
        ),
        (
            Way::Limit,
            Cause::Limit,
            Status::Stopped,
            "because the test tripped",
        ),
        (
            Way::Divergence,
            Cause::Diverged,
            Status::Stopped,
            "because the test tripped",
        ),
        (
            Way::OtherLink,
            Cause::Link,
            Status::Failed,
            "because the test tripped",
        ),
        (
            Way::Panic,
            Cause::Internal,
            Status::Failed,
            "because the test tripped",
        ),
        (
            Way::PanicOfLastWords,
            Cause::Internal,
            Status::Failed,
            "because the test tripped",
        ),
    ];
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let law = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
        let served = Served::start(folder.path(), &law, &["--transport", transport]);
        for (number, (way, cause, status, words)) in ways.into_iter().enumerate() {
            let finished = leave(folder.path(), number, &served.address, transport, way);
            let reason = &finished.summary.reason;
            assert_eq!(finished.cause, cause, "{way:?}: {reason}");
            assert_eq!(finished.summary.status, status, "{way:?}");
            let over = served.hears("test over");
            assert!(
                over.contains(&format!("retired {words}")),
                "{transport} {way:?}: {over}"
            );
            assert!(over.contains("stays where"), "{over}");
        }
    }
}

/// A clock whose readings jump by up to an hour, forwards and back, while the test waits.
struct Jumping {
    clock: SimClock,
    waits: std::cell::Cell<u64>,
    offset: std::cell::Cell<i64>,
}

const SECOND: i64 = 1_000_000_000;
/// Waits before which it jumps, and by how much. Time is never before the beginning.
const JUMPS: [(u64, i64); 6] = [
    (3, 5 * SECOND),
    (9, -3 * SECOND),
    (15, 3600 * SECOND),
    (22, -1800 * SECOND),
    (23, 1),
    (30, -1),
];

impl Jumping {
    fn shifted(&self, time: u64) -> u64 {
        time.saturating_add_signed(self.offset.get())
    }
}

impl Clock for Jumping {
    fn now(&self) -> Nanos {
        let Nanos(now) = self.clock.now();
        Nanos(self.shifted(now))
    }

    fn sleep_until(&self, at: Nanos) {
        let wait = self.waits.get();
        self.waits.set(wait + 1);
        for (when, jump) in JUMPS {
            if when == wait {
                self.offset.set(self.offset.get() + jump);
            }
        }
        let Nanos(at) = at;
        let target = at.saturating_add_signed(-self.offset.get());
        self.clock.sleep_until(Nanos(target));
    }
}

#[test]
fn clock_jump_costs_no_step() {
    let test = || {
        two_floors(
            80,
            "[timing]\nwarmup_ticks = 2\nmisses.in_total.trip = 1000\n",
        )
    };
    let smooth = run_on(test(), SimClock::new());
    let clock = Jumping {
        clock: SimClock::new(),
        waits: 0.into(),
        offset: 0.into(),
    };
    let jumped = run_on(test(), clock);
    for run in [&smooth, &jumped] {
        assert_eq!(run.outcome.ending, Ending::Completed);
    }
    for (index, column) in smooth.columns.iter().enumerate() {
        if !column.timing {
            let of = |rows: &[Vec<f64>]| {
                rows.iter()
                    .map(|row| row[index].to_bits())
                    .collect::<Vec<_>>()
            };
            assert_eq!(of(&smooth.rows), of(&jumped.rows), "{}", column.name);
        }
    }
    // Both jumps forwards are late edges; the loop waits after the jump backwards.
    assert!(
        (2..=4).contains(&jumped.outcome.pace.misses),
        "{}",
        jumped.outcome.pace.misses
    );
    assert!(
        jumped.outcome.pace.stretched >= 3_600_000,
        "{}",
        jumped.outcome.pace.stretched
    );
}

/// To retire the test only the list of specimens is needed, whatever the state of the engine's other parts.
#[test]
fn panic_at_any_command_keeps_every_row() {
    for at in [0, 7, 30] {
        let mut test = prepare(
            "timing.warmup_ticks = 0\n[time]\nrate_hz = 1000\nduration_s = 0.05\nclock = \"simulated\"\n\
             [structure.shear_building]\nmass_kg = [2e3, 2e3]\nstiffness_n_per_m = [3e5, 3e5]\n",
        );
        let mut experiment = two_floors(50, "timing.warmup_ticks = 0");
        attach_storey(
            &mut experiment,
            Coupling::Lockstep,
            &Log::default(),
            move |phase, sequence| {
                assert!(
                    (phase, sequence) != (Phase::Issue, at),
                    "in the middle of a send"
                );
                Act::Serve
            },
        );
        test.experiment = experiment;
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::create(&folder.path().join("run")).unwrap();
        let requests = crossbeam_channel::never();
        let finished = session::run(test, run, requests, Watches::default(), &mut |_| {}).unwrap();
        assert_eq!(finished.cause, Cause::Internal);
        assert_eq!(finished.recorded.rows_written, at);
        assert_eq!(finished.summary.steps, at.saturating_sub(1));
        assert!(finished.summary.reason.contains("a send"));
    }
}
