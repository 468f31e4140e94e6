//! `[[specimen]]`: its axes, its estimates, and its name.

use super::certificate::check_known;
use super::geometry::check_geometry;
use super::link::{check_link, check_standing};
use super::{Findings, idle, numbers};
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::safety::ZeroChoice;
use crate::specimen::SpecimenTable;
use crate::value::MatrixValue;
use gusset_actuator::transfer::TransferSpec;

/// Source of the displacements of a specimen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Source {
    /// The structure of the test.
    Structure,
    /// A prescribed displacement.
    Prescribed,
    /// The client of a server.
    Client,
}

/// One `[[specimen]]`.
pub(super) fn check_specimen(
    specimen: &SpecimenTable,
    source: Source,
    at: &KeyPath,
    findings: &mut Findings,
) {
    check_rules(specimen, at, findings);
    check_known(at, findings);
    if specimen.link.is_none() {
        let why = "a specimen is either simulated (`law`, `laws`, `coupled`, `bearing`), behind a `link` or on a `bus`";
        findings.exactly_one(
            at,
            &["law", "laws", "coupled", "bearing", "link", "bus"],
            why,
        );
    } else if specimen.source().is_some() {
        let why = "beside a `link` or `bus` it is the stand-in for rehearsals";
        findings.exactly_one(at, &["law", "laws", "coupled", "bearing"], why);
    }
    match &specimen.link {
        Some(link) => check_link(specimen, link, at, findings),
        None if specimen.hardening_bound.is_some() => findings.push(
            Finding::error(at.key("hardening_bound"), "a law has its own bound")
                .at_key()
                .label("only for a specimen behind a link"),
        ),
        None => {}
    }
    if specimen.drill.is_some() && specimen.link.is_some() {
        let text = "a `drill` injects faults into this program";
        let finding = Finding::error(at.key("drill"), text)
            .at_key()
            .label("not for a specimen behind a link")
            .help("`gusset serve --fault` injects faults at the server");
        findings.push(finding);
    }
    if source == Source::Structure {
        let why = "give the deformation d = B·x that the specimen follows";
        findings.exactly_one(at, &["storey", "rows", "deformations"], why);
    } else {
        for place in findings.given(at, "storey rows deformations") {
            let key = place.last_key().unwrap_or_default();
            if source == Source::Client && key == "rows" {
                check_served_rows(specimen, at, findings);
                continue;
            }
            let help = if source == Source::Client {
                "the client commands the displacement: remove this key, or give `rows` to transform its displacements to the \
                 axes (`--protocol openfresco…`)"
            } else {
                "without a structure the displacement is prescribed: remove this key"
            };
            findings.push(
                Finding::error(
                    place.clone(),
                    format!("`{key}` refers to a structure, and this test has no `[structure]`"),
                )
                .at_key()
                .label("no structure")
                .help(help),
            );
        }
    }
    if specimen.storey == Some(0) {
        findings.push(
            Finding::error(at.key("storey"), "storey 0 does not exist")
                .label("storeys are counted from 1 at the bottom"),
        );
    }
    let axes = match (&specimen.storey, &specimen.rows) {
        (Some(_), None) => Some(1),
        (None, Some(rows)) => {
            check_rows(rows, &at.key("rows"), findings);
            Some(rows.len())
        }
        _ => specimen.deformations.as_ref().map(Vec::len),
    };
    check_geometry(specimen, axes, at, findings);
    let loaded = specimen.geometry.as_ref();
    let laws = loaded.map_or(axes, |_| Some(specimen.law_axes()).filter(|n| *n > 0));
    let axes = loaded.map_or(axes, |_| Some(specimen.axes()));
    for (key, estimate) in [
        ("stiffness_n_per_m", &specimen.stiffness_n_per_m),
        ("damping_n_s_per_m", &specimen.damping_n_s_per_m),
    ] {
        if let Some(matrix) = estimate {
            check_estimate(matrix, laws, &at.key(key), findings);
        }
    }
    check_time(specimen, at, findings);
    check_standing(specimen, at, findings);
    check_axes(specimen, axes, at, findings);
}

/// The conditions on keys that hold in the file of a test and in that of a server.
fn check_rules(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    findings.numbers(at, numbers::NUMBERS_OF_SPECIMEN);
    findings.numbers(&at.key("link"), numbers::NUMBERS_OF_LINK);
    for index in 0..specimen.axis.len() {
        findings.numbers(&at.key("axis").index(index), numbers::NUMBERS_OF_AXIS);
    }
    findings.idle(at, idle::IDLE_SPECIMEN, |when| when(specimen));
}

/// A simulated actuator makes the velocity of its specimen itself, and knows the time of the test alone.
fn check_time(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    if specimen.similitude.time == 1.0 {
        return;
    }
    let spec = specimen.transfer.as_ref();
    if spec.is_some_and(TransferSpec::has_its_own_time) {
        findings.push(
            Finding::error(
                at.key("transfer"),
                "a simulated actuator runs in test time: `similitude.time` must be 1",
            )
            .at_key()
            .label("runs in test time")
            .beside(
                at.key("similitude").key("time"),
                "the specimen has another time scale",
            ),
        );
    }
}

fn check_axes(
    specimen: &SpecimenTable,
    axes: Option<usize>,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let given = specimen.axis.len();
    if let Some(axes) = axes
        && given > 0
        && given != axes
    {
        findings.push(
            Finding::error(
                at.key("axis"),
                format!(
                    "the specimen has {}, but {} given",
                    counted(axes, "axis", "axes"),
                    counted(given, "`axis` table is", "`axis` tables are")
                ),
            )
            .label("give one table per axis, or no tables"),
        );
    }
    for (index, axis) in specimen.axis.iter().enumerate() {
        let at = at.key("axis").index(index);
        if !matches!(axis.sign, -1 | 1) {
            findings.push(
                Finding::error(
                    at.key("sign"),
                    format!("`sign` is {}, but must be 1 or -1", axis.sign),
                )
                .label("only a direction")
                .help("use `scale` for a factor"),
            );
        }
    }
}

fn check_rows(rows: &[Vec<f64>], at: &KeyPath, findings: &mut Findings) {
    let Some(first) = rows.first() else {
        findings.push(
            Finding::error(at.clone(), "`rows` is empty").label("one row per axis is needed"),
        );
        return;
    };
    for (index, row) in rows.iter().enumerate() {
        let here = at.index(index);
        if row.len() != first.len() {
            findings.push(
                Finding::error(
                    here,
                    format!(
                        "row {} has {} numbers, but row 1 has {}",
                        index + 1,
                        row.len(),
                        first.len()
                    ),
                )
                .label("one number per DOF of the structure"),
            );
        } else if row.iter().all(|b| *b == 0.0) {
            findings.push(
                Finding::error(here, format!("row {} is all zero", index + 1))
                    .label("this axis would not move, and its force would have no effect"),
            );
        }
    }
}

/// Checks `rows` of a served file. The client commands x in one unit, and the axes are no actuators of a platform, unless a gateway
/// converts coordinates to them.
fn check_served_rows(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    if specimen.link.is_some() && specimen.converts() {
        return;
    }
    if specimen.geometry.is_some() {
        findings.push(
            Finding::error(
                at.key("geometry"),
                "`geometry` and `rows` exclude each other here",
            )
            .at_key()
            .label("the actuators of a platform are served without `rows`")
            .beside(at.key("rows"), "a transformation of axes"),
        );
    }
    let units = specimen.units_of(specimen.axes());
    let other = units.iter().position(|unit| Some(unit) != units.first());
    if let Some(index) = other {
        // Given by this axis, or absent where the first axis gives it.
        let here = match specimen.axis.get(index) {
            Some(_) => at.key("axis").index(index),
            None => at.key("axis"),
        };
        findings.push(
            Finding::error(
                here,
                format!("axis {} has other units than axis 1", index + 1),
            )
            .label("`rows` need one unit of displacement and one of force")
            .beside(
                at.key("rows"),
                "the client's displacements also have this unit",
            ),
        );
    }
}

/// Square, of the right size, symmetric, with no negative diagonal.
fn check_estimate(
    matrix: &MatrixValue,
    axes: Option<usize>,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let rows = matrix.rows();
    let n = rows.len();
    if let Some(axes) = axes
        && n != axes
    {
        findings.push(
            Finding::error(
                at.clone(),
                format!(
                    "the specimen has {}, but its estimate is for {n}",
                    counted(axes, "axis", "axes")
                ),
            )
            .label(format!("give a {axes} by {axes} matrix")),
        );
        return;
    }
    if let Some(index) = rows.iter().position(|row| row.len() != n) {
        findings.push(
            Finding::error(at.index(index), "the matrix is not square").label(format!(
                "row {} has {} numbers, but there are {n} rows",
                index + 1,
                rows[index].len()
            )),
        );
        return;
    }
    // Numbers that are equal in decimals are equal as doubles: each pair is written with the same digits.
    for (i, row) in rows.iter().enumerate() {
        for (j, below) in row.iter().enumerate().take(i) {
            let above = rows[j][i];
            if *below != above && below.is_finite() && above.is_finite() {
                findings.push(
                    Finding::error(at.index(i).index(j), "the matrix is not symmetric")
                        .label(format!("{below} here"))
                        .beside(at.index(j).index(i), format!("{above} there")),
                );
                return;
            }
        }
        if row[i] < 0.0 {
            let place = match matrix {
                MatrixValue::Number(_) => at.clone(),
                MatrixValue::Rows(_) => at.index(i).index(i),
            };
            findings.push(
                Finding::error(place, format!("the estimate is {}, but must not be negative", row[i]))
                    .label("must be zero or greater")
                    .help("it enters M_eff, which must be positive definite; a too large estimate is safe"),
            );
        }
    }
}

/// A gateway adds its offsets to every command and measurement, and reads no zero before a session: its zero would differ from
/// that of the file.
pub(super) fn refuse_relative_zeros(
    specimen: &SpecimenTable,
    at: &KeyPath,
    findings: &mut Findings,
) {
    for (index, axis) in specimen.axis.iter().enumerate() {
        let at = at.key("axis").index(index);
        let of_disp = "`offset_m` is the position of the axis at zero deformation";
        let of_force = "`offset_n` is the reading of the load cell at zero force";
        for (key, zero, offset) in [
            ("zero_disp", axis.zero_disp, of_disp),
            ("zero_force", axis.zero_force, of_force),
        ] {
            if zero == ZeroChoice::Relative {
                let text = format!("a gateway does not support `{key} = \"relative\"`");
                let finding = Finding::error(at.key(key), text)
                    .label("it takes no zero before a session")
                    .help(format!("remove the key; {offset}"));
                findings.push(finding);
            }
        }
    }
}

/// The names of all.
pub(super) fn check_names(specimens: &[SpecimenTable], findings: &mut Findings) {
    /// Leaves room for prefixes and endings in every file system.
    const LONGEST: usize = 64;
    for (index, specimen) in specimens.iter().enumerate() {
        let at = KeyPath::root().key("specimen").index(index).key("name");
        let name = specimen.name.as_str();
        let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        if name.is_empty()
            || name.starts_with('.')
            || name.len() > LONGEST
            || !name.chars().all(plain)
        {
            findings.push(
                Finding::error(at, format!("{name:?} cannot name a specimen"))
                    .label("it is part of file names")
                    .help("a name has up to 64 letters (a-z), digits, `-`, `_` and `.`, and does not begin with a dot"),
            );
        } else if let Some(before) = specimens[..index]
            .iter()
            .position(|other| other.name.eq_ignore_ascii_case(name))
        {
            let first = KeyPath::root().key("specimen").index(before).key("name");
            findings.push(
                Finding::error(at, format!("two specimens are called `{name}`"))
                    .label("again here")
                    .beside(first, "first here")
                    .help("names of specimens must differ, not only in upper and lower case, because columns and files have \
                     these names"),
            );
        }
    }
}

/// Noise that should be independent, but has one seed.
pub(super) fn check_seeds(specimens: &[SpecimenTable], findings: &mut Findings) {
    let seed = |table: &SpecimenTable| {
        let noisy = table.own_transfer().filter(|spec| spec.is_noisy());
        noisy.map(|spec| spec.seed)
    };
    for (index, specimen) in specimens.iter().enumerate() {
        let Some(own) = seed(specimen) else { continue };
        let before = specimens[..index].iter();
        let Some(first) = before
            .enumerate()
            .find(|(_, other)| seed(other) == Some(own))
        else {
            continue;
        };
        let at = |index: usize| KeyPath::root().key("specimen").index(index).key("transfer");
        let headline = format!(
            "the sensors of `{}` and `{}` have identical noise",
            first.1.name, specimen.name
        );
        findings.push(
            Finding::warning(at(index), headline)
                .at_key()
                .label(format!("`seed` is {own}"))
                .beside(at(first.0), "and here, too")
                .help("give one of them another `seed`"),
        );
    }
}

pub(super) fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}
