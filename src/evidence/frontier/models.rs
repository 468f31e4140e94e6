//! Models of any size, each with nonlinear elements everywhere, as a loop runs them.

use std::f64::consts::TAU;

use thiserror::Error;

use crate::verify::chain_of_example_4_3;
use gusset_control::engine::{Numerical, Side};
use gusset_motion::{Excitation, LoadTerm, MotionError};
use gusset_numerics::integrate::{Gui, GuiError, Integrator, Lambda, Start, State};
use gusset_numerics::law::{BilinearSpec, LawError, Reach};
use gusset_numerics::linalg::{NotPositiveDefinite, SymMatrix};
use gusset_numerics::model::{self, Acceleration, Element, End, Structure};

/// A model that comes in any size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalable {
    /// Example 4.3 of Gui et al. 2014: masses in a row on a moving base, a nonlinear damper at every mass.
    Chain,
    /// A rectangular plane frame of Euler–Bernoulli beams and columns, three degrees of freedom per joint, under ground
    /// motion, a yielding brace in every storey of every bay.
    Frame,
}

/// Why a model could not be made.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The structure.
    #[error(transparent)]
    Structure(#[from] model::ModelError),
    /// Its elements.
    #[error(transparent)]
    Law(#[from] LawError),
    /// The integrator.
    #[error(transparent)]
    Integrator(#[from] GuiError),
    /// The mass.
    #[error("the mass matrix is {0}")]
    Mass(#[from] NotPositiveDefinite),
    /// No such size.
    #[error("there is no model with {0} degrees of freedom")]
    Size(usize),
    /// The load.
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// λ of all models: the Chen–Ricles algorithm.
const LAMBDA: f64 = 4.0;
/// Amplitude of the base of the chain in m, its frequency is 1 Hz.
const BASE_M: f64 = 0.1;
/// Amplitude of the ground acceleration of the frame in m/s², at 1 Hz.
const GROUND_M_PER_S2: f64 = 3.0;

impl Scalable {
    /// The least size.
    #[must_use]
    pub const fn least(self) -> usize {
        match self {
            Scalable::Chain => 2,
            Scalable::Frame => 12,
        }
    }

    /// The nearest number of degrees of freedom that this model can have.
    #[must_use]
    pub fn size_near(self, n: usize) -> usize {
        match self {
            Scalable::Chain => n.max(self.least()),
            Scalable::Frame => {
                let (columns, storeys) = proportions(n);
                3 * columns * storeys
            }
        }
    }

    /// In words, as a picture says it.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Scalable::Chain => "chain with a nonlinear damper at every mass (example 4.3)",
            Scalable::Frame => "plane frame with a yielding brace in every panel",
        }
    }

    /// The numerical side of a test of `steps` steps of `dt` seconds on `n` degrees of freedom, λ = 4.
    ///
    /// # Errors
    /// [`ModelError`]; none for a size from [`Scalable::size_near`] and a positive step.
    pub fn side(self, n: usize, dt: f64, steps: usize) -> Result<Side, ModelError> {
        let structure = match self {
            Scalable::Chain => chain_of_example_4_3(n).ok_or(ModelError::Size(n))?,
            Scalable::Frame => frame(n)?,
        };
        let wave = |amplitude: f64, turn: f64| -> Vec<f64> {
            let at = |step| amplitude * libm::sin(TAU * step as f64 * dt + turn);
            (0..=steps).map(at).collect()
        };
        let excitation = Excitation::none(structure.dofs(), steps);
        let excitation = match self {
            Scalable::Chain => {
                excitation.with_base(wave(BASE_M, 0.0), wave(BASE_M * TAU, TAU / 4.0))?
            }
            Scalable::Frame => excitation.with_term(LoadTerm {
                pattern: structure.ground_load(),
                series: wave(GROUND_M_PER_S2, 0.0),
            })?,
        };
        let gui: Box<dyn Integrator> = Box::new(Gui::new(
            structure.mass(),
            &structure.reference_damping(),
            &structure.reference_stiffness(),
            dt,
            Lambda::Finite(LAMBDA),
            Start::Published,
        )?);
        let acceleration = Acceleration::new(structure.mass())?;
        let state = State::at_rest(structure.dofs());
        let numerical = Numerical::new(structure, acceleration, excitation, gui, state);
        Ok(Side::Structure(Box::new(numerical)))
    }
}

/// Columns and storeys of a frame of about `n` degrees of freedom that is about as wide as high.
fn proportions(n: usize) -> (usize, usize) {
    let joints = n as f64 / 3.0;
    let storeys = (joints.sqrt().round() as usize).max(2);
    let columns = ((joints / storeys as f64).round() as usize).max(2);
    (columns, storeys)
}

/// Axial stiffness E A in N, bending stiffness E I in N m² and length in m of every member; mass of a joint in kg, and of
/// its rotation per kg.
const AXIAL: f64 = 1.2e9;
const BENDING: f64 = 3.0e7;
const MEMBER: f64 = 3.5;
const JOINT_KG: f64 = 4.0e3;
const ROTATION_M2: f64 = 1e-2;
/// Mass-proportional damping in 1/s.
const MASS_DAMPING: f64 = 0.3;
/// The brace of a panel, along the floor: elastic stiffness, force at yield, ratio after it.
const BRACE: BilinearSpec = BilinearSpec {
    stiffness_n_per_m: 5.0e6,
    yield_force_n: 4.0e3,
    post_yield_ratio: 0.02,
};

fn frame(n: usize) -> Result<Structure, ModelError> {
    let (columns, storeys) = proportions(n);
    let (mass, stiffness) = plane_frame(columns, storeys);
    let damping = SymMatrix::diagonal(&vec![0.0; mass.n()]).plus(MASS_DAMPING, &mass);
    let influence = (0..mass.n()).map(|dof| if dof % 3 == 0 { 1.0 } else { 0.0 });
    let mut braces = Vec::with_capacity(columns * storeys);
    for storey in 1..=storeys {
        for bay in 1..columns {
            braces.push(Element {
                name: format!("brace {bay} of storey {storey}"),
                from: joint(columns, bay - 1, storey - 1).map_or(End::Ground, End::Dof),
                to: joint(columns, bay, storey).map_or(End::Ground, End::Dof),
                law: Box::new(BRACE.build()?),
                reach: Reach::default(),
                hardening_ratio: None,
                damping_ratio: None,
            });
        }
    }
    let influence = influence.collect();
    Ok(Structure::new(mass, damping, stiffness, influence, braces)?)
}

/// First degree of freedom (along the floor, upwards, rotation) of a joint; none of a foot.
fn joint(columns: usize, column: usize, storey: usize) -> Option<usize> {
    (storey > 0).then(|| 3 * ((storey - 1) * columns + column))
}

/// Lumped mass in kg and stiffness in N/m of a rectangular frame with clamped feet, `columns` wide and `storeys` high:
/// 3 columns · storeys degrees of freedom, storey by storey from below.
#[must_use]
fn plane_frame(columns: usize, storeys: usize) -> (SymMatrix, SymMatrix) {
    let n = 3 * columns * storeys;
    let masses: Vec<f64> = (0..n)
        .map(|dof| match dof % 3 {
            2 => ROTATION_M2 * JOINT_KG,
            _ => JOINT_KG,
        })
        .collect();
    let mut entries = Vec::with_capacity(2 * 21 * columns * storeys);
    for storey in 1..=storeys {
        for column in 0..columns {
            let here = joint(columns, column, storey);
            member(joint(columns, column, storey - 1), here, true, &mut entries);
            if column > 0 {
                member(
                    joint(columns, column - 1, storey),
                    here,
                    false,
                    &mut entries,
                );
            }
        }
    }
    (
        SymMatrix::diagonal(&masses),
        SymMatrix::from_triplets(n, entries),
    )
}

/// Adds the stiffness of one member between two joints.
fn member(
    a: Option<usize>,
    b: Option<usize>,
    upright: bool,
    entries: &mut Vec<(usize, usize, f64)>,
) {
    let length = MEMBER;
    let axial = AXIAL / length;
    let across = 12.0 * BENDING / (length * length * length);
    let lever = 6.0 * BENDING / (length * length);
    let (near, far) = (4.0 * BENDING / length, 2.0 * BENDING / length);
    // Along, across and rotation at a, then at b.
    let local = [
        [axial, 0.0, 0.0, -axial, 0.0, 0.0],
        [0.0, across, lever, 0.0, -across, lever],
        [0.0, lever, near, 0.0, -lever, far],
        [-axial, 0.0, 0.0, axial, 0.0, 0.0],
        [0.0, -across, -lever, 0.0, across, -lever],
        [0.0, lever, far, 0.0, -lever, near],
    ];
    // For an upright member, "along" points upwards and "across" against the floor's direction.
    let place = |k: usize| {
        let (end, axis) = (if k < 3 { a } else { b }, k % 3);
        let (axis, sign) = match (upright, axis) {
            (true, 0) => (1, 1.0),
            (true, 1) => (0, -1.0),
            _ => (axis, 1.0),
        };
        end.map(|end| (end + axis, sign))
    };
    for (i, row) in local.iter().enumerate() {
        for (j, value) in row.iter().enumerate().skip(i) {
            if let (Some((p, s)), Some((q, t))) = (place(i), place(j))
                && *value != 0.0
            {
                entries.push((p, q, s * t * value));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_is_as_stiff_as_columns_and_beam() {
        // Two columns, one storey, beam much stiffer than nothing: the sway stiffness of a portal with clamped feet
        // and equal members is 2 · 12 EI/L³ · (1 + 6 k)/(4 + 6 k) with k = I_b/I_c · h/L = 1: 24 EI/L³ · 7/10. Axial
        // flexibility of the members takes a little of it away.
        let (_, stiffness) = plane_frame(2, 1);
        let mut force = vec![1.0, 0.0, 0.0, 1.0, 0.0, 0.0];
        let mut factor = gusset_numerics::linalg::Spd::factor(&stiffness).unwrap();
        factor.solve_in_place(&mut force);
        let sway = 2.0 / ((force[0] + force[3]) / 2.0);
        let closed_form = 24.0 * BENDING / MEMBER.powi(3) * 0.7;
        // Columns in tension and compression let the frame lean: 3 I/(A L²) of the stiffness, some 1.8 %.
        assert!(
            (sway / closed_form - 1.0).abs() < 0.02,
            "{sway} {closed_form}"
        );
        assert!(sway < closed_form);
    }

    #[test]
    fn sizes_are_those_of_the_models() {
        for kind in [Scalable::Chain, Scalable::Frame] {
            for n in [1, 50, 999, 10_000] {
                let size = kind.size_near(n);
                assert_eq!(kind.size_near(size), size, "{kind:?} {n}");
                assert!(n < 100 || (size as f64 / n as f64 - 1.0).abs() < 0.1);
            }
            let Ok(Side::Structure(side)) = kind.side(kind.size_near(300), 1e-3, 4) else {
                panic!("{kind:?}");
            };
            assert_eq!(side.structure.dofs(), kind.size_near(300));
        }
    }

    #[test]
    fn moving_base_moves_every_model() {
        for kind in [Scalable::Chain, Scalable::Frame] {
            let n = kind.size_near(kind.least());
            let dt = 1e-3;
            let Ok(Side::Structure(mut side)) = kind.side(n, dt, 200) else {
                panic!("{kind:?}");
            };
            for step in 0..200 {
                side.close(step, dt, &mut []);
                side.advance(step).unwrap();
            }
            assert!(side.state.disp[0].abs() > 1e-6, "{kind:?}");
            assert!(side.state.disp.iter().all(|x| x.abs() < 1.0));
        }
    }
}
