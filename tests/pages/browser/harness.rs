//! The stage itself: it detects every fault that it must.

use super::stage::{assert_quiet, visit};

#[test]
fn a_page_that_only_draws_is_quiet() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    std::fs::write(&page, "<!doctype html><title>Q</title><canvas></canvas>").unwrap();
    let address = format!("file://{}", page.display());
    let Some(found) = visit("harness.mjs", &[&address]) else {
        return;
    };
    assert_quiet(&found);
    assert_eq!(found["painted"], 0.0, "{found:#}");
}

#[test]
fn stage_sees_errors_and_stops_requests() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let text = r#"<!doctype html><title>T</title><canvas></canvas>
        <script>
        document.querySelector("canvas").getContext("2d").fillRect(0, 0, 300, 75);
        console.warn("heard");
        fetch("http://192.0.2.1/away").catch(() => {});
        setTimeout(() => { throw new Error("seen"); }, 0);
        </script>"#;
    std::fs::write(&page, text).unwrap();
    let address = format!("file://{}", page.display());
    let Some(found) = visit("harness.mjs", &[&address]) else {
        return;
    };
    assert_eq!(found["left"][0], "http://192.0.2.1/away", "{found:#}");
    assert!(found["console"].to_string().contains("heard"), "{found:#}");
    assert!(found["errors"].to_string().contains("seen"), "{found:#}");
    // 300 × 75 of 300 × 150 pixels.
    assert_eq!(found["painted"], 0.5, "{found:#}");
    assert_eq!(found["title"], "T");
}
