//! The lasting record of a physical specimen: one file in one folder of the machine.
//!
//! It keeps a latched trip, and the place where the specimen began a motion that has not ended regularly. Its name comes from the
//! machine behind a server or a test, so that every program of this computer finds the same record. The process that holds it has a
//! lock on the file beside it.

use std::ffi::OsString;
use std::fs::{DirBuilder, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind, Read, Seek, SeekFrom, Write};
use std::net::{IpAddr, ToSocketAddrs, UdpSocket};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::{Access, OFlags, access};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Checksum, atomic};
use gusset_quantity::units::position;

/// Largest record that is read, in bytes.
const LARGEST: u64 = 1 << 20;

/// Positions whose difference is this share of the larger are the same, and those that differ by this much in the unit of the axis.
const SAME: f64 = 1e-9;
const ROUNDING: f64 = 1e-9;

/// A latched trip.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LatchedTrip {
    /// Name of the specimen.
    pub specimen: String,
    /// Key of the limit, or another name of the trip.
    pub what: String,
    /// What happened, with axis, value and bound.
    #[serde(deserialize_with = "gusset_quantity::text::words")]
    pub text: String,
    /// When, UTC.
    pub at: String,
}

/// Where a specimen began a motion that has not ended regularly, and where it was left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// What moves it: a command of ours with its run folder, or a client.
    pub what: String,
    /// Run folders of this motion: a resumed test adds its own.
    #[serde(default)]
    pub runs: Vec<PathBuf>,
    /// When it began, UTC.
    pub at: String,
    /// Unit of displacement of each axis.
    pub units: Vec<String>,
    /// Position of each axis before the motion; empty if it was unknown.
    pub began: Vec<f64>,
    /// The last command of each axis; empty until the motion has ended.
    #[serde(default)]
    pub left: Vec<f64>,
}

impl Place {
    /// A position of the axes, in words.
    fn position(&self, place: &[f64]) -> String {
        let units = self.units.iter().map(String::as_str);
        let axes = place.iter().zip(units.chain(std::iter::repeat("")));
        let words: Vec<_> = axes.map(|(disp, unit)| position(*disp, unit)).collect();
        words.join(", ")
    }

    /// Start and last position of the motion, and its program, in words.
    #[must_use]
    pub fn words(&self) -> String {
        let known = |place: &[f64]| match place {
            [] => "an unknown position".to_owned(),
            place => self.position(place),
        };
        let (began, left) = (known(&self.began), known(&self.left));
        let at = self.at.get(..19).unwrap_or_default();
        let what = &self.what;
        format!(
            "a motion of the specimen has not ended regularly: it began at {began} and was left at {left} ({what}, {at}Z)"
        )
    }

    /// True if this last command is where it began, within rounding.
    #[must_use]
    pub fn is_back(&self, last: &[f64]) -> bool {
        is_same(&self.began, last)
    }

    /// The words of this place, with the position that the specimen reports now.
    #[must_use]
    pub fn compared(&self, now: &[f64]) -> String {
        let now = match now {
            [] => "it does not report its position".to_owned(),
            now => format!("it reports the position {} now", self.position(now)),
        };
        format!("{}; {now}", self.words())
    }
}

/// True if two known positions are the same within rounding.
#[must_use]
pub fn is_same(one: &[f64], other: &[f64]) -> bool {
    let near = |(one, other): (&f64, &f64)| {
        (one - other).abs() <= (SAME * one.abs().max(other.abs())).max(ROUNDING)
    };
    !one.is_empty() && one.len() == other.len() && one.iter().zip(other).all(near)
}

/// The content of a lasting record. An empty one has no file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    /// The latched trip.
    pub trip: Option<LatchedTrip>,
    /// The motion that has not ended regularly.
    pub place: Option<Place>,
}

impl Kept {
    /// True if nothing is recorded.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.trip.is_none() && self.place.is_none()
    }

    /// Each of the two in words, with the position that the specimen reports now.
    #[must_use]
    pub fn words(&self, now: &[f64]) -> Vec<String> {
        let trip = self
            .trip
            .as_ref()
            .map(|trip| format!("trip: {}", trip.text));
        let place = self.place.as_ref().map(|place| place.compared(now));
        trip.into_iter().chain(place).collect()
    }
}

/// What identifies a physical specimen on this machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SpecimenKey(String);

impl SpecimenKey {
    /// The specimen behind a link: protocol family and resolved address. All addresses of this machine are one. On a bus the address
    /// is the interface with the devices that move the axes.
    ///
    /// # Errors
    /// The address cannot be resolved: another name of it may have a record.
    pub fn of_link(family: &str, address: &str) -> Result<Self, LastingError> {
        if family == ON_BUS {
            return Ok(Self(format!("{family} {address}")));
        }
        let unresolved = |source| LastingError::Unresolved {
            address: address.to_owned(),
            source,
        };
        let all = address.to_socket_addrs().map_err(unresolved)?;
        let hosts = all.map(|found| (host(found.ip().to_canonical()), found.port()));
        let hosts: std::collections::BTreeSet<_> = hosts.collect();
        let local = hosts.iter().find(|(host, _)| host == LOCAL);
        let (host, port) = local
            .or_else(|| hosts.first())
            .ok_or_else(|| unresolved(ErrorKind::NotFound.into()))?;
        Ok(Self(format!("{family} {host} {port}")))
    }

    /// The physical specimen that a file describes.
    #[must_use]
    pub fn of_file(file: &Path, specimen: &str) -> Self {
        let file = file.canonicalize().unwrap_or_else(|_| file.to_owned());
        Self(format!("file {} {specimen}", file.display()))
    }

    /// Name of the record without its ending.
    fn stem(&self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        let readable: String = self.0.chars().map(plain).collect();
        let from = readable.len().saturating_sub(60);
        let readable = readable
            .get(from..)
            .unwrap_or_default()
            .trim_start_matches('-');
        let digest = Checksum::of(self.0.as_bytes()).to_string();
        format!("{readable}-{}", digest.get(..8).unwrap_or_default())
    }
}

/// Family of the specimens on a bus.
pub const ON_BUS: &str = "ethercat";
/// One name for all addresses of this machine.
const LOCAL: &str = "localhost";

fn host(ip: IpAddr) -> String {
    // A socket can be bound to an address of this machine only.
    let is_local = ip.is_loopback() || ip.is_unspecified() || UdpSocket::bind((ip, 0)).is_ok();
    if is_local {
        LOCAL.to_owned()
    } else {
        ip.to_string()
    }
}

/// Folder of the lasting records of this machine: `$GUSSET_STATE`, else `/var/lib/gusset` if it exists or this user can make it, else
/// the user's own folder of states.
///
/// # Errors
/// There is no such folder, and it cannot be made; or `/var/lib/gusset` is not open to this user, and others have their records there.
pub fn state_folder() -> Result<PathBuf, LastingError> {
    let given = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    let make = |folder: PathBuf| match make_folder(&folder) {
        Ok(()) => Ok(folder),
        Err(source) => Err(LastingError::Folder { folder, source }),
    };
    if let Some(folder) = given("GUSSET_STATE") {
        return make(absolute(folder));
    }
    let common = Path::new("/var/lib/gusset");
    match make(common.to_owned()) {
        Err(error) if common.exists() => return Err(error),
        Err(_) => {}
        made => return made,
    }
    let own = given("XDG_STATE_HOME").map(PathBuf::from);
    let own = own.or_else(|| given("HOME").map(|home| Path::new(&home).join(".local/state")));
    match own {
        Some(own) => make(own.join("gusset")),
        None => Err(LastingError::NoFolder),
    }
}

fn absolute(folder: OsString) -> PathBuf {
    std::path::absolute(&folder).unwrap_or_else(|_| PathBuf::from(folder))
}

fn make_folder(folder: &Path) -> io::Result<()> {
    let mut builder = DirBuilder::new();
    builder.recursive(true).mode(0o755).create(folder)?;
    Ok(access(
        folder,
        Access::READ_OK | Access::WRITE_OK | Access::EXEC_OK,
    )?)
}

/// Reason why the lasting record is not usable.
#[derive(Debug, Error)]
pub enum LastingError {
    /// No folder for it.
    #[error("no folder for the records of specimens: set GUSSET_STATE to a folder of this machine")]
    NoFolder,
    /// The folder cannot be used.
    #[error("{}: the records of specimens cannot be kept there: {source} (its owner must open it to this user; or GUSSET_STATE names another folder for all users)", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The address of a link cannot be resolved.
    #[error(
        "{address}: the address cannot be resolved, so the record of the specimen cannot be found: {source} (an IP address always can)"
    )]
    Unresolved {
        /// The address.
        address: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Another process holds it.
    #[error("{}: the specimen is held by {}: end that first", file.display(), holder(*pid))]
    Held {
        /// The record.
        file: PathBuf,
        /// Number of the process, if it is known.
        pid: Option<u32>,
    },
    /// The file cannot be used.
    #[error("{}: the record of the specimen cannot be used: {source}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

fn holder(pid: Option<u32>) -> String {
    pid.map_or_else(
        || "another process".to_owned(),
        |pid| match pid == std::process::id() {
            true => "another specimen of this test (all addresses of this machine with one port are one specimen)".to_owned(),
            false => format!("process {pid}"),
        },
    )
}

/// The lasting record of one specimen, which this process alone holds.
#[derive(Debug)]
pub struct LastingRecord {
    file: PathBuf,
    _lock: File,
}

impl LastingRecord {
    /// Holds the record of the specimen `key` in `folder`. The record need not exist.
    ///
    /// # Errors
    /// Another process holds it, the folder cannot be written to, or a file of this name is no plain file.
    pub fn hold(folder: &Path, key: &SpecimenKey) -> Result<Self, LastingError> {
        let stem = key.stem();
        let file = folder.join(format!("{stem}.json"));
        let wrong = |file: &Path| {
            let file = file.to_owned();
            move |source| LastingError::File { file, source }
        };
        let lock_file = folder.join(format!("{stem}.lock"));
        let mut lock = plain(&lock_file, true).map_err(wrong(&lock_file))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut text = String::new();
                let _it_may_be_empty = (&lock).take(20).read_to_string(&mut text);
                let pid = text.trim().parse().ok();
                return Err(LastingError::Held { file, pid });
            }
            Err(TryLockError::Error(source)) => return Err(wrong(&lock_file)(source)),
        }
        let say = |lock: &mut File| {
            lock.set_len(0)?;
            lock.seek(SeekFrom::Start(0))?;
            writeln!(lock, "{}", std::process::id())
        };
        say(&mut lock).map_err(wrong(&lock_file))?;
        let record = Self { file, _lock: lock };
        // What cannot be read or written shows now.
        let usable = record.read().and_then(|_| record.probe());
        usable.map_err(wrong(&record.file))?;
        Ok(record)
    }

    /// The file.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The content of the record. Text that cannot be understood counts as a trip.
    ///
    /// # Errors
    /// It cannot be read, or is no plain file.
    pub fn read(&self) -> io::Result<Kept> {
        let file = match plain(&self.file, false) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Kept::default()),
            opened => opened?,
        };
        let mut bytes = Vec::new();
        file.take(LARGEST).read_to_end(&mut bytes)?;
        Ok(serde_json::from_slice(&bytes).unwrap_or_else(|error| Kept {
            trip: Some(LatchedTrip {
                specimen: String::new(),
                what: "unreadable".to_owned(),
                text: format!("{} cannot be read ({error})", self.file.display()),
                at: String::new(),
            }),
            place: None,
        }))
    }

    /// Writes it, or removes the file of an empty record. It is on the disk when this returns.
    ///
    /// # Errors
    /// It cannot be written: the old record stays.
    pub fn write(&self, kept: &Kept) -> io::Result<()> {
        self.check_plain()?;
        if kept.is_empty() {
            return self.remove();
        }
        let mut text = serde_json::to_vec_pretty(kept)?;
        text.push(b'\n');
        atomic::write(&self.file, &text)
    }

    fn remove(&self) -> io::Result<()> {
        match std::fs::remove_file(&self.file) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            removed => removed?,
        }
        let folder = self.file.parent().unwrap_or(Path::new("."));
        File::open(folder)?.sync_all()
    }

    /// Tries whether a record could be written now.
    ///
    /// # Errors
    /// It could not.
    pub(crate) fn probe(&self) -> io::Result<()> {
        self.check_plain()?;
        // Dropped without a commit it leaves nothing.
        let mut draft = atomic::AtomicFile::create(&self.file)?;
        draft.write_all(b"{}\n")
    }

    fn check_plain(&self) -> io::Result<()> {
        match std::fs::symlink_metadata(&self.file) {
            Ok(found) if found.is_file() => Ok(()),
            Ok(_) => Err(not_plain()),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) => Err(error),
        }
    }
}

fn not_plain() -> io::Error {
    io::Error::other("it is not a plain file: look what put it there, and remove it")
}

/// Opens a plain file, without following a link and without waiting; `make`: for writing, and new if it is not there.
fn plain(path: &Path, make: bool) -> io::Result<File> {
    let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC).bits();
    let flags = i32::try_from(flags).map_err(io::Error::other)?;
    let mut options = OpenOptions::new();
    options.read(true).custom_flags(flags);
    options.write(make).create(make).truncate(false).mode(0o644);
    let file = options.open(path).map_err(|error| {
        // The error of a link.
        if error.raw_os_error() == Some(rustix::io::Errno::LOOP.raw_os_error()) {
            not_plain()
        } else {
            error
        }
    })?;
    if file.metadata()?.is_file() {
        Ok(file)
    } else {
        Err(not_plain())
    }
}
