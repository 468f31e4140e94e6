//! The kernel's budget for real-time threads, and how long a pacer may spin inside it.
//!
//! A SCHED_FIFO thread that never sleeps is stopped: by default for 50 ms in every second
//! (`sched_rt_runtime_us` of `sched_rt_period_us`; newer kernels do the same through the fair server,
//! with the same share). A spin that leaves part of *every* period asleep can never use the budget up. This
//! file is arithmetic and one read of two files; it does not pace.

use serde::{Deserialize, Serialize};

/// The two settings in /proc/sys/kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Throttle {
    /// Microseconds that real-time threads may run in each period; none: no limit.
    pub runtime_us: Option<u64>,
    /// Length of the accounting period in microseconds.
    pub period_us: u64,
}

/// Thousandths of a tick that are kept free for its work (sends, waits for replies, compute, record).
const WORK: u64 = 250;
/// Thousandths of a tick that the thread always sleeps, beyond what the budget asks for: wake-ups are not free.
const SLEEP: u64 = 50;

impl Throttle {
    /// What kernels come with: 0.95 s in every second.
    pub const USUAL: Throttle = Throttle {
        runtime_us: Some(950_000),
        period_us: 1_000_000,
    };

    /// Reads the running kernel's setting; none where there is no such file.
    #[must_use]
    pub(crate) fn read() -> Option<Self> {
        let file = |name: &str| std::fs::read_to_string(format!("/proc/sys/kernel/{name}")).ok();
        Self::parse(&file("sched_rt_runtime_us")?, &file("sched_rt_period_us")?)
    }

    /// Reads both settings from their text; a runtime of −1 means no limit.
    #[must_use]
    pub(crate) fn parse(runtime: &str, period: &str) -> Option<Self> {
        let runtime: i64 = runtime.trim().parse().ok()?;
        let period_us: u64 = period.trim().parse().ok().filter(|us| *us > 0)?;
        Some(Self {
            runtime_us: u64::try_from(runtime).ok(),
            period_us,
        })
    }

    /// Thousandths of the time that real-time threads may run, rounded down.
    #[must_use]
    pub(crate) fn permille(&self) -> u64 {
        self.runtime_us.map_or(1000, |runtime_us| {
            (runtime_us.saturating_mul(1000) / self.period_us.max(1)).min(1000)
        })
    }

    /// The longest spin, up to `asked_ns`, that leaves a tick of `period_ns` room for its work and its sleep.
    ///
    /// The usual share bounds it even where the kernel sets no limit: a thread that never sleeps keeps the
    /// kernel's own threads off its processor.
    #[must_use]
    pub fn fit_spin(&self, asked_ns: u64, period_ns: u64) -> u64 {
        let spare = self.permille().min(Self::USUAL.permille());
        let spare = spare.saturating_sub(WORK + SLEEP);
        asked_ns.min(period_ns.saturating_mul(spare) / 1000)
    }
}

/// The spin in use, beside the one requested.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spin {
    /// Requested, in µs.
    pub asked_us: f64,
    /// In use, in µs.
    pub used_us: f64,
    /// The kernel's budget; none if it could not be read (then the usual one is assumed).
    pub throttle: Option<Throttle>,
    /// One sentence for the report.
    pub note: String,
}

impl Spin {
    /// Fits `asked_ns` into a tick of `period_ns`.
    #[must_use]
    pub(crate) fn plan(asked_ns: u64, period_ns: u64, throttle: Option<Throttle>) -> Self {
        let budget = throttle.unwrap_or(Throttle::USUAL);
        let used_ns = budget.fit_spin(asked_ns, period_ns);
        let (asked_us, used_us) = (asked_ns as f64 / 1e3, used_ns as f64 / 1e3);
        let limit = match (throttle, budget.runtime_us) {
            (None, _) => {
                "the kernel does not say how long real-time threads may run, 95 % is assumed"
                    .to_owned()
            }
            (Some(_), None) => "the kernel sets no limit to real-time threads".to_owned(),
            (Some(_), Some(_)) => format!(
                "the kernel lets real-time threads run {:.1} % of the time",
                budget.permille() as f64 / 10.0
            ),
        };
        let note = if used_ns == asked_ns {
            format!("spins the last {used_us} µs before each edge; {limit}")
        } else {
            format!(
                "a spin of {asked_us} µs in a tick of {} µs is shortened to {used_us} µs, so that the thread sleeps in \
                 every tick; {limit}",
                period_ns as f64 / 1e3
            )
        };
        Self {
            asked_us,
            used_us,
            throttle,
            note,
        }
    }

    /// The spin in use, in nanoseconds.
    #[must_use]
    pub(crate) fn used_ns(&self) -> u64 {
        (self.used_us * 1e3).round() as u64
    }

    /// True if the spin is shorter than requested.
    #[must_use]
    #[cfg(test)]
    pub(crate) fn is_shortened(&self) -> bool {
        self.used_us < self.asked_us
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn kernel_files_are_read() {
        assert_eq!(
            Throttle::parse("950000\n", "1000000\n"),
            Some(Throttle::USUAL)
        );
        assert_eq!(
            Throttle::parse("-1\n", "1000000\n").unwrap().runtime_us,
            None
        );
        assert_eq!(Throttle::parse("950000", "0"), None);
        assert_eq!(Throttle::parse("", "1000000"), None);
    }

    #[test]
    fn spin_is_shortened_only_if_too_long() {
        let kept = Spin::plan(60_000, 1_000_000, Some(Throttle::USUAL));
        assert_eq!((kept.used_ns(), kept.is_shortened()), (60_000, false));
        assert!(kept.note.contains("95.0 %"), "{}", kept.note);
        // 20 kHz: 50 µs · (0.95 − 0.25 − 0.05) = 32.5 µs.
        let cut = Spin::plan(60_000, 50_000, Some(Throttle::USUAL));
        assert_eq!((cut.used_ns(), cut.is_shortened()), (32_500, true));
        assert!(cut.note.contains("shortened to 32.5 µs"), "{}", cut.note);
        // A kernel without a limit has its own threads, too.
        let free = Throttle {
            runtime_us: None,
            ..Throttle::USUAL
        };
        assert_eq!(free.fit_spin(60_000, 50_000), 32_500);
    }

    #[test]
    fn throttled_kernel_gets_no_spin() {
        let none = Throttle {
            runtime_us: Some(0),
            period_us: 1_000_000,
        };
        assert_eq!(none.fit_spin(60_000, 1_000_000), 0);
    }

    proptest! {
        #[test]
        fn spin_and_work_stay_inside_the_budget(
            asked in 0u64..10_000_000, period in 1u64..1_000_000_000, runtime in 0u64..1_000_000
        ) {
            let throttle = Throttle { runtime_us: Some(runtime), period_us: 1_000_000 };
            let spin = throttle.fit_spin(asked, period);
            prop_assert!(spin <= asked);
            // Either no spin, or spin + a quarter of work fits the share.
            let busy = 1000 * spin + WORK * period;
            prop_assert!(spin == 0 || busy <= throttle.permille() * period);
        }
    }
}
