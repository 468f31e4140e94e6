//! Every fault of a bus in every phase of a test has one expected ending.

use gusset_control::engine::Control;
use gusset_quantity::catalog::ending::Cause;
use gusset_record::RunFolder;
use gusset_session::{self as session, Watches};
use gusset_setup::build_with_bus_faults;

use super::{DRIVE, INTERLOCK, OUTPUT, load, script, text};

/// Runs a test with these faults; how it ended, and how many commands were sent.
fn ended(axis: &str, faults: &str) -> (Cause, u64) {
    let folder = tempfile::tempdir().unwrap();
    let stands = if axis == OUTPUT {
        "stands_at_m = [0.0]"
    } else {
        ""
    };
    let loaded = load(
        folder.path(),
        &text(axis, &format!("{INTERLOCK}\n{stands}")),
    );
    let prepared = build_with_bus_faults(&loaded, script(faults)).unwrap();
    let run = RunFolder::create(&folder.path().join("run")).unwrap();
    let control = Control::from(crossbeam_channel::never());
    let finished = session::run(prepared, run, control, Watches::default(), &mut |_| {}).unwrap();
    let sent = finished
        .summary
        .link
        .get("storey")
        .map_or(0, |link| link.sent);
    (finished.cause, sent)
}

#[test]
fn each_fault_in_each_phase_has_one_ending() {
    let of = |device: &str| format!("{{ device = \"{device}\" }}");
    let coded = |device: &str| format!("{{ device = \"{device}\", code = 0x1a }}");
    let mut wrong = Vec::new();
    for (axis, device) in [(OUTPUT, "servo"), (DRIVE, "axis 1")] {
        let (cause, all) = ended(axis, "");
        assert_eq!((cause, all > 500), (Cause::Done, true));
        let is_drive = axis == DRIVE;
        // Exchanges until a drive has torque come before the first command.
        let after = all + if is_drive { 10 } else { 2 };
        let by_drive = |cause| if is_drive { cause } else { Cause::Done };
        // What happens, for how long, and how the test ends: at the connection, with the first exchanges, in the test, after it.
        let (done, link) = (Cause::Done, Cause::Link);
        let gone = Cause::NotConnected;
        let (interlock, sensor) = (Cause::Interlock, Cause::Saturated);
        for (what, lasts, wanted) in [
            ("\"drop\"".to_owned(), 1, [done; 4]),
            ("\"drop\"".to_owned(), 8, [gone, done, link, done]),
            ("{ late = { micros = 1900 } }".to_owned(), 1, [done; 4]),
            ("{ late = { micros = 100 } }".to_owned(), 8, [done; 4]),
            ("\"duplicate\"".to_owned(), 8, [done; 4]),
            (format!("{{ wkc = {} }}", of("cell")), 1, [done; 4]),
            (
                format!("{{ wkc = {} }}", of("cell")),
                8,
                [done, done, link, done],
            ),
            (
                format!("{{ cut = {} }}", of("cell")),
                1,
                [done, link, link, done],
            ),
            (
                format!("{{ al_error = {} }}", coded(device)),
                1,
                [gone, link, link, done],
            ),
            (
                format!("{{ drive_fault = {} }}", coded("axis 1")),
                1,
                [by_drive(gone), by_drive(link), by_drive(interlock), done],
            ),
            (
                format!("{{ emergency = {} }}", coded("axis 1")),
                1,
                [done; 4],
            ),
            (format!("{{ frozen_input = {} }}", of("cell")), 1, [done; 4]),
            (
                "\"interlock\"".to_owned(),
                5000,
                [link, interlock, interlock, done],
            ),
            (
                "\"bad_sensor\"".to_owned(),
                5000,
                [sensor, sensor, sensor, done],
            ),
            ("\"foreign\"".to_owned(), 1, [gone, link, link, done]),
        ] {
            let places = ["at_frame = 20", "at_tick = 0", "at_tick = 300"];
            let places = places.map(str::to_owned).into_iter();
            for (place, wanted) in places.chain([format!("at_tick = {after}")]).zip(wanted) {
                let fault = format!("[[fault]]\nwhat = {what}\nlasts = {lasts}\n{place}");
                let (cause, _) = ended(axis, &fault);
                if cause != wanted {
                    wrong.push(format!(
                        "{device} {what} x{lasts} {place}: {cause:?}, not {wanted:?}"
                    ));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
