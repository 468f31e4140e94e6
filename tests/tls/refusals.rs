//! Refusals of TLS, each with the file or end that is wrong: before anything moves, exit code 3. An unusable file of the user is a
//! mistake of the configuration, exit code 2.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;

use crate::link_common::{
    ONE_AXIS, ONE_AXIS_LAW, Served, finish, gusset, linked, run, summary, test_file, write,
};
use crate::tls_common::{Authority, EXPIRED, FUTURE, LOCAL, VALID};
use gusset_record::summary::Status;

const STEPS: u32 = 50;
const TLS: &[&str] = &["--transport", "tls"];

fn local() -> String {
    test_file(STEPS, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"))
}

fn over_tls(address: &str, keys: &str) -> String {
    linked(STEPS, address, &format!("transport = \"tls\"\n{keys}"))
}

/// Runs a test that must fail to connect; its reason.
fn unmoved(folder: &Path, name: &str, text: &str) -> String {
    let (code, said) = run(folder, name, text);
    assert_eq!(code, 3, "{said}");
    let summary = summary(folder, name);
    assert_eq!((summary.status, summary.steps), (Status::Failed, 0));
    assert!(summary.reason.ends_with("was moved"), "{}", summary.reason);
    summary.reason
}

fn shows(text: &str, part: &str) {
    assert!(text.contains(part), "{part:?} is not in: {text}");
}

/// One end has an unsuitable certificate; checks the messages of the controller and of the server.
fn with(spoil: impl Fn(&Authority, &Path), controller: &str, server: &str) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let authority = crate::tls_common::make(folder);
    spoil(&authority, folder);
    let served = Served::start(folder, &local(), TLS);
    let reason = unmoved(folder, "run", &over_tls(&served.address, ""));
    shows(&reason, controller);
    served.hears(server);
}

#[test]
fn expired_certificate_shows_its_day() {
    let day = "its certificate expired on 2003-01-01 00:00:00 UTC";
    with(
        |authority, folder| authority.issue(folder, "client", &["controller"], EXPIRED),
        "it refuses us: our certificate has expired",
        day,
    );
    with(
        |authority, folder| authority.issue(folder, "server", LOCAL, EXPIRED),
        day,
        "it refuses us: our certificate has expired",
    );
}

#[test]
fn future_certificate_suggests_the_clock() {
    let day = "its certificate is not valid before 2098-01-01 00:00:00 UTC: is the clock";
    with(
        |authority, folder| authority.issue(folder, "client", &["controller"], FUTURE),
        "it refuses us: our certificate has expired, or is not valid yet",
        day,
    );
    with(
        |authority, folder| authority.issue(folder, "server", LOCAL, FUTURE),
        day,
        "not valid yet, by its clock",
    );
}

#[test]
fn foreign_authority_refused_at_both_ends() {
    let stranger = Authority::named("another laboratory");
    with(
        |_, folder| stranger.issue(folder, "client", &["controller"], VALID),
        "it refuses us: our certificate is not signed by an authority that it trusts",
        "its certificate is not signed by an authority that is trusted here",
    );
    with(
        |_, folder| stranger.issue(folder, "server", LOCAL, VALID),
        "its certificate is not signed by an authority that is trusted here",
        "it refuses us: our certificate is not signed by an authority that it trusts",
    );
}

#[test]
fn authority_with_only_the_name_is_refused() {
    let anew = Authority::new();
    let words = "another authority";
    with(
        |_, folder| anew.issue(folder, "client", &["controller"], VALID),
        "another one of this name",
        words,
    );
    with(
        |_, folder| anew.issue(folder, "server", LOCAL, VALID),
        words,
        "another one of this name",
    );
}

#[test]
fn client_certificate_does_not_suit_server() {
    with(
        |authority, folder| {
            authority.issue(folder, "other", LOCAL, VALID);
            for end in ["crt", "key"] {
                std::fs::rename(
                    folder.join(format!("other.{end}")),
                    folder.join(format!("server.{end}")),
                )
                .unwrap();
            }
        },
        "its certificate is for another purpose",
        "it refuses us",
    );
}

#[test]
fn other_host_name_shows_both_names() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let authority = crate::tls_common::make(folder);
    authority.issue(folder, "server", &["rig.example", "192.0.2.7"], VALID);
    let served = Served::start(folder, &local(), TLS);
    let table = |keys: &str| over_tls(&served.address, &format!("[specimen.link.tls]\n{keys}"));
    let reason = unmoved(folder, "other", &table(""));
    shows(&reason, "127.0.0.1 wanted");
    shows(&reason, "rig.example");
    shows(&reason, "`server_name`");
    for (name, keys) in [
        ("named", "server_name = \"rig.example\""),
        ("addressed", "server_name = \"192.0.2.7\""),
        ("unchecked", "check_name = false"),
    ] {
        let (code, said) = run(folder, name, &table(keys));
        assert_eq!(code, 0, "{said}");
    }
    // Without the name the authority is still checked.
    Authority::named("another laboratory").issue(folder, "server", LOCAL, VALID);
    let served = Served::start(folder, &local(), TLS);
    let text = over_tls(&served.address, "[specimen.link.tls]\ncheck_name = false");
    let reason = unmoved(folder, "forged", &text);
    shows(&reason, "an authority");
}

/// A client of TLS that shows no certificate.
fn bare_client(folder: &Path, address: &str) -> std::io::Result<usize> {
    use rustls::pki_types::{CertificateDer, pem::PemObject};
    let mut roots = rustls::RootCertStore::empty();
    let ca = std::fs::read(folder.join("client_ca.crt")).unwrap();
    roots
        .add(CertificateDer::from_pem_slice(&ca).unwrap())
        .unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = rustls::ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let mut tls =
        rustls::ClientConnection::new(Arc::new(config), "127.0.0.1".try_into().unwrap()).unwrap();
    let mut socket = TcpStream::connect(address).unwrap();
    let mut stream = rustls::Stream::new(&mut tls, &mut socket);
    stream.write_all(&[0xff; 100]).unwrap();
    stream.read(&mut [0; 100])
}

#[test]
fn client_without_certificate_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let served = Served::start(folder, &local(), TLS);
    let error = bare_client(folder, &served.address)
        .unwrap_err()
        .to_string();
    assert!(error.contains("CertificateRequired"), "{error}");
    served.hears("TLS: it showed no certificate, and one is required here");
}

#[test]
fn plain_and_tls_report_it_at_both_ends() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let served = Served::start(folder, &local(), TLS);
    let reason = unmoved(folder, "plain", &linked(STEPS, &served.address, ""));
    shows(&reason, "`transport = \"tls\"`");
    served.hears("TLS: it speaks no TLS: its end wants `transport = \"tls\"`");
    let mut browser = TcpStream::connect(&served.address).unwrap();
    browser
        .write_all(b"GET / HTTP/1.1\r\nHost: rig\r\n\r\n")
        .unwrap();
    served.hears("TLS: it speaks no TLS");
    drop(browser);

    let plain = Served::start(folder, &local(), &[]);
    let reason = unmoved(folder, "tls", &over_tls(&plain.address, ""));
    shows(&reason, "`transport = \"tcp\"`");
    plain.hears("it speaks TLS, and plain TCP is served here (--transport tls)");
    let (code, said) = run(folder, "after", &over_tls(&served.address, ""));
    assert_eq!(code, 0, "{said}");
}

#[test]
fn stalled_handshake_is_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let reason = unmoved(
        folder,
        "run",
        &over_tls(&address, "connect_timeout_s = 0.3"),
    );
    shows(&reason, "TLS handshake");
    // And the server: it drops a silent caller after its limit, and ignores one that closes.
    let served = Served::start(folder, &local(), TLS);
    let silent = TcpStream::connect(&served.address).unwrap();
    drop(TcpStream::connect(&served.address).unwrap());
    served.hears("no end of the TLS handshake within 5 s");
    drop(silent);
}

/// Exit code 2, and the messages, of a test and of a server with these files.
fn mistakes(spoil: impl Fn(&Authority, &Path, &str)) -> [String; 2] {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let authority = crate::tls_common::make(folder);
    spoil(&authority, folder, "client");
    spoil(&authority, folder, "server");
    let (code, test) = run(folder, "run", &over_tls("127.0.0.1:1", ""));
    assert_eq!(code, 2, "{test}");
    assert!(!folder.join("run").exists(), "nothing was begun");
    let file = write(folder, "serve.toml", &local());
    let mut command = gusset();
    command
        .arg("serve")
        .arg(file)
        .args(TLS)
        .args(["--listen", "127.0.0.1:0"]);
    let output = finish(command);
    assert_eq!(output.status.code(), Some(2));
    [test, String::from_utf8_lossy(&output.stderr).into_owned()]
}

#[test]
fn unusable_file_is_named_with_its_key() {
    type Spoil = fn(&Authority, &Path, &str);
    let cases: [(Spoil, &str, &str); 5] = [
        (
            |_, folder, end| std::fs::remove_file(folder.join(format!("{end}.crt"))).unwrap(),
            "certificate_file",
            ".crt cannot be read: No such file",
        ),
        (
            |_, folder, end| std::fs::remove_file(folder.join(format!("{end}_ca.crt"))).unwrap(),
            "ca_file",
            "_ca.crt cannot be read: No such file",
        ),
        (
            |_, folder, end| {
                write(folder, &format!("{end}.key"), "no key");
            },
            "key_file",
            "it holds no private key in PEM",
        ),
        (
            |_, folder, end| {
                let text = "-----BEGIN ENCRYPTED PRIVATE KEY-----\nAAAA\n-----END ENCRYPTED PRIVATE KEY-----\n";
                write(folder, &format!("{end}.key"), text);
            },
            "key_file",
            "its key is encrypted",
        ),
        (
            |authority, folder, end| {
                authority.issue(folder, "another", &["x"], VALID);
                std::fs::rename(
                    folder.join("another.key"),
                    folder.join(format!("{end}.key")),
                )
                .unwrap();
            },
            "key_file",
            "it is not the key of the certificate",
        ),
    ];
    for (spoil, key, words) in cases {
        let [test, server] = mistakes(spoil);
        for (said, end) in [(test, "client"), (server, "server")] {
            shows(&said, &format!("`{key}`"));
            shows(&said, words);
            shows(&said, &format!("/{end}"));
        }
    }
}

#[test]
fn table_says_who_needs_a_certificate() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let authority = Authority::new();
    authority.issue(folder, "server-of-mine", LOCAL, VALID);
    authority.issue(folder, "client", &["controller"], VALID);
    for ca in ["mine.crt", "client_ca.crt"] {
        authority.publish(folder, ca);
    }
    let serve = |protocol: &str, keys: &str| {
        let table = "certificate_file = \"server-of-mine.crt\"\nkey_file = \"server-of-mine.key\"\nca_file = \"mine.crt\"";
        format!(
            "[serve]\ntransport = \"tls\"\nprotocol = \"{protocol}\"\n[serve.tls]\n{table}\n{keys}\n\
             [[specimen]]\nname = \"column\"\n{ONE_AXIS_LAW}"
        )
    };
    let served = Served::start(folder, &serve("gusset", ""), &[]);
    let (code, said) = run(folder, "run", &over_tls(&served.address, ""));
    assert_eq!(code, 0, "{said}");
    // On this machine an OpenFresco client needs no certificate, as in OpenFresco, unless the table requires one.
    for (keys, words) in [
        ("", "let in"),
        ("client_certificate = \"required\"", "no certificate"),
    ] {
        let served = Served::start(folder, &serve("openfresco", keys), &[]);
        let heard = bare_client(folder, &served.address);
        assert_eq!(heard.is_err(), !keys.is_empty(), "{heard:?}");
        served.hears(words);
    }
    let file = write(
        folder,
        "open.toml",
        &serve("gusset", "client_certificate = \"optional\""),
    );
    let mut command = gusset();
    command.arg("serve").arg(file);
    let output = finish(command);
    assert_eq!(output.status.code(), Some(2));
    shows(&String::from_utf8_lossy(&output.stderr), "requires one");
}

#[test]
fn contradicting_tls_tables_are_mistakes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    crate::tls_common::make(folder);
    let (code, said) = run(
        folder,
        "a",
        &linked(STEPS, "127.0.0.1:1", "[specimen.link.tls]"),
    );
    assert_eq!(code, 2);
    shows(&said, "TLS only");
    let keys = "[specimen.link.tls]\nserver_name = \"no name\"";
    let (code, said) = run(folder, "b", &over_tls("127.0.0.1:1", keys));
    assert_eq!(code, 2);
    shows(&said, "host name");
    let file = write(folder, "serve.toml", &local());
    let mut command = gusset();
    command
        .arg("serve")
        .arg(file)
        .args(["--tls-key", "server.key"]);
    let output = finish(command);
    assert_eq!(output.status.code(), Some(2));
    shows(&String::from_utf8_lossy(&output.stderr), "--tls-key");
}
