//! `gusset replay`: the proof that a recorded test comes out bit for bit the same.

use serde_json::json;

use super::exit::{Exit, WithExit};
use super::{ReplayArgs, answer};
use crate::session;

/// Replays one run folder.
pub fn replay(args: &ReplayArgs) -> anyhow::Result<Exit> {
    let found = session::replay(&args.run).map_err(|error| match error {
        session::ReplayError::Config(error) => super::run::refused(error),
        other => WithExit(Exit::Usage, format!("{}: {other}", args.run.display())).into(),
    })?;
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
        }))?)?;
    } else {
        answer(format_args!(
            "{} rows, {} columns: the same to the last bit{}",
            found.rows,
            found.columns,
            if found.rows > 0 {
                format!(", up to {} s of test time", found.time)
            } else {
                String::new()
            }
        ))?;
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
