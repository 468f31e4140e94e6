//! The rows of received targets, one for each exchange, the numbers that they are made from, and their columns.

use super::phase::Phase;
use super::stage_times::{StageCounter, StageTimes};
use super::tick::Tick;
use crate::port::{LoadingUnit, Port, ReceivedPort};
use gusset_actuator::geometry::Coordinate;
use gusset_quantity::catalog::column::{
    CORRECTION, CORRECTION_ENERGY, Each, Kind, Origin, SERVER, SERVER_COMPENSATION,
    SERVER_RAW_DISP, SERVER_RAW_FORCE,
};
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::Status;
use gusset_quantity::time::Nanos;
use gusset_quantity::units::AxisUnits;
use gusset_record::Column;
use gusset_record::rt::timing::TickStamps;

/// Whether the target of a row was commanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReceivedTarget {
    /// The port was aimed at it.
    #[default]
    Aimed,
    /// The port only sought it.
    Sought,
    /// It is not a finite number.
    NoNumber,
}

/// Numbers of a row that the server knows.
#[derive(Debug, Clone, Copy, Default)]
pub struct ReceivedRow {
    /// Test time of the command in s.
    pub time: f64,
    /// Test time in s since the last commit.
    pub elapsed: f64,
    /// The client's number of the command; none of a command of the server itself.
    pub number: Option<u64>,
    /// Commands that were accepted so far.
    pub commits: u64,
    /// Code of the trip; 0 without one.
    pub trip: u32,
    /// The specimen is lost.
    pub is_lost: bool,
    /// Flags that the client receives; none of a command of the server itself.
    pub status: Option<Status>,
    /// What became of the target.
    pub target: ReceivedTarget,
    /// What happened since the command before.
    pub between: Between,
    /// Time in s that the command has for its motion, by the limits of the specimen and by those that the controller announced.
    pub allowed: Option<[f64; 2]>,
}

/// What happened between two commands of a controller: flags of the column `between`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Between(pub u32);

impl Between {
    /// The specimen came to rest, since no command came.
    pub const RESTED: Self = Self(1);
    /// The controller ended its motion.
    pub const HALTED: Self = Self(2);
    /// The controller does not want the answer any more.
    pub const UNWANTED: Self = Self(4);
    /// The target before was given up on its way.
    pub const GIVEN_UP: Self = Self(8);
    /// The test tripped.
    pub const TRIPPED: Self = Self(16);
    /// The target came after the specimen had moved on.
    pub const LATE: Self = Self(32);

    /// The flags of a recorded row; none of a number that holds none.
    #[must_use]
    pub const fn of_column(value: f64) -> Self {
        Self(value as u32)
    }

    /// True if it happened.
    #[must_use]
    pub const fn has(self, flag: Self) -> bool {
        self.0 & flag.0 != 0
    }

    /// It happened.
    pub const fn add(&mut self, flag: Self) {
        self.0 |= flag.0;
    }

    /// It does not count.
    pub const fn remove(&mut self, flag: Self) {
        self.0 &= !flag.0;
    }
}

/// A target as the controller gave it.
#[derive(Debug)]
struct Asked {
    /// Test time in s, and test time since the last commit.
    times: [f64; 2],
    /// Displacements and velocities, one after the other for each signal.
    motion: Vec<f64>,
}

/// Counts of the exchanges.
#[derive(Debug, Clone, Default)]
pub struct ReceivedCounts {
    /// Exchanges, those included whose command was not passed on.
    pub exchanges: u64,
    /// Commands that were passed on, and those of them that were answered.
    pub passed_on: u64,
    /// See `passed_on`.
    pub answered: u64,
    /// Largest |displacement| of each axis in m, and largest |force| in N.
    pub peaks: [Vec<f64>; 2],
    /// First test time in s between two commands that is not 0.
    pub dt: f64,
    /// How the time of a specimen that keeps moving between targets was spent: in the whole test, and in its strong part.
    pub stages: Option<[StageTimes; 2]>,
}

/// The numbers that a row of a received target is made from.
#[derive(Debug)]
pub struct Received {
    /// Units of the axes, and units in which the port counts.
    units: Vec<AxisUnits>,
    pub(super) port_units: Vec<AxisUnits>,
    began: Nanos,
    stamps: TickStamps,
    pub(super) row: ReceivedRow,
    asked: Asked,
    /// Place of the newest command in the record.
    pub(super) place: Tick,
    pub(super) counts: ReceivedCounts,
    pub(super) stages: StageCounter,
    /// Correction of the force of each signal, and the energy of all; empty where none is made.
    pub(super) corrections: Vec<f64>,
    /// The last command that left to the axes, in their units; empty before one.
    pub(super) told: AtAxis<Vec<f64>>,
    /// The last paced command left late.
    pub(super) is_late: bool,
}

impl Received {
    /// The rows of a specimen with this number of axes. Its port counts in `port_units`.
    pub(super) fn new(
        signals: usize,
        axes: usize,
        units: Vec<AxisUnits>,
        port_units: Vec<AxisUnits>,
        began: Nanos,
    ) -> Self {
        Self {
            units,
            port_units,
            began,
            stamps: TickStamps::default(),
            row: ReceivedRow::default(),
            asked: Asked {
                times: [f64::NAN; 2],
                motion: vec![f64::NAN; 2 * signals],
            },
            place: Tick::before_start(0.0),
            counts: ReceivedCounts {
                peaks: [vec![0.0; axes], vec![0.0; axes]],
                ..ReceivedCounts::default()
            },
            stages: StageCounter::new(signals),
            corrections: Vec::new(),
            told: AtAxis(Vec::with_capacity(axes)),
            is_late: false,
        }
    }

    /// A command has left. Real-time: yes.
    pub(super) fn left(&mut self, command: AtAxis<&[f64]>) {
        // Within its capacity.
        self.told.clear();
        self.told.extend_from_slice(&command);
    }

    /// The controller asks for this target. Real-time: yes.
    pub(super) fn asks(&mut self, times: [f64; 2], motion: impl Iterator<Item = [f64; 2]>) {
        let is_new = times[0] > self.asked.times[0] || self.asked.times[0].is_nan();
        self.asked.times = times;
        let places = self.asked.motion.chunks_exact_mut(2);
        places
            .zip(motion)
            .for_each(|(to, from)| to.copy_from_slice(&from));
        if is_new {
            self.stages.target(&self.asked.motion, times[1]);
        }
    }

    /// The commands from here on are those of the server itself.
    pub(super) fn asks_nothing(&mut self) {
        self.asked.times = [f64::NAN; 2];
        self.asked.motion.fill(f64::NAN);
    }

    /// Metres and newtons in one unit of the port. Real-time: yes.
    pub(super) fn units_of(&self, axis: usize) -> (f64, f64) {
        let units = self.port_units.get(axis);
        units.map_or((1.0, 1.0), |units| (units.metres, units.newtons))
    }

    /// Keeps the times of an exchange. Real-time: yes.
    pub(super) const fn stamp(&mut self, stamps: &TickStamps) {
        self.stamps = *stamps;
    }

    /// When the command of the row came, and the time of its round trip, in s.
    pub(super) fn times(&self) -> (f64, f64) {
        let seconds = |from: Nanos, to: Nanos| to.since(from) as f64 * 1e-9;
        let TickStamps { woke, decoded, .. } = self.stamps;
        (seconds(self.began, woke), seconds(woke, decoded))
    }

    /// Counts the exchange whose row is complete. Real-time: yes.
    pub(super) fn count(&mut self, is_passed_on: bool, port: &Port) {
        let counts = &mut self.counts;
        counts.exchanges += 1;
        counts.passed_on += u64::from(is_passed_on);
        counts.answered += u64::from(is_passed_on && !self.row.is_lost);
        // A command on the way takes a part of the step of its controller.
        let [_, step] = self.asked.times;
        if counts.dt == 0.0 && step > 0.0 {
            counts.dt = step;
        }
        let raw = port.feedback().raw();
        let [disp, force] = &mut counts.peaks;
        let measured = raw.disp.iter().zip(&raw.force).zip(&self.units);
        for ((disp, force), ((raw_disp, raw_force), units)) in
            disp.iter_mut().zip(force).zip(measured)
        {
            *disp = disp.max((units.metres * raw_disp).abs());
            *force = force.max((units.newtons * raw_force).abs());
        }
    }

    /// The row of an exchange in this state. Real-time: yes.
    pub(super) fn write(&self, tick: &Tick, state: f64, port: &Port, values: &mut [f64]) {
        let row = &self.row;
        let (received_s, round_trip_s) = self.times();
        let [asked_time, asked_elapsed] = self.asked.times;
        let [allowed, by_controller] = row.allowed.unwrap_or([f64::NAN; 2]);
        let head = [
            self.counts.exchanges as f64,
            0.0,
            state,
            tick.time,
            row.elapsed,
            row.number.map_or_else(
                || port.exchange().count().sent.saturating_sub(1) as f64,
                |number| number as f64,
            ),
            row.commits as f64,
            f64::from(row.trip),
            received_s,
            round_trip_s,
            asked_time,
            asked_elapsed,
            f64::from(row.between.0),
            allowed,
            by_controller,
        ];
        let before_axes = head.iter().chain(&self.asked.motion);
        for (to, from) in values.iter_mut().zip(before_axes) {
            *to = *from;
        }
        let is_kept_back = state == Phase::Tripped.code();
        self.write_axes(
            is_kept_back,
            port,
            values
                .get_mut(HEAD + self.asked.motion.len()..)
                .unwrap_or_default(),
        );
        if let [.., raw_status, status] = values {
            let raw = port.feedback().raw().status.0;
            *raw_status = f64::from(raw);
            let raw = raw & !Status::HELD.0;
            let stale = if is_kept_back { Status::STALE.0 } else { 0 };
            *status = f64::from(row.status.map_or(raw, |status| status.0) | stale);
        }
    }

    /// The columns of the axes, [`WIDTH`] each, those of the coordinates, and those of tracking, as in the row of a run. Real-time: yes.
    fn write_axes(&self, is_kept_back: bool, port: &Port, row: &mut [f64]) {
        let axes = WIDTH * port.axes();
        let (row, coordinates) = row.split_at_mut(axes.min(row.len()));
        let commands = port.goal().0.iter().zip(*port.command());
        let commands = commands.zip(*port.command_vel()).zip(&self.port_units);
        for (slot, (axis, (((goal, command), vel), units))) in
            row.chunks_exact_mut(WIDTH).zip(commands.enumerate())
        {
            let [target, _, meas, force, raw_disp, raw_force] = port.motion_of(axis);
            let AxisUnits {
                metres, newtons, ..
            } = units;
            let target = match self.row.target {
                ReceivedTarget::Aimed => target,
                ReceivedTarget::Sought => *goal,
                ReceivedTarget::NoNumber => f64::NAN,
            };
            let sent = if is_kept_back { f64::NAN } else { *command };
            slot.copy_from_slice(&[
                metres * target,
                sent,
                metres * meas,
                newtons * force,
                raw_disp,
                raw_force,
                *vel,
            ]);
        }
        let slots = coordinates.chunks_exact_mut(COORDINATE_WIDTH);
        for (slot, (_, values)) in
            slots.zip(port.loading_unit().into_iter().flat_map(LoadingUnit::pose))
        {
            slot.copy_from_slice(&values);
        }
        let further = coordinates.get_mut(COORDINATE_WIDTH * port.coordinates()..);
        let values = port
            .tracking()
            .values()
            .flatten()
            .chain(port.path().compensation_parameters())
            .chain(self.corrections.iter().copied());
        // The last two columns are the status.
        for (slot, value) in further.into_iter().flatten().zip(values) {
            *slot = value;
        }
    }
}

/// Columns before those of the axes.
const HEAD: usize = count(Each::Test);
/// Columns of every axis.
const WIDTH: usize = count(Each::Axis);
/// Columns of every signal of the controller.
const SIGNAL_WIDTH: usize = count(Each::Signal);
const _: () = assert!(SIGNAL_WIDTH == 2);
/// Columns of every coordinate of a loading unit.
const COORDINATE_WIDTH: usize = count(Each::Coordinate);

/// Estimates are not counted: only an axis whose tracking is estimated has them.
const fn count(each: Each) -> usize {
    let (mut count, mut at) = (0, 0);
    while at < SERVER.len() {
        if SERVER[at].each as u8 == each as u8 && !is_estimate(&SERVER[at]) {
            count += 1;
        }
        at += 1;
    }
    count
}

const fn is_estimate(kind: &Kind) -> bool {
    kind.origin as u8 == Origin::Estimated as u8
}

fn kinds(each: Each) -> impl Iterator<Item = &'static Kind> {
    SERVER
        .iter()
        .filter(move |kind| kind.each == each && !is_estimate(kind))
}

/// The columns of a specimen with this number of signals, whose axes have these units, and which are the actuators of a loading unit
/// with these coordinates, if there is one. `corrects`: forces are corrected.
#[must_use]
pub fn received_columns(
    (signals, corrects): (usize, bool),
    units: &[AxisUnits],
    coordinates: &[Coordinate],
    port: &ReceivedPort,
    name: &str,
) -> Vec<Column> {
    let column = |kind: &Kind, name: String, unit: &str, meaning: String| Column {
        name,
        unit: unit.to_owned(),
        meaning,
        timing: kind.is_timing(),
    };
    let of_test = |kind: &Kind| column(kind, kind.name().into(), kind.unit, kind.told(""));
    let mut columns: Vec<Column> = kinds(Each::Test).map(of_test).collect();
    for signal in 1..=signals {
        columns.extend(kinds(Each::Signal).map(|kind| {
            let meaning = format!(
                "{}; specimen \"{name}\", displacement {signal}",
                kind.meaning
            );
            column(kind, kind.of_axis(1, signal), kind.unit, meaning)
        }));
    }
    for (axis, units) in (1..).zip(units) {
        for kind in kinds(Each::Axis) {
            // A rotation stays one, and a moment too: there is nothing to bring into metres.
            let unit = match kind.unit {
                unit if unit == SERVER_RAW_DISP.unit => units.disp,
                unit if unit == SERVER_RAW_FORCE.unit => units.force,
                _ => kind.unit_of(units.disp == "rad"),
            };
            let meaning = format!("{}; specimen \"{name}\", axis {axis}", kind.meaning);
            columns.push(column(kind, kind.of_axis(1, axis), unit, meaning));
        }
    }
    for (number, coordinate) in (1..).zip(coordinates) {
        columns.extend(kinds(Each::Coordinate).map(|kind| {
            let key = coordinate.key();
            let meaning = format!("{}; specimen \"{name}\", coordinate {key}", kind.meaning);
            let unit = kind.unit_of(coordinate.is_rotation());
            column(kind, kind.of_axis(1, number), unit, meaning)
        }));
    }
    for axis in (1..=port.axes()).filter(|_| port.tracking().is_on()) {
        let estimates = SERVER
            .iter()
            .filter(|kind| is_estimate(kind) && kind.each == Each::Axis);
        columns.extend(estimates.map(|kind| {
            let meaning = format!("{}; specimen \"{name}\", axis {axis}", kind.meaning);
            column(kind, kind.of_axis(1, axis), kind.unit, meaning)
        }));
    }
    for (axis, parameter) in port.path().compensation_names() {
        let (key, kind) = (parameter.name, &SERVER_COMPENSATION);
        let meaning = kind.meaning.replace("NAME", key);
        let meaning = format!("{meaning}; specimen \"{name}\", axis {}", axis + 1);
        let of = kind.of_parameter(key, 1, axis + 1);
        columns.push(column(kind, of, parameter.unit, meaning));
    }
    if corrects {
        for signal in 1..=signals {
            let kind = &CORRECTION;
            let meaning = format!(
                "{}; specimen \"{name}\", displacement {signal}",
                kind.meaning
            );
            columns.push(column(kind, kind.of_axis(1, signal), "N or N m", meaning));
        }
        let kind = &CORRECTION_ENERGY;
        let meaning = format!("{}; specimen \"{name}\"", kind.meaning);
        columns.push(column(kind, kind.of_specimen(1), kind.unit, meaning));
    }
    columns.extend(kinds(Each::Specimen).map(|kind| {
        let meaning = format!("{}; specimen \"{name}\"", kind.meaning);
        column(kind, kind.of_specimen(1), kind.unit, meaning)
    }));
    columns
}
