//! The report of a run, as a person sees it: pictures are there and not empty, all of them zoom together, a printer and a
//! reader without scripts get the same pictures, and a title is never executed.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde_json::Value;

use super::stage::{assert_quiet, visit};
use crate::common::{FRAME, PATIENT, completed, write};

/// The report of one short run with a title that would like to be a script, made once.
fn report() -> &'static Path {
    static MADE: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, page) = MADE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let title = "title = \"<script>document.title='taken'</script><b>&\"\n";
        let text = FRAME.replacen("title = \"Frame\"\n", title, 1);
        let test = write(
            folder.path(),
            "test.toml",
            &text.replace("duration_s = 0.5", "duration_s = 6"),
        );
        let out = folder.path().join("run");
        completed(&test, &out, &[]);
        (folder, out.join("report.html"))
    });
    page
}

fn visited(page: &Path, how: &str) -> Option<Value> {
    let address = format!("file://{}", page.display());
    let shots = std::env::var("GUSSET_BROWSER_SHOTS").unwrap_or_default();
    let shot = format!("{shots}/report-{how}.png");
    let shot = if shots.is_empty() { "" } else { &shot };
    let found = visit("report.mjs", &[&address, how, shot])?;
    assert_quiet(&found);
    assert_eq!(found["empty"], 0, "a frame round nothing: {found:#}");
    Some(found)
}

fn seen(how: &str) -> Option<Value> {
    let found = visited(report(), how)?;
    assert_eq!(
        found["title"],
        "<script>document.title='taken'</script><b>&"
    );
    assert_eq!(found["wide"], false, "nothing sticks out sideways");
    assert_eq!(
        found["unnamed"], 0,
        "every picture has a name for a screen reader"
    );
    Some(found)
}

/// The part of its lines that each history shows.
fn parts(shown: &Value) -> Vec<&str> {
    let all = shown.as_array().unwrap().iter();
    all.map(|one| one["part"].as_str().unwrap()).collect()
}

#[test]
fn plots_zoom_together_and_come_back() {
    for how in ["light", "dark"] {
        let Some(found) = seen(how) else { return };
        assert_eq!(found["scripts"], 1, "one script, our own");
        let before = found["before"].as_array().unwrap();
        // Displacement, floor acceleration, drift, shear, energy and ground at least.
        assert!(before.len() >= 6, "{found:#}");
        assert!(before.iter().all(|one| one["inked"] == true), "{found:#}");
        let whole = parts(&found["before"]);
        for (near, of) in [
            ("zoomed", &whole),
            ("nearer", &whole),
            ("moved", &parts(&found["nearer"])),
        ] {
            let near = parts(&found[near]);
            assert!(
                of.iter().zip(&near).all(|(a, b)| a != b),
                "every history follows: {found:#}"
            );
        }
        for same in ["after", "again"] {
            assert_eq!(parts(&found[same]), whole, "the whole test again");
        }
        assert_ne!(found["loop"][0], found["loop"][1], "a loop is zoomed alone");
        let background = found["background"].as_str().unwrap();
        assert_eq!(
            background == "rgb(255, 255, 255)",
            how == "light",
            "{background}"
        );
    }
}

#[test]
fn values_and_differences_are_read() {
    let Some(found) = seen("light") else { return };
    let text = |key: &str| found[key].as_str().unwrap();
    assert!(text("value").starts_with("test time ") && text("value").contains(": "));
    assert!(
        text("cursors").contains('Δ') && text("cursors").contains('→'),
        "{found:#}"
    );
    let csv = found["csv"].as_array().unwrap();
    assert!(
        csv[0]
            .as_str()
            .unwrap()
            .starts_with("series,\"test time (s)\",\""),
        "{found:#}"
    );
    assert!(
        csv.len() > 50 && csv[1].as_str().unwrap().split(',').count() == 3,
        "{found:#}"
    );
}

#[test]
fn pictures_work_on_paper_without_scripts() {
    let Some(plain) = seen("noscript") else {
        return;
    };
    let Some(printed) = seen("print") else { return };
    let all = plain["pictures"].as_u64().unwrap();
    assert!(all >= 7, "{plain:#}");
    // A folded picture is shown neither by the screen nor by paper.
    assert_eq!(printed["printed"]["pictures"], plain["unfolded"]);
    assert_eq!(printed["printed"]["tools"], 0);
}

#[test]
fn a_history_of_one_point_keeps_its_picture() {
    // Two cycles of one amplitude: one window of four periods, so errors in moving windows have one point.
    let text = "title = \"Short\"\n[time]\nrate_hz = 256\nduration_s = 4\nclock = \"simulated\"\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"column\"\nease_in_s = 0.5\n\
        signal.cyclic = { amplitudes = [0.002], cycles_per_amplitude = 2, shape = \"sine\", frequency_hz = 0.5 }\n\
        [[specimen]]\nname = \"column\"\nlaw.linear = { stiffness_n_per_m = 1e5 }\n\
        transfer.actuator.first_order = { time_constant_s = 0.006 }\n";
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    completed(&write(folder.path(), "test.toml", text), &out, &[]);
    let page = out.join("report.html");
    let markup = std::fs::read_to_string(&page).unwrap();
    let figures = |part: &str| markup.matches(part).count();
    let windows = "Amplitude error in moving windows";
    assert!(figures(windows) > 0, "no history of one point");
    for how in ["look", "print", "noscript"] {
        let Some(found) = visited(&page, how) else {
            return;
        };
        let pictures = |found: &Value| found["pictures"].as_u64().unwrap();
        assert!(pictures(&found) >= 2, "{found:#}");
    }
}

/// A virtual test of 20 s at 1 kHz whose actuator lags.
fn long() -> &'static Path {
    static MADE: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let (_, page) = MADE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let text = FRAME
            .replace("rate_hz = 200", "rate_hz = 1000")
            .replace("duration_s = 0.5", "duration_s = 20")
            .replace(
                "storey = 1\n",
                "storey = 1\ntransfer.actuator.first_order = { time_constant_s = 0.004 }\n\
                 compensation.polynomial = { order = 3, delay_s = 0.003 }\n",
            );
        let test = write(folder.path(), "test.toml", &text);
        let out = folder.path().join("run");
        completed(&test, &out, &[]);
        (folder, out.join("report.html"))
    });
    page
}

fn texts(found: &Value) -> Vec<&str> {
    let all = found.as_array().unwrap().iter();
    all.map(|text| text.as_str().unwrap()).collect()
}

#[test]
fn page_of_twenty_seconds_is_short() {
    let page = long();
    let bytes = std::fs::metadata(page).unwrap().len();
    assert!(bytes <= 1_500_000, "{bytes}");
    let Some(found) = visited(page, "layout") else {
        return;
    };
    let sections = texts(&found["sections"]);
    let order = [
        "Response",
        "Tracking",
        "Energy",
        "Timing",
        "Model",
        "Ground motion",
        "Limits",
        "Events",
        "Machine and configuration",
    ];
    assert_eq!(sections, order);
    let tops = found["tops"].as_array().unwrap().iter();
    let tops: Vec<f64> = tops.map(|top| top.as_f64().unwrap()).collect();
    assert!(tops.is_sorted(), "{tops:?}");
    assert!(found["headline"].as_f64().unwrap() < tops[0]);
    assert_eq!(found["open"], 0, "{found:#}");
    assert!(found["folded"].as_u64().unwrap() >= 5, "{found:#}");
    assert_eq!(found["hidden"], 0, "{found:#}");
    assert!(found["printed"].as_u64().unwrap() <= 4, "{found:#}");
    assert_eq!(found["borders"], 0, "{found:#}");
    assert_eq!(found["bare"], 0, "a picture without title and axes");
    assert_eq!(texts(&found["overlaps"]), [""; 0]);
}

#[test]
fn timing_histogram_labels_do_not_overlap() {
    let folder = tempfile::tempdir().unwrap();
    let text = FRAME.replace("duration_s = 0.5", "duration_s = 2");
    let test = write(folder.path(), "test.toml", &text);
    let out = folder.path().join("run");
    let patient = [&["--clock", "real"][..], &PATIENT].concat();
    completed(&test, &out, &patient);
    let page = out.join("report.html");
    let markup = std::fs::read_to_string(&page).unwrap();
    assert!(markup.contains(">Wake-up lateness</text>") || markup.contains("Wake-up lateness"));
    let Some(found) = visited(&page, "layout") else {
        return;
    };
    assert_eq!(texts(&found["overlaps"]), [""; 0]);
}

#[test]
fn every_colour_changes_in_the_dark() {
    let Some(light) = visited(report(), "layout") else {
        return;
    };
    let Some(dark) = visited(report(), "layout-dark") else {
        return;
    };
    let (light, dark) = (texts(&light["inks"]), texts(&dark["inks"]));
    assert_eq!(light[0], "#ffffff");
    assert!(
        light.iter().zip(&dark).all(|(a, b)| a != b),
        "{light:?} {dark:?}"
    );
}
