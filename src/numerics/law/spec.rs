//! A law in the test file: one table per kind, `law = { bilinear = { … } }`.
//!
//! A description may hold any number; [`LawSpec::build`] is where each is checked, by name.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    BilinearSpec, BiviscousSpec, BoucWenSpec, BucklingRestrainedSpec, CubicSpec, GapSpec,
    HystereticSpec, ImkSpec, Law, LawError, LinearSpec, MaxwellSpec, Parallel, Pinching4Spec,
    PoundingSpec, PowerDamperSpec, SelfCentringSpec, SmoothFrictionSpec, SquareRootSpec,
};

/// Uniaxial force law, for an element of the structure or for a simulated specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum LawSpec {
    /// Linear spring and dashpot, f = k d + c v, or one of them alone.
    Linear(LinearSpec),
    /// Spring that hardens or softens with the square root of the displacement. Source: Gui et al.
    /// 2014, equation 42.
    SquareRoot(SquareRootSpec),
    /// Cubic (Duffing) spring, f = k d + k₃ d³.
    Cubic(CubicSpec),
    /// Bilinear spring with kinematic hardening, perfectly plastic spring or Coulomb friction.
    Bilinear(BilinearSpec),
    /// Bouc–Wen hysteresis, with optional degradation and pinching.
    BoucWen(BoucWenSpec),
    /// Plastic hinge that softens and deteriorates, after Ibarra, Medina and Krawinkler.
    Imk(ImkSpec),
    /// Hysteresis of straight lines with pinching and damage, as `Hysteretic` of OpenSees.
    Hysteretic(HystereticSpec),
    /// Pinched hysteresis of four corners with damage, as `Pinching4` of OpenSees.
    #[serde(rename = "pinching4")]
    Pinching4(Pinching4Spec),
    /// Buckling-restrained brace, stronger in compression than in tension.
    BucklingRestrained(BucklingRestrainedSpec),
    /// Self-centring brace or connection with a flag-shaped loop.
    SelfCentring(SelfCentringSpec),
    /// Pounding behind a gap: contact after Hertz with restitution.
    Pounding(PoundingSpec),
    /// Spring behind a gap, in tension, compression or both.
    Gap(GapSpec),
    /// Friction that is smoothed around zero velocity by a hyperbolic tangent.
    SmoothFriction(SmoothFrictionSpec),
    /// Dashpot with a second damping coefficient above a yield velocity.
    Biviscous(BiviscousSpec),
    /// Fluid damper whose force is a power of the velocity.
    PowerDamper(PowerDamperSpec),
    /// Spring in series with a fluid damper: a damper in its brace, or a material that relaxes.
    Maxwell(MaxwellSpec),
    /// Several laws in parallel. The force is the sum of their forces.
    Parallel(Vec<LawSpec>),
}

impl LawSpec {
    /// Builds the law at rest, in its initial state.
    ///
    /// ```
    /// use gusset_numerics::law::{Law, LawSpec};
    ///
    /// let spec: LawSpec = toml::from_str(
    ///     "bilinear = { stiffness_n_per_m = 1.19e6, yield_force_n = 1190.0, post_yield_ratio = 0.1 }",
    /// )?;
    /// let mut law = spec.build()?;
    /// assert!((law.trial(3e-3, 0.0, 0.0) - 1428.0).abs() < 1e-9);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// The first parameter outside its domain, with its key.
    pub fn build(&self) -> Result<Box<dyn Law>, LawError> {
        Ok(match self {
            Self::Linear(spec) => Box::new(spec.build()?),
            Self::SquareRoot(spec) => Box::new(spec.build()?),
            Self::Cubic(spec) => Box::new(spec.build()?),
            Self::Bilinear(spec) => Box::new(spec.build()?),
            Self::BoucWen(spec) => Box::new(spec.build()?),
            Self::Imk(spec) => Box::new(spec.build()?),
            Self::Hysteretic(spec) => Box::new(spec.build()?),
            Self::Pinching4(spec) => Box::new(spec.build()?),
            Self::BucklingRestrained(spec) => Box::new(spec.build()?),
            Self::SelfCentring(spec) => Box::new(spec.build()?),
            Self::Pounding(spec) => Box::new(spec.build()?),
            Self::Gap(spec) => Box::new(spec.build()?),
            Self::SmoothFriction(spec) => Box::new(spec.build()?),
            Self::Biviscous(spec) => Box::new(spec.build()?),
            Self::PowerDamper(spec) => Box::new(spec.build()?),
            Self::Maxwell(spec) => Box::new(spec.build()?),
            Self::Parallel(specs) => Box::new(Parallel::new(Self::build_all("parallel", specs)?)?),
        })
    }

    /// The force in N at which the law yields from its virgin state; none for a law that does not yield, or not at one force.
    #[must_use]
    pub fn yield_force(&self) -> Option<f64> {
        match self {
            Self::Bilinear(spec) => Some(spec.yield_force_n),
            Self::BoucWen(spec) => Some(spec.yield_force_n),
            Self::Imk(spec) => Some(spec.yield_force()),
            Self::Hysteretic(spec) => spec.yield_force(),
            Self::Pinching4(spec) => spec.yield_force(),
            Self::BucklingRestrained(spec) => Some(spec.yield_force_n),
            Self::SelfCentring(spec) => Some(spec.activation_force_n),
            _ => None,
        }
    }

    /// Builds each entry of the list under the key `list`.
    ///
    /// # Errors
    /// The first entry that cannot be built, with its position.
    pub fn build_all(list: &'static str, specs: &[Self]) -> Result<Vec<Box<dyn Law>>, LawError> {
        let numbered = specs.iter().zip(1..);
        numbered
            .map(|(spec, index)| {
                spec.build().map_err(|reason| LawError::Entry {
                    list,
                    index,
                    reason: Box::new(reason),
                })
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use gusset_quantity::assert_is;
    use gusset_quantity::domain::OutOfDomain;

    use super::*;

    #[test]
    fn wrong_law_in_a_list_is_named() {
        let text = "parallel = [ { linear = { stiffness_n_per_m = 0.0, damping_n_s_per_m = 3.0 } }, \
                    { gap = { stiffness_n_per_m = 1e6, gap_m = -0.1, side = \"both\" } } ]";
        let error = toml::from_str::<LawSpec>(text)
            .unwrap()
            .build()
            .unwrap_err();
        assert_eq!(error.key(), "gap_m");
        assert_is!(
            error
            => LawError::Entry { list: "parallel", index: 2, reason } if matches!(**reason, LawError::Parameter(OutOfDomain { found: -0.1, .. }))
        );
        let empty = toml::from_str::<LawSpec>("parallel = []").unwrap();
        assert_is!(
            empty.build().err()
            => Some(LawError::Size { name: "parallel", found: 0, wanted: 1, .. })
        );
    }

    #[test]
    fn unknown_keys_and_kinds_are_refused() {
        let typo = "linear = { stifness_n_per_m = 1.0 }";
        assert!(toml::from_str::<LawSpec>(typo).is_err());
        assert!(toml::from_str::<LawSpec>("magic = {}").is_err());
    }

    #[test]
    fn schema_explains_every_key() {
        fn walk(value: &serde_json::Value, path: &str, missing: &mut Vec<String>) {
            if let Some(object) = value.as_object() {
                if let Some(properties) = object.get("properties").and_then(|p| p.as_object()) {
                    for (key, inner) in properties {
                        let explained = inner.get("description").is_some()
                            || inner.get("$ref").is_some()
                            || inner.get("items").is_some();
                        if !explained {
                            missing.push(format!("{path}/{key}"));
                        }
                    }
                }
                for (key, inner) in object {
                    walk(inner, &format!("{path}/{key}"), missing);
                }
            } else if let Some(list) = value.as_array() {
                for inner in list {
                    walk(inner, path, missing);
                }
            }
        }
        let schema = serde_json::to_value(schemars::schema_for!(LawSpec)).unwrap();
        let mut missing = Vec::new();
        walk(&schema, "", &mut missing);
        assert!(missing.is_empty(), "{missing:?}");
        assert!(schema.to_string().contains("post_yield_ratio"));
    }
}
