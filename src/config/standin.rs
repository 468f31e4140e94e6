//! Stand-ins, by name only, for the descriptions that live beside their implementations.
//!
//! Nothing else in this folder depends on their inner layout. Deleted when the implementations land.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Stands for `crate::law::LawSpec`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum LawSpec {
    /// A linear spring and damper.
    Linear {
        /// Stiffness.
        stiffness_n_per_m: f64,
        /// Damping.
        #[serde(default)]
        damping_n_s_per_m: f64,
    },
    /// A bilinear spring.
    Bilinear {
        /// Stiffness.
        stiffness_n_per_m: f64,
        /// Yield force.
        yield_force_n: f64,
        /// Stiffness after yield over stiffness before.
        post_yield_ratio: f64,
    },
}

/// Stands for `crate::specimen::SpecimenLaw`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum SpecimenLaw {
    /// One axis.
    Law(LawSpec),
    /// Independent axes.
    Laws(Vec<LawSpec>),
    /// Coupled axes.
    Coupled {
        /// Stiffness matrix.
        stiffness_n_per_m: Vec<Vec<f64>>,
    },
}

/// Stands for `crate::model::StructureSpec`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum StructureSpec {
    /// Floors on storeys.
    ShearBuilding {
        /// Floor masses.
        mass_kg: Vec<f64>,
        /// Storey stiffnesses.
        stiffness_n_per_m: Vec<f64>,
    },
    /// Matrices.
    Matrices {
        /// Mass matrix file.
        mass_file: String,
    },
    /// A long chain.
    Chain {
        /// Number of masses.
        dofs: usize,
    },
}

/// Stands for `crate::model::DampingSpec`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum DampingSpec {
    /// Rayleigh damping.
    Rayleigh {
        /// Mass coefficient.
        mass_coefficient_per_s: f64,
        /// Stiffness coefficient.
        stiffness_coefficient_s: f64,
    },
}

/// Stands for `crate::model::ElementSpec`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ElementSpec {
    /// DOF, from 1.
    pub from: usize,
    /// DOF, from 1.
    pub to: usize,
    /// Its law.
    pub law: LawSpec,
}

/// Stands for `crate::motion::Signal`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum Signal {
    /// A sine.
    Sine {
        /// Amplitude.
        amplitude: f64,
        /// Frequency.
        frequency_hz: f64,
    },
    /// A record.
    File {
        /// Path.
        path: String,
    },
}

/// Stands for `crate::motion::Processing`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Processing {
    /// Factor.
    pub scale_factor: f64,
}

impl Default for Processing {
    fn default() -> Self {
        Self { scale_factor: 1.0 }
    }
}

/// Stands for `crate::rt::TimingSpec`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TimingSpec {
    /// Refuse to run without real-time scheduling.
    pub require_realtime: bool,
}
