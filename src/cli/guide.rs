//! `gusset guide`.

use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::Context;

use super::args::GuideArgs;
use super::exit::Exit;
use super::{answer, tell};
use crate::guide::{self, CONTENTS, Entry, MANUAL_LIST, PAGES, plain_text};
use gusset_config::nearest;
use gusset_quantity::catalog::explained::explain;

/// The widest text.
const WIDEST: usize = 100;
/// Places that are shown where a word is neither a page nor a key.
const MOST_HITS: usize = 10;
/// Entries that are shown as a whole; of more, only the paths.
const MOST_ENTRIES: usize = 5;

/// Prints a page, an entry of the configuration reference, or the contents; or writes the web pages.
pub fn guide(args: &GuideArgs) -> anyhow::Result<Exit> {
    if let Some(folder) = &args.html {
        return write_manual(folder);
    }
    let markdown = match &args.topic {
        None => CONTENTS.to_owned(),
        Some(topic) => text_of(topic)?,
    };
    let text = plain_text(&markdown, width());
    if !(io::stdout().is_terminal() && paged(&text)) {
        answer(text)?;
    }
    Ok(Exit::Done)
}

fn width() -> usize {
    match rustix::termios::tcgetwinsize(io::stdout()) {
        Ok(size) if size.ws_col > 0 => usize::from(size.ws_col).min(WIDEST),
        _ => WIDEST,
    }
}

/// The Markdown of a topic.
fn text_of(topic: &str) -> anyhow::Result<String> {
    let entries = guide::find(topic);
    if let Some(page) = guide::page(&topic.to_lowercase().replace('_', "-")) {
        return Ok(match entries.first() {
            None => page.text.to_owned(),
            Some(entry) => format!("{}\nKeys: `gusset guide {}`\n", page.text, entry.path),
        });
    }
    match entries.as_slice() {
        [] => explained(topic)
            .or_else(|| found(topic))
            .ok_or_else(|| anyhow::Error::msg(no_such_topic(topic))),
        several if several.len() > MOST_ENTRIES => {
            let mut text = format!("Several entries end with `{topic}`:\n\n");
            for entry in several {
                text.push_str(&format!("- `gusset guide {}`\n", entry.path));
            }
            Ok(text)
        }
        few => Ok(few.iter().map(shown).collect::<Vec<_>>().join("\n\n")),
    }
}

/// An entry with the path of its key as heading.
fn shown(entry: &Entry) -> String {
    if entry.is_table {
        entry.text.to_owned()
    } else {
        format!("## {}\n\n{}", entry.path, entry.text)
    }
}

/// The meanings of a name in the files of a run.
fn explained(name: &str) -> Option<String> {
    let found = explain(name);
    let each = found.iter().map(|one| {
        format!(
            "## {}: {}\n\n{}\n\nMore: `gusset guide {}`\n\n",
            one.name, one.kind, one.meaning, one.page
        )
    });
    (!found.is_empty()).then(|| each.collect())
}

/// The parts of all pages in which every word of the topic occurs.
fn found(topic: &str) -> Option<String> {
    let hits = guide::search(topic);
    if hits.is_empty() {
        return None;
    }
    let mut text = format!("No page or key is called `{topic}`. It occurs here:\n\n");
    for hit in hits.iter().take(MOST_HITS) {
        text.push_str(&format!(
            "- `gusset guide {}`: {}\n\n  {}\n\n",
            hit.topic,
            escaped(&hit.heading),
            escaped(&hit.text)
        ));
    }
    if hits.len() > MOST_HITS {
        text.push_str(&format!("{} more places.\n", hits.len() - MOST_HITS));
    }
    Some(text)
}

/// A plain text as Markdown.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_ascii_punctuation() {
            escaped.push('\\');
        }
        escaped.push(c);
    }
    escaped
}

fn no_such_topic(topic: &str) -> String {
    let entries = guide::entries();
    let mut names: Vec<&str> = PAGES.iter().map(|page| page.id).collect();
    for entry in &entries {
        names.push(&entry.path);
        names.extend(entry.path.rsplit('.').next());
    }
    // A name that differs by more than a slip is no help.
    let is_a_slip =
        |name: &&str| strsim::osa_distance(&topic.to_lowercase(), name) <= topic.len() / 4;
    let near = match nearest(topic, &names).filter(is_a_slip) {
        Some(name) => format!("did you mean `{name}`? "),
        None => String::new(),
    };
    format!(
        "the guide has no topic `{topic}`, and no page has the word: {near}`gusset guide` lists the pages"
    )
}

/// Shows the text with the user's pager. False if the pager is not installed.
fn paged(text: &str) -> bool {
    let chosen = std::env::var("PAGER")
        .ok()
        .filter(|pager| !pager.trim().is_empty());
    let pager = chosen.unwrap_or_else(|| "less -R".to_owned());
    let program = pager.split_whitespace().next().unwrap_or_default();
    if !is_on_path(program) {
        return false;
    }
    let mut command = Command::new("sh");
    command.arg("-c").arg(&pager).stdin(Stdio::piped());
    if std::env::var_os("LESS").is_none() {
        command.env("LESS", "FRX");
    }
    let Ok(mut child) = command.spawn() else {
        return false;
    };
    if let Some(mut input) = child.stdin.take() {
        // A reader may close the pager early.
        let _closed_early = writeln!(input, "{text}");
    }
    child.wait().is_ok()
}

fn is_on_path(program: &str) -> bool {
    if program.contains('/') {
        return Path::new(program).is_file();
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join(program).is_file())
}

/// Writes the web pages. A folder with other files is refused, so that no file is replaced.
fn write_manual(folder: &Path) -> anyhow::Result<Exit> {
    let files = guide::manual();
    let old = files_of_a_manual(folder);
    if let Some(name) = other_file(folder, &old)? {
        anyhow::bail!(
            "--html {}: the folder has another file, `{name}`: choose a new folder, or one with an earlier manual",
            folder.display()
        );
    }
    let place = || format!("--html {}: the manual cannot be written", folder.display());
    fs::create_dir_all(folder).with_context(place)?;
    for name in old
        .iter()
        .filter(|name| !files.iter().any(|file| file.name == **name))
    {
        // A page that the guide no longer has; a missing file is not an error.
        let _gone = fs::remove_file(folder.join(name));
    }
    for file in &files {
        fs::write(folder.join(&file.name), &file.text).with_context(place)?;
    }
    tell(format_args!(
        "{} pages written: open {}",
        PAGES.len() + 1,
        folder.join("index.html").display()
    ));
    Ok(Exit::Done)
}

/// The names of the files that an earlier manual wrote here.
fn files_of_a_manual(folder: &Path) -> Vec<String> {
    let list = fs::read_to_string(folder.join(MANUAL_LIST)).unwrap_or_default();
    let names = list.lines().skip(1).filter(|name| is_plain(name));
    names.map(str::to_owned).collect()
}

/// True for a name without a folder.
fn is_plain(name: &str) -> bool {
    !name.is_empty() && !name.starts_with('.') && !name.contains('/')
}

/// The first file of the folder that no earlier manual wrote.
fn other_file(folder: &Path, old: &[String]) -> anyhow::Result<Option<String>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => {
            return Err(error).with_context(|| format!("--html {}", folder.display()));
        }
    };
    let mut others = Vec::new();
    for entry in entries {
        let name = entry?.file_name().to_string_lossy().into_owned();
        if !old.contains(&name) {
            others.push(name);
        }
    }
    others.sort();
    Ok(others.into_iter().next())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_is_a_page_whatever_its_hyphens() {
        assert!(text_of("first-test").unwrap().starts_with("# "));
        assert_eq!(text_of("Real_Time").unwrap(), text_of("real-time").unwrap());
    }

    #[test]
    fn unknown_topic_names_the_nearest_one() {
        let error = text_of("trouble-shooting").unwrap_err();
        assert_eq!(super::super::exit::of(&error), Exit::Usage);
        assert!(error.to_string().contains("`troubleshooting`"), "{error}");
    }

    #[test]
    fn any_word_of_the_guide_is_found() {
        for (word, topic) in [
            ("emergency", "real-specimen"),
            ("simulink", "opensees"),
            ("labview", "real-specimen"),
            ("MTS", "scope"),
            ("abort", "scope"),
            ("plastic hinge", "scope"),
            ("damper", "specimen.law.power_damper"),
            ("friction", "specimen.law.smooth_friction"),
            ("P-Delta", "scope"),
            ("pseudodynamic", "scope"),
            ("two components", "scope"),
        ] {
            let text = text_of(word).unwrap();
            assert!(
                text.contains(&format!("`gusset guide {topic}`")),
                "{word}: {text}"
            );
        }
    }

    #[test]
    fn unrelated_key_is_not_suggested() {
        for word in ["abrot", "xyzzyx", "smilunk"] {
            let error = text_of(word).unwrap_err();
            assert_eq!(super::super::exit::of(&error), Exit::Usage);
            assert!(!error.to_string().contains("did you mean"), "{error}");
        }
    }

    #[test]
    fn manual_overwrites_only_its_own_files() {
        let temp = tempfile::tempdir().unwrap();
        let folder = temp.path().join("manual");
        assert_eq!(write_manual(&folder).unwrap(), Exit::Done);
        assert!(folder.join("index.html").is_file());
        assert_eq!(write_manual(&folder).unwrap(), Exit::Done);
        fs::write(folder.join("notes.txt"), "mine").unwrap();
        let error = write_manual(&folder).unwrap_err();
        assert_eq!(super::super::exit::of(&error), Exit::Usage);
        assert!(error.to_string().contains("notes.txt"), "{error}");
    }
}
