//! Checks of a certificate: ranges, and numbers that are missing.

use super::Findings;
use super::numbers::{NUMBERS_OF_CERTIFICATE, NUMBERS_OF_UNCERTAINTY};
use crate::certificate::{UncertaintyTable, current_key, number_at};
use crate::diagnose::Finding;
use crate::document::{KeyPath, Segment};
use crate::schema::TestFile;
use crate::suggest::nearest;

/// Tables whose numbers may be uncertain.
const UNCERTAIN: [&str; 3] = ["structure", "excitation", "specimen"];

/// The spreads in `identified` of the specimen at `at`.
pub(super) fn check_known(at: &KeyPath, findings: &mut Findings) {
    let at = at.key("identified");
    for (key, of) in [
        ("delay_std_s", "delay_s"),
        ("gain_std", "gain"),
        ("stiffness_std_n_per_m", "stiffness_n_per_m"),
    ] {
        let has = |key: &str| findings.value(&at.key(key)).is_some();
        if has(key) && !has(of) {
            let headline = format!("`{key}` is the spread of `{of}`, which is missing");
            let finding = Finding::error(at.key(key), headline).at_key();
            findings.push(finding.label("of what?"));
        }
    }
}

/// `[certificate]` and `[[uncertainty]]`.
pub(super) fn check_certificate(file: &TestFile, findings: &mut Findings) {
    findings.numbers(&KeyPath::root().key("certificate"), NUMBERS_OF_CERTIFICATE);
    if file.uncertainty.is_empty() {
        return;
    }
    let complete = findings.values.clone();
    let mut known: Vec<KeyPath> = Vec::new();
    for (index, one) in file.uncertainty.iter().enumerate() {
        let at = KeyPath::root().key("uncertainty").index(index);
        let why = "it is the spread of the number in the test file";
        findings.exactly_one(&at, &["std", "std_share", "range"], why);
        findings.numbers(&at, NUMBERS_OF_UNCERTAINTY);
        if let Some([low, high]) = one.range
            && low.is_finite()
            && high.is_finite()
            && low >= high
        {
            let headline = format!("`range` is from {low} to {high}");
            let finding = Finding::error(at.key("range"), headline);
            findings.push(finding.label("the smaller number comes first"));
        }
        let at = at.key("key");
        let path = match KeyPath::parse(&one.key) {
            Ok(path) => current_key(&complete, path),
            Err(error) => {
                let headline = format!("{:?} is no dotted path: {}", one.key, error.message);
                findings.push(Finding::error(at, headline));
                known.push(KeyPath::root());
                continue;
            }
        };
        if let Some(first) = known.iter().position(|other| *other == path) {
            let headline = format!("`{path}` has two uncertainties");
            let finding = Finding::error(at, headline);
            let label = format!("`uncertainty[{first}]` would have no effect");
            findings.push(finding.label(label));
            known.push(path);
            continue;
        }
        known.push(path.clone());
        let root = match path.segments().first() {
            Some(Segment::Key(key)) => key.as_str(),
            _ => "",
        };
        if !UNCERTAIN.contains(&root) {
            let headline = format!("`{path}` cannot be uncertain");
            let finding = Finding::error(at, headline);
            findings.push(finding.label(
                "only keys below structure, excitation and specimen can be uncertain: all others are decisions of the user",
            ));
            continue;
        }
        let found = number_at(&complete, &path);
        if let Ok(number) = found {
            spread(one, &path, number.value(), index, findings);
            if let Some((why, instead)) = unfelt(file, &path) {
                let headline = format!("`{path}` has no effect on the trials of a certificate");
                let finding = Finding::error(at.clone(), headline).label(why);
                findings.push(finding.help(instead));
            }
        }
        if let Err((known, keys)) = found {
            let is_there = known == path;
            let headline = if is_there {
                format!("`{path}` is not a number")
            } else {
                format!("this test has no `{path}`")
            };
            let finding = Finding::error(at, headline).label(if is_there {
                "an uncertainty must name one number".to_owned()
            } else {
                format!("`{known}` has no such entry")
            });
            let missing = path.segments().get(known.segments().len());
            let meant = match missing {
                Some(Segment::Key(key)) => nearest(key, &keys),
                _ => None,
            };
            findings.push(match meant {
                Some(meant) => finding.help(format!("did you mean `{}`?", known.key(meant))),
                None if is_there => finding,
                None => finding.help("write the number into the test file: a default cannot vary"),
            });
        }
    }
}

/// Everything that is wrong with the `samples` of a study of the test `file`. The paths begin with `sample`.
pub(crate) fn check_samples(file: &TestFile, samples: &[UncertaintyTable]) -> Vec<Finding> {
    let mut with = file.clone();
    with.uncertainty = samples.to_vec();
    let mut findings = Findings::of(&with);
    check_certificate(&with, &mut findings);
    let of_uncertainty = KeyPath::root().key("uncertainty");
    let findings = findings.list.into_iter();
    let mut findings: Vec<Finding> = findings
        .filter(|finding| finding.path.starts_with(&of_uncertainty))
        .collect();
    for finding in &mut findings {
        let deeper = finding.path.segments().iter().skip(1).cloned();
        finding.path = std::iter::once(Segment::Key("sample".to_owned()))
            .chain(deeper)
            .collect();
    }
    findings
}

/// Why a number affects no trial, and what to vary instead; `None` for one that has an effect.
fn unfelt(file: &TestFile, path: &KeyPath) -> Option<(&'static str, &'static str)> {
    let segments = path.segments();
    let key = |place: usize| match segments.get(place) {
        Some(Segment::Key(key)) => key.as_str(),
        _ => "",
    };
    let of_proof = (
        "a bound for the proof of stability, which trials do not use",
        "vary the parameters of the law",
    );
    let last = key(segments.len().saturating_sub(1));
    if last == "hardening_ratio" || (key(0) == "structure" && last.starts_with("reach_")) {
        return Some(of_proof);
    }
    if key(0) == "bus" {
        return Some(("trials use no bus", "vary a property of the specimen"));
    }
    let Some(Segment::Index(index)) = segments.get(1) else {
        return None;
    };
    let table = file.specimen.get(*index).filter(|_| key(0) == "specimen")?;
    let is_remote = table.link.is_some();
    let has_law = table.source().is_some();
    let of_law = if has_law {
        "vary a parameter of its law"
    } else {
        "vary `stiffness_n_per_m`, a parameter of its stand-in `law`, or set `identified.stiffness_std_n_per_m`"
    };
    match (key(2), key(3)) {
        ("stiffness_n_per_m" | "damping_n_s_per_m", _) => {
            has_law.then_some((
                "this is an estimate of the controller, not a property of the specimen: it is the same in every trial",
                of_law,
            ))
        }
        ("hardening_bound" | "reach_disp_m" | "reach_vel_m_per_s", _) => Some((of_proof.0, of_law)),
        ("capacity", _) => Some((
            "a capacity of the rig, with which trials are compared",
            "for an uncertain rig give the smallest capacity",
        )),
        ("link" | "bus", which) if which != "stands_at_m" => {
            Some(("trials use no link", of_law))
        }
        ("drill", _) => Some(("trials have no fault injection", of_law)),
        ("identified", "stiffness_n_per_m") => Some(("trials do not use it", of_law)),
        ("identified", of) if of.contains("_std") => {
            Some(("a spread, from which trials draw", "give the largest spread"))
        }
        ("identified", _) if !is_remote => {
            Some(("a simulated law has its own actuator", "vary a parameter of its `transfer`"))
        }
        ("identified", _) if table.transfer.is_some() => Some((
            "its stand-in has the actuator of `transfer`",
            "vary a parameter of its `transfer`",
        )),
        _ => None,
    }
}

/// A spread of zero, or one that excludes the file's number.
fn spread(
    one: &UncertaintyTable,
    path: &KeyPath,
    nominal: f64,
    index: usize,
    findings: &mut Findings,
) {
    let at = KeyPath::root().key("uncertainty").index(index);
    if one.std_share.is_some() && nominal == 0.0 {
        let headline = format!("`{path}` is 0, so a relative spread has no effect");
        let finding = Finding::error(at.key("std_share"), headline);
        findings.push(finding.label("give the spread as `std`, in the unit of the number"));
    }
    if let Some([low, high]) = one.range
        && low < high
        && !(low..=high).contains(&nominal)
    {
        let headline = format!("`{path}` is {nominal}, and `range` is from {low} to {high}");
        let finding = Finding::error(at.key("range"), headline);
        findings.push(finding.label("the number of the file is outside this range"));
    }
}
