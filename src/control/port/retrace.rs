//! The motion of an identification, as far as it went, and its way back to where it began.
//!
//! One axis is displaced at a time, so that a straight way to the start has positions that were passed. It is never faster than the motion
//! was. Before it the specimen rests; a force beyond those that were passed ends it.

use super::passed::Passed;
use super::probe::WayBack;
use gusset_quantity::frame::AtAxis;
use gusset_quantity::substructure::Measurement;

/// Rest before the return, in s, and in ticks at least.
const REST_S: f64 = 0.1;
const REST_TICKS: u64 = 8;

/// Where the return is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    /// The motion runs.
    Forth,
    /// The specimen rests for this number of ticks.
    Rests(u64),
    Returns,
    Ended(WayBack),
}

/// The motion of one specimen, in its own units.
#[derive(Debug)]
pub(super) struct Retrace {
    /// Its first command.
    start: AtAxis<Vec<f64>>,
    /// Its last command, and the largest change from one to the next.
    last: AtAxis<Vec<f64>>,
    steps: Vec<f64>,
    forces: Vec<Passed>,
    /// Five standard deviations of each force.
    noise: Vec<f64>,
    stage: Stage,
}

impl Retrace {
    /// A motion that begins at `start`.
    pub(crate) fn new(start: AtAxis<&[f64]>, noise: Vec<f64>) -> Self {
        Self {
            start: AtAxis(start.to_vec()),
            last: AtAxis(start.to_vec()),
            steps: vec![0.0; start.len()],
            forces: vec![Passed::NOTHING; start.len()],
            noise,
            stage: Stage::Forth,
        }
    }

    /// The first command.
    pub(crate) fn start(&self) -> AtAxis<&[f64]> {
        self.start.part(Vec::as_slice)
    }

    /// Largest change of an axis from one command to the next.
    pub(crate) fn step(&self, axis: usize) -> f64 {
        self.steps.get(axis).copied().unwrap_or(0.0)
    }

    /// A command of the motion, and its measurement if that is a fresh one. Real-time: yes.
    pub(crate) fn pass(&mut self, sent: AtAxis<&[f64]>, measured: Option<&Measurement>) {
        let commands = self.last.iter_mut().zip(&mut self.steps).zip(*sent);
        for ((last, step), sent) in commands {
            *step = step.max((sent - *last).abs());
            *last = *sent;
        }
        self.take(measured);
    }

    fn take(&mut self, measured: Option<&Measurement>) {
        let forces = measured.into_iter().flat_map(|measured| &measured.force);
        for (passed, force) in self.forces.iter_mut().zip(forces) {
            passed.take(*force);
        }
    }

    /// The motion is over, and is retraced in ticks of `tick` s.
    pub(crate) fn turn_back(&mut self, tick: f64) {
        self.stage = Stage::Rests(((REST_S / tick).ceil() as u64).max(REST_TICKS));
    }

    /// True if the motion is retraced. Real-time: yes.
    pub(crate) fn goes_back(&self) -> bool {
        self.stage != Stage::Forth
    }

    /// One tick of the return, with the last measurement if that is a fresh one: whether the specimen moves, rests, or has ended it.
    /// Real-time: yes.
    pub(crate) fn go_on(&mut self, measured: Option<&Measurement>) -> Tick {
        match self.stage {
            Stage::Forth | Stage::Ended(_) => Tick::Ended,
            Stage::Rests(ticks) => {
                self.take(measured);
                self.stage = ticks.checked_sub(1).map_or(Stage::Returns, Stage::Rests);
                Tick::Rests
            }
            Stage::Returns => {
                let forces = measured.into_iter().flat_map(|measured| &measured.force);
                let mut axes = self.forces.iter().zip(&self.noise).zip(forces);
                let beyond = axes.position(|((passed, noise), force)| !passed.has(*force, *noise));
                match beyond {
                    Some(axis) => {
                        self.stage = Stage::Ended(WayBack::Force(axis));
                        Tick::Ended
                    }
                    None => Tick::Goes,
                }
            }
        }
    }

    /// The start is reached. Real-time: yes.
    pub(crate) const fn arrive(&mut self) {
        self.stage = Stage::Ended(WayBack::Complete);
    }

    /// How the return ended; none before it.
    pub(crate) fn ended(&self) -> Option<WayBack> {
        match self.stage {
            Stage::Forth => None,
            Stage::Ended(way) => Some(way),
            _ => Some(WayBack::Incomplete),
        }
    }
}

/// One tick of a way back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tick {
    Rests,
    Goes,
    Ended,
}
