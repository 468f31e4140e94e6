//! What one tick costs, measured inside the loop: from the decoded reply to the row pushed, on the README's study.
//!
//! Run with `cargo bench --bench tick`. The loop runs free (its clock never sleeps), so caches are as warm as they get; the
//! same quantities in real time stand in every run's report. The opponent is the bare arithmetic of the step: one
//! force evaluation and one solve, no port, no row, no histogram, no clock.

#![allow(clippy::disallowed_macros, reason = "a bench prints its result")]

use std::path::Path;
use std::sync::{Arc, Mutex};

use gusset::config;
use gusset::engine::{Control, Engine, Side};
use gusset::integrate::Integrator;
use gusset::record::{RingSize, WhenFull, ring};
use gusset::rt::os::monotonic_ns;
use gusset::time::{Clock, Nanos};

/// Real readings, no sleep, and a memory of every reading.
#[derive(Debug)]
struct FreeRunning {
    readings: Arc<Mutex<Vec<u64>>>,
}

impl Clock for FreeRunning {
    fn now(&self) -> Nanos {
        let now = monotonic_ns();
        if let Ok(mut readings) = self.readings.lock() {
            readings.push(now);
        }
        Nanos(now)
    }

    fn sleep_until(&self, _: Nanos) {}
}

/// Readings per tick of one port: woke, sent, decoded, ready, pushed.
const PER_TICK: usize = 5;

fn main() {
    let loaded = config::load(Path::new("config/frame-bouc-wen.toml"), &[]).expect("a valid study");
    let test = config::build(&loaded).expect("a study that can be built");
    let steps = test.experiment.steps as usize;
    let columns = test.experiment.columns().len();
    let size = RingSize {
        rows: steps + 1000,
        events: 1 << 16,
    };
    let (recorder, _reader) = ring(columns, size, WhenFull::Drop).expect("a ring");
    let readings = Arc::new(Mutex::new(Vec::with_capacity(PER_TICK * (steps + 4096))));
    let clock = FreeRunning {
        readings: Arc::clone(&readings),
    };
    let mut engine = Engine::new(test.experiment, Box::new(clock), Box::new(recorder));
    let mark = Arc::clone(&readings);
    engine.before_first_tick = Some(Box::new(move || mark.lock().expect("one thread").clear()));
    let outcome = engine.run(&Control::unattended());
    let all = readings.lock().expect("one thread").clone();
    let mut ticks: Vec<u64> = all
        .chunks_exact(PER_TICK)
        .take(steps)
        .map(|t| t[4].saturating_sub(t[2]))
        .collect();
    let mut whole: Vec<u64> = all
        .chunks_exact(PER_TICK)
        .take(steps)
        .map(|t| t[4].saturating_sub(t[0]))
        .collect();
    let mut bare = bare_steps(steps);

    println!(
        "3 DOFs, Bouc-Wen specimen, {} ticks, {} rows lost\n",
        ticks.len(),
        outcome.rows_lost
    );
    println!("{:<44}{:>9}{:>9}{:>9}", "ns", "p50", "p99", "p99.9");
    let row = |what: &str, of: &mut Vec<u64>| {
        of.sort_unstable();
        let at = |share: f64| of[((of.len() - 1) as f64 * share) as usize];
        println!("{what:<44}{:>9}{:>9}{:>9}", at(0.5), at(0.99), at(0.999));
        at(0.5) as f64
    };
    let tick = row("reply decoded to row pushed (goal 1000, 5000)", &mut ticks);
    row("whole tick, with the specimen", &mut whole);
    let arithmetic = row("bare arithmetic of a step", &mut bare);
    println!("\ntick over bare arithmetic: {:.2} ×", tick / arithmetic);
}

/// The same structure, stepped by hand; the specimen's force is left out.
fn bare_steps(steps: usize) -> Vec<u64> {
    let loaded = config::load(Path::new("config/frame-bouc-wen.toml"), &[]).expect("a valid study");
    let test = config::build(&loaded).expect("a study that can be built");
    let Side::Structure(mut numerical) = test.experiment.side else {
        return vec![0];
    };
    let n = numerical.structure.dofs();
    let structure = test.facts.structure.expect("a structure");
    let lambda = structure.lambda.expect("a member of the family");
    let mut gui = gusset::integrate::Gui::new(
        numerical.structure.mass(),
        &numerical.structure.reference_damping(),
        &numerical.structure.reference_stiffness(),
        test.facts.dt,
        lambda,
        gusset::integrate::Start::Published,
    )
    .expect("positive definite");
    let (mut residual, mut reported) = (vec![0.0; n], vec![0.0; n]);
    (0..steps)
        .map(|step| {
            let began = monotonic_ns();
            numerical.excitation.load_into(step, &mut residual);
            let state = &mut numerical.state;
            let base = gusset::model::Base::default();
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
