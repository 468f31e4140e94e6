//! Eight numbers at a time, with the instructions that the processor has, chosen when the program runs.
//!
//! A [`Kernel`] is written once and compiled for each [`Lanes`]. The invariant: every lane does the operations of the
//! source in their order, no product and sum are fused and no sum is reordered, so that all paths give the same
//! bits. What a kernel calculates must not depend on how wide a register is: sums over rows belong to lanes that the
//! data define. No `unsafe` of ours: the tokens of `pulp` prove that the processor has what a path is compiled for.

use std::fmt;

/// The instructions that block arithmetic uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Lanes {
    /// What every processor of the target has (two lanes on x86-64 and on ARM).
    Portable,
    /// AVX2: four lanes.
    Avx2,
    /// AVX-512: eight lanes.
    Avx512,
}

impl fmt::Display for Lanes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Lanes::Portable => "portable",
            Lanes::Avx2 => "AVX2",
            Lanes::Avx512 => "AVX-512",
        })
    }
}

impl Lanes {
    /// The widest that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Lanes::Portable)
    }

    /// The best for vectors of `n` entries: the widest, unless they fill no wide register.
    #[must_use]
    pub fn best_for(n: usize) -> Self {
        if n < 8 { Lanes::Portable } else { Self::best() }
    }

    /// All that this processor has, the narrowest first.
    pub fn available() -> impl Iterator<Item = Self> {
        [Lanes::Portable, Lanes::Avx2, Lanes::Avx512]
            .into_iter()
            .filter(|lanes| lanes.is_available())
    }

    #[cfg(target_arch = "x86_64")]
    fn is_available(self) -> bool {
        match self {
            Lanes::Portable => true,
            Lanes::Avx2 => pulp::x86::V3::try_new().is_some(),
            Lanes::Avx512 => pulp::x86::V4::try_new().is_some(),
        }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn is_available(self) -> bool {
        self == Lanes::Portable
    }

    /// Runs the kernel on these lanes; on those of every processor where this one lacks them. Real-time: yes.
    #[inline]
    pub(crate) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        #[cfg(target_arch = "x86_64")]
        match self {
            Lanes::Avx512 => {
                if let Some(isa) = pulp::x86::V4::try_new() {
                    return isa.vectorize(OnIsa { isa, kernel });
                }
            }
            Lanes::Avx2 => {
                if let Some(isa) = pulp::x86::V3::try_new() {
                    return isa.vectorize(OnIsa { isa, kernel });
                }
            }
            Lanes::Portable => {}
        }
        kernel.run(Portable)
    }
}

/// A calculation that is compiled once for each path. `run` must be `#[inline(always)]`, and all that it calls: what
/// stays a call of its own is compiled for every processor.
pub(crate) trait Kernel {
    /// What it gives.
    type Output;

    /// The calculation.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}

/// Eight doubles and what is done to them, lane by lane.
pub(crate) trait Isa: Copy {
    /// Eight doubles.
    type V: Copy;

    fn load(self, from: &[f64; 8]) -> Self::V;
    fn store(self, value: Self::V, into: &mut [f64; 8]);
    fn splat(self, value: f64) -> Self::V;
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// Entry i of vector j becomes entry j of vector i.
    fn transpose(self, block: [Self::V; 8]) -> [Self::V; 8];
}

/// Plain arrays: the compiler makes of them what every processor of the target has.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Portable;

impl Isa for Portable {
    type V = [f64; 8];

    #[inline(always)]
    fn load(self, from: &[f64; 8]) -> [f64; 8] {
        *from
    }

    #[inline(always)]
    fn store(self, value: [f64; 8], into: &mut [f64; 8]) {
        *into = value;
    }

    #[inline(always)]
    fn splat(self, value: f64) -> [f64; 8] {
        [value; 8]
    }

    #[inline(always)]
    fn add(self, mut a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        for (a, b) in a.iter_mut().zip(b) {
            *a += b;
        }
        a
    }

    #[inline(always)]
    fn sub(self, mut a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        for (a, b) in a.iter_mut().zip(b) {
            *a -= b;
        }
        a
    }

    #[inline(always)]
    fn mul(self, mut a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        for (a, b) in a.iter_mut().zip(b) {
            *a *= b;
        }
        a
    }

    #[inline(always)]
    fn transpose(self, block: [[f64; 8]; 8]) -> [[f64; 8]; 8] {
        let mut turned = block;
        for (i, row) in block.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                turned[j][i] = *value;
            }
        }
        turned
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use x86::OnIsa;

/// The two x86-64 extensions, through the safe wrappers of `pulp`.
#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{__m256d, __m512d};

    use pulp::x86::{V3, V4};
    use pulp::{NullaryFnOnce, Simd, cast, f64x4, f64x8};

    use super::{Isa, Kernel};

    /// A kernel and the proof that its path exists.
    #[derive(Debug)]
    pub(crate) struct OnIsa<I, K> {
        pub(super) isa: I,
        pub(super) kernel: K,
    }

    impl<I: Isa, K: Kernel> NullaryFnOnce for OnIsa<I, K> {
        type Output = K::Output;

        #[inline(always)]
        fn call(self) -> K::Output {
            self.kernel.run(self.isa)
        }
    }

    impl Isa for V3 {
        type V = [f64x4; 2];

        #[inline(always)]
        fn load(self, from: &[f64; 8]) -> Self::V {
            cast(*from)
        }

        #[inline(always)]
        fn store(self, value: Self::V, into: &mut [f64; 8]) {
            *into = cast(value);
        }

        #[inline(always)]
        fn splat(self, value: f64) -> Self::V {
            [self.splat_f64s(value); 2]
        }

        #[inline(always)]
        fn add(self, a: Self::V, b: Self::V) -> Self::V {
            [self.add_f64s(a[0], b[0]), self.add_f64s(a[1], b[1])]
        }

        #[inline(always)]
        fn sub(self, a: Self::V, b: Self::V) -> Self::V {
            [self.sub_f64s(a[0], b[0]), self.sub_f64s(a[1], b[1])]
        }

        #[inline(always)]
        fn mul(self, a: Self::V, b: Self::V) -> Self::V {
            [self.mul_f64s(a[0], b[0]), self.mul_f64s(a[1], b[1])]
        }

        #[inline(always)]
        fn transpose(self, m: [Self::V; 8]) -> [Self::V; 8] {
            let upper_left = quarter(self, [m[0][0], m[1][0], m[2][0], m[3][0]]);
            let lower_left = quarter(self, [m[4][0], m[5][0], m[6][0], m[7][0]]);
            let upper_right = quarter(self, [m[0][1], m[1][1], m[2][1], m[3][1]]);
            let lower_right = quarter(self, [m[4][1], m[5][1], m[6][1], m[7][1]]);
            [
                [upper_left[0], lower_left[0]],
                [upper_left[1], lower_left[1]],
                [upper_left[2], lower_left[2]],
                [upper_left[3], lower_left[3]],
                [upper_right[0], lower_right[0]],
                [upper_right[1], lower_right[1]],
                [upper_right[2], lower_right[2]],
                [upper_right[3], lower_right[3]],
            ]
        }
    }

    /// The transpose of a block of 4 × 4.
    #[inline(always)]
    fn quarter(isa: V3, rows: [f64x4; 4]) -> [f64x4; 4] {
        let [a, b, c, d]: [__m256d; 4] = cast(rows);
        let avx = isa.avx;
        let (even_top, odd_top) = (avx._mm256_unpacklo_pd(a, b), avx._mm256_unpackhi_pd(a, b));
        let (even_low, odd_low) = (avx._mm256_unpacklo_pd(c, d), avx._mm256_unpackhi_pd(c, d));
        [
            cast(avx._mm256_permute2f128_pd::<0x20>(even_top, even_low)),
            cast(avx._mm256_permute2f128_pd::<0x20>(odd_top, odd_low)),
            cast(avx._mm256_permute2f128_pd::<0x31>(even_top, even_low)),
            cast(avx._mm256_permute2f128_pd::<0x31>(odd_top, odd_low)),
        ]
    }

    impl Isa for V4 {
        type V = f64x8;

        #[inline(always)]
        fn load(self, from: &[f64; 8]) -> f64x8 {
            cast(*from)
        }

        #[inline(always)]
        fn store(self, value: f64x8, into: &mut [f64; 8]) {
            *into = cast(value);
        }

        #[inline(always)]
        fn splat(self, value: f64) -> f64x8 {
            self.splat_f64s(value)
        }

        #[inline(always)]
        fn add(self, a: f64x8, b: f64x8) -> f64x8 {
            self.add_f64s(a, b)
        }

        #[inline(always)]
        fn sub(self, a: f64x8, b: f64x8) -> f64x8 {
            self.sub_f64s(a, b)
        }

        #[inline(always)]
        fn mul(self, a: f64x8, b: f64x8) -> f64x8 {
            self.mul_f64s(a, b)
        }

        #[inline(always)]
        fn transpose(self, block: [f64x8; 8]) -> [f64x8; 8] {
            let rows: [__m512d; 8] = cast(block);
            let avx = self.avx512f;
            // Pairs of rows: columns 0 2 4 6 of both interleaved, then 1 3 5 7.
            let mut pairs = rows;
            for k in 0..4 {
                pairs[2 * k] = avx._mm512_unpacklo_pd(rows[2 * k], rows[2 * k + 1]);
                pairs[2 * k + 1] = avx._mm512_unpackhi_pd(rows[2 * k], rows[2 * k + 1]);
            }
            // Four rows: columns p and p + 4, then p + 2 and p + 6.
            let mut fours = pairs;
            for half in 0..2 {
                for p in 0..2 {
                    let (top, low) = (pairs[4 * half + p], pairs[4 * half + 2 + p]);
                    fours[4 * half + 2 * p] = avx._mm512_shuffle_f64x2::<0b10_00_10_00>(top, low);
                    fours[4 * half + 2 * p + 1] =
                        avx._mm512_shuffle_f64x2::<0b11_01_11_01>(top, low);
                }
            }
            let mut columns = rows;
            for p in 0..2 {
                for s in 0..2 {
                    let (top, low) = (fours[2 * p + s], fours[4 + 2 * p + s]);
                    columns[p + 2 * s] = avx._mm512_shuffle_f64x2::<0b10_00_10_00>(top, low);
                    columns[p + 2 * s + 4] = avx._mm512_shuffle_f64x2::<0b11_01_11_01>(top, low);
                }
            }
            cast(columns)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Transposes a block and does one of each operation to it.
    struct Probe<'a>(&'a [[f64; 8]; 8]);

    impl Kernel for Probe<'_> {
        type Output = [[f64; 8]; 8];

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> [[f64; 8]; 8] {
            let mut block = [isa.splat(0.0); 8];
            for (v, row) in block.iter_mut().zip(self.0) {
                *v = isa.load(row);
            }
            let turned = isa.transpose(block);
            let mut out = [[0.0; 8]; 8];
            for ((out, t), b) in out.iter_mut().zip(turned).zip(block) {
                let product = isa.mul(isa.sub(t, isa.splat(0.3)), b);
                isa.store(isa.add(product, t), out);
            }
            out
        }
    }

    #[test]
    fn every_path_turns_and_calculates_like_plain_loops() {
        let mut block = [[0.0; 8]; 8];
        for (i, row) in block.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = (8 * i + j) as f64 + 0.1;
            }
        }
        for lanes in Lanes::available() {
            let out = lanes.run(Probe(&block));
            for (i, row) in out.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    let wanted = (block[j][i] - 0.3) * block[i][j] + block[j][i];
                    assert_eq!(value.to_bits(), wanted.to_bits(), "{lanes} {i} {j}");
                }
            }
        }
    }

    #[test]
    fn lanes_that_are_missing_are_replaced_and_the_best_ones_exist() {
        assert_eq!(Lanes::available().next(), Some(Lanes::Portable));
        assert!(Lanes::available().any(|lanes| lanes == Lanes::best()));
        assert_eq!(Lanes::Avx2.to_string(), "AVX2");
    }
}
