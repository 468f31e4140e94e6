//! The master against the simulated devices: two halves that follow the same standard.

use std::sync::{Arc, Mutex};

use gusset_quantity::state::Visit;
use gusset_quantity::substructure::{
    Command, Freshness, LinkFault, Measurement, Retirement, Status, Substructure,
};
use gusset_quantity::time::{Clock, Nanos, SimClock};

use super::*;
use crate::error::BusError;
use crate::plan::{
    AxisPlan, Check, CommandPlan, DevicePlan, DrivePlan, EntryPlace, Scaled, SpecimenPlan,
    TimeSource,
};
use crate::wire::drive::DriveState;
use crate::wire::register::AlState;
use crate::{Bus, BusPort, Opener, SharedBus, bring_up, reset_faults, scan};

pub(crate) const PERIOD_NS: u64 = 1_000_000;
const SOURCE: [u8; 6] = [0x10, 9, 9, 9, 9, 9];

/// A spring of 1000 force units per unit.
struct Spring(Vec<f64>, u64);

impl Substructure for Spring {
    fn axes(&self) -> usize {
        self.0.len()
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.0.copy_from_slice(command.disp);
        self.1 = command.sequence;
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        into.disp.copy_from_slice(&self.0);
        for (force, disp) in into.force.iter_mut().zip(&self.0) {
            *force = 1000.0 * disp;
        }
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
    fn visit_state(&mut self, _: &mut dyn Visit) -> bool {
        true
    }
}

fn device(name: &str, code: u32, outputs: &[&str], inputs: &[&str]) -> DevicePlan {
    let entries = |texts: &[&str]| texts.iter().map(|text| text.parse().unwrap()).collect();
    DevicePlan {
        name: name.to_owned(),
        vendor: 2,
        code,
        revision: None,
        outputs: entries(outputs),
        inputs: entries(inputs),
        assign: false,
        setup: Vec::new(),
        drive: None,
    }
}

/// A coupler without process data, a load cell, an output of ±10 V that keeps its value, and a drive.
pub(crate) fn plan() -> BusPlan {
    let mut servo = device("servo", 3, &["7000:01 i16 command"], &[]);
    servo.setup = vec!["8000:05 u8 2".parse().unwrap()];
    let outputs = ["6040:00 u16", "607a:00 i32"];
    let inputs = ["6041:00 u16", "6064:00 i32", "603f:00 u16"];
    let mut drive = device("axis 1", 4, &outputs, &inputs);
    drive.drive = Some(DrivePlan {
        counts_per_unit: 1e6,
        accel: 10.0,
        following_counts: Some(2000.0),
        accepts_free_stop: false,
    });
    let cell = [
        "6000:01 u16 state",
        "6000:11 f64 force",
        "6010:11 f64 force 2",
    ];
    BusPlan {
        name: "rig".to_owned(),
        devices: vec![
            device("coupler", 1, &[], &[]),
            device("load cell", 2, &[], &cell),
            servo,
            drive,
        ],
        period_ns: PERIOD_NS,
        time: TimeSource::Bus,
        watchdog_ns: 100_000_000,
        sample_after_ns: None,
        patience_ns: 5_000_000_000,
        stale_ticks: 3,
    }
}

/// One specimen at the output, and one at the drive.
pub(crate) fn specimens() -> Vec<SpecimenPlan> {
    let at = |device, entry| EntryPlace { device, entry };
    let scaled = |at, per_count| Scaled {
        at,
        per_count,
        zero_count: 0.0,
    };
    let check = Check {
        at: at(1, 0),
        mask: 0x43,
        equals: 0,
    };
    let axis = |command, force| AxisPlan {
        command,
        force,
        disp: None,
        good: vec![check],
    };
    let output = CommandPlan::Output(scaled(at(2, 0), 1e-5));
    let one = |axis| SpecimenPlan {
        axes: vec![axis],
        interlock: Vec::new(),
    };
    vec![
        one(axis(output, scaled(at(1, 1), 1.0))),
        one(axis(CommandPlan::Drive(3), scaled(at(1, 2), 1.0))),
    ]
}

fn plants() -> Vec<Plant> {
    let plant = |specimen| Plant {
        specimen,
        law: Box::new(Spring(vec![0.0], 0)),
        stands_at: vec![0.0],
    };
    specimens().into_iter().map(plant).collect()
}

type Shared = Arc<Mutex<SimulatedBus>>;

pub(crate) fn simulated(plan: &BusPlan, faults: &str) -> (Shared, SimulatedLine) {
    let faults = script(faults);
    let bus = SimulatedBus::new(plan, plants(), faults).unwrap();
    let bus = Arc::new(Mutex::new(bus));
    let line = SimulatedLine::new(Arc::clone(&bus), Box::new(SimClock::new()));
    (bus, line)
}

fn script(text: &str) -> Vec<Fault> {
    if text.is_empty() {
        return Vec::new();
    }
    let script: FaultScript = toml::from_str(text).unwrap();
    script.fault
}

fn up(faults: &str) -> Result<(Shared, Box<Bus>), BusError> {
    let (shared, line) = simulated(&plan(), faults);
    let bus = bring_up(Box::new(line), plan(), SOURCE)?;
    Ok((shared, bus))
}

fn in_op(faults: &str) -> (Shared, Box<Bus>) {
    let (shared, mut bus) = up(faults).unwrap();
    bus.go_to(AlState::Op, &mut || true).unwrap();
    (shared, bus)
}

/// Waits for the next edge and exchanges.
fn tick(bus: &mut Bus) -> bool {
    let edge = bus.next_edge();
    bus.wait_until(edge);
    bus.exchange()
}

#[test]
fn a_bus_comes_to_op_and_carries_a_force() {
    let (shared, mut bus) = in_op("");
    let command = bus
        .place(
            EntryPlace {
                device: 2,
                entry: 0,
            },
            false,
        )
        .unwrap();
    let force = bus
        .place(
            EntryPlace {
                device: 1,
                entry: 1,
            },
            true,
        )
        .unwrap();
    command.write(250.0, bus.image());
    assert!(tick(&mut bus));
    // The exchange carries the inputs of the tick before.
    assert_eq!(force.read(bus.image()), 0.0);
    assert!(bus.sample(Nanos(u64::MAX)));
    assert_eq!(force.read(bus.image()), 250.0 * 1e-5 * 1000.0);
    assert_eq!(
        shared.lock().unwrap().commands().next().unwrap(),
        [250.0 * 1e-5]
    );
}

#[test]
fn a_scan_lists_what_is_there() {
    let (_, mut line) = simulated(&plan(), "");
    let found = scan(&mut line, SOURCE, false).unwrap();
    assert_eq!(found.len(), 4);
    assert_eq!(found[3].identity, [2, 4, 1]);
    assert_eq!(found[1].state, Some(AlState::Init));
    let inputs: Vec<String> = found[1].inputs.iter().map(ToString::to_string).collect();
    assert_eq!(inputs, ["6000:01 u16", "6000:11 f64", "6010:11 f64"]);
    assert_eq!(found[3].outputs.len(), 2);
    assert!(found.iter().all(|one| one.remark.is_none()));
}

#[test]
fn a_wrong_device_is_named() {
    let (_, line) = simulated(&plan(), "");
    let mut other = plan();
    other.devices[1].code = 99;
    let error = bring_up(Box::new(line), other, SOURCE).unwrap_err();
    let BusError::Identity {
        position,
        found,
        wanted,
        ..
    } = error
    else {
        panic!("{error}")
    };
    assert_eq!((position, found, wanted.1), (2, [2, 2, 1], 99));
    let (_, line) = simulated(&plan(), "");
    let mut other = plan();
    other.devices.pop();
    let error = bring_up(Box::new(line), other, SOURCE).unwrap_err();
    assert_eq!(
        error,
        BusError::Count {
            found: 4,
            wanted: 3
        }
    );
}

#[test]
fn another_mapping_is_refused_or_written() {
    let mut other = plan();
    other.devices[1].inputs.pop();
    let (_, line) = simulated(&plan(), "");
    let error = bring_up(Box::new(line), other.clone(), SOURCE).unwrap_err();
    assert!(
        matches!(
            error,
            BusError::Mapping {
                direction: "inputs",
                ..
            }
        ),
        "{error}"
    );
    let mut assigning = plan();
    assigning.devices[1].assign = true;
    other.devices[1].assign = true;
    let (_, line) = simulated(&assigning, "");
    bring_up(Box::new(line), other, SOURCE).unwrap();
}

#[test]
fn every_refusal_names_device_and_code() {
    for (state, code, wanted) in [
        ("PRE-OP", 0x16, AlState::PreOp),
        ("SAFE-OP", 0x1d, AlState::SafeOp),
        ("OP", 0x19, AlState::Op),
    ] {
        let faults = format!(
            "[[fault]]\nwhat = {{ refuse_state = {{ device = \"servo\", state = \"{state}\", code = {code} }} }}"
        );
        let error = match up(&faults) {
            Err(error) => error,
            Ok((_, mut bus)) => bus.go_to(AlState::Op, &mut || true).unwrap_err(),
        };
        let BusError::State {
            device,
            wanted: asked,
            code: found,
            ..
        } = error
        else {
            panic!("{error}")
        };
        assert_eq!((device.as_str(), asked, found), ("servo", wanted, code));
    }
}

#[test]
fn faults_in_op_make_the_exchange_stale() {
    for (fault, is_stale) in [
        ("what = \"drop\"", true),
        ("what = { late = { micros = 900 } }", true),
        ("what = { late = { micros = 100 } }", false),
        ("what = \"duplicate\"", false),
        ("what = { wkc = { device = \"load cell\" } }", true),
        ("what = { cut = { device = \"load cell\" } }", true),
        (
            "what = { al_error = { device = \"servo\", code = 0x1b } }",
            true,
        ),
        (
            "what = { frozen_input = { device = \"load cell\" } }",
            false,
        ),
        (
            "what = { emergency = { device = \"axis 1\", code = 0x3220 } }",
            false,
        ),
    ] {
        let (_, mut bus) = in_op(&format!("[[fault]]\n{fault}\nat_tick = 10"));
        let valid: Vec<bool> = (0..16).map(|_| tick(&mut bus)).collect();
        assert_eq!(
            valid.iter().any(|valid| !valid),
            is_stale,
            "{fault}: {valid:?}"
        );
        assert!(valid[..8].iter().all(|valid| *valid), "{fault}");
    }
}

#[test]
fn a_lost_state_is_found_with_its_code() {
    let (_, mut bus) = in_op(
        "[[fault]]\nwhat = { al_error = { device = \"load cell\", code = 0x1a } }\nat_tick = 5",
    );
    for _ in 0..20 {
        tick(&mut bus);
    }
    let Some(BusError::State {
        device,
        found,
        code,
        ..
    }) = bus.complaint()
    else {
        panic!("{:?}", bus.complaint())
    };
    assert_eq!(
        (device.as_str(), found, code),
        ("load cell", Some(AlState::SafeOp), 0x1a)
    );
}

/// Every device is named before three stale ticks trip the test.
#[test]
fn the_culprit_is_found_in_three_ticks() {
    for (fault, wanted) in [
        ("cut = { device = \"coupler\" }", ("load cell", 0)),
        ("cut = { device = \"servo\" }", ("axis 1", 0)),
        (
            "al_error = { device = \"load cell\", code = 0x1a }",
            ("load cell", 0x1a),
        ),
        (
            "al_error = { device = \"axis 1\", code = 0x2c }",
            ("axis 1", 0x2c),
        ),
    ] {
        for first in 5..9 {
            let (_, mut bus) = in_op(&format!(
                "[[fault]]\nwhat = {{ {fault} }}\nat_tick = {first}\nlasts = 99"
            ));
            let ticks = (0..20).take_while(|_| {
                tick(&mut bus);
                bus.trouble().2 < 3
            });
            assert!(ticks.count() < 19);
            let found = match bus.complaint() {
                Some(BusError::State { device, code, .. }) => (device, code),
                Some(BusError::Silent { device, .. }) => (device, 0),
                other => panic!("{fault}: {other:?}"),
            };
            assert_eq!((found.0.as_str(), found.1), wanted, "{first}");
        }
    }
}

/// A line that asks about each frame first: an answer is the result of sending it, and without one the frame goes on.
struct Asking<F>(SimulatedLine, F);

impl<F> crate::line::Line for Asking<F>
where
    F: FnMut(&[u8]) -> Option<Result<(), crate::line::LineFault>> + Send,
{
    fn now(&self) -> Nanos {
        self.0.now()
    }
    fn wait_until(&mut self, at: Nanos) {
        self.0.wait_until(at);
    }
    fn send(&mut self, frame: &[u8]) -> Result<(), crate::line::LineFault> {
        (self.1)(frame).unwrap_or_else(|| self.0.send(frame))
    }
    fn receive(
        &mut self,
        buffer: &mut [u8],
        deadline: Nanos,
    ) -> Result<Option<usize>, crate::line::LineFault> {
        self.0.receive(buffer, deadline)
    }
}

/// True of a frame that begins with this service.
fn begins_with(frame: &[u8], service: Service) -> bool {
    frame.get(16) == Some(&(service as u8))
}

#[test]
fn a_tick_without_its_sample_is_stale() {
    let mut sampled = plan();
    sampled.sample_after_ns = Some(500_000);
    let (_, line) = simulated(&sampled, "");
    let line = Asking(line, |frame: &[u8]| {
        begins_with(frame, Service::Lrd).then_some(Ok(()))
    });
    let mut bus = bring_up(Box::new(line), sampled, SOURCE).unwrap();
    for stale in 1..6 {
        bus.wait_until(bus.next_edge());
        bus.send();
        assert!(bus.receive(Nanos(u64::MAX)));
        assert!(!bus.sample(bus.now().plus(1000)));
        assert_eq!(bus.trouble(), (false, false, stale));
    }
}

#[test]
fn a_full_interface_is_stale_and_not_lost() {
    let (_, line) = simulated(&plan(), "");
    let line = Asking(line, |frame: &[u8]| {
        begins_with(frame, Service::Lrw).then_some(Err(crate::line::LineFault::Full))
    });
    let mut bus = bring_up(Box::new(line), plan(), SOURCE).unwrap();
    assert!(!tick(&mut bus));
    assert_eq!(bus.trouble(), (false, false, 1));
}

#[test]
fn a_drive_with_a_fault_is_refused() {
    let fault =
        "[[fault]]\nwhat = { drive_fault = { device = \"axis 1\", code = 0x3220 } }\nat_frame = 9";
    let error = up(fault).unwrap_err();
    let BusError::Drive { device, why } = error else {
        panic!("{error}")
    };
    assert!(device == "axis 1" && why.contains("0x3220"), "{why}");
}

#[test]
fn a_foreign_master_breaks_the_line() {
    let (_, mut bus) = in_op("[[fault]]\nwhat = \"foreign\"\nat_tick = 5");
    for _ in 0..8 {
        tick(&mut bus);
    }
    assert_eq!(
        bus.complaint(),
        Some(BusError::Line(crate::line::LineFault::Foreign))
    );
}

#[test]
fn a_drive_gets_torque_and_comes_to_rest() {
    let (shared, mut bus) = in_op("");
    let drive = bus.drive_of(3).unwrap();
    bus.drive(drive).unwrap().0.enable();
    let enabled = |bus: &mut Bus| Ok(bus.have_torque(&[drive]));
    assert!(bus.exchange_until(enabled, &mut || true).unwrap());
    let position = |shared: &Shared| shared.lock().unwrap().commands().nth(1).unwrap()[0];
    // 1 m/s for 20 ticks.
    for k in 1..=20 {
        bus.drive(drive).unwrap().0.aim(1e-3 * f64::from(k));
        assert!(tick(&mut bus));
    }
    assert!((position(&shared) - 0.02).abs() < 1e-9);
    let mut way = vec![position(&shared) - 1e-3, position(&shared)];
    while bus.drive(drive).unwrap().0.moves() {
        tick(&mut bus);
        way.push(position(&shared));
    }
    tick(&mut bus);
    way.push(position(&shared));
    let most = way
        .windows(3)
        .map(|x| (x[2] - 2.0 * x[1] + x[0]).abs())
        .fold(0.0, f64::max);
    let limit = 10.0 * 1e-6;
    assert!(most <= 1.2 * limit && most > 0.8 * limit, "{most}");
    // v²/2a = 50 mm.
    let rest = position(&shared);
    assert!((rest - 0.07).abs() < 1e-3, "{rest}");
    assert!(bus.drive(drive).unwrap().0.has_rested());
}

#[test]
fn a_fault_of_a_drive_is_reset_on_request_only() {
    let (shared, mut bus) = in_op(
        "[[fault]]\nwhat = { drive_fault = { device = \"axis 1\", code = 0x3220 } }\nat_tick = 4",
    );
    let drive = bus.drive_of(3).unwrap();
    bus.drive(drive).unwrap().0.enable();
    for _ in 0..20 {
        tick(&mut bus);
    }
    assert!(bus.drive(drive).unwrap().0.state().is_fault());
    bus.close();
    drop(bus);
    let mut line = SimulatedLine::new(shared, Box::new(SimClock::new()));
    assert_eq!(
        reset_faults(&mut line, &plan(), SOURCE).unwrap(),
        ["axis 1"]
    );
    assert!(reset_faults(&mut line, &plan(), SOURCE).unwrap().is_empty());
}

#[test]
fn a_drive_that_would_lose_its_torque_is_refused() {
    for (write, key) in [("605a:00 i16 2", "605A"), ("6065:00 u32 5000", "6065")] {
        let mut plan = plan();
        plan.devices[3].setup = vec![write.parse().unwrap()];
        let (_, line) = simulated(&plan, "");
        let error = bring_up(Box::new(line), plan, SOURCE).unwrap_err();
        let BusError::Drive { device, why } = error else {
            panic!("{error}")
        };
        assert!(device == "axis 1" && why.contains(key), "{why}");
    }
}

#[test]
fn the_watchdog_of_the_devices_acts() {
    let (shared, mut bus) = in_op("");
    let now = bus.now();
    bus.wait_until(now.plus(99_000_000));
    assert!(tick(&mut bus));
    let now = bus.now();
    bus.wait_until(now.plus(150_000_000));
    assert!(!tick(&mut bus));
    for _ in 0..8 {
        tick(&mut bus);
    }
    assert!(matches!(
        bus.complaint(),
        Some(BusError::State { code: 0x1b, .. })
    ));
    // The output keeps its last value, and the drive stands.
    assert_eq!(shared.lock().unwrap().commands().next().unwrap(), [0.0]);
}

#[test]
fn an_exchange_allocates_nothing() {
    let (_, mut bus) = in_op("");
    tick(&mut bus);
    let info = allocation_counter::measure(|| {
        for _ in 0..100 {
            tick(&mut bus);
            bus.sample(Nanos(u64::MAX));
        }
    });
    assert_eq!(info.count_total, 0);
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(300))]
    #[test]
    fn arbitrary_frames_never_panic(
        mut bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..200),
        service in 0u8..16,
        register in 0u16..0x3000,
    ) {
        let (shared, _) = simulated(&plan(), "");
        let mut bus = shared.lock().unwrap();
        bus.process(&mut bytes, 0);
        if bytes.len() > 40 {
            let length = (bytes.len() - 28) as u16;
            bytes[12..16].copy_from_slice(&[0x88, 0xa4, (length + 12) as u8, 0x10]);
            bytes[16] = service;
            bytes[18..20].fill(0);
            bytes[20..22].copy_from_slice(&register.to_le_bytes());
            bytes[22..24].copy_from_slice(&length.to_le_bytes());
            for now in 0..3 {
                bus.process(&mut bytes, now);
            }
        }
    }
}

/// Two specimens on one bus, armed at zero.
fn armed(faults: &str) -> [BusPort; 2] {
    let (_, line) = simulated(&plan(), faults);
    let opener: Opener = Box::new(move || Ok(Box::new(line)));
    let shared = SharedBus::new(plan(), (SOURCE, 2), opener, None);
    let ports = specimens()
        .into_iter()
        .map(|one| BusPort::new(Arc::clone(&shared), one));
    let mut ports: Vec<BusPort> = ports.collect();
    for port in &mut ports {
        let found = port.connect().unwrap();
        assert!(found.simulated && found.force == [0.0]);
    }
    for port in &mut ports {
        port.ask_to_arm(0, &[0.0]).unwrap();
    }
    for port in &mut ports {
        assert!(port.arm(0, &[0.0], &mut || true).unwrap());
    }
    ports.try_into().unwrap()
}

fn command(sequence: u64, disp: &[f64]) -> Command<'_> {
    Command {
        sequence,
        time: 0.0,
        dt: 0.001,
        disp,
        vel: &[0.0],
    }
}

const SOON: Nanos = Nanos(u64::MAX);

#[test]
fn a_tick_of_two_specimens_allocates_nothing() {
    let [mut output, mut drive] = armed("");
    let mut measured = Measurement::zeros(1);
    let mut forces = [[0.0; 2]; 20];
    let info = allocation_counter::measure(|| {
        for (k, row) in (0u64..).zip(&mut forces) {
            let disp = [1e-5 * k as f64];
            output.issue(&command(k, &disp)).unwrap();
            drive.issue(&command(k, &disp)).unwrap();
            for (port, force) in [&mut output, &mut drive].into_iter().zip(row) {
                assert_eq!(port.collect(SOON, &mut measured).unwrap(), Freshness::Fresh);
                assert_eq!(measured.sequence, k.saturating_sub(1));
                assert_eq!(measured.status, Status::default());
                *force = measured.force[0];
            }
        }
    });
    assert_eq!(info.count_total, 0);
    // The inputs of a tick answer the command before.
    for (k, row) in forces.iter().enumerate().skip(1) {
        let wanted = 1e-2 * (k - 1) as f64;
        assert!(
            row.iter().all(|force| (force - wanted).abs() < 1e-9),
            "{k}: {row:?}"
        );
    }
}

#[test]
fn a_specimen_goes_on_without_the_other() {
    let [mut output, mut drive] = armed("");
    let mut measured = Measurement::zeros(1);
    for k in 0..10 {
        drive.issue(&command(k, &[1e-4 * k as f64])).unwrap();
        output.issue(&command(k, &[0.0])).unwrap();
        drive.collect(SOON, &mut measured).unwrap();
        output.collect(SOON, &mut measured).unwrap();
    }
    // The drive is commanded no more: it comes to rest, and the other specimen keeps its exchanges.
    for k in 10..200 {
        output.issue(&command(k, &[1e-5])).unwrap();
        assert_eq!(
            output.collect(SOON, &mut measured).unwrap(),
            Freshness::Fresh
        );
    }
    assert_eq!(drive.issue(&command(200, &[0.0])), Err(LinkFault::Refused));
    assert!(!drive.settle(Retirement::Tripped));
    drive.retire(Retirement::Tripped);
    assert_eq!(drive.has_acknowledged(), Some(true));
    output.issue(&command(201, &[0.0])).unwrap();
    assert_eq!(
        output.collect(SOON, &mut measured).unwrap(),
        Freshness::Fresh
    );
    output.retire(Retirement::Orderly);
    assert_eq!(output.has_acknowledged(), Some(true));
    assert_eq!(output.issue(&command(202, &[0.0])), Err(LinkFault::Closed));
}

#[test]
fn a_command_beyond_its_type_is_saturated() {
    let [mut output, mut drive] = armed("");
    let mut measured = Measurement::zeros(1);
    drive.issue(&command(0, &[0.0])).unwrap();
    // The output has 16 bits of 10 µm.
    output.issue(&command(0, &[0.5])).unwrap();
    output.collect(SOON, &mut measured).unwrap();
    assert!(measured.status.has(Status::SATURATED));
    drive.collect(SOON, &mut measured).unwrap();
    assert!(!measured.status.has(Status::SATURATED));
}

#[test]
fn a_bus_in_operation_is_left_alone() {
    let (shared, bus) = in_op("");
    let mut line = SimulatedLine::new(Arc::clone(&shared), Box::new(SimClock::new()));
    let error = scan(&mut line, SOURCE, false).unwrap_err();
    let is_live = matches!(
        error,
        BusError::InOperation {
            position: 1,
            state: AlState::Op,
            ..
        }
    );
    assert!(is_live, "{error}");
    assert!(
        shared
            .lock()
            .unwrap()
            .devices
            .iter()
            .all(|one| one.state == AlState::Op)
    );
    drop(bus);
    assert_eq!(scan(&mut line, SOURCE, true).unwrap().len(), 4);
}

/// A bus whose drive has torque, and the number of the drive.
fn with_torque() -> (Shared, Box<Bus>, usize) {
    let (shared, mut bus) = in_op("");
    let drive = bus.drive_of(3).unwrap();
    bus.drive(drive).unwrap().0.enable();
    let enabled = |bus: &mut Bus| Ok(bus.have_torque(&[drive]));
    assert!(bus.exchange_until(enabled, &mut || true).unwrap());
    (shared, bus, drive)
}

/// The state of the servo after it changed to this one by itself.
fn changes_to(state: DriveState) -> (DriveState, bool) {
    let (shared, mut bus, drive) = with_torque();
    let servo = |shared: &Shared, set: Option<DriveState>| {
        let mut bus = shared.lock().unwrap();
        let servo = bus.devices[3].servo.as_mut().unwrap();
        servo.state = set.unwrap_or(servo.state);
        servo.state
    };
    servo(&shared, Some(state));
    for _ in 0..20 {
        tick(&mut bus);
    }
    let is_lost = bus.drive(drive).unwrap().0.is_lost();
    (servo(&shared, None), is_lost)
}

#[test]
fn torque_neither_ends_nor_returns_by_itself() {
    let stopped = changes_to(DriveState::QuickStopActive);
    assert_eq!(stopped, (DriveState::QuickStopActive, true));
    // A safe stop that is released, and a fault that is reset at the drive.
    let released = changes_to(DriveState::SwitchOnDisabled);
    assert_eq!(released, (DriveState::SwitchOnDisabled, true));
}

#[test]
fn a_lost_bus_is_left_at_its_watchdog() {
    let cut = "[[fault]]\nwhat = { cut = { device = \"coupler\" } }\nat_tick = 40";
    let (devices, _) = simulated(&plan(), cut);
    let clock = SimClock::new();
    let line = SimulatedLine::new(devices, Box::new(clock.clone()));
    let opener: Opener = Box::new(move || Ok(Box::new(line)));
    let shared = SharedBus::new(plan(), (SOURCE, 1), opener, None);
    let mut port = BusPort::new(shared, specimens().remove(1));
    port.connect().unwrap();
    assert!(port.arm(0, &[0.0], &mut || true).unwrap());
    let mut measured = Measurement::zeros(1);
    let mut lost = (1..60).filter_map(|sequence| {
        port.issue(&command(sequence, &[0.0])).unwrap();
        let deadline = clock.now().plus(PERIOD_NS / 2);
        port.collect(deadline, &mut measured).err()
    });
    assert!(lost.next().is_some());
    port.settle(Retirement::Tripped);
    let began = clock.now();
    port.retire(Retirement::Tripped);
    // The watchdog is 100 ms. Requests without a reply follow.
    let took_ms = clock.now().since(began) / 1_000_000;
    assert!((50..=300).contains(&took_ms), "{took_ms} ms");
    assert_eq!(port.has_acknowledged(), Some(false));
}

#[test]
fn a_drive_shows_the_mode_that_was_written() {
    let mut plan = plan();
    let drive = &mut plan.devices[3];
    drive.outputs.push("6060:00 i8".parse().unwrap());
    drive.inputs.push("6061:00 i8".parse().unwrap());
    let (shared, line) = simulated(&plan, "");
    let shown = |mode: u8| {
        let mut bus = shared.lock().unwrap();
        let device = &mut bus.devices[3];
        let place = device.place(2, false).unwrap();
        place.write(mode.into(), &mut device.memory);
        device.drive();
        device.show_drive(0.0);
        device.place(3, true).unwrap().read(&device.memory)
    };
    let mut bus = bring_up(Box::new(line), plan, SOURCE).unwrap();
    assert_eq!(shown(0), 0.0);
    bus.go_to(AlState::Op, &mut || true).unwrap();
    for _ in 0..2 {
        tick(&mut bus);
    }
    let drive = bus.drive_of(3).unwrap();
    let (drive, image) = bus.drive(drive).unwrap();
    assert!(!drive.why_no_torque(image).contains("6061"));
    assert_eq!(shown(7), 7.0);
    bus.sample(SOON);
    let (drive, image) = bus.drive(0).unwrap();
    assert!(drive.why_no_torque(image).contains("6061 is 7"));
    assert!(
        shared.lock().unwrap().devices[3]
            .servo
            .as_ref()
            .unwrap()
            .counts
            == 0.0
    );
}

type Frames = Arc<Mutex<Vec<Vec<u8>>>>;

/// The specimens of the plan on a bus whose frames are kept.
fn spied(plan: BusPlan) -> (Vec<BusPort>, Frames) {
    let frames = Frames::default();
    let (_, line) = simulated(&plan, "");
    let kept = Arc::clone(&frames);
    let line = Asking(line, move |frame: &[u8]| {
        kept.lock().unwrap().push(frame.to_vec());
        None
    });
    let opener: Opener = Box::new(move || Ok(Box::new(line)));
    let shared = SharedBus::new(plan, (SOURCE, 2), opener, None);
    let ports = specimens().into_iter();
    let ports = ports.map(|one| BusPort::new(Arc::clone(&shared), one));
    (ports.collect(), frames)
}

#[test]
fn outputs_stand_before_they_are_used() {
    let (mut ports, frames) = spied(plan());
    ports[0].connect().unwrap();
    assert!(ports[0].arm(0, &[0.02], &mut || true).unwrap());
    let frames = frames.lock().unwrap();
    let first = |frame: &[u8]| datagrams(frame).unwrap().next().unwrap().unwrap();
    let asks_for_op = |frame: &Vec<u8>| {
        let one = first(frame);
        one.address == crate::wire::datagram::at(0, crate::wire::register::AL_CONTROL)
            && one.bytes(frame).first() == Some(&8)
    };
    let op = frames.iter().position(asks_for_op).unwrap();
    let is_exchange = |frame: &&Vec<u8>| begins_with(frame, Service::Lrw);
    let last = frames[..op].iter().rfind(is_exchange).unwrap();
    assert_eq!(first(last).bytes(last)[..2], 2000i16.to_le_bytes());
}

#[test]
fn a_standing_command_beyond_its_output_is_refused() {
    let (mut ports, _) = spied(plan());
    ports[0].connect().unwrap();
    // The output has 16 bits of 10 µm.
    assert_eq!(ports[0].ask_to_arm(0, &[0.5]), Err(LinkFault::Refused));
    let refused = ports[0].arm(0, &[0.5], &mut || true);
    assert_eq!(refused, Err(LinkFault::Refused));
}

#[test]
fn an_input_at_its_end_is_saturated() {
    let mut own = plan();
    own.devices[1].inputs[1] = "6000:11 i8 force".parse().unwrap();
    let (mut ports, _) = spied(own);
    ports[0].connect().unwrap();
    assert!(ports[0].arm(0, &[0.0], &mut || true).unwrap());
    let mut measured = Measurement::zeros(1);
    // The spring has 1000 N/m, and the input ends at 127 N.
    for (k, (disp, is_at_end)) in (0u64..).zip([(0.0, false), (0.1, false), (0.2, true)]) {
        for again in 0..2 {
            ports[0].issue(&command(2 * k + again, &[disp])).unwrap();
            ports[0].collect(SOON, &mut measured).unwrap();
        }
        let found = measured.status.has(Status::SATURATED);
        assert_eq!(found, is_at_end, "{disp} m: {} N", measured.force[0]);
    }
}

#[test]
fn a_quick_stop_is_no_end_of_torque() {
    let (_shared, mut bus, drive) = with_torque();
    bus.drive(drive).unwrap().0.quick_stop();
    for _ in 0..3 {
        tick(&mut bus);
    }
    let found = bus.drive(drive).unwrap().0;
    assert_eq!(found.state(), DriveState::QuickStopActive);
    assert!(bus.take_torque(Some(&[drive])));
    assert!(!bus.drive(drive).unwrap().0.has_torque());
}

#[test]
fn a_gateway_does_not_stop_a_fast_drive_dead() {
    let drop = "[[fault]]\nwhat = \"drop\"\nat_tick = 60";
    for (speed, is_repeated) in [(1e-6, true), (1e-3, false)] {
        let (_, line) = simulated(&plan(), drop);
        let opener: Opener = Box::new(move || Ok(Box::new(line)));
        let shared = SharedBus::new(plan(), (SOURCE, 1), opener, None);
        shared.lend();
        let mut port = BusPort::new(shared, specimens().remove(1));
        port.connect().unwrap();
        assert!(port.arm(0, &[0.0], &mut || true).unwrap());
        let mut measured = Measurement::zeros(1);
        let mut refused = None;
        for k in 1..100u64 {
            port.issue(&command(k, &[speed * k as f64])).unwrap();
            let got = port.collect(Nanos(k * PERIOD_NS + PERIOD_NS * 500), &mut measured);
            if let Err(fault) = got {
                refused = Some(fault);
                break;
            }
        }
        let wanted = (!is_repeated).then_some(LinkFault::Timeout);
        assert_eq!(refused, wanted, "{speed}");
    }
}
