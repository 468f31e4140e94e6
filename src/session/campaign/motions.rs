//! Ground motions of a study, and the overrides that choose and scale them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fs, io};

use super::CampaignError;
use gusset_config::{Finding, InputStore, Inputs, Intensity, KeyPath, LoadedStudy, RecordsTable};
use gusset_motion::{FileSignal, Quantity, ReadOptions, Resample, Signal, Unit, parse_record};

/// Remedy for a file that is not an acceleration.
const LEAVE_OUT: &str = "convert it, or leave it out: list the records as `files`, or choose those of a folder with \
                         `pattern`, for example pattern = \"*.AT2\"";

/// One motion: its name, its file, the overrides that choose it, and the digest of its file.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub name: String,
    pub sets: Vec<String>,
    pub digest: String,
}

/// The motions of one table, each scaled to each level.
#[derive(Debug, Clone)]
pub(super) struct Motions {
    pub motions: Vec<Motion>,
    pub levels: Vec<f64>,
    /// Key of the only component of the test, or of the first.
    ground: String,
    scale: Scale,
}

/// How motions are scaled.
#[derive(Debug, Clone, Copy)]
struct Scale {
    intensity: Intensity,
    unit: Option<Unit>,
    period_s: f64,
    damping_ratio: f64,
}

impl Motions {
    /// Number of motions, each level counted.
    pub(crate) fn count(&self) -> u64 {
        self.motions.len() as u64 * self.levels.len().max(1) as u64
    }

    /// The motion and level at `index`; the level varies fastest.
    pub(crate) fn at(&self, index: u64) -> Option<(&Motion, Option<f64>)> {
        let levels = self.levels.len().max(1) as u64;
        let motion = self.motions.get((index / levels) as usize)?;
        Some((motion, self.levels.get((index % levels) as usize).copied()))
    }

    /// The override that scales a motion to `level`.
    pub(crate) fn scaled(&self, level: f64) -> String {
        let unit = self.unit();
        let Scale {
            period_s,
            damping_ratio,
            ..
        } = self.scale;
        let ground = &self.ground;
        match self.scale.intensity.of_pair() {
            Some(_) => format!(
                "excitation.scaling={{target=\"{}\",period_s={period_s:?},value={level:?},unit=\"{unit}\"}}",
                spelled(self.scale.intensity)
            ),
            None if self.scale.intensity == Intensity::Pga => {
                format!("{ground}.processing.target_peak={{value={level:?},unit=\"{unit}\"}}")
            }
            None => format!(
                "{ground}.processing.target_sa={{period_s={period_s:?},damping_ratio={damping_ratio:?},value={level:?},\
                 unit=\"{unit}\"}}"
            ),
        }
    }

    /// Unit of the levels as files spell it.
    pub(crate) fn unit(&self) -> String {
        let unit = self.scale.unit.map(spelled);
        unit.unwrap_or_else(|| "m/s2".to_owned())
    }

    /// The measure of intensity in words.
    pub(crate) fn words(&self) -> String {
        if let Some(measure) = self.scale.intensity.of_pair() {
            return format!("{}({:.3} s)", measure.words(), self.scale.period_s);
        }
        match self.scale.intensity {
            Intensity::Pga => "peak ground acceleration".to_owned(),
            _ => {
                // Twelve digits hide the rounding of the factor.
                let percent = (1e14 * self.scale.damping_ratio).round() / 1e12;
                format!("Sa({:.3} s, {percent} %)", self.scale.period_s)
            }
        }
    }
}

/// A word as files spell it.
fn spelled(word: impl serde::Serialize) -> String {
    let value = serde_json::to_value(word).ok();
    let text = value.as_ref().and_then(serde_json::Value::as_str);
    text.unwrap_or_default().to_owned()
}

/// The motions of each table of a study. `first_period` is that of the structure of the test.
pub(super) fn motions(
    loaded: &LoadedStudy,
    store: &Arc<InputStore>,
    first_period: Option<f64>,
) -> Result<Vec<Motions>, CampaignError> {
    let excitation = &loaded.test.file.excitation;
    let grounds = &excitation.ground_acceleration;
    let at = KeyPath::root().key("excitation");
    let key_of = |component: usize| grounds.place(&at, component).to_string();
    let mut all = Vec::new();
    for (index, table) in loaded.study.records.iter().enumerate() {
        let place = KeyPath::root().key("records").index(index);
        let refuse = |text: &str| loaded.refuse(Finding::error(place.clone(), text));
        let Some(ground) = grounds.all().first() else {
            let text = "`records` needs a test with `excitation.ground_acceleration`";
            return Err(refuse(text).into());
        };
        let wanted = if table.components.is_some() { 2 } else { 1 };
        if grounds.all().len() != wanted {
            let text = match wanted {
                1 => {
                    "the ground acceleration of the test has several components: give `components`"
                }
                _ => "`components` needs a test whose ground acceleration has two components",
            };
            return Err(refuse(text).into());
        }
        let is_scaled = grounds.all().iter().any(|ground| {
            ground.processing.target_sa.is_some() || ground.processing.target_peak.is_some()
        });
        if (is_scaled || excitation.scaling.is_some()) && !table.levels().is_empty() {
            let text = "the test file scales the motion already: remove its `target_peak`, `target_sa` or `scaling`";
            return Err(refuse(text).into());
        }
        let has_ways = grounds.all().iter().any(|ground| match &ground.signal {
            Signal::File(file) => has_own_ways(file),
            _ => false,
        });
        if table.synthetic.is_none() && has_ways {
            let text = "the records of a study are read with their own time step and columns, and begin at 0 s";
            let finding = Finding::error(place, text);
            let help = "keep only `path` and `unit` in the `signal.file` of the test file, and convert the records if necessary";
            return Err(loaded.refuse(finding.help(help)).into());
        }
        let period_s = match (table.intensity, table.period_s, first_period) {
            (Intensity::Pga, ..) => 0.0,
            (_, Some(period), _) | (_, None, Some(period)) => period,
            (_, None, None) => {
                return Err(refuse("this test has no first period: give `period_s`").into());
            }
        };
        let motions = match &table.synthetic {
            Some(synthetic) => {
                let kind = match &ground.signal {
                    Signal::KanaiTajimi(_) => "kanai_tajimi",
                    Signal::BandLimitedNoise(_) => "band_limited_noise",
                    _ => {
                        let text = "`synthetic` needs a test with the signal `kanai_tajimi` or `band_limited_noise`";
                        return Err(refuse(text).into());
                    }
                };
                let seeds = (0..synthetic.count).map(|i| synthetic.seed.wrapping_add(i));
                let motion = |seed: u64| Motion {
                    name: format!("seed-{seed}"),
                    sets: vec![format!("{}.signal.{kind}.seed={seed}", key_of(0))],
                    digest: String::new(),
                };
                seeds.map(motion).collect()
            }
            None => {
                let keys: Vec<String> = (0..grounds.all().len()).map(key_of).collect();
                files(loaded, store, table, &place, &keys)?
            }
        };
        all.push(Motions {
            motions,
            levels: table.levels(),
            ground: key_of(0),
            scale: Scale {
                intensity: table.intensity,
                unit: table.unit,
                period_s,
                damping_ratio: table.damping_ratio.unwrap_or(0.05),
            },
        });
    }
    Ok(all)
}

/// Files of one record, and the key of the study that names them.
type Files = (KeyPath, Vec<String>);

/// The records of a table, with the digests of their files. Each record is read once. `keys` are those of the components of the
/// test.
fn files(
    loaded: &LoadedStudy,
    store: &Arc<InputStore>,
    table: &RecordsTable,
    place: &KeyPath,
    keys: &[String],
) -> Result<Vec<Motion>, CampaignError> {
    let chosen: Vec<Files> = match (&table.files, &table.folder) {
        (Some(files), _) => {
            let at = |index| place.key("files").index(index);
            let files = files.iter().enumerate();
            files
                .map(|(index, file)| (at(index), vec![file.clone()]))
                .collect()
        }
        (None, Some(name)) => of_folder(loaded, table, name, place)?,
        (None, None) => Vec::new(),
    };
    let mut inputs = Inputs::new(loaded.folder()).with_store(Some(Arc::clone(store)));
    let mut motions: Vec<Motion> = Vec::with_capacity(chosen.len());
    for (at, names) in chosen {
        let mut digests = Vec::new();
        let mut motion = Motion {
            name: String::new(),
            sets: Vec::new(),
            digest: String::new(),
        };
        let mut paths = Vec::new();
        for (name, key) in names.iter().zip(keys) {
            let (full, set, digest) =
                record(loaded, table, &mut inputs, (at.clone(), name.as_str()), key)?;
            // Tasks ask for the full path.
            store.read(&full).map_err(super::at(&full))?;
            motion.sets.push(set);
            digests.push(digest);
            paths.push(full);
        }
        motion.name = unique_name(&paths, &motions);
        motion.digest = match digests.as_slice() {
            [one] => one.clone(),
            several => blake3::hash(several.concat().as_bytes())
                .to_hex()
                .to_string(),
        };
        motions.push(motion);
    }
    Ok(motions)
}

/// The records of a folder, or pairs of them.
fn of_folder(
    loaded: &LoadedStudy,
    table: &RecordsTable,
    name: &str,
    place: &KeyPath,
) -> Result<Vec<Files>, CampaignError> {
    let at = place.key("folder");
    let found = listed(&loaded.folder().join(name)).map_err(|error| {
        let text = format!("cannot read the folder {name}: {error}");
        let finding = Finding::error(at.clone(), text).label("a folder of records is wanted");
        loaded.refuse(finding.help("the path is relative to the folder of the study"))
    })?;
    let path = |file: &String| format!("{name}/{file}");
    let (chosen, words): (Vec<Vec<String>>, _) = match (&table.components, &table.pattern) {
        (Some(patterns), _) => {
            let pairs = pairs(&found, patterns).map_err(|alone| {
                let [file, partner] = alone;
                let text = format!(
                    "the record {name}/{file} has no partner: the folder has no file {partner}"
                );
                let finding = Finding::error(place.key("components"), text);
                loaded.refuse(finding.help("add the file, or choose others with `components`"))
            })?;
            let pairs = pairs.iter().map(|pair| pair.iter().map(path).collect());
            let words = format!("pairs with names like {} and {}", patterns[0], patterns[1]);
            (pairs.collect(), words)
        }
        (None, pattern) => {
            let wanted = pattern.as_deref().unwrap_or("*");
            let found = found.iter().filter(|file| fits(wanted, file));
            let words = match pattern {
                Some(pattern) => format!("records with a name like {pattern}"),
                None => "records".to_owned(),
            };
            (found.map(|file| vec![path(file)]).collect(), words)
        }
    };
    if chosen.is_empty() {
        let text = format!("the folder {name} contains no {words}");
        return Err(loaded.refuse(Finding::error(at, text)).into());
    }
    Ok(chosen
        .into_iter()
        .map(|files| (at.clone(), files))
        .collect())
}

/// Files whose names fit both patterns with equal letters for `*`. An error holds a file and the name of its missing partner.
fn pairs(found: &[String], patterns: &[String; 2]) -> Result<Vec<[String; 2]>, [String; 2]> {
    let mut pairs = Vec::new();
    for file in found {
        for (own, other) in [(0, 1), (1, 0)] {
            // The second pattern may fit a file of the first too: the one with fewer free letters decides.
            let Some(shared) = shared(&patterns[own], file) else {
                continue;
            };
            let is_of_other = |theirs: &str| theirs.chars().count() < shared.chars().count();
            if self::shared(&patterns[other], file).is_some_and(|theirs| is_of_other(&theirs)) {
                continue;
            }
            let partner = patterns[other].replacen('*', &shared, 1);
            let known = found
                .iter()
                .find(|name| name.to_lowercase() == partner.to_lowercase());
            match known {
                Some(known) if own == 0 => pairs.push([file.clone(), known.clone()]),
                Some(_) => {}
                None => return Err([file.clone(), partner]),
            }
        }
    }
    Ok(pairs)
}

/// The letters of a name in place of the only `*` of a pattern; upper and lower case are alike.
fn shared(pattern: &str, name: &str) -> Option<String> {
    let (start, end) = pattern.split_once('*')?;
    let letters: Vec<char> = name.chars().collect();
    let (first, last) = (start.chars().count(), end.chars().count());
    let middle = letters.get(first..letters.len().checked_sub(last)?)?;
    let is = |part: &[char], wanted: &str| {
        part.iter().collect::<String>().to_lowercase() == wanted.to_lowercase()
    };
    let fits = is(&letters[..first], start) && is(&letters[letters.len() - last..], end);
    fits.then(|| middle.iter().collect())
}

/// Name of a record in the table: that of its file, with folders where another record has the same. The second file of a pair follows.
fn unique_name(paths: &[PathBuf], others: &[Motion]) -> String {
    let [full, partners @ ..] = paths else {
        return String::new();
    };
    let file = |path: &PathBuf| {
        path.file_name()
            .map(|name| name.to_string_lossy().into_owned())
    };
    let partners = partners.iter().filter_map(file);
    let partners: String = partners.map(|name| format!(" + {name}")).collect();
    let parts: Vec<_> = full.iter().map(|part| part.to_string_lossy()).collect();
    let names = (1..=parts.len()).map(|count| parts[parts.len() - count..].join("/") + &partners);
    let mut names = names.filter(|name| others.iter().all(|other| other.name != *name));
    names.next().unwrap_or_else(|| full.display().to_string())
}

/// True if keys of the test file decide how its record is read: they do not hold for the records of a study.
fn has_own_ways(file: &FileSignal) -> bool {
    let plain = FileSignal {
        path: file.path.clone(),
        format: None,
        column: None,
        time_column: None,
        skip_rows: 0,
        dt_s: None,
        unit: file.unit,
        resample: Resample::default(),
        start_s: 0.0,
    };
    *file != plain
}

/// The record `name`, which the study names at `at`: its full path, the override that puts it into the component with this key,
/// and its digest.
fn record(
    loaded: &LoadedStudy,
    table: &RecordsTable,
    inputs: &mut Inputs,
    (at, name): (KeyPath, &str),
    key: &str,
) -> Result<(PathBuf, String, String), CampaignError> {
    let bytes = inputs
        .read(name)
        .map_err(|error| loaded.refuse(error.finding(at.clone())))?;
    let digest = blake3::hash(bytes).to_hex().to_string();
    let record = parse_record(name, bytes, &ReadOptions::default()).map_err(|error| {
        let finding = Finding::error(at.clone(), format!("{name} is no record: {error}"));
        loaded.refuse(finding.help(LEAVE_OUT))
    })?;
    if let Some(what) = other_quantity(name, record.unit) {
        let finding = Finding::error(at, format!("{name} is no acceleration: {what}"));
        return Err(loaded.refuse(finding.help(LEAVE_OUT)).into());
    }
    if table.record_unit.or(record.unit).is_none() {
        let finding = Finding::error(at, format!("the record {name} has no unit"));
        return Err(loaded
            .refuse(finding.help("for example record_unit = \"g\""))
            .into());
    }
    let path = loaded.folder().join(name);
    let full = fs::canonicalize(&path).map_err(super::at(&path))?;
    let quoted = toml::Value::from(full.to_string_lossy().as_ref());
    let unit = table.record_unit.map(|unit| format!(",unit=\"{unit}\""));
    let unit = unit.unwrap_or_default();
    let set = format!("{key}.signal={{file={{path={quoted}{unit}}}}}");
    Ok((full, set, digest))
}

/// Evidence that a record is not an acceleration: its stated unit, or the ending of a PEER file.
fn other_quantity(name: &str, unit: Option<Unit>) -> Option<String> {
    if let Some(unit) = unit {
        let is_other = unit.quantity() != Quantity::Acceleration;
        return is_other.then(|| format!("the file states the unit {unit}"));
    }
    let ending = Path::new(name).extension()?.to_ascii_lowercase();
    match ending.to_str()? {
        "vt2" => Some("a VT2 file has velocities".to_owned()),
        "dt2" => Some("a DT2 file has displacements".to_owned()),
        _ => None,
    }
}

/// True if a name fits a pattern: `*` fits any characters, `?` one. Upper and lower case are alike.
fn fits(pattern: &str, name: &str) -> bool {
    let [pattern, name] =
        [pattern, name].map(|text| text.to_lowercase().chars().collect::<Vec<char>>());
    let (mut at, mut place) = (0, 0);
    // The last `*`, and the end of its characters.
    let mut star: Option<(usize, usize)> = None;
    while place < name.len() {
        match pattern.get(at) {
            Some('*') => {
                star = Some((at, place));
                at += 1;
            }
            Some(letter) if *letter == '?' || *letter == name[place] => {
                (at, place) = (at + 1, place + 1);
            }
            _ => {
                let Some((last, reached)) = star else {
                    return false;
                };
                star = Some((last, reached + 1));
                (at, place) = (last + 1, reached + 1);
            }
        }
    }
    pattern[at..].iter().all(|letter| *letter == '*')
}

/// Names of the files of a folder that are not hidden, sorted.
fn listed(folder: &Path) -> io::Result<Vec<String>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let name = name.filter(|name| !name.starts_with('.') && path.is_file());
        found.extend(name);
    }
    found.sort();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_share_the_letters_of_a_star() {
        let patterns = ["*H1.AT2", "*H2.AT2"].map(str::to_owned);
        let named = |names: &[&str]| {
            names
                .iter()
                .map(|name| (*name).to_owned())
                .collect::<Vec<_>>()
        };
        let found = named(&["A-H1.AT2", "A-H2.AT2", "A-UP.AT2", "b-h1.at2", "B-H2.at2"]);
        let expected = [["A-H1.AT2", "A-H2.AT2"], ["b-h1.at2", "B-H2.at2"]];
        assert_eq!(pairs(&found, &patterns).unwrap(), expected);
        for alone in ["C-H1.AT2", "C-H2.AT2"] {
            let lonely = pairs(&named(&["A-H1.AT2", "A-H2.AT2", alone]), &patterns);
            let [file, partner] = lonely.unwrap_err();
            assert_eq!(file, alone);
            assert!(partner.starts_with("C-H") && partner != alone);
        }
        // A pattern that fits the files of both: the other fits with fewer letters.
        let nested = ["*.AT2", "*-2.AT2"].map(str::to_owned);
        let both = named(&["a-2.AT2", "a.AT2"]);
        assert_eq!(pairs(&both, &nested).unwrap(), [["a.AT2", "a-2.AT2"]]);
    }

    #[test]
    fn a_pattern_chooses_names() {
        for (pattern, name, expected) in [
            ("*.AT2", "RSN1_A-000.AT2", true),
            ("*.AT2", "rsn1.at2", true),
            ("*.AT2", "RSN1.VT2", false),
            ("*.AT2", "a.AT2.txt", false),
            ("a?.csv", "ab.csv", true),
            ("a?.csv", "a.csv", false),
            ("*a*b*", "xxaxxabx", true),
            ("*ab", "aab", true),
            ("*", "", true),
            ("", "a", false),
            ("*é?", "É1", true),
        ] {
            assert_eq!(fits(pattern, name), expected, "{pattern} {name}");
        }
    }
}
