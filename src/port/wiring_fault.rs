//! Why a specimen must not be armed, in words and with what to do about it.

use crate::units::{in_axis_unit, signed_in_axis_unit};

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
}

impl WiringFault {
    /// Axis, from 0.
    #[must_use]
    pub const fn axis(&self) -> usize {
        match self {
            Self::Reversed { axis, .. } | Self::Dead { axis, .. } | Self::Noise { axis, .. } => {
                *axis
            }
        }
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
            Self::Dead { .. } => "displacement_dead",
            Self::Noise { .. } => "probe_below_noise",
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
                    "axis {axis}: noise of {} hides the change of {what}, {}, that shows its direction: a larger `probe_m` \
                     is needed, or less noise",
                    in_axis_unit(noise, unit),
                    in_axis_unit(expected, unit)
                )
            }
        }
    }
}
