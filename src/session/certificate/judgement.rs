//! The certificate of a test: go or no-go, with the reasons.
//!
//! Each line is a separate judgement: go, no-go, or not known. One no-go makes the certificate a no-go. A line that is not known
//! does not forbid the test, but it is shown.

use super::super::integration;
use super::super::judged::Judged;
use super::super::rehearsal::{AxisNeed, FullRehearsal, NEEDS};
use super::draw::Plan;
use super::proportion::interval;
use super::{Band, Rehearsed as Trial, Trials, carry_out};
use gusset_config::{ConfigError, Loaded, SpecimenTable, missing_limits};
use gusset_proof::is_stable;
use gusset_quantity::units::quantity;
use gusset_quantity::work::Work;
use gusset_setup::Facts;

/// One judgement.
#[derive(Debug)]
pub struct Line {
    /// None if it is not known.
    pub go: Option<bool>,
    /// Its subject.
    pub about: String,
    /// The result in words.
    pub text: String,
}

/// The certificate of a test.
#[derive(Debug)]
pub struct Certificate {
    /// Its judgements.
    pub lines: Vec<Line>,
    /// Reasons why GO is not established although no line is a no-go.
    pub missing: Vec<String>,
    /// The values that varied between the trials.
    pub varied: Vec<String>,
    /// The trials.
    pub trials: Trials,
    /// Their seed.
    pub seed: u64,
}

impl Certificate {
    /// Rehearses a test whose nominal rehearsal and verdict are known.
    ///
    /// # Errors
    /// As [`carry_out`].
    pub fn of(
        loaded: &Loaded,
        judged: &Judged,
        trials: Option<u64>,
        seed: Option<u64>,
    ) -> Result<Self, ConfigError> {
        let (facts, rehearsed) = (&judged.test.facts, judged.rehearsed.as_ref());
        let allowed = &loaded.file.certificate;
        let seed = seed.unwrap_or(allowed.seed);
        let asked = trials.unwrap_or_else(|| u64::from(allowed.trials));
        let plan = Plan::of(loaded, seed);
        // Identical trials show no more than one trial.
        let count = if plan.is_certain() { 1 } else { asked };
        let work = Work::begin("certificate", count);
        let trials = carry_out(loaded, &plan, facts.lambda(), count, &|done| {
            work.done(done)
        });
        drop(work);
        let trials = trials?;
        let mut lines = vec![of_integration(facts)];
        lines.extend(judged.following.iter().flat_map(|one| {
            [one.of_delay(), one.of_stability()].map(|(go, about, text)| Line { go, about, text })
        }));
        if let Some(rehearsed) = rehearsed {
            let words: Vec<&str> = rehearsed.errors().collect();
            lines.push(Line {
                go: Some(words.is_empty()),
                about: "limits, nominal test".to_owned(),
                text: if words.is_empty() {
                    "none is reached".to_owned()
                } else {
                    words.join(";\n")
                },
            });
        }
        for (index, table) in loaded.file.specimen.iter().enumerate() {
            lines.extend(of_capacity(index, table, rehearsed, &trials));
        }
        lines.extend(of_draws(&trials));
        lines.push(of_trips(
            &trials,
            allowed.trip_probability,
            plan.is_certain(),
        ));
        lines.extend(of_errors(loaded, facts, &trials));
        Ok(Self {
            missing: missing(loaded, judged, trials.all.len()),
            lines,
            varied: plan.words(loaded),
            trials,
            seed,
        })
    }

    /// True if no line forbids the test, and everything that a GO needs is known.
    #[must_use]
    pub fn is_go(&self) -> bool {
        self.missing.is_empty() && self.lines.iter().all(|line| line.go != Some(false))
    }

    /// Probability of a trip with 95 % confidence: its low and its high end.
    #[must_use]
    pub fn trip_probability(&self) -> (f64, f64) {
        interval(self.trials.trips(), self.trials.all.len() as u64)
    }
}

/// Trials that a GO needs at least.
const LEAST_TRIALS: usize = 100;

/// Reasons why GO cannot be established: too few trials, unknown limits or capacities of linked specimens, open or accepted
/// findings.
fn missing(loaded: &Loaded, judged: &Judged, trials: usize) -> Vec<String> {
    let mut missing = Vec::new();
    if trials == 1 {
        missing.push(
            "only one trial ran, because nothing is uncertain: add `[[uncertainty]]`, noise of a sensor or `identified`"
                .to_owned(),
        );
    } else if trials < LEAST_TRIALS {
        missing.push(format!(
            "{trials} of at least {LEAST_TRIALS} trials ran: run more with `--trials`"
        ));
    }
    for table in loaded.file.specimen.iter().filter(|s| s.link.is_some()) {
        let without = |key: &str| {
            let name = &table.name;
            format!("specimen \"{name}\" has no {key}")
        };
        let capacity = table.capacity.unwrap_or_default();
        let entries = capacity.entries();
        let unknown = entries.iter().filter(|(_, _, value)| value.is_none());
        missing.extend(unknown.map(|(key, ..)| without(&format!("`capacity.{key}`"))));
        let limits = missing_limits(table).into_iter();
        missing.extend(limits.map(|key| without(&format!("trip level of {key}"))));
    }
    if !judged.verdict.is_clear() {
        missing.push("the verdict has errors".to_owned());
    }
    let accepted = judged.verdict.accepted();
    missing.extend(
        accepted
            .keys()
            .map(|key| format!("`safety.{key}` accepts a finding")),
    );
    missing
}

fn of_integration(facts: &Facts) -> Line {
    let (go, text) = match &facts.structure {
        None => (Some(true), "no structure is integrated".to_owned()),
        Some(one) => (
            is_stable(&one.stability, one.analysis.as_ref()),
            integration::in_words(one),
        ),
    };
    Line {
        go,
        about: "integration".to_owned(),
        text,
    }
}

/// Stroke, velocity, force and power against the capacity of the rig, in the nominal test without limits and in 95 % of the
/// trials.
fn of_capacity(
    index: usize,
    table: &SpecimenTable,
    rehearsed: Option<&FullRehearsal>,
    trials: &Trials,
) -> Vec<Line> {
    let own = table.capacity.unwrap_or_default();
    let transfer = table.believed_transfer(1.0).unwrap_or_default();
    let axes = trials.all.first();
    let axes = axes
        .and_then(|one| one.needs.get(index))
        .map_or(0, Vec::len);
    let mut lines = Vec::new();
    for axis in 0..axes {
        for ((key, unit, most), (_, _, declared)) in NEEDS.into_iter().zip(own.entries()) {
            let of_transfer = match key {
                "stroke_m" => transfer.stroke_m,
                "force_n" => transfer.force_limit_n,
                "velocity_m_per_s" => transfer.rate_limit_m_per_s,
                _ => None,
            };
            let allowed = declared.or(of_transfer);
            let need = |one: &AxisNeed| most(one);
            let nominal = rehearsed.and_then(|full| full.need(index, axis)).map(need);
            let all = trials.all.iter();
            let found = all.filter_map(|one| Some(need(one.needs.get(index)?.get(axis)?)));
            let band = Band::of(&found.collect::<Vec<f64>>());
            let needed = [nominal, band.map(|band| band.high)];
            let needed = needed.into_iter().flatten().fold(0.0, f64::max);
            let shown = |value: Option<f64>| {
                value.map_or_else(|| "not known".to_owned(), |value| quantity(value, unit))
            };
            let text = format!(
                "{} in the nominal test, {} in 95 % of the trials, {}",
                shown(nominal),
                shown(band.map(|band| band.high)),
                match allowed {
                    Some(allowed) => format!(
                        "{} available: {:.0} % used",
                        quantity(allowed, unit),
                        100.0 * needed / allowed
                    ),
                    None => format!("no `capacity.{key}` is declared"),
                }
            );
            let word = key.split('_').next().unwrap_or(key);
            lines.push(Line {
                go: allowed.map(|allowed| needed <= allowed),
                about: format!("{word}, {} axis {}", table.name, axis + 1),
                text,
            });
        }
    }
    lines
}

/// Largest allowed share of draws that give no valid test.
const MOST_IMPOSSIBLE: f64 = 0.02;

/// Draws that gave no valid test: the trials then do not have the spread that the file declares.
fn of_draws(trials: &Trials) -> Option<Line> {
    let share = trials.impossible();
    (share > 0.0).then(|| Line {
        go: Some(share <= MOST_IMPOSSIBLE),
        about: "draws".to_owned(),
        text: format!(
            "{:.1} % of the draws gave no valid test and were replaced; {:.0} % allowed",
            100.0 * share,
            100.0 * MOST_IMPOSSIBLE
        ),
    })
}

fn of_trips(trials: &Trials, allowed: f64, certain: bool) -> Line {
    let (trips, count) = (trials.trips(), trials.all.len() as u64);
    let mut text = if certain {
        let all = "nothing is uncertain, so all trials are equal to this one";
        let end = if trips == 0 {
            "it was completed"
        } else {
            "it tripped"
        };
        format!("{all}: {end}")
    } else {
        let (low, high) = interval(trips, count);
        let text = format!(
            "{trips} of {count} trials; with 95 % confidence the probability is {:.1} to {:.1} %, {:.1} % allowed",
            // Rounded outwards, so that the printed interval is not narrower than the computed one.
            (1e3 * low).floor() / 10.0,
            (1e3 * high).ceil() / 10.0,
            100.0 * allowed
        );
        if trips == 0 && high > allowed {
            // (1 − p)ⁿ = 0.025.
            let needed = (libm::log(0.025) / libm::log1p(-allowed)).ceil();
            let needed = needed.max(LEAST_TRIALS as f64);
            format!(
                "{text};\nthese are too few trials for a verdict: {needed:.0} trials without a trip suffice"
            )
        } else {
            text
        }
    };
    let go = if certain {
        trips == 0
    } else {
        interval(trips, count).1 <= allowed
    };
    for (reason, times) in trials.reasons() {
        text.push_str(&format!(";\n{times} × {reason}"));
    }
    Line {
        go: Some(go),
        about: "probability of a trip".to_owned(),
        text,
    }
}

fn of_errors(loaded: &Loaded, facts: &Facts, trials: &Trials) -> Vec<Line> {
    let allowed = &loaded.file.certificate;
    let percent = |value: f64| format!("{:.2} %", 100.0 * value);
    let line = |about: String, band: Option<Band>, allowed: f64, none: &str| {
        let Some(band) = band else {
            return Line {
                go: None,
                about,
                text: none.to_owned(),
            };
        };
        let text = format!(
            "{} to {} between the 5th and the 95th percentile of the completed trials, median {}; {} allowed",
            percent(band.low),
            percent(band.high),
            percent(band.middle),
            percent(allowed)
        );
        Line {
            go: Some(band.high <= allowed),
            about,
            text,
        }
    };
    const NONE: &str = "no trial was completed";
    let mut lines = Vec::new();
    let mut place = 0;
    let first = trials.all.first();
    for (index, table) in loaded.file.specimen.iter().enumerate() {
        let axes = first
            .and_then(|one| one.needs.get(index))
            .map_or(0, Vec::len);
        for axis in 1..=axes {
            let band = trials.band(|one| one.errors.tracking.get(place).copied());
            let about = format!("tracking error, {} axis {axis}", table.name);
            lines.push(line(about, band, allowed.tracking_error, NONE));
            place += 1;
        }
    }
    if facts.structure.is_some() {
        let worst = |one: &Trial| one.errors.response;
        let band = trials.band(worst);
        let dof = trials.all.iter().max_by(|a, b| {
            let of = |one: &&Trial| worst(one).unwrap_or(0.0);
            of(a).total_cmp(&of(b))
        });
        let dof = dof.map_or(0, |one| one.errors.dof);
        let about = format!("response error, worst at DOF {}", dof + 1);
        lines.push(line(about, band, allowed.response_error, NONE));
    }
    lines
}
