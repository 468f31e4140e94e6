//! Ticks that were due while the loop was stalled, and that the grid was moved past: found again from the column `stretched`, with
//! how late each was. The loop counts them with the ticks that were made, or a stall would be one late tick among many good ones.

/// Ticks in a row that were swallowed: the first is a tick less late than this many s, the next two ticks less, and so on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stall {
    pub late_s: f64,
    pub ticks: u64,
}

/// What the rows have told so far.
#[derive(Debug)]
pub(super) struct Swallowed {
    tick_s: f64,
    /// The column `stretched` of the last row.
    stretched: f64,
    /// Ticks that the grid was moved by when that row's tick began.
    at_its_wake: u64,
}

impl Swallowed {
    pub const fn new(tick_s: f64) -> Self {
        Self {
            tick_s,
            stretched: 0.0,
            at_its_wake: 0,
        }
    }

    /// What was swallowed behind the tick before, which was over `taken` s after its edge, and before this one, which woke
    /// `late_s` after its own.
    pub fn row(&mut self, taken: Option<f64>, late_s: f64, stretched: f64) -> [Stall; 2] {
        let moved = stretched - self.stretched;
        if stretched.is_finite() {
            self.stretched = stretched;
        }
        // No number makes none.
        let moved = moved.max(0.0) as u64;
        let taken = taken.unwrap_or(f64::NAN) - self.at_its_wake as f64 * self.tick_s;
        let behind = if late_s < self.tick_s {
            moved
        } else {
            moved.min((taken / self.tick_s - 1.0).max(0.0) as u64)
        };
        self.at_its_wake = moved - behind;
        let stall = |late_s, ticks| Stall { late_s, ticks };
        [stall(taken, behind), stall(late_s, self.at_its_wake)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stall_is_told_behind_the_tick_it_came_in_or_before_the_one_that_woke_late() {
        let mut swallowed = Swallowed::new(1e-3);
        let mut row = |taken, late_s, stretched| {
            let found = swallowed.row(taken, late_s, stretched);
            found.map(|Stall { late_s, ticks }| (ticks > 0).then_some((late_s, ticks)))
        };
        assert_eq!(row(None, 1e-5, 0.0), [None, None]);
        assert_eq!(row(Some(5e-4), 3.5e-3, 3.0), [None, Some((3.5e-3, 3))]);
        // The tick that woke late went past three edges already.
        assert_eq!(row(Some(6e-3), 1e-5, 5.0), [Some((3e-3, 2)), None]);
        let both = row(Some(4.5e-3), 2.25e-3, 10.0);
        assert_eq!(both, [Some((4.5e-3, 3)), Some((2.25e-3, 2))]);
        assert_eq!(row(Some(4.5e-3), 1e-5, f64::NAN), [None, None]);
        assert_eq!(row(Some(5e-4), 1e-5, 10.0), [None, None]);
    }
}
