//! Forces of specimens behind links that resist velocity and do not move at the velocities of the test: in the laboratory and at
//! the velocities of the test.

use super::{AxisNeed, Budget, Rehearsal, carry_out};
use gusset_config::{ConfigError, Loaded};
use gusset_setup as setup;

/// Largest velocity in m/s and force in N of one axis, at the specimen's scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Velocity.
    pub vel: f64,
    /// Force.
    pub force: f64,
}

/// One specimen at both speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Speeds {
    /// Its number, from 0.
    pub specimen: usize,
    /// Velocity in the laboratory over that of the test.
    pub ratio: f64,
    /// Per axis, in the laboratory and at the velocities of the test.
    pub axes: Vec<[Peak; 2]>,
}

/// Rehearses a test once more with specimens that move at the velocities of the test. Empty if all of them do anyway.
///
/// # Errors
/// As [`setup::build`].
pub(crate) fn compare_speeds(
    loaded: &Loaded,
    rehearsal: &Rehearsal,
    budget: &mut Budget,
) -> Result<Vec<Speeds>, ConfigError> {
    let Some(meant) = setup::build_at_test_speed(loaded)? else {
        return Ok(Vec::new());
    };
    let meant = carry_out(meant.experiment, budget);
    let pairs = rehearsal.specimens.iter().zip(&meant.specimens);
    let tables = loaded.file.specimen.iter().zip(pairs).enumerate();
    let speeds = tables.filter_map(|(specimen, (table, (here, there)))| {
        let ratio = setup::speed_ratio(loaded, table)?;
        let axes = here.found.iter().zip(&there.found);
        Some(Speeds {
            specimen,
            ratio,
            axes: axes
                .map(|(here, there)| [peak(here, 1.0), peak(there, ratio)])
                .collect(),
        })
    });
    Ok(speeds.collect())
}

/// Peaks of an axis; its velocities over the wall time are `ratio` times those of the test.
fn peak(need: &AxisNeed, ratio: f64) -> Peak {
    Peak {
        vel: need.vel.high / ratio,
        force: need.force.low.abs().max(need.force.high.abs()),
    }
}
