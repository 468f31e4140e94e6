//! `[about]`: texts that can be shown.

use super::Findings;
use crate::about_table::AboutTable;
use crate::diagnose::Finding;
use crate::document::KeyPath;

/// Refuses hidden characters, which would mislead a reader of the report, and a DOI without the form of one.
pub(super) fn check_about(about: &AboutTable, findings: &mut Findings) {
    let at = KeyPath::root().key("about");
    for (key, text) in [
        ("operator", &about.operator),
        ("laboratory", &about.laboratory),
        ("project", &about.project),
        ("notes", &about.notes),
        ("licence", &about.licence),
        ("doi", &about.doi),
    ] {
        findings.printable(&at.key(key), text.as_deref());
    }
    for (index, word) in about.keywords.iter().enumerate() {
        findings.printable(&at.key("keywords").index(index), Some(word));
    }
    for (index, specimen) in about.specimen.iter().enumerate() {
        let at = at.key("specimen").index(index);
        findings.printable(&at.key("id"), Some(&specimen.id));
        findings.printable(&at.key("material"), specimen.material.as_deref());
        findings.printable(&at.key("state"), specimen.state.as_deref());
    }
    if let Some(doi) = &about.doi
        && !(doi.starts_with("10.") && doi.contains('/'))
    {
        let text = format!("`about.doi` is {doi:?}, but a DOI begins with \"10.\" and has a \"/\"");
        let finding = Finding::error(at.key("doi"), text);
        findings.push(
            finding
                .help("for example \"10.17603/ds2-abcd-1234\", without the address of a resolver"),
        );
    }
}
