//! Runs made up for tests and for judging pictures by eye: a three-storey frame on a Bouc–Wen specimen, a
//! prescribed-displacement test. Physics is real (explicit central differences), timing is drawn from seeded distributions.

use rand::RngExt as _;
use rand::SeedableRng as _;
use serde_json::json;

use super::RunView;
use crate::Flaws;
use gusset_record::{Column, EventLine};

pub(super) const RATE: f64 = 1024.0;

pub(super) fn columns(names: &[&str]) -> Vec<Column> {
    let unit = |name: &str| match name.chars().next() {
        _ if name.starts_with("force") || name.starts_with("raw_force") => "N",
        _ if name.ends_with("_s") || name == "time" => "s",
        _ if name.starts_with("seq") || name.starts_with("st") => "1",
        Some('v') => "m/s",
        Some('a' | 'g') => "m/s^2",
        _ => "m",
    };
    let column = |name: &&str| Column {
        name: (*name).to_owned(),
        unit: unit(name).to_owned(),
        meaning: String::new(),
        timing: name.ends_with("_s"),
    };
    names.iter().map(column).collect()
}

const NAMES: [&str; 28] = [
    "step",
    "sub_tick",
    "state",
    "time",
    "ground",
    "x1",
    "x2",
    "x3",
    "v1",
    "v2",
    "v3",
    "a1",
    "a2",
    "a3",
    "target_1_1",
    "cmd_1_1",
    "meas_1_1",
    "force_1_1",
    "raw_disp_1_1",
    "raw_force_1_1",
    "seq_1",
    "status_1",
    "release_s",
    "wakeup_lateness_s",
    "command_lateness_s",
    "round_trip_s",
    "compute_s",
    "stretched",
];

struct Loop {
    rng: rand_pcg::Pcg64,
    counts: std::collections::BTreeMap<u64, u64>,
}

impl Loop {
    fn lateness_us(&mut self) -> f64 {
        let u: f64 = self.rng.random();
        let us = match self.rng.random::<f64>() {
            p if p < 0.9996 => 0.045 + 0.03 * u + 0.08 * u.powi(12),
            p if p < 0.999_97 => 2.0 + 30.0 * u * u,
            _ => 200.0 + 3000.0 * u,
        };
        *self.counts.entry((us * 1000.0).round() as u64).or_insert(0) += 1;
        us
    }

    fn histogram(&self) -> serde_json::Value {
        let total: u64 = self.counts.values().sum();
        let at = |share: f64| {
            let mut sum = 0;
            let found = self.counts.iter().find(|(_, n)| {
                sum += **n;
                sum as f64 >= share * total as f64
            });
            found.map(|(ns, _)| *ns as f64 / 1000.0)
        };
        let bins: Vec<_> = self
            .counts
            .iter()
            .map(|(ns, n)| json!([*ns as f64 / 1000.0 - 0.001, *ns as f64 / 1000.0, n]))
            .collect();
        json!({"count": total, "min": at(0.0), "p50": at(0.5), "p90": at(0.9), "p99": at(0.99), "p99_9": at(0.999), "max": at(1.0), "bins": bins})
    }
}

/// Bins by their upper edges in µs and their counts.
fn bins(of: &[(f64, u64)]) -> serde_json::Value {
    let lower = std::iter::once(0.0).chain(of.iter().map(|(to, _)| *to));
    lower
        .zip(of)
        .map(|(from, (to, count))| json!([from, to, count]))
        .collect()
}

/// A hybrid test of `seconds` at 1024 Hz whose specimen answers `delay` ticks late.
pub(super) fn hybrid(seconds: f64, delay: usize) -> RunView {
    let dt = 1.0 / RATE;
    let steps = (seconds * RATE) as usize;
    let mut timing = Loop {
        rng: rand_pcg::Pcg64::seed_from_u64(7),
        counts: Default::default(),
    };
    let mut noise = rand_pcg::Pcg64::seed_from_u64(11);
    let (mass, k) = ([20e3, 20e3, 20e3], [9e6, 12e6, 9e6]);
    let mut data = vec![Vec::with_capacity(steps); NAMES.len()];
    let (mut x, mut before, mut z) = ([0.0f64; 3], [0.0f64; 3], 0.0f64);
    let mut sent = vec![0.0; delay + 1];
    let mut last = 0.0;
    let mut events = vec![
        json!({"tick": 0, "time": 0.0, "wall": "2025-03-04T09:12:07.123456789Z", "clock_ns": 1, "event": "started"}),
    ];
    let mut filter = [0.0f64; 2];
    for i in 0..steps {
        let t = i as f64 * dt;
        let envelope = (t / 3.0).min(1.0)
            * if t > 14.0 {
                libm::exp(-(t - 14.0) / 6.0)
            } else {
                1.0
            };
        let white: f64 = noise.random::<f64>() - 0.5;
        filter[1] += dt * (600.0 * white - 2.0 * 0.4 * 14.0 * filter[1] - 196.0 * filter[0]);
        filter[0] += dt * filter[1];
        let ground = envelope * (9.0 * filter[0] + 0.7 * filter[1]);
        sent.rotate_right(1);
        sent[0] = x[0];
        let meas =
            sent[delay] + 4e-6 * (noise.random::<f64>() - 0.5) * f64::from(u8::from(delay > 0));
        let step = meas - last;
        last = meas;
        let (yield_disp, alpha) = (0.006, 0.08);
        z += step
            - (0.6 * step.abs() * z.abs() * z + 0.4 * step * z * z) / (yield_disp * yield_disp);
        let force = alpha * k[0] * meas + (1.0 - alpha) * k[0] * z;
        let story = [force, k[1] * (x[1] - x[0]), k[2] * (x[2] - x[1])];
        let vel: Vec<f64> = (0..3).map(|j| (x[j] - before[j]) / dt).collect();
        // Stiffness-proportional damping between storeys, and a little to the ground.
        let viscous = |vel: &[f64], j: usize| {
            let below = if j > 0 { vel[j - 1] } else { 0.0 };
            let above = vel.get(j + 1).map_or(0.0, |v| k[j + 1] * (v - vel[j]));
            0.0045 * (k[j] * (vel[j] - below) - above) + 0.3 * mass[j] * vel[j]
        };
        let accel: Vec<f64> = (0..3)
            .map(|j| {
                (-story[j] + story.get(j + 1).copied().unwrap_or(0.0)) / mass[j]
                    - viscous(&vel, j) / mass[j]
                    - ground
            })
            .collect();
        let late = timing.lateness_us();
        if late > 977.0 {
            let class = if late > 2000.0 {
                "taken_away"
            } else {
                "preempted"
            };
            events.push(json!({"tick": i, "time": t, "wall": "2025-03-04T09:12:19.000000001Z", "clock_ns": 1, "event": "miss", "class": class, "late_ns": (late * 1000.0) as u64, "stretched": 1, "steal_ms": 10}));
        }
        let row = [
            i as f64,
            0.0,
            3.0,
            t,
            ground,
            x[0],
            x[1],
            x[2],
            vel[0],
            vel[1],
            vel[2],
            accel[0],
            accel[1],
            accel[2],
            x[0],
            x[0],
            meas,
            force,
            meas,
            force,
            i as f64,
            0.0,
            t,
            late * 1e-6,
            late * 1e-6 + 2e-7,
            1.4e-7,
            (0.35 + 0.2 * noise.random::<f64>()) * 1e-6,
            0.0,
        ];
        for (column, value) in data.iter_mut().zip(row) {
            column.push(value);
        }
        for j in 0..3 {
            let next = 2.0 * x[j] - before[j] + dt * dt * accel[j];
            before[j] = x[j];
            x[j] = next;
        }
    }
    let misses = events.len() - 1;
    events.push(json!({"tick": steps, "time": seconds, "wall": "2025-03-04T09:12:47.123456789Z", "clock_ns": 2, "event": "ended"}));
    RunView {
        title: "Three storeys on a Bouc–Wen column".to_owned(),
        columns: columns(&NAMES),
        data,
        filed: Vec::new(),
        digest: None,
        replaced: 0,
        no_balance: None,
        modes: Vec::new(),
        no_modes: None,
        no_margin: None,
        summary: Some(json!({
            "status": "completed", "reason": "", "steps": steps, "dt": dt, "lambda": 11.5, "clock": "real", "wall_seconds": seconds,
            "link": {"bottom column": {"sent": steps, "received": steps, "late": 0, "lost": 0, "corrupt": 0}}, "rate_hz": RATE, "deadline_misses": misses, "stretched_ticks": 0, "version": "0.1.0",
            "realtime": {"complete": false, "required": false, "cpu": 1, "features": [
                {"want": "affinity", "asked": "processor 1", "granted": true},
                {"want": "policy", "asked": "SCHED_FIFO 80", "granted": true},
                {"want": "lock_memory", "asked": "mlockall", "granted": false, "errno": 1, "reason": "not permitted", "advice": "raise memlock in /etc/security/limits.conf or grant CAP_IPC_LOCK"},
            ], "spin": {"asked_us": 0.0, "used_us": 0.0, "throttle": null, "note": ""}},
        }).into()),
        timing: Some(json!({
            "wakeup_lateness": timing.histogram(),
            "compute": {"count": steps, "min": 0.35, "p50": 0.45, "p90": 0.52, "p99": 0.55, "p99_9": 0.58, "max": 4.1, "bins": bins(&[(0.36, 900), (0.4, 9000), (0.45, 21000), (0.5, 9000), (0.55, 1000), (0.7, 50), (1.2, 6), (4.1, 4)])},
            "tick_time": {"count": steps, "min": 0.9, "p50": 1.1, "p90": 1.3, "p99": 2.5, "p99_9": 9.0, "max": 1900.0, "bins": bins(&[(0.9, 2000), (1.0, 12000), (1.1, 20000), (1.3, 6000), (2.5, 600), (9.0, 300), (400.0, 6), (1200.0, 2), (1900.0, 1)])},
            "miss": {"count": 0},
        }).into()),
        events: events.into_iter().map(EventLine::from).collect(),
        flaws: Flaws::default(),
        test: "title = \"Three storeys\"\n\n[time]\nrate_hz = 1024\nduration_s = 40.0\n\n[structure.shear_building]\nmass_kg = [20e3, 20e3, 20e3]\nstiffness_n_per_m = [0.0, 12e6, 9e6]\n\n[integrator]\nmethod = \"gui\"\nlambda = \"auto\"\n\n[excitation.ground_acceleration.signal.sine]\namplitude = 1.0\nfrequency_hz = 1.5\n\n[[specimen]]\nname = \"bottom column\"\nstorey = 1\n[specimen.law.linear]\nstiffness_n_per_m = 9e6\n".into(),
    }
}

/// A cyclic test of one Kelvin specimen, k = 2 MN/m, c = 8 kN s/m, that follows 12.5 ms late; two seconds of static state first.
pub(super) fn prescribed() -> RunView {
    let names = [
        "state",
        "time",
        "target_1_1",
        "cmd_1_1",
        "meas_1_1",
        "force_1_1",
    ];
    let mut data = vec![Vec::new(); names.len()];
    let omega = 2.0 * std::f64::consts::PI;
    let disp = |t: f64| 0.02 * (t / 20.0).min(1.0) * libm::sin(omega * t);
    for i in -2048..20_480i32 {
        let t = f64::from(i) / RATE;
        let (command, measured) = if i < 0 {
            (5.0, 5.0)
        } else {
            (disp(t), disp((t - 0.0125).max(0.0)))
        };
        let vel = (disp(t - 0.0125 + 1e-6) - disp(t - 0.0125 - 1e-6)) / 2e-6;
        let force = 2e6 * measured + if t > 0.02 { 8e3 * vel } else { 0.0 };
        let row = [
            if i < 0 { 1.0 } else { 3.0 },
            t,
            command,
            command,
            measured,
            force,
        ];
        for (column, value) in data.iter_mut().zip(row) {
            column.push(value);
        }
    }
    RunView {
        title: "Cyclic test of the brace".to_owned(),
        columns: columns(&names),
        data,
        summary: Some(
            json!({"status": "completed", "steps": 20480, "dt": 1.0 / RATE, "clock": "simulated", "wall_seconds": 0.4, "deadline_misses": 0}).into()),
        test: "[[excitation.prescribed_displacement]]\nspecimen = \"brace\"\n[excitation.prescribed_displacement.signal.cyclic]\namplitudes = [0.02]\ncycles_per_amplitude = 20\nfrequency_hz = 1.0\n\n[[specimen]]\nname = \"brace\"\n".into(),
        ..RunView::default()
    }
}
