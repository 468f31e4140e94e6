//! A [`Strip`]: bilinear elements with the same numbers at degrees of freedom that follow each other.
//!
//! Their sliders stand in plain vectors while a test steps by rows, and go back to the laws when anybody asks for these.

use std::ops::Range;

use super::element::Connection;
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

struct Anchored<'a>(SliderForm, f64, &'a [f64], Rows<'a>);

impl Kernel for Anchored<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self(form, base, far, (forces, sliders, motions)) = self;
        let rows = forces.iter_mut().zip(sliders).zip(motions).zip(far);
        for (((force, slider), motion), far) in rows {
            *force = form.slide(far - base, slider, motion);
        }
    }
}

struct Between<'a>(SliderForm, &'a [f64], &'a [f64], Rows<'a>);

impl Kernel for Between<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self(form, near, far, (forces, sliders, motions)) = self;
        let rows = forces.iter_mut().zip(sliders).zip(motions);
        for (((force, slider), motion), (near, far)) in rows.zip(near.iter().zip(far)) {
            *force = form.slide(far - near, slider, motion);
        }
    }
}
