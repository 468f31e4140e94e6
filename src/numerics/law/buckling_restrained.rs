//! Buckling-restrained brace: kinematic and isotropic hardening, stronger in compression than in tension.
//!
//! Source: Zona & Dall'Asta 2012, J. Constr. Steel Res. 68, 118–125; Gu, Zona, Zhou & Dall'Asta 2014, Eng. Struct. 62–63, 217–230
//! (material `SteelBRB` of OpenSees). In yield displacements u and yield forces f, with the plastic displacement p,
//!
//! ```text
//! f = u − p        dp = |q/Y|^α du  where f du > 0, else 0        q = f − b p
//! Y = 1 + (S − 1) (1 − exp(−m/δ))        m = ∫ |dp|
//! ```
//!
//! S is ω in tension and ω β in compression. On a straight path the force is unloaded along a line, then p follows from a
//! differential equation, which is extrapolated to roundoff. So one step equals any number of partial steps.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::domain::{fraction, inside, positive, yield_disp};
use super::extrapolate::integrate;
use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;

/// Buckling-restrained brace with kinematic and isotropic hardening. Sources: Zona & Dall'Asta 2012, Gu et al. 2014.
///
/// The yield force grows with the plastic path from F_y to ω F_y in tension and to ω β F_y in compression. Kinematic hardening comes
/// on top of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct BucklingRestrainedSpec {
    /// Elastic stiffness, greater than 0.
    #[schemars(example = 2.0e8)]
    pub stiffness_n_per_m: f64,
    /// Yield force F_y of the core, greater than 0.
    #[schemars(example = 5.0e5)]
    pub yield_force_n: f64,
    /// Strain hardening ω: saturated yield force in tension, divided by F_y. From 1 to 10.
    #[schemars(example = 1.3)]
    pub strain_hardening: f64,
    /// Overstrength β: saturated yield force in compression, divided by that in tension. From 1 to 10.
    #[schemars(example = 1.1)]
    pub compression_overstrength: f64,
    /// Kinematic hardening b: force for each plastic displacement, divided by the stiffness. From 0 to 1.
    #[schemars(example = 0.02)]
    pub post_yield_ratio: f64,
    /// Plastic path δ over which the yield force grows by 63 % of its growth, greater than 0.
    #[schemars(example = 0.03)]
    pub saturation_disp_m: f64,
    /// Exponent α of the transition from elastic to plastic, from 0.1 to 10. A larger value makes it sharper.
    #[schemars(example = 0.8)]
    pub exponent: f64,
}

impl BucklingRestrainedSpec {
    /// # Errors
    /// A parameter outside its domain.
    pub(crate) fn build(&self) -> Result<BucklingRestrained, LawError> {
        let ratio = |name, found: f64| {
            let allowed = (1.0..=10.0).contains(&found);
            inside(name, found, allowed, "from 1 to 10")
        };
        let stiffness = positive("stiffness_n_per_m", self.stiffness_n_per_m)?;
        let force = positive("yield_force_n", self.yield_force_n)?;
        let yield_disp = yield_disp("yield_force_n", force, stiffness)?;
        let tension = ratio("strain_hardening", self.strain_hardening)?;
        let overstrength = ratio("compression_overstrength", self.compression_overstrength)?;
        let saturation = positive("saturation_disp_m", self.saturation_disp_m)? / yield_disp;
        let fits = (1e-3..1e9).contains(&saturation);
        let allowed = "from 1e-3 to 1e9 times the yield displacement";
        inside("saturation_disp_m", self.saturation_disp_m, fits, allowed)?;
        let fits = (0.1..=10.0).contains(&self.exponent);
        Ok(BucklingRestrained {
            stiffness,
            yield_disp,
            growth: [tension - 1.0, tension * overstrength - 1.0],
            kinematic: fraction("post_yield_ratio", self.post_yield_ratio)?,
            saturation,
            exponent: inside("exponent", self.exponent, fits, "from 0.1 to 10")?,
            committed: Core::default(),
            trial: Core::default(),
            share: 1.0,
        })
    }
}

/// See [`BucklingRestrainedSpec`]. A step of more than a thousand yield displacements is too long: it gives NaN.
#[derive(Debug, Clone)]
pub struct BucklingRestrained {
    stiffness: f64,
    yield_disp: f64,
    /// S − 1 in tension and in compression.
    growth: [f64; 2],
    kinematic: f64,
    /// δ in yield displacements.
    saturation: f64,
    exponent: f64,
    committed: Core,
    trial: Core,
    /// Tangent at the last trial, divided by the stiffness.
    share: f64,
}

state! {
    BucklingRestrained as "buckling_restrained" { committed }
    keeps { stiffness, yield_disp, growth, kinematic, saturation, exponent, trial, share }
    restored { *trial = *committed; *share = 1.0; }
}

/// All in yield displacements.
#[derive(Debug, Clone, Copy, Default)]
struct Core {
    disp: f64,
    plastic: f64,
    /// ∫ |dp|.
    path: f64,
}

state! { Core { disp, plastic, path } }

/// Longest piece of a path, in yield displacements.
const PIECE: f64 = 0.25;
/// Longest step, in yield displacements.
const FARTHEST: f64 = 1000.0;

/// The plastic flow in one direction of motion, in which all is positive.
struct Flow {
    growth: f64,
    kinematic: f64,
    saturation: f64,
    exponent: f64,
    path: f64,
    plastic: f64,
}

impl Flow {
    /// q at a force, after more plastic displacement.
    fn drive(&self, force: f64, more: f64) -> f64 {
        force - self.kinematic * (self.plastic + more)
    }

    /// dp/du, at most 1: the force never falls.
    fn share(&self, drive: f64, more: f64) -> f64 {
        let grown = -libm::expm1(-(self.path + more) / self.saturation);
        let strength = 1.0 + self.growth * grown;
        let ratio = drive.abs() / strength;
        if ratio >= 1.0 {
            1.0
        } else {
            libm::pow(ratio, self.exponent)
        }
    }

    /// Force and further plastic displacement after `travel` from zero force, or from a force in the direction of motion.
    fn after(&self, force: f64, travel: f64) -> Option<[f64; 2]> {
        let (mut start, mut rest) = ([force, 0.0], travel);
        let drive = self.drive(force, 0.0);
        // The equation has a kink where q changes its sign: with q as the variable it lies at an end.
        let rises = 1.0 - self.share(drive, 0.0) * (1.0 + self.kinematic);
        if drive < 0.0 && rises > 1e-3 {
            let [spent, force, more] = integrate([0.0, force, 0.0], -drive, |[_, force, more]| {
                let share = self.share(self.drive(*force, *more).min(0.0), *more);
                let slowness = 1.0 / (1.0 - share * (1.0 + self.kinematic));
                [slowness, (1.0 - share) * slowness, share * slowness]
            })?;
            if spent < rest {
                start = [force, more];
                rest -= spent;
            } else {
                return self.follow(start, rest, -1.0);
            }
        }
        let side = if self.drive(start[0], start[1]) < -1e-9 {
            -1.0
        } else {
            1.0
        };
        self.follow(start, rest, side)
    }

    /// A stretch on which q keeps its sign, which is `side`, in pieces over which the equation is smooth.
    fn follow(&self, start: [f64; 2], travel: f64, side: f64) -> Option<[f64; 2]> {
        let (mut at, mut rest) = (start, travel);
        while rest > 0.0 {
            let piece = rest.min(PIECE);
            at = integrate(at, piece, |[force, more]| {
                let drive = side * self.drive(*force, *more);
                let drive = if drive < -1e-9 {
                    f64::NAN
                } else {
                    drive.max(0.0)
                };
                let share = self.share(drive, *more);
                [1.0 - share, share]
            })?;
            rest -= piece;
        }
        Some(at)
    }
}

impl BucklingRestrained {
    /// The core at `disp` yield displacements and its tangent, on a straight path from the committed one.
    fn at(&self, disp: f64) -> Option<(Core, f64)> {
        let from = self.committed;
        let travel = (disp - from.disp).abs();
        let direction = f64::copysign(1.0, disp - from.disp);
        let force = direction * (from.disp - from.plastic);
        if travel > FARTHEST {
            return None;
        }
        // Back to zero force along the elastic line.
        let elastic = (-force).max(0.0);
        if travel <= elastic {
            return Some((Core { disp, ..from }, 1.0));
        }
        let flow = Flow {
            growth: if direction > 0.0 {
                self.growth[0]
            } else {
                self.growth[1]
            },
            kinematic: self.kinematic,
            saturation: self.saturation,
            exponent: self.exponent,
            path: from.path,
            plastic: direction * from.plastic,
        };
        let [force, more] = flow.after(force.max(0.0), travel - elastic)?;
        let core = Core {
            disp,
            plastic: from.plastic + direction * more,
            path: from.path + more,
        };
        Some((core, 1.0 - flow.share(flow.drive(force, more), more)))
    }
}

impl Law for BucklingRestrained {
    fn trial(&mut self, disp: f64, _vel: f64, _dt: f64) -> f64 {
        match self.at(disp / self.yield_disp) {
            Some((core, share)) => {
                (self.trial, self.share) = (core, share);
                self.stiffness * self.yield_disp * (core.disp - core.plastic)
            }
            None => f64::NAN,
        }
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
        (Some(self.stiffness), Some(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec() -> BucklingRestrainedSpec {
        BucklingRestrainedSpec {
            stiffness_n_per_m: 1e8,
            yield_force_n: 1e5,
            strain_hardening: 1.4,
            compression_overstrength: 1.2,
            post_yield_ratio: 0.0,
            saturation_disp_m: 5e-3,
            exponent: 1.0,
        }
    }

    /// Without growth and with α = 1 the force from zero is F_y (1 − exp(−u/u_y)).
    #[test]
    fn first_loading_is_an_exponential() {
        let mut law = BucklingRestrainedSpec {
            strain_hardening: 1.0,
            compression_overstrength: 1.0,
            ..spec()
        }
        .build()
        .unwrap();
        for disp in [0.5e-3, -2e-3_f64] {
            let mut law = law.clone();
            let wanted = -1e5 * libm::expm1(-disp.abs() / 1e-3) * disp.signum();
            assert!((law.step(disp, 0.0, 0.0) - wanted).abs() < 1e-6);
        }
        // Unloading is elastic to zero force.
        let force = law.step(2e-3, 0.0, 0.0);
        assert!((law.step(1.5e-3, 0.0, 0.0) - (force - 5e4)).abs() < 1e-6);
        assert_eq!(law.tangent().stiffness, 1e8);
    }

    #[test]
    fn saturated_forces_are_those_declared() {
        let mut law = spec().build().unwrap();
        let mut reached = [0.0; 2];
        for turn in 1..20 {
            let disp = if turn % 2 == 0 { 0.03 } else { -0.03 };
            reached[turn % 2] = law.step(disp, 0.0, 0.0);
        }
        assert!((reached[0] - 1.4e5).abs() < 1.0, "{reached:?}");
        assert!((reached[1] + 1.68e5).abs() < 1.0, "{reached:?}");
    }

    /// A partial step that ends where the drive changes its sign, and the reversal under much kinematic hardening.
    #[test]
    fn hardened_core_is_followed() {
        for exponent in [0.5, 1.0, 2.5] {
            let hard = BucklingRestrainedSpec {
                post_yield_ratio: 0.05,
                exponent,
                ..spec()
            };
            let (mut whole, mut parts) = (hard.build().unwrap(), hard.build().unwrap());
            let mut from = 0.0;
            for turn in [0.02, -0.01, -0.004, -0.02, 0.03, 0.0299, 0.0] {
                let force = whole.step(turn, 0.0, 0.0);
                let mut last = 0.0;
                for part in 1..=37 {
                    last = parts.step(from + (turn - from) * f64::from(part) / 37.0, 0.0, 0.0);
                }
                assert!(
                    (force - last).abs() < 1e-6,
                    "{exponent} {turn}: {force} {last}"
                );
                from = turn;
            }
        }
    }
}
