//! Structures against hand-written matrices, rigid-body invariance and modal identities; descriptions against the kinds of their errors.

mod damping;
mod descriptions;
mod frame_damping;
mod matrices;
mod parse;
mod runs;

use gusset_quantity::assert_is;
use proptest::prelude::*;

use super::*;
use crate::law::Tangent;
use crate::linalg::{MatrixError, SymMatrix, modes};

/// f = k d + h d |d| + c v plus a plastic slider that remembers its set: enough memory to see commits.
#[derive(Debug, Clone, Default)]
struct Probe {
    k: f64,
    h: f64,
    c: f64,
    committed: f64,
    trial: f64,
    at: f64,
}

impl Law for Probe {
    fn trial(&mut self, disp: f64, vel: f64, dt: f64) -> f64 {
        self.trial = self.committed + dt;
        self.at = disp;
        self.k * disp + self.h * disp * disp.abs() + self.c * vel + self.committed
    }

    fn commit(&mut self) {
        self.committed = self.trial;
    }

    fn revert(&mut self) {
        self.trial = self.committed;
    }

    fn tangent(&self) -> Tangent {
        Tangent {
            stiffness: self.k + 2.0 * self.h * self.at.abs(),
            damping: self.c,
        }
    }

    fn reference(&self) -> Tangent {
        Tangent {
            stiffness: self.k,
            damping: self.c,
        }
    }

    fn bound(&self, reach: Reach) -> (Option<f64>, Option<f64>) {
        let stiffness = reach.disp.map(|d| self.k + 2.0 * self.h * d);
        (stiffness, Some(self.c))
    }
}

gusset_quantity::state! { Probe { committed } keeps { k, h, c, trial, at } }

fn element(from: End, to: End, k: f64, h: f64, c: f64) -> Element {
    Element {
        name: "probe".to_owned(),
        from,
        to,
        law: Box::new(Probe {
            k,
            h,
            c,
            ..Probe::default()
        }),
        reach: Reach::default(),
        hardening_ratio: None,
        damping_ratio: None,
    }
}

fn building(mass: &[f64], stiffness: &[f64], damping: Option<&[f64]>) -> StructureSpec {
    StructureSpec::ShearBuilding(ShearBuildingSpec {
        mass_kg: mass.to_vec(),
        stiffness_n_per_m: stiffness.to_vec(),
        damping_n_s_per_m: damping.map(<[f64]>::to_vec),
        p_delta: None,
    })
}

fn build(spec: &StructureSpec) -> Result<Structure, BuildError> {
    spec.build(None, &[], None, &MatrixFiles::new())
}

fn with_elements(elements: Vec<Element>) -> Result<Structure, ModelError> {
    let mass = SymMatrix::diagonal(&[2.0, 3.0]);
    let stiffness = SymMatrix::from_triplets(2, [(0, 0, 30.0), (0, 1, -10.0), (1, 1, 10.0)]);
    Structure::new(mass, SymMatrix::zeros(2), stiffness, vec![1.0; 2], elements)
}

fn damped(spec: &StructureSpec, rule: DampingSpec) -> Result<Structure, BuildError> {
    spec.build(Some(&rule), &[], None, &MatrixFiles::new())
}
