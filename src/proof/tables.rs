//! The critical delay of every axis over its stiffness, for the margin that is watched while the test runs.
//!
//! One axis is late at a time. All others, and the coupling of the axes of one specimen, are on time and as stiff as at rest.
//! The delay is that of continuous time, or less where the steps are so coarse that the recursion tolerates less.

use nalgebra::DMatrix;

use super::analysis::{Analysis, Attached, Own, delayed};
use super::critical::CriticalDelay;
use gusset_numerics::spectral::delay::{DelayError, Delayed, DiscreteLimit, continuous, discrete};

/// Entries of a table at equal steps.
const ENTRIES: usize = 33;
/// Further ones, each at half of the stiffness of the one before, from the first step down: where a gap that is open makes an axis
/// stiff, it works far below.
const HALVES: i32 = 10;
/// The last of them, in parts of the initial stiffness or of its declared bound.
const REACH: f64 = 2.0;
/// Angle per step, in rad, from which the recursion gives the limit: below it the two differ by a per cent or so.
const COARSE: f64 = 0.2;
/// Axes times (4 DOFs)³ of all tables together: an entry needs the eigenvalues of four times as many rows, and all of them
/// about half a millisecond per thousand, so that a test begins within 70 ms. One axis in a structure of 12 DOFs, two in one of 9.
const MOST_WORK: usize = 120_000;

impl Analysis {
    /// Tables for the axes of the `wanted` specimens, empty for the others. `bounds` holds the largest declared tangents,
    /// NaN where none is declared. One axis late at a time.
    ///
    /// # Errors
    /// Why the tables cannot be computed, in words.
    pub fn critical_delays(
        &self,
        wanted: &[bool],
        bounds: &[Vec<f64>],
    ) -> Result<Vec<Vec<CriticalDelay>>, String> {
        let n = self.mass.n();
        let specimens = || self.specimens.iter().zip(wanted).zip(bounds);
        let axes: usize = specimens()
            .filter(|((_, wanted), _)| **wanted)
            .map(|((specimen, _), _)| specimen.rows.len())
            .sum();
        let rows = 4 * n;
        let work = rows.saturating_mul(rows).saturating_mul(rows);
        if work.saturating_mul(axes) > MOST_WORK {
            return Err(format!(
                "critical delays of {axes} axes in a structure of {n} DOFs take too long to tabulate"
            ));
        }
        let tables = specimens().map(|((specimen, wanted), bounds)| {
            if *wanted {
                self.tables(specimen, bounds)
            } else {
                Ok(Vec::new())
            }
        });
        tables.collect()
    }

    fn tables(&self, specimen: &Attached, bounds: &[f64]) -> Result<Vec<CriticalDelay>, String> {
        let axes = specimen.rows.iter().enumerate().zip(bounds);
        let tables = axes.map(|((axis, row), bound)| {
            let stiffness = specimen.stiffness[axis][axis];
            // NaN is passed over.
            let stiffest = REACH * stiffness.max(*bound);
            let is_other =
                |other: &Attached, index: usize| !(std::ptr::eq(other, specimen) && index == axis);
            let one = |value| DMatrix::from_element(1, 1, value);
            let mut system = delayed(
                self.mass_with(is_other).to_dense(),
                (&self.at_rest.damping, &self.at_rest.stiffness),
                std::slice::from_ref(row),
                Own {
                    damping: one(specimen.damping_at_rest[axis][axis]),
                    stiffness: one(specimen.stiffness_at_rest[axis][axis]),
                },
                specimen.mass_in_force,
            );
            let delay = |stiffness: f64| -> Result<(f64, f64), DelayError> {
                system.specimen_stiffness[(0, 0)] = stiffness;
                let found = continuous(&system)?;
                Ok((stiffness, found.map_or(f64::INFINITY, |found| found.delay)))
            };
            let entries = entries(stiffest, specimen.stiffness_at_rest[axis][axis]);
            let delays: Result<Vec<(f64, f64)>, _> = entries.into_iter().map(delay).collect();
            let mut delays = delays.map_err(|error| error.to_string())?;
            system.specimen_stiffness[(0, 0)] = stiffness;
            (system.weighted, system.ticks) = (self.effective(), specimen.ticks.clone());
            let share = self.share_of_recursion(&system);
            delays.iter_mut().for_each(|(_, delay)| *delay *= share);
            CriticalDelay::new(&delays).ok_or_else(|| {
                "an axis has no stiffness, or the structure has no damping".to_owned()
            })
        });
        tables.collect()
    }

    /// Share of the critical delay in continuous time that the recursion tolerates, 1 at most: with several ticks a step the path
    /// between targets lags, too.
    fn share_of_recursion(&self, system: &Delayed) -> f64 {
        let (Some((dt, lambda)), Ok(Some(found))) = (self.step, continuous(system)) else {
            return 1.0;
        };
        if found.omega.is_nan() || found.omega * dt < COARSE {
            return 1.0;
        }
        match discrete(system, dt, lambda.value(), Some(found.delay)) {
            Ok(DiscreteLimit::At(delay)) => (delay / found.delay).min(1.0),
            _ => 1.0,
        }
    }
}

/// Stiffnesses in N/m from 0 to `stiffest` for which a table has an entry, `at_rest` among them.
fn entries(stiffest: f64, at_rest: f64) -> Vec<f64> {
    let step = stiffest / (ENTRIES - 1) as f64;
    let equal = (0..ENTRIES).map(|entry| entry as f64 / (ENTRIES - 1) as f64 * stiffest);
    let halves = (1..=HALVES).map(|half| step * 0.5f64.powi(half));
    let own = std::iter::once(at_rest).filter(|own| *own > 0.0 && *own < stiffest);
    let mut all: Vec<f64> = equal.chain(halves).chain(own).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|next, one| *next - *one <= 1e-9 * *next);
    all
}
