//! The page a run leaves behind: one self-contained HTML file. Verdict first, machine and configuration last.

use sha2::{Digest as _, Sha256};

use super::RunView;
use super::balance::balance;
use super::digest::Digest;
use super::effect::effect_of_errors;
use super::end_positions;
use super::events;
use super::figures::tiles;
use super::following;
use super::ground::ground;
use super::histogram;
use super::html::{beside, definitions, details, note, section, table};
use super::identified;
use super::limits::limits;
use super::outcome::{Tone, refused, verdict};
use super::plots::base64;
use super::response;
use super::rows::Rows;
use super::scale;
use super::sketch::sketch;
use super::specimens;
use super::tested;
use super::text::{escape, number, plural};
use super::timeline::timeline;
use super::timing;
use super::tracked;
use crate::Trials;
use crate::assets::{CHART_LICENCE, CHART_SCRIPT, CHART_STYLE};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("script.js");
/// Hints that need a script in the reader's browser.
pub(super) const HINT: &str = "<p class=\"hint\">Drag across a history to zoom all of them in time; a double click, or the button that \
    then appears, shows the whole test again.</p>\n<noscript><p class=\"note\">Scripts are off: the pictures cannot be zoomed, but \
    nothing is missing.</p></noscript>\n";
/// Steps with trials that are listed.
const LISTED_TRIALS: usize = 20;
/// Sentences of a verdict that are always open, if no more are warnings.
const MOST_SENTENCES: usize = 6;

/// The whole page for `run`. Never fails: missing parts are reported.
#[must_use]
pub fn render(run: &RunView) -> String {
    let digest = run.digested();
    page(run, &digest)
}

fn page(run: &RunView, digest: &Digest) -> String {
    let rows = Rows::new(digest);
    let axes = tracked::tracking(run, &rows);
    let timings = histogram::read(run.timings());
    let title = if run.title.trim().is_empty() {
        "Untitled test"
    } else {
        &run.title
    };
    let mut body = format!(
        "<header>\n<p class=\"brand\">gusset · hybrid test report</p>\n<h1>{}</h1>\n",
        escape(title)
    );
    let part = rows.part().map(|part| format!("This page is of {part}."));
    let left = end_positions::sentences(run, &rows);
    let more: Vec<String> = part.into_iter().chain(left).collect();
    body += &banner(run, rows.after(), &more);
    body += &tiles(run, &rows, &axes, &timings);
    body += "</header>\n<main>\n";
    body += HINT;
    let loops = specimens::loops(&rows, &axes);
    let peaks = specimens::peaks(run, &rows, &axes);
    let effect = effect_of_errors(run, &rows, &axes);
    let results = [
        identified::identification(&rows, &axes),
        response::response(run, &rows, &loops, &peaks),
        specimens::response(run, &rows, &axes, &loops),
        following::tracking(&rows, &axes, &effect),
        balance(&rows, run.no_balance.as_deref()),
        Some(timing::timing(run, &rows, &timings)),
        Some(model(run, &rows)),
        ground(&rows),
        limits(run, &rows, &digest.largest).map(|limits| section("Limits", &limits)),
    ];
    body.extend(results.into_iter().flatten());
    body += &events::events(run, &timeline(run));
    body += &machine(run);
    body += "</main>\n";
    zoomable(title, &body)
}

/// Facts of the tested model, and its sketch.
fn model(run: &RunView, rows: &Rows<'_>) -> String {
    let mut facts = tested::facts(run);
    facts.push(("Recorded".to_owned(), recorded(rows)));
    if run.is_served() {
        let replaced = run.trials.iter().map(|one| one.replaced).sum();
        let trials = format!(
            "{} beside the last exchange of each step. The histories leave them out; `gusset export --rate tick` has all exchanges",
            plural(replaced, "exchange", "exchanges")
        );
        facts.push(("Trials and repeated requests".to_owned(), trials));
    }
    let drawn = sketch(&run.test.file);
    let drawn = if drawn.is_empty() {
        drawn
    } else {
        beside("sketch", &drawn)
    };
    let ends = scale::of_both_ends(rows, &run.test.file) + &trials(&run.trials);
    let markup = beside("model", &(definitions(&facts) + &drawn));
    section("Model", &(markup + &ends))
}

/// The steps of a served test with most trials and repeated requests; nothing without any.
fn trials(trials: &[Trials]) -> String {
    if trials.is_empty() {
        return String::new();
    }
    let mut most = trials.to_vec();
    most.sort_by(|a, b| {
        b.replaced
            .cmp(&a.replaced)
            .then(a.time_s.total_cmp(&b.time_s))
    });
    most.truncate(LISTED_TRIALS);
    let rows: Vec<Vec<String>> = (most.iter())
        .map(|one| vec![number(one.time_s, 6), (one.replaced + 1).to_string()])
        .collect();
    let title = format!(
        "Trials and repeated requests: {}",
        plural(trials.len() as u64, "step", "steps")
    );
    details(&title, &table(&["Test time (s)", "Exchanges"], &rows))
}

/// The machine, its grants, and the configuration.
fn machine(run: &RunView) -> String {
    let facts = tested::machine(run);
    let facts = if facts.is_empty() {
        String::new()
    } else {
        definitions(&facts)
    };
    let refused: String = refused(run).iter().map(|text| note(text)).collect();
    let text = &run.test.text;
    let configuration = if text.trim().is_empty() {
        note("The resolved configuration is missing from the run folder.")
    } else {
        let title = "resolved.toml: running it again runs the same test";
        details(title, &format!("<pre>{}</pre>\n", escape(text)))
    };
    section(
        "Machine and configuration",
        &(facts + &refused + &configuration),
    )
}

/// The number of rows of each kind, and whether some are missing between them.
fn recorded(rows: &Rows<'_>) -> String {
    let passed = rows.passed();
    // A server records its commands: only the controller knows which of them is a step.
    let (step, steps, of) = match rows.get("commits") {
        Some(_) => ("command", "commands", "a controller"),
        None => ("step", "steps", "the running test"),
    };
    let mut text = format!(
        "{}: {} of {of}",
        plural(rows.recorded(), "row", "rows"),
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
    let rest = rows.recorded() - known;
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
    } else if rows.digest().counted {
        text += &format!("; no {step} is missing between the first and the last");
    }
    text
}

/// A whole page with histories that can be zoomed. Nothing but our own script is executed and nothing is fetched: the page
/// itself forbids it, by the script's digest.
pub(super) fn zoomable(title: &str, markup: &str) -> String {
    let script = format!("{CHART_SCRIPT}\n{SCRIPT}");
    let digest = base64(&Sha256::digest(script.as_bytes()));
    let policy = format!(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
         script-src 'sha256-{digest}'\">\n"
    );
    let licence = CHART_LICENCE.trim().replace("--", "- -");
    let scripts = format!("<!--\nCharts: uPlot\n{licence}\n-->\n<script>{script}</script>\n");
    whole(title, &policy, CHART_STYLE, markup, &scripts)
}

/// A whole page round `markup`: self-contained, with the style sheet of all our pages.
pub fn frame(title: &str, markup: &str) -> String {
    whole(title, "", "", markup, "")
}

fn whole(title: &str, head: &str, style: &str, markup: &str, tail: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{head}\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{}</title>\n<style>\n{style}{STYLE}</style>\n</head>\n\
         <body>\n{markup}{tail}</body>\n</html>\n",
        escape(title)
    )
}

fn banner(run: &RunView, after: Option<u64>, more: &[String]) -> String {
    let verdict = verdict(run, after, more);
    let class = match verdict.tone {
        Tone::Good => "good",
        Tone::Warning => "warning",
        Tone::Bad => "bad",
    };
    let written = |sentences: &[String]| -> String {
        let each = sentences.iter().map(|s| format!("<p>{}</p>\n", escape(s)));
        each.collect()
    };
    let open = verdict.warnings.max(MOST_SENTENCES);
    let open = open.min(verdict.sentences.len());
    let (first, rest) = verdict.sentences.split_at(open);
    format!(
        "<div class=\"verdict {class}\">\n<p class=\"headline\">{}</p>\n{}{}</div>\n",
        escape(&verdict.headline),
        written(first),
        details(
            &plural(rest.len() as u64, "more remark", "more remarks"),
            &written(rest)
        )
    )
}
