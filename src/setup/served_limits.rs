//! Limits of a served specimen at its own scale and at that of its client.

use super::gateway::signal_units;
use super::gear;
use super::specimens::loading::loading_of;
use gusset_config::{ServedFile, SpecimenTable};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::units::AxisUnits;

/// Trip levels of one axis, or the range that they allow for one signal of the client. Infinite without a level.
#[derive(Debug, Clone, PartialEq)]
pub struct ServedLimit {
    /// The axis, or the coordinate of a loading unit.
    pub name: String,
    /// Smallest and largest displacement, and its unit.
    pub disp: [f64; 2],
    /// Unit of displacement.
    pub disp_unit: &'static str,
    /// Smallest and largest force.
    pub force: [f64; 2],
    /// Unit of force.
    pub force_unit: &'static str,
}

impl ServedLimit {
    /// Ranges of displacement and force in SI, as a client with these units counts them.
    fn counted(name: &str, [disp, force]: [[f64; 2]; 2], units: AxisUnits) -> Self {
        Self {
            name: name.to_owned(),
            disp: disp.map(|end| end / units.metres),
            disp_unit: units.disp,
            force: force.map(|end| end / units.newtons),
            force_unit: units.force,
        }
    }
}

/// Limits of `command_disp_m` and `measured_force_n`: those of the axes in m and N, and those in the client's units.
#[must_use]
pub fn served_limits(source: &ServedFile) -> [Vec<ServedLimit>; 2] {
    let Some(table) = source.specimen() else {
        return [Vec::new(), Vec::new()];
    };
    let own = own_limits(table);
    let client = match loading_of(table, Vec::new()) {
        Ok((_, Some(loading))) if source.converts() => {
            let reference = loading.geometry.reference();
            let units = source.client_units().unwrap_or_default();
            let coordinates = loading.geometry.coordinates().iter().enumerate();
            let limits = coordinates.map(|(index, coordinate)| {
                let slope = |axis: usize| reference.slope(axis, index);
                let alone = at_coordinate(table, &own, slope);
                let units = signal_units(Some(coordinate), units);
                ServedLimit::counted(coordinate.key(), alone, units)
            });
            limits.collect()
        }
        _ => own
            .iter()
            .enumerate()
            .map(|(index, own)| at_client(source, table, index, own))
            .collect(),
    };
    [own, client]
}

/// Limits of the axes, in m and N at the specimen.
fn own_limits(table: &SpecimenTable) -> Vec<ServedLimit> {
    let limits = table.limits_of(table.axes());
    let limits = limits.iter().enumerate();
    let open = [f64::NEG_INFINITY, f64::INFINITY];
    let limits = limits.map(|(index, limits)| ServedLimit {
        name: format!("axis {}", index + 1),
        disp: limits.trip(Limit::CommandDisp).unwrap_or(open),
        disp_unit: "m",
        force: limits.trip(Limit::MeasuredForce).unwrap_or(open),
        force_unit: "N",
    });
    limits.collect()
}

/// The axis at the structure's scale, and metres and newtons in its units.
fn geared(table: &SpecimenTable, index: usize) -> (gusset_control::port::Axis, (f64, f64)) {
    let gear = table.axis.get(index).cloned().unwrap_or_default();
    gear::axis(table, &gear, Vec::new())
}

/// Deformation in m and force in N at the structure of the limits of an axis.
fn at_structure(table: &SpecimenTable, index: usize, own: &ServedLimit) -> [[f64; 2]; 2] {
    let (axis, (metres, newtons)) = geared(table, index);
    let disp = own.disp.map(|end| axis.deformation(AtAxis(end / metres)).0);
    let force = own
        .force
        .map(|end| axis.force_gain * (end / newtons - axis.force_offset));
    [disp, force].map(|[one, other]| [one.min(other), one.max(other)])
}

fn at_client(
    source: &ServedFile,
    table: &SpecimenTable,
    index: usize,
    own: &ServedLimit,
) -> ServedLimit {
    let axis_units = table.units_of(table.axes());
    let units = axis_units.get(index).copied().unwrap_or(AxisUnits::SI);
    let (ends, units) = match source.client_units() {
        None => ([own.disp, own.force], units),
        Some(units) => (at_structure(table, index, own), signal_units(None, units)),
    };
    ServedLimit::counted(&own.name, ends, units)
}

/// Range of one coordinate in m or rad while all others are at the reference pose, and the range of its force, both for small
/// motions; `slope` is the stroke of each actuator for a unit of the coordinate.
fn at_coordinate(
    table: &SpecimenTable,
    own: &[ServedLimit],
    slope: impl Fn(usize) -> f64,
) -> [[f64; 2]; 2] {
    let mut disp = [f64::NEG_INFINITY, f64::INFINITY];
    let mut force = [0.0, 0.0];
    for (index, own) in own.iter().enumerate() {
        let slope = slope(index);
        if slope.abs() < 1e-12 {
            continue;
        }
        let [strokes, forces] = at_structure(table, index, own);
        let [one, other] = strokes.map(|end| end / slope);
        disp = [disp[0].max(one.min(other)), disp[1].min(one.max(other))];
        let [one, other] = forces.map(|end| end * slope);
        force = [force[0] + one.min(other), force[1] + one.max(other)];
    }
    [disp, force]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits(text: &str) -> [Vec<ServedLimit>; 2] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("gateway.toml");
        let text = format!("[safety]\nunlimited = \"a test\"\n{text}");
        std::fs::write(&path, text).unwrap();
        served_limits(&gusset_config::load_serve_file(&path, None).unwrap())
    }

    fn near(found: [f64; 2], wanted: [f64; 2]) {
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(
                (found - wanted).abs() <= 1e-9 * wanted.abs(),
                "{found} {wanted}"
            );
        }
    }

    const AXIS: &str = r#"
        [[specimen]]
        name = "column"
        stiffness_n_per_m = 1e6
        similitude = { length = 2.0, force = 8.0 }
        axis = [{ unit_disp = "mm", unit_force = "kN", sign = -1, scale = 0.5, offset_m = 0.01 }]
        limits = { command_disp_m = { trip = [-0.02, 0.03] }, measured_force_n = { trip = [-5e3, 4e3] } }
        link = { address = "127.0.0.1:1", probe = "none" }
    "#;

    #[test]
    fn client_limits_convert_to_the_axis() {
        let [own, client] = limits(&format!(
            "[serve]\nunit_disp = \"in\"\nunit_force = \"kip\"\n{AXIS}"
        ));
        near(own[0].disp, [-0.02, 0.03]);
        // 30 mm are 20 mm from the zero of the axis, −80 mm of the structure; −20 mm are 120 mm of it.
        near(client[0].disp, [-80.0 / 25.4, 120.0 / 25.4]);
        // −5 kN are 8 · 0.5 · 5 kN of the structure, with the other sign.
        near(
            client[0].force,
            [-16e3 / 4_448.221_615_260_5, 20e3 / 4_448.221_615_260_5],
        );
        assert_eq!((client[0].disp_unit, client[0].force_unit), ("in", "kip"));
    }

    #[test]
    fn without_conversion_units_are_the_axis() {
        let plain = AXIS.replace("similitude = { length = 2.0, force = 8.0 }", "");
        let plain = plain.replace(", sign = -1, scale = 0.5, offset_m = 0.01", "");
        let [_, client] = limits(&plain);
        near(client[0].disp, [-20.0, 30.0]);
        near(client[0].force, [-5.0, 4.0]);
        assert_eq!((client[0].disp_unit, client[0].force_unit), ("mm", "kN"));
    }

    #[test]
    fn first_actuator_end_bounds_a_coordinate() {
        let [own, client] = limits(
            r#"
            [serve]
            unit_disp = "mm"
            [[specimen]]
            name = "platform"
            stiffness_n_per_m = [[1e6, 0.0, 0.0], [0.0, 1e6, 0.0], [0.0, 0.0, 1e6]]
            geometry.law_at = "actuators"
            geometry.plane = [
                { base_m = [-1.0, 0.5], joint_m = [0.0, 0.5] },
                { base_m = [-1.0, -0.5], joint_m = [0.0, -0.5] },
                { base_m = [0.0, -1.0], joint_m = [0.0, 0.0] },
            ]
            limits = { command_disp_m = { trip = [-0.02, 0.02] }, measured_force_n = { trip = [-1e3, 1e3] } }
            link = { address = "127.0.0.1:1", probe = "none" }
            "#,
        );
        assert_eq!(own.len(), 3);
        let [ux, uy, rz] = &client[..] else {
            panic!("{client:?}")
        };
        near(ux.disp, [-20.0, 20.0]);
        near(ux.force, [-2e3, 2e3]);
        near(uy.force, [-1e3, 1e3]);
        near(rz.disp, [-0.04, 0.04]);
        // Two forces at levers of 500 mm.
        near(rz.force, [-1e6, 1e6]);
        assert_eq!((rz.disp_unit, rz.force_unit), ("rad", "N mm"));
    }
}
