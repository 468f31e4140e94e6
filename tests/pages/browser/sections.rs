//! Comparison, identification and verification as a person sees them: verdict, key figures, then sections in the order of
//! the report; a title and two named axes with units on every plot. A certificate is printed in the terminal and has no page.

use std::path::Path;

use serde_json::Value;

use super::stage::{assert_quiet, visit};
use crate::common::{FRAME, completed, gusset, write};

/// Sections of a page, after the checks that all pages share, in light and dark. `None` without a browser.
fn sections(page: &Path, name: &str, least_plots: usize) -> Option<Vec<String>> {
    let address = format!("file://{}", page.display());
    let mut sections = Vec::new();
    let mut colours = Vec::new();
    for scheme in ["light", "dark"] {
        let shots = std::env::var("GUSSET_BROWSER_SHOTS").unwrap_or_default();
        let shot = format!("{shots}/{name}-{scheme}.png");
        let shot = if shots.is_empty() { "" } else { &shot };
        let found = visit("sections.mjs", &[&address, scheme, shot])?;
        assert_quiet(&found);
        assert_eq!(found["wide"], false, "{name}: nothing sticks out sideways");
        assert_eq!(
            found["sheet"], true,
            "{name}: the style sheet of the report"
        );
        assert_eq!(found["borders"], 0, "{name}: a line beside a table");
        assert_eq!(found["open"], 0, "{name}: {found:#}");
        assert_eq!(found["overlaps"], serde_json::json!([]), "{name}");
        let plots = found["plots"].as_array().unwrap();
        assert!(plots.len() >= least_plots, "{name}: {found:#}");
        for plot in plots {
            for part in ["title", "across", "up"] {
                let texts = plot[part].as_array().unwrap();
                assert!(!texts.is_empty(), "{name}: no {part} in {plot:#}");
            }
        }
        let parts = found["parts"].as_array().unwrap();
        let top = |part: &Value| part[1].as_f64().unwrap();
        assert!(parts.is_sorted_by_key(top), "{name}: {parts:#?}");
        sections = parts
            .iter()
            .map(|part| part[0].as_str().unwrap().to_owned())
            .collect();
        colours.push(found["colours"].clone());
    }
    assert_ne!(colours[0], colours[1], "{name}: dark as light");
    let head = sections.drain(..3).collect::<Vec<_>>();
    assert_eq!(head, ["title", "headline", "tiles"], "{name}");
    Some(sections)
}

fn done(command: &str, arguments: &[&str]) {
    let output = gusset().arg(command).args(arguments).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command}: {stderr}");
}

#[test]
fn comparison_has_the_reports_sections() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = FRAME.replace("duration_s = 0.5", "duration_s = 4").replace(
        "storey = 1\n",
        "storey = 1\ntransfer.actuator.first_order = { time_constant_s = 0.004 }\n",
    );
    let stronger = text.replace("amplitude = 3.0", "amplitude = 4.0");
    let (first, second) = (at("first"), at("second"));
    completed(&write(folder.path(), "a.toml", &text), &first, &[]);
    completed(&write(folder.path(), "b.toml", &stronger), &second, &[]);
    let page = at("page.html");
    let paths = [&first, &second, &page].map(|path| path.to_str().unwrap());
    done("report", &[paths[0], paths[1], "--out", paths[2]]);
    let Some(sections) = sections(&page, "comparison", 5) else {
        return;
    };
    let order = [
        "Response",
        "Tracking",
        "Timing",
        "Model",
        "Differences by column",
    ];
    assert_eq!(sections, order);
    let markup = std::fs::read_to_string(page).unwrap();
    assert!(markup.contains("Hysteresis of storey"));
    for folded in ["Tracking indices", "Every column that differs"] {
        assert!(
            markup.contains(&format!("<details><summary>{folded}</summary>")),
            "{folded}"
        );
    }
}

#[test]
fn identification_shows_each_axis() {
    let folder = tempfile::tempdir().unwrap();
    let text = "title = \"Column\"\n[time]\nrate_hz = 256\nduration_s = 4\nclock = \"simulated\"\n\
        [[excitation.prescribed_displacement]]\nspecimen = \"column\"\n\
        signal.cyclic = { amplitudes = [0.002], cycles_per_amplitude = 2, shape = \"sine\", frequency_hz = 0.5 }\n\
        [[specimen]]\nname = \"column\"\nlaw.linear = { stiffness_n_per_m = 1e6 }\n\
        transfer.actuator.first_order = { time_constant_s = 0.006 }\n\
        limits.command_disp_m = { trip = [-0.05, 0.05] }\n";
    let test = write(folder.path(), "test.toml", text);
    let out = folder.path().join("run");
    let (test, run) = (test.to_str().unwrap(), out.to_str().unwrap());
    done("identify", &[test, "--out", run]);
    let page = out.join("identification/index.html");
    let Some(sections) = sections(&page, "identification", 4) else {
        return;
    };
    assert_eq!(sections, ["column, axis 1", "Method and files"]);
    let markup = std::fs::read_to_string(page).unwrap();
    assert!(markup.contains("class=\"verdict good\""));
}

#[test]
fn verification_shows_results_first() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("verify");
    let topics = ["fig-1", "fig-2", "eq-33", "fig-5", "example-4.1"];
    let arguments = [&topics[..], &["--quick", "--out", out.to_str().unwrap()]].concat();
    done("verify", &arguments);
    let Some(sections) = sections(&out.join("index.html"), "verification", 5) else {
        return;
    };
    assert_eq!(sections.first().unwrap(), "Results by topic");
    assert_eq!(sections.last().unwrap(), "Source");
    assert_eq!(sections.len(), topics.len() + 2, "{sections:?}");
}
