//! A drift that no storey survives: some number is in another unit.

use super::Rehearsal;
use gusset_config::{Finding, KeyPath, Loaded};
use gusset_quantity::units::quantity;

/// Largest drift of a storey that is not doubted, m.
const MOST_M: f64 = 1.0;

/// A finding where the rehearsal has a storey drift, or a deformation of a specimen at the structure's scale, above 1 m. For
/// the storeys of a shear building only the peaks of both floors are known; their difference is a lower bound.
#[must_use]
pub(crate) fn large_drift(loaded: &Loaded, rehearsal: &Rehearsal) -> Option<Finding> {
    let file = &loaded.file;
    let structure = file.structure.as_ref()?;
    let root = KeyPath::root();
    let storeys = structure.kind().into_iter().flat_map(|(key, _)| {
        let is_building = structure.shear_building.is_some();
        let at = root.key("structure").key(key);
        let peaks = rehearsal.peaks.iter().filter(move |_| is_building);
        let below = std::iter::once(&0.0).chain(&rehearsal.peaks);
        let storeys = peaks.zip(below).enumerate();
        storeys.map(move |(storey, (floor, below))| {
            (
                (floor - below).abs(),
                format!("storey {}", storey + 1),
                at.clone(),
            )
        })
    });
    let specimens = file.specimen.iter().zip(&rehearsal.specimens).enumerate();
    let specimens = specimens.filter(|(_, (table, _))| table.geometry.is_none());
    let specimens = specimens.flat_map(|(index, (table, needs))| {
        let at = root.key("specimen").index(index);
        needs.found.iter().enumerate().map(move |(axis, found)| {
            let scale = table.axis.get(axis).map_or(1.0, |axis| axis.scale);
            let offset = table.axis.get(axis).map_or(0.0, |axis| axis.offset_m);
            let far = (found.command.low - offset)
                .abs()
                .max((found.command.high - offset).abs());
            let name = format!("specimen \"{}\"", table.name);
            (
                far * table.similitude.length / scale.abs(),
                name,
                at.clone(),
            )
        })
    });
    let worst = storeys
        .chain(specimens)
        .max_by(|one, other| one.0.total_cmp(&other.0));
    let (drift, name, at) = worst.filter(|(drift, ..)| *drift > MOST_M)?;
    let text = format!(
        "the rehearsal has a drift of {} at {name}, which is more than {MOST_M} m",
        quantity(drift, "m")
    );
    Some(
        Finding::warning(at, text)
            .at_key()
            .label("masses in kg, stiffnesses in N/m, ground in m/s²?")
            .number("drift_m", drift),
    )
}
