//! Powers of positive numbers in plain operations: they vectorize, and their bits are equal on every machine.

use super::eight::Eight;
use crate::linalg::lanes::Isa;

/// 2/((2 k + 1) ln 2): log₂ m = s Σ cₖ s²ᵏ with s = (m − 1)/(m + 1). For m from 1/√2 to √2 the terms left out are below 1e-16.
const LOGARITHM: [[f64; 2]; 5] = {
    let mut terms = [[0.0; 2]; 5];
    let mut k = 0;
    while k < 10 {
        terms[k / 2][k % 2] = 2.0 / ((2 * k + 1) as f64 * std::f64::consts::LN_2);
        k += 1;
    }
    terms
};

/// 1/k!. For |z| up to ln(2)/2 the terms left out of eᶻ are below 1e-14.
const EXPONENTIAL: [[f64; 2]; 6] = {
    let mut terms = [[1.0; 2]; 6];
    let (mut k, mut factorial) = (2, 1.0);
    while k < 12 {
        factorial *= k as f64;
        terms[k / 2][k % 2] = 1.0 / factorial;
        k += 1;
    }
    terms
};

/// 2⁵²: the last bit of a double between it and 2⁵³ counts 1.
const UNITS: f64 = 4_503_599_627_370_496.0;
const ONE: u64 = 1.0_f64.to_bits();
const FRACTION: u64 = (1 << 52) - 1;

/// The binary exponent of a positive number: the whole number e with 2ᵉ ≤ x < 2ᵉ⁺¹; −1023 for 0. Real-time: yes.
#[inline(always)]
pub(super) fn exponent_of<I: Isa>(x: Eight<I>) -> Eight<I> {
    x.each(|x| f64::from_bits((x.to_bits() >> 52) | UNITS.to_bits()) - (UNITS + 1023.0))
}

/// baseᵉˣᵖᵒⁿᵉⁿᵗ for a normal base greater than 0; 0 where the result is below 2⁻¹⁰⁰⁰ or the base is 0 and the exponent at least 1.
/// The result must be below 2¹⁰⁰⁰. Real-time: yes.
///
/// y = exponent × log₂ base is kept as two numbers. Only the rounding of the whole one counts, so that the relative error
/// is about 1e-14 + 1e-16 |y|/3 and stays below 1e-13 for |y| up to 700.
#[inline(always)]
pub(super) fn power<I: Isa>(base: Eight<I>, exponent: Eight<I>) -> Eight<I> {
    let fraction = base.each(|x| f64::from_bits((x.to_bits() & FRACTION) | ONE));
    let (middle, one) = (base.fill(std::f64::consts::SQRT_2), base.fill(1.0));
    let m = middle.if_less(fraction, base.fill(0.5) * fraction, fraction);
    let up = middle.if_less(fraction, one, base.fill(0.0));
    let whole = exponent * (exponent_of(base) + up);
    let s = (m - one) / (m + one);
    let part = exponent * (s * series(s * s, &LOGARITHM));

    let y = whole + part;
    let shifted = y + base.fill(1.5 * UNITS);
    let nearest = shifted - base.fill(1.5 * UNITS);
    let z = ((whole - nearest) + part) * base.fill(std::f64::consts::LN_2);
    let scale = shifted.each(|n| f64::from_bits((n.to_bits() << 52).wrapping_add(ONE)));
    let value = scale * series(z, &EXPONENTIAL);
    y.if_less(base.fill(-1000.0), base.fill(0.0), value)
}

/// Σ cₖ xᵏ. Even and odd terms apart are two short chains instead of a long one.
#[inline(always)]
fn series<I: Isa, const N: usize>(x: Eight<I>, pairs: &[[f64; 2]; N]) -> Eight<I> {
    let square = x * x;
    let (mut even, mut odd) = (x.fill(0.0), x.fill(0.0));
    for [low, high] in pairs.iter().rev() {
        even = even * square + x.fill(*low);
        odd = odd * square + x.fill(*high);
    }
    even + x * odd
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linalg::Lanes;
    use crate::linalg::lanes::Kernel;

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

    /// Powers, and the binary exponents of the bases.
    struct Powers<'a>(&'a [(f64, f64)]);

    impl Kernel for Powers<'_> {
        type Output = Vec<[f64; 2]>;

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Vec<[f64; 2]> {
            let mut found = Vec::new();
            for (base, exponent) in self.0 {
                let base = Eight::all(isa, *base);
                let powers = power(base, Eight::all(isa, *exponent)).array();
                assert!(
                    powers
                        .iter()
                        .all(|one| one.to_bits() == powers[0].to_bits())
                );
                found.push([powers[0], exponent_of(base).array()[3]]);
            }
            found
        }
    }

    #[test]
    fn power_matches_libm() {
        let cases = cases();
        let found = Lanes::Portable.run(Powers(&cases));
        for ((base, exponent), [found, _]) in cases.into_iter().zip(found) {
            let off = (found / libm::pow(base, exponent) - 1.0).abs();
            assert!(off <= 1e-13, "{base:e} {exponent}: {off:e}");
        }
    }

    #[test]
    fn simple_powers_are_exact() {
        let cases = [
            (1.0, 0.37),
            (0.0, 1.5),
            (1e-200, 20.0),
            (1.99, 1.0),
            (0.49, 0.0),
        ];
        let found = Lanes::Portable.run(Powers(&cases));
        let wanted = [
            [1.0, 0.0],
            [0.0, -1023.0],
            [0.0, -665.0],
            [1.99, 0.0],
            [1.0, -2.0],
        ];
        assert_eq!(found, wanted);
    }

    #[test]
    fn power_has_equal_bits_on_all_lanes() {
        let cases = cases();
        let plain = Lanes::Portable.run(Powers(&cases));
        for lanes in Lanes::available() {
            assert!(plain == lanes.run(Powers(&cases)), "{lanes}");
        }
    }
}
