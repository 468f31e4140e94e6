//! A spring of one axis that answers every command, at once or after some polls, and shows a test its commands.

use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use gusset_quantity::time::Nanos;

/// Coupling: lockstep.
pub struct Spring {
    stiffness: f64,
    /// Its position without a force.
    pub place: f64,
    /// Offsets of the displacement sensor and of the load cell.
    pub bias: [f64; 2],
    hears: Box<dyn FnMut(&Command<'_>) + Send>,
    is_there: Box<dyn FnMut(u32, usize) -> bool + Send>,
    disp: f64,
    sequence: u64,
    told: usize,
    looks: u32,
    held: Option<usize>,
}

impl Spring {
    /// `hears` receives every command when it is issued.
    pub fn new(stiffness: f64, hears: impl FnMut(&Command<'_>) + Send + 'static) -> Self {
        Self {
            stiffness,
            place: 0.0,
            bias: [0.0; 2],
            hears: Box::new(hears),
            is_there: Box::new(|_, _| true),
            disp: 0.0,
            sequence: 0,
            told: 0,
            looks: 0,
            held: None,
        }
    }

    /// It is held half-way to the command with this number, from 1.
    pub fn held_on_the_way(mut self, number: usize) -> Self {
        self.held = Some(number);
        self
    }

    /// `is_there` says at each poll, from 1 on after every command, whether the answer to the last command is there. Its second
    /// argument is the number of commands.
    pub fn answering(mut self, is_there: impl FnMut(u32, usize) -> bool + Send + 'static) -> Self {
        self.is_there = Box::new(is_there);
        self
    }
}

impl Substructure for Spring {
    fn axes(&self) -> usize {
        1
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        (self.disp, self.sequence) = (command.disp[0], command.sequence);
        (self.told, self.looks) = (self.told + 1, 0);
        (self.hears)(command);
        Ok(())
    }
    /// A caller that waits gets the answer.
    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        if wait_ns > 0 {
            return Ok(true);
        }
        self.looks = self.looks.saturating_add(1);
        Ok((self.is_there)(self.looks, self.told))
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.sequence = self.sequence;
        into.status = Status::default();
        if self.held == Some(self.told) {
            self.disp *= 0.5;
            into.status = Status::HOLDING;
        }
        into.disp[0] = self.disp + self.bias[0];
        into.force[0] = self.stiffness * (self.disp - self.place) + self.bias[1];
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}
