//! Charts: data in, SVG out. The only drawing code of all pages and pictures.
//!
//! A [`Chart`] is two axes and layers over them. [`Chart::figure`] gives markup for a page, whose style sheet has the colours for
//! light, dark and paper; [`Chart::svg`] gives a separate picture for any background. The lines of a chart are in a nested
//! `svg` in whole units, with the ends of both axes beside them: the page's script computes values back, zooms by its `viewBox`,
//! and writes CSV. Without a script the page shows everything.
//!
//! Data that cannot be drawn leave a sentence in the chart, never an empty frame and never a panic.

use std::borrow::Cow;
use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};
use serde_json::json;

use super::axis::{Axis, Tick, decade, extent, is_drawable};
use super::text::{exact, printable, scaled, shortened};
use super::thin;

/// Width of a chart over the whole page, and of one of two side by side, in display units.
pub(super) const WHOLE: f64 = 1040.0;
pub(super) const HALF: f64 = 510.0;
/// Size of titles, and of numbers and labels.
const TITLE: f64 = 14.0;
pub(super) const LABEL: f64 = 12.0;
/// Height of the title's line, of tick labels with the name of the axis below them, and of a row of a legend or of marks.
const HEAD: f64 = 30.0;
const FOOT: f64 = 40.0;
const ROW: f64 = 17.0;
/// Whole units of a line per display unit, across and up: a page keeps times exact, a picture scales alike both ways.
const OF_PAGE: (f64, f64) = (1000.0, 100.0);
const OF_PICTURE: (f64, f64) = (50.0, 50.0);
/// Further outside than this many times the range nothing is drawn: a diverging curve must not hide the others.
const FAR: f64 = 2.0;
/// A level is drawn up to this many times the largest value.
const REACH: f64 = 1.6;
/// Colours of a picture, readable on white and on near-black. Series: Okabe and Ito (2008), safe for colour-blind readers.
const COLOURS: [(&str, &str); 11] = [
    ("text", "#7b8490"),
    ("soft", "#838c98"),
    ("grid", "#8b949e;stroke-opacity:.22"),
    ("frame", "#8b949e"),
    ("alarm", "#e5484d"),
    ("s0", "#0072b2"),
    ("s1", "#d55e00"),
    ("s2", "#009e73"),
    ("s3", "#cc79a7"),
    ("s4", "#e69f00"),
    ("s5", "#56b4e9"),
];

/// Purpose of a colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ink {
    /// Titles and references.
    Text,
    /// Numbers and names.
    Soft,
    /// Grid lines.
    Grid,
    /// Axis lines.
    Frame,
    /// Failures.
    Alarm,
    /// A series, from 0.
    Series(usize),
}

impl Ink {
    const fn name(self) -> &'static str {
        COLOURS[match self {
            Self::Text => 0,
            Self::Soft => 1,
            Self::Grid => 2,
            Self::Frame => 3,
            Self::Alarm => 4,
            Self::Series(i) => 5 + i % 6,
        }]
        .0
    }
}

/// Look of a layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// A line in the next colour.
    Line,
    /// A thick line in the next colour.
    Strong,
    /// A thick dashed line in the next colour.
    Dashed,
    /// Points in the next colour.
    Dots,
    /// Bars in the next colour: a bar of height y reaches from its x to the next.
    Bars,
    /// One of many lines: thin and grey.
    Faint,
    /// The reference of the other lines: in the colour of text, dashed.
    Reference,
}

impl Look {
    const fn width(self) -> f64 {
        match self {
            Self::Line => 1.3,
            Self::Strong => 3.0,
            Self::Dashed => 2.5,
            Self::Dots => 5.0,
            Self::Bars => 0.0,
            Self::Faint => 1.2,
            Self::Reference => 1.5,
        }
    }
}

/// How the numbers of an axis are spaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Spacing {
    Linear,
    Log,
    /// Logarithmic, each number with its own prefix and unit.
    Written,
}

/// One axis: its quantity, its unit ("1" for a pure number), and its range.
#[derive(Debug, Clone, Copy)]
pub struct Scale<'a> {
    words: &'a str,
    unit: &'a str,
    range: Option<(f64, f64)>,
    spacing: Spacing,
}

impl<'a> Scale<'a> {
    /// A linear axis as far as the data reach.
    #[must_use]
    pub const fn new(words: &'a str, unit: &'a str) -> Self {
        Self {
            words,
            unit,
            range: None,
            spacing: Spacing::Linear,
        }
    }

    /// From `lo` to `hi`, in the plain unit.
    #[must_use]
    pub const fn within(mut self, range: Option<(f64, f64)>) -> Self {
        self.range = range;
        self
    }

    /// Logarithmic.
    #[must_use]
    pub const fn log(mut self) -> Self {
        self.spacing = Spacing::Log;
        self
    }

    /// Logarithmic; each number carries its own prefix and unit.
    pub(super) const fn written(mut self) -> Self {
        self.spacing = Spacing::Written;
        self
    }

    fn axis(&self, values: impl Iterator<Item = f64>, is_tight: bool) -> Option<Axis> {
        match (self.range, self.spacing) {
            (Some((lo, hi)), Spacing::Linear) => Axis::exactly(lo, hi),
            (Some((lo, hi)), _) => Axis::logarithmic(lo, hi),
            (None, Spacing::Linear) if is_tight => {
                extent(values).and_then(|(lo, hi)| Axis::exactly(lo, hi))
            }
            (None, Spacing::Linear) => Axis::around(values),
            (None, _) => Axis::logarithmic_around(values),
        }
    }

    /// Ticks, name with unit, unit alone and divisor; `about` ticks.
    fn labelled(&self, axis: &Axis, about: f64, takes_prefix: bool) -> Labels {
        let size = axis.lo().abs().max(axis.hi().abs());
        let has_prefix = takes_prefix && self.range.is_none() && self.spacing == Spacing::Linear;
        let unit = scaled(if has_prefix { size } else { 1.0 }, self.unit);
        let name = match (self.spacing, self.unit, unit.unit.as_str()) {
            (Spacing::Written, ..) => self.words.to_owned(),
            (_, "1", _) => format!("{} (–)", self.words),
            (_, _, "") => self.words.to_owned(),
            (_, _, unit) => format!("{} ({unit})", self.words),
        };
        let ticks = match self.spacing {
            // Counts and numbers of storeys have no fractions.
            Spacing::Linear if self.unit.is_empty() => {
                axis.ticks(about.min(axis.hi() - axis.lo()) as usize, 1.0)
            }
            Spacing::Linear => axis.ticks(about as usize, unit.factor),
            Spacing::Log => axis.decades(decade),
            Spacing::Written => axis.decades(|digit, power| {
                let at = f64::from(digit) * libm::pow(10.0, f64::from(power));
                exact(at, self.unit).trim_end().to_owned()
            }),
        };
        Labels {
            ticks,
            name,
            unit: unit.unit,
            factor: unit.factor,
        }
    }

    /// The axis for the script: ends, spacing, words, unit and divisor.
    fn told(&self, axis: &Axis, labels: &Labels) -> String {
        let is_log = self.spacing != Spacing::Linear;
        json!([
            axis.lo(),
            axis.hi(),
            is_log,
            self.words,
            labels.unit,
            labels.factor
        ])
        .to_string()
    }
}

struct Labels {
    ticks: Vec<Tick>,
    name: String,
    unit: String,
    factor: f64,
}

/// Numbers of a layer.
type Values<'a> = Cow<'a, [f64]>;

#[derive(Debug, Clone)]
struct Layer<'a> {
    name: Cow<'a, str>,
    x: Values<'a>,
    y: Values<'a>,
    look: Look,
    ink: Ink,
    is_dashed: bool,
}

impl Layer<'_> {
    fn all(&self) -> impl Iterator<Item = (f64, f64)> {
        self.x.iter().copied().zip(self.y.iter().copied())
    }

    fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.all()
            .filter(|(x, y)| is_drawable(*x) && is_drawable(*y))
    }

    fn peak(&self) -> f64 {
        self.points().fold(0.0, |peak, (_, y)| y.abs().max(peak))
    }
}

/// Layers over one pair of axes.
#[derive(Debug, Clone)]
pub struct Chart<'a> {
    title: Cow<'a, str>,
    label: Option<Cow<'a, str>>,
    across: Scale<'a>,
    up: Scale<'a>,
    size: (f64, f64),
    /// Wall time of a second of test time, s.
    slower: f64,
    is_history: bool,
    is_square: bool,
    coloured: usize,
    layers: Vec<Layer<'a>>,
    /// Level lines with their names.
    levels: Vec<(String, f64)>,
    /// Upright lines with their names.
    marks: Vec<(String, f64, Ink)>,
    /// Short strokes at the upper edge.
    strokes: Vec<f64>,
}

impl<'a> Chart<'a> {
    /// An empty chart.
    pub fn new(title: impl Into<Cow<'a, str>>, across: Scale<'a>, up: Scale<'a>) -> Self {
        Self {
            title: title.into(),
            label: None,
            across,
            up,
            size: (HALF, 320.0),
            slower: 1.0,
            is_history: false,
            is_square: false,
            coloured: 0,
            layers: Vec::new(),
            levels: Vec::new(),
            marks: Vec::new(),
            strokes: Vec::new(),
        }
    }

    /// An empty chart of values over test time, as wide as the page. All of a page are zoomed together.
    pub(super) fn history(title: impl Into<Cow<'a, str>>, up: Scale<'a>) -> Self {
        Self {
            is_history: true,
            size: (WHOLE, 220.0),
            ..Self::new(title, Scale::new("test time", "s"), up)
        }
    }

    /// The axis of time tells that of the laboratory, too, where a second of the test takes `seconds` of it.
    #[must_use]
    pub(super) const fn slower(mut self, seconds: f64) -> Self {
        self.slower = seconds;
        self
    }

    /// Its size in display units.
    #[must_use]
    pub const fn sized(mut self, width: f64, height: f64) -> Self {
        self.size = (width, height);
        self
    }

    /// Half as wide as the page.
    #[must_use]
    pub(super) const fn half(self, height: f64) -> Self {
        self.sized(HALF, height)
    }

    /// Its text for screen readers; the title by default.
    #[must_use]
    pub(super) fn labelled(mut self, label: impl Into<Cow<'a, str>>) -> Self {
        self.label = Some(label.into());
        self
    }

    /// With a square frame.
    #[must_use]
    pub const fn square(mut self, is_square: bool) -> Self {
        self.is_square = is_square;
        self
    }

    /// With one more layer.
    #[must_use]
    pub fn with(
        mut self,
        name: impl Into<Cow<'a, str>>,
        x: impl Into<Values<'a>>,
        y: impl Into<Values<'a>>,
        look: Look,
    ) -> Self {
        let (ink, is_dashed) = match look {
            Look::Reference => (Ink::Text, true),
            Look::Faint => (Ink::Frame, false),
            // Six colours, then the same dashed.
            _ => (
                Ink::Series(self.coloured),
                self.coloured % 12 >= 6 || look == Look::Dashed,
            ),
        };
        self.coloured += usize::from(!matches!(look, Look::Reference | Look::Faint));
        self.layers.push(Layer {
            name: name.into(),
            x: x.into(),
            y: y.into(),
            look,
            ink,
            is_dashed,
        });
        self
    }

    /// With another colour of the last layer.
    #[must_use]
    pub(super) fn inked(mut self, ink: Ink) -> Self {
        if let Some(last) = self.layers.last_mut() {
            last.ink = ink;
        }
        self
    }

    /// With level lines, each with its name. A level far beyond all values is not drawn.
    #[must_use]
    pub(super) fn levels(mut self, levels: impl IntoIterator<Item = (String, f64)>) -> Self {
        self.levels.extend(levels);
        self
    }

    /// With upright lines, each with its name.
    #[must_use]
    pub(super) fn marks(mut self, marks: impl IntoIterator<Item = (String, f64, Ink)>) -> Self {
        self.marks.extend(marks);
        self
    }

    /// With red strokes at the upper edge.
    #[must_use]
    pub(super) fn strokes(mut self, at: Vec<f64>) -> Self {
        self.strokes = at;
        self
    }

    /// True if no layer has a point.
    pub(super) fn is_empty(&self) -> bool {
        self.layers
            .iter()
            .all(|layer| layer.points().next().is_none())
    }

    /// The chart in its frame, as a part of a page.
    #[must_use]
    pub fn figure(&self) -> Markup {
        html! { figure.history[self.is_history] { (self.inline()) } }
    }

    /// The chart as a part of a page, without a frame.
    #[must_use]
    pub fn inline(&self) -> Markup {
        let (width, height) = self.size;
        let label = self.label.as_ref().unwrap_or(&self.title);
        page_picture(width, height, label, |canvas| {
            self.draw(canvas, Area::whole(width, height));
        })
    }

    /// The chart as a separate picture.
    #[must_use]
    pub fn svg(&self) -> String {
        const EDGE: f64 = 12.0;
        let (w, h) = self.size;
        let (x, y) = (EDGE, EDGE);
        picture(w + 2.0 * EDGE, h + 2.0 * EDGE, &self.title, |canvas| {
            self.draw(canvas, Area { x, y, w, h });
        })
    }

    /// Draws the chart into `area`.
    pub(super) fn draw(&self, canvas: &mut Canvas, area: Area) {
        let points = || self.layers.iter().flat_map(Layer::points);
        let mut layers: Vec<_> = self.layers.iter().map(|l| (l.peak(), l)).collect();
        let peak = layers.iter().map(|layer| layer.0).fold(0.0, f64::max);
        let levels: Vec<_> = (self.levels.iter())
            .filter(|(_, at)| at.abs() <= REACH * peak)
            .collect();
        let heights = points()
            .map(|p| p.1)
            .chain(levels.iter().map(|level| level.1));
        let bars = self.layers.iter().filter(|layer| layer.look == Look::Bars);
        let edges = bars.filter_map(|layer| layer.x.last().copied());
        let widths = points().map(|p| p.0).chain(edges);
        let widths = widths.chain(self.marks.iter().filter(|_| !self.is_history).map(|m| m.1));
        let (x, y) = (
            self.across.axis(widths, self.is_history),
            self.up.axis(heights, false),
        );
        let (Some(x), Some(y)) = (x, y) else {
            return canvas.sentence(area, &self.title);
        };
        let area = self.headed(canvas, area, &levels);
        let columns = if self.is_history { 90.0 } else { 75.0 };
        let mut across =
            self.across
                .labelled(&x, (area.w / columns).clamp(3.0, 12.0), !self.is_history);
        if self.slower != 1.0 {
            let told = format!("; {} times as long in the laboratory", self.slower);
            across.name.push_str(&told);
        }
        let up = self
            .up
            .labelled(&y, ((area.h - 70.0) / 40.0).clamp(3.0, 8.0), true);
        let plot = Plot::frame(canvas, area, (x, &across), (y, &up), self.is_square);
        let (w, h) = (plot.inner.w, plot.inner.h);
        let told = [self.across.told(&x, &across), self.up.told(&y, &up)];
        if self.is_history {
            // The largest lies at the bottom, so that the smaller ones are seen.
            layers.sort_by(|a, b| b.0.total_cmp(&a.0));
        }
        let fine = canvas.fine();
        let (wide, high) = (whole(w * fine.0), whole(h * fine.1));
        // The strokes of a page do not scale.
        let size = if canvas.is_page { 1.0 } else { fine.1 };
        let marks: Vec<_> = self.marks.iter().filter(|mark| x.holds(mark.1)).collect();
        // Strokes at the upper edge, then the marks, each from its name downwards.
        let strokes = self.strokes.iter().filter(|at| x.holds(**at));
        let strokes = strokes.map(|at| (Ink::Alarm, 0.0, 9.0, *at));
        let marked = marks.iter().zip(0..).map(|((_, at, ink), row)| {
            let top = 2.0 + ROW * f64::from(row);
            (*ink, top, h - top, *at)
        });
        let mut upright: Vec<_> = strokes
            .chain(marked)
            .map(|(ink, from, to, at)| {
                (
                    ink,
                    whole(from * fine.1),
                    whole(to * fine.1),
                    whole(x.place(at) * w * fine.0),
                )
            })
            .collect();
        upright.dedup();
        canvas.add(html! {
            svg.lines x=(r(plot.inner.x)) y=(r(plot.inner.y)) width=(r(w)) height=(r(h)) preserveAspectRatio="none"
                viewBox={ "0 0 " (wide) " " (high) } data-x=(told[0]) data-y=(told[1]) {
                @for (name, at) in &levels {
                    path.l-alarm d={ "m0 " (whole(h * fine.1 * (1.0 - y.place(*at)))) "h" (wide) } data-level=(name) fill="none"
                        stroke-width=(size) stroke-dasharray={ (8.0 * size) " " (4.0 * size) } {}
                }
                @for (_, layer) in layers { (self.layer(layer, &plot, fine, size)) }
                @for (ink, from, to, d) in upright {
                    path class={ "l-" (ink.name()) } data-level="" fill="none" stroke-width=(size) d={ "m" (d) " " (from) "v" (to) } {}
                }
            }
        });
        canvas.open("names");
        for (row, (words, at, ink)) in marks.iter().enumerate() {
            let (at, top) = (plot.across(*at), plot.inner.y + 9.0 + ROW * row as f64);
            let fits = at + text_width(words, LABEL) + 8.0 < plot.inner.x + w;
            let ink = if *ink == Ink::Frame { Ink::Text } else { *ink };
            let (to, anchor) = if fits {
                (4.0, Anchor::Left)
            } else {
                (-4.0, Anchor::Right)
            };
            canvas.text(words, (at + to, top), Lettering::new(ink).anchored(anchor));
        }
        canvas.close();
    }

    /// One layer as a path in whole units, `fine` of them per display unit.
    fn layer(&self, layer: &Layer<'_>, plot: &Plot, fine: (f64, f64), size: f64) -> Markup {
        let room = FAR * (plot.y.hi() - plot.y.lo());
        let is_near = |y: f64| y >= plot.y.lo() - room && y <= plot.y.hi() + room;
        let is_log = self.up.spacing != Spacing::Linear;
        let (wide, high) = (plot.inner.w * fine.0, plot.inner.h * fine.1);
        let place = |(x, y): (f64, f64)| {
            let is_there = is_drawable(x) && is_drawable(y) && is_near(y) && !(is_log && y <= 0.0);
            let at = (wide * plot.x.share(x), high * (1.0 - plot.y.share(y)));
            is_there.then(|| (whole(at.0), whole(at.1)))
        };
        let points = match self.is_history && layer.look == Look::Line {
            true if is_log => thin::highest(&layer.x, &layer.y),
            true => thin::history(&layer.x, &layer.y),
            false => layer.all().collect(),
        };
        let places: Vec<Option<(i64, i64)>> = points.into_iter().map(place).collect();
        let first = places.iter().flatten().next();
        // A line of no length is not seen.
        let is_dots =
            layer.look == Look::Dots || places.iter().flatten().all(|at| Some(at) == first);
        let name = if layer.name.is_empty() {
            self.up.words
        } else {
            &*layer.name
        };
        let mut path = Path::default();
        if layer.look == Look::Bars {
            let bottom = whole(high * (1.0 - plot.y.place(0.0)));
            let gap = whole(0.6 * fine.0);
            let bars = layer.x.windows(2).zip(layer.y.iter());
            for (ends, y) in bars.filter(|(_, y)| **y > 0.0) {
                let ends = [ends[0], ends[1]].map(|x| place((x, *y)));
                let [Some((from, top)), Some((to, _))] = ends else {
                    continue;
                };
                let to = (to - gap).max(from + gap);
                let corners = [(from, bottom), (from, top), (to, top), (to, bottom)];
                corners.into_iter().for_each(|at| path.to(Some(at)));
                path.to(None);
            }
            let ink = format!("f-{}", layer.ink.name());
            return html! { path class=(ink) data-name=(name) data-bars="" fill-opacity=".75" d=(path.text) {} };
        }
        for at in places {
            path.to(at);
            if is_dots {
                path.dot();
            }
        }
        let width = match is_dots {
            // Many dots are a cloud, few are marks.
            true if layer.x.len() > 200 => 3.4,
            true => Look::Dots.width(),
            false => layer.look.width(),
        };
        let dashes =
            (layer.is_dashed && !is_dots).then(|| format!("{} {}", 6.0 * size, 4.0 * size));
        let ink = format!("l-{}", layer.ink.name());
        html! {
            path class=(ink) data-name=(name) fill="none" stroke-width=(width * size) stroke-dasharray=[dashes] d=(path.text) {}
        }
    }

    /// Title and legend. A legend that does not fit beside the title is below it; the rest of the area is returned.
    fn headed(&self, canvas: &mut Canvas, area: Area, levels: &[&(String, f64)]) -> Area {
        let named = self.layers.iter().filter(|layer| !layer.name.is_empty());
        let named = named.map(|layer| (&*layer.name, layer.look, layer.ink, layer.is_dashed));
        let levels = levels
            .iter()
            .map(|(name, _)| (name.as_str(), Look::Line, Ink::Alarm, true));
        let mut entries: Vec<(String, Look, Ink, bool)> = Vec::new();
        for (name, look, ink, is_dashed) in named.chain(levels) {
            let name = fitted(
                name,
                LABEL,
                (area.w - 40.0) / if self.is_history { 3.0 } else { 1.0 },
            );
            if !entries
                .iter()
                .any(|known| known.0 == name && known.2 == ink)
            {
                entries.push((name, look, ink, is_dashed));
            }
        }
        let wide = |name: &str| text_width(name, LABEL) + 42.0;
        let whole: f64 = entries.iter().map(|(name, ..)| wide(name)).sum();
        let is_beside = text_width(&self.title, TITLE) * 1.1 + whole + 32.0 <= area.w;
        canvas.title(
            area,
            &self.title,
            area.w - if is_beside { whole } else { 0.0 },
        );
        let left = if is_beside {
            area.x + area.w - whole
        } else {
            area.x
        };
        let (mut x, mut y) = (left, area.y + 12.0);
        if !is_beside && !entries.is_empty() {
            y += ROW + 1.0;
        }
        canvas.open("legend");
        for (name, look, ink, is_dashed) in &entries {
            if x + wide(name) > area.x + area.w + 16.0 && x > left {
                (x, y) = (left, y + ROW);
            }
            match look {
                Look::Dots => canvas.line((x + 9.0, y), (x + 9.0, y), *ink, 7.0),
                Look::Bars => canvas.line((x + 4.0, y), (x + 14.0, y), *ink, 9.0),
                _ if *is_dashed => {
                    canvas.line((x, y), (x + 7.0, y), *ink, 2.5);
                    canvas.line((x + 12.0, y), (x + 19.0, y), *ink, 2.5);
                }
                _ => canvas.line((x, y), (x + 18.0, y), *ink, look.width().max(2.5)),
            }
            canvas.text(name, (x + 25.0, y), Lettering::new(Ink::Soft));
            x += wide(name);
        }
        canvas.close();
        let below = y - 12.0 - area.y;
        Area {
            y: area.y + below,
            h: area.h - below,
            ..area
        }
    }
}

/// A path in whole units: `m` begins a line, and every pair of numbers is the way from the point before.
#[derive(Default)]
struct Path {
    text: String,
    at: (i64, i64),
    is_open: bool,
}

impl Path {
    /// To a point; `None` breaks the line.
    fn to(&mut self, point: Option<(i64, i64)>) {
        let Some(point) = point else {
            self.is_open = false;
            return;
        };
        let (dx, dy) = (point.0 - self.at.0, point.1 - self.at.1);
        if self.is_open && (dx, dy) == (0, 0) {
            return;
        }
        let lead = match (self.is_open, dx < 0) {
            (false, _) => "m",
            (true, true) => "",
            (true, false) => " ",
        };
        let gap = if dy < 0 { "" } else { " " };
        // Writing to a string does not fail.
        let _ = write!(self.text, "{lead}{dx}{gap}{dy}");
        (self.at, self.is_open) = (point, true);
    }

    /// Makes a dot of the point before.
    fn dot(&mut self) {
        if self.is_open {
            self.text.push_str("h0");
            self.is_open = false;
        }
    }
}

/// A length in whole units.
fn whole(length: f64) -> i64 {
    length.round() as i64
}

/// A length with one decimal.
fn r(length: f64) -> f64 {
    (length * 10.0).round() / 10.0
}

/// A rectangle in display units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Area {
    pub x: f64,
    pub y: f64,
    pub w: f64,
    pub h: f64,
}

impl Area {
    /// All of a picture.
    pub(super) const fn whole(w: f64, h: f64) -> Self {
        Self {
            x: 0.0,
            y: 0.0,
            w,
            h,
        }
    }
}

/// A frame with both axes.
pub(super) struct Plot {
    /// Where lines and bars go.
    pub inner: Area,
    x: Axis,
    y: Axis,
}

impl Plot {
    /// Draws frame, grid, numbers and names.
    fn frame(
        canvas: &mut Canvas,
        area: Area,
        (x, across): (Axis, &Labels),
        (y, up): (Axis, &Labels),
        is_square: bool,
    ) -> Self {
        let widest = up.ticks.iter().map(|tick| text_width(&tick.label, LABEL));
        // Room for numbers at the left, so that charts above each other mostly share their time axis.
        let left = widest.fold(30.0, f64::max) + if up.name.is_empty() { 10.0 } else { 30.0 };
        let foot = if across.name.is_empty() {
            FOOT - 18.0
        } else {
            FOOT
        };
        let wide = area.w - left;
        // Half of the last number may extend beyond the end of the axis.
        let beyond = across.ticks.iter().map(|tick| {
            text_width(&tick.label, LABEL) / 2.0 + 2.0 - (1.0 - x.place(tick.at)) * wide
        });
        let (mut w, mut h) = (wide - beyond.fold(10.0, f64::max), area.h - HEAD - foot);
        if is_square {
            (w, h) = (w.min(h), w.min(h));
        }
        let inner = Area {
            x: area.x + left,
            y: area.y + HEAD,
            w: w.max(10.0),
            h: h.max(10.0),
        };
        let plot = Self { inner, x, y };
        let (right, bottom) = (inner.x + inner.w, inner.y + inner.h);
        let small = Lettering::new(Ink::Soft);
        canvas.open("ticks up");
        for tick in up.ticks.iter().filter(|tick| !tick.label.is_empty()) {
            let at = plot.up(tick.at);
            canvas.line(
                (inner.x, at),
                (right, at),
                if tick.at == 0.0 {
                    Ink::Frame
                } else {
                    Ink::Grid
                },
                1.0,
            );
            canvas.text(
                &tick.label,
                (inner.x - 7.0, at),
                small.anchored(Anchor::Right),
            );
        }
        canvas.close();
        canvas.open("ticks across");
        let mut free_from = f64::NEG_INFINITY;
        for tick in &across.ticks {
            let at = plot.across(tick.at);
            let is_named = !tick.label.is_empty();
            let (to, from) = if is_named {
                (bottom + 5.0, inner.y)
            } else {
                (bottom + 3.0, bottom)
            };
            canvas.line((at, from), (at, to), Ink::Grid, 1.0);
            let half = text_width(&tick.label, LABEL) / 2.0;
            if is_named && at - half > free_from {
                canvas.text(
                    &tick.label,
                    (at, bottom + 14.0),
                    small.anchored(Anchor::Middle),
                );
                free_from = at + half + 6.0;
            }
        }
        canvas.close();
        if !up.name.is_empty() {
            // A name longer than the axis extends below it, and leaves the title free.
            let room = area.y + area.h - inner.y;
            let words = fitted(&up.name, LABEL, room);
            let half = text_width(&words, LABEL) / 2.0;
            let middle = (inner.y + inner.h / 2.0).max(inner.y + half.min(room / 2.0));
            canvas.text(
                &words,
                (area.x + 7.0, middle),
                small.anchored(Anchor::Middle).upright(),
            );
        }
        canvas.open("foot");
        canvas.line((inner.x, bottom), (right, bottom), Ink::Frame, 1.0);
        let words = fitted(&across.name, LABEL, area.w);
        let middle = (inner.x + inner.w / 2.0, bottom + 32.0);
        canvas.text(&words, middle, small.anchored(Anchor::Middle));
        canvas.close();
        plot
    }

    fn across(&self, value: f64) -> f64 {
        self.inner.x + self.inner.w * self.x.place(value)
    }

    fn up(&self, value: f64) -> f64 {
        self.inner.y + self.inner.h * (1.0 - self.y.place(value))
    }
}

/// Which part of a text lies at its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
}

/// Style of a text.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lettering {
    ink: Ink,
    anchor: Anchor,
    is_bold: bool,
    is_upright: bool,
}

impl Lettering {
    /// Plain text that starts at its point.
    pub(super) const fn new(ink: Ink) -> Self {
        Self {
            ink,
            anchor: Anchor::Left,
            is_bold: false,
            is_upright: false,
        }
    }

    pub(super) const fn anchored(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    pub(super) const fn bold(mut self) -> Self {
        self.is_bold = true;
        self
    }

    const fn upright(mut self) -> Self {
        self.is_upright = true;
        self
    }
}

/// A surface to draw on, in display units from the upper left corner.
pub(super) struct Canvas {
    body: String,
    is_page: bool,
}

impl Canvas {
    /// The markup of a drawing, in a page or as a separate picture.
    fn drawn(is_page: bool, draw: impl FnOnce(&mut Self)) -> String {
        let body = String::new();
        let mut canvas = Self { body, is_page };
        draw(&mut canvas);
        canvas.body
    }

    /// Whole units of a line per display unit.
    const fn fine(&self) -> (f64, f64) {
        if self.is_page { OF_PAGE } else { OF_PICTURE }
    }

    pub(super) fn add(&mut self, markup: Markup) {
        self.body += &markup.0;
    }

    pub(super) fn open(&mut self, class: &str) {
        self.body += &format!("<g class=\"{class}\">");
    }

    pub(super) fn close(&mut self) {
        self.body += "</g>";
    }

    /// A straight line; one without length is a dot.
    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), ink: Ink, width: f64) {
        self.add(html! {
            line class={ "l-" (ink.name()) } x1=(r(from.0)) y1=(r(from.1)) x2=(r(to.0)) y2=(r(to.1)) stroke-width=(width) {}
        });
    }

    /// A filled rectangle.
    pub(super) fn block(&mut self, Area { x, y, w, h }: Area, ink: Ink, opacity: f64) {
        self.add(html! {
            rect class={ "f-" (ink.name()) } x=(r(x)) y=(r(y)) width=(r(w)) height=(r(h)) fill-opacity=(opacity) {}
        });
    }

    /// A circle: filled, or an open one that covers what is below it.
    pub(super) fn circle(&mut self, at: (f64, f64), radius: f64, ink: Ink, is_filled: bool) {
        let class = match is_filled {
            true => format!("f-{}", ink.name()),
            false => format!("f-card l-{}", ink.name()),
        };
        self.add(html! { circle class=(class) cx=(r(at.0)) cy=(r(at.1)) r=(radius) stroke-width="1.5" {} });
    }

    /// Lines that are straight from the first point to the second, a Bézier curve to the fifth, and straight to the last.
    pub(super) fn members(&mut self, shapes: &[[(f64, f64); 6]], ink: Ink, width: f64) {
        let shapes = shapes.iter().map(|points| {
            let [first, from, a, b, to, last] = points.map(|(x, y)| format!("{} {}", r(x), r(y)));
            format!("M{first}L{from}C{a} {b} {to}L{last}")
        });
        let d: String = shapes.collect();
        self.add(
            html! { path class={ "l-" (ink.name()) } d=(d) fill="none" stroke-width=(width) {} },
        );
    }

    /// Text, centred on its point vertically.
    pub(super) fn text(&mut self, words: &str, (x, y): (f64, f64), how: Lettering) {
        self.letters(words, (x, y), how, LABEL);
    }

    fn letters(&mut self, words: &str, (x, y): (f64, f64), how: Lettering, size: f64) {
        let anchor = match how.anchor {
            Anchor::Left => None,
            Anchor::Middle => Some("middle"),
            Anchor::Right => Some("end"),
        };
        let weight = how.is_bold.then_some("bold");
        let turn = how
            .is_upright
            .then(|| format!("rotate(-90 {} {})", r(x), r(y)));
        self.add(html! {
            text class={ "f-" (how.ink.name()) } x=(r(x)) y=(r(y)) dy=".35em" font-size=(size) text-anchor=[anchor] font-weight=[weight]
                transform=[turn] { (words) }
        });
    }

    /// Title at the upper left of `area`.
    pub(super) fn title(&mut self, area: Area, words: &str, room: f64) {
        let words = fitted(words, TITLE * 1.06, room);
        self.letters(
            &words,
            (area.x, area.y + 12.0),
            Lettering::new(Ink::Text).bold(),
            TITLE,
        );
    }

    /// A sentence in the middle of `area`, instead of a chart.
    pub(super) fn sentence(&mut self, area: Area, heading: &str) {
        self.title(area, heading, area.w);
        let at = (area.x + area.w / 2.0, area.y + area.h / 2.0);
        let words = "There is nothing to draw: no finite values were recorded.";
        self.text(
            &fitted(words, LABEL, area.w),
            at,
            Lettering::new(Ink::Soft).anchored(Anchor::Middle),
        );
    }
}

/// A picture of a page; `label` is the text for screen readers.
pub(super) fn page_picture(
    width: f64,
    height: f64,
    label: &str,
    draw: impl FnOnce(&mut Canvas),
) -> Markup {
    let body = Canvas::drawn(true, draw);
    html! {
        svg.chart style={ "--drawn:" (width) } viewBox={ "0 0 " (width) " " (height) } role="img" aria-label=(label) {
            (PreEscaped(body))
        }
    }
}

/// A separate picture, on any background.
pub(super) fn picture(
    width: f64,
    height: f64,
    label: &str,
    draw: impl FnOnce(&mut Canvas),
) -> String {
    let body = Canvas::drawn(false, draw);
    let colours = COLOURS.iter().map(|(name, colour)| {
        let fill = colour.split(';').next().unwrap_or_default();
        format!(".l-{name}{{stroke:{colour}}}.f-{name}{{fill:{fill}}}")
    });
    let markup = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } role="img"
            aria-label=(label) font-family="sans-serif" stroke-linejoin="round" stroke-linecap="round" {
            title { (label) }
            style { (PreEscaped(colours.collect::<String>())) }
            (PreEscaped(body))
        }
    };
    printable(&markup.0).into_owned()
}

/// Width of `text` in display units, near enough to keep two texts apart.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let share = |c: char| match c {
        'i' | 'l' | 'j' | '.' | ',' | ':' | '\'' | '|' => 0.34,
        ' ' | '\u{a0}' | '\u{202f}' | 'f' | 'r' | 't' | '(' | ')' | '-' => 0.42,
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.98,
        c if c.is_uppercase() => 0.7,
        _ => 0.63,
    };
    text.chars().map(share).sum::<f64>() * size
}

/// `text` cut so that it fits into `width` at `size`.
pub(super) fn fitted(text: &str, size: f64, width: f64) -> String {
    let mut most = text.chars().count();
    while most > 1 && text_width(&shortened(text, most), size) > width {
        most -= 1;
    }
    shortened(text, most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> [Scale<'static>; 2] {
        [Scale::new("time", "s"), Scale::new("value", "m")]
    }

    fn chart<'a>(x: &'a [f64], y: &'a [f64]) -> Chart<'a> {
        let [across, up] = axes();
        Chart::new("Curves & others", across, up).with("tame <b>", x, y, Look::Line)
    }

    #[test]
    fn lines_carry_their_values() {
        let (x, y) = ([0.0, 1.0, 2.0, 3.0], [0.0, 2e-3, f64::NAN, -2e-3]);
        let markup = chart(&x, &y).figure().0;
        let told = |name: &str| {
            markup
                .split(&format!("{name}=\""))
                .nth(1)
                .unwrap()
                .split('"')
                .next()
                .unwrap()
        };
        let ends = told("data-x").replace("&quot;", "\"");
        let ends: serde_json::Value = serde_json::from_str(&ends).unwrap();
        let (lo, hi) = (ends[0].as_f64().unwrap(), ends[1].as_f64().unwrap());
        assert!(lo < 0.0 && hi > 3.0 && ends[3] == "time");
        let path = markup
            .split("data-name=\"tame")
            .nth(1)
            .unwrap()
            .split(" d=\"")
            .nth(1)
            .unwrap();
        let path = path.split('"').next().unwrap();
        assert_eq!(
            path.matches('m').count(),
            2,
            "a gap breaks the line: {path}"
        );
        // From the first point to the second: a third of the way from 0 to 3.
        let way: Vec<&str> = path
            .split([' ', 'm', '-'])
            .filter(|n| !n.is_empty())
            .collect();
        let width: f64 = markup
            .split("viewBox=\"0 0 ")
            .nth(2)
            .unwrap()
            .split(' ')
            .next()
            .unwrap()
            .parse()
            .unwrap();
        let moved: f64 = way[2].parse().unwrap();
        assert!((moved / width * (hi - lo) - 1.0).abs() < 1e-3, "{path}");
        assert!(markup.contains("tame &lt;b&gt;") && markup.contains("value (mm)"));
        assert!(markup.contains("aria-label=\"Curves &amp; others\""));
    }

    #[test]
    fn wild_curve_does_not_hide_the_others() {
        let x: Vec<f64> = (0..100).map(f64::from).collect();
        let tame: Vec<f64> = x.iter().map(|x| libm::sin(x / 10.0)).collect();
        let wild: Vec<f64> = x.iter().map(|x| libm::exp(*x)).collect();
        let [across, up] = axes();
        let chart = Chart::new("Both", across, up.within(Some((-1.0, 1.0))))
            .with("tame", &x, &tame, Look::Line)
            .with("wild", &x, &wild, Look::Line);
        let svg = chart.svg();
        assert!(svg.contains(">1.0</text>") && !svg.contains("e43"));
        let wild = svg.split("data-name=\"wild\"").nth(1).unwrap();
        assert!(
            wild.split(" d=\"")
                .nth(1)
                .unwrap()
                .split('"')
                .next()
                .unwrap()
                .len()
                < 60,
            "{wild}"
        );
    }

    #[test]
    fn levels_marks_and_dashes_are_drawn() {
        let x = [0.0, 1.0, 2.0];
        let marks = [
            ("trip: force".to_owned(), 1.5, Ink::Alarm),
            ("late".to_owned(), 9.0, Ink::Alarm),
        ];
        let mut both = Chart::history("History", axes()[1]).marks(marks);
        for _ in 0..7 {
            both = both.with("line", &x, &x, Look::Line);
        }
        let both = both.levels([("limit".to_owned(), 2.5), ("far".to_owned(), 50.0)]);
        let markup = both.figure().0;
        assert!(markup.contains("trip: force") && !markup.contains("late<"));
        assert!(markup.contains("limit") && !markup.contains("far<"));
        assert_eq!(
            markup.matches("stroke-dasharray").count(),
            2,
            "the level and the seventh line"
        );
    }

    #[test]
    fn points_of_one_place_are_a_dot() {
        assert!(chart(&[2.0, 2.0], &[5.0, 5.0]).figure().0.contains("h0"));
        let [across, up] = axes();
        let dots = Chart::new("Dots", across, up).with(
            "",
            vec![1.0, 2.0, f64::NAN],
            vec![1.0; 3],
            Look::Dots,
        );
        assert_eq!(dots.svg().matches("h0").count(), 2);
        assert!(chart(&[], &[]).svg().contains("nothing to draw"));
        assert!(
            chart(&[f64::NAN], &[1.0])
                .figure()
                .0
                .contains("nothing to draw")
        );
    }

    #[test]
    fn text_is_cut_to_its_width() {
        assert_eq!(fitted("short", 12.0, 500.0), "short");
        let cut = fitted(&"long ".repeat(40), 12.0, 80.0);
        assert!(cut.ends_with('…') && text_width(&cut, 12.0) <= 80.0);
    }
}
