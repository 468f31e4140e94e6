//! A matrix of scatter pictures: all pairs of some numbers, with a histogram of each on the diagonal.

use super::axis::{Axis, Tick, is_drawable};
use super::canvas::{Anchor, Canvas, Ink, Lettering, Skin, fitted, picture, text_width};
use super::charts::{Area, HEAD, sentence, title};
use super::text::{fixed, scaled};

/// One number of each test.
#[derive(Debug, Clone, Copy)]
pub struct Variable<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its unit.
    pub unit: &'a str,
    /// One value of each test.
    pub values: &'a [f64],
}

/// All pairs of `variables`.
#[derive(Debug, Clone, Copy)]
pub struct ScatterMatrix<'a> {
    /// Heading.
    pub title: &'a str,
    /// The numbers that are paired.
    pub variables: &'a [Variable<'a>],
    /// True for tests in the colour of `marked_as`.
    pub marked: &'a [bool],
    /// Meaning of `marked`.
    pub marked_as: &'a str,
    /// Correlation of each pair.
    pub correlations: &'a [Vec<f64>],
    /// Most dots of one picture.
    pub most_dots: usize,
}

/// Size of numbers and names.
const SMALL: f64 = 11.0;
/// Gap between two pictures.
const GAP: f64 = 8.0;
/// Room below the pictures for numbers and names of two lines.
const BELOW: f64 = 50.0;
/// Room at the left for names of two lines.
const NAMES: f64 = 32.0;
/// Most room for numbers at the left.
const MOST_NUMBERS: f64 = 80.0;
/// Most bars of a histogram.
const MOST_BARS: usize = 20;
/// Tick labels of an axis, about.
const TICKS: usize = 3;

impl ScatterMatrix<'_> {
    /// The picture as SVG for a page of `width`.
    pub fn svg(&self, width: f64) -> String {
        let sides: Option<Vec<Side>> = self.variables.iter().map(Side::of).collect();
        let count = self.variables.len();
        let numbers = sides.iter().flatten().skip(1).flat_map(|side| &side.ticks);
        let numbers = numbers.map(|tick| text_width(&tick.label, SMALL));
        let left = NAMES + 8.0 + numbers.fold(20.0, f64::max).min(MOST_NUMBERS);
        let side =
            (width - left - 10.0 - GAP * count.saturating_sub(1) as f64) / count.max(1) as f64;
        let side = side.clamp(40.0, 260.0);
        let whole = side * count as f64 + GAP * count.saturating_sub(1) as f64;
        let (wide, high) = (left + whole + 10.0, HEAD + whole + BELOW);
        picture(wide, high, Skin::Page, self.title, |canvas| {
            let Some(sides) = &sides else {
                let area = Area::whole(wide, high);
                return sentence(canvas, area, self.title, "There is nothing to draw.");
            };
            self.heading(canvas, wide);
            for row in 0..count {
                for column in 0..count {
                    let area = Area {
                        x: left + (side + GAP) * column as f64,
                        y: HEAD + (side + GAP) * row as f64,
                        w: side,
                        h: side,
                    };
                    self.cell(canvas, area, sides, (row, column));
                    if row + 1 == count {
                        below(canvas, area, &sides[column]);
                    }
                    if column == 0 {
                        // The picture at the upper left is a histogram, whose height has no numbers.
                        beside(canvas, area, &sides[row], row > 0);
                    }
                }
            }
        })
    }

    /// The title, and the meaning of the colours if there are two.
    fn heading(&self, canvas: &mut Canvas<'_>, wide: f64) {
        let mut room = wide;
        if self.marked.contains(&true) {
            let text = text_width(self.marked_as, SMALL);
            room -= text + 30.0;
            let soft = Lettering::new(SMALL, Ink::Soft);
            canvas.dot((wide - text - 20.0, 12.0), Ink::Series(1), 3.5);
            canvas.text(self.marked_as, (wide - text - 12.0, 12.0), soft);
        }
        title(canvas, Area::whole(wide, HEAD), self.title, room);
    }

    fn cell(
        &self,
        canvas: &mut Canvas<'_>,
        area: Area,
        sides: &[Side],
        (row, column): (usize, usize),
    ) {
        if row < column {
            let found = self.correlations.get(row).and_then(|line| line.get(column));
            let found = found.copied().unwrap_or(f64::NAN);
            let words = if found.is_finite() {
                fixed(found, 2)
            } else {
                "–".to_owned()
            };
            let size = SMALL + 9.0 * found.abs().min(1.0);
            let how = Lettering::new(size, Ink::Text).anchored(Anchor::Middle);
            let middle = (area.x + area.w / 2.0, area.y + area.h / 2.0);
            canvas.text(&words, middle, how);
        } else if row == column {
            histogram(canvas, area, &sides[row].axis, self.variables[row].values);
        } else {
            let (x, y) = (&self.variables[column], &self.variables[row]);
            let dots = x.values.iter().zip(y.values).zip(self.marked);
            // Marked dots lie above the others.
            for marked in [false, true] {
                let dots = dots.clone().take(self.most_dots);
                for ((x, y), _) in dots.filter(|(_, is_marked)| **is_marked == marked) {
                    if is_drawable(*x) && is_drawable(*y) {
                        let across = area.x + area.w * sides[column].axis.place(*x);
                        let up = area.y + area.h * (1.0 - sides[row].axis.place(*y));
                        canvas.dot((across, up), Ink::Series(u8::from(marked)), 1.6);
                    }
                }
            }
        }
        outline(canvas, area);
    }
}

/// The axis of a number, with its labels in the prefix that suits them.
struct Side {
    axis: Axis,
    ticks: Vec<Tick>,
    /// With the unit.
    name: String,
}

impl Side {
    fn of(variable: &Variable<'_>) -> Option<Self> {
        let axis = Axis::around(variable.values.iter().copied())?;
        let unit = scaled(axis.lo().abs().max(axis.hi().abs()), variable.unit);
        Some(Self {
            axis,
            ticks: axis.ticks(TICKS, unit.factor),
            name: match unit.unit.as_str() {
                "" => variable.name.to_owned(),
                unit => format!("{} ({unit})", variable.name),
            },
        })
    }
}

fn outline(canvas: &mut Canvas<'_>, Area { x, y, w, h }: Area) {
    let corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h), (x, y)];
    canvas.path(&corners, Ink::Frame, 1.0);
}

/// Bars over the axis of a number.
fn histogram(canvas: &mut Canvas<'_>, area: Area, axis: &Axis, values: &[f64]) {
    let drawable: Vec<f64> = values.iter().copied().filter(|v| is_drawable(*v)).collect();
    let bars = ((drawable.len() as f64).sqrt().ceil() as usize).clamp(4, MOST_BARS);
    let mut counts = vec![0_u32; bars];
    for value in &drawable {
        counts[((axis.place(*value) * bars as f64) as usize).min(bars - 1)] += 1;
    }
    let most = f64::from(counts.iter().copied().max().unwrap_or(1).max(1));
    let wide = area.w / bars as f64;
    let bottom = area.y + area.h;
    for (index, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let left = area.x + wide * index as f64;
        let top = bottom - 0.92 * area.h * f64::from(*count) / most;
        canvas.block(
            (left + 0.3, top),
            (left + wide - 0.3, bottom),
            Ink::Series(0),
            0.6,
        );
    }
}

/// Numbers and name below a column.
fn below(canvas: &mut Canvas<'_>, area: Area, Side { axis, ticks, name }: &Side) {
    let bottom = area.y + area.h;
    let small = Lettering::new(SMALL, Ink::Soft).anchored(Anchor::Middle);
    let mut free_from = area.x - GAP / 2.0;
    for tick in ticks {
        let at = area.x + area.w * axis.place(tick.at);
        let half = text_width(&tick.label, SMALL) / 2.0;
        canvas.line((at, bottom), (at, bottom + 3.0), Ink::Frame, 1.0);
        if at - half >= free_from && at + half <= area.x + area.w + GAP / 2.0 {
            canvas.text(&tick.label, (at, bottom + 11.0), small);
            free_from = at + half + 6.0;
        }
    }
    let named = Lettering::new(SMALL, Ink::Text).anchored(Anchor::Middle);
    for (line, words) in two_lines(name, area.w + GAP / 2.0).iter().enumerate() {
        let at = (area.x + area.w / 2.0, bottom + 27.0 + 13.0 * line as f64);
        canvas.text(words, at, named);
    }
}

/// Numbers and name at the left of a row.
fn beside(canvas: &mut Canvas<'_>, area: Area, side: &Side, has_numbers: bool) {
    let Side { axis, ticks, name } = side;
    let small = Lettering::new(SMALL, Ink::Soft).anchored(Anchor::Right);
    for tick in ticks.iter().filter(|_| has_numbers) {
        let at = area.y + area.h * (1.0 - axis.place(tick.at));
        canvas.line((area.x - 3.0, at), (area.x, at), Ink::Frame, 1.0);
        let inside = at - area.y >= 4.0 && area.y + area.h - at >= 4.0;
        if inside {
            let words = fitted(&tick.label, SMALL, MOST_NUMBERS);
            canvas.text(&words, (area.x - 6.0, at), small);
        }
    }
    let named = Lettering::new(SMALL, Ink::Text).anchored(Anchor::Middle);
    for (line, words) in two_lines(name, area.h).iter().enumerate() {
        let at = (7.0 + 13.0 * line as f64, area.y + area.h / 2.0);
        canvas.text(words, at, named.upright());
    }
}

/// `name` in one line, or in two that are broken behind a separator.
fn two_lines(name: &str, width: f64) -> Vec<String> {
    if text_width(name, SMALL) <= width {
        return vec![name.to_owned()];
    }
    let mut breaks = name.match_indices(['_', '.', ' ']).map(|(at, _)| at + 1);
    let fits = |at: &usize| text_width(&name[..*at], SMALL) <= width;
    match breaks.rfind(fits) {
        Some(at) => vec![name[..at].to_owned(), fitted(&name[at..], SMALL, width)],
        None => vec![fitted(name, SMALL, width)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn svg(columns: &[Vec<f64>], most_dots: usize) -> String {
        let names: Vec<String> = (0..columns.len()).map(|i| format!("number{i}")).collect();
        let variables: Vec<Variable<'_>> = names
            .iter()
            .zip(columns)
            .map(|(name, values)| Variable {
                name,
                unit: "N/m",
                values,
            })
            .collect();
        let count = columns.first().map_or(0, Vec::len);
        let marked: Vec<bool> = (0..count).map(|i| i == 1).collect();
        ScatterMatrix {
            title: "Pairs",
            variables: &variables,
            marked: &marked,
            marked_as: "stopped",
            correlations: &vec![vec![0.25; columns.len()]; columns.len()],
            most_dots,
        }
        .svg(900.0)
    }

    #[test]
    fn each_pair_has_dots_and_a_correlation() {
        let columns: Vec<Vec<f64>> = (1..=3)
            .map(|k| (0..50).map(|i| f64::from(i * k % 17)).collect())
            .collect();
        let text = svg(&columns, 40);
        // Three pairs of 40 dots, and one dot of the legend.
        assert_eq!(text.matches("<circle").count(), 3 * 40 + 1);
        assert_eq!(text.matches("0.25").count(), 3);
        assert_eq!(text.matches("number1 (N/m)").count(), 2);
        assert!(text.contains("stopped"));
    }

    #[test]
    fn nan_values_have_no_dot() {
        let columns = [vec![1.0, f64::NAN, f64::INFINITY, 2.0], vec![1.0; 4]];
        assert_eq!(svg(&columns, 40).matches("<circle").count(), 2 + 1);
        let columns = [vec![f64::NAN; 4], vec![1.0; 4]];
        assert!(svg(&columns, 40).contains("nothing to draw"));
    }

    #[test]
    fn long_names_are_broken_behind_a_separator() {
        assert_eq!(two_lines("short", 100.0), ["short"]);
        let name = "valve_stiffness_per_s2_of_the_actuator";
        let lines = two_lines(name, 150.0);
        assert_eq!(lines.concat(), name);
        assert!(lines.len() == 2 && lines[0].ends_with('_'));
        for line in two_lines(&"a".repeat(90), 100.0) {
            assert!(text_width(&line, SMALL) <= 100.0);
        }
    }
}
