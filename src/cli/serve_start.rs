//! What every server says when it starts: that it is ready, or which option is wrong.

use std::fmt::Display;
use std::net::SocketAddr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::UnixDatagram;

use anyhow::Context;

use super::exit::{Exit, WithExit};
use super::test_file::refused;
use super::{answer, tell};
use crate::config::{Finding, KeyPath, Locator};

/// An error in the option `flag`, or else in the key `key` below `[serve]`, shown at its place in the file.
pub(super) fn misasked(
    locator: &Locator,
    flag: Option<&str>,
    key: &[&str],
    error: &dyn Display,
) -> anyhow::Error {
    let serve = KeyPath::root().key("serve");
    let at = key.iter().fold(serve, |at, key| at.key(key));
    let text = match flag {
        Some(flag) => format!("{flag}: {error}"),
        None if locator.holds(&at) => {
            return refused(locator.refusal(Finding::error(at, error.to_string())));
        }
        None => error.to_string(),
    };
    WithExit(Exit::Usage, text).into()
}

/// Says that the port is open.
pub(super) fn say_ready(address: SocketAddr) -> anyhow::Result<()> {
    // The caller waits for this line, or for the message below.
    answer(format_args!("listening on {address}")).context("stdout")?;
    if let Err(error) = notify_ready() {
        tell(format_args!(
            "warning: the service manager was not told that we are ready: {error}"
        ));
    }
    Ok(())
}

/// The readiness message of systemd (sd_notify(3)); it sends nothing without a service manager.
fn notify_ready() -> std::io::Result<()> {
    let Some(path) = std::env::var_os("NOTIFY_SOCKET") else {
        return Ok(());
    };
    let socket = UnixDatagram::unbound()?;
    match path.as_bytes() {
        [b'@', name @ ..] => {
            let address = std::os::unix::net::SocketAddr::from_abstract_name(name)?;
            socket.connect_addr(&address)?;
        }
        _ => socket.connect(path)?,
    }
    socket.send(b"READY=1").map(|_| ())
}
