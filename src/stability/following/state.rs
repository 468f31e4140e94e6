//! One state of a loop with its actuator, at rest or as K0 and C0 have it: what delay it bears, and how many roots it has on the
//! right.

use std::f64::consts::PI;

use nalgebra::{Complex, DMatrix, DVector};

use crate::config::SpecimenTable;
use crate::spectral::delay::{Critical, DelayError, Delayed, continuous};
use crate::spectral::unstable_roots;
use crate::stability::{DelayBound, INERTIA, growing};
use crate::transfer::TransferSpec;

/// Frequencies that count are below this share of half the rate.
pub const HIGHEST: f64 = 0.9;
/// Share of the lag that counts as left where a delay decides: less is rounding of a compensation.
const LEFT: f64 = 0.05;

/// What delay the loop bears in continuous time.
#[derive(Debug, Clone, PartialEq)]
pub enum Bears {
    /// Every one.
    Every,
    /// Less than a critical one, s: lag of the actuator in s at its frequency, and that frequency in rad/s.
    LessThan { critical: f64, lag: f64, omega: f64 },
    /// None at all, for this reason.
    None(&'static str),
    /// It is unstable without any: growth in 1/s.
    Unstable(f64),
    /// Why it is not known.
    Unknown(DelayError),
}

impl Bears {
    fn of(system: &Delayed, lag: impl Fn(f64) -> f64) -> Self {
        if let Some(growth) = system.growth() {
            return Self::Unstable(growth);
        }
        match continuous(system) {
            Ok(None) => Self::Every,
            Ok(Some(Critical { delay, omega })) if omega.is_finite() => Self::LessThan {
                critical: delay,
                lag: lag(omega),
                omega,
            },
            Ok(Some(_)) => Self::None(INERTIA),
            Err(error) => Self::Unknown(error),
        }
    }

    /// The delays that it bears.
    pub fn bound(&self) -> DelayBound {
        match self {
            Self::Every => DelayBound::Every,
            Self::LessThan { critical, .. } => DelayBound::Below(*critical),
            Self::None(why) => DelayBound::NoDelay(why),
            Self::Unstable(growth) => DelayBound::Unstable(growing(*growth)),
            Self::Unknown(error) => DelayBound::Unknown(error.to_string()),
        }
    }
}

/// An actuator, and what makes up for it.
#[derive(Debug, Clone, Copy)]
pub struct Follows<'a> {
    pub table: &'a SpecimenTable,
    pub transfer: &'a TransferSpec,
    /// Of wall time, s.
    pub tick: f64,
}

impl Follows<'_> {
    /// H at ω in rad/s for one axis of a system; none of what adapts or feeds back.
    pub fn at(&self, omega: f64, system: &Delayed, axis: usize) -> Option<Complex<f64>> {
        let lead = match &self.table.compensation {
            None => Complex::new(1.0, 0.0),
            Some(spec) => spec.response(omega, self.tick)?,
        };
        let (k, c) = of_axis(system, axis);
        Some(lead * self.transfer.response_to_ticks(omega, k, c, self.tick))
    }

    /// What is left of the lag of an axis at ω in rad/s, s.
    pub fn left(&self, omega: f64, system: &Delayed, axis: usize) -> Option<f64> {
        self.at(omega, system, axis).map(|h| -h.arg() / omega)
    }
}

/// Stiffness and damping of one axis of a specimen.
fn of_axis(system: &Delayed, axis: usize) -> (f64, f64) {
    let at = (axis, axis);
    (system.specimen_stiffness[at], system.specimen_damping[at])
}

/// What is known of the loop in one state.
#[derive(Debug, Clone)]
pub struct State {
    pub bears: Bears,
    /// What of the lag is left after a compensation that neither adapts nor feeds back, in s.
    pub left: Option<f64>,
    /// Roots right of the imaginary axis; none if they are not counted.
    pub roots: Option<u32>,
}

impl State {
    /// Of a system of one axis.
    pub fn of(system: &Delayed, follows: Follows<'_>) -> Self {
        let (k, c) = of_axis(system, 0);
        let lag = |omega| follows.transfer.lag_to_ticks(omega, k, c, follows.tick);
        let bears = Bears::of(system, lag);
        let left = match bears {
            Bears::LessThan { omega, .. } => follows.left(omega, system, 0),
            _ => None,
        };
        let marks = system.marks();
        let chain = |omega: f64| {
            let missing = follows.at(omega, system, 0)? - 1.0;
            felt(system, omega).map(|felt| missing * felt + 1.0)
        };
        let roots = unstable_roots(chain, 1e-2, HIGHEST * PI / follows.tick, &marks);
        Self { bears, left, roots }
    }

    /// True if the loop is proven unstable with its actuator. Where no roots are counted the remaining delay decides.
    pub fn is_unstable(&self) -> bool {
        match (self.roots, &self.bears, self.left) {
            (Some(roots), ..) => roots > 0,
            (None, Bears::Unstable(_), _) => true,
            (None, Bears::None(_), Some(left)) => left > 0.0,
            (None, Bears::LessThan { critical, lag, .. }, Some(left)) => {
                left >= *critical && left > LEFT * lag
            }
            (None, ..) => false,
        }
    }

    /// True if no delay is stable, or the state is unstable without any.
    pub fn bears_nothing(&self) -> bool {
        matches!(self.bears, Bears::None(_) | Bears::Unstable(_))
    }

    /// True if the loop is known to be stable with its actuator.
    pub fn is_stable(&self) -> bool {
        self.roots == Some(0) && !matches!(self.bears, Bears::Unstable(_))
    }

    /// Whether what is left of the delay, twice its `spread` in s included, is below what is critical; none where it is not known.
    pub fn bears_what_is_left(&self, spread: f64) -> Option<bool> {
        match (&self.bears, self.left) {
            (Bears::Every, _) => Some(true),
            (Bears::None(_) | Bears::Unstable(_), _) => Some(false),
            (Bears::LessThan { critical, .. }, Some(left)) => Some(left + 2.0 * spread < *critical),
            (Bears::LessThan { .. } | Bears::Unknown(_), _) => None,
        }
    }
}

/// Z_e bᵀ Z⁻¹ b at iω: what the specimen feels of its own missing motion.
fn felt(system: &Delayed, omega: f64) -> Option<Complex<f64>> {
    let n = system.mass.nrows();
    let square = omega * omega;
    let specimen = Complex::new(
        system.specimen_stiffness[(0, 0)] - square * system.specimen_mass,
        omega * system.specimen_damping[(0, 0)],
    );
    let row = DVector::from_fn(n, |i, _| Complex::new(system.rows[(0, i)], 0.0));
    let whole = DMatrix::from_fn(n, n, |i, j| {
        let own = Complex::new(
            system.stiffness[(i, j)] - square * system.mass[(i, j)],
            omega * system.damping[(i, j)],
        );
        own + specimen * row[i] * row[j]
    });
    Some(specimen * row.dot(&whole.lu().solve(&row)?))
}
