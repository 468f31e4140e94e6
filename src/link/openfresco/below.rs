//! Reports what the transport below knows of a lost link, and whether the far end answered plain text with TLS.

use super::error::RemoteError;
use crate::Transport;
use crate::tls::{TlsFault, is_alert};

/// The first bytes that came, and why TLS failed.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Below {
    first: [u8; 4],
    seen: usize,
    tls: Option<TlsFault>,
}

impl Below {
    /// Takes notice of bytes that came. Real-time: yes.
    pub(super) fn follow(&mut self, bytes: &[u8]) {
        for (place, byte) in self.first.iter_mut().skip(self.seen).zip(bytes) {
            *place = *byte;
            self.seen += 1;
        }
    }

    /// Asks the transport before it is closed. Real-time: yes.
    pub(super) fn ask(&mut self, link: Option<&dyn Transport>) {
        if let Some(link) = link {
            self.tls = link.tls_fault();
        }
    }

    /// In words, if more is known than that the link is lost. `plain`: no TLS was spoken here.
    pub(super) fn text(self, plain: bool) -> Option<String> {
        if plain && is_alert(&self.first) {
            let text = "it speaks TLS: set `transport = \"tls\"`, with the certificates of [specimen.link.tls]";
            return Some(text.to_owned());
        }
        self.tls.map(|why| format!("TLS: {why}"))
    }

    /// A set-up that failed, with everything that is known.
    pub(super) fn explain(self, error: RemoteError, plain: bool) -> RemoteError {
        let fault = error.fault();
        match error {
            RemoteError::Lost { ref address, .. } | RemoteError::Timeout { ref address, .. } => {
                match self.text(plain) {
                    Some(text) => RemoteError::Below {
                        address: address.clone(),
                        text,
                        fault: self.tls.map_or(fault, TlsFault::link),
                    },
                    None => error,
                }
            }
            other => other,
        }
    }
}
