//! The verdict on a machine: the kind of test that it is fit for, and the first thing to do.

use super::{Finding, Verdict};

/// Topic of the verdict among the findings.
pub const TOPIC: &str = "verdict";

/// Without these a tick can be late by milliseconds however well the rest is set.
const ESSENTIAL: [&str; 4] = [
    "kernel",
    "scheduling policy",
    "own processor",
    "locked memory",
];

/// Topics in the order in which to work on them: what limits all others comes first. Topics that are not listed come last.
const ORDER: [&str; 9] = [
    "hypervisor",
    "processors",
    "scheduling policy",
    "limits",
    "own processor",
    "real-time throttling",
    "kernel",
    "isolated processors",
    "locked memory",
];

/// The verdict that follows from `findings`, as one more finding.
#[must_use]
pub fn verdict(findings: &[Finding]) -> Finding {
    let worst = |verdict: Verdict| {
        let found = findings.iter().filter(|one| one.verdict == verdict);
        found.min_by_key(|one| {
            let place = ORDER.iter().position(|topic| *topic == one.topic);
            place.unwrap_or(ORDER.len())
        })
    };
    let is_good = |topic: &&str| {
        let mut of_topic = findings.iter().filter(|one| one.topic == *topic);
        of_topic.any(|one| one.verdict == Verdict::Good)
    };
    let first = |finding: &Finding| {
        let advice = finding.advice.as_deref().unwrap_or(&finding.found);
        format!("{}: {advice}", finding.topic)
    };
    if let Some(poor) = worst(Verdict::Poor) {
        let found = "fit for simulation only";
        return Finding::new(TOPIC, found, Verdict::Poor, &first(poor));
    }
    if ESSENTIAL.iter().all(is_good) {
        let advice = "measure it: gusset jitter --rate 1024 --duration 60 --load";
        return Finding::new(TOPIC, "fit for hard real time", Verdict::Good, advice);
    }
    let found = "fit for real time with single late ticks";
    let unknown = || {
        findings
            .iter()
            .find(|one| ESSENTIAL.contains(&one.topic) && one.verdict == Verdict::Unknown)
    };
    let advice = match worst(Verdict::Fair).or_else(unknown) {
        Some(fair) => first(fair),
        None => "measure it: gusset jitter --rate 1024 --duration 60 --load".to_owned(),
    };
    Finding::new(TOPIC, found, Verdict::Fair, &advice)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine(changed: &[(&'static str, Verdict)]) -> Vec<Finding> {
        let topics = ["swap", "steal", "hypervisor"].iter().chain(&ESSENTIAL);
        let findings = topics.map(|topic| {
            let other = changed.iter().find(|(name, _)| name == topic);
            let verdict = other.map_or(Verdict::Good, |(_, verdict)| *verdict);
            Finding::new(topic, "found", verdict, &format!("mend the {topic}"))
        });
        findings.collect()
    }

    fn judged(changed: &[(&'static str, Verdict)]) -> (Verdict, String) {
        let found = verdict(&machine(changed));
        (found.verdict, found.advice.unwrap())
    }

    #[test]
    fn complete_machine_is_fit_for_real_time() {
        let (verdict, advice) = judged(&[("swap", Verdict::Fair)]);
        assert_eq!(verdict, Verdict::Good);
        assert!(advice.contains("gusset jitter"), "{advice}");
    }

    #[test]
    fn one_poor_finding_leaves_simulation() {
        let all = [
            ("steal", Verdict::Poor),
            ("hypervisor", Verdict::Poor),
            ("kernel", Verdict::Fair),
        ];
        let (verdict, advice) = judged(&all);
        assert_eq!(
            (verdict, advice.as_str()),
            (Verdict::Poor, "hypervisor: mend the hypervisor")
        );
        assert_eq!(judged(&all[..1]).1, "steal: mend the steal");
    }

    #[test]
    fn fair_or_unknown_item_allows_late_ticks() {
        for other in [Verdict::Fair, Verdict::Unknown] {
            let (verdict, advice) = judged(&[("kernel", other)]);
            assert_eq!(
                (verdict, advice.as_str()),
                (Verdict::Fair, "kernel: mend the kernel")
            );
        }
    }
}
