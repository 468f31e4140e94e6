//! From a description to M, K and the static load of the free directions.

use super::error::{finite, listed};
use super::inelastic::{Members, with};
use super::model::{FrameModel, Motion, influence};
use super::parts::{Part, PartKind};
use super::{ConstraintSpec, Direction, FrameError, FrameSpec};
use crate::law::Reach;
use crate::linalg::{Spd, SymMatrix};

/// Steps of the bisection for a buckling load.
const HALVINGS: u32 = 40;

impl FrameSpec {
    /// M, K and static load.
    ///
    /// # Errors
    /// See [`FrameError`].
    pub fn model(&self) -> Result<FrameModel, FrameError> {
        let mut model = self.numbered()?;
        let n = model.dofs.len();
        let mut mass = Vec::new();
        for (index, (node, motions)) in self.node.iter().zip(&model.motions).enumerate() {
            let [about_x, about_y] = node.tilting_mass_kg_m2;
            let given = [
                ("mass_kg", node.mass_kg),
                ("rotary_mass_kg_m2", node.rotary_mass_kg_m2),
                ("tilting_mass_kg_m2", about_x),
                ("tilting_mass_kg_m2", about_y),
            ];
            for (key, found) in given {
                if !(found >= 0.0 && found.is_finite()) {
                    let (at, allowed) = (("node", index), "finite and not negative");
                    return Err(FrameError::Value {
                        at,
                        key,
                        found,
                        allowed,
                    });
                }
            }
            if self.dimension == 2 && node.tilting_mass_kg_m2 != [0.0; 2] {
                let (at, key, direction) = (("node", index), "tilting_mass_kg_m2", Direction::Rx);
                return Err(FrameError::NotInPlane { at, key, direction });
            }
            let m = node.mass_kg;
            let mut of_direction = [m, m, m, about_x, about_y, node.rotary_mass_kg_m2];
            for direction in &node.massless {
                self.in_frame(("node", index), "massless", *direction)?;
                of_direction[*direction as usize] = 0.0;
            }
            for (motion, value) in motions.iter().zip(of_direction) {
                mass.extend(square(motion, value));
            }
        }
        model.mass = SymMatrix::from_triplets(n, mass);
        model.load = self.load_of(&model)?;
        let parts = self.parts(&model, &influence(&model.dofs))?;
        let (mut linear, mut members) = (Vec::new(), Vec::new());
        let (mut of_rule, mut own) = (Vec::new(), Vec::new());
        for (index, part) in parts.iter().enumerate() {
            let (to, entries) = match &part.kind {
                PartKind::Elastic(_, stiffness) => (&mut linear, stiffness.entries()),
                PartKind::Inelastic(_, place, (basic, beside), _) => {
                    let stiffness = with(basic.initial(), beside.as_ref());
                    (&mut members, place.matrix(&stiffness))
                }
                PartKind::Link(place, basic, _) => (&mut members, place.matrix(&basic.initial())),
            };
            match self.own_coefficient(index)? {
                None => of_rule.extend_from_slice(&entries),
                Some(0.0) => {}
                Some(b) => own.extend(entries.iter().map(|(i, j, k)| (*i, *j, b * k))),
            }
            to.extend(entries);
        }
        let damped = [of_rule, own].map(|entries| SymMatrix::from_triplets(n, entries));
        let linear = SymMatrix::from_triplets(n, linear);
        let stiffness = linear.plus(1.0, &SymMatrix::from_triplets(n, members));
        model.check_massless(&stiffness)?;
        let geometric = self.geometric(&model, &stiffness, &parts)?;
        let mut of_members = Members::default();
        for part in parts {
            match part.kind {
                PartKind::Elastic(..) => {}
                PartKind::Inelastic(_, place, basic, moving) => {
                    let reach = (Reach::default(), false);
                    of_members.push(part.title, place, basic, moving, reach);
                }
                PartKind::Link(place, basic, declared) => {
                    of_members.push(part.title, place, (basic, None), None, declared);
                }
            }
        }
        model.members = of_members;
        model.damped = damped;
        model.stiffness = stiffness.plus(1.0, &geometric);
        model.linear = linear.plus(1.0, &geometric);
        Ok(model)
    }

    /// Node and direction of each degree of freedom; empty for a frame that is not valid.
    #[must_use]
    pub fn places(&self) -> Vec<(String, Direction)> {
        self.numbered()
            .map_or_else(|_| Vec::new(), |model| model.dofs)
    }

    /// ι: displacement of each degree of freedom for a unit displacement of the ground to the right.
    #[must_use]
    pub fn influence(&self) -> Vec<f64> {
        influence(&self.places())
    }

    /// One number for each axis, the third of a plane frame being 0. An empty list is one of zeros if it may be.
    pub(super) fn coordinates(
        &self,
        at: (&'static str, usize),
        key: &'static str,
        given: &[f64],
        may_be_empty: bool,
    ) -> Result<[f64; 3], FrameError> {
        let mut out = [0.0; 3];
        let wanted = self.dimension;
        if given.len() != wanted && !(given.is_empty() && may_be_empty) {
            let found = given.len();
            return Err(FrameError::Coordinates {
                at,
                key,
                found,
                wanted,
            });
        }
        for (out, &found) in out.iter_mut().zip(given) {
            *out = finite(at, key, found)?;
        }
        Ok(out)
    }

    /// Refuses a direction that only a space frame has.
    pub(super) fn in_frame(
        &self,
        at: (&'static str, usize),
        key: &'static str,
        direction: Direction,
    ) -> Result<(), FrameError> {
        if self.directions().contains(&direction) {
            return Ok(());
        }
        Err(FrameError::NotInPlane { at, key, direction })
    }

    /// ι of a unit displacement of the ground in a direction.
    #[must_use]
    pub fn influence_in(&self, direction: Direction) -> Vec<f64> {
        let places = self.places();
        let own = places.iter().map(|(_, own)| *own == direction);
        own.map(f64::from).collect()
    }

    /// The free directions, with empty matrices.
    fn numbered(&self) -> Result<FrameModel, FrameError> {
        if !(2..=3).contains(&self.dimension) {
            return Err(FrameError::Dimension(self.dimension));
        }
        for (index, node) in self.node.iter().enumerate() {
            if self.node[..index]
                .iter()
                .any(|other| other.name == node.name)
            {
                let name = node.name.clone();
                return Err(FrameError::SameName { index, name });
            }
            let at = ("node", index);
            self.coordinates(at, "at_m", &node.at_m, false)?;
            for direction in &node.fixed {
                self.in_frame(at, "fixed", *direction)?;
            }
        }
        let mut ties = vec![[None; 6]; self.node.len()];
        for (index, constraint) in self.constraint.iter().enumerate() {
            self.tie(index, constraint, &mut ties)?;
        }
        for tie in ties.iter().flatten().flatten() {
            for (direction, lever) in Direction::ALL.into_iter().zip(tie.levers) {
                if lever != 0.0 && ties[tie.master][direction as usize].is_some() {
                    return Err(FrameError::Constrained {
                        index: tie.constraint,
                        node: self.node[tie.master].name.clone(),
                        direction,
                        why: "is followed, but follows another node itself",
                    });
                }
            }
        }
        let mut dofs = Vec::new();
        let mut motions = vec![<[Motion; 6]>::default(); self.node.len()];
        for (place, node) in self.node.iter().enumerate() {
            for &direction in self.directions() {
                let at = direction as usize;
                if ties[place][at].is_none() && !node.fixed.contains(&direction) {
                    motions[place][at] = vec![(dofs.len(), 1.0)];
                    dofs.push((node.name.clone(), direction));
                }
            }
        }
        for (place, ties) in ties.iter().enumerate() {
            for (at, tie) in ties.iter().enumerate() {
                let Some(tie) = tie else { continue };
                let terms = tie.levers.iter().zip(&motions[tie.master]);
                let terms = terms.filter(|(lever, _)| **lever != 0.0);
                let terms = terms.flat_map(|(lever, motion)| {
                    motion.iter().map(move |(dof, share)| (*dof, lever * share))
                });
                motions[place][at] = terms.collect();
            }
        }
        if dofs.is_empty() {
            return Err(FrameError::Empty);
        }
        let n = dofs.len();
        Ok(FrameModel {
            mass: SymMatrix::zeros(n),
            linear: SymMatrix::zeros(n),
            members: Members::default(),
            stiffness: SymMatrix::zeros(n),
            damped: [0, 1].map(|_| SymMatrix::zeros(n)),
            load: vec![0.0; n],
            dofs,
            motions,
            names: self.node.iter().map(|node| node.name.clone()).collect(),
        })
    }

    /// Notes what follows what.
    fn tie(
        &self,
        index: usize,
        constraint: &ConstraintSpec,
        ties: &mut [[Option<Tie>; 6]],
    ) -> Result<(), FrameError> {
        let (master, nodes, directions) = match constraint {
            ConstraintSpec::Equal(equal) => (&equal.master, &equal.nodes, &equal.directions[..]),
            ConstraintSpec::Rigid(rigid) => (&rigid.master, &rigid.nodes, self.directions()),
            ConstraintSpec::Diaphragm(floor) => {
                let directions = match self.dimension {
                    3 => &[Direction::X, Direction::Y, Direction::Rz][..],
                    _ => &[Direction::X],
                };
                (&floor.master, &floor.nodes, directions)
            }
        };
        let at = ("constraint", index);
        for direction in directions {
            self.in_frame(at, "directions", *direction)?;
        }
        let turns: &[Direction] = match constraint {
            ConstraintSpec::Equal(_) => &[],
            ConstraintSpec::Rigid(_) => directions,
            ConstraintSpec::Diaphragm(_) => match self.dimension {
                3 => &[Direction::Rz],
                _ => &[],
            },
        };
        let master = self.place(at, master)?;
        for name in nodes {
            let node = self.place(at, name)?;
            for &direction in directions {
                let which = direction as usize;
                let wrong = |node: usize, direction: Direction, why| FrameError::Constrained {
                    index,
                    node: self.node[node].name.clone(),
                    direction,
                    why,
                };
                if node == master {
                    return Err(wrong(node, direction, "would follow itself"));
                }
                if self.node[node].fixed.contains(&direction) {
                    return Err(wrong(node, direction, "is fixed and cannot follow"));
                }
                if ties[node][which].is_some() {
                    return Err(wrong(node, direction, "follows another node already"));
                }
                let mut levers = [0.0; 6];
                levers[which] = 1.0;
                let [from, to] = [master, node].map(|node| {
                    let at = &self.node[node].at_m;
                    [0, 1, 2].map(|k| at.get(k).copied().unwrap_or(0.0))
                });
                let [dx, dy, dz] = [0, 1, 2].map(|k| to[k] - from[k]);
                // u + θ × d.
                let of_turns = match direction {
                    Direction::X => [0.0, dz, -dy],
                    Direction::Y => [-dz, 0.0, dx],
                    Direction::Z => [dy, -dx, 0.0],
                    Direction::Rx | Direction::Ry | Direction::Rz => [0.0; 3],
                };
                for (turn, lever) in Direction::ALL[3..].iter().zip(of_turns) {
                    if turns.contains(turn) && !direction.turns() {
                        levers[*turn as usize] = lever;
                    }
                }
                ties[node][which] = Some(Tie {
                    constraint: index,
                    master,
                    levers,
                });
            }
        }
        Ok(())
    }

    /// Place of a node by its name.
    pub(super) fn place(&self, at: (&'static str, usize), name: &str) -> Result<usize, FrameError> {
        let found = self.node.iter().position(|node| node.name == name);
        found.ok_or_else(|| FrameError::NoNode {
            at,
            name: name.to_owned(),
            known: listed(self.node.iter().map(|node| &node.name)),
        })
    }

    fn load_of(&self, model: &FrameModel) -> Result<Vec<f64>, FrameError> {
        let mut load = vec![0.0; model.dofs.len()];
        for (index, given) in self.load.iter().enumerate() {
            let at = ("load", index);
            let node = self.place(at, &given.node)?;
            let each = given.each().into_iter().zip(Direction::ALL);
            for (((key, found), direction), motion) in each.zip(&model.motions[node]) {
                if found != 0.0 {
                    self.in_frame(at, key, direction)?;
                }
                finite(at, key, found)?;
                for (dof, share) in motion {
                    load[*dof] += share * found;
                }
            }
        }
        Ok(load)
    }

    /// What replaces the coefficient of K in a damping rule for a part: a member, or a link after all members.
    fn own_coefficient(&self, part: usize) -> Result<Option<f64>, FrameError> {
        let Some(member) = self.member.get(part) else {
            let link = self.link.get(part - self.member.len());
            return Ok(link.is_none_or(|link| !link.damped).then_some(0.0));
        };
        match member.stiffness_coefficient_s {
            Some(found) if !(found >= 0.0 && found.is_finite()) => Err(FrameError::Value {
                at: ("member", part),
                key: "stiffness_coefficient_s",
                found,
                allowed: "finite and not negative",
            }),
            given => Ok(given),
        }
    }

    /// Stiffness that the axial forces of the static loads add, where a member asks for it.
    fn geometric(
        &self,
        model: &FrameModel,
        stiffness: &SymMatrix,
        parts: &[Part<'_>],
    ) -> Result<SymMatrix, FrameError> {
        let n = model.dofs.len();
        let mut lowered = parts.iter().filter_map(|part| Some((part, part.ends()?)));
        if !lowered.clone().any(|(_, ends)| ends.p_delta) {
            return Ok(SymMatrix::zeros(n));
        }
        let at = |dof: usize| model.dofs[dof].clone();
        let mut factor = Spd::factor(stiffness).map_err(|failure| {
            let (node, direction) = at(failure.dof);
            FrameError::Loose { node, direction }
        })?;
        let mut disp = model.load.clone();
        factor.solve_in_place(&mut disp);
        let lowered = lowered.by_ref().filter(|(_, ends)| ends.p_delta);
        let entries =
            lowered.flat_map(|(part, ends)| ends.geometric_stiffness(part.first_forces(&disp)[0]));
        let geometric = SymMatrix::from_triplets(n, entries);
        let stands = |share: f64| Spd::factor(&stiffness.plus(share, &geometric));
        if stands(1.0).is_err() {
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if stands(middle).is_ok() {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            let nearly = stiffness.plus(low, &geometric);
            let (node, direction) = at(model.weakest(&nearly));
            return Err(FrameError::Buckles {
                share: low,
                node,
                direction,
            });
        }
        Ok(geometric)
    }
}

/// A direction that follows those of another node.
#[derive(Debug, Clone, Copy)]
struct Tie {
    constraint: usize,
    master: usize,
    /// Coefficients of the directions of the master.
    levers: [f64; 6],
}

/// value · a aᵀ of a motion.
fn square(motion: &Motion, value: f64) -> Vec<(usize, usize, f64)> {
    let each = motion.iter().enumerate();
    let pairs = each.flat_map(|(k, a)| motion[k..].iter().map(move |b| (a, b)));
    let entries = pairs.map(|(a, b)| (a.0, b.0, value * a.1 * b.1));
    entries.filter(|(.., value)| *value != 0.0).collect()
}
