//! Results of a prescribed displacement for its specimens: stiffness, damping and lag; and tracking metrics as data.

use maud::{Markup, html};

use super::RunView;
use super::axes::FIRST_LOADING;
use super::digest::{Digest, MISSING, NOT_MEASURED, WITHOUT_DISP};
use super::html::{note, table};
use super::text::{NOTHING, lag_words, number, or_dash, plural, quantity};
use super::tracked::{Tracked, tracking};
use gusset_motion::metrics::{Estimate, Tracking};
use gusset_record::COMMITS;
use gusset_record::summary::InOrder;

/// A share in percent; a negligible one is only called small.
fn small_percent(share: f64) -> String {
    if share < 1e-4 {
        "below 0.01".to_owned()
    } else {
        number(100.0 * share, 2)
    }
}

/// The number with its standard error, or why it is unknown.
#[must_use]
pub fn told(found: &Estimate, write: impl Fn(f64) -> String) -> String {
    let share = 100.0 * found.std / found.value.abs();
    if !found.is_sure() {
        return if found.is_of_this_motion {
            format!("{NOTHING} (the force is no line)")
        } else if share < 100.0 {
            format!("{NOTHING} (noise leaves ± {share:.0} %)")
        } else {
            format!("{NOTHING} (noise hides it)")
        };
    }
    if found.is_scattered() && found.is_of_this_motion {
        format!("{}, of this motion", write(found.value))
    } else if found.is_scattered() {
        format!("{} ± {}", write(found.value), write(found.std))
    } else {
        write(found.value)
    }
}

/// Results of a prescribed displacement for one axis, in words.
#[derive(Debug, Clone, PartialEq)]
pub struct IdentifiedAxis {
    /// Name of the specimen, and the axis where there are several.
    pub name: String,
    /// k̂ of the first loading, N/m: the value for K0.
    pub stiffness: Option<Estimate>,
    /// ĉ of the whole test, N s/m.
    pub damping: Option<Estimate>,
    /// Lag of the measured behind the target displacement, s.
    pub lag: Option<f64>,
}

/// Every axis of a test of prescribed displacement, identified; none for a test with a structure.
#[must_use]
pub fn identified(run: &RunView) -> Vec<IdentifiedAxis> {
    let digest = run.digested();
    let rows = &*digest;
    if !rows.dofs.is_empty() {
        return Vec::new();
    }
    let axes = tracking(run, rows);
    axes.into_iter()
        .map(|axis| {
            let (whole, initial) = (axis.digest.whole, axis.digest.initial);
            IdentifiedAxis {
                stiffness: initial.map(|found| found.stiffness),
                damping: whole.and_then(|found| found.damping),
                lag: axis.lag(),
                name: axis.name,
            }
        })
        .collect()
}

/// How each axis followed its target, in words; axes with too few rows are omitted.
#[must_use]
pub fn followed(run: &RunView) -> Vec<String> {
    let digest = run.digested();
    let rows = &*digest;
    let axes = tracking(run, rows).into_iter();
    let lines = axes.filter_map(|axis| {
        let found = axis.digest.tracking.as_ref()?;
        if axis.is_ideal() {
            return Some(format!("{}: {NOT_MEASURED}", axis.name));
        }
        let delay = axis.delay().map_or(NOTHING.to_owned(), lag_words);
        let amplitude = number(100.0 * axis.amplitude_error()?, 3);
        let rms = number(100.0 * found.nrmse.value, 3);
        let largest = quantity(found.peak_error_m.value, axis.disp_unit);
        Some(format!(
            "{}: delay {delay}, amplitude error {amplitude} %, RMS error {rms} %, largest error {largest}",
            axis.name
        ))
    });
    lines.collect()
}

/// Tracking metrics by specimen, one entry per axis in order, none where nothing moved: for `summary.json`.
#[must_use]
pub fn tracking_metrics(run: &RunView) -> InOrder<Vec<Option<Tracking>>> {
    let digest = run.digested();
    let mut all: Vec<(String, Vec<_>)> = Vec::new();
    for axis in &digest.axes {
        let name = run.test.file.specimen_name(axis.axis.specimen);
        match all.iter_mut().find(|(known, _)| *known == name) {
            Some((_, axes)) => axes.push(axis.tracking),
            None => all.push((name, vec![axis.tracking])),
        }
    }
    InOrder(all)
}

/// Why metrics of an axis are null though it may have moved, in words: for `summary.json`.
#[must_use]
pub fn missing_metrics(run: &RunView) -> Vec<String> {
    let digest = run.digested();
    let name = |axis| super::tested::axis_name(&run.test.file, axis, &digest.all_axes);
    let broken = digest.broken();
    let silent = digest.axes.iter().map(|axis| axis.axis);
    let silent = silent.filter(|axis| !digest.measures_disp(*axis));
    let silent = silent.map(|axis| format!("{}: {WITHOUT_DISP}", name(axis)));
    broken
        .filter(|axis| digest.measures_disp(*axis))
        .map(|axis| format!("{}: {MISSING}", name(axis)))
        .chain(silent)
        .collect()
}

/// For a test of prescribed displacement: identified stiffness, damping and lag of each axis.
pub(super) fn identification(rows: &Digest, axes: &[Tracked<'_>]) -> Option<Markup> {
    // A server does not know its controller's test.
    let is_served = rows.get(COMMITS).is_some();
    if axes.is_empty() || !rows.dofs.is_empty() || is_served {
        return None;
    }
    let mut lines = Vec::new();
    for axis in axes {
        let (whole, initial) = (axis.digest.whole, axis.digest.initial);
        let per = |unit: &str| format!("{}/{}", axis.force_unit, unit);
        let stiffness = |k: Estimate| told(&k, |k| quantity(k, &per(axis.disp_unit)));
        let damping = |c: Estimate| {
            told(&c, |c| {
                quantity(c, &format!("{} s/{}", axis.force_unit, axis.disp_unit))
            })
        };
        lines.push(vec![
            axis.name.clone(),
            or_dash(initial.map(|i| stiffness(i.stiffness))),
            or_dash(whole.map(|i| stiffness(i.stiffness))),
            or_dash(whole.and_then(|i| i.damping).map(damping)),
            or_dash(whole.map(|i| format!("{} %", small_percent(i.unexplained)))),
            or_dash(axis.lag().map(lag_words)),
        ]);
    }
    let markup = table(
        &[
            "",
            "k̂, first loading",
            "k̂, whole test",
            "ĉ, whole test",
            "not explained",
            "lag",
        ],
        &lines,
    );
    let how = format!(
        "Force by measured displacement and its velocity, {}, with the target as the instrument, so that noise of the sensors \
         leans neither; ± is a standard error, and a dash stands where that is not small beside the number. First loading: \
         until {:.0} % of the largest target is passed. Not explained: share of the force's variance that the line misses. Of this \
         motion: what it misses is no noise, as of a specimen that yields; then k̂ is a secant and ĉ an equivalent, and at another \
         amplitude or frequency both are others. This is the test before a hybrid test: k̂ and ĉ go into the specimen's \
         estimate (not an equivalent), the lag into its compensator.",
        plural(axes.len() as u64, "axis by itself", "axes each by itself"),
        100.0 * FIRST_LOADING
    );
    Some(rows.section("Identified specimen", html! { (markup) (note(&how)) }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_motion::metrics::identify;

    /// 5 mm at 1 Hz, whose force is cut off at `yields` of its peak.
    fn whole(yields: f64) -> [String; 2] {
        let dt = 1.0 / 512.0;
        let disp: Vec<f64> = (0..2048)
            .map(|i| 0.005 * libm::sin(std::f64::consts::TAU * f64::from(i) * dt))
            .collect();
        let bound = 0.005 * yields;
        let force: Vec<f64> = disp.iter().map(|d| 1e6 * d.clamp(-bound, bound)).collect();
        let found = identify(&disp, &disp, &force, dt).unwrap();
        [Some(found.stiffness), found.damping]
            .map(|found| told(&found.unwrap(), |value| format!("{value:.3e}")))
    }

    #[test]
    fn noise_free_misfit_has_no_standard_error() {
        assert_eq!(whole(1.0)[0], "1.000e6");
        let [stiffness, _] = whole(0.7);
        assert!(stiffness.ends_with("e5, of this motion"), "{stiffness}");
    }
}
