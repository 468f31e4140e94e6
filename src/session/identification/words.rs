//! Identified properties in words.

use super::outcome::Axis;
use gusset_motion::identify::{Estimate, Felt, Fit, SpecimenFit};

/// A number with its standard error, both with the same prefix and as many digits as are known.
#[must_use]
pub fn with_error(estimate: Estimate, unit: &str) -> String {
    let Estimate { value, std } = estimate;
    let (factor, prefix) = match unit {
        "1" => (1.0, ""),
        _ => prefixed(value.abs().max(std.abs())),
    };
    let (value, std) = (value / factor, std / factor);
    // Two digits of the error, but no more decimals than a reader can use.
    let shown = if std > 0.0 && std.is_finite() {
        (1.0 - libm::floor(libm::log10(std))).clamp(0.0, 5.0) as usize
    } else {
        5
    };
    let unit = if unit == "1" { "" } else { unit };
    // An error of which no digit would be shown is left out, and so are the zeros of an exact number.
    let number = if std < 0.5e-5 {
        let text = format!("{value:.shown$}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.shown$} ± {std:.shown$}")
    };
    format!("{number} {prefix}{unit}").trim_end().to_owned()
}

/// A factor of a thousand to a power, and its prefix.
fn prefixed(size: f64) -> (f64, &'static str) {
    let all = [(1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ")];
    let fits = all.into_iter().find(|(factor, _)| size >= *factor);
    fits.unwrap_or(if size > 0.0 { (1e-9, "n") } else { (1.0, "") })
}

/// The parameters of a model, in one line.
#[must_use]
pub fn parameters(fit: &Fit) -> String {
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

/// The specimen, in lines.
#[must_use]
pub fn of_specimen(specimen: &SpecimenFit, to_structure: (f64, f64)) -> Vec<(String, String)> {
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

/// Forces of the held axes, in lines.
#[must_use]
pub fn felt(axis: &Axis) -> Vec<(String, String)> {
    let scale = axis.own_stiffness();
    let felt = axis.felt.iter();
    let felt = felt.filter(|(_, felt)| felt.stiffness.counts_beside(scale));
    let line = |(other, felt): &(usize, Felt)| {
        let text = format!("{} of this one", with_error(felt.stiffness, "N/m"));
        (format!("felt by {}", axis.driven.place_words(*other)), text)
    };
    felt.map(line).collect()
}
