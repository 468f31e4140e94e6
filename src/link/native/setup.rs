//! The requests of a controller to a specimen of the Gusset protocol, and the hello that contains them.

use std::time::Duration;

use super::refused::SetupError;
use crate::SocketOptions;
use crate::announce;
use crate::secret::random;
use gusset_config::Carrier;
use gusset_quantity::substructure::Coupling;
use gusset_quantity::text::is_hidden;
use gusset_wire::handshake::{self, Axis, Hello, Sampling, Versions, Welcome, layout_hash};
use gusset_wire::key::{NONCE_LEN, PROOF_LEN, PreSharedKey};

/// The program, as it calls itself to peers.
pub(crate) const SOFTWARE: &str = concat!("gusset ", env!("CARGO_PKG_VERSION"));

/// Requirements of a controller for a specimen that speaks our own protocol.
#[derive(Debug, Clone)]
pub struct NativeSetup {
    /// "host:port".
    pub address: String,
    /// How the bytes travel.
    pub carrier: Carrier,
    /// Frames are signed with it.
    pub key: Option<PreSharedKey>,
    /// Name of the test.
    pub test: String,
    /// The axes, in the order of the vectors.
    pub axes: Vec<Axis>,
    /// Commands per second of wall time: numerator and denominator.
    pub rate: (u64, u64),
    /// The specimen must hold when no command has come for so long, s.
    pub watchdog_s: f64,
    /// When the force is sampled.
    pub sampling: Sampling,
    /// Whether each command needs a reply.
    pub coupling: Coupling,
    /// Time limit of connecting and of each question in the set-up.
    pub connect_limit: Duration,
    /// How long a lockstep reply may stay away.
    pub reply_timeout: Duration,
    /// Options of the socket.
    pub options: SocketOptions,
}

impl NativeSetup {
    /// Limits that the specimen's end keeps and the test does not know of.
    pub(super) fn limits_of_their_own(&self, welcome: &Welcome) -> Vec<String> {
        let axes = self.axes.iter().zip(&welcome.axes);
        axes.filter_map(|(ours, theirs)| {
            let units = announce::units_of(ours);
            let kept = announce::unknown_to_us(&ours.limits, &theirs.limits, &units)?;
            Some(format!(
                "its end keeps limits that the test does not have, axis \"{}\": {kept}",
                ours.name
            ))
        })
        .collect()
    }

    /// A watchdog that one late command alarms.
    pub(super) fn alarmed_early(&self, welcome: &Welcome) -> Option<String> {
        let period_s = self.rate.1 as f64 / self.rate.0 as f64;
        (welcome.watchdog_s < 2.0 * period_s).then(|| {
            format!(
                "\"{}\": its end holds after {} s without a command, and commands come every {period_s} s: one that is late \
                 alarms it (`watchdog_s` asks for {} s)",
                welcome.name, welcome.watchdog_s, self.watchdog_s
            )
        })
    }

    pub(super) fn hello(&self) -> Result<Hello, SetupError> {
        Ok(Hello {
            proof: [0; PROOF_LEN],
            nonce: random::<NONCE_LEN>()?,
            layout: layout_hash(&self.axes),
            versions: Versions::OURS,
            keyed: self.key.is_some(),
            rate_numerator: self.rate.0,
            rate_denominator: self.rate.1,
            watchdog_s: self.watchdog_s,
            sampling: self.sampling,
            software: SOFTWARE.to_owned(),
            name: fit(&self.test),
            axes: self.axes.clone(),
        })
    }
}

/// A text that fits into a message: no hidden characters, not too long, not empty.
pub(crate) fn fit(text: &str) -> String {
    let mut fitting: String = text
        .chars()
        .map(|c| if is_hidden(c) { ' ' } else { c })
        .collect();
    while fitting.len() > handshake::TEXT_LIMIT {
        fitting.pop();
    }
    if fitting.trim().is_empty() {
        "test".clone_into(&mut fitting);
    }
    fitting
}
