//! Limits as `gusset check --verbose` shows them: the levels, the program that checks them, and the consequences.

use super::table::Table;
use gusset_actuator::geometry::LawPlace;
use gusset_quantity::units::{number, quantity};
use gusset_record::summary::{LimitFact, LimitFacts, LoadingFacts};

/// Adds the limits to the table of a test.
pub fn tabulate(limits: &LimitFacts, table: &mut Table) {
    if let Some(reason) = &limits.unlimited {
        table.row("UNLIMITED", reason);
    }
    for specimen in &limits.specimens {
        if let Some(loading) = &specimen.geometry {
            loading_unit(&specimen.name, loading, table);
        }
        let what = format!("limits, {}", specimen.name);
        table.row(&what, &format!("checked by {}", specimen.checked_by));
        let several = specimen.axes.len() > 1;
        for (index, axis) in specimen.axes.iter().enumerate() {
            if several {
                let of = if axis.is_empty() { ": none" } else { "" };
                let word = if specimen.geometry.is_some() {
                    "actuator"
                } else {
                    "axis"
                };
                table.row(&format!("  {word} {}{of}", index + 1), "");
            } else if axis.is_empty() {
                table.row(
                    "  none",
                    "not set; a value that is not a finite number still trips",
                );
            }
            for limit in axis {
                line(limit, table);
            }
        }
        for (what, found) in [
            ("  ends of stroke", &specimen.ends),
            ("  watchdog", &specimen.watchdog),
            ("  direction", &specimen.direction),
        ] {
            if let Some(found) = found {
                table.row(what, found);
            }
        }
        table.row("  stale replies", &specimen.stale);
        if let Some(safe) = &specimen.safe_disp_m {
            let each: Vec<String> = safe.iter().map(|disp| quantity(*disp, "m")).collect();
            table.row("  safe_disp_m", &each.join(", "));
        }
    }
    table.row("limits, test", "checked by the controller");
    for limit in &limits.test {
        line(limit, table);
    }
    table.row("  always", &limits.always.join(";\n"));
    table.row("  late ticks", &limits.on_miss);
    table.row("a warning", "is an event in the log; the test continues");
    table.row("a trip", &limits.on_trip);
    table.row("startup", &limits.way_in);
    table.row("shutdown", &limits.at_end);
}

/// The actuators of a loading unit, and the coordinates that they hold.
fn loading_unit(name: &str, loading: &LoadingFacts, table: &mut Table) {
    let LoadingFacts {
        form,
        exact,
        law_at,
        coordinates,
        condition,
        actuators,
    } = loading;
    let place = match form.as_str() {
        "plane" => "in the plane",
        "space" => "in space",
        _ => "by a matrix",
    };
    let strokes = if *exact {
        "exact"
    } else {
        "for small displacements"
    };
    let at = match law_at {
        LawPlace::Platform => "the platform's coordinates",
        LawPlace::Actuators => "the actuators",
    };
    table.row(
        &format!("actuators, {name}"),
        &format!(
            "{} {place} hold {}, strokes {strokes};\nlaw and estimates are of {at}; condition {condition:.3} at the reference \
             pose, where K0 is taken",
            actuators.len(),
            coordinates.join(", ")
        ),
    );
    for (index, actuator) in actuators.iter().enumerate() {
        let mut text = match actuator.length_m {
            Some(length) => format!("{length:.6} m from pin to pin; "),
            None => String::new(),
        };
        let slopes = coordinates.iter().zip(&actuator.slope);
        let slopes: Vec<String> = slopes
            .map(|(key, slope)| format!("{slope:+.4} {key}"))
            .collect();
        text.push_str(&format!("stroke {}", slopes.join(" ")));
        if let [least, most] = actuator.stroke_m[..] {
            text.push_str(&format!("; {least:.6} to {most:.6} m allowed"));
        }
        table.row(&format!("  actuator {}", index + 1), &text);
    }
}

fn line(limit: &LimitFact, table: &mut Table) {
    let level = |values: &[f64]| match values {
        [] => "-".to_owned(),
        [low, high] => format!("{} to {}", number(*low), number(*high)),
        sizes => sizes.iter().map(|size| number(*size)).collect(),
    };
    let star = if limit.also_at_the_specimen { " *" } else { "" };
    let (unit, judged) = match (limit.unit.as_str(), &limit.judged) {
        ("1", None) => ("", String::new()),
        ("1", Some(judged)) => ("", judged.clone()),
        (unit, None) => (unit, String::new()),
        (unit, Some(judged)) => (unit, format!("; {judged}")),
    };
    table.row(
        &format!("  {}{star}", limit.key),
        format!(
            "warns {:<20} trips {:<20} {unit}{judged}",
            level(&limit.warn),
            level(&limit.trip)
        )
        .trim_end(),
    );
}
