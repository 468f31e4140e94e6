//! The step pacer: how far a command is on its path from one target to the next.
//!
//! One integration step is N ticks of the controller. The progress i runs from 0 at the last target to N at the next. While the next
//! target is unknown the command follows the prediction of [`super::interpolation`], slows down beyond 0.6 N and never passes 0.8 N.
//! An operator's hold is a factor ρ on every increment, which falls to 0 and rises again linearly. A target is met at a tick: what is
//! left of the step is cut into whole ticks. A delay that a compensator makes up for lives in wall time, and gets the pace without
//! that cutting. Invariants: i never passes N, nor 0.8 N while the target is unknown. With ρ = 1 and the target known at once, a step
//! is N increments of exactly 1. Limits: no input or output and no clock; the caller's calls count the ticks.

use gusset_quantity::catalog::phase::Stage;
use gusset_quantity::state;

/// Share of the step at which an unknown target slows the command down.
pub(crate) const SLOW_FROM: f64 = 0.6;
/// Share of the step that is not passed without a target.
pub(crate) const HOLD_AT: f64 = 0.8;
/// Share of the step over which the pace changes.
const OVER: f64 = 0.2;
/// Smallest increment of a recovery, so that it begins at all.
const CREEP: f64 = 0.001;
/// Relative difference of two increments that are the same.
const SAME: f64 = 1e-12;
/// Share of a tick within which a tick ends where one of full pace would.
const ON_GRID: f64 = 1e-9;

/// The way that one tick makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PacerTick {
    /// Where it ends, as a share of the step: 0 … 1, exactly 1 at the target.
    pub share: f64,
    /// How long it is, as a share of the step.
    pub length: f64,
    /// Where it begins and ends in the chart.
    pub stage: Stage,
    /// How fast test time passes beside wall time, without what meeting a target makes of it: 0 at rest … 1.
    pub pace: f64,
    /// The first place at or after its end at which a tick of a test of full pace ends, counted from 0 at the last target to
    /// N at the next.
    pub point: f64,
    /// How far that is ahead, as a share of such a tick: 0 … 1, exactly 0 there.
    pub ahead: f64,
    /// Such a tick as a share of the step, 1/N.
    pub spacing: f64,
}

state! { PacerTick { stage, share, length, pace, point, ahead, spacing } }

impl PacerTick {
    /// At the first target.
    #[must_use]
    pub(crate) const fn none() -> Self {
        Self {
            share: 1.0,
            length: 0.0,
            stage: Stage::Correct,
            pace: 1.0,
            point: 1.0,
            ahead: 0.0,
            spacing: 1.0,
        }
    }

    /// True if it ends at the target.
    #[inline]
    #[must_use]
    pub(crate) fn lands(&self) -> bool {
        self.share >= 1.0
    }
}

/// Progress and pace, after OpenFresco's state chart.
///
/// ```text
/// Correct    the target is known         i ← min(i + d, N),  d = clamp(d_sd + (i − i_sd)/(0.2 N), 0.001, 1)
/// Predict    it is not, i < 0.6 N        i ← i + 1
/// SlowDown   it is not, i ≥ 0.6 N        i ← i + d,          d = (0.8 N − i)/max(0.2 N, 1)
/// ```
///
/// d_sd and i_sd are the increment and the place at which a slow-down ended. What is left is cut as d ← (N − i)/q with q the whole
/// number next to (N − i)/d that leaves d ≤ 1: with N = 1 the pace can only be 1, 1/2, 1/3 … steps a tick, which are taken in turn.
/// The pace without that cutting is ρ d, followed by no more than ρ may change in a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepPacer {
    /// N.
    ticks: f64,
    /// i.
    progress: f64,
    known: bool,
    /// (d_sd, i_sd) while a slow-down is recovered from.
    left: Option<[f64; 2]>,
    /// Increment of the chart at the last tick, without ρ.
    increment: f64,
    /// ρ, and its change in one tick.
    ease: f64,
    ease_per_tick: f64,
    /// ρ d, no faster than easing.
    pace: f64,
}

state! { StepPacer { progress, known, left, increment, ease, pace } keeps { ticks, ease_per_tick } }

impl StepPacer {
    /// N ticks a step, and `ease_ticks` ticks from full pace to a hold: 0 stops at once.
    #[must_use]
    pub(crate) fn new(ticks: u32, ease_ticks: u32) -> Self {
        Self {
            ticks: f64::from(ticks.max(1)),
            progress: 0.0,
            known: false,
            left: None,
            increment: 1.0,
            ease: 1.0,
            pace: 1.0,
            ease_per_tick: if ease_ticks == 0 {
                1.0
            } else {
                1.0 / f64::from(ease_ticks)
            },
        }
    }

    /// N.
    #[inline]
    #[must_use]
    pub(crate) const fn ticks_per_step(&self) -> f64 {
        self.ticks
    }

    /// Share of the step that is made.
    #[inline]
    #[must_use]
    pub(crate) fn share(&self) -> f64 {
        self.progress / self.ticks
    }

    /// True if the next target is known.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn knows(&self) -> bool {
        self.known
    }

    /// True if the operator's hold is complete.
    #[inline]
    #[must_use]
    pub(crate) fn stands(&self) -> bool {
        self.ease <= 0.0
    }

    /// From here on it stands, as after a hold. Real-time: yes.
    pub(crate) fn stand(&mut self) {
        self.ease = 0.0;
    }

    /// The target was reached: a new step begins, whose target is not known yet. Real-time: yes.
    #[inline]
    pub(crate) fn begin(&mut self) {
        self.left = self.left.map(|_| [self.increment, 0.0]);
        self.progress = 0.0;
        self.known = false;
    }

    /// The next target is known. Real-time: yes.
    #[inline]
    pub(crate) fn know(&mut self) {
        if !self.known && self.increment < 1.0 {
            self.left = Some([self.increment, self.progress]);
        }
        self.known = true;
    }

    /// ρ a tick after it was `ease`. Real-time: yes.
    #[inline]
    #[must_use]
    pub(crate) fn eased(&self, ease: f64, hold: bool) -> f64 {
        let change = if hold {
            -self.ease_per_tick
        } else {
            self.ease_per_tick
        };
        let next = (ease + change).clamp(0.0, 1.0);
        // A sum of many small changes must not leave a pace that never ends.
        if next < SAME { 0.0 } else { next }
    }

    /// The next tick; `hold`: the operator wants test time to stand still. Real-time: yes.
    #[inline]
    pub(crate) fn next(&mut self, hold: bool) -> PacerTick {
        let n = self.ticks;
        self.ease = self.eased(self.ease, hold);
        self.increment = if self.known {
            match self.left {
                Some([pace, from]) => {
                    (pace + (self.progress - from) / (OVER * n)).clamp(CREEP, 1.0)
                }
                None => 1.0,
            }
        } else {
            let room = (HOLD_AT * n - self.progress).max(0.0);
            (room / (OVER * n).max(1.0)).min(1.0)
        };
        if self.known && self.increment >= 1.0 {
            self.left = None;
        }
        let stage = match (self.known, hold) {
            (_, true) => Stage::SlowDown,
            (true, false) => Stage::Correct,
            (false, false) if self.progress >= SLOW_FROM * n => Stage::SlowDown,
            (false, false) => Stage::Predict,
        };
        let before = self.progress;
        let wanted = self.ease * self.increment;
        let change = self.ease_per_tick;
        self.pace = wanted.clamp(self.pace - change, self.pace + change);
        if !self.known {
            self.progress += wanted;
        } else if wanted > 0.0 {
            let way = n - before;
            // No tick is longer than 1: what is left is made in this one.
            let ticks = if way <= wanted {
                1.0
            } else {
                let least = (way * (1.0 - SAME)).ceil();
                (way / wanted).round().max(least).max(1.0)
            };
            self.progress = if ticks <= 1.0 {
                n
            } else {
                before + way / ticks
            };
        }
        let point = (self.progress - ON_GRID).ceil().max(0.0);
        let ahead = point - self.progress;
        PacerTick {
            share: self.progress / n,
            length: (self.progress - before) / n,
            stage,
            pace: self.pace,
            point,
            ahead: if ahead > ON_GRID { ahead } else { 0.0 },
            spacing: 1.0 / n,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Ticks of one step with the target known after `unknown` ticks: the strides.
    fn step(tempo: &mut StepPacer, unknown: u32) -> Vec<PacerTick> {
        let mut strides = Vec::new();
        tempo.begin();
        for _ in 0..unknown {
            strides.push(tempo.next(false));
        }
        tempo.know();
        while !strides.last().is_some_and(PacerTick::lands) {
            strides.push(tempo.next(false));
        }
        strides
    }

    #[test]
    fn known_target_takes_n_equal_ticks() {
        for n in [1u32, 2, 3, 7, 10, 100, 1000] {
            let mut tempo = StepPacer::new(n, 50);
            for _ in 0..3 {
                let strides = step(&mut tempo, 0);
                assert_eq!(strides.len(), n as usize);
                for (k, stride) in (1..).zip(&strides) {
                    assert_eq!(stride.share, f64::from(k) / f64::from(n));
                    assert_eq!(stride.stage, Stage::Correct);
                }
            }
        }
    }

    /// 4 − i/(0.2 N) is 1 at 0.6 N and 0 at 0.8 N; with Euler's steps of one tick the distance to 0.8 N shrinks by
    /// 1 − 5/N a tick, so that after 200 ticks of N = 20 it is 0.2 N (3/4)^200, below the roundoff of 16.
    #[test]
    fn unknown_target_is_awaited_at_four_fifths() {
        for n in [5u32, 10, 20, 33, 100] {
            let mut tempo = StepPacer::new(n, 50);
            tempo.begin();
            let mut stages = Vec::new();
            for _ in 0..20 * n + 100 {
                let stride = tempo.next(false);
                // Roundoff of sums and quotients near 0.8 N.
                assert!(stride.share <= HOLD_AT * (1.0 + 1e-14));
                stages.push(stride.stage);
            }
            assert!((tempo.share() - 0.8).abs() <= 1e-14, "{n}");
            let predicted = stages.iter().filter(|s| **s == Stage::Predict).count();
            assert_eq!(predicted, (SLOW_FROM * f64::from(n)).ceil() as usize);
            assert_eq!(stages.last(), Some(&Stage::SlowDown));
        }
        // Where a fifth of the step is less than a tick, it is met at once, and not passed.
        for n in [1u32, 2, 3, 4] {
            let mut tempo = StepPacer::new(n, 50);
            tempo.begin();
            for _ in 0..2 * n + 2 {
                assert!(tempo.next(false).share <= HOLD_AT + f64::EPSILON);
            }
            assert!((tempo.share() - 0.8).abs() <= 4.0 * f64::EPSILON, "{n}");
        }
    }

    #[test]
    fn a_recovery_is_that_of_the_chart() {
        let n = 50.0;
        let mut tempo = StepPacer::new(50, 0);
        tempo.begin();
        while tempo.share() < 0.75 {
            tempo.next(false);
        }
        let pace = tempo.increment;
        let from = tempo.progress;
        tempo.know();
        let mut before = from;
        loop {
            let stride = tempo.next(false);
            let chart = (pace + (before - from) / (0.2 * n)).clamp(0.001, 1.0);
            let made = stride.length * n;
            // What is left of the way is cut into the whole number of ticks next to way/chart, so at 1.5 of them into 1 or 2.
            assert!(
                made <= 1.5 * chart && made >= 0.74 * chart,
                "{made} {chart}"
            );
            let ticks = (n - before) / chart;
            assert!((made / chart - 1.0).abs() <= 0.5001 / (ticks - 0.5).max(0.5));
            before = tempo.progress;
            if stride.lands() {
                break;
            }
        }
    }

    #[test]
    fn hold_of_one_tick_steps_ends_in_time() {
        let ease = 64u32;
        let mut tempo = StepPacer::new(1, ease);
        let mut lengths: Vec<f64> = Vec::new();
        let mut ticks = 0;
        tempo.begin();
        tempo.know();
        while !tempo.stands() {
            let stride = tempo.next(true);
            ticks += 1;
            lengths.push(stride.length);
            if stride.lands() {
                tempo.begin();
                tempo.know();
            }
        }
        assert_eq!(ticks, ease);
        assert_eq!((lengths[0], lengths[22]), (1.0, 0.5));
        // Slower and slower; where a step is cut anew while it is made, a tick may be a quarter longer than the one before.
        let ripple = |w: &[f64]| w[1] <= 1.25 * w[0];
        assert!(lengths.windows(2).all(ripple), "{lengths:?}");
        // After it, back to one step a tick.
        let mut after = Vec::new();
        for _ in 0..2 * ease {
            let stride = tempo.next(false);
            after.push(stride.length);
            if stride.lands() {
                tempo.begin();
                tempo.know();
            }
        }
        assert_eq!(after.last(), Some(&1.0));
        assert!(after[0] < 0.02, "{after:?}");
    }

    #[test]
    fn hold_without_easing_is_immediate() {
        let mut tempo = StepPacer::new(1, 0);
        tempo.begin();
        tempo.know();
        assert_eq!(tempo.next(true).length, 0.0);
        assert!(tempo.stands());
        assert!(tempo.next(false).lands());
    }

    proptest! {
        /// Whatever is known when and whatever the operator wants: i grows, never passes N or, unknown, 0.8 N; and the pace
        /// changes by no more in a tick than slow-down, recovery and easing allow, where N is large enough to show it.
        #[test]
        fn the_pace_has_no_corners(
            n in 40u32..400, ease in 20u32..400,
            events in proptest::collection::vec((0u32..600, any::<bool>()), 1..12),
        ) {
            let mut tempo = StepPacer::new(n, ease);
            let tick = 1.0 / f64::from(n);
            let mut pace = 1.0;
            let mut hold = false;
            // Slow-down and recovery: 5/N a tick; easing 1/E. The cutting into whole ticks: with w of the way left, in ticks,
            // the pace is off by at most 1/(2 w); near the target that shows, and at the beginning of the next step.
            let bound = 5.0 * tick * 1.01 + 1.0 / f64::from(ease);
            let mut way_before = f64::INFINITY;
            for (unknown, toggles) in events {
                tempo.begin();
                let mut k = 0;
                loop {
                    if k == unknown {
                        tempo.know();
                    }
                    if k == unknown / 2 + 3 && toggles {
                        hold = !hold;
                    }
                    if k > 700 {
                        hold = false;
                    }
                    let before = tempo.share();
                    let stride = tempo.next(hold);
                    k += 1;
                    prop_assert!(stride.length >= 0.0 && stride.share <= 1.0);
                    prop_assert!(stride.length <= tick * (1.0 + 1e-9), "longer than a tick");
                    prop_assert!(tempo.knows() || stride.share <= HOLD_AT + 1e-12);
                    prop_assert!((stride.share - before - stride.length).abs() < 1e-12);
                    let now = stride.length * f64::from(n);
                    let way = (1.0 - before) * f64::from(n);
                    let cut = 0.6 / way.max(1.0) + 0.6 / way_before.max(1.0);
                    prop_assert!((now - pace).abs() <= bound + cut, "{now} after {pace}, {bound} + {cut}");
                    way_before = way;
                    pace = now;
                    if stride.lands() {
                        break;
                    }
                }
            }
        }
    }
}
