//! A lost reply costs nothing: its force arrives in a later reply, and an event records it with the number of its command.

use gusset_config::fault_script::Script;
use gusset_config::load;
use gusset_record::{Event, Journal};

use crate::lab::{Extra, play};
use crate::scripts::folder;

const STIFFNESS: f64 = 15e6;

/// The specimen is linear, and every command reaches it: its measurement at each of them is known.
#[test]
fn recovered_forces_match_their_commands() {
    let set = [
        "specimen.0.link.max_stale=12",
        "excitation.ground_acceleration.signal.sine.amplitude=0.5",
    ];
    let set = set.map(str::to_owned);
    let loaded = load(&folder().join("laboratory.toml"), &set).unwrap();
    let script: Script = toml::from_str(
        "title = \"a third\"\nseed = 3\n[[fault]]\nprobability = 0.33\nkind = \"lost\"\n",
    )
    .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let rig = folder.path().join("rig.toml");
    let text = format!(
        "[[specimen]]\nname = \"columns\"\nlaw.linear = {{ stiffness_n_per_m = {STIFFNESS} }}\n\
         [[specimen.axis]]\nunit_disp = \"mm\"\nunit_force = \"kN\"\n"
    );
    std::fs::write(&rig, text).unwrap();
    let played = play(&loaded, Extra::default(), |_, _| {
        let host = gusset_setup::load_served(&rig, None).unwrap().host;
        host.faulty(script.clone()).unwrap()
    });
    let played = played.unwrap();
    assert_eq!(played.verdict().1, 0, "{:?}", played.verdict());

    let wanted = ["step", "state", "target_1_1", "seq_1"];
    let wanted = wanted.map(|name| played.layout.index_of(name).unwrap());
    let columns = Journal::new(&played.samples[..], played.columns().len())
        .columns(&wanted)
        .unwrap();
    let [step, state, target, newest] = [0, 1, 2, 3].map(|column| &columns[column]);
    let running = gusset_control::engine::Phase::Running.code();
    let row_of =
        |tick: u64| (0..step.len()).find(|row| state[*row] == running && step[*row] == tick as f64);
    let (mut told, mut compared) = (0, 0);
    for event in &played.events {
        let Event::Recovered {
            port: 0,
            axis: 0,
            age,
            force,
        } = event.kind
        else {
            continue;
        };
        told += 1;
        // The last ones were reported in the shutdown, the first ones in the warm-up.
        let (Some(now), Some(then)) = (
            row_of(event.tick),
            event.tick.checked_sub(age).and_then(row_of),
        ) else {
            continue;
        };
        let expected = STIFFNESS * target[then];
        assert!(
            (force - expected).abs() < 1e-9 * STIFFNESS * 0.01,
            "tick {}: {force} N of {age} commands ago, expected {expected}",
            event.tick
        );
        assert!(newest[then] < newest[now], "it was stale then");
        compared += 1;
    }
    assert_eq!(told, played.outcome.ports[0].2.stats.recovered);
    assert!(compared > 30, "{compared}");
    assert!(played.replay.is_exact(), "{:?}", played.replay);
}
