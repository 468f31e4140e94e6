//! Wraps a specimen of this process and keeps the extremes of its commands and measurements.
//!
//! Differences are those of [`gusset_control::port::limits::Watch`]: from one command to the next, over the tick's wall time; so
//! the watch would judge the same values.

use std::sync::{Arc, Mutex};

use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::Nanos;

/// Smallest and largest value, and the test time of each.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Extreme {
    /// Smallest.
    pub low: f64,
    /// Test time of it, s; 0 for everything before the test.
    pub low_at: f64,
    /// Largest.
    pub high: f64,
    /// Test time of it, s.
    pub high_at: f64,
}

impl Extreme {
    fn take(&mut self, value: f64, at: f64) {
        if value < self.low {
            (self.low, self.low_at) = (value, at);
        }
        if value > self.high {
            (self.high, self.high_at) = (value, at);
        }
    }

    /// The end that is beyond the levels, else the larger one; with its test time.
    #[must_use]
    pub(crate) fn farther_from(&self, trip: [f64; 2], warn: [f64; 2]) -> (f64, f64) {
        let below = [trip, warn].iter().any(|level| self.low < level[0]);
        let above = [trip, warn].iter().any(|level| self.high > level[1]);
        let (low, high) = ((self.low, self.low_at), (self.high, self.high_at));
        match (below, above) {
            (true, false) => low,
            (false, true) => high,
            _ if self.low.abs() > self.high.abs() => low,
            _ => high,
        }
    }
}

/// Needs of a test for one axis, SI at the specimen's scale.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisNeed {
    /// Commanded displacement, m.
    pub command: Extreme,
    /// Its change from one command to the next, m; a size.
    pub step: Extreme,
    /// Change of command over the tick's wall time, m/s; a size.
    pub vel: Extreme,
    /// Second difference over the tick's wall time squared, m/s²; a size.
    pub accel: Extreme,
    /// Measured displacement, m.
    pub measured: Extreme,
    /// Measured force, N.
    pub force: Extreme,
    /// Its change from one measurement to the next, N; a size.
    pub force_step: Extreme,
    /// Measured force times commanded velocity, W; a size.
    pub power: Extreme,
    /// Total travel of its commands, there and back, m.
    pub travel: f64,
}

/// Kept values of one axis.
#[derive(Debug, Clone, Copy)]
struct Axis {
    metres: f64,
    newtons: f64,
    /// The last command and the one before, and the velocity between them.
    past: [f64; 2],
    vel: f64,
    force: f64,
    need: AxisNeed,
}

/// A substructure with a meter round it; its extremes go to the book when the specimen is retired.
pub(super) struct Meter {
    inner: Box<dyn Substructure>,
    axes: Vec<Axis>,
    tick: f64,
    told: u8,
    answered: bool,
    time: f64,
    book: Arc<Mutex<Vec<AxisNeed>>>,
}

impl Meter {
    /// `units`: metres and newtons in one unit of each axis; `tick`: wall time from one command to the next in s.
    pub(crate) fn new(
        inner: Box<dyn Substructure>,
        units: &[(f64, f64)],
        tick: f64,
        book: Arc<Mutex<Vec<AxisNeed>>>,
    ) -> Self {
        let axis = |(metres, newtons): &(f64, f64)| Axis {
            metres: *metres,
            newtons: *newtons,
            past: [0.0; 2],
            vel: 0.0,
            force: 0.0,
            need: AxisNeed::default(),
        };
        Self {
            inner,
            axes: units.iter().map(axis).collect(),
            tick,
            told: 0,
            answered: false,
            time: 0.0,
            book,
        }
    }
}

impl Substructure for Meter {
    fn axes(&self) -> usize {
        self.inner.axes()
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        let (at, tick) = (command.time, self.tick);
        self.time = at;
        for (axis, disp) in self.axes.iter_mut().zip(command.disp) {
            let disp = disp * axis.metres;
            let [last, before] = axis.past;
            let need = &mut axis.need;
            if self.told == 0 {
                // The first one gives its position; it need not be near 0.
                let stands = Extreme {
                    low: disp,
                    low_at: at,
                    high: disp,
                    high_at: at,
                };
                (need.command, need.measured) = (stands, stands);
            }
            need.command.take(disp, at);
            if self.told >= 1 {
                let step = (disp - last).abs();
                need.step.take(step, at);
                need.travel += step;
                need.vel.take(step / tick, at);
                axis.vel = step / tick;
            }
            if self.told >= 2 {
                let accel = (disp - 2.0 * last + before).abs() / (tick * tick);
                need.accel.take(accel, at);
            }
            axis.past = [disp, last];
        }
        self.told = (self.told + 1).min(2);
        self.inner.issue(command)
    }

    fn collect(&mut self, deadline: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let freshness = self.inner.collect(deadline, into)?;
        if freshness == Freshness::Fresh {
            let values = into.disp.iter().zip(&into.force);
            for (axis, (disp, force)) in self.axes.iter_mut().zip(values) {
                let force = force * axis.newtons;
                axis.need.measured.take(disp * axis.metres, self.time);
                axis.need.force.take(force, self.time);
                axis.need.power.take((force * axis.vel).abs(), self.time);
                if self.answered {
                    let jump = (force - axis.force).abs();
                    axis.need.force_step.take(jump, self.time);
                }
                axis.force = force;
            }
            self.answered = true;
        }
        Ok(freshness)
    }

    fn accepted(&mut self, sequence: u64) -> Result<(), LinkFault> {
        self.inner.accepted(sequence)
    }

    fn halt(&mut self) -> Result<(), LinkFault> {
        // The stop is not judged, and the next motion starts from rest.
        for axis in &mut self.axes {
            axis.past = [axis.past[0]; 2];
        }
        Ok(())
    }

    fn retire(&mut self, how: Retirement) {
        if let Ok(mut book) = self.book.lock() {
            *book = self.axes.iter().map(|axis| axis.need).collect();
        }
        self.inner.retire(how);
    }
}
