//! The judging, not the paper: that is `gusset verify` itself.

use super::*;
use gusset_quantity::time::SimClock;

#[test]
fn wrong_value_fails_the_whole() {
    let right = Check::near("a", 4.75, 4.7495, 0.005);
    let wrong = Check::near("a", 4.85, 4.7495, 0.005);
    assert_eq!(
        (right.verdict, wrong.verdict),
        (Verdict::Pass, Verdict::Fail)
    );
    assert_eq!(wrong.obtained, "4.7495");
    assert_eq!(Check::near("a", 1.0, f64::NAN, 9.0).verdict, Verdict::Fail);
    assert_eq!(
        Check::within("a", "0", f64::NAN, 9.0).verdict,
        Verdict::Fail
    );
    assert_eq!(Check::within("a", "0", -1.0, 0.5).verdict, Verdict::Fail);
    let note = Check::note("a", "b", String::new(), "c");
    let part = |check: Check| Part {
        name: "a",
        title: "b",
        says: "c",
        tables: Vec::new(),
        checks: vec![note.clone(), check],
        figures: Vec::new(),
    };
    assert!(all_hold(&[part(right.clone())]));
    assert!(!all_hold(&[part(right), part(wrong.clone())]));
    let page = &files(&[part(wrong)])[0];
    assert_eq!(page.0, "index.html");
    assert!(page.1.contains("1 of 1") && page.1.contains("4.7495"));
}

#[test]
fn numbers_are_short_and_honest() {
    for (value, text) in [
        (0.0, "0"),
        (16.770_3, "16.7703"),
        (2.0, "2"),
        (100.0, "100"),
        (1.234_567_8e-5, "1.23e-5"),
        (2e-12, "2e-12"),
        (123_456.7, "123457"),
        (f64::INFINITY, "∞"),
        (-0.25, "-0.25"),
    ] {
        assert_eq!(number(value), text);
    }
}

#[test]
fn topics_keep_the_order_of_the_paper() {
    assert_eq!(select(&[]).unwrap().len(), TOPICS.len());
    let some = select(&["example-4.1".to_owned(), "table-1".to_owned()]).unwrap();
    let names: Vec<_> = some.iter().map(|topic| topic.name).collect();
    assert_eq!(names, ["table-1", "example-4.1"]);
    let error = select(&["fig-99".to_owned()]).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("\"fig-99\"") && text.contains("table-1,"),
        "{text}"
    );
    let mut all: Vec<_> = TOPICS.iter().map(|topic| topic.name).collect();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), TOPICS.len());
}

#[test]
fn figure_has_data_and_picture() {
    let topics = select(&["fig-5".to_owned()]).unwrap();
    let part = topics[0].prove(Effort::Quick, &SimClock::default());
    assert!(all_hold(std::slice::from_ref(&part)), "{part:?}");
    let files = files(&[part]);
    let names: Vec<_> = files.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["index.html", "fig-5.svg", "fig-5.csv"]);
    assert!(files[0].1.contains("class=\"chart\"") && files[0].1.contains("fig-5.csv"));
    assert!(files[1].1.starts_with("<svg xmlns"));
    assert!(
        files[2]
            .1
            .starts_with("curve,\"Re z (1)\",\"Im z (1)\"\n\"unit circle\",1,0\n")
    );
}
