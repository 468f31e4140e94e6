//! The section on timing: percentiles, histograms, lateness over test time, and the ticks that took longest.
//!
//! Regrouping counts for a logarithmic axis moves them between bins and never changes their sum. Percentiles are the recorded ones.

use maud::{Markup, html};

use super::RunView;
use super::axis::is_drawable;
use super::chart::{Chart, Ink, Look, Scale};
use super::digest::Digest;
use super::html::{beside, definitions, details, note, paragraph, section, table, table_of};
use super::outcome::{class_of, class_words, is_miss};
use super::text::{NOTHING, count, micros, plural};
use gusset_quantity::catalog::column;
use gusset_record::miss::Evidence;
use gusset_record::rt::timing::{Percentiles, TimingEntry, Timings};
use gusset_record::{Event, EventLine};

/// Histograms that are always open.
const FIRST: [&str; 2] = ["wakeup_lateness", "tick_time"];
/// Histograms that are drawn.
const MOST_HISTOGRAMS: usize = 12;

/// One timing quantity: its key, its percentiles, its counts if they were kept.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Timing {
    /// Key, with the specimen's name after it where there is one histogram per specimen.
    pub key: String,
    /// Percentiles.
    pub percentiles: Percentiles,
    /// Upper edge of a bin in µs and its count; empty if only percentiles were kept.
    pub histogram: Vec<(f64, u64)>,
}

/// Keys of the timing histograms in their order, each with a line of explanation (guide: real-time).
pub(super) const KEYS: [(&str, &str, &str); 8] = [
    (
        "wakeup_lateness",
        "Wake-up lateness",
        "from the release of the tick to the first instruction after the wait",
    ),
    (
        "command_lateness",
        "Command lateness",
        "from the release of the tick to the return of the last send",
    ),
    (
        "round_trip",
        "Round trip",
        "from the send to the decoded reply, ticks of a hold included",
    ),
    (
        "compute",
        "Compute",
        "from the last reply to the next command ready",
    ),
    (
        "record",
        "Record",
        "from the next command ready to the row pushed",
    ),
    (
        "tick_time",
        "Tick time",
        "from the first instruction after the wait to the row pushed",
    ),
    (
        "slack",
        "Slack",
        "from the row pushed to the next release, where that is later",
    ),
    (
        "miss",
        "Deadline misses",
        "from the next release to the row pushed, where that is later",
    ),
];

/// Title and explanation of a key.
pub(super) fn words(key: &str) -> (String, &'static str) {
    let (base, rest) = key
        .split_once(" · ")
        .map_or((key, None), |(base, rest)| (base, Some(rest)));
    let known = KEYS.iter().find(|(k, _, _)| *k == base);
    let title = known.map_or_else(
        || base.replace('_', " "),
        |(_, title, _)| (*title).to_owned(),
    );
    let title = rest.map_or_else(|| title.clone(), |rest| format!("{title}, {rest}"));
    (title, known.map_or("", |(_, _, meaning)| meaning))
}

/// Every quantity, in the order of the keys.
pub(super) fn read(timings: Option<&Timings>) -> Vec<Timing> {
    let mut found = Vec::new();
    for (quantity, entry) in timings.iter().flat_map(|timings| &timings.0) {
        let key = quantity.key();
        found.push(counted(key.to_owned(), entry));
        // Round trips are shown once for all specimens and, if there are several, once for each.
        let parts = entry.specimens.iter().flat_map(|parts| &parts.0);
        if parts.clone().nth(1).is_some() {
            found.extend(parts.map(|(part, entry)| counted(format!("{key} · {part}"), entry)));
        }
    }
    found
}

fn counted(key: String, entry: &TimingEntry) -> Timing {
    let bins = entry.bins.iter().flatten();
    Timing {
        key,
        percentiles: entry.percentiles,
        histogram: bins.map(|(_, to, count)| (*to, *count)).collect(),
    }
}

/// Counts in bins of equal width on a logarithmic axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LogBins {
    first: i64,
    /// Counts from the lowest bin upwards.
    pub counts: Vec<u64>,
}

/// Bins per decade: a bin is 12 % wide.
const PER_DECADE: f64 = 20.0;
/// One nanosecond: a recorded zero is shown here.
const SMALLEST_US: f64 = 1e-3;
/// A year: keeps a damaged file from asking for a picture without end.
const LARGEST_US: f64 = 3.2e13;

impl LogBins {
    /// Regroups (upper edge in µs, count); none if nothing was counted.
    pub(crate) fn new(histogram: &[(f64, u64)]) -> Option<Self> {
        // Lateness within one bin of an edge rounds to it: the edge is the largest value of its bin.
        let index = |us: f64| {
            let us = if us.is_nan() {
                LARGEST_US
            } else {
                us.clamp(SMALLEST_US, LARGEST_US)
            };
            libm::floor(libm::log10(us) * PER_DECADE + 1e-9) as i64
        };
        let filled = || {
            histogram
                .iter()
                .filter(|(_, count)| *count > 0)
                .map(|(us, count)| (index(*us), *count))
        };
        let first = filled().map(|(i, _)| i).min()?;
        let last = filled().map(|(i, _)| i).max()?;
        let mut counts = vec![0u64; (last - first) as usize + 1];
        for (i, count) in filled() {
            if let Some(cell) = counts.get_mut((i - first) as usize) {
                *cell = cell.saturating_add(count);
            }
        }
        Some(Self { first, counts })
    }

    /// Lower and upper edge of bin `i` in µs.
    pub(crate) fn edges(&self, i: usize) -> (f64, f64) {
        let at = |k: i64| libm::pow(10.0, k as f64 / PER_DECADE);
        let k = self.first + i as i64;
        (at(k), at(k + 1))
    }

    /// Largest count of any bin.
    pub(crate) fn top(&self) -> u64 {
        self.counts.iter().copied().max().unwrap_or(0)
    }
}

/// A histogram: counts over time, both axes logarithmic, percentiles and the deadline marked.
pub(super) fn histogram<'a>(
    title: &'a str,
    histogram: &[(f64, u64)],
    percentiles: &Percentiles,
    deadline_us: Option<f64>,
) -> Chart<'a> {
    let Some(bins) = LogBins::new(histogram) else {
        return Chart::new(title, Scale::new("time", "s"), Scale::new("count", ""));
    };
    let marks = percentile_marks(percentiles, deadline_us);
    let (lo, hi) = (bins.edges(0).0, bins.edges(bins.counts.len() - 1).1);
    // At least two decades, so that a narrow histogram is not blown up out of proportion.
    let far = marks.iter().map(|mark| 1e6 * mark.1).fold(hi, f64::max);
    let range = (1e-6 * lo / 1.3, 1e-6 * (far * 1.3).max(lo * 100.0));
    // Room for the rows of names above the highest bar: a logarithmic axis grows by a power.
    let share = 1.0 - 0.075 * marks.len() as f64;
    let top = libm::pow(bins.top() as f64 / 0.7 * 1.2, 1.0 / share) * 0.7;
    let across = Scale::new("time, logarithmic", "s")
        .written()
        .within(Some(range));
    let up = Scale::new("count, logarithmic", "")
        .log()
        .within(Some((0.7, top)));
    let edges = |i: usize| 1e-6 * bins.edges(i).0;
    let count = bins.counts.len();
    let is_late = |i: &usize| deadline_us.is_some_and(|deadline| bins.edges(*i).0 >= deadline);
    let late = (0..count).find(is_late).unwrap_or(count);
    let bars = |chart: Chart<'a>, part: std::ops::Range<usize>| {
        let x: Vec<f64> = (part.start..=part.end).map(edges).collect();
        let y: Vec<f64> = part.map(|i| bins.counts[i] as f64).collect();
        chart.with("", x, y, Look::Bars)
    };
    let chart = bars(Chart::new(title, across, up), 0..late);
    let chart = bars(chart, late..count).inked(Ink::Alarm);
    chart.labelled(format!("Histogram of {title}")).marks(marks)
}

/// Marks from the left: words, place in s, colour.
fn percentile_marks(
    percentiles: &Percentiles,
    deadline_us: Option<f64>,
) -> Vec<(String, f64, Ink)> {
    let p = percentiles;
    let named = [
        ("p50", p.p50),
        ("p99", p.p99),
        ("p99.9", p.p99_9),
        ("max", p.max),
    ];
    let marks = named.into_iter().map(|(name, us)| (us, name, Ink::Frame));
    let deadline = deadline_us.map(|us| (us, "deadline", Ink::Alarm));
    let mut all: Vec<_> = marks
        .chain(deadline)
        .filter(|m| m.0 > 0.0 && is_drawable(m.0))
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Of few values several percentiles are one: they share a label.
    let mut marks: Vec<(f64, String, Ink)> = Vec::new();
    for (us, name, ink) in all {
        match marks.last_mut() {
            Some((at, words, _)) if *at == us && ink != Ink::Alarm => {
                *words = format!("{words}, {name}");
            }
            _ => marks.push((us, name.to_owned(), ink)),
        }
    }
    for (us, words, _) in &mut marks {
        *words = format!("{words} {}", micros(*us));
    }
    marks
        .into_iter()
        .map(|(us, words, ink)| (words, 1e-6 * us, ink))
        .collect()
}

/// Histograms, their percentiles and lateness over test time.
pub(super) fn timing(run: &RunView, rows: &Digest, timings: &[Timing]) -> Markup {
    let heading = "Timing";
    if run.is_simulated() {
        let says =
            "No timing: this run used the simulated clock, on which no deadline can be missed.";
        return section(heading, paragraph(says));
    }
    if timings.iter().all(|t| t.percentiles.count == 0) {
        let says = paragraph("No timing was recorded for this run.");
        return rows.section(heading, html! { (says) (over_time(run, rows)) });
    }
    let rate = run.summary.as_ref().map(|summary| summary.rate_hz);
    let period = rate
        .filter(|hz| *hz > 0.0 && hz.is_finite())
        .map(|hz| 1e6 / hz);
    let drawn = timings
        .iter()
        .filter(|t| t.percentiles.count > 0 && !t.histogram.is_empty());
    let drawn: Vec<_> = drawn.take(MOST_HISTOGRAMS).collect();
    let (first, others): (Vec<&Timing>, Vec<&Timing>) = drawn
        .iter()
        .partition(|timing| FIRST.contains(&timing.key.as_str()));
    let figures = |timings: &[&Timing]| {
        beside(
            "grid",
            html! { @for timing in timings { (figure(timing, period)) } },
        )
    };
    let meanings = timings.iter().map(|timing| words(&timing.key));
    let meanings = meanings.filter(|(_, meaning)| !meaning.is_empty());
    let meanings: Vec<_> = meanings
        .map(|(title, meaning)| (title, meaning.to_owned()))
        .collect();
    let more = html! { (definitions(&meanings)) (figures(&others)) (worst(run, rows)) };
    let markup = html! {
        (percentiles(timings))
        @if drawn.is_empty() { (note("The counts behind these percentiles were not kept, so no histogram is drawn.")) }
        (figures(&first))
        (over_time(run, rows))
        (details("Definitions, other histograms, and the ticks that took longest", more))
    };
    rows.section(heading, markup)
}

fn figure(timing: &Timing, period_us: Option<f64>) -> Markup {
    let (title, _) = words(&timing.key);
    // A slack has no deadline, and a miss lies beyond it by definition.
    let deadline_us = period_us.filter(|_| timing.key != "miss" && timing.key != "slack");
    let reached = deadline_us.filter(|deadline| timing.percentiles.max > 0.05 * deadline);
    let chart = histogram(&title, &timing.histogram, &timing.percentiles, reached);
    match timing.key.as_str() {
        "miss" => chart.inked(Ink::Alarm).half(300.0).figure(),
        _ => chart.half(300.0).figure(),
    }
}

/// The ticks that took longest, each with the evidence around it.
fn worst(run: &RunView, rows: &Digest) -> Markup {
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
    let listed = rows.worst.iter().map(|tick| {
        let [step, time, wakeup, sent, round_trip, compute, stretched] = *tick;
        let miss = miss_at(step).map(|(_, miss)| miss);
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
        if stretched > 0.0 {
            context.push(format!(
                "grid moved by {} so far",
                plural(stretched as u64, "tick", "ticks")
            ));
        }
        vec![
            count(step as u64),
            format!("{time:.4}\u{a0}s"),
            show(super::worst::total(tick)),
            show(wakeup),
            show(sent - wakeup),
            show(round_trip),
            show(compute),
            context.join(", "),
        ]
    });
    let listed: Vec<_> = listed.collect();
    if listed.is_empty() {
        return Markup::default();
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
    html! {
        h3 { "The " (listed.len()) " ticks that took longest" }
        (table_of("worst", &heading, &listed))
        (note(&steal))
    }
}

/// Counters of the system around a miss.
const fn evidence(line: &EventLine) -> Option<Evidence> {
    match line.event {
        Event::Miss { evidence, .. } => evidence,
        _ => None,
    }
}

fn percentiles(timings: &[Timing]) -> Markup {
    let rows = timings.iter().map(|timing| {
        let p = &timing.percentiles;
        let show = |us: f64| {
            if p.count == 0 {
                NOTHING.to_owned()
            } else {
                micros(us)
            }
        };
        let mut row = vec![words(&timing.key).0, count(p.count)];
        row.extend([p.min, p.p50, p.p90, p.p99, p.p99_9, p.max].map(show));
        row
    });
    table(
        &["", "count", "min", "p50", "p90", "p99", "p99.9", "max"],
        &rows.collect::<Vec<_>>(),
    )
}

fn over_time(run: &RunView, rows: &Digest) -> Markup {
    let named = [
        (column::WAKEUP.name(), "wake-up lateness", 2),
        (column::ROUND_TRIP.name(), "round trip", 1),
        (column::COMPUTE.name(), "compute", 0),
        ("tick_time_s", "tick time", 3),
    ];
    let mut strokes: Vec<f64> = run
        .events
        .iter()
        .filter(|e| is_miss(e))
        .filter_map(|line| line.time)
        .collect();
    strokes.sort_by(f64::total_cmp);
    let has_strokes = !strokes.is_empty();
    let chart = Chart::history(
        "Lateness over test time: the highest value of every few ticks",
        Scale::new("time, logarithmic", "s").written(),
    )
    .strokes(strokes);
    let found = named
        .into_iter()
        .filter_map(|(column, name, ink)| Some((name, ink, rows.history(column)?)));
    let found = found.filter(|(.., of)| of.values.iter().any(|v| *v > 0.0));
    let chart = found.fold(chart, |chart, (name, ink, of)| {
        chart
            .with(name, of.time, of.values, Look::Line)
            .inked(Ink::Series(ink))
    });
    html! {
        @if !chart.is_empty() {
            (chart.figure())
            @if has_strokes { (note("Red strokes at the top mark deadline misses.")) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    proptest! {
        #[test]
        fn regrouped_counts_keep_their_sum(
            bins in prop::collection::vec((prop_oneof![9 => 0.0f64..1e7, 1 => Just(f64::NAN)], 0u64..1_000_000), 0..200),
        ) {
            let sum: u64 = bins.iter().map(|b| b.1).sum();
            let regrouped = LogBins::new(&bins).map_or(0, |b| b.counts.iter().sum());
            prop_assert_eq!(sum, regrouped);
        }

        #[test]
        fn value_is_between_the_edges_of_its_bin(us in 0.002f64..1e6) {
            let (lo, hi) = LogBins::new(&[(us, 1)]).unwrap().edges(0);
            prop_assert!(lo <= us * (1.0 + 1e-9) && us < hi * (1.0 + 1e-9), "{lo} {us} {hi}");
        }
    }

    #[test]
    fn nothing_counted_gives_no_bins() {
        assert_eq!(LogBins::new(&[]), None);
        assert_eq!(LogBins::new(&[(3.0, 0)]), None);
    }

    #[test]
    fn timing_keys_keep_their_order() {
        let timings = Timings::from(json!({
            "compute": {"count": 2, "p50": 0.4},
            "wakeup_lateness": {"count": 3, "min": 0.05, "max": 9.0, "bins": [[0.05, 0.1, 2], [8.0, 9.0, 1]]},
            "round_trip": {"count": 5, "specimens": {"column": {"count": 5}}},
            "slack": {"count": 0, "max": 0.0, "bins": []},
            "record": {"count": 4, "bins": [[0.05, 0.051, 4]], "specimens": {"b": {"count": 1}, "a": {"count": 3}}},
        }));
        let found = read(Some(&timings));
        let keys: Vec<_> = found.iter().map(|t| t.key.as_str()).collect();
        assert_eq!(
            keys,
            [
                "wakeup_lateness",
                "round_trip",
                "compute",
                "record",
                "record · b",
                "record · a",
                "slack",
            ]
        );
        assert_eq!(found[0].histogram, [(0.1, 2), (9.0, 1)]);
        assert_eq!(found[3].histogram, [(0.051, 4)]);
        assert_eq!(words("round_trip · column").0, "Round trip, column");
        assert!(read(None).is_empty());
    }

    #[test]
    fn histogram_marks_percentiles_and_late_ticks() {
        let p = Percentiles {
            count: 3,
            p50: 0.05,
            p99: 1200.0,
            max: 1200.0,
            ..Percentiles::default()
        };
        let svg = histogram("Lateness", &[(0.05, 2), (1200.0, 1)], &p, Some(976.6)).svg();
        for words in [
            "p50 50.0\u{a0}ns",
            "p99, max 1.20\u{a0}ms",
            "deadline 977\u{a0}µs",
            "f-alarm",
            "f-s0",
        ] {
            assert!(svg.contains(words), "{words}: {svg}");
        }
        assert!(
            histogram("Lateness", &[], &p, None)
                .svg()
                .contains("nothing to draw")
        );
    }
}
