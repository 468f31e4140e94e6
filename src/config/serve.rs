//! The file of `gusset serve`: specimens and how they are offered. A test file works, too.

mod gateway;

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::Node;
use super::echo::number;
use super::safety::SafetyTable;
use super::schema::RecordTable;
use super::timing_table::TimingSpec;
use super::{
    ConfigError, Finding, KeyPath, Locator, Purpose, Severity, SpecimenTable, check, judge, open,
    plain, read_text,
};
use crate::link::openfresco::{OpenFrescoServeSpec, Transformation};
use crate::link::secret::read_key;
use crate::link::serve::Host;
use crate::link::spec::{Carrier, Offer};
use crate::link::tls::ServeTlsSpec;
use crate::setup::links::{beside, wire_axes};
use crate::setup::{behind_actuators, own_offsets};
use crate::specimen::{InUnits, Mounted, Specimen};
use crate::transfer::Transfer;
use crate::wire::key::PreSharedKey;

/// Longest silence in s after which a client counts as gone: a day.
const IDLE_S: f64 = 86_400.0;

/// Specimens for `gusset serve`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ServeFile {
    /// Title of the file.
    #[serde(default)]
    pub title: String,
    /// Specimens, one table each. `gusset serve` serves one of them at a time.
    #[serde(default)]
    pub specimen: Vec<SpecimenTable>,
    /// Address, protocol and access.
    #[serde(default)]
    pub serve: ServeTable,
    /// Only `unlimited` has an effect. All other keys need the response of a structure, which a
    /// server does not have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety: Option<SafetyTable>,
    /// Real-time scheduling of the data thread. Default: normal scheduling.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timing: Option<TimingSpec>,
    /// Recording with `--out`. Only `queue_s` and `required` have an effect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record: Option<RecordTable>,
}

/// Address, protocol and access of `gusset serve`. Options of the command line override these keys.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServeTable {
    /// Address and port of the server, "host:port". Default: "127.0.0.1:4823".
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.0.0.0:4823")]
    pub listen: Option<String>,
    /// Protocol of the server. Default: "gusset".
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"openfresco")]
    pub protocol: Option<Offer>,
    /// Transport of the data: TCP, UDP or TLS. Default: "tcp".
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"tls")]
    pub transport: Option<Carrier>,
    /// Certificates for `transport = "tls"`.
    pub tls: ServeTlsSpec,
    /// File that contains the pre-shared key, relative to this file. Beyond loopback, the protocol
    /// of Gusset requires this or TLS. Other users must not have access to it (`chmod 600`).
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"laboratory.key")]
    pub key_file: Option<String>,
    /// If true, a simulated specimen keeps its state, the history of its limits and its trip
    /// between sessions, as a physical one does. An interrupted test can then be resumed. Default:
    /// false, each session starts with a new specimen.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    #[schemars(example = true)]
    pub remembers: bool,
    /// Settings for `protocol = "openfresco…"`.
    pub openfresco: OpenFrescoServeSpec,
}

/// A specimen that is ready to be served, with the settings of its file.
#[derive(Debug)]
pub struct Served {
    /// The specimen.
    pub host: Host,
    /// Settings of the file; empty for a test file.
    pub serve: ServeTable,
    /// The key that the file names.
    pub key: Option<PreSharedKey>,
    /// Real-time scheduling of the data thread.
    pub timing: Option<TimingSpec>,
    /// The file as given, byte for byte.
    pub text: String,
    /// The part of the file that is served.
    pub file: ServeFile,
    /// The file is a test file.
    pub of_a_test: bool,
    /// The file has other specimens, too.
    pub among_others: bool,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Position of each key in the file.
    pub locator: Locator,
    /// Path of its table in the file.
    pub place: KeyPath,
    /// The `rows` of a served file. A test file has none, because its `rows` are those of its structure.
    pub transformation: Option<Transformation>,
}

impl Served {
    /// Refuses what the chosen protocol has no word for.
    ///
    /// # Errors
    /// A unit that the protocol of Gusset lacks, or a transformation, which it leaves to the controller.
    pub fn check_protocol(&self, protocol: Offer) -> Result<(), ConfigError> {
        if protocol != Offer::Gusset {
            return Ok(());
        }
        if self.transformation.is_some() {
            let text = "the protocol of Gusset serves axes without `rows`";
            let finding = Finding::error(self.place.key("rows"), text)
                .at_key()
                .label("only for `--protocol openfresco…`")
                .help("`rows` of the controller's test file transform its displacements");
            return Err(self.locator.refusal(finding));
        }
        let axes = self.file.specimen.iter().flat_map(|table| &table.axis);
        for (index, gear) in axes.enumerate() {
            if let Some((key, known)) = gear.foreign_units().next() {
                let at = self.place.key("axis").index(index).key(key);
                let text = format!("the protocol of Gusset does not support this `{key}`");
                let finding = Finding::error(at, text)
                    .label(known)
                    .help("`gusset serve --protocol openfresco` serves it in this unit");
                return Err(self.locator.refusal(finding));
            }
        }
        Ok(())
    }

    /// Checks that the server does not need the port of the specimen that it commands. `flag` is the option that gives
    /// `listen`, if one does.
    ///
    /// # Errors
    /// A gateway and the specimen behind its link have the same port.
    pub fn check_listen(
        &self,
        listen: &str,
        carrier: Carrier,
        flag: Option<&str>,
    ) -> Result<(), ConfigError> {
        for specimen in &self.file.specimen {
            let link = specimen.link.as_ref();
            if link.is_some_and(|link| link.needs_port(listen, carrier)) {
                let text = format!(
                    "the gateway and the specimen `{}` have the same port",
                    specimen.name
                );
                let finding = Finding::error(self.place.key("link").key("address"), text)
                    .label("the server of the specimen");
                let key = KeyPath::root().key("serve").key("listen");
                let finding = match flag {
                    Some(flag) => finding.help(format!("the gateway itself has {flag} {listen}")),
                    None if self.locator.holds(&key) => finding.beside(key, "the gateway itself"),
                    None => {
                        finding.help(format!("without `serve.listen` the gateway has {listen}"))
                    }
                };
                let help = "choose another port for one of the two, for example with --listen";
                return Err(self.locator.refusal(finding.help(help)));
            }
        }
        Ok(())
    }
}

/// Reads a file of specimens, or a test file, and makes the specimen that is called `name` ready (the only one if there is
/// one).
///
/// # Errors
/// [`ConfigError`]: the file cannot be read, or everything that is wrong with it.
pub fn load_served(path: &Path, name: Option<&str>) -> Result<Served, ConfigError> {
    let text = read_text(path)?;
    let opened = open(Purpose::Run, path, text.clone(), &[])?;
    let locator = opened.locator.clone();
    let refuse = |finding: Finding| locator.refusal(finding);
    let of_a_test = is_test(&opened.root);
    let (mut file, warnings) = if of_a_test {
        let test = super::parse(path, text.clone(), &[])?.file;
        let file = ServeFile {
            title: test.title,
            specimen: test.specimen,
            serve: ServeTable::default(),
            safety: None,
            timing: None,
            record: None,
        };
        (file, vec![])
    } else {
        let (file, findings) = judge::<ServeFile>(&opened.root, check::check_served);
        let (findings, told): (Vec<_>, Vec<_>) = opened
            .notes
            .into_iter()
            .chain(findings)
            .partition(|finding| finding.severity == Severity::Error);
        match file {
            Some(file) if findings.is_empty() => {
                let said = |finding: Finding| match finding.label.as_str() {
                    "" => plain(&finding.headline),
                    label => plain(&format!("{}: {label}", finding.headline)),
                };
                let mut warnings: Vec<_> = told.into_iter().map(said).collect();
                if file.safety.as_ref().is_some_and(SafetyTable::bounds_a_test) {
                    let text = "[safety] bounds a test's response, which a server does not know; its bounds are `limits`";
                    warnings.push(text.to_owned());
                }
                (file, warnings)
            }
            _ => {
                let diagnostics = findings.into_iter().map(|f| locator.diagnose(f));
                return Err(ConfigError::Invalid(super::Diagnostics(
                    diagnostics.collect(),
                )));
            }
        }
    };
    let serve = file.serve.clone();
    if let Some(timing) = &file.timing
        && let Err(error) = timing.check()
    {
        let timing = KeyPath::root().key("timing");
        let at = error.keys().iter().fold(timing, |at, key| at.key(key));
        return Err(refuse(Finding::error(at, error.to_string())));
    }
    for (name, value) in [
        ("idle_timeout_s", serve.openfresco.idle_timeout_s),
        ("step_s", serve.openfresco.step_s),
    ] {
        if value.is_some_and(|value| !(value > 0.0 && value.is_finite())) {
            let at = KeyPath::root().key("serve").key("openfresco").key(name);
            let finding = Finding::error(at, format!("`{name}` must be greater than 0"));
            return Err(refuse(finding));
        }
    }
    if let Some(found) = serve.openfresco.idle_timeout_s.filter(|s| *s > IDLE_S) {
        let at = KeyPath::root().key("serve").key("openfresco");
        let headline = format!("`serve.openfresco.idle_timeout_s` must be at most {IDLE_S} s");
        let finding = Finding::error(at.key("idle_timeout_s"), headline);
        let found = format!("found {}", number(found));
        let why = "as long as a client that is gone keeps the specimen to itself";
        return Err(refuse(finding.label(found).help(why)));
    }
    let index = choose(&file.specimen, name).map_err(|f| refuse(*f))?;
    let at = KeyPath::root().key("specimen").index(index);
    let among_others = file.specimen.len() > 1;
    file.specimen = file.specimen.drain(..).skip(index).take(1).collect();
    let Some(table) = file.specimen.first() else {
        return Err(refuse(Finding::error(at, "there is no such specimen")));
    };
    let key = match &serve.key_file {
        None => None,
        Some(file) => Some(read_key(&beside(path, file)).map_err(|error| {
            let at = KeyPath::root().key("serve").key("key_file");
            refuse(Finding::error(at, error.to_string()))
        })?),
    };
    let host = match &table.link {
        Some(link) => {
            let step_s = serve.openfresco.step_s;
            gateway::host(table, link, &at, path, step_s, of_a_test).map_err(|f| refuse(*f))?
        }
        None => host(table, &at).map_err(|f| refuse(*f))?,
    };
    let transformation = match &table.rows {
        Some(rows) if !of_a_test => {
            Some(Transformation::new(rows.clone()).map_err(|text| {
                refuse(Finding::error(at.key("rows"), format!("`rows`: {text}")))
            })?)
        }
        _ => None,
    };
    let axes = table.axes();
    let host = host
        .in_units(table.units_of(axes))
        .limited(table.limits_of(axes));
    let host = match (serve.remembers, host.is_gateway()) {
        (false, _) => host,
        (true, false) => host.remembering(),
        (true, true) => {
            let at = KeyPath::root().key("serve").key("remembers");
            let text =
                "`remembers` is for a specimen that is computed, but this one is behind a link";
            return Err(refuse(Finding::error(at, text)));
        }
    };
    // A key is never copied into a run folder, so it is named in a way that holds from anywhere.
    let links = file.specimen.iter_mut().filter_map(|s| s.link.as_mut());
    let keys = links.filter_map(|link| link.key_file.as_mut());
    for named in keys.chain(&mut file.serve.key_file) {
        *named = beside(path, named).display().to_string();
    }
    Ok(Served {
        host,
        serve,
        key,
        timing: file.timing.clone(),
        text,
        file,
        of_a_test,
        among_others,
        warnings,
        locator: opened.locator,
        place: at,
        transformation,
    })
}

fn is_test(root: &Node) -> bool {
    root.find(&KeyPath::root().key("time")).is_some()
}

/// The finding for a file that is read as a test although it is one for `gusset serve`, or both in one.
pub(super) fn not_a_test(root: &Node) -> Option<Finding> {
    let has = |key: &str| root.find(&KeyPath::root().key(key)).is_some();
    let of_a_test = [
        "time",
        "structure",
        "integrator",
        "excitation",
        "certificate",
    ];
    if is_test(root) && has("serve") {
        let at = KeyPath::root().key("serve");
        let text = "a test file has no `[serve]`";
        return Some(
            Finding::error(at, text)
                .at_key()
                .label("only in a file for `gusset serve`")
                .help("move `[serve]` and a copy of the `[[specimen]]` to a separate file")
                .help("`gusset serve TEST.toml --specimen NAME --listen ADDR:PORT` also serves a specimen of a test file"),
        );
    }
    let is_served = has("serve") || (has("specimen") && !of_a_test.iter().any(|key| has(key)));
    is_served.then(|| {
        let key = if has("serve") { "serve" } else { "specimen" };
        Finding::error(
            KeyPath::root().key(key),
            "this file is for `gusset serve`, not a test file: it has no `[time]`",
        )
        .at_key()
        .label("the specimens of a server")
        .help("`gusset serve FILE` starts the server")
        .help("a test needs `[time]`, and a `[structure]` or an `[excitation]`; its `[specimen.link]` names the server's address")
    })
}

fn choose(tables: &[SpecimenTable], name: Option<&str>) -> Result<usize, Box<Finding>> {
    let at = KeyPath::root().key("specimen");
    let names = || {
        let all: Vec<&str> = tables.iter().map(|table| table.name.as_str()).collect();
        format!("the specimens of this file: {}", all.join(", "))
    };
    match (name, tables) {
        (None, [_]) => Ok(0),
        (None, []) => Err(Box::new(Finding::error(
            at,
            "this file has no `[[specimen]]` to serve",
        ))),
        (None, _) => Err(Box::new(
            Finding::error(at, "this file has several specimens, and a server has one")
                .help(format!("choose one with --specimen NAME; {}", names())),
        )),
        (Some(name), _) => tables
            .iter()
            .position(|table| table.name == name)
            .ok_or_else(|| {
                let text = format!("no specimen is called {name:?}");
                Box::new(Finding::error(at, text).help(names()))
            }),
    }
}

fn host(table: &SpecimenTable, at: &KeyPath) -> Result<Host, Box<Finding>> {
    let axes = table.axes();
    let units: Vec<(f64, f64)> = (0..axes)
        .map(|index| {
            let gear = table.axis.get(index).cloned().unwrap_or_default();
            (gear.unit_disp.metres(), gear.unit_force.newtons())
        })
        .collect();
    let Some((key, law)) = table.sources().into_iter().next() else {
        let text = "the specimen has neither a law nor a link";
        return Err(Box::new(Finding::error(at.clone(), text)));
    };
    let law = law.clone();
    let transfer = table.transfer.clone();
    let whole = table.clone();
    let wire = wire_axes(table, axes, None);
    let build = move || -> Result<Box<dyn Specimen>, String> {
        let laws = whole.law_axes();
        let law = law.build(laws).map_err(|error| error.to_string())?;
        let law = behind_actuators(&whole, law).map_err(|error| error.to_string())?;
        let law = Mounted::around(law, &own_offsets(&whole, axes));
        let law: Box<dyn Specimen> = match &transfer {
            Some(spec) => {
                let transfer = Transfer::new(spec, law, None);
                Box::new(transfer.map_err(|error| format!("[specimen.transfer]: {error}"))?)
            }
            None => law,
        };
        Ok(InUnits::around(law, &units))
    };
    Host::new(table.name.clone(), wire, Box::new(build))
        .map_err(|text| Box::new(Finding::error(at.key(key), text)))
}
