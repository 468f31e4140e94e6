//! A tornado picture: how far a result moves when one value at a time is altered, the largest range above.

use super::axis::Axis;
use super::canvas::{Anchor, Canvas, Ink, Lettering, Skin, fitted, picture, text_width};
use super::charts::{Area, FOOT, HEAD, LABEL, Plot, Quantity, Scaled, linear, sentence, title};
use super::curves::Scale;
use super::text::number;

/// One altered value: the smallest and the largest result, and the value at each of them as text.
#[derive(Debug, Clone, PartialEq)]
pub struct TornadoBar {
    /// Name of the value.
    pub name: String,
    /// Smallest result and where it was found.
    pub low: (f64, String),
    /// Largest result and where it was found.
    pub high: (f64, String),
}

/// Bars from the smallest to the largest result, in the given order.
#[derive(Debug, Clone, Copy)]
pub struct Tornado<'a> {
    /// Heading.
    pub title: &'a str,
    /// The result.
    pub across: Scale<'a>,
    /// Result without an alteration, and its name.
    pub base: Option<(f64, &'a str)>,
    /// The bars, in the order of the picture.
    pub bars: &'a [TornadoBar],
}

/// Height of a bar with its name.
const ROW: f64 = 40.0;
/// Room between the title and the frame, for the words at the base line.
const WORDS: f64 = 16.0;
/// Gap between a bar and the value at its end.
const GAP: f64 = 6.0;
/// Largest share of the width for the values at one end of the bars.
const MOST_LABEL: f64 = 0.25;

impl Tornado<'_> {
    /// The picture as SVG for a page.
    pub fn svg(&self, width: f64) -> String {
        let height = HEAD + WORDS + ROW * self.bars.len() as f64 + 8.0 + FOOT;
        picture(width, height, Skin::Page, self.title, |canvas| {
            self.draw(canvas, Area::whole(width, height));
        })
    }

    fn draw(&self, canvas: &mut Canvas<'_>, area: Area) {
        let most = MOST_LABEL * area.w;
        let widest = |of: fn(&TornadoBar) -> &str| {
            let widths = self.bars.iter().map(|bar| text_width(of(bar), LABEL));
            widths.fold(0.0, f64::max).min(most) + 2.0 * GAP
        };
        let room = (widest(|bar| &bar.low.1), widest(|bar| &bar.high.1));
        let up = Axis::exactly(0.0, self.bars.len() as f64);
        let (Some(x), Some(y)) = (self.axis(area.w, room), up) else {
            return sentence(canvas, area, self.title, "There is nothing to draw.");
        };
        title(canvas, area, self.title, area.w);
        let quantity = Quantity {
            words: self.across.words,
            unit: self.across.unit,
        };
        let mut across = linear(&x, quantity, 6, true);
        if self.across.unit == "1" {
            across.name += " (–)";
        }
        let nothing = Scaled {
            ticks: Vec::new(),
            name: String::new(),
        };
        let below = Area {
            y: area.y + WORDS,
            h: area.h - WORDS,
            ..area
        };
        let plot = Plot::frame(canvas, below, (x, &across), (y, &nothing));
        for (index, bar) in self.bars.iter().enumerate() {
            let top = plot.inner.y + ROW * index as f64;
            self.bar(canvas, &plot, top, bar, most);
        }
        if let Some((base, words)) = self.base {
            let words = format!(
                "{words}: {}",
                number(base / factor(&x, self.across.unit), 4)
            );
            let half = text_width(&words, LABEL) / 2.0;
            let (left, right) = (plot.inner.x, plot.inner.x + plot.inner.w);
            let at = plot
                .across(base)
                .clamp(left + half, (right - half).max(left + half));
            let how = Lettering::new(LABEL, Ink::Soft).anchored(Anchor::Middle);
            canvas.text(&words, (at, plot.inner.y - 9.0), how);
        }
    }

    /// The horizontal axis: all results, and room for texts of `room` display units left and right of the bars.
    fn axis(&self, width: f64, room: (f64, f64)) -> Option<Axis> {
        let ends = self.bars.iter().flat_map(|bar| [bar.low.0, bar.high.0]);
        let ends: Vec<f64> = ends.chain(self.base.map(|base| base.0)).collect();
        if !ends.iter().all(|end| end.is_finite()) {
            return None;
        }
        let low = ends.iter().copied().fold(f64::INFINITY, f64::min);
        let high = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let known = Axis::exactly(low, high)?;
        let (low, high) = (known.lo(), known.hi());
        let inner = (width - 50.0 - room.0 - room.1).max(0.2 * width);
        let per_unit = (high - low) / inner;
        Axis::exactly(low - room.0 * per_unit, high + room.1 * per_unit)
    }

    fn bar(&self, canvas: &mut Canvas<'_>, plot: &Plot, top: f64, bar: &TornadoBar, most: f64) {
        let (from, to) = (top + 19.0, top + 35.0);
        let middle = f64::midpoint(from, to);
        let name = fitted(&bar.name, LABEL, plot.inner.w - 8.0);
        let text = Lettering::new(LABEL, Ink::Text);
        canvas.text(&name, (plot.inner.x + 4.0, top + 10.0), text);
        let (low, high) = (plot.across(bar.low.0), plot.across(bar.high.0));
        let base = self.base.map(|base| plot.across(base.0));
        let split = base.unwrap_or(low).clamp(low, high);
        // A range of zero is a line.
        if high - low < 1.0 {
            canvas.line((low, from), (low, to), Ink::Series(0), 2.0);
        }
        canvas.block((low, from), (split, to), Ink::Series(0), 0.85);
        canvas.block((split, from), (high, to), Ink::Series(1), 0.85);
        let small = Lettering::new(LABEL, Ink::Soft);
        let ends = [
            (low - GAP, &bar.low.1, Anchor::Right),
            (high + GAP, &bar.high.1, Anchor::Left),
        ];
        for (at, words, anchor) in ends {
            let words = fitted(words, LABEL, most);
            canvas.text(&words, (at, middle), small.anchored(anchor));
        }
        if let Some(base) = base {
            canvas.line((base, from - 2.0), (base, to + 2.0), Ink::Text, 1.5);
        }
    }
}

/// Divisor of the numbers of the axis.
fn factor(axis: &Axis, unit: &str) -> f64 {
    super::text::scaled(axis.lo().abs().max(axis.hi().abs()), unit).factor
}

#[cfg(test)]
mod tests {
    use super::*;

    fn svg(bars: &[TornadoBar], base: Option<f64>) -> String {
        let tornado = Tornado {
            title: "Tornado",
            across: Scale {
                words: "drift",
                unit: "m",
                range: None,
            },
            base: base.map(|base| (base, "test file")),
            bars,
        };
        tornado.svg(640.0)
    }

    fn bar(low: f64, high: f64) -> TornadoBar {
        TornadoBar {
            name: format!("key of {high}"),
            low: (low, "lowest".to_owned()),
            high: (high, "highest".to_owned()),
        }
    }

    #[test]
    fn each_bar_has_a_name_and_end_values() {
        let text = svg(&[bar(0.01, 0.05), bar(0.02, 0.03)], Some(0.025));
        for words in [
            "key of 0.05",
            "key of 0.03",
            "drift (mm)",
            "test file: 25.00",
        ] {
            assert!(text.contains(words), "{words}");
        }
        assert_eq!(text.matches("lowest").count(), 2);
        // Two colours of each bar.
        assert_eq!(text.matches("f-s0").count(), 2);
        assert_eq!(text.matches("f-s1").count(), 2);
    }

    #[test]
    fn equal_results_and_no_results_are_drawn() {
        assert!(svg(&[bar(0.02, 0.02)], Some(0.02)).contains("lowest"));
        assert!(svg(&[bar(0.0, 0.0)], None).contains("lowest"));
        assert!(svg(&[], None).contains("nothing to draw"));
        assert!(svg(&[bar(f64::NAN, 1.0)], None).contains("nothing to draw"));
    }
}
