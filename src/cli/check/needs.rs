//! The needs of every axis beside its limits, as the short page of `gusset check` shows them.

use super::super::table::Table;
use crate::control::Poses;
use crate::control::limits::Quantity;
use crate::session::rehearsal::{Need, Needs, Rehearsal, StandIn, Used};
use crate::units::{digits, quantity, quantity_range};

/// Lines that the needs of a usual test may take. Where every quantity would take more, motion and force of an axis take a line each.
const MOST_LINES: usize = 12;

/// One line of the table.
struct Line {
    what: String,
    needed: String,
    limit: String,
    used: String,
}

/// Adds the table of a rehearsal.
pub(super) fn tabulate(rehearsal: &Rehearsal, table: &mut Table) {
    let all = &rehearsal.specimens;
    let mut blocks: Vec<Vec<Line>> = all.iter().map(each_quantity).collect();
    if blocks.iter().map(|lines| lines.len() + 1).sum::<usize>() > MOST_LINES {
        blocks = all.iter().map(grouped).collect();
    }
    let kept = nearest_to_limits(rehearsal, &mut blocks);
    let lines = blocks.iter().flatten();
    let width = |of: fn(&Line) -> &String, heading: &str| {
        let widths = lines.clone().map(|line| of(line).chars().count());
        widths.chain([heading.len()]).max().unwrap_or(0)
    };
    let widths = [
        width(|line| &line.what, "needs"),
        width(|line| &line.needed, "needed"),
        width(|line| &line.limit, "limit"),
    ];
    let show = |table: &mut Table, [what, needed, limit, used]: [&str; 4]| {
        let [a, b, c] = widths;
        let text = format!("{what:<0$}  {needed:<b$}  {limit:<c$}  {used}", a + 2);
        table.line(text.trim_end());
    };
    table.verbatim("");
    show(table, ["needs", "needed", "limit", "used"]);
    for (needs, lines) in all.iter().zip(&blocks) {
        if lines.is_empty() && !kept.is_empty() {
            continue;
        }
        table.line(&format!("{}: {}", needs.name, stand_in(needs.stand_in)));
        if let Some(poses) = &needs.poses {
            table.line(&format!("  platform {}", platform(poses)));
        }
        for line in lines {
            let what = format!("  {}", line.what);
            show(table, [&what, &line.needed, &line.limit, &line.used]);
        }
    }
    if !kept.is_empty() {
        table.line(&kept);
    }
}

/// Of very many axes keeps the lines that are nearest to their limits, and says how many are left out.
fn nearest_to_limits(rehearsal: &Rehearsal, blocks: &mut [Vec<Line>]) -> String {
    let axes: usize = rehearsal
        .specimens
        .iter()
        .map(|needs| needs.axes.len())
        .sum();
    let most = MOST_LINES / 2;
    if axes <= most {
        return String::new();
    }
    let used = |needs: &Needs, axis: usize| {
        let margins = needs
            .axes
            .get(axis)
            .into_iter()
            .flatten()
            .filter_map(Need::margin);
        let of_limits = margins.map(|margin| 1.0 - margin);
        let of_rig = needs.used(axis).into_iter().map(|used| used.share());
        let trips = needs.axes.get(axis).into_iter().flatten().any(Need::trips);
        let trips = if trips { f64::INFINITY } else { 0.0 };
        of_limits.chain(of_rig).fold(trips, f64::max)
    };
    let each = rehearsal.specimens.iter().enumerate();
    let mut order: Vec<(f64, usize, usize)> = each
        .flat_map(|(place, needs)| {
            (0..needs.axes.len()).map(move |axis| (used(needs, axis), place, axis))
        })
        .collect();
    order.sort_by(|one, other| other.0.total_cmp(&one.0));
    // An axis beyond a limit or a capacity is never left out.
    let beyond = order.iter().filter(|(used, ..)| *used > 1.0).count();
    let kept: Vec<(usize, usize)> = order
        .iter()
        .take(most.max(beyond))
        .map(|(_, place, axis)| (*place, *axis))
        .collect();
    for (place, lines) in blocks.iter_mut().enumerate() {
        let axes = rehearsal
            .specimens
            .get(place)
            .map_or(1, |needs| needs.axes.len());
        let per_axis = (lines.len() / axes.max(1)).max(1);
        let mut number = 0;
        lines.retain(|_| {
            let axis = number / per_axis;
            number += 1;
            kept.contains(&(place, axis))
        });
    }
    match axes - kept.len() {
        0 => String::new(),
        others => format!("{others} more axes are farther from their limits: --verbose shows them"),
    }
}

/// One line per quantity of every axis.
fn each_quantity(needs: &Needs) -> Vec<Line> {
    let mut lines = Vec::new();
    for (axis, all) in needs.axes.iter().enumerate() {
        let prefix = prefix(needs, axis);
        for need in all {
            lines.push(Line {
                what: format!("{prefix}{}", name(need.quantity)),
                needed: needed(need),
                limit: limit(need),
                used: used(need),
            });
        }
        let capacities = needs.used(axis);
        lines.extend(capacities.iter().map(|used| of_rig(used, &prefix)));
    }
    lines
}

/// Two lines per axis: motion and force, each with the limit that is used most.
fn grouped(needs: &Needs) -> Vec<Line> {
    let mut lines = Vec::new();
    for (axis, all) in needs.axes.iter().enumerate() {
        let prefix = prefix(needs, axis);
        let used_of_rig = needs.used(axis);
        for (word, of_force) in [("motion", false), ("force", true)] {
            let is_of_group = |quantity| is_of_force(quantity) == of_force;
            let group: Vec<&Need> = all
                .iter()
                .filter(|need| is_of_group(need.quantity))
                .collect();
            let shown = group.iter().filter(|need| is_usual(need.quantity));
            let shown: Vec<String> = shown.map(|need| needed(need)).collect();
            let nearest = group.iter().filter(|need| need.margin().is_some());
            let nearest = nearest.min_by(|one, other| {
                let of = |need: &Need| need.margin().unwrap_or(f64::INFINITY);
                of(one).total_cmp(&of(other))
            });
            let keys: [&str; 2] = if of_force {
                ["force_n", "power_w"]
            } else {
                ["stroke_m", "velocity_m_per_s"]
            };
            let of_rig = used_of_rig.iter().filter(|used| keys.contains(&used.key));
            let of_rig = of_rig.max_by(|one, other| one.share().total_cmp(&other.share()));
            let of_limit = nearest.map(|need| {
                (
                    limit(need),
                    used(need),
                    need.margin().map_or(0.0, |margin| 1.0 - margin),
                )
            });
            let of_rig = of_rig.map(|used| {
                (
                    quantity(used.capacity, used.unit) + " of the rig",
                    share(used),
                    used.share(),
                )
            });
            let worst = of_limit
                .into_iter()
                .chain(of_rig)
                .max_by(|one, other| one.2.total_cmp(&other.2));
            let (limit, used, _) = worst.unwrap_or_else(|| ("none".to_owned(), String::new(), 0.0));
            lines.push(Line {
                what: format!("{prefix}{word}"),
                needed: shown.join(", "),
                limit,
                used,
            });
        }
    }
    lines
}

/// What stood for a specimen in the rehearsal.
const fn stand_in(stand_in: StandIn) -> &'static str {
    match stand_in {
        StandIn::Itself => "computed by its own law",
        StandIn::Law => "behind a link; rehearsed with its `stand_in`",
        StandIn::Linear => "behind a link; rehearsed as a linear spring of its declared stiffness",
        StandIn::Nothing => {
            "behind a link; its force is unknown: set its stiffness or a `stand_in`"
        }
    }
}

fn platform(poses: &Poses) -> String {
    let each = poses.range.iter().map(|(coordinate, low, high)| {
        let range = quantity_range(*low, *high, coordinate.unit());
        format!("{} {range}", coordinate.key())
    });
    let each: Vec<String> = each.collect();
    let [at_rest, worst] = poses.condition;
    format!(
        "{}; condition {} at worst",
        each.join(", "),
        digits(worst.max(at_rest))
    )
}

/// Which axis a line is of, where there are several.
fn prefix(needs: &Needs, axis: usize) -> String {
    let word = if needs.poses.is_some() {
        "actuator"
    } else {
        "axis"
    };
    if needs.axes.len() > 1 {
        format!("{word} {}, ", axis + 1)
    } else {
        String::new()
    }
}

/// A quantity in two or three words.
const fn name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::CommandStep => "command step per tick",
        Quantity::ForceStep => "measured force step",
        Quantity::SensorDisp => "displacement sensor",
        Quantity::SensorForce => "load cell",
        other => other.words(),
    }
}

const fn is_of_force(quantity: Quantity) -> bool {
    matches!(
        quantity,
        Quantity::MeasuredForce | Quantity::SensorForce | Quantity::ForceStep
    )
}

/// The quantities that are shown whether or not they have a limit.
const fn is_usual(quantity: Quantity) -> bool {
    matches!(
        quantity,
        Quantity::CommandDisp
            | Quantity::CommandVel
            | Quantity::CommandAccel
            | Quantity::MeasuredForce
    )
}

const fn is_range(quantity: Quantity) -> bool {
    matches!(
        quantity,
        Quantity::CommandDisp
            | Quantity::MeasuredDisp
            | Quantity::SensorDisp
            | Quantity::MeasuredForce
            | Quantity::SensorForce
    )
}

fn unit(quantity: Quantity) -> &'static str {
    match quantity.unit() {
        "m/s2" => "m/s²",
        unit => unit,
    }
}

fn needed(need: &Need) -> String {
    let unit = unit(need.quantity);
    if is_range(need.quantity) {
        quantity_range(need.needed.low, need.needed.high, unit)
    } else {
        quantity(need.needed.high, unit)
    }
}

/// The trip levels, or the warning levels of a quantity that only warns.
fn limit(need: &Need) -> String {
    let unit = unit(need.quantity);
    let of = |[low, high]: [f64; 2]| match (low.is_finite(), high.is_finite()) {
        (false, false) => None,
        (true, true) => Some(quantity_range(low, high, unit)),
        (true, false) => Some(format!("from {}", quantity(low, unit))),
        (false, true) => Some(format!("up to {}", quantity(high, unit))),
    };
    let warns = || of(need.warn).map(|levels| format!("{levels} (warns)"));
    of(need.trip)
        .or_else(warns)
        .unwrap_or_else(|| "none".to_owned())
}

fn used(need: &Need) -> String {
    let share = need.margin().map(|margin| per_cent(1.0 - margin));
    let word = if need.trips() {
        "WOULD TRIP"
    } else if need.warns() {
        "would warn"
    } else {
        ""
    };
    let share = share.unwrap_or_default();
    format!("{share} {word}").trim().to_owned()
}

fn of_rig(used: &Used, prefix: &str) -> Line {
    let word = used.key.split('_').next().unwrap_or(used.key);
    Line {
        what: format!("{prefix}{word} of the rig"),
        needed: quantity(used.needed, used.unit),
        limit: quantity(used.capacity, used.unit),
        used: share(used),
    }
}

fn share(used: &Used) -> String {
    let word = if used.is_within() { "" } else { " TOO MUCH" };
    format!("{}{word}", per_cent(used.share()))
}

/// Rounded up: what is used in full is never shown as less.
fn per_cent(share: f64) -> String {
    format!("{:.0} %", (100.0 * share - 1e-9).ceil().max(0.0))
}
