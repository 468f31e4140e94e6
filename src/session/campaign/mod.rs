//! Campaigns: many simulated tests of one study, on one machine or on many.
//!
//! [`Study`] expands a study file into tasks. Task `i` is a function of the study and `i`, so no list of tasks is kept. [`plan()`]
//! writes a campaign folder, [`work()`] computes chunks of its tasks, and [`collect()`] merges the result parts into one table.
//! Workers share nothing but the folder: no network, no daemon, no lock.
//!
//! | file of the folder | contains |
//! |---|---|
//! | `plan.json` | digests of the files, identity of the program, number of tasks, size of a chunk |
//! | `study.toml`, `test.toml` | copies for people; workers read the originals and compare digests |
//! | `parts/chunk-K-DIGEST.part` | results of tasks of chunk K |
//! | `table.csv`, `table.parquet`, `summary.json`, `report.html` | output of `collect` |
//!
//! | module | content |
//! |---|---|
//! | `study`, `design`, `random`, `sobol`, `motions`, `task` | from the study file to the overrides and the identity of a task |
//! | `measure`, `perform` | one simulated test and the numbers of its table row |
//! | `plan`, `program`, `part`, `work` | campaign folder, identity of the program, result parts, chunks on threads |
//! | `bundle`, `launcher`, `submit` | open chunks, and job files of other launchers |
//! | `collect`, `table`, `prove` | merging, the table, recomputed tasks |
//! | `found`, `fractile`, `fragility`, `largest` | values for the report, and their statistics |
//! | `ida`, `sensitivity`, `distribution`, `pairs`, `drawing`, `page` | pictures of the report |

mod bundle;
mod collect;
mod design;
mod distribution;
mod drawing;
mod found;
pub(super) mod fractile;
mod fragility;
mod ida;
mod largest;
mod launcher;
mod measure;
mod motions;
mod page;
mod pairs;
mod part;
pub(super) mod perform;
mod plan;
mod program;
mod prove;
mod random;
mod sensitivity;
mod sobol;
mod study;
mod submit;
mod table;
mod task;
mod work;

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

pub use bundle::Chunks;
pub use collect::{Collected, Prove, collect};
pub use fragility::{Collapses, Fragility, Level};
pub use largest::Largest;
pub use plan::{Campaign, Plan, plan};
pub use program::{Program, fixed_test};
pub use study::Study;
pub use submit::{Engine, Prepared, prepare, start};
pub use work::{Status, Stop, Worked, status, work};

use gusset_config::ConfigError;
use gusset_record::FolderError;

/// Why a campaign cannot continue.
#[derive(Debug, Error)]
pub enum CampaignError {
    /// The study or its test is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The campaign folder cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The system refuses a file.
    #[error("cannot use {path}: {source}")]
    File {
        /// Which file.
        path: PathBuf,
        /// Reason from the system.
        source: io::Error,
    },
    /// The folder has no plan.
    #[error(
        "{0} is not a campaign folder: it has no plan.json. `gusset campaign plan STUDY.toml --out DIR` makes one"
    )]
    NoPlan(PathBuf),
    /// The plan belongs to another version of the program.
    #[error(
        "the plan {path} has format {found}, and this version of gusset reads format {wanted}: plan the campaign again"
    )]
    Version {
        /// The plan.
        path: PathBuf,
        /// Its format.
        found: u64,
        /// The format of this version.
        wanted: u64,
    },
    /// The plan was made by another program.
    #[error(
        "the plan {path} was made by another gusset program: use that program, or plan the campaign again. These differ:{differences}"
    )]
    Program {
        /// The plan.
        path: PathBuf,
        /// A line for each difference.
        differences: String,
    },
    /// A file has changed since the plan.
    #[error("{0} has changed since the plan: restore it, or plan the campaign again")]
    Changed(String),
    /// There is no such chunk.
    #[error("there is no chunk {found}: this campaign has the chunks 1 to {last}")]
    NoChunk {
        /// The number that was asked for.
        found: u64,
        /// The last chunk.
        last: u64,
    },
    /// Two results of one task differ.
    #[error(
        "task {task} has two different results, in the parts {one} and {other}: the machines that computed them do not agree. Remove \
         the wrong part from the folder; its tasks are computed again"
    )]
    Conflict {
        /// Number of the task, from 1.
        task: u64,
        /// A part.
        one: String,
        /// Another part.
        other: String,
    },
    /// A computed result differs from that of a part.
    #[error(
        "task {task} has other bits when it is computed again: {part} is wrong and does not count any more (it is renamed). \
         `gusset campaign run {}` computes its tasks again", folder.display()
    )]
    Refuted {
        /// Number of the task, from 1.
        task: u64,
        /// The part.
        part: String,
        /// The campaign.
        folder: PathBuf,
    },
    /// A part belongs to another campaign.
    #[error("{0} belongs to another campaign: remove it from the folder")]
    Foreign(String),
    /// The command of a launcher is missing.
    #[error(
        "there is no command {command} on the path: {origin}. This submits the file by hand:\n  {by_hand}"
    )]
    NoCommand {
        /// The command.
        command: &'static str,
        /// How to get it.
        origin: &'static str,
        /// The command that submits the file by hand.
        by_hand: String,
    },
    /// The user stopped the collection.
    #[error("stopped before the results were collected")]
    Stopped,
    /// Another reason.
    #[error("{0}")]
    Other(String),
}

/// An error of the system at `path`.
fn at(path: &Path) -> impl FnOnce(io::Error) -> CampaignError + '_ {
    |source| CampaignError::File {
        path: path.to_owned(),
        source,
    }
}
