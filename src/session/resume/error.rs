//! Why a test cannot go on.

use std::path::PathBuf;

use thiserror::Error;

use crate::config::ConfigError;
use crate::record::{FolderError, MissingEnd};
use crate::session::continued::{Now, WentOn};
use crate::session::desk::Unanswered;
use crate::session::replay::ReplayError;

/// Why a test cannot go on. Nothing was moved.
#[derive(Debug, Error)]
pub enum ResumeError {
    /// It is no run folder, it was changed, or it does not come out again.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// It ended as it should.
    #[error("{}: this test is complete: there is nothing to go on with", .0.display())]
    Complete(PathBuf),
    /// It still runs.
    #[error("{}: this test is running", .0.display())]
    Running(PathBuf),
    /// Whether it still runs is not known.
    #[error("{}: {unanswered}, but nothing says that it is over: end it, or its process, first", folder.display())]
    Unanswered {
        /// The folder.
        folder: PathBuf,
        /// Why there is no answer.
        unanswered: Unanswered,
    },
    /// Another went on with it already, and its specimens have been through the steps that follow.
    #[error("{}: {before}: {}", folder.display(), what_may_be(before))]
    WentOn {
        /// The folder.
        folder: PathBuf,
        /// The one that did.
        before: WentOn,
    },
    /// It ended before t = 0.
    #[error("{}: this test ended before its first step: run it again from its beginning", .0.display())]
    NotBegun(PathBuf),
    /// Nothing says what its files were.
    #[error("{}: its events do not say which files it was made of, so that nothing proves that they are the same", .0.display())]
    Unproven(PathBuf),
    /// Another test than the one that was interrupted.
    #[error("{} is not the test that was interrupted: its SHA-256 is {found}, but that of {} is {wanted}", given.display(), kept.display())]
    AnotherTest {
        /// As given.
        given: PathBuf,
        /// The copy in the run folder.
        kept: PathBuf,
        /// Of the copy.
        wanted: String,
        /// Of the file as given.
        found: String,
    },
    /// Its summary, which would say how it ended, cannot be read.
    #[error("{}/summary.json is damaged: {fault}: whether the test was interrupted is not known", folder.display())]
    Summary {
        /// The folder.
        folder: PathBuf,
        /// What is wrong.
        fault: String,
    },
    /// Rows at its end are missing, and what was done to the specimens in those steps is not known.
    #[error("{}: {missing}: what the specimens went through after that cannot be retraced", folder.display())]
    Short {
        /// The folder.
        folder: PathBuf,
        /// What is missing.
        missing: MissingEnd,
    },
    /// It had tripped, or may have, and nobody says that it may go on all the same.
    #[error("{}: this test {} ({reason}): look at its specimens, and say {wanted} if it may go on", folder.display(), if *has_tripped { "had tripped" } else { "may have tripped" })]
    Tripped {
        /// The folder.
        folder: PathBuf,
        /// That it had is known; otherwise what would say it cannot be read.
        has_tripped: bool,
        /// How it ended.
        reason: String,
        /// What must be said.
        wanted: String,
    },
    /// A trip that was none.
    #[error("{}: no \"{named}\" ended this test: {reason}", folder.display())]
    AnotherTrip {
        /// The folder.
        folder: PathBuf,
        /// As it was named.
        named: String,
        /// How it ended.
        reason: String,
    },
    /// The record is damaged, and specimens that are not made anew would be led once more through what came after its last
    /// checkpoint before that.
    #[error("{}: {trouble}: the test can resume only after step {step}, which repeats the last {again_s} s with {specimens}; add `--back-to-step {step}` if that is intended", folder.display())]
    Back {
        /// The folder.
        folder: PathBuf,
        /// What is wrong.
        trouble: String,
        /// Step of the checkpoint.
        step: u64,
        /// Wall time in s that the ticks took which would be made again.
        again_s: f64,
        /// Names of the specimens.
        specimens: String,
    },
    /// It goes on after another step than the one that was named.
    #[error("{}: this test resumes after step {step}, not after step {named}", folder.display())]
    AnotherStep {
        /// The folder.
        folder: PathBuf,
        /// As it was named.
        named: u64,
        /// Where it goes on.
        step: u64,
    },
    /// The record is damaged before its first checkpoint.
    #[error("{}: {trouble}, and no checkpoint is before it: the test cannot resume", folder.display())]
    Damaged {
        /// The folder.
        folder: PathBuf,
        /// What is wrong.
        trouble: String,
    },
}

/// What is left to whoever finds that a test went on already.
fn what_may_be(before: &WentOn) -> String {
    let folder = before.folder.display();
    let again = format!(
        "add `--back-to-step {}` if its specimens may repeat those steps",
        before.after
    );
    match before.now {
        Now::Running => "one test at a time moves its specimens".to_owned(),
        Now::Complete => again,
        Now::Ended => format!("resume that run (`--resume {folder}`), or {again}"),
        Now::Gone => format!("put it back and resume it, or {again}"),
    }
}

impl From<FolderError> for ResumeError {
    fn from(error: FolderError) -> Self {
        Self::Replay(error.into())
    }
}

impl From<ConfigError> for ResumeError {
    fn from(error: ConfigError) -> Self {
        Self::Replay(error.into())
    }
}
