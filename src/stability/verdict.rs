//! The verdict of a test: its findings, and whether they forbid it.

use std::collections::BTreeMap;

use super::axes::not_proven;
use super::together::together;
use super::{Following, grows};
use crate::config::{ClockChoice, Diagnostics, Finding, KeyPath, Loaded, SafetyTable, Severity};
use crate::record::{Kind, Outcome, RecordedFinding, RecordedVerdict};
use crate::setup::{Doubt, Facts, Prepared};

/// Key of `[safety]` that accepts an error of this kind.
const fn accepted_by(kind: Kind) -> Option<&'static str> {
    match kind {
        Kind::Unstable | Kind::Unproven => Some("accept_unstable"),
        Kind::Rehearsal => Some("accept_trip"),
        Kind::Unknown => None,
    }
}

/// A finding, its kind, and the reason for which the user accepts it.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// Its subject.
    pub kind: Kind,
    /// The finding with its place in the file; an accepted error stays an error here.
    pub finding: Finding,
    /// The reason of the user, if the finding is an error that is accepted.
    pub accepted: Option<String>,
}

impl Judgement {
    /// True for an error that the user has not accepted.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.finding.severity == Severity::Error && self.accepted.is_none()
    }

    /// The finding to show: an error only if it forbids the test, otherwise a warning.
    fn shown(&self, forbids: bool) -> Finding {
        let severity = if self.is_open() && forbids {
            Severity::Error
        } else {
            Severity::Warning
        };
        let finding = Finding {
            severity,
            ..self.finding.clone()
        };
        match &self.accepted {
            Some(reason) => finding.help(format!("accepted: {reason}")),
            None => finding,
        }
    }
}

/// May a test move its specimens?
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Verdict {
    /// Whether the test moves a specimen behind a link, on the real clock.
    pub behind_link: bool,
    /// All findings, those of stability first.
    pub findings: Vec<Judgement>,
    accept_unstable: Option<String>,
    accept_trip: Option<String>,
}

impl Verdict {
    /// The verdict on the stability of a test. `following` is what is proven of its actuators. Findings of a rehearsal are
    /// [added](Self::add) later.
    #[must_use]
    pub fn of(test: &Prepared, following: &[Following]) -> Self {
        let Some(loaded) = &test.loaded else {
            return Self::default();
        };
        let (file, facts) = (&loaded.file, &test.facts);
        let linked = file.specimen.iter().any(|table| table.link.is_some());
        let mut verdict = Self {
            behind_link: linked && facts.clock == ClockChoice::Real,
            findings: Vec::new(),
            accept_unstable: accepts_unstable(&file.safety, file.integrator.allow_unstable_lambda),
            accept_trip: file.safety.accept_trip.clone(),
        };
        for doubt in test.doubts.iter().cloned() {
            match doubt {
                Doubt::Unstable(finding) => verdict.add(Kind::Unstable, finding),
                Doubt::Unproven(finding) => verdict.add(Kind::Unproven, finding),
            }
        }
        if let Some(why) = facts.structure.as_ref().and_then(grows) {
            let at = KeyPath::root().key("structure");
            verdict.add(Kind::Unstable, Finding::error(at, why).at_key());
        }
        for (kind, finding) in following.iter().filter_map(Following::finding) {
            verdict.add(kind, finding);
        }
        if !verdict.is_unstable()
            && let Some((kind, finding)) = together(loaded, facts)
        {
            verdict.add(kind, finding);
        }
        for finding in not_proven(loaded, facts) {
            verdict.add(Kind::Unknown, finding);
        }
        for finding in unknown_actuators(loaded, facts) {
            verdict.add(Kind::Unknown, finding);
        }
        verdict
    }

    /// One more finding; an error is accepted where the file accepts its kind.
    pub fn add(&mut self, kind: Kind, finding: Finding) {
        let reason = match accepted_by(kind) {
            Some("accept_unstable") => self.accept_unstable.clone(),
            Some(_) => self.accept_trip.clone(),
            None => None,
        };
        let accepted = reason.filter(|_| finding.severity == Severity::Error);
        self.findings.push(Judgement {
            kind,
            finding,
            accepted,
        });
    }

    /// What follows from it.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        let errors = |open: bool| {
            let errors = self.findings.iter();
            let mut errors = errors.filter(|one| one.finding.severity == Severity::Error);
            errors.any(|one| one.is_open() == open)
        };
        match (errors(true), errors(false), self.behind_link) {
            (true, _, true) => Outcome::Refused,
            (true, _, false) => Outcome::Simulated,
            (false, true, _) => Outcome::Accepted,
            (false, false, _) => Outcome::Clear,
        }
    }

    /// True if no error is left that the user has not accepted: then `check` exits with 0.
    #[must_use]
    pub fn is_clear(&self) -> bool {
        matches!(self.outcome(), Outcome::Clear | Outcome::Accepted)
    }

    /// True if the test must not start.
    #[must_use]
    pub fn forbids(&self) -> bool {
        self.outcome() == Outcome::Refused
    }

    /// True if the loop is proven unstable, accepted or not.
    #[must_use]
    pub fn is_unstable(&self) -> bool {
        let mut errors = self.findings.iter();
        errors.any(|one| one.kind == Kind::Unstable && one.finding.severity == Severity::Error)
    }

    /// Findings with their places in the file. An error that forbids nothing is shown as a warning, unless `as_errors`.
    #[must_use]
    pub fn diagnostics(&self, loaded: &Loaded, as_errors: bool) -> Diagnostics {
        let errors = as_errors || self.forbids();
        loaded.diagnose(self.findings.iter().map(|one| one.shown(errors)))
    }

    /// The reason for each accepted kind of finding, by its key of `[safety]`.
    #[must_use]
    pub fn accepted(&self) -> BTreeMap<String, String> {
        let accepted = self.findings.iter().filter_map(|one| {
            let key = accepted_by(one.kind)?;
            Some((key.to_owned(), one.accepted.clone()?))
        });
        accepted.collect()
    }

    /// Keys of `[safety]` that would accept the errors that are open, each once.
    pub fn open_keys(&self) -> impl Iterator<Item = &'static str> {
        let open = |key: &&str| {
            let mut findings = self.findings.iter().filter(|one| one.is_open());
            findings.any(|one| accepted_by(one.kind) == Some(key))
        };
        ["accept_unstable", "accept_trip"].into_iter().filter(open)
    }

    /// Every finding in one line, for summaries and logs.
    pub fn headlines(&self) -> impl Iterator<Item = &str> {
        self.findings
            .iter()
            .map(|one| one.finding.headline.as_str())
    }

    /// The form for `summary.json` and `check --json`.
    #[must_use]
    pub fn record(&self) -> RecordedVerdict {
        let findings = self.findings.iter().map(|one| RecordedFinding {
            kind: one.kind,
            severity: match (&one.accepted, one.finding.severity) {
                (Some(_), _) => "accepted",
                (None, Severity::Error) => "error",
                (None, Severity::Warning) => "warning",
            }
            .to_owned(),
            key: one.finding.path.to_string(),
            text: one.finding.headline.clone(),
            numbers: (one.finding.numbers.iter())
                .map(|(name, value)| ((*name).to_owned(), value.is_finite().then_some(*value)))
                .collect(),
            help: one.finding.help.clone(),
        });
        RecordedVerdict {
            outcome: self.outcome(),
            unstable: self.is_unstable(),
            behind_link: self.behind_link,
            findings: findings.collect(),
        }
    }
}

/// The reason for which an unstable loop is accepted. The older key gives none.
fn accepts_unstable(safety: &SafetyTable, allow_unstable_lambda: bool) -> Option<String> {
    let older = || "allow_unstable_lambda = true in [integrator]".to_owned();
    let given = safety.accept_unstable.clone();
    given.or_else(|| allow_unstable_lambda.then(older))
}

/// A warning for each machine behind a link whose actuator is not declared: its delay is not known.
fn unknown_actuators(loaded: &Loaded, facts: &Facts) -> Vec<Finding> {
    if facts.structure.is_none() || facts.clock != ClockChoice::Real {
        return Vec::new();
    }
    let tables = loaded.file.specimen.iter().enumerate();
    let unknown = tables.filter_map(|(index, table)| {
        let link = table.link.as_ref()?;
        let is_known = link.computed || table.believed_transfer(1.0).is_some();
        (!is_known).then(|| {
            let at = KeyPath::root().key("specimen").index(index).key("link");
            let text = format!(
                "the delay of specimen \"{}\" is not known, so the stability of the loop with it is not known",
                table.name
            );
            let measure = if table.force_only_link().is_some() {
                "its link answers with forces only, so `gusset identify` cannot measure the delay: state `delay_s` in \
                 [specimen.identified] as the laboratory measured it"
            } else {
                "`gusset identify` measures the delay; write it into [specimen.identified]"
            };
            Finding::warning(at, text)
                .at_key()
                .label("no `identified` and no actuator is declared")
                .help(format!(
                    "{measure}. `computed = true` in [specimen.link] declares a computed specimen without an actuator"
                ))
        })
    });
    unknown.collect()
}
