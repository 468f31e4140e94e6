//! Mistakes in `[specimen.link]` and in the file of a server are shown at their place, before anything is connected.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

use crate::common::test_file::TestFile;
use crate::link_common::{ONE_AXIS, ONE_AXIS_LAW, linked, test_file, write};
use gusset_config::{self as config, Offer};
use gusset_setup as setup;

/// The error of a test with these keys in its link and its specimen.
fn complaint(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.toml");
    match config::parse(&path, text.to_owned(), &[]).and_then(|loaded| setup::build(&loaded)) {
        Ok(_) => String::new(),
        Err(error) => error.to_string(),
    }
}

fn shows(text: &str, part: &str) {
    assert!(text.contains(part), "{part:?} is not in:\n{text}");
}

#[test]
fn good_link_is_built_without_a_connection() {
    assert_eq!(complaint(&linked(10, "127.0.0.1:1", "")), "");
    assert_eq!(
        complaint(&linked(10, "[::1]:4823", "coupling = \"lockstep\"")),
        ""
    );
}

#[test]
fn numbers_out_of_range_are_shown_at_keys() {
    let with = |keys: &str| complaint(&linked(10, "127.0.0.1:1", keys));
    for (keys, words) in [
        ("reply_timeout_s = 0", "reply_timeout_s"),
        ("connect_timeout_s = -1", "connect_timeout_s"),
        ("watchdog_s = 0", "watchdog_s"),
        ("watchdog_s = 3601", "watchdog_s` must be at most 3600 s"),
        ("sample_after = 1.5", "a fraction of the tick, at most 1"),
        ("max_stale = 0", "must be 1 or greater"),
        ("spin_us = -1", "must be zero or greater"),
        ("axis_names = [\"a\", \"b\"]", "2 names for 1 axes"),
        ("axis_names = [\"\"]", "cannot name an axis"),
        ("transport = \"tpc\"", "tcp"),
        ("key_file = \"none.key\"", "cannot be read"),
        ("colour = 1", "colour"),
    ] {
        shows(&with(keys), words);
    }
    for (address, words) in [
        ("rig", "has no port"),
        ("127.0.0.1:4x", "has no port from 1 to 65535"),
        ("rig:", "has no port from 1 to 65535"),
        ("rig:0", "has no port from 1 to 65535"),
        ("rig:65536", "has no port from 1 to 65535"),
        (":4823", "has no host name"),
        ("2001:db8::7:4823", "has no host name"),
        ("[rig]:4823", "has no host name"),
    ] {
        shows(&complaint(&linked(10, address, "")), words);
    }
}

#[test]
fn position_comes_from_the_link_or_the_file() {
    let with = |keys: &str| {
        let text = linked(10, "127.0.0.1:1", keys);
        complaint(&text.without("specimen.0.link.computed"))
    };
    const ASKS: &str = "is unknown";
    const TELLS: &str = "its position";
    for (keys, words) in [
        ("protocol = \"openfresco-adapter\"", ASKS),
        ("protocol = \"openfresco-shadow\"", ASKS),
        ("protocol = \"openfresco\"", ASKS),
        (
            "protocol = \"openfresco\"\nopenfresco = { server = \"site\", answer_signals = [0, 0, 0, 1, 0] }",
            ASKS,
        ),
        (
            "protocol = \"openfresco\"\nopenfresco = { answer_signals = [1, 1, 1, 1, 1] }\nstands_at_m = [0]",
            TELLS,
        ),
        (
            "protocol = \"openfresco\"\nopenfresco = { server = \"site\" }\nstands_at_m = [0]",
            TELLS,
        ),
        ("stands_at_m = [0, 0]", "2 displacements for 1 axes"),
        (
            "protocol = \"openfresco-shadow\"\nstands_at_m = [0, 0]",
            "2 displacements for 1 axes",
        ),
        (
            "protocol = \"openfresco-shadow\"\nstands_at_m = [nan]",
            "stands_at_m",
        ),
    ] {
        shows(&with(keys), words);
    }
    for keys in [
        "protocol = \"openfresco-shadow\"\nstands_at_m = [-0.02]",
        "protocol = \"openfresco\"\nstands_at_m = [0.01]",
        "protocol = \"openfresco\"\nopenfresco = { answer_signals = [1, 1, 1, 1, 1] }",
        "protocol = \"openfresco\"\nopenfresco = { server = \"site\" }",
        // A specimen behind the native protocol may report its position, but need not.
        "",
        "stands_at_m = [0.01]",
    ] {
        assert_eq!(with(keys), "", "{keys}");
    }
    let computed = linked(10, "127.0.0.1:1", "protocol = \"openfresco-shadow\"");
    assert!(computed.contains("computed = true"));
    assert_eq!(complaint(&computed), "");
}

#[test]
fn displacement_keys_need_the_signal() {
    let said = |table: &str, openfresco: &str| {
        let link = format!("protocol = \"openfresco\"\n{openfresco}");
        let text = linked(10, "127.0.0.1:1", &link);
        complaint(&text.with(&format!("[specimen]\n{table}")))
    };
    for (key, table) in [
        (
            "measured_disp_m",
            "limits.measured_disp_m.trip = [-0.1, 0.1]",
        ),
        ("sensor_disp_m", "limits.sensor_disp_m.trip = [-0.1, 0.1]"),
        ("following_error_m", "limits.following_error_m.trip = 0.001"),
        ("stuck_ticks", "limits.stuck_ticks.trip = 100"),
        ("added_energy_j", "limits.added_energy_j.trip = 1.0"),
        ("lag_s", "limits.lag_s.trip = 0.01"),
        ("gain_error", "limits.gain_error.trip = 0.1"),
        ("lag_s", "axis = [{ limits.lag_s.trip = 0.01 }]"),
        ("zero_disp", "axis = [{ zero_disp = \"relative\" }]"),
        ("ats", "compensation.ats = { order = 1 }"),
    ] {
        let refused = format!("`{key}` needs a measured displacement");
        shows(&said(table, ""), &refused);
        shows(&said(table, ""), "answer_signals = [1, 1, 1, 1, 1]");
        for measures in [
            "openfresco = { answer_signals = [1, 1, 1, 1, 1] }",
            "openfresco = { server = \"site\" }",
        ] {
            let found = said(table, measures);
            assert!(!found.contains("a measured"), "{key}: {found}");
        }
    }
    assert_eq!(said("limits.force_step_n.trip = 10", "probe_m = 1e-4"), "");
}

/// A test key that uses all specimens is refused where none of them measures, and gives a warning where some do not.
#[test]
fn displacement_test_keys_spare_force_links() {
    let text = |key: &str| {
        let text = linked(
            10,
            "127.0.0.1:1",
            "protocol = \"openfresco\"\nprobe_m = 1e-4",
        );
        text.with(&format!("[safety]\n{key}"))
    };
    for key in ["delay_used", "added_energy_share"] {
        let floor = if key == "delay_used" {
            ""
        } else {
            ", floor_j = 1"
        };
        let alone = text(&format!("{key} = {{ warn = 0.5{floor} }}"));
        let found = complaint(&alone);
        shows(&found, &format!("`{key}`"));
        shows(&found, "measured displacement");
        shows(&found, "\"column\"");
        let beside = format!("{alone}\n[[specimen]]\nname = \"other\"\nstorey = 2\n{ONE_AXIS_LAW}");
        let loaded = config::parse(Path::new("test.toml"), beside, &[]).unwrap();
        let warned = gusset_config::Diagnostics(loaded.warnings).to_string();
        shows(&warned, &format!("`{key}`"));
        shows(&warned, "\"column\"");
        let measures = alone.with("specimen.link.openfresco.server = 'site'");
        let found = complaint(&measures);
        assert!(!found.contains("a measured"), "{found}");
    }
}

#[test]
fn signal_counts_are_zero_or_number_of_axes() {
    let said = |openfresco: &str, more: &str| {
        let link = format!("protocol = \"openfresco\"\nopenfresco = {{ {openfresco} }}\n{more}");
        complaint(&linked(10, "127.0.0.1:1", &link))
    };
    for signals in ["[2, 0, 0, 2, 0]", "[1, 0, 0, 2, 0]", "[1, 2, 0, 1, 0]"] {
        let found = said(&format!("answer_signals = {signals}"), "");
        shows(&found, "`answer_signals` is 2");
        shows(&found, "of axes");
    }
    let found = said("answer_signals = [1, 1, 1, 1, 1]", "stands_at_m = [0]");
    shows(&found, "`openfresco.answer_signals` gives");
    assert!(!found.contains("only for"), "{found}");
}

#[test]
fn link_specimen_needs_an_estimate() {
    let text = linked(10, "127.0.0.1:1", "");
    let silent = text.without("specimen.0.stiffness_n_per_m");
    shows(&complaint(&silent), "`stiffness_n_per_m` is missing");
    let softening = text.with("specimen.hardening_bound = 0.5");
    shows(&complaint(&softening), "1 or greater");
    let inches = text.with("[[specimen.axis]]\nunit_disp = 'in'");
    shows(&complaint(&inches), "`unit_disp`");
    shows(&complaint(&inches), "protocol = \"openfresco…\"");
    shows(&complaint(&inches), "mm");
    let burst = text.with("timing.on_miss = 'catch_up'");
    shows(&complaint(&burst), "faster");
    let allowed = burst.with("timing.catch_up_remote = true");
    shows(&complaint(&allowed), "`timing.catch_up_remote` was removed");
}

#[test]
fn hardening_bound_enters_stability_proof() {
    let limit = |bound: &str| {
        let text = linked(10, "127.0.0.1:1", "").with(&format!(
            "specimen.hardening_bound = {bound}\nintegrator = {{ lambda = 4, allow_unstable_lambda = true }}"
        ));
        let loaded = config::parse(Path::new("test.toml"), text, &[]).unwrap();
        let structure = setup::build(&loaded).unwrap().facts.structure.unwrap();
        structure.choice().unwrap().limit
    };
    // Ω² = 4e5 · 20000 / 1000 · 1e-6 = 8 at the bound, above the 4 that even λ = ∞ would bear.
    assert!(limit("1.0").is_none());
    assert!(limit("20000.0").is_some());
}

fn served(text: &str, name: Option<&str>) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "serve.toml", text);
    setup::load_served(&path, name)
        .map(|_| ())
        .map_err(|error| error.to_string())
}

#[test]
fn specimens_file_or_test_can_be_served() {
    let one = format!("[[specimen]]\nname = \"a\"\n{ONE_AXIS_LAW}");
    let two = format!("{one}[[specimen]]\nname = \"b\"\n{ONE_AXIS_LAW}");
    assert_eq!(served(&one, None), Ok(()));
    assert_eq!(served(&two, Some("b")), Ok(()));
    let test = test_file(10, &format!("{ONE_AXIS}{ONE_AXIS_LAW}"));
    assert_eq!(served(&test, Some("column")), Ok(()));
    let with_table = format!("[serve]\nlisten = \"127.0.0.1:0\"\ntransport = \"udp\"\n{one}");
    assert_eq!(served(&with_table, None), Ok(()));
    shows(&served(&two, None).unwrap_err(), "--specimen NAME");
    shows(&served(&two, None).unwrap_err(), "a, b");
    shows(&served(&one, Some("c")).unwrap_err(), "\"c\"");
    shows(
        &served("[serve]\n", None).unwrap_err(),
        "has no `[[specimen]]`",
    );
    shows(
        &served(&one.replace("gamma", "gama"), None).unwrap_err(),
        "gama",
    );
    shows(
        &served(&format!("[serve]\nlisen = \"x\"\n{one}"), None).unwrap_err(),
        "`listen`",
    );
    let inches = one.replace(
        "[specimen.law",
        "[[specimen.axis]]\nunit_force = \"lbf\"\n[specimen.law",
    );
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "serve.toml", &inches);
    let served = setup::load_served(&path, None).unwrap();
    assert!(served.source.check_protocol(Offer::OpenFresco).is_ok());
    let refused = served.source.check_protocol(Offer::Gusset).unwrap_err();
    shows(&refused.to_string(), "`unit_force`");
}

/// A served specimen has no structure: the client commands the displacements.
#[test]
fn served_storey_leads_to_rows() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("[[specimen]]\nname = \"column\"\nstorey = 1\n{ONE_AXIS_LAW}");
    let path = write(folder.path(), "served.toml", &text);
    let found = setup::load_served(&path, None).unwrap_err().to_string();
    shows(&found, "`storey`");
    shows(&found, "`rows`");
    assert!(!found.contains("is prescribed"), "{found}");
}

#[test]
fn live_page_on_a_specimens_port_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let text = linked(10, &address.to_string(), "probe = \"none\"\n");
    let text = text.with("time.clock = 'simulated'");
    let file = write(folder.path(), "test.toml", &text);
    let mut command = crate::link_common::gusset();
    command
        .arg("run")
        .arg(file)
        .arg("--live")
        .arg(address.to_string());
    command.arg("--out").arg(folder.path().join("run"));
    let output = crate::link_common::finish(command);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    for words in ["--live", "specimen `column`", &address.to_string()] {
        shows(&said, words);
    }
    assert!(!folder.path().join("run").exists());
    listener.set_nonblocking(true).unwrap();
    assert!(listener.accept().is_err(), "something connected");
}

#[test]
fn server_on_a_port_in_use_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let file =
        format!("[serve]\nlisten = \"{address}\"\n[[specimen]]\nname = \"column\"\n{ONE_AXIS_LAW}");
    let path = write(folder.path(), "rig.toml", &file);
    for protocol in ["gusset", "openfresco"] {
        let mut command = crate::link_common::gusset();
        command
            .arg("serve")
            .arg(&path)
            .args(["--protocol", protocol]);
        let output = crate::link_common::finish(command);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        for words in [
            address.as_str(),
            "--listen",
            "`serve.listen`",
            "`gusset serve`",
        ] {
            shows(&said, words);
        }
    }
}

/// The exit code of `gusset serve` with these options, or none if it serves, and its output.
fn serve(file: &Path, options: &[&str]) -> (Option<i32>, String) {
    let mut command = crate::link_common::gusset();
    command.arg("serve").arg(file).args(options);
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    stdout.read_line(&mut line).unwrap();
    if line.starts_with("listening on ") {
        child.kill().unwrap();
        child.wait().unwrap();
        return (None, line);
    }
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), said)
}

#[test]
fn gateway_on_its_specimens_port_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    // Two ports that are free.
    let free = || std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let ports = [free(), free()].map(|listener| listener.local_addr().unwrap().port());
    let [port, another] = ports.map(|port| format!("localhost:{port}"));
    let address = port.replace("localhost", "127.0.0.1");
    let write = |name: &str, listen: &str, link: &str| {
        let text = crate::link_common::gateway(&address, "stiffness_n_per_m = 4e5\n", link);
        let table = format!("[serve]\nlisten = \"{listen}\"\n[[specimen]]");
        let text = text.replacen("[[specimen]]", &table, 1);
        write(folder.path(), name, &text)
    };
    let same = write("same.toml", &port, "");
    let other = write("other.toml", &another, "");
    let same_udp = write("udp.toml", &port, "transport = \"udp\"\n");
    for (file, options, key) in [
        (&same, &[][..], "listen = "),
        (&same, &["--protocol", "openfresco"], "listen = "),
        (&other, &["--listen", address.as_str()], "--listen"),
        (&same_udp, &["--transport", "udp"], "listen = "),
    ] {
        let (code, said) = serve(file, options);
        assert_eq!(code, Some(2), "{said}");
        for words in ["have the same port", "`column`", key] {
            shows(&said, words);
        }
    }
    // The option replaces the key of the file. A TCP port is not a UDP port.
    for (file, options) in [
        (&same, &["--listen", "127.0.0.1:0"][..]),
        (&same_udp, &[]),
        (&same, &["--transport", "udp"]),
    ] {
        let (code, said) = serve(file, options);
        assert_eq!(code, None, "{said}");
    }
}
