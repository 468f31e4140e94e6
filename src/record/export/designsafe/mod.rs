//! A folder in the shape of a hybrid-simulation project of DesignSafe: ready to be uploaded and published.
//!
//! | folder | category there | holds |
//! |---|---|---|
//! | `global_model` | global model | the test file as given and as resolved, its inputs: enough to run it again |
//! | `coordinator` | coordinator | which program ran it, how, and what the machine granted |
//! | `coordinator_output` | coordinator output | in `log` the log, byte for byte, with all that the run left; the response history as CSV |
//! | `simulation_substructure`, `simulation_output` | the same | what was computed: its tables of the test file; its response |
//! | `experimental_substructure`, `experimental_output` | the same | one folder per specimen: its table and its channels; what was sent and measured |
//! | `analysis` | analysis | every channel with unit and meaning; scripts that read the log |
//! | `report` | report | report.html |
//!
//! `project.json` lists every file with its size and SHA-256, and `designsafe.json` has what DesignSafe asks for. What the run does not have is left out and said.

mod entity;
mod files;
mod readme;
pub(super) mod test;

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use entity::{authors, entity, unfiled};
use files::{copy, list};
use readme::{CATEGORIES, readme};
use test::Test;

use super::csv::Sheet;
use super::plan::{Choice, Exposed, Plan};
use super::{ExportError, Exported, Extra};
use crate::atomic;
use crate::run::Run;
use gusset_quantity::catalog::column::{self, Each, GROUND};

const READERS: [(&str, &str); 2] = [
    (
        "read_samples.py",
        include_str!("../../../../tools/read_samples.py"),
    ),
    (
        "read_samples.m",
        include_str!("../../../../tools/read_samples.m"),
    ),
];

/// Tables of the test file that describe the numerical part.
const COMPUTED: [&str; 4] = ["time", "structure", "integrator", "excitation"];

/// Makes the folder, which must not be there.
pub(super) fn export(
    run: &Run,
    choice: &Choice,
    extra: &Extra,
    out: &Path,
) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    if out.symlink_metadata().is_ok() {
        return Err(ExportError::Occupied(out.to_owned()));
    }
    let plan = Plan::new(run.layout(), &extra.sums)?;
    let staging = Staging::beside(out).map_err(failed)?;
    let test = Test::read(run);
    let mut project = Project {
        run,
        root: &staging.path,
        missing: Vec::new(),
    };
    project.copy_all().map_err(failed)?;
    project.describe(&plan, &test).map_err(failed)?;

    let mut sheets = Vec::new();
    for (path, columns) in sheets_of(&plan, &test) {
        let file = BufWriter::new(project.create(&path).map_err(failed)?);
        let sheet = if extra.units_line {
            Sheet::of(columns.iter().copied()).with_units(columns)
        } else {
            Sheet::of(columns)
        };
        sheets.push((sheet, file));
    }
    for (sheet, file) in &mut sheets {
        sheet.head(file).map_err(failed)?;
    }
    let mut journal = run.journal()?;
    let mut line = Vec::new();
    let rows = plan
        .walk(&mut journal, choice, u64::MAX, |_, row| {
            sheets.iter_mut().try_for_each(|(sheet, file)| {
                sheet.line(row, &mut line)?;
                file.write_all(&line)
            })
        })
        .map_err(|trouble| trouble.told(failed))?;
    for (_, file) in sheets {
        let file = file
            .into_inner()
            .map_err(|error| failed(error.into_error()))?;
        file.sync_all().map_err(failed)?;
    }
    let mut exported = Exported::new(run, rows, &journal).of_table(&plan);
    exported.notices.extend(unfiled(run));
    project.close(&test, &exported).map_err(failed)?;
    staging.commit(out).map_err(failed)?;
    Ok(exported)
}

/// A folder under way. Dropped without [`Staging::commit`], it leaves nothing.
struct Staging {
    path: PathBuf,
}

impl Staging {
    fn beside(out: &Path) -> io::Result<Self> {
        let path = atomic::partial_of(out)?;
        fs::create_dir(&path)?;
        Ok(Self { path })
    }

    fn commit(self, out: &Path) -> io::Result<()> {
        fs::rename(&self.path, out)
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        let _it_may_have_moved = fs::remove_dir_all(&self.path);
    }
}

/// The CSV files, and the columns of each.
fn sheets_of<'a>(plan: &'a Plan, test: &Test) -> Vec<(String, Vec<&'a Exposed>)> {
    let all = &plan.columns;
    let some = |wanted: &dyn Fn(&str) -> bool| -> Vec<&'a Exposed> {
        all.iter()
            .filter(|c| c.column.name == "time" || wanted(&c.column.name))
            .collect()
    };
    let mut sheets = vec![(
        "coordinator_output/response.csv".to_owned(),
        plan.csv_columns().iter().collect(),
    )];
    let computed = some(&|name| {
        column::find(name).is_some_and(|kind| kind.each == Each::Dof) || GROUND.fits(name)
    });
    if computed.len() > 1 {
        sheets.push(("simulation_output/response.csv".to_owned(), computed));
    }
    for (number, folder, _) in &test.specimens {
        let measured = some(&|name| is_of_specimen(name, *number));
        sheets.push((
            format!("experimental_output/{folder}/measured.csv"),
            measured,
        ));
    }
    sheets
}

struct Project<'a> {
    run: &'a Run,
    root: &'a Path,
    missing: Vec<&'static str>,
}

impl Project<'_> {
    fn create(&self, path: &str) -> io::Result<File> {
        let path = self.root.join(path);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        File::create_new(path)
    }

    fn write(&self, path: &str, text: &str) -> io::Result<()> {
        let mut file = self.create(path)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()
    }

    fn json(&self, path: &str, value: &Value) -> io::Result<()> {
        self.write(path, &format!("{value:#}\n"))
    }

    fn toml(&self, path: &str, table: &toml::Table) -> io::Result<()> {
        let text = toml::to_string_pretty(table).map_err(io::Error::other)?;
        self.write(path, &text)
    }

    /// Every file of the run, byte for byte.
    fn copy_all(&mut self) -> io::Result<()> {
        for name in ["test.toml", "resolved.toml", "report.html", "events.jsonl"] {
            if !self.run.path().join(name).is_file() {
                self.missing.push(name);
            }
        }
        copy(self.run.path(), &|name| {
            let folder = match name {
                "test.toml" | "resolved.toml" | "inputs" => "global_model",
                "report.html" => "report",
                _ => "coordinator_output/log",
            };
            self.root.join(folder).join(name)
        })
    }

    fn describe(&self, plan: &Plan, test: &Test) -> io::Result<()> {
        let summary = self.run.summary();
        let of =
            |key: &str| summary.map(|s| serde_json::to_value(s).unwrap_or_default()[key].clone());
        self.json(
            "coordinator/coordinator.json",
            &json!({
                "program": "Gusset",
                "version": of("version"),
                "integrator": test.table.get("integrator"),
                "lambda": of("lambda"),
                "step_s": of("dt"),
                "rate_hz": of("rate_hz"),
                "clock": of("clock"),
                "realtime": of("realtime"),
                "limits": of("limits"),
                "timing_us": of("timing"),
                "deadline_misses": of("deadline_misses"),
                "link": of("link"),
            }),
        )?;
        let computed = test.table.iter();
        let computed = computed.filter(|(key, _)| COMPUTED.contains(&key.as_str()));
        let computed: toml::Table = computed.map(|(k, v)| (k.clone(), v.clone())).collect();
        self.toml("simulation_substructure/model.toml", &computed)?;
        for (number, folder, table) in &test.specimens {
            let whole = toml::Table::from_iter([("specimen".to_owned(), table.clone())]);
            self.toml(
                &format!("experimental_substructure/{folder}/specimen.toml"),
                &whole,
            )?;
            let channels = plan.columns.iter();
            let channels = channels.filter(|c| is_of_specimen(&c.column.name, *number));
            let channels: Vec<_> = channels.map(|c| &c.column).collect();
            self.json(
                &format!("experimental_substructure/{folder}/sensors.json"),
                &json!({"specimen": table.get("name"), "axes": table.get("axis"), "channels": channels}),
            )?;
        }
        let channels: Vec<_> = plan.columns.iter().map(|c| &c.column).collect();
        self.json("analysis/channels.json", &json!({ "channels": channels }))?;
        for (name, text) in READERS {
            self.write(&format!("analysis/{name}"), text)?;
        }
        Ok(())
    }

    /// README and list of files: last, when everything else is there.
    fn close(&self, test: &Test, exported: &Exported) -> io::Result<()> {
        let mut notes: Vec<String> = exported.notices.iter().map(ToString::to_string).collect();
        notes.extend(
            self.missing
                .iter()
                .map(|name| format!("the run has no {name}")),
        );
        self.write("README.md", &readme(&test.title, self.run, &notes))?;
        self.json("designsafe.json", &entity(test, self.run))?;
        let about = self.run.about().unwrap_or_default();
        let mut files = Vec::new();
        list(self.root, self.root, &mut files)?;
        files.sort_unstable_by(|a, b| a["path"].as_str().cmp(&b["path"].as_str()));
        let summary = self.run.summary();
        self.json(
            "project.json",
            &json!({
                "title": test.title,
                "project_type": "hybrid simulation",
                "about": about,
                "authors": authors(&about),
                "licence": about["licence"],
                "keywords": about["keywords"],
                "origin": self.run.origin(),
                "categories": CATEGORIES.map(|(folder, category, _)| json!({"folder": folder, "category": category})),
                "specimens": test.specimens.iter().map(|(_, folder, _)| folder).collect::<Vec<_>>(),
                "status": summary.map(|s| s.status),
                "reason": summary.map(|s| s.reason.as_str()),
                "steps": summary.map(|s| s.steps),
                "step_s": summary.map(|s| s.dt),
                "rows_of_csv": exported.rows,
                "notes": notes,
                "files": files,
            }),
        )
    }
}
/// Whether a column belongs to this specimen.
fn is_of_specimen(name: &str, number: u32) -> bool {
    column::find(name).and_then(|kind| kind.specimen_in(name)) == Some(number)
}
