//! The studies of `config/remote` and `config/certificate`: a server and a test that commands its specimen.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};

use crate::common::{gusset, json, say};
use crate::tls_common::{Authority, LOCAL, VALID};

/// A server that ends with the test.
struct Server {
    process: Child,
    address: String,
}

impl Server {
    /// Serves `column.toml` of a folder at a free port.
    fn start(folder: &Path) -> Self {
        let mut command = gusset();
        command.arg("serve").arg(folder.join("column.toml"));
        command.args(["--listen", "127.0.0.1:0"]);
        command.stdout(Stdio::piped());
        let mut process = command.spawn().unwrap();
        let stdout = process.stdout.take().unwrap();
        let mut lines = BufReader::new(stdout).lines().map_while(Result::ok);
        let address = lines.find_map(|line| {
            let (_, address) = line.split_once("listening on ")?;
            Some(address.to_owned())
        });
        // The server never waits for a reader.
        std::thread::spawn(move || lines.for_each(drop));
        Self {
            process,
            address: address.expect("the server says where it listens"),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Copies a folder of studies, so that certificates and runs stay out of the crate.
fn copied(name: &str) -> tempfile::TempDir {
    let from = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("config")
        .join(name);
    let folder = tempfile::tempdir().unwrap();
    for file in ["column.toml", "frame.toml"] {
        std::fs::copy(from.join(file), folder.path().join(file)).unwrap();
    }
    folder
}

/// Checks the test of a folder and runs it with the server of that folder.
#[track_caller]
fn is_completed(folder: &Path) {
    let test = folder.join("frame.toml");
    let server = Server::start(folder);
    let address = format!("specimen.0.link.address=\"{}\"", server.address);
    let said = say(["check".as_ref(), test.as_os_str()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let out = folder.join("out");
    crate::common::completed(&test, &out, &["--clock", "simulated", "--set", &address]);
    let summary = json(&out, "summary.json");
    assert_eq!(summary["status"], "completed");
    assert_eq!(summary["steps"], 2560);
    // The column yields at 60 kN.
    let force = summary["peak"]["force"]["column"][0].as_f64().unwrap();
    assert!((60e3..63e3).contains(&force), "{force}");
}

#[test]
fn remote_study_runs_with_its_server() {
    is_completed(copied("remote").path());
}

#[test]
fn study_with_certificates_runs() {
    let folder = copied("certificate");
    let authority = Authority::new();
    authority.issue(folder.path(), "server", LOCAL, VALID);
    authority.issue(folder.path(), "client", &["controller"], VALID);
    authority.publish(folder.path(), "ca.crt");
    is_completed(folder.path());
}
