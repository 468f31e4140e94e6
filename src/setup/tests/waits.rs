//! Implausibly long waits, numbers that no count accepts, and texts with terminal codes.

use super::*;
use crate::build;

#[track_caller]
fn refused_as(text: &str, set: &str, parts: &[&str]) {
    let error = read(text, &[set]).unwrap_err().to_string();
    for part in parts {
        shows(&error, part);
    }
    assert_eq!(errors(&error), 1, "{error}");
}

const LINK: &str = "[specimen.link]\naddress = \"127.0.0.1:4823\"\n[specimen.limits]\n\
    command_disp_m = { trip = [-0.1, 0.1] }\nmeasured_force_n = { trip = [-1e4, 1e4] }\n";

fn linked() -> String {
    let law = GOOD.find("law = { bilinear").unwrap();
    format!("{}stiffness_n_per_m = 1e6\n{LINK}", &GOOD[..law])
}

#[test]
fn each_wait_has_a_maximum() {
    for (key, value, most) in [
        ("safety.zero_s", "1e6", "600 s"),
        ("safety.ease_s", "601", "600 s"),
        ("safety.ramp_s", "1e9", "3600 s"),
        ("record.queue_s", "1e7", "600 s"),
        ("record.checkpoint_s", "1e5", "3600 s"),
        ("certificate.trials", "4000000000", "1000000"),
    ] {
        refused_as(
            GOOD,
            &format!("{key}={value}"),
            &[&format!("`{key}`"), most],
        );
    }
    refused_as(
        GOOD,
        "timing.warmup_ticks=100000000",
        &["614400", "97656.25 s"],
    );
    refused_as(GOOD, "time.scale=1e7", &["9765.625 s"]);
    assert!(read(GOOD, &["time.scale=1e7", "time.clock=simulated"]).is_ok());
    let speed = read(
        GOOD,
        &[
            "safety.exit_speed_m_per_s=1e-9",
            "safety.at_end=zero_displacement",
        ],
    );
    shows(&speed.unwrap_err().to_string(), "1e-6 m/s");
    let newton = [
        "integrator.method=newmark_average",
        "integrator.newton_iterations=4000000000",
    ];
    shows(&read(GOOD, &newton).unwrap_err().to_string(), "10000");
}

#[test]
fn each_link_wait_has_a_maximum() {
    let text = linked();
    accepted(
        &text,
        &[
            "specimen.0.link.connect_timeout_s=3600",
            "specimen.0.link.watchdog_s=3600",
        ],
    );
    for (key, value, most) in [
        ("connect_timeout_s", "1e18", "3600 s"),
        ("reply_timeout_s", "3601", "3600 s"),
        ("watchdog_s", "3601", "3600 s"),
        ("probe_ramp_s", "1e4", "600 s"),
        ("spin_us", "1e7", "1000000 µs"),
    ] {
        let key_path = format!("`specimen[0].link.{key}`");
        let set = format!("specimen.0.link.{key}={value}");
        let error = read(&text, &[&set]).unwrap_err().to_string();
        shows(&error, &key_path);
        shows(&error, most);
    }
    // A watchdog shorter than the pause between two commands is refused.
    let error = read(&text, &["specimen.0.link.watchdog_s=1e-6"]).unwrap_err();
    shows(&error.to_string(), "`specimen[0].link.watchdog_s`");
}

#[test]
fn invalid_count_shows_its_range() {
    for (set, allowed, found) in [
        (
            "specimen.0.storey=1e30",
            "from 0 to 9223372036854775807",
            "found 1e30",
        ),
        (
            "specimen.0.storey=2.0",
            "from 0 to 9223372036854775807",
            "found 2.0",
        ),
        (
            "time.ticks_per_step=5000000000",
            "from 0 to 4294967295",
            "found 5000000000",
        ),
        ("timing.priority=300", "from 0 to 255", "found 300"),
        ("timing.priority=-1", "from 0 to 255", "found -1"),
    ] {
        refused_as(GOOD, set, &[allowed, found]);
    }
}

#[test]
fn endless_text_is_not_echoed_whole() {
    let digits = format!("1{}", "0".repeat(299));
    for (set, found) in [
        (format!("specimen.0.storey={digits}.0"), "found 1e299"),
        (format!("timing.spin_us=-{digits}.0"), "spin_us"),
        (format!("safety.zero_s={digits}.0"), "found 1e299"),
        (
            format!("specimen.0.storey='{}'", "ab ".repeat(500)),
            "(1500 characters)",
        ),
    ] {
        let error = match read(GOOD, &[&set]) {
            Err(error) => error,
            Ok(loaded) => build(&loaded).map(drop).unwrap_err(),
        };
        let text = error.to_string();
        shows(&text, found);
        // The picture cuts the line that it points at; a short echo follows the caret.
        let longest = text.lines().map(|line| line.chars().count()).max();
        assert!(longest < Some(300), "{text}");
    }
}

#[test]
fn terminal_codes_are_refused_or_spelt() {
    for key in ["title", "safety.unlimited"] {
        for c in ["\\u001b[2J", "\\u0007", "\\u202e", "\\u200b", "\\ufeff"] {
            let set = format!("{key}=\"a{c}b\"");
            refused_as(GOOD, &set, &[&format!("`{key}`")]);
        }
    }
    accepted(GOOD, &["title=\"Prüfling № 3 — µ\""]);
    let text = GOOD.replace("name = \"bottom\"", "name = \"a\\u001b[31mb\"");
    let raw = read(&text, &[]).unwrap_err().to_string();
    assert!(!raw.contains('\u{1b}'), "{raw:?}");
    shows(&raw, "cannot name");
    let driven = PRESCRIBED.replace("specimen = \"damper\"", "specimen = \"x\\u001b[31m\"");
    let error = read(&driven, &[]).unwrap_err().to_string();
    assert!(!error.contains('\u{1b}'), "{error:?}");
    shows(&error, "\\u{1b}[31m");
    let named = parse(Path::new("a\u{1b}[2J.toml"), "x".to_owned(), &[]).unwrap_err();
    assert!(!named.to_string().contains('\u{1b}'), "{named}");
    let unreadable = load(Path::new("no\u{1b}[2J.toml"), &[]).unwrap_err();
    assert!(!printable(&unreadable.to_string()).contains('\u{1b}'));
}
