//! `gusset check`: is a test valid, what will it do, is λ stable. Nothing moves.

use serde_json::json;

use super::exit::Exit;
use super::run::{load, method_name, refused};
use super::spectrum::Spectrum;
use super::table::{Table, duration, quantity};
use super::{CheckArgs, answer, tell, warn};
use crate::config::{self, ClockChoice, Facts, StructureFacts};

/// Checks one test.
pub fn check(args: &CheckArgs) -> anyhow::Result<Exit> {
    let loaded = load(&args.test, &args.sets)?;
    let test = config::build(&loaded).map_err(refused)?;
    warn(&test.warnings);
    for text in &test.facts.announced {
        tell(format_args!("note: {text}"));
    }
    let facts = &test.facts;
    let spectrum = facts
        .structure
        .as_ref()
        .and_then(|structure| Spectrum::of(facts, structure));
    if let Some(folder) = &args.plot {
        let Some(spectrum) = &spectrum else {
            anyhow::bail!(
                "there are no curves: they are for the method \"gui\" and structures of up to 100 degrees of freedom"
            );
        };
        spectrum.plot(folder)?;
    }
    if args.json {
        let found = as_json(facts, spectrum.as_ref());
        answer(serde_json::to_string_pretty(&found)?)?;
    } else {
        answer(as_table(facts, spectrum.as_ref()))?;
    }
    Ok(Exit::Done)
}

fn as_table(facts: &Facts, spectrum: Option<&Spectrum>) -> Table {
    let mut table = Table::new(&format!("{} — valid", facts.title));
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
    if let Some(structure) = &facts.structure {
        describe(&mut table, facts, structure, spectrum);
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
    table
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
    if let Some(peak) = structure.peak_ground_accel {
        table.row(
            "ground",
            &format!("peak acceleration {}", quantity(peak, "m/s²")),
        );
    }
    for (mode, omega) in structure.frequencies.iter().enumerate() {
        let hz = omega / std::f64::consts::TAU;
        let period = if hz > 0.0 {
            duration(1.0 / hz)
        } else {
            "none".to_owned()
        };
        let text = format!(
            "{omega:.4} rad/s, {hz:.4} Hz, period {period}, Ω = ω·Δt = {:.4}{}",
            omega * facts.dt,
            spectrum
                .map(|spectrum| spectrum.errors(mode))
                .unwrap_or_default()
        );
        table.row(&format!("mode {}", mode + 1), &text);
    }
    let Some(lambda) = structure.lambda else {
        table.row("method", &method_name(structure.method));
        return;
    };
    let how = if structure.lambda_by_number {
        "asked for by number".to_owned()
    } else {
        format!(
            "automatic: the largest up to 11.5 with gain at most {}",
            structure.gain
        )
    };
    table.row("lambda", &format!("{lambda} ({how})"));
    match &structure.choice {
        None => table.row("stability", "no proof: a tangent has no declared bound"),
        Some(choice) => {
            let limit = match choice.limit {
                Some(limit) => format!("stable up to lambda = {limit:.6}"),
                None => "stable for every lambda".to_owned(),
            };
            let margin = if choice.margin.is_finite() {
                format!(", margin {:.4}", choice.margin)
            } else {
                String::new()
            };
            let verdict = if choice.is_stable() {
                ""
            } else {
                " — UNSTABLE at this lambda"
            };
            table.row("stability", &format!("{limit}{margin}{verdict}"));
            if let Some(governing) = &choice.governing {
                table.row("governed by", &governing.to_string());
            }
        }
    }
    if let Some(spectrum) = spectrum {
        spectrum.describe(table);
    }
}

fn as_json(facts: &Facts, spectrum: Option<&Spectrum>) -> serde_json::Value {
    let number = |value: f64| {
        if value.is_finite() {
            json!(value)
        } else {
            json!(value.to_string())
        }
    };
    let structure = facts.structure.as_ref().map(|structure| {
        let choice = structure.choice.as_ref();
        json!({
            "dofs": structure.dofs,
            "storage": structure.storage,
            "frequencies_rad_per_s": structure.frequencies,
            "method": structure.method,
            "lambda": structure.lambda.map(|lambda| number(lambda.value())),
            "lambda_by_number": structure.lambda_by_number,
            "lambda_limit": choice.map(|choice| choice.limit),
            "margin": choice.map(|choice| number(choice.margin)),
            "stable": choice.map(|choice| choice.is_stable()),
            "governing": choice.and_then(|c| c.governing.as_ref()).map(ToString::to_string),
            "gain_bound": structure.gain.is_finite().then_some(structure.gain),
            "modes": spectrum.map(Spectrum::modes_json),
            "critical_delays": spectrum.map(Spectrum::delays_json),
            "peak_ground_acceleration_m_per_s2": structure.peak_ground_accel,
        })
    });
    json!({
        "title": facts.title,
        "valid": true,
        "steps": facts.steps,
        "dt": facts.dt,
        "rate_hz": facts.rate_hz,
        "structure": structure,
        "specimens": facts.specimens,
        "warnings": facts.warnings,
    })
}
