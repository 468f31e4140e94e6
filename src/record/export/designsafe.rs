//! A folder in the shape of a hybrid-simulation project of DesignSafe: ready to be uploaded and published.
//!
//! | folder | category there | holds |
//! |---|---|---|
//! | `global_model` | global model | the test file as given and as resolved, its inputs: enough to run it again |
//! | `coordinator` | coordinator | which program ran it, how, and what the machine granted |
//! | `coordinator_output` | coordinator output | the log, byte for byte, with all that the run left; the response history as CSV |
//! | `simulation_substructure`, `simulation_output` | the same | what was computed: its tables of the test file; its response |
//! | `experimental_substructure`, `experimental_output` | the same | one folder per specimen: its table and its channels; what was sent and measured |
//! | `analysis` | analysis | every channel with unit and meaning; scripts that read the log |
//! | `report` | report | report.html |
//!
//! `project.json` lists every file with its size and SHA-256. What the run does not have is left out and said.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::csv::Sheet;
use super::plan::{Choice, Exposed, Plan};
use super::{ExportError, Exported};
use crate::record::folder::slug;
use crate::record::run::Run;

const READERS: [(&str, &str); 2] = [
    (
        "read_samples.py",
        include_str!("../../../tools/read_samples.py"),
    ),
    (
        "read_samples.m",
        include_str!("../../../tools/read_samples.m"),
    ),
];

/// Tables of the test file that say what is computed.
const COMPUTED: [&str; 4] = ["time", "structure", "integrator", "excitation"];

/// Makes the folder, which must not be there.
pub(super) fn export(run: &Run, choice: &Choice, out: &Path) -> Result<Exported, ExportError> {
    let failed = ExportError::write(out);
    if out.symlink_metadata().is_ok() {
        return Err(ExportError::Occupied(out.to_owned()));
    }
    let plan = Plan::new(run.layout())?;
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
        sheets.push((Sheet::of(columns), file));
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
    let exported = Exported::new(run, rows, &journal);
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
        let name = out.file_name().ok_or(io::ErrorKind::InvalidInput)?;
        let process = std::process::id();
        let path = out.with_file_name(format!(".{}.partial-{process}", name.to_string_lossy()));
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

/// What the test file says, if it can be read.
struct Test {
    title: String,
    table: toml::Table,
    /// One per specimen: its number, its folder, its table.
    specimens: Vec<(usize, String, toml::Value)>,
}

impl Test {
    fn read(run: &Run) -> Self {
        let text = |name: &str| fs::read_to_string(run.path().join(name)).ok();
        let table = text("resolved.toml").or_else(|| text("test.toml"));
        let table: toml::Table = table.and_then(|text| text.parse().ok()).unwrap_or_default();
        let folder = run.path().file_name().map(|name| name.to_string_lossy());
        let title = table.get("title").and_then(toml::Value::as_str);
        let title = title.map_or_else(|| folder.unwrap_or_default().into_owned(), str::to_owned);
        let listed = table.get("specimen").and_then(toml::Value::as_array);
        let specimens = listed
            .into_iter()
            .flatten()
            .zip(1..)
            .map(|(specimen, number)| {
                let name = specimen.get("name").and_then(toml::Value::as_str);
                let folder = format!("{number}-{}", slug(name.unwrap_or("specimen")));
                (number, folder, specimen.clone())
            });
        Self {
            title,
            specimens: specimens.collect(),
            table,
        }
    }
}

/// Whether a column belongs to this specimen: `cmd_2_1`, `seq_2`.
fn is_of_specimen(name: &str, number: usize) -> bool {
    let whole = format!("_{number}");
    let counted = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let of_axis = name
        .rsplit_once('_')
        .is_some_and(|(head, axis)| counted(axis) && head.ends_with(&whole));
    let numbers = name.split('_').rev().take_while(|part| counted(part));
    of_axis || (numbers.count() == 1 && name.ends_with(&whole))
}

fn is_of_dof(name: &str) -> bool {
    let rest = name.strip_prefix(['x', 'v', 'a']);
    rest.is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|b| b.is_ascii_digit()))
}

/// Which CSV there is, and of which columns.
fn sheets_of<'a>(plan: &'a Plan, test: &Test) -> Vec<(String, Vec<&'a Exposed>)> {
    let all = plan.columns();
    let some = |wanted: &dyn Fn(&str) -> bool| -> Vec<&'a Exposed> {
        all.iter()
            .filter(|c| c.column.name == "time" || wanted(&c.column.name))
            .collect()
    };
    let mut sheets = vec![(
        "coordinator_output/response.csv".to_owned(),
        plan.contract().iter().collect(),
    )];
    let computed = some(&|name| is_of_dof(name) || name == "ground");
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
                _ => "coordinator_output",
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
            let channels = plan.columns().iter();
            let channels = channels.filter(|c| is_of_specimen(&c.column.name, *number));
            let channels: Vec<_> = channels.map(|c| &c.column).collect();
            self.json(
                &format!("experimental_substructure/{folder}/sensors.json"),
                &json!({"specimen": table.get("name"), "axes": table.get("axis"), "channels": channels}),
            )?;
        }
        let channels: Vec<_> = plan.columns().iter().map(|c| &c.column).collect();
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
        let mut files = Vec::new();
        list(self.root, self.root, &mut files)?;
        files.sort_unstable_by(|a, b| a["path"].as_str().cmp(&b["path"].as_str()));
        let summary = self.run.summary();
        self.json(
            "project.json",
            &json!({
                "title": test.title,
                "project_type": "hybrid simulation",
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

const CATEGORIES: [(&str, &str, &str); 9] = [
    (
        "global_model",
        "Global Model",
        "the test file as given (test.toml) and as resolved (resolved.toml), and copies of all files it read; `gusset run resolved.toml` runs the test again",
    ),
    (
        "coordinator",
        "Coordinator",
        "which program ran the test, its method, rate, limits and timing, and what the machine granted",
    ),
    (
        "coordinator_output",
        "Coordinator Output",
        "the log of every tick (samples.bin, described by samples.json), events, timing and summary, byte for byte; the response history as response.csv",
    ),
    (
        "simulation_substructure",
        "Simulation Substructure",
        "what was computed: structure, integration, excitation, time",
    ),
    (
        "simulation_output",
        "Simulation Output",
        "displacement, velocity and acceleration of the recorded degrees of freedom (m, m/s, m/s2)",
    ),
    (
        "experimental_substructure",
        "Experimental Substructure",
        "one folder per specimen: its table of the test file, its sensors with units and scales",
    ),
    (
        "experimental_output",
        "Experimental Output",
        "one folder per specimen: what was asked, sent and measured",
    ),
    (
        "analysis",
        "Analysis",
        "every channel with unit and meaning; scripts that read the log in Python and in MATLAB or Octave",
    ),
    (
        "report",
        "Report",
        "report.html, one file that needs nothing else",
    ),
];

fn readme(title: &str, run: &Run, notes: &[String]) -> String {
    let mut text = format!("# {title}\n\nA real-time hybrid simulation");
    if let Some(summary) = run.summary() {
        let status = serde_json::to_value(summary.status).unwrap_or_default();
        text.push_str(&format!(
            ": {} ({}), {} steps of {} s, run with Gusset {}",
            status.as_str().unwrap_or_default(),
            summary.reason,
            summary.steps,
            summary.dt,
            summary.version
        ));
    }
    text.push_str(".\n\n| folder | category | holds |\n|---|---|---|\n");
    for (folder, category, holds) in CATEGORIES {
        text.push_str(&format!("| `{folder}` | {category} | {holds} |\n"));
    }
    text.push_str(
        "\nSI units throughout: m, s, N, kg, rad; channels in the unit of a sensor say so in `analysis/channels.json`. \
         In the CSV files one row is one step, from t = 0, unless all ticks were asked for; what does not exist is empty. \
         `project.json` lists every file with its SHA-256.\n",
    );
    if !notes.is_empty() {
        text.push_str("\nTo be known:\n\n");
        for note in notes {
            text.push_str(&format!("- {note}\n"));
        }
    }
    text
}

/// Copies plain files, and folders with what is in them.
fn copy(from: &Path, to: &dyn Fn(&str) -> PathBuf) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let name = entry.file_name();
        let target = to(&name.to_string_lossy());
        let kind = entry.file_type()?;
        if kind.is_dir() {
            copy(&entry.path(), &|name| target.join(name))?;
        } else if kind.is_file() {
            if let Some(folder) = target.parent() {
                fs::create_dir_all(folder)?;
            }
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

fn list(root: &Path, folder: &Path, files: &mut Vec<Value>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(root, &path, files)?;
            continue;
        }
        let (sum, bytes) = digest(&path)?;
        let digest: String = sum.iter().map(|b| format!("{b:02x}")).collect();
        let path = path.strip_prefix(root).unwrap_or(&path);
        files.push(json!({"path": path, "bytes": bytes, "sha256": digest}));
    }
    Ok(())
}

fn digest(path: &Path) -> io::Result<(Vec<u8>, u64)> {
    let (mut file, mut sum, mut bytes) = (File::open(path)?, Sha256::new(), 0);
    let mut buffer = vec![0; 1 << 18];
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            return Ok((sum.finalize().to_vec(), bytes));
        }
        bytes += count as u64;
        sum.update(buffer.get(..count).unwrap_or_default());
    }
}
