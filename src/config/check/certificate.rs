//! Checks of a certificate: ranges, and numbers that are missing.

use super::Findings;
use crate::certificate::{UncertaintyTable, current_key, number_at};
use crate::diagnose::Finding;
use crate::document::{KeyPath, Segment};
use crate::schema::TestFile;
use crate::specimen::SpecimenTable;
use crate::suggest::nearest;

/// Tables whose numbers may be uncertain.
const UNCERTAIN: [&str; 3] = ["structure", "excitation", "specimen"];

/// `identified` and `capacity` of one specimen.
pub(super) fn check_known(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    if let Some(identified) = &specimen.identified {
        let at = at.key("identified");
        let entries = identified.entries();
        for (key, value, of) in entries {
            let Some(found) = value else { continue };
            if of.is_none() && matches!(key, "gain" | "stiffness_n_per_m") {
                findings.positive(at.key(key), Some(found));
            } else if found < 0.0 {
                let headline = format!("`{}` is {found}, but must be 0 or greater", at.key(key));
                findings
                    .0
                    .push(Finding::error(at.key(key), headline).label("negative"));
            }
            let missing = |of: &&str| {
                let mut others = entries.iter();
                others.any(|(other, value, _)| other == of && value.is_none())
            };
            if let Some(of) = of.filter(missing) {
                let headline = format!("`{key}` is the spread of `{of}`, which is missing");
                let finding = Finding::error(at.key(key), headline).at_key();
                findings.0.push(finding.label("of what?"));
            }
        }
    }
    if let Some(capacity) = &specimen.capacity {
        for (key, _, value) in capacity.entries() {
            findings.positive(at.key("capacity").key(key), value);
        }
    }
}

/// `[certificate]` and `[[uncertainty]]`.
pub(super) fn check_certificate(file: &TestFile, findings: &mut Findings) {
    let at = KeyPath::root().key("certificate");
    let table = &file.certificate;
    if table.trials == 0 {
        let finding = Finding::error(
            at.key("trials"),
            "`certificate.trials` must be 1 or greater",
        );
        findings.0.push(finding.label("found 0"));
    }
    let probability = table.trip_probability;
    if probability.is_finite() && !(probability > 0.0 && probability <= 1.0) {
        let headline = format!(
            "`certificate.trip_probability` is {probability}, but must be greater than 0 and at most 1"
        );
        let finding = Finding::error(at.key("trip_probability"), headline).label("a probability");
        findings
            .0
            .push(finding.help("a finite number of trials cannot show a probability of 0"));
    }
    findings.positive(at.key("tracking_error"), Some(table.tracking_error));
    findings.positive(at.key("response_error"), Some(table.response_error));
    if file.uncertainty.is_empty() {
        return;
    }
    let complete = toml::Value::try_from(file).ok();
    let mut known: Vec<KeyPath> = Vec::new();
    for (index, one) in file.uncertainty.iter().enumerate() {
        let at = KeyPath::root().key("uncertainty").index(index);
        let given: Vec<_> = [
            ("std", one.std.is_some()),
            ("std_share", one.std_share.is_some()),
            ("range", one.range.is_some()),
        ]
        .into_iter()
        .filter_map(|(key, given)| given.then_some(key))
        .collect();
        let why = "it is the spread of the number in the test file";
        findings.exactly_one(&at, &given, &["std", "std_share", "range"], why);
        findings.positive(at.key("std"), one.std);
        findings.positive(at.key("std_share"), one.std_share);
        if let Some([low, high]) = one.range
            && low.is_finite()
            && high.is_finite()
            && low >= high
        {
            let headline = format!("`range` is from {low} to {high}");
            let finding = Finding::error(at.key("range"), headline);
            findings
                .0
                .push(finding.label("the smaller number comes first"));
        }
        let at = at.key("key");
        let path = match KeyPath::parse(&one.key) {
            Ok(path) => match &complete {
                Some(complete) => current_key(complete, path),
                None => path,
            },
            Err(error) => {
                let headline = format!("{:?} is no dotted path: {}", one.key, error.message);
                findings.0.push(Finding::error(at, headline));
                known.push(KeyPath::root());
                continue;
            }
        };
        if let Some(first) = known.iter().position(|other| *other == path) {
            let headline = format!("`{path}` has two uncertainties");
            let finding = Finding::error(at, headline);
            let label = format!("`uncertainty[{first}]` would have no effect");
            findings.0.push(finding.label(label));
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
            findings.0.push(finding.label(
                "only keys below structure, excitation and specimen can be uncertain: all others are decisions of the user",
            ));
            continue;
        }
        let Some(complete) = &complete else { continue };
        let found = number_at(complete, &path);
        if let Ok(number) = found {
            spread(one, &path, number.value(), index, findings);
            if let Some((why, instead)) = unfelt(file, &path) {
                let headline = format!("`{path}` has no effect on the trials of a certificate");
                let finding = Finding::error(at.clone(), headline).label(why);
                findings.0.push(finding.help(instead));
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
            findings.0.push(match meant {
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
    let mut findings = Findings(Vec::new());
    check_certificate(&with, &mut findings);
    let of_uncertainty = KeyPath::root().key("uncertainty");
    let findings = findings.0.into_iter();
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
    let Some(Segment::Index(index)) = segments.get(1) else {
        return None;
    };
    let table = file.specimen.get(*index).filter(|_| key(0) == "specimen")?;
    let is_remote = table.link.is_some();
    let has_law = !table.sources().is_empty();
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
        ("link", which) if which != "stands_at_m" => {
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
        findings
            .0
            .push(finding.label("give the spread as `std`, in the unit of the number"));
    }
    if let Some([low, high]) = one.range
        && low < high
        && !(low..=high).contains(&nominal)
    {
        let headline = format!("`{path}` is {nominal}, and `range` is from {low} to {high}");
        let finding = Finding::error(at.key("range"), headline);
        findings
            .0
            .push(finding.label("the number of the file is outside this range"));
    }
}
