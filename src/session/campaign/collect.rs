//! Merging of the result parts: the table, the summary and the report.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::design::is_among;
pub use super::found::Collected;
use super::found::Shown;
use super::fragility::{Collapses, Fragility, Level};
use super::largest::Leaders;
use super::measure::End;
use super::page::render;
use super::part::{Lines, Parts, merge, names};
use super::perform::{Performed, why_invalid};
use super::plan::Campaign;
pub use super::prove::Prove;
use super::prove::{Choice, prove};
use super::study::Study;
use super::table::{Tables, cells, columns};
use super::task::Task;
use super::work::Stop;
use super::{CampaignError, at};
use gusset_record::atomic;
use gusset_record::cell::TableColumn;
use gusset_record::filed::pairs;
use gusset_record::origin::Origin;
use gusset_record::rt::wall::Wall;

const SUMMARY: &str = "summary.json";
const REPORT: &str = "report.html";
/// Most chunks with missing tasks that a summary names.
const MOST_NAMED: usize = 100;
/// Most tests in the pictures. More tasks do not need more memory: pictures then show a random choice of this number.
const MOST_SHOWN: u64 = 200_000;
/// Most points of the design with a fragility curve.
const MOST_POINTS: u64 = 20;

/// Counts and rows of a collection in progress.
#[derive(Default)]
struct Sheet {
    found: Collected,
    first_invalid: Option<u64>,
    parts: u64,
    shown: Vec<Shown>,
    /// Counts of collapses at the first points of the design.
    levels: BTreeMap<u64, Vec<Level>>,
    /// For each measure with pictures.
    largest: Vec<Leaders>,
}

/// Merges the parts of a campaign and writes table, summary and report. `jobs` threads compute the chosen tasks again.
///
/// # Errors
/// [`CampaignError`]: two results of one task differ, a part belongs to another campaign, the system refuses a file, or `stop` returns
/// true. The files of an earlier collection then stay.
pub fn collect(
    campaign: &Campaign,
    wanted: Prove,
    jobs: usize,
    stop: &Stop<'_>,
    progress: &dyn Fn(u64),
) -> Result<Collected, CampaignError> {
    let study = &campaign.study;
    let columns = columns(study);
    remove_drafts(&campaign.folder)?;
    let choice = wanted.drawn()?;
    let about = study.loaded.test.file.about.as_json();
    let origin = Origin::new(Wall::now(), &campaign.folder);
    // Equal results are equal bytes, so the table has no date.
    let mut tables = Tables::create(&campaign.folder, &columns, pairs(about.as_ref(), None))?;
    let sheet = merged(
        campaign,
        &mut tables,
        &|lines| match stop() {
            true => Err(CampaignError::Stopped),
            false => prove_some(campaign, choice, lines, jobs, stop),
        },
        progress,
    )?;
    let mut collected = Collected {
        table: tables.finish(sheet.found.is_complete())?,
        report: campaign.folder.join(REPORT),
        invalid_example: sheet.first_invalid.and_then(|index| example(study, index)),
        proof_seed: choice.seed,
        fragility: fragility(study, sheet.levels),
        largest: sheet.largest.into_iter().map(Leaders::into_all).collect(),
        ..sheet.found
    };
    collected.summary = summary(campaign, &collected, &columns, sheet.parts);
    collected.summary["about"] = json!(about);
    collected.summary["origin"] = json!(origin);
    let path = campaign.folder.join(SUMMARY);
    let text = serde_json::to_string_pretty(&collected.summary).unwrap_or_default();
    atomic::write(&path, (text + "\n").as_bytes()).map_err(at(&path))?;
    let mut filed = pairs(about.as_ref(), Some(&origin));
    filed.retain(|(name, _)| *name != "run_folder");
    let page = render(campaign, &collected, &sheet.shown, &filed);
    atomic::write(&collected.report, page.as_bytes()).map_err(at(&collected.report))?;
    Ok(collected)
}

/// Removes the drafts of killed collections and workers. Files of running ones stay.
fn remove_drafts(folder: &Path) -> Result<(), CampaignError> {
    let parts = folder.join(super::part::FOLDER);
    let is_table = |name: &str| name.starts_with("table.");
    let is_result = |name: &str| is_table(name) || [SUMMARY, REPORT].contains(&name);
    atomic::remove_abandoned(folder, is_result).map_err(at(folder))?;
    if parts.exists() {
        let is_part = |name: &str| name.ends_with(".part");
        atomic::remove_abandoned(&parts, is_part).map_err(at(&parts))?;
    }
    Ok(())
}

/// Computes the chosen tasks of a chunk again, and returns their number.
fn prove_some(
    campaign: &Campaign,
    choice: Choice,
    lines: &Lines,
    jobs: usize,
    stop: &Stop<'_>,
) -> Result<u64, CampaignError> {
    let chosen = lines
        .values()
        .filter(|(line, _)| choice.has(line.index, campaign.plan.tasks));
    let chosen: Vec<_> = chosen.cloned().collect();
    prove(campaign, &chosen, jobs, stop)?;
    if stop() {
        return Err(CampaignError::Stopped);
    }
    Ok(chosen.len() as u64)
}

/// Writes the rows of all results, chunk by chunk, and keeps the input of pictures. `prove` sees the results of each
/// chunk.
fn merged(
    campaign: &Campaign,
    tables: &mut Tables,
    prove: &dyn Fn(&Lines) -> Result<u64, CampaignError>,
    progress: &dyn Fn(u64),
) -> Result<Sheet, CampaignError> {
    let (study, plan) = (&campaign.study, &campaign.plan);
    let mut found = names(&campaign.folder)?;
    let own = plan.digest();
    let mut sheet = Sheet {
        found: Collected {
            tasks: plan.tasks,
            ..Collected::default()
        },
        largest: study
            .reported()
            .iter()
            .map(|_| Leaders::default())
            .collect(),
        ..Sheet::default()
    };
    for chunk in 1..=plan.chunks() {
        let paths = found.remove(&chunk).unwrap_or_default();
        sheet.parts += paths.len() as u64;
        let Parts { lines, damaged, .. } =
            merge(&paths, &own, |index| campaign.identity(chunk, index))?;
        sheet.found.damaged.extend(damaged);
        let tasks = plan.chunk(chunk);
        let open = &mut sheet.found.open;
        if (lines.len() as u64) < tasks.end - tasks.start && open.len() < MOST_NAMED {
            open.push(chunk);
        }
        sheet.found.proved += prove(&lines)?;
        for (index, (line, _)) in &lines {
            let task = Task::of(study, *index).attempted(study, line.result.attempt);
            tables.row(cells(study, &task, &line.result))?;
            sheet.count(campaign, &task, &line.result);
        }
        progress(tasks.end);
    }
    Ok(sheet)
}

impl Sheet {
    /// Counts a result, and keeps its values for the pictures.
    fn count(&mut self, campaign: &Campaign, task: &Task, result: &Performed) {
        let study = &campaign.study;
        let value = |place: usize| result.values.get(place).copied();
        let end = result.end();
        let found = &mut self.found;
        found.done += 1;
        if end == End::Invalid {
            found.invalid += 1;
            self.first_invalid.get_or_insert(task.index);
            return;
        }
        found.stopped += u64::from(end != End::Whole);
        let criterion = study.measure_at("collapse");
        let collapsed = match (criterion.and_then(value), end) {
            (Some(value), _) => (!value.is_nan()).then_some(value > 0.5),
            (None, End::Stopped) => None,
            (None, end) => Some(end == End::Diverged),
        };
        found.redrawn += u64::from(result.attempt > 0);
        found.collapsed += u64::from(collapsed == Some(true));
        found.censored += u64::from(collapsed.is_none());
        let level = task.motion.as_ref().and_then(|(_, level)| *level);
        if let (Some(level), Some(_)) = (level, criterion) {
            let point = study.point_of(task.index);
            if point < MOST_POINTS {
                count_at(self.levels.entry(point).or_default(), level, collapsed);
            }
        }
        let values: Vec<f64> = study
            .reported()
            .into_iter()
            .map(|place| value(place).unwrap_or(f64::NAN))
            .collect();
        for (leaders, value) in self.largest.iter_mut().zip(&values) {
            leaders.take(task.index + 1, result.attempt, *value);
        }
        let seed = study.loaded.study.campaign.seed;
        if is_among(seed, "shown", task.index, MOST_SHOWN, campaign.plan.tasks) {
            self.shown.push(Shown {
                index: task.index,
                level,
                collapsed,
                end,
                attempt: result.attempt,
                values,
            });
        }
    }
}

fn count_at(levels: &mut Vec<Level>, level: f64, collapsed: Option<bool>) {
    let place = levels.binary_search_by(|known| known.level.total_cmp(&level));
    let place = place.unwrap_or_else(|place| {
        let new = Level {
            level,
            tests: 0.0,
            collapses: 0.0,
            censored: 0.0,
        };
        levels.insert(place, new);
        place
    });
    let level = &mut levels[place];
    match collapsed {
        Some(collapsed) => {
            level.tests += 1.0;
            level.collapses += f64::from(u8::from(collapsed));
        }
        None => level.censored += 1.0,
    }
}

/// Why the task `index` has no valid test.
fn example(study: &Study, index: u64) -> Option<String> {
    let why = why_invalid(study, &Task::of(study, index))?;
    Some(format!("task {}: {}", index + 1, why.trim_end()))
}

/// The curves through counts of collapses, point by point: a curve belongs to one structure.
fn fragility(study: &Study, levels: BTreeMap<u64, Vec<Level>>) -> Vec<Collapses> {
    let each = levels.into_iter().map(|(point, levels)| Collapses {
        point: study.point_words(point),
        fit: Fragility::fit(&levels),
        levels,
    });
    each.collect()
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
    // A single curve is written alone; several are a list.
    let only = match collected.fragility.as_slice() {
        [only] => Some(only),
        _ => None,
    };
    let fragility = (!collected.fragility.is_empty()).then(|| {
        json!({
            "source": "columns `intensity` and `collapse` of the table",
            "method": "lognormal, binomial maximum likelihood",
            "intensity": study.levelled().map(|one| one.words()),
            "unit": study.levelled().map(|one| one.unit()),
            "fit": only.and_then(|one| one.fit),
            "levels": only.map(|one| &one.levels),
            "points": collected.fragility,
        })
    });
    let errors = plan.errors.iter();
    let errors = errors.map(|(task, errors)| json!({ "task": task, "errors": errors }));
    let reported = study.reported().into_iter().zip(&collected.largest);
    let largest = reported
        .map(|(place, tasks)| json!({ "measure": study.measures[place].name, "tasks": tasks }));
    json!({
        "title": study.title(),
        "complete": collected.is_complete(),
        "tasks": collected.tasks,
        "done": collected.done,
        "missing": collected.tasks - collected.done,
        "chunks_with_missing_tasks": collected.open,
        "stopped": collected.stopped,
        "collapsed": collected.collapsed,
        "censored": collected.censored,
        "redrawn": collected.redrawn,
        "invalid": collected.invalid,
        "invalid_example": collected.invalid_example,
        "errors": errors.collect::<Vec<_>>(),
        "table": table,
        "columns": columns,
        "fragility": fragility,
        "largest": largest.collect::<Vec<_>>(),
        "provenance": {
            "gusset": plan.gusset,
            "program_blake3": plan.program.digest(),
            "program": plan.program,
            "study": plan.study,
            "files": files.collect::<Vec<_>>(),
            "seed": study.loaded.study.campaign.seed,
            "parts": parts,
            "damaged_parts": collected.damaged,
            "tasks_computed_again_with_equal_bits": collected.proved,
            "prove_seed": collected.proof_seed,
        },
    })
}
