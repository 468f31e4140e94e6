//! A picture of several curves over one pair of axes, for pages other than a run's: linear or doubly logarithmic, with
//! fixed ranges where a published figure has them.
//!
//! A curve that leaves a fixed range ends at its edge; a sawtooth crosses the picture until it is far outside: a
//! diverging response must not hide the others.

use super::axis::{Axis, is_drawable};
use super::canvas::{Anchor, Canvas, Ink, Lettering, Skin, fitted, picture, text_width};
use super::charts::{
    Area, FOOT, HEAD, LABEL, Plot, Quantity, Scaled, left_of, linear, right_of, sentence, title,
};
use super::text::fixed;
use super::thin;

/// One curve.
#[derive(Debug, Clone, Copy)]
pub struct Curve<'a> {
    /// Name in the legend.
    pub name: &'a str,
    /// Across.
    pub x: &'a [f64],
    /// Up.
    pub y: &'a [f64],
    /// How it is drawn.
    pub look: Look,
}

/// Look of a curve.
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

/// How a curve is drawn.
#[derive(Debug, Clone, Copy)]
struct Style {
    ink: Ink,
    dashed: bool,
    width: f64,
}

/// Words, unit ("1" for a pure number) and fixed range of an axis.
#[derive(Debug, Clone, Copy)]
pub struct Scale<'a> {
    /// Quantity.
    pub words: &'a str,
    /// Unit.
    pub unit: &'a str,
    /// Fixed range; none: that of the values.
    pub range: Option<(f64, f64)>,
}

/// Curves over one pair of axes.
#[derive(Debug, Clone, Copy)]
pub struct Curves<'a> {
    /// Heading.
    pub title: &'a str,
    /// Horizontal axis.
    pub across: Scale<'a>,
    /// Vertical axis.
    pub up: Scale<'a>,
    /// The curves.
    pub curves: &'a [Curve<'a>],
    /// Both axes logarithmic.
    pub logarithmic: bool,
    /// The frame is square, for the z plane.
    pub square: bool,
}

/// Height of one row of the legend.
const ROW: f64 = 18.0;
/// Largest distance of an omitted point from the drawn line, in display units.
const TOLERANCE: f64 = 0.15;
/// Length of a dash and of the gap after it, in display units.
const DASH: (f64, f64) = (6.0, 4.0);
/// Margin round a picture in a separate file.
const EDGE: f64 = 12.0;
/// Opacity of a bar.
const BAR: f64 = 0.75;
/// Further outside than this many times the range nothing is drawn.
const FAR: f64 = 2.0;

impl Curves<'_> {
    /// The picture as SVG: a part of a page that carries the style sheet, or a separate file.
    pub fn svg(&self, width: f64, height: f64, inline: bool) -> String {
        // A page has its own margins, a file has none.
        let (skin, edge) = if inline {
            (Skin::Page, 0.0)
        } else {
            (Skin::Picture, EDGE)
        };
        let (wide, high) = (width + 2.0 * edge, height + 2.0 * edge);
        picture(wide, high, skin, self.title, |canvas| {
            let area = Area {
                x: edge,
                y: edge,
                w: width,
                h: height,
            };
            self.draw(canvas, area);
        })
    }

    fn draw(&self, canvas: &mut Canvas<'_>, area: Area) {
        let x = self.axis(self.across.range, |curve| curve.x);
        let y = self.axis(self.up.range, |curve| curve.y);
        let (Some(x), Some(y)) = (x, y) else {
            return sentence(canvas, area, self.title, "There is nothing to draw.");
        };
        title(canvas, area, self.title, area.w);
        let taken = self.legend(canvas, area);
        let rest = Area {
            y: area.y + taken,
            h: area.h - taken,
            ..area
        };
        let across = self.ticks(&x, self.across, (area.w / 80.0).clamp(3.0, 10.0));
        let up = self.ticks(&y, self.up, (rest.h / 50.0).clamp(3.0, 8.0));
        let rest = if self.square {
            let (left, right) = (left_of(&up), right_of(&across, x, rest.w));
            let side = (rest.w - left - right).min(rest.h - HEAD - FOOT);
            Area {
                w: side + left + right,
                h: side + HEAD + FOOT,
                ..rest
            }
        } else {
            rest
        };
        let plot = Plot::frame(canvas, rest, (x, &across), (y, &up));
        if !self.logarithmic {
            plot.zero_line(canvas);
        }
        for (curve, style) in self.curves.iter().zip(self.styles()) {
            let outside = sides(&y, curve.y);
            let places = curve
                .x
                .iter()
                .zip(curve.y)
                .zip(&outside)
                .map(|((&px, &py), side)| {
                    if is_drawable(px) && side.is_some() {
                        (plot.across(px), plot.up(py))
                    } else {
                        (f64::NAN, f64::NAN)
                    }
                });
            match curve.look {
                Look::Dots => {
                    // Many dots are a cloud, few are marks.
                    let radius = if curve.x.len() > 200 { 1.8 } else { 3.0 };
                    for at in places.filter(|at| at.0.is_finite()) {
                        canvas.dot(at, style.ink, radius);
                    }
                }
                Look::Bars => bars(canvas, &plot, curve, style.ink),
                _ => {
                    for run in thin::within(places, TOLERANCE) {
                        line(canvas, &run, style);
                    }
                }
            }
        }
    }

    fn axis<'b>(
        &'b self,
        range: Option<(f64, f64)>,
        of: impl Fn(&'b Curve<'b>) -> &'b [f64],
    ) -> Option<Axis> {
        let values = self
            .curves
            .iter()
            .flat_map(|curve| of(curve).iter().copied());
        match (range, self.logarithmic) {
            (Some((lo, hi)), false) => Axis::exactly(lo, hi),
            (Some((lo, hi)), true) => Axis::logarithmic(lo, hi),
            (None, false) => Axis::around(values),
            (None, true) => Axis::logarithmic_around(values),
        }
    }

    fn ticks(&self, axis: &Axis, scale: Scale<'_>, about: f64) -> Scaled {
        let quantity = Quantity {
            words: scale.words,
            unit: scale.unit,
        };
        let about = if self.logarithmic { 2 } else { about as usize };
        let mut scaled = linear(axis, quantity, about, false);
        if scale.unit == "1" {
            scaled.name += " (–)";
        }
        if self.logarithmic {
            scaled.ticks = axis.decades(decade);
        }
        scaled
    }

    /// Swatches and names in as many rows as they need, below the title; returns their height.
    fn legend(&self, canvas: &mut Canvas<'_>, area: Area) -> f64 {
        let (mut x, mut row) = (area.x, 0.0);
        let mut any = false;
        for (curve, style) in self.curves.iter().zip(self.styles()) {
            if curve.name.is_empty() {
                continue;
            }
            let name = fitted(curve.name, LABEL, area.w - 40.0);
            let wide = text_width(&name, LABEL) + 46.0;
            if any && x + wide > area.x + area.w {
                x = area.x;
                row += 1.0;
            }
            any = true;
            let at = area.y + 32.0 + row * ROW;
            let Style { ink, width, .. } = style;
            match curve.look {
                Look::Dots => canvas.dot((x + 9.0, at), ink, 3.5),
                Look::Bars => canvas.block((x, at - 5.0), (x + 18.0, at + 5.0), ink, BAR),
                _ if style.dashed => {
                    canvas.line((x, at), (x + 7.0, at), ink, 2.5);
                    canvas.line((x + 12.0, at), (x + 19.0, at), ink, 2.5);
                }
                Look::Faint => canvas.line((x, at), (x + 18.0, at), ink, 1.5),
                _ => canvas.line((x, at), (x + 18.0, at), ink, width.max(2.5)),
            }
            canvas.text(
                &name,
                (x + 24.0, at),
                Lettering::new(LABEL, Ink::Soft).anchored(Anchor::Left),
            );
            x += wide;
        }
        if any { (row + 1.0) * ROW + 8.0 } else { 0.0 }
    }

    /// Six colours, then the same dashed; the reference and faint curves take none of them.
    fn styles(&self) -> Vec<Style> {
        let mut taken = 0usize;
        let style = |curve: &Curve<'_>| {
            let plain = |ink, dashed, width| Style { ink, dashed, width };
            match curve.look {
                Look::Reference => return plain(Ink::Text, true, 1.5),
                Look::Faint => return plain(Ink::Frame, false, 1.2),
                _ => {}
            }
            let index = taken;
            taken += 1;
            let ink = Ink::Series(u8::try_from(index % 6).unwrap_or(0));
            match curve.look {
                Look::Strong => plain(ink, false, 3.0),
                Look::Dashed => plain(ink, true, 2.5),
                _ => plain(ink, index % 12 >= 6, 1.5),
            }
        };
        self.curves.iter().map(style).collect()
    }
}

/// A line, or its dashes.
fn line(canvas: &mut Canvas<'_>, run: &[(f64, f64)], style: Style) {
    if style.dashed {
        for dash in dashes(run) {
            canvas.path(&dash, style.ink, style.width);
        }
    } else {
        canvas.path(run, style.ink, style.width);
    }
}

/// The bars of a curve, from zero to their height.
fn bars(canvas: &mut Canvas<'_>, plot: &Plot, curve: &Curve<'_>, ink: Ink) {
    let bottom = plot.up(0.0);
    for (ends, height) in curve.x.windows(2).zip(curve.y) {
        if *height > 0.0 {
            let (left, right) = (plot.across(ends[0]), plot.across(ends[1]));
            let right = (right - 0.6).max(left + 0.5);
            canvas.block((left, plot.up(*height)), (right, bottom), ink, BAR);
        }
    }
}

/// "100", "0.02", and powers where zeros would have to be counted.
fn decade(digit: i32, exponent: i32) -> String {
    if (-3..=4).contains(&exponent) {
        let decimals = usize::try_from(-exponent).unwrap_or(0);
        let value = f64::from(digit) * libm::pow(10.0, f64::from(exponent));
        return fixed(value, decimals);
    }
    let raised = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        // The others follow each other.
        digit => char::from_u32(0x2070 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    };
    let exponent: String = exponent.to_string().chars().map(raised).collect();
    match digit {
        1 => format!("10{exponent}"),
        digit => format!("{digit}·10{exponent}"),
    }
}

/// A line cut into dashes.
fn dashes(points: &[(f64, f64)]) -> Vec<Vec<(f64, f64)>> {
    let mut all = Vec::new();
    let mut dash: Vec<(f64, f64)> = points.first().copied().into_iter().collect();
    let (mut drawn, mut left) = (true, DASH.0);
    for pair in points.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        loop {
            let length = libm::hypot(to.0 - from.0, to.1 - from.1);
            if length <= left {
                left -= length;
                if drawn {
                    dash.push(to);
                }
                break;
            }
            let share = left / length;
            from = (
                from.0 + share * (to.0 - from.0),
                from.1 + share * (to.1 - from.1),
            );
            if drawn {
                dash.push(from);
                all.push(std::mem::take(&mut dash));
            } else {
                dash.push(from);
            }
            drawn = !drawn;
            left = if drawn { DASH.0 } else { DASH.1 };
        }
    }
    if drawn && dash.len() > 1 {
        all.push(dash);
    }
    all
}

/// Where each value lies: below (−1), on (0) or above (1) the axis; none for a gap, and for a value whose neighbours
/// lie outside on the same side: a curve ends at the edge, while a sawtooth keeps crossing the picture until it is far.
fn sides(axis: &Axis, values: &[f64]) -> Vec<Option<i8>> {
    let side = |value: f64| {
        let room = FAR * (axis.hi() - axis.lo());
        match value {
            v if !is_drawable(v) || v < axis.lo() - room || v > axis.hi() + room => None,
            v if v < axis.lo() => Some(-1),
            v if v > axis.hi() => Some(1),
            _ => Some(0),
        }
    };
    let all: Vec<_> = values.iter().map(|&value| side(value)).collect();
    let neighbour = |at: Option<usize>| at.and_then(|i| all.get(i)).copied().flatten();
    all.iter()
        .enumerate()
        .map(|(i, &own)| {
            let alone = [i.checked_sub(1), Some(i + 1)]
                .into_iter()
                .all(|at| neighbour(at).is_none_or(|side| Some(side) == own));
            own.filter(|&side| side == 0 || !alone)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn svg(curves: &[Curve<'_>], range: Option<(f64, f64)>, logarithmic: bool) -> String {
        let scale = |range| Scale {
            words: "value",
            unit: "m",
            range,
        };
        Curves {
            title: "Curves & others",
            across: scale(None),
            up: scale(range),
            curves,
            logarithmic,
            square: false,
        }
        .svg(600.0, 400.0, false)
    }

    #[test]
    fn every_curve_is_drawn_named_and_cut() {
        let x: Vec<f64> = (0..100).map(f64::from).collect();
        let tame: Vec<f64> = x.iter().map(|x| libm::sin(x / 10.0)).collect();
        let wild: Vec<f64> = x.iter().map(|x| libm::exp(*x)).collect();
        let curve = |name, y, dots| Curve {
            name,
            x: &x,
            y,
            look: if dots { Look::Dots } else { Look::Line },
        };
        let both = [curve("tame", &tame, false), curve("wild", &wild, false)];
        let text = svg(&both, Some((-1.0, 1.0)), false);
        assert!(text.contains("tame") && text.contains("wild") && text.contains("&amp; others"));
        assert_eq!(text.matches("<polyline").count(), 2);
        let axis = Axis::exactly(-1.0, 1.0).unwrap();
        let leaving = sides(&axis, &[0.0, 2.0, 2.5, 3.0, 9.0, f64::NAN]);
        assert_eq!(leaving, [Some(0), Some(1), None, None, None, None]);
        let sawtooth = sides(&axis, &[0.0, 2.0, -2.5, 3.0, -9.0]);
        assert_eq!(sawtooth, [Some(0), Some(1), Some(-1), Some(1), None]);
        let dotted = svg(&[curve("", &tame, true)], None, false);
        assert_eq!(dotted.matches("<circle").count(), 100);
        let text = svg(&[curve("w", &wild, false)], None, true);
        assert!(text.contains("<polyline"));
        assert!(svg(&[], None, false).contains("nothing to draw"));
    }

    #[test]
    fn seventh_curve_is_dashed() {
        let x = [0.0, 1.0, 2.0];
        let curve = |reference| Curve {
            name: "c",
            x: &x,
            y: &x,
            look: if reference {
                Look::Reference
            } else {
                Look::Line
            },
        };
        let picture = |many: usize, reference| {
            let mut curves = vec![curve(false); many];
            curves.push(curve(reference));
            svg(&curves, None, false)
        };
        let count = |text: &str| text.matches("<polyline").count();
        assert_eq!(count(&picture(5, false)), 6);
        assert!(count(&picture(6, false)) > 20);
        assert!(count(&picture(0, true)) > 14);
        // The length that is drawn is six tenths of the whole, to one dash.
        let drawn: f64 = dashes(&[(0.0, 0.0), (60.0, 80.0), (60.0, 180.0)])
            .iter()
            .flat_map(|dash| {
                dash.windows(2)
                    .map(|p| libm::hypot(p[1].0 - p[0].0, p[1].1 - p[0].1))
                    .collect::<Vec<_>>()
            })
            .sum();
        assert!((drawn - 120.0).abs() < 1e-9, "{drawn}");
    }

    #[test]
    fn long_decades_are_powers() {
        assert_eq!(
            [-12, -3, 0, 4, 5].map(|e| decade(1, e)),
            ["10⁻¹²", "0.001", "1", "10\u{202f}000", "10⁵"]
        );
        let x = [500.0, 5000.0];
        let curve = Curve {
            name: "",
            x: &x,
            y: &x,
            look: Look::Line,
        };
        let text = svg(&[curve], None, true);
        for number in ["500", "1000", "2000", "5000"] {
            assert!(
                text.contains(&format!("\n{number}\n")) || text.contains(&format!(">{number}<")),
                "{number} {text}"
            );
        }
    }
}
