//! `summary.json` of a controller's test, with the keys of every run; a value that a server does not know is empty.

use std::collections::BTreeMap;

use super::exchange_columns::Exchange;
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::substructure::LinkStats;
use gusset_quantity::units::AxisUnits;
use gusset_record::rt::timing::Timing;
use gusset_record::rt::wall::Wall;
use gusset_record::summary::{ClockKind, InputFile, LinkCounts, Peak, Realtime};
use gusset_record::{MissClasses, Recorded, Summary};

/// Counters of a running test.
pub(super) struct Counted {
    pub exchanges: u64,
    pub passed_on: u64,
    pub answered: u64,
    /// Commands of a path that left late.
    pub missed_edges: u64,
    /// First length of a step that is not zero.
    dt: f64,
    /// Largest |displacement| in m and |force| in N.
    disp: Vec<f64>,
    force: Vec<f64>,
    rate_hz: Option<f64>,
    began: Wall,
}

impl Counted {
    pub(crate) fn new(axes: usize, rate_hz: Option<f64>, began: Wall) -> Self {
        Self {
            exchanges: 0,
            passed_on: 0,
            answered: 0,
            missed_edges: 0,
            dt: 0.0,
            disp: vec![0.0; axes],
            force: vec![0.0; axes],
            rate_hz,
            began,
        }
    }

    /// Real-time: yes.
    pub(crate) fn exchange(&mut self, exchange: &Exchange<'_>, units: &[AxisUnits]) {
        self.exchanges += 1;
        let passed_on = exchange.state != Exchange::KEPT_BACK;
        self.passed_on += u64::from(passed_on);
        let lost = matches!(exchange.trip, Some(super::Trip::Lost(_)));
        self.answered += u64::from(passed_on && !lost);
        if self.dt == 0.0 && exchange.elapsed > 0.0 {
            self.dt = exchange.elapsed;
        }
        let peaks = self.disp.iter_mut().zip(&mut self.force);
        for ((disp, force), measured) in peaks.zip(exchange.measured_si(units)) {
            *disp = disp.max(measured.0.abs());
            *force = force.max(measured.1.abs());
        }
    }
}

/// How it ended.
pub(super) struct End<'a> {
    pub cause: Cause,
    pub text: &'a str,
    pub wall_seconds: f64,
    pub required: bool,
    pub commits: u64,
    pub warnings: Vec<String>,
    pub accepted: BTreeMap<String, String>,
    pub inputs: Vec<InputFile>,
}

pub(super) fn summarise(
    end: End<'_>,
    name: &str,
    counted: &Counted,
    stats: &LinkStats,
    timing: &Timing,
    recorded: &Recorded,
) -> Summary {
    let mut warnings = end.warnings;
    if recorded.rows_lost() > 0 {
        let cause = recorded.first_error.as_deref();
        let cause = cause.unwrap_or("the queue was full");
        warnings.push(format!("{} rows are LOST: {cause}", recorded.rows_lost()));
    }
    let cause = match end.cause {
        Cause::Done if end.required && recorded.rows_lost() > 0 => Cause::RecordDamaged,
        cause => cause,
    };
    let link = LinkCounts {
        sent: counted.passed_on,
        received: counted.answered,
        late: stats.late,
        lost: counted.passed_on.saturating_sub(counted.answered),
        corrupt: stats.corrupt,
        duplicates: stats.duplicates,
        recovered: stats.recovered,
        missed: stats.missed,
        unreachable: stats.unreachable,
    };
    let some = |values: &[f64]| values.iter().map(|value| Some(*value)).collect();
    Summary {
        status: cause.status(),
        cause: Some(cause.word().to_owned()),
        reason: end.text.to_owned(),
        steps: end.commits,
        dt: counted.dt,
        lambda: None,
        clock: ClockKind::Real,
        wall_seconds: end.wall_seconds,
        rate_hz: counted.rate_hz.unwrap_or(0.0),
        deadline_misses: counted.missed_edges,
        stretched_ticks: 0,
        peak: Peak {
            force: BTreeMap::from([(name.to_owned(), some(&counted.force))]),
            ..Peak::default()
        },
        timing: Some(timing.summarised()),
        realtime: Realtime {
            asked: Some(false),
            role: Some("served to a controller: one row per exchange".to_owned()),
            began_utc_ns: Some(counted.began.0),
            peak_displacement_m: Some(some(&counted.disp)),
            granted: None,
        },
        link: BTreeMap::from([(name.to_owned(), link)]),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        rows_lost: recorded.rows_lost(),
        inputs: end.inputs,
        miss_classes: MissClasses::default(),
        warnings,
        limits: None,
        machine: None,
        metrics: None,
        metrics_missing: Vec::new(),
        falsified: None,
        left: BTreeMap::new(),
        force_on_the_way_in: BTreeMap::new(),
        accepted: end.accepted,
        verdict: None,
    }
}
