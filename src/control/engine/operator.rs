//! What passes between the loop and whoever attends it: requests in, notices out.

use std::collections::VecDeque;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, TrySendError};

use super::phase::PhaseCell;

/// What an operator can ask of a running test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operator {
    /// End cleanly: every specimen rests where it is.
    Stop,
    /// End cleanly, by a signal: the wiring check and the motion of an identification go back to where they began.
    Interrupt,
    /// Let test time stand still.
    Hold,
    /// Go on after the hold of this number ([`super::Glimpse::hold_number`]); dropped if another hold stands by now. Nothing
    /// is confirmed by it.
    EndHold(u32),
    /// Go on after whichever hold stands. No operator asks for it: a replay does, whose holds have no numbers.
    Continue,
    /// What the sensors read is right. Heard only while that is asked; no hold ends by it.
    Confirm,
    /// Give the test up as being late. No operator asks for it: a replay does, whose clock is never late.
    GiveUp,
}

impl Operator {
    /// True if it ends the test.
    #[must_use]
    pub const fn is_end(self) -> bool {
        matches!(self, Self::Stop | Self::Interrupt)
    }

    /// Into the operator's line (with room for two words at least). Half of the room is kept for ends: none is lost behind
    /// other words. One more end than there is room for would mean nothing that those before it do not.
    ///
    /// # Errors
    /// There is no room, or nobody listens any more.
    pub fn say_into(self, line: &Sender<Self>) -> Result<(), TrySendError<Self>> {
        let is_end = self.is_end();
        if !is_end
            && line
                .capacity()
                .is_some_and(|room| line.len() >= room.div_ceil(2))
        {
            return Err(TrySendError::Full(self));
        }
        match line.try_send(self) {
            Err(TrySendError::Full(_)) if is_end => Ok(()),
            said => said,
        }
    }
}

/// Commands of the operator that took effect between two rows: a set of bits, recorded in the column `operator`.
///
/// A recorded test is led by them again. A `continue` in the set comes before a `hold` in it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct OperatorCommands(u8);

impl OperatorCommands {
    /// A hold.
    pub const HOLD: Self = Self(1);
    /// The end of a hold.
    pub const CONTINUE: Self = Self(2);
    /// The operator confirms the sensor readings.
    pub const CONFIRM: Self = Self(4);
    /// An orderly stop, received between two ticks.
    pub const STOP: Self = Self(8);
    /// The test was given up for missed deadlines.
    pub const GIVE_UP: Self = Self(16);
    /// A stop that ended the wait for a reply.
    pub(crate) const STOP_IN_WAIT: Self = Self(32);
    /// An orderly stop after which the specimens go back to where their motion began.
    pub const RETRACE: Self = Self(64);

    /// In the column `operator`.
    #[inline]
    #[must_use]
    pub(crate) fn code(self) -> f64 {
        f64::from(self.0)
    }

    /// From that column; any other number is the empty set.
    #[must_use]
    pub fn of(code: f64) -> Self {
        let bits = code as u8;
        let is_code = f64::from(bits) == code && bits < 128;
        Self(if is_code { bits } else { 0 })
    }

    /// Adds commands. Real-time: yes.
    #[inline]
    pub(crate) const fn add(&mut self, commands: Self) {
        self.0 |= commands.0;
    }

    /// Removes commands. Real-time: yes.
    #[inline]
    pub const fn remove(&mut self, commands: Self) {
        self.0 &= !commands.0;
    }

    /// Commands of a tick without a row lead nothing; a stop stays for the next row. Real-time: yes.
    #[inline]
    pub(super) const fn begin_tick(&mut self) {
        self.0 &= Self::STOP.0 | Self::GIVE_UP.0 | Self::RETRACE.0;
    }

    /// Whether all of these are in the set.
    #[inline]
    #[must_use]
    pub const fn has(self, commands: Self) -> bool {
        self.0 & commands.0 == commands.0
    }
}

/// What the loop tells whoever attends it, besides rows and events. Never waited on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Notice {
    /// What was read of one axis while zeroing.
    Zeroed {
        /// Specimen, from 0.
        port: usize,
        /// Axis, from 0.
        axis: usize,
        /// In the axis' own units.
        reading: crate::port::Reading,
    },
    /// What was read is to be confirmed with [`Operator::Confirm`].
    AwaitingConfirmation,
    /// Drives hold a specimen with torque. [`Operator::Confirm`] says that it is unloaded, and the torque ends.
    AwaitingRelease,
}

/// The operator's line into the loop: polled once a tick, never waited on.
#[derive(Debug, Clone)]
pub struct Control {
    /// Requests; bounded.
    pub requests: Receiver<Operator>,
    /// Where notices go; bounded, and dropped when full.
    pub notices: Sender<Notice>,
    /// Where the phase is left.
    pub phase: PhaseCell,
    /// The other end of `requests`, if other programs may speak to the test through its run folder.
    pub request_socket: Option<Sender<Operator>>,
}

impl From<Receiver<Operator>> for Control {
    /// An operator who asks and is told nothing.
    fn from(requests: Receiver<Operator>) -> Self {
        Self {
            requests,
            ..Self::unattended()
        }
    }
}

impl Control {
    /// A control that nobody holds: for tests and offline runs.
    #[must_use]
    pub(crate) fn unattended() -> Self {
        Self {
            requests: crossbeam_channel::never(),
            notices: crossbeam_channel::bounded(0).0,
            phase: PhaseCell::default(),
            request_socket: None,
        }
    }
}

/// The request by which another controller, or its server, ends the test; asked for where requests of the operator are taken, too.
pub(super) type Client<'a> = dyn FnMut() -> Option<Operator> + 'a;

/// Words that are taken off the line before their turn, at most.
const MOST_ASKED: usize = 16;

/// What the operator has said and is not heard yet: one word a tick. Only an end is heard before its turn, by whoever waits.
#[derive(Debug)]
pub(super) struct Requests(VecDeque<Operator>);

impl Default for Requests {
    /// With all the room that it will ever need.
    fn default() -> Self {
        Self(VecDeque::with_capacity(MOST_ASKED))
    }
}

impl Requests {
    /// Drops all words.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds a word, if there is room. Real-time: yes.
    pub(crate) fn add(&mut self, word: Operator) {
        if self.0.len() < MOST_ASKED {
            self.0.push_back(word);
        }
    }

    /// The next word stays where it is. Real-time: yes.
    pub(crate) fn next(&mut self, control: &Control) -> Option<Operator> {
        if self.0.is_empty()
            && let Ok(word) = control.requests.try_recv()
        {
            self.0.push_back(word);
        }
        self.0.front().copied()
    }

    /// The next word is heard. Real-time: yes.
    #[inline]
    pub(crate) fn take(&mut self, control: &Control) -> Option<Operator> {
        let first = self.0.pop_front();
        first.or_else(|| control.requests.try_recv().ok())
    }

    /// Waits for the next word, for so long at most. Not for the real-time path.
    pub(crate) fn wait(&mut self, control: &Control, most: Duration) {
        if !self.0.is_empty() {
            return;
        }
        match control.requests.recv_timeout(most) {
            Ok(word) => self.0.push_back(word),
            Err(RecvTimeoutError::Timeout) => {}
            // Nobody can end it any more.
            Err(RecvTimeoutError::Disconnected) => std::thread::park_timeout(most),
        }
    }

    /// True if an end was asked for. It leaves the queue with everything before it. `first_waits`: the first interrupt does
    /// not count, and stays. Real-time: yes.
    pub(crate) fn takes_an_end(&mut self, control: &Control, first_waits: bool) -> bool {
        while self.0.len() < MOST_ASKED
            && let Ok(word) = control.requests.try_recv()
        {
            self.0.push_back(word);
        }
        let mut waits = first_waits;
        let end = self.0.iter().position(|word| match word {
            Operator::Interrupt => !std::mem::take(&mut waits),
            word => word.is_end(),
        });
        if let Some(end) = end {
            self.0.drain(..=end);
        }
        end.is_some()
    }
}

/// Something to do on the loop's own thread just before the first and just after the last tick of the test: the tests of Gusset put
/// a guard there that counts system calls and allocations.
pub type Watch = Box<dyn FnMut() + Send>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stop_passes_a_full_queue() {
        let (line, hears) = crossbeam_channel::bounded(4);
        let said = [Operator::Hold; 9].map(|word| word.say_into(&line).is_ok());
        assert_eq!(said.map(usize::from).iter().sum::<usize>(), 2);
        for _ in 0..9 {
            assert_eq!(Operator::Stop.say_into(&line), Ok(()));
        }
        let full = Operator::Confirm.say_into(&line);
        assert_eq!(full, Err(TrySendError::Full(Operator::Confirm)));
        let heard: Vec<Operator> = hears.try_iter().collect();
        assert_eq!(
            heard,
            [
                Operator::Hold,
                Operator::Hold,
                Operator::Stop,
                Operator::Stop
            ]
        );
        drop(hears);
        for word in [Operator::Stop, Operator::Hold] {
            assert_eq!(word.say_into(&line), Err(TrySendError::Disconnected(word)));
        }
    }
}
