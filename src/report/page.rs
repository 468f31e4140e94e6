//! The page a run leaves behind: one self-contained HTML file, verdict first, configuration last.

use sha2::{Digest as _, Sha256};

use super::RunData;
use super::balance::balance;
use super::digest::Digest;
use super::falsified::falsified_section;
use super::ground::ground;
use super::html::{beside, definitions, note, section};
use super::identified;
use super::left;
use super::limits::limits;
use super::outcome::{self, Tone, verdict};
use super::plots::base64;
use super::response;
use super::rows::Rows;
use super::scale;
use super::sketch::sketch;
use super::specimens;
use super::tested;
use super::text::{NOTHING, count, escape, micros, plural, quantity};
use super::timeline::timeline;
use super::tracked;
use super::{histogram, loops};
use crate::assets::{CHART_LICENCE, CHART_SCRIPT, CHART_STYLE};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("script.js");
/// What only a reader with a script can do.
const HINT: &str = "<p class=\"hint\">Drag across a history to zoom all of them in time; a double click, or the button that \
    then appears, shows the whole test again.</p>\n<noscript><p class=\"note\">Scripts are off: the pictures cannot be zoomed, but \
    nothing is missing.</p></noscript>\n";

/// The whole page for `run`. Never fails: what is missing is said to be missing.
#[must_use]
pub fn render(run: &RunData) -> String {
    let digest = run.digested();
    page(run, &digest)
}

fn page(run: &RunData, digest: &Digest) -> String {
    let rows = Rows::new(digest);
    let configuration = tested::configuration(run);
    let axes = tracked::tracking(run, &rows, configuration.as_ref());
    let timings = loops::timings(run);
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
    let left = left::sentences(run, &rows, configuration.as_ref());
    let more: Vec<String> = part.into_iter().chain(left).collect();
    body += &banner(run, rows.after(), &more);
    body += &tiles(run, &rows, &axes, &timings);
    body += "</header>\n<main>\n";
    let facts = tested::facts(run, configuration.as_ref());
    let recorded = recorded(&rows);
    let facts = [facts, vec![("Recorded".to_owned(), recorded)]].concat();
    let drawn = beside("sketch", &sketch(configuration.as_ref()));
    let ends = scale::of_both_ends(&rows, configuration.as_ref());
    body += &section(
        "Tested system",
        &(definitions(&facts) + &drawn + &ends + &limits(run)),
    );
    body += HINT;
    let parts = [
        identified::identification(&rows, &axes),
        ground(&rows),
        response::response(run, &rows),
        specimens::specimens(run, &rows, &axes),
        falsified_section(run, &rows, &axes),
        balance(&rows, run.no_balance.as_deref()),
    ];
    body.extend(parts.into_iter().flatten());
    body += &loops::timing(run, &rows, &timings);
    body += &loops::events(run, &timeline(run));
    body += &configuration_section(run);
    body += "</main>\n";
    zoomable(title, &body)
}

/// How many rows there are of what, and whether some are missing between them.
fn recorded(rows: &Rows<'_>) -> String {
    let passed = rows.passed();
    // A server records what it is commanded: which of it is a step, the controller knows.
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
pub(crate) fn frame(title: &str, markup: &str) -> String {
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

fn banner(run: &RunData, after: Option<u64>, more: &[String]) -> String {
    let verdict = verdict(run, after, more);
    let class = match verdict.tone {
        Tone::Good => "good",
        Tone::Warning => "warning",
        Tone::Bad => "bad",
    };
    let sentences: String = verdict
        .sentences
        .iter()
        .map(|s| format!("<p>{}</p>\n", escape(s)))
        .collect();
    format!(
        "<div class=\"verdict {class}\">\n<p class=\"headline\">{}</p>\n{sentences}</div>\n",
        escape(&verdict.headline)
    )
}

/// The largest displacement and the largest force: of the whole test, as far as the summary tells of it; of one that made no step,
/// what was before the first.
fn extremes(
    run: &RunData,
    rows: &Rows<'_>,
    axes: &[tracked::Tracked<'_>],
) -> Vec<(String, String)> {
    let has_run = rows.running() > 0 || outcome::number(run, "steps").is_some_and(|n| n > 0.0);
    let of = match (rows.part(), outcome::at(run, "peak")) {
        (None, _) => String::new(),
        (Some(_), Some(_)) => ", of the whole test".to_owned(),
        (Some(_), None) => of_steps(rows),
    };
    let mut tiles = Vec::new();
    if let Some((dof, value, unit)) = response::largest_displacement(run, rows) {
        let words = if has_run {
            format!("largest displacement, DOF {dof}{of}")
        } else {
            format!("displacement at the start, DOF {dof}: no step was made")
        };
        tiles.push((quantity(value, unit), words));
    }
    if !has_run {
        let way_in = tracked::largest(axes, tracked::Tracked::force_on_the_way_in);
        tiles.extend(way_in.map(|(axis, (force, unit))| {
            let words = format!("largest force before the first step, {}", axis.force_of());
            (quantity(force, unit), words)
        }));
    } else if let Some((axis, (force, unit))) =
        tracked::largest(axes, tracked::Tracked::largest_force)
    {
        let way_out = tracked::largest(axes, tracked::Tracked::force_on_the_way_out);
        let way_out = way_out.filter(|(_, (later, _))| later.abs() > force.abs());
        let words = match way_out {
            None => format!("largest force, {}{of}", axis.force_of()),
            Some((_, (later, unit))) => format!(
                "largest force of the running test, {}{of}; {} during shutdown",
                axis.force_of(),
                quantity(later, unit)
            ),
        };
        tiles.push((quantity(force, unit), words));
    }
    tiles
}

/// Which steps a number is of, where they are not all of the test.
fn of_steps(rows: &Rows<'_>) -> String {
    let steps = rows.steps().map(|steps| format!(", of {steps}"));
    steps.unwrap_or_default()
}

/// The numbers one looks for first.
fn tiles(
    run: &RunData,
    rows: &Rows<'_>,
    axes: &[tracked::Tracked<'_>],
    timings: &[histogram::Timing],
) -> String {
    let mut tiles = extremes(run, rows, axes);
    let lags = axes.iter().filter_map(|axis| Some((axis, axis.lag()?)));
    if let Some((axis, lag)) = lags.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) {
        let lag = if lag.abs() < 1e-9 {
            "0\u{a0}ms".to_owned()
        } else {
            quantity(lag, "s")
        };
        let largest = if axes.len() > 1 { "largest lag" } else { "lag" };
        tiles.push((lag, format!("{largest}, {}{}", axis.name, of_steps(rows))));
    }
    if outcome::text(run, "clock") != Some("simulated") {
        let misses = outcome::number(run, "deadline_misses");
        if let Some(misses) = misses.filter(|_| !outcome::is_served(run)) {
            tiles.push((count(misses as u64), "deadline misses".to_owned()));
        }
        if let Some(wakeup) = timings.iter().find(|t| t.key == "wakeup_lateness") {
            let show = |v: Option<f64>| v.map_or_else(|| NOTHING.to_owned(), micros);
            tiles.push((
                show(wakeup.percentiles.p99),
                "wake-up lateness, p99".to_owned(),
            ));
        }
    }
    let tile = |(value, words): &(String, String)| {
        format!(
            "<div><b>{}</b><span>{}</span></div>\n",
            escape(value),
            escape(words)
        )
    };
    if tiles.is_empty() {
        return String::new();
    }
    format!(
        "<div class=\"tiles\">\n{}</div>\n",
        tiles.iter().map(tile).collect::<String>()
    )
}

fn configuration_section(run: &RunData) -> String {
    if run.resolved.trim().is_empty() {
        return section(
            "Configuration",
            &note("The resolved configuration is missing from the run folder."),
        );
    }
    let markup = format!(
        "<details><summary>resolved.toml: running it again runs the same test</summary>\n<pre>{}</pre></details>\n",
        escape(&run.resolved)
    );
    section("Configuration", &markup)
}
