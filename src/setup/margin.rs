//! The tables of critical delays of the ports whose lag is estimated.

use super::{Refused, Site, StructureFacts, path};
use gusset_config::Finding;
use gusset_control::port::Port;

/// Gives the tables to each port whose lag is estimated. Without tables, the facts of the structure keep the reason. A test that
/// needs them is then refused.
pub(super) fn watched(
    site: &mut Site<'_>,
    structure: Option<&mut StructureFacts>,
    ports: Vec<Port>,
) -> Result<Vec<Port>, Refused> {
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
        return Ok(ports);
    };
    let wanted: Vec<bool> = ports.iter().map(Port::tracks).collect();
    let tables = match &structure.analysis {
        _ if !wanted.contains(&true) => Err("no specimen estimates its lag".to_owned()),
        None => Err("the structure is too large".to_owned()),
        Some(analysis) => {
            let bounds = ports
                .iter()
                .map(|port| port.tangent_bounds().map(|bound| bound.0));
            let bounds: Vec<Vec<f64>> = bounds.map(Iterator::collect).collect();
            analysis.critical_delays(&wanted, &bounds)
        }
    };
    match tables {
        Ok(tables) => {
            let both = ports.into_iter().zip(tables);
            Ok(both
                .map(|(port, tables)| port.with_critical_delays(tables))
                .collect())
        }
        Err(why) if asked => {
            let finding = Finding::error(at(), format!("the critical delay is unknown: {why}"));
            site.refuse(finding.help("`lag_s` at the limits of a specimen bounds its lag in s"))
        }
        Err(why) => {
            structure.no_margin = Some(why);
            Ok(ports)
        }
    }
}
