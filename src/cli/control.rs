//! `gusset reset`, and where a server is controlled.

use std::path::{Path, PathBuf};

use super::args::{ResetArgs, ServeArgs};
use super::exit::{Exit, WithExit};
use super::{answer, tell};
use crate::link::rig::Latch;
use crate::link::serve::Host;
use crate::session::{self, ControlPlace, ResetError, ServerControl};

/// Clears the latched trip of a server.
pub fn reset(args: &ResetArgs) -> anyhow::Result<Exit> {
    let cleared = session::reset(&ControlPlace::at(&args.control)).map_err(|error| {
        let exit = match error {
            ResetError::NoServer { .. } => Exit::Usage,
            ResetError::Silent { .. } => Exit::Link,
            ResetError::Kept { .. } => Exit::Stopped,
        };
        WithExit(exit, error.to_string())
    })?;
    match cleared {
        Some(trip) => answer(format_args!("cleared: {trip}"))?,
        None => answer("no trip is latched")?,
    }
    Ok(Exit::Done)
}

/// The host with the latch of its trips, and the socket through which `gusset reset` clears it. `physical`: it moves.
///
/// # Errors
/// A specimen that moves has no place for its latch, or another server is controlled there.
pub fn latched(
    host: Host,
    args: &ServeArgs,
    physical: bool,
) -> anyhow::Result<(Host, Option<ServerControl>)> {
    let is_lasting = physical || host.remembers();
    if !is_lasting && args.control.is_none() {
        if args.reset {
            tell(
                "note: --reset has no effect: the trips of this computed specimen end with their session",
            );
        }
        return Ok((host, None));
    }
    let place = ControlPlace::at(&place_of(args));
    let refuse = |text: String| WithExit(Exit::Usage, text);
    let latch = if physical {
        let file = place.latch_file();
        Latch::in_file(&file, place.path()).map_err(|error| {
            let file = file.display();
            refuse(format!(
                "{file}: a trip of the specimen cannot be kept there: {error} (--control PATH names another place)"
            ))
        })?
    } else {
        Latch::in_memory(place.path())
    };
    let for_reset = latch.clone();
    let clear = move || Ok(for_reset.clear()?.map(|trip| trip.text));
    let socket = match ServerControl::open(&place, clear) {
        Ok(socket) => Some(socket),
        // A trip in memory ends with the server in any case.
        Err(error) if !physical && args.control.is_none() => {
            tell(format_args!("warning: {error}"));
            None
        }
        Err(error) => return Err(refuse(error.to_string()).into()),
    };
    if args.reset {
        let cleared = latch.clear();
        match cleared.map_err(|error| refuse(format!("--reset: {error}")))? {
            Some(trip) => tell(format_args!("cleared: {}", trip.text)),
            None => tell("note: no trip is latched"),
        }
    }
    if let Some(refusal) = latch.refusal() {
        tell(format_args!("warning: {refusal}"));
    }
    Ok((host.latched(latch), socket))
}

/// Beside the file unless it is said otherwise.
fn place_of(args: &ServeArgs) -> PathBuf {
    match (&args.control, &args.out) {
        (Some(path), _) | (None, Some(path)) => path.clone(),
        (None, None) => Path::new(&args.file).with_extension("control.sock"),
    }
}
