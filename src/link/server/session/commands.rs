//! What a command does, and its answer.

use std::sync::atomic::Ordering;

use super::Stand;
use crate::catalog::event::Remark;
use crate::link::Transport;
use crate::link::rig::{TestEnd, Trip};
use crate::link::serve::{Desk, Heard};
use crate::substructure::Command;
use crate::time::Nanos;
use crate::wire::WireError;
use crate::wire::native::{CommandFrame, Moment};

/// Test time may pass so many times as fast as the announced rate says that wall time does.
const FASTEST: f64 = 1000.0;

/// What a command does.
pub(super) enum Moves {
    /// It was overtaken on the way.
    Overtaken,
    /// It is in force already: answered again.
    Again,
    /// It is new.
    On,
}

impl Stand {
    /// A new command is in force.
    pub(super) fn go(
        &mut self,
        sequence: u64,
        time: f64,
        dt: f64,
        now: Nanos,
        desk: &Desk,
    ) -> Result<(), TestEnd> {
        if self.sample_at.is_some() {
            // Faster than agreed: what the command before gave is sampled now, not lost.
            self.answer(now)?;
        }
        if self.holding {
            self.holding = false;
            let resumed = Heard::Resumed { sequence };
            let text = resumed.to_string();
            self.station.note(Remark::CommandsAgain, &text);
            desk.tell(resumed);
        }
        self.paused = false;
        let longest = self.longest(sequence);
        let before = sequence.checked_sub(1);
        let gap = before.map_or(0, |before| self.misses_up_to(before));
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
            (time - self.time).max(dt).min(longest)
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
        self.station.now_is(now);
        let held = self.station.tripped().is_some();
        let mut wanted = || !desk.stop.load(Ordering::Acquire);
        let outcome = (self.station).exchange(&command, dt_here, &mut wanted, &mut self.measured);
        self.flags = self.measured.status;
        self.commands += 1;
        self.arrived = now;
        match outcome {
            Err(trip @ Trip::Lost(_)) => return Err(self.lost_specimen(trip)),
            Err(trip) if !held => {
                let text = self.station.whole(trip);
                desk.tell(Heard::Tripped { sequence, text });
                if let Some(text) = self.station.next_step() {
                    desk.tell(Heard::Told { text });
                }
            }
            Ok(false) => return Err(self.told_to_stop()),
            Err(_) | Ok(true) => {}
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
    pub(super) fn answer(&mut self, now: Nanos) -> Result<(), TestEnd> {
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

    /// Longest test time in s that can have passed before a command.
    pub(super) fn longest(&self, sequence: u64) -> f64 {
        let commands = sequence
            .saturating_sub(self.next_sequence)
            .saturating_add(1);
        FASTEST * self.period_ns as f64 * 1e-9 * commands as f64
    }

    pub(super) fn read(
        command: &CommandFrame<'_>,
        first: u64,
        in_force: Option<u64>,
        disp: &mut [f64],
        vel: &mut [f64],
    ) -> Result<Moves, WireError> {
        match in_force {
            // One from before the specimen was armed again.
            _ if command.sequence() < first => Ok(Moves::Overtaken),
            Some(newest) if command.sequence() < newest => Ok(Moves::Overtaken),
            Some(newest) if command.sequence() == newest => Ok(Moves::Again),
            _ => command.read(disp, vel).map(|()| Moves::On),
        }
    }
}
