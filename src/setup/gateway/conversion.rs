//! A gateway that converts: its client commands deformations at the structure's scale, or the coordinates of a loading unit.
//!
//! The port of the gateway is made as that of a test: axes with gears, the loading unit, limits at the specimen's scale. Only a
//! structure is missing, whose place the client takes.

use std::sync::Arc;

use super::super::gear::{self, Rows};
use super::super::links::{wire_axes, wiring_check};
use super::super::specimens::loading::{at_actuators, loading_of};
use super::following::Following;
use super::{PROBE_PERIOD_S, check_estimate, counted, reply_limit_ns};
use gusset_actuator::geometry::{Coordinate, LawPlace};
use gusset_config::{DispUnit, Finding, ForceUnit, KeyPath, LinkSpec, SpecimenTable, axis_units};
use gusset_control::port::limits::AxisLimits;
use gusset_control::port::{Axis, AxisSpec, LoadingUnitSpec, PortSpec, WiringCheck};
use gusset_link::announce::announce;
use gusset_link::served::{AxesBehind, LinkBuild};
use gusset_link::server::{Conversion, Host, PortBuild};
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::Substructure;
use gusset_quantity::units::AxisUnits;
use gusset_wire::handshake::{Axis as WireAxis, Limits, Unit};

/// The axes of a specimen with everything that lies between them and the structure of a client.
struct Converted<'a> {
    table: &'a SpecimenTable,
    axes: Vec<Axis>,
    loading: Option<LoadingUnitSpec>,
    /// k̂ as the axes see it, by rows, at the structure's scale.
    stiffness: Rows,
}

/// Units and compensation of a gateway's client.
#[derive(Default)]
pub(super) struct Client {
    /// Its units; none if it counts in those of the axes.
    pub units: Option<(DispUnit, ForceUnit)>,
    pub following: Option<Following>,
    /// Its targets become paths of commands, whose velocities are slopes in wall time.
    pub is_paced: bool,
    /// The reason to accept a specimen whose stiffness is not near the estimate.
    pub accepted: Option<String>,
    /// From one exchange of the wiring check to the next, in s; none: the usual time.
    pub probed_every: Option<f64>,
}

/// The gateway, and how it checks the wiring.
pub(super) fn host(
    table: &SpecimenTable,
    link: &LinkSpec,
    at: &KeyPath,
    Client {
        units,
        following,
        is_paced,
        accepted,
        probed_every,
    }: Client,
    build: LinkBuild,
) -> Result<(Host, WiringCheck), Box<Finding>> {
    let converted = Converted::of(table, at, is_paced)?;
    let n = converted.axes.len();
    let client = units.map_or_else(|| table.units_of(n), |units| converted.client_units(units));
    let wire = match units {
        Some(units) => converted.wire_axes(units),
        None => wire_axes(table, n, None),
    };
    let stiffness = counted(&converted.at_signals(), &client);
    let axis_units = table.units_of(n);
    let gears = converted.axes.iter().zip(&axis_units);
    let gears = gears.map(|(axis, unit)| axis.disp_gain * unit.metres);
    // The port measures in m and N of the structure.
    let by_rows = converted.stiffness.iter().flatten().copied().collect();
    let estimate = (by_rows, accepted);
    let check = wiring_check(
        link,
        gears,
        estimate,
        probed_every.unwrap_or(PROBE_PERIOD_S),
        Vec::new(),
    );
    let host = Host::gateway(
        table.name.clone(),
        wire,
        stiffness,
        build,
        reply_limit_ns(link),
    );
    let conversion = Conversion {
        behind: AxesBehind {
            coordinates: converted.coordinates().to_vec(),
            units: axis_units,
        },
        port: converted.into_port(following),
    };
    Ok((host.in_units(client).converting(conversion), check))
}

impl<'a> Converted<'a> {
    fn of(table: &'a SpecimenTable, at: &KeyPath, is_paced: bool) -> Result<Self, Box<Finding>> {
        let n = table.axes();
        let (_, loading) = loading_of(table, Vec::new()).map_err(|error| {
            let at = at.key("geometry").key(error.key());
            Box::new(Finding::error(at, error.to_string()))
        })?;
        let gears = (0..n).map(|index| table.axis.get(index).cloned().unwrap_or_default());
        let axes = gears.map(|gear| {
            let axis = gear::axis(table, &gear, Vec::new()).0;
            // Velocities of a client are slopes in its own time; those of a path are slopes in wall time already.
            let vel_gain = if is_paced {
                axis.disp_gain
            } else {
                axis.vel_gain
            };
            Axis { vel_gain, ..axis }
        });
        let axes: Vec<Axis> = axes.collect();
        let estimate = table.stiffness_n_per_m.as_ref();
        let rows = estimate.map(|matrix| matrix.rows()).unwrap_or_default();
        check_estimate(&rows, table.law_axes(), at)?;
        let stiffness = match &loading {
            Some(loading) => at_actuators(table, &loading.geometry, rows),
            None => rows,
        };
        Ok(Self {
            table,
            axes,
            loading,
            stiffness,
        })
    }

    fn coordinates(&self) -> &[Coordinate] {
        let loading = self.loading.as_ref();
        loading.map_or(&[][..], |loading| loading.geometry.coordinates())
    }

    /// Units of the client, one entry per signal.
    fn client_units(&self, units: (DispUnit, ForceUnit)) -> Vec<AxisUnits> {
        if self.loading.is_none() {
            return vec![signal_units(None, units); self.axes.len()];
        }
        let coordinates = self.coordinates().iter();
        let of_signals = coordinates.map(|coordinate| signal_units(Some(coordinate), units));
        of_signals.collect()
    }

    /// k̂ of the signals, by rows: Jᵀ K J at the reference pose.
    fn at_signals(&self) -> Rows {
        let Some(loading) = &self.loading else {
            return self.stiffness.clone();
        };
        if let (LawPlace::Platform, Some(said)) = (loading.law_at, &self.table.stiffness_n_per_m) {
            return said.rows();
        }
        let reference = loading.geometry.reference();
        let n = self.coordinates().len();
        let entry = |p: usize, q: usize| {
            let mut sum = 0.0;
            for (i, row) in self.stiffness.iter().enumerate() {
                for (j, stiffness) in row.iter().enumerate() {
                    sum += reference.slope(i, p) * stiffness * reference.slope(j, q);
                }
            }
            sum
        };
        // One half of the symmetric whole, mirrored.
        let row = |p: usize| (0..n).map(|q| entry(p.min(q), p.max(q))).collect();
        (0..n).map(row).collect()
    }

    /// Signals for the handshake of the protocol of Gusset. Units that it lacks were refused before.
    fn wire_axes(&self, (disp, force): (DispUnit, ForceUnit)) -> Vec<WireAxis> {
        let disp_unit = disp.row().wire.unwrap_or(Unit::Metre);
        let force_unit = force.row().wire.unwrap_or(Unit::Newton);
        if self.loading.is_some() {
            let coordinates = self.coordinates().iter();
            let axes = coordinates.map(|coordinate| {
                let turns = coordinate.is_rotation();
                let moment = match force {
                    ForceUnit::Kilonewton => Unit::KilonewtonMetre,
                    _ => Unit::NewtonMetre,
                };
                WireAxis {
                    name: coordinate.key().to_owned(),
                    disp_unit: if turns { Unit::Radian } else { disp_unit },
                    force_unit: if turns { moment } else { force_unit },
                    // The actuators have bounds; the resulting bounds of the pose depend on the pose.
                    limits: Limits::NONE,
                }
            });
            return axes.collect();
        }
        let link = self.table.link.as_ref();
        let names = link.and_then(|link| link.axis_names.as_ref());
        let limits = self.table.limits_of(self.axes.len());
        let units = self.table.units_of(self.axes.len());
        let axes = self.axes.iter().zip(limits.iter().zip(&units));
        let axes = axes.enumerate().map(|(index, (axis, (limits, units)))| {
            let name = names.and_then(|names| names.get(index).cloned());
            let own = announce(&AxisLimits::of(limits), units, None);
            WireAxis {
                name: name.unwrap_or_else(|| format!("axis {}", index + 1)),
                disp_unit,
                force_unit,
                limits: at_client(&own, axis, (disp.row().si, force.row().si)),
            }
        });
        axes.collect()
    }

    /// Makes the port as often as a controller comes.
    fn into_port(self, following: Option<Following>) -> PortBuild {
        let Self {
            table,
            axes,
            loading,
            stiffness,
        } = self;
        let n = axes.len();
        let name = table.name.clone();
        let limits = table.limits_of(n).into_iter().zip(table.units_of(n));
        let each = axes.into_iter().zip(limits).enumerate();
        let axes = each.map(|(index, (axis, (limits, unit)))| AxisSpec {
            units: (unit.metres, unit.newtons),
            limits: AxisLimits::of(&limits),
            ..AxisSpec::new(axis, stiffness[index][index])
        });
        let axes: Vec<AxisSpec> = axes.collect();
        Arc::new(move |substructure: Box<dyn Substructure>| {
            let mut spec = PortSpec::new(name.clone(), substructure, 0, axes.clone());
            spec.loading_unit = loading.clone();
            if let Some(following) = &following {
                following.add_to(&mut spec)?;
            }
            spec.build_received().map_err(|error| error.to_string())
        })
    }
}

/// Limits of an axis, in its units, as its client counts, whose units have these metres and newtons.
fn at_client(own: &Limits, axis: &Axis, (metres, newtons): (f64, f64)) -> Limits {
    let ends = [own.disp_min, own.disp_max].map(|end| axis.deformation(AtAxis(end)).0 / metres);
    Limits {
        disp_min: ends[0].min(ends[1]),
        disp_max: ends[0].max(ends[1]),
        speed_max: own.speed_max / axis.disp_gain.abs() / metres,
        force_max: own.force_max * axis.force_gain.abs() / newtons,
    }
}

/// Units of a client that counts in `disp` and `force`, for a coordinate of a loading unit or for an axis.
pub(crate) fn signal_units(
    coordinate: Option<&Coordinate>,
    (disp, force): (DispUnit, ForceUnit),
) -> AxisUnits {
    if coordinate.is_some_and(|coordinate| coordinate.is_rotation()) {
        return AxisUnits {
            metres: 1.0,
            newtons: force.row().si * disp.row().si,
            disp: "rad",
            force: moment(disp, force),
        };
    }
    axis_units(disp, force)
}

/// The unit of a moment.
const fn moment(disp: DispUnit, force: ForceUnit) -> &'static str {
    match (force, disp) {
        (ForceUnit::Newton, DispUnit::Metre) => "N m",
        (ForceUnit::Newton, DispUnit::Millimetre) => "N mm",
        (ForceUnit::Newton, DispUnit::Inch) => "N in",
        (ForceUnit::Kilonewton, DispUnit::Metre) => "kN m",
        (ForceUnit::Kilonewton, DispUnit::Millimetre) => "kN mm",
        (ForceUnit::Kilonewton, DispUnit::Inch) => "kN in",
        (ForceUnit::PoundForce, DispUnit::Metre) => "lbf m",
        (ForceUnit::PoundForce, DispUnit::Millimetre) => "lbf mm",
        (ForceUnit::PoundForce, DispUnit::Inch) => "lbf in",
        (ForceUnit::Kip, DispUnit::Metre) => "kip m",
        (ForceUnit::Kip, DispUnit::Millimetre) => "kip mm",
        (ForceUnit::Kip, DispUnit::Inch) => "kip in",
    }
}
