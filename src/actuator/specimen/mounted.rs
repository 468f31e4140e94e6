//! A specimen that is not at the zero of its axes, and whose load cells do not read zero at rest: f(d − d₀) + f₀.

use super::Specimen;
use gusset_numerics::law::Reach;

/// A specimen whose deformation is zero at an offset of its axes. Everything in SI.
#[derive(Debug)]
pub struct Mounted {
    specimen: Box<dyn Specimen>,
    /// For each axis: its place in m, and its reading there in N.
    offsets: Vec<(f64, f64)>,
    disp: Vec<f64>,
    read: Vec<f64>,
}

gusset_quantity::state! { Mounted { specimen } keeps { offsets, disp, read } }

impl Mounted {
    /// `offsets` holds, for each axis, its position in m and its reading in N at a deformation of zero. Returns the specimen
    /// itself if all are zero.
    #[must_use]
    pub fn around(specimen: Box<dyn Specimen>, offsets: &[(f64, f64)]) -> Box<dyn Specimen> {
        if offsets.iter().all(|offset| *offset == (0.0, 0.0)) {
            return specimen;
        }
        let n = specimen.axes();
        let mut offsets = offsets.to_vec();
        offsets.resize(n, (0.0, 0.0));
        Box::new(Self {
            specimen,
            offsets,
            disp: vec![0.0; n],
            read: vec![0.0; n],
        })
    }
}

impl Specimen for Mounted {
    passed_on!(self => self.specimen);

    fn axes(&self) -> usize {
        self.specimen.axes()
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]) {
        let told = self.disp.iter_mut().zip(disp).zip(&self.offsets);
        for ((to, disp), (stands, _)) in told {
            *to = disp - stands;
        }
        self.specimen.trial(&self.disp, vel, dt, force);
        for (force, (_, reads)) in force.iter_mut().zip(&self.offsets) {
            *force += reads;
        }
    }

    fn measured(&mut self, disp: &mut [f64]) {
        let told = self.read.iter_mut().zip(&*disp).zip(&self.offsets);
        for ((to, disp), (stands, _)) in told {
            *to = disp - stands;
        }
        self.specimen.measured(&mut self.read);
        let both = disp.iter_mut().zip(&self.read).zip(&self.offsets);
        for ((disp, read), (stands, _)) in both {
            // A specimen that follows exactly keeps the very bits of its command.
            if *disp - stands != *read {
                *disp = read + stands;
            }
        }
    }

    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        self.specimen.reference(stiffness, damping, mass);
    }

    fn tangent(&self, stiffness: &mut [f64]) {
        self.specimen.tangent(stiffness);
    }

    fn tangent_damping(&self, damping: &mut [f64]) {
        self.specimen.tangent_damping(damping);
    }

    fn rest_damping(&self, damping: &mut [f64]) {
        self.specimen.rest_damping(damping);
    }

    /// `reach` is that of the deformation, wherever it begins.
    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        self.specimen.bound(reach, stiffness, damping)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::SpecimenLaw;
    use gusset_numerics::law::LawSpec;

    fn plastic() -> Box<dyn Specimen> {
        let text =
            "bilinear = { post_yield_ratio = 0, stiffness_n_per_m = 1e5, yield_force_n = 300.0 }";
        let law: LawSpec = toml::from_str(text).unwrap();
        SpecimenLaw::Law(law).build(1).unwrap()
    }

    #[test]
    fn offset_does_not_change_the_specimen() {
        let (mut plain, mut off) = (plastic(), Mounted::around(plastic(), &[(0.25, 40.0)]));
        let (mut expected, mut force) = ([0.0], [0.0]);
        for k in 0..60 {
            // Exact in binary, so that nothing is lost in the conversion.
            let disp = f64::from((7 * k) % 32 - 16) / 1024.0;
            plain.trial(&[disp], &[0.0], 0.01, &mut expected);
            off.trial(&[disp + 0.25], &[0.0], 0.01, &mut force);
            assert!((force[0] - 40.0 - expected[0]).abs() < 1e-12, "{k}");
            let mut read = [disp + 0.25];
            off.measured(&mut read);
            assert_eq!(read, [disp + 0.25]);
            plain.commit();
            off.commit();
        }
        assert!(expected[0].abs() > 0.0);
    }
}
