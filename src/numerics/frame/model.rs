//! A frame as matrices, members and loads of its free directions.

use super::inelastic::Members;
use super::{Direction, FrameError};
use crate::linalg::{Spd, SymMatrix};

/// A frame without its constraints: n free directions.
#[derive(Debug)]
pub struct FrameModel {
    /// M in kg and kg m².
    pub mass: SymMatrix,
    /// K of elastic members in N/m, N and N m, with the P-Δ effect of all.
    pub linear: SymMatrix,
    /// The other members, and links.
    pub members: Members,
    /// K of all members at rest and of links, with the P-Δ effect.
    pub stiffness: SymMatrix,
    /// K that a damping rule multiplies by its coefficient, and C of members with their own coefficients. Without the P-Δ effect.
    pub damped: [SymMatrix; 2],
    /// Static load in N and N m.
    pub load: Vec<f64>,
    /// Node and direction of each degree of freedom.
    pub dofs: Vec<(String, Direction)>,
    /// What each direction of each node is made of, in the order of the description.
    pub(super) motions: Vec<[Motion; 6]>,
    pub(super) names: Vec<String>,
}

/// A direction of a node: Σ coefficient · degree of freedom; empty for a fixed one.
pub(super) type Motion = Vec<(usize, f64)>;

impl FrameModel {
    /// The terms of a direction of a node: (degree of freedom from 0, coefficient). `None` without such a node.
    #[must_use]
    pub fn motion(&self, node: &str, direction: Direction) -> Option<&[(usize, f64)]> {
        let place = self.names.iter().position(|name| name == node)?;
        Some(&self.motions[place][direction as usize])
    }

    /// Names of the nodes.
    #[must_use]
    pub fn nodes(&self) -> &[String] {
        &self.names
    }

    /// Refuses a direction without mass that nothing holds.
    pub(super) fn check_massless(&self, stiffness: &SymMatrix) -> Result<(), FrameError> {
        let is_massless = |dof: &usize| self.mass.get(*dof, *dof) == 0.0;
        let rows: Vec<usize> = (0..self.dofs.len()).filter(is_massless).collect();
        let block = stiffness.block(&rows);
        match unheld(&block) {
            None => Ok(()),
            Some(at) => {
                let (node, direction) = self.dofs[rows[at]].clone();
                Err(FrameError::Loose { node, direction })
            }
        }
    }

    /// The direction that moves most in a motion that no stiffness resists, if there is one.
    #[must_use]
    pub fn loose(&self) -> Option<FrameError> {
        unheld(&self.stiffness)?;
        let (node, direction) = self.dofs[self.weakest(&held(&self.stiffness))].clone();
        Some(FrameError::Loose { node, direction })
    }

    /// The degree of freedom that moves most where this stiffness nearly vanishes.
    pub(super) fn weakest(&self, stiffness: &SymMatrix) -> usize {
        let n = self.dofs.len();
        let mut shape: Vec<f64> = (0..n).map(|dof| 1.0 + dof as f64 / n as f64).collect();
        if let Ok(mut factor) = Spd::factor(stiffness) {
            for _ in 0..20 {
                factor.solve_in_place(&mut shape);
                let largest = shape.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
                shape.iter_mut().for_each(|x| *x /= largest);
            }
        }
        let moves = |dof: &usize| match self.dofs[*dof].1 {
            direction if direction.turns() => 0.0,
            _ => shape[*dof].abs(),
        };
        let all = 0..n;
        all.max_by(|a, b| moves(a).total_cmp(&moves(b)))
            .unwrap_or(0)
    }
}

/// Part of the diagonal of a stiffness that roundoff may leave of a pivot.
const ROUNDOFF: f64 = 1e-11;

/// A stiffness with roundoff more on its diagonal.
fn held(stiffness: &SymMatrix) -> SymMatrix {
    let n = stiffness.n();
    let largest = (0..n).fold(f64::MIN_POSITIVE, |most, i| {
        f64::max(most, stiffness.get(i, i))
    });
    let own = |i| match stiffness.get(i, i) {
        0.0 => ROUNDOFF * largest,
        own => ROUNDOFF * own,
    };
    stiffness.plus(
        1.0,
        &SymMatrix::diagonal(&(0..n).map(own).collect::<Vec<f64>>()),
    )
}

/// The place of the first pivot that is no more than roundoff.
fn unheld(stiffness: &SymMatrix) -> Option<usize> {
    let n = stiffness.n();
    let less: Vec<f64> = (0..n).map(|i| ROUNDOFF * stiffness.get(i, i)).collect();
    let lessened = stiffness.plus(-1.0, &SymMatrix::diagonal(&less));
    Spd::factor(&lessened).err().map(|failure| failure.dof)
}

/// ι: 1 for a displacement to the right, 0 for others.
pub(super) fn influence(places: &[(String, Direction)]) -> Vec<f64> {
    let moves = places
        .iter()
        .map(|(_, direction)| *direction == Direction::X);
    moves.map(f64::from).collect()
}
