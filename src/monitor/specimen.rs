//! One specimen, row by row: in which ticks it was commanded and has answered, and what its limits are held against then.
//!
//! The reckoning is the loop's own, [`Watch`], fed from the rows; it judges nothing here. A row without an answer changes nothing
//! of what was measured. Where rows were lost, differences begin anew.

use super::axis::{AxisTap, Told};
use super::board::SpecimenView;
use super::subject::WatchedSpecimen;
use super::tap::at;
use crate::catalog::phase::Part;
use crate::control::limits::Watch;
use crate::substructure::Status;

/// Where in the life of a test a row stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Course {
    /// Before its first tick.
    Opening,
    /// In it, held or not.
    Test,
    /// On the way out.
    Leaving,
    /// The last row of one of these.
    Cut,
}

impl Course {
    /// By the column `state`.
    pub fn of(state: f64) -> Self {
        match Part::of(state) {
            Some(Part::Trip) => Self::Cut,
            Some(Part::Test) => Self::Test,
            Some(Part::Shutdown) => Self::Leaving,
            Some(Part::Startup) | None => Self::Opening,
        }
    }
}

/// What belongs to all specimens of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowHead {
    /// Number of the row, with the lost ones.
    pub sequence: u64,
    /// The column `step`.
    pub step: f64,
    /// The column `state`.
    pub state: f64,
}

/// Past of a specimen.
#[derive(Debug)]
pub(super) struct SpecimenTap {
    pub axes: Vec<AxisTap>,
    pub view: SpecimenView,
    watch: Watch,
    /// Number of the last row.
    sequence: Option<u64>,
    /// The column `seq` of the last row.
    newest: f64,
    in_test: bool,
    /// Of one that is commanded once a step: its answer is not here.
    owes: bool,
    /// Displacement, force, and displacement that is held against the command, of every axis, SI.
    values: Vec<(f64, f64, f64)>,
}

impl SpecimenTap {
    pub fn new(specimen: &WatchedSpecimen) -> Self {
        Self {
            axes: specimen.axes.iter().map(AxisTap::new).collect(),
            view: SpecimenView::default(),
            watch: specimen.watch(),
            sequence: None,
            newest: f64::NAN,
            in_test: false,
            owes: false,
            values: Vec::with_capacity(specimen.axes.len()),
        }
    }

    pub fn row(&mut self, head: RowHead, row: &[f64], specimen: &WatchedSpecimen) {
        let course = Course::of(head.state);
        let in_test = match course {
            Course::Test => true,
            Course::Cut => self.in_test,
            Course::Opening | Course::Leaving => false,
        };
        let begins = in_test && !self.in_test;
        let next = self.sequence.map(|last| last + 1);
        let follows = next == Some(head.sequence);
        let by_steps = in_test && specimen.per_step;
        // A test that is gone on with judges the first command of such a one by the last of the interrupted test.
        if !follows || (begins && by_steps && head.step > 0.0) {
            self.watch = specimen.watch();
            self.owes = false;
        }
        if begins {
            self.watch.forget_measurements();
        }
        let was_heard = is_heard(Status(self.view.status));
        let status = at(row, specimen.status);
        // Flags below 2²⁴ are whole numbers in every float.
        let status = Status(if status >= 0.0 { status as u32 } else { 0 });
        let is_stale = status.has(Status::STALE);
        let newest = at(row, specimen.newest);
        let is_silent = is_stale || !is_heard(status);
        // One that is commanded once a step gives each command one answer; the first of the test cannot be told from that before.
        let answers = follows && !begins && newest != self.newest && !is_silent;
        let is_fresh = !is_silent && (!by_steps || answers);
        let moves = self.axes.iter().zip(&specimen.axes);
        let moves = moves.fold(false, |moves, (tap, axis)| moves || tap.moves(row, axis));
        let starts = begins && head.step == 0.0;
        let is_told = was_heard
            && !status.has(Status::UNSENT)
            && (!by_steps || starts || moves || (answers && !self.owes));
        (self.sequence, self.newest, self.in_test) = (Some(head.sequence), newest, in_test);
        self.owes = by_steps && (self.owes || is_told) && !answers && !is_stale;
        self.view.status = status.0;
        self.view.exchanges += u64::from(is_told);
        self.view.stale += u64::from(is_told && is_stale);

        for (tap, axis) in self.axes.iter_mut().zip(&specimen.axes) {
            tap.begin(row, axis, head.state, course);
        }
        self.watch.tick_is(specimen.ticks[usize::from(by_steps)]);
        if is_told {
            for (index, tap) in self.axes.iter_mut().enumerate() {
                tap.asked = self.watch.asked(index, tap.now.command).or(tap.asked);
            }
            self.watch.sent(self.axes.iter().map(|tap| tap.now.command));
        }
        if is_fresh {
            self.values.clear();
            let axes = self.axes.iter().zip(&specimen.axes);
            self.values
                .extend(axes.map(|(tap, axis)| tap.measured(row, axis)));
            let axes = &mut self.axes;
            self.watch.seen(self.values.iter().copied(), |index, seen| {
                if let Some(tap) = axes.get_mut(index) {
                    tap.seen = Some(seen);
                }
            });
        }
        let told = Told {
            is_told,
            is_fresh,
            is_silent,
        };
        let values = self.values.iter().copied().map(Some);
        let values = values.chain(std::iter::repeat(None));
        for ((tap, axis), values) in self.axes.iter_mut().zip(&specimen.axes).zip(values) {
            tap.row(row, axis, told, values.filter(|_| is_fresh));
        }
    }
}

/// False of a specimen that is lost, or whose answer is not waited for: it is told nothing.
const fn is_heard(status: Status) -> bool {
    !status.has(Status::LOST) && !status.has(Status::OWED)
}
