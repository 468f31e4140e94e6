//! Why a test cannot resume.

use std::path::PathBuf;

use thiserror::Error;

use crate::continued::{Now, WentOn};
use crate::replay_error::ReplayError;
use crate::request_socket::Unanswered;
use gusset_config::ConfigError;
use gusset_control::port::limits::Hit;
use gusset_record::{FolderError, MissingEnd};

/// Why a test cannot resume. Nothing was moved.
#[derive(Debug, Error)]
pub enum ResumeError {
    /// It is no run folder, it was changed, or it cannot be reproduced.
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
    /// Another test resumed it already, and its specimens have made the steps that follow.
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
    /// The events do not list its files.
    #[error("{}: its events do not say which files it was made of, so that nothing proves that they are the same", .0.display())]
    Unproven(PathBuf),
    /// Another test than the one that was interrupted.
    #[error("{} is not the test that was interrupted: its SHA-256 is {found}, but that of {} is {wanted}", given.display(), kept.display())]
    AnotherTest {
        /// As given.
        given: PathBuf,
        /// The copy in the run folder.
        kept: PathBuf,
        /// SHA-256 of the copy.
        wanted: String,
        /// SHA-256 of the file as given.
        found: String,
    },
    /// Its summary, which contains its end, cannot be read.
    #[error("{}/summary.json is damaged: {fault}: whether the test was interrupted is not known", folder.display())]
    Summary {
        /// The folder.
        folder: PathBuf,
        /// The fault.
        fault: String,
    },
    /// Rows at its end are missing, and the motions of the specimens in those steps are not known.
    #[error("{}: {missing}: what the specimens went through after that cannot be retraced", folder.display())]
    Short {
        /// The folder.
        folder: PathBuf,
        /// The missing rows.
        missing: MissingEnd,
    },
    /// It tripped, or may have tripped, and `--after-trip` is missing.
    #[error(
        "{}: this test {} ({names}): {reason}\ninspect its specimens; then add `--after-trip` if it may resume",
        folder.display(),
        if *certain { "had tripped" } else { "may have tripped" }
    )]
    Tripped {
        /// The folder.
        folder: PathBuf,
        /// False if the record does not show whether it tripped.
        certain: bool,
        /// Everything that tripped.
        names: String,
        /// How it ended.
        reason: String,
    },
    /// The record is damaged, and specimens behind links would repeat too much of the test.
    #[error(
        "{}: {trouble}: the record is damaged and cannot be resumed; the last checkpoint before the damage is step {step}, and {specimens} \
         would repeat {again_s} s; start a new test",
        folder.display()
    )]
    Back {
        /// The folder.
        folder: PathBuf,
        /// The damage.
        trouble: String,
        /// Step of the checkpoint.
        step: u64,
        /// Wall time in s of the ticks after it.
        again_s: f64,
        /// Names of the specimens.
        specimens: String,
    },
    /// The changed key is not a limit.
    #[error("`--set {0}`: a resumed test keeps its configuration; only its limits may be widened")]
    NoLimit(String),
    /// A limit was to be narrowed, or added.
    #[error(
        "`--set {key}` is {new}, and the interrupted test had {old}: a limit may only be widened"
    )]
    Narrower {
        /// The key.
        key: String,
        /// Its value in the interrupted test.
        old: String,
        /// The value of the user.
        new: String,
    },
    /// The command that would leave next is beyond a limit.
    #[error(
        "specimen \"{specimen}\", {hit}: the next command of this test is beyond its limit, so that it would trip again; widen \
         the limit: `--set specimen.{index}.limits.{}.trip=[lowest, highest] --reason \"...\"`",
        hit.quantity.key()
    )]
    NextBeyond {
        /// Name of the specimen.
        specimen: String,
        /// Its place in the file, from 0.
        index: usize,
        /// The limit, with the number.
        hit: Hit,
    },
    /// The record is damaged before its first checkpoint.
    #[error("{}: {trouble}, and no checkpoint is before it: the test cannot resume", folder.display())]
    Damaged {
        /// The folder.
        folder: PathBuf,
        /// The damage.
        trouble: String,
    },
}

/// Advice for a test that was resumed already.
fn what_may_be(before: &WentOn) -> String {
    match before.now {
        Now::Running => "one test at a time moves its specimens".to_owned(),
        Now::Complete => "a test is resumed once; start a new test".to_owned(),
        Now::Ended => format!("resume that run (`--resume {}`)", before.folder.display()),
        Now::Gone => "put it back and resume it".to_owned(),
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
