//! A paced client that is late, pauses or dies: whenever that happens, the specimen moves within the bounds of its path, and rests.

use std::sync::LazyLock;

use super::*;
use crate::gateway::following::Following;

const TICKS: u32 = 10;

/// Ticks of the motion in s, and the largest step of the client in m.
const PERIOD_S: f64 = 1e-3;
const STEP_M: f64 = 0.004;

const TABLE: &str = r#"
    name = "column"
    stiffness_n_per_m = 1e6
    compensation.polynomial = { order = 1, delay_s = 0.002 }
    limits = { command_vel_m_per_s = { trip = 20.0 }, command_accel_m_per_s2 = { trip = 5000.0 } }
    link = { address = "127.0.0.1:1", probe = "none" }
"#;

/// A rig that notes when each command came.
#[derive(Clone)]
struct Watching {
    rig: Rig,
    times: Arc<Mutex<Vec<u64>>>,
}

impl Substructure for Watching {
    fn axes(&self) -> usize {
        self.rig.axes()
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        self.rig.connect()
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.times.lock().unwrap().push(simulated::now_ns());
        self.rig.issue(command)
    }
    fn collect(&mut self, limit: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.rig.collect(limit, into)
    }
    fn retire(&mut self, how: Retirement) {
        self.rig.retire(how);
    }
}

/// The action of a client after one target.
#[derive(Debug, Clone, Copy)]
enum Next {
    /// It sends the next one after this time in ns.
    Goes(u64),
    /// It pauses first.
    Pauses(u64),
    /// The server is stopped after this number of commands to the next target.
    Dies(u32),
}

fn next() -> impl Strategy<Value = Next> {
    prop_oneof![
        10 => (0u64..5_000_000).prop_map(Next::Goes),
        2 => (0u64..60_000_000_000).prop_map(Next::Pauses),
        1 => (0u32..2 * TICKS).prop_map(Next::Dies),
    ]
}

/// Time of each command in ns, and where it sends the axis, in m.
type Course = Vec<(u64, f64)>;

/// Motion at the rig: the targets of one client, from 0 on.
fn course(
    following: Option<Following>,
    settle_ticks: u32,
    targets: &[(f64, Next)],
) -> (Course, f64) {
    let rig = Watching {
        rig: Rig {
            law: Arc::new(|disp: &[f64]| vec![1e6 * disp[0]]),
            standing: vec![0.0],
            told: Told::default(),
            sequence: 0,
        },
        times: Arc::default(),
    };
    let (told, times) = (Arc::clone(&rig.rig.told), Arc::clone(&rig.times));
    let client = Client {
        probed_every: None,
        accepted: None,
        units: Some(SI),
        following,
        is_paced: true,
    };
    let pacing = Pacing {
        ticks: TICKS,
        settle_ticks,
        period_ns: 1_000_000,
        clock: simulated::CLOCK,
        predict: None,
    };
    let table = match client.following {
        Some(_) => TABLE.to_owned(),
        None => TABLE.replace("5000.0", "700.0"),
    };
    let host = host_of(&table, client, rig).paced(Some(pacing));
    let mut served = host.specimen(false).unwrap();
    let controller = Controller::nobody();
    served.begin(&controller, &mut || Ok(())).unwrap();
    // The force at rest was asked for.
    told.lock().unwrap().clear();
    times.lock().unwrap().clear();
    let mut place = 0.0;
    let mut commands_left = None;
    for (sequence, (step, next)) in (0..).zip(targets) {
        place += STEP_M * step;
        let command = Command {
            sequence,
            time: 0.02 * sequence as f64,
            dt: 0.02,
            disp: &[place],
            vel: &[0.0],
        };
        let mut into = Measurement::zeros(1);
        let mut wanted = || match &mut commands_left {
            None => true,
            Some(0) => false,
            Some(left) => {
                *left -= 1;
                true
            }
        };
        let is_reached = served
            .exchange(&command, 0.02, &mut wanted, &mut into)
            .unwrap();
        if !is_reached {
            break;
        }
        served.commit();
        assert_eq!(
            into.disp[0].to_bits(),
            told.lock().unwrap().last().unwrap()[0][0].to_bits()
        );
        match *next {
            Next::Goes(ns) => simulated::pass(ns),
            Next::Pauses(ns) => {
                simulated::pass(ns);
                served.attend().unwrap();
            }
            Next::Dies(ticks) => commands_left = Some(ticks),
        }
    }
    assert_eq!(served.tripped(), None);
    let rests = told.lock().unwrap().len();
    served.end(
        gusset_quantity::catalog::ending::Cause::ControllerVanished,
        "",
    );
    simulated::pass(1_000_000_000);
    assert_eq!(
        told.lock().unwrap().len(),
        rests,
        "nothing moves without a client"
    );
    let places = told.lock().unwrap().clone();
    let places = places.iter().map(|[disp, _]| disp[0]);
    let last_vel = told.lock().unwrap().last().map_or(0.0, |[_, vel]| vel[0]);
    let times = times.lock().unwrap().clone();
    (times.into_iter().zip(places).collect(), last_vel)
}

/// Where the axis is at the end of each tick of 1 ms: it stays where it was sent last.
fn tick_by_tick(course: &Course) -> Vec<f64> {
    let mut places = vec![0.0; 2];
    for window in course.windows(2) {
        let [(time, place), (next, _)] = window else {
            continue;
        };
        places.push(*place);
        // A longer gap is a rest: two more ticks show that it is one.
        if next - time > 1_500_000 {
            places.extend([*place; 2]);
        }
    }
    let last = course.last().map_or(0.0, |(_, place)| *place);
    places.extend([last; 3]);
    places
}

/// A compensator as a served file asks for it.
static LED: LazyLock<Option<Following>> = LazyLock::new(|| compensated::following(TABLE).unwrap());

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Speed and acceleration of the commands stay within those that the path and its limits promise, for every schedule. Commands are never
    /// closer than a tick, and the last one is at rest.
    #[test]
    fn late_targets_stay_within_the_bounds(
        settle_ticks in 0u32..4,
        targets in proptest::collection::vec((-1.0..1.0f64, next()), 1..25),
    ) {
        let (course, last_vel) = course(None, settle_ticks, &targets);
        for window in course.windows(2) {
            prop_assert!(window[1].0 - window[0].0 >= 1_000_000);
        }
        prop_assert!(last_vel.abs() < 1e-9, "{last_vel}");
        let n = f64::from(TICKS);
        // The ramp to the first target is half a cosine: π/2 of the mean speed, π²/2 of distance/time². Its acceleration does not
        // vanish at its ends, which a path of 10 ticks spreads over one tick.
        let (speed, mut accel) = (1.875 * STEP_M / n, 7.7 * STEP_M / (n * n));
        if targets.iter().any(|(_, next)| matches!(next, Next::Dies(_))) {
            // A stop uses the declared acceleration of 700 m/s².
            accel = accel.max(700.0 * PERIOD_S * PERIOD_S);
        }
        let places = tick_by_tick(&course);
        for (index, window) in places.windows(3).enumerate() {
            let step = (window[1] - window[0]).abs();
            prop_assert!(step <= speed * (1.0 + 1e-9), "{index}: {} m/s", step / PERIOD_S);
            let bend = (window[2] - 2.0 * window[1] + window[0]).abs();
            prop_assert!(bend <= accel * (1.0 + 1e-9), "{index}: {} {}", bend, accel);
        }
    }

    /// A compensator leads the motion by its gain and no further: it never begins or ends with a jump.
    #[test]
    fn compensated_schedule_has_no_jump(
        settle_ticks in 3u32..6,
        targets in proptest::collection::vec((-1.0..1.0f64, next()), 1..25),
    ) {
        let (course, _) = course(LED.clone(), settle_ticks, &targets);
        let n = f64::from(TICKS);
        let places = tick_by_tick(&course);
        // Twice the delay in ticks is the gain of a straight line through two targets at the highest frequency.
        let (speed, accel) = (5.0 * 1.875 * STEP_M / n, 5.0 * 7.7 * STEP_M / (n * n));
        for (index, window) in places.windows(3).enumerate() {
            let step = (window[1] - window[0]).abs();
            prop_assert!(step <= speed, "{index}: {step} {speed}");
            let bend = (window[2] - 2.0 * window[1] + window[0]).abs();
            prop_assert!(bend <= accel, "{index}: {bend} {accel}");
        }
    }
}
