//! What excites a test, made before the run on the step grid: [`Excitation`] for a structure, [`Prescribed`] for
//! specimens without one.
//!
//! A [`Motion`] is a [`Signal`] (a file, a closed form or a seeded random motion) and its [`Processing`].
//! Evaluating it needs the quantity that it is of, a [`Grid`], and a function that hands over the bytes of files; the
//! result is a [`Series`] of `steps + 1` numbers in SI units, and warnings in plain words. The same description gives the
//! same bits on every machine, and a random motion is the same function of time whatever the step.
//!
//! [`metrics`] reads numbers off recorded histories: tracking, energy, response spectra. [`identify`] finds an actuator and a
//! specimen from one recorded motion. Begin reading with [`Signal`].
//!
//! No file is opened here, no clock is read. During a test only [`Excitation::load_into`], [`Excitation::base`],
//! [`Excitation::ground`], [`Ground::at`] and [`Prescribed::at`] run: they read tables and allocate nothing.

mod base;
pub mod error;
pub mod identify;
pub mod metrics;
mod noise;
mod paths;
mod prescribed;
mod process;
mod random;
pub mod read;
mod record_facts;
mod resample;
mod sampled;
mod scaling;
mod shapes;
mod signal;
mod stroke;
pub mod unit;

pub use base::{BaseMotion, base_motion};
pub use error::MotionError;
pub use noise::{
    BandLimitedNoise, CloughPenzien, Envelope, JenningsHousner, KanaiTajimi, SaragoniHart,
};
pub use paths::{Cyclic, CyclicShape, RampAndHold, RampShape, Step};
pub use prescribed::{Prescribed, PrescribedSpec};
pub use process::{Amount, Detrend, Motion, Processing, TargetSa};
pub use read::{
    Column, ReadOptions, Record, RecordFormat, RecordSource, Table, parse_record, parse_table,
};
pub use record_facts::RecordFacts;
pub use resample::{Resample, central_difference, resample};
pub use scaling::{Scaled, Scaling};
pub use shapes::{Constant, Ricker, Sine, Sweep, SweepKind};
pub use signal::{FileSignal, Signal, Values};
pub use stroke::{Corrected, Stroke};
pub use unit::{Quantity, STANDARD_GRAVITY, Unit};

use std::ops::Range;

use error::{all_finite, positive};

/// Hands over the bytes of a file by the name that the test file uses. The caller opens it, and keeps its copy.
pub type Files<'a> = dyn Fn(&str) -> std::io::Result<Vec<u8>> + 'a;

/// The step grid: times 0, dt … steps · dt, the last included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    dt: f64,
    steps: usize,
}

impl Grid {
    /// `steps` steps of `dt` seconds.
    ///
    /// # Errors
    /// [`MotionError::Parameter`] unless `dt` is positive and finite.
    pub fn new(dt: f64, steps: usize) -> Result<Self, MotionError> {
        positive("dt", dt)?;
        Ok(Self { dt, steps })
    }

    /// The step in s.
    #[must_use]
    pub(crate) const fn dt(self) -> f64 {
        self.dt
    }

    /// Number of steps; there is one more point.
    #[must_use]
    pub const fn steps(self) -> usize {
        self.steps
    }

    /// Number of points, steps + 1.
    #[must_use]
    pub const fn points(self) -> usize {
        self.steps + 1
    }

    /// steps · dt in s.
    #[must_use]
    pub(crate) fn duration(self) -> f64 {
        self.steps as f64 * self.dt
    }

    /// The times of all points, each computed from its index.
    pub(crate) fn times(self) -> impl Iterator<Item = f64> {
        (0..self.points()).map(move |i| i as f64 * self.dt)
    }
}

/// Numbers on the step grid in SI units, and what the user should know about them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// steps + 1 values.
    pub values: Vec<f64>,
    /// Warnings in plain words, each naming what it is about.
    pub warnings: Vec<String>,
    /// Why the response to these values is not the one to the motion, in plain words: frequencies that the step does not
    /// represent, a peak after the end of the test.
    pub doubts: Vec<String>,
    /// Facts of the record, if the values come from a file.
    pub record: Option<RecordFacts>,
    /// How an acceleration became a displacement, if one did.
    pub corrected: Option<Corrected>,
}

/// A load that keeps its shape: pattern · series(t).
#[derive(Debug, Clone, PartialEq)]
pub struct LoadTerm {
    /// One entry per degree of freedom: −M ι for a ground acceleration, 1 at the loaded DOF for a nodal force.
    pub pattern: Vec<f64>,
    /// One value per point of the grid: m/s² or N.
    pub series: Vec<f64>,
}

/// Forces in N from a table: one column per loaded degree of freedom, one row per step.
#[derive(Debug, Clone, PartialEq)]
pub struct NodalTable {
    /// Degree of freedom of each column, from 0.
    pub dofs: Vec<usize>,
    /// Forces by rows; rows beyond the test are ignored, missing ones are zero.
    pub values: Vec<f64>,
}

/// All that loads a structure during a test, laid out to be read step by step.
#[derive(Debug, Clone, PartialEq)]
pub struct Excitation {
    dofs: usize,
    steps: usize,
    terms: Vec<Term>,
    table: Option<NodalTable>,
    constant: Option<Vec<f64>>,
    base: Option<(Vec<f64>, Vec<f64>)>,
    grounds: Vec<Ground>,
    supports: bool,
}

/// A recorded ground acceleration.
#[derive(Debug, Clone, PartialEq)]
pub struct Ground {
    /// End of the name of its column; empty for the only one.
    pub suffix: String,
    /// In m/s², steps + 1 values.
    pub accel: Vec<f64>,
}

impl Ground {
    /// Acceleration in m/s² at `step`, 0 beyond the test. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn at(&self, step: usize) -> f64 {
        self.accel.get(step).copied().unwrap_or(0.0)
    }
}

/// A load term as the loop reads it.
#[derive(Debug, Clone, PartialEq)]
struct Term {
    pattern: Pattern,
    series: Vec<f64>,
}

/// Entries of a pattern, all of them or those that are not zero.
#[derive(Debug, Clone, PartialEq)]
enum Pattern {
    Dense(Vec<f64>),
    Sparse(Vec<(usize, f64)>),
}

impl Excitation {
    /// Zero load on `dofs` degrees of freedom during `steps` steps.
    #[must_use]
    pub const fn none(dofs: usize, steps: usize) -> Self {
        Self {
            dofs,
            steps,
            terms: Vec::new(),
            table: None,
            constant: None,
            base: None,
            grounds: Vec::new(),
            supports: false,
        }
    }

    /// Adds a load term: pattern of `dofs` entries, series of `steps + 1`.
    ///
    /// # Errors
    /// [`MotionError::Length`], [`MotionError::EntryNotFinite`].
    pub fn with_term(mut self, term: LoadTerm) -> Result<Self, MotionError> {
        check("load pattern", &term.pattern, self.dofs)?;
        check("load series", &term.series, self.steps + 1)?;
        let loaded: Vec<(usize, f64)> = term
            .pattern
            .iter()
            .copied()
            .enumerate()
            .filter(|(_, p)| *p != 0.0)
            .collect();
        let pattern = if 2 * loaded.len() <= self.dofs {
            Pattern::Sparse(loaded)
        } else {
            Pattern::Dense(term.pattern)
        };
        self.terms.push(Term {
            pattern,
            series: term.series,
        });
        Ok(self)
    }

    /// Adds the loads of a support that moves: those of its displacement and of its velocity.
    ///
    /// # Errors
    /// As [`Self::with_term`].
    pub fn with_support(self, terms: [LoadTerm; 2]) -> Result<Self, MotionError> {
        let [elastic, viscous] = terms;
        let mut all = self.with_term(elastic)?.with_term(viscous)?;
        all.supports = true;
        Ok(all)
    }

    /// Adds a table of nodal forces.
    ///
    /// # Errors
    /// [`MotionError::Length`] if the values are no whole number of rows, [`MotionError::NoSuchDof`],
    /// [`MotionError::EntryNotFinite`].
    pub fn with_table(mut self, table: NodalTable) -> Result<Self, MotionError> {
        let width = table.dofs.len();
        let rows = table.values.len().checked_div(width).unwrap_or(0);
        if width == 0 || rows == 0 || rows * width != table.values.len() {
            return Err(MotionError::Length {
                what: "nodal force table",
                wanted: rows.max(1) * width.max(1),
                found: table.values.len(),
            });
        }
        if let Some(dof) = table.dofs.iter().find(|d| **d >= self.dofs) {
            return Err(MotionError::NoSuchDof {
                what: "nodal force table",
                found: dof + 1,
                dofs: self.dofs,
            });
        }
        all_finite("nodal force table", &table.values)?;
        self.table = Some(table);
        Ok(self)
    }

    /// Adds a load in N that acts at every step: gravity, a jack.
    ///
    /// # Errors
    /// [`MotionError::Length`], [`MotionError::EntryNotFinite`].
    pub fn with_constant(mut self, force: Vec<f64>) -> Result<Self, MotionError> {
        check("constant load", &force, self.dofs)?;
        self.constant = Some(force);
        Ok(self)
    }

    /// Sets the displacement (m) and velocity (m/s) of the base, `steps + 1` values each.
    ///
    /// # Errors
    /// [`MotionError::Length`], [`MotionError::EntryNotFinite`].
    pub fn with_base(mut self, disp: Vec<f64>, vel: Vec<f64>) -> Result<Self, MotionError> {
        check("base displacement", &disp, self.steps + 1)?;
        check("base velocity", &vel, self.steps + 1)?;
        self.base = Some((disp, vel));
        Ok(self)
    }

    /// Keeps a ground acceleration (m/s², `steps + 1` values) for the rows; the load it causes is a term. `suffix` is the end of
    /// the name of its column.
    ///
    /// # Errors
    /// [`MotionError::Length`], [`MotionError::EntryNotFinite`].
    pub fn with_ground(mut self, suffix: &str, accel: Vec<f64>) -> Result<Self, MotionError> {
        check("ground acceleration", &accel, self.steps + 1)?;
        self.grounds.push(Ground {
            suffix: suffix.to_owned(),
            accel,
        });
        Ok(self)
    }

    /// Number of steps.
    #[must_use]
    pub const fn steps(&self) -> usize {
        self.steps
    }

    /// True if the base moves.
    #[inline]
    #[must_use]
    pub const fn has_base(&self) -> bool {
        self.base.is_some()
    }

    /// True if the coordinates are absolute: the base or a support moves.
    #[inline]
    #[must_use]
    pub const fn is_absolute(&self) -> bool {
        self.has_base() || self.supports
    }

    /// True if a load acts from before the start, a static load.
    #[inline]
    #[must_use]
    pub const fn has_constant(&self) -> bool {
        self.constant.is_some()
    }

    /// The ground accelerations, in the order of their columns.
    #[inline]
    #[must_use]
    pub fn grounds(&self) -> &[Ground] {
        &self.grounds
    }

    /// The degree of freedom, from 0, and the largest force in N of a table of forces, with its sign.
    #[must_use]
    pub fn peak_of_table(&self) -> Option<(usize, f64)> {
        let table = self.table.as_ref()?;
        let forces = table.dofs.iter().cycle().zip(&table.values);
        let peak = forces.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        peak.map(|(dof, force)| (*dof, *force))
    }

    /// Writes the load at `step` over `out` (N, one entry per DOF). Beyond the test only the constant part is left.
    /// Real-time: yes.
    #[inline]
    pub fn load_into(&self, step: usize, out: &mut [f64]) {
        match &self.constant {
            Some(force) => out.iter_mut().zip(force).for_each(|(o, f)| *o = *f),
            None => out.fill(0.0),
        }
        for term in &self.terms {
            let factor = term.series.get(step).copied().unwrap_or(0.0);
            if factor == 0.0 {
                continue;
            }
            match &term.pattern {
                Pattern::Dense(pattern) => {
                    for (o, p) in out.iter_mut().zip(pattern) {
                        *o += p * factor;
                    }
                }
                Pattern::Sparse(entries) => {
                    for (dof, p) in entries {
                        if let Some(o) = out.get_mut(*dof) {
                            *o += p * factor;
                        }
                    }
                }
            }
        }
        if step <= self.steps
            && let Some(table) = &self.table
            && let Some(row) = table.values.chunks_exact(table.dofs.len()).nth(step)
        {
            for (dof, force) in table.dofs.iter().zip(row) {
                if let Some(o) = out.get_mut(*dof) {
                    *o += force;
                }
            }
        }
    }

    /// True if the loads of a step can be made some rows at a time.
    #[inline]
    #[must_use]
    pub fn is_by_rows(&self) -> bool {
        let is_dense = |term: &Term| matches!(term.pattern, Pattern::Dense(_));
        self.table.is_none() && self.terms.iter().all(is_dense)
    }

    /// The loads of these rows alone, with the bits of [`Excitation::load_into`]; `out` is whole. False if no load acts
    /// at this step: then `out` stays unchanged. Only if [`Excitation::is_by_rows`]. Real-time: yes.
    #[inline]
    pub fn load_rows(&self, step: usize, rows: Range<usize>, out: &mut [f64]) -> bool {
        let factor = |term: &Term| term.series.get(step).copied().unwrap_or(0.0);
        let is_loaded = self.constant.is_some() || self.terms.iter().any(|t| factor(t) != 0.0);
        let (true, Some(out)) = (is_loaded, out.get_mut(rows.clone())) else {
            return false;
        };
        match self
            .constant
            .as_ref()
            .and_then(|force| force.get(rows.clone()))
        {
            Some(force) => out.copy_from_slice(force),
            None => out.fill(0.0),
        }
        for term in &self.terms {
            let factor = factor(term);
            if factor != 0.0
                && let Pattern::Dense(pattern) = &term.pattern
                && let Some(pattern) = pattern.get(rows.clone())
            {
                for (o, p) in out.iter_mut().zip(pattern) {
                    *o += p * factor;
                }
            }
        }
        true
    }

    /// Displacement (m) and velocity (m/s) of the base at `step`; a base that does not move is at (0, 0). Beyond the
    /// test the base keeps its last displacement: it does not jump home. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn base(&self, step: usize) -> (f64, f64) {
        let Some((disp, vel)) = &self.base else {
            return (0.0, 0.0);
        };
        match (disp.get(step), vel.get(step)) {
            (Some(d), Some(v)) => (*d, *v),
            _ => (disp.last().copied().unwrap_or(0.0), 0.0),
        }
    }

    /// Acceleration in m/s² of the first of the [`Self::grounds`] at `step`, 0 without one. Real-time: yes.
    #[inline]
    #[must_use]
    pub fn ground(&self, step: usize) -> f64 {
        self.grounds.first().map_or(0.0, |ground| ground.at(step))
    }
}

/// Largest absolute value, 0 of nothing.
fn peak(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, v| most.max(v.abs()))
}

/// `values` has `wanted` finite entries.
fn check(what: &'static str, values: &[f64], wanted: usize) -> Result<(), MotionError> {
    if values.len() != wanted {
        return Err(MotionError::Length {
            what,
            wanted,
            found: values.len(),
        });
    }
    all_finite(what, values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_quantity::assert_is;

    fn loaded() -> Excitation {
        Excitation::none(5, 3)
            .with_constant(vec![0.0, -10.0, 0.0, 0.0, 0.0])
            .and_then(|e| {
                e.with_term(LoadTerm {
                    pattern: vec![-1.0, -2.0, -3.0, -4.0, -5.0],
                    series: vec![0.0, 1.0, 2.0, 0.5],
                })
            })
            .and_then(|e| {
                e.with_term(LoadTerm {
                    pattern: vec![0.0, 0.0, 0.0, 0.0, 7.0],
                    series: vec![1.0, 0.0, 1.0, 0.0],
                })
            })
            .and_then(|e| {
                e.with_table(NodalTable {
                    dofs: vec![3, 0],
                    values: vec![0.1, 0.2, 0.3, 0.4],
                })
            })
            .and_then(|e| e.with_base(vec![0.0, 1.0, 2.0, 3.0], vec![9.0; 4]))
            .and_then(|e| e.with_ground("", vec![0.0, 1.0, 2.0, 0.5]))
            .unwrap()
    }

    #[test]
    fn load_is_the_sum_of_its_parts() {
        let excitation = loaded();
        let mut out = vec![f64::NAN; 5];
        for (step, expected) in [
            (0, [0.2, -10.0, 0.0, 0.1, 7.0]),
            (1, [-1.0 + 0.4, -12.0, -3.0, -4.0 + 0.3, -5.0]),
            (2, [-2.0, -14.0, -6.0, -8.0, -10.0 + 7.0]),
            (3, [-0.5, -11.0, -1.5, -2.0, -2.5]),
            (4, [0.0, -10.0, 0.0, 0.0, 0.0]),
            (usize::MAX, [0.0, -10.0, 0.0, 0.0, 0.0]),
        ] {
            excitation.load_into(step, &mut out);
            assert_eq!(out, expected, "step {step}");
        }
    }

    #[test]
    fn long_table_ends_with_the_test() {
        let excitation = Excitation::none(1, 1)
            .with_table(NodalTable {
                dofs: vec![0],
                values: vec![1.0, 2.0, 3.0],
            })
            .unwrap();
        let mut out = [0.0];
        for (step, force) in [(0, 1.0), (1, 2.0), (2, 0.0)] {
            excitation.load_into(step, &mut out);
            assert_eq!(out, [force]);
        }
    }

    #[test]
    fn base_stays_at_its_last_displacement() {
        let excitation = loaded();
        assert_eq!(excitation.base(2), (2.0, 9.0));
        assert_eq!(excitation.base(4), (3.0, 0.0));
        assert_eq!((excitation.ground(2), excitation.ground(4)), (2.0, 0.0));
        assert_eq!(Excitation::none(1, 1).base(0), (0.0, 0.0));
        assert_eq!(Excitation::none(1, 1).ground(0), 0.0);
    }

    #[test]
    fn excitation_is_checked_when_it_is_made() {
        let bare = || Excitation::none(2, 1);
        let term = |pattern: &[f64], series: &[f64]| {
            bare().with_term(LoadTerm {
                pattern: pattern.to_vec(),
                series: series.to_vec(),
            })
        };
        assert!(term(&[1.0, 0.0], &[0.0, 1.0]).is_ok());
        assert_is!(
            term(&[1.0], &[0.0, 1.0]).unwrap_err()
            => MotionError::Length { what: "load pattern", wanted: 2, found: 1 }
        );
        assert_is!(
            term(&[1.0, 0.0], &[0.0]).unwrap_err()
            => MotionError::Length { what: "load series", wanted: 2, found: 1 }
        );
        assert_is!(
            term(&[1.0, 0.0], &[0.0, f64::NAN]).unwrap_err()
            => MotionError::EntryNotFinite { index: 2, .. }
        );
        assert!(bare().with_constant(vec![1.0]).is_err());
        assert!(bare().with_base(vec![0.0; 2], vec![0.0]).is_err());
        assert!(bare().with_ground("", vec![f64::INFINITY, 0.0]).is_err());
        let table = |dofs: &[usize], values: &[f64]| {
            bare().with_table(NodalTable {
                dofs: dofs.to_vec(),
                values: values.to_vec(),
            })
        };
        assert_is!(
            table(&[2], &[1.0]).unwrap_err()
            => MotionError::NoSuchDof { found: 3, dofs: 2, .. }
        );
        assert!(table(&[0, 1], &[1.0, 2.0, 3.0]).is_err());
        assert!(table(&[], &[]).is_err());
        for dt in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Grid::new(dt, 10).is_err());
        }
    }

    #[test]
    fn reading_the_load_allocates_nothing() {
        let n = 5000;
        let mut sparse = vec![0.0; n];
        sparse[17] = 1.0;
        let excitation = Excitation::none(n, 100)
            .with_term(LoadTerm {
                pattern: vec![-1.0; n],
                series: vec![1.0; 101],
            })
            .and_then(|e| {
                e.with_term(LoadTerm {
                    pattern: sparse,
                    series: vec![2.0; 101],
                })
            })
            .and_then(|e| {
                e.with_table(NodalTable {
                    dofs: vec![1, 2],
                    values: vec![1.0; 202],
                })
            })
            .and_then(|e| e.with_base(vec![0.0; 101], vec![0.0; 101]))
            .and_then(|e| e.with_ground("", vec![0.0; 101]))
            .unwrap();
        let mut out = vec![0.0; n];
        let mut sum = 0.0;
        let counted = allocation_counter::measure(|| {
            for step in 0..120 {
                excitation.load_into(step, &mut out);
                sum += excitation.base(step).0 + excitation.ground(step);
            }
        });
        assert_eq!(counted.count_total, 0);
        assert_eq!(sum, 0.0);
    }
}
