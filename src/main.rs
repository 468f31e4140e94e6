//! The `gusset` binary: arguments, logging, exit code; nothing else.

use std::process::ExitCode;

fn main() -> ExitCode {
    gusset::cli::tell_panics();
    gusset::cli::main()
}
