//! The needs of every axis beside its limits, as `gusset check` shows them.

use super::super::table::Table;
use gusset_control::port::Poses;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::units::{duration, number, quantity, quantity_range};
use gusset_session::rehearsal::{FullRehearsal, Held, Need, Needs, StandIn, Used};

/// Lines that the needs of a usual test may take. Where every quantity would take more, motion and force of an axis take a line each.
const MOST_LINES: usize = 12;
/// Axes that are shown at most: of more than six, the four that are nearest to their limits.
const MOST_AXES: [usize; 2] = [6, 4];

/// One line of the table.
struct Line {
    /// Specimen and axis, from 0.
    axis: (usize, usize),
    what: String,
    needed: String,
    limit: String,
    used: String,
    /// The need as a share of the limit or of the capacity; beyond 1 the test trips or is not possible.
    share: f64,
}

impl Line {
    fn of(need: &Need, axis: (usize, usize), prefix: &str) -> Self {
        Self {
            axis,
            what: format!("{prefix}{}", name(need.quantity)),
            needed: needed(need),
            limit: limit(need),
            used: used(need),
            share: need.share(),
        }
    }

    fn cells(&self) -> [&str; 4] {
        [&self.what, &self.needed, &self.limit, &self.used]
    }
}

/// Adds the table of a rehearsal, or `all_of_it`: also every quantity of a long table, and those that a hold decides.
pub(super) fn tabulate(full: &FullRehearsal, table: &mut Table, all_of_it: bool) {
    let all = &full.rehearsal.specimens;
    let each = |of: fn(&Needs, usize) -> Vec<Line>| -> Vec<Line> {
        let lines = all.iter().enumerate();
        lines.flat_map(|(place, needs)| of(needs, place)).collect()
    };
    let mut lines = each(each_quantity);
    let is_grouped = !all_of_it && lines.len() + all.len() > MOST_LINES;
    if is_grouped {
        lines = each(grouped);
    }
    let left_out = if all_of_it {
        0
    } else {
        keep_the_nearest(&mut lines)
    };
    let held = full.held.as_ref().filter(|_| all_of_it);
    let of_hold = held.into_iter().flat_map(Held::needs);
    let of_hold: Vec<Line> = of_hold.map(|need| Line::of(need, (0, 0), "  ")).collect();
    let first = all.first().map(|needs| needs.stand_in);
    let is_uniform = |needs: &Needs| is_flat(needs) && Some(needs.stand_in) == first;
    let is_flat = is_grouped && all.iter().all(is_uniform);
    for line in &mut lines {
        let name = all.get(line.axis.0).filter(|_| is_flat);
        let name = name.map_or_else(String::new, |needs| format!("{}, ", needs.name));
        line.what = format!("  {name}{}", line.what);
    }
    table.verbatim("");
    let columns = Columns::of(lines.iter().chain(&of_hold));
    columns.show(table, ["needs", "needed", "limit", "used"]);
    if let (true, Some(first)) = (is_flat, all.first()) {
        table.line(&format!(
            "all specimens: rehearsed with {}",
            stand_in(first, false)
        ));
    }
    for (place, needs) in all.iter().enumerate() {
        let own = lines.iter().filter(|line| line.axis.0 == place);
        if own.clone().next().is_none() && left_out > 0 {
            continue;
        }
        if !is_flat {
            let stand_in = stand_in(needs, all_of_it);
            table.line(&format!("{}: rehearsed with {stand_in}", needs.name));
        }
        if let Some(poses) = &needs.poses {
            table.line(&format!("  platform {}", platform(poses, all_of_it)));
        }
        own.for_each(|line| columns.show(table, line.cells()));
    }
    if left_out > 0 {
        table.line(&format!("{left_out} more axes: --verbose shows them"));
    }
    if let Some(held) = held.filter(|_| !of_hold.is_empty()) {
        let (specimen, axis) = held.fastest;
        let name = held.specimens.get(specimen);
        let name = name.map_or("", |needs| needs.name.as_str());
        table.line(&format!(
            "a hold at {}, where axis {} of `{name}` is fastest",
            duration(held.at),
            axis + 1
        ));
    }
    for line in &of_hold {
        columns.show(table, line.cells());
    }
}

/// Widths of the first three columns.
struct Columns([usize; 3]);

impl Columns {
    fn of<'a>(lines: impl Iterator<Item = &'a Line> + Clone) -> Self {
        let width = |of: fn(&Line) -> &String, heading: &str| {
            let widths = lines.clone().map(|line| of(line).chars().count());
            widths.chain([heading.len()]).max().unwrap_or(0)
        };
        Self([
            width(|line| &line.what, "needs"),
            width(|line| &line.needed, "needed"),
            width(|line| &line.limit, "limit"),
        ])
    }

    fn show(&self, table: &mut Table, [what, needed, limit, used]: [&str; 4]) {
        let [a, b, c] = self.0;
        let text = format!("{what:<a$}  {needed:<b$}  {limit:<c$}  {used}");
        table.line(text.trim_end());
    }
}

/// True if a specimen has one axis and no platform: its name then fits into every line.
const fn is_flat(needs: &Needs) -> bool {
    needs.axes.len() == 1 && needs.poses.is_none()
}

/// Of many axes keeps those that are nearest to their limits, and all that are beyond. Returns the number of the others.
fn keep_the_nearest(lines: &mut Vec<Line>) -> usize {
    let mut axes: Vec<((usize, usize), f64)> = Vec::new();
    for line in lines.iter() {
        match axes.last_mut() {
            Some((axis, share)) if *axis == line.axis => *share = share.max(line.share),
            _ => axes.push((line.axis, line.share)),
        }
    }
    let [most, kept] = MOST_AXES;
    if axes.len() <= most {
        return 0;
    }
    axes.sort_by(|one, other| other.1.total_cmp(&one.1));
    let beyond = axes.iter().filter(|(_, share)| *share > 1.0).count();
    let left_out = axes.split_off(kept.max(beyond));
    lines.retain(|line| axes.iter().any(|(axis, _)| *axis == line.axis));
    left_out.len()
}

/// One line per quantity of every axis.
fn each_quantity(needs: &Needs, place: usize) -> Vec<Line> {
    let mut lines = Vec::new();
    for (axis, all) in needs.axes.iter().enumerate() {
        let prefix = prefix(needs, axis);
        let axis_of = (place, axis);
        lines.extend(all.iter().map(|need| Line::of(need, axis_of, &prefix)));
        for used in needs.used(axis) {
            let word = used.key.split('_').next().unwrap_or(used.key);
            lines.push(Line {
                axis: axis_of,
                what: format!("{prefix}{word} of the rig"),
                needed: quantity(used.needed, used.unit),
                limit: quantity(used.capacity, used.unit),
                used: used_of_rig(&used),
                share: used.share(),
            });
        }
    }
    lines
}

/// Two lines per axis: motion and force, each with the limit that is used most.
fn grouped(needs: &Needs, place: usize) -> Vec<Line> {
    let groups = [
        ("motion", false, ["stroke_m", "velocity_m_per_s"]),
        ("force", true, ["force_n", "power_w"]),
    ];
    let mut lines = Vec::new();
    for (axis, all) in needs.axes.iter().enumerate() {
        for (word, of_force, keys) in groups {
            let group = all
                .iter()
                .filter(|need| need.quantity.is_of_force() == of_force);
            let shown = group.clone().filter(|need| is_usual(need.quantity));
            let shown: Vec<String> = shown.map(needed).collect();
            let of_limits = group.map(|need| (need.share(), limit(need), used(need)));
            let of_rig = needs.used(axis);
            let of_rig = of_rig.iter().filter(|used| keys.contains(&used.key));
            let of_rig = of_rig.map(|used| {
                let capacity = quantity(used.capacity, used.unit);
                (used.share(), format!("{capacity} (rig)"), used_of_rig(used))
            });
            let worst = of_limits
                .chain(of_rig)
                .reduce(|one, other| if other.0 > one.0 { other } else { one });
            let (share, limit, used) = worst.unwrap_or_default();
            lines.push(Line {
                axis: (place, axis),
                what: format!("{}{word}", prefix(needs, axis)),
                needed: shown.join(", "),
                limit,
                used,
                share,
            });
        }
    }
    lines
}

fn platform(poses: &Poses, all_of_it: bool) -> String {
    let each = poses.range.iter().map(|(coordinate, low, high)| {
        let range = quantity_range(*low, *high, coordinate.unit());
        format!("{} {range}", coordinate.key())
    });
    let each: Vec<String> = each.collect();
    let [at_rest, worst] = poses.condition;
    let mut condition = format!("condition {} at worst", number(worst.max(at_rest)));
    if all_of_it && worst > at_rest {
        let at_rest = number(at_rest);
        condition += &format!(", at {}; {at_rest} at the reference pose", poses.worst);
    }
    format!("{}; {condition}", each.join(", "))
}

/// The stand-in in words; `all_of_it`: also the reason for it and the power that each axis needs.
fn stand_in(needs: &Needs, all_of_it: bool) -> String {
    let words = needs.stand_in.words();
    if needs.stand_in == StandIn::Nothing {
        return words.to_owned();
    }
    if !all_of_it {
        return words.split(',').next().unwrap_or(words).to_owned();
    }
    let each = needs.found.iter();
    let each: Vec<String> = each.map(|found| quantity(found.power.high, "W")).collect();
    format!("{words}; power up to {}", each.join(", "))
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
const fn name(quantity: Limit) -> &'static str {
    match quantity {
        Limit::CommandStep => "command step per tick",
        Limit::ForceStep => "measured force step",
        Limit::SensorDisp => "displacement sensor",
        Limit::SensorForce => "load cell",
        other => other.words(),
    }
}

/// The quantities that are shown whether or not they have a limit.
const fn is_usual(quantity: Limit) -> bool {
    matches!(
        quantity,
        Limit::CommandDisp | Limit::CommandVel | Limit::CommandAccel | Limit::MeasuredForce
    )
}

fn needed(need: &Need) -> String {
    let unit = need.quantity.shown_unit();
    if need.quantity.is_range() {
        quantity_range(need.needed.low, need.needed.high, unit)
    } else {
        quantity(need.needed.high, unit)
    }
}

/// The trip levels, or the warning levels of a quantity that only warns.
fn limit(need: &Need) -> String {
    let unit = need.quantity.shown_unit();
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

fn used_of_rig(used: &Used) -> String {
    let word = if used.is_within() { "" } else { " TOO MUCH" };
    format!("{}{word}", per_cent(used.share()))
}

/// Rounded up, so that a share beyond 100 % never reads 100 %.
fn per_cent(share: f64) -> String {
    format!("{:.0} %", (100.0 * share - 1e-9).ceil().abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(axis: usize, share: f64) -> Line {
        Line {
            axis: (0, axis),
            what: String::new(),
            needed: String::new(),
            limit: String::new(),
            used: String::new(),
            share,
        }
    }

    #[test]
    fn axes_nearest_to_their_limits_are_kept() {
        let mut few: Vec<Line> = (0..6).map(|axis| line(axis, 0.1)).collect();
        assert_eq!((keep_the_nearest(&mut few), few.len()), (0, 6));
        let shares = [0.1, 0.9, 0.2, 0.8, 0.3, 0.7, 0.6, 0.0];
        let lines = |shares: &[f64]| -> Vec<Line> {
            let lines = shares.iter().enumerate();
            lines
                .flat_map(|(axis, share)| [line(axis, *share), line(axis, 0.05)])
                .collect()
        };
        let mut many = lines(&shares);
        assert_eq!(keep_the_nearest(&mut many), 4);
        let kept: Vec<usize> = many.iter().map(|line| line.axis.1).collect();
        assert_eq!(kept, [1, 1, 3, 3, 5, 5, 6, 6]);
        let mut beyond = lines(&[2.0; 8]);
        assert_eq!((keep_the_nearest(&mut beyond), beyond.len()), (0, 16));
    }

    #[test]
    fn shares_are_rounded_up() {
        assert_eq!(per_cent(0.5), "50 %");
        assert_eq!(per_cent(1.0001), "101 %");
        assert_eq!(per_cent(0.0), "0 %");
    }
}
