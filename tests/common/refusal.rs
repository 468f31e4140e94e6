//! A mistake in a test file, and what must be said about it.

use super::{FRAME, Said, run, say, write};

/// A structure given by matrices, in free vibration.
pub const MATRICES: &str = r#"[time]
rate_hz = 100
duration_s = 1
clock = "simulated"

[structure]
initial_displacement_m = [0.01, 0.0]

[structure.matrices]
mass = [[1000, 0], [0, 1000]]
stiffness = [[2e5, -1e5], [-1e5, 1e5]]
damping = [[100, 0], [0, 100]]

[integrator]
lambda = 4
"#;

pub const SINE: &str = "sine]\namplitude = 3.0\nfrequency_hz = 2.0";

/// [`FRAME`] with a record for its ground.
pub fn with_record(name: &str) -> String {
    FRAME.replace(SINE, &format!("file]\npath = \"{name}\""))
}

/// A record of 0.2 s at 100 Hz in the form of PEER, with a header line of the caller's choice.
pub fn peer(counts: &str, values: &str) -> String {
    format!(
        "PEER NGA STRONG MOTION DATABASE RECORD\nSomewhere\nACCELERATION TIME SERIES IN UNITS OF G\n{counts}\n{values}\n"
    )
}

pub fn plain(said: &Said) {
    assert_eq!(said.code, Some(2), "{}", said.stderr);
    assert_eq!(said.stdout, "");
    for word in ["panicked", "RUST_BACKTRACE", "error: error"] {
        assert!(!said.stderr.contains(word), "{}", said.stderr);
    }
}

/// The command refused the file, and its message says all `words`.
#[track_caller]
pub fn refusal(said: &Said, words: &[&str]) {
    assert_eq!(said.code, Some(2), "{}", said.stdout);
    for word in words {
        let stderr = &said.stderr;
        assert!(stderr.contains(word), "no {word:?} in\n{stderr}");
    }
}

/// The picture shows `line` of the test file with carets under exactly `under`, and says all `words`.
#[track_caller]
pub fn pictured(stderr: &str, text: &str, line: &str, under: &str, words: &[&str]) {
    let number = text
        .lines()
        .position(|l| l == line)
        .expect("a line of the test file")
        + 1;
    let column = line.rfind(under).expect("a part of the line") + 1;
    assert!(
        stderr.contains(&format!("test.toml:{number}:{column}\n")),
        "{stderr}"
    );
    let mut shown = stderr.lines();
    let source = shown.find(|shown| {
        let number = format!("{number} |");
        shown.trim_start().starts_with(&number) && shown.ends_with(line)
    });
    let margin = source.expect(stderr).len() - line.len();
    let carets = shown.next().expect(stderr);
    let expected = format!(
        "{}{}",
        " ".repeat(margin + column - 1),
        "^".repeat(under.len())
    );
    let found: String = carets
        .chars()
        .map(|c| if c == '|' { ' ' } else { c })
        .collect();
    assert!(found.starts_with(&expected), "{stderr}");
    assert!(!found[expected.len()..].starts_with('^'), "{stderr}");
    for word in words {
        assert!(stderr.contains(word), "no {word:?} in\n{stderr}");
    }
}

/// Both commands refuse `text`, which may name `files`, with the same picture; no run folder is made.
#[track_caller]
pub fn refused(text: &str, files: &[(&str, &str)], line: &str, under: &str, words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        write(folder.path(), name, bytes);
    }
    let test = write(folder.path(), "test.toml", text);
    let out = folder.path().join("out");
    let checked = say(["check".as_ref(), test.as_os_str()]);
    let ran = run(&test, &out, &[]);
    for said in [&checked, &ran] {
        plain(said);
        pictured(&said.stderr, text, line, under, words);
    }
    assert_eq!(checked.stderr, ran.stderr);
    assert!(!out.exists(), "a run folder was made");
}

/// [`FRAME`] or [`MATRICES`] with one line replaced, which the picture must show.
#[track_caller]
pub fn wrong_line(text: &str, right: &str, wrong: &str, under: &str, words: &[&str]) {
    assert!(text.contains(right), "{right}");
    refused(&text.replacen(right, wrong, 1), &[], wrong, under, words);
}
