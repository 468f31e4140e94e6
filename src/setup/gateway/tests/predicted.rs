//! A client whose specimen keeps moving between targets: whenever a target is late, or the client dies, the specimen stays near its last
//! target, keeps its limit of acceleration, and comes to rest.

use super::*;
use gusset_control::port::limits::Hit;
use gusset_control::port::{Order, SlowDown};
use gusset_link::served::{MOST_PREDICTED, Predicting, Trip};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::catalog::limit::Limit;

const TICKS: u32 = 20;
const PERIOD_S: f64 = 1e-3;
const WITHIN_M: f64 = 5e-4;
/// m/s², as in the table.
const ACCEL: f64 = 12.0;

const TABLE: &str = r#"
    name = "column"
    stiffness_n_per_m = 1e6
    limits = { command_vel_m_per_s = { trip = 2.0 }, command_accel_m_per_s2 = { trip = 12.0 } }
    link = { address = "127.0.0.1:1", probe = "none" }
"#;

fn pacing(order: Order, client_lead: f64) -> Pacing {
    Pacing {
        ticks: TICKS,
        settle_ticks: 0,
        period_ns: 1_000_000,
        clock: simulated::CLOCK,
        predict: Some(Predicting {
            slow: SlowDown {
                ticks: TICKS,
                at: 0.6,
                until: 0.8,
            },
            order,
            within: [WITHIN_M; MOST_PREDICTED],
            correct_at_most: 0.0,
            lead_s: client_lead,
        }),
    }
}

/// Where the axis is at each tick of the motion, and the last target that was known then.
#[derive(Default)]
struct Motion {
    places: Vec<[f64; 2]>,
    trip: Option<Trip>,
}

/// The action of a client after one target.
#[derive(Debug, Clone, Copy)]
enum Next {
    /// It computes for this time in ns.
    Computes(u64),
    /// It dies after this number of commands on the way to the next target.
    Dies(u32),
}

fn next() -> impl Strategy<Value = Next> {
    prop_oneof![
        8 => (0u64..12_000_000).prop_map(Next::Computes),
        4 => (0u64..60_000_000).prop_map(Next::Computes),
        1 => (0u64..20_000_000_000).prop_map(Next::Computes),
        1 => (0u32..TICKS + 5).prop_map(Next::Dies),
    ]
}

/// The specimen moves for this time.
fn passes(served: &mut ServedSpecimen, ns: u64) {
    let until = simulated::now_ns() + ns;
    loop {
        let now = simulated::now_ns();
        let due = served.go_on().unwrap();
        match due.map(|due| due.0).filter(|due| *due < until) {
            _ if simulated::now_ns() >= until => return,
            None => return simulated::pass(until - simulated::now_ns()),
            Some(due) if due > now => simulated::pass(due.saturating_sub(simulated::now_ns())),
            Some(_) => {}
        }
    }
}

fn motion(order: Order, table: &str, targets: &[(f64, Next)]) -> Motion {
    let rig = Rig {
        law: Arc::new(|disp: &[f64]| vec![1e6 * disp[0]]),
        standing: vec![0.0],
        told: Told::default(),
        sequence: 0,
    };
    let told = Arc::clone(&rig.told);
    let client = Client {
        probed_every: None,
        accepted: None,
        units: Some(SI),
        following: compensated::following(table).unwrap(),
        is_paced: true,
    };
    let leads = client.following.is_some();
    let lead_s = client
        .following
        .as_ref()
        .map_or(0.0, crate::gateway::following::Following::lead_s);
    let host = host_of(table, client, rig).paced(Some(pacing(order, lead_s)));
    let mut served = host.specimen(false).unwrap();
    served.begin(&Controller::nobody(), &mut || Ok(())).unwrap();
    let mut motion = Motion::default();
    let mut seen = told.lock().unwrap().len();
    let mut note = |motion: &mut Motion, target: f64| {
        let told = told.lock().unwrap();
        motion
            .places
            .extend(told[seen..].iter().map(|[disp, _]| [disp[0], target]));
        seen = told.len();
    };
    let (mut place, mut speed) = (0.0, 0.0);
    let mut left = None;
    for (sequence, (change, next)) in (0..).zip(targets) {
        if sequence > 0 {
            speed += 8e-5 * change;
            place += speed;
        }
        let command = Command {
            sequence,
            time: 0.02 * sequence as f64,
            dt: 0.02,
            disp: &[place],
            vel: &[speed / 0.02],
        };
        let mut into = Measurement::zeros(1);
        let mut wanted = || match &mut left {
            None => true,
            Some(0) => false,
            Some(left) => {
                *left -= 1;
                true
            }
        };
        let reached = served.exchange(&command, 0.02, &mut wanted, &mut into);
        // On the way, the distance counts from neither target.
        note(&mut motion, f64::NAN);
        match reached {
            Ok(true) => {}
            Ok(false) => break,
            Err(trip) => {
                motion.trip = Some(trip);
                break;
            }
        }
        if !leads {
            assert_eq!(into.disp[0].to_bits(), place.to_bits());
        }
        served.commit();
        match *next {
            Next::Computes(ns) => passes(&mut served, ns),
            Next::Dies(ticks) => left = Some(ticks),
        }
        note(&mut motion, place);
    }
    let last = place;
    served.end(Cause::ControllerVanished, "");
    let end = if motion.trip.is_some() {
        f64::NAN
    } else {
        last
    };
    note(&mut motion, end);
    let rests = motion.places.len();
    simulated::pass(1_000_000_000);
    note(&mut motion, last);
    assert_eq!(motion.places.len(), rests, "nothing moves without a client");
    motion
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Targets are met to the last bit, and no command is too fast, too hard or too far beyond the last target; at the end it rests.
    #[test]
    fn specimen_stays_near_its_targets(
        order in 0usize..5,
        targets in proptest::collection::vec((-0.3..1.5f64, next()), 2..40),
    ) {
        let order = [Order::Constant, Order::Linear, Order::Quadratic, Order::Cubic, Order::Velocities][order];
        let motion = motion(order, TABLE, &targets);
        // A target that asks for too much is refused before the specimen goes there, and no command of the way trips.
        let is_refused = matches!(motion.trip, Some(Trip::TooFast { .. } | Trip::FarAhead(_)));
        prop_assert!(motion.trip.is_none() || is_refused, "{:?}", motion.trip);
        for [place, target] in &motion.places {
            prop_assert!(target.is_nan() || (place - target).abs() <= WITHIN_M * (1.0 + 1e-9), "{place} {target}");
        }
        let last = motion.places.last().map_or(0.0, |[place, _]| *place);
        let mut places: Vec<f64> = vec![0.0; 2];
        places.extend(motion.places.iter().map(|[place, _]| *place));
        places.extend([last; 2]);
        for (index, window) in places.windows(3).enumerate() {
            let bend = (window[2] - 2.0 * window[1] + window[0]).abs() / (PERIOD_S * PERIOD_S);
            prop_assert!(bend <= ACCEL * 1.02, "{index} of {}: {bend}", places.len());
        }
    }

    /// A compensator leads by its gain, and the specimen stays as near.
    #[test]
    fn led_specimen_stays_near_its_targets(
        targets in proptest::collection::vec((-0.3..1.5f64, next()), 2..40),
    ) {
        let table = TABLE.replace("link =", "compensation.polynomial = { order = 2, delay_s = 0.002 }\n    link =");
        let motion = motion(Order::Cubic, &table, &targets);
        let trips = |limit: Limit| matches!(motion.trip, Some(Trip::Limit(hit)) if hit.quantity == limit);
        prop_assert!(!trips(Limit::CommandDisp) && !trips(Limit::CommandAccel));
        for [place, target] in &motion.places {
            prop_assert!(target.is_nan() || (place - target).abs() <= WITHIN_M * 1.05, "{place} {target}");
        }
    }
}

/// A sine whose targets come in time: the specimen arrives with its velocity, and never slows down.
#[test]
fn targets_in_time_are_met_on_the_move() {
    let targets: Vec<(f64, Next)> = (0..200)
        .map(|k| (libm::cos(0.1 * f64::from(k)), Next::Computes(8_000_000)))
        .collect();
    let motion = motion(Order::Cubic, TABLE, &targets);
    assert_eq!(motion.trip, None);
    let places: Vec<f64> = motion.places.iter().map(|[place, _]| *place).collect();
    // The last steps, a tick apart; at rest at targets they would stop every 20.
    let steps: Vec<f64> = places.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let moving = &steps[steps.len() - 2500..steps.len() - 40];
    let mean = moving.iter().sum::<f64>() / moving.len() as f64;
    let still = moving.iter().filter(|step| **step < 0.02 * mean).count();
    assert!(still < moving.len() / 50, "{still} of {}", moving.len());
}

/// A specimen that was lost in motion: the next session begins where it is, and nothing moves before a target comes.
#[test]
fn next_session_forgets_an_earlier_motion() {
    let lost = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let rig = Losing {
        rig: Rig {
            law: Arc::new(|disp: &[f64]| vec![1e6 * disp[0]]),
            standing: vec![0.0],
            told: Told::default(),
            sequence: 0,
        },
        lost: Arc::clone(&lost),
    };
    let told = Arc::clone(&rig.rig.told);
    let client = Client {
        probed_every: None,
        accepted: None,
        units: Some(SI),
        following: None,
        is_paced: true,
    };
    let host = host_of(TABLE, client, rig).paced(Some(pacing(Order::Cubic, 0.0)));
    let mut served = host.specimen(false).unwrap();
    served.begin(&Controller::nobody(), &mut || Ok(())).unwrap();
    for sequence in 0..30_u64 {
        let disp = 2e-4 * sequence as f64 * f64::min(1.0, sequence as f64 / 20.0);
        let command = Command {
            sequence,
            time: 0.02 * sequence as f64,
            dt: 0.02,
            disp: &[disp],
            vel: &[0.0],
        };
        let mut into = Measurement::zeros(1);
        served
            .exchange(&command, 0.02, &mut || true, &mut into)
            .unwrap();
        served.commit();
    }
    lost.store(true, std::sync::atomic::Ordering::Relaxed);
    assert!((0..5).any(|_| {
        simulated::pass(1_000_000);
        served.go_on().is_err()
    }));
    served.end(Cause::SpecimenLost, "");
    lost.store(false, std::sync::atomic::Ordering::Relaxed);
    served.begin(&Controller::nobody(), &mut || Ok(())).unwrap();
    let before = told.lock().unwrap().len();
    passes(&mut served, 100_000_000);
    served.end(Cause::ControllerVanished, "");
    assert_eq!(told.lock().unwrap().len(), before);
}

/// A target outside a limit of position is refused in the words of that limit, before the specimen goes there.
#[test]
fn target_outside_its_limit_is_not_followed() {
    let table = TABLE.replace(
        "limits = {",
        "limits = { command_disp_m = { trip = [-0.001, 0.001] },",
    );
    let targets: Vec<(f64, Next)> = (0..40).map(|_| (0.5, Next::Computes(8_000_000))).collect();
    let motion = motion(Order::Cubic, &table, &targets);
    let is_of_place = |hit: Hit| hit.quantity == Limit::CommandDisp;
    assert!(
        matches!(motion.trip, Some(Trip::Limit(hit)) if is_of_place(hit)),
        "{:?}",
        motion.trip
    );
    assert!(motion.places.iter().all(|[place, _]| place.abs() <= 0.001));
}

/// A rig that can be lost.
#[derive(Clone)]
struct Losing {
    rig: Rig,
    lost: Arc<std::sync::atomic::AtomicBool>,
}

impl Substructure for Losing {
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
        if self.lost.load(std::sync::atomic::Ordering::Relaxed) {
            return Err(LinkFault::Closed);
        }
        self.rig.issue(command)
    }
    fn collect(&mut self, limit: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.rig.collect(limit, into)
    }
    fn retire(&mut self, how: Retirement) {
        self.rig.retire(how);
    }
}
