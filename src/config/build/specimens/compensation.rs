//! The compensators of a specimen, and what a simulated actuator asks of the grid.

use super::super::{Refused, Site, path};
use crate::compensation::{CompensationSpec, Compensator};
use crate::config::steps::Time;
use crate::config::{Finding, KeyPath, Method, SpecimenTable, TestFile};
use crate::control::limits::LimitsSpec;
use crate::integrate::{AlphaWeights, MethodError};

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
            "`newton` takes v and w of the method \"gui\", which makes them of differences",
        )
        .at_key()
        .label("another kind of velocity")
        .help("`polynomial` with order = 2 and nodes = \"step\" says the same of any targets");
        return site.refuse(finding);
    }
    let built: Result<Vec<_>, _> = (0..axes).map(|_| spec.build(tick)).collect();
    match built {
        Ok(built) => Ok(Some(built)),
        Err(error) => site.refuse_key(&at, error.key(), &error),
    }
}

/// Test time that passes in one tick, in s.
pub(super) fn test_time(time: Time) -> f64 {
    time.step.value() / f64::from(time.ticks_per_step)
}

/// Whether it is seen how the specimen follows: where an actuator is simulated or made up for, or the lag is limited.
pub(super) fn is_tracked(file: &TestFile, table: &SpecimenTable, axes: usize) -> bool {
    let limited = |limits: &LimitsSpec| limits.lag_s.is_some() || limits.gain_error.is_some();
    file.safety.delay_used.is_some()
        || table.transfer.is_some()
        || table.compensation.is_some()
        || table.limits_of(axes).iter().any(limited)
}

/// By how much of the time from one target to the next the velocity that comes with a target is older than this. The family's is
/// ∇x/Δt; of the α methods ∇x/Δt = v + (γ − ½) ∇v; a prescribed one is that of its moment.
pub(super) fn velocity_age(file: &TestFile) -> f64 {
    let rho = file.integrator.rho_infinity.unwrap_or(f64::NAN);
    let gamma = |weights: Result<AlphaWeights, MethodError>| weights.map_or(0.5, |w| w.gamma);
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
            "a simulated actuator has no time of its own: `time.scale` must be 1",
        )
        .at_key()
        .label(format!("a tick of {period} s for {step} s of test time"))
    })
}
