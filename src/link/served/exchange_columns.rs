//! The rows of a server: one per exchange, and their columns.

use super::Trip;
use crate::catalog::column::{Each, Kind, SERVER};
use crate::catalog::phase::Phase;
use crate::record::Column;
use crate::substructure::{Command, Measurement};
use crate::units::AxisUnits;

/// One recorded exchange.
pub(super) struct Exchange<'a> {
    pub state: f64,
    pub command: &'a Command<'a>,
    pub elapsed: f64,
    pub commits: u64,
    pub measured: &'a Measurement,
    pub trip: Option<Trip>,
    pub received_ns: u64,
    pub answered_ns: u64,
}

impl Exchange<'_> {
    /// Values of the column `state`, as those of a controller's own record: what is kept back has tripped.
    pub const PROBING: f64 = Phase::Probing.code();
    pub const RUNNING: f64 = Phase::Running.code();
    pub const KEPT_BACK: f64 = Phase::Tripped.code();
}

/// Columns before those of the axes.
pub(super) const HEAD: usize = count(Each::Test);
/// Columns of every axis.
pub(super) const WIDTH: usize = count(Each::Axis);

const fn count(each: Each) -> usize {
    let (mut count, mut at) = (0, 0);
    while at < SERVER.len() {
        if SERVER[at].each as u8 == each as u8 {
            count += 1;
        }
        at += 1;
    }
    count
}

fn kinds(each: Each) -> impl Iterator<Item = &'static Kind> {
    SERVER.iter().filter(move |kind| kind.each == each)
}

pub(super) fn columns(units: &[AxisUnits], name: &str) -> Vec<Column> {
    let column = |kind: &Kind, name: String, unit: &str, meaning: String| Column {
        name,
        unit: unit.to_owned(),
        meaning,
        timing: kind.is_timing(),
    };
    let of_test = |kind: &Kind| column(kind, kind.name().into(), kind.unit, kind.told(""));
    let mut columns: Vec<Column> = kinds(Each::Test).map(of_test).collect();
    for (axis, units) in (1..).zip(units) {
        for kind in kinds(Each::Axis) {
            // A rotation stays one, and a moment too: there is nothing to bring into metres.
            let unit = match kind.unit {
                "unit of the axis" => units.disp,
                "unit of force of the axis" => units.force,
                _ => kind.unit_of(units.disp == "rad"),
            };
            let meaning = format!("{}; specimen \"{name}\", axis {axis}", kind.meaning);
            columns.push(column(kind, kind.of_axis(1, axis), unit, meaning));
        }
    }
    columns.extend(kinds(Each::Specimen).map(|kind| {
        let meaning = format!("{}; specimen \"{name}\"", kind.meaning);
        column(kind, kind.of_specimen(1), kind.unit, meaning)
    }));
    columns
}
