//! `[about]`: texts that can be shown.

use super::Findings;
use crate::about_table::{AboutTable, is_blank};
use crate::diagnose::Finding;
use crate::document::KeyPath;

/// Refuses hidden characters, which would mislead a reader of the report, a specimen without identifier, and a DOI without the form
/// of one.
pub(super) fn check_about(about: &AboutTable, findings: &mut Findings) {
    let at = KeyPath::root().key("about");
    let notes = about.notes.as_ref().map(|text| text.replace('\n', " "));
    for (key, text) in [
        ("operator", &about.operator),
        ("laboratory", &about.laboratory),
        ("project", &about.project),
        ("notes", &notes),
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
        let mut others = [&specimen.material, &specimen.state].into_iter().flatten();
        if is_blank(&specimen.id) && others.any(|text| !is_blank(text)) {
            let text = format!("`{}` is empty", at.key("id"));
            let finding = Finding::error(at.key("id"), text);
            findings.push(finding.help("for example \"B-07\", the identifier in the laboratory"));
        }
    }
    if let Some(doi) = &about.doi
        && !is_blank(doi)
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

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> AboutTable {
        toml::from_str(text).unwrap()
    }

    /// The keys with a finding.
    fn refused(text: &str) -> Vec<String> {
        let about = table(text);
        let mut findings = Findings::of(&about);
        check_about(&about, &mut findings);
        let keys = findings.list.iter().map(|finding| finding.path.to_string());
        keys.collect()
    }

    #[test]
    fn empty_texts_are_not_given() {
        let text = "operator = ''\nproject = 'P'\ndoi = ' '\nkeywords = [' ', 'a']\n\
                    specimen = [{ id = '', material = ' ' }, { id = 'B', state = '' }]\n";
        assert_eq!(refused(text), [""; 0]);
        let mut about = table(text);
        about.leave_out_empty();
        let expected = "project = 'P'\nkeywords = ['a']\nspecimen = [{ id = 'B' }]\n";
        assert_eq!(about, table(expected));
        let mut about = table("operator = ' '\nspecimen = [{ id = '', state = '' }]\n");
        about.leave_out_empty();
        assert_eq!(about.as_json(), None);
    }

    #[test]
    fn wrong_texts_are_refused() {
        for (text, keys) in [
            ("notes = \"one\\ntwo\"", &[][..]),
            ("notes = \"one\\ttwo\"", &["about.notes"]),
            ("project = \"one\\ntwo\"", &["about.project"]),
            ("doi = 'https://doi.org/10.1/2'", &["about.doi"]),
            (
                "specimen = [{ id = ' ', state = 'virgin' }]",
                &["about.specimen[0].id"],
            ),
        ] {
            assert_eq!(refused(text), keys, "{text}");
        }
    }
}
