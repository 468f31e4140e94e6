//! How a port finds out which way round its specimen is wired, before the test.

use super::{Misfit, Pace, Port, Probe, Trend};
use crate::units::AxisUnits;

/// How it is found out.
#[derive(Debug, Clone, Default)]
pub enum Direction {
    /// It is known, or nobody wants to know.
    #[default]
    Known,
    /// Not at all, and the user is warned of that.
    Unchecked,
    /// By the motion that brings the static load on.
    Settling(Trend),
    /// By a small motion and back.
    Probe {
        /// Along each axis, in m of the structure.
        amplitude: Vec<f64>,
        /// How fast.
        pace: Pace,
    },
}

impl Port {
    /// The probe of this specimen, if there is to be one: from where it says that it stands, else from where it is aimed at.
    #[must_use]
    pub fn probe(&self) -> Option<Probe> {
        let Direction::Probe { amplitude, pace } = &self.direction else {
            return None;
        };
        let units = vec![AxisUnits::SI; self.axes.len()];
        let stiffness = &self.stiffness;
        let stands = self.standing().map(|standing| {
            let axes = standing.iter().zip(&self.axes);
            let deformed = axes.map(|(disp, axis)| axis.deformation(*disp));
            deformed.collect::<Vec<f64>>()
        });
        Some(Probe::new(
            stands.as_ref().unwrap_or(&self.target),
            amplitude,
            stiffness,
            &units,
            *pace,
        ))
    }

    /// Makes the next command of a probe, which goes on by `share` of an exchange; false if there is none. Real-time: yes.
    pub fn aim_probe(&mut self, probe: &mut Probe, share: f64) -> bool {
        let goes_on = probe.go_on(share, &mut self.target, &mut self.target_vel);
        self.command_the_target();
        goes_on
    }

    /// Gives a probe what was measured, unless it is old. Real-time: yes.
    pub fn take_probe(&self, probe: &mut Probe) {
        if self.is_fresh() {
            probe.take(&self.measured, &self.force);
        } else {
            probe.give_again();
        }
    }

    /// What was tried has moved if it is no computation: over OpenFresco's protocols a rig that heard of no step would take the
    /// way back for one that is taken back.
    pub fn accept_probe(&mut self, sequence: u64) {
        if self.is_remote() && !self.computed {
            // A link that is lost shows at the next command.
            let _ = self.substructure.accepted(self.pursuit.on_link(sequence));
        }
    }

    /// The exchange that was just made is none of the test's: the test's numbers go on as if it had not been. Real-time: yes.
    pub fn skip_number(&mut self) {
        self.ahead += u64::from(!self.is_recorded);
    }

    /// Command `sequence` of the test stands ready to leave, but what tripped it may have tripped in the exchange of that
    /// number: the specimen stands where it was sent then, and the next command is another one.
    pub fn leave_number(&mut self, sequence: u64) {
        let number = sequence + self.ahead;
        if self.issued == Some(number) {
            if !self.owes {
                // A link that is lost shows at the next command.
                let _ = self.substructure.accepted(self.pursuit.on_link(sequence));
            }
            self.skip_number();
        }
    }

    /// True if the motion that brings the static load on is to show the direction.
    #[must_use]
    pub const fn is_listened_to(&self) -> bool {
        matches!(self.direction, Direction::Settling(_))
    }

    /// A reading at rest, before the static load comes on; none if it is an old one. Real-time: yes.
    pub fn listen_at_rest(&mut self) {
        if !self.is_fresh() {
            return;
        }
        if let Direction::Settling(trend) = &mut self.direction {
            trend.rest(&self.target, &self.measured, &self.force);
        }
    }

    /// A reading at rest, while the static load comes on. Real-time: yes.
    ///
    /// # Errors
    /// A channel is reversed.
    pub fn listen(&mut self) -> Result<(), Misfit> {
        match &mut self.direction {
            Direction::Settling(trend) => trend.moved(&self.target, &self.measured, &self.force),
            _ => Ok(()),
        }
    }

    /// The axes (from 0) whose direction the static load did not show.
    #[must_use]
    pub fn unshown(&self) -> Vec<usize> {
        match &self.direction {
            Direction::Settling(trend) => trend.unshown().collect(),
            _ => Vec::new(),
        }
    }
}
