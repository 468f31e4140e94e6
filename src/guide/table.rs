//! A table for a terminal: columns as wide as their cells, narrower where the terminal is too narrow.
//!
//! Own code, and not `comfy-table`: a cell has marks of the page's text (code, emphasis, links), which are wrapped with it.

use super::inline::{width_of, wrapped};

/// Blanks between two columns.
const GAP: usize = 2;
/// A column is not made narrower than this, nor than its longest word.
const NARROWEST: usize = 5;

/// Rows of cells; the first row is the head.
#[derive(Debug, Default)]
pub(super) struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    pub fn row(&mut self) {
        self.rows.push(Vec::new());
    }

    pub fn cell(&mut self, text: String) {
        if let Some(row) = self.rows.last_mut() {
            row.push(text);
        }
    }

    /// The lines of the table, at most `width` characters wide where the words allow it.
    pub fn lines(&self, width: usize) -> Vec<String> {
        let widths = self.widths(width);
        let mut lines = Vec::new();
        for (index, row) in self.rows.iter().enumerate() {
            let cells: Vec<Vec<String>> = row
                .iter()
                .zip(&widths)
                .map(|(cell, width)| wrapped(cell, *width))
                .collect();
            let height = cells.iter().map(Vec::len).max().unwrap_or(0);
            for at in 0..height {
                let mut line = String::new();
                for (cell, width) in cells.iter().zip(&widths) {
                    let part = cell.get(at).map_or("", String::as_str);
                    line.push_str(part);
                    let blanks = (width + GAP).saturating_sub(width_of(part));
                    line.extend(std::iter::repeat_n(' ', blanks));
                }
                lines.push(line.trim_end().to_owned());
            }
            if index == 0 {
                let rules: Vec<String> = widths.iter().map(|width| "-".repeat(*width)).collect();
                lines.push(rules.join(&" ".repeat(GAP)));
            }
        }
        lines
    }

    /// The width of every column: that of its widest cell, and then the widest columns give until the table fits.
    fn widths(&self, width: usize) -> Vec<usize> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let widest = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| width_of(cell)).max().unwrap_or(0)
        };
        let mut widths: Vec<usize> = (0..columns).map(widest).collect();
        let room = width.saturating_sub(GAP * columns.saturating_sub(1));
        let longest_word = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            let words = cells.flat_map(|cell| cell.split_whitespace());
            words.map(width_of).max().unwrap_or(0)
        };
        let least: Vec<usize> = (0..columns)
            .map(|column| longest_word(column).max(NARROWEST))
            .collect();
        while widths.iter().sum::<usize>() > room {
            let wide = widths.iter_mut().zip(&least);
            let widest = wide.filter(|(width, least)| **width > **least).max();
            match widest {
                Some((width, _)) => *width -= 1,
                None => break,
            }
        }
        widths
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[[&str; 2]]) -> Table {
        let mut table = Table::default();
        for row in rows {
            table.row();
            for cell in row {
                table.cell((*cell).to_owned());
            }
        }
        table
    }

    #[test]
    fn columns_align_and_the_head_is_underlined() {
        let lines = table(&[["file", "content"], ["samples.bin", "rows"]]).lines(60);
        assert_eq!(
            lines,
            [
                "file         content",
                "-----------  -------",
                "samples.bin  rows"
            ]
        );
    }

    #[test]
    fn columns_hold_their_longest_word() {
        let rows = [
            ["key", "meaning of it"],
            ["command_disp_m", "a b c d e f g h"],
        ];
        let lines = table(&rows).lines(12);
        assert!(
            lines.iter().any(|line| line.contains("command_disp_m  a")),
            "{lines:?}"
        );
    }

    #[test]
    fn the_widest_column_gives_way() {
        let lines = table(&[["key", "meaning"], ["a", "one two three four five six"]]).lines(20);
        assert!(lines.iter().all(|line| width_of(line) <= 20), "{lines:?}");
        assert_eq!(lines.len(), 4);
    }
}
