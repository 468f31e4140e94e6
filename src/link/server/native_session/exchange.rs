//! The exchange of a native client's command with the specimen.
//!
//! The path of the specimen to a paced target may be long. Meanwhile each tick reads the frames of the client, so that a hold, a
//! retire or a goodbye is obeyed within a tick, and a lost client is noticed.

use super::ends::Wrong;
use super::{MOST_READS, Message, NativeConversation, Reader};
use crate::Transport;
use crate::served::TestEnd;
use crate::served::Trip;
use crate::server::ServerEvent;
use crate::server::backlog::Backlog;
use crate::server::channel::Channel;
use crate::server::commanded::Effect;
use crate::server::connection::ClientLink;
use crate::server::shared::Shared;
use crate::socket::LOOK;
use gusset_quantity::substructure::{LinkFault, Status};
use gusset_quantity::time::Nanos;
use gusset_wire::handshake::{self, Arm, Control};
use gusset_wire::native::Notice;

/// Why a specimen comes to rest on its path to a target.
enum Interruption {
    /// The client is lost.
    Gone(LinkFault),
    /// A frame failed a check.
    Wrong(Wrong),
    /// The client is further ahead than it may be, with this command.
    TooFarAhead(u64),
    /// The client armed again before its command was answered.
    ArmedAgain,
    /// A hold, a retire or a goodbye.
    Message(Message),
}

impl NativeConversation {
    /// The exchange of the command in force with the specimen.
    pub(super) fn exchange(
        &mut self,
        elapsed: f64,
        now: Nanos,
        channel: &mut Channel,
        shared: &Shared,
    ) -> Result<(), TestEnd> {
        self.served.now_is(now);
        let was_tripped = self.served.tripped().is_some();
        let looks = self.served.is_paced();
        // A hold that came with the target: its path does not begin.
        let notice = looks.then(|| self.backlog.take_notice()).flatten();
        let (command, measured, next) = self.commanded.exchange();
        let sequence = command.sequence;
        let hold = notice.map(|cause| Message::Hold(Notice { sequence, cause }));
        let mut interruption = hold.map(Interruption::Message);
        let mut ahead = Ahead {
            link: &mut channel.link,
            armed: &self.armed,
            backlog: &mut self.backlog,
            reader: Reader {
                codec: &mut self.codec,
                silence: &mut self.silence,
                next,
                count: &self.count,
                first: self.armed.first_sequence,
                newest: Some(sequence),
            },
        };
        let mut wanted = || {
            if looks && interruption.is_none() {
                interruption = ahead.look().err();
            }
            interruption.is_none() && !shared.is_stopped()
        };
        let outcome = (self.served).exchange(&command, elapsed, &mut wanted, measured);
        self.commanded.flags = self.commanded.measured.status;
        self.count.commands += 1;
        match outcome {
            Err(trip @ Trip::Lost(_)) => return Err(self.lost_specimen(trip, channel)),
            Err(trip) if !was_tripped => {
                let text = self.served.whole(trip);
                shared.tell(ServerEvent::Tripped { sequence, text });
                if let Some(text) = self.served.next_step() {
                    shared.tell(ServerEvent::Told { text });
                }
            }
            Ok(false) if interruption.is_none() => return Err(self.told_to_stop(channel)),
            Err(_) | Ok(_) => {}
        }
        interruption.map_or(Ok(()), |why| self.interrupted(why, channel))
    }

    /// The specimen rests on its path: ends the test, or holds until the next command.
    fn interrupted(&mut self, why: Interruption, channel: &mut Channel) -> Result<(), TestEnd> {
        Err(match why {
            Interruption::Gone(fault) => channel.lost(self.codec.is_stream(), fault),
            Interruption::Wrong(Wrong::End(end)) => end,
            Interruption::Wrong(Wrong::Wire(error)) => TestEnd::failed(error),
            Interruption::TooFarAhead(sequence) => self.too_far_ahead(sequence, channel),
            Interruption::ArmedAgain => {
                TestEnd::failed("the controller armed again before its last command was answered")
            }
            Interruption::Message(Message::Retire(notice)) => self.retired(notice, channel),
            Interruption::Message(Message::Goodbye(notice)) => self.left(notice.cause.code(), ""),
            Interruption::Message(Message::Control(bye)) => {
                return match self.take_bye(&bye) {
                    Ok(end) => Err(end),
                    Err(error) => Err(TestEnd::failed(error)),
                };
            }
            Interruption::Message(Message::Hold(notice)) => {
                // The measurement does not belong to the command.
                self.commanded.flags.0 |= Status::HOLDING.0;
                self.take_notice(notice);
                return Ok(());
            }
            Interruption::Message(Message::Command(..) | Message::Nothing) => return Ok(()),
        })
    }
}

/// The frames of a client that come while its command is obeyed.
struct Ahead<'a> {
    link: &'a mut ClientLink,
    armed: &'a Arm,
    backlog: &'a mut Backlog,
    reader: Reader<'a>,
}

impl Ahead<'_> {
    /// Reads the frames that have come. Real-time: yes, but for the end of a session.
    ///
    /// # Errors
    /// Why the specimen must come to rest.
    fn look(&mut self) -> Result<(), Interruption> {
        // Its last frames came before it closed, and are read first.
        let has_hung_up = self.link.has_hung_up();
        for _ in 0..MOST_READS {
            let now = self.link.now();
            self.take_frames(now)?;
            let room = self.reader.codec.space();
            match self.link.recv(room, LOOK).map_err(Interruption::Gone)? {
                Some(count) => self.reader.codec.filled(count),
                None => break,
            }
        }
        if has_hung_up {
            return Err(Interruption::Gone(LinkFault::Closed));
        }
        // Over datagrams nothing hangs up, and a client that waits repeats its command.
        let is_silent = self.reader.silence.is_final(self.link.now());
        if is_silent && !self.reader.codec.is_stream() {
            return Err(Interruption::Gone(LinkFault::Timeout));
        }
        Ok(())
    }

    fn take_frames(&mut self, now: Nanos) -> Result<(), Interruption> {
        loop {
            let read = match self.reader.codec.next() {
                Ok(None) => return Ok(()),
                Ok(Some(place)) => self.reader.read(place, now),
                Err(error) => Err(error),
            };
            let taken = match read {
                Ok(message) => self.take(message),
                Err(error) => Err(Interruption::Wrong(Wrong::Wire(error))),
            };
            match taken {
                Err(Interruption::Wrong(Wrong::Wire(error))) => {
                    // Over datagrams it is counted and dropped.
                    let failed = self.reader.codec.failed(error);
                    failed.map_err(|error| Interruption::Wrong(Wrong::Wire(error)))?;
                }
                taken => taken?,
            }
        }
    }

    fn take(&mut self, message: Message) -> Result<(), Interruption> {
        match message {
            Message::Command(command, Effect::New) => {
                self.reader.newest = Some(command.sequence);
                self.backlog.put(command);
                if self.backlog.is_too_far_ahead() {
                    return Err(Interruption::TooFarAhead(command.sequence));
                }
                Ok(())
            }
            // Its answer will follow.
            Message::Command(..) | Message::Nothing => Ok(()),
            Message::Control(message) => match handshake::decode(&message) {
                // Its answer was lost, and a command has come since.
                Ok(Control::Arm(arm)) if arm == *self.armed => Ok(()),
                Ok(Control::Arm(_)) => Err(Interruption::ArmedAgain),
                Ok(_) => Err(Interruption::Message(Message::Control(message))),
                Err(error) => Err(Interruption::Wrong(Wrong::Wire(error))),
            },
            // A notice that was overtaken by a command has no effect.
            Message::Hold(notice)
                if (self.reader.newest).is_some_and(|newest| notice.sequence < newest) =>
            {
                Ok(())
            }
            message => Err(Interruption::Message(message)),
        }
    }
}
