//! A specimen whose axes have other units than SI. This adapter makes a law in SI answer a command in millimetres with
//! a force in kilonewtons, like the controller of a real rig.

use super::Specimen;
use gusset_numerics::law::Reach;

/// A specimen in SI units behind axes that do not count in SI.
#[derive(Debug)]
pub struct InUnits {
    specimen: Box<dyn Specimen>,
    /// Metres in one unit of displacement and newtons in one unit of force, per axis.
    units: Vec<(f64, f64)>,
    disp: Vec<f64>,
    vel: Vec<f64>,
    read: Vec<f64>,
}

gusset_quantity::state! { InUnits { specimen } keeps { units, disp, vel, read } }

impl InUnits {
    /// The specimen behind axes in these units: itself, where all count in SI. `units` holds, for each axis, metres per
    /// displacement unit and newtons per force unit; missing axes are in SI.
    #[must_use]
    pub fn around(specimen: Box<dyn Specimen>, units: &[(f64, f64)]) -> Box<dyn Specimen> {
        if units.iter().all(|unit| *unit == (1.0, 1.0)) {
            return specimen;
        }
        let n = specimen.axes();
        let mut units = units.to_vec();
        units.resize(n, (1.0, 1.0));
        Box::new(Self {
            specimen,
            units,
            disp: vec![0.0; n],
            vel: vec![0.0; n],
            read: vec![0.0; n],
        })
    }

    /// Brings an n × n matrix of force per motion, by columns, from SI into the axes' units.
    fn per_motion(&self, matrix: &mut [f64]) {
        let n = self.units.len().max(1);
        for (column, (metres, _)) in matrix.chunks_exact_mut(n).zip(&self.units) {
            for (entry, (_, newtons)) in column.iter_mut().zip(&self.units) {
                *entry *= metres / newtons;
            }
        }
    }
}

impl Specimen for InUnits {
    passed_on!(self => self.specimen);

    fn axes(&self) -> usize {
        self.specimen.axes()
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]) {
        let own = self.disp.iter_mut().zip(&mut self.vel);
        for (((own_disp, own_vel), (disp, vel)), (metres, _)) in
            own.zip(disp.iter().zip(vel)).zip(&self.units)
        {
            (*own_disp, *own_vel) = (metres * disp, metres * vel);
        }
        self.specimen.trial(&self.disp, &self.vel, dt, force);
        for (force, (_, newtons)) in force.iter_mut().zip(&self.units) {
            *force /= newtons;
        }
    }

    fn measured(&mut self, disp: &mut [f64]) {
        for ((to, from), (metres, _)) in self.read.iter_mut().zip(&*disp).zip(&self.units) {
            *to = metres * from;
        }
        self.specimen.measured(&mut self.read);
        let both = disp.iter_mut().zip(&self.read).zip(&self.units);
        for ((disp, read), (metres, _)) in both {
            // A specimen that follows exactly keeps the very bits of its command.
            if metres * *disp != *read {
                *disp = read / metres;
            }
        }
    }

    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        self.specimen.reference(stiffness, damping, mass);
        self.per_motion(stiffness);
        self.per_motion(damping);
        self.per_motion(mass);
    }

    fn tangent(&self, stiffness: &mut [f64]) {
        self.specimen.tangent(stiffness);
        self.per_motion(stiffness);
    }

    fn tangent_damping(&self, damping: &mut [f64]) {
        self.specimen.tangent_damping(damping);
        self.per_motion(damping);
    }

    fn rest_damping(&self, damping: &mut [f64]) {
        self.specimen.rest_damping(damping);
        self.per_motion(damping);
    }

    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        let metres = |value: Option<f64>, scale: f64| value.map(|value| value * scale);
        let in_si: Vec<Reach> = reach
            .iter()
            .zip(&self.units)
            .map(|(r, (m, _))| Reach {
                disp: metres(r.disp, *m),
                vel: metres(r.vel, *m),
            })
            .collect();
        self.specimen.bound(&in_si, stiffness, damping)?;
        self.per_motion(stiffness);
        self.per_motion(damping);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::specimen::SpecimenLaw;
    use gusset_numerics::law::{LawSpec, LinearSpec};

    #[test]
    fn units_do_not_change_a_spring() {
        let law = LawSpec::Linear(LinearSpec {
            stiffness_n_per_m: 8e6,
            damping_n_s_per_m: 0.0,
        });
        let spring = SpecimenLaw::Law(law).build(1).unwrap();
        let mut specimen = InUnits::around(spring, &[(1e-3, 1e3)]);
        let mut force = [0.0];
        specimen.trial(&[2.5], &[0.0], 0.0, &mut force);
        assert!((force[0] - 20.0).abs() < 1e-12, "8 kN/mm · 2.5 mm");
        let (mut k, mut c, mut m) = ([0.0], [0.0], [0.0]);
        specimen.reference(&mut k, &mut c, &mut m);
        assert!((k[0] - 8.0).abs() < 1e-12);
        specimen.tangent(&mut k);
        assert!((k[0] - 8.0).abs() < 1e-12);
    }
}
