//! The two sweeps over one tile: sixteen segments side by side, eight rows at a time.
//!
//! Right-hand sides and solutions stand in the user's order, the rows of a segment one after the other; a block of eight
//! rows of all segments is turned in registers. What a lane calculates does not depend on how many lanes a
//! register has.

use super::{Block, Coefficients, SEGMENTS};
use crate::linalg::lanes::{Isa, Kernel};

/// Forward: y ← L⁻¹ b of the rows inside the segments.
pub(super) struct Down<'a> {
    pub(super) coefficients: &'a Coefficients,
    /// The tile's part of the right-hand side, 16 segments long.
    pub(super) rhs: &'a [f64],
    pub(super) y: &'a mut [Block],
}

/// What the interfaces receive from the rows inside.
pub(super) struct Received {
    /// Right-hand side of the interface at the end of each segment, as far as this tile knows it.
    pub(super) interfaces: [f64; SEGMENTS],
    /// To be taken from the last interface of the tile before.
    pub(super) for_the_one_before: f64,
}

impl Kernel for Down<'_> {
    type Output = Received;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Received {
        let Coefficients {
            multiplier, fill, ..
        } = self.coefficients;
        let zero = isa.splat(0.0);
        let segments = in_blocks(self.rhs);
        let (mut above, mut above_high) = (zero, zero);
        let (mut sum, mut sum_high) = (zero, zero);
        for (at, (y, multiplier)) in self.y.iter_mut().zip(multiplier).enumerate() {
            let (mut low, mut high) = ([zero; 8], [zero; 8]);
            for j in 0..8 {
                if let (Some(b), Some(c)) = (segments[j].get(at), segments[j + 8].get(at)) {
                    low[j] = isa.load(b);
                    high[j] = isa.load(c);
                }
            }
            let (mut low, mut high) = (isa.transpose(low), isa.transpose(high));
            for k in 0..8 {
                let (l, l_high) = multiplier[k].halves();
                above = isa.sub(low[k], isa.mul(isa.load(l), above));
                above_high = isa.sub(high[k], isa.mul(isa.load(l_high), above_high));
                (low[k], high[k]) = (above, above_high);
                let (y, y_high) = y[k].halves_mut();
                isa.store(above, y);
                isa.store(above_high, y_high);
            }
            if let Some(fill) = fill.get(at) {
                for k in 0..8 {
                    let (f, f_high) = fill[k].halves();
                    sum = isa.add(sum, isa.mul(isa.load(f), low[k]));
                    sum_high = isa.add(sum_high, isa.mul(isa.load(f_high), high[k]));
                }
            }
        }
        let (mut interfaces, mut to_the_left) = ([0.0; SEGMENTS], [0.0; SEGMENTS]);
        let (low, high) = two(&mut interfaces);
        isa.store(above, low);
        isa.store(above_high, high);
        let (low, high) = two(&mut to_the_left);
        isa.store(sum, low);
        isa.store(sum_high, high);
        for (interface, from_the_right) in interfaces.iter_mut().zip(&to_the_left[1..]) {
            *interface -= from_the_right;
        }
        Received {
            interfaces,
            for_the_one_before: to_the_left[0],
        }
    }
}

/// Backward: x ← L⁻ᵀ D⁻¹ y of the rows inside, given the interfaces.
pub(super) struct Up<'a> {
    pub(super) coefficients: &'a Coefficients,
    pub(super) y: &'a [Block],
    /// Solution at the interface that ends each segment.
    pub(super) interfaces: &'a [f64; SEGMENTS],
    /// Solution at the last interface of the tile before; 0 for the first tile.
    pub(super) before: f64,
    /// The tile's part of the solution, 16 segments long.
    pub(super) out: &'a mut [f64],
}

impl Kernel for Up<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Coefficients {
            multiplier,
            inverse,
            fill,
        } = self.coefficients;
        let zero = isa.splat(0.0);
        let segments = in_blocks_mut(self.out);
        let mut left = [self.before; SEGMENTS];
        for (left, interface) in left[1..].iter_mut().zip(self.interfaces) {
            *left = *interface;
        }
        let (left, left_high) = halves(&left);
        let (left, left_high) = (isa.load(left), isa.load(left_high));
        let (end, end_high) = halves(self.interfaces);
        let (end, end_high) = (isa.load(end), isa.load(end_high));
        let (mut below, mut below_high) = (zero, zero);
        let (mut l, mut l_high) = (zero, zero);
        let last = multiplier.len().saturating_sub(1);
        let blocks = self.y.iter().zip(multiplier).zip(inverse).enumerate();
        for (at, ((y, multiplier), inverse)) in blocks.rev() {
            let (mut low, mut high) = ([zero; 8], [zero; 8]);
            for k in 0..8 {
                let ((y, y_high), (d, d_high)) = (y[k].halves(), inverse[k].halves());
                low[k] = isa.mul(isa.load(y), isa.load(d));
                high[k] = isa.mul(isa.load(y_high), isa.load(d_high));
            }
            if let Some(fill) = fill.get(at) {
                for k in 0..8 {
                    let (f, f_high) = fill[k].halves();
                    low[k] = isa.sub(low[k], isa.mul(isa.load(f), left));
                    high[k] = isa.sub(high[k], isa.mul(isa.load(f_high), left_high));
                }
            }
            if at == last {
                // The row of the interface itself; nothing of its own segment lies below it.
                (low[7], high[7]) = (end, end_high);
            }
            for k in (0..8).rev() {
                below = isa.sub(low[k], isa.mul(l, below));
                below_high = isa.sub(high[k], isa.mul(l_high, below_high));
                (low[k], high[k]) = (below, below_high);
                let (m, m_high) = multiplier[k].halves();
                (l, l_high) = (isa.load(m), isa.load(m_high));
            }
            let (low, high) = (isa.transpose(low), isa.transpose(high));
            for j in 0..8 {
                if let Some(out) = segments[j].get_mut(at) {
                    isa.store(low[j], out);
                }
            }
            for j in 0..8 {
                if let Some(out) = segments[j + 8].get_mut(at) {
                    isa.store(high[j], out);
                }
            }
        }
    }
}

#[inline(always)]
fn halves(values: &[f64; SEGMENTS]) -> (&[f64; 8], &[f64; 8]) {
    let (halves, _) = values.as_chunks::<8>();
    // Sixteen are two times eight.
    (&halves[0], &halves[1])
}

#[inline(always)]
fn two(values: &mut [f64; SEGMENTS]) -> (&mut [f64; 8], &mut [f64; 8]) {
    let (halves, _) = values.as_chunks_mut::<8>();
    let (low, high) = halves.split_at_mut(1);
    (&mut low[0], &mut high[0])
}

/// Sixteen segments of equal length, each in blocks of eight rows.
#[inline(always)]
fn in_blocks(values: &[f64]) -> [&[[f64; 8]]; SEGMENTS] {
    let mut segments: [&[[f64; 8]]; SEGMENTS] = [&[]; SEGMENTS];
    let length = (values.len() / SEGMENTS).max(1);
    for (blocks, segment) in segments.iter_mut().zip(values.chunks_exact(length)) {
        *blocks = segment.as_chunks::<8>().0;
    }
    segments
}

#[inline(always)]
fn in_blocks_mut(values: &mut [f64]) -> [&mut [[f64; 8]]; SEGMENTS] {
    let mut segments: [&mut [[f64; 8]]; SEGMENTS] = Default::default();
    let length = (values.len() / SEGMENTS).max(1);
    for (blocks, segment) in segments.iter_mut().zip(values.chunks_exact_mut(length)) {
        *blocks = segment.as_chunks_mut::<8>().0;
    }
    segments
}

/// One number per segment, on a cache line of its own pair.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(super) struct Row(pub(super) [f64; SEGMENTS]);

impl Row {
    #[inline(always)]
    fn halves(&self) -> (&[f64; 8], &[f64; 8]) {
        halves(&self.0)
    }

    #[inline(always)]
    fn halves_mut(&mut self) -> (&mut [f64; 8], &mut [f64; 8]) {
        two(&mut self.0)
    }
}
