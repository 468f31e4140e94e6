//! A [`Run`]: equal elements at degrees of freedom that follow each other.

use std::borrow::Cow;
use std::ops::Range;

use super::element::{Connection, Declared, Facts};
use super::point::{BiviscousForce, CubicForce, LinearForce, OfForce, SquareRootForce, With};
use super::rows::{Anchored, Between, EvenChain};
use super::{Base, End, Motion};
use crate::law::{Law, Memoryless};
use crate::linalg::Lanes;

/// Elements with one law, from the base or from degrees of freedom `from`, `from` + 1, …, to `to`, `to` + 1, ….
#[derive(Debug)]
pub(super) struct Run {
    law: Box<dyn Law>,
    form: Memoryless,
    declared: Declared,
    names: Names,
    from: Start,
    to: usize,
    len: usize,
    /// Deformation and rate of each element at its last evaluation; empty if never, or not kept.
    last: Vec<(f64, f64)>,
}

/// Where the deformation of the first element is counted from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Start {
    /// All elements from the same place that is no degree of freedom.
    Anchor(End),
    /// Each from the degree of freedom after the one of the element before.
    Dof(usize),
}

/// Names in little space.
#[derive(Debug)]
enum Names {
    /// "prefix first", "prefix first+1", ….
    Numbered {
        prefix: String,
        first: usize,
    },
    Listed(Vec<String>),
}

impl Run {
    /// True if `next` continues the run `before`, which has at least one element.
    pub(super) fn continues(before: &[(Connection, Facts)], next: &(Connection, Facts)) -> bool {
        let (Some(first), Some(last)) = (before.first(), before.last()) else {
            return false;
        };
        let same_law = |a: &dyn Law, b: &dyn Law, declared: &Declared| {
            a.memoryless().is_some()
                && a.memoryless() == b.memoryless()
                && a.reference() == b.reference()
                && a.bound(declared.reach) == b.bound(declared.reach)
        };
        let (old, new) = (&last.1, &next.1);
        let follows = match (old.from, new.from) {
            (End::Dof(a), End::Dof(b)) => b == a + 1,
            (a, b) => a == b,
        };
        let to = match (old.to, new.to) {
            (End::Dof(a), End::Dof(b)) => b == a + 1,
            _ => false,
        };
        // Towards the end: the force of an element leaves a degree of freedom before that of the next one enters it.
        let ascends = match (new.from, new.to) {
            (End::Dof(a), End::Dof(b)) => b > a,
            _ => true,
        };
        follows
            && to
            && ascends
            && old.declared == new.declared
            && same_law(first.0.law.as_ref(), next.0.law.as_ref(), &new.declared)
    }

    /// A run of elements each of which continues the ones before. Elements that form no run come back.
    pub(super) fn of(elements: Vec<(Connection, Facts)>) -> Result<Self, Vec<(Connection, Facts)>> {
        let Some((hot, cold)) = elements.first() else {
            return Err(elements);
        };
        let (Some(form), End::Dof(to)) = (hot.law.memoryless(), cold.to) else {
            return Err(elements);
        };
        let from = match cold.from {
            End::Dof(from) => Start::Dof(from),
            anchor => Start::Anchor(anchor),
        };
        let (declared, len) = (cold.declared, elements.len());
        let mut names = Names::of(&cold.name);
        for (index, (_, cold)) in elements.iter().enumerate().skip(1) {
            names.push(index, &cold.name);
        }
        let mut rest = elements.into_iter();
        match rest.next() {
            Some((hot, _)) => Ok(Self {
                law: hot.law,
                form,
                declared,
                names,
                from,
                to,
                len,
                last: Vec::new(),
            }),
            None => Err(rest.collect()),
        }
    }

    /// Takes in one more element, or gives it back if it does not continue the run.
    pub(super) fn take(&mut self, next: (Connection, Facts)) -> Option<(Connection, Facts)> {
        let (hot, cold) = &next;
        let law = hot.law.as_ref();
        let belongs = cold.from == self.from(self.len)
            && cold.to == self.to(self.len)
            && cold.declared == self.declared
            && law.memoryless() == Some(self.form)
            && law.reference() == self.law.reference()
            && law.bound(self.declared.reach) == self.law.bound(self.declared.reach);
        if !belongs {
            return Some(next);
        }
        self.names.push(self.len, &cold.name);
        self.len += 1;
        None
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn name(&self, index: usize) -> Cow<'_, str> {
        match &self.names {
            Names::Numbered { prefix, first } => format!("{prefix} {}", first + index).into(),
            Names::Listed(names) => names.get(index).map_or("", String::as_str).into(),
        }
    }

    pub(super) fn from(&self, index: usize) -> End {
        match self.from {
            Start::Anchor(end) => end,
            Start::Dof(first) => End::Dof(first + index),
        }
    }

    pub(super) fn to(&self, index: usize) -> End {
        End::Dof(self.to + index)
    }

    pub(super) fn declared(&self) -> &Declared {
        &self.declared
    }

    pub(super) fn law(&self) -> &dyn Law {
        self.law.as_ref()
    }

    /// The law and where the element was last evaluated.
    pub(super) fn last(&self, index: usize) -> (Memoryless, f64, f64) {
        let (disp, vel) = self.last.get(index).copied().unwrap_or_default();
        (self.form, disp, vel)
    }

    /// True if no element starts at a degree of freedom: each one acts on its own row only.
    pub(super) fn is_anchored(&self) -> bool {
        matches!(self.from, Start::Anchor(_))
    }

    /// Rows between the two ends of an element; 0 for a run from the base or the inertial frame.
    pub(super) fn span(&self) -> usize {
        match self.from {
            Start::Dof(from) => self.to.saturating_sub(from),
            Start::Anchor(_) => 0,
        }
    }

    /// residual ← residual − force, these rows of it; all vectors are whole. With `keep` each element remembers its trial; then
    /// one call must cover all rows if any element starts at a degree of freedom. Real-time: yes, if `keep` is false.
    pub(super) fn subtract(
        &mut self,
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
        keep: bool,
        lanes: Lanes,
    ) {
        let Motion { disp, vel, .. } = motion;
        let Start::Dof(from) = self.from else {
            return self.subtract_anchored(rows, motion, residual, keep, lanes);
        };
        if keep {
            self.remember(disp, vel, from);
        }
        self.evaluate(
            lanes,
            Between {
                rows,
                disp,
                vel,
                residual,
                from,
                to: self.to,
                len: self.len,
            },
        );
    }

    fn subtract_anchored(
        &mut self,
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
        keep: bool,
        lanes: Lanes,
    ) {
        let base = self.base(motion.base);
        let rows = rows.start.max(self.to)..rows.end.min(self.to + self.len);
        if rows.is_empty() {
            return;
        }
        let (Some(disp), Some(vel), Some(residual)) = (
            motion.disp.get(rows.clone()),
            motion.vel.get(rows.clone()),
            residual.get_mut(rows.clone()),
        ) else {
            return residual.fill(f64::NAN);
        };
        if keep {
            self.last.resize(self.len, (0.0, 0.0));
            let last = self.last.iter_mut().skip(rows.start - self.to);
            for ((last, x), v) in last.zip(disp).zip(vel) {
                *last = (x - base.disp, v - base.vel);
            }
        }
        self.evaluate(
            lanes,
            Anchored {
                disp,
                vel,
                residual,
                base,
            },
        );
    }

    /// The motion of the place that the elements of an anchored run are fastened to.
    fn base(&self, base: Base) -> Base {
        match self.from {
            Start::Anchor(End::Ground) => base,
            _ => Base::default(),
        }
    }

    /// Makes the forces of inner rows of an even chain with those of this run in one pass, if it acts on each of them from
    /// what is at rest and remembers nothing. False if nothing was done. Real-time: yes.
    pub(super) fn join(&self, chain: EvenChain<'_>, base: Base, lanes: Lanes) -> bool {
        let rows = &chain.rows;
        let covers = self.to <= rows.start && rows.end <= self.to + self.len;
        let joins = self.is_anchored() && covers && self.base(base) == Base::default();
        if joins {
            self.evaluate(lanes, chain);
        }
        joins
    }

    fn remember(&mut self, disp: &[f64], vel: &[f64], from: usize) {
        self.last.clear();
        let ends = (0..self.len).map(|i| (from + i, self.to + i));
        let of = |values: &[f64], a: usize, b: usize| match (values.get(a), values.get(b)) {
            (Some(a), Some(b)) => b - a,
            _ => 0.0,
        };
        self.last
            .extend(ends.map(|(a, b)| (of(disp, a, b), of(vel, a, b))));
    }

    /// Hands the law to the kernel as what it is.
    fn evaluate(&self, lanes: Lanes, of: impl OfForce) {
        match self.form {
            Memoryless::Linear { stiffness, damping } => {
                lanes.run(With(of, LinearForce(stiffness, damping)));
            }
            Memoryless::Biviscous {
                damping,
                post_yield,
                yield_vel,
            } => lanes.run(With(of, BiviscousForce(damping, post_yield, yield_vel))),
            Memoryless::SquareRoot {
                stiffness,
                hardening,
            } => lanes.run(With(of, SquareRootForce(stiffness, hardening))),
            Memoryless::Cubic { stiffness, cubic } => {
                lanes.run(With(of, CubicForce(stiffness, cubic)));
            }
        }
    }
}

impl Names {
    fn of(name: &str) -> Self {
        let parts = name.rsplit_once(' ');
        let numbered = parts.and_then(|(prefix, number)| {
            let first: usize = number.parse().ok()?;
            // "01" is not what this would give back.
            (first.to_string() == number).then(|| Names::Numbered {
                prefix: prefix.to_owned(),
                first,
            })
        });
        numbered.unwrap_or_else(|| Names::Listed(vec![name.to_owned()]))
    }

    /// The name of element `index`, all before it being known.
    fn push(&mut self, index: usize, name: &str) {
        if let Names::Numbered { prefix, first } = self {
            let expected = format!("{prefix} {}", *first + index);
            if expected == name {
                return;
            }
            let names = (0..index).map(|i| format!("{prefix} {}", *first + i));
            *self = Names::Listed(names.collect());
        }
        if let Names::Listed(names) = self {
            names.push(name.to_owned());
        }
    }
}
