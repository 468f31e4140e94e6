//! What was identified, as a table.

use std::path::Path;

use super::super::table::Table;
use super::outcome::{Axis, Outcome};
use crate::identify::{Estimate, Felt, Fit, Identification, SpecimenFit};
use crate::units::{duration, quantity};

/// Rows of the frequency response that are printed.
const ROWS: usize = 10;

/// A number with its standard error, both with the same prefix and as many digits as are known.
pub(super) fn with_error(estimate: Estimate, unit: &str) -> String {
    let Estimate { value, std } = estimate;
    let (factor, prefix) = match unit {
        "1" => (1.0, ""),
        _ => prefixed(value.abs().max(std.abs())),
    };
    let (value, std) = (value / factor, std / factor);
    // Two digits of the error, four to nine of the number.
    let shown = if std > 0.0 && std.is_finite() {
        (1.0 - libm::floor(libm::log10(std))).clamp(0.0, 8.0) as usize
    } else {
        6
    };
    let unit = if unit == "1" { "" } else { unit };
    let text = format!("{value:.shown$} ± {std:.shown$} {prefix}{unit}");
    text.trim_end().to_owned()
}

/// A factor of a thousand to a power, and its prefix.
fn prefixed(size: f64) -> (f64, &'static str) {
    let all = [(1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ")];
    let fits = all.into_iter().find(|(factor, _)| size >= *factor);
    fits.unwrap_or(if size > 0.0 { (1e-9, "n") } else { (1.0, "") })
}

/// The parameters of a model, in one line.
pub(super) fn parameters(fit: &Fit) -> String {
    let each = fit.parameters.iter().map(|found| {
        let estimate = Estimate {
            value: found.value,
            std: found.std,
        };
        let name = match found.name {
            "gain" => "gain",
            "delay_s" => "delay",
            "time_constant_s" => "T",
            "frequency_hz" => "f",
            "damping_ratio" => "ζ",
            other => other,
        };
        format!("{name} {}", with_error(estimate, found.unit))
    });
    each.collect::<Vec<_>>().join(", ")
}

/// What the specimen is, in lines.
pub(super) fn of_specimen(
    specimen: &SpecimenFit,
    to_structure: (f64, f64),
) -> Vec<(String, String)> {
    let scaled = |estimate: Estimate, by: f64| Estimate {
        value: estimate.value * by,
        std: estimate.std * by,
    };
    let mut rows = vec![
        (
            "stiffness".to_owned(),
            with_error(specimen.stiffness, "N/m"),
        ),
        ("damping".to_owned(), with_error(specimen.damping, "N s/m")),
    ];
    if to_structure != (1.0, 1.0) {
        rows.push((
            "at the structure".to_owned(),
            format!(
                "{}, {}",
                with_error(scaled(specimen.stiffness, to_structure.0), "N/m"),
                with_error(scaled(specimen.damping, to_structure.1), "N s/m")
            ),
        ));
    }
    if let Some(mass) = specimen.mass {
        let text = format!(
            "{}; it belongs into `mass_in_force_kg`",
            with_error(mass, "kg")
        );
        rows.push(("mass in force".to_owned(), text));
    }
    let verdict = if specimen.is_nonlinear() {
        ": NOT LINEAR at this amplitude, the stiffness is a secant"
    } else {
        ""
    };
    rows.push((
        "residual".to_owned(),
        format!(
            "{:.3} % of the force, {:.3} % are noise{verdict}",
            100.0 * specimen.residual,
            100.0 * specimen.floor
        ),
    ));
    rows
}

/// What axes that were held felt, in lines.
pub(super) fn felt(axis: &Axis) -> Vec<(String, String)> {
    let scale = axis.own_stiffness();
    let felt = axis.felt.iter();
    let felt = felt.filter(|(_, felt)| felt.stiffness.counts_beside(scale));
    let line = |(other, felt): &(usize, Felt)| {
        let text = format!("{} of this one", with_error(felt.stiffness, "N/m"));
        (format!("felt by {}", axis.driven.place_words(*other)), text)
    };
    felt.map(line).collect()
}

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
