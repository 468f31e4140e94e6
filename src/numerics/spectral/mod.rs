//! Effect of an integration method's recursion on one mode, in closed form: poles, apparent period and damping,
//! bounds of stability, the root locus of a changed stiffness, and the critical delay of a hybrid test.
//!
//! Everything is a function of a few numbers: Ω = ω Δt, the damping ratio ξ, and λ (infinity is a value). Nothing here
//! integrates, and the integrators do not use it: the two are independent formulations of one method and are tested
//! against each other. Formulas are those of Gui, Wang, Jin, Chen and Zhou (2014), by number.
//!
//! ```
//! use gusset_numerics::spectral;
//!
//! // λ = 4 has the poles of average acceleration, on the unit circle without damping.
//! let [z, _] = spectral::poles(0.5, 0.0, 4.0);
//! assert!((z.norm_sqr() - 1.0).abs() < 1e-15);
//! // Its period is too long, that of λ = ∞ too short.
//! assert!(spectral::period_error(0.5, 0.0, 4.0).unwrap() > 0.0);
//! assert!(spectral::period_error(0.5, 0.0, f64::INFINITY).unwrap() < 0.0);
//! ```

mod alpha;
mod apparent;
mod bounds;
mod companions;
pub mod delay;
mod eigen;
mod locus;
mod poles;
mod transfer;
mod winding;

pub use alpha::AlphaStep;
pub use apparent::{Apparent, amplitude_decay, apparent, period_error, zero_period_error_lambda};
pub use bounds::{
    crossing_stiffness, lambda_limit, lambda_limit_changed, omega_limit, unconditional_lambda,
};
#[cfg(test)]
pub(crate) use companions::alpha_method;
pub use companions::{chang, newmark, principal};
pub use eigen::{eigenvalues, spectral_radius};
pub use locus::Locus;
pub use poles::{Tabulated, alpha, coefficients, discriminant, poles, quadratic, table_1};
pub use transfer::{Transfer, amplification};
pub use winding::unstable_roots;

/// A pole in the z plane.
pub(crate) type Pole = nalgebra::Complex<f64>;

#[cfg(test)]
mod tests;
