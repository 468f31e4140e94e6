//! The real program and its specimen with a bad network between them, over TCP and UDP: every combination of what a network
//! does ends in a stated outcome, and the counts in summary.json are those of the network.
//!
//! * Our protocol over UDP, lockstep: whatever is lost, doubled, overtaken, damaged, cut or late, the test takes the
//!   course of the one in process, to the last bit.
//! * Over TCP: delay, jitter and pieces change nothing; a turned bit or a broken connection ends the test.
//! * OpenFresco's protocols: a test that completes has the course of the one in process; what cannot be mended and can be
//!   noticed ends it. A turned bit cannot be noticed there: no checksum.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::link_common::relay::{Fates, Relay};
use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, Served, columns, events, linked, run, summary, test_file,
};
use gusset_record::Summary;

const STEPS: u32 = 120;
/// Warm-up ticks of the test file.
const WARM_UP: u32 = 5;
/// Hello and arming, there and back.
const GREETING: u64 = 4;

fn local(folder: &Path) -> String {
    let text = test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    assert_eq!(run(folder, "local", &text).0, 0);
    text
}

fn count(counter: &AtomicU64) -> u64 {
    counter.load(Ordering::Relaxed)
}

fn same_course(folder: &Path, name: &str) {
    // The status shows that the specimen held while no command arrived.
    assert_eq!(
        columns(folder, "local", "status"),
        columns(folder, name, "status")
    );
}

/// Every subset of six evils.
fn subsets() -> impl Iterator<Item = Fates> {
    (0..64_u32).map(|bits| {
        let on = |bit: u32, value: u64| if bits & (1 << bit) == 0 { 0 } else { value };
        Fates {
            lost: on(0, 4),
            twice: on(1, 6),
            overtaken: on(2, 6),
            damaged: on(3, 4),
            cut: on(4, 4),
            delay_us: on(5, 100),
            jitter_us: on(5, 300),
            spared: GREETING,
            ..Fates::default()
        }
    })
}

#[test]
fn lockstep_over_bad_udp_keeps_the_bits() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = Served::start(folder, &local(folder), &["--transport", "udp"]);
    let keys = "transport = \"udp\"\nwatchdog_s = 0.02";
    let mut all = (0, 0, 0);
    for (index, fates) in subsets().enumerate() {
        let name = format!("run-{index}");
        let mut relay = Relay::start(&served.address, index as u64, fates);
        let (code, said) = run(folder, &name, &linked(STEPS, &relay.address, keys));
        relay.stop();
        assert_eq!(code, 0, "{fates:?} {said}");
        same_course(folder, &name);
        let link = summary(folder, &name).link["column"];
        assert_eq!(link.sent, u64::from(STEPS + WARM_UP + 1));
        assert_eq!(
            (link.received, link.late, link.lost),
            (link.sent, 0, 0),
            "{fates:?} {link:?}"
        );
        let done = &relay.to_controller;
        // The goodbye, which is requested up to three times, is not counted.
        let spoiled = count(&done.damaged) + count(&done.cut);
        assert!(
            link.corrupt <= spoiled && link.corrupt + 3 >= spoiled,
            "{fates:?} {link:?} {done:?}"
        );
        if fates.lost + fates.twice + fates.overtaken + fates.damaged + fates.cut == 0 {
            // A command is repeated when its answer stays away, which a busy machine alone may cause.
            assert_eq!(link.corrupt, 0);
        }
        all.0 += count(&done.lost);
        all.1 += spoiled;
        all.2 += count(&done.overtaken) + count(&done.twice);
    }
    assert!(all.0 > 50 && all.1 > 50 && all.2 > 100, "{all:?}");
}

#[test]
fn tcp_delay_is_harmless_damage_ends_test() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let served = Served::start(folder, &local(folder), &[]);
    for bits in 0..16_u64 {
        let on = |bit: u64, value: u64| if bits & (1 << bit) == 0 { 0 } else { value };
        let fates = Fates {
            delay_us: on(0, 100),
            jitter_us: on(0, 300),
            cut: on(1, 30),
            damaged: on(2, 4),
            broken: (on(3, 1) == 1).then_some(60),
            spared: GREETING,
            ..Fates::default()
        };
        let name = format!("run-{bits}");
        let mut relay = Relay::stream(&served.address, bits, fates);
        let text = linked(STEPS, &relay.address, "reply_timeout_s = 1");
        let (code, said) = run(folder, &name, &text);
        relay.stop();
        let Summary { reason, link, .. } = summary(folder, &name);
        let link = link["column"];
        if fates.damaged == 0 && fates.broken.is_none() {
            assert_eq!(code, 0, "{fates:?} {said}");
            same_course(folder, &name);
            assert_eq!((link.received, link.corrupt), (link.sent, 0), "{link:?}");
            continue;
        }
        assert_eq!(code, 3, "{fates:?} {said}");
        assert!(events(folder, &name).contains(&"link".to_owned()));
        // The receiver detects a flipped bit; the specimen's end then closes.
        let stated = [
            "the peer closed the connection",
            "the checksum of the frame",
            "the first bytes are",
            "protocol version",
            "which the protocol does not have",
            "must be zero",
            "length of the frame",
            "axes",
            "no reply within the time limit",
        ];
        assert!(
            stated.iter().any(|words| reason.contains(words)),
            "{reason}"
        );
        assert!(
            link.corrupt <= 1 && link.sent - link.received == 1,
            "{link:?} {reason}"
        );
    }
}

/// A disconnected link is only late after 50 ms, and lost after 5 s; the specimen holds meanwhile and reports it.
#[test]
fn short_cut_continues_long_cut_is_lost() {
    for transport in ["tcp", "udp"] {
        for (ms, code) in [(50, 0), (5000, 3)] {
            let folder = tempfile::tempdir().unwrap();
            let folder = folder.path();
            let served = Served::start(folder, &local(folder), &["--transport", transport]);
            let fates = Fates {
                pulled: Some((60, ms)),
                ..Fates::default()
            };
            let relay = match transport {
                "tcp" => Relay::stream(&served.address, 1, fates),
                _ => Relay::start(&served.address, 1, fates),
            };
            let keys =
                format!("transport = \"{transport}\"\nwatchdog_s = 0.1\nreply_timeout_s = 1");
            let (found, said) = run(folder, "run", &linked(STEPS, &relay.address, &keys));
            assert_eq!(found, code, "{transport} {ms} ms: {said}");
            if code == 0 {
                same_course(folder, "run");
                served.hears("retired at the end of the test");
            } else {
                let reason = summary(folder, "run").reason;
                assert!(
                    reason.contains("no reply within the time limit (1 s)"),
                    "{reason}"
                );
                served.hears("HOLDING: no command received");
            }
        }
    }
}

#[test]
fn openfresco_completes_or_reports_why_not() {
    for (serves, asks) in [
        ("openfresco", "openfresco"),
        ("openfresco-actor", "openfresco-shadow"),
    ] {
        for transport in ["tcp", "udp"] {
            let folder = tempfile::tempdir().unwrap();
            let folder = folder.path();
            let arguments = ["--protocol", serves, "--transport", transport];
            local(folder);
            let text = format!(
                "[serve.openfresco]\nidle_timeout_s = 0.5\n[[specimen]]\nname = \"column\"\n{ONE_AXIS_LAW}"
            );
            let served = Served::start(folder, &text, &arguments);
            let keys = format!(
                "protocol = \"{asks}\"\ntransport = \"{transport}\"\nreply_timeout_s = 0.3\nconnect_timeout_s = 20"
            );
            for (index, fates) in openfresco_fates(transport).into_iter().enumerate() {
                let name = format!("run-{index}");
                let mut relay = match transport {
                    "tcp" => Relay::stream(&served.address, index as u64, fates),
                    _ => Relay::start(&served.address, index as u64, fates),
                };
                let (code, said) = run(folder, &name, &linked(STEPS, &relay.address, &keys));
                relay.stop();
                served.hears("commands,");
                let lost = count(&relay.to_controller.lost) + count(&relay.to_specimen.lost);
                match code {
                    0 => same_course(folder, &name),
                    3 => {
                        let reason = summary(folder, &name).reason;
                        let stated = [
                            "did not answer",
                            "the peer closed the connection",
                            "a reply without a request",
                            "the answer to the one before",
                        ];
                        assert!(
                            stated.iter().any(|words| reason.contains(words)),
                            "{reason}"
                        );
                    }
                    _ => panic!("{code} {said}"),
                }
                let harmless = fates.lost + fates.twice == 0 && fates.broken.is_none();
                assert!(
                    !harmless || code == 0,
                    "{serves} {transport} {fates:?} {said}"
                );
                assert!(lost == 0 || code == 3, "{serves} {transport} {fates:?}");
            }
        }
    }
}

fn openfresco_fates(transport: &str) -> Vec<Fates> {
    let plain = Fates {
        spared: 6,
        ..Fates::default()
    };
    let late = Fates {
        delay_us: 100,
        jitter_us: 200,
        ..plain
    };
    if transport == "tcp" {
        return [plain, late]
            .into_iter()
            .flat_map(|fates| {
                let cut = Fates { cut: 40, ..fates };
                let broken = Fates {
                    broken: Some(60),
                    ..cut
                };
                [fates, cut, broken]
            })
            .collect();
    }
    // Delay without jitter: a network that reorders is not for a protocol without numbers.
    let late = Fates {
        jitter_us: 0,
        ..late
    };
    [plain, late]
        .into_iter()
        .flat_map(|fates| {
            let lost = Fates { lost: 2, ..fates };
            let twice = Fates { twice: 2, ..fates };
            [fates, lost, twice]
        })
        .collect()
}
