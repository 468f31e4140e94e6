//! Limits of estimates that are never made: they can never trip, and the user who relies on them must know.

use super::super::{Site, path};
use gusset_config::{Finding, KeyPath, LimitsSpec};
use gusset_control::port::Declared;
use gusset_quantity::catalog::limit::Limit;

/// Warns of each such limit of one specimen.
pub(super) fn unwatched(
    site: &mut Site<'_>,
    index: usize,
    specs: &[LimitsSpec],
    declared: &[Declared],
) {
    let at = path("specimen").index(index);
    let mut told: Vec<KeyPath> = Vec::new();
    for (axis, (spec, declared)) in specs.iter().zip(declared).enumerate() {
        let known = |bound: f64| bound > 0.0 && bound.is_finite();
        for (limit, known, why) in [
            (
                Limit::StiffnessRatio,
                known(declared.stiffness_bound),
                "no bound of its tangent stiffness is declared",
            ),
            (
                Limit::DampingRatio,
                known(declared.damping_bound),
                "no damping is declared, and none is estimated",
            ),
        ] {
            if !spec.has(limit) || known {
                continue;
            }
            let key = limit.key();
            let own = at.key("axis").index(axis).key("limits").key(key);
            let place = if site.loaded.locator.holds(&own) {
                own
            } else {
                at.key("limits").key(key)
            };
            if told.contains(&place) {
                continue;
            }
            let headline = format!(
                "`{place}` has no effect on axis {}: it cannot trip in this test",
                axis + 1
            );
            told.push(place.clone());
            site.warnings
                .push(Finding::warning(place, headline).at_key().label(why));
        }
    }
}
