//! The study file of `gusset campaign`: a test file, and tables of the varied keys and the measures.
//!
//! A study names its test file with `test`, or contains the tables of the test itself.

use std::path::{Path, PathBuf};

use super::campaign_table::OWN;
use super::campaign_table::{Intensity, MOST_VALUES, RecordsTable, SpanTable, StudyFile};
use super::check::check_samples;
use super::document::{Datum, KeyPath, Node};
use super::{ConfigError, Diagnostics, Finding, Loaded, Locator, Purpose, Severity};
use super::{judge, open, parse, read_text};
use gusset_motion::Quantity;

/// A study that has been read and checked.
#[derive(Debug, Clone)]
pub struct LoadedStudy {
    /// Where it was read from.
    pub path: PathBuf,
    /// The study as given, byte for byte.
    pub text: String,
    /// Its own tables.
    pub study: StudyFile,
    /// The test.
    pub test: Loaded,
    /// Position of each key in the study.
    pub locator: Locator,
}

impl LoadedStudy {
    /// Folder to which paths of the study are relative.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// A finding of a later module as an error with its place.
    #[must_use]
    pub fn refuse(&self, finding: Finding) -> ConfigError {
        self.locator.refusal(finding)
    }
}

/// Reads a study and its test file.
///
/// # Errors
/// [`ConfigError`]: a file cannot be read, or everything that is wrong with it.
pub fn load_study(path: &Path) -> Result<LoadedStudy, ConfigError> {
    parse_study(path, read_text(path)?)
}

/// [`load_study`] for a text that is already in memory; `path` names it and is the origin of relative paths.
///
/// # Errors
/// As [`load_study`].
pub(crate) fn parse_study(path: &Path, text: String) -> Result<LoadedStudy, ConfigError> {
    let opened = open(Purpose::Run, path, text.clone(), &[])?;
    let locator = opened.locator;
    let (own, rest) = divided(&opened.root);
    let (study, mut findings) = judge::<StudyFile>(&own, check_study);
    let is_in_other_file = own.find(&KeyPath::root().key("test")).is_some();
    if is_in_other_file && let Some((key, _)) = rest.first() {
        let text = format!("`{key}` is a table of a test, but `test` names another file");
        let finding = Finding::error(KeyPath::root().key(key), text).at_key();
        findings.push(finding.help("write it into the test file, or remove `test`"));
    }
    let (errors, _) = findings
        .into_iter()
        .map(|finding| locator.diagnose(finding))
        .partition::<Vec<_>, _>(|one| one.severity == Severity::Error);
    let Some(study) = study.filter(|_| errors.is_empty()) else {
        return Err(ConfigError::Invalid(Diagnostics(errors)));
    };
    let test = match &study.test {
        Some(name) => {
            let of_test = path.parent().unwrap_or(Path::new("")).join(name);
            super::load(&of_test, &[])?
        }
        None => parse(path, without_own_tables(&text), &[])?,
    };
    let mut wrong = check_samples(&test.file, &study.sample);
    wrong.extend(check_uncertainty(&study, &test));
    if !wrong.is_empty() {
        let wrong = wrong.into_iter().map(|finding| locator.diagnose(finding));
        return Err(ConfigError::Invalid(Diagnostics(wrong.collect())));
    }
    Ok(LoadedStudy {
        path: path.to_owned(),
        text,
        study,
        test,
        locator,
    })
}

/// The tables of the study, and the other entries of the file.
fn divided(root: &Node) -> (Node, Vec<(String, Node)>) {
    let Datum::Table(entries) = root.datum.clone() else {
        return (root.clone(), Vec::new());
    };
    let (own, rest): (Vec<_>, Vec<_>) = entries
        .into_iter()
        .partition(|(key, _)| OWN.contains(&key.as_str()));
    let own = Node {
        datum: Datum::Table(own),
        ..root.clone()
    };
    (own, rest)
}

/// The text with blanks in place of the tables of the study: every line keeps its number.
fn without_own_tables(text: &str) -> String {
    let Ok(root) = Node::parse(text) else {
        return text.to_owned();
    };
    let (_, rest) = divided(&root);
    let mut headers: Vec<(usize, bool)> = Vec::new();
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let name = line.trim_start().trim_start_matches('[').trim_start();
        let name: String = name.chars().take_while(|c| is_of_name(*c)).collect();
        if line.trim_start().starts_with('[') {
            let is_own = OWN.contains(&name.as_str());
            if is_own || rest.iter().any(|(key, _)| *key == name) {
                headers.push((at, is_own));
            }
        }
        at += line.len();
    }
    let mut out = String::with_capacity(text.len());
    let (mut at, mut blank) = (0, false);
    for line in text.split_inclusive('\n') {
        if let Some((_, is_own)) = headers.iter().find(|(start, _)| *start == at) {
            blank = *is_own;
        }
        match blank {
            true => out.push_str(if line.ends_with('\n') { "\n" } else { "" }),
            false => out.push_str(line),
        }
        at += line.len();
    }
    out
}

fn is_of_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || matches!(c, '_' | '-')
}

/// Everything that is wrong with the tables of a study.
fn check_study(file: &StudyFile) -> Vec<Finding> {
    let mut findings = Vec::new();
    let root = KeyPath::root();
    if file.campaign.replicates == 0 {
        let at = root.key("campaign").key("replicates");
        findings.push(Finding::error(at, "`replicates` must be 1 or greater"));
    }
    check_vary(file, &mut findings);
    for (index, records) in file.records.iter().enumerate() {
        let at = root.key("records").index(index);
        check_records(&at, records, &mut findings);
        check_intensity(&at, records, file, &mut findings);
    }
    for (index, height) in file.measure.storey_height_m.iter().enumerate() {
        if height.is_finite() && *height <= 0.0 {
            let at = root.key("measure").key("storey_height_m").index(index);
            findings.push(Finding::error(at, "a height must be greater than 0"));
        }
    }
    findings
}

/// The one spelling of a key: `a[1].b` and `a.1.b` are the same key.
fn current(key: &str) -> String {
    KeyPath::parse(key).map_or_else(|_| key.to_owned(), |path| path.to_string())
}

/// The keys of `vary`, their values, and keys that are given twice.
fn check_vary(file: &StudyFile, findings: &mut Vec<Finding>) {
    for (index, vary) in file.vary.iter().enumerate() {
        let at = KeyPath::root().key("vary").index(index);
        let list = vary.values.as_ref().map(Vec::len);
        check_range(&at, list, vary.linear, vary.log, true, findings);
        if let Err(error) = KeyPath::parse(&vary.key) {
            let text = format!("{:?} is no dotted path: {}", vary.key, error.message);
            findings.push(Finding::error(at.key("key"), text));
        }
        let key = current(&vary.key);
        if file.vary[..index]
            .iter()
            .any(|other| current(&other.key) == key)
        {
            let text = format!("`{key}` varies twice");
            findings.push(Finding::error(at.key("key"), text).help("remove one of the two"));
        }
        if file.sample.iter().any(|other| current(&other.key) == key) {
            let text = format!("`{key}` is in `vary` and in `sample`");
            findings.push(Finding::error(at.key("key"), text).help("remove one of the two"));
        }
    }
}

/// With `sample_uncertainty`, a key of the test's `[[uncertainty]]` may not vary or be sampled by the study too.
fn check_uncertainty(study: &StudyFile, test: &Loaded) -> Vec<Finding> {
    if !study.campaign.sample_uncertainty {
        return Vec::new();
    }
    let uncertain = test.uncertain();
    let keys: Vec<String> = uncertain.iter().map(|one| one.key.to_string()).collect();
    let vary = study.vary.iter().map(|one| one.key.as_str());
    let sample = study.sample.iter().map(|one| one.key.as_str());
    let own: [(&str, Vec<&str>); 2] = [("vary", vary.collect()), ("sample", sample.collect())];
    let mut findings = Vec::new();
    for (table, all) in own {
        for (index, key) in all.into_iter().enumerate() {
            let key = current(key);
            if keys.contains(&key) {
                let text = format!("`{key}` is in `{table}` and in `uncertainty` of the test");
                let at = KeyPath::root().key(table).index(index).key("key");
                let help = "remove it here, or set campaign.sample_uncertainty = false";
                findings.push(Finding::error(at, text).help(help));
            }
        }
    }
    findings
}

fn check_records(at: &KeyPath, records: &RecordsTable, findings: &mut Vec<Finding>) {
    let given = [
        records.folder.is_some(),
        records.files.is_some(),
        records.synthetic.is_some(),
    ];
    if given.iter().filter(|given| **given).count() != 1 {
        let text = "`records` needs exactly one of `folder`, `files` and `synthetic`";
        findings.push(Finding::error(at.clone(), text));
    }
    if records.pattern.is_some() && records.folder.is_none() {
        let finding = Finding::error(at.key("pattern"), "`pattern` needs `folder`");
        findings.push(finding.at_key());
    }
    if records.files.as_ref().is_some_and(Vec::is_empty) {
        findings.push(Finding::error(at.key("files"), "`files` names no record"));
    }
    let most = 1..=MOST_VALUES as u64;
    if let Some(table) = records
        .synthetic
        .filter(|table| !most.contains(&table.count))
    {
        let at = at.key("synthetic").key("count");
        let text = format!("`{at}` is {}, but must be 1 to {MOST_VALUES}", table.count);
        findings.push(Finding::error(at, text));
    }
    let units = [("record_unit", records.record_unit), ("unit", records.unit)];
    for (key, unit) in units {
        let Some(unit) = unit.filter(|unit| unit.quantity() != Quantity::Acceleration) else {
            continue;
        };
        let text = format!("`{}` must be a unit of acceleration", at.key(key));
        let finding = Finding::error(at.key(key), text).label(format!("found {unit}"));
        findings.push(finding.help(format!("allowed: {}", Quantity::Acceleration.spellings())));
    }
    let list = records.values.as_ref().map(Vec::len);
    check_range(at, list, records.linear, records.log, false, findings);
    let has_levels = list.is_some() || records.linear.is_some() || records.log.is_some();
    if has_levels && records.unit.is_none() {
        let finding = Finding::error(at.clone(), "the levels of intensity have no unit");
        findings.push(finding.help("for example unit = \"g\""));
    }
    check_components(at, records, has_levels, findings);
    let of_sa = [
        ("period_s", records.period_s, Intensity::Pga),
        ("damping_ratio", records.damping_ratio, Intensity::Pga),
    ];
    for (key, value, without) in of_sa {
        let is_fixed = key == "damping_ratio" && records.intensity.of_pair().is_some();
        if value.is_some() && (records.intensity == without || is_fixed) {
            let text = match is_fixed {
                true => format!(
                    "`{key}` has no effect: the measures of two components have 5 % damping"
                ),
                false => format!("`{key}` needs `intensity = \"sa\"`"),
            };
            findings.push(Finding::error(at.key(key), text).at_key());
        }
    }
}

/// Pairs of files, and the measure of intensity of two components.
fn check_components(
    at: &KeyPath,
    records: &RecordsTable,
    has_levels: bool,
    findings: &mut Vec<Finding>,
) {
    let of_pair = "\"geometric_mean\", \"rotd50\" or \"rotd100\"";
    let Some(components) = &records.components else {
        if records.intensity.of_pair().is_some() {
            let text = "this measure of intensity needs `components`: it is that of two components";
            findings.push(Finding::error(at.key("intensity"), text));
        }
        return;
    };
    for (key, is_given) in [
        ("folder", records.folder.is_none()),
        ("pattern", records.pattern.is_some()),
    ] {
        if is_given {
            let text = match key {
                "folder" => "`components` needs `folder`",
                _ => "`components` and `pattern` both choose files of the folder: give one of them",
            };
            findings.push(Finding::error(at.key("components"), text).at_key());
        }
    }
    for (index, pattern) in components.iter().enumerate() {
        if pattern.matches('*').count() != 1 || pattern.contains('?') {
            let at = at.key("components").index(index);
            let text = format!("{pattern:?} must have exactly one `*`, and no `?`");
            let help = "`*` fits the letters that both names share: components = [\"*H1.AT2\", \"*H2.AT2\"]";
            findings.push(Finding::error(at, text).help(help));
        }
    }
    if components[0].eq_ignore_ascii_case(&components[1]) {
        let text = "both components are the same file";
        findings.push(Finding::error(at.key("components"), text));
    }
    if has_levels && records.intensity.of_pair().is_none() {
        let text = "the levels of two components need a measure of both";
        let finding =
            Finding::error(at.clone(), text).label("`intensity` is that of one component");
        findings.push(finding.help(format!("use intensity = {of_pair}")));
    }
}

/// Levels of intensity are positive, and all tables have one measure of intensity: the table of results has one column for it.
fn check_intensity(
    at: &KeyPath,
    records: &RecordsTable,
    file: &StudyFile,
    findings: &mut Vec<Finding>,
) {
    let wrong = |at: KeyPath, value: f64| {
        let text = format!("`{at}` is {value}, but an intensity must be greater than 0");
        Finding::error(at, text).label("not positive")
    };
    for (index, value) in records.values.iter().flatten().enumerate() {
        if *value <= 0.0 {
            findings.push(wrong(at.key("values").index(index), *value));
        }
    }
    for (key, value) in records
        .linear
        .iter()
        .flat_map(|span| [("from", span.from), ("to", span.to)])
    {
        if value <= 0.0 {
            findings.push(wrong(at.key("linear").key(key), value));
        }
    }
    let kind = |one: &RecordsTable| (one.intensity, one.unit, one.period_s, one.damping_ratio);
    let mut scaled = file.records.iter().filter(|one| !one.levels().is_empty());
    if let Some(first) = scaled.next()
        && !records.levels().is_empty()
        && kind(first) != kind(records)
    {
        let text = "all `[[records]]` of a study need the same `intensity`, `unit`, `period_s` and `damping_ratio`";
        let finding = Finding::error(at.clone(), text).label("differs from the first table");
        findings.push(finding.help("use one study for each measure of intensity"));
    }
}

/// Checks a list or a range of values at `at`.
fn check_range(
    at: &KeyPath,
    list: Option<usize>,
    linear: Option<SpanTable>,
    log: Option<SpanTable>,
    is_needed: bool,
    findings: &mut Vec<Finding>,
) {
    let given = [list.is_some(), linear.is_some(), log.is_some()];
    let given = given.iter().filter(|given| **given).count();
    if given > 1 || (is_needed && given == 0) {
        let text = format!("`{at}` needs exactly one of `values`, `linear` and `log`");
        findings.push(Finding::error(at.clone(), text));
    }
    if list == Some(0) {
        findings.push(Finding::error(at.key("values"), "`values` is empty"));
    }
    for (key, span) in [("linear", linear), ("log", log)] {
        let Some(span) = span else { continue };
        let at = at.key(key);
        if span.count == 0 || span.count > MOST_VALUES {
            let text = format!(
                "`{at}.count` is {}, but must be 1 to {MOST_VALUES}",
                span.count
            );
            findings.push(Finding::error(at.key("count"), text));
        }
        if span.count > 1 && span.from == span.to {
            let text = format!("`{at}` is empty: `from` and `to` are equal");
            findings.push(Finding::error(at.clone(), text));
        }
        if key == "log" && !(span.from > 0.0 && span.to > 0.0) {
            let text = format!("the ends of `{at}` must be greater than 0");
            findings.push(Finding::error(at, text));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_contain_both_ends() {
        let span = SpanTable {
            from: 0.1,
            to: 10.0,
            count: 3,
        };
        assert_eq!(span.linear(), [0.1, 5.05, 10.0]);
        let log = span.log();
        assert!((log[1] - 1.0).abs() < 1e-12 && log[2] == 10.0);
    }

    #[test]
    fn text_of_the_test_keeps_its_line_numbers() {
        let text =
            "title = \"a\"\n[[vary]]\nkey = \"x\"\nvalues = [\n[1],\n]\n[time]\nrate_hz = 1\n";
        let rest = without_own_tables(text);
        assert_eq!(rest, "title = \"a\"\n\n\n\n\n\n[time]\nrate_hz = 1\n");
    }
}
