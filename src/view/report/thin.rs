//! Fewer points, the same picture.
//!
//! Lines are reduced by Ramer–Douglas–Peucker. A history passes every row within a thousandth of its peak, at its time; a very long
//! one keeps the extremes of every few rows. A loop has its points within a distance from the *segment*: a loop that turns back on
//! itself keeps its turning point. A NaN is a gap: the line is broken there.

use super::axis::is_drawable;

/// A stretch of line without gaps.
pub(super) type Run = Vec<(f64, f64)>;

/// Largest share of a line's peak by which its history may miss a row, at its time.
const EXACT: f64 = 7e-4;
/// Points of a history at most, give or take its gaps.
pub(super) const MOST: usize = 4000;

/// Parts of a history of highest values.
const PARTS: usize = 800;

/// The points of a history for a page: within a thousandth of its peak, roundoff of the page included; of very many, the extremes of every few.
pub(super) fn history(x: &[f64], y: &[f64]) -> Run {
    let points = || x.iter().copied().zip(y.iter().copied());
    let drawable = points().filter(|(_, y)| is_drawable(*y));
    let peak = drawable.fold(0.0, |peak, (_, y)| y.abs().max(peak));
    let gap = (f64::NAN, f64::NAN);
    let runs = reduced(points(), EXACT * peak, height_off);
    let kept: Run = runs
        .iter()
        .flat_map(|run| std::iter::once(gap).chain(run.iter().copied()))
        .collect();
    if kept.len() <= MOST {
        return kept.into_iter().skip(1).collect();
    }
    extremes(x, y, MOST / 2)
}

/// The highest of `y` in each of some hundred parts: for lateness, of which only the worst counts. A gap is a NaN point.
pub(super) fn highest(x: &[f64], y: &[f64]) -> Run {
    let points: Run = x.iter().copied().zip(y.iter().copied()).collect();
    let parts = points.chunks(points.len().div_ceil(PARTS).max(1));
    let top = |part: &[(f64, f64)]| {
        let known = part.iter().filter(|point| is_drawable(point.1));
        let top = known.max_by(|a, b| a.1.total_cmp(&b.1));
        top.copied().unwrap_or((f64::NAN, f64::NAN))
    };
    parts.map(top).collect()
}

/// Lowest and highest of `y` in each of `parts` parts, in the order in which they came. A gap is a NaN point.
fn extremes(x: &[f64], y: &[f64], parts: usize) -> Run {
    let points: Run = x.iter().copied().zip(y.iter().copied()).collect();
    let mut out = Run::new();
    for part in points.chunks(points.len().div_ceil(parts).max(1)) {
        for stretch in part.split(|(x, y)| !(is_drawable(*x) && is_drawable(*y))) {
            let by_height = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
            let ends = stretch
                .iter()
                .min_by(by_height)
                .zip(stretch.iter().max_by(by_height));
            if let Some((lo, hi)) = ends {
                let (first, last) = if lo.0 <= hi.0 { (lo, hi) } else { (hi, lo) };
                out.extend([*first, *last]);
            } else if out.last().is_some_and(|last| !last.1.is_nan()) {
                out.push((f64::NAN, f64::NAN));
            }
        }
    }
    out
}

/// Points of one Douglas–Peucker piece: bounds the worst case of the recursion.
const PIECE: usize = 4096;

/// Squared distance of a point from the segment between two others.
type Distance = fn((f64, f64), (f64, f64), (f64, f64)) -> f64;

/// The line through `points`, without points that are within `tolerance` of it; gaps break it.
pub(super) fn within(points: impl Iterator<Item = (f64, f64)>, tolerance: f64) -> Vec<Run> {
    reduced(points, tolerance, squared_distance)
}

fn reduced(
    points: impl Iterator<Item = (f64, f64)>,
    tolerance: f64,
    distance: Distance,
) -> Vec<Run> {
    let mut runs = vec![Run::new()];
    for point in points {
        match runs.last_mut() {
            Some(run) if is_drawable(point.0) && is_drawable(point.1) => run.push(point),
            Some(run) if !run.is_empty() => runs.push(Run::new()),
            _ => {}
        }
    }
    runs.retain(|run| !run.is_empty());
    for run in &mut runs {
        *run = thinned(run, tolerance, distance);
    }
    runs
}

fn thinned(points: &[(f64, f64)], tolerance: f64, distance: Distance) -> Run {
    let mut out = Run::new();
    let mut start = 0;
    while start + 1 < points.len() {
        let end = (start + PIECE).min(points.len() - 1);
        keep(&points[start..=end], tolerance, distance, &mut out);
        start = end;
    }
    out.extend(points.last());
    out
}

/// Appends the points that must be kept, without the last one.
fn keep(points: &[(f64, f64)], tolerance: f64, distance: Distance, out: &mut Run) {
    let mut stack = vec![(0, points.len() - 1)];
    while let Some((from, to)) = stack.pop() {
        let (a, b) = (points[from], points[to]);
        let mut worst = (from, tolerance * tolerance);
        for (index, &p) in points.iter().enumerate().take(to).skip(from + 1) {
            let off = distance(p, a, b);
            if off > worst.1 {
                worst = (index, off);
            }
        }
        if worst.0 > from {
            stack.push((worst.0, to));
            stack.push((from, worst.0));
        } else {
            out.push(a);
        }
    }
}

/// Square of how far `p` is above or below the segment `a`–`b`, at its own x.
fn height_off(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let off = if b.0 > a.0 {
        p.1 - (a.1 + (b.1 - a.1) * (p.0 - a.0) / (b.0 - a.0))
    } else {
        // Several values at one time.
        p.1 - p.1.clamp(a.1.min(b.1), a.1.max(b.1))
    };
    off * off
}

/// Squared distance of `p` from the segment `a`–`b`.
fn squared_distance(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (px, py) = (p.0 - a.0, p.1 - a.1);
    let length = dx * dx + dy * dy;
    let along = if length > 0.0 {
        ((px * dx + py * dy) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let (ex, ey) = (px - along * dx, py - along * dy);
    ex * ex + ey * ey
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn numbers(n: usize) -> Vec<f64> {
        (0..n).map(|i| i as f64).collect()
    }

    proptest! {
        #[test]
        fn thinned_parts_keep_their_extremes(
            y in prop::collection::vec(prop_oneof![9 => -1e3f64..1e3, 1 => Just(f64::NAN)], 1..400), parts in 1usize..50,
        ) {
            let kept = extremes(&numbers(y.len()), &y, parts);
            let drawn: Vec<_> = kept.iter().filter(|p| p.1.is_finite()).collect();
            prop_assert!(drawn.windows(2).all(|w| w[0].0 <= w[1].0));
            for (px, py) in &drawn {
                prop_assert_eq!(y[*px as usize], *py);
            }
            let size = y.len().div_ceil(parts);
            for (number, part) in y.chunks(size).enumerate() {
                let own = drawn.iter().filter(|p| p.0 as usize / size == number).map(|p| p.1);
                let all = super::super::axis::extent(part.iter().copied());
                prop_assert_eq!(all, super::super::axis::extent(own));
            }
        }

        #[test]
        fn thinned_loop_stays_within_tolerance(
            steps in prop::collection::vec((-3.0f64..3.0, -3.0f64..3.0), 2..300), tolerance in 0.1f64..5.0,
        ) {
            let mut at = (0.0, 0.0);
            let points: Vec<_> = steps.iter().map(|s| { at = (at.0 + s.0, at.1 + s.1); at }).collect();
            let kept: Vec<_> = within(points.iter().copied(), tolerance).concat();
            prop_assert_eq!(kept.first(), points.first());
            prop_assert_eq!(kept.last(), points.last());
            for &p in &points {
                let nearest = kept.windows(2).map(|w| squared_distance(p, w[0], w[1])).fold(f64::INFINITY, f64::min);
                prop_assert!(nearest.sqrt() <= tolerance * (1.0 + 1e-12));
            }
        }
    }

    proptest! {
        #[test]
        fn a_followed_history_passes_every_row(
            steps in prop::collection::vec(prop_oneof![9 => -1.0f64..1.0, 1 => Just(f64::NAN)], 1..400),
            tolerance in 0.0f64..5.0,
        ) {
            let mut at = 0.0;
            let y: Vec<f64> = steps.iter().map(|s| { at += s; if at.is_nan() { at = 0.0; f64::NAN } else { at } }).collect();
            let x = numbers(y.len());
            let points = x.iter().copied().zip(y.iter().copied());
            let kept = reduced(points, tolerance, height_off).concat();
            prop_assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0));
            for (&x, &y) in x.iter().zip(&y).filter(|(_, y)| y.is_finite()) {
                let after = kept.iter().position(|p| p.0 >= x).unwrap();
                let (b, a) = (kept[after], kept[after.saturating_sub(1)]);
                let drawn = if b.0 == x { b.1 } else { a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0) };
                prop_assert!((drawn - y).abs() <= tolerance + 1e-9, "{x}: {drawn} {y}");
            }
            let top = |values: &mut dyn Iterator<Item = f64>| values.filter(|v| v.is_finite()).fold(f64::NEG_INFINITY, f64::max);
            let lost = top(&mut y.iter().copied()) - top(&mut kept.iter().map(|p| p.1));
            prop_assert!(!lost.is_finite() || (0.0..=tolerance + 1e-9).contains(&lost));
        }
    }

    #[test]
    fn two_values_at_one_time_are_both_followed() {
        let points = [0.0, 1.0, 1.0, 2.0].into_iter().zip([0.0, 0.0, 5.0, 5.0]);
        let kept = reduced(points, 0.1, height_off).concat();
        assert_eq!(kept, [(0.0, 0.0), (1.0, 0.0), (1.0, 5.0), (2.0, 5.0)]);
    }

    #[test]
    fn line_turning_back_keeps_its_end() {
        let points = [(0.0, 0.0), (5.0, 0.0), (10.0, 0.0), (5.0, 0.0), (1.0, 0.0)];
        assert_eq!(
            within(points.into_iter(), 0.1),
            [vec![(0.0, 0.0), (10.0, 0.0), (1.0, 0.0)]]
        );
    }

    #[test]
    fn a_gap_breaks_the_line() {
        let y = [1.0, 2.0, f64::NAN, 3.0, 4.0];
        assert_eq!(within(numbers(5).into_iter().zip(y), 0.0).len(), 2);
        assert!(within(std::iter::empty(), 1.0).is_empty());
        assert_eq!(
            history(&numbers(5), &y)
                .iter()
                .filter(|p| p.1.is_nan())
                .count(),
            1
        );
        assert_eq!(
            extremes(&numbers(5), &y, 2)
                .iter()
                .filter(|p| p.1.is_nan())
                .count(),
            1
        );
        assert!(history(&[0.0], &[f64::NAN]).is_empty());
    }

    #[test]
    fn highest_values_keep_gaps() {
        let y = [1.0, 3.0, f64::NAN, 2.0];
        let kept = highest(&numbers(4), &y);
        assert_eq!((kept[1], kept[3], kept.len()), ((1.0, 3.0), (3.0, 2.0), 4));
        assert!(kept[2].1.is_nan());
        let long = highest(&numbers(10_000), &vec![1.0; 10_000]);
        assert!(long.len() <= PARTS);
    }

    #[test]
    fn noise_of_a_long_test_keeps_its_peak() {
        let mut y: Vec<f64> = numbers(100_000)
            .into_iter()
            .map(|k| libm::sin(k * k))
            .collect();
        y[77_777] = 9.0;
        let kept = history(&numbers(y.len()), &y);
        assert!(kept.len() <= MOST, "{}", kept.len());
        assert!(kept.contains(&(77_777.0, 9.0)));
    }

    #[test]
    fn pieces_join_without_a_seam() {
        let n = 3 * PIECE + 17;
        let points: Vec<_> = (0..n).map(|i| (i as f64, 0.0)).collect();
        let kept = thinned(&points, 0.1, squared_distance);
        assert_eq!(kept.len(), 5);
        assert_eq!(kept.last(), points.last());
    }
}
