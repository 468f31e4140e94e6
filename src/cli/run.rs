//! `gusset run`.

use anyhow::Context;

use super::args::RunArgs;
use super::attend;
use super::closing::closing;
use super::conduct;
use super::exit::Exit;
use super::live;
use super::status::Status;
use super::test_file::refused;
use super::{answer, only_with, tell, warn};
use gusset_record::Progress;
use gusset_session::{
    self as session, Allowed, Judged, ReplayError, ResumeError, Signals, Watches,
};
use gusset_setup::{self as setup, Prepared};

/// Runs one test.
pub fn run(args: &RunArgs) -> anyhow::Result<Exit> {
    let test = prepare(args)?;
    warn(&test.warnings);
    for text in test.facts.announced.iter().chain(&test.facts.moved) {
        tell(format_args!("note: {text}"));
    }
    let mut judged = Judged::of(test).map_err(refused)?;
    // The errors of a resumed test were accepted when it began: they are reported again, and do not refuse it.
    if args.resume.is_some() {
        conduct::obey(&judged)?;
        judged = judged.with_errors().map_err(refused)?;
    } else {
        judged = judged.with_errors().map_err(refused)?;
        conduct::obey(&judged)?;
    }
    let test = &mut judged.test;
    attend::can_confirm(&mut test.facts, args.test_run.yes)?;
    let asked = live::Asked::for_run(args, test)?;
    // Before there is a folder: from here on an interrupt leaves a whole one.
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let folder = conduct::folder(args.test_run.out.as_deref(), &test.facts.title)?;
    let facts = test.facts.clone();
    let mut status = Status::new(&facts, args);
    let control = conduct::attended(&signals, &facts, &folder, args.test_run.yes)?;
    // A board without viewers is not fed.
    let mut looked = (asked.is_wanted() || status.is_shown())
        .then(|| live::Looked::at(&judged.test, folder.path(), control.phase.clone()));
    let mut watches = Watches {
        specimen_records: super::control::records(&judged.test, "gusset run"),
        ..Watches::default()
    };
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
    let report = session::conclude(&finished.folder, &mut finished.summary);
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
    // The test is over: the rest only prints and must not hide how it ended.
    if args.json
        && let Err(error) = answer(serde_json::to_string_pretty(&finished.summary)?)
    {
        tell(format_args!("warning: stdout: {error}"));
    }
    if !args.quiet {
        tell(closing(&facts, &finished, report.as_ref().ok()));
    }
    let exit = finished.exit(signals.seen());
    conduct::end(&finished, exit, !args.quiet)
}

/// The requested test: a new one, or an interrupted one that resumes.
fn prepare(args: &RunArgs) -> anyhow::Result<Prepared> {
    if let Some(folder) = &args.resume {
        let allowed = Allowed {
            after_trip: args.after_trip,
            changed: args.accept_changed.as_deref(),
            wider: match (&args.reason, &*args.test_run.sets) {
                (None, []) => None,
                (Some(reason), sets) => Some((sets, reason.as_str())),
                (None, _) => {
                    anyhow::bail!(
                        "`--set` with `--resume` widens limits, and needs a reason: add `--reason \"...\"`\nnothing was moved"
                    );
                }
            },
        };
        let next = session::resume_allowed(folder, args.test.as_deref(), allowed);
        return next.map_err(|error| match error {
            ResumeError::Replay(ReplayError::Config(error)) => refused(error),
            other => anyhow::anyhow!("{other}\nnothing was moved"),
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
