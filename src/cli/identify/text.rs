//! The identified properties, as a table.

use std::path::Path;

use super::super::table::Table;
use gusset_motion::identify::Identification;
use gusset_quantity::units::{duration, quantity};
use gusset_session::identification::{Axis, Outcome, felt, of_specimen, parameters, with_error};

/// Rows of the frequency response that are printed.
const ROWS: usize = 10;

/// The whole table.
pub(super) fn table(outcome: &Outcome, folder: &Path) -> String {
    let mut text = String::new();
    for axis in &outcome.axes {
        let title = format!(
            "{}: {} either way, {} Hz to {} Hz",
            axis.driven.words(),
            quantity(axis.driven.amplitude, "m"),
            outcome.band.0,
            outcome.band.1
        );
        let mut table = Table::new(&title);
        match &axis.found {
            Err(error) => table.row("NOT IDENTIFIED", &error.to_string()),
            Ok(found) => of_axis(&mut table, axis, found),
        }
        if axis.stale > 0 {
            table.row(
                "stale",
                &format!("{} measurements were not of their tick", axis.stale),
            );
        }
        text += &table.to_string();
    }
    let mut table = Table::new("files");
    if outcome.stretched > 0.0 {
        let text = format!("{} ticks: the machine was late", outcome.stretched);
        table.row("stretched", &text);
    }
    let shown = |name: &str| folder.join(name).display().to_string();
    if folder.join("identified.toml").exists() {
        table.row("twin", &shown("identified.toml"));
    }
    table.row("pictures", &shown("identification/index.html"));
    table.row("run", &folder.display().to_string());
    text + &table.to_string()
}

fn of_axis(table: &mut Table, axis: &Axis, found: &Identification) {
    table.row(
        "frequency",
        "      gain                delay           coherence",
    );
    let every = found.response.len().div_ceil(ROWS).max(1);
    for point in found.response.iter().skip(every / 2).step_by(every) {
        let mark = if point.trusted { "" } else { "  not trusted" };
        let text = format!(
            "{:8.5} ± {:<8.1e} {:9.4} ± {:<7.4} ms {:6.4}{mark}",
            point.gain,
            point.gain_std,
            1e3 * point.delay_s,
            1e3 * point.delay_std_s,
            point.coherence
        );
        table.row(&format!("  {:.3} Hz", point.hz), &text);
    }
    let lowest = found.best().map_or(0.0, |best| best.criterion);
    for (place, fit) in found.models.iter().enumerate() {
        let verdict = if place == 0 {
            "best".to_owned()
        } else {
            format!("criterion +{:.1}", fit.criterion - lowest)
        };
        let text = format!(
            "{}\nleaves {:.3} % over, {verdict}",
            parameters(fit),
            100.0 * fit.residual
        );
        table.row(fit.model.words(), &text);
    }
    table.row(
        "over the band",
        &format!(
            "delay {}, gain {}, with what changes within the band",
            with_error(found.delay, "s"),
            with_error(found.gain, "1")
        ),
    );
    if let Some(inverse) = &found.inverse {
        let numbers = inverse.coefficients.iter().map(|a| format!("{a:.6e}"));
        let text = format!(
            "{}: leaves {:.3} % of the target over",
            numbers.collect::<Vec<_>>().join(", "),
            100.0 * inverse.residual
        );
        table.row("inverse", &text);
    }
    match &found.specimen {
        None => table.row("specimen", "no force beyond noise was measured"),
        Some(specimen) => {
            for (what, text) in of_specimen(specimen, axis.to_structure) {
                table.row(&what, &text);
            }
        }
    }
    for (what, text) in felt(axis) {
        table.row(&what, &text);
    }
    table.row(
        "noise at rest",
        &format!(
            "{} and {} (root mean square of {} samples, {})",
            quantity(found.noise.disp_m, "m"),
            quantity(found.noise.force_n, "N"),
            found.noise.samples,
            duration(found.noise.samples as f64 * axis.tick),
        ),
    );
}
