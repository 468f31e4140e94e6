//! Progress lines: on a terminal, and nowhere else.

use std::io::IsTerminal;
use std::sync::Mutex;

use super::{aside, screen};
use crate::config::Facts;
use crate::record::Progress;

/// One line that tells how far the test is: on a terminal, and nowhere else.
pub struct ProgressLine {
    show: bool,
    duration: f64,
    rate_hz: f64,
}

impl ProgressLine {
    /// `wanted` is whether the user wants one; it also takes a terminal.
    pub fn new(facts: &Facts, wanted: bool) -> Self {
        let show = wanted && screen::is_there();
        let duration = facts.steps as f64 * facts.dt;
        Self {
            show,
            duration,
            rate_hz: facts.rate_hz,
        }
    }

    /// Draws the line anew.
    pub fn show(&self, progress: &Progress) {
        if !self.show {
            return;
        }
        // `time` is the fourth column of every row.
        let time = progress.last_row.get(3).copied().unwrap_or(0.0);
        let share = if self.duration > 0.0 {
            (time / self.duration).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let filled = (share * 30.0) as usize;
        let bar: String = (0..30)
            .map(|i| if i < filled { '█' } else { '·' })
            .collect();
        let misses = progress.misses.total();
        screen::draw(&[format!(
            "{bar} {time:7.2} of {:.2} s   {:.0} Hz   misses {misses}   rows lost {}",
            self.duration, self.rate_hz, progress.rows_lost
        )]);
    }

    /// Takes the line away.
    pub fn clear(&self) {
        screen::step_aside();
    }
}

/// How many trials are done: on a terminal, and nowhere else.
pub struct TrialsLine {
    of: u64,
    show: bool,
    drawn: Mutex<u64>,
}

impl TrialsLine {
    /// Of so many trials.
    pub fn new(of: u64) -> Self {
        Self {
            of,
            show: std::io::stderr().is_terminal(),
            drawn: Mutex::new(0),
        }
    }

    /// Workers finish in any order: the line never goes back.
    pub fn show(&self, done: u64) {
        if !self.show {
            return;
        }
        let Ok(mut drawn) = self.drawn.lock() else {
            return;
        };
        if done > *drawn {
            *drawn = done;
            let filled = (done * 30 / self.of.max(1)) as usize;
            let bar: String = (0..30)
                .map(|i| if i < filled { '█' } else { '·' })
                .collect();
            aside::write(format!("\r\x1b[2K{bar} trial {done} of {}", self.of).as_bytes());
        }
    }

    /// Takes the line away.
    pub fn clear(&self) {
        if self.show {
            aside::write(b"\r\x1b[2K");
        }
    }
}
