//! The page that shows everything side by side with the claims, and the files beside it.

use super::{Axes, Check, Figure, Part, Tabulation, Verdict};
use gusset_view::report::{banner, details, escape, frame, note, section, tiles};

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
const SOURCE: &str = "Y. Gui, J.-T. Wang, F. Jin, C. Chen, M.-X. Zhou: Development of a family of explicit algorithms for \
    structural dynamics with unconditional stability. Nonlinear Dynamics, 2014. Numbers in parentheses are its equations. \
    This program's own integrators and models produced every value on this page in one run of `gusset verify`. Figures have the \
    axes of the paper; their data lie beside this page as CSV. A table of checks shows what the paper states in our words, what \
    was obtained, the permitted difference and the verdict.";

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
    let says = format!(
        "{notes} further statements are not judged: measurements of this machine, and places where the paper is loose."
    );
    let figures = [
        (pass, "checks hold"),
        (fail, "checks fail"),
        (notes, "statements not judged"),
        (parts.len(), "topics"),
    ];
    let figures = figures.map(|(number, words)| (number.to_string(), words.to_owned()));
    let mut body = format!(
        "<header>\n<p class=\"brand\">gusset {} · verification</p>\n<h1>{TITLE}</h1>\n",
        env!("CARGO_PKG_VERSION"),
    );
    body += &banner(class, &headline, &[says]);
    body += &tiles(&figures);
    body += "</header>\n<main>\n";
    body += &section("Results by topic", &contents(parts));
    for part in parts {
        body += &whole(part);
    }
    body += &section("Source", &note(SOURCE));
    body += "</main>\n";
    frame(TITLE, &body)
}

/// Contents of the page, with the verdict on each part.
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
            let class = if one.axes == Axes::Square {
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

/// Failed checks, and a folded table of the others.
fn checks(checks: &[Check]) -> String {
    let (failed, others): (Vec<&Check>, Vec<&Check>) = checks
        .iter()
        .partition(|check| check.verdict == Verdict::Fail);
    let hold = others.iter().filter(|c| c.verdict == Verdict::Pass).count();
    let mut summary = match hold {
        1 => "1 check holds".to_owned(),
        hold => format!("{hold} checks hold"),
    };
    if others.len() > hold {
        summary += &format!(", {} noted", others.len() - hold);
    }
    let folded = details(&summary, &claims(&others));
    claims(&failed) + &folded
}

fn claims(checks: &[&Check]) -> String {
    if checks.is_empty() {
        return String::new();
    }
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
