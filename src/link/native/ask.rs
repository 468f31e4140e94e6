//! A question to the specimen and its answer: how long it is waited for, and when it is sent again.

use std::time::Duration;

use super::refused::SetupError;
use crate::Transport;
use crate::inbox::Inbox;
use gusset_quantity::substructure::LISTEN_NS;
use gusset_wire::WireError;
use gusset_wire::handshake::{Control, Welcome};

/// A question whose answer is missing is repeated after so long, over UDP.
const REPEAT_NS: u64 = 200_000_000;

/// The error with the details that the transport knows about a lost connection.
pub(super) fn explained(error: SetupError, transport: &dyn Transport) -> SetupError {
    match (&error, transport.tls_fault()) {
        (SetupError::Lost(_) | SetupError::Silent { .. }, Some(why)) => SetupError::Tls(why),
        _ => error,
    }
}

/// An answer that is not the one that was due.
pub(super) fn not_welcome(message: Control, expected: &'static str) -> SetupError {
    match message {
        Control::Refuse(refuse) => SetupError::Refused {
            code: refuse.code,
            text: refuse.text,
        },
        Control::Bye(bye) => SetupError::Left {
            due: expected,
            cause: bye.cause,
            text: bye.text,
        },
        other => SetupError::Wire(WireError::Order {
            expected,
            found: other.name(),
        }),
    }
}

/// Asks, and waits for the answer while `wanted` returns true. Over UDP it repeats the question until an answer comes. It skips a
/// message without meaning, and reports it if no better one comes.
pub(super) fn ask<R>(
    transport: &mut dyn Transport,
    inbox: &mut Inbox,
    (question, limit): (&'static str, Duration),
    mut put: impl FnMut(&mut dyn Transport) -> Result<(), SetupError>,
    wanted: &mut dyn FnMut() -> bool,
    mut judge: impl FnMut(&[u8]) -> Result<Option<R>, SetupError>,
) -> Result<R, SetupError> {
    let limit_ns = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
    let deadline = transport.now().plus(limit_ns);
    let mut nonsense = None;
    put(transport)?;
    let mut repeat = transport.now().plus(REPEAT_NS);
    loop {
        loop {
            let place = match inbox.next() {
                Ok(Some(place)) => place,
                Ok(None) => break,
                Err(error) if inbox.is_stream() => return Err(error.into()),
                Err(error) => {
                    nonsense = Some(error);
                    continue;
                }
            };
            match judge(inbox.frame(place)) {
                Ok(Some(answer)) => return Ok(answer),
                Ok(None) => {}
                Err(SetupError::Wire(error)) if !inbox.is_stream() => nonsense = Some(error),
                Err(error) => return Err(error),
            }
        }
        if transport.now() >= deadline {
            return Err(nonsense.map_or(
                SetupError::Silent {
                    question,
                    seconds: limit.as_secs_f64(),
                },
                SetupError::Wire,
            ));
        }
        let until = if inbox.is_stream() {
            deadline
        } else {
            deadline.min(repeat)
        };
        // A wait on simulated time takes no wall time.
        let look = if transport.is_simulated() {
            deadline
        } else {
            transport.now().plus(LISTEN_NS)
        };
        match transport.recv(inbox.space(), until.min(look)) {
            Ok(Some(count)) => inbox.filled(count),
            Ok(None) if look < until => {
                if !wanted() {
                    return Err(SetupError::Unwanted);
                }
            }
            Ok(None) if until < deadline => {
                put(transport)?;
                repeat = transport.now().plus(REPEAT_NS);
            }
            Ok(None) => {}
            Err(fault) => return Err(SetupError::Lost(fault)),
        }
    }
}

/// After so long without an answer a lost datagram is sent again, well within the time limit of the answer; on a stream nothing is
/// lost, and the specimen receives a sign of life within its watchdog time.
pub(super) fn nudge_ns(watchdog_ns: u64, reply_timeout_ns: u64, is_stream: bool) -> u64 {
    let sign_of_life = watchdog_ns / 4;
    let nudge = if is_stream {
        sign_of_life
    } else {
        sign_of_life.min(REPEAT_NS).min(reply_timeout_ns / 8)
    };
    nudge.max(1_000_000)
}

/// Watchdog time of the session, as its Welcome gives it.
pub(super) fn watchdog_ns(welcome: &Welcome) -> u64 {
    (welcome.watchdog_s * 1e9) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds in ns.
    const S: u64 = 1_000_000_000;

    #[test]
    fn lost_datagram_is_sent_again_early() {
        // A gateway's usual watchdog time, and the shortest and the longest that are taken.
        for watchdog in [S / 1000, 10 * S, 600 * S] {
            for reply_timeout in [S / 20, S, 5 * S, 60 * S] {
                let repeats = nudge_ns(watchdog, reply_timeout, false);
                assert!(8 * repeats <= reply_timeout && repeats <= REPEAT_NS);
                assert_eq!(
                    nudge_ns(watchdog, reply_timeout, true),
                    (watchdog / 4).max(1_000_000)
                );
            }
        }
        // Unchanged if the watchdog asks for a longer time.
        assert_eq!(nudge_ns(S / 4, S, false), S / 16);
    }
}
