//! Keys of `[[specimen]]` and of its link that have no effect beside the others.

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::limit_table::LimitsSpec;
use crate::link_table::{Carrier, CommandPace, LinkCoupling, LinkSpec, Protocol, StaleChoice};
use crate::safety::{ExitChoice, SafetyTable, ZeroChoice};
use crate::specimen::SpecimenTable;
use gusset_actuator::compensation::CompensationSpec;
use gusset_actuator::transfer::{BetweenTicks, TransferSpec};
use gusset_numerics::law::Reach;
use gusset_quantity::catalog::limit::Limit;

/// One specimen; `safety` is that of the test, and absent where the file is only served.
pub(in crate::check) fn check_idle_specimen(
    specimen: &SpecimenTable,
    with_structure: bool,
    safety: Option<&SafetyTable>,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let leaves = safety.map(|safety| [safety.on_trip, safety.at_end]);
    findings.idle(
        at,
        "safe_disp_m",
        specimen.safe_disp_m.is_some()
            && !leaves.is_some_and(|both| both.contains(&ExitChoice::SafeDisplacement)),
        "only for `on_trip` or `at_end` = \"safe_displacement\"",
    );
    findings.idle(
        at,
        "mass_in_force_kg",
        specimen.mass_in_force_kg > 0.0 && !with_structure,
        "acts on a structure, and this file has no `[structure]`",
    );
    if let Some(transfer) = &specimen.transfer {
        check_transfer(transfer, &at.key("transfer"), findings);
    }
    // A server takes no zero.
    let own = specimen.axis.iter().enumerate();
    for (index, axis) in own.filter(|_| safety.is_some()) {
        let at = at.key("axis").index(index);
        for (key, zero, given, choice) in [
            ("offset_m", "zero_disp", axis.offset_m, axis.zero_disp),
            ("offset_n", "zero_force", axis.offset_n, axis.zero_force),
        ] {
            let why =
                format!("`{zero} = \"relative\"` takes the zero from the reading before the test");
            let relative = choice == ZeroChoice::Relative;
            findings.idle(&at, key, given != 0.0 && relative, &why);
        }
    }
    check_limits(specimen, at, findings);
    check_start(specimen, at, findings);
    if safety.is_some() {
        check_reach(specimen, at, findings);
    }
    if safety.is_none() {
        check_served(specimen, at, findings);
    }
}

fn check_transfer(spec: &TransferSpec, at: &KeyPath, findings: &mut Findings) {
    findings.idle(
        at,
        "seed",
        spec.seed != 0 && !spec.is_noisy(),
        "no sensor of this specimen has noise",
    );
    findings.idle(
        at,
        "between_ticks",
        spec.between_ticks == BetweenTicks::Held && !spec.lags(),
        "only for an `actuator` with a lag",
    );
}

/// Numbers that only affect the judgement of a bound, without that bound.
fn check_limits(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let merged = specimen.limits_of(specimen.axes().max(specimen.axis.len()));
    let mut check = |limits: &LimitsSpec, bounds: &[LimitsSpec], at: &KeyPath| {
        for limit in Limit::OF_AXIS {
            if let Some((setting, value)) = limits.setting(limit) {
                let idle = !bounds.iter().any(|axis| axis.has(limit));
                let why = format!("only with a limit `{}`", limit.key());
                findings.idle(at, setting.key, value != 0.0 && idle, &why);
            }
        }
    };
    if let Some(all) = &specimen.limits {
        check(all, &merged, &at.key("limits"));
    }
    for (index, axis) in specimen.axis.iter().enumerate() {
        if let (Some(own), Some(merged)) = (&axis.limits, merged.get(index)) {
            let at = at.key("axis").index(index).key("limits");
            check(own, std::slice::from_ref(merged), &at);
        }
    }
}

/// Given coefficients replace those that follow from delay and gain.
fn check_start(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let Some(CompensationSpec::Ats(ats)) = &specimen.compensation else {
        return;
    };
    if ats.start.is_some() {
        findings.all_idle(
            &at.key("compensation").key("ats"),
            &[
                ("delay_s", ats.delay_s.is_some()),
                ("gain", ats.gain != 1.0),
            ],
            "`start` already gives the coefficients",
        );
    }
}

/// A reach, where the tangents of the law have their bounds without it. One that turns actuators into a platform is not judged.
fn check_reach(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let axes = specimen.law_axes();
    let far = Some(1.0);
    let (disp, vel) = match (specimen.sources().first(), &specimen.link) {
        _ if specimen.geometry.is_some() => return,
        (_, Some(_)) => {
            let why = "for a specimen behind a link use `hardening_bound`";
            ((true, why), (true, why))
        }
        // No law is an error, found elsewhere.
        (None, None) => return,
        (Some((_, source)), None) => {
            // A law that cannot be built is an error, reported elsewhere.
            let Ok(law) = source.build(axes) else { return };
            let is_bounded = |disp, vel| {
                let reach = vec![Reach { disp, vel }; axes];
                let (mut k, mut c) = (vec![0.0; axes * axes], vec![0.0; axes * axes]);
                law.bound(&reach, &mut k, &mut c).is_ok()
            };
            let why = "the tangent of this law is bounded without it";
            ((is_bounded(None, far), why), (is_bounded(far, None), why))
        }
    };
    for (key, given, (idle, why)) in [
        ("reach_disp_m", specimen.reach_disp_m, disp),
        ("reach_vel_m_per_s", specimen.reach_vel_m_per_s, vel),
    ] {
        findings.idle(at, key, given.is_some() && idle, why);
    }
}

/// Keys of the controller's test file, in the file of a server. A gateway converts by those keys itself.
fn check_served(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let why = "only for the controller's test file: a server uses the numbers of the axes";
    if specimen.link.is_none() {
        findings.idle(
            at,
            "similitude",
            specimen.similitude != Default::default() && specimen.geometry.is_none(),
            why,
        );
        for (index, axis) in specimen.axis.iter().enumerate() {
            let at = at.key("axis").index(index);
            let zeros = [
                ("zero_disp", axis.zero_disp == ZeroChoice::Relative),
                ("zero_force", axis.zero_force == ZeroChoice::Relative),
            ];
            for (key, given) in axis.gear().into_iter().chain(zeros) {
                findings.idle(&at, key, given, why);
            }
        }
    }
    if let Some(link) = &specimen.link {
        refuse_relative_zeros(specimen, at, findings);
        let keys = [
            ("on_stale", link.on_stale != StaleChoice::default()),
            ("max_stale", link.max_stale.is_some()),
            ("commands", link.commands != CommandPace::default()),
            ("computed", link.computed),
        ];
        let why = "a gateway forwards each command and waits for its reply";
        findings.all_idle(&at.key("link"), &keys, why);
    }
    let in_rehearsals = specimen.stand_in().map(|(key, _)| key);
    let in_rehearsals = in_rehearsals.into_iter();
    let actuator = specimen.link.as_ref().and(specimen.transfer.as_ref());
    for key in in_rehearsals.chain(actuator.map(|_| "transfer")) {
        findings.idle(at, key, true, "a gateway has no rehearsal");
    }
    for (key, given) in [
        ("reach_disp_m", specimen.reach_disp_m.is_some()),
        ("reach_vel_m_per_s", specimen.reach_vel_m_per_s.is_some()),
        ("hardening_bound", specimen.hardening_bound.is_some()),
        ("identified", specimen.identified.is_some()),
        ("capacity", specimen.capacity.is_some()),
        ("drill", specimen.drill.is_some()),
    ] {
        findings.idle(at, key, given, why);
    }
}

/// A gateway adds its offsets to every command and measurement, and reads no zero before a session: its zero would differ from
/// that of the file.
fn refuse_relative_zeros(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    for (index, axis) in specimen.axis.iter().enumerate() {
        let at = at.key("axis").index(index);
        let of_disp = "`offset_m` is the position of the axis at zero deformation";
        let of_force = "`offset_n` is the reading of the load cell at zero force";
        for (key, zero, offset) in [
            ("zero_disp", axis.zero_disp, of_disp),
            ("zero_force", axis.zero_force, of_force),
        ] {
            if zero == ZeroChoice::Relative {
                let text = format!("a gateway does not support `{key} = \"relative\"`");
                let finding = Finding::error(at.key(key), text)
                    .label("it takes no zero before a session")
                    .help(format!("remove the key; {offset}"));
                findings.0.push(finding);
            }
        }
    }
}

/// The link of one specimen of a test; `at` is its place. On the simulated clock every link is lockstep, whatever coupling
/// the file has for the real one.
pub(in crate::check) fn check_idle_link(link: &LinkSpec, at: &KeyPath, findings: &mut Findings) {
    let native = link.protocol == Protocol::Gusset;
    let lockstep = !native || link.coupling == LinkCoupling::Lockstep;
    let stale = link.max_stale.is_some();
    let why_lockstep = if native {
        "`coupling = \"lockstep\"` waits for every reply, so no measurement is stale"
    } else {
        "OpenFresco's protocols wait for every reply, so no measurement is stale"
    };
    if lockstep {
        let usual = StaleChoice::default();
        findings.idle(at, "on_stale", link.on_stale != usual, why_lockstep);
        findings.idle(at, "max_stale", stale, why_lockstep);
    } else if link.on_stale == StaleChoice::Stop {
        let why = "`on_stale = \"stop\"` stops at the first one";
        findings.idle(at, "max_stale", stale, why);
    }
    findings.idle(
        at,
        "probe_ramp_s",
        link.probe_ramp_s != 0.5 && link.probe_m.is_none(),
        "only with `probe_m`, which is missing",
    );
    let Some(more) = &link.openfresco else { return };
    let at = at.key("openfresco");
    let over_udp = link.transport == Carrier::Udp;
    let shadow = link.protocol == Protocol::OpenFrescoShadow;
    findings.idle(
        &at,
        "udp_hello",
        more.udp_hello.is_some() && !over_udp,
        "only for `transport = \"udp\"`",
    );
    let why = "only for `protocol = \"openfresco-shadow\"`";
    findings.idle(&at, "version", more.version.is_some() && !shadow, why);
    findings.idle(&at, "site", more.site != 0 && !shadow, why);
    findings.idle(
        &at,
        "server",
        more.server != Default::default() && link.protocol != Protocol::OpenFresco,
        "only for `protocol = \"openfresco\"`",
    );
}
