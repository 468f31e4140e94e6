//! Lines on stderr while something runs: remarks, the log, and the words of a panic. They never make their writer wait.

use std::fmt::Display;
use std::io::{self, Write};

use tracing::level_filters::LevelFilter;

use super::{aside, screen};
use gusset_quantity::text::printable;

/// A line on stderr while something runs.
pub fn remark(text: impl Display) {
    screen::step_aside();
    // Much of it comes from other machines.
    aside::write(printable(&format!("{text}\n")).as_bytes());
}

/// Begins the log: messages of this level and of graver ones go to stderr. Called once, before the command begins.
pub fn begin_log(level: LevelFilter) {
    // A log that cannot be written ends nothing: the subscriber would report the failure with a macro that panics, on the
    // thread that writes the rows.
    tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(|| Log)
        .with_ansi(screen::in_colour())
        .log_internal_errors(false)
        .with_target(false)
        .init();
}

/// The program's log. Its lines appear above the status line of the terminal.
#[derive(Debug)]
struct Log;

impl Write for Log {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        screen::step_aside();
        aside::write(spelled(line).as_bytes());
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A line of the log with hidden characters spelled. Its colours stay: the library spells escape characters in the logged
/// text.
fn spelled(line: &[u8]) -> String {
    let text = String::from_utf8_lossy(line);
    let parts = text.split('\u{1b}').map(printable);
    parts.collect::<Vec<_>>().join("\u{1b}")
}

/// A panic reports its place and reason, and its backtrace if `RUST_BACKTRACE` is set.
pub fn tell_panics() {
    std::panic::set_hook(Box::new(|panic| {
        let thread = std::thread::current();
        let name = thread.name().unwrap_or("without a name").to_owned();
        let from = std::backtrace::Backtrace::capture();
        let from = match from.status() {
            std::backtrace::BacktraceStatus::Captured => format!("\n{from}"),
            _ => String::new(),
        };
        remark(format_args!("thread '{name}' {panic}{from}"));
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_line_keeps_colours_and_text() {
        let line = "\u{1b}[33m WARN\u{1b}[0m \u{202e}gnp\u{200b}\n";
        let shown = "\u{1b}[33m WARN\u{1b}[0m \\u{202e}gnp\\u{200b}\n";
        assert_eq!(spelled(line.as_bytes()), shown);
    }
}
