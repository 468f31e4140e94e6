//! The order of the signals of a vector.
//!
//! Everything but `SimSimulink` arranges signals by quantity: all displacements, then all velocities. `SimSimulink` arranges
//! them in the order of OpenFresco's control points, which no message announces. So where several axes have several
//! quantities, the order must be known from elsewhere.

use super::sizes::Counts;
use crate::wire::WireError;

/// The order of the signals of a vector. The time stands last in both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SignalOrder {
    /// d1 v1 d2 v2: the displacement, velocity, acceleration and force of an axis, then those of the next axis.
    ByAxis,
    /// d1 d2 v1 v2: the displacements of all axes, then the velocities, accelerations and forces.
    ByQuantity,
}

impl SignalOrder {
    /// The order that `counts` are sent in. Layouts with one axis or one quantity have only one.
    ///
    /// # Errors
    /// [`WireError::SignalOrder`] if there are several and none was given.
    pub fn of(given: Option<Self>, counts: &Counts) -> Result<Self, WireError> {
        let [.., time] = counts.in_order();
        let kinds = [counts.disp, counts.vel, counts.accel, counts.force];
        let axes = kinds.into_iter().max().unwrap_or(0);
        let quantities = kinds.iter().filter(|count| **count > 0).count();
        if axes <= 1 || quantities <= 1 {
            return Ok(Self::ByQuantity);
        }
        given.ok_or(WireError::SignalOrder {
            axes,
            quantities: quantities + time,
        })
    }

    /// Where each signal stands on the wire, counted from the first one; the signals are taken by quantity.
    pub(super) fn places(self, counts: &Counts) -> Vec<usize> {
        let kinds = [counts.disp, counts.vel, counts.accel, counts.force];
        let present = kinds.iter().filter(|count| **count > 0).count();
        let mut places = Vec::with_capacity(counts.total());
        let kinds = kinds.into_iter().filter(|count| *count > 0).enumerate();
        for (kind, count) in kinds {
            for axis in 0..count {
                places.push(match self {
                    Self::ByQuantity => places.len(),
                    Self::ByAxis => axis * present + kind,
                });
            }
        }
        places.extend(counts.before_time()..counts.total());
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_asked_for_only_where_several_axes_have_several_quantities() {
        for (counts, is_asked) in [
            (Counts::new(1, 1, 1, 1, 1), false),
            (Counts::new(2, 0, 0, 0, 0), false),
            (Counts::new(2, 0, 0, 0, 1), false),
            (Counts::new(0, 0, 0, 3, 1), false),
            (Counts::new(2, 2, 0, 0, 0), true),
            (Counts::new(2, 0, 0, 2, 1), true),
        ] {
            assert_eq!(SignalOrder::of(None, &counts).is_err(), is_asked);
            for given in [SignalOrder::ByAxis, SignalOrder::ByQuantity] {
                let found = SignalOrder::of(Some(given), &counts).unwrap();
                assert!(found == given || !is_asked);
            }
        }
    }

    #[test]
    fn the_places_are_those_of_the_named_order() {
        let counts = Counts::new(2, 2, 0, 2, 1);
        // d1 d2 v1 v2 f1 f2 t stand as d1 v1 f1 d2 v2 f2 t.
        assert_eq!(SignalOrder::ByAxis.places(&counts), [0, 3, 1, 4, 2, 5, 6]);
        assert_eq!(
            SignalOrder::ByQuantity.places(&counts),
            [0, 1, 2, 3, 4, 5, 6]
        );
    }
}
