//! `gusset verify`: the published values hold, every form reports them, and an unknown topic is refused.

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

fn verify(arguments: &[&str]) -> (i32, String, String) {
    let mut process = Command::new(assert_cmd::cargo::cargo_bin!("gusset"));
    let output = process.arg("verify").args(arguments).output().unwrap();
    (
        output.status.code().unwrap(),
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

#[test]
fn every_published_value_holds() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("paper");
    let (code, text, complaints) = verify(&["--quick", "--json", "--out", out.to_str().unwrap()]);
    let document: Value = serde_json::from_str(&text).unwrap();
    let failed: Vec<_> = document["parts"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|part| part["checks"].as_array().unwrap())
        .filter(|check| check["verdict"] == "fail")
        .collect();
    assert!(failed.is_empty(), "{failed:#?}");
    assert_eq!(
        (code, &document["holds"]),
        (0, &Value::Bool(true)),
        "{complaints}"
    );
    assert!(document["passed"].as_u64().unwrap() > 110);
    // Table 2 and its companions: every row has a number for every method.
    let tables: Vec<_> = document["parts"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|part| part["tables"].as_array().unwrap())
        .collect();
    assert_eq!(tables.len(), 3);
    for table in tables {
        for row in table["rows"].as_array().unwrap() {
            let row = row.as_array().unwrap();
            assert_eq!(row.len(), table["head"].as_array().unwrap().len());
            assert!(
                row.iter()
                    .all(|cell| cell.as_str().unwrap().parse::<f64>().unwrap() >= 0.0)
            );
        }
    }

    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("checks hold") && !page.contains("FAILS"));
    for figure in [
        "order",
        "fig-1",
        "fig-2",
        "fig-3",
        "eq-33",
        "fig-4",
        "fig-5",
        "criterion",
        "fig-7",
        "fig-8a",
        "fig-8b",
        "fig-9a",
        "fig-9b",
        "fig-10",
        "fig-11a",
        "fig-11b",
        "fig-12a",
        "fig-12b",
        "fig-13",
        "fig-15",
        "fig-16",
        "fig-16-sparse",
    ] {
        assert!(
            page.contains(&format!("<figure id=\"{figure}\"><svg")),
            "{figure}"
        );
        let svg = std::fs::read_to_string(out.join(format!("{figure}.svg"))).unwrap();
        assert!(
            svg.starts_with("<svg") && !svg.contains("nothing to draw"),
            "{figure}"
        );
        let csv = std::fs::read_to_string(out.join(format!("{figure}.csv"))).unwrap();
        assert!(
            csv.starts_with("curve,") && csv.lines().count() > 3,
            "{figure}"
        );
    }
    // Contents, the paper's own words, and its tables.
    for words in [
        "<a href=\"#example-4.2\">",
        "<section id=\"example-4.2\">",
        "<blockquote>",
        "<td>1871.2</td>",
    ] {
        assert!(page.contains(words), "{words}");
    }
    // The page carries everything itself.
    assert!(!page.contains("http://") && !page.contains("https://"));
    assert_eq!(page.matches("<script").count(), 1, "our own");
}

#[test]
fn topic_is_proven_alone_unknown_is_refused() {
    let (code, text, _) = verify(&["fig-5", "--quick"]);
    assert_eq!(code, 0);
    assert!(text.contains("Fig. 5") && !text.contains("Table 1"));
    let (_, listed, _) = verify(&["--list"]);
    assert!(listed.contains("example-4.2") && listed.lines().count() >= 15);
    let (code, _, complaint) = verify(&["fig-6"]);
    assert_eq!(code, 2);
    assert!(
        complaint.contains("there is no topic \"fig-6\""),
        "{complaint}"
    );
}
