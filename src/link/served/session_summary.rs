//! The part of a controller's summary that the loop counts; a value that a server does not know is empty.

use std::collections::BTreeMap;

use gusset_control::engine::{ReceivedCounts, StageTimes};
use gusset_quantity::substructure::LinkStats;
use gusset_record::Summary;
use gusset_record::rt::wall::Wall;
use gusset_record::summary::{LinkCounts, Peak, Realtime, StageShares, TimeBetweenTargets};

fn some(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().map(|value| Some(*value)).collect()
}

/// The largest forces of the specimen `name`.
pub(super) fn peak_of(counts: &ReceivedCounts, name: &str) -> Peak {
    let [_, force] = &counts.peaks;
    Peak {
        force: BTreeMap::from([(name.to_owned(), some(force))]),
        ..Peak::default()
    }
}

fn shares(times: StageTimes) -> StageShares {
    let all_s = times.all_s();
    let share = |seconds: f64| if all_s > 0.0 { seconds / all_s } else { 0.0 };
    StageShares {
        laboratory_s: all_s,
        correcting: share(times.correcting_s),
        predicting: share(times.predicting_s),
        slowing: share(times.slowing_s),
        holding: share(times.holding_s),
        slow_downs: times.slow_downs,
        longest_slow_down_s: times.longest_s,
    }
}

/// The counts of the specimen `name`, whose link counted `stats`; exchanges per second, if they are known, and the begin of the test.
pub(super) fn summary_of(
    counts: &ReceivedCounts,
    name: &str,
    stats: &LinkStats,
    (rate_hz, began): (Option<f64>, Wall),
) -> Summary {
    let [disp, _] = &counts.peaks;
    let links = LinkCounts::of(counts.passed_on, counts.answered, stats);
    let between_targets = counts.stages.map(|stages| {
        let [whole, strong_part] = stages.map(shares);
        TimeBetweenTargets { whole, strong_part }
    });
    Summary {
        dt: counts.dt,
        rate_hz: rate_hz.unwrap_or(0.0),
        peak: peak_of(counts, name),
        realtime: Realtime {
            asked: Some(false),
            role: Some("served to a controller: one row per exchange".to_owned()),
            began_utc_ns: Some(began.0),
            peak_displacement_m: Some(some(disp)),
            granted: None,
        },
        link: BTreeMap::from([(name.to_owned(), links)]),
        between_targets,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        ..Summary::default()
    }
}
