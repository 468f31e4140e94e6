//! The two ends of a specimen: its own, in its own units, and the structure's. Where they are not one to one, a page says of which
//! a number is.

use serde_json::Value;

use super::columns::SpecimenAxis;
use super::html::note;
use super::rows::Rows;
use super::tested::axis_name;
use super::text::trimmed;

/// Unit of a column that is of a specimen's own end: which one it is stands in the configuration.
const OWN: &str = "specimen unit";
/// What is said behind a number that is another at the specimen.
pub(super) const AS_SEEN: &str = ", as the structure sees it";

/// What a metre and a newton of an axis are for the structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    metres: f64,
    newtons: f64,
}

fn specimen(configuration: Option<&Value>, axis: SpecimenAxis) -> Option<&Value> {
    let list = configuration?.get("specimen")?;
    list.get(axis.specimen.checked_sub(1)? as usize)
}

/// Of the table of the axis.
fn entry<'a>(configuration: Option<&'a Value>, axis: SpecimenAxis, key: &str) -> Option<&'a Value> {
    let axes = specimen(configuration, axis)?.get("axis")?;
    axes.get(axis.axis.checked_sub(1)? as usize)?.get(key)
}

/// Unit of the column of this kind, which is of the specimen's own end.
pub(super) fn own_unit<'a>(
    rows: &Rows<'a>,
    configuration: Option<&'a Value>,
    axis: SpecimenAxis,
    kind: &str,
) -> &'a str {
    let (key, plain) = match kind {
        "raw_force" => ("unit_force", "N"),
        _ => ("unit_disp", "m"),
    };
    match rows.unit(&axis.column(kind)) {
        OWN => entry(configuration, axis, key)
            .and_then(Value::as_str)
            .unwrap_or(plain),
        unit => unit,
    }
}

impl Scale {
    /// Of an axis; none where both ends are one to one, or the record has only the specimen's.
    pub fn of(rows: &Rows<'_>, configuration: Option<&Value>, axis: SpecimenAxis) -> Option<Self> {
        if rows.unit(&axis.column("cmd")) != OWN {
            return None;
        }
        let number = |value: Option<&Value>| value.and_then(Value::as_f64).unwrap_or(1.0);
        let ratio = |key: &str| number(entry(configuration, axis, key));
        let similitude = specimen(configuration, axis)?.get("similitude");
        let of = |key: &str| number(similitude.and_then(|table| table.get(key)));
        let ratio = ratio("sign") * ratio("scale");
        let (metres, newtons) = (of("length") / ratio, of("force") * ratio);
        let is_plain = metres == 1.0 && newtons == 1.0;
        (!is_plain).then_some(Self { metres, newtons })
    }

    /// In words.
    pub fn words(self) -> String {
        format!(
            "1\u{a0}m of the specimen is {}\u{a0}m of the structure, 1\u{a0}N is {}\u{a0}N",
            trimmed(self.metres, 6),
            trimmed(self.newtons, 6)
        )
    }
}

/// Which numbers are of which end, and the scale of every axis that is not one to one; nothing where all are.
pub(super) fn of_both_ends(rows: &Rows<'_>, configuration: Option<&Value>) -> String {
    let mut told: Vec<(String, Vec<String>)> = Vec::new();
    for &axis in rows.axes() {
        let Some(scale) = Scale::of(rows, configuration, axis) else {
            continue;
        };
        let (name, words) = (axis_name(configuration, axis, rows.axes()), scale.words());
        match told.iter_mut().find(|(known, _)| *known == words) {
            Some((_, names)) => names.push(name),
            None => told.push((words, vec![name])),
        }
    }
    if told.is_empty() {
        return String::new();
    }
    let each = told
        .iter()
        .map(|(words, names)| format!("{}: {words}.", names.join(", ")));
    note(&format!(
        "Limits, warnings and where a specimen was left are of the specimen itself; histories, loops and peaks are as the structure \
         sees them. {}",
        each.collect::<Vec<_>>().join(" ")
    ))
}
