//! A formula behind a server.

use super::{Rig, Visitor};
use crate::specimen::{Specimen, status};
use crate::substructure::{Command, Introduction, LinkFault, Measurement, Retirement};

/// A specimen that is computed.
pub struct Law {
    specimen: Box<dyn Specimen>,
    virgin: Vec<f64>,
    /// A test finds it as the last one left it.
    remembers: bool,
    disp: Vec<f64>,
    committed: Vec<f64>,
    still: Vec<f64>,
}

impl std::fmt::Debug for Law {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Law").finish_non_exhaustive()
    }
}

impl Law {
    /// A formula in its present committed state, which is that of every test, or of the first one if it `remembers`.
    #[must_use]
    pub fn new(specimen: Box<dyn Specimen>, remembers: bool) -> Self {
        let axes = specimen.axes();
        let mut virgin = Vec::new();
        specimen.freeze(&mut virgin);
        Self {
            virgin,
            remembers,
            disp: vec![0.0; axes],
            committed: vec![0.0; axes],
            still: vec![0.0; axes],
            specimen,
        }
    }

    /// Initial stiffness and mass, n × n by columns.
    #[must_use]
    pub fn reference(&self) -> (Vec<f64>, Vec<f64>) {
        let n = self.disp.len() * self.disp.len();
        let (mut stiffness, mut damping) = (vec![0.0; n], vec![0.0; n]);
        let mut mass = vec![0.0; n];
        self.specimen
            .reference(&mut stiffness, &mut damping, &mut mass);
        (stiffness, mass)
    }
}

impl Rig for Law {
    fn axes(&self) -> usize {
        self.disp.len()
    }

    fn connect(&mut self, _: &Visitor) -> Result<Introduction, String> {
        Ok(Introduction::default())
    }

    fn arm(&mut self, _: u64, _: &[f64]) -> Result<(), LinkFault> {
        if !self.remembers {
            self.specimen.thaw(&self.virgin);
            self.committed.fill(0.0);
        }
        self.specimen.revert();
        Ok(())
    }

    fn at_rest(&mut self, into: &mut Measurement) {
        self.specimen
            .trial(&self.committed, &self.still, 0.0, &mut into.force);
        into.disp.copy_from_slice(&self.committed);
        self.specimen.measured(&mut into.disp);
        self.specimen.revert();
    }

    fn trial(
        &mut self,
        command: &Command<'_>,
        elapsed: f64,
        into: &mut Measurement,
    ) -> Result<(), LinkFault> {
        for ((own, measured), disp) in self.disp.iter_mut().zip(&mut into.disp).zip(command.disp) {
            (*own, *measured) = (*disp, *disp);
        }
        self.specimen
            .trial(&self.disp, command.vel, elapsed, &mut into.force);
        self.specimen.measured(&mut into.disp);
        into.status = status(self.specimen.as_ref());
        Ok(())
    }

    fn commit(&mut self) -> Result<(), LinkFault> {
        self.specimen.commit();
        self.committed.copy_from_slice(&self.disp);
        Ok(())
    }

    fn revert(&mut self) {
        self.specimen.revert();
    }

    fn tangent(&mut self, stiffness: &mut [f64]) {
        self.specimen.tangent(stiffness);
    }

    fn end(&mut self, _: Retirement) {
        self.specimen.revert();
    }
}
