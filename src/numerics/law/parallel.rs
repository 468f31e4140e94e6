//! Several laws side by side: same displacement and velocity, forces added in the order of the list.

use super::{Law, LawError, Reach, Tangent};
use gusset_quantity::state;

/// A sum of laws, e.g. a bilinear isolator and a viscous damper.
#[derive(Debug)]
pub struct Parallel {
    parts: Vec<Box<dyn Law>>,
}

state! { Parallel as "parallel" { parts } }

impl Parallel {
    /// The sum of `parts`.
    ///
    /// # Errors
    /// No parts.
    pub(crate) fn new(parts: Vec<Box<dyn Law>>) -> Result<Self, LawError> {
        if parts.is_empty() {
            return Err(LawError::Size {
                name: "parallel",
                what: "entries",
                found: 0,
                wanted: 1,
            });
        }
        Ok(Self { parts })
    }

    fn sum(&self, of: impl Fn(&dyn Law) -> Tangent) -> Tangent {
        let mut total = Tangent::default();
        for part in &self.parts {
            let tangent = of(part.as_ref());
            total.stiffness += tangent.stiffness;
            total.damping += tangent.damping;
        }
        total
    }
}

impl Law for Parallel {
    fn trial(&mut self, disp: f64, vel: f64, dt: f64) -> f64 {
        let mut force = 0.0;
        for part in &mut self.parts {
            force += part.trial(disp, vel, dt);
        }
        force
    }

    fn commit(&mut self) {
        for part in &mut self.parts {
            part.commit();
        }
    }

    fn revert(&mut self) {
        for part in &mut self.parts {
            part.revert();
        }
    }

    fn tangent(&self) -> Tangent {
        self.sum(|part| part.tangent())
    }

    fn solver_tangent(&self) -> Tangent {
        self.sum(|part| part.solver_tangent())
    }

    fn reference(&self) -> Tangent {
        self.sum(|part| part.reference())
    }

    fn rest_damping(&self) -> f64 {
        self.parts.iter().map(|part| part.rest_damping()).sum()
    }

    fn least_damping(&self) -> f64 {
        self.parts.iter().map(|part| part.least_damping()).sum()
    }

    fn bound(&self, reach: Reach) -> (Option<f64>, Option<f64>) {
        let mut total = (Some(0.0), Some(0.0));
        for part in &self.parts {
            let (stiffness, damping) = part.bound(reach);
            total.0 = total.0.zip(stiffness).map(|(sum, one)| sum + one);
            total.1 = total.1.zip(damping).map(|(sum, one)| sum + one);
        }
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::LawSpec;

    #[test]
    fn parallel_laws_are_their_sum() {
        let text = "parallel = [ \
            { bilinear = { stiffness_n_per_m = 1e6, yield_force_n = 800.0, post_yield_ratio = 0.1 } }, \
            { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 2e4 } }, \
            { bilinear = { post_yield_ratio = 0, stiffness_n_per_m = 2e6, yield_force_n = 300.0 } } ]";
        let spec: LawSpec = toml::from_str(text).unwrap();
        let LawSpec::Parallel(parts) = &spec else {
            panic!("{spec:?}");
        };
        let mut parts = LawSpec::build_all("parallel", parts).unwrap();
        let mut whole = spec.build().unwrap();
        for i in 0..200 {
            let t = f64::from(i) * 0.1;
            let (disp, vel) = (3e-3 * libm::sin(t), 0.3 * libm::cos(t));
            let mut force = 0.0;
            for part in &mut parts {
                force += part.trial(disp, vel, 0.01);
                part.commit();
            }
            assert_eq!(whole.trial(disp, vel, 0.01).to_bits(), force.to_bits());
            whole.commit();
        }
        let total = Tangent {
            stiffness: 3e6,
            damping: 2e4,
        };
        assert_eq!(whole.reference(), total);
        assert_eq!(whole.bound(Reach::default()), (Some(3e6), Some(2e4)));
    }
}
