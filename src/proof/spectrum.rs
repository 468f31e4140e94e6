//! Modes and critical delays of a test at its Δt and λ.
//!
//! For a method outside the Gui-λ family only the delays in continuous time are known.

use super::analysis::{ALL_MODES, Analysis, Loop, ModeFacts};
use super::bound::{DelayBound, DelayBounds, DelayCondition, diverging, growing};
use gusset_numerics::integrate::Lambda;
use gusset_numerics::spectral::delay::{Critical, DelayError, Delayed, DiscreteLimit, continuous};

/// Modes and critical delays of a test.
#[derive(Debug)]
pub struct Spectrum {
    /// Δt in s.
    pub dt: f64,
    /// λ of a member of the family.
    pub lambda: Option<f64>,
    /// Modes, ascending; empty for another method.
    pub modes: Vec<ModeFacts>,
    /// Whether these are all modes.
    pub complete: bool,
    /// The highest natural frequency in rad/s, if it is known.
    pub highest: Option<f64>,
    /// One per specimen.
    pub delays: Vec<CriticalDelays>,
}

/// The critical delays of one specimen by each calculation.
#[derive(Debug)]
pub struct CriticalDelays {
    /// The specimen in the structure.
    pub specimen: Loop,
    /// At rest, in continuous time.
    pub continuous: Result<Option<Critical>, DelayError>,
    /// By the recursion of the family.
    pub discrete: Option<Result<DiscreteLimit, DelayError>>,
    /// In continuous time at K0 and C0, where that is another structure.
    pub closed: Option<Result<Option<Critical>, DelayError>>,
    /// Growth at rest without any delay, 1/s.
    pub growth: Option<f64>,
    /// Growth at K0 and C0 without any delay, 1/s.
    closed_growth: Option<f64>,
}

impl CriticalDelays {
    fn of(specimen: &Loop, step: Option<(f64, f64)>) -> Self {
        Self {
            continuous: specimen.continuous(),
            discrete: step.map(|(dt, lambda)| specimen.discrete(dt, lambda)),
            closed: specimen.closed.as_ref().map(continuous),
            growth: specimen.system.growth(),
            closed_growth: specimen.closed.as_ref().and_then(Delayed::growth),
            specimen: specimen.clone(),
        }
    }

    /// The reason why the loop is unstable without any delay, if it is.
    #[must_use]
    pub fn at_once(&self) -> Option<String> {
        let growing = self.growth.map(growing);
        let recursion = self.radius().map(diverging);
        let both: Vec<String> = growing.into_iter().chain(recursion).collect();
        (!both.is_empty()).then(|| both.join("; "))
    }

    /// The delays that are stable under each condition.
    #[must_use]
    pub fn bounds(&self) -> DelayBounds {
        let at_rest = DelayBound::continuous(self.growth, &self.continuous);
        let mut bounds = vec![(DelayCondition::AtRest, at_rest)];
        if let Some(found) = &self.discrete {
            bounds.push((DelayCondition::Recursion, DelayBound::recursion(found)));
        }
        if let Some(found) = &self.closed {
            let closed = DelayBound::continuous(self.closed_growth, found);
            bounds.push((DelayCondition::Closed, closed));
        }
        DelayBounds(bounds)
    }

    /// The frequency in rad/s that the critical delay makes unstable. For the recursion it is that in continuous time.
    #[must_use]
    pub fn grows_at(&self, condition: DelayCondition) -> Option<f64> {
        let found = match condition {
            DelayCondition::AtRest | DelayCondition::Recursion => Some(&self.continuous),
            DelayCondition::Closed => self.closed.as_ref(),
        };
        let critical = found?.as_ref().ok()?.as_ref()?;
        critical.omega.is_finite().then_some(critical.omega)
    }

    /// Spectral radius of a recursion that is unstable with nothing delayed.
    fn radius(&self) -> Option<f64> {
        match self.discrete {
            Some(Err(DelayError::Unstable { radius })) => Some(radius),
            _ => None,
        }
    }
}

impl Spectrum {
    /// Modes and delays at steps of `dt` s, with λ for a member of the family.
    #[must_use]
    pub fn of(analysis: &Analysis, dt: f64, lambda: Option<Lambda>) -> Self {
        let step = lambda.map(|lambda| (dt, lambda.value()));
        let loops = analysis.loops.iter();
        let delays = loops.map(|specimen| CriticalDelays::of(specimen, step));
        let modes = lambda.map(|chosen| analysis.modes(dt, chosen));
        let modes = modes.unwrap_or_default();
        let complete = analysis.dofs() <= ALL_MODES;
        let highest = if complete {
            modes.last().map(|mode| mode.frequency)
        } else {
            analysis.highest()
        };
        Self {
            dt,
            lambda: lambda.map(Lambda::value),
            modes,
            complete,
            highest,
            delays: delays.collect(),
        }
    }

    /// Whether the method is one of the family, of which more is known.
    #[must_use]
    pub const fn is_of_family(&self) -> bool {
        self.lambda.is_some()
    }

    /// True if a delay in s is nothing: the search for it ends at a millionth of a step.
    #[must_use]
    pub fn vanishes(&self, delay: f64) -> bool {
        delay < 1e-5 * self.dt
    }

    /// Period error of the lowest mode, if it is known and the mode oscillates.
    #[must_use]
    pub fn period_error(&self) -> Option<f64> {
        self.modes.first()?.period_error(self.dt)
    }

    /// The lowest natural frequency in rad/s, if it is known.
    #[must_use]
    pub fn lowest(&self) -> Option<f64> {
        self.modes.first().map(|mode| mode.frequency)
    }
}
