//! A pure delay of any length: commands that ramp from tick to tick, read a while ago.
//!
//! The command between two ticks is a straight line, so that a delay of a fraction of a tick is a weighted mean of two
//! commands, exactly at each tick; what follows sees a straight line between two ticks again. The history stands on a grid of one tick; a step of several ticks (commands were lost on the way)
//! fills it in, another tick lays it out anew.

/// Longest history in ticks.
pub const LONGEST: usize = 8192;

/// Displacement and velocity.
type Motion = [f64; 2];

/// Steps that differ by less are whole numbers of each other.
const SAME: f64 = 1e-9;

/// A history of commands, and the moment at which it is read.
#[derive(Debug, Clone)]
pub(super) struct Delay {
    seconds: f64,
    /// Test time from one entry to the next; 0 until it is known.
    grid: f64,
    whole: usize,
    share: f64,
    ring: Vec<Motion>,
    spare: Vec<Motion>,
    newest: usize,
}

impl Delay {
    /// A delay of `seconds` with a history of `entries` commands.
    pub fn new(seconds: f64, entries: usize) -> Self {
        let entries = if seconds > 0.0 { entries.max(2) } else { 0 };
        Self {
            seconds,
            grid: 0.0,
            whole: 0,
            share: 0.0,
            ring: vec![[0.0; 2]; entries],
            spare: vec![[0.0; 2]; entries],
            newest: 0,
        }
    }

    /// True if commands pass unchanged.
    pub const fn is_none(&self) -> bool {
        self.ring.is_empty()
    }

    /// The specimen has always stood at `disp`.
    pub fn prime(&mut self, disp: f64) {
        self.ring.fill([disp, 0.0]);
    }

    /// Entry `back` ticks before the newest committed one.
    fn past(&self, back: usize) -> Motion {
        let n = self.ring.len();
        if back >= n {
            return [f64::NAN; 2];
        }
        let at = (self.newest + n - back) % n;
        self.ring.get(at).copied().unwrap_or([f64::NAN; 2])
    }

    /// What arrives now, `dt` after the last committed command, if `motion` is the newest command. Not a number where the
    /// history does not reach. Real-time: yes; a new `dt` costs one pass over the history.
    pub fn trial(&mut self, motion: Motion, dt: f64) -> Motion {
        if self.is_none() {
            return motion;
        }
        if dt <= 0.0 {
            return mix(self.past(self.whole), self.past(self.whole + 1), self.share);
        }
        let ticks = self.ticks(dt);
        mix(
            self.at(self.whole, motion, ticks),
            self.at(self.whole + 1, motion, ticks),
            self.share,
        )
    }

    /// Entry `back` ticks before `motion`, which is `ticks` after the newest committed one.
    fn at(&self, back: usize, motion: Motion, ticks: usize) -> Motion {
        match back.checked_sub(ticks) {
            Some(back) => self.past(back),
            None => mix(motion, self.past(0), back as f64 / ticks as f64),
        }
    }

    /// `dt` in ticks of the grid.
    fn ticks(&mut self, dt: f64) -> usize {
        if self.grid > 0.0 {
            let ratio = dt / self.grid;
            let whole = ratio.round();
            if (1.0..=LONGEST as f64).contains(&whole) && (ratio - whole).abs() < SAME * whole {
                return whole as usize;
            }
        }
        self.lay_out(dt);
        1
    }

    /// The grid becomes `dt`.
    fn lay_out(&mut self, dt: f64) {
        if self.grid > 0.0 {
            let ratio = dt / self.grid;
            let last = self.ring.len().saturating_sub(1);
            let fresh: usize = self.spare.len();
            for back in 0..fresh {
                let place = back as f64 * ratio;
                let whole = (place.floor() as usize).min(last);
                let share = if whole == last {
                    0.0
                } else {
                    place - place.floor()
                };
                let value = mix(self.past(whole), self.past((whole + 1).min(last)), share);
                if let Some(entry) = self.spare.get_mut(fresh - 1 - back) {
                    *entry = value;
                }
            }
            std::mem::swap(&mut self.ring, &mut self.spare);
            self.newest = self.ring.len() - 1;
        }
        self.grid = dt;
        let ticks = self.seconds / dt;
        // A whole number of ticks, but for roundoff, is a whole number of ticks.
        let near = ticks.round();
        let ticks = if (ticks - near).abs() < SAME * near.max(1.0) {
            near
        } else {
            ticks
        };
        self.whole = ticks.floor() as usize;
        self.share = ticks - ticks.floor();
    }

    /// The command `motion`, `dt` after the last, is committed. Real-time: yes.
    pub fn commit(&mut self, motion: Motion, dt: f64) {
        if self.is_none() {
            return;
        }
        if dt <= 0.0 {
            // A jump while test time stands still.
            if let Some(entry) = self.ring.get_mut(self.newest) {
                *entry = motion;
            }
            return;
        }
        let ticks = self.ticks(dt);
        let last = self.past(0);
        for k in 1..=ticks.min(self.ring.len()) {
            let value = mix(last, motion, k as f64 / ticks as f64);
            self.newest = (self.newest + 1) % self.ring.len();
            if let Some(entry) = self.ring.get_mut(self.newest) {
                *entry = value;
            }
        }
    }

    /// Appends the history.
    pub fn freeze(&self, out: &mut Vec<f64>) {
        if !self.is_none() {
            out.push(self.grid);
            for back in 0..self.ring.len() {
                out.extend(self.past(back));
            }
        }
    }

    /// Takes the history back.
    pub fn thaw<'a>(&mut self, from: &'a [f64]) -> &'a [f64] {
        if self.is_none() {
            return from;
        }
        let n = self.ring.len();
        let Some(((grid, history), rest)) = from
            .split_first()
            .and_then(|(grid, rest)| Some((rest.split_at_checked(2 * n)?, grid)))
            .map(|((history, rest), grid)| ((grid, history), rest))
        else {
            return from;
        };
        self.grid = 0.0;
        if *grid > 0.0 {
            self.lay_out(*grid);
        }
        self.newest = n - 1;
        for (back, pair) in history.chunks_exact(2).enumerate() {
            if let (Some(entry), [disp, vel]) = (self.ring.get_mut(n - 1 - back), pair) {
                *entry = [*disp, *vel];
            }
        }
        rest
    }
}

/// (1 − share) · a + share · b, and a itself for share 0.
fn mix(a: Motion, b: Motion, share: f64) -> Motion {
    if share == 0.0 {
        return a;
    }
    [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(seconds: f64, dt: f64, n: usize, command: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut delay = Delay::new(seconds, 64);
        delay.prime(command(0.0));
        let mut out = vec![];
        for k in 1..=n {
            let motion = [command(k as f64 * dt), 0.0];
            out.push(delay.trial(motion, dt)[0]);
            delay.commit(motion, dt);
        }
        out
    }

    #[test]
    fn whole_delays_give_the_very_commands_and_fractions_their_straight_line() {
        let dt = 1.0 / 4096.0;
        let command = |t: f64| libm::sin(200.0 * t);
        for ticks in [1.0, 7.0, 0.0, 3.25, 0.5] {
            let found = run(ticks * dt, dt, 40, command);
            for (k, found) in found.iter().enumerate() {
                let place = (k as f64 + 1.0 - ticks).max(0.0);
                let (low, share) = (place.floor(), place - place.floor());
                let wanted = (1.0 - share) * command(low * dt) + share * command((low + 1.0) * dt);
                let slack = if share == 0.0 { 0.0 } else { 1e-15 };
                assert!(
                    (found - wanted).abs() <= slack,
                    "{ticks} {k}: {found} {wanted}"
                );
            }
        }
    }

    #[test]
    fn a_ramp_is_delayed_exactly_over_lost_ticks_and_another_grid() {
        let mut delay = Delay::new(0.0105, 64);
        delay.prime(0.0);
        let mut t = 0.0;
        for k in 0..60 {
            let dt = [1e-3, 1e-3, 3e-3, 1e-3, 2e-3, 0.7e-3][k % 6];
            t += dt;
            let found = delay.trial([t, 1.0], dt)[0];
            assert_eq!(
                found,
                delay.trial([t, 1.0], dt)[0],
                "a trial leaves no trace"
            );
            delay.commit([t, 1.0], dt);
            // The corner at t = 0 is passed once the history is of one grid after it.
            if t > 0.025 {
                assert!((found - (t - 0.0105)).abs() < 1e-9, "{t}: {found}");
            }
        }
    }

    #[test]
    fn a_frozen_history_goes_on_with_the_same_bits() {
        let (mut one, mut two) = (Delay::new(0.0123, 40), Delay::new(0.0123, 40));
        one.prime(0.5);
        for k in 0..70 {
            one.commit([f64::from(k).sin(), 1.0], 1e-3);
        }
        let mut frozen = vec![];
        one.freeze(&mut frozen);
        frozen.push(9.0);
        assert_eq!(two.thaw(&frozen), [9.0]);
        for k in 0..50 {
            let motion = [f64::from(k).cos(), 0.0];
            assert_eq!(one.trial(motion, 1e-3), two.trial(motion, 1e-3));
            one.commit(motion, 1e-3);
            two.commit(motion, 1e-3);
        }
    }
}
