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
//! per lane. The interfaces are left with a tridiagonal system of their own.
//!
//! The fill decays geometrically as far as the matrix is diagonally dominant. Rows where it has fallen below 2⁻⁶⁴ of
//! its row and of its interface are left out, which no sum in doubles can see. Where that happens within a segment, the
//! interfaces do not see each other either, and a tile is solved as soon as the next one has been swept down: its
//! rows are still in the nearest caches. Otherwise all of the fill is kept, all tiles are swept down, the interfaces are
//! solved, and all tiles are swept up.
//!
//! The invariant: S, and with it every rounding, depends on the matrix only; lanes change nothing. Tiles with the same
//! coefficients (all inner ones of a uniform chain) are stored once.

mod sweep;

use std::ops::Range;

use super::lanes::Lanes;
use super::{NotPositiveDefinite, SymMatrix, check_pivot};
use sweep::{Down, Received, Row, Up};

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
    multiplier: Vec<Block>,
    /// 1/pᵢ; 1 in rows beyond the matrix.
    inverse: Vec<Block>,
    /// fᵢ of the first blocks of rows, as far as it counts.
    fill: Vec<Block>,
}

/// LDLᵀ by segments.
#[derive(Debug)]
pub(super) struct Partitioned {
    n: usize,
    /// S: rows of a segment and its interface.
    length: usize,
    coefficients: Vec<Coefficients>,
    /// Which coefficients each tile has.
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

/// LDLᵀ of what is left for the interfaces.
#[derive(Debug)]
struct Interfaces {
    /// Between an interface and the one before; empty if they do not see each other.
    multiplier: Vec<f64>,
    /// Reciprocal pivots, tile by tile.
    inverse: Vec<[f64; SEGMENTS]>,
}

/// What elimination inside the segments leaves.
struct Eliminated {
    /// Diagonal of the interfaces.
    diagonal: Vec<f64>,
    /// Between each interface and the one before.
    beside: Vec<f64>,
    /// Rows of a segment in which the fill counts.
    reach: usize,
    /// True if no interface sees another.
    apart: bool,
}

/// One row of the factor: segment, row in it, multiplier, pivot, fill.
type Put<'a> = &'a mut dyn FnMut(usize, usize, f64, f64, f64);

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
    pub(super) fn set_lanes(&mut self, lanes: Lanes) {
        self.lanes = lanes;
    }

    /// Bytes of the factor that a solve reads, each once.
    pub(super) fn bytes(&self) -> usize {
        let blocks: usize = self
            .coefficients
            .iter()
            .map(|c| c.multiplier.len() + c.inverse.len() + c.fill.len())
            .sum();
        blocks * size_of::<Block>() + size_of_val(&self.interfaces.inverse[..])
    }

    /// x ← A⁻¹ x. Real-time: yes.
    pub(super) fn solve_in_place(&mut self, x: &mut [f64]) {
        self.solve(&mut InPlace(x), |_, _| {});
    }

    /// x ← A⁻¹ b; `done` is called for each run of rows as soon as it stands. Real-time: yes.
    pub(super) fn solve_into(
        &mut self,
        rhs: &[f64],
        x: &mut [f64],
        done: impl FnMut(Range<usize>, &[f64]),
    ) {
        self.solve(&mut Apart(rhs, x), done);
    }

    fn solve(&mut self, vectors: &mut impl Vectors, mut done: impl FnMut(Range<usize>, &[f64])) {
        let tiles = self.of_tile.len();
        if self.interfaces.multiplier.is_empty() {
            for tile in 0..tiles {
                let received = self.down(tile, vectors);
                if let Some(before) = tile.checked_sub(1) {
                    self.take(before, received.for_the_one_before);
                    self.solve_interfaces_of(before);
                    self.up(before, vectors, &mut done);
                }
                self.keep(tile, received.interfaces);
            }
            if let Some(last) = tiles.checked_sub(1) {
                self.solve_interfaces_of(last);
                self.up(last, vectors, &mut done);
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
            self.up(tile, vectors, &mut done);
        }
    }

    /// The last interface of a tile also hears from the first segment of the next one.
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

    fn down(&mut self, tile: usize, vectors: &impl Vectors) -> Received {
        let rows = self.rows(tile);
        let buffers = self.swept.len().max(1);
        let coefficients = self
            .of_tile
            .get(tile)
            .and_then(|&which| self.coefficients.get(which as usize));
        let rhs = vectors.rhs(rows);
        let (Some(coefficients), Some(y)) = (coefficients, self.swept.get_mut(tile % buffers))
        else {
            return Received {
                interfaces: [0.0; SEGMENTS],
                for_the_one_before: 0.0,
            };
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
        self.lanes.run(Down {
            coefficients,
            rhs,
            y,
        })
    }

    fn up(
        &mut self,
        tile: usize,
        vectors: &mut impl Vectors,
        done: &mut impl FnMut(Range<usize>, &[f64]),
    ) {
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
        self.lanes.run(Up {
            coefficients,
            y,
            interfaces,
            before,
            out,
        });
        if !whole && let Some(front) = self.tail.get(..x.len()) {
            x.copy_from_slice(front);
        }
        done(rows, x);
    }
}

/// Where right-hand side and solution stand.
trait Vectors {
    fn rhs(&self, rows: Range<usize>) -> &[f64];
    fn solution(&mut self, rows: Range<usize>) -> &mut [f64];
}

/// Both in one vector: a tile is written after the one behind it has been read.
struct InPlace<'a>(&'a mut [f64]);

impl Vectors for InPlace<'_> {
    fn rhs(&self, rows: Range<usize>) -> &[f64] {
        self.0.get(rows).unwrap_or_default()
    }

    fn solution(&mut self, rows: Range<usize>) -> &mut [f64] {
        self.0.get_mut(rows).unwrap_or_default()
    }
}

struct Apart<'a>(&'a [f64], &'a mut [f64]);

impl Vectors for Apart<'_> {
    fn rhs(&self, rows: Range<usize>) -> &[f64] {
        self.0.get(rows).unwrap_or_default()
    }

    fn solution(&mut self, rows: Range<usize>) -> &mut [f64] {
        self.1.get_mut(rows).unwrap_or_default()
    }
}

/// Eliminates the rows inside all segments of `length` rows and hands each one to `put`.
fn eliminate(
    diagonal: &[f64],
    beside: &[f64],
    length: usize,
    put: Put<'_>,
) -> Result<Eliminated, NotPositiveDefinite> {
    let n = diagonal.len();
    let segments = n.div_ceil(length);
    let mut left = Eliminated {
        diagonal: vec![1.0; segments],
        beside: vec![0.0; segments],
        reach: 0,
        apart: true,
    };
    for segment in 0..segments {
        let first = segment * length;
        // Of the interface before: its diagonal, and what the rows of this segment take from it.
        let before = first.checked_sub(1).map_or(1.0, |row| diagonal[row].abs());
        let (mut pivot, mut fill, mut taken) = (1.0, 0.0, 0.0);
        for (place, &own) in diagonal[first..].iter().take(length).enumerate() {
            let row = first + place;
            let link = row.checked_sub(1).map_or(0.0, |above| beside[above]);
            let (multiplier, next, across) = if place == 0 {
                (0.0, own, link)
            } else {
                let multiplier = link / pivot;
                (
                    multiplier,
                    own - multiplier * link,
                    -multiplier * fill * pivot,
                )
            };
            pivot = next;
            if place == length - 1 {
                left.diagonal[segment] = pivot;
                left.beside[segment] = across;
                // Of the first segment nothing reaches further.
                put(segment, place, multiplier, 1.0, 0.0);
                continue;
            }
            check_pivot(row, pivot, own)?;
            fill = across / pivot;
            taken += fill * across;
            let counts =
                fill.abs() > NEGLIGIBLE || fill.abs() * pivot.sqrt() > NEGLIGIBLE * before.sqrt();
            if counts {
                left.reach = left.reach.max(place + 1);
            }
            put(segment, place, multiplier, pivot, fill);
        }
        if let Some(before) = segment.checked_sub(1) {
            left.diagonal[before] -= taken;
        }
    }
    left.apart = left.interfaces_are_apart(n, length);
    Ok(left)
}

impl Eliminated {
    /// True if what is left between interfaces is below all that a double can tell.
    fn interfaces_are_apart(&self, n: usize, length: usize) -> bool {
        // Only segments that end with an interface, but the first, lie between two.
        (1..n / length).all(|k| {
            let scale = (self.diagonal[k] * self.diagonal[k - 1]).abs().sqrt();
            self.beside[k].abs() <= NEGLIGIBLE * scale
        })
    }
}

impl Interfaces {
    fn factor(
        left: &Eliminated,
        tiles: usize,
        length: usize,
        diagonal: &[f64],
    ) -> Result<Self, NotPositiveDefinite> {
        let mut inverse = vec![[1.0; SEGMENTS]; tiles];
        let mut multiplier = Vec::new();
        let (mut pivot, mut carried) = (1.0, 0.0);
        let rows = inverse.as_flattened_mut().iter_mut();
        for (k, inverse) in rows.enumerate() {
            let row = (k + 1) * length - 1;
            // Rows beyond the matrix.
            let Some(&own) = diagonal.get(row) else {
                if !left.apart {
                    multiplier.push(0.0);
                }
                continue;
            };
            if !left.apart {
                let beside = if k == 0 { 0.0 } else { left.beside[k] };
                let link = beside / pivot;
                carried = link * beside;
                multiplier.push(link);
            }
            pivot = left.diagonal[k] - carried;
            check_pivot(row, pivot, own)?;
            *inverse = 1.0 / pivot;
        }
        Ok(Self {
            multiplier,
            inverse,
        })
    }

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

/// Lays the rows out tile by tile; a tile like the one before is not stored again.
struct Writer {
    length: usize,
    open: Coefficients,
    tile: usize,
    stored: Vec<Coefficients>,
    of_tile: Vec<u32>,
}

impl Writer {
    fn new(length: usize) -> Self {
        Self {
            length,
            open: Self::empty(length),
            tile: 0,
            stored: Vec::new(),
            of_tile: Vec::new(),
        }
    }

    fn empty(length: usize) -> Coefficients {
        let blocks = |value| vec![[Row([value; SEGMENTS]); HEIGHT]; length / HEIGHT];
        Coefficients {
            multiplier: blocks(0.0),
            inverse: blocks(1.0),
            fill: blocks(0.0),
        }
    }

    fn put(&mut self, segment: usize, row: usize, multiplier: f64, pivot: f64, fill: f64) {
        while self.tile < segment / SEGMENTS {
            self.close();
        }
        let (lane, block, line) = (segment % SEGMENTS, row / HEIGHT, row % HEIGHT);
        self.open.multiplier[block][line].0[lane] = multiplier;
        self.open.inverse[block][line].0[lane] = 1.0 / pivot;
        self.open.fill[block][line].0[lane] = fill;
    }

    fn close(&mut self) {
        let done = std::mem::replace(&mut self.open, Self::empty(self.length));
        if self.stored.last() != Some(&done) {
            self.stored.push(done);
        }
        self.of_tile.push(self.stored.len() as u32 - 1);
        self.tile += 1;
    }

    /// All of `segments` segments, the fill cut after `reach` rows.
    fn finish(mut self, segments: usize, reach: usize) -> (Vec<Coefficients>, Vec<u32>) {
        while self.of_tile.len() < segments.div_ceil(SEGMENTS) {
            self.close();
        }
        for coefficients in &mut self.stored {
            coefficients.fill.truncate(reach.div_ceil(HEIGHT));
            coefficients.fill.shrink_to_fit();
        }
        (self.stored, self.of_tile)
    }
}

#[cfg(test)]
mod tests;
