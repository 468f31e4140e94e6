//! Models of any size, each with nonlinear elements everywhere, as a loop runs them.

use std::f64::consts::TAU;

use thiserror::Error;

use crate::verify::chain_of_example_4_3;
use gusset_control::engine::{Numerical, Side};
use gusset_motion::{Excitation, LoadTerm, MotionError};
use gusset_numerics::frame::{
    Direction, FrameSpec, IShapeSpec, MaterialSpec, MemberKind, MemberSpec, MenegottoPintoSpec,
    NodeSpec, SectionSpec,
};
use gusset_numerics::integrate::{
    Explicit, Gui, GuiError, Integrator, Lambda, Massless, MasslessBounds, Start, State, Stepper,
};
use gusset_numerics::linalg::NotPositiveDefinite;
use gusset_numerics::model::{
    self, Acceleration, BuildError, DampingSpec, MatrixFiles, RayleighSpec, StiffnessPart,
    Structure, StructureSpec,
};

/// A model that comes in any size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalable {
    /// Example 4.3 of Gui et al. 2014: masses in a row on a moving base, a nonlinear damper at every mass.
    Chain,
    /// A rectangular plane frame of yielding members, three degrees of freedom per joint, under ground motion: [`moment_frame`].
    Frame,
}

/// Why a model could not be made.
#[derive(Debug, Error)]
pub enum ModelError {
    /// The structure.
    #[error(transparent)]
    Structure(#[from] model::ModelError),
    /// A frame.
    #[error(transparent)]
    Frame(#[from] BuildError),
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
            Scalable::Frame => {
                "plane frame of force-based members, five sections of twenty fibres each"
            }
        }
    }

    /// [`Scalable::side`] for a [`moment_frame`] with this many columns and storeys.
    ///
    /// # Errors
    /// As [`Scalable::side`].
    pub fn moment_frame(
        columns: usize,
        storeys: usize,
        dt: f64,
        steps: usize,
    ) -> Result<Side, ModelError> {
        Scalable::Frame.side_of(frame(columns, storeys)?, dt, steps)
    }

    /// The numerical side of a test of `steps` steps of `dt` seconds on `n` degrees of freedom, λ = 4.
    ///
    /// # Errors
    /// [`ModelError`]; none for a size from [`Scalable::size_near`] and a positive step.
    pub fn side(self, n: usize, dt: f64, steps: usize) -> Result<Side, ModelError> {
        let structure = match self {
            Scalable::Chain => chain_of_example_4_3(n).ok_or(ModelError::Size(n))?,
            Scalable::Frame => {
                let (columns, storeys) = proportions(n);
                frame(columns, storeys)?
            }
        };
        self.side_of(structure, dt, steps)
    }

    fn side_of(self, structure: Structure, dt: f64, steps: usize) -> Result<Side, ModelError> {
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
        let bounds = MasslessBounds {
            stiffness: structure.bound_stiffness()?,
            damping: structure.bound_damping()?,
        };
        let massless = Massless::new(&structure, bounds, dt)?;
        let stepper = Stepper::Explicit(Explicit {
            integrator: gui,
            massless: massless.map(Box::new),
        });
        let acceleration = Acceleration::new(structure.mass())?;
        let state = State::at_rest(structure.dofs());
        let numerical = Numerical::new(structure, acceleration, excitation, stepper, state);
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

/// A rectangular moment frame of clamped columns and beams in steel: force-based members with five sections of twenty fibres. Joints
/// have mass along the floor and upwards, and none in rotation.
#[must_use]
pub fn moment_frame(columns: usize, storeys: usize) -> FrameSpec {
    let name = |column: usize, storey: usize| format!("{column}.{storey}");
    let each = (0..=storeys).flat_map(|storey| (0..columns).map(move |column| (column, storey)));
    let node = each.clone().map(|(column, storey)| NodeSpec {
        name: name(column, storey),
        at_m: vec![6.0 * column as f64, 3.5 * storey as f64],
        mass_kg: if storey > 0 { 10e3 } else { 0.0 },
        rotary_mass_kg_m2: 0.0,
        massless: Vec::new(),
        tilting_mass_kg_m2: [0.0; 2],
        fixed: match storey {
            0 => Direction::PLANE.to_vec(),
            _ => Vec::new(),
        },
    });
    let member = each
        .filter(|(_, storey)| *storey > 0)
        .flat_map(|(column, storey)| {
            let here = name(column, storey);
            let below = ("column", name(column, storey - 1));
            let beside = (column > 0).then(|| ("beam", name(column - 1, storey)));
            let ends = [Some(below), beside].into_iter().flatten();
            let ends: Vec<_> = ends
                .map(|(section, from)| (section, [from, here.clone()]))
                .collect();
            ends.into_iter().map(|(section, nodes)| MemberSpec {
                kind: MemberKind::ForceBased,
                ..MemberSpec::new(nodes, section)
            })
        });
    let shape = |depth_m, flange_width_m, flange_thickness_m, web_thickness_m| {
        SectionSpec::IShape(IShapeSpec {
            young_pa: None,
            material: Some("steel".into()),
            depth_m,
            flange_width_m,
            flange_thickness_m,
            web_thickness_m,
            layers: 20,
            layers_across: 8,
        })
    };
    let steel = MaterialSpec::MenegottoPinto(MenegottoPintoSpec::new(2e11, 355e6, 0.01));
    FrameSpec {
        node: node.collect(),
        material: [("steel".to_owned(), steel)].into(),
        section: [
            ("column".to_owned(), shape(0.4, 0.3, 0.024, 0.0135)),
            ("beam".to_owned(), shape(0.45, 0.19, 0.0146, 0.0094)),
        ]
        .into(),
        member: member.collect(),
        ..FrameSpec::default()
    }
}

fn frame(columns: usize, storeys: usize) -> Result<Structure, ModelError> {
    let spec = StructureSpec::Frame(moment_frame(columns, storeys));
    let damping = DampingSpec::Rayleigh(RayleighSpec {
        mass_coefficient_per_s: MASS_DAMPING,
        stiffness_coefficient_s: 0.0,
        stiffness_part: StiffnessPart::default(),
    });
    Ok(spec.build(Some(&damping), &[], None, &MatrixFiles::new())?)
}

/// Mass-proportional damping in 1/s.
const MASS_DAMPING: f64 = 0.3;

#[cfg(test)]
mod tests {
    use super::*;

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
