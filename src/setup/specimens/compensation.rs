//! The compensators of a specimen, and the demands of a simulated actuator on the grid.

use super::super::{Refused, Site, path};
use gusset_actuator::compensation::{CompensationSpec, Compensator};
use gusset_config::steps::Time;
use gusset_config::{Finding, KeyPath, LimitsSpec, Method, SpecimenTable, TestFile};
use gusset_numerics::integrate::AlphaWeights;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::domain::OutOfDomain;

/// Commands over a target at rest that no sound actuator needs to leave.
const USUAL_GAINS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Limits that judge how a specimen follows.
pub(crate) const TRACKED: [Limit; 2] = [Limit::Lag, Limit::GainError];

/// True of a gain from a target at rest to its command that a sound actuator needs.
pub(crate) fn usual_gain(gain: f64) -> bool {
    USUAL_GAINS.contains(&gain)
}

/// One compensator per axis, if the table of specimen `index` has any.
pub(super) fn compensators(
    site: &mut Site<'_>,
    index: usize,
    axes: usize,
    tick: f64,
) -> Result<Option<Vec<Box<dyn Compensator>>>, Refused> {
    let Some(spec) = site
        .loaded
        .file
        .specimen
        .get(index)
        .and_then(|table| table.compensation.clone())
    else {
        return Ok(None);
    };
    let at = path("specimen").index(index).key("compensation");
    let method = site.loaded.file.integrator.method;
    if matches!(spec, CompensationSpec::Newton(_))
        && (method != Method::Gui || site.loaded.file.structure.is_none())
    {
        let finding = Finding::error(
            at.key("newton"),
            "`newton` needs velocity and acceleration targets, which the method \"gui\" computes as differences",
        )
        .at_key()
        .label("this method has another kind of velocity")
        .help("use `polynomial` with order = 2 and nodes = \"step\", which is equivalent for all targets");
        return site.refuse(finding);
    }
    let built: Result<Vec<_>, _> = (0..axes).map(|_| spec.build(tick)).collect();
    let built = built.or_else(|error| site.refuse_key(&at, error.key(), &error))?;
    if let Some(first) = built.first() {
        judge_gain(site, &at, &spec, first.as_ref())?;
    }
    Ok(Some(built))
}

/// The command for a constant target must have the sign of the target. A command far from it is probably a mistake.
fn judge_gain(
    site: &mut Site<'_>,
    at: &KeyPath,
    spec: &CompensationSpec,
    compensator: &dyn Compensator,
) -> Result<(), Refused> {
    let gain = compensator.stands(1.0);
    if usual_gain(gain) {
        return Ok(());
    }
    let key = match spec {
        CompensationSpec::ModelInverse(_) => "coefficients",
        CompensationSpec::Ats(ats) if ats.start.is_none() => "gain",
        _ => "start",
    };
    let place = site.loaded.locator.beneath(at, key);
    let headline = format!("a constant target of 1 mm gives a first command of {gain} mm");
    if gain > 0.0 {
        let finding = Finding::warning(place, headline).label("the command is far from the target");
        let help = "the first coefficient must be 1/A for an actuator whose static gain is A";
        site.warnings.push(finding.help(help));
        return Ok(());
    }
    let finding = Finding::error(place, headline).label("must be greater than zero");
    site.refuse(
        finding.help("the first coefficient is the static gain of the command over the target"),
    )
}

/// Test time that passes in one tick, in s.
pub(super) fn test_time(time: Time) -> f64 {
    time.step.value() / f64::from(time.ticks_per_step)
}

/// Whether it is seen how the specimen follows: where an actuator is simulated or made up for, or the lag is limited.
pub(super) fn is_tracked(file: &TestFile, table: &SpecimenTable, axes: usize) -> bool {
    let limited = |limits: &LimitsSpec| TRACKED.iter().any(|limit| limits.has(*limit));
    file.safety.delay_used.is_some()
        || table.own_transfer().is_some()
        || table.compensation.is_some()
        || table.limits_of(axes).iter().any(limited)
}

/// By how much of the time from one target to the next the velocity that comes with a target is older than this. The family's is
/// ∇x/Δt; of the α methods ∇x/Δt = v + (γ − ½) ∇v; a prescribed one is that of its moment.
pub(super) fn velocity_age(file: &TestFile) -> f64 {
    let rho = file.integrator.rho_infinity.unwrap_or(f64::NAN);
    let gamma = |weights: Result<AlphaWeights, OutOfDomain>| weights.map_or(0.5, |w| w.gamma);
    match file.integrator.method {
        _ if file.structure.is_none() => 0.0,
        Method::KrAlpha => gamma(AlphaWeights::kr(rho)),
        Method::MkrAlpha => gamma(AlphaWeights::mkr(rho)),
        // All others but the family move no specimen.
        _ => 0.5,
    }
}

/// A simulated actuator lives in test time: in a test that runs slower it would be faster than it is.
pub(super) fn slower_time(at: &KeyPath, time: Time) -> Option<Finding> {
    let (step, period) = (test_time(time), time.period.value());
    // One is a fraction of the other's digits.
    ((step - period).abs() > 1e-9 * period).then(|| {
        Finding::error(
            at.clone(),
            "a simulated actuator runs in test time: `time.scale` must be 1",
        )
        .at_key()
        .label(format!("a tick of {period} s for {step} s of test time"))
    })
}
