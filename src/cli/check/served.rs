//! `gusset check` of a file for `gusset serve`: the specimen, its client, and its limits at both scales.

use std::path::Path;

use serde_json::json;

use super::super::table::Table;
use super::super::test_file::refused;
use super::super::{answer, tell};
use crate::setup::{ServedLimit, load_served, served_limits};
use crate::units::in_axis_unit;

/// Checks a served file.
pub(super) fn check(path: &Path, is_json: bool) -> anyhow::Result<()> {
    let served = load_served(path, None).map_err(refused)?;
    for warning in &served.source.warnings {
        tell(format_args!("warning: {warning}"));
    }
    let [own, client] = served_limits(&served.source);
    if is_json {
        let found = json!({
            "file": "serve",
            "specimen": served.source.specimen().map(|table| table.name.clone()),
            "limits": own.iter().map(of_json).collect::<Vec<_>>(),
            "limits_of_the_client": client.iter().map(of_json).collect::<Vec<_>>(),
        });
        answer(serde_json::to_string_pretty(&found)?)?;
        return Ok(());
    }
    let name = served
        .source
        .specimen()
        .map_or("", |table| table.name.as_str());
    let mut table = Table::wrapped(&format!("specimen \"{name}\" for `gusset serve`"));
    for limit in &own {
        table.row(&limit.name, &format!("at the specimen: {}", words(limit)));
    }
    let poses = served
        .source
        .specimen()
        .is_some_and(|table| table.geometry.is_some());
    let note = if poses && served.source.converts() {
        ", alone and near the reference pose"
    } else {
        ""
    };
    for limit in &client {
        table.row(
            &limit.name,
            &format!("for the client{note}: {}", words(limit)),
        );
    }
    answer(table)?;
    Ok(())
}

fn of_json(limit: &ServedLimit) -> serde_json::Value {
    let ends = |ends: [f64; 2]| ends.map(|end| end.is_finite().then_some(end));
    json!({
        "name": limit.name,
        "disp": ends(limit.disp),
        "disp_unit": limit.disp_unit,
        "force": ends(limit.force),
        "force_unit": limit.force_unit,
    })
}

fn words(limit: &ServedLimit) -> String {
    let range = |[low, high]: [f64; 2], unit: &str| {
        if low.is_infinite() && high.is_infinite() {
            "no limit".to_owned()
        } else {
            format!(
                "{} to {}",
                in_axis_unit(low, unit),
                in_axis_unit(high, unit)
            )
        }
    };
    format!(
        "displacement {}, force {}",
        range(limit.disp, limit.disp_unit),
        range(limit.force, limit.force_unit)
    )
}
