//! The roll of a run's threads, and the queue in which they leave their stamps.
//!
//! Invariant: nobody waits. A stamp that finds the queue full is dropped and counted; who enters late is named late; after
//! the end of a run the roll is closed and stamps go nowhere. The only lock is taken by a thread when it enters and by the
//! writer when one has. No clock is read here but the one that is given.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crossbeam_channel::{Receiver, Sender};

use super::{NOBODY, Stamp, What};

/// Stamps that may wait for the writer: seconds of them, who looks every few milliseconds.
const QUEUE: usize = 4096;

/// Who a thread is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Who {
    /// Its name as /proc has it.
    pub name: String,
    /// The kernel's number of it.
    pub id: i32,
}

/// The threads of a run and the way of their stamps to the writer. A copy is the same roll.
#[derive(Debug, Clone)]
pub struct Roll(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    clock: fn() -> u64,
    caller: fn() -> Who,
    into: Sender<Stamp>,
    out: Receiver<Stamp>,
    closed: AtomicBool,
    lost: AtomicU64,
    entered: AtomicU64,
    threads: Mutex<Vec<Who>>,
}

thread_local! {
    static HERE: RefCell<Option<Roll>> = const { RefCell::new(None) };
}

impl Roll {
    /// An empty roll. `clock` reads CLOCK_MONOTONIC in ns, `caller` says who the calling thread is.
    #[must_use]
    pub fn new(clock: fn() -> u64, caller: fn() -> Who) -> Self {
        Self::with_queue(clock, caller, QUEUE)
    }

    pub(super) fn with_queue(clock: fn() -> u64, caller: fn() -> Who, stamps: usize) -> Self {
        let (into, out) = crossbeam_channel::bounded(stamps);
        Self(Arc::new(Shared {
            clock,
            caller,
            into,
            out,
            closed: AtomicBool::new(false),
            lost: AtomicU64::new(0),
            entered: AtomicU64::new(0),
            threads: Mutex::default(),
        }))
    }

    /// Enters the calling thread. The 256th and later ones are not on it, and leave nothing.
    #[must_use]
    pub fn enter(&self) -> Stamper {
        let who = (self.0.caller)();
        let mut threads = self
            .0
            .threads
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let number = u8::try_from(threads.len()).ok().filter(|n| *n != NOBODY);
        if number.is_some() {
            threads.push(who);
            self.0
                .entered
                .store(threads.len() as u64, Ordering::Release);
        }
        Stamper {
            thread: number,
            roll: self.clone(),
        }
    }

    /// Does something for which the calling thread may start threads of links: they find the roll there ([`Roll::here`]).
    pub fn within<T>(&self, work: impl FnOnce() -> T) -> T {
        let before = HERE.with(|here| here.replace(Some(self.clone())));
        let done = work();
        HERE.with(|here| *here.borrow_mut() = before);
        done
    }

    /// The roll that the calling thread works for, if it does so.
    #[must_use]
    pub fn here() -> Option<Self> {
        HERE.with(|here| here.borrow().clone())
    }

    /// From now on stamps go nowhere.
    pub fn close(&self) {
        self.0.closed.store(true, Ordering::Relaxed);
    }

    /// Stamps that found no room so far.
    pub(super) fn lost(&self) -> u64 {
        self.0.lost.load(Ordering::Relaxed)
    }

    /// Calls `name` for every thread that has entered behind the first `known` ones; how many there are now.
    pub(super) fn name_those_after(&self, known: usize, mut name: impl FnMut(u8, &Who)) -> usize {
        if self.0.entered.load(Ordering::Acquire) as usize == known {
            return known;
        }
        let threads = self
            .0
            .threads
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        for (number, who) in (0..=u8::MAX).zip(threads.iter()).skip(known) {
            name(number, who);
        }
        threads.len()
    }

    /// The stamps that wait.
    pub(super) fn waiting(&self) -> impl Iterator<Item = Stamp> {
        self.0.out.try_iter().take(QUEUE)
    }
}

/// The hand of one thread.
#[derive(Debug)]
pub struct Stamper {
    thread: Option<u8>,
    roll: Roll,
}

impl Stamper {
    /// The clock of the stamps, ns.
    #[must_use]
    pub fn now(&self) -> u64 {
        (self.roll.0.clock)()
    }

    /// Leaves a stamp of what ends now. Never waits.
    pub fn since(&self, what: What, begin_ns: u64, amount: u64) {
        self.pieces(what, 1, begin_ns, self.now(), amount);
    }

    /// Leaves a stamp of so many pieces, the first from `begin_ns`, the last to `end_ns`. Never waits.
    pub fn pieces(&self, what: What, pieces: u16, begin_ns: u64, end_ns: u64, amount: u64) {
        if let Some(stamp) = self.made(what, pieces, begin_ns, end_ns, amount)
            && self.roll.0.into.try_send(stamp).is_err()
        {
            self.roll.0.lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The stamp itself; none from a thread that is on no roll, or on a closed one.
    pub(super) fn made(
        &self,
        what: What,
        pieces: u16,
        begin_ns: u64,
        end_ns: u64,
        amount: u64,
    ) -> Option<Stamp> {
        let thread = self.thread?;
        let open = !self.roll.0.closed.load(Ordering::Relaxed);
        open.then(|| Stamp {
            thread,
            what,
            pieces,
            begin_ns,
            duration_ns: end_ns.saturating_sub(begin_ns),
            amount,
        })
    }
}
