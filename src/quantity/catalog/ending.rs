//! Why a test ends: one row per cause.
//!
//! A row has the word of the files, a code that is never renumbered, the kind of cause, the exit code, a heading and a
//! sentence. The exit code determines the `status` of the summary. The loop, the server, the files, the report, the page and
//! the command line read this table. A new cause is one row. The numbers that belong to a cause are with the code that
//! finds it.

use serde::{Deserialize, Serialize};

/// Exit code of the process. Firm: scripts of laboratories read it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Done and within its limits.
    Done = 0,
    /// Stopped by a limit, divergence, or a bound of stale measurements or misses; or a check or verification failed.
    Stopped = 1,
    /// Wrong usage, bad configuration, or a refused test; nothing was moved.
    Usage = 2,
    /// A link or peer failed.
    Link = 3,
    /// Real-time conditions were required and not granted; nothing was moved.
    NoRealTime = 4,
    /// A panic of this program, caught; the specimens were retired.
    Panic = 5,
    /// SIGINT or `gusset stop`, after an orderly stop.
    Interrupted = 130,
    /// SIGTERM, after an orderly stop.
    Terminated = 143,
}

impl Exit {
    /// The number.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The `status` of the summary of a test with this exit code.
    #[must_use]
    pub(crate) const fn status(self) -> Status {
        match self {
            Self::Done => Status::Completed,
            Self::Stopped | Self::Usage | Self::NoRealTime => Status::Stopped,
            Self::Link | Self::Panic => Status::Failed,
            Self::Interrupted | Self::Terminated => Status::Interrupted,
        }
    }
}

/// How a test ended, as `status` in `summary.json`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Done and within its limits.
    Completed,
    /// Stopped by a limit, divergence, or a bound of stale measurements or misses.
    Stopped,
    /// Stopped by the operator or a signal.
    Interrupted,
    /// A link, a peer or this program failed.
    #[default]
    Failed,
}

impl Status {
    /// The status of a file.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        let all = [
            Self::Completed,
            Self::Stopped,
            Self::Interrupted,
            Self::Failed,
        ];
        all.into_iter().find(|status| status.word() == word)
    }

    /// Spelling in the files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Completed => "completed",
            Self::Stopped => "stopped",
            Self::Interrupted => "interrupted",
            Self::Failed => "failed",
        }
    }
}

/// Kind of a cause. It decides whether an interrupted test may be resumed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The test reached its end.
    Completion,
    /// The operator or a signal stopped it.
    Operator,
    /// A link or its peer failed, or measurements did not arrive. The test may be resumed.
    Link,
    /// The test did not begin, or was not resumed: a specimen or the computer does not meet a condition.
    Refusal,
    /// A latched stop by a limit or fault: a resume needs `--after-trip`.
    Trip,
    /// A fault of this program, or a damaged record.
    Internal,
}

/// Page of the guide with this table.
pub const PAGE: &str = "columns";

/// Makes [`Cause`] and its table from the rows.
macro_rules! causes {
    ($($name:ident = $code:literal, $word:literal, $kind:ident, $exit:ident, $heading:literal, $sentence:literal;)*) => {
        /// Why a test ended, or a phase of it.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum Cause {
            $(#[doc = $sentence] $name = $code,)*
        }

        impl Cause {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Spelling in the files. The cause `limit` is spelled as the key of the limit in events.
            #[must_use]
            pub const fn word(self) -> &'static str {
                match self { $(Self::$name => $word,)* }
            }

            /// What kind of cause it is.
            #[must_use]
            pub const fn kind(self) -> Kind {
                match self { $(Self::$name => Kind::$kind,)* }
            }

            /// The exit code of a run that ended so. A signal may change [`Exit::Interrupted`].
            #[must_use]
            pub const fn exit(self) -> Exit {
                match self { $(Self::$name => Exit::$exit,)* }
            }

            /// The ending as a heading.
            #[must_use]
            pub const fn heading(self) -> &'static str {
                match self { $(Self::$name => $heading,)* }
            }

            /// In one sentence, for people.
            #[must_use]
            pub const fn sentence(self) -> &'static str {
                match self { $(Self::$name => $sentence,)* }
            }
        }
    };
}

// Name = code, word in files, kind, exit code, heading, sentence. A code is never given to another cause.
causes! {
    Done = 1, "done", Completion, Done, "completed",
        "The test, or this phase of it, came to its end.";
    Operator = 2, "operator", Operator, Interrupted, "interrupted",
        "The operator stopped the test.";
    Limit = 3, "limit", Trip, Stopped, "STOPPED",
        "A limit tripped.";
    Late = 4, "late", Trip, Stopped, "STOPPED",
        "More deadlines were missed than the test allows.";
    Stale = 5, "stale", Link, Stopped, "STOPPED",
        "No fresh measurement arrived for longer than the test allows.";
    Interlock = 6, "interlock", Trip, Stopped, "STOPPED",
        "The interlock or emergency stop at the specimen is open.";
    Misfit = 7, "misfit", Refusal, Link, "FAILED: wiring check",
        "The wiring check failed, so the specimen was not armed.";
    Saturated = 8, "saturated", Trip, Stopped, "STOPPED",
        "The specimen reports a sensor or actuator at the end of its range.";
    HoldsOn = 9, "specimen_holds_on", Trip, Stopped, "STOPPED",
        "The specimen's own watchdog holds it although commands arrive.";
    Link = 10, "link", Link, Link, "FAILED: a link was lost",
        "The link to a specimen was lost.";
    LinkNotFinite = 11, "link", Trip, Link, "FAILED: a link was lost",
        "A specimen answered with a number that is not finite.";
    LinkDiverged = 12, "link", Trip, Stopped, "STOPPED",
        "The computed law of a specimen gives no finite force.";
    Diverged = 13, "diverged", Trip, Stopped, "STOPPED",
        "The response diverged.";
    NotFinite = 14, "not_finite", Trip, Stopped, "STOPPED",
        "The next command is not a finite number.";
    Geometry = 15, "geometry", Trip, Stopped, "STOPPED",
        "The actuators cannot take the pose, or their strokes belong to no pose.";
    NoGo = 16, "no_go", Refusal, Stopped, "STOPPED",
        "The warm-up missed too many deadlines, so the test did not begin.";
    Moved = 17, "moved", Refusal, Usage, "REFUSED: a specimen has changed since the interruption",
        "A specimen is not at the position in which the interrupted test left it.";
    ForceChanged = 18, "force_changed", Refusal, Usage, "REFUSED: a specimen has changed since the interruption",
        "A load cell reads another force than when the test was interrupted.";
    Internal = 19, "internal_error", Internal, Panic, "FAILED: internal error, the specimens were retired",
        "The program failed. It retired the specimens.";
    CannotCommand = 20, "cannot_command", Refusal, Stopped, "STOPPED",
        "The integration method cannot command a specimen.";
    NotSettled = 21, "not_settled", Trip, Stopped, "STOPPED",
        "The static load found no equilibrium.";
    DoesNotFollow = 22, "does_not_follow", Trip, Stopped, "STOPPED",
        "An axis does not follow its commands under the static load.";
    NotAtRest = 23, "not_at_rest", Trip, Stopped, "STOPPED",
        "A specimen did not come to rest under the static load.";
    NotConnected = 24, "not_connected", Refusal, Link, "FAILED: a specimen could not be connected",
        "A specimen could not be connected.";
    Unfit = 25, "unfit", Refusal, Usage, "REFUSED: a specimen does not meet the needs of this test",
        "A specimen lacks something that the test needs.";
    RecordDamaged = 26, "record_damaged", Internal, Stopped, "STOPPED",
        "The record is incomplete although the test file requires it.";
    MeasuredNotFinite = 27, "measured_not_finite", Trip, Stopped, "STOPPED",
        "A measurement is not a finite number.";
    CommandNotFinite = 28, "command_not_finite", Trip, Stopped, "STOPPED",
        "The controller sent a command that is not a finite number.";
    FirstCommandElsewhere = 29, "first_command_elsewhere", Trip, Stopped, "STOPPED",
        "The first command is not the position in which the specimen was armed.";
    SpecimenLost = 30, "specimen_lost", Link, Link, "FAILED: a link was lost",
        "The server lost the link to its specimen.";
    ControllerTripped = 31, "controller_tripped", Trip, Stopped, "STOPPED",
        "The controller tripped and ended its test.";
    ControllerVanished = 32, "controller_vanished", Link, Link, "FAILED: the controller was lost",
        "The link to the controller was lost without a goodbye.";
    Shutdown = 33, "shutdown", Operator, Interrupted, "interrupted",
        "A signal or command ended the server or the controller.";
    Protocol = 34, "protocol", Link, Link, "FAILED: the link broke the protocol",
        "The test could not be served: a refusal, or bytes that the protocol does not allow.";
    TakenBack = 35, "taken_back", Trip, Stopped, "STOPPED",
        "The client took a command back, which a physical specimen cannot follow.";
    ClientIterates = 36, "client_iterates", Trip, Stopped, "STOPPED",
        "The client commanded another target in the same step, farther away than the file allows.";
}

impl Cause {
    /// The number in the column `cause` of the rows; 0 there means none.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The `status` of the summary.
    #[must_use]
    pub const fn status(self) -> Status {
        self.exit().status()
    }

    /// True if a resume needs `--after-trip`.
    #[must_use]
    pub const fn is_trip(self) -> bool {
        matches!(self.kind(), Kind::Trip)
    }

    /// The cause with this code.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn from_code(code: u8) -> Option<Self> {
        Self::ALL.iter().copied().find(|cause| cause.code() == code)
    }

    /// The cause in the column `cause`; none for 0 and for a number that is no code.
    #[must_use]
    pub fn of_column(code: f64) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
            .find(|cause| f64::from(cause.code()) == code)
    }

    /// The cause of an event with this word; none for an empty word. A word that no row has is the key of a limit. The word `link`
    /// alone does not state why the link failed.
    #[must_use]
    pub fn of_word(word: &str) -> Option<Self> {
        let known = Self::ALL.iter().copied().find(|cause| cause.word() == word);
        known.or_else(|| (!word.is_empty()).then_some(Self::Limit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Code and word of every cause, in the order of the codes. Programs read both: add rows, and never change one.
    const FROZEN: &[(u8, &str)] = &[
        (1, "done"),
        (2, "operator"),
        (3, "limit"),
        (4, "late"),
        (5, "stale"),
        (6, "interlock"),
        (7, "misfit"),
        (8, "saturated"),
        (9, "specimen_holds_on"),
        (10, "link"),
        (11, "link"),
        (12, "link"),
        (13, "diverged"),
        (14, "not_finite"),
        (15, "geometry"),
        (16, "no_go"),
        (17, "moved"),
        (18, "force_changed"),
        (19, "internal_error"),
        (20, "cannot_command"),
        (21, "not_settled"),
        (22, "does_not_follow"),
        (23, "not_at_rest"),
        (24, "not_connected"),
        (25, "unfit"),
        (26, "record_damaged"),
        (27, "measured_not_finite"),
        (28, "command_not_finite"),
        (29, "first_command_elsewhere"),
        (30, "specimen_lost"),
        (31, "controller_tripped"),
        (32, "controller_vanished"),
        (33, "shutdown"),
        (34, "protocol"),
        (35, "taken_back"),
        (36, "client_iterates"),
    ];

    #[test]
    fn codes_and_words_are_unique_and_frozen() {
        let table: Vec<_> = Cause::ALL.iter().map(|c| (c.code(), c.word())).collect();
        assert_eq!(table, FROZEN);
        let mut words: Vec<&str> = table.iter().map(|(_, word)| *word).collect();
        words.sort_unstable();
        words.dedup();
        // The fault in the event `link` distinguishes the three.
        assert_eq!(words.len() + 2, table.len());
    }

    #[test]
    fn every_word_has_its_exit_and_sentence() {
        for &cause in Cause::ALL {
            assert_eq!(Cause::from_code(cause.code()), Some(cause));
            let found = Cause::of_word(cause.word()).unwrap();
            assert_eq!(found.word(), cause.word());
            assert_eq!(cause.status(), cause.exit().status());
            assert!(cause.sentence().ends_with('.') && !cause.heading().is_empty());
            let is_completed = cause.exit() == Exit::Done;
            assert_eq!(cause.kind() == Kind::Completion, is_completed);
            assert_eq!(cause.status() == Status::Completed, is_completed);
            let is_interrupted = cause.status() == Status::Interrupted;
            assert_eq!(cause.kind() == Kind::Operator, is_interrupted);
        }
        assert_eq!(Cause::from_code(0), None);
        assert_eq!(Cause::of_word("stroke_m"), Some(Cause::Limit));
        assert_eq!(Cause::of_word(""), None);
        for cause in [Cause::Link, Cause::LinkNotFinite, Cause::LinkDiverged] {
            assert_eq!(cause.word(), "link");
        }
    }

    #[test]
    fn exit_codes_are_those_of_the_contract() {
        let of = |exit: Exit| (exit.code(), exit.status().word());
        let contract = [
            (0, "completed"),
            (1, "stopped"),
            (2, "stopped"),
            (3, "failed"),
            (4, "stopped"),
            (5, "failed"),
            (130, "interrupted"),
            (143, "interrupted"),
        ];
        let all = [
            Exit::Done,
            Exit::Stopped,
            Exit::Usage,
            Exit::Link,
            Exit::NoRealTime,
            Exit::Panic,
            Exit::Interrupted,
            Exit::Terminated,
        ];
        assert_eq!(all.map(of), contract);
    }
}
