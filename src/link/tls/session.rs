//! One TLS session over any socket that does not block: received bytes enter, due bytes leave.
//!
//! Invariant: nothing here waits. Bytes that came before a failure are delivered before the failure is reported.

use std::io::{self, Read, Write};

use rustls::{Connection, Error};

use super::record::Records;
use crate::socket::{Verdict, verdict};
use crate::tls_fault::{TlsFault, names};
use gusset_record::rt::os;

/// A TLS session.
pub(super) struct Session {
    tls: Connection,
    records: Records,
    /// Details of the fault, in words.
    detail: Option<String>,
}

/// Follows the bytes that are read.
struct Followed<'a, S> {
    socket: &'a mut S,
    records: &'a mut Records,
}

impl<S: Read> Read for Followed<'_, S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.socket.read(buffer)?;
        let came = buffer.get(..count).unwrap_or_default();
        self.records.follow(came, os::monotonic_ns());
        Ok(count)
    }
}

impl Session {
    pub(super) fn new(mut tls: Connection) -> Self {
        // How much may wait to be sent is decided above.
        tls.set_buffer_limit(None);
        Self {
            tls,
            records: Records::default(),
            detail: None,
        }
    }

    pub(super) fn is_handshaking(&self) -> bool {
        self.tls.is_handshaking()
    }

    pub(super) fn wants_write(&self) -> bool {
        self.tls.wants_write()
    }

    pub(super) const fn records(&self) -> &Records {
        &self.records
    }

    pub(super) fn detail(&self) -> Option<&str> {
        self.detail.as_deref()
    }

    /// Encrypts.
    pub(super) fn put(&mut self, bytes: &[u8]) -> Result<(), TlsFault> {
        self.tls
            .writer()
            .write_all(bytes)
            .map_err(|_| TlsFault::Lost)
    }

    /// Decrypted bytes; `None` if nothing waits. Call it until then before the next [`Session::pull`].
    pub(super) fn take(&mut self, buffer: &mut [u8]) -> Result<Option<usize>, TlsFault> {
        match self.tls.reader().read(buffer) {
            Ok(0) if buffer.is_empty() => Ok(None),
            Ok(0) => Err(TlsFault::Closed),
            Ok(count) => Ok(Some(count)),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
            Err(_) => Err(self.closed()),
        }
    }

    /// Reads the bytes of the socket; false if it had none.
    pub(super) fn pull<S: Read + Write>(&mut self, socket: &mut S) -> Result<bool, TlsFault> {
        let mut followed = Followed {
            socket,
            records: &mut self.records,
        };
        match self.tls.read_tls(&mut followed) {
            Ok(0) => Err(self.closed()),
            Ok(_) => match self.tls.process_new_packets() {
                Ok(_) => Ok(true),
                Err(error) => {
                    // The peer learns the reason, if it still listens.
                    let _ = self.write(socket);
                    Err(self.fail(&error))
                }
            },
            Err(error) => match verdict(&error) {
                Verdict::Again | Verdict::NotNow => Ok(false),
                Verdict::Lost(_) => Err(self.lost()),
            },
        }
    }

    /// Writes due bytes, as far as the socket takes them.
    pub(super) fn push<S: Read + Write>(&mut self, socket: &mut S) -> Result<(), TlsFault> {
        let Err(lost) = self.write(socket) else {
            return Ok(());
        };
        // A peer that rejects us sends an alert and closes: its alert explains more than the broken pipe.
        match self.pull(socket) {
            Err(fault) if fault.is_telling() => Err(fault),
            _ => Err(lost),
        }
    }

    fn write<S: Write>(&mut self, socket: &mut S) -> Result<(), TlsFault> {
        while self.tls.wants_write() {
            match self.tls.write_tls(socket) {
                Ok(0) => return Err(self.lost()),
                Ok(_) => {}
                Err(error) => match verdict(&error) {
                    Verdict::Again => {}
                    Verdict::NotNow => return Ok(()),
                    Verdict::Lost(_) => return Err(self.lost()),
                },
            }
        }
        Ok(())
    }

    /// Tells the peer that nothing more will come, as far as the socket takes it.
    pub(super) fn say_closed<S: Write>(&mut self, socket: &mut S) {
        self.tls.send_close_notify();
        let _ = self.write(socket);
    }

    fn lost(&self) -> TlsFault {
        if self.tls.is_handshaking() {
            TlsFault::ClosedEarly
        } else {
            TlsFault::Lost
        }
    }

    fn closed(&self) -> TlsFault {
        if self.tls.is_handshaking() {
            if self.records.is_tls() {
                TlsFault::ClosedEarly
            } else {
                TlsFault::NotTls
            }
        } else if self.records.unfinished().is_some() {
            TlsFault::Cut
        } else {
            TlsFault::Closed
        }
    }

    fn fail(&mut self, error: &Error) -> TlsFault {
        if !self.records.is_tls() {
            return TlsFault::NotTls;
        }
        let fault = TlsFault::of(error);
        self.detail = match fault {
            TlsFault::OtherName => names(error),
            TlsFault::Broken | TlsFault::NothingInCommon | TlsFault::Unusable => {
                Some(error.to_string())
            }
            _ => None,
        };
        fault
    }
}
