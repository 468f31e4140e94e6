//! All pairs of the drawn numbers and the measures of a report, with their rank correlations.

use maud::{Markup, html};

use super::drawing::{chart, scale, short};
use super::found::Shown;
use super::measure::Measure;
use super::random::bits;
use super::study::Study;
use super::task::Task;
use gusset_quantity::units::unit_in_name;
use gusset_view::report::{Look, beside, count, note, section, table};

/// Most numbers of the table.
const MOST_VARIABLES: usize = 6;
/// Most measures among them, if there are more keys than fit.
const MOST_MEASURES: usize = 3;
/// Most tests of the charts and of the correlations.
const MOST_TESTS: usize = 5000;
/// Most dots of one chart.
const MOST_DOTS: usize = 2000;
/// Charts of the strongest pairs.
const MOST_DRAWN: usize = 4;

/// A number of each test.
struct Column {
    /// Key or name of the measure.
    name: String,
    unit: String,
    values: Vec<f64>,
}

/// The section with the pairs; nothing without drawn numbers. `measures` are those with charts.
pub(super) fn pairs(study: &Study, measures: &[&Measure], shown: &[Shown]) -> Markup {
    let chosen = chosen(shown);
    if study.samples.is_empty() || chosen.len() < 2 {
        return Markup::default();
    }
    let draws: Vec<Vec<f64>> = chosen
        .iter()
        .map(|one| Task::of(study, one.index).attempted(study, one.attempt))
        .map(|task| task.draws)
        .collect();
    let keys = study.samples.iter().enumerate().map(|(place, one)| {
        let name = one.key.to_string();
        Column {
            unit: unit_in_name(&name).to_owned(),
            name,
            values: draws.iter().map(|row| row[place]).collect(),
        }
    });
    let mut columns: Vec<Column> = keys.collect();
    let results = measures.iter().enumerate().map(|(place, measure)| Column {
        name: measure.name.clone(),
        unit: measure.unit.clone(),
        values: chosen.iter().map(|one| one.values[place]).collect(),
    });
    let is_drawable = |column: &Column| column.values.iter().any(|value| value.is_finite());
    let mut results: Vec<Column> = results.filter(is_drawable).collect();
    let room = MOST_VARIABLES.saturating_sub(columns.len());
    results.truncate(room.max(MOST_MEASURES));
    let all = columns.len();
    if let Some(first) = results.first() {
        let strength = |column: &Column| {
            let found = rank_correlation(&column.values, &first.values).abs();
            if found.is_nan() { 0.0 } else { found }
        };
        columns.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
    }
    columns.truncate(MOST_VARIABLES - results.len());
    let kept = columns.len();
    columns.extend(results);
    let collapsed: Vec<bool> = chosen
        .iter()
        .map(|one| one.collapsed != Some(false))
        .collect();
    let mut text = "Rank correlation (Spearman) of each pair; the charts show the strongest pairs of a drawn number and a measure. ".to_owned();
    if kept < all {
        text += &format!(
            "The {kept} of {all} drawn numbers with the strongest correlation with the first measure are shown. "
        );
    }
    let dots = MOST_DOTS.min(chosen.len());
    if chosen.len() < shown.len() || dots < chosen.len() {
        text += &format!(
            "Correlations are of {} tests of {}, and {dots} of them have dots. The choice is random.",
            count(chosen.len() as u64),
            count(shown.len() as u64)
        );
    }
    let markup = html! {
        (correlations(&columns))
        (note(text.trim()))
        (strongest(&columns, kept, &collapsed))
        (listed(&columns))
    };
    section("Drawn numbers and measures", markup)
}

/// At most [`MOST_TESTS`] tests, in a random order that is a function of their numbers.
fn chosen(shown: &[Shown]) -> Vec<&Shown> {
    let mut all: Vec<(u64, &Shown)> = shown
        .iter()
        .map(|one| (bits(0, "pairs", one.index), one))
        .collect();
    all.sort_unstable_by_key(|(order, one)| (*order, one.index));
    all.truncate(MOST_TESTS);
    all.into_iter().map(|(_, one)| one).collect()
}

/// The rank correlation of each pair as a table.
fn correlations(columns: &[Column]) -> Markup {
    let names = short_names(columns);
    let row = |(one, name): (&Column, &String)| {
        let others = columns.iter().map(|other| {
            let found = rank_correlation(&one.values, &other.values);
            if found.is_finite() {
                format!("{found:.2}")
            } else {
                "–".to_owned()
            }
        });
        std::iter::once(name.clone()).chain(others).collect()
    };
    let rows: Vec<Vec<String>> = columns.iter().zip(&names).map(row).collect();
    let heads: Vec<&str> = std::iter::once("All pairs")
        .chain(names.iter().map(String::as_str))
        .collect();
    table(&heads, &rows)
}

/// Charts of the pairs of a drawn number and a measure that are correlated most. The first `drawn` columns are drawn numbers.
fn strongest(columns: &[Column], drawn: usize, collapsed: &[bool]) -> Markup {
    let names = short_names(columns);
    let strength = |(key, result): (usize, usize)| {
        let found = rank_correlation(&columns[key].values, &columns[result].values).abs();
        if found.is_nan() { 0.0 } else { found }
    };
    let pairs = (0..drawn).flat_map(|key| (drawn..columns.len()).map(move |result| (key, result)));
    let mut pairs: Vec<(usize, usize)> = pairs.collect();
    pairs.sort_by(|a, b| strength(*b).total_cmp(&strength(*a)));
    let figure = |(across, up): (usize, usize)| {
        let (x, y) = (&columns[across], &columns[up]);
        let title = format!("{} over {}", names[up], names[across]);
        let chart = chart(
            title,
            scale(&names[across], &x.unit),
            scale(&names[up], &y.unit),
        );
        let kinds = [
            ("test to its end", false),
            ("collapsed, or stopped before its end", true),
        ];
        let chart = kinds.into_iter().fold(chart, |chart, (name, kind)| {
            let tests = x
                .values
                .iter()
                .zip(&y.values)
                .zip(collapsed)
                .take(MOST_DOTS);
            let own = tests.filter(|(_, is_marked)| **is_marked == kind);
            let (x, y): (Vec<f64>, Vec<f64>) = own.map(|((x, y), _)| (*x, *y)).unzip();
            if x.is_empty() {
                chart
            } else {
                chart.with(name, x, y, Look::Dots)
            }
        });
        chart.figure()
    };
    beside(
        "grid",
        html! { @for pair in pairs.into_iter().take(MOST_DRAWN) { (figure(pair)) } },
    )
}

/// Names for the axes: the shortest unique end of a key.
fn short_names(columns: &[Column]) -> Vec<String> {
    let ending = |name: &str, parts: usize| {
        let all: Vec<&str> = name.split('.').collect();
        all[all.len().saturating_sub(parts)..].join(".")
    };
    let named = |column: &Column| {
        let is_alone = |parts: &usize| {
            let own = ending(&column.name, *parts);
            let same = columns
                .iter()
                .filter(|other| ending(&other.name, *parts) == own);
            same.count() == 1 && !own.starts_with(|c: char| c.is_ascii_digit())
        };
        let parts = (1..16).find(is_alone).unwrap_or(16);
        ending(&column.name, parts)
    };
    columns.iter().map(named).collect()
}

/// Mean, standard deviation and ends of each number.
fn listed(columns: &[Column]) -> Markup {
    let rows: Vec<Vec<String>> = columns
        .iter()
        .map(|column| {
            let values = column
                .values
                .iter()
                .copied()
                .filter(|value| value.is_finite());
            let values: Vec<f64> = values.collect();
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let square = values
                .iter()
                .map(|value| (value - mean) * (value - mean))
                .sum::<f64>();
            let low = values.iter().copied().fold(f64::NAN, f64::min);
            let high = values.iter().copied().fold(f64::NAN, f64::max);
            let unit = if column.unit == "1" { "" } else { &column.unit };
            let numbers = [mean, (square / (count - 1.0)).sqrt(), low, high].map(short);
            let mut row = vec![column.name.clone(), unit.to_owned()];
            row.extend(numbers);
            row
        })
        .collect();
    let heads = [
        "number",
        "unit",
        "mean",
        "standard deviation",
        "smallest",
        "largest",
    ];
    table(&heads, &rows)
}

/// Spearman's rank correlation over the pairs of finite values; NaN if one of them does not vary.
fn rank_correlation(x: &[f64], y: &[f64]) -> f64 {
    let pairs = x
        .iter()
        .zip(y)
        .filter(|(x, y)| x.is_finite() && y.is_finite());
    let (x, y): (Vec<f64>, Vec<f64>) = pairs.map(|(x, y)| (*x, *y)).unzip();
    let (x, y) = (ranks(&x), ranks(&y));
    let middle = (x.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| -> f64 {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - middle) * (b - middle))
            .sum()
    };
    product(&x, &y) / (product(&x, &x) * product(&y, &y)).sqrt()
}

/// The rank of each value from 0; equal values have the mean of their ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    for group in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let rank = from as f64 + (group.len() as f64 - 1.0) / 2.0;
        for place in group {
            ranks[*place] = rank;
        }
        from += group.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::super::measure::End;
    use super::*;

    #[test]
    fn ranks_ignore_monotone_transformations() {
        let x: Vec<f64> = (0..50).map(|i| f64::from(i * 7 % 50)).collect();
        let up: Vec<f64> = x.iter().map(|x| libm::exp(0.1 * x)).collect();
        let down: Vec<f64> = x.iter().map(|x| -x * x * x).collect();
        // Sums of whole and half numbers are exact.
        assert_eq!(rank_correlation(&x, &up), 1.0);
        assert_eq!(rank_correlation(&x, &down), -1.0);
        let mut with_gap = up.clone();
        with_gap[3] = f64::NAN;
        assert_eq!(rank_correlation(&x, &with_gap), 1.0);
        assert!(rank_correlation(&x, &[1.0; 50]).is_nan());
    }

    #[test]
    fn equal_values_share_their_mean_rank() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), [2.5, 0.0, 2.5, 1.0]);
        // By hand: Σ(x−1.5)(y−1.5) = 4.5, 4.5 and 5 for the squares.
        let found = rank_correlation(&[3.0, 1.0, 3.0, 2.0], &[4.0, 1.0, 3.0, 2.0]);
        assert!(
            (found - 4.5 / (4.5_f64 * 5.0).sqrt()).abs() < 1e-12,
            "{found}"
        );
    }

    #[test]
    fn names_are_as_short_as_they_can_be() {
        let column = |name: &str, unit: &str| Column {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values: Vec::new(),
        };
        let columns = [
            column("specimen.0.law.linear.stiffness_n_per_m", "N/m"),
            column("specimen.1.law.linear.stiffness_n_per_m", "N/m"),
            column("structure.damping.ratio", ""),
            column("list.3", ""),
            column("max_drift", "m"),
        ];
        assert_eq!(
            short_names(&columns),
            [
                "specimen.0.law.linear.stiffness_n_per_m",
                "specimen.1.law.linear.stiffness_n_per_m",
                "ratio",
                "list.3",
                "max_drift"
            ]
        );
    }

    #[test]
    fn chosen_tests_are_few_and_independent() {
        let shown: Vec<Shown> = (0..20_000)
            .map(|index| Shown {
                index,
                level: None,
                collapsed: Some(false),
                end: End::Whole,
                attempt: 0,
                values: Vec::new(),
            })
            .collect();
        let few = chosen(&shown);
        assert_eq!(few.len(), MOST_TESTS);
        let mean = few.iter().map(|one| one.index as f64).sum::<f64>() / few.len() as f64;
        // The mean of 5000 random numbers below 20 000 has a standard deviation of 71.
        assert!((mean - 10_000.0).abs() < 300.0, "{mean}");
    }
}
