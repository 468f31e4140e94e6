//! The report of a campaign: one page without scripts.

use maud::{Markup, html};

use super::distribution::distribution;
use super::drawing::{chart, scale, short};
use super::found::{Collected, Shown};
use super::fragility::Collapses;
use super::ida::ida;
use super::largest::largest;
use super::measure::Measure;
use super::pairs::pairs;
use super::plan::Campaign;
use super::sensitivity::sensitivity;
use super::study::Study;
use gusset_config::Design;
use gusset_view::report::{
    Look, banner, count, definitions, details, filed, frame, header, note, section,
};

/// Most points of the design with separate charts.
const MOST_POINTS: usize = 6;
/// Most files that the page names.
const MOST_FILES: usize = 50;

/// How a task of the table becomes a run folder.
const RUN_FOLDER: &str = "gusset run TEST --clock simulated --set SETTING with these settings gives the whole run of a test. In a study with \
     drawn numbers or noise its values differ slightly: the controller knows the numbers, and the noise has another seed.";

/// The page. `shown` are the tests with a value, or a sample of them; `about` says who tested what, when and where.
pub(super) fn render(
    campaign: &Campaign,
    collected: &Collected,
    shown: &[Shown],
    about: &[(&'static str, String)],
) -> String {
    let study = &campaign.study;
    let title = study.title();
    let (class, headline) = if collected.is_complete() && collected.invalid > 0 {
        let valid = collected.done - collected.invalid;
        let text = format!("{valid} of {} tasks have a valid test", collected.tasks);
        ("warning", text)
    } else if collected.is_complete() {
        let is_known =
            !campaign.plan.errors.is_empty() || study.loaded.test.file.structure.is_none();
        let is_small = is_known && campaign.plan.of_errors().all(|(_, is_small)| is_small);
        (
            if is_small { "good" } else { "warning" },
            format!("All {} tests have a result", collected.tasks),
        )
    } else {
        let (done, tasks) = (collected.done, collected.tasks);
        (
            "bad",
            format!("PARTIAL: {done} of {tasks} tests have a result"),
        )
    };
    let counted = format!(
        "Collapsed: {}. Stopped by a limit or a fault before a collapse: {}. Tasks without a valid test: {}.",
        collected.collapsed, collected.censored, collected.invalid
    );
    let valid = collected.done - collected.invalid;
    let measures: Vec<&Measure> = study
        .reported()
        .iter()
        .map(|i| &study.measures[*i])
        .collect();
    let brand = format!("{} · campaign", campaign.plan.gusset);
    let body = html! {
        (header(&brand, &title, html! { (filed(about)) (banner(class, &headline, &[counted])) }))
        main {
            @if let Some(why) = &collected.invalid_example { (details("A task without a valid test", note(why))) }
            @if collected.redrawn > 0 {
                (note(&format!(
                    "The numbers of {} tests were drawn again, because the test file must not have the first ones.",
                    count(collected.redrawn)
                )))
            }
            @for (text, _) in campaign.plan.of_errors() { (note(&text)) }
            @if (shown.len() as u64) < valid {
                (note(&format!(
                    "The charts show {} of {} tests, chosen at random. The file table.csv contains all of them.",
                    count(shown.len() as u64),
                    count(valid)
                )))
            }
            @for (place, measure) in measures.iter().enumerate() {
                (of_measure(study, measure, place, shown, &largest(campaign, measure, &collected.largest[place])))
            }
            (pairs(study, &measures, shown))
            @for one in collected.fragility.iter().take(MOST_POINTS) { (fragility(study, one)) }
            (provenance(campaign, collected))
        }
    };
    frame(&title, &body)
}

/// IDA curves for each point of the design: fractiles belong to one structure.
fn by_points(study: &Study, measure: &Measure, place: usize, shown: &[Shown]) -> Markup {
    if study.points() == 1 {
        return ida(study, measure, place, shown);
    }
    let of_point = |point: u64| {
        let own = shown
            .iter()
            .filter(|one| study.point_of(one.index) == point);
        (point, own.cloned().collect::<Vec<Shown>>())
    };
    let points = (0..study.points().min(MOST_POINTS as u64)).map(of_point);
    html! {
        @for (point, own) in points.filter(|(_, own)| !own.is_empty()) {
            (note(&format!("With {}:", study.point_words(point))))
            (ida(study, measure, place, &own))
        }
        @if study.points() > MOST_POINTS as u64 {
            (note(&format!("The page shows the first {MOST_POINTS} of {} points.", study.points())))
        }
    }
}

/// Charts of one measure.
fn of_measure(
    study: &Study,
    measure: &Measure,
    place: usize,
    shown: &[Shown],
    largest: &Markup,
) -> Markup {
    let has_levels = shown.iter().any(|one| one.level.is_some());
    let alone = study.loaded.study.campaign.design == Design::OneAtATime && !study.axes.is_empty();
    let values: Vec<f64> = shown.iter().map(|one| one.values[place]).collect();
    let spread = distribution(measure, &values);
    // Tests of several intensities or values have no distribution that means anything by itself.
    let markup = html! {
        @if has_levels { (by_points(study, measure, place, shown)) }
        @if alone { (sensitivity(study, measure, place, shown)) }
        @if has_levels || alone { (details("Distribution over all tests", spread)) } @else { (spread) }
        (details("Tests with the largest values", html! { (largest) (note(RUN_FOLDER)) }))
    };
    section(&format!("{}: {}", measure.name, measure.meaning), markup)
}

fn fragility(study: &Study, found: &Collapses) -> Markup {
    let Collapses { point, fit, levels } = found;
    let first = study.levelled();
    let words = first.map(|one| one.words()).unwrap_or_default();
    let unit = first.map(|one| one.unit()).unwrap_or_default();
    let counted = levels.iter().filter(|one| one.tests > 0.0);
    let (x, y): (Vec<f64>, Vec<f64>) = counted
        .map(|one| (one.level, one.collapses / one.tests))
        .unzip();
    let most = 1.05 * x.iter().copied().fold(0.0, f64::max);
    let across = scale(&words, &unit).within((most > 0.0).then_some((0.0, most)));
    let up = scale("probability of collapse", "1").within(Some((0.0, 1.02)));
    let mut chart = chart("Fragility".to_owned(), across, up).with(
        "share of collapsed tests",
        x,
        y,
        Look::Dots,
    );
    if let Some(fit) = fit {
        let fine: Vec<f64> = (1..=200).map(|i| most * f64::from(i) / 200.0).collect();
        let fitted: Vec<f64> = fine.iter().map(|level| fit.probability(*level)).collect();
        chart = chart.with("lognormal fit", fine, fitted, Look::Strong);
        let median = fit.median;
        if median <= most {
            chart = chart.with(
                "median θ",
                vec![0.0, median, median],
                vec![0.5, 0.5, 0.0],
                Look::Reference,
            );
        }
    }
    let mut text = match fit {
        Some(fit) => format!(
            "Median θ = {} {unit} (standard error of ln θ: {}), dispersion β = {} (standard error {}). Binomial maximum \
             likelihood over {} levels.",
            short(fit.median),
            short(fit.ln_median_error),
            short(fit.dispersion),
            short(fit.dispersion_error),
            levels.len()
        ),
        None => "The counts do not determine a curve: use more levels between no collapse and all."
            .to_owned(),
    };
    let censored: f64 = levels.iter().map(|one| one.censored).sum();
    if censored > 0.0 {
        text += &format!(
            " {censored} further tests are not counted: a limit or a fault stopped them before a collapse."
        );
    }
    let heading = match point.as_str() {
        "" => "Fragility".to_owned(),
        point => format!("Fragility: {point}"),
    };
    section(&heading, html! { (chart.figure()) (note(&text)) })
}

fn provenance(campaign: &Campaign, collected: &Collected) -> Markup {
    let plan = &campaign.plan;
    let pair = |name: &str, text: String| (name.to_owned(), text);
    let mut pairs = vec![
        pair("study", plan.study.display().to_string()),
        pair("program (BLAKE3)", plan.program.digest()),
        pair(
            "seed",
            campaign.study.loaded.study.campaign.seed.to_string(),
        ),
        pair(
            "computed again with equal bits",
            format!(
                "{} tasks, chosen by --prove-seed {}",
                collected.proved, collected.proof_seed
            ),
        ),
    ];
    let files = plan.files.iter().take(MOST_FILES);
    pairs.extend(files.map(|(name, digest)| pair(name, digest.clone())));
    if !collected.damaged.is_empty() {
        pairs.push(pair("damaged parts", collected.damaged.join(", ")));
    }
    section("Provenance", definitions(&pairs))
}
