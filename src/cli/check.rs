//! `gusset check`: is a test valid, what will it do, is λ stable. Nothing moves.

use serde_json::json;

use super::args::CheckArgs;
use super::certificate::Certificate;
use super::exit::Exit;
use super::following::Following;
use super::late_axes::late_axes;
use super::rehearsed::Rehearsed;
use super::run::{load, method_name, refused};
use super::spectrum::Spectrum;
use super::table::{Table, duration, quantity};
use super::{answer, stability, tell, warn};
use crate::config::{
    self, ClockChoice, Facts, Finding, KeyPath, Prepared, Stability, StructureFacts,
};
use crate::integrate::Lambda;

/// Checks one test.
pub fn check(args: &CheckArgs) -> anyhow::Result<Exit> {
    let loaded = load(&args.test, &args.sets)?;
    let Prepared {
        experiment,
        facts,
        warnings,
        ..
    } = config::build(&loaded).map_err(refused)?;
    let facts = &facts;
    warn(&warnings);
    for text in &facts.announced {
        tell(format_args!("note: {text}"));
    }
    let spectrum = facts
        .structure
        .as_ref()
        .and_then(|structure| Spectrum::of(facts, structure));
    if let Some(folder) = &args.plot {
        let Some(spectrum) = spectrum.as_ref().filter(|spectrum| spectrum.is_of_family()) else {
            anyhow::bail!(
                "there are no curves: they are for the method \"gui\" and structures of up to 50000 degrees of freedom"
            );
        };
        spectrum.plot(folder)?;
    }
    let rehearsed = if args.no_rehearsal || experiment.ports.is_empty() {
        None
    } else {
        Some(Rehearsed::of(&loaded, experiment)?)
    };
    let following = Following::of(&loaded, facts, spectrum.as_ref());
    let late = late_axes(&loaded, facts, spectrum.as_ref());
    let small = following.iter().filter_map(Following::warning);
    warn(&loaded.diagnose(small.chain(late)));
    let certificate = if args.rehearse {
        let certificate = Certificate::of(
            &loaded,
            facts,
            rehearsed.as_ref(),
            &following,
            args.trials,
            args.seed,
        )?;
        Some(certificate)
    } else {
        None
    };
    let grows = facts.structure.as_ref().and_then(stability::grows);
    let followed = grows.is_none() && following.iter().all(Following::is_possible);
    let valid = followed && rehearsed.as_ref().is_none_or(Rehearsed::is_possible);
    if args.json {
        let mut found = as_json(facts, spectrum.as_ref(), rehearsed.as_ref(), valid);
        if let (Some(found), false) = (found.as_object_mut(), following.is_empty()) {
            let each = following.iter().map(Following::as_json).collect();
            found.insert("following".to_owned(), serde_json::Value::Array(each));
        }
        if let (Some(found), Some(certificate)) = (found.as_object_mut(), &certificate) {
            found.insert("certificate".to_owned(), certificate.as_json());
        }
        answer(serde_json::to_string_pretty(&found)?)?;
    } else {
        let verdict = if valid { "valid" } else { "NOT POSSIBLE" };
        let mut table = as_table(facts, spectrum.as_ref(), verdict);
        for one in &following {
            one.tabulate(&mut table);
        }
        if let Some(rehearsed) = &rehearsed {
            rehearsed.tabulate(&mut table);
        }
        if let Some(certificate) = &certificate {
            certificate.tabulate(&mut table);
        }
        answer(table)?;
    }
    if let Some(certificate) = &certificate {
        if let Some(rehearsed) = &rehearsed {
            rehearsed.show(&loaded);
        }
        return Ok(if certificate.is_go() {
            Exit::Done
        } else {
            Exit::Stopped
        });
    }
    if !followed {
        let structure = KeyPath::root().key("structure");
        let grows = grows.map(|why| Finding::error(structure, why).at_key());
        let found = following.iter().filter_map(Following::finding);
        warn(&loaded.diagnose(found.chain(grows)));
        if let Some(rehearsed) = &rehearsed {
            rehearsed.show(&loaded);
        }
        return Ok(Exit::Stopped);
    }
    match rehearsed {
        Some(rehearsed) => rehearsed.judge(&loaded).map(|()| Exit::Done),
        None => Ok(Exit::Done),
    }
}

fn as_table(facts: &Facts, spectrum: Option<&Spectrum>, verdict: &str) -> Table {
    let mut table = Table::new(&format!("{} — {verdict}", facts.title));
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
    super::limits::tabulate(&facts.limits, &mut table);
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
    if let Some(condition) = structure.reciprocal_condition {
        table.row(
            "condition",
            &format!("{condition:.1e} reciprocal, of what is factored for alpha"),
        );
    }
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
    facts: &Facts,
    spectrum: Option<&Spectrum>,
    rehearsed: Option<&Rehearsed>,
    valid: bool,
) -> serde_json::Value {
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
            "stable": stability::is_stable(structure),
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
    json!({
        "title": facts.title,
        "valid": valid,
        "steps": facts.steps,
        "dt": facts.dt,
        "rate_hz": facts.rate_hz,
        "ticks_per_step": facts.ticks_per_step,
        "structure": structure,
        "specimens": facts.specimens,
        "rehearsal": rehearsed.map(Rehearsed::as_json),
        "limits": facts.limits,
        "warnings": facts.warnings,
    })
}
