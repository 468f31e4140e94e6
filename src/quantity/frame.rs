//! Frames of reference: where a displacement, a velocity, a force or a stiffness counts.
//!
//! One motion has other numbers in each frame. A value that goes from one part of the loop to another carries its frame in its
//! type, without cost. Only parts that know units, gains and geometry convert between frames: `Axis` between structure and axis, the
//! guard between axis and specimen, the loading unit between pose and strokes, `ClientScale` of a server between client and axis.
//! Arithmetic inside one part is with bare numbers of its frame.
//!
//! A bare number gets a frame only where it comes to be: in such a conversion, where a part hands out its own numbers, or at the outer
//! edge, which is an integrator, a codec, the test file or a recorded run. A value in a frame can be read as a bare number
//! everywhere. To give a number of one frame another frame is a conversion.

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
            /// A part of it, in the same frame.
            #[inline]
            pub fn part<P: ?Sized>(&self, part: impl FnOnce(&T) -> &P) -> $name<&P> {
                $name(part(&self.0))
            }
        }

        impl<'a, T: Copy> $name<&'a [T]> {
            /// One entry after the other, in the same frame.
            #[inline]
            pub fn each(self) -> impl Iterator<Item = $name<T>> + Clone + use<'a, T> {
                self.0.iter().map(|entry| $name(*entry))
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
