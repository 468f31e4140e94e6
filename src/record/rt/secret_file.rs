//! Files that hold a secret: one that other users of the machine can read holds none.

use std::fs::File;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use thiserror::Error;

/// Permissions of users who are neither the owner nor in the group of a file.
const OTHERS: u32 = 0o007;

/// Why a file of a secret is not read.
#[derive(Debug, Error)]
pub enum SecretError {
    /// Error of the operating system.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Other users can read or change it.
    #[error(
        "all users of this machine can read or change it (mode {mode:04o}): run `chmod 600 {path}`"
    )]
    Open {
        /// The file.
        path: String,
        /// Its permissions.
        mode: u32,
    },
}

/// Opens a file that holds a secret.
///
/// # Errors
/// See [`SecretError`].
pub fn open_secret(path: &Path) -> Result<File, SecretError> {
    let file = File::open(path)?;
    // Permissions of the open file: another file may have the name by now.
    let mode = file.metadata()?.permissions().mode() & 0o7777;
    if mode & OTHERS != 0 {
        let path = path.display().to_string();
        return Err(SecretError::Open { path, mode });
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use std::fs::Permissions;

    use super::*;

    #[test]
    fn secret_open_to_all_users_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("key");
        std::fs::write(&path, "secret").unwrap();
        for (mode, is_open) in [
            (0o600, false),
            (0o400, false),
            (0o640, false),
            (0o644, true),
            (0o602, true),
            (0o666, true),
        ] {
            std::fs::set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            match open_secret(&path) {
                Ok(_) => assert!(!is_open, "{mode:o}"),
                Err(SecretError::Open { mode: found, .. }) => {
                    assert_eq!((found, is_open), (mode, true));
                }
                Err(other) => panic!("{other}"),
            }
        }
        let missing = open_secret(&folder.path().join("none"));
        assert!(matches!(missing, Err(SecretError::Io(_))));
    }
}
