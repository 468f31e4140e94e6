//! Laws without memory that depend on the displacement: linear, square root, cubic.
//!
//! The linear one carries a dashpot too; a viscous damper is a linear law without a spring. Nothing here dissipates
//! but that dashpot.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{declared, finite, not_negative, positive, reference};
use super::{Law, LawError, Memoryless, Reach, Tangent};
use gusset_quantity::state;

/// Linear spring and dashpot in parallel, f = k d + c v. With k = 0 it is a viscous damper.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct LinearSpec {
    /// Stiffness k. It must not be negative.
    pub stiffness_n_per_m: f64,
    /// Damping c. It must not be negative.
    #[serde(default)]
    pub damping_n_s_per_m: f64,
}

impl LinearSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub fn build(&self) -> Result<Linear, LawError> {
        Ok(Linear {
            stiffness: not_negative("stiffness_n_per_m", self.stiffness_n_per_m)?,
            damping: not_negative("damping_n_s_per_m", self.damping_n_s_per_m)?,
        })
    }
}

/// See [`LinearSpec`].
#[derive(Debug, Clone)]
pub struct Linear {
    stiffness: f64,
    damping: f64,
}

state! { Linear as "linear" {} keeps { stiffness, damping } }

impl Law for Linear {
    fn trial(&mut self, disp: f64, vel: f64, _dt: f64) -> f64 {
        self.stiffness * disp + self.damping * vel
    }

    fn tangent(&self) -> Tangent {
        self.reference()
    }

    fn reference(&self) -> Tangent {
        Tangent {
            stiffness: self.stiffness,
            damping: self.damping,
        }
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(self.stiffness), Some(self.damping))
    }

    fn memoryless(&self) -> Option<Memoryless> {
        Some(Memoryless::Linear {
            stiffness: self.stiffness,
            damping: self.damping,
        })
    }
}

/// Spring whose tangent changes with the square root of the displacement, f = k₀ d (1 + θ √|d|).
/// Source: Gui et al. 2014, equation 42.
///
/// The tangent is k₀ (1 + 1.5 θ √|d|). With θ < 0 it is negative for |d| > (1.5 θ)⁻², and the force
/// changes its sign at |d| = θ⁻².
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct SquareRootSpec {
    /// Initial stiffness k₀, greater than 0.
    #[schemars(example = 1.0e6)]
    pub stiffness_n_per_m: f64,
    /// Coefficient θ in 1/√m. A positive value hardens, a negative value softens.
    #[schemars(example = -0.5)]
    pub hardening_per_sqrt_m: f64,
}

impl SquareRootSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub fn build(&self) -> Result<SquareRoot, LawError> {
        Ok(SquareRoot {
            stiffness: positive("stiffness_n_per_m", self.stiffness_n_per_m)?,
            hardening: finite("hardening_per_sqrt_m", self.hardening_per_sqrt_m)?,
            root: 0.0,
        })
    }
}

/// See [`SquareRootSpec`].
#[derive(Debug, Clone)]
pub struct SquareRoot {
    stiffness: f64,
    hardening: f64,
    /// √|d| at the last trial.
    root: f64,
}

state! { SquareRoot as "square_root" {} keeps { stiffness, hardening, root } }

impl Law for SquareRoot {
    fn trial(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        self.root = disp.abs().sqrt();
        let linear = self.stiffness * disp;
        linear + linear * (self.hardening * self.root)
    }

    fn tangent(&self) -> Tangent {
        Tangent::elastic(self.stiffness * (1.0 + 1.5 * self.hardening * self.root))
    }

    fn reference(&self) -> Tangent {
        Tangent::elastic(self.stiffness)
    }

    fn bound(&self, reach: Reach) -> (Option<f64>, Option<f64>) {
        let stiffness = if self.hardening > 0.0 {
            declared(reach.disp).map(|d| self.stiffness * (1.0 + 1.5 * self.hardening * d.sqrt()))
        } else {
            Some(self.stiffness)
        };
        (stiffness, Some(0.0))
    }

    fn memoryless(&self) -> Option<Memoryless> {
        Some(Memoryless::SquareRoot {
            stiffness: self.stiffness,
            hardening: self.hardening,
        })
    }
}

/// Cubic (Duffing) spring, f = k d + k₃ d³.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct CubicSpec {
    /// Linear stiffness k. If it is zero or negative (snap-through), `reference_stiffness_n_per_m`
    /// is required.
    #[schemars(example = 1.0e6)]
    pub stiffness_n_per_m: f64,
    /// Cubic coefficient k₃. A positive value hardens, a negative value softens.
    #[schemars(example = 1.0e9)]
    pub cubic_n_per_m3: f64,
    /// Stiffness that this spring adds to the initial stiffness of the structure, greater than 0.
    /// Default: `stiffness_n_per_m`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 1.0e6)]
    pub reference_stiffness_n_per_m: Option<f64>,
}

impl CubicSpec {
    /// # Errors
    /// A parameter outside its domain, or no positive tangent at the origin and no reference.
    pub fn build(&self) -> Result<Cubic, LawError> {
        let stiffness = finite("stiffness_n_per_m", self.stiffness_n_per_m)?;
        Ok(Cubic {
            stiffness,
            cubic: finite("cubic_n_per_m3", self.cubic_n_per_m3)?,
            reference: reference(
                "reference_stiffness_n_per_m",
                self.reference_stiffness_n_per_m,
                stiffness,
            )?,
            square: 0.0,
        })
    }
}

/// See [`CubicSpec`].
#[derive(Debug, Clone)]
pub struct Cubic {
    stiffness: f64,
    cubic: f64,
    reference: f64,
    /// d² at the last trial.
    square: f64,
}

state! { Cubic as "cubic" {} keeps { stiffness, cubic, reference, square } }

impl Law for Cubic {
    fn trial(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        self.square = disp * disp;
        disp * (self.stiffness + self.cubic * self.square)
    }

    fn tangent(&self) -> Tangent {
        Tangent::elastic(self.stiffness + 3.0 * self.cubic * self.square)
    }

    fn reference(&self) -> Tangent {
        Tangent::elastic(self.reference)
    }

    fn bound(&self, reach: Reach) -> (Option<f64>, Option<f64>) {
        let stiffness = if self.cubic > 0.0 {
            declared(reach.disp).map(|d| self.stiffness + 3.0 * self.cubic * d * d)
        } else {
            Some(self.stiffness)
        };
        (stiffness, Some(0.0))
    }

    fn memoryless(&self) -> Option<Memoryless> {
        Some(Memoryless::Cubic {
            stiffness: self.stiffness,
            cubic: self.cubic,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equation_42_gives_110_kn_at_10_mm() {
        let spec = SquareRootSpec {
            stiffness_n_per_m: 1e7,
            hardening_per_sqrt_m: 1.0,
        };
        let mut law = spec.build().unwrap();
        assert_eq!(law.trial(0.01, 0.0, 0.0), 110_000.0);
        assert_eq!(law.trial(-0.01, 0.0, 0.0), -110_000.0);
        // 1e7 (1 + 1.5 · 0.1), one rounding per operation.
        assert!((law.tangent().stiffness - 1.15e7).abs() < 1e-8);
        assert_eq!(law.bound(Reach::default()).0, None);
        let reach = Reach {
            disp: Some(0.04),
            vel: None,
        };
        assert!((law.bound(reach).0.unwrap() - 1.3e7).abs() < 1e-8);
    }

    #[test]
    fn softening_law_needs_no_reach() {
        let mut law = SquareRootSpec {
            stiffness_n_per_m: 1e5,
            hardening_per_sqrt_m: -2.0,
        }
        .build()
        .unwrap();
        assert_eq!(law.bound(Reach::default()), (Some(1e5), Some(0.0)));
        // Peak at √d = 1/3, zero force at √d = 1/2.
        law.trial(1.0 / 9.0, 0.0, 0.0);
        assert!(law.tangent().stiffness.abs() < 1e-9);
        assert_eq!(law.trial(0.25, 0.0, 0.0), 0.0);
        assert!(law.tangent().stiffness < 0.0);
    }

    #[test]
    fn cubic_spring_alone_needs_a_reference() {
        let mut spec = CubicSpec {
            stiffness_n_per_m: 0.0,
            cubic_n_per_m3: 6e9,
            reference_stiffness_n_per_m: None,
        };
        assert_eq!(
            spec.build().unwrap_err(),
            LawError::ReferenceNeeded {
                name: "reference_stiffness_n_per_m"
            }
        );
        spec.reference_stiffness_n_per_m = Some(1e6);
        let mut law = spec.build().unwrap();
        // 6e9 · 1e-9 = 6 N, tangent 3 · 6e9 · 1e-6 = 18 000 N/m.
        assert!((law.trial(1e-3, 0.0, 0.0) - 6.0).abs() < 1e-14);
        assert!((law.tangent().stiffness - 18_000.0).abs() < 1e-11);
        assert_eq!(law.reference().stiffness, 1e6);
        let reach = Reach {
            disp: Some(1e-3),
            vel: None,
        };
        assert!((law.bound(reach).0.unwrap() - 18_000.0).abs() < 1e-11);
    }
}
