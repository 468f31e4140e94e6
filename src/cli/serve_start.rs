//! The life of every server on the command line: it starts, reports that it is ready, and runs until a signal.

use std::fmt::Display;
use std::net::SocketAddr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use anyhow::Context;

use super::args::ServeArgs;
use super::exit::{Exit, WithExit};
use super::log::remark;
use super::test_file::refused;
use super::{answer, tell};
use gusset_config::{Finding, KeyPath, Locator};
use gusset_link::server::{ServeError, Server};
use gusset_session::{Signal, Signals, missing, pause};
use gusset_setup::Held;

/// An error in the option `flag`, or else in the key `key` below `[serve]`, shown at its place in the file.
pub(super) fn misasked(
    locator: &Locator,
    flag: Option<&str>,
    key: &[&str],
    error: &dyn Display,
) -> anyhow::Error {
    let serve = KeyPath::root().key("serve");
    let at = key.iter().fold(serve, |at, key| at.key(key));
    match flag {
        Some(flag) => anyhow::anyhow!("{flag}: {error}"),
        None if locator.holds(&at) => {
            refused(locator.refusal(Finding::error(at, error.to_string())))
        }
        None => anyhow::anyhow!("{error}"),
    }
}

/// A server that cannot bind its port, or has no right to.
pub(super) fn unbound(args: &ServeArgs, locator: &Locator, error: &ServeError) -> anyhow::Error {
    let flag = args.listen.as_ref().map(|_| "--listen");
    misasked(locator, flag, &["listen"], error)
}

/// Time between two looks for the signal that releases a specimen.
const LOOK: Duration = Duration::from_millis(20);

/// Runs the server until a signal ends it. Where the gateway itself holds a specimen, a further signal says that it is unloaded.
pub(super) fn run_until_signal(
    server: Server,
    quiet: bool,
    held: Option<&dyn Held>,
) -> anyhow::Result<Exit> {
    let address = server.local_addr();
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let requests = signals.requests();
    let running = server.start().map_err(|error| match error {
        ServeError::NoRealTime(granted) => {
            let missing = missing(&granted).join("; ");
            let text = format!("real-time conditions are required: {missing}");
            WithExit(Exit::NoRealTime, text).into()
        }
        other => anyhow::Error::new(other),
    })?;
    for text in running.granted().map(missing).unwrap_or_default() {
        tell(format_args!("warning: not granted: {text}"));
    }
    say_ready(address)?;
    // The requests stay in the queue: two of them end a wiring check where it is.
    let (stop, at_once) = (|| !requests.is_empty(), || requests.len() > 1);
    running.watch_twice(&stop, &at_once, &mut |event| {
        if !quiet {
            remark(event);
        }
    });
    if let Some(held) = held {
        if held.is_held() {
            tell(
                "no client is served any more, and the bus still holds the specimen: unload it, then press Ctrl-C again (or send \
                 SIGTERM): torque and outputs end",
            );
            let before = requests.len();
            while requests.len() <= before {
                pause(LOOK);
            }
        }
        if !held.release() {
            tell(
                "warning: the devices of the bus did not leave normal operation when they were asked to",
            );
        }
    }
    Ok(match signals.seen() {
        Some(Signal::Terminate) => Exit::Terminated,
        Some(Signal::Interrupt) | None => Exit::Interrupted,
    })
}

/// Says that the port is open.
fn say_ready(address: SocketAddr) -> anyhow::Result<()> {
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
