//! Keys that need a measured displacement, beside a link whose answers hold none.
//!
//! Such a link answers with forces only. The loop then takes the command for the measured displacement, so a limit of it can
//! never trip, and a compensator that adapts to it learns nothing.

use super::Findings;
use crate::config::diagnose::Finding;
use crate::config::document::KeyPath;
use crate::config::safety::ZeroChoice;
use crate::config::specimen::SpecimenTable;
use crate::control::limits::LimitsSpec;
use crate::link::openfresco::{Peer, RemoteSettings};

/// Refuses every key of a specimen that needs a measured displacement where its link answers with none.
pub(super) fn check_measured(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let Some(link) = &specimen.link else {
        return;
    };
    // A mistake in the settings is reported where the link is built.
    let Ok(Some(settings)) = RemoteSettings::from_spec(link, specimen.axes()) else {
        return;
    };
    if settings.measures_disp() {
        return;
    }
    let remedy = remedy(&settings, specimen.axes());
    let mut refuse = |at: KeyPath, key: &str| {
        findings.0.push(
            Finding::error(
                at.clone(),
                format!(
                    "`{key}` needs a measured displacement, but this link answers with forces only"
                ),
            )
            .at_key()
            .label("would compare the command with itself")
            .help(remedy.clone()),
        );
    };
    refuse_limits(specimen.limits.as_ref(), &at.key("limits"), &mut refuse);
    for (index, axis) in specimen.axis.iter().enumerate() {
        let at = at.key("axis").index(index);
        refuse_limits(axis.limits.as_ref(), &at.key("limits"), &mut refuse);
        if axis.zero_disp == ZeroChoice::Relative {
            refuse(at.key("zero_disp"), "zero_disp");
        }
    }
    if let Some(spec) = &specimen.compensation
        && spec.uses_measured_disp()
    {
        refuse(at.key("compensation").key(spec.kind()), spec.kind());
    }
}

fn refuse_limits(
    limits: Option<&LimitsSpec>,
    at: &KeyPath,
    refuse: &mut impl FnMut(KeyPath, &str),
) {
    let Some(limits) = limits else {
        return;
    };
    for (key, given) in [
        ("measured_disp_m", limits.measured_disp_m.is_some()),
        ("sensor_disp_m", limits.sensor_disp_m.is_some()),
        ("following_error_m", limits.following_error_m.is_some()),
        ("stuck_ticks", limits.stuck_ticks.is_some()),
        ("added_energy_j", limits.added_energy_j.is_some()),
        ("lag_s", limits.lag_s.is_some()),
        ("gain_error", limits.gain_error.is_some()),
    ] {
        if given {
            refuse(at.key(key), key);
        }
    }
}

fn remedy(settings: &RemoteSettings, n: usize) -> String {
    let signals =
        format!("`openfresco.answer_signals = [{n}, {n}, {n}, {n}, 1]` in [specimen.link]");
    match settings.peer {
        Peer::Element => format!(
            "an element server of OpenFresco always answers displacement 0; where the server measures, as `gusset serve` does, \
             say {signals}"
        ),
        Peer::Site | Peer::Actor | Peer::Adapter => {
            "the first number of `openfresco.answer_signals` in [specimen.link] is 0".to_owned()
        }
    }
}
