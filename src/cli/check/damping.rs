//! The damping that the numerical side adds along the axes of specimens, for `gusset check`.

use super::super::table::Table;
use gusset_quantity::units::quantity;
use gusset_setup::{Facts, RuleDamping, StructureFacts};
use serde_json::{Value, json};

/// Adds a row for each of the first `listed` specimens.
pub(super) fn tabulate(
    table: &mut Table,
    facts: &Facts,
    structure: &StructureFacts,
    listed: usize,
) {
    const WHAT: &str = "rule damping";
    let each = match &structure.rule_damping {
        None => return,
        Some(RuleDamping::Modal) => {
            let text = "modal damping resists every motion of its masses, also along the axes of specimens";
            return table.row(WHAT, text);
        }
        Some(RuleDamping::Stiffness(each)) => each,
    };
    for (name, axes) in facts.specimens.iter().zip(each).take(listed) {
        let words = axes.iter().map(|(damping, unit)| quantity(*damping, unit));
        let own = match axes.iter().all(|(damping, _)| *damping == 0.0) {
            true => "none".to_owned(),
            false => words.collect::<Vec<_>>().join(", "),
        };
        table.row(
            WHAT,
            &format!("{name}: {own} from the stiffness of the specimen"),
        );
    }
    if let Some(more @ 1..) = each.len().checked_sub(listed) {
        table.row(WHAT, &format!("{more} more: --verbose shows them"));
    }
}

/// For `--json`: "modal", or a list for each specimen with a number for each axis; null without a rule or a specimen.
pub(super) fn as_json(structure: &StructureFacts) -> Value {
    match &structure.rule_damping {
        None => Value::Null,
        Some(RuleDamping::Modal) => json!("modal"),
        Some(RuleDamping::Stiffness(each)) => {
            let each = each
                .iter()
                .map(|axes| axes.iter().map(|(damping, _)| *damping).collect());
            json!(each.collect::<Vec<Vec<f64>>>())
        }
    }
}
