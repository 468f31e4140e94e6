//! identified.toml: a virtual twin of the identified specimens, with everything that a `[[specimen]]` takes from it.
//!
//! It is a whole test file: the same motion, a linear specimen behind the identified actuator and sensors, and their
//! compensation. `gusset check` and `gusset run` accept it unchanged; `gusset identify` finds the same values again with the
//! command in it.

use nalgebra::DMatrix;
use toml_edit::{DocumentMut, Item};

use super::IdentificationError;
use super::matrices::{self, Found, rows};
use super::outcome::{Axis, Outcome};
use super::plan::Plan;
use gusset_actuator::compensation::{CompensationSpec, ModelInverseSpec};
use gusset_actuator::specimen::CoupledSpec;
use gusset_actuator::transfer::{
    ActuatorSpec, FirstOrderSpec, ProportionalSpec, SecondOrderSpec, TransferSpec,
};
use gusset_config::TimingSpec;
use gusset_config::{
    ClockChoice, IdentifiedTable, Loaded, MatrixValue, RecordTable, SafetyTable, SimilitudeTable,
    SpecimenTable, TestFile,
};
use gusset_motion::identify::{Estimate, Fit, Identification, Model};
use gusset_numerics::law::{LawSpec, LinearSpec};

/// Share of a tick, and of the gain, below which there is nothing to make up for.
const NOTHING: f64 = 0.05;
const UNITY: f64 = 1e-3;

/// The text; none if not all axes of a specimen are known.
pub(super) fn text(
    outcome: &Outcome,
    plan: &Plan,
    driven: &Loaded,
) -> Result<Option<String>, IdentificationError> {
    let mut file: TestFile = driven.file.clone();
    file.title = format!("Virtual twin: {}", driven.file.title);
    file.time.clock = ClockChoice::Simulated;
    let mut remarks = Vec::new();
    for (place, table) in file.specimen.iter_mut().enumerate() {
        let axes = outcome
            .axes
            .iter()
            .filter(|axis| axis.driven.place == place);
        let known: Option<Vec<(&Axis, &Identification)>> = axes
            .map(|axis| Some((axis, axis.found.as_ref().ok()?)))
            .collect();
        let Some(known) = known.filter(|known| !known.is_empty()) else {
            return Ok(None);
        };
        remarks.push(put(table, &known, plan));
    }
    let unwritten = |error: String| IdentificationError::Document(error);
    let document = toml::to_string(&file).map_err(|error| unwritten(error.to_string()))?;
    let document = document.parse::<DocumentMut>();
    let mut document = document.map_err(|error| unwritten(error.to_string()))?;
    without_defaults(&mut document, &file);
    let tables = document.get_mut("specimen");
    if let Some(tables) = tables.and_then(Item::as_array_of_tables_mut) {
        for (table, remark) in tables.iter_mut().zip(remarks) {
            table.decor_mut().set_prefix(format!("\n{remark}"));
        }
    }
    let said = format!(
        "A virtual twin, made by `gusset identify`: {}.\n\
         #\n\
         #   gusset run identified.toml    the same motion, with compensation\n\
         #   gusset identify identified.toml {}    finds the same again\n\
         #\n\
         # For the real specimen, copy `stiffness_n_per_m`, `damping_n_s_per_m`, `identified` and `compensation` from its table\n\
         # below. Here `law` and `transfer` simulate the specimen and its actuator. Beside a `link` they are its stand-in.",
        driven.file.title, plan.asked
    );
    let text = format!("# {said}\n\n{document}");
    // The written text must be a valid test file.
    gusset_config::parse(&driven.path, text.clone(), &[])?;
    Ok(Some(text))
}

/// Removes values that equal their defaults.
fn without_defaults(document: &mut DocumentMut, file: &TestFile) {
    document.remove("integrator");
    for (key, says_nothing) in [
        ("safety", file.safety == SafetyTable::default()),
        ("timing", file.timing == TimingSpec::default()),
        ("record", file.record == RecordTable::default()),
    ] {
        if says_nothing {
            document.remove(key);
        }
    }
    if let Some(time) = document.get_mut("time").and_then(Item::as_table_mut) {
        for key in ["ticks_per_step", "prediction_order", "scale"] {
            time.remove(key);
        }
    }
    let excitation = document.get_mut("excitation");
    let motions = excitation.and_then(|table| table.get_mut("prescribed_displacement"));
    if let Some(motions) = motions.and_then(Item::as_array_of_tables_mut) {
        for motion in motions.iter_mut() {
            for key in ["processing", "ease_in_s", "ease_out_s"] {
                motion.remove(key);
            }
        }
    }
    let tables = document.get_mut("specimen");
    let Some(tables) = tables.and_then(Item::as_array_of_tables_mut) else {
        return;
    };
    for (table, spec) in tables.iter_mut().zip(&file.specimen) {
        if spec.similitude == SimilitudeTable::default() {
            table.remove("similitude");
        }
        if spec.mass_in_force_kg == 0.0 {
            table.remove("mass_in_force_kg");
        }
        for place in ["transfer", "limits"] {
            without_zeros(table.get_mut(place));
        }
        let transfer = table.get_mut("transfer").and_then(Item::as_table_like_mut);
        if let Some(transfer) = transfer {
            for sensor in ["disp_sensor", "force_sensor"] {
                without_zeros(transfer.get_mut(sensor));
            }
            let is_empty = |item: &Item| item.as_table_like().is_some_and(|t| t.is_empty());
            for sensor in ["disp_sensor", "force_sensor"] {
                if transfer.get(sensor).is_some_and(is_empty) {
                    transfer.remove(sensor);
                }
            }
        }
    }
}

/// Numbers of these tables that are 0 are so by themselves.
fn without_zeros(item: Option<&mut Item>) {
    let Some(table) = item.and_then(Item::as_table_like_mut) else {
        return;
    };
    let is_zero = |item: &Item| {
        item.as_float().is_some_and(|value| value == 0.0) || item.as_integer() == Some(0)
    };
    let zeros = table.iter().filter(|(_, item)| is_zero(item));
    let zeros: Vec<String> = zeros.map(|(key, _)| key.to_owned()).collect();
    for key in zeros {
        table.remove(&key);
    }
}

/// Puts the results into a table, and their uncertainty into a comment.
fn put(table: &mut SpecimenTable, known: &[(&Axis, &Identification)], plan: &Plan) -> String {
    let mut remark = String::new();
    let mut said = |text: String| remark += &format!("# {text}\n");
    for (axis, found) in known {
        said(format!(
            "{}: {} m either way, {} Hz to {} Hz, mean coherence {:.4}.",
            axis.driven.place_words(axis.driven.axis),
            axis.driven.amplitude,
            plan.band.from_hz,
            plan.band.to_hz,
            found.coherence
        ));
        for fit in &found.models {
            let parameters = fit.parameters.iter();
            let parameters: Vec<String> = parameters
                .map(|p| format!("{} = {:.6e} ± {:.1e}", p.name, p.value, p.std))
                .collect();
            said(format!(
                "  {}: {}; leaves {:.3} % over",
                fit.model.words(),
                parameters.join(", "),
                100.0 * fit.residual
            ));
        }
        if let Some(specimen) = &found.specimen {
            let mut text = format!(
                "  specimen: k = {:.6e} ± {:.1e} N/m, c = {:.6e} ± {:.1e} N s/m",
                specimen.stiffness.value,
                specimen.stiffness.std,
                specimen.damping.value,
                specimen.damping.std
            );
            if let Some(mass) = specimen.mass {
                text += &format!(
                    ", m = {:.4} ± {:.4} kg, which the twin is without: `mass_in_force_kg` takes it",
                    mass.value, mass.std
                );
            }
            if specimen.is_nonlinear() {
                text += &format!(
                    "; a SECANT: {:.1} % of the force is not linear",
                    100.0 * specimen.residual
                );
            }
            said(text);
        }
        for (other, felt) in &axis.felt {
            if felt.stiffness.counts_beside(axis.own_stiffness()) {
                said(format!(
                    "  felt by {}: {:.6e} ± {:.1e} N/m",
                    axis.driven.place_words(*other),
                    felt.stiffness.value,
                    felt.stiffness.std
                ));
            }
        }
        if let Some(inverse) = &found.inverse {
            said(format!(
                "  compensation.model_inverse leaves {:.2} % of the target over in the band; one that adapts begins with\n\
                 #   compensation.ats = {{ delay_s = {:e}, order = {}, start = {:?} }}",
                100.0 * inverse.residual,
                found.delay.value.max(0.0),
                (inverse.coefficients.len() - 1).max(1),
                inverse.coefficients
            ));
        }
    }
    if known.len() > 1 {
        said("`transfer` and `compensation` are those of the first; all have the same.".to_owned());
    }
    specimen(table, known, plan.band.to_hz);
    actuator(table, known);
    identified(table, known);
    remark
}

/// Law, stiffness and damping.
fn specimen(table: &mut SpecimenTable, known: &[(&Axis, &Identification)], to_hz: f64) {
    let Found { law, estimate } = matrices::found(table, known, to_hz);
    (table.law, table.laws) = (None, None);
    (table.coupled, table.bearing) = (None, None);
    (table.link, table.bus) = (None, None);
    table.hardening_bound = None;
    let linear = |axis: usize| {
        LawSpec::Linear(LinearSpec {
            stiffness_n_per_m: law.stiffness[(axis, axis)],
            damping_n_s_per_m: law.damping[(axis, axis)],
        })
    };
    let n = law.stiffness.nrows();
    if n == 1 {
        table.law = Some(linear(0));
    } else if law.is_diagonal() {
        table.laws = Some((0..n).map(linear).collect());
    } else {
        table.coupled = Some(CoupledSpec {
            stiffness_n_per_m: rows(&law.stiffness),
            damping_n_s_per_m: Some(rows(&law.damping)),
            mass_kg: None,
        });
    }
    let value = |matrix: &DMatrix<f64>| match n {
        1 => MatrixValue::Number(matrix[(0, 0)]),
        _ => MatrixValue::Rows(rows(matrix)),
    };
    table.stiffness_n_per_m = Some(value(&estimate.stiffness));
    table.damping_n_s_per_m = Some(value(&estimate.damping));
}

/// Actuator and sensors, and their compensation: those of the first axis.
fn actuator(table: &mut SpecimenTable, known: &[(&Axis, &Identification)]) {
    let Some((axis, found)) = known.first() else {
        return;
    };
    let mut transfer = found.best().map_or_else(TransferSpec::default, transfer);
    let some = |value: f64| (value > 0.0).then_some(value);
    transfer.disp_sensor.noise_rms_m = some(found.noise.disp_m);
    transfer.force_sensor.noise_rms_n = some(found.noise.force_n);
    table.transfer = Some(transfer);
    let follows =
        found.delay.value.abs() < NOTHING * axis.tick && (found.gain.value - 1.0).abs() < UNITY;
    table.compensation = found.inverse.as_ref().filter(|_| !follows).map(|inverse| {
        CompensationSpec::ModelInverse(ModelInverseSpec {
            coefficients: inverse.coefficients.clone(),
        })
    });
}

/// A fitted model as a transfer system.
fn transfer(fit: &Fit) -> TransferSpec {
    let value = |name: &str| fit.parameter(name).map_or(0.0, |found| found.value);
    let gain = value("gain");
    TransferSpec {
        delay_s: value("delay_s").max(0.0),
        actuator: Some(match fit.model {
            Model::Delay => ActuatorSpec::Proportional(ProportionalSpec { gain }),
            Model::FirstOrder | Model::DelayedFirstOrder => {
                ActuatorSpec::FirstOrder(FirstOrderSpec {
                    time_constant_s: value("time_constant_s"),
                    gain,
                })
            }
            Model::SecondOrder | Model::DelayedSecondOrder => {
                ActuatorSpec::SecondOrder(SecondOrderSpec {
                    frequency_hz: value("frequency_hz"),
                    damping_ratio: value("damping_ratio"),
                    gain,
                })
            }
        }),
        ..TransferSpec::default()
    }
}

/// Declared knowledge of all axes alike: means, and spreads that include the differences between them.
fn identified(table: &mut SpecimenTable, known: &[(&Axis, &Identification)]) {
    let all = |pick: fn(&Identification) -> Estimate| {
        let estimates = known.iter().map(|(_, found)| pick(found));
        let estimates: Vec<Estimate> = estimates.collect();
        let n = estimates.len() as f64;
        let mean = estimates.iter().map(|e| e.value).sum::<f64>() / n;
        let square = |e: &Estimate| e.std * e.std + (e.value - mean) * (e.value - mean);
        let square = estimates.iter().map(square).sum::<f64>() / n;
        (mean, square.sqrt())
    };
    let noise = |pick: fn(&Identification) -> f64| {
        let largest = known.iter().map(|(_, found)| pick(found));
        Some(largest.fold(0.0, f64::max))
    };
    let (delay, gain) = (all(|found| found.delay), all(|found| found.gain));
    let stiffness = known.first().and_then(|(axis, found)| {
        let value = axis.to_structure.0 * found.specimen.as_ref()?.stiffness.value;
        let shares = known.iter().filter_map(|(_, found)| {
            let stiffness = found.specimen.as_ref()?.stiffness;
            Some((stiffness.std / stiffness.value).abs())
        });
        (value > 0.0).then(|| (value, value * shares.fold(0.0, f64::max)))
    });
    table.identified = Some(IdentifiedTable {
        // A sensor that is a hair early has no delay.
        delay_s: Some(delay.0.max(0.0)),
        delay_std_s: Some(delay.1),
        gain: Some(gain.0),
        gain_std: Some(gain.1),
        stiffness_n_per_m: stiffness.map(|pair| pair.0),
        stiffness_std_n_per_m: stiffness.map(|pair| pair.1),
        noise_disp_m: noise(|found| found.noise.disp_m),
        noise_force_n: noise(|found| found.noise.force_n),
    });
}
