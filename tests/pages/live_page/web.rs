//! A run with a live page, and plain HTTP to it: no library of ours on this side.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Stdio};
use std::time::{Duration, Instant};

use crate::common::{PATIENT, gusset};

/// A running test with a page.
pub struct Running {
    child: Child,
    /// Its messages after the address of its page.
    said: BufReader<ChildStderr>,
    pub address: String,
    pub link: String,
    pub token: String,
    pub folder: PathBuf,
}

impl Running {
    /// Starts `test` into `home/name`, with its page on any free port of `host`.
    pub fn start(home: &Path, name: &str, test: &Path, host: &str, more: &[&str]) -> Self {
        let folder = home.join(name);
        let mut child = gusset()
            .arg("run")
            .arg(test)
            .args(["--out", folder.to_str().unwrap()])
            .args(["--live", &format!("{host}:0")])
            .args(PATIENT)
            .args(["--set", "timing.policy=\"ordinary\""])
            .args(more)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        let mut after = |start: &str| {
            let mut line = String::new();
            loop {
                line.clear();
                assert!(said.read_line(&mut line).unwrap() > 0, "no line {start:?}");
                if let Some(rest) = line.strip_prefix(start) {
                    return rest.trim().to_owned();
                }
            }
        };
        let link = after("live page: http://");
        let token = after("control token (HOLD, CONTINUE, CONFIRM, STOP on the page): ");
        let address = link.split('/').next().unwrap().to_owned();
        Self {
            child,
            said,
            address,
            link,
            token,
            folder,
        }
    }

    /// Waits for the end; returns the exit code and the output.
    pub fn end(mut self) -> (Option<i32>, String) {
        let mut said = String::new();
        self.said.read_to_string(&mut said).unwrap();
        (self.child.wait().unwrap().code(), said)
    }

    /// An answer with these further header lines.
    pub fn ask(&self, request: &str, headers: &[(&str, &str)]) -> Reply {
        ask(&self.address, request, headers)
    }

    /// POST /control/`what` with the right token; a `continue` of the latest hold.
    pub fn order(&self, what: &str) -> Reply {
        let bearer = format!("Bearer {}", self.token);
        let mut request = format!("POST /control/{what}");
        if what == "continue" {
            request += &format!("?hold={}", self.metric("gusset_hold_number"));
        }
        self.ask(&request, &[("Authorization", &bearer)])
    }

    /// One number of /metrics.
    pub fn metric(&self, sample: &str) -> f64 {
        let reply = self.ask("GET /metrics", &[]);
        assert_eq!(reply.status, 200, "{}", reply.body);
        let line = reply
            .body
            .lines()
            .find_map(|line| line.strip_prefix(sample));
        let value = line.unwrap_or_else(|| panic!("no {sample} in {}", reply.body));
        value.trim().parse().unwrap()
    }

    /// Waits until the test is in this phase.
    pub fn until_phase(&self, phase: &str) {
        let sample = format!("gusset_phase{{phase=\"{phase}\"}}");
        until(phase, || self.metric(&sample) > 0.0);
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // After an assertion that failed; a child that has ended stays ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits until `done`, with a bound that only a hang meets.
#[expect(clippy::disallowed_methods, reason = "another process is waited for")]
pub fn until(what: &str, mut done: impl FnMut() -> bool) {
    let began = Instant::now();
    while !done() {
        assert!(began.elapsed() < Duration::from_secs(60), "{what}");
        std::thread::yield_now();
    }
}

/// A server's reply.
#[derive(Debug)]
pub struct Reply {
    pub status: u16,
    pub head: String,
    pub body: String,
}

/// Opens a connection and sends one request, "GET /path".
pub fn call(address: &str, request: &str, headers: &[(&str, &str)]) -> TcpStream {
    // 0.0.0.0 is every address of this machine.
    let near = address.replace("0.0.0.0", "127.0.0.1");
    let mut stream = TcpStream::connect(near).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    let mut text = format!("{request} HTTP/1.1\r\n");
    if !headers.iter().any(|(name, _)| *name == "Host") {
        text.push_str(&format!(
            "Host: {}\r\n",
            address.replace("0.0.0.0", "127.0.0.1")
        ));
    }
    for (name, value) in headers {
        text.push_str(&format!("{name}: {value}\r\n"));
    }
    text.push_str("Connection: close\r\nContent-Length: 0\r\n\r\n");
    stream.write_all(text.as_bytes()).unwrap();
    stream
}

/// A request that leaves its connection open.
pub const KEEP_ALIVE: &[u8] = b"GET /icon.svg HTTP/1.1\r\nHost: localhost\r\n\r\n";

/// Opens a connection that stays open, and has one request on it answered.
pub fn keep_alive(address: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(KEEP_ALIVE).unwrap();
    let patience = Some(Duration::from_secs(60));
    stream.set_read_timeout(patience).unwrap();
    stream.set_write_timeout(patience).unwrap();
    let _some = stream.read(&mut [0; 4096]).unwrap();
    stream
}

/// One request and its whole answer; of a stream only the head.
pub fn ask(address: &str, request: &str, headers: &[(&str, &str)]) -> Reply {
    let mut reader = BufReader::new(call(address, request, headers));
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        assert!(reader.read_line(&mut head).unwrap() > 0, "cut off: {head}");
    }
    let status = head.split(' ').nth(1).unwrap().parse().unwrap();
    let mut body = String::new();
    if !head.contains("text/event-stream") {
        reader.read_to_string(&mut body).unwrap();
    }
    Reply { status, head, body }
}

/// A viewer that reads /stream to its end: the events in it, and how it ended.
#[derive(Debug)]
pub struct Watched {
    pub events: usize,
    pub bins: usize,
    pub skipped: u64,
    pub phases: Vec<String>,
    pub status: Option<String>,
    pub rows: f64,
}

/// Reads events until the stream ends.
pub fn watch(stream: TcpStream) -> Watched {
    let mut seen = Watched {
        events: 0,
        bins: 0,
        skipped: 0,
        phases: Vec::new(),
        status: None,
        rows: 0.0,
    };
    for line in BufReader::new(stream).lines() {
        // Chunk sizes and heads stand between the events.
        let Some(text) = line
            .as_ref()
            .ok()
            .and_then(|line| line.strip_prefix("data: "))
        else {
            continue;
        };
        let event: serde_json::Value = serde_json::from_str(text).expect("an event is JSON");
        seen.events += 1;
        assert_eq!(event.get("hello").is_some(), seen.events == 1, "{text}");
        seen.bins += event["bins"].as_array().unwrap().len();
        seen.skipped += event["skipped"].as_u64().unwrap_or(0);
        let state = &event["state"];
        if let Some(phase) = state["phase"].as_str() {
            if seen.phases.last().map(String::as_str) != Some(phase) {
                seen.phases.push(phase.to_owned());
            }
            seen.rows = state["now"]["rows"].as_f64().unwrap();
            seen.status = state["ended"]["status"].as_str().map(str::to_owned);
        }
    }
    seen
}
