//! A local socket in a folder, through which programs of the same user speak to a running process.
//!
//! The socket file has its final permissions (0600) from the moment it exists, and it listens only after that. The kernel
//! names the user of each connection; a connection of another user is closed before one byte of it is read. The socket is
//! removed when it is dropped, wherever its folder was moved meanwhile.

use std::fs::{self, File, Metadata, Permissions};
use std::io::{self, ErrorKind};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::Mode;
use rustix::net::sockopt::{Timeout, set_socket_timeout, socket_peercred};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType};
use rustix::process::{Uid, geteuid};

/// Permissions of the socket file: its user may connect.
const MODE: u32 = 0o600;
/// Connections that the kernel keeps until they are accepted.
const BACKLOG: i32 = 128;

/// A listening control socket; closed and removed when it is dropped.
#[derive(Debug)]
pub struct ControlSocket {
    /// The folder, whatever its path is by now.
    folder: File,
    name: String,
    /// Identity of the socket file, to remove no other file.
    made: Metadata,
    socket: OwnedFd,
}

impl ControlSocket {
    /// Makes the socket `name` in `folder` and listens. It never blocks: see [`Self::accept`].
    ///
    /// # Errors
    /// A file of this name exists, or the system refuses.
    pub fn bind(folder: &Path, name: &str) -> io::Result<Self> {
        let folder = File::open(folder)?;
        let address = address(&folder, name);
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let socket = new_socket(flags)?;
        // Linux gives the socket file the mode of the socket, less the umask.
        rustix::fs::fchmod(&socket, Mode::from_raw_mode(MODE))?;
        rustix::net::bind(&socket, &SocketAddrUnix::new(&address)?)?;
        let made = fs::symlink_metadata(&address)?;
        // A umask may have taken permissions of the user too.
        fs::set_permissions(&address, Permissions::from_mode(MODE))?;
        // Until this call, the kernel refuses every connection.
        rustix::net::listen(&socket, BACKLOG)?;
        Ok(Self {
            folder,
            name: name.to_owned(),
            made,
            socket,
        })
    }

    /// The next connection, if one waits. A connection of another user is closed; root may speak to every process.
    ///
    /// # Errors
    /// [`ErrorKind::WouldBlock`] if none waits, [`ErrorKind::PermissionDenied`] if it was another user's, or the system refuses.
    pub fn accept(&self) -> io::Result<UnixStream> {
        let stream = rustix::net::accept_with(&self.socket, SocketFlags::CLOEXEC)?;
        let peer = socket_peercred(&stream)?;
        if is_allowed(peer.uid, geteuid()) {
            Ok(UnixStream::from(stream))
        } else {
            Err(ErrorKind::PermissionDenied.into())
        }
    }
}

/// True if a process of user `peer` may speak to one of user `own`.
fn is_allowed(peer: Uid, own: Uid) -> bool {
    peer == own || peer == Uid::ROOT
}

impl AsFd for ControlSocket {
    /// Readable when a connection waits.
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

impl Drop for ControlSocket {
    fn drop(&mut self) {
        let address = address(&self.folder, &self.name);
        let is_ours = fs::symlink_metadata(&address)
            .is_ok_and(|found| (found.dev(), found.ino()) == (self.made.dev(), self.made.ino()));
        if is_ours {
            let _ = fs::remove_file(&address);
        }
    }
}

/// Connects to the socket `name` in `folder`. Connecting, sending and receiving take at most `patience` each.
///
/// # Errors
/// [`ErrorKind::NotFound`] without such a socket, [`ErrorKind::ConnectionRefused`] if no process listens,
/// [`ErrorKind::PermissionDenied`] if it is another user's, or the system refuses.
pub fn connect(folder: &Path, name: &str, patience: Duration) -> io::Result<UnixStream> {
    let folder = File::open(folder)?;
    let socket = new_socket(SocketFlags::CLOEXEC)?;
    set_socket_timeout(&socket, Timeout::Send, Some(patience))?;
    set_socket_timeout(&socket, Timeout::Recv, Some(patience))?;
    rustix::net::connect(&socket, &SocketAddrUnix::new(address(&folder, name))?)?;
    Ok(UnixStream::from(socket))
}

fn new_socket(flags: SocketFlags) -> io::Result<OwnedFd> {
    let socket = rustix::net::socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)?;
    Ok(socket)
}

/// A path that is short enough for a socket address, however long that of the folder is.
fn address(folder: &File, name: &str) -> PathBuf {
    PathBuf::from(format!("/proc/self/fd/{}/{name}", folder.as_raw_fd()))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;

    #[test]
    fn socket_file_is_closed_to_other_users() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("control.sock");
        let is_over = AtomicBool::new(false);
        // Each look is right by itself: however few there are, none may see a wider mode.
        let widest = std::thread::scope(|scope| {
            let looks = scope.spawn(|| {
                let mut widest = 0;
                while !is_over.load(Ordering::Relaxed) {
                    if let Ok(found) = fs::symlink_metadata(&path) {
                        widest |= found.permissions().mode() & 0o777;
                    }
                }
                widest
            });
            for _ in 0..2000 {
                drop(ControlSocket::bind(folder.path(), "control.sock").unwrap());
            }
            is_over.store(true, Ordering::Relaxed);
            looks.join().unwrap()
        });
        assert_eq!(widest & 0o177, 0, "{widest:o}");
        let _socket = ControlSocket::bind(folder.path(), "control.sock").unwrap();
        let mode = fs::symlink_metadata(&path).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, MODE);
    }

    #[test]
    fn only_the_own_user_and_root_are_allowed() {
        let users = [0, 1000, 1001].map(Uid::from_raw);
        let allowed = |own| users.map(|peer| is_allowed(peer, own));
        assert_eq!(allowed(users[0]), [true, false, false]);
        assert_eq!(allowed(users[1]), [true, true, false]);
        assert_eq!(allowed(users[2]), [true, false, true]);
    }

    #[test]
    fn connection_of_another_user_is_closed() {
        if !geteuid().is_root() {
            // Only root can start a process of another user.
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("control.sock");
        let socket = ControlSocket::bind(folder.path(), "control.sock").unwrap();
        // Even if somebody opened the file to all.
        fs::set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o666)).unwrap();
        let address = SocketAddrUnix::new(&path).unwrap();
        let other = std::thread::spawn(move || {
            let nobody = Uid::from_raw(65534);
            // Only for this thread, which ends after the call.
            rustix::thread::set_thread_res_uid(nobody, nobody, nobody).unwrap();
            let other = new_socket(SocketFlags::CLOEXEC).unwrap();
            rustix::net::connect(&other, &address).unwrap();
            other
        });
        let _other = other.join().unwrap();
        assert_eq!(
            socket.accept().unwrap_err().kind(),
            ErrorKind::PermissionDenied
        );
        let _own = UnixStream::connect(&path).unwrap();
        assert!(socket.accept().is_ok());
        assert_eq!(socket.accept().unwrap_err().kind(), ErrorKind::WouldBlock);
    }

    #[test]
    fn existing_file_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let _first = ControlSocket::bind(folder.path(), "control.sock").unwrap();
        let taken = ControlSocket::bind(folder.path(), "control.sock").unwrap_err();
        assert_eq!(taken.kind(), ErrorKind::AddrInUse);
        assert!(connect(folder.path(), "control.sock", Duration::from_secs(1)).is_ok());
    }
}
