//! Errors of a test: those of its method and of its actuators, and the damping that the actuators add to each mode.

use nalgebra::Complex;
use serde::{Deserialize, Serialize};

use super::analysis::{Analysis, Attached};
use super::case::Case;
use super::kind::Kind;
use gusset_quantity::finding::{Finding, KeyPath};
use gusset_quantity::units::number;

/// Share of the damping of a mode that the actuators may take before a finding.
const LOST: f64 = 0.5;
/// Damping that the actuators may take from a mode without damping before a finding.
const TAKEN: f64 = 5e-4;
/// A smaller damping ratio counts as none.
const UNDAMPED: f64 = 1e-6;
/// Share of the added damping that its first order may be off.
const ROUNDING: f64 = 0.02;

/// Errors of a test with a structure: `verdict.errors` of `summary.json` and of `check --json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Error of the integration method, against Newmark's average acceleration with iteration. Specimens are ideal in both.
    pub method: TestError,
    /// Error of the coupling: the rehearsed test against the test with ideal specimens, by the method of the test.
    pub coupling: TestError,
    /// Error of the reduction of the structure, against the full model by the reference of the method. Null without a reduction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduction: Option<TestError>,
    /// Damping that the actuators add to each mode. Empty without actuators.
    pub modes: Vec<AddedDamping>,
    /// Error of a largest drift from which it is a finding, as a share.
    pub warn: f64,
    /// Error of a largest drift from which it is an error, as a share.
    pub refuse: f64,
}

/// One error of a test. Shares are of the reference.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TestError {
    /// Why the error is not known. Null where it is known.
    pub not_known: Option<String>,
    /// Largest error of a largest drift, as a share of this drift.
    pub drift: Option<f64>,
    /// Storey, specimen or DOF with this error.
    pub direction: Option<String>,
    /// Largest root mean square of the difference of a drift, as a share of that of the drift.
    pub nrmse: Option<f64>,
    /// Error of the input energy, as a share. Null with a base displacement.
    pub energy: Option<f64>,
    /// Energy that the tracking errors of the actuators add, as a share of the input energy. Null for the method.
    pub added_energy: Option<f64>,
    /// Every storey, specimen or DOF that moves, the largest error first.
    pub directions: Vec<DriftError>,
}

/// Error of one storey, specimen or DOF.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DriftError {
    /// Its name.
    pub name: String,
    /// Unit of its drifts: m or rad.
    pub unit: String,
    /// Largest drift in the test, from the position under a static load; after the initial state of a free vibration.
    pub largest: f64,
    /// Largest drift in the reference, counted in that way, too.
    pub reference: f64,
    /// Difference of the two, as a share of the reference.
    pub error: f64,
    /// Root mean square of the difference, as a share of that of the reference.
    pub nrmse: f64,
}

/// A mode with the damping that the actuators add.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AddedDamping {
    /// Natural frequency in rad/s.
    pub frequency_rad_per_s: f64,
    /// Damping ratio without actuators.
    pub damping_ratio: f64,
    /// Damping ratio that the actuators add. Null where a compensation adapts or feeds back.
    pub added_ratio: Option<f64>,
}

impl TestError {
    /// An error that is not known.
    #[must_use]
    pub fn not_known(why: impl Into<String>) -> Self {
        Self {
            not_known: Some(why.into()),
            ..Self::default()
        }
    }

    /// Zero errors.
    #[must_use]
    pub fn none() -> Self {
        Self {
            drift: Some(0.0),
            nrmse: Some(0.0),
            energy: Some(0.0),
            ..Self::default()
        }
    }

    /// True if it is known and at most `limit`.
    #[must_use]
    pub fn is_below(&self, limit: f64) -> bool {
        self.not_known.is_none() && self.drift.is_some_and(|drift| drift <= limit)
    }

    /// In words.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = self.in_short(" of the largest drift");
        if self.drift.is_none() || self.directions.is_empty() {
            return text;
        }
        let rest = [
            ("NRMSE", self.nrmse),
            ("input energy", self.energy),
            ("energy added by the actuators", self.added_energy),
        ];
        for (name, share) in rest {
            if let Some(share) = share {
                text.push_str(&format!(", {name} {}", per_cent(share)));
            }
        }
        text
    }

    /// Its size, `of` what, and where; or why it is not known.
    fn in_short(&self, of: &str) -> String {
        match (&self.not_known, self.drift) {
            (Some(why), _) => format!("not known: {why}"),
            (None, None) => "not known".to_owned(),
            (None, Some(_)) if self.directions.is_empty() => "none".to_owned(),
            (None, Some(drift)) => {
                let place = self.direction.as_deref().unwrap_or("structure");
                format!("{}{of} ({place})", per_cent(drift))
            }
        }
    }
}

/// A share in per cent.
#[must_use]
pub fn per_cent(share: f64) -> String {
    let value = 100.0 * share;
    match value.abs() {
        size if size < 0.01 => "< 0.01 %".to_owned(),
        size if size < 1.0 => format!("{value:.2} %"),
        size if size < 10.0 => format!("{value:.1} %"),
        size if size < 1e6 => format!("{value:.0} %"),
        _ => format!("{} %", number(value)),
    }
}

impl AddedDamping {
    /// True if much of its damping is taken.
    fn is_taken(&self) -> bool {
        let own = self.damping_ratio;
        let limit = if own > UNDAMPED { -LOST * own } else { -TAKEN };
        self.added_ratio.is_some_and(|added| added < limit)
    }

    /// Remaining damping. A share of the damping without actuators, where there is some.
    fn left(&self) -> f64 {
        let added = self.added_ratio.unwrap_or(f64::INFINITY);
        if self.damping_ratio > UNDAMPED {
            1.0 + added / self.damping_ratio
        } else {
            1.0 + LOST * added / TAKEN
        }
    }

    /// The finding on this mode, from 0; none if the actuators take little of its damping. `may_grow`: the loop is proven neither
    /// stable nor unstable.
    fn finding(&self, mode: usize, may_grow: bool) -> Option<Finding> {
        let added = self.added_ratio.filter(|_| self.is_taken())?;
        let own = self.damping_ratio;
        let has_damping = own > UNDAMPED;
        let at = KeyPath::root().key("specimen").index(0);
        let text = format!(
            "the actuators add {} of damping to mode {} ({} Hz), which has {}: {} is left",
            ratio(added),
            mode + 1,
            number(self.frequency_rad_per_s / std::f64::consts::TAU),
            ratio(own),
            ratio(own + added),
        );
        let grows = has_damping && own + added < -ROUNDING * added.abs();
        let finding = if grows && may_grow {
            Finding::error(at, text)
        } else {
            Finding::warning(at, text)
        };
        let finding = finding
            .number("damping_ratio", own)
            .number("added_ratio", added)
            .number("frequency_rad_per_s", self.frequency_rad_per_s);
        Some(
            finding
                .help("compensate the lag with [specimen.compensation], or use a faster actuator"),
        )
    }
}

/// A damping ratio in per cent.
fn ratio(value: f64) -> String {
    format!("{} %", number(100.0 * value))
}

impl Errors {
    /// Errors that are not known, with these limits for a finding and for an error.
    #[must_use]
    pub fn not_known(why: &str, [warn, refuse]: [f64; 2]) -> Self {
        Self {
            method: TestError::not_known(why),
            coupling: TestError::not_known(why),
            reduction: None,
            modes: Vec::new(),
            warn,
            refuse,
        }
    }

    /// True if the actuators take much damping from a mode.
    #[must_use]
    pub fn take_damping(&self) -> bool {
        self.modes.iter().any(AddedDamping::is_taken)
    }

    /// The mode from which the actuators take most of its damping, in words; none without actuators.
    #[must_use]
    pub fn of_modes(&self) -> Option<String> {
        let known = self.modes.iter().enumerate();
        let known = known.filter_map(|(index, mode)| Some((index, mode, mode.added_ratio?)));
        let worst = known.min_by(|a, b| a.1.left().total_cmp(&b.1.left()));
        let Some((index, mode, added)) = worst else {
            let unknown = !self.modes.is_empty();
            return unknown.then(|| {
                "damping that the actuators add: not known, a compensation adapts or feeds back"
                    .to_owned()
            });
        };
        Some(format!(
            "the actuators add {} of damping to mode {}, which has {}",
            ratio(added),
            index + 1,
            ratio(mode.damping_ratio)
        ))
    }

    /// True if `error` is known and is no finding: its largest drift is at most `warn`, its NRMSE at most `refuse`.
    #[must_use]
    pub fn is_small(&self, error: &TestError) -> bool {
        error.is_below(self.warn) && error.nrmse.is_none_or(|nrmse| nrmse <= self.refuse)
    }

    /// All errors in one row.
    #[must_use]
    pub fn words(&self) -> String {
        let [method, coupling] = [&self.method, &self.coupling].map(|error| error.in_short(""));
        let mut text = format!("largest drift: method {method}; coupling {coupling}");
        if self.method.not_known.is_some() && method == coupling {
            text = method;
        }
        if let Some(reduction) = &self.reduction {
            text.push_str(&format!("; reduction {}", reduction.in_short("")));
        }
        text
    }

    /// All errors with their names.
    pub fn each(&self) -> impl Iterator<Item = (&'static str, &TestError)> {
        let both = [("method", &self.method), ("coupling", &self.coupling)];
        let reduction = self.reduction.iter().map(|error| ("reduction", error));
        both.into_iter().chain(reduction)
    }

    /// The findings on these errors. `is_stable`: the loop is proven stable, or unstable. An unstable loop is an error by itself:
    /// what its actuators do is then a warning. So is what the method does, if `method_grows`.
    #[must_use]
    pub fn findings(&self, is_stable: Option<bool>, method_grows: bool) -> Vec<(Kind, Finding)> {
        let mut findings = Vec::new();
        let root = KeyPath::root();
        let places = [
            root.key("integrator"),
            root.key("specimen").index(0),
            root.key("structure").key("reduce"),
        ];
        let helps = [
            "reduce the error with a shorter step, a smaller `lambda`, or a smaller reference damping",
            "compensate the lag, use a faster actuator, or run the test at its own velocities",
            "reduce the error with more `modes`, or `keep` more DOFs",
        ];
        for (((name, error), at), help) in self.each().zip(places).zip(helps) {
            if let Some(why) = &error.not_known {
                let text = format!("the error of the {name} is not known: {why}");
                findings.push((Kind::Unknown, Finding::warning(at, text)));
                continue;
            }
            let (Some(drift), Some(worst)) = (error.drift, error.directions.first()) else {
                continue;
            };
            if self.is_small(error) {
                continue;
            }
            let text = format!("the error of the {name} is {}", error.words());
            let follows = match name {
                "method" => method_grows,
                "reduction" => false,
                _ => is_stable == Some(false),
            };
            let finding = if drift > self.refuse && !follows {
                Finding::error(at, text)
            } else {
                Finding::warning(at, text)
            };
            let finding = finding
                .number("drift_error", drift)
                .number("largest", worst.largest)
                .number("reference", worst.reference);
            findings.push((Kind::Error, finding.help(help)));
        }
        let modes = self.modes.iter().enumerate();
        let of_modes = modes.filter_map(|(index, mode)| mode.finding(index, is_stable.is_none()));
        findings.extend(of_modes.map(|finding| (Kind::Error, finding)));
        findings
    }
}

/// Damping that the declared actuators add to each mode, to the first order: Im φᵀ Bᵀ Z (H − 1) B φ/(2 ω²), Z being the dynamic
/// stiffness of a specimen. `pace`: test time that passes in one second. Empty without declared actuators, and for a structure
/// that is too large.
#[must_use]
pub fn added_damping(case: &Case<'_>, pace: f64) -> Vec<AddedDamping> {
    let Some(analysis) = case.analysis else {
        return Vec::new();
    };
    let pairs = analysis.loops.iter().zip(&analysis.specimens);
    let actuated: Vec<_> = (pairs.zip(&case.actuators))
        .filter_map(|((one, specimen), actuator)| {
            Some((one, specimen, actuator.follows(case.tick)?))
        })
        .collect();
    if actuated.is_empty() {
        return Vec::new();
    }
    let each = analysis.shapes().into_iter();
    let each = each.filter(|(frequency, _)| *frequency > 0.0);
    each.map(|(omega, shape)| {
        let added = actuated.iter().map(|(one, specimen, follows)| {
            let respond = |axis: usize| follows.at(omega * pace, &one.system, axis);
            added_by(specimen, omega, &shape, respond)
        });
        AddedDamping {
            frequency_rad_per_s: omega,
            damping_ratio: own_damping(analysis, &shape) / (2.0 * omega),
            added_ratio: added.sum(),
        }
    })
    .collect()
}

fn own_damping(analysis: &Analysis, shape: &[f64]) -> f64 {
    analysis.at_rest.damping.quadratic(shape)
}

/// What one specimen adds to a mode; none if the response of an actuator is not known.
fn added_by(
    specimen: &Attached,
    omega: f64,
    shape: &[f64],
    respond: impl Fn(usize) -> Option<Complex<f64>>,
) -> Option<f64> {
    let moved =
        |row: &Vec<(usize, f64)>| -> f64 { row.iter().map(|(dof, b)| b * shape[*dof]).sum() };
    let moved: Vec<f64> = specimen.rows.iter().map(moved).collect();
    let mut work = Complex::new(0.0, 0.0);
    for (b, of_b) in moved.iter().enumerate() {
        let off = respond(b)? - 1.0;
        for (a, of_a) in moved.iter().enumerate() {
            let inertia = if a == b { specimen.mass_in_force } else { 0.0 };
            let stiffness = specimen.stiffness_at_rest[a][b] - omega * omega * inertia;
            let dynamic = Complex::new(stiffness, omega * specimen.damping_at_rest[a][b]);
            work += dynamic * off * (of_a * of_b);
        }
    }
    Some(work.im / (2.0 * omega * omega))
}
