//! The data thread: one session after another, each with a specimen in its virgin state or a connection of its own.

use std::sync::atomic::Ordering;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError};

use super::armed::Session;
use super::greet;
use super::line::Line;
use super::stand::Stand;
use super::{Desk, Heard};
use crate::catalog::ending::Cause;
use crate::link::Transport;
use crate::rt::throttle::Throttle;
use crate::rt::{RtPlan, apply};

/// The stop flag is looked at this often while nobody is there.
const PAUSE: Duration = Duration::from_millis(50);

/// One session after another until the server stops.
pub(super) fn serve(desk: &Desk, sessions: &Receiver<Session>, plan: Option<&RtPlan>) {
    // Held for as long as the thread lives: it keeps the processors awake.
    let granted = plan.map(apply);
    for feature in granted.iter().flat_map(|granted| granted.missing()) {
        let reason = feature.reason.as_deref().unwrap_or("refused");
        desk.tell(Heard::NotGranted {
            text: format!("{}: {reason}", feature.asked),
        });
    }
    let cpu = granted.as_ref().and_then(|granted| granted.cpu);
    while !desk.stop.load(Ordering::Acquire) {
        match sessions.recv_timeout(PAUSE) {
            Ok(session) => {
                desk.tell(attend(session, desk, cpu));
                desk.give_back();
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// One test, from its beginning to its end.
fn attend(session: Session, desk: &Desk, cpu: Option<usize>) -> Heard {
    match get_ready(session, desk, cpu) {
        Ok(stand) => stand.run(desk),
        Err(refused) => refused.0,
    }
}

/// Everything is got ready, and only then the controller hears that the specimen is armed. An error is what has to be told
/// of a test that cannot begin, and its line.
pub(super) fn get_ready(
    mut session: Session,
    desk: &Desk,
    cpu: Option<usize>,
) -> Result<Stand, Box<(Heard, Line)>> {
    if let Some(script) = &desk.host.faults {
        let text = script.words();
        desk.tell(Heard::Told { text });
        session.line = session.line.played(
            script,
            session.greeted.period_ns,
            session.arm.first_sequence,
        );
    }
    let peer = session.peer;
    let station = desk.host.station(false).and_then(|mut station| {
        station.keep_log_away_from(cpu);
        station.now_is(session.line.now());
        let visitor = session.visitor();
        let told = station.begin(&visitor, &mut || session.is_wanted(desk));
        for text in told.map_err(|over| over.text)? {
            desk.tell(Heard::Told { text });
        }
        Ok(station)
    });
    let mut station = match station {
        Ok(station) => station,
        Err(text) => {
            let refuse = greet::not_ready(&text);
            let frame = greet::refusal(refuse, Some(&mut session.greeted.encoder));
            // Who does not hear it sees the connection close.
            let _ = session.line.send(&frame);
            return Err(Box::new((Heard::Refused { peer, text }, session.line)));
        }
    };
    let armed = session.greeted.armed(session.arm.clone());
    if let Err(fault) = session.line.send(&armed) {
        let text = fault.to_string();
        station.end(Cause::ControllerVanished, &text);
        return Err(Box::new((Heard::Refused { peer, text }, session.line)));
    }
    desk.tell(Heard::Armed {
        peer,
        test: session.greeted.test.clone(),
    });
    // A data thread that has a processor of its own must leave the kernel its share of it.
    let spin_ns = match cpu {
        None => desk.spin_ns,
        Some(_) => {
            let around = desk.spin_ns.saturating_mul(2);
            Throttle::USUAL.fit_spin(around, session.greeted.period_ns) / 2
        }
    };
    Ok(Stand::new(session, station, spin_ns))
}
