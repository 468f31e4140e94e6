//! The line of a loop, of which few points are kept.

use super::axis::is_drawable;
use super::thin;

/// Points of the largest picture that a loop is drawn in, and how far an omitted point may lie from the line.
const WIDTH: f64 = 480.0;
const TOLERANCE: f64 = 0.12;
/// Points beyond which the tolerance is doubled, up to a pixel: a noisy loop must not make a page of megabytes.
const POINTS: usize = 5_000;
/// Points of a loop that are kept at most before they are thinned.
const WAITING: usize = 1 << 15;

/// Points of a picture: x and y, NaN where the line is broken.
pub(super) type Points = (Vec<f64>, Vec<f64>);

/// The line of a loop while its points pass, without points whose omission is invisible.
#[derive(Debug)]
pub(super) struct Loop {
    /// A unit of the picture.
    per: (f64, f64),
    tolerance: f64,
    last: Option<(f64, f64)>,
    near: Vec<(f64, f64)>,
}

impl Loop {
    /// For values within these ranges.
    pub(crate) fn new(x: Option<(f64, f64)>, y: Option<(f64, f64)>) -> Self {
        let per = |range: Option<(f64, f64)>| {
            let range = range.filter(|(lo, hi)| hi > lo);
            range.map_or(1.0, |(lo, hi)| (hi - lo) / WIDTH)
        };
        Self {
            per: (per(x), per(y)),
            tolerance: TOLERANCE,
            last: None,
            near: Vec::new(),
        }
    }

    pub(crate) fn take(&mut self, x: f64, y: f64) {
        if !(is_drawable(x) && is_drawable(y)) {
            if self.last.take().is_some() {
                self.near.push((f64::NAN, f64::NAN));
            }
            return;
        }
        let at = (x / self.per.0, y / self.per.1);
        // Half of the later tolerance.
        let least = 0.5 * self.tolerance;
        let is_far = |last: (f64, f64)| (at.0 - last.0).abs().max((at.1 - last.1).abs()) > least;
        if self.last.is_none_or(is_far) {
            self.near.push(at);
            self.last = Some(at);
            if self.near.len() >= WAITING {
                self.thin(WAITING / 4, f64::INFINITY);
            }
        }
    }

    /// Drops points near the line, until few are left or the tolerance is as large as it may be.
    fn thin(&mut self, few: usize, largest: f64) {
        loop {
            let runs = thin::within(self.near.iter().copied(), self.tolerance);
            let kept: usize = runs.iter().map(Vec::len).sum();
            if self.tolerance >= largest || kept <= few {
                let breaks = std::iter::repeat((f64::NAN, f64::NAN));
                let runs = runs.into_iter().zip(breaks).enumerate();
                let lines = runs.map(|(place, (mut run, gap))| {
                    if place > 0 {
                        run.insert(0, gap);
                    }
                    run
                });
                self.near = lines.flatten().collect();
                return;
            }
            self.tolerance *= 2.0;
        }
    }

    /// The line.
    pub(crate) fn finish(mut self) -> Points {
        self.thin(POINTS, 0.9);
        let (x, y) = self.per;
        self.near.iter().map(|at| (at.0 * x, at.1 * y)).unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(x: &[f64], y: &[f64]) -> Points {
        let range = |values: &[f64]| super::super::axis::extent(values.iter().copied());
        let mut line = Loop::new(range(x), range(y));
        x.iter().zip(y).for_each(|(x, y)| line.take(*x, *y));
        line.finish()
    }

    #[test]
    fn noisy_loop_is_drawn_with_few_points() {
        let n = 400_000;
        let x: Vec<f64> = (0..n).map(|i| libm::sin(i as f64 * 1e-2)).collect();
        let y: Vec<f64> = (0..n)
            .map(|i| libm::cos(i as f64 * 1.7e-2) * (1.0 + 0.1 * libm::sin(i as f64)))
            .collect();
        let (dx, dy) = drawn(&x, &y);
        assert!(dx.len() == dy.len() && dx.len() < WAITING, "{}", dx.len());
        let top = |v: &[f64]| v.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert!((top(&dx) - top(&x)).abs() < 2.0 * 1.0 / WIDTH * 2.0);
        assert!((top(&dy) - top(&y)).abs() < 2.0 * 1.1 / WIDTH * 2.0);
        let gap = drawn(&[0.0, 1.0, f64::NAN, 2.0, 3.0], &[0.0; 5]);
        assert_eq!(gap.0.iter().filter(|v| v.is_nan()).count(), 1);
        assert_eq!(drawn(&[], &[]), Points::default());
    }
}
