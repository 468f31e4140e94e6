//! Powers of positive numbers in plain operations: they vectorize, and their bits are equal on every machine.

/// 2/((2 k + 1) ln 2): log₂ m = s Σ cₖ s²ᵏ with s = (m − 1)/(m + 1). For m from 1/√2 to √2 the first term left out is below 1e-19.
const LOGARITHM: [f64; 12] = {
    let mut terms = [2.0 / std::f64::consts::LN_2; 12];
    let mut k = 1;
    while k < terms.len() {
        terms[k] /= (2 * k + 1) as f64;
        k += 1;
    }
    terms
};

/// 1/k!. For |z| up to ln(2)/2 the first term left out of eᶻ is below 1e-17.
const EXPONENTIAL: [f64; 14] = {
    let mut terms = [1.0; 14];
    let mut k = 1;
    while k < terms.len() {
        terms[k] = terms[k - 1] / k as f64;
        k += 1;
    }
    terms
};

/// 2⁵²: the last bit of a double between it and 2⁵³ counts 1.
const UNITS: f64 = 4_503_599_627_370_496.0;
const FRACTION: u64 = (1 << 52) - 1;

/// The binary exponent of a positive number: the whole number e with 2ᵉ ≤ x < 2ᵉ⁺¹; −1023 for 0. Real-time: yes.
#[inline(always)]
pub(super) fn exponent_of(x: f64) -> f64 {
    f64::from_bits((x.to_bits() >> 52) | UNITS.to_bits()) - (UNITS + 1023.0)
}

/// baseᵉˣᵖᵒⁿᵉⁿᵗ for a normal base greater than 0; 0 where the result is below 2⁻¹⁰⁰⁰ or the base is 0 and the exponent at least 1.
/// The result must be below 2¹⁰⁰⁰. Real-time: yes.
///
/// y = exponent × log₂ base is kept as two numbers. Only the rounding of the whole one counts, so that the relative error
/// is about 1e-16 |y|/3 and stays below 1e-13 for |y| up to 700.
#[inline(always)]
pub(super) fn power(base: f64, exponent: f64) -> f64 {
    let one = 1.0_f64.to_bits();
    let fraction = f64::from_bits((base.to_bits() & FRACTION) | one);
    let upper = fraction > std::f64::consts::SQRT_2;
    let m = if upper { 0.5 * fraction } else { fraction };
    let whole = exponent * (exponent_of(base) + if upper { 1.0 } else { 0.0 });
    let s = (m - 1.0) / (m + 1.0);
    let part = exponent * (s * series(s * s, &LOGARITHM));

    let y = whole + part;
    let shifted = y + 1.5 * UNITS;
    let nearest = shifted - 1.5 * UNITS;
    let z = ((whole - nearest) + part) * std::f64::consts::LN_2;
    let scale = f64::from_bits((shifted.to_bits() << 52).wrapping_add(one));
    if y < -1000.0 {
        0.0
    } else {
        scale * series(z, &EXPONENTIAL)
    }
}

/// Σ cₖ xᵏ of an even number of terms. Even and odd ones apart are two short chains instead of a long one.
#[inline(always)]
fn series<const N: usize>(x: f64, terms: &[f64; N]) -> f64 {
    let square = x * x;
    let pairs = terms.as_chunks::<2>().0.iter().rev().copied();
    let sums = pairs.reduce(|[even, odd], [low, high]| [even * square + low, odd * square + high]);
    let [even, odd] = sums.unwrap_or_default();
    even + x * odd
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Lanes;
    use crate::linalg::lanes::{Isa, Kernel};

    /// Bases 1e-8 to 1e3 and 1 to 2, each with the exponents of steel.
    fn cases() -> Vec<(f64, f64)> {
        let bases = (0..=1100).map(|i| libm::pow(10.0, f64::from(i) / 100.0 - 8.0));
        let near = (0..=64).map(|i| 1.0 + f64::from(i) / 64.0);
        let exponents = [0.1, 0.8, 1.5, 1.9, 2.3, 7.77, 20.0, 25.0];
        let both = |r: f64| [r, 1.0 / r, -1.0 / r];
        let exponents: Vec<f64> = exponents.into_iter().flat_map(both).collect();
        bases
            .chain(near)
            .flat_map(|base| exponents.iter().map(move |exponent| (base, *exponent)))
            .collect()
    }

    #[test]
    fn power_matches_libm() {
        for (base, exponent) in cases() {
            let (found, wanted) = (power(base, exponent), libm::pow(base, exponent));
            let off = (found / wanted - 1.0).abs();
            assert!(off <= 1e-13, "{base:e} {exponent}: {off:e}");
        }
    }

    #[test]
    fn simple_powers_are_exact() {
        assert_eq!(power(1.0, 0.37), 1.0);
        assert_eq!(power(0.0, 1.5), 0.0);
        assert_eq!(power(1e-200, 20.0), 0.0);
        for (x, wanted) in [
            (1.0, 0.0),
            (1.99, 0.0),
            (0.49, -2.0),
            (3e5, 18.0),
            (0.0, -1023.0),
        ] {
            assert_eq!(exponent_of(x), wanted, "{x}");
        }
    }

    struct Powers<'a>(&'a [[f64; 8]], &'a [[f64; 8]]);

    impl Kernel for Powers<'_> {
        type Output = Vec<u64>;

        #[inline(always)]
        fn run<I: Isa>(self, _: I) -> Vec<u64> {
            let mut bits = Vec::new();
            for (bases, exponents) in self.0.iter().zip(self.1) {
                let mut out = [0.0; 8];
                for k in 0..8 {
                    out[k] = power(bases[k], exponents[k]);
                }
                bits.extend(out.map(f64::to_bits));
            }
            bits
        }
    }

    #[test]
    fn power_has_equal_bits_on_all_lanes() {
        let (bases, exponents): (Vec<f64>, Vec<f64>) = cases().into_iter().unzip();
        let (bases, exponents) = (bases.as_chunks().0, exponents.as_chunks().0);
        let plain = Lanes::Portable.run(Powers(bases, exponents));
        for lanes in Lanes::available() {
            assert!(plain == lanes.run(Powers(bases, exponents)), "{lanes}");
        }
    }
}
