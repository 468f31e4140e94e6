//! The columns of a row: name, unit, meaning, origin, and when a row has them.
//!
//! [`TEST`] lists the kinds of columns of a test in the order of a row, [`SERVER`] those of a server. Every reader and writer of rows
//! takes names from here. A kind has one column per DOF, specimen, axis or coordinate; all of these count from 1.
//! Two kinds may share a name where the meaning depends on the test. The column of a limit of the whole test has the key of
//! that limit, which the table of limits holds. A name never changes its meaning, because old records hold it.

use std::fmt::Display;

/// Scope of a kind: it has one column for each of these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Each {
    /// The test.
    Test,
    /// A component of the ground motion: a direction or a number.
    Component,
    /// A recorded DOF.
    Dof,
    /// A recorded member or link of a frame.
    Member,
    /// A specimen.
    Specimen,
    /// An axis of a specimen.
    Axis,
    /// A coordinate of a loading unit.
    Coordinate,
    /// A displacement that the controller of a server commands.
    Signal,
    /// A parameter of a compensator of an axis.
    Parameter,
}

/// A kind of column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind {
    /// Name without numbers.
    pub stem: &'static str,
    /// Scope: it has one column for each of these.
    pub each: Each,
    /// Unit, or that of a translation and that of a rotation.
    pub unit: &'static str,
    /// Meaning; `{specimen}` marks the place of the specimen.
    pub meaning: &'static str,
    /// Codes of the values, as the meaning in a file continues.
    pub codes: &'static str,
    /// Where the number comes from.
    pub origin: Origin,
    /// When a row contains it.
    pub when: &'static str,
}

/// Where the number of a column comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The real-time loop.
    Loop,
    /// The operator.
    Operator,
    /// The excitation.
    Excitation,
    /// The integration.
    Integrator,
    /// The command path of the controller.
    Controller,
    /// The specimen.
    Measured,
    /// An estimate from measurements.
    Estimated,
    /// A server.
    Server,
    /// Wall time: it differs between repeats of a test.
    Clock,
}

impl Origin {
    /// In words.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Origin::Loop => "loop",
            Origin::Operator => "operator",
            Origin::Excitation => "excitation",
            Origin::Integrator => "integrator",
            Origin::Controller => "controller",
            Origin::Measured => "measured",
            Origin::Estimated => "estimated",
            Origin::Server => "server",
            Origin::Clock => "clock",
        }
    }
}

impl Kind {
    /// Name of the one column of the test.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.stem
    }

    /// Name of the column of a component of the ground motion; an empty one is the only one.
    #[must_use]
    pub fn of_component(&self, component: &str) -> String {
        match component {
            "" => self.stem.to_owned(),
            component => format!("{}_{component}", self.stem),
        }
    }

    /// Name of the column of a DOF.
    #[must_use]
    pub fn of_dof(&self, dof: impl Display) -> String {
        format!("{}{dof}", self.stem)
    }

    /// Name of the column of a specimen, or of a member of a frame.
    #[must_use]
    pub fn of_specimen(&self, specimen: impl Display) -> String {
        format!("{}_{specimen}", self.stem)
    }

    /// Name of the column of an axis, of a coordinate, or of a signal, of a specimen.
    #[must_use]
    pub fn of_axis(&self, specimen: impl Display, axis: impl Display) -> String {
        format!("{}_{specimen}_{axis}", self.stem)
    }

    /// Name of the column of a parameter of the compensator of an axis.
    #[must_use]
    pub fn of_parameter(
        &self,
        parameter: &str,
        specimen: impl Display,
        axis: impl Display,
    ) -> String {
        format!("{}_{parameter}_{specimen}_{axis}", self.stem)
    }

    /// Name with letters in place of numbers, for people.
    #[must_use]
    pub fn pattern(&self) -> String {
        let stem = self.stem;
        match self.each {
            Each::Test => stem.to_owned(),
            Each::Component => format!("{stem}_D"),
            Each::Dof => format!("{stem}N"),
            Each::Member => format!("{stem}_M"),
            Each::Specimen => format!("{stem}_S"),
            Each::Axis => format!("{stem}_S_A"),
            Each::Coordinate => format!("{stem}_S_C"),
            Each::Signal => format!("{stem}_S_N"),
            Each::Parameter => format!("{stem}_NAME_S_A"),
        }
    }

    /// True if a column of this name is of this kind.
    #[must_use]
    pub fn fits(&self, name: &str) -> bool {
        self.numbers(name).is_some()
    }

    /// DOF of the column of this name, if it is of this kind.
    #[must_use]
    pub fn dof_in(&self, name: &str) -> Option<u32> {
        let [dof, _] = self.numbers(name)?;
        (self.each == Each::Dof).then_some(dof)
    }

    /// Specimen of the column of this name, if it is of this kind.
    #[must_use]
    pub fn specimen_in(&self, name: &str) -> Option<u32> {
        let [specimen, _] = self.numbers(name)?;
        let is_none = matches!(
            self.each,
            Each::Test | Each::Component | Each::Dof | Each::Member
        );
        (!is_none).then_some(specimen)
    }

    /// Number of the member of the column of this name, if it is of this kind.
    #[must_use]
    pub fn member_in(&self, name: &str) -> Option<u32> {
        let [member, _] = self.numbers(name)?;
        matches!(self.each, Each::Member).then_some(member)
    }

    /// Specimen and axis, coordinate or signal, of the column of this name, if it is of this kind.
    #[must_use]
    pub fn axis_in(&self, name: &str) -> Option<(u32, u32)> {
        let [specimen, axis] = self.numbers(name)?;
        (axis > 0).then_some((specimen, axis))
    }

    /// Takes apart what [`Self::of_dof`] and its neighbours put together. A number that the kind does not have is 0.
    fn numbers(&self, name: &str) -> Option<[u32; 2]> {
        let number = |text: &str| {
            let is_plain = !text.starts_with('0') && text.bytes().all(|b| b.is_ascii_digit());
            is_plain.then(|| text.parse().ok()).flatten()
        };
        let rest = name.strip_prefix(self.stem)?;
        let parts = || rest.strip_prefix('_');
        Some(match self.each {
            Each::Test => return rest.is_empty().then_some([0; 2]),
            Each::Component => match parts()? {
                "x" | "y" | "z" => [0; 2],
                component => [number(component)?, 0],
            },
            Each::Dof => [number(rest)?, 0],
            Each::Member | Each::Specimen => [number(parts()?)?, 0],
            Each::Axis | Each::Coordinate | Each::Signal => {
                let (specimen, axis) = parts()?.split_once('_')?;
                [number(specimen)?, number(axis)?]
            }
            Each::Parameter => {
                let (head, axis) = parts()?.rsplit_once('_')?;
                let (_, specimen) = head.rsplit_once('_')?;
                [number(specimen)?, number(axis)?]
            }
        })
    }

    /// Unit of a translation, or of a rotation where the kind has a second unit.
    #[must_use]
    pub fn unit_of(&self, turns: bool) -> &'static str {
        let mut units = self.unit.split(" or ");
        let first = units.next().unwrap_or_default();
        if turns {
            units.next().unwrap_or(first)
        } else {
            first
        }
    }

    /// Meaning as in a file; `specimen` names the specimen.
    #[must_use]
    pub fn told(&self, specimen: &str) -> String {
        let meaning = self.meaning.replace("{specimen}", specimen);
        meaning + self.codes
    }

    /// True if the column depends on wall time.
    #[must_use]
    pub const fn is_timing(&self) -> bool {
        matches!(self.origin, Origin::Clock)
    }
}

/// Page of the guide with this table.
pub const PAGE: &str = "columns";

/// True for a column of the ground motion.
#[must_use]
pub fn is_ground(name: &str) -> bool {
    GROUND.fits(name) || GROUND_COMPONENT.fits(name)
}

/// The kind of a column of this name, of a test or a server; none if no kind has such a name. The columns of limits of the whole test have
/// no kind. Of kinds that share a name it is the first.
#[must_use]
pub fn find(name: &str) -> Option<&'static Kind> {
    TEST.iter().chain(SERVER).find(|kind| kind.fits(name))
}

macro_rules! kinds {
    ($(#[$about:meta])* $table:ident: $($(#[$doc:meta])* $name:ident = $stem:literal, $each:ident, $unit:literal, $origin:ident,
        $when:expr, $meaning:literal $(, $codes:literal)?;)*) => {
        $($(#[$doc])*
        pub const $name: Kind = Kind {
            stem: $stem,
            each: Each::$each,
            unit: $unit,
            meaning: $meaning,
            codes: concat!($($codes)?),
            origin: Origin::$origin,
            when: $when,
        };)*

        $(#[$about])*
        pub const $table: &[Kind] = &[$($name,)*];
    };
}

const ALWAYS: &str = "always";
const STRUCTURE: &str = "with a structure";
const UNIT: &str = "with a loading unit";
const MEMBER: &str = "with a member or link that has `record = true`";
const BEARING: &str = "with a bearing of a frame that has `record = true`";
const VERTICAL_BEARING: &str = "with a bearing of three axes that has `record = true`";
const IN_SPACE: &str = "with a member in space that has `record = true`";
const TRACKED: &str = "where the tracking of the axis is estimated";

kinds! {
    /// All kinds of a test, in the order of a row.
    TEST:
    /// Step of the integration.
    STEP = "step", Test, "1", Loop, ALWAYS, "integration step, 0 at t = 0";
    /// Tick within the step.
    SUB_TICK = "sub_tick", Test, "1", Loop, ALWAYS, "tick within the step, from 0";
    /// Phase of the test, see [`super::phase::STATES`].
    STATE = "state", Test, "1", Loop, ALWAYS, "phase of the test",
        ": 1 static load, 2 wiring check, 3 running, 4 zeroing, 5 ramp to the start position, 6 hold, 7 return move at the end, \
     8 tripped, 10 warm-up, 14 ended because a tick was too late, 15 ended by the operator while a reply was awaited; \
     between two steps: 11 towards a known target, 12 along the prediction, 13 slowing down";
    /// Requests of the operator.
    HOLD = "hold", Test, "1", Operator, ALWAYS,
        "requests of the operator",
        ", as a sum: 1 from `hold` until `continue`, 2 `continue` since the row before, 4 confirmation of the sensor readings since the \
     row before; -1 a test that the operator stopped trips on its return move";
    /// Test time.
    TIME = "time", Test, "s", Loop, ALWAYS, "test time";
    /// Acceleration of the ground.
    GROUND = "ground", Test, "m/s2", Excitation, "always, except with a base displacement", "acceleration of the ground";
    /// Acceleration of the ground in a direction, or of a component.
    GROUND_COMPONENT = "ground", Component, "m/s2", Excitation, "with several components, instead of `ground`",
        "acceleration of the ground";
    /// Displacement of the base, in the same column.
    BASE = "ground", Test, "m", Excitation, "with a base displacement", "displacement of the base";
    /// Commands of the operator.
    OPERATOR = "operator", Test, "1", Operator, ALWAYS, "commands of the operator since the row before",
        ", as a sum: 1 hold, 2 continue, 4 confirm, 8 stop, 16 end because a tick was too late, 32 stop while a reply was \
     awaited, 64 stop after which the specimens go back to where their motion began; `continue` takes effect before a `hold` in \
     the same row";
    /// Cause of the ending, see [`super::ending::Cause`].
    CAUSE = "cause", Test, "1", Loop, ALWAYS, "code of the cause that ended the test or its shutdown; 0 in the rows before";
    /// Displacement of a DOF.
    DISP = "x", Dof, "m", Integrator, STRUCTURE, "displacement";
    /// Rotation of a DOF, in the same column.
    ROTATION = "x", Dof, "rad", Integrator, "with a structure whose DOF is a rotation", "rotation";
    /// Velocity of a DOF.
    VEL = "v", Dof, "m/s or rad/s", Integrator, STRUCTURE, "velocity";
    /// Acceleration of a DOF.
    ACCEL = "a", Dof, "m/s2 or rad/s2", Integrator, STRUCTURE,
        "acceleration from equilibrium at the end of the step, M⁻¹r,";
    /// Acceleration of a DOF in a method that has its own, in the same column.
    OWN_ACCEL = "a", Dof, "m/s2 or rad/s2", Integrator, "with a method that carries an acceleration",
        "acceleration that the method uses in its next step, not from equilibrium,";
    /// Elongation of a member of a frame, or deformation of a link.
    STRETCH = "stretch", Member, "m or rad", Integrator, MEMBER, "elongation, or deformation of a link, or of a bearing in x";
    /// Deformation of a bearing in y.
    STRETCH_Y = "stretch_y", Member, "m", Integrator, BEARING, "deformation of a bearing in y";
    /// Deformation of a bearing in z.
    STRETCH_Z = "stretch_z", Member, "m", Integrator, VERTICAL_BEARING, "deformation of a bearing in z";
    /// Its rotation from the chord at its start.
    START_ROTATION = "rotation_start", Member, "rad", Integrator, MEMBER, "rotation of the start from the chord";
    /// Its rotation from the chord at its end.
    END_ROTATION = "rotation_end", Member, "rad", Integrator, MEMBER, "rotation of the end from the chord";
    /// Its rotation about the local axis y at its start, in space.
    WEAK_START_ROTATION = "weak_rotation_start", Member, "rad", Integrator, IN_SPACE, "rotation of the start from the chord about the local axis y";
    /// Its rotation about the local axis y at its end, in space.
    WEAK_END_ROTATION = "weak_rotation_end", Member, "rad", Integrator, IN_SPACE, "rotation of the end from the chord about the local axis y";
    /// Its twist, in space.
    TWIST = "twist", Member, "rad", Integrator, IN_SPACE, "twist from start to end";
    /// Its axial force, or the force of a link.
    MEMBER_FORCE = "member_force", Member, "N or N m", Integrator, MEMBER, "axial force, tension positive, or force of a link, or of a bearing in x";
    /// Force of a bearing in y.
    MEMBER_FORCE_Y = "member_force_y", Member, "N", Integrator, BEARING, "force of a bearing in y";
    /// Force of a bearing in z.
    MEMBER_FORCE_Z = "member_force_z", Member, "N", Integrator, VERTICAL_BEARING, "force of a bearing in z";
    /// Its moment at its start.
    START_MOMENT = "moment_start", Member, "N m", Integrator, MEMBER, "moment at the start";
    /// Its moment at its end.
    END_MOMENT = "moment_end", Member, "N m", Integrator, MEMBER, "moment at the end";
    /// Its moment about the local axis y at its start, in space.
    WEAK_START_MOMENT = "weak_moment_start", Member, "N m", Integrator, IN_SPACE, "moment at the start about the local axis y";
    /// Its moment about the local axis y at its end, in space.
    WEAK_END_MOMENT = "weak_moment_end", Member, "N m", Integrator, IN_SPACE, "moment at the end about the local axis y";
    /// Its torque, in space.
    TORQUE = "torque", Member, "N m", Integrator, IN_SPACE, "torque";
    /// Target of an axis.
    TARGET = "target", Axis, "m", Integrator, ALWAYS, "target: the deformation B·x of the structure";
    /// Target of an actuator of a loading unit, in the same column.
    STROKE = "target", Axis, "m", Integrator, UNIT, "target: the stroke of the actuator for the pose B·x";
    /// Command of an axis.
    COMMAND = "cmd", Axis, "specimen unit", Controller, ALWAYS, "command that was sent";
    /// Measured displacement of an axis.
    MEASURED = "meas", Axis, "m", Measured, ALWAYS, "measured displacement at the structure's scale";
    /// Force of an axis.
    FORCE = "force", Axis, "N", Measured, ALWAYS, "restoring force that entered equilibrium";
    /// Force of an actuator of a loading unit, in the same column.
    ACTUATOR_FORCE = "force", Axis, "N", Measured, UNIT, "force of the actuator at the structure's scale";
    /// Measured displacement of an axis, as received.
    RAW_DISP = "raw_disp", Axis, "specimen unit", Measured, ALWAYS, "measured displacement as received";
    /// Measured force of an axis, as received.
    RAW_FORCE = "raw_force", Axis, "specimen unit", Measured, ALWAYS, "measured force as received";
    /// Tangent stiffness of an axis.
    TANGENT = "kt", Axis, "N/m", Estimated, ALWAYS, "estimated tangent stiffness; the declared one until the axis has moved";
    /// Energy that an axis added by tracking errors.
    ADDED = "added", Axis, "J", Estimated, ALWAYS, "energy that the axis has added to the structure through its tracking error; negative if it has removed energy";
    /// Tangent damping of an axis.
    TANGENT_DAMPING = "ct", Axis, "N s/m", Estimated, "where damping is declared", "estimated tangent damping";
    /// Lag of an axis.
    LAG = "lag", Axis, "s", Estimated, TRACKED, "estimated lag of the measured displacement behind the target";
    /// Gain of an axis.
    GAIN = "gain", Axis, "1", Estimated, TRACKED, "estimated gain of the measured displacement over the target";
    /// Fitted stiffness of an axis.
    STIFFNESS = "stiffness", Axis, "N/m", Estimated, TRACKED, "stiffness fitted over the last seconds of motion";
    /// Damping that the lag of an axis adds.
    FALSE_DAMPING = "false_c", Axis, "N s/m", Estimated, TRACKED, "damping that the lag adds; negative if the lag removes energy";
    /// Margin of an axis to its critical delay.
    MARGIN = "margin", Axis, "s", Estimated, "where the critical delay is known",
        "critical delay minus lag, at the stiffness of the last seconds of motion; the response grows below 0; inf if every \
     delay is stable";
    /// Parameter of the compensator of an axis.
    COMPENSATION = "comp", Parameter, "of the parameter", Controller, "with a compensator that has parameters",
        "parameter NAME of the compensator";
    /// Target of a coordinate.
    POSE = "pose", Coordinate, "m or rad", Integrator, UNIT, "target pose B·x of the loading unit";
    /// Measured coordinate.
    MEASURED_POSE = "pose_meas", Coordinate, "m or rad", Measured, UNIT, "pose from the measured strokes";
    /// Force in a coordinate.
    POSE_FORCE = "pose_force", Coordinate, "N or N m", Measured, UNIT, "force that entered equilibrium";
    /// Value that a limit of an axis judged.
    JUDGED = "judged", Parameter, "of the limit", Controller, "where the limit has a level",
        "value that the limit NAME judged in this tick; none if it judged nothing";
    /// Deviation of the clock of a bus.
    CLOCK_PPM = "clock_ppm", Specimen, "ppm", Clock, "where the loop follows the clock of a bus",
        "deviation of the clock of the bus of {specimen} from the clock of this computer";
    /// Number of a command.
    SEQUENCE = "seq", Specimen, "1", Measured, ALWAYS, "number of the newest command in force when {specimen} was sampled";
    /// Status flags.
    STATUS = "status", Specimen, "1", Measured, ALWAYS, "status flags of {specimen}",
        ", as a sum: 1 interlock open, 2 held by its own watchdog, 4 a sensor or an actuator at the end of its range, \
     8 simulated actuator: iteration not converged; set by the loop: 65536 link lost, 131072 before the last command was sent, \
     262144 stale: no new measurement, 524288 reply not waited for, 1048576 with 2: it held until its last command came";
    /// Commands that were sent. Whether a reply comes in time depends on the wall clock.
    EXCHANGES = "exchanges", Specimen, "1", Clock, ALWAYS, "commands sent to {specimen} so far, with repeated ones";
    /// Stale measurements.
    STALE = "stale", Specimen, "1", Clock, ALWAYS, "stale measurements of {specimen} so far: no reply arrived in time";
    /// Edge of the tick.
    RELEASE = "release_s", Test, "s", Clock, ALWAYS, "wall time from the first edge to the edge of this tick";
    /// Lateness of the wake-up.
    WAKEUP = "wakeup_lateness_s", Test, "s", Clock, ALWAYS, "from the edge of the tick to the first instruction after waiting";
    /// Lateness of the command.
    COMMAND_LATENESS = "command_lateness_s", Test, "s", Clock, ALWAYS, "from the edge of the tick to the end of the last send";
    /// Round trip.
    ROUND_TRIP = "round_trip_s", Test, "s", Clock, ALWAYS, "from the last send to the last decoded reply";
    /// Time of the computation.
    COMPUTE = "compute_s", Test, "s", Clock, ALWAYS, "from the last decoded reply until the next command is ready";
    /// Moves of the grid.
    STRETCHED = "stretched", Test, "1", Clock, ALWAYS, "whole ticks by which the grid has moved so far";
    /// Time of recording.
    RECORD_BEFORE = "record_before_s", Test, "s", Clock, ALWAYS,
        "for the tick of the row before: from the next command being ready until the row is handed over; none in the first row, \
     and where it was not measured";
    /// Deadline misses in a row.
    MISSES_IN_A_ROW = "misses_in_a_row", Test, "1", Clock, ALWAYS, "deadline misses in a row, up to the tick of the row before";
    /// Deadline misses in the window.
    MISSES_IN_WINDOW = "misses_in_window", Test, "1", Clock, ALWAYS,
        "deadline misses within `timing.misses.window_s`, up to the tick of the row before; the count ends at one more than allowed";
    /// Deadline misses.
    MISSES_IN_TOTAL = "misses_in_total", Test, "1", Clock, ALWAYS, "deadline misses in total, up to the tick of the row before";
    /// Ticks skipped before this one.
    SKIPPED_BY_WAKEUP = "skipped_by_wakeup", Test, "1", Clock, ALWAYS,
        "ticks by which the grid moved because this tick woke late; `wakeup_lateness_s` holds how late";
    /// Ticks skipped behind the one before.
    SKIPPED_BY_WORK = "skipped_by_work", Test, "1", Clock, ALWAYS,
        "ticks by which the grid moved because the work of the tick before ended late; `overrun_s` holds how late";
    /// Lateness of the work that skipped them.
    OVERRUN = "overrun_s", Test, "s", Clock, ALWAYS,
        "from the edge that moved to the end of the work of the tick before; 0 if `skipped_by_work` is 0";
}

/// Columns at the beginning of a row, in their order.
pub const HEAD: [Kind; 5] = [STEP, SUB_TICK, STATE, HOLD, TIME];

/// Columns after the ground, in their order.
pub const CAUSES: [Kind; 2] = [OPERATOR, CAUSE];

/// Columns at the end of a row, in their order. Recordings without the last ones are replayed.
pub const TIMING: [Kind; 13] = [
    RELEASE,
    WAKEUP,
    COMMAND_LATENESS,
    ROUND_TRIP,
    COMPUTE,
    STRETCHED,
    RECORD_BEFORE,
    MISSES_IN_A_ROW,
    MISSES_IN_WINDOW,
    MISSES_IN_TOTAL,
    SKIPPED_BY_WAKEUP,
    SKIPPED_BY_WORK,
    OVERRUN,
];

kinds! {
    /// All kinds of a server, in the order of a row.
    SERVER:
    /// Number of the exchange.
    SERVER_STEP = "step", Test, "1", Server, ALWAYS, "number of the exchange, from 0";
    /// Always 0.
    SERVER_SUB_TICK = "sub_tick", Test, "1", Server, ALWAYS, "always 0: one row per exchange";
    /// Phase of the exchange.
    SERVER_STATE = "state", Test, "1", Server, ALWAYS,
        "phase of the exchange: 2 before the test (wiring check, force in the start position), 3 running, 5 on the way to the \
         first target of a gateway that paces; with `between = \"predict\"` 11 towards a target, 12 along the prediction, 13 slower \
         because the target is late; \
         8 command not passed on: it tripped, or came after a trip";
    /// Test time of the command.
    SERVER_TIME = "time", Test, "s", Controller, ALWAYS, "test time of the command";
    /// Test time since the command before.
    ELAPSED = "elapsed", Test, "s", Controller, ALWAYS, "test time since the command before, or since the last commit";
    /// Number of the command.
    COMMAND_NUMBER = "command", Test, "1", Controller, ALWAYS, "the controller's number of the command; in a gateway that paces the number of the target; where `state` is 2 the server's own \
         number";
    /// Commands that were accepted. Only a server has this column.
    COMMITS = "commits", Test, "1", Server, ALWAYS, "commands accepted so far";
    /// Cause of a trip.
    TRIP = "trip", Test, "1", Server, ALWAYS,
        "cause of a trip: 0 none; a limit: 1 command_disp, 2 command_step, 3 command_vel, 4 command_accel, 5 measured_disp, \
         6 measured_force, 7 following_error, 8 force_step, 9 stuck_ticks, 10 sensor_disp, 11 sensor_force, \
         12 alternating_ticks, 13 stiffness_ratio, 14 damping_ratio, 15 added_energy, 16 lag, 17 gain_error; 100 more for a limit that the controller announced; 50 command not finite, 51 measurement not finite, 52 first command not the armed position, 53 no such pose of the loading unit, 54 trial too far, 55 too far beyond the last target, 60 interlock open, \
         61 a sensor or an actuator at the end of its range, 62 held by its own watchdog, 70 specimen lost";
    /// Arrival of the command.
    RECEIVED = "received_s", Test, "s", Clock, ALWAYS, "wall time from the start of the test to the command";
    /// Time of the exchange.
    SERVER_ROUND_TRIP = "round_trip_s", Test, "s", Clock, ALWAYS, "wall time from the command to the specimen's reply";
    /// Test time of the target that the controller asks for.
    ASKED_TIME = "asked_time", Test, "s", Controller, ALWAYS, "test time that the controller gave its target, of which a gateway that paces makes several commands";
    /// Test time since the last commit, as the controller gave it.
    ASKED_ELAPSED = "asked_elapsed", Test, "s", Controller, ALWAYS, "test time of that target since the last commit";
    /// What happened between the command before and this one.
    BETWEEN = "between", Test, "1", Server, ALWAYS,
        "what happened before this command, as a sum: 1 the specimen came to rest, 2 the controller ended its motion here, 4 the controller does not want \
         the answer any more, so that the path slows down, 8 the target before was given up, on its way or at its end, 16 the test tripped between two commands, \
         32 the target came after the specimen had moved on";
    /// Time that a command has by the limits of the specimen.
    ALLOWED = "allowed", Test, "s", Server, ALWAYS, "time that the command has for its motion by the limits of the specimen; NaN where nothing is known of it, or it was not judged";
    /// Time that a command has by the limits that the controller announced.
    ALLOWED_BY_CONTROLLER = "allowed_by_controller", Test, "s", Server, ALWAYS,
        "time that the command has for its motion by the limits that the controller announced";
    /// Displacement that the controller asks for.
    ASKED = "asked", Signal, "unit of the controller", Controller, ALWAYS, "displacement that the controller asks for, behind its `rows`, to the last bit";
    /// Velocity that the controller gives.
    ASKED_VEL = "asked_vel", Signal, "unit of the controller per s", Controller, ALWAYS, "velocity that the controller gives with it, or that the server takes from its displacements";
    /// Target that the controller asks for.
    SERVER_TARGET = "target", Axis, "m or rad", Controller, ALWAYS, "target displacement from the controller; a translation in m";
    /// Command of an axis.
    SERVER_COMMAND = "cmd", Axis, "unit of the axis", Server, ALWAYS,
        "command sent to the specimen, in the unit of the axis; none was sent where `state` is 8";
    /// Measured displacement of an axis.
    SERVER_MEASURED = "meas", Axis, "m or rad", Measured, ALWAYS, "measured displacement; a translation in m";
    /// Force of an axis.
    SERVER_FORCE = "force", Axis, "N or N m", Measured, ALWAYS, "measured force; of a translation in N";
    /// Measured displacement of an axis, as received.
    SERVER_RAW_DISP = "raw_disp", Axis, "unit of the axis", Measured, ALWAYS, "measured displacement in the unit of the axis";
    /// Measured force of an axis, as received.
    SERVER_RAW_FORCE = "raw_force", Axis, "unit of force of the axis", Measured, ALWAYS,
        "measured force in the unit of the axis";
    /// Velocity of the command.
    SERVER_VEL = "vel", Axis, "unit of the axis", Controller, ALWAYS,
        "velocity that came with the command, in units of the axis per s";
    /// Coordinate of a loading unit that the controller asks for.
    SERVER_POSE = "pose", Coordinate, "m or rad", Controller, UNIT, "target pose of the loading unit from the controller";
    /// Measured coordinate of a loading unit.
    SERVER_MEASURED_POSE = "pose_meas", Coordinate, "m or rad", Measured, UNIT, "pose from the measured strokes";
    /// Force in a coordinate of a loading unit.
    SERVER_POSE_FORCE = "pose_force", Coordinate, "N or N m", Measured, UNIT, "force that the controller received";
    /// Lag of an axis.
    SERVER_LAG = "lag", Axis, "s", Estimated, TRACKED, "estimated lag of the measured displacement behind the target, in wall time";
    /// Gain of an axis.
    SERVER_GAIN = "gain", Axis, "1", Estimated, TRACKED, "estimated gain of the measured displacement over the target";
    /// Fitted stiffness of an axis.
    SERVER_STIFFNESS = "stiffness", Axis, "N/m", Estimated, TRACKED, "stiffness fitted over the last seconds of motion";
    /// Damping that the lag of an axis adds.
    SERVER_FALSE_DAMPING = "false_c", Axis, "N s/m", Estimated, TRACKED,
        "damping that the lag adds; negative if the lag removes energy";
    /// Parameter of the compensator of an axis.
    SERVER_COMPENSATION = "comp", Parameter, "of the parameter", Controller, "with a compensator that has parameters",
        "parameter NAME of the compensator";
    /// Correction of a force that the controller received.
    CORRECTION = "correction", Signal, "N", Estimated, "with `correct` in `serve.pace`",
        "correction of the force that the controller received, k̂ times what the specimen lacked to the target";
    /// Energy of all corrections.
    CORRECTION_ENERGY = "correction_energy", Specimen, "J", Estimated, "with `correct` in `serve.pace`",
        "energy that all corrections have added";
    /// Flags of the measurement.
    RAW_STATUS = "raw_status", Specimen, "1", Measured, ALWAYS, "status flags as the specimen gave them";
    /// Status flags.
    SERVER_STATUS = "status", Specimen, "1", Server, ALWAYS,
        "status flags that the controller received; 262144 if nothing was measured because the command was not passed on";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_fits_only_its_kind() {
        for kind in TEST {
            let name = match kind.each {
                Each::Test => kind.name().to_owned(),
                Each::Component => kind.of_component("x"),
                Each::Dof => kind.of_dof(12),
                Each::Member | Each::Specimen => kind.of_specimen(3),
                Each::Axis | Each::Coordinate | Each::Signal => kind.of_axis(2, 10),
                Each::Parameter => kind.of_parameter("gain_a", 1, 4),
            };
            let found = find(&name).unwrap();
            assert_eq!((found.stem, found.each), (kind.stem, kind.each), "{name}");
            let (dof, of) = (found.dof_in(&name), found.specimen_in(&name));
            let read = (dof, of, found.axis_in(&name));
            let expected = match kind.each {
                Each::Test | Each::Component => (None, None, None),
                Each::Dof => (Some(12), None, None),
                Each::Member => (None, None, None),
                Each::Specimen => (None, Some(3), None),
                Each::Axis | Each::Coordinate | Each::Signal => (None, Some(2), Some((2, 10))),
                Each::Parameter => (None, Some(1), Some((1, 4))),
            };
            assert_eq!(read, expected, "{name}");
        }
        for name in [
            "",
            "x",
            "x0",
            "x1_1",
            "target_1",
            "target_1_",
            "pose_1_1_1",
            "comp_1_1",
            "steps",
        ] {
            assert_eq!(find(name), None, "{name}");
        }
    }

    #[test]
    fn head_and_timing_are_at_the_table_ends() {
        assert_eq!(TEST[..HEAD.len()], HEAD);
        assert_eq!(TEST[TEST.len() - TIMING.len()..], TIMING);
        assert!(TIMING.iter().all(Kind::is_timing));
        let of_test = TEST.iter().filter(|kind| kind.each == Each::Test);
        let timing = of_test.filter(|kind| kind.is_timing()).count();
        assert_eq!(timing, TIMING.len());
    }

    #[test]
    fn every_row_state_is_in_the_column_text() {
        use crate::catalog::phase::{Phase, STATES};
        let told = STATE.told("");
        let numbers: Vec<&str> = told.split(|c: char| !c.is_ascii_digit()).collect();
        for state in &STATES {
            let never = [Phase::Connected, Phase::Safe]
                .map(Phase::state)
                .contains(&state);
            let is_told = numbers.contains(&state.code.to_string().as_str());
            assert_eq!(is_told, !never, "{}", state.word);
        }
    }

    #[test]
    fn every_axis_limit_has_a_trip_code() {
        use crate::catalog::limit::Limit;
        let codes: Vec<&str> = TRIP.meaning.split([',', ';', ':']).map(str::trim).collect();
        for limit in Limit::OF_AXIS {
            let code = format!("{} {}", limit as u32 + 1, limit.row().name);
            assert!(codes.contains(&code.as_str()), "{code}");
        }
    }

    #[test]
    fn rotation_has_its_own_unit() {
        assert_eq!((VEL.unit_of(false), VEL.unit_of(true)), ("m/s", "rad/s"));
        assert_eq!((TIME.unit_of(false), TIME.unit_of(true)), ("s", "s"));
    }
}
