//! A strict reader of Prometheus' text format 0.0.4, from its description: whatever it does not allow panics.

use std::collections::{BTreeMap, BTreeSet};

/// One line of a family.
#[derive(Debug)]
pub struct Sample {
    pub name: String,
    pub labels: BTreeMap<String, String>,
    pub value: f64,
}

/// Samples under one HELP and one TYPE.
#[derive(Debug, Default)]
pub struct Family {
    pub kind: String,
    pub samples: Vec<Sample>,
}

fn is_name(text: &str) -> bool {
    let good = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == ':';
    !text.is_empty() && text.chars().all(good) && !text.starts_with(|c: char| c.is_ascii_digit())
}

fn number(text: &str) -> f64 {
    match text {
        "+Inf" => f64::INFINITY,
        "-Inf" => f64::NEG_INFINITY,
        "NaN" => f64::NAN,
        _ => {
            let plain = text
                .chars()
                .all(|c| c.is_ascii_digit() || "+-.eE".contains(c));
            assert!(plain, "{text:?} is no number");
            text.parse()
                .unwrap_or_else(|_| panic!("{text:?} is no number"))
        }
    }
}

fn sample(line: &str) -> Sample {
    let end = line
        .find(['{', ' '])
        .unwrap_or_else(|| panic!("no value: {line:?}"));
    let name = line[..end].to_owned();
    assert!(is_name(&name), "{line:?}");
    let mut labels = BTreeMap::new();
    let mut rest = &line[end..];
    if let Some(mut inside) = rest.strip_prefix('{') {
        loop {
            let (key, after) = inside
                .split_once("=\"")
                .unwrap_or_else(|| panic!("{line:?}"));
            assert!(
                is_name(key) && !key.contains(':'),
                "label {key:?} in {line:?}"
            );
            let mut value = String::new();
            let mut chars = after.char_indices();
            let end = loop {
                match chars
                    .next()
                    .unwrap_or_else(|| panic!("open label: {line:?}"))
                {
                    (at, '"') => break at,
                    (_, '\\') => value.push(match chars.next().map(|c| c.1) {
                        Some('\\') => '\\',
                        Some('"') => '"',
                        Some('n') => '\n',
                        other => panic!("escape {other:?} in {line:?}"),
                    }),
                    (_, c) => value.push(c),
                }
            };
            assert!(
                labels.insert(key.to_owned(), value).is_none(),
                "{key} twice: {line:?}"
            );
            inside = &after[end + 1..];
            if let Some(after) = inside.strip_prefix('}') {
                rest = after;
                break;
            }
            inside = inside
                .strip_prefix(',')
                .unwrap_or_else(|| panic!("{line:?}"));
        }
    }
    let value = rest.strip_prefix(' ').unwrap_or_else(|| panic!("{line:?}"));
    assert!(!value.contains(' '), "a time stamp, or more: {line:?}");
    Sample {
        name,
        labels,
        value: number(value),
    }
}

/// All families by name.
pub fn parse(text: &str) -> BTreeMap<String, Family> {
    assert!(text.ends_with('\n'), "the last line ends");
    let mut families: BTreeMap<String, Family> = BTreeMap::new();
    let mut open: Option<String> = None;
    let mut helped: BTreeSet<String> = BTreeSet::new();
    let mut seen: BTreeSet<String> = BTreeSet::new();
    for line in text.lines() {
        if let Some(help) = line.strip_prefix("# HELP ") {
            let (name, words) = help.split_once(' ').unwrap();
            assert!(is_name(name) && !words.trim().is_empty(), "{line:?}");
            assert!(helped.insert(name.to_owned()), "HELP of {name} twice");
            continue;
        }
        if let Some(kind) = line.strip_prefix("# TYPE ") {
            let (name, kind) = kind.split_once(' ').unwrap();
            assert!(helped.contains(name), "no HELP before TYPE of {name}");
            assert!(
                ["counter", "gauge", "histogram"].contains(&kind),
                "{line:?}"
            );
            assert_eq!(kind == "counter", name.ends_with("_total"), "{line:?}");
            let family = Family {
                kind: kind.to_owned(),
                ..Family::default()
            };
            assert!(
                families.insert(name.to_owned(), family).is_none(),
                "{name} twice"
            );
            open = Some(name.to_owned());
            continue;
        }
        assert!(!line.starts_with('#') && !line.is_empty(), "{line:?}");
        let sample = sample(line);
        let name = open
            .clone()
            .unwrap_or_else(|| panic!("before any TYPE: {line:?}"));
        let family = families.get_mut(&name).unwrap();
        let of_histogram = sample.name.strip_prefix(&name).unwrap_or("?");
        let belongs = match family.kind.as_str() {
            "histogram" => ["_bucket", "_sum", "_count"].contains(&of_histogram),
            _ => of_histogram.is_empty(),
        };
        assert!(belongs, "{line:?} under {name}");
        assert!(
            seen.insert(line.rsplit_once(' ').unwrap().0.to_owned()),
            "twice: {line:?}"
        );
        if family.kind == "counter" {
            assert!(sample.value >= 0.0 && sample.value.is_finite(), "{line:?}");
        }
        family.samples.push(sample);
    }
    for (name, family) in families
        .iter()
        .filter(|(_, family)| family.kind == "histogram")
    {
        let of = |end: &'static str| family.samples.iter().filter(move |s| s.name.ends_with(end));
        let buckets: Vec<_> = of("_bucket")
            .map(|s| (number(&s.labels["le"]), s.value))
            .collect();
        let rising = |pair: &[(f64, f64)]| pair[0].0 < pair[1].0 && pair[0].1 <= pair[1].1;
        assert!(buckets.windows(2).all(rising), "{name}: {buckets:?}");
        let last = buckets
            .last()
            .unwrap_or_else(|| panic!("{name} has no bucket"));
        assert_eq!(last.0, f64::INFINITY, "{name}");
        assert_eq!(
            of("_count").map(|s| s.value).collect::<Vec<_>>(),
            [last.1],
            "{name}"
        );
        assert_eq!(of("_sum").count(), 1, "{name}");
    }
    families
}
