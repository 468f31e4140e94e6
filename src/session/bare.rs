//! The loop with nothing attached: the same threads, engine and recording as a test, no structure and no specimen.

use crate::config::{ClockChoice, Diagnostics, Facts, Files, Prepared};
use crate::engine::{Experiment, Limits, OnMiss, Opening, Side, TestLimits};
use crate::rt::TimingSpec;
use crate::time::{RateError, Ratio};

/// Warm-up ticks take this long at the most, in s.
const WARM_UP_S: f64 = 0.2;

/// An experiment that only keeps time, at `rate` ticks per second for about `duration` seconds.
///
/// # Errors
/// [`RateError`] if the duration is no positive number.
pub fn bare_loop(rate: Ratio, duration: f64, timing: TimingSpec) -> Result<Prepared, RateError> {
    if !(duration > 0.0 && duration.is_finite()) {
        return Err(RateError::NotPositive);
    }
    let rate_hz = rate.value();
    let steps = (duration * rate_hz).round().max(1.0) as u64;
    let period = rate.inverse();
    let warmup = timing.warmup_ticks.min((WARM_UP_S * rate_hz) as u64 + 1);
    let experiment = Experiment {
        dt: period.value(),
        period,
        steps,
        side: Side::Prescribed(Vec::new()),
        opening: Opening::default(),
        settling: None,
        ports: Vec::new(),
        record_dofs: Vec::new(),
        limits: Limits {
            on_miss: OnMiss::Stretch,
            misses_in_a_row: u64::MAX,
            misses_in_total: u64::MAX,
            extrapolate_stale: false,
            stale_in_a_row: 0,
            reply_timeout_ns: 0,
            warmup_ticks: warmup,
            divergence: f64::MAX,
            test: TestLimits::default(),
        },
    };
    let title = format!("Jitter at {rate} Hz");
    let text = format!("# gusset jitter --rate {rate} --duration {duration}\n");
    let facts = Facts {
        title,
        dt: period.value(),
        steps,
        rate_hz,
        clock: ClockChoice::Real,
        structure: None,
        specimens: Vec::new(),
        timing,
        record_required: false,
        queue_s: 4.0,
        announced: Vec::new(),
        confirm: false,
        warnings: Vec::new(),
    };
    let files = Files {
        test: text.clone().into_bytes(),
        resolved: text,
        inputs: Vec::new(),
    };
    Ok(Prepared {
        experiment,
        facts,
        files,
        warnings: Diagnostics::default(),
    })
}
