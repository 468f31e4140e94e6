//! The path between two targets, and its effect on a compensator.

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::link_table::LinkSpec;
use crate::schema::TestFile;
use crate::specimen::SpecimenTable;

/// Value and slope of the path are continuous, its curvature is not: a compensator that differentiates it from tick to
/// tick passes its jumps on.
pub(super) fn check_way(
    specimen: &SpecimenTable,
    file: &TestFile,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let from_target_to_target =
        file.time.ticks_per_step == 1 || specimen.link.as_ref().is_some_and(LinkSpec::is_per_step);
    let Some(spec) = &specimen.compensation else {
        return;
    };
    if from_target_to_target || !spec.takes_curvature() {
        return;
    }
    let time = KeyPath::root().key("time");
    let headline = format!(
        "`{}` amplifies the jumps of the curvature between targets",
        spec.kind()
    );
    let first = if file.time.prediction_order < 3 {
        "`prediction_order = 3` in [time] makes the jumps of the curvature several times smaller; "
    } else {
        ""
    };
    findings.push(
        Finding::warning(at.key("compensation").key(spec.kind()), headline)
            .at_key()
            .label("it uses second or higher differences from tick to tick, so its commands jerk at each target")
            .beside(time.key("ticks_per_step"), "this test has several ticks per step")
            .help(format!(
                "{first}`polynomial` with nodes = \"delay\" uses differences over its delay, which are smooth"
            )),
    );
}
