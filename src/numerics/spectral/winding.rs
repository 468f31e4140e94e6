//! Number of roots of a characteristic function right of the imaginary axis, by its turns about zero.
//!
//! For a function that is real on the real axis, has no poles there and tends to a positive number, the number of roots is
//! −1/π times the growth of its argument from ω = 0 to ∞ (Cauchy). So the stability of a loop with a delay, an actuator and
//! a compensator follows without a state space.

use nalgebra::{Complex, ComplexField as _};

/// Distances from a mark, in its widths, at which the first grid has points.
const ABOUT: [f64; 9] = [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0];

/// Points of the first grid.
const GRID: usize = 400;
/// Growth of the argument between two points that counts as followed, in rad.
const FINE: f64 = 0.4;
/// Halvings of one interval of the grid.
const DEEPEST: u32 = 40;

/// Roots of `function` right of the imaginary axis, evaluated from `lowest` to `highest` in rad/s; beyond, it must not turn
/// about zero any more. `marks` are places and widths of its poles: near a lightly damped pole it may turn between two points
/// of a plain grid. `None` if it is not finite, is zero on the path, or turns too fast to be followed.
#[must_use]
pub fn unstable_roots(
    mut function: impl FnMut(f64) -> Option<Complex<f64>>,
    lowest: f64,
    highest: f64,
    marks: &[(f64, f64)],
) -> Option<u32> {
    let ratio = highest / lowest;
    let plain = (1..=GRID).map(|k| lowest * libm::pow(ratio, k as f64 / GRID as f64));
    let near = marks.iter().flat_map(|(at, width)| {
        let about = ABOUT.iter().flat_map(|by| [-by, *by]);
        about.map(move |by| at + by * width)
    });
    let inside = |at: &f64| *at > lowest && *at < highest;
    let mut grid: Vec<f64> = near.filter(inside).chain(plain).collect();
    grid.sort_by(f64::total_cmp);
    let mut turned = 0.0;
    let mut last = (lowest, function(lowest)?);
    // From ω = 0, where it is real.
    turned += last.1.argument();
    for end in grid {
        let mut open = vec![(end, 0)];
        while let Some((to, depth)) = open.pop() {
            let value = function(to)?;
            if !(value.re.is_finite() && value.im.is_finite() && last.1.modulus() > 0.0) {
                return None;
            }
            let turn = (value / last.1).argument();
            if turn.abs() > FINE {
                if depth == DEEPEST {
                    return None;
                }
                open.push((to, depth + 1));
                open.push((0.5 * (last.0 + to), depth + 1));
            } else {
                turned += turn;
                last = (to, value);
            }
        }
    }
    let roots = (-turned / std::f64::consts::PI).round();
    (roots >= 0.0).then_some(roots as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightly_damped_mode_is_not_stepped_over() {
        // (s² − 2ζ s + 1)/(s² + 2ζ s + 1) goes round zero within a few ζ about ω = 1, and is 1 elsewhere.
        let zeta = 1e-6;
        let function = |omega: f64| {
            let s = Complex::new(0.0, omega);
            let rest = s * s + 1.0;
            Some((rest - s * (2.0 * zeta)) / (rest + s * (2.0 * zeta)))
        };
        assert_eq!(
            unstable_roots(function, 1.1e-3, 1e3, &[(1.0, zeta)]),
            Some(2)
        );
    }

    #[test]
    fn roots_right_of_the_axis_are_counted() {
        // (s² + 2ζ s + 1)/(s + 1)² with ζ above and below zero, and both of them together.
        let one = |zeta: f64| {
            move |omega: f64| {
                let s = Complex::new(0.0, omega);
                (s * s + s * (2.0 * zeta) + 1.0) / ((s + 1.0) * (s + 1.0))
            }
        };
        for zeta in [0.001, 0.3] {
            assert_eq!(
                unstable_roots(|w| Some(one(zeta)(w)), 1e-3, 1e4, &[]),
                Some(0)
            );
            assert_eq!(
                unstable_roots(|w| Some(one(-zeta)(w)), 1e-3, 1e4, &[]),
                Some(2)
            );
            let both = |w: f64| Some(one(-zeta)(w) * one(-0.2)(3.0 * w));
            assert_eq!(unstable_roots(both, 1e-3, 1e4, &[]), Some(4));
        }
        // A delayed spring: 1 + (e^{−sτ} − 1)·p/(s² + 2ξs + 1) is unstable beyond the critical delay.
        let (ratio, share) = (0.02, 0.5);
        let critical = super::super::delay::sdof(ratio, share, 1.0).unwrap();
        for (factor, roots) in [(0.99, 0), (1.01, 2)] {
            let delayed = |omega: f64| {
                let s = Complex::new(0.0, omega);
                let (sine, cosine) = libm::sincos(-omega * factor * critical);
                let behind = Complex::new(cosine, sine) - 1.0;
                Some(behind * share / (s * s + s * (2.0 * ratio) + 1.0) + 1.0)
            };
            assert_eq!(
                unstable_roots(delayed, 1e-3, 1e3, &[]),
                Some(roots),
                "{factor}"
            );
        }
    }
}
