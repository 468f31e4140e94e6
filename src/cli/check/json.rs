//! `gusset check --json`.

use serde_json::{Value, json};

use super::super::spectrum::{delays_json, modes_json};
use super::super::{certificate, rehearsed};
use super::{Checked, commands, damping, frame, reduction};
use gusset_motion::{Corrected, Quantity, RecordFacts, STANDARD_GRAVITY, Scaled};
use gusset_proof::Stability;
use gusset_quantity::catalog::column;
use gusset_setup::{GroundFacts, StructureFacts};

/// The whole document.
pub(super) fn document(checked: &Checked<'_>) -> Value {
    let judged = checked.judged;
    let facts = &judged.test.facts;
    let structure = facts.structure.as_ref();
    let structure = structure.map(|structure| structure_json(checked, structure));
    let following = judged.following.iter().map(|one| one.as_json());
    let full = judged.rehearsed.as_ref();
    let mut found = json!({
        "title": facts.title,
        "valid": judged.verdict.is_clear(),
        "verdict": judged.verdict.record(),
        "steps": facts.steps,
        "dt": facts.dt,
        "rate_hz": facts.rate_hz,
        "ticks_per_step": facts.ticks_per_step,
        "structure": structure,
        "specimens": facts.specimens,
        "commands": commands(checked.loaded)
            .map(|(name, between_ticks)| json!({"specimen": name, "between_ticks": between_ticks.name()}))
            .collect::<Vec<_>>(),
        "rehearsal": full.map(rehearsed::as_json),
        "record": facts.records.first().map(record_json),
        "displacements": facts.corrected.iter().map(corrected_json).collect::<Vec<_>>(),
        "records": facts.records.iter().map(record_json).collect::<Vec<_>>(),
        "limits": facts.limits,
        "warnings": facts.warnings,
    });
    if let Some(found) = found.as_object_mut() {
        if !judged.following.is_empty() {
            found.insert("following".to_owned(), following.collect());
        }
        if let Some(certificate) = checked.certificate {
            found.insert("certificate".to_owned(), certificate::as_json(certificate));
        }
    }
    found
}

/// `structure`.
fn structure_json(checked: &Checked<'_>, structure: &StructureFacts) -> Value {
    let (choice, spectrum) = (structure.choice(), checked.spectrum);
    json!({
        "dofs": structure.dofs,
        "places": structure.places,
        "frame": frame::as_json(structure, checked.frame()),
        "reduction": reduction::as_json(structure, checked.accuracy.as_ref()),
        "rule_damping_of_specimens": damping::as_json(structure),
        "storage": structure.storage,
        "reciprocal_condition": structure.reciprocal_condition,
        "frequencies_rad_per_s": structure.frequencies,
        "method": structure.method,
        "lambda": structure.lambda.map(|lambda| number(lambda.value())),
        "lambda_by_number": structure.lambda_by_number,
        "lambda_limit": choice.map(|choice| choice.limit),
        "criterion": choice.map(|_| "S(lambda) positive semi-definite at the declared bounds"),
        "margin": choice.map(|choice| number(choice.margin)),
        "stable": gusset_proof::is_stable(&structure.stability, structure.analysis.as_ref()),
        "governing": choice.and_then(|c| c.governing.as_ref()).map(ToString::to_string),
        "gain_bound": structure.gain.is_finite().then_some(structure.gain),
        "spectral_radius_at_bounds": match structure.stability {
            Stability::AtBounds(radius) => Some(radius),
            _ => None,
        },
        "modes": spectrum.filter(|spectrum| spectrum.is_of_family()).map(modes_json),
        "highest_frequency_rad_per_s": spectrum.and_then(|spectrum| spectrum.highest),
        "critical_delays": spectrum.map(delays_json),
        "peak_ground_acceleration_m_per_s2": structure.peak_ground_accel,
        "grounds": structure.grounds.iter().map(ground_json).collect::<Vec<_>>(),
        "scaling": structure.scaled.as_ref().map(scaling_json),
        "peak_nodal_force_n": structure.peak_nodal_force.map(|(_, peak)| peak),
    })
}

/// A displacement that was made of an acceleration.
fn corrected_json((key, corrected): &(String, Corrected)) -> Value {
    let [disp, vel, accel] = corrected.peaks;
    let spectrum = corrected.spectrum.iter().map(|[period, before, after]| {
        json!({ "period_s": period, "before_m_per_s2": before, "after_m_per_s2": after })
    });
    json!({
        "key": key,
        "corner_hz": corrected.corner_hz,
        "stroke_m": corrected.stroke,
        "peak_m": disp,
        "peak_m_per_s": vel,
        "peak_m_per_s2": accel,
        "peak_before_m_per_s2": corrected.peak_before,
        "spectrum": spectrum.collect::<Vec<_>>(),
    })
}

/// A recorded ground acceleration.
fn ground_json(ground: &GroundFacts) -> Value {
    json!({
        "column": column::GROUND.of_component(&ground.suffix),
        "peak_m_per_s2": ground.peak,
    })
}

/// `structure.scaling`.
fn scaling_json(scaled: &Scaled) -> Value {
    let [before, after] = scaled.misfit();
    json!({
        "target": scaled.measure,
        "factor": scaled.factor,
        "spectrum": scaled.spectrum,
        "periods_s": scaled.periods,
        "target_m_per_s2": scaled.target,
        "before_m_per_s2": scaled.before,
        "after_m_per_s2": scaled.after,
        "misfit_before": before,
        "misfit_after": after,
    })
}

/// A number, or its name where it is not finite.
fn number(value: f64) -> Value {
    if value.is_finite() {
        json!(value)
    } else {
        json!(value.to_string())
    }
}

/// One record for `--json`. `column` is the name of the column, or its number where it has no name.
fn record_json(record: &RecordFacts) -> Value {
    let peak_key = match record.quantity {
        Quantity::Acceleration => "peak_m_per_s2",
        Quantity::Velocity => "peak_m_per_s",
        Quantity::Displacement => "peak_m",
        Quantity::Force => "peak_n",
    };
    let column = match &record.column_name {
        Some(name) => json!(name),
        None => json!(record.column),
    };
    let mut found = json!({
        "file": record.file,
        "format": record.format,
        "column": column,
        "column_number": record.column,
        "unit": record.unit,
        "npts": record.npts,
        "dt_s": record.dt_s,
        "duration_s": record.duration_s(),
    });
    if let Some(found) = found.as_object_mut() {
        found.insert(peak_key.to_owned(), json!(record.peak));
        if record.quantity == Quantity::Acceleration {
            let in_g = record.peak / STANDARD_GRAVITY;
            found.insert("peak_g".to_owned(), json!(in_g));
        }
    }
    found
}
