//! IDA curves: intensity over a measure, for single motions and as fractiles.

use super::drawing::{of, picture, scale, short};
use super::found::Shown;
use super::fractile::{SHARES, fractile};
use super::measure::Measure;
use super::study::Study;
use crate::view::report::{Curve, Scale, note, table};

/// Most tests whose single curves are drawn.
const MOST_CURVES: usize = 5000;

/// IDA curves with their fractiles, and a table of the fractiles. `place` is the place of the measure among those with pictures.
pub(super) fn ida(study: &Study, measure: &Measure, place: usize, shown: &[Shown]) -> String {
    let mut levels: Vec<f64> = shown.iter().filter_map(|one| one.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let (x, y) = single(study, place, shown);
    let largest = x.iter().copied().filter(|v| v.is_finite());
    let largest = largest.fold(0.0, f64::max);
    let (rows, fractiles) = at_levels(&levels, place, shown);
    let curve = |name, x, y| Curve {
        name,
        x,
        y,
        dots: false,
        reference: false,
    };
    let names = SHARES.map(|share| format!("{:.0} % fractile", 100.0 * share));
    let mut curves = vec![curve("single motions", &x[..], &y[..])];
    let lines = names.iter().zip(&fractiles);
    curves.extend(lines.map(|(name, values)| curve(name.as_str(), values, &levels)));
    let first = study.motions.first();
    let words = first.map(|one| one.words()).unwrap_or_default();
    let unit = first.map(|one| one.unit()).unwrap_or_default();
    let across = Scale {
        range: (largest > 0.0).then_some((0.0, 1.05 * largest)),
        ..of(measure)
    };
    let title = format!("IDA curves: {}", measure.name);
    let head = ["intensity", "16 %", "50 %", "84 %", "collapsed"];
    picture(&title, across, scale(&words, &unit), &curves)
        + &table(&head, &rows)
        + &note(
            "A collapsed structure counts as an infinite value. A curve ends where the structure collapses.",
        )
}

/// The value of a test: infinite if the structure has collapsed.
fn value(one: &Shown, place: usize) -> f64 {
    if one.collapsed {
        f64::INFINITY
    } else {
        one.values[place]
    }
}

/// One curve for each motion and draw. Curves are separated by values that are no numbers.
fn single(study: &Study, place: usize, shown: &[Shown]) -> (Vec<f64>, Vec<f64>) {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    let replicates = study.loaded.study.campaign.replicates;
    for replicate in 0..replicates {
        let mut last = f64::INFINITY;
        let own = shown
            .iter()
            .filter(|one| one.index % replicates == replicate);
        for one in own {
            let Some(level) = one.level.filter(|_| x.len() < MOST_CURVES) else {
                continue;
            };
            if level <= last {
                x.push(f64::NAN);
                y.push(f64::NAN);
            }
            last = level;
            let value = value(one, place);
            x.push(if value.is_finite() { value } else { f64::NAN });
            y.push(level);
        }
    }
    (x, y)
}

/// Rows of the table, and the values of each fractile.
fn at_levels(
    levels: &[f64],
    place: usize,
    shown: &[Shown],
) -> (Vec<Vec<String>>, [Vec<f64>; SHARES.len()]) {
    let mut fractiles = SHARES.map(|_| Vec::new());
    let mut rows = Vec::new();
    for level in levels {
        let at_level = shown.iter().filter(|one| one.level == Some(*level));
        let values: Vec<f64> = at_level.map(|one| value(one, place)).collect();
        let mut row = vec![short(*level)];
        for (share, line) in SHARES.iter().zip(&mut fractiles) {
            let found = fractile(&values, *share).unwrap_or(f64::NAN);
            row.push(short(found));
            line.push(if found.is_finite() { found } else { f64::NAN });
        }
        let collapsed = values.iter().filter(|value| value.is_infinite()).count();
        row.push(format!("{collapsed} of {}", values.len()));
        rows.push(row);
    }
    (rows, fractiles)
}
