//! A hybrid test over a link is the same test: over an ideal link every number that does not depend on wall time is that
//! of the same test in process, to the last bit.

use std::path::Path;

use crate::link_common::relay::{Fates, Relay};
use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, Served, TWO_AXES, TWO_AXES_LAW, columns, finish, gusset, run, summary,
    test_file,
};
use gusset_control::engine::Phase;
use gusset_record::Run;

const STEPS: u32 = 600;

fn linked(seen: &str, address: &str, transport: &str, keys: &str) -> String {
    let link =
        format!("[specimen.link]\naddress = \"{address}\"\ntransport = \"{transport}\"\n{keys}");
    test_file(STEPS, &format!("{seen}{link}"))
}

fn is_the_same_over(transport: &str, seen: &str, law: &str, more: &str) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(STEPS, &format!("{seen}{more}{law}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let served = Served::start(folder, &local, &["--transport", transport]);
    // One test after another, each with a specimen in its virgin state.
    for name in ["first", "second"] {
        let remote = linked(
            &format!("{seen}{more}"),
            &served.address,
            transport,
            "watchdog_s = 20",
        );
        let (code, said) = run(folder, name, &remote);
        assert_eq!(code, 0, "{said}");
        assert_eq!(columns(folder, "local", ""), columns(folder, name, ""));
        let link = summary(folder, name).link["column"];
        assert_eq!(
            link.sent,
            u64::from(STEPS) + 1 + 5,
            "steps, step 0, warm-up"
        );
        assert_eq!((link.received, link.late, link.lost), (link.sent, 0, 0));
        assert_eq!((link.corrupt, link.duplicates, link.missed), (0, 0, 0));
        served.hears("retired at the end of the test");
    }
}

#[test]
fn one_axis_over_tcp_gives_the_same_bits() {
    is_the_same_over("tcp", ONE_AXIS, ONE_AXIS_LAW, "");
}

#[test]
fn one_axis_over_udp_gives_the_same_bits() {
    is_the_same_over("udp", ONE_AXIS, ONE_AXIS_LAW, "");
}

#[test]
fn two_axes_in_other_units_give_same_bits() {
    let units = "[[specimen.axis]]\nunit_disp = \"mm\"\nunit_force = \"kN\"\n[[specimen.axis]]\nsign = -1\n";
    is_the_same_over("tcp", TWO_AXES, TWO_AXES_LAW, units);
}

#[test]
fn two_axes_over_udp_give_the_same_bits() {
    is_the_same_over("udp", TWO_AXES, TWO_AXES_LAW, "");
}

#[test]
fn a_static_load_settles_on_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let loaded = |text: String| {
        text.replacen(
            "[structure.shear_building]",
            "[structure]\nstatic_load_n = [300.0, 100.0]\n[structure.shear_building]",
            1,
        )
    };
    let local = loaded(test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}")));
    let (code, said) = run(folder, "local", &local);
    assert_eq!(code, 0, "{said}");
    let served = Served::start(folder, &local, &[]);
    let remote = loaded(linked(ONE_AXIS, &served.address, "tcp", "watchdog_s = 20"));
    assert_eq!(run(folder, "remote", &remote).0, 0);
    // A remote specimen is read at rest before the load begins: rows of zeros, except for its known values.
    let (local, mut remote) = (columns(folder, "local", ""), columns(folder, "remote", ""));
    let rest = remote[0].1.len() - local[0].1.len();
    assert!(rest > 0);
    for (name, values) in &mut remote {
        let read: Vec<u64> = values.drain(1..=rest).collect();
        if name.starts_with("raw_") || name.starts_with("cmd_") {
            assert_eq!(read, vec![0; rest], "{name}");
        }
    }
    assert_eq!(local, remote);
}

/// Lost commands and answers are requested again, damaged and repeated ones dropped: the course is the same.
#[test]
fn bad_network_changes_no_lockstep_number() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let local = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    assert_eq!(run(folder, "local", &local).0, 0);
    let served = Served::start(folder, &local, &["--transport", "udp"]);
    let fates = Fates {
        lost: 5,
        twice: 5,
        damaged: 3,
        overtaken: 3,
        ..Fates::default()
    };
    let mut relay = Relay::start(&served.address, 20140402, fates);
    let remote = linked(ONE_AXIS, &relay.address, "udp", "watchdog_s = 0.02");
    let (code, said) = run(folder, "remote", &remote);
    relay.stop();
    assert_eq!(code, 0, "{said}");
    // The specimen may have held in between and reports it; that is the only difference.
    assert_eq!(
        columns(folder, "local", "status"),
        columns(folder, "remote", "status")
    );
    let link = summary(folder, "remote").link["column"];
    assert_eq!(link.received, link.sent);
    assert!(link.corrupt > 0 && link.duplicates > 0, "{link:?}");
}

/// Columns of the steps of a run, and the number of its rows between two steps.
fn steps_of(folder: &Path, name: &str) -> (Vec<Vec<f64>>, usize) {
    let wanted = ["state", "x1", "x2", "v1", "a2", "target_1_1", "force_1_1"];
    let run = Run::open(&folder.join(name)).unwrap();
    let columns = run.columns(&wanted).unwrap();
    let state = &columns[0];
    let steps = columns.iter().map(|column| {
        let rows = column.iter().zip(state);
        let running = rows.filter(|(_, state)| **state == Phase::Running.code());
        running.map(|(value, _)| *value).collect()
    });
    (steps.collect(), state.iter().filter(|s| **s > 10.0).count())
}

/// Real sockets, real time: the course does not depend on when an answer comes.
#[test]
fn per_step_specimen_gives_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let paced = |ticks: u32, clock: &str, specimen: &str| {
        test_file(1000, specimen)
            .replace(
                "rate_hz = 1000",
                &format!("rate_hz = 100\nticks_per_step = {ticks}"),
            )
            .replace("clock = \"simulated\"", &format!("clock = \"{clock}\""))
            .replace(
                "[timing]",
                "[timing]\npolicy = \"ordinary\"\nmisses.in_total.trip = 1000000\nmisses.in_a_row.trip = 1000000\n\
                 misses.in_window.trip = 1000000",
            )
    };
    let local = paced(1, "simulated", &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let (code, said) = run(folder, "local", &local);
    assert_eq!(code, 0, "{said}");
    let (expected, none) = steps_of(folder, "local");
    assert_eq!((expected[0].len(), none), (101, 0));
    for transport in ["tcp", "udp"] {
        let served = Served::start(folder, &local, &["--transport", transport]);
        let link = format!(
            "{ONE_AXIS}[specimen.link]\naddress = \"{}\"\ntransport = \"{transport}\"\ncoupling = \"lockstep\"\n\
             commands = \"every_step\"\nwatchdog_s = 20\n",
            served.address
        );
        let (code, said) = run(folder, transport, &paced(5, "real", &link));
        assert_eq!(code, 0, "{said}");
        let (found, between) = steps_of(folder, transport);
        assert_eq!(found, expected, "{transport}");
        assert!(
            between >= 4 * 100,
            "four ticks between two steps: {between}"
        );
        // Once a step, and in the warm-up; a repeated request for a lost datagram does not count.
        let sent = summary(folder, transport).link["column"].sent;
        assert_eq!(sent, 101 + 5, "{transport}");
    }
}

/// A damper behind a link moves at a tenth of the velocity of the test: `check` and `run` find the force of that.
#[test]
fn slow_damper_force_is_in_check_and_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let law = "law.linear = { stiffness_n_per_m = 0, damping_n_s_per_m = 3e4 }\n";
    let served = Served::start(
        folder,
        &format!("[[specimen]]\nname = \"column\"\n{law}"),
        &[],
    );
    let seen = "storey = 1\nstiffness_n_per_m = 0\ndamping_n_s_per_m = 3e4\n";
    let slow = |clock: &str| {
        linked(seen, &served.address, "tcp", "")
            .replace("[0, 1e5]", "[4e5, 1e5]")
            .replace("[time]", &format!("[time]\nscale = {clock}"))
    };
    let force = |scale: &str| {
        let text = slow(scale);
        let (code, said) = run(folder, scale, &text);
        assert_eq!(code, 0, "{said}");
        let file = folder.join(format!("{scale}.toml"));
        let mut check = gusset();
        check.arg("check").arg(file).arg("--json");
        let check: serde_json::Value = serde_json::from_slice(&finish(check).stdout).unwrap();
        let needs = check["rehearsal"]["specimens"][0]["axes"][0].as_array();
        let mut needs = needs.unwrap().iter();
        let need = needs.find(|need| need["quantity"] == "measured_force_n");
        let [low, high] = ["low", "high"].map(|end| need.unwrap()[end].as_f64().unwrap().abs());
        let measured = summary(folder, scale).peak.force["column"][0].unwrap();
        assert!((measured / low.max(high) - 1.0).abs() < 1e-12);
        measured
    };
    let share = force("10") / force("1");
    assert!((0.1..0.2).contains(&share), "{share}");
}
