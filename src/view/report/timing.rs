//! The section on timing: percentiles, histograms, lateness over test time, and the ticks that took longest.

use super::RunView;
use super::bars::HistogramChart;
use super::canvas::Ink;
use super::charts::Quantity;
use super::histogram::{Timing, words};
use super::html::{beside, definitions, details, figure, note, paragraph, section, table};
use super::lines::{Reduce, TimeChart};
use super::outcome::{class_of, class_words, is_miss};
use super::plots::{WHOLE, history};
use super::rows::Rows;
use super::text::{NOTHING, count, micros, plural};
use gusset_quantity::catalog::column;
use gusset_record::miss::Evidence;
use gusset_record::{Event, EventLine};

/// Histograms that are always open.
const FIRST: [&str; 2] = ["wakeup_lateness", "tick_time"];
/// Histograms that are drawn.
const MOST_HISTOGRAMS: usize = 12;

/// Histograms, their percentiles and lateness over test time.
pub(super) fn timing(run: &RunView, rows: &Rows<'_>, timings: &[Timing]) -> String {
    let heading = "Timing";
    if run.is_simulated() {
        return section(
            heading,
            &paragraph(
                "No timing: this run used the simulated clock, on which no deadline can be missed.",
            ),
        );
    }
    if timings.iter().all(|t| t.percentiles.count == 0) {
        let markup = paragraph("No timing was recorded for this run.");
        return rows.section(heading, &(markup + &over_time(run, rows)));
    }
    let period = period_us(run);
    let drawn: Vec<_> = timings
        .iter()
        .filter(|t| t.percentiles.count > 0 && !t.histogram.is_empty())
        .take(MOST_HISTOGRAMS)
        .collect();
    let (first, others): (Vec<&Timing>, Vec<&Timing>) = drawn
        .iter()
        .partition(|timing| FIRST.contains(&timing.key.as_str()));
    let pictures = |timings: Vec<&Timing>| {
        let figures = timings.into_iter().zip(0..);
        let figures: String = figures
            .map(|(timing, i)| drawn_histogram(timing, period, i))
            .collect();
        if figures.is_empty() {
            figures
        } else {
            beside("grid", &figures)
        }
    };
    let mut markup = percentiles(timings);
    if drawn.is_empty() {
        markup +=
            &note("The counts behind these percentiles were not kept, so no histogram is drawn.");
    }
    markup += &pictures(first);
    markup += &over_time(run, rows);
    let more = meanings(timings) + &pictures(others) + &worst(run, rows);
    let title = "Definitions, other histograms, and the ticks that took longest";
    markup += &details(title, &more);
    rows.section(heading, &markup)
}

/// The ticks that took longest, each with the evidence around it.
fn worst(run: &RunView, rows: &Rows<'_>) -> String {
    let miss_at = |step: f64| {
        let near = run.events.iter().filter(|e| is_miss(e));
        near.filter_map(|e| Some((e.tick? as f64 - step, e)))
            .find(|(apart, _)| apart.abs() <= 1.0)
    };
    let show = |s: f64| {
        if s.is_finite() {
            micros(s * 1e6)
        } else {
            NOTHING.to_owned()
        }
    };
    let listed = rows.digest().worst.iter().map(|tick| {
        let miss = miss_at(tick.step).map(|(_, miss)| miss);
        let evidence = miss.and_then(evidence).unwrap_or_default();
        let mut context = Vec::new();
        if let Some(miss) = miss {
            context.push(format!("missed: {}", class_words(class_of(miss))));
        }
        if evidence.steal_ms > 0 {
            context.push(format!("{} ms of steal around it", evidence.steal_ms));
        }
        for (n, one, many) in [
            (
                evidence.involuntary_switches,
                "involuntary switch",
                "involuntary switches",
            ),
            (evidence.minor_faults, "page fault", "page faults"),
        ] {
            if n > 0 {
                context.push(plural(n, one, many));
            }
        }
        if tick.stretched > 0.0 {
            context.push(format!(
                "grid moved by {} so far",
                plural(tick.stretched as u64, "tick", "ticks")
            ));
        }
        vec![
            count(tick.step as u64),
            format!("{:.4}\u{a0}s", tick.time),
            show(tick.total),
            show(tick.wakeup),
            show(tick.sent - tick.wakeup),
            show(tick.round_trip),
            show(tick.compute),
            context.join(", "),
        ]
    });
    let listed: Vec<_> = listed.collect();
    if listed.is_empty() {
        return String::new();
    }
    let heading = [
        "step",
        "test time",
        "edge to next command ready",
        "wake-up",
        "send",
        "round trip",
        "compute",
        "context",
    ];
    let steal = run
        .events
        .iter()
        .filter(|e| is_miss(e))
        .filter_map(|e| Some(evidence(e)?.steal_ms));
    let steal: u64 = steal.sum();
    let steal = match (run.events.iter().any(is_miss), steal) {
        (false, _) => "No deadline was missed, so no steal was counted around one.".to_owned(),
        (true, ms) => format!(
            "Steal counted around misses, time that the hypervisor withheld: {ms} ms in all."
        ),
    };
    format!("<h3>The {} ticks that took longest</h3>\n", listed.len())
        + &beside("worst", &table(&heading, &listed))
        + &note(&steal)
}

/// Counters of the system around a miss.
const fn evidence(line: &EventLine) -> Option<Evidence> {
    match line.event {
        Event::Miss { evidence, .. } => evidence,
        _ => None,
    }
}

fn period_us(run: &RunView) -> Option<f64> {
    let rate = run
        .progress()
        .rate_hz
        .filter(|r| *r > 0.0 && r.is_finite())?;
    Some(1e6 / rate)
}

fn drawn_histogram(timing: &Timing, period_us: Option<f64>, i: usize) -> String {
    let (title, _) = words(&timing.key);
    let is_miss = timing.key == "miss";
    // A slack has no deadline, and a miss lies beyond it by definition.
    let deadline_us = if is_miss || timing.key == "slack" {
        None
    } else {
        period_us
    };
    let largest = timing.percentiles.max;
    let reached = deadline_us.is_some_and(|deadline| largest > 0.05 * deadline);
    let chart = HistogramChart {
        title: &title,
        histogram: &timing.histogram,
        percentiles: &timing.percentiles,
        deadline_us: deadline_us.filter(|_| reached),
        ink: if is_miss {
            Ink::Alarm
        } else {
            Ink::Series([2, 0, 1, 3][i % 4])
        },
    };
    figure(
        510.0,
        300.0,
        &format!("Histogram of {title}"),
        |canvas, area| chart.draw(canvas, area),
    )
}

/// Meaning of each quantity.
fn meanings(timings: &[Timing]) -> String {
    let each = timings.iter().map(|timing| words(&timing.key));
    let known = each.filter(|(_, meaning)| !meaning.is_empty());
    let known: Vec<_> = known
        .map(|(title, meaning)| (title, meaning.to_owned()))
        .collect();
    definitions(&known)
}

fn percentiles(timings: &[Timing]) -> String {
    let rows = timings.iter().map(|timing| {
        let (title, _) = words(&timing.key);
        let p = &timing.percentiles;
        let show = |us: f64| match p.count {
            0 => NOTHING.to_owned(),
            _ => micros(us),
        };
        let mut row = vec![title, count(p.count)];
        row.extend([p.min, p.p50, p.p90, p.p99, p.p99_9, p.max].map(show));
        row
    });
    table(
        &["", "count", "min", "p50", "p90", "p99", "p99.9", "max"],
        &rows.collect::<Vec<_>>(),
    )
}

fn over_time(run: &RunView, rows: &Rows<'_>) -> String {
    let named = [
        (column::WAKEUP.name(), "wake-up lateness"),
        (column::ROUND_TRIP.name(), "round trip"),
        (column::COMPUTE.name(), "compute"),
        ("tick_time_s", "tick time"),
    ];
    let mut series = Vec::new();
    for (i, (column, name)) in named.into_iter().enumerate() {
        let is_positive = |values: &[f64]| values.iter().any(|v| *v > 0.0);
        let found = rows.history(column);
        if let Some(found) = found.filter(|found| is_positive(&found.values)) {
            series.push((name, found, Ink::Series([2, 1, 0, 3][i])));
        }
    }
    if series.is_empty() {
        return String::new();
    }
    let lines: Vec<_> = series
        .iter()
        .map(|(name, of, ink)| of.line(name, *ink, 1.1))
        .collect();
    let mut marks: Vec<f64> = run
        .events
        .iter()
        .filter(|e| is_miss(e))
        .filter_map(|line| line.time)
        .collect();
    marks.sort_by(f64::total_cmp);
    let up = Quantity {
        words: "time, logarithmic",
        unit: "s",
    };
    let title = "Over test time: the highest value in each column of the picture";
    let chart = TimeChart {
        title,
        up,
        lines: &lines,
        marks: &marks,
        reduce: Reduce::Highest,
        named_time: true,
    };
    let mut markup = history((WHOLE, 200.0), "Lateness over test time", &chart);
    if !marks.is_empty() {
        markup += &note("Red strokes at the top mark deadline misses.");
    }
    markup
}
