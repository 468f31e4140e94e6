//! A test on a bus that an operator stopped: on the devices where it was left, it resumes with the bits of the test that was not.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use gusset_control::engine::{Operator, Phase};
use gusset_control::port::{Axis, AxisSpec, PortSpec};
use gusset_ethercat::plan::{AxisPlan, CommandPlan, EntryPlace, Scaled, SpecimenPlan};
use gusset_ethercat::simulated::{SimulatedBus, SimulatedLine};
use gusset_ethercat::{BusPort, Opener, SharedBus};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::time::SimClock;
use gusset_record::{Run, RunFolder};
use gusset_session::{self as session, Allowed, Watches, replay, resume_allowed};
use gusset_setup::{Prepared, build, bus_of, simulated_bus};

use super::{DRIVE, OUTPUT, load, text};

/// Step → the bits of its row, over runs that follow each other.
fn steps(runs: &[&Path]) -> BTreeMap<u64, Vec<u64>> {
    let mut all = BTreeMap::new();
    let names = [
        "step",
        "state",
        "x1",
        "x2",
        "v1",
        "v2",
        "cmd_1_1",
        "raw_disp_1_1",
        "raw_force_1_1",
    ];
    for run in runs {
        let columns = Run::open(run).unwrap().columns(&names).unwrap();
        for row in 0..columns[0].len() {
            if columns[1][row] == Phase::Running.code() {
                let bits = columns[2..].iter().map(|column| column[row].to_bits());
                all.insert(columns[0][row] as u64, bits.collect());
            }
        }
    }
    all
}

fn run_to(out: &Path, test: Prepared, words: Vec<Operator>) -> Cause {
    let (says, requests) = crossbeam_channel::unbounded();
    words.into_iter().for_each(|word| says.send(word).unwrap());
    let folder = RunFolder::create(out).unwrap();
    let done = session::run(test, folder, requests, Watches::default(), &mut |_| {});
    done.unwrap().cause
}

#[test]
fn stopped_test_resumes_with_the_same_bits() {
    for (axis, stands, command) in [
        (OUTPUT, "stands_at_m = [0.0]", Some((1, 0))),
        (DRIVE, "", None),
    ] {
        let home = tempfile::tempdir().unwrap();
        let at = |name: &str| home.path().join(name);
        // While the pace rises again, commands between the steps pass a peak that no step has: the specimen feels it.
        let text = text(axis, stands).replace("[bus.rig]", "[safety]\nease_s = 0\n[bus.rig]");
        let loaded = load(home.path(), &text);
        run_to(&at("whole"), build(&loaded).unwrap(), Vec::new());

        // The devices outlive the first test.
        let devices = Arc::new(Mutex::new(simulated_bus(&loaded, Vec::new()).unwrap()));
        let on = |devices: &Arc<Mutex<SimulatedBus>>, mut test: Prepared| {
            let line = SimulatedLine::new(Arc::clone(devices), Box::new(SimClock::new()));
            let opener: Opener = Box::new(move || Ok(Box::new(line)));
            let plan = bus_of(&loaded).unwrap().0;
            let shared = SharedBus::new(plan, ([0x10, 9, 9, 9, 9, 9], 1), opener, None);
            let scaled = |(device, entry)| Scaled {
                at: EntryPlace { device, entry },
                per_count: 1.0,
                zero_count: 0.0,
            };
            let command = command.map(|at| CommandPlan::Output(scaled(at)));
            let port = BusPort::new(
                shared,
                SpecimenPlan {
                    axes: vec![AxisPlan {
                        command: command.unwrap_or(CommandPlan::Drive(2)),
                        force: scaled((0, 1)),
                        disp: command.map(|_| scaled((0, 2))),
                        good: Vec::new(),
                    }],
                    interlock: Vec::new(),
                },
            );
            let axis = AxisSpec::new(Axis::plain(vec![(0, 1.0)]), 10e6);
            let port = PortSpec::new("storey", Box::new(port), 2, vec![axis]);
            test.experiment.ports[0].go_live(port.build().unwrap());
            test
        };
        let mut words = vec![Operator::Continue; 550];
        words.push(Operator::Stop);
        let cause = run_to(&at("first"), on(&devices, build(&loaded).unwrap()), words);
        assert_eq!(cause, Cause::Operator);

        // New devices have not the state of the first test: it is in their specimens.
        let anew = resume_allowed(&at("first"), None, Allowed::default()).unwrap();
        assert_eq!(run_to(&at("anew"), anew, Vec::new()), Cause::Unfit);
        let next = resume_allowed(&at("first"), None, Allowed::default()).unwrap();
        let cause = run_to(&at("second"), on(&devices, next), Vec::new());
        assert_eq!(cause, Cause::Done);
        assert!(replay(&at("second")).unwrap().is_exact());
        let (whole, both) = (
            steps(&[&at("whole")]),
            steps(&[&at("first"), &at("second")]),
        );
        assert!(steps(&[&at("first")]).len() > 100 && whole.len() >= 500);
        assert_eq!(
            whole.keys().collect::<Vec<_>>(),
            both.keys().collect::<Vec<_>>()
        );
        for (step, bits) in &whole {
            assert_eq!(Some(bits), both.get(step), "{axis}: step {step}");
        }
    }
}
