//! The course of a rehearsal, from its rows: errors of tracking and of response, kept as sums only.

use std::sync::{Arc, Mutex, PoisonError};

use gusset_control::engine::{Experiment, Phase};
use gusset_quantity::catalog::column;
use gusset_record::{Recorder, TimedEvent};

/// Most numbers of a reference that are kept; of a longer one every second, third, … row.
const MOST: usize = 4_000_000;
/// A DOF that moves less than this share of the one that moves most is not compared.
const MOVES: f64 = 1e-3;

/// Sums of a series about its first value.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    first: Option<f64>,
    count: f64,
    sum: f64,
    square: f64,
}

impl Sums {
    fn take(&mut self, value: f64) {
        let value = value - *self.first.get_or_insert(value);
        self.count += 1.0;
        self.sum += value;
        self.square += value * value;
    }

    /// Sample standard deviation.
    fn deviation(&self) -> f64 {
        let about_mean = self.square - self.sum * self.sum / self.count;
        (about_mean.max(0.0) / (self.count - 1.0)).sqrt()
    }
}

/// The reference of the response: every `stride`-th row of the running test, all DOFs side by side.
#[derive(Debug, Clone, Default)]
pub struct Reference {
    stride: usize,
    disp: Vec<f64>,
}

#[derive(Debug, Default)]
struct Sheet {
    /// Columns of the phase, of displacements, and of target and measured displacement of every axis.
    phase: usize,
    dofs: Vec<usize>,
    axes: Vec<(usize, usize)>,
    kept: Option<Reference>,
    compared: Option<Arc<Reference>>,
    rows: usize,
    /// Error and target of every axis; error and reference of every DOF.
    tracking: Vec<[Sums; 2]>,
    response: Vec<[Sums; 2]>,
}

/// A recorder that others can read when the test is over.
#[derive(Debug, Clone)]
pub struct Course(Arc<Mutex<Sheet>>);

/// Errors of a course.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Errors {
    /// Per specimen and axis, in order: of measured less target displacement over the target's standard deviation.
    pub tracking: Vec<f64>,
    /// The largest over the DOFs: of displacement less the reference's over the reference's; none without a reference.
    pub response: Option<f64>,
    /// DOF with this error, from 0.
    pub dof: usize,
}

impl Course {
    /// A course of `experiment` that is kept as a reference, or compared with one.
    #[must_use]
    pub(crate) fn of(
        experiment: &Experiment,
        reference: Option<Arc<Reference>>,
        keep: bool,
    ) -> Self {
        let columns = experiment.columns();
        let place = |name: &str| columns.iter().position(|column| column.name == name);
        let dofs: Vec<usize> = experiment
            .record_dofs
            .iter()
            .filter_map(|dof| place(&column::DISP.of_dof(dof + 1)))
            .collect();
        let mut axes = Vec::new();
        for (index, port) in experiment.ports.iter().enumerate() {
            for axis in 1..=port.axes() {
                let of = |kind: &column::Kind| place(&kind.of_axis(index + 1, axis));
                axes.extend(of(&column::TARGET).zip(of(&column::MEASURED)));
            }
        }
        let rows = usize::try_from(experiment.steps).unwrap_or(usize::MAX);
        let rows = rows.saturating_mul(experiment.pacing.ticks_per_step as usize);
        let stride = rows.saturating_mul(dofs.len()).div_ceil(MOST).max(1);
        let room = rows / stride + 1;
        let sheet = Sheet {
            phase: place(column::STATE.name()).unwrap_or(0),
            kept: keep.then(|| Reference {
                stride,
                disp: Vec::with_capacity(room.saturating_mul(dofs.len())),
            }),
            compared: reference,
            rows: 0,
            tracking: vec![Default::default(); axes.len()],
            response: vec![Default::default(); dofs.len()],
            dofs,
            axes,
        };
        Self(Arc::new(Mutex::new(sheet)))
    }

    /// The kept reference.
    #[must_use]
    pub(crate) fn kept(&self) -> Option<Reference> {
        let mut sheet = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        sheet.kept.take()
    }

    /// The errors. A part that did not move has an error of 0.
    #[must_use]
    pub fn errors(&self, dofs: &[usize]) -> Errors {
        let sheet = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let ratio = |[error, own]: &[Sums; 2]| {
            let own = own.deviation();
            // Also where nothing was counted.
            if own > 0.0 {
                error.deviation() / own
            } else {
                0.0
            }
        };
        let moves = |[_, own]: &[Sums; 2]| own.deviation();
        let most = sheet.response.iter().map(moves).fold(0.0, f64::max);
        let compared = sheet.response.iter().zip(dofs);
        let compared = compared.filter(|(sums, _)| moves(sums) > MOVES * most);
        let worst = compared
            .map(|(sums, dof)| (ratio(sums), *dof))
            .reduce(|a, b| if b.0 > a.0 { b } else { a });
        let has_reference = sheet.compared.is_some() && !sheet.dofs.is_empty();
        Errors {
            tracking: sheet.tracking.iter().map(ratio).collect(),
            response: worst.filter(|_| has_reference).map(|found| found.0),
            dof: worst.map_or(0, |found| found.1),
        }
    }
}

impl Recorder for Course {
    fn row(&mut self, row: &[f64]) -> bool {
        let Ok(mut sheet) = self.0.lock() else {
            return true;
        };
        let sheet = &mut *sheet;
        if row.get(sheet.phase) != Some(&Phase::Running.code()) {
            return true;
        }
        let at = |column: &usize| row.get(*column).copied().unwrap_or(f64::NAN);
        for ([error, own], (target, measured)) in sheet.tracking.iter_mut().zip(&sheet.axes) {
            let (target, measured) = (at(target), at(measured));
            error.take(measured - target);
            own.take(target);
        }
        let number = sheet.rows;
        sheet.rows += 1;
        if let Some(kept) = &mut sheet.kept
            && number.is_multiple_of(kept.stride)
        {
            kept.disp.extend(sheet.dofs.iter().map(at));
        }
        let Some(reference) = &sheet.compared else {
            return true;
        };
        let n = sheet.dofs.len();
        if number.is_multiple_of(reference.stride) {
            let start = number / reference.stride * n;
            let wanted = reference.disp.get(start..start + n).unwrap_or_default();
            let both = sheet.dofs.iter().zip(wanted);
            for ([error, own], (column, wanted)) in sheet.response.iter_mut().zip(both) {
                error.take(at(column) - wanted);
                own.take(*wanted);
            }
        }
        true
    }

    fn event(&mut self, _: TimedEvent) -> bool {
        true
    }
}
