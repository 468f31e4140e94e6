//! A [`Strip`]: bilinear elements with the same numbers at degrees of freedom that follow each other.
//!
//! Their sliders stand in plain vectors while a test steps by rows, and go back to the laws when anybody asks for these.

use std::ops::Range;

use super::element::Connection;
use super::rows::{copy, filled};
use super::{Base, End, Motion};
use crate::law::SliderForm;
use crate::linalg::Lanes;
use crate::linalg::lanes::{Isa, Kernel};

/// Elements from one place that is no degree of freedom, or from `from`, `from` + 1, …, to `to`, `to` + 1, ….
#[derive(Debug)]
pub(super) struct Strip {
    form: SliderForm,
    from: End,
    to: usize,
    /// Of each element in this step.
    forces: Vec<f64>,
    /// Sliders, and how they moved last.
    sliders: Vec<f64>,
    motions: Vec<f64>,
    /// Elements evaluated in this step.
    done: usize,
    /// The vectors have what the laws have.
    loaded: bool,
    /// The laws have what the vectors have.
    stored: bool,
}

impl Strip {
    /// The number of elements at the front that make a strip, given with their ends.
    pub(super) fn length<'a>(
        elements: impl Iterator<Item = (&'a mut Connection, (End, End))>,
    ) -> usize {
        let mut first: Option<(SliderForm, End, usize)> = None;
        let mut length = 0;
        for (connection, ends) in elements {
            let (Some(law), (from, End::Dof(to))) = (connection.law.bilinear(), ends) else {
                break;
            };
            let form = law.form();
            let ascends = !matches!(from, End::Dof(dof) if dof >= to);
            let follows = first.is_none_or(|(other, begin, end)| {
                form == other && to == end + length && from == moved(begin, length)
            });
            if !(ascends && follows) {
                break;
            }
            first.get_or_insert((form, from, to));
            length += 1;
        }
        length
    }

    /// Of elements that make one.
    pub(super) fn new(connections: &mut [Connection], ends: (End, End)) -> Option<Self> {
        let len = connections.len();
        let form = connections.first_mut()?.law.bilinear()?.form();
        let (from, End::Dof(to)) = ends else {
            return None;
        };
        Some(Self {
            form,
            from,
            to,
            forces: vec![0.0; len],
            sliders: vec![0.0; len],
            motions: vec![0.0; len],
            done: 0,
            loaded: false,
            stored: true,
        })
    }

    /// Brings the laws up to date; they may be changed after that. Real-time: yes.
    pub(super) fn store(&mut self, connections: &mut [Connection]) {
        self.loaded = false;
        if self.stored {
            return;
        }
        let sliders = self.sliders.iter().zip(&self.motions);
        for (connection, (slider, motion)) in connections.iter_mut().zip(sliders) {
            if let Some(law) = connection.law.bilinear() {
                law.set_slider(*slider, *motion);
            }
        }
        self.stored = true;
    }

    fn load(&mut self, connections: &mut [Connection]) {
        let sliders = self.sliders.iter_mut().zip(&mut self.motions);
        for (connection, (slider, motion)) in connections.iter_mut().zip(sliders) {
            if let Some(law) = connection.law.bilinear() {
                (*slider, *motion) = law.slider();
            }
        }
        self.loaded = true;
    }

    /// residual ← residual − force, these rows of it; each element is committed with the first of its rows.
    /// Real-time: yes.
    pub(super) fn subtract(
        &mut self,
        connections: &mut [Connection],
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
        lanes: Lanes,
    ) {
        if rows.start == 0 {
            self.done = 0;
        }
        if !self.loaded {
            self.load(connections);
        }
        self.stored = false;
        let len = self.forces.len();
        let begin = match self.from {
            End::Dof(from) => from,
            _ => self.to,
        };
        let end = rows.end.saturating_sub(begin).min(len);
        if end > self.done {
            self.evaluate(self.done..end, motion.disp, motion.base, lanes);
            self.done = end;
        }
        // Of a row, the element that ends there comes before the one that begins there.
        let at = |first: usize| {
            let end = rows.end.saturating_sub(first).min(len);
            rows.start.saturating_sub(first).min(end)..end
        };
        let ends = at(self.to);
        let place = self.to + ends.start..self.to + ends.end;
        if let (Some(rows), Some(forces)) = (residual.get_mut(place), self.forces.get(ends)) {
            for (r, f) in rows.iter_mut().zip(forces) {
                *r -= f;
            }
        }
        if let End::Dof(from) = self.from {
            let begins = at(from);
            let place = from + begins.start..from + begins.end;
            if let (Some(rows), Some(forces)) = (residual.get_mut(place), self.forces.get(begins)) {
                for (r, f) in rows.iter_mut().zip(forces) {
                    *r += f;
                }
            }
        }
    }

    fn evaluate(&mut self, elements: Range<usize>, disp: &[f64], base: Base, lanes: Lanes) {
        let of = |first: usize| disp.get(first + elements.start..first + elements.end);
        let (Some(far), Some(forces), Some(sliders), Some(motions)) = (
            of(self.to),
            self.forces.get_mut(elements.clone()),
            self.sliders.get_mut(elements.clone()),
            self.motions.get_mut(elements.clone()),
        ) else {
            return;
        };
        let rows = (forces, sliders, motions);
        let form = self.form;
        match self.from {
            End::Dof(from) => {
                if let Some(near) = of(from) {
                    lanes.run(Between(form, near, far, rows));
                }
            }
            End::Ground => lanes.run(Anchored(form, base.disp, far, rows)),
            End::Fixed => lanes.run(Anchored(form, 0.0, far, rows)),
        }
    }
}

/// An end `by` elements further on.
fn moved(end: End, by: usize) -> End {
    match end {
        End::Dof(dof) => End::Dof(dof + by),
        anchor => anchor,
    }
}

/// Forces, sliders, how these moved. All slices of a loop are equally long.
type Rows<'a> = (&'a mut [f64], &'a mut [f64], &'a mut [f64]);

/// Elements from one place, counted from there.
struct Anchored<'a>(SliderForm, f64, &'a [f64], Rows<'a>);

impl Kernel for Anchored<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self(form, base, far, rows) = self;
        let base = isa.splat(base);
        let form = Form::new(isa, form);
        let mut blocks = Blocks::new(rows);
        let (far, far_rest) = far.as_chunks::<8>();
        for far in far {
            let disp = isa.sub(isa.load(far), base);
            if let Some((force, slider, motion)) = blocks.next() {
                form.slide(isa, disp, force, slider, motion);
            }
        }
        if !far_rest.is_empty() {
            let disp = isa.sub(isa.load(&filled(far_rest)), base);
            let (mut force, mut slider, mut motion) = blocks.rest();
            form.slide(isa, disp, &mut force, &mut slider, &mut motion);
            blocks.put_rest(&force, &slider, &motion);
        }
    }
}

/// Elements between `near` and `far`.
struct Between<'a>(SliderForm, &'a [f64], &'a [f64], Rows<'a>);

impl Kernel for Between<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self(form, near, far, rows) = self;
        let form = Form::new(isa, form);
        let mut blocks = Blocks::new(rows);
        let ((near, near_rest), (far, far_rest)) = (near.as_chunks::<8>(), far.as_chunks::<8>());
        for (near, far) in near.iter().zip(far) {
            let disp = isa.sub(isa.load(far), isa.load(near));
            if let Some((force, slider, motion)) = blocks.next() {
                form.slide(isa, disp, force, slider, motion);
            }
        }
        if !far_rest.is_empty() {
            let disp = isa.sub(isa.load(&filled(far_rest)), isa.load(&filled(near_rest)));
            let (mut force, mut slider, mut motion) = blocks.rest();
            form.slide(isa, disp, &mut force, &mut slider, &mut motion);
            blocks.put_rest(&force, &slider, &motion);
        }
    }
}

type Eights<'a> = std::slice::IterMut<'a, [f64; 8]>;

/// [`Rows`] eight at a time, then what is left of them.
struct Blocks<'a> {
    eights: (Eights<'a>, Eights<'a>, Eights<'a>),
    rest: Rows<'a>,
}

/// A force, a slider and a motion of eight elements.
type Eight<'a> = (&'a mut [f64; 8], &'a mut [f64; 8], &'a mut [f64; 8]);

impl<'a> Blocks<'a> {
    #[inline(always)]
    fn new((forces, sliders, motions): Rows<'a>) -> Self {
        let (forces, a) = forces.as_chunks_mut::<8>();
        let (sliders, b) = sliders.as_chunks_mut::<8>();
        let (motions, c) = motions.as_chunks_mut::<8>();
        Self {
            eights: (forces.iter_mut(), sliders.iter_mut(), motions.iter_mut()),
            rest: (a, b, c),
        }
    }

    #[inline(always)]
    fn next(&mut self) -> Option<Eight<'a>> {
        let (forces, sliders, motions) = &mut self.eights;
        Some((forces.next()?, sliders.next()?, motions.next()?))
    }

    #[inline(always)]
    fn rest(&self) -> ([f64; 8], [f64; 8], [f64; 8]) {
        let (forces, sliders, motions) = &self.rest;
        (filled(forces), filled(sliders), filled(motions))
    }

    #[inline(always)]
    fn put_rest(&mut self, force: &[f64], slider: &[f64], motion: &[f64]) {
        let (forces, sliders, motions) = &mut self.rest;
        copy(force, forces);
        copy(slider, sliders);
        copy(motion, motions);
    }
}

/// [`SliderForm`] in lanes.
#[derive(Clone, Copy)]
struct Form<V> {
    stiffness: V,
    yield_force: V,
    yield_disp: V,
    /// b k, and 1 − b.
    beside: V,
    share: V,
}

impl<V: Copy> Form<V> {
    #[inline(always)]
    fn new<I: Isa<V = V>>(isa: I, form: SliderForm) -> Self {
        Self {
            stiffness: isa.splat(form.stiffness),
            yield_force: isa.splat(form.yield_force),
            yield_disp: isa.splat(form.yield_disp),
            beside: isa.splat(form.ratio * form.stiffness),
            share: isa.splat(1.0 - form.ratio),
        }
    }

    /// What the law does on the way to `disp` and commits, in the same operations.
    #[inline(always)]
    fn slide<I: Isa<V = V>>(
        self,
        isa: I,
        disp: V,
        force: &mut [f64; 8],
        slider: &mut [f64; 8],
        motion: &mut [f64; 8],
    ) {
        let (zero, one, two) = (isa.splat(0.0), isa.splat(1.0), isa.splat(2.0));
        let (old, moved_last) = (isa.load(slider), isa.load(motion));
        let reach = self.yield_disp;
        let stretch = isa.sub(disp, old);
        let (ahead, behind) = ((reach, stretch), (stretch, isa.sub(zero, reach)));
        let stuck = isa.mul(self.stiffness, stretch);
        let held = isa.if_less(behind, isa.sub(zero, self.yield_force), stuck);
        let held = isa.if_less(ahead, self.yield_force, held);
        let kept = isa.if_less(behind, isa.add(disp, reach), old);
        isa.store(isa.if_less(ahead, isa.sub(disp, reach), kept), slider);
        // 0, 1 (slips) or 2 (flows, but does not slip), as the law numbers it.
        let rounding = isa.mul(isa.splat(2.0 * f64::EPSILON), isa.max(isa.abs(disp), reach));
        let at_yield = (isa.sub(reach, rounding), isa.abs(stretch));
        let flows = isa.if_at_most(
            (moved_last, zero),
            zero,
            isa.if_at_most(at_yield, two, zero),
        );
        let moves = isa.if_less(behind, one, flows);
        isa.store(isa.if_less(ahead, one, moves), motion);
        let sum = isa.add(isa.mul(self.beside, disp), isa.mul(self.share, held));
        isa.store(sum, force);
    }
}
