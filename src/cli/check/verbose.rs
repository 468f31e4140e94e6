//! `gusset check --verbose`: everything that is known of a test without a rehearsal.

use super::super::table::Table;
use super::super::{limits, spectrum as modes};
use gusset_config::{ClockChoice, word};
use gusset_motion::{Quantity, STANDARD_GRAVITY};
use gusset_numerics::integrate::Lambda;
use gusset_proof::{Errors, Spectrum, per_cent};
use gusset_quantity::units::{duration, number, quantity, rate};
use gusset_session::integration;
use gusset_setup::{Facts, StructureFacts};

/// Everything that is known of the test without a rehearsal.
pub(super) fn tabulate(table: &mut Table, facts: &Facts, spectrum: Option<&Spectrum>) {
    of_test(table, facts);
    of_records(table, facts);
    if facts.ticks_per_step > 1 {
        let ticks = f64::from(facts.ticks_per_step);
        table.row(
            "rates",
            &format!(
                "integration {:.6} steps per second of wall time, controller {:.6} ticks per second: {} ticks per step",
                facts.rate_hz / ticks,
                facts.rate_hz,
                facts.ticks_per_step
            ),
        );
    }
    if let Some(structure) = &facts.structure {
        describe(table, facts, structure, spectrum);
    } else {
        table.row(
            "structure",
            "none: the specimens follow a prescribed displacement",
        );
    }
    let specimens = facts.specimens.join(", ");
    table.row(
        "specimens",
        if specimens.is_empty() {
            "none"
        } else {
            &specimens
        },
    );
    limits::tabulate(&facts.limits, table);
}

/// The error of each storey, specimen or DOF, and each mode with the damping that the actuators add.
pub(super) fn of_errors(table: &mut Table, errors: Option<&Errors>) {
    let Some(errors) = errors else {
        return;
    };
    for (name, error) in errors.each() {
        table.row(&format!("error, {name}"), &error.words());
        for one in &error.directions {
            let text = format!(
                "largest drift {} instead of {}: {}, NRMSE {}",
                quantity(one.largest, &one.unit),
                quantity(one.reference, &one.unit),
                per_cent(one.error),
                per_cent(one.nrmse)
            );
            table.row(&format!("{name}, {}", one.name), &text);
        }
    }
    for (index, mode) in errors.modes.iter().enumerate() {
        let added = match mode.added_ratio {
            Some(added) => format!("the actuators add {} %", number(100.0 * added)),
            None => "the damping that the actuators add is not known".to_owned(),
        };
        let own = number(100.0 * mode.damping_ratio);
        table.row(
            &format!("damping, mode {}", index + 1),
            &format!("{own} %; {added}"),
        );
    }
}

fn describe(
    table: &mut Table,
    facts: &Facts,
    structure: &StructureFacts,
    spectrum: Option<&Spectrum>,
) {
    table.row(
        "structure",
        &format!(
            "{} DOFs{}",
            structure.dofs,
            structure
                .storage
                .as_ref()
                .map(|storage| format!(", effective mass stored {storage}"))
                .unwrap_or_default()
        ),
    );
    if let Some(condition) = structure.reciprocal_condition {
        table.row(
            "condition",
            &format!(
                "{} reciprocal, of the matrix that is factored for alpha",
                number(condition)
            ),
        );
    }
    of_loads(table, structure);
    match spectrum.filter(|spectrum| spectrum.is_of_family()) {
        Some(spectrum) => modes::tabulate(spectrum, table),
        None => frequencies(table, facts, structure),
    }
    match structure.lambda {
        Some(lambda) => describe_lambda(table, structure, lambda),
        None => table.row("method", &word(&structure.method)),
    }
    for (what, found) in integration::in_full(facts, structure) {
        table.row(what, &found);
    }
    if let Some(spectrum) = spectrum {
        modes::describe(spectrum, table);
    }
}

fn describe_lambda(table: &mut Table, structure: &StructureFacts, lambda: Lambda) {
    let how = if structure.lambda_by_number {
        "asked for by number".to_owned()
    } else {
        format!(
            "automatic: the largest up to 11.5 with gain at most {}",
            structure.gain
        )
    };
    table.row("λ", &format!("{lambda} ({how})"));
}

/// Natural frequencies alone, where the effect of the method on them is not known.
fn frequencies(table: &mut Table, facts: &Facts, structure: &StructureFacts) {
    if structure.frequencies.is_empty() {
        return;
    }
    table.row("mode", "   frequency       period    Ω = ω·Δt");
    for (mode, omega) in structure.frequencies.iter().enumerate() {
        let text = modes::swing(*omega, facts.dt);
        table.row(&format!("  {}", mode + 1), &text);
    }
}

fn of_test(table: &mut Table, facts: &Facts) {
    let clock = match facts.clock {
        ClockChoice::Real => "real",
        ClockChoice::Simulated => "simulated",
    };
    table.row(
        "test",
        &format!(
            "{} steps of {} = {}, {clock} clock at {}",
            facts.steps,
            duration(facts.dt),
            duration(facts.steps as f64 * facts.dt),
            rate(facts.rate_hz)
        ),
    );
}

/// Each record that was read from a file, in a line.
fn of_records(table: &mut Table, facts: &Facts) {
    for record in &facts.records {
        let column = match (&record.column_name, record.column) {
            (Some(name), Some(number)) => format!("column {number} {name:?}, "),
            (None, Some(number)) => format!("column {number}, "),
            _ => String::new(),
        };
        let peak = match record.quantity {
            Quantity::Acceleration => format!(
                "{} ({:.4} g)",
                quantity(record.peak, record.quantity.si_unit()),
                record.peak / STANDARD_GRAVITY
            ),
            other => quantity(record.peak, other.si_unit()),
        };
        table.row(
            "record",
            &format!(
                "{}: {}, {column}unit {}, {} points of {} = {}, peak {peak}",
                record.file,
                record.format.name(),
                record.unit,
                record.npts,
                duration(record.dt_s),
                duration(record.duration_s())
            ),
        );
    }
}

fn of_loads(table: &mut Table, structure: &StructureFacts) {
    if let Some(peak) = structure.peak_ground_accel {
        table.row(
            "ground",
            &format!("peak acceleration {}", quantity(peak, "m/s²")),
        );
    }
    if let Some((dof, peak)) = structure.peak_nodal_force {
        let turns = structure.rotations.contains(&dof);
        let peak = quantity(peak, if turns { "N m" } else { "N" });
        table.row("nodal forces", &format!("peak {peak} at DOF {}", dof + 1));
    }
}
