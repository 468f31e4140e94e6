//! Pictures of lines: histories over time, one quantity against another.

use super::axis::{Axis, extent, is_drawable, micros_decade};
use super::canvas::{Canvas, Ink, Lettering, fitted, text_width};
use super::charts::{
    Area, FOOT, HEAD, LABEL, Plot, Quantity, Scaled, TITLE, linear, sentence, title,
};
use super::thin;
use gusset_motion::metrics;

/// One line of a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<'a> {
    pub name: &'a str,
    pub x: &'a [f64],
    pub y: &'a [f64],
    pub ink: Ink,
    pub width: f64,
}

/// How many samples become one column of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reduce {
    /// First, lowest, highest, last: the same line with fewer points.
    Extremes,
    /// The highest only, on a logarithmic axis: for lateness.
    Highest,
}

/// Several lines over time.
#[derive(Debug, Clone, Copy)]
pub(super) struct TimeChart<'a> {
    pub title: &'a str,
    pub up: Quantity<'a>,
    pub lines: &'a [Line<'a>],
    /// Times that are marked as going wrong.
    pub marks: &'a [f64],
    pub reduce: Reduce,
    /// False leaves out the name of the time axis, where another picture below carries it.
    pub named_time: bool,
}

impl<'a> TimeChart<'a> {
    /// Values over test time, unmarked: no peak is lost.
    pub(crate) const fn history(title: &'a str, up: Quantity<'a>, lines: &'a [Line<'a>]) -> Self {
        Self {
            title,
            up,
            lines,
            marks: &[],
            reduce: Reduce::Extremes,
            named_time: true,
        }
    }
}

impl TimeChart<'_> {
    /// Draws the chart into `area`.
    pub(crate) fn draw(&self, canvas: &mut Canvas<'_>, area: Area) {
        let x = self.lines.iter().flat_map(|line| ends(line.x));
        let values = self.lines.iter().flat_map(|line| line.y.iter().copied());
        let y = match self.reduce {
            Reduce::Extremes => Axis::around(values),
            Reduce::Highest => Axis::logarithmic_around(values),
        };
        let range = extent(x).and_then(|(lo, hi)| Axis::exactly(lo, hi));
        let (Some(x), Some(y)) = (range, y) else {
            return sentence(
                canvas,
                area,
                self.title,
                "There is nothing to draw: no finite values were recorded.",
            );
        };
        let area = headed(canvas, area, self.title, self.lines);
        let about = ((area.h - HEAD - FOOT) / 38.0).clamp(3.0, 6.0) as usize;
        let up = match self.reduce {
            Reduce::Extremes => linear(&y, self.up, about, true),
            // Lateness is kept in seconds; the decades are named in µs.
            Reduce::Highest => Scaled {
                ticks: y.decades(|digit, e| micros_decade(digit, e + 6)),
                name: self.up.words.to_owned(),
            },
        };
        let time = Quantity {
            words: if self.named_time { "test time" } else { "" },
            unit: "s",
        };
        let mut across = linear(&x, time, (area.w / 90.0).clamp(3.0, 12.0) as usize, false);
        if !self.named_time {
            across.name.clear();
        }
        let plot = Plot::frame(canvas, area, (x, &across), (y, &up));
        if self.reduce == Reduce::Extremes {
            plot.zero_line(canvas);
        }
        let columns = plot.inner.w.round().max(1.0) as usize;
        // The largest lies at the bottom, so that the smaller ones are seen.
        let size = |line: &Line<'_>| metrics::peak(line.y).map_or(0.0, |p| p.value.abs());
        let mut lines: Vec<&Line<'_>> = self.lines.iter().collect();
        lines.sort_by(|a, b| size(b).total_cmp(&size(a)));
        for line in lines {
            let range = (x.lo(), x.hi());
            let runs = match self.reduce {
                Reduce::Extremes => thin::extremes(line.x, line.y, range, columns),
                Reduce::Highest => thin::highest(line.x, line.y, range, columns),
            };
            for run in runs {
                let points = run.iter().map(|&(t, v)| (plot.across(t), plot.up(v)));
                for run in thin::within(points, HISTORY_TOLERANCE) {
                    canvas.path(&run, line.ink, line.width);
                }
            }
        }
        let mut last = f64::NEG_INFINITY;
        for &time in self.marks.iter().filter(|&&t| x.holds(t)) {
            let at = plot.across(time);
            // Marks closer than half a display unit would be one mark.
            if (at - last).abs() >= 0.5 {
                canvas.line(
                    (at, plot.inner.y),
                    (at, plot.inner.y + 9.0),
                    Ink::Alarm,
                    1.5,
                );
                last = at;
            }
        }
    }
}

/// Length of a swatch, and the room before it and behind it.
const SWATCH: f64 = 18.0;
const GAP: f64 = 8.0;
/// Height of a row of the legend below the title.
const LEGEND_ROW: f64 = 18.0;

/// Title and legend. A legend that does not fit beside the title is below it; the rest of the area is returned.
fn headed(canvas: &mut Canvas<'_>, area: Area, words: &str, lines: &[Line<'_>]) -> Area {
    let named = lines.iter().filter(|line| !line.name.is_empty());
    let entries: Vec<(String, f64, Ink)> = named
        .map(|line| {
            let name = fitted(line.name, LABEL, area.w / 4.0);
            let wide = SWATCH + GAP + text_width(&name, LABEL) + 2.0 * GAP;
            (name, wide, line.ink)
        })
        .collect();
    let wide: f64 = entries.iter().map(|(_, wide, _)| wide).sum();
    let of_title = text_width(words, TITLE) * 1.1;
    let is_beside = of_title + wide + 4.0 * GAP <= area.w;
    title(
        canvas,
        area,
        words,
        area.w - if is_beside { wide } else { 0.0 },
    );
    let left = if is_beside {
        area.x + area.w - wide
    } else {
        area.x
    };
    let (mut x, mut y) = (
        left,
        area.y + 12.0 + if is_beside { 0.0 } else { LEGEND_ROW },
    );
    for (name, wide, ink) in &entries {
        if x + wide > area.x + area.w + 2.0 * GAP && x > left {
            (x, y) = (left, y + LEGEND_ROW);
        }
        canvas.line((x, y), (x + SWATCH, y), *ink, 2.5);
        let at = (x + SWATCH + GAP, y);
        canvas.text(name, at, Lettering::new(LABEL, Ink::Soft));
        x += wide;
    }
    let below = y - 12.0 - area.y;
    Area {
        y: area.y + below,
        h: area.h - below,
        ..area
    }
}

fn ends(times: &[f64]) -> impl Iterator<Item = f64> {
    let first = times.iter().copied().find(|&t| is_drawable(t));
    let last = times.iter().rev().copied().find(|&t| is_drawable(t));
    first.into_iter().chain(last)
}

/// One quantity against another, of one thing or of several.
#[derive(Debug, Clone, Copy)]
pub(super) struct LoopChart<'a> {
    pub title: &'a str,
    pub across: Quantity<'a>,
    pub up: Quantity<'a>,
    pub lines: &'a [Line<'a>],
}

/// Largest distance of an omitted point of a history from the drawn line, in display units.
const HISTORY_TOLERANCE: f64 = 0.15;
/// Largest distance of an omitted point from the drawn line, in display units: well below the resolution of an eye.
const LOOP_TOLERANCE: f64 = 0.12;
/// Points beyond which the tolerance is doubled, up to a pixel: a noisy loop must not make a page of megabytes.
const LOOP_POINTS: usize = 5_000;
/// Radius within which points count as one, in display units.
const DOT: f64 = 3.0;

impl<'a> LoopChart<'a> {
    /// Draws the chart into `area`.
    pub(crate) fn draw(&self, canvas: &mut Canvas<'_>, area: Area) {
        let both = |line: &Line<'a>| line.x.iter().copied().zip(line.y.iter().copied());
        let all = || self.lines.iter().flat_map(both);
        let drawable = || all().filter(|(x, y)| is_drawable(*x) && is_drawable(*y));
        let x = Axis::around(drawable().map(|p| p.0));
        let y = Axis::around(drawable().map(|p| p.1));
        let (Some(x), Some(y)) = (x, y) else {
            return sentence(
                canvas,
                area,
                self.title,
                "There is nothing to draw: no finite values were recorded.",
            );
        };
        let area = headed(canvas, area, self.title, self.lines);
        let across = linear(
            &x,
            self.across,
            (area.w / 70.0).clamp(3.0, 8.0) as usize,
            true,
        );
        let up = linear(&y, self.up, (area.h / 50.0).clamp(3.0, 8.0) as usize, true);
        let plot = Plot::frame(canvas, area, (x, &across), (y, &up));
        plot.zero_line(canvas);
        if x.holds(0.0) {
            let at = plot.across(0.0);
            canvas.line(
                (at, plot.inner.y),
                (at, plot.inner.y + plot.inner.h),
                Ink::Frame,
                0.75,
            );
        }
        for line in self.lines {
            let mut tolerance = LOOP_TOLERANCE;
            let runs = loop {
                let places = both(line).map(|(px, py)| {
                    let on = |v: f64, place: f64| if is_drawable(v) { place } else { f64::NAN };
                    (on(px, plot.across(px)), on(py, plot.up(py)))
                });
                let runs = thin::within(places, tolerance);
                if tolerance >= 0.9 || runs.iter().map(Vec::len).sum::<usize>() <= LOOP_POINTS {
                    break runs;
                }
                tolerance *= 2.0;
            };
            for run in &runs {
                canvas.path(run, line.ink, line.width);
                // A line of no length is not seen.
                if let Some(&at) = run.first()
                    && run.iter().all(|point| *point == at)
                {
                    canvas.dot(at, line.ink, DOT);
                }
            }
        }
    }
}
