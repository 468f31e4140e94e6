//! The exit code of a command that failed.

use gusset_config::ConfigError;
pub use gusset_quantity::catalog::ending::Exit;

/// The exit code of an error that reached the top: every failure before a specimen is commanded counts as wrong usage,
/// unless the error has its own code.
pub fn of(error: &anyhow::Error) -> Exit {
    if error.downcast_ref::<ConfigError>().is_some() || error.downcast_ref::<Mistakes>().is_some() {
        return Exit::Usage;
    }
    error
        .downcast_ref::<WithExit>()
        .map_or(Exit::Usage, |with| with.0)
}

/// The mistakes of a test file, drawn: each picture itself is marked as an error.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Mistakes(pub String);

/// An error that carries its own exit code.
#[derive(Debug, thiserror::Error)]
#[error("{1}")]
pub struct WithExit(pub Exit, pub String);
