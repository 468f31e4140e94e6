//! The conversation with one native client: commands in, measurements out.
//!
//! The specimen commits a command when the next one comes.
//! A command that repeats the position at the same test time is answered again from the same state.
//! So a test over a link takes the same course as one in process, bit for bit.
//! A computed specimen gets every command.
//! A specimen behind another link gets the newest of the commands that came while it was busy.

mod ends;
mod exchange;

use super::ServerEvent;
use super::backlog::{Backlog, WaitingCommand};
use super::channel::Channel;
use super::commanded::{CommandCount, CommandInForce, Effect, NextMotion};
use super::farewell::Farewell;
use super::native_codec::NativeCodec;
use super::native_handshake::NativeOpening;
use super::sampling::SampleClock;
use super::session::Conversation;
use super::shared::Shared;
use super::silence::{Due, Silence};
use crate::Transport;
use crate::served::{ServedSpecimen, TestEnd};
use crate::socket::LOOK;
use ends::Wrong;
use gusset_quantity::catalog::event::Remark;
use gusset_quantity::substructure::{LinkFault, Status};
use gusset_quantity::time::Nanos;
use gusset_wire::WireError;
use gusset_wire::handshake::Arm;
use gusset_wire::native::{Cause, Frame, Heartbeat, Moment, Notice};

/// Reads of the messages that came while the specimen was busy, before the newest command is passed on.
const MOST_READS: u32 = 64;
/// The stop flag and the specimen are checked this often.
const LOOK_NS: u64 = 50_000_000;

/// The conversation with one client.
pub(super) struct NativeConversation {
    codec: NativeCodec,
    served: ServedSpecimen,
    /// The last Arm of the client that the server granted.
    armed: Arm,
    commanded: CommandInForce,
    count: CommandCount,
    backlog: Backlog,
    sampling: SampleClock,
    silence: Silence,
    /// Number of the command behind which the client stopped last.
    halted: Option<u64>,
    /// The specimen was checked at this time.
    attended: Nanos,
    /// The next test finds the specimen in its initial state.
    starts_anew: bool,
    /// The last frames over datagrams, which the network may lose.
    last_frames: Vec<Vec<u8>>,
}

/// The content of a frame. The vectors of a command are in the conversation already.
enum Message {
    Command(WaitingCommand, Effect),
    Hold(Notice),
    Retire(Notice),
    Goodbye(Notice),
    Control(Vec<u8>),
    Nothing,
}

/// Reader of a client's frames.
struct Reader<'a> {
    codec: &'a mut NativeCodec,
    silence: &'a mut Silence,
    next: &'a mut NextMotion,
    count: &'a CommandCount,
    /// Number of the first command of the test, and of the newest one.
    first: u64,
    newest: Option<u64>,
}

impl Reader<'_> {
    /// Reads one frame. Nothing of a command is read before its test time is checked, because its vectors replace those of the
    /// waiting command.
    fn read(&mut self, place: std::ops::Range<usize>, now: Nanos) -> Result<Message, WireError> {
        let received = self.codec.open(place)?;
        self.silence.heard(now);
        Ok(match received.frame {
            Frame::Command(command) => {
                let (sequence, time, dt) = (command.sequence, command.time, command.dt);
                if !(0.0..=self.count.longest(sequence)).contains(&dt) {
                    return Err(WireError::Range {
                        field: "command dt",
                        index: 0,
                        found: dt,
                    });
                }
                let effect = self.next.read(&command, self.first, self.newest)?;
                Message::Command(WaitingCommand { sequence, time, dt }, effect)
            }
            Frame::Hold(notice) => Message::Hold(notice),
            Frame::Heartbeat(_) | Frame::Measurement(_) => Message::Nothing,
            Frame::Retire(notice) => Message::Retire(notice),
            Frame::Goodbye(notice) => Message::Goodbye(notice),
            Frame::Control(message) => Message::Control(message.to_vec()),
        })
    }
}

impl NativeConversation {
    /// The specimen is armed, and the client knows it.
    pub(crate) fn new(
        opening: NativeOpening,
        mut served: ServedSpecimen,
        now: Nanos,
        spin_ns: u64,
        starts_anew: bool,
    ) -> Self {
        let NativeOpening {
            inbox,
            greeted,
            arm,
        } = opening;
        served.starts(now);
        // The server of a specimen behind another link samples at the requested time: its answer is passed on at once.
        let after_ns = greeted.sample_after_ns.filter(|_| !served.is_remote());
        Self {
            sampling: SampleClock::new(now, after_ns, greeted.period_ns, spin_ns),
            silence: Silence::new(greeted.watchdog_ns, now),
            commanded: CommandInForce::new(&arm.disp),
            count: CommandCount::new(arm.first_sequence, greeted.period_ns),
            backlog: Backlog::default(),
            codec: NativeCodec::new(inbox, greeted),
            served,
            armed: arm,
            halted: None,
            attended: now,
            starts_anew,
            last_frames: Vec::new(),
        }
    }

    /// The number of the newest command.
    fn newest(&self) -> Option<u64> {
        self.backlog.sequence().or(self.commanded.sequence)
    }

    /// Takes every complete frame that is here.
    fn take_frames(&mut self, channel: &mut Channel, shared: &Shared) -> Result<(), TestEnd> {
        loop {
            let outcome = match self.codec.next() {
                Ok(None) => return Ok(()),
                Ok(Some(place)) => self.take(place, channel, shared),
                Err(error) => Err(Wrong::Wire(error)),
            };
            match outcome {
                Ok(()) => {}
                Err(Wrong::End(end)) => return Err(end),
                Err(Wrong::Wire(error)) => self.codec.failed(error).map_err(TestEnd::failed)?,
            }
        }
    }

    fn take(
        &mut self,
        place: std::ops::Range<usize>,
        channel: &mut Channel,
        shared: &Shared,
    ) -> Result<(), Wrong> {
        let now = channel.now();
        let newest = self.newest();
        match self.reader(newest).read(place, now)? {
            Message::Command(command, effect) => {
                self.obey(command, effect, now, channel, shared)?
            }
            Message::Hold(notice) => self.take_notice(notice),
            Message::Retire(notice) => return Err(Wrong::End(self.retired(notice, channel))),
            Message::Goodbye(notice) => {
                return Err(Wrong::End(self.left(notice.cause.code(), "")));
            }
            Message::Control(message) => self.again_armed(&message, channel, shared)?,
            Message::Nothing => {}
        }
        Ok(())
    }

    fn reader(&mut self, newest: Option<u64>) -> Reader<'_> {
        Reader {
            codec: &mut self.codec,
            silence: &mut self.silence,
            next: &mut self.commanded.next,
            count: &self.count,
            first: self.armed.first_sequence,
            newest,
        }
    }

    /// Real-time: yes.
    fn obey(
        &mut self,
        command: WaitingCommand,
        effect: Effect,
        now: Nanos,
        channel: &mut Channel,
        shared: &Shared,
    ) -> Result<(), TestEnd> {
        match effect {
            Effect::Overtaken => Ok(()),
            // Its answer will follow.
            Effect::Repeated if !self.backlog.is_empty() => Ok(()),
            Effect::Repeated => self.answer(now, channel),
            Effect::New if self.served.is_remote() => {
                self.backlog.put(command);
                if self.served.is_paced() && self.backlog.is_too_far_ahead() {
                    return Err(self.too_far_ahead(command.sequence, channel));
                }
                Ok(())
            }
            Effect::New => self.command(command, now, channel, shared),
        }
    }

    /// A notice of a hold or a stop. A notice that was overtaken by a command has no effect.
    fn take_notice(&mut self, notice: Notice) {
        if self.newest().is_some_and(|newest| notice.sequence < newest) {
            return;
        }
        if !self.backlog.is_empty() {
            self.backlog.follow(notice.cause);
        } else if notice.cause == Cause::Operator {
            self.hold();
        } else {
            self.halt();
        }
    }

    /// Passes the newest command that is here on to a specimen behind another link; the commands that it overtook are missed.
    fn pass_on(&mut self, channel: &mut Channel, shared: &Shared) -> Result<(), TestEnd> {
        if self.backlog.is_empty() {
            return Ok(());
        }
        // Its last frames came before it closed, and are read first.
        let has_hung_up = channel.link.has_hung_up();
        for _ in 0..MOST_READS {
            if !self.receive(channel, LOOK)? {
                break;
            }
            self.take_frames(channel, shared)?;
        }
        if has_hung_up {
            return Err(channel.lost(true, LinkFault::Closed));
        }
        let Some((command, halt_precedes)) = self.backlog.take() else {
            return Ok(());
        };
        if halt_precedes {
            self.halt();
        }
        let now = channel.now();
        self.command(command, now, channel, shared)?;
        match self.backlog.take_notice() {
            Some(Cause::Operator) => self.hold(),
            Some(_) => self.halt(),
            None => {}
        }
        Ok(())
    }

    /// The client is held by its operator: no command need come.
    fn hold(&mut self) {
        if !self.silence.pause() {
            self.served.pause();
        }
    }

    /// The client stops here, and its shutdown begins. A repetition has no effect.
    fn halt(&mut self) {
        self.silence.pause();
        let sequence = self.commanded.sequence;
        if self.halted != sequence || sequence.is_none() {
            self.halted = sequence;
            self.served.halt();
        }
    }

    /// A new command is in force.
    fn command(
        &mut self,
        command: WaitingCommand,
        now: Nanos,
        channel: &mut Channel,
        shared: &Shared,
    ) -> Result<(), TestEnd> {
        let WaitingCommand { sequence, time, dt } = command;
        if self.sampling.is_waiting() {
            // Commands come faster than agreed: the measurement of the one before is taken now, not lost.
            self.answer(now, channel)?;
        }
        if self.silence.go_on() {
            let resumed = ServerEvent::Resumed { sequence };
            let text = resumed.to_string();
            self.served.note(Remark::CommandsAgain, &text);
            shared.tell(resumed);
        }
        let longest = self.count.longest(sequence);
        let before = sequence.checked_sub(1);
        let gap = before.map_or(0, |before| self.count.misses_up_to(before));
        self.count.expect(sequence.saturating_add(1));
        let is_first = self.commanded.sequence.is_none();
        if !is_first && !self.commanded.stays(dt) {
            self.served.commit();
        }
        // Over a gap the motion took as long as all the steps that were lost, too.
        let elapsed = if gap == 0 || is_first {
            dt
        } else {
            (time - self.commanded.time).max(dt).min(longest)
        };
        self.commanded.advance(sequence, time, dt);
        self.exchange(elapsed, now, channel, shared)?;
        if self.sampling.arrive(now) {
            return Ok(());
        }
        if !self.served.is_remote() {
            return self.answer(now, channel);
        }
        // The measurement of a specimen behind another link comes only now. The client was not silent meanwhile: it waited.
        let now = channel.now();
        self.silence.heard(now);
        self.answer(now, channel)
    }

    /// Sends the measurement of the command in force. Real-time: yes.
    fn answer(&mut self, now: Nanos, channel: &mut Channel) -> Result<(), TestEnd> {
        let status = self.status();
        let moment = Moment {
            sampled_after: self.sampling.take(now),
            missed: self.count.missed,
        };
        let measured = &mut self.commanded.measured;
        measured.sequence = self.commanded.sequence.unwrap_or_default();
        measured.time = self.sampling.own_time(now);
        measured.status = status;
        let is_stream = self.codec.is_stream();
        let frame = self.codec.measurement(measured, moment);
        self.backlog.answered();
        send(channel, is_stream, frame)
    }

    /// Everything that happens because time passes.
    fn keep_time(
        &mut self,
        now: Nanos,
        channel: &mut Channel,
        shared: &Shared,
    ) -> Result<(), TestEnd> {
        if self.sampling.is_due(now) {
            self.answer(now, channel)?;
        }
        let silent_ns = self.silence.lasts_ns(now);
        if self.silence.is_final(now) {
            self.say_goodbye(Cause::Watchdog, channel);
            return Err(channel.silent(silent_ns));
        }
        if now.since(self.attended) >= LOOK_NS {
            self.attended = now;
            if let Err(trip) = self.served.attend() {
                return Err(self.lost_specimen(trip, channel));
            }
        }
        match self.silence.due(now) {
            Due::Nothing => return Ok(()),
            Due::Hold => {
                let text = "no command comes from the controller: the specimen holds";
                self.served.note(Remark::Holding, text);
                shared.tell(ServerEvent::Holding {
                    sequence: self.commanded.sequence,
                    silent_s: silent_ns as f64 * 1e-9,
                });
            }
            Due::Heartbeat => {}
        }
        let beat = Heartbeat {
            sequence: self.commanded.sequence.unwrap_or_default(),
            time: self.sampling.own_time(now),
            status: self.status(),
        };
        let is_stream = self.codec.is_stream();
        send(channel, is_stream, self.codec.heartbeat(beat))
    }

    /// Real-time: yes.
    fn status(&self) -> Status {
        let flags = self.commanded.flags;
        if self.silence.is_holding() {
            Status(flags.0 | Status::HOLDING.0)
        } else {
            flags
        }
    }

    /// Takes bytes of the client until a time; false if nothing comes. Real-time: yes.
    fn receive(&mut self, channel: &mut Channel, until: Nanos) -> Result<bool, TestEnd> {
        match channel.link.recv(self.codec.space(), until) {
            Ok(Some(count)) => {
                self.codec.filled(count);
                Ok(true)
            }
            Ok(None) => Ok(false),
            Err(fault) => Err(channel.lost(self.codec.is_stream(), fault)),
        }
    }
}

impl Conversation for NativeConversation {
    type End = TestEnd;

    fn turn(&mut self, channel: &mut Channel, shared: &Shared) -> Result<Nanos, TestEnd> {
        self.take_frames(channel, shared)?;
        self.pass_on(channel, shared)?;
        let now = channel.now();
        self.keep_time(now, channel, shared)?;
        let until = self.silence.next(now.plus(LOOK_NS));
        let runs = self.commanded.sequence.is_some();
        let (wait, until) = self.sampling.wait(now, until, runs);
        channel.link.set_wait(wait);
        Ok(until)
    }

    fn listen(&mut self, channel: &mut Channel, until: Nanos) -> Result<(), TestEnd> {
        self.receive(channel, until).map(|_| ())
    }

    fn stopped(&mut self, channel: &mut Channel) -> TestEnd {
        self.told_to_stop(channel)
    }

    fn finish(mut self, channel: &mut Channel, end: TestEnd, shared: &Shared) {
        let farewell = Farewell::new(channel.peer, std::mem::take(&mut self.last_frames));
        let ended = self.close(end, channel);
        if channel.link.wire_end().is_none() {
            // Closing the records may take as long as a client waits.
            farewell.answers(&mut channel.link);
            shared.part(farewell);
        }
        shared.tell(ended);
    }
}

/// Sends a frame of the codec. Real-time: yes.
fn send(
    channel: &mut Channel,
    is_stream: bool,
    frame: Result<&[u8], WireError>,
) -> Result<(), TestEnd> {
    let sent = channel.link.send(frame.map_err(TestEnd::failed)?);
    sent.map_err(|fault| channel.lost(is_stream, fault))
}

#[cfg(test)]
mod tests;
