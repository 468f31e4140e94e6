//! How a specimen that keeps moving between the targets of its controller has spent its time.
//!
//! The strong part of the test is that between 5 and 95 % of ∫ a² dt, with a from the second differences of the targets. It is known at
//! the end only, so each target keeps its part in a list of fixed length, whose neighbours are added up where it is full.

use gusset_quantity::catalog::phase::{Phase, Stage};

/// Entries of the list.
const BINS: usize = 1024;
/// Share of ∫ a² dt before the strong part, and behind it.
const WEAK: f64 = 0.05;

/// Wall time in s, and slow-downs.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StageTimes {
    /// Towards a known target.
    pub correcting_s: f64,
    /// Along the prediction, at full pace.
    pub predicting_s: f64,
    /// Slower, because the target is late.
    pub slowing_s: f64,
    /// At rest, because the target is late.
    pub holding_s: f64,
    /// Times that it slowed down.
    pub slow_downs: u64,
    /// The longest time from the begin of a slow-down to its target, s.
    pub longest_s: f64,
}

impl StageTimes {
    fn add(&mut self, other: &Self) {
        self.correcting_s += other.correcting_s;
        self.predicting_s += other.predicting_s;
        self.slowing_s += other.slowing_s;
        self.holding_s += other.holding_s;
        self.slow_downs += other.slow_downs;
        self.longest_s = self.longest_s.max(other.longest_s);
    }

    /// Wall time of all stages, s.
    #[must_use]
    pub fn all_s(&self) -> f64 {
        self.correcting_s + self.predicting_s + self.slowing_s + self.holding_s
    }
}

/// A part of the test, with ∫ a² dt of it.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    times: StageTimes,
    work: f64,
}

/// Counts stages row by row.
#[derive(Debug, Clone)]
pub(super) struct StageCounter {
    bins: Vec<Bin>,
    /// Targets of a bin, and of the last one.
    targets: u32,
    filled: u32,
    now: Bin,
    /// Targets before, two for each signal, and how many are known.
    past: Vec<[f64; 2]>,
    known: u8,
    /// Wall time of the row before, and from which it slows down, s.
    last_s: Option<f64>,
    slows_from: Option<f64>,
    /// It does not rest at each target.
    goes_on: bool,
}

impl StageCounter {
    /// For targets of this number of signals.
    pub(super) fn new(signals: usize) -> Self {
        Self {
            bins: Vec::with_capacity(BINS),
            targets: 1,
            filled: 0,
            now: Bin::default(),
            past: vec![[0.0; 2]; signals],
            known: 0,
            last_s: None,
            slows_from: None,
            goes_on: false,
        }
    }

    /// A command in this state at this wall time; others are no part of it. Ticks take `period_s`. Real-time: yes.
    pub(super) fn count(&mut self, state: f64, at_s: f64, period_s: f64) {
        let is = |stage: Stage| state == stage.code();
        let lands = state == Phase::Running.code();
        self.goes_on |= is(Stage::Correct) || is(Stage::Predict) || is(Stage::SlowDown);
        if !(self.goes_on
            && (lands || is(Stage::Correct) || is(Stage::Predict) || is(Stage::SlowDown)))
        {
            self.last_s = None;
            return;
        }
        let times = &mut self.now.times;
        let passed = self.last_s.map_or(period_s, |last| at_s - last);
        // Only a slow-down ends at rest: another gap is a late tick.
        let rests = passed > 1.5 * period_s && self.slows_from.is_some();
        let moves = if rests { period_s } else { passed };
        times.holding_s += passed - moves;
        if lands || is(Stage::Correct) {
            times.correcting_s += moves;
        } else if is(Stage::Predict) {
            times.predicting_s += moves;
        } else {
            times.slowing_s += moves;
        }
        if is(Stage::SlowDown) {
            self.slows_from.get_or_insert(at_s);
        } else if let Some(from) = self.slows_from.take() {
            times.slow_downs += 1;
            times.longest_s = times.longest_s.max(at_s - from);
        }
        self.last_s = Some(at_s);
    }

    /// The next target, one displacement and velocity after the other for each signal, `step_s` s after the last. Real-time: yes.
    pub(super) fn target(&mut self, motion: &[f64], step_s: f64) {
        let mut work = 0.0;
        for (past, now) in self.past.iter_mut().zip(motion.chunks_exact(2)) {
            let [one, two] = *past;
            if self.known == 2 && step_s > 0.0 {
                let accel = (now[0] - 2.0 * one + two) / (step_s * step_s);
                work += accel * accel * step_s;
            }
            *past = [now[0], one];
        }
        self.known = (self.known + 1).min(2);
        self.now.work += work;
        self.filled += 1;
        if self.filled < self.targets {
            return;
        }
        self.filled = 0;
        if self.bins.len() == BINS {
            for k in 0..BINS / 2 {
                let [a, mut b] = [self.bins[2 * k], self.bins[2 * k + 1]];
                b.times.add(&a.times);
                b.work += a.work;
                self.bins[k] = b;
            }
            self.bins.truncate(BINS / 2);
            self.targets *= 2;
        }
        // Within its capacity.
        self.bins.push(std::mem::take(&mut self.now));
    }

    /// The whole test, and its strong part; none without a stage.
    pub(super) fn times(&self) -> Option<[StageTimes; 2]> {
        let all = || self.bins.iter().chain([&self.now]);
        let mut whole = StageTimes::default();
        all().for_each(|bin| whole.add(&bin.times));
        if whole.all_s() == 0.0 {
            return None;
        }
        let work: f64 = all().map(|bin| bin.work).sum();
        let (mut strong, mut done) = (StageTimes::default(), 0.0);
        for bin in all() {
            let before = done;
            done += bin.work;
            if done > WEAK * work && before < (1.0 - WEAK) * work {
                strong.add(&bin.times);
            }
        }
        Some([whole, strong])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strong_part_has_its_own_times() {
        let mut counter = StageCounter::new(1);
        let mut wall = 0.0;
        // Nothing moves, then a sine, then nothing; targets are late in the sine alone.
        for step in 0..6000 {
            let moves = (2000..4000).contains(&step);
            let disp = if moves {
                1.0 - libm::cos(std::f64::consts::TAU * f64::from(step) / 100.0)
            } else {
                0.0
            };
            counter.target(&[disp, 0.0], 0.01);
            for tick in 0..10 {
                let stage = match (tick, moves) {
                    (0..3, _) => Stage::Predict,
                    (3..5, true) => Stage::SlowDown,
                    _ => Stage::Correct,
                };
                wall += if moves && tick == 5 { 0.051 } else { 0.001 };
                counter.count(stage.code(), wall, 0.001);
            }
        }
        let [whole, strong] = counter.times().unwrap();
        let near = |found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 1e-2, "{found} {expected}")
        };
        near(whole.predicting_s, 18.0);
        near(whole.slowing_s, 4.0);
        near(whole.holding_s, 100.0);
        near(whole.correcting_s, 38.0);
        near(whole.longest_s, 0.052);
        assert_eq!(whole.slow_downs, 2000);
        near(strong.holding_s / strong.all_s(), 0.05 / 0.06);
        near(strong.slow_downs as f64, 1800.0);
    }
}
