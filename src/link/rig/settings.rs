//! How a station finds out which way round its specimen is wired, and how its tests end.

use crate::catalog::ending::Cause;
use crate::port::Pace;

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

/// Why a test is over, or does not begin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TestEnd {
    /// The row of the table of causes.
    pub cause: Cause,
    /// In words.
    pub text: String,
}

impl TestEnd {
    /// The specimen was lost, or the test cannot be served.
    #[must_use]
    pub fn failed(text: impl ToString) -> Self {
        Self {
            cause: Cause::Protocol,
            text: text.to_string(),
        }
    }

    /// The controller is lost without a goodbye.
    #[must_use]
    pub fn vanished(text: impl ToString) -> Self {
        Self {
            cause: Cause::ControllerVanished,
            text: text.to_string(),
        }
    }

    /// The operator of this server ends it.
    #[must_use]
    pub fn told_to_stop() -> Self {
        Self {
            cause: Cause::Shutdown,
            text: "the server was stopped".to_owned(),
        }
    }
}

impl From<String> for TestEnd {
    fn from(text: String) -> Self {
        Self::failed(text)
    }
}
