//! The two sweeps over one tile: a group of segments side by side, eight rows at a time.
//!
//! Right-hand sides and solutions are in the user's order, the rows of a segment one after the other. Registers
//! transpose a block of eight rows of a group, which has as many segments as a register has lanes. The result of a lane
//! does not depend on the number of lanes. `B` is the number of blocks of a segment where the compiler knows it, which
//! removes all index checks; otherwise 0.

use super::{Block, Coefficients, HEIGHT, SEGMENTS};
use crate::linalg::Lanes;
use crate::linalg::lanes::{Isa, Kernel};

/// Forward: y ← L⁻¹ b of the rows inside the segments.
pub(super) struct Down<'a> {
    pub(super) coefficients: &'a Coefficients,
    /// The tile's part of the right-hand side, 16 segments long.
    pub(super) rhs: &'a [f64],
    pub(super) y: &'a mut [Block],
}

/// Contributions of the inner rows to the interfaces.
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
        let (blocks, even) = (self.y.len(), self.coefficients.is_even());
        on_lanes(self, blocks, even, lanes)
    }
}

impl Up<'_> {
    /// Real-time: yes.
    #[inline]
    pub(super) fn run(self, lanes: Lanes) {
        let (blocks, even) = (self.y.len(), self.coefficients.is_even());
        on_lanes(self, blocks, even, lanes);
    }
}

/// A sweep over segments of `B` blocks, or of as many as it has if that is 0, with coefficients that are alike in all segments if
/// `EVEN`. `sweep` must be `#[inline(always)]`, as what a [`Kernel`] runs.
trait Sweep {
    type Output;

    fn sweep<I: Isa, const B: usize, const EVEN: bool>(self, isa: I) -> Self::Output;
}

/// Runs a sweep that knows its length, where it is one of those that long chains have, or the one that most even chains have.
#[inline]
fn on_lanes<S: Sweep>(sweep: S, blocks: usize, even: bool, lanes: Lanes) -> S::Output {
    match (blocks, even) {
        (5, true) => lanes.run(Known::<_, 5, true>(sweep)),
        (5, false) => lanes.run(Known::<_, 5, false>(sweep)),
        (13, false) => lanes.run(Known::<_, 13, false>(sweep)),
        (29, false) => lanes.run(Known::<_, 29, false>(sweep)),
        (61, false) => lanes.run(Known::<_, 61, false>(sweep)),
        (_, true) => lanes.run(Known::<_, 0, true>(sweep)),
        (_, false) => lanes.run(Known::<_, 0, false>(sweep)),
    }
}

/// A [`Sweep`] as a kernel.
struct Known<S, const B: usize, const EVEN: bool>(S);

impl<S: Sweep, const B: usize, const EVEN: bool> Kernel for Known<S, B, EVEN> {
    type Output = S::Output;

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) -> S::Output {
        self.0.sweep::<I, B, EVEN>(isa)
    }
}

impl Sweep for Down<'_> {
    type Output = Received;

    #[inline(always)]
    fn sweep<I: Isa, const B: usize, const EVEN: bool>(self, isa: I) -> Received {
        let Down {
            coefficients,
            rhs,
            y,
        } = self;
        let blocks = if B == 0 { y.len() } else { B };
        let (Some(rhs), Some(y), Some(multiplier)) = (
            rhs.as_chunks::<8>().0.get(..SEGMENTS * blocks),
            y.get_mut(..blocks),
            coefficients.multiplier.view::<EVEN>(blocks),
        ) else {
            return Received::default();
        };
        let (fill, reach) = coefficients.fill::<EVEN>();
        let (mut above, mut sums) = (Row::ZERO, Row::ZERO);
        for (at, y) in y.iter_mut().enumerate() {
            let multiplier = multiplier.block(at);
            let fill = (at < reach).then(|| fill.block(at));
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
                for (k, (row, y)) in rows.iter_mut().zip(&mut *y).enumerate() {
                    last = isa.sub_group(*row, isa.mul_group(multiplier.row(isa, k, first), last));
                    *row = last;
                    y.put(isa, first, last);
                }
                above.put(isa, first, last);
                if let Some(fill) = fill {
                    let mut sum = sums.group(isa, first);
                    for (k, row) in rows.iter().enumerate() {
                        sum = isa.add_group(sum, isa.mul_group(fill.row(isa, k, first), *row));
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

impl Sweep for Up<'_> {
    type Output = ();

    #[inline(always)]
    fn sweep<I: Isa, const B: usize, const EVEN: bool>(self, isa: I) {
        let Up {
            coefficients,
            y,
            interfaces,
            before,
            out,
        } = self;
        let blocks = if B == 0 { y.len() } else { B };
        let (Some(out), Some(y), Some(multipliers), Some(inverse)) = (
            out.as_chunks_mut::<8>().0.get_mut(..SEGMENTS * blocks),
            y.get(..blocks),
            coefficients.multiplier.view::<EVEN>(blocks),
            coefficients.inverse.view::<EVEN>(blocks),
        ) else {
            return;
        };
        let (fill, reach) = coefficients.fill::<EVEN>();
        let mut left = Row([before; SEGMENTS]);
        left.0[1..].copy_from_slice(&interfaces[..SEGMENTS - 1]);
        // The row of the interface itself; its segment ends there.
        let mut below = Row(*interfaces);
        let mut links = multipliers.block(0);
        for at in (0..blocks).rev() {
            let (y, inverse, multiplier) = (&y[at], inverse.block(at), multipliers.block(at));
            let fill = (at < reach).then(|| fill.block(at));
            for group in 0..SEGMENTS / I::GROUP {
                let first = group * I::GROUP;
                let mut rows = [isa.splat_group(0.0); 8];
                for (k, (row, y)) in rows.iter_mut().zip(y).enumerate() {
                    *row = isa.mul_group(y.group(isa, first), inverse.row(isa, k, first));
                }
                if let Some(fill) = fill {
                    let left = left.group(isa, first);
                    for (k, row) in rows.iter_mut().enumerate() {
                        let f = fill.row(isa, k, first);
                        *row = isa.sub_group(*row, isa.mul_group(f, left));
                    }
                }
                let mut last = below.group(isa, first);
                if at + 1 < blocks {
                    let l = links.row(isa, 0, first);
                    last = isa.sub_group(rows[7], isa.mul_group(l, last));
                }
                rows[7] = last;
                for k in (0..7).rev() {
                    let l = multiplier.row(isa, k + 1, first);
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
            links = multiplier;
        }
    }
}

/// One coefficient of each row of a tile: all segments' own, or the one that they have in common.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Lines {
    of_segments: Vec<Block>,
    common: Vec<[f64; HEIGHT]>,
}

impl Lines {
    pub(super) fn new(of_segments: Vec<Block>) -> Self {
        Self {
            of_segments,
            common: Vec::new(),
        }
    }

    /// The common ones, if there are some.
    fn in_common(&self) -> Option<Vec<[f64; HEIGHT]>> {
        let alike = |row: &Row| row.0.iter().all(|value| *value == row.0[0]);
        let mut blocks = self.of_segments.iter();
        blocks
            .clone()
            .all(|block| block.iter().all(alike))
            .then(|| {
                blocks
                    .by_ref()
                    .map(|block| block.map(|row| row.0[0]))
                    .collect()
            })
    }

    /// Keeps what all segments have in common only, if all of these allow it.
    pub(super) fn compact(all: [&mut Self; 3]) {
        let common = all.each_ref().map(|lines| lines.in_common());
        if common.iter().any(Option::is_none) {
            return;
        }
        for (lines, common) in all.into_iter().zip(common) {
            lines.common = common.unwrap_or_default();
            lines.of_segments = Vec::new();
        }
    }

    pub(super) fn is_even(&self) -> bool {
        !self.common.is_empty()
    }

    pub(super) fn blocks(&self) -> usize {
        self.of_segments.len().max(self.common.len())
    }

    pub(super) fn block_mut(&mut self, block: usize) -> Option<&mut Block> {
        self.of_segments.get_mut(block)
    }

    pub(super) fn truncate(&mut self, blocks: usize) {
        self.of_segments.truncate(blocks);
        self.of_segments.shrink_to_fit();
    }

    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.of_segments[..]) + size_of_val(&self.common[..])
    }

    /// The first `blocks` blocks, which must be there.
    #[inline(always)]
    fn view<const EVEN: bool>(&self, blocks: usize) -> Option<View<'_, EVEN>> {
        Some(if EVEN {
            View {
                of_segments: &[],
                common: self.common.get(..blocks)?,
            }
        } else {
            View {
                of_segments: self.of_segments.get(..blocks)?,
                common: &[],
            }
        })
    }

    #[inline(always)]
    fn all<const EVEN: bool>(&self) -> View<'_, EVEN> {
        View {
            of_segments: &self.of_segments,
            common: &self.common,
        }
    }
}

/// [`Lines`] of which it is known what they are.
#[derive(Clone, Copy)]
struct View<'a, const EVEN: bool> {
    of_segments: &'a [Block],
    common: &'a [[f64; HEIGHT]],
}

impl<'a, const EVEN: bool> View<'a, EVEN> {
    #[inline(always)]
    fn block(self, at: usize) -> BlockView<'a, EVEN> {
        BlockView {
            of_segments: if EVEN {
                &EMPTY
            } else {
                self.of_segments.get(at).unwrap_or(&EMPTY)
            },
            common: if EVEN {
                self.common.get(at).unwrap_or(&NOTHING)
            } else {
                &NOTHING
            },
        }
    }
}

/// Eight rows of it.
#[derive(Clone, Copy)]
struct BlockView<'a, const EVEN: bool> {
    of_segments: &'a Block,
    common: &'a [f64; HEIGHT],
}

impl<const EVEN: bool> BlockView<'_, EVEN> {
    #[inline(always)]
    fn row<I: Isa>(self, isa: I, k: usize, first: usize) -> I::G {
        if EVEN {
            isa.splat_group(self.common[k])
        } else {
            self.of_segments[k].group(isa, first)
        }
    }
}

impl Coefficients {
    fn is_even(&self) -> bool {
        self.multiplier.is_even()
    }

    /// The fill, and of how many blocks.
    #[inline(always)]
    fn fill<const EVEN: bool>(&self) -> (View<'_, EVEN>, usize) {
        (self.fill.all(), self.fill.blocks())
    }
}

static EMPTY: Block = [Row::ZERO; HEIGHT];

/// Rows that do not exist.
static NOTHING: [f64; 8] = [0.0; 8];

/// One number per segment, on two cache lines.
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
