//! The short page of `gusset check`: the test, its model, its stability and its needs in a few lines.

use super::super::rehearsed::tabulate_speeds;
use super::super::spectrum;
use super::super::table::Table;
use super::{Checked, damping, frame, needs, reduction};
use gusset_config::{ClockChoice, Loaded};
use gusset_control::engine::{Ending, Stop};
use gusset_motion::{Corrected, Quantity, RecordFacts, STANDARD_GRAVITY, Scaled, Signal};
use gusset_quantity::units::{duration, number, quantity, rate};
use gusset_session::integration;
use gusset_session::rehearsal::{FullRehearsal, Need, Rehearsal};
use gusset_setup::{Facts, StructureFacts};

/// Specimens, and records, that have a separate line. The page gives the number of the others.
const LISTED: usize = 2;

/// Period error of the lowest mode from which on the page shows it.
const SHOWN_PERIOD_ERROR: f64 = 0.001;

/// Adds all of it to the page.
pub(super) fn tabulate(checked: &Checked<'_>, table: &mut Table) {
    let facts = &checked.judged.test.facts;
    table.row("test", &of_test(facts));
    let first = facts.structure.as_ref().and_then(|structure| {
        let first = structure.frequencies.first().copied();
        first.or_else(|| checked.spectrum?.lowest())
    });
    let text = match &facts.structure {
        Some(structure) => of_structure(structure, first),
        None => "none: the specimens follow a prescribed displacement".to_owned(),
    };
    table.row("structure", &text);
    if let Some(structure) = &facts.structure {
        reduction::tabulate(table, structure, checked.accuracy.as_ref());
        frame::tabulate(table, structure, checked.frame(), false);
        damping::tabulate(table, facts, structure, LISTED);
    }
    of_excitation(checked.loaded, facts, table);
    if let Some(structure) = &facts.structure {
        let mut text = integration::in_words(structure);
        let error = checked
            .spectrum
            .and_then(|spectrum| spectrum.period_error());
        if let Some(error) = error.filter(|error| error.abs() >= SHOWN_PERIOD_ERROR) {
            text.push_str(&format!(
                "; period error of mode 1: {} %",
                number(100.0 * error)
            ));
        }
        table.row("integrator", &text);
    }
    of_delays(checked, table);
    of_errors(checked, table);
    of_rehearsal(checked, table);
}

/// The rehearsal and its needs. With `--verbose` all of them, and the time that it took.
pub(super) fn of_rehearsal(checked: &Checked<'_>, table: &mut Table) {
    let Some(full) = &checked.judged.rehearsed else {
        table.row("rehearsal", "none: needs and limits are not compared");
        return;
    };
    let mut text = extent(full);
    if checked.args.verbose {
        let Rehearsal { wall_s, tick_s, .. } = full.rehearsal;
        let each = tick_s.map(|tick| format!(", {} a tick", duration(tick)));
        let each = each.unwrap_or_default();
        text.push_str(&format!("; it took {}{each}", duration(wall_s)));
    }
    table.row("rehearsal", &text);
    tabulate_speeds(full, table);
    needs::tabulate(full, table, checked.args.verbose);
}

pub(super) fn of_test(facts: &Facts) -> String {
    let clock = match facts.clock {
        ClockChoice::Real => "real",
        ClockChoice::Simulated => "simulated",
    };
    let steps = format!(
        "{} steps of {} = {}, {clock} clock at {}",
        facts.steps,
        quantity(facts.dt, "s"),
        duration(facts.steps as f64 * facts.dt),
        rate(facts.rate_hz),
    );
    match facts.ticks_per_step {
        0 | 1 => steps,
        ticks => format!("{steps}, {ticks} ticks per step"),
    }
}

fn of_structure(structure: &StructureFacts, first: Option<f64>) -> String {
    let dofs = match structure.dofs {
        1 => "1 DOF".to_owned(),
        dofs => format!("{dofs} DOFs"),
    };
    match first {
        Some(omega) if omega > 0.0 => {
            let hz = number(omega / std::f64::consts::TAU);
            format!("{dofs}, first natural frequency {hz} Hz")
        }
        _ => dofs,
    }
}

/// Every motion and load in one line, then a line for each record file.
fn of_excitation(loaded: &Loaded, facts: &Facts, table: &mut Table) {
    let excitation = &loaded.file.excitation;
    let structure = facts.structure.as_ref();
    let mut parts = Vec::new();
    let grounds = excitation.ground_acceleration.all();
    if !grounds.is_empty() {
        let kinds: Vec<&str> = grounds.iter().map(|ground| kind(&ground.signal)).collect();
        let peaks = structure.map_or(&[][..], |structure| &structure.grounds);
        let peaks = peaks.iter().map(|ground| match ground.suffix.as_str() {
            "" => format!(", peak {}", acceleration(ground.peak)),
            of => format!(", peak of {of} {}", acceleration(ground.peak)),
        });
        let (kinds, peaks) = (kinds.join(" and "), peaks.collect::<String>());
        parts.push(format!("ground acceleration ({kinds}{peaks})"));
    }
    if let Some(base) = &excitation.base_displacement {
        parts.push(format!("base displacement ({})", kind(&base.signal)));
    }
    match excitation.support_motion.as_slice() {
        [] => {}
        [one] => parts.push(format!("motion of a support ({})", kind(&one.signal))),
        several => parts.push(format!("{} motions of supports", several.len())),
    }
    match excitation.nodal_force.as_slice() {
        [] => {}
        [one] => parts.push(format!("nodal force ({})", kind(&one.signal))),
        several => parts.push(format!("{} nodal force histories", several.len())),
    }
    if let Some(nodal) = &excitation.nodal_table {
        let peak = structure.and_then(of_peak_nodal_force);
        let peak = peak.map_or_else(String::new, |peak| format!(", {peak}"));
        parts.push(format!("nodal forces from {}{peak}", nodal.file));
    }
    match excitation.prescribed_displacement.as_slice() {
        [] => {}
        [one] => parts.push(format!(
            "prescribed displacement of {} ({})",
            one.specimen,
            kind(&one.signal)
        )),
        several => parts.push(format!("{} prescribed displacements", several.len())),
    }
    let held = loaded.file.structure.as_ref();
    if held.is_some_and(|table| table.static_load_n.is_some() || table.gravity.is_some()) {
        parts.push("static load held throughout".to_owned());
    }
    let text = match parts.is_empty() {
        true => "none".to_owned(),
        false => parts.join("; "),
    };
    table.row("excitation", &text);
    if let Some(scaled) = structure.and_then(|structure| structure.scaled.as_ref()) {
        table.row("scaling", &of_scaling(scaled));
    }
    for (key, corrected) in &facts.corrected {
        table.row("displacement", &of_corrected(key, corrected));
    }
    for record in facts.records.iter().take(LISTED) {
        table.row("record", &of_record(record));
    }
    if let Some(more @ 1..) = facts.records.len().checked_sub(LISTED) {
        table.row("record", &format!("{more} more: --verbose shows them"));
    }
}

/// The common factor of all components, and the measure before and after.
pub(super) fn of_scaling(scaled: &Scaled) -> String {
    let (factor, measure) = (number(scaled.factor), scaled.measure.words());
    match (scaled.periods.as_slice(), &scaled.spectrum) {
        ([period], _) => format!(
            "factor {factor}: {measure} at {} is {} before and {} after",
            quantity(*period, "s"),
            acceleration(scaled.before[0]),
            acceleration(scaled.after[0])
        ),
        (periods, spectrum) => {
            let [first, last] = [periods.first(), periods.last()]
                .map(|period| quantity(period.copied().unwrap_or(0.0), "s"));
            let [before, after] = scaled.misfit().map(number);
            format!(
                "factor {factor}: from {first} to {last} the root mean square of ln({measure}/target) is {before} before and \
                 {after} after; target {}",
                spectrum.as_deref().unwrap_or_default()
            )
        }
    }
}

/// How an acceleration became a displacement.
pub(super) fn of_corrected(key: &str, corrected: &Corrected) -> String {
    let [disp, vel, accel] = corrected.peaks;
    let kept = corrected.spectrum.iter().map(|[period, before, after]| {
        let share = if *before > 0.0 {
            100.0 * after / before
        } else {
            0.0
        };
        format!("{share:.0} % at {}", quantity(*period, "s"))
    });
    let kept: Vec<String> = kept.collect();
    format!(
        "{key}: corner frequency {} for a stroke of {}; peaks {}, {}, and {} of {}; kept of the spectral acceleration: {}",
        quantity(corrected.corner_hz, "Hz"),
        quantity(corrected.stroke, "m"),
        quantity(disp, "m"),
        quantity(vel, "m/s"),
        quantity(accel, "m/s²"),
        quantity(corrected.peak_before, "m/s²"),
        kept.join(", ")
    )
}

/// The largest nodal force and its DOF.
pub(super) fn of_peak_nodal_force(structure: &StructureFacts) -> Option<String> {
    let (dof, peak) = structure.peak_nodal_force?;
    let turns = structure.rotations.contains(&dof);
    let peak = quantity(peak, if turns { "N m" } else { "N" });
    Some(format!("peak {peak} at {}", structure.dof(dof)))
}

/// The kind of a signal in words.
const fn kind(signal: &Signal) -> &'static str {
    match signal {
        Signal::File(_) => "record",
        Signal::Values(_) => "values of the test file",
        Signal::Sine(_) => "sine",
        Signal::Sweep(_) => "sweep",
        Signal::BandLimitedNoise(_) => "band-limited noise",
        Signal::KanaiTajimi(_) => "Kanai–Tajimi",
        Signal::Step(_) => "step",
        Signal::RampAndHold(_) => "ramp and hold",
        Signal::Cyclic(_) => "cyclic",
        Signal::Ricker(_) => "Ricker wavelet",
        Signal::Constant(_) => "constant",
    }
}

fn acceleration(peak: f64) -> String {
    format!(
        "{} = {} g",
        quantity(peak, "m/s²"),
        number(peak / STANDARD_GRAVITY)
    )
}

pub(super) fn of_record(record: &RecordFacts) -> String {
    let column = match (&record.column_name, record.column) {
        (Some(name), Some(number)) => format!("column {number} {name:?}, "),
        (None, Some(number)) => format!("column {number}, "),
        _ => String::new(),
    };
    let peak = match record.quantity {
        Quantity::Acceleration => acceleration(record.peak),
        other => quantity(record.peak, other.si_unit()),
    };
    format!(
        "{}: {}, {column}{} points of {} = {}, unit {}, peak {peak}",
        record.file,
        record.format.name(),
        record.npts,
        quantity(record.dt_s, "s"),
        duration(record.duration_s()),
        record.unit,
    )
}

/// Delays: the proof with the actuator for each specimen that has one, and the critical delay for the others.
fn of_delays(checked: &Checked<'_>, table: &mut Table) {
    let following = &checked.judged.following;
    let (listed, more) = following.split_at(following.len().min(LISTED));
    for one in listed {
        let text = format!("{}: {}", one.specimen(), one.in_short());
        table.row("actuator", &text);
    }
    if !more.is_empty() {
        let text = format!("{} more: --verbose shows them", more.len());
        table.row("actuator", &text);
    }
    let Some(spectrum) = checked.spectrum else {
        return;
    };
    let names: Vec<&str> = following.iter().map(|one| one.specimen()).collect();
    let delays = spectrum::in_short(spectrum, &names);
    match delays.as_slice() {
        [] => {}
        [(_, text)] if following.is_empty() => table.row("critical delay", text),
        all => {
            for (name, text) in all.iter().take(LISTED) {
                table.row("critical delay", &format!("{name}: {text}"));
            }
            if let Some(more @ 1..) = all.len().checked_sub(LISTED) {
                table.row(
                    "critical delay",
                    &format!("{more} more: --verbose shows them"),
                );
            }
        }
    }
}

/// Errors of method and coupling in one row, and the damping that the actuators take.
fn of_errors(checked: &Checked<'_>, table: &mut Table) {
    let Some(errors) = &checked.judged.verdict.errors else {
        return;
    };
    table.row("errors", &errors.words());
    if let Some(text) = errors.of_modes().filter(|_| errors.take_damping()) {
        table.row("damping", &text);
    }
}

/// Whether the whole test was rehearsed, and the limits that it met.
fn extent(full: &FullRehearsal) -> String {
    let rehearsal = &full.rehearsal;
    let time = duration(rehearsal.time);
    let extent = match rehearsal.ending {
        Ending::Completed => format!("all {time} of the test on the simulated clock"),
        Ending::Stopped(Stop::Operator) => {
            format!("the first {time} of the test; the rest takes too long to rehearse")
        }
        Ending::Stopped(stop) => format!("the test would stop after {time}: {stop}"),
    };
    let axes = rehearsal.specimens.iter().flat_map(|needs| &needs.axes);
    let needs: Vec<&Need> = axes.flatten().collect();
    let trips = needs.iter().filter(|need| need.trips()).count();
    let limited = needs.iter().any(|need| need.margin().is_some());
    let limits = match (limited, trips) {
        (false, 0) => "no trip level is set".to_owned(),
        (_, 0) => "no trip level is reached".to_owned(),
        (_, 1) => "ONE LIMIT WOULD TRIP".to_owned(),
        (_, several) => format!("{several} LIMITS WOULD TRIP"),
    };
    let held = full.held.as_ref().map(|held| {
        let trips = held.needs().any(Need::trips);
        let trips = if trips { ", WHICH WOULD TRIP" } else { "" };
        format!("; with a hold at {}{trips}", quantity(held.at, "s"))
    });
    format!("{extent}; {limits}{}", held.unwrap_or_default())
}
