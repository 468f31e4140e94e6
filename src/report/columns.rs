//! Names of recorded columns, and how many of them a page shows.

/// DOFs of which columns are kept.
pub(super) const MOST_DOFS: usize = 24;
/// Axes that are judged.
pub(super) const MOST_AXES: usize = 40;
/// Lines that one picture can carry and still be read.
pub(super) const MOST_LINES: usize = 4;
/// Share of the test at its end over which the residual displacement is averaged.
pub(super) const TAIL: usize = 50;
/// Kind of the column of measured − target.
pub(super) const ERROR: &str = "error";

/// One axis of one specimen, both from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SpecimenAxis {
    pub specimen: u32,
    pub axis: u32,
}

impl SpecimenAxis {
    /// Name of a column of this axis: "force" gives "force_1_1".
    pub fn column(self, kind: &str) -> String {
        format!("{kind}_{}_{}", self.specimen, self.axis)
    }
}

/// A column that is the difference of two: a storey drift.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Its name.
    pub name: String,
    /// What it means.
    pub meaning: String,
    /// Name of the column that counts.
    pub of: String,
    /// Name of the one that is taken off; none for zero.
    pub less: Option<String>,
}

/// Name of the column of a storey's drift, from 1.
pub(super) fn drift(storey: usize) -> String {
    format!("drift{storey}")
}

/// `most` entries of `list`, spread evenly, first and last among them.
pub(super) fn spread(list: &[u32], most: usize) -> Vec<u32> {
    if list.len() <= most {
        return list.to_vec();
    }
    (0..most)
        .filter_map(|i| list.get(i * (list.len() - 1) / (most - 1)).copied())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spread_has_both_ends() {
        let list: Vec<u32> = (1..=100).collect();
        assert_eq!(spread(&list, 4), [1, 34, 67, 100]);
        assert_eq!(spread(&list[..3], 4), [1, 2, 3]);
    }
}
