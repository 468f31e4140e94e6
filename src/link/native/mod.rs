//! A specimen that speaks our own protocol, as a [`Substructure`]: the controller's side.
//!
//! Everything that blocks or allocates happens in `connect` and `arm`, before anything moves; `issue` and `collect` run
//! on the loop's thread. Guarantees: a late answer never overwrites a newer one; every answer is counted once; a fault is
//! final; an open interlock stays in the status of every later measurement. The stiffness that the specimen reports is
//! only compared, in number and sign, with the estimate of the test file. The comparison moves nothing.

mod ask;
mod book;
mod live;
mod refused;
mod setup;
mod start;

pub(super) use refused::with_words;
pub use setup::NativeSetup;
pub(crate) use setup::{SOFTWARE, fit};

use crate::Transport;
use crate::tls::TlsClient;
use gusset_config::Carrier;
use gusset_quantity::substructure::{
    Command, Coupling, Freshness, Holder, Introduction, LinkFault, LinkStats, Measurement,
    Retirement, Substructure, Unavailable,
};
use gusset_quantity::time::Nanos;
use live::Live;

/// The controller's end of our own protocol.
pub struct NativeLink {
    setup: NativeSetup,
    tls: Option<TlsClient>,
    /// Given instead of a connection; taken by the first.
    wire: Option<Box<dyn Transport>>,
    live: Option<Live>,
}

impl std::fmt::Debug for NativeLink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NativeLink")
            .field("address", &self.setup.address)
            .field("connected", &self.live.is_some())
            .finish()
    }
}

impl NativeLink {
    /// A link that is not connected yet.
    #[must_use]
    pub const fn new(setup: NativeSetup) -> Self {
        Self {
            setup,
            tls: None,
            wire: None,
            live: None,
        }
    }

    /// A link over a transport that is connected already and carries whole frames like the carrier of the set-up.
    #[must_use]
    pub fn over(setup: NativeSetup, wire: Box<dyn Transport>) -> Self {
        Self {
            wire: Some(wire),
            ..Self::new(setup)
        }
    }

    /// A link over TLS, whichever carrier the set-up names.
    #[must_use]
    pub fn over_tls(mut setup: NativeSetup, tls: TlsClient) -> Self {
        setup.carrier = Carrier::Tls;
        let tls = Some(tls.with_record_limit(setup.reply_timeout));
        Self {
            setup,
            tls,
            wire: None,
            live: None,
        }
    }
}

impl Substructure for NativeLink {
    fn axes(&self) -> usize {
        self.setup.axes.len()
    }

    fn coupling(&self) -> Coupling {
        self.setup.coupling
    }

    fn is_remote(&self) -> bool {
        true
    }

    fn holder(&self) -> Holder {
        match &self.live {
            Some(live) if live.may_be_lost() => Holder::Unknown,
            _ => Holder::ItsWatchdog,
        }
    }

    fn connect(&mut self) -> Result<Introduction, Unavailable> {
        match start::connect(&self.setup, self.tls.as_ref(), self.wire.take()) {
            Ok((live, introduction)) => {
                self.live = Some(live);
                Ok(introduction)
            }
            Err(error) => Err(error.unavailable(&self.setup.address)),
        }
    }

    fn ask_to_arm(&mut self, sequence: u64, disp: &[f64]) -> Result<(), LinkFault> {
        self.live.as_mut().map_or(Err(LinkFault::Closed), |live| {
            live.ask_to_arm(sequence, disp)
        })
    }

    fn arm(
        &mut self,
        sequence: u64,
        disp: &[f64],
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<bool, LinkFault> {
        self.live.as_mut().map_or(Err(LinkFault::Closed), |live| {
            live.arm(sequence, disp, wanted)
        })
    }

    fn stats(&self) -> LinkStats {
        self.live
            .as_ref()
            .map_or_else(LinkStats::default, Live::stats)
    }

    fn complaint(&self) -> Option<String> {
        self.live.as_ref().and_then(Live::complaint)
    }

    fn issue(&mut self, command: &Command<'_>) -> Result<(), LinkFault> {
        self.live
            .as_mut()
            .map_or(Err(LinkFault::Closed), |live| live.issue(command))
    }

    fn collect(&mut self, deadline: Nanos, into: &mut Measurement) -> Result<Freshness, LinkFault> {
        self.live
            .as_mut()
            .map_or(Err(LinkFault::Closed), |live| live.collect(deadline, into))
    }

    fn recover(&mut self, force: &mut [f64]) -> Option<u64> {
        self.live.as_mut().and_then(|live| live.recover(force))
    }

    fn is_answered(&mut self, wait_ns: u64) -> Result<bool, LinkFault> {
        self.live
            .as_mut()
            .map_or(Err(LinkFault::Closed), |live| live.is_answered(wait_ns))
    }

    fn attend(&mut self) -> Result<(), LinkFault> {
        self.live.as_mut().map_or(Ok(()), Live::attend)
    }

    fn pause(&mut self) -> Result<(), LinkFault> {
        self.live.as_mut().map_or(Ok(()), Live::pause)
    }

    fn halt(&mut self) -> Result<(), LinkFault> {
        self.live.as_mut().map_or(Ok(()), Live::halt)
    }

    fn retire(&mut self, how: Retirement) {
        if let Some(live) = &mut self.live {
            live.retire(how);
        }
    }

    fn has_acknowledged(&self) -> Option<bool> {
        self.live.as_ref().and_then(Live::has_acknowledged)
    }

    fn last_words(&self) -> Option<String> {
        self.live.as_ref().and_then(Live::last_words)
    }
}

#[cfg(test)]
mod tests;
