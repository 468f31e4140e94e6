//! Progress of long work with the remaining time: on a terminal, and nowhere else.
//!
//! Two things take long: a test, which draws a [`ProgressLine`] from its first moment, and every other [`gusset_quantity::work::Work`],
//! which is shown once it has taken two seconds.
//!
//! Own code, and not `indicatif`: the bar is a line of the same screen as the state of a running test, and no further thread draws it
//! beside the loop.

use std::sync::{Mutex, PoisonError};

use super::drawn::bar;
use super::screen;
use gusset_quantity::work::{self, Watcher};
use gusset_record::Progress;
use gusset_record::rt::os::monotonic_ns;
use gusset_setup::Facts;

/// Work is shown once it has taken so long, in ns.
const PATIENCE_NS: u64 = 2_000_000_000;
/// Time between two drawings, in ns.
const EVERY_NS: u64 = 100_000_000;
/// Work that begins so soon after other work, in ns, continues it: a report reads its record several times.
const PAUSE_NS: u64 = 5_000_000_000;
/// Columns of a bar.
const BAR: usize = 30;

/// Shows long work from now on, if there is a terminal.
pub fn show_long_work() {
    static TERMINAL: Terminal = Terminal(Mutex::new(Course::new()));
    if screen::is_there() {
        work::watch(&TERMINAL);
    }
}

/// The terminal, with the course of the work that is shown there.
struct Terminal(Mutex<Course>);

impl Watcher for Terminal {
    fn done(&self, what: &str, count: u64, total: u64) {
        let mut course = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(line) = course.line(monotonic_ns(), what, count, total) {
            screen::draw(&[line]);
        }
    }

    fn end(&self) {
        let mut course = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if course.end(monotonic_ns()) {
            screen::step_aside();
        }
    }
}

/// When work began, and when its line was drawn.
struct Course {
    /// Start of the work, and its count then.
    begun: Option<(u64, u64)>,
    /// Start of the first of works that follow each other.
    busy_since_ns: u64,
    ended_ns: Option<u64>,
    drawn_ns: Option<u64>,
}

impl Course {
    const fn new() -> Self {
        Self {
            begun: None,
            busy_since_ns: 0,
            ended_ns: None,
            drawn_ns: None,
        }
    }

    /// The line to draw at `now_ns`, if it is time for one.
    fn line(&mut self, now_ns: u64, what: &str, count: u64, total: u64) -> Option<String> {
        let (began_ns, began_at) = match self.begun {
            Some(begun) => begun,
            None => {
                let ended = self.ended_ns.filter(|ended| now_ns - ended < PAUSE_NS);
                if ended.is_none() {
                    self.busy_since_ns = now_ns;
                }
                *self.begun.insert((now_ns, count))
            }
        };
        let is_long = now_ns.saturating_sub(self.busy_since_ns) >= PATIENCE_NS;
        let is_due = self
            .drawn_ns
            .is_none_or(|drawn| now_ns.saturating_sub(drawn) >= EVERY_NS);
        if !(is_long && is_due) {
            return None;
        }
        self.drawn_ns = Some(now_ns);
        let elapsed_s = now_ns.saturating_sub(began_ns) as f64 * 1e-9;
        let share = |count: u64| count as f64 / total.max(1) as f64;
        let remaining = and_remaining(
            share(count) - share(began_at),
            1.0 - share(count),
            elapsed_s,
        );
        Some(format!(
            "{} {:3.0} %  {what}{remaining}",
            bar(share(count), BAR),
            100.0 * share(count)
        ))
    }

    /// The work is over. True if a line of it is to be taken away.
    fn end(&mut self, now_ns: u64) -> bool {
        self.begun = None;
        self.ended_ns = Some(now_ns);
        self.drawn_ns.take().is_some()
    }
}

/// The remaining time in words, if a share of the work was done in `elapsed_s` and the share `left` remains. `None`
/// before a hundredth is done: an estimate would jump.
pub fn remaining(done: f64, left: f64, elapsed_s: f64) -> Option<String> {
    let is_known = done >= 0.01 && left.is_finite() && elapsed_s.is_finite();
    is_known.then(|| format!("about {} left", rounded(elapsed_s * left / done)))
}

/// The remaining time behind a comma, or nothing.
fn and_remaining(done: f64, left: f64, elapsed_s: f64) -> String {
    remaining(done, left, elapsed_s).map_or_else(String::new, |text| format!(", {text}"))
}

/// A time as a person estimates it: whole seconds, minutes or hours.
fn rounded(seconds: f64) -> String {
    match seconds.ceil().max(0.0) as u64 {
        seconds @ 0..=90 => format!("{seconds} s"),
        seconds @ 91..=5400 => format!("{} min", seconds.div_ceil(60)),
        seconds => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

/// One line with the progress of the test: on a terminal, and nowhere else.
pub struct ProgressLine {
    show: bool,
    duration: f64,
    rate_hz: f64,
    began_ns: u64,
}

impl ProgressLine {
    /// `wanted` is whether the user wants a line; it also needs a terminal.
    pub fn new(facts: &Facts, wanted: bool) -> Self {
        Self {
            show: wanted && screen::is_there(),
            duration: facts.steps as f64 * facts.dt,
            rate_hz: facts.rate_hz,
            began_ns: monotonic_ns(),
        }
    }

    /// Draws the line again.
    pub fn show(&self, progress: &Progress) {
        if self.show {
            let elapsed_s = monotonic_ns().saturating_sub(self.began_ns) as f64 * 1e-9;
            screen::draw(&[self.line(progress, elapsed_s)]);
        }
    }

    fn line(&self, progress: &Progress, elapsed_s: f64) -> String {
        // `time` is the fourth column of every row.
        let time = progress.last_row.get(3).copied().unwrap_or(0.0);
        let share = if self.duration > 0.0 {
            (time / self.duration).clamp(0.0, 1.0)
        } else {
            1.0
        };
        format!(
            "{} {time:7.2} of {:.2} s{}   {:.0} Hz   misses {}   rows lost {}",
            bar(share, BAR),
            self.duration,
            and_remaining(share, 1.0 - share, elapsed_s),
            self.rate_hz,
            progress.misses.total(),
            progress.rows_lost
        )
    }

    /// Takes the line away.
    pub fn clear(&self) {
        screen::step_aside();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    #[test]
    fn long_work_shows_its_remaining_time() {
        let mut course = Course::new();
        let start = 7 * SECOND;
        assert_eq!(course.line(start, "rehearsal", 0, 100), None);
        assert_eq!(
            course.line(start + 2 * SECOND - 1, "rehearsal", 19, 100),
            None
        );
        let line = course.line(start + 2 * SECOND, "rehearsal", 20, 100);
        let line = line.unwrap();
        assert!(line.ends_with(" 20 %  rehearsal, about 8 s left"), "{line}");
        // Not drawn more often than ten times a second.
        let soon = start + 2 * SECOND + EVERY_NS;
        assert_eq!(course.line(soon - 1, "rehearsal", 21, 100), None);
        assert!(course.line(soon, "rehearsal", 21, 100).is_some());
        assert!(course.end(soon), "its line is taken away");
    }

    #[test]
    fn short_work_leaves_the_terminal_alone() {
        let mut course = Course::new();
        assert_eq!(course.line(0, "export", 0, 2), None);
        assert_eq!(course.line(SECOND, "export", 1, 2), None);
        assert!(!course.end(SECOND));
        // Other work, much later, is hidden for its first two seconds.
        assert_eq!(course.line(9 * SECOND, "export", 0, 2), None);
        assert_eq!(course.line(10 * SECOND, "export", 1, 2), None);
    }

    #[test]
    fn consecutive_works_count_as_one() {
        let mut course = Course::new();
        for start in [0, SECOND] {
            assert_eq!(course.line(start, "reading", 0, 10), None);
            assert_eq!(course.line(start + SECOND - 1, "reading", 9, 10), None);
            assert!(!course.end(start + SECOND - 1));
        }
        assert!(course.line(2 * SECOND, "reading", 0, 10).is_some());
    }

    #[test]
    fn remaining_time_is_rounded_for_people() {
        assert_eq!(and_remaining(0.0, 1.0, 5.0), "");
        assert_eq!(and_remaining(0.5, 0.5, 12.3), ", about 13 s left");
        assert_eq!(rounded(100.0), "2 min");
        assert_eq!(rounded(7300.0), "2 h 1 min");
    }
}
