//! Equally spaced samples in SI units, laid on the step grid.
//!
//! A record that ends before the test is zero after its end, but for a displacement, which stays where it ends: a table
//! or an actuator cannot jump home.

use super::error::{MotionError, Short};
use super::resample::{Kernel, Resample, linear, snapped};
use super::shapes::left_out;
use super::{Grid, RecordFacts, peak};

/// Values of a synthetic motion for each of its samples, four of which are in a cycle of its highest frequency.
const FINER: f64 = 8.0;

/// Equally spaced samples in SI units.
#[derive(Debug, Clone)]
pub(super) struct Sampled {
    /// Distance in s.
    pub(super) dt: f64,
    /// Test time of the first sample in s.
    pub(super) first_time: f64,
    /// Test times between which the motion exists; samples beyond them only feed the kernel.
    pub(super) span: (f64, f64),
    pub(super) values: Vec<f64>,
    pub(super) resample: Resample,
    pub(super) origin: Origin,
    /// Facts about the file of the samples, if there is one.
    pub(super) record: Option<RecordFacts>,
}

/// Where samples come from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Origin {
    /// Somebody's record, by this name: filtered if the grid is coarser; a displacement stays where it ends.
    Record(String),
    /// Our own, which holds nothing above `top_hz`.
    Synthetic {
        /// In Hz.
        top_hz: f64,
    },
}

impl Sampled {
    /// Begins `delay` s later.
    pub(super) fn delay(&mut self, delay: f64) {
        self.first_time += delay;
        self.span = (self.span.0 + delay, self.span.1 + delay);
    }

    /// Test time of the first value of [`Self::itself`].
    pub(super) fn first_inner_time(&self) -> f64 {
        match self.origin {
            Origin::Record(_) => self.first_time + self.inner().0 as f64 * self.dt,
            Origin::Synthetic { .. } => self.span.0,
        }
    }

    /// First and last sample within the span.
    pub(super) fn inner(&self) -> (usize, usize) {
        let place = |time: f64| snapped((time - self.first_time) / self.dt).max(0.0);
        let most = self.values.len().saturating_sub(1);
        let last = (place(self.span.1).floor() as usize).min(most);
        ((place(self.span.0).ceil() as usize).min(last), last)
    }

    /// Value and, for band-limited samples, rate at every point of the grid.
    pub(super) fn on(&self, grid: Grid, holds: bool) -> Vec<(f64, Option<f64>)> {
        self.at(grid.times(), grid, holds).collect()
    }

    /// The motion itself, whatever the steps of a test, with the interval: the samples of a record, or values of a synthetic motion so
    /// close together that none of its peaks is missed.
    pub(super) fn itself(&self) -> Result<(Vec<f64>, f64), MotionError> {
        let (first, last) = self.inner();
        if matches!(self.origin, Origin::Record(_)) {
            let values = self.values.get(first..=last).unwrap_or(&[]);
            return Ok((values.to_vec(), self.dt));
        }
        let dt = self.dt / FINER;
        let steps = ((self.span.1 - self.span.0) / dt).floor();
        let grid = Grid::new(dt, steps as usize)?;
        let times = grid.times().map(|time| self.span.0 + time);
        let values = self.at(times, grid, false).map(|point| point.0);
        Ok((values.collect(), dt))
    }

    fn at(
        &self,
        times: impl Iterator<Item = f64>,
        grid: Grid,
        holds: bool,
    ) -> impl Iterator<Item = (f64, Option<f64>)> {
        let kernel = match self.origin {
            Origin::Record(_) => Kernel::new(self.dt, grid.dt()),
            Origin::Synthetic { .. } => Kernel::without_filter(),
        };
        let is_record = matches!(self.origin, Origin::Record(_));
        let resting = if holds && is_record {
            self.values.last().copied().unwrap_or(0.0)
        } else {
            0.0
        };
        let (start, end) = self.span;
        let slack = 1e-9 * self.dt.min(grid.dt());
        times.map(move |time| {
            if time < start - slack {
                return (0.0, self.known(0.0));
            }
            if time > end + slack {
                return (resting, self.known(0.0));
            }
            let at = snapped((time - self.first_time) / self.dt);
            match self.resample {
                Resample::Linear => (linear(&self.values, at), None),
                Resample::BandLimited => {
                    let (value, slope) = kernel.value_and_slope(&self.values, at);
                    (value, Some(slope / self.dt))
                }
            }
        })
    }

    /// A rate that the kernel knows; straight lines leave it to differences.
    fn known(&self, rate: f64) -> Option<f64> {
        match self.resample {
            Resample::Linear => None,
            Resample::BandLimited => Some(rate),
        }
    }

    pub(super) fn tail_warning(&self, grid: Grid, holds: bool, warnings: &mut Vec<String>) {
        let (end, test) = (self.span.1, grid.duration());
        let Origin::Record(name) = &self.origin else {
            warnings.extend(left_out(end, test));
            return;
        };
        if test > end + 1e-9 * grid.dt() {
            let after = if holds {
                format!(
                    "its last value, {} m, is held after it",
                    Short(self.values.last().copied().unwrap_or(0.0))
                )
            } else {
                "it is zero after that".to_owned()
            };
            warnings.push(format!(
                "{name}: the record ends at {} s, the test at {} s; {after}",
                Short(end),
                Short(test)
            ));
        }
    }

    /// Doubts a test that ends before the peak of its record.
    pub(super) fn cut_peak(&self, grid: Grid, doubts: &mut Vec<String>) {
        let (test, Origin::Record(name)) = (grid.duration(), &self.origin) else {
            return;
        };
        let cut = self
            .values
            .iter()
            .enumerate()
            .filter(|(i, _)| self.first_time + *i as f64 * self.dt > test + 1e-9 * grid.dt());
        let beyond = peak(&cut.map(|(_, v)| *v).collect::<Vec<_>>());
        let whole = peak(&self.values);
        if beyond > 0.0 && beyond >= whole {
            doubts.push(format!(
                "{name}: the test ends at {} s, before the peak of the record",
                Short(test)
            ));
        }
    }

    /// That the step is longer than that of the record, in words, and the share of the record that straight lines between `points`
    /// of `grid` miss, as a root mean square.
    pub(super) fn coarse(
        &self,
        grid: Grid,
        points: &[(f64, Option<f64>)],
    ) -> Option<(String, f64)> {
        let Origin::Record(name) = &self.origin else {
            return None;
        };
        if self.resample != Resample::Linear || grid.dt() <= self.dt * (1.0 + 1e-9) {
            return None;
        }
        let on_grid: Vec<f64> = points.iter().map(|(value, _)| *value).collect();
        let each = self.values.iter().enumerate();
        let each = each.map(|(i, value)| (self.first_time + i as f64 * self.dt, *value));
        let within = each.filter(|(time, _)| (0.0..=grid.duration()).contains(time));
        let (missed, all) = within.fold((0.0, 0.0), |(missed, all), (time, value)| {
            let off = value - linear(&on_grid, snapped(time / grid.dt()));
            (missed + off * off, all + value * value)
        });
        let share = if all > 0.0 {
            f64::sqrt(missed / all)
        } else {
            0.0
        };
        let text = format!(
            "{name}: the step of {} s is longer than that of the record, {} s: {} % of the record is lost between the steps, and \
             frequencies above {} Hz are aliased: resample = \"band_limited\" removes them",
            Short(grid.dt()),
            Short(self.dt),
            Short(100.0 * share),
            Short(0.5 / grid.dt())
        );
        Some((text, share))
    }
}
