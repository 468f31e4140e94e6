//! Keys that decide what the stiffness of a damping rule is: they need a frame, and a rule with such a stiffness.

use super::rules::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::schema::TestFile;
use gusset_numerics::model::DampingSpec;

pub(super) fn check_damping(file: &TestFile, findings: &mut Findings) {
    let root = KeyPath::root();
    let structure = file.structure.as_ref();
    let frame = structure.and_then(|structure| structure.frame.as_ref());
    let mut given = Vec::new();
    for (index, specimen) in file.specimen.iter().enumerate() {
        let at = root.key("specimen").index(index).key("damped");
        match (specimen.damped, frame) {
            (Some(true), Some(_)) => given.push(at),
            (Some(_), None) => {
                let text = format!("`{at}` is only for a specimen of a frame");
                let finding = Finding::error(at, text).at_key();
                findings.push(match structure {
                    Some(_) => {
                        finding.label("damping rules of this structure include all specimens")
                    }
                    None => finding.label("the test has no structure"),
                });
            }
            _ => {}
        }
    }
    let of_frame = root.under("structure.frame");
    let members = frame
        .iter()
        .flat_map(|frame| frame.member.iter().enumerate());
    let members = members.filter(|(_, member)| member.stiffness_coefficient_s.is_some());
    let key = |index| {
        of_frame
            .key("member")
            .index(index)
            .key("stiffness_coefficient_s")
    };
    given.extend(members.map(|(index, _)| key(index)));
    let links = frame.iter().flat_map(|frame| frame.link.iter().enumerate());
    let links = links.filter(|(_, link)| link.damped);
    given.extend(links.map(|(index, _)| of_frame.key("link").index(index).key("damped")));
    let lacks = match structure.and_then(|structure| structure.damping.as_ref()) {
        Some(DampingSpec::Rayleigh(_) | DampingSpec::RayleighRatio(_)) => return,
        Some(DampingSpec::Modal(_)) => "modal damping belongs to the masses, not to a stiffness",
        None => "the test has no `[structure.damping]`",
    };
    for at in given {
        let text = format!("`{at}` needs a damping rule that refers to the stiffness");
        let finding = Finding::error(at, text).at_key().label(lacks);
        findings.push(finding.help("use `rayleigh` or `rayleigh_ratio`, or remove the key"));
    }
}
