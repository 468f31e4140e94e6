//! Text within a paragraph, for a terminal: words, wrapped at a width.

/// Text that grows by pieces. A line break that must stay is `\n`.
#[derive(Debug, Default)]
pub(super) struct Inline {
    text: String,
}

impl Inline {
    pub fn push(&mut self, piece: &str) {
        self.text.push_str(piece);
    }

    /// Takes the text so far, and starts an empty one.
    pub fn take(&mut self) -> String {
        std::mem::take(&mut self.text)
    }

    pub fn is_empty(&self) -> bool {
        self.text.trim().is_empty()
    }
}

/// Characters of a text.
pub(super) fn width_of(text: &str) -> usize {
    text.chars().count()
}

/// The text in lines of at most `width` characters; a longer word takes one line.
pub(super) fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = Vec::new();
    for part in text.split('\n') {
        let mut line = String::new();
        for word in part.split_whitespace() {
            if !line.is_empty() && width_of(&line) + 1 + width_of(word) > width {
                lines.push(std::mem::take(&mut line));
            }
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_break_between_words() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
        assert_eq!(
            wrapped("a specimen.limits b", 6),
            ["a", "specimen.limits", "b"]
        );
        assert_eq!(wrapped("one\ntwo", 20), ["one", "two"]);
    }
}
