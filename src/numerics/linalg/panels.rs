//! Triangular sweeps over a sparse factor whose columns are gathered into panels.
//!
//! Neighbouring columns of a factor often have the same rows below them. Such columns make a **panel**: a small dense
//! triangle and, below it, dense **slabs** of eight rows by all columns, with one list of row numbers. A sweep then reads
//! plain memory from front to back, meets each row number once per panel, and sums over the columns in registers. Columns
//! whose rows differ are joined as well, with zeros in the empty places, where that is cheaper than another panel.
//!
//! The invariant: the order of operations follows from the factor alone; sums over rows go into eight parts that are
//! added in one order, so the lanes of the processor do not change a bit.

use super::Lanes;
use super::lanes::{Isa, Kernel};

/// The unit lower L of an LDLᵀ, by columns: rows ascending, the diagonal left out.
pub(super) struct Columns<'a> {
    pub(super) start: &'a [usize],
    pub(super) rows: &'a [u32],
    pub(super) values: &'a [f64],
}

/// Eight rows of one column, on one cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Line([f64; 8]);

/// One panel.
#[derive(Debug, Clone, Copy)]
struct Panel {
    /// First column.
    first: u32,
    /// Columns.
    width: u32,
    /// Slabs; the list of row numbers is eight times as long, its end filled up with the last row.
    slabs: u32,
    /// Begin of its row numbers, in eights.
    rows: usize,
    /// Begin of its triangle, by columns.
    triangle: usize,
    /// Begin of its first slab, in lines.
    lines: usize,
}

/// L in panels.
#[derive(Debug)]
pub(super) struct Panels {
    panels: Vec<Panel>,
    rows: Vec<[u32; 8]>,
    triangles: Vec<f64>,
    lines: Vec<Line>,
    lanes: Lanes,
}

/// Widest panel: beyond it the triangle, which is met number by number, would cost more than it saves.
const WIDEST: usize = 32;

/// Lines that are met in the time that a panel takes for itself.
const PANEL_COST: usize = 8;

/// Columns `first` … `first + width − 1` with all their rows below.
struct Joined {
    first: usize,
    width: usize,
    rows: Vec<u32>,
}

impl Joined {
    /// Time of a panel in lines; the numbers of its triangle count three times.
    fn cost(width: usize, height: usize) -> usize {
        PANEL_COST + width * height.div_ceil(8) + 3 * width * (width - 1) / 16
    }

    /// This panel and the one right behind it as one, if that is worth its zeros.
    fn with(&self, next: &Joined) -> Option<Joined> {
        // Elimination theory: rows below this panel are among the columns or below the columns of its parent.
        let parent = *self.rows.first()? as usize;
        let (width, height) = (self.width + next.width, next.rows.len());
        if parent >= next.first + next.width || width > WIDEST {
            return None;
        }
        let apart = Self::cost(self.width, self.rows.len()) + Self::cost(next.width, height);
        (Self::cost(width, height) <= apart).then(|| Joined {
            first: self.first,
            width,
            rows: next.rows.clone(),
        })
    }
}

impl Panels {
    /// Gathers the columns of a factor.
    pub(super) fn new(columns: &Columns<'_>) -> Self {
        let n = columns.start.len().saturating_sub(1);
        let below = |column: usize| &columns.rows[columns.start[column]..columns.start[column + 1]];
        let mut joined: Vec<Joined> = Vec::new();
        for column in 0..n {
            let mut own = Joined {
                first: column,
                width: 1,
                rows: below(column).to_vec(),
            };
            while let Some(one) = joined.last().and_then(|before| before.with(&own)) {
                own = one;
                joined.pop();
            }
            joined.push(own);
        }
        let mut all = Self {
            panels: Vec::with_capacity(joined.len()),
            rows: Vec::new(),
            triangles: Vec::new(),
            lines: Vec::new(),
            lanes: Lanes::best(),
        };
        for panel in &joined {
            all.push(panel, columns);
        }
        all
    }

    fn push(&mut self, joined: &Joined, columns: &Columns<'_>) {
        let Joined { first, width, rows } = joined;
        let (triangle, lines) = (self.triangles.len(), self.lines.len());
        let slabs = rows.len().div_ceil(8);
        self.panels.push(Panel {
            first: *first as u32,
            width: *width as u32,
            slabs: slabs as u32,
            rows: self.rows.len(),
            triangle,
            lines,
        });
        for some in rows.chunks(8) {
            let last = some.last().copied().unwrap_or(0);
            let mut eight = [last; 8];
            eight[..some.len()].copy_from_slice(some);
            self.rows.push(eight);
        }
        self.triangles
            .resize(triangle + width * (width - 1) / 2, 0.0);
        self.lines.resize(lines + slabs * width, Line([0.0; 8]));
        // Where the triangle's column begins: its first row is the one after its own.
        let mut begin = triangle;
        for k in 0..*width {
            let column = first + k;
            let range = columns.start[column]..columns.start[column + 1];
            let entries = columns.rows[range.clone()]
                .iter()
                .zip(&columns.values[range]);
            let mut at = 0;
            for (&row, &value) in entries {
                let inside = (row as usize).wrapping_sub(column + 1);
                if inside < width - k - 1 {
                    self.triangles[begin + inside] = value;
                    continue;
                }
                // Both lists ascend.
                while rows.get(at).is_some_and(|&other| other < row) {
                    at += 1;
                }
                self.lines[lines + (at / 8) * width + k].0[at % 8] = value;
            }
            begin += width - k - 1;
        }
    }

    #[cfg(any(test, feature = "test-doubles"))]
    pub(super) fn set_lanes(&mut self, lanes: Lanes) {
        self.lanes = lanes;
    }

    /// Bytes that one sweep reads.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.panels[..])
            + size_of_val(&self.rows[..])
            + size_of_val(&self.triangles[..])
            + size_of_val(&self.lines[..])
    }

    /// x ← L⁻ᵀ D⁻¹ L⁻¹ x with the reciprocals of D. Real-time: yes. Row numbers lie below the length by construction.
    pub(super) fn solve_in_place(&self, inverse_pivots: &[f64], x: &mut [f64]) {
        self.lanes.run(Sweeps {
            factor: self,
            inverse_pivots,
            x,
        });
    }
}

struct Sweeps<'a> {
    factor: &'a Panels,
    inverse_pivots: &'a [f64],
    x: &'a mut [f64],
}

impl Kernel for Sweeps<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Sweeps {
            factor,
            inverse_pivots,
            x,
        } = self;
        for panel in &factor.panels {
            let parts = Parts::of(panel, factor);
            let (before, after) = x.split_at_mut(parts.end);
            let own = &mut before[parts.first..];
            solve_triangle(parts.triangle, own);
            let slabs = parts.lines.chunks_exact(own.len().max(1));
            for (slab, rows) in slabs.zip(parts.rows) {
                let sum = times(isa, slab, own);
                for (&row, sum) in rows.iter().zip(sum) {
                    after[row as usize - parts.end] -= sum;
                }
            }
        }
        for (x, inverse) in x.iter_mut().zip(inverse_pivots) {
            *x *= inverse;
        }
        let mut room = [[0.0; 8]; WIDEST];
        for panel in factor.panels.iter().rev() {
            let parts = Parts::of(panel, factor);
            let (before, after) = x.split_at_mut(parts.end);
            let own = &mut before[parts.first..];
            let sums = &mut room[..own.len().min(WIDEST)];
            sums.fill([0.0; 8]);
            let slabs = parts.lines.chunks_exact(own.len().max(1));
            for (slab, rows) in slabs.zip(parts.rows) {
                let mut below = [0.0; 8];
                for (below, &row) in below.iter_mut().zip(rows) {
                    *below = after[row as usize - parts.end];
                }
                let below = isa.load(&below);
                for (sum, line) in sums.iter_mut().zip(slab) {
                    let product = isa.mul(isa.load(&line.0), below);
                    isa.store(isa.add(isa.load(sum), product), sum);
                }
            }
            for (x, s) in own.iter_mut().zip(&*sums) {
                *x -= ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
            }
            solve_transposed_triangle(parts.triangle, own);
        }
    }
}

/// What belongs to one panel.
struct Parts<'a> {
    first: usize,
    end: usize,
    triangle: &'a [f64],
    /// Slab after slab, one line per column.
    lines: &'a [Line],
    rows: &'a [[u32; 8]],
}

impl<'a> Parts<'a> {
    #[inline(always)]
    fn of(panel: &Panel, factor: &'a Panels) -> Self {
        let (first, width) = (panel.first as usize, panel.width as usize);
        let slabs = panel.slabs as usize;
        Self {
            first,
            end: first + width,
            triangle: &factor.triangles[panel.triangle..panel.triangle + width * (width - 1) / 2],
            lines: &factor.lines[panel.lines..panel.lines + width * slabs],
            rows: &factor.rows[panel.rows..panel.rows + slabs],
        }
    }
}

/// The product of a slab and the numbers of its columns: four sums in turn, then one.
#[inline(always)]
fn times<I: Isa>(isa: I, slab: &[Line], x: &[f64]) -> [f64; 8] {
    let mut sums = [isa.splat(0.0); 4];
    let (fours, rest) = x.as_chunks::<4>();
    let (wide, narrow) = slab.split_at(4 * fours.len());
    let (lines, _) = wide.as_chunks::<4>();
    for (lines, x) in lines.iter().zip(fours) {
        for k in 0..4 {
            let product = isa.mul(isa.load(&lines[k].0), isa.splat(x[k]));
            sums[k] = isa.add(sums[k], product);
        }
    }
    for (k, (line, x)) in narrow.iter().zip(rest).enumerate() {
        sums[k] = isa.add(sums[k], isa.mul(isa.load(&line.0), isa.splat(*x)));
    }
    let total = isa.add(isa.add(sums[0], sums[1]), isa.add(sums[2], sums[3]));
    let mut out = [0.0; 8];
    isa.store(total, &mut out);
    out
}

/// x ← T⁻¹ x for a unit lower triangle by columns.
#[inline(always)]
fn solve_triangle(mut triangle: &[f64], mut x: &mut [f64]) {
    while let Some((first, rest)) = x.split_first_mut() {
        let Some((column, others)) = triangle.split_at_checked(rest.len()) else {
            return;
        };
        for (x, l) in rest.iter_mut().zip(column) {
            *x -= l * *first;
        }
        (triangle, x) = (others, rest);
    }
}

/// x ← T⁻ᵀ x.
#[inline(always)]
fn solve_transposed_triangle(triangle: &[f64], x: &mut [f64]) {
    let mut end = triangle.len();
    for k in (0..x.len()).rev() {
        let (own, below) = x.split_at_mut(k + 1);
        let begin = end - below.len();
        let mut sum = 0.0;
        for (x, l) in below.iter().zip(&triangle[begin..end]) {
            sum += l * x;
        }
        own[k] -= sum;
        end = begin;
    }
}
