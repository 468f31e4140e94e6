//! Tables and numbers as a person reads them on a terminal.

use std::fmt;

use serde_json::Value;

use crate::config::printable;
use crate::record::Summary;
use crate::rt::timing::Quantity;

/// A titled table of two columns, with timing blocks.
pub struct Table {
    title: String,
    lines: Vec<(String, String)>,
}

impl Table {
    /// An empty table.
    pub fn new(title: &str) -> Self {
        Self {
            title: printable(title),
            lines: Vec::new(),
        }
    }

    /// One line.
    pub fn row(&mut self, what: &str, found: &str) {
        self.lines.push((printable(what), printable(found)));
    }

    /// The timing quantities of a run, in µs.
    pub fn timing(&mut self, timing: &Value) {
        self.row(
            "timing in µs",
            "     p50      p99    p99.9      max      count",
        );
        for quantity in Quantity::ALL {
            let Some(entry) = timing.get(quantity.key()) else {
                continue;
            };
            let number = |key: &str| entry.get(key).and_then(Value::as_f64).unwrap_or(0.0);
            if number("count") > 0.0 {
                let text = format!(
                    "{:8.3} {:8.3} {:8.3} {:8.1} {:10}",
                    number("p50"),
                    number("p99"),
                    number("p99_9"),
                    number("max"),
                    number("count")
                );
                self.row(&format!("  {}", quantity.key().replace('_', " ")), &text);
            }
        }
    }

    /// The deadline misses of a run, and their causes.
    pub fn misses(&mut self, summary: &Summary) {
        let mut found = summary.deadline_misses.to_string();
        if summary.deadline_misses > 0 {
            let of = &summary.miss_classes;
            // The loop waits for nobody: of very many misses some are counted, and their causes are lost before they are written.
            let untold = summary.deadline_misses.saturating_sub(of.total());
            let mut causes = vec![
                ("ours", of.ours),
                ("preempted", of.preempted),
                ("taken away", of.taken_away),
                ("late reply", of.late_reply),
            ];
            if untold > 0 {
                causes.push(("cause not told", untold));
            }
            let causes = causes
                .iter()
                .map(|(cause, count)| format!("{cause} {count}"));
            found.push_str(&format!(": {}", causes.collect::<Vec<_>>().join(", ")));
        }
        self.row("deadline misses", &found);
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = self
            .lines
            .iter()
            .map(|(what, _)| what.chars().count())
            .max()
            .unwrap_or(0);
        writeln!(f, "\n{}", self.title)?;
        writeln!(
            f,
            "{}",
            "─".repeat(self.title.chars().count().max(width + 2))
        )?;
        for (what, found) in &self.lines {
            let gap = " ".repeat(width - what.chars().count());
            let indent = format!("\n{}", " ".repeat(width + 2));
            writeln!(f, "{what}{gap}  {}", found.replace('\n', &indent))?;
        }
        Ok(())
    }
}

/// A quantity with a prefix that leaves one to three digits before the point.
pub fn quantity(value: f64, unit: &str) -> String {
    let size = value.abs();
    if !value.is_finite() || size == 0.0 {
        return format!("{value} {unit}");
    }
    let prefixes = [
        (1e9, "G"),
        (1e6, "M"),
        (1e3, "k"),
        (1.0, ""),
        (1e-3, "m"),
        (1e-6, "µ"),
        (1e-9, "n"),
    ];
    let (factor, prefix) = prefixes
        .into_iter()
        .find(|(factor, _)| size >= *factor)
        .unwrap_or((1e-9, "n"));
    format!("{:.4} {prefix}{unit}", value / factor)
}

/// A time with a fitting unit.
pub fn duration(seconds: f64) -> String {
    if seconds >= 1.0 || seconds == 0.0 {
        let text = format!("{seconds:.3}");
        format!("{} s", text.trim_end_matches('0').trim_end_matches('.'))
    } else {
        quantity(seconds, "s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_one_to_three_digits_before_the_point() {
        assert_eq!(quantity(0.0375, "m"), "37.5000 mm");
        assert_eq!(quantity(-123_456.0, "N"), "-123.4560 kN");
        assert_eq!(quantity(0.0, "m"), "0 m");
        assert_eq!(quantity(f64::NAN, "m"), "NaN m");
        assert_eq!(duration(20.0), "20 s");
        assert_eq!(duration(1.0 / 1024.0), "976.5625 µs");
    }

    #[test]
    fn lines_of_a_value_stay_in_its_column() {
        let mut table = Table::new("A test");
        table.row("one", "a\nb");
        assert!(table.to_string().contains("one  a\n     b\n"));
    }
}
