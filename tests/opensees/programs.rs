//! Runs the real OpenSees, and our binary beside it. Where OpenSees is not installed a test prints a clear message, and with
//! CI=true it fails. `tools/test` installs it.

#![allow(dead_code, reason = "each test file uses its part")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use serde_json::Value;

/// No step takes this long unless it hangs.
pub const LONG: Duration = Duration::from_secs(60);

/// The interpreter that has OpenSeesPy; `None`, with a clear message, if it is not installed.
///
/// # Panics
/// If it is not installed and CI=true.
pub fn python() -> Option<PathBuf> {
    let made = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/opensees-venv/bin/python");
    let python = match std::env::var_os("GUSSET_OPENSEES_PYTHON") {
        Some(given) => PathBuf::from(given),
        None => made,
    };
    if python.exists() {
        return Some(python);
    }
    let text = "SKIPPED: OpenSees is not installed; `tools/test` installs it\n";
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{text}");
    // Past the capture of the test harness, which hides the output of a passing test.
    let _ = std::io::stderr().write_all(text.as_bytes());
    None
}

/// A port that is free now, outside the range from which the system gives out ports by itself: no connection of another
/// test takes it before OpenSees opens it.
///
/// # Panics
/// If none of them is free.
pub fn free_port() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let start = (std::process::id() % 10_000) as u16;
    for _ in 0..10_000 {
        let port = 20_000 + (start + NEXT.fetch_add(1, Ordering::Relaxed)) % 10_000;
        let address = ("127.0.0.1", port);
        if TcpListener::bind(address).is_ok() && UdpSocket::bind(address).is_ok() {
            return port;
        }
    }
    panic!("no port from 20000 to 29999 is free");
}

/// A process whose lines are read, and which does not outlive its test.
#[derive(Debug)]
pub struct Peer {
    child: Child,
    lines: Receiver<String>,
    seen: Vec<String>,
}

impl Peer {
    /// Reads the lines of stdout, and those of stderr if they are wanted, as they come.
    fn spawn(mut command: Command, with_stderr: bool) -> Self {
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(if with_stderr {
                Stdio::piped()
            } else {
                Stdio::null()
            });
        let mut child = command.spawn().unwrap();
        let (tell, lines) = channel();
        let stdout = child
            .stdout
            .take()
            .map(|s| Box::new(s) as Box<dyn Read + Send>);
        let stderr = child
            .stderr
            .take()
            .map(|s| Box::new(s) as Box<dyn Read + Send>);
        for source in stdout.into_iter().chain(stderr) {
            let tell = tell.clone();
            std::thread::spawn(move || {
                for line in BufReader::new(source).lines().map_while(Result::ok) {
                    if tell.send(line).is_err() {
                        break;
                    }
                }
            });
        }
        Self {
            child,
            lines,
            seen: Vec::new(),
        }
    }

    /// A script of tools/opensees; its JSON lines are read.
    pub fn script(python: &Path, name: &str, args: &[&str]) -> Self {
        let mut command = Command::new(python);
        command
            .arg(format!(
                "{}/tools/opensees/{name}",
                env!("CARGO_MANIFEST_DIR")
            ))
            .args(args)
            .env("PYTHONDONTWRITEBYTECODE", "1");
        Self::spawn(command, false)
    }

    /// Our binary; all its output is read.
    pub fn gusset(args: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gusset"));
        command.env("GUSSET_STATE", crate::link_common::state_folder());
        command.args(args);
        Self::spawn(command, true)
    }

    /// The next line that satisfies `wanted`.
    ///
    /// # Panics
    /// If none comes in time.
    pub fn line(&mut self, wanted: impl Fn(&str) -> bool) -> String {
        loop {
            match self.lines.recv_timeout(LONG) {
                Ok(line) => {
                    self.seen.push(line.clone());
                    if wanted(&line) {
                        return line;
                    }
                }
                Err(error) => panic!("{error}; it said only {:#?}", self.seen),
            }
        }
    }

    /// The next JSON line of this event.
    pub fn event(&mut self, name: &str) -> Value {
        let mark = format!("\"event\": \"{name}\"");
        serde_json::from_str(&self.line(|line| line.contains(&mark))).unwrap()
    }

    /// All JSON lines of this event that stand before its end.
    pub fn events(&mut self, name: &str) -> Vec<Value> {
        let mark = format!("\"event\": \"{name}\"");
        let mut found = Vec::new();
        while let Ok(line) = self.lines.recv_timeout(LONG) {
            if line.contains(&mark) {
                found.push(serde_json::from_str(&line).unwrap());
            }
        }
        found
    }

    /// Ends it at once, as a power cut would.
    pub fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Asks it to end.
    pub fn terminate(&self) {
        let pid = rustix::process::Pid::from_child(&self.child);
        rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    }

    /// Its end, which must come by itself once its output has ended.
    pub fn end(mut self) -> (ExitStatus, Vec<String>) {
        while let Ok(line) = self.lines.recv_timeout(LONG) {
            self.seen.push(line);
        }
        (self.child.wait().unwrap(), std::mem::take(&mut self.seen))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// `gusset serve` on a free port of this machine, for OpenSees.
#[derive(Debug)]
pub struct Server {
    pub peer: Peer,
    pub port: u16,
    _folder: tempfile::TempDir,
}

impl Server {
    /// An element server of the specimen whose `[[specimen]]` table holds `lines`.
    pub fn start(lines: &str, transport: &str) -> Self {
        Self::offering("openfresco", lines, transport)
    }

    /// A server of that specimen for any of the protocols.
    pub fn offering(protocol: &str, lines: &str, transport: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("specimen.toml");
        std::fs::write(&file, format!("[[specimen]]\nname = \"spring\"\n{lines}\n")).unwrap();
        let mut peer = Peer::gusset(&[
            "serve",
            file.to_str().unwrap(),
            "--protocol",
            protocol,
            "--transport",
            transport,
            "--listen",
            "127.0.0.1:0",
        ]);
        let line = peer.line(|line| line.starts_with("listening on "));
        let port = line.split("127.0.0.1:").nth(1).unwrap();
        let port: String = port.chars().take_while(char::is_ascii_digit).collect();
        Self {
            peer,
            port: port.parse().unwrap(),
            _folder: folder,
        }
    }
}
