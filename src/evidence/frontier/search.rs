//! The search for the largest model: double or halve until it is enclosed, halve the rest, then prove it in a long trial.

/// Length of a trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Length {
    /// Short, to find the approximate limit.
    Short,
    /// Long enough to determine the share of kept deadlines.
    Long,
}

/// Outcome of one trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Ticks of it.
    pub ticks: u64,
    /// Deadlines missed because the step took too long, or another thread had the processor.
    pub missed: u64,
    /// Deadlines lost to stalls of a hypervisor. No smaller model would have kept them.
    pub taken_away: u64,
    /// Time of a step in µs, median and 99.9th percentile.
    pub compute_us: [f64; 2],
}

impl Trial {
    /// Share of kept deadlines, apart from those that a smaller model would not have kept either: the criterion for a
    /// model.
    #[must_use]
    pub fn kept(&self) -> f64 {
        1.0 - self.missed as f64 / self.ticks.max(1) as f64
    }

    /// Share of all deadlines.
    #[must_use]
    pub fn kept_of_all(&self) -> f64 {
        1.0 - (self.missed + self.taken_away) as f64 / self.ticks.max(1) as f64
    }
}

/// The largest model at one rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Ticks per second.
    pub rate_hz: f64,
    /// Degrees of freedom.
    pub dofs: usize,
    /// The long trial that proved it.
    pub trial: Trial,
}

impl Point {
    /// Degrees of freedom times rate.
    #[must_use]
    pub fn dof_hz(&self) -> f64 {
        self.dofs as f64 * self.rate_hz
    }
}

/// Where to look and what to be content with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// Size to begin with.
    pub begin: usize,
    /// Least and largest size.
    pub range: (usize, usize),
    /// Share of the deadlines that must be kept.
    pub wanted: f64,
}

/// The enclosing sizes may be this much apart at the end.
const CLOSE: f64 = 1.06;
/// Each failed proof takes this much away.
const BACK: f64 = 0.94;
/// Proofs at the most.
const PROOFS: usize = 10;

/// The largest size that keeps its deadlines, with its proof; none if not even the least one does, or `attempt` gives up
/// (none from it ends the search). `attempt` runs one trial and says which size it really had.
///
/// # Errors
/// Those of `attempt`.
pub fn largest<E>(
    search: Search,
    attempt: &mut dyn FnMut(usize, Length) -> Result<Option<(usize, Trial)>, E>,
) -> Result<Option<(usize, Trial)>, E> {
    let (least, most) = search.range;
    let within = |n: f64| (n as usize).clamp(least, most);
    let mut good: Option<usize> = None;
    let mut bad: Option<usize> = None;
    let mut n = search.begin.clamp(least, most);
    loop {
        let Some((size, trial)) = attempt(n, Length::Short)? else {
            return Ok(None);
        };
        if trial.kept() >= search.wanted {
            good = Some(size);
        } else {
            bad = Some(size);
        }
        n = match (good, bad) {
            (Some(good), _) if good >= most => break,
            (None, Some(bad)) if bad <= least => return Ok(None),
            (Some(good), None) => within(good as f64 * 2.0),
            (None, Some(bad)) => within(bad as f64 / 2.0),
            (Some(good), Some(bad)) => {
                let middle = within((good as f64 * bad as f64).sqrt());
                if bad as f64 <= good as f64 * CLOSE || middle <= good || middle >= bad {
                    break;
                }
                middle
            }
            (None, None) => break,
        };
    }
    let mut n = good.unwrap_or(least);
    for _ in 0..PROOFS {
        let Some((size, trial)) = attempt(n, Length::Long)? else {
            return Ok(None);
        };
        if trial.kept() >= search.wanted {
            return Ok(Some((size, trial)));
        }
        if n <= least {
            break;
        }
        n = within(size as f64 * BACK);
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    /// A machine that takes `ns` per degree of freedom and whose long trials are a little harder than its short ones.
    fn machine(
        limit: usize,
        harder: f64,
    ) -> impl FnMut(usize, Length) -> Result<Option<(usize, Trial)>, Infallible> {
        move |n, length| {
            let limit = match length {
                Length::Short => limit as f64,
                Length::Long => limit as f64 * harder,
            };
            let ticks = 10_000;
            let missed = if n as f64 > limit { ticks / 2 } else { 1 };
            let trial = Trial {
                ticks,
                missed,
                taken_away: 50,
                compute_us: [n as f64, n as f64],
            };
            Ok(Some((n, trial)))
        }
    }

    fn search(begin: usize) -> Search {
        Search {
            begin,
            range: (2, 1_000_000),
            wanted: 0.9999,
        }
    }

    #[test]
    fn limit_is_found_from_below_and_above() {
        for begin in [2, 100, 12_345, 1_000_000] {
            let found = largest(search(begin), &mut machine(5_000, 1.0)).unwrap();
            let (n, trial) = found.unwrap();
            assert!((4_700..=5_000).contains(&n), "{n} from {begin}");
            assert!(trial.kept() >= 0.9999 && trial.kept_of_all() < 0.9999);
        }
    }

    #[test]
    fn failed_proof_reduces_the_size() {
        let (n, _) = largest(search(100), &mut machine(5_000, 0.7))
            .unwrap()
            .unwrap();
        assert!((3_200..=3_500).contains(&n), "{n}");
    }

    #[test]
    fn search_ends_with_none_or_the_largest() {
        assert_eq!(largest(search(100), &mut machine(1, 1.0)).unwrap(), None);
        let (n, _) = largest(search(100), &mut machine(usize::MAX, 1.0))
            .unwrap()
            .unwrap();
        assert_eq!(n, 1_000_000);
        // The operator ends the search.
        let mut never = |_: usize, _: Length| Ok::<_, Infallible>(None);
        assert_eq!(largest(search(100), &mut never).unwrap(), None);
    }
}
