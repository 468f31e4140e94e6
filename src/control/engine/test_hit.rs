//! A limit of the test as a whole that was reached, and its sentence.

use super::test_limits::Worst;
use gusset_quantity::catalog::limit::{Judges, Limit};
use gusset_quantity::units::compared;

/// One limit of the test that was reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TestHit {
    /// The limit.
    pub quantity: Limit,
    /// Value that the limit judged.
    pub value: f64,
    /// Level of the limit.
    pub bound: f64,
    /// The largest contributor, where it is known.
    pub worst: Option<Worst>,
    /// It was found in the warm-up, and the test was not begun.
    pub in_warm_up: bool,
}

impl std::fmt::Display for TestHit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            quantity,
            value,
            bound,
            worst,
            in_warm_up,
        } = self;
        let (words, key) = (quantity.words(), quantity.key());
        match quantity {
            Limit::MissesInARow if *in_warm_up => write!(
                f,
                "not ready: the warm-up ends with {value} {words}, allowed {bound} ({key}); the test was not begun"
            ),
            Limit::MissesInWindow | Limit::Misses if *in_warm_up => write!(
                f,
                "not ready: the warm-up lets expect {value} {words}, allowed {bound} ({key}); the test was not begun"
            ),
            limit if limit.row().judges == Judges::Step => {
                let [value, bound] = compared(*value, *bound, limit.unit());
                write!(f, "{words}: {value}, allowed {bound} ({key})")?;
                match worst {
                    None => Ok(()),
                    Some(Worst::Axis(port, axis)) => {
                        let (port, axis) = (port + 1, axis + 1);
                        write!(f, ", most of it of specimen {port}, axis {axis}")
                    }
                    Some(Worst::Dof(dof)) => write!(f, ", most of it at DOF {}", dof + 1),
                    Some(Worst::Member(number)) => write!(f, ", most of it along member {number}"),
                }
            }
            _ => write!(f, "{words}: {value}, allowed {bound} ({key})"),
        }
    }
}
