//! The run folder, written by [`RunFolder`] while the test runs; [`super::run`] reads it afterwards.
//!
//! A folder without `summary.json` is unfinished: the summary is written last, whole or not at all. A folder that
//! holds anything is never written into. `samples.json` is on the disk before the first row.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;
use thiserror::Error;

use super::atomic;
use super::checkpoint::{STATE_FILES, StateFolder};
use super::checksum::Checksum;
use super::layout::{Layout, LayoutError};
use super::origin::Origin;
use super::rt::timing::Timings;
use super::rt::wall::Wall;
use super::summary::{InputFile, Summary};
use super::utc::stamp;
use super::whereabouts::{Hold, Whereabouts, is_claimed};
use crate::Event;

/// The files of a run until it ends.
pub(super) const FILES: [&str; 9] = [
    "events.jsonl",
    "samples.json",
    "samples.bin",
    STATE_FILES[0],
    STATE_FILES[1],
    // Earlier versions wrote it.
    "threads.bin",
    "resolved.toml",
    "test.toml",
    "resumed.json",
];

/// Holds the interrupted run in the folder of the run that resumed it.
pub const BEFORE: &str = "before";

/// Those that come when it has ended.
pub(super) const AFTER: [&str; 3] = ["summary.json", "timing.json", "report.html"];

/// Why a run folder cannot be written or read.
#[derive(Debug, Error)]
pub enum FolderError {
    /// The folder holds something already.
    #[error("{} is not empty: it holds {holds}. Nothing is overwritten: choose a new or an empty folder", .path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// Names of its first files.
        holds: String,
    },
    /// The folder is empty, but a running test has claimed it.
    #[error("a test runs into {}, though it is empty: a run is never written over another", .0.display())]
    Claimed(PathBuf),
    /// The folder of the run was moved or deleted, even if another has its name.
    #[error("{}: the folder of this run is not there any more", .0.display())]
    Lost(PathBuf),
    /// There is nothing of this name.
    #[error("{} does not exist", .0.display())]
    Missing(PathBuf),
    /// Something of this name is not a folder.
    #[error("{} is not a folder", .0.display())]
    NotAFolder(PathBuf),
    /// A pipe or a device has the name of a file of a run: it is not read.
    #[error("{} is not a file", .0.display())]
    NotAFile(PathBuf),
    /// The folder is empty.
    #[error("{} is empty: no run was recorded there", .0.display())]
    Empty(PathBuf),
    /// The folder is something else.
    #[error("{} is not a run folder: it has neither samples.json nor test.toml", .0.display())]
    Foreign(PathBuf),
    /// The run ended before its first row.
    #[error("{} has no samples.json: the run ended before anything was recorded", .0.display())]
    NoSamples(PathBuf),
    /// `samples.json` is damaged or of another version.
    #[error("{}: {source}", .path.display())]
    Layout {
        /// The file.
        path: PathBuf,
        /// The error.
        source: LayoutError,
    },
    /// A JSON file is damaged.
    #[error("{} is damaged: {source}", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The error.
        source: serde_json::Error,
    },
    /// A name that cannot be a file's.
    #[error("{0:?} cannot be a file name: wanted letters, digits, '-', '_' and '.'")]
    Name(String),
    /// A column that the samples do not have.
    #[error("the samples have no column {0:?}")]
    NoColumn(String),
    /// The system refuses.
    #[error("{}: {source}", .path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

pub(super) fn at(path: &Path) -> impl FnOnce(io::Error) -> FolderError {
    let path = path.to_owned();
    |source| FolderError::Io { path, source }
}

/// The default name of a run: `<title-slug>-<YYYYmmdd-HHMMSS>` in UTC.
#[must_use]
pub(crate) fn default_name(title: &str, utc_ns: u64) -> String {
    format!("{}-{}", slug(title), stamp(utc_ns))
}

/// Small letters, digits and single hyphens, at most 48 of them; `run` if nothing is left.
#[must_use]
pub(crate) fn slug(title: &str) -> String {
    let mut slug = String::new();
    for c in title.chars() {
        if c.is_ascii_alphanumeric() {
            slug.push(c.to_ascii_lowercase());
        } else if !slug.is_empty() && !slug.ends_with('-') {
            slug.push('-');
        }
        if slug.len() == 48 {
            break;
        }
    }
    let trimmed = slug.trim_end_matches('-');
    if trimmed.is_empty() {
        "run".to_owned()
    } else {
        trimmed.to_owned()
    }
}

/// Copies the files of a run into another folder. Its rows are linked where the file system has links.
fn link_run(from: &Path, to: &Path) -> Result<(), FolderError> {
    let inputs = to.join("inputs");
    fs::create_dir_all(&inputs).map_err(at(&inputs))?;
    let inputs = fs::read_dir(from.join("inputs")).into_iter().flatten();
    let inputs = inputs
        .flatten()
        .map(|entry| Path::new("inputs").join(entry.file_name()));
    let names = FILES.into_iter().chain(AFTER).map(PathBuf::from);
    for name in names.chain(inputs) {
        let (one, other) = (from.join(&name), to.join(&name));
        if one.is_file() {
            let copy = || fs::copy(&one, &other).map(drop);
            let kept = if name == Path::new("samples.bin") {
                fs::hard_link(&one, &other).or_else(|_| copy())
            } else {
                copy()
            };
            kept.map_err(at(&other))?;
        }
    }
    let before = from.join(BEFORE);
    if before.is_dir() {
        link_run(&before, &to.join(BEFORE))?;
    }
    Ok(())
}

/// Makes the folder, and those above it, for new files. An existing empty folder is used.
///
/// # Errors
/// [`FolderError::Occupied`] if it holds anything, [`FolderError::NotAFolder`] if it is a file, or the system refuses.
pub fn make_free(path: &Path) -> Result<(), FolderError> {
    if path.exists() && !path.is_dir() {
        return Err(FolderError::NotAFolder(path.to_owned()));
    }
    fs::create_dir_all(path).map_err(at(path))?;
    if fs::read_dir(path).map_err(at(path))?.next().is_some() {
        return Err(occupied(path));
    }
    Ok(())
}

/// Names of a folder that a message shows.
const SHOWN: usize = 3;

/// Names what is in a folder that must be empty.
fn occupied(path: &Path) -> FolderError {
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    let more = names.len().saturating_sub(SHOWN);
    names.truncate(SHOWN);
    let mut holds = names.join(", ");
    if more > 0 {
        holds.push_str(&format!(" and {more} more"));
    }
    FolderError::Occupied {
        path: path.to_owned(),
        holds,
    }
}

/// A run folder being written.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// False if it was there before, empty.
    made: bool,
    inputs: Vec<InputFile>,
    hold: Hold,
}

impl RunFolder {
    /// Makes the folder, and those above it. An empty folder is used.
    ///
    /// # Errors
    /// [`FolderError::Occupied`] if it holds anything, [`FolderError::Claimed`] if it held what others deleted,
    /// [`FolderError::NotAFolder`] if it is a file, or the system refuses.
    pub fn create(path: &Path) -> Result<Self, FolderError> {
        let made = !path.exists();
        make_free(path)?;
        if is_claimed(path) {
            return Err(FolderError::Claimed(path.to_owned()));
        }
        // Two runs that start at once may both have found it empty: only one of them can make this file.
        match File::create_new(path.join("events.jsonl")) {
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                return Err(occupied(path));
            }
            Err(error) => return Err(at(&path.join("events.jsonl"))(error)),
        }
        Ok(Self {
            path: path.to_owned(),
            made,
            inputs: Vec::new(),
            hold: Hold::on(path).map_err(at(path))?,
        })
    }

    /// Claims the folder for a running test: [`super::is_claimed`] reports it until the test ends.
    pub fn claim(&self) {
        self.hold.claim();
    }

    /// The test is over.
    pub fn release(&self) {
        self.hold.release();
    }

    /// False if the folder was moved or deleted, even if another has its name. Then nothing is written there.
    #[must_use]
    pub fn is_there(&self) -> bool {
        self.hold.is_at(&self.path)
    }

    /// State of the folder since it was made. Later writes go to the place where it was moved.
    pub fn find_again(&mut self) -> Whereabouts {
        let found = self.hold.find(&self.path);
        if let Whereabouts::Moved(place) = &found {
            self.path.clone_from(place);
        }
        found
    }

    /// Takes the folder of a test that never began away again; only what this made is removed, and what the system
    /// does not let go of stays.
    pub fn abandon(self) {
        if !self.is_there() {
            return;
        }
        let inputs = self.inputs.iter().map(|input| input.path.as_str());
        for name in FILES.into_iter().chain(inputs) {
            let _it_may_not_be_there = fs::remove_file(self.path.join(name));
        }
        let _others_may_be_in_it = fs::remove_dir(self.path.join("inputs"));
        let _there_may_be_none = fs::remove_dir_all(self.path.join(BEFORE));
        if self.made {
            let _others_may_be_in_it = fs::remove_dir(&self.path);
        }
    }

    /// Makes a folder of the default name under `root` (usually `runs`); a second run in the same second gets `-2`, and so on.
    ///
    /// # Errors
    /// The system refuses, or a hundred runs began in this second.
    pub fn create_default(root: &Path, title: &str, utc_ns: u64) -> Result<Self, FolderError> {
        let name = default_name(title, utc_ns);
        let mut result = Self::create(&root.join(&name));
        for number in 2..=100 {
            if !matches!(
                result,
                Err(FolderError::Occupied { .. } | FolderError::NotAFolder(_))
            ) {
                break;
            }
            result = Self::create(&root.join(format!("{name}-{number}")));
        }
        result
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The files added so far.
    #[must_use]
    pub fn inputs(&self) -> &[InputFile] {
        &self.inputs
    }

    /// Where the writer keeps the states of the test.
    ///
    /// # Errors
    /// The system refuses.
    pub fn open_states(&self) -> Result<StateFolder, FolderError> {
        StateFolder::open(&self.path).map_err(at(&self.path))
    }

    /// Keeps the interrupted `run` that this one resumes in `before`.
    ///
    /// # Errors
    /// The system refuses.
    pub fn keep_before(&self, run: &Path) -> Result<(), FolderError> {
        link_run(run, &self.place(BEFORE)?)
    }

    /// The files of a test: `test.toml`, the configuration byte for byte; `resolved.toml`, the complete one; and copies of other files
    /// that it read.
    ///
    /// # Errors
    /// The system refuses.
    pub fn keep(
        &mut self,
        test: &[u8],
        resolved: &str,
        inputs: &[(PathBuf, Vec<u8>)],
    ) -> Result<(), FolderError> {
        self.write("test.toml", test)?;
        self.write("resolved.toml", resolved.as_bytes())?;
        for (path, bytes) in inputs {
            self.add_input(path, bytes)?;
        }
        Ok(())
    }

    /// Makes a folder of this name in it for the program that runs the test.
    ///
    /// # Errors
    /// [`FolderError::Lost`], or the system refuses.
    pub fn make(&self, name: &str) -> Result<(), FolderError> {
        let folder = self.place(name)?;
        fs::create_dir_all(&folder).map_err(at(&folder))
    }

    /// The event that records the files of the test, so that a replay or a resume can prove that they are unchanged: the test file, its
    /// complete configuration, the layout of the rows, and the inputs. It also says where the run comes from.
    #[must_use]
    pub fn files_event(&self, file: &[u8], resolved: &str, layout: &Layout) -> Event {
        // A changed name or unit of a column changes the measured quantity.
        let layout = layout.to_json();
        let files = [
            ("test.toml", file),
            ("resolved.toml", resolved.as_bytes()),
            ("samples.json", layout.as_bytes()),
        ];
        let files = files.map(|(name, bytes)| (name.to_owned(), Checksum::of(bytes).to_string()));
        let inputs = self.inputs.iter();
        let inputs = inputs.map(|input| (input.path.clone(), input.sha256.clone()));
        let hashes = files.into_iter().chain(inputs);
        Event::Files {
            sha256: hashes.map(|(name, hash)| (name, hash.into())).collect(),
            version: env!("CARGO_PKG_VERSION").into(),
            origin: Some(Box::new(Origin::new(Wall::now(), self.path()))),
        }
    }

    /// A copy under `inputs/` of a file that the test read. The same bytes under the same name are kept once; other
    /// bytes under a name that is taken get a number before the extension.
    ///
    /// # Errors
    /// The system refuses.
    pub(crate) fn add_input(
        &mut self,
        source: &Path,
        bytes: &[u8],
    ) -> Result<InputFile, FolderError> {
        let sha256 = Checksum::of(bytes).to_string();
        let name = file_safe(source.file_name());
        let (stem, extension) = match name.rfind('.') {
            Some(point) if point > 0 => name.split_at(point),
            _ => (name.as_str(), ""),
        };
        let mut number = 1;
        let path = loop {
            let path = match number {
                1 => format!("inputs/{name}"),
                _ => format!("inputs/{stem}-{number}{extension}"),
            };
            match self.inputs.iter().find(|known| known.path == path) {
                None => break path,
                Some(known) if known.sha256 == sha256 => return Ok(known.clone()),
                Some(_) => number += 1,
            }
        };
        self.make("inputs")?;
        self.write(&path, bytes)?;
        let input = InputFile {
            path,
            sha256,
            bytes: bytes.len() as u64,
        };
        self.inputs.push(input.clone());
        Ok(input)
    }

    /// `samples.json`, then the empty `samples.bin` for the writer.
    ///
    /// # Errors
    /// The system refuses.
    pub fn open_samples(&self, layout: &Layout) -> Result<File, FolderError> {
        self.write("samples.json", layout.to_json().as_bytes())?;
        let path = self.path.join("samples.bin");
        let mut options = OpenOptions::new();
        options.append(true).create_new(true);
        options.open(&path).map_err(at(&path))
    }

    /// `events.jsonl` for the writer.
    ///
    /// # Errors
    /// The system refuses.
    pub fn open_events(&self) -> Result<File, FolderError> {
        let path = self.path.join("events.jsonl");
        OpenOptions::new()
            .append(true)
            .open(&path)
            .map_err(at(&path))
    }

    /// `timing.json`.
    ///
    /// # Errors
    /// The system refuses.
    pub fn write_timing(&self, timing: &Timings) -> Result<(), FolderError> {
        self.write_json("timing.json", timing)
    }

    /// `<name>.hgrm`.
    ///
    /// # Errors
    /// [`FolderError::Name`] if the name cannot be a file's, or the system refuses.
    pub fn write_histogram(&self, name: &str, text: &str) -> Result<(), FolderError> {
        let fit = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if name.is_empty() || name.starts_with('.') || !name.chars().all(fit) {
            return Err(FolderError::Name(name.to_owned()));
        }
        self.write(&format!("{name}.hgrm"), text.as_bytes())
    }

    /// `timing.hlog`: all histograms as one HdrHistogram interval log.
    ///
    /// # Errors
    /// The system refuses.
    pub fn write_interval_log(&self, text: &[u8]) -> Result<(), FolderError> {
        self.write("timing.hlog", text)
    }

    /// `summary.json`: the run is finished by this.
    ///
    /// # Errors
    /// The system refuses.
    pub fn write_summary(&self, summary: &Summary) -> Result<(), FolderError> {
        self.write_json("summary.json", summary)
    }

    fn write_json(&self, name: &str, content: &impl Serialize) -> Result<(), FolderError> {
        let path = self.path.join(name);
        let mut text = serde_json::to_string_pretty(content)
            .map_err(|source| FolderError::Damaged { path, source })?;
        text.push('\n');
        self.write(name, text.as_bytes())
    }

    /// Writes a file of this name.
    ///
    /// # Errors
    /// The system refuses.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), FolderError> {
        let path = self.place(name)?;
        atomic::write(&path, bytes).map_err(at(&path))
    }

    /// Where a file of this name is to be written.
    fn place(&self, name: &str) -> Result<PathBuf, FolderError> {
        let path = self.path.join(name);
        if self.is_there() {
            Ok(path)
        } else {
            Err(FolderError::Lost(path))
        }
    }
}

fn file_safe(name: Option<&std::ffi::OsStr>) -> String {
    let text = name.map(|name| name.to_string_lossy()).unwrap_or_default();
    let fit = |c: char| {
        // As `config::Inputs` names them, since resolved.toml points there.
        if c.is_alphanumeric() || "-_+.".contains(c) {
            c
        } else {
            '_'
        }
    };
    let safe: String = text.chars().map(fit).collect();
    if safe.is_empty() {
        "input".to_owned()
    } else {
        safe
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::Run;
    use crate::journal::encode;
    use crate::layout::tests::named;
    use crate::summary::tests::example;
    use std::io::Write as _;

    /// A folder with these columns and rows, unfinished.
    pub(crate) fn recorded(path: &Path, names: &[&str], rows: &[&[f64]]) -> RunFolder {
        let folder = RunFolder::create(path).unwrap();
        let mut samples = folder.open_samples(&named(names)).unwrap();
        let mut bytes = Vec::new();
        for (sequence, row) in rows.iter().enumerate() {
            assert_eq!(row.len(), names.len());
            encode(sequence as u64, row, &mut bytes);
        }
        samples.write_all(&bytes).unwrap();
        folder
    }

    #[test]
    fn written_folder_is_read_back() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("runs/deep/one");
        let mut folder = recorded(&path, &["time", "x1"], &[&[0.0, 1.0], &[0.5, 2.0]]);
        let test = b"title = \"\xC3\xBC\"\r\n";
        folder.keep(test, "title = 1\n", &[]).unwrap();
        folder
            .write_timing(&serde_json::json!({"slack": {"count": 1}}).into())
            .unwrap();
        folder
            .write_histogram("wakeup_lateness", "Value\n")
            .unwrap();
        let mut events = folder.open_events().unwrap();
        events
            .write_all(b"{\"event\":\"started\"}\n{\"eve")
            .unwrap();

        let run = Run::open(&path).unwrap();
        assert!(run.summary().is_none(), "unfinished without a summary");
        let mut summary = example();
        summary.peak.velocity[1] = None;
        folder.write_summary(&summary).unwrap();
        let run = Run::open(&path).unwrap();
        assert_eq!(run.summary(), Some(&summary));
        assert_eq!(
            run.columns(&["x1", "time"]).unwrap(),
            [[1.0, 2.0], [0.0, 0.5]]
        );
        assert!(matches!(run.columns(&["x2"]), Err(FolderError::NoColumn(name)) if name == "x2"));
        let events = run.events().unwrap();
        assert_eq!((events.events.len(), events.unreadable), (1, 1));
        assert_eq!(
            fs::read(path.join("test.toml")).unwrap(),
            b"title = \"\xC3\xBC\"\r\n"
        );
        let mut names: Vec<_> = fs::read_dir(&path)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        assert_eq!(
            names,
            [
                "events.jsonl",
                "resolved.toml",
                "samples.bin",
                "samples.json",
                "summary.json",
                "test.toml",
                "timing.json",
                "wakeup_lateness.hgrm"
            ]
        );
    }

    #[test]
    fn run_never_overwrites_anything() {
        let temp = tempfile::tempdir().unwrap();
        let empty = temp.path().join("empty");
        fs::create_dir(&empty).unwrap();
        RunFolder::create(&empty).unwrap();
        assert!(matches!(
            RunFolder::create(&empty),
            Err(FolderError::Occupied { .. })
        ));
        let other = temp.path().join("other");
        fs::create_dir_all(other.join("precious")).unwrap();
        for name in ["a", "b", "c", "d"] {
            fs::write(other.join(name), "x").unwrap();
        }
        match make_free(&other) {
            Err(FolderError::Occupied { holds, .. }) => assert_eq!(holds, "a, b, c and 2 more"),
            other => panic!("{other:?}"),
        }
        assert!(matches!(
            RunFolder::create(&other),
            Err(FolderError::Occupied { .. })
        ));
        let file = temp.path().join("file");
        fs::write(&file, "x").unwrap();
        assert!(matches!(
            RunFolder::create(&file),
            Err(FolderError::NotAFolder(_))
        ));
        let one = RunFolder::create_default(temp.path(), "A b", 0).unwrap();
        let two = RunFolder::create_default(temp.path(), "A b", 0).unwrap();
        assert!(one.path().ends_with("a-b-19700101-000000"));
        assert!(two.path().ends_with("a-b-19700101-000000-2"));
        let layout = named(&["x1"]);
        one.open_samples(&layout).unwrap();
        assert!(
            one.open_samples(&layout).is_err(),
            "rows already there are never appended to"
        );
    }

    #[test]
    fn unstarted_test_leaves_no_folder() {
        let temp = tempfile::tempdir().unwrap();
        let fill = |path: &Path| {
            let mut folder = recorded(path, &["x1"], &[]);
            folder.keep(b"", "", &[]).unwrap();
            folder.add_input(Path::new("a.csv"), b"1").unwrap();
            folder
        };
        let (new, old, shared) = (
            temp.path().join("new"),
            temp.path().join("old"),
            temp.path().join("shared"),
        );
        fs::create_dir(&old).unwrap();
        fill(&new).abandon();
        fill(&old).abandon();
        let folder = fill(&shared);
        fs::write(shared.join("notes.txt"), "theirs").unwrap();
        folder.abandon();
        assert!(!new.exists());
        assert_eq!(fs::read_dir(&old).unwrap().count(), 0);
        assert_eq!(fs::read_dir(&shared).unwrap().count(), 1);
    }

    #[test]
    fn replaced_folder_is_not_written_into() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        let mut folder = recorded(&path, &["x1"], &[]);
        assert!(folder.is_there());
        fs::remove_dir_all(&path).unwrap();
        let _other = RunFolder::create(&path).unwrap();
        assert!(!folder.is_there());
        assert_eq!(folder.find_again(), Whereabouts::Gone);
        for refused in [
            folder.write_summary(&example()),
            folder.write("report.html", b""),
            folder.make("identification"),
            folder.add_input(Path::new("a.csv"), b"1").map(|_| ()),
        ] {
            assert!(matches!(refused, Err(FolderError::Lost(_))), "{refused:?}");
        }
        folder.abandon();
        assert_eq!(fs::read_dir(&path).unwrap().count(), 1);
    }

    #[test]
    fn emptied_folder_stays_claimed() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        let folder = RunFolder::create(&path).unwrap();
        folder.claim();
        fs::remove_file(path.join("events.jsonl")).unwrap();
        let refused = RunFolder::create(&path).unwrap_err();
        assert!(matches!(refused, FolderError::Claimed(_)), "{refused}");
        folder.release();
        RunFolder::create(&path).unwrap();
    }

    #[test]
    fn input_keeps_its_name_in_resolved_toml() {
        let temp = tempfile::tempdir().unwrap();
        let mut folder = RunFolder::create(&temp.path().join("run")).unwrap();
        for name in ["RSN6_IMPVALL.I_I-ELC180.AT2", "+é.csv", ".hidden", "end."] {
            let input = folder.add_input(Path::new(name), name.as_bytes()).unwrap();
            assert_eq!(input.path, format!("inputs/{name}"));
        }
    }

    #[test]
    fn unreadable_parts_are_named() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        let open = |path: &Path| Run::open(path).unwrap_err();
        assert!(matches!(open(&path), FolderError::Missing(_)));
        fs::create_dir(&path).unwrap();
        assert!(matches!(open(&path), FolderError::Empty(_)));
        fs::write(path.join("holiday.jpg"), "x").unwrap();
        assert!(matches!(open(&path), FolderError::Foreign(_)));
        assert!(matches!(
            open(&path.join("holiday.jpg")),
            FolderError::NotAFolder(_)
        ));
        fs::write(path.join("test.toml"), "").unwrap();
        assert!(matches!(open(&path), FolderError::NoSamples(_)));
        fs::write(path.join("samples.json"), "{").unwrap();
        assert!(matches!(open(&path), FolderError::Layout { .. }));
        fs::write(path.join("samples.json"), named(&["x1"]).to_json()).unwrap();
        // No process writes to this pipe: a reader that opened it would wait for ever.
        for name in FILES.into_iter().chain(AFTER) {
            let file = path.join(name);
            let kept = fs::read(&file).ok();
            let _it_may_not_be_there = fs::remove_file(&file);
            rustix::fs::mkfifoat(rustix::fs::CWD, &file, rustix::fs::Mode::RUSR).unwrap();
            let refused = open(&path);
            assert!(matches!(refused, FolderError::NotAFile(of) if of == file));
            fs::remove_file(&file).unwrap();
            if let Some(kept) = kept {
                fs::write(&file, kept).unwrap();
            }
        }
        fs::write(path.join("summary.json"), "{\"status\": \"completed\"}").unwrap();
        let run = Run::open(&path).unwrap();
        assert_eq!(run.summary(), None, "it counts as missing");
        let fault = run.summary_fault().unwrap();
        assert!(fault.contains("`reason`"), "{fault}");
        fs::write(path.join("timing.json"), "{\n  \"slack\": 7\n}").unwrap();
        let fault = run.timings().unwrap_err().to_string();
        assert!(
            fault.contains("timing.json") && fault.contains("\"slack\": 7"),
            "{fault}"
        );
        fs::remove_file(path.join("timing.json")).unwrap();
        assert_eq!(run.timings().unwrap(), None);
        fs::write(path.join("summary.json"), b"{\"status\": \"compl\xE5ted\"").unwrap();
        let run = Run::open(&path).unwrap();
        assert_eq!(
            run.summary(),
            None,
            "what is no text counts as missing, too"
        );
        assert!(run.summary_fault().is_some());
        fs::remove_file(path.join("summary.json")).unwrap();
        let run = Run::open(&path).unwrap();
        assert!(matches!(run.journal(), Err(FolderError::Io { .. })));
        assert_eq!(run.events().unwrap().events.len(), 0);
    }

    #[test]
    fn inputs_are_copied_without_collisions() {
        let temp = tempfile::tempdir().unwrap();
        let mut folder = RunFolder::create(&temp.path().join("run")).unwrap();
        let one = folder
            .add_input(Path::new("/a/El Centro.AT2"), b"abc")
            .unwrap();
        let same = folder
            .add_input(Path::new("/b/El Centro.AT2"), b"abc")
            .unwrap();
        let two = folder
            .add_input(Path::new("/c/El Centro.AT2"), b"")
            .unwrap();
        let bare = folder.add_input(Path::new(".."), b"x").unwrap();
        // FIPS 180-2, appendix B.1.
        assert_eq!(
            one.sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
        assert_eq!((one.path.as_str(), one.bytes), ("inputs/El_Centro.AT2", 3));
        assert_eq!(same, one);
        assert_eq!(
            (two.path.as_str(), bare.path.as_str()),
            ("inputs/El_Centro-2.AT2", "inputs/input")
        );
        assert_eq!(fs::read(folder.path().join(&one.path)).unwrap(), b"abc");
        assert_eq!(folder.inputs().len(), 3);
    }

    #[test]
    fn python_reader_reads_the_same_bits() {
        let temp = tempfile::tempdir().unwrap();
        let path = temp.path().join("run");
        let rows: Vec<[f64; 2]> = (0..50)
            .map(|k| {
                [
                    f64::from(k) / 3.0,
                    (-1.0f64).powi(k) * 1e-300 / f64::from(k),
                ]
            })
            .collect();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        recorded(&path, &["time", "x1"], &rows);
        let samples = path.join("samples.bin");
        let bytes = fs::read(&samples).unwrap();
        fs::write(&samples, &bytes[..bytes.len() - 3]).unwrap();
        let tool = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tools/read_samples.py");
        let Ok(output) = std::process::Command::new("python3")
            .arg(tool)
            .arg(&path)
            .args(["sequence", "x1", "time"])
            .output()
        else {
            return; // No Python here; the format is held by the golden bytes of the journal.
        };
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let text = String::from_utf8(output.stdout).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("sequence\tx1\ttime"));
        let mut count = 0;
        for (number, (line, row)) in lines.zip(&rows).enumerate() {
            let cells: Vec<f64> = line.split('\t').map(|cell| cell.parse().unwrap()).collect();
            let bits = |values: [f64; 3]| values.map(f64::to_bits);
            let expected = [number as f64, row[1], row[0]];
            assert_eq!(bits([cells[0], cells[1], cells[2]]), bits(expected));
            count += 1;
        }
        assert_eq!(count, 49);
    }

    #[test]
    fn names_are_made_safe_or_refused() {
        assert_eq!(
            slug("Three-storey frame, Bouc–Wen (1024 Hz)!"),
            "three-storey-frame-bouc-wen-1024-hz"
        );
        assert_eq!(
            (slug("../../etc"), slug("…"), slug("")),
            ("etc".into(), "run".into(), "run".into())
        );
        assert_eq!(slug(&"ab ".repeat(40)).len(), 47);
        assert_eq!(
            default_name("x", 1_772_366_400_000_000_000),
            "x-20260301-120000"
        );
        let temp = tempfile::tempdir().unwrap();
        let folder = RunFolder::create(&temp.path().join("run")).unwrap();
        for name in ["", "..", "a/b", "a b"] {
            assert!(matches!(
                folder.write_histogram(name, ""),
                Err(FolderError::Name(_))
            ));
        }
    }
}
