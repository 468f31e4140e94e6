//! A bus that several specimens share, with a keeper for the time without a loop.
//!
//! The bus lies in a slot with room for one. Its user takes it out and puts it back: the loop in each tick, the keeper while the
//! loop does not exchange. So process data flow from SAFE-OP to the last message, also while an operator or a client is awaited.
//! Taking it is one exchange of atomic words; the loop waits only while the keeper exchanges, which is never during a test.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, bounded};
use gusset_quantity::time::{Clock, Nanos};

use crate::cycle::Bus;
use crate::error::BusError;
use crate::follow::BusTime;
use crate::line::Line;
use crate::plan::BusPlan;

/// Longest wait for the bus while the keeper exchanges.
const HAND_OVER: Duration = Duration::from_millis(200);
/// Ticks of silence after which the keeper exchanges in place of the loop.
const SILENT_TICKS: u64 = 4;
/// Shortest such silence in ns: a loop that was preempted comes back.
const SILENT_NS: u64 = 5_000_000;

/// Opens the line: it may wait, and ask the system.
pub type Opener = Box<dyn FnOnce() -> Result<Box<dyn Line>, BusError> + Send>;

/// Where a tick is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stage {
    /// Specimens write their commands.
    Writing,
    /// The frame has left.
    Sent,
    /// The inputs are there, or not.
    Done(bool),
}

/// The bus, with what its specimens know together.
#[derive(Debug)]
pub(crate) struct Held {
    pub bus: Box<Bus>,
    pub stage: Stage,
    /// Specimens that have written their command in this tick, and those that were retired.
    pub written: usize,
    pub retired: usize,
}

/// State that the specimens of a bus share.
pub struct SharedBus {
    plan: BusPlan,
    source: [u8; 6],
    specimens: usize,
    time: Arc<BusTime>,
    opener: Mutex<Option<Opener>>,
    /// Clock of the keeper; none on simulated time, where nothing happens beside the loop.
    clock: Mutex<Option<Box<dyn Clock>>>,
    is_on_simulated_time: bool,
    keeper: Mutex<Option<JoinHandle<()>>>,
    put: Sender<Box<Held>>,
    slot: Receiver<Box<Held>>,
    /// The loop does not exchange.
    is_idle: AtomicBool,
    is_over: AtomicBool,
    used_ns: AtomicU64,
}

impl std::fmt::Debug for SharedBus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SharedBus")
            .field("plan", &self.plan.name)
            .finish_non_exhaustive()
    }
}

impl SharedBus {
    /// A bus of this plan, which is not connected yet. `source` is the sender of our frames. `clock` is that of
    /// the keeper: none on simulated time.
    #[must_use]
    pub fn new(
        plan: BusPlan,
        (source, specimens): ([u8; 6], usize),
        opener: Opener,
        clock: Option<Box<dyn Clock>>,
    ) -> Arc<Self> {
        let (put, slot) = bounded(1);
        Arc::new(Self {
            plan,
            source,
            specimens,
            time: Arc::new(BusTime::default()),
            opener: Mutex::new(Some(opener)),
            is_on_simulated_time: clock.is_none(),
            clock: Mutex::new(clock),
            keeper: Mutex::new(None),
            put,
            slot,
            is_idle: AtomicBool::new(true),
            is_over: AtomicBool::new(false),
            used_ns: AtomicU64::new(0),
        })
    }

    /// The relation between the clock of this machine and that of the bus.
    #[must_use]
    pub fn time(&self) -> &Arc<BusTime> {
        &self.time
    }

    /// The bus as the test file says it.
    #[must_use]
    pub const fn plan(&self) -> &BusPlan {
        &self.plan
    }

    pub(crate) const fn specimens(&self) -> usize {
        self.specimens
    }

    /// Opens the line and brings the devices to SAFE-OP, once; a later call does nothing.
    pub(crate) fn open(self: &Arc<Self>) -> Result<(), BusError> {
        let Ok(mut opener) = self.opener.lock() else {
            return Err(BusError::NoDevice);
        };
        let Some(open) = opener.take() else {
            return if self.is_over.load(Ordering::Acquire) {
                Err(BusError::NoDevice)
            } else {
                Ok(())
            };
        };
        let up = self.bring_up(open);
        if up.is_err() {
            self.is_over.store(true, Ordering::Release);
        }
        up
    }

    fn bring_up(self: &Arc<Self>, open: Opener) -> Result<(), BusError> {
        let line = open()?;
        let mut bus = crate::bring_up::bring_up(line, self.plan.clone(), self.source)?;
        bus.follow(Arc::clone(&self.time));
        // Inputs must have come once before anyone reads them.
        if !bus.exchange_until(|bus| Ok(bus.trouble().2 == 0), &mut || true)? {
            return Err(bus.complaint().unwrap_or(BusError::NoDevice));
        }
        self.put_back(Box::new(Held {
            bus,
            stage: Stage::Done(true),
            written: 0,
            retired: 0,
        }));
        let clock = self.clock.lock().ok().and_then(|mut clock| clock.take());
        if let Some(clock) = clock {
            let shared = Arc::clone(self);
            let thread = std::thread::Builder::new().name("gusset-bus".into());
            let keeper = thread.spawn(move || shared.keep(clock.as_ref()));
            if let (Ok(keeper), Ok(mut place)) = (keeper, self.keeper.lock()) {
                *place = Some(keeper);
            }
        }
        Ok(())
    }

    /// Takes the bus out of its slot; none if it is closed. Real-time: yes, while the loop runs.
    pub(crate) fn take(&self) -> Option<Box<Held>> {
        if let Ok(held) = self.slot.try_recv() {
            return Some(held);
        }
        if self.is_over.load(Ordering::Acquire) {
            return None;
        }
        self.slot.recv_timeout(HAND_OVER).ok()
    }

    /// Puts the bus back. Real-time: yes.
    pub(crate) fn put_back(&self, held: Box<Held>) {
        self.used_ns.store(held.bus.sent().0, Ordering::Release);
        let _ = self.put.try_send(held);
    }

    /// Whether the loop exchanges, or the keeper does. Real-time: yes.
    pub(crate) fn set_idle(&self, is_idle: bool) {
        self.is_idle.store(is_idle, Ordering::Release);
    }

    /// True on simulated time: then the loop makes the time of the bus pass. Real-time: yes.
    pub(crate) const fn is_on_simulated_time(&self) -> bool {
        self.is_on_simulated_time
    }

    /// The bus is closed, and the keeper ends.
    pub(crate) fn close(&self, mut held: Box<Held>) {
        self.is_over.store(true, Ordering::Release);
        held.bus.close();
        drop(held);
        let keeper = self.keeper.lock().ok().and_then(|mut keeper| keeper.take());
        if let Some(keeper) = keeper {
            let _ = keeper.join();
        }
    }

    /// Exchanges process data while the loop does not.
    fn keep(&self, clock: &dyn Clock) {
        let period = self.plan.period_ns;
        let silence = (SILENT_TICKS * period).max(SILENT_NS);
        while !self.is_over.load(Ordering::Acquire) {
            let used = Nanos(self.used_ns.load(Ordering::Acquire));
            let is_idle = self.is_idle.load(Ordering::Acquire);
            let due = used.plus(if is_idle { period / 2 } else { silence });
            if clock.now() < due {
                let look = if is_idle {
                    due
                } else {
                    clock.now().plus(period)
                };
                clock.sleep_until(look);
                continue;
            }
            let Ok(mut held) = self.slot.try_recv() else {
                clock.sleep_until(clock.now().plus(period / 4));
                continue;
            };
            let edge = held.bus.next_edge();
            // A loop that came back meanwhile must not wait for long.
            held.bus.wait_until(edge.min(clock.now().plus(period)));
            held.bus.exchange();
            held.stage = Stage::Done(false);
            self.put_back(held);
        }
    }
}
