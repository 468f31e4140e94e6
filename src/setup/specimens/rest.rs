//! Force of a law in this process before anything moves: offsets belong to axes, and a law does not know them.

use super::super::Site;
use super::super::gear::axis;
use super::loading::{offsets, own_offsets};

use gusset_actuator::specimen::Specimen;
use gusset_config::{AxisTable, Finding, KeyPath, SpecimenTable, ZeroChoice};

/// Share of the effect of a shifted zero that counts as roundoff.
const ROUNDOFF: f64 = 1e-9;

/// Warns where the structure receives a force of the law under `key` while every axis is at its offset, and the offsets are
/// the cause.
pub(super) fn says_its_force(
    site: &mut Site<'_>,
    at: &KeyPath,
    table: &SpecimenTable,
    (key, law): (&str, &mut dyn Specimen),
) {
    let n = law.axes();
    let (stand, taken_off) = (offsets(table, n), own_offsets(table, n));
    let still = vec![0.0; n];
    let mut resists = |stands: &[f64]| {
        let mut force = vec![0.0; n];
        law.trial(stands, &still, 0.0, &mut force);
        law.revert();
        force
    };
    let places = stand.iter().zip(&taken_off);
    let places: Vec<f64> = places.map(|(stands, off)| stands.0 - off.0).collect();
    let (force, at_zero) = (resists(&places), resists(&still));
    for (index, (resists, at_zero)) in force.iter().zip(&at_zero).enumerate() {
        let gear = table.axis.get(index).cloned().unwrap_or_default();
        let (_, reads) = stand.get(index).copied().unwrap_or_default();
        let (seen, (_, newtons)) = axis(table, &gear, Vec::new());
        let size = resists.abs() + reads.abs() + at_zero.abs();
        let by_offsets = (resists - reads - at_zero).abs();
        // A load cell that is zeroed before the test shows nothing of it.
        let is_zeroed = gear.zero_force == ZeroChoice::Relative;
        if is_zeroed || by_offsets <= ROUNDOFF * size {
            continue;
        }
        let felt = seen.force_gain * (resists - reads) / newtons;
        let offset = if gear.offset_m != 0.0 {
            "offset_m"
        } else {
            "offset_n"
        };
        let whole = |axis: &AxisTable| axis.offset_m != 0.0 || axis.offset_n != 0.0;
        let own = table.axis.get(index).is_some_and(whole);
        let place = if own {
            at.key("axis").index(index).key(offset)
        } else {
            at.key(key)
        };
        let text = format!(
            "at rest the law of {:?} gives {} to the structure although every deformation is zero",
            table.name,
            newtons_in_words(felt)
        );
        site.warnings.push(
            Finding::warning(place, text)
                .label("a simulated law receives the absolute position of its axis")
                .help("without `offset_m` and `offset_n` the law begins at its zero"),
        );
    }
}

fn newtons_in_words(force: f64) -> String {
    if force.abs() >= 1e3 {
        format!("{} kN", rounded(force / 1e3))
    } else {
        format!("{} N", rounded(force))
    }
}

/// To four digits.
pub(super) fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    fn warnings(specimen: &str) -> String {
        let text = format!(
            "[time]\nrate_hz = 1000\nduration_s = 1\n[structure.shear_building]\nmass_kg = [1000]\n\
             stiffness_n_per_m = [1e5]\n[excitation.ground_acceleration.signal.sine]\namplitude = 1.0\n\
             frequency_hz = 1.0\n[[specimen]]\nname = \"brace\"\nstorey = 1\n{specimen}"
        );
        let loaded = gusset_config::parse(Path::new("test.toml"), text, &[]).unwrap();
        crate::build(&loaded).unwrap().warnings.to_string()
    }

    #[test]
    fn offset_strain_reports_a_force_at_rest() {
        let plastic = "law.bilinear = { post_yield_ratio = 0, stiffness_n_per_m = 2e6, yield_force_n = 15e3 }\n";
        let gear = "sign = -1, unit_disp = \"mm\", unit_force = \"kN\"";
        let said = warnings(&format!(
            "{plastic}axis = [{{ {gear}, offset_m = 0.05 }}]\n"
        ));
        assert!(
            said.contains("at rest") && said.contains("-15 kN"),
            "{said}"
        );
        let said = warnings(&format!("{plastic}axis = [{{ offset_n = 500 }}]\n"));
        assert!(said.contains("-500 N"), "{said}");
        let silent = [
            // Nothing is off.
            format!("{plastic}axis = [{{ {gear} }}]\n"),
            // A preloaded spring whose load cell reads k d₀ where the deformation is zero.
            "law.linear = { stiffness_n_per_m = 9e6 }\naxis = [{ offset_m = 0.012, offset_n = 108e3 }]\n".to_owned(),
            // An offset within the gap.
            "law.gap = { stiffness_n_per_m = 9e6, gap_m = 0.004, side = \"tension\" }\naxis = [{ offset_m = 0.001 }]\n"
                .to_owned(),
            // Zeroed on its reading.
            format!("{plastic}axis = [{{ offset_m = 0.05, zero_force = \"relative\" }}]\n"),
        ];
        for specimen in silent {
            let said = warnings(&specimen);
            assert!(!said.contains("at rest"), "{specimen}{said}");
        }
    }
}
