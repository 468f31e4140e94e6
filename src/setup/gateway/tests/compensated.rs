//! Compensators of a gateway: the same commands and the same tracking as a test gives for the same targets.

use super::*;
use crate::gateway::following::Following;
use gusset_config::ServedFile;
use gusset_control::port::limits::AxisLimits;
use gusset_control::port::{AxisSpec, Port, PortSpec};
use gusset_quantity::frame::AtStructure;

const ALL: [&str; 9] = [
    "none = {}",
    "polynomial = { order = 3, delay_s = 0.015 }",
    "polynomial = { order = 2, delay_s = 0.015, nodes = \"step\" }",
    "inverse = { delay_s = 0.015 }",
    "model_inverse = { coefficients = [1.0, 0.015] }",
    "ats = { delay_s = 0.015 }",
    "amb = {}",
    "recursive_fir = { delay_s = 0.015 }",
    "pi_lead = {}",
];

const PACED: Pacing = Pacing {
    ticks: 20,
    settle_ticks: 4,
    period_ns: 1_000_000,
    clock: simulated::CLOCK,
    predict: None,
};

/// A spring behind a first-order lag of 15 ms, in mm and kN. It lives in the time of its commands.
#[derive(Clone)]
struct Lagging {
    told: Told,
    disp: f64,
    sequence: u64,
}

impl Substructure for Lagging {
    fn axes(&self) -> usize {
        1
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction {
            standing: vec![0.0],
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        let motion = [command.disp.to_vec(), command.vel.to_vec()];
        self.told.lock().unwrap().push(motion);
        self.sequence = command.sequence;
        let share = 1.0 - libm::exp(-command.dt / 0.015);
        self.disp += share * (command.disp[0] - self.disp);
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.sequence = self.sequence;
        into.disp[0] = self.disp;
        into.force[0] = 2.0 * self.disp;
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

fn lagging() -> Lagging {
    Lagging {
        told: Told::default(),
        disp: 0.0,
        sequence: 0,
    }
}

fn table_of(compensation: &str) -> String {
    format!(
        r#"
        name = "column"
        stiffness_n_per_m = 2e6
        similitude = {{ length = 2.0, force = 4.0 }}
        axis = [{{ unit_disp = "mm", unit_force = "kN", sign = -1 }}]
        compensation.{compensation}
        limits = {{ command_vel_m_per_s = {{ trip = 5.0 }} }}
        link = {{ address = "127.0.0.1:1", probe = "none" }}
        "#
    )
}

/// The compensators as a served file asks for them.
pub fn following(table: &str) -> Result<Option<Following>, Box<gusset_config::Finding>> {
    let text = format!(
        "[safety]\nunlimited = \"a test\"\n[serve]\npace = {{ ticks_per_step = 20, rate_hz = 1000.0 }}\n[[specimen]]\n{table}"
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("gateway.toml");
    std::fs::write(&path, text).unwrap();
    let source: ServedFile = gusset_config::load_serve_file(&path, None).unwrap();
    let pace = source.file.serve.pace.clone().unwrap();
    assert_eq!((pace.ticks_per_step, pace.settle_ticks), (20, 0));
    Following::of(&source, source.specimen().unwrap(), &source.place)
}

/// Targets in m at the structure: a swing of 0.3 s.
fn targets() -> impl Iterator<Item = f64> + Clone {
    (1..50).map(|step| 0.01 * libm::sin(std::f64::consts::TAU * f64::from(step) / 15.0))
}

/// The commands and the tracking of a gateway.
fn by_gateway(compensation: &str) -> (Vec<[Vec<f64>; 2]>, [f64; 4]) {
    let (table, rig) = (table_of(compensation), lagging());
    let client = Client {
        probed_every: None,
        accepted: None,
        units: Some(SI),
        following: following(&table).unwrap(),
        is_paced: true,
    };
    let told = Arc::clone(&rig.told);
    let host = host_of(&table, client, rig).paced(Some(PACED));
    let mut served = host.specimen(false).unwrap();
    let controller = Controller::nobody();
    served.begin(&controller, &mut || Ok(())).unwrap();
    // Before the first target the gateway reads the force at rest.
    told.lock().unwrap().clear();
    for (sequence, target) in (0..).zip(targets()) {
        // The client is late by another time each time, and by less than a tick: a longer gap may teach nothing.
        simulated::pass(sequence * 137_000 % 1_000_000);
        goes(&mut served, sequence, &[target], &[0.0]).unwrap();
        served.commit();
    }
    let tracking = served.tracking().next().unwrap();
    let told = told.lock().unwrap().clone();
    (told, tracking)
}

/// Commands and tracking of a test's port that gets these targets tick by tick, after a ramp to the first one.
fn by_test(compensation: &str) -> (Vec<[Vec<f64>; 2]>, [f64; 4]) {
    let (text, rig) = (table_of(compensation), lagging());
    let table: SpecimenTable = toml::from_str(&text).unwrap();
    let told = Arc::clone(&rig.told);
    let (axis, (metres, newtons)) = crate::gear::axis(&table, &table.axis[0], Vec::new());
    let axis = AxisSpec {
        units: (metres, newtons),
        limits: AxisLimits::of(&table.limits_of(1)[0]),
        ..AxisSpec::new(axis, 2e6)
    };
    let mut spec = PortSpec::new("column", Box::new(rig), 1, vec![axis]);
    spec.tick = 1e-3;
    following(&text)
        .unwrap()
        .unwrap()
        .add_to(&mut spec)
        .unwrap();
    let mut port = spec.build().unwrap();
    port.path_mut().take_velocities_of_a_path();
    let mut sequence = 0;
    let mut tick = |port: &mut Port| {
        assert_eq!(port.clear().trip, None);
        port.issue(sequence, 0.0, 1e-3).unwrap();
        port.collect(Nanos(0)).unwrap();
        port.judge();
        port.accepted(sequence).unwrap();
        sequence += 1;
    };
    let mut from = None;
    for target in targets() {
        let Some(from) = from.replace(target) else {
            port.aim_at(&mut std::iter::once(AtStructure((target, 0.0))));
            port.begin_ramp();
            for step in 1..=20 {
                port.ramp_to(f64::from(step) / 20.0, 0.02);
                tick(&mut port);
            }
            for _ in 0..4 {
                port.ramp_to(1.0, 0.02);
                tick(&mut port);
            }
            port.begin_compensation();
            continue;
        };
        for step in 1..=24 {
            let x = f64::from(step.min(20)) / 20.0;
            let share = x * x * x * (10.0 + x * (6.0 * x - 15.0));
            let slope = 30.0 * x * x * (1.0 - x) * (1.0 - x) / 0.02;
            let disp = if x < 1.0 {
                from + share * (target - from)
            } else {
                target
            };
            port.aim_at(&mut std::iter::once(AtStructure((
                disp,
                slope * (target - from),
            ))));
            tick(&mut port);
        }
    }
    let tracking = port.tracking().values().next().unwrap();
    let told = told.lock().unwrap().clone();
    (told, tracking)
}

#[test]
fn gateway_compensates_like_a_test() {
    let mut lags = Vec::new();
    for compensation in ALL {
        let (told, tracking) = by_gateway(compensation);
        let (here, expected) = by_test(compensation);
        assert_eq!(told.len(), here.len(), "{compensation}");
        for (index, (told, here)) in told.iter().zip(&here).enumerate() {
            let same = (told[0][0] - here[0][0]).abs() <= 1e-12 * here[0][0].abs().max(1e-3);
            let vel = (told[1][0] - here[1][0]).abs() <= 1e-9 * here[1][0].abs().max(1.0);
            assert!(same && vel, "{compensation} {index}: {told:?} {here:?}");
        }
        let pairs = tracking.iter().zip(expected);
        for (found, expected) in pairs {
            let off = (found - expected).abs();
            assert!(
                off <= 1e-6 * expected.abs(),
                "{compensation}: {tracking:?} {expected}"
            );
        }
        lags.push((compensation, tracking));
    }
    let lag = |name: &str| {
        let found = lags.iter().find(|(kind, _)| kind.starts_with(name));
        found.unwrap().1[0]
    };
    // A path that rests at each target has faster motions than the swing: of them a lag of 15 ms makes 9 ms and a gain of 0.88.
    assert!((lag("none") - 0.009).abs() < 0.001, "{lags:?}");
    for name in [
        "polynomial",
        "inverse",
        "model_inverse",
        "ats",
        "recursive_fir",
    ] {
        assert!(lag(name).abs() < 0.6 * lag("none"), "{name}: {lags:?}");
    }
    for name in ["inverse", "model_inverse", "recursive_fir"] {
        assert!(lag(name).abs() < 0.0015, "{name}: {lags:?}");
    }
}

#[test]
fn session_starts_with_fresh_compensators() {
    let (table, rig) = (table_of("ats = { delay_s = 0.015 }"), lagging());
    let client = Client {
        probed_every: None,
        accepted: None,
        units: Some(SI),
        following: following(&table).unwrap(),
        is_paced: true,
    };
    let told = Arc::clone(&rig.told);
    let host = host_of(&table, client, rig).paced(Some(PACED));
    let mut served = host.specimen(false).unwrap();
    let mut go = || {
        told.lock().unwrap().clear();
        let controller = Controller::nobody();
        served.begin(&controller, &mut || Ok(())).unwrap();
        // It ends at zero, where the next session begins.
        for (sequence, target) in (0..).zip(targets().take(44).chain([0.0])) {
            goes(&mut served, sequence, &[target], &[0.0]).unwrap();
            served.commit();
        }
        let told = told.lock().unwrap().clone();
        let tracking: Vec<_> = served.tracking().flatten().map(f64::to_bits).collect();
        served.end(gusset_quantity::catalog::ending::Cause::Done, "");
        (told, tracking)
    };
    let first = go();
    assert!(first.0.len() > 40 * 24);
    assert_eq!(first, go());
}

/// The last commands of a swing, with an adaptive compensator and a client that is late or not.
fn swings(settle_ticks: u32, late_ns: u64) -> Vec<f64> {
    let (table, rig) = (table_of("ats = { delay_s = 0.005 }"), lagging());
    let client = Client {
        probed_every: None,
        accepted: None,
        units: Some(SI),
        following: following(&table).unwrap(),
        is_paced: true,
    };
    let told = Arc::clone(&rig.told);
    let pacing = Pacing {
        settle_ticks,
        ..PACED
    };
    let host = host_of(&table, client, rig).paced(Some(pacing));
    let mut served = host.specimen(false).unwrap();
    let controller = Controller::nobody();
    served.begin(&controller, &mut || Ok(())).unwrap();
    for (sequence, target) in (0..200).zip(targets().cycle()) {
        if sequence == 198 {
            told.lock().unwrap().clear();
        }
        simulated::pass(late_ns);
        goes(&mut served, sequence, &[target], &[0.0]).unwrap();
        served.commit();
    }
    let told = told.lock().unwrap();
    told.iter().map(|[disp, _]| disp[0]).collect()
}

#[test]
fn late_client_teaches_only_after_a_rest() {
    let late = 5_000_000;
    for settle_ticks in [0, 1, 10, 64] {
        let learns = swings(settle_ticks, late) != swings(settle_ticks, late + 7_000_000);
        assert!(!learns, "{settle_ticks}: the time of the gap says nothing");
        let is_as_without_gaps = swings(settle_ticks, late) == swings(settle_ticks, 0);
        assert_eq!(is_as_without_gaps, settle_ticks == 64, "{settle_ticks}");
    }
}

#[test]
fn unsupported_compensator_is_refused() {
    let refused = |compensation: &str| {
        following(&table_of(compensation))
            .unwrap_err()
            .path
            .to_string()
    };
    assert_eq!(
        refused("newton = { delay_s = 0.02 }"),
        "specimen[0].compensation.newton"
    );
    let far = "model_inverse = { coefficients = [3.0, 0.02] }";
    assert_eq!(refused(far), "specimen[0].compensation");
}

#[test]
fn controller_resumes_with_a_static_gain() {
    let table = table_of("model_inverse = { coefficients = [1.25, 0.015] }");
    let host = |standing: Vec<f64>| {
        let rig = Rig {
            law: Arc::new(|disp: &[f64]| vec![2.0 * disp[0]]),
            standing,
            told: Told::default(),
            sequence: 0,
        };
        let client = Client {
            probed_every: None,
            accepted: None,
            units: Some(SI),
            following: following(&table).unwrap(),
            is_paced: true,
        };
        let told = Arc::clone(&rig.told);
        (told, host_of(&table, client, rig).paced(Some(PACED)))
    };
    let begin = |host: &Host, start: Vec<f64>| {
        let controller = Controller {
            start,
            ..Controller::nobody()
        };
        let mut served = host.specimen(false).unwrap();
        let begun = served.begin(&controller, &mut || Ok(()));
        begun.map(|_| served)
    };
    let (told, first) = host(vec![0.0]);
    let mut served = begin(&first, Vec::new()).unwrap();
    for (sequence, target) in [(0, 0.004), (1, 0.01)] {
        goes(&mut served, sequence, &[target], &[0.0]).unwrap();
        served.commit();
    }
    served.end(gusset_quantity::catalog::ending::Cause::Done, "");
    // 10 mm of the structure are −5 mm of the axis, and 1.25 times that the command.
    let left = told.lock().unwrap().last().unwrap()[0][0];
    assert!((left + 6.25).abs() < 1e-9, "{left}");
    let stands = first.standing();
    assert!((stands[0] - 0.01).abs() < 1e-12, "{stands:?}");
    // The specimen reports that this command holds it.
    let (told, next) = host(vec![left]);
    assert!(begin(&next, vec![0.0125]).is_err());
    let mut served = begin(&next, vec![0.01]).unwrap();
    goes(&mut served, 0, &[0.01], &[0.0]).unwrap();
    let told = told.lock().unwrap().clone();
    assert!(!told.is_empty());
    for [disp, _] in told {
        assert!((disp[0] - left).abs() < 1e-9, "{disp:?}: nothing moves");
    }
}
