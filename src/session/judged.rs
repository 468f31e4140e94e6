//! A test with its verdict: every command that moves a specimen obeys it before anything connects.

use super::rehearsal::{FullRehearsal, errors};
use gusset_config::{ConfigError, DIVERGENCE_M, KeyPath};
use gusset_proof::Kind;
use gusset_proof::{Following, Verdict, added_damping};
use gusset_setup::{self as setup, Prepared};

/// Least default of `safety.divergence_m` in m for a test that moves a specimen behind a link.
const LEAST_DIVERGENCE_M: f64 = 0.1;
/// That default as a multiple of the largest displacement of the rehearsal.
const TIMES_PEAK: f64 = 10.0;

/// A prepared test and its verdict.
#[derive(Debug)]
pub struct Judged {
    /// The test. With a specimen behind a link its divergence bound follows from the rehearsal.
    pub test: Prepared,
    /// May it move its specimens?
    pub verdict: Verdict,
    /// Proofs of the loop with its actuators.
    pub following: Vec<Following>,
    /// Its rehearsal, if there was one.
    pub rehearsed: Option<FullRehearsal>,
}

impl Judged {
    /// Judges a test. It is rehearsed if it moves a specimen behind a link on the real clock.
    ///
    /// # Errors
    /// The rehearsal cannot be built.
    pub fn of(test: Prepared) -> Result<Self, ConfigError> {
        let judged = Self::without_rehearsal(test);
        if judged.verdict.behind_link {
            judged.rehearsed()
        } else {
            Ok(judged)
        }
    }

    /// Judges the proofs of a test, without a rehearsal.
    #[must_use]
    pub fn without_rehearsal(mut test: Prepared) -> Self {
        let (following, verdict) = match test.case() {
            Some(case) => {
                let following = Following::of(&case);
                let verdict = Verdict::of(&case, &following);
                (following, verdict)
            }
            None => Default::default(),
        };
        let told = verdict.headlines().map(str::to_owned);
        test.facts.warnings.extend(told);
        let mut judged = Self {
            test,
            verdict,
            following,
            rehearsed: None,
        };
        judged.write_down();
        judged
    }

    /// Rehearses the test and adds the findings.
    ///
    /// # Errors
    /// The rehearsal cannot be built.
    pub fn rehearsed(self) -> Result<Self, ConfigError> {
        match &self.test.loaded {
            Some(loaded) if !self.test.facts.specimens.is_empty() => {
                let full = FullRehearsal::of(loaded)?;
                self.with(full).with_errors()
            }
            _ => self.with_errors(),
        }
    }

    /// Computes the errors of method and coupling, unless they are known, and adds their findings.
    ///
    /// # Errors
    /// The test with ideal specimens cannot be built.
    pub fn with_errors(mut self) -> Result<Self, ConfigError> {
        let (Some(loaded), Some(case), None) =
            (&self.test.loaded, self.test.case(), &self.verdict.errors)
        else {
            return Ok(self);
        };
        let facts = &self.test.facts;
        let pace = facts.dt * facts.rate_hz / f64::from(facts.ticks_per_step.max(1));
        let modes = added_damping(&case, pace);
        let mut unknown = case.actuators.iter().filter(|one| !one.is_known());
        let unknown = unknown.next().map(|one| one.name.as_str());
        let found = errors(loaded, facts.lambda(), modes, unknown)?;
        let proven = self
            .following
            .iter()
            .all(|one| one.of_stability().0 == Some(true));
        let is_stable = match self.verdict.is_unstable() {
            true => Some(false),
            false => proven.then_some(true),
        };
        let integrator = KeyPath::root().key("integrator");
        let method_grows = self
            .verdict
            .findings
            .iter()
            .any(|one| one.kind == Kind::Unstable && one.finding.path.starts_with(&integrator));
        let findings = found.iter();
        let findings = findings.flat_map(|errors| errors.findings(is_stable, method_grows));
        for (kind, finding) in findings.collect::<Vec<_>>() {
            self.test.facts.warnings.push(finding.headline.clone());
            self.verdict.add(kind, finding);
        }
        self.verdict.errors = found;
        self.write_down();
        Ok(self)
    }

    /// Adds the findings of a rehearsal of this test.
    #[must_use]
    pub fn with(mut self, full: FullRehearsal) -> Self {
        let found = full.findings.iter().map(|found| (Kind::Rehearsal, found));
        let unknown = full.unknown.iter().map(|found| (Kind::Unknown, found));
        let units = full.units.iter().map(|found| (Kind::Units, found));
        for (kind, finding) in found.chain(unknown).chain(units) {
            self.test.facts.warnings.push(finding.headline.clone());
            self.verdict.add(kind, finding.clone());
        }
        self.bound_divergence(&full);
        self.rehearsed = Some(full);
        self.write_down();
        self
    }

    /// Bounds the response of a test that moves a specimen behind a link by its rehearsal, unless its file gives a bound.
    fn bound_divergence(&mut self, full: &FullRehearsal) {
        let file = self.test.loaded.as_ref().map(|loaded| &loaded.file);
        let given = file.is_none_or(|file| file.safety.divergence_m.is_some());
        let trusted = self.verdict.behind_link
            && !self.verdict.is_unstable()
            && full.is_complete()
            && self.test.facts.structure.is_some();
        if given || !trusted {
            return;
        }
        let bound = TIMES_PEAK * full.rehearsal.peak_disp;
        let bound = bound.clamp(LEAST_DIVERGENCE_M, DIVERGENCE_M);
        if bound.is_finite() {
            setup::set_divergence(&mut self.test, bound);
        }
    }

    /// Passes the accepted findings to the summary.
    fn write_down(&mut self) {
        let accepted = self.verdict.accepted();
        self.test.facts.accepted.extend(accepted);
    }
}

impl From<Judged> for Subject {
    fn from(judged: Judged) -> Self {
        Self::Judged(Box::new(judged))
    }
}

impl From<Prepared> for Subject {
    fn from(test: Prepared) -> Self {
        Self::Prepared(Box::new(test))
    }
}

/// A test that is to run: judged already, or still to be judged.
#[derive(Debug)]
pub enum Subject {
    /// Its verdict is known.
    Judged(Box<Judged>),
    /// Its verdict is not known yet.
    Prepared(Box<Prepared>),
}

impl Subject {
    /// The test with its verdict.
    ///
    /// # Errors
    /// Its rehearsal cannot be built.
    pub(super) fn judged(self) -> Result<Judged, ConfigError> {
        match self {
            Self::Judged(judged) => Ok(*judged),
            Self::Prepared(test) => Judged::of(*test),
        }
    }
}
