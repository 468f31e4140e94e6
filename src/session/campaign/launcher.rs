//! Files of launchers: one command a line, an array job of Slurm, a job file of HyperQueue.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;

use super::CampaignError;
use super::bundle::Chunks;
use super::plan::Plan;
use gusset_quantity::text::shell_word;
use gusset_quantity::units::duration;

/// The command of a worker, without its chunks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Worker<'a> {
    /// Full path of the executable.
    program: &'a str,
    /// Full path of the campaign folder.
    folder: &'a str,
}

impl<'a> Worker<'a> {
    /// The worker `program` for the campaign in `folder`.
    ///
    /// # Errors
    /// A script cannot contain a path.
    pub(super) fn new(program: &'a Path, folder: &'a Path) -> Result<Self, CampaignError> {
        Ok(Self {
            program: text(program)?,
            folder: text(folder)?,
        })
    }

    /// The command as a shell reads it.
    fn command(&self) -> String {
        let (program, folder) = (shell_word(self.program), shell_word(self.folder));
        format!("{program} campaign work {folder} --chunk")
    }
}

/// The path as text.
fn text(path: &Path) -> Result<&str, CampaignError> {
    let text = path
        .to_str()
        .filter(|text| !text.contains(char::is_control));
    text.ok_or_else(|| {
        CampaignError::Other(format!(
            "the path {path:?} has control characters or is not UTF-8, and a job script cannot contain it: move the folder"
        ))
    })
}

/// One command a line.
pub(super) fn lines(worker: &Worker<'_>, jobs: &[Chunks]) -> String {
    let command = worker.command();
    let mut text = String::new();
    for chunks in jobs {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{command} {chunks}");
    }
    text
}

/// Comments at the top of a file: the jobs and their size.
fn heading(engine: &str, plan: &Plan, jobs: &[Chunks], job: &str) -> String {
    let chunks: usize = jobs.iter().map(|chunks| chunks.iter().count()).sum();
    let each = jobs.first().map_or(0, |chunks| chunks.iter().count());
    let seconds = each as f64 * plan.tasks_per_chunk as f64 * plan.task_s;
    format!(
        "# Written by `gusset campaign submit --engine {engine}`.\n\
         # Computes {chunks} of {} chunks of simulated tests. A chunk has {} tests.\n\
         # {job} computes up to {each} chunks, in about {} on one core.\n\
         # A killed worker loses at most 15 s. Submit again to compute what is then missing.\n",
        plan.chunks(),
        plan.tasks_per_chunk,
        duration(seconds)
    )
}

/// An array job of Slurm.
pub(super) fn slurm(worker: &Worker<'_>, plan: &Plan, jobs: &[Chunks]) -> String {
    let mut list = String::new();
    for chunks in jobs {
        // Writing to a string does not fail.
        let _ = writeln!(list, "{chunks}");
    }
    let heading = heading("slurm", plan, jobs, "Each array element");
    let log = directive(&format!("{}/logs/slurm-", worker.folder));
    format!(
        "#!/bin/sh\n{heading}\
         #SBATCH --job-name=gusset\n#SBATCH --array=1-{}\n#SBATCH --ntasks=1\n#SBATCH --cpus-per-task=1\n\
         #SBATCH --output=\"{log}%A-%a.log\"\n\n\
         : \"${{SLURM_ARRAY_TASK_ID:?submit this script with sbatch}}\"\n\
         # Line K of this list has the chunks of array element K.\n\
         chunks=$(sed -n \"${{SLURM_ARRAY_TASK_ID}}p\" <<'END'\n{list}END\n)\n\
         exec {} \"$chunks\"\n",
        jobs.len(),
        worker.command()
    )
}

/// Characters of a path between the quotes of a directive of Slurm.
fn directive(path: &str) -> String {
    let mut text = String::new();
    for character in path.chars() {
        match character {
            '%' => text.push('%'),
            '\\' | '"' | '\'' | '#' => text.push('\\'),
            _ => {}
        }
        text.push(character);
    }
    text
}

/// A job of HyperQueue, as its job definition files describe it.
#[derive(Debug, Serialize)]
struct JobFile<'a> {
    name: &'static str,
    task: Vec<JobTask<'a>>,
}

/// A task of a job of HyperQueue. It needs one CPU, which is the default of HyperQueue.
#[derive(Debug, Serialize)]
struct JobTask<'a> {
    id: u64,
    command: [String; 6],
    cwd: &'a str,
    stdout: &'static str,
    stderr: &'static str,
}

/// A job file of HyperQueue. The number of a task is its first chunk.
pub(super) fn hyperqueue(
    worker: &Worker<'_>,
    plan: &Plan,
    jobs: &[Chunks],
) -> Result<String, CampaignError> {
    let Worker { program, folder } = *worker;
    let task = |chunks: &Chunks| JobTask {
        id: chunks.first(),
        command: [
            program,
            "campaign",
            "work",
            folder,
            "--chunk",
            &chunks.to_string(),
        ]
        .map(str::to_owned),
        cwd: folder,
        stdout: "none",
        stderr: "%{CWD}/logs/hyperqueue-%{JOB_ID}-%{TASK_ID}.log",
    };
    let file = JobFile {
        name: "gusset",
        task: jobs.iter().map(task).collect(),
    };
    let text = toml::to_string(&file).map_err(|error| CampaignError::Other(error.to_string()))?;
    let heading = heading("hyperqueue", plan, jobs, "Each task");
    Ok(format!("{heading}\n{text}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ODD: &str = "/a b/c'd\"%";

    fn jobs() -> Vec<Chunks> {
        vec![Chunks::of(&[1, 2, 3]), Chunks::of(&[5])]
    }

    fn plan() -> Plan {
        Plan {
            format: 1,
            gusset: "0".to_owned(),
            program: crate::campaign::Program::default(),
            study: "/s.toml".into(),
            files: Vec::new(),
            tasks: 30,
            tasks_per_chunk: 6,
            errors: Vec::new(),
            task_s: 10.0,
        }
    }

    #[test]
    fn a_line_has_the_chunks_of_a_job() {
        let worker = Worker::new(Path::new("/g"), Path::new(ODD)).unwrap();
        let text = lines(&worker, &jobs());
        let command = "/g campaign work '/a b/c'\\''d\"%' --chunk";
        assert_eq!(text, format!("{command} 1-3\n{command} 5\n"));
        for path in ["/a\nb", "/a\tb"] {
            assert!(Worker::new(Path::new(path), Path::new("/f")).is_err());
        }
    }

    #[test]
    fn slurm_script_has_one_element_per_job() {
        let worker = Worker::new(Path::new("/g"), Path::new(ODD)).unwrap();
        let text = slurm(&worker, &plan(), &jobs());
        let has = |line: &str| assert!(text.contains(&format!("\n{line}\n")), "{text}");
        has("#SBATCH --array=1-2");
        has("#SBATCH --output=\"/a b/c\\'d\\\"%%/logs/slurm-%A-%a.log\"");
        has("1-3\n5\nEND");
        has("# Computes 4 of 5 chunks of simulated tests. A chunk has 6 tests.");
    }

    #[test]
    fn hyperqueue_file_has_one_task_per_job() {
        let worker = Worker::new(Path::new("/g"), Path::new(ODD)).unwrap();
        let text = hyperqueue(&worker, &plan(), &jobs()).unwrap();
        let file: toml::Table = text.parse().unwrap();
        let tasks = file["task"].as_array().unwrap();
        let ids: Vec<_> = tasks.iter().map(|task| task["id"].as_integer()).collect();
        assert_eq!(ids, [Some(1), Some(5)]);
        let command = tasks[0]["command"].as_array().unwrap();
        let command: Vec<_> = command.iter().filter_map(toml::Value::as_str).collect();
        assert_eq!(command, ["/g", "campaign", "work", ODD, "--chunk", "1-3"]);
    }
}
