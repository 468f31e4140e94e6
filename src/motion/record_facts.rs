//! Facts about a record that was read from a file, and warnings about implausible values.

use super::error::Short;
use super::peak;
use super::read::{Record, RecordFormat};
use super::unit::{Quantity, STANDARD_GRAVITY, Unit};

/// Facts about a record before processing.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordFacts {
    /// The file, as the test file spells it.
    pub file: String,
    /// Its format.
    pub format: RecordFormat,
    /// Its column or component from 1, where there are several.
    pub column: Option<usize>,
    /// The name of that column in the file.
    pub column_name: Option<String>,
    /// Unit of its numbers.
    pub unit: Unit,
    /// How many values there are.
    pub npts: usize,
    /// Time step in s.
    pub dt_s: f64,
    /// Its quantity.
    pub quantity: Quantity,
    /// Largest absolute value in the SI unit of the quantity.
    pub peak: f64,
}

/// Peaks of a ground acceleration in m/s² below and above which its unit is doubted.
const PLAUSIBLE: [f64; 2] = [0.001 * STANDARD_GRAVITY, 5.0 * STANDARD_GRAVITY];

/// Least number of values that can be checked.
const LEAST: usize = 4;

impl RecordFacts {
    pub(super) fn of(
        file: &str,
        record: &Record,
        unit: Unit,
        quantity: Quantity,
        si: &[f64],
    ) -> Self {
        Self {
            file: file.to_owned(),
            format: record.source.format.unwrap_or(RecordFormat::Table),
            column: record.source.column,
            column_name: record.source.name.clone(),
            unit,
            npts: record.values.len(),
            dt_s: record.dt,
            quantity,
            peak: peak(si),
        }
    }

    /// From its first to its last value, in s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.npts.saturating_sub(1) as f64 * self.dt_s
    }

    /// Warns of values that look like something else: a count in front, or times.
    pub(super) fn doubt_values(&self, values: &[f64], warnings: &mut Vec<String>) {
        let [first, rest @ ..] = values else {
            return;
        };
        if values.len() < LEAST {
            return;
        }
        let file = &self.file;
        if *first == rest.len() as f64 {
            warnings.push(format!(
                "{file}: its first value is {first}, as many as the values after it. If it is their count, leave it out with skip_rows"
            ));
        }
        if self.quantity == Quantity::Acceleration && rises_evenly(values) {
            warnings.push(format!(
                "{file}: its values rise evenly, as times do. If they are times, choose another column with `column`"
            ));
        }
    }

    /// Warns of an implausible ground acceleration; `peak` in m/s².
    pub(super) fn doubt_peak(&self, peak: f64, how: &str, warnings: &mut Vec<String>) {
        let [least, most] = PLAUSIBLE;
        let is_doubtful = peak > 0.0 && !(least..=most).contains(&peak);
        if self.quantity == Quantity::Acceleration && is_doubtful {
            warnings.push(format!(
                "{}: the peak ground acceleration {how} is {} g. Between 0.001 g and 5 g is usual: check `unit` ({}) and `scale_factor`",
                self.file,
                Short(peak / STANDARD_GRAVITY),
                self.unit
            ));
        }
    }
}

/// True if values depart from a rising straight line by less than the distance of two of them, and never fall.
fn rises_evenly(values: &[f64]) -> bool {
    let (Some(first), Some(last)) = (values.first(), values.last()) else {
        return false;
    };
    let step = (last - first) / (values.len() - 1) as f64;
    let is_near = |(i, value): (usize, &f64)| (value - first - step * i as f64).abs() < step;
    step > 0.0
        && values.windows(2).all(|pair| pair[0] <= pair[1])
        && values.iter().enumerate().all(is_near)
}
