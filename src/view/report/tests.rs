//! The page and the pictures as a whole: well-formed, self-contained, harmless, and alive on any input.

use proptest::prelude::*;
use serde_json::json;

use super::synthetic::{columns, hybrid, prescribed};
use super::*;
use gusset_record::rt::timing::Percentiles;

fn assert_pictures_are_well_formed(page: &str) {
    for inside in svgs(page) {
        assert_well_formed(&format!("<svg {inside}</svg>"));
    }
}

/// Panics unless tags are balanced, attributes quoted, and text free of bare markup: the part of XML that matters here.
fn assert_well_formed(svg: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = svg;
    while let Some(at) = rest.find('<') {
        let text = &rest[..at];
        assert!(!text.contains('>'), "bare > in {text:?}");
        for (i, _) in text.match_indices('&') {
            let entity = text[i..].find(';').map(|end| &text[i..i + end + 1]);
            assert!(
                entity.is_some_and(|e| matches!(
                    e,
                    "&amp;" | "&lt;" | "&gt;" | "&quot;" | "&apos;" | "&#39;"
                )),
                "{text:?}"
            );
        }
        let end = rest[at..].find('>').expect("a tag without end") + at;
        let tag = &rest[at + 1..end];
        assert!(!tag.contains('<'), "bare < in {tag:?}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else {
            assert_eq!(
                tag.matches('"').count() % 2,
                0,
                "unbalanced quotes in {tag:?}"
            );
            let name = tag.split([' ', '/']).next().unwrap_or("");
            let mut names: Vec<_> = tag
                .split('"')
                .step_by(2)
                .filter_map(|part| part.trim().strip_suffix('='))
                .collect();
            names.sort_unstable();
            let total = names.len();
            names.dedup();
            assert_eq!(names.len(), total, "an attribute twice in {tag:?}");
            if !tag.ends_with('/') {
                open.push(name);
            }
        }
        rest = &rest[end + 1..];
    }
    assert!(open.is_empty(), "left open: {open:?}");
    assert!(!svg.chars().any(|c| c.is_control() && c != '\n'));
}

/// The pictures of a page: the content of each, nested pictures included.
fn svgs(page: &str) -> Vec<&str> {
    page.split("<svg class=\"chart\" ")
        .skip(1)
        .filter_map(|part| part.split("</figure>").next()?.rsplit_once("</svg>"))
        .map(|(inside, _)| inside)
        .collect()
}

/// The page without its own script.
fn without_script(page: &str) -> &str {
    page.rsplit_once("<script>").map_or(page, |(own, _)| own)
}

fn assert_self_contained(text: &str) {
    let text = without_script(text).replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for outside in [
        "http://", "https://", "src=", "href=", "url(", "@import", "<script", "<link", "NaN",
        "inf\"",
    ] {
        assert!(!text.contains(outside), "{outside}");
    }
}

#[test]
fn hybrid_page_is_complete() {
    let page = render(&hybrid(8.0, 6));
    for part in [
        "Completed: the test ran to its end",
        "Ground motion",
        "Peak ground acceleration",
        "DOF 3",
        "bottom column",
        "NRMSE",
        "Wake-up lateness",
        "p99.9",
        "Not granted: locked memory",
        "raise memlock",
        "shear building",
        "resolved.toml",
        "started",
    ] {
        assert!(page.contains(part), "{part} is missing");
    }
    assert_self_contained(&page);
    let figures = svgs(&page);
    assert!(figures.len() >= 11, "{}", figures.len());
    assert_pictures_are_well_formed(&page);
}

#[test]
fn prescribed_test_shows_its_properties() {
    let page = render(&prescribed());
    assert!(page.contains("Identified specimen") && !page.contains("Response of the structure"));
    // Properties of the made-up specimen; rows of the static state (5 m) must not enter.
    for part in [
        "2.00\u{a0}MN/m",
        "8.00\u{a0}kN·s/m",
        "12.5\u{a0}ms",
        "simulated clock",
    ] {
        assert!(page.contains(part), "{part} is missing");
    }
    assert!(!page.contains("5.00\u{a0}m<"));
}

/// Every length and force that is written on a page or a picture: with a prefix or without, alone or per something.
fn lengths_and_forces(page: &str) -> Vec<String> {
    // Scripts are full of "(m)".
    let page = without_script(page);
    let mut found = Vec::new();
    for prefix in ["", "k", "M", "m", "µ", "n"] {
        for unit in ["m", "N", "m s", "m²", "N/m", "N·s/m"] {
            for (before, after) in [
                ("(", ")"),
                ("\u{a0}", "<"),
                ("\u{a0}", " "),
                ("\u{a0}", ","),
            ] {
                let text = format!("{before}{prefix}{unit}{after}");
                found.extend(page.contains(&text).then_some(text));
            }
        }
    }
    found
}

#[test]
fn rotations_and_moments_are_shown() {
    // A prescribed rotation: nothing on the page is a length or a force.
    let straight = prescribed();
    let mut turned = straight.clone();
    let turn = |run: &mut RunView| {
        for column in &mut run.columns {
            column.unit = match column.unit.as_str() {
                "m" => "rad".to_owned(),
                "N" => "N m".to_owned(),
                other => other.to_owned(),
            };
        }
    };
    turn(&mut turned);
    assert!(!lengths_and_forces(&render(&straight)).is_empty());
    for page in [render(&turned), hero_svg(&turned)] {
        assert_eq!(lengths_and_forces(&page), [""; 0]);
        assert!(page.contains("(mrad)") && page.contains("N·m)"));
    }
    // A structure with a DOF that turns: it has a separate picture beside those that do not.
    let mut run = hybrid(4.0, 0);
    let before = render(&run);
    let mut others = run.columns.iter_mut();
    others.find(|column| column.name == "x3").unwrap().unit = "rad".to_owned();
    let page = render(&run);
    let histories = |page: &str| page.matches("Displacement over test time").count();
    assert_eq!(histories(&page), 2 * histories(&before));
    assert!(page.contains("displacement (mm)") && page.contains("displacement (mrad)"));
    assert!(page.contains("amplitude (mrad s)") || page.contains("amplitude (rad s)"));
    assert!(hero_svg(&run).contains("displ. (mrad)"));
    // An angle is no largest displacement, recorded or not, however large its number.
    let summary = run.summary.as_mut().unwrap();
    let tile = |page: &str| {
        let end = page.find("largest displacement, DOF ").unwrap();
        page[end..].split('<').next().unwrap().to_owned()
    };
    let peak = &mut summary.peak;
    peak.displacement = [0.1, 0.2, 500.0, 700.0].map(Some).into();
    peak.rotations = vec![3, 4];
    assert_eq!(tile(&render(&run)), "largest displacement, DOF 2");
    let summary = run.summary.as_mut().unwrap();
    summary.peak.rotations = vec![3];
    assert_eq!(tile(&render(&run)), "largest displacement, DOF 4");
}

#[test]
fn separate_pictures_are_well_formed() {
    let run = hybrid(4.0, 0);
    let hero = hero_svg(&run);
    assert_well_formed(&hero);
    assert_self_contained(&hero);
    assert!(hero.contains("Ground motion") && hero.contains("p99.9"));
    let p = Percentiles {
        count: 3,
        p50: 0.05,
        max: 1200.0,
        ..Percentiles::default()
    };
    let jitter = jitter_svg(
        "Wake-up lateness at 1024 Hz <idle>",
        &[(0.05, 2), (1200.0, 1)],
        &p,
        Some(976.6),
    );
    assert_well_formed(&jitter);
    assert!(jitter.contains("deadline") && jitter.contains("&lt;idle&gt;"));
    assert_well_formed(&jitter_svg("", &[], &Percentiles::default(), None));
    assert_well_formed(&hero_svg(&RunView::default()));
    assert_well_formed(&hero_svg(&prescribed()));
}

#[test]
fn user_text_never_becomes_markup() {
    let evil = "<script>alert(\"x\")</script>'&\u{0}\u{1b}[0m";
    let mut run = hybrid(1.0, 2);
    run.title = evil.to_owned();
    run.flaws.unfinished = Some(evil.to_owned());
    run.summary = Some(
        json!({"status": "failed", "reason": evil, "version": evil, "clock": "real", "realtime": {"complete": false, "required": false, "features": [{"want": "policy", "asked": evil, "granted": false, "reason": evil}], "spin": {"asked_us": 0.0, "used_us": 0.0, "throttle": null, "note": ""}}}).into());
    let round_trip = json!({"count": 1, "p50": 1.0, "bins": [[0.5, 1.0, 1]]});
    run.timing = Some(
        json!({"round_trip": {"count": 2, "specimens": {evil: round_trip, "b": round_trip}}})
            .into(),
    );
    run.events = vec![
        json!({"event": evil, evil: evil, "wall": evil}).into(),
        json!(evil).into(),
    ];
    run.test = format!(
        "[[specimen]]\nname = '''{}'''\n",
        evil.replace(['\'', '\u{0}', '\u{1b}'], "")
    )
    .into();
    for column in &mut run.columns {
        column.unit = evil.to_owned();
    }
    let (page, hero) = (render(&run), hero_svg(&run));
    for text in [&page, &hero] {
        // Our own script, and nothing else.
        let own = usize::from(text.contains("<!DOCTYPE html>"));
        assert_eq!(text.matches("<script").count(), own);
        assert_eq!(text.matches("</script").count(), own);
        assert!(!text.contains("alert(\"x\")"));
        assert!(!text.contains(['\u{0}', '\u{1b}']));
    }
    assert_pictures_are_well_formed(&page);
    assert_well_formed(&hero);
}

#[test]
fn empty_run_gives_a_page() {
    let page = render(&RunView::default());
    for part in [
        "No summary",
        "No timing was recorded",
        "No events were recorded",
        "configuration is missing",
        "Untitled test",
    ] {
        assert!(page.contains(part), "{part} is missing");
    }
    let mut run = hybrid(1.0, 0);
    run.data.iter_mut().for_each(Vec::clear);
    assert!(render(&run).contains("No row was recorded while the test was running"));
}

#[test]
fn odd_rows_do_not_break_the_page() {
    for make in [
        |_: f64| f64::NAN,
        |_: f64| 0.0,
        |_: f64| -7.5,
        |v: f64| v * f64::INFINITY,
        |v: f64| v * 1e300,
    ] {
        for rows in [1, 2, 50, 1024] {
            let mut run = hybrid(1.0, 0);
            for (column, values) in run.columns.iter().zip(&mut run.data) {
                values.truncate(rows);
                if column.name != "state" {
                    values.iter_mut().for_each(|v| *v = make(*v));
                }
            }
            let (page, hero) = (render(&run), hero_svg(&run));
            assert_well_formed(&hero);
            assert_pictures_are_well_formed(&page);
        }
    }
}

#[test]
fn ragged_columns_do_not_break_the_page() {
    let whole = hybrid(1.0, 0);
    for missing in 0..whole.columns.len() {
        let mut run = whole.clone();
        run.columns.remove(missing);
        run.data.remove(missing);
        assert_pictures_are_well_formed(&render(&run));
        let mut run = whole.clone();
        run.data[missing].truncate(100);
        let _ = render(&run);
        run.data.truncate(missing);
        let _ = render(&run);
        let _ = hero_svg(&run);
    }
}

#[test]
fn large_tests_are_limited_on_the_page() {
    let mut names = vec!["state".to_owned(), "time".to_owned()];
    names.extend((1..=60).map(|i| format!("x{i}")));
    for axis in 1..=50 {
        names.extend(["target", "meas", "force"].map(|kind| format!("{kind}_1_{axis}")));
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut data = vec![vec![3.0; 200]; names.len()];
    for (j, column) in data.iter_mut().enumerate().skip(1) {
        *column = (0..200)
            .map(|i| {
                if j == 1 {
                    f64::from(i)
                } else {
                    libm::sin(f64::from(i) / 9.0) * j as f64
                }
            })
            .collect();
    }
    let events = (0..731)
        .map(|i| json!({"event": "stale", "tick": i}).into())
        .collect();
    let page = render(&RunView {
        columns: columns(&names),
        data,
        events,
        ..RunView::default()
    });
    assert!(
        page.contains("show 6 of 60 recorded DOFs") && page.contains("24 of 60 DOFs are listed")
    );
    assert!(page.contains("show 8 of 50 axes"));
    assert!(page.contains("531\u{a0}further events"));
    assert_eq!(page.matches("<td>stale</td>").count(), 200);
}

#[test]
fn the_page_of_a_long_test_stays_small() {
    // 40 s at 1024 Hz hold 41 000 rows of 28 columns, 9 MB as doubles.
    let page = render(&hybrid(40.0, 6));
    assert!(page.len() < 8_000_000, "{}", page.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_numbers_do_not_break_the_page(
        values in prop::collection::vec(prop::collection::vec(prop_oneof![6 => -1e3f64..1e3, 1 => any::<f64>(), 1 => Just(3.0)], 0..60), 28),
    ) {
        let mut run = hybrid(0.1, 0);
        run.data = values;
        let page = render(&run);
        assert_pictures_are_well_formed(&page);
        assert_well_formed(&hero_svg(&run));
    }
}

/// Writes the pages and pictures into the folder named by GUSSET_REPORT_SAMPLES, to be judged by eye; without it, nothing.
#[test]
fn samples_for_the_eye() {
    let Some(folder) = std::env::var_os("GUSSET_REPORT_SAMPLES").map(std::path::PathBuf::from)
    else {
        return;
    };
    let run = hybrid(40.0, 6);
    let mut cut = hybrid(11.0, 6);
    cut.flaws.unfinished = Some("the folder has no summary; rows end at 11.0 s".to_owned());
    cut.summary = None;
    cut.timing = None;
    let wakeup = super::timing::read(run.timing.as_ref()).remove(0);
    let files = [
        ("report.html", render(&run)),
        ("prescribed.html", render(&prescribed())),
        ("unfinished.html", render(&cut)),
        ("empty.html", render(&RunView::default())),
        ("hero.svg", hero_svg(&run)),
        (
            "jitter.svg",
            jitter_svg(
                "Wake-up lateness at 1024 Hz, 40 s",
                &wakeup.histogram,
                &wakeup.percentiles,
                Some(976.6),
            ),
        ),
    ];
    for (name, text) in files {
        std::fs::write(folder.join(name), text).unwrap();
    }
}

/// The command is no measured displacement: nothing compares it with the target, and no picture calls it measured.
#[test]
fn missing_displacement_is_explained() {
    let mut run = prescribed();
    let brace = |run: &RunView| {
        let (name, axes) = tracking_metrics(run).0.remove(0);
        assert_eq!((name.as_str(), axes.len()), ("brace", 1));
        axes[0]
    };
    assert!(brace(&run).is_some());
    assert!(missing_metrics(&run).is_empty());
    assert!(render(&run).contains("Target and measured"));
    run.events =
        vec![json!({"event": "connected", "specimen": 1, "name": "brace", "peer": "rig", "measures_disp": false}).into()];
    assert_eq!(brace(&run), None);
    let missing = missing_metrics(&run);
    assert_eq!(missing.len(), 1);
    assert!(missing[0].starts_with("brace"), "{missing:?}");
    assert!(missing[0].contains("displacement is not measured"));
    let axes = identified(&run);
    assert!(axes[0].stiffness.is_none() && axes[0].lag.is_none());
    let page = render(&run);
    assert_pictures_are_well_formed(&page);
    assert!(page.contains("Target and command") && page.contains("force against command"));
    for line in [
        "Target and measured",
        ">measured<",
        "force against measured",
    ] {
        assert!(!page.contains(line), "{line}");
    }
}

/// A portal frame with a rigid floor, and the DOFs B0 rz, A1 x, A1 y, A1 rz, B1 y, B1 rz. The beam has no name.
const PORTAL: &str = "[structure.frame]\nnode = [\n\
    { name = \"A0\", at_m = [0, 0], fixed = [\"x\", \"y\", \"rz\"] },\n\
    { name = \"B0\", at_m = [6, 0], fixed = [\"x\", \"y\"] },\n\
    { name = \"A1\", at_m = [0, 4], mass_kg = 1e4 },\n{ name = \"B1\", at_m = [6, 4] },\n]\n\
    member = [\n{ name = \"left\", nodes = [\"A0\", \"A1\"], section = \"s\" },\n\
    { name = \"right\", nodes = [\"B0\", \"B1\"], section = \"s\" },\n\
    { nodes = [\"A1\", \"B1\"], section = \"s\", release = [\"end\"], offset_start_m = [0.2, 0] },\n]\n\
    constraint = [{ diaphragm = { master = \"A1\", nodes = [\"B1\"] } }]\n\
    section.s.elastic = { young_pa = 2e11, area_m2 = 1e-2, inertia_m4 = 1e-4 }\n";

/// Rows of the portal; the floor drifts by −80 mm at 0.25 s.
fn portal(more: &str) -> RunView {
    let names = [
        "state", "time", "ground", "x1", "x2", "x3", "x4", "x5", "x6",
    ];
    let drift = [0.01, 0.03, -0.08, 0.05];
    let column = |name: &str, row: usize| match name {
        "state" => 3.0,
        "time" => 0.125 * row as f64,
        "ground" => 0.5,
        "x2" => drift[row],
        "x3" | "x5" => -0.001,
        _ => -0.1 * drift[row],
    };
    let data = names.map(|name| (0..4).map(|row| column(name, row)).collect());
    RunView {
        columns: columns(&names),
        data: data.into(),
        test: format!("{PORTAL}{more}").into(),
        ..RunView::default()
    }
}

/// The picture of the frame and its caption.
fn frame_of(run: &RunView) -> (String, String) {
    let page = render(run);
    assert_pictures_are_well_formed(&page);
    let figures = page
        .split("<figure>")
        .filter(|part| part.contains("<figcaption>"));
    let [figure] = figures.collect::<Vec<_>>()[..] else {
        panic!("no frame, or several");
    };
    let (picture, caption) = figure.split_once("<figcaption>").unwrap();
    let caption = caption.split_once("</figcaption>").unwrap().0;
    (picture.to_owned(), caption.replace("&quot;", "\""))
}

#[test]
fn frame_is_drawn_at_its_largest_drift() {
    let mut run = portal("");
    let (picture, caption) = frame_of(&run);
    let told = "At 0.25\u{a0}s node A1 has the largest drift: −80.0\u{a0}mm in x. Displacements are magnified 5 times.";
    assert!(caption.starts_with(told), "{caption}");
    let count = |picture: &str, part: &str| picture.matches(part).count();
    // Three members as curves, undeformed and deformed; a hinge; a mass, and the node with its name.
    assert_eq!(count(&picture, "C"), 6);
    assert_eq!(count(&picture, "f-card l-frame"), 1);
    assert_eq!(count(&picture, "<circle"), 3);
    assert!(picture.contains(">A1</text>") && !picture.contains("yielded"));
    // The end of the third member without a name, and both ends of another.
    let demands = json!([{ "name": "member 3", "demand": [0.99, 1.0] }, { "name": "left", "demand": [4.5, 3.0] },
        { "name": "right", "demand": [null, 0.0] }, { "name": "unknown", "demand": [9.0, 9.0] }]);
    run.summary = Some(json!({ "members": demands }).into());
    let (picture, _) = frame_of(&run);
    for ink in ["f-s4", "f-s1", "f-alarm"] {
        assert_eq!(
            count(&picture, &format!("<circle class=\"{ink}\"")),
            2,
            "{ink}, one in the legend"
        );
    }
}

/// Coordinates are absolute where the base is displaced: the drift is 80 mm − 0.5 m.
#[test]
fn base_is_no_drift_of_a_frame() {
    let base = "[excitation.base_displacement.signal.sine]\namplitude = 0.5\nfrequency_hz = 1\n";
    let (_, caption) = frame_of(&portal(base));
    assert!(
        caption.contains("largest drift: −580\u{a0}mm in x. Displacements are not magnified."),
        "{caption}"
    );
}

#[test]
fn beam_is_drawn_at_its_largest_deflection() {
    let mut run = portal("");
    run.data[4] = vec![1e-9; 4];
    run.data[7] = vec![0.0, 0.02, 0.04, -0.03];
    let (_, caption) = frame_of(&run);
    let told = "At 0.25\u{a0}s node B1 has the largest displacement: 40.0\u{a0}mm in y.";
    assert!(caption.starts_with(told), "{caption}");
}

#[test]
fn undeformed_frame_says_why() {
    let reason = |change: &dyn Fn(&mut RunView)| {
        let mut run = portal("");
        change(&mut run);
        let (picture, caption) = frame_of(&run);
        assert_eq!(picture.matches('C').count(), 3);
        let (_, reason) = caption.split_once("is missing: ").unwrap();
        reason.split_once(" Grey: ").unwrap().0.to_owned()
    };
    let empty = reason(&|run| run.data.iter_mut().for_each(Vec::clear));
    assert_eq!(empty, "no row was recorded while the test was running.");
    let partly = reason(&|run| run.columns[4].name = "x9".to_owned());
    assert!(partly.contains("`record.dofs = \"all\"`"), "{partly}");
    let still = reason(&|run| run.data[3..].iter_mut().for_each(|x| x.fill(0.0)));
    assert_eq!(still, "the largest displacement is 0\u{a0}m.");
    let gone = reason(&|run| run.data[4][1] = 7.0);
    assert_eq!(gone, "the largest displacement is 7.00\u{a0}m.");
    let absent = reason(&|run| run.data[3..].iter_mut().for_each(|x| x.fill(f64::NAN)));
    assert!(absent.contains("lack displacements"), "{absent}");
}
