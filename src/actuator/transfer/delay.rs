//! A pure delay of any length: commands that ramp from tick to tick, read a while ago.
//!
//! The command between two ticks is a straight line. So a delay of a fraction of a tick is a weighted mean of two commands,
//! exactly at each tick, and the next stage sees a straight line between two ticks again. The history lies on a grid of one
//! tick. A step of several ticks (commands were lost) fills it in. A step of a part of a tick (a hold ramp) continues from
//! the end of the last one.

use gusset_quantity::state::{Stateful, Visit};

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
    newest: usize,
    /// The command last committed, and how far it is beyond the newest entry: ticks of the grid, less than one.
    head: Motion,
    beyond: f64,
}

impl Delay {
    /// A delay of `seconds` with a history of `entries` commands, one per tick of `dt` s if that is known.
    pub(crate) fn new(seconds: f64, entries: usize, dt: Option<f64>) -> Self {
        let entries = if seconds > 0.0 { entries.max(4) } else { 0 };
        let mut delay = Self {
            seconds,
            grid: 0.0,
            whole: 0,
            share: 0.0,
            ring: vec![[0.0; 2]; entries],
            newest: 0,
            head: [0.0; 2],
            beyond: 0.0,
        };
        if let Some(dt) = dt {
            delay.lay_out(dt);
        }
        delay
    }

    /// True if commands pass unchanged.
    pub(crate) const fn is_none(&self) -> bool {
        self.ring.is_empty()
    }

    /// Begins with a specimen that has always been at `disp`.
    pub(crate) fn prime(&mut self, disp: f64) {
        self.ring.fill([disp, 0.0]);
        self.head = [disp, 0.0];
        self.beyond = 0.0;
    }

    /// Entry `back` ticks before the newest one.
    fn past(&self, back: usize) -> Motion {
        let n = self.ring.len();
        if back >= n {
            return [f64::NAN; 2];
        }
        let at = (self.newest + n - back) % n;
        self.ring.get(at).copied().unwrap_or([f64::NAN; 2])
    }

    /// The delayed command, `dt` after the last committed one, if `motion` is the newest. NaN where the history does not
    /// reach. Real-time: yes.
    pub(crate) fn trial(&mut self, motion: Motion, dt: f64) -> Motion {
        if self.is_none() {
            return motion;
        }
        if dt <= 0.0 {
            if self.beyond == 0.0 {
                return mix(self.past(self.whole), self.past(self.whole + 1), self.share);
            }
            return self.between(self.beyond, self.head);
        }
        match self.ticks(dt) {
            Some(ticks) => mix(
                self.at(self.whole, motion, ticks),
                self.at(self.whole + 1, motion, ticks),
                self.share,
            ),
            None => self.between(self.beyond + dt / self.grid, motion),
        }
    }

    /// Entry `back` ticks before `motion`, which is `ticks` after the newest entry.
    fn at(&self, back: usize, motion: Motion, ticks: usize) -> Motion {
        match back.checked_sub(ticks) {
            Some(back) => self.past(back),
            None => mix(motion, self.past(0), back as f64 / ticks as f64),
        }
    }

    /// The delayed command at the moment `end`, in ticks beyond the newest entry, if `motion` is the command of that
    /// moment.
    fn between(&self, end: f64, motion: Motion) -> Motion {
        let at = end - (self.whole as f64 + self.share);
        if at <= 0.0 {
            let whole = (-at).floor();
            return mix(
                self.past(whole as usize),
                self.past(whole as usize + 1),
                -at - whole,
            );
        }
        if at <= self.beyond {
            return mix(self.past(0), self.head, at / self.beyond);
        }
        mix(self.head, motion, (at - self.beyond) / (end - self.beyond))
    }

    /// `dt` in whole ticks of the grid, if it leads from entry to entry.
    fn ticks(&mut self, dt: f64) -> Option<usize> {
        if self.grid == 0.0 {
            self.lay_out(dt);
        }
        let ratio = dt / self.grid;
        let whole = ratio.round();
        let fits = self.beyond == 0.0
            && (1.0..=LONGEST as f64).contains(&whole)
            && (ratio - whole).abs() < SAME * whole;
        fits.then_some(whole as usize)
    }

    /// The grid becomes `dt`, or as much more as the history needs to reach back.
    fn lay_out(&mut self, dt: f64) {
        self.grid = match self.ring.len() {
            0 => dt,
            entries => dt.max(self.seconds / (entries - 3) as f64),
        };
        self.read_back();
    }

    /// How many ticks of the grid back the history is read.
    fn read_back(&mut self) {
        if self.grid <= 0.0 {
            (self.whole, self.share) = (0, 0.0);
            return;
        }
        let ticks = self.seconds / self.grid;
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

    fn push(&mut self, value: Motion) {
        self.newest = (self.newest + 1) % self.ring.len();
        if let Some(entry) = self.ring.get_mut(self.newest) {
            *entry = value;
        }
    }

    /// The command `motion`, `dt` after the last, is committed. Real-time: yes.
    pub(crate) fn commit(&mut self, motion: Motion, dt: f64) {
        if self.is_none() {
            return;
        }
        let last = std::mem::replace(&mut self.head, motion);
        if dt <= 0.0 {
            // A jump while test time stops.
            if self.beyond == 0.0
                && let Some(entry) = self.ring.get_mut(self.newest)
            {
                *entry = motion;
            }
            return;
        }
        if let Some(ticks) = self.ticks(dt) {
            let last = self.past(0);
            for k in 1..=ticks.min(self.ring.len()) {
                self.push(mix(last, motion, k as f64 / ticks as f64));
            }
            return;
        }
        // Part of a tick: passed entries are on the line from the last command to this one.
        let steps = dt / self.grid;
        let end = self.beyond + steps;
        let count = (end + SAME).floor();
        // However long it took: older commands than the history are not kept.
        for back in (0..(count as usize).min(self.ring.len())).rev() {
            let k = count - back as f64;
            self.push(mix(last, motion, ((k - self.beyond) / steps).min(1.0)));
        }
        self.beyond = (end - count).max(0.0);
        if self.beyond < SAME {
            self.beyond = 0.0;
        }
    }
}

impl Stateful for Delay {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        visit.part("delay");
        if self.is_none() {
            return;
        }
        let Self {
            seconds: _,
            grid,
            whole: _,
            share: _,
            ring,
            newest,
            head,
            beyond,
        } = self;
        grid.visit_state(visit);
        beyond.visit_state(visit);
        head.visit_state(visit);
        visit.index(newest, ring.len());
        ring.visit_state(visit);
        if visit.restores() {
            self.read_back();
        }
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
    use gusset_quantity::state::{Stateful, TestState};

    fn run(seconds: f64, dt: f64, n: usize, command: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut delay = Delay::new(seconds, 64, None);
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
    fn delays_are_exact_and_linear_in_between() {
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
    fn ramp_delay_is_exact_over_lost_ticks() {
        let mut delay = Delay::new(0.0105, 64, None);
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
    fn hold_ramp_is_delayed_equally() {
        // A history for the nominal tick alone, and steps of any part of it down to a thousandth.
        let dt = 1e-3;
        let mut delay = Delay::new(3.7e-3, 7, Some(dt));
        delay.prime(0.0);
        let mut t = 0.0;
        for k in 0..400 {
            let part = if k % 50 < 40 {
                1e-3 + 0.02 * f64::from(k % 50)
            } else {
                1.0
            };
            t += part * dt;
            let found = delay.trial([t, 1.0], part * dt)[0];
            delay.commit([t, 1.0], part * dt);
            let wanted = (t - 3.7e-3).max(0.0);
            // The corner at t = 0 is on the grid.
            assert!((found - wanted).abs() < 1e-12, "{k} {t}: {found} {wanted}");
            // Time stops.
            let still = delay.trial([t, 0.0], 0.0)[0];
            delay.commit([t, 1.0], 0.0);
            assert!((still - wanted).abs() < 1e-12, "{k} {t}: {still} {wanted}");
        }
    }

    #[test]
    fn a_step_of_any_length_ends() {
        for dt in [1e13, 1e300] {
            let mut delay = Delay::new(0.0105, 64, Some(1e-3));
            delay.prime(0.0);
            delay.commit([1.0, 0.0], 1e-3);
            assert!(delay.trial([2.0, 0.0], dt)[0].is_finite());
            delay.commit([2.0, 0.0], dt);
            delay.commit([2.0, 0.0], 1e-3);
            assert!(
                (delay.trial([2.0, 0.0], 1e-3)[0] - 2.0).abs() < 1e-12,
                "{dt}"
            );
        }
    }

    #[test]
    fn restored_history_has_the_same_bits() {
        let (mut one, mut two) = (Delay::new(0.0123, 40, None), Delay::new(0.0123, 40, None));
        one.prime(0.5);
        for k in 0..70 {
            one.commit([libm::sin(f64::from(k)), 1.0], 1e-3);
        }
        let state = TestState::of(|visit| one.visit_state(visit)).unwrap();
        state.restore(|visit| two.visit_state(visit)).unwrap();
        for k in 0..50 {
            let motion = [libm::cos(f64::from(k)), 0.0];
            assert_eq!(one.trial(motion, 1e-3), two.trial(motion, 1e-3));
            one.commit(motion, 1e-3);
            two.commit(motion, 1e-3);
        }
    }
}
