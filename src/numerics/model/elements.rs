//! All elements of a structure in their order: single ones, and runs of equal ones that are evaluated side by side.
//!
//! A [`Run`] is formed of at least [`SHORTEST`] consecutive elements with one law without memory, all from the base or
//! the inertial frame, or all from another degree of freedom, to degrees of freedom that follow each other: the dampers of
//! a chain, the storeys of a building. It holds its law once. The invariant: forces enter a residual in the order of the
//! elements and with the operations of the law, so that a run gives the bits of its elements one by one.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::ops::Range;

use super::by_rows::ByRows;
use super::element::{Connection, Declared, Facts, at, split};
use super::rows::EvenChain;
use super::run::Run;
use super::strip::Strip;
use super::{Element, End, ModelError, Motion};
use crate::law::{Law, Memoryless, Tangent};
use crate::linalg::Lanes;
use gusset_quantity::state::{Stateful, Visit};

/// Shortest run that is formed.
const SHORTEST: usize = 16;

/// Elements in their order.
#[derive(Debug)]
pub(super) struct Elements {
    groups: Vec<Group>,
    lanes: Lanes,
    /// Whether runs remember where they were last evaluated.
    keeps_tangents: bool,
}

#[derive(Debug)]
enum Group {
    Singles {
        connections: Vec<Connection>,
        facts: Vec<Facts>,
        by_rows: ByRows,
    },
    Run(Box<Run>),
}

/// One element, wherever it is kept.
#[derive(Debug)]
pub(super) struct Seen<'a> {
    pub(super) name: Cow<'a, str>,
    pub(super) from: End,
    pub(super) to: End,
    pub(super) declared: &'a Declared,
    pub(super) law: &'a dyn Law,
    /// In a run: deformation and rate at the last evaluation, zeros if they are not kept.
    at: Option<(Memoryless, f64, f64)>,
}

impl Seen<'_> {
    /// Tangent at the last evaluation.
    pub(super) fn tangent(&self) -> Tangent {
        match self.at {
            Some((form, disp, vel)) => form.tangent(disp, vel),
            None => self.law.tangent(),
        }
    }
}

impl Elements {
    /// Checks each element against a structure of `n` degrees of freedom and takes it in. With `apart` all of them are single
    /// ones, whose forces and tangents can be asked for one by one.
    pub(super) fn new(
        elements: impl IntoIterator<Item = Element>,
        n: usize,
        apart: bool,
    ) -> Result<Self, ModelError> {
        let mut all = Self {
            groups: Vec::new(),
            lanes: Lanes::best_for(n),
            keeps_tangents: true,
        };
        // Elements that may yet become a run.
        let mut waiting: Vec<(Connection, Facts)> = Vec::new();
        for element in elements {
            let next = split(element, n)?;
            if apart {
                all.singles(std::iter::once(next));
                continue;
            }
            if waiting.is_empty() {
                // Only a run that everything before has joined can be continued.
                let refused = match all.groups.last_mut() {
                    Some(Group::Run(run)) => run.take(next),
                    _ => Some(next),
                };
                waiting.extend(refused);
                continue;
            }
            if !Run::continues(&waiting, &next) {
                all.singles(waiting.drain(..));
            }
            waiting.push(next);
            if waiting.len() == SHORTEST {
                match Run::of(std::mem::take(&mut waiting)) {
                    Ok(run) => all.groups.push(Group::Run(Box::new(run))),
                    Err(none) => all.singles(none.into_iter()),
                }
            }
        }
        all.singles(waiting.into_iter());
        if apart {
            for group in &mut all.groups {
                if let Group::Singles {
                    connections,
                    by_rows,
                    ..
                } = group
                {
                    *by_rows = ByRows::new(connections, n);
                }
            }
            return Ok(all);
        }
        let groups = std::mem::take(&mut all.groups);
        all.groups = groups.into_iter().flat_map(|g| in_strips(g, n)).collect();
        Ok(all)
    }

    fn singles(&mut self, more: impl Iterator<Item = (Connection, Facts)>) {
        for (hot, cold) in more {
            if let Some(Group::Singles {
                connections, facts, ..
            }) = self.groups.last_mut()
            {
                connections.push(hot);
                facts.push(cold);
            } else {
                self.groups.push(Group::Singles {
                    connections: vec![hot],
                    facts: vec![cold],
                    by_rows: ByRows::default(),
                });
            }
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Elements of runs need not remember where they were evaluated from now on.
    pub(super) fn forget_tangents(&mut self) {
        self.keeps_tangents = false;
    }

    pub(super) const fn keeps_tangents(&self) -> bool {
        self.keeps_tangents
    }

    #[cfg(any(test, feature = "test-doubles"))]
    pub(super) fn set_lanes(&mut self, lanes: Lanes) {
        self.lanes = lanes;
    }

    /// All elements in their order.
    pub(super) fn iter(&self) -> impl Iterator<Item = Seen<'_>> {
        self.groups.iter().flat_map(|group| {
            let (run, singles) = match group {
                Group::Run(run) => (Some(run), None),
                Group::Singles {
                    connections, facts, ..
                } => (None, Some((connections, facts))),
            };
            let of_run = run.into_iter().flat_map(|run| {
                (0..run.len()).map(|index| Seen {
                    name: run.name(index),
                    from: run.from(index),
                    to: run.to(index),
                    declared: run.declared(),
                    law: run.law(),
                    at: Some(run.last(index)),
                })
            });
            let of_singles = singles.into_iter().flat_map(|(connections, facts)| {
                connections.iter().zip(facts).map(|(hot, cold)| Seen {
                    name: Cow::Borrowed(&cold.name),
                    from: cold.from,
                    to: cold.to,
                    declared: &cold.declared,
                    law: hot.law.as_ref(),
                    at: None,
                })
            });
            of_run.chain(of_singles)
        })
    }

    /// Tangent of each element at rest: a trial at zero that is forgotten.
    pub(super) fn at_rest(&mut self) -> Vec<Tangent> {
        let mut all = Vec::new();
        for group in &mut self.groups {
            match group {
                Group::Run(run) => {
                    let at_rest = run.last(0).0.tangent(0.0, 0.0);
                    all.extend(std::iter::repeat_n(at_rest, run.len()));
                }
                Group::Singles {
                    connections,
                    by_rows,
                    ..
                } => {
                    by_rows.store(connections, true);
                    for connection in connections {
                        connection.law.trial(0.0, 0.0, 0.0);
                        all.push(Tangent {
                            damping: connection.law.least_damping(),
                            ..connection.law.tangent()
                        });
                        connection.law.revert();
                    }
                }
            }
        }
        all
    }

    pub(super) fn commit(&mut self) {
        self.connections_mut(true)
            .for_each(|connection| connection.law.commit());
    }

    #[cfg(test)]
    pub(super) fn revert(&mut self) {
        self.connections_mut(true)
            .for_each(|connection| connection.law.revert());
    }

    /// The elements that are kept one by one: all that have a memory. `change`: they may change.
    fn connections_mut(&mut self, change: bool) -> impl Iterator<Item = &mut Connection> {
        self.groups.iter_mut().flat_map(move |group| match group {
            Group::Singles {
                connections,
                by_rows,
                ..
            } => {
                by_rows.store(connections, change);
                &mut connections[..]
            }
            Group::Run(_) => &mut [],
        })
    }

    /// Number of groups at the front that act row by row: runs from the base or the inertial frame.
    #[inline]
    fn row_by_row(&self) -> usize {
        self.groups
            .iter()
            .take_while(|group| matches!(group, Group::Run(run) if run.is_anchored()))
            .count()
    }

    /// residual ← residual − force, `rows` of it, for the groups that act row by row; all vectors are whole.
    /// Real-time: yes.
    #[inline]
    pub(super) fn subtract_anchored(
        &mut self,
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
    ) {
        let (keep, lanes) = (self.keeps_tangents, self.lanes);
        let count = self.row_by_row();
        for group in self.groups.iter_mut().take(count) {
            if let Group::Run(run) = group {
                run.subtract(rows.clone(), motion, residual, keep, lanes);
            }
        }
    }

    /// residual ← residual − force for all other groups, one trial each; with a commit if `COMMIT`. `gross` gains the size of each
    /// force of a single element where it has an entry for its row. Real-time: yes.
    #[inline]
    pub(super) fn subtract_rest<const COMMIT: bool>(
        &mut self,
        motion: Motion<'_>,
        residual: &mut [f64],
        gross: &mut [f64],
    ) {
        let (keep, lanes) = (self.keeps_tangents, self.lanes);
        let count = self.row_by_row();
        let Motion {
            disp,
            vel,
            base,
            dt,
        } = motion;
        for group in self.groups.iter_mut().skip(count) {
            match group {
                Group::Run(run) => run.subtract(0..residual.len(), motion, residual, keep, lanes),
                Group::Singles {
                    connections,
                    by_rows,
                    ..
                } => {
                    by_rows.store(connections, true);
                    for Connection { law, from, to } in connections {
                        let deformation = at(*to, disp, base.disp) - at(*from, disp, base.disp);
                        let rate = at(*to, vel, base.vel) - at(*from, vel, base.vel);
                        let force = if COMMIT {
                            law.step(deformation, rate, dt)
                        } else {
                            law.trial(deformation, rate, dt)
                        };
                        if let Some(r) = residual.get_mut(*to as usize) {
                            *r -= force;
                        }
                        if let Some(r) = residual.get_mut(*from as usize) {
                            *r += force;
                        }
                        for end in [from, to] {
                            if let Some(gross) = gross.get_mut(*end as usize) {
                                *gross += force.abs();
                            }
                        }
                    }
                }
            }
        }
    }

    /// Rows above the requested ones whose displacements [`Elements::subtract_rows`] needs; all of them if the
    /// elements remember their last trial, which takes whole vectors.
    pub(super) fn reach(&self) -> usize {
        let span = |group: &Group| match group {
            Group::Run(_) if self.keeps_tangents => usize::MAX,
            Group::Run(run) => run.span(),
            // Evaluated with the first of their rows.
            Group::Singles { .. } => 0,
        };
        self.groups.iter().map(span).max().unwrap_or(0)
    }

    /// Makes the forces of inner rows of an even chain with those of the first group in one pass. False if that group does
    /// not act on each of them alike; then nothing was done. Real-time: yes.
    #[inline]
    pub(super) fn join(&self, chain: EvenChain<'_>, motion: Motion<'_>) -> bool {
        match self.groups.first() {
            Some(Group::Run(run)) if !self.keeps_tangents => {
                run.join(chain, motion.base, self.lanes)
            }
            _ => false,
        }
    }

    /// residual ← residual − force, `rows` of it, for the first group, which has joined a chain. Real-time: yes.
    pub(super) fn subtract_first(
        &mut self,
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
    ) {
        if let Some(Group::Run(run)) = self.groups.first_mut() {
            run.subtract(rows, motion, residual, false, self.lanes);
        }
    }

    /// residual ← residual − force, `rows` of it, for all groups but the first `skipped`, with a commit. In one step rows
    /// are requested in ascending order, each once. Real-time: yes.
    #[inline]
    pub(super) fn subtract_rows(
        &mut self,
        skipped: usize,
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
    ) {
        let lanes = self.lanes;
        for group in self.groups.iter_mut().skip(skipped) {
            match group {
                Group::Run(run) => run.subtract(rows.clone(), motion, residual, false, lanes),
                Group::Singles {
                    connections,
                    by_rows,
                    ..
                } => by_rows.subtract(connections, rows.clone(), motion, residual, lanes),
            }
        }
    }
}

/// Elements in runs have no memory.
impl Stateful for Elements {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        for connection in self.connections_mut(visit.restores()) {
            connection.visit_state(visit);
        }
    }
}

/// A group of single elements, parted where some that follow each other make a strip.
fn in_strips(group: Group, n: usize) -> Vec<Group> {
    let Group::Singles {
        connections, facts, ..
    } = group
    else {
        return vec![group];
    };
    let ends = |facts: &Facts| (facts.from, facts.to);
    let mut left: VecDeque<_> = connections.into_iter().zip(facts).collect();
    let (mut groups, mut others) = (Vec::new(), Vec::new());
    while !left.is_empty() {
        let length = Strip::length(left.iter_mut().map(|(hot, cold)| (hot, ends(cold))));
        if length < SHORTEST {
            // A row of elements too short for a strip is too short from its second element on, too.
            others.extend(left.drain(..length.max(1)));
        } else {
            groups.extend(of_others(&mut others, n));
            let (mut connections, facts): (Vec<_>, Vec<_>) = left.drain(..length).unzip();
            let strip = facts
                .first()
                .and_then(|first| Strip::new(&mut connections, ends(first)));
            groups.push(Group::Singles {
                by_rows: strip.map_or_else(|| ByRows::new(&connections, n), ByRows::alike),
                connections,
                facts,
            });
        }
    }
    groups.extend(of_others(&mut others, n));
    groups
}

fn of_others(others: &mut Vec<(Connection, Facts)>, n: usize) -> Option<Group> {
    let (mut connections, facts): (Vec<Connection>, Vec<_>) = others.drain(..).unzip();
    share_constants(&mut connections);
    (!connections.is_empty()).then(|| Group::Singles {
        by_rows: ByRows::new(&connections, n),
        connections,
        facts,
    })
}

/// Bouc–Wen laws with equal constants keep these once, and follow each other in memory: a long chain reads little.
fn share_constants(connections: &mut [Connection]) {
    let copies = connections.iter_mut().map(|connection| {
        let law = connection.law.bouc_wen();
        law.map(|law| Box::new(law.clone()))
    });
    // All of them before the first original is dropped.
    let copies: Vec<_> = copies.collect();
    let mut known = Vec::new();
    for (connection, copy) in connections.iter_mut().zip(copies) {
        if let Some(mut law) = copy {
            law.share(&mut known);
            connection.law = law;
        }
    }
}

/// Upper bounds of both tangents of one element.
pub(super) fn bound(element: &Seen<'_>) -> Result<Tangent, ModelError> {
    let (reference, own) = (element.law.reference(), element.declared);
    let (stiffness, damping) = element.law.bound(own.reach);
    let declared = |ratio: Option<f64>, reference: f64| ratio.map(|ratio| ratio * reference);
    let missing = |tangent, key, ratio| ModelError::NoBound {
        element: element.name.clone().into_owned(),
        tangent,
        key,
        ratio,
    };
    Ok(Tangent {
        stiffness: declared(own.hardening_ratio, reference.stiffness)
            .or(stiffness)
            .ok_or_else(|| missing("stiffness", "reach_disp_m", "hardening_ratio"))?,
        damping: declared(own.damping_ratio, reference.damping)
            .or(damping)
            .ok_or_else(|| missing("damping", "reach_vel_m_per_s", "damping_ratio"))?,
    })
}
