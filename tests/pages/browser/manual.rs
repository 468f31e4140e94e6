//! The guide as web pages: they search without a network, follow the system's colours, and print without the navigation.

use serde_json::Value;

use super::stage::{assert_quiet, visit};
use crate::common::say;

/// The contents page in a browser.
fn seen(how: &str) -> Option<Value> {
    let folder = tempfile::tempdir().unwrap();
    let manual = folder.path().join("manual");
    let said = say(["guide".as_ref(), "--html".as_ref(), manual.as_os_str()]);
    assert_eq!(said.code, Some(0), "{}", said.stderr);
    let address = format!("file://{}", manual.join("index.html").display());
    let shots = std::env::var("GUSSET_BROWSER_SHOTS").unwrap_or_default();
    let shot = format!("{shots}/manual-{how}.png");
    let shot = if shots.is_empty() { "" } else { &shot };
    let found = visit("manual.mjs", &[&address, how, shot])?;
    assert_quiet(&found);
    assert_eq!(found["wide"], false, "{how}: nothing sticks out sideways");
    Some(found)
}

#[test]
fn search_leads_to_the_entry_of_a_key() {
    for how in ["light", "dark", "narrow"] {
        let Some(found) = seen(how) else {
            return;
        };
        let first = found["results"][0].as_str().unwrap();
        assert!(first.starts_with("configuration.html#"), "{found:#}");
        assert!(found["marked"].as_u64().unwrap() > 0, "{found:#}");
        assert_eq!(
            (&found["article"], &found["back"]),
            (&false.into(), &true.into())
        );
        assert_eq!(found["nothing"], 0);
        assert!(
            found["target"].as_str().unwrap().contains("command_disp_m"),
            "{found:#}"
        );
        let pages = gusset::guide::PAGES.len() + 1;
        assert_eq!(found["links"], pages);
    }
}

#[test]
fn pages_turn_dark_and_print_cleanly() {
    let (Some(light), Some(dark), Some(print)) = (seen("light"), seen("dark"), seen("print"))
    else {
        return;
    };
    assert_ne!(light["background"], dark["background"]);
    assert_eq!(print["navigation"], false);
}
