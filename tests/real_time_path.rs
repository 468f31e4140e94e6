//! From the first tick to the last the loop's thread allocates nothing and makes no system call but its clock's.
//!
//! A separate binary: it starts itself as a child process, and a system-call filter kills that process.
//!
//! Allocations: a run that the operator ends at the first tick is subtracted from a whole one, on this thread; the difference
//! happened between the two hooks. System calls: a child process runs the loop under a seccomp filter that allows two calls and
//! kills the process at any other. A second child that makes one more call must die, so the filter works.

mod common;

use common::test_file::TestFile;
use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use common::engine::prepare;
use common::rig::{Act, Log, Phase, attach, storey};
use gusset_control::engine::{Connected, Control, Ending, Experiment, OnMiss, Operator};
use gusset_control::port::limits::Bound;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::substructure::Coupling;
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_record::rt::clock::MonotonicClock;
use gusset_record::{RingReader, RingSize, WhenFull, ring};
use seccompiler::{BpfProgram, SeccompAction, SeccompFilter};

const FRAME: &str = r#"
    [time]
    rate_hz = 1000
    duration_s = 2.5
    [structure]
    static_load_n = [10e3, 0, 5e3]
    [structure.shear_building]
    mass_kg = [20e3, 20e3, 18e3]
    stiffness_n_per_m = [0, 14e6, 11e6]
    [structure.damping.rayleigh_ratio]
    ratio = 0.02
    first_hz = 1
    second_hz = 6
    [[structure.element]]
    from = 1
    to = 2
    law = { bouc_wen = { stiffness_n_per_m = 9e6, yield_force_n = 60e3, post_yield_ratio = 0.08, beta = 0.55,
            gamma = 0.45, exponent = 1.6, hardening_ratio = 1.3, degradation = { strength = 0.02 },
            pinching = { total_slip = 0.8, slope = 0.1, initiation = 0.2, magnitude = 0.2, rate = 0.01, severity = 0.4 } } }
    [excitation.ground_acceleration.signal.sine]
    amplitude = 4
    frequency_hz = 1.5
    [[specimen]]
    name = "columns"
    storey = 1
    law = { bouc_wen = { stiffness_n_per_m = 15e6, yield_force_n = 120e3, post_yield_ratio = 0.08, beta = 0.55,
            gamma = 0.45, exponent = 1.6 } }
    [[specimen]]
    name = "dampers"
    rows = [[0, -1, 1], [0, 0, 1]]
    laws = [ { power_damper = { force_at_unit_velocity_n = 2e5, exponent = 0.4, linear_below_m_per_s = 0.01 } },
             { parallel = [ { smooth_friction = { slip_force_n = 1e3, reference_velocity_m_per_s = 0.05 } },
                            { gap = { stiffness_n_per_m = 1e6, gap_m = 0.01, side = "both" } } ] } ]
"#;

const PRESCRIBED: &str = r#"
    [time]
    rate_hz = 1000
    duration_s = 2.5
    [[specimen]]
    name = "brace"
    law = { bilinear = { stiffness_n_per_m = 2e6, yield_force_n = 6e3, post_yield_ratio = 0.1 } }
    [[excitation.prescribed_displacement]]
    specimen = "brace"
    ease_in_s = 0.5
    signal = { sine = { amplitude = 10, unit = "mm", frequency_hz = 2.0 } }
"#;

/// A drive and a sensor on simulated devices.
#[cfg(feature = "ethercat")]
const ON_BUS: &str = r#"
    [time]
    rate_hz = 1000
    duration_s = 1
    clock = "simulated"
    [structure.shear_building]
    mass_kg = [20e3, 18e3]
    stiffness_n_per_m = [0, 12e6]
    [excitation.ground_acceleration.signal.sine]
    amplitude = 1
    frequency_hz = 1.5
    [bus.rig]
    interface = "none"
    [[bus.rig.device]]
    name = "cell"
    product = { vendor = 2, code = 7 }
    inputs = ["6000:01 u16 state", "6000:11 f64 force"]
    [[bus.rig.device]]
    name = "axis 1"
    product = { vendor = 2, code = 9 }
    outputs = ["6040:00 u16", "607a:00 i32"]
    inputs = ["6041:00 u16", "6064:00 i32"]
    [[specimen]]
    name = "storey"
    storey = 1
    stiffness_n_per_m = 10e6
    law.linear.stiffness_n_per_m = 10e6
    [specimen.limits]
    command_disp_m = { trip = [-0.05, 0.05] }
    command_accel_m_per_s2 = { trip = 40 }
    measured_force_n = { trip = [-5e5, 5e5] }
    [specimen.bus]
    bus = "rig"
    probe = "none"
    [[specimen.bus.axis]]
    drive = { device = "axis 1", m_per_count = 1e-7 }
    force = { at = "cell.force", n_per_count = 1.0 }
"#;

/// The rig is on a bus of simulated devices.
#[cfg(feature = "ethercat")]
fn on_bus() -> Experiment {
    let mut experiment = prepare(ON_BUS).experiment;
    for port in &mut experiment.ports {
        port.connect().unwrap();
    }
    experiment
}

/// Masses that are coupled, and a chain whose links leap far: the factors that the frame does not use.
fn others() -> [(&'static str, String); 4] {
    // Every mass coupled to every other, every spring to every other: 1/(1 + |i − j|), and more on the diagonal.
    let full = |unit: f64| {
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => 40.0 * unit,
            apart => unit / (1.0 + apart as f64),
        };
        let row = |i| (0..40).map(|j| entry(i, j)).collect::<Vec<f64>>();
        (0..40).map(row).collect::<Vec<_>>()
    };
    let matrices = format!(
        "[time]\nrate_hz = 1000\nduration_s = 2.5\n[structure.matrices]\nmass = {:?}\nstiffness = {:?}\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 4\nfrequency_hz = 1.5\n",
        full(100.0),
        full(1e4)
    );
    let chain = |links: &str| {
        format!(
            "[time]\nrate_hz = 1000\nduration_s = 2.1\n[integrator]\nlambda = 4\n\
             [structure.chain]\ndofs = 600\nmass_kg = 150\nstiffness_n_per_m = 2.5e5\ndamping_n_s_per_m = 10\n\
             {links}\n[excitation.base_displacement.signal.sine]\namplitude = 0.1\nfrequency_hz = 1\n"
        )
    };
    let leaps: String = (1..600)
        .step_by(3)
        .filter_map(|from| {
            let to = 1 + from * 359 % 600;
            (from != to).then(|| {
                format!(
                    "[[structure.element]]\nfrom = {from}\nto = {to}\n\
                 law = {{ linear = {{ stiffness_n_per_m = 1e4 }} }}\n"
                )
            })
        })
        .collect();
    let unit = "[time]\nrate_hz = 1000\nduration_s = 2.1\n[structure.matrices]\n\
        mass = [[2e3, 0, 0], [0, 2e3, 0], [0, 0, 300]]\nstiffness = [[3e5, 0, 1e5], [0, 8e5, 0], [1e5, 0, 4e5]]\n\
        influence = [1, 0, 0]\n[excitation.ground_acceleration.signal.sine]\namplitude = 2\nfrequency_hz = 1.5\n\
        [[specimen]]\nname = \"column\"\nrows = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n\
        law.bilinear = { stiffness_n_per_m = 4e5, yield_force_n = 1e3, post_yield_ratio = 0.1 }\n\
        geometry.plane = [ { base_m = [-1.6, 0.1], joint_m = [-0.4, 0.15] }, { base_m = [-0.5, -1.2], joint_m = [-0.5, -0.1] }, \
        { base_m = [0.6, -1.3], joint_m = [0.5, -0.1] } ]\n";
    [
        ("dense", matrices),
        ("banded", unit.to_owned()),
        ("tridiagonal, in segments", chain("")),
        ("sparse", chain(&leaps)),
    ]
}

/// A simulated clock that oversleeps by 2.5 ms before every 100th edge.
struct Jumpy(SimClock, std::sync::atomic::AtomicU64);

impl Clock for Jumpy {
    fn now(&self) -> Nanos {
        self.0.now()
    }
    fn sleep_until(&self, at: Nanos) {
        self.0.sleep_until(at);
        if self.1.fetch_add(1, Ordering::Relaxed) % 100 == 99 {
            self.0.advance(2_500_000);
        }
    }
}

/// Rows and events enough for every run here.
fn recorder(experiment: &Experiment) -> (gusset_record::RingRecorder, RingReader) {
    let size = RingSize {
        rows: 4096,
        events: 1024,
    };
    ring(experiment.columns().len(), size, WhenFull::Drop).unwrap()
}

/// Allocations and bytes allocated in a run that ends at its first tick if `at_once`.
fn cost(experiment: Experiment, clock: Box<dyn Clock>, at_once: bool) -> (u64, u64) {
    let steps = experiment.steps;
    let (recorder, mut reader) = recorder(&experiment);
    let (ask, requests) = crossbeam_channel::bounded(1);
    let control = Control::from(requests);
    let before = move || {
        if at_once {
            ask.try_send(Operator::Stop).unwrap();
        }
    };
    let test =
        Connected::new(experiment, clock, Box::new(recorder)).watched(Some(Box::new(before)), None);
    let mut ending = None;
    let counted = allocation_counter::measure(|| {
        let outcome = test.run(&control).into_outcome();
        ending = Some((outcome.ending, outcome.rows_lost, outcome.events_lost));
    });
    let mut rows = 0;
    while let Some((_, row)) = reader.row() {
        rows += u64::from(row[2] == gusset_control::engine::Phase::Running.code());
    }
    if at_once {
        assert_eq!(
            (ending.unwrap().0, rows),
            (Ending::Stopped(gusset_control::engine::Stop::Operator), 0)
        );
    } else {
        assert_eq!(
            (ending.unwrap(), rows),
            ((Ending::Completed, 0, 0), steps + 1)
        );
        assert!(steps >= 2000);
    }
    (counted.count_total, counted.bytes_total)
}

#[test]
fn no_tick_allocates_whatever_the_structure() {
    let frame = [
        ("tridiagonal", FRAME.to_owned()),
        ("", PRESCRIBED.to_owned()),
    ];
    for (storage, text) in frame.into_iter().chain(others()) {
        let facts = prepare(&text).facts;
        let found = facts
            .structure
            .and_then(|structure| structure.storage)
            .unwrap_or_default();
        assert_eq!(found, storage);
        let once = cost(prepare(&text).experiment, Box::new(SimClock::new()), true);
        let whole = cost(prepare(&text).experiment, Box::new(SimClock::new()), false);
        assert_eq!(whole, once, "{text}");
    }
}

/// Misses, stretches, stale data and the events about them are on the path too.
#[test]
fn late_or_stale_tick_does_not_allocate() {
    let experiment = || {
        let mut experiment = prepare(FRAME).experiment;
        experiment.limits.on_miss = OnMiss::Stretch;
        experiment.limits.extrapolate_stale = true;
        let log = Log::default();
        // The log itself must not grow: each entry of a rig is removed at once.
        let own = log.clone();
        own.lock().unwrap().reserve(64);
        attach(
            &mut experiment,
            storey(1),
            Coupling::Sampled,
            &log,
            move |phase, sequence| {
                own.lock().unwrap().clear();
                if phase == Phase::Collect && sequence % 50 == 49 {
                    Act::Miss
                } else {
                    Act::Serve
                }
            },
        );
        experiment
    };
    let clock = || Box::new(Jumpy(SimClock::new(), Default::default()));
    let once = cost(experiment(), clock(), true);
    let whole = cost(experiment(), clock(), false);
    assert_eq!(whole, once);
}

/// Names the run that the child must make.
const CHILD: &str = "GUSSET_TEST_SECCOMP_CHILD";
/// The child could not install the filter.
const NOT_PERMITTED: i32 = 77;
/// The child lost rows, or its loop ended where it should not.
const WRONG: i32 = 3;
const TICKS: usize = 1001;

fn spawn_child(mode: &str) -> ExitStatus {
    let this = std::env::current_exe().unwrap();
    Command::new(this)
        .args(["--exact", "in_the_child", "--ignored", "--nocapture"])
        .env(CHILD, mode)
        .output()
        .unwrap()
        .status
}

#[test]
#[expect(clippy::disallowed_macros, reason = "a skipped test must be reported")]
fn ticks_make_only_the_clocks_system_calls() {
    let quiet = spawn_child("quiet");
    #[cfg(feature = "ethercat")]
    assert_eq!(spawn_child("bus"), quiet);
    if quiet.code() == Some(NOT_PERMITTED) {
        eprintln!(
            "SKIPPED: seccomp is not permitted here; system calls of the loop are NOT checked"
        );
        return;
    }
    assert_eq!((quiet.code(), quiet.signal()), (Some(0), None));
    // One getpid in 1001 ticks, and the guard bites.
    let chatty = spawn_child("chatty");
    assert_eq!((chatty.code(), chatty.signal()), (None, Some(libc::SIGSYS)));
}

/// No separate test: the children run this.
#[test]
#[ignore = "run by ticks_make_only_the_clocks_system_calls in separate processes"]
fn in_the_child() {
    let Ok(mode) = std::env::var(CHILD) else {
        return;
    };
    #[cfg(feature = "ethercat")]
    if mode == "bus" {
        return guarded(on_bus(), Box::new(SimClock::new()));
    }
    // The static load comes in few exchanges: the extra call is in the test.
    let short = FRAME.with("time.duration_s = 1\nsafety.ramp_s = 0");
    let mut experiment = prepare(&short).experiment;
    // The machine may be busy: lateness is not what this is about.
    for limit in [Limit::MissesInARow, Limit::Misses] {
        experiment.limits.test.set(limit, Bound::NONE);
    }
    // Both use this rig, except for the chatty one's extra call.
    let log = Log::default();
    log.lock().unwrap().reserve(1 << 16);
    attach(
        &mut experiment,
        storey(1),
        Coupling::Lockstep,
        &log,
        move |phase, sequence| {
            if mode == "chatty" && (phase, sequence) == (Phase::Collect, 900) {
                std::hint::black_box(rustix::process::getpid());
            }
            Act::Serve
        },
    );
    guarded(experiment, Box::new(MonotonicClock::new(60_000)));
}

/// Runs this test under the filter, and ends the process.
fn guarded(experiment: Experiment, clock: Box<dyn Clock>) {
    let (recorder, mut reader) = recorder(&experiment);
    let done = Arc::new(AtomicBool::new(false));
    let flag = done.clone();
    let thread = std::thread::spawn(move || {
        let filter = clock_calls_only();
        let before = move || {
            if seccompiler::apply_filter(&filter).is_err() {
                std::process::exit(NOT_PERMITTED);
            }
        };
        // Not one call more, not even to end: the other thread ends the process.
        let after = move || {
            flag.store(true, Ordering::Release);
            loop {
                std::hint::spin_loop();
            }
        };
        Connected::new(experiment, clock, Box::new(recorder))
            .watched(Some(Box::new(before)), Some(Box::new(after)))
            .run(&Control::from(crossbeam_channel::never()));
    });
    while !done.load(Ordering::Acquire) {
        if thread.is_finished() {
            std::process::exit(WRONG);
        }
        std::thread::yield_now();
    }
    let mut rows = 0;
    while let Some((_, row)) = reader.row() {
        rows += usize::from(row[2] == gusset_control::engine::Phase::Running.code());
    }
    std::process::exit(if rows == TICKS { 0 } else { WRONG });
}

/// Kills the process at any call but the clock's two. (Where the kernel's shared page serves the time, one of them is
/// never made.)
fn clock_calls_only() -> BpfProgram {
    let allowed = [libc::SYS_clock_nanosleep, libc::SYS_clock_gettime];
    let rules: BTreeMap<_, _> = allowed.into_iter().map(|call| (call, vec![])).collect();
    let arch = std::env::consts::ARCH.try_into().unwrap();
    let filter = SeccompFilter::new(
        rules,
        SeccompAction::KillProcess,
        SeccompAction::Allow,
        arch,
    )
    .unwrap();
    filter.try_into().unwrap()
}
