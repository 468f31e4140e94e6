//! Startup: what is known of a specimen before the test, its position, readings at rest, the zero, and how its wiring is checked.
//!
//! Invariant: the zero of a relative channel is taken once, from readings of this startup. A position that the specimen reports
//! counts more than the one that the test file states. Limits: all values are in the specimen's own units.

use super::axis::Axis;
use super::sensor_zero::{DispZero, Reading, ReadingSums, Reference, Zero};
use super::wiring_check::WiringCheck;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::state;
use gusset_quantity::substructure::Measurement;

/// Displacements whose relative difference is smaller are the same place.
pub(super) const SAME: f64 = 1e-9;

/// What needs the measured displacement of a specimen: places in the test file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct NeedsMeasuredDisp {
    /// Keys of the specimen.
    pub own: Vec<String>,
    /// Keys of the test, which judge all of its specimens together.
    pub of_the_test: Vec<String>,
}

/// The startup of one specimen.
#[derive(Debug)]
pub struct Startup {
    references: Vec<Reference>,
    sums: Vec<ReadingSums>,
    zero_is_taken: bool,
    /// Where the specimen reports that it stands.
    standing: Option<AtAxis<Vec<f64>>>,
    /// Where the test file says that a specimen stands which does not report it.
    stated: Option<AtAxis<Vec<f64>>>,
    wiring: WiringCheck,
    /// The test file says that a computation answers, and no machine.
    is_computed: bool,
    needs_measured_disp: NeedsMeasuredDisp,
}

// Where the specimen stands is known when it is connected.
state! {
    Startup as "startup" { sums, zero_is_taken }
    keeps { references, standing, stated, wiring, is_computed, needs_measured_disp }
}

impl Startup {
    /// One reference for each axis.
    pub(crate) fn new(
        references: Vec<Reference>,
        wiring: WiringCheck,
        is_computed: bool,
        needs_measured_disp: NeedsMeasuredDisp,
    ) -> Self {
        Self {
            sums: vec![ReadingSums::default(); references.len()],
            references,
            zero_is_taken: false,
            standing: None,
            stated: None,
            wiring,
            is_computed,
            needs_measured_disp,
        }
    }

    /// How the wiring is checked.
    #[must_use]
    pub const fn wiring(&self) -> &WiringCheck {
        &self.wiring
    }

    /// Where to say how the wiring is checked.
    pub const fn wiring_mut(&mut self) -> &mut WiringCheck {
        &mut self.wiring
    }

    /// True if the test file says that a computation answers, and no machine.
    #[must_use]
    pub const fn is_computed(&self) -> bool {
        self.is_computed
    }

    /// Whether the test file says that a computation answers, and no machine.
    pub const fn set_computed(&mut self, computed: bool) {
        self.is_computed = computed;
    }

    /// What needs the measured displacement.
    #[must_use]
    pub const fn needs_measured_disp(&self) -> &NeedsMeasuredDisp {
        &self.needs_measured_disp
    }

    /// Where to say what needs the measured displacement.
    pub const fn needs_measured_disp_mut(&mut self) -> &mut NeedsMeasuredDisp {
        &mut self.needs_measured_disp
    }

    /// True if the zero of an axis' displacement sensor is still to be taken. Real-time: yes.
    #[inline]
    pub(crate) fn awaits_zero(&self, axis: usize) -> bool {
        !self.zero_is_taken && self.has_relative_disp(axis)
    }

    /// True if the zero of an axis' displacement sensor is read, not declared. Real-time: yes.
    #[inline]
    pub(crate) fn has_relative_disp(&self, axis: usize) -> bool {
        let reference = self.references.get(axis);
        reference.is_some_and(|of| of.disp == Zero::Relative)
    }

    /// True if the zero of an axis' load cell is read, not declared.
    pub(crate) fn has_relative_force(&self, axis: usize) -> bool {
        let reference = self.references.get(axis);
        reference.is_some_and(|of| of.force == Zero::Relative)
    }

    /// Keeps a fresh measurement for the zero.
    pub(crate) fn take_reading(&mut self, raw: &Measurement) {
        let values = raw.disp.iter().zip(&raw.force);
        for (sums, (disp, force)) in self.sums.iter_mut().zip(values) {
            sums.take([*disp, *force]);
        }
    }

    /// True if this many readings were kept.
    pub(crate) fn has_read(&self, times: u32) -> bool {
        let mut sums = self.sums.iter();
        sums.all(|sums| sums.count() >= f64::from(times))
    }

    /// Drops the readings.
    pub(crate) fn forget_readings(&mut self) {
        self.sums.fill(ReadingSums::default());
    }

    /// Readings of one axis.
    #[must_use]
    pub fn reading(&self, axis: usize) -> Reading {
        let sums = self.sums.get(axis);
        sums.map_or_else(Reading::default, ReadingSums::reading)
    }

    /// Puts the zero of every relative channel into `axes`: commands count from `sent`, measurements from where it took the
    /// specimen.
    pub(crate) fn take_zero(&mut self, axes: &mut [Axis], sent: AtAxis<&[f64]>) {
        let declared = self.references.iter().zip(&self.sums);
        for ((axis, sent), (reference, sums)) in axes.iter_mut().zip(*sent).zip(declared) {
            let reading = sums.reading();
            if reference.disp == Zero::Relative {
                axis.disp_offset = *sent;
                axis.measured_offset = reading.disp - *sent;
            }
            if reference.force == Zero::Relative {
                axis.force_offset = reading.force;
            }
        }
        self.zero_is_taken = true;
    }

    /// An axis reads what it reads now where it read `disp` before an interruption: a relative channel takes the difference for
    /// drift of its zero.
    pub(crate) fn take_disp_drift(&self, index: usize, disp: f64, axis: &mut Axis) {
        if self.has_relative_disp(index) {
            axis.measured_offset += self.reading(index).disp - disp;
        }
    }

    /// A relative load cell takes its difference from `force` for drift.
    pub(crate) fn take_force_drift(&self, index: usize, force: f64, axis: &mut Axis) {
        if self.has_relative_force(index) {
            axis.force_offset += self.reading(index).force - force;
        }
    }

    /// How the displacement sensor of each axis belongs to its commands now.
    pub fn disp_zeros<'a>(&'a self, axes: &'a [Axis]) -> impl Iterator<Item = DispZero> + 'a {
        axes.iter().enumerate().map(|(index, axis)| DispZero {
            gain: axis.disp_gain,
            command: axis.disp_offset,
            is_awaited: self.awaits_zero(index),
        })
    }

    /// Position that the specimen reports, or else the one that the test file states.
    #[must_use]
    pub fn standing(&self) -> Option<AtAxis<&[f64]>> {
        self.standing
            .as_ref()
            .map(|standing| standing.part(Vec::as_slice))
    }

    /// The specimen reports this position; another number of values than axes clears it.
    pub fn report_position(&mut self, disp: AtAxis<&[f64]>) {
        self.standing = (disp.len() == self.references.len()).then(|| AtAxis(disp.to_vec()));
    }

    /// The specimen has reported this; where it reports nothing the stated position counts.
    pub(crate) fn learn_position(&mut self, reported: AtAxis<&[f64]>) {
        match self.stated.clone() {
            Some(stated) if reported.is_empty() => self.report_position(stated.part(Vec::as_slice)),
            _ => self.report_position(reported),
        }
    }

    /// Where the test file says that the specimen stands.
    pub(crate) fn stated(&self) -> Option<AtAxis<&[f64]>> {
        self.stated
            .as_ref()
            .map(|stated| stated.part(Vec::as_slice))
    }

    pub(crate) fn state_position(&mut self, disp: AtAxis<Vec<f64>>) {
        self.stated = Some(disp);
    }

    /// The specimen was commanded since: the stated position is of another time.
    pub(crate) fn forget_stated(&mut self) {
        self.stated = None;
    }
}
