//! `gusset benchmark`: published benchmarks, obtained natively.

mod ground;

use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use serde_json::json;

use self::ground::GroundArgs;
use super::exit::Exit;
use super::{answer, tell};
use gusset_actuator::transfer::BetweenTicks;
use gusset_evidence::benchmark::{Criteria, Job, Line, RATE_HZ, Trials, Wiring, controllers, jobs};
use gusset_quantity::time::Clock;
use gusset_quantity::work::{Work, each, processors};
use gusset_record::rt::clock::{MonotonicClock, USUAL_SPIN_NS};

#[derive(Debug, Subcommand)]
pub enum Of {
    /// The virtual real-time hybrid simulation benchmark (Silva et al. 2020): a servo-hydraulic actuator moves the first storey.
    Vrths(VrthsArgs),
}

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  gusset benchmark vrths\n  gusset benchmark vrths --case 1 --controller ats --plants 20\n  \
    gusset benchmark vrths --controller 'inverse = { delay_s = 0.025 }' --record elcentro.AT2\n\n\
    J1 is a delay. J2 and J3 are errors relative to the target, J4 to J9 relative to the linear reference.\n\n\
    More: gusset guide actuators, gusset guide mathematics-errors (the criteria)"
)]
pub struct VrthsArgs {
    /// Case, 1 to 4 [default: all].
    #[arg(long)]
    case: Option<usize>,
    /// Compensator by its name in the results, or as a table of [specimen.compensation] [default: all].
    #[arg(long)]
    controller: Option<String>,
    #[command(flatten)]
    ground: GroundArgs,
    /// Noise of the sensors: on or off.
    #[arg(long, default_value = "on", value_parser = on_or_off, action = clap::ArgAction::Set)]
    noise: bool,
    /// Converters of 18 bits, on or off: commands and readings are multiples of 2^-18 m and 2^-18 N.
    #[arg(long, default_value = "off", value_parser = on_or_off, action = clap::ArgAction::Set)]
    quantisation: bool,
    /// Coupling of structure and specimen: as in the published benchmark, or as in the loop of Gusset.
    #[arg(long, value_enum, default_value_t = WiringArg::Benchmark)]
    wiring: WiringArg,
    /// For the loop of Gusset: the command between two ticks [default: both, one row each].
    #[arg(long, value_enum)]
    between_ticks: Option<BetweenTicksArg>,
    /// Number of plants drawn from the published uncertainty; the results are mean and worst. 0 is the nominal plant.
    #[arg(long, default_value_t = 0)]
    plants: u64,
    /// Additional delay of the force in whole ticks, up to 62.
    #[arg(long, default_value_t = 0, value_parser = up_to_62)]
    late: usize,
    /// Seed of the noise, the plants and the synthetic earthquake.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print the result as JSON on stdout.
    #[arg(long)]
    json: bool,
}

fn on_or_off(text: &str) -> Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("on or off".to_owned()),
    }
}

fn up_to_62(text: &str) -> Result<usize, String> {
    let late = text.parse().ok().filter(|late| *late <= 62);
    late.ok_or_else(|| "a whole number from 0 to 62".to_owned())
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum WiringArg {
    /// Runge-Kutta method, held commands, force one tick late.
    Benchmark,
    /// Gui-λ method with lambda = 4, commands known one tick ahead, force of the same tick.
    InTick,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum BetweenTicksArg {
    /// A straight line from the previous command to the new one.
    Ramped,
    /// The new command during the whole tick, as a digital-to-analogue converter holds it.
    Held,
}

/// The virtual real-time hybrid simulation benchmark.
pub fn vrths(args: &VrthsArgs) -> anyhow::Result<Exit> {
    let cases = match args.case {
        Some(case) if (1..=4).contains(&case) => vec![case],
        Some(case) => anyhow::bail!("there is no case {case}, only 1 to 4"),
        None => vec![1, 2, 3, 4],
    };
    let controllers = controllers(args.controller.as_deref()).map_err(anyhow::Error::msg)?;
    let wirings = wirings(args).map_err(anyhow::Error::msg)?;
    let ground = args.ground.history(args.seed).map_err(anyhow::Error::msg)?;
    let clock = MonotonicClock::new(USUAL_SPIN_NS);
    let begun = clock.now();
    let jobs = jobs(&cases, &controllers, &wirings, &ground).context("the cases are 1 to 4")?;
    let lines = computed(args, &ground, &jobs)?;
    let wall = clock.now().since(begun) as f64 * 1e-9;
    let seconds = ground.len() as f64 / RATE_HZ;
    if args.json {
        let document = as_document(args, seconds, &lines);
        answer(serde_json::to_string_pretty(&document)?)?;
    } else {
        show(&lines, args.plants)?;
        let tests = lines.len() as f64 * (args.plants.max(1)) as f64;
        tell(format_args!(
            "{tests:.0} tests of {seconds:.1} s in {wall:.3} s: {:.0} times real time",
            tests * seconds / wall
        ));
    }
    Ok(Exit::Done)
}

/// The wirings of the table. This program's loop has a row with a ramped and one with a held command.
fn wirings(args: &VrthsArgs) -> Result<Vec<Wiring>, String> {
    let ways = [BetweenTicks::Ramped, BetweenTicks::Held];
    match (args.wiring, args.between_ticks) {
        (WiringArg::Benchmark, Some(BetweenTicksArg::Ramped)) => {
            let wanted = "use --wiring in-tick, or leave --between-ticks out";
            Err(format!(
                "--between-ticks ramped: the released wiring holds its commands: {wanted}"
            ))
        }
        (WiringArg::Benchmark, _) => Ok(vec![Wiring::Benchmark]),
        (WiringArg::InTick, None) => Ok(ways.map(Wiring::InTick).to_vec()),
        (WiringArg::InTick, Some(BetweenTicksArg::Ramped)) => {
            Ok(vec![Wiring::InTick(BetweenTicks::Ramped)])
        }
        (WiringArg::InTick, Some(BetweenTicksArg::Held)) => {
            Ok(vec![Wiring::InTick(BetweenTicks::Held)])
        }
    }
}

/// All rows in the order of the jobs, on all processors.
fn computed(args: &VrthsArgs, ground: &[f64], jobs: &[Job<'_>]) -> anyhow::Result<Vec<Line>> {
    let trials = Trials {
        plants: args.plants,
        noise: args.noise,
        quantisation: args.quantisation,
        late: args.late,
        seed: args.seed,
        ground,
    };
    let tests = Tests {
        work: Work::begin("benchmark", jobs.len() as u64 * args.plants.max(1)),
        done: AtomicU64::new(0),
    };
    let mut lines = Vec::new();
    each(
        processors(),
        jobs.iter().enumerate(),
        &|| false,
        &|(place, job)| Ok((place, trials.line(job, &|| tests.one_more())?)),
        |line| {
            lines.push(line);
            Ok::<_, anyhow::Error>(())
        },
    )?;
    lines.sort_by_key(|(place, _)| *place);
    Ok(lines.into_iter().map(|(_, line)| line).collect())
}

/// How many tests are done, of all workers.
struct Tests {
    work: Work,
    done: AtomicU64,
}

impl Tests {
    fn one_more(&self) {
        self.work
            .done(self.done.fetch_add(1, Ordering::Relaxed) + 1);
    }
}

fn show(lines: &[Line], plants: u64) -> anyhow::Result<()> {
    let mut text = String::from(
        "case controller        J1 ms     J2 %     J3 %     J4 %     J5 %     J6 %     J7 %     J8 %     J9 %  delay ms command\n",
    );
    let mut row = |line: &Line, name: &str, found: &Criteria, note: &str| {
        let numbers: String = found
            .j
            .iter()
            .skip(1)
            .map(|j| format!(" {j:8.2}"))
            .collect();
        let delay = if found.delay_ms.is_nan() {
            String::new()
        } else {
            format!("{:.3}", found.delay_ms)
        };
        text.push_str(&format!(
            "{:4} {name:16} {:7.3}{numbers} {delay:>9} {:7}{note}",
            line.case,
            found.j[0],
            line.wiring.between_ticks().name()
        ));
        text.truncate(text.trim_end().len());
        text.push('\n');
    };
    for line in lines {
        let note = if line.saturated > 0 {
            "  unstable or overloaded: at the limit of force"
        } else {
            ""
        };
        row(line, &line.controller, &line.criteria, note);
        if plants > 0 {
            row(line, "  worst", &line.worst, "");
        }
    }
    answer(text.trim_end())?;
    Ok(())
}

fn as_document(args: &VrthsArgs, record_s: f64, lines: &[Line]) -> serde_json::Value {
    let found: Vec<_> = lines.iter().map(as_json).collect();
    json!({
        "benchmark": "vrths",
        "convention": "sample standard deviation; J8, J9 are peaks of floors 2 and 3",
        "wiring": match args.wiring {
            WiringArg::Benchmark => "benchmark",
            WiringArg::InTick => "in_tick",
        },
        "noise": args.noise,
        "quantisation": args.quantisation,
        "plants": args.plants,
        "record_s": record_s,
        "lines": found,
    })
}

fn as_json(line: &Line) -> serde_json::Value {
    let numbers = |found: &Criteria| {
        let mut all: serde_json::Map<_, _> = found
            .j
            .iter()
            .enumerate()
            .map(|(i, j)| (format!("j{}", i + 1), json!(j)))
            .collect();
        all.insert("delay_ms".into(), json!(found.delay_ms));
        all
    };
    json!({
        "case": line.case,
        "controller": line.controller,
        "between_ticks": line.wiring.between_ticks().name(),
        "criteria": numbers(&line.criteria),
        "worst": numbers(&line.worst),
        "ticks_at_force_limit": line.saturated,
    })
}
