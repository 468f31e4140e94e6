//! Vectors of N doubles: their layout, and zeros behind the data.
//!
//! Real programs leave stale values behind the data; ours are zero. Doubles that a message does not define are
//! never read.

use super::action::Action;
use super::sizes::Counts;
use crate::WireError;
use crate::bytes::{finite_words, get_f64, put, put_doubles, same_length, words};

/// Signals of a command or an answer. Slices for kinds that the layout does not have are ignored.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Response<'a> {
    /// Displacements.
    pub disp: &'a [f64],
    /// Velocities.
    pub vel: &'a [f64],
    /// Accelerations.
    pub accel: &'a [f64],
    /// Forces.
    pub force: &'a [f64],
    /// Time in s.
    pub time: f64,
}

impl<'a> Response<'a> {
    /// Splits signals in one row, in the order of the wire; missing ones are empty. Real-time: yes.
    #[must_use]
    pub fn split(counts: &Counts, values: &'a [f64]) -> Self {
        let (disp, rest) = cut(values, counts.disp);
        let (vel, rest) = cut(rest, counts.vel);
        let (accel, rest) = cut(rest, counts.accel);
        let (force, time) = cut(rest, counts.force);
        Self {
            disp,
            vel,
            accel,
            force,
            time: time.first().copied().unwrap_or(0.0),
        }
    }

    /// Puts the signals that `counts` wants into one row, in the order of the wire. Real-time: yes.
    pub fn gather(&self, counts: &Counts, row: &mut [f64]) {
        let time = [self.time];
        let wanted = [
            (counts.disp, self.disp),
            (counts.vel, self.vel),
            (counts.accel, self.accel),
            (counts.force, self.force),
            (counts.time, &time[..]),
        ];
        let signals = wanted
            .iter()
            .flat_map(|(count, values)| values.iter().take(*count));
        for (place, signal) in row.iter_mut().zip(signals) {
            *place = *signal;
        }
    }
}

/// Writes a vector that begins with `lead` (an action, a flag, or nothing) and the signals, and zeros up to the
/// end of `out`. Real-time: yes.
///
/// # Errors
/// [`WireError::Count`] if a kind of the layout has another number of signals, [`WireError::NotFinite`],
/// [`WireError::Room`].
pub(crate) fn write_vector(
    out: &mut [u8],
    lead: Option<f64>,
    counts: &Counts,
    response: &Response<'_>,
) -> Result<(), WireError> {
    let mut at = 0;
    if let Some(lead) = lead {
        put(out, at, lead.to_le_bytes())?;
        at += 8;
    }
    let time = [response.time];
    for (field, count, values) in [
        ("displacements", counts.disp, response.disp),
        ("velocities", counts.vel, response.vel),
        ("accelerations", counts.accel, response.accel),
        ("forces", counts.force, response.force),
        ("time", counts.time, &time[..]),
    ] {
        if count == 0 {
            continue;
        }
        same_length(field, count, values.len())?;
        crate::bytes::finite(field, values)?;
        put_doubles(out, at, values)?;
        at += 8 * count;
    }
    zero_from(out, at);
    Ok(())
}

/// Writes a vector of nothing but an action. Real-time: yes.
///
/// # Errors
/// [`WireError::Room`].
pub(crate) fn write_action(out: &mut [u8], action: Action) -> Result<(), WireError> {
    put(out, 0, action.code().to_le_bytes())?;
    zero_from(out, 8);
    Ok(())
}

/// Writes an n×n matrix, given row by row, column by column, and zeros behind it. Real-time: yes.
///
/// # Errors
/// [`WireError::Count`], [`WireError::NotFinite`], [`WireError::Room`].
pub(crate) fn write_matrix(out: &mut [u8], n: usize, rows: &[f64]) -> Result<(), WireError> {
    same_length("entries of the matrix", n.saturating_mul(n), rows.len())?;
    crate::bytes::finite("matrix", rows)?;
    let mut at = 0;
    for column in 0..n {
        for value in rows.iter().skip(column).step_by(n) {
            put(out, at, value.to_le_bytes())?;
            at += 8;
        }
    }
    zero_from(out, at);
    Ok(())
}

/// Reads an n×n matrix, column by column on the wire, into row order. Real-time: yes.
///
/// # Errors
/// [`WireError::Count`], [`WireError::NotFinite`], [`WireError::Truncated`].
pub(crate) fn read_matrix(vector: &[u8], n: usize, rows: &mut [f64]) -> Result<(), WireError> {
    same_length("entries of the matrix", n.saturating_mul(n), rows.len())?;
    let columns = words(vector, 0, rows.len())?;
    finite_words("matrix", columns)?;
    for (row, values) in rows.chunks_exact_mut(n.max(1)).enumerate() {
        for (value, word) in values.iter_mut().zip(columns.iter().skip(row).step_by(n)) {
            *value = f64::from_le_bytes(*word);
        }
    }
    Ok(())
}

/// The action of a vector. Real-time: yes.
///
/// # Errors
/// [`WireError::Truncated`].
pub(crate) fn read_lead(vector: &[u8]) -> Result<f64, WireError> {
    get_f64(vector, 0)
}

fn zero_from(out: &mut [u8], at: usize) {
    if let Some(rest) = out.get_mut(at..) {
        rest.fill(0);
    }
}

/// Signals with a layout and their own buffer.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Signals {
    counts: Counts,
    values: Vec<f64>,
}

impl Signals {
    pub(super) fn zeros(counts: Counts) -> Self {
        Self {
            counts,
            values: vec![0.0; counts.total()],
        }
    }

    /// Reads all signals of a vector that begins with `lead` other doubles. An error leaves them unchanged.
    /// Real-time: yes.
    pub(super) fn read(
        &mut self,
        field: &'static str,
        vector: &[u8],
        lead: usize,
    ) -> Result<(), WireError> {
        let words = words(vector, 8 * lead, self.values.len())?;
        finite_words(field, words)?;
        crate::bytes::copy_words(field, words, &mut self.values)
    }

    pub(super) const fn counts(&self) -> &Counts {
        &self.counts
    }

    /// All values in one row, in the order of the wire.
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    pub(super) fn response(&self) -> Response<'_> {
        // The lengths add up to values.len() by construction.
        Response::split(&self.counts, &self.values)
    }

    /// The time, if the layout has one.
    pub(super) fn time(&self) -> Option<f64> {
        (self.counts.time == 1)
            .then(|| self.values.last().copied())
            .flatten()
    }

    /// True if all bits agree.
    pub(super) fn same_bits(&self, other: &Self) -> bool {
        same_bits(&self.values, &other.values)
    }
}

/// True if all bits agree: a zero that has changed its sign is another command.
pub(super) fn same_bits(a: &[f64], b: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(x, y)| x.to_bits() == y.to_bits())
}

fn cut(values: &[f64], at: usize) -> (&[f64], &[f64]) {
    values.split_at_checked(at).unwrap_or((values, &[]))
}
