//! Numbers computed from recorded histories: response of a structure, tracking of a specimen, intensity of the ground
//! motion.
//!
//! Pure functions: slices in, numbers out. A longer slice is cut to the shorter; a NaN is a missing sample and takes no
//! part. Where a number does not exist (no data, no motion) the answer is `None` and never a NaN. Nothing here knows of
//! files, column names or pictures.
//!
//! | file | holds |
//! |---|---|
//! | [`response`] | peaks, residuals, absorbed energy, lag by correlation |
//! | [`specimen`] | stiffness and damping of a specimen, with their standard errors |
//! | [`tracking`] | how well a measured displacement follows its target, each number with its noise floor |
//! | [`windows`] | phase and amplitude errors over the course of a test |
//! | [`fourier`] | amplitude spectra; the frequency evaluation index |
//! | [`ground`] | Arias intensity, significant duration, cumulative absolute velocity |
//! | [`spectrum`] | response spectra (Nigam and Jennings) |
//! | [`pair`] | geometric mean, RotD50 and RotD100 of two horizontal components |
//! | [`falsified`] | errors in damping and energy that late specimens introduce into a test as a whole |
//! | [`energy`] | the energy balance of a structure and its specimens, step by step |

pub mod energy;
pub mod falsified;
mod floor;
pub mod fourier;
pub mod ground;
pub mod pair;
pub mod response;
pub mod specimen;
pub mod spectrum;
pub mod tracking;
pub mod windows;

pub use floor::Judged;
pub use response::{Denominator, Peak, absorbed_energy, bridged, lag, nrmse, peak, residual};
pub use specimen::{Estimate, Identified, delayed, identify, loading};
pub use tracking::{Noise, Tracking};
