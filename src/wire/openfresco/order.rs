//! The order of the signals of a vector.
//!
//! Everything but `SimSimulink` arranges signals by quantity: all displacements, then all velocities. `SimSimulink` arranges
//! them in the order of OpenFresco's control points, which no message announces. So where several axes have several
//! quantities, the order must be known from elsewhere. The time is one of the quantities: any control point may hold it.

use super::sizes::Counts;
use crate::WireError;

/// The order of the signals of a vector.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SignalOrder {
    /// d1 v1 d2 v2: the displacement, velocity, acceleration and force of an axis, then those of the next axis. There is no time:
    /// nothing says which control point holds it.
    ByAxis,
    /// d1 d2 v1 v2: the displacements of all axes, then the velocities, accelerations and forces. The time is last.
    ByQuantity,
}

impl SignalOrder {
    /// The order that `counts` are sent in. Layouts with one axis or one quantity have only one.
    ///
    /// # Errors
    /// [`WireError::SignalOrder`] if there are several and none was given, [`WireError::TimePlace`] if the place of the time is
    /// unknown.
    pub(crate) fn of(given: Option<Self>, counts: &Counts) -> Result<Self, WireError> {
        let [kinds @ .., _] = counts.in_order();
        let axes = kinds.into_iter().max().unwrap_or(0);
        let present = counts.in_order().into_iter().filter(|count| *count > 0);
        let quantities = present.count();
        if axes <= 1 || quantities <= 1 {
            return Ok(Self::ByQuantity);
        }
        match given {
            None => Err(WireError::SignalOrder { axes, quantities }),
            Some(Self::ByAxis) if counts.time > 0 => Err(WireError::TimePlace { axes }),
            Some(order) => Ok(order),
        }
    }

    /// Place of each signal on the wire, counted from the first one; the signals are taken by quantity.
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
    fn order_matters_only_for_several_signals() {
        for (counts, is_asked) in [
            (Counts::new(1, 1, 1, 1, 1), false),
            (Counts::new(2, 0, 0, 0, 0), false),
            (Counts::new(0, 0, 0, 3, 0), false),
            (Counts::new(0, 0, 0, 0, 1), false),
            (Counts::new(2, 2, 0, 0, 0), true),
            (Counts::new(0, 0, 2, 2, 0), true),
        ] {
            assert_eq!(SignalOrder::of(None, &counts).is_err(), is_asked);
            for given in [SignalOrder::ByAxis, SignalOrder::ByQuantity] {
                let found = SignalOrder::of(Some(given), &counts).unwrap();
                assert!(found == given || !is_asked);
            }
        }
    }

    #[test]
    fn only_order_by_quantity_places_the_time() {
        for (counts, quantities) in [
            (Counts::new(2, 0, 0, 0, 1), 2),
            (Counts::new(0, 0, 0, 2, 1), 2),
            (Counts::new(2, 2, 0, 2, 1), 4),
        ] {
            let none = WireError::SignalOrder {
                axes: 2,
                quantities,
            };
            assert_eq!(SignalOrder::of(None, &counts), Err(none));
            let by_axis = SignalOrder::of(Some(SignalOrder::ByAxis), &counts);
            assert_eq!(by_axis, Err(WireError::TimePlace { axes: 2 }));
            let order = SignalOrder::of(Some(SignalOrder::ByQuantity), &counts).unwrap();
            assert_eq!(order.places(&counts).last(), Some(&counts.before_time()));
        }
    }

    #[test]
    fn places_follow_the_named_order() {
        let timeless = Counts::new(2, 2, 0, 2, 0);
        // d1 d2 v1 v2 f1 f2 become d1 v1 f1 d2 v2 f2.
        assert_eq!(SignalOrder::ByAxis.places(&timeless), [0, 3, 1, 4, 2, 5]);
        let counts = Counts::new(2, 2, 0, 2, 1);
        assert_eq!(
            SignalOrder::ByQuantity.places(&counts),
            [0, 1, 2, 3, 4, 5, 6]
        );
    }
}
