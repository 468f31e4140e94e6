//! The page that shows everything side by side with the claims, and the files beside it.

use super::{Check, Figure, Part, Tabulation, Verdict};
use crate::view::report::{escape, frame, note};

/// index.html, and an SVG and a CSV for every figure: names and contents.
#[must_use]
pub fn files(parts: &[Part]) -> Vec<(String, String)> {
    let mut files = vec![("index.html".to_owned(), index(parts))];
    for figure in parts.iter().flat_map(|part| &part.figures) {
        files.push((format!("{}.svg", figure.file), figure.svg(false)));
        files.push((format!("{}.csv", figure.file), figure.csv()));
    }
    files
}

const TITLE: &str = "The Gui-λ family, verified";

fn index(parts: &[Part]) -> String {
    let count = |verdict| parts.iter().map(|part| part.count(verdict)).sum::<usize>();
    let (pass, fail, notes) = (
        count(Verdict::Pass),
        count(Verdict::Fail),
        count(Verdict::Note),
    );
    let (class, headline) = if fail == 0 {
        ("good", format!("All {pass} checks hold"))
    } else {
        ("bad", format!("{fail} of {} checks FAIL", pass + fail))
    };
    let mut body = format!(
        "<header>\n<p class=\"brand\">gusset {} · verification</p>\n<h1>{TITLE}</h1>\n\
         <div class=\"verdict {class}\">\n<p class=\"headline\">{}</p>\n<p>{notes} further statements are not judged: \
         measurements of this machine, and places where the paper is loose.</p>\n</div>\n",
        env!("CARGO_PKG_VERSION"),
        escape(&headline)
    );
    body += &note(
        "Y. Gui, J.-T. Wang, F. Jin, C. Chen, M.-X. Zhou: Development of a family of explicit algorithms for structural \
         dynamics with unconditional stability. Nonlinear Dynamics, 2014. Numbers in parentheses are its equations. Every \
         value below was obtained by this program's own integrators and models in one run of `gusset verify`; figures have \
         the paper's axes, their data lie beside this page as CSV. What the paper states stands, in our words, beside what was obtained, \
         how far the two may be apart, and the verdict.",
    );
    body += &contents(parts);
    body += "</header>\n<main>\n";
    for part in parts {
        body += &whole(part);
    }
    body += "</main>\n";
    frame(TITLE, &body)
}

/// What the page holds, with the verdict on each part.
fn contents(parts: &[Part]) -> String {
    let mut out = String::from("<nav><ul class=\"contents\">\n");
    for part in parts {
        let (pass, fail, notes) = (
            part.count(Verdict::Pass),
            part.count(Verdict::Fail),
            part.count(Verdict::Note),
        );
        let (class, mut words) = if fail == 0 {
            ("good", format!("{pass} hold"))
        } else {
            ("bad", format!("{fail} FAIL, {pass} hold"))
        };
        if notes > 0 {
            words += &format!(", {notes} noted");
        }
        out += &format!(
            "<li><a href=\"#{}\">{}</a><span class=\"{class}\">{words}</span></li>\n",
            part.name,
            escape(part.title)
        );
    }
    out + "</ul></nav>\n"
}

/// One part: what the paper says beside its figure, further figures, tables, checks.
fn whole(part: &Part) -> String {
    let mut out = format!(
        "<section id=\"{}\">\n<h2>{}</h2>\n",
        part.name,
        escape(part.title)
    );
    let says = format!("<blockquote>{}</blockquote>\n", escape(part.says));
    match part.figures.as_slice() {
        [] => out += &says,
        [one] => {
            let class = if one.square {
                "beside square"
            } else {
                "beside"
            };
            let picture = picture(one);
            out += &format!("<div class=\"{class}\">\n{picture}<div>{says}</div></div>\n");
        }
        several => {
            out += &says;
            let figures: String = several.iter().map(picture).collect();
            out += &format!("<div class=\"grid\">\n{figures}</div>\n");
        }
    }
    out.extend(part.tables.iter().map(table));
    out += &checks(&part.checks);
    out + "</section>\n"
}

fn picture(figure: &Figure) -> String {
    format!(
        "<figure id=\"{0}\">{1}<figcaption>{2} <a href=\"{0}.csv\">Data</a>, <a href=\"{0}.svg\">picture</a>.</figcaption>\
         </figure>\n",
        figure.file,
        figure.svg(true),
        escape(figure.claim),
    )
}

fn table(table: &Tabulation) -> String {
    let row = |cells: &[String], tag: &str| -> String {
        let cells = cells
            .iter()
            .map(|cell| format!("<{tag}>{}</{tag}>", escape(cell)));
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let rows: String = table.rows.iter().map(|cells| row(cells, "td")).collect();
    format!(
        "<h3>{}</h3>\n<div class=\"wide\"><table>\n<thead>{}</thead>\n<tbody>\n{rows}</tbody></table></div>\n",
        escape(&table.title),
        row(&table.head, "th")
    )
}

fn checks(checks: &[Check]) -> String {
    let mut out = String::from(
        "<div class=\"wide\"><table class=\"claims\">\n<thead><tr><th>what</th><th>paper</th><th>obtained</th>\
         <th>judged by</th><th>verdict</th></tr></thead>\n<tbody>\n",
    );
    for check in checks {
        let (class, word) = match check.verdict {
            Verdict::Pass => ("good", "holds"),
            Verdict::Fail => ("bad", "FAILS"),
            Verdict::Note => ("note", "note"),
        };
        out += &format!(
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"{class}\">{word}</td></tr>\n",
            escape(&check.what),
            escape(&check.paper),
            escape(&check.obtained),
            escape(&check.tolerance)
        );
    }
    out + "</tbody></table></div>\n"
}
