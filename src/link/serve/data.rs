//! The data thread: one session after another, each with a specimen in its virgin state.

use std::net::SocketAddr;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError};

use super::greet::Greeted;
use super::stand::Stand;
use super::{Desk, Heard, Line};
use crate::link::inbox::Inbox;
use crate::rt::{RtPlan, apply};

/// The stop flag is looked at this often.
const LOOK: Duration = Duration::from_millis(50);

/// A controller that has armed, on its way to the data thread.
pub(super) struct Session {
    pub(super) line: Line,
    pub(super) inbox: Inbox,
    pub(super) peer: SocketAddr,
    pub(super) greeted: Greeted,
    pub(super) first_sequence: u64,
}

impl Session {
    /// Hands a session over; the specimen is reserved for it.
    pub(super) fn start(
        desk: &Desk,
        line: Line,
        inbox: Inbox,
        peer: SocketAddr,
        greeted: Greeted,
        first_sequence: u64,
    ) {
        desk.tell(Heard::Armed {
            peer,
            test: greeted.test.clone(),
        });
        let session = Session {
            line,
            inbox,
            peer,
            greeted,
            first_sequence,
        };
        // The reservation makes room in the queue certain; a data thread that is gone ends the server.
        if desk.sessions.try_send(session).is_err() {
            desk.give_back();
        }
    }
}

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
    while !desk.stop.load(Ordering::Acquire) {
        match sessions.recv_timeout(LOOK) {
            Ok(session) => {
                desk.tell(attend(session, desk));
                desk.give_back();
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn attend(session: Session, desk: &Desk) -> Heard {
    match (desk.host.build)() {
        Ok(specimen) => Stand::new(session, specimen, desk.spin_ns).run(desk),
        Err(text) => Heard::Ended {
            text,
            commands: 0,
            missed: 0,
            corrupt: 0,
        },
    }
}
