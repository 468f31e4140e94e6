//! A fault script: the same reading, with the same complaints, as a test file.

use std::path::Path;

use super::fault_rules::{ScriptError, check_script};
use super::fault_script::Script;
use super::{ConfigError, Finding, KeyPath, Purpose, open};
use gusset_quantity::catalog::phase::Phase;

/// Reads the text of the fault script at `path`.
///
/// # Errors
/// [`ConfigError::Invalid`] with everything that is wrong.
pub fn parse_script(path: &Path, text: String) -> Result<Script, ConfigError> {
    let opened = open(Purpose::Run, path, text, &[])?;
    opened.accept(check).map(|(script, _)| script)
}

fn check(script: &Script) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Err(error) = check_script(script, None) {
        findings.push(finding(script, &error));
    }
    let Some(expect) = &script.expect else {
        return findings;
    };
    let at = KeyPath::root().key("expect").key("path");
    let words = Phase::ALL.map(Phase::word);
    for (index, word) in expect.path.iter().enumerate() {
        if !words.contains(&word.as_str()) {
            let text = format!("{word:?} is no phase of a test");
            let help = format!("they are: {}", words.join(", "));
            findings.push(Finding::error(at.index(index), text).help(help));
        }
    }
    let ends = expect.path.first().map(String::as_str) == Some(Phase::Connected.word())
        && expect.path.last().map(String::as_str) == Some(Phase::Safe.word());
    if !ends {
        let text = "a path goes from \"connected\" to \"safe\"";
        findings.push(Finding::error(at, text));
    }
    findings
}

/// At the parameter that is wrong, or as near as can be.
fn finding(script: &Script, error: &ScriptError) -> Finding {
    let root = KeyPath::root();
    let Some(number) = error.fault else {
        return Finding::error(root, error.to_string());
    };
    let at = root.key("fault").index(number);
    let own = ["at", "for", "axis", "on", "probability"];
    let place = if own.contains(&error.key) {
        at.key(error.key)
    } else {
        let kind = script.fault.get(number).map(|fault| fault.kind.word());
        at.key("kind").key(&kind.unwrap_or_default()).key(error.key)
    };
    Finding::error(place, error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        let error = parse_script(Path::new("script.toml"), text.to_owned()).unwrap_err();
        error.to_string()
    }

    #[test]
    fn script_errors_are_shown_at_their_place() {
        for (text, words) in [
            (
                "title = \"x\"\nfaults = []",
                vec!["unknown key", "`faults`", "fault"],
            ),
            (
                "title = \"x\"\n[[fault]]\nat = 3\nkind = \"vanished\"",
                vec!["vanished", "lost"],
            ),
            (
                "title = \"x\"\n[[fault]]\nat = 3\nkind = { late = { tick = 1 } }",
                vec!["tick", "ticks"],
            ),
            (
                "title = \"x\"\n[[fault]]\nkind = { late = { ticks = -1 } }",
                vec!["`ticks` is -1", "greater than 0", ":3:"],
            ),
            (
                "title = \"x\"\n[[fault]]\nfor = 0\nkind = \"lost\"",
                vec!["`for` is 0"],
            ),
            (
                "title = \"x\"\n[[fault]]\nprobability = 1.5\nkind = \"lost\"",
                vec!["`probability` is 1.5"],
            ),
            (
                "title = \"x\"\n[[fault]]\non = \"commands\"\nkind = \"interlock\"",
                vec!["`on` has"],
            ),
            (
                "title = \"x\"\n[[fault]]\nat = 1\nkind = \"arming_unanswered\"",
                vec!["`at` has"],
            ),
            (
                "title = \"x\"\n[expect]\npath = [\"connected\", \"running\"]\nexit = 0",
                vec!["from \"connected\" to \"safe\""],
            ),
            (
                "title = \"x\"\n[expect]\npath = [\"connected\", \"dancing\", \"safe\"]\nexit = 0",
                vec!["dancing", "no phase", "running"],
            ),
        ] {
            let found = refusal(text);
            for words in words {
                assert!(
                    found.contains(words),
                    "{text}\n{words:?} is not in\n{found}"
                );
            }
        }
    }

    #[test]
    fn script_is_read_as_written() {
        let text = "title = \"x\"\nseed = 7\n[[fault]]\nat = 3\nfor = 2\nprobability = 0.5\non = \"commands\"\n\
                    kind = { late = { ticks = 1.5 } }\n[[fault]]\nkind = { stuck = { channel = \"force\" } }\n";
        let script = parse_script(Path::new("s"), text.to_owned()).unwrap();
        assert_eq!((script.seed, script.fault.len()), (7, 2));
        assert_eq!(toml::from_str::<Script>(text).unwrap(), script);
    }
}
