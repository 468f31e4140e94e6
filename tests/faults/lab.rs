//! One test in the virtual laboratory: the real loop, link, codecs, far end, records and replay, on simulated time.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use crossbeam_channel::{Receiver, Sender};
use gusset::config::{Loaded, build, build_over};
use gusset::engine::{Control, Engine, Notice, Operator, Outcome, Phase};
use gusset::link::fault::{Script, StallingClock};
use gusset::link::serve::{Host, Simulated, Tap, Tapped};
use gusset::link::{NativeSetup, Transport};
use gusset::record::{Column, Event, EventKind, FolderImage, Layout, Recorder};
use gusset::session::{Finish, Replay, ending, replay_rows};
use gusset::time::{Clock, Nanos, SimClock};

use crate::rig::Seen;

/// One way over the wire, as a share of a tick.
const DELAY: f64 = 0.05;

/// What a test left behind.
pub struct Played {
    pub layout: Layout,
    pub samples: Vec<u8>,
    pub events_jsonl: Vec<u8>,
    pub events: Vec<Event>,
    pub outcome: Outcome,
    /// One per specimen.
    pub taps: Vec<Vec<Tapped>>,
    /// What was seen at each specimen; none: it stood at zero, and nobody looked.
    pub seen: Vec<Seen>,
    pub replay: Replay,
}

/// What is asked of a test besides its file.
#[derive(Default)]
pub struct Extra<'a> {
    /// Stalls of the controller.
    pub script: Option<&'a Script>,
    /// What the operator says, and before which wait of the loop.
    pub operator: Vec<(u64, Operator)>,
    /// After how many waits he confirms what was read, where he is asked to.
    pub confirms_after: u64,
    /// Without a tap and a replay: for speed.
    pub bare: bool,
}

/// A clock that stalls as it is told, on which an operator speaks.
struct LabClock {
    clock: StallingClock,
    waits: AtomicU64,
    says: Vec<(u64, Operator)>,
    into: Sender<Operator>,
    told: Receiver<Notice>,
    confirms_after: u64,
    confirms_at: AtomicU64,
}

impl Clock for LabClock {
    fn now(&self) -> Nanos {
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
            let _ = self.into.try_send(Operator::Continue);
        }
        self.clock.sleep_until(at);
    }

    fn is_simulated(&self) -> bool {
        true
    }
}

#[derive(Clone)]
struct Shared(Arc<Mutex<(FolderImage, Vec<Event>)>>);

impl Recorder for Shared {
    fn row(&mut self, row: &[f64]) -> bool {
        self.0.lock().unwrap().0.row(row)
    }

    fn event(&mut self, event: Event) -> bool {
        let mut both = self.0.lock().unwrap();
        both.1.push(event);
        both.0.event(event)
    }
}

/// Plays the test; `host` makes the far end of each specimen. An error is a panic, or a set-up that failed.
pub fn play(
    loaded: &Loaded,
    extra: Extra<'_>,
    mut host: impl FnMut(usize, &NativeSetup) -> Host,
) -> Result<Played, String> {
    let clock = SimClock::new();
    let tick_ns = (loaded.time.period.value() * 1e9) as u64;
    let mut taps: Vec<Tap> = Vec::new();
    let bare = extra.bare;
    let mut dial = |setup: &NativeSetup| -> Box<dyn Transport> {
        let host = host(taps.len(), setup);
        let delay_ns = (DELAY * tick_ns as f64) as u64;
        let stream = setup.carrier.is_stream();
        let simulated = Simulated::new(host, clock.clone(), delay_ns, stream);
        let tap = Tap::default();
        taps.push(Arc::clone(&tap));
        Box::new(if bare {
            simulated
        } else {
            simulated.tapped(tap)
        })
    };
    let prepared = build_over(loaded, &mut dial).map_err(|error| error.to_string())?;
    let mut experiment = prepared.experiment;
    for port in &mut experiment.ports {
        port.connect().map_err(|error| error.to_string())?;
    }
    let stood: Vec<_> = experiment
        .ports
        .iter()
        .map(|port| port.standing().map(<[f64]>::to_vec))
        .collect();
    let (into, requests) = crossbeam_channel::bounded(16);
    let (notices, told) = crossbeam_channel::bounded(16);
    let stalls = extra.script.map(Script::stalls).unwrap_or_default();
    let lab_clock = LabClock {
        clock: StallingClock::new(clock, tick_ns, stalls),
        waits: AtomicU64::new(0),
        says: extra.operator,
        into,
        told,
        confirms_after: extra.confirms_after,
        confirms_at: AtomicU64::new(u64::MAX),
    };
    let columns = experiment.columns();
    let layout = Layout::new(columns).map_err(|error| error.to_string())?;
    let image = FolderImage::new(layout.columns().len(), prepared.facts.specimens.clone());
    let shared = Shared(Arc::new(Mutex::new((image, Vec::new()))));
    let recorder = Box::new(shared.clone());
    let mut engine = Engine::new(experiment, Box::new(lab_clock), recorder);
    let control = Control {
        notices,
        ..Control::from(requests)
    };
    let outcome = catch_unwind(AssertUnwindSafe(|| engine.run(&control)))
        .map_err(|_| "the loop panicked".to_owned())?;
    drop(engine);
    let mut both = shared.0.lock().unwrap();
    let events = std::mem::take(&mut both.1);
    let samples = both.0.samples().to_vec();
    let events_jsonl = both.0.events().to_vec();
    let replay = if bare {
        Replay {
            rows: 0,
            columns: 0,
            time: 0.0,
            difference: None,
            short: None,
        }
    } else {
        let mut again = build(loaded).map_err(|error| error.to_string())?.experiment;
        for (port, stood) in again.ports.iter_mut().zip(&stood) {
            port.says_it_stands_at(stood.as_deref().unwrap_or_default());
        }
        let rows = Box::new(std::io::Cursor::new(samples.clone()));
        replay_rows(again, &layout, rows).map_err(|error| error.to_string())?
    };
    Ok(Played {
        layout,
        samples,
        events_jsonl,
        events,
        outcome,
        taps: taps.iter().map(|tap| tap.lock().unwrap().clone()).collect(),
        seen: Vec::new(),
        replay,
    })
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
            EventKind::Phase { to, .. } => Some((event.clock_ns, to)),
            _ => None,
        })
    }

    /// The reason for the end, and the exit code of `gusset run`.
    pub fn verdict(&self) -> (String, u8) {
        let (finish, reason) = ending(&self.outcome);
        let code = match finish {
            Finish::Completed => 0,
            Finish::Stopped => 1,
            Finish::LinkFailed => 3,
            Finish::Panicked => 5,
            Finish::Interrupted => 130,
        };
        (reason, code)
    }

    /// Where a specimen of one axis stood before the test, in the unit of its commands.
    pub fn stood(&self, port: usize) -> f64 {
        self.seen.get(port).map_or(0.0, |seen| seen.stood)
    }

    pub fn columns(&self) -> &[Column] {
        self.layout.columns()
    }

    /// What the far ends told, in one text.
    pub fn told(&self) -> String {
        let told = self
            .taps
            .iter()
            .flatten()
            .filter_map(|tapped| match tapped {
                Tapped::Heard { what, .. } => Some(what.to_string()),
                Tapped::Sent { .. } => None,
            });
        told.collect::<Vec<_>>().join("\n")
    }
}
