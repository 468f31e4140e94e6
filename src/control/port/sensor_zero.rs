//! Readings of an axis at rest, and the zero that is taken of them.

use gusset_quantity::state;

/// Whether a channel keeps its declared zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Zero {
    /// The declared offset holds; what is read is only reported.
    #[default]
    Absolute,
    /// The mean reading while zeroing is the zero.
    Relative,
}

/// The two channels of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reference {
    /// Displacement sensor: with [`Zero::Relative`] the deformation is zero where the specimen stands.
    pub disp: Zero,
    /// Load cell.
    pub force: Zero,
}

/// How the readings of a displacement sensor belong to the commands of its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DispZero {
    /// Specimen displacement units per metre of the structure.
    pub gain: f64,
    /// Command at which the deformation is zero, in the specimen's unit.
    pub command: f64,
    /// Whether the sensor's zero is still to be read.
    pub is_awaited: bool,
}

/// Readings from which on their scatter says how noisy a sensor is.
const TELL_NOISE: u32 = 8;

/// Readings of one axis while zeroing, in its own units.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reading {
    /// Number of readings.
    pub count: u32,
    /// Mean of the measured displacement.
    pub disp: f64,
    /// Mean of the measured force.
    pub force: f64,
    /// Root mean square of the displacement about its mean: the noise floor, as far as this many readings show it.
    pub disp_noise: f64,
    /// Root mean square of the force about its mean.
    pub force_noise: f64,
}

impl Reading {
    /// Noise of displacement and force; none where too few readings were taken to know it. That of a single one is no 0.
    #[must_use]
    pub fn noise(&self) -> Option<[f64; 2]> {
        (self.count >= TELL_NOISE).then_some([self.disp_noise, self.force_noise])
    }
}

/// ReadingSums over the readings of one axis, about the first of them so that a large offset does not eat the noise.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ReadingSums {
    count: f64,
    first: [f64; 2],
    sum: [f64; 2],
    squares: [f64; 2],
}

state! { ReadingSums { count, first, sum, squares } }

impl ReadingSums {
    /// Takes displacement and force.
    pub(crate) fn take(&mut self, values: [f64; 2]) {
        if self.count == 0.0 {
            self.first = values;
        }
        self.count += 1.0;
        let sums = self.sum.iter_mut().zip(&mut self.squares);
        for ((sum, squares), (value, first)) in sums.zip(values.iter().zip(&self.first)) {
            let value = value - first;
            *sum += value;
            *squares += value * value;
        }
    }

    /// Number of readings.
    pub(crate) const fn count(&self) -> f64 {
        self.count
    }

    pub(crate) fn reading(&self) -> Reading {
        let count = self.count.max(1.0);
        let mean = |i: usize| self.first[i] + self.sum[i] / count;
        let noise = |i: usize| {
            let mean = self.sum[i] / count;
            (self.squares[i] / count - mean * mean).max(0.0).sqrt()
        };
        Reading {
            count: self.count as u32,
            disp: mean(0),
            force: mean(1),
            disp_noise: noise(0),
            force_noise: noise(1),
        }
    }
}
