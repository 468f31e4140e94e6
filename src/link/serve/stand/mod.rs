//! The specimen and its controller: commands in, measurements out.
//!
//! The specimen commits what it was last told when the next command comes. A command that only repeats where it is (test
//! time stands still and nothing differs) is answered again from the same state, so that a test over a link takes the
//! same course as one in process, to the last bit. A formula gets every command; a specimen across another link gets the
//! newest of those that came while it was busy, never a burst of them.

mod ends;
mod watch;

use ends::Wrong;
use std::net::SocketAddr;
use std::sync::atomic::Ordering;

use super::data::Session;
use super::line::Line;
use super::{Desk, Heard};
use crate::link::Transport;
use crate::link::inbox::Inbox;
use crate::link::rig::{Close, Station, Trip};
use crate::record::NoteLevel;
use crate::substructure::{Command, LinkFault, Measurement, Status};
use crate::time::Nanos;
use crate::wire::WireError;
use crate::wire::native::{Cause, CommandFrame, Decoder, Encoder, Frame, LARGEST_FRAME, Moment};

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
}

/// Why a session ends.
pub(super) struct End {
    close: Close,
    text: String,
}

impl End {
    fn failed(text: impl ToString) -> Self {
        Self {
            close: Close::Failed,
            text: text.to_string(),
        }
    }
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
        } = session;
        let axes = station.axes();
        let now = line.now();
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
            disp: vec![0.0; axes],
            vel: vec![0.0; axes],
            new_disp: vec![0.0; axes],
            new_vel: vec![0.0; axes],
            measured: Measurement::zeros(axes),
            flags: Status::default(),
            pending: None,
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
        }
    }

    /// Runs the session to its end.
    pub(super) fn run(mut self, desk: &Desk) -> Heard {
        let end = self.course(desk);
        self.finish(end).0
    }

    /// The books of a session are closed; what there is to tell, and the line.
    pub(super) fn finish(mut self, End { close, text }: End) -> (Heard, Line) {
        let counts = format!(
            "{} commands, {} missed, {} frames corrupt",
            self.commands, self.missed, self.corrupt
        );
        self.station.note(NoteLevel::Info, "counts", &counts);
        self.station.end(close, &text);
        let ended = Heard::Ended {
            text,
            commands: self.commands,
            missed: self.missed,
            corrupt: self.corrupt,
        };
        (ended, self.line)
    }

    fn course(&mut self, desk: &Desk) -> End {
        loop {
            if desk.stop.load(Ordering::Acquire) {
                self.say_goodbye(Cause::Shutdown);
                return End {
                    close: Close::Interrupted,
                    text: "the server was told to stop".to_owned(),
                };
            }
            if let Err(end) = self.turn(desk).and_then(|until| self.listen(until)) {
                return end;
            }
        }
    }

    /// Does everything that is due, and says how long there is to wait.
    pub(super) fn turn(&mut self, desk: &Desk) -> Result<Nanos, End> {
        self.take_frames(desk)?;
        self.pass_on(desk)?;
        let now = self.line.now();
        self.keep_time(now, desk)?;
        Ok(self.until(now))
    }

    /// Waits for bytes.
    pub(super) fn listen(&mut self, until: Nanos) -> Result<(), End> {
        match self.line.recv(self.inbox.space(), until) {
            Ok(Some(count)) => self.inbox.filled(count),
            Ok(None) => {}
            Err(fault) => return Err(self.lost_controller(fault)),
        }
        Ok(())
    }

    /// What its bytes go over.
    pub(super) fn line(&mut self) -> &mut Line {
        &mut self.line
    }

    fn lost_controller(&self, fault: LinkFault) -> End {
        match (self.line.tls_fault(), fault) {
            (Some(why), _) => End::failed(format_args!("{}: TLS: {why}", self.peer)),
            (None, LinkFault::Closed) => End::failed(format_args!(
                "{} closed the connection without a goodbye",
                self.peer
            )),
            (None, fault) => End::failed(fault),
        }
    }

    /// Passes the newest command that is here on to a specimen across another link; those that it overtook count as
    /// missed.
    fn pass_on(&mut self, desk: &Desk) -> Result<(), End> {
        if self.pending.is_none() {
            return Ok(());
        }
        for _ in 0..MOST_READS {
            match self.line.recv(self.inbox.space(), Nanos(0)) {
                Ok(Some(count)) => self.inbox.filled(count),
                Ok(None) => break,
                Err(fault) => return Err(self.lost_controller(fault)),
            }
            self.take_frames(desk)?;
        }
        match self.pending.take() {
            Some((sequence, time, dt)) => {
                let now = self.line.now();
                self.go(sequence, time, dt, now, desk)
            }
            None => Ok(()),
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
                        return Err(End::failed(error));
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
                let moves = Self::read(&command, newest, &mut self.new_disp, &mut self.new_vel)?;
                let (sequence, time, dt) = (command.sequence(), command.time(), command.dt());
                match moves {
                    Moves::Overtaken => {}
                    // Its answer is on its way.
                    Moves::Again if self.pending.is_some() => {}
                    Moves::Again => self.answer(now)?,
                    Moves::On if self.station.is_remote() => {
                        self.pending = Some((sequence, time, dt));
                    }
                    Moves::On => self.go(sequence, time, dt, now, desk)?,
                }
            }
            Frame::Hold(_) => self.paused = true,
            Frame::Heartbeat(_) | Frame::Measurement(_) => {}
            Frame::Retire(notice) => return Err(Wrong::End(self.retired(notice))),
            Frame::Goodbye(_) => {
                return Err(Wrong::End(End::failed("the controller said goodbye")));
            }
            Frame::Control(message) => self.again_armed(message.to_vec())?,
        }
        Ok(())
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
            self.station.commit();
        }
        // Over a gap the motion took as long as all the steps that were lost, too.
        let dt_here = if gap == 0 || first {
            dt
        } else {
            (time - self.time).max(dt)
        };
        std::mem::swap(&mut self.disp, &mut self.new_disp);
        std::mem::swap(&mut self.vel, &mut self.new_vel);
        (self.sequence, self.time, self.dt) = (Some(sequence), time, dt);
        let command = Command {
            sequence,
            time,
            dt,
            disp: &self.disp,
            vel: &self.vel,
        };
        let held = self.station.tripped().is_some();
        let outcome = self.station.exchange(&command, dt_here, &mut self.measured);
        self.flags = self.measured.status;
        self.commands += 1;
        self.arrived = now;
        match outcome {
            Err(trip @ Trip::Lost(_)) => return Err(self.lost_specimen(trip)),
            Err(trip) if !held => {
                let text = self.station.whole(trip);
                desk.tell(Heard::Tripped { sequence, text });
            }
            Err(_) | Ok(()) => {}
        }
        match self.sample_after_ns {
            Some(after) => {
                self.sample_at = Some(now.plus(after));
                Ok(())
            }
            // What a specimen across another link has measured is there only now; the controller was not silent meanwhile,
            // it waited.
            None if self.station.is_remote() => {
                let now = self.line.now();
                self.heard_at = now;
                self.answer(now)
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
        let length = written.map_err(End::failed)?;
        let frame = self.out.get(..length).unwrap_or_default();
        self.line.send(frame).map_err(End::failed)
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
