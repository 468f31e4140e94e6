//! Plain arrays: the compiler makes of them what every processor of the target has.

use super::{Isa, first, put_first};

/// What every processor of the target has.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Portable;

/// a ← what `of` makes of a and b.
#[inline(always)]
fn each<const N: usize>(mut a: [f64; N], b: [f64; N], of: impl Fn(f64, f64) -> f64) -> [f64; N] {
    for (a, b) in a.iter_mut().zip(b) {
        *a = of(*a, b);
    }
    a
}

impl Isa for Portable {
    type V = [f64; 8];
    type G = [f64; 2];
    const GROUP: usize = 2;

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
    fn add(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        each(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn min(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        each(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, a: [f64; 8], b: [f64; 8]) -> [f64; 8] {
        each(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn abs(self, a: [f64; 8]) -> [f64; 8] {
        a.map(f64::abs)
    }

    #[inline(always)]
    fn sqrt(self, a: [f64; 8]) -> [f64; 8] {
        a.map(f64::sqrt)
    }

    #[inline(always)]
    fn zero_below(self, a: [f64; 8], limit: [f64; 8]) -> [f64; 8] {
        each(a, limit, |a, limit| if a.abs() < limit { 0.0 } else { a })
    }

    #[inline(always)]
    fn if_less(self, (a, b): ([f64; 8], [f64; 8]), yes: [f64; 8], no: [f64; 8]) -> [f64; 8] {
        let mut out = no;
        for (k, out) in out.iter_mut().enumerate() {
            *out = if a[k] < b[k] { yes[k] } else { *out };
        }
        out
    }

    #[inline(always)]
    fn if_at_most(self, (a, b): ([f64; 8], [f64; 8]), yes: [f64; 8], no: [f64; 8]) -> [f64; 8] {
        let mut out = no;
        for (k, out) in out.iter_mut().enumerate() {
            *out = if a[k] <= b[k] { yes[k] } else { *out };
        }
        out
    }

    #[inline(always)]
    fn load_group(self, from: &[f64]) -> [f64; 2] {
        first(from)
    }

    #[inline(always)]
    fn store_group(self, value: [f64; 2], into: &mut [f64]) {
        put_first(value, into);
    }

    #[inline(always)]
    fn splat_group(self, value: f64) -> [f64; 2] {
        [value; 2]
    }

    #[inline(always)]
    fn add_group(self, a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
        each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub_group(self, a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
        each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul_group(self, a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
        each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn turn_in(self, segments: [&[f64; 8]; 8]) -> [[f64; 2]; 8] {
        let mut rows = [[0.0; 2]; 8];
        for ((row, a), b) in rows.iter_mut().zip(segments[0]).zip(segments[1]) {
            *row = [*a, *b];
        }
        rows
    }

    #[inline(always)]
    fn turn_out(self, rows: [[f64; 2]; 8]) -> [[f64; 8]; 8] {
        let mut segments = [[0.0; 8]; 8];
        for (k, row) in rows.into_iter().enumerate() {
            segments[0][k] = row[0];
            segments[1][k] = row[1];
        }
        segments
    }
}
