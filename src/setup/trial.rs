//! One rehearsal among many: its draws.

use super::Estimate;

/// Draws of a rehearsal.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trial {
    /// One per specimen; missing ones are nominal.
    pub specimens: Vec<Drawn>,
    /// The controller's estimate of each specimen, whatever the drawn file contains; empty: the estimates of the file.
    pub believed: Vec<Estimate>,
    /// The masses whose inertia is inside measured forces are counted in M instead: for ideal actuators, which have none.
    pub ideal: bool,
    /// Specimens behind links move at the velocities of the test, whatever `time.scale` is.
    pub at_test_speed: bool,
}

/// Draws for one specimen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// Its stiffness over that of its law.
    pub stiffness: f64,
    /// Further delay of its actuator in s; in all never less than none.
    pub delay_s: f64,
    /// Gain of its actuator over the declared one.
    pub gain: f64,
    /// Seed of its noise; none: as in the file.
    pub seed: Option<u64>,
}

impl Default for Drawn {
    fn default() -> Self {
        Self {
            stiffness: 1.0,
            delay_s: 0.0,
            gain: 1.0,
            seed: None,
        }
    }
}

/// Nothing is drawn.
pub(super) static NOMINAL: Trial = Trial {
    specimens: Vec::new(),
    believed: Vec::new(),
    ideal: false,
    at_test_speed: false,
};
