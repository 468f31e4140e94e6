//! Names of recorded columns, and how many of them a page shows.

/// DOFs of which columns are kept.
pub(super) const MOST_DOFS: usize = 24;
/// Axes that are judged.
pub(super) const MOST_AXES: usize = 40;
/// Lines that one picture can carry and still be read: as many as there are colours.
pub(super) const MOST_LINES: usize = 6;
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
    pub(crate) fn column(self, kind: &str) -> String {
        format!("{kind}_{}_{}", self.specimen, self.axis)
    }
}

/// A column that is a sum of others, each with a factor: a storey drift, for example.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Combination {
    /// Its name.
    pub name: String,
    /// Its meaning.
    pub meaning: String,
    /// Its unit.
    pub unit: &'static str,
    /// Names of the columns, and their factors.
    pub terms: Vec<(String, f64)>,
}

/// Quantities of a storey; each has a column per storey, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Storey {
    /// Displacement against the storey below.
    Drift,
    /// Absolute acceleration of its floor.
    Floor,
    /// Shear force.
    Shear,
}

impl Storey {
    /// Name of the column.
    pub(crate) fn column(self, storey: usize) -> String {
        let kind = match self {
            Self::Drift => "drift",
            Self::Floor => "floor",
            Self::Shear => "shear",
        };
        format!("{kind}{storey}")
    }
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
