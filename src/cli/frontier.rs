//! `gusset jitter --model`: the largest model that keeps its deadlines on this machine, at each of several rates.

use std::path::{Path, PathBuf};

use anyhow::Context;
use serde_json::json;

use super::args::{JitterArgs, ModelArg};
use super::exit::Exit;
use super::table::Table;
use super::{answer, tell};
use gusset_config::TimingSpec;
use gusset_evidence::frontier::{Point, Scalable, csv, svg};
use gusset_quantity::time::Ratio;
use gusset_quantity::work::Work;
use gusset_record::rt::wall::Wall;
use gusset_record::{RunFolder, atomic};
use gusset_session::frontier::{Trials, WANTED};
use gusset_session::{Signal, Signals};

/// Beyond this rate no clock of ours ticks.
const HIGHEST_HZ: f64 = 1e6;

/// Default ticks per second.
const USUAL_RATES: [&str; 5] = ["256", "512", "1024", "2048", "4096"];

/// Searches at all rates, from the highest, draws and writes.
pub fn frontier(args: &JitterArgs, model: ModelArg) -> anyhow::Result<Exit> {
    let model = match model {
        ModelArg::Chain => Scalable::Chain,
        ModelArg::Frame => Scalable::Frame,
    };
    let rates = rates(args)?;
    let timing = timing(args)?;
    let folder = folder(args, model)?;
    let signals = Signals::listen().context("signals cannot be taken over")?;
    let trials = Trials {
        model,
        timing,
        proof: if args.quick {
            Trials::QUICK_PROOF
        } else {
            Trials::PROOF
        },
        scratch: folder.join("trial"),
        signals: &signals,
        told: &|text| tell(text),
    };
    let mut points: Vec<Point> = Vec::with_capacity(rates.len());
    let work = Work::begin("largest model at each rate", rates.len() as u64);
    let mut refused = Vec::new();
    for (searched, rate) in rates.into_iter().enumerate() {
        let rate_hz = rate.value();
        let found = trials.largest(rate, points.last(), &|| work.done(searched as u64))?;
        if signals.seen().is_some() {
            break;
        }
        match found {
            Some((dofs, trial)) => points.push(Point {
                rate_hz,
                dofs,
                trial,
            }),
            None => refused.push(rate_hz),
        }
    }
    drop(work);
    write(&folder, model, &points)?;
    if args.json {
        answer(serde_json::to_string_pretty(&as_json(model, &points))?)?;
    }
    conclude(model, &points, &refused, trials.proof, &folder);
    Ok(match signals.seen() {
        Some(Signal::Terminate) => Exit::Terminated,
        Some(Signal::Interrupt) => Exit::Interrupted,
        None if points.is_empty() => Exit::Stopped,
        None => Exit::Done,
    })
}

/// The rates to search at, the highest first.
fn rates(args: &JitterArgs) -> anyhow::Result<Vec<Ratio>> {
    let given: Vec<&str> = match args.rates.as_slice() {
        [] => USUAL_RATES.to_vec(),
        given => given.iter().map(String::as_str).collect(),
    };
    let mut rates = Vec::with_capacity(given.len());
    for text in given {
        let rate = Ratio::parse(text).with_context(|| format!("--rates {text:?}"))?;
        if rate.value() > HIGHEST_HZ {
            anyhow::bail!("--rates {text:?}: wanted at most {HIGHEST_HZ} Hz");
        }
        rates.push(rate);
    }
    rates.sort_by(|a, b| b.value().total_cmp(&a.value()));
    Ok(rates)
}

/// The folder of the results, newly made.
fn folder(args: &JitterArgs, model: Scalable) -> anyhow::Result<PathBuf> {
    let made = match &args.out {
        Some(path) => RunFolder::create(path),
        None => RunFolder::create_default(Path::new("runs"), title(model), Wall::now().0),
    };
    let made = made.context("the folder cannot be made")?;
    let path = made.path().to_owned();
    // No test is recorded in it.
    made.abandon();
    std::fs::create_dir_all(&path).with_context(|| path.display().to_string())?;
    Ok(path)
}

const fn title(model: Scalable) -> &'static str {
    match model {
        Scalable::Chain => "frontier chain",
        Scalable::Frame => "frontier frame",
    }
}

fn write(folder: &Path, model: Scalable, points: &[Point]) -> anyhow::Result<()> {
    for (name, text) in [
        ("frontier.svg", svg(model.words(), points)),
        ("frontier.csv", csv(points)),
    ] {
        let path = folder.join(name);
        atomic::write(&path, text.as_bytes()).with_context(|| path.display().to_string())?;
    }
    Ok(())
}

fn as_json(model: Scalable, points: &[Point]) -> serde_json::Value {
    let each = points.iter().map(|point| {
        let trial = &point.trial;
        json!({
            "rate_hz": point.rate_hz,
            "dofs": point.dofs,
            "dof_hz": point.dof_hz(),
            "ticks": trial.ticks,
            "missed": trial.missed,
            "taken_away": trial.taken_away,
            "kept": trial.kept(),
            "kept_of_all": trial.kept_of_all(),
            "compute_p50_us": trial.compute_us[0],
            "compute_p99_9_us": trial.compute_us[1],
        })
    });
    json!({ "model": model.words(), "frontier": each.collect::<Vec<_>>() })
}

fn conclude(model: Scalable, points: &[Point], refused: &[f64], proof: u64, folder: &Path) {
    let mut table = Table::new(&format!(
        "Largest {} that keeps {:.2} % of {proof} deadlines",
        model.words(),
        WANTED * 100.0
    ));
    table.row(
        "rate",
        "     DOFs  million DOF·Hz   step p50, p99.9 µs   missed   taken away",
    );
    for point in points {
        let trial = &point.trial;
        let [p50, p99_9] = trial.compute_us;
        table.row(
            &format!("{} Hz", point.rate_hz),
            &format!(
                "{:>9} {:>15.1} {p50:>10.1} {p99_9:>9.1} {:>8} {:>12}",
                point.dofs,
                point.dof_hz() * 1e-6,
                trial.missed,
                trial.taken_away
            ),
        );
    }
    for rate_hz in refused {
        let text = format!("not even {} degrees of freedom", model.least());
        table.row(&format!("{rate_hz} Hz"), &text);
    }
    let path = folder.display();
    table.row(
        "taken away",
        "deadlines missed because of the hypervisor or an interrupt: they do not count against a model",
    );
    table.row("files", &format!("{path} (frontier.svg, frontier.csv)"));
    tell(table);
}

/// The real-time settings that the measurement asks for.
pub(super) fn timing(args: &JitterArgs) -> anyhow::Result<TimingSpec> {
    let timing = TimingSpec {
        cpu: args.cpu,
        priority: args.priority,
        ..TimingSpec::default()
    };
    let allowed = gusset_record::rt::os::process_cpus();
    let checked = timing.check_cpu(&allowed).map_err(anyhow::Error::msg);
    checked.context("--cpu")?;
    Ok(timing)
}
