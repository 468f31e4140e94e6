//! A page as plain text for a terminal.

use pulldown_cmark::{Event, HeadingLevel, Tag, TagEnd};

use super::inline::{Inline, width_of, wrapped};
use super::markdown::{linked_page, parse};
use super::table::Table;

/// Blanks before a line of code.
const CODE_INDENT: usize = 4;
/// The narrowest text, also on a narrower terminal.
const NARROWEST: usize = 30;

/// The page as plain text with lines of at most `width` characters. Code and long words may be wider.
///
/// A link to another page shows the page's topic in brackets.
#[must_use]
pub fn plain_text(markdown: &str, width: usize) -> String {
    let mut writer = Writer {
        width: width.max(NARROWEST),
        ..Writer::default()
    };
    for event in parse(markdown) {
        writer.take(event);
    }
    let mut text = writer.lines.join("\n");
    if writer.has_topics {
        text.push_str("\n\nA word in [brackets] is a topic: gusset guide TOPIC");
    }
    text
}

/// A list that is open: the number of its next item, or a bullet.
#[derive(Debug)]
struct List {
    next: Option<u64>,
    /// Width of the marks of its items.
    indent: usize,
    has_items: bool,
}

#[derive(Debug, Default)]
struct Writer {
    width: usize,
    lines: Vec<String>,
    inline: Inline,
    lists: Vec<List>,
    /// The mark of an item whose first line is not yet written.
    mark: Option<String>,
    /// True if the last item has paragraphs: a blank line follows it.
    is_loose: bool,
    quotes: usize,
    in_code: bool,
    /// Where the links that are open lead.
    links: Vec<String>,
    table: Option<Table>,
    has_topics: bool,
}

impl Writer {
    fn take(&mut self, event: Event<'_>) {
        match event {
            Event::Start(tag) => self.start(tag),
            Event::End(tag) => self.end(tag),
            Event::Text(text) if self.in_code => self.code(&text),
            Event::Text(text) => self.inline.push(&text),
            Event::Code(text) => {
                self.inline.push("`");
                self.inline.push(&text);
                self.inline.push("`");
            }
            Event::SoftBreak => self.inline.push(" "),
            Event::HardBreak => self.inline.push("\n"),
            Event::Rule => {
                self.gap();
                self.line(&"-".repeat(self.width.min(40)));
            }
            _ => {}
        }
    }

    fn start(&mut self, tag: Tag<'_>) {
        match tag {
            Tag::Heading { .. } | Tag::Paragraph => {}
            Tag::CodeBlock(_) => {
                self.flush();
                self.gap();
                self.in_code = true;
            }
            Tag::BlockQuote(_) => {
                self.flush();
                self.quotes += 1;
            }
            Tag::List(next) => {
                self.flush();
                let indent = if next.is_some() { 3 } else { 2 };
                self.lists.push(List {
                    next,
                    indent,
                    has_items: false,
                });
            }
            Tag::Item => self.item(),
            Tag::Table(_) => self.table = Some(Table::default()),
            Tag::TableHead | Tag::TableRow => {
                if let Some(table) = &mut self.table {
                    table.row();
                }
            }
            Tag::Link { dest_url, .. } => self.links.push(dest_url.into_string()),
            Tag::Image { dest_url, .. } => {
                self.links.push(dest_url.into_string());
                self.inline.push("[Picture: ");
            }
            _ => {}
        }
    }

    fn end(&mut self, tag: TagEnd) {
        match tag {
            TagEnd::Heading(level) => self.heading(level),
            TagEnd::Paragraph => {
                if self.mark.is_none() {
                    self.gap();
                }
                self.flush();
                self.is_loose = !self.lists.is_empty();
            }
            TagEnd::CodeBlock => self.in_code = false,
            TagEnd::BlockQuote(_) => {
                self.flush();
                self.quotes = self.quotes.saturating_sub(1);
            }
            TagEnd::List(_) => {
                self.flush();
                self.lists.pop();
                self.is_loose = false;
            }
            TagEnd::Item => {
                self.flush();
                self.mark = None;
            }
            TagEnd::TableCell => {
                let text = self.inline.take();
                if let Some(table) = &mut self.table {
                    table.cell(text);
                }
            }
            TagEnd::Table => {
                self.gap();
                let table = self.table.take().unwrap_or_default();
                for line in table.lines(self.width.saturating_sub(self.indent())) {
                    self.line(&line);
                }
            }
            TagEnd::Link => self.end_of_link(),
            TagEnd::Image => {
                self.links.pop();
                self.inline.push("]");
            }
            _ => {}
        }
    }

    fn end_of_link(&mut self) {
        let Some(target) = self.links.pop() else {
            return;
        };
        if let Some(id) = linked_page(&target) {
            if id != "README" {
                self.inline.push(&format!(" [{id}]"));
                self.has_topics = true;
            }
        } else if !target.starts_with('#') {
            self.inline.push(&format!(" <{target}>"));
        }
    }

    fn heading(&mut self, level: HeadingLevel) {
        let text = self.inline.take();
        if !self.lines.is_empty() {
            self.lines.push(String::new());
        }
        let rule = match level {
            HeadingLevel::H1 => Some("="),
            HeadingLevel::H2 => Some("-"),
            _ => None,
        };
        self.lines.push(text.clone());
        if let Some(rule) = rule {
            self.lines.push(rule.repeat(width_of(&text)));
        }
    }

    /// Begins an item. A blank line separates items only where an item has several paragraphs.
    fn item(&mut self) {
        self.flush();
        let is_first = self.lists.last().is_some_and(|list| !list.has_items);
        if self.is_loose || (is_first && self.lists.len() == 1) {
            self.gap();
        }
        self.is_loose = false;
        if let Some(list) = self.lists.last_mut() {
            list.has_items = true;
        }
        let mark = match self.lists.last_mut() {
            Some(List {
                next: Some(number), ..
            }) => {
                let mark = format!("{number}.");
                *number += 1;
                mark
            }
            _ => "-".to_owned(),
        };
        self.mark = Some(mark);
    }

    /// Blanks before the text of the innermost list.
    fn indent(&self) -> usize {
        self.lists.iter().map(|list| list.indent).sum::<usize>() + 2 * self.quotes
    }

    /// Writes the paragraph that was collected.
    fn flush(&mut self) {
        if self.inline.is_empty() {
            self.inline.take();
            return;
        }
        let text = self.inline.take();
        let width = self.width.saturating_sub(self.indent()).max(NARROWEST / 2);
        for line in wrapped(&text, width) {
            self.line(&line);
        }
    }

    fn code(&mut self, text: &str) {
        for line in text.lines() {
            let line = format!("{}{line}", " ".repeat(CODE_INDENT));
            self.line(line.trim_end());
        }
    }

    /// A line at the indent of the lists around it, after the mark of an item that begins.
    fn line(&mut self, text: &str) {
        let indent = self.indent();
        let line = match (self.mark.take(), self.lists.last()) {
            (Some(mark), Some(list)) => {
                let before = " ".repeat(indent.saturating_sub(list.indent));
                format!("{before}{mark:<0$}{text}", list.indent)
            }
            _ => format!("{}{text}", " ".repeat(indent)),
        };
        self.lines.push(line.trim_end().to_owned());
    }

    /// A blank line, unless there is one or nothing is written yet.
    fn gap(&mut self) {
        if self.mark.is_none() && self.lines.last().is_some_and(|line| !line.is_empty()) {
            self.lines.push(String::new());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_and_paragraphs_are_laid_out() {
        let text = plain_text("# Limits\n\nOne two three four five six seven eight.\n", 30);
        assert_eq!(
            text,
            "Limits\n======\n\nOne two three four five six\nseven eight."
        );
    }

    #[test]
    fn link_shows_its_topic() {
        let text = plain_text("See [the limits][limits].\n\n[limits]: limits.md\n", 80);
        assert!(text.starts_with("See the limits [limits].\n"), "{text}");
        assert!(!text.contains("limits.md"), "{text}");
        assert!(text.ends_with("gusset guide TOPIC"), "{text}");
    }

    #[test]
    fn lists_and_code_keep_their_form() {
        let text = plain_text(
            "Do this:\n\n1. Check.\n\n2. Run:\n\n   ```sh\n   gusset run a.toml\n   ```\n\n- one\n- two\n",
            60,
        );
        assert_eq!(
            text,
            "Do this:\n\n1. Check.\n\n2. Run:\n\n       gusset run a.toml\n\n- one\n- two"
        );
    }

    #[test]
    fn blank_lines_separate_long_items() {
        let tight = plain_text("- a long item that needs two lines of text\n- two\n", 30);
        assert_eq!(
            tight,
            "- a long item that needs two\n  lines of text\n- two"
        );
        let loose = plain_text("- one\n\n  more\n\n- two\n", 30);
        assert_eq!(loose, "- one\n\n  more\n\n- two");
    }

    #[test]
    fn no_line_of_prose_is_wider_than_asked() {
        let text = plain_text(
            "- **`key`** · m\n\n  A long paragraph with more words than one line can hold.\n",
            40,
        );
        assert!(text.lines().all(|line| width_of(line) <= 40), "{text}");
        assert!(text.starts_with("- `key` · m\n\n  A long"), "{text}");
    }
}
