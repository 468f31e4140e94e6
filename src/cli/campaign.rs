//! `gusset campaign`: many simulated tests of one study.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde_json::json;

use super::args::{
    CampaignCommand, CollectArgs, EngineArg, FolderArgs, PlanArgs, ResultArgs, RunCampaignArgs,
    SubmitArgs, WorkArgs,
};
use super::exit::{Exit, Mistakes, WithExit};
use super::{answer, screen, tell};
use crate::program::program;
use gusset_config::ConfigError;
use gusset_quantity::units::duration;
use gusset_quantity::work::{Work, processors};
use gusset_session::campaign::{self, Campaign, CampaignError, Collected, Engine, Prove, Worked};
use gusset_session::{Signal, Signals};

/// Carries out a command on a campaign.
pub fn campaign(command: &CampaignCommand) -> anyhow::Result<Exit> {
    match command {
        CampaignCommand::Plan(args) => plan(args),
        CampaignCommand::Run(args) => run(args),
        CampaignCommand::Submit(args) => submit(args),
        CampaignCommand::Work(args) => work(args),
        CampaignCommand::Collect(args) => collect(args),
        CampaignCommand::Status(args) => status(args),
    }
}

fn plan(args: &PlanArgs) -> anyhow::Result<Exit> {
    let planned =
        campaign::plan(&args.study, &args.out, args.tasks_per_chunk, &program()?).map_err(told)?;
    if args.json {
        answer(serde_json::to_string_pretty(&planned.plan)?)?;
    } else {
        answer(in_words(&planned))?;
        let folder = args.out.display();
        answer(format_args!(
            "continue with\n  gusset campaign run {folder}"
        ))?;
    }
    Ok(Exit::Done)
}

fn in_words(campaign: &Campaign) -> String {
    let plan = &campaign.plan;
    format!(
        "{}: {} tasks of {} each, {} chunks",
        campaign.folder.display(),
        plan.tasks,
        duration(plan.task_s),
        plan.chunks()
    )
}

fn run(args: &RunCampaignArgs) -> anyhow::Result<Exit> {
    let prove = proof(&args.results)?;
    let campaign = if args.study.is_dir() {
        if args.out.is_some() {
            bail!("--out is for a study, and this is a campaign folder");
        }
        Campaign::open(&args.study, &program()?).map_err(told)?
    } else {
        let out = args.out.clone();
        let out = out.unwrap_or_else(|| usual_folder(&args.study));
        begun(&args.study, &out)?
    };
    tell(in_words(&campaign));
    let jobs = args.jobs.map_or_else(processors, usize::from);
    let chunks = campaign.plan.chunks();
    let signals = listen()?;
    let worked = compute(&campaign, 1..=chunks, jobs, campaign.plan.tasks, &signals)?;
    if let Some(exit) = worked {
        return Ok(exit);
    }
    conclude(&campaign, prove, jobs, args.results.json, &signals)
}

/// The campaign of `study` in `out`: a new one, or the one that was begun there.
fn begun(study: &Path, out: &Path) -> anyhow::Result<Campaign> {
    if !out.join("plan.json").exists() {
        return campaign::plan(study, out, None, &program()?).map_err(told);
    }
    let campaign = Campaign::open(out, &program()?).map_err(told)?;
    if study.canonicalize().ok().as_deref() != Some(&campaign.plan.study) {
        bail!(
            "{} has the campaign of another study, {}: choose another folder with --out",
            out.display(),
            campaign.plan.study.display()
        );
    }
    Ok(campaign)
}

/// The folder of a study without `--out`.
fn usual_folder(study: &Path) -> PathBuf {
    let stem = study.file_stem().unwrap_or_default();
    Path::new("campaigns").join(stem)
}

fn work(args: &WorkArgs) -> anyhow::Result<Exit> {
    let campaign = Campaign::open(&args.folder, &program()?).map_err(told)?;
    let (chunks, plan) = (&args.chunk, &campaign.plan);
    let last = plan.chunks();
    let found = [chunks.first(), chunks.last()];
    let wrong = found
        .into_iter()
        .find(|number| !(1..=last).contains(number));
    if let Some(found) = wrong {
        return Err(told(CampaignError::NoChunk { found, last }));
    }
    let tasks = chunks.iter().map(|number| plan.chunk(number));
    let total = tasks.map(|tasks| tasks.end - tasks.start).sum();
    let jobs = usize::from(args.jobs);
    let interrupted = compute(&campaign, chunks.iter(), jobs, total, &listen()?)?;
    Ok(interrupted.unwrap_or(Exit::Done))
}

/// Computes chunks, with progress on a terminal. Returns the exit code of a signal that stopped it.
fn compute(
    campaign: &Campaign,
    chunks: impl Iterator<Item = u64>,
    jobs: usize,
    total: u64,
    signals: &Signals,
) -> anyhow::Result<Option<Exit>> {
    let progress = Work::begin("tests of the campaign", total);
    let stop = || signals.seen().is_some();
    let worked = campaign::work(campaign, chunks, jobs, &stop, &|done| progress.done(done));
    drop(progress);
    let Worked {
        computed,
        known,
        interrupted,
    } = worked.map_err(told)?;
    screen::step_aside();
    tell(format_args!(
        "{computed} tests computed, {known} were done before"
    ));
    if !interrupted {
        return Ok(None);
    }
    let folder = campaign.folder.display();
    tell(format_args!(
        "stopped; continue with\n  gusset campaign run {folder}"
    ));
    Ok(Some(exit_of(signals)))
}

fn listen() -> anyhow::Result<Signals> {
    Signals::listen().context("signals cannot be taken over")
}

/// The exit code of the signal that stopped a command.
fn exit_of(signals: &Signals) -> Exit {
    match signals.seen() {
        Some(Signal::Terminate) => Exit::Terminated,
        _ => Exit::Interrupted,
    }
}

fn submit(args: &SubmitArgs) -> anyhow::Result<Exit> {
    let engine = match args.engine {
        EngineArg::Lines => Engine::Lines,
        EngineArg::Slurm => Engine::Slurm,
        EngineArg::Hyperqueue => Engine::HyperQueue,
    };
    if engine == Engine::Lines && !args.arguments.is_empty() {
        bail!(
            "arguments behind -- are for slurm and hyperqueue: with --engine lines, nothing is started"
        );
    }
    let campaign = Campaign::open(&args.folder, &program()?).map_err(told)?;
    let prepared = campaign::prepare(&campaign, engine, args.tasks_per_job).map_err(told)?;
    let chunks = campaign.plan.chunks();
    let Some(prepared) = prepared else {
        let folder = args.folder.display();
        tell(format_args!(
            "all {chunks} chunks are done; continue with\n  gusset campaign collect {folder}"
        ));
        return Ok(Exit::Done);
    };
    answer(prepared.file.display())?;
    tell(format_args!(
        "{} of {chunks} chunks are open: {} jobs",
        prepared.open, prepared.jobs
    ));
    if let Some(reply) = campaign::start(&prepared, &args.arguments).map_err(told)? {
        tell(reply.trim_end());
    }
    Ok(Exit::Done)
}

fn collect(args: &CollectArgs) -> anyhow::Result<Exit> {
    let prove = proof(&args.results)?;
    let campaign = Campaign::open(&args.folder, &program()?).map_err(told)?;
    conclude(
        &campaign,
        prove,
        processors(),
        args.results.json,
        &listen()?,
    )
}

fn proof(args: &ResultArgs) -> anyhow::Result<Prove> {
    let text = &args.prove;
    Prove::parse(text, args.prove_seed).with_context(|| {
        format!("--prove {text:?}: expected a number of tasks, or a share from 0% to 100%")
    })
}

/// Collects the results and shows the findings.
fn conclude(
    campaign: &Campaign,
    prove: Prove,
    jobs: usize,
    json: bool,
    signals: &Signals,
) -> anyhow::Result<Exit> {
    let work = Work::begin("results", campaign.plan.tasks);
    let stop = || signals.seen().is_some();
    let collected = campaign::collect(campaign, prove, jobs, &stop, &|done| work.done(done));
    drop(work);
    if matches!(collected, Err(CampaignError::Stopped)) {
        screen::step_aside();
        let folder = campaign.folder.display();
        tell(format_args!(
            "stopped; continue with\n  gusset campaign collect {folder}"
        ));
        return Ok(exit_of(signals));
    }
    let collected = collected.map_err(told)?;
    screen::step_aside();
    for name in &collected.damaged {
        tell(format_args!(
            "warning: {name} was cut short and does not count"
        ));
    }
    if json {
        answer(serde_json::to_string_pretty(&collected.summary)?)?;
    } else {
        let errors = campaign.plan.of_errors();
        let errors = errors.map(|(text, _)| format!("\nerrors   {text}"));
        answer(found(&collected) + &errors.collect::<String>())?;
    }
    if !collected.is_complete() {
        let missing = collected.tasks - collected.done;
        let folder = campaign.folder.display();
        tell(format_args!(
            "PARTIAL: {missing} of {} tasks have no result{}. `gusset campaign run {folder}` computes them",
            collected.tasks,
            match collected.invalid {
                0 => String::new(),
                invalid => format!(", and {invalid} have no valid test"),
            }
        ));
        return Ok(Exit::Stopped);
    }
    if collected.invalid > 0 {
        tell(format_args!(
            "INVALID: {} of {} tasks have no valid test. The table has `invalid` in their column `ended`",
            collected.invalid, collected.tasks
        ));
        return Ok(Exit::Stopped);
    }
    Ok(Exit::Done)
}

fn found(collected: &Collected) -> String {
    let mut lines = vec![
        format!("table    {}", collected.table.display()),
        format!("report   {}", collected.report.display()),
        format!(
            "tests    {} of {}; collapsed: {}; stopped by a limit or fault: {}; without a valid test: {}",
            collected.done,
            collected.tasks,
            collected.collapsed,
            collected.censored,
            collected.invalid
        ),
        format!(
            "proved   {} tasks computed again with equal bits, chosen by --prove-seed {}",
            collected.proved, collected.proof_seed
        ),
    ];
    if let Some(why) = &collected.invalid_example {
        lines.push(format!("invalid  {why}"));
    }
    if collected.redrawn > 0 {
        lines.push(format!(
            "drawn    numbers of {} tests were drawn again: the test file must not have the first ones",
            collected.redrawn
        ));
    }
    for one in &collected.fragility {
        let of = match one.point.as_str() {
            "" => String::new(),
            point => format!(", {point}"),
        };
        lines.push(match one.fit {
            Some(fit) => format!(
                "collapse median {:.4}, dispersion {:.4}{of}",
                fit.median, fit.dispersion
            ),
            None => format!(
                "collapse median not determined: use more levels between no collapse and all{of}"
            ),
        });
    }
    lines.join("\n")
}

fn status(args: &FolderArgs) -> anyhow::Result<Exit> {
    let status = campaign::status(&args.folder).map_err(told)?;
    let (tasks, chunks) = (status.plan.tasks, status.plan.chunks());
    let missing = tasks - status.done;
    if args.json {
        let document = json!({
            "tasks": tasks,
            "done": status.done,
            "missing": missing,
            "invalid": status.invalid,
            "chunks": chunks,
            "chunks_done": status.chunks_done,
            "chunks_with_missing_tasks": status.open,
            "damaged_parts": status.damaged,
            "foreign_parts": status.foreign,
            "task_s": status.plan.task_s,
        });
        answer(format_args!("{document:#}"))?;
    } else {
        answer(format_args!(
            "{} of {tasks} tasks are done, {} of them without a valid test, {} of {chunks} chunks; about {} of one core left",
            status.done,
            status.invalid,
            status.chunks_done,
            duration(missing as f64 * status.plan.task_s)
        ))?;
        for name in &status.damaged {
            tell(format_args!(
                "warning: {name} was cut short and does not count"
            ));
        }
        for path in &status.foreign {
            let path = path.display();
            tell(format_args!(
                "warning: {path} belongs to another campaign and does not count: remove it from the folder"
            ));
        }
    }
    Ok(if missing == 0 {
        Exit::Done
    } else {
        Exit::Stopped
    })
}

/// The error with its exit code. Mistakes of a study are drawn.
fn told(error: CampaignError) -> anyhow::Error {
    match error {
        CampaignError::Config(ConfigError::Invalid(mistakes)) => {
            Mistakes(mistakes.render(screen::in_colour())).into()
        }
        CampaignError::Conflict { .. } | CampaignError::Refuted { .. } => {
            WithExit(Exit::Stopped, error.to_string()).into()
        }
        error => anyhow::Error::msg(error),
    }
}
