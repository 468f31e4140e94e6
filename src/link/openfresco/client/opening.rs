//! Exchange before the first command: sizes, and the questions that a server can answer. Nothing moves.

use super::Remote;
use crate::openfresco::asking::{Asking, Came, pause, send};
use crate::openfresco::error::{Lost, RemoteError, Saying};
use gusset_quantity::substructure::{LinkFault, Measurement};
use gusset_quantity::time::Nanos;
use gusset_record::rt::os;
use gusset_wire::WireError;
use gusset_wire::openfresco::{Client, Matrix, Reading};

impl Remote {
    pub(super) fn set_up(&mut self, until: Nanos) -> Result<(), RemoteError> {
        let say = Saying::new(&self.settings, "the set-up");
        let opening = self
            .machine
            .open()
            .map_err(|error| say.wire(error))?
            .to_vec();
        let hello = opening.len() == 1;
        self.send_raw(&opening).map_err(|fault| say.lost(fault))?;
        if !hello && matches!(self.machine, Asking::Client(_)) {
            return Ok(());
        }
        loop {
            match self.hear(until) {
                Ok(Came::Ready) => return Ok(()),
                Ok(_) => {}
                // No program has the port yet: the hello has certainly not arrived, so it may be sent again.
                Err(Lost::Link(LinkFault::Closed))
                    if hello && Nanos(os::monotonic_ns()) < until =>
                {
                    pause();
                    self.send_raw(&opening).or_else(|fault| match fault {
                        LinkFault::Closed => Ok(()),
                        fault => Err(say.lost(fault)),
                    })?;
                }
                Err(lost) => return Err(say.why(lost)),
            }
        }
    }

    /// Asks, and waits for the answer; false where the peer is of a kind that is not asked.
    fn ask(
        &mut self,
        say: &Saying,
        until: Nanos,
        request: impl FnOnce(&mut Client) -> Result<&[u8], WireError>,
        answer: Came,
    ) -> Result<bool, RemoteError> {
        let Self {
            machine: Asking::Client(client),
            link: Some(link),
            ..
        } = self
        else {
            return Ok(false);
        };
        let bytes = request(client).map_err(|error| say.wire(error))?;
        send(link.as_mut(), self.settings.carrier, bytes, bytes.len())
            .map_err(|fault| say.lost(fault))?;
        while self.hear(until).map_err(|lost| say.why(lost))? != answer {}
        Ok(true)
    }

    pub(super) fn ask_stiffness(&mut self, until: Nanos) -> Result<(), RemoteError> {
        let say = Saying::new(&self.settings, "the request for the initial stiffness");
        if !self.ask(
            &say,
            until,
            |client| client.request_matrix(Matrix::InitialStiffness),
            Came::Matrix,
        )? {
            return Ok(());
        }
        let mut rows = vec![0.0; self.settings.axes * self.settings.axes];
        if let Asking::Client(client) = &self.machine {
            client.matrix(&mut rows).map_err(|error| say.wire(error))?;
        }
        self.initial_stiffness = Some(rows);
        Ok(())
    }

    pub(super) fn ask_standing(&mut self, until: Nanos) -> Result<(), RemoteError> {
        let say = Saying::new(&self.settings, "the request for where the specimen stands");
        if !self.ask(
            &say,
            until,
            |client| client.request(Reading::All),
            Came::Signals,
        )? {
            return Ok(());
        }
        let mut measured = Measurement::zeros(self.settings.axes);
        let filled = self.machine.measurement(&mut measured);
        filled.map_err(|error| say.wire(error))?;
        self.standing = Some((measured.disp, measured.force));
        Ok(())
    }
}
