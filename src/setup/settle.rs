//! The ramp of a static load onto the structure before t = 0.

use super::{Refused, Site, path};
use gusset_config::Finding;
use gusset_control::engine::StaticLoad;
use gusset_numerics::linalg::{Spd, SymMatrix};

/// Equal parts in which a static load is brought on.
const SETTLING_PARTS: u32 = 20;
/// Relative unbalance at which the static load is in equilibrium.
const SETTLING_TOLERANCE: f64 = 1e-10;
/// Corrections after which a static load counts as impossible to carry.
const SETTLING_EXCHANGES: u32 = 40_000;

pub(super) fn settle(
    site: &mut Site<'_>,
    load: Vec<f64>,
    initial: &SymMatrix,
    bound: Option<&SymMatrix>,
) -> Result<StaticLoad, Refused> {
    match Spd::factor(bound.unwrap_or(initial)) {
        Ok(stiffness) => Ok(StaticLoad {
            stiffness,
            load,
            parts: SETTLING_PARTS,
            tolerance: SETTLING_TOLERANCE,
            most_exchanges: SETTLING_EXCHANGES,
        }),
        Err(error) => {
            let at = if site
                .loaded
                .file
                .structure
                .as_ref()
                .is_some_and(|s| s.gravity.is_some())
            {
                path("structure").key("gravity")
            } else {
                path("structure").key("static_load_n")
            };
            let finding = Finding::error(
                at,
                format!("the structure cannot carry the static load: the stiffness is {error}"),
            );
            site.refuse(finding)
        }
    }
}
