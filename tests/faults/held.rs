//! An operator who holds a test longer than a specimen's watchdog waits.

use std::path::Path;

use gusset_config::fault_script::{Fault, Kind, Script};
use gusset_config::load;
use gusset_control::engine::{GIVEN_UP, Operator, Phase};
use gusset_record::Journal;

use crate::lab::{Extra, play};
use crate::rig::{Place, Rig};

/// During a hold, a specimen that is commanded once a step is only told that the test holds: its watchdog has no reason to act, and
/// the hold may last.
#[test]
fn no_watchdog_is_alarmed_by_a_hold() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/campaign/paced");
    let mut loaded = load(&folder.join("once.toml"), &[]).unwrap();
    for transport in ["tcp", "udp"] {
        let link = loaded.file.specimen[0].link.as_mut().unwrap();
        link.watchdog_s = Some(0.1);
        link.transport = toml::Value::from(transport).try_into().unwrap();
        let extra = Extra {
            // 400 ticks a second.
            operator: vec![(200, Operator::Hold), (600, Operator::Continue)],
            ..Extra::default()
        };
        let played = play(&loaded, extra, |index, setup| {
            Rig::new(&loaded, index, &Place::default()).host(setup).0
        });
        let played = played.unwrap();
        let path = played.path();
        assert!(path.contains(&"holding"), "{path:?}");
        assert_eq!(played.verdict().1, 0, "{:?}", played.verdict());
        let told = played.told();
        assert!(
            told.contains("armed") && !told.contains("HOLDING"),
            "{told}"
        );
    }
}

/// A hold during the wiring check stops the specimen, and a replay repeats it.
#[test]
fn hold_in_the_wiring_check_is_replayed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/campaign");
    let mut loaded = load(&folder.join("probed.toml"), &[]).unwrap();
    loaded.file.safety.ease_s = 0.05;
    let link = loaded.file.specimen[0].link.as_mut().unwrap();
    link.probe_ramp_s = 1.0;
    let extra = Extra {
        // 100 ticks a second: on its way up.
        operator: vec![(90, Operator::Hold), (190, Operator::Continue)],
        ..Extra::default()
    };
    let played = play(&loaded, extra, |index, setup| {
        Rig::new(&loaded, index, &Place::default()).host(setup).0
    });
    let played = played.unwrap();
    assert_eq!(played.verdict().1, 0, "{:?}", played.verdict());
    crate::invariants::check(&loaded, &played).unwrap();
    let wanted = ["state", "hold", "cmd_1_1"].map(|name| played.layout.index_of(name).unwrap());
    let columns = Journal::new(&played.samples[..], played.columns().len())
        .columns(&wanted)
        .unwrap();
    let held = (0..columns[0].len()).filter(|row| columns[1][*row] == 1.0);
    let held: Vec<usize> = held.collect();
    assert_eq!(held.len(), 100);
    let stood: Vec<f64> = held[5..].iter().map(|row| columns[2][*row]).collect();
    assert!(stood[0] > 0.0 && stood.iter().all(|place| *place == stood[0]));
    assert!(
        held.iter()
            .all(|row| columns[0][*row] == Phase::Probing.code())
    );
}

/// The tick before the operator's `continue` is late, and the test is given up for it.
#[test]
fn test_given_up_at_a_command_is_replayed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/campaign");
    let moves = [
        "safety.on_trip=zero_displacement",
        "safety.exit_speed_m_per_s=0.05",
    ];
    let loaded = load(&folder.join("no-misses.toml"), &moves.map(str::to_owned)).unwrap();
    let late = Fault {
        at: Some(60),
        lasts: None,
        axis: None,
        on: None,
        probability: None,
        kind: Kind::ControllerStalls { ticks: 3 },
    };
    let script = Script {
        title: "late".to_owned(),
        fault: vec![late],
        ..Script::default()
    };
    for word in [Operator::Continue, Operator::Hold] {
        let extra = Extra {
            script: Some(&script),
            operator: vec![(60, word)],
            ..Extra::default()
        };
        let played = play(&loaded, extra, |index, setup| {
            Rig::new(&loaded, index, &Place::default()).host(setup).0
        });
        let played = played.unwrap();
        let wanted = ["state", "hold"].map(|name| played.layout.index_of(name).unwrap());
        let columns = Journal::new(&played.samples[..], played.columns().len())
            .columns(&wanted)
            .unwrap();
        let given_up = columns[0].iter().position(|state| *state == GIVEN_UP);
        let before = given_up.unwrap() - 1;
        let said = if word == Operator::Hold { 1.0 } else { 2.0 };
        assert_eq!(columns[1][before], said, "{word:?}");
        assert!(played.replay.is_exact(), "{word:?}: {:?}", played.replay);
    }
}
