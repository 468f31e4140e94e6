//! The loop with no specimen, with or without a structure: the same threads, engine and recording as a test.

use std::collections::BTreeMap;

use gusset_config::{ClockChoice, Diagnostics, TimingSpec};
use gusset_control::engine::{
    Experiment, Limits, OnMiss, Pacing, Side, StartupSettings, TestLimits,
};
use gusset_quantity::time::{RateError, Ratio};
use gusset_record::summary::LimitFacts;
use gusset_setup::{Facts, Files, Prepared};

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
    let steps = (duration * rate.value()).round().max(1.0) as u64;
    let title = format!("Jitter at {rate} Hz");
    let text = format!("# gusset jitter --rate {rate} --duration {duration}\n");
    let side = Side::Prescribed(Vec::new());
    Ok(loop_round(side, &[], rate, steps, timing, (title, text)))
}

/// A loop round a numerical side alone: no specimen, no bound, a missed deadline moves the grid. `record` are the degrees
/// of freedom to record; title and text replace the test file.
#[must_use]
pub(crate) fn loop_round(
    side: Side,
    record: &[usize],
    rate: Ratio,
    steps: u64,
    timing: TimingSpec,
    (title, text): (String, String),
) -> Prepared {
    let rate_hz = rate.value();
    let period = rate.inverse();
    let warmup = timing
        .warmup(period.value())
        .min((WARM_UP_S * rate_hz) as u64 + 1);
    let experiment = Experiment {
        dt: period.value(),
        period,
        steps,
        side,
        opening: StartupSettings::default(),
        settling: None,
        ports: Vec::new(),
        record_dofs: record.to_vec(),
        rotations: Vec::new(),
        limits: Limits {
            on_miss: OnMiss::Stretch,
            extrapolate_stale: false,
            stale_in_a_row: 0,
            reply_timeout_ns: 0,
            warmup_ticks: warmup,
            divergence: f64::MAX,
            test: TestLimits::NONE,
        },
        pacing: Pacing::default(),
        resume: None,
        retraces: false,
        followed: None,
    };
    let facts = Facts {
        about: None,
        title,
        dt: period.value(),
        steps,
        rate_hz,
        ticks_per_step: 1,
        clock: ClockChoice::Real,
        structure: None,
        specimens: Vec::new(),
        units: Vec::new(),
        scaled: Vec::new(),
        timing,
        record_required: false,
        queue_s: 4.0,
        resume_within: None,
        resume_within_n: None,
        force_noise_n: Vec::new(),
        resumed: None,
        announced: Vec::new(),
        moved: Vec::new(),
        records: Vec::new(),
        corrected: Vec::new(),
        confirm: false,
        limits: LimitFacts::default(),
        warnings: Vec::new(),
        accepted: BTreeMap::new(),
    };
    let files = Files {
        test: text.clone().into_bytes(),
        resolved: text,
        inputs: Vec::new(),
        origin: None,
    };
    Prepared {
        experiment,
        facts,
        files,
        warnings: Diagnostics::default(),
        doubts: Vec::new(),
        loaded: None,
    }
}
