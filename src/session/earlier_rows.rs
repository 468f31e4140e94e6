//! Rows of recordings that earlier versions made, in the terms of the rows of today.
//!
//! Recordings of versions up to 0.2.0 have no column `operator`. The commands of the operator follow from `hold`, from `state` and
//! from the row before. Nothing else in the program knows such rows.

use gusset_control::engine::OperatorCommands;
use gusset_quantity::catalog::column::{CAUSE, JUDGED, Kind, OPERATOR};
use gusset_quantity::catalog::phase::{GIVEN_UP, NOT_AWAITED, Part, Phase};
use gusset_record::{Column, Layout};

/// Physical columns that recordings of earlier versions do not have.
const NEWER: [&Kind; 3] = [&OPERATOR, &CAUSE, &JUDGED];

/// Whether a recording of an earlier version may lack this column.
pub(super) fn may_be_absent(column: &Column) -> bool {
    column.timing || NEWER.iter().any(|kind| kind.fits(&column.name))
}

/// State of the reading of a recording without the column `operator`.
pub(super) struct EarlierRows {
    /// Places of `state` and `hold`.
    state: usize,
    hold: usize,
    /// Steps of the test.
    steps: u64,
    /// Whether the operator requested a hold in the row before.
    holding: bool,
}

impl EarlierRows {
    /// For a recording with this layout; none if it has the column.
    pub(crate) fn of(layout: &Layout, steps: u64) -> Option<Self> {
        let place = |name: &str| layout.index_of(name).unwrap_or(usize::MAX);
        let is_earlier = layout.index_of("operator").is_none();
        is_earlier.then(|| Self {
            state: place("state"),
            hold: place("hold"),
            steps,
            holding: false,
        })
    }

    /// Value that the column `operator` of the next row would have. `before`: state and step of the row before it.
    pub(crate) fn commands(&mut self, before: Option<(f64, f64)>, row: &[f64]) -> OperatorCommands {
        let at = |place: usize| row.get(place).copied().unwrap_or(f64::NAN);
        let (state, hold) = (at(self.state), at(self.hold));
        let stop_if = |is_stop: bool| {
            if is_stop {
                OperatorCommands::STOP
            } else {
                OperatorCommands::default()
            }
        };
        if state == GIVEN_UP {
            return OperatorCommands::GIVE_UP;
        }
        let leaving = Phase::Leaving.code();
        if state == leaving {
            return stop_if(before.is_some_and(|(before, step)| {
                let is_complete = before == Phase::Running.code() && step >= self.steps as f64;
                !is_complete && before != leaving && !Part::Trip.has(before)
            }));
        }
        if hold < 0.0 {
            // The first tick of the shutdown tripped.
            let was_leaving =
                before.is_some_and(|(before, _)| before == leaving || before == NOT_AWAITED);
            return stop_if(!was_leaving);
        }
        // 1 during a requested hold, plus 2 for `continue`, plus 4 for a confirmation.
        let mut commands = OperatorCommands::of(hold);
        let wanted = commands.has(OperatorCommands::HOLD);
        let continued = commands.has(OperatorCommands::CONTINUE);
        let was_wanted = std::mem::replace(&mut self.holding, wanted);
        if was_wanted && !continued {
            commands.remove(OperatorCommands::HOLD);
        }
        commands
    }
}
