use super::*;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::AtSpecimen;

/// Of as many axes as there are in any test.
const NO_NOISE: [f64; 2] = [0.0; 2];

/// Trips at `trip`, warns at half of it.
fn half(trip: f64) -> Bound {
    Bound {
        warn: trip / 2.0,
        trip,
    }
}

fn range(low: f64, high: f64) -> Range {
    Range {
        warn: [low / 2.0, high / 2.0],
        trip: [low, high],
    }
}

/// 0.1 s ticks, one axis.
fn watch(limits: AxisLimits) -> Watch {
    Watch::new(vec![limits], 0.1)
}

/// Judges and sends; what was found.
fn command(watch: &mut Watch, disp: f64) -> Found {
    let found = watch.command(std::iter::once(AtSpecimen(disp)));
    watch.sent(std::iter::once(AtSpecimen(disp)));
    found
}

fn measure(watch: &mut Watch, disp: f64, force: f64) -> Found {
    watch.measured(std::iter::once(AtSpecimen((disp, force))))
}

fn what(hit: Option<Hit>) -> Option<(Limit, f64)> {
    hit.map(|hit| (hit.quantity, hit.value))
}

#[test]
fn stroke_has_a_warning_at_each_end() {
    let limits = AxisLimits::NONE.with(Limit::CommandDisp, range(-0.2, 0.4));
    let mut one = watch(limits);
    assert_eq!(command(&mut one, -0.05), Found::default());
    let low = command(&mut one, -0.15);
    assert_eq!(what(low.warning), Some((Limit::CommandDisp, -0.15)));
    assert_eq!(low.trip, None);
    assert_eq!(low.warning.unwrap().bound, -0.1);
    let beyond = command(&mut one, -0.21).trip.unwrap();
    assert_eq!((beyond.value, beyond.bound), (-0.21, -0.2));
    assert_eq!(
        command(&mut one, 0.4).trip,
        None,
        "the bound itself is allowed"
    );
    assert_eq!(command(&mut one, 0.41).trip.unwrap().bound, 0.4);
}

#[test]
fn nan_trips_without_a_limit() {
    let mut one = watch(AxisLimits::NONE);
    assert!(command(&mut one, f64::NAN).trip.is_some());
    assert!(command(&mut one, f64::INFINITY).trip.is_some());
    assert!(measure(&mut one, 0.0, f64::NAN).trip.is_some());
    assert!(measure(&mut one, f64::NAN, 0.0).trip.is_some());
}

#[test]
fn warning_repeats_only_after_a_return() {
    let limits = AxisLimits::NONE.with(Limit::MeasuredForce, range(-100.0, 100.0));
    let mut one = watch(limits);
    let warned: Vec<bool> = [10.0, 60.0, 70.0, 40.0, 55.0]
        .into_iter()
        .map(|force| measure(&mut one, 0.0, force).warning.is_some())
        .collect();
    assert_eq!(warned, [false, true, false, false, true]);
}

#[test]
fn one_tick_gives_all_its_warnings() {
    let limits = AxisLimits::NONE
        .with(Limit::MeasuredForce, range(-100.0, 100.0))
        .with(Limit::MeasuredDisp, range(-1.0, 1.0));
    let mut two = Watch::new(vec![limits; 2], 0.1);
    let look = |two: &mut Watch, values: [(f64, f64); 2]| {
        let found = two.measured(values.into_iter().map(AtSpecimen));
        let more = std::iter::from_fn(|| two.next_untold());
        let all = found.warning.into_iter().chain(more);
        let all = all.map(|hit| {
            assert_eq!(hit.level, Level::Warning);
            (hit.axis, hit.quantity, hit.value)
        });
        (found.trip, found.more, all.collect::<Vec<_>>())
    };
    let beyond = [(0.6, 60.0), (0.7, 0.0)];
    let wanted = vec![
        (0, Limit::MeasuredDisp, 0.6),
        (0, Limit::MeasuredForce, 60.0),
        (1, Limit::MeasuredDisp, 0.7),
    ];
    assert_eq!(look(&mut two, beyond), (None, true, wanted));
    assert_eq!(look(&mut two, beyond), (None, false, Vec::new()), "known");
    assert_eq!(look(&mut two, [(0.0, 0.0); 2]).2, []);
    assert_eq!(look(&mut two, [(0.0, 0.0), (0.7, 0.0)]).2.len(), 1);
    // Beside a trip, and of another axis.
    let (trip, _, told) = {
        let found = two.measured([(1.1, 60.0), (0.0, 60.0)].into_iter().map(AtSpecimen));
        let more: Vec<_> = std::iter::from_fn(|| two.next_untold()).collect();
        (found.trip, found.warning, more)
    };
    assert_eq!(what(trip), Some((Limit::MeasuredDisp, 1.1)));
    assert_eq!(told.len(), 1);
    assert_eq!((told[0].axis, told[0].value), (1, 60.0));
}

#[test]
fn speeds_are_differences_over_wall_time() {
    let limits = AxisLimits::NONE.with(Limit::CommandVel, Bound::trip(1.0));
    let mut one = watch(limits);
    assert_eq!(command(&mut one, 5.0).trip, None, "nothing to differ from");
    assert_eq!(command(&mut one, 5.09).trip, None, "0.9 m/s");
    let fast = command(&mut one, 5.2).trip.unwrap();
    assert_eq!(fast.quantity, Limit::CommandVel);
    assert!((fast.value - 1.1).abs() < 1e-9);

    let limits = AxisLimits::NONE.with(Limit::CommandAccel, Bound::trip(2.0));
    let mut one = watch(limits);
    for disp in [0.0, 0.1, 0.21] {
        assert_eq!(command(&mut one, disp).trip, None, "1 m/s2 at the most");
    }
    let hard = command(&mut one, 0.35).trip.unwrap();
    assert!((hard.value - 3.0).abs() < 1e-9, "(0.35 - 0.42 + 0.1)/0.01");
}

#[test]
fn unequal_ticks_use_their_mean_length() {
    let limits = AxisLimits::NONE.with(Limit::CommandAccel, Bound::trip(2.0));
    let mut one = watch(limits);
    command(&mut one, 0.0);
    command(&mut one, 0.1);
    one.tick_is(0.3);
    // From 1 to 1.35 m/s in 0.2 s, and from there to 1.85 m/s.
    assert_eq!(command(&mut one, 0.505).trip, None, "1.75 m/s2");
    one.tick_is(0.1);
    let hard = command(&mut one, 0.69).trip.unwrap();
    assert_eq!(hard.quantity, Limit::CommandAccel);
    assert!((hard.value - 2.5).abs() < 1e-9, "{}", hard.value);
}

#[test]
fn first_step_begins_at_the_position() {
    let limits = AxisLimits::NONE.with(Limit::CommandStep, half(0.01));
    let mut one = watch(limits);
    one.stands_at(std::iter::once(AtSpecimen(0.5)));
    let found = one.command(std::iter::once(AtSpecimen(0.0))).trip.unwrap();
    assert_eq!((found.quantity, found.value), (Limit::CommandStep, 0.5));
}

#[test]
fn following_error_grows_with_speed() {
    let limits = AxisLimits {
        following_time: 0.02,
        ..AxisLimits::NONE.with(Limit::FollowingError, Bound::trip(0.01))
    };
    let mut one = watch(limits);
    command(&mut one, 0.0);
    command(&mut one, 0.1);
    // 1 m/s: 0.01 + 0.02 m are allowed.
    assert_eq!(measure(&mut one, 0.0705, 0.0).trip, None);
    assert!(measure(&mut one, 0.0695, 0.0).trip.is_some());
    command(&mut one, 0.1);
    assert!(measure(&mut one, 0.0705, 0.0).trip.is_some(), "at rest");
}

/// An actuator that comes 3 ticks behind goes on for as long after a command that stops, or slows down.
#[test]
fn late_axis_may_come_to_rest() {
    let limits = AxisLimits {
        following_time: 0.31,
        ..AxisLimits::NONE.with(Limit::FollowingError, Bound::trip(0.01))
    };
    let slow = |k: u32| if k.is_multiple_of(2) { 0.02 } else { 0.0 };
    let stops: [(&str, &dyn Fn(u32) -> f64); 3] = [
        ("at once", &|k| if k < 10 { 0.1 } else { 0.0 }),
        ("for a slow way", &|k| if k < 10 { 0.1 } else { slow(k) }),
        ("by and by", &|k| 0.1 - 0.02 * f64::from(k.clamp(5, 10) - 5)),
    ];
    for (name, step) in stops {
        let way = |k: u32| (1..=k).map(step).sum::<f64>();
        let mut one = watch(limits);
        for k in 0..40 {
            command(&mut one, way(k));
            let found = measure(&mut one, way(k.saturating_sub(3)), 0.0);
            assert_eq!(found.trip, None, "{name}: {k}");
        }
    }
    // Told once more where it stands it is the same, and one that never comes trips after twice that time.
    for comes in [true, false] {
        let mut one = watch(limits);
        let way = |k: u32| 0.1 * f64::from(k.min(10));
        let trips = (0..40).find(|&k| {
            if k <= 10 {
                command(&mut one, way(k));
            } else {
                one.sent_again();
            }
            let stands = if comes {
                k.saturating_sub(3)
            } else {
                k.min(10).saturating_sub(3)
            };
            measure(&mut one, way(stands), 0.0).trip.is_some()
        });
        assert_eq!(trips.is_some(), !comes);
        assert!(trips.is_none_or(|k| k <= 10 + 2 * 4), "{trips:?}");
    }
}

#[test]
fn force_jump_counts_from_the_second_value() {
    let limits = AxisLimits::NONE.with(Limit::ForceStep, Bound::trip(10.0));
    let mut one = watch(limits);
    assert_eq!(measure(&mut one, 0.0, 500.0).trip, None);
    assert_eq!(measure(&mut one, 0.0, 509.0).trip, None);
    assert!(measure(&mut one, 0.0, 498.0).trip.is_some());
    // The way out knows of it; a test that goes on after an interruption does not.
    assert_eq!(one.jump(0), Some(AtSpecimen([509.0, 10.0])));
    one.forget_measurements();
    assert_eq!(one.jump(0), None);
}

#[test]
fn stuck_sensor_needs_a_moving_command() {
    let limits = AxisLimits {
        stuck_travel: 0.015,
        ..AxisLimits::NONE.with(Limit::StuckSensor, Bound::trip(3.0))
    };
    let mut still = watch(limits);
    for _ in 0..100 {
        command(&mut still, 0.5);
        assert_eq!(measure(&mut still, 0.5, 7.0).trip, None, "nothing moves");
    }
    let mut moving = watch(limits);
    let ticks = (0..20).take_while(|&k| {
        command(&mut moving, 0.01 * f64::from(k));
        measure(&mut moving, 0.5, 7.0).trip.is_none()
    });
    // Travel exceeds 0.015 m with the command of tick 2; ticks 2, 3 and 4 are allowed.
    assert_eq!(ticks.count(), 5);
    let mut noisy = watch(limits);
    for k in 0..100 {
        command(&mut noisy, 0.01 * f64::from(k));
        let noise = f64::from(k % 2) * 1e-9;
        assert_eq!(measure(&mut noisy, 0.5, 7.0 + noise).trip, None, "it lives");
    }
    // In its play a specimen moves without a force.
    let mut slack = watch(limits);
    for k in 0..100 {
        let disp = 0.01 * f64::from(k);
        command(&mut slack, disp);
        assert_eq!(measure(&mut slack, disp, 0.0).trip, None, "it moves");
    }
}

#[test]
fn a_hit_reads_as_a_sentence() {
    let hit = Hit {
        axis: 1,
        quantity: Limit::MeasuredForce,
        level: Level::Trip,
        value: -120_500.0,
        bound: -120_000.0,
    };
    assert_eq!(
        hit.to_string(),
        "axis 2: measured force -120.5 kN, allowed -120 kN"
    );
}

#[test]
fn hit_shows_the_larger_number() {
    let words = |value: f64| {
        let hit = Hit {
            axis: 0,
            quantity: Limit::CommandStep,
            level: Level::Trip,
            value,
            bound: 1e-5,
        };
        hit.to_string()
    };
    for (value, end) in [
        (1.04e-5, "10.4 µm, allowed 10 µm"),
        (2e-5, "20 µm, allowed 10 µm"),
        (1e-5 + 1e-18, "10.000000000001 µm, allowed 10 µm"),
        (f64::NAN, "NaN m, allowed 10 µm"),
    ] {
        assert!(words(value).ends_with(end), "{}", words(value));
    }
}

#[test]
fn trip_repeats_only_if_it_gets_worse() {
    let limits = AxisLimits::NONE
        .with(Limit::MeasuredForce, range(-100.0, 100.0))
        .with(Limit::MeasuredDisp, range(-1.0, 1.0));
    let mut one = watch(limits);
    assert!(measure(&mut one, 0.0, -110.0).trip.is_some());
    one.excuse(NO_NOISE.map(AtSpecimen).into_iter());
    assert_eq!(measure(&mut one, 0.0, -112.0).trip, None);
    assert!(measure(&mut one, 0.0, -116.0).trip.is_some());
    assert!(
        measure(&mut one, 2.0, -105.0).trip.is_some(),
        "another limit"
    );
}

#[test]
fn trip_excuses_one_side_only() {
    for (trip, at, worse, other) in [
        ([-2.0, 104.0], 104.1, 110.0, -2.1),
        ([-300.0, -50.0], -49.8, -47.0, -301.0),
        ([-300.0, -50.0], -49.8, 49.0, -301.0),
        ([20.0, 104.0], 19.0, 18.0, 105.0),
        ([20.0, 104.0], 19.0, -19.0, 105.0),
    ] {
        let limits = AxisLimits::NONE.with(
            Limit::MeasuredForce,
            Range {
                trip,
                ..Range::NONE
            },
        );
        for again in [worse, other, f64::NAN] {
            let mut one = watch(limits);
            assert!(measure(&mut one, 0.0, at).trip.is_some());
            one.excuse(NO_NOISE.map(AtSpecimen).into_iter());
            assert_eq!(measure(&mut one, 0.0, at).trip, None);
            let hit = measure(&mut one, 0.0, again).trip.unwrap();
            assert!(hit.value == again || again.is_nan());
        }
    }
}

#[test]
fn trips_of_one_tick_are_all_reported() {
    let limits = AxisLimits::NONE
        .with(Limit::MeasuredForce, range(-100.0, 100.0))
        .with(Limit::MeasuredDisp, range(-1.0, 1.0));
    let mut two = Watch::new(vec![limits; 2], 0.1);
    let values = [(-1.1, -110.0), (0.0, 101.0)];
    let found = two.measured(values.into_iter().map(AtSpecimen));
    assert_eq!(what(found.trip), Some((Limit::MeasuredDisp, -1.1)));
    let more: Vec<_> = std::iter::from_fn(|| two.next_untold()).collect();
    let more: Vec<_> = more
        .iter()
        .map(|hit| (hit.axis, hit.quantity, hit.value))
        .collect();
    assert!(found.more);
    assert_eq!(
        more,
        [
            (0, Limit::MeasuredForce, -110.0),
            (1, Limit::MeasuredForce, 101.0)
        ]
    );
    two.excuse(NO_NOISE.map(AtSpecimen).into_iter());
    let found = two.measured(values.into_iter().map(AtSpecimen));
    assert!((found.trip, found.more) == (None, false));
    let worse = two.measured([(-1.1, -110.0), (1.01, 101.0)].into_iter().map(AtSpecimen));
    let trip = worse.trip.unwrap();
    assert_eq!((trip.axis, trip.quantity), (1, Limit::MeasuredDisp));
}

/// Of an actuator that lags: it trips at 1.0 on the way to 1.5, in a specimen of 101 N at 1.0.
#[test]
fn earlier_command_is_still_allowed() {
    let limits = AxisLimits::NONE
        .with(Limit::MeasuredForce, range(-100.0, 100.0))
        .with(Limit::MeasuredDisp, range(-1.2, 1.2))
        .with(
            Limit::SensorForce,
            Range {
                trip: [-140.0, 140.0],
                ..Range::NONE
            },
        );
    let left = |sensor_force: Range| {
        let mut one = watch(limits.with(Limit::SensorForce, sensor_force));
        command(&mut one, 1.5);
        assert!(measure(&mut one, 1.0, 101.0).trip.is_some());
        one.excuse(NO_NOISE.map(AtSpecimen).into_iter());
        command(&mut one, 1.4);
        assert_eq!(measure(&mut one, 1.1, 111.0).trip, None);
        one
    };
    let mut one = left(Range::NONE);
    // Another limit on that way is told and stops nothing.
    let found = measure(&mut one, 1.3, 131.0);
    assert!(found.trip.is_none() && found.is_something());
    let told = |one: &mut Watch| what(one.next_untold());
    assert_eq!(told(&mut one), Some((Limit::MeasuredDisp, 1.3)));
    assert_eq!(told(&mut one), None);
    assert!(!measure(&mut one, 1.5, 151.0).is_something());
    for (disp, force) in [(1.5, 156.0), (1.52, 158.0), (1.4, 141.0)] {
        assert!(!measure(&mut one, disp, force).is_something(), "{disp}");
    }
    assert!(
        measure(&mut one, 1.4, 159.0).trip.is_some(),
        "on its way back"
    );

    let trips = |disp: f64, force: f64| {
        measure(&mut left(limits.get(Limit::SensorForce)), disp, force).trip
    };
    assert_eq!(what(trips(1.3, 131.0)), None);
    assert!(trips(1.51, 131.0).is_some(), "farther than it was sent");
    assert!(trips(1.05, 117.0).is_some(), "it has turned");
    assert!(trips(1.3, f64::NAN).is_some());
    let range = trips(1.3, 141.0);
    assert_eq!(what(range), Some((Limit::SensorForce, 141.0)));
}

/// Two axes of one specimen: the first is on its way from 1.0 to 1.5 when it trips, the second stands.
#[test]
fn axes_feel_each_others_motion() {
    let limits = AxisLimits::NONE
        .with(Limit::MeasuredForce, range(-100.0, 100.0))
        .with(Limit::MeasuredDisp, range(-1.4, 1.4));
    let measure =
        |two: &mut Watch, values: [(f64, f64); 2]| two.measured(values.into_iter().map(AtSpecimen));
    let left = || {
        let mut two = Watch::new(vec![limits; 2], 0.1);
        two.sent([1.5, 0.0].map(AtSpecimen).into_iter());
        let found = measure(&mut two, [(1.0, 101.0), (0.0, 50.0)]);
        assert!(found.trip.is_some());
        two.excuse(NO_NOISE.map(AtSpecimen).into_iter());
        two
    };
    let mut two = left();
    let found = measure(&mut two, [(1.2, 121.0), (0.0, 101.0)]);
    assert!(found.trip.is_none() && found.more);
    let told = two.next_untold().map(|hit| (hit.axis, hit.quantity));
    assert_eq!(told, Some((1, Limit::MeasuredForce)));
    let found = measure(&mut two, [(1.3, 131.0), (0.0, 111.0)]);
    assert_eq!(found, Found::default());
    let found = measure(&mut two, [(1.2, 121.0), (0.0, 117.0)]);
    assert_eq!(found.trip.map(|hit| hit.axis), Some(1), "no test continues");
    // Where an axis is, is its own.
    let found = measure(&mut left(), [(1.2, 121.0), (1.41, 0.0)]);
    assert_eq!(what(found.trip), Some((Limit::MeasuredDisp, 1.41)));
}

/// It trips at 1.0 on the way to 1.5, and its readings stray by some hundredths.
#[test]
fn recent_maximum_excuses_noise() {
    let limits = AxisLimits::NONE
        .with(Limit::MeasuredDisp, range(-1.0, 1.0))
        .with(Limit::MeasuredForce, range(-100.0, 100.0));
    let left = |noise: f64, readings: &[f64]| {
        let mut one = Watch::new(vec![limits], 0.01);
        one.sent(std::iter::once(AtSpecimen(1.5)));
        assert!(measure(&mut one, 1.01, 90.0).trip.is_some());
        one.excuse(std::iter::once(AtSpecimen(noise)));
        for disp in readings {
            assert_eq!(measure(&mut one, *disp, 90.0).trip, None, "{disp}");
        }
        one
    };
    let trips = |noise: f64, readings: &[f64], disp: f64| {
        let hit = measure(&mut left(noise, readings), disp, 101.0).trip;
        hit.is_some()
    };
    assert!(!trips(0.01, &[1.05], 1.02));
    assert!(trips(0.0, &[1.05], 1.04), "it has turned");
    assert!(
        trips(0.01, &[1.1], 1.015),
        "it has turned, beyond the noise"
    );
    assert!(!trips(0.01, &[1.4], 1.54));
    assert!(trips(0.01, &[1.4], 1.585), "farther than it was sent");
    assert!(!trips(0.01, &[1.05, 1.03, 1.04, 1.02, 1.03], 1.04));
    let stuck = [1.05, 1.03, 1.04, 1.02, 1.03, 1.04];
    assert!(trips(0.01, &stuck, 1.04));
    // Whoever comes to its end goes nowhere, whatever its sensor reads.
    let there = [1.5, 1.51, 1.52, 1.53, 1.54, 1.545];
    assert!(trips(0.01, &there, 1.549));
    // Nor does what stood where it was sent to within the noise.
    assert!(trips(0.1, &[], 1.02));
}

/// A command beyond its stroke never left: where the specimen is led it may not go either.
#[test]
fn command_beyond_the_stroke_trips() {
    let limits = AxisLimits::NONE.with(Limit::CommandDisp, range(-1.0, 1.0));
    let mut one = watch(limits);
    assert!(
        one.command(std::iter::once(AtSpecimen(1.01)))
            .trip
            .is_some()
    );
    one.excuse(NO_NOISE.map(AtSpecimen).into_iter());
    assert!(
        one.command(std::iter::once(AtSpecimen(1.005)))
            .trip
            .is_some()
    );
}

#[test]
fn growing_sawtooth_is_counted() {
    let limits = AxisLimits::NONE.with(Limit::Alternation, half(6.0));
    // A smooth motion under a sawtooth of period two ticks: the root of an unstable step is beyond -1.
    let tripped = |growth: f64| {
        let mut one = watch(limits);
        (0..200).position(|k| {
            let smooth = 1e-3 * libm::sin(0.02 * f64::from(k));
            command(&mut one, smooth + 1e-6 * (-growth).powi(k))
                .trip
                .is_some()
        })
    };
    // Second differences exist from the third command, k = 2, on; k = 3 is the first turn, k = 9 the seventh.
    assert_eq!(tripped(1.2), Some(9));
    assert_eq!(tripped(0.99), None);
    let mut warned = watch(limits);
    let first = (0..20).position(|k| {
        command(&mut warned, 1e-6 * (-1.2f64).powi(k))
            .warning
            .is_some()
    });
    assert_eq!(first, Some(6), "the fourth turn, beyond 3");
}

#[test]
fn a_smooth_motion_is_no_sawtooth() {
    let mut smooth = watch(AxisLimits::NONE.with(Limit::Alternation, Bound::trip(3.0)));
    for k in 0..1000 {
        let t = 0.02 * f64::from(k);
        assert_eq!(
            command(&mut smooth, libm::sin(t) + 0.3 * libm::cos(7.0 * t)).trip,
            None
        );
    }
}

#[test]
fn unknown_estimates_trip_nothing() {
    let limits = AxisLimits::NONE
        .with(Limit::StiffnessRatio, half(2.0))
        .with(Limit::DampingRatio, half(4.0))
        .with(Limit::AddedEnergy, half(10.0));
    let judged = |stiffness_ratio, damping_ratio, added_energy| {
        let mut found = Found::default();
        let estimated = [stiffness_ratio, damping_ratio, added_energy];
        watch(limits).estimated(std::iter::once(estimated), &mut found);
        (what(found.warning), what(found.trip))
    };
    assert_eq!(judged(1.0, 2.0, 5.0), (None, None), "the bounds themselves");
    assert_eq!(judged(f64::NAN, f64::NAN, -1e9), (None, None));
    assert_eq!(
        judged(1.01, 0.0, 0.0).0,
        Some((Limit::StiffnessRatio, 1.01))
    );
    assert_eq!(
        judged(2.01, 0.0, 0.0).1,
        Some((Limit::StiffnessRatio, 2.01))
    );
    assert_eq!(judged(0.0, 2.01, 0.0).0, Some((Limit::DampingRatio, 2.01)));
    assert_eq!(judged(0.0, 4.01, 0.0).1, Some((Limit::DampingRatio, 4.01)));
    assert_eq!(judged(0.0, 0.0, 5.01).0, Some((Limit::AddedEnergy, 5.01)));
    assert_eq!(judged(0.0, 0.0, 10.01).1, Some((Limit::AddedEnergy, 10.01)));
}

#[test]
fn broken_sensor_shows_few_digits() {
    let hit = |value: f64, bound: f64| Hit {
        axis: 0,
        quantity: Limit::MeasuredForce,
        level: Level::Trip,
        value,
        bound,
    };
    for (value, bound, told) in [
        (1e300, 4e5, "measured force 1e291 GN, allowed 400 kN"),
        (-3.5e15, -4e5, "measured force -3500000 GN, allowed -400 kN"),
        (1.5, 1.0, "measured force 1.5 N, allowed 1 N"),
    ] {
        assert_eq!(hit(value, bound).to_string(), format!("axis 1: {told}"));
    }
}
