//! Plane and space frames: nodes, members, constraints and static loads become M, K and a load vector.
//!
//! Constraints are eliminated while the matrices are assembled, so that M_eff stays positive definite. Members are those of
//! Bernoulli and Euler; with P-Δ the axial force N of the static loads adds N/L at the displaced ends (linear geometry, small
//! rotations of the chord). No time step, no file: reading is the configuration's, integrating [`crate::integrate`]'s affair.
//! Begin with [`FrameSpec::model`].

mod build;
mod corotation;
mod error;
mod fibre;
mod inelastic;
mod member;
mod model;
mod parts;
mod section;
mod spec;
mod support;
mod symmetric;
mod utilisation;

pub use error::FrameError;
pub use fibre::{Concrete01Spec, Concrete02Spec, MaterialSpec, MenegottoPintoSpec, YoungSpec};
pub use inelastic::Members;
pub(crate) use inelastic::{At, Which};
pub use model::FrameModel;
pub use spec::{
    CircleSpec, ConstraintSpec, CorotationalSpec, Direction, ElasticSpec, EqualSpec, FibreSpec,
    FollowersSpec, FrameLinkSpec, FrameSpec, IShapeSpec, LinkDirection, MemberEnd, MemberKind,
    MemberSpec, NodeLoadSpec, NodeSpec, RcRectangleSpec, RectangleSpec, SectionSpec, TubeSpec,
};
pub use support::SupportError;
pub use utilisation::MemberUse;

#[cfg(test)]
mod tests;
