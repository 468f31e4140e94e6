//! The frontier as a picture and as a table, beside published marks.

use std::fmt::Write as _;

use super::search::Point;
use crate::verify::{Axes, Figure, Scale, Series};

/// A published size at a published rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    /// Degrees of freedom.
    pub dofs: f64,
    /// Steps per second.
    pub rate_hz: f64,
    /// Description and source.
    pub words: &'static str,
}

/// What others have published.
pub(crate) const MARKS: [Mark; 2] = [
    Mark {
        dofs: 27_000.0,
        rate_hz: 50.0,
        words: "27 000 DOFs at 50 Hz on a GPU (published)",
    },
    Mark {
        dofs: 5000.0,
        rate_hz: 1000.0 / 64.8,
        words: "5000 DOFs, 64.8 ms per step (Gui et al. 2014, Table 2, λ = 4)",
    },
];

/// Rate over size, both logarithmic.
#[must_use]
pub fn svg(words: &str, points: &[Point]) -> String {
    let x: Vec<f64> = points.iter().map(|point| point.dofs as f64).collect();
    let y: Vec<f64> = points.iter().map(|point| point.rate_hz).collect();
    let mut series = vec![
        Series::line(
            format!("this machine, one core: {words}"),
            x.clone(),
            y.clone(),
        ),
        Series::dots("", x.clone(), y.clone()),
    ];
    let ends = |all: &[f64], mark: f64| {
        let least = all.iter().copied().fold(mark, f64::min);
        (least, all.iter().copied().fold(mark, f64::max))
    };
    // Curve of the goal: 5 million degrees of freedom per second.
    let (least, most) = ends(&x, MARKS[0].dofs);
    let goal = |dofs: f64| 5e6 / dofs;
    series.push(Series::reference(
        "5 million DOF·Hz",
        vec![least, most],
        vec![goal(least), goal(most)],
    ));
    for mark in MARKS {
        series.push(Series::dots(
            mark.words,
            vec![mark.dofs],
            vec![mark.rate_hz],
        ));
    }
    Figure {
        file: "frontier",
        title: "Largest model that keeps 99.99 % of its deadlines",
        claim: "",
        across: Scale::free("degrees of freedom", "1"),
        up: Scale::free("rate", "Hz"),
        axes: Axes::Logarithmic,
        series,
    }
    .chart()
    .svg()
}

/// One line per rate, SI units but for the times in µs that the names say.
#[must_use]
pub fn csv(points: &[Point]) -> String {
    let mut text = String::from(
        "rate_hz,dofs,dof_hz,ticks,missed,taken_away,compute_p50_us,compute_p99_9_us\n",
    );
    for point in points {
        let trial = &point.trial;
        let [p50, p99_9] = trial.compute_us;
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{p50},{p99_9}",
            point.rate_hz,
            point.dofs,
            point.dof_hz(),
            trial.ticks,
            trial.missed,
            trial.taken_away,
        );
    }
    text
}
