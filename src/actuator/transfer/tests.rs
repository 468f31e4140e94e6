use super::*;
use crate::specimen::SpecimenLaw;
use gusset_numerics::law::{LawSpec, LinearSpec};
use gusset_quantity::state::{Stateful, TestState};
use nalgebra::ComplexField as _;
use std::f64::consts::PI;

mod restored;

const DT: f64 = 1.0 / 4096.0;

fn spec(text: &str) -> TransferSpec {
    toml::from_str(text).unwrap()
}

fn spring(stiffness: f64, damping: f64) -> Box<dyn Specimen> {
    let law = LawSpec::Linear(LinearSpec {
        stiffness_n_per_m: stiffness,
        damping_n_s_per_m: damping,
    });
    SpecimenLaw::Law(law).build(1).unwrap()
}

fn behind(text: &str, law: Box<dyn Specimen>) -> Transfer {
    Transfer::new(&spec(text), law, None).unwrap()
}

/// Achieved displacement and force at each tick of a commanded motion from rest at its value at 0.
fn follow(
    transfer: &mut Transfer,
    dt: f64,
    n: usize,
    command: impl Fn(f64) -> f64,
) -> Vec<[f64; 2]> {
    let mut force = [0.0];
    transfer.trial(&[command(0.0)], &[0.0], 0.0, &mut force);
    transfer.commit();
    (1..=n)
        .map(|k| {
            let now = command(k as f64 * dt);
            transfer.trial(&[now], &[0.0], dt, &mut force);
            transfer.commit();
            [transfer.achieved()[0], force[0]]
        })
        .collect()
}

#[test]
fn without_keys_the_law_answers_directly() {
    let mut direct = spring(1.19e6, 114.0);
    let mut through = behind("", spring(1.19e6, 114.0));
    let (mut a, mut b) = ([0.0], [0.0]);
    for k in 0..100 {
        let (disp, vel) = ([libm::sin(0.1 * f64::from(k))], [f64::from(k)]);
        let dt = if k == 0 { 0.0 } else { DT };
        direct.trial(&disp, &vel, dt, &mut a);
        through.trial(&disp, &vel, dt, &mut b);
        let mut read = disp;
        through.measured(&mut read);
        assert_eq!((a, disp), (b, read));
        direct.commit();
        through.commit();
    }
}

#[test]
fn lags_follow_ramps_and_steps_exactly() {
    // A step of one tick's ramp: after it, x = 1 − e^{−(t−δ)/T}·(1 − e^{−δ/T})·T/δ … with δ the tick, exactly.
    let (lag, rise) = (0.02, DT);
    let mut first = behind(
        "actuator.first_order = { time_constant_s = 0.02 }",
        spring(1.0, 0.0),
    );
    let step = follow(&mut first, DT, 400, |t| f64::min(t / rise, 1.0));
    let ramp_end = 1.0 - lag / rise * (1.0 - libm::exp(-rise / lag));
    for (k, [x, force]) in step.iter().enumerate() {
        let t = k as f64 * DT;
        let wanted = 1.0 - (1.0 - ramp_end) * libm::exp(-t / lag);
        assert!((x - wanted).abs() < 1e-13 && (force - x).abs() < 1e-15);
    }
    // Second order, ramp u = t: x = t − 2ζ/ω + e^{−ζωt}(2ζ/ω cos ω_d t + (2ζ² − 1)/ω_d sin ω_d t).
    let (zeta, omega) = (0.7, 2.0 * PI * 12.0);
    let damped = omega * f64::sqrt(1.0 - zeta * zeta);
    let mut second = behind(
        "actuator.second_order = { frequency_hz = 12, damping_ratio = 0.7 }",
        spring(1.0, 0.0),
    );
    for (k, [x, _]) in follow(&mut second, DT, 800, |t| t).iter().enumerate() {
        let t = (k + 1) as f64 * DT;
        let (s, c) = libm::sincos(damped * t);
        let swing = 2.0 * zeta / omega * c + (2.0 * zeta * zeta - 1.0) / damped * s;
        let wanted = t - 2.0 * zeta / omega + libm::exp(-zeta * omega * t) * swing;
        assert!((x - wanted).abs() < 1e-13, "{k}: {x} {wanted}");
    }
}

#[test]
fn held_command_steps_at_each_tick_start() {
    // First order: x = 1 − e^{−t/T} from the start of the first tick on, exactly.
    let mut first = behind(
        "between_ticks = \"held\"\nactuator.first_order = { time_constant_s = 0.02 }",
        spring(1.0, 0.0),
    );
    let step = follow(&mut first, DT, 400, |t| f64::from(u8::from(t > 0.0)));
    for (k, [x, _]) in step.iter().enumerate() {
        let wanted = 1.0 - libm::exp(-(k as f64 + 1.0) * DT / 0.02);
        assert!((x - wanted).abs() < 1e-13, "{k}: {x} {wanted}");
    }
    // After a delay of three ticks, the same three ticks later.
    let mut late = behind(
        &format!(
            "between_ticks = \"held\"\ndelay_s = {:?}\nactuator.first_order = {{ time_constant_s = 0.02 }}",
            3.0 * DT
        ),
        spring(1.0, 0.0),
    );
    let later = follow(&mut late, DT, 400, |t| f64::from(u8::from(t > 0.0)));
    assert_eq!(later[3..], step[..397]);
    // Without a lag there is nothing between two ticks.
    let direct = |text: &str| {
        let mut direct = behind(text, spring(1.0, 0.0));
        follow(&mut direct, DT, 50, |t| libm::sin(300.0 * t))
    };
    assert_eq!(direct("between_ticks = \"held\""), direct(""));
}

#[test]
fn held_sine_is_answered_half_a_tick_early() {
    let (hertz, k, c) = (3.6, 1.19e6, 114.22);
    let omega = 2.0 * PI * hertz;
    let text = "between_ticks = \"held\"\nactuator.servo_hydraulic = {}";
    let mut plant = behind(text, spring(k, c));
    let n = 40_960;
    let out = follow(&mut plant, DT, n, |t| 1e-3 * libm::sin(omega * t));
    let held = spec(text);
    let expected = held.response_to_ticks(omega, k, c, DT);
    for (i, [x, _]) in out.iter().enumerate().skip(n - 1200) {
        let (s, cosine) = libm::sincos(omega * (i + 1) as f64 * DT);
        let wanted = 1e-3 * (expected.re * s + expected.im * cosine);
        // A plant of three poles more than zeros passes almost nothing of the aliases at 4096 Hz: 1e-12 m.
        assert!((x - wanted).abs() < 1e-12, "{x} {wanted}");
    }
    let lead = held.lag(omega, k, c) - held.lag_to_ticks(omega, k, c, DT);
    assert!((lead - 0.5 * DT).abs() < 1e-15);
    let ramped = spec("actuator.servo_hydraulic = {}");
    assert_eq!(
        ramped.response_to_ticks(omega, k, c, DT),
        ramped.response(omega, k, c)
    );
    assert_eq!(
        ramped.lag_to_ticks(omega, k, c, DT),
        ramped.lag(omega, k, c)
    );
}

#[test]
fn benchmark_plant_has_published_lags() {
    let plant = spec("actuator.servo_hydraulic = {}");
    let (k, c) = (1.19e6, 114.22);
    for (hertz, lag, gain) in [
        (1.0, 25.0e-3, None),
        (3.6, 23.7e-3, Some(0.916)),
        (10.0, 19.0e-3, Some(0.633)),
    ] {
        let omega = 2.0 * PI * hertz;
        let found = plant.lag(omega, k, c);
        assert!((found - lag).abs() < 0.06e-3, "{hertz} Hz: {found}");
        if let Some(gain) = gain {
            assert!((plant.response(omega, k, c).modulus() - gain).abs() < 6e-4);
        }
    }
    // Its poles, in 1/s.
    let [a5, a4, a3, a2, a1, a0] = ServoHydraulicSpec::default().characteristic(k, c);
    for (re, im) in [(-8.0, 421.8), (-184.0, 229.9), (-48.2, 0.0)] {
        let s = nalgebra::Complex::new(re, im);
        let value = ((((s * a5 + a4) * s + a3) * s + a2) * s + a1) * s + a0;
        let slope = (((s * (5.0 * a5) + 4.0 * a4) * s + 3.0 * a3) * s + 2.0 * a2) * s + a1;
        let off = (value / slope).modulus();
        assert!(
            off < 0.08,
            "a root lies {off} from {s}, which is printed to 0.05"
        );
    }
}

#[test]
fn plant_matches_its_transfer_function() {
    let (hertz, k, c) = (3.6, 1.19e6, 114.22);
    let omega = 2.0 * PI * hertz;
    let text = "delay_s = 0.0031\nactuator.servo_hydraulic = {}";
    let mut plant = behind(text, spring(k, c));
    let n = 40_960;
    let out = follow(&mut plant, DT, n, |t| 1e-3 * libm::sin(omega * t));
    let expected = spec(text).response(omega, k, c);
    // A sine of straight lines is a little smaller: sinc²(ωΔt/2) ≈ 1 − (ωΔt)²/12 = 1 − 2.5e-6, and one that is read between
    // its corners, 0.7 of a tick late, by 0.7·0.3/2·(ωΔt)² = 3.2e-6 more; times 0.93 mm.
    for (i, [x, force]) in out.iter().enumerate().skip(n - 1200) {
        let t = (i + 1) as f64 * DT;
        let (s, cosine) = libm::sincos(omega * t);
        let wanted = 1e-3 * (expected.re * s + expected.im * cosine);
        assert!((x - wanted).abs() < 6e-9, "{x} {wanted}");
        // The load cell measures spring, dashpot and inertia: the equation of motion of a sine.
        let dynamic = nalgebra::Complex::new(k - 29.13 * omega * omega, c * omega) * expected;
        let felt = 1e-3 * (dynamic.re * s + dynamic.im * cosine);
        assert!((force - felt).abs() < 7e-3, "{force} {felt}");
    }
}

#[test]
fn yielding_specimen_is_in_equilibrium() {
    // Half the step must give a quarter of the difference: the coupling is of second order.
    let law = || {
        let text = "bouc_wen = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1, \
                    beta = 0.5, gamma = 0.5, exponent = 2 }";
        let law: LawSpec = toml::from_str(text).unwrap();
        SpecimenLaw::Law(law).build(1).unwrap()
    };
    let run = |per_second: usize| {
        let mut plant = behind("actuator.servo_hydraulic = {}", law());
        let n = per_second / 2;
        let dt = 1.0 / per_second as f64;
        follow(&mut plant, dt, n, |t| 4e-3 * libm::sin(12.0 * t))[n - 1][0]
    };
    let (coarse, middle, fine) = (run(1024), run(2048), run(4096));
    let ratio = (coarse - middle) / (middle - fine);
    assert!((2.5..8.0).contains(&ratio), "{ratio}");
}

#[test]
fn limits_of_rate_stroke_and_force_hold() {
    // A far command: at the rate until the lag would be slower, |u − x| = rate T, then an exponential.
    let text = "actuator.first_order = { time_constant_s = 0.05 }\nrate_limit_m_per_s = 0.2";
    let mut slow = behind(text, spring(1.0, 0.0));
    let out = follow(&mut slow, DT, 2000, |t| if t > 0.0 { 0.04 } else { 0.0 });
    let (rate, lag) = (0.2, 0.05);
    let leaves = (0.04 - rate * lag) / rate;
    for (i, [x, _]) in out.iter().enumerate() {
        let t = (i + 1) as f64 * DT;
        let wanted = if t < leaves {
            rate * t
        } else {
            0.04 - rate * lag * libm::exp(-(t - leaves) / lag)
        };
        // The limit ends between two ticks, and the step is a ramp of one tick.
        assert!((x - wanted).abs() < rate * DT, "{t}: {x} {wanted}");
    }
    let mut slow = behind(text, spring(1.0, 0.0));
    let back = follow(&mut slow, DT, 2000, |t| if t > 0.0 { -0.04 } else { 0.0 });
    let mirrored = |([x, _], [back, _]): (&[f64; 2], &[f64; 2])| *x == -back;
    assert!(out.iter().zip(&back).all(mirrored), "the other way");
    let mut short = behind("stroke_m = 0.01", spring(1e5, 0.0));
    let out = follow(&mut short, DT, 100, |t| t);
    assert_eq!(out[99], [0.01, 1000.0]);
    assert!(short.is_saturated());
    // Stalls where 1e5 N/m gives 500 N, at 5 mm, to 2⁻¹⁹ of a tick's step.
    let mut weak = behind("force_limit_n = 500", spring(1e5, 0.0));
    let out = follow(&mut weak, DT, 100, |t| t);
    assert!((out[99][0] - 0.005).abs() < DT / 2e5 && out[99][1] <= 500.0);
    assert!(weak.is_saturated());
    // The cylinder gives 8.9 kN and no more, and nothing blows up.
    let mut plant = behind(
        "actuator.servo_hydraulic = {}\nforce_limit_n = 8900",
        spring(1.19e6, 114.0),
    );
    let out = follow(&mut plant, DT, 4096, |t| 0.02 * libm::sin(20.0 * t));
    let peak = out.iter().map(|[_, f]| f.abs()).fold(0.0, f64::max);
    assert_eq!(peak, 8900.0);
    assert!(out.iter().all(|[x, _]| x.abs() < 0.02));
}

/// Beyond 2 mm the stop takes the pressing force of the cylinder, and nothing bleeds it while it is at rest.
#[test]
fn cylinder_winds_up_at_its_stroke_end() {
    let (k, stroke) = (1.19e6, 2e-3);
    let run = |per_second: usize| {
        let mut plant = behind(
            "actuator.servo_hydraulic = {}\nstroke_m = 0.002",
            spring(k, 114.22),
        );
        let dt = 1.0 / per_second as f64;
        let command = |t: f64| 4e-3 * libm::sin(4.0 * PI * t);
        let out = follow(&mut plant, dt, per_second / 2, command);
        for [_, force] in out.iter().filter(|[x, _]| *x >= stroke) {
            assert!((force - k * stroke).abs() < 1e-9 * k * stroke, "{force}");
        }
        // It arrives, bounces and stops. It leaves at 0.2887 s, as by small steps with a piston that is held.
        let last = out.iter().rposition(|[x, _]| *x >= stroke).unwrap();
        let left = (last + 1) as f64 * dt;
        let later: Vec<f64> = out
            .iter()
            .skip(per_second / 64 * 20 - 1)
            .step_by(per_second / 64)
            .map(|[x, _]| *x)
            .collect();
        (left, later)
    };
    let runs: Vec<_> = [1024, 2048, 4096, 16_384].into_iter().map(run).collect();
    let (left, exact) = runs.last().unwrap();
    assert!((left - 0.2887).abs() < 1e-3, "{left}");
    let off = |(_, places): &(f64, Vec<f64>)| {
        let both = places.iter().zip(exact);
        both.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    for ((left, _), per_second) in runs.iter().zip([1024.0, 2048.0, 4096.0]) {
        assert!((left - 0.2887).abs() < 1e-3 + 2.0 / per_second, "{left}");
    }
    assert!(
        off(&runs[0]) < 0.02 * stroke && off(&runs[2]) < 0.25 * off(&runs[0]),
        "{} {}",
        off(&runs[0]),
        off(&runs[2])
    );
}

#[test]
fn startup_is_at_rest_at_the_first_command() {
    for text in [
        "delay_s = 0.01\nactuator.second_order = { frequency_hz = 9, damping_ratio = 0.6 }",
        "actuator.first_order = { time_constant_s = 0.03 }",
        "actuator.servo_hydraulic = {}",
    ] {
        let mut plant = behind(text, spring(1.19e6, 114.0));
        let out = follow(&mut plant, DT, 500, |_| 3e-3);
        let first = out[0][0];
        assert!((first - 3e-3).abs() < 3e-5, "{first}");
        for [x, _] in &out {
            assert!((x - first).abs() < 1e-12, "{text}: {x} {first}");
        }
    }
}

const NOISY: &str = "delay_s = 0.0041\nactuator.servo_hydraulic = {}\nseed = 5\nforce_limit_n = 3000\n\
                     [disp_sensor]\nnoise_rms_m = 1e-5\ndrift_m_per_s = 1e-4\n[force_sensor]\nnoise_power_n2_s = 1e-3\nquantum_n = 0.5";

#[test]
fn trials_and_holds_leave_no_trace() {
    let law = || spring(1.19e6, 114.0);
    let (mut plain, mut disturbed) = (behind(NOISY, law()), behind(NOISY, law()));
    let (mut a, mut b) = ([0.0], [0.0]);
    for k in 0..600 {
        let disp = [5e-3 * libm::sin(0.02 * f64::from(k))];
        let dt = if k == 0 { 0.0 } else { DT };
        plain.trial(&disp, &[0.1], dt, &mut a);
        plain.commit();
        disturbed.trial(&[0.02], &[9.0], dt, &mut b);
        disturbed.revert();
        disturbed.trial(&disp, &[0.1], dt, &mut b);
        assert_eq!(a, b);
        disturbed.commit();
        if k % 50 == 20 {
            // A hold: readings are noisy, time stops, and a commit (as a server makes it) changes nothing.
            let mut before = f64::NAN;
            for _ in 0..3 {
                disturbed.trial(&disp, &[0.0], 0.0, &mut b);
                let mut read = disp;
                disturbed.measured(&mut read);
                assert_ne!(read[0], before, "noise is read while zeroing");
                before = read[0];
            }
            disturbed.commit();
        }
        if k % 100 == 70 {
            let state = TestState::of(|visit| disturbed.visit_state(visit)).unwrap();
            let mut fresh = behind(NOISY, law());
            state.restore(|visit| fresh.visit_state(visit)).unwrap();
            disturbed = fresh;
        }
    }
}

#[test]
fn a_tick_allocates_nothing() {
    let law =
        "bilinear = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1 }";
    let law: LawSpec = toml::from_str(law).unwrap();
    let law = SpecimenLaw::Law(law).build(2).unwrap();
    let mut plant = Transfer::new(&spec(NOISY), law, None).unwrap();
    let mut force = [0.0; 2];
    let count = allocation_counter::measure(|| {
        for k in 0..400 {
            let disp = [3e-3 * libm::sin(0.1 * f64::from(k)); 2];
            let dt = if k % 7 == 0 { 2.0 * DT } else { DT };
            plant.trial(&disp, &[0.1; 2], dt, &mut force);
            plant.commit();
        }
    });
    assert_eq!(count.count_total, 0);
}

#[test]
fn invalid_transfer_is_refused_by_key() {
    let refuse =
        |text: &str| Transfer::new(&spec(text), spring(1.19e6, 114.0), Some(DT)).unwrap_err();
    for (text, key) in [
        ("delay_s = -0.01", "delay_s"),
        ("delay_s = nan", "delay_s"),
        ("delay_s = 3.0", "delay_s"),
        ("stroke_m = 0", "stroke_m"),
        (
            "actuator.first_order = { time_constant_s = 0 }",
            "time_constant_s",
        ),
        (
            "actuator.second_order = { frequency_hz = 5, damping_ratio = -0.1 }",
            "damping_ratio",
        ),
        (
            "actuator.servo_hydraulic = {}\nrate_limit_m_per_s = 1",
            "rate_limit_m_per_s",
        ),
        (
            "actuator.servo_hydraulic = { valve_gain = 1e15 }",
            "servo_hydraulic",
        ),
        ("disp_sensor = { noise_rms_m = -1 }", "noise_rms_m"),
    ] {
        assert_eq!(refuse(text).key(), key, "{text}");
    }
    let text = refuse("delay_s = 3.0").to_string();
    assert!(
        text.contains("12288.0 ticks") && text.contains("8190"),
        "{text}"
    );
}

/// Growth of a freely vibrating mass on a computed spring and dashpot and a specimen behind a transfer system, over 100
/// periods at the critical state's own frequency.
fn growth(ratio: f64, share: f64, transfer: &str) -> f64 {
    let omega = 2.0 * PI;
    let (k, c) = (omega * omega, 2.0 * ratio * omega);
    let dt = 1e-3;
    let mut specimen = behind(transfer, spring(share * k, 0.0));
    let effective = 1.0 + dt / 2.0 * c + dt * dt / 4.0 * k;
    let (mut x, mut v, mut force) = (1e-3, 0.0, [0.0]);
    let mut peaks = [0.0f64; 2];
    let n = 200_000;
    for i in 0..n {
        specimen.trial(&[x], &[v], if i == 0 { 0.0 } else { dt }, &mut force);
        specimen.commit();
        v -= dt / effective * (c * v + (1.0 - share) * k * x + force[0]);
        x += dt * v;
        let half = usize::from(i >= n / 2);
        if i % (n / 2) > n / 4 {
            peaks[half] = peaks[half].max(x.abs());
        }
    }
    peaks[1] / peaks[0]
}

#[test]
fn loops_decay_below_the_critical_delay() {
    let omega = 2.0 * PI;
    // With the critical delay and lag in closed form.
    for (ratio, share, delay, lag) in [
        (0.02, 0.5, 0.012745994077000876, 0.01281467435719022),
        (0.05, 0.8, 0.01994621620342171, 0.020211173250689753),
        (0.01, 1.0, 0.0031833110641826244, 0.00318437261088226),
    ] {
        let (k, c) = (omega * omega, 2.0 * ratio * omega);
        // Second order: (m s² + c s + k_n)(s² + 2ζω_a s + ω_a²) + k_e ω_a², by bisection on ω_a at ζ = 0.7.
        let is_stable = |natural: f64| {
            let (a, b) = (1.4 * natural, natural * natural);
            let numerical = (1.0 - share) * k;
            exact::is_hurwitz(&[
                1.0,
                a + c,
                b + a * c + numerical,
                b * c + a * numerical,
                b * numerical + b * share * k,
            ])
        };
        let (mut low, mut high) = (1.0, 1e5);
        for _ in 0..100 {
            let middle = f64::sqrt(low * high);
            if is_stable(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        for (factor, grows) in [(0.9, false), (1.1, true)] {
            let transfers = [
                format!("delay_s = {}", factor * delay),
                format!(
                    "actuator.first_order = {{ time_constant_s = {} }}",
                    factor * lag
                ),
                format!(
                    "actuator.second_order = {{ frequency_hz = {}, damping_ratio = 0.7 }}",
                    high / (2.0 * PI) / factor
                ),
            ];
            for transfer in transfers {
                let found = growth(ratio, share, &transfer);
                // A tenth of the damping remains or is missing: e^{∓0.1 ξ ω 100 s} or more.
                let wanted = libm::exp(0.05 * ratio * omega * 100.0);
                assert_eq!(
                    found > 1.0,
                    grows,
                    "ξ {ratio}, p {share}, {factor}: {transfer}: {found}"
                );
                assert!(
                    found > wanted || found < 1.0 / wanted,
                    "{transfer}: {found}"
                );
            }
        }
    }
}

#[test]
fn noise_power_holds_before_time_passes() {
    let rms = |told: f64, dt: f64| {
        let mut plant = behind(
            "seed = 5\n[force_sensor]\nnoise_power_n2_s = 1e-3",
            spring(1.19e6, 0.0),
        );
        plant.commanded_every(told);
        let (n, mut sum, mut force) = (4000, 0.0, [0.0]);
        for _ in 0..n {
            plant.trial(&[0.0], &[0.0], dt, &mut force);
            plant.commit();
            sum += force[0] * force[0];
        }
        (sum / f64::from(n)).sqrt()
    };
    let exact = (1e-3 / DT).sqrt();
    // Five standard deviations of an rms of 4000 readings, 1/√8000 each.
    for (told, dt) in [(DT, 0.0), (DT, DT), (0.0, DT)] {
        assert!((rms(told, dt) / exact - 1.0).abs() < 0.056, "{told} {dt}");
    }
    // A test that runs slower than its time is read as often as it is commanded.
    let slow = rms(100.0 * DT, DT) * 10.0;
    assert!((slow / exact - 1.0).abs() < 0.056, "{slow}");
    // The interval of commands is not announced.
    assert_eq!(rms(0.0, 0.0), 0.0);
}

fn law(text: &str) -> Box<dyn Specimen> {
    let law: LawSpec = toml::from_str(text).unwrap();
    SpecimenLaw::Law(law).build(1).unwrap()
}

/// Part of the specimen's force that is missing in the actuator's equations at the end of the last trial.
fn left_over(plant: &mut Transfer, dt: f64) -> f64 {
    let mut force = [0.0];
    plant.law.trial(&plant.disp, &plant.vel, dt, &mut force);
    plant.axes[0].clone().correct(force[0])
}

#[test]
fn coarse_ticks_converge_with_sharp_laws() {
    let laws = [
        "bilinear = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.05 }",
        "cubic = { stiffness_n_per_m = 2e5, cubic_n_per_m3 = 1e11 }",
        "parallel = [{ linear = { stiffness_n_per_m = 2e5 } }, \
         { bilinear = { stiffness_n_per_m = 3e6, yield_force_n = 900.0, post_yield_ratio = 0.0 } }]",
    ];
    for (text, rate) in laws
        .iter()
        .flat_map(|law| [1000, 400, 200, 100].map(|rate| (law, rate)))
    {
        let mut plant = behind("actuator.servo_hydraulic = {}", law(text));
        let dt = 1.0 / f64::from(rate);
        let mut force = [0.0];
        for k in 0..2 * rate {
            let disp = [6e-3 * libm::sin(9.0 * dt * f64::from(k))];
            let dt = if k == 0 { 0.0 } else { dt };
            plant.trial(&disp, &[0.0], dt, &mut force);
            assert!(plant.is_settled(), "{text} at {rate} Hz, tick {k}");
            let left = left_over(&mut plant, dt);
            assert!(left <= SETTLED, "{text} at {rate} Hz, tick {k}: {left:e}");
            plant.commit();
        }
    }
}

/// A force that jumps where the specimen passes zero: nothing is in equilibrium between.
#[derive(Debug, Default)]
struct Jump;

impl Specimen for Jump {
    fn axes(&self) -> usize {
        1
    }
    fn trial(&mut self, disp: &[f64], _: &[f64], _: f64, force: &mut [f64]) {
        force[0] = 2e4_f64.copysign(disp[0]);
    }
    fn commit(&mut self) {}
    fn revert(&mut self) {}
    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        (stiffness[0], damping[0], mass[0]) = (1e5, 0.0, 0.0);
    }
    fn tangent(&self, stiffness: &mut [f64]) {
        stiffness[0] = 0.0;
    }
    fn bound(&self, _: &[Reach], _: &mut [f64], _: &mut [f64]) -> Result<(), usize> {
        Ok(())
    }
}

gusset_quantity::state! { Jump {} }

#[test]
fn failed_convergence_is_reported() {
    let mut plant = behind("actuator.servo_hydraulic = {}", Box::new(Jump));
    let (dt, mut force, mut unsettled) = (0.01, [0.0], 0);
    for k in 0..300 {
        let disp = [2e-3 * libm::cos(9.0 * dt * f64::from(k))];
        plant.trial(&disp, &[0.0], if k == 0 { 0.0 } else { dt }, &mut force);
        assert!(force[0].is_finite() && plant.achieved()[0].abs() < 0.1);
        if left_over(&mut plant, dt) > SETTLED {
            unsettled += usize::from(!plant.is_settled());
            assert!(!plant.is_settled(), "tick {k}");
        }
        plant.commit();
    }
    assert!(unsettled > 0, "it cannot be in equilibrium everywhere");
}
