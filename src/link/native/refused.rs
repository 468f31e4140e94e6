//! Why a set-up failed, and the remedy.

use thiserror::Error;

use crate::ConnectError;
use crate::tls::TlsFault;
use gusset_quantity::substructure::{LinkFault, Unavailable};
use gusset_wire::WireError;
use gusset_wire::handshake::{RefuseCode, Wider};
use gusset_wire::native::Cause;

/// Why a set-up failed. Nothing was moved.
#[derive(Debug, Error)]
pub(crate) enum SetupError {
    /// There is no connection.
    #[error(transparent)]
    Connect(#[from] ConnectError),
    /// No answer.
    #[error(
        "no answer to our {question} within {seconds} s: is it a specimen that speaks the gusset protocol?"
    )]
    Silent {
        /// The unanswered question.
        question: &'static str,
        /// The time limit.
        seconds: f64,
    },
    /// The connection was lost.
    #[error("{0} before everything was agreed: is it a specimen that speaks the gusset protocol?")]
    Lost(LinkFault),
    /// The link requires TLS, and no certificate is given.
    #[error("TLS wants a certificate, a key and an authority")]
    Bare,
    /// The far end speaks TLS, and we do not.
    #[error(
        "it speaks TLS: set `transport = \"tls\"`, with the certificates of [specimen.link.tls]"
    )]
    SpeaksTls,
    /// The TLS session was lost, or hangs.
    #[error("TLS: {0}")]
    Tls(TlsFault),
    /// The answer is invalid, or belongs to another question.
    #[error("{wrong}{hint}", wrong = .0, hint = hint(*.0))]
    Wire(WireError),
    /// The specimen refuses.
    #[error("refused: {}{}", reason(*code, text), advice(*code))]
    Refused {
        /// The reason, for programs.
        code: RefuseCode,
        /// In the specimen's words.
        text: String,
    },
    /// The specimen leaves instead of answering.
    #[error("it said goodbye where {due} was due: {}", parting(*cause, text))]
    Left {
        /// The answer.
        due: &'static str,
        /// The code of the cause, see [`Cause`].
        cause: u32,
        /// In the specimen's words; empty if it has none.
        text: String,
    },
    /// It keeps narrower limits than the test, and did not report them in its answer to the Hello.
    #[error(
        "axis \"{axis}\": {what} is {promised} {unit} here, beyond {own} {unit} there{}",
        advice(RefuseCode::Limits),
        what = wider.what, promised = wider.promised, own = wider.own, unit = wider.unit
    )]
    Wider {
        /// Name of the axis.
        axis: String,
        /// The limit.
        wider: Wider,
    },
    /// It answers that it is armed, for another place than was asked for.
    #[error("the specimen is armed for another place than it was asked to be")]
    ArmedElsewhere,
    /// The connection is no longer needed.
    #[error("it is not wanted any more")]
    Unwanted,
    /// The system has no random numbers.
    #[error("no random numbers: {0}")]
    Random(#[from] std::io::Error),
}

/// Why a specimen refuses: in its own words, if it has any.
pub(super) fn reason(code: RefuseCode, text: &str) -> &str {
    if text.trim().is_empty() {
        code.why()
    } else {
        text
    }
}

/// Why a specimen leaves, and its own words.
pub(super) fn parting(cause: u32, text: &str) -> String {
    let why = Cause::from_code(cause).map_or("for an unknown reason", Cause::why);
    with_words(why.to_owned(), text)
}

/// A reason, followed by the sender's text, if any.
pub(crate) fn with_words(why: String, text: &str) -> String {
    if text.trim().is_empty() {
        why
    } else {
        format!("{why}: {text}")
    }
}

fn advice(code: RefuseCode) -> &'static str {
    match code {
        RefuseCode::Busy => " (one controller at a time; wait until its test is over)",
        RefuseCode::Key => " (give both ends the same key file)",
        RefuseCode::Axes => " (compare the number and the names of the axes: `axis_names`)",
        RefuseCode::Units => " (compare `unit_disp` and `unit_force`)",
        RefuseCode::Limits => " (narrow [specimen.limits] to what the specimen's end keeps)",
        RefuseCode::Version => " (one of the two programs is too old)",
        _ => "",
    }
}

fn hint(error: WireError) -> &'static str {
    match error {
        WireError::Magic { .. } => {
            " (is it the right port, and does `protocol` name what it speaks?)"
        }
        WireError::Version { .. } => advice(RefuseCode::Version),
        WireError::Mac | WireError::Keyed { .. } | WireError::Proof { .. } => {
            advice(RefuseCode::Key)
        }
        _ => "",
    }
}

impl SetupError {
    /// The kind of the fault.
    #[must_use]
    pub(crate) fn fault(&self) -> LinkFault {
        match self {
            Self::Connect(ConnectError::Timeout { .. }) | Self::Silent { .. } => LinkFault::Timeout,
            Self::Connect(ConnectError::Refused { .. }) => LinkFault::Refused,
            Self::Connect(ConnectError::Tls { fault, .. }) => fault.link(),
            Self::Tls(fault) => fault.link(),
            Self::Lost(fault) => *fault,
            Self::Bare | Self::SpeaksTls | Self::ArmedElsewhere => LinkFault::Malformed,
            Self::Wider { .. } => LinkFault::Refused,
            Self::Connect(_) | Self::Left { .. } | Self::Unwanted | Self::Random(_) => {
                LinkFault::Closed
            }
            Self::Wire(error) => error.fault(),
            Self::Refused { code, .. } => match code {
                RefuseCode::Version => LinkFault::Version,
                RefuseCode::Key => LinkFault::Auth,
                _ => LinkFault::Refused,
            },
        }
    }

    /// Cause and text, if it may say that the specimen is lost. A gateway of version 1 refuses in that case.
    pub(super) fn goodbye(&self) -> Option<(u32, &str)> {
        match self {
            Self::Left { cause, text, .. } => Some((*cause, text)),
            Self::Refused { code, text } if *code == RefuseCode::NotReady => {
                Some((Cause::Tripped.code(), text))
            }
            _ => None,
        }
    }

    pub(super) fn unavailable(self, address: &str) -> Unavailable {
        let text = match &self {
            // These name the address themselves.
            Self::Connect(error) => error.to_string(),
            other => format!("{address}: {other}"),
        };
        Unavailable {
            fault: self.fault(),
            text,
        }
    }
}

impl From<WireError> for SetupError {
    fn from(error: WireError) -> Self {
        Self::Wire(error)
    }
}
