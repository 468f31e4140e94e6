//! An impossible motion is refused before anything moves, with a possible one.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use gusset_wire::handshake::{Capabilities, Welcome};

use super::command::{SHORT, TEST, identify, served};
use crate::common::test_file::TestFile;
use crate::common::{Said, write};
use crate::link_common::Fake;

/// Refused with exit code 2, with these words and without a run folder.
fn refused(text: &str, arguments: &[&str], words: &[&str]) {
    let said = attempt(text, arguments, |out| {
        assert!(!out.exists(), "nothing was to be moved")
    });
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    for word in words {
        assert!(said.stderr.contains(word), "{word:?}: {}", said.stderr);
    }
}

fn attempt(text: &str, arguments: &[&str], look: impl FnOnce(&Path)) -> Said {
    let folder = tempfile::tempdir().unwrap();
    let test = write(folder.path(), "test.toml", text);
    let out = folder.path().join("out");
    let said = identify(&test, &out, arguments);
    look(&out);
    said
}

#[test]
fn refused_amplitude_shows_the_largest_one() {
    // A sweep to 15 Hz that leaves as it gets there: a little less than 2π · 15 /s, 5 mm would need 0.45 m/s.
    refused(
        TEST,
        &[
            "--duration",
            "8",
            "--band",
            "0.5,15",
            "--amplitude",
            "0.005",
        ],
        &[
            "storey",
            "command_vel_m_per_s",
            "400 mm/s",
            "largest amplitude",
            "4.4 mm",
            "--amplitude 0.0044",
            "13.4",
        ],
    );
    refused(
        TEST,
        &["--duration", "41", "--band", "0.2,1", "--amplitude", "0.06"],
        &["command_disp_m", "50 mm", "largest amplitude"],
    );
    refused(
        TEST,
        &["--amplitude", "-0.001"],
        &["--amplitude is -0.001", "greater than 0"],
    );
    refused(TEST, &["--amplitude", "nan"], &["--amplitude is NaN"]);
    let free = TEST.without("specimen.0.limits.command_disp_m");
    refused(
        &free,
        &["--duration", "10"],
        &["storey", "command_disp_m", "--amplitude"],
    );
}

#[test]
fn rehearsal_sees_a_force_that_would_trip() {
    // 1.2e6 N/m · 2 mm = 2400 N.
    let weak = TEST.without("specimen.0.limits.lag_s");
    let weak = weak.with("specimen.limits.measured_force_n.trip = [-1000, 1000]");
    refused(&weak, &SHORT, &["measured_force_n", "measured force"]);
    let said = attempt(&weak, &["--duration", "8", "--band", "0.5,10"], |out| {
        assert!(out.exists())
    });
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(said.stderr.contains("halved"), "{}", said.stderr);
}

#[test]
fn impossible_bands_are_refused() {
    refused(
        TEST,
        &["--band", "1,256"],
        &["256 Hz", "512 Hz", "less than"],
    );
    refused(TEST, &["--band", "5,2"], &["5 Hz to 2"]);
    refused(TEST, &["--band", "0,2"], &["0 Hz to 2"]);
    refused(TEST, &["--band", "3"], &["--band"]);
    refused(TEST, &["--duration", "0.5"], &["0.5 s", "at least"]);
    refused(TEST, &["--duration", "inf"], &["inf s"]);
    refused(
        TEST,
        &["--specimen", "story"],
        &["no specimen \"story\"", "\"storey\""],
    );
    let none = TEST.split("[[specimen]]").next().unwrap();
    let none = none.with("structure.shear_building.stiffness_n_per_m = [4e5, 4e5]");
    refused(&none, &[], &["no specimen", "identify"]);
}

#[test]
fn dead_sensor_ends_with_1_and_its_reason() {
    // The actuator does not move, and the sensor reads noise only.
    let dead = TEST.without("specimen.0.transfer.actuator");
    let dead = dead.with("specimen.transfer.actuator.proportional.gain = 1e-9");
    let said = attempt(&dead, &SHORT, |out| {
        assert!(out.join("samples.bin").exists() && out.join("report.html").exists());
        assert!(out.join("identification/index.html").exists());
        assert!(!out.join("identified.toml").exists());
    });
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    assert!(said.stderr.contains("not follow"), "{}", said.stderr);
    assert!(said.stdout.contains("not follow"), "{}", said.stdout);
}

#[test]
fn motion_stopped_by_a_limit_exits_with_1() {
    // The actuator lags by 12 ms: the rehearsal sees it where the file knows the actuator, and nothing moves.
    let strict = TEST.without("specimen.0.limits.lag_s");
    let strict = strict.with("specimen.limits.following_error_m.trip = 0.0003");
    refused(&strict, &SHORT, &["would stop", "following_error_m"]);
    // The stand-in of a specimen behind a link has no lag.
    let folder = tempfile::tempdir().unwrap();
    let limits = ", following_error_m = { trip = 0.0003 }";
    let (_server, test) = served(folder.path(), "tcp", limits);
    let out = folder.path().join("out");
    let said = identify(&test, &out, &SHORT);
    assert!(out.join("summary.json").exists(), "{}", said.stderr);
    assert!(!out.join("identified.toml").exists());
    assert_eq!(said.code, Some(1), "{}", said.stderr);
    assert!(said.stderr.contains("is identified"), "{}", said.stderr);
    assert!(said.stderr.contains("following error"), "{}", said.stderr);
}

/// Four actuators hold three coordinates: none can move while the others stand.
#[test]
fn redundant_actuators_are_refused() {
    let unit = |pins: &str| {
        format!(
            "[time]\nrate_hz = 512\nduration_s = 1\nclock = \"simulated\"\n\
             [[excitation.prescribed_displacement]]\nspecimen = \"column\"\nsignal.sine = {{ amplitude = 0.001, frequency_hz = 1 }}\n\
             [[specimen]]\nname = \"column\"\ngeometry.plane = [{pins}]\n\
             law.linear.stiffness_n_per_m = 1e6\n"
        )
    };
    let three = "{ base_m = [-1, 0.2], length_m = [0.99, 1.1] }, { base_m = [0.5, 1], joint_m = [0.5, 0] }, \
                 { base_m = [-0.5, 1], joint_m = [-0.5, 0] }";
    let four = format!("{three}, {{ base_m = [1, 0.1], joint_m = [0, 0.1] }}");
    refused(
        &unit(&four),
        &SHORT,
        &["specimen \"column\"", "4 actuators", "cannot move"],
    );
    let far = ["--duration", "8", "--band", "0.5,5", "--amplitude", "0.05"];
    refused(
        &unit(three),
        &far,
        &["actuator 1", "length_m", "29 mm", "--amplitude 0.029"],
    );
    // The first one has a stroke limit, the second one does not.
    refused(
        &unit(three),
        &["--duration", "10"],
        &["actuator 2", "command_disp_m", "length_m", "--amplitude"],
    );
}

#[test]
fn findings_are_not_shown_at_the_users_file() {
    // Inertia in the force loads the structure, which a motion is without.
    let heavy = TEST.with("specimen.mass_in_force_kg = 20.0");
    let quick = [
        "--duration",
        "8",
        "--band",
        "0.5,15",
        "--amplitude",
        "0.002",
    ];
    let said = attempt(&heavy, &quick, |_| {});
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    assert!(!said.stderr.contains("mass_in_force_kg"), "{}", said.stderr);
    // A bound that the motion alone meets is shown where it stands, in a text of another name.
    let trips = TEST.without("specimen.0.limits.command_vel_m_per_s");
    let trips = trips.with("specimen.limits.measured_force_n.trip = [-900.0, 900.0]");
    let said = attempt(&trips, &quick, |_| {});
    assert_ne!(said.code, Some(0), "{}", said.stderr);
    assert!(
        said.stderr.contains("test.toml (driven):") && !said.stderr.contains("test.toml:"),
        "{}",
        said.stderr
    );
}

/// Against its own command every specimen follows perfectly: nothing is learnt of its actuator.
#[test]
fn link_without_displacement_is_refused() {
    let link = |more: &str| {
        let head = ["law", "limits.lag_s", "transfer", "compensation"]
            .iter()
            .fold(TEST.to_owned(), |text, key| {
                text.without(&format!("specimen.0.{key}"))
            });
        head.with(&format!(
            "[specimen]\nstiffness_n_per_m = 1.2e6\nlimits.measured_force_n.trip = [-1e5, 1e5]\n\
             [specimen.link]\ncomputed = true\n{more}\n"
        ))
    };
    let element = "address = \"127.0.0.1:1\"\nprotocol = \"openfresco\"";
    let delay = "`delay_s` in [specimen.identified]";
    refused(&link(element), &SHORT, &["storey", "forces only", delay]);
    // Values that its end does not report are known only after connecting.
    let armed = Arc::new(AtomicUsize::new(0));
    let counter = Arc::clone(&armed);
    let change = |welcome: &mut Welcome| {
        welcome.capabilities = Capabilities::default();
        welcome.standing = vec![0.0];
    };
    let address = Fake::start_welcoming(change, move |mut fake| {
        let count = |_| {
            counter.fetch_add(1, Ordering::SeqCst);
        };
        fake.obey(|disp| (disp, 1.2e6 * disp), count);
    });
    let silent = link(&format!("address = \"{address}\""));
    let said = attempt(&silent, &SHORT, |out| {
        assert!(!out.join("identification.json").exists());
    });
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert!(said.stderr.contains("gusset identify"), "{}", said.stderr);
    assert_eq!(armed.load(Ordering::SeqCst), 0);
}
