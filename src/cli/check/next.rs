//! The commands that come after `gusset check`.

use super::super::table::{COLUMNS, Table};
use super::Checked;
use gusset_config::ClockChoice;
use gusset_proof::Outcome;
use gusset_quantity::text::shell_word;

/// Columns in front of a command, and between it and its purpose.
const GAPS: usize = "    # ".len();

/// Adds the next commands to the page.
pub(super) fn tabulate(checked: &Checked<'_>, table: &mut Table) {
    let steps = steps(checked);
    let widest = |of: fn(&(String, String)) -> &String| {
        let widths = steps.iter().map(|step| of(step).chars().count());
        widths.max().unwrap_or(0)
    };
    let width = widest(|(command, _)| command);
    let fits = width + GAPS + widest(|(_, purpose)| purpose) <= COLUMNS;
    table.verbatim("\nnext");
    for (command, purpose) in &steps {
        if fits {
            table.verbatim(&format!("  {command:<width$}  # {purpose}"));
        } else {
            table.verbatim(&format!("  # {purpose}"));
            table.verbatim(&format!("  {command}"));
        }
    }
}

/// Each command with its purpose, in the order of use.
fn steps(checked: &Checked<'_>) -> Vec<(String, String)> {
    let sets = &checked.args.sets;
    let file = shell_word(&checked.args.test.to_string_lossy());
    let command = |before: &str, after: &str| {
        let sets = sets.iter().map(|set| format!(" --set {}", shell_word(set)));
        let sets: String = sets.collect();
        format!("gusset {before} {file}{sets}{after}")
    };
    let step =
        |before: &str, after: &str, purpose: &str| (command(before, after), purpose.to_owned());
    let mut steps = Vec::new();
    let specimens = &checked.loaded.file.specimen;
    let links = specimens.iter().filter_map(|table| table.link.as_ref());
    let addresses: Vec<&str> = links.map(|link| link.address.as_str()).collect();
    let verdict = checked.judged.verdict.record();
    let certified = checked.certificate.is_some();
    match (verdict.outcome, addresses.as_slice()) {
        (Outcome::Refused, _) => {
            steps.push(step(
                "check",
                "",
                "check again after correcting the errors above",
            ));
        }
        (Outcome::Simulated, []) => steps.push(step(
            "run",
            " --clock simulated",
            "run it; the findings above forbid a real specimen",
        )),
        (_, []) => {
            let clock = match checked.judged.test.facts.clock {
                ClockChoice::Real => " --clock simulated",
                ClockChoice::Simulated => "",
            };
            steps.push(step("run", clock, "run it as fast as it goes"));
            if !clock.is_empty() {
                steps.push(step("run", "", "run it in real time: same results"));
            }
            if !certified && !checked.judged.following.is_empty() {
                steps.push(step(
                    "check --rehearse",
                    "",
                    "go or no-go over all that is uncertain",
                ));
            }
        }
        (_, addresses) => {
            let servers = addresses.join(", ");
            if !certified {
                steps.push(step(
                    "check --rehearse",
                    "",
                    "go or no-go over all that is uncertain",
                ));
            }
            let purpose = format!("small motion; {servers} must listen");
            steps.push((command("identify", ""), purpose));
            steps.push(step("run", "", "run it with the specimen"));
        }
    }
    if !checked.args.verbose {
        steps.push(step("check --verbose", "", "modes, delays and all limits"));
    }
    steps
}
