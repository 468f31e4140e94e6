//! Exit codes: firm, since labs' scripts read them.

use std::process::ExitCode;

use crate::config::ConfigError;

/// What the process says at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done and within its limits.
    Done,
    /// Stopped by a limit, divergence, a stale or miss bound; or a check or verification failed.
    Stopped,
    /// Wrong usage or bad configuration; nothing was moved.
    Usage,
    /// A link or peer failed.
    Link,
    /// Real-time conditions were required and not granted; nothing was moved.
    NoRealTime,
    /// Our own panic, caught, the specimen retired.
    Panic,
    /// SIGINT, after an orderly stop.
    Interrupted,
    /// SIGTERM, after an orderly stop.
    Terminated,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(match exit {
            Exit::Done => 0,
            Exit::Stopped => 1,
            Exit::Usage => 2,
            Exit::Link => 3,
            Exit::NoRealTime => 4,
            Exit::Panic => 5,
            Exit::Interrupted => 130,
            Exit::Terminated => 143,
        })
    }
}

/// The exit code of an error that reached the top: everything that fails before a specimen is commanded is a
/// matter of usage, unless the error says otherwise.
pub fn of(error: &anyhow::Error) -> Exit {
    if error.downcast_ref::<ConfigError>().is_some() || error.downcast_ref::<Mistakes>().is_some() {
        return Exit::Usage;
    }
    error
        .downcast_ref::<WithExit>()
        .map_or(Exit::Usage, |with| with.0)
}

/// The mistakes of a test file, drawn: each picture says itself that it is an error.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Mistakes(pub String);

/// An error that carries its own exit code.
#[derive(Debug, thiserror::Error)]
#[error("{1}")]
pub struct WithExit(pub Exit, pub String);
