//! Levels of limits as a test file writes them.

use gusset_config::LimitsSpec;
use gusset_quantity::catalog::limit::{Kind, Limit, Scope, TABLE};

use super::*;

fn read(text: &str) -> LimitsSpec {
    toml::from_str(text).unwrap()
}

#[test]
fn axis_limit_replaces_the_common_one() {
    let all =
        read("command_step_m = { trip = 0.1 }\nforce_step_n = { trip = 7 }\nfollowing_time_s = 1");
    let limits = AxisLimits::of(&read("command_step_m = { trip = 0.2 }").over(&all));
    assert_eq!(limits.size(Limit::CommandStep), Bound::trip(0.2));
    assert_eq!(limits.size(Limit::ForceStep), Bound::trip(7.0));
    assert_eq!(limits.following_time, 1.0);
    assert_eq!(limits.get(Limit::CommandDisp), Range::NONE);
}

#[test]
fn axis_with_one_level_keeps_the_other() {
    let all = read(
        "command_step_m = { warn = 0.1, trip = 0.2 }\nmeasured_force_n = { warn = [-5, 5], trip = [-9, 9] }",
    );
    let axis = |text: &str| AxisLimits::of(&read(text).over(&all));
    let warned = axis("command_step_m = { warn = 0.15 }\nmeasured_force_n = { warn = [-6, 6] }");
    let bound = Bound {
        warn: 0.15,
        trip: 0.2,
    };
    assert_eq!(warned.size(Limit::CommandStep), bound);
    assert_eq!(warned.get(Limit::MeasuredForce).trip, [-9.0, 9.0]);
    assert_eq!(warned.get(Limit::MeasuredForce).warn, [-6.0, 6.0]);
    let tripped = axis("command_step_m = { trip = 0.3 }").size(Limit::CommandStep);
    assert_eq!((tripped.warn, tripped.trip), (0.1, 0.3));
}

#[test]
fn every_level_of_an_axis_is_judged() {
    let rows = TABLE.iter().filter(|row| row.scope() == Scope::Axis);
    for row in rows {
        let text = match row.kind {
            Kind::Range => format!("{} = {{ warn = [-1, 1], trip = [-2, 2] }}", row.key),
            Kind::Size | Kind::Count => format!("{} = {{ warn = 1, trip = 2 }}", row.key),
        };
        let limits = AxisLimits::of(&read(&text));
        let kept = limits.get(row.limit);
        assert_eq!((kept.warn[1], kept.trip[1]), (1.0, 2.0), "{}", row.key);
        let judged = limits.levels().filter(|(_, levels)| levels.is_some());
        let judged: Vec<&str> = judged.map(|(limit, _)| limit.key()).collect();
        assert_eq!(judged, [row.key]);
    }
}
