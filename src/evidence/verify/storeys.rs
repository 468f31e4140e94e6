//! The two-storey structures of examples 4.1 and 4.2.

use super::drive::{Method, histories};
use gusset_numerics::law::SquareRootSpec;
use gusset_numerics::linalg::SymMatrix;
use gusset_numerics::model::{Element, End, Structure};
use gusset_proof::StabilityProof;

/// Two storeys of the examples: masses and stiffnesses from the ground up, no damping.
#[derive(Debug, Clone, Copy)]
pub(super) struct TwoStoreys {
    pub(super) mass: [f64; 2],
    pub(super) stiffness: [f64; 2],
    /// θ of equation (42).
    pub(super) theta: [f64; 2],
}

impl TwoStoreys {
    /// Stiffness matrix of two storeys.
    pub(super) fn matrix([lower, upper]: [f64; 2]) -> SymMatrix {
        SymMatrix::from_triplets(2, [(0, 0, lower + upper), (0, 1, -upper), (1, 1, upper)])
    }

    /// The structure; storeys with θ = 0 are linear.
    pub(super) fn structure(&self) -> Option<Structure> {
        let mut elements = Vec::new();
        for (storey, from) in [(0, End::Ground), (1, End::Dof(0))] {
            let law = SquareRootSpec {
                stiffness_n_per_m: self.stiffness[storey],
                hardening_per_sqrt_m: self.theta[storey],
            };
            elements.push(Element {
                name: format!("storey {}", storey + 1),
                from,
                to: End::Dof(storey),
                law: Box::new(law.build().ok()?),
                reach: gusset_numerics::law::Reach::default(),
                hardening_ratio: None,
                damping_ratio: None,
            });
        }
        let mass = SymMatrix::diagonal(&self.mass);
        let none = SymMatrix::zeros(2);
        Structure::new(mass, none.clone(), none, vec![1.0; 2], elements).ok()
    }

    /// Tangent stiffness of both storeys at displacements x, equation (42).
    pub(super) fn tangents(&self, x: [f64; 2]) -> [f64; 2] {
        let drift = [x[0], x[1] - x[0]];
        [0, 1].map(|i| self.stiffness[i] * (1.0 + 1.5 * self.theta[i] * drift[i].abs().sqrt()))
    }

    /// The proof of stability with the tangent stiffnesses `tangents`.
    pub(super) fn proof(&self, tangents: [f64; 2], dt: f64) -> StabilityProof {
        StabilityProof {
            mass: SymMatrix::diagonal(&self.mass),
            damping: SymMatrix::zeros(2),
            stiffness: Self::matrix(self.stiffness),
            damping_bound: SymMatrix::zeros(2),
            stiffness_bound: Self::matrix(tangents),
            dt,
            late_mass: None,
            massless: Vec::new(),
        }
    }

    /// Both natural frequencies in rad/s for storeys of stiffness `k`: roots of the quadratic in ω².
    pub(super) fn frequencies(&self, k: [f64; 2]) -> [f64; 2] {
        let [m1, m2] = self.mass;
        let half = ((k[0] + k[1]) / m1 + k[1] / m2) / 2.0;
        let product = k[0] * k[1] / (m1 * m2);
        let far = half + (half * half - product).max(0.0).sqrt();
        [(product / far).max(0.0).sqrt(), far.max(0.0).sqrt()]
    }

    /// Displacements of both floors from rest under a_g = 20 sin t.
    pub(super) fn run(
        &self,
        method: Method,
        dt: f64,
        seconds: f64,
        every: usize,
    ) -> Option<[Vec<f64>; 2]> {
        let mut structure = self.structure()?;
        let stepper = method.stepper(&structure, dt).ok()?;
        let steps = libm::round(seconds / dt) as usize;
        let mass = self.mass;
        let load = move |t: f64, out: &mut [f64]| {
            let accel = 20.0 * libm::sin(t);
            for (f, m) in out.iter_mut().zip(mass) {
                *f = -m * accel;
            }
        };
        let found = histories(stepper, &mut structure, (dt, steps, every), load);
        <[Vec<f64>; 2]>::try_from(found).ok()
    }
}
