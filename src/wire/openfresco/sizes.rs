//! The numbers that both ends must know before any vector: how many signals of each kind, and how long a vector is.
//!
//! Invariant: an object of this module is valid. Every count is between 0 and [`MAX_COUNT`], and N holds what it
//! must and is at most [`MAX_DATA_SIZE`]. The real programs check none of this and write past their buffers.

use crate::WireError;
use crate::bytes::{bounded, get_i32, put};

/// Length of the first message in dialects A, C and D.
pub(crate) const SIZES_LEN: usize = 44;
/// Length of one size array in dialect B.
pub(crate) const BLOCK_LEN: usize = 20;
/// Doubles in a vector, unless somebody wants it otherwise.
pub const DEFAULT_DATA_SIZE: usize = 256;
/// Most doubles in a vector: 512 kB.
pub const MAX_DATA_SIZE: usize = 65_536;
/// Most signals of one kind.
pub const MAX_COUNT: usize = 4096;

/// How many signals of each kind, in the order of the vectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Displacements.
    pub disp: usize,
    /// Velocities.
    pub vel: usize,
    /// Accelerations.
    pub accel: usize,
    /// Forces.
    pub force: usize,
    /// Time: 0 or 1.
    pub time: usize,
}

impl Counts {
    /// Five counts in the order of the wire.
    #[must_use]
    pub const fn new(disp: usize, vel: usize, accel: usize, force: usize, time: usize) -> Self {
        Self {
            disp,
            vel,
            accel,
            force,
            time,
        }
    }

    /// In the order of the wire.
    #[must_use]
    pub const fn in_order(&self) -> [usize; 5] {
        [self.disp, self.vel, self.accel, self.force, self.time]
    }

    /// All signals.
    #[must_use]
    pub const fn total(&self) -> usize {
        self.before_time() + self.time
    }

    /// Place of the time, counted from the first signal.
    #[must_use]
    pub(crate) const fn before_time(&self) -> usize {
        self.disp + self.vel + self.accel + self.force
    }

    /// Reads five int32.
    ///
    /// # Errors
    /// [`WireError::Truncated`], or [`WireError::Bounds`] for a count that cannot be.
    pub(crate) fn parse(bytes: &[u8], at: usize) -> Result<Self, WireError> {
        Ok(Self {
            disp: count("number of displacements", MAX_COUNT, bytes, at)?,
            vel: count("number of velocities", MAX_COUNT, bytes, at + 4)?,
            accel: count("number of accelerations", MAX_COUNT, bytes, at + 8)?,
            force: count("number of forces", MAX_COUNT, bytes, at + 12)?,
            time: count("number of times", 1, bytes, at + 16)?,
        })
    }

    /// Writes five int32.
    ///
    /// # Errors
    /// [`WireError::Room`], or [`WireError::Bounds`] for a count that cannot be.
    pub(crate) fn write(&self, out: &mut [u8], at: usize) -> Result<(), WireError> {
        self.check()?;
        for (index, count) in self.in_order().into_iter().enumerate() {
            // check() bounded it: the cast is lossless.
            put(out, at + 4 * index, (count as i32).to_le_bytes())?;
        }
        Ok(())
    }

    fn check(&self) -> Result<(), WireError> {
        let [disp, vel, accel, force, time] = self.in_order();
        for (field, highest, found) in [
            ("number of displacements", MAX_COUNT, disp),
            ("number of velocities", MAX_COUNT, vel),
            ("number of accelerations", MAX_COUNT, accel),
            ("number of forces", MAX_COUNT, force),
            ("number of times", 1, time),
        ] {
            inside(field, 0, highest, i64::try_from(found).unwrap_or(i64::MAX))?;
        }
        Ok(())
    }
}

/// The first message of dialects A, C and D.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    ctrl: Counts,
    daq: Counts,
    data_size: usize,
}

impl Sizes {
    /// Checked sizes.
    ///
    /// # Errors
    /// [`WireError::Bounds`] for a count that cannot be, or an N below `1 + Σ ctrl` or `Σ daq` or above
    /// [`MAX_DATA_SIZE`].
    pub fn new(ctrl: Counts, daq: Counts, data_size: usize) -> Result<Self, WireError> {
        ctrl.check()?;
        daq.check()?;
        inside(
            "data size N",
            smallest(&ctrl, &daq),
            MAX_DATA_SIZE,
            i64::try_from(data_size).unwrap_or(i64::MAX),
        )?;
        Ok(Self {
            ctrl,
            daq,
            data_size,
        })
    }

    /// Sizes with the requested N, raised as far as commands, answers and, if wanted, n×n matrices need it.
    ///
    /// # Errors
    /// See [`Sizes::new`].
    pub fn fitted(
        ctrl: Counts,
        daq: Counts,
        data_size: usize,
        matrices: bool,
    ) -> Result<Self, WireError> {
        ctrl.check()?;
        let matrix = if matrices { ctrl.disp * ctrl.disp } else { 0 };
        let raised = data_size.max(smallest(&ctrl, &daq)).max(matrix);
        Self::new(ctrl, daq, raised)
    }

    /// What OpenSees' `genericClient` with `n` degrees of freedom sends: d, v, a, t out, forces back.
    ///
    /// # Errors
    /// See [`Sizes::new`].
    #[cfg(test)]
    pub(crate) fn generic_client(n: usize, data_size: usize) -> Result<Self, WireError> {
        let ctrl = Counts::new(n, n, n, 0, 1);
        Self::fitted(ctrl, Counts::new(0, 0, 0, n, 0), data_size, true)
    }

    /// Sizes for an OpenSees `adapter`, `actuator` or `corotActuator`: d out, d and f back.
    ///
    /// # Errors
    /// See [`Sizes::new`].
    pub fn adapter(n: usize, data_size: usize) -> Result<Self, WireError> {
        let ctrl = Counts::new(n, 0, 0, 0, 0);
        Self::fitted(ctrl, Counts::new(n, 0, 0, n, 0), data_size, false)
    }

    /// Everything out but forces, everything back: OpenFresco's own experimental elements.
    ///
    /// # Errors
    /// See [`Sizes::new`].
    #[cfg(test)]
    pub(crate) fn full(n: usize, data_size: usize) -> Result<Self, WireError> {
        let ctrl = Counts::new(n, n, n, 0, 1);
        Self::fitted(ctrl, Counts::new(n, n, n, n, 1), data_size, false)
    }

    /// Reads the 44 bytes.
    ///
    /// # Errors
    /// [`WireError::Truncated`], [`WireError::Foreign`], or [`WireError::Bounds`] for impossible sizes.
    pub fn parse(bytes: &[u8]) -> Result<Self, WireError> {
        crate::not_foreign(bytes)?;
        let ctrl = Counts::parse(bytes, 0)?;
        let daq = Counts::parse(bytes, BLOCK_LEN)?;
        let found = i64::from(get_i32(bytes, 2 * BLOCK_LEN)?);
        let data_size = inside("data size N", smallest(&ctrl, &daq), MAX_DATA_SIZE, found)?;
        Self::new(ctrl, daq, data_size)
    }

    /// Writes the 44 bytes.
    ///
    /// # Errors
    /// [`WireError::Room`].
    pub fn write(&self, out: &mut [u8]) -> Result<usize, WireError> {
        self.ctrl.write(out, 0)?;
        self.daq.write(out, BLOCK_LEN)?;
        // At most MAX_DATA_SIZE: the cast is lossless.
        put(out, 2 * BLOCK_LEN, (self.data_size as i32).to_le_bytes())?;
        Ok(SIZES_LEN)
    }

    /// Signals of a command.
    #[must_use]
    pub const fn ctrl(&self) -> &Counts {
        &self.ctrl
    }

    /// Signals of an answer.
    #[must_use]
    pub const fn daq(&self) -> &Counts {
        &self.daq
    }

    /// Doubles in every vector: N.
    #[must_use]
    pub const fn data_size(&self) -> usize {
        self.data_size
    }

    /// Bytes of every vector: 8N.
    #[must_use]
    pub(crate) const fn vector_len(&self) -> usize {
        8 * self.data_size
    }
}

/// Signals of a server: the counts of a client must fit them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Interface {
    /// Commanded displacements.
    pub axes: usize,
    /// Measured forces; the same number for nearly every specimen.
    pub forces: usize,
}

impl Interface {
    /// As many forces as displacements.
    #[must_use]
    pub const fn of_axes(axes: usize) -> Self {
        Self { axes, forces: axes }
    }

    /// Displacements must be commanded and no forces, something must be measured, and what is given must be given for
    /// every axis. An announced force is meant to be commanded: OpenFresco's `bearing` announces forces only where its user
    /// asks for force control.
    ///
    /// # Errors
    /// [`WireError::CommandedForces`], [`WireError::UnequalForces`], [`WireError::Count`].
    pub(crate) fn check(&self, ctrl: &Counts, daq: &Counts) -> Result<(), WireError> {
        if ctrl.force > 0 {
            return Err(WireError::CommandedForces { found: ctrl.force });
        }
        exactly("commanded displacements", self.axes, ctrl.disp)?;
        none_or("commanded velocities", self.axes, ctrl.vel)?;
        none_or("commanded accelerations", self.axes, ctrl.accel)?;
        none_or("measured displacements", self.axes, daq.disp)?;
        none_or("measured velocities", self.axes, daq.vel)?;
        none_or("measured accelerations", self.axes, daq.accel)?;
        if self.forces == self.axes && daq.force != 0 && daq.force != ctrl.disp {
            return Err(WireError::UnequalForces {
                disp: ctrl.disp,
                found: daq.force,
            });
        }
        none_or("measured forces", self.forces, daq.force)?;
        if daq.total() == 0 {
            return exactly("measured forces", self.forces, 0);
        }
        Ok(())
    }
}

const fn smallest(ctrl: &Counts, daq: &Counts) -> usize {
    let command = 1 + ctrl.total();
    if command > daq.total() {
        command
    } else {
        daq.total()
    }
}

fn count(field: &'static str, highest: usize, bytes: &[u8], at: usize) -> Result<usize, WireError> {
    inside(field, 0, highest, i64::from(get_i32(bytes, at)?))
}

pub(super) fn inside(
    field: &'static str,
    lowest: usize,
    highest: usize,
    found: i64,
) -> Result<usize, WireError> {
    bounded(field, lowest, highest, found.into())?;
    Ok(found as usize)
}

fn exactly(field: &'static str, expected: usize, found: usize) -> Result<(), WireError> {
    crate::bytes::same_length(field, expected, found)
}

fn none_or(field: &'static str, expected: usize, found: usize) -> Result<(), WireError> {
    if found == 0 {
        Ok(())
    } else {
        exactly(field, expected, found)
    }
}
