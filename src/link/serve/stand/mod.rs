//! The specimen and its controller: commands in, measurements out.
//!
//! The specimen commits what it was last told when the next command comes. A command that only repeats where it is (test
//! time stands still and nothing differs) is answered again from the same state, so that a test over a link takes the
//! same course as one in process, to the last bit.

mod watch;

use std::net::SocketAddr;
use std::sync::atomic::Ordering;

use super::data::Session;
use super::{Desk, Heard, Line};
use crate::link::Transport;
use crate::link::inbox::Inbox;
use crate::rt::os;
use crate::specimen::Specimen;
use crate::substructure::{LinkFault, Measurement};
use crate::time::Nanos;
use crate::wire::WireError;
use crate::wire::native::{
    Cause, CommandFrame, Decoder, Encoder, Frame, LARGEST_FRAME, Moment, Notice,
};

/// The specimen and its controller.
pub(super) struct Stand {
    line: Line,
    inbox: Inbox,
    peer: SocketAddr,
    encoder: Encoder,
    decoder: Decoder,
    out: Vec<u8>,
    specimen: Box<dyn Specimen>,
    watchdog_ns: u64,
    period_ns: u64,
    spin_ns: u64,
    sample_after_ns: Option<u64>,
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
    arrived: Nanos,
    /// The measurement of the command in force is still to be taken, at this time.
    sample_at: Option<Nanos>,
    begun: Nanos,
    heard_at: Nanos,
    beat_at: Nanos,
    paused: bool,
    holding: bool,
    commands: u64,
    missed: u32,
    corrupt: u64,
}

/// Why a session ends, in words.
type End = String;

impl Stand {
    pub(super) fn new(session: Session, specimen: Box<dyn Specimen>, spin_ns: u64) -> Self {
        let Session {
            line,
            inbox,
            peer,
            greeted,
            first_sequence,
        } = session;
        let axes = specimen.axes();
        let now = Nanos(os::monotonic_ns());
        Self {
            line,
            inbox,
            peer,
            encoder: greeted.encoder,
            decoder: greeted.decoder,
            out: vec![0; LARGEST_FRAME],
            specimen,
            watchdog_ns: greeted.watchdog_ns,
            period_ns: greeted.period_ns,
            spin_ns,
            sample_after_ns: greeted.sample_after_ns,
            sequence: None,
            next_sequence: first_sequence,
            time: 0.0,
            dt: 0.0,
            disp: vec![0.0; axes],
            vel: vec![0.0; axes],
            new_disp: vec![0.0; axes],
            new_vel: vec![0.0; axes],
            measured: Measurement::zeros(axes),
            arrived: now,
            sample_at: None,
            begun: now,
            heard_at: now,
            beat_at: now,
            paused: false,
            holding: false,
            commands: 0,
            missed: 0,
            corrupt: 0,
        }
    }

    /// Runs the session to its end.
    pub(super) fn run(mut self, desk: &Desk) -> Heard {
        let text = self.course(desk);
        Heard::Ended {
            text,
            commands: self.commands,
            missed: self.missed,
            corrupt: self.corrupt,
        }
    }

    fn course(&mut self, desk: &Desk) -> End {
        loop {
            if desk.stop.load(Ordering::Acquire) {
                self.say_goodbye(Cause::Shutdown);
                return "the server was told to stop".to_owned();
            }
            if let Err(end) = self.take_frames(desk).and_then(|()| self.keep_time(desk)) {
                return end;
            }
            let until = self.until();
            match self.line.recv(self.inbox.space(), until) {
                Ok(Some(count)) => self.inbox.filled(count),
                Ok(None) => {}
                Err(fault) => return self.lost(fault),
            }
        }
    }

    fn lost(&self, fault: LinkFault) -> End {
        match (self.line.tls_fault(), fault) {
            (Some(why), _) => format!("{}: TLS: {why}", self.peer),
            (None, LinkFault::Closed) => {
                format!("{} closed the connection without a goodbye", self.peer)
            }
            (None, fault) => fault.to_string(),
        }
    }

    /// Takes every whole frame that is here; over UDP what fails a check is counted and dropped.
    fn take_frames(&mut self, desk: &Desk) -> Result<(), End> {
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
                        return Err(error.to_string());
                    }
                }
            }
        }
    }

    fn take(&mut self, place: std::ops::Range<usize>, desk: &Desk) -> Result<(), Wrong> {
        let now = Nanos(os::monotonic_ns());
        let received = self.decoder.open(self.inbox.frame(place))?;
        self.heard_at = now;
        match received.frame {
            Frame::Command(command) => {
                let moves = Self::read(
                    &command,
                    self.sequence,
                    &mut self.new_disp,
                    &mut self.new_vel,
                )?;
                let (sequence, time, dt) = (command.sequence(), command.time(), command.dt());
                match moves {
                    Moves::Overtaken => {}
                    Moves::Again => self.answer(now)?,
                    Moves::On => self.go(sequence, time, dt, now, desk)?,
                }
            }
            Frame::Hold(_) => self.paused = true,
            Frame::Heartbeat(_) | Frame::Measurement(_) => {}
            Frame::Retire(notice) => {
                self.say_goodbye(Cause::Orderly);
                return Err(Wrong::End(format!(
                    "retired {}",
                    match notice.cause {
                        Cause::Orderly => "in an orderly way",
                        Cause::Operator => "by the operator",
                        _ => "because the test tripped",
                    }
                )));
            }
            Frame::Goodbye(_) => {
                return Err(Wrong::End("the controller said goodbye".to_owned()));
            }
            Frame::Control(message) => self.again_armed(message.to_vec())?,
        }
        Ok(())
    }

    /// The answer to the arming was lost: it is given again. Any other message now is the end.
    fn again_armed(&mut self, message: Vec<u8>) -> Result<(), Wrong> {
        use crate::wire::handshake::{Control, decode};
        match decode(&message)? {
            Control::Arm(_) => {
                let written = self.encoder.control(&message, &mut self.out);
                Ok(self.send(written)?)
            }
            other => Err(Wrong::End(format!("the controller sent {}", other.name()))),
        }
    }

    fn read(
        command: &CommandFrame<'_>,
        in_force: Option<u64>,
        disp: &mut [f64],
        vel: &mut [f64],
    ) -> Result<Moves, WireError> {
        match in_force {
            Some(newest) if command.sequence() < newest => Ok(Moves::Overtaken),
            Some(newest) if command.sequence() == newest => Ok(Moves::Again),
            _ => command.read(disp, vel).map(|()| Moves::On),
        }
    }

    /// A new command is in force.
    fn go(
        &mut self,
        sequence: u64,
        time: f64,
        dt: f64,
        now: Nanos,
        desk: &Desk,
    ) -> Result<(), End> {
        if self.sample_at.is_some() {
            // Faster than agreed: what the command before gave is sampled now, not lost.
            self.answer(now)?;
        }
        if self.holding {
            self.holding = false;
            desk.tell(Heard::Resumed { sequence });
        }
        self.paused = false;
        let gap = sequence.saturating_sub(self.next_sequence);
        self.missed = self
            .missed
            .saturating_add(u32::try_from(gap).unwrap_or(u32::MAX));
        self.next_sequence = sequence.saturating_add(1);
        let first = self.sequence.is_none();
        let stays = !first
            && dt == 0.0
            && self.dt == 0.0
            && self.new_disp == self.disp
            && self.new_vel == self.vel;
        if !first && !stays {
            self.specimen.commit();
        }
        // Over a gap the motion took as long as all the steps that were lost, too.
        let dt_here = if gap == 0 || first {
            dt
        } else {
            (time - self.time).max(dt)
        };
        self.disp.copy_from_slice(&self.new_disp);
        self.vel.copy_from_slice(&self.new_vel);
        (self.sequence, self.time, self.dt) = (Some(sequence), time, dt);
        self.specimen
            .trial(&self.disp, &self.vel, dt_here, &mut self.measured.force);
        if !self.measured.force.iter().all(|force| force.is_finite()) {
            self.say_goodbye(Cause::Tripped);
            return Err(format!(
                "command {sequence} gives a force that is no number"
            ));
        }
        self.measured.disp.copy_from_slice(&self.disp);
        self.commands += 1;
        self.arrived = now;
        match self.sample_after_ns {
            Some(after) => {
                self.sample_at = Some(now.plus(after));
                Ok(())
            }
            None => self.answer(now),
        }
    }

    /// Sends the measurement of the command in force.
    fn answer(&mut self, now: Nanos) -> Result<(), End> {
        self.sample_at = None;
        self.measured.sequence = self.sequence.unwrap_or_default();
        self.measured.time = self.own_time(now);
        self.measured.status = self.status();
        let moment = Moment {
            sampled_after: now.since(self.arrived) as f64 * 1e-9,
            missed: self.missed,
        };
        let written = self
            .encoder
            .measurement(&self.measured, moment, &mut self.out);
        self.send(written)
    }

    fn send(&mut self, written: Result<usize, WireError>) -> Result<(), End> {
        let length = written.map_err(|error| error.to_string())?;
        let frame = self.out.get(..length).unwrap_or_default();
        self.line.send(frame).map_err(|fault| fault.to_string())
    }

    fn say_goodbye(&mut self, cause: Cause) {
        let notice = Notice {
            sequence: self.sequence.unwrap_or_default(),
            cause,
        };
        let written = self.encoder.goodbye(notice, &mut self.out);
        // Whoever does not hear it sees the connection close.
        let _ = self.send(written);
    }
}

/// What a command does.
enum Moves {
    /// It was overtaken on the way.
    Overtaken,
    /// It is in force already: answered again.
    Again,
    /// It is new.
    On,
}

enum Wrong {
    Wire(WireError),
    End(End),
}

impl From<WireError> for Wrong {
    fn from(error: WireError) -> Self {
        Wrong::Wire(error)
    }
}

impl From<End> for Wrong {
    fn from(end: End) -> Self {
        Wrong::End(end)
    }
}
