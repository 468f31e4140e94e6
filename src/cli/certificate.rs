//! The certificate of `gusset check --rehearse` as a table and as JSON.

use serde_json::{Value, json};

use super::table::Table;
use gusset_quantity::units::duration;
use gusset_session::certificate::{Band, Certificate, Line, Trials};

/// Adds its lines and the verdict to a table.
pub fn tabulate(certificate: &Certificate, table: &mut Table) {
    let Trials {
        all,
        wall_s,
        threads,
    } = &certificate.trials;
    table.row(
        "trials",
        &format!(
            "{} of the whole test with seed {}, in {} on {threads} threads",
            all.len(),
            certificate.seed,
            duration(*wall_s),
        ),
    );
    let varied = if certificate.varied.is_empty() {
        "nothing: no noise, no `[[uncertainty]]`, no standard deviation in `identified`".to_owned()
    } else {
        certificate.varied.join(",\n")
    };
    table.row("varied", &varied);
    for Line { go, about, text } in &certificate.lines {
        let word = match go {
            Some(true) => "go",
            Some(false) => "NO-GO",
            None => "not known",
        };
        table.row(about, &format!("{word}: {text}"));
    }
    let against = certificate
        .lines
        .iter()
        .filter(|line| line.go == Some(false));
    let against: Vec<&str> = against.map(|line| line.about.as_str()).collect();
    let verdict = match (against.is_empty(), certificate.missing.is_empty()) {
        (true, true) => "GO".to_owned(),
        (true, false) => format!("GO not established: {}", certificate.missing.join(";\n")),
        (false, _) => format!("NO-GO, for {}", against.join("; ")),
    };
    table.row("certificate", &verdict);
}

/// The certificate as JSON.
pub fn as_json(certificate: &Certificate) -> Value {
    let band = |band: Option<Band>| {
        band.map(|b| json!({ "p5": b.low, "p50": b.middle, "p95": b.high, "max": b.worst }))
    };
    let count = certificate.trials.all.len() as u64;
    let (low, high) = certificate.trip_probability();
    let axes = certificate.trials.all.first();
    let axes = axes.map_or(0, |one| one.errors.tracking.len());
    let tracking = (0..axes).map(|axis| {
        band(
            certificate
                .trials
                .band(|one| one.errors.tracking.get(axis).copied()),
        )
    });
    let lines = certificate.lines.iter().map(|line| {
        json!({
            "about": line.about,
            "verdict": match line.go {
                Some(true) => "go",
                Some(false) => "no-go",
                None => "not known",
            },
            "text": line.text,
        })
    });
    json!({
        "go": certificate.is_go(),
        "not_established": certificate.missing,
        "trials": count,
        "seed": certificate.seed,
        "wall_s": certificate.trials.wall_s,
        "threads": certificate.trials.threads,
        "varied": certificate.varied,
        "trips": certificate.trials.trips(),
        "trip_probability_95": [low, high],
        "trip_reasons": certificate.trials.reasons(),
        "tracking_error": tracking.collect::<Vec<_>>(),
        "response_error": band(certificate.trials.band(|one| one.errors.response)),
        "lines": lines.collect::<Vec<_>>(),
    })
}
