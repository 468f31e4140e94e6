use nalgebra::{Complex, ComplexField as _};

use super::*;
use gusset_actuator::compensation::CompensationSpec;
use gusset_actuator::transfer::BetweenTicks;
use gusset_motion::{Grid, Motion as GroundMotion, Quantity};

const DT: f64 = 1.0 / RATE_HZ;

/// A synthetic earthquake with the peak of El Centro times 0.4.
fn ground(seconds: f64) -> Vec<f64> {
    let text = format!(
        "signal.kanai_tajimi = {{ ground_angular_frequency_rad_per_s = 15.0, ground_damping_ratio = 0.6, \
         envelope.jennings_housner = {{ rise_s = 2.0, strong_s = 8.0, decay_per_s = 0.2 }}, duration_s = {seconds}, \
         seed = 3, peak = 1.254 }}"
    );
    let motion: GroundMotion = toml::from_str(&text).unwrap();
    let grid = Grid::new(DT, (seconds * RATE_HZ) as usize).unwrap();
    let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
    motion
        .evaluate(Quantity::Acceleration, grid, &none)
        .unwrap()
        .values
}

struct Found {
    criteria: Criteria,
    saturated: usize,
    /// Largest first floor over the reference's.
    growth: f64,
}

fn find(case: usize, controller: &str, ground: &[f64], change: impl Fn(&mut Setup<'_>)) -> Found {
    let frame = Frame::case(case).unwrap();
    let spec: CompensationSpec = toml::from_str(controller).unwrap();
    let mut controller = spec.build(DT).unwrap();
    controller.reset(0.0);
    let mut setup = Setup {
        frame: &frame,
        plant: Plant::default(),
        wiring: Wiring::Benchmark,
        noise: None,
        quantum: 0.0,
        ground,
        late: 0,
        force_limit: FORCE_LIMIT_N,
    };
    change(&mut setup);
    let outcome = run(&setup, controller.as_mut());
    let linear = reference(&frame, ground);
    let peak = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    Found {
        criteria: Criteria::of(&outcome.histories, &linear, DT),
        saturated: outcome.saturated,
        growth: peak(&outcome.histories.floors[0]) / peak(&linear[0]),
    }
}

#[test]
fn frame_has_its_published_frequencies() {
    let wanted = [
        [3.612, 15.997, 38.086],
        [3.444, 15.252, 36.314],
        [3.168, 14.030, 33.404],
        [3.612, 15.997, 38.086],
    ];
    for (case, wanted) in (1..).zip(wanted) {
        let frame = Frame::case(case).unwrap();
        let mut found: Vec<f64> = frame
            .stiffness
            .symmetric_eigenvalues()
            .iter()
            .map(|k| (k / frame.mass).sqrt() / std::f64::consts::TAU)
            .collect();
        found.sort_by(f64::total_cmp);
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(
                (found - wanted).abs() < 6e-4,
                "case {case}: {found} {wanted}"
            );
        }
    }
    assert!(Frame::case(0).is_none() && Frame::case(5).is_none());
}

/// L(iω) = Z_e(iω) [Z_N(iω)⁻¹]₁₁.
fn loop_gain(frame: &Frame, omega: f64) -> Complex<f64> {
    let part = frame.numerical();
    let s = Complex::new(0.0, omega);
    let numerical = nalgebra::Matrix3::from_fn(|i, j| {
        let mass = if i == j { part.mass[i] } else { 0.0 };
        s * s * mass + s * part.damping[(i, j)] + part.stiffness[(i, j)]
    });
    let (m, c, k) = SPECIMEN;
    (s * s * m + s * c + k) * numerical.try_inverse().unwrap()[(0, 0)]
}

#[test]
fn cases_have_published_critical_delays() {
    let wanted = [(14.64, 3.587), (12.22, 3.429), (9.92, 3.160), (8.73, 3.603)];
    for (case, (delay, hertz)) in (1..).zip(wanted) {
        let frame = Frame::case(case).unwrap();
        let mut best = (f64::INFINITY, 0.0);
        let mut last = loop_gain(&frame, 1.0).modulus() - 1.0;
        for step in 1..60_000 {
            let omega = 1.0 + f64::from(step) * 5e-3;
            let gain = loop_gain(&frame, omega);
            let now = gain.modulus() - 1.0;
            if now * last < 0.0 {
                let omega = omega - 5e-3 * now / (now - last);
                let delay = (std::f64::consts::PI + loop_gain(&frame, omega).argument()) / omega;
                if delay < best.0 {
                    best = (delay, omega);
                }
            }
            last = now;
        }
        // Printed to 0.01 ms and 0.001 Hz.
        let found = (best.0 * 1e3, best.1 / std::f64::consts::TAU);
        assert!((found.0 - delay).abs() < 0.0051, "case {case}: {found:?}");
        assert!((found.1 - hertz).abs() < 5.1e-4, "case {case}: {found:?}");
    }
}

#[test]
fn every_case_is_unstable_uncompensated() {
    let ground = ground(20.0);
    for case in 1..=4 {
        let limited = find(case, "none = {}", &ground, |_| {});
        assert!(
            limited.saturated > 1000,
            "case {case}: at the limit of force in {} ticks",
            limited.saturated
        );
        let free = find(case, "none = {}", &ground, |setup| {
            setup.force_limit = f64::INFINITY
        });
        assert!(free.growth > 2.0, "case {case}: {}", free.growth);
    }
}

#[test]
fn extrapolation_drives_the_second_mode() {
    let ground = ground(20.0);
    for case in 1..=4 {
        for order in [2, 3] {
            let text = format!("polynomial = {{ order = {order}, delay_s = 0.024 }}");
            let found = find(case, &text, &ground, |setup| setup.noise = Some(1));
            assert!(
                found.saturated > 1000,
                "case {case}, order {order}: {}",
                found.saturated
            );
        }
    }
}

#[test]
fn tracking_kinds_are_stable_in_every_case() {
    let ground = ground(15.0);
    for case in 1..=4 {
        for (controller, most) in [
            ("pi_lead = {}", 20.0),
            ("inverse = { delay_s = 0.026 }", 30.0),
            (
                "ats = { delay_s = 0.024, start = [1.0, 0.0249, 1.07e-4] }",
                10.0,
            ),
            ("amb = {}", 10.0),
        ] {
            let found = find(case, controller, &ground, |setup| setup.noise = Some(1));
            assert_eq!(found.saturated, 0, "case {case} {controller}");
            let [_, j2, ..] = found.criteria.j;
            assert!(j2 < most, "case {case} {controller}: {:?}", found.criteria);
        }
    }
}

/// Target and measurement of one tick: what learns finds the plant of that tick, with the half tick by which a held command is
/// late. A pair that is a tick apart leaves a bias of a whole tick, 0.244 ms; the four weights leave an eighth of one.
#[test]
fn adaptive_kinds_have_no_bias_of_a_tick() {
    let ground = ground(12.0);
    let tick_ms = 1e3 * DT;
    for case in [1, 3] {
        for controller in [
            "ats = { start = [1.0, 0.0249, 1.07e-4] }",
            "amb = { lower = [0, 0, 0, 0], upper = [1e9, 1e9, 1e9, 1e9], rate_per_s = [1e9, 1e9, 1e9, 1e9] }",
            "recursive_fir = { delay_s = 0.024, start_variance_per_m2 = 1e12 }",
        ] {
            let found = find(case, controller, &ground, |_| {});
            let criteria = found.criteria;
            assert_eq!(criteria.j[0], 0.0, "case {case} {controller}: {criteria:?}");
            let bias = criteria.delay_ms.abs() / tick_ms;
            assert!(bias < 0.25, "case {case} {controller}: {bias} ticks");
        }
    }
}

/// A held command arrives half a tick before one that ramps; a compensator that does not learn leaves the difference.
#[test]
fn held_command_leads_a_ramp_by_half_a_tick() {
    let ground = ground(15.0);
    let delay = |between_ticks: BetweenTicks| {
        let controller = "model_inverse = { coefficients = [1.0, 0.0249, 1.07e-4] }";
        let set = |setup: &mut Setup<'_>| setup.wiring = Wiring::InTick(between_ticks);
        find(1, controller, &ground, set).criteria.delay_ms
    };
    let lead = delay(BetweenTicks::Ramped) - delay(BetweenTicks::Held);
    let half = 0.5e3 * DT;
    // The two responses differ by the effect of the delay, which the metric weights differently: 2 %.
    assert!((lead / half - 1.0).abs() < 0.02, "{lead} {half}");
}

#[test]
fn quantisation_and_noise_are_separate() {
    let ground = ground(3.0);
    let is_whole = |quantum: f64, noise: Option<u64>| {
        let frame = Frame::case(1).unwrap();
        let spec: CompensationSpec = toml::from_str("amb = {}").unwrap();
        let mut controller = spec.build(DT).unwrap();
        controller.reset(0.0);
        let setup = Setup {
            frame: &frame,
            plant: Plant::default(),
            wiring: Wiring::Benchmark,
            noise,
            quantum,
            ground: &ground,
            late: 0,
            force_limit: FORCE_LIMIT_N,
        };
        let measured = run(&setup, controller.as_mut()).histories.measured;
        let whole = measured.iter().all(|x| (x / QUANTUM).fract() == 0.0);
        // A perfect sensor reads rest; a noisy one does not.
        (whole, measured[0] == 0.0)
    };
    assert_eq!(is_whole(QUANTUM, None), (true, true));
    assert_eq!(is_whole(0.0, None), (false, true));
    assert!(is_whole(QUANTUM, Some(1)).0);
    assert_eq!(is_whole(0.0, Some(1)), (false, false));
}

/// Error of the third floor, in per cent of its deviation, due to a force that comes one tick late, to first order in the
/// delay. The whole frame, linear and without a loop, is excited by the specimen's force now less that of a tick ago.
fn cost_of_a_tick(frame: &Frame, ground: &[f64], linear: &[f64]) -> f64 {
    let whole = frame.whole();
    let (m, c, k) = SPECIMEN;
    let (mut motion, mut late) = (Motion::REST, Motion::REST);
    let (mut before, mut third) = (0.0, Vec::new());
    for (tick, accel) in ground.iter().enumerate() {
        third.push(late.disp[2]);
        let pull = whole.load * *accel - whole.damping * motion.vel - whole.stiffness * motion.disp;
        let force = m * pull[0] / whole.mass[0] + c * motion.vel[0] + k * motion.disp[0];
        late = whole.runge_kutta(late, DT, [0.0; 2], before - force);
        before = force;
        let next = ground.get(tick + 1).copied().unwrap_or(*accel);
        motion = whole.runge_kutta(motion, DT, [*accel, next], 0.0);
    }
    100.0 * deviation(&third) / deviation(linear)
}

/// Sample standard deviation.
fn deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (squares / (n - 1.0)).sqrt()
}

/// d(n) is the distance of the third floor of a run n ticks late from the run without delay, per tick. It is d + d' n + …,
/// because the delay acts on a response that it has already changed, by 1.3 % to 2.2 % a tick here. So 2 d(1) − d(2) is d up to
/// the square of that, 5e-4. The delay also acts on the response that the tracker produces. That response differs by J7 of the
/// run without delay: this is the tolerance, 0.7 %. J7 itself is a norm, so it is n d(n) up to its value without delay.
#[test]
fn tick_of_latency_costs_as_computed() {
    let ground = ground(20.0);
    for case in 1..=4 {
        let frame = Frame::case(case).unwrap();
        let linear = reference(&frame, &ground);
        let cost = cost_of_a_tick(&frame, &ground, &linear[2]);
        for controller in [
            "amb = {}",
            "ats = { delay_s = 0.024, start = [1.0, 0.0249, 1.07e-4] }",
        ] {
            let late = |late: usize| {
                let spec: CompensationSpec = toml::from_str(controller).unwrap();
                let mut controller = spec.build(DT).unwrap();
                controller.reset(0.0);
                let setup = Setup {
                    frame: &frame,
                    plant: Plant::default(),
                    wiring: Wiring::InTick(BetweenTicks::Ramped),
                    noise: None,
                    quantum: 0.0,
                    ground: &ground,
                    late,
                    force_limit: FORCE_LIMIT_N,
                };
                let histories = run(&setup, controller.as_mut()).histories;
                let j7 = Criteria::of(&histories, &linear, DT).j[6];
                (j7, histories.floors)
            };
            let (in_time, [_, _, third]) = late(0);
            assert!(in_time < 0.7, "case {case} {controller}: {in_time}");
            let mut per_tick = Vec::new();
            for n in 1..=3 {
                let (j7, [_, _, floor]) = late(n);
                let apart: Vec<f64> = floor.iter().zip(&third).map(|(a, b)| a - b).collect();
                let all = 100.0 * deviation(&apart) / deviation(&linear[2]);
                // A hair for the sums' order.
                let room = in_time * (1.0 + 1e-9);
                assert!(
                    (j7 - all).abs() <= room,
                    "case {case} {controller}: {j7} {all}"
                );
                per_tick.push(all / n as f64);
            }
            let found = 2.0 * per_tick[0] - per_tick[1];
            assert!(
                (found / cost - 1.0).abs() < 0.007,
                "case {case} {controller}: {found} {cost}"
            );
        }
        if case == 1 {
            // "About 1.1 %" of the benchmark's first case, whatever the record: a share, not a size.
            assert!((cost - 1.1).abs() < 0.05, "{cost}");
        }
    }
}

#[test]
fn drawn_plants_have_the_published_spread() {
    let n = 2000;
    let drawn: Vec<Plant> = (1..=n).map(|number| Plant::drawn(9, number)).collect();
    assert_eq!(Plant::drawn(9, 0), Plant::default());
    assert_eq!(drawn[4], Plant::drawn(9, 5));
    let spread = |of: fn(&Plant) -> f64| {
        let mean = drawn.iter().map(of).sum::<f64>() / n as f64;
        (drawn
            .iter()
            .map(|p| (of(p) - mean) * (of(p) - mean))
            .sum::<f64>()
            / n as f64)
            .sqrt()
    };
    // Standard error of a deviation: 1/√(2n) = 1.6 %; five of them. The leakage is cut at zero, 2.5 deviations below.
    for (found, wanted) in [
        (spread(|p| p.stiffness), 5e4),
        (spread(|p| p.servo.valve_damping_per_s), 3.3),
        (spread(|p| p.servo.valve_stiffness_per_s2), 3.3e3),
        (spread(|p| p.servo.leakage_per_s), 1.3),
    ] {
        assert!((found / wanted - 1.0).abs() < 0.08, "{found} {wanted}");
    }
    assert!(drawn.iter().all(|p| p.servo.leakage_per_s >= 0.0));
}

#[test]
fn unstable_roots_confirm_the_cases() {
    use gusset_actuator::transfer::TransferSpec;
    use gusset_numerics::spectral::unstable_roots;
    let plant: TransferSpec = toml::from_str("actuator.servo_hydraulic = {}").unwrap();
    let (m, c, k) = SPECIMEN;
    for case in 1..=4 {
        let frame = Frame::case(case).unwrap();
        let felt = |omega: f64| {
            let s = Complex::new(0.0, omega);
            let whole = nalgebra::Matrix3::from_fn(|i, j| {
                let mass = if i == j { frame.mass } else { 0.0 };
                s * s * mass + s * frame.damping[(i, j)] + frame.stiffness[(i, j)]
            });
            (s * s * m + s * c + k) * whole.try_inverse().unwrap()[(0, 0)]
        };
        for (controller, is_stable) in [
            ("none = {}", false),
            ("polynomial = { order = 2, delay_s = 0.024 }", false),
            ("polynomial = { order = 3, delay_s = 0.024 }", false),
            ("inverse = { delay_s = 0.026 }", true),
        ] {
            let spec: CompensationSpec = toml::from_str(controller).unwrap();
            let chain = |omega: f64| {
                let follows = spec.response(omega, DT)? * plant.response(omega, k, c);
                Some((follows - 1.0) * felt(omega) + 1.0)
            };
            let roots = unstable_roots(chain, 1e-2, 0.9 * std::f64::consts::PI / DT, &[]);
            assert_eq!(
                roots == Some(0),
                is_stable,
                "case {case} {controller}: {roots:?}"
            );
        }
    }
}
