//! Elimination: the rows inside all segments, what is left for the interfaces, and how the factor is laid out.

use super::super::{NotPositiveDefinite, check_pivot};
use super::sweep::{Lines, Row};
use super::{Coefficients, HEIGHT, Interfaces, NEGLIGIBLE, SEGMENTS};

/// What elimination inside the segments leaves.
pub(super) struct Eliminated {
    /// Diagonal of the interfaces.
    diagonal: Vec<f64>,
    /// Between each interface and the one before.
    beside: Vec<f64>,
    /// Rows of a segment in which the fill counts.
    pub reach: usize,
    /// True if no interface sees another.
    pub apart: bool,
}

/// One row of the factor: segment, row in it, multiplier, pivot, fill.
pub(super) type Put<'a> = &'a mut dyn FnMut(usize, usize, f64, f64, f64);

/// Eliminates the rows inside all segments of `length` rows and hands each one to `put`.
pub(super) fn eliminate(
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
        // The interface before: its diagonal, and the sum that the rows of this segment subtract from it.
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
                // The first segment has no interface before it.
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
    /// True if the coupling between interfaces is below the resolution of a double.
    fn interfaces_are_apart(&self, n: usize, length: usize) -> bool {
        // Only segments that end with an interface, but the first, lie between two.
        (1..n / length).all(|k| {
            let scale = (self.diagonal[k] * self.diagonal[k - 1]).abs().sqrt();
            self.beside[k].abs() <= NEGLIGIBLE * scale
        })
    }
}

impl Interfaces {
    pub(super) fn factor(
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
}

/// Lays the rows out tile by tile; a tile like the one before is not stored again.
pub(super) struct Writer {
    length: usize,
    open: Coefficients,
    tile: usize,
    stored: Vec<Coefficients>,
    of_tile: Vec<u32>,
}

impl Writer {
    pub(crate) fn new(length: usize) -> Self {
        Self {
            length,
            open: Self::empty(length),
            tile: 0,
            stored: Vec::new(),
            of_tile: Vec::new(),
        }
    }

    fn empty(length: usize) -> Coefficients {
        let blocks = |value| Lines::new(vec![[Row([value; SEGMENTS]); HEIGHT]; length / HEIGHT]);
        Coefficients {
            multiplier: blocks(0.0),
            inverse: blocks(1.0),
            fill: blocks(0.0),
        }
    }

    pub(crate) fn put(
        &mut self,
        segment: usize,
        row: usize,
        multiplier: f64,
        pivot: f64,
        fill: f64,
    ) {
        while self.tile < segment / SEGMENTS {
            self.close();
        }
        let (lane, block, line) = (segment % SEGMENTS, row / HEIGHT, row % HEIGHT);
        let open = &mut self.open;
        let values = [multiplier, 1.0 / pivot, fill];
        let lines = [&mut open.multiplier, &mut open.inverse, &mut open.fill];
        for (lines, value) in lines.into_iter().zip(values) {
            if let Some(block) = lines.block_mut(block) {
                block[line].0[lane] = value;
            }
        }
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
    pub(crate) fn finish(mut self, segments: usize, reach: usize) -> (Vec<Coefficients>, Vec<u32>) {
        while self.of_tile.len() < segments.div_ceil(SEGMENTS) {
            self.close();
        }
        for coefficients in &mut self.stored {
            let Coefficients {
                multiplier,
                inverse,
                fill,
            } = coefficients;
            fill.truncate(reach.div_ceil(HEIGHT));
            Lines::compact([multiplier, inverse, fill]);
        }
        (self.stored, self.of_tile)
    }
}
