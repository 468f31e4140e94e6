//! `[specimen.link]`: numbers inside their ranges, and keys that our own protocol does not support.

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::link_table::{Carrier, LinkCoupling, LinkSpec, Protocol};
use crate::schema::TestFile;
use crate::specimen::SpecimenTable;
use gusset_quantity::text::is_hidden;

/// The link of one specimen.
pub(super) fn check_link(
    specimen: &SpecimenTable,
    link: &LinkSpec,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let here = at.key("link");
    if specimen.stiffness_n_per_m.is_none() {
        findings.push(
            Finding::error(here.clone(), "`stiffness_n_per_m` is missing")
                .label("needed for a specimen behind a link, which has no law")
                .help(
                    "it enters K0, and is compared with the stiffness that the specimen reports on connection",
                ),
        );
    }
    check_probe(specimen, link, &here, findings);
    if let Some(names) = &link.axis_names {
        check_names(names, specimen, &here.key("axis_names"), findings);
    }
    if link.protocol == Protocol::Ethercat {
        return;
    }
    if let Err(text) = check_address(&link.address) {
        findings.push(
            Finding::error(
                here.key("address"),
                format!("{:?} has no {text}", link.address),
            )
            .label("write \"host:port\", \"192.0.2.7:port\" or \"[2001:db8::7]:port\""),
        );
    }
    if link.tls.is_some() && link.transport != Carrier::Tls {
        findings.push(
            Finding::error(here.key("tls"), "certificates are for TLS only")
                .at_key()
                .label("needed for `transport = \"tls\"`"),
        );
    }
    if link.protocol != Protocol::Gusset {
        check_openfresco(link, specimen.axes(), &here, findings);
        return;
    }
    if link.openfresco.is_some() {
        findings.push(
            Finding::error(
                here.key("openfresco"),
                "the protocol of Gusset has no such settings",
            )
            .at_key()
            .label("only for `protocol = \"openfresco…\"`"),
        );
    }
    for (index, axis) in specimen.axis.iter().enumerate() {
        let at = at.key("axis").index(index);
        for (key, known) in axis.foreign_units() {
            let text = format!("the protocol of Gusset does not support this `{key}`");
            findings.push(
                Finding::error(at.key(key), text)
                    .label(known)
                    .help(
                        "inches, feet, pounds and kips need `protocol = \"openfresco…\"`; otherwise let the server use m or \
                         mm, and N or kN",
                    ),
            );
        }
    }
}

/// Two specimens behind one address: a server has one specimen and takes one controller.
pub(super) fn check_shared(specimens: &[SpecimenTable], findings: &mut Findings) {
    let at = |index: usize| {
        let specimen = KeyPath::root().key("specimen").index(index);
        specimen.key("link").key("address")
    };
    for (index, specimen) in specimens.iter().enumerate() {
        let Some(link) = &specimen.link else {
            continue;
        };
        let shares = |other: &&SpecimenTable| {
            let known = other.link.as_ref();
            known.is_some_and(|known| known.needs_port(&link.address, link.transport))
        };
        if let Some(first) = specimens[..index].iter().position(|known| shares(&known)) {
            let name = |index: usize| &specimens[index].name;
            let text = format!(
                "the links of `{}` and `{}` have the same address",
                name(first),
                name(index)
            );
            findings.push(
                Finding::error(at(index), text)
                    .label("also here")
                    .beside(at(first), "first here")
                    .help("a server has one specimen and takes one controller: start one server for each specimen"),
            );
        }
    }
}

/// How often it is commanded.
pub(super) fn check_pace(
    specimen: &SpecimenTable,
    file: &TestFile,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let Some(link) = &specimen.link else {
        return;
    };
    if !link.is_per_step() {
        return;
    }
    let here = at.key("link").key("commands");
    if file.time.ticks_per_step == 1 {
        findings.push(
            Finding::error(here, "each step has only one tick here")
                .label("\"every_step\" is for tests with several ticks per step")
                .help("set `ticks_per_step` in [time]"),
        );
    } else if link.protocol == Protocol::Gusset && link.coupling == LinkCoupling::Sampled {
        findings.push(
            Finding::error(here, "a sampled specimen needs a command at every tick")
                .label("\"every_step\" needs `coupling = \"lockstep\"`")
                .beside(at.key("link").key("coupling"), "sampled here"),
        );
    } else if file.timing.warmup_ticks == Some(0) {
        // The record must separate its first answer from earlier readings.
        let warm_up = KeyPath::root().key("timing").key("warmup_ticks");
        let text =
            "a specimen that is commanded once per step needs a warm-up of at least one tick";
        findings.push(Finding::error(warm_up, text).beside(here, "commanded once per step here"));
    }
}

/// The missing part of "host:port". A connection shows whether the host exists.
fn check_address(address: &str) -> Result<(), &'static str> {
    let (host, port) = address.rsplit_once(':').ok_or("port")?;
    if !port.bytes().all(|c| c.is_ascii_digit()) || !port.parse::<u16>().is_ok_and(|port| port > 0)
    {
        return Err("port from 1 to 65535");
    }
    let inner = host
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'));
    match inner {
        Some(inner) if inner.contains(':') => Ok(()),
        None if !host.is_empty() && !host.contains([':', '[', ']']) => Ok(()),
        _ => Err("host name before the port"),
    }
}

fn check_probe(specimen: &SpecimenTable, link: &LinkSpec, at: &KeyPath, findings: &mut Findings) {
    if link.probe_m.is_none() {
        return;
    }
    if link.probe.is_some() {
        findings.push(
            Finding::error(
                at.key("probe"),
                "`probe = \"none\"` and `probe_m` contradict each other",
            )
            .at_key()
            .label("no motion here")
            .beside(at.key("probe_m"), "a motion there"),
        );
    }
    let estimate = specimen.stiffness_n_per_m.as_ref();
    let rows = estimate.map(|matrix| matrix.rows()).unwrap_or_default();
    let soft = (0..rows.len()).find(|axis| rows[*axis].get(*axis).is_none_or(|k| *k <= 0.0));
    if let Some(axis) = soft {
        findings.push(
            Finding::error(
                at.key("probe_m"),
                format!("the wiring check needs a stiffness on axis {}", axis + 1),
            )
            .label("without a stiffness a slow motion causes no force")
            .help("set `probe = \"none\"` and check the wiring by hand"),
        );
    }
}

/// Either the link or the file gives the position of the specimen, not both. Our own protocol is an exception: its specimens
/// may report it.
pub(super) fn check_standing(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let Some(link) = &specimen.link else {
        return;
    };
    let (at, axes) = (at.key("link"), specimen.axes());
    let reports = link.reports_position(axes);
    let here = at.key("stands_at_m");
    match &link.stands_at_m {
        None if reports != Some(false) || link.computed => {}
        None => findings.push(
            Finding::error(at.clone(), "the position of this specimen before the test is unknown")
                .label("this protocol cannot report the position before the first command")
                .help(format!(
                    "give it as `stands_at_m = {:?}`, in m with the sign of each axis: the test starts from there",
                    vec![0.0; axes]
                ))
                .help("or set `computed = true` if the server only simulates"),
        ),
        Some(_) if reports == Some(true) => {
            let finding = Finding::error(here, "the specimen reports its position, so `stands_at_m` is not needed").at_key();
            let chosen = link.openfresco.as_ref();
            let given = chosen.is_some_and(|given| given.answer_signals.is_some());
            findings.push(if given {
                finding
                    .label("`openfresco.answer_signals` gives displacements and forces")
                    .help("remove one of the two keys: an element server of OpenFresco measures no displacement")
            } else {
                finding.label("only for an element server, an actor site, an adapter, or a server with the protocol of Gusset \
                 that does not report it")
            });
        }
        Some(stands) if stands.len() != axes => {
            let text = format!("{} displacements for {axes} axes", stands.len());
            findings.push(Finding::error(here, text).label("one per axis"));
        }
        Some(stands) => {
            if let Some(index) = stands.iter().position(|disp| !disp.is_finite()) {
                let text = format!("axis {} is at {}", index + 1, stands[index]);
                findings.push(Finding::error(here, text).label("must be a finite number, in m"));
            }
        }
    }
}

/// Keys that OpenFresco's protocols do not support.
fn check_openfresco(link: &LinkSpec, axes: usize, at: &KeyPath, findings: &mut Findings) {
    let more = link.openfresco.iter();
    for (key, found, allowed) in more.flat_map(|more| more.out_of_range(axes)) {
        let text = format!("`{key}` is {found}, but must be {allowed}");
        let at = at.key("openfresco").key(key);
        findings.push(Finding::error(at, text));
    }
    for (key, why) in [
        ("key_file", "they know no key"),
        ("watchdog_s", "this server has no watchdog for commands"),
        ("sample_after", "the server answers each request"),
        ("axis_names", "this protocol has no names of axes"),
    ] {
        for place in findings.given(at, key) {
            let text = format!("OpenFresco's protocols do not support `{key}`");
            findings.push(Finding::error(place, text).at_key().label(why));
        }
    }
}

fn check_names(names: &[String], specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let axes = specimen.axes();
    if names.len() != axes {
        let text = format!("{} names for {axes} axes", names.len());
        findings.push(Finding::error(at.clone(), text).label("one name per axis"));
    }
    for (index, name) in names.iter().enumerate() {
        let fits = !name.is_empty() && name.len() <= 64 && !name.chars().any(is_hidden);
        if !fits || names[..index].contains(name) {
            findings.push(
                Finding::error(at.index(index), format!("{name:?} cannot name an axis"))
                    .label("a name has 1 to 64 bytes and is unique"),
            );
        }
    }
}
