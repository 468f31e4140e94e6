//! Positions of rows on the clock. A run has up to three grids of ticks: for the wiring check, for the rest of the startup,
//! and for the test. Rows count from the first edge of their grid. Events of the kind `grid` give the time of that edge on
//! the loop's clock.

use super::stamps::Stamped;
use crate::{Event, EventLine, GridOf};
use gusset_quantity::catalog::phase::{Part, Phase};

/// Places row after row, from the first of the file on.
pub(crate) struct Grid {
    /// First edges, ns of the loop's clock.
    edges: [Option<u64>; 3],
    /// The edge that is zero: the first of the grid of the first row.
    zero_ns: Option<u64>,
    begun: bool,
    /// Without edges: position of the row before, the shortest time between two rows, and the shift of the rows.
    before: f64,
    shortest: f64,
    moved: f64,
}

impl Grid {
    pub(crate) fn of(told: &[EventLine]) -> Self {
        let edge = |of: GridOf| {
            let mut lines = told.iter().rev();
            lines.find_map(|line| match line.event {
                Event::Grid {
                    of: grid,
                    first_edge_ns,
                } if grid == of => Some(first_edge_ns),
                _ => None,
            })
        };
        Self {
            edges: [GridOf::Directions, GridOf::Opening, GridOf::Test].map(edge),
            zero_ns: None,
            begun: false,
            before: f64::NEG_INFINITY,
            shortest: f64::INFINITY,
            moved: 0.0,
        }
    }

    /// When zero was on the loop's clock, µs; none before the first row, and where the events do not say it.
    pub(crate) fn zero_us(&self) -> Option<f64> {
        self.zero_ns.map(|ns| ns as f64 / 1e3)
    }

    /// The row in µs from zero.
    pub(crate) fn place(&mut self, row: &Stamped) -> Stamped {
        let part = Part::of(row.state);
        self.begun |= part == Some(Part::Test) || row.state.is_nan();
        let [directions, opening, test] = self.edges;
        let edge = if row.state == Phase::Probing.code() {
            directions.or(opening)
        } else if part == Some(Part::Test)
            || (self.begun && matches!(part, Some(Part::Trip | Part::Shutdown)))
        {
            test
        } else if self.begun {
            test.or(opening)
        } else {
            opening
        };
        if let Some(edge) = edge {
            let zero = *self.zero_ns.get_or_insert(edge);
            let ns = edge as f64 - zero as f64;
            return row.later(ns / 1e3);
        }
        // Records of earlier versions: a grid that restarts follows directly behind the one before.
        let at = row.release + self.moved;
        if at < self.before && row.is_stamped() && row.release == 0.0 {
            let way = if self.shortest.is_finite() {
                self.shortest
            } else {
                0.0
            };
            self.moved = self.before + way - row.release;
        }
        let placed = row.later(self.moved);
        if placed.release > self.before {
            self.shortest = self.shortest.min(placed.release - self.before);
        }
        if placed.release.is_finite() {
            self.before = self.before.max(placed.release);
        }
        placed
    }
}
