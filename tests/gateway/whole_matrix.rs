//! The wiring check compares the forces of all axes with the estimate, in `gusset run` and in a gateway: a wrong sign, exchanged
//! connections, a forgotten scale and a wrong estimate are not armed.

use std::path::Path;

use crate::link_common::{Served, gateway, run, summary, test_file};
use crate::waits_for;
use gusset_record::Run;

/// A specimen of two coupled axes, N/m.
const LAW: &str = "coupled = { stiffness_n_per_m = [[4e6, -1.5e6], [-1.5e6, 1.5e6]] }\n";
const PROBE: &str = "probe_m = 1e-4\nprobe_ramp_s = 0.05\n";

/// A file that describes the specimen: name of the fault (none: it is right), its keys, and whether `accept_wiring` accepts it.
const FILES: [(&str, &str, bool); 9] = [
    (
        "",
        "stiffness_n_per_m = [[4e6, -1.5e6], [-1.5e6, 1.5e6]]\n",
        true,
    ),
    (
        "",
        "stiffness_n_per_m = [[5e6, -1.2e6], [-1.2e6, 1.4e6]]\n",
        true,
    ),
    (
        "",
        "stiffness_n_per_m = [[20e6, -7.5e6], [-7.5e6, 7.5e6]]\nsimilitude = { length = 2.0, force = 10.0 }\n",
        true,
    ),
    (
        "coupling_reversed",
        "stiffness_n_per_m = [[4e6, -1.5e6], [-1.5e6, 1.5e6]]\naxis = [{}, { sign = -1 }]\n",
        false,
    ),
    // The two axes are exchanged.
    (
        "stiffness_differs",
        "stiffness_n_per_m = [[1.5e6, -1.5e6], [-1.5e6, 4e6]]\n",
        true,
    ),
    // A similitude is forgotten.
    (
        "stiffness_differs",
        "stiffness_n_per_m = [[20e6, -7.5e6], [-7.5e6, 7.5e6]]\n",
        true,
    ),
    // The estimate is off by ten.
    (
        "stiffness_differs",
        "stiffness_n_per_m = [[40e6, -15e6], [-15e6, 15e6]]\n",
        true,
    ),
    // One axis counts in kN/mm, the other in N/m.
    (
        "stiffness_differs",
        "stiffness_n_per_m = [[4e6, -1.5e6], [-1.5e6, 1.5e6]]\naxis = [{}, { scale = 0.3 }]\n",
        true,
    ),
    (
        "coupling_differs",
        "stiffness_n_per_m = [[4e6, -0.2e6], [-0.2e6, 1.5e6]]\n",
        true,
    ),
];

fn names(run: &Path, event: &str) -> Vec<String> {
    let events = Run::open(run).unwrap().events().unwrap().to_json();
    let found = events.iter().filter(|one| one["event"] == event);
    found
        .map(|one| one["what"].as_str().unwrap_or_default().to_owned())
        .collect()
}

#[test]
fn a_run_refuses_each_wrong_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let server = Served::start(
        folder,
        &format!("[[specimen]]\nname = \"column\"\n{LAW}"),
        &[],
    );
    for (index, (fault, keys, is_acceptable)) in FILES.into_iter().enumerate() {
        for accepts in [false, true] {
            let name = format!("{index}-{accepts}");
            let link = format!("[specimen.link]\naddress = \"{}\"\n{PROBE}", server.address);
            let text = test_file(20, &format!("rows = [[1, 0], [0, 1]]\n{keys}{link}"));
            let reason = "[safety]\naccept_wiring = \"a cracked one\"\n";
            let text = if accepts {
                text.replacen("[safety]\n", reason, 1)
            } else {
                text
            };
            let (code, said) = run(folder, &name, &text);
            let summary = summary(folder, &name);
            let passes = fault.is_empty() || (accepts && is_acceptable);
            assert_eq!(code, if passes { 0 } else { 3 }, "{index}: {said}");
            let path = folder.join(&name);
            let accepted = names(&path, "wiring_accepted");
            if fault.is_empty() {
                assert!(accepted.is_empty() && summary.accepted.is_empty());
            } else if passes {
                assert_eq!(accepted[0], fault, "{index}");
                assert_eq!(summary.accepted["accept_wiring"], "a cracked one");
            } else {
                assert_eq!(
                    names(&path, "misfit"),
                    [fault],
                    "{index}: {}",
                    summary.reason
                );
                assert!(!summary.reason.contains("accept_wiring") || is_acceptable);
            }
        }
    }
}

#[test]
fn a_gateway_refuses_each_wrong_file() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let server = Served::start(
        folder,
        &format!("[[specimen]]\nname = \"column\"\n{LAW}"),
        &[],
    );
    for (index, (fault, keys, is_acceptable)) in FILES.into_iter().enumerate() {
        for accepts in [false, true] {
            let file = gateway(&server.address, keys, PROBE).replace("probe = \"none\"\n", "");
            let reason = "[safety]\naccept_wiring = \"a cracked one\"\n";
            let file = if accepts {
                file.replacen("[safety]\n", reason, 1)
            } else {
                file
            };
            let out = folder.join(format!("kept-{index}-{accepts}"));
            let between = Served::start(folder, &file, &["--out", out.to_str().unwrap()]);
            let link = format!(
                "[specimen.link]\naddress = \"{}\"\nconnect_timeout_s = 20\n",
                between.address
            );
            let text = test_file(
                20,
                &format!("rows = [[1, 0], [0, 1]]\n{}{link}", estimate(keys)),
            );
            let (code, said) = run(folder, &format!("{index}-{accepts}"), &text);
            let passes = fault.is_empty() || (accepts && is_acceptable);
            assert_eq!(code, if passes { 0 } else { 3 }, "{index}: {said}");
            let record = out.join("test-0001/summary.json");
            waits_for("it has no summary", || record.exists());
            let kept = summary(&out, "test-0001");
            let is_noted = kept.accepted.contains_key("accept_wiring");
            assert_eq!(is_noted, passes && !fault.is_empty(), "{index}");
        }
    }
}

/// The estimate alone: the client of a gateway counts at the structure.
fn estimate(keys: &str) -> &str {
    &keys[..=keys.find('\n').unwrap()]
}

#[test]
fn meaningless_reason_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let link = format!("[specimen.link]\naddress = \"127.0.0.1:1\"\n{PROBE}");
    let text = test_file(20, &format!("storey = 1\nstiffness_n_per_m = 4e6\n{link}"));
    for reason in ["", " ", "\\u200b", "1"] {
        let said = format!("[safety]\naccept_wiring = \"{reason}\"\n");
        let text = text.replacen("[safety]\n", &said, 1);
        let (code, said) = run(folder.path(), "refused", &text);
        assert_eq!(code, 2, "{said}");
        assert!(said.contains("accept_wiring"), "{said}");
    }
}
