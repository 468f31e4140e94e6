//! How a station finds out which way round its specimen is wired, and how its tests end.

use crate::control::Pace;

/// How it is found out, before a test, which way round a specimen is wired.
#[derive(Debug, Clone, PartialEq)]
pub enum ProbeSettings {
    /// The specimen is a formula in this process.
    Needless,
    /// Not at all; `silent` if that was asked for.
    Unchecked {
        /// Nobody is to be warned in each test.
        silent: bool,
    },
    /// By a small motion and back.
    Motion {
        /// In the unit of each axis.
        amplitude: Vec<f64>,
        /// How fast.
        pace: Pace,
        /// It is a computation, which forgets having been tried.
        forgets: bool,
    },
}

/// How a test ended, for the summary of its log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Close {
    /// The controller brought it to its end.
    Completed,
    /// A limit, an interlock, or the controller's own trip.
    Stopped,
    /// The controller's operator.
    Interrupted,
    /// A program was told to end: our own, or the controller's.
    Shutdown,
    /// The controller is gone without a word.
    Vanished,
    /// The specimen was lost, or nonsense came.
    Failed,
}

/// Why a test is over, or does not begin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Over {
    /// How it ended.
    pub close: Close,
    /// In words.
    pub text: String,
}

impl Over {
    /// The specimen was lost, or nonsense came.
    #[must_use]
    pub fn failed(text: impl ToString) -> Self {
        Self {
            close: Close::Failed,
            text: text.to_string(),
        }
    }

    /// The controller is gone without a word.
    #[must_use]
    pub fn vanished(text: impl ToString) -> Self {
        Self {
            close: Close::Vanished,
            text: text.to_string(),
        }
    }

    /// Our own operator ends it.
    #[must_use]
    pub fn told_to_stop() -> Self {
        Self {
            close: Close::Shutdown,
            text: "the server was stopped".to_owned(),
        }
    }
}

impl From<String> for Over {
    fn from(text: String) -> Self {
        Self::failed(text)
    }
}
