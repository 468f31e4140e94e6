//! `gusset check` of a file for `gusset serve`: the specimen, its client, and its limits at both scales.

use serde_json::json;

use super::super::args::CheckArgs;
use super::super::exit::Exit;
use super::super::table::Table;
use super::super::test_file::refused;
use super::super::{answer, tell, warn};
use super::in_words;
use gusset_quantity::units::in_axis_unit;
use gusset_setup::{ServedLimit, load_served, served_limits};

/// Checks a served file. The exit code shows whether its verdict is clear.
///
/// # Errors
/// The server would refuse the file, or an option is for tests only.
pub(super) fn check(args: &CheckArgs) -> anyhow::Result<Exit> {
    refuse_options_of_a_test(args)?;
    let served = load_served(&args.test, args.specimen.as_deref()).map_err(refused)?;
    let protocol = served.source.file.serve.protocol.unwrap_or_default();
    served.source.check_protocol(protocol).map_err(refused)?;
    for warning in &served.source.warnings {
        tell(format_args!("warning: {warning}"));
    }
    let verdict = served.verdict(protocol).unwrap_or_default();
    let exit = match verdict.is_clear() {
        true => Exit::Done,
        false => Exit::Stopped,
    };
    warn(&served.source.locator.diagnose_all(verdict.shown(true)));
    let verdict = verdict.record();
    let [own, client] = served_limits(&served.source);
    let has_rows = served.source.rows().is_some();
    if args.json {
        let of_signals = if has_rows {
            "limits_behind_rows"
        } else {
            "limits_of_the_client"
        };
        let found = json!({
            "file": "serve",
            "specimen": served.source.specimen().map(|table| table.name.clone()),
            "limits": own.iter().map(of_json).collect::<Vec<_>>(),
            of_signals: client.iter().map(of_json).collect::<Vec<_>>(),
            "verdict": verdict,
        });
        answer(serde_json::to_string_pretty(&found)?)?;
        return Ok(exit);
    }
    let name = served
        .source
        .specimen()
        .map_or("", |table| table.name.as_str());
    let mut table = Table::wrapped(&format!(
        "specimen \"{name}\" for `gusset serve` — {}",
        in_words(&verdict)
    ));
    for one in &verdict.findings {
        let text = format!("{} ({})", one.text, one.key);
        table.row(&one.severity, &served.source.locator.as_written(&text));
    }
    for limit in &own {
        table.row(&limit.name, &format!("at the specimen: {}", words(limit)));
    }
    let poses = served
        .source
        .specimen()
        .is_some_and(|table| table.geometry.is_some());
    let note = if poses && served.source.converts() {
        ", alone and near the reference pose"
    } else {
        ""
    };
    let place = if has_rows {
        "behind `rows`, in the client's units"
    } else {
        "for the client"
    };
    for limit in &client {
        table.row(&limit.name, &format!("{place}{note}: {}", words(limit)));
    }
    answer(table)?;
    Ok(exit)
}

/// A server has no test: it rehearses and draws nothing, and no option overrides a key of its file.
fn refuse_options_of_a_test(args: &CheckArgs) -> anyhow::Result<()> {
    let options = [
        ("--set", !args.sets.is_empty(), "change the key in the file"),
        ("--plot", args.plot.is_some(), "give a test file"),
        (
            "--rehearse",
            args.rehearse,
            "rehearse the test of the controller",
        ),
    ];
    let Some((option, _, instead)) = options.into_iter().find(|(_, given, _)| *given) else {
        return Ok(());
    };
    anyhow::bail!(
        "{option} is for a test, but {} is a file for `gusset serve`: {instead}",
        args.test.display()
    )
}

fn of_json(limit: &ServedLimit) -> serde_json::Value {
    let ends = |ends: [f64; 2]| ends.map(|end| end.is_finite().then_some(end));
    json!({
        "name": limit.name,
        "disp": ends(limit.disp),
        "disp_unit": limit.disp_unit,
        "force": ends(limit.force),
        "force_unit": limit.force_unit,
    })
}

fn words(limit: &ServedLimit) -> String {
    let range = |[low, high]: [f64; 2], unit: &str| {
        if low.is_infinite() && high.is_infinite() {
            "no limit".to_owned()
        } else {
            format!(
                "{} to {}",
                in_axis_unit(low, unit),
                in_axis_unit(high, unit)
            )
        }
    };
    format!(
        "displacement {}, force {}",
        range(limit.disp, limit.disp_unit),
        range(limit.force, limit.force_unit)
    )
}
