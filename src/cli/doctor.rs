//! `gusset doctor`.

use super::answer;
use super::args::DoctorArgs;
use super::exit::Exit;
use super::table::Table;
use gusset_config::TimingSpec;
use gusset_record::rt::doctor::{Finding, Verdict, examine, examine_interface, fitness};
use gusset_setup::rt_plan;

/// Length of a tick for which the machine is examined.
const USUAL_PERIOD_NS: u64 = 1_000_000;

/// Shows the strengths and gaps of this machine for real-time work. The last entry is the verdict.
pub fn doctor(args: &DoctorArgs) -> anyhow::Result<Exit> {
    let plan = rt_plan(&TimingSpec::default(), USUAL_PERIOD_NS);
    let mut findings = examine(plan);
    let verdict = fitness::verdict(&findings);
    findings.extend(
        args.interface
            .iter()
            .flat_map(|name| examine_interface(name)),
    );
    if args.json {
        findings.push(verdict);
        answer(serde_json::to_string_pretty(&findings)?)?;
    } else {
        answer(page(&findings, &verdict))?;
    }
    Ok(Exit::Done)
}

fn page(findings: &[Finding], verdict: &Finding) -> Table {
    let mut table = Table::wrapped("This machine, for real-time work");
    for finding in findings {
        let mark = match finding.verdict {
            Verdict::Good => "good   ",
            Verdict::Fair => "fair   ",
            Verdict::Poor => "POOR   ",
            Verdict::Unknown => "?      ",
        };
        let mut text = format!("{mark} {}", finding.found);
        if let Some(advice) = &finding.advice {
            text.push_str(&format!("\n-> {advice}"));
        }
        table.row(finding.topic, &text);
    }
    let first = verdict.advice.as_deref().unwrap_or("nothing");
    table.row(verdict.topic, &format!("{}; first: {first}", verdict.found));
    table
}
