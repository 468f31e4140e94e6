use std::f64::consts::PI;

use nalgebra::{Complex, ComplexField as _};

use super::polynomial::{horiuchi_weights, lagrange_weights};
use super::*;
use gusset_quantity::state::{Stateful, TestState};

const DT: f64 = 1.0 / 4096.0;

fn build(text: &str) -> Box<dyn Compensator> {
    let spec: CompensationSpec = toml::from_str(text).unwrap();
    spec.build(DT).unwrap()
}

const ALL: [&str; 10] = [
    "none = {}",
    "polynomial = { order = 3, delay_s = 0.0105 }",
    "polynomial = { order = 2, delay_s = 0.001, nodes = \"step\" }",
    "newton = { delay_s = 0.01 }",
    "inverse = { delay_s = 0.02 }",
    "model_inverse = { coefficients = [1.0, 0.02, 8e-5] }",
    "ats = { delay_s = 0.02 }",
    "amb = {}",
    "recursive_fir = { delay_s = 0.02 }",
    "pi_lead = {}",
];

/// A target with several frequencies, its backward velocity and acceleration.
fn target(k: i32) -> (f64, f64, f64) {
    let at = |k: i32| {
        let t = f64::from(k.max(0)) * DT;
        3e-3 * libm::sin(2.0 * PI * 3.1 * t) + 1e-3 * libm::sin(2.0 * PI * 7.3 * t)
    };
    let (a, b, c) = (at(k), at(k - 1), at(k - 2));
    (a, (a - b) / DT, (a - 2.0 * b + c) / (DT * DT))
}

#[test]
fn weights_are_published_and_exact() {
    assert_eq!(horiuchi_weights(1)[..2], [2.0, -1.0]);
    assert_eq!(horiuchi_weights(2)[..3], [3.0, -3.0, 1.0]);
    assert_eq!(horiuchi_weights(3)[..4], [4.0, -6.0, 4.0, -1.0]);
    assert_eq!(horiuchi_weights(4), [5.0, -10.0, 10.0, -5.0, 1.0]);
    for order in 1..=4 {
        // On nodes as far apart as the lead both are the same.
        for (a, b) in lagrange_weights(order, 1.0)
            .iter()
            .zip(horiuchi_weights(order))
        {
            assert!((a - b).abs() < 1e-12);
        }
        let weights = lagrange_weights(order, 2.7);
        for power in 0..=order as i32 {
            let sum: f64 = (0..5).map(|j| weights[j] * (-(j as f64)).powi(power)).sum();
            let wanted = 2.7_f64.powi(power);
            assert!((sum - wanted).abs() < 1e-10 * wanted, "{order} {power}");
        }
    }
}

#[test]
fn all_kinds_hold_the_first_target() {
    for text in ALL {
        let mut one = build(text);
        one.reset(2e-3);
        for _ in 0..50 {
            let command = one.predict(2e-3, 0.0, 0.0);
            // A hold teaches only the roundoff of the filters.
            assert!((command - 2e-3).abs() < 1e-12, "{text}: {command}");
            one.observe(command, 2e-3);
        }
    }
}

#[test]
fn lead_of_an_adaptive_kind_is_its_command() {
    for text in ALL {
        let mut one = build(text);
        one.reset(0.0);
        let learns = one.bounds().iter().any(|(lower, upper)| lower < upper);
        let same = one.regulate(2e-3) == 2e-3;
        assert!(!learns || same, "{text}");
    }
}

#[test]
fn three_forms_on_steps_give_equal_weights() {
    let delay = 0.0031;
    let pairs = [
        (
            "newton = { delay_s = 0.0031 }",
            "polynomial = { order = 2, delay_s = 0.0031, nodes = \"step\" }",
        ),
        (
            "inverse = { delay_s = 0.0031 }",
            "polynomial = { order = 1, delay_s = 0.0031, nodes = \"step\" }",
        ),
    ];
    for (a, b) in pairs {
        let (mut a, mut b) = (build(a), build(b));
        a.reset(0.0);
        b.reset(0.0);
        for k in 1..400 {
            let (disp, vel, accel) = target(k);
            let (x, y) = (a.predict(disp, vel, accel), b.predict(disp, vel, accel));
            // Weights of the polynomial are up to η²/2 = 80 and cancel.
            assert!(
                (x - y).abs() < 80.0 * 8.0 * f64::EPSILON * 4e-3,
                "{k}: {x} {y}"
            );
        }
    }
    // The Taylor form with ½τ² would be off by ½ τ Δt w.
    let (_, _, accel) = target(200);
    assert!((0.5 * delay * DT * accel).abs() > 1e-7);
}

#[test]
fn compensated_delay_follows_h_of_theta() {
    // A complex exponential through target → polynomial → delay of whole ticks, as sine and cosine side by side.
    let ticks = 40;
    let delay = f64::from(ticks) * DT;
    for order in 1..=4_i32 {
        for theta in [0.05, 0.4, 1.0, 1.5] {
            let omega = theta / delay;
            let text = format!("polynomial = {{ order = {order}, delay_s = {delay:?} }}");
            let mut parts = [build(&text), build(&text)];
            let mut sent: Vec<Complex<f64>> = vec![];
            for k in 0..400_i32 {
                let (s, c) = libm::sincos(omega * f64::from(k) * DT);
                let [a, b] = &mut parts;
                sent.push(Complex::new(a.predict(c, 0.0, 0.0), b.predict(s, 0.0, 0.0)));
            }
            let now = 399;
            let (s, c) = libm::sincos(omega * f64::from(now) * DT);
            let found = sent[(now - ticks) as usize] / Complex::new(c, s);
            let (s, c) = libm::sincos(-theta);
            let wanted = Complex::new(1.0, 0.0)
                - (Complex::new(1.0, 0.0) - Complex::new(c, s)).powi(order + 1);
            assert!(
                (found - wanted).modulus() < 1e-11,
                "{order} {theta}: {found} {wanted}"
            );
            // Added damping has the sign of Im H, as documented.
            match order {
                1 => assert!(wanted.im < 0.0),
                2 => assert_eq!(wanted.im >= 0.0, theta <= PI / 3.0),
                3 => assert_eq!(wanted.im >= 0.0, theta <= PI / 2.0),
                _ => assert!(theta > 0.5 || wanted.im < 0.0),
            }
        }
    }
}

/// Drives a compensator through a first-order lag T and returns it with the largest error of the last second.
fn through_lag(text: &str, lag: f64, seconds: f64) -> (Box<dyn Compensator>, f64) {
    let mut one = build(text);
    one.reset(0.0);
    let decay = libm::exp(-DT / lag);
    // Exact for a ramp: x⁺ = x e^{−h} + u₀ (1 − e^{−h}) + (u₁ − u₀)(1 − (1 − e^{−h})/h), h = Δt/T.
    let end = 1.0 - (1.0 - decay) * lag / DT;
    let (mut x, mut last, mut worst) = (0.0, 0.0, 0.0f64);
    let n = (seconds / DT) as i32;
    for k in 1..n {
        let (disp, vel, accel) = target(k);
        let command = one.predict(disp, vel, accel);
        x = x * decay + last * (1.0 - decay) + (command - last) * end;
        last = command;
        one.observe(command, x);
        if k > n - 4096 {
            worst = worst.max((x - disp).abs());
        }
    }
    (one, worst)
}

#[test]
fn ats_inverts_a_first_order_lag() {
    let lag = 0.02;
    let (ats, error) = through_lag(
        "ats = { delay_s = 0.015, gain = 1.05, upper = [1.4, 0.1, 1e-3] }",
        lag,
        20.0,
    );
    // a0 = 1, a1 = T, a2 = T Δt/2 from the backward difference.
    let [a0, a1, a2] = *ats.parameters() else {
        panic!("three coefficients")
    };
    assert!((a0 - 1.0).abs() < 1e-5, "{a0}");
    // No coefficient represents the T Δt²/6 of the third derivative: 4e-7 of T at 7 Hz, distributed by the fit.
    assert!((a1 - lag).abs() < 5e-5 * lag, "{a1}");
    assert!((a2 - lag * DT / 2.0).abs() < 0.01 * lag * DT / 2.0, "{a2}");
    // T Δt²/6 · d⃛ = 2e-10 s³ · 100 m/s³.
    assert!(error < 1e-7, "{error}");
}

#[test]
fn adaptive_kinds_improve_on_their_start() {
    let lag = 0.02;
    for (text, bound) in [
        (
            "amb = { start = [1.0, 0.012, 2e-5, 1e-8], upper = [1.4, 0.05, 1e-3, 1e-5] }",
            0.3,
        ),
        ("recursive_fir = { delay_s = 0.012 }", 0.1),
        ("ats = { delay_s = 0.012 }", 0.1),
    ] {
        let (_, early) = through_lag(text, lag, 1.0);
        let (one, late) = through_lag(text, lag, 30.0);
        assert!(
            late < bound * early,
            "{text}: {early} then {late}, {:?}",
            one.parameters()
        );
        for (value, (lower, upper)) in one.parameters().iter().zip(one.bounds()) {
            assert!((lower..=upper).contains(&value));
        }
    }
}

#[test]
fn forgetting_does_not_wind_up_at_rest() {
    // A slow, narrow motion through a lag, with 10 µm of noise: two of four weights can be identified, two cannot.
    let lag = 0.02;
    let mut one = build("recursive_fir = { delay_s = 0.01, forgetting = 0.999 }");
    one.reset(0.0);
    let decay = libm::exp(-DT / lag);
    let (mut x, mut most, mut largest) = (0.0, 0.0f64, 0.0f64);
    let mut state = 1u64;
    for k in 1..(30.0 / DT) as i32 {
        let t = f64::from(k) * DT;
        let disp = 3e-3 * libm::sin(2.0 * PI * 0.7 * t) + 3e-3 * libm::sin(2.0 * PI * 1.9 * t);
        let command = one.predict(disp, 0.0, 0.0);
        x = x * decay + command * (1.0 - decay);
        // A generator of the congruent kind: even numbers between ±17 µm.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let noise = ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 34e-6;
        one.observe(command, x + noise);
        most = most.max(command.abs());
        largest = largest.max(disp.abs());
    }
    // The inverse of the lag at 1.9 Hz is 1.03 and the weights are within a few per cent of it.
    assert!(most < 1.2 * largest, "{most} for {largest}");
}

/// Numbers of the congruent kind, evenly from −1 to 1.
fn scatter(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1);
    (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A pure delay and a first-order lag, as published for four weights that only have a meaning together.
#[test]
fn coupled_weights_lead_any_motion_size() {
    let (delay, lag) = (0.012, 0.006);
    for rate in [250.0, 1000.0] {
        let dt = 1.0 / rate;
        let spec: CompensationSpec = toml::from_str("recursive_fir = { delay_s = 0.015 }").unwrap();
        for size in [0.02, 0.05, 0.1, 0.2] {
            for (sweeps, noise) in [(false, 0.0), (false, 1e-5), (true, 0.0), (true, 1e-5)] {
                let mut fir = spec.build(dt).unwrap();
                fir.reset(0.0);
                let decay = libm::exp(-dt / lag);
                let mut on_the_way =
                    std::collections::VecDeque::from(vec![0.0; (delay * rate) as usize]);
                let (mut x, mut seed, mut most, mut late) = (0.0, 1, 0.0f64, 0.0f64);
                let n = (10.0 * rate) as i32;
                for k in 0..n {
                    let t = f64::from(k) * dt;
                    let eased = t.min(1.0) * t.min(1.0) * (3.0 - 2.0 * t.min(1.0));
                    // 0.3 to 4 Hz in ten seconds, or 1 Hz.
                    let turns = if sweeps { 0.3 * t + 0.185 * t * t } else { t };
                    let target = size * eased * libm::sin(2.0 * PI * turns);
                    let command = fir.predict(target, 0.0, 0.0);
                    on_the_way.push_back(command);
                    x += (1.0 - decay) * (on_the_way.pop_front().unwrap() - x);
                    // The root mean square of even numbers is 1/√3.
                    fir.observe(command, x + noise * 3.0_f64.sqrt() * scatter(&mut seed));
                    most = most.max(command.abs());
                    if k > n - 2 * rate as i32 {
                        late = late.max((x - target).abs());
                    }
                    let sum = fir.stands(1.0);
                    assert!(
                        (0.7 - 1e-9..=1.4 + 1e-9).contains(&sum),
                        "{size} {sweeps}: {sum}"
                    );
                }
                let all = format!(
                    "{rate} {size} {sweeps} {noise}: {most} {late} {:?}",
                    fir.parameters()
                );
                // A lag requires 1 % more than the target at 4 Hz.
                assert!(most < 1.1 * size, "{all}");
                // At the end of the sweep the smallest motion has determined three more weights than one least well: 1.2 %.
                assert!(late < 0.02 * size, "{all}");
            }
        }
    }
}

#[test]
fn adaptation_keeps_bounds_and_rates() {
    for text in [
        "ats = { delay_s = 0.02 }",
        "amb = {}",
        "recursive_fir = { delay_s = 0.02 }",
    ] {
        let mut one = build(text);
        one.reset(0.0);
        let mut last = one.parameters().to_vec();
        let bounds = one.bounds().to_vec();
        let mut state = 1_u64;
        for k in 0..20_000 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let noise = (state >> 33) as f64 / 2e9 - 1.0;
            let command = one.predict(target(k).0, 0.0, 0.0);
            let measured = match k % 1000 {
                0..5 => 1e9 * noise,
                _ => 0.01 * noise,
            };
            one.observe(command, measured);
            for ((value, last), (lower, upper)) in
                one.parameters().iter().zip(&mut last).zip(&bounds)
            {
                assert!((lower..=upper).contains(&value), "{text}: {value}");
                let most = 0.5 * (upper - lower) * DT;
                assert!((value - *last).abs() <= most * (1.0 + 1e-9), "{text}");
                *last = *value;
            }
            assert!(command.is_finite());
        }
    }
}

/// A predicted and amended target leaves only roundoff, with weights up to 1e4 at 4 mm.
#[test]
fn amended_target_leaves_no_trace() {
    for text in ALL {
        let (mut one, mut two) = (build(text), build(text));
        one.reset(0.0);
        two.reset(0.0);
        for k in 1..400 {
            let (disp, vel, accel) = target(k);
            one.lead(disp, vel, accel);
            if k == 395 {
                two.lead(disp + 1e-4, vel, accel);
                two.amend(disp);
            } else {
                two.lead(disp, vel, accel);
            }
        }
        let (disp, vel, accel) = target(400);
        let (a, b) = (one.lead(disp, vel, accel), two.lead(disp, vel, accel));
        assert!((a - b).abs() < 1e-12, "{text}: {a} {b}");
    }
}

/// The lead of a target that has long been at rest is that of a place at rest, whatever was learnt before.
#[test]
fn target_at_rest_is_led_as_a_place_at_rest() {
    for text in ALL {
        let (mut one, _) = through_lag(text, 0.02, 2.0);
        let led = (0..8192).map(|_| one.lead(2e-3, 0.0, 0.0)).last().unwrap();
        // A lead of 8570 per second, the slowest here, is forgotten in a few ticks; the sum of weights is 1 to roundoff.
        assert!((led - one.stands(2e-3)).abs() < 1e-12, "{text}: {led}");
    }
}

#[test]
fn nothing_is_learnt_without_motion() {
    let mut one = build("ats = { delay_s = 0.02 }");
    one.reset(0.0);
    let before = one.parameters().to_vec();
    for k in 0..10_000 {
        let command = one.predict(0.0, 0.0, 0.0);
        one.observe(command, 1e-5 * libm::sin(f64::from(k)));
    }
    assert_eq!(before, one.parameters());
}

#[test]
fn sample_controller_matches_tustin() {
    // Open loop (nothing measured): a sine through lead and PI against both transfer functions at z = e^{iωΔt}.
    let mut one = build("pi_lead = {}");
    one.reset(0.0);
    let omega = 2.0 * PI * 5.0;
    let n = 40_960;
    let (mut re, mut im) = (0.0, 0.0);
    for k in 0..n {
        let t = f64::from(k) * DT;
        let out = one.predict(libm::sin(omega * t), 0.0, 0.0);
        if k >= n - 8192 {
            // Two seconds are ten whole periods; the integrator's constant drops out.
            re += out * libm::sin(omega * t) / 4096.0;
            im += out * libm::cos(omega * t) / 4096.0;
        }
    }
    let (s, c) = libm::sincos(omega * DT);
    let z = Complex::new(c, s);
    let tustin = (z - 1.0) / (z + 1.0) * (2.0 / DT);
    let lead = (tustin * 50.831_633_6 + 8_570.397_34) / (tustin + 8_570.397_34);
    let wanted = lead * (Complex::new(2.0, 0.0) + Complex::new(95.0, 0.0) / tustin);
    assert!(
        (re - wanted.re).abs() < 1e-6 && (im - wanted.im).abs() < 1e-6,
        "{re} {im} {wanted}"
    );
}

/// Other parameters, whose states have other sizes.
const MORE: [&str; 6] = [
    "polynomial = { order = 4, delay_s = 0.0301 }",
    "polynomial = { order = 1, delay_s = 0.0 }",
    "model_inverse = { coefficients = [0.97, 0.02, 8e-5, 1e-7] }",
    "ats = { delay_s = 0.03, order = 3, window_s = 0.25 }",
    "ats = { delay_s = 0.01, order = 1, window_s = 0.05, filter_hz = 100 }",
    "recursive_fir = { delay_s = 0.03, spacing_s = 0.0009765625, forgetting = 0.999 }",
];

#[test]
fn restored_compensator_has_the_same_bits() {
    let step = |one: &mut Box<dyn Compensator>, k: i32| {
        let (disp, vel, accel) = target(k);
        let command = one.predict(disp, vel, accel);
        // Not every tick may teach it anything.
        if k % 11 == 0 {
            one.notice(command, 0.98 * target(k - 60).0);
        } else {
            one.observe(command, 0.98 * target(k - 60).0);
        }
        command
    };
    for text in ALL.into_iter().chain(MORE) {
        // Within the first window, at its end, and in a later one.
        for taken in [3, 100, 4100, 6000] {
            let mut one = build(text);
            one.reset(1e-3);
            for k in 0..taken {
                step(&mut one, k);
            }
            let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
            let mut two = build(text);
            two.reset(0.0);
            for k in 0..17 {
                step(&mut two, k);
            }
            state.restore(|visit| two.visit_state(visit)).unwrap();
            let count = allocation_counter::measure(|| {
                for k in taken..taken + 500 {
                    assert_eq!(
                        step(&mut one, k).to_bits(),
                        step(&mut two, k).to_bits(),
                        "{text} {k}"
                    );
                }
            });
            assert_eq!(count.count_total, 0, "{text}");
            assert_eq!(one.parameters(), two.parameters());
        }
        let one = build(text);
        assert_eq!(one.parameters().len(), one.names().len());
    }
}

/// Each kind names itself: the state of one does not fit another, whatever its size.
#[test]
fn state_of_another_compensator_is_refused() {
    for (index, text) in ALL.into_iter().enumerate() {
        let mut one = build(text);
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        for (other, text) in ALL.into_iter().enumerate() {
            let mut two = build(text);
            let fits = state.restore(|visit| two.visit_state(visit)).is_ok();
            assert_eq!(fits, index == other, "{text}");
        }
    }
}

#[test]
fn invalid_compensation_is_refused_by_key() {
    for (text, key) in [
        ("polynomial = { order = 5, delay_s = 0.01 }", "order"),
        ("polynomial = { order = 2, delay_s = 5.0 }", "delay_s"),
        ("newton = { delay_s = -0.01 }", "delay_s"),
        ("inverse = { delay_s = nan }", "delay_s"),
        (
            "model_inverse = { coefficients = [1.0, 0.1, 0.1, 0.1, 0.1] }",
            "coefficients",
        ),
        ("model_inverse = { coefficients = [0.0] }", "coefficients"),
        ("ats = {}", "delay_s"),
        ("ats = { delay_s = 0.02, lower = [1.1, 0.0, 0.0] }", "lower"),
        ("ats = { delay_s = 0.02, upper = [1.1] }", "upper"),
        ("ats = { delay_s = 0.02, window_s = 9.0 }", "window_s"),
        ("ats = { delay_s = 0.02, filter_hz = 3000 }", "filter_hz"),
        (
            "recursive_fir = { delay_s = 0.02, forgetting = 1.1 }",
            "forgetting",
        ),
        (
            "recursive_fir = { delay_s = 0.02, spacing_s = 0.0003 }",
            "spacing_s",
        ),
        ("amb = { log10_gains = [nan, 0, 0, 0] }", "log10_gains"),
        ("pi_lead = { lead_corner_per_s = 0 }", "lead_corner_per_s"),
    ] {
        let spec: CompensationSpec = toml::from_str(text).unwrap();
        assert_eq!(spec.build(DT).unwrap_err().key(), key, "{text}");
    }
}
