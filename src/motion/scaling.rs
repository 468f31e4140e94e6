//! One factor for all components of a ground motion.
//!
//! The measure is the spectral acceleration of both horizontal components together, of the records over their whole length. The
//! factor brings it to a value at one period, or as close as one factor can to a spectrum: then the mean of ln(f·Sa/target) over
//! periods that are evenly spaced on a logarithmic axis is zero, which makes the mean of its square least.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, inside, positive};
use super::metrics::pair::{PairMeasure, pair_spectrum};
use super::metrics::spectrum::periods;
use super::process::{Accelerogram, Motion};
use super::read::parse_table;
use super::resample::{linear, snapped};
use super::shapes::factor_of;
use super::unit::{Quantity, Unit};
use super::{Files, Grid};

/// Damping ratio of the oscillators.
const RATIO: f64 = 0.05;
/// Periods at which a target spectrum is compared.
const PERIODS: usize = 64;
/// Values between two samples where the components have different times.
const FINER: f64 = 8.0;

/// Scaling of all components by one factor, to a measure of both horizontal components together. Damping
/// is 5 %. Give `period_s` and `value`, or `spectrum_file`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scaling {
    /// Measure of the spectral acceleration of both horizontal components together.
    #[schemars(example = &"rotd50")]
    pub target: PairMeasure,
    /// Natural period at which the measure gets the value.
    #[schemars(example = 0.8)]
    pub period_s: Option<f64>,
    /// Value of the measure, in `unit`.
    #[schemars(example = 0.4)]
    pub value: Option<f64>,
    /// File with the target spectrum, relative to the test file: periods in s, and spectral accelerations
    /// in `unit`.
    #[schemars(example = &"design-spectrum.csv")]
    pub spectrum_file: Option<String>,
    /// First and last natural period at which the measure is compared with the spectrum. Default: the
    /// periods of the file.
    #[schemars(example = [0.2, 1.5])]
    pub periods_s: Option<[f64; 2]>,
    /// Unit of the value or of the spectrum.
    #[schemars(example = &"g")]
    pub unit: Unit,
}

/// Result of a scaling.
#[derive(Debug, Clone, PartialEq)]
pub struct Scaled {
    /// The measure.
    pub measure: PairMeasure,
    /// The factor of all components.
    pub factor: f64,
    /// Natural periods in s.
    pub periods: Vec<f64>,
    /// The measure at these periods before the scaling, m/s².
    pub before: Vec<f64>,
    /// After it, with the factor `scale_factor` of each component, m/s².
    pub after: Vec<f64>,
    /// Its target, m/s².
    pub target: Vec<f64>,
    /// The file of the target spectrum.
    pub spectrum: Option<String>,
}

impl Scaled {
    /// Root mean square of ln(measure/target) before and after.
    #[must_use]
    pub fn misfit(&self) -> [f64; 2] {
        [&self.before, &self.after].map(|found| {
            let each = found.iter().zip(&self.target);
            let square = |(found, target): (&f64, &f64)| {
                let ln = libm::log(found / target);
                ln * ln
            };
            (each.map(square).sum::<f64>() / self.target.len().max(1) as f64).sqrt()
        })
    }
}

/// Natural periods that a motion can be scaled at, s.
const SHORTEST: f64 = 0.01;
const LONGEST: f64 = 20.0;

impl Scaling {
    /// The common factor of two horizontal components, whose own targets must be absent. `files` hands over the records of the
    /// first, of the second, and the spectrum.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn of(
        &self,
        pair: [&Motion; 2],
        grid: Grid,
        [first, second, spectrum]: [&Files<'_>; 3],
    ) -> Result<Scaled, MotionError> {
        let (periods, target) = self.wanted(spectrum)?;
        let found = [
            pair[0].accelerogram(grid, first)?,
            pair[1].accelerogram(grid, second)?,
        ];
        let (accel, dt) = together(&found);
        let measured = |factors: [f64; 2]| {
            let scaled = [0, 1].map(|i| -> Vec<f64> {
                let own = accel[i].iter();
                own.map(|a| factors[i] * a).collect()
            });
            let [x, y] = &scaled;
            pair_spectrum(self.target, [x, y], dt, &periods, RATIO)
        };
        let before = measured([1.0; 2]);
        if before.len() != periods.len() || before.iter().any(|sa| *sa <= 0.0 || !sa.is_finite()) {
            let wanted = target.first().copied().unwrap_or(0.0);
            return Err(MotionError::ZeroMotion { wanted });
        }
        let each = before.iter().zip(&target);
        let mean = each.map(|(sa, target)| libm::log(target / sa)).sum::<f64>();
        let factor = match target.as_slice() {
            [one] => one / before[0],
            _ => libm::exp(mean / target.len() as f64),
        };
        let after = measured(pair.map(|one| factor * one.processing.scale_factor));
        Ok(Scaled {
            measure: self.target,
            factor,
            periods,
            before,
            after,
            target,
            spectrum: self.spectrum_file.clone(),
        })
    }

    /// Periods in s and targets in m/s².
    fn wanted(&self, files: &Files<'_>) -> Result<(Vec<f64>, Vec<f64>), MotionError> {
        let to_si = factor_of("unit", self.unit, Quantity::Acceleration)?;
        match (&self.spectrum_file, self.period_s, self.value) {
            (None, Some(period), Some(value)) => Ok((
                vec![inside(
                    "period_s",
                    period,
                    (SHORTEST..=LONGEST).contains(&period),
                    "from 0.01 to 20",
                )?],
                vec![positive("value", value)? * to_si],
            )),
            (Some(file), None, None) => {
                let bytes = files(file).map_err(|source| MotionError::Unreadable {
                    file: file.clone(),
                    source,
                })?;
                self.spectrum_of(file, &bytes, to_si)
            }
            _ => Err(MotionError::Scaling {
                key: "scaling",
                why: "give `period_s` and `value`, or `spectrum_file`".to_owned(),
            }),
        }
    }

    fn spectrum_of(
        &self,
        file: &str,
        bytes: &[u8],
        to_si: f64,
    ) -> Result<(Vec<f64>, Vec<f64>), MotionError> {
        let refuse = |key, why: String| Err(MotionError::Scaling { key, why });
        let table = parse_table(file, bytes)?;
        if table.columns != 2 {
            let why = format!(
                "{file} has {} columns, but a spectrum has two: period in s, spectral acceleration",
                table.columns
            );
            return refuse("spectrum_file", why);
        }
        if let Some(stated) = table.unit_of(1).filter(|unit| *unit != self.unit) {
            let why = format!(
                "{file} states the unit {stated}, but `unit` is {}",
                self.unit
            );
            return refuse("unit", why);
        }
        let rows: Vec<(f64, f64)> = table.values.chunks(2).map(|row| (row[0], row[1])).collect();
        let is_rising = rows.windows(2).all(|two| two[0].0 < two[1].0);
        let is_positive = rows.iter().all(|(period, sa)| *period > 0.0 && *sa > 0.0);
        let (Some((first, _)), Some((last, _))) = (rows.first(), rows.last()) else {
            return refuse("spectrum_file", format!("{file} holds no numbers"));
        };
        if !is_rising || !is_positive || rows.len() < 2 {
            let why = format!(
                "{file} must have at least two rows with rising periods, and all its numbers must be greater than 0"
            );
            return refuse("spectrum_file", why);
        }
        let [from, to] = self.periods_s.unwrap_or([*first, *last]);
        if !(from < to && from >= *first && to <= *last) {
            let why = format!(
                "`periods_s` is [{from}, {to}], but must rise and lie within {file}, from {first} s to {last} s"
            );
            return refuse("periods_s", why);
        }
        let mut periods = periods(from, to, PERIODS);
        if let Some(end) = periods.last_mut() {
            *end = to;
        }
        let target = periods.iter().map(|period| to_si * between(&rows, *period));
        Ok((periods.clone(), target.collect()))
    }
}

/// Spectral acceleration at a period, along straight lines of the logarithms.
fn between(rows: &[(f64, f64)], period: f64) -> f64 {
    let next = rows.partition_point(|(at, _)| *at < period);
    let next = next.clamp(1, rows.len() - 1);
    let [(from, low), (to, high)] = [rows[next - 1], rows[next]];
    let share = libm::log(period / from) / libm::log(to / from);
    low * libm::pow(high / low, share)
}

/// Both components at equal times, and the distance of these: the samples themselves where they have equal steps, else values on
/// straight lines between them, eight for each of the finer step.
fn together(pair: &[Accelerogram; 2]) -> ([Vec<f64>; 2], f64) {
    let [first, second] = pair;
    let start = first.start.min(second.start);
    let step = first.dt.min(second.dt);
    let whole = |one: &Accelerogram| {
        let at = (one.start - start) / step;
        (one.dt / step - 1.0).abs() < 1e-9 && snapped(at).fract() == 0.0
    };
    let dt = if whole(first) && whole(second) {
        step
    } else {
        step / FINER
    };
    let laid = |one: &Accelerogram| {
        let last = one.values.len().saturating_sub(1) as f64;
        let end = one.start + last * one.dt;
        let count = ((end - start) / dt).ceil() as usize + 1;
        let at = |i: usize| snapped((start - one.start + i as f64 * dt) / one.dt);
        let value = |at: f64| match (0.0..=last).contains(&at) {
            true => linear(&one.values, at),
            false => 0.0,
        };
        (0..count).map(|i| value(at(i))).collect()
    };
    (pair.each_ref().map(laid), dt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Resample, Signal, Values};
    use gusset_quantity::assert_is;

    fn component(phase: f64, dt_s: f64, delay_s: f64) -> Motion {
        let count = (8.0 / dt_s) as usize;
        let at = |i: usize| {
            let t = i as f64 * dt_s;
            libm::sin(6.0 * t + phase) * libm::sin(std::f64::consts::PI * t / 8.0)
        };
        let signal = Signal::Values(Values {
            values: (0..=count).map(at).collect(),
            dt_s,
            unit: None,
            resample: Resample::Linear,
            start_s: 0.0,
        });
        Motion {
            delay_s,
            ..Motion::plain(signal)
        }
    }

    fn scaling(more: &str) -> Scaling {
        toml::from_str(&format!("target = \"rotd50\"\nunit = \"g\"\n{more}")).unwrap()
    }

    fn of(scaling: &Scaling, pair: [&Motion; 2], spectrum: &str) -> Result<Scaled, MotionError> {
        let grid = Grid::new(0.01, 1000).unwrap();
        let files = |_: &str| Ok(spectrum.as_bytes().to_vec());
        scaling.of(pair, grid, [&files, &files, &files])
    }

    #[test]
    fn value_at_one_period_is_met() {
        let (x, mut y) = (component(0.0, 0.01, 0.0), component(1.0, 0.01, 0.5));
        let wanted = scaling("period_s = 0.9\nvalue = 0.3");
        let scaled = of(&wanted, [&x, &y], "").unwrap();
        assert!((scaled.after[0] / (0.3 * 9.806_65) - 1.0).abs() < 1e-12);
        assert!((scaled.factor * scaled.before[0] / scaled.after[0] - 1.0).abs() < 1e-12);
        // An additional factor of one component changes neither the factor nor the measure before.
        y.processing.scale_factor = 0.5;
        let halved = of(&wanted, [&x, &y], "").unwrap();
        assert_eq!(
            (halved.factor, halved.before[0]),
            (scaled.factor, scaled.before[0])
        );
        assert!(halved.after[0] < scaled.after[0]);
    }

    #[test]
    fn factor_to_a_spectrum_is_least_squares() {
        let (x, y) = (component(0.0, 0.01, 0.0), component(1.0, 0.01, 0.0));
        let text = "period,Sa (g)\n0.1,0.8\n0.5,0.8\n4.0,0.1\n";
        let wanted = scaling("spectrum_file = \"a.csv\"\nperiods_s = [0.2, 2.0]");
        let scaled = of(&wanted, [&x, &y], text).unwrap();
        assert_eq!((scaled.periods[0], scaled.periods[63]), (0.2, 2.0));
        assert!((scaled.target[0] / (0.8 * 9.806_65) - 1.0).abs() < 1e-12);
        let of_factor = |share: f64| {
            let after = scaled.after.iter().map(|sa| sa * share).collect();
            let changed = Scaled {
                after,
                ..scaled.clone()
            };
            changed.misfit()[1]
        };
        let least = of_factor(1.0);
        assert!(least < scaled.misfit()[0]);
        assert!(of_factor(1.001) > least && of_factor(0.999) > least);
        // Twice the spectrum needs twice the factor.
        let doubled = text.replace("0.8", "1.6").replace("0.1\n", "0.2\n");
        let twice = of(&wanted, [&x, &y], &doubled).unwrap();
        assert!((twice.factor / scaled.factor - 2.0).abs() < 1e-12);
    }

    #[test]
    fn components_of_unequal_steps_are_joined() {
        let wanted = scaling("period_s = 0.9\nvalue = 0.3");
        let [fine, coarse] = [0.005, 0.01].map(|dt| component(1.0, dt, 0.0));
        let x = component(0.0, 0.005, 0.0);
        let alike = of(&wanted, [&x, &fine], "").unwrap();
        let unlike = of(&wanted, [&x, &coarse], "").unwrap();
        // The straight lines of the coarse samples differ by (ωh)²/12 and less.
        assert!((unlike.factor / alike.factor - 1.0).abs() < 1e-3);
        let shifted = of(&wanted, [&x, &component(1.0, 0.005, 1e-5)], "").unwrap();
        assert!((shifted.factor / alike.factor - 1.0).abs() < 1e-3);
    }

    #[test]
    fn wrong_spectra_are_refused() {
        let (x, y) = (component(0.0, 0.01, 0.0), component(1.0, 0.01, 0.0));
        let wanted = scaling("spectrum_file = \"a.csv\"");
        for (text, key) in [
            ("0.1 0.8 3\n0.5 0.8 4\n", "spectrum_file"),
            ("0.5 0.8\n0.1 0.8\n", "spectrum_file"),
            ("0.0 0.8\n0.1 0.8\n", "spectrum_file"),
            ("0.1 0.8\n", "spectrum_file"),
            ("period,Sa (m/s2)\n0.1,0.8\n0.5,0.8\n", "unit"),
        ] {
            let error = of(&wanted, [&x, &y], text).unwrap_err();
            assert_eq!(error.key(), Some(key), "{text} {error}");
        }
        let beyond = scaling("spectrum_file = \"a.csv\"\nperiods_s = [0.2, 3.0]");
        let error = of(&beyond, [&x, &y], "0.1 0.8\n0.5 0.8\n").unwrap_err();
        assert_is!(error => MotionError::Scaling { key: "periods_s", .. });
        let neither = of(&scaling("period_s = 1.0"), [&x, &y], "").unwrap_err();
        assert_is!(neither => MotionError::Scaling { key: "scaling", .. });
        let silent = Motion::plain(Signal::Values(Values {
            values: vec![0.0; 9],
            dt_s: 0.01,
            unit: None,
            resample: Resample::Linear,
            start_s: 0.0,
        }));
        let value = scaling("period_s = 1.0\nvalue = 0.1");
        assert_is!(of(&value, [&silent, &silent], "").unwrap_err() => MotionError::ZeroMotion { .. });
    }
}
