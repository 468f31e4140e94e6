//! The control socket of a server: through it the operator of a specimen clears its latched trip.
//!
//! Its protocol is that of a running test ([`super::request_socket`]): one line of JSON in, one out. The answer to `{"request": "reset"}`
//! is `{"trip": …, "place": …}`, the cleared entries in words, or `null` where nothing was recorded. `{"request": "show"}`
//! clears nothing.

use std::io::{self, ErrorKind};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::request_socket::{
    Caller, RequestSocket, SOCKET, in_a_line, reach, read_line, write_line,
};

/// Where a server is controlled: a folder and the name of the socket in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ControlPlace {
    folder: PathBuf,
    name: String,
    path: PathBuf,
}

impl ControlPlace {
    /// `path` is a folder, whose socket is `control.sock`, or a socket that may not exist yet.
    #[must_use]
    pub fn at(path: &Path) -> Self {
        match path.file_name().and_then(|name| name.to_str()) {
            Some(name) if !path.is_dir() => {
                let folder = path
                    .parent()
                    .filter(|folder| !folder.as_os_str().is_empty());
                Self {
                    folder: folder.unwrap_or(Path::new(".")).to_owned(),
                    name: name.to_owned(),
                    path: path.to_owned(),
                }
            }
            _ => Self {
                folder: path.to_owned(),
                name: SOCKET.into(),
                path: path.to_owned(),
            },
        }
    }

    /// The argument of `gusset reset`.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where an earlier version kept the trip of a physical specimen.
    #[must_use]
    pub fn old_latch_file(&self) -> PathBuf {
        self.folder.join(format!("{}.latch.json", self.name))
    }
}

/// Why a server cannot be controlled at a place.
#[derive(Debug, Error)]
pub enum ControlError {
    /// Another server is controlled there.
    #[error("{}: another server is controlled there: give each server another --control", .0.display())]
    Taken(PathBuf),
    /// The system gives no socket there.
    #[error("{}: no control socket can be made there: {source} (--control PATH names another place)", path.display())]
    Socket {
        /// Where.
        path: PathBuf,
        /// The system's word.
        source: io::Error,
    },
}

/// The control socket of a server; closed and removed when dropped.
#[derive(Debug)]
pub struct ServerControl {
    _socket: RequestSocket,
}

/// A request to a server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ServerRequest {
    /// Show the record of the specimen.
    Show,
    /// Clear the record of the specimen.
    Reset,
}

/// The record of a specimen, in words.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordWords {
    /// The latched trip.
    pub trip: Option<String>,
    /// The motion without a regular end, and where the specimen is now.
    #[serde(default)]
    pub place: Option<String>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    request: ServerRequest,
}

/// The answer to a request.
#[derive(Debug, Serialize, Deserialize)]
struct ResetAnswer {
    #[serde(flatten)]
    words: RecordWords,
    /// Why it is not cleared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    error: Option<String>,
}

impl ServerControl {
    /// Listens at `place`, and calls `carry_out` for each request: it returns the record in words. The socket of a killed
    /// server is replaced.
    ///
    /// # Errors
    /// [`ControlError`].
    pub fn open(
        place: &ControlPlace,
        mut carry_out: impl FnMut(ServerRequest) -> io::Result<RecordWords> + Send + 'static,
    ) -> Result<Self, ControlError> {
        let path = || place.folder.join(&place.name);
        let wrong = |source| ControlError::Socket {
            path: path(),
            source,
        };
        let is_socket = std::fs::symlink_metadata(path()).is_ok_and(|m| m.file_type().is_socket());
        if is_socket {
            match reach(&place.folder, &place.name) {
                Err(error) if error.kind() == ErrorKind::ConnectionRefused => {
                    std::fs::remove_file(path()).map_err(wrong)?;
                }
                Err(error) if error.kind() == ErrorKind::PermissionDenied => {
                    return Err(wrong(error));
                }
                Ok(_) | Err(_) => return Err(ControlError::Taken(path())),
            }
        }
        let serve = move |caller: &Caller| {
            let Asked { request } = serde_json::from_slice(&caller.line)?;
            in_a_line(&match carry_out(request) {
                Ok(words) => ResetAnswer { words, error: None },
                Err(error) => ResetAnswer {
                    words: RecordWords::default(),
                    error: Some(error.to_string()),
                },
            })
        };
        let request_socket = RequestSocket::listen(&place.folder, &place.name, Box::new(serve));
        Ok(Self {
            _socket: request_socket.map_err(wrong)?,
        })
    }
}

/// Why a trip is not cleared.
#[derive(Debug, Error)]
pub enum ResetError {
    /// No server listens there.
    #[error(
        "{}: no server is controlled there: {source} (name the file of the server if none is running, or start one with --reset)",
        path.display()
    )]
    NoServer {
        /// Where.
        path: PathBuf,
        /// The system's word.
        source: io::Error,
    },
    /// The server does not answer.
    #[error("{}: the server does not answer: {source}", path.display())]
    Silent {
        /// Where.
        path: PathBuf,
        /// The system's word.
        source: io::Error,
    },
    /// The server cannot remove the file.
    #[error("{}: the record of the specimen stays: {text}", path.display())]
    Kept {
        /// Where.
        path: PathBuf,
        /// Why.
        text: String,
    },
}

/// Sends a request to the server that is controlled at `place`; returns the record of its specimen.
///
/// # Errors
/// [`ResetError`].
pub fn ask_server(place: &ControlPlace, request: ServerRequest) -> Result<RecordWords, ResetError> {
    let path = || place.path.clone();
    let silent = |source| ResetError::Silent {
        path: path(),
        source,
    };
    let stream = reach(&place.folder, &place.name);
    let stream = stream.map_err(|source| ResetError::NoServer {
        path: path(),
        source,
    })?;
    write_line(&stream, &Asked { request }).map_err(silent)?;
    let answer: ResetAnswer = read_line(&stream).map_err(silent)?;
    match answer.error {
        Some(text) => Err(ResetError::Kept { path: path(), text }),
        None => Ok(answer.words),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nothing(_: ServerRequest) -> io::Result<RecordWords> {
        Ok(RecordWords::default())
    }

    fn reset(place: &ControlPlace) -> Result<RecordWords, ResetError> {
        ask_server(place, ServerRequest::Reset)
    }

    #[test]
    fn reset_clears_and_reports_the_latch() {
        let folder = tempfile::tempdir().unwrap();
        for path in [folder.path().to_owned(), folder.path().join("rig.sock")] {
            let place = ControlPlace::at(&path);
            assert!(matches!(reset(&place), Err(ResetError::NoServer { .. })));
            let words = RecordWords {
                trip: Some("too much".to_owned()),
                place: Some("left elsewhere".to_owned()),
            };
            let mut latched = vec![Ok(words.clone())];
            latched.insert(0, Err(io::Error::from(ErrorKind::ReadOnlyFilesystem)));
            let shown = words.clone();
            let carry_out = move |request| match request {
                ServerRequest::Show => Ok(shown.clone()),
                ServerRequest::Reset => latched.pop().unwrap_or(Ok(RecordWords::default())),
            };
            let socket = ServerControl::open(&place, carry_out).unwrap();
            let taken = ServerControl::open(&place, nothing);
            assert!(matches!(taken, Err(ControlError::Taken(_))));
            assert_eq!(ask_server(&place, ServerRequest::Show).unwrap(), words);
            assert_eq!(reset(&place).unwrap(), words);
            assert!(matches!(reset(&place), Err(ResetError::Kept { .. })));
            assert_eq!(reset(&place).unwrap(), RecordWords::default());
            drop(socket);
            assert!(matches!(reset(&place), Err(ResetError::NoServer { .. })));
        }
    }

    #[test]
    fn socket_of_a_killed_server_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let place = ControlPlace::at(folder.path());
        let path = folder.path().join(SOCKET);
        drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
        drop(ServerControl::open(&place, nothing).unwrap());
        std::fs::write(&path, "a file").unwrap();
        let refused = ServerControl::open(&place, nothing);
        assert!(matches!(refused, Err(ControlError::Socket { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"a file");
    }
}
