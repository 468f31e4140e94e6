//! Text of a file, quoted in a message: short enough to read, and without terminal codes.

use gusset_quantity::text::is_hidden;

/// Longest echo of a text, in characters.
const LONGEST: usize = 80;
/// Longest row of digits: those of a double are fewer.
const MOST_DIGITS: usize = 24;
/// Longest word; paths of files are longer than other words.
const LONGEST_WORD: usize = 300;

/// A number as a person writes it: without rows of zeros.
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() || (1e-5..1e15).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// A text of a file in quotes, cut short where it is long.
pub(crate) fn quoted(text: &str) -> String {
    match text.char_indices().nth(LONGEST) {
        None => format!("{text:?}"),
        Some((end, _)) => {
            let all = text.chars().count();
            format!("{:?}… ({all} characters)", &text[..end])
        }
    }
}

/// A message about a file: [`gusset_quantity::text::printable`], and without endless numbers and words.
#[must_use]
pub(crate) fn plain(message: &str) -> String {
    let mut text = String::with_capacity(message.len());
    for (index, line) in message.split('\n').enumerate() {
        if index > 0 {
            text.push('\n');
        }
        for (index, word) in line.split(' ').enumerate() {
            if index > 0 {
                text.push(' ');
            }
            short_word(word, &mut text);
        }
    }
    text
}

fn short_word(word: &str, text: &mut String) {
    let mut rest = word;
    let mut written = 0;
    while let Some(first) = rest.chars().next() {
        let digits = rest.bytes().take_while(u8::is_ascii_digit).count();
        let taken = if digits > MOST_DIGITS {
            text.push_str(&rest[..MOST_DIGITS / 2]);
            text.push_str(&format!("…({digits} digits)"));
            digits
        } else if is_hidden(first) {
            text.extend(first.escape_unicode());
            first.len_utf8()
        } else {
            let taken = digits.max(first.len_utf8());
            text.push_str(&rest[..taken]);
            taken
        };
        written += 1;
        rest = &rest[taken..];
        if written >= LONGEST_WORD && !rest.is_empty() {
            text.push_str(&format!("…({} more characters)", rest.chars().count()));
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminal_codes_are_spelt_out() {
        assert_eq!(plain("a \u{1b}[2J b\n c\td"), "a \\u{1b}[2J b\n c\\u{9}d");
        assert_eq!(plain("\u{202e}txt.exe"), "\\u{202e}txt.exe");
        let usual = "µm, 1024 Hz, \"Prüfling\", 0.0009765625 s, 18446744073709551615";
        assert_eq!(plain(usual), usual);
    }

    #[test]
    fn endless_numbers_and_words_are_cut() {
        let long = format!("found 1{}, and more", "0".repeat(299));
        assert_eq!(plain(&long), "found 100000000000…(300 digits), and more");
        let word = plain(&"x".repeat(1000));
        assert!(word.ends_with("x…(700 more characters)"), "{word}");
        assert_eq!(number(1e300), "1e300");
        assert_eq!(number(-2.5e-9), "-2.5e-9");
        assert_eq!(number(20.25), "20.25");
        assert_eq!(quoted("\u{1b}[0m"), "\"\\u{1b}[0m\"");
        let cut = quoted(&"a b ".repeat(100));
        assert!(
            cut.len() < 120 && cut.ends_with("(400 characters)"),
            "{cut}"
        );
    }
}
