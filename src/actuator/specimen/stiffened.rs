//! A specimen that is stiffer or softer than is declared of it: f(s·d) in place of f(d).

use super::Specimen;
use gusset_numerics::law::Reach;

/// A specimen with `factor` times the stiffness and damping of the law inside, at the same strength: it yields at the same
/// force. It declares the properties of the law inside, because no better ones are known.
#[derive(Debug)]
pub struct Stiffened {
    inner: Box<dyn Specimen>,
    factor: f64,
    disp: Vec<f64>,
    vel: Vec<f64>,
}

gusset_quantity::state! { Stiffened { inner } keeps { factor, disp, vel } }

impl Stiffened {
    /// `inner`, `factor` times as stiff.
    #[must_use]
    pub fn new(inner: Box<dyn Specimen>, factor: f64) -> Self {
        let n = inner.axes();
        Self {
            inner,
            factor,
            disp: vec![0.0; n],
            vel: vec![0.0; n],
        }
    }
}

impl Specimen for Stiffened {
    passed_on!(self => self.inner);

    fn axes(&self) -> usize {
        self.inner.axes()
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]) {
        for (to, from) in self.disp.iter_mut().zip(disp) {
            *to = self.factor * from;
        }
        for (to, from) in self.vel.iter_mut().zip(vel) {
            *to = self.factor * from;
        }
        self.inner.trial(&self.disp, &self.vel, dt, force);
    }

    fn measured(&mut self, disp: &mut [f64]) {
        self.inner.measured(disp);
    }

    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        self.inner.reference(stiffness, damping, mass);
    }

    fn tangent(&self, stiffness: &mut [f64]) {
        self.inner.tangent(stiffness);
        for entry in stiffness {
            *entry *= self.factor;
        }
    }

    fn rest_damping(&self, damping: &mut [f64]) {
        self.inner.rest_damping(damping);
    }

    fn tangent_damping(&self, damping: &mut [f64]) {
        self.inner.tangent_damping(damping);
        for entry in damping {
            *entry *= self.factor;
        }
    }

    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        self.inner.bound(reach, stiffness, damping)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::SpecimenLaw;

    #[test]
    fn stiffer_spring_yields_at_equal_force() {
        let law: SpecimenLaw = toml::from_str(
            "law.bilinear = { stiffness_n_per_m = 1e6, yield_force_n = 1e3, post_yield_ratio = 0.1 }",
        )
        .unwrap();
        let mut specimen = Stiffened::new(law.build(1).unwrap(), 2.0);
        let mut force_at = |disp: f64| {
            let mut force = [0.0];
            specimen.trial(&[disp], &[0.0], 0.0, &mut force);
            force[0]
        };
        // 2e6 N/m to 1 kN at 0.5 mm, then a tenth of it.
        assert!((force_at(2e-4) - 400.0).abs() < 1e-9);
        assert!((force_at(5e-4) - 1e3).abs() < 1e-9);
        assert!((force_at(1e-3) - 1100.0).abs() < 1e-9);
        let mut tangent = [0.0];
        specimen.tangent(&mut tangent);
        assert!((tangent[0] - 2e5).abs() < 1e-6);
        let (mut k, mut c, mut m) = ([0.0], [0.0], [0.0]);
        specimen.reference(&mut k, &mut c, &mut m);
        assert_eq!(k[0], 1e6);
    }
}
