//! Has a specimen come to rest where it was sent? A force belongs to a place only if it was measured there.
//!
//! A specimen that reads exactly its command, twice the same, is at rest at once. Of every other specimen whole blocks of readings are
//! taken, until the means of two in a row are the same but for their noise and a small share of the way. A specimen that has not gone
//! most of its way by then may not have begun: it counts as one at rest only when it has not moved for longer. Limits: the
//! specimen's own units; no clock, readings are counted.

use super::probe::{Average, SIGMAS};
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::Measurement;

/// Time of a block of readings in s, and the fewest readings: of fewer a steady drift could pass for noise.
const BLOCK_S: f64 = 0.025;
const FEWEST: f64 = 8.0;
/// From block to block a reading at rest changes by no more than this share of what it changed by on the way there ...
const SHARE: f64 = 1e-3;
/// ... or of what it changed by since the load began to come on: creep, and the drift of a sensor, are no way.
const SHARE_OF_ALL: f64 = 1e-4;
/// Share of its way that a specimen has gone at least when it stands where it was sent.
const MOST_OF_IT: f64 = 0.8;
/// An axis is asked for that only if its way is this share of the longest of the specimen.
const TAKES_PART: f64 = 0.2;
/// It stands still for a quarter of the time that it was waited for: one that goes beyond its place stands where it turns, too.
const QUARTER: u32 = 4;
/// Time in s after which one that stands still off its place rests there.
const OFF_S: f64 = 1.0;
/// Time in s after which one has not come to rest, and the fewest blocks of it.
const PATIENCE_S: f64 = 30.0;
const PATIENCE: f64 = 64.0;
/// Readings that differ by this share of their change, or of their size, are the same.
const SAME: f64 = 1e-9;
const ROUNDOFF: f64 = 1e-12;

/// One axis. Of pairs the first is displacement, the second force.
#[derive(Debug, Clone, Copy, Default)]
struct AxisRest {
    /// That the last command went, and the size of its numbers.
    way: f64,
    size: f64,
    /// Where it stood before the load, where it rested last, and the last answer.
    origin: [f64; 2],
    start: [f64; 2],
    last: [f64; 2],
    /// The block before, and the one that is being read.
    before: [Average; 2],
    block: [Average; 2],
}

/// Whether a specimen moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RestState {
    Moves,
    /// It rests at its last answer.
    RestsAtAnswer,
    /// It rests at the mean of a block.
    RestsAtMean,
}

/// One specimen that is sent from place to place. Real-time: yes, after its making.
#[derive(Debug, Clone)]
pub(crate) struct Rest {
    axes: Vec<AxisRest>,
    /// Readings of a block; blocks at a standstill that count as a rest off the place, and blocks after which it never came.
    readings: u32,
    off: u32,
    patience: u32,
    /// It is known where it stood before.
    has_origin: bool,
    /// Answers to this command, and blocks of them; of those the last ones at a standstill.
    answers: u32,
    blocks: u32,
    still: u32,
    /// It showed that it stands at once where it is sent.
    at_once: bool,
    state: RestState,
}

impl Rest {
    /// For `axes` axes with one exchange every `period` s of wall time. It rests until it is sent somewhere.
    #[must_use]
    pub(crate) fn new(axes: usize, period: f64) -> Self {
        let readings = (BLOCK_S / period).ceil().max(FEWEST);
        let blocks = |seconds: f64, fewest: f64| (seconds / (readings * period)).ceil().max(fewest);
        Self {
            axes: vec![AxisRest::default(); axes],
            readings: readings as u32,
            off: blocks(OFF_S, 2.0) as u32,
            patience: blocks(PATIENCE_S, PATIENCE) as u32,
            has_origin: false,
            answers: 0,
            blocks: 0,
            still: 0,
            at_once: false,
            state: RestState::RestsAtAnswer,
        }
    }

    /// Whether it is at rest.
    #[must_use]
    pub(crate) const fn rests(&self) -> bool {
        !matches!(self.state, RestState::Moves)
    }

    /// Exchanges after which it has not come to rest.
    #[must_use]
    pub(crate) const fn patience(&self) -> u64 {
        self.patience as u64 * self.readings as u64
    }

    /// Means of displacement and force of each axis where it rests; none where its last answer says it.
    pub(crate) fn means(&self) -> Option<impl Iterator<Item = (f64, f64)>> {
        let axes = self.axes.iter();
        (self.state == RestState::RestsAtMean)
            .then(|| axes.map(|axis| (axis.start[0], axis.start[1])))
    }

    /// It is sent from one command to another; `raw` is what was measured before, if anything was. Real-time: yes.
    pub(crate) fn sent(&mut self, [from, to]: [AtAxis<&[f64]>; 2], raw: Option<&Measurement>) {
        if let (false, Some(raw)) = (self.has_origin, raw) {
            let values = raw.disp.iter().zip(&raw.force);
            for (axis, (disp, force)) in self.axes.iter_mut().zip(values) {
                axis.origin = [*disp, *force];
                axis.start = axis.origin;
            }
            self.has_origin = true;
        }
        let mut rests = true;
        for (axis, (from, to)) in self.axes.iter_mut().zip(from.iter().zip(*to)) {
            let way = to - from;
            // What the balance leaves of roundoff is no way.
            axis.size = from.abs().max(to.abs());
            let goes = way.abs() > ROUNDOFF * axis.size;
            axis.way = if goes { way } else { 0.0 };
            rests &= !goes;
            axis.block = Default::default();
        }
        (self.answers, self.blocks, self.still) = (0, 0, 0);
        self.state = if rests {
            RestState::RestsAtAnswer
        } else {
            RestState::Moves
        };
    }

    /// It was led there, and this is the answer to the last command of the way, which is the one to be sent again. Real-time: yes.
    pub(crate) fn led(&mut self, raw: &Measurement) {
        self.keep(raw);
        self.answers = 1;
    }

    /// A fresh answer to that command; true if it is at rest. Real-time: yes.
    pub(crate) fn take(&mut self, raw: &Measurement) -> bool {
        match self.state {
            RestState::Moves => {}
            RestState::RestsAtMean => return true,
            RestState::RestsAtAnswer => {
                self.keep(raw);
                self.start_from_the_last();
                return true;
            }
        }
        // One answer alone tells it of those only that are known to stand at once. The force of a damper is another as long as it
        // moves, and the same from then on.
        if (1..=2).contains(&self.answers) {
            self.at_once = self.is_the_same(raw);
        }
        self.keep(raw);
        self.answers = self.answers.saturating_add(1);
        if self.answers <= 3 && self.at_once && self.is_there() {
            self.start_from_the_last();
            self.state = RestState::RestsAtAnswer;
            return true;
        }
        let mut count = 0.0;
        for axis in &mut self.axes {
            for (block, value) in axis.block.iter_mut().zip(axis.last) {
                block.add(value);
            }
            count = axis.block[0].count;
        }
        if count >= f64::from(self.readings) {
            self.close_block();
        }
        self.rests()
    }

    fn keep(&mut self, raw: &Measurement) {
        let values = raw.disp.iter().zip(&raw.force);
        for (axis, (disp, force)) in self.axes.iter_mut().zip(values) {
            axis.last = [*disp, *force];
        }
    }

    fn start_from_the_last(&mut self) {
        for axis in &mut self.axes {
            axis.start = axis.last;
        }
    }

    fn is_the_same(&self, raw: &Measurement) -> bool {
        let values = raw.disp.iter().zip(&raw.force);
        self.axes.iter().zip(values).all(|(axis, (disp, force))| {
            let pairs = [*disp, *force].into_iter().zip(axis.last).zip(axis.start);
            pairs.into_iter().all(|((now, last), start)| {
                let change = if self.has_origin { now - start } else { 0.0 };
                (now - last).abs() <= SAME * change.abs() + ROUNDOFF * now.abs()
            })
        })
    }

    /// Whether the last answer is that of one that went its way exactly.
    fn is_there(&self) -> bool {
        !self.has_origin
            || self.axes.iter().all(|axis| {
                let off = axis.last[0] - axis.start[0] - axis.way;
                off.abs() <= SAME * axis.way.abs() + ROUNDOFF * axis.size.max(axis.last[0].abs())
            })
    }

    /// Whether every axis that was sent somewhere is most of its way from where it stood, by what is read there and how far that
    /// may be off. The other way round is gone, too.
    fn has_gone(&self, read: impl Fn(&AxisRest) -> (f64, f64)) -> bool {
        if !self.has_origin {
            return true;
        }
        let longest = self.axes.iter().fold(0.0, |m: f64, a| m.max(a.way.abs()));
        let mut sent = self.axes.iter();
        sent.all(|axis| {
            let way = axis.way.abs();
            let (disp, noise) = read(axis);
            let gone = (disp - axis.start[0]).abs();
            way < TAKES_PART * longest || gone + noise >= MOST_OF_IT * way
        })
    }

    fn close_block(&mut self) {
        let noise = |blocks: [&Average; 2]| {
            let squares = blocks.iter().map(|block| block.variance() / block.count);
            SIGMAS * squares.sum::<f64>().sqrt()
        };
        let has_before = self.blocks > 0;
        let is_still = has_before
            && self.axes.iter().all(|axis| {
                let pairs = axis.block.iter().zip(&axis.before);
                let pairs = pairs.zip(axis.start.iter().zip(&axis.origin));
                pairs.into_iter().all(|((block, before), (start, origin))| {
                    let way = SHARE * (block.mean - start).abs();
                    let all = SHARE_OF_ALL * (block.mean - origin).abs();
                    let bound = way.max(all).max(noise([block, before]));
                    (block.mean - before.mean).abs() <= bound + ROUNDOFF * block.mean.abs()
                })
            });
        self.still = if is_still { self.still + 1 } else { 0 };
        let has_gone = self.has_gone(|axis| (axis.block[0].mean, noise([&axis.block[0]; 2])));
        self.blocks = self.blocks.saturating_add(1);
        let turns = self.still.saturating_mul(QUARTER) < self.blocks;
        let rests = if has_gone {
            !turns
        } else {
            self.still >= self.off
        };
        let rests = is_still && rests;
        for axis in &mut self.axes {
            if rests {
                axis.start = axis.block.map(|block| block.mean);
            }
            axis.before = std::mem::take(&mut axis.block);
        }
        self.state = if rests {
            RestState::RestsAtMean
        } else {
            RestState::Moves
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 1e-3;

    /// Answers that are taken of a specimen that was led to 1 and stands at `disp` so many answers later, until it rests; none
    /// if it never does.
    fn answers(mut disp: impl FnMut(u64) -> f64) -> (Option<u64>, Rest) {
        let mut rest = Rest::new(1, PERIOD);
        let mut raw = Measurement::zeros(1);
        let mut read = |raw: &mut Measurement, number: u64| {
            raw.disp[0] = disp(number);
            raw.force[0] = 1e6 * raw.disp[0];
        };
        rest.sent([AtAxis(&[0.0]), AtAxis(&[1.0])], Some(&raw));
        assert!(!rest.rests());
        read(&mut raw, 0);
        rest.led(&raw);
        for number in 1..=rest.patience() {
            read(&mut raw, number);
            if rest.take(&raw) {
                return (Some(number), rest);
            }
        }
        (None, rest)
    }

    #[test]
    fn resting_axis_is_not_waited_for() {
        let (taken, mut rest) = answers(|_| 1.0);
        assert_eq!(taken, Some(1));
        assert!(rest.means().is_none());
        // Nor later, where it is not led: it is known.
        let mut raw = Measurement::zeros(1);
        (raw.disp[0], raw.force[0]) = (1.0, 1e6);
        rest.sent([AtAxis(&[1.0]), AtAxis(&[1.001])], Some(&raw));
        (raw.disp[0], raw.force[0]) = (1.001, 1.001e6);
        assert!(rest.take(&raw));
    }

    #[test]
    fn damper_force_counts_at_rest() {
        let mut rest = Rest::new(1, PERIOD);
        let mut raw = Measurement::zeros(1);
        rest.sent([AtAxis(&[0.0]), AtAxis(&[1.0])], Some(&raw));
        (raw.disp[0], raw.force[0]) = (1.0, 3e5);
        rest.led(&raw);
        raw.force[0] = 1e5;
        assert!(!rest.take(&raw), "it may go on to change");
        assert!(rest.take(&raw) && rest.means().is_none());
    }

    #[test]
    fn who_lags_or_has_not_begun_is_waited_for() {
        for lag in [2.0, 24.0, 300.0] {
            let (taken, rest) = answers(|tick| 1.0 - libm::exp(-(tick as f64) / lag));
            let (disp, force) = rest.means().unwrap().next().unwrap();
            assert!((disp - 1.0).abs() < 0.02, "{lag}: {disp} at {taken:?}");
            assert!((force - 1e6 * disp).abs() < 1e-3);
        }
        for delay in [3, 100, 900] {
            let (taken, _) = answers(|tick| f64::from(u8::from(tick >= delay)));
            let taken = taken.unwrap();
            // Two blocks, and a third of the delay, which is a quarter of both.
            let most = delay + delay / 3 + 100;
            assert!((delay..most).contains(&taken), "{delay}: {taken}");
        }
    }

    /// 2 Hz and a damping ratio of 0.2 after a step: half a period later it turns at 1.53.
    #[test]
    fn where_it_turns_it_does_not_rest() {
        let (omega, ratio) = (4.0 * std::f64::consts::PI * PERIOD, 0.2f64);
        let damped = omega * (1.0 - ratio * ratio).sqrt();
        let (taken, rest) = answers(|tick| {
            let phase = damped * tick as f64;
            let decay = libm::exp(-ratio * omega * tick as f64);
            1.0 - decay * (libm::cos(phase) + ratio * omega / damped * libm::sin(phase))
        });
        let (disp, _) = rest.means().unwrap().next().unwrap();
        assert!((disp - 1.0).abs() < 0.01, "{disp} at {taken:?}");
    }

    #[test]
    fn restless_axis_is_reported_after_a_second() {
        let (taken, _) = answers(|tick| 0.3 + 0.1 * libm::exp(-(tick as f64) / 5.0));
        assert!((1000..1200).contains(&taken.unwrap()), "{taken:?}");
        let (taken, rest) = answers(|tick| 1e-3 * tick as f64);
        assert_eq!(taken, None);
        assert!((rest.patience() as f64 * PERIOD - 30.0).abs() < 0.1);
    }

    /// Noise of 2 % of the way: the blocks' means are taken for the same within five deviations of them.
    #[test]
    fn noise_is_no_motion_and_hides_none() {
        use rand::{RngExt as _, SeedableRng as _};
        for seed in 0..200 {
            let mut random = rand_pcg::Pcg64::seed_from_u64(seed);
            let mut noise = || 0.02 * (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            let (taken, _) = answers(|_| 1.0 + noise());
            assert!(taken.unwrap() <= 200, "seed {seed}: {taken:?}");
            let (_, rest) = answers(|tick| 1.0 - libm::exp(-(tick as f64) / 100.0) + noise());
            let (disp, _) = rest.means().unwrap().next().unwrap();
            assert!((disp - 1.0).abs() < 0.2, "seed {seed}: {disp}");
        }
    }
}
