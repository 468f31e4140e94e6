//! First guess at the cause of a miss, from the stamps of the tick.
//!
//! A first guess, made at once in the loop from nothing but durations: no system call. Whether the thread
//! was switched away is known to the sampler on another processor; the writer refines the guess with its evidence.
//!
//! Each part of a tick has a typical duration, a running median. The part with the largest excess over its typical
//! duration is the suspect if the deadline would have been met without that excess:
//!
//! * in the wait: the thread was taken away (it had nothing to do but watch the clock);
//! * in the reply of a peer: the reply was late;
//! * in any other part: taken away if the part took more than ten times as long as it typically does, else ours;
//! * time lost by the tick before, which ended after this edge: what that tick was blamed on.
//!
//! Work that is longer than a tick is not excused by earlier delays. If no single excess explains the miss, it is a late reply if
//! the peer's reply came after the deadline, else ours.

use super::TickStamps;

/// First guess at the cause of a miss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Suspect {
    /// The processor was elsewhere: preempted, interrupted, or taken by the hypervisor.
    TakenAway,
    /// The specimen's reply came late.
    LateReply,
    /// Long compute or record: our own fault until shown otherwise.
    Ours,
}

/// A part of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Carried,
    Wait,
    Send,
    Reply,
    Compute,
    Record,
}

/// In the order of [`Typical::durations`].
const PARTS: [Part; 6] = [
    Part::Carried,
    Part::Wait,
    Part::Send,
    Part::Reply,
    Part::Compute,
    Part::Record,
];

/// Running median of a duration: moves up or down by a small share of itself, whichever side the sample is on.
///
/// It rests where samples above and below balance, costs a comparison, and one stall of any size moves it by 1/64.
#[derive(Debug, Clone, Copy, Default)]
struct Median {
    ns: u64,
}

impl Median {
    /// The first samples are cold and moves are large; then they are small.
    const COLD: u32 = 64;

    /// Adds one sample, after `seen` others.
    #[inline]
    fn learn(&mut self, ns: u64, seen: u32) {
        if ns == self.ns {
            return;
        }
        let step = match seen {
            0 => u64::MAX,
            1..Self::COLD => self.ns / 8 + 1,
            _ => self.ns / 64 + 1,
        };
        // Not past the sample: so that a constant duration is met exactly. Which side it is on is a coin's toss that no
        // processor can foresee: no branch.
        let (up, down) = (ns.saturating_sub(self.ns), self.ns.saturating_sub(ns));
        self.ns = self.ns + up.min(step) - down.min(step);
    }
}

/// What each part of a tick typically takes.
#[derive(Debug, Clone)]
pub(super) struct Typical {
    awaits_peer: bool,
    medians: [Median; PARTS.len()],
    /// Ticks that were learnt from.
    seen: u32,
    last: Suspect,
}

impl Typical {
    pub(super) fn new(awaits_peer: bool) -> Self {
        Self {
            awaits_peer,
            medians: [Median::default(); PARTS.len()],
            seen: 0,
            last: Suspect::Ours,
        }
    }

    #[inline]
    fn durations(stamps: &TickStamps) -> [u64; PARTS.len()] {
        let free = stamps.idle.max(stamps.release);
        [
            stamps.idle.since(stamps.release),
            stamps.woke.since(free),
            stamps.sent.since(stamps.woke),
            stamps.decoded.since(stamps.sent),
            stamps.ready.since(stamps.decoded),
            stamps.pushed.since(stamps.ready),
        ]
    }

    /// Judges a tick (only a missed one is of interest) and learns from it. Real-time: yes.
    #[inline]
    pub(super) fn judge(&mut self, stamps: &TickStamps, missed: bool) -> Suspect {
        let durations = Self::durations(stamps);
        if missed {
            self.last = self.blame(&durations, stamps);
        }
        for (median, took) in self.medians.iter_mut().zip(durations) {
            median.learn(took, self.seen);
        }
        self.seen = self.seen.saturating_add(1);
        self.last
    }

    #[cold]
    fn blame(&self, durations: &[u64; PARTS.len()], stamps: &TickStamps) -> Suspect {
        let mut worst = (Part::Compute, 0, 0, 0);
        for ((median, part), &took) in self.medians.iter().zip(PARTS).zip(durations) {
            // Before anything is known, nothing is unusual.
            let typical = if self.seen == 0 { took } else { median.ns };
            let excess = took.saturating_sub(typical);
            if excess > worst.1 {
                worst = (part, excess, took, typical);
            }
        }
        let (part, excess, took, typical) = worst;
        let explains = stamps.pushed.minus(excess) <= stamps.deadline;
        // Work that does not fit into a tick is late whatever came before it.
        let own = stamps.sent.since(stamps.woke) + stamps.pushed.since(stamps.decoded);
        let fits = own <= stamps.deadline.since(stamps.release);
        match part {
            Part::Carried if explains && fits => self.last,
            Part::Wait if explains && fits => Suspect::TakenAway,
            Part::Reply if explains && self.awaits_peer => Suspect::LateReply,
            _ if explains && typical.saturating_mul(10) < took => Suspect::TakenAway,
            _ if self.awaits_peer && !explains && stamps.decoded > stamps.deadline => {
                Suspect::LateReply
            }
            _ => Suspect::Ours,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::time::Nanos;

    const T: u64 = 1_000_000;

    /// Durations in ns of wait, send, reply, compute, record after the edge of tick `k`.
    fn tick(k: u64, parts: [u64; 5]) -> TickStamps {
        let release = Nanos(k * T);
        let mut at = release;
        let mut next = |ns| {
            at = at.plus(ns);
            at
        };
        TickStamps {
            idle: release.minus(T / 2),
            release,
            woke: next(parts[0]),
            sent: next(parts[1]),
            decoded: next(parts[2]),
            ready: next(parts[3]),
            pushed: next(parts[4]),
            deadline: Nanos((k + 1) * T),
        }
    }

    const USUAL: [u64; 5] = [60, 4_000, 30_000, 300_000, 2_000];

    fn warmed(awaits_peer: bool) -> Typical {
        let mut typical = Typical::new(awaits_peer);
        for k in 0..500 {
            // ± 20 %, alternating.
            let parts = USUAL.map(|ns| ns * if k % 2 == 0 { 4 } else { 6 } / 5);
            typical.judge(&tick(k, parts), false);
        }
        typical
    }

    fn missed_with(awaits_peer: bool, part: usize, ns: u64) -> Suspect {
        let mut parts = USUAL;
        parts[part] = ns;
        let stamps = tick(1000, parts);
        assert!(stamps.pushed > stamps.deadline);
        warmed(awaits_peer).judge(&stamps, true)
    }

    #[test]
    fn excess_in_the_wait_is_taken_away() {
        assert_eq!(missed_with(false, 0, 5 * T), Suspect::TakenAway);
        assert_eq!(missed_with(true, 0, 5 * T), Suspect::TakenAway);
    }

    #[test]
    fn long_reply_is_late_only_with_a_peer() {
        assert_eq!(missed_with(true, 2, T), Suspect::LateReply);
        assert_eq!(missed_with(false, 2, T), Suspect::TakenAway);
    }

    #[test]
    fn part_far_beyond_usual_is_taken_away() {
        assert_eq!(missed_with(false, 3, 4 * T), Suspect::TakenAway);
        assert_eq!(missed_with(false, 3, T), Suspect::Ours);
        assert_eq!(missed_with(false, 4, T), Suspect::TakenAway);
    }

    #[test]
    fn too_long_work_is_ours_after_a_stall() {
        let mut typical = warmed(false);
        let stalled = tick(1000, [5 * T, 4_000, 30_000, 300_000, 2_000]);
        assert_eq!(typical.judge(&stalled, true), Suspect::TakenAway);
        // Each tick begins late by the excess of the one before.
        let late = |took: u64| TickStamps {
            idle: Nanos(1001 * T + 400_000),
            woke: Nanos(1001 * T + 400_060),
            sent: Nanos(1001 * T + 404_000),
            decoded: Nanos(1001 * T + 404_000),
            ready: Nanos(1001 * T + 404_000 + took),
            pushed: Nanos(1001 * T + 406_000 + took),
            ..tick(1001, USUAL)
        };
        assert_eq!(typical.judge(&late(T + 50_000), true), Suspect::Ours);
        assert_eq!(typical.judge(&stalled, true), Suspect::TakenAway);
        assert_eq!(typical.judge(&late(610_000), true), Suspect::TakenAway);
    }

    #[test]
    fn tick_that_is_always_too_long_is_ours() {
        let mut typical = Typical::new(false);
        let long = [60, 4_000, 30_000, 1_200_000, 2_000];
        for k in 0..200 {
            assert_eq!(typical.judge(&tick(k, long), true), Suspect::Ours, "{k}");
        }
    }

    #[test]
    fn always_slow_peer_is_a_late_reply() {
        let mut typical = Typical::new(true);
        let slow = [60, 4_000, 1_300_000, 1_000, 2_000];
        for k in 0..200 {
            assert_eq!(
                typical.judge(&tick(k, slow), true),
                Suspect::LateReply,
                "{k}"
            );
        }
    }

    #[test]
    fn late_begin_inherits_the_last_cause() {
        let mut typical = warmed(true);
        let mut parts = USUAL;
        parts[2] = 2 * T - 400_000;
        let first = tick(1000, parts);
        assert_eq!(typical.judge(&first, true), Suspect::LateReply);
        // The next edge stayed: the loop reached its wait 0.94 T after the edge, and compute makes it a miss.
        let next = TickStamps {
            idle: first.pushed,
            ..tick(
                1001,
                [
                    first.pushed.since(Nanos(1001 * T)),
                    4_000,
                    30_000,
                    300_000,
                    2_000,
                ],
            )
        };
        assert_eq!(typical.judge(&next, true), Suspect::LateReply);
    }

    #[test]
    fn running_median_settles_despite_a_stall() {
        let mut median = Median::default();
        median.learn(500_000, 0);
        for k in 0..5000u64 {
            median.learn(900 + (k * 7919) % 200, k as u32 + 1);
        }
        assert!((950..=1050).contains(&median.ns), "{}", median.ns);
        let before = median.ns;
        median.learn(u64::MAX / 2, 5001);
        assert!(median.ns <= before + before / 64 + 1);
    }
}
