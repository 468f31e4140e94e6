//! A reduction as the build of a test uses it.

use std::sync::Arc;

use gusset_config::{KeptDof, ReduceTable};
use gusset_reduction::{Coordinate, Reduction};

/// A reduction as the test file and the structure need it.
#[derive(Debug, Clone)]
pub(super) struct Reduced {
    pub(super) reduction: Arc<Reduction>,
    /// Kept DOFs that the file names.
    pub(super) named: usize,
    /// All kept DOFs, in order.
    pub(super) keep: Vec<KeptDof>,
    /// Influence vector of each component of the ground, with the end of the name of its column.
    pub(super) grounds: Vec<(String, Vec<f64>)>,
}

impl Reduced {
    /// Each degree of freedom of the reduced structure in words.
    pub(super) fn places(&self) -> Vec<String> {
        let table = ReduceTable {
            modes: self.modes(),
            keep: self.keep.clone(),
        };
        let all = 0..self.reduction.coordinates().len();
        all.map(|dof| table.place(dof)).collect()
    }

    pub(super) fn modes(&self) -> usize {
        let all = self.reduction.coordinates().iter();
        all.filter(|one| matches!(one, Coordinate::Mode(_))).count()
    }

    /// Those of the listed DOFs of the full model that are kept, in the numbers of the reduced one.
    pub(super) fn of_model(&self, dofs: &[usize]) -> Vec<usize> {
        let kept = dofs.iter().filter_map(|&dof| self.reduction.place(dof));
        kept.collect()
    }
}
