//! The parts of a page: blocks of code, links and code in the text.

use std::collections::BTreeMap;

use pulldown_cmark::{
    BrokenLink, CodeBlockKind, CowStr, Event, LinkType, Options, Parser, Tag, TagEnd,
};

/// A block of code.
#[derive(Debug, Clone)]
pub struct Block {
    /// The first word behind the fence; empty for an indented block and for a fence without a word.
    pub language: String,
    pub is_indented: bool,
    /// `file="name"`: the block is written there.
    pub file: Option<String>,
    /// `no-run="reason"`: the block is not executed.
    pub no_run: Option<String>,
    /// Words behind the fence that mean nothing.
    pub unknown: Vec<String>,
    pub text: String,
    /// Line of the page on which it begins, from 1.
    pub line: usize,
}

/// A link to another place.
#[derive(Debug)]
pub struct Link {
    pub target: String,
    /// The label, where the link has one.
    pub label: Option<String>,
    pub is_image: bool,
}

/// The parts that the tests judge.
#[derive(Debug, Default)]
pub struct Markdown {
    pub blocks: Vec<Block>,
    pub links: Vec<Link>,
    /// Labels without a definition.
    pub unresolved: Vec<String>,
    /// Code within the text.
    pub spans: Vec<String>,
}

pub fn read<'a>(text: &'a str) -> Markdown {
    let mut found = Markdown::default();
    let mut unresolved = Vec::new();
    let callback = |broken: BrokenLink<'a>| -> Option<(CowStr<'a>, CowStr<'a>)> {
        if broken.link_type != LinkType::Shortcut {
            unresolved.push(broken.reference.to_string());
        }
        None
    };
    let parser =
        Parser::new_with_broken_link_callback(text, Options::ENABLE_TABLES, Some(callback));
    let mut open: Option<Block> = None;
    for (event, range) in parser.into_offset_iter() {
        match event {
            Event::Start(Tag::CodeBlock(kind)) => {
                let line = text[..range.start].matches('\n').count() + 1;
                open = Some(block(&kind, line));
            }
            Event::End(TagEnd::CodeBlock) => found.blocks.extend(open.take()),
            Event::Text(piece) => {
                if let Some(block) = &mut open {
                    block.text.push_str(&piece);
                }
            }
            Event::Code(code) => found.spans.push(code.to_string()),
            Event::Start(
                ref tag @ (Tag::Link {
                    ref link_type,
                    ref dest_url,
                    ref id,
                    ..
                }
                | Tag::Image {
                    ref link_type,
                    ref dest_url,
                    ref id,
                    ..
                }),
            ) => {
                let has_label = matches!(
                    link_type,
                    LinkType::Reference | LinkType::Collapsed | LinkType::Shortcut
                );
                found.links.push(Link {
                    target: dest_url.to_string(),
                    label: has_label.then(|| id.to_string()),
                    is_image: matches!(tag, Tag::Image { .. }),
                });
            }
            _ => {}
        }
    }
    found.unresolved = unresolved;
    found
}

fn block(kind: &CodeBlockKind<'_>, line: usize) -> Block {
    let (is_indented, info) = match kind {
        CodeBlockKind::Indented => (true, ""),
        CodeBlockKind::Fenced(info) => (false, info.as_ref()),
    };
    let (language, rest) = info.split_once(' ').unwrap_or((info, ""));
    let (mut known, unknown) = attributes(rest);
    Block {
        language: language.to_owned(),
        is_indented,
        file: known.remove("file"),
        no_run: known.remove("no-run"),
        unknown: unknown.into_iter().chain(known.into_keys()).collect(),
        text: String::new(),
        line,
    }
}

/// `key="value"` pairs, and the rest.
fn attributes(text: &str) -> (BTreeMap<String, String>, Vec<String>) {
    let mut pairs = BTreeMap::new();
    let mut rest = text.trim();
    while let Some((key, after)) = rest.split_once("=\"") {
        let Some((value, more)) = after.split_once('"') else {
            break;
        };
        pairs.insert(key.trim().to_owned(), value.to_owned());
        rest = more.trim();
    }
    let unknown = rest.split_whitespace().map(str::to_owned).collect();
    (pairs, unknown)
}
