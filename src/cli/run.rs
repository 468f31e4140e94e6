//! `gusset run`.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use anyhow::Context;

use super::exit::{Exit, WithExit};
use super::progress::ProgressLine;
use super::table::{Table, duration, quantity};
use super::{ClockArg, RunArgs};
use crate::config::{self, ConfigError, Facts, Loaded, Method};
use crate::record::{Progress, RunFolder};
use crate::rt::wall::Wall;
use crate::session::{self, Finish, Finished, SessionError, Signal, Signals, Watches};

/// Runs one test.
pub fn run(args: &RunArgs) -> anyhow::Result<Exit> {
    let mut sets = args.sets.clone();
    if let Some(clock) = args.clock {
        let clock = match clock {
            ClockArg::Real => "real",
            ClockArg::Simulated => "simulated",
        };
        sets.push(format!("time.clock=\"{clock}\""));
    }
    let loaded = load(&args.test, &sets)?;
    let test = config::build(&loaded).map_err(refused)?;
    for warning in &test.facts.warnings {
        eprintln!("warning: {warning}");
    }
    let folder = match &args.out {
        Some(path) => RunFolder::create(path),
        None => RunFolder::create_default(Path::new("runs"), &test.facts.title, Wall::now().0),
    }
    .context("the run folder cannot be made")?;
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let facts = test.facts.clone();
    let mut line = ProgressLine::new(&facts, !args.quiet);
    let finished = session::run(
        test,
        folder,
        signals.requests(),
        Watches::default(),
        &mut |progress: &Progress| line.show(progress),
    );
    line.clear();
    let finished = finished.map_err(|error| match error {
        SessionError::NotRealTime { .. } => {
            WithExit(Exit::NoRealTime, format!("{error}\nnothing was moved")).into()
        }
        other => anyhow::Error::new(other),
    })?;
    if let Err(error) = session::write_report(&finished.path) {
        eprintln!("warning: report.html was not written: {error}");
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&finished.summary)?);
    }
    if !args.quiet {
        conclude(&facts, &finished);
    }
    Ok(match (finished.finish, signals.seen()) {
        (Finish::Completed, _) => Exit::Done,
        (Finish::Stopped, _) => Exit::Stopped,
        (Finish::Interrupted, Some(Signal::Terminate)) => Exit::Terminated,
        (Finish::Interrupted, _) => Exit::Interrupted,
        (Finish::LinkFailed, _) => Exit::Link,
        (Finish::Panicked, _) => Exit::Panic,
    })
}

/// Reads a test file; its mistakes are shown with file, line and caret.
pub fn load(path: &Path, sets: &[String]) -> anyhow::Result<Loaded> {
    config::load(path, sets).map_err(refused)
}

/// A mistake of the user as it is shown: in colour on a terminal.
pub fn refused(error: ConfigError) -> anyhow::Error {
    match error {
        ConfigError::Invalid(diagnostics) => {
            let colour = std::io::stderr().is_terminal();
            WithExit(Exit::Usage, diagnostics.render(colour)).into()
        }
        other => other.into(),
    }
}

/// A method as the test file spells it.
pub fn method_name(method: Method) -> String {
    match serde_json::to_value(method) {
        Ok(serde_json::Value::String(name)) => name,
        _ => format!("{method:?}"),
    }
}

/// What a person wants to know at the end of a test.
fn conclude(facts: &Facts, finished: &Finished) {
    let summary = &finished.summary;
    let verdict = match finished.finish {
        Finish::Completed => "completed",
        Finish::Stopped => "STOPPED",
        Finish::Interrupted => "interrupted",
        Finish::LinkFailed => "FAILED: a link was lost",
        Finish::Panicked => "FAILED: internal error, the specimens were retired",
    };
    let mut table = Table::new(&format!("{} — {verdict}", facts.title));
    table.row("ended", &summary.reason);
    let tested = summary.steps as f64 * summary.dt;
    table.row(
        "test",
        &format!(
            "{} steps of {}: {} in {} of wall time ({} clock, {:.6} Hz)",
            summary.steps,
            duration(summary.dt),
            duration(tested),
            duration(summary.wall_seconds),
            if finished.granted.is_some() {
                "real"
            } else {
                "simulated"
            },
            summary.rate_hz
        ),
    );
    if let Some(structure) = &facts.structure {
        match structure.lambda {
            None => table.row("method", &method_name(structure.method)),
            Some(lambda) => {
                let how = if structure.lambda_by_number {
                    "by number"
                } else {
                    "automatic"
                };
                let limit = match structure.choice.as_ref().map(|choice| choice.limit) {
                    Some(Some(limit)) => format!("limit {limit:.4}"),
                    Some(None) => "every lambda is stable".to_owned(),
                    None => "no proof: a tangent has no declared bound".to_owned(),
                };
                table.row("lambda", &format!("{lambda} ({how}; {limit})"));
            }
        }
    }
    let largest = |values: &[Option<f64>]| {
        let known = values
            .iter()
            .enumerate()
            .filter_map(|(dof, value)| Some((dof + 1, (*value)?)));
        known.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    for (what, unit, values) in [
        ("peak displacement", "m", &summary.peak.displacement),
        ("peak velocity", "m/s", &summary.peak.velocity),
        ("peak acceleration", "m/s²", &summary.peak.acceleration),
    ] {
        if let Some((dof, value)) = largest(values) {
            table.row(what, &format!("{} at DOF {dof}", quantity(value, unit)));
        }
    }
    for (name, forces) in &summary.peak.force {
        if let Some((axis, value)) = largest(forces) {
            let axis = if forces.len() > 1 {
                format!(" on axis {axis}")
            } else {
                String::new()
            };
            table.row(
                &format!("peak force, {name}"),
                &format!("{}{axis}", quantity(value, "N")),
            );
        }
    }
    if let Some(granted) = &finished.granted {
        table.timing(&summary.timing);
        let classes = &summary.miss_classes;
        let mut misses = format!("{}", summary.deadline_misses);
        if summary.deadline_misses > 0 {
            misses.push_str(&format!(
                " (ours {}, preempted {}, taken away {}, late reply {})",
                classes.ours, classes.preempted, classes.taken_away, classes.late_reply
            ));
        }
        table.row("deadline misses", &misses);
        for text in session::missing(granted) {
            table.row("not granted", &text);
        }
    }
    if summary.rows_lost > 0 {
        table.row("ROWS LOST", &summary.rows_lost.to_string());
    }
    let file = |name: &str| -> PathBuf { finished.path.join(name) };
    table.row("report", &file("report.html").display().to_string());
    table.row("data", &finished.path.display().to_string());
    eprint!("{table}");
}
