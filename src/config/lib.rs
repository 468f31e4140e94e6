//! The files that a user writes: test files, files of `gusset serve` and fault scripts. Schema, reading, checks, diagnostics.
//!
//! This module knows no engine. It reads the content of a file, and the module `setup` builds an experiment from that. A view
//! may use it too. Each table of a file has its own Rust file.
//!
//! [`load`] reads a test file with the `--set` arguments. The [`TestFile`] that it returns has no mistake that the file alone can
//! show. Otherwise a [`ConfigError`] shows every mistake with file, line and caret. Later modules report a mistake by its path,
//! such as `specimen[1].storey`, with [`Loaded::locator`]. [`resolve()`] writes the complete configuration of a run, and
//! [`json_schema`] the schema from which editors complete. [`Inputs`] reads the files that a test names.
//!
//! ```
//! use std::path::Path;
//!
//! let text = "[time]\nrate_hz = 1024\nduration = 20\n".to_owned();
//! let error = gusset_config::parse(Path::new("test.toml"), text, &[]).unwrap_err();
//! assert!(error.to_string().contains("did you mean `duration_s`?"));
//! ```
//!
//! Unknown keys are refused, and so is every number that is not finite except λ = ∞.
//!
//! Begin reading with [`TestFile`].

mod about_table;
mod address;
mod axis_table;
mod bus_spec;
mod bus_table;
mod campaign;
mod campaign_table;
mod certificate;
pub mod check;
mod diagnose;
mod document;
mod driven;
pub mod echo;
mod excitation;
mod fault_rules;
pub mod fault_script;
mod frame_file;
mod ground;
mod hints;
mod input_store;
mod inputs;
mod levels;
mod limit_table;
mod link_table;
mod locator;
mod mistake;
mod openfresco_table;
mod overrides;
mod read;
mod reader;
mod recorded;
mod removed;
mod renamed;
mod resolve;
mod safety;
mod schema;
mod script;
mod serve;
mod serve_table;
mod specimen;
pub mod steps;
mod suggest;
mod timetable;
mod timing_table;
mod tls_table;
mod value;
mod words;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use schemars::transform::{Transform, transform_subschemas};
use schemars::{JsonSchema, Schema};
use thiserror::Error;

pub use about_table::{AboutSpecimen, AboutTable};
pub use axis_table::{AxisTable, DispUnit, ForceUnit, UnitRow, axis_units};
use bus_spec::OnBuses;
pub use bus_spec::{
    BusAxis, BusCommand, BusCondition, BusDisp, BusDrive, BusForce, BusSample, BusSpec,
    DriveProfile,
};
pub use bus_table::{Acceptance, BusClock, BusTable, DeviceTable, Flow, ProductTable};
pub use campaign::{LoadedStudy, load_study};
pub use campaign_table::{
    CampaignTable, CollapseTable, Design, Intensity, MeasureTable, RecordsTable, Sampling, Scalar,
    SpanTable, StudyFile, SyntheticTable, VaryTable,
};
pub use certificate::{
    CapacityTable, CertificateTable, IdentifiedTable, Spread, Uncertain, UncertaintyTable,
};
pub use check::missing_limits;
pub use diagnose::{Diagnostic, Diagnostics, Finding, Part, Place, Severity, Source};
pub use document::{KeyPath, PathError, Segment};
pub use driven::Drive;
use echo::plain;
pub use excitation::{
    ExcitationTable, GroundTable, NodalFileTable, NodalForceTable, PrescribedPlace,
    PrescribedTable, SupportMotionTable,
};
pub use fault_rules::{ScriptError, check_script};
pub use ground::{GroundComponent, GroundDirection, GroundMotions, GroundTrack};
pub use gusset_quantity::text::printable;
pub use input_store::InputStore;
pub use input_store::read_input;
pub use inputs::{Input, InputError, Inputs};
pub use levels::{BoundSpec, RangeSpec};
pub use limit_table::LimitsSpec;
pub use link_table::{
    Carrier, CommandPace, LinkCoupling, LinkSpec, Offer, ProbeChoice, Protocol, StaleChoice,
    WATCHDOG_MAX_S,
};
pub use locator::Locator;
pub use openfresco_table::{OpenFrescoServeSpec, OpenFrescoSpec, ServerKind, SignalOrderSpec};
pub use overrides::Override;
pub use recorded::{RecordedFile, word};
pub use resolve::{ResolveError, resolve, resolve_again};
pub use safety::{DIVERGENCE_M, ExitChoice, SafetyTable, ShareSpec, ZeroChoice};
pub use schema::{
    GravityTable, IntegratorTable, KeptDof, KeptNode, Method, RecordTable, ReduceTable, Start,
    StructureTable, TestFile, Weighting,
};
pub use script::parse_script;
pub use serve::{ServedFile, is_for_a_server, load_serve_file, specimens_of};
pub use serve_table::{BetweenTargets, Correction, PaceTable, PerAxis, ServeFile, ServeTable};
pub use specimen::{DeformationTable, DrillTable, ForceOnly, SimilitudeTable, SpecimenTable};
pub use steps::Time;
pub use suggest::nearest;
pub use timetable::{ClockChoice, TimeTable};
pub use timing_table::{CountSpec, MissesSpec, OnMiss, Policy, TimingSpec};
pub use tls_table::{ClientCertificate, ServeTlsSpec, TlsSpec};
pub use value::{DofChoice, LambdaValue, MatrixValue, RateValue};

/// Why a test file cannot be used.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file itself cannot be read.
    #[error("cannot read {path}: {source}")]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is not text.
    #[error("{path} is not UTF-8: byte {at} on line {line} is no part of a character")]
    NotText {
        /// Which file.
        path: PathBuf,
        /// Bytes before the first wrong one.
        at: usize,
        /// Its line, from 1.
        line: usize,
    },
    /// It can be read, and is wrong.
    #[error("{0}")]
    Invalid(Diagnostics),
}

/// A test file that has been read and checked.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Where it was read from.
    pub path: PathBuf,
    /// The file as given, byte for byte.
    pub text: String,
    /// The test file.
    pub file: TestFile,
    /// Its step and length, exact.
    pub time: Time,
    /// Warnings for the user; the test may run.
    pub warnings: Vec<Diagnostic>,
    /// Where everything stands.
    pub locator: Locator,
    /// Bytes of the files of a study, whose tests do not read them again.
    pub store: Option<Arc<InputStore>>,
    /// The file as a tree, with the overrides in it.
    root: document::Node,
    /// The files that were read with it.
    read: Inputs,
}

impl Loaded {
    /// The loader of the files that the test names: relative to the folder of the test file.
    #[must_use]
    pub fn inputs(&self) -> Inputs {
        self.read.clone().with_store(self.store.clone())
    }

    /// Findings of a later layer as one error with their places.
    #[must_use]
    pub fn refuse(&self, findings: impl IntoIterator<Item = Finding>) -> ConfigError {
        ConfigError::Invalid(self.diagnose(findings))
    }

    /// Findings with their places in the file.
    #[must_use]
    pub fn diagnose(&self, findings: impl IntoIterator<Item = Finding>) -> Diagnostics {
        self.locator.diagnose_all(findings)
    }
}

/// Reads the test file at `path`, puts the `--set` arguments into it, and checks it.
///
/// # Errors
/// [`ConfigError`]: the file cannot be read, or everything that is wrong with it.
pub fn load(path: &Path, sets: &[String]) -> Result<Loaded, ConfigError> {
    parse(path, read_text(path)?, sets)
}

/// Reads the `resolved.toml` of a run folder for a report or an export, which move nothing.
///
/// A removed key is ignored at any value, and nothing is refused that only a new run must refuse.
///
/// # Errors
/// [`ConfigError`]: the file cannot be read, or it is no test file.
pub fn load_recorded(path: &Path) -> Result<Loaded, ConfigError> {
    parse_for(Purpose::View, path, read_text(path)?, &[])
}

/// Purpose for which a file is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    /// A test, or a specimen that is served.
    Run,
    /// A report or an export of a recorded test.
    View,
}

/// The matrices of a test may be in it.
const LONGEST_TEST_MIB: u64 = 64;

/// The text of a file that [`parse`] or [`parse_script`] takes.
///
/// # Errors
/// [`ConfigError`]: it cannot be read, or is no text.
pub fn read_text(path: &Path) -> Result<String, ConfigError> {
    let bytes = input_store::read_at_most(LONGEST_TEST_MIB, path).map_err(|source| {
        ConfigError::Unreadable {
            path: path.to_owned(),
            source,
        }
    })?;
    text_of(path, bytes)
}

fn text_of(path: &Path, bytes: Vec<u8>) -> Result<String, ConfigError> {
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let newlines = error.as_bytes()[..at].iter().filter(|byte| **byte == b'\n');
        ConfigError::NotText {
            path: path.to_owned(),
            at,
            line: newlines.count() + 1,
        }
    })
}

/// A file whose grammar is right, with the overrides in it.
struct Opened {
    text: String,
    root: document::Node,
    locator: Locator,
    /// Entries with an old name.
    moves: Vec<renamed::Move>,
    /// The files that were read with it.
    inputs: Inputs,
}

impl Opened {
    /// Puts the `--set` arguments into the tree.
    fn set(&mut self, purpose: Purpose, path: &Path, sets: &[String]) -> Result<(), ConfigError> {
        let (mut overrides, mut refused) = parse_overrides(sets);
        self.include_frame(path, &overrides)?;
        for one in &mut overrides {
            let holds = |path: &KeyPath| self.root.find(path).is_some();
            if let Some((path, moved)) = renamed::current(&one.path(), &holds) {
                one.moved_to(&path);
                self.moves.push(moved);
            }
        }
        refused.append(&mut overrides::apply_all(&mut self.root, &overrides));
        if !refused.is_empty() {
            return Err(ConfigError::Invalid(Diagnostics(refused)));
        }
        self.locator.add(overrides, renamed::written(&self.moves));
        // The value of an override may have old names inside.
        self.moves.append(&mut renamed::rename(&mut self.root));
        removed::pass_over(purpose, path, &mut self.root);
        if removed::is_resolved(path) {
            // Gusset wrote this file, and the user does not change it.
            self.moves.clear();
        }
        Ok(())
    }

    /// The file of this kind and the warnings about it, or everything that is wrong with it.
    fn accept<T: serde::de::DeserializeOwned + JsonSchema + OnBuses>(
        &self,
        check: impl Fn(&T) -> Vec<Finding>,
    ) -> Result<(T, Vec<Finding>), ConfigError> {
        let (file, findings) = judge(&self.root, check);
        let all = renamed::notes(&self.moves).into_iter().chain(findings);
        let (errors, warnings): (Vec<_>, Vec<_>) =
            all.partition(|finding| finding.severity == Severity::Error);
        match file {
            Some(file) if errors.is_empty() => Ok((file, warnings)),
            _ => Err(ConfigError::Invalid(self.locator.diagnose_all(errors))),
        }
    }
}

fn open(
    purpose: Purpose,
    path: &Path,
    text: String,
    sets: &[String],
) -> Result<Opened, ConfigError> {
    let source = Arc::new(Source {
        name: plain(&path.display().to_string()),
        text: text.clone(),
    });
    let mut root = document::Node::parse(&text)
        .map_err(|errors| ConfigError::Invalid(Diagnostics(diagnose::syntax(&source, errors))))?;
    let moves = renamed::rename(&mut root);
    let locator = Locator::new(source, root.clone());
    let mut opened = Opened {
        text,
        root,
        locator,
        moves,
        inputs: Inputs::new(path.parent().unwrap_or(Path::new(""))),
    };
    opened.set(purpose, path, sets)?;
    Ok(opened)
}

/// [`load`] for a text that is already in memory; `path` names it and is the origin of relative paths.
///
/// # Errors
/// [`ConfigError::Invalid`] with everything that is wrong.
pub fn parse(path: &Path, text: String, sets: &[String]) -> Result<Loaded, ConfigError> {
    parse_for(Purpose::Run, path, text, sets)
}

fn parse_for(
    purpose: Purpose,
    path: &Path,
    text: String,
    sets: &[String],
) -> Result<Loaded, ConfigError> {
    let opened = open(purpose, path, text, sets)?;
    if let Some(finding) = serve::not_a_test(&opened.root) {
        return Err(opened.locator.refusal(finding));
    }
    test_of(purpose, path, opened)
}

fn test_of(purpose: Purpose, path: &Path, opened: Opened) -> Result<Loaded, ConfigError> {
    let clock = KeyPath::root().under("time.clock");
    let clock_is_chosen = opened.locator.overrides(&clock);
    let (mut file, warnings) = opened.accept(|file: &TestFile| match purpose {
        Purpose::Run => check::check(file, clock_is_chosen),
        Purpose::View => Vec::new(),
    })?;
    let Opened {
        text,
        root,
        locator,
        inputs,
        ..
    } = opened;
    let time = Time::of(&file.time).map_err(|finding| locator.refusal(*finding))?;
    file.about.leave_out_empty();
    if file.title.trim().is_empty() {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy());
        file.title = stem.map_or_else(|| "test".to_owned(), std::borrow::Cow::into_owned);
    }
    if removed::is_resolved(path) && file.structure.is_some() {
        // Earlier versions did not write it down, and meant this.
        file.safety.divergence_m.get_or_insert(DIVERGENCE_M);
    }
    Ok(Loaded {
        path: path.to_owned(),
        text,
        file,
        time,
        warnings: locator.diagnose_all(warnings).0,
        locator,
        store: None,
        root,
        read: inputs,
    })
}

fn parse_overrides(sets: &[String]) -> (Vec<Override>, Vec<Diagnostic>) {
    let mut overrides = Vec::new();
    let mut refused = Vec::new();
    for argument in sets {
        match Override::parse(argument) {
            Ok(parsed) => overrides.push(parsed),
            Err(diagnostic) => refused.push(*diagnostic),
        }
    }
    (overrides, refused)
}

/// Everything that is wrong with the tree, and its value as far as there is one.
fn judge<T: serde::de::DeserializeOwned + schemars::JsonSchema + OnBuses>(
    root: &document::Node,
    check: impl Fn(&T) -> Vec<Finding>,
) -> (Option<T>, Vec<Finding>) {
    let mut reading = read::read::<T>(root);
    if let Some(file) = &mut reading.value {
        file.link_specimens();
    }
    // A table that lost an entry would raise complaints that only follow from it.
    let damaged: Vec<KeyPath> = reading
        .mistakes
        .iter()
        .map(|mistake| mistake.path.parent().unwrap_or_default())
        .collect();
    let buses = KeyPath::root().key("bus");
    let lost_a_bus = damaged.iter().any(|table| table.starts_with(&buses));
    // The schema is only needed where there is a mistake.
    let hints = std::cell::OnceCell::new();
    let told = |mistake: mistake::Mistake| {
        let removed = match &mistake.kind {
            mistake::Kind::UnknownKey { .. } => {
                removed::finding(&mistake.path).or_else(|| renamed::finding(&mistake.path))
            }
            _ => None,
        };
        removed.unwrap_or_else(|| {
            hints
                .get_or_init(hints::Hints::of::<T>)
                .explain(mistake, root)
        })
    };
    let mut findings: Vec<Finding> = reading.mistakes.into_iter().map(told).collect();
    let known = |findings: &[Finding], path: &KeyPath| findings.iter().any(|f| f.path == *path);
    for finding in check::not_finite(root) {
        if !known(&findings, &finding.path) {
            findings.push(finding);
        }
    }
    if let Some(file) = &reading.value {
        for finding in check(file) {
            let follows = damaged
                .iter()
                .any(|table| finding.path.starts_with(table) || table.starts_with(&finding.path));
            // A bus that cannot be read is not missing.
            let follows = follows || (lost_a_bus && finding.path.shape() == "specimen[*].bus.bus");
            if !follows && !known(&findings, &finding.path) {
                findings.push(finding);
            }
        }
    }
    // In the order of the file; findings without a place in it come last.
    findings.sort_by_key(|finding| {
        let mut path = finding.path.clone();
        loop {
            if path.segments().is_empty() {
                return usize::MAX;
            }
            if let Some(node) = root.find(&path) {
                return node.key.start;
            }
            path = path.parent().unwrap_or_default();
        }
    });
    (reading.value, findings)
}

/// The JSON Schema of the test file, for editors.
#[must_use]
pub fn json_schema() -> String {
    schema_of::<TestFile>()
}

/// The JSON Schema of the study file of `gusset campaign`: the tables of a study and those of a test, which are needed unless
/// `test` names another file.
#[must_use]
pub fn study_json_schema() -> String {
    let mut schema = schemars::schema_for!(StudyFile);
    let test = schemars::schema_for!(TestFile);
    for part in ["properties", "$defs"] {
        let of_test = test.get(part).and_then(serde_json::Value::as_object);
        let own = schema
            .get_mut(part)
            .and_then(serde_json::Value::as_object_mut);
        if let (Some(own), Some(of_test)) = (own, of_test) {
            for (key, value) in of_test {
                own.entry(key.clone()).or_insert_with(|| value.clone());
            }
        }
    }
    schema.insert(
        "anyOf".to_owned(),
        serde_json::json!([{ "required": ["test"] }, { "required": ["time"] }]),
    );
    in_toml_schema(schema)
}

/// The JSON Schema of any of the files that a user writes.
#[must_use]
pub fn schema_of<T: JsonSchema>() -> String {
    in_toml_schema(schemars::schema_for!(T))
}

fn in_toml_schema(mut schema: Schema) -> String {
    ForToml.transform(&mut schema);
    serde_json::to_string_pretty(&schema).unwrap_or_default()
}

/// TOML has no null: what may be absent is simply not required. Lines of a comment are joined to sentences.
struct ForToml;

impl Transform for ForToml {
    fn transform(&mut self, schema: &mut Schema) {
        use serde_json::Value;
        transform_subschemas(self, schema);
        let Some(object) = schema.as_object_mut() else {
            return;
        };
        if let Some(Value::String(text)) = object.get_mut("description") {
            let paragraphs: Vec<_> = text.split("\n\n").map(|p| p.replace('\n', " ")).collect();
            *text = paragraphs.join("\n\n");
        }
        match object.get_mut("default") {
            Some(Value::Null) => drop(object.remove("default")),
            Some(default) => remove_nulls(default),
            None => {}
        }
        if let Some(Value::Array(types)) = object.get_mut("type") {
            types.retain(|t| t != "null");
            if let [only] = types.as_slice() {
                let only = only.clone();
                object.insert("type".to_owned(), only);
            }
        }
        if let Some(Value::Array(choices)) = object.get_mut("anyOf") {
            choices.retain(|c| c.get("type").is_none_or(|t| t != "null"));
            if let [Value::Object(only)] = choices.as_slice() {
                let only = only.clone();
                object.remove("anyOf");
                for (key, value) in only {
                    object.entry(key).or_insert(value);
                }
            }
        }
    }
}

fn remove_nulls(value: &mut serde_json::Value) {
    if let Some(keys) = value.as_object_mut() {
        keys.retain(|_, value| !value.is_null());
        keys.values_mut().for_each(remove_nulls);
    }
}

#[cfg(test)]
mod bus_tests;
#[cfg(test)]
mod schema_tests;
