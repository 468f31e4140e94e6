//! A shutdown begins with a stop that no limit checks: neither the controller's nor those of the specimen's end, which limits the
//! acceleration.

use crate::common::test_file::TestFile;
use crate::link_common::{ONE_AXIS_LAW, Served, linked, run, summary};
use gusset_control::engine::Phase;
use gusset_record::{Run, summary::Status};

const STEPS: u32 = 400;
const PERIOD: f64 = 1e-3;
/// More than the test and the return ramp need, less than the stop between them, in m/s².
const ACCEL: f64 = 12.0;

#[test]
fn acceleration_limit_allows_the_shutdown() {
    let limits = format!("[specimen.limits]\ncommand_accel_m_per_s2 = {{ trip = {ACCEL} }}\n");
    for transport in ["tcp", "udp"] {
        let folder = tempfile::tempdir().unwrap();
        let rig = format!(
            "[serve]\ntransport = \"{transport}\"\n[[specimen]]\nname = \"column\"\n{limits}{ONE_AXIS_LAW}"
        );
        let served = Served::start(folder.path(), &rig, &[]);
        let text = linked(
            STEPS,
            &served.address,
            &format!("transport = \"{transport}\"\n{limits}"),
        );
        let text =
            text.with("safety = { at_end = 'zero_displacement', exit_speed_m_per_s = 0.05 }");
        let (code, said) = run(folder.path(), "run", &text);
        assert_eq!(code, 0, "{transport}: {said}");
        let summary = summary(folder.path(), "run");
        assert_eq!(summary.status, Status::Completed, "{}", summary.reason);
        assert_eq!(summary.left["column"], "reached", "{:?}", summary.left);
        let record = Run::open(&folder.path().join("run")).unwrap();
        let columns = record.columns(&["state", "cmd_1_1"]).unwrap();
        let leaves = columns[0]
            .iter()
            .position(|state| *state == Phase::Leaving.code());
        let leaves = leaves.expect("rows of the shutdown");
        let command = &columns[1];
        let accel = |k: usize| {
            (command[k] - 2.0 * command[k - 1] + command[k - 2]).abs() / (PERIOD * PERIOD)
        };
        assert!(accel(leaves) > 1.5 * ACCEL, "the stop: {}", accel(leaves));
        let others = (2..command.len()).filter(|k| *k != leaves);
        assert!(others.map(accel).all(|accel| accel < ACCEL));
        assert_eq!(command.last(), Some(&0.0));
    }
}

/// A specimen that trips on its load cell's reading is not unloaded, and keeps its place while the other returns: its own end gets
/// the stop, too.
#[test]
fn specimen_kept_in_place_stops_first() {
    let folder = tempfile::tempdir().unwrap();
    let law = "law.linear = { stiffness_n_per_m = 1e5 }\n";
    let served = ["one", "other"].map(|name| {
        let home = folder.path().join(name);
        std::fs::create_dir(&home).unwrap();
        let limits = format!("[specimen.limits]\ncommand_accel_m_per_s2 = {{ trip = {ACCEL} }}\n");
        let rig = format!("[[specimen]]\nname = \"{name}\"\n{law}{limits}");
        Served::start(&home, &rig, &[])
    });
    let specimen = |name: &str, served: &Served, limit: &str| {
        format!(
            "[[excitation.prescribed_displacement]]\nspecimen = \"{name}\"\nease_in_s = 0.3\n\
             signal.sine = {{ amplitude = 0.02, frequency_hz = 2 }}\n[[specimen]]\nname = \"{name}\"\n\
             stiffness_n_per_m = 1e5\n[specimen.limits]\ncommand_accel_m_per_s2 = {{ trip = 30 }}\n{limit}\
             [specimen.link]\naddress = \"{}\"\nprobe = \"none\"\n",
            served.address
        )
    };
    let text = format!(
        "[time]\nrate_hz = 200\nduration_s = 1.05\n[safety]\non_trip = \"zero_force\"\nexit_speed_m_per_s = 0.02\n\
         unlimited = \"springs\"\naccept_trip = \"this test is about the shutdown\"\n{}{}",
        specimen("one", &served[0], ""),
        specimen(
            "other",
            &served[1],
            "sensor_force_n = { trip = [-900, 900] }\n"
        )
    );
    let (code, said) = run(folder.path(), "run", &text);
    assert_eq!(code, 1, "{said}");
    let summary = summary(folder.path(), "run");
    assert!(summary.reason.contains("load cell"), "{}", summary.reason);
    assert_eq!(summary.left["one"], "reached", "{said}");
}
