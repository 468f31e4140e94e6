//! One state of a loop with its actuator, at rest or at K0 and C0: the delay it tolerates, and its number of roots in the right
//! half-plane.

use super::actuator::Follows;
use super::bound::{DelayBound, INERTIA, growing};
use super::roots::roots;
use gusset_numerics::spectral::delay::{Critical, DelayError, Delayed, continuous};

/// Share of the lag that counts as left where a delay decides: less is rounding of a compensation.
const LEFT: f64 = 0.05;

/// Delay that the loop tolerates in continuous time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Bears {
    /// Every one.
    Every,
    /// Less than a critical one, s: lag of the actuator in s at its frequency, and that frequency in rad/s.
    LessThan { critical: f64, lag: f64, omega: f64 },
    /// No delay, for this reason.
    None(&'static str),
    /// It is unstable without delay: growth in 1/s.
    Unstable(f64),
    /// Reason why it is not known.
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

    /// The bound of the tolerated delays.
    pub(crate) fn bound(&self) -> DelayBound {
        match self {
            Self::Every => DelayBound::Every,
            Self::LessThan { critical, .. } => DelayBound::Below(*critical),
            Self::None(why) => DelayBound::NoDelay(why),
            Self::Unstable(growth) => DelayBound::Unstable(growing(*growth)),
            Self::Unknown(error) => DelayBound::Unknown(error.to_string()),
        }
    }
}

/// Findings about the loop in one state.
#[derive(Debug, Clone)]
pub struct State {
    pub bears: Bears,
    /// What of the lag is left after a compensation that neither adapts nor feeds back, in s.
    pub left: Option<f64>,
    /// Roots right of the imaginary axis; none if they are not counted.
    pub roots: Option<u32>,
}

impl State {
    /// State of a system of one axis.
    pub(crate) fn of(system: &Delayed, follows: Follows<'_>) -> Self {
        let bears = Bears::of(system, |omega| follows.lag(omega, system, 0));
        let left = match bears {
            Bears::LessThan { omega, .. } => follows.left(omega, system, 0),
            _ => None,
        };
        let roots = roots(&[(system, follows)]);
        Self { bears, left, roots }
    }

    /// True if the loop is proven unstable with its actuator. Where no roots are counted the remaining delay decides.
    pub(crate) fn is_unstable(&self) -> bool {
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
    pub(crate) fn bears_nothing(&self) -> bool {
        matches!(self.bears, Bears::None(_) | Bears::Unstable(_))
    }

    /// True if the loop is known to be stable with its actuator.
    pub fn is_stable(&self) -> bool {
        self.roots == Some(0) && !matches!(self.bears, Bears::Unstable(_))
    }

    /// Whether what is left of the delay, twice its `spread` in s included, is below what is critical; none where it is not known.
    pub(crate) fn bears_what_is_left(&self, spread: f64) -> Option<bool> {
        match (&self.bears, self.left) {
            (Bears::Every, _) => Some(true),
            (Bears::None(_) | Bears::Unstable(_), _) => Some(false),
            (Bears::LessThan { critical, .. }, Some(left)) => Some(left + 2.0 * spread < *critical),
            (Bears::LessThan { .. } | Bears::Unknown(_), _) => None,
        }
    }
}
