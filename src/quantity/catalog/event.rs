//! What happens in a test: one row per kind of line in `events.jsonl`.
//!
//! A row has the name of the event, how grave it is, the group in which it is listed, whether it ends a test out of order, a
//! sentence for people, and the text of the guide. Names are firm: programs read them.
//!
//! The sentence is a template. `{key}` shows a field of the line, rounded and with its unit. `{specimen}` is the specimen by
//! name, `{place}` the specimen with its axis. A part in brackets is left out where a field of it is missing.
//! `{flag?yes|no}` chooses by a field that is true or false. An empty template means that no sentence is shown.

use serde::{Deserialize, Serialize};

/// How grave an event is. It decides the level of the line in the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// For programs, or of no interest in a normal test.
    Debug,
    /// Worth knowing.
    Info,
    /// Worth a look.
    Warning,
    /// Something is lost, broken or stopped.
    Error,
}

/// The group in which a report lists an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// Deadline misses.
    Misses,
    /// Stale, late or lost measurements, and what a specimen reports of itself.
    Answers,
    /// Limits and warnings.
    Limits,
    /// Commands of the operator.
    Operator,
    /// Everything else.
    Other,
    /// For programs only: a report does not list it.
    Silent,
}

impl Group {
    /// The groups that a report lists, in its order.
    pub const LISTED: [Self; 5] = [
        Self::Misses,
        Self::Answers,
        Self::Limits,
        Self::Operator,
        Self::Other,
    ];

    /// Its title.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Misses => "deadline misses",
            Self::Answers => "stale, late or lost answers",
            Self::Limits => "limits and warnings",
            Self::Operator => "operator",
            Self::Other | Self::Silent => "other",
        }
    }
}

/// Programs that write an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writer {
    /// The controller of a test. A server may write it, too, with a text.
    Test,
    /// The server of a specimen.
    Server,
}

/// A row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EventRow {
    /// Name in `events.jsonl`.
    pub name: &'static str,
    /// How grave it is.
    pub severity: Severity,
    /// Where a report lists it.
    pub group: Group,
    /// It ends a test out of order.
    pub is_trip: bool,
    /// It may come on every tick: the log shows the first few only.
    pub is_frequent: bool,
    /// The sentence for people, as a template.
    pub sentence: &'static str,
    /// Meaning, for the guide.
    pub meaning: &'static str,
    /// Its own fields, for the guide.
    pub fields: &'static str,
    /// Programs that write it.
    pub writer: Writer,
}

impl EventRow {
    const fn trip(mut self) -> Self {
        self.is_trip = true;
        self
    }

    const fn frequent(mut self) -> Self {
        self.is_frequent = true;
        self
    }

    const fn of(mut self, writer: Writer) -> Self {
        self.writer = writer;
        self
    }
}

/// Makes the table: name, severity, group, sentence, meaning and fields of each event, and what else is true of it.
macro_rules! events {
    ($($name:literal, $severity:ident, $group:ident, $sentence:literal, $meaning:literal, $fields:expr
        $(, $also:ident$(($writer:ident))?)*;)*) => {
        &[$(EventRow {
            name: $name,
            severity: Severity::$severity,
            group: Group::$group,
            is_trip: false,
            is_frequent: false,
            sentence: $sentence,
            meaning: $meaning,
            fields: $fields,
            writer: Writer::Test,
        }$(.$also($(Writer::$writer)?))*),*]
    };
}

const OF_AXIS: &str = "`specimen`, `name`, `axis`";
const OF_SPECIMEN: &str = "`specimen`, `name`";
const TEXT: &str = "`text`";

/// Page of the guide with this table.
pub const PAGE: &str = "events";

/// All events, in the order of the guide.
pub const EVENTS: &[EventRow] = events! {
    "files", Debug, Silent, "", "The input files, and where the run comes from.", "`sha256`: hash by file name; `version`; `origin`: time, machine, folder and program";
    "warning", Warning, Limits, "{text}", "A warning before the test.", TEXT;
    "not_granted", Warning, Limits, "not granted: {text}", "The operating system refused a real-time setting.", TEXT;
    "live_page", Info, Other, "the live page is served at {address}", "The live page is served.", "`address`";
    "connected", Info, Other, "{specimen}: connected to {peer}[, its position is {standing}]",
        "A specimen behind a link is connected.", "`specimen`, `name`, `peer`; `measures_disp` false: it repeats the command instead of measuring; `standing`: the position that it reports";
    "grid", Debug, Silent, "",
        "A grid of ticks begins. Wall times of the rows count from its first edge.", "`of`: `opening`, `directions` or `test`; `first_edge_ns`: ns of the loop's clock";
    "phase", Info, Other, "{from} → {to} ({cause})",
        "The test enters another phase.", "`from`, `to`; `cause`: `done`, `operator`, or what stopped it; `specimen`, `name` if one specimen is the cause";
    "zeroed", Info, Other, "{place}: zero readings: displacement {disp}, force {force} (units of the axis)",
        "A sensor's zero was read.", "`specimen`, `name`, `axis`; `disp`, `force`: means; `disp_noise_rms`, `force_noise_rms`; all in the axis' own units";
    "initial_force", Warning, Limits, "{place}: it carries a force at the start that its displacement does not explain: {force}, allowed {most} ({of})",
        "An axis carries a force at the start that its displacement does not explain.", "`specimen`, `name`, `axis`; `force` in N; `most`: allowed, in N; `of`: the reference for the allowed force";
    "confirmed", Info, Operator, "confirmed", "The operator confirmed the sensor readings.", "";
    "probing", Warning, Other, "{specimen}: wiring check: each axis moves a little and back",
        "The wiring check moves the specimen by a small motion.", OF_SPECIMEN;
    "direction", Info, Other, "{place}: wiring check: displacement {disp}, force {force} (units of the axis)",
        "Result of the wiring check for one axis.", "`specimen`, `name`, `axis`; `disp` in m, `force` in N: changes of the measured values";
    "wiring_accepted", Warning, Limits, "{place}: the wiring check found {what}, which `safety.accept_wiring` accepts",
        "A difference between the measured stiffness and the estimate that the user accepts.", "`specimen`, `name`, `axis`; `what`: the fault in one word";
    "retraced", Warning, Other, "{specimen}: it went back along its own motion: {what}",
        "The wiring check, or the motion of `identify`, was ended and went back to where it began.", "`specimen`, `name`; `what`: `complete`, `beyond_passed_force` or `incomplete`; a server: `text`";
    "direction_unknown", Warning, Other, "{place}: the static load does not show the direction of its wiring",
        "The wiring check found no direction.", OF_AXIS;
    "misfit", Error, Limits, "{place}: not armed: the wiring check found {what}",
        "A wiring fault: the specimen is not armed.", "`specimen`, `name`, `axis`; `what`: the fault in one word", trip;
    "stands", Info, Other, "{place}: position {found}; the interrupted test left it at {left} ± {within} (unit of the axis)",
        "Resume: an axis is at the position in which the interrupted test left it.", "`specimen`, `name`, `axis`; `found`, `left`, `within`: position, earlier position, allowed difference, in the axis' unit; `differs` true: by more than the noise";
    "moved", Error, Limits, "{place}: position {found}; the interrupted test left it at {left} ± {within} (unit of the axis): it has moved since",
        "Resume: an axis is not at the position in which the interrupted test left it.", "as `stands`", trip;
    "force_changed", Warning, Other, "{place}: the load cell reads {found}, expected {left} ± {within} after the interruption (unit of the axis); {taken_for_drift?the difference is taken for drift of its zero|its zero stays unchanged}",
        "Resume: a load cell reads another force than at the interruption.", "`specimen`, `name`, `axis`; `left`: expected, `found`, `within`: allowed difference, in the axis' unit; `taken_for_drift`: true if the zero was corrected";
    "go", Info, Other, "warm-up of {ticks} ticks: {missed} deadlines missed, at most {in_a_row} in a row; a tick took {mean_ns} on average and {longest_ns} at most: the test starts",
        "The warm-up kept the limits of `[timing.misses]`: the test begins.", "`ticks`: judged; `missed`, `in_a_row`: misses; `mean_ns`, `longest_ns`: duration of a tick";
    "no_go", Error, Misses, "warm-up of {ticks} ticks: {missed} deadlines missed, at most {in_a_row} in a row; a tick took {mean_ns} on average and {longest_ns} at most: the test does not start",
        "The warm-up did not keep the limits of `[timing.misses]`: the test does not begin.", "as `go`", trip;
    "started", Info, Other, "started", "The first command of the test is sent.", "";
    "checkpoint", Debug, Silent, "",
        "A digest of the test's state after a step, for `gusset run --resume`.", "`digest`: 16 hexadecimal digits; `sha256`: of the state file, where there is one";
    "hold_requested", Info, Operator, "hold requested", "The operator asked for a hold.", "";
    "continue_requested", Info, Operator, "continue requested", "The operator let a held test go on.", "";
    "continue_dropped", Warning, Operator, "`continue` is ignored: it was for hold {hold}, and the latest hold is {latest}",
        "A continue command named an earlier hold and had no effect.", "`hold`: the number it named; `latest`: the number of the latest hold";
    "stop_requested", Info, Operator, "stop requested", "The operator asked for the end of the test.", "";
    "control_request", Info, Other, "the live page received the request {request} from {from}: {accepted?accepted|refused}[: {why}]",
        "The live page received a request.", "`request`, `from`: address, `accepted`; `why` if it was refused";
    "control_refused", Warning, Other, "the live page refused the request {request} from {from}: {why} (times: {times})",
        "The live page refused a request without the control token.", "`request`, `from`, `why`; `times`: how often";
    "pace", Info, Other, "{from} → {to}",
        "The pace of the commands between two targets changed.", "`from`, `to`; `share`: part of the step that was made", frequent;
    "limit_warning", Warning, Limits, "[{place}: ]{limit} is {value}, beyond its warning level of {bound}",
        "A value is beyond the `warn` level of a limit.", "`limit`: its key; `value`, `bound` in SI units; `specimen`, `name`, `axis` for a limit of an axis", frequent;
    "limit_trip", Error, Limits, "[{place}: ]TRIP: {limit} is {value}, allowed {bound}",
        "A value is beyond the `trip` level of a limit: the test ends.", "as `limit_warning`", trip;
    "interlock", Error, Answers, "{specimen}: the interlock is open", "The interlock of a specimen is open.", OF_SPECIMEN, trip;
    "saturated", Error, Answers, "{specimen}: a sensor or actuator is at the end of its range",
        "A sensor or an actuator is at the end of its range.", OF_SPECIMEN, trip;
    "geometry", Error, Other, "{place}: geometry: {what}",
        "The actuators of a loading unit cannot take a pose, or their strokes have no pose.", "`specimen`, `name`; `axis` if one actuator is the cause; `what`: the fault in one word", trip;
    "diverged", Error, Limits, "the response of DOF {dof} diverged",
        "A displacement is beyond `safety.divergence_m` or not finite.", "`dof`: from 1", trip;
    "specimen_holds", Warning, Answers, "{specimen}: its own watchdog holds it, so commands do not move it",
        "The specimen reports that its own watchdog holds it.", OF_SPECIMEN;
    "specimen_holds_on", Error, Answers, "{specimen}: its own watchdog still holds it",
        "The specimen still reports that its own watchdog holds it.", OF_SPECIMEN, trip;
    "unsettled", Warning, Limits, "{specimen}: the actuator–specimen iteration did not converge in {ticks} ticks",
        "The actuator–specimen iteration of a simulated actuator did not converge.", "`specimen`, `name`; `ticks`: how many so far";
    "miss", Warning, Misses, "deadline missed by {late_ns}; cause: {class}",
        "A deadline was missed.", "`class`: cause; `late_ns`; `stretched`: whole ticks by which the grid moved; `steal_ms`, `involuntary_switches`, `minor_faults`, `waited_us`, `stopped`: counters of the system meanwhile", frequent;
    "gap", Warning, Misses, "no command was sent for {late_ns}",
        "No command was sent for a time outside of the steps of the test.", "`late_ns`; `ticks`: ticks without a command";
    "stale", Warning, Answers, "{specimen}: stale measurement, {age} ticks old",
        "A measurement is stale.", "`specimen`, `name`; `age`: commands since the one that it answers", frequent;
    "recovered", Debug, Answers, "{place}: a measurement that was missing arrived late, {age} ticks old",
        "A missing measurement arrived within the history of a later one.", "`specimen`, `name`, `axis`; `age` in commands; `force` in N";
    "link", Error, Answers, "{specimen}: {fault}: {message}",
        "A link failed.", "`specimen`, `name`; `fault`: in one word; `message`", trip;
    "unacknowledged", Warning, Answers, "{specimen}: the server did not acknowledge the end of the test. Check that its watchdog holds the specimen",
        "A specimen did not acknowledge the end of the test.", OF_SPECIMEN;
    "last_words", Warning, Answers, "{text}", "A message with which the specimen's end closed the link.", "`specimen`; `text`";
    "row_lost", Error, Limits, "row lost: the queue to the writer is full",
        "The queue to the writer was full: one row is lost.", "", frequent;
    "rows_lost", Error, Limits, "{rows_lost} rows lost[: {to_full_queue} because the queue was full, {to_file_error} because a file could not be written]",
        "Rows are missing from `samples.bin`.", "`rows_lost`; `to_full_queue`, `to_file_error`: by cause";
    "write_failed", Error, Other, "{file} cannot be written: {error}[ ({rows_lost} rows lost)]",
        "A file of the run folder cannot be written. The program tries again.", "`file`, `error`, `rows_lost`";
    "write_recovered", Warning, Other, "{file} can be written again[ ({rows_lost} rows lost)]",
        "A file of the run folder can be written again.", "`file`, `rows_lost`";
    "record_damaged", Error, Limits, "{text}", "Another program changed or deleted a file of the run folder.", "`file`, `text`";
    "internal_error", Error, Other, "{text}", "A fault of the program itself.", TEXT;
    "ended", Info, Other, "ended", "The test has ended and every specimen is in its end state.", "";
    "controller", Info, Other, "the controller {peer} begins a test[: {test}]",
        "A controller begins a test.", "`peer`: address; `test`: title; `software`", of(Server);
    "ready", Info, Other, "ready for the first command", "The specimen is ready for the first command of a controller's test.",
        "what the test begins with, so that it can be replayed: `specimen`; `remembers`, `moves`: of the specimen; `first`: number of the first \
         command; `rate`, `start`, `limits`: as the controller announced them; `standing`, `measured`, `force`: as the specimen introduced \
         itself; `at_rest`: displacement and force of each axis", of(Server);
    "armed_again", Info, Other, "{text}", "The controller begins the test again.", TEXT, of(Server);
    "holding", Warning, Other, "{text}", "No command has come for the time of the watchdog: the specimen holds.", TEXT, of(Server);
    "commands_again", Info, Other, "{text}", "Commands come again after a pause.", TEXT, of(Server);
    "limit", Warning, Other, "{text}", "A command or a measurement is beyond a `warn` level.", TEXT, of(Server);
    "trip", Error, Limits, "TRIP: {text}",
        "A limit or a fault ends the controller's test and latches.", "`text`; `what`: name of the cause; `code`: as in the column `trip`; `axis`, `value`, `bound`, `unit` for a limit", trip, of(Server);
    "faults", Warning, Limits, "{text}", "A fault script is played.", TEXT, of(Server);
    "left_aside", Warning, Other, "{text}", "A message of the controller had no effect.", TEXT, of(Server);
    "client_without_commits", Warning, Limits, "{text}", "An OpenFresco client sends no commits.", TEXT, of(Server);
    "client_reset", Warning, Limits, "{text}", "An OpenFresco client reset its state.", TEXT, of(Server);
    "late_replies", Warning, Misses, "{text}",
        "A gateway with `pace`: the specimen does not reply within one period.", TEXT, of(Server);
    "counts", Info, Other, "{text}", "Counts of messages at the end of the controller's test.", TEXT, of(Server);
};

/// The row of this name; none for an event of another version.
#[must_use]
pub fn find(name: &str) -> Option<&'static EventRow> {
    EVENTS.iter().find(|row| row.name == name)
}

/// An event whose only field is a sentence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Remark {
    /// A warning before the test.
    Warning,
    /// The operating system refused a real-time setting.
    NotGranted,
    /// A fault of the program itself.
    InternalError,
    /// A server: the specimen behind it is connected.
    Connected,
    /// A server: the link to the specimen behind it failed.
    Link,
    /// A server of an earlier version: the wiring check moves the specimen.
    Probing,
    /// A server of an earlier version: what the wiring check found.
    Direction,
    /// A server of an earlier version: the wiring check was ended and went back.
    Retraced,
    /// A server of an earlier version: the user accepts what the wiring check found.
    WiringAccepted,
    /// A server: the specimen reports that its own watchdog holds it.
    SpecimenHolds,
    /// A server: what the specimen reported after the test.
    LastWords,
    /// A server: the iteration of a simulated actuator did not converge.
    Unsettled,
    /// A server: the controller's test has ended.
    Ended,
    /// A server: the controller begins the test again.
    ArmedAgain,
    /// A server: no command comes, and the specimen holds.
    Holding,
    /// A server: commands come again.
    CommandsAgain,
    /// A server: a command or a measurement is beyond a `warn` level.
    Limit,
    /// A server: a fault script is played.
    Faults,
    /// A server: a message of the controller had no effect.
    LeftAside,
    /// A server: an OpenFresco client sends no commits.
    ClientWithoutCommits,
    /// A server: an OpenFresco client reset its state.
    ClientReset,
    /// A server that paces its client: the specimen does not reply within one period.
    LateReplies,
    /// A server: counts of messages.
    Counts,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn event_names_are_unique_with_guide_text() {
        for (place, row) in EVENTS.iter().enumerate() {
            let first = EVENTS.iter().position(|other| other.name == row.name);
            assert_eq!(first, Some(place), "{}", row.name);
            assert!(row.meaning.ends_with('.'), "{}", row.name);
            let is_silent = row.sentence.is_empty();
            assert_eq!(is_silent, row.group == Group::Silent, "{}", row.name);
        }
    }
}
