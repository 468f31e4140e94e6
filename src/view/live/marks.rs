//! The displayed limits: their names, their levels, and the used share of them.

use serde::Serialize;

use gusset_control::engine::Experiment;
use gusset_control::port::limits::{Bound, Range};
use gusset_quantity::catalog::limit::{Kind, Limit};
use gusset_record::Column;

/// One limit with its levels, SI.
#[derive(Debug, Clone, Serialize)]
pub struct Mark {
    /// Key of the test file.
    pub key: &'static str,
    /// In words.
    pub words: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Warned about outside of these two; null where not set.
    pub warn: [f64; 2],
    /// Trips outside of these two.
    pub trip: [f64; 2],
    /// Whether it is a size, from 0 up.
    pub size: bool,
    /// End of the range of a simulated actuator in both directions, in place of levels; null for a limit.
    pub end: f64,
    #[serde(skip)]
    pub(super) quantity: Limit,
    /// Place of the column with its judged value, where it has its own column.
    #[serde(skip)]
    pub(super) place: Option<usize>,
}

/// A limit, if it has a level; `place` finds the column of a limit of its axis by name.
pub(super) fn mark(
    (quantity, levels): (Limit, Range),
    place: impl Fn(&str) -> Option<usize>,
) -> Option<Mark> {
    let Range { warn, trip } = levels;
    let size = quantity.row().kind != Kind::Range;
    levels.is_some().then(|| Mark {
        key: quantity.key(),
        words: quantity.words(),
        unit: quantity.unit(),
        warn,
        trip,
        size,
        end: f64::INFINITY,
        quantity,
        place: place(quantity.row().name),
    })
}

/// Stroke and largest force of the simulated actuator of a specimen; infinite without one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatorEnds {
    /// Stroke in both directions, m.
    pub stroke: f64,
    /// Largest force in both directions, N.
    pub force: f64,
}

impl Default for ActuatorEnds {
    fn default() -> Self {
        Self {
            stroke: f64::INFINITY,
            force: f64::INFINITY,
        }
    }
}

impl ActuatorEnds {
    /// A mark for each end whose quantity has no limit among `limits`.
    pub(super) fn marks(self, limits: &[Mark]) -> Vec<Mark> {
        let of = |key, words, quantity: Limit, others: [Limit; 2], end: f64| {
            let limited =
                |mark: &Mark| others.contains(&mark.quantity) || mark.quantity == quantity;
            (end.is_finite() && !limits.iter().any(limited)).then(|| Mark {
                key,
                words,
                unit: quantity.unit(),
                warn: [f64::NEG_INFINITY, f64::INFINITY],
                trip: [f64::NEG_INFINITY, f64::INFINITY],
                size: false,
                end,
                quantity,
                place: None,
            })
        };
        let stroke = of(
            "stroke_m",
            "actuator stroke",
            Limit::CommandDisp,
            [Limit::MeasuredDisp, Limit::SensorDisp],
            self.stroke,
        );
        let force = of(
            "force_limit_n",
            "actuator force",
            Limit::MeasuredForce,
            [Limit::SensorForce; 2],
            self.force,
        );
        [stroke, force].into_iter().flatten().collect()
    }
}

/// Every limit of the test as a whole that is judged in it.
pub(super) fn test_marks(experiment: &Experiment, columns: &[Column]) -> Vec<Mark> {
    let marks = Limit::OF_TEST.into_iter().map(|quantity| {
        let Bound { warn, trip } = experiment.limits.test.of_test(quantity);
        Mark {
            key: quantity.key(),
            words: quantity.words(),
            unit: "1",
            warn: [f64::NEG_INFINITY, warn],
            trip: [f64::NEG_INFINITY, trip],
            size: true,
            end: f64::INFINITY,
            quantity,
            place: columns.iter().position(|c| c.name == quantity.column()),
        }
    });
    marks.filter(|mark| mark.place.is_some()).collect()
}

/// A value over the level at which its limit is reached, on its side: more than 1 is beyond. Where both ends are on one side of zero,
/// the closer end counts. Not a number where there is no level.
#[must_use]
pub fn share([low, high]: [f64; 2], value: f64) -> f64 {
    if low > 0.0 {
        let below = if value > 0.0 {
            low / value
        } else {
            f64::INFINITY
        };
        return below.max(value / high);
    }
    if high < 0.0 {
        return share([-high, -low], -value);
    }
    let level = if value < 0.0 { low } else { high };
    match level.is_finite() {
        true if value == 0.0 => 0.0,
        true => (value / level).abs(),
        false => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_control::port::limits::AxisLimits;

    #[test]
    fn every_level_has_a_mark_and_a_value() {
        for limit in Limit::OF_AXIS {
            let levels = Range::trip([-2.0, 2.0]);
            let limits = AxisLimits::NONE.with(limit, levels);
            let place = |name: &str| name.starts_with("judged_").then_some(7);
            let marks: Vec<Mark> = limits.levels().filter_map(|of| mark(of, place)).collect();
            assert_eq!(marks.len(), 1, "{limit:?}");
            let shown = &marks[0];
            let row = limit.row();
            assert_eq!(
                (shown.key, shown.words, shown.unit),
                (row.key, row.words, row.unit)
            );
            assert_eq!(shown.trip, levels.trip);
        }
    }

    #[test]
    fn actuator_ends_are_shown_without_a_limit() {
        let ends = ActuatorEnds {
            stroke: 0.1,
            force: 5e3,
        };
        let shown = |limits: AxisLimits| {
            let limits: Vec<Mark> = limits
                .levels()
                .filter_map(|of| mark(of, |_| None))
                .collect();
            let marks = ends.marks(&limits);
            marks
                .iter()
                .map(|mark| (mark.key, mark.end))
                .collect::<Vec<_>>()
        };
        let both = [("stroke_m", 0.1), ("force_limit_n", 5e3)];
        assert_eq!(shown(AxisLimits::NONE), both);
        let level = Range::trip([-2.0, 2.0]);
        for (limit, kept) in [
            (Limit::CommandDisp, &both[1..]),
            (Limit::MeasuredDisp, &both[1..]),
            (Limit::SensorForce, &both[..1]),
            (Limit::CommandVel, &both[..]),
        ] {
            assert_eq!(shown(AxisLimits::NONE.with(limit, level)), kept);
        }
        assert!(ActuatorEnds::default().marks(&[]).is_empty());
    }

    #[test]
    fn share_beyond_one_is_beyond_the_limit() {
        let none = f64::INFINITY;
        for (levels, value, wanted) in [
            ([-10.0, 20.0], -5.0, 0.5),
            ([-10.0, 20.0], 5.0, 0.25),
            ([-none, 20.0], 5.0, 0.25),
            ([0.0, 20.0], -1.0, none),
            ([10.0, 50.0], 50.0, 1.0),
            ([10.0, 50.0], 5.0, 2.0),
            ([10.0, 50.0], -5.0, none),
            ([-50.0, -10.0], -20.0, 0.5),
            ([-50.0, -10.0], -60.0, 1.2),
            ([10.0, none], 40.0, 0.25),
        ] {
            assert_eq!(share(levels, value), wanted, "{levels:?} {value}");
        }
        assert!(share([-none, 20.0], -5.0).is_nan());
        assert!(share([-none, none], 5.0).is_nan());
    }
}
