//! Products out ← out − A x of matrices whose shape lets them run over plain arrays.

use super::lanes::{Isa, Kernel};

/// A diagonal matrix.
pub(super) struct Diagonal<'a> {
    pub diagonal: &'a [f64],
    pub x: &'a [f64],
    pub out: &'a mut [f64],
}

impl Kernel for Diagonal<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        for ((out, d), x) in self.out.iter_mut().zip(self.diagonal).zip(self.x) {
            *out -= d * x;
        }
    }
}

/// Inner rows of a tridiagonal matrix over plain arrays: no index to follow, so the compiler can use vector lanes.
pub(super) struct Chain<'a> {
    pub diagonal: &'a [f64],
    /// One more than rows.
    pub beside: &'a [f64],
    /// Two more than rows.
    pub x: &'a [f64],
    pub out: &'a mut [f64],
}

impl Kernel for Chain<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let rows = self.out.iter_mut().zip(self.diagonal);
        for (((out, d), x), e) in rows.zip(self.x.windows(3)).zip(self.beside.windows(2)) {
            *out -= e[0] * x[0] + d * x[1] + e[1] * x[2];
        }
    }
}

/// The product where all inner rows are alike: no coefficients to fetch.
pub(super) struct EvenChain<'a> {
    pub d: f64,
    pub e: f64,
    pub x: &'a [f64],
    pub out: &'a mut [f64],
}

impl Kernel for EvenChain<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let (d, e) = (self.d, self.e);
        for (out, x) in self.out.iter_mut().zip(self.x.windows(3)) {
            *out -= e * x[0] + d * x[1] + e * x[2];
        }
    }
}
