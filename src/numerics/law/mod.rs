//! Uniaxial laws: one displacement and velocity in, one force out.
//!
//! The same objects serve as springs and dampers of the numerical side ([`crate::model`]) and as
//! specimens (`gusset_actuator::specimen`), so that a hybrid test and the monolithic run of the same structure
//! agree to roundoff. Pure mathematics: no clock, no input or output.
//!
//! A law keeps a committed state and a trial state. [`Law::trial`] always starts from the committed one,
//! however often it is called; [`Law::commit`] makes the last trial the committed one. A
//! rate-independent law is integrated along the straight path from the committed displacement to the
//! trial one, so that its result does not depend on an inner step.

mod bearing;
mod bouc_wen;
mod buckling_restrained;
mod contact;
mod damper;
mod domain;
mod elastic;
mod envelope;
mod extrapolate;
mod hysteretic;
mod imk;
mod maxwell;
mod memoryless;
mod parallel;
mod pinching4;
mod plastic;
mod pounding;
mod self_centring;
mod spec;

#[cfg(test)]
mod tests;

use thiserror::Error;

use gusset_quantity::domain::OutOfDomain;
use gusset_quantity::state::Stateful;

pub use bearing::{Bearing, BearingSpec, ElastomericSpec, FrictionPendulumSpec};
pub use bouc_wen::{BoucWen, BoucWenSpec, DegradationSpec, PinchingSpec};
pub use buckling_restrained::{BucklingRestrained, BucklingRestrainedSpec};
pub use contact::{Gap, GapSpec, Side};
pub use damper::{
    Biviscous, BiviscousSpec, PowerDamper, PowerDamperSpec, SmoothFriction, SmoothFrictionSpec,
};
pub use elastic::{Cubic, CubicSpec, Linear, LinearSpec, SquareRoot, SquareRootSpec};
pub use envelope::EnvelopePointSpec;
pub use hysteretic::{Hysteretic, HystereticSpec};
pub use imk::{HingeResponse, Imk, ImkSpec, NegativeHingeSpec};
pub use maxwell::MaxwellSpec;
pub use memoryless::Memoryless;
pub use parallel::Parallel;
pub use pinching4::{DamageType, PinchSpec, Pinching4, Pinching4Spec};
pub(crate) use plastic::SliderForm;
pub use plastic::{Bilinear, BilinearSpec};
pub use pounding::{Pounding, PoundingSpec};
pub use self_centring::{SelfCentring, SelfCentringSpec};
pub use spec::LawSpec;

/// Stiffness in N/m and damping in N s/m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tangent {
    /// ∂f/∂d.
    pub stiffness: f64,
    /// ∂f/∂v.
    pub damping: f64,
}

impl Tangent {
    /// That of a force without damping.
    #[inline]
    pub(crate) const fn elastic(stiffness: f64) -> Self {
        let damping = 0.0;
        Self { stiffness, damping }
    }
}

/// Declared reach of a law: largest displacement in m and velocity in m/s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reach {
    /// Largest |displacement| expected.
    pub disp: Option<f64>,
    /// Largest |velocity| expected.
    pub vel: Option<f64>,
}

/// A parameter outside its domain.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LawError {
    /// A number that must lie in a range does not.
    #[error(transparent)]
    Parameter(#[from] OutOfDomain),
    /// A law whose tangent at the origin is zero or infinite needs a reference value from the user.
    #[error("{name} must be given: the law has no finite, positive tangent at the origin")]
    ReferenceNeeded {
        /// The missing parameter.
        name: &'static str,
    },
    /// A law whose tangent has no bound needs one from the user.
    #[error(
        "`{law}.{name}` must be given: a law that degrades or pinches has no bound for its tangent"
    )]
    BoundNeeded {
        /// The law, as the configuration spells it.
        law: &'static str,
        /// The missing parameter.
        name: &'static str,
    },
    /// A member of a list (of `parallel` or of `laws`) is wrong.
    #[error("{list} entry {index}: {reason}")]
    Entry {
        /// Key of the list.
        list: &'static str,
        /// Position in the list, from 1.
        index: usize,
        /// The error.
        reason: Box<LawError>,
    },
    /// A list or a matrix does not have the size that the number of axes asks for.
    #[error("{name} has {found} {what}, but must have {wanted}")]
    Size {
        /// Name of the parameter, as the configuration spells it.
        name: &'static str,
        /// The counted items: "entries", "rows", "columns in a row".
        what: &'static str,
        /// The number counted.
        found: usize,
        /// The number expected.
        wanted: usize,
    },
    /// A matrix that must be symmetric is not. Row and column count from 1.
    #[error(
        "{name} is not symmetric: entry ({row}, {column}) is {found}, its mirror image {mirror}"
    )]
    Asymmetric {
        /// Name of the parameter, as the configuration spells it.
        name: &'static str,
        /// Row, from 1.
        row: usize,
        /// Column, from 1.
        column: usize,
        /// The entry there.
        found: f64,
        /// The entry at (column, row).
        mirror: f64,
    },
    /// A matrix that must not have a negative eigenvalue has one.
    #[error("{name} has the eigenvalue {eigenvalue}, but none may be negative")]
    Indefinite {
        /// Name of the parameter, as the configuration spells it.
        name: &'static str,
        /// The smallest eigenvalue.
        eigenvalue: f64,
    },
    /// Two keys that exclude each other are both given.
    #[error("{first} and {second} are both given, but only one of them may be")]
    Exclusive {
        /// One of them.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
}

impl LawError {
    /// The configuration key to point at.
    #[must_use]
    pub fn key(&self) -> &'static str {
        match self {
            Self::Parameter(OutOfDomain { name, .. })
            | Self::ReferenceNeeded { name }
            | Self::Size { name, .. }
            | Self::Asymmetric { name, .. }
            | Self::Indefinite { name, .. }
            | Self::Exclusive { second: name, .. } => name,
            // The missing key has no place in the file: name the law.
            Self::BoundNeeded { law, .. } => law,
            Self::Entry { reason, .. } => reason.key(),
        }
    }
}

/// A uniaxial force law with memory.
///
/// Every method is on the real-time path: no allocation, no panic, bounded time. Its state is the committed one: a restored law has
/// no trial, its last trial is the committed state.
pub trait Law: Stateful + Send + std::fmt::Debug {
    /// Force in N at displacement `disp` (m) and velocity `vel` (m/s), reached from the committed state along
    /// a straight path in `dt` seconds. `dt` = 0 is a repeated or first reading: rate effects other than those of
    /// `vel` do not progress.
    fn trial(&mut self, disp: f64, vel: f64, dt: f64) -> f64;

    /// The last trial becomes the committed state. A law without memory does nothing.
    fn commit(&mut self) {}

    /// A trial that is committed at once.
    fn step(&mut self, disp: f64, vel: f64, dt: f64) -> f64 {
        let force = self.trial(disp, vel, dt);
        self.commit();
        force
    }

    /// Forgets the last trial. A law without memory does nothing.
    fn revert(&mut self) {}

    /// Tangent at the last trial.
    fn tangent(&self) -> Tangent;

    /// Tangent for the solver of a client that commands the law (OpenFresco 13): that at the last trial, but a trial that
    /// repeats the committed displacement keeps the tangent of the motion that led there, as OpenSees' materials do.
    fn solver_tangent(&self) -> Tangent {
        self.tangent()
    }

    /// What enters K0 and C0: the tangent at the start, unless that is zero or infinite; then the contact
    /// stiffness of an open gap, the elastic slope before slip, or a value given by the user.
    fn reference(&self) -> Tangent;

    /// Part of the reference damping that acts around rest only: where the law moves fast, its tangent is small. 0 by default.
    fn rest_damping(&self) -> f64 {
        0.0
    }

    /// Damping at the last trial, or that of the reference where it is less: the resistance to small motions there.
    fn least_damping(&self) -> f64 {
        self.reference().damping.min(self.tangent().damping)
    }

    /// Upper bounds of both tangents within `reach`, for the proof of stability; `None` for a component that needs
    /// a declared reach and has none; +∞ where no reach makes it finite, so that no proof exists (a power damper
    /// with an exponent below 1 and no linear part).
    fn bound(&self, reach: Reach) -> (Option<f64>, Option<f64>);

    /// True if the force depends on the velocity, at whatever speed.
    fn resists_velocity(&self) -> bool {
        let reach = Reach {
            disp: Some(1.0),
            vel: Some(1.0),
        };
        self.bound(reach).1 != Some(0.0)
    }

    /// Steepest fall of the force beyond its largest value in N/m, as a positive number; 0 for a law that does not soften. By default 0.
    fn steepest_softening(&self) -> f64 {
        0.0
    }

    /// The law as plain numbers, if its force follows from the moment alone and takes no transcendental function:
    /// equal ones can then be evaluated side by side. `None` by default.
    fn memoryless(&self) -> Option<Memoryless> {
        None
    }

    /// The law itself, if it is bilinear: many of them can be evaluated side by side. `None` by default.
    fn bilinear(&mut self) -> Option<&mut Bilinear> {
        None
    }

    /// The law itself, if it is a Bouc–Wen law: equal ones can share their constants. `None` by default.
    fn bouc_wen(&mut self) -> Option<&mut BoucWen> {
        None
    }
}
