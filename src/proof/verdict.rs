//! The verdict of a test: its findings, and whether they forbid it.

use std::collections::BTreeMap;

use super::axes::not_proven;
use super::case::{Accepts, Case};
use super::errors::Errors;
use super::following::Following;
use super::integration::grows;
use super::kind::Kind;
use super::recorded::{Outcome, RecordedFinding, RecordedVerdict};
use super::together::together;
use gusset_quantity::finding::{Finding, KeyPath, Severity};

/// Key of `[safety]` that accepts an error of this kind.
const fn accepted_by(kind: Kind) -> Option<&'static str> {
    match kind {
        Kind::Unstable | Kind::Unproven => Some("accept_unstable"),
        Kind::Rehearsal => Some("accept_trip"),
        Kind::Speed => Some("accept_speed"),
        Kind::Unknown | Kind::Units => None,
        Kind::Error => Some("accept_error"),
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
    /// Errors of the test; none where they were not computed, and without a structure.
    pub errors: Option<Errors>,
    /// All findings, those of stability first.
    pub findings: Vec<Judgement>,
    accepts: Accepts,
}

impl Verdict {
    /// The verdict on the stability of a test. `following` is what is proven of its actuators. Findings of a rehearsal are
    /// [added](Self::add) later.
    #[must_use]
    pub fn of(case: &Case<'_>, following: &[Following]) -> Self {
        let linked = case
            .actuators
            .iter()
            .any(|actuator| actuator.link.is_some());
        let mut verdict = Self {
            errors: None,
            behind_link: linked && case.real_clock,
            findings: Vec::new(),
            accepts: case.accepts.clone(),
        };
        for (kind, finding) in case.doubts.iter().cloned() {
            verdict.add(kind, finding);
        }
        if let Some(why) = grows(case.analysis) {
            let at = KeyPath::root().key("structure");
            verdict.add(Kind::Unstable, Finding::error(at, why).at_key());
        }
        for (kind, finding) in following.iter().filter_map(Following::finding) {
            verdict.add(kind, finding);
        }
        if !verdict.is_unstable()
            && let Some((kind, finding)) = together(case)
        {
            verdict.add(kind, finding);
        }
        let unknown = not_proven(case).into_iter().chain(unknown_actuators(case));
        for finding in unknown {
            verdict.add(Kind::Unknown, finding);
        }
        verdict
    }

    /// The verdict on a specimen that a gateway serves: its findings are [added](Self::add).
    #[must_use]
    pub fn of_gateway(accepts: Accepts) -> Self {
        Self {
            behind_link: true,
            errors: None,
            findings: Vec::new(),
            accepts,
        }
    }

    /// One more finding; an error is accepted where the file accepts its kind.
    pub fn add(&mut self, kind: Kind, finding: Finding) {
        let reason = match accepted_by(kind) {
            Some("accept_unstable") => self.accepts.unstable.clone(),
            Some("accept_speed") => self.accepts.speed.clone(),
            Some("accept_error") => self.accepts.error.clone(),
            Some(_) => self.accepts.trip.clone(),
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
    pub(crate) fn outcome(&self) -> Outcome {
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

    /// Its findings as a user sees them. An error that forbids nothing is a warning, unless `as_errors`.
    pub fn shown(&self, as_errors: bool) -> impl Iterator<Item = Finding> + '_ {
        let errors = as_errors || self.forbids();
        self.findings.iter().map(move |one| one.shown(errors))
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
        let keys = [
            "accept_unstable",
            "accept_trip",
            "accept_speed",
            "accept_error",
        ];
        keys.into_iter().filter(open)
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
            errors: self.errors.clone(),
            findings: findings.collect(),
        }
    }
}

/// A warning for each machine behind a link whose actuator is not declared: its delay is not known.
fn unknown_actuators(case: &Case<'_>) -> Vec<Finding> {
    if !case.structure || !case.real_clock {
        return Vec::new();
    }
    let unknown = case.actuators.iter().filter_map(|actuator| {
        let machine = actuator.link?;
        (!actuator.is_known()).then(|| {
            let text = format!(
                "the delay of specimen \"{}\" is not known, so the stability of the loop with it is not known",
                actuator.name
            );
            let measure = if machine.forces_only {
                "its link answers with forces only, so `gusset identify` cannot measure the delay: state `delay_s` in \
                 [specimen.identified] as the laboratory measured it"
            } else {
                "`gusset identify` measures the delay; write it into [specimen.identified]"
            };
            Finding::warning(actuator.at("link"), text)
                .at_key()
                .label("no `identified` and no actuator is declared")
                .help(format!(
                    "{measure}. `computed = true` in [specimen.link] declares a computed specimen without an actuator"
                ))
        })
    });
    unknown.collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Actuator, Analysis, AtRest, Attached, Machine, Matrices};
    use super::*;
    use gusset_actuator::transfer::TransferSpec;
    use gusset_numerics::integrate::Lambda;
    use gusset_numerics::linalg::SymMatrix;

    const MASS: f64 = 1000.0;
    const DAMPING: f64 = 400.0;
    /// Stiffness of the specimen, and that of the whole.
    const STIFFNESS: [f64; 2] = [2e5, 3e5];

    fn analysis() -> Analysis {
        let one = |value: f64| SymMatrix::diagonal(&[value]);
        let matrices = Matrices {
            mass: one(MASS),
            at_rest: AtRest {
                stiffness: one(STIFFNESS[1]),
                damping: one(DAMPING),
            },
            stiffness: one(STIFFNESS[1]),
            damping: one(DAMPING),
            massless: Vec::new(),
        };
        let specimen = Attached {
            name: "it".to_owned(),
            rows: vec![vec![(0, 1.0)]],
            stiffness: vec![vec![STIFFNESS[0]]],
            stiffness_at_rest: vec![vec![STIFFNESS[0]]],
            damping: vec![vec![0.0]],
            damping_at_rest: vec![vec![0.0]],
            mass_in_force: 0.0,
            ticks: Vec::new(),
        };
        let step = Some((1e-3, Lambda::Finite(4.0)));
        Analysis::new(matrices, vec![specimen], step).unwrap()
    }

    /// A specimen behind a link with this delay, in s; none: its actuator is not known.
    fn case(analysis: &Analysis, delay_s: Option<f64>) -> Case<'_> {
        let transfer = |delay_s| TransferSpec {
            delay_s,
            ..TransferSpec::default()
        };
        Case {
            real_clock: true,
            dt: 1e-3,
            tick: 1e-5,
            structure: true,
            lambda: Some(4.0),
            analysis: Some(analysis),
            actuators: vec![Actuator {
                number: 0,
                name: "it".to_owned(),
                key: "identified",
                transfer: delay_s.map(transfer),
                compensation: None,
                delay_std_s: 0.0,
                link: Some(Machine {
                    computed: false,
                    forces_only: false,
                }),
            }],
            doubts: &[],
            accepts: Accepts::default(),
        }
    }

    fn verdict(case: &Case<'_>) -> Verdict {
        Verdict::of(case, &Following::of(case))
    }

    #[test]
    fn delay_beyond_critical_forbids_the_test() {
        let analysis = analysis();
        // The closed form of one degree of freedom.
        let critical = 0.002000400055997482;
        let below = verdict(&case(&analysis, Some(0.95 * critical)));
        assert_eq!(below.outcome(), Outcome::Clear, "{below:?}");
        let beyond = verdict(&case(&analysis, Some(1.05 * critical)));
        assert_eq!(beyond.outcome(), Outcome::Refused);
        assert!(beyond.is_unstable());
        let found = &beyond.findings[0].finding;
        assert_eq!(found.path.to_string(), "specimen[0].identified");
        let number = |name: &str| found.numbers.iter().find(|one| one.0 == name).unwrap().1;
        assert!((number("critical_delay_s") / critical - 1.0).abs() < 1e-6);
        assert_eq!(number("unstable_roots"), 2.0);
        // On the simulated clock nothing can break. The user may accept the finding.
        let simulated = Case {
            real_clock: false,
            ..case(&analysis, Some(1.05 * critical))
        };
        assert_eq!(verdict(&simulated).outcome(), Outcome::Simulated);
        let accepted = Case {
            accepts: Accepts {
                unstable: Some("a study".to_owned()),
                ..Accepts::default()
            },
            ..case(&analysis, Some(1.05 * critical))
        };
        assert_eq!(verdict(&accepted).outcome(), Outcome::Accepted);
    }

    #[test]
    fn unknown_remote_actuator_is_a_warning() {
        let analysis = analysis();
        let found = verdict(&case(&analysis, None));
        assert_eq!(found.outcome(), Outcome::Clear);
        let kinds: Vec<Kind> = found.findings.iter().map(|one| one.kind).collect();
        assert_eq!(kinds, [Kind::Unknown]);
        assert_eq!(
            found.findings[0].finding.path.to_string(),
            "specimen[0].link"
        );
    }
}
