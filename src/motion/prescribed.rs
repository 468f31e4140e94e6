//! Displacement histories of specimen axes without any structure: the test before every hybrid test.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::{MotionError, inside};
use super::process::{Motion, jump};
use super::shapes::smooth_rise;
use super::unit::Quantity;
use super::{Files, Grid};

/// One motion per axis, and how it begins and ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct PrescribedSpec {
    /// Displacement of each axis, in their order.
    pub axes: Vec<Motion>,
    /// The motions grow from zero over this time in s (fifth-order polynomial, no jump in velocity); 0 if absent.
    #[serde(default)]
    pub ease_in_s: f64,
    /// The motions return to zero over this time in s before the end of the test; 0 if absent.
    #[serde(default)]
    pub ease_out_s: f64,
}

/// Displacements (m) and velocities (m/s) of all axes at every step.
#[derive(Debug, Clone, PartialEq)]
pub struct Prescribed {
    axes: usize,
    steps: usize,
    /// By rows, steps + 1 of them, and one more in which the last displacement stands still.
    disp: Vec<f64>,
    vel: Vec<f64>,
    warnings: Vec<String>,
}

impl PrescribedSpec {
    /// The history on `grid`. Velocities are those of [`Motion::evaluate_with_rate`], with the easing.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn evaluate(&self, grid: Grid, files: &Files<'_>) -> Result<Prescribed, MotionError> {
        let axes = self.axes.len();
        if axes == 0 {
            return Err(MotionError::Length {
                what: "axes",
                wanted: 1,
                found: 0,
            });
        }
        let room = grid.duration();
        let ease = |name, value: f64| {
            let fits = value >= 0.0 && value <= room;
            inside(name, value, fits, "at least zero and within the test")
        };
        let ease_in = ease("ease_in_s", self.ease_in_s)?;
        let ease_out = ease("ease_out_s", self.ease_out_s)?;
        inside(
            "ease_in_s + ease_out_s",
            ease_in + ease_out,
            ease_in + ease_out <= room * (1.0 + 1e-12),
            "at most the duration of the test",
        )?;
        let rows = grid.points() + 1;
        let mut prescribed = Prescribed {
            axes,
            steps: grid.steps(),
            disp: vec![0.0; rows * axes],
            vel: vec![0.0; rows * axes],
            warnings: Vec::new(),
        };
        for (axis, motion) in self.axes.iter().enumerate() {
            let (mut series, mut rates) =
                motion.evaluate_with_rate(Quantity::Displacement, grid, files)?;
            for ((time, d), v) in grid.times().zip(&mut series.values).zip(&mut rates) {
                let (w, w_rate) = easing(time, room, ease_in, ease_out);
                *v = w * *v + w_rate * *d;
                *d *= w;
            }
            let place = format!("axis {}", axis + 1);
            let of_axis = |text: String| format!("{place}: {text}");
            prescribed
                .warnings
                .extend(series.warnings.into_iter().map(of_axis));
            prescribed
                .warnings
                .extend(rough_ends(&place, &series.values, &rates, grid.dt()));
            let last = series.values.last().copied().unwrap_or(0.0);
            let column = |into: &mut Vec<f64>, values: &[f64], rest: f64| {
                let all = values.iter().copied().chain([rest]);
                for (row, value) in into.chunks_exact_mut(axes).zip(all) {
                    row[axis] = value;
                }
            };
            column(&mut prescribed.disp, &series.values, last);
            column(&mut prescribed.vel, &rates, 0.0);
        }
        Ok(prescribed)
    }
}

/// Factor and its rate: up over `ease_in`, down over `ease_out` before `end`.
fn easing(time: f64, end: f64, ease_in: f64, ease_out: f64) -> (f64, f64) {
    let up = if ease_in > 0.0 && time < ease_in {
        smooth_rise(time, ease_in)
    } else {
        (1.0, 0.0)
    };
    let down = if ease_out > 0.0 && end - time < ease_out {
        let (w, rate) = smooth_rise(end - time, ease_out);
        (w, -rate)
    } else {
        (1.0, 0.0)
    };
    (up.0 * down.0, up.1 * down.0 + up.0 * down.1)
}

/// What an actuator will not follow: jumps, and velocities at the ends.
fn rough_ends(place: &str, disp: &[f64], vel: &[f64], dt: f64) -> Vec<String> {
    let mut found = Vec::new();
    if let Some(jump) = jump(disp, dt) {
        found.push(format!("{place} {jump}"));
    }
    let top = vel.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let rough = |v: Option<&f64>| v.copied().filter(|v| v.abs() > 1e-3 * top);
    if let Some(d) = disp.first().filter(|d| **d != 0.0) {
        found.push(format!("{place} starts at {d:e} m, not at zero"));
    }
    if let Some(v) = rough(vel.first()) {
        found.push(format!(
            "{place} starts with {v:e} m/s out of rest; ease_in_s softens it"
        ));
    }
    if let Some(v) = rough(vel.last()) {
        found.push(format!(
            "{place} ends with {v:e} m/s; ease_out_s brings it to rest"
        ));
    }
    found
}

impl Prescribed {
    /// Number of axes.
    #[must_use]
    pub const fn axes(&self) -> usize {
        self.axes
    }

    /// Number of steps.
    #[must_use]
    pub const fn steps(&self) -> usize {
        self.steps
    }

    /// What the user should know.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Displacements in m and velocities in m/s of all axes at `step`; beyond the test the last displacement stands
    /// still. Real-time: yes.
    #[must_use]
    pub fn at(&self, step: usize) -> (&[f64], &[f64]) {
        let start = step.min(self.steps + 1) * self.axes;
        let row = start..start + self.axes;
        (
            self.disp.get(row.clone()).unwrap_or(&[]),
            self.vel.get(row).unwrap_or(&[]),
        )
    }
}
