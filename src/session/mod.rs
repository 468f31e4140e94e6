//! One test from the prepared experiment to the finished run folder: the threads, and what each owns.
//!
//! | thread | owns | talks through |
//! |---|---|---|
//! | loop (pinned, FIFO) | engine, clock, histograms | rings of rows and events out, a bounded channel of operator requests in |
//! | writer | samples.bin, events.jsonl, the log | drains the rings every few milliseconds |
//! | sampler | the kernel's counters of the loop's thread | a bounded channel to the writer |
//! | signals | SIGINT, SIGTERM | the channel of operator requests |
//! | caller | everything else | joins the rest |
//!
//! No shared mutable state with the loop, no mutex it could meet.

mod bare;
mod page;
mod signals;
mod summary;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::mpsc;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender};
use thiserror::Error;

pub use bare::bare_loop;
pub use page::{PageError, hero, write_report};
pub use signals::{Signal, Signals};

use crate::config::{ClockChoice, Prepared};
use crate::engine::{Control, Engine, Experiment, Operator, Outcome, Watch};
use crate::record::writer::{Clocks, WriterError};
use crate::record::{
    FolderError, Layout, Note, NoteLevel, Progress, Recorded, RingSize, RunFolder, SchedSample,
    Summary, WhenFull, Writer, WriterSettings, ring,
};
use crate::rt::sampler::{Sampler, SchedSample as SamplerReading};
use crate::rt::wall::Wall;
use crate::rt::{Granted, RtPlan, apply, os, pin_away};
use crate::substructure::Retirement;
use crate::time::{Clock, SimClock};

/// Why a test could not be run at all. Nothing was moved.
#[derive(Debug, Error)]
pub enum SessionError {
    /// The run folder refuses.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The writer refuses.
    #[error(transparent)]
    Writer(#[from] WriterError),
    /// The rows cannot be laid out, or their queue cannot be made.
    #[error("the recording cannot be set up: {0}")]
    Recording(String),
    /// The system gives no thread.
    #[error("cannot start the loop's thread: {0}")]
    Thread(std::io::Error),
    /// Real-time conditions are required and were not granted.
    #[error("real-time conditions are required and not granted: {}", missing.join("; "))]
    NotRealTime {
        /// What was refused, why, and what to do about it.
        missing: Vec<String>,
    },
}

/// How a session ended, for the exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finish {
    /// At its last step, within its limits.
    Completed,
    /// Stopped by a limit, divergence, a stale or miss bound.
    Stopped,
    /// By the operator.
    Interrupted,
    /// A link or peer failed.
    LinkFailed,
    /// A panic of our own, caught; the specimens are retired.
    Panicked,
}

/// Why there is no outcome.
#[derive(Debug)]
enum NoOutcome {
    /// The loop panicked.
    Panic(String),
    /// A specimen could not be connected; the loop never ran.
    Link(String),
}

/// What a session leaves behind.
#[derive(Debug)]
pub struct Finished {
    /// How it ended.
    pub finish: Finish,
    /// The run folder.
    pub path: PathBuf,
    /// What stands in summary.json.
    pub summary: Summary,
    /// What the recording came to.
    pub recorded: Recorded,
    /// What the operating system gave; none under the simulated clock.
    pub granted: Option<Granted>,
}

/// Guards that a test may put on the loop's own thread, round the ticks.
#[derive(Default)]
pub struct Watches {
    /// Called when the warm-up is over.
    pub before_first_tick: Option<Watch>,
    /// Called when the last tick is over.
    pub after_last_tick: Option<Watch>,
}

impl std::fmt::Debug for Watches {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Watches")
    }
}

/// Period of the caller's look at the progress.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// What the loop's thread says when it is ready, before anything moves.
struct Ready {
    granted: Option<Granted>,
    thread_id: i32,
}

/// Runs a prepared test into `folder`. `progress` is called about ten times a second.
///
/// # Errors
/// [`SessionError`] if the test could not be started; how a started test ended is not an error but [`Finished`].
pub fn run(
    test: Prepared,
    mut folder: RunFolder,
    requests: Receiver<Operator>,
    watches: Watches,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Finished, SessionError> {
    os::ignore_file_size_signal();
    let Prepared {
        mut experiment,
        mut facts,
        files,
    } = test;
    folder.write_test(&files.test)?;
    folder.write_resolved(&files.resolved)?;
    for (path, bytes) in &files.inputs {
        folder.add_input(path, bytes)?;
    }
    let columns = experiment.columns();
    let layout = Layout::new(columns).map_err(|e| SessionError::Recording(e.to_string()))?;
    let samples = folder.open_samples(&layout)?;
    let events = folder.open_events()?;
    let real = facts.clock == ClockChoice::Real;
    let size = RingSize::for_rate(layout.columns().len(), facts.rate_hz, facts.queue_s);
    let when_full = if real { WhenFull::Drop } else { WhenFull::Wait };
    let (recorder, reader) = ring(layout.columns().len(), size, when_full)
        .map_err(|e| SessionError::Recording(e.to_string()))?;
    let (sample_in, sample_out) = crossbeam_channel::bounded(1024);

    // The loop's thread first: it says what it was granted before anything else is set up or moved.
    let plan = real.then(|| RtPlan::new(&facts.timing, period_ns(facts.rate_hz)));
    let (ready_in, ready) = mpsc::sync_channel(1);
    let (go, gate) = mpsc::sync_channel::<Experiment>(1);
    let (done_in, done) = mpsc::sync_channel(1);
    let control = Control { requests };
    let thread = std::thread::Builder::new()
        .name("gusset-loop".into())
        .spawn(move || {
            let granted = plan.as_ref().map(apply);
            let ready = Ready {
                granted: granted.clone(),
                thread_id: os::thread_id(),
            };
            if ready_in.send(ready).is_err() {
                return;
            }
            // The gate opens when every specimen is connected; a gate that is dropped ends the test unmoved.
            let Ok(experiment) = gate.recv() else {
                return;
            };
            let clock: Box<dyn Clock> = match &granted {
                Some(granted) => Box::new(granted.clock()),
                None => Box::new(SimClock::new()),
            };
            let mut engine = Engine::new(experiment, clock, Box::new(recorder));
            engine.before_first_tick = watches.before_first_tick;
            engine.after_last_tick = watches.after_last_tick;
            let _ = done_in.send(run_retired(&mut engine, &control));
        })
        .map_err(SessionError::Thread)?;
    let Ok(Ready { granted, thread_id }) = ready.recv() else {
        return Err(SessionError::Recording(
            "the loop's thread died before it began".into(),
        ));
    };
    if let Some(granted) = &granted {
        if granted.must_refuse() {
            return Err(SessionError::NotRealTime {
                missing: missing(granted),
            });
        }
        if let Some(cpu) = granted.cpu {
            // With one processor there is no other; the caller then shares it with the loop.
            let _ = pin_away(cpu);
        }
    }

    let clocks = Clocks {
        monotonic_ns: os::monotonic_ns,
        utc_ns: || Wall::now().0,
    };
    let settings = WriterSettings {
        real_clock: real,
        tick_ns: period_ns(facts.rate_hz),
        time_column: layout.index_of("time"),
        specimens: facts.specimens.clone(),
        ..WriterSettings::default()
    };
    let sampler_out = real.then_some(sample_out);
    let writer = Writer::spawn(reader, samples, events, sampler_out, clocks, settings)?;
    let sampler = if real {
        spawn_sampler(thread_id, &granted, sample_in)
    } else {
        None
    };

    for warning in &facts.warnings {
        writer.note(Note::new(NoteLevel::Warning, "warning").with("text", warning.as_str()));
    }
    if let Some(granted) = &granted {
        for text in missing(granted) {
            writer.note(Note::new(NoteLevel::Warning, "not_granted").with("text", text));
        }
    }
    let connected = connect(&mut experiment, &writer);
    let mut latest = Progress::default();
    let result = match connected {
        Ok(warnings) => {
            facts.warnings.extend(warnings);
            let _ = go.send(experiment);
            None
        }
        Err(text) => {
            drop(go);
            Some(Err(NoOutcome::Link(text)))
        }
    };
    let result = result.unwrap_or_else(|| {
        loop {
            match done.recv_timeout(LOOK_EVERY) {
                Ok(result) => break result,
                Err(mpsc::RecvTimeoutError::Timeout) => {
                    writer.progress(&mut latest);
                    progress(&latest);
                }
                // The thread can end without a word only by a panic outside the engine.
                Err(mpsc::RecvTimeoutError::Disconnected) => {
                    break Err(NoOutcome::Panic("the loop's thread died".to_owned()));
                }
            }
        }
    });
    let _ = thread.join();
    if let Some(sampler) = sampler {
        let _ = sampler.stop();
    }
    let recorded = writer.finish()?;
    if let Ok(outcome) = &result {
        summary::write_timing(&folder, &outcome.timing)?;
    }
    let (finish, summary) =
        summary::summarise(&facts, &folder, &result, &recorded, granted.as_ref());
    folder.write_summary(&summary)?;
    Ok(Finished {
        finish,
        path: folder.path().to_owned(),
        summary,
        recorded,
        granted,
    })
}

/// Whatever happens in the loop, the specimens are retired: a panic is caught here and named.
fn run_retired(engine: &mut Engine, control: &Control) -> Result<Outcome, NoOutcome> {
    catch_unwind(AssertUnwindSafe(|| engine.run(control))).map_err(|panic| {
        let text = panic_text(panic.as_ref());
        NoOutcome::Panic(
            match catch_unwind(AssertUnwindSafe(|| engine.retire(Retirement::Tripped))) {
                Ok(()) => text,
                Err(_) => format!("{text}; retiring the specimens failed too"),
            },
        )
    })
}

/// Connects every specimen, one after the other, and notes what each says of itself. Nothing moves yet. Returns what
/// the user should know.
fn connect(experiment: &mut Experiment, writer: &Writer) -> Result<Vec<String>, String> {
    let mut warnings = Vec::new();
    for index in 0..experiment.ports.len() {
        let Some(port) = experiment.ports.get_mut(index) else {
            break;
        };
        match port.connect() {
            Ok(introduction) => {
                for warning in &introduction.warnings {
                    let note = Note::new(NoteLevel::Warning, "warning");
                    writer.note(note.with("text", warning.as_str()));
                }
                warnings.extend(introduction.warnings);
                if port.is_remote() {
                    let note = Note::new(NoteLevel::Info, "connected");
                    writer.note(
                        note.with("specimen", index as u64 + 1)
                            .with("name", port.name.as_str())
                            .with("peer", introduction.peer.as_str()),
                    );
                }
            }
            Err(error) => {
                let text = format!("specimen \"{}\": {error}", port.name);
                let note = Note::new(NoteLevel::Error, "link");
                writer.note(
                    note.with("specimen", index as u64 + 1)
                        .with("name", port.name.as_str())
                        .with("message", error.text.as_str()),
                );
                // Those that are connected already are told that nothing will come.
                for port in &mut experiment.ports {
                    port.retire(Retirement::Orderly);
                }
                return Err(text);
            }
        }
    }
    Ok(warnings)
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "without a message".to_owned())
}

fn spawn_sampler(
    thread_id: i32,
    granted: &Option<Granted>,
    into: Sender<SchedSample>,
) -> Option<Sampler> {
    let cpu = granted.as_ref().and_then(|granted| granted.cpu);
    match Sampler::spawn(thread_id, cpu, into) {
        Ok(sampler) => Some(sampler),
        Err(error) => {
            tracing::warn!(
                "misses cannot be classed: the loop's thread cannot be watched: {error}"
            );
            None
        }
    }
}

impl From<SamplerReading> for SchedSample {
    fn from(reading: SamplerReading) -> Self {
        Self {
            clock_ns: reading.clock_ns,
            involuntary_switches: reading.involuntary_switches,
            minor_faults: reading.minor_faults,
            steal_ticks: reading.steal_ticks,
        }
    }
}

/// What was refused, in sentences.
#[must_use]
pub fn missing(granted: &Granted) -> Vec<String> {
    granted
        .missing()
        .map(|feature| {
            let reason = feature.reason.as_deref().unwrap_or("refused");
            match &feature.advice {
                Some(advice) => format!("{}: {reason} ({advice})", feature.asked),
                None => format!("{}: {reason}", feature.asked),
            }
        })
        .collect()
}

fn period_ns(rate_hz: f64) -> u64 {
    (1e9 / rate_hz) as u64
}
