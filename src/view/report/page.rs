//! The page a run leaves behind: one self-contained HTML file. Verdict first, machine and configuration last.

use maud::{Markup, html};

use super::RunView;
use super::balance::balance;
use super::digest::Digest;
use super::effect::effect_of_errors;
use super::figures::tiles;
use super::ground::ground;
use super::html::{
    HINT, banner_with, beside, definitions, details, filed, frame, header, note, section,
};
use super::limits::limits;
use super::outcome::{Tone, refused, verdict};
use super::response::response;
use super::sketch::sketch;
use super::text::plural;
use super::tracking::tracking;

use super::{end_positions, events, identified, scale, tested, timing, tracked};

/// Sentences of a verdict that are always open, if no more are warnings.
const MOST_SENTENCES: usize = 6;

/// The whole page for `run`. Never fails: missing parts are reported.
#[must_use]
pub fn render(run: &RunView) -> String {
    page(run, &run.digested())
}

fn page(run: &RunView, digest: &Digest) -> String {
    let rows = digest;
    let axes = tracked::tracking(run, rows);
    let timings = timing::read(run.timings());
    let is_untitled = run.title.trim().is_empty();
    let title = if is_untitled {
        "Untitled test"
    } else {
        &run.title
    };
    let part = rows.part().map(|part| format!("This page is of {part}."));
    let more: Vec<String> = part
        .into_iter()
        .chain(end_positions::sentences(run, rows))
        .collect();
    let head = html! {
        (filed(&run.filed))
        (banner(run, rows.after(), &more))
        (tiles(run, rows, &axes, &timings))
    };
    let effect = effect_of_errors(run, rows, &axes);
    let results = [
        identified::identification(rows, &axes),
        response(run, rows, &axes),
        tracking(run, rows, &axes, &effect),
        balance(run, rows),
        Some(timing::timing(run, rows, &timings)),
        Some(model(run, rows)),
        ground(run, rows),
        limits(run, rows, &digest.largest).map(|limits| section("Limits", limits)),
    ];
    let body = html! {
        (header("· hybrid test report", title, head))
        main {
            p.hint { (HINT) }
            @for result in results.into_iter().flatten() { (result) }
            (events::events(run))
            (machine(run))
        }
    };
    frame(title, &body)
}

/// Facts of the tested model, and its sketch.
fn model(run: &RunView, rows: &Digest) -> Markup {
    let mut facts = tested::facts(run);
    facts.push(("Recorded".to_owned(), recorded(rows)));
    if run.is_served() {
        let trials = format!(
            "{} beside the last exchange of each step. The histories leave them out; `gusset export --rate tick` has all exchanges",
            plural(run.replaced, "exchange", "exchanges")
        );
        facts.push(("Trials and repeated requests".to_owned(), trials));
    }
    let sketch = beside("sketch", sketch(&run.test.file));
    let markup = html! {
        (beside("model", html! { (definitions(&facts)) (sketch) }))
        (scale::of_both_ends(rows, &run.test.file))
    };
    section("Model", markup)
}

/// The machine, its grants, and the configuration.
fn machine(run: &RunView) -> Markup {
    let facts = tested::machine(run);
    let text = &run.test.text;
    let markup = html! {
        @if !facts.is_empty() { (definitions(&facts)) }
        @for text in refused(run) { (note(&text)) }
        @if text.trim().is_empty() { (note("The resolved configuration is missing from the run folder.")) }
        @else { (details("resolved.toml: running it again runs the same test", html! { pre { (text) } })) }
    };
    section("Machine and configuration", markup)
}

/// The number of rows of each kind, and whether some are missing between them.
fn recorded(rows: &Digest) -> String {
    let passed = rows.passed;
    // A server records its commands: only the controller knows which of them is a step.
    let (step, steps, of) = match rows.get("commits") {
        Some(_) => ("command", "commands", "a controller"),
        None => ("step", "steps", "the running test"),
    };
    let mut text = format!(
        "{}: {} of {of}",
        plural(rows.recorded, "row", "rows"),
        plural(passed.steps, step, steps)
    );
    let others = passed.ticks - passed.steps;
    if others > 0 {
        text += &format!(
            " and {} between two of them, in a hold or at a trip",
            plural(others, "tick", "ticks")
        );
    }
    let known = passed.ticks + passed.before + passed.leaving + passed.kept_back;
    let rest = rows.recorded - known;
    for (count, of) in [
        (passed.before, "before the test"),
        (passed.leaving, "of the shutdown"),
        (passed.kept_back, "not passed on to the specimen"),
        (rest, "of other states"),
    ] {
        if count > 0 {
            text += &format!("; {} {of}", plural(count, "row", "rows"));
        }
    }
    if passed.missing_steps > 0 {
        let are = if passed.missing_steps == 1 {
            "IS"
        } else {
            "ARE"
        };
        text += &format!(
            "; {} {are} MISSING between the first and the last: lines are broken there, and what needs all of them (lag, tracking, \
             spectra, intensities, energies) is left out",
            plural(
                passed.missing_steps,
                &step.to_uppercase(),
                &steps.to_uppercase()
            )
        );
    } else if passed.missing_ticks > 0 {
        text += &format!(
            "; no {step} is missing between the first and the last, but {} BETWEEN THEM",
            plural(passed.missing_ticks, "TICK IS", "TICKS ARE")
        );
    } else if rows.counted {
        text += &format!("; no {step} is missing between the first and the last");
    }
    text
}

fn banner(run: &RunView, after: Option<u64>, more: &[String]) -> Markup {
    let verdict = verdict(run, after, more);
    let class = match verdict.tone {
        Tone::Good => "good",
        Tone::Warning => "warning",
        Tone::Bad => "bad",
    };
    let open = verdict
        .warnings
        .max(MOST_SENTENCES)
        .min(verdict.sentences.len());
    let (first, rest) = verdict.sentences.split_at(open);
    let title = plural(rest.len() as u64, "more remark", "more remarks");
    let sentences = html! {
        @for text in first { p { (text) } }
        (details(&title, html! { @for text in rest { p { (text) } } }))
    };
    banner_with(class, &verdict.headline, sentences)
}
