//! Fractiles of values among which some are infinite: a collapsed structure has an infinite drift.

/// Shares of the fractiles of IDA curves.
pub(super) const SHARES: [f64; 3] = [0.16, 0.5, 0.84];

/// The fractile `share` of `values`, linear between neighbours; `None` without a value. NaN values are omitted.
pub(crate) fn fractile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    let place = share * sorted.len().checked_sub(1)? as f64;
    let (low, high) = (place.floor() as usize, place.ceil() as usize);
    if sorted[high].is_infinite() {
        return Some(if low == high {
            sorted[high]
        } else {
            f64::INFINITY
        });
    }
    Some(sorted[low] + (place - place.floor()) * (sorted[high] - sorted[low]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractiles_are_between_their_neighbours() {
        let values: Vec<f64> = (0..=100).map(f64::from).collect();
        for share in SHARES {
            let found = fractile(&values, share).unwrap();
            assert!((found - 100.0 * share).abs() < 1e-12);
        }
        assert_eq!(fractile(&[], 0.5), None);
        let some = [1.0, 2.0, f64::INFINITY, f64::NAN];
        assert_eq!(fractile(&some, 0.5), Some(2.0));
        assert_eq!(fractile(&some, 0.84), Some(f64::INFINITY));
    }
}
