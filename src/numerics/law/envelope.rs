//! Envelopes of straight lines: corners that the user gives, as positive numbers of one direction.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawError;
use super::domain::{inside, positive, yield_disp};

/// A corner of an envelope, in positive numbers for both directions. For a rotational hinge the displacement is a rotation in rad
/// and the force a moment in N m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EnvelopePointSpec {
    /// Displacement of the corner. It is greater than that of the corner before.
    #[schemars(example = 0.01)]
    pub disp_m: f64,
    /// Force at the corner. That of the first corner is greater than 0, and no other one is negative. No line is steeper than the
    /// first one.
    #[schemars(example = 1.0e5)]
    pub force_n: f64,
}

/// A point of an envelope, or of a line of reloading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Point {
    pub(super) disp: f64,
    pub(super) force: f64,
}

impl Point {
    /// Slope of the line from here to `other`.
    pub(super) fn slope_to(self, other: Self) -> f64 {
        (other.force - self.force) / (other.disp - self.disp)
    }
}

/// The envelope of one direction. It begins at zero and continues beyond its last corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Envelope<const N: usize> {
    pub(super) corners: [Point; N],
    /// Slope beyond the last corner, at least 0.
    pub(super) beyond: f64,
}

/// The smaller force of both first corners.
pub(super) fn yield_force(
    positive: &[EnvelopePointSpec],
    negative: Option<&[EnvelopePointSpec]>,
) -> Option<f64> {
    let first = |list: &[EnvelopePointSpec]| list.first().map(|corner| corner.force_n);
    let positive = first(positive)?;
    Some(positive.min(negative.and_then(first).unwrap_or(positive)))
}

/// Checks the corners of one direction.
pub(super) fn corners<const N: usize>(
    list: &'static str,
    given: &[EnvelopePointSpec],
) -> Result<[Point; N], LawError> {
    let size = || LawError::Size {
        name: list,
        what: "entries",
        found: given.len(),
        wanted: N,
    };
    let points = <[EnvelopePointSpec; N]>::try_from(given).map_err(|_| size())?;
    let mut last = Point::default();
    let mut first_slope = f64::INFINITY;
    let mut corners = [last; N];
    for (place, (corner, given)) in corners.iter_mut().zip(points).enumerate() {
        *corner = checked(given, last, first_slope).map_err(|reason| LawError::Entry {
            list,
            index: place + 1,
            reason: Box::new(reason),
        })?;
        if place == 0 {
            first_slope = corner.force / corner.disp;
        }
        last = *corner;
    }
    Ok(corners)
}

fn checked(given: EnvelopePointSpec, last: Point, steepest: f64) -> Result<Point, LawError> {
    let disp = positive("disp_m", given.disp_m)?;
    let allowed = "greater than that of the corner before";
    inside("disp_m", disp, disp > last.disp, allowed)?;
    let point = Point {
        disp,
        force: given.force_n,
    };
    if last.disp == 0.0 {
        positive("force_n", point.force)?;
        let stiffness = positive("force_n", point.force / disp)?;
        yield_disp("force_n", point.force, stiffness)?;
    }
    inside(
        "force_n",
        point.force,
        // A line that continues the first one may be steeper by rounding.
        point.force >= 0.0 && last.slope_to(point) <= steepest * (1.0 + 1e-12),
        "at least 0, on a line that is not steeper than the first one",
    )?;
    Ok(point)
}

impl<const N: usize> Envelope<N> {
    /// The line of the envelope that begins at or before `disp` ≥ 0: its start, its slope and its end.
    pub(super) fn line(&self, disp: f64) -> (Point, f64, f64) {
        let mut start = Point::default();
        for corner in &self.corners {
            if disp < corner.disp {
                return (start, start.slope_to(*corner), corner.disp);
            }
            start = *corner;
        }
        (start, self.beyond, f64::INFINITY)
    }

    pub(super) fn force(&self, disp: f64) -> f64 {
        let (start, slope, _) = self.line(disp);
        start.force + slope * (disp - start.disp)
    }

    /// Slope of the first line.
    pub(super) fn stiffness(&self) -> f64 {
        Point::default().slope_to(self.corners[0])
    }

    /// Work along the envelope up to its last corner.
    pub(super) fn work(&self) -> f64 {
        let mut last = Point::default();
        self.corners.iter().fold(0.0, |sum, corner| {
            let work = 0.5 * (corner.force + last.force) * (corner.disp - last.disp);
            last = *corner;
            sum + work
        })
    }

    /// Steepest fall, as a positive number; 0 without any.
    pub(super) fn steepest_fall(&self) -> f64 {
        let mut last = Point::default();
        self.corners.iter().fold(0.0, |most, corner| {
            let fall = -last.slope_to(*corner);
            last = *corner;
            f64::max(most, fall)
        })
    }
}
