//! IDA curves: intensity over a measure, for single motions and as fractiles.

use std::collections::BTreeMap;

use super::drawing::{curve, headed, of, picture, scale, short};
use super::found::Shown;
use super::fractile::{SHARES, fractile};
use super::measure::Measure;
use super::study::Study;
use crate::view::report::{Look, Scale, note, table};

/// Most tests whose single curves are drawn.
const MOST_SINGLE: usize = 5000;

/// IDA curves with their fractiles, and a table of the fractiles. `place` is the place of the measure among those with pictures.
pub(super) fn ida(study: &Study, measure: &Measure, place: usize, shown: &[Shown]) -> String {
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
    let edge = high + 0.08 * (high - low);
    let (x, y) = single(study, place, shown, edge);
    let rows = at_levels(&levels, place, shown);
    let lines = [0, 1, 2].map(|share| flat(&levels, &rows, share, edge));
    let mut curves = vec![curve("single motions", &x, &y, Look::Faint)];
    let names = SHARES.map(|share| format!("{:.0} % fractile", 100.0 * share));
    let looks = [Look::Dashed, Look::Strong, Look::Dashed];
    for ((name, (x, y)), look) in names.iter().zip(&lines).zip(looks) {
        curves.push(curve(name, x, y, look));
    }
    // Levels at which every structure collapses have no curve.
    let most = 1.12 * y.iter().copied().fold(0.0, f64::max);
    let criterion = criterion.map(|one| ([one.above; 2], [0.0, most]));
    if let Some((x, y)) = &criterion {
        curves.push(curve("criterion of collapse", x, y, Look::Reference));
    }
    let first = study.levelled();
    let words = first.map(|one| one.words()).unwrap_or_default();
    let unit = first.map(|one| one.unit()).unwrap_or_default();
    let across = Scale {
        range: (edge > low).then_some((low, edge)),
        ..of(measure)
    };
    let up = Scale {
        range: (most > 0.0).then_some((0.0, most)),
        ..scale(&words, &unit)
    };
    let title = format!("IDA curves: {}", measure.name);
    picture(&title, across, up, &curves) + &explained(&rows) + &listed(measure, &unit, &rows)
}

/// Fractiles of a measure at one level.
struct Row {
    level: f64,
    fractiles: [f64; SHARES.len()],
    collapsed: usize,
    tests: usize,
}

fn explained(rows: &[Row]) -> String {
    let mut text =
        "The fractiles are those of the measure at each intensity, over all tests.".to_owned();
    if rows.iter().any(|row| row.collapsed > 0) {
        text += " A collapsed structure counts as an infinite value. A curve becomes flat at its highest intensity without \
                 collapse.";
    }
    note(&text)
}

fn listed(measure: &Measure, unit: &str, rows: &[Row]) -> String {
    let cells = rows.iter().map(|row| {
        let mut cells = vec![short(row.level)];
        cells.extend(row.fractiles.map(short));
        cells.push(format!("{} of {}", row.collapsed, row.tests));
        cells
    });
    let cells: Vec<Vec<String>> = cells.collect();
    let mut heads = vec![headed("intensity", unit)];
    heads.extend(SHARES.map(|share| headed(&format!("{:.0} %", 100.0 * share), &measure.unit)));
    heads.push("collapsed".to_owned());
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    table(&heads, &cells)
}

/// The value of a test: infinite if the structure has collapsed.
fn value(one: &Shown, place: usize) -> f64 {
    if one.collapsed {
        f64::INFINITY
    } else {
        one.values[place]
    }
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

/// Points of a curve over rising levels. It goes flat to `edge` where the values become infinite, and ends there.
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
fn at_levels(levels: &[f64], place: usize, shown: &[Shown]) -> Vec<Row> {
    let mut values: BTreeMap<u64, Vec<f64>> = BTreeMap::new();
    for one in shown {
        if let Some(level) = one.level {
            let of_level = values.entry(level.to_bits()).or_default();
            of_level.push(value(one, place));
        }
    }
    let row = |level: &f64| {
        let values = values.remove(&level.to_bits()).unwrap_or_default();
        Row {
            level: *level,
            fractiles: SHARES.map(|share| fractile(&values, share).unwrap_or(f64::NAN)),
            collapsed: values.iter().filter(|value| value.is_infinite()).count(),
            tests: values.len(),
        }
    };
    levels.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_goes_flat_at_its_highest_level_without_collapse() {
        let infinite = f64::INFINITY;
        let (x, y) = flattened(&[1.0, 2.0, 3.0, 4.0], &[0.1, 0.3, infinite, infinite], 0.5);
        assert_eq!((x, y), (vec![0.1, 0.3, 0.5], vec![1.0, 2.0, 2.0]));
        // A collapse at the first level has no curve, and a curve without collapse has no flat line.
        assert_eq!(flattened(&[1.0], &[infinite], 0.5), (vec![], vec![]));
        assert_eq!(flattened(&[1.0], &[0.2], 0.5), (vec![0.2], vec![1.0]));
    }

    #[test]
    fn fractiles_of_a_level_count_a_collapse_as_infinite() {
        let shown: Vec<Shown> = (0..10)
            .map(|index| Shown {
                index,
                level: Some(if index < 5 { 0.5 } else { 1.0 }),
                collapsed: index >= 7,
                values: vec![index as f64],
            })
            .collect();
        let rows = at_levels(&[0.5, 1.0], 0, &shown);
        assert_eq!(rows[0].fractiles[1], 2.0);
        assert_eq!((rows[0].collapsed, rows[0].tests), (0, 5));
        assert_eq!(rows[1].fractiles[1], f64::INFINITY);
        assert_eq!((rows[1].collapsed, rows[1].tests), (3, 5));
    }
}
