//! `gusset jitter`: the loop's own timing on this machine.

use anyhow::Context;
use serde_json::json;

use super::args::JitterArgs;
use super::exit::Exit;
use super::frontier::{frontier, timing};
use super::progress::ProgressLine;
use super::table::Table;
use super::{answer, only_with, tell};
use gusset_quantity::catalog::ending::Cause;
use gusset_quantity::time::Ratio;
use gusset_record::rt::load::{Load, USUAL_BYTES};
use gusset_record::rt::timing::{Quantity, Timings};
use gusset_record::{Progress, Run, RunFolder};
use gusset_session::fitness::Measured;
use gusset_session::{self as session, Finished, Signals, Watches, bare_loop};
use gusset_setup::Prepared;
use gusset_view::report::jitter_svg;

/// More than any machine keeps.
const HIGHEST_HZ: f64 = 1e6;
/// More than sixteen weeks.
const LONGEST_S: f64 = 1e7;

/// Measures the loop with nothing attached.
pub fn jitter(args: &JitterArgs) -> anyhow::Result<Exit> {
    if let Some(model) = args.model {
        return frontier(args, model);
    }
    let of_model = [("--rates", !args.rates.is_empty()), ("--quick", args.quick)];
    only_with("--model", of_model).map_err(anyhow::Error::msg)?;
    let test = bare_test(args)?;
    let temporary = std::env::temp_dir();
    anyhow::ensure!(
        args.out.is_some() || temporary.is_dir(),
        "TMPDIR is {}, which is not a folder: set another one, or name a folder with --out",
        temporary.display()
    );
    let scratch = temporary.join(format!("gusset-jitter-{}", std::process::id()));
    let path = args.out.as_deref().unwrap_or(&scratch);
    let signals = Signals::listen().context("signals cannot be handled")?;
    let folder = RunFolder::create(path).context("the folder cannot be created")?;
    let facts = test.facts.clone();
    let cpu = args
        .cpu
        .or_else(|| gusset_record::rt::os::process_cpus().last().copied())
        .unwrap_or(0);
    let load = args.load.then(|| start_load(cpu)).transpose()?;
    let line = ProgressLine::new(&facts, true);
    let watches = Watches::default();
    let finished = session::run(
        test,
        folder,
        signals.requests(),
        watches,
        &mut |progress: &Progress| line.show(progress),
    );
    line.clear();
    let streamed = load.map(|load| {
        let cpus = load.cpus.clone();
        json!({ "cpus": cpus, "streamed_bytes": load.stop() })
    });
    let finished = finished?;
    for text in &finished.unwritten {
        tell(format_args!("warning: not written: {text}"));
    }
    let kept = &finished.folder;
    let bins = match kept.is_there() {
        true => Run::open(kept.path())?.timings()?,
        false => None,
    };
    let bins = bins.unwrap_or_default();
    if args.out.is_some() {
        draw(&facts.title, kept, &bins, 1e6 / facts.rate_hz)?;
    } else {
        // No other process uses it: the name contains the number of this one.
        let _ = std::fs::remove_dir_all(&scratch);
    }
    let summary = &finished.summary;
    let measured = Measured {
        rate_hz: summary.rate_hz,
        seconds: summary.wall_seconds,
        misses: summary.deadline_misses,
        causes: summary.miss_classes,
        bins: &bins,
        loaded: args.load,
        granted: finished
            .granted
            .as_ref()
            .is_some_and(|granted| session::missing(granted).is_empty()),
        complete: finished.cause == Cause::Done,
    };
    if args.json {
        let found = as_json(&finished, &measured, streamed);
        answer(serde_json::to_string_pretty(&found)?)?;
    }
    conclude(&facts.title, args, &finished, &measured);
    Ok(match finished.cause {
        Cause::Operator | Cause::Internal => finished.exit(signals.seen()),
        _ => Exit::Done,
    })
}

/// A test with nothing attached, at the rate and for the duration of the arguments.
fn bare_test(args: &JitterArgs) -> anyhow::Result<Prepared> {
    let rate = Ratio::parse(&args.rate).with_context(|| format!("--rate {:?}", args.rate))?;
    anyhow::ensure!(
        rate.value() <= HIGHEST_HZ,
        "--rate {}: at most {HIGHEST_HZ} ticks a second are allowed, as in a test file on the real clock",
        args.rate
    );
    anyhow::ensure!(
        args.duration <= LONGEST_S || !args.duration.is_finite(),
        "--duration {}: at most {LONGEST_S} s are allowed. Ctrl-C ends a measurement earlier and prints its result",
        args.duration
    );
    bare_loop(rate, args.duration, timing(args)?)
        .with_context(|| format!("--duration {}", args.duration))
}

/// Starts a load on another core than `cpu`.
fn start_load(cpu: usize) -> anyhow::Result<Load> {
    let load = Load::start(cpu, USUAL_BYTES);
    load.context("the load cannot be started")
}

fn as_json(
    finished: &Finished,
    measured: &Measured<'_>,
    load: Option<serde_json::Value>,
) -> serde_json::Value {
    let summary = &finished.summary;
    json!({
        "rate_hz": summary.rate_hz,
        "ticks": summary.steps + 1,
        "wall_seconds": summary.wall_seconds,
        "deadline_misses": summary.deadline_misses,
        "miss_classes": summary.miss_classes,
        "stretched_ticks": summary.stretched_ticks,
        "rows_lost": summary.rows_lost,
        "load": load,
        "realtime": summary.realtime,
        "timing": measured.bins,
        "verdict": measured.as_json(),
    })
}

/// The picture of the histogram.
fn draw(title: &str, folder: &RunFolder, timing: &Timings, period_us: f64) -> anyhow::Result<()> {
    let bins = timing.bins(Quantity::WakeupLateness).iter();
    let histogram: Vec<(f64, u64)> = bins.map(|(_, to, count)| (*to, *count)).collect();
    let percentiles = timing.percentiles(Quantity::WakeupLateness);
    let picture = jitter_svg(title, &histogram, &percentiles, Some(period_us));
    Ok(folder.write("jitter.svg", picture.as_bytes())?)
}

fn conclude(title: &str, args: &JitterArgs, finished: &Finished, measured: &Measured<'_>) {
    let summary = &finished.summary;
    let mut table = Table::wrapped(&format!("{title}, {:.3} s", summary.wall_seconds));
    table.timing(&summary.timing.clone().unwrap_or_default());
    table.row("ticks", &(summary.steps + 1).to_string());
    table.misses(summary);
    if let Some(granted) = &finished.granted {
        if let Some(cpu) = granted.cpu {
            table.row("core", &cpu.to_string());
        }
        for text in session::missing(granted) {
            table.row("not granted", &text);
        }
    }
    if let Some(out) = &args.out {
        table.row(
            "files",
            &format!("{} (jitter.svg, *.hgrm, timing.json)", out.display()),
        );
    }
    table.row("verdict", &measured.words());
    tell(table);
}
