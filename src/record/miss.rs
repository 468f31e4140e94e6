//! The class of a deadline miss, from what the loop knew at once and what the scheduler counted around it.
//!
//! A sampler on another core reads the loop thread's counters about every 10 ms ([`SchedSample`]). A miss lies
//! between the last sample before its beginning and the first one after its end; the growth of the counters
//! between the two is the evidence. It is evidence over a window, not proof for one miss: it is written beside the
//! class, so that a reader can judge.
//!
//! The first line that holds decides:
//!
//! | evidence | the loop's own computation was long | the clock jumped |
//! |---|---|---|
//! | the process was stopped and continued | stopped | stopped |
//! | the thread waited for a processor for half of the delay; where no wait is counted: was switched away | preempted | preempted |
//! | page faults | ours | ours |
//! | steal for half of the delay, in whole ticks of 10 ms | ours | taken away (hypervisor) |
//! | nothing | ours | unknown |
//!
//! Only a stop changes the class of a late reply.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::MissCause;
use crate::rt::sampler::SchedSample;
use gusset_quantity::units::duration;

/// Key of the limit that a tick breaks which is late by a whole period, with `timing.on_miss = "stop"`.
pub const ON_MISS: &str = "on_miss";

/// Why a tick ended the test that was late by a whole period, in words. Times in s.
pub fn late_words(late_s: f64, period_s: f64) -> String {
    format!(
        "a tick was late by {}, and a period is {}; `timing.on_miss = \"stop\"` ends the test for that, \"stretch\" delays the \
         later ticks instead",
        duration(late_s),
        duration(period_s)
    )
}

/// One tick of /proc/stat in ms: USER_HZ is 100 on every architecture that has this interface to user space.
const STEAL_TICK_MS: u64 = 10;

/// Growth of the counters around a miss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Evidence {
    /// Time withheld by the hypervisor, in ms, in units of 10.
    pub steal_ms: u64,
    /// Involuntary switches of the loop's thread.
    pub involuntary_switches: u64,
    /// Minor page faults of the loop's thread.
    pub minor_faults: u64,
    /// Time in which the loop's thread was ready and waited for a processor, in µs.
    #[serde(default)]
    pub waited_us: u64,
    /// The process was stopped and continued.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub stopped: bool,
}

/// The class of a miss by `late_ns`; the table of this module.
#[must_use]
pub(crate) const fn classify(
    known: MissCause,
    evidence: Option<Evidence>,
    late_ns: u64,
) -> MissCause {
    let evidence = match evidence {
        Some(evidence) => evidence,
        // A hypervisor is not blamed without steal.
        None if matches!(known, MissCause::TakenAway) => return MissCause::Unknown,
        None => return known,
    };
    if evidence.stopped {
        return MissCause::Stopped;
    }
    let waited_us = evidence.waited_us;
    let is_preempted = if waited_us > 0 {
        waited_us.saturating_mul(2_000) >= late_ns
    } else {
        // A kernel without statistics of its scheduler counts switches alone.
        evidence.involuntary_switches > 0
    };
    // Steal is counted in whole ticks.
    let stolen_ms = evidence.steal_ms + STEAL_TICK_MS;
    let is_stolen = evidence.steal_ms > 0 && stolen_ms.saturating_mul(2_000_000) >= late_ns;
    match known {
        MissCause::TakenAway | MissCause::Ours if is_preempted => MissCause::Preempted,
        MissCause::TakenAway if evidence.minor_faults > 0 => MissCause::Ours,
        MissCause::TakenAway if !is_stolen => MissCause::Unknown,
        _ => known,
    }
}

/// The latest samples.
#[derive(Debug, Default)]
pub(crate) struct SampleWindow {
    samples: VecDeque<SchedSample>,
}

/// Samples kept: five seconds of them; a miss waits for its next sample 0.2 s at most.
const KEPT: usize = 512;

impl SampleWindow {
    /// Adds a sample; one that is older than the newest is ignored.
    pub(crate) fn push(&mut self, sample: SchedSample) {
        if self
            .samples
            .back()
            .is_some_and(|last| last.clock_ns >= sample.clock_ns)
        {
            return;
        }
        if self.samples.len() == KEPT {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// True if a sample at or after `clock_ns` is there.
    #[must_use]
    pub(crate) fn reaches(&self, clock_ns: u64) -> bool {
        self.samples
            .back()
            .is_some_and(|last| last.clock_ns >= clock_ns)
    }

    /// Growth from the last sample at or before `from_ns` to the first at or after `to_ns`; without such a sample,
    /// from the oldest or to the newest. `None` without two different samples.
    #[must_use]
    pub(crate) fn evidence(&self, from_ns: u64, to_ns: u64) -> Option<Evidence> {
        let before = self.samples.iter().rev().find(|s| s.clock_ns <= from_ns);
        let before = before.or_else(|| self.samples.front())?;
        let after = self.samples.iter().find(|s| s.clock_ns >= to_ns);
        let after = after.or_else(|| self.samples.back())?;
        (after.clock_ns > before.clock_ns).then(|| Evidence {
            involuntary_switches: after
                .involuntary_switches
                .saturating_sub(before.involuntary_switches),
            minor_faults: after.minor_faults.saturating_sub(before.minor_faults),
            steal_ms: after.steal_ticks.saturating_sub(before.steal_ticks) * STEAL_TICK_MS,
            waited_us: after.waited_ns.saturating_sub(before.waited_ns) / 1000,
            stopped: after.continued > before.continued,
        })
    }
}

/// Deadline misses by class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct MissClasses {
    /// The thread was switched away against its will.
    pub preempted: u64,
    /// The hypervisor had the processor: there was steal.
    pub taken_away: u64,
    /// A specimen's reply came late.
    pub late_reply: u64,
    /// Our own fault.
    pub ours: u64,
    /// The process was stopped and continued.
    pub stopped: u64,
    /// The clock jumped, and nothing that is counted says why.
    pub unknown: u64,
}

impl MissClasses {
    /// Counts one miss.
    pub(crate) const fn count(&mut self, cause: MissCause) {
        let class = match cause {
            MissCause::Preempted => &mut self.preempted,
            MissCause::TakenAway => &mut self.taken_away,
            MissCause::LateReply => &mut self.late_reply,
            MissCause::Ours => &mut self.ours,
            MissCause::Stopped => &mut self.stopped,
            MissCause::Unknown => &mut self.unknown,
        };
        *class += 1;
    }

    /// Each class with its count; the program's own first.
    #[must_use]
    pub const fn each(&self) -> [(MissCause, u64); 6] {
        [
            (MissCause::Ours, self.ours),
            (MissCause::Preempted, self.preempted),
            (MissCause::TakenAway, self.taken_away),
            (MissCause::Stopped, self.stopped),
            (MissCause::LateReply, self.late_reply),
            (MissCause::Unknown, self.unknown),
        ]
    }

    /// All misses.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.each().iter().map(|(_, count)| count).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use MissCause::{LateReply, Ours, Preempted, Stopped, TakenAway, Unknown};

    #[test]
    fn class_follows_the_table() {
        let none = Evidence::default();
        let steal = Evidence {
            steal_ms: 1_240,
            ..none
        };
        let faults = Evidence {
            minor_faults: 2,
            ..steal
        };
        let switches = Evidence {
            involuntary_switches: 1,
            ..faults
        };
        // A delay of 1.25 s; the thread was ready for 1.249 s of it, without any steal.
        let waited = Evidence {
            waited_us: 1_249_000,
            ..none
        };
        let a_little = Evidence {
            waited_us: 300,
            ..none
        };
        // One tick of steal, and one switch with a short wait, beside a delay of 1.25 s.
        let a_tick = Evidence {
            steal_ms: 10,
            ..none
        };
        let a_switch = Evidence {
            involuntary_switches: 1,
            ..a_little
        };
        let stopped = Evidence {
            stopped: true,
            ..switches
        };
        for (evidence, of_jump, of_compute, of_reply) in [
            (None, Unknown, Ours, LateReply),
            (Some(none), Unknown, Ours, LateReply),
            (Some(a_little), Unknown, Ours, LateReply),
            (Some(a_tick), Unknown, Ours, LateReply),
            (Some(a_switch), Unknown, Ours, LateReply),
            (Some(steal), TakenAway, Ours, LateReply),
            (Some(faults), Ours, Ours, LateReply),
            (Some(switches), Preempted, Preempted, LateReply),
            (Some(waited), Preempted, Preempted, LateReply),
            (Some(stopped), Stopped, Stopped, Stopped),
        ] {
            let class = |known| classify(known, evidence, 1_250_000_000);
            assert_eq!(class(TakenAway), of_jump, "{evidence:?}");
            assert_eq!(class(Ours), of_compute, "{evidence:?}");
            assert_eq!(class(LateReply), of_reply, "{evidence:?}");
        }
    }

    fn sample(clock_ns: u64, switches: u64, faults: u64, steal: u64) -> SchedSample {
        SchedSample {
            clock_ns,
            involuntary_switches: switches,
            minor_faults: faults,
            steal_ticks: steal,
            ..SchedSample::default()
        }
    }

    #[test]
    fn evidence_is_the_growth_around_the_miss() {
        let mut window = SampleWindow::default();
        assert_eq!(window.evidence(0, 10), None);
        for (k, counts) in [(0, 0, 0), (1, 0, 1), (3, 4, 1), (3, 4, 9)]
            .into_iter()
            .enumerate()
        {
            window.push(sample(100 + 100 * k as u64, counts.0, counts.1, counts.2));
        }
        window.push(sample(150, 77, 77, 77));
        let found = |from, to| {
            let e = window.evidence(from, to).unwrap();
            (e.involuntary_switches, e.minor_faults, e.steal_ms)
        };
        assert_eq!(found(210, 290), (2, 4, 0));
        assert_eq!(found(200, 200 + 1), (2, 4, 0));
        assert_eq!(found(150, 310), (3, 4, 90));
        assert_eq!(found(0, 5000), (3, 4, 90));
        assert_eq!(window.evidence(900, 950), None);
        assert!(window.reaches(400) && !window.reaches(401));
    }

    #[test]
    fn window_forgets_the_oldest_samples() {
        let mut window = SampleWindow::default();
        for k in 0..2 * KEPT as u64 {
            window.push(sample(k, k, 0, 0));
        }
        assert_eq!(window.samples.len(), KEPT);
        let evidence = window.evidence(0, u64::MAX).unwrap();
        assert_eq!(evidence.involuntary_switches, KEPT as u64 - 1);
    }
}
