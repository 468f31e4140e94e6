//! The `gusset` commands that a text names, and whether the program has them.

/// The faults in the commands of a script.
pub fn wrong(script: &str, program: &clap::Command) -> Vec<String> {
    let script = script.replace("\\\n", " ");
    let mut wrong = Vec::new();
    for line in script.lines() {
        let line = line.split(" #").next().unwrap_or_default();
        for piece in line.split(['|', '&', ';', '(', ')', '`']) {
            let words: Vec<&str> = piece.split_whitespace().collect();
            let start = words.iter().position(|word| !is_before(word));
            let words = start
                .and_then(|start| words.get(start..))
                .unwrap_or_default();
            if let ["gusset", rest @ ..] = words {
                wrong.extend(
                    judged(rest, program).map(|what| format!("`{}`: {what}", piece.trim())),
                );
            }
        }
    }
    wrong
}

/// Words that may stand before a command.
fn is_before(word: &str) -> bool {
    [
        "!", "if", "then", "else", "do", "while", "until", "time", "exec", "$", "sudo",
    ]
    .contains(&word)
        || word
            .split_once('=')
            .is_some_and(|(name, _)| name.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
}

fn judged(words: &[&str], program: &clap::Command) -> Option<String> {
    let mut command = program;
    let mut words = words.iter();
    for word in words.by_ref() {
        if let Some(below) = command.find_subcommand(word) {
            command = below;
            if !command.has_subcommands() {
                break;
            }
        } else if is_name(word) && command.has_subcommands() {
            return Some(format!("there is no command `{word}`"));
        } else {
            break;
        }
    }
    // Words behind `--` are for another program.
    for word in words.take_while(|word| **word != "--") {
        let Some(flag) = word.strip_prefix("--").filter(|flag| !flag.is_empty()) else {
            continue;
        };
        let flag = flag
            .split(['=', '\'', '"', ',', '.'])
            .next()
            .unwrap_or_default();
        let is_known = command
            .get_arguments()
            .chain(program.get_arguments().filter(|one| one.is_global_set()))
            .any(|one| one.get_long() == Some(flag));
        if !is_known && !["help", "version"].contains(&flag) {
            return Some(format!("`{}` has no option `--{flag}`", command.get_name()));
        }
    }
    None
}

/// True of a word that can only be a command: not an option, a placeholder or a file.
fn is_name(word: &str) -> bool {
    word.chars().all(|c| c.is_ascii_lowercase() || c == '-') && !word.starts_with('-')
}
