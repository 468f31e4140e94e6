//! Behaviour of a simulated specimen in the test file: `law`, `laws`, `coupled` or `bearing`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{BearingSpec, CoupledSpec, Specimen, Uniaxial};
use gusset_numerics::law::{LawError, LawSpec};

/// Behaviour of a simulated specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum SpecimenLaw {
    /// Same law for all axes, with own state for each axis.
    Law(LawSpec),
    /// Own law for each axis.
    Laws(Vec<LawSpec>),
    /// Linear law with full matrices.
    Coupled(CoupledSpec),
    /// Bearing whose horizontal axes share one circle.
    Bearing(BearingSpec),
}

impl SpecimenLaw {
    /// The force in N at which an axis yields from its virgin state, if its law has one.
    #[must_use]
    pub fn yield_force(&self, axis: usize) -> Option<f64> {
        match self {
            Self::Law(law) => law.yield_force(),
            Self::Laws(laws) => laws.get(axis)?.yield_force(),
            Self::Coupled(_) => None,
            Self::Bearing(bearing) => (axis < 2).then(|| bearing.yield_force()),
        }
    }

    /// True if the force of an axis depends on the velocity.
    #[must_use]
    pub fn resists_velocity(&self) -> bool {
        let resists = |law: &LawSpec| law.build().is_ok_and(|law| law.resists_velocity());
        match self {
            Self::Law(law) => resists(law),
            Self::Laws(laws) => laws.iter().any(resists),
            Self::Coupled(coupled) => {
                let damping = coupled.damping_n_s_per_m.iter().flatten();
                damping.flatten().any(|entry| *entry != 0.0)
            }
            Self::Bearing(bearing) => bearing.resists_velocity(),
        }
    }

    /// The behaviour from the three keys of a specimen's table, which exclude each other; `None` without any of them.
    ///
    /// # Errors
    /// More than one of them is given.
    #[cfg(test)]
    pub(crate) fn one_of(
        law: Option<LawSpec>,
        laws: Option<Vec<LawSpec>>,
        coupled: Option<CoupledSpec>,
    ) -> Result<Option<Self>, LawError> {
        let exclusive = |first, second| Err(LawError::Exclusive { first, second });
        match (law, laws, coupled) {
            (Some(_), Some(_), _) => exclusive("law", "laws"),
            (Some(_), _, Some(_)) => exclusive("law", "coupled"),
            (_, Some(_), Some(_)) => exclusive("laws", "coupled"),
            (Some(law), None, None) => Ok(Some(Self::Law(law))),
            (None, Some(laws), None) => Ok(Some(Self::Laws(laws))),
            (None, None, Some(coupled)) => Ok(Some(Self::Coupled(coupled))),
            (None, None, None) => Ok(None),
        }
    }

    /// The specimen for `axes` ≥ 1 axes, in its virgin state.
    ///
    /// # Errors
    /// A parameter outside its domain, or a list or matrix of the wrong size.
    pub fn build(&self, axes: usize) -> Result<Box<dyn Specimen>, LawError> {
        match self {
            Self::Law(spec) => {
                let laws: Result<_, _> = (0..axes).map(|_| spec.build()).collect();
                Ok(Box::new(Uniaxial::new(laws?)?))
            }
            Self::Laws(specs) => {
                if specs.len() != axes {
                    return Err(LawError::Size {
                        name: "laws",
                        what: "entries",
                        found: specs.len(),
                        wanted: axes,
                    });
                }
                let laws = LawSpec::build_all("laws", specs)?;
                Ok(Box::new(Uniaxial::new(laws)?))
            }
            Self::Coupled(spec) => Ok(Box::new(spec.build(axes)?)),
            Self::Bearing(spec) => Ok(Box::new(spec.build(axes)?)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::assert_is;

    #[derive(Deserialize)]
    struct Keys {
        law: Option<LawSpec>,
        laws: Option<Vec<LawSpec>>,
        coupled: Option<CoupledSpec>,
    }

    fn read(text: &str) -> Result<Option<SpecimenLaw>, LawError> {
        let keys: Keys = toml::from_str(text).unwrap();
        SpecimenLaw::one_of(keys.law, keys.laws, keys.coupled)
    }

    #[test]
    fn each_key_builds_its_specimen() {
        let one = "law = { bouc_wen = { stiffness_n_per_m = 1e6, yield_force_n = 1e3, \
                   post_yield_ratio = 0.1, beta = 0.5, gamma = 0.5, exponent = 2 } }";
        let two = "laws = [ { linear = { stiffness_n_per_m = 2.0 } }, { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 3.0 } } ]";
        let full = "coupled = { stiffness_n_per_m = [[2.0, -1.0], [-1.0, 2.0]] }";
        for (text, axes) in [(one, 1), (one, 3), (two, 2), (full, 2)] {
            let specimen = read(text).unwrap().unwrap().build(axes).unwrap();
            assert_eq!(specimen.axes(), axes);
        }
        assert_eq!(read("").unwrap(), None);
        let wrong = read(two).unwrap().unwrap().build(3).unwrap_err();
        assert_is!(wrong => LawError::Size { name: "laws", found: 2, wanted: 3, .. });
        let both = read(&format!("{two}\n{full}")).unwrap_err();
        assert_is!(both => LawError::Exclusive { first: "laws", second: "coupled" });
    }
}
