//! The loading unit of a specimen: its actuators in place of the coordinates of its platform.
//!
//! From here on the axes of the specimen are actuators. Their rows are those of small displacements, J·B at the reference
//! pose, so that K0, C0 and their proof follow as for any other specimen; the port itself uses the whole geometry.

use std::collections::BTreeMap;

use super::super::gear::Rows;
use super::super::{Refused, Site};
use gusset_actuator::geometry::{Geometry, GeometryError, GeometrySpec, LawPlace, MOST};
use gusset_actuator::specimen::{Gear, Platform, Specimen};
use gusset_config::{AxisTable, KeyPath, SpecimenTable};
use gusset_control::port::{LoadingUnitSpec, PoseRow};
use gusset_record::summary::{ActuatorFacts, LoadingFacts};

type Sparse = Vec<(usize, f64)>;

/// The rows of the axes, and the loading unit if the axes are its actuators; `rows` are those of B.
pub(super) fn loading(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &SpecimenTable,
    rows: Vec<Sparse>,
) -> Result<(Vec<Sparse>, Option<LoadingUnitSpec>), Refused> {
    loading_of(table, rows)
        .or_else(|error| site.refuse_key(&at.key("geometry"), error.key(), &error))
}

/// Rows and loading unit from the table alone.
pub(crate) fn loading_of(
    table: &SpecimenTable,
    rows: Vec<Sparse>,
) -> Result<(Vec<Sparse>, Option<LoadingUnitSpec>), GeometryError> {
    let Some(spec) = &table.geometry else {
        return Ok((rows, None));
    };
    let geometry = spec.build(table.similitude.length)?;
    let coordinates = geometry.coordinates().len();
    // Without a structure there is nothing to take a coordinate from: it is prescribed. Their number was checked.
    let rows = (0..coordinates).map(|index| PoseRow {
        row: rows.get(index).cloned().unwrap_or_default(),
        base: 0.0,
    });
    let rows: Vec<PoseRow> = rows.collect();
    let reference = geometry.reference();
    let axes = (0..geometry.actuators()).map(|actuator| {
        let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
        for (column, row) in rows.iter().enumerate() {
            for &(dof, coefficient) in &row.row {
                *sums.entry(dof).or_default() += reference.slope(actuator, column) * coefficient;
            }
        }
        sums.into_iter().filter(|(_, sum)| *sum != 0.0).collect()
    });
    let axes = axes.collect();
    let loading = LoadingUnitSpec {
        geometry,
        rows,
        law_at: spec.law_at,
    };
    Ok((axes, Some(loading)))
}

/// Position of each axis in m, and its reading there in N, while the deformation and the force are zero.
pub(super) fn offsets(table: &SpecimenTable, axes: usize) -> Vec<(f64, f64)> {
    let axis = |index: usize| table.axis.get(index);
    let axes = (0..axes).map(|index| axis(index).map(|axis| (axis.offset_m, axis.offset_n)));
    axes.map(Option::unwrap_or_default).collect()
}

/// Offsets of a law in this process. It receives positions without their offset, except at a platform: there its
/// actuators take it to the position.
pub(crate) fn own_offsets(table: &SpecimenTable, axes: usize) -> Vec<(f64, f64)> {
    let mut offsets = offsets(table, axes);
    let is_at_platform = of_platform(table).is_some();
    for (disp, force) in &mut offsets {
        *disp = if is_at_platform { *disp } else { 0.0 };
        *force = 0.0;
    }
    offsets
}

/// The law behind its actuators, if it is at their platform, by their strokes: without the offsets of their axes.
pub(crate) fn behind_actuators(
    table: &SpecimenTable,
    law: Box<dyn Specimen>,
) -> Result<Box<dyn Specimen>, GeometryError> {
    let Some(spec) = of_platform(table) else {
        return Ok(law);
    };
    let geometry = spec.build(1.0)?;
    let gears = (0..geometry.actuators()).map(|index| {
        let axis = table.axis.get(index).cloned().unwrap_or_default();
        let AxisTable { scale, sign, .. } = axis;
        Gear {
            ratio: f64::from(sign) * scale,
            offset: 0.0,
        }
    });
    let gears: Vec<Gear> = gears.collect();
    Ok(Box::new(Platform::new(law, geometry, &gears)))
}

/// An estimate as the actuators see it, one row each: Pᵀ K P with P = J⁺ at the reference pose; `geometry` is at the scale of
/// the estimate.
pub(crate) fn at_actuators(table: &SpecimenTable, geometry: &Geometry, estimate: Rows) -> Rows {
    if of_platform(table).is_none() {
        return estimate;
    }
    let (n, m) = (geometry.coordinates().len(), geometry.actuators());
    let reference = geometry.reference();
    let motions = (0..m).map(|actuator| {
        let (mut unit, mut motion) = ([0.0; MOST], vec![0.0; n]);
        unit[actuator] = 1.0;
        geometry.pose_rates(&reference, &unit, &mut motion);
        motion
    });
    let motions: Vec<Vec<f64>> = motions.collect();
    let entry = |i: usize, j: usize| {
        let mut sum = 0.0;
        for (row, a) in estimate.iter().zip(&motions[i]) {
            for (entry, b) in row.iter().zip(&motions[j]) {
                sum += a * entry * b;
            }
        }
        sum
    };
    // One half of the symmetric whole, mirrored.
    let row = |i: usize| (0..m).map(|j| entry(i.min(j), i.max(j))).collect();
    (0..m).map(row).collect()
}

fn of_platform(table: &SpecimenTable) -> Option<&GeometrySpec> {
    let spec = table.geometry.as_ref()?;
    (spec.law_at == LawPlace::Platform).then_some(spec)
}

/// The loading unit of a specimen.
pub(crate) fn facts(table: &SpecimenTable) -> Option<LoadingFacts> {
    let spec = table.geometry.as_ref()?;
    let geometry = spec.build(1.0).ok()?;
    let reference = geometry.reference();
    let coordinates = geometry.coordinates();
    let actuators = (0..geometry.actuators()).map(|actuator| {
        let range = geometry.stroke_range(actuator);
        ActuatorFacts {
            length_m: geometry.length(actuator),
            stroke_m: if range.iter().all(|stroke| stroke.is_finite()) {
                range.to_vec()
            } else {
                Vec::new()
            },
            slope: (0..coordinates.len())
                .map(|column| reference.slope(actuator, column))
                .collect(),
        }
    });
    Some(LoadingFacts {
        form: match (&spec.plane, &spec.space) {
            (Some(_), _) => "plane",
            (_, Some(_)) => "space",
            _ => "matrix",
        }
        .to_owned(),
        exact: geometry.is_exact(),
        law_at: spec.law_at,
        coordinates: coordinates.iter().map(|one| one.key().to_owned()).collect(),
        condition: geometry.condition(&reference),
        actuators: actuators.collect(),
    })
}
