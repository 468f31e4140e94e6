//! Merging of the result parts: the table, the summary and the report.

use serde_json::{Value, json};

pub use super::found::Collected;
use super::found::Shown;
use super::fragility::{Fragility, Level};
use super::page::render;
use super::part::{Line, Parts, merge, names};
use super::perform::INVALID;
use super::plan::Campaign;
pub use super::prove::Prove;
use super::prove::prove;
use super::study::Study;
use super::table::{TableColumn, Tables, cells, columns};
use super::task::Task;
use super::{CampaignError, at};
use crate::catalog::ending::Cause;
use crate::record::atomic;

/// Most chunks with missing tasks that a summary names.
const MOST_NAMED: usize = 100;

/// Counts and rows under way.
#[derive(Default)]
struct Sheet {
    done: u64,
    stopped: u64,
    invalid: u64,
    open: Vec<u64>,
    damaged: Vec<String>,
    parts: u64,
    shown: Vec<Shown>,
    to_prove: Vec<(Line, String)>,
}

/// Merges the parts of a campaign and writes table, summary and report. `jobs` threads compute the chosen tasks again.
///
/// # Errors
/// [`CampaignError`]: two results of one task differ, a part belongs to another campaign, or the system refuses a file.
pub fn collect(
    campaign: &Campaign,
    wanted: Prove,
    jobs: usize,
    progress: &dyn Fn(u64),
) -> Result<Collected, CampaignError> {
    let study = &campaign.study;
    let columns = columns(study);
    let mut tables = Tables::create(&campaign.folder, &columns)?;
    let sheet = merged(campaign, wanted, &mut tables, progress)?;
    prove(campaign, &sheet.to_prove, jobs)?;
    let table = tables.finish(sheet.done == campaign.plan.tasks)?;
    let mut collected = Collected {
        report: campaign.folder.join("report.html"),
        tasks: campaign.plan.tasks,
        done: sheet.done,
        stopped: sheet.stopped,
        invalid: sheet.invalid,
        open: sheet.open,
        damaged: sheet.damaged,
        proved: sheet.to_prove.len() as u64,
        fragility: fragility(study, &sheet.shown),
        summary: Value::Null,
        table,
    };
    collected.summary = summary(campaign, &collected, &columns, sheet.parts);
    let path = campaign.folder.join("summary.json");
    let text = serde_json::to_string_pretty(&collected.summary).unwrap_or_default();
    atomic::write(&path, (text + "\n").as_bytes()).map_err(at(&path))?;
    let page = render(campaign, &collected, &sheet.shown);
    atomic::write(&collected.report, page.as_bytes()).map_err(at(&collected.report))?;
    Ok(collected)
}

/// Writes the rows of all results, chunk by chunk, and keeps what pictures need.
fn merged(
    campaign: &Campaign,
    wanted: Prove,
    tables: &mut Tables,
    progress: &dyn Fn(u64),
) -> Result<Sheet, CampaignError> {
    let (study, plan) = (&campaign.study, &campaign.plan);
    let mut found = names(&campaign.folder)?;
    let chosen = wanted.chosen(campaign);
    let shown = study.reported();
    let collapse = study.measure_at("collapse");
    let mut sheet = Sheet::default();
    for chunk in 1..=plan.chunks() {
        let paths = found.remove(&chunk).unwrap_or_default();
        sheet.parts += paths.len() as u64;
        let Parts { lines, damaged } = merge(&paths, |index| campaign.identity(index))?;
        sheet.damaged.extend(damaged);
        let tasks = plan.chunk(chunk);
        if (lines.len() as u64) < tasks.end - tasks.start && sheet.open.len() < MOST_NAMED {
            sheet.open.push(chunk);
        }
        for (index, (line, part)) in lines {
            let task = Task::of(study, index);
            tables.row(cells(study, &task, &line.result))?;
            let value = |place: usize| line.result.values.get(place).copied();
            let is_done = line.result.ended == Cause::Done.word();
            let is_invalid = line.result.ended == INVALID;
            sheet.done += 1;
            sheet.invalid += u64::from(is_invalid);
            sheet.stopped += u64::from(!is_done && !is_invalid);
            if !is_invalid {
                let collapsed = collapse.and_then(value);
                sheet.shown.push(Shown {
                    index,
                    level: task.motion.as_ref().and_then(|(_, level)| *level),
                    collapsed: !is_done || collapsed == Some(1.0),
                    values: shown
                        .iter()
                        .map(|place| value(*place).unwrap_or(f64::NAN))
                        .collect(),
                });
            }
            if chosen.contains(&index) {
                sheet.to_prove.push((line, part));
            }
        }
        progress(plan.chunk(chunk).end);
    }
    Ok(sheet)
}

/// Counts of collapses at each level, and the curve; none without levels or without a criterion.
fn fragility(study: &Study, shown: &[Shown]) -> Option<(Option<Fragility>, Vec<Level>)> {
    study.measure_at("collapse")?;
    let mut levels: Vec<Level> = Vec::new();
    for one in shown {
        let level = one.level?;
        let place = levels.iter().position(|known| known.level == level);
        let place = place.unwrap_or_else(|| {
            levels.push(Level {
                level,
                tests: 0.0,
                collapses: 0.0,
            });
            levels.len() - 1
        });
        levels[place].tests += 1.0;
        levels[place].collapses += f64::from(u8::from(one.collapsed));
    }
    levels.sort_by(|a, b| a.level.total_cmp(&b.level));
    (!levels.is_empty()).then(|| (Fragility::fit(&levels), levels))
}

fn summary(
    campaign: &Campaign,
    collected: &Collected,
    columns: &[TableColumn],
    parts: u64,
) -> Value {
    let Campaign { plan, study, .. } = campaign;
    let files = plan.files.iter();
    let files = files.map(|(name, digest)| json!({ "name": name, "blake3": digest }));
    let table = collected
        .table
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let fragility = collected.fragility.as_ref().map(|(fit, levels)| {
        json!({
            "source": "columns `intensity` and `collapse` of the table",
            "method": "lognormal, binomial maximum likelihood",
            "intensity": study.motions.first().map(|one| one.words()),
            "unit": study.motions.first().map(|one| one.unit()),
            "fit": fit,
            "levels": levels,
        })
    });
    json!({
        "title": study.title(),
        "complete": collected.is_complete(),
        "tasks": collected.tasks,
        "done": collected.done,
        "missing": collected.tasks - collected.done,
        "chunks_with_missing_tasks": collected.open,
        "stopped": collected.stopped,
        "invalid": collected.invalid,
        "table": table,
        "columns": columns,
        "fragility": fragility,
        "provenance": {
            "gusset": plan.gusset,
            "executable_blake3": plan.executable,
            "study": plan.study,
            "files": files.collect::<Vec<_>>(),
            "seed": study.loaded.study.campaign.seed,
            "parts": parts,
            "damaged_parts": collected.damaged,
            "tasks_computed_again_with_equal_bits": collected.proved,
        },
    })
}
