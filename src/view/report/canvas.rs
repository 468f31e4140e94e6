//! The one place where a picture is drawn: plotters' SVG backend, on a canvas several times the display size.
//!
//! plotters places every point on a whole unit. So the canvas has [`FINE`] units per display unit, and every length is
//! multiplied by it. The size in the first line is set back and `viewBox` stays. Colours are drawn as sentinels and replaced
//! at the end: by classes in a page, whose style sheet has light, dark and paper colours, or by neutral mid-tones in a
//! picture for any background. Sentinels cannot be forged: quotes in text arrive escaped.

use std::fmt::Write as _;

use plotters::backend::{DrawingBackend, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{
    Color, FontDesc, FontFamily, FontStyle, FontTransform, RGBAColor, RGBColor, ShapeStyle,
    TextStyle,
};

use super::text::{escape, printable, shortened};

/// Units of the canvas per display unit.
const FINE: f64 = 8.0;
/// plotters divides the size of a font by this before it writes it.
const FONT_FACTOR: f64 = 1.24;

/// Purpose of a colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ink {
    /// Titles.
    Text,
    /// Axis labels and numbers.
    Soft,
    /// Grid lines.
    Grid,
    /// Axis lines.
    Frame,
    /// Failures.
    Alarm,
    /// Line or bar of a series, from 0.
    Series(u8),
}

/// Class of each sentinel and its colour in a picture, readable on white and on near-black. The grid's carries an
/// attribute with it: eight-digit colours are younger than many programs that show SVG.
const INKS: [(&str, &str); 11] = [
    ("text", "#7b8490"),
    ("soft", "#838c98"),
    ("grid", "#8b949e\" stroke-opacity=\"0.22"),
    ("frame", "#8b949e"),
    ("alarm", "#e5484d"),
    // Okabe and Ito (2008), safe for colour-blind readers; black is reserved for text.
    ("s0", "#0072b2"),
    ("s1", "#d55e00"),
    ("s2", "#009e73"),
    ("s3", "#cc79a7"),
    ("s4", "#e69f00"),
    ("s5", "#56b4e9"),
];

impl Ink {
    const fn index(self) -> u8 {
        match self {
            Ink::Text => 0,
            Ink::Soft => 1,
            Ink::Grid => 2,
            Ink::Frame => 3,
            Ink::Alarm => 4,
            Ink::Series(i) => 5 + i % 6,
        }
    }

    const fn sentinel(self) -> RGBColor {
        RGBColor(1, 2, self.index())
    }
}

/// Place of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Skin {
    /// Inside the page, which has a style sheet.
    Page,
    /// A separate file, on an unknown background.
    Picture,
}

/// Which part of a text lies at its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
}

/// Style of a piece of text.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lettering {
    /// Font size in display units.
    pub size: f64,
    /// Colour.
    pub ink: Ink,
    /// Where the point lies on the text.
    pub anchor: Anchor,
    /// Bold.
    pub bold: bool,
    /// Reads from below to above.
    pub upright: bool,
}

impl Lettering {
    /// Plain text starting at its point.
    pub(crate) const fn new(size: f64, ink: Ink) -> Self {
        Self {
            size,
            ink,
            anchor: Anchor::Left,
            bold: false,
            upright: false,
        }
    }

    /// This text, anchored elsewhere.
    pub(crate) const fn anchored(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    /// This text in bold.
    pub(crate) const fn bold(mut self) -> Self {
        self.bold = true;
        self
    }

    /// This text, turned by a quarter.
    pub(crate) const fn upright(mut self) -> Self {
        self.upright = true;
        self
    }
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

/// Width of bold letters over that of plain ones.
const BOLD: f64 = 1.1;

impl Lettering {
    /// `text` cut so that it fits into `width` when it is written like this.
    pub(super) fn fitted(self, text: &str, width: f64) -> String {
        let wider = if self.bold { BOLD } else { 1.0 };
        fitted(text, self.size * wider, width)
    }
}

/// A surface to draw on, in display units from the upper left corner.
pub(super) struct Canvas<'a> {
    backend: SVGBackend<'a>,
}

/// Draws a picture of `width` × `height` display units and returns it as SVG; `label` is the text for screen readers.
pub(super) fn picture(
    width: f64,
    height: f64,
    skin: Skin,
    label: &str,
    draw: impl FnOnce(&mut Canvas<'_>),
) -> String {
    let mut raw = String::new();
    let fine = |v: f64| (v * FINE).round() as u32;
    {
        let mut canvas = Canvas {
            backend: SVGBackend::with_string(&mut raw, (fine(width), fine(height))),
        };
        draw(&mut canvas);
        // Writing to a string does not fail.
        let _ = canvas.backend.present();
    }
    let body = raw.split_once('\n').map_or("", |(_, body)| body);
    let mut out = String::with_capacity(raw.len());
    let label = escape(label);
    let view = format!(
        "viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{label}\"",
        fine(width),
        fine(height)
    );
    let round = "stroke-linejoin=\"round\" stroke-linecap=\"round\"";
    // Writing to a string does not fail.
    let _ = match skin {
        Skin::Page => writeln!(
            out,
            "<svg class=\"chart\" style=\"--drawn:{width}\" {view} {round}>"
        ),
        Skin::Picture => writeln!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" {view} {round}>\n<title>{label}</title>"
        ),
    };
    inked(body, skin, &mut out);
    out
}

/// Copies `body` with every sentinel replaced and every needless attribute omitted.
fn inked(body: &str, skin: Skin, out: &mut String) {
    let body = body.replace(" opacity=\"1\"", "").replace(" \"/>", "\"/>");
    let mut rest = body.as_str();
    while let Some(at) = rest.find("=\"#0102") {
        let name = rest[..at]
            .rfind(' ')
            .map_or("", |space| &rest[space + 1..at]);
        let code = rest
            .get(at + 7..at + 9)
            .and_then(|digits| usize::from_str_radix(digits, 16).ok());
        let (class, colour) = code.and_then(|c| INKS.get(c)).copied().unwrap_or(INKS[0]);
        out.push_str(&rest[..at - name.len()]);
        // Writing to a string does not fail.
        let _ = match skin {
            Skin::Page => write!(
                out,
                "class=\"{}-{class}\"",
                if name == "fill" { 'f' } else { 'l' }
            ),
            Skin::Picture => write!(out, "{name}=\"{colour}\""),
        };
        rest = rest.get(at + 10..).unwrap_or("");
    }
    out.push_str(rest);
}

impl Canvas<'_> {
    fn unit(v: f64) -> i32 {
        // The cast saturates, and a NaN would become 0; axes never give either.
        (v * FINE).round() as i32
    }

    fn point((x, y): (f64, f64)) -> (i32, i32) {
        (Self::unit(x), Self::unit(y))
    }

    fn shape(ink: Ink, opacity: f64, width: f64) -> ShapeStyle {
        let color: RGBAColor = ink.sentinel().mix(opacity);
        ShapeStyle {
            color,
            filled: false,
            stroke_width: (width * FINE).round() as u32,
        }
    }

    // Every call below writes to a string, which does not fail.

    /// A straight line.
    pub(crate) fn line(&mut self, from: (f64, f64), to: (f64, f64), ink: Ink, width: f64) {
        let _ = self.backend.draw_line(
            Self::point(from),
            Self::point(to),
            &Self::shape(ink, 1.0, width),
        );
    }

    /// A line through `points`; one alone is a dot.
    pub(crate) fn path(&mut self, points: &[(f64, f64)], ink: Ink, width: f64) {
        match points {
            [] => {}
            [alone] => self.dot(*alone, ink, width),
            _ => {
                let mut places: Vec<_> = points.iter().map(|&p| Self::point(p)).collect();
                places.dedup();
                let _ = self
                    .backend
                    .draw_path(places, &Self::shape(ink, 1.0, width));
            }
        }
    }

    /// A filled circle.
    pub(crate) fn dot(&mut self, at: (f64, f64), ink: Ink, radius: f64) {
        let radius = Self::unit(radius).max(1).unsigned_abs();
        let _ =
            self.backend
                .draw_circle(Self::point(at), radius, &Self::shape(ink, 1.0, 0.0), true);
    }

    /// A filled rectangle between two corners.
    pub(crate) fn block(
        &mut self,
        upper_left: (f64, f64),
        lower_right: (f64, f64),
        ink: Ink,
        opacity: f64,
    ) {
        let style = Self::shape(ink, opacity, 0.0);
        let _ = self.backend.draw_rect(
            Self::point(upper_left),
            Self::point(lower_right),
            &style,
            true,
        );
    }

    /// Text, centred on its point vertically.
    pub(crate) fn text(&mut self, text: &str, at: (f64, f64), how: Lettering) {
        let style = if how.bold {
            FontStyle::Bold
        } else {
            FontStyle::Normal
        };
        let turn = if how.upright {
            FontTransform::Rotate270
        } else {
            FontTransform::None
        };
        let font = FontDesc::new(FontFamily::SansSerif, how.size * FINE * FONT_FACTOR, style)
            .transform(turn);
        let across = match how.anchor {
            Anchor::Left => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::Right => HPos::Right,
        };
        let color = how.ink.sentinel();
        let style = TextStyle::from(font)
            .color(&color)
            .pos(Pos::new(across, VPos::Center));
        let _ = self
            .backend
            .draw_text(&printable(text), &style, Self::point(at));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(skin: Skin) -> String {
        picture(100.0, 50.0, skin, "a <b> \"c\"", |canvas| {
            canvas.line((0.0, 0.0), (10.5, 20.0), Ink::Series(1), 1.5);
            canvas.path(&[(1.0, 1.0), (2.0, 2.0), (2.0, 2.0)], Ink::Series(7), 1.0);
            canvas.path(&[(1.0, 1.0)], Ink::Alarm, 1.0);
            canvas.block((0.0, 0.0), (3.0, 4.0), Ink::Series(0), 0.3);
            canvas.text(
                "fill=\"#010204\" <&> \u{0}",
                (5.0, 5.0),
                Lettering::new(12.0, Ink::Text).upright().bold(),
            );
        })
    }

    #[test]
    fn canvas_is_finer_than_the_display() {
        let svg = sample(Skin::Picture);
        assert!(
            svg.contains("width=\"100\" height=\"50\" viewBox=\"0 0 800 400\""),
            "{svg}"
        );
        assert!(svg.contains("x2=\"84\" y2=\"160\""));
        assert!(svg.contains("stroke-width=\"12\""));
        assert!(svg.contains("points=\"8,8 16,16\""));
        assert!(svg.contains("font-size=\"96\""));
    }

    #[test]
    fn text_cannot_forge_markers() {
        let (page, file) = (sample(Skin::Page), sample(Skin::Picture));
        assert!(
            page.contains("class=\"l-s1\"")
                && page.contains("class=\"f-alarm\"")
                && page.contains("class=\"f-text\"")
        );
        assert!(page.contains("fill=&quot;#010204&quot; &lt;&amp;&gt;"));
        assert!(file.contains("stroke=\"#d55e00\"") && !page.contains("xmlns"));
        for svg in [page, file] {
            assert!(!svg.contains("\"#0102"), "{svg}");
            assert!(svg.contains("aria-label=\"a &lt;b&gt; &quot;c&quot;\""));
        }
    }

    #[test]
    fn text_is_cut_to_its_width() {
        assert_eq!(fitted("short", 12.0, 500.0), "short");
        let cut = fitted(&"long ".repeat(40), 12.0, 80.0);
        assert!(cut.ends_with('…') && text_width(&cut, 12.0) <= 80.0);
    }
}
