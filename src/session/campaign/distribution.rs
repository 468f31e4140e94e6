//! Histogram and exceedance of a measure.

use maud::{Markup, html};

use super::drawing::{chart, of, short};
use super::measure::Measure;
use gusset_view::report::{Look, Scale, beside, note};

/// Most points of an exceedance curve.
const MOST_POINTS: usize = 2000;

/// Histogram and exceedance of a measure.
pub(super) fn distribution(measure: &Measure, values: &[f64]) -> Markup {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let (Some(low), Some(high)) = (sorted.first().copied(), sorted.last().copied()) else {
        return note("No test has a value.");
    };
    let missing = values.len() - sorted.len();
    let below = html! {
        @if missing > 0 { (note(&format!("{missing} tests without a finite value are not in these charts."))) }
    };
    if high <= low {
        return html! { (note(&format!("All tests have the value {}.", short(low)))) (below) };
    }
    let (edges, shares) = histogram(&sorted, low, high);
    let tallest = shares.iter().copied().fold(0.0, f64::max);
    let (x, y) = exceedance(&sorted);
    let name = &measure.name;
    let counted = Scale::new("share of the tests", "1").within(Some((0.0, 1.08 * tallest)));
    let exceeded = Scale::new("share of the tests above this value", "1").within(Some((0.0, 1.0)));
    let bars = chart(format!("Histogram: {name}"), of(measure), counted).with(
        "",
        edges,
        shares,
        Look::Bars,
    );
    let above =
        chart(format!("Exceedance: {name}"), of(measure), exceeded).with("", x, y, Look::Strong);
    html! { (beside("grid", html! { (bars.figure()) (above.figure()) })) (below) }
}

/// Edges of the bars, and the share of the values in each. The last edge has no bar.
fn histogram(sorted: &[f64], low: f64, high: f64) -> (Vec<f64>, Vec<f64>) {
    let count = sorted.len() as f64;
    let bars = (count.sqrt().ceil() as usize).clamp(5, 40);
    let width = (high - low) / bars as f64;
    let mut counts = vec![0_u64; bars];
    for value in sorted {
        counts[(((value - low) / width) as usize).min(bars - 1)] += 1;
    }
    let edges = (0..=bars).map(|edge| low + edge as f64 * width).collect();
    let mut shares: Vec<f64> = counts.iter().map(|number| *number as f64 / count).collect();
    shares.push(0.0);
    (edges, shares)
}

/// Values, and the share of the tests above each: a step at each value.
fn exceedance(sorted: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let count = sorted.len();
    let every = count.div_ceil(MOST_POINTS);
    let (mut x, mut y) = (vec![sorted[0]], vec![1.0]);
    for (place, value) in sorted.iter().enumerate() {
        if (place + 1) % every == 0 || place + 1 == count {
            let before = y[y.len() - 1];
            x.extend([*value, *value]);
            y.extend([before, (count - place - 1) as f64 / count as f64]);
        }
    }
    (x, y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_histogram_have_the_sum_one() {
        let sorted: Vec<f64> = (0..1000).map(f64::from).collect();
        let (edges, shares) = histogram(&sorted, 0.0, 999.0);
        assert_eq!(edges.len(), shares.len());
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(edges[edges.len() - 1], 999.0);
    }

    #[test]
    fn exceedance_falls_from_one_to_zero() {
        for count in [2, 7, 100_000] {
            let sorted: Vec<f64> = (0..count).map(f64::from).collect();
            let (x, y) = exceedance(&sorted);
            assert!(x.len() == y.len() && x.len() <= 2 * MOST_POINTS + 3);
            assert_eq!((y[0], y[y.len() - 1]), (1.0, 0.0));
            assert!(y.windows(2).all(|pair| pair[1] <= pair[0]));
            let half = y.iter().position(|share| *share < 0.5).unwrap();
            let middle = f64::from(count) / 2.0;
            assert!((x[half] - middle).abs() <= 1.0 + f64::from(count) / 1000.0);
        }
    }
}
