//! The initial stiffness k̂ of a specimen at the structure, and the forces that it explains.

use super::axis::Axis;
use super::row_product::row_times;
use gusset_quantity::frame::{AtAxis, AtStructure};

/// k̂ of all axes in N/m.
#[derive(Debug)]
pub(crate) struct InitialStiffness {
    /// Of each axis alone.
    own: AtStructure<Vec<f64>>,
    /// Between different axes, n × n by rows, zero on the diagonal; empty if they do not know of each other.
    between: Vec<f64>,
}

impl InitialStiffness {
    /// k̂ of each axis alone, and between the axes, n × n by rows, whose diagonal is not looked at; empty if they do not know of each
    /// other.
    pub(crate) fn new(own: AtStructure<Vec<f64>>, coupling: &[Vec<f64>]) -> Self {
        let rows = coupling.iter().enumerate().flat_map(|(i, row)| {
            let beside = move |(j, value): (usize, &f64)| if i == j { 0.0 } else { *value };
            row.iter().enumerate().map(beside)
        });
        let between: Vec<f64> = rows.collect();
        let known = between.iter().any(|value| *value != 0.0);
        Self {
            own,
            between: if known { between } else { Vec::new() },
        }
    }

    /// Of each axis alone, N/m.
    pub(crate) fn own(&self) -> AtStructure<&[f64]> {
        self.own.part(Vec::as_slice)
    }

    /// Of all axes, n × n by rows.
    pub(crate) fn matrix(&self) -> Vec<f64> {
        let n = self.own.len();
        let mut matrix = self.between.clone();
        matrix.resize(n * n, 0.0);
        for (entry, own) in matrix.iter_mut().step_by(n + 1).zip(&*self.own) {
            *entry = *own;
        }
        matrix
    }

    /// Force in N on an axis that the others make where they were measured, as declared. Real-time: yes.
    #[inline]
    pub(crate) fn force_of_others(&self, index: usize, measured: AtStructure<&[f64]>) -> f64 {
        if self.between.is_empty() {
            return 0.0;
        }
        row_times(
            &self.between,
            index,
            measured.len(),
            measured.iter().copied(),
        )
    }

    /// Change of the force of an axis whose displacement changes by `way`; both in the specimen's own units.
    pub(crate) fn elastic_force(&self, index: usize, axis: &Axis, way: AtAxis<f64>) -> AtAxis<f64> {
        let own = self.own.get(index);
        AtAxis(own.map_or(f64::NAN, |own| {
            own / (axis.force_gain * axis.disp_gain) * way.0
        }))
    }

    /// The most that the force of an axis can change where the axes are displaced by `ways`, both in the specimen's own units: |kᵢⱼ|
    /// is at most √(kᵢᵢ kⱼⱼ).
    pub(crate) fn most_force(
        &self,
        index: usize,
        axes: &[Axis],
        ways: AtAxis<&[f64]>,
    ) -> AtAxis<f64> {
        let roots = self.own.iter().map(|stiffness| stiffness.abs().sqrt());
        let roots: Vec<f64> = roots.collect();
        let each = ways.iter().zip(axes).zip(&roots);
        let all: f64 = each
            .map(|((way, axis), root)| root * (way / axis.disp_gain).abs())
            .sum();
        let gain = axes
            .get(index)
            .map_or(f64::NAN, |axis| axis.force_gain.abs());
        AtAxis(roots.get(index).map_or(f64::NAN, |root| root * all / gain))
    }

    /// Force of an axis that its displacement does not explain, and how far off that is where k̂ is known to a `share` and the other
    /// axes are coupled with it. `measured`: displacement and force of each axis; all is in the specimen's own units.
    pub(crate) fn unexplained_force(
        &self,
        index: usize,
        axes: &[Axis],
        measured: AtAxis<&[[f64; 2]]>,
        share: f64,
    ) -> AtAxis<(f64, f64)> {
        let disps = measured.iter().zip(axes);
        let mut ways: Vec<f64> = disps
            .map(|([disp, _], axis)| disp - axis.measured_offset - axis.disp_offset)
            .collect();
        let (Some(own), Some(known), Some([_, force])) =
            (ways.get_mut(index), axes.get(index), measured.get(index))
        else {
            return AtAxis((f64::NAN, f64::NAN));
        };
        let stiffness = self.own.get(index).copied().unwrap_or(f64::NAN);
        let explained = stiffness / (known.force_gain * known.disp_gain) * *own;
        *own *= share;
        let AtAxis(slack) = self.most_force(index, axes, AtAxis(&ways));
        AtAxis((force - known.force_offset - explained, slack))
    }
}
