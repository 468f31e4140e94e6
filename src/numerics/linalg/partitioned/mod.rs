//! Factor of a tridiagonal matrix in many short segments that do not wait for each other.
//!
//! A recurrence costs its latency. Every S-th row is an **interface**; the rows between two interfaces are a
//! **segment**. Eliminating all rows inside the segments first, each segment from its first row to its last, and the
//! interfaces afterwards, is a Cholesky factorisation in another order (nested dissection of a chain), as stable as any
//! other. Inside a segment
//!
//! ```text
//! lᵢ = eᵢ₋₁/pᵢ₋₁,  pᵢ = dᵢ − lᵢ eᵢ₋₁,   f₀ = e₋₁/p₀,  fᵢ = −lᵢ fᵢ₋₁ pᵢ₋₁/pᵢ
//! ```
//!
//! where f is the fill between row i and the interface before the segment. Sixteen segments make a **tile**, one segment
//! per lane. A separate tridiagonal system remains for the interfaces.
//!
//! The fill decays geometrically as far as the matrix is diagonally dominant. Rows where it has fallen below 2⁻⁶⁴ of
//! its row and of its interface are left out, which no sum in doubles can see. Where that happens within a segment, the
//! interfaces do not see each other either, and a tile is solved as soon as the next one has been swept down: its
//! rows are still in the nearest caches. Otherwise all of the fill is kept, all tiles are swept down, the interfaces are
//! solved, and all tiles are swept up.
//!
//! The invariant: S, and with it every rounding, depends on the matrix only; lanes change nothing. Tiles with the same
//! coefficients (all inner ones of a uniform chain) are stored once.

mod factor;
mod sweep;

use std::ops::Range;

use super::lanes::Lanes;
use super::{NotPositiveDefinite, Rows, SymMatrix};
use factor::{Writer, eliminate};
use sweep::{Down, Lines, Received, Row, Up};

/// Segments of a tile.
const SEGMENTS: usize = 16;

/// Rows of a block.
const HEIGHT: usize = 8;

/// Eight rows of all segments of a tile.
type Block = [Row; HEIGHT];

/// Lengths that a segment of a long chain may have: odd multiples of eight, so that the segments of a tile do not fall
/// onto the same lines of a cache. The shortest one within which the fill dies out is taken; a tile then is 5 to 62 kB
/// for each vector.
const LENGTHS: [usize; 4] = [40, 104, 232, 488];

/// What falls below this, relative to row and interface, is left out.
const NEGLIGIBLE: f64 = 1.0 / (1u128 << 64) as f64;

/// Coefficients of the rows of a tile.
#[derive(Debug, Clone, PartialEq)]
struct Coefficients {
    /// lᵢ, the row of the interface included; 0 in the first row of each segment.
    multiplier: Lines,
    /// 1/pᵢ; 1 in rows beyond the matrix.
    inverse: Lines,
    /// fᵢ of the first blocks of rows, as far as it counts.
    fill: Lines,
}

/// LDLᵀ by segments.
#[derive(Debug)]
pub(super) struct Partitioned {
    n: usize,
    /// S: rows of a segment and its interface.
    length: usize,
    coefficients: Vec<Coefficients>,
    /// Index of each tile's coefficients.
    of_tile: Vec<u32>,
    interfaces: Interfaces,
    /// y of each tile where the interfaces see each other, else of two tiles in turn.
    swept: Vec<Vec<Block>>,
    /// Right-hand side, then solution at the interfaces, tile by tile.
    at_interfaces: Vec<[f64; SEGMENTS]>,
    /// The last tile of a vector, filled up with zeros.
    tail: Vec<f64>,
    lanes: Lanes,
}

/// LDLᵀ of the remaining system of the interfaces.
#[derive(Debug)]
struct Interfaces {
    /// Between an interface and the one before; empty if they do not see each other.
    multiplier: Vec<f64>,
    /// Reciprocal pivots, tile by tile.
    inverse: Vec<[f64; SEGMENTS]>,
}

impl Partitioned {
    pub(super) fn factor(matrix: &SymMatrix) -> Result<Self, NotPositiveDefinite> {
        let n = matrix.n();
        let (diagonal, beside) = matrix.chain();
        // A chain that fits into one tile of the shortest length is cut in proportion.
        let longest = n.div_ceil(SEGMENTS).div_ceil(HEIGHT) | 1;
        let lengths = LENGTHS.map(|length| length.min(HEIGHT * longest));
        let mut length = lengths[0];
        for candidate in lengths {
            length = candidate;
            if eliminate(&diagonal, &beside, candidate, &mut |_, _, _, _, _| {})?.apart {
                break;
            }
        }
        let mut writer = Writer::new(length);
        let left = eliminate(
            &diagonal,
            &beside,
            length,
            &mut |segment, row, multiplier, pivot, fill| {
                writer.put(segment, row, multiplier, pivot, fill);
            },
        )?;
        let (coefficients, of_tile) = writer.finish(n.div_ceil(length), left.reach);
        let tiles = of_tile.len();
        let interfaces = Interfaces::factor(&left, tiles, length, &diagonal)?;
        let buffers = if left.apart { tiles.min(2) } else { tiles };
        let zero = [Row([0.0; SEGMENTS]); HEIGHT];
        Ok(Self {
            n,
            length,
            coefficients,
            of_tile,
            interfaces,
            swept: vec![vec![zero; length / HEIGHT]; buffers],
            at_interfaces: vec![[0.0; SEGMENTS]; tiles],
            tail: vec![0.0; SEGMENTS * length],
            lanes: Lanes::best(),
        })
    }

    /// Instructions to use from now on; the bits stay the same.
    #[cfg(any(test, feature = "test-doubles"))]
    pub(super) fn set_lanes(&mut self, lanes: Lanes) {
        self.lanes = lanes;
    }

    /// Bytes of the factor that a solve reads, each once.
    pub(super) fn bytes(&self) -> usize {
        let of_tile = |c: &Coefficients| [&c.multiplier, &c.inverse, &c.fill].map(Lines::bytes);
        let all = self.coefficients.iter().flat_map(of_tile);
        all.sum::<usize>() + size_of_val(&self.interfaces.inverse[..])
    }

    /// Rows that are solved at a time.
    pub(super) fn rows_at_a_time(&self) -> usize {
        SEGMENTS * self.length
    }

    /// x ← A⁻¹ x. Real-time: yes.
    pub(super) fn solve_in_place(&mut self, x: &mut [f64]) {
        self.solve(&mut InPlace(x));
    }

    /// x ← A⁻¹ b, both wherever `vectors` has them: each right-hand side is requested once, tile by tile, and each
    /// solution is handed over once it is complete, one tile later or after all requests. Real-time: yes.
    pub(super) fn solve(&mut self, vectors: &mut impl Rows) {
        let tiles = self.of_tile.len();
        if self.interfaces.multiplier.is_empty() {
            for tile in 0..tiles {
                let received = self.down(tile, vectors);
                if let Some(before) = tile.checked_sub(1) {
                    self.take(before, received.for_the_one_before);
                    self.solve_interfaces_of(before);
                    self.up(before, vectors);
                }
                self.keep(tile, received.interfaces);
            }
            if let Some(last) = tiles.checked_sub(1) {
                self.solve_interfaces_of(last);
                self.up(last, vectors);
            }
            return;
        }
        for tile in 0..tiles {
            let received = self.down(tile, vectors);
            if let Some(before) = tile.checked_sub(1) {
                self.take(before, received.for_the_one_before);
            }
            self.keep(tile, received.interfaces);
        }
        self.interfaces
            .solve_in_place(self.at_interfaces.as_flattened_mut());
        for tile in 0..tiles {
            self.up(tile, vectors);
        }
    }

    /// The last interface of a tile also receives a part from the first segment of the next one.
    fn take(&mut self, tile: usize, amount: f64) {
        if let Some(interfaces) = self.at_interfaces.get_mut(tile) {
            interfaces[SEGMENTS - 1] -= amount;
        }
    }

    fn keep(&mut self, tile: usize, received: [f64; SEGMENTS]) {
        if let Some(interfaces) = self.at_interfaces.get_mut(tile) {
            *interfaces = received;
        }
    }

    fn solve_interfaces_of(&mut self, tile: usize) {
        let inverse = self.interfaces.inverse.get(tile);
        if let (Some(values), Some(inverse)) = (self.at_interfaces.get_mut(tile), inverse) {
            for (value, inverse) in values.iter_mut().zip(inverse) {
                *value *= inverse;
            }
        }
    }

    /// Rows of a tile.
    fn rows(&self, tile: usize) -> Range<usize> {
        let rows = SEGMENTS * self.length;
        tile * rows..((tile + 1) * rows).min(self.n)
    }

    fn down(&mut self, tile: usize, vectors: &mut impl Rows) -> Received {
        let rows = self.rows(tile);
        let buffers = self.swept.len().max(1);
        let coefficients = self
            .of_tile
            .get(tile)
            .and_then(|&which| self.coefficients.get(which as usize));
        let rhs = vectors.rhs(rows);
        let (Some(coefficients), Some(y)) = (coefficients, self.swept.get_mut(tile % buffers))
        else {
            return Received::default();
        };
        let rhs = if rhs.len() == self.tail.len() {
            rhs
        } else {
            let some = rhs.len().min(self.tail.len());
            let (front, rest) = self.tail.split_at_mut(some);
            front.copy_from_slice(rhs);
            rest.fill(0.0);
            &self.tail
        };
        Down {
            coefficients,
            rhs,
            y,
        }
        .run(self.lanes)
    }

    fn up(&mut self, tile: usize, vectors: &mut impl Rows) {
        let rows = self.rows(tile);
        let before = tile
            .checked_sub(1)
            .and_then(|before| self.at_interfaces.get(before))
            .map_or(0.0, |interfaces| interfaces[SEGMENTS - 1]);
        let coefficients = self
            .of_tile
            .get(tile)
            .and_then(|&which| self.coefficients.get(which as usize));
        let (Some(coefficients), Some(interfaces), Some(y)) = (
            coefficients,
            self.at_interfaces.get(tile),
            self.swept.get(tile % self.swept.len().max(1)),
        ) else {
            return;
        };
        let x = vectors.solution(rows.clone());
        let whole = x.len() == self.tail.len();
        let out = if whole { &mut *x } else { &mut self.tail[..] };
        Up {
            coefficients,
            y,
            interfaces,
            before,
            out,
        }
        .run(self.lanes);
        if !whole && let Some(front) = self.tail.get(..x.len()) {
            x.copy_from_slice(front);
        }
        vectors.solved(rows);
    }
}

/// Both in one vector: a tile is written after the one behind it has been read.
struct InPlace<'a>(&'a mut [f64]);

impl Rows for InPlace<'_> {
    fn rhs(&mut self, rows: Range<usize>) -> &[f64] {
        self.0.get(rows).unwrap_or_default()
    }

    fn solution(&mut self, rows: Range<usize>) -> &mut [f64] {
        self.0.get_mut(rows).unwrap_or_default()
    }

    fn start(&mut self, _n: usize) {}
}

impl Interfaces {
    /// One value per interface. Real-time: yes.
    fn solve_in_place(&self, values: &mut [f64]) {
        let mut above = 0.0;
        for (value, l) in values.iter_mut().zip(&self.multiplier) {
            *value -= l * above;
            above = *value;
        }
        let (mut below, mut link) = (0.0, 0.0);
        let inverse = self.inverse.as_flattened();
        let rows = values.iter_mut().zip(inverse).zip(&self.multiplier);
        for ((value, inverse), l) in rows.rev() {
            *value = *value * inverse - link * below;
            (below, link) = (*value, *l);
        }
    }
}

#[cfg(test)]
mod tests;
