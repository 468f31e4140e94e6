//! The picture of a frame: its undeformed shape, its deformed shape at the largest drift, and the members that yielded.

use maud::{Markup, html};

use super::RunView;
use super::chart::{
    Anchor, Area, Canvas, HALF, Ink, LABEL, Lettering, fitted, page_picture, text_width,
};
use super::digest::Digest;
use super::farthest::{Farthest, frame, moved};
use super::sketch::hatch;
use super::text::{count, quantity};
use gusset_numerics::frame::{Direction, FrameModel, FrameSpec, MemberEnd, MemberSpec};
use gusset_record::summary::MemberDemand;

/// Room at the sides, for the title and for a legend, and above and below the shapes; height of the shapes at most.
const SIDE: f64 = 36.0;
const ROW: f64 = 20.0;
const AIR: f64 = 26.0;
const TALLEST: f64 = 400.0;
/// From the end of a member to the mark of its hinge or of its yielding.
const INSET: f64 = 8.0;
/// Demands up to which a yielded end has a colour, and its radius.
const YIELDED: [(&str, f64, Ink, f64); 3] = [
    ("yielded: demand 1 to 2", 2.0, Ink::Series(4), 4.0),
    ("2 to 4", 4.0, Ink::Series(1), 5.0),
    ("above 4", f64::INFINITY, Ink::Alarm, 6.0),
];
const ENDS: [MemberEnd; 2] = [MemberEnd::Start, MemberEnd::End];

type Point = [f64; 2];

/// Place of a node, and its displacements and rotation as drawn.
#[derive(Debug, Clone, Copy, Default)]
struct Node {
    at: Point,
    disp: [f64; 3],
}

impl Node {
    fn place(&self) -> Point {
        [0, 1].map(|d| self.at[d] + self.disp[d])
    }
}

/// A member from its first node to its second: rigid offset, Bézier curve, rigid offset.
///
/// A member of Bernoulli and Euler without a load along it is a cubic. The inner points of its Bézier curve are a third of the end
/// derivatives away from its ends.
#[derive(Debug, Clone, Copy)]
struct Shape([Point; 6]);

/// Where the picture shows a place: of space the x–z plane, with y behind it.
fn seen(at: &[f64]) -> Point {
    let [x, y, z] = [0, 1, 2].map(|k| at.get(k).copied().unwrap_or(0.0));
    match at.len() {
        3 => [x + 0.45 * y, z + 0.3 * y],
        _ => [x, y],
    }
}

impl Shape {
    /// A member in space is drawn straight.
    fn straight(member: &MemberSpec, nodes: [Node; 2]) -> Self {
        let [first, second] = nodes.map(|node| node.place());
        let offsets = [&member.offset_start_m, &member.offset_end_m].map(|of| seen(of));
        let [start, end] = [(first, offsets[0]), (second, offsets[1])]
            .map(|(at, by)| [0, 1].map(|d| at[d] + by[d]));
        let part = |share: f64| [0, 1].map(|d| start[d] + share * (end[d] - start[d]));
        Self([first, start, part(1.0 / 3.0), part(2.0 / 3.0), end, second])
    }

    fn of(member: &MemberSpec, nodes: [Node; 2]) -> Self {
        let offsets = [&member.offset_start_m, &member.offset_end_m].map(|of| seen(of));
        let [(from, start), (to, end)] = [0, 1].map(|k| {
            let (Node { at, disp }, [ox, oy]) = (nodes[k], offsets[k]);
            let moved = [disp[0] - oy * disp[2], disp[1] + ox * disp[2]];
            ([at[0] + ox, at[1] + oy], moved)
        });
        let (cx, cy) = (to[0] - from[0], to[1] - from[1]);
        let (dx, dy) = (end[0] - start[0], end[1] - start[1]);
        let square = cx * cx + cy * cy;
        let stretch = 1.0 + (cx * dx + cy * dy) / square;
        // Rotation of the chord. A hinge turns so that it bears no moment: 4 θ + 2 θ' = 6 ψ.
        let chord = (cx * dy - cy * dx) / square;
        let hinged = |other: f64| 1.5 * chord - 0.5 * other;
        let [first, second] = nodes.map(|node| node.disp[2]);
        let turns = match ENDS.map(|end| member.release.contains(&end)) {
            [false, false] => [first, second],
            [true, false] => [hinged(second), second],
            [false, true] => [first, hinged(first)],
            [true, true] => [chord; 2],
        };
        let inner = |turn: f64| [stretch * cx - turn * cy, stretch * cy + turn * cx];
        let plus = |a: Point, factor: f64, b: Point| [0, 1].map(|d| a[d] + factor * b[d]);
        let (start, end) = (plus(from, 1.0, start), plus(to, 1.0, end));
        let a = plus(start, 1.0 / 3.0, inner(turns[0]));
        let b = plus(end, -1.0 / 3.0, inner(turns[1]));
        let [first, second] = nodes.map(|node| node.place());
        Self([first, start, a, b, end, second])
    }

    /// Point of the curve at a share of its length.
    fn at(&self, share: f64) -> Point {
        let (a, b) = (1.0 - share, share);
        let weights = [a * a * a, 3.0 * a * a * b, 3.0 * a * b * b, b * b * b];
        let points = || self.0[1..5].iter().zip(weights);
        [0, 1].map(|d| points().map(|(point, weight)| weight * point[d]).sum())
    }

    /// Point of the curve at a distance from one end.
    fn near(&self, end: MemberEnd, distance: f64) -> Point {
        let [_, [x, y], .., [u, v], _] = self.0;
        let share = (distance / libm::hypot(u - x, v - y)).min(0.25);
        self.at(match end {
            MemberEnd::Start => share,
            MemberEnd::End => 1.0 - share,
        })
    }
}

/// A frame as drawn: nodes and members in the order of the test file.
struct Drawn {
    nodes: Vec<Node>,
    shapes: Vec<Shape>,
}

impl Drawn {
    /// With displacements times a factor. The model has found the nodes of all members.
    fn of(spec: &FrameSpec, model: &FrameModel, disp: &[f64], factor: f64) -> Self {
        let nodes = spec.node.iter().map(|node| {
            let motion = |of| model.motion(&node.name, of).unwrap_or_default();
            let moves = Direction::ALL.map(|of| factor * moved(motion(of), disp));
            let [x, y, z, .., turn] = moves;
            let [across, up] = match spec.dimension {
                3 => seen(&[x, y, z]),
                _ => [x, y],
            };
            Node {
                at: seen(&node.at_m),
                disp: [across, up, turn],
            }
        });
        let nodes: Vec<Node> = nodes.collect();
        let place = |name: &String| spec.node.iter().position(|node| node.name == *name);
        let node = |name: &String| place(name).map(|at| nodes[at]).unwrap_or_default();
        let members = spec.member.iter();
        let shape = match spec.dimension {
            3 => Shape::straight,
            _ => Shape::of,
        };
        let shapes = members.map(|member| shape(member, member.nodes.each_ref().map(node)));
        Self {
            shapes: shapes.collect(),
            nodes,
        }
    }

    /// Lower left and upper right corner, those of another drawing included.
    fn corners(&self, other: Option<&Self>) -> [Point; 2] {
        let both = std::iter::once(self).chain(other);
        let points = both.flat_map(|drawn| {
            let nodes = drawn.nodes.iter().map(Node::place);
            nodes.chain(drawn.shapes.iter().flat_map(|shape| shape.0))
        });
        let none = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        points.fold(none, |[lo, hi], at| {
            [
                [0, 1].map(|d| lo[d].min(at[d])),
                [0, 1].map(|d| hi[d].max(at[d])),
            ]
        })
    }
}

/// 1, 2, 5, 10, 20, 50 … times: a displacement becomes a tenth of the size of the frame at most. `None` for one that is roundoff,
/// or larger than the frame.
fn magnification(size: f64, disp: f64) -> Option<f64> {
    let most = 0.1 * size / disp;
    if !(0.1..=1e9).contains(&most) {
        return None;
    }
    let steps = [2.0, 2.5, 2.0].into_iter().cycle();
    let factors = steps.scan(1.0, |factor, step| {
        *factor *= step;
        Some(*factor)
    });
    let fitting = factors.take_while(|factor| *factor <= most);
    Some(fitting.last().unwrap_or(1.0))
}

/// The deformed shape with its displacements and its magnification, or the reason why it is missing.
fn deformed<'a>(
    spec: &FrameSpec,
    model: &FrameModel,
    size: f64,
    rows: &'a Digest,
) -> Result<(Drawn, &'a Farthest, f64), String> {
    let Some(most) = &rows.farthest else {
        let why = match rows.passed.ends {
            0 => "no row was recorded while the test was running",
            _ => "the rows lack displacements. `record.dofs = \"all\"` records those of all DOFs",
        };
        return Err(why.to_owned());
    };
    let real = Drawn::of(spec, model, &most.disp, 1.0).nodes;
    let moves = real
        .iter()
        .map(|node| libm::hypot(node.disp[0], node.disp[1]));
    let largest = moves.fold(0.0, f64::max);
    let factor = magnification(size, largest);
    let factor =
        factor.ok_or_else(|| format!("the largest displacement is {}", quantity(largest, "m")))?;
    Ok((Drawn::of(spec, model, &most.disp, factor), most, factor))
}

/// The picture with its caption; `None` for another structure.
pub(super) fn figure(run: &RunView, rows: &Digest) -> Option<Markup> {
    let spec = frame(&run.test.file)?;
    let model = spec.model().ok()?;
    let still = Drawn::of(spec, &model, &vec![0.0; model.dofs.len()], 1.0);
    let [lo, hi] = still.corners(None);
    let size = (hi[0] - lo[0]).max(hi[1] - lo[1]);
    let deformed = deformed(spec, &model, size, rows);
    let (title, says) = match &deformed {
        Ok((_, most, factor)) => {
            let what = match most.direction {
                sideways if sideways != spec.upwards() => "the largest drift",
                _ => "the largest displacement",
            };
            let says = format!(
                "At {} node {} has {what}: {} in {}. Displacements are {}.",
                rows.moment(most.time),
                most.node,
                quantity(most.value, "m"),
                most.direction.word(),
                match *factor as u64 {
                    1 => "not magnified".to_owned(),
                    factor => format!("magnified {} times", count(factor)),
                }
            );
            (format!("Frame at {what}"), says)
        }
        Err(why) => {
            let says = format!("The deformed shape is missing: {why}.");
            ("Frame".to_owned(), says)
        }
    };
    let summary = run.summary.as_ref();
    let demands = summary.map_or(&[][..], |summary| &summary.members);
    let deformed = deformed.as_ref().ok();
    let deformed = deformed.map(|(drawn, most, _)| (drawn, *most));
    let picture = picture(spec, &title, &still, deformed, demands);
    let grey = "Grey: the undeformed frame, with dots for masses and open circles for hinges.";
    Some(html! { figure { (picture) figcaption { (says) " " (grey) } } })
}

/// Places of the ends of members that yielded, with colours and radii of their demands.
fn yielded(
    spec: &FrameSpec,
    drawn: &Drawn,
    demands: &[MemberDemand],
    inset: f64,
) -> Vec<(Point, Ink, f64)> {
    let mut found = Vec::new();
    for ((member, shape), number) in spec.member.iter().zip(&drawn.shapes).zip(1..) {
        let name = member.name.clone();
        let name = name.unwrap_or_else(|| format!("member {number}"));
        let own = demands.iter().find(|one| one.name == name);
        let demands = own.map_or([None; 2], |own| own.demand);
        for (end, demand) in ENDS.into_iter().zip(demands) {
            let demand = demand.filter(|demand| *demand >= 1.0);
            let band = demand.and_then(|demand| YIELDED.iter().find(|band| demand <= band.1));
            found.extend(band.map(|band| (shape.near(end, inset), band.2, band.3)));
        }
    }
    found
}

fn picture(
    spec: &FrameSpec,
    title: &str,
    still: &Drawn,
    deformed: Option<(&Drawn, &Farthest)>,
    demands: &[MemberDemand],
) -> Markup {
    let moved = deformed.map(|(drawn, _)| drawn);
    let [lo, hi] = still.corners(moved);
    let (w, h) = (hi[0] - lo[0], hi[1] - lo[1]);
    // Equal in both directions. Nodes in one point have no size.
    let scale = ((HALF - 2.0 * SIDE) / w).min(TALLEST / h);
    let scale = if scale.is_finite() { scale } else { 1.0 };
    let inset = INSET / scale;
    let yielded = yielded(spec, moved.unwrap_or(still), demands, inset);
    let head = AIR + ROW * if yielded.is_empty() { 1.0 } else { 2.0 };
    let left = (HALF - scale * w) / 2.0;
    let place = |[x, y]: Point| (left + scale * (x - lo[0]), head + scale * (hi[1] - y));
    let height = (head + scale * h + AIR).round();
    page_picture(HALF, height, title, |canvas| {
        canvas.title(Area::whole(HALF, height), title, HALF);
        let shapes = |drawn: &Drawn| {
            let shapes = drawn.shapes.iter().map(|shape| shape.0.map(place));
            shapes.collect::<Vec<_>>()
        };
        for node in &spec.node {
            let up = spec.upwards();
            support(canvas, place(seen(&node.at_m)), (&node.fixed, up));
        }
        canvas.members(&shapes(still), Ink::Frame, 1.5);
        for (member, shape) in spec.member.iter().zip(&still.shapes) {
            for end in &member.release {
                canvas.circle(place(shape.near(*end, inset)), 3.5, Ink::Frame, false);
            }
        }
        for node in spec.node.iter().filter(|node| node.mass_kg > 0.0) {
            canvas.circle(place(seen(&node.at_m)), 3.5, Ink::Frame, true);
        }
        if let Some((drawn, most)) = deformed {
            canvas.members(&shapes(drawn), Ink::Series(0), 2.2);
            let names = spec.node.iter().zip(&drawn.nodes);
            for (_, node) in names.filter(|(node, _)| node.name == most.node) {
                let (x, y) = place(node.place());
                canvas.circle((x, y), 4.5, Ink::Series(0), true);
                let words = fitted(&most.node, LABEL, 2.0 * SIDE);
                let style = Lettering::new(Ink::Text).bold().anchored(Anchor::Middle);
                canvas.open("names");
                canvas.text(&words, (x, y - 15.0), style);
                canvas.close();
            }
        }
        for (at, ink, radius) in &yielded {
            canvas.circle(place(*at), *radius, *ink, true);
        }
        let (mut x, y) = (8.0, ROW + 10.0);
        for (words, _, ink, radius) in YIELDED.iter().filter(|_| !yielded.is_empty()) {
            canvas.circle((x, y), *radius, *ink, true);
            canvas.text(words, (x + 11.0, y), Lettering::new(Ink::Soft));
            x += 30.0 + text_width(words, LABEL);
        }
    })
}

/// Ground where all directions are fixed. Else a triangle, with a line beside it where the node slides, and a square where it does
/// not turn.
fn support(canvas: &mut Canvas, (x, y): (f64, f64), (fixed, up): (&[Direction], Direction)) {
    let across = fixed.contains(&Direction::X);
    let up = fixed.contains(&up);
    let turn = fixed.iter().any(|one| one.turns());
    if across && up && turn {
        return hatch(canvas, x - 10.0, x + 10.0, y);
    }
    let outward = if x > HALF / 2.0 { 1.0 } else { -1.0 };
    let at = |(away, side): (f64, f64)| match up {
        true => (x + side, y + away),
        false => (x + outward * away, y + side),
    };
    let triangle = [(0.0, 0.0), (10.0, -6.0), (10.0, 6.0), (0.0, 0.0)];
    let slide = [(14.0, -6.0), (14.0, 6.0)];
    let square = [
        (-5.0, -5.0),
        (5.0, -5.0),
        (5.0, 5.0),
        (-5.0, 5.0),
        (-5.0, -5.0),
    ];
    let lines = [
        (across || up, &triangle[..]),
        (across != up, &slide),
        (turn, &square),
    ];
    for (_, points) in lines.into_iter().filter(|(is_drawn, _)| *is_drawn) {
        for pair in points.windows(2) {
            canvas.line(at(pair[0]), at(pair[1]), Ink::Text, 1.5);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANGLE: f64 = 0.7;
    const L: f64 = 3.0;

    /// A member that leans by an angle, with these releases and displacements across and rotations at its ends. Returns its
    /// deflection across at a share of its length.
    fn bent(release: &str, across: [f64; 2], turns: [f64; 2]) -> impl Fn(f64) -> f64 {
        let text = format!("nodes = [\"a\", \"b\"]\nsection = \"s\"\nrelease = [{release}]");
        let member: MemberSpec = toml::from_str(&text).unwrap();
        let (c, s) = (libm::cos(ANGLE), libm::sin(ANGLE));
        let node = |k: usize| Node {
            at: [1.0 + k as f64 * L * c, 2.0 + k as f64 * L * s],
            disp: [-s * across[k], c * across[k], turns[k]],
        };
        let shape = Shape::of(&member, [node(0), node(1)]);
        let [first, start, .., end, second] = shape.0;
        assert_eq!((first, second), (start, end));
        move |share| {
            let [x, y] = shape.at(share);
            let (x, y) = (x - 1.0, y - 2.0);
            assert!((x * c + y * s - share * L).abs() < 1e-12, "along");
            y * c - x * s
        }
    }

    /// An end moment M bends a cantilever by M x²/(2 E I).
    #[test]
    fn cantilever_has_its_closed_form() {
        let turn = 0.02;
        let at = bent("", [0.0, turn * L / 2.0], [0.0, turn]);
        for share in [0.0, 0.25, 0.5, 1.0] {
            let expected = turn * L * share * share / 2.0;
            assert!((at(share) - expected).abs() < 1e-12, "{share}");
        }
    }

    /// A beam with a hinge, whose other end is turned by θ, bends by θ (x³/L² − x)/2 from the hinge.
    #[test]
    fn hinged_end_bears_no_moment() {
        let turn = 0.02;
        let form = |share: f64| turn * L * (share * share * share - share) / 2.0;
        let start = bent("\"start\"", [0.0; 2], [9.0, turn]);
        let end = bent("\"end\"", [0.0; 2], [turn, 9.0]);
        let both = bent("\"start\", \"end\"", [0.1, 0.3], [9.0; 2]);
        for share in [0.0, 0.25, 0.5, 1.0] {
            assert!((start(share) - form(share)).abs() < 1e-12, "{share}");
            assert!((end(share) + form(1.0 - share)).abs() < 1e-12, "{share}");
            assert!((both(share) - 0.1 - 0.2 * share).abs() < 1e-12, "{share}");
        }
    }

    #[test]
    fn offsets_turn_with_their_nodes() {
        let text = "nodes = [\"a\", \"b\"]\nsection = \"s\"\noffset_start_m = [0.5, 0.25]";
        let member: MemberSpec = toml::from_str(text).unwrap();
        let still = Node {
            at: [4.0, 0.0],
            disp: [0.0; 3],
        };
        let turned = Node {
            at: [0.0, 0.0],
            disp: [0.125, 0.0, 0.25],
        };
        let shape = Shape::of(&member, [turned, still]);
        let end = [0.5 + 0.125 - 0.25 * 0.25, 0.25 + 0.5 * 0.25];
        assert_eq!((shape.0[0], shape.0[5]), ([0.125, 0.0], [4.0, 0.0]));
        assert_eq!((shape.at(0.0), shape.at(1.0)), (end, [4.0, 0.0]));
    }

    #[test]
    fn magnification_is_round() {
        for (disp, factor) in [
            (9.0, Some(1.0)),
            (0.6, Some(1.0)),
            (0.5, Some(2.0)),
            (0.2, Some(5.0)),
            (0.0819, Some(10.0)),
            (0.049, Some(20.0)),
            (1e-3, Some(1000.0)),
            (11.0, None),
            (0.0, None),
            (1e-12, None),
            (f64::NAN, None),
        ] {
            assert_eq!(magnification(10.0, disp), factor, "{disp}");
        }
    }
}
