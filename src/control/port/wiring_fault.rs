//! Why a specimen must not be armed, in words and with what to do about it.

use gusset_quantity::units::{in_axis_unit, number, signed_in_axis_unit};

/// A part of an axis's way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// From the command to the motion.
    Command,
    /// From the motion to its reading.
    Disp,
    /// From the force to its reading.
    Force,
}

/// Why a specimen must not be armed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WiringFault {
    /// A channel counts the other way.
    Reversed {
        /// Axis, from 0.
        axis: usize,
        /// Which.
        channel: Channel,
        /// Change of the measured displacement.
        disp: f64,
        /// Change of the measured force.
        force: f64,
        /// Units of the two.
        units: (&'static str, &'static str),
    },
    /// A reading that did not change as it must.
    Dead {
        /// Axis, from 0.
        axis: usize,
        /// Which: displacement or force.
        channel: Channel,
        /// Its change.
        found: f64,
        /// The change that was expected.
        expected: f64,
        /// Their unit.
        unit: &'static str,
    },
    /// The motion is too small to be told from noise.
    Noise {
        /// Axis, from 0.
        axis: usize,
        /// Which: displacement or force.
        channel: Channel,
        /// What may be noise.
        noise: f64,
        /// The change that was expected.
        expected: f64,
        /// Their unit.
        unit: &'static str,
    },
    /// The measured stiffness of an axis is not near the estimate.
    Stiffness {
        /// Axis, from 0.
        axis: usize,
        /// Measured stiffness.
        found: f64,
        /// The estimate.
        expected: f64,
        /// Units of force and displacement.
        units: (&'static str, &'static str),
    },
    /// The force of an axis beside the motion of another one does not agree with the estimate.
    Coupling {
        /// Axis of the force, from 0.
        axis: usize,
        /// Axis that moved, from 0.
        moved: usize,
        /// Measured stiffness.
        found: f64,
        /// The estimate.
        expected: f64,
        /// Units of force and displacement.
        units: (&'static str, &'static str),
        /// They have opposite signs.
        is_reversed: bool,
    },
    /// Noise hides the force of an axis beside the motion of another one.
    HiddenCoupling {
        /// Axis of the force, from 0.
        axis: usize,
        /// Axis that moved, from 0.
        moved: usize,
        /// Factor of the motion that would show it.
        times: f64,
    },
}

impl WiringFault {
    /// Axis, from 0.
    #[must_use]
    pub(crate) const fn axis(&self) -> usize {
        match self {
            Self::Reversed { axis, .. }
            | Self::Dead { axis, .. }
            | Self::Noise { axis, .. }
            | Self::Stiffness { axis, .. }
            | Self::Coupling { axis, .. }
            | Self::HiddenCoupling { axis, .. } => *axis,
        }
    }

    /// True if the user may accept it with `safety.accept_wiring`: the specimen may be another than the estimate, but its wiring is not
    /// shown to be wrong.
    #[must_use]
    pub(crate) const fn is_acceptable(&self) -> bool {
        matches!(
            self,
            Self::Stiffness { .. }
                | Self::Coupling {
                    is_reversed: false,
                    ..
                }
                | Self::HiddenCoupling { .. }
        )
    }

    /// As it stands in events.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Reversed {
                channel: Channel::Command,
                ..
            } => "command_reversed",
            Self::Reversed {
                channel: Channel::Disp,
                ..
            } => "displacement_reversed",
            Self::Reversed {
                channel: Channel::Force,
                ..
            } => "force_reversed",
            Self::Dead {
                channel: Channel::Force,
                ..
            } => "force_dead",
            Self::Dead {
                found, expected, ..
            } if found.abs() > expected.abs() => "displacement_too_large",
            Self::Dead { .. } => "displacement_dead",
            Self::Noise { .. } => "probe_below_noise",
            Self::Stiffness { .. } => "stiffness_differs",
            Self::Coupling {
                is_reversed: true, ..
            } => "coupling_reversed",
            Self::Coupling { .. } => "coupling_differs",
            Self::HiddenCoupling { .. } => "coupling_below_noise",
        }
    }
}

/// What makes another stiffness than the estimate.
const MISTAKES: &str = "exchanged connections, a forgotten `similitude` or `scale`, another unit, or a wrong \
                        `stiffness_n_per_m`";
/// The next step of a user whose specimen is in order.
const ACCEPT: &str =
    "If the specimen is in order, correct the estimate or give a reason in `safety.accept_wiring`";

/// The factor of a motion that noise would not hide, rounded up.
struct Larger(f64);

impl std::fmt::Display for Larger {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0.is_finite() {
            let times = (10.0 * self.0).ceil() / 10.0;
            write!(
                f,
                "a larger `probe_m` is needed, at least {times} times as large, or less noise"
            )
        } else {
            f.write_str("a larger `probe_m` is needed, or less noise")
        }
    }
}

impl std::fmt::Display for WiringFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::Reversed {
                axis,
                channel,
                disp,
                force,
                units: (metres, newtons),
            } => {
                let axis = axis + 1;
                write!(
                    f,
                    "axis {axis}: moved in the positive direction, it reads {} and {}: ",
                    signed_in_axis_unit(disp, metres),
                    signed_in_axis_unit(force, newtons)
                )?;
                f.write_str(match channel {
                    Channel::Force => {
                        "its force channel is reversed (turn the load cell's polarity round; a specimen that pushes \
                         back must read positive)"
                    }
                    Channel::Disp => {
                        "its displacement sensor is reversed (turn the sensor's polarity round)"
                    }
                    Channel::Command => {
                        "its actuator moves against the command (turn the polarity of the servo-valve or of the \
                         command round)"
                    }
                })
            }
            Self::Dead {
                axis,
                channel,
                found,
                expected,
                unit,
            } => {
                let axis = axis + 1;
                let (what, why) = match channel {
                    Channel::Force => (
                        "force",
                        "a dead load cell, a slack connection, another unit, or a wrong `stiffness_n_per_m`",
                    ),
                    Channel::Disp | Channel::Command if found.abs() > expected.abs() => (
                        "measured displacement",
                        "a wrong scale of the command or of the sensor, or another unit",
                    ),
                    Channel::Disp | Channel::Command => (
                        "measured displacement",
                        "a dead or frozen sensor, pumps off, a closed valve, or another unit",
                    ),
                };
                write!(
                    f,
                    "axis {axis}: the {what} changed by {} where {} was expected: {why}",
                    in_axis_unit(found, unit),
                    in_axis_unit(expected, unit)
                )
            }
            Self::Noise {
                axis,
                channel,
                noise,
                expected,
                unit,
            } => {
                let axis = axis + 1;
                let what = match channel {
                    Channel::Force => "force",
                    Channel::Disp | Channel::Command => "displacement",
                };
                write!(
                    f,
                    "axis {axis}: noise of {} hides the change of {what}, {}, that shows its direction: {}",
                    in_axis_unit(noise, unit),
                    in_axis_unit(expected, unit),
                    Larger(noise / expected.abs())
                )
            }
            Self::Stiffness {
                axis,
                found,
                expected,
                units: (force, disp),
            } => {
                let axis = axis + 1;
                write!(
                    f,
                    "axis {axis}: its measured stiffness is {} {force}/{disp}, and the estimate is {} \
                     {force}/{disp}: look for {MISTAKES}. {ACCEPT}",
                    number(found),
                    number(expected)
                )
            }
            Self::Coupling {
                axis,
                moved,
                found,
                expected,
                units: (force, disp),
                is_reversed,
            } => {
                let (axis, moved) = (axis + 1, moved + 1);
                write!(
                    f,
                    "axis {axis}: for each {disp} of axis {moved} its force changes by {} {force}, and the estimate says \
                     {} {force}: ",
                    number(found),
                    number(expected)
                )?;
                if is_reversed {
                    write!(
                        f,
                        "one of the two axes counts the other way (look at `sign`, at the loading unit and at the wiring), or \
                         the estimate has a wrong sign there"
                    )
                } else {
                    write!(f, "look for {MISTAKES}. {ACCEPT}")
                }
            }
            Self::HiddenCoupling { axis, moved, times } => {
                let (axis, moved) = (axis + 1, moved + 1);
                write!(
                    f,
                    "axis {axis}: noise hides its force beside the motion of axis {moved}: {}. {ACCEPT}",
                    Larger(times)
                )
            }
        }
    }
}
