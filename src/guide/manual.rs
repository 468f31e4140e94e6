//! The guide as web pages: navigation, pictures, and a search that needs no network.

use pulldown_cmark::{CowStr, Event, Tag, TagEnd, html};
use serde_json::json;

use super::markdown::{anchor, linked_page, parse};
use super::{CONTENTS, Group, PAGES, PICTURES};

/// The file that lists the files of a manual.
pub const MANUAL_LIST: &str = "gusset-guide.txt";

/// Points of a word by the place where it occurs. The web pages read them, too.
pub(super) const POINTS: [(&str, u32); 4] =
    [("text", 1), ("page", 2), ("heading", 5), ("whole", 10)];

const STYLE: &str = include_str!("manual.css");
const SCRIPT: &str = include_str!("search.js");

/// A file of the manual.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ManualFile {
    /// Its name in the folder of the manual.
    pub name: String,
    /// Its text.
    pub text: String,
}

/// Every file of the manual. The last one lists the names of all.
#[must_use]
pub fn manual() -> Vec<ManualFile> {
    let mut files = Vec::new();
    let mut index = Vec::new();
    for (id, text) in texts() {
        let rendered = Rendered::new(id, text);
        index.extend(rendered.index);
        files.push(ManualFile {
            name: file_of(id),
            text: framed(id, &rendered.title, &rendered.body),
        });
    }
    let points: serde_json::Map<_, _> = POINTS
        .iter()
        .map(|(place, points)| ((*place).to_owned(), json!(points)))
        .collect();
    let index = format!(
        "const GUIDE = {};\nconst POINTS = {};\n",
        json!(index),
        json!(points)
    );
    let named = [
        ("search-index.js", index.as_str()),
        ("search.js", SCRIPT),
        ("manual.css", STYLE),
    ];
    let pictures = PICTURES.iter().map(|(name, text)| (base_name(name), *text));
    files.extend(
        named
            .into_iter()
            .chain(pictures)
            .map(|(name, text)| ManualFile {
                name: name.to_owned(),
                text: text.to_owned(),
            }),
    );
    let mut list = String::from("Files of the Gusset guide\n");
    for file in &files {
        list.push_str(&file.name);
        list.push('\n');
    }
    list.push_str(MANUAL_LIST);
    list.push('\n');
    files.push(ManualFile {
        name: MANUAL_LIST.to_owned(),
        text: list,
    });
    files
}

/// Address, page or table, heading and text of a heading or key.
pub(super) type IndexEntry = [String; 4];

/// The entries of all pages for the search.
pub(super) fn index() -> Vec<IndexEntry> {
    texts()
        .flat_map(|(id, text)| Rendered::new(id, text).index)
        .collect()
}

/// The contents page and all pages with their names.
fn texts() -> impl Iterator<Item = (&'static str, &'static str)> {
    let contents = std::iter::once(("README", CONTENTS));
    contents.chain(PAGES.iter().map(|page| (page.id, page.text)))
}

fn file_of(id: &str) -> String {
    match id {
        "README" => "index.html".to_owned(),
        id => format!("{id}.html"),
    }
}

fn base_name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

/// A page as HTML, and what the search knows of it.
struct Rendered {
    title: String,
    body: String,
    index: Vec<IndexEntry>,
}

/// Collects the events of a page, and one index entry per heading and per key.
struct Collector<'a> {
    file: String,
    events: Vec<Event<'a>>,
    index: Vec<IndexEntry>,
    title: String,
    /// The part that is open.
    part: Part,
    /// Anchors so far: the second one of a name gets a number.
    anchors: Vec<String>,
    /// The last heading and its anchor, for the keys below it.
    section: (String, String),
}

/// A heading or a key, as the search shows it.
#[derive(Debug, Default)]
struct Part {
    heading: String,
    anchor: String,
    /// The title of the page, or the table of a key.
    place: String,
    text: String,
}

impl Rendered {
    fn new(id: &str, text: &str) -> Self {
        let events: Vec<Event<'_>> = parse(text).collect();
        let mut collector = Collector {
            file: file_of(id),
            events: Vec::with_capacity(events.len()),
            index: Vec::new(),
            title: String::new(),
            part: Default::default(),
            anchors: Vec::new(),
            section: Default::default(),
        };
        let mut rest = events.as_slice();
        while let [event, more @ ..] = rest {
            match event {
                Event::Start(Tag::Heading { level, .. }) => {
                    let text = text_until(more, |end| matches!(end, TagEnd::Heading(_)));
                    let id = collector.heading(&text);
                    collector.events.push(Event::Start(Tag::Heading {
                        level: *level,
                        id: Some(id.into()),
                        classes: Vec::new(),
                        attrs: Vec::new(),
                    }));
                }
                Event::Start(Tag::Item) => match key_of(more) {
                    Some(key) => {
                        let id = collector.key(&key);
                        let item = format!("<li class=\"key\" id=\"{id}\">");
                        collector.events.push(Event::Html(item.into()));
                    }
                    None => collector.events.push(event.clone()),
                },
                event => collector.other(event.clone()),
            }
            rest = more;
        }
        collector.close();
        let mut body = String::new();
        html::push_html(&mut body, collector.events.into_iter());
        Self {
            title: collector.title,
            body,
            index: collector.index,
        }
    }
}

/// The text of events up to an end.
fn text_until(events: &[Event<'_>], is_end: impl Fn(&TagEnd) -> bool) -> String {
    let mut text = String::new();
    for event in events {
        match event {
            Event::End(end) if is_end(end) => break,
            Event::Text(piece) | Event::Code(piece) => text.push_str(piece),
            _ => {}
        }
    }
    text
}

/// The key that an item of the configuration reference is about: code in bold at its beginning.
fn key_of(events: &[Event<'_>]) -> Option<String> {
    let events = match events {
        [Event::Start(Tag::Paragraph), rest @ ..] => rest,
        all => all,
    };
    match events {
        [Event::Start(Tag::Strong), Event::Code(key), ..] => Some(key.to_string()),
        _ => None,
    }
}

impl<'a> Collector<'a> {
    fn heading(&mut self, text: &str) -> String {
        let id = self.unique(anchor(text));
        if self.title.is_empty() {
            self.title = text.to_owned();
        }
        self.section = (text.to_owned(), id.clone());
        self.begin(text, &id, self.title.clone());
        id
    }

    fn key(&mut self, key: &str) -> String {
        let (heading, section) = self.section.clone();
        let id = self.unique(format!("{section}-{}", anchor(key)));
        self.begin(key, &id, heading);
        id
    }

    fn unique(&mut self, wanted: String) -> String {
        let mut id = wanted.clone();
        let mut number = 1;
        while self.anchors.contains(&id) {
            id = format!("{wanted}-{number}");
            number += 1;
        }
        self.anchors.push(id.clone());
        id
    }

    fn begin(&mut self, heading: &str, anchor: &str, place: String) {
        self.close();
        self.part = Part {
            heading: heading.to_owned(),
            anchor: anchor.to_owned(),
            place,
            text: String::new(),
        };
    }

    /// Puts the part that was open into the index.
    fn close(&mut self) {
        let Part {
            heading,
            anchor,
            place,
            text,
        } = std::mem::take(&mut self.part);
        if !heading.is_empty() {
            let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
            let text = text.strip_prefix(heading.as_str()).unwrap_or(&text).trim();
            let address = format!("{}#{anchor}", self.file);
            let text = text.to_owned();
            self.index.push([address, place, heading, text]);
        }
    }

    /// Any other event: links lead to web pages, pictures are in the folder.
    fn other(&mut self, event: Event<'a>) {
        match &event {
            Event::Text(text) | Event::Code(text) => {
                self.part.text.push_str(text);
            }
            Event::SoftBreak | Event::HardBreak | Event::End(_) => self.part.text.push(' '),
            _ => {}
        }
        self.events.push(match event {
            Event::Start(Tag::Link {
                link_type,
                dest_url,
                title,
                id,
            }) => {
                let dest_url = linked_page(&dest_url)
                    .map(file_of)
                    .map_or(dest_url, CowStr::from);
                Event::Start(Tag::Link {
                    link_type,
                    dest_url,
                    title,
                    id,
                })
            }
            Event::Start(Tag::Image {
                link_type,
                dest_url,
                title,
                id,
            }) => Event::Start(Tag::Image {
                link_type,
                dest_url: base_name(&dest_url).to_owned().into(),
                title,
                id,
            }),
            other => other,
        });
    }
}

/// The page with its head, navigation and search box.
fn framed(id: &str, title: &str, body: &str) -> String {
    let mut navigation = link("README", "Contents", id);
    for group in Group::ALL {
        navigation.push_str(&format!("<h2>{}</h2>\n", escaped(group.title())));
        for page in PAGES.iter().filter(|page| page.group == group) {
            navigation.push_str(&link(page.id, page.title(), id));
        }
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title} – Gusset</title>\n\
         <link rel=\"stylesheet\" href=\"manual.css\">\n</head>\n<body>\n\
         <nav aria-label=\"Pages\">\n<p class=\"brand\">Gusset {version}</p>\n\
         <input id=\"search\" type=\"search\" placeholder=\"Search\" aria-label=\"Search the guide\" autocomplete=\"off\" hidden>\n\
         {navigation}</nav>\n<main>\n<section id=\"found\" aria-live=\"polite\" hidden></section>\n\
         <article>\n{body}</article>\n</main>\n\
         <script src=\"search-index.js\"></script>\n<script src=\"search.js\"></script>\n</body>\n</html>\n",
        title = escaped(title),
        version = env!("CARGO_PKG_VERSION"),
    )
}

fn link(id: &str, title: &str, current: &str) -> String {
    let mark = if id == current {
        " aria-current=\"page\""
    } else {
        ""
    };
    format!("<a href=\"{}\"{mark}>{}</a>\n", file_of(id), escaped(title))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_and_headings_have_anchors() {
        let page = "# Limits\n\nSee [units][concepts] and ![a](pictures/a.svg).\n\n## Every limit\n\ntext\n\n[concepts]: concepts.md\n";
        let rendered = Rendered::new("limits", page);
        assert!(
            rendered.body.contains("<h2 id=\"every-limit\">"),
            "{}",
            rendered.body
        );
        assert!(
            rendered.body.contains("href=\"concepts.html\""),
            "{}",
            rendered.body
        );
        assert!(rendered.body.contains("src=\"a.svg\""), "{}", rendered.body);
        assert_eq!(
            rendered.index[1],
            ["limits.html#every-limit", "Limits", "Every limit", "text"].map(str::to_owned)
        );
    }

    #[test]
    fn every_key_is_found_under_its_own_anchor() {
        let page =
            "# Reference\n\n## `[time]`\n\n- **`step_s`** · s\n\n  Step.\n\n- **`clock`** · word\n";
        let rendered = Rendered::new("configuration", page);
        assert!(
            rendered
                .body
                .contains("<li class=\"key\" id=\"time-step_s\">")
        );
        let addresses: Vec<_> = rendered.index.iter().map(|entry| &entry[0]).collect();
        assert_eq!(addresses[2], "configuration.html#time-step_s");
        assert_eq!(rendered.index[2][1], "[time]");
        assert_eq!(rendered.index[2][3], "· s Step.");
    }

    #[test]
    fn no_page_asks_for_anything_from_a_network() {
        for file in manual() {
            let used = [
                "src=\"http",
                "rel=\"stylesheet\" href=\"http",
                "@import",
                "url(http",
            ];
            let found: Vec<_> = used
                .iter()
                .filter(|text| file.text.contains(**text))
                .collect();
            assert!(found.is_empty(), "{} uses {found:?}", file.name);
        }
    }

    #[test]
    fn every_link_leads_to_a_page() {
        let files = manual();
        for file in &files {
            let links = file.text.split("href=\"").skip(1);
            for target in links.filter_map(|rest| rest.split('"').next()) {
                let name = target.split('#').next().unwrap_or_default();
                let is_there = name.is_empty() || files.iter().any(|file| file.name == name);
                assert!(
                    is_there || target.contains("://"),
                    "{}: {target}",
                    file.name
                );
            }
        }
    }
}
