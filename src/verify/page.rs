//! The page that shows everything side by side with the claims, and the files beside it.

use super::{Check, Part, Verdict};
use crate::report::{escape, frame, note, section};

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
        "<header>\n<p class=\"brand\">gusset · verification</p>\n<h1>{TITLE}</h1>\n\
         <div class=\"verdict {class}\">\n<p class=\"headline\">{}</p>\n<p>{notes} further statements are not judged: \
         measurements of this machine, and places where the paper is loose.</p>\n</div>\n</header>\n<main>\n",
        escape(&headline)
    );
    body += &note(
        "Y. Gui, J.-T. Wang, F. Jin, C. Chen, M.-X. Zhou: Development of a family of explicit algorithms for structural \
         dynamics with unconditional stability. Nonlinear Dynamics, 2014. Every value below was obtained by this \
         program's own integrators and models; figures have the paper's axes, their data lie beside this page as CSV.",
    );
    for part in parts {
        let mut markup = checks(&part.checks);
        let figures = part.figures.iter().map(|figure| {
            format!(
                "<figure id=\"{}\">{}<p class=\"note\">{} <a href=\"{}.csv\">data</a></p></figure>\n",
                figure.file,
                figure.svg(true),
                escape(figure.claim),
                figure.file
            )
        });
        let figures: String = figures.collect();
        if !figures.is_empty() {
            markup += &format!("<div class=\"grid\">\n{figures}</div>\n");
        }
        body += &section(part.title, &markup);
    }
    body += "</main>\n";
    frame(TITLE, &body)
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
