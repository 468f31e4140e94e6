//! Noise as a function of a seed and a place in the test, not of how often it was asked for.
//!
//! A trial that is repeated from the same committed state reads the same noise, so that a test takes the same course in
//! process and behind a link. The generator is a counter through the finaliser of SplitMix64 (Steele, Lea & Flood 2014);
//! normal numbers come in pairs by Box and Muller with the functions of `libm`.

use std::f64::consts::PI;

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

const fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// In [0, 1).
fn uniform(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// Two independent normal numbers of mean 0 and variance 1 for channel `channel` of stream `seed` at tick `tick`, reading
/// `reading` of it. Real-time: yes.
#[must_use]
pub fn normal_pair(seed: u64, channel: u64, tick: u64, reading: u64) -> (f64, f64) {
    let mut at = mixed(seed.wrapping_add(GOLDEN));
    for part in [channel, tick, reading] {
        at = mixed(at.wrapping_add(part).wrapping_add(GOLDEN));
    }
    let first = uniform(mixed(at.wrapping_add(GOLDEN)));
    let second = uniform(mixed(at.wrapping_add(GOLDEN.wrapping_mul(2))));
    // 1 − u is in (0, 1]: its logarithm is finite.
    let radius = (-2.0 * libm::log(1.0 - first)).sqrt();
    let (sine, cosine) = libm::sincos(2.0 * PI * second);
    (radius * cosine, radius * sine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_white_and_independent() {
        let n = 40_000_u64;
        let draw = |channel, tick| normal_pair(7, channel, tick, 0);
        let (mut sum, mut square, mut fourth, mut next, mut other) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for tick in 0..n {
            let (a, b) = draw(0, tick);
            sum += a;
            square += a * a;
            fourth += a * a * a * a;
            next += a * draw(0, tick + 1).0;
            other += a * (draw(1, tick).0 + b);
        }
        let n = n as f64;
        // Five standard deviations: 1/√n of the mean and of the products, √2/√n and √96/√n of the powers.
        let bound = 5.0 / n.sqrt();
        assert!((sum / n).abs() < bound && (next / n).abs() < bound);
        assert!((other / n).abs() < 1.5 * bound);
        assert!((square / n - 1.0).abs() < 1.5 * bound);
        assert!((fourth / n - 3.0).abs() < 10.0 * bound);
        assert_ne!(normal_pair(7, 0, 0, 0), normal_pair(8, 0, 0, 0));
        assert_ne!(normal_pair(7, 0, 0, 0), normal_pair(7, 0, 0, 1));
    }
}
