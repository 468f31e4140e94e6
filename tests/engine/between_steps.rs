//! Commands and rows between two steps of a test with many ticks a step: numbers, times, velocities, the pace of a hold.

use std::sync::{Arc, Mutex};

use crate::common::engine::{Run, prepare, run, run_under};
use crate::common::spring::Spring;
use gusset_control::engine::{Control, Operator, Phase};
use gusset_control::port::{Axis, AxisSpec, PortSpec, Stage};
use gusset_quantity::time::SimClock;

const DT: f64 = 0.01;
const TICKS: u32 = 8;
const WARM_UP: usize = 3;
const STIFFNESS: f64 = 2e5;

/// Test time, Δt, displacement and velocity of every command.
type Heard = Arc<Mutex<Vec<[f64; 4]>>>;

/// A frame on the near spring, `steps` steps of 10 ms with 8 ticks each.
fn frame(steps: u32, says: &[(usize, Operator)]) -> (Run, Vec<[f64; 4]>) {
    let (run, commands, _) = frame_with(steps, says, None);
    (run, commands)
}

/// Runs the frame with a far spring in the upper storey, whose answer to every fifth command takes `late` polls. Also returns how
/// many commands the near spring had received at each command of the far one.
fn frame_with(
    steps: u32,
    says: &[(usize, Operator)],
    late: Option<u32>,
) -> (Run, Vec<[f64; 4]>, Vec<usize>) {
    let text = format!(
        "safety.ease_s = 0\n[time]\nstep_s = {DT}\nduration_s = {}\nclock = \"simulated\"\nticks_per_step = {TICKS}\n\
         [integrator]\nlambda = 2\n[structure.shear_building]\nmass_kg = [2e3, 2e3]\nstiffness_n_per_m = [3e5, 3e5]\n\
         [excitation.ground_acceleration.signal.sine]\namplitude = 5\nfrequency_hz = 1\nphase_rad = 1\n[timing]\n\
         warmup_ticks = {WARM_UP}\n",
        f64::from(steps) * DT
    );
    let mut experiment = prepare(&text).experiment;
    let (ask, requests) = crossbeam_channel::bounded(8);
    let heard = Heard::default();
    let (says, near) = (says.to_vec(), Arc::clone(&heard));
    let spring = Spring::new(STIFFNESS, move |command| {
        let mut heard = near.lock().unwrap();
        for (_, word) in says.iter().filter(|(at, _)| *at == heard.len()) {
            ask.send(*word).unwrap();
        }
        heard.push([command.time, command.dt, command.disp[0], command.vel[0]]);
    });
    let axis = Axis::plain(vec![(0, 1.0)]);
    let port = PortSpec::new(
        "spring",
        Box::new(spring),
        2,
        vec![AxisSpec::new(axis, STIFFNESS)],
    )
    .build();
    experiment.ports.push(port.unwrap());
    let told: Arc<Mutex<Vec<usize>>> = Arc::default();
    if let Some(late) = late {
        let (near, told) = (Arc::clone(&heard), Arc::clone(&told));
        let far = Spring::new(1e5, move |_| {
            told.lock().unwrap().push(near.lock().unwrap().len());
        });
        let far = far.answering(move |looks, told| !told.is_multiple_of(5) || looks > late);
        let axis = Axis::plain(vec![(0, -1.0), (1, 1.0)]);
        let axes = vec![AxisSpec::new(axis, 1e5)];
        let mut spec = PortSpec::new("far", Box::new(far), 2, axes);
        spec.per_step = true;
        experiment.ports.push(spec.build().unwrap());
    }
    let run = run_under(experiment, SimClock::new(), &Control::from(requests));
    let commands = heard.lock().unwrap().split_off(WARM_UP);
    let told = told.lock().unwrap();
    let told = told.iter().skip(WARM_UP).map(|near| near - WARM_UP);
    let told = told.collect();
    (run, commands, told)
}

/// A specimen that is commanded once a step is held before it reaches the target of the step. The step needs the force at the
/// target, so the target is sent once more.
#[test]
fn a_target_that_is_not_reached_is_repeated() {
    let run_with = |held: Option<usize>| {
        let text = format!(
            "[time]\nstep_s = {DT}\nduration_s = 0.3\nclock = \"simulated\"\nticks_per_step = {TICKS}\n[integrator]\nlambda = 2\n\
             [structure.shear_building]\nmass_kg = [2e3]\nstiffness_n_per_m = [3e5]\n\
             [excitation.ground_acceleration.signal.sine]\namplitude = 5\nfrequency_hz = 1\nphase_rad = 1\n[timing]\n\
             warmup_ticks = {WARM_UP}\n"
        );
        let mut experiment = prepare(&text).experiment;
        let told: Arc<Mutex<Vec<f64>>> = Arc::default();
        let hears = Arc::clone(&told);
        let mut spring = Spring::new(STIFFNESS, move |command| {
            hears.lock().unwrap().push(command.disp[0]);
        });
        if let Some(number) = held {
            spring = spring.held_on_the_way(number);
        }
        let axis = Axis::plain(vec![(0, 1.0)]);
        let axes = vec![AxisSpec::new(axis, STIFFNESS)];
        let mut spec = PortSpec::new("slow", Box::new(spring), 1, axes);
        spec.per_step = true;
        let port = spec.build().unwrap();
        experiment.ports.push(port);
        let run = run_under(
            experiment,
            SimClock::new(),
            &Control::from(crossbeam_channel::never()),
        );
        let told = told.lock().unwrap().clone();
        (run, told)
    };
    let at_steps = |run: &Run| {
        let rows = run.all("state").into_iter().zip(run.all("x1"));
        let closed = rows.filter(|(state, _)| *state == Phase::Running.code());
        closed.map(|(_, disp)| disp.to_bits()).collect::<Vec<_>>()
    };
    let (plain, told) = run_with(None);
    let number = WARM_UP + 15;
    let (held, again) = run_with(Some(number));
    assert_eq!(again.len(), told.len() + 1);
    assert_eq!(again[number].to_bits(), again[number - 1].to_bits());
    assert_eq!(at_steps(&held), at_steps(&plain));
    assert_eq!(held.outcome.ending, plain.outcome.ending);
}

#[test]
fn ticks_share_their_step_evenly() {
    let (run, commands) = frame(100, &[]);
    let columns = ["step", "sub_tick", "state", "time"].map(|name| run.all(name));
    let rows = columns[0].len();
    assert_eq!((rows, commands.len()), (100 * 8 + 1, 100 * 8 + 1));
    for row in 0..rows {
        let [step, sub_tick, state, time] = [0, 1, 2, 3].map(|column| columns[column][row]);
        let (closed, since) = ((row / 8) as f64, (row % 8) as f64);
        assert_eq!((step, sub_tick), (closed, since), "row {row}");
        let expected = if since == 0.0 {
            Phase::Running.code()
        } else {
            Stage::Correct.code()
        };
        assert_eq!(state, expected, "row {row}");
        // A few roundings of a time below 1 s.
        let share = (closed + since / 8.0) * DT;
        assert!((time - share).abs() < 1e-14, "row {row}: {time} {share}");
        let [sent_at, dt, ..] = commands[row];
        assert_eq!(sent_at, time, "row {row}");
        let way = if row == 0 { 0.0 } else { DT / 8.0 };
        assert!((dt - way).abs() < 1e-14, "row {row}: {dt}");
    }
}

/// The response is mostly 1 Hz, and at most 3.2 Hz (the second mode). Over a tick of 1.25 ms a central difference is off by (2π 3.2
/// · 1.25e-3)²/6, 1e-4. Where two cubics meet at a target, it is off by a quarter of the jump of their second derivative over a
/// tick, third order in a step: (2π 3.2 · 1e-2)³/8, 1e-3. Where a prediction ends in the middle of a step, its error, a third of
/// the third difference, is made up for in half a step. With f Hz this is 6 · (2π f · 1e-2)³/3 / 0.5² of the amplitude per step²,
/// times a quarter of a tick, over 2π f · 1e-2: 1e-3 for 1 Hz, 1e-2 for 3.2 Hz. A path from elsewhere would jump by the
/// prediction's error within two ticks: several times that.
#[test]
fn velocity_is_the_slope_of_the_command() {
    // Known at once, and known only in the fourth tick of the step.
    for late in [None, Some(11)] {
        let (run, commands, _) = frame_with(100, &[], late);
        let predicts = |state: &&f64| **state == Stage::Predict.code();
        let predicted = run.all("state").iter().filter(predicts).count();
        assert!(late.is_none() || predicted > 50, "{predicted}");
        is_smooth(&commands, if late.is_some() { 1e-2 } else { 5e-3 });
    }
}

fn is_smooth(commands: &[[f64; 4]], allowed: f64) {
    let peak = commands.iter().fold(0.0f64, |m, [.., v]| m.max(v.abs()));
    let tick = DT / f64::from(TICKS);
    // From rest with a jerk: a parabola through the first four targets cannot predict the next ones.
    for k in 32..commands.len() - 1 {
        let slope = (commands[k + 1][2] - commands[k - 1][2]) / (2.0 * tick);
        let off = (commands[k][3] - slope).abs() / peak;
        assert!(off < allowed, "tick {k}: {off}");
    }
    assert!(peak > 0.1, "{peak}");
}

#[test]
fn hold_between_two_steps_moves_nothing() {
    let (plain, _) = frame(20, &[]);
    // In the middle of a step, for 30 ticks.
    let at = WARM_UP + 8 * 10 + 3;
    let (held, commands) = frame(20, &[(at, Operator::Hold), (at + 30, Operator::Continue)]);
    let (state, sub_tick, step) = (held.all("state"), held.all("sub_tick"), held.all("step"));
    let standing: Vec<usize> = (0..state.len())
        .filter(|row| state[*row] == Phase::Holding.code())
        .collect();
    assert!((28..=31).contains(&standing.len()), "{}", standing.len());
    let (first, last) = (standing[0], standing[standing.len() - 1]);
    assert_eq!(last - first + 1, standing.len());
    // Between the step before and the step after each row there is one tick more.
    let before = (0..first).rev().find(|row| state[*row] == 3.0).unwrap();
    let behind = (last..state.len()).find(|row| state[*row] == 3.0).unwrap();
    for (count, row) in (before..behind).enumerate() {
        assert_eq!(
            (sub_tick[row], step[row]),
            (count as f64, 10.0),
            "row {row}"
        );
    }
    assert_eq!(sub_tick[behind], 0.0);
    for row in &standing {
        assert_eq!(
            commands[*row][1..3],
            [0.0, commands[first - 1][2]],
            "row {row}"
        );
    }
    for column in ["x1", "v2", "force_1_1", "target_1_1", "time"] {
        assert_eq!(held.column(column), plain.column(column), "{column}");
    }
}

/// A specimen that answers long after the target was reached: the others wait at four fifths of a step, and return to their pace
/// over a fifth of one.
#[test]
fn pace_returns_gradually_after_a_slow_down() {
    let (run, commands, _) = frame_with(30, &[], Some(45));
    assert_eq!(run.column("x1").len(), 31);
    let way = |row: usize| commands[row][1] / (DT / f64::from(TICKS));
    let state = run.all("state");
    let mut recovered = 0;
    for row in 1..state.len() - 1 {
        if state[row] == Phase::Running.code() && state[row - 1] == Stage::SlowDown.code() {
            // The target is known from here on; the motion begins slowly.
            let way = way(row + 1);
            assert!(way < 0.1, "row {row}: {way}");
            recovered += 1;
        }
    }
    assert!(recovered > 4, "{recovered}");
    assert_eq!(run.column("meas_1_1"), run.column("target_1_1"));
    let force: Vec<f64> = run.column("target_1_1");
    let force: Vec<f64> = force.iter().map(|disp| STIFFNESS * disp).collect();
    assert_eq!(run.column("force_1_1"), force);
}

/// A specimen is slow with its last answer, the 25th with those of the warm-up: the command does not move past the end.
#[test]
fn all_wait_at_the_last_target_for_answers() {
    let mut hold = None;
    for _ in 0..2 {
        let says = hold.map(|at| [(at, Operator::Hold), (at + 10, Operator::Continue)]);
        let says = says.as_ref().map_or(&[][..], |says| says);
        let (run, commands, told) = frame_with(21, says, Some(45));
        assert_eq!((run.column("x1").len(), told.len()), (22, 22));
        let goal = *run.column("target_1_1").last().unwrap();
        let first = commands.iter().position(|sent| sent[2] == goal).unwrap();
        let [end, ..] = commands[first];
        assert!((end - 21.0 * DT).abs() < 1e-14);
        let waits = &commands[first + 1..];
        assert!(waits.len() > 30, "{}", waits.len());
        for sent in waits {
            assert_eq!(*sent, [end, 0.0, goal, 0.0]);
        }
        let times = run.all("time");
        assert!(
            times
                .iter()
                .rev()
                .take(waits.len())
                .all(|time| *time == end)
        );
        let force = *run.column("force_1_1").last().unwrap();
        assert_eq!(force, STIFFNESS * goal);
        let holding = |state: &&f64| **state == Phase::Holding.code();
        let held = run.all("state").iter().filter(holding).count();
        assert_eq!(held > 5, hold.is_some());
        hold = Some(WARM_UP + first + 15);
    }
}

/// Wherever in a step the operator asks for a hold: during the hold no specimen gets a new target.
#[test]
fn hold_sends_no_target_to_a_far_specimen() {
    let mut told_at_last = 0;
    for tick in 0..usize::try_from(TICKS).unwrap() {
        let at = WARM_UP + 8 * 10 + tick;
        let says = [(at, Operator::Hold), (at + 30, Operator::Continue)];
        let (run, commands, told) = frame_with(20, &says, Some(3));
        let state = run.all("state");
        let holding = |row: &usize| state[*row] == Phase::Holding.code();
        let standing: Vec<usize> = (0..state.len()).filter(holding).collect();
        let (first, last) = (standing[0], standing[standing.len() - 1]);
        assert!(last - first > 25, "{first} {last}");
        assert!(commands[first..=last].iter().all(|sent| sent[1] == 0.0));
        // The near specimen gets each tick's command before the far one.
        let inside = told
            .iter()
            .filter(|near| (first + 1..=last + 1).contains(near));
        assert_eq!(inside.count(), 0, "tick {tick}: {told:?} {first} {last}");
        told_at_last += told.iter().filter(|near| **near == last + 2).count();
        assert_eq!(told.len(), 21, "once a step");
    }
    assert!(
        told_at_last > 0,
        "none of the holds began with a target that was not told"
    );
}

/// All stiffness and damping are those of the specimen: λ (Δt² k − 4 m + 2 Δt (r − 1) c) ≤ 4 Δt² k with r = 1, 2 or 10/3.
#[test]
fn loop_grows_at_the_limit_with_velocities() {
    let (mass, k, c) = (200.0, 2e6, 4e4);
    for (order, counts) in [(2, 2.0), (3, 10.0 / 3.0)] {
        let limit = 4.0 * DT * DT * k / (DT * DT * k - 4.0 * mass + 2.0 * DT * (counts - 1.0) * c);
        let peak = |share: f64| {
            let run = run(&format!(
                "safety.ease_s = 0\n[time]\nstep_s = {DT}\nduration_s = 3\nclock = \"simulated\"\nticks_per_step = {TICKS}\n\
                 prediction_order = {order}\n[integrator]\nlambda = {}\n[structure.matrices]\nmass = [[{mass}]]\n\
                 stiffness = [[0]]\n[excitation.ground_acceleration.signal.sine]\namplitude = 2\nfrequency_hz = 1.5\n\
                 [[specimen]]\nname = \"it\"\nrows = [[1]]\n\
                 law.linear = {{ stiffness_n_per_m = {k}, damping_n_s_per_m = {c} }}\n",
                share * limit
            ));
            let disp = run.column("x1");
            disp.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
        };
        // 200 kg · 2 m/s² on 2e6 N/m, and next to no amplification; growth by a per cent a step would make it twenty times.
        let (below, above) = (peak(0.97), peak(1.3));
        assert!(below < 1e-3, "{order}: {below}");
        assert!(above > 10.0 * below, "{order}: {below} {above}");
    }
}

/// A frame on a formula, whose command comes out of its range between two steps.
fn tripping(more: &str) -> String {
    format!(
        "[time]\nstep_s = {DT}\nduration_s = 2\nclock = \"simulated\"\nticks_per_step = {TICKS}\n[integrator]\nlambda = 2\n\
         [structure.shear_building]\nmass_kg = [2e3]\nstiffness_n_per_m = [1e5]\n[excitation.ground_acceleration.signal.sine]\n\
         amplitude = 5\nfrequency_hz = 1\n[[specimen]]\nname = \"column\"\nstorey = 1\n\
         law.linear.stiffness_n_per_m = {STIFFNESS}\n{more}"
    )
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |most, x| most.max(x.abs()))
}

#[test]
fn targeted_displacement_is_no_peak() {
    for at in 8..8 * 20 {
        let (run, _) = frame(40, &[(WARM_UP + at, Operator::Stop)]);
        let reached = run.column("x1");
        assert_eq!(run.outcome.peaks.disp[0], largest(reached), "command {at}");
    }
    let mut ended_a_step = 0;
    for bound in 1..40 {
        let bound = 5e-4 * f64::from(bound);
        let trip = format!("limits.measured_disp_m.trip = [{}, {bound}]\n", -bound);
        let run = run(&tripping(&trip));
        let (x, state, sub_tick) = (run.all("x1"), run.all("state"), run.all("sub_tick"));
        assert_eq!(run.outcome.peaks.disp[0], largest(x), "{bound}");
        let trip = state.iter().position(|s| *s == Phase::Tripped.code());
        ended_a_step += u32::from(sub_tick[trip.unwrap()] == 0.0);
    }
    assert!((1..39).contains(&ended_a_step), "{ended_a_step}");
}

#[test]
fn test_time_never_runs_back_in_shutdown() {
    let trip = "limits.command_disp_m.trip = [-5e-3, 5e-3]\n";
    let leaves = "[safety]\non_trip = \"zero_displacement\"\nexit_speed_m_per_s = 0.05\n";
    let run = run(&tripping(&format!("{trip}{leaves}")));
    let [state, step, time] = ["state", "step", "time"].map(|name| run.all(name));
    let sub_tick = run.all("sub_tick");
    let trip = state.iter().position(|s| *s == Phase::Tripped.code());
    let trip = trip.unwrap();
    assert!(sub_tick[trip] > 0.0 && state[trip + 1..].contains(&Phase::Leaving.code()));
    for row in trip..state.len() {
        let now = (step[row], sub_tick[row], time[row]);
        assert_eq!(now, (step[trip - 1], sub_tick[trip - 1], time[trip - 1]));
    }
    assert!(time.is_sorted());
}
