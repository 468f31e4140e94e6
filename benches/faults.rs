//! Steps per core-second of a hybrid test in the virtual laboratory.
//!
//! Run with `cargo bench --bench faults`. Three DOFs, one Bouc-Wen specimen, simulated clock, one thread; seconds are this thread's
//! processor time. Timed: the whole loop (integration, every limit, estimates, audit, timing books), and the record of each tick
//! with its checksum in memory, as in `samples.bin`. With the wire also the frames of our protocol, encoded, checked and decoded at
//! both ends, the server with its own limits and watchdog, and the faults. Not timed: reading the test file, building the
//! experiment, the handshake, and the memory that the first of five runs requests from the system. The reference is the same test
//! with its specimen in process, which no link can beat.

#![allow(clippy::disallowed_macros, reason = "a bench prints its result")]

use std::path::Path;
use std::sync::{Arc, Mutex};

use gusset_actuator::specimen::SpecimenLaw;
use gusset_config as config;
use gusset_config::LimitsSpec;
use gusset_config::fault_script::Script;
use gusset_control::engine::{Connected, Control, Ending};
use gusset_link::server::{Host, Simulated};
use gusset_link::{NativeSetup, Transport};
use gusset_numerics::law::LawSpec;
use gusset_quantity::time::SimClock;
use gusset_record::{FolderImage, Recorder, TimedEvent};
use gusset_setup as setup;

const TEST: &str = r#"
title = "virtual laboratory"
[time]
rate_hz = 1024
duration_s = 200
[structure.shear_building]
mass_kg = [20e3, 20e3, 18e3]
stiffness_n_per_m = [0, 14e6, 11e6]
[integrator]
lambda = 2
[excitation.ground_acceleration.signal.sine]
amplitude = 1.5
frequency_hz = 1.5
[[specimen]]
name = "columns"
storey = 1
stiffness_n_per_m = 15e6
[specimen.limits]
command_disp_m = { trip = [-0.05, 0.05] }
command_vel_m_per_s = { trip = 2.0 }
command_accel_m_per_s2 = { trip = 1e4 }
measured_disp_m = { trip = [-0.05, 0.05] }
measured_force_n = { trip = [-300e3, 300e3] }
following_error_m = { trip = 0.02 }
force_step_n = { trip = 240e3 }
stuck_ticks = { trip = 60 }
stuck_travel_m = 0.01
added_energy_j = { trip = 1e5 }
alternating_ticks = { trip = 50 }
"#;

const LAW: &str = "bouc_wen = { stiffness_n_per_m = 15e6, yield_force_n = 120e3, post_yield_ratio = 0.1, beta = 0.5, gamma = 0.5, \
                   exponent = 2 }";

const LINK: &str = r#"
[specimen.link]
address = "rig:1"
connect_timeout_s = 1
reply_timeout_s = 1
transport = "udp"
on_stale = "hold"
max_stale = 12
"#;

/// On both ways frames are lost, late, jittered, doubled and bent, all the time.
const FAULTS: &str = r#"
title = "a bad network"
seed = 20261121
[[fault]]
probability = 0.02
kind = "lost"
[[fault]]
probability = 0.02
on = "commands"
kind = "lost"
[[fault]]
probability = 0.05
kind.late = { ticks = 1.2 }
[[fault]]
kind.jitter = { ticks = 0.5 }
[[fault]]
probability = 0.02
kind.duplicated = { times = 1 }
[[fault]]
probability = 0.01
kind.corrupted = { bits = 3 }
"#;

/// Samples and events in memory; the test has the same one.
#[derive(Clone)]
struct Kept(Arc<Mutex<FolderImage>>);

impl Recorder for Kept {
    fn row(&mut self, row: &[f64]) -> bool {
        self.0.lock().is_ok_and(|mut image| image.row(row))
    }

    fn event(&mut self, event: TimedEvent) -> bool {
        self.0.lock().is_ok_and(|mut image| image.event(event))
    }
}

fn host(setup: &NativeSetup, script: Option<Script>) -> Host {
    let spec: LawSpec = toml::from_str(LAW).expect("a law");
    let build = move || {
        let law = SpecimenLaw::Law(spec.clone()).build(1);
        law.map_err(|error| error.to_string())
    };
    let own: LimitsSpec =
        toml::from_str("command_disp_m = { trip = [-0.06, 0.06] }").expect("limits");
    let host =
        Host::new("columns".to_owned(), setup.axes.clone(), Box::new(build)).expect("a host");
    let host = host.limited(vec![own]);
    match script {
        Some(script) => host.faulty(script).expect("a script"),
        None => host,
    }
}

/// How the specimen is reached.
#[derive(Clone, Copy, PartialEq)]
enum Reached {
    InProcess,
    PerfectWire,
    BadNetwork,
}

struct Found {
    steps: u64,
    seconds: f64,
    stale: u64,
    bytes: usize,
}

/// `memory` is that of the run before, as a campaign uses it again.
fn run(reached: Reached, memory: &mut Vec<u8>) -> Found {
    let tail = match reached {
        Reached::InProcess => format!("[specimen.law]\n{LAW}\n"),
        _ => LINK.to_owned(),
    };
    let text = format!("{TEST}{tail}");
    let loaded = config::parse(Path::new("faults.toml"), text, &[]).expect("a valid test");
    let clock = SimClock::new();
    let of_wire = clock.clone();
    let delay_ns = (0.05e9 * loaded.time.period.value()) as u64;
    let mut dial = |setup: &NativeSetup| -> Box<dyn Transport> {
        let script = (reached == Reached::BadNetwork)
            .then(|| toml::from_str::<Script>(FAULTS).expect("a script"));
        let host = host(setup, script);
        Box::new(Simulated::new(host, of_wire.clone(), delay_ns, false, None))
    };
    let test = setup::build_over(&loaded, &mut dial).expect("a test that can be built");
    let mut experiment = test.experiment;
    for port in &mut experiment.ports {
        port.connect().expect("a far end");
    }
    let columns = experiment.columns().len();
    let image = FolderImage::into_memory(std::mem::take(memory), columns, test.facts.specimens);
    let kept = Kept(Arc::new(Mutex::new(image)));
    let recorder = Box::new(kept.clone());
    let test = Connected::new(experiment, Box::new(clock), recorder);
    let began = cpu_s();
    let outcome = test
        .run(&Control::from(crossbeam_channel::never()))
        .into_outcome();
    let seconds = cpu_s() - began;
    assert_eq!(
        outcome.ending,
        Ending::Completed,
        "{:?}",
        outcome.complaints
    );
    assert_eq!(outcome.rows_lost, 0, "every row is kept");
    let image = Arc::into_inner(kept.0).and_then(|image| image.into_inner().ok());
    *memory = image.map(FolderImage::into_samples).unwrap_or_default();
    let bytes = memory.len();
    Found {
        steps: outcome.steps + 1,
        seconds,
        stale: outcome.ports.iter().map(|(_, _, count)| count.stale).sum(),
        bytes,
    }
}

/// Time that this thread has had on a processor, s: what others do on the machine does not count.
fn cpu_s() -> f64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

fn main() {
    println!(
        "3 DOFs, Bouc-Wen specimen, every limit on, every tick recorded in memory; best of five\n\n\
         {:<44}{:>14}{:>10}{:>9}",
        "specimen", "steps/core-s", "ns/step", "stale"
    );
    // A profiler wants only one of them.
    let only = std::env::args()
        .nth(1)
        .filter(|word| !word.starts_with('-'));
    let mut rates = Vec::new();
    let mut memory = Vec::new();
    for (what, reached) in [
        ("in process", Reached::InProcess),
        ("behind our protocol, perfect wire", Reached::PerfectWire),
        ("behind our protocol, bad network", Reached::BadNetwork),
    ] {
        if only
            .as_ref()
            .is_some_and(|only| !what.contains(only.as_str()))
        {
            continue;
        }
        let found: Vec<Found> = (0..5).map(|_| run(reached, &mut memory)).collect();
        let best = found
            .iter()
            .min_by(|a, b| a.seconds.total_cmp(&b.seconds))
            .expect("five runs");
        assert!(
            found
                .iter()
                .all(|one| one.stale == best.stale && one.bytes == best.bytes)
        );
        let rate = best.steps as f64 / best.seconds;
        println!(
            "{what:<44}{rate:>14.0}{:>10.0}{:>9}",
            1e9 / rate,
            best.stale
        );
        rates.push(rate);
    }
    if let [ideal, perfect, bad] = rates.as_slice() {
        println!(
            "\nagainst the specimen in process: perfect wire {:.2} ×, bad network {:.2} × (goal: 2 000 000 steps per core-second)",
            perfect / ideal,
            bad / ideal
        );
    }
}
