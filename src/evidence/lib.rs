//! Proof that Gusset computes what it says, from published and independent values.
//!
//! [`verify`] obtains the published values of the family of methods again and judges them. [`benchmark`] is the virtual hybrid
//! simulation benchmark of the literature, computed without a file. [`frontier`] finds how large a structure may be at a rate.
//!
//! A value is never copied from the program that it judges: it comes from a paper, a closed form or another formulation. This member
//! knows the loop and the numerics, but no user's file, no link and no run folder. Begin reading with [`verify`].

pub mod benchmark;
pub mod frontier;
pub mod verify;
