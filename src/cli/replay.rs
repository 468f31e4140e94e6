//! `gusset replay`: the proof that a recorded test is reproduced bit for bit.

use serde_json::json;

use super::answer;
use super::args::ReplayArgs;
use super::exit::Exit;
use super::tell;
use gusset_record::Run;
use gusset_record::export::Notice;
use gusset_session as session;

/// Replays one run folder.
pub fn replay(args: &ReplayArgs) -> anyhow::Result<Exit> {
    let found = session::replay(&args.run).map_err(|error| match error {
        session::ReplayError::Config(error) => super::test_file::refused(error),
        columns @ session::ReplayError::Columns { .. } => {
            anyhow::anyhow!(
                "{}: {columns}: resolved.toml and samples.json are not of one test, or of another version of this program",
                args.run.display()
            )
        }
        // All others name the file that they are about.
        other => anyhow::Error::msg(other),
    })?;
    // A run without a summary needs no warning: it is proven as far as its rows.
    if Run::open(&args.run)?.summary_fault().is_some() {
        let notice = Notice::SummaryDamaged;
        tell(format_args!("warning: {}: {notice}", args.run.display()));
    }
    if !found.files_proven {
        tell(format_args!(
            "warning: {}: its events do not say what its files were: that test.toml, resolved.toml and the inputs are those of the \
             test is not proven",
            args.run.display()
        ));
    }
    for difference in found
        .summary
        .iter()
        .filter(|_| found.is_of_an_earlier_version)
    {
        tell(format_args!(
            "warning: {}: {difference}; an earlier version wrote it",
            args.run.display()
        ));
    }
    if args.json {
        let difference = found.difference.as_ref().map(|difference| {
            json!({
                "row": difference.row,
                "step": difference.step,
                "time": difference.time,
                "column": difference.column,
                "recorded": difference.recorded,
                "replayed": difference.replayed,
            })
        });
        answer(serde_json::to_string_pretty(&json!({
            "exact": found.is_exact(),
            "rows": found.rows,
            "columns": found.columns,
            "difference": difference,
            "short": found.short,
            "files_proven": found.files_proven,
            "summary": found.summary.iter().map(|difference| json!({
                "key": difference.key,
                "summary": difference.summary,
                "replayed": difference.found,
            })).collect::<Vec<_>>(),
        }))?)?;
    } else {
        if found.rows == 0 {
            answer("0 rows: nothing is proven")?;
        } else {
            answer(format_args!(
                "{} rows, {} columns: the same to the last bit, up to {} s of test time",
                found.rows, found.columns, found.time
            ))?;
        }
        if let Some(difference) = &found.difference {
            answer(format_args!(
                "row {} (step {}, {} s): `{}` was {:e}, comes out as {:e}",
                difference.row,
                difference.step,
                difference.time,
                difference.column,
                difference.recorded,
                difference.replayed
            ))?;
        }
        for difference in found
            .summary
            .iter()
            .filter(|_| !found.is_of_an_earlier_version)
        {
            answer(format_args!("{difference}"))?;
        }
        if let Some(short) = &found.short {
            answer(format_args!("the proof ends there: {short}"))?;
        }
    }
    Ok(if found.is_exact() {
        Exit::Done
    } else {
        Exit::Stopped
    })
}
