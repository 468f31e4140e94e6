//! Critical delays of one axis, tabulated over its stiffness.
//!
//! The loop looks the delay up at the present stiffness. Between two entries 1/τ is interpolated along a straight line. Where
//! every delay is stable at one end of an interval, the other end counts. Beyond the last entry 1/τ grows in proportion to
//! the stiffness. A stiffness below zero counts as zero.

/// Critical delays of one axis over its stiffness.
#[derive(Debug, Clone, PartialEq)]
pub struct CriticalDelay {
    /// Stiffness of the entries in N/m, rising from 0, and 1/τ in 1/s there; 0: every delay is stable.
    entries: Vec<(f64, f64)>,
}

impl CriticalDelay {
    /// A table of stiffnesses in N/m, which rise from 0, and the critical delay in s at each; infinite where every delay is
    /// stable. `None` with fewer than two entries, with a delay that is not a positive number, or where the stiffness does not
    /// rise.
    #[must_use]
    pub(crate) fn new(delays: &[(f64, f64)]) -> Option<Self> {
        let rises = delays.windows(2).all(|pair| pair[0].0 < pair[1].0);
        let is_known = delays.len() >= 2
            && rises
            && delays.first().is_some_and(|first| first.0 == 0.0)
            && delays.last().is_some_and(|last| last.0.is_finite())
            && delays.iter().all(|(_, delay)| *delay > 0.0);
        is_known.then(|| Self {
            entries: delays.iter().map(|(k, delay)| (*k, 1.0 / delay)).collect(),
        })
    }

    /// The critical delay in s at a stiffness in N/m; infinite if every delay is stable, NaN for a stiffness of NaN.
    /// Real-time: yes.
    #[must_use]
    pub fn at(&self, stiffness: f64) -> f64 {
        if stiffness.is_nan() {
            return f64::NAN;
        }
        let stiffness = stiffness.max(0.0);
        let right = self.entries.partition_point(|(k, _)| *k <= stiffness);
        let left = right.checked_sub(1).and_then(|left| self.entries.get(left));
        let inverse = match (left, self.entries.get(right)) {
            (Some((at, a)), _) if *at == stiffness => *a,
            (Some((at, a)), Some((next, b))) if *a > 0.0 && *b > 0.0 => {
                a + (stiffness - at) / (next - at) * (b - a)
            }
            (Some((_, a)), Some((_, b))) => a.max(*b),
            (Some((last, a)), None) => a * (stiffness / last),
            // The first entry is at 0.
            (None, _) => f64::NAN,
        };
        1.0 / inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_is_exact_and_cautious_at_its_edge() {
        let table = CriticalDelay::new(&[
            (0.0, f64::INFINITY),
            (10.0, f64::INFINITY),
            (20.0, 0.5),
            (30.0, 0.25),
            (40.0, 0.2),
        ])
        .unwrap();
        for (stiffness, delay) in [
            (-5.0, f64::INFINITY),
            (0.0, f64::INFINITY),
            (9.9, f64::INFINITY),
            // Between every delay and half a second: half a second.
            (10.1, 0.5),
            (20.0, 0.5),
            (30.0, 0.25),
            (25.0, 1.0 / 3.0),
            (40.0, 0.2),
            (80.0, 0.1),
        ] {
            let found = table.at(stiffness);
            let same = found == delay || (found / delay - 1.0).abs() < 1e-12;
            assert!(same, "{stiffness}: {found} and not {delay}");
        }
        assert!(table.at(f64::NAN).is_nan());
        assert_eq!(table.at(f64::INFINITY), 0.0);
        assert_eq!(CriticalDelay::new(&[(0.0, 1.0)]), None);
        assert_eq!(CriticalDelay::new(&[(0.0, 1.0), (40.0, f64::NAN)]), None);
        assert_eq!(CriticalDelay::new(&[(0.0, 1.0), (0.0, 1.0)]), None);
        assert_eq!(CriticalDelay::new(&[(1.0, 1.0), (2.0, 1.0)]), None);
    }
}
