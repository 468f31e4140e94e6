//! `gusset reset`, and where a server is controlled.

use std::io::{self, IsTerminal};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{anyhow, bail};

use super::args::{ResetArgs, ServeArgs};
use super::exit::{Exit, WithExit};
use super::question::{Answered, Question};
use super::test_file::refused;
use super::{answer, tell};
use gusset_config::{Protocol, SpecimenTable, specimens_of};
use gusset_link::served::{Latch, LinkMaker};
use gusset_link::server::Host;
use gusset_record::lasting::{
    Kept, LastingError, LastingRecord, ON_BUS, SpecimenKey, state_folder,
};
use gusset_session::{
    self as session, ControlPlace, RecordWords, ResetError, ServerControl, ServerRequest,
    SpecimenRecords,
};
use gusset_setup::{Prepared, position_reader};

/// Longest connection to read a position: of a server that answers a request, and of `gusset reset` itself.
const SERVER_READS: Duration = Duration::from_millis(1500);
const RESET_READS: Duration = Duration::from_secs(10);

/// Clears the record of the specimen of a server, or of the specimens of a file.
pub fn reset(args: &ResetArgs) -> anyhow::Result<Exit> {
    let place = ControlPlace::at(&args.control);
    let beside = ControlPlace::at(&args.control.with_extension("control.sock"));
    let shown = |place| session::ask_server(place, ServerRequest::Show);
    match shown(&place) {
        Err(ResetError::NoServer { .. }) => {}
        words => return reset_server(args, &place, words),
    }
    let Some(file) = file_at(&args.control) else {
        return reset_server(args, &place, shown(&place));
    };
    match shown(&beside) {
        Err(ResetError::NoServer { .. }) => reset_file(args, &file),
        words => reset_server(args, &beside, words),
    }
}

/// The file with the specimens of `path`: a file, or the configuration in a run folder.
fn file_at(path: &Path) -> Option<PathBuf> {
    let resolved = path.join("resolved.toml");
    [path.to_owned(), resolved]
        .into_iter()
        .find(|file| file.is_file())
}

fn reset_server(
    args: &ResetArgs,
    place: &ControlPlace,
    shown: Result<RecordWords, ResetError>,
) -> anyhow::Result<Exit> {
    let refuse = |error: ResetError| {
        let exit = match error {
            ResetError::NoServer { .. } => Exit::Usage,
            ResetError::Silent { .. } => Exit::Link,
            ResetError::Kept { .. } => Exit::Stopped,
        };
        WithExit(exit, error.to_string())
    };
    if let Some(words) = shown.map_err(refuse)?.place {
        tell(&words);
        confirm(args)?;
    }
    let RecordWords { trip, place } =
        session::ask_server(place, ServerRequest::Reset).map_err(refuse)?;
    match &trip {
        Some(trip) => answer(format_args!("cleared: {trip}"))?,
        None if place.is_none() => answer("no trip is latched")?,
        None => {}
    }
    if let Some(place) = place {
        answer(format_args!("cleared: {place}"))?;
    }
    Ok(Exit::Done)
}

/// Clears the records of the specimens of a file whose server does not run.
fn reset_file(args: &ResetArgs, file: &Path) -> anyhow::Result<Exit> {
    let tables = specimens_of(file).map_err(refused)?;
    let folder = state_folder().map_err(anyhow::Error::msg)?;
    let mut recorded = Vec::new();
    for table in tables {
        let name = &table.name;
        let wrong = |error: &dyn std::fmt::Display| anyhow!("specimen \"{name}\": {error}");
        let key = key_of(&table, file).map_err(|error| wrong(&error))?;
        let record = LastingRecord::hold(&folder, &key).map_err(|error| wrong(&error))?;
        let kept = record.read().map_err(|error| wrong(&error))?;
        if kept.is_empty() {
            continue;
        }
        let reader = position_reader(&table, file).map_err(|finding| wrong(&finding.headline))?;
        let words = kept.words(&reported(reader.as_ref(), RESET_READS));
        for text in words {
            tell(format_args!("specimen \"{name}\": {text}"));
        }
        recorded.push((name.clone(), record));
    }
    if recorded.is_empty() {
        answer("no trip is latched")?;
        return Ok(Exit::Done);
    }
    confirm(args)?;
    for (name, record) in recorded {
        let kept = |error: io::Error| {
            let file = record.file().display();
            WithExit(Exit::Stopped, format!("{file}: the record stays: {error}"))
        };
        record.write(&Kept::default()).map_err(kept)?;
        answer(format_args!("cleared: specimen \"{name}\""))?;
    }
    Ok(Exit::Done)
}

/// Asks the operator whether the specimen is at an allowed position.
fn confirm(args: &ResetArgs) -> anyhow::Result<()> {
    if args.yes {
        return Ok(());
    }
    if !io::stdin().is_terminal() {
        bail!("nothing was cleared: look at the specimen, then confirm its position with --yes");
    }
    let question = Question {
        here: "May the next test begin where the specimen stands? Enter clears the record, Ctrl-C keeps it.",
        elsewhere: "bring this command to the foreground to answer",
    };
    match question.ask(|| true) {
        Answered::Yes => Ok(()),
        Answered::Over | Answered::Nobody => bail!("nothing was cleared"),
    }
}

/// The position that the specimen reports now; empty if it reports none.
fn reported(reader: Option<&LinkMaker>, limit: Duration) -> Vec<f64> {
    let Some(reader) = reader else {
        return Vec::new();
    };
    reader.report(limit).unwrap_or_else(|error| {
        tell(format_args!(
            "warning: its position cannot be read: {error}"
        ));
        Vec::new()
    })
}

/// Protocol family and address of the specimen of `table` if it moves behind a link.
fn link_of(table: &SpecimenTable) -> Option<(&'static str, String)> {
    let link = table.link.as_ref().filter(|link| !link.computed)?;
    let family = match link.protocol {
        Protocol::Gusset => "gusset",
        Protocol::Ethercat => return Some((ON_BUS, link.movers.clone()?)),
        Protocol::OpenFresco | Protocol::OpenFrescoShadow | Protocol::OpenFrescoAdapter => {
            "openfresco"
        }
    };
    Some((family, link.address.clone()))
}

/// The lasting record of a specimen of `file`. A computed specimen belongs to its file.
fn key_of(table: &SpecimenTable, file: &Path) -> Result<SpecimenKey, LastingError> {
    match link_of(table) {
        Some((family, address)) => SpecimenKey::of_link(family, &address),
        None => Ok(SpecimenKey::of_file(file, &table.name)),
    }
}

/// The lasting records of the specimens of a test that `what` moves.
pub fn records(test: &Prepared, what: &'static str) -> Option<SpecimenRecords> {
    let tables = &test.loaded.as_ref()?.file.specimen;
    let links = tables.iter().map(link_of).collect();
    Some(SpecimenRecords { links, what })
}

/// The host with the latch of its specimen, and the socket through which `gusset reset` clears it. `table`: the specimen;
/// `physical`: it moves.
///
/// # Errors
/// A specimen that moves has no lasting record, or another server is controlled there.
pub fn latched(
    host: Host,
    args: &ServeArgs,
    table: Option<&SpecimenTable>,
    (physical, among_others): (bool, bool),
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
    let mut reader = None;
    let latch = match table.filter(|_| physical) {
        Some(table) => {
            let among = among_others.then_some(table.name.as_str());
            refuse_old_latch(&[place.old_latch_file(), old_latch_beside(&args.file, among)])?;
            let key = key_of(table, &args.file).map_err(anyhow::Error::msg)?;
            let folder = state_folder().map_err(anyhow::Error::msg)?;
            let record = LastingRecord::hold(&folder, &key).map_err(anyhow::Error::msg)?;
            let file = record.file().to_owned();
            if !args.quiet {
                tell(format_args!(
                    "note: the record of the specimen is {}",
                    file.display()
                ));
            }
            reader = position_reader(table, &args.file)
                .map_err(|finding| anyhow::Error::msg(finding.headline))?;
            Latch::in_record(record, place.path())
                .map_err(|error| anyhow!("{}: {error}", file.display()))?
        }
        None => Latch::in_memory(place.path()),
    };
    let for_reset = latch.clone();
    let carry_out = move |request: ServerRequest| -> io::Result<RecordWords> {
        let kept = for_reset.kept();
        if request == ServerRequest::Reset {
            for_reset.clear()?;
        }
        // Only a request that clears nothing connects, and only while no test moves the specimen.
        let now = match (&kept.place, request) {
            (Some(_), ServerRequest::Show) if !for_reset.is_moving() => {
                reported(reader.as_ref(), SERVER_READS)
            }
            _ => Vec::new(),
        };
        Ok(RecordWords {
            trip: kept.trip.map(|trip| trip.text),
            place: kept.place.map(|place| match request {
                ServerRequest::Show => place.compared(&now),
                ServerRequest::Reset => place.words(),
            }),
        })
    };
    let socket = match ServerControl::open(&place, carry_out) {
        Ok(socket) => Some(socket),
        // A trip in memory ends with the server in any case.
        Err(error) if !physical && args.control.is_none() => {
            tell(format_args!("warning: {error}"));
            None
        }
        Err(error) => bail!("{error}"),
    };
    if args.reset {
        let cleared = latch.clear();
        let cleared = cleared.map_err(|error| anyhow!("--reset: {error}"))?;
        if cleared.is_empty() {
            tell("note: no trip is latched");
        }
        if let Some(trip) = cleared.trip {
            tell(format_args!("cleared: {}", trip.text));
        }
        if let Some(place) = cleared.place {
            tell(format_args!("cleared: {}", place.words()));
        }
    }
    if let Some(refusal) = latch.refusal() {
        tell(format_args!("warning: {refusal}"));
    }
    Ok((host.latched(latch), socket))
}

/// Refuses a start beside a trip that an earlier version has kept.
fn refuse_old_latch(files: &[PathBuf]) -> anyhow::Result<()> {
    let old = files.iter().find(|file| file.symlink_metadata().is_ok());
    if let Some(file) = old {
        bail!(
            "{}: an earlier version of this program has latched a trip here: look at the specimen, then delete this file",
            file.display()
        );
    }
    Ok(())
}

/// Where an earlier version kept a trip without --control.
fn old_latch_beside(file: &Path, among: Option<&str>) -> PathBuf {
    let specimen = among.map_or_else(String::new, |name| format!(".{name}"));
    let stem = match file.extension() {
        Some(extension) if extension == "toml" => file.file_stem(),
        _ => file.file_name(),
    };
    let mut name = stem.unwrap_or_default().to_owned();
    name.push(format!(".control{specimen}.latch.json"));
    file.with_file_name(name)
}

/// The socket is in the folder of --out, or beside the file, unless --control is given.
fn place_of(args: &ServeArgs) -> PathBuf {
    match (&args.control, &args.out) {
        (Some(path), _) | (None, Some(path)) => path.clone(),
        (None, None) => Path::new(&args.file).with_extension("control.sock"),
    }
}
