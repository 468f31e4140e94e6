//! The commands. Only this module prints; the library does the work of a command.
//!
//! One JSON document goes to stdout with `--json`, everything else to stderr; progress goes to stderr and only to a
//! terminal. All text is written by `tell` and `answer`, never by the print macros. Those panic when a terminal has
//! hung up or the disk under a log is full, which must not end a test.

mod args;
mod aside;
mod attend;
mod benchmark;
#[cfg(feature = "ethercat")]
mod bus;
mod campaign;
mod certificate;
mod check;
mod closing;
mod conduct;
mod control;
mod doctor;
mod drawn;
mod exit;
mod export;
mod frontier;
mod guide;
mod identify;
mod import;
mod jitter;
mod limits;
mod list;
mod live;
mod log;
mod new;
mod operate;
mod progress;
mod question;
mod rehearsed;
mod replay;
mod report;
mod run;
mod schema;
mod screen;
mod serve;
mod serve_openfresco;
mod serve_reports;
mod serve_start;
mod serve_tls;
mod shell;
mod spectrum;
mod status;
mod table;
mod test_file;
mod verify;

use std::fmt::Display;
use std::io::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use clap::{CommandFactory, Parser};

pub use exit::Exit;
pub use log::tell_panics;

use crate::program::build;
use args::{Cli, Command, LogArg};
use clap::ValueEnum as _;

use gusset_config::Diagnostics;
use gusset_quantity::text::printable;
use gusset_record::origin::Build;
use gusset_record::rt::os;

/// Runs the command line and returns the exit code: 0 done, 1 stopped, 2 wrong usage, 3 link, 4 no real
/// time, 5 our own fault, 130 and 143 interrupted.
#[must_use]
pub fn main() -> ExitCode {
    #[cfg(debug_assertions)]
    if std::env::var_os("GUSSET_REWORD").is_some() {
        gusset_quantity::text::reword_received();
    }
    os::ignore_file_size_signal();
    progress::show_long_work();
    gusset_record::origin::introduce(build());
    if asks_for_the_build(std::env::args().skip(1)) {
        return show_build();
    }
    let cli = Cli::parse();
    begin_log(cli.log);
    match caught(|| enough_files().and_then(|()| dispatch(cli.command))) {
        Ok(exit) => exit.code().into(),
        Err(error) => {
            match error.downcast_ref::<exit::Mistakes>() {
                Some(exit::Mistakes(pictures)) => show(pictures),
                None => tell(format_args!("error: {}", in_one_line(&error))),
            }
            exit::of(&error).code().into()
        }
    }
}

/// True of `--version --verbose`, in any order and by their letters.
fn asks_for_the_build(words: impl Iterator<Item = String>) -> bool {
    let words: Vec<String> = words.collect();
    let is = |names: [&str; 2]| words.iter().any(|word| names.contains(&word.as_str()));
    words.len() == 2 && is(["--version", "-V"]) && is(["--verbose", "-v"])
}

/// The facts of this build.
fn show_build() -> ExitCode {
    let Build {
        version,
        commit,
        features,
        target,
        compiler,
    } = build();
    let shown = answer(format_args!(
        "gusset {version}\ncommit {commit}\nfeatures {features}\ntarget {target}\ncompiler {compiler}"
    ));
    let exit = if shown.is_ok() {
        Exit::Done
    } else {
        Exit::Stopped
    };
    exit.code().into()
}

/// The level of the option, or else of the environment. A variable that is no level must not keep anybody from `gusset stop`.
fn begin_log(option: Option<LogArg>) {
    let variable = std::env::var("GUSSET_LOG")
        .ok()
        .filter(|text| !text.is_empty());
    let found = variable.as_ref().map(|text| LogArg::from_str(text, true));
    let level = option.or_else(|| found.clone()?.ok());
    log::begin_log(level.unwrap_or(LogArg::Warn).into());
    if let (None, Some(text), Some(Err(_))) = (option, variable, found) {
        tracing::warn!(
            "GUSSET_LOG is {text:?}, but must be off, error, warn, info, debug or trace; the level is warn"
        );
    }
}

/// The commands with all their options, as the parser has them.
#[must_use]
pub fn definition() -> clap::Command {
    Cli::command()
}

/// Files that a process needs at least, with the sockets of a test of a few specimens.
const FEWEST_FILES: u64 = 64;
/// Files that a process asks for, as far as it may: a live page and a server have many connections.
const WANTED_FILES: u64 = 4096;

/// Refuses to begin what would fail in the middle for want of files.
fn enough_files() -> anyhow::Result<()> {
    match os::raise_open_files(WANTED_FILES) {
        Some(most) if most < FEWEST_FILES => anyhow::bail!(
            "this process may open {most} files, and gusset needs {FEWEST_FILES} at least: raise the limit with \
             `ulimit -n {WANTED_FILES}`; nothing was moved"
        ),
        _ => Ok(()),
    }
}

fn dispatch(command: Command) -> anyhow::Result<Exit> {
    match command {
        Command::New(args) => new::new(&args),
        Command::Import(args) => import::import(&args),
        Command::Run(args) => run::run(&args),
        Command::Check(args) => check::check(&args),
        Command::Identify(args) => identify::identify(&args),
        Command::Jitter(args) => jitter::jitter(&args),
        Command::Doctor(args) => doctor::doctor(&args),
        #[cfg(feature = "ethercat")]
        Command::Bus(command) => bus::bus(&command),
        Command::Export(args) => export::export(&args),
        Command::Report(args) => report::report(&args),
        Command::Stop(args) => operate::operate(&args, operate::Order::Stop),
        Command::Hold(args) => operate::operate(&args, operate::Order::Hold),
        Command::Continue(args) => operate::operate(&args, operate::Order::Continue),
        Command::Replay(args) => replay::replay(&args),
        Command::Serve(args) => serve::serve(&args),
        Command::Reset(args) => control::reset(&args),
        Command::Verify(args) => verify::verify(&args),
        Command::Benchmark(benchmark::Of::Vrths(args)) => benchmark::vrths(&args),
        Command::Campaign(args) => campaign::campaign(&args.command),
        Command::List(args) => list::list(&args),
        Command::Schema(args) => schema::schema(&args),
        Command::Completions(args) => shell::completions(&args),
        Command::Man(args) => shell::man(&args),
        Command::Guide(args) => guide::guide(&args),
    }
}

/// What `command` comes to. A panic of ours is one whatever the command: a test that runs catches its own and retires the
/// specimens, but a rehearsal of the same law comes here.
fn caught(command: impl FnOnce() -> anyhow::Result<Exit>) -> anyhow::Result<Exit> {
    catch_unwind(AssertUnwindSafe(command)).unwrap_or_else(|_told_by_the_hook| {
        let text = "this is a fault of gusset itself, not of the test";
        Err(exit::WithExit(Exit::Panic, text.to_owned()).into())
    })
}

/// The error and what caused it; causes that it quotes already are not said twice.
fn in_one_line(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text.push_str(": ");
            text.push_str(&cause);
        }
    }
    text
}

/// Writes a line to stderr and waits for it. For use before and after a run; [`log::remark`] is for lines during a run.
/// A failure to write loses only the line.
fn tell(text: impl Display) {
    show(printable(&text.to_string()));
}

/// Writes a text with colours of ours to stderr.
fn show(text: impl Display) {
    screen::step_aside();
    let _nobody_reads = writeln!(io::stderr(), "{text}");
}

/// Refuses the first of these flags that is given, beside `whole`, which is not: the parser lets `requires` pass where another key
/// is given that excludes that one.
fn only_with(
    whole: &str,
    flags: impl IntoIterator<Item = (&'static str, bool)>,
) -> Result<(), String> {
    match flags.into_iter().find(|(_, given)| *given) {
        Some((flag, _)) => Err(format!("{flag} is for {whole}, which is not given")),
        None => Ok(()),
    }
}

/// The result to stdout. A reader who has seen enough (`| head`) is no error.
fn answer(text: impl Display) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

/// Warnings as pictures; in colour on a terminal.
fn warn(warnings: &Diagnostics) {
    if !warnings.0.is_empty() {
        show(warnings.render(screen::in_colour()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panic_exits_with_code_5() {
        let broken = caught(|| panic!("a bug in a law"));
        assert_eq!(exit::of(&broken.unwrap_err()), Exit::Panic);
        assert_eq!(caught(|| Ok(Exit::Stopped)).unwrap(), Exit::Stopped);
        let wrong = caught(|| anyhow::bail!("wrong usage"));
        assert_eq!(exit::of(&wrong.unwrap_err()), Exit::Usage);
    }
}
