//! How a run ended, in plain words, from its summary; and the facts that are known without one.
//!
//! It never guesses: an absent value is reported as absent.

use std::collections::BTreeSet;

use super::RunView;
use super::text::{count, exact, plural, quantity};
use gusset_proof::{RecordedFinding, RecordedVerdict, per_cent};
use gusset_quantity::catalog::ending::Status;
use gusset_quantity::catalog::event::Remark;
use gusset_record::rt::{Feature, Want};
use gusset_record::summary::{StageShares, TimeBetweenTargets};
use gusset_record::{Event, EventLine, MissCause};

/// How good the news is; decides the colour of the banner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tone {
    Good,
    Warning,
    Bad,
}

/// The verdict: one headline, then sentences. Plain text, not yet escaped.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Verdict {
    pub tone: Tone,
    pub headline: String,
    /// Faults and doubts, and then the rest.
    pub sentences: Vec<String>,
    /// Sentences of the first kind: they are never folded.
    pub warnings: usize,
}

/// The verdict on `run`; `after` is the step after which it resumed, if it did. `more` are sentences on the steps of the test
/// that these are, and on the end positions of the specimens.
pub(super) fn verdict(run: &RunView, after: Option<u64>, more: &[String]) -> Verdict {
    let summary = run.summary.as_ref();
    let status = summary.map(|summary| summary.status);
    let (mut tone, headline) = match status {
        _ if run.flaws.unfinished.is_some() => (
            Tone::Bad,
            "Unfinished: this run did not come to an orderly end",
        ),
        _ if !run.flaws.contradicted.is_empty() => (
            Tone::Bad,
            "Contradicted: the files of this run contradict each other",
        ),
        _ if !run.flaws.damaged.is_empty() => {
            (Tone::Bad, "Damaged: this record is not whole any more")
        }
        Some(Status::Completed) => (Tone::Good, "Completed: the test ran to its end"),
        Some(Status::Interrupted) => (
            Tone::Warning,
            "Interrupted: the test was ended by the operator",
        ),
        Some(Status::Stopped) => (Tone::Bad, "Stopped: a limit or bound ended the test"),
        Some(Status::Failed) => (Tone::Bad, "Failed: the test could not go on"),
        None => (Tone::Bad, "No summary: how this run ended is not recorded"),
    };
    let warned = warned(run);
    let mut headline = headline.to_owned();
    if let Some(first) = run
        .flaws
        .contradicted
        .first()
        .filter(|_| run.flaws.unfinished.is_none())
    {
        headline += &format!(": {first}");
    }
    if warned > 0 {
        tone = worse(tone);
        let limits = if warned == 1 { "limit" } else { "limits" };
        headline += &format!("; {warned} {limits} warned");
    }
    let is_played = |line: &EventLine| {
        matches!(
            line.event,
            Event::Said {
                event: Remark::Faults,
                ..
            }
        )
    };
    if run.events.iter().any(is_played) {
        tone = worse(tone);
        headline += "; FAULTS were played on it";
    }
    let mut sentences = Vec::new();
    let judged = summary.and_then(|summary| summary.verdict.as_ref());
    if let Some(unstable) = judged.and_then(RecordedVerdict::headline) {
        tone = Tone::Bad;
        headline += "; the LOOP IS UNSTABLE";
        sentences.push(ended(&unstable));
    }
    if let Some(errors) = judged.and_then(|judged| judged.errors.as_ref()) {
        for (name, error) in errors.each() {
            sentences.push(ended(&format!("Error of the {name}: {}", error.words())));
            if error.not_known.is_some() {
                tone = worse(tone);
                headline += &format!("; the error of the {name} is not known");
            } else if !errors.is_small(error) {
                let is_large = !error.is_below(errors.refuse);
                tone = if is_large { Tone::Bad } else { worse(tone) };
                let of_drift = !error.is_below(errors.warn);
                let (what, size) = if of_drift {
                    ("error", error.drift)
                } else {
                    ("NRMSE", error.nrmse)
                };
                let size = per_cent(size.unwrap_or(f64::NAN));
                headline += &format!("; the {what} of the {name} is {size}");
            }
        }
        if let Some(text) = errors.of_modes().filter(|_| errors.take_damping()) {
            tone = worse(tone);
            sentences.push(ended(&text));
        }
    } else if judged.is_some() && run.test.file.structure.is_some() {
        tone = worse(tone);
        headline += "; its errors are not known";
    }
    let findings = judged.map_or(&[][..], |judged| &judged.findings);
    let is_error = |one: &&RecordedFinding| one.severity == "error";
    if findings.iter().any(|one| is_error(&one)) {
        tone = Tone::Bad;
    } else if !findings.is_empty() {
        tone = worse(tone);
    }
    let counted = |n: usize, one: &str, many: &str| match n {
        0 => String::new(),
        n => format!("; {}", plural(n as u64, one, many)),
    };
    let errors = findings.iter().filter(is_error).count();
    headline += &counted(errors, "error of the verdict", "errors of the verdict");
    headline += &counted(
        findings.len() - errors,
        "finding of the verdict",
        "findings of the verdict",
    );
    for (key, reason) in summary.iter().flat_map(|summary| &summary.accepted) {
        tone = worse(tone);
        sentences.push(ended(&format!(
            "The user accepted findings by `{key}`: {reason}"
        )));
    }
    if let Some(why) = &run.flaws.unfinished {
        sentences.push(ended(why));
    }
    sentences.extend(run.flaws.contradicted.iter().map(|what| ended(what)));
    sentences.extend(run.flaws.damaged.iter().map(|what| ended(what)));
    if let Some(status) =
        status.filter(|_| !run.flaws.damaged.is_empty() && run.flaws.contradicted.is_empty())
    {
        sentences.push(format!("The test itself: {}.", status.word()));
    }
    if run.flaws.unreadable_events > 0 && run.flaws.unfinished.is_none() {
        // One at the end is normal after a kill.
        tone = worse(tone);
        sentences.push("Lines of events.jsonl are damaged: see the events.".to_owned());
    }
    let reason = summary.map(|summary| &summary.reason);
    if let Some(reason) = reason.filter(|r| {
        // The headline already reports that a completed test reached its end.
        !r.trim().is_empty() && status != Some(Status::Completed)
    }) {
        sentences.push(ended(&format!("Reason: {reason}")));
    }
    let is_told = |text: &str| sentences.iter().any(|told| told.contains(text.trim()));
    let findings = findings.iter().map(|one| (&one.text, &one.severity));
    let findings: Vec<_> = findings.filter(|(text, _)| !is_told(text)).collect();
    let is_finding = |text: &String| findings.iter().any(|(known, _)| text.contains(*known));
    let warnings = summary.iter().flat_map(|summary| &summary.warnings);
    let warnings: Vec<&String> = warnings
        .filter(|text| !is_told(text) && !is_finding(text))
        .collect();
    let name = |severity: &str| match severity {
        "error" => "Error of the verdict",
        "accepted" => "Accepted finding of the verdict",
        _ => "Finding of the verdict",
    };
    let findings = (findings.iter()).map(|(text, severity)| format!("{}: {text}", name(severity)));
    let warnings = warnings.into_iter().map(|text| format!("Warning: {text}"));
    let doubts: Vec<String> = findings.chain(warnings).map(|text| ended(&text)).collect();
    if !doubts.is_empty() {
        tone = worse(tone);
    }
    sentences.extend(doubts);
    let lost = summary.map_or(0, |summary| summary.rows_lost);
    if lost > 0 {
        tone = worse(tone);
        let gaps = match run.flaws.missing_rows {
            0 => "they are missing at the end of this record",
            _ => "this record has gaps",
        };
        sentences.push(format!(
            "ROWS LOST: {} did not reach the disk; {gaps}.",
            count(lost)
        ));
    }
    let (misses, sentence) = misses(run);
    let mut sentence = sentence;
    if misses > 0 {
        tone = worse(tone);
        sentences.extend(sentence.take());
    }
    let stretched = summary.map_or(0, |summary| summary.stretched_ticks);
    if stretched > 0 {
        tone = worse(tone);
        let ticks = plural(stretched, "tick", "ticks");
        sentences.push(format!(
            "The grid was stretched by {ticks}: the specimen saw slower time."
        ));
    }
    let warnings = sentences.len();
    sentences.extend(extent(run, after));
    sentences.extend(summary.and_then(|summary| summary.between_targets.as_ref().map(between)));
    sentences.extend_from_slice(more);
    sentences.extend(sentence);
    Verdict {
        tone,
        headline,
        sentences,
        warnings,
    }
}

/// How a gateway has spent its time between targets.
fn between(times: &TimeBetweenTargets) -> String {
    let part = |name: &str, shares: &StageShares| {
        format!(
            "{name} {} in the laboratory, {} at full pace, {} slower, {} at rest, {}",
            quantity(shares.laboratory_s, "s"),
            per_cent(shares.correcting + shares.predicting),
            per_cent(shares.slowing),
            per_cent(shares.holding),
            plural(shares.slow_downs, "slow-down", "slow-downs")
        )
    };
    let TimeBetweenTargets { whole, strong_part } = times;
    format!(
        "Between targets: {}; {}. The longest slow-down took {}.",
        part("in the whole test", whole),
        part("in its strong part (5 to 95 % of ∫ a² dt)", strong_part),
        quantity(whole.longest_slow_down_s, "s")
    )
}

/// Number of limits whose warning level was passed, each counted once however often it was.
fn warned(run: &RunView) -> usize {
    let limits: BTreeSet<_> = run
        .events
        .iter()
        .filter_map(|line| match &line.event {
            Event::LimitWarning(reached) => Some((reached.port, reached.axis, &reached.limit)),
            _ => None,
        })
        .collect();
    limits.len()
}

const fn worse(tone: Tone) -> Tone {
    match tone {
        Tone::Good | Tone::Warning => Tone::Warning,
        Tone::Bad => Tone::Bad,
    }
}

/// A sentence with its full stop.
fn ended(text: &str) -> String {
    let text = text.trim();
    let stop = if text.ends_with(['.', '!', '?']) {
        ""
    } else {
        "."
    };
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        format!("{}{}{stop}", first.to_uppercase(), letters.as_str())
    })
}

fn extent(run: &RunView, after: Option<u64>) -> Option<String> {
    let summary = run.summary.as_ref()?;
    let (steps, dt, wall) = (summary.steps, summary.dt, summary.wall_seconds);
    // The first command of a controller belongs to no step, nor may others.
    let mut sentence = if run.is_served() {
        let accepted = plural(steps, "command", "commands");
        let apart = exact(dt, "s");
        format!("{accepted} accepted, {apart} of test time from one to the next")
    } else {
        let before = after.unwrap_or(0);
        let own = steps.saturating_sub(before);
        let steps_of = if before > 0 && own > 0 {
            format!("Steps {} to {}", count(before + 1), count(steps))
        } else {
            plural(own, "step", "steps")
        };
        let sentence = format!("{steps_of} of {} each", exact(dt, "s"));
        let tested = own as f64 * dt;
        sentence + &format!(", {tested:.6} s of test time").replace(".000000", "")
    };
    sentence += &match run.is_simulated() {
        true => {
            let took = quantity(wall, "s");
            format!(", on the simulated clock in {took}: nothing here was in real time")
        }
        false => format!(", in {wall:.1} s of wall time"),
    };
    Some(sentence + ".")
}

/// Deadline misses by class, from the summary or, where it has none, counted from the events.
pub(super) fn miss_classes(run: &RunView) -> Vec<(Option<MissCause>, u64)> {
    let classes = run.summary.as_ref().map(|summary| summary.miss_classes);
    if let Some(classes) = classes.filter(|classes| classes.total() > 0) {
        return classes.each().map(|(cause, n)| (Some(cause), n)).into();
    }
    let mut classes = Vec::new();
    for line in run.events.iter().filter(|line| is_miss(line)) {
        let class = class_of(line);
        match classes.iter_mut().find(|(known, _)| *known == class) {
            Some((_, n)) => *n += 1,
            None => classes.push((class, 1)),
        }
    }
    classes
}

/// The class of a miss, if it was recorded.
pub(super) const fn class_of(line: &EventLine) -> Option<MissCause> {
    match line.event {
        Event::Miss { class, .. } => Some(class),
        _ => None,
    }
}

/// True for the record of a deadline miss.
pub(super) fn is_miss(event: &EventLine) -> bool {
    event.name() == "miss"
}

/// Number of misses, and a sentence about them where anything is known.
fn misses(run: &RunView) -> (u64, Option<String>) {
    let classes = miss_classes(run);
    let sum: u64 = classes.iter().map(|(_, n)| n).sum();
    let stated = run.summary.as_ref().map(|summary| summary.deadline_misses);
    // A server has no deadlines: the controller's record has its own.
    if run.is_simulated() || run.is_served() {
        return (stated.unwrap_or(0), None);
    }
    let total = stated.unwrap_or(sum);
    if total == 0 {
        return (0, stated.map(|_| "No deadline was missed.".to_owned()));
    }
    let list: Vec<_> = classes
        .iter()
        .filter(|(_, n)| *n > 0)
        .map(|(class, n)| format!("{}: {}", class_words(*class), count(*n)))
        .collect();
    // Only if every miss has a class can the text exclude our own misses.
    let is_other = |class: &Option<MissCause>| {
        class.is_some_and(|class| !matches!(class, MissCause::Ours | MissCause::Unknown))
    };
    let others = classes.iter().filter(|(class, _)| is_other(class));
    let others: u64 = others.map(|(_, n)| n).sum();
    let mut sentence = format!("{} missed", plural(total, "deadline was", "deadlines were"));
    if !list.is_empty() {
        sentence += &format!(" ({})", list.join(", "));
        sentence += if others == total {
            ", none by this program's own fault"
        } else {
            ""
        };
    }
    (total, Some(sentence + "."))
}

/// A class of misses in words.
pub(super) const fn class_words(class: Option<MissCause>) -> &'static str {
    match class {
        Some(MissCause::Preempted) => "thread switched away",
        Some(MissCause::TakenAway) => "processor taken away by the hypervisor",
        Some(MissCause::Stopped) => "process stopped and continued",
        Some(MissCause::Unknown) => "cause not known",
        Some(MissCause::LateReply) => "late reply of a specimen",
        Some(MissCause::Ours) => "own computation",
        None => "class not recorded",
    }
}

const fn feature_words(want: Want) -> &'static str {
    match want {
        Want::Affinity => "a separate processor",
        Want::Policy => "real-time priority",
        Want::LockMemory => "locked memory",
        Want::Prefault => "a touched stack",
        Want::CpuAwake => "processors held awake",
        Want::TimerSlack => "exact timers",
        Want::Signals => "signals kept off the loop",
    }
}

/// Sentences on the refusals of the operating system, and their remedies.
pub(super) fn refused(run: &RunView) -> Vec<String> {
    let granted = run.summary.iter();
    let granted = granted.flat_map(|summary| &summary.realtime.granted);
    let features = granted.flat_map(|granted| &granted.features);
    let sentence = |feature: &Feature| {
        let mut sentence = format!("Not granted: {}", feature_words(feature.want));
        if let Some(reason) = &feature.reason {
            sentence += &format!(" ({reason})");
        }
        if let Some(advice) = &feature.advice {
            sentence += &format!("; {advice}");
        }
        ended(&sentence)
    };
    features
        .filter(|feature| !feature.granted)
        .map(sentence)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Flaws;
    use serde_json::{Value, json};

    fn of(summary: Value, events: Vec<Value>) -> Verdict {
        verdict(
            &RunView {
                summary: Some(summary.into()),
                events: events.into_iter().map(EventLine::from).collect(),
                ..RunView::default()
            },
            None,
            &[],
        )
    }

    #[test]
    fn clean_run_is_reported_as_good() {
        let v = of(
            json!({"status": "completed", "steps": 40960, "dt": 0.0009765625, "clock": "real", "wall_seconds": 40.0, "deadline_misses": 0}),
            vec![],
        );
        assert_eq!(v.tone, Tone::Good);
        assert!(
            v.sentences.iter().any(|s| s.contains("40 s of test time")),
            "{v:?}"
        );
        assert!(v.sentences.contains(&"No deadline was missed.".to_owned()));
    }

    #[test]
    fn misses_and_lost_rows_are_spelled_out() {
        let miss = |class: &str| json!({"event": "miss", "class": class});
        let v = of(
            json!({
                "status": "completed", "deadline_misses": 3, "rows_lost": 7, "stretched_ticks": 1,
                "warnings": ["the record is shorter than the test"],
                "realtime": {"complete": false, "required": false, "features": [
                    {"want": "policy", "asked": "SCHED_FIFO", "granted": true},
                    {"want": "lock_memory", "asked": "mlockall", "granted": false, "reason": "EPERM", "advice": "raise memlock in limits.conf"},
                ], "spin": {"asked_us": 0.0, "used_us": 0.0, "throttle": null, "note": ""}},
            }),
            vec![miss("preempted"), miss("taken_away"), miss("taken_away")],
        );
        assert_eq!(v.tone, Tone::Warning);
        let all = v.sentences.join("\n");
        for part in [
            "deadlines were missed",
            "thread switched away: 1",
            "by the hypervisor: 2",
            "none by this program's own fault",
            "ROWS LOST: 7",
            "stretched by 1\u{a0}tick",
            "Warning: the record is shorter than the test.",
        ] {
            assert!(all.contains(part), "{part} is missing in:\n{all}");
        }
    }

    #[test]
    fn warnings_are_counted_in_the_verdict() {
        let warned = |specimen: u64, limit: &str| json!({"event": "limit_warning", "specimen": specimen, "axis": 1, "limit": limit});
        let of_test = json!({"event": "limit_warning", "limit": "delay_used"});
        let events = vec![
            warned(1, "measured_force_n"),
            warned(1, "measured_force_n"),
            warned(2, "measured_force_n"),
            of_test,
        ];
        let v = of(json!({"status": "completed"}), events);
        assert_eq!(v.tone, Tone::Warning);
        assert!(v.headline.ends_with("to its end; 3 limits warned"), "{v:?}");
        let v = of(json!({"status": "completed"}), vec![warned(1, "a")]);
        assert!(v.headline.ends_with("; 1 limit warned"), "{v:?}");
        let trip = json!({"event": "limit_trip", "limit": "a"});
        let v = of(json!({"status": "stopped"}), vec![trip]);
        assert!(
            v.tone == Tone::Bad && !v.headline.contains("warned"),
            "{v:?}"
        );
    }

    #[test]
    fn any_finding_turns_the_tone() {
        let finding = |kind: &str, severity: &str, text: &str| json!({"kind": kind, "severity": severity, "key": "", "text": text, "numbers": {}, "help": []});
        let of_verdict = |findings: Vec<Value>, unstable: bool, warnings: Vec<&str>| {
            let verdict = json!({"outcome": "simulated", "unstable": unstable, "behind_link": false, "findings": findings});
            of(
                json!({"status": "completed", "steps": 10, "dt": 0.1, "verdict": verdict, "warnings": warnings}),
                vec![],
            )
        };
        let clean = of_verdict(vec![], false, vec![]);
        assert_eq!((clean.tone, clean.warnings), (Tone::Good, 0));
        let unknown: Vec<Value> = (0..5)
            .map(|n| finding("unknown", "warning", &format!("number {n} is not known")))
            .collect();
        let v = of_verdict(
            unknown,
            false,
            vec!["number 3 is not known", "units are odd"],
        );
        assert_eq!(v.tone, Tone::Warning);
        assert!(
            v.headline.ends_with("; 5\u{a0}findings of the verdict"),
            "{v:?}"
        );
        // Each once, and all of them before the part that may be folded.
        assert_eq!(v.warnings, 6, "{v:?}");
        let v = of_verdict(vec![], false, vec!["units are odd"]);
        assert_eq!((v.tone, v.warnings), (Tone::Warning, 1));
        for kind in ["unstable", "rehearsal"] {
            let v = of_verdict(
                vec![finding(kind, "error", "it grows")],
                kind == "unstable",
                vec![],
            );
            assert_eq!((v.tone, v.warnings), (Tone::Bad, 1), "{v:?}");
        }
    }

    #[test]
    fn miss_without_a_class_is_not_excused() {
        let miss = |class: Value| json!({"event": "miss", "class": class});
        let v = of(
            json!({"status": "completed", "deadline_misses": 2}),
            vec![miss(json!("preempted")), miss(Value::Null)],
        );
        let all = v.sentences.join("\n");
        assert!(
            all.contains("class not recorded: 1") && !all.contains("own fault"),
            "{all}"
        );
        let v = of(
            json!({"status": "completed", "deadline_misses": 2, "miss_classes": {"ours": 1, "preempted": 1}}),
            vec![],
        );
        let all = v.sentences.join("\n");
        assert!(
            all.contains("own computation: 1") && !all.contains("own fault"),
            "{all}"
        );
    }

    #[test]
    fn every_other_end_is_reported_plainly() {
        assert!(
            of(
                json!({"status": "stopped", "reason": "force limit of axis 1"}),
                vec![]
            )
            .sentences[0]
                .contains("Reason: force limit")
        );
        assert_eq!(of(json!({"status": "failed"}), vec![]).tone, Tone::Bad);
        assert_eq!(
            of(json!({"status": "interrupted"}), vec![]).tone,
            Tone::Warning
        );
        let nothing = verdict(&RunView::default(), None, &[]);
        assert!(nothing.headline.starts_with("No summary"));
        let v = verdict(
            &RunView {
                flaws: Flaws {
                    unfinished: Some("killed".to_owned()),
                    ..Flaws::default()
                },
                ..RunView::default()
            },
            None,
            &[],
        );
        assert!(v.headline.starts_with("Unfinished") && v.sentences == ["Killed."]);
    }

    #[test]
    fn resumed_test_claims_only_its_steps() {
        let run = RunView {
            summary: Some(
                json!({"status": "completed", "steps": 5120, "dt": 0.00390625, "clock": "real", "wall_seconds": 16.1}).into()),
            ..RunView::default()
        };
        let told = verdict(&run, Some(1869), &[]).sentences[0].clone();
        let own = "Steps 1870 to 5120 of 3.90625\u{a0}ms each, 12.699219 s of test time, in 16.1 s of wall time.";
        assert_eq!(told, own);
        let whole = verdict(&run, None, &[]).sentences[0].clone();
        assert!(whole.contains(", 20 s of test time, in 16.1 s"), "{whole}");
    }

    #[test]
    fn unreadable_events_are_not_good_news() {
        let v = verdict(
            &RunView {
                summary: Some(json!({"status": "completed"}).into()),
                flaws: Flaws {
                    unreadable_events: 1,
                    ..Flaws::default()
                },
                ..RunView::default()
            },
            None,
            &[],
        );
        assert_eq!(v.tone, Tone::Warning);
        assert!(v.sentences[0].contains("events.jsonl"), "{v:?}");
    }

    #[test]
    fn incomplete_record_is_not_good_news() {
        let v = verdict(
            &RunView {
                summary: Some(json!({"status": "completed", "steps": 100, "dt": 0.01}).into()),
                flaws: Flaws {
                    damaged: vec!["the rows end at 0.25 s".to_owned()],
                    ..Flaws::default()
                },
                ..RunView::default()
            },
            None,
            &[],
        );
        assert_eq!(v.tone, Tone::Bad);
        assert!(v.headline.starts_with("Damaged"), "{v:?}");
        assert_eq!(
            v.sentences[..2],
            ["The rows end at 0.25 s.", "The test itself: completed."]
        );
    }
}
