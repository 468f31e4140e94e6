//! Findings that only asking can give: policy, memory lock, wake-up latency, limits, timers.
//!
//! Asked on a scratch thread that ends with the asking; the memory lock, which is the process's, is taken back.

use super::{Finding, Verdict};
use crate::rt::os::{self, Privileges};
use crate::rt::{Feature, Granted, RtPlan, Want, apply};

/// Tries everything that a run with `plan` would ask for, and gives it back.
#[must_use]
pub(crate) fn findings(plan: RtPlan) -> Vec<Finding> {
    let granted = std::thread::spawn(move || {
        let granted = apply(&plan);
        if granted.has(Want::LockMemory) {
            // Nothing is left to try if the kernel will not unlock; the process ends soon.
            let _ = os::unlock_memory();
        }
        granted
    })
    .join();
    let mut findings = granted.map_or_else(|_| Vec::new(), |granted| trials(&granted));
    findings.push(limits(&os::privileges()));
    findings.push(timers(os::timer_resolution_ns(), os::kernel_tick_ns()));
    findings
}

fn trials(granted: &Granted) -> Vec<Finding> {
    let judged = [
        (Want::Policy, "scheduling policy", Verdict::Poor),
        (Want::Affinity, "own processor", Verdict::Poor),
        (Want::LockMemory, "locked memory", Verdict::Fair),
        (Want::CpuAwake, "processors kept awake", Verdict::Fair),
    ];
    judged
        .into_iter()
        .filter_map(|(want, topic, refused)| {
            let feature = granted
                .features
                .iter()
                .find(|feature| feature.want == want)?;
            Some(trial(feature, topic, refused))
        })
        .collect()
}

fn trial(feature: &Feature, topic: &'static str, refused: Verdict) -> Finding {
    if feature.granted {
        return Finding::new(
            topic,
            format!("{}: granted", feature.asked),
            Verdict::Good,
            "",
        );
    }
    let reason = feature.reason.as_deref().unwrap_or("refused");
    Finding {
        topic,
        found: format!("{}: {reason}", feature.asked),
        verdict: refused,
        advice: Some(
            feature
                .advice
                .clone()
                .unwrap_or_else(|| "run as root".into()),
        ),
    }
}

fn limits(privileges: &Privileges) -> Finding {
    let rtprio = privileges
        .rtprio
        .map_or_else(|| "unlimited".into(), |limit| limit.to_string());
    let memlock = privileges.memlock.map_or_else(
        || "unlimited".into(),
        |bytes| format!("{} kB", bytes / 1024),
    );
    let capability = |held| if held { "held" } else { "not held" };
    let found = format!(
        "rtprio {rtprio}, memlock {memlock}; CAP_SYS_NICE {}, CAP_IPC_LOCK {}",
        capability(privileges.nice),
        capability(privileges.ipc_lock)
    );
    let may_schedule = privileges.nice || privileges.rtprio.is_none_or(|limit| limit >= 90);
    let may_lock = privileges.ipc_lock || privileges.memlock.is_none();
    if may_schedule && may_lock {
        Finding::new("limits", found, Verdict::Good, "")
    } else {
        let advice = "in /etc/security/limits.conf: '@realtime - rtprio 90' and '@realtime - memlock unlimited'; join \
                      the group realtime and log in again";
        Finding::new("limits", found, Verdict::Fair, advice)
    }
}

fn timers(resolution_ns: u64, tick_ns: u64) -> Finding {
    let hz = 1_000_000_000 / tick_ns.max(1);
    if resolution_ns <= 1000 {
        let found = format!("high resolution ({resolution_ns} ns); the kernel ticks at {hz} Hz");
        Finding::new("timers", found, Verdict::Good, "")
    } else {
        let found = format!("sleeps end on the kernel's tick only: {hz} Hz");
        Finding::new(
            "timers",
            found,
            Verdict::Poor,
            "boot without highres=off; use a kernel with HIGH_RES_TIMERS",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusal_becomes_a_finding_with_advice() {
        let feature = Feature {
            want: Want::Policy,
            asked: "SCHED_FIFO, priority 90".into(),
            granted: false,
            errno: Some(1),
            reason: Some("EPERM: Operation not permitted (os error 1)".into()),
            advice: Some("limits".into()),
        };
        let finding = trial(&feature, "scheduling policy", Verdict::Poor);
        assert_eq!(finding.verdict, Verdict::Poor);
        assert!(finding.found.contains("priority 90: EPERM"), "{finding:?}");
        assert_eq!(finding.advice.as_deref(), Some("limits"));
    }

    #[test]
    fn limits_are_good_by_capability_or_number() {
        let with = |nice, ipc_lock, rtprio, memlock| {
            limits(&Privileges {
                nice,
                ipc_lock,
                net_raw: false,
                rtprio,
                memlock,
            })
            .verdict
        };
        assert_eq!(with(true, true, Some(0), Some(0)), Verdict::Good);
        assert_eq!(with(false, false, Some(95), None), Verdict::Good);
        assert_eq!(with(false, false, Some(0), None), Verdict::Fair);
        assert_eq!(with(true, false, Some(0), Some(8 << 20)), Verdict::Fair);
    }

    #[test]
    fn tick_length_is_the_kernel_frequency() {
        assert!(timers(1, 4_000_000).found.contains("250 Hz"));
        assert_eq!(timers(4_000_000, 4_000_000).verdict, Verdict::Poor);
    }
}
