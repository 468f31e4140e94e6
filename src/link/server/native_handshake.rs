//! The judgement on a Hello and on an Arm: the same over TCP and UDP.

use super::Desk;
use crate::config::WATCHDOG_MAX_S;
use crate::link::native::{SOFTWARE, fit};
use crate::link::rig::elsewhere;
use crate::link::secret::random;
use crate::text::is_hidden;
use crate::wire::handshake::{
    self, Arm, Control, Hello, Limits, Refuse, RefuseCode, Sampling, TEXT_LIMIT, Terms, Versions,
    Welcome, layout_hash,
};
use crate::wire::key::{NONCE_LEN, PROOF_LEN};
use crate::wire::native::{Decoder, Encoder, LARGEST_FRAME};
use crate::wire::{Side, WireError};

/// Most commands per second that are taken on.
const RATE_MAX_HZ: f64 = 100_000.0;

/// A controller that has been welcomed and has not armed yet.
pub(super) struct Greeted {
    pub test: String,
    pub software: String,
    session: u64,
    axes: usize,
    pub rate: (u64, u64),
    pub watchdog_s: f64,
    pub sampling: Sampling,
    /// What the controller announced, per axis.
    pub limits: Vec<Limits>,
    /// Where the specimen stands, as the welcome says; empty if that is not known.
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
    let mut text = text.to_owned();
    text.retain(|c| !is_hidden(c));
    while text.len() > TEXT_LIMIT {
        text.pop();
    }
    Refuse {
        code,
        versions: Versions::OURS,
        text,
    }
}

/// The refusal of what is not even a frame.
pub(super) fn nonsense(error: WireError) -> Refuse {
    let code = match error {
        WireError::Version { .. } => RefuseCode::Version,
        WireError::Mac | WireError::Keyed { .. } | WireError::Proof { .. } => RefuseCode::Key,
        _ => RefuseCode::Malformed,
    };
    refuse(code, &error.to_string())
}

pub(super) fn busy() -> Refuse {
    refuse(
        RefuseCode::Busy,
        "another controller is connected; the specimen is commanded by one at a time",
    )
}

/// The refusal of a specimen that cannot be had.
pub(super) fn not_ready(text: &str) -> Refuse {
    refuse(RefuseCode::NotReady, text)
}

/// A refusal as a frame; of session 0 without an encoder.
pub(super) fn refusal(refuse: Refuse, encoder: Option<&mut Encoder>) -> Vec<u8> {
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

/// Judges the first message of a controller.
pub(super) fn judge(desk: &Desk, message: &[u8]) -> Result<Greeted, Refuse> {
    let hello = match handshake::decode(message).map_err(nonsense)? {
        Control::Hello(hello) => hello,
        other => {
            let text = format!("{} came where a hello was due", other.name());
            return Err(refuse(RefuseCode::Malformed, &text));
        }
    };
    if desk.is_taken() {
        return Err(busy());
    }
    if let Some(text) = desk.host.latch().refusal() {
        return Err(not_ready(&text));
    }
    if let (Some(key), true) = (&desk.key, hello.keyed) {
        handshake::verify_hello(message, key).map_err(nonsense)?;
    }
    let terms = Terms {
        versions: Versions::OURS,
        axes: desk.host.axes.clone(),
        rate_max_hz: RATE_MAX_HZ,
        watchdog_max_s: WATCHDOG_MAX_S,
        timed_sampling: true,
        keyed: desk.key.is_some(),
    };
    let version = handshake::agree(&hello, &terms)?;
    welcome(desk, message, &hello, version).map_err(|text| refuse(RefuseCode::NotReady, &text))
}

fn welcome(desk: &Desk, message: &[u8], hello: &Hello, version: u16) -> Result<Greeted, String> {
    let host = &desk.host;
    let standing = host.standing();
    let nonce = random::<NONCE_LEN>().map_err(|e| e.to_string())?;
    let session = u64::from_le_bytes(random().map_err(|e| e.to_string())?).max(1);
    let welcome = Welcome {
        proof: [0; PROOF_LEN],
        nonce,
        layout: layout_hash(&host.axes),
        session,
        version,
        keyed: desk.key.is_some(),
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
    let key = desk
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

/// Judges the request to arm a specimen that stands at `standing`, which is empty if that is not known.
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

    /// The answer to an Arm: the same again, as a frame of this session.
    pub(super) fn armed(&mut self, arm: Arm) -> Vec<u8> {
        framed(&Control::Arm(arm), &mut self.encoder).unwrap_or_default()
    }
}
