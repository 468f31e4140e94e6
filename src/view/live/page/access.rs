//! Permission to view and to operate: tokens, and the host names that the server accepts.
//!
//! Any other page that a browser has open can make it send requests here. Three checks keep such a page out. It can read
//! nothing: no CORS header is ever sent. It cannot name this server: the `Host` must be an address, `localhost` or this
//! machine, so an attacker's name that resolves to us gets no answer. It cannot operate: the control token is required in
//! a header that no form can send, and `Origin` and `Sec-Fetch-Site` must be ours.

use std::fs::File;
use std::io::{self, Read};
use std::net::IpAddr;
use std::path::Path;

use axum::http::{HeaderMap, StatusCode, header};
use thiserror::Error;

use gusset_record::rt::secret_file::{SecretError, open_secret};

/// Letters of a token, none of which looks like another.
const LETTERS: &[u8; 32] = b"abcdefghjkmnpqrstuvwxyz123456789";
/// Letters of a token that is made here: 100 bits.
const LENGTH: usize = 20;
/// Fewest characters of a token from a file.
const SHORTEST: usize = 16;
/// Most characters of such a token.
const LONGEST: usize = 256;

/// A secret that is compared in constant time. It is shown once, where the test was started.
#[derive(Clone)]
pub struct Token {
    text: String,
    digest: blake3::Hash,
}

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Token")
    }
}

/// Why a file holds no token.
#[derive(Debug, Error)]
pub enum TokenError {
    /// It cannot be read.
    #[error("the token file {path} cannot be read: {source}")]
    Unreadable {
        /// Which.
        path: String,
        /// The system's word.
        source: io::Error,
    },
    /// Other users know the token.
    #[error("the token file {path} cannot be used: {source}")]
    Open {
        /// Which.
        path: String,
        /// Why.
        source: SecretError,
    },
    /// It holds something else.
    #[error(
        "the token file {path} holds no token: wanted {SHORTEST} to {LONGEST} letters, digits or any of -._~+/= on one \
         line, found {found}"
    )]
    Unusable {
        /// Which.
        path: String,
        /// The text.
        found: String,
    },
}

/// How tokens that are typed are meant: without regard to case and dashes.
fn plain(text: &str) -> String {
    let letters = text.trim().chars().filter(|c| *c != '-');
    letters.flat_map(char::to_lowercase).collect()
}

impl Token {
    /// A fresh one.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub(crate) fn random() -> io::Result<Self> {
        let mut bytes = [0; LENGTH];
        File::open("/dev/urandom")?.read_exact(&mut bytes)?;
        let mut text = String::new();
        for (place, byte) in bytes.iter().enumerate() {
            if place > 0 && place % 4 == 0 {
                text.push('-');
            }
            // 32 letters: every one is as likely as any other.
            text.extend(LETTERS.get(usize::from(byte % 32)).map(|c| char::from(*c)));
        }
        Ok(Self::of(text))
    }

    /// The one in a file: its only line.
    ///
    /// # Errors
    /// See [`TokenError`].
    pub fn read(path: &Path) -> Result<Self, TokenError> {
        let name = || path.display().to_string();
        let mut text = String::new();
        let unreadable = |source| TokenError::Unreadable {
            path: name(),
            source,
        };
        let file = open_secret(path).map_err(|error| match error {
            SecretError::Io(source) => unreadable(source),
            source => TokenError::Open {
                path: name(),
                source,
            },
        })?;
        let read = file.take(4096).read_to_string(&mut text);
        read.map_err(unreadable)?;
        let text = text.trim();
        let allowed = |c: char| c.is_ascii_alphanumeric() || "-._~+/=".contains(c);
        let found = if let Some(strange) = text.chars().find(|c| !allowed(*c)) {
            format!("{strange:?}")
        } else if !(SHORTEST..=LONGEST).contains(&plain(text).len()) {
            format!("{}", text.len())
        } else {
            return Ok(Self::of(text.to_owned()));
        };
        Err(TokenError::Unusable {
            path: name(),
            found,
        })
    }

    fn of(text: String) -> Self {
        Self {
            digest: blake3::hash(plain(&text).as_bytes()),
            text,
        }
    }

    /// The token as a user sees it.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Whether `found` is it. The digests are compared in constant time.
    #[must_use]
    pub(crate) fn is(&self, found: &str) -> bool {
        blake3::hash(plain(found).as_bytes()) == self.digest
    }
}

/// Reason for a refused request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Refusal(pub StatusCode, pub &'static str);

/// Checks of host name, origin and tokens.
#[derive(Debug)]
pub(super) struct AccessRules {
    loopback: bool,
    names: Vec<String>,
    control: Token,
    view: Option<Token>,
}

const STRANGE_HOST: Refusal = Refusal(
    StatusCode::MISDIRECTED_REQUEST,
    "this server does not answer under that name: use its address, localhost, or the machine's own name",
);
const OTHER_SITE: Refusal = Refusal(
    StatusCode::FORBIDDEN,
    "requests of another site are refused",
);
const NO_VIEW: Refusal = Refusal(
    StatusCode::UNAUTHORIZED,
    "the viewing token is missing or wrong",
);
const NO_CONTROL: Refusal = Refusal(
    StatusCode::UNAUTHORIZED,
    "the control token is missing or wrong",
);

impl AccessRules {
    pub(crate) fn new(
        bound: IpAddr,
        name: Option<String>,
        control: Token,
        view: Option<Token>,
    ) -> Self {
        let own = rustix::system::uname();
        let own = own.nodename().to_string_lossy().into_owned();
        let names = ["localhost".to_owned(), own].into_iter().chain(name);
        Self {
            loopback: super::is_loopback(bound),
            names: names.filter(|name| !name.is_empty()).collect(),
            control,
            view,
        }
    }

    /// Whether the name by which it was called is one of ours.
    pub(crate) fn host(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let host = text(headers, header::HOST).ok_or(STRANGE_HOST)?;
        let name = without_port(host).ok_or(STRANGE_HOST)?;
        let ours = match name.parse::<IpAddr>() {
            // A name server cannot redirect addresses.
            Ok(ip) => !self.loopback || super::is_loopback(ip),
            Err(_) => {
                let name = name.strip_suffix('.').unwrap_or(name);
                self.names.iter().any(|own| own.eq_ignore_ascii_case(name))
            }
        };
        if ours { Ok(()) } else { Err(STRANGE_HOST) }
    }

    /// Whether the request comes from this page, or from no page at all.
    pub(crate) fn origin(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let site = headers.get("sec-fetch-site");
        let near = site.is_none_or(|site| site == "same-origin" || site == "none");
        let host = text(headers, header::HOST).unwrap_or_default();
        let same = match headers.get(header::ORIGIN) {
            None => true,
            Some(origin) => {
                let origin = origin.to_str().unwrap_or_default();
                let rest = origin
                    .strip_prefix("http://")
                    .or_else(|| origin.strip_prefix("https://"));
                rest.is_some_and(|rest| rest.eq_ignore_ascii_case(host))
            }
        };
        if near && same {
            Ok(())
        } else {
            Err(OTHER_SITE)
        }
    }

    /// Whether the request may view the test.
    pub(crate) fn view(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        self.origin(headers)?;
        let Some(view) = &self.view else {
            return Ok(());
        };
        // The control token permits viewing too.
        match bearer(headers) {
            Some(found) if view.is(found) || self.control.is(found) => Ok(()),
            _ => Err(NO_VIEW),
        }
    }

    /// Whether the request may operate the test.
    pub(crate) fn control(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        self.origin(headers)?;
        match bearer(headers) {
            Some(found) if self.control.is(found) => Ok(()),
            _ => Err(NO_CONTROL),
        }
    }
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    let mut values = headers.get_all(name).iter();
    let only = values.next()?;
    // Two of them mean different things to different readers.
    if values.next().is_some() {
        return None;
    }
    only.to_str().ok()
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    let value = text(headers, header::AUTHORIZATION)?;
    let (scheme, token) = value.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then_some(token)
}

fn without_port(host: &str) -> Option<&str> {
    if let Some(rest) = host.strip_prefix('[') {
        let (name, after) = rest.split_once(']')?;
        let port = after.strip_prefix(':');
        return (after.is_empty() || port.is_some_and(is_port)).then_some(name);
    }
    match host.rsplit_once(':') {
        Some((name, port)) => (is_port(port) && !name.contains(':')).then_some(name),
        None => Some(host),
    }
}

fn is_port(text: &str) -> bool {
    text.parse::<u16>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules(bound: &str, view: bool) -> (AccessRules, Token, Token) {
        let (control, looking) = (Token::random().unwrap(), Token::random().unwrap());
        let view = view.then(|| looking.clone());
        let name = Some("lab-pc".to_owned());
        let rules = AccessRules::new(bound.parse().unwrap(), name, control.clone(), view);
        (rules, control, looking)
    }

    fn headers(all: &[(&'static str, &str)]) -> HeaderMap {
        let mut map = HeaderMap::new();
        for (name, value) in all {
            map.append(*name, value.parse().unwrap());
        }
        map
    }

    #[test]
    fn only_own_names_are_answered() {
        let (near, ..) = rules("127.0.0.1", false);
        let (far, ..) = rules("0.0.0.0", true);
        for (host, at_loopback, beyond) in [
            ("127.0.0.1:4824", true, true),
            ("localhost:9000", true, true),
            ("LOCALHOST.", true, true),
            ("[::1]:4824", true, true),
            ("lab-pc:1", true, true),
            ("192.168.1.7:4824", false, true),
            ("evil.example:4824", false, false),
            ("localhost.evil.example", false, false),
            ("127.0.0.1.evil.example", false, false),
            ("[::1", false, false),
            ("[::1]x", false, false),
            ("localhost:port", false, false),
            ("", false, false),
        ] {
            let asked = headers(&[("host", host)]);
            assert_eq!(near.host(&asked).is_ok(), at_loopback, "{host}");
            assert_eq!(far.host(&asked).is_ok(), beyond, "{host}");
        }
        assert!(near.host(&headers(&[])).is_err(), "no name at all");
        let two = headers(&[("host", "localhost"), ("host", "evil.example")]);
        assert!(near.host(&two).is_err());
    }

    #[test]
    fn another_site_cannot_look_or_operate() {
        let (rules, control, _) = rules("127.0.0.1", false);
        let bearer = format!("Bearer {}", control.text());
        let with = |more: &[(&'static str, &str)]| {
            let mut all = vec![
                ("host", "localhost:4824"),
                ("authorization", bearer.as_str()),
            ];
            all.extend(more);
            rules.control(&headers(&all))
        };
        assert_eq!(with(&[]), Ok(()), "a program that is no browser");
        assert_eq!(with(&[("origin", "http://localhost:4824")]), Ok(()));
        assert_eq!(with(&[("sec-fetch-site", "same-origin")]), Ok(()));
        for strange in [
            ("origin", "http://evil.example"),
            ("origin", "null"),
            ("origin", "http://localhost:9999"),
            ("origin", "http://localhost:4824.evil.example"),
            ("sec-fetch-site", "cross-site"),
            ("sec-fetch-site", "same-site"),
        ] {
            assert_eq!(with(&[strange]), Err(OTHER_SITE), "{strange:?}");
        }
    }

    #[test]
    fn tokens_are_required_beyond_loopback() {
        let (near, control, _) = rules("127.0.0.1", false);
        let (far, far_control, view) = rules("10.0.0.5", true);
        let asked = |token: Option<&str>| match token {
            Some(token) => headers(&[
                ("host", "localhost"),
                ("authorization", &format!("bearer {token}")),
            ]),
            None => headers(&[("host", "localhost")]),
        };
        assert_eq!(near.view(&asked(None)), Ok(()));
        assert_eq!(near.control(&asked(None)), Err(NO_CONTROL));
        assert_eq!(near.control(&asked(Some("wrong"))), Err(NO_CONTROL));
        assert_eq!(near.control(&asked(Some(""))), Err(NO_CONTROL));
        assert_eq!(near.control(&asked(Some(control.text()))), Ok(()));
        assert_eq!(far.view(&asked(None)), Err(NO_VIEW));
        assert_eq!(far.view(&asked(Some(view.text()))), Ok(()));
        assert_eq!(far.view(&asked(Some(far_control.text()))), Ok(()));
        assert_eq!(far.control(&asked(Some(view.text()))), Err(NO_CONTROL));
        assert_eq!(far.control(&asked(Some(control.text()))), Err(NO_CONTROL));
    }

    #[test]
    fn token_may_lack_dashes_and_have_capitals() {
        let token = Token::random().unwrap();
        let text = token.text();
        assert_eq!(text.len(), LENGTH + 4);
        assert!(token.is(text) && token.is(&text.replace('-', "").to_uppercase()));
        assert!(token.is(&format!(" {text} ")));
        assert!(!token.is(&text[..text.len() - 1]));
        assert_ne!(text, Token::random().unwrap().text());
        assert!(!format!("{token:?}").contains(text));
    }

    #[test]
    fn token_file_is_one_line_of_16_letters() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            let owner = std::os::unix::fs::PermissionsExt::from_mode(0o600);
            std::fs::set_permissions(&path, owner).unwrap();
            Token::read(&path).map_err(|error| error.to_string())
        };
        assert!(
            read("a-long-enough-secret-1\n")
                .unwrap()
                .is("a-long-enough-secret-1")
        );
        assert!(read("short\n").unwrap_err().contains("found 5"));
        assert!(
            read("two lines are\nno token at all")
                .unwrap_err()
                .contains("found")
        );
        assert!(read("").unwrap_err().contains("holds no token"));
        let others = std::os::unix::fs::PermissionsExt::from_mode(0o644);
        std::fs::set_permissions(&path, others).unwrap();
        let known = Token::read(&path).unwrap_err();
        assert!(matches!(known, TokenError::Open { .. }), "{known}");
        let missing = Token::read(&folder.path().join("none")).unwrap_err();
        assert!(missing.to_string().contains("cannot be read"));
    }
}
