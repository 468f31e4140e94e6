//! Pictures of lines: histories over time, one quantity against another.

use super::axis::{Axis, extent, is_drawable, micros_decade};
use super::canvas::{Anchor, Canvas, Ink, Lettering, fitted, text_width};
use super::charts::{Area, FOOT, HEAD, LABEL, Plot, Quantity, Scaled, linear, sentence, title};
use super::thin;

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
    pub const fn history(title: &'a str, up: Quantity<'a>, lines: &'a [Line<'a>]) -> Self {
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
    pub fn draw(&self, canvas: &mut Canvas<'_>, area: Area) {
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
        let room = legend(canvas, area, self.lines);
        title(canvas, area, self.title, room);
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
        for line in self.lines {
            let range = (x.lo(), x.hi());
            let runs = match self.reduce {
                Reduce::Extremes => thin::extremes(line.x, line.y, range, columns),
                Reduce::Highest => thin::highest(line.x, line.y, range, columns),
            };
            for run in runs {
                let points: Vec<_> = run
                    .iter()
                    .map(|&(t, v)| (plot.across(t), plot.up(v)))
                    .collect();
                canvas.path(&points, line.ink, line.width);
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

/// Swatches and names at the upper right; returns the room that is left for the title.
fn legend(canvas: &mut Canvas<'_>, area: Area, lines: &[Line<'_>]) -> f64 {
    let mut right = area.x + area.w - 10.0;
    for line in lines.iter().rev().filter(|line| !line.name.is_empty()) {
        let name = fitted(line.name, LABEL, area.w / 4.0);
        canvas.text(
            &name,
            (right, area.y + 12.0),
            Lettering::new(LABEL, Ink::Soft).anchored(Anchor::Right),
        );
        right -= text_width(&name, LABEL) + 8.0;
        canvas.line(
            (right - 18.0, area.y + 12.0),
            (right, area.y + 12.0),
            line.ink,
            2.5,
        );
        right -= 36.0;
    }
    (right - area.x).max(60.0)
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

/// Largest distance of a left-out point from the drawn line, in display units: well below what an eye resolves.
const LOOP_TOLERANCE: f64 = 0.12;
/// Points beyond which the tolerance is doubled, up to a pixel: a noisy loop must not make a page of megabytes.
const LOOP_POINTS: usize = 12_000;
/// Radius of what is one point, in display units.
const DOT: f64 = 3.0;

impl<'a> LoopChart<'a> {
    /// Draws the chart into `area`.
    pub fn draw(&self, canvas: &mut Canvas<'_>, area: Area) {
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
        let room = legend(canvas, area, self.lines);
        title(canvas, area, self.title, room);
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
