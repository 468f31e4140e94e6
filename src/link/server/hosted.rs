//! The specimen of a server: its name, its axes, and how it is made for each test.

use std::sync::Arc;

use crate::announce::units_of;
use crate::fault::Bench;
use crate::served::{
    AxesBehind, ClientScale, Computed, GuardStore, Latch, LinkBuild, LinkMaker, Memory, Pacing,
    RecordSettings, ServedSpecimen, Unconnected, Whereabouts, first_words,
};
use gusset_actuator::specimen::Specimen;
use gusset_config::fault_script::Script;
use gusset_config::{LimitsSpec, ScriptError, check_script};
use gusset_control::port::limits::AxisLimits;
use gusset_control::port::{ReceivedPort, WiringCheck};
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::Substructure;
use gusset_quantity::units::AxisUnits;
use gusset_wire::handshake::{Axis, Capabilities};

/// A hosted specimen, and how to make a new one for each test.
pub struct Host {
    pub(super) name: String,
    pub(super) axes: Vec<Axis>,
    pub(super) stiffness: Vec<f64>,
    mass: Vec<f64>,
    behind: Behind,
    units: Vec<AxisUnits>,
    limits: Vec<LimitsSpec>,
    /// How its wiring is checked, and whether a computation answers.
    check: (WiringCheck, bool),
    record: Option<RecordSettings>,
    pub(super) faults: Option<Arc<Script>>,
    memory: Option<Memory>,
    guard: GuardStore,
    latch: Latch,
    gateway: GatewaySettings,
}

/// Settings of a gateway.
#[derive(Default)]
struct GatewaySettings {
    /// Its specimen answers with forces only.
    lacks_disp: bool,
    /// Conversion of the commands of its controllers.
    conversion: Option<Conversion>,
    /// Pacing of their targets.
    pacing: Option<Pacing>,
}

/// Makes the port of a gateway around its link.
pub type PortBuild =
    Arc<dyn Fn(Box<dyn Substructure>) -> Result<ReceivedPort, String> + Send + Sync>;

/// How a gateway converts its controllers' commands to the axes of the specimen.
#[derive(Clone)]
pub struct Conversion {
    /// Makes the port that converts.
    pub port: PortBuild,
    /// The axes behind it.
    pub behind: AxesBehind,
}

impl std::fmt::Debug for Conversion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Conversion")
            .field("behind", &self.behind)
            .finish_non_exhaustive()
    }
}

impl Conversion {
    fn build(&self) -> Result<ReceivedPort, String> {
        let axes = self.behind.units.len();
        (self.port)(Box::new(Unconnected { axes }))
    }
}

/// Makes a specimen in its virgin state, or returns why not.
pub type Build = Box<dyn Fn() -> Result<Box<dyn Specimen>, String> + Send + Sync>;

enum Behind {
    Law(Build),
    Link(LinkBuild, u64, Whereabouts),
}

impl std::fmt::Debug for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host")
            .field("name", &self.name)
            .field("axes", &self.axes)
            .finish_non_exhaustive()
    }
}

impl Host {
    /// `build` makes the specimen in the units of `axes`, with as many axes.
    ///
    /// # Errors
    /// Errors of `build`, or another number of axes.
    pub fn new(name: String, axes: Vec<Axis>, build: Build) -> Result<Self, String> {
        let n = axes.len();
        let specimen = build()?;
        if specimen.axes() != n {
            return Err(format!("{n} axes wanted, {} found", specimen.axes()));
        }
        let (stiffness, mass) = Computed::new(specimen, false).reference();
        let behind = Behind::Law(build);
        let check = WiringCheck::Known;
        Ok(Self::of(name, axes, [stiffness, mass], behind, check))
    }

    fn of(
        name: String,
        axes: Vec<Axis>,
        [stiffness, mass]: [Vec<f64>; 2],
        behind: Behind,
        check: WiringCheck,
    ) -> Self {
        Self {
            name,
            units: axes.iter().map(units_of).collect(),
            axes,
            stiffness,
            mass,
            behind,
            limits: Vec::new(),
            check: (check, false),
            record: None,
            faults: None,
            memory: None,
            guard: GuardStore::default(),
            latch: Latch::default(),
            gateway: GatewaySettings::default(),
        }
    }

    /// A gateway: `build` makes the link to the specimen. `stiffness` is the estimate, n × n by columns in the units of
    /// `axes`. An answer may take up to `reply_limit_ns`.
    #[must_use]
    pub fn gateway(
        name: String,
        axes: Vec<Axis>,
        stiffness: Vec<f64>,
        build: LinkBuild,
        reply_limit_ns: u64,
    ) -> Self {
        let mass = vec![0.0; axes.len() * axes.len()];
        let behind = Behind::Link(build, reply_limit_ns, Whereabouts::default());
        let check = WiringCheck::Unchecked;
        Self::of(name, axes, [stiffness, mass], behind, check)
    }

    /// For a gateway whose specimen cannot report its position: the position before the first test, in the units of the axes.
    #[must_use]
    pub fn said_to_stand_at(mut self, place: Vec<f64>) -> Self {
        if let Behind::Link(.., whereabouts) = &mut self.behind {
            *whereabouts = Whereabouts::said(place);
        }
        self
    }

    /// The specimen behind this gateway answers with forces only. The handshake announces that no displacement is
    /// measured.
    #[must_use]
    pub const fn without_measured_disp(mut self) -> Self {
        self.gateway.lacks_disp = true;
        self
    }

    /// Makes the gateway convert: its own axes and units are the signals of its controllers. Limits, position and wiring check belong
    /// to the axes behind.
    #[must_use]
    pub fn converting(mut self, conversion: Conversion) -> Self {
        self.gateway.conversion = Some(conversion);
        self
    }

    /// Makes the gateway lead its specimen to each target by a path of commands.
    #[must_use]
    pub const fn paced(mut self, pacing: Option<Pacing>) -> Self {
        self.gateway.pacing = pacing;
        self
    }

    /// Declares that the gateway leads to a computation: its position counts as zero where no measurement gives it.
    #[must_use]
    pub fn computed(mut self) -> Self {
        if let Behind::Link(.., whereabouts) = &mut self.behind {
            *whereabouts = std::mem::take(whereabouts).of_a_computation();
        }
        self
    }

    /// The units of its axes, one entry per axis, where the handshake's units are not they: inches, pounds and kips. Such a
    /// specimen is served by OpenFresco's protocols only.
    #[must_use]
    pub fn in_units(mut self, units: Vec<AxisUnits>) -> Self {
        if units.len() == self.axes.len() {
            self.units = units;
        }
        self
    }

    /// The bounds of its axes.
    #[must_use]
    pub fn limited(mut self, limits: Vec<LimitsSpec>) -> Self {
        self.limits = limits;
        self
    }

    /// How the wiring of a specimen behind a link is checked. `computed`: a computation answers.
    #[must_use]
    pub fn checked(mut self, check: WiringCheck, computed: bool) -> Self {
        self.check = (check, computed);
        self
    }

    /// Each controller's test gets a run folder.
    #[must_use]
    pub fn recorded(mut self, record: RecordSettings) -> Self {
        self.record = Some(record);
        self
    }

    /// Where its trips are latched: else in memory, for as long as this host lives.
    #[must_use]
    pub fn latched(mut self, latch: Latch) -> Self {
        self.latch = latch;
        self
    }

    /// The latch of its trips.
    #[must_use]
    pub fn latch(&self) -> Latch {
        self.latch.clone()
    }

    /// Shares the limits' history and the latch with `other`, which serves the same specimen.
    #[must_use]
    #[cfg(any(test, feature = "test-doubles"))]
    pub fn guarded_as(mut self, other: &Self) -> Self {
        (self.guard, self.latch) = (other.guard.clone(), other.latch.clone());
        self
    }

    /// A formula keeps its state from test to test, as a real specimen does. Otherwise each test finds it as new.
    #[must_use]
    pub fn remembering(mut self) -> Self {
        self.memory = Some(Memory::default());
        self
    }

    /// Like `new`, but the first test finds the specimen at `disp`, moved from its virgin state: one displacement per axis in
    /// their units.
    ///
    /// # Errors
    /// Errors of its maker, another number of displacements, or a specimen behind a link, which reports its position
    /// itself.
    #[cfg(any(test, feature = "test-doubles"))]
    pub fn standing_at(mut self, disp: &[f64]) -> Result<Self, String> {
        let Behind::Law(build) = &self.behind else {
            return Err("the specimen is behind a link, and stands where it stands".to_owned());
        };
        if disp.len() != self.axes.len() {
            let (axes, found) = (self.axes.len(), disp.len());
            return Err(format!("{axes} displacements wanted, {found} found"));
        }
        self.memory = Some(Memory::of(build()?.as_mut(), disp));
        Ok(self)
    }

    /// True if a formula keeps its state from test to test.
    #[must_use]
    pub const fn remembers(&self) -> bool {
        self.memory.is_some()
    }

    /// True of a computed specimen that each test finds as new.
    #[must_use]
    pub(crate) const fn starts_anew(&self) -> bool {
        !self.is_gateway() && !self.remembers()
    }

    /// The specimen's position; empty if it is not known before a controller arms it. A gateway learns it with its first
    /// test. The second test shows whether a possible computation keeps its position.
    #[must_use]
    pub fn standing(&self) -> Vec<f64> {
        match &self.behind {
            Behind::Link(.., whereabouts) => self.as_controllers_count(whereabouts.place()),
            Behind::Law(_) => {
                let left = self.memory.as_ref().and_then(Memory::disp);
                left.unwrap_or_else(|| vec![0.0; self.axes.len()])
            }
        }
    }

    /// A place of the axes in the signals of the controllers; empty if it is unknown.
    fn as_controllers_count(&self, place: Vec<f64>) -> Vec<f64> {
        let Some(conversion) = self
            .gateway
            .conversion
            .as_ref()
            .filter(|_| !place.is_empty())
        else {
            return place;
        };
        let scale = ClientScale {
            units: self.units.clone(),
            behind: Some(conversion.behind.clone()),
        };
        let port = conversion.build().ok();
        let disp = port.and_then(|port| scale.disp_at(&port, AtAxis(&place)).ok());
        disp.unwrap_or_default().0
    }

    /// Every test meets these faults, the same each time.
    ///
    /// # Errors
    /// The script cannot be played, or the specimen is no formula: a real one is not to be played with.
    pub fn faulty(mut self, script: Script) -> Result<Self, ScriptError> {
        check_script(&script, Some(self.axes.len()))?;
        if self.is_gateway() {
            return Err(ScriptError {
                fault: None,
                key: "fault",
                text: "is for specimens that are computed, but this one is behind a link"
                    .to_owned(),
            });
        }
        self.faults = Some(Arc::new(script));
        Ok(self)
    }

    /// True if the specimen is behind a link.
    #[must_use]
    pub const fn is_gateway(&self) -> bool {
        matches!(self.behind, Behind::Link(..))
    }

    /// How the first command of a test is judged on axes whose steps the file does not bound, in words. `moves`: it is no mere
    /// computation; a gateway never is.
    #[must_use]
    pub fn first_command(&self, moves: bool) -> Vec<String> {
        if !(moves || self.is_gateway()) {
            return Vec::new();
        }
        let bound = |index| {
            self.limits
                .get(index)
                .map_or(AxisLimits::NONE, AxisLimits::of)
        };
        let behind = self.gateway.conversion.as_ref();
        let units = behind.map_or(&self.units, |conversion| &conversion.behind.units);
        let limits: Vec<AxisLimits> = (0..units.len()).map(bound).collect();
        first_words(&limits, units)
    }

    pub(super) fn capabilities(&self) -> Capabilities {
        // A gateway passes on its specimen's measurements, and itself warns of a missing one.
        let kind = match self.behind {
            // In its first test a process finds the specimen as new: it holds no state of an interrupted test.
            Behind::Law(_) if self.memory.as_ref().is_some_and(Memory::is_of_a_test) => {
                Capabilities::SIMULATED.and(Capabilities::KEEPS_STATE)
            }
            Behind::Law(_) => Capabilities::SIMULATED,
            // It reports its own trips as an interlock.
            Behind::Link(..) => Capabilities::INTERLOCK,
        };
        let kind = kind.and(Capabilities::USES_VEL);
        if self.gateway.lacks_disp {
            kind
        } else {
            kind.and(Capabilities::MEASURES_DISP)
        }
    }

    /// The specimen in its virgin state, or across a link that is not connected. `remembers`: a computed specimen keeps its state
    /// from test to test.
    ///
    /// # Errors
    /// Errors of its maker.
    pub fn specimen(&self, remembers: bool) -> Result<ServedSpecimen, String> {
        let (name, units) = (self.name.clone(), self.units.clone());
        let (stiffness, mass) = (self.stiffness.clone(), self.mass.clone());
        let served = match &self.behind {
            Behind::Law(build) => {
                let computed = Computed::new(build()?, remembers);
                let computed = Box::new(match &self.memory {
                    Some(memory) => computed.recalling(memory.clone()),
                    None => computed,
                });
                let substructure = match &self.faults {
                    Some(script) => Bench::around(computed, script, units.clone()),
                    None => computed,
                };
                ServedSpecimen::new(name, substructure, units, stiffness, mass)
            }
            Behind::Link(build, reply_limit_ns, whereabouts) => {
                let links = LinkMaker::new(build.clone(), whereabouts.clone(), *reply_limit_ns);
                let served = match &self.gateway.conversion {
                    None => ServedSpecimen::linked(name, links, units, stiffness, mass),
                    Some(conversion) => {
                        let (port, behind) = (conversion.build()?, conversion.behind.clone());
                        ServedSpecimen::converted(links, port, behind, units, [stiffness, mass])
                    }
                };
                served.paced(self.gateway.pacing)
            }
        };
        let (check, computed) = self.check.clone();
        Ok(served
            .limited(&self.limits)
            .guarded(self.guard.clone(), self.latch.clone())
            .remembering(remembers || self.memory.is_some())
            .checked(check, computed)
            .played(self.faults.as_ref().map(|script| script.words()))
            .recorded(self.record.clone()))
    }
}
