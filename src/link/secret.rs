//! Secrets: the key file, and random numbers of the operating system.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use thiserror::Error;

use gusset_record::rt::secret_file::{SecretError, open_secret};
use gusset_wire::key::{LONGEST_KEY, PreSharedKey};

/// Why there is no key.
#[derive(Debug, Error)]
pub enum KeyError {
    /// The file cannot be read.
    #[error("the key file {path} cannot be read: {source}")]
    Unreadable {
        /// Which file.
        path: String,
        /// The system's word.
        source: io::Error,
    },
    /// Other users know the key.
    #[error("the key file {path} cannot be used: {source}")]
    Open {
        /// Which file.
        path: String,
        /// Why.
        source: SecretError,
    },
    /// The file holds no usable key.
    #[error("the key file {path} holds no key: {reason}")]
    Unusable {
        /// Which file.
        path: String,
        /// Why.
        reason: String,
    },
}

/// Reads a pre-shared key: all bytes of the file but one line end behind them.
///
/// # Errors
/// See [`KeyError`].
pub fn read_key(path: &Path) -> Result<PreSharedKey, KeyError> {
    let name = || path.display().to_string();
    let unreadable = |source| KeyError::Unreadable {
        path: name(),
        source,
    };
    let mut bytes = Vec::new();
    // Two bytes more than a key may have: the line end, or the proof that it is too long.
    open_secret(path)
        .map_err(|error| match error {
            SecretError::Io(source) => unreadable(source),
            source => KeyError::Open {
                path: name(),
                source,
            },
        })?
        .take(LONGEST_KEY as u64 + 3)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.last() == Some(&b'\n') {
        bytes.pop();
        if bytes.last() == Some(&b'\r') {
            bytes.pop();
        }
    }
    let unusable = |reason| KeyError::Unusable {
        path: name(),
        reason,
    };
    if bytes.len() > LONGEST_KEY {
        return Err(unusable(format!("it has more than {LONGEST_KEY} bytes")));
    }
    let is_blank = |byte: &u8| byte.is_ascii_whitespace() || *byte == 0;
    if !bytes.is_empty() && bytes.iter().all(is_blank) {
        return Err(unusable("nothing but blanks is in it".into()));
    }
    PreSharedKey::new(&bytes).map_err(|error| unusable(error.to_string()))
}

/// Random bytes of the operating system: nonces and session numbers.
///
/// # Errors
/// The system has no random numbers, which does not happen in practice.
pub(super) fn random<const N: usize>() -> io::Result<[u8; N]> {
    let mut bytes = [0; N];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::fs::Permissions;
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn line_end_is_not_part_of_the_key() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            std::fs::set_permissions(&path, Permissions::from_mode(0o600)).unwrap();
            path
        };
        let plain = read_key(&write("a", b"sixteen bytes it is")).unwrap();
        assert_eq!(
            plain,
            read_key(&write("b", b"sixteen bytes it is\n")).unwrap()
        );
        assert_eq!(
            plain,
            read_key(&write("c", b"sixteen bytes it is\r\n")).unwrap()
        );
        assert_ne!(
            plain,
            read_key(&write("d", b"sixteen bytes it is\n\n")).unwrap()
        );
        let short = read_key(&write("e", b"short")).unwrap_err();
        assert!(short.to_string().contains("no key"));
        let long = read_key(&write("f", &[7; 5000])).unwrap_err();
        assert!(long.to_string().ends_with("4096 bytes"));
        for blank in [
            &[b' '; 32],
            &[0; 32],
            b"\t\n\r \t\n\r \t\n\r \t\n\r \t\n\r \t\n\r \t\n\r \t\n\r ",
        ] {
            let blank = read_key(&write("g", blank)).unwrap_err();
            assert!(blank.to_string().contains("blanks"), "{blank}");
        }
        assert!(read_key(&folder.path().join("none")).is_err());
    }

    #[test]
    fn key_that_everyone_can_read_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lab.key");
        std::fs::write(&path, b"sixteen bytes it is").unwrap();
        std::fs::set_permissions(&path, Permissions::from_mode(0o644)).unwrap();
        let refused = read_key(&path).unwrap_err();
        assert!(matches!(refused, KeyError::Open { .. }), "{refused}");
        assert!(refused.to_string().contains("chmod 600"), "{refused}");
    }

    #[test]
    fn nonces_differ() {
        assert_ne!(random::<32>().unwrap(), random::<32>().unwrap());
    }
}
