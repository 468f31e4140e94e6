//! The layout of a row: which number stands where, and its name.
//!
//! Fixed before the run. Filled in two strokes per tick: what must be kept before the state moves on
//! ([`Row::exchange`]), and the rest when the next command stands ready ([`Row::outputs`], [`Row::timing`]).

use std::ops::Range;

use super::numerical::Side;
use super::operator::OperatorCommands;
use super::phase::Phase;
use super::port_columns::{named, of_test, port_columns, port_values, width_of_axis};
use super::tick::Tick;
use crate::port::Port;
use gusset_quantity::catalog::column::{
    ACCEL, BASE, CAUSES, DISP, END_MOMENT, END_ROTATION, GROUND, GROUND_COMPONENT, HEAD, Kind,
    MEMBER_FORCE, MEMBER_FORCE_Y, MEMBER_FORCE_Z, OWN_ACCEL, ROTATION, START_MOMENT,
    START_ROTATION, STRETCH, STRETCH_Y, STRETCH_Z, TIMING, TORQUE, TWIST, VEL, WEAK_END_MOMENT,
    WEAK_END_ROTATION, WEAK_START_MOMENT, WEAK_START_ROTATION,
};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::state;
use gusset_quantity::time::Nanos;
use gusset_record::Column;
use gusset_record::rt::timing::TickStamps;

/// What the operator wants in a tick: one number of its row.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Word {
    /// A hold.
    pub holds: bool,
    /// He said before this tick that the test may go on.
    pub goes_on: bool,
    /// He confirmed before this tick what was read.
    pub confirms: bool,
}

impl Word {
    /// In the column `hold`.
    #[inline]
    #[must_use]
    pub(crate) fn code(self) -> f64 {
        let (holds, goes_on) = (u8::from(self.holds), u8::from(self.goes_on));
        f64::from(holds + 2 * goes_on + 4 * u8::from(self.confirms))
    }
}

/// The row of the current tick and the place of each number in it.
#[derive(Debug)]
pub struct Row {
    /// What the operator wants.
    pub word: Word,
    /// What trips does so on the way out that the operator asked for.
    pub stopped: bool,
    /// What ended the test or its shutdown, once it is known.
    pub cause: Option<Cause>,
    /// Commands of the operator since the last row that was kept.
    pub commands: OperatorCommands,
    /// Deadline misses and skipped ticks, known when the row is made.
    pub lateness: Lateness,
    /// From the ready command of the tick before to its pushed row, in s; known when that row is gone. Not a number where
    /// it was not measured.
    pub record_before: f64,
    values: Vec<f64>,
    /// Those that are recorded; none given: all in their order.
    dofs: Option<Vec<usize>>,
    /// Ground accelerations after the first.
    grounds: Range<usize>,
    disp: Range<usize>,
    vel: Range<usize>,
    accel: Range<usize>,
    members: Range<usize>,
    ports: Vec<PortPlace>,
    checks: Range<usize>,
    kept: Vec<Limit>,
}

// A row between two steps repeats the numbers of the last step.
state! {
    Row { values }
    keeps {
        word, stopped, cause, commands, lateness, record_before, dofs, grounds, disp, vel, accel, members, ports, checks,
        kept
    }
}

/// Deadline misses up to the tick before, and ticks that the grid was moved past.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lateness {
    /// Misses in a row.
    pub in_a_row: u64,
    /// Misses in the window `timing.misses.window_s`.
    pub in_window: u64,
    /// Misses in total.
    pub in_total: u64,
    /// Ticks skipped because this tick woke late.
    pub skipped_by_wakeup: u64,
    /// Ticks skipped because the work of the tick before ended late.
    pub skipped_by_work: u64,
    /// Lateness of the first tick skipped by work, plus one period, ns.
    pub overrun_ns: u64,
}

/// Columns of the members of a frame that are recorded: deformations, then forces.
fn member_columns(columns: &mut Vec<Column>, side: &Side) -> Range<usize> {
    let start = columns.len();
    if let Side::Structure(numerical) = side {
        for member in numerical.structure.members().recorded() {
            let of_link = [&STRETCH, &MEMBER_FORCE];
            let of_member = [
                &STRETCH,
                &START_ROTATION,
                &END_ROTATION,
                &MEMBER_FORCE,
                &START_MOMENT,
                &END_MOMENT,
            ];
            let in_space = [
                &STRETCH,
                &START_ROTATION,
                &END_ROTATION,
                &WEAK_START_ROTATION,
                &WEAK_END_ROTATION,
                &TWIST,
                &MEMBER_FORCE,
                &START_MOMENT,
                &END_MOMENT,
                &WEAK_START_MOMENT,
                &WEAK_END_MOMENT,
                &TORQUE,
            ];
            let of_bearing = [
                &STRETCH,
                &STRETCH_Y,
                &STRETCH_Z,
                &MEMBER_FORCE,
                &MEMBER_FORCE_Y,
                &MEMBER_FORCE_Z,
            ];
            let of_two = [&STRETCH, &STRETCH_Y, &MEMBER_FORCE, &MEMBER_FORCE_Y];
            let (kinds, turns): (&[&Kind], bool) = match (member.link_turns(), member.axes()) {
                (Some(turns), 1) => (&of_link, turns),
                (Some(_), 2) => (&of_two, false),
                (Some(_), _) => (&of_bearing, false),
                (None, axes) if axes > 3 => (&in_space, false),
                (None, _) => (&of_member, false),
            };
            columns.extend(kinds.iter().map(|kind| Column {
                unit: kind.unit_of(turns).into(),
                meaning: format!("{}, {}", kind.meaning, member.name()),
                ..named(kind, kind.of_specimen(member.number()))
            }));
        }
    }
    start..columns.len()
}

/// Where the numbers of a port stand.
#[derive(Debug)]
struct PortPlace {
    range: Range<usize>,
    /// Columns that every axis has side by side: eight, and one more where damping is declared of any.
    width: usize,
}

impl Row {
    /// The row for `dofs` (from 0) of a structure, which of them are `rotations`, and all ports, and its description.
    #[must_use]
    pub(crate) fn new(
        (dofs, rotations): (&[usize], &[usize]),
        side: &Side,
        ports: &[Port],
    ) -> (Self, Vec<Column>) {
        let mut columns = Vec::new();
        columns.extend(HEAD.iter().map(of_test));
        let mut of_ground = ground_columns(side).into_iter();
        columns.extend(of_ground.next());
        columns.extend(CAUSES.iter().map(of_test));
        let start = columns.len();
        columns.extend(of_ground);
        let grounds = start..columns.len();
        let block = |columns: &mut Vec<Column>, moves: &Kind, turns: &Kind| {
            let start = columns.len();
            for dof in dofs {
                let is_rotation = rotations.contains(dof);
                let kind = if is_rotation { turns } else { moves };
                let number = dof + 1;
                columns.push(Column {
                    unit: kind.unit_of(is_rotation).into(),
                    meaning: format!("{} of DOF {number}", kind.meaning),
                    ..named(kind, kind.of_dof(number))
                });
            }
            start..columns.len()
        };
        let disp = block(&mut columns, &DISP, &ROTATION);
        let vel = block(&mut columns, &VEL, &VEL);
        let has_own = matches!(side, Side::Structure(numerical) if numerical.has_own_accel());
        let kind = if has_own { &OWN_ACCEL } else { &ACCEL };
        let accel = block(&mut columns, kind, kind);
        let members = member_columns(&mut columns, side);
        let ports_given = ports;
        let ports = ports
            .iter()
            .enumerate()
            .map(|(index, port)| PortPlace {
                range: port_columns(&mut columns, index + 1, port),
                width: width_of_axis(port),
            })
            .collect();
        let start = columns.len();
        let kept = super::test_limits::kept_limits(side, ports_given);
        for quantity in &kept {
            columns.push(Column {
                name: quantity.key().into(),
                unit: "1".into(),
                meaning: quantity.words().into(),
                timing: false,
            });
        }
        let checks = start..columns.len();
        columns.extend(TIMING.iter().map(of_test));
        let row = Self {
            dofs: (!are_all(dofs, side)).then(|| dofs.to_vec()),
            grounds,
            disp,
            vel,
            accel,
            members,
            ports,
            checks,
            kept,
            ..Self::of_received(columns.len())
        };
        (row, columns)
    }

    /// The row of a received target, with this many columns. Nothing of a test that is integrated has a place in it.
    #[must_use]
    pub(crate) fn of_received(width: usize) -> Self {
        Self {
            word: Word::default(),
            stopped: false,
            cause: None,
            commands: OperatorCommands::default(),
            lateness: Lateness::default(),
            record_before: f64::NAN,
            values: vec![0.0; width],
            dofs: None,
            grounds: 0..0,
            disp: 0..0,
            vel: 0..0,
            accel: 0..0,
            members: 0..0,
            ports: Vec::new(),
            checks: 0..0,
            kept: Vec::new(),
        }
    }

    /// A quantity of the test as a whole and its value as it stands in the row, by its place among those that are kept.
    /// Real-time: yes.
    #[inline]
    pub(super) fn kept_at(&self, place: usize) -> Option<(Limit, f64)> {
        let value = self.values.get(self.checks.start + place)?;
        Some((*self.kept.get(place)?, *value))
    }

    /// Tick within the step, and test time in s, of the row that was made last.
    pub(super) fn moment(&self) -> (f64, f64) {
        match self.values.first_chunk() {
            Some(&[_, sub_tick, _, _, time]) => (sub_tick, time),
            None => (0.0, 0.0),
        }
    }

    /// The finished row.
    #[inline]
    #[must_use]
    pub(crate) fn values(&self) -> &[f64] {
        &self.values
    }

    /// What the next advance and the next aim will overwrite: x and everything of the ports. Real-time: yes.
    #[inline]
    pub(crate) fn exchange(&mut self, tick: &Tick, phase: Phase, side: &Side, ports: &[Port]) {
        if let Side::Structure(numerical) = side {
            self.gather(&self.disp.clone(), &numerical.state.disp);
            if let Some(slots) = self.values.get_mut(self.members.clone()) {
                let members = numerical.structure.members();
                let values = members.recorded().flat_map(|member| member.values());
                for (slot, value) in slots.iter_mut().zip(values) {
                    *slot = value;
                }
            }
        }
        self.between(tick, phase.code(), side, ports);
    }

    /// A tick that ends no step: x, v and a are those of the last one. `state` is for the column of this name. Real-time: yes.
    #[inline]
    pub(crate) fn between(&mut self, tick: &Tick, state: f64, side: &Side, ports: &[Port]) {
        let ground = match side {
            Side::Structure(numerical) if numerical.excitation.has_base() => {
                numerical.excitation.base(tick.index()).0
            }
            Side::Structure(numerical) => numerical.excitation.ground(tick.index()),
            Side::Prescribed(_) => 0.0,
            Side::Received(received) => {
                if let Some(port) = ports.first() {
                    received.write(tick, state, port, &mut self.values);
                }
                return;
            }
        };
        let head = [
            number(tick.step),
            number(tick.sub_tick),
            state,
            if self.stopped { -1.0 } else { self.word.code() },
            tick.time,
            ground,
            self.commands.code(),
            self.cause.map_or(0.0, |cause| f64::from(cause.code())),
        ];
        if let Some(slots) = self.values.first_chunk_mut() {
            *slots = head;
        }
        if let Side::Structure(numerical) = side
            && let Some(slots) = self.values.get_mut(self.grounds.clone())
        {
            let further = numerical.excitation.grounds().iter().skip(1);
            for (slot, ground) in slots.iter_mut().zip(further) {
                *slot = ground.at(tick.index());
            }
        }
        for (place, port) in self.ports.iter().zip(ports) {
            if let Some(slots) = self.values.get_mut(place.range.clone()) {
                port_values(slots, place.width, port);
            }
        }
        if let Some(slots) = self.values.get_mut(self.checks.clone()) {
            for (to, quantity) in slots.iter_mut().zip(&self.kept) {
                *to = super::test_limits::value(*quantity, side, ports);
            }
        }
    }

    /// The recorded ones of the values of all degrees of freedom.
    #[inline]
    fn gather(&mut self, range: &Range<usize>, from: &[f64]) {
        let Some(slots) = self.values.get_mut(range.clone()) else {
            return;
        };
        match &self.dofs {
            None => {
                for (slot, value) in slots.iter_mut().zip(from) {
                    *slot = *value;
                }
            }
            Some(dofs) => {
                for (slot, dof) in slots.iter_mut().zip(dofs) {
                    *slot = from.get(*dof).copied().unwrap_or(f64::NAN);
                }
            }
        }
    }

    /// What is known only after the solve: v and a. Real-time: yes.
    #[inline]
    pub(crate) fn outputs(&mut self, side: &Side) {
        if let Side::Structure(numerical) = side {
            self.gather(&self.vel.clone(), &numerical.reported_vel);
            self.gather(&self.accel.clone(), &numerical.accel);
        }
    }

    /// v and a of a tick whose equilibrium is not made. Real-time: yes.
    pub(crate) fn no_outputs(&mut self) {
        for range in [&self.vel, &self.accel] {
            if let Some(slots) = self.values.get_mut(range.clone()) {
                slots.fill(f64::NAN);
            }
        }
    }

    /// The columns that depend on wall time. What was measured of the tick before is told once. Real-time: yes.
    #[inline]
    pub(crate) fn timing(&mut self, stamps: &TickStamps, first_edge: Nanos, stretched: u64) {
        let seconds = |from: Nanos, to: Nanos| number(to.since(from)) * 1e-9;
        let late = self.lateness;
        // They are the last: an array of as many as there are names.
        let values: [f64; TIMING.len()] = [
            seconds(first_edge, stamps.release),
            seconds(stamps.release, stamps.woke),
            seconds(stamps.release, stamps.sent),
            seconds(stamps.sent, stamps.decoded),
            seconds(stamps.decoded, stamps.ready),
            number(stretched),
            std::mem::replace(&mut self.record_before, f64::NAN),
            number(late.in_a_row),
            number(late.in_window),
            number(late.in_total),
            number(late.skipped_by_wakeup),
            number(late.skipped_by_work),
            number(late.overrun_ns) * 1e-9,
        ];
        self.lateness = Lateness {
            skipped_by_wakeup: 0,
            skipped_by_work: 0,
            overrun_ns: 0,
            ..late
        };
        if let Some(slots) = self.values.last_chunk_mut() {
            *slots = values;
        }
    }
}

/// A count as it stands in a row: none comes near 2⁶³, and of a signed word it is one instruction.
#[inline]
pub(super) fn number(count: u64) -> f64 {
    count.cast_signed() as f64
}

/// The columns of the ground: one at least.
fn ground_columns(side: &Side) -> Vec<Column> {
    let Side::Structure(numerical) = side else {
        return vec![of_test(&GROUND)];
    };
    if numerical.excitation.has_base() {
        return vec![of_test(&BASE)];
    }
    match numerical.excitation.grounds() {
        [] | [_] => vec![of_test(&GROUND)],
        several => several
            .iter()
            .map(|ground| {
                let kind = &GROUND_COMPONENT;
                let component = match ground.suffix.as_str() {
                    direction @ ("x" | "y" | "z") => format!("direction {direction}"),
                    number => format!("component {number}"),
                };
                Column {
                    meaning: format!("{}, {component}", kind.meaning),
                    ..named(kind, kind.of_component(&ground.suffix))
                }
            })
            .collect(),
    }
}

/// True if these are all degrees of freedom in their order.
fn are_all(dofs: &[usize], side: &Side) -> bool {
    matches!(side, Side::Structure(numerical) if (0..numerical.structure.dofs()).eq(dofs.iter().copied()))
}
