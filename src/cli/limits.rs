//! Limits as `gusset check` shows them: what is allowed, who checks it, what happens then.

use super::table::Table;
use crate::config::{Limit, LimitFacts};

/// Adds them to the table of a test.
pub fn tabulate(limits: &LimitFacts, table: &mut Table) {
    if let Some(reason) = &limits.unlimited {
        table.row("UNLIMITED", reason);
    }
    for specimen in &limits.specimens {
        let what = format!("limits, {}", specimen.name);
        table.row(&what, &format!("checked by {}", specimen.checked_by));
        let several = specimen.axes.len() > 1;
        for (index, axis) in specimen.axes.iter().enumerate() {
            if several {
                let of = if axis.is_empty() { ": none" } else { "" };
                table.row(&format!("  axis {}{of}", index + 1), "");
            } else if axis.is_empty() {
                table.row("  none", "only what is not a number trips");
            }
            for limit in axis {
                line(limit, table);
            }
        }
        table.row("  stale answers", &specimen.stale);
    }
    table.row("limits, test", "checked by this loop");
    for limit in &limits.test {
        line(limit, table);
    }
    table.row("  always", &limits.always.join(";\n"));
    table.row("a warning", "is an event in the log; the test goes on");
    table.row("a trip", &limits.on_trip);
}

fn line(limit: &Limit, table: &mut Table) {
    let level = |values: &[f64]| match values {
        [] => "-".to_owned(),
        [low, high] => format!("{} to {}", plain(*low), plain(*high)),
        sizes => sizes.iter().map(|size| plain(*size)).collect(),
    };
    let star = if limit.also_at_the_specimen { " *" } else { "" };
    table.row(
        &format!("  {}{star}", limit.key),
        &format!(
            "warns {:<20} trips {:<20} {}",
            level(&limit.warn),
            level(&limit.trip),
            limit.unit
        ),
    );
}

/// Without rows of zeros.
fn plain(value: f64) -> String {
    if value == 0.0 || (1e-3..1e7).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}
