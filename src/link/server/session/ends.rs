//! How a session ends, or begins anew, and the last words that are said.

use std::sync::atomic::Ordering;

use super::Stand;
use crate::catalog::ending::{self, Kind};
use crate::link::Transport;
use crate::link::rig::{TestEnd, Trip, with_last_words};
use crate::link::serve::armed::said_goodbye;
use crate::link::serve::{Desk, greet};
use crate::text::is_hidden;
use crate::wire::WireError;
use crate::wire::handshake::{self, Bye, Control, Refuse, TEXT_LIMIT};
use crate::wire::native::{Cause, Notice};

/// What ends a session, or a frame that failed a check.
pub(super) enum Wrong {
    Wire(WireError),
    End(TestEnd),
}

impl From<WireError> for Wrong {
    fn from(error: WireError) -> Self {
        Wrong::Wire(error)
    }
}

impl From<TestEnd> for Wrong {
    fn from(end: TestEnd) -> Self {
        Wrong::End(end)
    }
}

impl Stand {
    pub(super) fn retired(&mut self, notice: Notice) -> TestEnd {
        let how = match notice.cause {
            Cause::Orderly => "at the end of the test",
            Cause::Operator => "by the operator",
            Cause::Tripped => "because the test tripped",
            Cause::Watchdog => "because its controller is lost",
            Cause::Shutdown => "because the program that commands it ends",
            Cause::Interlock => "because an interlock opened",
        };
        let cause = notice.cause.ending();
        self.commits_what_ends(cause);
        // Zero is no number where no command was sent.
        if notice.sequence > 0 || self.sequence.is_some() {
            self.misses_up_to(notice.sequence);
        }
        match self.station.tripped() {
            Some(trip) => {
                // Why it tripped, in words, for whoever reads the controller's summary.
                let why = self.station.whole(trip);
                // At once: a specimen that owes its goodbye must not keep this from a controller that waits only a little.
                self.say(Cause::Tripped, &why);
                let said = self.station.dismiss(trip.cause());
                if said.is_some() {
                    self.say(Cause::Tripped, &with_last_words(why, said));
                }
                self.say_goodbye(Cause::Tripped);
            }
            None => {
                if let Some(said) = self.station.dismiss(cause) {
                    self.say(Cause::Orderly, &said);
                }
                self.say_goodbye(Cause::Orderly);
            }
        }
        TestEnd {
            cause,
            text: format!("retired {how}"),
        }
    }

    /// The controller leaves without a retire.
    pub(super) fn left(&mut self, cause: u32, text: &str) -> TestEnd {
        let over = said_goodbye(cause, text);
        self.commits_what_ends(over.cause);
        over
    }

    /// All commands up to this one that did not come, or were not passed on, are missed; how many.
    pub(super) fn misses_up_to(&mut self, last: u64) -> u64 {
        let next = last.saturating_add(1);
        let gap = next.saturating_sub(self.next_sequence);
        self.missed = self
            .missed
            .saturating_add(u32::try_from(gap).unwrap_or(u32::MAX));
        self.next_sequence = self.next_sequence.max(next);
        gap
    }

    fn commits_what_ends(&mut self, cause: ending::Cause) {
        let is_orderly = matches!(cause.kind(), Kind::Completion | Kind::Operator);
        if is_orderly && self.sequence.is_some() {
            self.station.commit();
        }
    }

    /// The answer to the arming was lost: it is given again. A later one, after commands that only tried the specimen:
    /// the test begins anew, where the specimen stands. Any other message now is the end.
    pub(super) fn again_armed(&mut self, message: &[u8], desk: &Desk) -> Result<(), Wrong> {
        match handshake::decode(message)? {
            Control::Arm(arm) if arm == self.armed => {}
            Control::Arm(arm) => {
                if let Err(refuse) = greet::fits(&arm, self.armed.session, &self.disp) {
                    return Err(Wrong::End(self.refused(refuse)));
                }
                let newest = self.pending.map(|(pending, ..)| pending).or(self.sequence);
                if arm.first_sequence <= newest.unwrap_or(self.armed.first_sequence) {
                    // An earlier one, late.
                    return Ok(());
                }
                let mut wanted = || {
                    if desk.stop.load(Ordering::Acquire) {
                        return Err(TestEnd::told_to_stop());
                    }
                    Ok(())
                };
                let begun = self
                    .station
                    .begin_again(arm.first_sequence, &arm.disp, &mut wanted);
                begun.map_err(|over| {
                    if over == TestEnd::told_to_stop() {
                        self.told_to_stop()
                    } else {
                        over
                    }
                })?;
                self.station.starts(self.line.now());
                if let Some((pending, ..)) = self.pending {
                    self.misses_up_to(pending);
                }
                (self.sequence, self.next_sequence) = (None, arm.first_sequence);
                self.line.armed(arm.first_sequence);
                (self.pending, self.sample_at) = (None, None);
                (self.hold_follows, self.halt_precedes, self.halted) = (None, false, None);
                (self.time, self.dt) = (0.0, 0.0);
                self.armed = arm;
            }
            Control::Bye(bye) => return Err(Wrong::End(self.left(bye.cause, &bye.text))),
            other => {
                return Err(Wrong::End(TestEnd::failed(format_args!(
                    "the controller sent {}",
                    other.name()
                ))));
            }
        }
        let written = self.encoder.control(message, &mut self.out);
        Ok(self.send(written)?)
    }

    /// The controller hears why it is not armed again, and that this is the end.
    fn refused(&mut self, refuse: Refuse) -> TestEnd {
        let text = refuse.text.clone();
        if let Ok(message) = handshake::encode(&Control::Refuse(refuse)) {
            let written = self.encoder.control(&message, &mut self.out);
            // Who does not hear it sees the connection close.
            let _ = self.send(written);
        }
        TestEnd::failed(format_args!("refused: {text}"))
    }

    /// The specimen across the other link is gone: the controller hears why, and that this is the end.
    pub(super) fn lost_specimen(&mut self, trip: Trip) -> TestEnd {
        let text = self.station.whole(trip);
        self.say(Cause::Tripped, &text);
        self.say_goodbye(Cause::Tripped);
        TestEnd::failed(text)
    }

    /// Our own operator ends the test: the controller hears it.
    pub(super) fn told_to_stop(&mut self) -> TestEnd {
        self.say_goodbye(Cause::Shutdown);
        TestEnd::told_to_stop()
    }

    /// Last words for people.
    fn say(&mut self, cause: Cause, text: &str) {
        let mut text = text.to_owned();
        text.retain(|c| !is_hidden(c));
        while text.len() > TEXT_LIMIT {
            text.pop();
        }
        let bye = Control::Bye(Bye {
            cause: cause.code(),
            text,
        });
        if let Ok(message) = handshake::encode(&bye) {
            let written = self.encoder.control(&message, &mut self.out);
            self.send_last(written);
        }
    }

    pub(super) fn say_goodbye(&mut self, cause: Cause) {
        let notice = Notice {
            sequence: self.sequence.unwrap_or_default(),
            cause,
        };
        let written = self.encoder.goodbye(notice, &mut self.out);
        self.send_last(written);
    }

    /// Whoever does not hear it sees the connection close, or, over datagrams, asks again.
    fn send_last(&mut self, written: Result<usize, WireError>) {
        if let (Ok(length), false) = (&written, self.inbox.is_stream()) {
            let frame = self.out.get(..*length).unwrap_or_default();
            self.last_words.push(frame.to_vec());
        }
        let _ = self.send(written);
    }
}
