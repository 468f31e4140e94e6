//! The layout of a row: which number stands where, and its name.
//!
//! Fixed before the run. Filled in two strokes per tick: what must be kept before the state moves on
//! ([`Row::exchange`]), and the rest when the next command stands ready ([`Row::outputs`], [`Row::timing`]).

use std::ops::Range;

use super::checks::TestQuantity;
use super::numerical::Side;
use super::phase::Phase;
use super::tick::Tick;
use crate::control::Port;
use crate::record::Column;
use crate::rt::timing::TickStamps;
use crate::time::Nanos;

/// State of the row in which a test was given up for being late: only the clock knows why, so the row must say that.
pub const GIVEN_UP: f64 = 14.0;

/// The row of the current tick and the place of each number in it.
#[derive(Debug)]
pub struct Row {
    /// Whether the operator wants a hold.
    pub hold: bool,
    values: Vec<f64>,
    dofs: Vec<usize>,
    disp: Range<usize>,
    vel: Range<usize>,
    accel: Range<usize>,
    ports: Vec<Range<usize>>,
    checks: Range<usize>,
    timing: Range<usize>,
}

const BOOKKEEPING: [(&str, &str, &str); 5] = [
    ("step", "1", "step of the integration, from 0 at t = 0"),
    ("sub_tick", "1", "tick within the step, from 0"),
    (
        "state",
        "1",
        "phase: 1 settling under the static load, 2 trying which way round a specimen is wired, 3 running, 4 zeroing, \
         5 ramping, 6 holding, 7 leaving, 8 tripped, 10 warming up (kept where it mattered), 14 given up for being late; \
         between two steps: 11 towards a known target, 12 along the prediction, 13 slowing down",
    ),
    (
        "hold",
        "1",
        "1 from the tick before which the operator asked for a hold, until he lets the test go on",
    ),
    ("time", "s", "test time"),
];

const TIMING: [(&str, &str); 6] = [
    (
        "release_s",
        "wall time from the first edge to the edge of this tick",
    ),
    (
        "wakeup_lateness_s",
        "from the edge to the first instruction after the wait",
    ),
    (
        "command_lateness_s",
        "from the edge to the end of the last send",
    ),
    (
        "round_trip_s",
        "from the last send to the last decoded reply",
    ),
    (
        "compute_s",
        "from the last decoded reply to the next command ready",
    ),
    (
        "stretched",
        "whole ticks by which the grid has been moved so far",
    ),
];

impl Row {
    /// The row for `dofs` (from 0) of a structure and all ports, and its description.
    #[must_use]
    pub fn new(dofs: &[usize], side: &Side, ports: &[Port]) -> (Self, Vec<Column>) {
        let mut columns = Vec::new();
        for (name, unit, meaning) in BOOKKEEPING {
            columns.push(column(name, unit, meaning, false));
        }
        let (unit, meaning) = if moves_its_base(side) {
            ("m", "displacement of the base")
        } else {
            ("m/s2", "acceleration of the ground")
        };
        columns.push(column("ground", unit, meaning, false));
        let block = |columns: &mut Vec<Column>, letter: &str, unit: &str, meaning: &str| {
            let start = columns.len();
            for dof in dofs {
                let name = format!("{letter}{}", dof + 1);
                columns.push(column(
                    &name,
                    unit,
                    &format!("{meaning} of DOF {}", dof + 1),
                    false,
                ));
            }
            start..columns.len()
        };
        let disp = block(&mut columns, "x", "m", "displacement");
        let vel = block(
            &mut columns,
            "v",
            "m/s",
            "velocity as the integrator reports it",
        );
        let accel = block(&mut columns, "a", "m/s2", "acceleration from equilibrium");
        let ports_given = ports;
        let ports = ports
            .iter()
            .enumerate()
            .map(|(index, port)| port_columns(&mut columns, index + 1, port))
            .collect();
        let start = columns.len();
        for quantity in TestQuantity::columns(side, ports_given) {
            columns.push(column(quantity.key(), "1", quantity.words(), false));
        }
        let checks = start..columns.len();
        let start = columns.len();
        for (name, meaning) in TIMING {
            let unit = if name == "stretched" { "1" } else { "s" };
            columns.push(column(name, unit, meaning, true));
        }
        let timing = start..columns.len();
        let values = vec![0.0; columns.len()];
        (
            Self {
                hold: false,
                values,
                dofs: dofs.to_vec(),
                disp,
                vel,
                accel,
                ports,
                checks,
                timing,
            },
            columns,
        )
    }

    /// The finished row.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// What the next advance and the next aim will overwrite: x and everything of the ports. Real-time: yes.
    pub fn exchange(&mut self, tick: &Tick, phase: Phase, side: &Side, ports: &[Port]) {
        if let Side::Structure(numerical) = side {
            gather(
                &mut self.values,
                &self.disp,
                &self.dofs,
                &numerical.state.disp,
            );
        }
        self.between(tick, phase.code(), side, ports);
    }

    /// A tick that ends no step: x, v and a are those of the last one. `state` is for the column of this name. Real-time: yes.
    pub fn between(&mut self, tick: &Tick, state: f64, side: &Side, ports: &[Port]) {
        let ground = match side {
            Side::Structure(numerical) if numerical.excitation.has_base() => {
                numerical.excitation.base(tick.index()).0
            }
            Side::Structure(numerical) => numerical.excitation.ground(tick.index()),
            Side::Prescribed(_) => 0.0,
        };
        let head = [
            tick.step as f64,
            tick.sub_tick as f64,
            state,
            f64::from(u8::from(self.hold)),
            tick.time,
            ground,
        ];
        for (to, from) in self.values.iter_mut().zip(head) {
            *to = from;
        }
        for (range, port) in self.ports.iter().zip(ports) {
            let Some(slots) = self.values.get_mut(range.clone()) else {
                continue;
            };
            let axes = port
                .target
                .iter()
                .zip(&port.sent)
                .zip(&port.measured)
                .zip(&port.force)
                .zip(port.raw().disp.iter().zip(&port.raw().force));
            let width = width_of_axis(port);
            let slots_of_axes = slots.chunks_exact_mut(width);
            for (slot, (axis, estimates)) in slots_of_axes.zip(axes.zip(port.estimates())) {
                let ((((target, command), measured), force), (raw_disp, raw_force)) = axis;
                let (stiffness, damping, energy) = estimates;
                let values = [
                    *target, *command, *measured, *force, *raw_disp, *raw_force, stiffness, energy,
                ];
                for (to, from) in slot.iter_mut().zip(values.into_iter().chain(damping)) {
                    *to = from;
                }
            }
            let after_axes = slots.iter_mut().skip(width * port.axes());
            let further = port.tracking().flatten();
            let margins = port.knows_margin().then(|| port.delay_margins());
            let further = further.chain(margins.into_iter().flatten());
            let further = further.chain(port.compensation_parameters());
            let poses = port.pose().flat_map(|(_, values)| values);
            for (slot, value) in after_axes.zip(further.chain(poses)) {
                *slot = value;
            }
            if let [.., sequence, status] = slots {
                *sequence = port.raw().sequence as f64;
                *status = f64::from(port.raw().status.0);
            }
        }
        if let Some(slots) = self.values.get_mut(self.checks.clone()) {
            for (to, from) in slots.iter_mut().zip(TestQuantity::values(side, ports)) {
                *to = from;
            }
        }
    }

    /// What is known only after the solve: v and a. Real-time: yes.
    pub fn outputs(&mut self, side: &Side) {
        if let Side::Structure(numerical) = side {
            gather(
                &mut self.values,
                &self.vel,
                &self.dofs,
                &numerical.reported_vel,
            );
            gather(&mut self.values, &self.accel, &self.dofs, &numerical.accel);
        }
    }

    /// v and a of a tick whose equilibrium is not made. Real-time: yes.
    pub fn no_outputs(&mut self) {
        for range in [&self.vel, &self.accel] {
            if let Some(slots) = self.values.get_mut(range.clone()) {
                slots.fill(f64::NAN);
            }
        }
    }

    /// The columns that depend on wall time. Real-time: yes.
    pub fn timing(&mut self, stamps: &TickStamps, first_edge: Nanos, stretched: u64) {
        let seconds = |from: Nanos, to: Nanos| to.since(from) as f64 * 1e-9;
        let values = [
            seconds(first_edge, stamps.release),
            seconds(stamps.release, stamps.woke),
            seconds(stamps.release, stamps.sent),
            seconds(stamps.sent, stamps.decoded),
            seconds(stamps.decoded, stamps.ready),
            stretched as f64,
        ];
        if let Some(slots) = self.values.get_mut(self.timing.clone()) {
            for (to, from) in slots.iter_mut().zip(values) {
                *to = from;
            }
        }
    }
}

fn moves_its_base(side: &Side) -> bool {
    matches!(side, Side::Structure(numerical) if numerical.excitation.has_base())
}

fn gather(values: &mut [f64], range: &Range<usize>, dofs: &[usize], from: &[f64]) {
    if let Some(slots) = values.get_mut(range.clone()) {
        for (slot, dof) in slots.iter_mut().zip(dofs) {
            *slot = from.get(*dof).copied().unwrap_or(f64::NAN);
        }
    }
}

/// Columns that every axis of a port has side by side: eight, and one more where damping is declared of any.
fn width_of_axis(port: &Port) -> usize {
    let damping = port.estimates().any(|(_, damping, _)| damping.is_some());
    8 + usize::from(damping)
}

fn port_columns(columns: &mut Vec<Column>, number: usize, port: &Port) -> Range<usize> {
    let start = columns.len();
    let name = &port.name;
    for axis in 1..=port.axes() {
        let mut add = |kind: &str, unit: &str, meaning: &str| {
            let meaning = format!("{meaning}, specimen \"{name}\", axis {axis}");
            columns.push(column(
                &format!("{kind}_{number}_{axis}"),
                unit,
                &meaning,
                false,
            ));
        };
        let (target, force) = if port.geometry().is_some() {
            (
                "stroke of the actuator for the pose B·x",
                "force of the actuator, at the structure's scale",
            )
        } else {
            (
                "deformation B·x that the structure asks for",
                "restoring force that entered equilibrium",
            )
        };
        add("target", "m", target);
        add("cmd", "specimen unit", "displacement that was sent");
        add(
            "meas",
            "m",
            "measured displacement in the structure's units",
        );
        add("force", "N", force);
        add(
            "raw_disp",
            "specimen unit",
            "measured displacement as it came",
        );
        add("raw_force", "specimen unit", "measured force as it came");
        add(
            "kt",
            "N/m",
            "tangent stiffness, estimated; the declared one until the axis has moved",
        );
        add(
            "added",
            "J",
            "energy that the transfer system has added, negative if it has taken some",
        );
        if port.estimates().any(|(_, damping, _)| damping.is_some()) {
            add("ct", "N s/m", "tangent damping, estimated");
        }
    }
    let tracked = if port.tracks() { port.axes() } else { 0 };
    for axis in 1..=tracked {
        for (key, unit, meaning) in [
            ("lag", "s", "lag behind the target, estimated"),
            (
                "gain",
                "1",
                "measured displacement over the target, estimated",
            ),
            (
                "stiffness",
                "N/m",
                "stiffness as fitted over the last seconds of motion",
            ),
            ("false_c", "N s/m", "damping that the lag adds to it"),
        ] {
            let meaning = format!("{meaning}, specimen \"{name}\", axis {axis}");
            columns.push(column(
                &format!("{key}_{number}_{axis}"),
                unit,
                &meaning,
                false,
            ));
        }
    }
    let margins = if port.knows_margin() { port.axes() } else { 0 };
    for axis in 1..=margins {
        let meaning = format!(
            "critical delay at the stiffness of the last seconds less their lag: below 0 the test grows; inf where every delay is \
             stable, specimen \"{name}\", axis {axis}"
        );
        let key = format!("margin_{number}_{axis}");
        columns.push(column(&key, "s", &meaning, false));
    }
    for (axis, parameter) in port.compensation_names() {
        let (key, axis) = (parameter.name, axis + 1);
        let meaning =
            format!("parameter {key} of the compensation, specimen \"{name}\", axis {axis}");
        let key = format!("comp_{key}_{number}_{axis}");
        columns.push(column(&key, parameter.unit, &meaning, false));
    }
    for (index, (coordinate, _)) in port.pose().enumerate() {
        let (key, unit) = (coordinate.key(), coordinate.unit());
        for (kind, unit, meaning) in [
            ("pose", unit, "pose B·x that the structure asks for"),
            ("pose_meas", unit, "pose that the measured strokes have"),
            (
                "pose_force",
                coordinate.force_unit(),
                "force that entered equilibrium",
            ),
        ] {
            let meaning = format!("{meaning}, specimen \"{name}\", {key}");
            let key = format!("{kind}_{number}_{}", index + 1);
            columns.push(column(&key, unit, &meaning, false));
        }
    }
    let meaning = format!("newest command in force when specimen \"{name}\" was sampled");
    columns.push(column(&format!("seq_{number}"), "1", &meaning, false));
    let meaning = format!(
        "status flags of specimen \"{name}\": 1 interlock, 2 holding, 4 saturated; of the loop: 65536 lost, 131072 before its \
         last command left, 262144 stale"
    );
    columns.push(column(&format!("status_{number}"), "1", &meaning, false));
    start..columns.len()
}

fn column(name: &str, unit: &str, meaning: &str, timing: bool) -> Column {
    Column {
        name: name.into(),
        unit: unit.into(),
        meaning: meaning.into(),
        timing,
    }
}
