//! A picture of several curves over one pair of axes, for pages other than a run's: linear or doubly logarithmic, with
//! fixed ranges where a published figure has them.
//!
//! A curve that leaves a fixed range ends at its edge; a sawtooth crosses the picture until it is far outside: a
//! diverging response must not hide the others.

use super::axis::{Axis, is_drawable};
use super::canvas::{Anchor, Canvas, Ink, Lettering, Skin, fitted, picture, text_width};
use super::charts::{Area, LABEL, Plot, Quantity, Scaled, linear, sentence, title};
use super::text::fixed;
use super::thin;

/// One curve.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Curve<'a> {
    pub name: &'a str,
    pub x: &'a [f64],
    pub y: &'a [f64],
    /// Points instead of a line.
    pub dots: bool,
}

/// What an axis shows: words, SI unit, range if it is fixed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale<'a> {
    pub words: &'a str,
    pub unit: &'a str,
    pub range: Option<(f64, f64)>,
}

/// Curves over one pair of axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Curves<'a> {
    pub title: &'a str,
    pub across: Scale<'a>,
    pub up: Scale<'a>,
    pub curves: &'a [Curve<'a>],
    /// Both axes logarithmic.
    pub logarithmic: bool,
}

/// Height of one row of the legend.
const ROW: f64 = 18.0;
/// Largest distance of a left-out point from the drawn line, in display units.
const TOLERANCE: f64 = 0.15;
/// Further outside than this many times the range nothing is drawn.
const FAR: f64 = 2.0;

impl Curves<'_> {
    /// The picture as SVG: a part of a page that carries the style sheet, or a file of its own.
    pub(crate) fn svg(&self, width: f64, height: f64, inline: bool) -> String {
        let skin = if inline { Skin::Page } else { Skin::Picture };
        picture(width, height, skin, self.title, |canvas| {
            self.draw(canvas, Area::whole(width, height));
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
        let plot = Plot::frame(canvas, rest, (x, &across), (y, &up));
        if !self.logarithmic {
            plot.zero_line(canvas);
        }
        for (index, curve) in self.curves.iter().enumerate() {
            let ink = ink(index);
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
            if curve.dots {
                for at in places.filter(|at| at.0.is_finite()) {
                    canvas.dot(at, ink, 3.0);
                }
            } else {
                for run in thin::within(places, TOLERANCE) {
                    canvas.path(&run, ink, 1.5);
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
        if !self.logarithmic {
            return linear(axis, quantity, about as usize, false);
        }
        let mut scaled = linear(axis, quantity, 2, false);
        scaled.ticks = axis.decades(|exponent| {
            fixed(
                libm::pow(10.0, f64::from(exponent)),
                usize::try_from(-exponent).unwrap_or(0),
            )
        });
        scaled
    }

    /// Swatches and names in as many rows as they need, below the title; returns their height.
    fn legend(&self, canvas: &mut Canvas<'_>, area: Area) -> f64 {
        let (mut x, mut row) = (area.x, 0.0);
        let mut any = false;
        for (index, curve) in self.curves.iter().enumerate() {
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
            canvas.line((x, at), (x + 18.0, at), ink(index), 2.5);
            canvas.text(
                &name,
                (x + 24.0, at),
                Lettering::new(LABEL, Ink::Soft).anchored(Anchor::Left),
            );
            x += wide;
        }
        if any { (row + 1.0) * ROW } else { 0.0 }
    }
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

fn ink(index: usize) -> Ink {
    Ink::Series(u8::try_from(index % 6).unwrap_or(0))
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
        }
        .svg(600.0, 400.0, false)
    }

    #[test]
    fn every_curve_is_drawn_named_and_cut_where_it_is_far_outside() {
        let x: Vec<f64> = (0..100).map(f64::from).collect();
        let tame: Vec<f64> = x.iter().map(|x| libm::sin(x / 10.0)).collect();
        let wild: Vec<f64> = x.iter().map(|x| libm::exp(*x)).collect();
        let curve = |name, y, dots| Curve {
            name,
            x: &x,
            y,
            dots,
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
}
