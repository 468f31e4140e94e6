//! Motion of the base: displacement and velocity at every step, and a check for motion that no shake table can
//! follow.

use super::error::MotionError;
use super::process::Motion;
use super::unit::Quantity;
use super::{Corrected, Files, Grid, RecordFacts, peak};

/// A base that moves: displacement and velocity on the step grid.
#[derive(Debug, Clone, PartialEq)]
pub struct BaseMotion {
    /// In m, steps + 1 values.
    pub disp: Vec<f64>,
    /// In m/s, steps + 1 values.
    pub vel: Vec<f64>,
    /// Warnings in plain words.
    pub warnings: Vec<String>,
    /// Doubts, as those of a [`Series`](super::Series).
    pub doubts: Vec<String>,
    /// Facts of the record, if the motion comes from a file.
    pub record: Option<RecordFacts>,
    /// How an acceleration became the displacement, if one did.
    pub corrected: Option<Corrected>,
}

/// Displacement and velocity of a base or a support on `grid`; warnings call it `name`. See [`Motion::evaluate_with_rate`] for the velocity. A jump is a
/// warning.
///
/// # Errors
/// See [`MotionError`].
pub fn base_motion(
    motion: &Motion,
    grid: Grid,
    files: &Files<'_>,
    name: &str,
) -> Result<BaseMotion, MotionError> {
    let (series, vel) = motion.evaluate_with_rate(Quantity::Displacement, grid, files)?;
    let mut warnings = series.warnings;
    if let Some(jump) = jump(&series.values, grid.dt()) {
        warnings.push(format!("{name} {jump}"));
    }
    if let Some(start) = series.values.first().filter(|d| **d != 0.0) {
        warnings.push(format!("{name} starts at {start} m, not at rest at zero"));
    }
    Ok(BaseMotion {
        disp: series.values,
        vel,
        warnings,
        doubts: series.doubts,
        record: series.record,
        corrected: series.corrected,
    })
}

/// Words for the first step in which a displacement moves five times as far as in any of the four steps on either
/// side: a jump, which no actuator follows.
pub(super) fn jump(disp: &[f64], dt: f64) -> Option<String> {
    let moves: Vec<f64> = disp.windows(2).map(|d| d[1] - d[0]).collect();
    let top = peak(disp);
    let place = (0..moves.len()).find(|&i| {
        let before = moves.get(i.saturating_sub(4)..i).unwrap_or(&[]);
        let after = moves.get(i + 1..(i + 5).min(moves.len())).unwrap_or(&[]);
        moves.len() > 1 && moves[i].abs() > 5.0 * peak(before).max(peak(after)) + 1e-9 * top
    })?;
    Some(format!(
        "jumps by {:.3e} m between {:.6} s and {:.6} s",
        moves[place],
        place as f64 * dt,
        (place + 1) as f64 * dt
    ))
}
