//! Columns that have become short enough for a page: the smallest and the largest value of every few rows.
//!
//! Invariant: every value is one of the rows at the time beside it, no finite extreme is lost, and all columns have one length.
//! Of `every` rows two stay, in the order in which the extremes came. For a short test `every` is one, and all rows are kept. A
//! NaN entry replaces missing rows, so that no line is drawn across. Numbers of a page are marked before the rows are thinned: an
//! entry does not keep which row was the last.

use std::collections::HashMap;

use super::row_filter::Gap;
use gusset_record::Column;

/// Rows of a test of which every row is kept: 20 s at 6.5 kHz.
pub(super) const WHOLE: usize = 1 << 17;
/// Numbers of all columns that are kept if every row is.
const NUMBERS: usize = 1 << 25;
/// Entries of a column of a longer test at most, give or take one pair.
pub(super) const MOST: usize = 8192;

/// A value of a column, and the time of its row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mark {
    pub time: f64,
    pub value: f64,
}

/// Marks of a column, whether its rows are thinned or not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Marks {
    /// The finite value of largest magnitude, and the smallest; the first of those that are equal.
    pub peak: Option<Mark>,
    pub least: Option<Mark>,
    /// Value of the last row, possibly NaN.
    pub last: Option<f64>,
}

impl Marks {
    fn take(&mut self, time: Option<&[f64]>, values: &[f64]) {
        for (row, &value) in values.iter().enumerate() {
            if !value.is_finite() {
                continue;
            }
            let time = || time.and_then(|time| time.get(row).copied());
            let mark = || Mark {
                time: time().unwrap_or(f64::NAN),
                value,
            };
            if self.peak.is_none_or(|peak| value.abs() > peak.value.abs()) {
                self.peak = Some(mark());
            }
            if self.least.is_none_or(|least| value < least.value) {
                self.least = Some(mark());
            }
        }
        self.last = values.last().copied().or(self.last);
    }
}

/// One column during thinning.
#[derive(Debug, Clone)]
struct Thinning {
    /// Row in the bucket, its time and its value.
    lo: (usize, f64, f64),
    hi: (usize, f64, f64),
    out: Vec<f64>,
    /// Times of the entries; empty where every row is kept.
    times: Vec<f64>,
    marks: Marks,
}

/// Columns that are thinned side by side.
#[derive(Debug, Clone)]
pub(super) struct Thinner {
    every: usize,
    filled: usize,
    columns: Vec<Thinning>,
    /// Which of them is time: first and middle of a bucket in place of extremes.
    time: Option<usize>,
}

impl Thinner {
    /// For `rows` rows of `columns` columns; `time` is the place of a column that only rises.
    pub(crate) fn new(rows: u64, columns: usize, time: Option<usize>) -> Self {
        let whole = WHOLE.min(NUMBERS / columns.max(1)).max(MOST);
        let every = if rows <= whole as u64 {
            1
        } else {
            rows.div_ceil(MOST as u64 / 2) as usize
        };
        let fresh = Thinning {
            lo: (0, f64::NAN, f64::NAN),
            hi: (0, f64::NAN, f64::NAN),
            out: Vec::new(),
            times: Vec::new(),
            marks: Marks::default(),
        };
        Self {
            every,
            filled: 0,
            columns: vec![fresh; columns],
            time,
        }
    }

    /// Rows that become two entries; one means that every row stays.
    pub(crate) const fn every(&self) -> usize {
        self.every
    }

    /// Takes rows: one slice per column, all of one length.
    pub(crate) fn take(&mut self, block: &[&[f64]]) {
        let rows = block.first().map_or(0, |column| column.len());
        let time = self.time.and_then(|place| block.get(place).copied());
        for (column, values) in self.columns.iter_mut().zip(block) {
            column.marks.take(time, values);
        }
        if self.every == 1 {
            for (column, values) in self.columns.iter_mut().zip(block) {
                column.out.extend_from_slice(values);
            }
            return;
        }
        let mut from = 0;
        while from < rows {
            let to = (from + self.every - self.filled).min(rows);
            for (place, (column, values)) in self.columns.iter_mut().zip(block).enumerate() {
                let part = &values[from..to];
                if self.time == Some(place) {
                    column.time(part, self.filled, self.every / 2);
                } else {
                    column.extremes(time.map(|time| &time[from..to]), part, self.filled);
                }
            }
            self.filled += to - from;
            from = to;
            if self.filled == self.every {
                self.close();
            }
        }
    }

    /// Marks that rows are missing here: nothing is known at this time. A gap narrower than two entries is not visible.
    pub(crate) fn gap(&mut self, gap: Gap) {
        if gap.rows < self.every as u64 {
            // Without thinning every gap is wide enough.
            return;
        }
        if self.filled > 0 {
            self.close();
        }
        let entries = if self.every == 1 { 1 } else { 2 };
        for (place, column) in self.columns.iter_mut().enumerate() {
            let is_time = self.time == Some(place);
            let value = if is_time { gap.time } else { f64::NAN };
            column.out.extend(std::iter::repeat_n(value, entries));
            if self.every > 1 {
                column.times.extend(std::iter::repeat_n(gap.time, entries));
            }
        }
    }

    fn close(&mut self) {
        let bucket = self.time.and_then(|place| self.columns.get(place));
        let bucket = bucket.map(|time| [time.lo.2, time.hi.2]);
        for column in &mut self.columns {
            let (first, second) = if column.lo.0 <= column.hi.0 {
                (column.lo, column.hi)
            } else {
                (column.hi, column.lo)
            };
            column.out.extend([first.2, second.2]);
            let times = match bucket {
                Some(bucket) if first.2.is_nan() => bucket,
                _ => [first.1, second.1],
            };
            column.times.extend(times);
            column.lo = (0, f64::NAN, f64::NAN);
            column.hi = column.lo;
        }
        self.filled = 0;
    }

    /// The columns, each with the times of its entries; no times where every row was kept.
    pub(crate) fn finish(mut self) -> Vec<(Vec<f64>, Vec<f64>)> {
        if self.filled > 0 {
            self.close();
        }
        let columns = self.columns.into_iter();
        columns.map(|column| (column.times, column.out)).collect()
    }

    /// The columns by name, with their marks.
    pub fn table(self, names: impl IntoIterator<Item = Column>) -> Table {
        let marks = self.columns.iter().map(|column| column.marks).collect();
        let (times, values): (Vec<_>, Vec<_>) = self.finish().into_iter().unzip();
        Table {
            marks,
            times,
            ..Table::new(names.into_iter().zip(values).collect())
        }
    }
}

impl Thinning {
    fn extremes(&mut self, times: Option<&[f64]>, values: &[f64], filled: usize) {
        for (i, &value) in values.iter().enumerate() {
            if !value.is_finite() {
                continue;
            }
            let time = || times.and_then(|times| times.get(i).copied());
            let mark = || (filled + i, time().unwrap_or(f64::NAN), value);
            if self.lo.2.is_nan() || value < self.lo.2 {
                self.lo = mark();
            }
            if self.hi.2.is_nan() || value > self.hi.2 {
                self.hi = mark();
            }
        }
    }

    fn time(&mut self, values: &[f64], filled: usize, middle: usize) {
        if filled == 0
            && let Some(first) = values.first()
        {
            (self.lo, self.hi) = ((0, *first, *first), (1, *first, *first));
        }
        if let Some(value) = middle.checked_sub(filled).and_then(|at| values.get(at)) {
            self.hi = (1, *value, *value);
        }
    }
}

/// Columns by name, all of one length; some that were recorded are not among them.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Table {
    columns: Vec<(Column, Vec<f64>)>,
    /// As many, or none where nothing was marked.
    marks: Vec<Marks>,
    /// Times of the entries of each column; empty where they are those of the column of time.
    times: Vec<Vec<f64>>,
    places: HashMap<String, usize>,
}

impl Table {
    /// Of these columns.
    pub(crate) fn new(columns: Vec<(Column, Vec<f64>)>) -> Self {
        let names = columns.iter().enumerate().rev();
        let places = names
            .map(|(i, (column, _))| (column.name.clone(), i))
            .collect();
        Self {
            columns,
            marks: Vec::new(),
            times: Vec::new(),
            places,
        }
    }

    /// A column.
    pub(crate) fn get(&self, name: &str) -> Option<&[f64]> {
        Some(&self.columns.get(*self.places.get(name)?)?.1)
    }

    /// Times of the entries of a column.
    pub(crate) fn time_of(&self, name: &str) -> Option<&[f64]> {
        let own = self.times.get(*self.places.get(name)?);
        let own = own.filter(|times| !times.is_empty());
        own.map(Vec::as_slice).or_else(|| self.get("time"))
    }

    /// The marks of a column; empty if it does not exist.
    pub(crate) fn marks(&self, name: &str) -> Marks {
        let place = self.places.get(name);
        let marks = place.and_then(|place| self.marks.get(*place));
        marks.copied().unwrap_or_default()
    }

    /// Unit of a column; "1" of one that is not there.
    pub(crate) fn unit(&self, name: &str) -> &str {
        let place = self.places.get(name);
        let column = place.and_then(|place| self.columns.get(*place));
        column.map_or("1", |(column, _)| column.unit.as_str())
    }

    /// Names of the columns, in order.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(column, _)| column.name.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn extremes_survive_any_block_size(
            values in prop::collection::vec(prop_oneof![9 => -1e3f64..1e3, 1 => Just(f64::NAN)], 1..300),
            every in 1usize..40, block in 1usize..70,
        ) {
            let time: Vec<f64> = (0..values.len()).map(|i| i as f64).collect();
            let mut thinner = Thinner { every, ..Thinner::new(0, 2, Some(0)) };
            for (t, v) in time.chunks(block).zip(values.chunks(block)) {
                thinner.take(&[t, v]);
            }
            let (times, out): (Vec<_>, Vec<_>) = thinner.finish().into_iter().unzip();
            prop_assert_eq!(out[0].len(), out[1].len());
            if every == 1 {
                prop_assert_eq!(&out[0], &time);
                return Ok(());
            }
            prop_assert!(out[0].windows(2).all(|w| w[0] <= w[1]));
            for (i, bucket) in values.chunks(every).enumerate() {
                let finite = || bucket.iter().copied().filter(|v| v.is_finite());
                let pair = &out[1][2 * i..2 * i + 2];
                if finite().next().is_none() {
                    prop_assert!(pair.iter().all(|v| v.is_nan()));
                    continue;
                }
                let (lo, hi) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
                prop_assert_eq!((pair[0].min(pair[1]), pair[0].max(pair[1])), (lo, hi));
                let at = |wanted: f64| bucket.iter().position(|v| *v == wanted);
                prop_assert_eq!(pair[0] <= pair[1], at(lo) <= at(hi));
                prop_assert_eq!(out[0][2 * i], (i * every) as f64);
                // Each extreme has the time of its row.
                for (time, value) in times[1][2 * i..2 * i + 2].iter().zip(pair) {
                    prop_assert_eq!(values[*time as usize], *value);
                }
            }
        }
    }

    #[test]
    fn marks_come_from_single_rows() {
        let (time, values) = ([0.0, 1.0, 2.0, 3.0, 4.0], [1.0, -7.0, 7.0, f64::NAN, 5.0]);
        let marks = |every: usize, rows: usize| {
            let mut thinner = Thinner {
                every,
                ..Thinner::new(0, 2, Some(0))
            };
            for (t, v) in time[..rows].chunks(2).zip(values.chunks(2)) {
                thinner.take(&[t, &v[..t.len()]]);
            }
            let names = ["time", "x1"].map(|name| Column {
                name: name.to_owned(),
                unit: "1".to_owned(),
                meaning: String::new(),
                timing: false,
            });
            thinner.table(names).marks("x1")
        };
        for every in [1, 4] {
            let found = marks(every, 5);
            let lowest = Some(Mark {
                time: 1.0,
                value: -7.0,
            });
            assert_eq!((found.peak, found.least), (lowest, lowest));
            assert_eq!(found.last, Some(5.0));
            assert!(marks(every, 4).last.is_some_and(f64::is_nan));
        }
        assert_eq!(Table::default().marks("x1"), Marks::default());
    }

    #[test]
    fn missing_rows_leave_a_nan_entry() {
        for (every, wanted) in [(1, 1), (4, 2)] {
            let mut thinner = Thinner {
                every,
                ..Thinner::new(0, 2, Some(0))
            };
            thinner.take(&[&[0.0, 1.0], &[5.0, 6.0]]);
            thinner.gap(Gap {
                time: 8.0,
                rows: 12,
            });
            thinner.take(&[&[15.0, 16.0], &[7.0, 8.0]]);
            let (_, out): (Vec<_>, Vec<_>) = thinner.finish().into_iter().unzip();
            let empty: Vec<f64> = (0..out[0].len())
                .filter(|&i| out[1][i].is_nan())
                .map(|i| out[0][i])
                .collect();
            assert_eq!(empty, vec![8.0; wanted]);
            assert!(out[0].windows(2).all(|pair| pair[0] <= pair[1]));
        }
        // Narrower than a pair of entries.
        let mut thinner = Thinner {
            every: 4,
            ..Thinner::new(0, 1, None)
        };
        thinner.gap(Gap { time: 0.0, rows: 3 });
        assert!(thinner.finish()[0].1.is_empty());
    }

    #[test]
    fn long_test_is_thinned_short_one_is_not() {
        assert_eq!(Thinner::new(WHOLE as u64, 1, None).every(), 1);
        assert!(Thinner::new(WHOLE as u64, 1000, None).every() > 1);
        let rows = 5_000_000u64;
        let mut thinner = Thinner::new(rows, 1, None);
        let block = vec![1.0; 10_000];
        for _ in 0..rows / 10_000 {
            thinner.take(&[&block]);
        }
        let length = thinner.finish()[0].1.len();
        assert!((MOST / 2..=MOST + 2).contains(&length), "{length}");
    }
}
