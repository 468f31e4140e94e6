//! The pacer of targets that come at irregular times: how far a command is on its way, and how fast it goes, while the next target is
//! computed elsewhere.
//!
//! The progress i runs from 0 at the last target to N at the next. At full pace it grows by 1 a tick. While the next target is not known,
//! the pace falls from the last tick before `slow_at` on, and is 0 at `slow_until`. When the target comes, the pace rises again, and is
//! the full one at the target, which is met at a tick. Each change is a quintic in time: progress, pace and the change of the pace are
//! continuous. With W ticks from `slow_at` to `slow_until`, a fall takes 2 W ticks, and the pace changes by at most 3/(4 W) a tick. A rise
//! takes the fewest whole ticks in which it changes by at most 1/W, or 1/(N − `slow_until`) where that is larger. Where a fall has nearly
//! ended, such a rise does not exist: the fall ends first. Limits: no input or output and no clock; the caller's calls count
//! the ticks.

use super::step_pacer::PacerTick;
use gusset_quantity::catalog::phase::Stage;

/// Share of a tick within which two places are one.
const ON_GRID: f64 = 1e-9;
/// Places of a rise at which its pace is looked at.
const LOOKS: u32 = 24;
/// Factor for its change between those places.
const BETWEEN_LOOKS: f64 = 1.02;
/// Bound of the change of a change, in parts of the square of the steepest change.
const SHARPEST: f64 = 7.0;
/// Times that a rise may take, in parts of that with a steady change, and how many are tried.
const SHORTEST: f64 = 0.9;
const LONGEST: f64 = 1.7;
const MOST_RISES: u32 = 64;

/// Shares of a step at which it slows down and rests without a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowDown {
    /// Ticks of a step.
    pub ticks: u32,
    /// It slows down from here on.
    pub at: f64,
    /// It rests here.
    pub until: f64,
}

impl SlowDown {
    /// W: ticks of full pace from where it slows down to where it rests.
    #[must_use]
    pub fn width(&self) -> f64 {
        (self.until - self.at) * f64::from(self.ticks)
    }

    /// Most by which that change itself changes in a tick.
    #[must_use]
    pub fn sharpest(&self) -> f64 {
        SHARPEST * self.steepest() * self.steepest()
    }

    /// Most by which the pace changes in a tick, of a full pace of 1 tick a tick.
    #[must_use]
    pub fn steepest(&self) -> f64 {
        BETWEEN_LOOKS / self.width().min((1.0 - self.until) * f64::from(self.ticks))
    }
}

/// Progress, pace, and the change of the pace in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Point {
    progress: f64,
    pace: f64,
    change: f64,
}

/// A change of the pace: a quintic that ends without a change.
#[derive(Debug, Clone, Copy)]
struct Turn {
    from: Point,
    /// Coefficients of u³, u⁴ and u⁵ of the progress.
    bends: [f64; 3],
    to: Point,
    ticks: u32,
    tick: u32,
}

impl Turn {
    fn new(from: Point, to: Point, ticks: u32) -> Self {
        let m = f64::from(ticks);
        let (v, a, w) = (from.pace * m, from.change * m * m, to.pace * m);
        let way = to.progress - from.progress;
        let bends = [
            10.0 * way - 6.0 * v - 4.0 * w - 1.5 * a,
            -15.0 * way + 8.0 * v + 7.0 * w + 1.5 * a,
            6.0 * way - 3.0 * v - 3.0 * w - 0.5 * a,
        ];
        Self {
            from,
            bends,
            to,
            ticks,
            tick: 0,
        }
    }

    /// At a share of its time.
    fn at(&self, u: f64) -> Point {
        let m = f64::from(self.ticks);
        let (v, a) = (self.from.pace * m, self.from.change * m * m);
        let [c, d, e] = self.bends;
        let progress = u * (v + u * (0.5 * a + u * (c + u * (d + u * e))));
        let pace = v + u * (a + u * (3.0 * c + u * (4.0 * d + u * 5.0 * e)));
        let change = a + u * (6.0 * c + u * (12.0 * d + u * 20.0 * e));
        Point {
            progress: self.from.progress + progress,
            pace: pace / m,
            change: change / (m * m),
        }
    }

    fn now(&self) -> Point {
        if self.is_over() {
            self.to
        } else {
            self.at(f64::from(self.tick) / f64::from(self.ticks))
        }
    }

    const fn is_over(&self) -> bool {
        self.tick >= self.ticks
    }

    /// The pace is never below 0 or above 1, and changes by at most `steepest` a tick.
    fn is_within(&self, steepest: f64) -> bool {
        // Closer at first: what falls may be near rest.
        let even = (0..=LOOKS).map(|look| f64::from(look) / f64::from(LOOKS));
        even.clone().map(|u| u * u).chain(even).all(|u| {
            let point = self.at(u);
            point.pace >= -ON_GRID
                && point.pace <= 1.0 + ON_GRID
                && point.change.abs() * BETWEEN_LOOKS <= steepest
        })
    }
}

/// Progress and pace.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LatePacer {
    slow: SlowDown,
    now: Point,
    turn: Option<Turn>,
    known: bool,
    /// No further target will come.
    ends: bool,
}

impl LatePacer {
    /// At the first target, at full pace.
    pub(crate) fn new(slow: SlowDown) -> Self {
        Self {
            slow,
            now: Point {
                pace: 1.0,
                ..Point::default()
            },
            turn: None,
            known: false,
            ends: false,
        }
    }

    fn ticks(&self) -> f64 {
        f64::from(self.slow.ticks)
    }

    /// Share of the step that is made. Real-time: yes.
    pub(crate) fn share(&self) -> f64 {
        self.now.progress / self.ticks()
    }

    /// Share of a step at which a fall that begins now ends. Real-time: yes.
    pub(crate) fn rests_at(&self) -> f64 {
        let turn = self.turn.filter(|_| !self.known);
        let rests = turn.map_or(self.now.progress + self.slow.width(), |turn| {
            turn.to.progress
        });
        rests / self.ticks()
    }

    /// True if nothing moves before the next target is known. Real-time: yes.
    pub(crate) fn stands(&self) -> bool {
        self.now.pace <= 0.0
            && self
                .turn
                .is_none_or(|turn| turn.to.pace == 0.0 && turn.is_over())
    }

    /// True if the next target is known. Real-time: yes.
    pub(crate) const fn knows(&self) -> bool {
        self.known
    }

    /// The next target is known. Real-time: yes.
    pub(crate) fn know(&mut self) {
        self.known = true;
        self.rise();
    }

    /// A fall that is no longer needed becomes a rise to the target, as soon as there is a gentle one. Real-time: yes.
    fn rise(&mut self) {
        let falls = self.turn.is_some_and(|turn| turn.to.pace == 0.0);
        if !falls || self.ends {
            return;
        }
        let to = Point {
            progress: self.ticks(),
            pace: 1.0,
            change: 0.0,
        };
        let way = to.progress - self.now.progress;
        let least = (way - ON_GRID).ceil().max(1.0);
        let usual = 2.0 * way / (1.0 + self.now.pace);
        let first = (SHORTEST * usual).ceil().max(least) as u32;
        let last = (LONGEST * usual).ceil().max(least) as u32 + 2;
        let stride = ((last - first) / MOST_RISES + 1) as usize;
        let steepest = self.slow.steepest();
        let mut rises = (first..=last).step_by(stride);
        let gentle = rises.find_map(|ticks| {
            let turn = Turn::new(self.now, to, ticks);
            turn.is_within(steepest).then_some(turn)
        });
        let rests = self.now.pace <= 0.0 && self.now.change == 0.0;
        // From rest it rises in any case: with so few ticks that none fits, a little harder.
        let at_all = || rests.then(|| Turn::new(self.now, to, usual.ceil() as u32));
        if let Some(turn) = gentle.or_else(at_all) {
            self.turn = Some(turn);
        }
    }

    /// The pace begins to fall, if no target is on its way. Real-time: yes.
    pub(crate) fn slow_down(&mut self) {
        if !self.known && self.turn.is_none() {
            self.fall(self.slow.width());
        }
    }

    /// No further target will come: it comes to rest as soon as the steepest fall allows, if need be beyond the target. Real-time: yes.
    pub(crate) fn end(&mut self) {
        if std::mem::replace(&mut self.ends, true) || (!self.known && self.turn.is_some()) {
            return;
        }
        if self.stands() {
            self.turn = None;
            self.now.pace = 0.0;
        } else {
            // As far as the same deceleration needs from here.
            let pace = self.now.pace;
            self.fall((self.slow.width() * pace * pace).max(pace));
        }
    }

    /// The pace falls to 0 over this way. Real-time: yes.
    fn fall(&mut self, way: f64) {
        let Point { progress, pace, .. } = self.now;
        let to = Point {
            progress: progress + way,
            ..Point::default()
        };
        let ticks = (2.0 * way / pace).ceil().max(1.0) as u32;
        self.turn = Some(Turn::new(self.now, to, ticks));
    }

    /// The next tick: none if nothing moves. A tick that passes the last target ends in the next step. Real-time: yes.
    pub(crate) fn next(&mut self) -> Option<PacerTick> {
        let n = self.ticks();
        let begins = self.now.progress + 1.0 > self.slow.at * n + ON_GRID;
        if !self.known && self.turn.is_none() && begins && !self.stands() {
            self.fall(self.slow.until * n - self.now.progress);
        }
        if self.known {
            self.rise();
        }
        if self.stands() {
            self.now.pace = 0.0;
            return None;
        }
        let before = self.now.progress;
        match &mut self.turn {
            None => self.now.progress += 1.0,
            Some(turn) => {
                turn.tick += 1;
                self.now = turn.now();
                // Rounding goes not back.
                self.now.progress = self.now.progress.max(before);
            }
        }
        let stage = match (self.known, self.turn) {
            _ if self.ends => Stage::SlowDown,
            (true, _) => Stage::Correct,
            (false, None) => Stage::Predict,
            (false, Some(_)) => Stage::SlowDown,
        };
        let is_near = (self.now.progress - n).abs() <= ON_GRID;
        if self.known && is_near {
            self.now.progress = n;
        }
        let point = (self.now.progress - ON_GRID).ceil().max(0.0);
        let ahead = point - self.now.progress;
        Some(PacerTick {
            share: self.now.progress / n,
            length: (self.now.progress - before) / n,
            stage,
            pace: self.now.pace.clamp(0.0, 1.0),
            point,
            ahead: if ahead > ON_GRID { ahead } else { 0.0 },
            spacing: 1.0 / n,
        })
    }

    /// The target was reached or passed: a new step begins, whose target is not known. Real-time: yes.
    pub(crate) fn begin(&mut self) {
        let n = self.ticks();
        self.known = false;
        self.now.progress = (self.now.progress - n).max(0.0);
        match &mut self.turn {
            Some(turn) if self.ends => {
                turn.from.progress -= n;
                turn.to.progress -= n;
            }
            _ => {
                self.turn = None;
                (self.now.pace, self.now.change) = (1.0, 0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Shares and ticks until the target after `unknown` ticks without one, or until rest.
    fn step(pacer: &mut LatePacer, unknown: u32) -> Vec<Option<PacerTick>> {
        let mut made = Vec::new();
        for _ in 0..unknown {
            made.push(pacer.next());
        }
        pacer.know();
        while !made
            .last()
            .is_some_and(|tick| tick.is_some_and(|tick| tick.lands()))
        {
            made.push(pacer.next());
            assert!(made.len() < 20_000, "never lands: {pacer:?}");
        }
        pacer.begin();
        made
    }

    #[test]
    fn target_in_time_is_met_after_n_equal_ticks() {
        for ticks in [5, 20, 100, 1000] {
            let slow = SlowDown {
                ticks,
                at: 0.6,
                until: 0.8,
            };
            let mut pacer = LatePacer::new(slow);
            for unknown in [0, 1, 3 * ticks / 5 - 1] {
                let made = step(&mut pacer, unknown);
                assert_eq!(made.len(), ticks as usize);
                for (k, tick) in (1..).zip(made) {
                    let tick = tick.unwrap();
                    assert_eq!(tick.share, f64::from(k) / f64::from(ticks));
                    assert_eq!((tick.pace, tick.ahead), (1.0, 0.0));
                }
            }
        }
    }

    proptest! {
        /// Whenever a target comes: rest at `until`, the target at a tick, and the pace without a jump and as gentle as promised.
        #[test]
        fn pace_is_gentle(
            ticks in 10u32..300, at in 0.2..0.7f64, width in 0.15..0.3f64,
            unknown in proptest::collection::vec(0u32..900, 1..6),
        ) {
            let slow = SlowDown { ticks, at, until: (at + width).min(0.9) };
            prop_assume!(slow.width() >= 4.0 && (1.0 - slow.until) * f64::from(ticks) >= 4.0);
            let mut pacer = LatePacer::new(slow);
            let (mut pace, mut change) = (1.0, 0.0);
            for unknown in unknown {
                let mut share = 0.0;
                for (k, tick) in (0..).zip(step(&mut pacer, unknown)) {
                    let Some(tick) = tick else {
                        prop_assert!(k < unknown && (share - slow.until).abs() < 1e-12);
                        prop_assert!(pace < 1e-12);
                        (pace, change) = (0.0, 0.0);
                        continue;
                    };
                    prop_assert!(tick.share >= share && (k >= unknown || tick.share <= slow.until + 1e-12));
                    prop_assert!((tick.pace - pace).abs() <= slow.steepest(), "{} {pace}", tick.pace);
                    // Beside the ends of a fall and a rise, where a tick has parts of two motions.
                    let sharp = (tick.pace - pace - change).abs();
                    prop_assert!(sharp <= slow.sharpest() * 1.001, "{k} {unknown}: {sharp} {}", slow.sharpest());
                    // The pace is the derivative of the progress.
                    let mean = f64::midpoint(tick.pace, pace);
                    prop_assert!((tick.length * f64::from(ticks) - mean).abs() <= slow.steepest() / 4.0, "{k} {unknown}: {} {mean} {}", tick.length * f64::from(ticks), tick.share);
                    change = tick.pace - pace;
                    (share, pace) = (tick.share, tick.pace);
                }
                prop_assert_eq!(share, 1.0);
                prop_assert!(pace == 1.0 && change.abs() <= slow.steepest() + 1e-12);
            }
        }

        /// After the end it rests within the way of a whole fall, wherever that begins, and the pace only falls.
        #[test]
        fn end_comes_to_rest(ticks in 10u32..300, unknown in 0u32..600, when in 0u32..900) {
            let slow = SlowDown { ticks, at: 0.6, until: 0.8 };
            prop_assume!(slow.width() >= 2.0);
            let mut pacer = LatePacer::new(slow);
            let (mut gone, mut reached) = (0.0, 0.0);
            for k in 0..when {
                if k == unknown {
                    pacer.know();
                }
                let Some(tick) = pacer.next() else { continue };
                gone = reached + tick.share;
                if tick.lands() {
                    pacer.begin();
                    reached += 1.0;
                }
            }
            pacer.end();
            let (begun, mut pace) = (gone, pacer.now.pace);
            let mut further = 0;
            while let Some(tick) = pacer.next() {
                prop_assert!(reached + tick.share >= gone - 1e-12);
                // Where it rises, it does so for a moment.
                prop_assert!(tick.pace - pace <= slow.steepest() * 1.001);
                prop_assert!(pace - tick.pace <= 2.0 * slow.steepest());
                gone = reached + tick.share;
                pace = tick.pace;
                if tick.share >= 1.0 {
                    pacer.begin();
                    reached += 1.0;
                }
                further += 1;
            }
            prop_assert!(gone - begun <= slow.width() / f64::from(ticks) * 1.01 + 1.0 / f64::from(ticks));
            prop_assert!(f64::from(further) <= 2.0 * slow.width() + 2.0);
            prop_assert!(pacer.stands());
        }
    }
}
