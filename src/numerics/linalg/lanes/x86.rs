//! The two x86-64 extensions, through the safe wrappers of `pulp`.

use std::arch::x86_64::{__m256d, __m512d, _CMP_NLT_UQ};

use pulp::x86::{V3, V4};
use pulp::{NullaryFnOnce, Simd, cast, f64x4, f64x8};

use super::{Isa, Kernel, first, put_first};

/// A kernel and the proof that its path exists.
#[derive(Debug)]
pub(super) struct OnIsa<I, K> {
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

/// What `pulp` makes of the two registers of each argument.
macro_rules! twice {
    ($self:ident.$to:ident($($arg:ident),+)) => { [$self.$to($($arg[0]),+), $self.$to($($arg[1]),+)] };
}

/// What `pulp` makes of the one register of each argument.
macro_rules! once {
    ($self:ident.$to:ident($($arg:ident),+)) => { $self.$to($($arg),+) };
}

/// The functions of vectors and groups that `pulp` has.
macro_rules! forwarded {
    ($each:ident, $group:literal) => {
        forwarded!($each: add = add_f64s(a, b), sub = sub_f64s(a, b), mul = mul_f64s(a, b));
        forwarded!($each: div = div_f64s(a, b), min = min_f64s(a, b), max = max_f64s(a, b));
        forwarded!($each: abs = abs_f64s(a), sqrt = sqrt_f64s(a));

        #[inline(always)]
        fn load_group(self, from: &[f64]) -> Self::G {
            cast(first::<$group>(from))
        }

        #[inline(always)]
        fn store_group(self, value: Self::G, into: &mut [f64]) {
            put_first::<$group>(cast(value), into);
        }

        #[inline(always)]
        fn splat_group(self, value: f64) -> Self::G {
            self.splat_f64s(value)
        }

        #[inline(always)]
        fn add_group(self, a: Self::G, b: Self::G) -> Self::G {
            self.add_f64s(a, b)
        }

        #[inline(always)]
        fn sub_group(self, a: Self::G, b: Self::G) -> Self::G {
            self.sub_f64s(a, b)
        }

        #[inline(always)]
        fn mul_group(self, a: Self::G, b: Self::G) -> Self::G {
            self.mul_f64s(a, b)
        }
    };
    ($each:ident: $($name:ident = $to:ident($($arg:ident),+)),+) => {
        $(
            #[inline(always)]
            fn $name(self, $($arg: Self::V),+) -> Self::V {
                $each!(self.$to($($arg),+))
            }
        )+
    };
}

impl Isa for V3 {
    type V = [f64x4; 2];
    type G = f64x4;
    const GROUP: usize = 4;

    forwarded!(twice, 4);

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
    fn zero_below(self, a: Self::V, limit: Self::V) -> Self::V {
        [
            zero_below(self, a[0], limit[0]),
            zero_below(self, a[1], limit[1]),
        ]
    }

    #[inline(always)]
    fn if_less(self, (a, b): (Self::V, Self::V), yes: Self::V, no: Self::V) -> Self::V {
        [
            self.select_f64s(self.less_than_f64s(a[0], b[0]), yes[0], no[0]),
            self.select_f64s(self.less_than_f64s(a[1], b[1]), yes[1], no[1]),
        ]
    }

    #[inline(always)]
    fn if_at_most(self, (a, b): (Self::V, Self::V), yes: Self::V, no: Self::V) -> Self::V {
        [
            self.select_f64s(self.less_than_or_equal_f64s(a[0], b[0]), yes[0], no[0]),
            self.select_f64s(self.less_than_or_equal_f64s(a[1], b[1]), yes[1], no[1]),
        ]
    }

    #[inline(always)]
    fn turn_in(self, segments: [&[f64; 8]; 8]) -> [Self::G; 8] {
        let [a, b, c, d, ..] = segments;
        let (a, b): (Self::V, Self::V) = (cast(*a), cast(*b));
        let (c, d): (Self::V, Self::V) = (cast(*c), cast(*d));
        let top = quarter(self, [a[0], b[0], c[0], d[0]]);
        let low = quarter(self, [a[1], b[1], c[1], d[1]]);
        [
            top[0], top[1], top[2], top[3], low[0], low[1], low[2], low[3],
        ]
    }

    #[inline(always)]
    fn turn_out(self, rows: [Self::G; 8]) -> [Self::V; 8] {
        let [a, b, c, d, e, f, g, h] = rows;
        let (top, low) = (quarter(self, [a, b, c, d]), quarter(self, [e, f, g, h]));
        let none = [self.splat_f64s(0.0); 2];
        [
            [top[0], low[0]],
            [top[1], low[1]],
            [top[2], low[2]],
            [top[3], low[3]],
            none,
            none,
            none,
            none,
        ]
    }
}

/// One comparison (not less, or not a number) and one mask.
#[inline(always)]
fn zero_below(isa: V3, a: f64x4, limit: f64x4) -> f64x4 {
    let avx = isa.avx;
    let stays = avx._mm256_cmp_pd::<_CMP_NLT_UQ>(cast(isa.abs_f64s(a)), cast(limit));
    cast(avx._mm256_and_pd(stays, cast(a)))
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
    type G = f64x8;
    const GROUP: usize = 8;

    forwarded!(once, 8);

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
        self.splat_f64s(value)
    }

    #[inline(always)]
    fn zero_below(self, a: Self::V, limit: Self::V) -> Self::V {
        let below = self.less_than_f64s(self.abs_f64s(a), limit);
        self.select_f64s(below, self.splat_f64s(0.0), a)
    }

    #[inline(always)]
    fn if_less(self, (a, b): (Self::V, Self::V), yes: Self::V, no: Self::V) -> Self::V {
        self.select_f64s(self.less_than_f64s(a, b), yes, no)
    }

    #[inline(always)]
    fn if_at_most(self, (a, b): (Self::V, Self::V), yes: Self::V, no: Self::V) -> Self::V {
        self.select_f64s(self.less_than_or_equal_f64s(a, b), yes, no)
    }

    #[inline(always)]
    fn turn_in(self, segments: [&[f64; 8]; 8]) -> [Self::G; 8] {
        let mut rows = [self.splat_f64s(0.0); 8];
        for (row, segment) in rows.iter_mut().zip(segments) {
            *row = cast(*segment);
        }
        transpose(self, rows)
    }

    #[inline(always)]
    fn turn_out(self, rows: [Self::G; 8]) -> [Self::V; 8] {
        transpose(self, rows)
    }
}

/// The transpose of a block of 8 × 8.
#[inline(always)]
fn transpose(isa: V4, block: [f64x8; 8]) -> [f64x8; 8] {
    let rows: [__m512d; 8] = cast(block);
    let avx = isa.avx512f;
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
            fours[4 * half + 2 * p + 1] = avx._mm512_shuffle_f64x2::<0b11_01_11_01>(top, low);
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
