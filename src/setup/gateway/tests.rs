//! A gateway that converts: work, positions, limits, the wiring check, and the bits of a test in this process.

mod compensated;
mod predicted;
mod recorded;
mod schedules;
mod stops;

use std::sync::{Arc, Mutex};

use proptest::prelude::*;

use super::conversion::{self, Client};
use gusset_config::{DispUnit, ForceUnit, KeyPath, SpecimenTable};
use gusset_control::port::{AxisSpec, LoadingUnitSpec, PortSpec, PoseRow, ReceivedPort};
use gusset_link::served::{
    Controller, LinkBuild, Pacing, ServedSpecimen, Trip, simulated_pace as simulated,
};
use gusset_link::server::Host;
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::frame::{AtAxis, AtStructure};
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;

const SI: (DispUnit, ForceUnit) = (DispUnit::Metre, ForceUnit::Newton);

/// Forces of the axes for their displacements, in the units of the axes.
type Law = Arc<dyn Fn(&[f64]) -> Vec<f64> + Send + Sync>;

/// Displacements and velocities of one command after the other.
type Told = Arc<Mutex<Vec<[Vec<f64>; 2]>>>;

/// A machine that follows its command at once, and reports its position.
#[derive(Clone)]
struct Rig {
    law: Law,
    standing: Vec<f64>,
    told: Told,
    sequence: u64,
}

impl Substructure for Rig {
    fn axes(&self) -> usize {
        self.standing.len()
    }
    fn is_remote(&self) -> bool {
        true
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        Ok(Introduction {
            standing: self.standing.clone(),
            ..Introduction::default()
        })
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        let motion = [command.disp.to_vec(), command.vel.to_vec()];
        self.told.lock().unwrap().push(motion);
        self.sequence = command.sequence;
        Ok(())
    }
    fn collect(&mut self, _: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        let told = self.told.lock().unwrap();
        let [disp, _] = told.last().unwrap();
        into.sequence = self.sequence;
        into.disp.copy_from_slice(disp);
        into.force.copy_from_slice(&(self.law)(disp));
        Ok(Freshness::Fresh)
    }
    fn retire(&mut self, _: Retirement) {}
}

/// The machine behind a gateway, and its gateway.
struct Behind {
    told: Told,
    host: Host,
}

fn behind(table: &str, units: (DispUnit, ForceUnit), standing: &[f64], law: Law) -> Behind {
    let client = Client {
        units: Some(units),
        ..Client::default()
    };
    behind_for(client, table, standing, law)
}

/// A gateway whose targets become paths of commands.
fn behind_paced(table: &str) -> Behind {
    let client = Client {
        units: Some(SI),
        is_paced: true,
        ..Client::default()
    };
    let Behind { told, host } = behind_for(client, table, &REST, springs());
    Behind {
        told,
        host: host.paced(Some(PACING)),
    }
}

fn behind_for(client: Client, table: &str, standing: &[f64], law: Law) -> Behind {
    let told = Told::default();
    let rig = Rig {
        law,
        standing: standing.to_vec(),
        told: Arc::clone(&told),
        sequence: 0,
    };
    Behind {
        told,
        host: host_of(table, client, rig),
    }
}

/// A gateway to this rig.
fn host_of(table: &str, client: Client, rig: impl Substructure + Clone + Sync + 'static) -> Host {
    let table: SpecimenTable = toml::from_str(table).unwrap();
    let build: LinkBuild = Arc::new(move |_: &Controller| {
        let link: Box<dyn Substructure> = Box::new(rig.clone());
        Ok(link)
    });
    let at = KeyPath::root().key("specimen").index(0);
    let link = table.link.clone().unwrap();
    let (host, check) = conversion::host(&table, &link, &at, client, build).unwrap();
    let host = host.limited(table.limits_of(table.axes()));
    host.checked(check, false)
}

impl Behind {
    /// A session has begun.
    fn begun(&self) -> ServedSpecimen {
        let mut served = self.host.specimen(false).unwrap();
        let controller = Controller::nobody();
        served.begin(&controller, &mut || Ok(())).unwrap();
        served
    }

    /// The last command to the machine.
    fn last(&self) -> [Vec<f64>; 2] {
        self.told.lock().unwrap().last().unwrap().clone()
    }
}

fn goes(
    served: &mut ServedSpecimen,
    sequence: u64,
    disp: &[f64],
    vel: &[f64],
) -> Result<Measurement, Trip> {
    let command = Command {
        sequence,
        time: 0.01 * sequence as f64,
        dt: 0.01,
        disp,
        vel,
    };
    let mut into = Measurement::zeros(disp.len());
    served.exchange(&command, 0.01, &mut || true, &mut into)?;
    Ok(into)
}

/// Three actuators in the plane at a platform of half scale, with units, a lever and a reversed axis.
const PLATFORM: &str = r#"
    name = "platform"
    stiffness_n_per_m = [[4e6, 0.0, 0.0], [0.0, 5e6, 0.0], [0.0, 0.0, 6e6]]
    similitude = { length = 2.0, force = 4.0, time = 1.5 }
    geometry.law_at = "actuators"
    geometry.plane = [
        { base_m = [-1.0, 0.4], joint_m = [0.0, 0.4] },
        { base_m = [-1.0, -0.4], joint_m = [0.0, -0.4] },
        { base_m = [0.1, -1.2], joint_m = [0.1, 0.0] },
    ]
    axis = [
        { unit_disp = "mm", unit_force = "kN", sign = -1, offset_m = 0.004 },
        { unit_disp = "in", unit_force = "kip", scale = 0.5 },
        { offset_n = 120.0 },
    ]
    limits = { command_step_m = { trip = 0.5 } }
    link = { address = "127.0.0.1:1", probe = "none" }
"#;

/// Metres and newtons in one unit of the axes of the platform.
const AXES: [(f64, f64); 3] = [(1e-3, 1e3), (0.0254, 4_448.221_615_260_5), (1.0, 1.0)];

/// Strokes of the actuators at the reference pose of the platform.
const REST: [f64; 3] = [4.0, 0.0, 0.0];

/// Springs and a coupling, in the units of the axes.
fn springs() -> Law {
    Arc::new(|disp: &[f64]| {
        let sum: f64 = disp
            .iter()
            .zip(AXES)
            .map(|(d, (metres, _))| d * metres)
            .sum();
        let axes = disp.iter().zip(AXES).enumerate();
        axes.map(|(index, (disp, (metres, newtons)))| {
            let stiffness = 1e6 * (index + 4) as f64;
            (stiffness * disp * metres + 2e5 * sum) / newtons
        })
        .collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Power at the client equals that of the actuators, at the scale of the structure: forces belong to velocities.
    #[test]
    fn client_forces_do_the_actuators_work(
        pose in [-0.06..0.06f64, -0.06..0.06f64, -0.1..0.1f64],
        rates in [-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64],
    ) {
        let units = (DispUnit::Inch, ForceUnit::Kip);
        let rig = behind(PLATFORM, units, &REST, springs());
        let mut served = rig.begun();
        let [inch, kip] = [0.0254, 4_448.221_615_260_5];
        let (metres, newtons) = ([inch, inch, 1.0], [kip, kip, kip * inch]);
        let disp: Vec<f64> = pose.iter().zip(metres).map(|(q, unit)| q / unit).collect();
        let vel: Vec<f64> = rates.iter().zip(metres).map(|(v, unit)| v / unit).collect();
        let answer = goes(&mut served, 0, &disp, &vel).unwrap();
        let [told, told_vel] = rig.last();
        let forces = springs()(&told);
        let zero = [0.0, 0.0, 120.0];
        let (mut actuators, mut size) = (0.0, 0.0);
        for (axis, (metres, newtons)) in AXES.iter().enumerate() {
            let force = (forces[axis] - zero[axis]) * newtons;
            let power = force * told_vel[axis] * metres;
            actuators += power * 2.0 * 4.0 / 1.5;
            size += (power * 2.0 * 4.0 / 1.5).abs();
        }
        let client: f64 = (0..3)
            .map(|i| answer.force[i] * newtons[i] * vel[i] * metres[i])
            .sum();
        prop_assert!((client - actuators).abs() <= 1e-12 * size, "{client} {actuators}");
        for (found, asked) in answer.disp.iter().zip(&disp) {
            prop_assert!((found - asked).abs() <= 1e-12 * (1.0 + asked.abs()));
        }
    }

    /// A port of a test with this geometry sends and measures the same bits for these commands.
    #[test]
    fn gateway_gives_the_bits_of_a_local_port(
        poses in proptest::collection::vec([-0.02..0.02f64, -0.02..0.02f64, -0.03..0.03f64], 1..20),
    ) {
        let rig = behind(PLATFORM, SI, &REST, springs());
        let mut served = rig.begun();
        let table: SpecimenTable = toml::from_str(PLATFORM).unwrap();
        let told = Told::default();
        let own = Rig {
            law: springs(),
            standing: REST.to_vec(),
            told: Arc::clone(&told),
            sequence: 0,
        };
        let mut port = in_process(&table, own).build().unwrap();
        for (sequence, pose) in (0..).zip(&poses) {
            let vel = pose.map(|q| 3.0 * q);
            let answer = goes(&mut served, sequence, pose, &vel).unwrap();
            port.aim_at(&mut pose.iter().copied().zip(vel).map(AtStructure));
            prop_assert_eq!(port.clear().trip, None);
            port.issue(sequence, 0.0, 0.01).unwrap();
            port.collect(Nanos(0)).unwrap();
            port.judge();
            port.resolve_pose().unwrap();
            let here = told.lock().unwrap().last().cloned();
            prop_assert_eq!(here, Some(rig.last()));
            let found: Vec<[f64; 3]> = port.loading_unit().unwrap().pose().map(|(_, values)| values).collect();
            for (index, [_, disp, force]) in found.into_iter().enumerate() {
                prop_assert_eq!(answer.disp[index].to_bits(), disp.to_bits());
                prop_assert_eq!(answer.force[index].to_bits(), force.to_bits());
            }
        }
    }
}

/// The port of a test with a prescribed deformation, as [`crate::specimens`] puts it together.
fn in_process(table: &SpecimenTable, rig: Rig) -> PortSpec {
    use crate::gear::axis;
    let axes = table.axis.iter();
    let axes = axes.zip([4e6, 5e6, 6e6]);
    let axes = axes.map(|(gear, k)| AxisSpec::new(axis(table, gear, Vec::new()).0, k));
    let unit = table.geometry.as_ref().unwrap();
    let mut spec = PortSpec::new("rig", Box::new(rig), 1, axes.collect());
    spec.loading_unit = Some(LoadingUnitSpec {
        geometry: unit.build(table.similitude.length).unwrap(),
        rows: vec![PoseRow::default(); 3],
        law_at: unit.law_at,
    });
    spec
}

#[test]
fn reversed_lever_converts_units_and_limits() {
    let table = r#"
        name = "damper"
        stiffness_n_per_m = 1e6
        similitude = { length = 2.0, force = 8.0 }
        axis = [{ unit_disp = "mm", unit_force = "kN", sign = -1, scale = 0.5, offset_m = 0.01, offset_n = 250.0 }]
        limits = { command_disp_m = { trip = [-0.02, 0.03] }, measured_force_n = { trip = [-5e3, 5e3] } }
        link = { address = "127.0.0.1:1", probe = "none" }
    "#;
    let law: Law = Arc::new(|disp: &[f64]| vec![0.25 + 0.02 * (disp[0] - 10.0)]);
    let rig = behind(table, (DispUnit::Inch, ForceUnit::Kip), &[10.0], law);
    let mut served = rig.begun();
    // 0.1 in are 2.54 mm at the structure, 1.27 mm at the specimen, −0.635 mm behind the lever.
    let answer = goes(&mut served, 0, &[0.1], &[1.0]).unwrap();
    let [told, vel] = rig.last();
    assert!(
        (told[0] - 9.365).abs() < 1e-12 && (vel[0] + 6.35).abs() < 1e-12,
        "{told:?} {vel:?}"
    );
    // −0.0127 kN there are 8 · 0.5 · 12.7 N at the structure.
    let kips = 50.8 / 4_448.221_615_260_5;
    assert!((answer.disp[0] - 0.1).abs() < 1e-13, "{}", answer.disp[0]);
    assert!(
        (answer.force[0] - kips).abs() < 1e-15,
        "{}",
        answer.force[0]
    );
    // k̂ of the file is that of the structure, in kip/in.
    let stiffness = served.stiffness()[0];
    assert!((stiffness - 1e6 * 0.0254 / 4_448.221_615_260_5).abs() < 1e-12);
    // The actuator ends at 30 mm: 20 mm from its zero, −80 mm of the structure.
    let Err(Trip::Limit(hit)) = goes(&mut served, 1, &[-80.1 / 25.4], &[0.0]) else {
        panic!("it leaves");
    };
    assert_eq!(hit.quantity, Limit::CommandDisp);
    assert!((hit.value - 0.030_025).abs() < 1e-12, "{}", hit.value);
    assert_eq!(
        rig.told.lock().unwrap().len(),
        2,
        "the first asks for the force at rest"
    );
}

#[test]
fn platform_is_found_from_its_actuators() {
    let reference = behind(PLATFORM, SI, &REST, springs());
    let mut served = reference.begun();
    let pose = [0.03, -0.02, 0.05];
    goes(&mut served, 0, &pose, &[0.0; 3]).unwrap();
    let [strokes, _] = reference.last();
    drop(served);
    let left = reference.host.standing();
    for (found, pose) in left.iter().zip(pose) {
        assert!((found - pose).abs() < 1e-13, "{left:?}");
    }
    // Another machine is at this pose from the beginning.
    let rig = behind(PLATFORM, SI, &strokes, springs());
    let served = rig.begun();
    let at_rest = served.measured();
    for (found, pose) in at_rest.disp.iter().zip(pose) {
        assert!((found - pose).abs() < 1e-13, "{at_rest:?}");
    }
    assert!(at_rest.force.iter().all(|force| force.abs() > 1.0));
    let told = rig.told.lock().unwrap().clone();
    for (told, stroke) in told[0][0].iter().zip(&strokes) {
        assert!((told - stroke).abs() < 1e-12, "nothing has moved");
    }
    drop(served);
    // A controller that arms at the reported position is accepted, and one that arms elsewhere is not.
    let stands = rig.host.standing();
    for (start, is_there) in [(stands, true), (vec![0.0; 3], false)] {
        let controller = Controller {
            start,
            ..Controller::nobody()
        };
        let mut served = rig.host.specimen(false).unwrap();
        assert_eq!(served.begin(&controller, &mut || Ok(())).is_ok(), is_there);
    }
}

#[test]
fn impossible_pose_trips_and_moves_nothing() {
    let table = PLATFORM.replace(
        "joint_m = [0.1, 0.0] }",
        "joint_m = [0.1, 0.0], length_m = [1.1, 1.3] }",
    );
    let rig = behind(&table, SI, &REST, springs());
    let mut served = rig.begun();
    let before = rig.told.lock().unwrap().len();
    // 0.1 m of the specimen is 0.2 m of the structure.
    let tripped = goes(&mut served, 0, &[0.0, 0.21, 0.0], &[0.0; 3]);
    assert!(matches!(tripped, Err(Trip::Geometry(_))), "{tripped:?}");
    assert_eq!(served.tripped().map(Trip::code), Some(53));
    assert_eq!(rig.told.lock().unwrap().len(), before);
}

#[test]
fn wiring_check_moves_one_actuator_at_once() {
    let probed = PLATFORM.replace(r#"probe = "none""#, "probe_m = 0.001, probe_ramp_s = 0.05");
    let controller = Controller::nobody();
    // The estimate is that of the machine, and not of the structure.
    let rig = behind(&probed, SI, &REST, springs());
    let mut forgotten = rig.host.specimen(false).unwrap();
    let refused = forgotten.begin(&controller, &mut || Ok(())).unwrap_err();
    assert!(refused.text.contains("accept_wiring"), "{}", refused.text);
    // Forces by 4 over lengths by 2, and the lever of the second axis twice.
    let probed = probed.replace(
        "[[4e6, 0.0, 0.0], [0.0, 5e6, 0.0], [0.0, 0.0, 6e6]]",
        "[[8e6, 0.0, 0.0], [0.0, 2.5e6, 0.0], [0.0, 0.0, 12e6]]",
    );
    let rig = behind(&probed, SI, &REST, springs());
    drop(rig.begun());
    let told = rig.told.lock().unwrap().clone();
    for (axis, (metres, _)) in AXES.iter().enumerate() {
        let way = told
            .iter()
            .map(|[disp, _]| (disp[axis] - REST[axis]) * metres);
        let most = way.fold(0.0, |most: f64, way| most.max(way.abs()));
        assert!((most - 0.001).abs() < 1e-9, "axis {axis}: {most}");
    }
    for [disp, _] in &told {
        let moved = disp
            .iter()
            .zip(REST)
            .filter(|(disp, rest)| (*disp - rest).abs() > 1e-12);
        assert!(moved.count() <= 1);
    }
    // A load cell with reversed wiring.
    let reversed: Law = Arc::new(|disp: &[f64]| {
        let mut forces = springs()(disp);
        forces[1] = -forces[1];
        forces
    });
    let rig = behind(&probed, SI, &REST, reversed);
    let mut served = rig.host.specimen(false).unwrap();
    let refused = served.begin(&controller, &mut || Ok(())).unwrap_err();
    assert!(refused.text.contains("axis 2"), "{}", refused.text);
}

#[test]
fn client_receives_coordinate_stiffness() {
    let rig = behind(PLATFORM, SI, &REST, springs());
    let served = rig.host.specimen(false).unwrap();
    // At the structure's scale the joints are at y = ±0.8 m and x = 0.2 m.
    let [k1, k2, k3] = [4e6, 5e6, 6e6];
    let turning = 0.64 * (k1 + k2) + 0.04 * k3;
    let wanted = [
        [k1 + k2, 0.0, 0.8 * (k2 - k1)],
        [0.0, k3, 0.2 * k3],
        [0.8 * (k2 - k1), 0.2 * k3, turning],
    ];
    for (found, wanted) in served.stiffness().iter().zip(wanted.as_flattened()) {
        assert!((found - wanted).abs() < 1e-3, "{found} {wanted}");
    }
    assert_eq!(served.axes(), 3);
}

const PACING: Pacing = Pacing {
    ticks: 20,
    settle_ticks: 0,
    period_ns: 200_000,
    clock: simulated::CLOCK,
    predict: None,
};

#[test]
fn paced_target_moves_from_rest_to_rest() {
    let rig = behind_paced(PLATFORM);
    let mut served = rig.begun();
    let mut plain = behind(PLATFORM, SI, &REST, springs()).begun();
    for (sequence, pose) in (0..).zip([[0.01, -0.02, 0.03], [0.012, 0.0, 0.03], [-0.02, 0.01, 0.0]])
    {
        let before = rig.told.lock().unwrap().len();
        let answer = goes(&mut served, sequence, &pose, &[0.0; 3]).unwrap();
        let told = rig.told.lock().unwrap()[before..].to_vec();
        assert_eq!(told.len(), 20);
        // The target and its answer are those of a gateway that does not pace, to the last bit.
        let wanted = goes(&mut plain, sequence, &pose, &[0.0; 3]).unwrap();
        assert_eq!((answer.disp, answer.force), (wanted.disp, wanted.force));
        assert_eq!(answer.sequence, sequence);
        assert!(told[19][1].iter().all(|vel| vel.abs() < 1e-9));
        // At half the time the platform is at half the distance.
        let poses = told
            .iter()
            .map(|[disp, _]| port_of_platform().signals_at(AtAxis(disp)).unwrap().0);
        let poses: Vec<Vec<f64>> = poses.collect();
        assert!((poses[9][2] - 0.5 * (poses[19][2] + before_of(sequence))).abs() < 1e-12);
    }
}

#[test]
fn paced_velocities_are_command_slopes() {
    let table = PLATFORM.replace("time = 1.5", "time = 2.0");
    assert_ne!(table, PLATFORM);
    let rig = behind_paced(&table);
    let mut served = rig.begun();
    // The first target is reached by a ramp, the second by a path.
    for (sequence, pose) in (0..).zip([[0.01, -0.02, 0.03], [-0.02, 0.01, 0.0]]) {
        let before = rig.told.lock().unwrap().len();
        goes(&mut served, sequence, &pose, &[0.0; 3]).unwrap();
        let told = rig.told.lock().unwrap()[before - 1..].to_vec();
        let tick = 200e-6;
        for axis in 0..3 {
            let way = told.last().unwrap()[0][axis] - told[0][0][axis];
            let sum: f64 = told.iter().map(|[_, vel]| vel[axis] * tick).sum();
            assert!((sum - way).abs() < 1e-2 * way.abs(), "{axis}: {sum} {way}");
        }
    }
}

/// The rotation of the target before this one.
fn before_of(sequence: u64) -> f64 {
    if sequence == 0 { 0.0 } else { 0.03 }
}

fn port_of_platform() -> ReceivedPort {
    let rig = Rig {
        law: springs(),
        standing: REST.to_vec(),
        told: Told::default(),
        sequence: 0,
    };
    let spec = in_process(&toml::from_str(PLATFORM).unwrap(), rig);
    spec.build_received().unwrap()
}

/// OpenSees sends each displacement twice: with the velocity that it predicts, and with that of the end of the step.
#[test]
fn repeated_target_moves_nothing() {
    let rig = behind_paced(PLATFORM);
    let mut served = rig.begun();
    let pose = [0.01, 0.0, 0.02];
    goes(&mut served, 0, &[0.0; 3], &[0.0; 3]).unwrap();
    served.commit();
    let first = goes(&mut served, 1, &pose, &[0.0; 3]).unwrap();
    let before = rig.told.lock().unwrap().len();
    let again = goes(&mut served, 2, &pose, &[0.5; 3]).unwrap();
    assert_eq!(rig.told.lock().unwrap().len(), before);
    assert_eq!((again.disp, again.force), (first.disp, first.force));
    assert_eq!(again.sequence, 2);
    // In the next step its time passes.
    served.commit();
    goes(&mut served, 3, &pose, &[0.0; 3]).unwrap();
    assert_eq!(rig.told.lock().unwrap().len(), before + 20);
    // A NaN velocity trips.
    let fault = goes(&mut served, 4, &pose, &[f64::NAN; 3]);
    assert!(matches!(fault, Err(Trip::NotFinite { axis: Some(0), .. })));
}

#[test]
fn late_client_finds_the_last_target() {
    let rig = behind_paced(PLATFORM);
    let mut served = rig.begun();
    goes(&mut served, 0, &[0.01, 0.0, 0.0], &[0.0; 3]).unwrap();
    let told = rig.told.lock().unwrap().clone();
    simulated::pass(20_000_000);
    served.attend().unwrap();
    drop(served);
    assert_eq!(*rig.told.lock().unwrap(), told);
    // A stop of the server on the path to the second target slows the specimen down.
    let mut served = rig.begun();
    for (sequence, goal) in [(0, 0.02), (1, 0.04)] {
        let before = rig.told.lock().unwrap().clone();
        let mut asked = 0;
        let mut wanted = || {
            asked += 1;
            asked <= 8 || sequence == 0
        };
        let command = Command {
            sequence,
            time: 0.0,
            dt: 0.01,
            disp: &[goal, 0.0, 0.0],
            vel: &[0.0; 3],
        };
        let mut into = Measurement::zeros(3);
        let outcome = served.exchange(&command, 0.01, &mut wanted, &mut into);
        assert_eq!(outcome, Ok(sequence == 0));
        let told = rig.told.lock().unwrap()[before.len()..].to_vec();
        assert!(told.len() > 8 && told.len() <= 29, "{}", told.len());
        assert!(told.last().unwrap()[1].iter().all(|vel| vel.abs() < 1e-9));
        let strokes = told.iter().map(|[disp, _]| disp[0]);
        let mut last = before.last().unwrap()[0][0];
        for stroke in strokes {
            // 20 mm of the structure are 10 mm of the actuator, and 1.875/20 of them the most in one command.
            assert!((stroke - last).abs() < 1.0, "{stroke} {last}");
            last = stroke;
        }
    }
    // A stop before the first command of a path: nothing moves.
    let before = rig.told.lock().unwrap().len();
    let command = Command {
        sequence: 2,
        time: 0.0,
        dt: 0.01,
        disp: &[0.0; 3],
        vel: &[0.0; 3],
    };
    let mut into = Measurement::zeros(3);
    let outcome = served.exchange(&command, 0.01, &mut || false, &mut into);
    assert_eq!(
        (outcome, rig.told.lock().unwrap().len()),
        (Ok(false), before)
    );
}

#[test]
fn target_beyond_its_bound_is_refused() {
    let table = PLATFORM.replace(
        "limits = { command_step_m = { trip = 0.5 } }",
        "limits = { command_disp_m = { trip = [-0.02, 0.02] }, command_step_m = { trip = 0.5 } }",
    );
    let rig = behind_paced(&table);
    let mut served = rig.begun();
    let before = rig.told.lock().unwrap().len();
    // 0.05 m of the structure is 0.025 m of the third actuator.
    let Err(Trip::Limit(hit)) = goes(&mut served, 0, &[0.0, 0.05, 0.0], &[0.0; 3]) else {
        panic!("it leaves");
    };
    assert_eq!((hit.axis, hit.quantity), (2, Limit::CommandDisp));
    assert_eq!(rig.told.lock().unwrap().len(), before);
}
