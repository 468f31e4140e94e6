//! `gusset reset`, and where a server is controlled.

use std::path::{Path, PathBuf};

use super::args::{ResetArgs, ServeArgs};
use super::exit::{Exit, WithExit};
use super::{answer, tell};
use crate::link::served::Latch;
use crate::link::server::Host;
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
/// `among`: the name of the specimen, if its file has several.
///
/// # Errors
/// A specimen that moves has no place for its latch, or another server is controlled there.
pub fn latched(
    host: Host,
    args: &ServeArgs,
    among: Option<&str>,
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
        let file = match &args.control {
            Some(_) => place.latch_file(),
            None => latch_beside(&args.file, among),
        };
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

/// Where the latch is without --control. It belongs to the specimen, so it depends on the served file alone, and not on
/// where this server records.
fn latch_beside(file: &Path, among: Option<&str>) -> PathBuf {
    let specimen = among.map_or_else(String::new, |name| format!(".{name}"));
    let stem = match file.extension() {
        Some(extension) if extension == "toml" => file.file_stem(),
        _ => file.file_name(),
    };
    let mut name = stem.unwrap_or_default().to_owned();
    name.push(format!(".control{specimen}.latch.json"));
    file.with_file_name(name)
}

/// The socket is in the folder of --out, or beside the file, unless --control says otherwise.
fn place_of(args: &ServeArgs) -> PathBuf {
    match (&args.control, &args.out) {
        (Some(path), _) | (None, Some(path)) => path.clone(),
        (None, None) => Path::new(&args.file).with_extension("control.sock"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_served_specimen_has_a_latch_file_of_its_own() {
        let found = |file: &str, among| latch_beside(Path::new(file), among);
        for (file, among, wanted) in [
            ("lab/rig.toml", None, "lab/rig.control.latch.json"),
            ("lab/rig.1", None, "lab/rig.1.control.latch.json"),
            ("rig.1.toml", None, "rig.1.control.latch.json"),
            ("rig.toml", Some("left"), "rig.control.left.latch.json"),
            ("rig.toml", Some("right"), "rig.control.right.latch.json"),
        ] {
            assert_eq!(found(file, among), Path::new(wanted));
        }
    }
}
