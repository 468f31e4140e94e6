//! What an interrupted test has come to, also after the last step that counts: the state goes back to that step, what the
//! specimens have borne does not.

use super::tape::{is_a_trip, is_under_way};
use crate::control::Port;
use crate::engine::{Borne, Peaks};
use crate::record::summary::Peak;
use crate::record::{FolderError, Run};
use crate::substructure::Status;

/// Largest magnitudes of a test and of those that it went on with, which came to `before`: as its summary has them, of a test
/// without one those of its rows from the one with this number on. What is before them the retraced loop knows.
pub(super) fn peak_of(
    run: &Run,
    from: u64,
    ports: &[Port],
    before: Option<&Peak>,
) -> Result<Peak, FolderError> {
    let summary = run.summary().map(|summary| &summary.peak);
    // A loop that broke down said nothing of them.
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

/// For the loop of the test that goes on, with these specimens.
pub(super) fn borne(peak: &Peak, ports: &[Port]) -> Borne {
    let numbers = |values: &Vec<Option<f64>>| {
        let values = values.iter().map(|value| value.unwrap_or(f64::NAN));
        values.collect::<Vec<f64>>()
    };
    let forces = ports.iter().map(|port| peak.force.get(&port.name));
    Borne {
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

/// Places of the columns of one kind, each with its number from 0.
pub(super) fn places(run: &Run, letter: char) -> Vec<(usize, usize)> {
    let columns = run.layout().columns().iter().enumerate();
    let each = columns.filter_map(|(place, column)| {
        let number = column.name.strip_prefix(letter)?.parse::<usize>().ok()?;
        Some((number.checked_sub(1)?, place))
    });
    each.collect()
}

/// Those of the rows of the running test, that which ended it among them, as the loop counts them.
fn of_rows(run: &Run, from: u64, ports: &[Port]) -> Result<Peak, FolderError> {
    let at = |name: String| run.layout().index_of(&name).unwrap_or(usize::MAX);
    let state = at("state".to_owned());
    let structure = ['x', 'v', 'a'].map(|letter| places(run, letter));
    let specimen = |(port, behind): (usize, &Port)| {
        let number = port + 1;
        let force = |axis: usize| at(format!("force_{number}_{}", axis + 1));
        let forces: Vec<usize> = (0..behind.axes()).map(force).collect();
        (at(format!("status_{number}")), forces)
    };
    let specimens: Vec<_> = ports.iter().enumerate().map(specimen).collect();
    let (mut peaks, mut forces) = (<[Vec<Option<f64>>; 3]>::default(), Vec::new());
    forces.resize(ports.len(), Vec::new());
    let mut is_in_test = false;
    let mut journal = run.journal()?;
    let path = run.path().join("samples.bin");
    let unreadable = |source| FolderError::Io {
        path: path.clone(),
        source,
    };
    while let Some(row) = journal.next_row().map_err(unreadable)? {
        let value = |place: usize| row.values.get(place).copied().unwrap_or(f64::NAN);
        let state = value(state);
        if !is_a_trip(state) {
            is_in_test = is_under_way(state);
        }
        if !is_in_test || row.sequence < from {
            continue;
        }
        for (peaks, places) in peaks.iter_mut().zip(&structure) {
            for (dof, place) in places {
                raise(peaks, *dof, value(*place));
            }
        }
        for (peaks, (status, places)) in forces.iter_mut().zip(&specimens) {
            // What stands in for an answer that stayed away was not measured.
            if Status(value(*status) as u32).has(Status::STALE) {
                continue;
            }
            for (axis, place) in places.iter().enumerate() {
                raise(peaks, axis, value(*place));
            }
        }
    }
    let names = ports.iter().map(|port| port.name.clone());
    let [displacement, velocity, acceleration] = peaks;
    Ok(Peak {
        displacement,
        velocity,
        acceleration,
        force: names.zip(forces).collect(),
        ..Peak::default()
    })
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

pub(super) fn raise(peaks: &mut Vec<Option<f64>>, index: usize, value: f64) {
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
    fn peaks_come_back_from_their_text_to_the_last_bit_and_are_raised_by_what_is_larger() {
        let numbers = (1..4000).map(|k| Some((f64::from(k) * 1.37).sin().abs() * 1e5));
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
