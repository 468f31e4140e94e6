//! The digested rows by name, as the sections of the page ask for them.

use std::borrow::Cow;

use super::digest::Digest;
pub(super) use super::digest::SpecimenAxis;

/// A view of a run's rows in which the test was running; of a long test the extremes of every few.
pub(super) struct Rows<'a> {
    digest: &'a Digest,
}

impl<'a> Rows<'a> {
    /// The rows of a digest.
    pub const fn new(digest: &'a Digest) -> Self {
        Self { digest }
    }

    /// The digest itself.
    pub const fn digest(&self) -> &'a Digest {
        self.digest
    }

    /// Number of rows in which the test was running.
    pub const fn running(&self) -> u64 {
        self.digest.running
    }

    /// Number of all rows.
    pub const fn recorded(&self) -> u64 {
        self.digest.recorded
    }

    /// A column.
    pub fn get(&self, name: &str) -> Option<Cow<'a, [f64]>> {
        self.digest.table.get(name).map(Cow::Borrowed)
    }

    /// A column that holds at least one number.
    pub fn filled(&self, name: &str) -> Option<Cow<'a, [f64]>> {
        self.get(name)
            .filter(|values| values.iter().any(|v| v.is_finite()))
    }

    /// Unit of a column.
    pub fn unit(&self, name: &str) -> &'a str {
        self.digest.table.unit(name)
    }

    /// Numbers of the DOFs with a recorded displacement, rising.
    pub fn dofs(&self) -> &'a [u32] {
        &self.digest.dofs
    }

    /// Axes of specimens with a recorded force, rising.
    pub fn axes(&self) -> &'a [SpecimenAxis] {
        &self.digest.all_axes
    }

    /// True if the recorded steps run from the first to the last without a hole; none without a column of steps.
    pub const fn is_gapless(&self) -> Option<bool> {
        self.digest.gapless
    }
}
