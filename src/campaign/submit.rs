//! Commands of all chunks for other launchers. Gusset does not schedule, distribute or retry.

use std::fmt::Write as _;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::plan::Campaign;
use super::{CampaignError, at};
use crate::record::atomic;

/// Most elements of an array job: Slurm has this default (`MaxArraySize = 1001`).
const MOST_ELEMENTS: u64 = 1000;

/// A launcher of chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engine {
    /// One command a line.
    Lines,
    /// An array job of Slurm.
    Slurm,
}

/// A file for a launcher.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Submitted {
    /// The file.
    pub file: PathBuf,
    /// Output of the launcher; none if it was not started.
    pub reply: Option<String>,
}

/// Writes the file for `engine` into the campaign folder. A Slurm script is submitted if there is a command `sbatch`.
///
/// # Errors
/// [`CampaignError`]: the system refuses a file, or `sbatch` refuses the script.
pub fn submit(
    campaign: &Campaign,
    engine: Engine,
    arguments: &[String],
) -> Result<Submitted, CampaignError> {
    let folder = fs::canonicalize(&campaign.folder).map_err(at(&campaign.folder))?;
    let program = std::env::current_exe().map_err(at(Path::new("/proc/self/exe")))?;
    let work = format!("{} campaign work {}", quoted(&program), quoted(&folder));
    let chunks = campaign.plan.chunks();
    let (name, text) = match engine {
        Engine::Lines => ("lines.txt", lines(&work, chunks)),
        Engine::Slurm => ("slurm.sh", script(&work, chunks, &folder)),
    };
    let file = folder.join(name);
    atomic::write(&file, text.as_bytes()).map_err(at(&file))?;
    let reply = match engine {
        Engine::Lines => None,
        Engine::Slurm => started(&file, arguments)?,
    };
    Ok(Submitted { file, reply })
}

fn lines(work: &str, chunks: u64) -> String {
    let mut text = String::new();
    for chunk in 1..=chunks {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{work} --chunk {chunk}");
    }
    text
}

/// An array job. Each element computes one chunk, or several where there are too many.
fn script(work: &str, chunks: u64, folder: &Path) -> String {
    let each = chunks.div_ceil(MOST_ELEMENTS);
    let elements = chunks.div_ceil(each);
    let log = folder.join("slurm-%a.log");
    format!(
        "#!/bin/sh\n#SBATCH --job-name=gusset\n#SBATCH --array=1-{elements}\n#SBATCH --ntasks=1\n#SBATCH --cpus-per-task=1\n\
         #SBATCH --output={}\nset -e\nfirst=$(( (SLURM_ARRAY_TASK_ID - 1) * {each} + 1 ))\n\
         last=$(( SLURM_ARRAY_TASK_ID * {each} ))\n[ \"$last\" -le {chunks} ] || last={chunks}\n\
         for chunk in $(seq \"$first\" \"$last\"); do\n  {work} --chunk \"$chunk\"\ndone\n",
        log.display()
    )
}

/// Submits a script; none if there is no command `sbatch`.
fn started(script: &Path, arguments: &[String]) -> Result<Option<String>, CampaignError> {
    let mut sbatch = Command::new("sbatch");
    let output = match sbatch.args(arguments).arg(script).output() {
        Ok(output) => output,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(at(Path::new("sbatch"))(error)),
    };
    if !output.status.success() {
        let why = String::from_utf8_lossy(&output.stderr);
        let text = format!("sbatch refuses {}: {}", script.display(), why.trim());
        return Err(CampaignError::Other(text));
    }
    Ok(Some(String::from_utf8_lossy(&output.stdout).into_owned()))
}

/// A path in single quotes, as a shell reads it.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    format!("'{}'", text.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_job_covers_every_chunk_once() {
        for (chunks, elements) in [(1, 1), (1000, 1000), (1001, 501), (2500, 834)] {
            let text = script("work", chunks, Path::new("/a"));
            assert!(text.contains(&format!("--array=1-{elements}\n")), "{text}");
        }
        assert_eq!(lines("w", 2), "w --chunk 1\nw --chunk 2\n");
    }

    #[test]
    fn a_path_with_quotes_is_one_word_of_a_shell() {
        assert_eq!(quoted(Path::new("/a b/c'd")), "'/a b/c'\\''d'");
    }
}
