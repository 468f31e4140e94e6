//! The end of a native session with its last frames, and a repeated Arm.

use super::{NativeConversation, send};
use crate::Transport;
use crate::served::{TestEnd, Trip, with_last_words};
use crate::server::ServerEvent;
use crate::server::backlog::Backlog;
use crate::server::channel::{Channel, said_goodbye};
use crate::server::native_handshake;
use crate::server::shared::Shared;
use gusset_quantity::catalog::ending::{self, Kind};
use gusset_wire::WireError;
use gusset_wire::handshake::{self, Arm, Control, Refuse};
use gusset_wire::native::{Cause, Notice};

/// The end of a session, or a frame that failed a check.
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

impl NativeConversation {
    pub(super) fn retired(&mut self, notice: Notice, channel: &mut Channel) -> TestEnd {
        let how = match notice.cause {
            Cause::Orderly => "at the end of the test",
            Cause::Operator => "by the operator",
            Cause::Tripped => "because the test tripped",
            Cause::Watchdog => "because its controller is lost",
            Cause::Shutdown => "because the program that commands it ends",
            Cause::Interlock => "because an interlock opened",
            Cause::Lost => "because another specimen is lost",
        };
        let cause = notice.cause.ending();
        self.commits_what_ends(cause);
        // Zero is not a valid number if no command was sent.
        if notice.sequence > 0 || self.commanded.sequence.is_some() {
            self.count.misses_up_to(notice.sequence);
        }
        match self.served.tripped() {
            Some(trip) => {
                let told = if self.served.has_lost_it() {
                    Cause::Lost
                } else {
                    Cause::Tripped
                };
                // The reason of the trip, for the summary of the client.
                let why = self.served.whole(trip);
                // At once: a client waits for a short time only, and the goodbye of the specimen may take longer.
                self.say(told, &why, channel);
                let said = self.served.dismiss(trip.cause());
                if said.is_some() {
                    self.say(told, &with_last_words(why, said), channel);
                }
                self.say_goodbye(told, channel);
            }
            None => {
                if let Some(said) = self.served.dismiss(cause) {
                    self.say(Cause::Orderly, &said, channel);
                }
                self.say_goodbye(Cause::Orderly, channel);
            }
        }
        TestEnd::of(cause, format!("retired {how}"))
    }

    /// The client leaves without a retire.
    pub(super) fn left(&mut self, cause: u32, text: &str) -> TestEnd {
        let over = said_goodbye(cause, text);
        self.commits_what_ends(over.cause);
        over
    }

    fn commits_what_ends(&mut self, cause: ending::Cause) {
        let is_orderly = matches!(cause.kind(), Kind::Completion | Kind::Operator);
        if is_orderly && self.commanded.sequence.is_some() {
            self.served.commit();
        }
    }

    /// A control message. An Arm again: its answer was lost, or the test begins again at the position of the specimen, after commands
    /// that only checked the wiring. Any other message ends the session.
    pub(super) fn again_armed(
        &mut self,
        message: &[u8],
        channel: &mut Channel,
        shared: &Shared,
    ) -> Result<(), Wrong> {
        match handshake::decode(message)? {
            Control::Arm(arm) if arm == self.armed => {}
            Control::Arm(arm) => {
                let session = self.armed.session;
                if let Err(refuse) = native_handshake::fits(&arm, session, self.commanded.disp()) {
                    return Err(Wrong::End(self.refused(refuse, channel)));
                }
                if arm.first_sequence <= self.newest().unwrap_or(self.armed.first_sequence) {
                    // An earlier one, late.
                    return Ok(());
                }
                self.begin_again(arm, channel, shared)?;
            }
            _ => return Err(Wrong::End(self.take_bye(message)?)),
        }
        let is_stream = self.codec.is_stream();
        Ok(send(channel, is_stream, self.codec.control(message))?)
    }

    /// A control message that ends the session, as each one but an Arm does.
    pub(super) fn take_bye(&mut self, message: &[u8]) -> Result<TestEnd, WireError> {
        Ok(match handshake::decode(message)? {
            Control::Bye(bye) => self.left(bye.cause, &bye.text),
            other => TestEnd::failed(format_args!("the controller sent {}", other.name())),
        })
    }

    /// The client does not wait for answers: informs it, and ends the session.
    pub(super) fn too_far_ahead(&mut self, sequence: u64, channel: &mut Channel) -> TestEnd {
        let text = format!(
            "command {sequence} came before the two commands ahead of it were answered: with `serve.pace` a controller waits for the answer to \
             each target"
        );
        self.say(Cause::Tripped, &text, channel);
        self.say_goodbye(Cause::Tripped, channel);
        TestEnd::failed(text)
    }

    fn begin_again(
        &mut self,
        arm: Arm,
        channel: &mut Channel,
        shared: &Shared,
    ) -> Result<(), TestEnd> {
        let mut wanted = || {
            if shared.is_stopped() {
                return Err(TestEnd::told_to_stop());
            }
            Ok(())
        };
        let begun = self
            .served
            .begin_again(arm.first_sequence, &arm.disp, &mut wanted);
        begun.map_err(|over| match self.served.tripped() {
            Some(trip @ Trip::Lost(_)) => self.lost_specimen(trip, channel),
            _ if over.cause == ending::Cause::Shutdown => self.told_to_stop(channel),
            _ => over,
        })?;
        let now = channel.now();
        self.served.starts(now);
        if let Some(waiting) = self.backlog.sequence() {
            self.count.misses_up_to(waiting);
        }
        self.commanded.reset();
        self.count.expect(arm.first_sequence);
        channel.link.armed(arm.first_sequence);
        self.backlog = Backlog::default();
        self.sampling.take(now);
        self.halted = None;
        self.armed = arm;
        Ok(())
    }

    /// Tells the client why it is not armed again, and that the session ends.
    fn refused(&mut self, refuse: Refuse, channel: &mut Channel) -> TestEnd {
        let text = refuse.text.clone();
        let is_stream = self.codec.is_stream();
        // A client that does not receive it sees the connection close.
        let _ = send(channel, is_stream, self.codec.refusal(refuse));
        TestEnd::failed(format_args!("refused: {text}"))
    }

    /// The link to the specimen is lost: sends the client the reason, and ends the session.
    pub(super) fn lost_specimen(&mut self, trip: Trip, channel: &mut Channel) -> TestEnd {
        let text = self.served.whole(trip);
        self.say(Cause::Lost, &text, channel);
        self.say_goodbye(Cause::Lost, channel);
        TestEnd::failed(text)
    }

    /// The operator of this server ends the test: informs the client.
    pub(super) fn told_to_stop(&mut self, channel: &mut Channel) -> TestEnd {
        self.say_goodbye(Cause::Shutdown, channel);
        TestEnd::told_to_stop()
    }

    /// Tells the reason of the end, for people.
    fn say(&mut self, cause: Cause, text: &str, channel: &mut Channel) {
        let is_stream = self.codec.is_stream();
        let frame = self.codec.bye(cause, text);
        send_last(channel, is_stream, frame, &mut self.last_frames);
    }

    pub(super) fn say_goodbye(&mut self, cause: Cause, channel: &mut Channel) {
        let notice = Notice {
            sequence: self.commanded.sequence.unwrap_or_default(),
            cause,
        };
        let is_stream = self.codec.is_stream();
        let frame = self.codec.goodbye(notice);
        send_last(channel, is_stream, frame, &mut self.last_frames);
    }

    /// Closes the records of the session, and returns the report.
    pub(super) fn close(mut self, end: TestEnd, channel: &Channel) -> ServerEvent {
        let TestEnd {
            cause, mut text, ..
        } = end;
        let unreachable = channel.link.unreachable();
        if unreachable > 0 {
            text = format!("{text}; the network said {unreachable} times that it was unreachable");
        }
        if let Some(waiting) = self.backlog.sequence() {
            self.count.misses_up_to(waiting);
        }
        let (commands, missed) = (self.count.commands, self.count.missed);
        let corrupt = self.codec.corrupt();
        self.served.counted(commands, missed, corrupt);
        let lost = self
            .served
            .tripped()
            .filter(|trip| matches!(trip, Trip::Lost(_)));
        // The log contains the trip already, before everything else.
        let what_else = match lost {
            Some(trip) if self.served.whole(trip) == text => "the controller was informed",
            _ => &text,
        };
        self.served.end(cause, what_else);
        ServerEvent::Ended {
            text,
            commands,
            missed,
            corrupt,
            // A computed specimen of this process is where it was, whatever faults a script plays.
            is_lost: lost.is_some() && self.served.is_remote(),
            starts_anew: self.starts_anew,
        }
    }
}

/// Sends a last frame. Over datagrams it is kept, because the client asks again if the network loses it; over a stream the client
/// sees the connection close.
fn send_last(
    channel: &mut Channel,
    is_stream: bool,
    frame: Result<&[u8], WireError>,
    last_frames: &mut Vec<Vec<u8>>,
) {
    if let (Ok(frame), false) = (&frame, is_stream) {
        last_frames.push(frame.to_vec());
    }
    let _ = send(channel, is_stream, frame);
}
