//! A way out begins with a stop that nobody judges: neither the controller nor the end of the specimen, which has a limit of
//! acceleration of its own.

mod link_common;

use gusset::engine::Phase;
use gusset::record::{Run, summary::Status};
use link_common::{ONE_AXIS_LAW, Served, linked, run, summary};

const STEPS: u32 = 400;
const PERIOD: f64 = 1e-3;
/// More than the test and the way out need, less than the stop between them, in m/s².
const ACCEL: f64 = 12.0;

#[test]
fn an_end_of_the_specimen_with_a_limit_of_acceleration_is_led_out_of_a_test_that_ends_in_motion() {
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
        let led = "[safety]\nat_end = \"zero_displacement\"\nexit_speed_m_per_s = 0.05\n";
        let text = text.replace("[safety]\n", led);
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
        let leaves = leaves.expect("rows of the way out");
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
