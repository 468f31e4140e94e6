//! The silence of a client: the watchdog on its commands, and the time after which it counts as lost.
//!
//! The watchdog holds the specimen when no message has come for its time. In a hold of the operator no command need come.

use gusset_quantity::time::Nanos;

/// A client that sends no message for this time is lost.
const GONE_NS: u64 = 30_000_000_000;

/// The action that silence requires.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    Nothing,
    /// The specimen holds from now on; the client gets a heartbeat.
    Hold,
    /// The specimen still holds; the client gets another heartbeat.
    Heartbeat,
}

/// The watchdog of one session.
#[derive(Debug)]
pub(super) struct Silence {
    limit_ns: u64,
    heard_at: Nanos,
    beat_at: Nanos,
    /// The client holds or stops: no command need come.
    is_paused: bool,
    /// The watchdog holds the specimen.
    is_holding: bool,
}

impl Silence {
    pub(crate) const fn new(limit_ns: u64, now: Nanos) -> Self {
        Self {
            limit_ns,
            heard_at: now,
            beat_at: now,
            is_paused: false,
            is_holding: false,
        }
    }

    /// A message has come, or the client could not send one. Real-time: yes.
    pub(crate) const fn heard(&mut self, now: Nanos) {
        self.heard_at = now;
    }

    /// The client holds or stops. Returns true if it did before.
    pub(crate) const fn pause(&mut self) -> bool {
        std::mem::replace(&mut self.is_paused, true)
    }

    /// A new command has come. Returns true if the watchdog held the specimen. Real-time: yes.
    pub(crate) const fn go_on(&mut self) -> bool {
        self.is_paused = false;
        std::mem::replace(&mut self.is_holding, false)
    }

    /// True if the watchdog holds the specimen.
    pub(crate) const fn is_holding(&self) -> bool {
        self.is_holding
    }

    /// Time since the last message, ns.
    pub(crate) fn lasts_ns(&self, now: Nanos) -> u64 {
        now.since(self.heard_at)
    }

    /// True if the client counts as lost. Real-time: yes.
    pub(crate) fn is_final(&self, now: Nanos) -> bool {
        self.lasts_ns(now) >= GONE_NS.max(self.limit_ns.saturating_mul(10))
    }

    /// The action that is due now. A heartbeat is due after each watchdog time. Real-time: yes.
    pub(crate) fn due(&mut self, now: Nanos) -> Due {
        if self.is_paused || self.lasts_ns(now) < self.limit_ns {
            return Due::Nothing;
        }
        let due = if !std::mem::replace(&mut self.is_holding, true) {
            Due::Hold
        } else if now.since(self.beat_at) < self.limit_ns {
            return Due::Nothing;
        } else {
            Due::Heartbeat
        };
        self.beat_at = now;
        due
    }

    /// The time at which something is due next, but not after `limit`. Real-time: yes.
    pub(crate) fn next(&self, limit: Nanos) -> Nanos {
        if self.is_paused {
            return limit;
        }
        let since = if self.is_holding {
            self.heard_at.max(self.beat_at)
        } else {
            self.heard_at
        };
        limit.min(since.plus(self.limit_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn watchdog_holds_once_and_sends_heartbeats() {
        let mut silence = Silence::new(100, Nanos(0));
        assert_eq!(silence.due(Nanos(99)), Due::Nothing);
        assert_eq!(silence.due(Nanos(100)), Due::Hold);
        assert_eq!(silence.due(Nanos(199)), Due::Nothing);
        assert_eq!(silence.next(Nanos(1000)), Nanos(200));
        assert_eq!(silence.due(Nanos(200)), Due::Heartbeat);
        assert!(silence.go_on() && !silence.is_holding());
        silence.heard(Nanos(250));
        assert!(!silence.pause());
        assert_eq!(silence.due(Nanos(10_000)), Due::Nothing);
        assert_eq!(silence.next(Nanos(1000)), Nanos(1000));
        assert!(!silence.is_final(Nanos(GONE_NS + 249)));
        assert!(silence.is_final(Nanos(GONE_NS + 250)));
    }
}
