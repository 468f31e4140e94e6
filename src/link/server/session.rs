//! The specimen and its controller: commands in, measurements out.
//!
//! The specimen commits what it was last told when the next command comes. A command that only repeats where it is (test
//! time stands still and nothing differs) is answered again from the same state, so that a test over a link takes the
//! same course as one in process, to the last bit. A formula gets every command; a specimen across another link gets the
//! newest of those that came while it was busy, never a burst of them.

mod commands;
mod ends;
mod watch;

use commands::Moves;
use ends::Wrong;
use std::net::SocketAddr;
use std::sync::atomic::Ordering;

use super::armed::{Session, hear, lost_controller};
use super::line::Line;
use super::parted::Parted;
use super::{Desk, Heard};
use crate::link::Transport;
use crate::link::inbox::Inbox;
use crate::link::rig::{Station, TestEnd, Trip};
use crate::substructure::{Measurement, Status};
use crate::time::Nanos;
use crate::wire::WireError;
use crate::wire::handshake::Arm;
use crate::wire::native::{Cause, Decoder, Encoder, Frame, LARGEST_FRAME};

/// The specimen and its controller.
pub(super) struct Stand {
    line: Line,
    inbox: Inbox,
    peer: SocketAddr,
    encoder: Encoder,
    decoder: Decoder,
    out: Vec<u8>,
    station: Station,
    watchdog_ns: u64,
    period_ns: u64,
    spin_ns: u64,
    sample_after_ns: Option<u64>,
    /// What the controller asked for last, and was granted.
    armed: Arm,
    /// The command in force.
    sequence: Option<u64>,
    next_sequence: u64,
    time: f64,
    dt: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
    new_disp: Vec<f64>,
    new_vel: Vec<f64>,
    measured: Measurement,
    /// Flags of the specimen itself.
    flags: Status,
    /// A command that has come and was not passed on yet: number, test time and its step.
    pending: Option<(u64, f64, f64)>,
    /// A hold that came behind that command: the specimen hears of it after the command, which would end it.
    hold_follows: Option<Cause>,
    /// Number of the command behind which the controller stopped last.
    halted: Option<u64>,
    /// A stop of the test stood between that command and the one before, which was never passed on.
    halt_precedes: bool,
    arrived: Nanos,
    /// The measurement of the command in force is still to be taken, at this time.
    sample_at: Option<Nanos>,
    begun: Nanos,
    heard_at: Nanos,
    beat_at: Nanos,
    attended: Nanos,
    paused: bool,
    holding: bool,
    commands: u64,
    missed: u32,
    corrupt: u64,
    /// Frames that were said at the end, over datagrams.
    last_words: Vec<Vec<u8>>,
}

/// Reads of what came while the specimen was busy, before the newest command is passed on.
const MOST_READS: u32 = 64;

impl Stand {
    pub(super) fn new(session: Session, station: Station, spin_ns: u64) -> Self {
        let Session {
            line,
            inbox,
            peer,
            greeted,
            arm,
            heard_at: _,
        } = session;
        let axes = station.axes();
        let now = line.now();
        let mut station = station;
        station.starts(now);
        Self {
            line,
            inbox,
            peer,
            encoder: greeted.encoder,
            decoder: greeted.decoder,
            out: vec![0; LARGEST_FRAME],
            // The far end of a gateway samples when it was asked to: its answer is passed on at once.
            sample_after_ns: greeted.sample_after_ns.filter(|_| !station.is_remote()),
            station,
            watchdog_ns: greeted.watchdog_ns,
            period_ns: greeted.period_ns,
            spin_ns,
            sequence: None,
            next_sequence: arm.first_sequence,
            time: 0.0,
            dt: 0.0,
            disp: arm.disp.clone(),
            armed: arm,
            vel: vec![0.0; axes],
            new_disp: vec![0.0; axes],
            new_vel: vec![0.0; axes],
            measured: Measurement::zeros(axes),
            flags: Status::default(),
            pending: None,
            hold_follows: None,
            halted: None,
            halt_precedes: false,
            arrived: now,
            sample_at: None,
            begun: now,
            heard_at: now,
            beat_at: now,
            attended: now,
            paused: false,
            holding: false,
            commands: 0,
            missed: 0,
            corrupt: 0,
            last_words: Vec::new(),
        }
    }

    /// Runs the session to its end.
    pub(super) fn run(mut self, desk: &Desk) -> Heard {
        let end = self.course(desk);
        let parted = Parted::new(self.peer, std::mem::take(&mut self.last_words));
        let (ended, mut line) = self.finish(end, desk.host.starts_anew());
        // Closing the books may take as long as a controller is patient.
        parted.answers(&mut line);
        desk.part(parted);
        ended
    }

    /// The books of a session are closed; what there is to tell, and the line.
    pub(super) fn finish(
        mut self,
        TestEnd { cause, mut text }: TestEnd,
        starts_anew: bool,
    ) -> (Heard, Line) {
        let unreachable = self.line.unreachable();
        if unreachable > 0 {
            text = format!("{text}; the network said {unreachable} times that it was unreachable");
        }
        if let Some((pending, ..)) = self.pending {
            self.misses_up_to(pending);
        }
        self.station
            .counted(self.commands, self.missed, self.corrupt);
        let lost = self
            .station
            .tripped()
            .filter(|trip| matches!(trip, Trip::Lost(_)));
        // The log has the trip already, and says it before whatever else is said.
        let what_else = match lost {
            Some(trip) if self.station.whole(trip) == text => "the controller was informed",
            _ => &text,
        };
        self.station.end(cause, what_else);
        let ended = Heard::Ended {
            text,
            commands: self.commands,
            missed: self.missed,
            corrupt: self.corrupt,
            // A formula in this process is where it was, whatever was played on it.
            is_lost: lost.is_some() && self.station.is_remote(),
            starts_anew,
        };
        (ended, self.line)
    }

    fn course(&mut self, desk: &Desk) -> TestEnd {
        loop {
            if desk.stop.load(Ordering::Acquire) {
                return self.told_to_stop();
            }
            if let Err(end) = self.turn(desk).and_then(|until| self.listen(until)) {
                return end;
            }
        }
    }

    /// Does everything that is due, and says how long there is to wait.
    pub(super) fn turn(&mut self, desk: &Desk) -> Result<Nanos, TestEnd> {
        self.take_frames(desk)?;
        self.pass_on(desk)?;
        let now = self.line.now();
        self.keep_time(now, desk)?;
        Ok(self.until(now))
    }

    /// Waits for bytes.
    pub(super) fn listen(&mut self, until: Nanos) -> Result<(), TestEnd> {
        hear(&mut self.line, &mut self.inbox, self.peer, until).map(|_| ())
    }

    /// What its bytes go over.
    pub(super) fn line(&mut self) -> &mut Line {
        &mut self.line
    }

    /// Passes the newest command that is here on to a specimen across another link; those that it overtook count as
    /// missed.
    fn pass_on(&mut self, desk: &Desk) -> Result<(), TestEnd> {
        if self.pending.is_none() {
            return Ok(());
        }
        for _ in 0..MOST_READS {
            if !hear(&mut self.line, &mut self.inbox, self.peer, Nanos(0))? {
                break;
            }
            self.take_frames(desk)?;
        }
        match self.pending.take() {
            Some((sequence, time, dt)) => {
                if std::mem::take(&mut self.halt_precedes) {
                    self.halt();
                }
                let now = self.line.now();
                self.go(sequence, time, dt, now, desk)?;
            }
            None => return Ok(()),
        }
        match self.hold_follows.take() {
            Some(Cause::Operator) => self.hold(),
            Some(_) => self.halt(),
            None => {}
        }
        Ok(())
    }

    /// The controller is held by its operator: no command need come.
    fn hold(&mut self) {
        if !std::mem::replace(&mut self.paused, true) {
            self.station.pause();
        }
    }

    /// The controller stops here, and a way out begins: said more than once, it says nothing new.
    fn halt(&mut self) {
        self.paused = true;
        if self.halted != self.sequence || self.sequence.is_none() {
            self.halted = self.sequence;
            self.station.halt();
        }
    }

    /// Takes every whole frame that is here; over UDP what fails a check is counted and dropped.
    fn take_frames(&mut self, desk: &Desk) -> Result<(), TestEnd> {
        loop {
            let outcome = match self.inbox.next() {
                Ok(None) => return Ok(()),
                Ok(Some(place)) => self.take(place, desk),
                Err(error) => Err(Wrong::Wire(error)),
            };
            match outcome {
                Ok(()) => {}
                Err(Wrong::End(end)) => return Err(end),
                Err(Wrong::Wire(error)) => {
                    let overtaken =
                        matches!(error, WireError::Replayed { .. } | WireError::TooOld { .. });
                    self.corrupt += u64::from(!overtaken);
                    if self.inbox.is_stream() {
                        return Err(TestEnd::failed(error));
                    }
                }
            }
        }
    }

    fn take(&mut self, place: std::ops::Range<usize>, desk: &Desk) -> Result<(), Wrong> {
        let now = self.line.now();
        let received = self.decoder.open(self.inbox.frame(place))?;
        self.heard_at = now;
        match received.frame {
            Frame::Command(command) => {
                let newest = self.pending.map(|(pending, ..)| pending).or(self.sequence);
                let first = self.armed.first_sequence;
                let (sequence, time, dt) = (command.sequence(), command.time(), command.dt());
                // Before anything is read: a command that is pending goes where these vectors say.
                if !(0.0..=self.longest(sequence)).contains(&dt) {
                    let (field, index) = ("command dt", 0);
                    let found = dt;
                    return Err(Wrong::Wire(WireError::Range {
                        field,
                        index,
                        found,
                    }));
                }
                let (disp, vel) = (&mut self.new_disp, &mut self.new_vel);
                match Self::read(&command, first, newest, disp, vel)? {
                    Moves::Overtaken => {}
                    // Its answer is on its way.
                    Moves::Again if self.pending.is_some() => {}
                    Moves::Again => self.answer(now)?,
                    Moves::On if self.station.is_remote() => {
                        self.pending = Some((sequence, time, dt));
                        let followed = self.hold_follows.take();
                        self.halt_precedes |=
                            followed.is_some_and(|cause| cause != Cause::Operator);
                    }
                    Moves::On => self.go(sequence, time, dt, now, desk)?,
                }
            }
            Frame::Hold(notice) => {
                // One that was overtaken by a command is over.
                let newest = self.pending.map(|(pending, ..)| pending).or(self.sequence);
                if newest.is_none_or(|newest| notice.sequence >= newest) {
                    match (self.pending, notice.cause) {
                        // A stop stays one, whatever comes late.
                        (Some(_), Cause::Operator) => {
                            self.hold_follows.get_or_insert(Cause::Operator);
                        }
                        (Some(_), cause) => self.hold_follows = Some(cause),
                        (None, Cause::Operator) => self.hold(),
                        (None, _) => self.halt(),
                    }
                }
            }
            Frame::Heartbeat(_) | Frame::Measurement(_) => {}
            Frame::Retire(notice) => return Err(Wrong::End(self.retired(notice))),
            Frame::Goodbye(notice) => {
                return Err(Wrong::End(self.left(notice.cause.code(), "")));
            }
            Frame::Control(message) => {
                let message = message.to_vec();
                self.again_armed(&message, desk)?;
            }
        }
        Ok(())
    }

    fn send(&mut self, written: Result<usize, WireError>) -> Result<(), TestEnd> {
        let length = written.map_err(TestEnd::failed)?;
        let frame = self.out.get(..length).unwrap_or_default();
        let sent = self.line.send(frame);
        let is_stream = self.inbox.is_stream();
        sent.map_err(|fault| lost_controller(&self.line, is_stream, self.peer, fault))
    }
}

#[cfg(test)]
mod tests;
