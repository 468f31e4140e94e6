//! The two sweeps over one tile: a group of segments side by side, eight rows at a time.
//!
//! Right-hand sides and solutions stand in the user's order, the rows of a segment one after the other; a block of eight
//! rows of a group, as many segments as a register has lanes, is turned in registers. What a lane calculates does not
//! depend on how many lanes a register has. `B` is the number of blocks of a segment where the compiler knows it, which
//! takes the checks of all indices away; 0 where it does not.

use super::{Block, Coefficients, SEGMENTS};
use crate::linalg::Lanes;
use crate::linalg::lanes::{Isa, Kernel};

/// Forward: y ← L⁻¹ b of the rows inside the segments.
pub(super) struct Down<'a> {
    pub(super) coefficients: &'a Coefficients,
    /// The tile's part of the right-hand side, 16 segments long.
    pub(super) rhs: &'a [f64],
    pub(super) y: &'a mut [Block],
}

/// What the interfaces receive from the rows inside.
#[derive(Default)]
pub(super) struct Received {
    /// Right-hand side of the interface at the end of each segment, as far as this tile knows it.
    pub(super) interfaces: [f64; SEGMENTS],
    /// To be taken from the last interface of the tile before.
    pub(super) for_the_one_before: f64,
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

impl Down<'_> {
    /// Real-time: yes.
    #[inline]
    pub(super) fn run(self, lanes: Lanes) -> Received {
        // The lengths that long chains have.
        match self.y.len() {
            5 => lanes.run(Known::<_, 5>(self)),
            13 => lanes.run(Known::<_, 13>(self)),
            29 => lanes.run(Known::<_, 29>(self)),
            61 => lanes.run(Known::<_, 61>(self)),
            _ => lanes.run(Known::<_, 0>(self)),
        }
    }
}

impl Up<'_> {
    /// Real-time: yes.
    #[inline]
    pub(super) fn run(self, lanes: Lanes) {
        match self.y.len() {
            5 => lanes.run(Known::<_, 5>(self)),
            13 => lanes.run(Known::<_, 13>(self)),
            29 => lanes.run(Known::<_, 29>(self)),
            61 => lanes.run(Known::<_, 61>(self)),
            _ => lanes.run(Known::<_, 0>(self)),
        }
    }
}

/// A sweep over segments of `B` blocks, or of as many as it has.
struct Known<S, const B: usize>(S);

impl<const B: usize> Kernel for Known<Down<'_>, B> {
    type Output = Received;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> Received {
        let Down {
            coefficients,
            rhs,
            y,
        } = self.0;
        let blocks = if B == 0 { y.len() } else { B };
        let (rhs, fill) = (rhs.as_chunks::<8>().0, &coefficients.fill);
        let (Some(rhs), Some(y), Some(multiplier)) = (
            rhs.get(..SEGMENTS * blocks),
            y.get_mut(..blocks),
            coefficients.multiplier.get(..blocks),
        ) else {
            return Received::default();
        };
        let (mut above, mut sums) = (Row::ZERO, Row::ZERO);
        for (at, (y, multiplier)) in y.iter_mut().zip(multiplier).enumerate() {
            let fill = fill.get(at);
            for group in 0..SEGMENTS / I::GROUP {
                let first = group * I::GROUP;
                let mut segments = [&NOTHING; 8];
                for (j, segment) in segments.iter_mut().enumerate().take(I::GROUP) {
                    if let Some(rows) = rhs.get((first + j) * blocks + at) {
                        *segment = rows;
                    }
                }
                let mut rows = isa.turn_in(segments);
                let mut last = above.group(isa, first);
                for ((row, y), l) in rows.iter_mut().zip(&mut *y).zip(multiplier) {
                    last = isa.sub_group(*row, isa.mul_group(l.group(isa, first), last));
                    *row = last;
                    y.put(isa, first, last);
                }
                above.put(isa, first, last);
                if let Some(fill) = fill {
                    let mut sum = sums.group(isa, first);
                    for (row, f) in rows.iter().zip(fill) {
                        sum = isa.add_group(sum, isa.mul_group(f.group(isa, first), *row));
                    }
                    sums.put(isa, first, sum);
                }
            }
        }
        let (mut interfaces, to_the_left) = (above.0, sums.0);
        for (interface, from_the_right) in interfaces.iter_mut().zip(&to_the_left[1..]) {
            *interface -= from_the_right;
        }
        Received {
            interfaces,
            for_the_one_before: to_the_left[0],
        }
    }
}

impl<const B: usize> Kernel for Known<Up<'_>, B> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Up {
            coefficients,
            y,
            interfaces,
            before,
            out,
        } = self.0;
        let blocks = if B == 0 { y.len() } else { B };
        let (out, fill) = (out.as_chunks_mut::<8>().0, &coefficients.fill);
        let (Some(out), Some(y), Some(multiplier), Some(inverse)) = (
            out.get_mut(..SEGMENTS * blocks),
            y.get(..blocks),
            coefficients.multiplier.get(..blocks),
            coefficients.inverse.get(..blocks),
        ) else {
            return;
        };
        let mut left = Row([before; SEGMENTS]);
        left.0[1..].copy_from_slice(&interfaces[..SEGMENTS - 1]);
        // The row of the interface itself; nothing of its own segment lies below it.
        let mut below = Row(*interfaces);
        let mut links: &Row = &Row::ZERO;
        for at in (0..blocks).rev() {
            let (y, inverse, multiplier) = (&y[at], &inverse[at], &multiplier[at]);
            let fill = fill.get(at);
            for group in 0..SEGMENTS / I::GROUP {
                let first = group * I::GROUP;
                let mut rows = [isa.splat_group(0.0); 8];
                for ((row, y), d) in rows.iter_mut().zip(y).zip(inverse) {
                    *row = isa.mul_group(y.group(isa, first), d.group(isa, first));
                }
                if let Some(fill) = fill {
                    let left = left.group(isa, first);
                    for (row, f) in rows.iter_mut().zip(fill) {
                        *row = isa.sub_group(*row, isa.mul_group(f.group(isa, first), left));
                    }
                }
                let mut last = below.group(isa, first);
                if at + 1 < blocks {
                    last = isa.sub_group(rows[7], isa.mul_group(links.group(isa, first), last));
                }
                rows[7] = last;
                for k in (0..7).rev() {
                    let l = multiplier[k + 1].group(isa, first);
                    last = isa.sub_group(rows[k], isa.mul_group(l, last));
                    rows[k] = last;
                }
                below.put(isa, first, last);
                let segments = isa.turn_out(rows);
                for (j, rows) in segments.into_iter().enumerate().take(I::GROUP) {
                    if let Some(out) = out.get_mut((first + j) * blocks + at) {
                        isa.store(rows, out);
                    }
                }
            }
            links = &multiplier[0];
        }
    }
}

/// Rows that do not exist.
static NOTHING: [f64; 8] = [0.0; 8];

/// One number per segment, on a cache line of its own pair.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub(super) struct Row(pub(super) [f64; SEGMENTS]);

impl Row {
    pub(super) const ZERO: Self = Self([0.0; SEGMENTS]);

    /// The numbers of a group of segments that begins with `first`.
    #[inline(always)]
    fn group<I: Isa>(&self, isa: I, first: usize) -> I::G {
        isa.load_group(&self.0[first..first + I::GROUP])
    }

    #[inline(always)]
    fn put<I: Isa>(&mut self, isa: I, first: usize, value: I::G) {
        isa.store_group(value, &mut self.0[first..first + I::GROUP]);
    }
}
