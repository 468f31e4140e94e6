mod on_the_way;

use super::*;
use std::sync::Arc;

use crossbeam_channel::unbounded;

use crate::openfresco::{Nature, Role};
use crate::served::{Computed, ServedSpecimen, Trip};
use crate::server::connection::Connection;
use crate::server::wire_end::WireEnd;
use gusset_actuator::specimen::SpecimenLaw;
use gusset_quantity::substructure::{
    Command, Freshness, Introduction, LinkFault, Measurement, Retirement, Substructure, Unavailable,
};
use gusset_quantity::units::AxisUnits;
use gusset_wire::WireError;
use gusset_wire::openfresco::Carrier;

const LINEAR: &str = "law = { linear = { stiffness_n_per_m = 8000.0 } }";
const VISCOUS: &str = "law = { linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 50.0 } }";
/// Doubles of a vector.
const N: usize = 4;

/// A client of one axis that commands displacements and, if it is `timed`, times, and requests forces.
struct Client {
    codec: Codec,
    role: Role,
    host: Host,
    timed: i32,
}

impl Client {
    fn new(role: Role, law: &str, nature: Nature, timed: bool) -> Self {
        let law: SpecimenLaw = toml::from_str(law).unwrap();
        let mut host = Host::new(law.build(1).unwrap(), nature, Some(0.01));
        let controller = Controller::unnamed(([127, 0, 0, 1], 1).into());
        host.begin(&controller, &mut || Ok(())).unwrap();
        let mut codec = Codec::new(role, None, Carrier::Stream, 1);
        let timed = i32::from(timed);
        let sizes = [1, 0, 0, 0, timed, 0, 0, 0, 1, 0, N as i32];
        let bytes: Vec<u8> = sizes.into_iter().flat_map(i32::to_le_bytes).collect();
        codec.feed(&bytes).unwrap();
        Self {
            codec,
            role,
            host,
            timed,
        }
    }

    fn send(&mut self, code: f64, disp: f64, time: f64) -> Result<Vec<f64>, End> {
        let values = [code, disp, time * f64::from(self.timed), 0.0];
        let bytes: Vec<u8> = values.into_iter().flat_map(f64::to_le_bytes).collect();
        let (_, request) = self.codec.feed(&bytes).unwrap();
        let reply = obey(&mut self.codec, request, &mut self.host, &mut || true)?;
        let words = reply.chunks_exact(8);
        Ok(words
            .map(|word| f64::from_le_bytes(word.try_into().unwrap()))
            .collect())
    }

    /// The force of a command, which is committed then.
    fn step(&mut self, disp: f64, time: f64) -> f64 {
        self.send(3.0, disp, time).unwrap();
        // Behind the flag, where there is one.
        let at = usize::from(self.role == Role::Simulink);
        let force = self.send(6.0, 0.0, 0.0).unwrap()[at];
        // The time has the same place as in a command.
        self.send(5.0, 0.0, time).unwrap();
        force
    }
}

#[test]
fn held_damper_is_at_rest() {
    for role in [Role::Application, Role::Simulink] {
        for timed in [false, true] {
            let mut client = Client::new(role, VISCOUS, Nature::Simulated, timed);
            let commands = [0.0, 0.001, 0.002, 0.002, 0.002, 0.001];
            let forces = (0_i32..)
                .zip(commands)
                .map(|(k, disp)| client.step(disp, 0.01 * f64::from(k)));
            let forces: Vec<f64> = forces.collect();
            for (force, wanted) in forces.iter().zip([0.0, 5.0, 5.0, 0.0, 0.0, -5.0]) {
                assert!(
                    (force - wanted).abs() < 1e-9,
                    "{role:?} {timed}: {forces:?}"
                );
            }
        }
    }
    // This protocol has no commits: each target is a step.
    let mut client = Client::new(Role::Controller, VISCOUS, Nature::Simulated, false);
    for (disp, wanted) in [(0.0, 0.0), (0.001, 5.0), (0.001, 0.0)] {
        client.send(3.0, disp, 0.0).unwrap();
        let force = client.send(6.0, 0.0, 0.0).unwrap()[0];
        assert!((force - wanted).abs() < 1e-9, "{force} {wanted}");
    }
}

#[test]
fn physical_step_taken_back_ends_the_test() {
    for role in [Role::Application, Role::Simulink] {
        for timed in [false, true] {
            for nature in [Nature::Simulated, Nature::Physical] {
                let mut client = Client::new(role, LINEAR, nature, timed);
                client.step(0.0, 0.0);
                client.step(0.0004, 0.01);
                client.send(3.0, 0.0008, 0.02).unwrap();
                if nature == Nature::Simulated {
                    client.send(3.0, 0.0009, 0.02).unwrap();
                }
                let back = client.send(3.0, 0.0004, 0.01);
                match nature {
                    Nature::Simulated => assert!(back.is_ok(), "{role:?}"),
                    Nature::Physical => assert!(
                        matches!(
                            back,
                            Err(End::Refused(ExchangeFault::Host(
                                HostFault::TakenBack { .. }
                            )))
                        ),
                        "{role:?} {timed}: {back:?}"
                    ),
                }
            }
        }
    }
}

#[test]
fn physical_test_passes_through_zero() {
    for nature in [Nature::Simulated, Nature::Physical] {
        let mut client = Client::new(Role::Application, LINEAR, nature, false);
        for disp in [0.0, 0.0005, 0.001, 0.0005, 0.0] {
            client.send(3.0, disp, 0.0).unwrap();
            let force = client.send(10.0, 0.0, 0.0).unwrap()[0];
            assert!((force - 8e3 * disp).abs() < 1e-9);
        }
    }
}

/// Two targets of one test time are trials in each protocol. A repeated target is allowed.
#[test]
fn iterating_client_is_known_by_its_time() {
    for role in [Role::Application, Role::Controller, Role::Simulink] {
        for timed in [false, true] {
            let mut client = Client::new(role, LINEAR, Nature::Physical, timed);
            for (disp, time) in [(0.0, 0.0), (0.0004, 0.01), (0.0004, 0.01), (0.0008, 0.02)] {
                client.send(3.0, disp, time).unwrap();
            }
            let again = client.send(3.0, 0.0009, 0.02);
            let is_trial = matches!(
                again,
                Err(End::Refused(ExchangeFault::Host(HostFault::Tripped(
                    Trip::Trial(_)
                ))))
            );
            assert_eq!(is_trial, timed, "{role:?}: {again:?}");
        }
    }
}

/// Each target has the force of the last committed one behind it, also where a step is tried twice.
#[test]
fn a_trial_of_a_controller_is_not_accepted() {
    const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
    let mut client = Client::new(Role::Controller, BILINEAR, Nature::Simulated, true);
    for (disp, time) in [(0.0, 0.0), (0.005, 0.01), (0.0275, 0.02)] {
        client.send(3.0, disp, time).unwrap();
    }
    // Back from a trial at 27.5 mm, beyond the yield at 7.5 mm: still elastic.
    client.send(3.0, 0.006, 0.02).unwrap();
    let force = client.send(10.0, 0.0, 0.0).unwrap()[0];
    assert!((force - 48.0).abs() < 1e-9, "{force}");
}

#[test]
fn zeros_after_a_commit_keep_step_lengths() {
    let mut client = Client::new(Role::Application, VISCOUS, Nature::Simulated, true);
    for k in 0..5 {
        let (disp, time) = (0.001 * f64::from(k), 0.01 * f64::from(k));
        client.send(3.0, disp, time).unwrap();
        let force = client.send(10.0, 0.0, 0.0).unwrap()[0];
        // 1 mm in 10 ms at 50 N s/m.
        let wanted = if k > 0 { 5.0 } else { 0.0 };
        assert!((force - wanted).abs() < 1e-9, "{k}: {force}");
        client.send(5.0, 0.0, 0.0).unwrap();
    }
}

#[test]
fn return_to_the_start_is_reported() {
    const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
    let mut client = Client::new(Role::Application, BILINEAR, Nature::Simulated, true);
    client.step(0.0, 0.0);
    client.step(0.0275, 0.01);
    client.send(3.0, 0.0, 0.0).unwrap();
    assert!(client.codec.is_reset());
    // 27.5 mm are 20 mm beyond the yield: unloaded by 15 mm, and 12.5 mm beyond the other one.
    let force = client.send(10.0, 0.0, 0.0).unwrap()[0];
    assert!((force + 57.0).abs() < 1e-9, "{force}");
}

#[test]
fn falling_load_factor_ends_no_test() {
    for nature in [Nature::Simulated, Nature::Physical] {
        let mut client = Client::new(Role::Application, LINEAR, nature, true);
        client.step(0.0, 0.0);
        client.step(0.0004, 49.0);
        client.send(3.0, 0.0008, 56.0).unwrap();
        client.send(3.0, 0.0008, 47.0).unwrap();
        let force = client.send(6.0, 0.0, 0.0).unwrap()[0];
        assert!((force - 6.4).abs() < 1e-12);
    }
}

/// A spring that stops the server while it is moved for the tenth time.
struct Stopping {
    spring: Computed,
    shared: Arc<Shared>,
    trials: u32,
}

impl Substructure for Stopping {
    fn axes(&self) -> usize {
        1
    }
    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        self.spring.connect()
    }
    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.trials += 1;
        if self.trials == 10 {
            self.shared.stop();
        }
        self.spring.issue(command)
    }
    fn collect(&mut self, deadline: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.spring.collect(deadline, into)
    }
    fn retire(&mut self, how: Retirement) {
        self.spring.retire(how);
    }
}

#[test]
fn stop_request_ends_one_piece() {
    let (events_in, events) = unbounded();
    let shared = Arc::new(Shared::new(events_in));
    let law: SpecimenLaw = toml::from_str(LINEAR).unwrap();
    let rig = Stopping {
        spring: Computed::new(law.build(1).unwrap(), false),
        shared: Arc::clone(&shared),
        trials: 0,
    };
    let units = vec![AxisUnits::SI];
    let served = ServedSpecimen::new("spring".into(), Box::new(rig), units, vec![8e3], vec![0.0]);
    let mut host = Host::of(served, Nature::Simulated, None);
    let mut codec = Codec::new(Role::Application, None, Carrier::Stream, 1);
    let sizes = [1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2_i32].map(i32::to_le_bytes);
    let (_, Request::Sizes(sizes)) = codec.feed(sizes.as_flattened()).unwrap() else {
        panic!("these are the sizes");
    };
    let commands = (1..=100).flat_map(|k| [[3.0, 1e-4 * f64::from(k)], [5.0, 0.0]]);
    let early: Vec<u8> = commands.flatten().flat_map(f64::to_le_bytes).collect();
    let opening = OpenFrescoOpening {
        codec,
        sizes,
        early: vec![early],
    };
    let end = WireEnd::new(Nanos(0), 0);
    let channel = Channel {
        link: ClientLink::from(Connection::Simulated(Box::new(end))),
        peer: ([127, 0, 0, 1], 1).into(),
    };
    let settings = ServeSettings::new(Role::Application, None);
    attend(channel, opening, &mut host, &settings, true, &shared);
    let left = events.try_iter().find_map(|event| match event {
        ServerEvent::ClientLeft(_, end, tally) => Some((end, tally.commands)),
        _ => None,
    });
    assert_eq!(left, Some((End::Stopped, 10)));
}

/// SimFEAdapter announces the largest DOF of each quantity in its control points.
#[test]
fn sizes_of_another_specimen_are_refused() {
    for (signals, field, found) in [
        ([1, 0, 0, 0, 0, 2, 0, 0, 2, 0], "commanded displacements", 1),
        ([2, 0, 0, 0, 0, 1, 0, 0, 2, 0], "measured displacements", 1),
        ([2, 0, 0, 0, 0, 3, 0, 0, 2, 0], "measured displacements", 3),
    ] {
        let mut codec = Codec::new(Role::Controller, None, Carrier::Stream, 2);
        let mut bytes: Vec<u8> = signals.into_iter().flat_map(i32::to_le_bytes).collect();
        bytes.extend(256_i32.to_le_bytes());
        let expected = 2;
        let error = WireError::Count {
            field,
            expected,
            found,
        };
        assert_eq!(codec.feed(&bytes), Err(error));
        let text = error.to_string();
        assert!(
            text.contains('2') && text.contains(&found.to_string()),
            "{text}"
        );
    }
}
