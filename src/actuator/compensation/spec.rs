//! `[specimen.compensation]`: a compensator in the test file, one table per kind.

use nalgebra::Complex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::none::Plain;
use super::polynomial::{Nodes, horiuchi_weights, lagrange_weights};
use super::{
    AmbSpec, AtsSpec, CompensationError, Compensator, InverseSpec, ModelInverseSpec, NewtonSpec,
    NoneSpec, PiLeadSpec, PolynomialSpec, RecursiveFirSpec,
};

/// Compensation of the actuator dynamics: it computes commands from targets, so that the measured
/// displacement follows the target. All axes use the same settings, with own state for each axis.
/// Units are SI at the specimen. More: guide, actuators.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum CompensationSpec {
    /// No compensation. The command is the target.
    None(NoneSpec),
    /// Polynomial extrapolation through past targets. Source: Horiuchi et al. 1999.
    Polynomial(PolynomialSpec),
    /// Extrapolation with the velocity and acceleration of the integrator.
    Newton(NewtonSpec),
    /// Inverse of a first-order lag. Source: Chen et al. 2009.
    Inverse(InverseSpec),
    /// Inverse of a model with up to three poles. Source: Carrion & Spencer 2007.
    ModelInverse(ModelInverseSpec),
    /// Adaptive time series compensation. Source: Chae et al. 2013.
    Ats(AtsSpec),
    /// Adaptive model-based compensation. Source: Gálmez & Fermandois 2022.
    Amb(AmbSpec),
    /// Filter with four weights that follow recursive least squares. Source: Quiroz et al. 2024.
    RecursiveFir(RecursiveFirSpec),
    /// PI control with a phase lead: the sample controller of the virtual hybrid simulation
    /// benchmark.
    PiLead(PiLeadSpec),
}

impl CompensationSpec {
    /// The compensator of one axis for ticks of `dt` seconds.
    ///
    /// # Errors
    /// A key outside its domain, bounds that do not hold the start, a lead beyond the history.
    pub fn build(&self, dt: f64) -> Result<Box<dyn Compensator>, CompensationError> {
        super::positive("the tick", dt)?;
        Ok(match self {
            Self::None(_) => Box::new(Plain),
            Self::Polynomial(spec) => Box::new(spec.build(dt)?),
            Self::Newton(spec) => Box::new(spec.build(dt)?),
            Self::Inverse(spec) => Box::new(spec.build(dt)?),
            Self::ModelInverse(spec) => Box::new(spec.build(dt)?),
            Self::Ats(spec) => Box::new(spec.build(dt)?),
            Self::Amb(spec) => Box::new(spec.build(dt)?),
            Self::RecursiveFir(spec) => Box::new(spec.build(dt)?),
            Self::PiLead(spec) => Box::new(spec.build(dt)?),
        })
    }

    /// Command over target at ω in rad/s for ticks of `dt` seconds; `None` for adaptive kinds, feedback, and invalid
    /// settings.
    #[must_use]
    pub fn response(&self, omega: f64, dt: f64) -> Option<Complex<f64>> {
        let back = |seconds: f64| {
            let (sine, cosine) = libm::sincos(-omega * seconds);
            Complex::new(cosine, sine)
        };
        let one = Complex::new(1.0, 0.0);
        let difference = (one - back(dt)) / dt;
        match self {
            Self::None(_) => Some(one),
            Self::Polynomial(spec) => {
                let (weights, spacing) = match spec.nodes {
                    Nodes::Delay => (horiuchi_weights(spec.order), spec.delay_s),
                    Nodes::Step => (lagrange_weights(spec.order, spec.delay_s / dt), dt),
                };
                let each = weights.iter().enumerate();
                Some(each.map(|(j, w)| back(j as f64 * spacing) * *w).sum())
            }
            Self::Newton(spec) => {
                let tau = spec.delay_s;
                let curve = 0.5 * tau * (tau + dt);
                Some(one + difference * tau + difference * difference * curve)
            }
            Self::Inverse(spec) => Some(one + difference * spec.delay_s),
            Self::ModelInverse(spec) => {
                let falling = spec.coefficients.iter().rev();
                Some(falling.fold(Complex::new(0.0, 0.0), |sum, a| sum * difference + a))
            }
            Self::Ats(_) | Self::Amb(_) | Self::RecursiveFir(_) | Self::PiLead(_) => None,
        }
    }

    /// True for a compensator that takes second or higher differences of targets from tick to tick.
    #[must_use]
    pub fn takes_curvature(&self) -> bool {
        match self {
            Self::None(_) | Self::Inverse(_) | Self::PiLead(_) => false,
            Self::Polynomial(spec) => spec.nodes == Nodes::Step && spec.order > 1,
            Self::ModelInverse(spec) => spec.coefficients.iter().skip(2).any(|a| *a != 0.0),
            Self::Ats(spec) => spec.order > 1,
            Self::Newton(_) | Self::Amb(_) | Self::RecursiveFir(_) => true,
        }
    }

    /// True for a compensator that adapts to the measured displacement or feeds it back.
    #[must_use]
    pub const fn uses_measured_disp(&self) -> bool {
        matches!(
            self,
            Self::Ats(_) | Self::Amb(_) | Self::RecursiveFir(_) | Self::PiLead(_)
        )
    }

    /// The key of its kind.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::None(_) => "none",
            Self::Polynomial(_) => "polynomial",
            Self::Newton(_) => "newton",
            Self::Inverse(_) => "inverse",
            Self::ModelInverse(_) => "model_inverse",
            Self::Ats(_) => "ats",
            Self::Amb(_) => "amb",
            Self::RecursiveFir(_) => "recursive_fir",
            Self::PiLead(_) => "pi_lead",
        }
    }
}
