//! Shared by the tests of links: test files, a served specimen, a fake specimen, rows.
#![allow(
    dead_code,
    reason = "each test is a separate program and uses its own part"
)]

pub mod adapter;
pub mod element;
mod fake;
pub mod relay;
mod running;

#[allow(unused_imports, reason = "as above")]
pub use fake::Fake;
#[allow(unused_imports, reason = "as above")]
pub use running::Running;

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use gusset_record::{Run, Summary};

/// No step here takes as long unless it hangs.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Of `[safety]`: a specimen behind a link may be without limits.
pub const UNLIMITED: &str = "unlimited = \"a formula\"\n";

pub const ONE_AXIS_LAW: &str = "[specimen.law.bouc_wen]
stiffness_n_per_m = 4e5
yield_force_n = 2e3
post_yield_ratio = 0.1
beta = 0.5
gamma = 0.5
exponent = 2
";

/// The file of a specimen of one axis that moves, for OpenFresco's protocols.
pub fn moving() -> String {
    format!("[serve.openfresco]\nphysical = true\n[[specimen]]\nname = \"column\"\n{ONE_AXIS_LAW}")
}

pub const TWO_AXES_LAW: &str = "[[specimen.laws]]
bilinear = { stiffness_n_per_m = 4e5, yield_force_n = 2e3, post_yield_ratio = 0.1 }
[[specimen.laws]]
linear = { stiffness_n_per_m = 4e5, damping_n_s_per_m = 300.0 }
";

/// A line of a link to a server that does not report itself as simulated.
pub const COMPUTED: &str = "computed = true";

/// A frame of two storeys for `steps` steps of 1 ms on the simulated clock; `specimen` ends the file. Its link always leads to a
/// computation.
pub fn test_file(steps: u32, specimen: &str) -> String {
    let duration = f64::from(steps) * 1e-3;
    const LINK: &str = "[specimen.link]";
    let unlimited = if specimen.contains(LINK) {
        UNLIMITED
    } else {
        ""
    };
    let specimen = specimen.replace(LINK, &format!("{LINK}\n{COMPUTED}"));
    format!(
        "title = \"link\"
[time]
rate_hz = 1000
duration_s = {duration}
clock = \"simulated\"
[structure.shear_building]
mass_kg = [1000, 1000]
stiffness_n_per_m = [0, 1e5]
[structure.damping.rayleigh_ratio]
ratio = 0.02
modes = [1, 2]
[excitation.ground_acceleration.signal.sine]
frequency_hz = 2.0
amplitude = 3.0
[timing]
warmup_ticks = 5
[safety]
zero_s = 0
{unlimited}[[specimen]]
name = \"column\"
{specimen}"
    )
}

pub const ONE_AXIS: &str = "storey = 1\nstiffness_n_per_m = 4e5\n";
pub const TWO_AXES: &str = "rows = [[1, 0], [-1, 1]]\nstiffness_n_per_m = [[4e5, 0], [0, 4e5]]\n\
                            damping_n_s_per_m = [[0, 0], [0, 300]]\n";

/// The file of a gateway to the specimen at `address`: `table` and `link` are further keys of the specimen and its link.
pub fn gateway(address: &str, table: &str, link: &str) -> String {
    format!(
        "[safety]\n{UNLIMITED}[[specimen]]\nname = \"column\"\n{table}[specimen.link]\naddress = \"{address}\"\nprobe = \"none\"\n\
         connect_timeout_s = 2\n{COMPUTED}\n{link}\n"
    )
}

/// A test of `steps` steps whose specimen of one axis is at `address`.
pub fn linked(steps: u32, address: &str, keys: &str) -> String {
    test_file(
        steps,
        &format!("{ONE_AXIS}[specimen.link]\naddress = \"{address}\"\n{keys}\n"),
    )
}

pub fn gusset() -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    command.env("GUSSET_STATE", state_folder());
    // To run all tests with other words in place of received texts. The test itself reads the true ones.
    if std::env::var_os("GUSSET_TEST_REWORD").is_some() {
        command.env("GUSSET_REWORD", "1");
    }
    command
}

/// A folder that does not exist yet, for the lasting records of specimens: no test sees those of another, or of this machine.
pub fn state_folder() -> PathBuf {
    static MADE: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
    let number = MADE.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    let name = format!("gusset-state-{}-{number}", std::process::id());
    std::env::temp_dir().join(name)
}

/// Words of a peer as a program reads them: with `GUSSET_TEST_REWORD` others.
pub fn as_read(words: &str) -> &str {
    match std::env::var_os("GUSSET_TEST_REWORD") {
        Some(_) => "reworded",
        None => words,
    }
}

pub fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    // A secret that other users can read is refused.
    if [".key", ".token"].iter().any(|end| name.ends_with(end)) {
        use std::os::unix::fs::PermissionsExt;
        let owner = std::fs::Permissions::from_mode(0o600);
        std::fs::set_permissions(&path, owner).unwrap();
    }
    path
}

/// Runs the program and does not wait for ever.
pub fn finish(mut command: Command) -> Output {
    let child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    not_for_ever(child)
}

fn not_for_ever(child: Child) -> Output {
    let id = child.id();
    let (done, is_done) = mpsc::channel();
    let guard = std::thread::spawn(move || {
        if is_done.recv_timeout(PATIENCE).is_err() {
            let _ = Command::new("kill").arg(id.to_string()).status();
            true
        } else {
            false
        }
    });
    let output = child.wait_with_output().unwrap();
    let _ = done.send(());
    assert!(!guard.join().unwrap(), "it hung: {output:?}");
    output
}

/// Runs one test into `folder/name`; returns its exit code and its output.
pub fn run(folder: &Path, name: &str, text: &str) -> (i32, String) {
    run_by(gusset(), folder, name, text)
}

/// Runs one test by a program that reads other words in place of each text of a peer.
pub fn run_reworded(folder: &Path, name: &str, text: &str) -> (i32, String) {
    let mut command = gusset();
    command.env("GUSSET_REWORD", "1");
    run_by(command, folder, name, text)
}

fn run_by(mut command: Command, folder: &Path, name: &str, text: &str) -> (i32, String) {
    let file = write(folder, &format!("{name}.toml"), text);
    command
        .arg("run")
        .arg(file)
        .arg("--out")
        .arg(folder.join(name));
    let output = finish(command);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code().unwrap(), said)
}

pub fn summary(folder: &Path, name: &str) -> Summary {
    let run = Run::open(&folder.join(name)).unwrap();
    run.summary().unwrap().clone()
}

/// Every row of this run folder is reproduced, and its files are those of the test.
pub fn assert_replays(folder: &Path) {
    let found = gusset_session::replay(folder).unwrap();
    assert!(
        found.is_exact() && found.files_proven && found.rows > 0,
        "{found:?}"
    );
}

/// Sends a signal by name.
pub fn signal(process: u32, name: &str) {
    let id = process.to_string();
    let sent = Command::new("kill").args(["-s", name, &id]).status();
    assert!(sent.unwrap().success());
}

/// Names of the events of a run.
pub fn events(folder: &Path, name: &str) -> Vec<String> {
    let events = Run::open(&folder.join(name)).unwrap().events().unwrap();
    assert_eq!(events.unreadable, 0);
    events
        .events
        .iter()
        .map(|line| line.name().to_owned())
        .collect()
}

/// Every column that does not depend on wall time, as bits, but those whose name begins with `without`.
pub fn columns(folder: &Path, name: &str, without: &str) -> Vec<(String, Vec<u64>)> {
    let run = Run::open(&folder.join(name)).unwrap();
    let names: Vec<String> = run
        .layout()
        .columns()
        .iter()
        .filter(|column| {
            !column.timing && (without.is_empty() || !column.name.starts_with(without))
        })
        .map(|column| column.name.to_string())
        .collect();
    let wanted: Vec<&str> = names.iter().map(String::as_str).collect();
    let values = run.columns(&wanted).unwrap();
    names
        .into_iter()
        .zip(values)
        .map(|(name, column)| (name, column.iter().map(|v| v.to_bits()).collect()))
        .collect()
}

/// `gusset serve` in the background; ended when dropped.
pub struct Served {
    child: Child,
    pub address: String,
    heard: mpsc::Receiver<String>,
    /// Where `gusset reset` reaches it.
    control: PathBuf,
}

impl Served {
    pub fn start(folder: &Path, text: &str, arguments: &[&str]) -> Self {
        Self::listen(folder, text, "127.0.0.1:0", arguments)
    }

    pub fn listen(folder: &Path, text: &str, listen: &str, arguments: &[&str]) -> Self {
        static STARTED: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let number = STARTED.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let file = write(folder, &format!("serve-{number}.toml"), text);
        Self::serves(&file, listen, arguments)
    }

    /// The server of a file that is there.
    pub fn serves(file: &Path, listen: &str, arguments: &[&str]) -> Self {
        let given = arguments.contains(&"--listen");
        let out = arguments.iter().skip_while(|word| **word != "--out").nth(1);
        let control = out.map_or_else(|| file.with_extension("control.sock"), PathBuf::from);
        // The server reacts to a hang-up, even where the tests ignore it.
        let mut child = Command::new("env")
            .arg("--default-signal=HUP")
            .arg(assert_cmd::cargo::cargo_bin!("gusset"))
            .arg("serve")
            .arg(file)
            .args(if given {
                vec![]
            } else {
                vec!["--listen", listen]
            })
            .args(arguments)
            .env("GUSSET_STATE", file.with_file_name("state"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        stdout.read_line(&mut line).unwrap();
        let Some(address) = line.trim().strip_prefix("listening on ") else {
            let mut said = String::new();
            child
                .stderr
                .take()
                .unwrap()
                .read_to_string(&mut said)
                .unwrap();
            panic!("not ready: {line:?} {said}");
        };
        let address = address.to_owned();
        let (tell, heard) = mpsc::channel();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        std::thread::spawn(move || {
            for line in stderr.lines().map_while(Result::ok) {
                let _ = tell.send(line);
            }
        });
        Self {
            child,
            address,
            heard,
            control,
        }
    }

    /// Clears its latched trip, as its operator does; returns the exit code and the output.
    pub fn reset(&self) -> (i32, String) {
        let mut command = gusset();
        command.arg("reset").arg(&self.control).arg("--yes");
        let output = finish(command);
        let said = [output.stdout, output.stderr].concat();
        let said = String::from_utf8_lossy(&said).into_owned();
        (output.status.code().unwrap(), said)
    }

    /// Waits until it prints a line that contains `words`.
    pub fn hears(&self, words: &str) -> String {
        let mut before = Vec::new();
        loop {
            match self.heard.recv_timeout(PATIENCE) {
                Ok(line) if line.contains(words) => return line,
                Ok(line) => before.push(line),
                Err(_) => panic!("{words:?} was never said, but {before:?}"),
            }
        }
    }

    /// All its lines up to one that contains `words`.
    pub fn says_before(&self, words: &str) -> Vec<String> {
        let mut before = Vec::new();
        loop {
            match self.heard.recv_timeout(PATIENCE) {
                Ok(line) if line.contains(words) => return before,
                Ok(line) => before.push(line),
                Err(_) => panic!("{words:?} was never said, but {before:?}"),
            }
        }
    }

    pub fn kill(&mut self) {
        self.child.kill().unwrap();
    }

    /// Sends a signal by name, and does not wait.
    pub fn send(&self, name: &str) {
        signal(self.child.id(), name);
    }

    /// Sends a signal by name, and waits for the end.
    pub fn signal(&mut self, name: &str) -> i32 {
        self.send(name);
        self.child.wait().unwrap().code().unwrap()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
