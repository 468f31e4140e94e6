//! The section on energy: its sources and sinks.

use super::canvas::Ink;
use super::charts::Quantity;
use super::digest::Digest;
use super::html::{details, note, paragraph, table};
use super::lines::{Line, TimeChart};
use super::metrics;
use super::plots::{WHOLE, history};
use super::rows::Rows;
use super::text::{NOTHING, number, quantity};

const PARTS: [(&str, &str, &str, Ink); 6] = [
    (
        "input",
        "input",
        "work of the loads and of the ground, with the kinetic energy at the beginning",
        Ink::Text,
    ),
    ("kinetic", "kinetic", "½ vᵀM v", Ink::Series(0)),
    (
        "damping",
        "damping",
        "dissipated by the linear damping of the numerical side",
        Ink::Series(3),
    ),
    (
        "springs",
        "numerical springs",
        "stored in stiffness, stored and dissipated by nonlinear elements of the numerical side",
        Ink::Series(2),
    ),
    (
        "specimens",
        "specimens",
        "∫ f d(B·x): stored and dissipated by the specimens",
        Ink::Series(1),
    ),
    (
        "remainder",
        "residual",
        "input less all others: the trapezoidal rule's own error, of order Δt²",
        Ink::Series(5),
    ),
];

fn column<'a>(digest: &'a Digest, name: &str) -> Option<&'a [f64]> {
    let found = digest.energy.get(name);
    found.filter(|values| !values.is_empty())
}

/// The section; `None` for a test without a structure. `why` explains a missing balance.
pub(super) fn balance(rows: &Rows<'_>, why: Option<&str>) -> Option<String> {
    let digest = rows.digest();
    let heading = "Energy";
    if rows.dofs().is_empty() || rows.running() == 0 {
        return None;
    }
    if column(digest, "time").is_none() {
        let why = match rows.passed() {
            passed if passed.missing_steps > 0 => "steps are missing in the record",
            passed if passed.steps < 3 => "it takes three steps",
            _ => why.unwrap_or(
                "not every DOF and axis is recorded, or the structure is too large for it",
            ),
        };
        return Some(rows.section(
            heading,
            &(paragraph(&format!("No energy balance is drawn: {why}.")) + &audit(rows)),
        ));
    }
    let lines: Vec<_> = PARTS
        .iter()
        .filter_map(|(key, name, _, ink)| {
            let y =
                column(digest, key).filter(|y| metrics::peak(y).is_some_and(|p| p.value != 0.0))?;
            Some(Line {
                name,
                x: digest.energy.time_of(key)?,
                y,
                ink: *ink,
                width: 1.3,
            })
        })
        .collect();
    let chart = TimeChart::history(
        "Energy balance",
        Quantity {
            words: "energy",
            unit: "J",
        },
        &lines,
    );
    let marks = |key: &str| digest.energy.marks(key);
    let input = marks("input").peak.map(|peak| peak.value.abs());
    let share = |value: f64| {
        input
            .filter(|i| *i > 0.0 && value.is_finite())
            .map(|i| format!("{} %", number(100.0 * value / i, 3)))
    };
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| NOTHING.to_owned());
    let listed = PARTS.iter().filter_map(|(key, name, meaning, _)| {
        let (end, peak) = (marks(key).last?, marks(key).peak?);
        Some(vec![
            format!("{name}: {meaning}"),
            quantity(end, "J"),
            or_dash(share(end)),
            quantity(peak.value, "J"),
        ])
    });
    let listed: Vec<_> = listed.collect();
    let picture = if lines.is_empty() {
        note("No picture: every energy is zero from the first step to the last.")
    } else {
        history((WHOLE, 220.0), "Energy balance over test time", &chart)
    };
    let more = table(
        &["", "at the end", "of the largest input", "largest"],
        &listed,
    ) + &note(
        "Work of a force in a step: half the way from the step before to the step after. The balance is of second order in Δt.",
    ) + &audit(rows);
    let markup = picture + &details("Energies at the end, and the audit of the steps", &more);
    Some(rows.section(heading, &markup))
}

/// Result of the program's exact audit.
fn audit(rows: &Rows<'_>) -> String {
    let values = rows.get("step_audit");
    let Some((values, peak)) = values.and_then(|values| {
        let peak = metrics::peak(&values)?;
        Some((values, peak))
    }) else {
        return note("The steps of this test were not audited (column step_audit).");
    };
    let found = if values.last().is_some_and(|last| last.is_nan()) {
        "in the last row it is not a number, so that nothing is known of that step".to_owned()
    } else {
        let size = if peak.value == 0.0 {
            "only roundoff remains".to_owned()
        } else {
            format!(
                "the residual is at most {} of the energy turned over",
                number(peak.value.abs(), 2)
            )
        };
        format!("{size}. It audits this program: steps, forces and rows are booked right")
    };
    note(&format!(
        "Exact audit of the steps, ½ Δ(vᵀ M_eff v) = Σ ½ (x[i+1] − x[i−1])ᵀ (F − R − Bᵀf)[i], made while the test ran: {found}."
    ))
}
