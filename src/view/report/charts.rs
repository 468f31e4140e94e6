//! Common parts of all pictures: title, frame, grid, numbers and names of both axes.
//!
//! A picture draws itself into an [`Area`] of a [`Canvas`], so that a page shows one and a wide picture shows several.
//! Data that cannot be drawn leave a sentence in the area, never an empty frame and never a panic.

use super::axis::{Axis, Tick};
use super::canvas::{Anchor, Canvas, Ink, Lettering, fitted, text_width};
use super::text::scaled;

/// Title size.
pub(super) const TITLE: f64 = 14.0;
/// Size of numbers and labels.
pub(super) const LABEL: f64 = 12.0;
/// Height of the title's line.
pub(super) const HEAD: f64 = 30.0;
/// Height of tick labels, and of the axis name below them.
pub(super) const FOOT: f64 = 40.0;

/// Room kept for numbers at the left, so that pictures above each other mostly share their time axis.
const LEAST_LABEL: f64 = 30.0;

/// Least room right of the frame.
const LEAST_MARGIN: f64 = 10.0;

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
    pub(crate) const fn whole(w: f64, h: f64) -> Self {
        Self {
            x: 0.0,
            y: 0.0,
            w,
            h,
        }
    }
}

/// Quantity of an axis: words and SI unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Quantity<'a> {
    pub words: &'a str,
    pub unit: &'a str,
}

/// A frame with both axes, ready for lines.
pub(super) struct Plot {
    /// Where lines and bars go.
    pub inner: Area,
    x: Axis,
    y: Axis,
}

/// Ticks and name of one axis.
pub(super) struct Scaled {
    pub ticks: Vec<Tick>,
    pub name: String,
}

/// Ticks and name of a linear axis, in the prefix that suits its range if `prefix` allows one.
pub(super) fn linear(axis: &Axis, quantity: Quantity<'_>, about: usize, prefix: bool) -> Scaled {
    let size = axis.lo().abs().max(axis.hi().abs());
    let unit = if prefix {
        scaled(size, quantity.unit)
    } else {
        scaled(1.0, quantity.unit)
    };
    let name = if unit.unit.is_empty() {
        quantity.words.to_owned()
    } else {
        format!("{} ({})", quantity.words, unit.unit)
    };
    Scaled {
        ticks: axis.ticks(about, unit.factor),
        name,
    }
}

/// Title at the upper left of `area`.
pub(super) fn title(canvas: &mut Canvas<'_>, area: Area, words: &str, room: f64) {
    let words = fitted(words, TITLE * 1.06, room);
    canvas.text(
        &words,
        (area.x, area.y + 12.0),
        Lettering::new(TITLE, Ink::Text).bold(),
    );
}

/// A sentence in the middle of `area`, instead of a picture.
pub(super) fn sentence(canvas: &mut Canvas<'_>, area: Area, heading: &str, words: &str) {
    title(canvas, area, heading, area.w);
    let at = (area.x + area.w / 2.0, area.y + area.h / 2.0);
    canvas.text(
        &fitted(words, LABEL, area.w),
        at,
        Lettering::new(LABEL, Ink::Soft).anchored(Anchor::Middle),
    );
}

/// Room that the numbers and the name of an upright axis take.
pub(super) fn left_of(up: &Scaled) -> f64 {
    let labels = up.ticks.iter().map(|t| text_width(&t.label, LABEL));
    let widest = labels.fold(LEAST_LABEL, f64::max);
    widest + if up.name.is_empty() { 10.0 } else { 30.0 }
}

/// Room right of the frame: half of the last number may extend beyond the end of an axis that leaves this room.
pub(super) fn right_of(across: &Scaled, x: Axis, wide: f64) -> f64 {
    let beyond = across
        .ticks
        .iter()
        .map(|tick| text_width(&tick.label, LABEL) / 2.0 + 2.0 - (1.0 - x.place(tick.at)) * wide);
    beyond.fold(LEAST_MARGIN, f64::max)
}

impl Plot {
    /// Draws frame, grid, numbers and names, and returns the area of the lines.
    pub fn frame(
        canvas: &mut Canvas<'_>,
        area: Area,
        (x, across): (Axis, &Scaled),
        (y, up): (Axis, &Scaled),
    ) -> Self {
        let named = !up.name.is_empty();
        let left = left_of(up);
        let foot = if across.name.is_empty() {
            FOOT - 18.0
        } else {
            FOOT
        };
        let wide = area.w - left;
        let margin = right_of(across, x, wide);
        let inner = Area {
            x: area.x + left,
            y: area.y + HEAD,
            w: (wide - margin).max(10.0),
            h: (area.h - HEAD - foot).max(10.0),
        };
        let plot = Self { inner, x, y };
        let (right, bottom) = (inner.x + inner.w, inner.y + inner.h);
        let small = Lettering::new(LABEL, Ink::Soft);
        for tick in &up.ticks {
            let at = plot.up(tick.at);
            if !tick.label.is_empty() {
                canvas.line((inner.x, at), (right, at), Ink::Grid, 1.0);
                canvas.text(
                    &tick.label,
                    (inner.x - 7.0, at),
                    small.anchored(Anchor::Right),
                );
            }
        }
        let mut free_from = f64::NEG_INFINITY;
        for tick in &across.ticks {
            let at = plot.across(tick.at);
            let is_named = !tick.label.is_empty();
            if is_named {
                canvas.line((at, inner.y), (at, bottom), Ink::Grid, 1.0);
            }
            canvas.line(
                (at, bottom),
                (at, bottom + if is_named { 5.0 } else { 3.0 }),
                Ink::Frame,
                1.0,
            );
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
        canvas.line((inner.x, bottom), (right, bottom), Ink::Frame, 1.0);
        if named {
            // A name longer than the axis extends below it, and leaves the title free.
            let room = area.y + area.h - inner.y;
            let words = fitted(&up.name, LABEL, room);
            let half = text_width(&words, LABEL) / 2.0;
            let middle = (inner.y + inner.h / 2.0).max(inner.y + half.min(room / 2.0));
            let at = (area.x + 7.0, middle);
            canvas.text(&words, at, small.anchored(Anchor::Middle).upright());
        }
        let words = fitted(&across.name, LABEL, area.w);
        canvas.text(
            &words,
            (inner.x + inner.w / 2.0, bottom + 32.0),
            small.anchored(Anchor::Middle),
        );
        plot
    }

    /// Display position of a value of the horizontal axis.
    pub(crate) fn across(&self, value: f64) -> f64 {
        self.inner.x + self.inner.w * self.x.place(value)
    }

    /// Display position of a value of the vertical axis.
    pub(crate) fn up(&self, value: f64) -> f64 {
        self.inner.y + self.inner.h * (1.0 - self.y.place(value))
    }

    /// A quiet line at zero.
    pub(crate) fn zero_line(&self, canvas: &mut Canvas<'_>) {
        if self.y.holds(0.0) {
            let at = self.up(0.0);
            canvas.line(
                (self.inner.x, at),
                (self.inner.x + self.inner.w, at),
                Ink::Frame,
                0.75,
            );
        }
    }
}
