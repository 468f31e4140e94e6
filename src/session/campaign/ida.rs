//! IDA curves: intensity over a measure, for single motions and as fractiles.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::drawing::{chart, headed, of, scale, short};
use super::found::Shown;
use super::fractile::{SHARES, fractile};
use super::measure::{End, Measure};
use super::study::Study;
use gusset_view::report::{Look, note, table};

/// Edge of a picture with a criterion of collapse, as a multiple of its value.
const FARTHEST: f64 = 4.0;
/// Below every value, and finite: differences of it and of values are finite, too.
const LEAST: f64 = -1e300;
/// Most tests whose single curves are drawn.
const MOST_SINGLE: usize = 5000;

/// IDA curves with their fractiles, and a table of the fractiles. `place` is the place of the measure among those with pictures.
pub(super) fn ida(study: &Study, measure: &Measure, place: usize, shown: &[Shown]) -> Markup {
    let mut levels: Vec<f64> = shown.iter().filter_map(|one| one.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let collapse = study.loaded.study.measure.collapse.as_ref();
    let criterion = collapse.filter(|one| one.measure == measure.name);
    let finite = shown.iter().filter(|one| one.level.is_some());
    let finite = finite
        .map(|one| value(one, place))
        .filter(|v| v.is_finite());
    let finite: Vec<f64> = finite.chain(criterion.map(|one| one.above)).collect();
    let low = finite.iter().copied().fold(0.0, f64::min);
    let high = finite.iter().copied().fold(0.0, f64::max);
    // Values near a collapse may be many times the others. A curve ends at the edge.
    let most = criterion.map_or(f64::INFINITY, |one| FARTHEST * one.above.abs());
    let edge = (high + 0.08 * (high - low)).min(most);
    let (x, y) = single(study, place, shown, edge);
    let rows = at_levels(&levels, place, measure.grows(), shown);
    let lines = [0, 1, 2].map(|share| flat(&levels, &rows, share, edge));
    // Levels at which every structure collapses have no curve.
    let most = 1.12 * y.iter().copied().fold(0.0, f64::max);
    let first = study.levelled();
    let words = first.map(|one| one.words()).unwrap_or_default();
    let unit = first.map(|one| one.unit()).unwrap_or_default();
    let across = of(measure).within((edge > low).then_some((low, edge)));
    let up = scale(&words, &unit).within((most > 0.0).then_some((0.0, most)));
    let mut chart = chart(format!("IDA curves: {}", measure.name), across, up).with(
        "single motions",
        x,
        y,
        Look::Faint,
    );
    let looks = [Look::Dashed, Look::Strong, Look::Dashed];
    for ((share, (x, y)), look) in SHARES.iter().zip(lines).zip(looks) {
        chart = chart.with(format!("{:.0} % fractile", 100.0 * share), x, y, look);
    }
    if let Some(one) = criterion {
        chart = chart.with(
            "criterion of collapse",
            vec![one.above; 2],
            vec![0.0, most],
            Look::Reference,
        );
    }
    html! { (chart.figure()) (explained(&rows)) (listed(measure, &unit, &rows)) }
}

/// Fractiles of a measure at one level.
struct Row {
    level: f64,
    fractiles: [f64; SHARES.len()],
    collapsed: usize,
    /// Tests that a limit or a fault stopped.
    stopped: usize,
    tests: usize,
}

fn explained(rows: &[Row]) -> Markup {
    let mut text =
        "The fractiles are those of the measure at each intensity, over all tests. A test that diverged counts as an infinite value: \
         a curve becomes flat at its highest intensity with a finite value."
            .to_owned();
    if rows.iter().any(|row| row.stopped > 0) {
        text += " A limit or a fault stopped some tests: their values are not known. Their curves end before, and a fractile that \
                 depends on them is not shown.";
    }
    note(&text)
}

fn listed(measure: &Measure, unit: &str, rows: &[Row]) -> Markup {
    let cells = rows.iter().map(|row| {
        let mut cells = vec![short(row.level)];
        cells.extend(row.fractiles.map(short));
        cells.push(format!("{} of {}", row.collapsed, row.tests));
        cells.push(format!("{} of {}", row.stopped, row.tests));
        cells
    });
    let cells: Vec<Vec<String>> = cells.collect();
    let mut heads = vec![headed("intensity", unit)];
    heads.extend(SHARES.map(|share| headed(&format!("{:.0} %", 100.0 * share), &measure.unit)));
    heads.extend(["collapsed", "stopped"].map(str::to_owned));
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    table(&heads, &cells)
}

/// The value of a test: infinite if the response diverged, and NaN if something else stopped the test.
fn value(one: &Shown, place: usize) -> f64 {
    match one.end {
        End::Diverged => f64::INFINITY,
        End::Whole => one.values[place],
        End::Stopped | End::Invalid => f64::NAN,
    }
}

/// The fractiles of a level. One that depends on the values of stopped tests is not a number: they are between the value at their end
/// (if the measure `grows`) and infinity.
fn fractiles(tests: &[&Shown], place: usize, grows: bool) -> [f64; SHARES.len()] {
    let values = |of_stopped: &dyn Fn(&Shown) -> f64| -> Vec<f64> {
        let one = |test: &&Shown| match test.end {
            End::Stopped => of_stopped(test),
            _ => value(test, place),
        };
        tests.iter().map(one).collect()
    };
    let least = values(&|test| if grows { test.values[place] } else { LEAST });
    let most = values(&|_| f64::INFINITY);
    SHARES.map(|share| {
        let [least, most] = [&least, &most].map(|all| fractile(all, share).unwrap_or(f64::NAN));
        if least == most { least } else { f64::NAN }
    })
}

/// The point of the design, the motion and the draw of a test: tests that differ in their level only are one curve.
fn curve_of(study: &Study, index: u64) -> (u64, u64, u64) {
    let replicates = study.loaded.study.campaign.replicates;
    let (rest, replicate) = (index / replicates, index % replicates);
    let (point, mut shot) = (rest / study.shots(), rest % study.shots());
    let mut before = 0;
    for motions in &study.motions {
        let levels = motions.levels.len().max(1) as u64;
        if shot < motions.count() {
            return (point, before + shot / levels, replicate);
        }
        shot -= motions.count();
        before += motions.motions.len() as u64;
    }
    (point, before, replicate)
}

/// One curve for each motion and draw. Curves are separated by values that are no numbers.
fn single(study: &Study, place: usize, shown: &[Shown], edge: f64) -> (Vec<f64>, Vec<f64>) {
    let mut all: BTreeMap<(u64, u64, u64), Vec<(f64, f64)>> = BTreeMap::new();
    for one in shown {
        if let Some(level) = one.level {
            let points = all.entry(curve_of(study, one.index)).or_default();
            points.push((level, value(one, place)));
        }
    }
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for mut points in all.into_values() {
        if x.len() + points.len() > MOST_SINGLE {
            break;
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (levels, values): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let (own_x, own_y) = flattened(&levels, &values, edge);
        x.extend(own_x.into_iter().chain([f64::NAN]));
        y.extend(own_y.into_iter().chain([f64::NAN]));
    }
    (x, y)
}

/// The curve of a fractile.
fn flat(levels: &[f64], rows: &[Row], share: usize, edge: f64) -> (Vec<f64>, Vec<f64>) {
    let values: Vec<f64> = rows.iter().map(|row| row.fractiles[share]).collect();
    flattened(levels, &values, edge)
}

/// Points of a curve over rising levels. It continues flat to `edge` where the values become infinite, and ends there. An unknown
/// value leaves a gap.
fn flattened(levels: &[f64], values: &[f64], edge: f64) -> (Vec<f64>, Vec<f64>) {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for (level, value) in levels.iter().zip(values) {
        if *value == f64::INFINITY {
            if let Some(last) = y.last().copied() {
                x.push(edge);
                y.push(last);
            }
            break;
        }
        x.push(*value);
        y.push(*level);
    }
    (x, y)
}

/// The fractiles at each of the levels.
fn at_levels(levels: &[f64], place: usize, grows: bool, shown: &[Shown]) -> Vec<Row> {
    let mut tests: BTreeMap<u64, Vec<&Shown>> = BTreeMap::new();
    for one in shown {
        if let Some(level) = one.level {
            tests.entry(level.to_bits()).or_default().push(one);
        }
    }
    let row = |level: &f64| {
        let tests = tests.remove(&level.to_bits()).unwrap_or_default();
        let count = |of: &dyn Fn(&Shown) -> bool| tests.iter().filter(|one| of(one)).count();
        Row {
            level: *level,
            fractiles: fractiles(&tests, place, grows),
            collapsed: count(&|one| one.collapsed == Some(true)),
            stopped: count(&|one| one.end == End::Stopped),
            tests: tests.len(),
        }
    };
    levels.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curve_is_flat_at_its_highest_level() {
        let infinite = f64::INFINITY;
        let (x, y) = flattened(&[1.0, 2.0, 3.0, 4.0], &[0.1, 0.3, infinite, infinite], 0.5);
        assert_eq!((x, y), (vec![0.1, 0.3, 0.5], vec![1.0, 2.0, 2.0]));
        // A collapse at the first level has no curve, and a curve without collapse has no flat line.
        assert_eq!(flattened(&[1.0], &[infinite], 0.5), (vec![], vec![]));
        assert_eq!(flattened(&[1.0], &[0.2], 0.5), (vec![0.2], vec![1.0]));
    }

    /// Ten tests at each of two levels; `end` of the last ones.
    fn tests(last: usize, end: End) -> Vec<Shown> {
        let all = 0..20;
        all.map(|index: u64| {
            let is_last = index as usize >= 20 - last;
            Shown {
                index,
                level: Some(if index < 10 { 0.5 } else { 1.0 }),
                collapsed: Some(index >= 15),
                end: if is_last { end } else { End::Whole },
                attempt: 0,
                values: vec![index as f64],
            }
        })
        .collect()
    }

    #[test]
    fn values_above_the_criterion_stay_finite() {
        let rows = at_levels(&[0.5, 1.0], 0, true, &tests(0, End::Whole));
        assert_eq!((rows[0].fractiles[1], rows[0].collapsed), (4.5, 0));
        // Half of them are above the criterion, and the median is still that of the values.
        assert_eq!((rows[1].fractiles[1], rows[1].collapsed), (14.5, 5));
        let diverged = at_levels(&[1.0], 0, true, &tests(6, End::Diverged));
        assert_eq!(diverged[0].fractiles[1], f64::INFINITY);
        assert_eq!(diverged[0].stopped, 0);
    }

    #[test]
    fn stopped_test_keeps_unaffected_results() {
        // The last two values are 18 and 19, or more.
        let rows = at_levels(&[1.0], 0, true, &tests(2, End::Stopped));
        let [low, middle, high] = rows[0].fractiles;
        assert!((low - 11.44).abs() < 1e-12 && middle == 14.5 && high.is_nan());
        assert_eq!(rows[0].stopped, 2);
        let rows = at_levels(&[1.0], 0, true, &tests(6, End::Stopped));
        assert!(rows[0].fractiles[1].is_nan() && rows[0].fractiles[0] == low);
        // A residual does not bound its later value.
        let rows = at_levels(&[1.0], 0, false, &tests(2, End::Stopped));
        assert!(rows[0].fractiles.iter().all(|value| value.is_nan()));
        let value = f64::NAN;
        let (x, y) = flattened(&[1.0, 2.0], &[0.1, value], 0.5);
        assert!(x[1].is_nan() && y == [1.0, 2.0]);
    }
}
