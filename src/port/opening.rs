//! How a port comes to where the test begins: readings while it stands, and the zero that is taken of them.

use super::Port;
use crate::substructure::{Command, LinkFault};

/// Displacements whose relative difference is smaller are the same place.
pub(super) const SAME: f64 = 1e-9;

/// Whether a channel keeps its declared zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Zero {
    /// The declared offset holds; what is read is only told.
    #[default]
    Absolute,
    /// What is read while zeroing is the zero.
    Relative,
}

/// The two channels of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reference {
    /// Displacement sensor: with [`Zero::Relative`] the deformation is zero where the specimen stands.
    pub disp: Zero,
    /// Load cell.
    pub force: Zero,
}

/// Readings from which on their scatter says how noisy a sensor is.
const TELL_NOISE: u32 = 8;

/// What was read of one axis while zeroing, in its own units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reading {
    /// Number of readings.
    pub count: u32,
    /// Mean of the measured displacement.
    pub disp: f64,
    /// Mean of the measured force.
    pub force: f64,
    /// Root mean square of the displacement about its mean: the noise floor, as far as so many readings show it.
    pub disp_noise: f64,
    /// Of the force.
    pub force_noise: f64,
}

impl Reading {
    /// Noise of displacement and force; none where too few readings were taken to know it. That of a single one is no 0.
    #[must_use]
    pub fn noise(&self) -> Option<[f64; 2]> {
        (self.count >= TELL_NOISE).then_some([self.disp_noise, self.force_noise])
    }
}

/// How the readings of a displacement sensor belong to the commands of its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DispZero {
    /// Specimen displacement units per metre of the structure.
    pub gain: f64,
    /// Command at which the deformation is zero, in the specimen's unit.
    pub command: f64,
    /// Whether the sensor's zero is still to be read.
    pub is_awaited: bool,
}

/// Sums over the readings of one axis, about the first of them so that a large offset does not eat the noise.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    first: [f64; 2],
    sum: [f64; 2],
    squares: [f64; 2],
}

impl Sums {
    fn take(&mut self, values: [f64; 2]) {
        if self.count == 0.0 {
            self.first = values;
        }
        self.count += 1.0;
        let sums = self.sum.iter_mut().zip(&mut self.squares);
        for ((sum, squares), (value, first)) in sums.zip(values.iter().zip(&self.first)) {
            let value = value - first;
            *sum += value;
            *squares += value * value;
        }
    }

    fn reading(&self) -> Reading {
        let count = self.count.max(1.0);
        let mean = |i: usize| self.first[i] + self.sum[i] / count;
        let noise = |i: usize| {
            let mean = self.sum[i] / count;
            (self.squares[i] / count - mean * mean).max(0.0).sqrt()
        };
        Reading {
            count: self.count as u32,
            disp: mean(0),
            force: mean(1),
            disp_noise: noise(0),
            force_noise: noise(1),
        }
    }
}

/// What a port needs to begin.
#[derive(Debug)]
pub(super) struct Opening {
    references: Vec<Reference>,
    sums: Vec<Sums>,
    zero_is_taken: bool,
}

impl Opening {
    /// For `axes` axes whose offsets are declared.
    pub fn absolute(axes: usize) -> Self {
        Self {
            references: vec![Reference::default(); axes],
            sums: vec![Sums::default(); axes],
            zero_is_taken: false,
        }
    }

    /// True if the zero of an axis' displacement sensor is still to be taken. Real-time: yes.
    #[inline]
    pub fn awaits_zero(&self, axis: usize) -> bool {
        let reference = self.references.get(axis);
        !self.zero_is_taken && reference.is_some_and(|of| of.disp == Zero::Relative)
    }

    /// What was read of one axis.
    pub fn reading(&self, axis: usize) -> Reading {
        let sums = self.sums.get(axis);
        sums.map_or_else(Reading::default, Sums::reading)
    }
}

impl Port {
    /// Which channels take their zero from what is read, one entry per axis.
    #[must_use]
    pub fn with_references(mut self, references: Vec<Reference>) -> Self {
        if references.len() == self.axes.len() {
            self.opening.references = references;
        }
        self
    }

    /// The next command is the last one: nothing moves.
    pub fn stand_still(&mut self) {
        self.leave_pose();
        self.command.copy_from_slice(&self.sent);
        self.command_vel.fill(0.0);
    }

    /// Whatever moved when the test was interrupted stands by now: what it is told next is judged by that.
    pub fn has_come_to_rest(&mut self) {
        self.guard.watch.rests();
    }

    /// Sends the last command again, at rest, whatever command stands ready. Real-time: yes.
    ///
    /// # Errors
    /// The link is lost.
    pub fn repeat(&mut self, sequence: u64, time: f64) -> Result<(), LinkFault> {
        self.guard.sent_again(&self.sent);
        self.estimates.moves = false;
        self.link.sent += 1;
        self.compensation_asks(false);
        self.issued = Some(sequence + self.ahead);
        let outcome = self.substructure.issue(&Command {
            sequence: self.pursuit.number(sequence, self.ahead),
            time,
            dt: 0.0,
            disp: &self.sent,
            vel: &self.still,
        });
        self.unsent = outcome.is_err();
        self.owes |= !self.unsent;
        outcome
    }

    /// Keeps the measurement last taken for the zero, unless it is an old one.
    pub fn take_reading(&mut self) {
        if !self.is_fresh() {
            return;
        }
        let values = self.raw.disp.iter().zip(&self.raw.force);
        for (sums, (disp, force)) in self.opening.sums.iter_mut().zip(values) {
            sums.take([*disp, *force]);
        }
    }

    /// True if so many readings were kept.
    #[must_use]
    pub fn has_read(&self, times: u32) -> bool {
        let mut sums = self.opening.sums.iter();
        sums.all(|sums| sums.count >= f64::from(times))
    }

    /// Readings begin anew: those of an earlier opening are of another moment.
    pub fn forget_readings(&mut self) {
        self.opening.sums.fill(Sums::default());
    }

    /// What was read of one axis.
    #[must_use]
    pub fn reading(&self, axis: usize) -> Reading {
        self.opening.reading(axis)
    }

    /// Takes the zero of every relative channel from the readings.
    pub fn take_zero(&mut self) {
        let declared = self.opening.references.iter().zip(&self.opening.sums);
        for ((axis, sent), (reference, sums)) in self.axes.iter_mut().zip(&self.sent).zip(declared)
        {
            let reading = sums.reading();
            if reference.disp == Zero::Relative {
                // Commands count from the last one, measurements from where it took the specimen.
                axis.disp_offset = *sent;
                axis.measured_offset = reading.disp - *sent;
            }
            if reference.force == Zero::Relative {
                axis.force_offset = reading.force;
            }
        }
        self.opening.zero_is_taken = true;
        self.estimate_above_noise();
    }

    /// An axis reads what it reads now where it read `disp` before an interruption: a relative channel takes the difference
    /// for drift of its zero.
    pub fn take_disp_drift(&mut self, index: usize, disp: f64) {
        let reading = self.reading(index);
        if let Some(axis) = self.axes.get_mut(index)
            && let Some(Reference {
                disp: Zero::Relative,
                ..
            }) = self.opening.references.get(index)
        {
            axis.measured_offset += reading.disp - disp;
        }
    }

    /// The same of a load cell that read `force`.
    pub fn take_force_drift(&mut self, index: usize, force: f64) {
        let reading = self.reading(index);
        if self.has_relative_force(index)
            && let Some(axis) = self.axes.get_mut(index)
        {
            axis.force_offset += reading.force - force;
        }
    }

    /// True if the zero of an axis' displacement sensor was read, not declared.
    #[must_use]
    pub fn has_relative_disp(&self, index: usize) -> bool {
        let reference = self.opening.references.get(index);
        reference.is_some_and(|of| of.disp == Zero::Relative)
    }

    /// True if the zero of an axis' load cell was read, not declared.
    #[must_use]
    pub fn has_relative_force(&self, index: usize) -> bool {
        let reference = self.opening.references.get(index);
        reference.is_some_and(|of| of.force == Zero::Relative)
    }

    /// How the displacement sensor of each axis belongs to its commands, as it stands now.
    pub fn disp_zeros(&self) -> impl Iterator<Item = DispZero> {
        self.axes.iter().enumerate().map(|(index, axis)| DispZero {
            gain: axis.disp_gain,
            command: axis.disp_offset,
            is_awaited: self.opening.awaits_zero(index),
        })
    }

    /// True if it is neither behind a link nor a recording.
    #[must_use]
    pub fn is_formula(&self) -> bool {
        !self.is_recorded && !self.is_remote()
    }

    /// Where the specimen stands, in its own unit, one value per axis: it was moved there by others than this port.
    pub fn stands_at(&mut self, disp: &[f64]) {
        // A way out led it from where the test stood: what it is told next is judged from there.
        self.pursuit.led_away = self.sent != disp;
        for (sent, disp) in self.sent.iter_mut().zip(disp) {
            *sent = *disp;
        }
    }

    /// The specimen says where it stands, in its own unit, one value per axis. What is not one value per axis is nothing.
    pub fn says_it_stands_at(&mut self, disp: &[f64]) {
        self.standing = (disp.len() == self.axes.len()).then(|| disp.to_vec());
    }

    /// The test file says where a specimen stands that cannot tell, in m, one value per axis.
    pub fn is_said_to_stand_at(&mut self, disp: &[f64]) {
        let units = self.guard.units().iter().map(|(metres, _)| *metres);
        self.stated = Some(
            disp.iter()
                .zip(units)
                .map(|(disp, metres)| disp / metres)
                .collect(),
        );
    }

    /// It was commanded since: what the test file says of where it stood is over.
    pub(super) fn was_commanded_since(&mut self) {
        self.stated = None;
    }

    /// The specimen has said what it says of where it stands; for one that says nothing the test file may.
    pub(super) fn learns_where_it_stands(&mut self, said: &[f64]) {
        match self.stated.clone() {
            Some(stated) if said.is_empty() => self.says_it_stands_at(&stated),
            _ => self.says_it_stands_at(said),
        }
    }

    /// Where the specimen says that it stands before the test, in its own unit.
    #[must_use]
    pub fn standing(&self) -> Option<&[f64]> {
        self.standing.as_deref()
    }

    /// Where the specimen says that it stands is where the next command is, and what that is held against. Once a command
    /// has left it stands where that sent it, whatever it said before. Does nothing if it does not say.
    pub fn take_its_word(&mut self) {
        let has_begun = self.has_begun();
        let Some(standing) = &self.standing else {
            return;
        };
        if !has_begun {
            self.sent.copy_from_slice(standing);
            self.guard.stands_at(standing);
        }
        self.stand_still();
    }

    /// Newtons in one unit of force of an axis.
    #[must_use]
    pub fn newtons_of(&self, axis: usize) -> f64 {
        self.guard.units().get(axis).map_or(1.0, |unit| unit.1)
    }

    /// A force in N as the structure sees it, in the unit of the axis' load cell.
    #[must_use]
    pub fn in_own_unit(&self, axis: usize, newtons: f64) -> f64 {
        newtons
            / self
                .axes
                .get(axis)
                .map_or(1.0, |axis| axis.force_gain.abs())
    }

    /// Force of an axis that its displacement does not explain by the initial stiffness, and how far off that is where the stiffness is
    /// known to a `share` and the other axes are coupled with it. `measured`: displacement and force of each axis; all is in the
    /// specimen's own units.
    #[must_use]
    pub fn unexplained_force(&self, axis: usize, measured: &[[f64; 2]], share: f64) -> (f64, f64) {
        let disps = measured.iter().zip(&self.axes);
        let mut ways: Vec<f64> = disps
            .map(|([disp, _], axis)| disp - axis.measured_offset - axis.disp_offset)
            .collect();
        let (Some(own), Some(known), Some([_, force])) =
            (ways.get_mut(axis), self.axes.get(axis), measured.get(axis))
        else {
            return (0.0, 0.0);
        };
        let stiffness = self.stiffness.get(axis).copied().unwrap_or(0.0);
        let explained = stiffness / (known.force_gain * known.disp_gain) * *own;
        *own *= share;
        let slack = self.most_force_of(axis, &ways);
        (force - known.force_offset - explained, slack)
    }

    /// Initial stiffness of an axis at the specimen's own scale, N/m.
    #[must_use]
    pub fn stiffness_at_specimen(&self, axis: usize) -> f64 {
        let (Some(known), Some(stiffness)) = (self.axes.get(axis), self.stiffness.get(axis)) else {
            return 0.0;
        };
        let own = stiffness / (known.force_gain * known.disp_gain);
        (own * self.newtons_of(axis) / self.metres_of(axis)).abs()
    }

    /// Change of the force of an axis whose displacement changes by `way`, by its initial stiffness; both in the specimen's own units.
    #[must_use]
    pub fn elastic_force_of(&self, axis: usize, way: f64) -> f64 {
        let (Some(known), Some(stiffness)) = (self.axes.get(axis), self.stiffness.get(axis)) else {
            return 0.0;
        };
        stiffness / (known.force_gain * known.disp_gain) * way
    }

    /// The most that the force of an axis can change where the axes are displaced by `ways`, both in the specimen's own units and
    /// by its initial stiffness: |kᵢⱼ| is at most √(kᵢᵢ kⱼⱼ).
    #[must_use]
    pub fn most_force_of(&self, axis: usize, ways: &[f64]) -> f64 {
        let roots = self
            .stiffness
            .iter()
            .map(|stiffness| stiffness.abs().sqrt());
        let roots: Vec<f64> = roots.collect();
        let each = ways.iter().zip(&self.axes).zip(&roots);
        let all: f64 = each
            .map(|((way, axis), root)| root * (way / axis.disp_gain).abs())
            .sum();
        roots
            .get(axis)
            .map_or(0.0, |root| self.in_own_unit(axis, root * all))
    }

    /// Metres in one unit of an axis.
    #[must_use]
    pub fn metres_of(&self, axis: usize) -> f64 {
        self.guard.metres_of(axis)
    }
}
