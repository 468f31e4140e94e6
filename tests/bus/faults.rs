//! Every fault of a bus in every phase of a test has one expected ending.

use gusset_control::engine::{Operator, Phase};
use gusset_quantity::catalog::ending::Cause;
use gusset_record::{Run, RunFolder};
use gusset_session::{self as session, Watches};
use gusset_setup::build_with_bus_faults;

use super::{DRIVE, INTERLOCK, OUTPUT, load, script, text};

/// Ticks after which an operator holds the test, and those that the hold lasts. One word is received per tick.
const HOLD: [usize; 2] = [500, 300];

/// Runs a test with these faults, which an operator may hold; how it ended, how many commands were sent, and the phase and the
/// command of each row.
fn ended(axis: &str, faults: &str, is_held: bool) -> (Cause, u64, [Vec<f64>; 2]) {
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
    let (says, requests) = crossbeam_channel::unbounded();
    if is_held {
        let words = [Operator::Continue, Operator::Hold].into_iter().zip(HOLD);
        let words = words.flat_map(|(word, ticks)| vec![word; ticks]);
        for word in words.chain([Operator::Continue]) {
            says.send(word).unwrap();
        }
    }
    let finished = session::run(prepared, run, requests, Watches::default(), &mut |_| {}).unwrap();
    let sent = finished
        .summary
        .link
        .get("storey")
        .map_or(0, |link| link.sent);
    let run = Run::open(&folder.path().join("run"));
    let rows = run.map_or_else(
        |_| Vec::new(),
        |run| run.columns(&["state", "cmd_1_1"]).unwrap(),
    );
    (finished.cause, sent, rows.try_into().unwrap_or_default())
}

#[test]
fn each_fault_in_each_phase_has_one_ending() {
    let of = |device: &str| format!("{{ device = \"{device}\" }}");
    let coded = |device: &str| format!("{{ device = \"{device}\", code = 0x1a }}");
    let mut wrong = Vec::new();
    for (axis, device) in [(OUTPUT, "servo"), (DRIVE, "axis 1")] {
        let (cause, all, _) = ended(axis, "", false);
        assert_eq!((cause, all > 500), (Cause::Done, true));
        let (cause, held, _) = ended(axis, "", true);
        assert_eq!((cause, held > all + 250), (Cause::Done, true));
        let is_drive = axis == DRIVE;
        // Exchanges until a drive has torque come before the first command.
        let after = all + if is_drive { 10 } else { 2 };
        let by_drive = |cause| if is_drive { cause } else { Cause::Done };
        // What happens, for how long, and how the test ends: at the connection, with the first exchanges, in the test, after it. In a hold it ends as in the test.
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
            let places = ["at_frame = 20", "at_tick = 0", "at_tick = 500"];
            let places = places.map(str::to_owned).into_iter();
            let places = places.chain([format!("at_tick = {after}")]);
            for (place, wanted) in places.zip(wanted) {
                let fault = format!("[[fault]]\nwhat = {what}\nlasts = {lasts}\n{place}");
                let (cause, ..) = ended(axis, &fault, false);
                if cause != wanted {
                    wrong.push(format!(
                        "{device} {what} x{lasts} {place}: {cause:?}, not {wanted:?}"
                    ));
                }
            }
            // In a hold, the test ends as it does while it runs, and nothing moves before that.
            let fault = format!("[[fault]]\nwhat = {what}\nlasts = {lasts}\nat_tick = 700");
            let (cause, _, [phases, commands]) = ended(axis, &fault, true);
            let during = |phase: Phase| {
                let each = phases.iter().zip(&commands);
                each.skip_while(|(own, _)| **own != Phase::Holding.code())
                    .filter(move |(own, _)| **own == phase.code())
            };
            let places: Vec<&f64> = during(Phase::Holding).map(|(_, place)| place).collect();
            let stands = !places.is_empty() && places.iter().all(|place| *place == places[0]);
            let goes_on = during(Phase::Running).next().is_some();
            if !stands || goes_on != (cause == done) {
                wrong.push(format!("{device} {what} x{lasts} hold: {stands} {goes_on}"));
            }
            if cause != wanted[2] {
                wrong.push(format!(
                    "{device} {what} x{lasts} hold: {cause:?}, not {:?}",
                    wanted[2]
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
