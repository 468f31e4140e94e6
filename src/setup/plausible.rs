//! Warnings about a structure that can be computed and is probably not the one that was meant.

use std::f64::consts::TAU;

use super::specimens::Specimens;
use super::{Site, StructureFacts, path};
use gusset_config::{Finding, KeyPath};
use gusset_motion::{Quantity, STANDARD_GRAVITY, Signal, Unit};
use gusset_proof::Kind;
use gusset_quantity::units::{duration, number, quantity};

/// First periods of structures that are tested, s.
const PERIODS_S: [f64; 2] = [0.02, 10.0];
/// The usual ones among them, s.
const USUAL_PERIODS_S: [f64; 2] = [0.1, 5.0];
/// Frequencies below this share of the highest are those of a rigid motion, found with rounding.
const RIGID: f64 = 1e-7;
/// Peak ground accelerations whose unit is not doubted, g. A signal of the file itself may be smaller.
const PEAKS_G: [f64; 2] = [0.003, 2.0];
/// The usual ones among them, g.
const USUAL_PEAKS_G: [f64; 2] = [0.05, 1.0];
/// Largest ratio of two stiffnesses whose unit is the same.
const MOST_APART: f64 = 1e5;
/// Units that are mistaken for N/m, and N/m in one of each.
const STIFFNESSES: [(&str, f64); 4] = [
    ("kN/mm", 1e6),
    ("kip/in", 175_126.835_246_5),
    ("kN/m or N/mm", 1e3),
    ("lbf/in", 175.126_835_246_5),
];

/// Warns of a storey that is stiff in the structure and in a specimen.
pub(super) fn check(site: &mut Site<'_>, specimens: &Specimens) {
    let doubled = doubled_storeys(site, specimens);
    site.warnings.extend(doubled);
}

/// Numbers that look like those of another unit, for the verdict.
pub(super) fn units(site: &mut Site<'_>, specimens: &Specimens, facts: &StructureFacts) {
    let found = unusual_period(&facts.frequencies)
        .into_iter()
        .chain(mixed_stiffnesses(site, specimens, &facts.rotations))
        .chain(unusual_peak(site, facts.peak_ground_accel));
    let found: Vec<_> = found.map(|finding| (Kind::Units, finding)).collect();
    site.doubts.extend(found);
}

fn doubled_storeys(site: &Site<'_>, specimens: &Specimens) -> Vec<Finding> {
    let file = &site.loaded.file;
    let structure = file.structure.as_ref();
    let Some(building) = structure.and_then(|table| table.shear_building.as_ref()) else {
        return Vec::new();
    };
    let pairs = file.specimen.iter().zip(specimens.attached()).enumerate();
    let doubled = pairs.filter_map(|(index, (table, estimate))| {
        let storey = table.storey?;
        let own = *building.stiffness_n_per_m.get(storey.checked_sub(1)?)?;
        let entries = estimate.stiffness.iter().flatten();
        let specimen = entries.fold(0.0, |most: f64, k| most.max(k.abs()));
        (own != 0.0 && specimen > 0.0).then(|| {
            let text = format!(
                "storey {storey} has {own} N/m in the structure and {specimen} N/m in specimen \"{}\": both act together",
                table.name
            );
            let stiffness = path("structure").key("shear_building");
            Finding::warning(path("specimen").index(index).key("storey"), text)
                .number("structure_n_per_m", own)
                .number("specimen_n_per_m", specimen)
                .beside(stiffness.key("stiffness_n_per_m"), "its stiffness in the structure")
                .help("give this storey the stiffness 0 in the structure if the specimen is the whole storey")
        })
    });
    doubled.collect()
}

/// `frequencies` in rad/s, ascending.
fn unusual_period(frequencies: &[f64]) -> Option<Finding> {
    let rigid = RIGID * frequencies.last().copied()?;
    let period = TAU / frequencies.iter().copied().find(|omega| *omega > rigid)?;
    let [shortest, longest] = PERIODS_S;
    if (shortest..=longest).contains(&period) {
        return None;
    }
    let text = format!(
        "the first period is {}, which is unusual for a tested structure ({shortest} s to {longest} s)",
        duration(period)
    );
    let usual = |factor: f64| is_within(period * factor.sqrt(), USUAL_PERIODS_S);
    let likely = if period > longest {
        let mut units = STIFFNESSES.iter();
        let unit = units.find(|(_, factor)| usual(1.0 / factor));
        unit.map(|(unit, _)| format!("stiffnesses in {unit}?"))
    } else {
        let units = [("t", 1e3), ("kip s²/in", 175_126.835_246_5)];
        let unit = units.into_iter().find(|(_, factor)| usual(*factor));
        unit.map(|(unit, _)| format!("masses in {unit}?"))
    };
    Some(
        Finding::warning(path("structure"), text)
            .at_key()
            .label(likely.unwrap_or_else(|| "masses in kg, stiffnesses in N/m?".to_owned()))
            .number("period_s", period)
            .help("check the units: masses in kg, stiffnesses in N/m"),
    )
}

/// Stiffnesses of storeys and specimens that belong to different units. Those of rotations are omitted.
fn mixed_stiffnesses(
    site: &Site<'_>,
    specimens: &Specimens,
    rotations: &[usize],
) -> Option<Finding> {
    let file = &site.loaded.file;
    let mut all: Vec<(f64, KeyPath)> = Vec::new();
    if let Some(table) = &file.structure {
        let at = path("structure");
        let buildings = table.shear_building.iter();
        let storeys = buildings.flat_map(|building| building.stiffness_n_per_m.iter().enumerate());
        let of_building = at.under("shear_building.stiffness_n_per_m");
        all.extend(storeys.map(|(storey, value)| (*value, of_building.index(storey))));
        let of_chain = at.under("chain.stiffness_n_per_m");
        all.extend((table.chain.iter()).map(|chain| (chain.stiffness_n_per_m, of_chain.clone())));
    }
    let tables = file.specimen.iter().zip(specimens.attached());
    for (index, (table, one)) in tables.enumerate() {
        let mut dofs = one.rows.iter().flatten();
        let turns = dofs.any(|(dof, _)| rotations.contains(dof));
        if turns || table.geometry.is_some() {
            continue;
        }
        let axes = one.stiffness.iter().enumerate();
        let at = path("specimen").index(index);
        all.extend(axes.map(|(axis, row)| (row[axis], at.clone())));
    }
    all.retain(|(value, _)| *value > 0.0);
    all.sort_by(|one, other| one.0.total_cmp(&other.0));
    let ((softest, at), (stiffest, _)) = (all.first()?, all.last()?);
    if stiffest / softest <= MOST_APART {
        return None;
    }
    // The lone one is the mistake, as a rule.
    let middle = all[all.len() / 2].0;
    let usual = |(_, factor): &&(&str, f64)| is_within(softest * factor / middle, [0.03, 30.0]);
    let likely = STIFFNESSES.iter().find(usual);
    let text = format!(
        "stiffnesses of storeys and specimens differ by a factor of {}: {} to {}",
        number(stiffest / softest),
        quantity(*softest, "N/m"),
        quantity(*stiffest, "N/m")
    );
    let label = match likely {
        Some((unit, _)) => format!("{} in {unit}?", number(*softest)),
        None => "one of them in another unit?".to_owned(),
    };
    Some(
        Finding::warning(at.clone(), text)
            .label(label)
            .number("least_n_per_m", *softest)
            .number("most_n_per_m", *stiffest)
            .help("all stiffnesses are in N/m"),
    )
}

/// A peak ground acceleration, in m/s², that belongs to another unit of its record.
fn unusual_peak(site: &Site<'_>, peak: Option<f64>) -> Option<Finding> {
    let peak = peak.filter(|peak| *peak > 0.0)?;
    let in_g = peak / STANDARD_GRAVITY;
    let excitation = &site.loaded.file.excitation;
    let grounds = &excitation.ground_acceleration;
    let ground = grounds.all().first()?;
    let mut records = site.records.iter();
    let record = records.find(|record| record.quantity == Quantity::Acceleration);
    let record = record.filter(|_| matches!(ground.signal, Signal::File(_)));
    let [least, most] = match record {
        Some(_) => PEAKS_G,
        None => [0.0, PEAKS_G[1]],
    };
    if is_within(in_g, [least, most]) {
        return None;
    }
    let at = grounds.place(&path("excitation"), 0);
    let text = format!(
        "the peak ground acceleration is {} g: between {least} g and {most} g is usual",
        number(in_g)
    );
    let finding = Finding::warning(at.clone(), text).number("peak_g", in_g);
    let scaled = ground.processing.target_peak.is_some()
        || ground.processing.target_sa.is_some()
        || excitation.scaling.is_some();
    // One unit of several components is not the cause of all.
    let is_alone = grounds.all().len() == 1;
    let Some(record) = record.filter(|_| !scaled && is_alone) else {
        return Some(finding.at_key().label("in m/s²?"));
    };
    let units = [
        Unit::MetrePerSecond2,
        Unit::Gravity,
        Unit::CentimetrePerSecond2,
        Unit::InchPerSecond2,
    ];
    let as_unit = |unit: &Unit| in_g * unit.to_si() / record.unit.to_si();
    let likely = units.into_iter().filter(|unit| *unit != record.unit);
    let likely = likely
        .into_iter()
        .find(|unit| is_within(as_unit(unit), USUAL_PEAKS_G));
    let finding = match likely {
        Some(unit) => finding
            .label(format!(
                "in {}? The peak would be {} g",
                unit.name(),
                number(as_unit(&unit))
            ))
            .number("peak_g_in_likely_unit", as_unit(&unit)),
        None => finding.label("another unit?"),
    };
    Some(finding.at_key().help(format!(
        "{} is read in {}: check `unit` and `scale_factor`",
        record.file,
        record.unit.name()
    )))
}

fn is_within(value: f64, [least, most]: [f64; 2]) -> bool {
    (least..=most).contains(&value)
}
