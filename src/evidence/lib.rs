//! Proof that Gusset computes what it says, from published and independent values.
//!
//! [`verify`] recomputes the published values of the family of methods and compares them. [`benchmark`] is the virtual hybrid
//! simulation benchmark of the literature, computed without a file. [`frontier`] finds how large a structure may be at a rate.
//!
//! A value is never copied from the program under test: it comes from a paper, a closed form or another formulation. This member
//! knows the loop and the numerics, but no user's file, no link and no run folder. Begin reading with [`verify`].

pub mod benchmark;
pub mod frontier;
pub mod verify;
