//! A rig for tests of a client that acts during the specimen's path to a target: it acts for the client when a command reaches
//! the specimen. So nothing depends on the time that passes.

use std::sync::{Arc, Mutex};

use crate::served::{Pacing, simulated_pace};
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;

/// Commands of a path of 4 s.
pub(super) const TICKS: u32 = 4000;

/// The path of each target. Time passes only where a paced command waits for it.
pub(super) const PACING: Pacing = Pacing {
    ticks: TICKS,
    settle_ticks: 0,
    period_ns: 1_000_000,
    clock: simulated_pace::CLOCK,
    predict: None,
};

type Act = Box<dyn FnOnce() + Send>;

/// A rig that follows its command at once. It notes displacements, and acts at one of them.
#[derive(Clone, Default)]
pub(super) struct Acting {
    pub told: Arc<Mutex<Vec<f64>>>,
    act: Arc<Mutex<Option<(usize, Act)>>>,
    sequence: u64,
}

impl Acting {
    /// Does `act` at the command with this number, from 1.
    pub(crate) fn acts(&self, at: usize, act: impl FnOnce() + Send + 'static) {
        *self.act.lock().unwrap() = Some((at, Box::new(act)));
    }
}

impl Substructure for Acting {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction {
            standing: vec![0.0],
            force: vec![0.0],
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.sequence = command.sequence;
        let mut told = self.told.lock().unwrap();
        told.push(command.disp[0]);
        let mut act = self.act.lock().unwrap();
        if act.as_ref().is_some_and(|(at, _)| *at == told.len()) {
            let (_, act) = act.take().unwrap();
            act();
        }
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let disp = *self.told.lock().unwrap().last().unwrap();
        into.sequence = self.sequence;
        (into.disp[0], into.force[0]) = (disp, 8000.0 * disp);
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}
