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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_a_value_stay_in_its_column() {
        let mut table = Table::new("A test");
        table.row("one", "a\nb");
        assert!(table.to_string().contains("one  a\n     b\n"));
    }
}
