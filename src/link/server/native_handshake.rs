//! The handshake of the native protocol: a Hello that is welcomed, then an Arm.
//!
//! Over a stream the first malformed byte ends the handshake. Any sender may forge a datagram's address, so a malformed
//! one is reported and dropped.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use super::ServerEvent;
use super::handshake_step::{Failure, Step};
use super::hosted::Host;
use super::shared::{Occupancy, Shared};
use crate::inbox::Inbox;
use crate::native::{SOFTWARE, fit};
use crate::secret::random;
use crate::served::elsewhere;
use crate::tls::is_client_hello;
use gusset_config::WATCHDOG_MAX_S;
use gusset_quantity::text::is_hidden;
use gusset_wire::handshake::{
    self, Arm, Bye, Control, Hello, Limits, Refuse, RefuseCode, Sampling, TEXT_LIMIT, Terms,
    Versions, Welcome, layout_hash,
};
use gusset_wire::key::{NONCE_LEN, PROOF_LEN, PreSharedKey};
use gusset_wire::native::{Cause, Decoder, Encoder, Frame, LARGEST_FRAME};
use gusset_wire::{Side, WireError};

/// Most commands per second that are taken on.
const RATE_MAX_HZ: f64 = 100_000.0;

/// Time limit of the TLS session, and of the Hello.
const HELLO_LIMIT: Duration = Duration::from_secs(5);
/// Time limit from the welcome to the Arm: a large model takes a while to get ready.
const ARM_LIMIT: Duration = Duration::from_secs(60);

/// The specimen that a native server offers, and the key that its clients must have.
pub(super) struct Offer {
    pub host: Host,
    pub key: Option<PreSharedKey>,
}

/// Medium of the bytes of a handshake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Medium {
    Stream,
    Datagrams,
    /// A wire of simulated time, which may lose frames.
    Simulated,
}

/// A client that has armed.
pub(super) struct NativeOpening {
    pub inbox: Inbox,
    pub greeted: Greeted,
    pub arm: Arm,
}

/// The handshake of one client.
pub(super) struct NativeHandshake {
    offer: Arc<Offer>,
    medium: Medium,
    inbox: Inbox,
    welcomed: Option<Welcomed>,
    arm: Option<Arm>,
}

struct Welcomed {
    hello: Vec<u8>,
    greeted: Greeted,
}

impl NativeHandshake {
    pub(crate) fn new(offer: Arc<Offer>, medium: Medium, inbox: Inbox) -> Self {
        Self {
            offer,
            medium,
            inbox,
            welcomed: None,
            arm: None,
        }
    }

    pub(crate) const fn has_spoken(&self) -> bool {
        self.welcomed.is_some()
    }

    pub(crate) fn phase(&self, is_encrypting: bool) -> (u8, Duration) {
        match &self.welcomed {
            _ if is_encrypting => (0, HELLO_LIMIT),
            None => (1, HELLO_LIMIT),
            // A place over datagrams has no time limit: a newer client takes it if there are too many.
            Some(_) if self.medium == Medium::Datagrams => (2, Duration::MAX),
            Some(_) => (2, ARM_LIMIT),
        }
    }

    pub(crate) fn timed_out(&self, is_encrypting: bool) -> Failure {
        let what = match &self.welcomed {
            _ if is_encrypting => "end of the TLS handshake",
            None => "hello",
            Some(_) => "arm message",
        };
        let limit = self.phase(is_encrypting).1.as_secs();
        Failure::Malformed {
            text: format!("no {what} within {limit} s"),
            frame: Vec::new(),
        }
    }

    pub(crate) fn into_opening(self) -> Option<NativeOpening> {
        Some(NativeOpening {
            inbox: self.inbox,
            greeted: self.welcomed?.greeted,
            arm: self.arm?,
        })
    }

    pub(crate) fn take(
        &mut self,
        bytes: &[u8],
        peer: SocketAddr,
        shared: &Shared,
        replies: &mut Vec<Vec<u8>>,
    ) -> Result<Step, Failure> {
        if self.medium != Medium::Stream {
            return self.frame(bytes, peer, shared, replies);
        }
        let mut rest = bytes;
        loop {
            while let Some(place) = self.inbox.next().map_err(malformed)? {
                let frame = self.inbox.frame(place).to_vec();
                if self.frame(&frame, peer, shared, replies)? == Step::Complete {
                    // The bytes after it belong to the session.
                    self.inbox.add(rest);
                    return Ok(Step::Complete);
                }
            }
            if rest.is_empty() {
                return Ok(Step::More);
            }
            let used = self.inbox.add(rest);
            rest = rest.get(used..).unwrap_or_default();
        }
    }

    fn frame(
        &mut self,
        frame: &[u8],
        peer: SocketAddr,
        shared: &Shared,
        replies: &mut Vec<Vec<u8>>,
    ) -> Result<Step, Failure> {
        let greeting = Decoder::greeting(Side::Controller)
            .open(frame)
            .map(|received| received.frame);
        let is_welcomed = self.welcomed.is_some();
        match greeting {
            Ok(Frame::Control(message)) if !is_welcomed || self.medium != Medium::Stream => {
                replies.push(self.welcome(message, peer, shared)?);
                Ok(Step::More)
            }
            // Another version deserves an answer.
            Err(error @ WireError::Version { .. }) if self.medium == Medium::Datagrams => {
                Err(refused(nonsense(error), None))
            }
            _ if is_welcomed => self.arming(frame, peer, shared),
            Ok(_) => Ok(Step::More),
            Err(error) if self.medium != Medium::Datagrams => Err(malformed(error)),
            // A late frame of a test that is over.
            Err(WireError::Session { .. } | WireError::Keyed { .. }) => Ok(Step::More),
            Err(error) => {
                shared.complain(peer, nonsense(error).text);
                Ok(Step::More)
            }
        }
    }

    /// The welcome of a Hello; the same again if the client repeats it.
    fn welcome(
        &mut self,
        message: &[u8],
        peer: SocketAddr,
        shared: &Shared,
    ) -> Result<Vec<u8>, Failure> {
        if let Some(known) = &self.welcomed
            && known.hello == message
        {
            return Ok(known.greeted.welcome.clone());
        }
        let is_taken = shared.occupancy() != Occupancy::Free;
        let greeted =
            judge(&self.offer, is_taken, message).map_err(|refuse| refused(refuse, None))?;
        shared.tell(ServerEvent::Hello {
            peer,
            software: greeted.software.clone(),
            test: greeted.test.clone(),
        });
        let welcome = greeted.welcome.clone();
        let hello = message.to_vec();
        self.welcomed = Some(Welcomed { hello, greeted });
        Ok(welcome)
    }

    /// A frame after the welcome.
    fn arming(&mut self, frame: &[u8], peer: SocketAddr, shared: &Shared) -> Result<Step, Failure> {
        let Some(Welcomed { greeted, .. }) = &mut self.welcomed else {
            return Ok(Step::More);
        };
        let received = match (greeted.decoder.open(frame), self.medium) {
            (Ok(received), _) => received,
            (Err(error), Medium::Stream) => return Err(malformed(error)),
            (Err(error), Medium::Datagrams) => {
                shared.complain(peer, nonsense(error).text);
                return Ok(Step::More);
            }
            (Err(_), Medium::Simulated) => return Ok(Step::More),
        };
        let Frame::Control(message) = received.frame else {
            return Ok(Step::More);
        };
        match greeted.arming(message) {
            Ok(Some(arm)) if shared.reserve(peer) => {
                self.arm = Some(arm);
                Ok(Step::Complete)
            }
            Ok(Some(_)) => Err(refused(busy(), Some(&mut greeted.encoder))),
            Ok(None) => Err(Failure::Left),
            Err(refuse) => Err(refused(refuse, Some(&mut greeted.encoder))),
        }
    }
}

fn refused(refuse: Refuse, encoder: Option<&mut Encoder>) -> Failure {
    let text = refuse.text.clone();
    let frame = refusal(refuse, encoder);
    Failure::Refused { text, frame }
}

fn malformed(error: WireError) -> Failure {
    let refuse = nonsense(error);
    let text = match error {
        // The refusal shows a TLS client that this is no TLS server.
        WireError::Magic { found, .. } if is_client_hello(&found) => {
            "it speaks TLS, and plain TCP is served here (--transport tls)".to_owned()
        }
        _ => refuse.text.clone(),
    };
    let frame = refusal(refuse, None);
    Failure::Malformed { text, frame }
}

/// A client that has been welcomed and has not armed yet.
pub(super) struct Greeted {
    pub test: String,
    pub software: String,
    session: u64,
    axes: usize,
    /// Version of the handshake that both speak.
    pub version: u16,
    pub rate: (u64, u64),
    pub watchdog_s: f64,
    pub sampling: Sampling,
    /// The limits that the client announced, per axis.
    pub limits: Vec<Limits>,
    /// Position of the specimen, as in the welcome; empty if it is not known.
    standing: Vec<f64>,
    pub watchdog_ns: u64,
    pub period_ns: u64,
    /// From the arrival of a command to the sampling.
    pub sample_after_ns: Option<u64>,
    /// The welcome, as a frame of session 0.
    pub welcome: Vec<u8>,
    pub encoder: Encoder,
    pub decoder: Decoder,
}

fn refuse(code: RefuseCode, text: &str) -> Refuse {
    Refuse {
        code,
        versions: Versions::OURS,
        text: short(text),
    }
}

/// A goodbye that fits into a message.
pub(super) fn bye(cause: Cause, text: &str) -> Bye {
    Bye {
        cause: cause.code(),
        text: short(text),
    }
}

/// A text that fits into a message, and may be empty.
fn short(text: &str) -> String {
    let mut text = text.to_owned();
    text.retain(|c| !is_hidden(c));
    while text.len() > TEXT_LIMIT {
        text.pop();
    }
    text
}

/// The refusal of bytes that are no frame.
fn nonsense(error: WireError) -> Refuse {
    let code = match error {
        WireError::Version { .. } => RefuseCode::Version,
        WireError::Mac | WireError::Keyed { .. } | WireError::Proof { .. } => RefuseCode::Key,
        _ => RefuseCode::Malformed,
    };
    refuse(code, &error.to_string())
}

fn busy() -> Refuse {
    refuse(
        RefuseCode::Busy,
        "another controller is connected; the specimen is commanded by one at a time",
    )
}

/// The refusal of a specimen that is not ready.
fn not_ready(text: &str) -> Refuse {
    refuse(RefuseCode::NotReady, text)
}

/// A refusal as a frame; of session 0 without an encoder.
fn refusal(refuse: Refuse, encoder: Option<&mut Encoder>) -> Vec<u8> {
    let mut greeting = Encoder::greeting(Side::Specimen);
    framed(&Control::Refuse(refuse), encoder.unwrap_or(&mut greeting)).unwrap_or_default()
}

fn framed(message: &Control, encoder: &mut Encoder) -> Result<Vec<u8>, WireError> {
    framed_bytes(&handshake::encode(message)?, encoder)
}

fn framed_bytes(message: &[u8], encoder: &mut Encoder) -> Result<Vec<u8>, WireError> {
    let mut out = vec![0; LARGEST_FRAME];
    let length = encoder.control(message, &mut out)?;
    out.truncate(length);
    Ok(out)
}

/// Judges the first message of a client.
fn judge(offer: &Offer, is_taken: bool, message: &[u8]) -> Result<Greeted, Refuse> {
    let hello = match handshake::decode(message).map_err(nonsense)? {
        Control::Hello(hello) => hello,
        other => {
            let text = format!("{} came where a hello was due", other.name());
            return Err(refuse(RefuseCode::Malformed, &text));
        }
    };
    if is_taken {
        return Err(busy());
    }
    if let Some(text) = offer.host.latch().refusal() {
        return Err(not_ready(&text));
    }
    if let (Some(key), true) = (&offer.key, hello.keyed) {
        handshake::verify_hello(message, key).map_err(nonsense)?;
    }
    let terms = Terms {
        versions: Versions::OURS,
        axes: offer.host.axes.clone(),
        rate_max_hz: RATE_MAX_HZ,
        watchdog_max_s: WATCHDOG_MAX_S,
        timed_sampling: true,
        keyed: offer.key.is_some(),
    };
    let version = handshake::agree(&hello, &terms)?;
    welcome(offer, message, &hello, version).map_err(|text| refuse(RefuseCode::NotReady, &text))
}

fn welcome(offer: &Offer, message: &[u8], hello: &Hello, version: u16) -> Result<Greeted, String> {
    let host = &offer.host;
    let standing = host.standing();
    let nonce = random::<NONCE_LEN>().map_err(|e| e.to_string())?;
    let session = u64::from_le_bytes(random().map_err(|e| e.to_string())?).max(1);
    let welcome = Welcome {
        proof: [0; PROOF_LEN],
        nonce,
        layout: layout_hash(&host.axes),
        session,
        version,
        keyed: offer.key.is_some(),
        capabilities: host.capabilities(),
        watchdog_s: hello.watchdog_s,
        sampling: hello.sampling,
        stiffness: host.stiffness.clone(),
        standing: standing.clone(),
        software: SOFTWARE.to_owned(),
        name: fit(&host.name),
        axes: host.axes.clone(),
    };
    let wrong = |error: WireError| error.to_string();
    let mut bytes = handshake::encode(&Control::Welcome(welcome)).map_err(wrong)?;
    let key = offer
        .key
        .as_ref()
        .map(|key| key.session(&hello.nonce, &nonce, session));
    if let Some(key) = &key {
        handshake::prove_welcome(message, &mut bytes, key).map_err(wrong)?;
    }
    let frame = framed_bytes(&bytes, &mut Encoder::greeting(Side::Specimen)).map_err(wrong)?;
    let axes = host.axes.len();
    let period_s = hello.rate_denominator as f64 / hello.rate_numerator as f64;
    Ok(Greeted {
        test: hello.name.clone(),
        software: hello.software.clone(),
        session,
        axes,
        version,
        rate: (hello.rate_numerator, hello.rate_denominator),
        watchdog_s: hello.watchdog_s,
        sampling: hello.sampling,
        limits: hello.axes.iter().map(|axis| axis.limits).collect(),
        standing,
        watchdog_ns: (hello.watchdog_s * 1e9) as u64,
        period_ns: (period_s * 1e9) as u64,
        sample_after_ns: match hello.sampling {
            Sampling::Reply => None,
            Sampling::Fraction(part) => Some((part * period_s * 1e9) as u64),
        },
        welcome: frame,
        encoder: Encoder::new(Side::Specimen, axes, session, key.clone()).map_err(wrong)?,
        decoder: Decoder::new(Side::Controller, axes, session, key).map_err(wrong)?,
    })
}

/// Judges the request to arm a specimen whose position is `standing`; empty if it is not known.
pub(super) fn fits(arm: &Arm, session: u64, standing: &[f64]) -> Result<(), Refuse> {
    if arm.session != session || !(standing.is_empty() || standing.len() == arm.disp.len()) {
        return Err(strange_arm());
    }
    match elsewhere(standing, &arm.disp) {
        Some(text) => Err(refuse(RefuseCode::Position, &text)),
        None => Ok(()),
    }
}

fn strange_arm() -> Refuse {
    refuse(
        RefuseCode::Malformed,
        "an arm message of another session, or for another number of axes",
    )
}

impl Greeted {
    /// Judges a message after the welcome: an Arm, or `None` for a Bye.
    pub(super) fn arming(&self, message: &[u8]) -> Result<Option<Arm>, Refuse> {
        match handshake::decode(message).map_err(nonsense)? {
            Control::Arm(arm) => {
                fits(&arm, self.session, &self.standing)?;
                if arm.disp.len() == self.axes {
                    Ok(Some(arm))
                } else {
                    Err(strange_arm())
                }
            }
            Control::Bye(_) => Ok(None),
            other => {
                let text = format!("{} came where arming was due", other.name());
                Err(refuse(RefuseCode::Malformed, &text))
            }
        }
    }

    /// The answer to an Arm that is not granted, as a frame of this session. A specimen that was lost meanwhile is no refusal: only its
    /// own server knows its position.
    pub(super) fn not_armed(&mut self, text: &str, is_lost: bool) -> Vec<u8> {
        let answer = if is_lost && Cause::Lost.for_version(self.version) == Cause::Lost {
            Control::Bye(bye(Cause::Lost, text))
        } else {
            Control::Refuse(not_ready(text))
        };
        framed(&answer, &mut self.encoder).unwrap_or_default()
    }

    /// The answer to an Arm: the same again, as a frame of this session.
    pub(super) fn armed(&mut self, arm: Arm) -> Vec<u8> {
        framed(&Control::Arm(arm), &mut self.encoder).unwrap_or_default()
    }
}
