//! The page that shows everything side by side with the claims, and the files beside it.

use maud::{Markup, html};

use super::{Axes, Check, Figure, Part, Tabulation, Verdict};
use gusset_view::report::{banner, beside, details, frame, header, note, section, table, tiles};

/// index.html, and an SVG and a CSV for every figure: names and contents.
#[must_use]
pub fn files(parts: &[Part]) -> Vec<(String, String)> {
    let mut files = vec![("index.html".to_owned(), index(parts))];
    for figure in parts.iter().flat_map(|part| &part.figures) {
        files.push((format!("{}.svg", figure.file), figure.chart().svg()));
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
    let brand = format!("{} · verification", env!("CARGO_PKG_VERSION"));
    let head = html! { (banner(class, &headline, &[says])) (tiles(&figures)) };
    let body = html! {
        (header(&brand, TITLE, head))
        main {
            (section("Results by topic", contents(parts)))
            @for part in parts { (whole(part)) }
            (section("Source", note(SOURCE)))
        }
    };
    frame(TITLE, &body)
}

/// Contents of the page, with the verdict on each part.
fn contents(parts: &[Part]) -> Markup {
    let judged = |part: &Part| {
        let (pass, fail, notes) = (
            part.count(Verdict::Pass),
            part.count(Verdict::Fail),
            part.count(Verdict::Note),
        );
        let (class, mut words) = match fail {
            0 => ("good", format!("{pass} hold")),
            _ => ("bad", format!("{fail} FAIL, {pass} hold")),
        };
        if notes > 0 {
            words += &format!(", {notes} noted");
        }
        html! { span class=(class) { (words) } }
    };
    html! {
        nav {
            ul.contents {
                @for part in parts { li { a href={ "#" (part.name) } { (part.title) } (judged(part)) } }
            }
        }
    }
}

/// One part: what the paper says beside its figure, further figures, tables, checks.
fn whole(part: &Part) -> Markup {
    let says = html! { blockquote { (part.says) } };
    let figures = html! { @for one in &part.figures { (picture(one)) } };
    let shares = match part.figures.first() {
        Some(one) if one.axes == Axes::Square => "beside square",
        _ => "beside",
    };
    html! {
        section id=(part.name) {
            h2 { (part.title) }
            @if part.figures.len() == 1 { (beside(shares, html! { (figures) div { (says) } })) }
            @else { (says) (beside("grid", figures)) }
            @for one in &part.tables { (tabulated(one)) }
            (checks(&part.checks))
        }
    }
}

fn picture(figure: &Figure) -> Markup {
    let name = figure.file;
    html! {
        figure id=(name) {
            (figure.chart().inline())
            figcaption {
                (figure.claim) " " a href={ (name) ".csv" } { "Data" } ", "
                a href={ (name) ".svg" } { "picture" } "."
            }
        }
    }
}

fn tabulated(one: &Tabulation) -> Markup {
    let heading: Vec<&str> = one.head.iter().map(String::as_str).collect();
    html! { h3 { (one.title) } (table(&heading, &one.rows)) }
}

/// Failed checks, and a folded table of the others.
fn checks(checks: &[Check]) -> Markup {
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
    html! { (claims(&failed)) (details(&summary, claims(&others))) }
}

fn claims(checks: &[&Check]) -> Markup {
    const HEADING: [&str; 5] = ["what", "paper", "obtained", "judged by", "verdict"];
    let row = |check: &Check| {
        let (class, word) = match check.verdict {
            Verdict::Pass => ("good", "holds"),
            Verdict::Fail => ("bad", "FAILS"),
            Verdict::Note => ("note", "note"),
        };
        let cells = [&check.what, &check.paper, &check.obtained, &check.tolerance];
        html! { tr { @for cell in cells { td { (cell) } } td class=(class) { (word) } } }
    };
    html! {
        @if !checks.is_empty() {
            div.wide {
                table.claims {
                    thead { tr { @for cell in HEADING { th { (cell) } } } }
                    tbody { @for check in checks { (row(check)) } }
                }
            }
        }
    }
}
