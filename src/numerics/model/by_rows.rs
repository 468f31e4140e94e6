//! Elements that are kept one by one, for a residual that is made some rows at a time.
//!
//! An element is evaluated with the first of its rows, and its force waits for the others. The invariant: forces enter a
//! row in the order of the elements, so that the bits are those of all elements one after the other.

use std::ops::Range;

use super::Motion;
use super::element::{Connection, at};
use super::strip::Strip;
use crate::linalg::Lanes;

/// The order in which the elements of one group are wanted, and how far a step has come.
#[derive(Debug, Default)]
pub(super) struct ByRows {
    /// Elements by their first row.
    evaluated: Vec<(u32, u32)>,
    /// Row of every force that enters one, twice its element, and one more where the element begins there; by rows.
    entered: Vec<(u32, u32)>,
    /// Force of each element in this step.
    forces: Vec<f64>,
    next_evaluated: usize,
    next_entered: usize,
    /// All of them together, if they are alike; then nothing above is used.
    strip: Option<Box<Strip>>,
}

impl ByRows {
    /// Elements that make a strip.
    pub(super) fn alike(strip: Strip) -> Self {
        Self {
            strip: Some(Box::new(strip)),
            ..Self::default()
        }
    }

    /// Brings the laws up to date. `change`: they may be changed after that. Real-time: yes.
    pub(super) fn store(&mut self, connections: &mut [Connection], change: bool) {
        if let Some(strip) = &mut self.strip {
            strip.store(connections, change);
        }
    }

    /// The ends of `connections` that are degrees of freedom of a structure of `n`.
    pub(super) fn new(connections: &[Connection], n: usize) -> Self {
        let (mut evaluated, mut entered) = (Vec::new(), Vec::new());
        for (element, connection) in connections.iter().enumerate() {
            let element = element as u32;
            let ends = [(connection.to, 0), (connection.from, 1)];
            let rows = ends.into_iter().filter(|(row, _)| (*row as usize) < n);
            let first = rows.clone().map(|(row, _)| row).min();
            evaluated.extend(first.map(|row| (row, element)));
            entered.extend(rows.map(|(row, begins)| (row, 2 * element + begins)));
        }
        evaluated.sort_by_key(|&(row, _)| row);
        entered.sort_by_key(|&(row, _)| row);
        Self {
            forces: vec![0.0; connections.len()],
            evaluated,
            entered,
            next_evaluated: 0,
            next_entered: 0,
            strip: None,
        }
    }

    /// residual ← residual − force, these rows of it, which begin at 0 or where the last ones ended; each element commits
    /// when it is evaluated. Real-time: yes.
    pub(super) fn subtract(
        &mut self,
        connections: &mut [Connection],
        rows: Range<usize>,
        motion: Motion<'_>,
        residual: &mut [f64],
        lanes: Lanes,
    ) {
        if let Some(strip) = &mut self.strip {
            return strip.subtract(connections, rows, motion, residual, lanes);
        }
        let Motion {
            disp,
            vel,
            base,
            dt,
        } = motion;
        if rows.start == 0 {
            (self.next_evaluated, self.next_entered) = (0, 0);
        }
        let left = self.evaluated.get(self.next_evaluated..);
        for &(row, element) in left.unwrap_or_default() {
            if row as usize >= rows.end {
                break;
            }
            self.next_evaluated += 1;
            let place = self.forces.get_mut(element as usize);
            if let (Some(connection), Some(force)) = (connections.get_mut(element as usize), place)
            {
                let Connection { law, from, to } = connection;
                let deformation = at(*to, disp, base.disp) - at(*from, disp, base.disp);
                let rate = at(*to, vel, base.vel) - at(*from, vel, base.vel);
                *force = law.step(deformation, rate, dt);
            } else {
                self.forces.fill(f64::NAN);
            }
        }
        let left = self.entered.get(self.next_entered..);
        for &(row, end) in left.unwrap_or_default() {
            if row as usize >= rows.end {
                break;
            }
            self.next_entered += 1;
            let force = self.forces.get(end as usize / 2);
            if let (Some(r), Some(force)) = (residual.get_mut(row as usize), force) {
                *r += if end % 2 == 0 { -force } else { *force };
            } else {
                residual.fill(f64::NAN);
            }
        }
    }
}
