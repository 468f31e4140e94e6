//! The nodes and members of a frame for `gusset check`.

use std::f64::consts::TAU;

use super::super::table::Table;
use gusset_config::word;
use gusset_numerics::frame::{Direction, FrameSpec};
use gusset_quantity::units::{duration, number, quantity};
use gusset_setup::{FrameFacts, StructureFacts};
use serde_json::{Value, json};

/// Nodes, and members, that are listed without `--verbose`.
const LISTED: usize = 12;
/// Periods that are named.
const PERIODS: usize = 3;

/// Adds masses and loads, nodes and members; in full with every node and the numbers of its DOFs.
pub(super) fn tabulate(
    table: &mut Table,
    structure: &StructureFacts,
    spec: Option<&FrameSpec>,
    in_full: bool,
) {
    let (Some(facts), Some(spec)) = (&structure.frame, spec) else {
        return;
    };
    let mut text = format!(
        "mass {}, static loads {} downwards",
        mass(facts.mass),
        quantity(facts.weight, "N")
    );
    let omegas = structure.frequencies.iter().filter(|omega| **omega > 0.0);
    let periods = omegas.take(PERIODS).map(|omega| duration(TAU / omega));
    let periods: Vec<String> = periods.collect();
    // The table of modes has them, too.
    if !in_full && !periods.is_empty() {
        text.push_str(&format!("; first periods {}", periods.join(", ")));
    }
    table.row("frame", &text);
    if let Some(share) = facts.share_of_tick {
        let text = format!(
            "at most {} of a tick, measured now",
            number(100.0 * share) + " %"
        );
        table.row("members take", &text);
    }
    let listed = if in_full { usize::MAX } else { LISTED };
    nodes(table, structure, spec, listed);
    members(table, facts, spec, listed);
}

fn nodes(table: &mut Table, structure: &StructureFacts, spec: &FrameSpec, listed: usize) {
    let mut rows = vec![["at", "mass", "fixed", "DOFs"].map(str::to_owned)];
    rows.extend(spec.node.iter().map(|node| {
        let own = Direction::ALL.iter().filter_map(|direction| {
            let place = format!("{} {}", node.name, direction.word());
            let dof = structure.places.iter().position(|known| *known == place)?;
            Some(format!("{} {}", dof + 1, direction.word()))
        });
        let own: Vec<String> = own.collect();
        let fixed: Vec<&str> = node.fixed.iter().map(|one| one.word()).collect();
        let at: Vec<String> = node.at_m.iter().map(|at| number(*at)).collect();
        let at = format!("({}) m", at.join(", "));
        let rotary = match node.rotary_mass_kg_m2 {
            0.0 => String::new(),
            rotary => format!(", {} kg m²", number(rotary)),
        };
        let mass = format!("{}{rotary}", mass(node.mass_kg));
        [at, mass, or_dash(fixed.join(" ")), or_dash(own.join(", "))]
    }));
    let names = spec.node.iter().map(|node| node.name.as_str());
    let order: Vec<usize> = (0..spec.node.len()).collect();
    list(table, "node", names.collect(), &rows, &order, listed);
}

fn members(table: &mut Table, facts: &FrameFacts, spec: &FrameSpec, listed: usize) {
    let heads = ["nodes", "kind", "section", "length", "utilisation"];
    let mut rows = vec![heads.map(str::to_owned)];
    let both = spec.member.iter().zip(&facts.members);
    rows.extend(both.map(|(spec, member)| {
        [
            spec.nodes.join("–"),
            word(&spec.kind),
            spec.section.clone(),
            quantity(member.length, "m"),
            or_dash(member.utilisation.map(share).unwrap_or_default()),
        ]
    }));
    let names = facts.members.iter().map(|member| member.name.as_str());
    let mut order: Vec<usize> = (0..facts.members.len()).collect();
    if order.len() > listed {
        let used = |place: &usize| facts.members[*place].utilisation.unwrap_or(-1.0);
        order.sort_by(|a, b| used(b).total_cmp(&used(a)));
    }
    list(table, "member", names.collect(), &rows, &order, listed);
}

/// Adds the first `listed` of these rows in this order, below their heads, and the number of the others.
fn list<const N: usize>(
    table: &mut Table,
    what: &str,
    names: Vec<&str>,
    rows: &[[String; N]],
    order: &[usize],
    listed: usize,
) {
    let wide = |text: &String| text.chars().count();
    let widths: [usize; N] =
        std::array::from_fn(|k| rows.iter().map(|row| wide(&row[k])).max().unwrap_or(0));
    let aligned = |row: &[String; N]| {
        let cells = row.iter().zip(widths);
        let cells: Vec<String> = cells
            .map(|(cell, width)| format!("{cell:<width$}"))
            .collect();
        cells.join("  ").trim_end().to_owned()
    };
    table.row(what, &aligned(&rows[0]));
    for place in order.iter().take(listed) {
        table.row(&format!("  {}", names[*place]), &aligned(&rows[place + 1]));
    }
    if let Some(more @ 1..) = order.len().checked_sub(listed) {
        table.row("", &format!("{more} more: --verbose shows them"));
    }
}

fn mass(kg: f64) -> String {
    if kg >= 1e3 {
        format!("{} t", number(kg / 1e3))
    } else {
        format!("{} kg", number(kg))
    }
}

/// A utilisation. What rounding leaves of a member without a force is zero.
fn share(utilisation: f64) -> String {
    let is_rounding = utilisation < 1e-9;
    number(if is_rounding { 0.0 } else { utilisation })
}

fn or_dash(text: String) -> String {
    if text.is_empty() {
        "–".to_owned()
    } else {
        text
    }
}

/// The frame for `--json`; null for other structures.
pub(super) fn as_json(structure: &StructureFacts, spec: Option<&FrameSpec>) -> Value {
    let (Some(facts), Some(spec)) = (&structure.frame, spec) else {
        return Value::Null;
    };
    let members = spec.member.iter().zip(&facts.members);
    let members = members.map(|(spec, member)| {
        json!({
            "name": member.name,
            "nodes": spec.nodes,
            "kind": spec.kind,
            "section": spec.section,
            "length_m": member.length,
            "utilisation": member.utilisation,
        })
    });
    let nodes = spec.node.iter().map(|node| {
        json!({
            "name": node.name,
            "at_m": node.at_m,
            "mass_kg": node.mass_kg,
            "rotary_mass_kg_m2": node.rotary_mass_kg_m2,
            "fixed": node.fixed,
        })
    });
    json!({
        "mass_kg": facts.mass,
        "weight_n": facts.weight,
        "share_of_tick": facts.share_of_tick,
        "nodes": nodes.collect::<Vec<_>>(),
        "members": members.collect::<Vec<_>>(),
    })
}
