//! Counts over a logarithmic time axis, percentiles and deadline marked.

use super::axis::{Axis, count_decade, is_drawable, micros_decade};
use super::canvas::{Anchor, Canvas, Ink, Lettering, text_width};
use super::charts::{Area, FOOT, HEAD, LABEL, Plot, Scaled, sentence, title};
use super::histogram::LogBins;
use super::text::micros;
use gusset_record::rt::timing::Percentiles;

/// Counts over time, both axes logarithmic, percentiles marked.
#[derive(Debug, Clone, Copy)]
pub(super) struct HistogramChart<'a> {
    pub title: &'a str,
    /// (upper edge in µs, count).
    pub histogram: &'a [(f64, u64)],
    pub percentiles: &'a Percentiles,
    /// Values beyond it are misses, in µs.
    pub deadline_us: Option<f64>,
    pub ink: Ink,
}

/// Height of one row of percentile labels.
const MARK_ROW: f64 = 15.0;
/// Rows of percentile labels.
const MOST_ROWS: usize = 6;

impl HistogramChart<'_> {
    /// Draws the chart into `area`.
    pub(crate) fn draw(&self, canvas: &mut Canvas<'_>, area: Area) {
        let Some(bins) = LogBins::new(self.histogram) else {
            return sentence(canvas, area, self.title, "Nothing was counted.");
        };
        title(canvas, area, self.title, area.w);
        let (lo, _) = bins.edges(0);
        let (_, hi) = bins.edges(bins.counts.len() - 1);
        let marks = self.marks();
        let far = marks.iter().map(|m| m.0).fold(hi, f64::max);
        // At least two decades, so that a narrow histogram is not blown up out of proportion.
        let wide = (far * 1.3).max(lo * 100.0);
        let x = Axis::logarithmic(lo / 1.3, wide);
        // Room for the rows of labels above the highest bar: a logarithmic axis grows by a power.
        let share = (1.0
            - (marks.len().min(4) as f64 * MARK_ROW + 6.0) / (area.h - HEAD - FOOT).max(60.0))
        .clamp(0.3, 1.0);
        let top = libm::pow(bins.top() as f64 / 0.7 * 1.2, 1.0 / share) * 0.7;
        let (Some(x), Some(y)) = (x, Axis::logarithmic(0.7, top)) else {
            return sentence(canvas, area, self.title, "There is nothing to draw.");
        };
        let across = Scaled {
            ticks: x.decades(micros_decade),
            name: "time, logarithmic".to_owned(),
        };
        let ticks = y
            .decades(count_decade)
            .into_iter()
            .filter(|t| t.at <= bins.top() as f64 * 1.5);
        let up = Scaled {
            ticks: ticks.collect(),
            name: "count, logarithmic".to_owned(),
        };
        let plot = Plot::frame(canvas, area, (x, &across), (y, &up));
        let bottom = plot.inner.y + plot.inner.h;
        for (i, &count) in bins
            .counts
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0)
        {
            let (from, to) = bins.edges(i);
            let is_late = self.deadline_us.is_some_and(|deadline| from >= deadline);
            let ink = if is_late { Ink::Alarm } else { self.ink };
            let (left, right) = (plot.across(from), plot.across(to));
            canvas.block(
                (left, plot.up(count as f64)),
                ((right - 0.6).max(left + 0.5), bottom),
                ink,
                0.8,
            );
        }
        let marks: Vec<_> = marks.into_iter().filter(|m| x.holds(m.0)).collect();
        let at: Vec<_> = marks
            .iter()
            .map(|m| (plot.across(m.0), text_width(&m.1, LABEL)))
            .collect();
        let right = plot.inner.x + plot.inner.w;
        for ((_, words, ink), label) in marks.iter().zip(labels(&at, right)) {
            let y = plot.inner.y + 4.0 + MARK_ROW * label.row as f64;
            canvas.line((label.at, y - 5.0), (label.at, bottom), *ink, 1.0);
            let ink = if *ink == Ink::Alarm {
                Ink::Alarm
            } else {
                Ink::Text
            };
            let (x, anchor) = if label.is_left {
                (label.at - 4.0, Anchor::Right)
            } else {
                (label.at + 4.0, Anchor::Left)
            };
            canvas.text(words, (x, y), Lettering::new(LABEL, ink).anchored(anchor));
        }
    }

    /// Marks from the left: place in µs, words, colour.
    fn marks(&self) -> Vec<(f64, String, Ink)> {
        let p = self.percentiles;
        let named = [
            ("p50", p.p50),
            ("p99", p.p99),
            ("p99.9", p.p99_9),
            ("max", p.max),
        ];
        let marks = named.into_iter().map(|(name, us)| (us, name, Ink::Frame));
        let deadline = self.deadline_us.map(|us| (us, "deadline", Ink::Alarm));
        let mut all: Vec<_> = marks
            .chain(deadline)
            .filter(|m| m.0 > 0.0 && is_drawable(m.0))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Of few values several percentiles are one: they share a label.
        let mut marks: Vec<(f64, String, Ink)> = Vec::new();
        for (us, name, ink) in all {
            match marks.last_mut() {
                Some((at, words, _)) if *at == us && ink != Ink::Alarm => {
                    *words = format!("{words}, {name}");
                }
                _ => marks.push((us, name.to_owned(), ink)),
            }
        }
        for (us, words, _) in &mut marks {
            *words = format!("{words} {}", micros(*us));
        }
        marks
    }
}

/// Place of a mark's label: `row` from above, left or right of its line.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Label {
    at: f64,
    from: f64,
    to: f64,
    row: usize,
    is_left: bool,
}

/// Rows for labels at (place, width), in rising order of place, so that no label lies on another or on a line, which
/// runs from its own row downwards.
fn labels(marks: &[(f64, f64)], right: f64) -> Vec<Label> {
    let make = |&(at, width): &(f64, f64)| {
        let is_left = at + width + 8.0 > right;
        let (from, to) = if is_left {
            (at - width - 8.0, at)
        } else {
            (at, at + width + 8.0)
        };
        Label {
            at,
            from,
            to,
            row: 0,
            is_left,
        }
    };
    let all: Vec<Label> = marks.iter().map(make).collect();
    // Each side is a staircase away from its end of the picture.
    let rightwards = all.iter().filter(|label| !label.is_left);
    let leftwards = all.iter().rev().filter(|label| label.is_left);
    let mut placed: Vec<Label> = Vec::new();
    for &label in rightwards.chain(leftwards) {
        let fits = |row: usize| {
            placed.iter().all(|other| {
                let apart = label.to <= other.from || label.from >= other.to;
                let clear_of_line =
                    other.row > row || !(label.from < other.at && other.at < label.to);
                let line_is_clear =
                    other.row < row || !(other.from < label.at && label.at < other.to);
                (apart || other.row != row) && clear_of_line && line_is_clear
            })
        };
        // Where every row crosses a line, a label crosses it, but lies on no other label.
        let is_free = |row: &usize| {
            let mut others = placed.iter().filter(|other| other.row == *row);
            others.all(|other| label.to <= other.from || label.from >= other.to)
        };
        let row = (0..MOST_ROWS).find(|&row| fits(row));
        let row = row.or_else(|| (0..MOST_ROWS).rev().find(is_free));
        let row = row.unwrap_or(MOST_ROWS - 1);
        placed.push(Label { row, ..label });
    }
    placed.sort_by(|a, b| a.at.total_cmp(&b.at));
    placed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mark_labels_do_not_overlap() {
        let cases: [&[(f64, f64)]; 4] = [
            &[
                (100.0, 60.0),
                (110.0, 60.0),
                (118.0, 60.0),
                (380.0, 90.0),
                (395.0, 60.0),
            ],
            &[
                (100.0, 60.0),
                (140.0, 60.0),
                (200.0, 60.0),
                (350.0, 90.0),
                (390.0, 60.0),
            ],
            &[(10.0, 60.0), (10.0, 60.0), (10.0, 60.0)],
            &[],
        ];
        for marks in cases {
            let placed = labels(marks, 400.0);
            assert_eq!(placed.len(), marks.len());
            for (i, a) in placed.iter().enumerate() {
                assert!(a.to <= 400.0 && a.row < MOST_ROWS);
                for (j, b) in placed.iter().enumerate().filter(|(j, _)| *j != i) {
                    let overlap = a.from < b.to && b.from < a.to;
                    assert!(a.row != b.row || !overlap, "{i} {j} {placed:?}");
                    assert!(
                        b.row > a.row || !(a.from < b.at && b.at < a.to),
                        "{i} {j} {placed:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn labels_without_a_row_do_not_overlap() {
        let crowded = [
            (330.0, 60.0),
            (350.0, 90.0),
            (352.0, 90.0),
            (354.0, 90.0),
            (356.0, 80.0),
        ];
        let placed = labels(&crowded, 400.0);
        for (i, a) in placed.iter().enumerate() {
            let mut others = placed.iter().skip(i + 1).filter(|b| b.row == a.row);
            assert!(
                others.all(|b| a.to <= b.from || b.to <= a.from),
                "{placed:?}"
            );
        }
    }
}
