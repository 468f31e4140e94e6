//! A bus that several specimens share, with a keeper for the time without a loop.
//!
//! The bus lies in a slot with room for one. Its user takes it out and puts it back: the loop in each tick, the keeper while the
//! loop does not exchange. So process data flow from SAFE-OP to the last message, also while an operator or a client is awaited.
//! Taking it is one exchange of atomic words; the loop waits only while the keeper exchanges, which is never during a test.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, bounded};
use gusset_quantity::time::{Clock, Nanos};

use crate::cycle::Bus;
use crate::error::BusError;
use crate::follow::BusTime;
use crate::line::Line;
use crate::plan::BusPlan;

/// Longest wait for the bus while the keeper exchanges, and the same in ticks.
const HAND_OVER_NS: u64 = 200_000_000;
const HAND_OVER_TICKS: u64 = 3;
/// Fewest ticks of silence after which the keeper exchanges in place of the loop: no fewer than the stale ticks that a test bears.
const SILENT_TICKS: u64 = 4;
/// Shortest such silence in ns: a loop that was preempted comes back.
const SILENT_NS: u64 = 5_000_000;

/// Opens the line: it may wait, and ask the system.
pub type Opener = Box<dyn FnOnce() -> Result<Box<dyn Line>, BusError> + Send>;

/// Means of the keeper of a bus.
pub struct Keeper {
    /// The clock of this machine.
    pub clock: Arc<dyn Clock + Sync>,
    /// Called first on its thread, which asks the system for real-time conditions.
    pub prepare: Box<dyn FnOnce() + Send>,
}

impl std::fmt::Debug for Keeper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Keeper")
    }
}

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
    /// Specimens that have written their command in this tick.
    pub written: usize,
    /// Specimens whose commands the frame of a tick waits for: those that wrote in the tick before.
    pub expected: usize,
    /// Specimens that were retired.
    pub retired: usize,
}

/// State that the specimens of a bus share.
pub struct SharedBus {
    plan: BusPlan,
    source: [u8; 6],
    specimens: usize,
    time: Arc<BusTime>,
    opener: Mutex<Option<Opener>>,
    /// Means of the keeper until it starts; none on simulated time, where nothing happens beside the loop.
    keeper: Mutex<Option<Keeper>>,
    /// The clock of this machine; none on simulated time.
    clock: Option<Arc<dyn Clock + Sync>>,
    thread: Mutex<Option<JoinHandle<()>>>,
    put: Sender<Box<Held>>,
    slot: Receiver<Box<Held>>,
    /// The loop does not exchange.
    is_idle: AtomicBool,
    is_over: AtomicBool,
    /// Some device may be in OP: outputs or torque hold the specimens.
    is_live: AtomicBool,
    /// The devices stay in operation from one test to the next.
    is_lent: AtomicBool,
    /// When the last exchange began, and when the next one of the keeper is due.
    used_ns: AtomicU64,
    edge_ns: AtomicU64,
}

impl std::fmt::Debug for SharedBus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SharedBus")
            .field("plan", &self.plan.name)
            .finish_non_exhaustive()
    }
}

impl SharedBus {
    /// A bus of this plan, which is not connected yet. `source` is the sender of our frames. There is no
    /// `keeper` on simulated time.
    #[must_use]
    pub fn new(
        plan: BusPlan,
        (source, specimens): ([u8; 6], usize),
        opener: Opener,
        keeper: Option<Keeper>,
    ) -> Arc<Self> {
        let (put, slot) = bounded(1);
        Arc::new(Self {
            plan,
            source,
            specimens,
            time: Arc::new(BusTime::default()),
            opener: Mutex::new(Some(opener)),
            clock: keeper.as_ref().map(|keeper| Arc::clone(&keeper.clock)),
            keeper: Mutex::new(keeper),
            thread: Mutex::new(None),
            put,
            slot,
            is_idle: AtomicBool::new(true),
            is_over: AtomicBool::new(false),
            is_live: AtomicBool::new(false),
            is_lent: AtomicBool::new(false),
            used_ns: AtomicU64::new(0),
            edge_ns: AtomicU64::new(0),
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
            return if self.is_over() {
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
            expected: self.specimens,
            retired: 0,
        }));
        let keeper = self.keeper.lock().ok().and_then(|mut keeper| keeper.take());
        if let Some(Keeper { clock, prepare }) = keeper {
            let shared = Arc::downgrade(self);
            let thread = std::thread::Builder::new().name("gusset-bus".into());
            let thread = thread.spawn(move || {
                prepare();
                keep(&shared, clock.as_ref());
            });
            match (thread, self.thread.lock()) {
                (Ok(thread), Ok(mut place)) => *place = Some(thread),
                _ => return Err(BusError::NoKeeper),
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
        let most = HAND_OVER_NS.max(HAND_OVER_TICKS * self.plan.period_ns);
        self.slot.recv_timeout(Duration::from_nanos(most)).ok()
    }

    /// Puts the bus back. Real-time: yes.
    pub(crate) fn put_back(&self, held: Box<Held>) {
        self.used_ns.store(held.bus.sent().0, Ordering::Release);
        self.edge_ns
            .store(held.bus.next_edge().0, Ordering::Release);
        let _ = self.put.try_send(held);
    }

    /// Whether the loop exchanges, or the keeper does. Real-time: yes.
    pub(crate) fn set_idle(&self, is_idle: bool) {
        self.is_idle.store(is_idle, Ordering::Release);
    }

    /// True on simulated time: then the loop makes the time of the bus pass. Real-time: yes.
    pub(crate) const fn is_on_simulated_time(&self) -> bool {
        self.clock.is_none()
    }

    /// Waits in a tick, and lets go of the bus meanwhile: if the loop comes to a halt here, the keeper exchanges. Real-time: yes.
    pub(crate) fn wait_until(&self, mut held: Box<Held>, at: Nanos) -> Option<Box<Held>> {
        let Some(clock) = &self.clock else {
            held.bus.wait_until(at);
            return Some(held);
        };
        self.put_back(held);
        clock.sleep_until(at);
        self.take()
    }

    /// Silence of the loop in ns after which the keeper exchanges. The devices must not wait for so long that their
    /// watchdogs expire. Real-time: yes.
    pub(crate) fn silence_ns(&self) -> u64 {
        let period = self.plan.period_ns;
        let ticks = SILENT_TICKS.max(self.plan.stale_ticks.into());
        let silence = ticks.saturating_mul(period).max(SILENT_NS);
        silence.min(self.plan.watchdog_ns / 2).max(2 * period)
    }

    /// True from the first request of OP on: outputs or torque may hold the specimens.
    pub(crate) fn is_live(&self) -> bool {
        self.is_live.load(Ordering::Acquire)
    }

    pub(crate) fn set_live(&self) {
        self.is_live.store(true, Ordering::Release);
    }

    /// From here on the devices stay in operation when a test is over: [`SharedBus::release`] ends it.
    pub fn lend(&self) {
        self.is_lent.store(true, Ordering::Release);
    }

    /// True if the devices stay in operation when a test is over. Real-time: yes.
    pub(crate) fn is_lent(&self) -> bool {
        self.is_lent.load(Ordering::Acquire)
    }

    /// True if the bus was closed: nothing comes from it any more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Acquire)
    }

    /// True if outputs or torque of real devices hold a specimen.
    #[must_use]
    pub fn is_held(&self) -> bool {
        let Some(held) = self.take() else {
            return false;
        };
        let is_real = !held.bus.is_simulated();
        self.put_back(held);
        self.is_live() && is_real
    }

    /// Ends torque and outputs, and closes the bus; false if some device did not follow. The operator has said that the specimens
    /// are unloaded.
    pub fn release(&self) -> bool {
        let Some(mut held) = self.take() else {
            return true;
        };
        let is_off = held.bus.take_torque(None);
        let has_left = (held.bus.leave() && is_off) || !self.is_live();
        self.close(held);
        has_left
    }

    /// The bus is closed, and the keeper ends.
    pub(crate) fn close(&self, mut held: Box<Held>) {
        self.is_over.store(true, Ordering::Release);
        held.bus.close();
        drop(held);
        let thread = self.thread.lock().ok().and_then(|mut thread| thread.take());
        if let Some(thread) = thread {
            let _ = thread.join();
        }
    }

    /// Whether the loop does not exchange, and when the keeper does.
    fn due(&self) -> (bool, Nanos) {
        let is_idle = self.is_idle.load(Ordering::Acquire);
        let due = if is_idle {
            Nanos(self.edge_ns.load(Ordering::Acquire))
        } else {
            Nanos(self.used_ns.load(Ordering::Acquire)).plus(self.silence_ns())
        };
        (is_idle, due)
    }

    /// Exchanges process data once, if the loop does not. Returns when the keeper is to look again.
    fn keep(&self, now: Nanos) -> Nanos {
        let period = self.plan.period_ns;
        let (is_idle, due) = self.due();
        if now < due {
            return if is_idle { due } else { now.plus(period) };
        }
        let Ok(mut held) = self.slot.try_recv() else {
            return now.plus(period / 4);
        };
        // The loop may have come back meanwhile.
        if now < self.due().1 {
            self.put_back(held);
            return now;
        }
        // Until it comes back, a silent loop is replaced in every tick.
        self.set_idle(true);
        held.bus.exchange();
        held.stage = Stage::Done(false);
        self.put_back(held);
        now
    }
}

/// The thread that exchanges while the loop does not. It ends with the last specimen of the bus.
fn keep(shared: &Weak<SharedBus>, clock: &dyn Clock) {
    while let Some(shared) = shared.upgrade() {
        if shared.is_over.load(Ordering::Acquire) {
            return;
        }
        let look = shared.keep(clock.now());
        drop(shared);
        clock.sleep_until(look);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulated::tests::{plan, simulated};

    #[test]
    fn a_silent_loop_is_replaced_in_every_tick() {
        let (_devices, line) = simulated(&plan(), "");
        let opener: Opener = Box::new(move || Ok(Box::new(line)));
        let shared = SharedBus::new(plan(), ([2; 6], 1), opener, None);
        shared.open().unwrap();
        shared.set_idle(false);
        let period = plan().period_ns;
        let (is_idle, due) = shared.due();
        let sent = Nanos(shared.used_ns.load(Ordering::Acquire));
        assert_eq!((is_idle, due.since(sent)), (false, shared.silence_ns()));
        assert!(shared.keep(Nanos(due.0 - 1)) > due);
        assert!(!shared.due().0);
        shared.keep(due);
        let (is_idle, next) = shared.due();
        let sent = Nanos(shared.used_ns.load(Ordering::Acquire));
        assert!(is_idle && next.since(sent) <= 2 * period);
    }
}
