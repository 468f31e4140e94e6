//! Sensitivity of a measure in a one-at-a-time design: the range of the measure over the values of each key.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::design::alone;
use super::drawing::{headed, short};
use super::found::Shown;
use super::measure::Measure;
use super::study::Study;
use gusset_config::Scalar;
use gusset_quantity::units::{number, unit_in_name};
use gusset_view::report::{note, table};

/// Name of the unaltered test.
const BASE: &str = "test file";

/// The smallest and the largest result of one key, each with the value of the key.
struct Range {
    key: String,
    low: (f64, String),
    high: (f64, String),
}

impl Range {
    fn width(&self) -> f64 {
        self.high.0 - self.low.0
    }
}

/// Sum and number of the values of one point of the design.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: u64,
}

impl Mean {
    fn take(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    fn value(self) -> f64 {
        self.sum / self.count as f64
    }
}

/// A table of the ranges, the largest first; `place` is the place of the measure among those with pictures.
pub(super) fn sensitivity(
    study: &Study,
    measure: &Measure,
    place: usize,
    shown: &[Shown],
) -> Markup {
    let means = means(study, place, shown);
    let base = means.get(&None).map(|mean| mean.value());
    let mut ranges: Vec<Range> = (0..study.axes.len())
        .filter_map(|axis| range(study, axis, &means, base))
        .collect();
    ranges.sort_by(|a, b| b.width().total_cmp(&a.width()));
    if ranges.is_empty() {
        return note("No test with an altered key has a value.");
    }
    let rows: Vec<Vec<String>> = ranges.iter().map(row).collect();
    let unit = &measure.unit;
    let heads = [
        "key".to_owned(),
        headed("smallest", unit),
        "at".to_owned(),
        headed("largest", unit),
        "at".to_owned(),
        headed("range", unit),
    ];
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let mut text =
        "Each row has the smallest and the largest result of one key, and the value of the key there."
            .to_owned();
    if let Some(base) = base {
        text += &format!(" The result of the test file is {}.", short(base));
    }
    let tests = means.values().map(|mean| mean.count).max().unwrap_or(1);
    if tests > 1 {
        text += &format!(" Each result is the mean of {tests} tests.");
    }
    html! { (note(&text)) (table(&heads, &rows)) }
}

fn row(range: &Range) -> Vec<String> {
    let Range { key, low, high } = range;
    let cells = [
        key.clone(),
        short(low.0),
        low.1.clone(),
        short(high.0),
        high.1.clone(),
        short(range.width()),
    ];
    cells.to_vec()
}

/// The mean of the measure over the tests of each point; the key is an axis and the place of its value.
fn means(study: &Study, place: usize, shown: &[Shown]) -> BTreeMap<Option<(usize, usize)>, Mean> {
    let per_point = study.shots() * study.loaded.study.campaign.replicates;
    let mut means: BTreeMap<Option<(usize, usize)>, Mean> = BTreeMap::new();
    for one in shown.iter().filter(|one| one.values[place].is_finite()) {
        let point = alone(&study.axes, one.index / per_point);
        means.entry(point).or_default().take(one.values[place]);
    }
    means
}

/// The range of an axis; `None` if no test of it has a value.
fn range(
    study: &Study,
    axis: usize,
    means: &BTreeMap<Option<(usize, usize)>, Mean>,
    base: Option<f64>,
) -> Option<Range> {
    let key = &study.axes[axis].key;
    let of_axis = means.range(Some((axis, 0))..Some((axis + 1, 0)));
    let mut results: Vec<(f64, String)> = of_axis
        .filter_map(|(point, mean)| {
            let value = study.axes[axis].values.get(point.as_ref()?.1)?;
            Some((mean.value(), in_words(value, unit_in_name(key))))
        })
        .collect();
    if results.is_empty() {
        return None;
    }
    results.extend(base.map(|base| (base, BASE.to_owned())));
    results.sort_by(|a, b| a.0.total_cmp(&b.0));
    Some(Range {
        key: key.clone(),
        low: results[0].clone(),
        high: results[results.len() - 1].clone(),
    })
}

/// A value of a key for people.
fn in_words(value: &Scalar, unit: &str) -> String {
    let of_number = |value: f64| match unit {
        "" => number(value),
        unit => format!("{} {unit}", number(value)),
    };
    match value {
        Scalar::Whole(value) => of_number(*value as f64),
        Scalar::Real(value) => of_number(*value),
        Scalar::Text(text) => text.clone(),
        Scalar::Flag(value) => value.to_string(),
    }
}
