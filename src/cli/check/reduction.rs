//! The reduction of a structure for `gusset check`: its size, and its modes beside those of the full model.

use std::f64::consts::TAU;

use super::super::table::Table;
use gusset_proof::per_cent;
use gusset_quantity::units::number;
use gusset_reduction::Accuracy;
use gusset_setup::StructureFacts;
use serde_json::{Value, json};

/// Adds the size of the reduced structure and the errors of its lowest modes; nothing for others.
pub(super) fn tabulate(
    table: &mut Table,
    structure: &StructureFacts,
    accuracy: Option<&Result<Accuracy, String>>,
) {
    let Some(facts) = &structure.reduction else {
        return;
    };
    let kept = facts.reduction.kept().len();
    let mut text = format!(
        "{} DOFs of the model become {}: {kept} kept ({} named, {} added), {} modes",
        facts.reduction.full(),
        structure.dofs,
        facts.named,
        kept - facts.named,
        facts.modes,
    );
    if facts.modes > 0 {
        text.push_str(&format!(
            " up to {} Hz",
            number(facts.reduction.highest() / TAU)
        ));
    }
    if let shapes @ 1.. = structure.dofs - kept - facts.modes {
        text.push_str(&format!(", {shapes} shapes of kept DOFs without mass"));
    }
    table.row("reduction", &text);
    let accuracy = match accuracy {
        Some(Ok(accuracy)) => accuracy,
        Some(Err(why)) => return table.row("", &format!("errors of its modes: not known: {why}")),
        None => return,
    };
    for (mode, [full, reduced]) in accuracy.frequencies.iter().enumerate() {
        let mut text = format!(
            "{} Hz, error {}",
            number(full / TAU),
            per_cent((reduced - full) / full)
        );
        for ground in &accuracy.grounds {
            let [full, reduced] = ground.sums[mode];
            let name = match ground.suffix.as_str() {
                "" => String::new(),
                suffix => format!(" {suffix}"),
            };
            text.push_str(&format!(
                "; effective mass{name} so far {} %, error {}",
                number(100.0 * full),
                per_cent(reduced - full)
            ));
        }
        table.row(&format!("  mode {}", mode + 1), &text);
    }
}

/// Lists the degrees of freedom of a reduced structure.
pub(super) fn list(table: &mut Table, structure: &StructureFacts) {
    if structure.reduction.is_none() {
        return;
    }
    for (dof, place) in (1..).zip(&structure.places) {
        table.row(&format!("  DOF {dof}"), place);
    }
}

/// The reduction for `--json`; null for other structures.
pub(super) fn as_json(
    structure: &StructureFacts,
    accuracy: Option<&Result<Accuracy, String>>,
) -> Value {
    let Some(facts) = &structure.reduction else {
        return Value::Null;
    };
    let known = accuracy.and_then(|one| one.as_ref().ok());
    let modes = known
        .iter()
        .flat_map(|one| one.frequencies.iter().enumerate());
    let modes = modes.map(|(mode, [full, reduced])| {
        let grounds = known.iter().flat_map(|one| &one.grounds);
        let masses = grounds.map(|ground| {
            let [full, reduced] = ground.sums[mode];
            json!({"ground": ground.suffix, "sum": full, "reduced_sum": reduced})
        });
        json!({
            "frequency_rad_per_s": full,
            "reduced_frequency_rad_per_s": reduced,
            "effective_masses": masses.collect::<Vec<_>>(),
        })
    });
    json!({
        "full_dofs": facts.reduction.full(),
        "kept": facts.reduction.kept().iter().map(|dof| dof + 1).collect::<Vec<_>>(),
        "named": facts.named,
        "modes": facts.modes,
        "highest_mode_rad_per_s": facts.reduction.highest(),
        "lowest_modes": modes.collect::<Vec<_>>(),
        "not_known": accuracy.and_then(|one| one.as_ref().err()),
    })
}
