//! One test from the prepared experiment to the finished run folder: the threads, and the objects of each.
//!
//! | thread | owns | talks through |
//! |---|---|---|
//! | loop (pinned, FIFO) | engine, clock, histograms | rings of rows and events out, a bounded channel of operator requests in |
//! | writer | samples.bin, events.jsonl, the log | drains the rings every few milliseconds |
//! | sampler | the kernel's counters of the loop's thread | a bounded channel to the writer |
//! | signals | SIGINT, SIGTERM and their like | the channel of operator requests |
//! | caller | everything else | joins the rest |
//!
//! No shared mutable state with the loop, no mutex it could meet.
//!
//! Rehearsal, certificate, replay and resume are sessions on the simulated clock. [`campaign`] runs many of them for one study. This
//! member knows every other one but the command line. Begin reading with [`run`].

mod agreement;
mod archive;
mod bare;
pub mod campaign;
pub mod certificate;
mod checksum;
mod compare;
mod connect;
mod continued;
mod derived;
mod earlier_rows;
mod energetics;
pub mod fitness;
pub mod frontier;
mod guarded;
pub mod identification;
pub mod integration;
mod judged;
mod kept;
mod origin;
mod page;
mod playback;
mod ready;
mod reason;
mod recorded;
pub mod rehearsal;
mod replay;
mod replay_error;
mod request_socket;
mod reset;
mod resume;
mod retrace;
mod row_peaks;
mod sampling;
mod served_replay;
mod signals;
mod specimen_records;
mod summary;
pub(crate) mod unaware;
mod watches;

use std::sync::mpsc;
use std::time::Duration;

use thiserror::Error;

pub use agreement::SummaryDifference;
pub use bare::bare_loop;
pub(crate) use bare::loop_round;
pub use checksum::altered;
pub use compare::{Compared, compare, compared_name};
pub use continued::{Now, Unsaid, WentOn};
pub use derived::{Derived, DerivedError, FloorPeaks, derived, floor_peaks};
pub use judged::{Judged, Subject};
pub use page::{Page, PageError, conclude, hero, write_report};
pub use playback::Difference;
pub use ready::missing;
pub use reason::ending;
#[cfg(any(test, feature = "test-doubles"))]
pub use replay::replay_rows;
pub use replay::{Replay, replay};
pub use replay_error::ReplayError;
pub use request_socket::{Answer, Request, Unanswered, ask};
pub use reset::{
    ControlError, ControlPlace, RecordWords, ResetError, ServerControl, ServerRequest, ask_server,
};
#[cfg(any(test, feature = "test-doubles"))]
pub use resume::resume_over;
pub use resume::{Allowed, ResumeError, resume_allowed};
pub use signals::{Signal, Signals, Taken};
pub use specimen_records::SpecimenRecords;
pub use watches::{Attendance, Watches};

use connect::{Connections, Line};
use continued::Word;
use guarded::Ended;
use ready::{Ready, prepare};
use request_socket::RequestSocket;
use specimen_records::HeldRecords;

use gusset_config::ConfigError;
use gusset_control::engine::Control;
use gusset_proof::RecordedVerdict;
use gusset_quantity::catalog::ending::{Cause, Exit};
use gusset_quantity::catalog::event::Remark;
use gusset_record::origin::Origin;
use gusset_record::rt::wall::Wall;
use gusset_record::rt::{Granted, os};
use gusset_record::writer::WriterError;
use gusset_record::{Event, FolderError, Progress, Recorded, RunFolder, Summary, Writer};
use gusset_setup::{Facts, Prepared};

/// Why a test could not be run at all. Nothing was moved.
#[derive(Debug, Error)]
pub enum SessionError {
    /// The run folder refuses.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The interrupted test cannot record this resume.
    #[error(transparent)]
    Unsaid(#[from] Unsaid),
    /// The writer refuses.
    #[error(transparent)]
    Writer(#[from] WriterError),
    /// The rows cannot be laid out, or their queue cannot be made.
    #[error("the recording cannot be set up: {0}")]
    Recording(String),
    /// The system gives no thread.
    #[error("cannot start the loop's thread: {0}")]
    Thread(std::io::Error),
    /// A helper of the test cannot start.
    #[error("the live page cannot be served: {0}")]
    Attendance(std::io::Error),
    /// The verdict forbids the test.
    #[error("the verdict forbids this test: {}", findings.join("; "))]
    Forbidden {
        /// Every error that is not accepted.
        findings: Vec<String>,
    },
    /// The test cannot be rehearsed.
    #[error(transparent)]
    Rehearsal(#[from] ConfigError),
    /// Real-time conditions are required and were not granted.
    #[error("real-time conditions are required and not granted: {}", missing.join("; "))]
    NotRealTime {
        /// Refused requests, with reason and remedy.
        missing: Vec<String>,
    },
}

/// Results of a session.
#[derive(Debug)]
pub struct Finished {
    /// How it ended; its row has the exit code and the status.
    pub cause: Cause,
    /// The run folder. Other programs may move or delete it at any time: additions check for it.
    pub folder: RunFolder,
    /// Content of summary.json.
    pub summary: Summary,
    /// Result of the recording.
    pub recorded: Recorded,
    /// Grants of the operating system; `None` under the simulated clock.
    pub granted: Option<Granted>,
    /// Files that could not be written, each with its reason.
    pub unwritten: Vec<String>,
}

impl Finished {
    /// The exit code. An interruption has the code of its `signal`.
    #[must_use]
    pub const fn exit(&self, signal: Option<Signal>) -> Exit {
        match (self.cause.exit(), signal) {
            (Exit::Interrupted, Some(Signal::Terminate)) => Exit::Terminated,
            (exit, _) => exit,
        }
    }
}

/// Period of the caller's look at the progress.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Runs a test into `folder`. A test that is not judged yet is judged first; a verdict that forbids it ends it here, before
/// anything connects. `progress` is called about ten times a second.
///
/// # Errors
/// [`SessionError`] if the test could not be started: nothing was moved, and the folder is removed. The end of a
/// started test is not an error but [`Finished`].
pub fn run(
    test: impl Into<Subject>,
    mut folder: RunFolder,
    control: impl Into<Control>,
    mut watches: Watches,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Finished, SessionError> {
    let (test, verdict) = match permitted(test.into()) {
        Ok(permitted) => permitted,
        Err(error) => {
            folder.abandon();
            return Err(error);
        }
    };
    let Prepared {
        experiment,
        facts,
        files,
        ..
    } = test;
    let control = control.into();
    let request_socket = control
        .request_socket
        .clone()
        .map(|asks| (asks, control.phase.clone()));
    if request_socket.is_some() {
        folder.claim();
    }
    let line = Line::of(&control);
    let kept = archive::keep(&files, &mut folder).map_err(SessionError::from);
    let said = kept.and_then(|()| Ok(Word::say(&files, &experiment.ports, folder.path())?));
    let word = match said {
        Ok(word) => word,
        Err(error) => {
            folder.abandon();
            return Err(error);
        }
    };
    let records = watches.specimen_records.take();
    match prepare(experiment, &facts, &files, &mut folder, control, watches) {
        Ok(ready) => {
            let request_socket =
                request_socket.map(|(asks, phase)| RequestSocket::open(folder.path(), asks, phase));
            if let Some(Err(error)) = &request_socket {
                let text = format!("other programs cannot reach this test: {error}");
                ready.writer.note(Event::said(Remark::Warning, text));
            }
            let mut finished = carry_out(ready, (line, records), &facts, verdict, folder, progress);
            let ended = word.map_or(Ok(()), |word| word.end(&finished.folder));
            if let Err(error) = ended {
                finished.unwritten.push(error.to_string());
            }
            Ok(finished)
        }
        Err(error) => {
            word.into_iter().for_each(Word::take_back);
            folder.abandon();
            Err(error)
        }
    }
}

/// The test and its verdict, if that permits it.
fn permitted(test: Subject) -> Result<(Prepared, Option<RecordedVerdict>), SessionError> {
    let Judged { test, verdict, .. } = test.judged()?;
    if verdict.forbids() {
        let open = verdict.findings.iter().filter(|one| one.is_open());
        let findings = open.map(|one| one.finding.headline.clone()).collect();
        return Err(SessionError::Forbidden { findings });
    }
    let record = test.loaded.is_some().then(|| verdict.record());
    Ok((test, record))
}

/// From the first edge to the finished folder. Nothing here fails: a file that cannot be written is reported.
fn carry_out(
    ready: Ready,
    (line, records): (Line, Option<SpecimenRecords>),
    facts: &Facts,
    verdict: Option<RecordedVerdict>,
    mut folder: RunFolder,
    progress: &mut dyn FnMut(&Progress),
) -> Finished {
    let Ready {
        thread,
        go,
        mut experiment,
        done,
        writer,
        sampler,
        granted,
    } = ready;
    let mut facts = facts.clone();
    let began = Wall::now();
    let mut held = HeldRecords::default();
    let connected = connect::connect(&mut experiment, facts.clock, &writer, line);
    let connected = connected.and_then(|Connections { warnings, moving }| {
        if let Some(records) = &records {
            let begun = records.begin(&experiment.ports, &moving, &facts, folder.path());
            held = begun.map_err(|why| connect::let_go(&mut experiment, why))?;
        }
        Ok(warnings)
    });
    let mut ended = match connected {
        Ok(warnings) => {
            facts.warnings.extend(warnings);
            let _ = go.send(experiment);
            wait_for_the_end(&done, &writer, progress)
        }
        Err(why) => {
            drop(go);
            Ended::without_loop(Some(why))
        }
    };
    let _ = thread.join();
    drop(sampler);
    if let Some(fault) = &ended.fault {
        writer.note(Event::said(Remark::InternalError, fault.as_str()));
    }
    let last_words = ended.outcome.as_ref().map(reason::last_words);
    for (index, text) in last_words.into_iter().flatten() {
        let port = index as u32;
        writer.note(Event::LastWords { port, text });
    }
    let mut recorded = writer.finish().unwrap_or_else(|error| {
        ended.fault.get_or_insert(error.to_string());
        Recorded::default()
    });
    kept::look_over(&mut folder, &mut facts, &mut recorded);
    let mut unwritten = Vec::new();
    let span = summary::Span {
        began,
        seconds: ended.wall_ns as f64 * 1e-9,
    };
    if let Some(outcome) = &ended.outcome {
        let accepted = outcome.accepted_wiring.clone();
        let accepted = accepted.map(|reason| ("accept_wiring".to_owned(), reason));
        facts.accepted.extend(accepted);
        summary::write_timing(&folder, &outcome.pace.timing, span, &mut unwritten);
    }
    let (mut cause, mut summary) = summary::summarise(
        &facts,
        &folder,
        &ended,
        &recorded,
        granted.as_ref(),
        &unwritten,
    );
    summary.verdict = verdict;
    summary.origin = Some(Origin::new(began, folder.path()));
    if let Err(error) = folder.write_summary(&summary) {
        if facts.record_required && cause == Cause::Done {
            // A later reader takes such a record for that of a test which was killed.
            cause = Cause::RecordDamaged;
            summary.status = cause.status();
            summary.cause = Some(cause.word().to_owned());
            summary.reason = format!("{error}, and [record] required");
        }
        unwritten.push(error.to_string());
    }
    // A test that is killed before it has a summary leaves its places.
    let places = held.end(&ended);
    if !places.is_empty() {
        let texts = places.iter().map(|text| format!("not written: {text}"));
        summary.warnings.extend(texts);
        let again = folder.write_summary(&summary);
        unwritten.extend(again.err().map(|error| error.to_string()));
        unwritten.extend(places);
    }
    folder.release();
    Finished {
        cause,
        folder,
        summary,
        recorded,
        granted,
        unwritten,
    }
}

/// Shows the progress until the loop's thread reports its end.
fn wait_for_the_end(
    done: &mpsc::Receiver<Ended>,
    writer: &Writer,
    progress: &mut dyn FnMut(&Progress),
) -> Ended {
    let mut latest = Progress::default();
    loop {
        match done.recv_timeout(LOOK_EVERY) {
            Ok(ended) => break ended,
            Err(mpsc::RecvTimeoutError::Timeout) => {
                writer.progress(&mut latest);
                progress(&latest);
            }
            // The thread can end without a word only by a panic outside the engine.
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                let mut ended = Ended::without_loop(None);
                ended.fault = Some("the loop's thread died".to_owned());
                break ended;
            }
        }
    }
}

/// Lets the caller's thread rest. Not for the loop.
pub fn pause(time: Duration) {
    let nanos = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
    os::sleep_until_ns(os::monotonic_ns().saturating_add(nanos));
}
