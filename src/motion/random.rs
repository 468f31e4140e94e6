//! Randomness that is the same on every machine and in every year.
//!
//! The stream: PCG-XSL-RR 128/64 (`rand_pcg::Pcg64`) from `seed_from_u64(seed)`; a uniform number is the upper 53
//! bits of one output times 2⁻⁵³; two normal numbers come from two uniform ones by Box and Muller, with the logarithm
//! and the circle functions of `libm`. (The ziggurat of `rand_distr` takes its exponential and logarithm from the
//! platform, so that its last bit may differ between machines.) A test pins the stream to numbers worked out
//! by an independent program.
//!
//! Beside it the one transform that makes a motion of random lines: a radix-2 FFT.

use std::f64::consts::PI;

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// A stream of random numbers that its seed determines wholly.
#[derive(Debug, Clone)]
pub(super) struct Random(Pcg64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    /// In [0, 1).
    pub(super) fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Two independent normal numbers of mean 0 and variance 1.
    pub(super) fn normal_pair(&mut self) -> (f64, f64) {
        // 1 − u is in (0, 1]: its logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        let (sine, cosine) = libm::sincos(2.0 * PI * self.uniform());
        (radius * cosine, radius * sine)
    }
}

/// `Σ_k cos[k] cos(2πkj/n) + sin[k] sin(2πkj/n)` for j = 0 … n − 1, where n is a power of two and line k of `lines` is
/// (cos, sin). Lines beyond n are ignored.
pub(super) fn sum_of_lines(lines: &[(f64, f64)], n: usize) -> Vec<f64> {
    let mut z: Vec<(f64, f64)> = lines.iter().copied().take(n).collect();
    // Re Σ (c − is) e^{+iθ} = Σ c cos θ + s sin θ.
    for line in &mut z {
        line.1 = -line.1;
    }
    z.resize(n, (0.0, 0.0));
    inverse_fft(&mut z);
    z.into_iter().map(|(re, _)| re).collect()
}

/// `z[j] ← Σ_k z[k] e^{+2πijk/n}`, in place, without scaling; the length is a power of two.
fn inverse_fft(z: &mut [(f64, f64)]) {
    let n = z.len();
    if n < 2 {
        return;
    }
    let shift = usize::BITS - n.trailing_zeros();
    for i in 0..n {
        let j = i.reverse_bits() >> shift;
        if i < j {
            z.swap(i, j);
        }
    }
    let turns: Vec<(f64, f64)> = (0..n / 2)
        .map(|k| {
            let (sine, cosine) = libm::sincos(2.0 * PI * k as f64 / n as f64);
            (cosine, sine)
        })
        .collect();
    let mut half = 1;
    while half < n {
        let stride = n / (2 * half);
        for block in z.chunks_exact_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            let turns = turns.iter().step_by(stride);
            for ((a, b), (c, s)) in low.iter_mut().zip(high).zip(turns) {
                let turned = (b.0 * c - b.1 * s, b.0 * s + b.1 * c);
                *b = (a.0 - turned.0, a.1 - turned.1);
                *a = (a.0 + turned.0, a.1 + turned.1);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transform_is_the_stated_sum() {
        let lines: Vec<(f64, f64)> = (0..20)
            .map(|k| (f64::from(k * k % 7) - 2.0, f64::from(k % 5)))
            .collect();
        for n in [1_usize, 2, 8, 64] {
            let found = sum_of_lines(&lines, n);
            for (j, value) in found.iter().enumerate() {
                let exact: f64 = lines
                    .iter()
                    .take(n)
                    .enumerate()
                    .map(|(k, (c, s))| {
                        let angle = 2.0 * PI * (k * j % n) as f64 / n as f64;
                        c * libm::cos(angle) + s * libm::sin(angle)
                    })
                    .sum();
                // Twenty terms below 6, six levels of rounding.
                assert!((value - exact).abs() < 1e-12, "{n} {j}");
            }
        }
    }

    /// Worked out by a program of some thirty lines in another language from the published recurrences.
    #[test]
    fn stream_matches_an_independent_program() {
        for (seed, outputs) in [
            (
                0,
                [
                    0x20ae_25da_d4e2_bc53,
                    0x58f9_38e1_2bbf_69fb,
                    0xb5b2_35d6_0cf8_e231,
                ],
            ),
            (
                42,
                [
                    0x39fc_b970_a300_1809,
                    0x3d36_1897_2c55_d911,
                    0xc2c5_fa78_9a8b_6a2d,
                ],
            ),
            (
                u64::MAX >> 1,
                [
                    0x8d39_c545_1131_1c13,
                    0x1986_a599_3bec_56be,
                    0x3f96_da51_a2e4_37fd,
                ],
            ),
        ] {
            let mut random = Random::new(seed);
            for output in outputs {
                let output: u64 = output;
                assert_eq!(random.0.next_u64(), output);
            }
        }
        let mut random = Random::new(42);
        for (a, b) in [
            (0.049_017_572_888_746_586, 0.715_044_657_853_571),
            (-1.665_693_121_258_388, -0.294_374_442_985_969_93),
        ] {
            let found = random.normal_pair();
            // The other program's logarithm and circle functions differ in the last bit at most.
            assert!((found.0 - a).abs() < 2e-15 && (found.1 - b).abs() < 2e-15);
        }
    }

    #[test]
    fn uniform_and_normal_numbers_are_correct() {
        let mut random = Random::new(7);
        let n = 40_000;
        let (mut sum, mut squares, mut fourth) = (0.0, 0.0, 0.0);
        for _ in 0..n / 2 {
            let u = random.uniform();
            assert!((0.0..1.0).contains(&u));
            let (a, b) = random.normal_pair();
            sum += a + b;
            squares += a * a + b * b;
            fourth += a.powi(4) + b.powi(4);
        }
        let n = f64::from(n);
        // Standard errors √(1/n), √(2/n), √(96/n); four of each.
        assert!((sum / n).abs() < 4.0 / n.sqrt());
        assert!((squares / n - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
        assert!((fourth / n - 3.0).abs() < 4.0 * (96.0 / n).sqrt());
    }
}
