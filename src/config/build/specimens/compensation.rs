//! The compensators of a specimen, and what a simulated actuator asks of the grid.

use super::super::{Refused, Site, path};
use crate::compensation::{CompensationSpec, Compensator};
use crate::config::steps::Time;
use crate::config::{Finding, KeyPath, Method};

/// One compensator per axis, if the table of specimen `index` has any.
pub(super) fn compensators(
    site: &mut Site<'_>,
    index: usize,
    axes: usize,
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
    let tick = site.loaded.time.period.value();
    let built: Result<Vec<_>, _> = (0..axes).map(|_| spec.build(tick)).collect();
    match built {
        Ok(built) => Ok(Some(built)),
        Err(error) => site.refuse_key(&at, error.key(), &error),
    }
}

/// A simulated actuator lives in test time: in a test that runs slower it would be faster than it is.
pub(super) fn slower_time(at: &KeyPath, time: Time) -> Option<Finding> {
    let (step, period) = (time.step.value(), time.period.value());
    (step != period).then(|| {
        Finding::error(
            at.clone(),
            "a simulated actuator has no time of its own: `time.scale` must be 1",
        )
        .at_key()
        .label(format!("a tick of {period} s for a step of {step} s"))
    })
}
