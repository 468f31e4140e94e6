//! What all renderers share: the parser's options, anchors of headings, and where links lead.

use pulldown_cmark::{Options, Parser};

/// The parser of the guide's Markdown: CommonMark with tables.
pub(super) fn parse(text: &str) -> Parser<'_> {
    Parser::new_ext(text, Options::ENABLE_TABLES)
}

/// The anchor of a heading, as GitHub and rustdoc make it: lower case, blanks become hyphens, punctuation disappears.
#[must_use]
pub fn anchor(heading: &str) -> String {
    heading
        .chars()
        .filter_map(|c| match c {
            ' ' => Some('-'),
            '-' | '_' => Some(c),
            c if c.is_alphanumeric() => Some(c),
            _ => None,
        })
        .flat_map(char::to_lowercase)
        .collect()
}

/// The id of the page that a link leads to, if it leads to a page; the contents page has the id "README".
pub(super) fn linked_page(target: &str) -> Option<&str> {
    let id = target.strip_suffix(".md")?;
    (!id.contains('/')).then_some(id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_those_of_github() {
        assert_eq!(anchor("Your first hybrid test"), "your-first-hybrid-test");
        assert_eq!(anchor("[specimen.limits]"), "specimenlimits");
        assert_eq!(anchor("λ and its choice"), "λ-and-its-choice");
    }

    #[test]
    fn only_links_to_pages_beside_are_pages() {
        assert_eq!(linked_page("limits.md"), Some("limits"));
        assert_eq!(linked_page("https://example.org/limits.md"), None);
        assert_eq!(linked_page("#limits"), None);
    }
}
