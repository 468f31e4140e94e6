//! The report of a campaign: one page without scripts.

use super::drawing::{of, picture, scale, short};
use super::found::{Collected, Shown};
use super::fragility::{Fragility, Level};
use super::ida::ida;
use super::measure::Measure;
use super::plan::Campaign;
use super::study::Study;
use super::task::Task;
use crate::config::Design;
use crate::view::report::{Curve, Scale, definitions, escape, frame, note, section, table};

/// Most drawn numbers with a scatter picture.
const MOST_SCATTER: usize = 6;
/// Most files that the page names.
const MOST_FILES: usize = 50;

/// The page.
pub(super) fn render(campaign: &Campaign, collected: &Collected, shown: &[Shown]) -> String {
    let study = &campaign.study;
    let title = study.title();
    let (class, headline) = if collected.is_complete() {
        (
            "good",
            format!("All {} tests have a result", collected.tasks),
        )
    } else {
        let (done, tasks) = (collected.done, collected.tasks);
        (
            "bad",
            format!("PARTIAL: {done} of {tasks} tests have a result"),
        )
    };
    let mut body = format!(
        "<header>\n<p class=\"brand\">gusset {} · campaign</p>\n<h1>{}</h1>\n\
         <div class=\"verdict {class}\">\n<p class=\"headline\">{}</p>\n<p>{} tests stopped before their end. {} tasks have no \
         valid test.</p>\n</div>\n</header>\n<main>\n",
        escape(&campaign.plan.gusset),
        escape(&title),
        escape(&headline),
        collected.stopped,
        collected.invalid,
    );
    let measures: Vec<&Measure> = study
        .reported()
        .iter()
        .map(|i| &study.measures[*i])
        .collect();
    for (place, measure) in measures.iter().enumerate() {
        body += &of_measure(study, measure, place, shown);
    }
    if let Some((fit, levels)) = &collected.fragility {
        body += &fragility(study, fit.as_ref(), levels);
    }
    body += &provenance(campaign, collected);
    body += "</main>\n";
    frame(&title, &body)
}

/// Pictures of one measure.
fn of_measure(study: &Study, measure: &Measure, place: usize, shown: &[Shown]) -> String {
    let mut markup = String::new();
    if shown.iter().any(|one| one.level.is_some()) {
        markup += &ida(study, measure, place, shown);
    }
    let values: Vec<f64> = shown.iter().map(|one| one.values[place]).collect();
    markup += &distribution(measure, &values);
    if study.loaded.study.campaign.design == Design::OneAtATime && !study.axes.is_empty() {
        markup += &sensitivity(study, measure, place, shown);
    }
    for (index, sample) in study.samples.iter().enumerate().take(MOST_SCATTER) {
        let draws: Vec<f64> = shown
            .iter()
            .map(|one| Task::of(study, one.index).draws[index])
            .collect();
        let key = sample.key.to_string();
        let curve = Curve {
            name: "tests",
            x: &draws,
            y: &values,
            dots: true,
            reference: false,
        };
        let title = format!("{} over {key}", measure.name);
        markup += &picture(&title, scale(&key, ""), of(measure), &[curve]);
    }
    section(&measure.meaning, &markup)
}

/// Histogram and exceedance of a measure.
fn distribution(measure: &Measure, values: &[f64]) -> String {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let (Some(low), Some(high)) = (sorted.first().copied(), sorted.last().copied()) else {
        return note("No test has a value.");
    };
    if high <= low {
        return note(&format!("All tests have the value {}.", short(low)));
    }
    let count = sorted.len();
    let exceedance: Vec<f64> = (0..count)
        .map(|i| 1.0 - (i as f64 + 0.5) / count as f64)
        .collect();
    let bins = ((count as f64).sqrt().ceil() as usize).clamp(5, 40);
    let width = (high - low) / bins as f64;
    let mut counts = vec![0_u64; bins];
    for value in &sorted {
        counts[(((value - low) / width) as usize).min(bins - 1)] += 1;
    }
    let (mut x, mut y) = (vec![low], vec![0.0]);
    for (bin, number) in counts.iter().enumerate() {
        let share = *number as f64 / count as f64;
        x.extend([low + bin as f64 * width, low + (bin + 1) as f64 * width]);
        y.extend([share, share]);
    }
    x.push(high);
    y.push(0.0);
    let line = |name, x, y| Curve {
        name,
        x,
        y,
        dots: false,
        reference: false,
    };
    let histogram = [line("", &x[..], &y[..])];
    let above = [line("", &sorted[..], &exceedance[..])];
    let share = Scale {
        words: "share of the tests",
        unit: "1",
        range: None,
    };
    picture(
        &format!("Histogram: {}", measure.name),
        of(measure),
        share,
        &histogram,
    ) + &picture(
        &format!("Exceedance: {}", measure.name),
        of(measure),
        share,
        &above,
    )
}

/// Range of a measure over the values of each key, the largest first.
fn sensitivity(study: &Study, measure: &Measure, place: usize, shown: &[Shown]) -> String {
    let mut all: Vec<(f64, Vec<String>)> = Vec::new();
    for (index, axis) in study.axes.iter().enumerate() {
        let own = shown
            .iter()
            .filter(|one| Task::of(study, one.index).values[index].is_some());
        let values: Vec<f64> = own
            .map(|one| one.values[place])
            .filter(|v| v.is_finite())
            .collect();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if low <= high {
            let row = vec![axis.key.clone(), short(low), short(high), short(high - low)];
            all.push((high - low, row));
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let rows: Vec<Vec<String>> = all.into_iter().map(|(_, row)| row).collect();
    let unit = if measure.unit == "1" {
        ""
    } else {
        &measure.unit
    };
    let head = format!("range of {} {unit}", measure.name);
    table(&["key", "smallest", "largest", head.trim()], &rows)
}

fn fragility(study: &Study, fit: Option<&Fragility>, levels: &[Level]) -> String {
    let first = study.motions.first();
    let words = first.map(|one| one.words()).unwrap_or_default();
    let unit = first.map(|one| one.unit()).unwrap_or_default();
    let x: Vec<f64> = levels.iter().map(|one| one.level).collect();
    let y: Vec<f64> = levels.iter().map(|one| one.collapses / one.tests).collect();
    let most = x.iter().copied().fold(0.0, f64::max);
    let fine: Vec<f64> = (1..=200).map(|i| most * f64::from(i) / 200.0).collect();
    let curve: Vec<f64> = fit.map_or_else(Vec::new, |fit| {
        fine.iter().map(|level| fit.probability(*level)).collect()
    });
    let mut curves = vec![Curve {
        name: "tests",
        x: &x,
        y: &y,
        dots: true,
        reference: false,
    }];
    let text = match fit {
        Some(fit) => {
            curves.push(Curve {
                name: "lognormal fit",
                x: &fine,
                y: &curve,
                dots: false,
                reference: false,
            });
            format!(
                "Median θ = {} {unit} (standard error of ln θ: {}), dispersion β = {} (standard error {}). Binomial maximum \
                 likelihood over {} levels.",
                short(fit.median),
                short(fit.ln_median_error),
                short(fit.dispersion),
                short(fit.dispersion_error),
                levels.len()
            )
        }
        None => "The counts do not determine a curve: use more levels between no collapse and all."
            .to_owned(),
    };
    let up = Scale {
        words: "probability of collapse",
        unit: "1",
        range: Some((0.0, 1.0)),
    };
    let picture = picture("Fragility", scale(&words, &unit), up, &curves);
    section("Fragility", &(picture + &note(&text)))
}

fn provenance(campaign: &Campaign, collected: &Collected) -> String {
    let plan = &campaign.plan;
    let pair = |name: &str, text: String| (name.to_owned(), text);
    let mut pairs = vec![
        pair("study", plan.study.display().to_string()),
        pair("executable (BLAKE3)", plan.executable.clone()),
        pair(
            "seed",
            campaign.study.loaded.study.campaign.seed.to_string(),
        ),
        pair(
            "computed again with equal bits",
            format!("{} tasks", collected.proved),
        ),
    ];
    let files = plan.files.iter().take(MOST_FILES);
    pairs.extend(files.map(|(name, digest)| pair(name, digest.clone())));
    if !collected.damaged.is_empty() {
        pairs.push(pair("damaged parts", collected.damaged.join(", ")));
    }
    section("Provenance", &definitions(&pairs))
}
