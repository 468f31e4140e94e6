//! Frames of reference: where a displacement, a velocity, a force or a stiffness counts.
//!
//! The same motion has other numbers in each frame. A value that goes from one part of the loop to another carries its frame in its
//! type, without cost. The parts that know units, gains and geometry convert between frames; nothing else does.
//!
//! A command in the unit of an axis cannot be taken for a deformation in metres:
//!
//! ```compile_fail,E0308
//! use gusset_quantity::frame::{AtAxis, AtStructure};
//!
//! fn send(command: AtAxis<&[f64]>) {}
//!
//! let deformation = AtStructure(&[0.01][..]);
//! send(deformation);
//! ```

use std::ops::{Deref, DerefMut};

use crate::state::{Stateful, Visit};

/// Defines a frame with its meaning.
macro_rules! frame {
    ($(#[$meaning:meta])* $name:ident) => {
        $(#[$meaning])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        #[repr(transparent)]
        pub struct $name<T>(pub T);

        impl<T> $name<T> {
            /// The same value, borrowed.
            #[inline]
            pub const fn as_ref(&self) -> $name<&T> {
                $name(&self.0)
            }
        }

        impl<T> Deref for $name<T> {
            type Target = T;

            #[inline]
            fn deref(&self) -> &T {
                &self.0
            }
        }

        impl<T> DerefMut for $name<T> {
            #[inline]
            fn deref_mut(&mut self) -> &mut T {
                &mut self.0
            }
        }

        impl<T: Stateful> Stateful for $name<T> {
            #[inline]
            fn visit_state(&mut self, visit: &mut dyn Visit) {
                self.0.visit_state(visit);
            }
        }
    };
}

frame! {
    /// As the structure sees the specimen: metres and newtons at the structure's scale.
    AtStructure
}
frame! {
    /// In the unit of an axis, which a command has and a sensor reads.
    AtAxis
}
frame! {
    /// Metres and newtons at the specimen's own scale: the frame of its limits.
    AtSpecimen
}
frame! {
    /// As a client counts.
    AtClient
}
frame! {
    /// Coordinates of a platform: metres and radians, newtons and newton metres.
    AtPose
}
