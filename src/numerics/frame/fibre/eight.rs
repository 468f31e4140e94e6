//! Eight numbers with operators. They keep formulas legible in a [`Kernel`](crate::linalg::lanes::Kernel).

use std::ops::{Add, Div, Mul, Sub};

use crate::linalg::lanes::Isa;

/// Eight numbers in the registers of an [`Isa`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Eight<I: Isa>(pub(super) I, I::V);

macro_rules! operators {
    ($($operator:ident $name:ident),+) => {
        $(
            impl<I: Isa> $operator for Eight<I> {
                type Output = Self;

                #[inline(always)]
                fn $name(self, other: Self) -> Self {
                    Self(self.0, self.0.$name(self.1, other.1))
                }
            }
        )+
    };
}

operators!(Add add, Sub sub, Mul mul, Div div);

impl<I: Isa> Eight<I> {
    /// Eight times the same.
    #[inline(always)]
    pub(super) fn all(isa: I, value: f64) -> Self {
        Self(isa, isa.splat(value))
    }

    /// Eight times the same, in the same registers.
    #[inline(always)]
    pub(super) fn fill(self, value: f64) -> Self {
        Self::all(self.0, value)
    }

    #[inline(always)]
    pub(super) fn load(isa: I, from: &[f64; 8]) -> Self {
        Self(isa, isa.load(from))
    }

    #[inline(always)]
    pub(super) fn store(self, into: &mut [f64; 8]) {
        self.0.store(self.1, into);
    }

    #[inline(always)]
    pub(super) fn array(self) -> [f64; 8] {
        let mut values = [0.0; 8];
        self.store(&mut values);
        values
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        Self(self.0, self.0.abs(self.1))
    }

    /// The smaller one.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min(self.1, other.1))
    }

    /// The greater one.
    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self(self.0, self.0.max(self.1, other.1))
    }

    /// `yes` where these are less than the others, else `no`.
    #[inline(always)]
    pub(super) fn if_less(self, than: Self, yes: Self, no: Self) -> Self {
        Self(self.0, self.0.if_less((self.1, than.1), yes.1, no.1))
    }

    /// A function of each number that uses no [`Isa`].
    #[inline(always)]
    pub(super) fn each(self, of: impl Fn(f64) -> f64) -> Self {
        let mut values = self.array();
        for value in &mut values {
            *value = of(*value);
        }
        Self::load(self.0, &values)
    }
}
