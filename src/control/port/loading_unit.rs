//! A loading unit: the axes of a specimen are its actuators, and a target is the stroke that the pose B·x of its platform asks for.
//!
//! ```text
//! out    pose q = B·x  →  target = s(q), target_vel = J(q) B·v  →  units, compensation, limits, all per actuator
//! back   measured strokes  →  measured pose q_m, by Newton from q  →  B ᵀ J(q_m)ᵀ f enters equilibrium
//! ```
//!
//! The measured pose depends on the target and the measurement of one step only: a replay finds the same one. Forces act where
//! the actuators are, not where they should be. Invariant: a pose that cannot be is kept as a fault, and no command leaves while
//! there is one.

use std::ops::Range;

use super::axis::dots;
use super::bend::Bend;
use super::unloading::PlatformUnloading;
use gusset_actuator::geometry::{Coordinate, Fault, Geometry, LawPlace, MOST, Placed};
use gusset_quantity::frame::{AtPose, AtStructure};
use gusset_quantity::state;

/// Strokes of the actuators in m, and their velocities.
type Strokes<'a> = AtStructure<[&'a mut [f64]; 2]>;

/// One row of B: what a coordinate is of the structure's displacements.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PoseRow {
    /// Nonzero entries: degree of freedom (from 0) and coefficient.
    pub row: Vec<(usize, f64)>,
    /// b·ι: the part of a base displacement that this coordinate does not see.
    pub base: f64,
}

/// How far a platform went, and how near it came to where its actuators cannot hold it.
#[derive(Debug, Clone, PartialEq)]
pub struct Poses {
    /// Smallest and largest value of each coordinate, in m or rad.
    pub range: Vec<(Coordinate, f64, f64)>,
    /// Condition number of the Jacobian at the reference pose, and at the worst of all poses.
    pub condition: [f64; 2],
    /// The worst pose in words.
    pub worst: String,
}

/// A loading unit and everything of the current step.
#[derive(Debug)]
pub struct LoadingUnit {
    geometry: Geometry,
    rows: Vec<PoseRow>,
    law_at: LawPlace,
    /// The pose last sought, and its velocity.
    aim: Placed,
    rates: [f64; MOST],
    /// The pose last measured, and the forces of its coordinates.
    found: Placed,
    force: [f64; MOST],
    /// None belongs to what was measured last.
    is_unknown: bool,
    /// Of the pose last sought.
    fault: Option<Fault>,
    range: [[f64; 2]; MOST],
    worst: Placed,
    /// Of the way that it is led, before and after the test.
    bend: Bend,
}

// A pose that cannot be ends the test before a state is taken.
state! {
    LoadingUnit as "loading unit" { aim, rates, found, force, is_unknown, range, worst }
    keeps { geometry, rows, law_at, fault, bend }
}

impl LoadingUnit {
    /// At its reference pose; `rows` are those of B, one per coordinate.
    pub(crate) fn new(geometry: Geometry, rows: Vec<PoseRow>, law_at: LawPlace) -> Self {
        let reference = geometry.reference();
        Self {
            geometry,
            rows,
            law_at,
            aim: reference,
            rates: [0.0; MOST],
            found: reference,
            force: [0.0; MOST],
            is_unknown: false,
            fault: None,
            range: [[0.0; 2]; MOST],
            worst: reference,
            bend: Bend::new(reference),
        }
    }

    /// Goes to `pose` with `rates`, and leaves strokes and their velocities in `target` and `target_vel`. Real-time: yes.
    fn go(&mut self, pose: AtPose<&[f64; MOST]>, strokes: Strokes<'_>) {
        let AtStructure([target, target_vel]) = strokes;
        let placed = self.geometry.place(*pose, &mut self.aim);
        self.fault = placed
            .and_then(|()| self.geometry.within_reach(&self.aim))
            .err();
        if self.fault.is_some() {
            return;
        }
        for (to, from) in target.iter_mut().zip(self.aim.strokes()) {
            *to = *from;
        }
        self.geometry
            .stroke_rates(&self.aim, &self.rates, target_vel);
        for ([low, high], value) in self.range.iter_mut().zip(self.aim.pose()) {
            *low = low.min(*value);
            *high = high.max(*value);
        }
        if self.aim.independence() < self.worst.independence() {
            self.worst = self.aim;
        }
    }

    /// Goes where the structure is. Real-time: yes.
    pub(crate) fn seek(&mut self, state: [&[f64]; 2], base: [f64; 2], strokes: Strokes<'_>) {
        let mut pose = [0.0; MOST];
        let each = pose.iter_mut().zip(&mut self.rates);
        for (row, (value, rate)) in self.rows.iter().zip(each) {
            (*value, *rate) = dots(&row.row, row.base, state, base);
        }
        self.go(AtPose(&pose), strokes);
    }

    /// Goes along prescribed coordinates. Real-time: yes.
    pub(crate) fn seek_at(
        &mut self,
        along: &mut impl Iterator<Item = AtStructure<(f64, f64)>>,
        strokes: Strokes<'_>,
    ) {
        let mut pose = [0.0; MOST];
        let each = pose.iter_mut().zip(&mut self.rates);
        for ((value, rate), AtStructure((disp, vel))) in each.take(self.rows.len()).zip(along) {
            (*value, *rate) = (disp, vel);
        }
        self.go(AtPose(&pose), strokes);
    }

    /// The strokes in m of a pose.
    pub(crate) fn strokes_for(&self, pose: AtPose<&[f64]>) -> Result<AtStructure<Vec<f64>>, Fault> {
        let mut placed = self.geometry.reference();
        self.geometry.place(*pose, &mut placed)?;
        self.geometry.within_reach(&placed)?;
        let strokes = placed.strokes()[..self.geometry.actuators()].to_vec();
        Ok(AtStructure(strokes))
    }

    /// The pose in which the actuators have these strokes in m, from the reference pose on.
    pub(crate) fn pose_at(&self, strokes: AtStructure<&[f64]>) -> Result<AtPose<Vec<f64>>, Fault> {
        let placed = self.found_at(strokes)?;
        Ok(AtPose(placed.pose()[..self.rows.len()].to_vec()))
    }

    fn found_at(&self, strokes: AtStructure<&[f64]>) -> Result<Placed, Fault> {
        let mut placed = self.geometry.reference();
        self.geometry.find(*strokes, &mut placed)?;
        Ok(placed)
    }

    /// The actuators have these strokes in m: the next pose is sought from there. Impossible strokes change nothing.
    pub(crate) fn stands_at(&mut self, strokes: AtStructure<&[f64]>) {
        if let Ok(placed) = self.found_at(strokes) {
            (self.aim, self.found) = (placed, placed);
            self.rates = [0.0; MOST];
        }
    }

    /// It is led from the first of these strokes in m to the second. Real-time: yes.
    pub(crate) fn begin_way(&mut self, strokes: [AtStructure<&[f64]>; 2]) {
        self.bend.begin(&self.geometry, strokes);
    }

    /// Bends of the strokes at a share of the way: see [`Bend::at`]. Real-time: yes.
    pub(crate) fn bends(&mut self, way: f64) -> Option<impl Iterator<Item = (f64, f64)> + use<>> {
        self.bend.at(&self.geometry, way)
    }

    /// True if the pose last sought can be. Real-time: yes.
    #[inline]
    pub(crate) const fn is_possible(&self) -> bool {
        self.fault.is_none()
    }

    /// Takes the measured pose and the forces of its coordinates from the actuators. Real-time: yes.
    pub(crate) fn resolve(
        &mut self,
        measured: AtStructure<&[f64]>,
        force: AtStructure<&[f64]>,
    ) -> Result<(), Fault> {
        self.found = self.aim;
        let found = self.geometry.find_for_forces(*measured, &mut self.found);
        self.is_unknown = found.is_err();
        found?;
        let n = self.rows.len();
        match self.force.get_mut(..n) {
            Some(forces) => self.geometry.pose_forces(&self.found, *force, forces),
            None => self.force = [f64::NAN; MOST],
        }
        Ok(())
    }

    /// Of a loading unit.
    pub(crate) const fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// residual −= Bᵀ·force, these rows of it. Real-time: yes.
    #[inline]
    pub(crate) fn subtract_force(&self, rows: Range<usize>, residual: &mut [f64]) {
        for (row, force) in self.rows.iter().zip(&self.force) {
            for &(dof, coefficient) in &row.row {
                if rows.contains(&dof)
                    && let Some(entry) = residual.get_mut(dof)
                {
                    *entry -= coefficient * force;
                }
            }
        }
    }

    /// Why the pose last sought cannot be. Real-time: yes.
    #[inline]
    #[must_use]
    pub const fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// The next commands are strokes from where the actuators are, whatever pose was sought.
    pub(crate) const fn leave_pose(&mut self) {
        self.fault = None;
    }

    /// The way to zero force from where the platform was sent last, in m, if its actuators turn beside the specimen.
    pub(crate) fn unloading_from(&self, strokes: AtStructure<&[f64]>) -> Option<PlatformUnloading> {
        let turns = self.geometry.is_exact() && self.law_at == LawPlace::Platform;
        turns
            .then(|| PlatformUnloading::new(&self.geometry, strokes).ok())
            .flatten()
    }

    /// Where its poses bend the way of an actuator, the distance in m for which that is nowhere faster; else 0.
    pub(crate) fn steepest(&self, axis: usize) -> AtStructure<f64> {
        AtStructure(self.bend.steepest(axis))
    }

    /// Each coordinate: pose that the structure asks for, measured pose, force. Real-time: yes.
    #[inline]
    pub fn pose(&self) -> impl Iterator<Item = (Coordinate, [f64; 3])> + '_ {
        let values = self.aim.pose().iter().zip(self.found.pose());
        let values = values.zip(&self.force);
        let named = self.geometry.coordinates().iter().zip(values);
        named.map(|(coordinate, ((aim, found), force))| {
            let (found, force) = if self.is_unknown {
                (f64::NAN, f64::NAN)
            } else {
                (*found, *force)
            };
            (*coordinate, [*aim, found, force])
        })
    }

    /// How far the platform went. Allocates.
    pub(crate) fn poses(&self) -> Poses {
        let Self {
            geometry,
            range,
            worst,
            ..
        } = self;
        let named = geometry.coordinates().iter().zip(range);
        let reference = geometry.reference();
        let at_rest = geometry.condition(&reference);
        // What is kept tick by tick is near the condition, not the same.
        let far = geometry.condition(worst);
        let (condition, worst) = if far >= at_rest {
            ([at_rest, far], geometry.words(worst))
        } else {
            ([at_rest; 2], geometry.words(&reference))
        };
        Poses {
            range: named.map(|(c, [low, high])| (*c, *low, *high)).collect(),
            condition,
            worst,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::{Axis, AxisSpec, Exit, Exits, LoadingUnitSpec, Port, PortSpec};
    use gusset_actuator::geometry::{GeometrySpec, PlanePins};
    use gusset_quantity::substructure::{
        Command, Freshness, LinkFault, Measurement, Retirement, Substructure,
    };
    use gusset_quantity::time::Nanos;

    /// Two actuators whose strokes make these displacements and forces.
    struct Rig<F> {
        disp: [f64; 2],
        answer: F,
    }

    impl<F: FnMut([f64; 2]) -> [[f64; 2]; 2] + Send> Substructure for Rig<F> {
        fn axes(&self) -> usize {
            2
        }
        fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
            self.disp.copy_from_slice(command.disp);
            Ok(())
        }
        fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
            let [disp, force] = (self.answer)(self.disp);
            into.disp.copy_from_slice(&disp);
            into.force.copy_from_slice(&force);
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    /// Two springs that follow to `lag` m.
    fn port(lag: f64, length_m: Option<[f64; 2]>) -> Port {
        let pins = |base_m| PlanePins {
            base_m,
            joint_m: [0.0; 2],
            length_m,
        };
        let spec = GeometrySpec {
            coordinates: Some(vec![Coordinate::Ux, Coordinate::Uy]),
            plane: Some(vec![pins([-4.0, 0.0]), pins([0.0, -3.0])]),
            ..GeometrySpec::default()
        };
        let axes = vec![
            Axis::plain(vec![(0, 1.0), (2, -1.0)]),
            Axis::plain(vec![(1, 1.0)]),
        ];
        let rows = vec![
            PoseRow {
                row: vec![(0, 1.0), (2, -1.0)],
                base: 1.0,
            },
            PoseRow {
                row: vec![(1, 1.0)],
                base: 0.0,
            },
        ];
        // 1 kN/m each.
        let springs = Rig {
            disp: [0.0; 2],
            answer: move |disp: [f64; 2]| {
                let measured = disp.map(|disp| disp - lag);
                [measured, measured.map(|disp| 1000.0 * disp)]
            },
        };
        let axes = axes.into_iter().map(|axis| AxisSpec::new(axis, 1000.0));
        let geometry = spec.build(1.0).unwrap();
        let mut spec = PortSpec::new("rig", Box::new(springs), 3, axes.collect());
        spec.loading_unit = Some(LoadingUnitSpec {
            geometry,
            rows,
            law_at: LawPlace::Platform,
        });
        spec.build().unwrap()
    }

    #[test]
    fn forces_return_at_the_actuators_pose() {
        let mut port = port(0.0, None);
        // x₀ − x₂ − base = 0, x₁ = 3: the first actuator is 5 m long and inclined.
        port.aim(&[0.7, 3.0, 0.5], &[0.0, 2.0, 0.0], 0.2, 0.0);
        assert!((port.target()[0] - 1.0).abs() < 1e-15 && (port.target()[1] - 3.0).abs() < 1e-15);
        assert!((port.target_vel()[0] - 1.2).abs() < 1e-15, "3/5 of 2 m/s");
        assert_eq!(port.clear().trip, None);
        port.issue(0, 0.0, 0.0).unwrap();
        port.collect(Nanos(0)).unwrap();
        port.resolve_pose().unwrap();
        let mut residual = [0.0; 3];
        port.subtract_force(0..residual.len(), &mut residual);
        // 1 kN along (4, 3)/5 and 3 kN along y.
        for (found, exact) in residual.iter().zip([-800.0, -3600.0, 800.0]) {
            assert!((found - exact).abs() < 1e-10, "{residual:?}");
        }
        let pose: Vec<_> = port.loading_unit().unwrap().pose().collect();
        assert_eq!(pose[1].0, Coordinate::Uy);
        assert!((pose[1].1[0] - 3.0).abs() < 1e-15 && (pose[1].1[1] - 3.0).abs() < 1e-14);
    }

    /// The force of an actuator that lags acts where it is: at the measured pose, which is not that of the target.
    #[test]
    fn lagging_actuator_pulls_along_its_axis() {
        let mut port = port(0.5, None);
        port.aim(&[0.0, 3.0, 0.0], &[0.0; 3], 0.0, 0.0);
        assert_eq!(port.clear().trip, None);
        port.issue(0, 0.0, 0.0).unwrap();
        port.collect(Nanos(0)).unwrap();
        port.resolve_pose().unwrap();
        let measured: Vec<f64> = port
            .loading_unit()
            .unwrap()
            .pose()
            .map(|(_, [_, found, _])| found)
            .collect();
        // Circles of 4.5 m about (−4, 0) and 5.5 m about (0, −3).
        let [x, y] = [measured[0], measured[1]];
        assert!((libm::hypot(4.0 + x, y) - 4.5).abs() < 1e-14);
        assert!((libm::hypot(x, 3.0 + y) - 5.5).abs() < 1e-14);
        let mut residual = [0.0; 3];
        port.subtract_force(0..residual.len(), &mut residual);
        let along_x = 500.0 * (4.0 + x) / 4.5 + 2500.0 * x / 5.5;
        assert!((residual[0] + along_x).abs() < 1e-10);
    }

    /// Sensors that no pose belongs to: circles that do not meet.
    #[test]
    fn strokes_without_a_pose_are_a_fault() {
        for lag in [3.9, f64::NAN, 1e30] {
            let mut port = port(lag, None);
            port.aim(&[0.0, 0.0, 0.0], &[0.0; 3], 0.0, 0.0);
            port.clear();
            port.issue(0, 0.0, 0.0).unwrap();
            let _ = port.collect(Nanos(0));
            assert!(port.resolve_pose().is_err(), "{lag}");
            let mut residual = [0.0; 3];
            port.subtract_force(0..residual.len(), &mut residual);
            assert_eq!(residual, [0.0; 3]);
        }
    }

    /// Led from (0, 3) to the reference pose it goes down the y axis, though its actuators turn, and no actuator is faster than said.
    #[test]
    fn a_platform_is_led_out_along_its_poses() {
        let mut port = port(0.0, None);
        let exchange = |port: &mut Port| {
            assert_eq!(port.clear().trip, None);
            port.issue(0, 0.0, 0.0).unwrap();
            port.collect(Nanos(0)).unwrap();
            port.resolve_pose().unwrap();
            let pose: Vec<f64> = port
                .loading_unit()
                .unwrap()
                .pose()
                .map(|(_, [_, found, _])| found)
                .collect();
            [pose[0], pose[1]]
        };
        port.aim(&[0.0, 3.0, 0.0], &[0.0; 3], 0.0, 0.0);
        let [_, mut last] = exchange(&mut port);
        (port.exits.on_trip, port.exits.speed) = (Exit::ZeroDisp, 0.5);
        let mut way = port.begin_return_move(true, 0.01).unwrap();
        let mut fastest: f64 = 0.0;
        while port.go_on(&mut way) {
            let before = port.path().sent().to_vec();
            let rates = port.path.command().vel.clone();
            let [x, y] = exchange(&mut port);
            assert!(x.abs() < 1e-13 && y <= last, "{x} {y}");
            last = y;
            for ((from, to), rate) in before.iter().zip(*port.path().sent()).zip(rates) {
                let speed = (to - from) / 0.01;
                fastest = fastest.max(speed.abs());
                assert!(
                    (speed - rate).abs() < 0.01,
                    "the mean over a tick: {speed} {rate}"
                );
            }
        }
        assert!(
            way.end() == Some(Ok(())) && fastest > 0.45 && fastest < 0.5,
            "{fastest}"
        );
        assert_eq!(*port.path().sent(), [0.0, 0.0], "to the last bit");
    }

    /// A platform that is soft along x and stiff along y, behind two actuators that turn.
    const LAW: [f64; 2] = [7e4, 7e6];

    /// By the strokes' own stiffness the second actuator would get tens of kilonewtons on the way. The row says where it is.
    #[test]
    fn platform_unloads_along_its_law() {
        let loading = port(0.0, None);
        let geometry = loading.geometry().unwrap().clone();
        let (kinematics, mut placed) = (geometry.clone(), geometry.reference());
        let law = Rig {
            disp: [0.0; 2],
            answer: move |disp: [f64; 2]| {
                kinematics.find(&disp, &mut placed).unwrap();
                let pose = placed.pose();
                let forces = [LAW[0] * pose[0], LAW[1] * pose[1]];
                let mut actuators = [0.0; 2];
                kinematics.stroke_forces(&placed, &forces, &mut actuators);
                [disp, actuators]
            },
        };
        let rows = loading.loading_unit.as_deref().unwrap().rows.clone();
        let axes = loading.axes.iter().zip(LAW);
        let axes = axes.map(|(axis, k)| AxisSpec::new(axis.clone(), k));
        let mut spec = PortSpec::new("rig", Box::new(law), 3, axes.collect());
        spec.loading_unit = Some(LoadingUnitSpec {
            geometry,
            rows,
            law_at: LawPlace::Platform,
        });
        let mut port = spec.build().unwrap();
        let exchange = |port: &mut Port| {
            assert_eq!(port.clear().trip, None);
            port.issue(0, 0.0, 0.0).unwrap();
            port.collect(Nanos(0)).unwrap();
            port.look_at_pose();
            let pose: Vec<f64> = port
                .loading_unit()
                .unwrap()
                .pose()
                .map(|(_, [_, found, _])| found)
                .collect();
            [pose[0], pose[1]]
        };
        port.aim(&[0.3, 0.001, 0.0], &[0.0; 3], 0.0, 0.0);
        let first = exchange(&mut port);
        assert!((first[0] - 0.3).abs() < 1e-12 && (first[1] - 0.001).abs() < 1e-12);
        let most = port
            .feedback()
            .force()
            .iter()
            .fold(0.0, |a: f64, f| a.max(f.abs()));
        (port.exits.on_trip, port.exits.speed) = (Exit::ZeroForce, 0.2);
        let mut way = port.begin_return_move(true, 0.001).unwrap();
        let mut last = first;
        while port.go_on(&mut way) {
            for (from, to) in port.path().sent().iter().zip(*port.command()) {
                assert!((to - from).abs() <= 2e-4 * (1.0 + 1e-9), "{from} {to}");
            }
            last = exchange(&mut port);
            for force in *port.feedback().force() {
                assert!(force.abs() <= 1.01 * most, "{force} beside {most}");
            }
        }
        assert_eq!(way.end(), Some(Ok(())));
        assert!(last[0].abs() < 0.004 && last[1].abs() < 4e-5, "{last:?}");
    }

    #[test]
    fn unreachable_poses_send_no_command() {
        let mut port = port(0.0, Some([2.0, 4.5]));
        port.aim(&[0.0, 0.1, 0.0], &[0.0; 3], 0.0, 0.0);
        assert_eq!(port.loading_unit().unwrap().fault(), None);
        port.clear();
        assert_eq!(port.issue(0, 0.0, 0.0), Ok(()));
        for x in [[0.9, 0.0, 0.0], [-4.0, 0.0, 0.0], [f64::NAN, 0.0, 0.0]] {
            port.aim(&x, &[0.0; 3], 0.0, 0.0);
            let fault = port.loading_unit().unwrap().fault().unwrap();
            port.clear();
            assert_eq!(port.issue(1, 0.0, 0.0), Err(LinkFault::Refused));
            assert!(fault.to_string().contains("ux = "), "{fault}");
        }
        // The way out is none of the pose's.
        port.exits = Exits {
            on_trip: Exit::ZeroDisp,
            at_end: Exit::Freeze,
            speed: 0.1,
            comes_to_rest: false,
        };
        let mut way = port.begin_return_move(true, 0.01).unwrap();
        assert!(port.go_on(&mut way));
        port.clear();
        assert_eq!(port.issue(1, 0.0, 0.0), Ok(()));
        port.aim(&[0.0, 0.2, 0.0], &[0.0; 3], 0.0, 0.0);
        port.clear();
        assert_eq!(port.issue(2, 0.0, 0.0), Ok(()));
        let poses = port.poses().unwrap();
        assert_eq!(poses.range[1], (Coordinate::Uy, 0.0, 0.2));
        assert!((poses.condition[0] - 1.0).abs() < 1e-14 && poses.condition[1] > 1.01);
        assert_eq!(poses.worst, "ux = 0 m, uy = 0.2 m");
    }
}
