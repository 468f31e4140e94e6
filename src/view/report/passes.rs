//! Two readings of the rows make a digest. The only failure is that rows cannot be read.

use std::io;

use super::axes::{AxisDigest, envelope};
use super::columns::{ERROR, MOST_LINES, SpecimenAxis, spread};
use super::digest::Digest;
use super::first::{First, Measured};
use super::series::{Second, second};
use super::shaking::Shaking;
use super::source::Source;
use crate::TestFile;
use gusset_motion::metrics::energy::Model;
use gusset_quantity::catalog::column::{DISP, FORCE, is_ground};
use gusset_record::Column;

/// DOFs of which spectra are made.
const MOST_SPECTRA: usize = MOST_LINES;

/// DOFs with a displacement among `columns`, rising.
fn dofs(columns: &[Column]) -> Vec<u32> {
    let names = columns.iter().map(|c| c.name.as_str());
    let mut dofs: Vec<u32> = names.filter_map(|name| DISP.dof_in(name)).collect();
    dofs.sort_unstable();
    dofs.dedup();
    dofs
}

/// Columns of the ground among `columns`.
fn grounds(columns: &[Column]) -> Vec<String> {
    let names = columns.iter().map(|column| column.name.clone());
    names.filter(|name| is_ground(name)).collect()
}

/// Axes of specimens with a force among `columns`, rising.
fn axes(columns: &[Column]) -> Vec<SpecimenAxis> {
    let parse = |name: &str| {
        let (specimen, axis) = FORCE.axis_in(name)?;
        Some(SpecimenAxis { specimen, axis })
    };
    let mut axes: Vec<_> = columns.iter().filter_map(|c| parse(&c.name)).collect();
    axes.sort_unstable();
    axes.dedup();
    axes
}

impl Digest {
    /// Reads `source`; `test` gives the storeys or the frame, `model` closes the energy balance.
    ///
    /// # Errors
    /// The rows cannot be read.
    pub fn of(
        source: &dyn Source,
        test: &TestFile,
        model: Option<&mut dyn Model>,
    ) -> io::Result<Self> {
        let columns = source.columns();
        let mut digest = Self {
            dofs: dofs(columns),
            all_axes: axes(columns),
            grounds: grounds(columns),
            ticks_per_step: source.ticks_per_step().max(1),
            earlier: source.earlier().cloned(),
            without_disp: source.without_disp().to_vec(),
            ..Self::default()
        };
        let mut first = First::new(source, test, model, &digest);
        source.read(&first.wanted.clone(), &mut |block| first.take(block))?;
        let (measured, evenness) = first.finish(&mut digest);
        let spectra = spread(&digest.dofs, MOST_SPECTRA);
        let found = second(source, &digest, &measured, evenness, &spectra)?;
        digest.conclude(found, &measured, &spectra);
        Ok(digest)
    }

    fn conclude(&mut self, found: Second, measured: &[Measured], spectra: &[u32]) {
        let (steps, every) = found.steps;
        if let Some(dt) = self.interval.map(|dt| dt * every as f64) {
            for (place, column) in self.grounds.clone().into_iter().enumerate() {
                let Some(ground) = steps.get(&column) else {
                    continue;
                };
                let before = self.ground_before(place).chunks(every);
                let before = before.map(|part| part.iter().sum::<f64>() / part.len() as f64);
                let ground: Vec<f64> = before.chain(ground.iter().copied()).collect();
                let found = Shaking::of(&ground, steps.unit(&column), dt);
                self.shaking.extend(found.map(|found| (column, found)));
            }
            let of = |dof: &u32| Some((*dof, envelope(steps.get(&format!("x{dof}"))?, dt)?));
            self.spectra = spectra.iter().filter_map(of).collect();
        }
        let (ticks, every) = found.ticks;
        (self.means_of, self.residuals) = (every, found.residuals);
        for (one, loops) in measured.iter().zip(found.loops) {
            let peak = |kind: &str| {
                let peak = self.ticks.marks(&one.axis.column(kind)).peak;
                peak.map(|peak| peak.value)
            };
            let mut axis = AxisDigest {
                peak_disp: peak("meas"),
                peak_force: peak("force"),
                absorbed: one.absorbed.filter(|_| self.passed.missing_ticks == 0),
                ..AxisDigest::of(one.axis, &ticks, found.dt, every, one.noise())
            };
            [axis.hysteresis, axis.subspace] = loops;
            if let Some(tracking) = &mut axis.tracking {
                let scale = self.scale.as_ref();
                tracking.energy_error_share =
                    scale.and_then(|scale| scale.share(tracking.energy_error_j));
                if let Some(largest) = peak(ERROR).filter(|_| every > 1) {
                    tracking.peak_error_m.value = largest.abs();
                }
            }
            if !self.measures_disp(one.axis) {
                axis.forget_measured_disp();
            }
            self.axes.push(axis);
        }
    }
}
