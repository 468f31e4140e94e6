//! The limits of a test: one row per limit, with its key, unit, kind and words.
//!
//! A limit belongs to one axis of a specimen or to the test as a whole. All other modules read this table: the test file
//! and its schema, the checks, the judgement in the loop, events, the summary, the report, the live page and the guide.
//! A new limit is one variant of [`Limit`], one row of [`TABLE`], and the code that computes its value. `CONTRIBUTING.md` lists
//! the places.
//! The table is in the order of the test file. The variants are in the order in which limits are listed and reported.
//! The table holds no levels: those are of the test.

/// A limit of one axis or of the test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Limit {
    /// Displacement of the next command, m.
    CommandDisp,
    /// Change of the command in one tick, m.
    CommandStep,
    /// Change of the command over the wall time of the tick, m/s.
    CommandVel,
    /// Second difference of the command over the wall time squared, m/s².
    CommandAccel,
    /// Measured displacement, m.
    MeasuredDisp,
    /// Measured force, N.
    MeasuredForce,
    /// |measured − commanded| displacement beyond the share of motion, m.
    FollowingError,
    /// Change of the measured force from one measurement to the next, N.
    ForceStep,
    /// Measurements in a row in which both sensors were unchanged to the last bit under a moving command.
    StuckSensor,
    /// Reading of the displacement sensor, m. At the end of its range it is not reliable.
    SensorDisp,
    /// Reading of the load cell, N.
    SensorForce,
    /// Steps in a row in which the second difference of the command changed its sign and grew.
    Alternation,
    /// Estimated tangent stiffness over its declared upper bound.
    StiffnessRatio,
    /// Estimated tangent damping over its declared upper bound.
    DampingRatio,
    /// Energy that the transfer system has added to the structure, J.
    AddedEnergy,
    /// |lag| of the measured displacement behind the target, s.
    Lag,
    /// |gain − 1| of the measured displacement over the target.
    GainError,
    /// Share of the stability margin that tangents beyond their declared bounds use up.
    StabilityUsed,
    /// Largest share of its critical delay that the lag of a specimen uses up.
    DelayUsed,
    /// Energy error of the steps, relative to the energy that was turned over.
    StepAudit,
    /// Energy that the transfer systems have added, relative to the energy that the test has taken in.
    AddedEnergyShare,
    /// Unbalance of the degrees of freedom without mass, relative to their forces: the least of the last six steps.
    StaticUnbalance,
    /// Deadline misses in a row.
    MissesInARow,
    /// Deadline misses in a stretch of time.
    MissesInWindow,
    /// Deadline misses in all.
    Misses,
}

/// Scope of a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// One axis of a specimen.
    Axis,
    /// The test as a whole.
    Test,
}

/// Allowed numbers for a level of a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A smallest and a largest value.
    Range,
    /// A largest absolute value.
    Size,
    /// A largest whole number.
    Count,
}

/// Value that a limit checks. The limits of an axis are checked in this order, then in the order of [`Limit`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Judges {
    /// A command, before it leaves.
    Command,
    /// The reading of a sensor. It comes before the measurement: at the end of its range a sensor is not reliable.
    Sensor,
    /// A fresh measurement.
    Measurement,
    /// An estimate from measurements. A value that is not finite is unknown and is not checked.
    Estimate,
    /// Tracking of the target by the measured displacement. A value that is not finite is unknown and is not checked.
    Tracking,
    /// A step of the whole test.
    Step,
    /// Deadline misses.
    Misses,
}

/// Program that checks a limit of an axis; each one beside those before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum CheckedBy {
    /// The controller. A server checks it as well if its file gives a level.
    Controller,
    /// Every server whose file gives a level.
    Gateway,
    /// Every server of the Gusset protocol too: the controller announces the limit.
    Server,
}

/// A number of the test file that sets how a limit is checked.
#[derive(Debug, PartialEq)]
pub struct Setting {
    /// Key of the test file.
    pub key: &'static str,
    /// Sentence of the schema.
    pub sentence: &'static str,
    /// Example of the schema.
    pub example: Option<f64>,
}

/// One limit.
#[derive(Debug, PartialEq)]
pub struct Row {
    /// The limit.
    pub limit: Limit,
    /// Key of the test file, and name in events. The limits of missed deadlines keep the names of an earlier version here: their
    /// keys in the test file are those of `timing.misses`.
    pub key: &'static str,
    /// The key without its unit: part of the names of columns.
    pub name: &'static str,
    /// In words.
    pub words: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Allowed numbers for its levels.
    pub kind: Kind,
    /// The value that it checks.
    pub judges: Judges,
    /// Number of earlier values that its value is a difference from.
    pub differs_from: u8,
    /// Whether a column holds the checked value whatever the limits are.
    pub has_column: bool,
    /// Whether the value needs a measured displacement.
    pub needs_measured_disp: bool,
    /// Program that checks it.
    pub checked_by: CheckedBy,
    /// The checked value, for the guide.
    pub judged: &'static str,
    /// The default, in words.
    pub default: &'static str,
    /// Sentence of the schema; empty where another table of the file holds the key.
    pub sentence: &'static str,
    /// Example of the schema, as JSON.
    pub example: Option<&'static str>,
    /// A number of the test file that belongs to it.
    pub setting: Option<Setting>,
}

/// Number of limits of an axis.
pub const AXIS_LIMITS: usize = 17;
/// Number of all limits.
pub const LIMITS: usize = 25;
/// Page of the guide that explains the limits.
pub const PAGE: &str = "limit-table";

/// A row that the others change.
const AXIS: Row = Row {
    limit: Limit::CommandDisp,
    key: "",
    name: "",
    words: "",
    unit: "m",
    kind: Kind::Size,
    judges: Judges::Command,
    differs_from: 0,
    has_column: false,
    needs_measured_disp: false,
    checked_by: CheckedBy::Gateway,
    judged: "",
    default: "none",
    sentence: "",
    example: None,
    setting: None,
};
const TEST: Row = Row {
    judges: Judges::Step,
    has_column: true,
    checked_by: CheckedBy::Controller,
    unit: "1",
    ..AXIS
};
const MISSES: Row = Row {
    judges: Judges::Misses,
    kind: Kind::Count,
    has_column: false,
    unit: "ticks",
    ..TEST
};

/// All limits, in the order of the test file.
pub static TABLE: [Row; LIMITS] = ROWS;

const ROWS: [Row; LIMITS] = [
    Row {
        limit: Limit::CommandDisp,
        key: "command_disp_m",
        name: "command_disp",
        words: "commanded displacement",
        kind: Kind::Range,
        has_column: true,
        checked_by: CheckedBy::Server,
        judged: "commanded displacement",
        sentence: "Range of the commanded displacement.",
        ..AXIS
    },
    Row {
        limit: Limit::CommandStep,
        key: "command_step_m",
        name: "command_step",
        words: "change of the command in one tick",
        differs_from: 1,
        checked_by: CheckedBy::Server,
        judged: "change of the command from one tick to the next",
        sentence: "Largest change of the command between two commands.",
        ..AXIS
    },
    Row {
        limit: Limit::CommandVel,
        key: "command_vel_m_per_s",
        name: "command_vel",
        words: "commanded velocity",
        unit: "m/s",
        differs_from: 1,
        checked_by: CheckedBy::Server,
        judged: "commanded velocity",
        sentence: "Largest velocity of the command, in wall time. With a trip level v, clients of `gusset serve` move a \
                   physical specimen by at most v·(T + burst) in T seconds. The burst is 0.02 s or two announced periods, \
                   at most 0.1 s. More: guide, limits.",
        ..AXIS
    },
    Row {
        limit: Limit::CommandAccel,
        key: "command_accel_m_per_s2",
        name: "command_accel",
        words: "commanded acceleration",
        unit: "m/s2",
        differs_from: 2,
        judged: "commanded acceleration",
        sentence: "Largest acceleration of the command, from its second difference in wall time.",
        example: Some(r#"{"warn": 20.0, "trip": 30.0}"#),
        ..AXIS
    },
    Row {
        limit: Limit::MeasuredDisp,
        key: "measured_disp_m",
        name: "measured_disp",
        words: "measured displacement",
        kind: Kind::Range,
        judges: Judges::Measurement,
        has_column: true,
        needs_measured_disp: true,
        judged: "measured displacement",
        default: "trips beyond ±1000 m",
        sentence: "Range of the measured displacement. Default: a measured displacement beyond ±1000 m trips.",
        ..AXIS
    },
    Row {
        limit: Limit::MeasuredForce,
        key: "measured_force_n",
        name: "measured_force",
        words: "measured force",
        unit: "N",
        kind: Kind::Range,
        judges: Judges::Measurement,
        has_column: true,
        checked_by: CheckedBy::Server,
        judged: "measured force; a Gusset server checks 1.25 times the level",
        sentence: "Range of the measured force.",
        ..AXIS
    },
    Row {
        limit: Limit::SensorDisp,
        key: "sensor_disp_m",
        name: "sensor_disp",
        words: "reading of the displacement sensor",
        kind: Kind::Range,
        judges: Judges::Sensor,
        has_column: true,
        needs_measured_disp: true,
        judged: "reading of the displacement sensor, at the end of its range",
        sentence: "Measuring range of the displacement sensor. A reading outside this range is not reliable.",
        example: Some(r#"{"trip": [-0.12, 0.12]}"#),
        ..AXIS
    },
    Row {
        limit: Limit::SensorForce,
        key: "sensor_force_n",
        name: "sensor_force",
        words: "reading of the load cell",
        unit: "N",
        kind: Kind::Range,
        judges: Judges::Sensor,
        has_column: true,
        judged: "reading of the load cell, at the end of its range",
        sentence: "Measuring range of the load cell. A reading outside this range is not reliable, and no specimen moves to \
                   zero force by it.",
        ..AXIS
    },
    Row {
        limit: Limit::FollowingError,
        key: "following_error_m",
        name: "following_error",
        words: "following error",
        judges: Judges::Measurement,
        needs_measured_disp: true,
        judged: "measured minus commanded displacement",
        sentence: "Largest following error, |measured − commanded| displacement, at rest. `following_time_s` allows for more \
                   in motion.",
        setting: Some(Setting {
            key: "following_time_s",
            sentence: "Delay of the actuator that the following error allows for. The limit grows by this time multiplied by \
                       the largest recent speed of the command.",
            example: None,
        }),
        ..AXIS
    },
    Row {
        limit: Limit::ForceStep,
        key: "force_step_n",
        name: "force_step",
        words: "change of the measured force from one measurement to the next",
        unit: "N",
        judges: Judges::Measurement,
        differs_from: 1,
        judged: "change of the measured force from one measurement to the next",
        sentence: "Largest change of the measured force between two measurements.",
        example: Some(r#"{"trip": 5000.0}"#),
        ..AXIS
    },
    Row {
        limit: Limit::StuckSensor,
        key: "stuck_ticks",
        name: "stuck_ticks",
        words: "ticks with unchanged sensors under a moving command",
        unit: "ticks",
        kind: Kind::Count,
        judges: Judges::Measurement,
        differs_from: 1,
        needs_measured_disp: true,
        judged: "ticks in a row in which the command moves and neither sensor changes",
        sentence: "Number of successive measurements in which both sensors are unchanged to the last bit although the command \
                   moves.",
        example: Some(r#"{"warn": 20.0, "trip": 50.0}"#),
        setting: Some(Setting {
            key: "stuck_travel_m",
            sentence: "Motion of the command that is too small to change the sensors. `stuck_ticks` ignores it.",
            example: Some(1e-5),
        }),
        ..AXIS
    },
    Row {
        limit: Limit::Alternation,
        key: "alternating_ticks",
        name: "alternating_ticks",
        words: "ticks of a growing sawtooth in the command",
        unit: "ticks",
        kind: Kind::Count,
        checked_by: CheckedBy::Controller,
        judged: "ticks in a row in which the command grows as a sawtooth: the sign of an unstable integration",
        sentence: "Number of successive commands in which the second difference changes its sign and grows. Such a sawtooth \
                   is an early sign of an unstable integration.",
        example: Some(r#"{"warn": 6.0, "trip": 12.0}"#),
        ..AXIS
    },
    Row {
        limit: Limit::StiffnessRatio,
        key: "stiffness_ratio",
        name: "stiffness_ratio",
        words: "tangent stiffness over its declared bound",
        unit: "×",
        judges: Judges::Estimate,
        has_column: true,
        checked_by: CheckedBy::Controller,
        judged: "estimated tangent stiffness over its declared upper bound",
        sentence: "Estimated tangent stiffness divided by its declared upper bound. The bound is `hardening_bound` · \
                   `stiffness_n_per_m`, or that of the law. The proof of stability holds up to 1.",
        example: Some(r#"{"warn": 1.0, "trip": 1.2}"#),
        ..AXIS
    },
    Row {
        limit: Limit::DampingRatio,
        key: "damping_ratio",
        name: "damping_ratio",
        words: "tangent damping over its declared bound",
        unit: "×",
        judges: Judges::Estimate,
        has_column: true,
        checked_by: CheckedBy::Controller,
        judged: "estimated tangent damping over its declared upper bound",
        sentence: "Estimated tangent damping divided by its declared upper bound. It is only estimated if damping is declared.",
        example: Some(r#"{"warn": 1.0, "trip": 1.2}"#),
        ..AXIS
    },
    Row {
        limit: Limit::AddedEnergy,
        key: "added_energy_j",
        name: "added_energy",
        words: "energy added by the tracking error",
        unit: "J",
        judges: Judges::Estimate,
        has_column: true,
        needs_measured_disp: true,
        checked_by: CheckedBy::Controller,
        judged: "energy that the axis adds to the structure through its tracking error",
        sentence: "Energy that the tracking error of this axis adds to the structure. A delay adds energy, a lead removes it.",
        example: Some(r#"{"warn": 5.0, "trip": 10.0}"#),
        ..AXIS
    },
    Row {
        limit: Limit::Lag,
        key: "lag_s",
        name: "lag",
        words: "lag behind the target",
        unit: "s",
        judges: Judges::Tracking,
        has_column: true,
        needs_measured_disp: true,
        checked_by: CheckedBy::Controller,
        judged: "estimated lag of the measured displacement behind the target",
        sentence: "Lag of the measured displacement behind the target, or lead if it is early. It is estimated over the last \
                   seconds of motion, after two periods.",
        example: Some(r#"{"warn": 0.002, "trip": 0.004}"#),
        ..AXIS
    },
    Row {
        limit: Limit::GainError,
        key: "gain_error",
        name: "gain_error",
        words: "error of the gain of the measured displacement over the target",
        unit: "1",
        judges: Judges::Tracking,
        has_column: true,
        needs_measured_disp: true,
        checked_by: CheckedBy::Controller,
        judged: "amplitude error: difference between 1 and the gain of the measured displacement over the target",
        sentence: "Amplitude error |gain − 1| of the measured displacement relative to the target. It is estimated over the \
                   last seconds of motion, after two periods.",
        example: Some(r#"{"warn": 0.05, "trip": 0.1}"#),
        ..AXIS
    },
    Row {
        limit: Limit::StabilityUsed,
        key: "stability_used",
        name: "stability_used",
        words: "stability margin used",
        judged: "stability margin used, from the estimated stiffness and damping",
        default: "warns above 1",
        ..TEST
    },
    Row {
        limit: Limit::DelayUsed,
        key: "delay_used",
        name: "delay_used",
        words: "largest lag over the critical delay",
        judged: "lag of a specimen over its critical delay",
        default: "warns above 1",
        needs_measured_disp: true,
        ..TEST
    },
    Row {
        limit: Limit::StepAudit,
        key: "step_audit",
        name: "step_audit",
        words: "relative energy error of the integration",
        judged: "energy error of the integration over the energy turned over",
        default: "warns above 1e-9, trips above 1e-6, up to 64 DOFs",
        ..TEST
    },
    Row {
        limit: Limit::AddedEnergyShare,
        key: "added_energy_share",
        name: "added_energy_share",
        words: "energy added by tracking errors over the energy that the test has taken in",
        judged: "energy added by all tracking errors over the energy that the test has taken in",
        needs_measured_disp: true,
        ..TEST
    },
    Row {
        limit: Limit::StaticUnbalance,
        key: "static_unbalance",
        name: "static_unbalance",
        words: "unbalance of degrees of freedom without mass or along members, over their forces",
        judged: "unbalance of the DOFs without mass, and along force-based members, over their forces: the least of six steps",
        default: "warns above 1e-3, trips above 1e-2",
        ..TEST
    },
    Row {
        limit: Limit::MissesInARow,
        key: "max_consecutive_misses",
        name: "max_consecutive_misses",
        words: "deadlines missed in a row",
        judged: "deadline misses in a row",
        default: "warns above 25, trips above 50",
        ..MISSES
    },
    Row {
        limit: Limit::MissesInWindow,
        key: "max_misses_in_window",
        name: "max_misses_in_window",
        words: "deadlines missed in the window",
        judged: "deadline misses within `timing.misses.window_s`",
        default: "one tick in ten, at least 100",
        ..MISSES
    },
    Row {
        limit: Limit::Misses,
        key: "max_total_misses",
        name: "max_total_misses",
        words: "deadlines missed in total",
        judged: "deadline misses in the whole test",
        default: "one tick in a hundred, at least 100",
        ..MISSES
    },
];

/// Place in [`TABLE`] of each limit.
const PLACES: [usize; LIMITS] = {
    // A limit without a row, or with two, does not compile.
    let mut places = [LIMITS; LIMITS];
    let mut place = 0;
    while place < LIMITS {
        let limit = ROWS[place].limit as usize;
        assert!(places[limit] == LIMITS, "two rows of one limit");
        places[limit] = place;
        place += 1;
    }
    places
};

impl Limit {
    /// Limits of an axis.
    pub const OF_AXIS: [Limit; AXIS_LIMITS] = of_scope(Scope::Axis);
    /// Limits of the test as a whole.
    pub const OF_TEST: [Limit; LIMITS - AXIS_LIMITS] = of_scope(Scope::Test);

    /// Its row of the table.
    #[must_use]
    #[expect(
        clippy::indexing_slicing,
        reason = "one place per variant, checked when the table is built"
    )]
    pub const fn row(self) -> &'static Row {
        &TABLE[PLACES[self as usize]]
    }

    /// The limit of a key.
    #[must_use]
    pub fn of_key(key: &str) -> Option<Self> {
        TABLE.iter().find(|row| row.key == key).map(|row| row.limit)
    }

    /// Its key; see [`Row::key`].
    #[must_use]
    pub const fn key(self) -> &'static str {
        self.row().key
    }

    /// The column with the value of a limit of the test as a whole.
    #[must_use]
    pub const fn column(self) -> &'static str {
        match self {
            Self::MissesInARow => "misses_in_a_row",
            Self::MissesInWindow => "misses_in_window",
            Self::Misses => "misses_in_total",
            _ => self.key(),
        }
    }

    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        self.row().words
    }

    /// SI unit.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        self.row().unit
    }

    /// SI unit, as people write it.
    #[must_use]
    pub fn shown_unit(self) -> &'static str {
        match self.unit() {
            "m/s2" => "m/s²",
            unit => unit,
        }
    }

    /// Scope: an axis or the test.
    #[must_use]
    pub const fn scope(self) -> Scope {
        self.row().scope()
    }

    /// Whether its levels are a smallest and a largest value.
    #[must_use]
    pub const fn is_range(self) -> bool {
        matches!(self.row().kind, Kind::Range)
    }

    /// Whether it checks a force or its change.
    #[must_use]
    pub fn is_of_force(self) -> bool {
        self.unit() == "N"
    }

    /// Whether it checks a difference of commands.
    #[must_use]
    pub const fn is_of_motion(self) -> bool {
        self.is_of_command() && self.row().differs_from > 0
    }

    /// Whether it checks commands, and not measurements.
    #[must_use]
    pub const fn is_of_command(self) -> bool {
        matches!(self.row().judges, Judges::Command)
    }

    /// Whether it counts missed deadlines.
    #[must_use]
    pub const fn is_of_misses(self) -> bool {
        matches!(self.row().judges, Judges::Misses)
    }

    /// Whether its value needs the history of a test: no single command and no single measurement shows it.
    #[must_use]
    pub const fn is_of_loop(self) -> bool {
        matches!(self, Self::FollowingError | Self::StuckSensor)
            || matches!(self.row().checked_by, CheckedBy::Controller)
    }

    /// Whether the controller announces it to a server of the Gusset protocol.
    #[must_use]
    pub const fn is_announced(self) -> bool {
        matches!(self.row().checked_by, CheckedBy::Server)
    }

    /// Its place in [`Limit::OF_TEST`]; none of a limit of an axis.
    #[must_use]
    pub const fn place_in_test(self) -> Option<usize> {
        (self as usize).checked_sub(AXIS_LIMITS)
    }

    /// Its place in a set of limits.
    #[must_use]
    pub const fn bit(self) -> u32 {
        1 << self as u32
    }

    /// The limits of an axis whose checked value has no column in every test.
    #[must_use]
    #[expect(clippy::indexing_slicing, reason = "runs when the program is compiled")]
    pub const fn without_column<const N: usize>() -> [Limit; N] {
        let mut limits = [Limit::CommandDisp; N];
        let (mut found, mut limit) = (0, 0);
        while limit < AXIS_LIMITS {
            let row = &ROWS[PLACES[limit]];
            if !row.has_column {
                limits[found] = row.limit;
                found += 1;
            }
            limit += 1;
        }
        assert!(found == N, "not as many limits are without a column");
        limits
    }

    /// The limits that check one of these, in the order of the checks.
    #[must_use]
    #[expect(clippy::indexing_slicing, reason = "runs when the program is compiled")]
    pub const fn judging<const N: usize>(what: &[Judges]) -> [Limit; N] {
        let mut limits = [Limit::CommandDisp; N];
        let (mut found, mut kind) = (0, 0);
        while kind < what.len() {
            let mut limit = 0;
            while limit < LIMITS {
                let row = &ROWS[PLACES[limit]];
                if row.judges as u8 == what[kind] as u8 {
                    limits[found] = row.limit;
                    found += 1;
                }
                limit += 1;
            }
            kind += 1;
        }
        assert!(found == N, "not as many limits judge this");
        limits
    }
}

impl Row {
    /// Scope: an axis or the test.
    #[must_use]
    pub const fn scope(&self) -> Scope {
        match self.judges {
            Judges::Step | Judges::Misses => Scope::Test,
            _ => Scope::Axis,
        }
    }
}

#[expect(clippy::indexing_slicing, reason = "runs when the program is compiled")]
const fn of_scope<const N: usize>(scope: Scope) -> [Limit; N] {
    let mut limits = [Limit::CommandDisp; N];
    let (mut found, mut limit) = (0, 0);
    while limit < LIMITS {
        let row = &ROWS[PLACES[limit]];
        if row.scope() as u8 == scope as u8 {
            limits[found] = row.limit;
            found += 1;
        }
        limit += 1;
    }
    limits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_limit_has_its_row_and_names() {
        for (place, limit) in Limit::OF_AXIS.into_iter().chain(Limit::OF_TEST).enumerate() {
            assert_eq!(limit as usize, place);
            let in_test = limit.place_in_test().map(|place| Limit::OF_TEST[place]);
            assert_eq!(in_test, (limit.scope() == Scope::Test).then_some(limit));
            let row = limit.row();
            assert_eq!(row.limit, limit);
            assert_eq!(Limit::of_key(row.key), Some(limit));
            assert!(row.key.starts_with(row.name), "{}", row.key);
            assert_eq!(row.sentence.is_empty(), row.scope() == Scope::Test);
            for text in [row.words, row.unit, row.judged, row.default] {
                assert!(!text.is_empty(), "{}", row.key);
            }
        }
        let names = |of: fn(&Row) -> &str| {
            let mut names: Vec<&str> = TABLE.iter().map(of).collect();
            names.sort_unstable();
            names.dedup();
            names.len()
        };
        assert_eq!(names(|row| row.key), LIMITS);
        assert_eq!(names(|row| row.name), LIMITS);
        assert_eq!(names(|row| row.words), LIMITS);
    }

    #[test]
    fn saturated_sensor_is_judged_first() {
        let order: [Limit; 7] = Limit::judging(&[Judges::Sensor, Judges::Measurement]);
        assert_eq!(
            order,
            [
                Limit::SensorDisp,
                Limit::SensorForce,
                Limit::MeasuredDisp,
                Limit::MeasuredForce,
                Limit::FollowingError,
                Limit::ForceStep,
                Limit::StuckSensor,
            ]
        );
    }
}
