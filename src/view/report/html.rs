//! The few pieces of HTML that the page is made of.
//!
//! Invariant: every argument called text is escaped here and nowhere else; every argument called markup is taken as it
//! is and must have been made by this module or by a picture.

use super::canvas::{Skin, picture};
use super::charts::Area;
use super::text::escape;

pub(super) use super::canvas::Canvas;

/// A section with its heading.
pub fn section(heading: &str, markup: &str) -> String {
    format!(
        "<section>\n<h2>{}</h2>\n{markup}</section>\n",
        escape(heading)
    )
}

/// A paragraph of text.
pub(super) fn paragraph(text: &str) -> String {
    format!("<p>{}</p>\n", escape(text))
}

/// A small paragraph of text: how to read the element above it.
pub fn note(text: &str) -> String {
    format!("<p class=\"note\">{}</p>\n", escape(text))
}

/// Key figures: each a value and the words below it; empty without figures.
pub fn tiles(figures: &[(String, String)]) -> String {
    if figures.is_empty() {
        return String::new();
    }
    let tile = |(value, words): &(String, String)| {
        format!(
            "<div><b>{}</b><span>{}</span></div>\n",
            escape(value),
            escape(words)
        )
    };
    let tiles: String = figures.iter().map(tile).collect();
    format!("<div class=\"tiles\">\n{tiles}</div>\n")
}

/// The box at the top of a page: the verdict in plain words, and sentences below it. `class` is `good`, `warning` or `bad`.
pub fn banner(class: &str, headline: &str, sentences: &[String]) -> String {
    let sentences: String = sentences.iter().map(|text| paragraph(text)).collect();
    format!(
        "<div class=\"verdict {class}\">\n<p class=\"headline\">{}</p>\n{sentences}</div>\n",
        escape(headline)
    )
}

/// A table: a heading of texts, rows of texts. The first column holds names, the others numbers.
pub fn table(heading: &[&str], rows: &[Vec<String>]) -> String {
    let mut out = String::from("<div class=\"wide\"><table>\n<thead><tr>");
    for cell in heading {
        out += &format!("<th>{}</th>", escape(cell));
    }
    out += "</tr></thead>\n<tbody>\n";
    for row in rows {
        out += "<tr>";
        for cell in row {
            out += &format!("<td>{}</td>", escape(cell));
        }
        out += "</tr>\n";
    }
    out + "</tbody></table></div>\n"
}

/// A table without the columns in which every cell below the heading is `nothing`.
pub(super) fn table_without(nothing: &str, heading: &[&str], rows: &[Vec<String>]) -> String {
    let says = |column: &usize| {
        *column == 0
            || rows
                .iter()
                .any(|row| row.get(*column).is_some_and(|cell| cell != nothing))
    };
    let kept: Vec<usize> = (0..heading.len()).filter(says).collect();
    let heading: Vec<&str> = kept.iter().map(|&column| heading[column]).collect();
    let cells = |row: &Vec<String>| {
        let cells = kept.iter().filter_map(|&column| row.get(column).cloned());
        cells.collect()
    };
    let rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
    table(&heading, &rows)
}

/// Markup that a reader opens; nothing where it is empty. It stays folded on paper.
pub fn details(summary: &str, markup: &str) -> String {
    if markup.is_empty() {
        return String::new();
    }
    format!(
        "<details>\n<summary>{}</summary>\n{markup}</details>\n",
        escape(summary)
    )
}

/// Names and their meanings, as texts.
pub fn definitions(pairs: &[(String, String)]) -> String {
    let rows = pairs
        .iter()
        .map(|(name, text)| format!("<dt>{}</dt><dd>{}</dd>\n", escape(name), escape(text)));
    format!("<dl>\n{}</dl>\n", rows.collect::<String>())
}

/// A picture of the page; `label` is the text for screen readers.
pub(super) fn figure(
    width: f64,
    height: f64,
    label: &str,
    draw: impl FnOnce(&mut Canvas<'_>, Area),
) -> String {
    let svg = picture(width, height, Skin::Page, label, |canvas| {
        draw(canvas, Area::whole(width, height))
    });
    format!("<figure>{svg}</figure>\n")
}

/// Figures side by side where the page is wide enough; `class` sets the shares of the columns.
pub(super) fn beside(class: &str, markup: &str) -> String {
    format!("<div class=\"{class}\">\n{markup}</div>\n")
}
