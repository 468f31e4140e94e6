//! Points of a design, and seeded draws. Everything is a function of the seed and an index, and no list is kept.

use std::f64::consts::SQRT_2;

use super::random::bits;
use super::sobol;
use gusset_config::{Design, Sampling, Scalar};

/// A key with its values.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub key: String,
    pub values: Vec<Scalar>,
}

/// Number of points of a design; none if it exceeds 64 bits.
pub(super) fn points(design: Design, axes: &[Axis]) -> Option<u64> {
    let counts = axes.iter().map(|axis| axis.values.len() as u64);
    match design {
        Design::Grid => counts.into_iter().try_fold(1_u64, u64::checked_mul),
        Design::OneAtATime => counts.into_iter().try_fold(1_u64, u64::checked_add),
    }
}

/// The value of each axis at a point; none where the test file decides. The last axis of a grid varies fastest.
pub(super) fn point(design: Design, axes: &[Axis], index: u64) -> Vec<Option<&Scalar>> {
    let mut chosen = vec![None; axes.len()];
    match design {
        Design::Grid => {
            let mut rest = index;
            for (place, axis) in axes.iter().enumerate().rev() {
                let count = axis.values.len() as u64;
                chosen[place] = axis.values.get((rest % count) as usize);
                rest /= count;
            }
        }
        Design::OneAtATime => {
            if let Some((place, value)) = alone(axes, index) {
                chosen[place] = axes[place].values.get(value);
            }
        }
    }
    chosen
}

/// The axis and the place of its value at a point of a one-at-a-time design; none for the test file itself.
pub(super) fn alone(axes: &[Axis], index: u64) -> Option<(usize, usize)> {
    let mut rest = index.checked_sub(1)?;
    for (place, axis) in axes.iter().enumerate() {
        let count = axis.values.len() as u64;
        if rest < count {
            return Some((place, rest as usize));
        }
        rest -= count;
    }
    None
}

/// A number between 0 and 1, both excluded.
fn uniform(seed: u64, channel: &str, number: u64) -> f64 {
    let high = bits(seed, channel, number) >> 12;
    (high as f64 + 0.5) / (1_u64 << 52) as f64
}

/// How numbers are drawn: `count` draws for each key.
#[derive(Debug, Clone, Copy)]
pub(super) struct Draws {
    pub sampling: Sampling,
    pub seed: u64,
    pub count: u64,
}

impl Draws {
    /// Draw `number` of the standard normal distribution for `key`, which is at `place` among the keys.
    pub(crate) fn normal(self, key: &str, place: usize, number: u64) -> f64 {
        let Self {
            sampling,
            seed,
            count,
        } = self;
        let within = uniform(seed, key, number);
        quantile(match sampling {
            Sampling::Random => within,
            Sampling::LatinHypercube => {
                (permuted(seed, key, number, count) as f64 + within) / count as f64
            }
            Sampling::Sobol => sobol::share(seed, place, number),
        })
    }
}

/// Draw `number` of the standard normal distribution for `key` that replaces an impossible one; independent of the sampling.
pub(super) fn again(seed: u64, key: &str, number: u64, attempt: u64) -> f64 {
    quantile(uniform(seed, &format!("{key} again {attempt}"), number))
}

/// Rounds of the permutation. A small range has few bits, and needs more rounds than a large one.
const ROUNDS: u64 = 12;

/// Place of `number` in a random permutation of 0 to `count` − 1: a Feistel network that walks until it is inside.
fn permuted(seed: u64, key: &str, number: u64, count: u64) -> u64 {
    let width = u64::BITS - count.saturating_sub(1).leading_zeros();
    let half = width.div_ceil(2).max(1);
    let mask = (1_u64 << half) - 1;
    let mut value = number;
    loop {
        let (mut left, mut right) = (value >> half, value & mask);
        for round in 0..ROUNDS {
            let mixed = bits(seed ^ (round + 1), key, right) & mask;
            (left, right) = (right, left ^ mixed);
        }
        value = (left << half) | right;
        if value < count {
            return value;
        }
    }
}

/// True for `chosen` of the numbers 0 to `count` − 1, in random places.
pub(super) fn is_among(seed: u64, key: &str, number: u64, chosen: u64, count: u64) -> bool {
    chosen >= count || permuted(seed, key, number, count) < chosen
}

/// The standard normal quantile of `share`: Acklam's rational approximation and one step of Halley's method.
fn quantile(share: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969683028665376e1,
        2.209460984245205e2,
        -2.759285104469687e2,
        1.383_577_518_672_69e2,
        -3.066479806614716e1,
        2.506628277459239,
    ];
    const B: [f64; 5] = [
        -5.447609879822406e1,
        1.615858368580409e2,
        -1.556989798598866e2,
        6.680131188771972e1,
        -1.328068155288572e1,
    ];
    const C: [f64; 6] = [
        -7.784894002430293e-3,
        -3.223964580411365e-1,
        -2.400758277161838,
        -2.549732539343734,
        4.374664141464968,
        2.938163982698783,
    ];
    const D: [f64; 4] = [
        7.784695709041462e-3,
        3.224671290700398e-1,
        2.445134137142996,
        3.754408661907416,
    ];
    const LOW: f64 = 0.02425;
    let power = |all: &[f64], x: f64| all.iter().fold(0.0, |sum, one| sum * x + one);
    let tail = |share: f64| {
        let x = (-2.0 * libm::log(share)).sqrt();
        power(&C, x) / (power(&D, x) * x + 1.0)
    };
    let x = if share < LOW {
        tail(share)
    } else if share > 1.0 - LOW {
        -tail(1.0 - share)
    } else {
        let x = share - 0.5;
        let square = x * x;
        power(&A, square) * x / (power(&B, square) * square + 1.0)
    };
    let error = 0.5 * libm::erfc(-x / SQRT_2) - share;
    let step = error * (2.0 * std::f64::consts::PI).sqrt() * libm::exp(0.5 * x * x);
    x - step / (1.0 + 0.5 * x * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> Vec<Axis> {
        let axis = |key: &str, count: i64| Axis {
            key: key.to_owned(),
            values: (0..count).map(Scalar::Whole).collect(),
        };
        vec![axis("a", 2), axis("b", 3)]
    }

    #[test]
    fn a_grid_has_every_combination_once() {
        let axes = axes();
        assert_eq!(points(Design::Grid, &axes), Some(6));
        let all: Vec<_> = (0..6).map(|i| point(Design::Grid, &axes, i)).collect();
        for (index, one) in all.iter().enumerate() {
            assert!(one.iter().all(Option::is_some));
            assert!(!all[..index].contains(one));
        }
    }

    #[test]
    fn one_at_a_time_begins_with_the_test_file() {
        let axes = axes();
        assert_eq!(points(Design::OneAtATime, &axes), Some(6));
        let at = |index| point(Design::OneAtATime, &axes, index);
        assert_eq!(at(0), [None, None]);
        assert_eq!(at(2), [Some(&Scalar::Whole(1)), None]);
        assert_eq!(at(3), [None, Some(&Scalar::Whole(0))]);
    }

    #[test]
    fn latin_hypercube_draws_each_interval_once() {
        let count = 37;
        let draws = Draws {
            sampling: Sampling::LatinHypercube,
            seed: 5,
            count,
        };
        let draw = |i| draws.normal("key", 0, i);
        let share = |x: f64| 0.5 * libm::erfc(-x / SQRT_2);
        let mut found: Vec<u64> = (0..count)
            .map(|i| (share(draw(i)) * count as f64) as u64)
            .collect();
        found.sort_unstable();
        assert_eq!(found, (0..count).collect::<Vec<_>>());
    }

    #[test]
    fn choice_changes_places_with_the_seed() {
        let of = |seed| -> Vec<u64> {
            let all = 0..1000;
            all.filter(|i| is_among(seed, "key", *i, 70, 1000))
                .collect()
        };
        assert_eq!((of(1).len(), of(2).len()), (70, 70));
        assert_ne!(of(1), of(2));
        assert!(is_among(1, "key", 5, 10, 10));
    }

    #[test]
    fn quantiles_invert_the_distribution() {
        for share in [1e-9, 0.01, 0.16, 0.5, 0.84, 0.999] {
            let back = 0.5 * libm::erfc(-quantile(share) / SQRT_2);
            // Halley's step leaves rounding errors of some units in the last place.
            assert!((back / share - 1.0).abs() < 1e-12, "{share}: {back}");
        }
    }
}
