//! Loads and motions of the structure, on the step grid.

use super::histories::{added, keep, motion, series, sized, warn_of_nothing, with_files};
use super::specimens::Specimens;
use super::structure::vector;
use super::{Refused, Site, path};
use gusset_config::{ExcitationTable, Finding, KeyPath, NodalFileTable};
use gusset_motion::{
    Excitation, Grid, LoadTerm, NodalTable, Quantity, Unit, base_motion, parse_table,
};
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::Structure;

/// Most numbers of all motions of a test together, which are laid out before it: 4 GiB, twelve hours of a ground motion at 4096 Hz.
const MOST_NUMBERS: u64 = 1 << 29;

/// Names that are listed in one warning, at most.
const MOST_NAMED: usize = 12;

/// Numbers that the motions take for each step while they are laid out, as far as that is decided by the file: values, their
/// rates and a copy of each in the making.
fn numbers_per_step(excitation: &ExcitationTable) -> u64 {
    let ExcitationTable {
        ground_acceleration,
        incident_angle_deg: _,
        scaling: _,
        base_displacement,
        support_motion,
        nodal_force,
        nodal_table: _,
        prescribed_displacement,
    } = excitation;
    let counts = [
        3 * ground_acceleration.all().len(),
        4 * usize::from(base_displacement.is_some()),
        4 * support_motion.len(),
        2 * nodal_force.len(),
        4 * prescribed_displacement.len(),
    ];
    counts.iter().sum::<usize>() as u64
}

/// The step grid of the test.
pub(super) fn grid(site: &mut Site<'_>) -> Result<Grid, Refused> {
    let time = site.loaded.time;
    let per_step = numbers_per_step(&site.loaded.file.excitation).max(1);
    let most = MOST_NUMBERS / per_step;
    if time.steps > most && site.loaded.file.excitation != ExcitationTable::default() {
        let text = format!(
            "the excitation of {} steps needs {:.1} GiB of memory before the test, which is too much",
            time.steps,
            time.steps as f64 * per_step as f64 * 8.0 / f64::from(1 << 30)
        );
        let finding = Finding::error(path("time").key("duration_s"), text)
            .label(format!("at most {most} steps"))
            .help("a longer test is possible without an excitation: in free vibration or under a static load");
        return site.refuse(finding);
    }
    let steps = usize::try_from(time.steps).unwrap_or(usize::MAX);
    Grid::new(time.step.value(), steps)
        .or_else(|error| site.refuse(Finding::error(path("time"), error.to_string())))
}

/// A static load as the file gives it, and at the degrees of freedom of the structure, in N.
pub(super) type StaticLoads = [Vec<f64>; 2];

/// The loads of a structure, and its static load if it has one.
pub(super) fn excitation(
    site: &mut Site<'_>,
    structure: &Structure,
    specimens: &Specimens,
    initial_stiffness: &SymMatrix,
) -> Result<(Excitation, Option<StaticLoads>), Refused> {
    let n = structure.dofs();
    let given = site.dofs_of_file(n);
    let grid = grid(site)?;
    let mut excitation = Excitation::none(n, grid.steps());
    let table = &site.loaded.file.excitation;
    let at = path("excitation");
    excitation = super::ground::ground(site, structure, specimens, grid, excitation)?;
    if let Some(base) = &table.base_displacement {
        let at = at.key("base_displacement");
        let history = motion(&base.signal, &base.processing);
        let moved = with_files(site, &at, &base.signal, |files| {
            base_motion(&history, grid, files, "the base")
        })?;
        let told = [moved.warnings, moved.doubts];
        keep(site, &at, &base.signal, told, moved.record);
        let corrected = moved.corrected.map(|one| (at.to_string(), one));
        site.corrected.extend(corrected);
        warn_of_nothing(site, at.clone(), [structure.influence(), &moved.disp]);
        if base
            .influence
            .as_ref()
            .is_some_and(|given| given != structure.influence())
        {
            let text = "a base displacement uses the influence vector of the structure: ones, or `influence` in \
             `structure.matrices`";
            return site.refuse(Finding::error(at.key("influence"), text));
        }
        excitation = added(site, &at, || excitation.with_base(moved.disp, moved.vel))?;
    }
    excitation = super::supports::supports(site, structure, initial_stiffness, grid, excitation)?;
    for (index, force) in table.nodal_force.iter().enumerate() {
        let at = at.key("nodal_force").index(index);
        let pattern = match (&force.dofs, &force.pattern) {
            (Some(dofs), _) => spread(site, &at.key("dofs"), dofs, given)?,
            (None, Some(pattern)) => sized(site, &at.key("pattern"), pattern.clone(), given)?,
            (None, None) => vec![0.0; given],
        };
        let pattern = site.load(pattern);
        let history = motion(&force.signal, &force.processing);
        let series = series(site, &at, &history, Quantity::Force, grid)?;
        warn_of_nothing(site, at.clone(), [&pattern, &series]);
        let term = LoadTerm { pattern, series };
        excitation = added(site, &at, || excitation.with_term(term))?;
    }
    if let Some(nodal) = &table.nodal_table {
        let at = at.key("nodal_table");
        let table = nodal_table(site, &at, nodal, n, grid)?;
        warn_of_nothing(site, at.clone(), [&[1.0], &table.values]);
        excitation = added(site, &at, || excitation.with_table(table))?;
    }
    let given = static_load(site, structure)?;
    let loads = given.map(|given| [given.clone(), site.load(given)]);
    if let Some([_, load]) = loads.clone() {
        excitation = added(site, &path("structure"), || excitation.with_constant(load))?;
    }
    Ok((excitation, loads))
}

/// A force on every DOF, from a file whose columns are taken in order. A warning reports names that contradict this
/// order.
fn nodal_table(
    site: &mut Site<'_>,
    at: &KeyPath,
    nodal: &NodalFileTable,
    n: usize,
    grid: Grid,
) -> Result<NodalTable, Refused> {
    let file = &nodal.file;
    let bytes = site.read(at.key("file"), file)?;
    let at = at.key("file");
    let parsed = parse_table(file, &bytes);
    let parsed =
        parsed.or_else(|error| site.refuse(Finding::error(at.clone(), error.to_string())))?;
    if let Some(name) = parsed
        .column_of_times()
        .and_then(|time| parsed.names.get(time))
    {
        let text = format!(
            "{file} has a column {name:?}, which is not allowed: each row is one step and each column one DOF"
        );
        return site.refuse(Finding::error(at, text));
    }
    if parsed.columns != n {
        let text = format!(
            "{file} has {} columns, but the structure has {n} DOFs: give one column per DOF",
            parsed.columns
        );
        return site.refuse(Finding::error(at, text));
    }
    let is_other = |column: &usize| {
        parsed
            .unit_of(*column)
            .is_some_and(|unit| unit != Unit::Newton)
    };
    if nodal.scale == 1.0
        && let Some(column) = (0..n).find(is_other)
    {
        let text = match parsed.names.get(column) {
            Some(name) => format!("{file} has a column {name:?}, but forces must be in N"),
            None => format!("the header of {file} states another unit than N"),
        };
        let help = "use `scale` to convert all numbers to N";
        return site.refuse(Finding::error(at, text).help(help));
    }
    let mut texts = parsed.warnings.clone();
    if !are_numbered(&parsed.names) {
        let named = parsed.names.iter().enumerate();
        let named = named.map(|(index, name)| format!("{name:?} is DOF {}", index + 1));
        let list: Vec<String> = named.take(MOST_NAMED).collect();
        texts.push(format!(
            "the columns of {file} are used in their order: {}",
            list.join(", ")
        ));
    }
    let used = parsed.rows().min(grid.points());
    if parsed.rows() > used {
        texts.push(format!(
            "{file} has {} rows, but the test from t = 0 to its end has {used} steps: the remaining rows are not used. One \
             row is one step of the test",
            parsed.rows()
        ));
    }
    if parsed.rows() < grid.points() {
        texts.push(format!(
            "{file} has {} rows, but the test from t = 0 to its end has {} steps: the rest is zero",
            parsed.rows(),
            grid.points()
        ));
    }
    let warnings = texts
        .into_iter()
        .map(|text| Finding::warning(at.clone(), text));
    site.warnings.extend(warnings);
    Ok(NodalTable {
        dofs: (0..n).collect(),
        values: parsed
            .values
            .iter()
            .take(used * n)
            .map(|value| value * nodal.scale)
            .collect(),
    })
}

/// True of `F1`, `F2`, `F3`, and of no names at all.
fn are_numbered(names: &[String]) -> bool {
    names.iter().enumerate().all(|(index, name)| {
        let plain = name.split(['(', '[']).next().unwrap_or("").trim_end();
        let digits = plain.trim_start_matches(|c: char| !c.is_ascii_digit());
        digits.parse() == Ok(index + 1)
    })
}

fn spread(
    site: &mut Site<'_>,
    at: &KeyPath,
    dofs: &[usize],
    n: usize,
) -> Result<Vec<f64>, Refused> {
    let mut pattern = vec![0.0; n];
    for (index, dof) in dofs.iter().enumerate() {
        match dof.checked_sub(1).and_then(|dof| pattern.get_mut(dof)) {
            Some(entry) => *entry = 1.0,
            None => {
                let text = format!("DOF {dof} does not exist: the structure has {n}");
                return site.refuse(Finding::error(at.index(index), text));
            }
        }
    }
    Ok(pattern)
}

fn static_load(site: &mut Site<'_>, structure: &Structure) -> Result<Option<Vec<f64>>, Refused> {
    let table = site.loaded.file.structure.as_ref();
    let given = table.and_then(|table| table.static_load_n.clone());
    let gravity = table.and_then(|table| table.gravity.clone());
    let frame = table.and_then(|table| table.frame.as_ref());
    let lowers = frame.is_some_and(|frame| frame.member.iter().any(|member| member.p_delta));
    let beside = [
        ("gravity", gravity.is_some()),
        ("static_load_n", given.is_some()),
    ];
    if let Some((key, _)) = beside.into_iter().find(|(_, given)| *given && lowers) {
        let text = format!(
            "`p_delta` of a member counts the loads of the frame alone, not those of `{key}`"
        );
        let finding = Finding::error(path("structure").key(key), text).at_key();
        return site
            .refuse(finding.help("give all static loads as `load` of nodes in [structure.frame]"));
    }
    let of_nodes = frame.filter(|frame| !frame.load.is_empty());
    let of_nodes = of_nodes.and_then(|frame| frame.model().ok());
    if given.is_none() && gravity.is_none() && of_nodes.is_none() {
        return Ok(None);
    }
    let n = site.dofs_of_file(structure.dofs());
    let mut load = vector(site, "static_load_n", given, n)?;
    for (to, from) in load
        .iter_mut()
        .zip(of_nodes.iter().flat_map(|model| &model.load))
    {
        *to += from;
    }
    if let Some(gravity) = gravity {
        let at = path("structure").key("gravity").key("influence");
        let down = sized(site, &at, gravity.influence, n)?;
        let pull: Vec<f64> = down
            .iter()
            .map(|iota| -iota * gravity.accel_m_per_s2)
            .collect();
        let mass = match &site.reduced {
            Some(one) => one.reduction.mass(),
            None => structure.mass(),
        };
        mass.subtract_product(&pull, &mut load);
    }
    Ok(Some(load))
}
