//! Probability behind `hits` of `trials`.

/// The interval of Clopper and Pearson (1934) that holds the probability with at least 95 %: zero hits are no proof of
/// probability zero. `hits` counts at most as `trials`; without any trial everything is possible.
#[must_use]
pub fn interval(hits: u64, trials: u64) -> (f64, f64) {
    const TAIL: f64 = 0.025;
    let hits = hits.min(trials);
    // At most `hits` of `trials` fall below a probability that is too large, at least as many above one that is too small.
    let low = if hits == 0 {
        0.0
    } else {
        root(|p| 1.0 - at_most(hits - 1, trials, p) < TAIL)
    };
    let high = if hits == trials {
        1.0
    } else {
        root(|p| at_most(hits, trials, p) > TAIL)
    };
    (low, high)
}

/// Where `below` ends to hold, in [0, 1].
fn root(below: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Probability of at most `hits` of `trials` at probability `p` each.
fn at_most(hits: u64, trials: u64, p: f64) -> f64 {
    if p <= 0.0 {
        return 1.0;
    }
    if p >= 1.0 {
        return f64::from(u8::from(hits >= trials));
    }
    let (n, odds) = (trials as f64, libm::log(p / (1.0 - p)));
    // Logarithms: (1 − p)ⁿ alone would be too small for a double.
    let mut term = n * libm::log1p(-p);
    let mut sum = libm::exp(term);
    for k in 0..hits {
        let k = k as f64;
        term += libm::log((n - k) / (k + 1.0)) + odds;
        sum += libm::exp(term);
    }
    sum.min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_the_tables() {
        // Zero of n: 1 − 0.025^(1/n), the rule of 3.7/n; and exact values of Clopper and Pearson.
        for (hits, trials, low, high) in [
            (0, 200, 0.0, 1.0 - libm::pow(0.025, 1.0 / 200.0)),
            (200, 200, libm::pow(0.025, 1.0 / 200.0), 1.0),
            (1, 10, 0.002_528_579, 0.445_016_1),
            (5, 10, 0.187_086_0, 0.812_914_0),
            (0, 0, 0.0, 1.0),
        ] {
            let found = interval(hits, trials);
            assert!(
                (found.0 - low).abs() < 1e-6 && (found.1 - high).abs() < 1e-6,
                "{hits} of {trials}: {found:?}"
            );
        }
    }

    #[test]
    fn many_trials_are_handled() {
        let (low, high) = interval(3_000, 100_000);
        // Five standard errors of 0.03.
        assert!(low > 0.027 && low < 0.03 && high > 0.03 && high < 0.033);
    }
}
