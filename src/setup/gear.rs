//! Relation between a deformation of the structure and the numbers of an axis: scaling, sign and units.

use gusset_config::{AxisTable, SpecimenTable};
use gusset_control::port::Axis;

/// A square matrix by rows, one row per axis.
pub(super) type Rows = Vec<Vec<f64>>;

/// The map of one axis, and metres and newtons in one unit of it.
pub(super) fn axis(
    table: &SpecimenTable,
    gear: &AxisTable,
    row: Vec<(usize, f64)>,
) -> (Axis, (f64, f64)) {
    let (metres, newtons) = (gear.unit_disp.row().si, gear.unit_force.row().si);
    let ratio = f64::from(gear.sign) * gear.scale;
    let scale = &table.similitude;
    let axis = Axis {
        row,
        base: 0.0,
        disp_gain: ratio / (scale.length * metres),
        disp_offset: gear.offset_m / metres,
        measured_offset: 0.0,
        vel_gain: ratio * scale.time / (scale.length * metres),
        force_gain: scale.force * ratio * newtons,
        force_offset: gear.offset_n / newtons,
    };
    (axis, (metres, newtons))
}

/// A matrix of the law (by columns, SI, specimen's scale) as the structure sees it (by rows).
pub(super) fn scaled(
    flat: &[f64],
    axes: &[Axis],
    units: &[(f64, f64)],
    motion: fn(&Axis) -> f64,
) -> Rows {
    let n = axes.len();
    let value = |i: usize, j: usize| {
        let (force, moved) = (
            axes[i].force_gain / units[i].1,
            motion(&axes[j]) * units[j].0,
        );
        force * flat[j * n + i] * moved
    };
    (0..n)
        .map(|i| (0..n).map(|j| value(i, j)).collect())
        .collect()
}
