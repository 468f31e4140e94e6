//! A figure of the paper: curves in its axes, as data and as a picture.

use std::fmt::Write as _;

use gusset_view::report::{self, Chart, Look};

/// One curve of a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name of the curve.
    pub name: String,
    /// Abscissas.
    pub x: Vec<f64>,
    /// Ordinates; NaN where a point is missing.
    pub y: Vec<f64>,
    /// How it is drawn.
    pub look: Look,
}

impl Series {
    /// A line.
    #[must_use]
    pub fn line(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self {
            name: name.into(),
            x,
            y,
            look: Look::Line,
        }
    }

    /// The line that the others are compared with.
    #[must_use]
    pub(crate) fn reference(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self {
            look: Look::Reference,
            ..Self::line(name, x, y)
        }
    }

    /// Points.
    #[must_use]
    pub fn dots(name: impl Into<String>, x: Vec<f64>, y: Vec<f64>) -> Self {
        Self {
            look: Look::Dots,
            ..Self::line(name, x, y)
        }
    }
}

/// One axis of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Label of the axis.
    pub words: &'static str,
    /// SI unit, or "1".
    pub unit: &'static str,
    /// Its ends, where they are fixed.
    pub range: Option<(f64, f64)>,
}

impl Scale {
    /// As far as the data reach.
    #[must_use]
    pub const fn free(words: &'static str, unit: &'static str) -> Self {
        Self {
            words,
            unit,
            range: None,
        }
    }

    /// From `lo` to `hi`.
    #[must_use]
    pub(crate) const fn fixed(words: &'static str, unit: &'static str, lo: f64, hi: f64) -> Self {
        Self {
            words,
            unit,
            range: Some((lo, hi)),
        }
    }
}

/// How the axes of a figure are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// Both linear.
    Linear,
    /// Both logarithmic.
    Logarithmic,
    /// Both linear, and as wide as high: for the z plane.
    Square,
}

/// A figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Name of its files, without ending.
    pub file: &'static str,
    /// Its caption.
    pub title: &'static str,
    /// What to see in it.
    pub claim: &'static str,
    /// Horizontal axis.
    pub across: Scale,
    /// Vertical axis.
    pub up: Scale,
    /// How the axes are drawn.
    pub axes: Axes,
    /// Its curves.
    pub series: Vec<Series>,
}

impl Figure {
    /// The figure as a chart.
    #[must_use]
    pub fn chart(&self) -> Chart<'_> {
        let scale = |scale: Scale| {
            let axis = report::Scale::new(scale.words, scale.unit);
            let axis = if self.axes == Axes::Logarithmic {
                axis.log()
            } else {
                axis
            };
            axis.within(scale.range)
        };
        let (width, height) = match self.axes {
            Axes::Square => (460.0, 520.0),
            Axes::Linear | Axes::Logarithmic => (640.0, 420.0),
        };
        let chart = Chart::new(self.title, scale(self.across), scale(self.up));
        let chart = chart.sized(width, height).square(self.axes == Axes::Square);
        self.series.iter().fold(chart, |chart, series| {
            chart.with(series.name.as_str(), &series.x, &series.y, series.look)
        })
    }

    /// The data: curve, abscissa, ordinate; nothing where there is no value.
    #[must_use]
    pub fn csv(&self) -> String {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let mut out = format!(
            "curve,{},{}\n",
            quoted(&format!("{} ({})", self.across.words, self.across.unit)),
            quoted(&format!("{} ({})", self.up.words, self.up.unit))
        );
        for series in &self.series {
            let name = quoted(&series.name);
            for (x, y) in series.x.iter().zip(&series.y) {
                // Writing to a string does not fail.
                let _ = if y.is_finite() {
                    writeln!(out, "{name},{x},{y}")
                } else {
                    writeln!(out, "{name},{x},")
                };
            }
        }
        out
    }
}
