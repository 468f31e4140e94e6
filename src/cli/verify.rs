//! `gusset verify`: the paper's tables, equations, figures and examples, computed again and judged.

use std::io;
use std::path::Path;

use anyhow::Context;
use serde_json::json;

use super::args::VerifyArgs;
use super::exit::Exit;
use super::{answer, screen, tell};
use gusset_evidence::verify::{self, Check, Effort, Part, TOPICS, Tabulation, Verdict};
use gusset_quantity::work::Work;
use gusset_record::make_free;
use gusset_record::rt::clock::{MonotonicClock, USUAL_SPIN_NS};

/// Proves the requested topics.
pub fn verify(args: &VerifyArgs) -> anyhow::Result<Exit> {
    if args.list {
        if args.json {
            let topics = TOPICS
                .iter()
                .map(|topic| json!({ "name": topic.name, "title": topic.title }));
            let document = json!({ "topics": topics.collect::<Vec<_>>() });
            answer(format_args!("{document:#}"))?;
            return Ok(Exit::Done);
        }
        for topic in &TOPICS {
            answer(format_args!("{:16} {}", topic.name, topic.title))?;
        }
        return Ok(Exit::Done);
    }
    let topics = verify::select(&args.names).map_err(anyhow::Error::msg)?;
    if let Some(out) = &args.out {
        make_free(out).context("--out")?;
    }
    let effort = if args.quick {
        Effort::Quick
    } else {
        Effort::Whole
    };
    let clock = MonotonicClock::new(USUAL_SPIN_NS);
    let mut parts = Vec::with_capacity(topics.len());
    let work = Work::begin("verify", topics.len() as u64);
    for topic in topics {
        work.done(parts.len() as u64);
        let part = topic.prove(effort, &clock);
        if !args.json {
            screen::step_aside();
            show(&part)?;
        }
        parts.push(part);
    }
    drop(work);
    if let Some(out) = &args.out {
        write(out, &parts)?;
        tell(out.join("index.html").display());
    }
    Ok(conclude(&parts, args.json)?)
}

/// The final message, and the exit code: 1 if anything fails.
fn conclude(parts: &[Part], as_json: bool) -> io::Result<Exit> {
    let holds = verify::all_hold(parts);
    let count = |verdict| parts.iter().map(|part| part.count(verdict)).sum::<usize>();
    let (pass, fail, notes) = (
        count(Verdict::Pass),
        count(Verdict::Fail),
        count(Verdict::Note),
    );
    if as_json {
        let document = json!({
            "holds": holds,
            "passed": pass,
            "failed": fail,
            "notes": notes,
            "parts": parts,
        });
        answer(format_args!("{document:#}"))?;
    } else {
        answer(format_args!("\n{pass} hold, {fail} fail, {notes} notes"))?;
    }
    Ok(if holds { Exit::Done } else { Exit::Stopped })
}

fn show(part: &Part) -> io::Result<()> {
    answer(format_args!("\n{}  [{}]", part.title, part.name))?;
    for table in &part.tables {
        answer(format_args!("  {}\n{}", table.title, columns(table)))?;
    }
    for check in &part.checks {
        let Check {
            what,
            paper,
            obtained,
            tolerance,
            verdict,
        } = check;
        let word = match verdict {
            Verdict::Pass => "holds",
            Verdict::Fail => "FAILS",
            Verdict::Note => "note ",
        };
        answer(format_args!(
            "  {word}  {what}\n         paper: {paper}; obtained: {obtained}; {tolerance}"
        ))?;
    }
    Ok(())
}

/// A table with its columns under each other, numbers to the right.
fn columns(table: &Tabulation) -> String {
    let all = || std::iter::once(&table.head).chain(&table.rows);
    let width = |column: usize| {
        let cells = all().filter_map(|cells| cells.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..table.head.len()).map(width).collect();
    let line = |cells: &Vec<String>| {
        let cells = cells.iter().zip(&widths).map(|(cell, &width)| {
            let gap = " ".repeat(width.saturating_sub(cell.chars().count()));
            format!("  {gap}{cell}")
        });
        format!("       {}", cells.collect::<String>())
    };
    all().map(line).collect::<Vec<_>>().join("\n")
}

fn write(out: &Path, parts: &[Part]) -> anyhow::Result<()> {
    for (name, text) in verify::files(parts) {
        let path = out.join(name);
        gusset_record::atomic::write(&path, text.as_bytes())
            .with_context(|| path.display().to_string())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_failed_value_gives_exit_code_one() {
        let part = |paper: f64| Part {
            name: "eq-33",
            title: "a limit",
            says: "",
            tables: Vec::new(),
            checks: vec![Check::near("upper limit of λ", paper, 16.7703, 0.005)],
            figures: Vec::new(),
        };
        assert_eq!(conclude(&[part(16.77)], true).unwrap(), Exit::Done);
        let both = [part(16.77), part(16.97)];
        assert_eq!(conclude(&both, true).unwrap(), Exit::Stopped);
    }
}
