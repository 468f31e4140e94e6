//! Self-centring brace or connection: a flag-shaped loop, with slip and bearing.
//!
//! Source: Christopoulos, Tremblay, Kim & Lacerte 2008, J. Struct. Eng. 134(1), 96–107. Slip and bearing follow the material
//! `SelfCentering` of OpenSees 3.7.1, each alone; with both, OpenSees loses the origin after some cycles. Each limit of the force is less steep than the elastic line, so the clamped elastic line is exact
//! on a straight path: one step equals any number of partial steps.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{fraction, inside, not_negative, positive, yield_disp};
use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;

/// Self-centring brace or connection: its loop is a flag. Beyond the activation force F_a the stiffness falls. Unloading is elastic
/// by (1 − r) β F_a, then the force returns to zero with the stiffness after activation. r is `post_activation_ratio`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct SelfCentringSpec {
    /// Stiffness before activation, greater than 0.
    #[schemars(example = 1.0e8)]
    pub stiffness_n_per_m: f64,
    /// Activation force F_a, greater than 0.
    #[schemars(example = 2.0e5)]
    pub activation_force_n: f64,
    /// Stiffness after activation, divided by that before, from 0 to 1.
    #[schemars(example = 0.05)]
    pub post_activation_ratio: f64,
    /// Height β of the flag, from 0 to 1: 0 dissipates nothing.
    #[schemars(example = 0.8)]
    pub beta: f64,
    /// Displacement at which a fuse slips, greater than that of activation. Beyond it the force stays constant, and the origin
    /// moves. Default: no slip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.04)]
    pub slip_disp_m: Option<f64>,
    /// Displacement at which the device bears, greater than that of activation. Default: it never does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = 0.06)]
    pub bearing_disp_m: Option<f64>,
    /// Stiffness in bearing, divided by that before activation. It must not be negative.
    #[serde(default = "one")]
    #[schemars(example = 1.0)]
    pub bearing_ratio: f64,
}

fn one() -> f64 {
    1.0
}

impl SelfCentringSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub(crate) fn build(&self) -> Result<SelfCentring, LawError> {
        let stiffness = positive("stiffness_n_per_m", self.stiffness_n_per_m)?;
        let force = positive("activation_force_n", self.activation_force_n)?;
        let activation = yield_disp("activation_force_n", force, stiffness)?;
        let beyond = |name, given: Option<f64>| match given {
            None => Ok(f64::INFINITY),
            Some(disp) => inside(
                name,
                disp,
                disp > activation,
                "greater than the activation force over the stiffness",
            ),
        };
        Ok(SelfCentring {
            stiffness,
            activation,
            ratio: fraction("post_activation_ratio", self.post_activation_ratio)?,
            beta: fraction("beta", self.beta)?,
            slip: beyond("slip_disp_m", self.slip_disp_m)?,
            bearing: beyond("bearing_disp_m", self.bearing_disp_m)?,
            bearing_ratio: not_negative("bearing_ratio", self.bearing_ratio)?,
            committed: Place::default(),
            trial: Place::default(),
            share: 1.0,
        })
    }
}

/// See [`SelfCentringSpec`].
#[derive(Debug, Clone)]
pub struct SelfCentring {
    stiffness: f64,
    /// Displacement of activation.
    activation: f64,
    ratio: f64,
    beta: f64,
    slip: f64,
    bearing: f64,
    bearing_ratio: f64,
    committed: Place,
    trial: Place,
    /// Tangent at the last trial, divided by the stiffness.
    share: f64,
}

state! {
    SelfCentring as "self_centring" { committed }
    keeps { stiffness, activation, ratio, beta, slip, bearing, bearing_ratio, trial, share }
    restored { *trial = *committed; *share = 1.0; }
}

#[derive(Debug, Clone, Copy, Default)]
struct Place {
    /// Where the elastic line has no force.
    rest: f64,
    /// Where the flag has no force: moved by slip.
    origin: f64,
}

state! { Place { rest, origin } }

impl SelfCentring {
    /// A limit of the force at a displacement ≥ 0, for a line that begins at the displacement `from`, and its slope. Both are divided
    /// by the stiffness.
    fn limit(&self, disp: f64, from: f64) -> (f64, f64) {
        if disp <= from {
            (disp, 1.0)
        } else if disp < self.slip {
            (from + self.ratio * (disp - from), self.ratio)
        } else {
            (from + self.ratio * (disp - from), 0.0)
        }
    }
}

impl Law for SelfCentring {
    fn trial(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        let held = disp.clamp(-self.bearing, self.bearing);
        let Place { rest, origin } = self.committed;
        let within = (held - origin).clamp(-self.slip, self.slip);
        let origin = if within == held - origin {
            origin
        } else {
            held - within
        };
        let size = within.abs();
        let mut high = self.limit(size, self.activation);
        let mut low = self.limit(size, (1.0 - self.beta) * self.activation);
        if within < 0.0 {
            (low, high) = ((-high.0, high.1), (-low.0, low.1));
        }
        let elastic = held - rest;
        let reached = elastic.max(low.0).min(high.0);
        self.trial = Place {
            rest: if reached == elastic {
                rest
            } else {
                held - reached
            },
            origin,
        };
        let bears = disp != held;
        self.share = if bears {
            self.bearing_ratio
        } else if reached >= high.0 {
            high.1
        } else if reached <= low.0 {
            low.1
        } else {
            1.0
        };
        let beyond = if bears {
            self.bearing_ratio * (disp - held)
        } else {
            0.0
        };
        // A lost displacement must not pass for a force.
        self.stiffness * (reached + beyond) + 0.0 * disp
    }

    fn commit(&mut self) {
        self.committed = self.trial;
    }

    fn revert(&mut self) {
        self.trial = self.committed;
    }

    fn tangent(&self) -> Tangent {
        Tangent::elastic(self.share * self.stiffness)
    }

    fn reference(&self) -> Tangent {
        Tangent::elastic(self.stiffness)
    }

    fn bound(&self, _reach: Reach) -> (Option<f64>, Option<f64>) {
        let steepest = if self.bearing.is_finite() {
            self.bearing_ratio.max(1.0)
        } else {
            1.0
        };
        (Some(steepest * self.stiffness), Some(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flag() -> SelfCentringSpec {
        SelfCentringSpec {
            stiffness_n_per_m: 1e5,
            activation_force_n: 100.0,
            post_activation_ratio: 0.05,
            beta: 0.8,
            slip_disp_m: None,
            bearing_disp_m: None,
            bearing_ratio: 0.5,
        }
    }

    /// Forces in one step for each displacement in mm.
    fn assert_forces(spec: &SelfCentringSpec, path: &[(f64, f64)]) {
        let mut law = spec.build().unwrap();
        for (disp, wanted) in path {
            let force = law.step(1e-3 * disp, 0.0, 0.0);
            assert!((force - wanted).abs() < 1e-9, "{disp}: {force} {wanted}");
        }
    }

    /// Unloading lowers the force by (1 − r) β F_a = 76 N.
    #[test]
    fn loop_is_a_flag() {
        let back = [
            (3.0, 110.0),
            (2.24, 34.0),
            (2.0, 29.0),
            (2.5, 79.0),
            (2.1, 39.0),
            (0.2, 20.0),
        ];
        assert_forces(&flag(), &back);
        assert_forces(
            &flag(),
            &[
                (3.0, 110.0),
                (0.0, 0.0),
                (-1.5, -102.5),
                (-1.0, -52.5),
                (0.0, 0.0),
            ],
        );
    }

    #[test]
    fn slip_moves_the_origin() {
        let spec = SelfCentringSpec {
            slip_disp_m: Some(5e-3),
            ..flag()
        };
        assert_forces(
            &spec,
            &[
                (5.0, 120.0),
                (9.0, 120.0),
                (8.24, 44.0),
                (4.0, 0.0),
                (-1.0, -120.0),
            ],
        );
    }

    #[test]
    fn device_bears_at_its_end() {
        let spec = SelfCentringSpec {
            bearing_disp_m: Some(5e-3),
            ..flag()
        };
        assert_forces(
            &spec,
            &[(6.0, 170.0), (5.0, 120.0), (4.5, 70.0), (-6.0, -170.0)],
        );
        assert_eq!(spec.build().unwrap().bound(Reach::default()).0, Some(1e5));
    }
}
