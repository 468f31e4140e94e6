//! Text shown to people: characters that a terminal or a browser would obey or hide are spelled out.
//!
//! Names, titles and reasons come from files and from other machines. A character that moves the cursor, turns the direction of
//! writing or takes no room could make a line say something else than it does. Every place that shows such a text uses
//! [`printable`]: terminal, log, events, report and live page.

/// Bytes as hexadecimal digits, two for each: a checksum.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// True of a character that is obeyed or hidden instead of shown: controls, those that turn the direction of writing or break
/// lines, and those without width.
#[must_use]
pub fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{ad}'
                | '\u{34f}'
                | '\u{61c}'
                | '\u{115f}'
                | '\u{1160}'
                | '\u{17b4}'
                | '\u{17b5}'
                | '\u{180b}'..='\u{180f}'
                | '\u{200b}'..='\u{200f}'
                | '\u{2028}'..='\u{202e}'
                | '\u{2060}'..='\u{206f}'
                | '\u{3164}'
                | '\u{feff}'
                | '\u{ffa0}'
                | '\u{fff9}'..='\u{fffb}'
                | '\u{1d173}'..='\u{1d17a}'
                | '\u{e0000}'..='\u{e0fff}'
        )
}

/// The text with every hidden character spelled as `\u{202e}`; lines stay lines.
#[must_use]
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if c != '\n' && is_hidden(c) {
            shown.extend(c.escape_unicode());
        } else {
            shown.push(c);
        }
    }
    shown
}

/// The text as one word of a shell.
#[must_use]
pub fn shell_word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+:@,=%".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', "'\\''"))
}

/// Whether received texts are replaced.
#[cfg(debug_assertions)]
static REWORDS: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false);

/// From here on each received text becomes another one. Tests show that the program does the same.
#[cfg(debug_assertions)]
pub fn reword_received() {
    REWORDS.store(true, std::sync::atomic::Ordering::Relaxed);
}

/// A text that a peer sent or a run file holds. People read it, and nothing depends on it.
#[must_use]
pub fn received(text: String) -> String {
    #[cfg(debug_assertions)]
    if !text.is_empty() && REWORDS.load(std::sync::atomic::Ordering::Relaxed) {
        return "reworded".to_owned();
    }
    text
}

/// Reads such a text with serde.
///
/// # Errors
/// It is no text.
pub fn words<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    serde::Deserialize::deserialize(deserializer).map(received)
}

/// True if a text can be a reason that a user gives: it has at least one letter, in any script.
#[must_use]
pub fn is_reason(text: &str) -> bool {
    text.chars().any(|c| c.is_alphabetic() && !is_hidden(c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_characters_are_spelled_out() {
        assert_eq!(printable("a \u{1b}[2J b\nc\td"), "a \\u{1b}[2J b\nc\\u{9}d");
        for (c, spelled) in [
            ('\u{202e}', "\\u{202e}"),
            ('\u{2066}', "\\u{2066}"),
            ('\u{200b}', "\\u{200b}"),
            ('\u{200f}', "\\u{200f}"),
            ('\u{feff}', "\\u{feff}"),
            ('\u{2028}', "\\u{2028}"),
            ('\u{ad}', "\\u{ad}"),
            ('\u{e0041}', "\\u{e0041}"),
        ] {
            assert_eq!(printable(&format!("x{c}y")), format!("x{spelled}y"));
        }
        let usual = "µm, \"Prüfling\", ζ = 2 %, 東京, žába, –45.6\u{a0}kN";
        assert_eq!(printable(usual), usual);
    }

    #[test]
    fn reason_needs_a_letter() {
        for nothing in [
            "",
            " \t\n",
            "\u{200b}",
            "\u{2800}\u{a0}",
            "\u{3164} \u{202e}",
            ".",
            "1",
            "-- 2026-04-01 !",
            "\u{fe0f}",
        ] {
            assert!(!is_reason(nothing), "{nothing:?}");
        }
        for reason in [" a\u{200b}", "№ 3 geprüft", "試験"] {
            assert!(is_reason(reason), "{reason:?}");
        }
    }

    #[test]
    fn quoted_words_reach_the_program_unchanged() {
        assert_eq!(shell_word("config/cyclic.toml"), "config/cyclic.toml");
        assert_eq!(shell_word("my test.toml"), "'my test.toml'");
        assert_eq!(shell_word("title=\"it's\""), "'title=\"it'\\''s\"'");
        assert_eq!(shell_word("$HOME"), "'$HOME'");
    }
}
