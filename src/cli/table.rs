//! Tables and numbers as a person reads them on a terminal.
//!
//! Own code, and not `comfy-table`: a table has values that are wrapped and commands that must not be, and its second column is as wide
//! as the terminal leaves it.

use std::fmt;

use gusset_config::printable;
use gusset_record::Summary;
use gusset_record::rt::timing::{Quantity, Timings};

/// Columns of a terminal that the pages of the commands fit into.
pub const COLUMNS: usize = 100;
/// Widest first column of a table that is wrapped. A longer name has a separate line.
const WIDEST_NAME: usize = 28;

/// One entry of a table.
enum Entry {
    /// A name and its value, in two columns.
    Row(String, String),
    /// A line across both columns.
    Line(String),
    /// A line that is never broken.
    Verbatim(String),
}

/// A titled table of two columns, with timing blocks.
pub struct Table {
    title: String,
    entries: Vec<Entry>,
    /// Columns that it must fit into; none: it is as wide as its values.
    width: Option<usize>,
}

impl Table {
    /// An empty table.
    pub fn new(title: &str) -> Self {
        Self {
            title: printable(title),
            entries: Vec::new(),
            width: None,
        }
    }

    /// An empty table that wraps its values, so that no line is wider than a terminal.
    pub fn wrapped(title: &str) -> Self {
        Self {
            width: Some(COLUMNS),
            ..Self::new(title)
        }
    }

    /// One line.
    pub fn row(&mut self, what: &str, found: &str) {
        let entry = Entry::Row(printable(what), printable(found));
        self.entries.push(entry);
    }

    /// A line across both columns. It is wrapped only if it is too wide, and then indented.
    pub fn line(&mut self, text: &str) {
        self.entries.push(Entry::Line(printable(text)));
    }

    /// A line that is never broken, such as a command to copy.
    pub fn verbatim(&mut self, text: &str) {
        self.entries.push(Entry::Verbatim(printable(text)));
    }

    /// The timing quantities of a run, in µs.
    pub fn timing(&mut self, timing: &Timings) {
        self.row(
            "timing in µs",
            "     p50      p99    p99.9      max      count",
        );
        for quantity in Quantity::ALL {
            let found = timing.percentiles(quantity);
            if found.count > 0 {
                let text = format!(
                    "{:8.3} {:8.3} {:8.3} {:8.1} {:10}",
                    found.p50, found.p99, found.p99_9, found.max, found.count
                );
                self.row(&format!("  {}", quantity.key().replace('_', " ")), &text);
            }
        }
    }

    /// The deadline misses of a run, and their causes.
    pub fn misses(&mut self, summary: &Summary) {
        self.row("deadline misses", &misses(summary));
    }
}

/// The deadline misses of a run in words, with their causes.
pub fn misses(summary: &Summary) -> String {
    let mut found = summary.deadline_misses.to_string();
    if summary.deadline_misses > 0 {
        let of = &summary.miss_classes;
        // The loop never waits for the writer. Of very many misses some are counted without their causes.
        let untold = summary.deadline_misses.saturating_sub(of.total());
        let mut of = *of;
        of.unknown += untold;
        let causes = of.each().into_iter().filter(|(_, count)| *count > 0);
        let causes = causes.map(|(cause, count)| format!("{} {count}", cause.words()));
        found.push_str(&format!(": {}", causes.collect::<Vec<_>>().join(", ")));
    }
    found
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let most = self.width.unwrap_or(usize::MAX);
        let widest_name = self.width.map_or(usize::MAX, |_| WIDEST_NAME);
        let names = self.entries.iter().filter_map(|entry| match entry {
            Entry::Row(name, _) => Some(columns(name)),
            Entry::Line(_) | Entry::Verbatim(_) => None,
        });
        let width = names
            .filter(|width| *width <= widest_name)
            .max()
            .unwrap_or(0);
        let title = wrap(&self.title, most);
        writeln!(f, "\n{}", title.join("\n"))?;
        let rule = title.iter().map(|line| columns(line)).max().unwrap_or(0);
        writeln!(f, "{}", "─".repeat(rule.max(width + 2)))?;
        for entry in &self.entries {
            match entry {
                Entry::Row(name, value) => {
                    let mut lead = format!(
                        "{name}{}",
                        " ".repeat(width.saturating_sub(columns(name)) + 2)
                    );
                    if columns(name) > width {
                        writeln!(f, "{name}")?;
                        lead = " ".repeat(width + 2);
                    }
                    let value = value.split('\n');
                    for line in value.flat_map(|line| wrap(line, most.saturating_sub(width + 2))) {
                        writeln!(f, "{}", format!("{lead}{line}").trim_end())?;
                        lead = " ".repeat(width + 2);
                    }
                }
                Entry::Verbatim(text) => writeln!(f, "{text}")?,
                Entry::Line(text) => {
                    let mut indent = "";
                    for line in wrap(text, most.saturating_sub(4)) {
                        writeln!(f, "{indent}{line}")?;
                        indent = "    ";
                    }
                }
            }
        }
        Ok(())
    }
}

fn columns(text: &str) -> usize {
    text.chars().count()
}

/// `text` in lines of at most `most` columns, broken at spaces. A longer word, such as a path, is broken only
/// if it does not fit into one line.
fn wrap(text: &str, most: usize) -> Vec<String> {
    let most = most.max(8);
    if columns(text) <= most {
        return vec![text.to_owned()];
    }
    let mut lines = Vec::new();
    let mut line = String::new();
    for word in text.split_inclusive(' ') {
        if columns(&line) + columns(word.trim_end()) > most && !line.trim().is_empty() {
            lines.push(std::mem::take(&mut line).trim_end().to_owned());
        }
        for letter in word.chars() {
            if columns(&line) == most && letter != ' ' {
                lines.push(std::mem::take(&mut line));
            }
            line.push(letter);
        }
    }
    if !line.trim().is_empty() {
        lines.push(line.trim_end().to_owned());
    }
    lines
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

    #[test]
    fn wrapped_table_keeps_words_and_width() {
        let mut table = Table::wrapped(&"title ".repeat(40));
        let value = "word ".repeat(60);
        table.row("name", &value);
        table.row(&"n".repeat(40), "short");
        table.row("path", &"p".repeat(250));
        table.line(&"line ".repeat(60));
        let text = table.to_string();
        assert!(
            text.lines().all(|line| line.chars().count() <= COLUMNS),
            "{text}"
        );
        for (word, count) in [("word", 60), ("title", 40), ("line", 60), ("p", 251)] {
            assert_eq!(text.matches(word).count(), count, "{word}: {text}");
        }
        assert!(
            text.contains(&format!("\n{}\n      short\n", "n".repeat(40))),
            "{text}"
        );
    }
}
