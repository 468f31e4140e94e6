//! A specimen on an EtherCAT bus, from the test file to the run folder: simulated devices in this process and behind a pair of network
//! interfaces.

#![cfg(feature = "ethercat")]

#[path = "../common/mod.rs"]
mod common;

mod certificate;
mod faults;
mod pair;
mod resume;
mod same_bits;

use std::path::Path;

use gusset_config::Loaded;
use gusset_ethercat::simulated::{Fault, FaultScript};

/// A storey on a bus. `axis` is what moves it, and `more` goes to its `[specimen.bus]`.
fn text(axis: &str, more: &str) -> String {
    format!(
        r#"
title = "bus"
[time]
rate_hz = 500
duration_s = 1
clock = "simulated"
[structure.shear_building]
mass_kg = [20e3, 18e3]
stiffness_n_per_m = [0, 12e6]
[structure.damping.rayleigh_ratio]
ratio = 0.02
modes = [1, 2]
[excitation.ground_acceleration]
signal.sine = {{ amplitude = 1.0, frequency_hz = 2.0, duration_s = 1 }}
[bus.rig]
interface = "gusset-none"
[[bus.rig.device]]
name = "cell"
product = {{ vendor = 2, code = 7 }}
inputs = ["6000:01 u16 state", "6000:11 f64 force", "6000:12 f64 disp", "6000:13 u8 interlock"]
[[bus.rig.device]]
name = "servo"
product = {{ vendor = 2, code = 8 }}
outputs = ["7000:01 f64 command"]
setup = ["8000:05 u8 2"]
[[bus.rig.device]]
name = "axis 1"
product = {{ vendor = 2, code = 9 }}
outputs = ["6040:00 u16", "607a:00 i32"]
inputs = ["6041:00 u16", "6064:00 i32"]
[[specimen]]
name = "storey"
storey = 1
stiffness_n_per_m = 10e6
[specimen.law.bilinear]
stiffness_n_per_m = 10e6
yield_force_n = 40e3
post_yield_ratio = 0.05
[specimen.limits]
command_disp_m = {{ trip = [-0.05, 0.05] }}
command_accel_m_per_s2 = {{ trip = 40 }}
measured_force_n = {{ trip = [-100e3, 100e3] }}
[specimen.bus]
bus = "rig"
probe = "none"
{more}
[[specimen.bus.axis]]
{axis}
force = {{ at = "cell.force", n_per_count = 1.0 }}
good = {{ at = "cell.state", mask = 0x43, equals = 0 }}
"#
    )
}

const OUTPUT: &str = "command = { at = \"servo.command\", m_per_count = 1.0 }\ndisp = { at = \"cell.disp\", m_per_count = 1.0 }";
const DRIVE: &str = "drive = { device = \"axis 1\", m_per_count = 1e-7 }";
const INTERLOCK: &str = "interlock = { at = \"cell.interlock\", equals = 1 }";

fn load(folder: &Path, text: &str) -> Loaded {
    let path = folder.join("test.toml");
    std::fs::write(&path, text).unwrap();
    gusset_config::load(&path, &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn script(text: &str) -> Vec<Fault> {
    if text.is_empty() {
        return Vec::new();
    }
    let script: FaultScript = toml::from_str(text).unwrap();
    script.fault
}

#[test]
fn a_scale_beyond_its_entry_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let counts = |text: String| text.replace("7000:01 f64 command", "7000:01 i16 command");
    let standing = text(OUTPUT, "stands_at_m = [0.045]");
    let standing = counts(standing).replace(
        "servo.command\", m_per_count = 1.0",
        "servo.command\", m_per_count = 1e-6",
    );
    // 32 767 counts are 98 kN, and the trip level is 100 kN.
    let force = text(OUTPUT, "stands_at_m = [0.0]")
        .replace("6000:11 f64 force", "6000:11 i16 force")
        .replace("n_per_count = 1.0", "n_per_count = 3.0");
    for (text, key) in [(&standing, "stands_at_m"), (&force, "measured_force_n")] {
        let loaded = load(folder.path(), text);
        let error = gusset_setup::build(&loaded).err().map(|e| e.to_string());
        assert!(error.is_some_and(|text| text.contains(key)), "{key}");
    }
}

/// An output whose specimen takes no part would be commanded to 0.
#[test]
fn identify_leaves_no_output_of_a_bus_out() {
    let folder = tempfile::tempdir().unwrap();
    let whole = text(DRIVE, "");
    let (_, specimen) = whole.split_once("[[specimen]]").unwrap();
    let other = format!("[[specimen]]{specimen}")
        .replace("\"storey\"\nstorey = 1", "\"other\"\nstorey = 2")
        .replace("probe = \"none\"", "probe = \"none\"\nstands_at_m = [0.01]")
        .replace(DRIVE, OUTPUT);
    let path = folder.path().join("test.toml");
    std::fs::write(&path, format!("{whole}{other}")).unwrap();
    for (name, left) in [("storey", Some("\"other\"")), ("other", None)] {
        let mut identify = common::gusset();
        identify.arg("identify").arg(&path);
        let said = identify
            .args(["--specimen", name, "--yes"])
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&said.stderr);
        let is_refused = errors.contains("--specimen: ");
        assert_eq!(is_refused, left.is_some(), "{errors}");
        assert!(left.is_none_or(|left| errors.contains(left)), "{errors}");
    }
}
