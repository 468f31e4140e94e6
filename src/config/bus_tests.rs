//! The tables of a bus: read, linked, written, and every rule.

use std::path::Path;

use super::*;
use crate::link_table::Protocol;
use gusset_wire::process_data::Kind;

/// A test with a servo controller behind an output terminal, and with all keys of a bus.
const RIG: &str = r#"
[time]
rate_hz = 1000
duration_s = 1
[structure.shear_building]
mass_kg = [1000.0]
stiffness_n_per_m = [1e6]
[bus.rig]
interface = "enp3s0"
clock = "free"
watchdog_s = 0.05
stale_ticks = 5
[[bus.rig.device]]
name = "load cell"
product = { vendor = 0x2, code = 0x0c1e3052, revision = 0x110000 }
inputs = ["6000:01 u16 state", "6000:11 i16 force", "6010:11 i32 stroke"]
[[bus.rig.device]]
name = "servo"
product = { vendor = 0x2, code = 0x10063052 }
outputs = ["7000:01 i16 command", "7010:01 i16"]
inputs = ["6000:01 u8 estop"]
setup = ["8000:05 u8 0x02"]
assign = true
accept = "zero volts on watchdog"
accept_reason = "the controller has its own limit"
[[specimen]]
name = "brace"
storey = 1
stiffness_n_per_m = 1e6
[specimen.limits]
command_disp_m = { trip = [-0.1, 0.1] }
measured_force_n = { trip = [-1e5, 1e5] }
[specimen.bus]
bus = "rig"
sample_after = 0.7
probe_m = 1e-4
probe_ramp_s = 2.0
stands_at_m = [0.01]
connect_timeout_s = 7.0
axis_names = ["north"]
interlock = { at = "servo.estop", equals = 1 }
[[specimen.bus.axis]]
command = { at = "servo.command", m_per_count = 3.05e-6, offset_count = 12 }
force = { at = "load cell.force", n_per_count = 3.05, zero_count = -4 }
disp = { at = "load cell.stroke", m_per_count = -1e-6 }
good = [{ at = "load cell.state", mask = 0x43, equals = 0 }]
"#;

fn read(text: &str, sets: &[&str]) -> Result<Loaded, String> {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    parse(Path::new("test.toml"), text.to_owned(), &sets).map_err(|error| error.to_string())
}

#[test]
fn bus_is_read_and_reads_back() {
    let loaded = read(RIG, &[]).unwrap();
    let file = &loaded.file;
    let bus = &file.bus["rig"];
    let servo = bus.device("servo").unwrap();
    assert_eq!(servo.product.code, 0x1006_3052);
    assert_eq!((servo.setup[0].entry.sub, servo.setup[0].value), (5, 2.0));
    assert_eq!(servo.outputs[0].kind, Kind::I16);
    let spec = file.specimen[0].bus.as_ref().unwrap();
    assert_eq!(spec.axis[0].good[0].mask, Some(0x43));
    assert_eq!(spec.interlock[0].equals, 1);
    let text = resolve(file, None, &loaded.inputs()).unwrap();
    assert!(!text.contains("specimen.link"), "{text}");
    let again = read(&text, &[]).unwrap().file;
    assert_eq!((&again.bus, &again.specimen), (&file.bus, &file.specimen));
}

#[test]
fn bus_specimen_has_a_link() {
    let loaded = read(RIG, &[]).unwrap();
    let link = loaded.file.specimen[0].link.as_ref().unwrap();
    assert_eq!(link.protocol, Protocol::Ethercat);
    assert_eq!(link.address, "rig");
    assert_eq!((link.max_stale, link.watchdog_s), (Some(5), Some(0.05)));
    assert_eq!((link.sample_after, link.probe_m), (Some(0.7), Some(1e-4)));
    assert_eq!(link.stands_at_m, Some(vec![0.01]));
    let next = read(RIG, &["specimen.0.bus.sample=next_tick"]).unwrap();
    let link = next.file.specimen[0].link.as_ref().unwrap();
    assert_eq!(link.sample_after, None);
}
