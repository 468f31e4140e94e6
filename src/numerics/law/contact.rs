//! A gap that closes: no force until it does, then a spring. No memory, no damping, no impact law.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{not_negative, positive};
use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;

/// Side on which a gap can close.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Positive displacement, for example a cable, a hook or a tension-only brace.
    Tension,
    /// Negative displacement, for example a bearing or a pounding joint.
    Compression,
    /// Both sides, for example a pin in an oversized hole or a moat wall.
    Both,
}

/// Spring behind a gap of width g. The force is k (d − g) for d > g, k (d + g) for d < −g, and 0
/// between.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct GapSpec {
    /// Contact stiffness k, greater than 0. It is part of the initial stiffness of the structure,
    /// although the gap is open at the start.
    #[schemars(example = 5.0e7)]
    pub stiffness_n_per_m: f64,
    /// Width g of the gap. It must not be negative, and it is equal on both sides. 0 is a gap that
    /// is about to close.
    #[schemars(example = 0.01)]
    pub gap_m: f64,
    /// Side on which the gap can close.
    #[schemars(example = &"compression")]
    pub side: Side,
}

impl GapSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub(crate) fn build(&self) -> Result<Gap, LawError> {
        Ok(Gap {
            stiffness: positive("stiffness_n_per_m", self.stiffness_n_per_m)?,
            gap: not_negative("gap_m", self.gap_m)?,
            side: self.side,
            closed: false,
        })
    }
}

/// See [`GapSpec`].
#[derive(Debug, Clone)]
pub struct Gap {
    stiffness: f64,
    gap: f64,
    side: Side,
    /// At the last trial.
    closed: bool,
}

state! { Gap as "gap" {} keeps { stiffness, gap, side, closed } }

impl Law for Gap {
    fn trial(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        let tension = matches!(self.side, Side::Tension | Side::Both) && disp > self.gap;
        let compression = matches!(self.side, Side::Compression | Side::Both) && disp < -self.gap;
        self.closed = tension || compression;
        if tension {
            self.stiffness * (disp - self.gap)
        } else if compression {
            self.stiffness * (disp + self.gap)
        } else {
            // 0 for every number, NaN for NaN and ∞: a lost displacement must not pass for an open gap.
            0.0 * disp + 0.0
        }
    }

    fn tangent(&self) -> Tangent {
        Tangent::elastic(if self.closed { self.stiffness } else { 0.0 })
    }

    fn reference(&self) -> Tangent {
        Tangent::elastic(self.stiffness)
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        (Some(self.stiffness), Some(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_side_closes_at_its_gap() {
        // At −3 mm, −1 mm, 1 mm, 3 mm with a gap of 2 mm and 1e6 N/m.
        for (side, wanted) in [
            (Side::Tension, [0.0, 0.0, 0.0, 1000.0]),
            (Side::Compression, [-1000.0, 0.0, 0.0, 0.0]),
            (Side::Both, [-1000.0, 0.0, 0.0, 1000.0]),
        ] {
            let mut law = GapSpec {
                stiffness_n_per_m: 1e6,
                gap_m: 2e-3,
                side,
            }
            .build()
            .unwrap();
            for (disp, force) in [-3e-3, -1e-3, 1e-3, 3e-3].into_iter().zip(wanted) {
                // One rounding of d − g, relative 1e-16 of 3 mm.
                assert!(
                    (law.trial(disp, 0.0, 0.0) - force).abs() < 1e-12,
                    "{side:?} {disp}"
                );
                assert_eq!(law.tangent().stiffness != 0.0, force != 0.0);
            }
            assert_eq!(law.reference().stiffness, 1e6);
            assert!(law.trial(f64::NAN, 0.0, 0.0).is_nan());
        }
    }
}
