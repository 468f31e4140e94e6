//! An operator who holds a test longer than a specimen's watchdog waits.

use std::path::Path;

use gusset::config::load;
use gusset::engine::Operator;

use crate::lab::{Extra, play};
use crate::rig::{Place, Rig};

/// A partner that is told every step hears nothing in a hold but that it is one: its watchdog has no reason to act, and the hold
/// may last.
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
