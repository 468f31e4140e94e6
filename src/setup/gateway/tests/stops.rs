//! Limits of speed and acceleration on the path of a paced client: before it begins, and when it is stopped.

use super::*;
use gusset_link::served::RecordSettings;

/// A rig whose replies take two polls of the gateway.
#[derive(Clone)]
struct Slow {
    rig: Rig,
    looked: bool,
    /// Time of each reply in ns.
    takes_ns: u64,
}

impl Substructure for Slow {
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
        self.looked = false;
        self.rig.issue(command)
    }
    fn is_answered(&mut self, _: u64) -> Result<bool, LinkFault> {
        Ok(std::mem::replace(&mut self.looked, true))
    }
    fn collect(&mut self, limit: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        simulated::pass(self.takes_ns);
        self.rig.collect(limit, into)
    }
    fn retire(&mut self, how: Retirement) {
        self.rig.retire(how);
    }
}

/// A gateway of one axis with these limits and this pace, in a session.
fn begun(limits: &str, pacing: Pacing) -> (ServedSpecimen, Told) {
    let (mut served, told) = with_replies(limits, pacing, 0);
    begin(&mut served);
    told.lock().unwrap().clear();
    (served, told)
}

fn begin(served: &mut ServedSpecimen) {
    let controller = Controller::nobody();
    served.begin(&controller, &mut || Ok(())).unwrap();
}

/// A gateway before any session, with replies that take this time.
fn with_replies(limits: &str, pacing: Pacing, takes_ns: u64) -> (ServedSpecimen, Told) {
    let rig = Rig {
        law: Arc::new(|disp: &[f64]| vec![1e6 * disp[0]]),
        standing: vec![0.0],
        told: Told::default(),
        sequence: 0,
    };
    let told = Arc::clone(&rig.told);
    let table = format!(
        "name = \"column\"\nstiffness_n_per_m = 1e6\nlimits = {{ {limits} }}\n\
         link = {{ address = \"127.0.0.1:1\", probe = \"none\" }}"
    );
    let client = Client {
        probed_every: None,
        accepted: None,
        units: Some(SI),
        following: None,
        is_paced: true,
    };
    let rig = Slow {
        rig,
        looked: false,
        takes_ns,
    };
    let host = host_of(&table, client, rig).paced(Some(pacing));
    (host.specimen(false).unwrap(), told)
}

const fn of(ticks: u32) -> Pacing {
    Pacing {
        ticks,
        settle_ticks: 0,
        period_ns: 1_000_000,
        clock: simulated::CLOCK,
        predict: None,
    }
}

/// One target, which is wanted until this number of commands has left for it. Returns places and velocities of the
/// commands.
fn leads(
    served: &mut ServedSpecimen,
    told: &Told,
    target: f64,
    commands: usize,
) -> (Result<bool, Trip>, Vec<[f64; 2]>) {
    told.lock().unwrap().clear();
    let command = Command {
        sequence: 0,
        time: 0.0,
        dt: 0.02,
        disp: &[target],
        vel: &[0.0],
    };
    let mut into = Measurement::zeros(1);
    let mut wanted = || told.lock().unwrap().len() < commands;
    let outcome = served.exchange(&command, 0.02, &mut wanted, &mut into);
    let made = told.lock().unwrap();
    (
        outcome,
        made.iter().map(|[disp, vel]| [disp[0], vel[0]]).collect(),
    )
}

#[test]
fn path_beyond_a_limit_is_refused_early() {
    // 10 mm in 20 ms.
    for (limits, quantity, needed) in [
        (
            "command_vel_m_per_s = { trip = 0.5 }",
            Limit::CommandVel,
            38,
        ),
        ("command_step_m = { trip = 4e-4 }", Limit::CommandStep, 47),
        (
            "command_accel_m_per_s2 = { trip = 100 }",
            Limit::CommandAccel,
            25,
        ),
    ] {
        for (pace, is_reached) in [(20, false), (needed - 1, false), (needed, true)] {
            let (mut served, told) = begun(limits, of(pace));
            // The ramp to the first target is stretched.
            let (first, _) = leads(&mut served, &told, 0.01, usize::MAX);
            assert_eq!(first, Ok(true));
            served.commit();
            let (second, made) = leads(&mut served, &told, 0.02, usize::MAX);
            if is_reached {
                assert_eq!(second, Ok(true), "{limits}");
                continue;
            }
            let Err(Trip::TooFast { hit, ticks }) = second else {
                panic!("{limits}: {second:?}");
            };
            assert_eq!((hit.quantity, ticks), (quantity, needed));
            assert!(made.is_empty(), "nothing moves");
            let text = served.whole(served.tripped().unwrap());
            assert!(text.contains(&needed.to_string()), "{text}");
        }
    }
}

#[test]
fn stop_on_a_path_keeps_its_limits() {
    // 10/√3 of 10 mm in 40 ms squared are 36.1 m/s².
    let limits = "command_vel_m_per_s = { trip = 0.6 }, command_accel_m_per_s2 = { trip = 36.2 }";
    for is_ramp in [true, false] {
        for commands in 1..60 {
            let (mut served, told) = begun(limits, of(40));
            let mut from = 0.0;
            if !is_ramp {
                from = 0.01;
                assert_eq!(leads(&mut served, &told, from, usize::MAX).0, Ok(true));
                served.commit();
            }
            let (outcome, made) = leads(&mut served, &told, from + 0.01, commands);
            assert!(outcome.is_ok(), "{is_ramp} {commands}: {outcome:?}");
            let [disp, vel] = *made.last().unwrap();
            assert!(vel.abs() < 1e-9, "{is_ramp} {commands}: {vel}");
            assert!(disp > from && disp <= from + 0.01 + 1e-12);
            assert_eq!(outcome == Ok(true), commands > made.len());
        }
    }
}

/// A stop in a path of 4 s is obeyed by the next command, in the shortest time that the limits allow.
#[test]
fn a_stop_of_a_slow_path_takes_a_few_ticks() {
    for (limits, slows) in [
        // 30·0.3²·0.7²·10 mm/4 s are 3.3 mm/s; half of the limit slows that down in 6.6 ms.
        ("command_accel_m_per_s2 = { trip = 1 }", 7),
        // The usual hold ramp.
        ("command_vel_m_per_s = { trip = 0.6 }", 250),
    ] {
        let (mut served, told) = begun(limits, of(4000));
        assert_eq!(leads(&mut served, &told, 0.01, usize::MAX).0, Ok(true));
        served.commit();
        let (outcome, made) = leads(&mut served, &told, 0.02, 1200);
        assert_eq!((outcome, made.len()), (Ok(false), 1200 + slows), "{limits}");
        assert!(made[1200][1] < made[1199][1] && made[1199 + slows][1] == 0.0);
        for pair in made.windows(2) {
            let change = (pair[1][1] - pair[0][1]).abs();
            assert!(change < 1e-3, "{change}");
        }
        // The next target leads away from where it rests.
        let [rests, _] = made[1199 + slows];
        let (outcome, made) = leads(&mut served, &told, 0.01, usize::MAX);
        assert_eq!((outcome, made.len()), (Ok(true), 4000));
        assert!((made[0][0] - rests).abs() < 1e-8 && made[3999][0] == 0.01);
    }
}

#[test]
fn stop_of_stretched_ramp_takes_quarter_s() {
    // 1 m at 0.05 m/s at most: about 31 s.
    let (mut served, told) = begun("command_vel_m_per_s = { trip = 0.1 }", of(200));
    let (outcome, made) = leads(&mut served, &told, 1.0, 10_000);
    assert_eq!((outcome, made.len()), (Ok(false), 10_250));
    assert!(made.last().unwrap()[1] == 0.0 && made[9_990][1] > 0.02);
    // Each command changes the velocity a little only.
    for pair in made.windows(2) {
        let change = (pair[1][1] - pair[0][1]).abs();
        assert!(change < 0.05 / 240.0, "{change}");
    }
}

#[test]
fn first_ramp_without_a_speed_limit_is_1_s() {
    let (mut served, told) = begun("command_disp_m = { trip = [-1, 1] }", of(20));
    for (target, commands) in [(0.01, 1000), (0.02, 20)] {
        let (outcome, made) = leads(&mut served, &told, target, usize::MAX);
        assert_eq!((outcome, made.len()), (Ok(true), commands));
        served.commit();
    }
}

#[test]
fn late_replies_are_counted_reported_once() {
    for (takes_ns, missed) in [(900_000, 0), (1_400_000, 0), (1_600_000, 38)] {
        let folder = tempfile::tempdir().unwrap();
        let (served, told) = with_replies("command_vel_m_per_s = { trip = 5 }", of(20), takes_ns);
        let mut served = served.recorded(Some(RecordSettings {
            root: folder.path().to_owned(),
            file: Vec::new(),
            resolved: String::new(),
            about: None,
            inputs: Vec::new(),
            queue_s: 1.0,
            required: true,
            accepted: Default::default(),
            verdict: None,
            ended: None,
        }));
        begin(&mut served);
        for target in [0.001, 0.002] {
            assert_eq!(leads(&mut served, &told, target, usize::MAX).0, Ok(true));
            served.commit();
            // A client that is late misses nothing.
            simulated::pass(50_000_000);
        }
        served.end(gusset_quantity::catalog::ending::Cause::Done, "");
        let read = |name| std::fs::read_to_string(folder.path().join("test-0001").join(name));
        let summary: serde_json::Value =
            serde_json::from_str(&read("summary.json").unwrap()).unwrap();
        assert_eq!(summary["deadline_misses"], missed, "{takes_ns}");
        assert_eq!(summary["rate_hz"], 1000.0);
        let events = read("events.jsonl").unwrap();
        let warnings = events.matches("late_replies").count();
        assert_eq!(warnings, usize::from(missed > 0), "{takes_ns}");
    }
}
