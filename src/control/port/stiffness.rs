//! What a specimen says of its stiffness beside what is believed of it.

/// Relative difference of the two estimates of a stiffness beyond which the user is warned.
const DIFFERENCE: f64 = 0.1;

/// How two estimates of one stiffness stand to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Opinion {
    /// Within a tenth.
    Agrees,
    /// Further apart, or no number.
    Differs,
    /// Of opposite sign: a channel is reversed.
    Reversed,
}

/// Compares the stiffness that a specimen reports with ours, both in the same units.
#[must_use]
pub(super) fn compare_stiffness(theirs: f64, ours: f64) -> Opinion {
    if theirs * ours < 0.0 {
        Opinion::Reversed
    } else if (theirs - ours).abs() <= DIFFERENCE * ours.abs() {
        Opinion::Agrees
    } else {
        Opinion::Differs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tenth_is_near_and_no_number_is_not() {
        assert_eq!(
            compare_stiffness(1.1, 1.0),
            Opinion::Differs,
            "1.1 is a little more"
        );
        assert_eq!(compare_stiffness(1.09, 1.0), Opinion::Agrees);
        assert_eq!(compare_stiffness(0.0, 0.0), Opinion::Agrees);
        assert_eq!(compare_stiffness(f64::NAN, 1.0), Opinion::Differs);
        assert_eq!(compare_stiffness(-1e-9, 1.0), Opinion::Reversed);
    }
}
