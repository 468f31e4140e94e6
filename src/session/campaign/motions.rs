//! Ground motions of a study, and the overrides that choose and scale them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fs, io};

use super::CampaignError;
use gusset_config::{Finding, InputStore, Inputs, Intensity, KeyPath, LoadedStudy, RecordsTable};
use gusset_motion::{FileSignal, Quantity, ReadOptions, Resample, Signal, Unit, parse_record};

const GROUND: &str = "excitation.ground_acceleration";
/// Remedy for a file that is not an acceleration.
const LEAVE_OUT: &str = "convert it, or leave it out: list the records as `files`, or choose those of a folder with \
                         `pattern`, for example pattern = \"*.AT2\"";

/// One motion: its name, its file, the overrides that choose it, and the digest of its file.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    pub name: String,
    /// Full path of its record; empty for a synthetic motion.
    pub full: PathBuf,
    pub sets: Vec<String>,
    pub digest: String,
}

/// The motions of one table, each scaled to each level.
#[derive(Debug, Clone)]
pub(super) struct Motions {
    pub motions: Vec<Motion>,
    pub levels: Vec<f64>,
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
        match self.scale.intensity {
            Intensity::Pga => {
                format!("{GROUND}.processing.target_peak={{value={level:?},unit=\"{unit}\"}}")
            }
            Intensity::Sa => format!(
                "{GROUND}.processing.target_sa={{period_s={period_s:?},damping_ratio={damping_ratio:?},value={level:?},\
                 unit=\"{unit}\"}}"
            ),
        }
    }

    /// Unit of the levels as files spell it.
    pub(crate) fn unit(&self) -> String {
        let unit = self
            .scale
            .unit
            .and_then(|unit| serde_json::to_value(unit).ok());
        unit.and_then(|unit| unit.as_str().map(str::to_owned))
            .unwrap_or_else(|| "m/s2".to_owned())
    }

    /// The measure of intensity in words.
    pub(crate) fn words(&self) -> String {
        match self.scale.intensity {
            Intensity::Pga => "peak ground acceleration".to_owned(),
            Intensity::Sa => {
                // Twelve digits hide the rounding of the factor.
                let percent = (1e14 * self.scale.damping_ratio).round() / 1e12;
                format!("Sa({:.3} s, {percent} %)", self.scale.period_s)
            }
        }
    }
}

/// The motions of each table of a study. `first_period` is that of the structure of the test.
pub(super) fn motions(
    loaded: &LoadedStudy,
    store: &Arc<InputStore>,
    first_period: Option<f64>,
) -> Result<Vec<Motions>, CampaignError> {
    let ground = loaded.test.file.excitation.ground_acceleration.as_ref();
    let mut all = Vec::new();
    for (index, table) in loaded.study.records.iter().enumerate() {
        let place = KeyPath::root().key("records").index(index);
        let refuse = |text: &str| loaded.refuse(Finding::error(place.clone(), text));
        let Some(ground) = ground else {
            let text = "`records` needs a test with `excitation.ground_acceleration`";
            return Err(refuse(text).into());
        };
        let is_scaled =
            ground.processing.target_sa.is_some() || ground.processing.target_peak.is_some();
        if is_scaled && !table.levels().is_empty() {
            let text =
                "the test file scales the motion already: remove its `target_peak` or `target_sa`";
            return Err(refuse(text).into());
        }
        if let Signal::File(file) = &ground.signal
            && table.synthetic.is_none()
            && has_own_ways(file)
        {
            let text = "the records of a study are read with their own time step and columns, and begin at 0 s";
            let finding = Finding::error(place, text);
            let help = "keep only `path` and `unit` in the `signal.file` of the test file, and convert the records if necessary";
            return Err(loaded.refuse(finding.help(help)).into());
        }
        let period_s = match (table.intensity, table.period_s, first_period) {
            (Intensity::Pga, ..) => 0.0,
            (_, Some(period), _) | (_, None, Some(period)) => period,
            (Intensity::Sa, None, None) => {
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
                    sets: vec![format!("{GROUND}.signal.{kind}.seed={seed}")],
                    full: PathBuf::new(),
                    digest: String::new(),
                };
                seeds.map(motion).collect()
            }
            None => files(loaded, store, table, &place)?,
        };
        all.push(Motions {
            motions,
            levels: table.levels(),
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

/// The records of a table, with the digests of their files. Each record is read once.
fn files(
    loaded: &LoadedStudy,
    store: &Arc<InputStore>,
    table: &RecordsTable,
    place: &KeyPath,
) -> Result<Vec<Motion>, CampaignError> {
    let names: Vec<(KeyPath, String)> = match (&table.files, &table.folder) {
        (Some(files), _) => {
            let at = |index| place.key("files").index(index);
            let files = files.iter().enumerate();
            files
                .map(|(index, file)| (at(index), file.clone()))
                .collect()
        }
        (None, Some(name)) => {
            let at = place.key("folder");
            let found = listed(&loaded.folder().join(name)).map_err(|error| {
                let text = format!("cannot read the folder {name}: {error}");
                let finding =
                    Finding::error(at.clone(), text).label("a folder of records is wanted");
                loaded.refuse(finding.help("the path is relative to the folder of the study"))
            })?;
            let pattern = table.pattern.as_deref().unwrap_or("*");
            let found: Vec<String> = found
                .into_iter()
                .filter(|file| fits(pattern, file))
                .collect();
            if found.is_empty() {
                let of = match &table.pattern {
                    Some(pattern) => format!(" with a name like {pattern}"),
                    None => String::new(),
                };
                let text = format!("the folder {name} contains no records{of}");
                return Err(loaded.refuse(Finding::error(at, text)).into());
            }
            let path = |file: String| format!("{name}/{file}");
            found
                .into_iter()
                .map(|file| (at.clone(), path(file)))
                .collect()
        }
        (None, None) => Vec::new(),
    };
    let mut inputs = Inputs::new(loaded.folder()).with_store(Some(Arc::clone(store)));
    let mut motions: Vec<Motion> = Vec::with_capacity(names.len());
    for (at, name) in names {
        let mut motion = motion(loaded, table, &mut inputs, (at, &name))?;
        // Tasks ask for the full path.
        store.read(&motion.full).map_err(super::at(&motion.full))?;
        motion.name = unique_name(&motion.full, &motions);
        motions.push(motion);
    }
    Ok(motions)
}

/// Name of a record in the table: that of its file, with folders where another record has the same.
fn unique_name(full: &Path, others: &[Motion]) -> String {
    let parts: Vec<_> = full.iter().map(|part| part.to_string_lossy()).collect();
    let names = (1..=parts.len()).map(|count| parts[parts.len() - count..].join("/"));
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

/// The record `name`, which the study names at `at`.
fn motion(
    loaded: &LoadedStudy,
    table: &RecordsTable,
    inputs: &mut Inputs,
    (at, name): (KeyPath, &str),
) -> Result<Motion, CampaignError> {
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
    let sets = vec![format!("{GROUND}.signal={{file={{path={quoted}{unit}}}}}")];
    Ok(Motion {
        name: String::new(),
        full,
        sets,
        digest,
    })
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
