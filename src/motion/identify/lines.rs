//! The transforms of a record over its whole length, and the lines of the band.

use nalgebra::Complex;
use rustfft::FftPlanner;

use super::{Band, IdentifyError, Record};

/// A complex number.
pub(super) type C64 = Complex<f64>;

/// Fewest lines for a fit.
const FEWEST: usize = 24;
/// Share of the commanded power that is not measured but computed.
const ROUNDOFF: f64 = 1e-20;
/// A drift between the two rests counts beyond this many standard errors.
const DRIFT: f64 = 4.0;

/// The lines of the band, and all others for the response outside of it.
pub(super) struct Lines {
    pub dt: f64,
    /// Samples of the record.
    pub samples: usize,
    /// ω in rad/s of each line of the band.
    pub omega: Vec<f64>,
    pub command: Vec<C64>,
    pub measured: Vec<C64>,
    pub force: Vec<C64>,
    /// The command and the force from the first line to the last one below half the sampling rate.
    pub all_command: Vec<C64>,
    pub all_force: Vec<C64>,
}

impl Lines {
    /// Transforms a record.
    pub(crate) fn of(record: &Record<'_>, band: Band) -> Result<Self, IdentifyError> {
        let n = record.command.len();
        let even = record.measured.len() == n && record.force.len() == n;
        let is_record = even && n >= 4 && record.dt > 0.0 && record.dt.is_finite();
        if !is_record {
            let (a, b) = (record.measured.len(), record.force.len());
            return Err(IdentifyError::NoRecord {
                samples: n.min(a).min(b),
                dt: record.dt,
            });
        }
        for (column, values) in [
            ("command", record.command),
            ("measured displacement", record.measured),
            ("measured force", record.force),
        ] {
            if let Some(index) = values.iter().position(|value| !value.is_finite()) {
                return Err(IdentifyError::NotFinite {
                    column,
                    index: index + 1,
                    found: values[index],
                });
            }
        }
        if record.command.windows(2).all(|pair| pair[0] == pair[1]) {
            return Err(IdentifyError::Still);
        }
        let length = n as f64 * record.dt;
        let first = (band.from_hz * length).ceil().max(1.0) as usize;
        let top = (band.to_hz * length).floor().min(((n - 1) / 2) as f64);
        let last = top.max(0.0) as usize;
        let found = (last + 1).saturating_sub(first);
        if found < FEWEST {
            return Err(IdentifyError::TooShort {
                from_hz: band.from_hz,
                to_hz: band.to_hz,
                found,
                wanted: FEWEST,
            });
        }
        let mut planner = FftPlanner::<f64>::new();
        let transform = planner.plan_fft_forward(n);
        let spectrum = |column: &[f64]| {
            let mut values = at_rest_zero(column, record.rest);
            transform.process(&mut values);
            // The mean says nothing, and the upper half repeats the lower one.
            values.drain(..1);
            values.truncate((n - 1) / 2);
            values
        };
        let all_command = spectrum(record.command);
        let all_force = spectrum(record.force);
        let measured = spectrum(record.measured);
        let part = |all: &[C64]| all.get(first - 1..last).unwrap_or_default().to_vec();
        let line = 2.0 * std::f64::consts::PI / length;
        Ok(Self {
            dt: record.dt,
            samples: n,
            omega: (first..=last).map(|k| k as f64 * line).collect(),
            command: part(&all_command),
            measured: part(&measured),
            force: part(&all_force),
            all_command,
            all_force,
        })
    }

    /// True if what is measured is no more than the roundoff of a constant.
    pub(crate) fn is_dead(&self) -> bool {
        let power = |lines: &[C64]| lines.iter().map(C64::norm_sqr).sum::<f64>();
        let is_alive = power(&self.measured) > ROUNDOFF * power(&self.command);
        !is_alive
    }

    /// ω of line `index` of all, from 0 for the first one.
    pub(crate) fn omega_of(&self, index: usize) -> f64 {
        2.0 * std::f64::consts::PI * (index + 1) as f64 / (self.samples as f64 * self.dt)
    }
}

/// The column less its mean, and less the line from the first rest to the last one if it drifted: a column that does not
/// come back would leak into every line.
fn at_rest_zero(column: &[f64], rest: [usize; 2]) -> Vec<C64> {
    let n = column.len();
    let (first, last) = (rest[0].min(n / 2), (rest[1] / 2).min(n / 2));
    let mut from = column.iter().sum::<f64>() / n as f64;
    let mut slope = 0.0;
    if let (Some((a, error_a)), Some((b, error_b))) = (
        mean(column.get(..first).unwrap_or_default()),
        mean(column.get(n - last..).unwrap_or_default()),
    ) && (b - a).abs() > DRIFT * (error_a * error_a + error_b * error_b).sqrt()
    {
        let (at_a, at_b) = (0.5 * first as f64, n as f64 - 0.5 * last as f64);
        slope = (b - a) / (at_b - at_a);
        from = a - slope * at_a;
    }
    let level = |i: usize| from + slope * i as f64;
    let values = column.iter().enumerate();
    values
        .map(|(i, value)| C64::new(value - level(i), 0.0))
        .collect()
}

/// Mean and its standard error.
fn mean(values: &[f64]) -> Option<(f64, f64)> {
    let n = values.len() as f64;
    if values.len() < 8 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
    Some((mean, (square / n).sqrt()))
}
