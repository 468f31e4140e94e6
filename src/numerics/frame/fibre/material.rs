//! A material with its numbers checked.

use super::{Concrete01, Concrete02, MenegottoPinto};

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
