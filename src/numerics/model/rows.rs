//! Loops over rows: what equal elements and an even chain do to a residual, eight rows at a time.

use std::ops::Range;

use super::point::{OfForce, PointForce};
use super::{Base, Motion};
use crate::linalg::lanes::{Isa, Kernel};

/// Elements from one place that is no degree of freedom, one at each row. All slices are equally long.
pub(super) struct Anchored<'a> {
    pub disp: &'a [f64],
    pub vel: &'a [f64],
    pub residual: &'a mut [f64],
    pub base: Base,
}

impl OfForce for Anchored<'_> {
    #[inline(always)]
    fn with<I: Isa, F: PointForce>(self, isa: I, force: F) {
        let base = (isa.splat(self.base.disp), isa.splat(self.base.vel));
        let (x, x_rest) = self.disp.as_chunks::<8>();
        let (v, v_rest) = self.vel.as_chunks::<8>();
        let (r, r_rest) = self.residual.as_chunks_mut::<8>();
        for ((r, x), v) in r.iter_mut().zip(x).zip(v) {
            anchored(isa, force, base, (x, v), r);
        }
        if !r_rest.is_empty() {
            let mut last: [f64; 8] = filled(r_rest);
            let (x, v) = (filled(x_rest), filled(v_rest));
            anchored(isa, force, base, (&x, &v), &mut last);
            copy(&last, r_rest);
        }
    }
}

#[inline(always)]
fn anchored<I: Isa, F: PointForce>(
    isa: I,
    force: F,
    base: (I::V, I::V),
    (x, v): (&[f64; 8], &[f64; 8]),
    r: &mut [f64; 8],
) {
    let (x, v) = (isa.load(x), isa.load(v));
    let force = force.force(isa, isa.sub(x, base.0), isa.sub(v, base.1));
    isa.store(isa.sub(isa.load(r), force), r);
}

/// Elements per turn of a run between degrees of freedom.
const TURN: usize = 64;

/// The widest span whose elements are evaluated once for both of their ends.
const NARROW: usize = 8;

/// Elements from degrees of freedom `from`, `from` + 1, … to `to`, `to` + 1, …, `to` > `from`; these rows of them. The
/// vectors are whole.
pub(super) struct Between<'a> {
    pub rows: Range<usize>,
    pub disp: &'a [f64],
    pub vel: &'a [f64],
    pub residual: &'a mut [f64],
    pub from: usize,
    pub to: usize,
    pub len: usize,
}

impl Between<'_> {
    /// Forces of some elements. Real-time: yes.
    #[inline(always)]
    fn forces<I: Isa, F: PointForce>(
        &self,
        isa: I,
        force: F,
        elements: &Range<usize>,
        forces: &mut [f64; TURN + NARROW],
    ) {
        let near = self.from + elements.start..self.from + elements.end;
        let far = self.to + elements.start..self.to + elements.end;
        let (Some(x_near), Some(x_far), Some(v_near), Some(v_far)) = (
            self.disp.get(near.clone()),
            self.disp.get(far.clone()),
            self.vel.get(near),
            self.vel.get(far),
        ) else {
            return;
        };
        let ((a, a_rest), (b, b_rest)) = (x_near.as_chunks::<8>(), x_far.as_chunks::<8>());
        let ((c, c_rest), (d, d_rest)) = (v_near.as_chunks::<8>(), v_far.as_chunks::<8>());
        let mut blocks = forces.as_chunks_mut::<8>().0.iter_mut();
        for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
            if let Some(f) = blocks.next() {
                between(isa, force, (a, b), (c, d), f);
            }
        }
        if !a_rest.is_empty()
            && let Some(f) = blocks.next()
        {
            let (a, b) = (filled(a_rest), filled(b_rest));
            let (c, d) = (filled(c_rest), filled(d_rest));
            between(isa, force, (&a, &b), (&c, &d), f);
        }
    }

    /// The elements whose end `first` + i is one of these rows.
    fn at(&self, rows: &Range<usize>, first: usize) -> Range<usize> {
        let end = rows.end.saturating_sub(first).min(self.len);
        rows.start.saturating_sub(first).min(end)..end
    }
}

#[inline(always)]
fn between<I: Isa, F: PointForce>(
    isa: I,
    force: F,
    disp: (&[f64; 8], &[f64; 8]),
    vel: (&[f64; 8], &[f64; 8]),
    f: &mut [f64; 8],
) {
    let disp = isa.sub(isa.load(disp.1), isa.load(disp.0));
    let vel = isa.sub(isa.load(vel.1), isa.load(vel.0));
    isa.store(force.force(isa, disp, vel), f);
}

impl OfForce for Between<'_> {
    #[inline(always)]
    fn with<I: Isa, F: PointForce>(self, isa: I, force: F) {
        let this = self;
        let all = this.rows.clone();
        let narrow = this.to - this.from <= NARROW;
        let mut forces = [0.0; TURN + NARROW];
        let mut start = all.start;
        while start < all.end {
            let rows = start..(start + TURN).min(all.end);
            start = rows.end;
            // The element that ends in a row comes before the one that begins there.
            let (ends, begins) = (this.at(&rows, this.to), this.at(&rows, this.from));
            let both =
                if ends.is_empty() { &begins } else { &ends }.start..begins.end.max(ends.end);
            if narrow {
                this.forces(isa, force, &both, &mut forces);
            } else {
                this.forces(isa, force, &ends, &mut forces);
            }
            let first = if narrow { both.start } else { ends.start };
            let done = this.to + ends.start..this.to + ends.end;
            let of_ends = forces
                .get(ends.start.saturating_sub(first)..)
                .unwrap_or_default();
            if let Some(rows) = this.residual.get_mut(done) {
                for (r, f) in rows.iter_mut().zip(of_ends) {
                    *r -= f;
                }
            }
            let first = if narrow {
                both.start
            } else {
                this.forces(isa, force, &begins, &mut forces);
                begins.start
            };
            let done = this.from + begins.start..this.from + begins.end;
            let of_begins = forces
                .get(begins.start.saturating_sub(first)..)
                .unwrap_or_default();
            if let Some(rows) = this.residual.get_mut(done) {
                for (r, f) in rows.iter_mut().zip(of_begins) {
                    *r += f;
                }
            }
        }
    }
}

/// Inner rows of a chain whose K and C have the same entries in all of them, and a law at each row. The vectors are whole.
pub(super) struct EvenChain<'a> {
    /// Neither the first row nor the last one.
    pub rows: Range<usize>,
    /// Entries of K.
    pub stiffness: Entries,
    /// Entries of C.
    pub damping: Entries,
    pub disp: &'a [f64],
    pub vel: &'a [f64],
    pub residual: &'a mut [f64],
    /// The residual is to begin with zeros, whatever is there.
    pub fresh: bool,
}

impl<'a> EvenChain<'a> {
    /// `entries` of K and C.
    pub(super) fn new(
        rows: Range<usize>,
        entries: (Entries, Entries),
        motion: Motion<'a>,
        residual: &'a mut [f64],
        fresh: bool,
    ) -> Self {
        Self {
            rows,
            stiffness: entries.0,
            damping: entries.1,
            disp: motion.disp,
            vel: motion.vel,
            residual,
            fresh,
        }
    }
}

impl OfForce for EvenChain<'_> {
    #[inline(always)]
    fn with<I: Isa, F: PointForce>(self, isa: I, force: F) {
        let (start, end) = (self.rows.start, self.rows.end);
        let (Some(x), Some(v), Some(r)) = (
            self.disp.get(start - 1..end + 1),
            self.vel.get(start - 1..end + 1),
            self.residual.get_mut(start..end),
        ) else {
            return;
        };
        let (k, c) = (self.stiffness, self.damping);
        if self.fresh {
            even::<I, F, true>(isa, force, (k, c), (x, v), r);
        } else {
            even::<I, F, false>(isa, force, (k, c), (x, v), r);
        }
    }
}

/// The even chain alone.
pub(super) struct Alone<'a>(pub EvenChain<'a>);

impl Kernel for Alone<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        self.0.with(isa, super::point::NoForce);
    }
}

/// On the diagonal and beside it.
pub(super) type Entries = (f64, f64);

/// Rows of an even chain, eight at a time.
#[derive(Clone, Copy)]
struct Even<V, F> {
    stiffness: (V, V),
    damping: (V, V),
    force: F,
}

/// Eight rows, those one above and those one below.
type Three<'a> = [&'a [f64; 8]; 3];

impl<V: Copy, F: PointForce> Even<V, F> {
    /// e (above) + d (here) + e (below).
    #[inline(always)]
    fn product<I: Isa<V = V>>(isa: I, (d, e): (V, V), [above, here, below]: [V; 3]) -> V {
        let sum = isa.add(isa.mul(e, above), isa.mul(d, here));
        isa.add(sum, isa.mul(e, below))
    }

    /// r ← r − K x − C v − f; `FRESH`: r ← 0 − K x − C v − f, with the sign of a zero that this gives.
    #[inline(always)]
    fn rows<I: Isa<V = V>, const FRESH: bool>(
        self,
        isa: I,
        x: Three<'_>,
        v: Three<'_>,
        r: &mut [f64; 8],
    ) {
        let x = [isa.load(x[0]), isa.load(x[1]), isa.load(x[2])];
        let springs = Self::product(isa, self.stiffness, x);
        let sum = if FRESH {
            isa.sub(isa.splat(0.0), springs)
        } else {
            isa.sub(isa.load(r), springs)
        };
        let v = [isa.load(v[0]), isa.load(v[1]), isa.load(v[2])];
        let sum = isa.sub(sum, Self::product(isa, self.damping, v));
        isa.store(isa.sub(sum, self.force.force(isa, x[1], v[1])), r);
    }
}

/// r ← (r or 0) − K x − C v − f; `x` and `v` have one row more at each end.
#[inline(always)]
fn even<I: Isa, F: PointForce, const FRESH: bool>(
    isa: I,
    force: F,
    (k, c): (Entries, Entries),
    (x, v): (&[f64], &[f64]),
    r: &mut [f64],
) {
    let chain = Even {
        stiffness: (isa.splat(k.0), isa.splat(k.1)),
        damping: (isa.splat(c.0), isa.splat(c.1)),
        force,
    };
    let (blocks, rest) = r.as_chunks_mut::<8>();
    let count = blocks.len();
    let (xs, vs) = (shifted(x, count), shifted(v, count));
    let x_rows = xs[0].iter().zip(xs[1]).zip(xs[2]);
    let v_rows = vs[0].iter().zip(vs[1]).zip(vs[2]);
    for ((r, ((x0, x1), x2)), ((v0, v1), v2)) in blocks.iter_mut().zip(x_rows).zip(v_rows) {
        chain.rows::<I, FRESH>(isa, [x0, x1, x2], [v0, v1, v2], r);
    }
    if !rest.is_empty() {
        let (x, v) = (last(x, count), last(v, count));
        let mut rows = filled(rest);
        chain.rows::<I, FRESH>(isa, [&x[0], &x[1], &x[2]], [&v[0], &v[1], &v[2]], &mut rows);
        copy(&rows, rest);
    }
}

/// `count` times eight numbers, from the first one, the second one and the third one on.
#[inline(always)]
fn shifted(of: &[f64], count: usize) -> [&[[f64; 8]]; 3] {
    let mut all: [&[[f64; 8]]; 3] = [&[]; 3];
    for (by, all) in all.iter_mut().enumerate() {
        if let Some(of) = of.get(by..by + 8 * count) {
            *all = of.as_chunks::<8>().0;
        }
    }
    all
}

/// What comes after these, fewer than eight numbers each.
#[inline(always)]
fn last(of: &[f64], count: usize) -> [[f64; 8]; 3] {
    let mut all = [[0.0; 8]; 3];
    for (by, all) in all.iter_mut().enumerate() {
        if let Some(of) = of.get(by + 8 * count..) {
            copy(of, all);
        }
    }
    all
}

/// Up to eight numbers, then zeros.
#[inline(always)]
pub(super) fn filled(from: &[f64]) -> [f64; 8] {
    let mut all = [0.0; 8];
    copy(from, &mut all);
    all
}

#[inline(always)]
pub(super) fn copy(from: &[f64], into: &mut [f64]) {
    for (into, from) in into.iter_mut().zip(from) {
        *into = *from;
    }
}
