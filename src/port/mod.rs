//! What stands between the structure's degrees of freedom and a specimen's axes.
//!
//! A [`Port`] holds one substructure and every intermediate value of its way: the target B·x, the command
//! that was sent, what was measured, and the force after offsets. All of them stand in the row, so nothing that
//! a specimen was told is hidden. Pure bookkeeping: no clock, no input or output of its own.

mod believed;
mod bend;
mod compensated;
mod direction;
mod error;
mod estimate;
mod exchange;
mod follows;
mod guard;
mod leaving;
pub mod limits;
mod link;
mod margin;
mod misfit;
mod opening;
mod path;
mod posed;
mod probe;
mod pursuit;
mod ramp;
mod rest;
mod rows;
mod stiffness;
mod tangent;
mod tempo;
mod tracking;
mod trend;
mod unloading;

pub use believed::Believed;
pub use direction::Direction;
pub use error::PortError;
pub use estimate::Declared;
pub use follows::Follows;
pub use leaving::{Departure, Exit, Exits};
pub use link::{LinkCount, NeedsMeasuredDisp, OnStale, Partner, WaitRules};
pub use misfit::{Channel, Misfit};
pub use opening::{DispZero, Reading, Reference, Zero};
pub use path::{Order, Path, Point, shares};
pub use posed::{PoseRow, Poses};
pub use probe::{Found, Pace, Probe};
pub use ramp::UNBOUNDED_RAMP_S;
pub use rest::Rest;
pub use stiffness::{Opinion, compare_stiffness};
pub use tangent::{Point as TangentPoint, Tangent};
pub use tempo::{HOLD_AT, SLOW_FROM, Stride, Tempo};
pub use trend::Trend;
pub use unloading::Astray;

pub use crate::catalog::phase::Stage;

use crate::stability::CriticalDelay;
use crate::substructure::{Measurement, Status, Substructure};

/// One axis of a specimen as the structure sees it: the row of B and the map between the two systems of units.
///
/// Command = `disp_gain`·d + `disp_offset`, force = `force_gain`·(raw − `force_offset`). The gains carry
/// sign, scale, similitude and unit; for a specimen in SI units and full scale they are 1 and the offsets 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Nonzero entries of the row of B: degree of freedom (from 0) and coefficient. Of an actuator: what the stroke is of
    /// small displacements.
    pub row: Vec<(usize, f64)>,
    /// b·ι: the part of a base displacement that this deformation does not see.
    pub base: f64,
    /// Specimen displacement units per metre.
    pub disp_gain: f64,
    /// Command at d = 0, in the specimen's unit.
    pub disp_offset: f64,
    /// What the displacement sensor reads there beyond the command: 0 unless it was found while zeroing.
    pub measured_offset: f64,
    /// Specimen velocity units per m/s.
    pub vel_gain: f64,
    /// Newtons at the structure per unit of raw force.
    pub force_gain: f64,
    /// Raw force to be taken as zero, in the specimen's unit.
    pub force_offset: f64,
}

impl Axis {
    /// An axis in SI units at full scale.
    #[must_use]
    pub fn plain(row: Vec<(usize, f64)>) -> Self {
        Self {
            row,
            base: 0.0,
            disp_gain: 1.0,
            disp_offset: 0.0,
            measured_offset: 0.0,
            vel_gain: 1.0,
            force_gain: 1.0,
            force_offset: 0.0,
        }
    }

    /// d in m at the structure for which this is the command, in the specimen's unit. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn deformation(&self, command: f64) -> f64 {
        (command - self.disp_offset) / self.disp_gain
    }

    /// Displacement in m and force in N at the structure of what was measured in the specimen's units. Real-time: yes.
    #[inline]
    fn at_structure(&self, disp: f64, force: f64) -> (f64, f64) {
        let disp = (disp - self.measured_offset - self.disp_offset) / self.disp_gain;
        (disp, self.force_gain * (force - self.force_offset))
    }

    /// b·x and b·v, relative to the base. Real-time: yes.
    #[inline]
    fn dots(&self, state: [&[f64]; 2], base: [f64; 2]) -> (f64, f64) {
        posed::dots(&self.row, self.base, state, base)
    }
}

/// One substructure with its axes and every value of the current tick. All vectors have one entry per axis.
pub struct Port {
    /// Name from the test file.
    pub name: String,
    axes: Vec<Axis>,
    substructure: Box<dyn Substructure>,
    /// Deformation that the structure asks for: B·x, in m; of an actuator the stroke for the pose B·x.
    pub target: Vec<f64>,
    /// Velocity of the target in m/s (it belongs to t − Δt/2 with the published start).
    pub target_vel: Vec<f64>,
    /// What is sent, in the specimen's unit.
    pub command: Vec<f64>,
    command_vel: Vec<f64>,
    /// What was sent last, in the specimen's unit.
    pub sent: Vec<f64>,
    /// Where the specimen says that it stands before the test, in its own unit.
    standing: Option<Vec<f64>>,
    raw: Measurement,
    /// Where the substructure writes, so that an older measurement never replaces a newer one. Between two exchanges its axes
    /// are those of `raw`.
    incoming: Measurement,
    /// Force of an answer that was recovered last, N.
    pub recovered: Vec<f64>,
    /// Measured displacement, brought back to the structure's metres.
    pub measured: Vec<f64>,
    /// Restoring force in N that enters equilibrium.
    pub force: Vec<f64>,
    /// Largest |force| so far.
    pub peak_force: Vec<f64>,
    /// The same of every exchange before the test.
    pub force_on_the_way_in: Vec<f64>,
    /// The same without what was measured after the last command of the test: nothing of it has stopped anything.
    carried: Vec<f64>,
    /// Exchanges so far.
    pub link: LinkCount,
    /// Who answers, as the loop sees it.
    pub partner: Partner,
    /// How long this specimen is waited for; none: as the test's limits say.
    pub wait: Option<WaitRules>,
    /// How it is found out which way round the specimen is wired.
    pub direction: Direction,
    /// The test file says that a computation answers, and no machine.
    pub computed: bool,
    /// What needs its measured displacement.
    pub needs_measured_disp: NeedsMeasuredDisp,
    /// Where the test file says that a specimen stands which cannot tell, in its own unit.
    stated: Option<Vec<f64>>,
    /// True if a recording stands for the substructure.
    is_recorded: bool,
    /// Number on the link of the command that left last.
    issued: Option<u64>,
    /// The last command did not leave.
    unsent: bool,
    /// A command has left, and its answer was not taken yet.
    owes: bool,
    /// Exchanges that were none of the test's: by so much the numbers on the link are ahead of the test's.
    ahead: u64,
    /// How it is led from one target to the next.
    pursuit: pursuit::Pursuit,
    stiffness: Vec<f64>,
    guard: guard::Guard,
    /// The loading unit whose actuators the axes are.
    posed: Option<Box<posed::Posed>>,
    estimates: estimate::Estimates,
    opening: opening::Opening,
    ramp: ramp::Ramp,
    /// Zero velocities.
    still: Vec<f64>,
    compensation: Option<compensated::Compensation>,
    tracking: tracking::Tracking,
    /// One per axis, or none at all.
    critical: Vec<CriticalDelay>,
    /// The test runs.
    runs: bool,
    /// How the specimen is left.
    pub exits: Exits,
}

impl std::fmt::Debug for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Port")
            .field("name", &self.name)
            .field("axes", &self.axes)
            .finish()
    }
}

impl Port {
    /// Joins a substructure to a structure of `dofs` degrees of freedom. `stiffness` is the estimate k̂, one
    /// value per axis in N/m as the structure sees it, used to extrapolate a stale force.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn new(
        name: impl Into<String>,
        axes: Vec<Axis>,
        substructure: Box<dyn Substructure>,
        dofs: usize,
        stiffness: Vec<f64>,
    ) -> Result<Self, PortError> {
        let n = substructure.axes();
        if axes.len() != n || stiffness.len() != n {
            return Err(PortError::Axes {
                rows: axes.len(),
                axes: n,
            });
        }
        for (index, axis) in axes.iter().enumerate() {
            if let Some(&(dof, _)) = axis.row.iter().find(|&&(dof, _)| dof >= dofs) {
                return Err(PortError::Dof {
                    row: index + 1,
                    dof: dof + 1,
                    dofs,
                });
            }
            let gains = [
                ("displacement gain", axis.disp_gain),
                ("velocity gain", axis.vel_gain),
                ("force gain", axis.force_gain),
            ];
            if let Some(&(what, found)) = gains.iter().find(|(_, g)| !(g.is_finite() && *g != 0.0))
            {
                return Err(PortError::Gain {
                    axis: index + 1,
                    what,
                    found: found.to_string(),
                });
            }
        }
        // Until the specimen says where it stands, it stands where the deformation is zero.
        let stands = axes.iter().map(|axis| axis.disp_offset).collect();
        Ok(Self {
            name: name.into(),
            axes,
            substructure,
            target: vec![0.0; n],
            target_vel: vec![0.0; n],
            command: vec![0.0; n],
            command_vel: vec![0.0; n],
            sent: stands,
            standing: None,
            raw: Measurement::zeros(n),
            incoming: Measurement::zeros(n),
            recovered: vec![0.0; n],
            measured: vec![0.0; n],
            force: vec![0.0; n],
            peak_force: vec![0.0; n],
            force_on_the_way_in: vec![0.0; n],
            carried: vec![0.0; n],
            link: LinkCount::default(),
            partner: Partner::default(),
            wait: None,
            direction: Direction::Known,
            computed: false,
            needs_measured_disp: NeedsMeasuredDisp::default(),
            stated: None,
            issued: None,
            unsent: false,
            owes: false,
            ahead: 0,
            pursuit: pursuit::Pursuit::new(n),
            is_recorded: false,
            estimates: estimate::Estimates::new(&stiffness),
            stiffness,
            guard: guard::Guard::open(n),
            posed: None,
            opening: opening::Opening::absolute(n),
            ramp: ramp::Ramp::new(n),
            still: vec![0.0; n],
            compensation: None,
            tracking: tracking::Tracking::new(n),
            critical: Vec::new(),
            runs: false,
            exits: Exits::default(),
        })
    }

    /// Puts a recording with as many axes in place of the substructure that was there: it knows the test's numbers only.
    pub fn put_recording(&mut self, substructure: Box<dyn Substructure>) {
        if substructure.axes() == self.axes.len() {
            self.substructure = substructure;
            self.is_recorded = true;
        }
    }

    /// Number of axes.
    #[inline]
    #[must_use]
    pub fn axes(&self) -> usize {
        self.axes.len()
    }

    /// Whether a reply is owed for each command.
    #[inline]
    #[must_use]
    pub fn coupling(&self) -> crate::substructure::Coupling {
        self.substructure.coupling()
    }

    /// True if replies come from outside this process, so that a late one is the peer's doing.
    #[inline]
    #[must_use]
    pub fn is_remote(&self) -> bool {
        self.substructure.is_remote()
    }

    /// True if a recording answers in place of the specimen.
    #[inline]
    #[must_use]
    pub const fn is_recorded(&self) -> bool {
        self.is_recorded
    }

    /// The raw measurement of the last exchange, in the specimen's units.
    #[inline]
    #[must_use]
    pub fn raw(&self) -> &Measurement {
        &self.raw
    }

    /// True if that answers the command of the exchange, and is not the newest known in place of an answer that stayed away.
    /// Real-time: yes.
    #[inline]
    #[must_use]
    pub const fn is_fresh(&self) -> bool {
        !self.raw.status.has(Status::STALE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::limit::Limit;
    use crate::substructure::{Command, Coupling, Freshness, LinkFault, Retirement};
    use crate::time::Nanos;

    /// A spring in millimetres and kilonewtons, mounted the wrong way round, with a load cell that reads 2 at rest.
    #[derive(Debug)]
    struct Reversed {
        disp: f64,
    }

    impl Substructure for Reversed {
        fn axes(&self) -> usize {
            1
        }
        fn coupling(&self) -> Coupling {
            Coupling::Lockstep
        }
        fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
            self.disp = command.disp[0];
            Ok(())
        }
        fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
            into.disp[0] = self.disp;
            // 8 kN/m = 0.008 kN/mm, about a rest position of 5 mm.
            into.force[0] = 0.008 * (self.disp - 5.0) + 2.0;
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    fn reversed() -> Port {
        let axis = Axis {
            row: vec![(1, 1.0), (0, -1.0)],
            base: 0.0,
            disp_gain: -1000.0,
            disp_offset: 5.0,
            measured_offset: 0.0,
            vel_gain: -1000.0,
            force_gain: -1000.0,
            force_offset: 2.0,
        };
        Port::new(
            "rig",
            vec![axis],
            Box::new(Reversed { disp: 0.0 }),
            2,
            vec![8000.0],
        )
        .unwrap()
    }

    /// Judges and sends.
    fn send(port: &mut Port, sequence: u64) {
        assert_eq!(port.clear().trip, None);
        port.issue(sequence, 0.0, 0.0).unwrap();
    }

    #[test]
    fn a_command_that_was_not_judged_does_not_leave() {
        let mut port = reversed();
        assert_eq!(port.issue(0, 0.0, 0.0), Err(LinkFault::Refused));
        send(&mut port, 0);
        assert_eq!(port.issue(1, 0.0, 0.0), Err(LinkFault::Refused));
    }

    /// Whatever its displacement is: a link may use the velocity.
    #[test]
    fn a_command_whose_velocity_is_no_number_does_not_leave() {
        for vel in [f64::NAN, f64::INFINITY] {
            let mut port = reversed();
            port.aim(&[0.0, 0.001], &[0.0, vel], 0.0, 0.0);
            let hit = port.clear().trip.unwrap();
            assert_eq!((hit.axis, hit.quantity), (0, Limit::CommandVel));
            assert_eq!(port.issue(0, 0.0, 0.0), Err(LinkFault::Refused));
        }
    }

    /// Its sensors read 0.3 mm and 0.5 kN too much, and after an interruption 0.1 mm and 0.2 kN more.
    #[test]
    fn a_zero_that_is_read_and_its_drift_are_taken_off_what_is_read() {
        let relative = Reference {
            disp: Zero::Relative,
            force: Zero::Relative,
        };
        let mut port = reversed().with_references(vec![relative]);
        port.aim(&[0.0, 0.001], &[0.0, 0.0], 0.0, 0.0);
        send(&mut port, 0);
        let read = |port: &mut Port, disp: f64, force: f64| {
            port.collect(Nanos(0)).unwrap();
            (port.raw.disp[0], port.raw.force[0]) =
                (port.raw.disp[0] + disp, port.raw.force[0] + force);
            port.forget_readings();
            port.take_reading();
            (port.raw.disp[0], port.raw.force[0])
        };
        let is_zero = |port: &Port, (disp, force): (f64, f64)| {
            let (disp, force) = port.axes[0].at_structure(disp, force);
            assert!(disp.abs() < 1e-15 && force.abs() < 1e-9, "{disp} {force}");
        };
        let before = read(&mut port, 0.3, 0.5);
        port.take_zero();
        is_zero(&port, before);
        let after = read(&mut port, 0.4, 0.7);
        port.take_disp_drift(0, before.0);
        port.take_force_drift(0, before.1);
        is_zero(&port, after);
    }

    /// It answers to command 3, too, which was lost, with what its load cell read.
    #[derive(Debug)]
    struct Recovering(bool);

    impl Substructure for Recovering {
        fn axes(&self) -> usize {
            1
        }
        fn coupling(&self) -> Coupling {
            Coupling::Sampled
        }
        fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
            Ok(())
        }
        fn collect(&mut self, _: Nanos, _: &mut Measurement) -> Result<Freshness, LinkFault> {
            Ok(Freshness::Fresh)
        }
        fn recover(&mut self, force: &mut [f64]) -> Option<u64> {
            force[0] = 2.5;
            std::mem::take(&mut self.0).then_some(3)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    #[test]
    fn a_force_that_is_recovered_is_one_of_the_structure() {
        let axis = Axis {
            force_gain: -1000.0,
            force_offset: 2.0,
            ..Axis::plain(vec![(0, 1.0)])
        };
        let rig = Box::new(Recovering(true));
        let mut port = Port::new("rig", vec![axis], rig, 1, vec![0.0]).unwrap();
        assert_eq!((port.recover(), port.recovered[0]), (Some(3), -500.0));
        assert_eq!(port.recover(), None);
    }

    /// Half as fast as the structure's time has it.
    #[test]
    fn a_ramp_says_how_fast_it_goes_in_the_specimens_own_time() {
        let mut port = reversed();
        port.axes[0].vel_gain = -500.0;
        send(&mut port, 0);
        let from = port.sent[0];
        port.aim(&[0.0, 0.002], &[0.0, 0.0], 0.0, 0.0);
        let way = port.command[0] - from;
        port.begin_ramp();
        port.ramp_to(0.5, 2.0);
        assert!((port.command[0] - (from + 0.5 * way)).abs() < 1e-12);
        // Half a cosine is π/2 times as fast in the middle as on the average.
        let vel = 0.5 * std::f64::consts::FRAC_PI_2 * way / 2.0;
        assert!((port.command_vel[0] - vel).abs() < 1e-12, "{way}");
    }

    #[test]
    fn units_signs_and_offsets_come_out_as_a_spring_in_si() {
        let mut port = reversed();
        port.aim(&[0.001, 0.004], &[0.0, 0.0], 0.0, 0.0);
        assert!((port.command[0] - 2.0).abs() < 1e-12, "-1000 · 0.003 + 5");
        send(&mut port, 0);
        port.collect(Nanos(0)).unwrap();
        assert!((port.measured[0] - 0.003).abs() < 1e-15);
        assert!((port.force[0] - 8000.0 * 0.003).abs() < 1e-10);
        let mut residual = [0.0, 0.0];
        port.subtract_force(&mut residual);
        assert!((residual[0] - 24.0).abs() < 1e-10 && (residual[1] + 24.0).abs() < 1e-10);
    }

    #[test]
    fn a_base_displacement_is_not_a_deformation_of_the_upper_storeys() {
        let mut axis = Axis::plain(vec![(0, 1.0)]);
        axis.base = 1.0;
        let mut port = Port::new(
            "base",
            vec![axis],
            Box::new(Reversed { disp: 0.0 }),
            2,
            vec![0.0],
        )
        .unwrap();
        port.aim(&[0.25, 0.0], &[0.5, 0.0], 0.2, 0.5);
        assert!((port.target[0] - 0.05).abs() < 1e-15);
        assert_eq!(port.target_vel[0], 0.0);
    }

    #[test]
    fn a_stale_force_moves_with_the_estimate() {
        let mut port = reversed();
        send(&mut port, 0);
        port.aim(&[0.0, 0.0], &[0.0, 0.0], 0.0, 0.0);
        send(&mut port, 1);
        port.collect(Nanos(0)).unwrap();
        port.aim(&[0.0, 0.002], &[0.0, 0.0], 0.0, 0.0);
        port.extrapolate();
        assert!((port.force[0] - 16.0).abs() < 1e-9);
    }

    /// It was never told anything but to stay where its declared offset says that it stands.
    #[test]
    fn what_stays_at_a_declared_offset_follows_and_a_dead_sensor_does_not() {
        let limits =
            limits::AxisLimits::NONE.with(Limit::FollowingError, limits::Bound::trip(1e-3));
        let read = |disp: Option<f64>| {
            let mut port = reversed().with_limits(vec![limits], vec![(1e-3, 1e3)], 0.01);
            port.stand_still();
            port.repeat(0, 0.0).unwrap();
            port.collect(Nanos(0)).unwrap();
            if let Some(disp) = disp {
                port.raw.disp[0] = disp;
            }
            port.judge().trip.map(|hit| hit.value)
        };
        assert_eq!(read(None), None);
        assert_eq!(read(Some(0.0)), Some(5e-3));
    }

    #[test]
    fn rows_that_do_not_fit_are_refused() {
        let axes = || vec![Axis::plain(vec![(2, 1.0)])];
        let specimen = || Box::new(Reversed { disp: 0.0 });
        assert_eq!(
            Port::new("a", axes(), specimen(), 2, vec![1.0]).unwrap_err(),
            PortError::Dof {
                row: 1,
                dof: 3,
                dofs: 2
            }
        );
        assert_eq!(
            Port::new("a", vec![], specimen(), 2, vec![]).unwrap_err(),
            PortError::Axes { rows: 0, axes: 1 }
        );
        let mut axis = Axis::plain(vec![(0, 1.0)]);
        axis.force_gain = f64::NAN;
        assert!(matches!(
            Port::new("a", vec![axis], specimen(), 2, vec![1.0]),
            Err(PortError::Gain { axis: 1, .. })
        ));
    }
}
