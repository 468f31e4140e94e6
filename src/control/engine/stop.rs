//! How a test ends, and why before its last step.

use thiserror::Error;

use super::test_hit::TestHit;
use super::test_limits::Worst;
use crate::port::limits::Hit;
use crate::port::{Port, WiringFault};
use gusset_actuator::geometry::Fault;
use gusset_numerics::integrate::StepError;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::units::{compared, compared_within, duration};

/// Why a test ended before its last step.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Stop {
    /// The operator asked for it.
    #[error("stopped by the operator")]
    Operator,
    /// Too many deadlines were missed.
    #[error("{total} deadlines missed, {in_a_row} of them in a row; the last one by {}", duration(*late_ns as f64 / 1e9))]
    Late {
        /// In all.
        total: u64,
        /// In a row.
        in_a_row: u64,
        /// Size of the last one.
        late_ns: u64,
    },
    /// A specimen's measurements stayed away too long.
    #[error("specimen {}: no fresh measurement for {ticks} ticks", port + 1)]
    Stale {
        /// Specimen, from 0.
        port: usize,
        /// Ticks in a row.
        ticks: u64,
    },
    /// The interlock or emergency stop at a specimen's end opened. Latched: the test does not go on when it closes.
    #[error("specimen {}: it reports a trip, or its interlock or emergency stop is open", port + 1)]
    Interlock {
        /// Specimen, from 0.
        port: usize,
    },
    /// A specimen is wired the wrong way round, or does not answer as it must. It is not armed for the test.
    #[error("specimen {} is not armed: {misfit}", port + 1)]
    Misfit {
        /// Specimen, from 0.
        port: usize,
        /// What is wrong with it.
        misfit: WiringFault,
    },
    /// A specimen says that a sensor or an actuator of its own is at the end of its range: its force is no measurement.
    #[error(
        "specimen {}: it reports a sensor or actuator at the end of its range, so its force cannot be trusted",
        port + 1
    )]
    Saturated {
        /// Specimen, from 0.
        port: usize,
    },
    /// A specimen goes on saying that its own watchdog holds it, although commands come.
    #[error(
        "specimen {}: it reported in {answers} answers in a row that its own watchdog holds it: commands do not move it",
        port + 1
    )]
    HoldsOn {
        /// Specimen, from 0.
        port: usize,
        /// Answers in a row.
        answers: u64,
    },
    /// A link failed.
    #[error("specimen {}: {fault}", port + 1)]
    Link {
        /// Specimen, from 0.
        port: usize,
        /// Why.
        fault: LinkFault,
    },
    /// The response grew beyond the divergence bound, or ceased to be a number.
    #[error(
        "the response diverged: the displacement of DOF {} is {}, and `safety.divergence_m` allows {}",
        dof + 1,
        compared(*value, *bound, "m")[0],
        compared(*value, *bound, "m")[1]
    )]
    Diverged {
        /// Degree of freedom, from 0.
        dof: usize,
        /// Its displacement in m.
        value: f64,
        /// The bound in m.
        bound: f64,
    },
    /// The next command is not a finite number; it was not sent.
    #[error("specimen {}: the next command is not a finite number; it was not sent", port + 1)]
    NotFinite {
        /// Specimen, from 0.
        port: usize,
    },
    /// A limit of a specimen tripped.
    #[error("specimen {}, {hit}", port + 1)]
    Limit {
        /// Specimen, from 0.
        port: usize,
        /// Which limit.
        hit: Hit,
    },
    /// A pose that the actuators of a specimen cannot take, or strokes without a pose.
    #[error("specimen {}: {fault}", port + 1)]
    Geometry {
        /// Specimen, from 0.
        port: usize,
        /// What is wrong, and at which pose.
        fault: Fault,
    },
    /// A limit of the test as a whole tripped.
    #[error("{0}")]
    TestLimit(TestHit),
    /// A specimen does not stand where an interrupted test left it. Nothing was moved.
    #[error(
        "specimen {}, axis {}: {} {} (unit of the axis)",
        port + 1,
        axis + 1,
        if *read { "it reads" } else { "it reports the position" },
        found_and_left(*found, *left, *within)
    )]
    Moved {
        /// Specimen, from 0.
        port: usize,
        /// Axis, from 0.
        axis: usize,
        /// Its sensor was read; otherwise it says where it stands.
        read: bool,
        /// What it reads, or says.
        found: f64,
        /// What it would read, or say, where it was left.
        left: f64,
        /// How far it may be off.
        within: f64,
    },
    /// A load cell reads another force than when the test was interrupted. Nothing was moved.
    #[error(
        "specimen {}, axis {}: its load cell reads {} (unit of the axis)",
        port + 1,
        axis + 1,
        found_and_expected(*found, *left, *within)
    )]
    ForceChanged {
        /// Specimen, from 0.
        port: usize,
        /// Axis, from 0.
        axis: usize,
        /// The reading.
        found: f64,
        /// The last reading of the interrupted test, moved elastically to where the axis is found.
        left: f64,
        /// How far it may differ.
        within: f64,
    },
    /// A fault of our own, caught at the boundary of the loop's thread.
    #[error("internal error")]
    Internal,
    /// The parts of the loop do not fit each other: it asked for one that does not exist. Nothing more is moved.
    #[error("internal error: the loop asked for {part} {}, which does not exist", index + 1)]
    NoSuchPart {
        /// Which list.
        part: &'static str,
        /// Place in it, from 0.
        index: usize,
    },
    /// A method that iterates found no equilibrium.
    #[error(transparent)]
    Step(StepError),
    /// The method needs the forces of the step that it is making, which no specimen can give in advance.
    #[error("the integration method cannot command a specimen; nothing was moved")]
    CannotCommand,
    /// The static load found no equilibrium.
    #[error(
        "the static load found no equilibrium in {exchanges} exchanges: the smallest remaining correction is {unbalance:.1e} of the \
         displacement{}",
        farthest(*port)
    )]
    NotSettled {
        /// Exchanges made.
        exchanges: u32,
        /// Smallest relative unbalance of the last part.
        unbalance: f64,
        /// Specimen, from 0, that the last correction sent farthest; none without specimens.
        port: Option<usize>,
    },
    /// A specimen came to rest again and again where the static load had not sent it.
    #[error(
        "specimen {}, axis {}: the static load commanded {}, and the axis reads {} (its unit); displacement and force did not follow \
         the last commands: the actuator is at its end or switched off, or the sensors are dead",
        port + 1,
        axis + 1,
        compared(*sent, *read, "")[0],
        compared(*sent, *read, "")[1]
    )]
    DoesNotFollow {
        /// Specimen, from 0.
        port: usize,
        /// Axis, from 0.
        axis: usize,
        /// Its last command.
        sent: f64,
        /// Where it reads that it stands.
        read: f64,
    },
    /// A specimen did not come to rest while the static load was brought on.
    #[error(
        "specimen {}: it did not come to rest within {seconds:.0} s at its position under the static load",
        port + 1
    )]
    NotAtRest {
        /// Specimen, from 0.
        port: usize,
        /// Time in s of wall time in which its command was the same.
        seconds: f64,
    },
}

/// One of the parts of the loop. Real-time: yes.
///
/// # Errors
/// [`Stop::NoSuchPart`]: the loop must not go on as if there were nothing to do.
#[inline]
pub(super) fn part_at<'a, T>(
    parts: &'a mut [T],
    index: usize,
    part: &'static str,
) -> Result<&'a mut T, Stop> {
    parts.get_mut(index).ok_or(Stop::NoSuchPart { part, index })
}

/// The specimen with this number, from 0. Real-time: yes.
///
/// # Errors
/// [`Stop::NoSuchPart`].
#[inline]
pub(super) fn port_at(ports: &mut [Port], index: usize) -> Result<&mut Port, Stop> {
    part_at(ports, index, "specimen")
}

impl Stop {
    /// Its row in the table of causes. Real-time: yes.
    #[must_use]
    pub(crate) const fn cause(&self) -> Cause {
        match self {
            Self::Operator => Cause::Operator,
            Self::Late { .. } => Cause::Late,
            Self::Stale { .. } => Cause::Stale,
            Self::Interlock { .. } => Cause::Interlock,
            Self::Misfit { .. } => Cause::Misfit,
            Self::Saturated { .. } => Cause::Saturated,
            Self::HoldsOn { .. } => Cause::HoldsOn,
            Self::Link { fault, .. } => fault.cause(),
            Self::Diverged { .. } | Self::Step(StepError::NotConverged { .. }) => Cause::Diverged,
            Self::NotFinite { .. } => Cause::NotFinite,
            Self::Geometry { .. } => Cause::Geometry,
            Self::TestLimit(hit) if hit.in_warm_up => Cause::NoGo,
            Self::Limit { .. } | Self::TestLimit(_) => Cause::Limit,
            Self::Moved { .. } => Cause::Moved,
            Self::ForceChanged { .. } => Cause::ForceChanged,
            Self::Internal | Self::NoSuchPart { .. } => Cause::Internal,
            Self::CannotCommand => Cause::CannotCommand,
            Self::NotSettled { .. } => Cause::NotSettled,
            Self::DoesNotFollow { .. } => Cause::DoesNotFollow,
            Self::NotAtRest { .. } => Cause::NotAtRest,
        }
    }

    /// As the files spell it, where it is the cause of a phase: of a limit the key of its row in the catalogue.
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Limit { hit, .. } => hit.quantity.key(),
            Self::TestLimit(hit) if !hit.in_warm_up => hit.quantity.key(),
            _ => self.cause().word(),
        }
    }

    /// The specimen, from 0, that it came from, if from one.
    #[must_use]
    pub const fn port(&self) -> Option<usize> {
        match self {
            Self::Stale { port, .. }
            | Self::Interlock { port }
            | Self::Misfit { port, .. }
            | Self::Saturated { port }
            | Self::HoldsOn { port, .. }
            | Self::Link { port, .. }
            | Self::NotFinite { port }
            | Self::Limit { port, .. }
            | Self::Geometry { port, .. }
            | Self::Moved { port, .. }
            | Self::ForceChanged { port, .. }
            | Self::DoesNotFollow { port, .. }
            | Self::NotAtRest { port, .. } => Some(*port),
            Self::NotSettled { port, .. } => *port,
            Self::Operator
            | Self::Late { .. }
            | Self::Diverged { .. }
            | Self::TestLimit(_)
            | Self::Internal
            | Self::NoSuchPart { .. }
            | Self::Step(_)
            | Self::CannotCommand => None,
        }
    }
}

impl Stop {
    /// Its sentence with the name of the specimen in place of its number.
    #[must_use]
    pub fn with_name(&self, name: impl FnOnce(usize) -> String) -> String {
        let text = self.to_string();
        let worst = match self {
            Self::TestLimit(hit) => hit.worst.and_then(Worst::axis).map(|(port, _)| port),
            _ => None,
        };
        match self.port().or(worst) {
            None => text,
            Some(port) => text.replacen(&format!("specimen {}", port + 1), &name(port), 1),
        }
    }
}

fn found_and_left(found: f64, left: f64, within: f64) -> String {
    let [found, left, within] = compared_within(found, left, within);
    format!("{found}, but the interrupted test left it at {left} ± {within}")
}

fn found_and_expected(found: f64, expected: f64, within: f64) -> String {
    let [found, expected, within] = compared_within(found, expected, within);
    format!("{found}, but {expected} ± {within} is expected at the present displacement")
}

fn farthest(port: Option<usize>) -> String {
    port.map_or_else(String::new, |port| {
        format!("; the last one moved specimen {} most", port + 1)
    })
}

/// How a test, or a phase of it, ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ending {
    /// At its last step; a phase, when its work was done.
    Completed,
    /// Before it.
    Stopped(Stop),
}

impl Ending {
    /// Its row in the table of causes. Real-time: yes.
    #[must_use]
    pub const fn cause(&self) -> Cause {
        match self {
            Self::Completed => Cause::Done,
            Self::Stopped(stop) => stop.cause(),
        }
    }

    /// As the files spell it: see [`Stop::word`].
    #[must_use]
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Completed => Cause::Done.word(),
            Self::Stopped(stop) => stop.word(),
        }
    }

    /// The specimen, from 0, that it came from, if from one.
    #[must_use]
    pub(crate) const fn port(&self) -> Option<usize> {
        match self {
            Self::Completed => None,
            Self::Stopped(stop) => stop.port(),
        }
    }

    /// True if missed deadlines ended it: no measurement shows that.
    #[must_use]
    pub const fn is_for_being_late(&self) -> bool {
        match self {
            Self::Stopped(Stop::Late { .. }) => true,
            Self::Stopped(Stop::TestLimit(hit)) => hit.quantity.is_of_misses(),
            _ => false,
        }
    }
}

impl From<Result<(), Stop>> for Ending {
    fn from(result: Result<(), Stop>) -> Self {
        match result {
            Ok(()) => Self::Completed,
            Err(stop) => Self::Stopped(stop),
        }
    }
}

impl std::fmt::Display for Ending {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Completed => f.write_str("end of the test"),
            Self::Stopped(stop) => stop.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refused_resumes_have_their_own_cause() {
        let moved = Stop::Moved {
            port: 0,
            axis: 0,
            read: true,
            found: 12.0301,
            left: 12.0,
            within: 0.03,
        };
        let text = moved.to_string();
        assert!(
            text.contains("12.0301") && text.contains(" 12 ± 0.03"),
            "{text}"
        );
        let changed = Stop::ForceChanged {
            port: 1,
            axis: 0,
            found: -63_464.4,
            left: -63_461.2,
            within: 2.0,
        };
        let text = changed.to_string();
        assert!(
            text.contains("-63464,") && text.contains("-63461 ± 2"),
            "{text}"
        );
    }
}
