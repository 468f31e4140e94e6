//! The mathematics of the computed half of a test: force laws, matrices, the structure, and its integration in time.
//!
//! [`law`] holds uniaxial force laws, which elements and computed specimens share. [`linalg`] holds symmetric matrices and their
//! factors; a solve allocates nothing. [`model`] builds M, C, K and the nonlinear elements of a structure, [`frame`] those of
//! a plane frame. [`integrate`] is the Gui-λ
//! family and its companions. [`spectral`] says what a method does to one mode: poles, period error, bounds, critical delay.
//!
//! Results are the same to the last bit on every machine: functions come from `libm`, and vector kernels add in a fixed order. The
//! kernels and all their helpers stay in this member, because a call from another one would be compiled for the least common
//! processor. This member knows no clock, no file, no specimen and no configuration. Begin reading with [`integrate`].

pub mod frame;
pub mod integrate;
pub mod law;
pub mod linalg;
pub mod model;
pub mod spectral;
