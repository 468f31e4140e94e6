//! Members and links of a description as parts between degrees of freedom.

use super::corotation::Corotation;
use super::error::{finite, listed};
use super::fibre::Fibres;
use super::inelastic::{self, Basic, Declared, HingeLaw, Moving, Place};
use super::member::{Beside, Chord, ChordInSpace, Matrix};
use super::model::{FrameModel, Motion};
use super::section::Section;
use super::symmetric::Sym;
use super::{Direction, FrameError, FrameSpec, MemberKind, MemberSpec};
use crate::law::{LawSpec, Reach};
use std::f64::consts::FRAC_PI_2;

/// Most sections along a member.
const MOST_POINTS: usize = 10;

/// A member or a link.
pub(super) struct Part<'a> {
    /// Number from 1, name, and whether it is recorded.
    pub(super) title: (usize, String, bool),
    pub(super) kind: PartKind<'a>,
}

pub(super) enum PartKind<'a> {
    /// An elastic member.
    Elastic(Ends<'a>, Box<Linear<'a>>),
    /// A member that is evaluated in each step, with what stays linear.
    Inelastic(
        Ends<'a>,
        Place,
        (Basic, Option<Beside>),
        Option<Box<Moving>>,
    ),
    /// With what its user declared, and whether it acts on rotations.
    Link(Place, Basic, (Reach, bool)),
}

/// Stiffness of an elastic member.
pub(super) enum Linear<'a> {
    /// In a plane: at its ends, and its rigidity along.
    Plane(Ends<'a>, Chord, Matrix, f64),
    /// In space.
    Space(Place, Sym<6>),
}

/// Both ends of a member.
#[derive(Clone, Copy)]
pub(super) struct Ends<'a> {
    pub(super) chord: Line,
    pub(super) motions: [&'a [Motion; 6]; 2],
    pub(super) p_delta: bool,
}

/// A member between two points.
#[derive(Clone, Copy)]
pub(super) enum Line {
    Plane(Chord),
    Space(ChordInSpace),
}

impl Line {
    pub(super) const fn length(&self) -> f64 {
        match self {
            Self::Plane(chord) => chord.length,
            Self::Space(chord) => chord.length,
        }
    }
}

impl Linear<'_> {
    /// As [`Part::first_forces`].
    fn first_forces(&self, disp: &[f64]) -> [f64; 6] {
        match self {
            Self::Plane(ends, chord, matrix, along) => {
                let [stretch, ..] = chord.deformations();
                let moved = ends.moved(disp);
                let times = |row: &[f64; 6]| -> f64 {
                    row.iter().zip(moved).map(|(row, moved)| row * moved).sum()
                };
                let [start, end] = chord.moments(matrix.each_ref().map(times));
                [along * times(&stretch), start, end, 0.0, 0.0, 0.0]
            }
            Self::Space(place, stiffness) => place.first_force(stiffness, disp),
        }
    }

    /// Entries (i ≤ j, value) at the degrees of freedom.
    pub(super) fn entries(&self) -> Vec<(usize, usize, f64)> {
        match self {
            Self::Plane(ends, _, matrix, _) => spread(ends.motions, matrix),
            Self::Space(place, stiffness) => place.matrix(stiffness),
        }
    }
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
        let offsets = [
            self.coordinates(at, "offset_start_m", &spec.offset_start_m, true)?,
            self.coordinates(at, "offset_end_m", &spec.offset_end_m, true)?,
        ];
        let chord = self.line(at, nodes, offsets, spec.orientation)?;
        let chord = chord.ok_or_else(|| {
            let why = match spec.orientation {
                Some(_) => "has no length, or lies along its `orientation`",
                None => "has no length: its ends lie at one place",
            };
            unfit("nodes", why)
        })?;
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
        let in_space = matches!(chord, Line::Space(_));
        for (key, is_given) in [
            ("orientation", spec.orientation.is_some()),
            ("torsion_n_m2", spec.torsion_n_m2.is_some()),
        ] {
            if is_given && !in_space {
                return Err(unfit(
                    key,
                    "lies in a plane frame, which does not have this key",
                ));
            }
        }
        let length = chord.length();
        let torsion = if in_space && spec.kind != MemberKind::Truss {
            self.torsion(index, name, spec, &section)?
        } else {
            0.0
        };
        let beside = |weak: f64| {
            let (weak, torsion) = (weak / length, torsion / length);
            in_space.then_some(Beside { weak, torsion })
        };
        let fibres = |sections: usize| Fibres::new(sections, &section.fibres, &section.materials);
        let basic = match spec.kind {
            MemberKind::Elastic
                if hinges.iter().all(|hinge| hinge.is_none()) && spec.corotational.is_none() =>
            {
                let mut rigidity = rigidity()?;
                let linear = match chord {
                    Line::Plane(chord) => {
                        let stiffness = chord.stiffness(rigidity, &spec.release);
                        Linear::Plane(ends, chord, stiffness, rigidity.axial / length)
                    }
                    Line::Space(chord) => {
                        rigidity.torsion = torsion;
                        let place = ends.place(influence);
                        Linear::Space(place, chord.stiffness(rigidity, &spec.release))
                    }
                };
                return Ok(PartKind::Elastic(ends, Box::new(linear)));
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
                let [first, second] = hinges.map(Option::is_some);
                if !first && !second && !spec.release.is_empty() {
                    return Err(unfit(
                        "release",
                        "is corotational and cannot be released: give it a soft hinge",
                    ));
                }
                // Two hinges that soften alike are stable up to this slope, and one up to twice it.
                let most = 2.0 * rigidity.bending / length;
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
                let hinged = inelastic::hinged(length, rigidity, laws);
                hinged.map(|hinged| (hinged, beside(rigidity.weak)))
            }
            MemberKind::ForceBased => {
                let points = spec.points.unwrap_or(5);
                let member = inelastic::force_based(length, points, fibres(points), in_space);
                member.map(|member| (member, beside(0.0)))
            }
            MemberKind::DisplacementBased => {
                let points = spec.points.unwrap_or(3);
                let fibres = fibres(points);
                let member = inelastic::displacement_based(length, points, fibres, in_space);
                Some((member, beside(0.0)))
            }
            MemberKind::Truss => Some((inelastic::truss(length, fibres(1)), None)),
        };
        let basic = basic.ok_or_else(|| unfit("section", "has no stiffness"))?;
        let mut place = ends.place(influence);
        if spec.kind == MemberKind::Truss {
            place = place.stretched();
        }
        let axial = basic.0.initial()[0][0];
        let moving = self.moving(index, name, spec, (&ends, &place, axial), influence)?;
        Ok(PartKind::Inelastic(ends, place, basic, moving))
    }

    /// Corotational geometry, of a member that asks for it.
    fn moving(
        &self,
        index: usize,
        name: &str,
        spec: &MemberSpec,
        (ends, place, axial): (&Ends<'_>, &Place, f64),
        influence: &[f64],
    ) -> Result<Option<Box<Moving>>, FrameError> {
        let at = ("member", index);
        let Some(given) = spec.corotational else {
            return Ok(None);
        };
        let has_offset = [&spec.offset_start_m, &spec.offset_end_m]
            .into_iter()
            .flatten()
            .any(|offset| *offset != 0.0);
        for (key, is_given, why) in [
            (
                "p_delta",
                spec.p_delta,
                "is corotational, which has the P-Δ effect already",
            ),
            (
                "offset_start_m",
                has_offset,
                "is corotational and cannot have rigid offsets",
            ),
            (
                "kind",
                spec.kind == MemberKind::Truss,
                "is a truss and cannot be corotational",
            ),
        ] {
            if is_given {
                let name = name.to_owned();
                return Err(FrameError::Unfit { at, key, name, why });
            }
        }
        let (tension, rotation) = (given.largest_tension_n, given.largest_rotation_rad);
        for found in [tension, rotation.unwrap_or(0.0)] {
            if !(found >= 0.0 && found.is_finite()) {
                return Err(FrameError::Value {
                    at,
                    key: "corotational",
                    found,
                    allowed: "a tension and a rotation that are finite and not negative",
                });
            }
        }
        let of = match ends.chord {
            Line::Plane(chord) => Corotation::Plane(chord),
            Line::Space(chord) => Corotation::Space(chord),
        };
        let motions: Vec<&[(usize, f64)]> = match ends.chord {
            Line::Plane(_) => in_plane(ends.motions).map(Vec::as_slice).collect(),
            Line::Space(_) => ends
                .motions
                .into_iter()
                .flatten()
                .map(Vec::as_slice)
                .collect(),
        };
        // E A/L sin² of the rotation acts across the axis at rest.
        let (length, angle) = (ends.chord.length(), rotation.unwrap_or(0.0).min(FRAC_PI_2));
        let sine = libm::sin(angle);
        let across = tension + axial * length * sine * sine;
        let declared = Declared {
            tension,
            rotation,
            stiffening: ends.geometric_stiffness(across),
        };
        let moving = Moving::new(of, &motions, declared, place, influence);
        Ok(Some(Box::new(moving)))
    }

    /// The line between two nodes; `None` without a length, or along its orientation.
    fn line(
        &self,
        at: (&'static str, usize),
        nodes: [usize; 2],
        offsets: [[f64; 3]; 2],
        orientation: Option<[f64; 3]>,
    ) -> Result<Option<Line>, FrameError> {
        let mut places = [[0.0; 3]; 2];
        for (place, node) in places.iter_mut().zip(nodes) {
            *place = self.coordinates(("node", node), "at_m", &self.node[node].at_m, false)?;
        }
        for found in orientation.iter().flatten() {
            finite(at, "orientation", *found)?;
        }
        let flat = |all: [[f64; 3]; 2]| all.map(|[x, y, _]| [x, y]);
        Ok(match self.dimension {
            3 => ChordInSpace::new(offsets, places, orientation).map(Line::Space),
            _ => Chord::new(flat(offsets), flat(places)).map(Line::Plane),
        })
    }

    /// G J of a member in space.
    fn torsion(
        &self,
        index: usize,
        name: &str,
        spec: &MemberSpec,
        section: &Section,
    ) -> Result<f64, FrameError> {
        let at = ("member", index);
        match spec.torsion_n_m2 {
            Some(found) if !(found > 0.0 && found.is_finite()) => Err(FrameError::Value {
                at,
                key: "torsion_n_m2",
                found,
                allowed: "finite and greater than 0",
            }),
            Some(given) => Ok(given),
            None if section.torsion() > 0.0 => Ok(section.torsion()),
            None => Err(FrameError::Unfit {
                at,
                key: "section",
                name: name.to_owned(),
                why: "needs `torsion_n_m2`, its G J in space: reinforced concrete and single fibres do not tell it",
            }),
        }
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
            LawSpec::Linear(_) | LawSpec::Bilinear(_) | LawSpec::BoucWen(_) | LawSpec::Imk(_) => {
                law.bound(Reach::default())
                    .0
                    .is_some_and(|bound| bound <= stiffness)
            }
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
        let motions = nodes.map(|node| &model.motions[node]);
        let unfit = |key, why| FrameError::Unfit {
            at,
            key,
            name: name.clone(),
            why,
        };
        let along = |direction: Direction| {
            let row = [-1.0, 1.0];
            let each = row.iter().zip(motions.map(|of| &of[direction as usize]));
            of_nodes(each)
        };
        let wrong = |source| FrameError::Law {
            at: ("link", Some(index)),
            name: name.clone(),
            source,
        };
        let reach = Reach {
            disp: spec.reach_disp_m,
            vel: spec.reach_vel_m_per_s,
        };
        let number = self.member.len() + index + 1;
        let (terms, basic, turns) = match (&spec.law, spec.direction, &spec.bearing) {
            (Some(law), Some(direction), None) => {
                let law = law.build().map_err(wrong)?;
                let terms = match direction.of_nodes() {
                    Some(direction) => {
                        self.in_frame(at, "direction", direction)?;
                        along(direction)
                    }
                    None => {
                        let line = self.line(at, nodes, [[0.0; 3]; 2], None)?;
                        let why =
                            "has no length and no axial direction: use the direction of a node";
                        let line = line.ok_or_else(|| unfit("direction", why))?;
                        let mut rows = line.deformations(motions);
                        rows.swap_remove(0)
                    }
                };
                let turns = direction.of_nodes().is_some_and(Direction::turns);
                (vec![terms], Basic::Link(law), turns)
            }
            (None, None, Some(bearing)) => {
                self.in_frame(at, "bearing", Direction::Z)?;
                let axes = bearing.axes();
                let built = bearing.build(axes).map_err(wrong)?;
                let directions = [Direction::X, Direction::Y, Direction::Z];
                let terms = directions.into_iter().take(axes).map(along).collect();
                (terms, Basic::Bearing(Box::new(built)), false)
            }
            (None, _, Some(_)) => {
                return Err(unfit("direction", "is a bearing, which has no `direction`"));
            }
            (_, None, _) => return Err(unfit("nodes", "has no `direction`")),
            _ => return Err(unfit("nodes", "needs either a `law` or a `bearing`")),
        };
        if terms.iter().all(Vec::is_empty) {
            return Err(unfit(
                "nodes",
                "is never deformed: both of its ends move alike",
            ));
        }
        let place = Place::new(terms, influence);
        let kind = PartKind::Link(place, basic, (reach, turns));
        let title = (number, name, spec.record);
        Ok(Part { title, kind })
    }
}

/// Terms of a row over directions of nodes.
fn of_nodes<'a>(row: impl Iterator<Item = (&'a f64, &'a Motion)>) -> Vec<(usize, f64)> {
    let mut terms: Vec<(usize, f64)> = Vec::new();
    for (coefficient, motion) in row {
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

/// The directions of a plane, at both nodes.
fn in_plane<'a>(motions: [&'a [Motion; 6]; 2]) -> impl Iterator<Item = &'a Motion> {
    let of_node =
        |node: &'a [Motion; 6]| Direction::PLANE.map(|direction| &node[direction as usize]);
    motions.into_iter().flat_map(of_node)
}

/// Entries of a matrix of two nodes, at the degrees of freedom that these are made of; each beside the diagonal once.
fn spread(ends: [&[Motion; 6]; 2], matrix: &Matrix) -> Vec<(usize, usize, f64)> {
    let motions: Vec<&Motion> = in_plane(ends).collect();
    let mut entries = Vec::new();
    for (row, of_row) in matrix.iter().zip(&motions) {
        for (value, of_column) in row.iter().zip(&motions) {
            for (i, a) in of_row.iter() {
                for (j, b) in of_column.iter().filter(|(j, _)| i <= j) {
                    entries.push((*i, *j, a * value * b));
                }
            }
        }
    }
    entries
}

impl Line {
    /// Terms of each deformation: three in a plane, six in space.
    fn deformations(&self, motions: [&[Motion; 6]; 2]) -> Vec<Vec<(usize, f64)>> {
        match self {
            Self::Plane(chord) => {
                let rows = chord.deformations();
                let of = |row: &[f64; 6]| of_nodes(row.iter().zip(in_plane(motions)));
                rows.iter().map(of).collect()
            }
            Self::Space(chord) => {
                let rows = chord.deformations();
                let of = |row: &[f64; 12]| of_nodes(row.iter().zip(motions.into_iter().flatten()));
                rows.iter().map(of).collect()
            }
        }
    }
}

impl Ends<'_> {
    fn place(&self, influence: &[f64]) -> Place {
        Place::new(self.chord.deformations(self.motions), influence)
    }

    /// Displacements of both nodes of a plane frame.
    fn moved(&self, disp: &[f64]) -> [f64; 6] {
        let mut moved = [0.0; 6];
        for (to, motion) in moved.iter_mut().zip(in_plane(self.motions)) {
            *to = motion.iter().map(|(dof, share)| share * disp[*dof]).sum();
        }
        moved
    }

    /// Entries of N/L across the member, for an axial force N at the displaced ends.
    pub(super) fn geometric_stiffness(&self, force: f64) -> Vec<(usize, usize, f64)> {
        match &self.chord {
            Line::Plane(chord) => spread(self.motions, &chord.geometric_stiffness(force)),
            Line::Space(chord) => {
                let [_, across, aside] = chord.drifts();
                let terms = [across, aside].map(|row| {
                    let each = row.iter().zip(self.motions.into_iter().flatten());
                    of_nodes(each)
                });
                let of = force / chord.length;
                let mut stiffness = [[0.0; 6]; 6];
                (stiffness[0][0], stiffness[1][1]) = (of, of);
                Place::of(terms).matrix(&stiffness)
            }
        }
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

    /// Axial force, moments at both ends about z, and in space about y, and torque, at displacements of the frame, from the first
    /// stiffness.
    pub(super) fn first_forces(&self, disp: &[f64]) -> [f64; 6] {
        match &self.kind {
            PartKind::Elastic(_, linear) => linear.first_forces(disp),
            PartKind::Inelastic(_, place, (basic, beside), _) => {
                let stiffness = inelastic::with(basic.initial(), beside.as_ref());
                place.first_force(&stiffness, disp)
            }
            PartKind::Link(..) => [0.0; 6],
        }
    }
}
