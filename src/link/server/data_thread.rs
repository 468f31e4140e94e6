//! The data thread: it serves one client after another, and is the only thread that commands the specimen.

use std::sync::Arc;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError};

use super::handshake::Opening;
use super::native_handshake::Offer;
use super::native_opening::{self, DataThread};
use super::openfresco_session;
use super::reception::Client;
use super::shared::Shared;
use crate::openfresco::{Host, ServeSettings};

/// The stop flag is checked this often while no client is served.
const PAUSE: Duration = Duration::from_millis(50);

/// The specimen of a server, and how its protocol commands it.
pub(super) enum Served {
    Native {
        offer: Arc<Offer>,
        spin_ns: u64,
    },
    OpenFresco {
        host: Box<Host>,
        settings: ServeSettings,
        is_stream: bool,
    },
}

impl Served {
    /// The logs of tests leave this processor to the data thread.
    pub(crate) fn keep_record_away_from(&mut self, cpu: Option<usize>) {
        if let Self::OpenFresco { host, .. } = self {
            host.keep_record_away_from(cpu);
        }
    }

    /// One test, from its beginning to its end.
    fn attend(&mut self, client: Client, shared: &Shared, cpu: Option<usize>) {
        let Client { channel, opening } = client;
        match (self, opening) {
            (Self::Native { offer, spin_ns }, Opening::Native(opening)) => {
                let spin_ns = *spin_ns;
                let thread = DataThread { cpu, spin_ns };
                match native_opening::open(channel, *opening, &offer.host, thread, shared) {
                    Ok(session) => session.run(shared),
                    Err(_closed) => {}
                }
            }
            (
                Self::OpenFresco {
                    host,
                    settings,
                    is_stream,
                },
                Opening::OpenFresco(opening),
            ) => openfresco_session::attend(channel, *opening, host, settings, *is_stream, shared),
            // A server speaks one protocol.
            (Self::Native { .. } | Self::OpenFresco { .. }, _) => {}
        }
    }
}

/// Serves one client after another until the server stops.
pub(super) fn serve(
    shared: &Shared,
    clients: &Receiver<Client>,
    served: &mut Served,
    cpu: Option<usize>,
) {
    while !shared.is_stopped() {
        match clients.recv_timeout(PAUSE) {
            Ok(client) => {
                served.attend(client, shared, cpu);
                shared.release();
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}
