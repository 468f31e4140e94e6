//! Every transfer system continues from a restored state with the same bits: in motion, in a hold, and in its ramps.

use super::*;

const LAW: &str = "parallel = [ \
    { bilinear = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1 } }, \
    { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 114.0 } } ]";

/// Ticks of one test, and how many of them a restored specimen is followed.
const TICKS: usize = 260;
const FOLLOWED: usize = 80;

/// A state is taken after these ticks: in motion, in a hold, in its ramps, and after the stroke has ended.
const TAKEN: [usize; 6] = [3, 21, 24, 28, 75, 160];

/// One description for each kind of actuator, delay, command between ticks, limits and sensors.
fn all() -> Vec<String> {
    let actuators = [
        "",
        "actuator.proportional = { gain = 0.98 }\n",
        "actuator.first_order = { time_constant_s = 0.004 }\n",
        "actuator.second_order = { frequency_hz = 25.0, damping_ratio = 0.6 }\n",
        "actuator.servo_hydraulic = {}\n",
    ];
    let mut all = Vec::new();
    for actuator in actuators {
        for delay in ["", "delay_s = 0.0041\n"] {
            for between in ["", "between_ticks = \"held\"\n"] {
                for limits in ["", "stroke_m = 4e-3\nforce_limit_n = 1500.0\n"] {
                    for sensors in [
                        "",
                        "seed = 5\n[disp_sensor]\nnoise_power_m2_s = 1e-14\ndrift_m_per_s = 1e-4\nquantum_m = 1e-7\n\
                         [force_sensor]\nnoise_rms_n = 2.0\nbias_n = 1.0\n",
                    ] {
                        let rate = if limits.is_empty() || actuator.contains("servo") {
                            ""
                        } else {
                            "rate_limit_m_per_s = 0.5\n"
                        };
                        all.push(format!("{actuator}{delay}{between}{limits}{rate}{sensors}"));
                    }
                }
            }
        }
    }
    all
}

/// Test time of a tick: held in each twentieth to twenty-sixth of forty, with hold ramps around it, and nothing in the
/// first.
fn tick_dt(k: usize) -> f64 {
    match k % 40 {
        _ if k == 0 => 0.0,
        16..20 => DT * (20 - k % 40) as f64 / 5.0,
        20..26 => 0.0,
        26..30 => DT * (k % 40 - 25) as f64 / 5.0,
        _ => DT,
    }
}

/// One tick, and everything that the loop sees of the specimen in it.
fn tick(plant: &mut Transfer, k: usize) -> (Vec<u64>, bool, bool) {
    let disp = [6e-3 * libm::sin(0.05 * k as f64), 2e-3];
    let vel = [0.3 * libm::cos(0.05 * k as f64), 0.0];
    let (mut force, mut measured) = ([0.0; 2], disp);
    plant.trial(&disp, &vel, tick_dt(k), &mut force);
    plant.measured(&mut measured);
    let seen = force.iter().chain(&measured).map(|value| value.to_bits());
    let seen = (seen.collect(), plant.is_saturated(), plant.is_settled());
    plant.commit();
    seen
}

#[test]
fn restored_transfer_has_the_same_bits() {
    let law: LawSpec = toml::from_str(LAW).unwrap();
    let law = SpecimenLaw::Law(law);
    let mut saturated = 0;
    for (index, text) in all().into_iter().enumerate() {
        // A server may not know the tick.
        let dt = (index % 3 > 0).then_some(DT);
        let build = || Transfer::new(&spec(&text), law.build(2).unwrap(), dt).unwrap();
        let mut one = build();
        let (mut seen, mut states) = (Vec::new(), Vec::new());
        for k in 0..TICKS {
            seen.push(tick(&mut one, k));
            if TAKEN.contains(&k) {
                let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
                states.push((k + 1, state));
            }
        }
        saturated += usize::from(seen.iter().any(|(_, saturated, _)| *saturated));
        for (first, state) in states {
            let mut other = build();
            // It need not be new.
            for k in 0..first % 7 {
                tick(&mut other, 3 * k);
            }
            state.restore(|visit| other.visit_state(visit)).unwrap();
            let again = TestState::of(|visit| other.visit_state(visit));
            assert_eq!(again.as_ref(), Ok(&state), "{text}");
            for (k, wanted) in seen.iter().enumerate().skip(first).take(FOLLOWED) {
                assert_eq!(tick(&mut other, k), *wanted, "{text} {first} {k}");
            }
        }
    }
    assert!(saturated > 20, "{saturated}");
}

#[test]
fn state_of_another_transfer_is_refused() {
    let states: Vec<TestState> = [
        "",
        "delay_s = 0.0041",
        "actuator.first_order = { time_constant_s = 0.004 }",
    ]
    .into_iter()
    .map(|text| {
        let mut plant = behind(text, spring(1e6, 0.0));
        TestState::of(|visit| plant.visit_state(visit)).unwrap()
    })
    .collect();
    let mut plant = behind(
        "actuator.second_order = { frequency_hz = 25.0, damping_ratio = 0.6 }",
        spring(1e6, 0.0),
    );
    for state in states {
        assert!(state.restore(|visit| plant.visit_state(visit)).is_err());
    }
}
