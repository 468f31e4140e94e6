//! Result parts: text files with one line for each task and a digest at the end.
//!
//! Numbers are written as the hexadecimal digits of their bits. A part that was cut short has no valid digest and does not
//! count: its tasks are computed again.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use super::perform::Performed;
use super::{CampaignError, at};
use gusset_config::read_input;
use gusset_record::atomic;

/// First words of a part, before the identity of its campaign.
const HEAD: &str = "gusset campaign part 2 ";
/// Folder of the parts.
pub(super) const FOLDER: &str = "parts";

/// One line of a part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Line {
    /// Number of the task, from 0.
    pub index: u64,
    /// Its identity.
    pub identity: String,
    /// Its result.
    pub result: Performed,
}

/// Results by task, with the name of the part of each.
pub(super) type Lines = BTreeMap<u64, (Line, String)>;

/// Parts of one chunk.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// Results by task, with the name of the part of each.
    pub lines: Lines,
    /// Names of parts that were cut short.
    pub damaged: Vec<String>,
    /// Parts of another campaign.
    pub foreign: Vec<PathBuf>,
}

/// Writes the lines of a part of chunk `chunk` of the campaign `own`: first under a temporary name, then renamed.
pub(super) fn write(
    folder: &Path,
    own: &str,
    chunk: u64,
    lines: &[Line],
) -> Result<(), CampaignError> {
    let mut text = format!("{HEAD}{own}\n");
    for line in lines {
        let bits = line
            .result
            .values
            .iter()
            .map(|v| format!("{:016x}", v.to_bits()));
        let bits: Vec<String> = bits.collect();
        let (index, identity) = (line.index, &line.identity);
        let (ended, attempt) = (&line.result.ended, line.result.attempt);
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "{index}\t{identity}\t{ended}\t{attempt}\t{}",
            bits.join(",")
        );
    }
    let digest = blake3::hash(text.as_bytes()).to_hex();
    let _ = writeln!(text, "end\t{digest}");
    let parts = folder.join(FOLDER);
    fs::create_dir_all(&parts).map_err(at(&parts))?;
    let path = parts.join(format!("chunk-{chunk:06}-{}.part", &digest[..16]));
    atomic::write(&path, text.as_bytes()).map_err(at(&path))
}

/// The identity of the campaign of a part and its lines; none if it was cut short.
fn read(text: &str) -> Option<(&str, Vec<Line>)> {
    let (body, last) = text.trim_end_matches('\n').rsplit_once('\n')?;
    let digest = last.strip_prefix("end\t")?;
    let whole = &text[..=body.len()];
    if blake3::hash(whole.as_bytes()).to_hex().as_str() != digest {
        return None;
    }
    let mut lines = body.lines();
    let campaign = lines.next()?.strip_prefix(HEAD)?;
    Some((campaign, lines.map(line).collect::<Option<_>>()?))
}

fn line(text: &str) -> Option<Line> {
    let mut cells = text.split('\t');
    let mut next = || cells.next();
    let (index, identity, ended) = (next()?, next()?, next()?);
    let (attempt, bits) = (next()?.parse().ok()?, next()?);
    let values = bits.split(',').filter(|bits| !bits.is_empty());
    let values: Option<Vec<f64>> = values
        .map(|bits| Some(f64::from_bits(u64::from_str_radix(bits, 16).ok()?)))
        .collect();
    Some(Line {
        index: index.parse().ok()?,
        identity: identity.to_owned(),
        result: Performed {
            ended: ended.to_owned(),
            attempt,
            values: values?,
        },
    })
}

/// The names of all parts by chunk, in order.
pub(super) fn names(folder: &Path) -> Result<BTreeMap<u64, Vec<PathBuf>>, CampaignError> {
    let parts = folder.join(FOLDER);
    let mut found: BTreeMap<u64, Vec<PathBuf>> = BTreeMap::new();
    if !parts.exists() {
        return Ok(found);
    }
    for entry in fs::read_dir(&parts).map_err(at(&parts))? {
        let path = entry.map_err(at(&parts))?.path();
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let name = name.unwrap_or_default();
        let chunk = name
            .strip_prefix("chunk-")
            .and_then(|rest| rest.strip_suffix(".part"))
            .and_then(|rest| rest.split('-').next()?.parse().ok());
        if let Some(chunk) = chunk {
            found.entry(chunk).or_default().push(path);
        }
    }
    found.values_mut().for_each(|paths| paths.sort());
    Ok(found)
}

/// Renames a part with a wrong number: it does not count any more.
pub(super) fn set_aside(folder: &Path, part: &str) -> Result<(), CampaignError> {
    let path = folder.join(FOLDER).join(part);
    fs::rename(&path, path.with_extension("refuted")).map_err(at(&path))
}

/// Merges parts of one chunk of the campaign `own`. `expected` gives the identity of a task.
///
/// # Errors
/// [`CampaignError::Conflict`], [`CampaignError::Foreign`], or the system refuses.
pub(super) fn merge(
    paths: &[PathBuf],
    own: &str,
    expected: impl Fn(u64) -> Option<String>,
) -> Result<Parts, CampaignError> {
    let parts = merge_if(paths, own, |line| {
        expected(line.index).as_ref() == Some(&line.identity)
    })?;
    match parts.foreign.first() {
        Some(path) => Err(CampaignError::Foreign(path.display().to_string())),
        None => Ok(parts),
    }
}

/// Merges parts of one chunk of the campaign `own`. A part with another identity, or with a line that is not its own, is foreign.
///
/// # Errors
/// [`CampaignError::Conflict`], or the system refuses.
pub(super) fn merge_if(
    paths: &[PathBuf],
    own: &str,
    is_own: impl Fn(&Line) -> bool,
) -> Result<Parts, CampaignError> {
    let mut parts = Parts::default();
    for path in paths {
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let name = name.unwrap_or_default();
        let text = String::from_utf8_lossy(&read_input(path).map_err(at(path))?).into_owned();
        let Some((campaign, lines)) = read(&text) else {
            parts.damaged.push(name);
            continue;
        };
        if campaign != own || !lines.iter().all(&is_own) {
            parts.foreign.push(path.clone());
            continue;
        }
        for line in lines {
            match parts.lines.get(&line.index) {
                Some((known, _)) if known.result.is_same(&line.result) => {}
                Some((_, other)) => {
                    return Err(CampaignError::Conflict {
                        task: line.index + 1,
                        one: other.clone(),
                        other: name,
                    });
                }
                None => {
                    parts.lines.insert(line.index, (line, name.clone()));
                }
            }
        }
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(value: f64) -> Line {
        Line {
            index: 3,
            identity: "ab".to_owned(),
            result: Performed {
                ended: "done".to_owned(),
                attempt: 2,
                values: vec![value, f64::NAN, -0.0],
            },
        }
    }

    fn all(folder: &Path) -> Result<Parts, CampaignError> {
        let names = names(folder).unwrap();
        merge(&names[&7], "own", |_| Some("ab".to_owned()))
    }

    #[test]
    fn part_returns_every_bit() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "own", 7, &[sample(0.1)]).unwrap();
        let parts = all(folder.path()).unwrap();
        assert!(parts.lines[&3].0.result.is_same(&sample(0.1).result));
        let path = &names(folder.path()).unwrap()[&7][0];
        let bytes = fs::read(path).unwrap();
        for length in [0, 10, bytes.len() / 2, bytes.len() - 2] {
            fs::write(path, &bytes[..length]).unwrap();
            let parts = all(folder.path()).unwrap();
            assert!(parts.lines.is_empty(), "{length} bytes");
            assert_eq!(parts.damaged.len(), 1);
        }
    }

    #[test]
    fn equal_results_merge_others_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "own", 7, &[sample(0.1)]).unwrap();
        let more = Line {
            index: 4,
            ..sample(0.2)
        };
        write(folder.path(), "own", 7, &[sample(0.1), more]).unwrap();
        assert_eq!(all(folder.path()).unwrap().lines.len(), 2);
        write(folder.path(), "own", 7, &[sample(0.1_f64.next_up())]).unwrap();
        let error = all(folder.path()).unwrap_err();
        assert!(matches!(error, CampaignError::Conflict { task: 4, .. }));
    }

    #[test]
    fn a_part_of_another_campaign_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "own", 7, &[sample(0.1)]).unwrap();
        let names = names(folder.path()).unwrap();
        for (own, identity) in [("own", "cd"), ("other", "ab")] {
            let error = merge(&names[&7], own, |_| Some(identity.to_owned())).unwrap_err();
            assert!(matches!(error, CampaignError::Foreign(_)));
        }
    }
}
