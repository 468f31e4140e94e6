//! Real-time abilities and shortcomings of this machine, and what to do about them.
//!
//! Every topic becomes one [`Finding`]. The kernel's files are read from a directory tree, so that tests can examine
//! other machines. Abilities that only a request shows are requested on a scratch thread and given back. Nothing is
//! changed for good and nothing is printed.

use serde::Serialize;

use super::RtPlan;
use super::os::process_cpus;

pub mod fitness;
pub mod interface;
pub mod machine;
pub mod trial;

pub use interface::examine_interface;
pub(crate) use machine::Tree;

/// How good a finding is for a real-time test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Suitable for a real-time test.
    Good,
    /// Tests run; single ticks may be late.
    Fair,
    /// Expect late ticks.
    Poor,
    /// The machine does not say.
    Unknown,
}

/// One topic of the examination.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Short name, for example "clock source".
    pub topic: &'static str,
    /// The state of the machine in words.
    pub found: String,
    /// How good that is.
    pub verdict: Verdict,
    /// What to do about it; none if there is nothing to do.
    pub advice: Option<String>,
}

impl Finding {
    fn new(topic: &'static str, found: impl Into<String>, verdict: Verdict, advice: &str) -> Self {
        Self {
            topic,
            found: found.into(),
            verdict,
            advice: (!advice.is_empty()).then(|| advice.to_owned()),
        }
    }
}

/// Examines this machine for a run with `plan`. Takes a few milliseconds; memory is locked and released again meanwhile, so
/// this is not for a process that is running a test.
#[must_use]
pub fn examine(plan: RtPlan) -> Vec<Finding> {
    let tree = Tree::of_this_machine();
    // Before the trial, which binds its threads.
    let mut findings = machine::findings(&tree, Some(&process_cpus()));
    findings.extend(trial::findings(plan));
    findings
}

/// Findings from the machine's files alone, without a trial: safe at any time. The processors that this process may use are left
/// out, because a running test has bound itself to one.
#[must_use]
pub fn read() -> Vec<Finding> {
    machine::findings(&Tree::of_this_machine(), None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_gets_one_finding_per_topic() {
        let plan = RtPlan {
            fifo_priority: Some(90),
            cpu: None,
            lock_memory: true,
            hold_cpu_awake: true,
            spin_ns: 60_000,
            period_ns: 1_000_000,
            require: false,
        };
        let findings = examine(plan);
        let mut topics: Vec<_> = findings.iter().map(|f| f.topic).collect();
        let count = topics.len();
        topics.sort_unstable();
        topics.dedup();
        assert_eq!(topics.len(), count, "a topic appears twice");
        assert!(count >= 15, "{topics:?}");
        for finding in &findings {
            assert!(!finding.found.is_empty(), "{finding:?}");
            // Every poor finding has an advice.
            assert!(
                finding.verdict != Verdict::Poor || finding.advice.is_some(),
                "{finding:?}"
            );
        }
    }

    #[test]
    fn finding_serialises_with_its_verdict() {
        let json = serde_json::to_value(Finding::new("swap", "none", Verdict::Good, "")).unwrap();
        assert_eq!(
            json,
            serde_json::json!({"topic": "swap", "found": "none", "verdict": "good", "advice": null})
        );
    }
}
