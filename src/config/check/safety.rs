//! `[safety]`, and related keys of the specimens.

use super::{Finding, Findings, KeyPath, TestFile};
use crate::{ExitChoice, ShareSpec, ZeroChoice};

pub(super) fn check_safety(file: &TestFile, findings: &mut Findings) {
    let safety = &file.safety;
    let at = KeyPath::root().key("safety");
    for (key, bound) in [
        ("stability_used", safety.stability_used),
        ("delay_used", safety.delay_used),
        ("step_audit", safety.step_audit),
        ("static_unbalance", safety.static_unbalance),
        (
            "added_energy_share",
            safety.added_energy_share.map(ShareSpec::levels),
        ),
    ] {
        if let Some(Err(error)) = bound.map(|bound| bound.check(key)) {
            findings.push(Finding::error(at.key(key), error.to_string()));
        }
    }
    if safety.added_energy_share.is_some() && file.structure.is_none() {
        let finding = Finding::error(at.key("added_energy_share"), "this test has no structure")
            .label("a share of what?")
            .help("use `added_energy_j` in the limits of a specimen for one axis, in J");
        findings.push(finding);
    }
    let (warn, refuse) = (safety.error_warn, safety.error_refuse);
    let is_sound = warn > 0.0 && warn <= 1.0 && refuse >= warn && refuse.is_finite();
    if !is_sound {
        let text = format!(
            "`error_warn` is {warn} and `error_refuse` is {refuse}, but 0 < `error_warn` ≤ 1 and `error_warn` ≤ `error_refuse` are required"
        );
        findings.push(Finding::error(at.key("error_refuse"), text).label("shares of a drift"));
    }
    for (key, choice) in [("on_trip", safety.on_trip), ("at_end", safety.at_end)] {
        if choice == ExitChoice::Freeze {
            continue;
        }
        if safety.exit_speed_m_per_s.is_none() {
            findings.push(
                Finding::error(
                    at.key(key),
                    format!(
                        "\"{}\" moves the specimens, but their speed is not given",
                        choice.word()
                    ),
                )
                .label("`exit_speed_m_per_s` is missing"),
            );
        }
        for (index, specimen) in file.specimen.iter().enumerate() {
            if choice == ExitChoice::SafeDisplacement && specimen.safe_disp_m.is_none() {
                let place = KeyPath::root().key("specimen").index(index);
                findings.push(
                    Finding::error(place, "the safe position of this specimen is not given")
                        .label("`safe_disp_m` is missing")
                        .beside(at.key(key), "asked for here"),
                );
            }
        }
    }
    check_confirmation(file, &at, findings);
    for (index, specimen) in file.specimen.iter().enumerate() {
        for (number, axis) in specimen.axis.iter().enumerate() {
            let place = KeyPath::root().key("specimen").index(index);
            let place = place.key("axis").index(number);
            for (key, zero) in [
                ("zero_disp", axis.zero_disp),
                ("zero_force", axis.zero_force),
            ] {
                if zero == ZeroChoice::Relative && safety.zero_s.is_some_and(|zero| zero <= 0.0) {
                    findings.push(
                        Finding::error(place.key(key), "the sensors are not read before the test")
                            .label("a relative zero needs a reading")
                            .beside(at.key("zero_s"), "0 here"),
                    );
                }
            }
        }
    }
}

/// Readings that must be confirmed need zeroing.
fn check_confirmation(file: &TestFile, at: &KeyPath, findings: &mut Findings) {
    let safety = &file.safety;
    let is_unread = safety.zero_s.is_some_and(|zero| zero <= 0.0);
    if safety.confirm && is_unread && !file.specimen.is_empty() {
        let text = "the sensors are not read before the test, so there is nothing to confirm";
        let finding = Finding::error(at.key("confirm"), text)
            .label("this waits for the operator")
            .beside(at.key("zero_s"), "no sensor is read, because this is 0");
        findings.push(finding);
    }
}
