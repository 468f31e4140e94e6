//! The page of several runs over each other: a rehearsal against the test, yesterday's against today's. Each further run is compared
//! with the first one.

use std::collections::HashMap;

use maud::{Markup, html};
use serde_json::Value;

use super::RunView;
use super::chart::{Chart, HALF, Ink, Look, Scale, WHOLE};
use super::digest::Digest;
use super::html::{
    self, HINT, beside, details, frame, header, note, paragraph, section, table, table_of,
};
use super::matched::{Apart, Matched};
use super::metrics;
use super::response;
use super::tested::clock_word;
use super::text::{
    NOTHING, count, exact, micros, number, or_dash, percent, plural, quantity, shortened,
};
use super::timing::{self, words};
use super::tracked::{self, Tracked};
use super::tracking;
use gusset_proof::RecordedVerdict;
use gusset_quantity::catalog::column::{DISP, FORCE, Kind, MEASURED};

/// A smaller number is shown without a prefix.
const SMALLEST_PREFIXED: f64 = 1e-12;
/// Rows of a table, and characters of a value in a table of settings.
const MOST_LISTED: usize = 60;
const MOST_SHOWN: usize = 120;
/// DOFs and axes that are drawn.
const MOST: usize = 4;
/// Names of the runs on a page, in order.
const ORDER: [&str; 6] = ["first", "second", "third", "fourth", "fifth", "sixth"];

/// One run of the page.
struct Of<'a> {
    order: &'static str,
    run: &'a RunView,
    rows: &'a Digest,
    axes: Vec<Tracked<'a>>,
}

impl Of<'_> {
    fn axis(&self, like: &Tracked<'_>) -> Option<&Tracked<'_>> {
        self.axes
            .iter()
            .find(|axis| axis.digest.axis == like.digest.axis)
    }
}

/// Runs on one page: `matched` has for each but the first the result for its rows against the first, or why they cannot be
/// compared row by row. Each run has a name.
#[must_use]
pub fn compare(runs: &[(&str, &RunView)], matched: &[Result<Matched, String>]) -> String {
    let names: Vec<&str> = runs.iter().map(|(name, _)| *name).collect();
    let title = names.join(" against ");
    let digests: Vec<_> = runs.iter().map(|(_, run)| run.digested()).collect();
    let all = runs.iter().zip(&digests).zip(ORDER);
    let all: Vec<Of<'_>> = all
        .map(|(((_, run), digest), order)| of(order, run, digest))
        .collect();
    let runs: Vec<&RunView> = runs.iter().map(|(_, run)| *run).collect();
    let found: Vec<&Matched> = matched
        .iter()
        .filter_map(|found| found.as_ref().ok())
        .collect();
    let head = html! { (banner(matched, &runs)) (key_figures(&all, &found)) };
    let brand = if runs.len() > 2 {
        "· comparison of several runs"
    } else {
        "· comparison of two runs"
    };
    let body = html! {
        (header(brand, &title, head))
        main {
            p.hint { (HINT) }
            (section("Response", html! { (histories(&all, matched)) (loops(&all)) }))
            (followed(&all))
            (timing(&all))
            (section("Model", html! { (facts(&all)) (settings(&runs)) }))
            @for (found, order) in matched.iter().zip(&ORDER[1..]) {
                @if let Ok(found) = found { (columns(found, order, matched.len() > 1)) }
            }
        }
    };
    frame(&title, &body)
}

fn of<'a>(order: &'static str, run: &'a RunView, digest: &'a Digest) -> Of<'a> {
    let rows = digest;
    let axes = tracked::tracking(run, rows);
    Of {
        order,
        run,
        rows,
        axes,
    }
}

/// Result of the comparison in one sentence.
#[must_use]
pub fn verdict(matched: &Result<Matched, String>) -> String {
    match matched {
        Err(why) => format!("not compared row by row: {why}"),
        Ok(found) if found.rows == 0 => "the runs have no step in common".to_owned(),
        Ok(found) => match &found.first {
            None => {
                let same = format!(
                    "the same to the last bit: {} of {}",
                    plural(found.rows, "row", "rows"),
                    plural(found.columns as u64, "column", "columns")
                );
                alone(found).map_or_else(|| same.clone(), |more| format!("{same}; but {more}"))
            }
            Some(first) => format!(
                "{}they differ first at step {}, {}, in {}: {:e} against {:e}",
                if found.only_counts {
                    "every number of structure and specimens is the same, only the count of ticks, holds and commands is not: "
                } else {
                    ""
                },
                first.step,
                exact(first.time, "s"),
                first.column,
                first.values.0,
                first.values.1
            ),
        },
    }
}

/// The verdict for readers of the page: the size of the first difference in place of two numbers with all digits.
fn found_in_words(found: &Matched) -> String {
    let Some(first) = &found.first else {
        return verdict(&Ok(found.clone()));
    };
    let column = found.apart.iter().find(|a| a.column.name == first.column);
    let unit = column.map_or("1", |apart| apart.column.unit.as_str());
    let only = if found.only_counts {
        "every number of structure and specimens is equal; only the count of ticks, holds and commands differs. "
    } else {
        ""
    };
    let apart = (first.values.1 - first.values.0).abs();
    let by = match apart {
        apart if !apart.is_finite() => String::new(),
        // No prefix reaches so far down.
        apart if apart < SMALLEST_PREFIXED && unit != "1" => {
            format!(" by {}\u{a0}{unit}", number(apart, 3))
        }
        apart => format!(" by {}", quantity(apart, unit)),
    };
    format!(
        "{only}the first difference is at step {} ({}): {} differs{by}",
        count(first.step),
        quantity(first.time, "s"),
        first.column
    )
}

/// Rows that only one of the runs has, in words.
fn alone(found: &Matched) -> Option<String> {
    let (first, second) = found.alone;
    (found.alone != (0, 0)).then(|| {
        format!(
            "{} of the first run and {} of the second have no counterpart",
            plural(first, "row", "rows"),
            count(second)
        )
    })
}

/// Missing parts of each run's record, in words; each sentence names its run.
#[must_use]
pub fn damages(runs: &[&RunView]) -> Vec<String> {
    let of = |(run, which): (&&RunView, &&str)| {
        let what = run.flaws.unfinished.iter().chain(&run.flaws.damaged);
        what.map(|what| format!("{which} run: {what}"))
            .collect::<Vec<_>>()
    };
    runs.iter().zip(&ORDER).flat_map(of).collect()
}

/// Findings of the verdict on each run, in words; an unstable loop comes first.
#[must_use]
pub fn doubts(runs: &[&RunView]) -> Vec<String> {
    let of = |(run, which): (&&RunView, &&str)| {
        let judged = verdict_of(run)?;
        let found = plural(judged.findings.len() as u64, "finding", "findings");
        let found = match (judged.headline(), judged.findings.is_empty()) {
            (Some(unstable), _) => unstable,
            (None, false) => format!("{found} of the verdict: see its own report"),
            (None, true) => return None,
        };
        Some((judged.unstable, format!("{which} run: {found}")))
    };
    let mut all: Vec<_> = runs.iter().zip(&ORDER).filter_map(of).collect();
    all.sort_by_key(|(is_unstable, _)| !is_unstable);
    all.into_iter().map(|(_, text)| text).collect()
}

fn verdict_of(run: &RunView) -> Option<&RecordedVerdict> {
    run.summary.as_ref()?.verdict.as_ref()
}

/// Colour and headline of one comparison, and what it found.
fn headline(
    matched: &Result<Matched, String>,
    is_damaged: bool,
) -> (bool, &'static str, Vec<String>) {
    let found = match matched {
        Err(why) => {
            return (
                false,
                "The runs cannot be compared row by row",
                vec![capital(why)],
            );
        }
        Ok(found) if found.rows == 0 => {
            return (false, "The runs have no step in common", Vec::new());
        }
        Ok(found) => found,
    };
    let is_whole = found.alone == (0, 0) && !is_damaged;
    let (is_good, headline) = match &found.first {
        None if is_whole => (true, "Both runs are identical to the last bit"),
        None => (
            false,
            "Both runs are identical where both have data, but data is missing",
        ),
        Some(_) => (false, "The runs differ"),
    };
    let mut more = vec![format!("{}.", capital(&found_in_words(found)))];
    if found.first.is_some() {
        more.extend(alone(found).map(|text| format!("{text}.")));
    }
    (is_good, headline, more)
}

fn banner(matched: &[Result<Matched, String>], runs: &[&RunView]) -> Markup {
    let (damages, doubts) = (damages(runs), doubts(runs));
    let is_unstable = runs
        .iter()
        .filter_map(|run| verdict_of(run))
        .any(|verdict| verdict.unstable);
    let each: Vec<_> = matched
        .iter()
        .map(|found| headline(found, !damages.is_empty()))
        .collect();
    let mut more: Vec<String> = Vec::new();
    for ((_, headline, told), order) in each.iter().zip(&ORDER[1..]) {
        let told = told.iter().cloned();
        match matched.len() {
            1 => more.extend(told),
            _ => more.push(capital(&format!(
                "{order} run against the first: {headline}. {}",
                told.collect::<Vec<_>>().join(" ")
            ))),
        }
    }
    if matched
        .iter()
        .any(|found| found.as_ref().is_ok_and(|found| found.rows > 0))
    {
        more.push(
            "The comparison takes all ticks of the running tests that both runs have at the same test time. It leaves out columns that depend on wall time."
                .to_owned(),
        );
    }
    let is_good = each.iter().all(|(is_good, ..)| *is_good);
    let first = each
        .first()
        .map_or("There is one run only", |(_, headline, _)| *headline);
    let headline = match (matched.len(), is_good) {
        (..=1, _) => first.to_owned(),
        (_, true) => "All runs are identical to the last bit".to_owned(),
        (_, false) => "The runs differ, or cannot be compared row by row".to_owned(),
    };
    let class = match is_good {
        _ if is_unstable => "bad",
        true if doubts.is_empty() => "good",
        _ => "warning",
    };
    let unstable = if is_unstable {
        "; a LOOP IS UNSTABLE"
    } else {
        ""
    };
    let told = damages.iter().chain(&doubts);
    more.extend(told.map(|text| format!("{}.", capital(text.trim_end_matches('.')))));
    html::banner(class, &format!("{headline}{unstable}"), &more)
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(char::to_uppercase);
    first.into_iter().flatten().chain(letters).collect()
}

/// A heading and the value of each run; `None` where no run has one.
fn known(
    what: impl Into<String>,
    values: impl IntoIterator<Item = Option<String>>,
) -> Option<Vec<String>> {
    let values: Vec<Option<String>> = values.into_iter().collect();
    let cells = || values.iter().cloned().map(or_dash);
    values
        .iter()
        .any(Option::is_some)
        .then(|| std::iter::once(what.into()).chain(cells()).collect())
}

/// A table with a column for each run.
fn by_runs(class: &str, first: &str, all: &[Of<'_>], rows: &[Vec<String>]) -> Markup {
    let heading: Vec<&str> = std::iter::once(first)
        .chain(all.iter().map(|of| of.order))
        .collect();
    table_of(class, &heading, rows)
}

/// Largest differences of displacement and force, and the largest values of all runs.
fn key_figures(all: &[Of<'_>], found: &[&Matched]) -> Markup {
    let mut shown: Vec<(String, String)> = found
        .iter()
        .take(1)
        .flat_map(|found| differences(found))
        .collect();
    let peak = |of: &Of<'_>| {
        let peak = response::largest_displacement(of.run, of.rows);
        peak.map(|(_, value, unit)| quantity(value.abs(), unit))
    };
    let force = |of: &Of<'_>| {
        let largest = tracked::largest(&of.axes, Tracked::largest_force);
        largest.map(|(axis, force)| quantity(force.abs(), axis.force_unit))
    };
    let orders: Vec<&str> = all.iter().map(|of| of.order).collect();
    let kinds = [
        (
            "largest displacement",
            all.iter().map(peak).collect::<Vec<_>>(),
        ),
        ("largest force", all.iter().map(force).collect()),
        ("deadline misses", all.iter().map(misses).collect()),
    ];
    for (words, values) in kinds {
        let values = known("", values).map(|row| row[1..].join(" | "));
        let words = format!("{words}, {}", orders.join(" | "));
        shown.extend(values.map(|text| (text, words)));
    }
    html::tiles(&shown)
}

fn misses(of: &Of<'_>) -> Option<String> {
    of.run
        .misses()
        .filter(|_| !of.run.is_simulated())
        .map(count)
}

/// The largest differences of displacement and force, and the number of rows they are of.
fn differences(matched: &Matched) -> Vec<(String, String)> {
    let largest = |kind: &Kind, words: &str| {
        let of_kind = |apart: &&Apart| kind.fits(&apart.column.name);
        let all = matched.apart.iter().filter(of_kind);
        let apart = all.max_by(|a, b| a.largest.total_cmp(&b.largest))?;
        let share = if apart.first.is_none() {
            ": none".to_owned()
        } else if apart.size > 0.0 {
            let share = percent(apart.largest / apart.size);
            format!(", {}: {share} of the largest value", apart.column.name)
        } else {
            format!(", {}", apart.column.name)
        };
        Some((
            quantity(apart.largest, &apart.column.unit),
            format!("largest difference of {words}{share}"),
        ))
    };
    let mut shown = Vec::new();
    if matched.rows > 0 {
        shown.extend(largest(&DISP, "displacement"));
        shown.extend(largest(&FORCE, "force"));
    }
    let columns = matched.columns;
    shown.push((
        count(matched.rows),
        format!("rows compared, {columns} columns each"),
    ));
    shown
}

/// Name and words of the columns that are drawn: displacements, then measured displacements and forces.
fn drawn(names: &[String]) -> Vec<(String, String)> {
    let dofs: Vec<u32> = names.iter().filter_map(|name| DISP.dof_in(name)).collect();
    let dofs = super::columns::spread(&dofs, MOST);
    let mut out: Vec<(String, String)> = dofs
        .iter()
        .map(|dof| (format!("x{dof}"), format!("Displacement of DOF {dof}")))
        .collect();
    for (kind, words) in [
        (MEASURED, "Measured displacement, specimen"),
        (FORCE, "Force, specimen"),
    ] {
        let axes = names.iter().filter_map(|name| {
            let (specimen, axis) = kind.axis_in(name)?;
            Some((name.clone(), format!("{words} {specimen}, axis {axis}")))
        });
        out.extend(axes.take(MOST));
    }
    out
}

/// Histories of all runs over each other, and the differences to the first where rows belong together.
fn histories(all: &[Of<'_>], matched: &[Result<Matched, String>]) -> Markup {
    let Some(first) = all.first() else {
        return Markup::default();
    };
    let drawn: Vec<Markup> = (drawn(&first.rows.names()).into_iter())
        .filter_map(|(name, title)| {
            let words = if FORCE.fits(&name) {
                "force"
            } else {
                "displacement"
            };
            let chart = Chart::history(title.clone(), Scale::new(words, first.rows.unit(&name)));
            let found = all
                .iter()
                .map(|of| Some((of.order, of.rows.history(&name)?)));
            let found = found.collect::<Option<Vec<_>>>()?;
            let chart = found.into_iter().fold(chart, |chart, (order, of)| {
                chart.with(order, of.time, of.values, Look::Line)
            });
            let differences = matched
                .iter()
                .zip(&ORDER[1..])
                .map(|(found, order)| difference(found, order, &name, &title));
            let differences: Vec<Markup> = differences.collect();
            (!chart.is_empty())
                .then(|| html! { (chart.figure()) @for one in &differences { (one) } })
        })
        .collect();
    html! {
        @if drawn.is_empty() { (paragraph("The runs have no recorded displacement or force in common.")) }
        @for one in &drawn { (one) }
    }
}

/// A column of a run less that of the first run, over time.
fn difference(found: &Result<Matched, String>, order: &str, name: &str, title: &str) -> Markup {
    let Some(table) = found.as_ref().ok().and_then(|found| found.table_of(name)) else {
        return Markup::default();
    };
    let column = format!("d:{name}");
    let (time, values) = (
        table.time_of(&column).unwrap_or_default(),
        table.get(&column).unwrap_or_default(),
    );
    if metrics::peak(values).is_none_or(|peak| peak.value == 0.0) {
        return note(&format!("{title}, {order} run: no difference."));
    }
    let name = format!("{order} − first");
    Chart::history(
        format!("{title}: {name}"),
        Scale::new("difference", table.unit(&column)),
    )
    .with(name, time, values, Look::Line)
    .inked(Ink::Series(4))
    .sized(WHOLE, 150.0)
    .figure()
}

/// Hysteresis of the axes that all runs have, over the same axes.
fn loops(all: &[Of<'_>]) -> Markup {
    let axes = all.first().map_or(&[][..], |first| &first.axes);
    let drawn = axes.iter().take(MOST).filter_map(|axis| {
        let title = format!("Hysteresis of {}", axis.name);
        let scales = [
            axis.disp("measured displacement"),
            Scale::new("force", axis.force_unit),
        ];
        let chart = Chart::new(title, scales[0], scales[1]).sized(HALF, 400.0);
        all.iter().try_fold(chart, |chart, of| {
            let digest = of.axis(axis)?.digest;
            digest.is_drawable().then(|| {
                chart.with(
                    of.order,
                    &digest.hysteresis.0,
                    &digest.hysteresis.1,
                    Look::Line,
                )
            })
        })
    });
    beside("grid", html! { @for chart in drawn { (chart.figure()) } })
}

/// Delay, amplitude error and energy error of the axes that all runs have; further indices are folded.
fn followed(all: &[Of<'_>]) -> Markup {
    let (mut plain, mut more) = (Vec::new(), Vec::new());
    for one in all.first().map_or(&[][..], |first| &first.axes) {
        let Some(axes) = all
            .iter()
            .map(|of| of.axis(one))
            .collect::<Option<Vec<_>>>()
        else {
            continue;
        };
        let figures: Vec<_> = axes.iter().map(|axis| axis.figures()).collect();
        for (place, (what, _)) in one.figures().into_iter().enumerate() {
            let values = figures.iter().map(|figures| figures[place].1.clone());
            plain.extend(known(format!("{}: {what}", one.name), values));
        }
        more.extend(indices(one, &axes));
    }
    if plain.is_empty() {
        return Markup::default();
    }
    let folded = html! {
        @if !more.is_empty() {
            (by_runs("", "", all, &more))
            (note("`gusset guide mathematics-errors` defines the indices."))
        }
    };
    let says = "Measured against target. Delay: positive where the measured displacement is behind. Energy error: positive where \
        the actuator adds energy to the test.";
    section(
        "Tracking",
        html! { (by_runs("", "", all, &plain)) (note(says)) (details("Tracking indices", folded)) },
    )
}

/// The indices of an axis, with those of the other runs under the names of `one`.
fn indices(one: &Tracked<'_>, axes: &[&Tracked<'_>]) -> Vec<Vec<String>> {
    let all: Vec<_> = axes.iter().map(|axis| tracking::indices(axis)).collect();
    let row = |(what, _): (String, _)| {
        let show = |own: &Vec<(String, [String; 3])>| {
            let (_, [value, _, corrected]) = own.iter().find(|(name, _)| *name == what)?;
            Some(match corrected.as_str() {
                NOTHING => value.clone(),
                corrected => format!("{value} (corrected {corrected})"),
            })
        };
        known(format!("{}: {what}", one.name), all.iter().map(show))
    };
    let names = tracking::indices(one).into_iter();
    names.filter_map(row).collect()
}

/// Deadline misses and percentiles of all runs.
fn timing(all: &[Of<'_>]) -> Markup {
    if all.iter().all(|of| of.run.is_simulated()) {
        let runs = if all.len() > 2 { "all" } else { "both" };
        let says = format!(
            "No timing: {runs} runs used the simulated clock, on which no deadline can be missed."
        );
        return section("Timing", paragraph(&says));
    }
    let timings = all.iter().map(|of| {
        let read = timing::read(of.run.timings().filter(|_| !of.run.is_simulated()));
        read.into_iter()
            .filter(|timing| timing.percentiles.count > 0)
            .collect::<Vec<_>>()
    });
    let timings: Vec<_> = timings.collect();
    let mut keys: Vec<&str> = Vec::new();
    for timing in timings.iter().flatten() {
        if timing.key != "miss" && !keys.contains(&timing.key.as_str()) {
            keys.push(&timing.key);
        }
    }
    let mut rows: Vec<Vec<String>> = known("deadline misses", all.iter().map(misses))
        .into_iter()
        .collect();
    for key in keys {
        let found = || {
            let of = |all: &Vec<timing::Timing>| {
                Some(all.iter().find(|timing| timing.key == key)?.percentiles)
            };
            timings.iter().map(of)
        };
        let name = words(key).0;
        rows.extend(known(
            format!("{name}, p99"),
            found().map(|p| Some(micros(p?.p99))),
        ));
        rows.extend(known(
            format!("{name}, largest"),
            found().map(|p| Some(micros(p?.max))),
        ));
    }
    match rows.is_empty() {
        true => section(
            "Timing",
            paragraph("No timing was recorded for these runs."),
        ),
        false => section("Timing", by_runs("", "", all, &rows)),
    }
}

fn facts(all: &[Of<'_>]) -> Markup {
    const NAMES: [&str; 9] = [
        "title",
        "status",
        "reason",
        "steps",
        "step",
        "λ",
        "clock",
        "deadline misses",
        "program",
    ];
    let of = |of: &Of<'_>| {
        let title = Some(of.run.title.clone());
        let Some(summary) = &of.run.summary else {
            return std::iter::once(title)
                .chain(std::iter::repeat_n(None, 8))
                .collect::<Vec<_>>();
        };
        vec![
            title,
            Some(summary.status.word().to_owned()),
            Some(summary.reason.clone()),
            Some(count(summary.steps)),
            Some(exact(summary.dt, "s")),
            summary.lambda.as_ref().map(|lambda| lambda.0.to_string()),
            Some(clock_word(summary.clock).to_owned()),
            of.run.misses().map(count),
            Some(summary.version.clone()),
        ]
    };
    let facts: Vec<_> = all.iter().map(of).collect();
    let rows = NAMES
        .iter()
        .enumerate()
        .filter_map(|(place, name)| known(*name, facts.iter().map(|own| own[place].clone())));
    by_runs("plain", "", all, &rows.collect::<Vec<_>>())
}

/// Keys of the configuration that are not alike.
fn settings(runs: &[&RunView]) -> Markup {
    let trees: Option<Vec<Value>> = runs
        .iter()
        .map(|run| toml::from_str(&run.test.text).ok())
        .collect();
    let Some(trees) = trees else {
        return note("The configurations cannot be compared: one of them cannot be read.");
    };
    let mut keys: Vec<String> = Vec::new();
    let flat = trees.iter().map(|tree| {
        let mut own = Vec::new();
        flat(tree, String::new(), &mut own);
        keys.extend(own.iter().map(|(key, _)| key.clone()));
        own.into_iter().collect::<HashMap<String, String>>()
    });
    let flat: Vec<_> = flat.collect();
    let mut seen = std::collections::HashSet::new();
    keys.retain(|key| seen.insert(key.clone()));
    // Values that differ, values that a later run lacks, and values that the first run lacks.
    let mut kinds: [Vec<Vec<String>>; 3] = Default::default();
    for key in keys {
        let values: Vec<Option<&String>> = flat.iter().map(|own| own.get(&key)).collect();
        if values.iter().all(|value| *value == values[0]) {
            continue;
        }
        let kind = if values[0].is_none() {
            2
        } else {
            usize::from(values.contains(&None))
        };
        let shown = around_difference(&values);
        kinds[kind].push(std::iter::once(key).chain(shown).collect());
    }
    let all: usize = kinds.iter().map(Vec::len).sum();
    if all == 0 {
        return note("The resolved configurations are alike.");
    }
    let shares = shares(kinds.each_ref().map(Vec::len), MOST_LISTED);
    let listed = kinds.into_iter().zip(shares);
    let rows: Vec<Vec<String>> = listed
        .flat_map(|(rows, share)| rows.into_iter().take(share))
        .collect();
    let more = (all - rows.len()) as u64;
    let heading: Vec<&str> = std::iter::once("key")
        .chain(ORDER)
        .take(runs.len() + 1)
        .collect();
    html! {
        h3 { "Settings that differ" }
        (table_of("plain", &heading, &rows))
        @if more > 0 {
            (note(&format!("{} differ{}.", plural(more, "more key", "more keys"), if more == 1 { "s" } else { "" })))
        }
    }
}

/// How far each column is apart.
fn columns(matched: &Matched, order: &str, is_one_of_many: bool) -> Markup {
    let heading = match is_one_of_many {
        true => format!("Differences by column, {order} run"),
        false => "Differences by column".to_owned(),
    };
    let mut apart: Vec<_> = matched
        .apart
        .iter()
        .filter(|apart| apart.first.is_some())
        .collect();
    if apart.is_empty() {
        return section(&heading, paragraph("No column differs."));
    }
    apart.sort_by_key(|apart| apart.first);
    let share = |apart: &Apart| (apart.size > 0.0).then(|| apart.largest / apart.size);
    let two = |share: f64| format!("{}\u{a0}%", number(100.0 * share, 2));
    let row = |apart: &&Apart| {
        let unit = apart.column.unit.as_str();
        vec![
            apart.column.name.clone(),
            or_dash(apart.first.map(count)),
            quantity(apart.largest, unit),
            or_dash(
                apart
                    .at
                    .is_finite()
                    .then(|| format!("{:.4}\u{a0}s", apart.at)),
            ),
            or_dash(share(apart).map(two)),
            quantity(apart.rms, unit),
        ]
    };
    let rows: Vec<_> = apart.iter().take(MOST_LISTED).map(row).collect();
    let heads = [
        "column",
        "from step",
        "largest difference",
        "at",
        "of the largest value",
        "root mean square",
    ];
    let largest = apart
        .iter()
        .filter_map(|apart| Some((apart, share(apart)?)));
    let largest = largest.max_by(|a, b| a.1.total_cmp(&b.1));
    let most = largest.map_or_else(String::new, |(apart, share)| {
        format!(
            " The largest difference is {} of the largest value, in {}.",
            two(share),
            apart.column.name
        )
    });
    let says = format!(
        "{} of {} columns differ.{most}",
        apart.len(),
        matched.columns
    );
    let list = html! {
        (table(&heads, &rows))
        @if apart.len() > MOST_LISTED { (note(&format!("{MOST_LISTED} of {} columns that differ are listed.", apart.len()))) }
    };
    section(
        &heading,
        html! { (paragraph(&says)) (details("Every column that differs", list)) },
    )
}

/// How many of each list are shown where `room` are shown in all: one after the other has its turn, so that none crowds out another.
fn shares(lengths: [usize; 3], room: usize) -> [usize; 3] {
    let mut shares = [0; 3];
    let (mut left, mut is_over) = (room, false);
    while left > 0 && !is_over {
        is_over = true;
        for (share, length) in shares.iter_mut().zip(lengths) {
            if *share < length && left > 0 {
                (*share, left, is_over) = (*share + 1, left - 1, false);
            }
        }
    }
    shares
}

/// Texts that are not alike, so short that a table has room for them, with the place at which they part.
fn around_difference(texts: &[Option<&String>]) -> Vec<String> {
    let known: Vec<&String> = texts.iter().copied().flatten().collect();
    let alike = |other: &&String| {
        known[0]
            .chars()
            .zip(other.chars())
            .take_while(|(a, b)| a == b)
            .count()
    };
    let alike = known.iter().skip(1).map(alike).min().unwrap_or(0);
    let before = alike.saturating_sub(MOST_SHOWN / 3);
    let show = |text: &String| {
        if before == 0 || text.chars().count() <= MOST_SHOWN {
            return shortened(text, MOST_SHOWN);
        }
        let rest: String = text.chars().skip(before).collect();
        shortened(&format!("…{rest}"), MOST_SHOWN)
    };
    texts
        .iter()
        .map(|text| text.map_or_else(|| NOTHING.to_owned(), show))
        .collect()
}

fn flat(value: &Value, path: String, out: &mut Vec<(String, String)>) {
    let join = |key: &str| {
        if path.is_empty() {
            key.to_owned()
        } else {
            format!("{path}.{key}")
        }
    };
    match value {
        Value::Object(map) => map
            .iter()
            .for_each(|(key, value)| flat(value, join(key), out)),
        Value::Array(list) if list.iter().any(Value::is_object) => {
            for (i, value) in list.iter().enumerate() {
                // As `--set` and every message count them.
                flat(value, format!("{path}.{i}"), out);
            }
        }
        other => out.push((path, other.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::super::matched::Matcher;
    use super::super::synthetic::columns;
    use super::*;
    use crate::Flaws;

    #[test]
    fn equal_runs_are_good_only_if_complete() {
        let names = columns(&["step", "sub_tick", "state", "time", "x1"]);
        let found = |left: (u64, u64)| {
            let mut matcher = Matcher::new(&names, &names, 2).unwrap();
            let row = [0.0, 0.0, 3.0, 0.0, 1.0];
            matcher.take(&row, &row);
            Ok(matcher.finish(left))
        };
        let whole = RunView::default();
        let torn = RunView {
            flaws: Flaws {
                damaged: vec!["row 7 of the samples is damaged".to_owned()],
                ..Flaws::default()
            },
            ..RunView::default()
        };
        let page =
            |second: &RunView, left| compare(&[("a", &whole), ("b", second)], &[found(left)]);
        assert!(page(&whole, (0, 0)).contains("verdict good"));
        let short = page(&whole, (0, 9));
        assert!(short.contains("verdict warning") && !short.contains("verdict good"));
        assert!(short.contains("0\u{a0}rows of the first run and 9 of the second"));
        let damaged = page(&torn, (0, 0));
        assert!(!damaged.contains("verdict good"));
        assert!(damaged.contains("Second run: row 7 of the samples is damaged."));
        assert!(verdict(&found((0, 9))).contains("no counterpart"));
    }
    fn configured(resolved: String) -> RunView {
        let file = crate::TestFile::default();
        RunView {
            test: crate::ResolvedTest {
                text: resolved,
                file,
            },
            ..RunView::default()
        }
    }

    #[test]
    fn difference_far_along_a_list_is_found() {
        let listed = |last: f64| {
            let values: Vec<String> = (0..200).map(|i| format!("{i}.5")).collect();
            configured(format!("mass_kg = [{}, {last:?}]\n", values.join(", ")))
        };
        let alike = settings(&[&listed(7.25), &listed(7.25)]).0;
        assert!(alike.contains("are alike"), "{alike}");
        let page = settings(&[&listed(7.25), &listed(8.25)]).0;
        assert!(!page.contains("alike"), "{page}");
        for part in ["mass_kg", "…", "199.5,7.25]", "199.5,8.25]"] {
            assert!(page.contains(part), "{part} is missing in {page}");
        }
        // The list itself is not shown to where they part.
        assert!(!page.contains("100.5"), "{page}");
    }

    #[test]
    fn unlisted_differences_are_counted() {
        let keys = |name: &str, count: usize| -> String {
            (0..count).map(|i| format!("{name}{i:03} = 1\n")).collect()
        };
        let first = configured(keys("a", 100) + "both = 1\n");
        let second = configured(keys("b", 25) + "both = 2\n");
        let page = settings(&[&first, &second]).0;
        let rows = page.matches("<tr>").count() - 1;
        assert_eq!(rows, MOST_LISTED);
        for key in ["both", "a033", "b024"] {
            assert!(page.contains(&format!("<td>{key}</td>")), "{key}");
        }
        assert!(page.contains("66\u{a0}more keys differ."), "{page}");
        assert_eq!(shares([3, 100, 0], 60), [3, 57, 0]);
        assert_eq!(shares([1, 2, 0], 60), [1, 2, 0]);
    }
}
