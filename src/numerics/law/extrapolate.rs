//! Gragg's midpoint rule with extrapolation (Bulirsch and Stoer): an ordinary differential equation along a path,
//! to roundoff, with a bounded number of operations.
//!
//! It decides its own inner steps from the equation alone, so its result depends on the path's ends and not on how
//! the caller divides it, within the tolerance.

/// Columns of the tableau: 2, 4, … 2·COLUMNS midpoint steps.
const COLUMNS: usize = 8;
/// Largest difference of the last two columns, of 1 + |state|. The accepted column is orders better.
const TOLERANCE: f64 = 1e-13;
/// Largest difference of the two columns before them: one small difference may be a coincidence.
const ON_THE_WAY: f64 = 1e-6;
/// Inner steps, refused ones included: at most 73 slopes each.
const BUDGET: u32 = 2048;

/// The state after `length` ≥ 0 of d state = slope(state), or nothing if that takes more than the budget or is not
/// a number. Real-time: yes.
pub(super) fn integrate<const N: usize>(
    mut state: [f64; N],
    length: f64,
    mut slope: impl FnMut(&[f64; N]) -> [f64; N],
) -> Option<[f64; N]> {
    let mut rest = length;
    let mut inner = length;
    for _ in 0..BUDGET {
        if rest <= 0.0 {
            return Some(state);
        }
        let last = inner >= rest;
        let step = if last { rest } else { inner };
        match attempt(&state, step, &mut slope) {
            Some((reached, columns)) => {
                state = reached;
                rest = if last { 0.0 } else { rest - step };
                inner = if columns <= 4 { 3.0 * step } else { step };
            }
            None => inner = 0.2 * step,
        }
    }
    None
}

/// The state after `step` and the number of columns it took, or nothing if the columns do not agree.
fn attempt<const N: usize>(
    state: &[f64; N],
    step: f64,
    slope: &mut impl FnMut(&[f64; N]) -> [f64; N],
) -> Option<([f64; N], usize)> {
    let first = slope(state);
    let mut row = [[0.0; N]; COLUMNS];
    let mut before = f64::INFINITY;
    for j in 0..COLUMNS {
        let mut entry = midpoint(state, &first, step, 2 * (j + 1), slope);
        let mut difference = f64::INFINITY;
        // Neville's scheme in (step/count)²: row[k] still holds the entry of the row before.
        for (k, above) in row.iter_mut().enumerate().take(j) {
            let ratio = (j + 1) as f64 / (j - k) as f64;
            let weight = 1.0 / (ratio * ratio - 1.0);
            let mut next = [0.0; N];
            difference = 0.0;
            for i in 0..N {
                let change = (entry[i] - above[i]) * weight;
                next[i] = entry[i] + change;
                difference = f64::max(difference, change.abs() / (1.0 + next[i].abs()));
                // f64::max drops NaN.
                if !change.is_finite() {
                    return None;
                }
            }
            *above = entry;
            entry = next;
        }
        if difference <= TOLERANCE && before <= ON_THE_WAY {
            return Some((entry, j + 1));
        }
        // With four columns an equation that is smooth over the step has converged this far.
        if j == 3 && difference > 1e-5 {
            return None;
        }
        row[j] = entry;
        before = difference;
    }
    None
}

/// Gragg's smoothed midpoint rule in `count` (even) steps.
fn midpoint<const N: usize>(
    state: &[f64; N],
    first: &[f64; N],
    step: f64,
    count: usize,
    slope: &mut impl FnMut(&[f64; N]) -> [f64; N],
) -> [f64; N] {
    let h = step / count as f64;
    let mut before = *state;
    let mut here = *state;
    for i in 0..N {
        here[i] += h * first[i];
    }
    for _ in 1..count {
        let rate = slope(&here);
        for i in 0..N {
            (before[i], here[i]) = (here[i], before[i] + 2.0 * h * rate[i]);
        }
    }
    let rate = slope(&here);
    let mut out = [0.0; N];
    for i in 0..N {
        out[i] = 0.5 * (here[i] + before[i] + h * rate[i]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circle_is_followed_to_roundoff() {
        let end = integrate([1.0, 0.0], 7.0, |s| [-s[1], s[0]]).unwrap();
        assert!((end[0] - libm::cos(7.0)).abs() < 1e-13, "{end:?}");
        assert!((end[1] - libm::sin(7.0)).abs() < 1e-13, "{end:?}");
    }

    #[test]
    fn diverging_equation_ends() {
        assert_eq!(integrate([1.0], 2.0, |s| [s[0] * s[0]]), None);
        assert_eq!(integrate([f64::NAN], 2.0, |s| [s[0]]), None);
        assert_eq!(integrate([1.0], f64::NAN, |s| [s[0]]), None);
    }
}
