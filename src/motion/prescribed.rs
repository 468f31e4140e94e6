//! Displacement histories of specimen axes without any structure: the test before every hybrid test.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::base::jump;
use super::error::{MotionError, Short, inside};
use super::process::Motion;
use super::shapes::smooth_rise;
use super::unit::Quantity;
use super::{Corrected, Files, Grid, RecordFacts};
use gusset_quantity::units::quantity;

/// Displacement of each axis, with smooth start and end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub struct PrescribedSpec {
    /// Displacement of each axis, in the order of the axes.
    pub axes: Vec<Motion>,
    /// Time in s over which the motions grow smoothly from zero. The default is 0.
    #[serde(default)]
    pub ease_in_s: f64,
    /// Time in s over which the motions return smoothly to zero before the end of the test. The
    /// default is 0.
    #[serde(default)]
    pub ease_out_s: f64,
}

/// Steps that an ease must have for a command to begin, or to end, more softly.
const EASES: f64 = 4.0;

/// Displacements (m) and velocities (m/s) of all axes at every step.
#[derive(Debug, Clone, PartialEq)]
pub struct Prescribed {
    axes: usize,
    steps: usize,
    /// By rows: steps + 1 rows, and one more that repeats the last displacement.
    disp: Vec<f64>,
    vel: Vec<f64>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Facts of the records in the motion.
    pub records: Vec<RecordFacts>,
    /// How accelerations became displacements of axes.
    pub corrected: Vec<Corrected>,
}

impl PrescribedSpec {
    /// The history on `grid`. Velocities are those of [`Motion::evaluate_with_rate`], with the easing.
    ///
    /// # Errors
    /// See [`MotionError`].
    #[cfg(test)]
    pub(crate) fn evaluate(
        &self,
        grid: Grid,
        files: &Files<'_>,
    ) -> Result<Prescribed, MotionError> {
        self.evaluate_named(grid, files, |axis| format!("axis {}", axis + 1))
    }

    /// The motions on the grid; warnings call the axis with index i, from 0, `name(i)`.
    ///
    /// # Errors
    /// See [`MotionError`].
    pub fn evaluate_named(
        &self,
        grid: Grid,
        files: &Files<'_>,
        name: impl Fn(usize) -> String,
    ) -> Result<Prescribed, MotionError> {
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
            records: Vec::new(),
            corrected: Vec::new(),
        };
        for (key, ease) in [("ease_in_s", ease_in), ("ease_out_s", ease_out)] {
            let step = grid.dt();
            if ease > 0.0 && ease < EASES * step {
                prescribed.warnings.push(format!(
                    "{key} = {ease} s is shorter than {EASES} steps of {} s: it softens nothing",
                    Short(step)
                ));
            }
        }
        for (axis, motion) in self.axes.iter().enumerate() {
            let (mut series, mut rates) =
                motion.evaluate_with_rate(Quantity::Displacement, grid, files)?;
            for ((time, d), v) in grid.times().zip(&mut series.values).zip(&mut rates) {
                let (w, w_rate) = easing(time, room, ease_in, ease_out);
                *v = w * *v + w_rate * *d;
                *d *= w;
            }
            prescribed.records.extend(series.record.take());
            prescribed.corrected.extend(series.corrected.take());
            let place = name(axis);
            let of_axis = |text: String| format!("{place}: {text}");
            prescribed.warnings.extend(
                series
                    .warnings
                    .into_iter()
                    .chain(series.doubts)
                    .map(of_axis),
            );
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

/// Warnings about jumps and about velocities at the ends, which an actuator cannot follow.
fn rough_ends(place: &str, disp: &[f64], vel: &[f64], dt: f64) -> Vec<String> {
    let mut found = Vec::new();
    if let Some(jump) = jump(disp, dt) {
        found.push(format!("{place} {jump}"));
    }
    let top = vel.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let rough = |v: Option<&f64>| v.copied().filter(|v| v.abs() > 1e-3 * top);
    if let Some(d) = disp.first().filter(|d| **d != 0.0) {
        found.push(format!(
            "{place} starts at {}, not at zero",
            quantity(*d, "m")
        ));
    }
    if let Some(v) = rough(vel.first()) {
        found.push(format!(
            "{place} starts with {} out of rest; ease_in_s softens it",
            quantity(v, "m/s")
        ));
    }
    if let Some(v) = rough(vel.last()) {
        found.push(format!(
            "{place} ends with {}; ease_out_s brings it to rest",
            quantity(v, "m/s")
        ));
    }
    found
}

impl Prescribed {
    /// One axis with these displacements (m) and velocities (m/s), one of each for every step from 0 on: as many as the
    /// shorter has.
    #[must_use]
    pub fn of_axis(mut disp: Vec<f64>, mut vel: Vec<f64>) -> Self {
        let points = disp.len().min(vel.len());
        disp.truncate(points);
        vel.truncate(points);
        disp.push(disp.last().copied().unwrap_or(0.0));
        vel.push(0.0);
        Self {
            axes: 1,
            steps: points.saturating_sub(1),
            disp,
            vel,
            warnings: Vec::new(),
            records: Vec::new(),
            corrected: Vec::new(),
        }
    }

    /// Displacements in m and velocities in m/s of all axes at `step`; beyond the test the last displacement remains.
    /// Real-time: yes.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cyclic, CyclicShape, Signal, Sine, Unit};

    fn no_files(_: &str) -> std::io::Result<Vec<u8>> {
        Err(std::io::ErrorKind::NotFound.into())
    }

    fn sine(amplitude: f64) -> Motion {
        Motion::plain(Signal::Sine(Sine {
            amplitude,
            unit: Some(Unit::Millimetre),
            frequency_hz: Some(1.0),
            angular_frequency_rad_per_s: None,
            phase_rad: 0.0,
            start_s: 0.0,
            cycles: None,
            duration_s: None,
            taper_s: 0.0,
        }))
    }

    fn spec(axes: Vec<Motion>, ease: f64) -> PrescribedSpec {
        PrescribedSpec {
            axes,
            ease_in_s: ease,
            ease_out_s: ease,
        }
    }

    #[test]
    fn too_short_ease_is_reported() {
        let grid = Grid::new(0.01, 250).unwrap();
        let told = |ease: f64| {
            let found = spec(vec![sine(10.0)], ease)
                .evaluate(grid, &no_files)
                .unwrap();
            let softens = |text: &&String| text.starts_with("ease_");
            found.warnings.iter().filter(softens).count()
        };
        assert_eq!((told(0.0), told(0.005), told(0.5)), (0, 2, 0));
    }

    #[test]
    fn every_axis_has_its_own_motion() {
        let grid = Grid::new(0.01, 250).unwrap();
        let test = spec(vec![sine(1.0), sine(3.0)], 0.0)
            .evaluate(grid, &no_files)
            .unwrap();
        assert_eq!((test.axes, test.steps), (2, 250));
        for step in 0..=250 {
            let angle = 2.0 * std::f64::consts::PI * 0.01 * step as f64;
            let (d, v) = test.at(step);
            assert!((d[0] - 1e-3 * libm::sin(angle)).abs() < 1e-16);
            assert!((d[1] - 3e-3 * libm::sin(angle)).abs() < 1e-16);
            assert!((v[1] - 3e-3 * 2.0 * std::f64::consts::PI * libm::cos(angle)).abs() < 1e-15);
        }
        // Beyond the end it does not move.
        let (last, _) = test.at(250);
        assert_eq!(test.at(251), (last, &[0.0, 0.0][..]));
        assert_eq!(test.at(usize::MAX), test.at(251));
        // A sine out of rest is rough at both ends, on both axes.
        assert_eq!(test.warnings.len(), 4, "{:?}", test.warnings);
        assert!(test.warnings[0].contains("axis 1 "));
    }

    #[test]
    fn easing_brings_both_ends_to_rest() {
        let grid = Grid::new(0.001, 4000).unwrap();
        let test = spec(vec![sine(2.0)], 0.8)
            .evaluate(grid, &no_files)
            .unwrap();
        assert!(test.warnings.is_empty(), "{:?}", test.warnings);
        for step in [0, 4000] {
            let (d, v) = test.at(step);
            assert!(d[0].abs() < 1e-15 && v[0].abs() < 1e-15);
        }
        let top = 2e-3 * 2.0 * std::f64::consts::PI;
        for step in 1..4000 {
            let difference = (test.at(step + 1).0[0] - test.at(step - 1).0[0]) / 0.002;
            // h²/6 of the third derivative: of the sine (2π)³, of the easing 60/0.8³, mixed below 1e3; times 2 mm.
            assert!(
                (test.at(step).1[0] - difference).abs() < 1e-3 * top,
                "{step}"
            );
        }
        // In between nothing is changed.
        let plain = spec(vec![sine(2.0)], 0.0)
            .evaluate(grid, &no_files)
            .unwrap();
        assert_eq!(test.at(2000), plain.at(2000));
    }

    #[test]
    fn truncated_motion_is_reported() {
        let cut = Motion::plain(Signal::Sine(Sine {
            amplitude: 1.0,
            unit: None,
            frequency_hz: Some(1.0),
            angular_frequency_rad_per_s: None,
            phase_rad: 0.0,
            start_s: 0.0,
            cycles: Some(1.25),
            duration_s: None,
            taper_s: 0.0,
        }));
        let grid = Grid::new(0.01, 200).unwrap();
        let test = spec(vec![cut], 0.0).evaluate(grid, &no_files).unwrap();
        assert!(
            test.warnings
                .iter()
                .any(|w| w.contains("axis 1") && w.contains("-1.000e0 m")),
            "{:?}",
            test.warnings
        );
        let triangle = Motion::plain(Signal::Cyclic(Cyclic {
            amplitudes: vec![1.0, 2.0],
            unit: Some(Unit::Millimetre),
            cycles_per_amplitude: 1,
            shape: CyclicShape::Triangle,
            frequency_hz: None,
            speed: Some(10.0),
            rest_s: 0.3,
            start_s: 0.1,
        }));
        let test = spec(vec![triangle.clone()], 0.0).evaluate(grid, &no_files);
        let test = test.unwrap();
        assert!(test.warnings.is_empty(), "{:?}", test.warnings);
        // Eased out before the second amplitude: nothing jumps, and half of the motion is missing.
        let short = Grid::new(0.01, 75).unwrap();
        let test = spec(vec![triangle], 0.1).evaluate(short, &no_files);
        let warnings = test.unwrap().warnings.to_vec();
        let left = "axis 1: the signal ends at 1.6 s, but the test already ends at 0.75 s: the rest of the signal is not used; its \
                    largest is 2.000 times that of the test";
        assert_eq!(warnings, [left]);
    }

    #[test]
    fn missing_axes_or_long_easing_is_refused() {
        let grid = Grid::new(0.01, 100).unwrap();
        for spec in [
            spec(vec![], 0.0),
            spec(vec![sine(1.0)], 0.6),
            spec(vec![sine(1.0)], -0.1),
            spec(vec![sine(1.0)], f64::NAN),
        ] {
            assert!(spec.evaluate(grid, &no_files).is_err());
        }
    }

    #[test]
    fn reading_a_step_allocates_nothing() {
        let grid = Grid::new(0.01, 100).unwrap();
        let test = spec(vec![sine(1.0), sine(2.0)], 0.0)
            .evaluate(grid, &no_files)
            .unwrap();
        let mut sum = 0.0;
        let counted = allocation_counter::measure(|| {
            for step in 0..200 {
                let (d, v) = test.at(step);
                sum += d.iter().zip(v).map(|(d, v)| d + v).sum::<f64>();
            }
        });
        assert_eq!(counted.count_total, 0);
        assert!(sum.is_finite());
    }
}
