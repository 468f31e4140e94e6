//! Columns that follow from the recorded ones: absolute acceleration, storey drift and storey shear, as sums for an export.
//!
//! | columns | sum | needs |
//! |---|---|---|
//! | `abs_a<dof>` | a + ι a_g | a motion of the ground |
//! | `drift<storey>` | x of the floor − x of the floor below | storeys |
//! | `shear<storey>` | − Σ m (a + ι a_g) of the floors above | a shear building |
//!
//! Where the base is displaced, coordinates are absolute: a is absolute, and the floor below the first storey is the base.
//! The shear comes from the inertia of the floors, so that it holds restoring and damping forces, and those of the specimens. It is positive
//! where it resists a positive drift.

use thiserror::Error;

use gusset_config::{self as config, ConfigError, TestFile, Weighting};
use gusset_control::engine::Phase;
use gusset_numerics::model::{BuildError, StructureSpec};
use gusset_quantity::catalog::column::{ACCEL, DISP, GROUND, STATE, TIME};
use gusset_record::export::{Rows, Sum};
use gusset_record::{FolderError, Run};

/// A kind of column that follows from recorded ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Derived {
    /// Acceleration against a point that rests.
    AbsoluteAcceleration,
    /// Displacement of a floor against the floor below.
    StoreyDrift,
    /// Force that a storey passes to the floor below.
    StoreyShear,
}

/// Why there are no such columns.
#[derive(Debug, Error)]
pub enum DerivedError {
    /// The configuration of the run cannot be read again.
    #[error("resolved.toml of the run cannot be read again: {0}")]
    Config(#[from] ConfigError),
    /// The test has no structure.
    #[error("the test has no [structure], so it has no {0}")]
    NoStructure(&'static str),
    /// Nothing moves the ground.
    #[error(
        "the ground does not move: without [excitation.ground_acceleration] and [excitation.base_displacement] the columns a1, a2 … \
         are absolute"
    )]
    NoGround,
    /// The structure has no storeys.
    #[error("[structure.{0}] has no storeys: storey drift is of a shear_building or a chain")]
    NoStoreys(&'static str),
    /// Only a shear building has floors with their masses.
    #[error("[structure.{0}] has no floors: storey shear is of a shear_building")]
    NoFloors(&'static str),
    /// A force that is not recorded acts on the floors.
    #[error(
        "storey shear is the inertia of the floors above, and `{0}` adds forces to them that are not recorded: take the drift instead"
    )]
    OtherForces(&'static str),
    /// A specimen's measured force holds inertia.
    #[error(
        "storey shear needs the whole mass of each floor, and a part of it is in the force of specimen {name:?} \
         (`mass_in_force_kg`): take the drift instead"
    )]
    MassInForce {
        /// Name of the specimen.
        name: String,
    },
    /// The recorded acceleration is not that of equilibrium.
    #[error(
        "storey shear needs the acceleration of equilibrium, and `integrator.weighting` \"state\" records another: take the drift \
         instead"
    )]
    OwnAcceleration,
    /// The ground moves within a step, and the acceleration does not.
    #[error(
        "with several ticks per step (`time.ticks_per_step`), accelerations are those of the step's end: take --rate step"
    )]
    BetweenSteps,
}

/// The requested columns, from the configuration in the folder of a run.
///
/// # Errors
/// [`DerivedError`].
pub fn derived(run: &Run, wanted: &[Derived], rows: Rows) -> Result<Vec<Sum>, DerivedError> {
    if wanted.is_empty() {
        return Ok(Vec::new());
    }
    let loaded = config::load_recorded(&run.path().join("resolved.toml"))?;
    let test = Described::of(&loaded.file, run)?;
    let mut sums = Vec::new();
    for kind in wanted {
        let is_between = rows == Rows::Tick && loaded.file.time.ticks_per_step > 1;
        if is_between && *kind != Derived::StoreyDrift {
            return Err(DerivedError::BetweenSteps);
        }
        match kind {
            Derived::AbsoluteAcceleration => test.accelerations(&mut sums)?,
            Derived::StoreyDrift => test.drifts(&mut sums)?,
            Derived::StoreyShear => test.shears(&mut sums)?,
        }
    }
    Ok(sums)
}

/// Largest values of the floors of a test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorPeaks {
    /// Storey from 1 and its drift in m, where the structure has storeys.
    pub drift: Option<(usize, f64)>,
    /// DOF from 1 and its absolute acceleration in m/s², where the ground moves.
    pub accel: Option<(usize, f64)>,
}

/// Largest storey drift and absolute acceleration in the steps of a run. A kind with an unrecorded column is omitted.
///
/// # Errors
/// [`DerivedError`], or the system refuses the rows.
pub fn floor_peaks(run: &Run) -> Result<FloorPeaks, FloorError> {
    let loaded =
        config::load_recorded(&run.path().join("resolved.toml")).map_err(DerivedError::Config)?;
    let test = Described::of(&loaded.file, run)?;
    let place = |name: &str| run.layout().index_of(name);
    // Number from 1, places and factors of each sum. A kind without columns has no sums.
    let placed = |sums: Vec<Sum>, unit: &str| -> Vec<(usize, Vec<(usize, f64)>)> {
        let of_unit = (1..).zip(&sums).filter(|(_, sum)| sum.unit == unit);
        let each = of_unit.map(|(storey, sum)| {
            let terms = sum.terms.iter();
            let dof = terms.clone().find_map(|(name, _)| ACCEL.dof_in(name));
            let terms = terms.map(|(name, factor)| Some((place(name)?, *factor)));
            let number = dof.map_or(storey, |dof| dof as usize);
            Some((number, terms.collect::<Option<Vec<_>>>()?))
        });
        each.collect::<Option<Vec<_>>>().unwrap_or_default()
    };
    let (mut drifts, mut accels) = (Vec::new(), Vec::new());
    let drifts = test
        .drifts(&mut drifts)
        .map_or(Vec::new(), |()| placed(drifts, "m"));
    let accels = test
        .accelerations(&mut accels)
        .map_or(Vec::new(), |()| placed(accels, "m/s2"));
    let mut peaks = [vec![0.0_f64; drifts.len()], vec![0.0; accels.len()]];
    let (time, state) = (place(TIME.name()), place(STATE.name()));
    if !(drifts.is_empty() && accels.is_empty()) {
        let mut journal = run.journal()?;
        while let Some(row) = journal.next_row().map_err(FloorError::Rows)? {
            let at = |place: usize| row.values.get(place).copied().unwrap_or(f64::NAN);
            let is_of_test = time.is_none_or(|place| at(place) >= 0.0)
                && state.is_none_or(|place| at(place) == Phase::Running.code());
            if !is_of_test {
                continue;
            }
            for (sums, peaks) in [&drifts, &accels].into_iter().zip(&mut peaks) {
                for ((_, terms), peak) in sums.iter().zip(peaks) {
                    let value: f64 = terms
                        .iter()
                        .map(|(place, factor)| factor * at(*place))
                        .sum();
                    *peak = peak.max(value.abs());
                }
            }
        }
    }
    let largest = |sums: &[(usize, Vec<_>)], peaks: &[f64]| {
        let numbered = sums
            .iter()
            .map(|(number, _)| *number)
            .zip(peaks.iter().copied());
        numbered
            .filter(|(_, peak)| *peak > 0.0)
            .max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let (drift, accel) = (largest(&drifts, &peaks[0]), largest(&accels, &peaks[1]));
    Ok(FloorPeaks { drift, accel })
}

/// Why the peaks of the floors are not known.
#[derive(Debug, Error)]
pub enum FloorError {
    /// The test has no floors.
    #[error(transparent)]
    Derived(#[from] DerivedError),
    /// The folder cannot be read.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The rows cannot be read.
    #[error("samples.bin: {0}")]
    Rows(std::io::Error),
}

/// The description of a test, and its recorded columns.
struct Described<'a> {
    file: &'a TestFile,
    run: &'a Run,
    kind: &'static str,
    structure: StructureSpec,
    influence: Option<Vec<f64>>,
}

impl<'a> Described<'a> {
    fn of(file: &'a TestFile, run: &'a Run) -> Result<Self, DerivedError> {
        let first = file.structure.as_ref().and_then(|table| table.kind());
        let (kind, structure) = first.ok_or(DerivedError::NoStructure("columns of floors"))?;
        Ok(Self {
            influence: structure.influence(),
            file,
            run,
            kind,
            structure,
        })
    }

    fn has_base(&self) -> bool {
        self.file.excitation.base_displacement.is_some()
    }

    /// Columns of the ground and their ι of a DOF from 0, where it is not zero.
    fn grounds(&self, dof: usize) -> impl Iterator<Item = (String, f64)> {
        let grounds = self.file.excitation.ground_acceleration.clone();
        grounds.tracks().into_iter().filter_map(move |track| {
            // All components of a column have one influence vector.
            let component = grounds.all().get(*track.components.first()?)?;
            let given = component.influence_in(&self.structure);
            let given = given.or_else(|| self.influence.clone());
            let iota = given.map_or(1.0, |iota| iota.get(dof).copied().unwrap_or(0.0));
            (iota != 0.0).then(|| (GROUND.of_component(&track.suffix), iota))
        })
    }

    /// The absolute acceleration of a DOF from 0, times a factor.
    fn accel(&self, dof: usize, factor: f64, terms: &mut Vec<(String, f64)>) {
        terms.push((ACCEL.of_dof(dof + 1), factor));
        let grounds = self.grounds(dof);
        terms.extend(grounds.map(|(column, iota)| (column, factor * iota)));
    }

    fn accelerations(&self, sums: &mut Vec<Sum>) -> Result<(), DerivedError> {
        let excitation = &self.file.excitation;
        let is_absolute = self.has_base() || !excitation.support_motion.is_empty();
        if excitation.ground_acceleration.is_empty() && !is_absolute {
            return Err(DerivedError::NoGround);
        }
        for column in self.run.layout().columns() {
            let Some(dof) = ACCEL.dof_in(&column.name) else {
                continue;
            };
            let dof = dof as usize - 1;
            let table = self.file.structure.as_ref();
            let Some(of_model) = table.and_then(|table| table.dof_of_model(dof)) else {
                continue;
            };
            let mut terms = vec![(ACCEL.of_dof(dof + 1), 1.0)];
            terms.extend(self.grounds(of_model));
            let also = if is_absolute {
                ", which is the recorded one: the base or a support is displaced"
            } else {
                ""
            };
            sums.push(Sum {
                name: format!("abs_a{}", dof + 1),
                unit: column.unit.clone(),
                meaning: format!("absolute acceleration of DOF {}{also}", dof + 1),
                terms,
            });
        }
        Ok(())
    }

    fn drifts(&self, sums: &mut Vec<Sum>) -> Result<(), DerivedError> {
        for storey in 1.. {
            let row = match self.structure.storey_row(storey) {
                Ok(row) => row,
                Err(BuildError::NoSuchStorey { .. }) => break,
                Err(_) => return Err(DerivedError::NoStoreys(self.kind)),
            };
            // The upper floor first, as a difference is read.
            let each = row.iter().rev();
            let mut terms: Vec<(String, f64)> = each
                .map(|(dof, factor)| (DISP.of_dof(dof + 1), *factor))
                .collect();
            if storey == 1 && self.has_base() {
                terms.push((GROUND.name().to_owned(), -1.0));
            }
            sums.push(Sum {
                name: format!("drift{storey}"),
                unit: "m".to_owned(),
                meaning: format!("drift of storey {storey}"),
                terms,
            });
        }
        Ok(())
    }

    fn shears(&self, sums: &mut Vec<Sum>) -> Result<(), DerivedError> {
        let StructureSpec::ShearBuilding(building) = &self.structure else {
            return Err(DerivedError::NoFloors(self.kind));
        };
        self.check_forces()?;
        let floors = building.mass_kg.len();
        for storey in 1..=floors {
            let mut terms = Vec::new();
            for (floor, mass) in building.mass_kg.iter().enumerate().skip(storey - 1) {
                self.accel(floor, -mass, &mut terms);
            }
            sums.push(Sum {
                name: format!("shear{storey}"),
                unit: "N".to_owned(),
                meaning: format!("shear of storey {storey}, from the inertia of the floors above"),
                terms,
            });
        }
        Ok(())
    }

    /// The inertia of the floors is all that the storeys carry.
    fn check_forces(&self) -> Result<(), DerivedError> {
        let excitation = &self.file.excitation;
        let structure = self.file.structure.as_ref();
        for (key, is_given) in [
            ("excitation.nodal_force", !excitation.nodal_force.is_empty()),
            ("excitation.nodal_table", excitation.nodal_table.is_some()),
            (
                "structure.static_load_n",
                structure.is_some_and(|table| table.static_load_n.is_some()),
            ),
            (
                "structure.gravity",
                structure.is_some_and(|table| table.gravity.is_some()),
            ),
        ] {
            if is_given {
                return Err(DerivedError::OtherForces(key));
            }
        }
        let mut specimens = self.file.specimen.iter();
        if let Some(heavy) = specimens.find(|specimen| specimen.mass_in_force_kg != 0.0) {
            return Err(DerivedError::MassInForce {
                name: heavy.name.clone(),
            });
        }
        if self.file.integrator.weighting == Some(Weighting::State) {
            return Err(DerivedError::OwnAcceleration);
        }
        Ok(())
    }
}
