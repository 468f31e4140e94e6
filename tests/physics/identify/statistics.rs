//! The mathematics on records of simulated actuators: truth, bias and spread.

use gusset_actuator::specimen::{Specimen, SpecimenLaw};
use gusset_actuator::transfer::{Transfer, TransferSpec};
use gusset_motion::identify::{
    Band, Course, Identification, IdentifyError, Model, Record, Shape, identify,
};
use gusset_motion::{Grid, Quantity};
use gusset_numerics::law::LawSpec;
use nalgebra::ComplexField as _;

const RATE: f64 = 512.0;
const BAND: Band = Band {
    from_hz: 0.5,
    to_hz: 20.0,
};
const SECONDS: f64 = 8.0;
const REST: usize = 512;

struct Rig {
    rate: f64,
    band: Band,
    seconds: f64,
    shape: Shape,
    amplitude: f64,
}

const RIG: Rig = Rig {
    rate: RATE,
    band: BAND,
    seconds: SECONDS,
    shape: Shape::Sweep,
    amplitude: 1e-3,
};

struct Columns {
    command: Vec<f64>,
    measured: Vec<f64>,
    force: Vec<f64>,
}

impl Rig {
    fn command(&self) -> Vec<f64> {
        let dt = 1.0 / self.rate;
        let course = Course::new(self.shape, self.band, self.seconds, 1, dt).unwrap();
        let rest = REST as f64 * dt;
        let steps = (self.seconds * self.rate).ceil() as usize + 2 * REST;
        let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        let motion = course.motion(self.amplitude, rest);
        let grid = Grid::new(dt, steps).unwrap();
        motion
            .evaluate(Quantity::Displacement, grid, &none)
            .unwrap()
            .values
    }

    fn drive(&self, law: &str, transfer: &str) -> Columns {
        let dt = 1.0 / self.rate;
        let spec: TransferSpec = toml::from_str(transfer).unwrap();
        let law: LawSpec = toml::from_str(law).unwrap();
        let law = SpecimenLaw::Law(law).build(1).unwrap();
        let mut rig = Transfer::new(&spec, law, Some(dt)).unwrap();
        let command = self.command();
        let (mut measured, mut forces) = (Vec::new(), Vec::new());
        let mut before = command[0];
        for (k, &disp) in command.iter().enumerate() {
            let mut force = [0.0];
            let step = if k == 0 { 0.0 } else { dt };
            rig.trial(&[disp], &[(disp - before) / dt], step, &mut force);
            let mut read = [disp];
            rig.measured(&mut read);
            rig.commit();
            measured.push(read[0]);
            forces.push(force[0]);
            before = disp;
        }
        Columns {
            command,
            measured,
            force: forces,
        }
    }

    fn judge(&self, columns: &Columns) -> Result<Identification, IdentifyError> {
        let record = Record {
            dt: 1.0 / self.rate,
            command: &columns.command,
            measured: &columns.measured,
            force: &columns.force,
            rest: [REST; 2],
        };
        identify(&record, self.band)
    }

    fn identified(&self, law: &str, transfer: &str) -> Identification {
        self.judge(&self.drive(law, transfer)).unwrap()
    }
}

const SPRING: &str = "linear = { stiffness_n_per_m = 1.2e6, damping_n_s_per_m = 900.0 }";
const NOISE: &str = "disp_sensor = { noise_rms_m = 5e-6 }\nforce_sensor = { noise_rms_n = 20.0 }\n";

/// Over many seeds the errors in units of their standard errors have mean 0 and mean square 1.
fn honest(model: Model, damping: f64, transfer: &str, truths: &[(&str, f64)]) {
    let law = format!("linear = {{ stiffness_n_per_m = 1.2e6, damping_n_s_per_m = {damping:e} }}");
    const SEEDS: usize = 24;
    let mut scores: Vec<Vec<f64>> = vec![Vec::new(); truths.len() + 2];
    for seed in 0..SEEDS {
        let found = RIG.identified(&law, &format!("{NOISE}seed = {seed}\n{transfer}"));
        let fit = found.models.iter().find(|fit| fit.model == model).unwrap();
        for (place, (name, truth)) in truths.iter().enumerate() {
            let found = fit.parameter(name).unwrap();
            scores[place].push((found.value - truth) / found.std);
        }
        let specimen = found.specimen.unwrap();
        let (k, c) = (specimen.stiffness, specimen.damping);
        scores[truths.len()].push((k.value - 1.2e6) / k.std);
        scores[truths.len() + 1].push((c.value - damping) / c.std);
        // The best model explains the measurements to their noise: no other is better by more than chance.
        assert!(
            found.best().unwrap().residual <= fit.residual * (1.0 + 1e-9)
                || found.best().unwrap().model == model
        );
    }
    let names = truths.iter().map(|(name, _)| *name);
    for (name, scores) in names.chain(["stiffness", "damping"]).zip(scores) {
        let n = scores.len() as f64;
        let mean = scores.iter().sum::<f64>() / n;
        let square = scores.iter().map(|z| z * z).sum::<f64>() / n;
        // The mean of 24 such numbers is 0 ± 0.2, their mean square 1 ± √(2/24) = 1 ± 0.29: four of these.
        assert!(mean.abs() < 0.82, "{name}: mean {mean:.2} of {scores:?}");
        assert!(
            (0.25..2.2).contains(&square),
            "{name}: mean square {square:.2} of {scores:?}"
        );
    }
}

#[test]
fn first_order_lag_has_honest_errors() {
    let lag = "actuator.first_order = { time_constant_s = 0.0123, gain = 0.97 }";
    honest(
        Model::FirstOrder,
        900.0,
        lag,
        &[("gain", 0.97), ("time_constant_s", 0.0123)],
    );
}

#[test]
fn second_order_lag_has_honest_errors() {
    let lag = "actuator.second_order = { frequency_hz = 14.0, damping_ratio = 0.55 }";
    honest(
        Model::SecondOrder,
        900.0,
        lag,
        &[
            ("gain", 1.0),
            ("frequency_hz", 14.0),
            ("damping_ratio", 0.55),
        ],
    );
}

#[test]
fn fractional_delay_has_honest_errors() {
    // 7.37 ticks.
    let delay = 7.37 / RATE;
    honest(
        Model::Delay,
        // The velocity of a delayed command is a mean of two differences, each half a tick old.
        0.0,
        &format!("delay_s = {delay}"),
        &[("gain", 1.0), ("delay_s", delay)],
    );
    let found = RIG.identified(SPRING, &format!("{NOISE}delay_s = {delay}"));
    assert_eq!(found.best().unwrap().model, Model::Delay);
    let found = found.best().unwrap().parameter("delay_s").unwrap();
    assert!(found.std < 0.02 / RATE && (found.value - delay).abs() < 0.05 / RATE);
}

#[test]
fn every_motion_distinguishes_the_models() {
    for shape in [Shape::Sweep, Shape::Noise, Shape::Steps] {
        let rig = Rig { shape, ..RIG };
        for (model, transfer) in [
            (Model::Delay, "delay_s = 0.0113"),
            (
                Model::FirstOrder,
                "actuator.first_order = { time_constant_s = 0.011 }",
            ),
            (
                Model::SecondOrder,
                "actuator.second_order = { frequency_hz = 18.0, damping_ratio = 0.7 }",
            ),
            (
                Model::DelayedFirstOrder,
                "delay_s = 0.0083\nactuator.first_order = { time_constant_s = 0.011 }",
            ),
            (
                Model::DelayedSecondOrder,
                "delay_s = 0.0083\nactuator.second_order = { frequency_hz = 18.0, damping_ratio = 0.7 }",
            ),
        ] {
            let found = rig.identified(SPRING, &format!("{NOISE}seed = 5\n{transfer}"));
            let best = found.best().unwrap();
            assert_eq!(best.model, model, "{shape:?} {:?}", found.models);
            let wanted: TransferSpec = toml::from_str(transfer).unwrap();
            for point in found.response.iter().filter(|point| point.trusted) {
                let omega = std::f64::consts::TAU * point.hz;
                let truth = wanted.response(omega, 0.0, 0.0).modulus();
                // Ramps from tick to tick hold (ωΔt)²/12 less of a sine, 0.5 % at 20 Hz, and what is aliased.
                let allowed = 6.0 * point.gain_std + 0.01;
                assert!(
                    (point.gain - truth).abs() < allowed,
                    "{shape:?} {point:?} {truth}"
                );
            }
        }
    }
}

/// Without noise nothing but roundoff is left.
#[test]
fn linear_spring_is_exact() {
    let spring = "linear = { stiffness_n_per_m = 3.4e6 }";
    let lag = "actuator.first_order = { time_constant_s = 0.01 }";
    let found = RIG.identified(spring, lag);
    let specimen = found.specimen.unwrap();
    assert!(
        (specimen.stiffness.value / 3.4e6 - 1.0).abs() < 1e-10,
        "{specimen:?}"
    );
    assert!(
        specimen.damping.value.abs() < 1e-6 * 3.4e6 / 100.0,
        "{specimen:?}"
    );
    assert!(specimen.mass.is_none() && !specimen.is_nonlinear());
    let fit = found.best().unwrap();
    assert_eq!(fit.model, Model::FirstOrder);
    let lag_found = fit.parameter("time_constant_s").unwrap();
    // The lag still to settle at the end of the rest: e^{−1/0.01} and less; the taper has settled.
    assert!((lag_found.value - 0.01).abs() < 1e-8, "{lag_found:?}");
    assert!(found.noise.disp_m < 1e-15 && found.noise.force_n < 1e-9);

    let yields =
        "bilinear = { stiffness_n_per_m = 3.4e6, yield_force_n = 1000.0, post_yield_ratio = 0.1 }";
    let found = RIG.identified(yields, "");
    let specimen = found.specimen.unwrap();
    // At 1 mm: 1000 N + 0.1 k (1 mm − 0.294 mm) = 1240 N: the secant of its tips, and a fatter loop leans less.
    assert!(
        (0.6..1.05).contains(&(specimen.stiffness.value / 1.24e6)),
        "{specimen:?}"
    );
    assert!(specimen.damping.value > 0.0, "a loop takes energy");
    assert!(specimen.is_nonlinear() && specimen.residual > 0.1);
}

/// The benchmark's plant lags by 24 to 25 ms as long as it is slow.
#[test]
fn benchmark_plant_lags_as_published() {
    let rig = Rig {
        rate: 4096.0,
        band: Band {
            from_hz: 0.5,
            to_hz: 10.0,
        },
        seconds: 10.0,
        ..RIG
    };
    let law = "linear = { stiffness_n_per_m = 1.19e6, damping_n_s_per_m = 114.22 }";
    let plant = "seed = 3\nactuator = { servo_hydraulic = {} }\ndisp_sensor = { noise_power_m2_s = 6.25e-14 }\n\
                 force_sensor = { noise_power_n2_s = 1.16e-3 }";
    let found = rig.identified(law, plant);
    let trusted: Vec<_> = found.response.iter().filter(|p| p.trusted).collect();
    assert!(trusted.len() >= 8);
    let truth: TransferSpec = toml::from_str(plant).unwrap();
    for point in &trusted {
        let omega = std::f64::consts::TAU * point.hz;
        // Five standard errors, and what a ramp from tick to tick differs from a sine: (ωΔt)²/12 = 2e-5 at 10 Hz.
        let lag = truth.lag(omega, 1.19e6, 114.22);
        assert!(
            (point.delay_s - lag).abs() < 5.0 * point.delay_std_s + 2e-5 * lag,
            "{point:?} {lag}"
        );
        let gain = truth.response(omega, 1.19e6, 114.22).modulus();
        assert!(
            (point.gain - gain).abs() < 5.0 * point.gain_std + 1e-4,
            "{point:?} {gain}"
        );
    }
    let slow: Vec<_> = trusted.iter().filter(|point| point.hz < 3.0).collect();
    assert!(
        slow.iter().all(|p| (0.024..0.0255).contains(&p.delay_s)),
        "{slow:?}"
    );
    // 25.05 ms at rest, 19.0 ms at 10 Hz.
    let best = found.best().unwrap();
    assert!((best.slow_delay_s - 0.02505).abs() < 3e-4, "{best:?}");
    assert!(
        (0.0225..0.0250).contains(&found.delay.value) && found.delay.std > 1e-3,
        "{:?}",
        found.delay
    );
    let specimen = found.specimen.unwrap();
    let k = specimen.stiffness;
    assert!(
        (k.value - 1.19e6).abs() < 5.0 * k.std + 1e-3 * 1.19e6,
        "{specimen:?}"
    );
}

#[test]
fn wrong_or_dead_motion_is_not_fitted() {
    let mut columns = RIG.drive(SPRING, NOISE);
    let good = columns.measured.clone();
    columns.measured.iter_mut().for_each(|v| *v = -*v);
    let error = RIG.judge(&columns).unwrap_err();
    assert!(
        matches!(error, IdentifyError::Reversed { gain } if (gain + 1.0).abs() < 0.01),
        "{error}"
    );
    columns.measured.fill(0.0125);
    let error = RIG.judge(&columns).unwrap_err();
    assert!(matches!(error, IdentifyError::DoesNotFollow { coherence } if coherence < 0.01));
    assert!(error.to_string().contains("not follow"));
    // Noise alone follows nothing either.
    let still = RIG.drive(SPRING, NOISE);
    let noise = still.measured.iter().zip(&still.command);
    columns.measured = noise
        .map(|(measured, command)| measured - command)
        .collect();
    assert!(matches!(
        RIG.judge(&columns),
        Err(IdentifyError::DoesNotFollow { coherence }) if coherence < 0.2
    ));
    columns.measured = good.clone();
    columns.force.iter_mut().for_each(|f| *f = -*f);
    assert!(matches!(
        RIG.judge(&columns),
        Err(IdentifyError::ForceReversed { stiffness }) if stiffness < -1e6
    ));
    columns.measured[77] = f64::NAN;
    assert!(matches!(
        RIG.judge(&columns),
        Err(IdentifyError::NotFinite { index: 78, .. })
    ));
    columns.measured = good;
    columns.command.fill(0.0);
    assert!(matches!(RIG.judge(&columns), Err(IdentifyError::Still)));
}

/// Neither the drift of a sensor nor its offset is motion.
#[test]
fn sensor_offset_and_drift_change_nothing() {
    let lag = "seed = 4\nactuator.first_order = { time_constant_s = 0.011 }\n";
    let drifting = "disp_sensor = { noise_rms_m = 5e-6, bias_m = 0.004, drift_m_per_s = 3e-5 }";
    let found = RIG.identified(SPRING, &format!("{lag}{drifting}"));
    let fit = found.best().unwrap();
    assert_eq!(fit.model, Model::FirstOrder);
    let lag = fit.parameter("time_constant_s").unwrap();
    assert!((lag.value - 0.011).abs() < 4.0 * lag.std, "{lag:?}");
    // Noise at rest is about its mean: a drift of 30 µm/s in a second adds 8.7 µm.
    assert!(found.noise.disp_m < 12e-6, "{:?}", found.noise);
}

#[test]
fn noise_at_rest_is_that_of_the_sensors() {
    let found = RIG.identified(SPRING, &format!("{NOISE}seed = 9"));
    // 768 samples: 1/√1536 = 2.6 %; four of these.
    assert!(
        (found.noise.disp_m / 5e-6 - 1.0).abs() < 0.11,
        "{:?}",
        found.noise
    );
    assert!(
        (found.noise.force_n / 20.0 - 1.0).abs() < 0.11,
        "{:?}",
        found.noise
    );
}

#[test]
fn inverse_undoes_a_first_order_lag() {
    let lag = 0.02;
    let found = RIG.identified(
        SPRING,
        &format!("actuator.first_order = {{ time_constant_s = {lag} }}"),
    );
    let inverse = found.inverse.unwrap();
    // A first-order lag T has a0 = 1, a1 = T, a2 = TΔt/2 with backward differences. The next order, T D³ Δt²/3, is in the
    // others: up to (ωΔt)²/3 = 2 % of T at 20 Hz.
    let [a0, a1, a2] = inverse.coefficients[..] else {
        panic!("{inverse:?}")
    };
    assert!((a0 - 1.0).abs() < 2e-3, "{inverse:?}");
    assert!((a1 / lag - 1.0).abs() < 0.02, "{inverse:?}");
    assert!((a2 / (lag / RATE / 2.0) - 1.0).abs() < 0.15, "{inverse:?}");
    assert!(inverse.residual < 3e-3);
}
