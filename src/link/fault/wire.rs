//! Faults of frames in transit, and of the connection as a whole.
//!
//! The wire is at the specimen's end. Invariants: a frame that no fault concerns passes unchanged and at once; delayed
//! frames leave in the order of their times; numbers of commands, never a clock, decide what happens.

use std::collections::VecDeque;

use super::Queue;
use super::dice::Dice;
use crate::Transport;
use crate::tls::TlsFault;
use gusset_config::fault_script::{Fault, Kind, MEMORY, Place, Script, Way};
use gusset_quantity::substructure::LinkFault;
use gusset_quantity::time::Nanos;
use gusset_wire::native::{Kind as FrameKind, forge_force, forge_length, forge_sequence, peek};

/// The stream of chance on the link.
const STREAM: u64 = 1;

/// Faults of one direction, and its kept frames.
#[derive(Debug, Default)]
struct OneWay {
    faults: Vec<Fault>,
    /// Frames that arrive later.
    later: Queue,
    /// Waits for the next frame, to follow it.
    behind: Option<Vec<u8>>,
    past: VecDeque<Vec<u8>>,
    /// Whether some fault sends old frames again.
    remembers: bool,
}

impl OneWay {
    fn new(script: &Script, way: Way) -> Self {
        let mut faults = script.faults_at(Place::Frames);
        faults.retain(|fault| fault.on.unwrap_or_default() == way);
        let old_again = |fault: &Fault| matches!(fault.kind, Kind::OldAgain { .. });
        Self {
            remembers: faults.iter().any(old_again),
            faults,
            ..Self::default()
        }
    }

    fn concerns(&self, number: u64) -> bool {
        self.behind.is_some()
            || self.remembers
            || self.faults.iter().any(|fault| fault.concerns(number))
    }

    /// Keeps `frame`, to be sent again.
    fn remember(&mut self, frame: &[u8]) {
        let oldest = (self.past.len() >= MEMORY).then(|| self.past.pop_front());
        let mut copy = oldest.flatten().unwrap_or_default();
        copy.clear();
        copy.extend_from_slice(frame);
        self.past.push_back(copy);
    }
}

/// A transport on which a script is played.
#[derive(Debug)]
pub(crate) struct FaultyWire<T> {
    inner: T,
    /// Faults of the connection, once after each arming, and those that are still to come.
    events: Vec<Fault>,
    coming: Vec<Fault>,
    dice: Dice,
    tick_ns: f64,
    first: u64,
    newest: u64,
    heard: bool,
    replies: OneWay,
    commands: OneWay,
    deaf_until: Nanos,
    answers_arming: bool,
    closed: bool,
    origin: Nanos,
    /// Seconds of the specimen's clock per second, less one.
    drift: f64,
}

impl<T: Transport> FaultyWire<T> {
    /// `inner`, with the faults of `script` that happen there, for a test with ticks of `tick_ns`.
    #[must_use]
    pub(crate) fn new(inner: T, script: &Script, tick_ns: u64) -> Self {
        let mut events = script.faults_at(Place::Connection);
        let mut drift = 0.0;
        let mut answers_arming = true;
        events.retain(|fault| match fault.kind {
            Kind::ClockDrift { ppm } => {
                drift = ppm * 1e-6;
                false
            }
            Kind::ArmingUnanswered => {
                answers_arming = false;
                false
            }
            _ => true,
        });
        Self {
            origin: inner.now(),
            inner,
            coming: events.clone(),
            events,
            dice: Dice::new(script.seed, STREAM),
            tick_ns: tick_ns as f64,
            first: 0,
            newest: 0,
            heard: false,
            replies: OneWay::new(script, Way::Replies),
            commands: OneWay::new(script, Way::Commands),
            deaf_until: Nanos(0),
            answers_arming,
            closed: false,
            drift,
        }
    }

    /// Commands count from this number on, and the script restarts.
    pub(crate) fn armed(&mut self, first: u64) {
        (self.first, self.newest, self.heard) = (first, 0, false);
        self.deaf_until = Nanos(0);
        self.coming.clone_from(&self.events);
    }

    /// True once the script has closed the connection.
    #[must_use]
    pub(crate) const fn is_closed(&self) -> bool {
        self.closed
    }

    /// The transport below.
    pub(crate) fn inner_mut(&mut self) -> &mut T {
        &mut self.inner
    }

    /// `at` of the specimen's clock, on the clock below.
    fn below(&self, at: Nanos) -> Nanos {
        if self.drift == 0.0 {
            return at;
        }
        let since = at.since(self.origin) as f64 / (1.0 + self.drift);
        // Not before it, on the specimen's clock.
        self.origin.plus(since.ceil() as u64 + 1)
    }

    /// Plays the faults on a frame of command `number`: it waits, once or several times, for its time.
    fn play(&mut self, way: Way, number: u64, frame: &[u8]) {
        let now = self.inner.now();
        let one_way = match way {
            Way::Replies => &mut self.replies,
            Way::Commands => &mut self.commands,
        };
        let mut bytes = one_way.later.copy(frame);
        let (mut late_ticks, mut copies, mut lost, mut follows) = (0.0, 1, false, false);
        let mut again = None;
        let faults = one_way.faults.iter();
        let faults = faults.filter(|fault| fault.concerns(number));
        for fault in faults {
            if !self.dice.happens(fault.probability.unwrap_or(1.0)) {
                continue;
            }
            match fault.kind {
                Kind::Lost => lost = true,
                Kind::Late { ticks } => late_ticks += ticks,
                Kind::Jitter { ticks } => late_ticks += ticks * self.dice.uniform(),
                Kind::Duplicated { times } => copies += times,
                Kind::Reordered => follows = true,
                Kind::OldAgain { age } => again = Some(age),
                Kind::Corrupted { bits } => {
                    for _ in 0..bits {
                        let bit = self.dice.below(8);
                        let place = self.dice.below(bytes.len());
                        if let Some(byte) = bytes.get_mut(place) {
                            *byte ^= 1 << bit;
                        }
                    }
                }
                Kind::WrongLength => {
                    let length = self.dice.next() as u32;
                    forge_length(&mut bytes, length);
                }
                Kind::Truncated => {
                    let length = self.dice.below(bytes.len());
                    bytes.truncate(length.max(1));
                }
                Kind::Garbage => {
                    for byte in &mut bytes {
                        *byte = self.dice.next() as u8;
                    }
                }
                Kind::NotANumberSent => {
                    forge_force(&mut bytes, fault.axis.unwrap_or(1) - 1, f64::NAN);
                }
                Kind::AnswersTheFuture { by } => {
                    let sequence = (self.first + number).saturating_add(by);
                    forge_sequence(&mut bytes, sequence);
                }
                _ => {}
            }
        }
        let at = now.plus((late_ticks * self.tick_ns) as u64);
        let before = one_way.behind.take();
        if lost {
            one_way.later.discard(bytes);
        } else if follows && before.is_none() {
            one_way.behind = Some(bytes);
        } else {
            for _ in 1..copies {
                one_way.later.push(at, &bytes);
            }
            one_way.later.put(at, bytes);
        }
        if let Some(before) = before {
            one_way.later.put(at, before);
        }
        if let Some(age) = again
            && let Some(old) = one_way.past.len().checked_sub(age)
            && let Some(old) = one_way.past.get(old)
        {
            one_way.later.push(at, old);
        }
        if one_way.remembers {
            one_way.remember(frame);
        }
    }

    /// Sends the replies whose time has come.
    #[inline]
    fn flush(&mut self) -> Result<(), LinkFault> {
        match self.replies.later.next_at() {
            Some(_) => self.send_due(),
            None => Ok(()),
        }
    }

    fn send_due(&mut self) -> Result<(), LinkFault> {
        let now = self.inner.now();
        let inner = &mut self.inner;
        while let Some(sent) = self.replies.later.pass(now, |frame| inner.send(frame)) {
            sent?;
        }
        Ok(())
    }

    /// Applies the faults of the connection to a command that arrived. True if the command is received.
    fn hears(&mut self, number: u64) -> Result<bool, LinkFault> {
        let is_new = !self.heard || number > self.newest;
        if is_new {
            (self.newest, self.heard) = (number, true);
        }
        while is_new
            && let Some(index) = self
                .coming
                .iter()
                .position(|fault| fault.at.unwrap_or(0) <= number)
        {
            let fault = self.coming.swap_remove(index);
            if !self.dice.happens(fault.probability.unwrap_or(1.0)) {
                continue;
            }
            match fault.kind {
                Kind::Closed => {
                    self.closed = true;
                    return Err(LinkFault::Closed);
                }
                Kind::Hangs { ticks } => {
                    self.deaf_until = self.inner.now().plus((ticks * self.tick_ns) as u64);
                }
                _ => {}
            }
        }
        Ok(self.inner.now() >= self.deaf_until)
    }
}

impl<T: Transport> Transport for FaultyWire<T> {
    fn has_hung_up(&self) -> bool {
        self.inner.has_hung_up()
    }

    fn trust_only_frames(&mut self) {
        self.inner.trust_only_frames();
    }

    fn unreachable(&self) -> u64 {
        self.inner.unreachable()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkFault> {
        if self.closed {
            return Err(LinkFault::Closed);
        }
        self.flush()?;
        let Some(seen) = peek(frame) else {
            return self.inner.send(frame);
        };
        let number = match seen.kind {
            FrameKind::Control if self.answers_arming => return self.inner.send(frame),
            FrameKind::Control => return Ok(()),
            FrameKind::Measurement => seen.sequence.saturating_sub(self.first),
            _ => self.newest,
        };
        if self.deaf_until > Nanos(0) && self.inner.now() < self.deaf_until {
            return Ok(());
        }
        // Nothing can send a goodbye later.
        if seen.kind == FrameKind::Goodbye || !self.replies.concerns(number) {
            return self.inner.send(frame);
        }
        self.play(Way::Replies, number, frame);
        self.flush()
    }

    fn recv(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LinkFault> {
        let deadline = self.below(deadline);
        loop {
            if self.closed {
                return Err(LinkFault::Closed);
            }
            self.flush()?;
            let now = self.inner.now();
            if let Some(count) = self.commands.later.take(now, buffer) {
                return Ok(Some(count));
            }
            let due = [self.commands.later.next_at(), self.replies.later.next_at()];
            let until = due.into_iter().flatten().fold(deadline, Nanos::min);
            let Some(count) = self.inner.recv(buffer, until)? else {
                self.flush()?;
                let now = self.inner.now();
                return Ok(self.commands.later.take(now, buffer));
            };
            let frame = buffer.get(..count).unwrap_or_default();
            let number = match peek(frame) {
                Some(seen) if seen.kind == FrameKind::Command => {
                    seen.sequence.saturating_sub(self.first)
                }
                Some(seen) if seen.kind != FrameKind::Control => self.newest,
                // A message before the test, or not one frame: several came at once.
                _ => return Ok(Some(count)),
            };
            if !self.hears(number)? {
                self.commands.later.push(self.deaf_until, frame);
            } else if self.commands.concerns(number) {
                self.play(Way::Commands, number, frame);
            } else {
                return Ok(Some(count));
            }
        }
    }

    fn now(&self) -> Nanos {
        let now = self.inner.now();
        if self.drift == 0.0 {
            return now;
        }
        let since = now.since(self.origin) as f64 * (1.0 + self.drift);
        self.origin.plus(since as u64)
    }

    fn tls_fault(&self) -> Option<TlsFault> {
        self.inner.tls_fault()
    }
}
