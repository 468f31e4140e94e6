//! One test in the virtual laboratory: the real loop, link, codecs, far end, records and replay, on simulated time.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use crossbeam_channel::{Receiver, Sender};
use gusset_config::Loaded;
use gusset_config::fault_script::Script;
use gusset_control::engine::{Connected, Control, Notice, Operator, Outcome, Phase, Stopped};
use gusset_link::fault::StallingClock;
use gusset_link::server::{Host, Simulated, Tap, Tapped};
use gusset_link::{NativeSetup, Transport};
use gusset_quantity::frame::AtAxis;
use gusset_quantity::time::{Clock, Nanos, SimClock};
use gusset_record::{Column, Event, FolderImage, Layout, Recorder, TimedEvent};
use gusset_session::{Replay, ending, replay_rows};
use gusset_setup::{Files, Prepared, build, build_over};

use crate::rig::Seen;

/// One way over the wire, as a share of a tick.
const DELAY: f64 = 0.05;

/// Everything that a test recorded.
pub struct Played {
    /// The first step that it computed itself: a resumed test begins later.
    pub first_step: u64,
    pub layout: Layout,
    pub samples: Vec<u8>,
    pub events_jsonl: Vec<u8>,
    pub events: Vec<TimedEvent>,
    pub outcome: Outcome,
    /// One per specimen.
    pub taps: Vec<Vec<Tapped>>,
    /// The state seen at each specimen; empty if it started at zero and was not observed.
    pub seen: Vec<Seen>,
    pub replay: Replay,
}

/// Settings of a test besides its file.
#[derive(Default)]
pub struct Extra<'a> {
    /// Stalls of the controller.
    pub script: Option<&'a Script>,
    /// The operator's commands, and the number of the loop's wait before each.
    pub operator: Vec<(u64, Operator)>,
    /// Number of waits before the operator confirms the readings, where that is required.
    pub confirms_after: u64,
    /// Without a tap and a replay: for speed.
    pub bare: bool,
    /// The process is killed when it looks at its clock for so manieth time.
    pub killed_at: Option<u64>,
}

/// Unwinds a killed process without a goodbye.
struct Killed;

/// A clock with the script's stalls, on which an operator gives commands.
struct LabClock {
    clock: StallingClock,
    waits: AtomicU64,
    says: Vec<(u64, Operator)>,
    into: Sender<Operator>,
    told: Receiver<Notice>,
    confirms_after: u64,
    confirms_at: AtomicU64,
    looks: Arc<AtomicU64>,
    killed_at: Option<u64>,
}

impl Clock for LabClock {
    fn now(&self) -> Nanos {
        let look = self.looks.fetch_add(1, Ordering::Relaxed);
        if self.killed_at == Some(look) {
            std::panic::resume_unwind(Box::new(Killed));
        }
        self.clock.now()
    }

    fn sleep_until(&self, at: Nanos) {
        let wait = self.waits.fetch_add(1, Ordering::Relaxed);
        for (_, word) in self.says.iter().filter(|(at, _)| *at == wait) {
            let _ = self.into.try_send(*word);
        }
        while let Ok(notice) = self.told.try_recv() {
            if notice == Notice::AwaitingConfirmation {
                let at = wait + self.confirms_after;
                self.confirms_at.store(at, Ordering::Relaxed);
            }
        }
        if self.confirms_at.load(Ordering::Relaxed) == wait {
            let _ = self.into.try_send(Operator::Confirm);
        }
        self.clock.sleep_until(at);
    }

    fn is_simulated(&self) -> bool {
        true
    }
}

#[derive(Clone)]
struct Shared(Arc<Mutex<(FolderImage, Vec<TimedEvent>)>>);

impl Recorder for Shared {
    fn row(&mut self, row: &[f64]) -> bool {
        self.0.lock().unwrap().0.row(row)
    }

    fn event(&mut self, event: TimedEvent) -> bool {
        let mut both = self.0.lock().unwrap();
        both.1.push(event.clone());
        both.0.event(event)
    }
}

/// The wires from a test to its far ends, which `host` makes.
pub struct Wires<'h> {
    clock: SimClock,
    tick_ns: u64,
    taps: Option<Vec<Tap>>,
    made: usize,
    host: &'h mut dyn FnMut(usize, &NativeSetup) -> Host,
}

impl<'h> Wires<'h> {
    pub fn new(
        loaded: &Loaded,
        bare: bool,
        host: &'h mut dyn FnMut(usize, &NativeSetup) -> Host,
    ) -> Self {
        Self {
            clock: SimClock::new(),
            tick_ns: (loaded.time.period.value() * 1e9) as u64,
            taps: (!bare).then(Vec::new),
            made: 0,
            host,
        }
    }

    pub fn dial(&mut self, setup: &NativeSetup) -> Box<dyn Transport> {
        let host = (self.host)(self.made, setup);
        self.made += 1;
        let delay_ns = (DELAY * self.tick_ns as f64) as u64;
        let stream = setup.carrier.is_stream();
        let tap = self.taps.as_mut().map(|taps| {
            let tap = Tap::default();
            taps.push(Arc::clone(&tap));
            tap
        });
        Box::new(Simulated::new(
            host,
            self.clock.clone(),
            delay_ns,
            stream,
            tap,
        ))
    }
}

/// The record of a test, however it ended.
pub struct Recorded {
    pub layout: Layout,
    pub samples: Vec<u8>,
    pub events_jsonl: Vec<u8>,
    pub events: Vec<TimedEvent>,
    /// None for a killed test.
    pub outcome: Option<Outcome>,
    pub files: Files,
    /// The position that each specimen reported.
    pub stood: Vec<Option<Vec<f64>>>,
    /// How often the clock was looked at.
    pub looks: u64,
    taps: Vec<Vec<Tapped>>,
}

/// Plays the test; `host` makes the far end of each specimen. An error is a panic, or a set-up that failed.
pub fn play(
    loaded: &Loaded,
    extra: Extra<'_>,
    mut host: impl FnMut(usize, &NativeSetup) -> Host,
) -> Result<Played, String> {
    let bare = extra.bare;
    let mut wires = Wires::new(loaded, bare, &mut host);
    let prepared = build_over(loaded, &mut |setup| wires.dial(setup));
    let recorded = perform(prepared.map_err(|error| error.to_string())?, wires, extra)?;
    let replay = if bare {
        Replay {
            rows: 0,
            columns: 0,
            time: 0.0,
            difference: None,
            short: None,
            files_proven: true,
            summary: Vec::new(),
            is_of_an_earlier_version: false,
        }
    } else {
        let mut again = build(loaded).map_err(|error| error.to_string())?.experiment;
        for (port, stood) in again.ports.iter_mut().zip(&recorded.stood) {
            port.startup_mut()
                .report_position(AtAxis(stood.as_deref().unwrap_or_default()));
        }
        let rows = Box::new(std::io::Cursor::new(recorded.samples.clone()));
        replay_rows(again, &recorded.layout, rows).map_err(|error| error.to_string())?
    };
    recorded.played(0, replay)
}

/// Connects a test that is prepared over these wires, and runs it.
pub fn perform(prepared: Prepared, wires: Wires<'_>, extra: Extra<'_>) -> Result<Recorded, String> {
    let mut experiment = prepared.experiment;
    for port in &mut experiment.ports {
        port.connect().map_err(|error| error.to_string())?;
    }
    let stood = experiment
        .ports
        .iter()
        .map(|port| port.startup().standing().map(|stands| stands.to_vec()))
        .collect();
    let (into, requests) = crossbeam_channel::bounded(16);
    let (notices, told) = crossbeam_channel::bounded(16);
    let stalls = extra.script.map(Script::stalls).unwrap_or_default();
    let looks = Arc::default();
    let lab_clock = LabClock {
        clock: StallingClock::new(wires.clock, wires.tick_ns, stalls),
        waits: AtomicU64::new(0),
        says: extra.operator,
        into,
        told,
        confirms_after: extra.confirms_after,
        confirms_at: AtomicU64::new(u64::MAX),
        looks: Arc::clone(&looks),
        killed_at: extra.killed_at,
    };
    let layout = Layout::new(experiment.columns()).map_err(|error| error.to_string())?;
    let image = FolderImage::new(layout.columns().len(), prepared.facts.specimens.clone());
    let shared = Shared(Arc::new(Mutex::new((image, Vec::new()))));
    let recorder = Box::new(shared.clone());
    let test = Connected::new(experiment, Box::new(lab_clock), recorder);
    let control = Control {
        notices,
        ..Control::from(requests)
    };
    let is_killed = || {
        let looks = looks.load(Ordering::Relaxed);
        extra.killed_at.is_some_and(|at| looks > at)
    };
    let stopped = match test.start(&control) {
        Ok(ready) => ready.run(),
        Err(stopped) => *stopped,
    };
    // A killed process moves nothing more, and says no goodbye.
    let stopped = (!is_killed()).then(|| stopped.shut_down_alone());
    let retired = stopped.filter(|_| !is_killed()).map(Stopped::retire);
    let outcome = match retired {
        Some(retired) if retired.fault.is_none() => retired.outcome,
        Some(_) => return Err("the loop panicked".to_owned()),
        None => None,
    };
    let mut both = shared.0.lock().unwrap();
    let taps = wires.taps.unwrap_or_default();
    Ok(Recorded {
        layout,
        samples: both.0.samples().to_vec(),
        events_jsonl: both.0.events().to_vec(),
        events: std::mem::take(&mut both.1),
        outcome,
        files: prepared.files,
        stood,
        looks: looks.load(Ordering::Relaxed),
        taps: taps.iter().map(|tap| tap.lock().unwrap().clone()).collect(),
    })
}

impl Recorded {
    /// With its proof. An error is that it was killed.
    pub fn played(self, first_step: u64, replay: Replay) -> Result<Played, String> {
        Ok(Played {
            first_step,
            layout: self.layout,
            samples: self.samples,
            events_jsonl: self.events_jsonl,
            events: self.events,
            outcome: self.outcome.ok_or("the test was killed")?,
            taps: self.taps,
            seen: Vec::new(),
            replay,
        })
    }
}

impl Played {
    /// The phases, the first included.
    pub fn path(&self) -> Vec<&'static str> {
        let mut path = vec![Phase::Connected.word()];
        path.extend(self.entries().map(|(_, to)| to));
        path
    }

    /// When each phase was entered.
    pub fn entries(&self) -> impl Iterator<Item = (u64, &'static str)> + '_ {
        self.events.iter().filter_map(|event| match event.kind {
            Event::Phase { to, .. } => Some((event.clock_ns, to.word())),
            _ => None,
        })
    }

    /// The reason for the end, and the exit code of `gusset run`.
    pub fn verdict(&self) -> (String, u8) {
        let (cause, reason) = ending(&self.outcome);
        (reason, cause.exit().code())
    }

    /// The position of a specimen of one axis before the test, in the unit of its commands.
    pub fn stood(&self, port: usize) -> f64 {
        self.seen.get(port).map_or(0.0, |seen| seen.stood)
    }

    pub fn columns(&self) -> &[Column] {
        self.layout.columns()
    }

    /// All reports of the far ends in one text.
    pub fn told(&self) -> String {
        let told = self
            .taps
            .iter()
            .flatten()
            .filter_map(|tapped| match tapped {
                Tapped::Event { event, .. } => Some(event.to_string()),
                Tapped::Sent { .. } => None,
            });
        told.collect::<Vec<_>>().join("\n")
    }
}
