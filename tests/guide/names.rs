//! Whether the lists of the guide have every name that the program has.

use gusset_quantity::catalog::column::{Kind, TEST};
use gusset_quantity::catalog::limit::Limit;
use serde_json::Value;

use super::limits::FURTHER_LIMITS;
use super::pages::schemas;

pub fn limits() -> Vec<String> {
    let mut wrong = Vec::new();
    let schemas = schemas();
    let test = schemas[0].1.root();
    for [key, _, _, _, table] in FURTHER_LIMITS {
        let owner = if table == "safety" {
            "SafetyTable"
        } else {
            "LinkSpec"
        };
        if test["$defs"][owner]["properties"].get(key).is_none() {
            wrong.push(format!("limit `{key}`: [{table}] has no such key"));
        }
    }
    wrong
}

/// Columns of a run that the catalogue does not have, or has with another unit.
pub fn columns_of(layout: &str) -> Vec<String> {
    let layout: Value = serde_json::from_str(layout).unwrap();
    let mut wrong = Vec::new();
    for column in layout["columns"].as_array().unwrap() {
        let name = column["name"].as_str().unwrap();
        let unit = column["unit"].as_str().unwrap();
        if Limit::OF_TEST.iter().any(|quantity| quantity.key() == name) {
            continue;
        }
        let mut kinds = TEST.iter().filter(|kind| kind.fits(name)).peekable();
        if kinds.peek().is_none() {
            wrong.push(format!("column `{name}` is not in the catalogue"));
        }
        // Words replace the unit of a kind whose unit depends on the axis or parameter.
        let fits = |kind: &Kind| {
            let named = ["specimen unit", "of the parameter", "of the limit"].contains(&kind.unit);
            named || kind.unit.split(" or ").any(|one| one == unit)
        };
        if !kinds.any(fits) {
            wrong.push(format!("column `{name}`: its unit is {unit}"));
        }
    }
    wrong
}
