//! The forces of a moving support: the columns of the stiffness beside the degrees of freedom.
//!
//! A support is a direction that the ground holds, so the matrices do not contain it. Here it becomes a degree of freedom of a second
//! model, of which one column is read. That column is constant only if the members at the support are elastic.

use thiserror::Error;

use super::error::listed;
use super::{ConstraintSpec, Direction, FrameError, FrameSpec, MemberKind};

/// Why a support cannot move.
#[derive(Debug, Error)]
pub enum SupportError {
    /// No node has this name.
    #[error("there is no node \"{name}\"; the nodes are {known}")]
    NoNode {
        /// The name.
        name: String,
        /// Names of all nodes.
        known: String,
    },
    /// A direction that the ground does not hold.
    #[error("node \"{node}\" is not fixed in {}: only a support moves with the ground", direction.word())]
    NotFixed {
        /// Name of the node.
        node: String,
        /// The direction.
        direction: Direction,
    },
    /// A node of a constraint.
    #[error("node \"{node}\" is in a constraint: such a support cannot move")]
    Constrained {
        /// Name of the node.
        node: String,
    },
    /// A member whose force is not that of a constant stiffness.
    #[error(
        "{name} at the support \"{node}\" is not linear: only elastic members without hinges, `p_delta` and `corotational` can be at a moving support"
    )]
    NotElastic {
        /// Name of the member or link.
        name: String,
        /// Name of the node.
        node: String,
    },
    /// The frame is not valid with that support as a degree of freedom.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

impl FrameSpec {
    /// Column of the stiffness for a support: the force on each degree of freedom that holds the frame when the support moves by 1.
    ///
    /// # Errors
    /// See [`SupportError`].
    pub fn support_column(
        &self,
        node: &str,
        direction: Direction,
    ) -> Result<Vec<f64>, SupportError> {
        let mut freed = self.clone();
        for member in &mut freed.member {
            member.p_delta = false;
        }
        let own = freed.node.iter_mut().find(|one| one.name == node);
        let Some(own) = own else {
            return Err(SupportError::NoNode {
                name: node.to_owned(),
                known: listed(self.node.iter().map(|one| &one.name)),
            });
        };
        if !own.fixed.contains(&direction) {
            return Err(SupportError::NotFixed {
                node: node.to_owned(),
                direction,
            });
        }
        own.fixed.retain(|other| *other != direction);
        self.check_support(node)?;
        let (model, places) = (freed.model()?, self.places());
        let at = |wanted: &(String, Direction)| model.dofs.iter().position(|dof| dof == wanted);
        let support = at(&(node.to_owned(), direction));
        let rows: Option<Vec<usize>> = places.iter().map(at).collect();
        let (Some(support), Some(rows)) = (support, rows) else {
            return Err(FrameError::Empty.into());
        };
        Ok(rows
            .into_iter()
            .map(|row| model.linear.get(row, support))
            .collect())
    }

    /// Refuses a support whose column is not constant.
    fn check_support(&self, node: &str) -> Result<(), SupportError> {
        let is_of = |nodes: &[String], master: &String| {
            master == node || nodes.iter().any(|name| name == node)
        };
        let is_tied = self.constraint.iter().any(|constraint| match constraint {
            ConstraintSpec::Equal(one) => is_of(&one.nodes, &one.master),
            ConstraintSpec::Rigid(one) => is_of(&one.nodes, &one.master),
            ConstraintSpec::Diaphragm(one) => is_of(&one.nodes, &one.master),
        });
        if is_tied {
            return Err(SupportError::Constrained {
                node: node.to_owned(),
            });
        }
        let members = self.member.iter().map(|member| {
            let is_linear = member.kind == MemberKind::Elastic
                && member.hinge_start.is_none()
                && member.hinge_end.is_none()
                && member.corotational.is_none()
                && !member.p_delta;
            (&member.nodes, is_linear)
        });
        let links = self.link.iter().map(|link| (&link.nodes, false));
        for (index, (nodes, is_linear)) in members.chain(links).enumerate() {
            if !is_linear && nodes.iter().any(|name| name == node) {
                return Err(SupportError::NotElastic {
                    name: self.name_of(index + 1),
                    node: node.to_owned(),
                });
            }
        }
        Ok(())
    }
}
