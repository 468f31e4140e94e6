//! The `gusset` binary: arguments, logging, exit code; nothing else.

use std::process::ExitCode;

use tracing::level_filters::LevelFilter;

fn main() -> ExitCode {
    // Text of the log goes to stderr; results go to stdout.
    tracing_subscriber::fmt()
        .with_max_level(LevelFilter::WARN)
        .with_writer(std::io::stderr)
        .with_target(false)
        .init();
    gusset::cli::main()
}
