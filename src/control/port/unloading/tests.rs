use std::f64::consts::TAU;

use super::*;

const TICK: f64 = 1e-3;
const STIFFNESS: f64 = 2e5;

const LEG: Leg = Leg {
    largest: 0.0,
    noise: 0.0,
    meant: [f64::NEG_INFINITY, f64::INFINITY],
    jump: None,
    by_speed: 0.05 * TICK,
    slew: f64::INFINITY,
};

/// How a way went: where it ended, of how many ticks, the largest forces on it, and why it ended.
struct End {
    at: Vec<f64>,
    ticks: u32,
    peaks: Vec<f64>,
    outcome: Result<(), UnloadFailure>,
}

/// From `at` with these axes and stiffness; `specimen` answers a command in a tick with displacements and forces as measured.
fn unload(
    legs: &[Leg],
    stiffness: &[f64],
    tick: f64,
    mut at: Vec<f64>,
    mut specimen: impl FnMut(u32, &[f64]) -> Vec<(f64, f64)>,
) -> End {
    let mut unloading = Unloading::new(legs.to_vec(), stiffness.to_vec(), tick);
    let (mut ticks, mut peaks) = (0, vec![0.0_f64; at.len()]);
    let mut answer: Option<Vec<(f64, f64)>> = None;
    while unloading.go_on(answer.take().map(Vec::into_iter)) {
        for (at, step) in at.iter_mut().zip(unloading.steps()) {
            *at -= step;
        }
        let measured = specimen(ticks, &at);
        for (peak, (_, force)) in peaks.iter_mut().zip(&measured) {
            *peak = peak.max(force.abs());
        }
        answer = Some(measured);
        ticks += 1;
    }
    End {
        at,
        ticks,
        peaks,
        outcome: unloading.end().unwrap(),
    }
}

/// One spring, from 10 mm, whose load cell says something else: of the tick and the force.
fn spring(leg: Leg, cell: impl Fn(u32, f64) -> f64) -> End {
    unload(&[leg], &[STIFFNESS], TICK, vec![0.01], |tick, at| {
        vec![(at[0], cell(tick, STIFFNESS * at[0]))]
    })
}

#[test]
fn no_single_answer_decides_where_it_goes() {
    for glitch in [0.0, -5e3, 2e5] {
        for at in [0, 1, 60, 110, 111, 400] {
            let end = spring(LEG, |tick, force| if tick == at { glitch } else { force });
            assert_eq!(end.outcome, Ok(()), "{glitch} in tick {at}");
            assert!(
                end.at[0].abs() <= 2e-4,
                "{glitch} in tick {at}: {}",
                end.at[0]
            );
        }
    }
}

#[test]
fn stuck_load_cell_ends_by_the_stiffness() {
    let end = spring(LEG, |_, _| 2e3);
    assert_eq!(end.outcome, Err(UnloadFailure::DoesNotFollow));
    assert!(end.at[0] <= 0.0 && end.at[0] >= -0.003, "{}", end.at[0]);
    // It hangs on the way.
    let end = spring(LEG, |_, force| force.max(1.9e3));
    assert_eq!(end.outcome, Err(UnloadFailure::DoesNotFollow));
}

/// Five times as soft as believed: its force follows, and is still there where the stiffness says that it is gone.
#[test]
fn soft_specimen_unloads_three_times_as_far() {
    let end = unload(&[LEG], &[STIFFNESS], TICK, vec![0.01], |_, at| {
        vec![(at[0], STIFFNESS / 5.0 * at[0])]
    });
    assert_eq!(end.outcome, Err(UnloadFailure::TooFar));
    // 2 mm by k̂, of a force that may be off by a twentieth.
    let gone = 0.01 - end.at[0];
    assert!(gone > 5.9e-3 && gone <= 3.0 * 2.1e-3 + 1e-12, "{gone}");
}

#[test]
fn growing_force_is_not_followed() {
    let end = spring(LEG, |_, force| -force);
    assert_eq!(end.outcome, Err(UnloadFailure::Grows));
    assert!(end.at[0] <= 0.014, "{}", end.at[0]);
}

#[test]
fn sudden_zero_force_is_no_arrival() {
    for last in [150, 163, 200, 250] {
        let end = spring(LEG, |tick, force| if tick < last { force } else { 0.0 });
        assert_eq!(end.outcome, Err(UnloadFailure::Fell), "{last}");
    }
    // Ten times as stiff as believed, and thirty.
    for times in [10.0, 30.0] {
        let end = unload(&[LEG], &[STIFFNESS / times], TICK, vec![0.01], |_, at| {
            vec![(at[0], STIFFNESS * at[0])]
        });
        assert_eq!(end.outcome, Ok(()), "{times}");
        assert!(end.at[0].abs() <= 2e-4, "{times}: {}", end.at[0]);
    }
}

#[test]
fn force_jump_is_not_followed() {
    let leg = Leg {
        jump: Some([2e3, 500.0]),
        ..LEG
    };
    for offset in [-2e3, 5e3, -4e3] {
        let end = spring(leg, |_, force| force + offset);
        assert_eq!((end.outcome, end.at[0]), (Err(UnloadFailure::Jumped), 0.01));
    }
    let back = spring(leg, |tick, force| if tick < 3 { 0.0 } else { force });
    assert_eq!(back.outcome, Ok(()));
}

/// An actuator of second order that resonates at `hz`: the loop gain of the first approach is far above one.
#[test]
fn resonance_is_not_driven() {
    for (hz, damping) in [(10.0, 0.03), (10.0, 0.05), (5.0, 0.1), (20.0, 0.02)] {
        let (omega, mut disp, mut vel) = (TAU * hz, 0.01, 0.0);
        let end = unload(&[LEG], &[STIFFNESS], TICK, vec![0.01], |_, at| {
            for _ in 0..20 {
                let dt = TICK / 20.0;
                vel += dt * omega * (omega * (at[0] - disp) - 2.0 * damping * vel);
                disp += dt * vel;
            }
            vec![(disp, STIFFNESS * disp)]
        });
        assert_eq!(end.outcome, Ok(()), "{hz} Hz");
        assert!(end.peaks[0] <= 2.01e3, "{hz} Hz: {}", end.peaks[0]);
        let swing = libm::hypot(disp, vel / omega);
        assert!(swing <= 3e-4, "{hz} Hz: {swing}");
    }
}

/// Two storeys, [[2k, −k], [−k, k]], with a force on the upper one alone: on the way of the stiffness none comes on the lower.
#[test]
fn coupled_axes_go_together() {
    let k = STIFFNESS;
    let stiffness = [2.0 * k, -k, -k, k];
    let end = unload(&[LEG; 2], &stiffness, TICK, vec![0.01, 0.02], |_, at| {
        let lower = k * at[0] - k * (at[1] - at[0]);
        vec![(at[0], lower), (at[1], k * (at[1] - at[0]))]
    });
    assert_eq!(end.outcome, Ok(()));
    assert!(
        end.peaks[0] <= 1.0 && end.peaks[1] <= 2e3 + 1.0,
        "{:?}",
        end.peaks
    );
    assert!(end.at.iter().all(|at| at.abs() <= 5e-4), "{:?}", end.at);
    // One that knows of no other, and is not loaded, stays.
    let alone = unload(
        &[LEG; 2],
        &[k, 0.0, 0.0, k],
        TICK,
        vec![0.0, 0.01],
        |_, at| vec![(at[0], k * at[0]), (at[1], k * at[1])],
    );
    assert_eq!((alone.outcome, alone.at[0]), (Ok(()), 0.0));
}

/// Two axes on one stiff storey, [[k + c, −k], [−k, k]]: what one of them takes away the other brings, hundreds of times the force
/// that there is.
#[test]
fn what_nearly_cancels_is_no_force() {
    let (k, soft) = (1e9, 5e6);
    let stiffness = [k + soft, -k, -k, k];
    let specimen = |_, at: &[f64]| {
        let between = k * (at[1] - at[0]);
        vec![(at[0], soft * at[0] - between), (at[1], between)]
    };
    let from = vec![0.006, 0.006 + 18e3 / k];
    let end = unload(&[LEG; 2], &stiffness, TICK, from, specimen);
    assert_eq!(end.outcome, Ok(()));
    for (_, force) in specimen(0, &end.at) {
        assert!(force.abs() <= 200.0, "{force}");
    }
    assert!(
        end.peaks.iter().all(|peak| *peak <= 18.1e3),
        "{:?}",
        end.peaks
    );
}

/// What an acceleration limit takes from one axis it takes from all: no force grows.
#[test]
fn slow_start_slows_all_axes() {
    let stiffness = [130e6, -250e6, -250e6, 505e6];
    let specimen = |_, at: &[f64]| {
        let force = |row: &[f64]| row[0] * at[0] + row[1] * at[1];
        vec![
            (at[0], force(&stiffness[..2])),
            (at[1], force(&stiffness[2..])),
        ]
    };
    for slew in [0.15e-6, 0.5e-6] {
        let leg = Leg { slew, ..LEG };
        let end = unload(&[leg; 2], &stiffness, TICK, vec![0.03, 0.015], specimen);
        assert_eq!(end.outcome, Ok(()), "{slew}");
        let began = specimen(0, &[0.03, 0.015]);
        for (peak, (_, first)) in end.peaks.iter().zip(began) {
            assert!(*peak <= 1.01 * first.abs(), "{slew}: {peak} beside {first}");
        }
    }
}

/// Four actuators on three coordinates: between them there is a force without a stiffness, and nobody runs after it.
#[test]
fn unknown_direction_is_not_moved() {
    let k = STIFFNESS;
    // Two side by side that share one coordinate: pᵀ k p with p = (½, ½).
    let share = 0.25 * k;
    let stiffness = [share, share, share, share];
    let end = unload(&[LEG; 2], &stiffness, TICK, vec![0.01, 0.01], |_, at| {
        let force = share * (at[0] + at[1]);
        vec![(at[0], force + 5.0), (at[1], force - 5.0)]
    });
    assert_eq!(end.outcome, Ok(()));
    assert!(end.at.iter().all(|at| at.abs() <= 2e-4), "{:?}", end.at);
}

#[test]
fn a_slow_way_has_the_time_that_it_takes() {
    // 150 mm at 1 mm/s with ticks of 10 ms, and 10 mm with ticks of 5 s.
    for (by_speed, tick, from) in [(1e-5, 0.01, 0.15), (0.25, 5.0, 0.01)] {
        let leg = Leg { by_speed, ..LEG };
        let end = unload(&[leg], &[STIFFNESS], tick, vec![from], |_, at| {
            vec![(at[0], STIFFNESS * at[0])]
        });
        assert_eq!(end.outcome, Ok(()), "{tick}: {} ticks", end.ticks);
        assert!(end.at[0] <= 0.011 * from, "{tick}: {}", end.at[0]);
    }
    // A force that no motion takes away is not followed for ever.
    let end = spring(LEG, |tick, force| {
        force + 0.5 * f64::from(tick) * LEG.by_speed * STIFFNESS
    });
    assert!(end.outcome.is_err() && end.ticks < 130_000, "{}", end.ticks);
}
