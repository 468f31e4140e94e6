//! The `gusset` binary: arguments, logging, exit code; nothing else.

use std::process::ExitCode;

use tracing::level_filters::LevelFilter;

fn main() -> ExitCode {
    // Text of the log goes to stderr; results go to stdout. A log that cannot be written ends nothing: the subscriber
    // would complain by a macro that panics, on the thread that writes the rows.
    tracing_subscriber::fmt()
        .with_max_level(LevelFilter::WARN)
        .with_writer(|| gusset::cli::Log)
        .with_ansi(gusset::cli::in_colour())
        .log_internal_errors(false)
        .with_target(false)
        .init();
    gusset::cli::tell_panics();
    gusset::cli::main()
}
