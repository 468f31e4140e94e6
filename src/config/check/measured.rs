//! Keys that need a measured displacement, beside a link whose answers hold none.
//!
//! Such a link answers with forces only. The loop then takes the command for the measured displacement, so a limit of it can
//! never trip, and a compensator that adapts to it learns nothing.

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::limit_table::LimitsSpec;
use crate::safety::ZeroChoice;
use crate::schema::TestFile;
use crate::specimen::ForceOnly;
use crate::specimen::SpecimenTable;
use gusset_wire::openfresco::Peer;

/// Refuses every key of a specimen that needs a measured displacement where its link answers with none.
pub(super) fn check_measured(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let Some(peer) = specimen.force_only_link() else {
        return;
    };
    let remedy = remedy(peer, specimen.axes());
    for (place, key) in needing_measured_disp(specimen, at) {
        let text = format!(
            "`{key}` needs a measured displacement, but this link answers with forces only"
        );
        findings.push(
            Finding::error(place, text)
                .at_key()
                .label("it would compare the command with itself")
                .help(remedy.clone()),
        );
    }
}

/// Keys of `[safety]` that judge all specimens by their measured displacements: an error where no link answers with one, a warning
/// where only some of them do not.
pub(super) fn check_judged(file: &TestFile, findings: &mut Findings) {
    let silent = file.specimen.iter().enumerate();
    let silent: Vec<_> = silent
        .filter_map(|(index, specimen)| Some((index, specimen, specimen.force_only_link()?)))
        .collect();
    let Some((first, specimen, peer)) = silent.first() else {
        return;
    };
    let names = silent.iter().map(|(_, of, _)| format!("\"{}\"", of.name));
    let names = names.collect::<Vec<_>>().join(", ");
    let link = KeyPath::root().key("specimen").index(*first).key("link");
    for key in file.safety.needing_measured_disp() {
        let at = KeyPath::root().key("safety").key(key);
        let finding = if silent.len() == file.specimen.len() {
            let text = format!(
                "`{key}` needs a measured displacement, but all links answer with forces only: {names}"
            );
            Finding::error(at, text)
                .label("it would compare the commands with themselves")
                .help(remedy(*peer, specimen.axes()))
        } else {
            let text =
                format!("`{key}` does not check {names}: their links answer with forces only");
            Finding::warning(at, text).label("it needs a measured displacement")
        };
        findings.push(
            finding
                .at_key()
                .beside(link.clone(), "no measured displacement"),
        );
    }
}

/// The keys of a specimen that need a measured displacement, each with its place. The check of the file refuses them where the
/// link is known to answer without one, the controller where that shows only once it has connected.
pub fn needing_measured_disp(
    specimen: &SpecimenTable,
    at: &KeyPath,
) -> Vec<(KeyPath, &'static str)> {
    let mut keys = Vec::new();
    let mut add = |limits: Option<&LimitsSpec>, at: KeyPath| {
        let given = limits
            .into_iter()
            .flat_map(LimitsSpec::needing_measured_disp);
        keys.extend(given.map(|key| (at.key(key), key)));
    };
    add(specimen.limits.as_ref(), at.key("limits"));
    for (index, axis) in specimen.axis.iter().enumerate() {
        let at = at.key("axis").index(index);
        add(axis.limits.as_ref(), at.key("limits"));
    }
    for (index, axis) in specimen.axis.iter().enumerate() {
        if axis.zero_disp == ZeroChoice::Relative {
            let at = at.key("axis").index(index);
            keys.push((at.key("zero_disp"), "zero_disp"));
        }
    }
    if let Some(spec) = &specimen.compensation
        && spec.uses_measured_disp()
    {
        let kind = spec.kind();
        keys.push((at.key("compensation").key(kind), kind));
    }
    keys
}

fn remedy(end: ForceOnly, n: usize) -> String {
    let signals =
        format!("`openfresco.answer_signals = [{n}, {n}, {n}, {n}, 1]` in [specimen.link]");
    let peer = match end {
        ForceOnly::Bus => {
            return "give each axis a `disp` in [[specimen.bus.axis]], the input that measures its displacement".to_owned();
        }
        ForceOnly::Peer(peer) => peer,
    };
    match peer {
        Peer::Element => format!(
            "an element server of OpenFresco always answers displacement 0; if the server measures it, as `gusset serve` \
             does, set {signals}"
        ),
        Peer::Site | Peer::Actor | Peer::Adapter => {
            "the first number of `openfresco.answer_signals` in [specimen.link] is 0".to_owned()
        }
    }
}
