//! The lines that a terminal shows while something runs: drawn over themselves, and removed before any other output.
//!
//! Plain ANSI, on stderr, and nothing at all without a terminal. Any other output (`tell`, the log) first removes the lines
//! with [`step_aside`]; the next drawing puts them below. The terminal cuts long lines and never wraps them, so that exactly
//! the drawn lines can be removed.

use std::ffi::OsStr;
use std::io::{self, IsTerminal};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::aside;

/// Number of drawn lines on the terminal.
static DRAWN: Mutex<usize> = Mutex::new(0);

fn drawn() -> MutexGuard<'static, usize> {
    DRAWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether there is a terminal to draw on.
pub fn is_there() -> bool {
    io::stderr().is_terminal()
}

/// Whether text may be coloured there: any value of `NO_COLOR` forbids it.
#[must_use]
pub fn in_colour() -> bool {
    is_there() && wants_colour(std::env::var_os("NO_COLOR").as_deref())
}

fn wants_colour(no_colour: Option<&OsStr>) -> bool {
    no_colour.is_none_or(OsStr::is_empty)
}

/// Columns and rows of the terminal; the historic size if it does not report one.
pub fn size() -> (usize, usize) {
    match rustix::termios::tcgetwinsize(io::stderr()) {
        Ok(size) if size.ws_col > 0 && size.ws_row > 0 => {
            (usize::from(size.ws_col), usize::from(size.ws_row))
        }
        _ => (80, 24),
    }
}

/// Draws `lines` where the last ones were.
pub fn draw(lines: &[String]) {
    let mut drawn = drawn();
    let text = over(*drawn, lines);
    *drawn = lines.len();
    aside::write(text.as_bytes());
}

/// Takes the lines away: something else is to be printed, or it is over.
pub fn step_aside() {
    let mut drawn = drawn();
    if *drawn > 0 {
        aside::write(over(*drawn, &[]).as_bytes());
        *drawn = 0;
    }
}

/// Text that draws `lines` over the `before` lines above the cursor.
fn over(before: usize, lines: &[String]) -> String {
    let mut text = String::new();
    if before > 0 {
        text.push_str(&format!("\r\x1b[{before}A"));
    }
    // No wrapping while we draw; old text is wiped line by line, which flickers less than all at once.
    text.push_str("\x1b[?7l");
    for line in lines {
        text.push_str(&format!("\r{line}\x1b[0m\x1b[K\n"));
    }
    text.push_str("\r\x1b[J\x1b[?7h");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_no_colour_value_disables_colour() {
        assert!(wants_colour(None) && wants_colour(Some(OsStr::new(""))));
        assert!(!wants_colour(Some(OsStr::new("1"))));
    }

    /// Rows of a terminal of 20 columns after `text`: it emulates only the codes that we send.
    fn shown(text: &str) -> Vec<String> {
        let (mut rows, mut row, mut column, mut wraps) = (vec![Vec::new()], 0, 0, true);
        let mut chars = text.chars().peekable();
        while let Some(c) = chars.next() {
            match c {
                '\r' => column = 0,
                '\n' => {
                    row += 1;
                    if row == rows.len() {
                        rows.push(Vec::new());
                    }
                }
                '\x1b' => {
                    assert_eq!(chars.next(), Some('['));
                    let mut code = String::new();
                    while let Some(c) = chars.next_if(|c| !c.is_ascii_alphabetic()) {
                        code.push(c);
                    }
                    match (code.as_str(), chars.next().unwrap()) {
                        (n, 'A') => row -= n.parse::<usize>().unwrap(),
                        ("", 'K') => rows[row].truncate(column),
                        ("", 'J') => {
                            rows[row].truncate(column);
                            rows.truncate(row + 1);
                        }
                        ("?7", 'l') => wraps = false,
                        ("?7", 'h') => wraps = true,
                        (_, 'm') => {}
                        other => panic!("{other:?}"),
                    }
                }
                c => {
                    if column == 20 {
                        assert!(!wraps, "a line wrapped");
                        continue;
                    }
                    let line: &mut Vec<char> = &mut rows[row];
                    line.resize(line.len().max(column + 1), ' ');
                    line[column] = c;
                    column += 1;
                }
            }
        }
        assert!(wraps, "the terminal still wraps lines");
        rows.into_iter()
            .map(|line| line.into_iter().collect())
            .collect()
    }

    fn lines(texts: &[&str]) -> Vec<String> {
        texts.iter().map(|text| (*text).to_owned()).collect()
    }

    #[test]
    fn lines_are_redrawn_and_removed_cleanly() {
        let first = over(
            0,
            &lines(&["one and something long that is cut", "two", "three"]),
        );
        let second = over(3, &lines(&["1", "2"]));
        assert_eq!(
            shown(&format!("before\n{first}")),
            ["before", "one and something lo", "two", "three", ""]
        );
        assert_eq!(
            shown(&format!("before\n{first}{second}")),
            ["before", "1", "2", ""]
        );
        let gone = over(2, &[]);
        assert_eq!(
            shown(&format!("before\n{first}{second}{gone}after\n")),
            ["before", "after", ""]
        );
    }
}
