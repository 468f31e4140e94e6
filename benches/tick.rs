//! What one tick costs, measured inside the loop: from the decoded reply to the row pushed, on the README's study.
//!
//! Run with `cargo bench --bench tick`. The loop runs free (its clock jumps where it would sleep), so caches are as warm as
//! they get. Every run's report gives these quantities in real time. The reference is the bare arithmetic of the step: one
//! force evaluation and one solve, no port, no row, no histogram, no clock.

#![allow(clippy::disallowed_macros, reason = "a bench prints its result")]

use std::path::Path;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex};

use gusset_config as config;
use gusset_control::engine::{Connected, Control, Side};
use gusset_numerics::integrate::Integrator;
use gusset_quantity::time::{Clock, Nanos};
use gusset_record::rt::os::monotonic_ns;
use gusset_record::{RingSize, WhenFull, ring};
use gusset_setup as setup;

/// Reads the real clock and remembers every reading; instead of sleeping, it jumps to the wake-up time.
#[derive(Debug)]
struct FreeRunning {
    readings: Arc<Mutex<Vec<u64>>>,
    /// Not slept so far, ns.
    skipped: AtomicU64,
}

impl Clock for FreeRunning {
    fn now(&self) -> Nanos {
        let now = monotonic_ns() + self.skipped.load(Relaxed);
        if let Ok(mut readings) = self.readings.lock() {
            readings.push(now);
        }
        Nanos(now)
    }

    fn sleep_until(&self, until: Nanos) {
        let now = monotonic_ns() + self.skipped.load(Relaxed);
        self.skipped.fetch_add(until.since(Nanos(now)), Relaxed);
        if let Ok(mut readings) = self.readings.lock() {
            readings.push(SLEEP);
        }
    }
}

/// Readings per tick of one port: woke, sent, decoded, ready, pushed; before the sleep to the edge there may be others.
const PER_TICK: usize = 5;
/// Stands among the readings where the loop would sleep.
const SLEEP: u64 = u64::MAX;

/// Every limit of the specimen and of the test, none of which is reached.
const ALL_LIMITS: &[&str] = &[
    "specimen[0].limits.command_disp_m={warn=[-0.9,0.9],trip=[-1.0,1.0]}",
    "specimen[0].limits.command_step_m={warn=0.9,trip=1.0}",
    "specimen[0].limits.command_accel_m_per_s2={warn=1e9,trip=1e10}",
    "specimen[0].limits.measured_disp_m={warn=[-0.9,0.9],trip=[-1.0,1.0]}",
    "specimen[0].limits.measured_force_n={warn=[-1e9,1e9],trip=[-1e10,1e10]}",
    "specimen[0].limits.following_error_m={warn=0.9,trip=1.0}",
    "specimen[0].limits.force_step_n={warn=1e9,trip=1e10}",
    "specimen[0].limits.stuck_ticks={warn=1e9,trip=1e10}",
    "specimen[0].limits.alternating_ticks={warn=1e9,trip=1e10}",
    "specimen[0].limits.stiffness_ratio={warn=1e9,trip=1e10}",
    "specimen[0].limits.added_energy_j={warn=1e9,trip=1e10}",
];

fn study(sets: &[&str]) -> setup::Prepared {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let loaded =
        config::load(Path::new("config/frame-bouc-wen.toml"), &sets).expect("a valid study");
    setup::build(&loaded).expect("a study that can be built")
}

/// From the decoded reply to the pushed row, and whole ticks, in ns; and rows that were lost.
fn ticks(sets: &[&str]) -> (Vec<u64>, Vec<u64>, u64) {
    let test = study(sets);
    let steps = test.experiment.steps as usize;
    let columns = test.experiment.columns().len();
    let size = RingSize {
        rows: steps + 1000,
        events: 1 << 16,
    };
    let (recorder, _reader) = ring(columns, size, WhenFull::Drop).expect("a ring");
    // Touched, so that no tick pays for a page.
    let readings = Arc::new(Mutex::new(vec![0; 2 * PER_TICK * (steps + 4096)]));
    readings.lock().expect("one thread").clear();
    let clock = FreeRunning {
        readings: Arc::clone(&readings),
        skipped: AtomicU64::new(0),
    };
    let mark = Arc::clone(&readings);
    let before = move || mark.lock().expect("one thread").clear();
    let outcome = Connected::new(test.experiment, Box::new(clock), Box::new(recorder))
        .watched(Some(Box::new(before)), None)
        .run(&Control::from(crossbeam_channel::never()))
        .into_outcome();
    let all = readings.lock().expect("one thread").clone();
    let between = |from: usize| {
        all.split(|reading| *reading == SLEEP)
            .filter_map(|tick| tick.get(..PER_TICK))
            .take(steps)
            .map(|tick| tick[4].saturating_sub(tick[from]))
            .collect()
    };
    (between(2), between(0), outcome.rows_lost)
}

fn main() {
    let (mut bare_tick, _, _) = ticks(&[]);
    let (mut tick, mut whole, lost) = ticks(ALL_LIMITS);
    let mut bare = bare_steps(tick.len());
    println!(
        "3 DOFs, Bouc-Wen specimen, {} ticks, {lost} rows lost\n",
        tick.len()
    );
    println!("{:<52}{:>9}{:>9}{:>9}", "ns", "p50", "p99", "p99.9");
    let row = |what: &str, of: &mut Vec<u64>| {
        of.sort_unstable();
        let at = |share: f64| of[((of.len() - 1) as f64 * share) as usize];
        println!("{what:<52}{:>9}{:>9}{:>9}", at(0.5), at(0.99), at(0.999));
        at(0.5) as f64
    };
    let without = row(
        "reply decoded to row pushed (goal 1000, 5000)",
        &mut bare_tick,
    );
    let with = row("the same with every limit in the file", &mut tick);
    row("whole tick, with the specimen", &mut whole);
    let arithmetic = row("bare arithmetic of a step", &mut bare);
    println!("\ntick over bare arithmetic: {:.2} ×", with / arithmetic);
    println!(
        "every limit in the file over none: {:.3} ×, {:+.0} ns (a level costs a comparison that is made in any case)",
        with / without,
        with - without
    );
    watching();
}

/// Exchanges in one measurement of the cost of watching.
const EXCHANGES: u32 = 200_000;

/// What judging and estimating cost in all, apart from the tick: exchanges with and without them, in turns.
fn watching() {
    let test = study(ALL_LIMITS);
    let mut ports = test.experiment.ports;
    let port = &mut ports[0];
    let dofs = test.facts.structure.map_or(0, |structure| structure.dofs);
    let (mut disp, mut vel) = (vec![0.0; dofs], vec![0.0; dofs]);
    let mut sequence = 0;
    // One exchange with this number of checks of the command and of the measurement; ns.
    let mut exchanges = |clears: u32, judges: u32| {
        let began = monotonic_ns();
        for _ in 0..EXCHANGES {
            let phase = sequence as f64 * 1e-2;
            disp.fill(0.004 * libm::sin(phase));
            vel.fill(0.04 * libm::cos(phase));
            port.aim(&disp, &vel, 0.0, 0.0);
            for _ in 0..clears {
                std::hint::black_box(port.clear());
            }
            port.issue(sequence, 0.0, 1e-3).expect("in process");
            port.collect(Nanos(0)).expect("in process");
            for _ in 0..judges {
                std::hint::black_box(port.judge());
            }
            port.accepted(sequence).expect("in process");
            sequence += 1;
        }
        (monotonic_ns() - began) as f64 / f64::from(EXCHANGES)
    };
    let (mut commands, mut measurements) = (Vec::new(), Vec::new());
    for _ in 0..9 {
        let (less, more, base) = (exchanges(1, 0), exchanges(2, 0), exchanges(1, 1));
        commands.push(more - less);
        measurements.push(base - less);
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_unstable_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let (command, measurement) = (median(&mut commands), median(&mut measurements));
    let audit = audit_ns();
    println!(
        "\nwatching, median of nine: command {command:.0} ns, measurement with its estimates {measurement:.0} ns, audit of the \
         step {audit:.0} ns;\ntogether {:.0} ns of every tick (goal 300)",
        command + measurement + audit
    );
}

/// The audit of one step of the study's structure.
fn audit_ns() -> f64 {
    let Side::Structure(numerical) = study(&[]).experiment.side else {
        return 0.0;
    };
    let Some(mut audit) = numerical.audit else {
        return 0.0;
    };
    let n = numerical.state.disp.len();
    let (mut disp, vel, residual) = (vec![0.0; n], vec![0.1; n], vec![1.0; n]);
    let mut times: Vec<f64> = (0..9)
        .map(|_| {
            let began = monotonic_ns();
            for k in 0..EXCHANGES {
                disp[0] = f64::from(k) * 1e-9;
                audit.before(&disp);
                audit.after(&disp, &vel, &residual);
                std::hint::black_box(audit.relative());
            }
            (monotonic_ns() - began) as f64 / f64::from(EXCHANGES)
        })
        .collect();
    times.sort_unstable_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Those steps by hand, without the specimen's force.
fn bare_steps(steps: usize) -> Vec<u64> {
    let loaded = config::load(Path::new("config/frame-bouc-wen.toml"), &[]).expect("a valid study");
    let test = setup::build(&loaded).expect("a study that can be built");
    let Side::Structure(mut numerical) = test.experiment.side else {
        return vec![0];
    };
    let n = numerical.structure.dofs();
    let structure = test.facts.structure.expect("a structure");
    let lambda = structure.lambda.expect("a member of the family");
    let mut gui = gusset_numerics::integrate::Gui::new(
        numerical.structure.mass(),
        &numerical.structure.reference_damping(),
        &numerical.structure.reference_stiffness(),
        test.facts.dt,
        lambda,
        gusset_numerics::integrate::Start::Published,
    )
    .expect("positive definite");
    let (mut residual, mut reported) = (vec![0.0; n], vec![0.0; n]);
    (0..steps)
        .map(|step| {
            let began = monotonic_ns();
            numerical.excitation.load_into(step, &mut residual);
            let state = &mut numerical.state;
            let base = gusset_numerics::model::Base::default();
            let dt = test.facts.dt;
            numerical
                .structure
                .subtract_internal(&state.disp, &state.vel, base, dt, &mut residual);
            gui.advance(state, &residual, &mut reported);
            std::hint::black_box(&state.disp);
            monotonic_ns() - began
        })
        .collect()
}
