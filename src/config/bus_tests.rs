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
[structure]
initial_displacement_m = [0.01]
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
sample_after = 0.6
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
    assert_eq!((link.sample_after, link.probe_m), (Some(0.6), Some(1e-4)));
    assert_eq!(link.stands_at_m, Some(vec![0.01]));
    let next = read(RIG, &["specimen.0.bus.sample=next_tick"]).unwrap();
    let link = next.file.specimen[0].link.as_ref().unwrap();
    assert_eq!(link.sample_after, None);
}

/// An axis with a drive, in place of the one with an output.
const DRIVE: &str = r#"
[[bus.rig.device]]
name = "axis 1"
product = { vendor = 0x1, code = 0x2 }
outputs = ["6040:00 u16", "607a:00 i32"]
inputs = ["6041:00 u16", "6064:00 i32", "2000:01 f32 torque"]
"#;

fn driven() -> String {
    let rig = RIG.replacen("[[specimen]]", &format!("{DRIVE}[[specimen]]"), 1);
    let command = r#"command = { at = "servo.command", m_per_count = 3.05e-6, offset_count = 12 }"#;
    let drive = r#"drive = { device = "axis 1", m_per_count = 1e-7 }"#;
    assert!(rig.contains(command));
    rig.replacen(command, drive, 1)
        .replacen("stands_at_m = [0.01]\n", "", 1)
        .replacen(
            "measured_force_n",
            "command_accel_m_per_s2 = { trip = 20.0 }\nmeasured_force_n",
            1,
        )
}

/// Paths and severities of all findings.
fn findings(text: &str) -> Vec<(String, Severity)> {
    let root = document::Node::parse(text).unwrap();
    let (_, findings) = judge::<TestFile>(&root, |file| check::check(file, false));
    let found = findings.into_iter();
    found
        .map(|one| (one.path.to_string(), one.severity))
        .collect()
}

/// Checks that each change of `text` has one finding, an error at this path.
#[track_caller]
fn refused(text: &str, changes: &[(&str, &str, impl AsRef<str>)]) {
    assert_eq!(findings(text), [], "unchanged");
    for (from, to, path) in changes {
        assert!(text.contains(from), "{from}");
        let changed = text.replacen(from, to, 1);
        let found = findings(&changed);
        assert_eq!(found, [(path.as_ref().to_owned(), Severity::Error)], "{to}");
    }
}

#[test]
fn rules_of_a_bus_hold() {
    refused(
        RIG,
        &[
            ("enp3s0", "", "bus.rig.interface"),
            ("enp3s0", "eth 0", "bus.rig.interface"),
            ("enp3s0", "much-too-long-name", "bus.rig.interface"),
            ("= 0.05", "= 0.001", "bus.rig.watchdog_s"),
            ("= 0.05", "= 0", "bus.rig.watchdog_s"),
            ("= 0.05", "= 61", "bus.rig.watchdog_s"),
            ("stale_ticks = 5", "stale_ticks = 0", "bus.rig.stale_ticks"),
            (
                "stale_ticks = 5",
                "stale_ticks = 1001",
                "bus.rig.stale_ticks",
            ),
            ("\"free\"", "\"fre\"", "bus.rig.clock"),
            ("interface = \"enp3s0\"\n", "", "bus.rig"),
            (
                "[structure",
                "[bus.shaker]\ninterface = \"eth1\"\ndevice = [{ name = \"a\", product = { vendor = 1, code = 1 } }]\n[structure",
                "bus.shaker",
            ),
        ],
    );
}

#[test]
fn rules_of_a_device_hold() {
    let device = "bus.rig.device[1]";
    let inputs = r#"inputs = ["6000:01 u8 estop"]"#;
    let large = format!(
        "inputs = [\"6000:01 u8 estop\"{}]",
        ", \"2000:01 f64\"".repeat(175)
    );
    let at = |key: &str| format!("{device}.{key}");
    let further = |name: &str| {
        format!(
            "[[bus.rig.device]]\nname = \"{name}\"\nproduct = {{ vendor = 1, code = 1 }}\n[[specimen]]"
        )
    };
    let (twin, dotted) = (further("servo"), further("ser.vo"));
    let changes = [
        (
            "[[specimen]]",
            twin.as_str(),
            "bus.rig.device[2].name".to_owned(),
        ),
        (
            "[[specimen]]",
            dotted.as_str(),
            "bus.rig.device[2].name".to_owned(),
        ),
        ("7010:01 i16\"", "7010:01 i24\"", at("outputs[1]")),
        ("7010:01 i16\"", "7010 i16\"", at("outputs[1]")),
        ("7010:01 i16\"", "7010:01 i16 command\"", at("outputs[1]")),
        ("7010:01 i16\"", "0000:00 i16 gap\"", at("outputs[1]")),
        ("u8 0x02", "u8 0x102", at("setup[0]")),
        (
            "accept = \"zero volts on watchdog\"",
            "",
            at("accept_reason"),
        ),
        ("accept = \"zero volts", "accept = \"zero", at("accept")),
        (
            "accept_reason = \"the controller has its own limit\"",
            "",
            at("accept"),
        ),
        ("the controller has its own limit", " ", at("accept_reason")),
        (
            "zero volts on watchdog",
            "torque off at quick stop",
            at("accept"),
        ),
        (inputs, &large, device.to_owned()),
    ];
    refused(RIG, &changes);
}

#[test]
fn rules_of_a_specimen_on_a_bus_hold() {
    let axis = "specimen[0].bus.axis[0]";
    let at = |key: &str| format!("{axis}.{key}");
    let changes = [
        (
            "bus = \"rig\"",
            "bus = \"rib\"",
            "specimen[0].bus.bus".to_owned(),
        ),
        ("\"servo.command\"", "\"servo.comand\"", at("command.at")),
        ("\"servo.command\"", "\"servo\"", at("command.at")),
        ("\"servo.command\"", "\"servos.command\"", at("command.at")),
        ("\"servo.command\"", "\"servo.estop\"", at("command.at")),
        ("\"load cell.force\"", "\"servo.command\"", at("force.at")),
        ("\"load cell.stroke\"", "\"load cell.\"", at("disp.at")),
        (
            "m_per_count = 3.05e-6",
            "m_per_count = 0",
            at("command.m_per_count"),
        ),
        (
            "n_per_count = 3.05",
            "n_per_count = inf",
            at("force.n_per_count"),
        ),
        (
            "m_per_count = -1e-6",
            "m_per_count = 0",
            at("disp.m_per_count"),
        ),
        ("0x43, equals = 0", "0x43, equals = 4", at("good[0].equals")),
        ("mask = 0x43", "mask = 0", at("good[0].mask")),
        ("mask = 0x43", "mask = 0x10000", at("good[0].mask")),
        (
            "equals = 1",
            "equals = 256",
            "specimen[0].bus.interlock[0].equals".to_owned(),
        ),
        (
            "sample_after = 0.6",
            "sample_after = 0.96",
            "specimen[0].bus.sample_after".to_owned(),
        ),
        (
            "probe_ramp_s = 2.0",
            "probe_ramp_s = 601",
            "specimen[0].bus.probe_ramp_s".to_owned(),
        ),
        (
            "= 7.0",
            "= 3601",
            "specimen[0].bus.connect_timeout_s".to_owned(),
        ),
        ("stands_at_m = [0.01]", "", "specimen[0].bus".to_owned()),
        (
            "stands_at_m = [0.01]",
            "stands_at_m = [0, 0]",
            "specimen[0].link.stands_at_m".to_owned(),
        ),
        (
            "[\"north\"]",
            "[\"north\", \"south\"]",
            "specimen[0].link.axis_names".to_owned(),
        ),
        (
            "storey = 1\n",
            "storey = 1\naxis = [{ unit_disp = \"mm\" }]\n",
            "specimen[0].axis[0].unit_disp".to_owned(),
        ),
        (
            "command = { at = \"servo.command\", m_per_count = 3.05e-6, offset_count = 12 }",
            "",
            axis.to_owned(),
        ),
    ];
    refused(RIG, &changes);
}

#[test]
fn output_is_commanded_once() {
    let axis = RIG.split_once("[[specimen.bus.axis]]").unwrap().1;
    let twice = RIG
        .replacen("storey = 1", "rows = [[1.0], [1.0]]", 1)
        .replacen(
            "m = 1e6\n[specimen.l",
            "m = [[1e6, 0.0], [0.0, 1e6]]\n[specimen.l",
            1,
        )
        .replacen("stands_at_m = [0.01]", "stands_at_m = [0.01, 0.01]", 1)
        .replacen("[\"north\"]", "[\"north\", \"south\"]", 1);
    let twice = format!("{twice}[[specimen.bus.axis]]{axis}");
    let at = "specimen[0].bus.axis[1].command.at".to_owned();
    assert_eq!(findings(&twice), [(at, Severity::Error)]);
}

#[test]
fn drive_needs_its_objects_and_a_limit() {
    let text = driven();
    refused(
        &text,
        &[
            (
                "\"607a:00 i32\"",
                "\"607a:00 i16\"",
                "specimen[0].bus.axis[0].drive.device",
            ),
            (
                "\"6064:00 i32\", ",
                "",
                "specimen[0].bus.axis[0].drive.device",
            ),
            (
                "device = \"axis 1\"",
                "device = \"axis 2\"",
                "specimen[0].bus.axis[0].drive.device",
            ),
            (
                "command_accel_m_per_s2 = { trip = 20.0 }\n",
                "",
                "specimen[0].bus.axis[0].drive",
            ),
            (
                "probe_m =",
                "stands_at_m = [0.0]\nprobe_m =",
                "specimen[0].bus.stands_at_m",
            ),
            (
                "\"load cell.state\"",
                "\"axis 1.torque\"",
                "specimen[0].bus.axis[0].good[0].at",
            ),
        ],
    );
    let accepted = text.replacen(
        "\"torque\"]",
        "\"torque\"]\naccept = \"torque off at quick stop\"\naccept_reason = \"horizontal axis\"",
        1,
    );
    assert_eq!(findings(&accepted), []);
}

#[test]
fn unused_bus_and_idle_key_are_warnings() {
    let bus = RIG.split_once("[specimen.bus]").unwrap().0;
    let link = format!("{bus}[specimen.link]\naddress = \"127.0.0.1:4823\"\n");
    let warning = |path: &str| [(path.to_owned(), Severity::Warning)];
    assert_eq!(findings(&link), warning("bus.rig"));
    let next = RIG.replacen("sample_after", "sample = \"next_tick\"\nsample_after", 1);
    assert_eq!(findings(&next), warning("specimen[0].bus.sample_after"));
}

#[test]
fn link_and_bus_exclude_each_other() {
    let both = format!("{RIG}[specimen.link]\naddress = \"127.0.0.1:4823\"\n");
    assert_eq!(
        findings(&both),
        [("specimen[0].bus".to_owned(), Severity::Error)]
    );
    let bus = RIG.split_once("[bus.rig]").unwrap().0;
    let link = format!(
        "{bus}[[specimen]]\nname = \"a\"\nstorey = 1\nlink = {{ protocol = \"ethercat\", address = \"rig\" }}\n"
    );
    let error = read(&link, &[]).unwrap_err();
    assert!(error.contains("`[specimen.bus]`"), "{error}");
}

#[test]
fn catch_up_is_refused_on_a_bus() {
    let text = RIG.replacen("[structure", "timing.on_miss = \"catch_up\"\n[structure", 1);
    let text = text.replacen("timing.on_miss", "[timing]\non_miss", 1);
    assert_eq!(
        findings(&text),
        [("timing.on_miss".to_owned(), Severity::Error)]
    );
}

#[test]
fn axis_without_a_displacement_has_no_such_limit() {
    let disp = "disp = { at = \"load cell.stroke\", m_per_count = -1e-6 }\n";
    let blind = RIG.replacen(disp, "", 1);
    assert_eq!(findings(&blind), []);
    let limit = "measured_disp_m = { trip = [-0.1, 0.1] }\nmeasured_force_n";
    let limited = blind.replacen("measured_force_n", limit, 1);
    let at = "specimen[0].limits.measured_disp_m".to_owned();
    assert_eq!(findings(&limited), [(at, Severity::Error)]);
}

#[test]
fn findings_on_a_link_point_into_the_bus() {
    let long = RIG.replacen("probe_m = 1e-4", "probe_m = 1.0", 1);
    let error = read(&long, &[]).unwrap_err();
    let line = 1 + long
        .lines()
        .position(|line| line == "probe_m = 1.0")
        .unwrap();
    assert!(error.contains(&format!("test.toml:{line}:")), "{error}");
    let locator = read(RIG, &[]).unwrap().locator;
    let place = |path: &str| {
        let place = locator.locate(&KeyPath::parse(path).unwrap(), Part::Value);
        RIG.get(place.span.unwrap()).unwrap().to_owned()
    };
    assert_eq!(place("specimen[0].link.max_stale"), "5");
    assert_eq!(place("specimen[0].link.watchdog_s"), "0.05");
    assert_eq!(place("specimen[0].link.address"), "\"rig\"");
    assert_eq!(place("specimen[0].link.probe_ramp_s"), "2.0");
    let at = KeyPath::parse("specimen[0].link.max_stale").unwrap();
    let told = locator.diagnose(Finding::error(
        at,
        "`specimen[0].link.max_stale` in [specimen.link]",
    ));
    assert_eq!(told.headline, "`bus.rig.stale_ticks` in [specimen.bus]");
}

#[test]
fn gateway_serves_a_specimen_on_a_bus() {
    let rig = RIG.split_once("[bus.rig]").unwrap().1;
    let text = format!("[bus.rig]{rig}").replacen("storey = 1\n", "", 1);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("serve.toml");
    std::fs::write(&path, &text).unwrap();
    let served = load_serve_file(&path, None).unwrap();
    let table = served.specimen().unwrap();
    assert!(
        table
            .link
            .as_ref()
            .is_some_and(|link| link.protocol == Protocol::Ethercat)
    );
    assert!(served.file.bus.contains_key("rig"));
    let broken = text.replacen("\"servo.command\"", "\"servo.comand\"", 1);
    std::fs::write(&path, broken).unwrap();
    assert!(load_serve_file(&path, None).is_err());
}
