//! Every fault script of config/faults takes the test where it says. GUSSET_FAULT_SCRIPT=NAME plays one alone.

use std::path::{Path, PathBuf};

use gusset_config::fault_script::Script;
use gusset_config::{load, parse_script};

use crate::invariants;
use crate::lab::{Extra, Played, play};

pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("config/faults")
}

/// Plays a script of the folder with the laboratory file beside it.
fn play_script(script: &Script) -> Result<(Played, gusset_config::Loaded), String> {
    let folder = folder();
    let loaded = load(&folder.join("laboratory.toml"), &script.set).map_err(|e| e.to_string())?;
    let extra = Extra {
        script: Some(script),
        ..Extra::default()
    };
    let played = play(&loaded, extra, |_, _| {
        let host = gusset_setup::load_served(&folder.join("rig.toml"), None)
            .unwrap()
            .host;
        host.faulty(script.clone()).unwrap()
    })?;
    Ok((played, loaded))
}

fn all() -> Vec<(String, Script)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let is_script = path.extension().is_some_and(|e| e == "toml");
        if is_script && name != "rig" && name != "laboratory" {
            let text = std::fs::read_to_string(&path).unwrap();
            let script = parse_script(&path, text).unwrap_or_else(|error| panic!("{error}"));
            all.push((name, script));
        }
    }
    all.sort_by(|one, other| one.0.cmp(&other.0));
    all
}

/// The failures of a script.
fn judge(script: &Script) -> Result<(), String> {
    let (played, loaded) = play_script(script)?;
    let (reason, exit) = played.verdict();
    let found = format!(
        "path = {:?}, exit = {exit}, reason: {reason}\nfar end:\n{}",
        played.path(),
        played.told()
    );
    invariants::check(&loaded, &played).map_err(|wrong| format!("{wrong}\n{found}"))?;
    let Some(expect) = &script.expect else {
        return Err(format!("it does not say what is expected; {found}"));
    };
    let words = expect.reason.as_deref().unwrap_or("end of the test");
    let far_end = expect.far_end.as_deref().unwrap_or("");
    let as_expected = played.path() == expect.path
        && exit == expect.exit
        && reason.contains(words)
        && played.told().contains(far_end);
    if as_expected { Ok(()) } else { Err(found) }
}

#[test]
fn scripts_take_the_test_where_they_say() {
    let mut wrong = Vec::new();
    let only = std::env::var("GUSSET_FAULT_SCRIPT").ok();
    for (name, script) in all() {
        if only.as_ref().is_some_and(|only| *only != name) {
            continue;
        }
        if let Err(found) = judge(&script) {
            wrong.push(format!("{name}: {found}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}
