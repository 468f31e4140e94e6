//! The file of `gusset serve`: specimens and how they are offered. A test file works, too.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::build::links::{beside, wire_axes};
use super::document::Node;
use super::schema::{RecordTable, SafetyTable};
use super::{
    ConfigError, DispUnit, Finding, ForceUnit, KeyPath, SpecimenTable, check, judge, open,
    read_text,
};
use crate::link::openfresco::OpenFrescoServeSpec;
use crate::link::secret::read_key;
use crate::link::serve::Host;
use crate::link::spec::{Carrier, Offer};
use crate::link::tls::ServeTlsSpec;
use crate::rt::TimingSpec;
use crate::specimen::{InUnits, Specimen};
use crate::wire::key::PreSharedKey;

/// Specimens to be served.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ServeFile {
    /// For people.
    #[serde(default)]
    pub title: String,
    /// What can be served, one table each; one of them at a time.
    #[serde(default)]
    pub specimen: Vec<SpecimenTable>,
    /// How it is offered.
    #[serde(default)]
    pub serve: ServeTable,
    /// Bounds. A specimen that is a formula has none; accepted, without effect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety: Option<SafetyTable>,
    /// What is asked of the machine for the data thread. Default: nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timing: Option<TimingSpec>,
    /// What is recorded. Nothing is recorded at this end so far; accepted, without effect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record: Option<RecordTable>,
}

/// How specimens are offered. The command line overrides each key.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServeTable {
    /// Where to listen, "host:port". Default: 127.0.0.1:4823.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub listen: Option<String>,
    /// What is spoken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<Offer>,
    /// How the bytes travel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transport: Option<Carrier>,
    /// For `transport = "tls"` only.
    pub tls: ServeTlsSpec,
    /// File with the pre-shared key, relative to this file. Beyond loopback our own protocol wants this or TLS.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key_file: Option<String>,
    /// For `protocol = "openfresco…"` only.
    pub openfresco: OpenFrescoServeSpec,
}

/// A specimen that is ready to be served, and how the file wants it to be.
#[derive(Debug)]
pub struct Served {
    /// The specimen.
    pub host: Host,
    /// Wishes of the file; empty for a test file.
    pub serve: ServeTable,
    /// The key that the file names.
    pub key: Option<PreSharedKey>,
    /// What is asked of the machine.
    pub timing: Option<TimingSpec>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Reads a file of specimens, or a test file, and makes the specimen that is called `name` ready (the only one if there is
/// one).
///
/// # Errors
/// [`ConfigError`]: the file cannot be read, or everything that is wrong with it.
pub fn load_served(path: &Path, name: Option<&str>) -> Result<Served, ConfigError> {
    let text = read_text(path)?;
    let opened = open(path, text.clone(), &[])?;
    let locator = opened.locator.clone();
    let refuse = |finding: Finding| {
        let diagnostics = vec![locator.diagnose(finding)];
        ConfigError::Invalid(super::Diagnostics(diagnostics))
    };
    let (tables, serve, timing, warnings) = if is_test(&opened.root) {
        let loaded = super::parse(path, text, &[])?;
        (loaded.file.specimen, ServeTable::default(), None, vec![])
    } else {
        let (file, findings) = judge::<ServeFile>(&opened.root, check::check_served);
        match file {
            Some(file) if findings.is_empty() => {
                let mut warnings = Vec::new();
                for (key, given) in [
                    ("safety", file.safety.is_some()),
                    ("record", file.record.is_some()),
                ] {
                    if given {
                        warnings.push(format!(
                            "[{key}] has no effect on a specimen that is a formula"
                        ));
                    }
                }
                (file.specimen, file.serve, file.timing, warnings)
            }
            _ => {
                let diagnostics = findings.into_iter().map(|f| locator.diagnose(f));
                return Err(ConfigError::Invalid(super::Diagnostics(
                    diagnostics.collect(),
                )));
            }
        }
    };
    if let Some(timing) = &timing
        && let Err(error) = timing.check()
    {
        let at = KeyPath::root().key("timing").key(error.key());
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
    let index = choose(&tables, name).map_err(|f| refuse(*f))?;
    let at = KeyPath::root().key("specimen").index(index);
    let Some(table) = tables.into_iter().nth(index) else {
        return Err(refuse(Finding::error(at, "there is no such specimen")));
    };
    let key = match &serve.key_file {
        None => None,
        Some(file) => Some(read_key(&beside(path, file)).map_err(|error| {
            let at = KeyPath::root().key("serve").key("key_file");
            refuse(Finding::error(at, error.to_string()))
        })?),
    };
    Ok(Served {
        host: host(table, &at).map_err(|f| refuse(*f))?,
        serve,
        key,
        timing,
        warnings,
    })
}

fn is_test(root: &Node) -> bool {
    root.find(&KeyPath::root().key("time")).is_some()
}

fn choose(tables: &[SpecimenTable], name: Option<&str>) -> Result<usize, Box<Finding>> {
    let at = KeyPath::root().key("specimen");
    let names = || {
        let all: Vec<&str> = tables.iter().map(|table| table.name.as_str()).collect();
        format!("there are: {}", all.join(", "))
    };
    match (name, tables) {
        (None, [_]) => Ok(0),
        (None, []) => Err(Box::new(Finding::error(
            at,
            "there is no specimen to be served",
        ))),
        (None, _) => Err(Box::new(
            Finding::error(at, "which of the specimens is to be served?")
                .help(format!("name it with --specimen; {}", names())),
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

fn host(table: SpecimenTable, at: &KeyPath) -> Result<Host, Box<Finding>> {
    if table.link.is_some() {
        let text = "a specimen behind a link cannot be served on: a gateway is not built yet";
        return Err(Box::new(Finding::error(at.key("link"), text)));
    }
    let axes = match (&table.storey, &table.rows) {
        (Some(_), _) => 1,
        (_, Some(rows)) => rows.len(),
        _ => table.axes_by_itself(),
    };
    let units: Vec<(f64, f64)> = (0..axes)
        .map(|index| {
            let gear = table.axis.get(index).cloned().unwrap_or_default();
            (gear.unit_disp.metres(), gear.unit_force.newtons())
        })
        .collect();
    let Some((key, law)) = table.sources().into_iter().next() else {
        let text = "nothing stands for the specimen";
        return Err(Box::new(Finding::error(at.clone(), text)));
    };
    let law = law.clone();
    for (index, gear) in table.axis.iter().enumerate() {
        if gear.unit_disp == DispUnit::Inch || gear.unit_force == ForceUnit::PoundForce {
            let at = at.key("axis").index(index);
            let text = "the protocol has neither inches nor pounds";
            return Err(Box::new(Finding::error(at, text).label("m or mm, N or kN")));
        }
    }
    let wire = wire_axes(&table, axes);
    let build = move || -> Result<Box<dyn Specimen>, String> {
        let law = law.build(axes).map_err(|error| error.to_string())?;
        Ok(Box::new(InUnits::new(law, &units)))
    };
    Host::new(table.name.clone(), wire, Box::new(build))
        .map_err(|text| Box::new(Finding::error(at.key(key), text)))
}
