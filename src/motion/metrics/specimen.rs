//! Identification of a specimen from a prescribed displacement: stiffness and damping, each with its standard error.
//!
//! Force against measured displacement and its velocity. The noise of the displacement sensor is in both of these, and in the
//! velocity the more the shorter the ticks: least squares would lean towards zero with the one and make up for it with the
//! other. So the target and its velocity, which know no noise, serve as instruments, and rows are means of some samples, over
//! which the noise of differences cancels.

use super::response::peak;

/// Rows that are kept at least where samples are averaged, and how far the motion may turn over one of them, in rad.
const ROWS: f64 = 32.0;
const TURN: f64 = 0.2;
/// Correlation of neighbouring rows from which on what the line misses is no noise; 32 rows of noise have less, 99 times in 100.
const ALIKE: f64 = 0.5;
/// Standard error beside the number, and beside the force that is resisted with, up to which it counts as known.
const SURE: f64 = 0.1;
const SLIGHT: f64 = 0.01;

/// A number and its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard error; infinite where the data are too few.
    pub std: f64,
    /// What would be a hundredth of the force.
    slight: f64,
    /// True if the residual is not noise: neighbouring samples have similar residuals. Then the number belongs to this motion
    /// only, as a secant or an equivalent, and its standard error has no meaning.
    pub is_of_this_motion: bool,
}

impl Estimate {
    /// True if the standard error is small beside the number, or matters to no force of the test.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.std <= (SURE * self.value.abs()).max(self.slight)
    }

    /// True if the standard error is worth reporting: more than roundoff.
    #[must_use]
    pub fn is_scattered(&self) -> bool {
        self.std > 1e-4 * self.value.abs().max(self.slight)
    }
}

/// Linear fit of a specimen under a prescribed displacement: f ≈ k̂·d + ĉ·ḋ + f₀.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Identified {
    /// k̂ in N/m.
    pub stiffness: Estimate,
    /// ĉ in N s/m; `None` where the data cannot separate displacement and velocity.
    pub damping: Option<Estimate>,
    /// f₀ in N.
    pub offset: f64,
    /// Share of the force's variance that the line does not explain, 0 … 1.
    pub unexplained: f64,
}

/// Target, its velocity, measured displacement, its velocity, and force.
type Sample = [f64; 5];

/// Fits `force` (N) by measured `disp` (m) and its velocity by central differences, `dt` in s, with `target` (m) as the
/// instrument: without noise any will do, with noise one that comes as late as the measured displacement ([`delayed`]).
///
/// k̂ of a specimen that yields is a secant over all of the test: give the part before yielding for its initial stiffness
/// ([`loading`]).
#[must_use]
pub fn identify(target: &[f64], disp: &[f64], force: &[f64], dt: f64) -> Option<Identified> {
    if !(dt > 0.0 && dt.is_finite()) {
        return None;
    }
    let samples = || {
        let slope = |d: &[f64]| (d[2] - d[0]) / (2.0 * dt);
        let both = target.windows(3).zip(disp.windows(3));
        let all = both.zip(force.iter().skip(1));
        all.map(move |((t, d), &f)| [t[1], slope(t), d[1], slope(d), f])
    };
    let (mut mean, mut n) = ([0.0; 5], 0.0);
    for (_, sample) in averaged(samples(), 1) {
        for (total, value) in mean.iter_mut().zip(sample) {
            *total += value;
        }
        n += 1.0;
    }
    if n < 3.0 {
        return None;
    }
    mean = mean.map(|total| total / n);
    let (mut way, mut speed) = (0.0, 0.0);
    for (_, [t, slope, ..]) in averaged(samples(), 1) {
        way += (t - mean[0]) * (t - mean[0]);
        speed += slope * slope;
    }
    let turning = (n / ROWS).min(TURN * (way / speed).sqrt() / dt);
    // Not a number where nothing moves.
    let rows = || {
        let rows = averaged(samples(), turning.max(1.0) as usize);
        // Second moments about the mean: well conditioned where raw normal equations are not.
        rows.map(|(weight, row)| {
            let mut about = row;
            for (value, mean) in about.iter_mut().zip(mean) {
                *value -= mean;
            }
            (weight, about)
        })
    };
    // Products of every two.
    let mut moments = [[0.0; 5]; 5];
    let mut count = 0.0;
    for (weight, row) in rows() {
        for (moments, a) in moments.iter_mut().zip(row) {
            for (moment, b) in moments.iter_mut().zip(row) {
                *moment += weight * a * b;
            }
        }
        count += 1.0;
    }
    let [of_target, of_slope, of_disp, _, [.., ff]] = moments;
    let ([tt, ts, td, tv, tf], [_, ss, sd, sv, sf]) = (of_target, of_slope);
    let rounding = 1e-12 * mean[0] * mean[0] * n;
    if !(tt > rounding && tt.is_finite() && td != 0.0 && tf.is_finite()) {
        return None;
    }
    // Differences of a steady ramp scatter by rounding alone, which contains no information on damping.
    let scatter = 1e-13 * (mean[0].abs() + (tt / n).sqrt()) / dt;
    let is_moving_freely = ss > n * scatter * scatter && tt * ss - ts * ts > 1e-6 * tt * ss;
    let determinant = td * sv - tv * sd;
    // Change of k̂ and of ĉ per unit of either moment with the instruments.
    let [by_stiffness, by_damping] = if is_moving_freely {
        [
            [sv / determinant, -tv / determinant],
            [-sd / determinant, td / determinant],
        ]
    } else {
        [[1.0 / td, 0.0], [0.0; 2]]
    };
    let value = |by: [f64; 2]| by[0] * tf + by[1] * sf;
    let (k, c) = (value(by_stiffness), value(by_damping));
    let (mut left, mut before, mut beside) = (0.0, 0.0, 0.0);
    for (weight, [_, _, d, v, f]) in rows() {
        let error = f - k * d - c * v;
        left += weight * error * error;
        beside += weight * error * before;
        before = error;
    }
    let freedom = count - if is_moving_freely { 3.0 } else { 2.0 };
    let variance = if freedom > 0.0 {
        left / freedom
    } else {
        f64::INFINITY
    };
    let estimate = |value: f64, by: [f64; 2], of: f64| Estimate {
        value,
        std: (variance * (by[0] * by[0] * tt + 2.0 * by[0] * by[1] * ts + by[1] * by[1] * ss))
            .sqrt(),
        slight: SLIGHT * (ff / of).sqrt(),
        is_of_this_motion: beside > ALIKE * left,
    };
    let offset = mean[4] - k * mean[2] - c * mean[3];
    let is_sound = k.is_finite() && c.is_finite() && offset.is_finite() && ff.is_finite();
    is_sound.then_some(Identified {
        stiffness: estimate(k, by_stiffness, of_disp[2]),
        damping: is_moving_freely.then(|| estimate(c, by_damping, ss)),
        offset,
        unexplained: if ff > 0.0 {
            (left / ff).clamp(0.0, 1.0)
        } else {
            0.0
        },
    })
}

/// Means of `size` samples each, with how many they are of; a sample of which something is missing takes no part.
fn averaged(
    mut samples: impl Iterator<Item = Sample>,
    size: usize,
) -> impl Iterator<Item = (f64, Sample)> {
    std::iter::from_fn(move || {
        loop {
            let (mut sum, mut count, mut seen) = (Sample::default(), 0.0, false);
            for sample in samples.by_ref().take(size) {
                seen = true;
                if sample.iter().all(|value| value.is_finite()) {
                    for (total, value) in sum.iter_mut().zip(sample) {
                        *total += value;
                    }
                    count += 1.0;
                }
            }
            if count > 0.0 {
                return Some((count, sum.map(|total| total / count)));
            }
            if !seen {
                return None;
            }
        }
    })
}

/// `target` delayed by `samples`; before its first sample and behind its last one it is constant.
#[must_use]
pub fn delayed(target: &[f64], samples: f64) -> Vec<f64> {
    let last = target.len().saturating_sub(1) as f64;
    // A place is within the slice by then.
    let place = |i: usize| (i as f64 - samples.round()).clamp(0.0, last) as usize;
    (0..target.len()).map(|i| target[place(i)]).collect()
}

/// Number of leading samples before |`disp`| first exceeds `share` of its largest magnitude: the first loading.
#[must_use]
pub fn loading(disp: &[f64], share: f64) -> usize {
    let Some(top) = peak(disp) else { return 0 };
    let bound = share * top.value.abs();
    disp.iter()
        .position(|d| d.abs() > bound)
        .unwrap_or(disp.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng as _, rngs::Xoshiro256PlusPlus};
    use std::f64::consts::TAU;

    const DT: f64 = 1.0 / 1024.0;

    fn sampled(n: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..n).map(|i| f(i as f64 * DT)).collect()
    }

    /// 8 MN/m and `damping` N s/m in cycles of 20 mm at 0.5 Hz, which come `late` ticks late and are measured with noise of
    /// `sigma` m: the whole, and the first loading.
    fn noisy(rate: f64, damping: f64, late: usize, sigma: f64, seed: u64) -> [Identified; 2] {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let omega = TAU * 0.5;
        let at = |i: usize| i as f64 / rate;
        let n = (8.0 * rate) as usize;
        // Eased in over the first second.
        let motion = |t: f64| {
            let ease = 0.5 - 0.5 * libm::cos(0.5 * TAU * t.clamp(0.0, 1.0));
            ease * 0.02 * libm::sin(omega * t)
        };
        let target: Vec<f64> = (0..n).map(|i| motion(at(i))).collect();
        let true_disp = delayed(&target, late as f64);
        let vel = |i: usize| {
            (true_disp[(i + 1).min(n - 1)] - true_disp[i.saturating_sub(1)]) * rate / 2.0
        };
        let force: Vec<f64> = (0..n)
            .map(|i| 8e6 * true_disp[i] + damping * vel(i))
            .collect();
        let disp: Vec<f64> = true_disp
            .iter()
            .map(|d| {
                // Twelve uniform numbers have variance 1.
                let sum: f64 = (0..12)
                    .map(|_| RngExt::random::<f64>(&mut random) - 0.5)
                    .sum();
                d + sigma * sum
            })
            .collect();
        let first = loading(&true_disp, 0.2);
        [n, first]
            .map(|to| identify(&true_disp[..to], &disp[..to], &force[..to], 1.0 / rate).unwrap())
    }

    /// At 4096 Hz noise of 0.1 % is as large in a difference of two ticks as the velocity itself.
    #[test]
    fn displacement_noise_biases_no_estimate() {
        for rate in [256.0, 1024.0, 4096.0] {
            for seed in 1..=5 {
                let [whole, first] = noisy(rate, 4e5, 7, 2e-5, seed);
                let damping = whole.damping.unwrap();
                for (found, exact, within) in [
                    (whole.stiffness, 8e6, 0.005),
                    (damping, 4e5, 0.01),
                    (first.stiffness, 8e6, 0.2),
                ] {
                    let off = found.value - exact;
                    assert!(off.abs() < 4.0 * found.std, "{rate} {seed}: {found:?}");
                    assert!(found.std < within * exact, "{rate}: {found:?}");
                }
                assert!(whole.stiffness.is_sure() && damping.is_sure());
                assert!(first.stiffness.is_scattered());
                assert!(!whole.stiffness.is_of_this_motion && !damping.is_of_this_motion);
                assert!(whole.unexplained < 1e-3, "{}", whole.unexplained);
            }
        }
    }

    #[test]
    fn only_noisy_estimates_are_unsure() {
        let [_, first] = noisy(256.0, 0.0, 0, 1e-3, 1);
        assert!(!first.stiffness.is_sure(), "{first:?}");
        for found in noisy(256.0, 4e5, 3, 0.0, 1) {
            let sure = [Some(found.stiffness), found.damping];
            for found in sure.into_iter().flatten() {
                assert!(found.is_sure() && !found.is_scattered(), "{found:?}");
            }
        }
        // A spring has no damping, and that is known.
        let [whole, _] = noisy(1024.0, 0.0, 0, 2e-5, 1);
        assert!(whole.damping.unwrap().is_sure(), "{whole:?}");
        // Three samples lie on a line whatever they are.
        let three = identify(
            &[0.0, 1.0, 3.0, 4.0, 4.5],
            &[0.0, 1.0, 3.0, 4.0, 4.5],
            &[0.0, 7.0, 1.0, 5.0, 0.0],
            1.0,
        );
        assert!(!three.unwrap().stiffness.is_sure());
    }

    #[test]
    fn delayed_target_is_constant_at_its_ends() {
        assert_eq!(delayed(&[1.0, 2.0, 3.0], 1.4), [1.0, 1.0, 2.0]);
        assert_eq!(delayed(&[1.0, 2.0, 3.0], -2.0), [3.0, 3.0, 3.0]);
        assert_eq!(delayed(&[], 2.0), [] as [f64; 0]);
    }

    #[test]
    fn kelvin_element_is_identified() {
        // Central differences of a 2 Hz sine are short by (ω dt)²/6 = 2.5e-5; k̂ is untouched by that.
        let omega = TAU * 2.0;
        let (k, c, f0) = (1.19e6, 114.22e2, -350.0);
        let disp = sampled(4096, |t| 0.01 * libm::sin(omega * t));
        let force = sampled(4096, |t| {
            k * 0.01 * libm::sin(omega * t) + c * 0.01 * omega * libm::cos(omega * t) + f0
        });
        let found = identify(&disp, &disp, &force, DT).unwrap();
        assert!((found.stiffness.value / k - 1.0).abs() < 1e-6);
        assert!((found.damping.unwrap().value / c - 1.0).abs() < 1e-4);
        assert!((found.offset - f0).abs() < 1e-3);
        assert!(found.unexplained < 1e-9);
    }

    #[test]
    fn steady_ramp_gives_stiffness_only() {
        let disp = sampled(500, |t| 0.01 * t);
        let force: Vec<_> = disp.iter().map(|d| 2e5 * d).collect();
        let found = identify(&disp, &disp, &force, DT).unwrap();
        assert!((found.stiffness.value / 2e5 - 1.0).abs() < 1e-9);
        assert_eq!(found.damping, None);
        assert_eq!(identify(&[0.3; 50], &[0.3; 50], &[1.0; 50], DT), None);
        assert_eq!(identify(&[], &[], &[], DT), None);
        assert_eq!(identify(&disp, &disp, &force, 0.0), None);
    }

    #[test]
    fn first_loading_gives_initial_stiffness() {
        let disp = sampled(1024, |t| 0.03 * libm::sin(TAU * t));
        let force: Vec<_> = disp
            .iter()
            .map(|d: &f64| 1e6 * d.clamp(-0.01, 0.01))
            .collect();
        let part = loading(&disp, 0.2);
        assert!(part > 10 && disp[part - 1] <= 0.006 && disp[part] > 0.006);
        let initial = identify(&disp[..part], &disp[..part], &force[..part], DT).unwrap();
        assert!((initial.stiffness.value / 1e6 - 1.0).abs() < 1e-9);
        let whole = identify(&disp, &disp, &force, DT).unwrap();
        assert!(whole.stiffness.value < 0.6e6 && whole.stiffness.is_of_this_motion);
        assert!(!initial.stiffness.is_scattered());
        assert_eq!(loading(&[], 0.2), 0);
    }

    proptest! {
        #[test]
        fn no_input_makes_a_share_that_is_no_number(
            a in prop::collection::vec(prop_oneof![8 => -1e6f64..1e6, 1 => Just(f64::NAN), 1 => Just(1e308)], 0..80),
            b in prop::collection::vec(prop_oneof![8 => -1e6f64..1e6, 1 => Just(f64::INFINITY)], 0..80),
        ) {
            for target in [&a, &b] {
                if let Some(found) = identify(target, &a, &b, DT) {
                    prop_assert!(!found.unexplained.is_nan());
                }
            }
        }
    }
}
