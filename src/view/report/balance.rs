//! The section on energy: its sources and sinks.

use maud::{Markup, html};

use super::chart::{Chart, Ink, Look, Scale};
use super::digest::Digest;
use super::html::{details, note, paragraph, table};
use super::response::trips;
use super::text::{number, or_dash, quantity};
use super::{RunView, metrics};

/// Column, name, meaning and colour of each energy.
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

/// The section; `None` for a test without a structure.
pub(super) fn balance(run: &RunView, rows: &Digest) -> Option<Markup> {
    let digest = rows;
    if rows.dofs.is_empty() || rows.passed.steps == 0 {
        return None;
    }
    if column(digest, "time").is_none() {
        let why = match rows.passed {
            passed if passed.missing_steps > 0 => "steps are missing in the record",
            passed if passed.steps < 3 => "it takes three steps",
            _ => {
                let why = run.no_balance.as_deref();
                why.unwrap_or(
                    "not every DOF and axis is recorded, or the structure is too large for it",
                )
            }
        };
        let says = paragraph(&format!("No energy balance is drawn: {why}."));
        return Some(rows.section("Energy", html! { (says) (audit(rows)) }));
    }
    let drawn = PARTS.iter().filter_map(|(key, name, _, ink)| {
        let y = column(digest, key).filter(|y| metrics::peak(y).is_some_and(|p| p.value != 0.0))?;
        Some((*name, digest.energy.time_of(key)?, y, *ink))
    });
    let chart = Chart::history("Energy balance", Scale::new("energy", "J")).marks(trips(run));
    let chart = drawn.fold(chart, |chart, (name, x, y, ink)| {
        chart.with(name, x, y, Look::Line).inked(ink)
    });
    let marks = |key: &str| digest.energy.marks(key);
    let input = marks("input")
        .peak
        .map(|peak| peak.value.abs())
        .filter(|input| *input > 0.0);
    let share = |value: f64| {
        let input = input.filter(|_| value.is_finite());
        input.map(|input| format!("{} %", number(100.0 * value / input, 3)))
    };
    let listed = PARTS.iter().filter_map(|(key, name, meaning, _)| {
        let (end, peak) = (marks(key).last?, marks(key).peak?);
        let name = format!("{name}: {meaning}");
        Some(vec![
            name,
            quantity(end, "J"),
            or_dash(share(end)),
            quantity(peak.value, "J"),
        ])
    });
    let more = html! {
        (table(&["", "at the end", "of the largest input", "largest"], &listed.collect::<Vec<_>>()))
        (note("Work of a force in a step: half the way from the step before to the step after. The balance is of second order in Δt."))
        (audit(rows))
    };
    let markup = html! {
        @if chart.is_empty() { (note("No picture: every energy is zero from the first step to the last.")) }
        @else { (chart.labelled("Energy balance over test time").figure()) }
        (details("Energies at the end, and the audit of the steps", more))
    };
    Some(rows.section("Energy", markup))
}

/// Result of the program's exact audit.
fn audit(rows: &Digest) -> Markup {
    let values = rows.get("step_audit");
    let Some((values, peak)) = values.and_then(|values| {
        let peak = metrics::peak(values)?;
        Some((values, peak))
    }) else {
        return note("The steps of this test were not audited (column step_audit).");
    };
    let found = if values.last().is_some_and(|last| last.is_nan()) {
        "in the last row it is not a number, so that nothing is known of that step".to_owned()
    } else {
        let size = match peak.value == 0.0 {
            true => "only roundoff remains".to_owned(),
            false => {
                let size = number(peak.value.abs(), 2);
                format!("the residual is at most {size} of the energy turned over")
            }
        };
        format!("{size}. It audits this program: steps, forces and rows are booked right")
    };
    note(&format!(
        "Exact audit of the steps, ½ Δ(vᵀ M_eff v) = Σ ½ (x[i+1] − x[i−1])ᵀ (F − R − Bᵀf)[i], made while the test ran: {found}."
    ))
}
