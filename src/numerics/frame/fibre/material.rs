//! A material with its numbers checked.

use super::spec::{Concrete01Spec, Concrete02Spec, MaterialSpec, MenegottoPintoSpec, YoungSpec};
use super::{Concrete01, Concrete02, Fibre, Fibres, MenegottoPinto, SectionResponse};
use crate::linalg::Lanes;
use gusset_quantity::domain::{OutOfDomain, finite, inside, not_negative, positive};

/// See [`super::MaterialSpec`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::frame) enum Material {
    /// Young's modulus.
    Elastic(f64),
    /// Young's modulus.
    ElasticNoTension(f64),
    MenegottoPinto(MenegottoPinto),
    Concrete01(Concrete01),
    Concrete02(Concrete02),
}

impl Material {
    /// True if its tangent jumps by itself: where it cracks, crushes or opens.
    pub(in crate::frame) const fn is_brittle(&self) -> bool {
        !matches!(self, Self::Elastic(_) | Self::MenegottoPinto(_))
    }

    /// Young's modulus before the first motion. No tangent exceeds it.
    pub(in crate::frame) fn initial_stiffness(&self) -> f64 {
        match self {
            Self::Elastic(young) | Self::ElasticNoTension(young) => *young,
            Self::MenegottoPinto(steel) => steel.young(),
            Self::Concrete01(concrete) => concrete.young(),
            Self::Concrete02(concrete) => concrete.young(),
        }
    }

    /// Yield strain of steel, strain at the strength of concrete (it counts in compression only).
    pub(in crate::frame) fn yield_strain(&self) -> Option<f64> {
        match self {
            Self::Elastic(_) | Self::ElasticNoTension(_) => None,
            Self::MenegottoPinto(steel) => Some(steel.yield_strain()),
            Self::Concrete01(concrete) => Some(concrete.yield_strain()),
            Self::Concrete02(concrete) => Some(concrete.yield_strain()),
        }
    }

    /// A strain in parts of that at which it yields. Concrete counts in compression only.
    pub(in crate::frame) fn demand(&self, strain: f64) -> Option<f64> {
        let size = match self {
            Self::Concrete01(_) | Self::Concrete02(_) => (-strain).max(0.0),
            _ => strain.abs(),
        };
        Some(size / self.yield_strain()?)
    }

    /// Rows of state of a block. The first one, if there is one, is the strain in yield strains: its present value or its extreme.
    pub(super) fn rows(&self) -> usize {
        match self {
            Self::Elastic(_) | Self::ElasticNoTension(_) => 0,
            Self::MenegottoPinto(_) => MenegottoPinto::ROWS,
            Self::Concrete01(_) => Concrete01::ROWS,
            Self::Concrete02(_) => Concrete02::ROWS,
        }
    }

    /// Each row before the first motion.
    pub(super) fn virgin(&self) -> Vec<f64> {
        match self {
            Self::MenegottoPinto(steel) => steel.virgin().to_vec(),
            _ => vec![0.0; self.rows()],
        }
    }
}

const POSITIVE: &str = "finite and greater than 0; compression is given as a positive number";

impl MaterialSpec {
    /// The material, after all numbers are checked.
    pub(in crate::frame) fn build(&self) -> Result<Material, OutOfDomain> {
        let young = |spec: &YoungSpec| positive("young_pa", spec.young_pa);
        Ok(match self {
            Self::Elastic(spec) => Material::Elastic(young(spec)?),
            Self::ElasticNoTension(spec) => Material::ElasticNoTension(young(spec)?),
            Self::MenegottoPinto(spec) => Material::MenegottoPinto(spec.build()?),
            Self::Concrete01(spec) => Material::Concrete01(spec.build()?),
            Self::Concrete02(spec) => Material::Concrete02(spec.build()?),
        })
    }

    /// Stresses of one fibre that takes these strains one after the other, tension positive.
    ///
    /// # Errors
    /// A number outside its domain, or a strain that is not finite.
    pub fn stresses(&self, strains: &[f64]) -> Result<Vec<f64>, OutOfDomain> {
        let fibre = Fibre {
            y: 0.0,
            z: 0.0,
            area: 1.0,
            material: 0,
        };
        let mut fibres = Fibres::new(1, &[fibre], &[self.build()?]);
        let lanes = Lanes::best();
        let mut stress = |strain| {
            let mut out = [SectionResponse::default()];
            fibres.trial(lanes, &[[finite("strain", strain)?, 0.0]], &mut out);
            fibres.commit();
            Ok(out[0].force[0])
        };
        strains.iter().map(|strain| stress(*strain)).collect()
    }
}

impl MenegottoPintoSpec {
    fn build(&self) -> Result<MenegottoPinto, OutOfDomain> {
        let young = positive("young_pa", self.young_pa)?;
        let yield_strain = self.yield_pa / young;
        Ok(MenegottoPinto::new(Self {
            young_pa: young,
            yield_pa: inside(
                "yield_pa",
                self.yield_pa,
                1e-9 < yield_strain && yield_strain < 1.0,
                "greater than 1e-9 and less than 1 times `young_pa`",
            )?,
            hardening_ratio: inside(
                "hardening_ratio",
                self.hardening_ratio,
                (0.0..1.0).contains(&self.hardening_ratio),
                "from 0 to less than 1",
            )?,
            r0: positive("r0", self.r0)?,
            cr1: inside(
                "cr1",
                self.cr1,
                self.cr1 >= 0.0 && self.r0 * (1.0 - self.cr1) >= 0.1,
                "not negative, and small enough that `r0` (1 − `cr1`) is at least 0.1",
            )?,
            cr2: positive("cr2", self.cr2)?,
            a1: not_negative("a1", self.a1)?,
            a2: positive("a2", self.a2)?,
            a3: not_negative("a3", self.a3)?,
            a4: positive("a4", self.a4)?,
        }))
    }
}

impl Concrete01Spec {
    fn build(&self) -> Result<Concrete01, OutOfDomain> {
        let (strength, strain) = (self.strength_pa, self.strain_at_strength);
        inside("strength_pa", strength, strength > 0.0, POSITIVE)?;
        inside(
            "strain_at_strength",
            strain,
            1e-9 < strain && strain < 1.0 && (2.0 * strength / strain).is_finite(),
            "greater than 1e-9 and less than 1; compression is given as a positive number",
        )?;
        inside(
            "crushing_strength_pa",
            self.crushing_strength_pa,
            (0.0..strength).contains(&self.crushing_strength_pa),
            "from 0 to less than `strength_pa`; compression is given as a positive number",
        )?;
        inside(
            "crushing_strain",
            self.crushing_strain,
            self.crushing_strain > strain,
            "finite and greater than `strain_at_strength`; compression is given as a positive number",
        )?;
        Ok(Concrete01::new(*self))
    }
}

impl Concrete02Spec {
    fn build(&self) -> Result<Concrete02, OutOfDomain> {
        let envelope = Concrete01Spec {
            strength_pa: self.strength_pa,
            strain_at_strength: self.strain_at_strength,
            crushing_strength_pa: self.crushing_strength_pa,
            crushing_strain: self.crushing_strain,
        };
        let compression = envelope.build()?;
        let young = 2.0 * self.strength_pa / self.strain_at_strength;
        let secant = self.crushing_strength_pa / (young * self.crushing_strain);
        let ratio = self.unloading_ratio;
        inside(
            "unloading_ratio",
            ratio,
            (secant..1.0).contains(&ratio),
            "at least `crushing_strength_pa` `strain_at_strength`/(2 `strength_pa` `crushing_strain`), and less than 1",
        )?;
        not_negative("tensile_strength_pa", self.tensile_strength_pa)?;
        positive("tension_softening_pa", self.tension_softening_pa)?;
        Ok(Concrete02::new(compression, self))
    }
}
