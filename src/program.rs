//! Which program this is: facts that `src/build.rs` finds at build time.

use gusset_config::ConfigError;
use gusset_record::origin::Build;
use gusset_session::campaign::{Program, fixed_test};

/// Version of the package.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
/// Commit of the sources, followed by `, modified` if they differ from it; `unknown` without a repository.
pub const COMMIT: &str = env!("GUSSET_COMMIT");
/// Digest (BLAKE3) of all files below `src`, of `Cargo.toml`, and of the files of `tools` that are part of the program.
pub const SOURCES: &str = env!("GUSSET_SOURCES");
/// Digest (BLAKE3) of `Cargo.lock`.
pub const LOCK: &str = env!("GUSSET_LOCK");
/// Features with which it was built, separated by commas.
pub const FEATURES: &str = env!("GUSSET_FEATURES");
/// The platform for which it was built.
pub const TARGET: &str = env!("GUSSET_TARGET");
/// Version of the compiler.
pub const COMPILER: &str = env!("GUSSET_COMPILER");

/// This build, for the origin of a run.
pub(crate) fn build() -> Build {
    Build {
        version: VERSION.to_owned(),
        commit: COMMIT.to_owned(),
        features: FEATURES.to_owned(),
        target: TARGET.to_owned(),
        compiler: COMPILER.to_owned(),
    }
}

/// The identity of this program, for campaigns. It computes a fixed test.
///
/// # Errors
/// As [`fixed_test`].
pub(crate) fn program() -> Result<Program, ConfigError> {
    Ok(Program {
        sources: SOURCES.to_owned(),
        lock: LOCK.to_owned(),
        features: FEATURES.to_owned(),
        target: TARGET.to_owned(),
        compiler: COMPILER.to_owned(),
        results: fixed_test()?,
    })
}
