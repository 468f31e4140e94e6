//! The tables of critical delays of the specimens whose lag is estimated.

use super::{Refused, Site, StructureFacts, path};
use gusset_config::Finding;
use gusset_control::port::PortSpec;

/// Gives the tables to each specimen whose lag is estimated. Without tables, the facts of the structure keep the reason. A test that
/// needs them is then refused.
pub(super) fn watched(
    site: &mut Site<'_>,
    structure: Option<&mut StructureFacts>,
    specs: &mut [PortSpec],
) -> Result<(), Refused> {
    let asked = site.loaded.file.safety.delay_used.is_some();
    let at = || path("safety").key("delay_used");
    let Some(structure) = structure else {
        if asked {
            let finding = Finding::error(
                at(),
                "the test has no structure that a delay could destabilise",
            );
            return site.refuse(finding.label("a share of what?"));
        }
        return Ok(());
    };
    let wanted: Vec<bool> = specs.iter().map(|spec| spec.tracking.is_some()).collect();
    let tables = match &structure.analysis {
        _ if !wanted.contains(&true) => Err("no specimen estimates its lag".to_owned()),
        None => Err("the structure is too large".to_owned()),
        Some(analysis) => {
            let bounds = specs.iter().map(|spec| {
                let axes = spec.axes.iter();
                axes.map(|axis| axis.declared.stiffness_bound).collect()
            });
            let bounds: Vec<Vec<f64>> = bounds.collect();
            analysis.critical_delays(&wanted, &bounds)
        }
    };
    match tables {
        Ok(tables) => {
            for (spec, tables) in specs.iter_mut().zip(tables) {
                if let Some(tracking) = &mut spec.tracking {
                    tracking.critical = tables;
                }
            }
            Ok(())
        }
        Err(why) if asked => {
            let finding = Finding::error(at(), format!("the critical delay is unknown: {why}"));
            site.refuse(finding.help("`lag_s` at the limits of a specimen bounds its lag in s"))
        }
        Err(why) => {
            structure.no_margin = Some(why);
            Ok(())
        }
    }
}
