//! Models of an actuator, as `gusset_actuator::transfer` samples them: a command that ramps from tick to tick, and the actuator's
//! response at each tick. Parameters fitted here give the same response in `transfer`.

use nalgebra::ComplexField as _;
use serde::Serialize;

use super::lines::C64;

/// Model of an actuator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// A gain and a pure delay.
    Delay,
    /// T ẋ + x = g u.
    FirstOrder,
    /// ẍ + 2 ζ ω ẋ + ω² x = ω² g u.
    SecondOrder,
    /// A first-order lag behind a pure delay.
    DelayedFirstOrder,
    /// A second-order lag behind a pure delay.
    DelayedSecondOrder,
}

/// One parameter of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter {
    /// Key, as `transfer` spells it.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Only values greater than zero make sense; fitted by its logarithm.
    pub positive: bool,
}

const GAIN: Parameter = parameter("gain", "1", false);
const DELAY: Parameter = parameter("delay_s", "s", false);
const LAG: Parameter = parameter("time_constant_s", "s", true);
const FREQUENCY: Parameter = parameter("frequency_hz", "Hz", true);
const DAMPING: Parameter = parameter("damping_ratio", "1", true);

const fn parameter(name: &'static str, unit: &'static str, positive: bool) -> Parameter {
    Parameter {
        name,
        unit,
        positive,
    }
}

/// Two poles nearer to each other than this are taken apart: their partial fractions would cancel.
const DOUBLE: f64 = 1e-7;

impl Model {
    /// All of them, those with the fewest parameters first.
    pub const ALL: [Model; 5] = [
        Model::Delay,
        Model::FirstOrder,
        Model::SecondOrder,
        Model::DelayedFirstOrder,
        Model::DelayedSecondOrder,
    ];

    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Delay => "pure delay",
            Self::FirstOrder => "first order",
            Self::SecondOrder => "second order",
            Self::DelayedFirstOrder => "first order, delayed",
            Self::DelayedSecondOrder => "second order, delayed",
        }
    }

    /// Its parameters, in order.
    #[must_use]
    pub(crate) const fn parameters(self) -> &'static [Parameter] {
        match self {
            Self::Delay => &[GAIN, DELAY],
            Self::FirstOrder => &[GAIN, LAG],
            Self::SecondOrder => &[GAIN, FREQUENCY, DAMPING],
            Self::DelayedFirstOrder => &[GAIN, DELAY, LAG],
            Self::DelayedSecondOrder => &[GAIN, DELAY, FREQUENCY, DAMPING],
        }
    }

    /// Measured over commanded displacement at ω in rad/s, sampled every `dt` seconds; `values` in the order of the
    /// parameters.
    #[must_use]
    pub(crate) fn response(self, values: &[f64], omega: f64, dt: f64) -> C64 {
        let zero = C64::new(f64::NAN, 0.0);
        match (self, values) {
            (Self::Delay, [gain, delay]) => delayed(*delay, omega, dt) * *gain,
            (Self::FirstOrder, [gain, lag]) => first_order(*lag, omega, dt) * *gain,
            (Self::SecondOrder, [gain, hz, damping]) => {
                second_order(*hz, *damping, omega, dt) * *gain
            }
            (Self::DelayedFirstOrder, [gain, delay, lag]) => {
                delayed(*delay, omega, dt) * first_order(*lag, omega, dt) * *gain
            }
            (Self::DelayedSecondOrder, [gain, delay, hz, damping]) => {
                delayed(*delay, omega, dt) * second_order(*hz, *damping, omega, dt) * *gain
            }
            _ => zero,
        }
    }

    /// Delay in s of slow motion.
    #[must_use]
    pub(crate) fn slow_delay(self, values: &[f64]) -> f64 {
        let of_two = |hz: f64, damping: f64| damping / (std::f64::consts::PI * hz);
        match (self, values) {
            (Self::Delay, [_, delay]) => *delay,
            (Self::FirstOrder, [_, lag]) => *lag,
            (Self::SecondOrder, [_, hz, damping]) => of_two(*hz, *damping),
            (Self::DelayedFirstOrder, [_, delay, lag]) => delay + lag,
            (Self::DelayedSecondOrder, [_, delay, hz, damping]) => delay + of_two(*hz, *damping),
            _ => f64::NAN,
        }
    }
}

/// e^{−iω·seconds}.
fn back(omega: f64, seconds: f64) -> C64 {
    let (sine, cosine) = libm::sincos(-omega * seconds);
    C64::new(cosine, sine)
}

/// A weighted mean of the two commands around the moment that is read.
fn delayed(delay: f64, omega: f64, dt: f64) -> C64 {
    let ticks = delay / dt;
    let whole = ticks.floor();
    let share = ticks - whole;
    back(omega, whole * dt) * (1.0 - share) + back(omega, (whole + 1.0) * dt) * share
}

/// 1/(s − p) for a command that ramps over the tick, over T: T φ₂ + T (φ₁ − φ₂) z⁻¹ over 1 − e^{pT} z⁻¹ with φ₁ = (eʰ − 1)/h,
/// φ₂ = (eʰ − 1 − h)/h², h = pT.
fn pole(p: C64, omega: f64, dt: f64) -> C64 {
    let h = p * dt;
    let (sine, cosine) = libm::sincos(h.im);
    let e = C64::new(cosine, sine) * libm::exp(h.re);
    let (one, two) = if h.modulus() < 0.02 {
        // Differences of nearly equal numbers: series instead, whose next term is below 1e-13.
        let series = |from: f64| {
            let (mut term, mut sum, mut k) = (
                C64::new(1.0 / factorial(from), 0.0),
                C64::new(0.0, 0.0),
                from,
            );
            for _ in 0..7 {
                sum += term;
                k += 1.0;
                term = term * h / k;
            }
            sum
        };
        (series(1.0), series(2.0))
    } else {
        let one = (e - 1.0) / h;
        (one, (one - 1.0) / h)
    };
    let z = back(omega, dt);
    (two + (one - two) * z) * dt / (C64::new(1.0, 0.0) - e * z)
}

fn factorial(n: f64) -> f64 {
    if n > 1.0 { n } else { 1.0 }
}

fn first_order(lag: f64, omega: f64, dt: f64) -> C64 {
    pole(C64::new(-1.0 / lag, 0.0), omega, dt) / lag
}

fn second_order(hz: f64, damping: f64, omega: f64, dt: f64) -> C64 {
    let natural = 2.0 * std::f64::consts::PI * hz;
    let mut under = 1.0 - damping * damping;
    if under.abs() < DOUBLE {
        under = DOUBLE.copysign(under);
    }
    let (middle, apart) = if under > 0.0 {
        (-damping * natural, C64::new(0.0, natural * under.sqrt()))
    } else {
        (-damping * natural, C64::new(natural * (-under).sqrt(), 0.0))
    };
    let (p, q) = (apart + middle, -apart + middle);
    (pole(p, omega, dt) - pole(q, omega, dt)) * (natural * natural) / (p - q)
}
