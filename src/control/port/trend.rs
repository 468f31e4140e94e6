//! The direction of a specimen out of a motion that the test makes anyway: the one that brings its static load on.
//!
//! Readings at rest give the zero and the noise. Then the end of each slow motion is held against what the estimate k̂ expects
//! of it: a force or a displacement that goes the other way, twice in a row and clearly, is a reversed channel, and it shows
//! before the load has grown.

use super::probe::{Average, SIGMAS};
use super::wiring_fault::{Channel, WiringFault};
use gusset_quantity::units::AxisUnits;

/// A reading that goes the other way by this part of what is expected is no accident.
const CLEARLY: f64 = 0.25;
/// A reading that goes the right way by this part shows the direction.
const SHOWS: f64 = 0.05;
/// Judgements in a row that count.
const IN_A_ROW: u32 = 2;
/// An axis is judged by its force only if it takes this part of the largest of the specimen.
const TAKES_PART: f64 = 0.2;

/// One axis.
#[derive(Debug, Clone, Copy, Default)]
struct AxisTrend {
    start: f64,
    disp: Average,
    force: Average,
    against: [u32; 2],
    shown: bool,
}

/// The direction of one specimen, in metres and newtons of the structure. Real-time: yes, after its making.
#[derive(Debug, Clone)]
pub struct Trend {
    /// n × n by rows.
    stiffness: Vec<f64>,
    axes: Vec<AxisTrend>,
    expected: Vec<f64>,
}

impl Trend {
    /// For a specimen whose stiffness is believed to be `stiffness`, n × n by rows.
    #[must_use]
    pub fn new(axes: usize, stiffness: Vec<f64>) -> Self {
        Self {
            stiffness,
            axes: vec![AxisTrend::default(); axes],
            expected: vec![0.0; axes],
        }
    }

    /// A reading while the specimen stands at `target`. Real-time: yes.
    pub(crate) fn rest(&mut self, target: &[f64], disp: &[f64], force: &[f64]) {
        let readings = target.iter().zip(disp).zip(force);
        for (axis, ((target, disp), force)) in self.axes.iter_mut().zip(readings) {
            axis.start = *target;
            axis.disp.add(*disp);
            axis.force.add(*force);
        }
    }

    /// A reading after a slow motion to `target`, where the specimen has come to rest. Real-time: yes.
    ///
    /// # Errors
    /// A channel goes the other way.
    pub(crate) fn moved(
        &mut self,
        target: &[f64],
        disp: &[f64],
        force: &[f64],
    ) -> Result<(), WiringFault> {
        let n = self.axes.len().max(1);
        for (expected, row) in self.expected.iter_mut().zip(self.stiffness.chunks(n)) {
            let ways = row.iter().zip(target).zip(&self.axes);
            *expected = ways
                .map(|((k, target), axis)| k * (target - axis.start))
                .sum();
        }
        let largest = self.expected.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
        let readings = target.iter().zip(disp).zip(force).zip(&self.expected);
        let axes = self.axes.iter_mut().zip(readings).enumerate();
        for (index, (axis, (((target, disp), force), expected))) in axes {
            let way = target - axis.start;
            let disp = Change::of(&axis.disp, *disp, way);
            let force = Change::of(&axis.force, *force, *expected);
            let judged = expected.abs() >= TAKES_PART * largest && way * expected > 0.0;
            for (count, change) in axis.against.iter_mut().zip([&disp, &force]) {
                *count = if judged && change.is_against() {
                    *count + 1
                } else {
                    0
                };
            }
            axis.shown |= judged && disp.shows() && force.shows();
            let [disp_against, force_against] = axis.against.map(|count| count >= IN_A_ROW);
            let channel = match (disp_against, force_against) {
                (false, false) => continue,
                (false, true) => Channel::Force,
                (true, false) => Channel::Disp,
                (true, true) => Channel::Command,
            };
            let sign = way.signum();
            return Err(WiringFault::Reversed {
                axis: index,
                channel,
                disp: sign * disp.found,
                force: sign * force.found,
                units: (AxisUnits::SI.disp, AxisUnits::SI.force),
            });
        }
        Ok(())
    }

    /// The axes (from 0) whose direction did not show.
    pub(crate) fn unshown(&self) -> impl Iterator<Item = usize> {
        let axes = self.axes.iter().enumerate();
        axes.filter(|(_, axis)| !axis.shown).map(|(index, _)| index)
    }
}

/// A reading beside the rest, and what was expected of it.
struct Change {
    found: f64,
    expected: f64,
    noise: f64,
}

impl Change {
    fn of(rest: &Average, reading: f64, expected: f64) -> Self {
        Self {
            found: reading - rest.mean,
            expected,
            // Beside a rest that nobody read nothing shows.
            noise: if rest.count > 0.0 {
                SIGMAS * (rest.variance() * (1.0 + 1.0 / rest.count)).sqrt()
            } else {
                f64::INFINITY
            },
        }
    }

    fn is_against(&self) -> bool {
        let size = self.found.abs();
        self.found * self.expected < 0.0
            && size > self.noise
            && size > CLEARLY * self.expected.abs()
    }

    fn shows(&self) -> bool {
        let size = self.found.abs();
        self.found * self.expected > 0.0 && size > self.noise && size > SHOWS * self.expected.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: f64 = 1e6;

    /// A load that comes on in twenty parts; after how many of them it was stopped, and why.
    fn settled(mut wiring: impl FnMut(f64) -> (f64, f64)) -> (usize, Result<Trend, WiringFault>) {
        let mut trend = Trend::new(1, vec![K]);
        for _ in 0..16 {
            let (disp, force) = wiring(0.0);
            trend.rest(&[0.5], &[0.5 + disp], &[force]);
        }
        for part in 1..=20 {
            let way = -1e-5 * part as f64;
            let (disp, force) = wiring(way);
            if let Err(misfit) = trend.moved(&[0.5 + way], &[0.5 + disp], &[force]) {
                return (part, Err(misfit));
            }
        }
        (20, Ok(trend))
    }

    fn channel(outcome: Result<Trend, WiringFault>) -> Channel {
        match outcome {
            Err(WiringFault::Reversed { channel, .. }) => channel,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn reversed_axis_stops_at_the_second_part() {
        let (_, right) = settled(|d| (d, K * d));
        assert_eq!(right.unwrap().unshown().count(), 0);
        // A yielding one, at a tenth of its stiffness from the first part on.
        assert_eq!(
            settled(|d| (d, 0.1 * K * d)).1.unwrap().unshown().count(),
            0
        );
        for (wiring, expected) in [
            ((|d| (d, -K * d)) as fn(f64) -> (f64, f64), Channel::Force),
            (|d| (-d, K * d), Channel::Disp),
            (|d| (-d, -K * d), Channel::Command),
        ] {
            let (parts, outcome) = settled(wiring);
            assert_eq!((parts, channel(outcome)), (2, expected));
        }
    }

    #[test]
    fn some_reversals_are_no_reversed_channel() {
        let mut reading = 0;
        let (_, outcome) = settled(|d| {
            reading += 1;
            (d, if reading % 3 == 0 { -K * d } else { K * d })
        });
        assert_eq!(outcome.unwrap().unshown().count(), 0);
    }

    #[test]
    fn dead_channel_shows_no_direction() {
        let (_, trend) = settled(|d| (d, 7.0));
        assert_eq!(trend.unwrap().unshown().collect::<Vec<_>>(), [0]);
    }

    /// Noise that is larger than the first parts of the load: nothing is stopped by accident, and a reversed channel is
    /// stopped when the load has risen above the noise.
    #[test]
    fn noise_hides_no_direction_for_long() {
        use rand::{RngExt as _, SeedableRng as _};
        for seed in 0..200 {
            let mut random = rand_pcg::Pcg64::seed_from_u64(seed);
            // A standard deviation of 5 N; the parts are 10 N each.
            let mut noise = || 5.0 * (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            let (_, right) = settled(|d| (d, K * d + noise()));
            assert_eq!(right.unwrap().unshown().count(), 0, "seed {seed}");
            let (parts, wrong) = settled(|d| (d, -K * d + noise()));
            assert_eq!(channel(wrong), Channel::Force, "seed {seed}");
            assert!(parts <= 8, "seed {seed}: {parts} parts");
        }
    }

    #[test]
    fn an_axis_that_takes_no_part_is_not_judged() {
        // Coupled axes; the first is pushed back by the second, as a coupled estimate says.
        let mut trend = Trend::new(2, vec![2.0, -1.0, -1.0, 2.0]);
        trend.rest(&[0.0; 2], &[0.0; 2], &[0.0; 2]);
        for k in 1..10 {
            let (one, two) = (0.1 * f64::from(k), f64::from(k));
            let force = [2.0 * one - two, 2.0 * two - one];
            trend.moved(&[one, two], &[one, two], &force).unwrap();
        }
        assert_eq!(trend.unshown().collect::<Vec<_>>(), [0]);
    }
}
