//! The search of the guide: the entries of all pages in which every word occurs, best first.
//!
//! `gusset guide WORD` and the web pages search one index with one table of points; `search.js` ranks as [`search`] does.

use super::manual::{IndexEntry, POINTS, index};

/// Characters of the text that are shown around a word.
const SHOWN: usize = 160;

/// A part of a page that has all words of a query.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hit {
    /// The topic of `gusset guide` that shows it.
    pub topic: String,
    /// Heading or key.
    pub heading: String,
    /// The text around the first word.
    pub text: String,
    points: u32,
}

/// The parts of all pages in which every word occurs, best first.
#[must_use]
pub fn search(query: &str) -> Vec<Hit> {
    let query = query.to_lowercase();
    let words: Vec<&str> = query.split_whitespace().collect();
    if words.is_empty() {
        return Vec::new();
    }
    let mut hits: Vec<Hit> = index()
        .iter()
        .filter_map(|entry| hit(entry, &words))
        .collect();
    hits.sort_by_key(|hit| std::cmp::Reverse(hit.points));
    hits
}

fn hit([address, page, heading, text]: &IndexEntry, words: &[&str]) -> Option<Hit> {
    let [in_page, in_heading, in_text] = [page, heading, text].map(|part| part.to_lowercase());
    let points_of = |word: &str| {
        let is_there = [
            in_text.contains(word),
            in_page.contains(word),
            in_heading.contains(word),
            in_heading == word,
        ];
        let there = POINTS.iter().zip(is_there).filter(|(_, is)| *is);
        let sum: u32 = there.map(|((_, points), _)| points).sum();
        (sum > 0).then_some(sum)
    };
    let points: Vec<u32> = words
        .iter()
        .map(|word| points_of(word))
        .collect::<Option<_>>()?;
    Some(Hit {
        topic: topic(address, page, heading)?,
        heading: heading.clone(),
        text: around(text, &in_text, words),
        points: points.iter().sum(),
    })
}

/// The topic that shows an entry: its page, or the dotted path of a key. `None` for the contents page.
fn topic(address: &str, place: &str, heading: &str) -> Option<String> {
    let page = address.split(".html").next().unwrap_or_default();
    let plain = |name: &str| name.replace(['[', ']'], "");
    match page {
        "index" => None,
        "configuration" if place.starts_with('[') && !heading.starts_with('[') => {
            Some(format!("{}.{}", plain(place), plain(heading)))
        }
        "configuration" if heading.starts_with('[') => Some(plain(heading)),
        page => Some(page.to_owned()),
    }
}

/// The text around the first word that occurs in it.
fn around(text: &str, lower: &str, words: &[&str]) -> String {
    let first = words.iter().filter_map(|word| lower.find(word)).min();
    let before = first.map_or(0, |at| lower[..at].chars().count());
    let skipped = before.saturating_sub(SHOWN / 3);
    let rest: String = text.chars().skip(skipped).take(SHOWN).collect();
    let is_cut = text.chars().count() > skipped + SHOWN;
    let begin = if skipped > 0 { "… " } else { "" };
    let end = if is_cut { " …" } else { "" };
    // Half words at either end say nothing.
    let mut shown = rest.as_str();
    if skipped > 0 {
        shown = shown.split_once(' ').map_or(shown, |(_, rest)| rest);
    }
    if is_cut {
        shown = shown.rsplit_once(' ').map_or(shown, |(start, _)| start);
    }
    format!("{begin}{shown}{end}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_must_occur() {
        assert!(!search("emergency stop").is_empty());
        assert!(search("emergency xyzzy").is_empty());
        assert!(search("  ").is_empty());
    }

    #[test]
    fn a_heading_comes_first() {
        let hits = search("emergency stop");
        assert_eq!(hits[0].heading, "Emergency stop");
        assert_eq!(hits[0].topic, "real-specimen");
    }

    #[test]
    fn keys_are_found_by_their_path() {
        let hits = search("smooth_friction");
        assert!(
            hits.iter()
                .any(|hit| hit.topic == "specimen.law.smooth_friction")
        );
        for hit in hits.iter().filter(|hit| hit.topic.contains('.')) {
            assert!(!super::super::find(&hit.topic).is_empty(), "{}", hit.topic);
        }
    }
}
