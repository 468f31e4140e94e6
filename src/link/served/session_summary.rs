//! Counters of a controller's test, and their part of its summary; a value that a server does not know is empty.

use std::collections::BTreeMap;

use super::exchange_columns::Exchange;
use gusset_quantity::substructure::LinkStats;
use gusset_quantity::units::AxisUnits;
use gusset_record::Summary;
use gusset_record::rt::wall::Wall;
use gusset_record::summary::{LinkCounts, Peak, Realtime};

/// Counters of a running test.
pub(super) struct Counted {
    pub exchanges: u64,
    pub passed_on: u64,
    pub answered: u64,
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
        let raw = exchange.port.feedback().raw();
        let measured = raw.disp.iter().zip(&raw.force).zip(units);
        for ((disp, force), ((raw_disp, raw_force), units)) in peaks.zip(measured) {
            *disp = disp.max((units.metres * raw_disp).abs());
            *force = force.max((units.newtons * raw_force).abs());
        }
    }

    /// The counts of the specimen `name`, whose link counted `stats`.
    pub(crate) fn summary(&self, name: &str, stats: &LinkStats) -> Summary {
        let some = |values: &[f64]| -> Vec<_> { values.iter().map(|value| Some(*value)).collect() };
        let counts = LinkCounts::of(self.passed_on, self.answered, stats);
        Summary {
            dt: self.dt,
            rate_hz: self.rate_hz.unwrap_or(0.0),
            peak: Peak {
                force: BTreeMap::from([(name.to_owned(), some(&self.force))]),
                ..Peak::default()
            },
            realtime: Realtime {
                asked: Some(false),
                role: Some("served to a controller: one row per exchange".to_owned()),
                began_utc_ns: Some(self.began.0),
                peak_displacement_m: Some(some(&self.disp)),
                granted: None,
            },
            link: BTreeMap::from([(name.to_owned(), counts)]),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            ..Summary::default()
        }
    }
}
