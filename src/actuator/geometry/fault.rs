//! Errors of a geometry, and the pose at which they occur.

use super::{Coordinate, MOST, Six};

/// Kinds of errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wrong {
    /// An actuator would be longer or shorter than its `length_m` allows.
    OutOfReach {
        /// Actuator, from 0.
        actuator: usize,
        /// Its stroke, m.
        stroke: f64,
        /// Farthest stroke on that side, m.
        bound: f64,
    },
    /// The two pins of an actuator are in one place: it has no direction.
    PinsMeet {
        /// Actuator, from 0.
        actuator: usize,
    },
    /// The platform can move although no actuator gets longer or shorter.
    Singular,
    /// No pose was found in which the actuators have the strokes that were measured; the pose named is the last that was
    /// tried.
    NotFound,
    /// Something is not a finite number.
    NotFinite,
}

impl Wrong {
    /// In one word, for the log.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Wrong::OutOfReach { .. } => "out_of_reach",
            Wrong::PinsMeet { .. } => "pins_meet",
            Wrong::Singular => "singular",
            Wrong::NotFound => "not_found",
            Wrong::NotFinite => "not_finite",
        }
    }

    /// The actuator, from 0, where it is one alone.
    #[must_use]
    pub const fn actuator(self) -> Option<usize> {
        match self {
            Wrong::OutOfReach { actuator, .. } | Wrong::PinsMeet { actuator } => Some(actuator),
            Wrong::Singular | Wrong::NotFound | Wrong::NotFinite => None,
        }
    }
}

/// An error and its pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// Kind of the error.
    pub wrong: Wrong,
    coordinates: [Option<Coordinate>; MOST],
    pose: Six,
}

impl Fault {
    pub(super) fn new(wrong: Wrong, coordinates: &[Coordinate], pose: &Six) -> Self {
        let mut named = [None; MOST];
        for (to, from) in named.iter_mut().zip(coordinates) {
            *to = Some(*from);
        }
        Self {
            wrong,
            coordinates: named,
            pose: *pose,
        }
    }
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let coordinates: Vec<_> = self.coordinates.iter().flatten().copied().collect();
        let pose = words(&coordinates, &self.pose);
        match self.wrong {
            Wrong::OutOfReach {
                actuator,
                stroke,
                bound,
            } => write!(
                f,
                "actuator {} would need a stroke of {stroke:.6} m, allowed {bound:.6} m, at the pose {pose}",
                actuator + 1
            ),
            Wrong::PinsMeet { actuator } => write!(
                f,
                "the two pins of actuator {} meet at the pose {pose}",
                actuator + 1
            ),
            Wrong::Singular => write!(
                f,
                "singular at the pose {pose}: there the platform can move without any actuator getting longer or shorter"
            ),
            Wrong::NotFound => write!(
                f,
                "no pose near {pose} gives the actuators the strokes that were measured"
            ),
            Wrong::NotFinite => write!(f, "not a finite number at the pose {pose}"),
        }
    }
}

/// "ux = 0.012 m, uy = 0 m".
pub(super) fn words(coordinates: &[Coordinate], pose: &Six) -> String {
    let each = coordinates.iter().zip(pose).map(|(coordinate, value)| {
        let text = format!("{value:.6}");
        let text = if value.is_finite() {
            text.trim_end_matches('0').trim_end_matches('.')
        } else {
            &text
        };
        let text = if text == "-0" { "0" } else { text };
        format!("{} = {text} {}", coordinate.key(), coordinate.unit())
    });
    each.collect::<Vec<_>>().join(", ")
}
