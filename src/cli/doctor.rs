//! `gusset doctor`.

use super::answer;
use super::args::DoctorArgs;
use super::exit::Exit;
use super::table::Table;
use crate::rt::doctor::{Verdict, examine};

/// Says what this machine gives and lacks for real-time work.
pub fn doctor(args: &DoctorArgs) -> anyhow::Result<Exit> {
    let findings = examine();
    if args.json {
        answer(serde_json::to_string_pretty(&findings)?)?;
        return Ok(Exit::Done);
    }
    let mut table = Table::new("This machine, for real-time work");
    for finding in &findings {
        let mark = match finding.verdict {
            Verdict::Good => "good   ",
            Verdict::Fair => "fair   ",
            Verdict::Poor => "POOR   ",
            Verdict::Unknown => "?      ",
        };
        let mut text = format!("{mark} {}", finding.found);
        if let Some(advice) = &finding.advice {
            text.push_str(&format!("\n        {advice}"));
        }
        table.row(finding.topic, &text);
    }
    answer(table)?;
    Ok(Exit::Done)
}
