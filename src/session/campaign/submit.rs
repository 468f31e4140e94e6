//! Chunks for other launchers: only those that are still open. Gusset does not schedule, distribute or retry.

use std::ffi::OsStr;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::bundle::{bundles, open};
use super::launcher::{Worker, hyperqueue, lines, slurm};
use super::plan::Campaign;
use super::{CampaignError, at};
use gusset_quantity::text::shell_word;
use gusset_record::atomic;

/// `MaxArraySize` of Slurm without a setting. The numbers of array elements are below it.
const MAX_ARRAY_SIZE: u64 = 1001;

/// A launcher of chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engine {
    /// One command a line.
    Lines,
    /// An array job of Slurm.
    Slurm,
    /// A job of HyperQueue.
    HyperQueue,
}

impl Engine {
    /// Name of its file in the campaign folder.
    const fn file(self) -> &'static str {
        match self {
            Self::Lines => "lines.txt",
            Self::Slurm => "slurm.sh",
            Self::HyperQueue => "hyperqueue.toml",
        }
    }

    /// The words that submit its file, and how to get the command; none if the user starts the lines.
    const fn command(self) -> Option<(&'static [&'static str], &'static str)> {
        match self {
            Self::Lines => None,
            Self::Slurm => Some((
                &["sbatch"],
                "install slurm-client (Debian), or use a login node of the cluster",
            )),
            Self::HyperQueue => Some((
                &["hq", "job", "submit-file"],
                "get it from https://github.com/It4innovations/hyperqueue/releases",
            )),
        }
    }
}

/// A file for a launcher.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Prepared {
    /// The launcher.
    pub engine: Engine,
    /// The file.
    pub file: PathBuf,
    /// Number of chunks with missing tasks. All of them are in the file.
    pub open: u64,
    /// Number of jobs: lines, array elements or tasks of the launcher.
    pub jobs: u64,
}

/// Writes the file for `engine` into the campaign folder: all chunks with missing tasks, in jobs of at least `tasks_per_job`
/// tasks. Without open chunks it removes an old file and returns none.
///
/// # Errors
/// [`CampaignError`]: the size of a job makes no sense, a part is wrong, or the system refuses a file.
pub fn prepare(
    campaign: &Campaign,
    engine: Engine,
    tasks_per_job: Option<u64>,
) -> Result<Option<Prepared>, CampaignError> {
    let tasks = campaign.plan.tasks;
    if let Some(found) = tasks_per_job.filter(|found| *found > tasks) {
        return Err(CampaignError::Other(format!(
            "--tasks-per-job {found} is more than the {tasks} tasks of this campaign: give 1 to {tasks}"
        )));
    }
    let folder = fs::canonicalize(&campaign.folder).map_err(at(&campaign.folder))?;
    let program = std::env::current_exe().map_err(at(Path::new("/proc/self/exe")))?;
    // The path is wrong if the executable was replaced.
    let program = fs::canonicalize(&program).map_err(at(&program))?;
    let file = folder.join(engine.file());
    let open = open(campaign)?;
    if open.is_empty() {
        return match fs::remove_file(&file) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(at(&file)(error)),
            _ => Ok(None),
        };
    }
    let most = match engine {
        Engine::Slurm => most_elements(),
        Engine::Lines | Engine::HyperQueue => u64::MAX,
    };
    let plan = &campaign.plan;
    let jobs = bundles(&open, plan.tasks_per_chunk, tasks_per_job, most)?;
    let worker = Worker::new(&program, &folder)?;
    let text = match engine {
        Engine::Lines => lines(&worker, &jobs),
        Engine::Slurm => slurm(&worker, plan, &jobs),
        Engine::HyperQueue => hyperqueue(&worker, plan, &jobs)?,
    };
    if engine != Engine::Lines {
        let logs = folder.join("logs");
        fs::create_dir_all(&logs).map_err(at(&logs))?;
    }
    atomic::write(&file, text.as_bytes()).map_err(at(&file))?;
    Ok(Some(Prepared {
        engine,
        file,
        open: open.len() as u64,
        jobs: jobs.len() as u64,
    }))
}

/// Most elements of an array job on this cluster.
fn most_elements() -> u64 {
    let output = Command::new("scontrol").args(["show", "config"]).output();
    let text = output.map(|output| String::from_utf8_lossy(&output.stdout).into_owned());
    let size = text.ok().and_then(|text| max_array_size(&text));
    size.unwrap_or(MAX_ARRAY_SIZE).saturating_sub(1).max(1)
}

/// The value of `MaxArraySize` in the configuration that `scontrol` shows.
fn max_array_size(config: &str) -> Option<u64> {
    let mut settings = config.lines().filter_map(|line| line.split_once('='));
    let (_, value) = settings.find(|(key, _)| key.trim() == "MaxArraySize")?;
    value.trim().parse().ok()
}

/// Gives the file to its launcher with the further arguments `arguments`, and returns the answer of the launcher; none if the
/// user starts the lines.
///
/// # Errors
/// [`CampaignError`]: the command is not on the path, or refuses the file.
pub fn start(prepared: &Prepared, arguments: &[String]) -> Result<Option<String>, CampaignError> {
    let Some((words, origin)) = prepared.engine.command() else {
        return Ok(None);
    };
    let (program, rest) = (words[0], &words[1..]);
    let mut command = Command::new(program);
    command.args(rest).args(arguments).arg(&prepared.file);
    let output = match command.output() {
        Ok(output) => output,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return Err(CampaignError::NoCommand {
                command: program,
                origin,
                by_hand: shown(&command),
            });
        }
        Err(error) => return Err(at(Path::new(program))(error)),
    };
    if !output.status.success() {
        let why = String::from_utf8_lossy(&output.stderr);
        let text = format!("`{}` failed: {}", shown(&command), why.trim());
        return Err(CampaignError::Other(text));
    }
    Ok(Some(String::from_utf8_lossy(&output.stdout).into_owned()))
}

/// The command as a user types it.
fn shown(command: &Command) -> String {
    let word = |word: &OsStr| shell_word(&word.to_string_lossy());
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(word).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_of_a_cluster_is_read() {
        let text = "Configuration data\nMaxArraySize            = 51\nMaxDBDMsgs = 20008\n";
        assert_eq!(max_array_size(text), Some(51));
        assert_eq!(max_array_size("MaxArraySizes = 51"), None);
    }
}
