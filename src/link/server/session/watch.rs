//! What happens because time passes: waiting, sampling, the watchdog on the commands, heartbeats.
//!
//! The thread sleeps until shortly before the next command is expected, then reads in a busy loop until shortly after.

use super::Stand;
use crate::catalog::event::Remark;
use crate::link::Wait;
use crate::link::rig::TestEnd;
use crate::link::serve::armed::gone_silent;
use crate::link::serve::{Desk, Heard};
use crate::substructure::Status;
use crate::time::Nanos;
use crate::wire::native::{Cause, Heartbeat};

/// The stop flag is looked at this often.
const LOOK_NS: u64 = 50_000_000;
/// A controller that says nothing for so long is gone.
const GONE_NS: u64 = 30_000_000_000;

impl Stand {
    /// How long to wait, and how.
    pub(super) fn until(&mut self, now: Nanos) -> Nanos {
        let mut until = now.plus(LOOK_NS);
        if let Some(sample_at) = self.sample_at {
            until = until.min(sample_at);
        }
        // As `keep_time` has it: a beat is due after that much silence, and after that much time since the last.
        if !self.paused {
            let silent_since = if self.holding {
                self.heard_at.max(self.beat_at)
            } else {
                self.heard_at
            };
            until = until.min(silent_since.plus(self.watchdog_ns));
        }
        let expected = self.arrived.plus(self.period_ns);
        let (from, to) = (expected.minus(self.spin_ns), expected.plus(self.spin_ns));
        let spins = self.sequence.is_some() && self.spin_ns > 0 && now >= from && now < to;
        self.line
            .set_wait(if spins { Wait::SPIN } else { Wait::SLEEP });
        if spins {
            until.min(to)
        } else if now < from {
            until.min(from)
        } else {
            until
        }
    }

    /// Everything that happens because time passes.
    pub(super) fn keep_time(&mut self, now: Nanos, desk: &Desk) -> Result<(), TestEnd> {
        if self.sample_at.is_some_and(|at| now >= at) {
            self.answer(now)?;
        }
        let silent = now.since(self.heard_at);
        if silent >= GONE_NS.max(self.watchdog_ns.saturating_mul(10)) {
            self.say_goodbye(Cause::Watchdog);
            return Err(gone_silent(self.peer, silent));
        }
        if now.since(self.attended) >= LOOK_NS {
            self.attended = now;
            if let Err(trip) = self.station.attend() {
                return Err(self.lost_specimen(trip));
            }
        }
        if self.paused || silent < self.watchdog_ns {
            return Ok(());
        }
        if !self.holding {
            self.holding = true;
            self.station.note(
                Remark::Holding,
                "no command comes from the controller: the specimen holds",
            );
            desk.tell(Heard::Holding {
                sequence: self.sequence,
                silent_s: silent as f64 * 1e-9,
            });
        } else if now.since(self.beat_at) < self.watchdog_ns {
            return Ok(());
        }
        self.beat_at = now;
        self.beat(now)
    }

    fn beat(&mut self, now: Nanos) -> Result<(), TestEnd> {
        let beat = Heartbeat {
            sequence: self.sequence.unwrap_or_default(),
            time: self.own_time(now),
            status: self.status(),
        };
        let written = self.encoder.heartbeat(beat, &mut self.out);
        self.send(written)
    }

    pub(super) fn status(&self) -> Status {
        if self.holding {
            Status(self.flags.0 | Status::HOLDING.0)
        } else {
            self.flags
        }
    }

    pub(super) fn own_time(&self, now: Nanos) -> f64 {
        now.since(self.begun) as f64 * 1e-9
    }
}
