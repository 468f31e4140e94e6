//! The progress line of a measurement of the loop: on a terminal, and nowhere else.

use super::screen;
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
