//! Warnings about a structure that can be computed and is probably not the one that was meant.

use std::f64::consts::TAU;

use super::specimens::Specimens;
use super::{Site, path};
use crate::config::Finding;
use crate::model::StructureSpec;
use crate::units::duration;

/// First periods of structures that are tested, s.
const PERIODS_S: [f64; 2] = [0.02, 20.0];

/// Warns of a storey that is stiff in the structure and in a specimen, and of an unusual first period.
/// `frequencies` in rad/s, ascending.
pub(super) fn check(site: &mut Site<'_>, specimens: &Specimens, frequencies: &[f64]) {
    let doubled = doubled_storeys(site, specimens);
    site.warnings.extend(doubled);
    site.warnings.extend(unusual_period(frequencies));
}

fn doubled_storeys(site: &Site<'_>, specimens: &Specimens) -> Vec<Finding> {
    let file = &site.loaded.file;
    let structure = file.structure.as_ref();
    let spec = structure.and_then(|table| table.kinds().into_iter().next());
    let Some((_, StructureSpec::ShearBuilding(building))) = spec else {
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

fn unusual_period(frequencies: &[f64]) -> Option<Finding> {
    let [shortest, longest] = PERIODS_S;
    let period = TAU / frequencies.iter().copied().find(|omega| *omega > 0.0)?;
    (!(shortest..=longest).contains(&period)).then(|| {
        let text = format!(
            "the first period is {}, which is unusual for a tested structure ({shortest} s to {longest} s)",
            duration(period)
        );
        Finding::warning(path("structure"), text)
            .at_key()
            .number("period_s", period)
            .help("check the units: masses in kg, stiffnesses in N/m")
    })
}
