//! The state of a test in its run folder: `state.bin` holds the newest one, `state-before.bin` the one before it.
//!
//! A file appears whole or not at all: it is written beside its place, synced and moved there. A kill or a power cut
//! leaves the old or the new file. The file carries the SHA-256 of everything else in it, and so does the event
//! `checkpoint` of its step. A state is of use only if both agree and all rows up to it are on record, so a reader tries
//! the newest file first and then the other. All numbers are little-endian:
//!
//! | offset | type | content |
//! |---|---|---|
//! | 0 | 8 bytes | `GUSSETST` |
//! | 8 | u64 | version of this format |
//! | 16 | u64 | layout of the values |
//! | 24 | u64 | step |
//! | 32 | u64 | rows made up to and with that step |
//! | 40 | u64 | number n of values |
//! | 48 | n × u64 | bits of the values |
//! | 48 + 8 n | 32 bytes | SHA-256 of all bytes before it |

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::Arc;

use rustix::fs::{AtFlags, Mode, OFlags};
use sha2::{Digest as _, Sha256};
use thiserror::Error;

use super::checksum::Checksum;
use gusset_quantity::state::{Layout, TestState};

/// The newest state of a run folder, and the one before it.
pub(crate) const STATE_FILES: [&str; 2] = ["state.bin", "state-before.bin"];

/// A state that is not finished has this name.
const PARTIAL: &str = ".state.bin.partial";
const MAGIC: [u8; 8] = *b"GUSSETST";
const VERSION: u64 = 1;
/// Bytes before the values, and after them.
const HEADER: usize = 48;
const TAIL: usize = Checksum::BYTES;
/// Values that are written or read at a time.
const PIECE: usize = 1024;

/// Why a state file is of no use.
#[derive(Debug, Error)]
pub enum CheckpointFault {
    /// The system refuses, or it is no file.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It does not begin as a state file does.
    #[error("it is not a state file")]
    Foreign,
    /// It was written by another version of the program.
    #[error("its format is version {found}, but this program reads version {VERSION}")]
    Version {
        /// Version found.
        found: u64,
    },
    /// It is shorter or longer than it says.
    #[error("it has {found} bytes, but its header says {wanted}")]
    Length {
        /// Bytes found.
        found: u64,
        /// Bytes according to the header.
        wanted: u64,
    },
    /// Its bytes are not those that were written.
    #[error("its SHA-256 does not agree with its content")]
    Damaged,
    /// No event confirms it.
    #[error("no checkpoint event of step {step} has its SHA-256")]
    Unmatched {
        /// Step of the state.
        step: u64,
    },
    /// Rows before it were lost.
    #[error("it follows row {rows}, but only {made} rows are on record")]
    Ahead {
        /// Rows up to the state.
        rows: u64,
        /// Rows on record.
        made: u64,
    },
}

/// State files that are of no use, by name, and why.
pub type StateFaults = Vec<(&'static str, CheckpointFault)>;

/// The state of a test after a step.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// The last step that is part of the state.
    pub step: u64,
    /// Rows that were made up to and with that step, lost ones included.
    pub rows: u64,
    /// The state.
    pub state: TestState,
}

impl Checkpoint {
    fn header(&self) -> [u8; HEADER] {
        let layout = self.state.layout();
        let numbers = [
            VERSION,
            layout.fingerprint,
            self.step,
            self.rows,
            self.state.words().len() as u64,
        ];
        let mut header = [0; HEADER];
        let (magic, rest) = header.split_at_mut(MAGIC.len());
        magic.copy_from_slice(&MAGIC);
        for (place, number) in rest.chunks_exact_mut(8).zip(numbers) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        header
    }

    /// Gives the bytes of the file before the SHA-256 to `take`, piece by piece.
    fn pieces(&self, mut take: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
        take(&self.header())?;
        let mut bytes = [0; 8 * PIECE];
        for words in self.state.words().chunks(PIECE) {
            for (place, word) in bytes.chunks_exact_mut(8).zip(words) {
                place.copy_from_slice(&word.to_le_bytes());
            }
            take(bytes.get(..8 * words.len()).unwrap_or_default())?;
        }
        Ok(())
    }

    /// SHA-256 of the file.
    #[must_use]
    pub(crate) fn checksum(&self) -> Checksum {
        let mut sha = Sha256::new();
        let _hashing_does_not_fail = self.pieces(|bytes| {
            sha.update(bytes);
            Ok(())
        });
        Checksum::from(sha)
    }

    /// Writes the bytes of the file; `checksum` is that of this checkpoint.
    fn write(&self, checksum: Checksum, to: impl Write) -> io::Result<()> {
        let mut to = BufWriter::with_capacity(1 << 16, to);
        self.pieces(|bytes| to.write_all(bytes))?;
        to.write_all(checksum.bytes())?;
        to.flush()
    }

    /// Reads and verifies a state file. `None` if there is no such file.
    ///
    /// # Errors
    /// See [`CheckpointFault`].
    pub fn read(path: &Path) -> Result<Option<(Self, Checksum)>, CheckpointFault> {
        let found = match path.metadata() {
            Ok(found) => found,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        if !found.is_file() {
            return Err(io::Error::other("it is not a file").into());
        }
        Self::from_bytes(BufReader::new(File::open(path)?), found.len()).map(Some)
    }

    fn from_bytes(mut from: impl Read, length: u64) -> Result<(Self, Checksum), CheckpointFault> {
        let mut header = [0; HEADER];
        read_whole(&mut from, &mut header)?;
        let (magic, rest) = header.split_at(MAGIC.len());
        if magic != MAGIC {
            return Err(CheckpointFault::Foreign);
        }
        let mut numbers = [0; 5];
        for (number, bytes) in numbers.iter_mut().zip(rest.as_chunks().0) {
            *number = u64::from_le_bytes(*bytes);
        }
        let [version, fingerprint, step, rows, count] = numbers;
        if version != VERSION {
            return Err(CheckpointFault::Version { found: version });
        }
        let wanted = count
            .saturating_mul(8)
            .saturating_add((HEADER + TAIL) as u64);
        if wanted != length {
            return Err(CheckpointFault::Length {
                found: length,
                wanted,
            });
        }
        // No more than the file has.
        let mut words = Vec::with_capacity(usize::try_from(count).unwrap_or(0));
        let mut word = [0; 8];
        for _ in 0..count {
            read_whole(&mut from, &mut word)?;
            words.push(u64::from_le_bytes(word));
        }
        let mut tail = [0; TAIL];
        read_whole(&mut from, &mut tail)?;
        let layout = Layout {
            words: words.len(),
            fingerprint,
        };
        let state = TestState::from_words(layout, words).map_err(|_| CheckpointFault::Damaged)?;
        let checkpoint = Self { step, rows, state };
        let checksum = checkpoint.checksum();
        if *checksum.bytes() == tail {
            Ok((checkpoint, checksum))
        } else {
            Err(CheckpointFault::Damaged)
        }
    }
}

/// A file that ends too early is no state file: it appears whole or not at all.
fn read_whole(from: &mut impl Read, to: &mut [u8]) -> Result<(), CheckpointFault> {
    from.read_exact(to).map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => CheckpointFault::Foreign,
        _ => error.into(),
    })
}

/// A run folder into which states are written, wherever it is moved meanwhile.
#[derive(Debug, Clone)]
pub struct StateFolder(Arc<OwnedFd>);

impl StateFolder {
    /// The folder at `path`.
    ///
    /// # Errors
    /// The system refuses, or it is no folder.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
        let folder = rustix::fs::open(path, flags, Mode::empty())?;
        Ok(Self(Arc::new(folder)))
    }

    /// Writes `state.bin`; the file that had this name becomes `state-before.bin`.
    ///
    /// # Errors
    /// The system refuses. The earlier files stay unchanged, or the newest of them has become `state-before.bin`.
    pub(crate) fn keep(&self, checkpoint: &Checkpoint, checksum: Checksum) -> io::Result<()> {
        let [newest, before] = STATE_FILES;
        // An interrupted attempt may have left one. A new file never follows a link of this name.
        let _it_may_not_be_there = rustix::fs::unlinkat(&self.0, PARTIAL, AtFlags::empty());
        let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL | OFlags::CLOEXEC;
        let mode = Mode::from_raw_mode(0o666);
        let file = File::from(rustix::fs::openat(&self.0, PARTIAL, flags, mode)?);
        let written = checkpoint
            .write(checksum, &file)
            .and_then(|()| file.sync_all());
        if let Err(error) = written {
            let _nothing_half_is_left = rustix::fs::unlinkat(&self.0, PARTIAL, AtFlags::empty());
            return Err(error);
        }
        let _there_may_be_none = rustix::fs::renameat(&self.0, newest, &self.0, before);
        rustix::fs::renameat(&self.0, PARTIAL, &self.0, newest)?;
        // The names are on the disk only when their folder is.
        rustix::fs::fsync(&self.0)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Layout as RecordLayout;
    use crate::writer::Clocks;
    use crate::{
        Column, Recorder, RingSize, Run, RunFolder, WhenFull, Writer, WriterSettings, ring,
    };

    fn checkpoint(step: u64, values: &[f64]) -> Checkpoint {
        let mut values = values.to_vec();
        let state = TestState::of(|visit| {
            visit.part("example");
            visit.numbers(&mut values);
        });
        Checkpoint {
            step,
            rows: 2 * step + 1,
            state: state.unwrap(),
        }
    }

    fn numbers(count: u32) -> Vec<f64> {
        (0..count).map(|k| libm::sin(f64::from(k))).collect()
    }

    #[test]
    fn newest_two_states_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let states = StateFolder::open(folder.path()).unwrap();
        let read = |name: &str| Checkpoint::read(&folder.path().join(name)).unwrap();
        assert!(STATE_FILES.into_iter().all(|name| read(name).is_none()));
        // Several pieces, and none.
        let all = [3000, 0, 1].map(|count| checkpoint(u64::from(count), &numbers(count)));
        for checkpoint in &all {
            states.keep(checkpoint, checkpoint.checksum()).unwrap();
        }
        let [_, before, newest] = all;
        let sums = [newest.checksum(), before.checksum()];
        assert_eq!(read(STATE_FILES[0]), Some((newest, sums[0])));
        assert_eq!(read(STATE_FILES[1]), Some((before, sums[1])));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn state_follows_its_moved_folder() {
        let root = tempfile::tempdir().unwrap();
        let [old, new] = ["old", "new"].map(|name| root.path().join(name));
        std::fs::create_dir(&old).unwrap();
        let states = StateFolder::open(&old).unwrap();
        std::fs::rename(&old, &new).unwrap();
        std::fs::create_dir(&old).unwrap();
        let one = checkpoint(7, &[1.0]);
        states.keep(&one, one.checksum()).unwrap();
        assert!(new.join(STATE_FILES[0]).is_file());
        assert_eq!(std::fs::read_dir(&old).unwrap().count(), 0);
    }

    /// An interrupted attempt, or somebody's link, occupies the place of the next state.
    #[test]
    fn unfinished_state_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let victim = folder.path().join("victim");
        std::fs::write(&victim, b"precious").unwrap();
        std::os::unix::fs::symlink(&victim, folder.path().join(PARTIAL)).unwrap();
        let states = StateFolder::open(folder.path()).unwrap();
        let one = checkpoint(7, &[1.0]);
        states.keep(&one, one.checksum()).unwrap();
        assert_eq!(std::fs::read(&victim).unwrap(), b"precious");
        assert!(Checkpoint::read(&folder.path().join(STATE_FILES[0])).is_ok());
    }

    #[test]
    fn every_changed_or_lost_byte_is_found() {
        let one = checkpoint(1000, &numbers(5));
        let mut bytes = Vec::new();
        one.write(one.checksum(), &mut bytes).unwrap();
        assert_eq!(bytes.len(), HEADER + 8 * 5 + TAIL);
        let read = |bytes: &[u8]| Checkpoint::from_bytes(bytes, bytes.len() as u64);
        assert_eq!(read(&bytes).unwrap(), (one.clone(), one.checksum()));
        for place in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[place] ^= 1 << (place % 8);
            let fault = read(&changed).unwrap_err();
            let is_the_one = match place {
                0..8 => matches!(fault, CheckpointFault::Foreign),
                8..16 => matches!(fault, CheckpointFault::Version { .. }),
                40..48 => matches!(fault, CheckpointFault::Length { .. }),
                _ => matches!(fault, CheckpointFault::Damaged),
            };
            assert!(is_the_one, "{place}: {fault:?}");
        }
        for length in 0..bytes.len() {
            let fault = read(&bytes[..length]).unwrap_err();
            let is_the_one = match length {
                0..HEADER => matches!(fault, CheckpointFault::Foreign),
                _ => matches!(fault, CheckpointFault::Length { .. }),
            };
            assert!(is_the_one, "{length}: {fault:?}");
        }
        bytes.push(0);
        assert!(matches!(
            read(&bytes),
            Err(CheckpointFault::Length {
                found: 121,
                wanted: 120
            })
        ));
    }

    #[test]
    fn folder_is_refused_as_a_state() {
        let folder = tempfile::tempdir().unwrap();
        let fault = Checkpoint::read(folder.path()).unwrap_err();
        assert!(matches!(fault, CheckpointFault::Io(_)));
    }

    /// A run folder with `rows` rows, these states in their order of time, and an event for each state in `told`.
    fn run_with(folder: &Path, rows: u64, states: &[Checkpoint], told: &[u64]) -> Run {
        let column = Column {
            name: "step".to_owned(),
            unit: "1".to_owned(),
            meaning: String::new(),
            timing: false,
        };
        let record = RecordLayout::new(vec![column]).unwrap();
        let run = RunFolder::create(folder).unwrap();
        let size = RingSize {
            rows: 64,
            events: 1,
        };
        let (mut recorder, reader) = ring(1, size, WhenFull::Drop).unwrap();
        let samples = run.open_samples(&record).unwrap();
        let events = run.open_events().unwrap();
        let clocks = Clocks {
            monotonic_ns: || 0,
            utc_ns: || 0,
        };
        let settings = WriterSettings::default();
        let writer = Writer::spawn(reader, samples, events, None, clocks, settings, None).unwrap();
        assert!((0..rows).all(|row| recorder.row(&[row as f64])));
        writer.finish().unwrap();
        let mut lines = String::new();
        for state in states {
            let (step, checksum) = (state.step, state.checksum());
            run.open_states().unwrap().keep(state, checksum).unwrap();
            let line = serde_json::json!({
                "tick": step, "event": "checkpoint", "digest": "00ab00ab00ab00ab", "sha256": checksum,
            });
            if told.contains(&step) {
                lines += &format!("{line}\n");
            }
        }
        std::fs::write(folder.join("events.jsonl"), lines).unwrap();
        Run::open(folder).unwrap()
    }

    #[test]
    fn resume_uses_the_newest_confirmed_state() {
        let all = [4, 9, 14].map(|step| checkpoint(step, &[step as f64]));
        let kinds = |faults: &StateFaults| -> Vec<&str> {
            let kind = |fault: &CheckpointFault| match fault {
                CheckpointFault::Unmatched { .. } => "unmatched",
                CheckpointFault::Ahead { .. } => "ahead",
                _ => "other",
            };
            faults.iter().map(|(_, fault)| kind(fault)).collect()
        };
        let found = |rows, told: &[u64]| {
            let folder = tempfile::tempdir().unwrap();
            let run = run_with(&folder.path().join("run"), rows, &all, told);
            let (state, faults) = run.usable_state(u64::MAX).unwrap();
            (state.map(|state| state.step), kinds(&faults))
        };
        assert_eq!(found(30, &[4, 9, 14]), (Some(14), vec![]));
        // A row must follow the state.
        assert_eq!(found(29, &[4, 9, 14]), (Some(9), vec![]));
        assert_eq!(found(28, &[4, 9, 14]), (Some(9), vec!["ahead"]));
        assert_eq!(found(29, &[4, 9]), (Some(9), vec!["unmatched"]));
        assert_eq!(found(18, &[4, 9, 14]), (None, vec!["ahead"; 2]));
        assert_eq!(found(29, &[4]), (None, vec!["unmatched"; 2]));
        assert_eq!(found(0, &[]), (None, vec!["unmatched"; 2]));
    }

    #[test]
    fn damaged_state_yields_to_the_older_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        let all = [4, 9].map(|step| checkpoint(step, &[step as f64]));
        let run = run_with(&path, 29, &all, &[4, 9]);
        let [newest, _] = STATE_FILES;
        let mut bytes = std::fs::read(path.join(newest)).unwrap();
        bytes[50] ^= 1;
        std::fs::write(path.join(newest), &bytes).unwrap();
        let (state, faults) = run.usable_state(u64::MAX).unwrap();
        assert_eq!(state.map(|state| state.step), Some(4));
        assert!(matches!(faults[..], [(name, CheckpointFault::Damaged)] if name == newest));
        // An earlier version, or a test without states: nothing is wrong.
        for name in STATE_FILES {
            std::fs::remove_file(path.join(name)).unwrap();
        }
        let (state, faults) = run.usable_state(u64::MAX).unwrap();
        assert!(state.is_none() && faults.is_empty());
    }

    /// A kill leaves what the calls before it have made: half a file beside the others, or no newest file.
    #[test]
    fn kill_at_any_moment_leaves_a_state() {
        let all = [4, 9].map(|step| checkpoint(step, &[step as f64]));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        let run = run_with(&path, 29, &all, &[4, 9]);
        let [newest, before] = STATE_FILES.map(|name| path.join(name));
        let step = || {
            let (state, faults) = run.usable_state(u64::MAX).unwrap();
            assert!(faults.is_empty(), "{faults:?}");
            state.map(|state| state.step)
        };
        let whole = std::fs::read(&newest).unwrap();
        std::fs::write(path.join(PARTIAL), &whole[..whole.len() / 2]).unwrap();
        assert_eq!(step(), Some(9));
        std::fs::rename(&newest, &before).unwrap();
        assert_eq!(step(), Some(9));
        // The next attempt takes no notice of it.
        let next = checkpoint(14, &[14.0]);
        let states = StateFolder::open(&path).unwrap();
        states.keep(&next, next.checksum()).unwrap();
        assert!(!path.join(PARTIAL).exists());
        let [newest, before] = [newest, before].map(|path| Checkpoint::read(&path).unwrap());
        let steps = [newest, before].map(|found| found.map(|(state, _)| state.step));
        assert_eq!(steps, [Some(14), Some(9)]);
    }
}
