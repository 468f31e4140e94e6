use super::*;
use gusset_actuator::specimen::SpecimenLaw;
use gusset_quantity::time::Nanos;
use gusset_quantity::units::AxisUnits;

fn host(law: &str, axes: usize, nature: Nature) -> Host {
    let law: SpecimenLaw = toml::from_str(law).unwrap();
    let law = Computed::new(law.build(axes).unwrap(), nature == Nature::Physical);
    let (stiffness, mass) = law.reference();
    // Steps are bounded, as the first long step of a physical specimen requires.
    let limits = toml::from_str("command_step_m = { trip = 1.0 }").unwrap();
    let units = vec![AxisUnits::SI; axes];
    let served = ServedSpecimen::new("rig".into(), Box::new(law), units, stiffness, mass);
    let mut host = Host::of(served.limited(&vec![limits; axes]), nature, None);
    host.begin(&controller(), &mut || Ok(())).unwrap();
    host
}

fn controller() -> Controller {
    Controller::unnamed(([127, 0, 0, 1], 1).into())
}

const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";

fn at<'a>(disp: &'a [f64], time: f64) -> Response<'a> {
    Response {
        disp,
        time,
        ..Response::default()
    }
}

#[test]
fn iterations_start_from_the_commit() {
    let mut host = host(BILINEAR, 1, Nature::Simulated);
    host.trial(Course::Step, &at(&[0.03], 0.01), Some(0.01), &mut || true)
        .unwrap();
    let plastic = host.response().force[0];
    // 60 at 7.5 mm, then 400 N/m.
    assert!((plastic - (60.0 + 400.0 * 0.0225)).abs() < 1e-9);
    host.trial(
        Course::Iteration,
        &at(&[0.005], 0.01),
        Some(0.01),
        &mut || true,
    )
    .unwrap();
    assert!((host.response().force[0] - 40.0).abs() < 1e-12);
    host.trial(Course::Repeat, &at(&[0.005], 0.01), Some(0.01), &mut || {
        true
    })
    .unwrap();
    assert!((host.response().force[0] - 40.0).abs() < 1e-12);
    host.commit();
    host.commit();
    assert_eq!(host.tally().commands, 3);
    assert_eq!(host.tally().commits, 2);
}

#[test]
fn formula_skips_a_repeated_command() {
    for (nature, evaluated) in [(Nature::Simulated, 1), (Nature::Physical, 2)] {
        let mut host = host(BILINEAR, 1, nature);
        for course in [Course::Step, Course::Repeat] {
            host.trial(course, &at(&[0.005], 0.01), Some(0.01), &mut || true)
                .unwrap();
        }
        assert_eq!(host.sequence, evaluated);
        assert!((host.response().force[0] - 40.0).abs() < 1e-12);
    }
}

#[test]
fn falling_load_factor_is_no_step_length() {
    let law: SpecimenLaw =
        toml::from_str("law = { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 50.0 } }")
            .unwrap();
    let law = law.build(1).unwrap();
    let mut host = Host::new(law, Nature::Simulated, Some(0.1));
    host.begin(&controller(), &mut || Ok(())).unwrap();
    host.trial(
        Course::Iteration,
        &at(&[0.02], 40.0),
        Some(-7.0),
        &mut || true,
    )
    .unwrap();
    // One step as configured.
    assert!((host.response().force[0] - 10.0).abs() < 1e-12);
}

#[test]
fn formula_follows_past_the_last_commit() {
    for nature in [Nature::Simulated, Nature::Physical] {
        let mut host = host(BILINEAR, 1, nature);
        host.trial(Course::Step, &at(&[0.004], 0.02), Some(0.02), &mut || true)
            .unwrap();
        host.commit();
        let back = host.trial(
            Course::Reversed,
            &at(&[0.003], 0.01),
            Some(0.0),
            &mut || true,
        );
        match nature {
            Nature::Simulated => {
                back.unwrap();
                assert!((host.response().force[0] - 24.0).abs() < 1e-12);
                assert_eq!(host.tally().taken_back, 1);
            }
            Nature::Physical => assert_eq!(back, Err(HostFault::Reversed { time: 0.01 })),
        }
    }
}

#[test]
fn only_later_times_count_as_new_commands() {
    let mut host = host(BILINEAR, 1, Nature::Simulated);
    for test in 0..2 {
        // A step of three tries, one that is taken back and cut, and the next one.
        let sign = [1.0, -1.0][test];
        for time in [0.0, 0.01, 0.01, 0.01, 0.0, 0.005, 0.01, 0.02] {
            let disp = [time];
            let command = at(&disp, sign * time);
            host.trial(Course::Iteration, &command, None, &mut || true)
                .unwrap();
        }
        assert_eq!(host.tally().later_times, 2, "{test}");
        host.begin(&controller(), &mut || Ok(())).unwrap();
        assert_eq!(host.tally().later_times, 0);
    }
}

#[test]
fn impossible_time_is_refused() {
    let mut host = host(BILINEAR, 1, Nature::Simulated);
    for time in [1e300, -1e300] {
        let fault = host.trial(Course::Step, &at(&[0.001], time), Some(time), &mut || true);
        assert_eq!(fault, Err(HostFault::Leap { time }));
    }
}

#[test]
fn tiny_step_passes_no_missing_limit() {
    for time in [5e-324, 1e-200] {
        let mut host = host(BILINEAR, 1, Nature::Simulated);
        for _ in 0..2 {
            host.trial(Course::Step, &at(&[time], time), Some(time), &mut || true)
                .unwrap();
            host.commit();
        }
    }
}

#[test]
fn step_taken_back_is_refused_if_it_moved() {
    for nature in [Nature::Simulated, Nature::Physical] {
        // Trials of physical specimens are judged elsewhere.
        let mut host = host(BILINEAR, 1, nature).iterating_within(Some(1.0));
        host.trial(Course::First, &at(&[0.0], 0.0), Some(0.0), &mut || true)
            .unwrap();
        host.trial(Course::Step, &at(&[0.004], 0.01), Some(0.01), &mut || true)
            .unwrap();
        host.commit();
        host.trial(Course::Step, &at(&[0.5], 0.02), Some(0.01), &mut || true)
            .unwrap();
        let back = host.trial(
            Course::TakenBack,
            &at(&[0.004], 0.01),
            Some(0.0),
            &mut || true,
        );
        match nature {
            Nature::Simulated => {
                back.unwrap();
                assert!((host.response().force[0] - 32.0).abs() < 1e-12);
            }
            Nature::Physical => {
                assert_eq!(back, Err(HostFault::TakenBack { time: 0.01 }));
                assert_eq!(host.motion.committed_disp, [0.004]);
            }
        }
        host.trial(Course::Step, &at(&[0.006], 0.015), Some(0.005), &mut || {
            true
        })
        .unwrap();
        assert!((host.response().force[0] - 48.0).abs() < 1e-12);
    }
}

#[test]
fn new_client_finds_a_formula_virgin() {
    for (nature, left) in [(Nature::Simulated, 0.0), (Nature::Physical, 69.0)] {
        let mut host = host(BILINEAR, 1, nature);
        host.trial(Course::Step, &at(&[0.03], 0.01), Some(0.01), &mut || true)
            .unwrap();
        host.commit();
        host.begin(&controller(), &mut || Ok(())).unwrap();
        assert!((host.response().force[0] - left).abs() < 1e-9);
    }
}

#[test]
fn uncommitted_steps_of_a_formula_vanish() {
    for (nature, stands, force) in [
        (Nature::Simulated, 0.0, 0.0),
        (Nature::Physical, 0.01, 61.0),
    ] {
        let mut host = host(BILINEAR, 1, nature);
        host.trial(Course::Step, &at(&[0.005], 0.01), Some(0.01), &mut || true)
            .unwrap();
        host.commit();
        host.trial(Course::Step, &at(&[0.01], 0.02), Some(0.01), &mut || true)
            .unwrap();
        host.end(Cause::Protocol, "");
        host.begin(&controller(), &mut || Ok(())).unwrap();
        assert_eq!(host.response().disp, [stands]);
        assert!((host.response().force[0] - force).abs() < 1e-9);
    }
}

/// A physical specimen, within limits.
fn limited(limits: &str) -> Host {
    let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
    let law = Computed::new(law.build(1).unwrap(), true);
    let limits = toml::from_str(limits).unwrap();
    let units = vec![AxisUnits::SI];
    let served = ServedSpecimen::new("rig".into(), Box::new(law), units, vec![8e3], vec![0.0]);
    Host::of(served.limited(&[limits]), Nature::Physical, None)
}

#[test]
fn first_command_steps_from_the_position() {
    let mut host = limited("command_step_m = { trip = 0.00101 }");
    host.begin(&controller(), &mut || Ok(())).unwrap();
    for k in 1..=40 {
        let time = 0.01 * f64::from(k);
        let command = [1e-3 * f64::from(k)];
        host.trial(Course::Step, &at(&command, time), Some(0.01), &mut || true)
            .unwrap();
        host.commit();
    }
    host.end(Cause::Done, "");
    // As genericClient does: it begins at zero, at any position of the specimen.
    let told = host.begin(&controller(), &mut || Ok(())).unwrap();
    assert!(told.iter().any(|text| text.contains(" 40 mm")));
    assert_eq!(host.response().disp, [0.04]);
    let fault = host.trial(Course::First, &at(&[0.0], 0.0), None, &mut || true);
    let text = host.whole(fault.unwrap_err());
    assert!(text.contains("command_step_m"), "{text}");
    assert!(text.contains(" 40 mm"), "{text}");
    host.end(Cause::Protocol, "");
    let over = host.begin(&controller(), &mut || Ok(())).unwrap_err();
    assert!(over.text.contains("command_step_m"), "{}", over.text);
    host.served.latch().clear().unwrap();
    host.begin(&controller(), &mut || Ok(())).unwrap();
    host.trial(Course::First, &at(&[0.0395], 0.0), None, &mut || true)
        .unwrap();
    let fault = host.trial(Course::Step, &at(&[0.0], 0.01), Some(0.01), &mut || true);
    let text = host.whole(fault.unwrap_err());
    assert!(!text.contains("stands"), "{text}");
}

#[test]
fn unbounded_first_step_is_small() {
    for (limits, holds, trips) in [
        ("command_disp_m = { trip = [-0.05, 0.05] }", 0.0049, 0.0051),
        (
            "command_disp_m = { warn = [-0.05, 0.05] }",
            0.00099,
            0.00101,
        ),
        (
            "measured_force_n = { trip = [-900, 900] }",
            0.00099,
            0.00101,
        ),
        ("command_step_m = { trip = 0.02 }", 0.019, 0.021),
        // A bound of the speed bounds the step of a tick, too.
        ("command_vel_m_per_s = { trip = 10.0 }", 0.05, 0.11),
    ] {
        for disp in [holds, trips] {
            let mut host = limited(limits);
            host.begin(&controller(), &mut || Ok(())).unwrap();
            let outcome = host.trial(Course::First, &at(&[disp], 0.0), None, &mut || true);
            assert_eq!(
                outcome.is_ok(),
                disp == holds,
                "{limits} {disp}: {outcome:?}"
            );
            if outcome.is_ok() {
                host.commit();
                // Later commands are not judged like this.
                let next = [disp.mul_add(2.0, 1e-4)];
                let next = host.trial(Course::Step, &at(&next, 0.01), Some(0.01), &mut || true);
                assert!(next.is_ok(), "{limits}: {next:?}");
            }
        }
    }
    // A formula is not moved.
    let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
    let mut host = Host::new(law.build(1).unwrap(), Nature::Simulated, None);
    host.begin(&controller(), &mut || Ok(())).unwrap();
    host.trial(Course::First, &at(&[0.04], 0.0), None, &mut || true)
        .unwrap();
}

#[test]
fn physical_speed_uses_wall_time() {
    // A millimetre in 0.02 s of test time, every 0.02 s or every 0.2 ms.
    for (period_ns, holds) in [(20_000_000, true), (200_000, false)] {
        let mut host = limited("command_vel_m_per_s = { trip = 0.11 }");
        host.begin(&controller(), &mut || Ok(())).unwrap();
        let tripped = (1..=40_u32).any(|k| {
            host.served.now_is(Nanos(u64::from(k) * period_ns));
            let (disp, time) = ([1e-3 * f64::from(k)], 0.02 * f64::from(k));
            let outcome = host.trial(Course::Step, &at(&disp, time), Some(0.02), &mut || true);
            host.commit();
            outcome.is_err()
        });
        assert_eq!(tripped, !holds, "every {period_ns} ns");
    }
}

#[test]
fn missing_velocity_is_a_difference() {
    let mut host = host(
        "law = { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 50.0 } }",
        1,
        Nature::Simulated,
    );
    host.trial(Course::Step, &at(&[0.02], 0.1), Some(0.1), &mut || true)
        .unwrap();
    assert!((host.response().force[0] - 10.0).abs() < 1e-12);
    // Time that does not pass drives no rate effect.
    host.trial(
        Course::Iteration,
        &at(&[0.04], 0.0),
        Some(-1.0),
        &mut || true,
    )
    .unwrap();
    assert_eq!(host.response().force[0], 0.0);
}

#[test]
fn step_begins_with_the_last_tangent() {
    let mut host = host(BILINEAR, 1, Nature::Simulated);
    for (disp, tangent) in [(0.005, 8e3), (0.03, 400.0), (0.03, 400.0), (0.029, 8e3)] {
        host.trial(Course::Step, &at(&[disp], 0.01), Some(0.01), &mut || true)
            .unwrap();
        assert_eq!(host.matrix(Matrix::TangentStiffness), [tangent], "{disp}");
        host.commit();
    }
}

#[test]
fn matrices_come_row_by_row() {
    let law = "coupled = { stiffness_n_per_m = [[2.0, -1.0], [-1.0, 3.0]] }";
    let mut host = host(law, 2, Nature::Simulated);
    assert_eq!(
        host.matrix(Matrix::InitialStiffness),
        [2.0, -1.0, -1.0, 3.0]
    );
    assert_eq!(
        host.matrix(Matrix::TangentStiffness),
        [2.0, -1.0, -1.0, 3.0]
    );
    assert_eq!(host.matrix(Matrix::Mass), [0.0; 4]);
}

#[test]
fn second_target_trips_a_physical_specimen() {
    let go = |host: &mut Host, course, disp: f64, time: f64| {
        host.trial(course, &at(&[disp], time), Some(0.01), &mut || true)
    };
    for (nature, within) in [
        (Nature::Simulated, None),
        (Nature::Physical, None),
        (Nature::Physical, Some(0.0005)),
    ] {
        let mut host = host(BILINEAR, 1, nature).iterating_within(within);
        go(&mut host, Course::First, 0.0, 0.0).unwrap();
        go(&mut host, Course::Step, 0.004, 0.01).unwrap();
        go(&mut host, Course::Repeat, 0.004, 0.01).unwrap();
        host.commit();
        go(&mut host, Course::Step, 0.005, 0.02).unwrap();
        let near = go(&mut host, Course::Iteration, 0.0054, 0.02);
        let far = go(&mut host, Course::Iteration, 0.0056, 0.02);
        let fault = |outcome| match outcome {
            Err(HostFault::Tripped(Trip::Trial(fault))) => Some(fault),
            _ => None,
        };
        match (nature, within) {
            (Nature::Simulated, _) => assert!(near.is_ok() && far.is_ok()),
            (Nature::Physical, None) => {
                assert!((fault(near).unwrap().distance - 0.0004).abs() < 1e-12);
                assert!(far.is_err(), "it holds");
            }
            (Nature::Physical, Some(_)) => {
                assert!(near.is_ok());
                let fault = fault(far).unwrap();
                assert!((fault.distance - 0.0006).abs() < 1e-12 && fault.within == within);
                assert_eq!(
                    host.whole(HostFault::Tripped(Trip::Trial(fault)))
                        .lines()
                        .count(),
                    1
                );
            }
        }
    }
}
