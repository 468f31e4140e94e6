//! The studies of `config/remote` and `config/certificate`: a server and a test that commands its specimen.

mod common;
mod tls_common;

use std::fs::File;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

use common::{gusset, json, say};
use tls_common::{Authority, LOCAL, VALID};

/// A server that ends with the test.
struct Server {
    process: Child,
    address: String,
}

impl Server {
    /// Serves `column.toml` of a folder at a free port.
    fn start(folder: &Path) -> Self {
        let output = folder.join("output");
        let file = File::create(&output).unwrap();
        let mut command = gusset();
        command.arg("serve").arg(folder.join("column.toml"));
        command.args(["--listen", "127.0.0.1:0"]);
        command.stdout(file.try_clone().unwrap()).stderr(file);
        let mut server = Self {
            process: command.spawn().unwrap(),
            address: String::new(),
        };
        let until = Instant::now() + Duration::from_secs(60);
        while server.address.is_empty() {
            let text = std::fs::read_to_string(&output).unwrap();
            assert!(Instant::now() < until, "no address in {text}");
            let found = text.lines().find_map(|line| {
                let (_, address) = line.split_once("listening on ")?;
                Some(address.to_owned())
            });
            server.address = found.filter(|_| text.ends_with('\n')).unwrap_or_default();
            std::thread::sleep(Duration::from_millis(20));
        }
        server
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
    common::completed(&test, &out, &["--clock", "simulated", "--set", &address]);
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
fn study_with_certificates_runs_with_its_server() {
    let folder = copied("certificate");
    let authority = Authority::new();
    authority.issue(folder.path(), "server", LOCAL, VALID);
    authority.issue(folder.path(), "client", &["controller"], VALID);
    authority.publish(folder.path(), "ca.crt");
    is_completed(folder.path());
}
