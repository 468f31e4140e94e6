//! Eight numbers at a time, with the instructions that the processor has, chosen when the program runs.
//!
//! A [`Kernel`] is written once and compiled for each [`Lanes`]. The invariant: every lane does the operations of the
//! source in their order, no product and sum are fused and no sum is reordered, so that all paths give the same
//! bits. What a kernel calculates must not depend on how wide a register is: sums over rows belong to lanes that the
//! data define. No `unsafe` of ours: the tokens of `pulp` prove that the processor has what a path is compiled for.

mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::fmt;

pub(crate) use portable::Portable;
#[cfg(target_arch = "x86_64")]
use x86::OnIsa;

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
    pub(crate) fn best_for(n: usize) -> Self {
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
/// stays a separate call is compiled for every processor. A closure may stay one: none uses an [`Isa`].
pub(crate) trait Kernel {
    /// Its result.
    type Output;

    /// The calculation.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}

/// Eight doubles, or one double of each segment of a group, and what is done to them, lane by lane.
pub(crate) trait Isa: Copy {
    /// Eight doubles that follow each other.
    type V: Copy;
    /// One double of each segment of a group: what one register holds.
    type G: Copy;
    /// Segments of a group. Divides 16.
    const GROUP: usize;

    /// Eight doubles of memory.
    fn load(self, from: &[f64; 8]) -> Self::V;
    /// Writes eight doubles.
    fn store(self, value: Self::V, into: &mut [f64; 8]);
    /// Eight times the same.
    fn splat(self, value: f64) -> Self::V;
    /// a + b.
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    /// a − b.
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    /// a b.
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// a / b.
    fn div(self, a: Self::V, b: Self::V) -> Self::V;
    /// a where a < b, else b.
    fn min(self, a: Self::V, b: Self::V) -> Self::V;
    /// a where a > b, else b.
    fn max(self, a: Self::V, b: Self::V) -> Self::V;
    /// |a|.
    fn abs(self, a: Self::V) -> Self::V;
    /// √a.
    fn sqrt(self, a: Self::V) -> Self::V;
    /// 0 where |a| < `limit`, else a.
    fn zero_below(self, a: Self::V, limit: Self::V) -> Self::V;
    /// `yes` where a < b of a pair, else `no`.
    fn if_less(self, pair: (Self::V, Self::V), yes: Self::V, no: Self::V) -> Self::V;
    /// `yes` where a ≤ b of a pair, else `no`.
    fn if_at_most(self, pair: (Self::V, Self::V), yes: Self::V, no: Self::V) -> Self::V;

    /// The first [`Isa::GROUP`] entries; there must be as many.
    fn load_group(self, from: &[f64]) -> Self::G;
    /// Writes the first [`Isa::GROUP`] entries.
    fn store_group(self, value: Self::G, into: &mut [f64]);
    /// A group of the same.
    fn splat_group(self, value: f64) -> Self::G;
    /// a + b.
    fn add_group(self, a: Self::G, b: Self::G) -> Self::G;
    /// a − b.
    fn sub_group(self, a: Self::G, b: Self::G) -> Self::G;
    /// a b.
    fn mul_group(self, a: Self::G, b: Self::G) -> Self::G;
    /// Eight rows of a group of segments, the first ones of those given: entry k of segment j becomes entry j of row k.
    fn turn_in(self, segments: [&[f64; 8]; 8]) -> [Self::G; 8];
    /// And back; beyond the group are zeros.
    fn turn_out(self, rows: [Self::G; 8]) -> [Self::V; 8];
}

/// The first `N` entries. A group that is shorter does not exist: segments are counted in groups.
#[inline(always)]
fn first<const N: usize>(of: &[f64]) -> [f64; N] {
    of.first_chunk().copied().unwrap_or([0.0; N])
}

#[inline(always)]
fn put_first<const N: usize>(values: [f64; N], into: &mut [f64]) {
    if let Some(place) = into.first_chunk_mut() {
        *place = values;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Does one of each operation to two vectors, and turns 16 segments of eight rows in and out, doubled.
    struct Probe<'a>(&'a [[f64; 8]; 16]);

    impl Kernel for Probe<'_> {
        type Output = ([[f64; 8]; 12], [[f64; 8]; 16], [[f64; 16]; 8]);

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let (a, b) = (isa.load(&self.0[3]), isa.load(&self.0[4]));
            let results = [
                isa.add(a, b),
                isa.sub(a, b),
                isa.mul(a, b),
                isa.div(a, b),
                isa.min(a, b),
                isa.max(a, b),
                isa.abs(a),
                isa.sqrt(isa.abs(a)),
                isa.zero_below(a, isa.splat(1.0)),
                isa.splat(0.3),
                isa.if_less((a, b), isa.splat(2.0), b),
                isa.if_at_most((a, b), isa.splat(2.0), b),
            ];
            let mut out = [[0.0; 8]; 12];
            for (value, out) in results.into_iter().zip(&mut out) {
                isa.store(value, out);
            }
            let (mut back, mut turned) = ([[0.0; 8]; 16], [[0.0; 16]; 8]);
            for group in 0..16 / I::GROUP {
                let first = group * I::GROUP;
                let mut segments = [&self.0[0]; 8];
                for (j, segment) in segments.iter_mut().enumerate().take(I::GROUP) {
                    *segment = &self.0[first + j];
                }
                let mut rows = isa.turn_in(segments);
                for (row, out) in rows.iter_mut().zip(&mut turned) {
                    isa.store_group(*row, &mut out[first..]);
                    let again = isa.load_group(&out[first..]);
                    let one = isa.splat_group(1.0);
                    let with_one = isa.add_group(*row, one);
                    *row = isa.add_group(isa.mul_group(again, one), isa.sub_group(with_one, one));
                }
                let segments = isa.turn_out(rows);
                for (j, rows) in segments.into_iter().enumerate().take(I::GROUP) {
                    isa.store(rows, &mut back[first + j]);
                }
            }
            (out, back, turned)
        }
    }

    #[test]
    fn every_path_matches_plain_loops() {
        let mut block = [[0.0; 8]; 16];
        for (i, row) in block.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = ((7 * i + 5 * j) % 23) as f64 / 7.0 - 1.6;
            }
        }
        block[3][0] = f64::NAN;
        block[4][1] = f64::NAN;
        (block[3][2], block[4][2]) = (0.0, -0.0);
        (block[3][4], block[4][4]) = (f64::NEG_INFINITY, 2.0);
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
        for lanes in Lanes::available() {
            let (out, back, turned) = lanes.run(Probe(&block));
            for k in 0..8 {
                let (a, b) = (block[3][k], block[4][k]);
                let wanted = [
                    a + b,
                    a - b,
                    a * b,
                    a / b,
                    if a < b { a } else { b },
                    if a > b { a } else { b },
                    a.abs(),
                    a.abs().sqrt(),
                    if a.abs() < 1.0 { 0.0 } else { a },
                    0.3,
                    if a < b { 2.0 } else { b },
                    if a <= b { 2.0 } else { b },
                ];
                for (which, wanted) in wanted.into_iter().enumerate() {
                    let found = out[which][k];
                    assert!(
                        same(found, wanted),
                        "{lanes}: {which} of {a} and {b}: {found}"
                    );
                }
            }
            for (i, row) in block.iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    assert!(same(turned[j][i], *value), "{lanes} {i} {j}");
                    let wanted = value + ((value + 1.0) - 1.0);
                    assert!(same(back[i][j], wanted), "{lanes} {i} {j}");
                }
            }
        }
    }

    #[test]
    fn missing_lanes_are_replaced() {
        assert_eq!(Lanes::available().next(), Some(Lanes::Portable));
        assert!(Lanes::available().any(|lanes| lanes == Lanes::best()));
        assert_eq!(Lanes::Avx2.to_string(), "AVX2");
    }
}
