//! The largest magnitudes of a recorded test, from its rows.
//!
//! A process that is killed leaves no summary, so the rows are the only source of its peaks. [`RowPeaks`] is the one place that
//! folds rows: a resume and the check of a run folder use it. Steps after the last one that counts are included, because they
//! loaded the specimens. Invariant: a stale measurement raises no peak.

use gusset_control::engine::{EarlierPeaks, Peaks};
use gusset_control::port::Port;
use gusset_quantity::catalog::column::{ACCEL, DISP, FORCE, Kind, STATUS, VEL};
use gusset_quantity::catalog::phase::Part;
use gusset_quantity::substructure::Status;
use gusset_record::summary::Peak;
use gusset_record::{FolderError, Run};

/// Largest magnitudes of a test and its ancestors, which reached `before`. They come from its summary, else from its rows
/// beginning with number `from`. The retraced loop knows the peaks before them.
pub(super) fn peak_of(
    run: &Run,
    from: u64,
    ports: &[Port],
    before: Option<&Peak>,
) -> Result<Peak, FolderError> {
    let summary = run.summary().map(|summary| &summary.peak);
    // A loop that broke down did not write them.
    let told = summary.filter(|peak| **peak != Peak::default());
    let mut peak = match told {
        Some(peak) => peak.clone(),
        None => of_rows(run, from, ports)?,
    };
    if let Some(before) = before {
        raise_all(&mut peak, before);
    }
    Ok(peak)
}

/// The earlier peaks for the loop of the resumed test, with these specimens.
pub(super) fn earlier_peaks(peak: &Peak, ports: &[Port]) -> EarlierPeaks {
    let numbers = |values: &Vec<Option<f64>>| {
        let values = values.iter().map(|value| value.unwrap_or(f64::NAN));
        values.collect::<Vec<f64>>()
    };
    let forces = ports.iter().map(|port| peak.force.get(port.name()));
    EarlierPeaks {
        peaks: Peaks {
            disp: numbers(&peak.displacement),
            vel: numbers(&peak.velocity),
            accel: numbers(&peak.acceleration),
        },
        forces: forces
            .map(|force| force.map(numbers).unwrap_or_default())
            .collect(),
    }
}

/// Those of the rows of the running test from the one with this number on.
fn of_rows(run: &Run, from: u64, ports: &[Port]) -> Result<Peak, FolderError> {
    let mut peaks = RowPeaks::of_test(run, ports.len());
    let mut journal = run.journal()?;
    let path = run.path().join("samples.bin");
    let unreadable = |source| FolderError::Io {
        path: path.clone(),
        source,
    };
    while let Some(row) = journal.next_row().map_err(unreadable)? {
        peaks.take(row.values, row.sequence >= from);
    }
    let names = ports.iter().map(|port| port.name().to_owned());
    Ok(peaks.finish(names))
}

/// Largest magnitudes of rows, as the loop counts them. Every reader of the peaks of a record folds its rows with this.
pub(super) struct RowPeaks {
    state: usize,
    /// Columns of displacements, velocities and accelerations: DOF from 0, and place.
    structure: [Vec<(usize, usize)>; 3],
    /// Of each specimen: place of its status, and places of the force of each axis.
    specimens: Vec<(usize, Vec<usize>)>,
    /// Rows beside the test and stale measurements count, too.
    every_row: bool,
    is_in_test: bool,
    peaks: [Vec<Option<f64>>; 3],
    forces: Vec<Vec<Option<f64>>>,
}

impl RowPeaks {
    /// Folds the rows of the test and the row that ended it. A stale measurement was not taken in its tick.
    pub(crate) fn of_test(run: &Run, specimens: usize) -> Self {
        let layout = run.layout();
        let at = |name: &str| layout.index_of(name).unwrap_or(usize::MAX);
        let forces = |number: usize| {
            let axes = (1..).map(|axis| layout.index_of(&FORCE.of_axis(number, axis)));
            axes.map_while(|place| place).collect()
        };
        let each = 1..=specimens;
        Self {
            state: at("state"),
            structure: [DISP, VEL, ACCEL].map(|kind| places(run, &kind)),
            specimens: each
                .map(|number| (at(&STATUS.of_specimen(number)), forces(number)))
                .collect(),
            every_row: false,
            is_in_test: false,
            peaks: Default::default(),
            forces: vec![Vec::new(); specimens],
        }
    }

    /// Of all rows, with stale measurements.
    pub(crate) fn of_every_row(run: &Run, specimens: usize) -> Self {
        Self {
            every_row: true,
            ..Self::of_test(run, specimens)
        }
    }

    /// Takes the next row; its magnitudes count only if `counts`.
    pub(crate) fn take(&mut self, row: &[f64], counts: bool) {
        let value = |place: usize| row.get(place).copied().unwrap_or(f64::NAN);
        let state = value(self.state);
        if !Part::Trip.has(state) {
            self.is_in_test = Part::Test.has(state);
        }
        if !counts || !(self.is_in_test || self.every_row) {
            return;
        }
        for (peaks, places) in self.peaks.iter_mut().zip(&self.structure) {
            for (dof, place) in places {
                raise(peaks, *dof, value(*place));
            }
        }
        for (peaks, (status, places)) in self.forces.iter_mut().zip(&self.specimens) {
            if !self.every_row && Status(value(*status) as u32).has(Status::STALE) {
                continue;
            }
            for (axis, place) in places.iter().enumerate() {
                raise(peaks, axis, value(*place));
            }
        }
    }

    /// The peaks, with the names of the specimens.
    pub(crate) fn finish(self, names: impl Iterator<Item = String>) -> Peak {
        let [displacement, velocity, acceleration] = self.peaks;
        Peak {
            displacement,
            velocity,
            acceleration,
            force: names.zip(self.forces).collect(),
            ..Peak::default()
        }
    }
}

/// Places of the columns of one kind, each with its number from 0.
fn places(run: &Run, kind: &Kind) -> Vec<(usize, usize)> {
    let columns = run.layout().columns().iter().enumerate();
    let each = columns.filter_map(|(place, column)| {
        let dof = kind.dof_in(&column.name)?;
        Some((dof as usize - 1, place))
    });
    each.collect()
}

pub(super) fn raise_all(peak: &mut Peak, others: &Peak) {
    let each = |peaks: &mut Vec<Option<f64>>, others: &[Option<f64>]| {
        for (index, other) in others.iter().enumerate() {
            raise(peaks, index, other.unwrap_or(f64::NAN));
        }
    };
    each(&mut peak.displacement, &others.displacement);
    each(&mut peak.velocity, &others.velocity);
    each(&mut peak.acceleration, &others.acceleration);
    for (name, others) in &others.force {
        each(peak.force.entry(name.clone()).or_default(), others);
    }
}

fn raise(peaks: &mut Vec<Option<f64>>, index: usize, value: f64) {
    if peaks.len() <= index {
        peaks.resize(index + 1, None);
    }
    let size = value.abs();
    if let Some(peak) = peaks.get_mut(index)
        && size.is_finite()
        && peak.is_none_or(|peak| size > peak)
    {
        *peak = Some(size);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peaks_are_read_back_exactly_and_raised() {
        let numbers = (1..4000).map(|k| Some(libm::sin(f64::from(k) * 1.37).abs() * 1e5));
        let mut peak = Peak {
            displacement: numbers.collect(),
            ..Peak::default()
        };
        let text = serde_json::to_string(&peak).unwrap();
        assert_eq!(serde_json::from_str::<Peak>(&text).unwrap(), peak);

        peak.displacement.truncate(1);
        let first = peak.displacement[0];
        let others = Peak {
            displacement: vec![Some(0.0), Some(2.0)],
            acceleration: vec![None],
            force: [("rig".to_owned(), vec![Some(3.0)])].into(),
            ..Peak::default()
        };
        raise_all(&mut peak, &others);
        assert_eq!(peak.displacement, [first, Some(2.0)]);
        assert_eq!(peak.acceleration, [None], "a massless DOF has none");
        assert_eq!(peak.force["rig"], [Some(3.0)]);
    }
}
