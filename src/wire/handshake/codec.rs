//! Messages to bytes and back, bounded and checked; proofs.

use std::ops::{Range, RangeInclusive};

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use bincode::error::{DecodeError, EncodeError};

use super::{
    Arm, Axis, Bye, Control, Hello, Limits, NAME_LIMIT, Refuse, Sampling, TEXT_LIMIT, Unit,
    Versions, Welcome,
};
use crate::bytes::{array, bounded, finite, put, same_length};
use crate::key::{PROOF_LEN, PreSharedKey, Proof, SessionKey, same};
use crate::native::{CONTROL_LIMIT, Cause, MAX_AXES};
use crate::{ControlFault, Side, WireError};
use gusset_quantity::text::{is_hidden, received};

/// Largest control message in bytes.
pub const LIMIT: usize = CONTROL_LIMIT;

/// The proof follows the variant, so that the signed bytes are one piece.
const PROOF_AT: Range<usize> = 4..4 + PROOF_LEN;

const HELLO_LABEL: &[u8] = b"gusset wire 1 hello";
const WELCOME_LABEL: &[u8] = b"gusset wire 1 welcome";

type Config = Configuration<LittleEndian, Fixint, Limit<LIMIT>>;

fn config() -> Config {
    bincode::config::standard()
        .with_fixed_int_encoding()
        .with_limit::<LIMIT>()
}

/// Encodes a message.
///
/// # Errors
/// A message that the other end would refuse as nonsense: what cannot be decoded is not sent.
pub fn encode(message: &Control) -> Result<Vec<u8>, WireError> {
    check(message)?;
    let bytes = bincode::encode_to_vec(message, config()).map_err(|fault| {
        WireError::Control(match fault {
            EncodeError::UnexpectedEnd => ControlFault::Limit,
            _ => ControlFault::Value,
        })
    })?;
    if bytes.len() > LIMIT {
        return Err(WireError::Control(ControlFault::Limit));
    }
    Ok(bytes)
}

/// Decodes a message and checks every number, text and count in it.
///
/// # Errors
/// [`WireError::Control`] if it does not decode; otherwise what is wrong with its content.
pub fn decode(bytes: &[u8]) -> Result<Control, WireError> {
    if bytes.len() > LIMIT {
        return Err(WireError::Control(ControlFault::Limit));
    }
    let (mut message, used) = bincode::decode_from_slice::<Control, Config>(bytes, config())
        .map_err(|fault| {
            WireError::Control(match fault {
                DecodeError::UnexpectedEnd { .. } => ControlFault::Short,
                DecodeError::LimitExceeded => ControlFault::Limit,
                DecodeError::UnexpectedVariant { found, .. } => ControlFault::Variant(found),
                _ => ControlFault::Value,
            })
        })?;
    if used != bytes.len() {
        return Err(WireError::Control(ControlFault::Trailing(
            bytes.len() - used,
        )));
    }
    check(&message)?;
    if let Control::Refuse(Refuse { text, .. }) | Control::Bye(Bye { text, .. }) = &mut message {
        *text = received(std::mem::take(text));
    }
    Ok(message)
}

/// Writes the controller's proof into an encoded Hello.
///
/// # Errors
/// [`WireError::Truncated`] if the bytes are too short for one.
pub fn prove_hello(hello: &mut [u8], key: &PreSharedKey) -> Result<(), WireError> {
    let proof = hello_proof(hello, key)?;
    put(hello, PROOF_AT.start, proof)
}

/// Checks the controller's proof in an encoded Hello.
///
/// # Errors
/// [`WireError::Proof`].
pub fn verify_hello(hello: &[u8], key: &PreSharedKey) -> Result<(), WireError> {
    if same(&hello_proof(hello, key)?, &array(hello, PROOF_AT.start)?) {
        Ok(())
    } else {
        Err(WireError::Proof {
            found: Side::Controller,
        })
    }
}

/// Writes the specimen's proof into an encoded Welcome: it signs the Hello that it answers, too.
///
/// # Errors
/// [`WireError::Truncated`] if the bytes are too short for one.
pub fn prove_welcome(hello: &[u8], welcome: &mut [u8], key: &SessionKey) -> Result<(), WireError> {
    let proof = welcome_proof(hello, welcome, key)?;
    put(welcome, PROOF_AT.start, proof)
}

/// Checks the server's proof in an encoded Welcome, against the Hello that was sent.
///
/// # Errors
/// [`WireError::Proof`].
pub fn verify_welcome(hello: &[u8], welcome: &[u8], key: &SessionKey) -> Result<(), WireError> {
    if same(
        &welcome_proof(hello, welcome, key)?,
        &array(welcome, PROOF_AT.start)?,
    ) {
        Ok(())
    } else {
        Err(WireError::Proof {
            found: Side::Specimen,
        })
    }
}

fn hello_proof(hello: &[u8], key: &PreSharedKey) -> Result<Proof, WireError> {
    Ok(key.proof(&[HELLO_LABEL, signed(hello)?]))
}

fn welcome_proof(hello: &[u8], welcome: &[u8], key: &SessionKey) -> Result<Proof, WireError> {
    Ok(key.proof(&[WELCOME_LABEL, signed(hello)?, signed(welcome)?]))
}

/// Everything behind the proof.
fn signed(message: &[u8]) -> Result<&[u8], WireError> {
    message.get(PROOF_AT.end..).ok_or(WireError::Truncated {
        needed: PROOF_AT.end,
        found: message.len(),
    })
}

fn check(message: &Control) -> Result<(), WireError> {
    match message {
        Control::Hello(hello) => check_hello(hello),
        Control::Welcome(welcome) => check_welcome_content(welcome),
        Control::Refuse(Refuse { text: said, .. }) => {
            text("text of the refusal", said, 0..=TEXT_LIMIT)
        }
        Control::Arm(Arm { disp, .. }) => {
            count("axes of the arm message", disp.len())?;
            finite("first displacement", disp)
        }
        Control::Bye(Bye { cause, text: said }) => {
            Cause::from_code(*cause)?;
            text("text of the goodbye", said, 0..=TEXT_LIMIT)
        }
    }
}

fn check_hello(hello: &Hello) -> Result<(), WireError> {
    let Versions { lowest, highest } = hello.versions;
    let most = u16::MAX.into();
    bounded("highest version", lowest.into(), most, highest.into())?;
    for (field, term) in [
        ("numerator of the rate", hello.rate_numerator),
        ("denominator of the rate", hello.rate_denominator),
    ] {
        bounded(field, 1, 1_000_000_000_000, term.into())?;
    }
    positive("watchdog time", hello.watchdog_s)?;
    check_sampling(hello.sampling)?;
    text("software", &hello.software, 1..=TEXT_LIMIT)?;
    text("name of the test", &hello.name, 1..=TEXT_LIMIT)?;
    check_axes(&hello.axes)
}

fn check_welcome_content(welcome: &Welcome) -> Result<(), WireError> {
    if welcome.session == 0 {
        return Err(WireError::Bounds {
            field: "session number",
            lowest: 1,
            highest: i64::MAX,
            found: 0,
        });
    }
    positive("watchdog time", welcome.watchdog_s)?;
    check_sampling(welcome.sampling)?;
    text("software", &welcome.software, 1..=TEXT_LIMIT)?;
    text("name of the specimen", &welcome.name, 1..=TEXT_LIMIT)?;
    check_axes(&welcome.axes)?;
    if !welcome.stiffness.is_empty() {
        let n = welcome.axes.len();
        same_length("entries of the stiffness", n * n, welcome.stiffness.len())?;
    }
    finite("stiffness", &welcome.stiffness)?;
    if !welcome.standing.is_empty() {
        let n = welcome.axes.len();
        same_length("axes of where it stands", n, welcome.standing.len())?;
    }
    finite("where it stands", &welcome.standing)
}

fn check_axes(axes: &[Axis]) -> Result<(), WireError> {
    count("axes", axes.len())?;
    for (index, axis) in axes.iter().enumerate() {
        text("name of an axis", &axis.name, 1..=NAME_LIMIT)?;
        if axes.iter().take(index).any(|other| other.name == axis.name) {
            return Err(WireError::Count {
                field: "axes of the same name",
                expected: 1,
                found: 2,
            });
        }
        if !Unit::conjugate(axis.disp_unit, axis.force_unit) {
            return Err(WireError::Code {
                field: "force unit of an axis",
                found: axis.force_unit as u64,
            });
        }
        let Limits {
            disp_min,
            disp_max,
            speed_max,
            force_max,
        } = axis.limits;
        // Written as "is inside", so that NaN fails.
        for (field, found, inside) in [
            (
                "smallest displacement of an axis",
                disp_min,
                !disp_min.is_nan(),
            ),
            (
                "largest displacement of an axis",
                disp_max,
                disp_max > disp_min,
            ),
            ("largest speed of an axis", speed_max, speed_max > 0.0),
            ("largest force of an axis", force_max, force_max > 0.0),
        ] {
            if !inside {
                return Err(WireError::Range {
                    field,
                    index,
                    found,
                });
            }
        }
    }
    Ok(())
}

fn check_sampling(sampling: Sampling) -> Result<(), WireError> {
    match sampling {
        Sampling::Reply => Ok(()),
        Sampling::Fraction(part) if part > 0.0 && part <= 1.0 => Ok(()),
        Sampling::Fraction(found) => Err(WireError::Range {
            field: "fraction of the sampling moment",
            index: 0,
            found,
        }),
    }
}

fn positive(field: &'static str, value: f64) -> Result<(), WireError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(WireError::Range {
            field,
            index: 0,
            found: value,
        })
    }
}

fn count(field: &'static str, found: usize) -> Result<(), WireError> {
    bounded(field, 1, MAX_AXES, found as i128)
}

fn text(field: &'static str, text: &str, lengths: RangeInclusive<usize>) -> Result<(), WireError> {
    if lengths.contains(&text.len()) && !text.chars().any(is_hidden) {
        Ok(())
    } else {
        let limit = *lengths.end();
        Err(WireError::Text { field, limit })
    }
}
