//! Certificates of tools/make-certificates, and OpenSSL at the other end: OpenFresco's programs speak TLS through it. Without
//! `openssl` these tests print a clear message, and fail with CI=true.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use crate::link_common::{ONE_AXIS, ONE_AXIS_LAW, Served, linked, run, test_file};
use crate::openfresco_ends::{Listen, in_process, path, settings};
use gusset_config::{ServeTlsSpec, TlsSpec};
use gusset_link::openfresco::{End, Nature, Remote, RemoteSettings, Role, ServeSettings};
use gusset_link::tls::{TlsClient, TlsFiles, TlsServer};
use gusset_quantity::substructure::{Command as Move, Measurement, Retirement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_wire::openfresco::{Action, Carrier, Counts, Peer, Reading, Sizes};

/// The files, or `None` without openssl.
fn made() -> Option<tempfile::TempDir> {
    if Command::new("openssl").arg("version").output().is_err() {
        let text = "SKIPPED: openssl is not installed\n";
        // Past the capture of the test harness, which hides the output of a passing test.
        let _ = std::io::stderr().write_all(text.as_bytes());
        assert!(
            std::env::var_os("CI").is_none_or(|ci| ci != "true"),
            "{text}"
        );
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let output = make(folder.path(), &["rig.example", "192.0.2.7"]);
    assert!(output.status.success(), "{output:?}");
    Some(folder)
}

fn make(folder: &Path, names: &[&str]) -> std::process::Output {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/make-certificates");
    Command::new(script)
        .arg(folder)
        .args(names)
        .output()
        .unwrap()
}

#[test]
fn scripts_certificates_carry_a_test() {
    let Some(folder) = made() else { return };
    let folder = folder.path();
    use std::os::unix::fs::PermissionsExt;
    for key in ["ca.key", "server.key", "client.key"] {
        let mode = std::fs::metadata(folder.join(key))
            .unwrap()
            .permissions()
            .mode();
        assert_eq!(mode & 0o077, 0, "{key} is for its owner only");
    }
    assert_eq!(make(folder, &[]).status.code(), Some(1));
    let local = test_file(50, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    let served = Served::start(folder, &local, &["--transport", "tls"]);
    for (name, keys) in [("as-it-is", ""), ("named", "server_name = \"rig.example\"")] {
        let keys = format!("transport = \"tls\"\n[specimen.link.tls]\n{keys}");
        let (code, said) = run(folder, name, &linked(50, &served.address, &keys));
        assert_eq!(code, 0, "{said}");
    }
}

/// `openssl ARGUMENTS` whose stdin and stdout are the two directions of a session.
struct OpenSsl(Child);

impl OpenSsl {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let child = Command::new("openssl")
            .args(arguments)
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        Self(child)
    }

    fn say(&mut self, bytes: &[u8]) {
        let stdin = self.0.stdin.as_mut().unwrap();
        stdin.write_all(bytes).unwrap();
        stdin.flush().unwrap();
    }

    fn hear(&mut self, length: usize) -> Vec<u8> {
        let mut bytes = vec![0; length];
        self.0
            .stdout
            .as_mut()
            .unwrap()
            .read_exact(&mut bytes)
            .unwrap();
        bytes
    }
}

impl Drop for OpenSsl {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

const N: usize = 5;

fn vector(action: Action, disp: f64) -> Vec<u8> {
    let mut bytes = vec![0; 8 * N];
    let mut codes = (0..100).map(f64::from);
    let code = codes.find(|code| Action::whole(*code) == Ok(Some(action)));
    bytes[..8].copy_from_slice(&code.unwrap().to_le_bytes());
    bytes[8..16].copy_from_slice(&disp.to_le_bytes());
    bytes
}

fn double(bytes: &[u8], index: usize) -> f64 {
    f64::from_le_bytes(bytes[8 * index..8 * index + 8].try_into().unwrap())
}

#[test]
fn openssl_client_is_served() {
    let Some(folder) = made() else { return };
    let folder = folder.path();
    let files = TlsFiles::of_server(&ServeTlsSpec::default(), folder);
    let tls = TlsServer::new(&files, false).unwrap();
    let limits = ServeSettings::new(Role::Application, Some(30.0));
    let server = Listen::tls("127.0.0.1:0", tls).serve(limits, 1, Nature::Simulated);
    let address = server.address.to_string();
    for version in ["-tls1_2", "-tls1_3"] {
        for certificate in [&[][..], &["-cert", "client.crt", "-key", "client.key"][..]] {
            let mut arguments = vec!["s_client", "-quiet", "-verify_return_error", version];
            arguments.extend(["-CAfile", "client_ca.crt", "-connect", &address]);
            arguments.extend(certificate);
            let mut client = OpenSsl::start(folder, &arguments);
            let mut sizes = [0; 44];
            let (ctrl, daq) = (Counts::new(1, 0, 0, 0, 0), Counts::new(0, 0, 0, 1, 0));
            Sizes::new(ctrl, daq, N).unwrap().write(&mut sizes).unwrap();
            client.say(&sizes);
            for (k, (_, force)) in in_process(1, 20).iter().enumerate() {
                client.say(&vector(Action::Trial, path(k as u64, 0)));
                client.say(&vector(Action::Read(Reading::Force), 0.0));
                assert_eq!(double(&client.hear(8 * N), 0), force[0], "{version}");
                client.say(&vector(Action::Commit, 0.0));
            }
            client.say(&vector(Action::Die, 0.0));
            assert_eq!(server.end(), End::Finished);
        }
    }
}

#[test]
fn openssl_server_is_commanded() {
    let Some(folder) = made() else { return };
    let folder = folder.path();
    let client = TlsClient::new(
        &TlsFiles::of_client(&TlsSpec::default(), folder),
        None,
        true,
    )
    .unwrap();
    for version in ["-tls1_2", "-tls1_3"] {
        let port = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let at = port.to_string();
        let mut arguments = vec![
            "s_server", "-quiet", version, "-naccept", "1", "-accept", &at,
        ];
        arguments.extend(["-cert", "server.crt", "-key", "server.key"]);
        arguments.extend([
            "-CAfile",
            "server_ca.crt",
            "-Verify",
            "1",
            "-verify_return_error",
        ]);
        let mut server = OpenSsl::start(folder, &arguments);
        // It may need a moment to listen: a refused connection is tried again.
        let mut remote = Remote::new(RemoteSettings {
            tls: Some(client.clone()),
            connect_limit_s: 20.0,
            reply_limit_s: 20.0,
            ctrl: Counts::new(1, 0, 0, 0, 0),
            daq: Counts::new(1, 0, 0, 1, 0),
            data_size: N,
            ..settings(Peer::Site, Carrier::Stream, port, 1)
        })
        .unwrap();
        let opening = std::thread::spawn(move || {
            remote.open().unwrap();
            remote
        });
        let sizes = server.hear(44);
        assert_eq!(sizes[0], 1);
        // The controller queries its position: it is at 0.
        let asked = server.hear(8 * N);
        assert_eq!(asked, vector(Action::Read(Reading::All), 0.0));
        server.say(&[0; 8 * N]);
        let mut remote = opening.join().unwrap();
        let mut into = Measurement::zeros(1);
        for k in 0..20 {
            let disp = path(k, 0);
            let command = Move {
                sequence: k,
                time: 0.01 * k as f64,
                dt: 0.01,
                disp: &[disp],
                vel: &[0.0],
            };
            remote.issue(&command).unwrap();
            let heard = server.hear(2 * 8 * N);
            assert_eq!((double(&heard, 0), double(&heard, 1)), (3.0, disp));
            let mut answer = vec![0; 8 * N];
            answer[..8].copy_from_slice(&disp.to_le_bytes());
            answer[8..16].copy_from_slice(&(2.5 * disp).to_le_bytes());
            server.say(&answer);
            remote.collect(Nanos(0), &mut into).unwrap();
            assert_eq!((into.disp[0], into.force[0]), (disp, 2.5 * disp));
            remote.accepted(k).unwrap();
            assert_eq!(double(&server.hear(8 * N), 0), 5.0);
        }
        remote.retire(Retirement::Orderly);
        assert_eq!(double(&server.hear(8 * N), 0), 99.0);
    }
}
