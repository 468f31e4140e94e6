//! `gusset check --verbose`: everything that is known of a test without a rehearsal.

use super::super::table::Table;
use super::super::{limits, spectrum as modes};
use super::brief::{of_corrected, of_peak_nodal_force, of_record, of_scaling, of_test};
use super::{Checked, damping, frame, reduction};
use gusset_config::word;
use gusset_numerics::integrate::Lambda;
use gusset_proof::{Errors, per_cent};
use gusset_quantity::units::{number, quantity};
use gusset_session::integration;
use gusset_setup::{Facts, StructureFacts};

/// Everything that is known of the test without a rehearsal.
pub(super) fn tabulate(table: &mut Table, checked: &Checked<'_>) {
    let facts = &checked.judged.test.facts;
    table.row("test", &of_test(facts));
    for record in &facts.records {
        table.row("record", &of_record(record));
    }
    for (key, corrected) in &facts.corrected {
        table.row("displacement", &of_corrected(key, corrected));
    }
    if let Some(structure) = &facts.structure {
        describe(table, checked, structure);
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

fn describe(table: &mut Table, checked: &Checked<'_>, structure: &StructureFacts) {
    let (facts, spectrum) = (&checked.judged.test.facts, checked.spectrum);
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
    reduction::tabulate(table, structure, checked.accuracy.as_ref());
    reduction::list(table, structure);
    frame::tabulate(table, structure, checked.frame(), true);
    damping::tabulate(table, facts, structure, usize::MAX);
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

fn of_loads(table: &mut Table, structure: &StructureFacts) {
    for ground in &structure.grounds {
        let name = match ground.suffix.as_str() {
            "" => "ground".to_owned(),
            of => format!("ground {of}"),
        };
        let peak = format!("peak acceleration {}", quantity(ground.peak, "m/s²"));
        table.row(&name, &peak);
    }
    if let Some(scaled) = &structure.scaled {
        table.row("scaling", &of_scaling(scaled));
    }
    if let Some(text) = of_peak_nodal_force(structure) {
        table.row("nodal forces", &text);
    }
}
