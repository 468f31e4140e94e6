//! A port from end to end: units, the zero, drift, ramps and stale forces.

use super::*;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, LinkFault, Measurement, Retirement, Substructure,
};
use gusset_quantity::time::Nanos;

/// A spring in millimetres and kilonewtons, mounted the wrong way round, with a load cell that reads 2 at rest.
#[derive(Debug)]
struct Reversed {
    disp: f64,
}

impl Substructure for Reversed {
    fn axes(&self) -> usize {
        1
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
    reversed_spec().build().unwrap()
}

fn reversed_spec() -> PortSpec {
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
    PortSpec::new(
        "rig",
        Box::new(Reversed { disp: 0.0 }),
        2,
        vec![AxisSpec::new(axis, 8000.0)],
    )
}

/// Judges and sends.
fn send(port: &mut Port, sequence: u64) {
    assert_eq!(port.clear().trip, None);
    port.issue(sequence, 0.0, 0.0).unwrap();
}

#[test]
fn unjudged_command_is_not_sent() {
    let mut port = reversed();
    assert_eq!(port.issue(0, 0.0, 0.0), Err(LinkFault::Refused));
    send(&mut port, 0);
    assert_eq!(port.issue(1, 0.0, 0.0), Err(LinkFault::Refused));
}

/// Whatever its displacement is: a link may use the velocity.
#[test]
fn command_with_nan_velocity_is_not_sent() {
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
fn sensor_zero_and_drift_are_subtracted() {
    let relative = Reference {
        disp: Zero::Relative,
        force: Zero::Relative,
    };
    let mut spec = reversed_spec();
    spec.axes[0].reference = relative;
    let mut port = spec.build().unwrap();
    port.aim(&[0.0, 0.001], &[0.0, 0.0], 0.0, 0.0);
    send(&mut port, 0);
    let read = |port: &mut Port, disp: f64, force: f64| {
        port.collect(Nanos(0)).unwrap();
        let raw = port.feedback.raw_mut();
        raw.disp[0] += disp;
        raw.force[0] += force;
        port.startup_mut().forget_readings();
        port.take_reading();
        (
            port.feedback().raw().disp[0],
            port.feedback().raw().force[0],
        )
    };
    let is_zero = |port: &Port, (disp, force): (f64, f64)| {
        let AtStructure((disp, force)) = port.axes[0].at_structure(AtAxis((disp, force)));
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
fn recovered_force_is_the_structures() {
    let axis = Axis {
        force_gain: -1000.0,
        force_offset: 2.0,
        ..Axis::plain(vec![(0, 1.0)])
    };
    let rig = Box::new(Recovering(true));
    let mut port = PortSpec::new("rig", rig, 1, vec![AxisSpec::new(axis, 0.0)])
        .build()
        .unwrap();
    assert_eq!(
        (port.recover(), port.feedback().recovered()[0]),
        (Some(3), -500.0)
    );
    assert_eq!(port.recover(), None);
}

/// The specimen's time is half as fast as the structure's.
#[test]
fn ramp_speed_is_in_the_specimens_time() {
    let mut port = reversed();
    port.axes[0].vel_gain = -500.0;
    send(&mut port, 0);
    let from = port.path().sent()[0];
    port.aim(&[0.0, 0.002], &[0.0, 0.0], 0.0, 0.0);
    let way = port.command()[0] - from;
    port.begin_ramp();
    port.ramp_to(0.5, 2.0);
    assert!((port.command()[0] - (from + 0.5 * way)).abs() < 1e-12);
    // Half a cosine is π/2 times as fast in the middle as on the average.
    let vel = 0.5 * std::f64::consts::FRAC_PI_2 * way / 2.0;
    assert!((port.path.command().vel[0] - vel).abs() < 1e-12, "{way}");
}

#[test]
fn units_signs_and_offsets_give_si() {
    let mut port = reversed();
    port.aim(&[0.001, 0.004], &[0.0, 0.0], 0.0, 0.0);
    assert!((port.command()[0] - 2.0).abs() < 1e-12, "-1000 · 0.003 + 5");
    send(&mut port, 0);
    port.collect(Nanos(0)).unwrap();
    assert!((port.feedback().disp()[0] - 0.003).abs() < 1e-15);
    assert!((port.feedback().force()[0] - 8000.0 * 0.003).abs() < 1e-10);
    let mut residual = [0.0, 0.0];
    port.subtract_force(0..residual.len(), &mut residual);
    assert!((residual[0] - 24.0).abs() < 1e-10 && (residual[1] + 24.0).abs() < 1e-10);
}

#[test]
fn base_motion_deforms_no_upper_storey() {
    let mut axis = Axis::plain(vec![(0, 1.0)]);
    axis.base = 1.0;
    let mut port = PortSpec::new(
        "base",
        Box::new(Reversed { disp: 0.0 }),
        2,
        vec![AxisSpec::new(axis, 0.0)],
    )
    .build()
    .unwrap();
    port.aim(&[0.25, 0.0], &[0.5, 0.0], 0.2, 0.5);
    assert!((port.target()[0] - 0.05).abs() < 1e-15);
    assert_eq!(port.target_vel()[0], 0.0);
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
    assert!((port.feedback().force()[0] - 16.0).abs() < 1e-9);
}

/// It was never told anything but to stay where its declared offset says that it stands.
#[test]
fn declared_offset_is_no_dead_sensor() {
    let limits = limits::AxisLimits::NONE.with(Limit::FollowingError, limits::Bound::trip(1e-3));
    let read = |disp: Option<f64>| {
        let mut port = reversed();
        port.set_limits(0.01, |_| (limits, (1e-3, 1e3)));
        port.stand_still();
        port.repeat(0, 0.0).unwrap();
        port.collect(Nanos(0)).unwrap();
        if let Some(disp) = disp {
            port.feedback.raw_mut().disp[0] = disp;
        }
        port.judge().trip.map(|hit| hit.value)
    };
    assert_eq!(read(None), None);
    assert_eq!(read(Some(0.0)), Some(5e-3));
}

#[test]
fn what_does_not_fit_is_refused() {
    let refused = |change: fn(&mut PortSpec)| {
        let mut spec = reversed_spec();
        change(&mut spec);
        spec.build().unwrap_err()
    };
    let length = |found, wanted| move |error: PortError| matches!(error, PortError::Length { found: f, wanted: w, .. } if (f, w) == (found, wanted));
    let dof = PortError::Dof {
        row: 1,
        dof: 3,
        dofs: 2,
    };
    assert_eq!(refused(|spec| spec.axes[0].axis.row = vec![(2, 1.0)]), dof);
    assert_eq!(
        refused(|spec| spec.axes.clear()),
        PortError::Axes { rows: 0, axes: 1 }
    );
    assert!(matches!(
        refused(|spec| spec.axes[0].axis.force_gain = f64::NAN),
        PortError::Gain { axis: 1, .. }
    ));
    assert!(length(2, 1)(refused(
        |spec| spec.coupling = vec![vec![0.0]; 2]
    )));
    assert!(length(3, 1)(refused(
        |spec| spec.coupling = vec![vec![0.0; 3]]
    )));
    assert!(length(0, 1)(refused(|spec| spec.compensation =
        Some(Compensation {
            compensators: Vec::new(),
            tick: 1e-3,
            pace: 1.0,
            delay_in_test_time: false,
            base_moves: false,
        }))));
    assert!(length(2, 1)(refused(
        |spec| spec.exits.on_trip = Exit::Safe(AtAxis(vec![0.0; 2]))
    )));
    assert!(length(2, 1)(refused(
        |spec| spec.exits.at_end = Exit::Safe(AtAxis(vec![0.0; 2]))
    )));
    assert!(length(0, 1)(refused(
        |spec| spec.stands_at_m = Some(Vec::new())
    )));
}

/// The command that was judged is another one.
#[test]
fn changed_command_is_not_sent() {
    let changes: [fn(&mut Port); 5] = [
        |port| port.aim(&[0.0, 0.002], &[0.0, 0.0], 0.0, 0.0),
        Port::stand_still,
        |port| port.ramp_to(0.5, 1.0),
        Port::return_to_the_test,
        |port| port.advance(&PacerTick::none(), 0.01),
    ];
    for (index, change) in changes.into_iter().enumerate() {
        let mut port = reversed();
        assert_eq!(port.clear().trip, None);
        change(&mut port);
        assert_eq!(port.issue(0, 0.0, 0.0), Err(LinkFault::Refused), "{index}");
        send(&mut port, 0);
    }
}
