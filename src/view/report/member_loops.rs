//! Loops of the members of a frame that are recorded: moments over the rotations of both ends, or the force of a link over its
//! deformation.

use maud::{Markup, html};

use super::RunView;
use super::axis::extent;
use super::chart::{Chart, Look, Scale};
use super::digest::Digest;
use super::farthest::frame;
use super::loop_line::{Loop, Points};
use gusset_quantity::catalog::column::{
    END_MOMENT, END_ROTATION, Kind, MEMBER_FORCE, MEMBER_FORCE_Y, START_MOMENT, START_ROTATION,
    STRETCH, STRETCH_Y, TORQUE, WEAK_END_MOMENT, WEAK_END_ROTATION, WEAK_START_MOMENT,
    WEAK_START_ROTATION,
};

/// Members that are drawn.
const MOST_DRAWN: usize = 8;

/// Lines of a chart: their names, and what they are made of.
type Lines = &'static [(&'static str, Kind, Kind)];

const OF_ENDS: Lines = &[
    ("start", START_ROTATION, START_MOMENT),
    ("end", END_ROTATION, END_MOMENT),
];
const IN_SPACE: Lines = &[
    ("start", START_ROTATION, START_MOMENT),
    ("end", END_ROTATION, END_MOMENT),
    ("start, weak", WEAK_START_ROTATION, WEAK_START_MOMENT),
    ("end, weak", WEAK_END_ROTATION, WEAK_END_MOMENT),
];
const OF_LINK: Lines = &[("", STRETCH, MEMBER_FORCE)];
const OF_BEARING: Lines = &[
    ("x", STRETCH, MEMBER_FORCE),
    ("y", STRETCH_Y, MEMBER_FORCE_Y),
];

/// A chart for each of them.
pub(super) fn figures(run: &RunView, rows: &Digest) -> Markup {
    let Some(spec) = frame(&run.test.file) else {
        return html! {};
    };
    let numbers = rows.table.names().filter_map(|name| {
        let number = name.strip_prefix(STRETCH.stem)?.strip_prefix('_')?;
        number.parse::<usize>().ok()
    });
    let drawn = numbers.take(MOST_DRAWN).map(|number| {
        let column = |kind: &Kind| kind.of_specimen(number);
        let values = |kind: &Kind| rows.get(&column(kind)).unwrap_or_default();
        let bends = rows.get(&column(&START_MOMENT)).is_some();
        let (of, [across, up]) = match bends {
            true if rows.get(&column(&TORQUE)).is_some() => {
                (IN_SPACE, ["rotation from the chord", "moment"])
            }
            true => (OF_ENDS, ["rotation from the chord", "moment"]),
            false if rows.get(&column(&STRETCH_Y)).is_some() => {
                (OF_BEARING, ["deformation", "force"])
            }
            false => (OF_LINK, ["deformation", "force"]),
        };
        let name = spec.name_of(number);
        let lines = of.iter();
        let lines = lines.map(|(end, x, y)| (*end, loop_of(values(x), values(y))));
        let lines: Vec<(&str, Points)> = lines.collect();
        let unit = |kind: Option<&Kind>| kind.map_or("1", |kind| rows.table.unit(&column(kind)));
        let first = of.first();
        let chart = Chart::new(
            format!("Loops of {name}"),
            Scale::new(across, unit(first.map(|(_, x, _)| x))),
            Scale::new(up, unit(first.map(|(_, _, y)| y))),
        );
        let chart = chart.labelled(format!("{name}: {up} against {across}"));
        let all = lines.iter();
        let chart = all.fold(chart, |chart, (end, (x, y))| {
            chart.with(*end, x, y, Look::Line)
        });
        chart.figure()
    });
    html! { @for figure in drawn { (figure) } }
}

/// A loop without points whose omission is invisible.
fn loop_of(x: &[f64], y: &[f64]) -> Points {
    let mut line = Loop::new(extent(x.iter().copied()), extent(y.iter().copied()));
    x.iter().zip(y).for_each(|(x, y)| line.take(*x, *y));
    line.finish()
}
