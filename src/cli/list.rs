//! `gusset list`: the runs below a folder, newest first.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::answer;
use super::args::ListArgs;
use super::drawn::cut;
use super::exit::Exit;
use gusset_config::printable;
use gusset_quantity::units::{duration, quantity};
use gusset_record::FolderError;
use gusset_record::listing::{Listed, Peak, State, listed};

/// Widest line.
const COLUMNS: usize = 100;

/// Keys of `[about]` in a list; `--json` has all of them.
const LISTED: [&str; 4] = ["specimen", "operator", "laboratory", "project"];

/// Default folder of runs. It need not exist yet.
const USUAL: &str = "runs";

/// Lists the runs below a folder.
pub fn list(args: &ListArgs) -> anyhow::Result<Exit> {
    let runs = match listed(&args.dir) {
        Err(FolderError::Missing(folder)) if folder.as_os_str() == USUAL => Vec::new(),
        found => found?,
    };
    if args.json {
        let runs: Vec<Value> = runs.iter().map(as_json).collect();
        answer(format_args!("{:#}", json!({ "runs": runs })))?;
    } else if runs.is_empty() {
        answer(format_args!("no runs below {}", args.dir.display()))?;
    } else {
        let texts: Vec<String> = runs.iter().map(in_words).collect();
        answer(texts.join("\n"))?;
    }
    Ok(Exit::Done)
}

/// Folder and title, then date, state, length and peak, then who tested what.
fn in_words(run: &Listed) -> String {
    let folder = run.folder.strip_prefix(".").unwrap_or(&run.folder);
    let folder = printable(&folder.display().to_string());
    let head = cut(&format!("{folder}  {}", printable(&run.title)), COLUMNS);
    let date = run
        .started
        .as_deref()
        .map_or("no date", |wall| wall.get(..16).unwrap_or(wall));
    let mut parts = vec![
        format!("{:16}", date.replace('T', " ")),
        format!("{:11}", run.state.word()),
    ];
    match (run.unstable, run.findings) {
        (true, _) => parts.push("UNSTABLE".to_owned()),
        (false, 0) => {}
        (false, 1) => parts.push("1 finding".to_owned()),
        (false, n) => parts.push(format!("{n} findings")),
    }
    if let (Some(steps), Some(dt)) = (run.steps, run.dt) {
        parts.push(format!("{steps} steps, {}", duration(steps as f64 * dt)));
    }
    match &run.peak {
        Some(Peak::Displacement { metres, dof }) => {
            parts.push(format!("peak {} at DOF {dof}", quantity(*metres, "m")));
        }
        Some(Peak::Force { newtons, specimen }) => {
            let specimen = printable(specimen);
            parts.push(format!("peak {} in {specimen}", quantity(*newtons, "N")));
        }
        None => {}
    }
    if let State::Damaged(why) = &run.state {
        parts.push(printable(why));
    }
    let line = cut(&format!("    {}", parts.join("  ")), COLUMNS);
    let mut text = format!("{head}\n{}", line.trim_end());
    let filed = run.filed.iter().filter(|(name, _)| LISTED.contains(name));
    let filed: Vec<String> = filed
        .map(|(name, said)| format!("{name} {}", printable(said)))
        .collect();
    if !filed.is_empty() {
        text += "\n";
        text += &cut(&format!("    {}", filed.join("  ")), COLUMNS);
    }
    text
}

fn as_json(run: &Listed) -> Value {
    let peak = match &run.peak {
        Some(Peak::Displacement { metres, dof }) => {
            json!({ "displacement_m": metres, "dof": dof })
        }
        Some(Peak::Force { newtons, specimen }) => {
            json!({ "force_n": newtons, "specimen": specimen })
        }
        None => Value::Null,
    };
    let fault = match &run.state {
        State::Damaged(why) => Some(why),
        _ => None,
    };
    json!({
        "folder": run.folder,
        "title": run.title,
        "started": run.started,
        "status": run.state.word(),
        "reason": run.reason,
        "damage": fault,
        "steps": run.steps,
        "dt": run.dt,
        "duration_s": run.steps.zip(run.dt).map(|(steps, dt)| steps as f64 * dt),
        "peak": peak,
        "unstable": run.unstable,
        "findings": run.findings,
        "filed": run.filed.iter().cloned().collect::<BTreeMap<_, _>>(),
    })
}
