//! Why a TLS session does not come about, or ends.

use rustls::{AlertDescription, CertificateError, Error, InvalidMessage};
use thiserror::Error as Thiserror;

use gusset_quantity::substructure::LinkFault;
use gusset_record::utc;

/// Why a TLS session does not come about, or ends; "it" is the peer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Thiserror)]
pub enum TlsFault {
    /// Seconds since 1970.
    #[error("its certificate expired on {}", date(*.0))]
    Expired(u64),
    /// Seconds since 1970.
    #[error("its certificate is not valid before {}: is the clock of this machine right?", date(*.0))]
    NotYetValid(u64),
    /// Another authority signed it, or it signed itself.
    #[error("its certificate is not signed by an authority that is trusted here (`ca_file`)")]
    UnknownAuthority,
    /// The names in it are others.
    #[error("its certificate is for another name")]
    OtherName,
    /// A client's certificate in a server's hands, or the reverse.
    #[error("its certificate is for another purpose: those of servers and clients differ")]
    Purpose,
    /// It is an authority's own, or older than version 3, or damaged.
    #[error(
        "its certificate cannot be used: version 3 and not an authority's own is wanted (tools/make-certificates makes one)"
    )]
    Unusable,
    /// A signature is wrong: it comes from an authority with the trusted one's name, or from the certificate's own key.
    #[error(
        "the signature of its certificate is wrong: it can be from another authority of this name (if the certificates \
         were replaced on one side only)"
    )]
    Unproven,
    /// It showed none.
    #[error("it showed no certificate, and one is required here")]
    NoCertificate,
    /// It will not have ours.
    #[error("it refuses us: {}", refusal(*.0))]
    RefusedUs(AlertDescription),
    /// Its first bytes are no TLS record.
    #[error("it speaks no TLS")]
    NotTls,
    /// No version or cipher in common.
    #[error("no version of TLS (1.2 and 1.3 here) or no cipher in common")]
    NothingInCommon,
    /// Something that TLS does not allow.
    #[error("it breaks the rules of TLS")]
    Broken,
    /// Gone before the session was agreed.
    #[error(
        "it closed the connection in the middle of the TLS handshake: does it speak TLS, and is it free?"
    )]
    ClosedEarly,
    /// Gone with half a record sent.
    #[error("it closed the connection in the middle of a TLS record")]
    Cut,
    /// Gone between two records.
    #[error("it closed the connection")]
    Closed,
    /// The handshake took too long.
    #[error("it did not finish the TLS handshake within the time limit: does it speak TLS?")]
    SlowHandshake,
    /// A record began and did not end.
    #[error("it stopped in the middle of a TLS record, after {got} of {of} bytes")]
    Stalled {
        /// Bytes that came.
        got: u32,
        /// Bytes of the whole record.
        of: u32,
    },
    /// The socket failed.
    #[error("the connection broke")]
    Lost,
}

impl TlsFault {
    /// The fault as the loop sees it.
    #[must_use]
    pub(crate) const fn link(self) -> LinkFault {
        match self {
            Self::Expired(_)
            | Self::NotYetValid(_)
            | Self::UnknownAuthority
            | Self::OtherName
            | Self::Purpose
            | Self::Unusable
            | Self::Unproven
            | Self::NoCertificate
            | Self::RefusedUs(_) => LinkFault::Auth,
            Self::NotTls | Self::Broken => LinkFault::Malformed,
            Self::NothingInCommon => LinkFault::Version,
            Self::ClosedEarly | Self::Cut | Self::Closed | Self::Lost => LinkFault::Closed,
            Self::SlowHandshake | Self::Stalled { .. } => LinkFault::Timeout,
        }
    }

    /// More than a lost connection: worth a word beside the [`LinkFault`].
    pub(crate) const fn is_telling(self) -> bool {
        !matches!(self, Self::Closed | Self::Lost)
    }

    pub(crate) fn of(error: &Error) -> Self {
        match error {
            Error::InvalidCertificate(certificate) => Self::of_certificate(certificate),
            Error::NoCertificatesPresented => Self::NoCertificate,
            Error::AlertReceived(alert) => Self::of_alert(*alert),
            Error::PeerIncompatible(_)
            | Error::InvalidMessage(InvalidMessage::UnknownProtocolVersion) => {
                Self::NothingInCommon
            }
            _ => Self::Broken,
        }
    }

    fn of_certificate(error: &CertificateError) -> Self {
        match error {
            CertificateError::ExpiredContext { not_after, .. } => {
                Self::Expired(not_after.as_secs())
            }
            CertificateError::NotValidYetContext { not_before, .. } => {
                Self::NotYetValid(not_before.as_secs())
            }
            CertificateError::UnknownIssuer => Self::UnknownAuthority,
            CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => {
                Self::OtherName
            }
            CertificateError::InvalidPurpose | CertificateError::InvalidPurposeContext { .. } => {
                Self::Purpose
            }
            CertificateError::BadSignature => Self::Unproven,
            _ => Self::Unusable,
        }
    }

    const fn of_alert(alert: AlertDescription) -> Self {
        match alert {
            AlertDescription::CloseNotify => Self::Closed,
            AlertDescription::ProtocolVersion | AlertDescription::InsufficientSecurity => {
                Self::NothingInCommon
            }
            other => Self::RefusedUs(other),
        }
    }
}

fn date(seconds: u64) -> String {
    let text = utc::rfc3339(seconds.saturating_mul(1_000_000_000));
    format!("{} UTC", text.get(..19).unwrap_or(&text).replace('T', " "))
}

fn refusal(alert: AlertDescription) -> String {
    match alert {
        AlertDescription::CertificateExpired => {
            "our certificate has expired, or is not valid yet, by its clock".to_owned()
        }
        AlertDescription::UnknownCA => {
            "our certificate is not signed by an authority that it trusts".to_owned()
        }
        AlertDescription::DecryptError => {
            "it found the signature of our certificate wrong: its authority can be another one of this name (if the \
             certificates were replaced on one side only)"
                .to_owned()
        }
        AlertDescription::CertificateRequired | AlertDescription::NoCertificate => {
            "it requires a certificate of ours".to_owned()
        }
        AlertDescription::BadCertificate
        | AlertDescription::UnsupportedCertificate
        | AlertDescription::CertificateUnknown
        | AlertDescription::CertificateRevoked
        | AlertDescription::AccessDenied => {
            format!("it does not accept our certificate (TLS alert {alert:?})")
        }
        other => format!("TLS alert {other:?}"),
    }
}

/// The names that were compared, where names did not fit.
pub(crate) fn names(error: &Error) -> Option<String> {
    let Error::InvalidCertificate(CertificateError::NotValidForNameContext {
        expected,
        presented,
    }) = error
    else {
        return None;
    };
    // They come as `DnsName("rig.lab")` or `IpAddress(127.0.0.1)`.
    let plain = |name: &String| {
        let inner = name.split_once('(').map_or(name.as_str(), |(_, rest)| rest);
        inner.trim_end_matches(')').trim_matches('"').to_owned()
    };
    let names: Vec<String> = presented.iter().map(plain).collect();
    let found = if names.is_empty() {
        "no name at all".to_owned()
    } else {
        names.join(", ")
    };
    Some(format!("{} wanted, {found} found", expected.to_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn certificate_faults_are_failed_proofs() {
        let expired = TlsFault::Expired(951_782_400);
        assert!(expired.to_string().ends_with("2000-02-29 00:00:00 UTC"));
        assert_eq!(expired.link(), LinkFault::Auth);
        assert_eq!(TlsFault::Lost.link(), LinkFault::Closed);
        assert_eq!(TlsFault::SlowHandshake.link(), LinkFault::Timeout);
        let alert = Error::AlertReceived(AlertDescription::CertificateRequired);
        let fault = TlsFault::of(&alert);
        assert_eq!(fault.link(), LinkFault::Auth);
        assert!(fault.to_string().contains("requires"));
        assert_eq!(
            TlsFault::of(&Error::AlertReceived(AlertDescription::CloseNotify)),
            TlsFault::Closed
        );
    }
}
