//! `gusset run`.

use anyhow::Context;

use super::args::RunArgs;
use super::attend;
use super::conduct;
use super::exit::{Exit, WithExit};
use super::live;
use super::status::Status;
use super::table::Table;
use super::test_file::refused;
use super::{answer, only_with, tell, warn};
use crate::record::Progress;
use crate::session::{
    self, Allowed, Finished, Judged, Page, ReplayError, ResumeError, Signals, Watches, integration,
};
use crate::setup::{self, Facts, Prepared};
use crate::stability::RecordedVerdict;
use crate::units::{duration, number, quantity};
use crate::view::report::told;

/// Runs one test.
pub fn run(args: &RunArgs) -> anyhow::Result<Exit> {
    let test = prepare(args)?;
    warn(&test.warnings);
    for text in test.facts.announced.iter().chain(&test.facts.moved) {
        tell(format_args!("note: {text}"));
    }
    let mut judged = Judged::of(test).map_err(refused)?;
    conduct::obey(&judged)?;
    let test = &mut judged.test;
    attend::can_confirm(&mut test.facts, args.test_run.yes)?;
    let asked = live::Asked::for_run(args, test)?;
    // Before there is a folder: from here on an interrupt leaves a whole one.
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let folder = conduct::folder(args.test_run.out.as_deref(), &test.facts.title)?;
    let facts = test.facts.clone();
    let mut status = Status::new(&facts, args);
    let control = conduct::attended(&signals, &facts, &folder, args.test_run.yes)?;
    // Who is not looked at is not tapped.
    let mut looked = (asked.is_wanted() || status.is_shown())
        .then(|| live::Looked::at(&judged.test, folder.path(), control.phase.clone()));
    let mut watches = Watches::default();
    #[cfg(feature = "monitor")]
    let served = live::Served::default();
    if let Some(looked) = &mut looked {
        watches.onlooker = looked.onlooker();
        #[cfg(feature = "monitor")]
        {
            watches.when_placed = looked.page(asked, signals.operator(), &served);
        }
        status.look_at(&looked.board);
    }
    let finished = session::run(judged, folder, control, watches, &mut |_: &Progress| {
        status.show();
    });
    status.clear();
    let mut finished = conduct::finished(finished)?;
    let report = session::conclude(&mut finished);
    if let Err(error) = &report {
        tell(format_args!("warning: not written: {error}"));
    }
    #[cfg(feature = "monitor")]
    {
        let page = report.as_ref().ok().map(|page| page.path.as_path());
        served.end(live::Looked::ended(&finished, page));
    }
    if finished.summary.rows_lost > 0 {
        tell(format_args!(
            "warning: {} ROWS ARE LOST: the record of this test has gaps",
            finished.summary.rows_lost
        ));
    }
    // The test is over: what follows is only talk and must not hide how it ended.
    if args.json
        && let Err(error) = answer(serde_json::to_string_pretty(&finished.summary)?)
    {
        tell(format_args!("warning: stdout: {error}"));
    }
    if !args.quiet {
        conclude(&facts, &finished, report.ok().as_ref());
    }
    let exit = finished.exit(signals.seen());
    conduct::end(&finished, exit, !args.quiet)
}

/// The test that is asked for: a new one, or an interrupted one that goes on.
fn prepare(args: &RunArgs) -> anyhow::Result<Prepared> {
    if let Some(folder) = &args.resume {
        let allowed = Allowed {
            after_trip: args.after_trip,
            changed: args.accept_changed.as_deref(),
        };
        let next = session::resume_allowed(folder, args.test.as_deref(), allowed);
        return next.map_err(|error| match error {
            ResumeError::Replay(ReplayError::Config(error)) => refused(error),
            other => WithExit(Exit::Usage, format!("{other}\nnothing was moved")).into(),
        });
    }
    let of_resumed = [
        ("--after-trip", args.after_trip),
        ("--accept-changed", args.accept_changed.is_some()),
    ];
    only_with("--resume", of_resumed)
        .map_err(|text| anyhow::anyhow!("{text}\nnothing was moved"))?;
    let test = args.test.as_deref().context("no test file is given")?;
    let loaded = args.test_run.load(test)?;
    setup::build(&loaded).map_err(refused)
}

/// Which steps were made, and the test time that they took; `after` is the last step that was made by another test.
fn tested(steps: u64, after: Option<u64>, dt: f64) -> String {
    let own = steps.saturating_sub(after.unwrap_or(0));
    let which = match after {
        Some(after) if own > 0 => format!("steps {} to {steps}", after + 1),
        Some(after) => format!("no step after step {after}, each"),
        None => format!("{steps} steps"),
    };
    format!("{which} of {}: {}", duration(dt), duration(own as f64 * dt))
}

/// What a person wants to know at the end of a test.
fn conclude(facts: &Facts, finished: &Finished, page: Option<&Page>) {
    let summary = &finished.summary;
    let verdict = finished.cause.heading();
    let mut table = Table::new(&format!("{} — {verdict}", facts.title));
    if let Some(headline) = summary.verdict.as_ref().and_then(RecordedVerdict::headline) {
        table.row("verdict", &headline);
    }
    table.row("ended", &summary.reason);
    let after = facts.resumed.as_ref().map(|(_, step)| *step);
    table.row(
        "test",
        &format!(
            "{} in {} of wall time ({} clock, {} Hz)",
            tested(summary.steps, after, summary.dt),
            duration(summary.wall_seconds),
            if finished.granted.is_some() {
                "real"
            } else {
                "simulated"
            },
            number(summary.rate_hz)
        ),
    );
    if let Some(structure) = &facts.structure {
        match structure.lambda {
            None => {
                let limit = integration::brief(structure);
                table.row(
                    "method",
                    &format!("{} ({limit})", integration::method_name(structure.method)),
                );
            }
            Some(lambda) => {
                let how = if structure.lambda_by_number {
                    "by number"
                } else {
                    "automatic"
                };
                let limit = integration::brief(structure);
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
    let structure = facts.structure.as_ref();
    let shaken = structure.and_then(|structure| structure.peak_ground_accel);
    let against = match shaken {
        Some(peak) if peak > 0.0 => ", relative to the ground",
        _ => "",
    };
    let turning = structure.map_or(&[][..], |structure| &structure.rotations);
    let peak = &summary.peak;
    for (turns, what, unit, values) in [
        (false, "peak displacement", "m", &peak.displacement),
        (false, "peak velocity", "m/s", &peak.velocity),
        (false, "peak acceleration", "m/s²", &peak.acceleration),
        (true, "peak rotation", "rad", &peak.displacement),
        (true, "peak angular velocity", "rad/s", &peak.velocity),
        (true, "peak angular accel.", "rad/s²", &peak.acceleration),
    ] {
        let of_kind = values.iter().enumerate();
        let of_kind = of_kind.map(|(dof, value)| value.filter(|_| turning.contains(&dof) == turns));
        if let Some((dof, value)) = largest(&of_kind.collect::<Vec<_>>()) {
            let value = quantity(value, unit);
            let against = if turns { "" } else { against };
            table.row(what, &format!("{value} at DOF {dof}{against}"));
        }
    }
    for (name, forces) in &summary.peak.force {
        // A test without a step has been nowhere but on its way in.
        let before = summary.force_on_the_way_in.get(name);
        let before = before.filter(|_| summary.steps == 0);
        let what = match before {
            Some(_) => "peak force before the first step",
            None => "peak force",
        };
        let each = [Some(forces), before].into_iter().flatten();
        let each = each.filter_map(|forces| largest(forces));
        if let Some((axis, value)) = each.max_by(|a, b| a.1.total_cmp(&b.1)) {
            let axis = if forces.len() > 1 {
                format!(" on axis {axis}")
            } else {
                String::new()
            };
            let seen = if facts.scaled.contains(name) {
                " as the structure sees it"
            } else {
                ""
            };
            table.row(
                &format!("{what}, {name}"),
                &format!("{}{axis}{seen}", quantity(value, "N")),
            );
        }
    }
    for axis in page.iter().flat_map(|page| &page.identified) {
        let unknown = || "unknown".to_owned();
        let stiffness = axis.stiffness.as_ref();
        let text = format!(
            "stiffness {}, lag {}",
            stiffness.map_or_else(unknown, |k| told(k, |k| quantity(k, "N/m"))),
            axis.lag.map_or_else(unknown, duration)
        );
        table.row(&format!("identified, {}", axis.name), &text);
    }
    if let Some(granted) = &finished.granted {
        table.timing(&summary.timing);
        table.misses(summary);
        for text in session::missing(granted) {
            table.row("not granted", &text);
        }
    }
    if summary.rows_lost > 0 {
        table.row("ROWS LOST", &summary.rows_lost.to_string());
    }
    if let Some(page) = page {
        table.row("report", &page.path.display().to_string());
    }
    let data = finished.folder.path().display();
    if finished.folder.is_there() {
        table.row("data", &data.to_string());
    } else {
        table.row("DATA LOST", &format!("{data} was deleted"));
    }
    tell(table);
}

#[cfg(test)]
mod tests {
    use super::tested;

    #[test]
    fn a_test_that_goes_on_claims_its_own_steps_only() {
        let dt = 1.0 / 256.0;
        assert_eq!(tested(5120, None, dt), "5120 steps of 3.906 ms: 20 s");
        let own = "steps 1870 to 5120 of 3.906 ms: 12.699 s";
        assert_eq!(tested(5120, Some(1869), dt), own);
        assert_eq!(
            tested(7, Some(7), dt),
            "no step after step 7, each of 3.906 ms: 0 s"
        );
    }
}
