//! Connect, greet, agree: everything before the first command. Blocking, with time limits.

use std::time::Duration;

use super::live::Live;
use super::refused::{SetupError, parting};
use crate::config::Carrier;
use crate::link::announce;
use crate::link::inbox::Inbox;
use crate::link::secret::random;
use crate::link::tls::{TlsClient, is_alert};
use crate::link::{ConnectError, SocketOptions, TcpTransport, Transport, UdpTransport};
use crate::substructure::{Coupling, Introduction, LISTEN_NS, LinkFault};
use crate::text::is_hidden;
use crate::wire::handshake::{
    self, Axis, Capabilities, Control, Hello, Limits, Sampling, Versions, Welcome, layout_hash,
};
use crate::wire::key::{NONCE_LEN, PROOF_LEN, PreSharedKey};
use crate::wire::native::{Decoder, Encoder, Frame, LARGEST_FRAME};
use crate::wire::{Side, WireError};

/// The program, as it calls itself to peers.
pub(in crate::link) const SOFTWARE: &str = concat!("gusset ", env!("CARGO_PKG_VERSION"));

/// A question whose answer is missing is repeated after so long, over UDP.
const REPEAT_NS: u64 = 200_000_000;

/// What a controller wants of a specimen that speaks our own protocol.
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
    /// Whether a reply is owed for each command.
    pub coupling: Coupling,
    /// Time limit of connecting and of each question in the set-up.
    pub connect_limit: Duration,
    /// How long a lockstep reply may stay away.
    pub reply_timeout: Duration,
    /// What is asked of the socket.
    pub options: SocketOptions,
}

impl NativeSetup {
    /// Connects and agrees. Blocks, up to twice the time limit.
    pub(super) fn connect(
        &self,
        tls: Option<&TlsClient>,
        wire: Option<Box<dyn Transport>>,
    ) -> Result<(Live, Introduction), SetupError> {
        let (mut transport, peer): (Box<dyn Transport>, String) = match (wire, self.carrier) {
            (Some(wire), _) => (wire, self.address.clone()),
            (None, Carrier::Tcp) => {
                let tcp = TcpTransport::connect(&self.address, self.connect_limit, self.options)?;
                let peer = tcp.peer().to_string();
                (Box::new(tcp), peer)
            }
            (None, Carrier::Tls) => {
                let tls = tls.ok_or(SetupError::Bare)?;
                let (limit, options) = (self.connect_limit, self.options);
                let tls = tls.connect(&self.address, limit, options, 2 * LARGEST_FRAME)?;
                let peer = tls.peer().to_string();
                (Box::new(tls), peer)
            }
            (None, Carrier::Udp) => {
                let udp = UdpTransport::connect(&self.address, self.options)?;
                let peer = udp.peer().to_string();
                (Box::new(udp), peer)
            }
        };
        let mut inbox = Inbox::new(self.carrier.is_stream());
        let hello = self.hello()?;
        let mut hello_bytes = handshake::encode(&Control::Hello(hello.clone()))?;
        if let Some(key) = &self.key {
            handshake::prove_hello(&mut hello_bytes, key)?;
        }
        let mut encoder = Encoder::greeting(Side::Controller);
        let mut decoder = Decoder::greeting(Side::Specimen);
        let mut out = vec![0; LARGEST_FRAME];
        let limit = self.connect_limit;
        let answer = ask(
            transport.as_mut(),
            &mut inbox,
            ("hello", limit),
            |transport| {
                let length = encoder.control(&hello_bytes, &mut out)?;
                let frame = out.get(..length).unwrap_or_default();
                transport.send(frame).map_err(SetupError::Lost)
            },
            // Who connects waits on a thread of its own, which is left behind.
            &mut || true,
            |frame| {
                let received = decoder.open(frame)?;
                let Frame::Control(message) = received.frame else {
                    return Ok(None);
                };
                match handshake::decode(message)? {
                    Control::Welcome(welcome) => Ok(Some((welcome, message.to_vec()))),
                    other => Err(not_welcome(other, "a welcome")),
                }
            },
        );
        let (welcome, welcome_bytes) = answer.map_err(|error| match error {
            // Nobody listens on that UDP port: the machine itself says so.
            SetupError::Lost(LinkFault::Closed) if self.carrier == Carrier::Udp => {
                ConnectError::Refused {
                    address: self.address.clone(),
                }
                .into()
            }
            SetupError::Wire(WireError::Magic { found, .. })
                if self.carrier == Carrier::Tcp && is_alert(&found) =>
            {
                SetupError::SpeaksTls
            }
            other => explained(other, transport.as_ref()),
        })?;
        let key = match &self.key {
            Some(key) => {
                let key = key.session(&hello.nonce, &welcome.nonce, welcome.session);
                if welcome.keyed {
                    handshake::verify_welcome(&hello_bytes, &welcome_bytes, &key)?;
                }
                Some(key)
            }
            None => None,
        };
        handshake::check_welcome(&hello, &welcome)?;
        if let Some(wider) = handshake::wider(&welcome.axes, &hello.axes) {
            let axis = hello.axes.into_iter().nth(wider.axis);
            let axis = axis.map(|axis| axis.name).unwrap_or_default();
            return Err(SetupError::Wider { axis, wider });
        }
        let axes = self.axes.len();
        let live = Live::new(
            transport,
            inbox,
            Encoder::new(Side::Controller, axes, welcome.session, key.clone())?,
            Decoder::new(Side::Specimen, axes, welcome.session, key)?,
            self,
            &welcome,
        );
        let mut warnings = self.limits_of_their_own(&welcome);
        warnings.extend(self.alarmed_early(&welcome));
        let measures = Capabilities::MEASURES_DISP.0 | Capabilities::SIMULATED.0;
        let introduction = Introduction {
            peer: format!(
                "\"{}\" at {peer} ({}, {}, watchdog {} s)",
                welcome.name, self.carrier, welcome.software, welcome.watchdog_s
            ),
            stiffness: welcome.stiffness,
            standing: welcome.standing,
            measured: false,
            force: Vec::new(),
            warnings,
            simulated: welcome.capabilities.has(Capabilities::SIMULATED),
            keeps_state: welcome.capabilities.has(Capabilities::KEEPS_STATE),
            repeats_the_command: welcome.capabilities.0 & measures == 0,
        };
        Ok((live, introduction))
    }

    /// Limits that the specimen's end keeps and the test does not know of.
    fn limits_of_their_own(&self, welcome: &Welcome) -> Vec<String> {
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
    fn alarmed_early(&self, welcome: &Welcome) -> Option<String> {
        let period_s = self.rate.1 as f64 / self.rate.0 as f64;
        (welcome.watchdog_s < 2.0 * period_s).then(|| {
            format!(
                "\"{}\": its end holds after {} s without a command, and commands come every {period_s} s: one that is late \
                 alarms it (`watchdog_s` asks for {} s)",
                welcome.name, welcome.watchdog_s, self.watchdog_s
            )
        })
    }

    fn hello(&self) -> Result<Hello, SetupError> {
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

/// What the transport knows about a lost connection.
pub(super) fn explained(error: SetupError, transport: &dyn Transport) -> SetupError {
    match (&error, transport.tls_fault()) {
        (SetupError::Lost(_) | SetupError::Silent { .. }, Some(why)) => SetupError::Tls(why),
        _ => error,
    }
}

/// An axis without limits.
#[must_use]
pub fn unlimited_axis(
    name: String,
    disp_unit: handshake::Unit,
    force_unit: handshake::Unit,
) -> Axis {
    Axis {
        name,
        disp_unit,
        force_unit,
        limits: Limits::NONE,
    }
}

/// A text that fits into a message: no hidden characters, not too long, not empty.
pub(in crate::link) fn fit(text: &str) -> String {
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

/// An answer that is not the one that was due.
pub(super) fn not_welcome(message: Control, expected: &'static str) -> SetupError {
    match message {
        Control::Refuse(refuse) => SetupError::Refused {
            code: refuse.code,
            text: refuse.text,
        },
        Control::Bye(bye) => SetupError::Left {
            due: expected,
            why: parting(bye.cause, &bye.text),
        },
        other => SetupError::Wire(WireError::Order {
            expected,
            found: other.name(),
        }),
    }
}

/// Asks and waits for the answer as long as it is `wanted`; over UDP the question is repeated until there is one, and what
/// makes no sense is passed over, but named if nothing better comes.
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
        // A wait on simulated time takes none of whoever may not want it any more.
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
/// lost, and the specimen is told within its watchdog time that we are here.
pub(super) fn nudge_ns(watchdog_ns: u64, reply_timeout_ns: u64, is_stream: bool) -> u64 {
    let sign_of_life = watchdog_ns / 4;
    let nudge = if is_stream {
        sign_of_life
    } else {
        sign_of_life.min(REPEAT_NS).min(reply_timeout_ns / 8)
    };
    nudge.max(1_000_000)
}

/// What a Welcome settles for the session.
pub(super) fn watchdog_ns(welcome: &Welcome) -> u64 {
    (welcome.watchdog_s * 1e9) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds in ns.
    const S: u64 = 1_000_000_000;

    #[test]
    fn a_lost_datagram_is_sent_again_long_before_its_answer_is_given_up() {
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
        // As it was where the watchdog asks for more than that.
        assert_eq!(nudge_ns(S / 4, S, false), S / 16);
    }
}
