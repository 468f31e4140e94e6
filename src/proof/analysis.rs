//! A structure with its specimens before anything moves: its matrices, modes and the loop of each specimen.
//!
//! Only the matrices are kept. Modes and delays are computed when a caller asks for them.

use nalgebra::DMatrix;

use gusset_numerics::integrate::Lambda;
use gusset_numerics::linalg::{self, Condensation, SymMatrix};
use gusset_numerics::spectral::delay::{
    Critical, DelayError, Delayed, DiscreteLimit, Weights, continuous, discrete,
};
use gusset_numerics::spectral::{Apparent, Locus};

/// Largest structure of which anything is analysed: some dozens of factorisations and a few vectors of its size.
const LARGEST: usize = 50_000;
/// Largest structure of which all modes are found.
pub(crate) const ALL_MODES: usize = 100;
/// Modes that are found of a larger one.
const LOWEST: usize = 6;
/// Largest structure whose delays are analysed: eigenvalues of four times as many rows.
const LARGEST_DELAYED: usize = 40;

/// Matrices of a structure with its specimens, at the start.
#[derive(Debug, Clone)]
pub struct Analysis {
    pub(super) mass: SymMatrix,
    /// Tangents at rest: an open gap has no stiffness.
    pub(super) at_rest: AtRest,
    /// K0 and C0, as in M_eff: an open gap counts as closed.
    stiffness: SymMatrix,
    damping: SymMatrix,
    /// Δt in s and λ, of a member of the family.
    pub(super) step: Option<(f64, Lambda)>,
    /// One per specimen; empty where the structure is too large.
    pub loops: Vec<Loop>,
    pub(super) specimens: Vec<Attached>,
    /// Tangent stiffness at rest of all degrees of freedom.
    whole: SymMatrix,
}

/// Tangents before anything moves, specimens included.
#[derive(Debug, Clone)]
pub struct AtRest {
    /// Tangent stiffness.
    pub stiffness: SymMatrix,
    /// Tangent damping, or its reference where that is less: a damper without a finite tangent at rest has only a
    /// reference.
    pub damping: SymMatrix,
}

/// One specimen in the structure, in the structure's units. Matrices are by rows.
#[derive(Debug, Clone)]
pub struct Attached {
    /// Its name.
    pub name: String,
    /// Its rows of B: degree of freedom, from 0, and entry.
    pub rows: Vec<Vec<(usize, f64)>>,
    /// k̂ in N/m.
    pub stiffness: Vec<Vec<f64>>,
    /// Stiffness before anything moves, in N/m.
    pub stiffness_at_rest: Vec<Vec<f64>>,
    /// ĉ in N s/m.
    pub damping: Vec<Vec<f64>>,
    /// Damping before anything moves, in N s/m.
    pub damping_at_rest: Vec<Vec<f64>>,
    /// Mass whose inertia is inside the measured force, in kg.
    pub mass_in_force: f64,
    /// The course of its commands between two steps, as in [`Delayed::ticks`].
    pub ticks: Vec<Weights>,
}

/// The matrices of a structure with its specimens.
#[derive(Debug, Clone)]
pub struct Matrices {
    /// M, without the mass whose inertia is inside measured forces.
    pub mass: SymMatrix,
    /// Tangents before anything moves.
    pub at_rest: AtRest,
    /// K0, as in M_eff: an open gap counts as closed.
    pub stiffness: SymMatrix,
    /// C0, as in M_eff.
    pub damping: SymMatrix,
    /// Degrees of freedom without mass that follow statically, rising.
    pub massless: Vec<usize>,
}

impl Matrices {
    /// The degrees of freedom that remain where those without mass follow statically, and what they see of the specimens. Rows with a
    /// dashpot do not follow statically and remain. `None` where nothing holds a row.
    fn condensed(mut self, specimens: &mut [Attached]) -> Option<Self> {
        let (damping, at_rest) = (&self.damping, &self.at_rest.damping);
        let is_static = |row: &usize| damping.row_is_zero(*row) && at_rest.row_is_zero(*row);
        self.massless.retain(is_static);
        if self.massless.is_empty() {
            return Some(self);
        }
        let mut by_estimate = Condensation::new(&self.stiffness, &self.massless).ok()?;
        // An open gap may hold nothing at rest.
        let mut at_rest = Condensation::new(&self.at_rest.stiffness, &self.massless);
        let at_rest = at_rest.as_mut().unwrap_or(&mut by_estimate);
        for row in specimens.iter_mut().flat_map(|one| &mut one.rows) {
            *row = at_rest.row(row);
        }
        let (mass, at_rest) = (
            at_rest.seen_by(&self.mass),
            AtRest {
                stiffness: at_rest.seen_by(&self.at_rest.stiffness),
                damping: at_rest.seen_by(&self.at_rest.damping),
            },
        );
        Some(Self {
            mass,
            at_rest,
            stiffness: by_estimate.complement(),
            damping: by_estimate.seen_by(&self.damping),
            massless: Vec::new(),
        })
    }
}

/// A mode of the whole at rest, and what delays do to it.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayedMode {
    /// Natural frequency in rad/s.
    pub frequency: f64,
    /// Damping ratio φᵀ C0 φ/(2 ω) without delay.
    pub ratio: f64,
    /// Change of the damping ratio per second of delay of each axis of each specimen, −φ_a Σ (k̂ − ω² m)_ab φ_b/(2 ω), to the
    /// first order: m is mass whose inertia is in the specimen's force and as late as that force.
    pub per_second: Vec<Vec<f64>>,
}

/// One mode at λ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModeFacts {
    /// Natural frequency in rad/s.
    pub frequency: f64,
    /// Modal damping ratio φᵀ C0 φ/(2 ω).
    pub ratio: f64,
    /// Apparent frequency (times Δt) and damping ratio of the recursion; none where its poles are real.
    pub apparent: Option<Apparent>,
}

impl ModeFacts {
    /// PE = T̄/T − 1 for a step of `dt` s; positive for a period that is too long.
    #[must_use]
    pub fn period_error(&self, dt: f64) -> Option<f64> {
        self.apparent
            .map(|apparent| self.frequency * dt / apparent.omega - 1.0)
    }

    /// ξ̄ − ξ.
    #[must_use]
    pub fn damping_error(&self) -> Option<f64> {
        self.apparent.map(|apparent| apparent.ratio - self.ratio)
    }
}

/// A specimen and the structure round it, for its critical delay.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// The specimen.
    pub name: String,
    /// The structure at rest with this specimen's motion delayed, all others on time.
    pub system: Delayed,
    /// The system at K0 and C0, where it differs: every gap closed, dampers at their reference.
    pub closed: Option<Delayed>,
}

impl Attached {
    /// Change of the damping ratio of a mode per second of delay of each axis.
    fn per_second(&self, frequency: f64, shape: &[f64]) -> Vec<f64> {
        let dot =
            |row: &Vec<(usize, f64)>| -> f64 { row.iter().map(|(dof, b)| b * shape[*dof]).sum() };
        let moved: Vec<f64> = self.rows.iter().map(dot).collect();
        let inertia = frequency * frequency * self.mass_in_force;
        let of_axis = |(axis, own): (usize, &f64)| {
            // The delay of an axis is in every force that its motion makes.
            let force: f64 = moved
                .iter()
                .zip(&self.stiffness_at_rest)
                .map(|(moved, row)| moved * row[axis])
                .sum();
            -own * (force - inertia * own) / (2.0 * frequency)
        };
        moved.iter().enumerate().map(of_axis).collect()
    }
}

impl Loop {
    /// By the frequency at which the loop gain is one; none if every delay is stable.
    ///
    /// # Errors
    /// See [`DelayError`].
    pub fn continuous(&self) -> Result<Option<Critical>, DelayError> {
        continuous(&self.system)
    }

    /// By the spectral radius of the recursion at Δt and λ.
    ///
    /// # Errors
    /// See [`DelayError`].
    pub fn discrete(&self, dt: f64, lambda: f64) -> Result<DiscreteLimit, DelayError> {
        let hint = self.continuous().ok().flatten().map(|found| found.delay);
        discrete(&self.system, dt, lambda, hint)
    }
}

/// Matrices of the axes of one specimen.
pub(super) fn square(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i][j])
}

/// Damping and stiffness of a late specimen, which also represent it in the whole (m × m for m axes).
pub(super) struct Own {
    pub damping: DMatrix<f64>,
    pub stiffness: DMatrix<f64>,
}

/// A structure whose axes at `rows` are late, all others on time: they are taken out of the damping and the stiffness of the
/// `whole`.
pub(super) fn delayed(
    mass: DMatrix<f64>,
    whole: (&SymMatrix, &SymMatrix),
    rows: &[impl AsRef<[(usize, f64)]>],
    own: Own,
    mass_in_force: f64,
) -> Delayed {
    let mut b = DMatrix::zeros(rows.len(), mass.nrows());
    for (axis, row) in rows.iter().enumerate() {
        for &(dof, share) in row.as_ref() {
            b[(axis, dof)] += share;
        }
    }
    let rest = |whole: &SymMatrix, own: &DMatrix<f64>| whole.to_dense() - b.transpose() * own * &b;
    Delayed {
        mass,
        damping: rest(whole.0, &own.damping),
        stiffness: rest(whole.1, &own.stiffness),
        rows: b,
        specimen_damping: own.damping,
        specimen_stiffness: own.stiffness,
        specimen_mass: mass_in_force,
        weighted: None,
        ticks: Vec::new(),
    }
}

impl Analysis {
    /// None for a structure that is too large. `step` is Δt in s and λ of a member of the family.
    #[must_use]
    pub fn new(
        matrices: Matrices,
        mut specimens: Vec<Attached>,
        step: Option<(f64, Lambda)>,
    ) -> Option<Self> {
        if matrices.mass.n() > LARGEST {
            return None;
        }
        let whole = matrices.at_rest.stiffness.clone();
        let Matrices {
            mass,
            at_rest,
            stiffness,
            damping,
            ..
        } = matrices.condensed(&mut specimens)?;
        let n = mass.n();
        let mut analysis = Self {
            mass,
            at_rest,
            stiffness,
            damping,
            step,
            loops: Vec::new(),
            specimens,
            whole,
        };
        if n <= LARGEST_DELAYED {
            let loops = analysis.specimens.iter().map(|one| analysis.of(one));
            let loops: Vec<Loop> = loops.collect();
            analysis.loops = loops;
        }
        Some(analysis)
    }

    /// The loop of a specimen.
    fn of(&self, specimen: &Attached) -> Loop {
        let own = |damping: &[Vec<f64>], stiffness: &[Vec<f64>]| Own {
            damping: square(damping),
            stiffness: square(stiffness),
        };
        let AtRest { stiffness, damping } = &self.at_rest;
        // The inertia in the forces of the others is on time.
        let mass = self.mass_with(|other, _| !std::ptr::eq(other, specimen));
        let at_rest = delayed(
            mass.to_dense(),
            (damping, stiffness),
            &specimen.rows,
            own(&specimen.damping_at_rest, &specimen.stiffness_at_rest),
            specimen.mass_in_force,
        );
        let closed = delayed(
            mass.to_dense(),
            (&self.damping, &self.stiffness),
            &specimen.rows,
            own(&specimen.damping, &specimen.stiffness),
            specimen.mass_in_force,
        );
        // A difference is as exact as the larger of its parts.
        let differ = |pairs: [(&DMatrix<f64>, &DMatrix<f64>); 2]| {
            let scale = pairs
                .iter()
                .flat_map(|(one, other)| [one.amax(), other.amax()])
                .fold(0.0, f64::max);
            let off = |(one, other): &(&DMatrix<f64>, &DMatrix<f64>)| (*one - *other).amax();
            pairs.iter().map(off).fold(0.0, f64::max) > 1e-9 * scale
        };
        let differs = differ([
            (&closed.stiffness, &at_rest.stiffness),
            (&closed.specimen_stiffness, &at_rest.specimen_stiffness),
        ]) || differ([
            (&closed.damping, &at_rest.damping),
            (&closed.specimen_damping, &at_rest.specimen_damping),
        ]);
        Loop {
            name: specimen.name.clone(),
            system: Delayed {
                weighted: self.effective(),
                ticks: specimen.ticks.clone(),
                ..at_rest
            },
            closed: differs.then_some(closed),
        }
    }

    /// K̃ for the tangents at rest, such that M_eff stays that of K0 and C0. `None` for a method outside the family.
    pub(super) fn effective(&self) -> Option<DMatrix<f64>> {
        let (dt, lambda) = self.step?;
        let less = self.damping.plus(-1.0, &self.at_rest.damping);
        Some(self.weighted(lambda).plus(0.5 / dt, &less).to_dense())
    }

    /// K̃ = K0/λ of M_eff.
    fn weighted(&self, lambda: Lambda) -> SymMatrix {
        SymMatrix::zeros(self.mass.n()).plus(lambda.inverse(), &self.stiffness)
    }

    /// M with the mass whose inertia is in the forces of specimens.
    fn moved_mass(&self) -> SymMatrix {
        self.mass_with(|_, _| true)
    }

    /// M with the mass whose inertia is in the forces of these axes (from 0), which are on time.
    pub(super) fn mass_with(&self, counts: impl Fn(&Attached, usize) -> bool) -> SymMatrix {
        let n = self.mass.n();
        let counts = &counts;
        let moving = self.specimens.iter().flat_map(|specimen| {
            let mass = specimen.mass_in_force;
            let rows = specimen.rows.iter().enumerate();
            let rows = rows.filter(move |(axis, _)| counts(specimen, *axis));
            let squares = rows.flat_map(move |(_, row)| {
                let each = row
                    .iter()
                    .flat_map(move |a| row.iter().map(move |b| (a, b)));
                each.map(move |(a, b)| (a.0, b.0, mass * a.1 * b.1))
            });
            // One triangle says it all.
            squares.filter(move |(i, j, mass)| *mass != 0.0 && i >= j)
        });
        self.mass.plus(1.0, &SymMatrix::from_triplets(n, moving))
    }

    /// Natural frequencies of the whole at rest, ascending, and their shapes: all of a small structure, the lowest of a large
    /// one. Inertia in the forces of specimens counts as mass, as it does at low frequencies. Empty if there are no real modes.
    pub(super) fn shapes(&self) -> Vec<(f64, Vec<f64>)> {
        let mass = self.moved_mass();
        let modes = if mass.n() <= ALL_MODES {
            linalg::modes(&self.at_rest.stiffness, &mass)
        } else {
            linalg::lowest_modes(&self.at_rest.stiffness, &mass, LOWEST)
        };
        let Ok(modes) = modes else {
            return Vec::new();
        };
        let each = modes.frequencies.iter().zip(modes.shapes.column_iter());
        each.map(|(frequency, shape)| (*frequency, shape.as_slice().to_vec()))
            .collect()
    }

    /// Modes at rest, ascending, and what the recursion at Δt and λ makes of them: α holds K0 and C0, which may differ from
    /// the tangents. Modal damping is the diagonal of Φᵀ C0 Φ.
    #[must_use]
    pub fn modes(&self, dt: f64, lambda: Lambda) -> Vec<ModeFacts> {
        let weighted = self.weighted(lambda);
        let each = self.shapes().into_iter();
        each.map(|(frequency, shape)| {
            let damping = self.damping.quadratic(&shape);
            let locus = Locus {
                mass: 1.0,
                damping,
                stiffness: weighted.quadratic(&shape),
                dt,
                lambda: 1.0,
            };
            let [pole, _] = locus.roots(frequency * frequency);
            ModeFacts {
                frequency,
                ratio: damping / (2.0 * frequency),
                apparent: Apparent::of(pole),
            }
        })
        .collect()
    }

    /// The whole with nothing late, `[C, K]` being its damping and stiffness.
    fn on_time(mass: &SymMatrix, [damping, stiffness]: [&SymMatrix; 2]) -> Delayed {
        let own = Own {
            damping: DMatrix::zeros(1, 1),
            stiffness: DMatrix::zeros(1, 1),
        };
        delayed(mass.to_dense(), (damping, stiffness), &[[]], own, 0.0)
    }

    /// How fast the whole grows in continuous time with nothing delayed, in 1/s: at rest, and with K0 and C0 as well, so that
    /// nothing that is not yet in touch holds it. None if nothing grows, or the structure is too large to know.
    #[must_use]
    pub fn growth(&self) -> Option<f64> {
        if self.mass.n() > LARGEST_DELAYED {
            return None;
        }
        let mass = self.moved_mass();
        let of = |both: [&SymMatrix; 2]| Self::on_time(&mass, both).growth();
        let AtRest { stiffness, damping } = &self.at_rest;
        let at_rest = of([damping, stiffness])?;
        of([&self.damping, &self.stiffness]).map(|_| at_rest)
    }

    /// Degrees of freedom.
    #[must_use]
    pub(crate) fn dofs(&self) -> usize {
        self.mass.n()
    }

    /// ½ xᵀ K x in J, K the tangent stiffness of the structure and its specimens at rest.
    #[must_use]
    pub fn strain_energy(&self, disp: &[f64]) -> f64 {
        0.5 * self.whole.quadratic(disp)
    }

    /// Modes of the whole at rest, ascending, with the damping that delays of its specimens add.
    #[must_use]
    pub fn delayed_modes(&self) -> Vec<DelayedMode> {
        // A body that moves freely has no damping ratio.
        let each = self.shapes().into_iter();
        let each = each.filter(|(frequency, _)| *frequency > 0.0);
        each.map(|(frequency, shape)| DelayedMode {
            frequency,
            ratio: self.damping.quadratic(&shape) / (2.0 * frequency),
            per_second: self
                .specimens
                .iter()
                .map(|specimen| specimen.per_second(frequency, &shape))
                .collect(),
        })
        .collect()
    }

    /// The highest natural frequency at rest in rad/s; none if a massless degree of freedom leaves it without a bound.
    #[must_use]
    pub fn highest(&self) -> Option<f64> {
        linalg::highest_frequency(&self.at_rest.stiffness, &self.moved_mass())
    }
}
