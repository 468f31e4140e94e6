//! Everything before the first edge: facts are written, real-time conditions requested, threads started.

use std::sync::mpsc::{self, SyncSender};
use std::thread::JoinHandle;

use super::guarded::{Ended, run_to_the_end};
use super::sampling::spawn_sampler;
use super::{SessionError, Watches};
use gusset_config::ClockChoice;
use gusset_control::engine::{Connected, Control, Experiment};
use gusset_quantity::catalog::event::{Remark, Severity};
use gusset_quantity::time::{Clock, SimClock};
use gusset_record::rt::sampler::Sampler;
use gusset_record::rt::wall::Wall;
use gusset_record::rt::{Granted, apply, os, pin_away};
use gusset_record::writer::Clocks;
use gusset_record::{
    Event, Layout, Note, RingSize, RunFolder, WhenFull, Writer, WriterSettings, ring,
};
use gusset_setup::{Facts, Files, rt_plan};

/// A test whose threads are ready; nothing has moved.
pub(super) struct Ready {
    pub thread: JoinHandle<()>,
    pub go: SyncSender<Experiment>,
    pub experiment: Experiment,
    pub done: mpsc::Receiver<Ended>,
    pub writer: Writer,
    pub sampler: Option<Sampler>,
    pub granted: Option<Granted>,
}

/// Writes the facts before the test, requests real-time conditions and starts the threads.
pub fn prepare(
    experiment: Experiment,
    facts: &Facts,
    files: &Files,
    folder: &mut RunFolder,
    control: Control,
    mut watches: Watches,
) -> Result<Ready, SessionError> {
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

    // The loop's thread first: it reports its grants before anything else is set up or moved.
    let plan = real.then(|| rt_plan(&facts.timing, period_ns(facts.rate_hz)));
    let (onlooker, when_placed) = (watches.onlooker.take(), watches.when_placed.take());
    let (before_first_tick, after_last_tick) = (watches.before_first_tick, watches.after_last_tick);
    let (answer, answered) = mpsc::sync_channel(1);
    let (go, gate) = mpsc::sync_channel::<Experiment>(1);
    let (done_in, done) = mpsc::sync_channel(1);
    let thread = std::thread::Builder::new()
        .name("gusset-loop".into())
        .spawn(move || {
            let granted = plan.as_ref().map(apply);
            if answer.send((granted.clone(), os::thread_id())).is_err() {
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
            let test = Connected::new(experiment, clock, Box::new(recorder))
                .watched(before_first_tick, after_last_tick);
            let _ = done_in.send(run_to_the_end(test, &control, granted.is_some()));
        })
        .map_err(SessionError::Thread)?;
    let Ok((granted, thread_id)) = answered.recv() else {
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
    if let Some(start) = when_placed {
        start().map_err(SessionError::Attendance)?;
    }

    let clocks = Clocks {
        monotonic_ns: os::monotonic_ns,
        utc_ns: || Wall::now().0,
    };
    let settings = WriterSettings {
        real_clock: real,
        tick_ns: period_ns(facts.rate_hz),
        step_column: layout.index_of("step"),
        time_column: layout.index_of("time"),
        specimens: facts.specimens.clone(),
        states: Some(folder.open_states()?),
        ..WriterSettings::default()
    };
    let sampler_out = real.then_some(sample_out);
    let writer = Writer::spawn(
        reader,
        samples,
        events,
        sampler_out,
        clocks,
        settings,
        onlooker,
    )?;
    let sampler = if real {
        spawn_sampler(thread_id, &granted, sample_in)
    } else {
        None
    };

    let archived = folder.files_event(&files.test, &files.resolved, &layout);
    writer.note(archived);
    for warning in &facts.warnings {
        // For the file only: the program has already shown this warning, with its place in the test file.
        let event = Event::said(Remark::Warning, warning.as_str());
        writer.note(Note::new(event).at(Severity::Info));
    }
    if let Some(granted) = &granted {
        for text in missing(granted) {
            writer.note(Event::said(Remark::NotGranted, text));
        }
    }
    Ok(Ready {
        thread,
        go,
        experiment,
        done,
        writer,
        sampler,
        granted,
    })
}

/// Refused real-time requests, in sentences.
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
