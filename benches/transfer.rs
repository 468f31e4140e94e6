//! Cost of a transfer system and a compensator in a tick at 4096 Hz.
//!
//! Run with `cargo bench --bench transfer`. One tick is `observe` and `predict` of the compensator and `trial` and `commit` of
//! the benchmark's plant with its noisy sensors, as in a test in process; the median over batches of 64 ticks, so that the
//! clock itself is not measured. Goals: 0.3 µs for the plant with compensators that do not adapt, 2 µs with ATS, AMB and the
//! recursive least squares.

#![allow(clippy::disallowed_macros, reason = "a bench prints its result")]

use std::hint::black_box;

use gusset_actuator::compensation::CompensationSpec;
use gusset_actuator::specimen::{Specimen, SpecimenLaw};
use gusset_actuator::transfer::{Transfer, TransferSpec};
use gusset_record::rt::os::monotonic_ns;

const DT: f64 = 1.0 / 4096.0;
const BATCH: usize = 64;
const BATCHES: usize = 4000;

const LINEAR: &str = "law.linear = { stiffness_n_per_m = 1.19e6, damping_n_s_per_m = 114.22 }";
const YIELDING: &str = "law.bouc_wen = { stiffness_n_per_m = 1.19e6, yield_force_n = 1.19e3, post_yield_ratio = 0.1, \
                        beta = 0.5, gamma = 0.5, exponent = 2 }";
const PLANT: &str = "actuator = { servo_hydraulic = {} }\nforce_limit_n = 8900\n";
const NOISE: &str = "disp_sensor = { noise_power_m2_s = 6.25e-14 }\nforce_sensor = { noise_power_n2_s = 1.16e-3 }\n";

/// Kind, and its goal in µs.
const COMPENSATORS: [(&str, f64); 9] = [
    ("none = {}", 0.3),
    ("polynomial = { order = 3, delay_s = 0.024 }", 0.3),
    ("newton = { delay_s = 0.024 }", 0.3),
    ("inverse = { delay_s = 0.026 }", 0.3),
    (
        "model_inverse = { coefficients = [1, 0.0249, 1.07e-4, 2e-7] }",
        0.3,
    ),
    ("pi_lead = {}", 0.3),
    ("ats = { delay_s = 0.024 }", 2.0),
    ("amb = {}", 2.0),
    ("recursive_fir = { delay_s = 0.024 }", 2.0),
];

fn transfer(law: &str, spec: &str) -> Box<dyn Specimen> {
    let law: SpecimenLaw = toml::from_str(law).expect("a law");
    let law = law.build(1).expect("a law");
    if spec.is_empty() {
        return law;
    }
    let spec: TransferSpec = toml::from_str(spec).expect("a transfer system");
    Box::new(Transfer::new(&spec, law, Some(DT)).expect("a transfer system"))
}

/// Median, 99 % and 99.9 % of ns per tick.
fn measure(specimen: &mut dyn Specimen, compensation: &str) -> [f64; 3] {
    let spec: CompensationSpec = toml::from_str(compensation).expect("a compensator");
    let mut controller = spec.build(DT).expect("a compensator");
    controller.reset(0.0);
    let mut batches = Vec::with_capacity(BATCHES);
    let (mut command, mut last, mut last_vel) = (0.0, 0.0, 0.0);
    let (mut force, mut read) = ([0.0], [0.0]);
    let targets: Vec<f64> = (0..BATCH * BATCHES)
        .map(|k| {
            let t = k as f64 * DT;
            2e-3 * libm::sin(22.0 * t) + 3e-4 * libm::sin(99.0 * t)
        })
        .collect();
    for batch in targets.chunks_exact(BATCH) {
        let began = monotonic_ns();
        for target in batch {
            controller.observe(command, read[0]);
            let vel = (target - last) / DT;
            let next = controller.predict(*target, vel, (vel - last_vel) / DT);
            (last, last_vel) = (*target, vel);
            specimen.trial(&[next], &[(next - command) / DT], DT, &mut force);
            read[0] = next;
            specimen.measured(&mut read);
            specimen.commit();
            command = next;
        }
        batches.push((monotonic_ns() - began) as f64 / BATCH as f64);
        black_box(force);
    }
    batches.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| batches[((batches.len() - 1) as f64 * share) as usize];
    [at(0.5), at(0.99), at(0.999)]
}

fn main() {
    println!(
        "{:<58}{:>9}{:>9}{:>9}",
        "ns per tick", "p50", "p99", "p99.9"
    );
    let row = |what: &str, [p50, p99, p999]: [f64; 3], goal: Option<f64>| {
        let goal = goal.map_or(String::new(), |goal| {
            let word = if p50 <= 1e3 * goal { "met" } else { "MISSED" };
            format!("   goal {goal} µs: {word}")
        });
        println!("{what:<58}{p50:>9.0}{p99:>9.0}{p999:>9.0}{goal}");
    };
    let bare = measure(transfer(LINEAR, "").as_mut(), "none = {}");
    row("linear specimen alone", bare, None);
    for (what, spec) in [
        ("pure delay", "delay_s = 0.0243"),
        ("first order", "actuator.first_order.time_constant_s = 0.02"),
        (
            "second order",
            "actuator.second_order = { frequency_hz = 10, damping_ratio = 0.7 }",
        ),
        ("servo-hydraulic", PLANT),
    ] {
        row(
            what,
            measure(transfer(LINEAR, spec).as_mut(), "none = {}"),
            Some(0.3),
        );
    }
    let noisy = format!("{PLANT}{NOISE}");
    for (compensation, goal) in COMPENSATORS {
        let kind = compensation.split(' ').next().unwrap_or_default();
        let what = format!("servo-hydraulic, noisy sensors, {kind}");
        row(
            &what,
            measure(transfer(LINEAR, &noisy).as_mut(), compensation),
            Some(goal),
        );
    }
    for (compensation, goal) in COMPENSATORS {
        let kind = compensation.split(' ').next().unwrap_or_default();
        let what = format!("{kind} alone, behind a first-order actuator");
        let lag = "actuator.first_order.time_constant_s = 0.02";
        row(
            &what,
            measure(transfer(LINEAR, lag).as_mut(), compensation),
            Some(goal),
        );
    }
    let yielding = measure(transfer(YIELDING, &noisy).as_mut(), "none = {}");
    row(
        "servo-hydraulic that feels a Bouc-Wen specimen",
        yielding,
        None,
    );
}
