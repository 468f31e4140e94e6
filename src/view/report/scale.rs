//! The two ends of a specimen: its own, in its own units, and the structure's. Where they are not one to one, a page names the
//! end of a number.

use maud::Markup;

use super::columns::SpecimenAxis;
use super::digest::Digest;
use super::html::note;
use super::tested::axis_name;
use super::text::{named_once, trimmed};
use crate::TestFile;
use gusset_config::AxisTable;

/// Unit of a column at the specimen's end: the configuration contains the unit itself.
const OWN: &str = "specimen unit";
/// Words after a number that differs at the specimen.
pub(super) const AS_SEEN: &str = ", as the structure sees it";

/// Metres and newtons of an axis as the structure sees them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    pub(super) metres: f64,
    pub(super) newtons: f64,
}

/// The table of the axis.
fn entry(test: &TestFile, axis: SpecimenAxis) -> Option<&AxisTable> {
    let axes = &test.specimen(axis.specimen)?.axis;
    axes.get(axis.axis.checked_sub(1)? as usize)
}

/// Unit of the column of this kind, which is of the specimen's own end.
pub(super) fn own_unit<'a>(
    rows: &'a Digest,
    test: &'a TestFile,
    axis: SpecimenAxis,
    kind: &str,
) -> &'a str {
    let unit = rows.unit(&axis.column(kind));
    if unit != OWN {
        return unit;
    }
    let entry = entry(test, axis);
    match kind {
        "raw_force" => entry.map_or("N", |axis| axis.unit_force.row().symbol),
        _ => entry.map_or("m", |axis| axis.unit_disp.row().symbol),
    }
}

impl Scale {
    /// Scale of an axis; `None` where both ends are one to one, or the record has only the specimen's.
    pub(crate) fn of(rows: &Digest, test: &TestFile, axis: SpecimenAxis) -> Option<Self> {
        if rows.unit(&axis.column("cmd")) != OWN {
            return None;
        }
        let ratio = entry(test, axis).map_or(1.0, |axis| f64::from(axis.sign) * axis.scale);
        let similitude = &test.specimen(axis.specimen)?.similitude;
        let metres = similitude.length / ratio;
        let newtons = similitude.force * ratio;
        let is_plain = metres == 1.0 && newtons == 1.0;
        (!is_plain).then_some(Self { metres, newtons })
    }

    /// In words.
    pub(crate) fn words(self) -> String {
        format!(
            "1\u{a0}m of the specimen is {}\u{a0}m of the structure, 1\u{a0}N is {}\u{a0}N",
            trimmed(self.metres, 6),
            trimmed(self.newtons, 6)
        )
    }
}

/// Which numbers are of which end, and the scale of every axis that is not one to one; nothing where all are.
pub(super) fn of_both_ends(rows: &Digest, test: &TestFile) -> Markup {
    let scales = rows.all_axes.iter().filter_map(|&axis| {
        let scale = Scale::of(rows, test, axis)?;
        Some((axis_name(test, axis, &rows.all_axes), scale.words()))
    });
    let told = named_once(scales);
    if told.is_empty() {
        return Markup::default();
    }
    note(&format!(
        "Limits, warnings and where a specimen was left are of the specimen itself; histories, loops and peaks are as the structure \
         sees them. {}",
        told.join(" ")
    ))
}
