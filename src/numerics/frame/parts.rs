//! Members and links of a description as parts between degrees of freedom.

use super::error::listed;
use super::fibre::Fibres;
use super::inelastic::{self, Basic, HingeLaw, Place};
use super::member::{Chord, Matrix};
use super::model::{FrameModel, Motion};
use super::{FrameError, FrameSpec, LinkDirection, MemberKind, MemberSpec};
use crate::law::{LawSpec, Reach};

/// Most sections along a member.
const MOST_POINTS: usize = 10;

/// A member or a link.
pub(super) struct Part<'a> {
    /// Number from 1, name, and whether it is recorded.
    pub(super) title: (usize, String, bool),
    pub(super) kind: PartKind<'a>,
}

pub(super) enum PartKind<'a> {
    /// The stiffness of an elastic member at its ends, and its rigidity along.
    Elastic(Ends<'a>, Matrix, f64),
    /// A member that is evaluated in each step.
    Inelastic(Ends<'a>, Place, Basic),
    /// With what its user declared, and whether it acts on rotations.
    Link(Place, Basic, (Reach, bool)),
}

/// Both ends of a member.
#[derive(Clone, Copy)]
pub(super) struct Ends<'a> {
    pub(super) chord: Chord,
    pub(super) motions: [&'a [Motion; 3]; 2],
    pub(super) p_delta: bool,
}

impl FrameSpec {
    /// All members, then all links.
    pub(super) fn parts<'a>(
        &self,
        model: &'a FrameModel,
        influence: &[f64],
    ) -> Result<Vec<Part<'a>>, FrameError> {
        let mut parts = Vec::with_capacity(self.member.len() + self.link.len());
        for (index, spec) in self.member.iter().enumerate() {
            let name = self.name_of(index + 1);
            let kind = self.member_part(index, &name, spec, model, influence)?;
            if spec.record && matches!(kind, PartKind::Elastic(..)) {
                return Err(FrameError::Unfit {
                    at: ("member", index),
                    key: "record",
                    name,
                    why: "is elastic and cannot be recorded: its forces follow from the displacements",
                });
            }
            let title = (index + 1, name, spec.record);
            parts.push(Part { title, kind });
        }
        for index in 0..self.link.len() {
            parts.push(self.link_part(index, model, influence)?);
        }
        Ok(parts)
    }

    fn member_part<'a>(
        &self,
        index: usize,
        name: &str,
        spec: &MemberSpec,
        model: &'a FrameModel,
        influence: &[f64],
    ) -> Result<PartKind<'a>, FrameError> {
        let at = ("member", index);
        let unfit = |key, why| FrameError::Unfit {
            at,
            key,
            name: name.to_owned(),
            why,
        };
        let [start, end] = &spec.nodes;
        let nodes = [self.place(at, start)?, self.place(at, end)?];
        let chord = Chord::new(
            [spec.offset_start_m, spec.offset_end_m],
            nodes.map(|node| self.node[node].at_m),
        );
        let chord =
            chord.ok_or_else(|| unfit("nodes", "has no length: its ends lie at one place"))?;
        let ends = Ends {
            chord,
            motions: nodes.map(|node| &model.motions[node]),
            p_delta: spec.p_delta,
        };
        let section = self.section_named(index, &spec.section)?;
        let hinges = [&spec.hinge_start, &spec.hinge_end];
        let is_fibre = matches!(
            spec.kind,
            MemberKind::ForceBased | MemberKind::DisplacementBased
        );
        if spec.kind != MemberKind::Elastic {
            if hinges.iter().any(|hinge| hinge.is_some()) {
                let key = if hinges[0].is_some() {
                    "hinge_start"
                } else {
                    "hinge_end"
                };
                return Err(unfit(
                    key,
                    "cannot have hinges: only an elastic member has them",
                ));
            }
            if !spec.release.is_empty() {
                return Err(unfit(
                    "release",
                    "cannot be released: only an elastic member can",
                ));
            }
            if section.fibres.is_empty() {
                return Err(unfit(
                    "section",
                    "needs a section with a `material` or with `fibres`",
                ));
            }
        }
        if let Some(found) = spec.points {
            if !is_fibre {
                return Err(unfit(
                    "points",
                    "has no points: only a fibre member has them",
                ));
            }
            if !(2..=MOST_POINTS).contains(&found) {
                return Err(FrameError::Value {
                    at,
                    key: "points",
                    found: found as f64,
                    allowed: "2 to 10",
                });
            }
        }
        let rigidity = || {
            let given = section.rigidity();
            given.ok_or_else(|| {
                unfit(
                    "section",
                    "is elastic and needs a section whose elastic centre lies on its axis",
                )
            })
        };
        let fibres = |sections: usize| Fibres::new(sections, &section.fibres, &section.materials);
        let basic = match spec.kind {
            MemberKind::Elastic if hinges.iter().all(|hinge| hinge.is_none()) => {
                let rigidity = rigidity()?;
                let stiffness = chord.stiffness(rigidity, &spec.release);
                return Ok(PartKind::Elastic(
                    ends,
                    stiffness,
                    rigidity.axial / chord.length,
                ));
            }
            MemberKind::Elastic => {
                if !spec.release.is_empty() {
                    return Err(unfit("release", "has a hinge and cannot be released, too"));
                }
                let laws = [
                    self.hinge(at, "hinge_start", hinges[0].as_ref())?,
                    self.hinge(at, "hinge_end", hinges[1].as_ref())?,
                ];
                let rigidity = rigidity()?;
                // Two hinges that soften alike are stable up to this slope, and one up to twice it.
                let most = 2.0 * rigidity.bending / chord.length;
                let ends = laws.iter().zip(["hinge_start", "hinge_end"]);
                for ((law, _), key) in ends.filter_map(|(law, key)| Some((law.as_ref()?, key))) {
                    let found = law.steepest_softening();
                    if found >= most {
                        return Err(FrameError::SnapBack {
                            index,
                            key,
                            name: name.to_owned(),
                            found,
                            most,
                        });
                    }
                }
                inelastic::hinged(chord.length, rigidity, laws)
            }
            MemberKind::ForceBased => {
                let points = spec.points.unwrap_or(5);
                inelastic::force_based(chord.length, points, fibres(points))
            }
            MemberKind::DisplacementBased => {
                let points = spec.points.unwrap_or(3);
                Some(inelastic::displacement_based(
                    chord.length,
                    points,
                    fibres(points),
                ))
            }
            MemberKind::Truss => Some(inelastic::truss(chord.length, fibres(1))),
        };
        let basic = basic.ok_or_else(|| unfit("section", "has no stiffness"))?;
        let terms = chord.deformations().map(|row| of_nodes(&row, ends.motions));
        Ok(PartKind::Inelastic(
            ends,
            Place::new(terms, influence),
            basic,
        ))
    }

    /// The law of a hinge, and its moment at yield.
    fn hinge(
        &self,
        at: (&'static str, usize),
        key: &'static str,
        name: Option<&String>,
    ) -> Result<Option<HingeLaw>, FrameError> {
        let Some(name) = name else { return Ok(None) };
        let spec = self.hinge.get(name).ok_or_else(|| FrameError::NoHinge {
            at,
            key,
            name: name.clone(),
            known: listed(self.hinge.keys()),
        })?;
        let law = spec.build().map_err(|source| FrameError::Law {
            at: ("hinge", None),
            name: name.clone(),
            source,
        })?;
        let stiffness = law.reference().stiffness;
        // Laws whose tangent is never above the first one, and whose steepest fall is known.
        let is_bounded = match spec {
            LawSpec::Linear(_)
            | LawSpec::Bilinear(_)
            | LawSpec::BoucWen(_)
            | LawSpec::Imk(_)
            | LawSpec::Hysteretic(_)
            | LawSpec::Pinching4(_) => law
                .bound(Reach::default())
                .0
                .is_some_and(|bound| bound <= stiffness),
            _ => false,
        };
        if !is_bounded || stiffness <= 0.0 || !stiffness.is_finite() || law.resists_velocity() {
            return Err(FrameError::NotAHinge { name: name.clone() });
        }
        Ok(Some((law, spec.yield_force())))
    }

    fn link_part<'a>(
        &self,
        index: usize,
        model: &'a FrameModel,
        influence: &[f64],
    ) -> Result<Part<'a>, FrameError> {
        let (at, spec) = (("link", index), &self.link[index]);
        let name = self.name_of(self.member.len() + index + 1);
        let [start, end] = &spec.nodes;
        let nodes = [self.place(at, start)?, self.place(at, end)?];
        let row = match spec.direction {
            LinkDirection::X => [-1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            LinkDirection::Y => [0.0, -1.0, 0.0, 0.0, 1.0, 0.0],
            LinkDirection::Rz => [0.0, 0.0, -1.0, 0.0, 0.0, 1.0],
            LinkDirection::Axial => {
                let chord = Chord::new([[0.0; 2]; 2], nodes.map(|node| self.node[node].at_m));
                let chord = chord.ok_or_else(|| FrameError::Unfit {
                    at,
                    key: "direction",
                    name: name.clone(),
                    why: "has no length and no axial direction: use \"x\", \"y\" or \"rz\"",
                })?;
                chord.deformations()[0]
            }
        };
        let law = spec.law.build().map_err(|source| FrameError::Law {
            at: ("link", Some(index)),
            name: name.clone(),
            source,
        })?;
        let terms = of_nodes(&row, nodes.map(|node| &model.motions[node]));
        if terms.is_empty() {
            return Err(FrameError::Unfit {
                at,
                key: "nodes",
                name,
                why: "is never deformed: both of its ends move alike",
            });
        }
        let reach = Reach {
            disp: spec.reach_disp_m,
            vel: spec.reach_vel_m_per_s,
        };
        let place = Place::new([terms, Vec::new(), Vec::new()], influence);
        let turns = spec.direction == LinkDirection::Rz;
        let kind = PartKind::Link(place, Basic::Link(law), (reach, turns));
        let title = (self.member.len() + index + 1, name, spec.record);
        Ok(Part { title, kind })
    }
}

/// Terms of a row over the directions of two nodes.
fn of_nodes(row: &[f64; 6], motions: [&[Motion; 3]; 2]) -> Vec<(usize, f64)> {
    let mut terms: Vec<(usize, f64)> = Vec::new();
    for (coefficient, motion) in row.iter().zip(motions.into_iter().flatten()) {
        for (dof, share) in motion {
            match terms.iter_mut().find(|(known, _)| known == dof) {
                Some((_, sum)) => *sum += coefficient * share,
                None => terms.push((*dof, coefficient * share)),
            }
        }
    }
    terms.retain(|(_, coefficient)| *coefficient != 0.0);
    terms
}

impl Ends<'_> {
    /// Displacements of both nodes.
    pub(super) fn moved(&self, disp: &[f64]) -> [f64; 6] {
        let mut moved = [0.0; 6];
        for (to, motion) in moved.iter_mut().zip(self.motions.into_iter().flatten()) {
            *to = motion.iter().map(|(dof, share)| share * disp[*dof]).sum();
        }
        moved
    }
}

impl<'a> Part<'a> {
    /// Both ends of a member; none of a link.
    pub(super) const fn ends(&self) -> Option<Ends<'a>> {
        match self.kind {
            PartKind::Elastic(ends, ..) | PartKind::Inelastic(ends, ..) => Some(ends),
            PartKind::Link(..) => None,
        }
    }

    /// Axial force and the moments at both ends, at displacements of the frame, from the first stiffness.
    pub(super) fn first_forces(&self, disp: &[f64]) -> [f64; 3] {
        match &self.kind {
            PartKind::Elastic(ends, matrix, along) => {
                let [stretch, ..] = ends.chord.deformations();
                let moved = ends.moved(disp);
                let times = |row: &[f64; 6]| -> f64 {
                    row.iter().zip(moved).map(|(row, moved)| row * moved).sum()
                };
                let [start, end] = ends.chord.moments(matrix.each_ref().map(times));
                [along * times(&stretch), start, end]
            }
            PartKind::Inelastic(_, place, basic) => basic.first_force(place, disp),
            PartKind::Link(..) => [0.0; 3],
        }
    }
}
