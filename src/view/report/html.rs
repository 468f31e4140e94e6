//! The pieces of all pages, and a page round them. Text is escaped by the type of the markup.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use sha2::{Digest as _, Sha256};

use super::text::printable;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("script.js");
/// How to use the charts; the script fills it in.
pub(super) const HINT: &str = "Drag across a chart to zoom; histories are zoomed together. Two clicks set two cursors, and their difference is shown. \
    Keys: arrows, + and −, 0 for the whole test, Escape.";

/// A section with its heading; nothing where it is empty.
#[must_use]
pub fn section(heading: &str, inside: Markup) -> Markup {
    html! { section { h2 { (heading) } (inside) } }
}

/// A paragraph.
pub(super) fn paragraph(text: &str) -> Markup {
    html! { p { (text) } }
}

/// A small paragraph: how to read the element above it.
#[must_use]
pub fn note(text: &str) -> Markup {
    html! { p.note { (text) } }
}

/// Key figures: each a value and the words below it; empty without figures.
#[must_use]
pub fn tiles(figures: &[(String, String)]) -> Markup {
    html! {
        @if !figures.is_empty() {
            div.tiles { @for (value, words) in figures { div { b { (value) } span { (words) } } } }
        }
    }
}

/// The box at the top of a page: the verdict in plain words, and sentences below it. `class` is `good`, `warning` or `bad`.
#[must_use]
pub fn banner(class: &str, headline: &str, sentences: &[String]) -> Markup {
    banner_with(
        class,
        headline,
        html! { @for text in sentences { p { (text) } } },
    )
}

pub(super) fn banner_with(class: &str, headline: &str, inside: Markup) -> Markup {
    html! { div class={ "verdict " (class) } { p.headline { (headline) } (inside) } }
}

/// A table: a heading of texts, rows of texts. The first column holds names, the others numbers.
#[must_use]
pub fn table(heading: &[&str], rows: &[Vec<String>]) -> Markup {
    table_of("", heading, rows)
}

/// A table in a box of a class.
#[must_use]
pub fn table_of(class: &str, heading: &[&str], rows: &[Vec<String>]) -> Markup {
    html! {
        div class={ "wide " (class) } {
            table {
                thead { tr { @for cell in heading { th { (cell) } } } }
                tbody { @for row in rows { tr { @for cell in row { td { (cell) } } } } }
            }
        }
    }
}

/// A table without the columns in which every cell below the heading is `nothing`.
pub(super) fn table_without(
    nothing: &str,
    class: &str,
    heading: &[&str],
    rows: &[Vec<String>],
) -> Markup {
    let says =
        |row: &Vec<String>, column: usize| row.get(column).is_some_and(|cell| cell != nothing);
    let is_kept = |column: &usize| *column == 0 || rows.iter().any(|row| says(row, *column));
    let kept: Vec<usize> = (0..heading.len()).filter(is_kept).collect();
    let heading: Vec<&str> = kept.iter().map(|&column| heading[column]).collect();
    let cells = |row: &Vec<String>| {
        kept.iter()
            .filter_map(|&column| row.get(column).cloned())
            .collect()
    };
    let rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
    table_of(class, &heading, &rows)
}

/// Markup that a reader opens; nothing where it is empty. It stays folded on paper.
#[must_use]
pub fn details(summary: &str, inside: Markup) -> Markup {
    html! { @if !inside.0.is_empty() { details { summary { (summary) } (inside) } } }
}

/// Names and their meanings.
#[must_use]
pub fn definitions(pairs: &[(String, String)]) -> Markup {
    html! { dl { @for (name, text) in pairs { dt { (name) } dd { (text) } } } }
}

/// Who tested what, when, where and by which program.
#[must_use]
pub fn filed(pairs: &[(&'static str, String)]) -> Markup {
    html! {
        @if !pairs.is_empty() {
            dl.filed { @for (name, text) in pairs { div { dt { (name.replace('_', " ")) } dd { (text) } } } }
        }
    }
}

/// Parts side by side where the page is wide enough; `class` sets the shares of the columns. Nothing where it is empty.
#[must_use]
pub fn beside(class: &str, inside: Markup) -> Markup {
    html! { @if !inside.0.is_empty() { div class=(class) { (inside) } } }
}

/// The head of a page: what it is, its title, and what a reader sees first.
#[must_use]
pub fn header(brand: &str, title: &str, inside: Markup) -> Markup {
    html! { header { p.brand { "gusset " (brand) } h1 { (title) } (inside) } }
}

/// A whole page round `body`: self-contained, nothing is fetched, and only our own script is executed: the page itself
/// forbids everything else, by the script's digest.
#[must_use]
pub fn frame(title: &str, body: &Markup) -> String {
    let script = base64(&Sha256::digest(SCRIPT.as_bytes()));
    let policy =
        format!("default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{script}'");
    let has_charts = body.0.contains("class=\"lines\"");
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (body)
                @if has_charts { script { (PreEscaped(SCRIPT)) } }
            }
        }
    };
    printable(&page.0).into_owned()
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let at = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let word = at(0) << 16 | at(1) << 8 | at(2);
        for i in 0..4 {
            let digit = ALPHABET[((word >> (18 - 6 * i)) & 63) as usize];
            out.push(if i <= chunk.len() {
                char::from(digit)
            } else {
                '='
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    #[test]
    fn base64_is_that_of_the_standard() {
        // RFC 4648, section 10.
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(super::base64(plain.as_bytes()), coded);
        }
    }
}
