//! A [`Strip`]: bilinear elements with the same numbers at degrees of freedom that follow each other.
//!
//! Their sliders are kept in plain vectors while a test steps by rows, and go back to the laws before these are read.

use std::ops::Range;

use super::element::Connection;
use super::rows::{copy, filled};
use super::{End, Motion};
use crate::law::SliderForm;
use crate::linalg::Lanes;
use crate::linalg::lanes::{Isa, Kernel};

/// Elements from one place that is no degree of freedom, or from `from`, `from` + 1, …, to `to`, `to` + 1, ….
#[derive(Debug)]
pub(super) struct Strip {
    form: SliderForm,
    from: End,
    to: usize,
    /// Force of each element in this step, between degrees of freedom only.
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

    /// A strip of elements that form one.
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
            forces: match from {
                End::Dof(_) => vec![0.0; len],
                _ => Vec::new(),
            },
            sliders: vec![0.0; len],
            motions: vec![0.0; len],
            done: 0,
            loaded: false,
            stored: true,
        })
    }

    /// Brings the laws up to date. `change`: they may be changed after that. Real-time: yes.
    pub(super) fn store(&mut self, connections: &mut [Connection], change: bool) {
        self.loaded &= !change;
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
        let len = self.sliders.len();
        let at = |first: usize| {
            let end = rows.end.saturating_sub(first).min(len);
            rows.start.saturating_sub(first).min(end)..end
        };
        let base = match self.from {
            End::Dof(from) => {
                self.evaluate(at(from).end, from, motion.disp, lanes);
                self.enter(at(self.to), at(from), from, residual);
                return;
            }
            End::Ground => motion.base.disp,
            End::Fixed => 0.0,
        };
        let elements = at(self.to);
        let places = self.to + elements.start..self.to + elements.end;
        if let (Some(disp), Some(rows), Some(sliders), Some(motions)) = (
            motion.disp.get(places.clone()),
            residual.get_mut(places),
            self.sliders.get_mut(elements.clone()),
            self.motions.get_mut(elements),
        ) {
            lanes.run(Anchored(self.form, base, disp, (rows, sliders, motions)));
        }
    }

    /// Forces of the elements up to `end`, which begin at `from` and those after it, except those that were made before.
    fn evaluate(&mut self, end: usize, from: usize, disp: &[f64], lanes: Lanes) {
        let elements = self.done..end.max(self.done);
        self.done = elements.end;
        let of = |first: usize| disp.get(first + elements.start..first + elements.end);
        if let (Some(near), Some(far), Some(forces), Some(sliders), Some(motions)) = (
            of(from),
            of(self.to),
            self.forces.get_mut(elements.clone()),
            self.sliders.get_mut(elements.clone()),
            self.motions.get_mut(elements.clone()),
        ) {
            let rows = (forces, sliders, motions);
            lanes.run(Between(self.form, near, far, rows));
        }
    }

    /// The element that ends in a row comes before the one that begins there.
    fn enter(&self, ends: Range<usize>, begins: Range<usize>, from: usize, residual: &mut [f64]) {
        let place = self.to + ends.start..self.to + ends.end;
        if let (Some(rows), Some(forces)) = (residual.get_mut(place), self.forces.get(ends)) {
            for (r, f) in rows.iter_mut().zip(forces) {
                *r -= f;
            }
        }
        let place = from + begins.start..from + begins.end;
        if let (Some(rows), Some(forces)) = (residual.get_mut(place), self.forces.get(begins)) {
            for (r, f) in rows.iter_mut().zip(forces) {
                *r += f;
            }
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

/// Forces (of anchored elements the residual, from which their forces are taken), sliders, how these moved. All slices of a
/// loop are equally long.
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
            if let Some((row, slider, motion)) = blocks.next() {
                let force = form.slide(isa, disp, slider, motion);
                isa.store(isa.sub(isa.load(row), force), row);
            }
        }
        if !far_rest.is_empty() {
            let disp = isa.sub(isa.load(&filled(far_rest)), base);
            let (mut row, mut slider, mut motion) = blocks.rest();
            let force = form.slide(isa, disp, &mut slider, &mut motion);
            isa.store(isa.sub(isa.load(&row), force), &mut row);
            blocks.put_rest(&row, &slider, &motion);
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
                isa.store(form.slide(isa, disp, slider, motion), force);
            }
        }
        if !far_rest.is_empty() {
            let disp = isa.sub(isa.load(&filled(far_rest)), isa.load(&filled(near_rest)));
            let (mut force, mut slider, mut motion) = blocks.rest();
            isa.store(form.slide(isa, disp, &mut slider, &mut motion), &mut force);
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

/// [`Rows`] of eight elements.
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

    /// Moves the slider as the law does on the way to `disp` and commits, in the same operations. Returns its force.
    #[inline(always)]
    fn slide<I: Isa<V = V>>(
        self,
        isa: I,
        disp: V,
        slider: &mut [f64; 8],
        motion: &mut [f64; 8],
    ) -> V {
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
        isa.add(isa.mul(self.beside, disp), isa.mul(self.share, held))
    }
}
