//! Mistakes of matrices, masses and storeys are explained as all others: file, line, caret, what was found, what is
//! allowed; exit code 2, no panic, and no run folder.

use crate::common::FRAME;
use crate::common::refusal::{MATRICES, refused, wrong_line};
use crate::common::test_file::TestFile;

#[test]
fn matrix_of_the_wrong_size_is_refused() {
    let stiffness = "stiffness = [[2e5, -1e5], [-1e5, 1e5]]";
    for (rows, words) in [
        ("[[2e5, -1e5]]", "stiffness: must be square, but is 1 by 2"),
        (
            "[[2e5, -1e5], [-1e5]]",
            "stiffness: row 2 has 1 entries, but row 1 has 2",
        ),
        (
            "[[2, 0, 0], [0, 2, 0], [0, 0, 2]]",
            "stiffness has 3 degrees of freedom, but the mass matrix has 2",
        ),
    ] {
        wrong_line(
            MATRICES,
            stiffness,
            &format!("stiffness = {rows}"),
            rows,
            &[words],
        );
    }
    let words = ["damping has 1", "has 2"];
    wrong_line(
        MATRICES,
        "damping = [[100, 0], [0, 100]]",
        "damping = [[100]]",
        "[[100]]",
        &words,
    );
    let (text, line) = (
        MATRICES
            .without("structure.matrices.stiffness")
            .with("structure.matrices.stiffness_file = 'k.csv'"),
        "stiffness_file = \"k.csv\"",
    );
    for (rows, words) in [
        (
            "2,0,0\n0,2,0\n0,0,2\n",
            "stiffness has 3 degrees of freedom, but the mass matrix has 2",
        ),
        ("2e5,-1e5\n", "must be square, but is 1 by 2"),
        (
            "2e5,-1e5\n1e5\n",
            "k.csv, line 2: found 1 numbers, expected 2",
        ),
        (
            "2e5,-1e5\n-1e5,stiff\n",
            "k.csv, line 2, field 2: \"stiff\" is not a finite number",
        ),
    ] {
        refused(&text, &[("k.csv", rows)], line, "\"k.csv\"", &[words]);
    }
}

#[test]
fn indefinite_mass_names_the_dof() {
    let loose = MATRICES
        .replace("[[2e5, -1e5], [-1e5, 1e5]]", "[[2e5, 0], [0, 0]]")
        .replace("[[100, 0], [0, 100]]", "[[100, 0], [0, 0]]");
    let (right, wrong) = (
        "mass = [[1000, 0], [0, 1000]]",
        "mass = [[1000, 0], [0, 0]]",
    );
    let words = [
        "effective mass",
        "positive definite",
        "freedom 2",
        "DOF 2",
        "0 kg",
        "a stiffness",
    ];
    wrong_line(&loose, right, wrong, "[0, 0]", &words);
    // No choice of λ can mend it, so the choice must not be blamed.
    wrong_line(
        &loose.replace("lambda = 4", "lambda = \"auto\""),
        right,
        wrong,
        "[0, 0]",
        &words,
    );
    let soft = MATRICES.replace("[-1e5, 1e5]]", "[-1e5, -9e9]]");
    let words = ["negative eigenvalue", "is unstable"];
    let (line, under) = (
        "stiffness = [[2e5, -1e5], [-1e5, -9e9]]",
        "[[2e5, -1e5], [-1e5, -9e9]]",
    );
    refused(&soft, &[], line, under, &words);
    let hinge = FRAME
        .without("structure.damping")
        .with("structure.shear_building = { mass_kg = [1000, 0], stiffness_n_per_m = [0, 0] }");
    let words = ["positive definite", "freedom 2", "DOF 2", "0 kg"];
    refused(&hinge, &[], "mass_kg = [1000, 0]", "0", &words);
    let words = ["freedom 2", "-1000 kg"];
    wrong_line(
        MATRICES,
        right,
        "mass = [[1000, 0], [0, -1000]]",
        "[0, -1000]",
        &words,
    );
}

#[test]
fn oversized_chain_is_refused_early() {
    let start = MATRICES.find("[structure.matrices]").unwrap();
    let end = MATRICES.find("[integrator]").unwrap();
    let chain = "[structure.chain]\ndofs = 4000000000000\nmass_kg = 1\nstiffness_n_per_m = 1e3\n\n";
    let text = format!("{}{chain}{}", &MATRICES[..start], &MATRICES[end..]);
    let words = ["dofs is 4000000000000", "1 to 1000000"];
    refused(&text, &[], "dofs = 4000000000000", "4000000000000", &words);
}

#[test]
fn specimen_on_a_missing_storey_is_refused() {
    let words = ["storey 3", "1 to 2", "such storey"];
    wrong_line(FRAME, "storey = 1", "storey = 3", "3", &words);
    let words = ["storey 0", "from 1"];
    wrong_line(FRAME, "storey = 1", "storey = 0", "0", &words);
    let specimen = FRAME.find("[[specimen]]").unwrap();
    let text = format!("{MATRICES}\n{}", &FRAME[specimen..]);
    let words = ["no storeys"];
    refused(&text, &[], "storey = 1", "1", &words);
    let words = ["row 1", "3 entries", "2 DOFs"];
    wrong_line(
        &text,
        "storey = 1",
        "rows = [[0, 0, 1]]",
        "[0, 0, 1]",
        &words,
    );
}

#[test]
fn asymmetric_entry_is_shown_with_mirror() {
    for (right, wrong, words) in [
        (
            "mass = [[1000, 0], [0, 1000]]",
            "mass = [[1000, 7], [0, 1000]]",
            "mass: must be symmetric, but entry (1, 2) is 7 and entry (2, 1) is 0",
        ),
        (
            "stiffness = [[2e5, -1e5], [-1e5, 1e5]]",
            "stiffness = [[2e5, 7], [-1e5, 1e5]]",
            "stiffness: must be symmetric, but entry (1, 2) is 7 and",
        ),
        (
            "damping = [[100, 0], [0, 100]]",
            "damping = [[100, 7], [0, 100]]",
            "damping: must be symmetric, but entry (1, 2) is 7 and",
        ),
    ] {
        wrong_line(MATRICES, right, wrong, "7", &[words, "found 7", "here"]);
        let (key, _) = right.split_once(' ').unwrap();
        let line = format!("{key}_file = \"m.csv\"");
        let words = format!(
            "{key}_file m.csv: must be symmetric, but entry (1, 2) is 7 and entry (2, 1) is 0"
        );
        let file = [("m.csv", "1000,7\n0,1000\n")];
        refused(
            &MATRICES.replace(right, &line),
            &file,
            &line,
            "\"m.csv\"",
            &[&words],
        );
    }
}

#[test]
fn bad_mass_matrix_does_not_blame_specimens() {
    let mass = "mass = [[1000, 0], [0, 1000]]";
    let law = "law = { linear = { stiffness_n_per_m = 1e5 } }";
    let text = format!("{MATRICES}\n[[specimen]]\nname = \"s\"\nrows = [[1, 0]]\n{law}\n");
    for (rows, words) in [
        (
            "[[1000, 0], [0]]",
            "mass: row 2 has 1 entries, but row 1 has 2",
        ),
        ("[[1000, 0]]", "mass: must be square, but is 1 by 2"),
    ] {
        wrong_line(&text, mass, &format!("mass = {rows}"), rows, &[words]);
    }
}

#[test]
fn overflowing_mass_is_refused() {
    for mass in ["1e308", "1.7e308"] {
        wrong_line(
            MATRICES,
            "mass = [[1000, 0], [0, 1000]]",
            &format!("mass = [[1000, 0], [0, {mass}]]"),
            mass,
            &["entry (2, 2)", mass, "1e140"],
        );
        let wrong = format!("mass_kg = [1000.0, {mass}]");
        let words = [mass, "1e140"];
        wrong_line(FRAME, "mass_kg = [1000.0, 900.0]", &wrong, mass, &words);
    }
}

/// The matrices of the structure are bounded when they are read: what overflows is a specimen.
#[test]
fn impossible_stiffness_names_the_specimen() {
    let soft = "[[specimen]]\nname = 'soft'\nstorey = 1\nlaw.linear.stiffness_n_per_m = 1e5";
    let line = "[[specimen]]";
    let text = FRAME
        .without("structure.damping")
        .without("specimen.0.law")
        .without("time.rate_hz")
        .with("specimen = { name = 'stiff', storey = 2, law.linear.stiffness_n_per_m = 1e308 }")
        .with("time = { step_s = 100, duration_s = 1000 }")
        .with(soft);
    let words = ["100 s", "4 M + 2 Δt", "overflows"];
    refused(&text, &[], line, line, &words);
}
