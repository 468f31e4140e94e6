//! All that a port is built from, and what fits together of it.

use super::command_path::CommandPath;
use super::compensators::{Compensation, Compensators};
use super::error::fits;
use super::estimates::Estimates;
use super::exchange::Exchange;
use super::feedback::Feedback;
use super::initial_stiffness::InitialStiffness;
use super::limits::AxisLimits;
use super::loading_unit::LoadingUnit;
use super::startup::Startup;
use super::tracking::{Tracking, TrackingSpec};
use super::{
    Axis, Declared, Exit, Exits, Guard, NeedsMeasuredDisp, Order, Port, PortError, PoseRow,
    Reference, WaitRules, WiringCheck,
};
use gusset_actuator::geometry::{Geometry, LawPlace};
use gusset_quantity::frame::{AtAxis, AtStructure};
use gusset_quantity::substructure::Substructure;

/// One axis of a specimen, with everything that is declared of it.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisSpec {
    /// Row of B, gains and offsets.
    pub axis: Axis,
    /// k̂ in N/m at the structure. It extrapolates a stale force.
    pub stiffness: f64,
    /// Metres and newtons in one unit of the axis.
    pub units: (f64, f64),
    /// SI at the specimen's own scale.
    pub limits: AxisLimits,
    /// Which channels take their zero from what is read.
    pub reference: Reference,
    /// Declared values at the structure.
    pub declared: Declared,
}

impl AxisSpec {
    /// An axis in metres and newtons without limits, whose zero is declared.
    #[must_use]
    pub fn new(axis: Axis, stiffness: f64) -> Self {
        Self {
            axis,
            stiffness,
            units: (1.0, 1.0),
            limits: AxisLimits::NONE,
            reference: Reference::default(),
            declared: Declared::NONE,
        }
    }
}

/// The loading unit whose actuators the axes are, at the structure's scale.
#[derive(Debug, Clone)]
pub struct LoadingUnitSpec {
    /// Where the actuators are.
    pub geometry: Geometry,
    /// Rows of B, one per coordinate.
    pub rows: Vec<PoseRow>,
    /// Where the specimen's stiffness is the same for every pose.
    pub law_at: LawPlace,
}

/// Everything that a [`Port`] is built from.
pub struct PortSpec {
    /// Name from the test file.
    pub name: String,
    /// Degrees of freedom of the structure.
    pub dofs: usize,
    /// One per axis of the substructure.
    pub axes: Vec<AxisSpec>,
    /// Takes commands and answers.
    pub substructure: Box<dyn Substructure>,
    /// k̂ of all axes in N/m, n × n by rows; the diagonal is not looked at. Empty if the axes do not know of each other.
    pub coupling: Vec<Vec<f64>>,
    /// None if the axes are directions of the structure.
    pub loading_unit: Option<LoadingUnitSpec>,
    /// Δt of the integration, s.
    pub dt: f64,
    /// Wall time of a tick, s.
    pub tick: f64,
    /// Wall time from command to command in the running test, s; none: a tick.
    pub step: Option<f64>,
    /// It is commanded once a step, and may take several ticks for its answer.
    pub per_step: bool,
    /// Order of the path between targets of the others.
    pub order: Order,
    /// None if nothing is compensated.
    pub compensation: Option<Compensation>,
    /// None if delay and gain are not estimated.
    pub tracking: Option<TrackingSpec>,
    /// How the loop waits for it; none: by the limits of the test.
    pub wait: Option<WaitRules>,
    /// How the wiring is checked.
    pub wiring: WiringCheck,
    /// A computation answers, and no machine.
    pub is_computed: bool,
    /// What needs the measured displacement.
    pub needs_measured_disp: NeedsMeasuredDisp,
    /// How the specimen is left.
    pub exits: Exits,
    /// Where a specimen stands that does not report it, m of the specimen, one value per axis.
    pub stands_at_m: Option<Vec<f64>>,
}

impl std::fmt::Debug for PortSpec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PortSpec")
            .field("name", &self.name)
            .field("axes", &self.axes)
            .finish_non_exhaustive()
    }
}

impl PortSpec {
    /// A specimen in a structure of `dofs` degrees of freedom: commanded in every tick of one second, without limits, compensation
    /// or tracking.
    #[must_use]
    pub fn new(
        name: impl Into<String>,
        substructure: Box<dyn Substructure>,
        dofs: usize,
        axes: Vec<AxisSpec>,
    ) -> Self {
        Self {
            name: name.into(),
            dofs,
            axes,
            substructure,
            coupling: Vec::new(),
            loading_unit: None,
            dt: 0.0,
            tick: 1.0,
            step: None,
            per_step: false,
            order: Order::default(),
            compensation: None,
            tracking: None,
            wait: None,
            wiring: WiringCheck::Known,
            is_computed: false,
            needs_measured_disp: NeedsMeasuredDisp::default(),
            exits: Exits::default(),
            stands_at_m: None,
        }
    }

    /// Joins the specimen to its structure.
    ///
    /// # Errors
    /// A list whose length does not fit, a row of B beyond the structure, or a gain that cannot be undone.
    pub fn build(self) -> Result<Port, PortError> {
        self.check()?;
        Ok(self.join())
    }

    pub(super) fn check(&self) -> Result<(), PortError> {
        let n = self.axes.len();
        let axes = self.substructure.axes();
        if n != axes {
            return Err(PortError::Axes { rows: n, axes });
        }
        for (index, spec) in self.axes.iter().enumerate() {
            spec.axis.check(index, self.dofs)?;
        }
        if !self.coupling.is_empty() {
            fits("rows of k̂", self.coupling.len(), n)?;
        }
        for row in &self.coupling {
            fits("entries in a row of k̂", row.len(), n)?;
        }
        if let Some(unit) = &self.loading_unit {
            fits(
                "actuators of the loading unit",
                unit.geometry.actuators(),
                n,
            )?;
            let coordinates = unit.geometry.coordinates().len();
            fits(
                "rows of B of the loading unit",
                unit.rows.len(),
                coordinates,
            )?;
        }
        if let Some(compensation) = &self.compensation {
            fits("compensators", compensation.compensators.len(), n)?;
        }
        if let Some(tracking) = self.tracking.as_ref().filter(|of| !of.critical.is_empty()) {
            fits("tables of critical delays", tracking.critical.len(), n)?;
        }
        for exit in [&self.exits.on_trip, &self.exits.at_end] {
            if let Exit::Safe(disp) = exit {
                fits("safe positions", disp.len(), n)?;
            }
        }
        if let Some(stands) = &self.stands_at_m {
            fits("stated positions", stands.len(), n)?;
        }
        Ok(())
    }

    /// A port of parts that fit.
    pub(super) fn join(self) -> Port {
        let units: Vec<(f64, f64)> = self.axes.iter().map(|spec| spec.units).collect();
        let stiffness: Vec<f64> = self.axes.iter().map(|spec| spec.stiffness).collect();
        let limits = self.axes.iter().map(|spec| spec.limits).collect();
        let declared: Vec<Declared> = self.axes.iter().map(|spec| spec.declared).collect();
        let references = self.axes.iter().map(|spec| spec.reference).collect();
        let axes: Vec<Axis> = self.axes.into_iter().map(|spec| spec.axis).collect();

        let mut guard = Guard::new(limits, units.clone(), self.tick);
        if let Some(step) = self.step {
            guard.set_ticks(self.tick, step);
        }
        let mut path = CommandPath::new(&axes);
        path.set_pace(self.per_step, self.order);
        if let Some(compensation) = self.compensation {
            let metres = units.iter().map(|(metres, _)| *metres).collect();
            path.set_compensators(Compensators::new(compensation, metres));
        }
        let mut tracking = Tracking::new(axes.len());
        if let Some(spec) = self.tracking {
            let noise = spec.noise_m.unwrap_or(0.0);
            let noise = axes
                .iter()
                .zip(&units)
                .map(|(axis, (metres, _))| (noise / (metres * axis.disp_gain)).abs());
            tracking.declare_noise(noise);
            tracking.begin(spec);
        }
        let mut startup = Startup::new(
            references,
            self.wiring,
            self.is_computed,
            self.needs_measured_disp,
        );
        if let Some(stands) = self.stands_at_m {
            let stated = stands
                .iter()
                .zip(&units)
                .map(|(disp, (metres, _))| disp / metres);
            startup.state_position(AtAxis(stated.collect()));
        }
        let stiffness = InitialStiffness::new(AtStructure(stiffness), &self.coupling);
        let mut exchange = Exchange::new(self.substructure);
        exchange.set_wait(self.wait);
        let loading_unit = self
            .loading_unit
            .map(|unit| Box::new(LoadingUnit::new(unit.geometry, unit.rows, unit.law_at)));
        Port {
            name: self.name,
            feedback: Feedback::new(axes.len()),
            estimates: Estimates::new(stiffness.own(), &declared, self.dt),
            stiffness,
            loading_unit,
            path,
            exchange,
            guard,
            tracking,
            startup,
            exits: self.exits,
            retrace: None,
            axes,
        }
    }
}
