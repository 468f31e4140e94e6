//! README of the project folder.

use crate::filed::filed;
use crate::run::Run;

/// Folder, category, what it holds.
pub(super) const CATEGORIES: [(&str, &str, &str); 9] = [
    (
        "global_model",
        "Global Model",
        "the test file as given (test.toml) and as resolved (resolved.toml), and copies of all files it read; `gusset run resolved.toml` runs the test again",
    ),
    (
        "coordinator",
        "Coordinator",
        "which program ran the test, its method, rate, limits and timing, and what the machine granted",
    ),
    (
        "coordinator_output",
        "Coordinator Output",
        "the response history as response.csv; in log the log of every tick (samples.bin, described by samples.json), events, timing and summary, byte for byte",
    ),
    (
        "simulation_substructure",
        "Simulation Substructure",
        "what was computed: structure, integration, excitation, time",
    ),
    (
        "simulation_output",
        "Simulation Output",
        "displacement, velocity and acceleration of the recorded degrees of freedom (m, m/s, m/s2)",
    ),
    (
        "experimental_substructure",
        "Experimental Substructure",
        "one folder per specimen: its table of the test file, its sensors with units and scales",
    ),
    (
        "experimental_output",
        "Experimental Output",
        "one folder per specimen: what was asked, sent and measured",
    ),
    (
        "analysis",
        "Analysis",
        "every channel with unit and meaning; scripts that read the log in Python and in MATLAB or Octave",
    ),
    (
        "report",
        "Report",
        "report.html, one file that needs nothing else",
    ),
];

/// The text of README.md.
pub(super) fn readme(title: &str, run: &Run, notes: &[String]) -> String {
    let mut text = format!("# {title}\n\nA real-time hybrid simulation");
    if let Some(summary) = run.summary() {
        let status = serde_json::to_value(summary.status).unwrap_or_default();
        text.push_str(&format!(
            ": {} ({}), {} steps of {} s, run with Gusset {}",
            status.as_str().unwrap_or_default(),
            summary.reason,
            summary.steps,
            summary.dt,
            summary.version
        ));
    }
    text.push_str(".\n\n");
    for (key, said) in filed(run) {
        text.push_str(&format!("- {}: {said}\n", key.replace('_', " ")));
    }
    text.push_str("\n| folder | category | holds |\n|---|---|---|\n");
    for (folder, category, holds) in CATEGORIES {
        text.push_str(&format!("| `{folder}` | {category} | {holds} |\n"));
    }
    text.push_str(
        "\nSI units throughout: m, s, N, kg, rad; `analysis/channels.json` names the channels in other units of a sensor. \
         In the CSV files one row is one step, from t = 0, or one tick if all ticks were requested; missing values are empty. \
         `project.json` lists every file with its SHA-256.\n",
    );
    if !notes.is_empty() {
        text.push_str("\nTo be known:\n\n");
        for note in notes {
            text.push_str(&format!("- {note}\n"));
        }
    }
    text
}
