//! The results of a test beside its rows and events.

use super::{EndPosition, Ending, Gaps, IncompleteShutdown, Peaks};
use crate::port::LinkCount;
use gusset_quantity::substructure::Holder;
use gusset_record::rt::timing::Timing;

/// The results of a test beside its rows and events.
#[derive(Debug)]
pub struct Outcome {
    /// How it ended.
    pub ending: Ending,
    /// The stop of the shutdown, if it did not complete.
    pub unfinished: Option<IncompleteShutdown>,
    /// Where each specimen was left.
    pub left: Vec<EndPosition>,
    /// The last command to each specimen, in its own unit; empty if no command has left.
    pub last_commands: Vec<Vec<f64>>,
    /// The reason of the user for a difference that the wiring check found, if it found one.
    pub accepted_wiring: Option<String>,
    /// Specimens, from 0, that owe an answer to the last message.
    pub unheard: Vec<usize>,
    /// Specimens, from 0, whose own ends were getting them ready when the operator ended the test.
    pub unarmed: Vec<usize>,
    /// Who holds each specimen if commands stay away.
    pub holders: Vec<Holder>,
    /// Last step whose row was made.
    pub steps: u64,
    /// Peaks over all DOFs.
    pub peaks: Peaks,
    /// Name of each member of a frame that can yield, with its largest use so far at both ends in parts of what makes it yield.
    pub demands: Vec<(String, [f64; 2])>,
    /// Name of each corotational member that went beyond its declared tension or rotation, with its largest ones in N and rad.
    pub beyond_declared: Vec<(String, [f64; 2])>,
    /// Peaks and counts of each specimen: name, largest |force| per axis of answers that came in time, exchanges.
    pub ports: Vec<(String, Vec<f64>, LinkCount)>,
    /// Largest |force| of each specimen before the test, one per axis.
    pub forces_on_the_way_in: Vec<Vec<f64>>,
    /// How the loop kept its ticks.
    pub pace: PaceOutcome,
    /// Rows that found the queue full.
    pub rows_lost: u64,
    /// Events that found the queue full.
    pub events_lost: u64,
    /// Reports of the links about their faults: specimen (from 0) and text.
    pub complaints: Vec<(usize, String)>,
    /// Reports of the specimens after the last message: specimen (from 0) and text.
    pub last_words: Vec<(usize, String)>,
}

/// How the loop kept its ticks.
#[derive(Debug)]
pub struct PaceOutcome {
    /// Histograms of every timing quantity.
    pub timing: Timing,
    /// Deadline misses.
    pub misses: u64,
    /// Whole ticks by which the grid was moved.
    pub stretched: u64,
    /// Where no command left, outside of the ticks of the test.
    pub gaps: Gaps,
    /// From the first edge of the test to the end of its last tick.
    pub wall_ns: u64,
}
