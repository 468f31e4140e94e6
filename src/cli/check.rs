//! `gusset check`: may this test run, what does it need, and what follows? Nothing moves.

use serde_json::json;

use super::args::CheckArgs;
use super::certificate::Certificate;
use super::exit::Exit;
use super::rehearsed;
use super::run::{load, method_name, refused};
use super::spectrum::Spectrum;
use super::table::Table;
use super::{answer, stability, tell, warn};
use crate::config::{self, ClockChoice, Facts, Loaded, Stability, StructureFacts};
use crate::integrate::Lambda;
use crate::motion::{Quantity, RecordFacts, STANDARD_GRAVITY};
use crate::record::{Outcome, RecordedVerdict};
use crate::session::Judged;
use crate::transfer::BetweenTicks;
use crate::units::{duration, quantity};

/// Checks one test.
pub fn check(args: &CheckArgs) -> anyhow::Result<Exit> {
    let loaded = load(&args.test, &args.sets)?;
    let test = config::build(&loaded).map_err(refused)?;
    warn(&test.warnings);
    for text in &test.facts.announced {
        tell(format_args!("note: {text}"));
    }
    let spectrum = test.facts.structure.as_ref();
    let spectrum = spectrum.and_then(|structure| Spectrum::of(&test.facts, structure));
    if let Some(folder) = &args.plot {
        let Some(spectrum) = spectrum.as_ref().filter(|spectrum| spectrum.is_of_family()) else {
            anyhow::bail!(
                "there are no curves: they are for the method \"gui\" and structures of up to 50000 degrees of freedom"
            );
        };
        spectrum.plot(folder)?;
    }
    let mut judged = Judged::without_rehearsal(test);
    if !args.no_rehearsal {
        judged = judged.rehearsed().map_err(refused)?;
    }
    let certificate = if args.rehearse {
        Some(Certificate::of(&loaded, &judged, args.trials, args.seed)?)
    } else {
        None
    };
    warn(&judged.verdict.diagnostics(&loaded, true));
    if args.json {
        let found = as_json(&loaded, &judged, spectrum.as_ref(), certificate.as_ref());
        answer(serde_json::to_string_pretty(&found)?)?;
    } else {
        answer(as_table(
            &loaded,
            &judged,
            spectrum.as_ref(),
            certificate.as_ref(),
            args.verbose,
        ))?;
    }
    let go = certificate.as_ref().is_none_or(Certificate::is_go);
    Ok(if go && judged.verdict.is_clear() {
        Exit::Done
    } else {
        Exit::Stopped
    })
}

/// The verdict, then the test and its needs; with `verbose` everything that is known.
fn as_table(
    loaded: &Loaded,
    judged: &Judged,
    spectrum: Option<&Spectrum>,
    certificate: Option<&Certificate>,
    verbose: bool,
) -> Table {
    let facts = &judged.test.facts;
    let verdict = judged.verdict.record();
    let mut table = Table::new(&format!("{} — {}", facts.title, in_words(&verdict)));
    for one in &verdict.findings {
        table.row(&one.severity, &format!("{} ({})", one.text, one.key));
    }
    if verbose {
        everything(&mut table, facts, spectrum);
        for (what, found) in judged.following.iter().map(|one| one.words()) {
            table.row(&what, &found);
        }
    } else {
        in_short(&mut table, facts, spectrum);
    }
    for (name, between_ticks) in commands(loaded) {
        let what = match between_ticks {
            BetweenTicks::Ramped => "ramped: a straight line from tick to tick",
            BetweenTicks::Held => "held over each tick, as a D/A converter does",
        };
        table.row(&format!("command, {name}"), what);
    }
    if let Some(full) = &judged.rehearsed {
        rehearsed::tabulate(full, &mut table);
    }
    if let Some(certificate) = certificate {
        certificate.tabulate(&mut table);
    }
    if !verbose {
        table.row(
            "more",
            "--verbose shows modes, delays, all limits and what a trip does",
        );
    }
    table
}

/// Each simulated actuator that lags, with what its command does between two ticks.
fn commands(loaded: &Loaded) -> impl Iterator<Item = (&str, BetweenTicks)> {
    loaded.file.specimen.iter().filter_map(|table| {
        let transfer = table.believed_transfer(1.0)?;
        transfer
            .lags()
            .then_some((table.name.as_str(), transfer.between_ticks))
    })
}

/// The verdict in a few words.
fn in_words(verdict: &RecordedVerdict) -> &'static str {
    match (verdict.outcome, verdict.unstable) {
        (Outcome::Clear, _) => "valid",
        (Outcome::Accepted, true) => "valid, UNSTABLE and accepted",
        (Outcome::Accepted, false) => "valid, with accepted findings",
        (Outcome::Simulated, true) => "NOT POSSIBLE with a specimen: UNSTABLE. Simulated, it runs",
        (Outcome::Simulated, false) => "NOT POSSIBLE with a specimen. Simulated, it runs",
        (Outcome::Refused, true) => "NOT POSSIBLE: UNSTABLE",
        (Outcome::Refused, false) => "NOT POSSIBLE",
    }
}

/// Test, structure and method, each in a line.
fn in_short(table: &mut Table, facts: &Facts, spectrum: Option<&Spectrum>) {
    of_test(table, facts);
    of_records(table, facts);
    let Some(structure) = &facts.structure else {
        return table.row(
            "structure",
            "none: the specimens follow a prescribed displacement",
        );
    };
    let first = structure.frequencies.first().copied();
    let first = first.or_else(|| spectrum?.lowest());
    let first = first.map(|omega| {
        let hz = omega / std::f64::consts::TAU;
        format!(", first frequency {hz:.4} Hz")
    });
    let dofs = structure.dofs;
    table.row(
        "structure",
        &format!("{dofs} DOFs{}", first.unwrap_or_default()),
    );
    of_loads(table, structure);
    let method = match structure.lambda {
        Some(lambda) => format!("λ = {lambda}"),
        None => method_name(structure.method),
    };
    table.row(
        "method",
        &format!("{method}; {}", stability::brief(structure)),
    );
    if let Some(spectrum) = spectrum {
        spectrum.describe(table);
    }
}

fn of_test(table: &mut Table, facts: &Facts) {
    let clock = match facts.clock {
        ClockChoice::Real => "real",
        ClockChoice::Simulated => "simulated",
    };
    table.row(
        "test",
        &format!(
            "{} steps of {} = {}, {clock} clock at {:.6} Hz",
            facts.steps,
            duration(facts.dt),
            duration(facts.steps as f64 * facts.dt),
            facts.rate_hz
        ),
    );
}

/// Each record that was read from a file, in a line.
fn of_records(table: &mut Table, facts: &Facts) {
    for record in &facts.records {
        let column = match (&record.column_name, record.column) {
            (Some(name), Some(number)) => format!("column {number} {name:?}, "),
            (None, Some(number)) => format!("column {number}, "),
            _ => String::new(),
        };
        let peak = match record.quantity {
            Quantity::Acceleration => format!(
                "{} ({:.4} g)",
                quantity(record.peak, record.quantity.si_unit()),
                record.peak / STANDARD_GRAVITY
            ),
            other => quantity(record.peak, other.si_unit()),
        };
        table.row(
            "record",
            &format!(
                "{}: {}, {column}unit {}, {} points of {} = {}, peak {peak}",
                record.file,
                record.format.name(),
                record.unit,
                record.npts,
                duration(record.dt_s),
                duration(record.duration_s())
            ),
        );
    }
}

/// One record for `--json`. `column` is the name of the column, or its number where it has no name.
fn record_json(record: &RecordFacts) -> serde_json::Value {
    let peak_key = match record.quantity {
        Quantity::Acceleration => "peak_m_per_s2",
        Quantity::Velocity => "peak_m_per_s",
        Quantity::Displacement => "peak_m",
        Quantity::Force => "peak_n",
    };
    let column = match &record.column_name {
        Some(name) => json!(name),
        None => json!(record.column),
    };
    let mut found = json!({
        "file": record.file,
        "format": record.format,
        "column": column,
        "column_number": record.column,
        "unit": record.unit,
        "npts": record.npts,
        "dt_s": record.dt_s,
        "duration_s": record.duration_s(),
    });
    if let Some(found) = found.as_object_mut() {
        found.insert(peak_key.to_owned(), json!(record.peak));
        if record.quantity == Quantity::Acceleration {
            let in_g = record.peak / STANDARD_GRAVITY;
            found.insert("peak_g".to_owned(), json!(in_g));
        }
    }
    found
}

fn of_loads(table: &mut Table, structure: &StructureFacts) {
    if let Some(peak) = structure.peak_ground_accel {
        table.row(
            "ground",
            &format!("peak acceleration {}", quantity(peak, "m/s²")),
        );
    }
    if let Some((dof, peak)) = structure.peak_nodal_force {
        let turns = structure.rotations.contains(&dof);
        let peak = quantity(peak, if turns { "N m" } else { "N" });
        table.row("nodal forces", &format!("peak {peak} at DOF {}", dof + 1));
    }
}

/// Everything that is known of the test without a rehearsal.
fn everything(table: &mut Table, facts: &Facts, spectrum: Option<&Spectrum>) {
    of_test(table, facts);
    of_records(table, facts);
    if facts.ticks_per_step > 1 {
        let ticks = f64::from(facts.ticks_per_step);
        table.row(
            "rates",
            &format!(
                "integration {:.6} steps per second of wall time, controller {:.6} ticks per second: {} ticks per step",
                facts.rate_hz / ticks,
                facts.rate_hz,
                facts.ticks_per_step
            ),
        );
    }
    if let Some(structure) = &facts.structure {
        describe(table, facts, structure, spectrum);
    } else {
        table.row(
            "structure",
            "none: the specimens follow a prescribed displacement",
        );
    }
    let specimens = facts.specimens.join(", ");
    table.row(
        "specimens",
        if specimens.is_empty() {
            "none"
        } else {
            &specimens
        },
    );
    super::limits::tabulate(&facts.limits, table);
}

fn describe(
    table: &mut Table,
    facts: &Facts,
    structure: &StructureFacts,
    spectrum: Option<&Spectrum>,
) {
    table.row(
        "structure",
        &format!(
            "{} DOFs{}",
            structure.dofs,
            structure
                .storage
                .as_ref()
                .map(|storage| format!(", effective mass stored {storage}"))
                .unwrap_or_default()
        ),
    );
    if let Some(condition) = structure.reciprocal_condition {
        table.row(
            "condition",
            &format!("{condition:.1e} reciprocal, of what is factored for alpha"),
        );
    }
    of_loads(table, structure);
    match spectrum.filter(|spectrum| spectrum.is_of_family()) {
        Some(spectrum) => spectrum.tabulate(table),
        None => frequencies(table, facts, structure),
    }
    match structure.lambda {
        Some(lambda) => describe_lambda(table, structure, lambda),
        None => table.row("method", &method_name(structure.method)),
    }
    stability::tabulate(table, facts, structure);
    if let Some(spectrum) = spectrum {
        spectrum.describe(table);
    }
}

fn describe_lambda(table: &mut Table, structure: &StructureFacts, lambda: Lambda) {
    let how = if structure.lambda_by_number {
        "asked for by number".to_owned()
    } else {
        format!(
            "automatic: the largest up to 11.5 with gain at most {}",
            structure.gain
        )
    };
    let own = structure.lambda_apart.iter();
    let own: Vec<String> = own.map(|(name, own)| format!("{own} for {name}")).collect();
    if own.is_empty() {
        table.row("λ", &format!("{lambda} ({how})"));
    } else {
        table.row(
            "λ",
            &format!("{lambda} for the rest ({how});\n{}", own.join(", ")),
        );
    }
}

/// Natural frequencies alone, where nothing is known of what the method makes of them.
fn frequencies(table: &mut Table, facts: &Facts, structure: &StructureFacts) {
    if structure.frequencies.is_empty() {
        return;
    }
    table.row("mode", "   frequency       period    Ω = ω·Δt");
    for (mode, omega) in structure.frequencies.iter().enumerate() {
        let text = super::spectrum::swing(*omega, facts.dt);
        table.row(&format!("  {}", mode + 1), &text);
    }
}

fn as_json(
    loaded: &Loaded,
    judged: &Judged,
    spectrum: Option<&Spectrum>,
    certificate: Option<&Certificate>,
) -> serde_json::Value {
    let facts = &judged.test.facts;
    let number = |value: f64| {
        if value.is_finite() {
            json!(value)
        } else {
            json!(value.to_string())
        }
    };
    let structure = facts.structure.as_ref().map(|structure| {
        let choice = structure.choice();
        json!({
            "dofs": structure.dofs,
            "storage": structure.storage,
            "reciprocal_condition": structure.reciprocal_condition,
            "frequencies_rad_per_s": structure.frequencies,
            "method": structure.method,
            "lambda": structure.lambda.map(|lambda| number(lambda.value())),
            "lambda_by_number": structure.lambda_by_number,
            "lambda_apart": structure.lambda_apart.iter().map(|(name, own)| (name.clone(), number(own.value())))
                .collect::<serde_json::Map<_, _>>(),
            "lambda_limit": choice.map(|choice| choice.limit),
            "criterion": choice.map(|_| "S(lambda) positive semi-definite at the declared bounds"),
            "margin": choice.map(|choice| number(choice.margin)),
            "stable": crate::stability::is_stable(structure),
            "governing": choice.and_then(|c| c.governing.as_ref()).map(ToString::to_string),
            "gain_bound": structure.gain.is_finite().then_some(structure.gain),
            "spectral_radius_at_bounds": match structure.stability {
                Stability::AtBounds(radius) => Some(radius),
                _ => None,
            },
            "modes": spectrum.filter(|spectrum| spectrum.is_of_family()).map(Spectrum::modes_json),
            "highest_frequency_rad_per_s": spectrum.and_then(Spectrum::highest),
            "critical_delays": spectrum.map(Spectrum::delays_json),
            "peak_ground_acceleration_m_per_s2": structure.peak_ground_accel,
            "peak_nodal_force_n": structure.peak_nodal_force.map(|(_, peak)| peak),
        })
    });
    let following = judged.following.iter().map(|one| one.as_json());
    let full = judged.rehearsed.as_ref();
    let mut found = json!({
        "title": facts.title,
        "valid": judged.verdict.is_clear(),
        "verdict": judged.verdict.record(),
        "steps": facts.steps,
        "dt": facts.dt,
        "rate_hz": facts.rate_hz,
        "ticks_per_step": facts.ticks_per_step,
        "structure": structure,
        "specimens": facts.specimens,
        "commands": commands(loaded)
            .map(|(name, between_ticks)| json!({"specimen": name, "between_ticks": between_ticks.name()}))
            .collect::<Vec<_>>(),
        "rehearsal": full.map(rehearsed::as_json),
        "record": facts.records.first().map(record_json),
        "records": facts.records.iter().map(record_json).collect::<Vec<_>>(),
        "limits": facts.limits,
        "warnings": facts.warnings,
    });
    if let Some(found) = found.as_object_mut() {
        if !judged.following.is_empty() {
            found.insert("following".to_owned(), following.collect());
        }
        if let Some(certificate) = certificate {
            found.insert("certificate".to_owned(), certificate.as_json());
        }
    }
    found
}
