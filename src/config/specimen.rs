//! `[[specimen]]`: deformation, estimates, law, link or bus, limits and capacity of a specimen.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::axis_table::AxisTable;
use super::bus_spec::{BusSample, BusSpec, is_not_written};
use super::bus_table::Buses;
use super::certificate::{CapacityTable, IdentifiedTable};
use super::limit_table::LimitsSpec;
use super::link_table::{LinkSpec, Protocol};
use super::value::MatrixValue;
use gusset_actuator::compensation::CompensationSpec;
use gusset_actuator::geometry::{GeometrySpec, LawPlace};
use gusset_actuator::specimen::{BearingSpec, CoupledSpec, SpecimenLaw};
use gusset_actuator::transfer::TransferSpec;
use gusset_numerics::frame::Direction;
use gusset_numerics::law::LawSpec;
use gusset_quantity::units::AxisUnits;
use gusset_wire::openfresco::Peer;

/// Deformation of a specimen between the nodes of a frame: the motion of `node` minus that of `from`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeformationTable {
    /// Name of the node that moves the specimen.
    #[schemars(example = &"B1")]
    pub node: String,
    /// Direction of the motion.
    pub direction: Direction,
    /// Name of the node at its other end. Default: the ground.
    #[schemars(example = &"B0")]
    pub from: Option<String>,
}

/// One specimen: simulated by exactly one of `law`, `laws`, `coupled` and `bearing`, or reached by a `link` or
/// a `bus`. In a test with a structure, also give exactly one of `storey`, `rows` and `deformations`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpecimenTable {
    /// Name of the specimen, unique in the file. Letters, digits, `-`, `_` and `.` are allowed,
    /// because the name is part of file names.
    pub name: String,
    /// Storey whose deformation the specimen follows, from 1 at the bottom. Use `rows` for any
    /// other deformation.
    #[schemars(range(min = 1))]
    #[schemars(example = 1)]
    pub storey: Option<usize>,
    /// Transformation B from the DOFs to the axes, d = B·x. Give one row for each axis, or for each
    /// coordinate of the platform with `geometry`. In a file of `gusset serve`, B transforms the
    /// displacements of an OpenFresco client. More: guide, opensees.
    pub rows: Option<Vec<Vec<f64>>>,
    /// Deformations between nodes of a frame, one for each axis, or for each coordinate of the platform
    /// with `geometry`. Use it instead of `storey` and `rows`.
    #[schemars(example = serde_json::json!([{"node": "B1", "direction": "x", "from": "B0"}]))]
    pub deformations: Option<Vec<DeformationTable>>,
    /// Loading unit: several actuators that hold one platform. The axes are then the actuators, and
    /// `rows` give the pose of the platform. Default: none, each axis is one deformation.
    pub geometry: Option<GeometrySpec>,
    /// Estimate of the initial stiffness at the structure's scale: a number or a matrix. Too large
    /// a value costs accuracy, too small a value costs stability. Default: the initial stiffness of
    /// the law. Required with `link` or `bus`.
    pub stiffness_n_per_m: Option<MatrixValue>,
    /// Estimate of the initial damping at the structure's scale and the velocities of the test: a
    /// number or a matrix. Default: the initial damping of the law; zero with `link` or `bus`.
    pub damping_n_s_per_m: Option<MatrixValue>,
    /// If true, the stiffness K of a damping rule of a frame includes this specimen. The numerical side
    /// then resists its deformation with a viscous force, too. Only for a frame: the rules of other
    /// structures include all specimens. Default: false.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = true)]
    pub damped: Option<bool>,
    /// Upper bound of the tangent stiffness of a specimen with `link` or `bus`, divided by
    /// `stiffness_n_per_m`. The proof of stability uses it. Default: 1, the specimen never becomes
    /// stiffer.
    #[schemars(example = 1.5)]
    pub hardening_bound: Option<f64>,
    /// Largest expected deformation, at the structure's scale. The proof of stability uses it to
    /// bound the tangent stiffness of a hardening law. Default: none.
    #[schemars(example = 0.05)]
    pub reach_disp_m: Option<f64>,
    /// Largest expected deformation velocity, at the structure's scale. The proof of stability uses
    /// it to bound the tangent damping of a nonlinear damper. Default: none.
    #[schemars(example = 0.5)]
    pub reach_vel_m_per_s: Option<f64>,
    /// Mass whose inertia is already part of the measured force, so the structure must not contain
    /// it. The proof of stability subtracts it from M, because the measured force is one step late.
    /// Damping rules include it. A base displacement is refused with it.
    #[serde(default)]
    pub mass_in_force_kg: f64,
    /// Scale factors between structure and specimen. Default: full scale.
    #[serde(default)]
    pub similitude: SimilitudeTable,
    /// Scale, offset and units of each axis, one `[[specimen.axis]]` table each. Default: no scale,
    /// no offset, SI units.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axis: Vec<AxisTable>,
    /// Limits of all axes. `limits` of a single `axis` override single levels.
    pub limits: Option<LimitsSpec>,
    /// Force law of a simulated specimen. All axes have the same law, and each axis has its own
    /// state. Beside a `link` or `bus`, it is the stand-in: a rehearsal uses it in place of the specimen, at
    /// the specimen's scale. Default of the stand-in: linear, with `stiffness_n_per_m` and
    /// `damping_n_s_per_m`.
    pub law: Option<LawSpec>,
    /// Force law of each axis of a simulated specimen. The axes are independent of each other.
    /// Beside a `link` or `bus`, it is the stand-in for rehearsals.
    #[schemars(example = serde_json::json!([{"linear": {"stiffness_n_per_m": 1.0e6}}, {"linear": {"stiffness_n_per_m": 5.0e5}}]))]
    pub laws: Option<Vec<LawSpec>>,
    /// Linear law of a simulated specimen with several coupled axes. Beside a `link` or `bus`, it is
    /// the stand-in for rehearsals.
    pub coupled: Option<CoupledSpec>,
    /// Simulated bearing in two horizontal directions that share one circle of yielding or sliding.
    /// Beside a `link` or `bus`, it is the stand-in for rehearsals.
    pub bearing: Option<BearingSpec>,
    /// Simulated actuator and sensors of a simulated specimen. Default: none, the specimen follows
    /// its command at once. Beside a `link` or `bus`, they are those of the stand-in for rehearsals.
    /// Their default is then the delay, gain and noise of `identified`.
    pub transfer: Option<TransferSpec>,
    /// Compensation of the actuator dynamics. It computes the commands from the targets. Default:
    /// none, the command is the target. More: guide, actuators.
    pub compensation: Option<CompensationSpec>,
    /// Displacement of each axis, at the specimen's scale, for the end position
    /// "safe_displacement".
    #[schemars(example = [0.0])]
    pub safe_disp_m: Option<Vec<f64>>,
    /// Network connection to a specimen that another program controls or computes.
    #[serde(default, skip_serializing_if = "is_not_written")]
    pub link: Option<LinkSpec>,
    /// Specimen on an EtherCAT bus of this computer. Use it instead of `link`.
    pub bus: Option<BusSpec>,
    /// Fault injection: this simulated specimen fails on purpose. Use it to see how the test ends
    /// after an internal error. Rehearsals, replays and resumed tests ignore it. Default: none.
    pub drill: Option<DrillTable>,
    /// Measured properties of the specimen, its actuator and its sensors. `gusset identify` writes
    /// this table. Default: none.
    pub identified: Option<IdentifiedTable>,
    /// Capacity of the actuators. `check` refuses a test whose rehearsal needs more. Default: none.
    pub capacity: Option<CapacityTable>,
}

/// Fault injection in a simulated specimen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DrillTable {
    /// Test time at which the specimen panics. All specimens then stop, the record is kept, and
    /// `gusset run` exits with code 5.
    #[schemars(example = 5.0)]
    pub panic_at_s: f64,
}

/// The other end of a link that answers with forces only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceOnly {
    /// A server or client of OpenFresco's protocols.
    Peer(Peer),
    /// A bus without an input for the displacement of an axis.
    Bus,
}

impl SpecimenTable {
    /// The known actuator and sensors: those of the specimen, else those of its stand-in, else the identified ones.
    /// `pace` is the test time in a second of wall time.
    #[must_use]
    pub fn believed_transfer(&self, pace: f64) -> Option<TransferSpec> {
        let identified = || {
            self.link.as_ref()?;
            self.identified?.transfer(pace)
        };
        self.transfer.clone().or_else(identified)
    }

    /// True if its measurement of a tick answers the command of the tick before.
    #[must_use]
    pub fn answers_late(&self) -> bool {
        let bus = self.bus.as_ref();
        bus.is_some_and(|bus| bus.sample == BusSample::NextTick)
    }

    /// The known actuator as the loop sees it, with ticks of `tick_s`: where the inputs of a bus are read with the outputs,
    /// they answer the command before. An identified delay contains that.
    #[must_use]
    pub fn transfer_in_the_loop(&self, pace: f64, tick_s: f64) -> Option<TransferSpec> {
        let known = self.believed_transfer(pace);
        match (
            known,
            self.answers_late() && (self.transfer.is_some() || self.identified.is_none()),
        ) {
            (Some(own), true) => Some(TransferSpec {
                delay_s: own.delay_s + tick_s,
                ..own
            }),
            (known, _) => known,
        }
    }

    /// The simulated actuator and sensors of a simulated specimen; none behind a link.
    #[must_use]
    pub const fn own_transfer(&self) -> Option<&TransferSpec> {
        match &self.link {
            Some(_) => None,
            None => self.transfer.as_ref(),
        }
    }

    /// The law that replaces a specimen behind a link in a rehearsal, with its key; none for a simulated specimen.
    #[must_use]
    pub fn stand_in(&self) -> Option<(&'static str, SpecimenLaw)> {
        self.link.as_ref()?;
        self.source()
    }

    /// Number of axes as far as the table alone says it, without a structure to take deformations from.
    #[must_use]
    pub fn axes_by_itself(&self) -> usize {
        if let Some(geometry) = &self.geometry {
            return geometry.actuators();
        }
        let said = match (&self.link, &self.laws, &self.coupled, &self.bearing) {
            (None, Some(laws), ..) => laws.len(),
            (None, _, Some(coupled), _) => coupled.stiffness_n_per_m.len(),
            (None, .., Some(bearing)) => bearing.axes(),
            (Some(link), ..) => {
                let estimate = self.stiffness_n_per_m.as_ref();
                let named = link.axis_names.as_ref().map_or(0, Vec::len);
                let on_bus = self.bus.as_ref().map_or(0, |bus| bus.axis.len());
                let estimated = estimate.map_or(0, |matrix| matrix.rows().len());
                estimated.max(named).max(on_bus)
            }
            _ => 1,
        };
        said.max(self.axis.len()).max(1)
    }

    /// Number of axes as far as the table says it.
    #[must_use]
    pub fn axes(&self) -> usize {
        match (&self.geometry, &self.storey, &self.rows) {
            (None, Some(_), _) => 1,
            (None, _, Some(rows)) => rows.len(),
            (None, ..) => match &self.deformations {
                Some(deformations) => deformations.len(),
                None => self.axes_by_itself(),
            },
            _ => self.axes_by_itself(),
        }
    }

    /// Symbols of the units of displacement and force of each axis.
    #[must_use]
    pub fn units(&self) -> Vec<[&'static str; 2]> {
        let symbols =
            |axis: &AxisTable| [axis.unit_disp.row().symbol, axis.unit_force.row().symbol];
        let default = AxisTable::default();
        let table = |index: usize| self.axis.get(index).unwrap_or(&default);
        (0..self.axes())
            .map(|index| symbols(table(index)))
            .collect()
    }

    /// The other end of its link, if that is known to answer with forces only, without a measured displacement.
    #[must_use]
    pub fn force_only_link(&self) -> Option<ForceOnly> {
        let link = self.link.as_ref()?;
        if link.protocol == Protocol::Ethercat {
            let bus = self.bus.as_ref().filter(|bus| bus.is_force_only());
            return bus.map(|_| ForceOnly::Bus);
        }
        let (_, answer) = link.signals(self.axes())?;
        let peer = link.peer().filter(|_| answer.disp == 0);
        peer.map(ForceOnly::Peer)
    }

    /// Number of axes of its laws and estimates: those of the specimen, or the coordinates of its platform.
    #[must_use]
    pub fn law_axes(&self) -> usize {
        match &self.geometry {
            Some(geometry) if geometry.law_at == LawPlace::Platform => geometry.width(),
            _ => self.axes(),
        }
    }

    /// Bounds of each of `axes` axes.
    #[must_use]
    pub fn limits_of(&self, axes: usize) -> Vec<LimitsSpec> {
        let all = self.limits.unwrap_or_default();
        let own = |index: usize| self.axis.get(index).and_then(|axis| axis.limits);
        let merged = |index| own(index).unwrap_or_default().over(&all);
        (0..axes).map(merged).collect()
    }

    /// True if a displacement or a force of an axis is another for the structure, units apart.
    #[must_use]
    pub fn is_scaled(&self) -> bool {
        let is_geared = |axis: &AxisTable| axis.scale != 1.0 || axis.sign != 1;
        let similitude = &self.similitude;
        self.axis.iter().any(is_geared) || similitude.length != 1.0 || similitude.force != 1.0
    }

    /// True if a key makes the displacements or forces of a structure others than those of an axis, units apart.
    #[must_use]
    pub(crate) fn converts(&self) -> bool {
        let is_geared = |axis: &AxisTable| axis.gear().iter().any(|(_, given)| *given);
        let is_scaled = self.similitude != SimilitudeTable::default();
        self.geometry.is_some() || is_scaled || self.axis.iter().any(is_geared)
    }

    /// True if its force depends on its velocity, by its declared damping or by a law.
    #[must_use]
    pub fn resists_velocity(&self) -> bool {
        let damping = self.damping_n_s_per_m.iter().flat_map(MatrixValue::rows);
        let is_damped = damping.flatten().any(|entry| entry != 0.0);
        is_damped || (self.source()).is_some_and(|(_, law)| law.resists_velocity())
    }

    /// Units of each of `axes` axes.
    #[must_use]
    pub fn units_of(&self, axes: usize) -> Vec<AxisUnits> {
        let default = AxisTable::default();
        let units = |index: usize| self.axis.get(index).unwrap_or(&default).units();
        (0..axes).map(units).collect()
    }

    /// The law that is given, with its key. A checked file has exactly one, or a link and at most one.
    #[must_use]
    pub fn source(&self) -> Option<(&'static str, SpecimenLaw)> {
        let law = self.law.clone().map(|law| ("law", SpecimenLaw::Law(law)));
        let laws = || Some(("laws", SpecimenLaw::Laws(self.laws.clone()?)));
        let coupled = || Some(("coupled", SpecimenLaw::Coupled(self.coupled.clone()?)));
        let bearing = || Some(("bearing", SpecimenLaw::Bearing(self.bearing.clone()?)));
        law.or_else(laws).or_else(coupled).or_else(bearing)
    }
}

/// Gives each specimen on a bus its link, unless the user wrote one.
pub(crate) fn link_specimens(buses: &Buses, specimens: &mut [SpecimenTable]) {
    for table in specimens {
        if let Some(spec) = &table.bus {
            let link = || spec.link(buses.get(&spec.bus));
            table.link.get_or_insert_with(link);
        }
    }
}

/// Scale factors, quantity of the structure divided by quantity of the specimen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SimilitudeTable {
    /// Length scale: d_structure = length · d_specimen. 10 is a specimen at a scale of one to ten.
    #[schemars(example = 2.0)]
    pub length: f64,
    /// Force scale: f_structure = force · f_specimen.
    #[schemars(example = 4.0)]
    pub force: f64,
    /// Time scale: t_structure = time · t_specimen. Velocities have the factor length / time.
    #[schemars(example = 1.414)]
    pub time: f64,
}

impl Default for SimilitudeTable {
    fn default() -> Self {
        Self {
            length: 1.0,
            force: 1.0,
            time: 1.0,
        }
    }
}
