//! A table of nodal forces is taken column by column: a warning reports names of its columns that contradict this.

use super::*;
use crate::build;

/// Builds a file of these lines: the peak and the warnings, or the reason of the refusal.
fn built(lines: &str, sets: &[&str]) -> Result<((usize, f64), Vec<String>), String> {
    let home = tempfile::tempdir().unwrap();
    std::fs::write(home.path().join("forces.csv"), lines).unwrap();
    let text = GOOD
        .without("excitation.ground_acceleration")
        .with("excitation.nodal_table.file = 'forces.csv'");
    let path = home.path().join("test.toml");
    std::fs::write(&path, text).unwrap();
    let mut all: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    all.push("time.duration_s=0.001953125".to_owned());
    let loaded = load(&path, &all).unwrap_or_else(|error| panic!("{error}"));
    let test = build(&loaded).map_err(|error| error.to_string())?;
    let told = test.warnings.0.iter().map(|warning| warning.render(false));
    let peak = test.facts.structure.unwrap().peak_nodal_force;
    Ok((peak.unwrap(), told.collect()))
}

const ROWS: &str = "0,0,0\n1000,0,0\n0,0,0\n";

#[test]
fn contradicting_column_names_are_reported() {
    for header in ["", "F1,F2,F3\n", "DOF 1 (N),DOF 2 (N),DOF 3 (N)\n"] {
        let (peak, told) = built(&format!("{header}{ROWS}"), &[]).unwrap();
        assert_eq!((peak, told), ((0, 1000.0), Vec::new()), "{header}");
    }
    let (peak, told) = built(&format!("F3,F1,F2\n{ROWS}"), &[]).unwrap();
    assert_eq!(peak, (0, 1000.0));
    shows(&told[0], "\"F3\" is DOF 1");
}

#[test]
fn times_and_other_units_are_refused() {
    for header in ["time,F1,F2", "t (ms),F1,F2"] {
        let refused = built(&format!("{header}\n{ROWS}"), &[]).unwrap_err();
        shows(&refused, "one step");
    }
    let in_kn = format!("F1 (kN),F2 (kN),F3 (kN)\n{ROWS}");
    let refused = built(&in_kn, &[]).unwrap_err();
    shows(&refused, "\"F1 (kN)\"");
    let (peak, told) = built(&in_kn, &["excitation.nodal_table.scale=1000"]).unwrap();
    assert_eq!((peak, told), ((0, 1e6), Vec::new()));
}

#[test]
fn rows_after_the_end_are_not_peaks() {
    let (peak, told) = built(&format!("{ROWS}0,0,5000\n"), &[]).unwrap();
    assert_eq!(peak, (0, 1000.0));
    shows(&told[0], "4 rows");
    shows(&told[0], "3 steps");
    let (_, told) = built("0,0,0\n0,0,0\n0,0,0\n0,0,5000\n", &[]).unwrap();
    assert!(
        told.iter().any(|one| one.contains("moves nothing")),
        "{told:?}"
    );
}
