//! From a file of `gusset serve` to the specimen that a server offers. Keys are read; nothing is connected and nothing moves.

use std::path::Path;
use std::sync::Arc;

use super::gateway;
use super::held::Held;
use super::links::{beside, wire_axes};
use super::specimens::loading::{behind_actuators, own_offsets};
use super::speed;
use gusset_actuator::specimen::{InUnits, Mounted, Specimen};
use gusset_actuator::transfer::Transfer;
use gusset_config::{
    Carrier, ConfigError, Finding, KeyPath, Offer, ServedFile, SpecimenTable, load_serve_file,
};
use gusset_link::openfresco::{Role, Transformation};
use gusset_link::secret::read_key;
use gusset_link::server::Host;
use gusset_proof::{Accepts, Kind, Verdict};
use gusset_wire::key::PreSharedKey;
use gusset_wire::openfresco::{APPLICATION_PORT, CONTROLLER_PORT, SITE_PORT};

/// A specimen that is ready to be served.
#[derive(Debug)]
pub struct Served {
    /// The specimen.
    pub host: Host,
    /// The file that describes it. Paths of keys in it are absolute.
    pub source: ServedFile,
    /// The key that the file names.
    pub key: Option<PreSharedKey>,
    /// The `rows` of a served file.
    pub transformation: Option<Transformation>,
    /// What holds the specimen from one client's test to the next, if the gateway itself does.
    pub held: Option<Arc<dyn Held>>,
}

impl Served {
    /// May this gateway move its specimen for clients of `protocol`? None for a specimen that is computed here.
    #[must_use]
    pub fn verdict(&self, protocol: Offer) -> Option<Verdict> {
        if !self.host.is_gateway() {
            return None;
        }
        let safety = self.source.file.safety.as_ref();
        let mut verdict = Verdict::of_gateway(Accepts {
            speed: safety.and_then(|safety| safety.accept_speed.clone()),
            ..Accepts::default()
        });
        if let Some(finding) = speed::of_gateway(&self.source, protocol) {
            verdict.add(Kind::Speed, finding);
        }
        Some(verdict)
    }
}

/// The role of a server with an OpenFresco protocol, and its usual port; none for the protocol of Gusset.
#[must_use]
pub const fn openfresco_role(offer: Offer) -> Option<(Role, u16)> {
    match offer {
        Offer::Gusset => None,
        Offer::OpenFresco => Some((Role::Application, APPLICATION_PORT)),
        Offer::OpenFrescoActor => Some((Role::Actor, SITE_PORT)),
        Offer::OpenFrescoController => Some((Role::Controller, CONTROLLER_PORT)),
        Offer::OpenFrescoSimulink => Some((Role::Simulink, CONTROLLER_PORT)),
    }
}

/// Reads a file of specimens, or a test file, and makes the specimen that is called `name` ready (the only one if there is
/// one).
///
/// # Errors
/// [`ConfigError`]: the file cannot be read, or everything that is wrong with it.
pub fn load_served(path: &Path, name: Option<&str>) -> Result<Served, ConfigError> {
    served(load_serve_file(path, name)?, path)
}

/// Reads the file of a record as [`load_served`]. Nothing is connected, so no key and no certificate is read.
///
/// # Errors
/// As [`load_served`].
pub fn load_served_record(path: &Path, name: Option<&str>) -> Result<Served, ConfigError> {
    let mut source = load_serve_file(path, name)?;
    source.file.serve.key_file = None;
    let links = source.file.specimen.iter_mut();
    for link in links.filter_map(|specimen| specimen.link.as_mut()) {
        (link.key_file, link.tls) = (None, None);
        if link.transport == Carrier::Tls {
            link.transport = Carrier::Tcp;
        }
    }
    served(source, path)
}

fn served(mut source: ServedFile, path: &Path) -> Result<Served, ConfigError> {
    let refuse = |finding: Finding| source.locator.refusal(finding);
    let at = &source.place;
    let Some(table) = source.specimen() else {
        return Err(refuse(Finding::error(
            at.clone(),
            "there is no such specimen",
        )));
    };
    let key = match &source.file.serve.key_file {
        None => None,
        Some(file) => Some(read_key(&beside(path, file)).map_err(|error| {
            let at = KeyPath::root().key("serve").key("key_file");
            refuse(Finding::error(at, error.to_string()))
        })?),
    };
    let (host, held) = match &table.link {
        Some(link) => gateway::host(&source, table, link, path).map_err(|f| refuse(*f))?,
        None => (host(table, at).map_err(|f| refuse(*f))?, None),
    };
    let transformation = source.rows().cloned().map(Transformation::new).transpose();
    let transformation = transformation
        .map_err(|text| refuse(Finding::error(at.key("rows"), format!("`rows`: {text}"))))?;
    let axes = table.axes();
    let host = host.limited(table.limits_of(axes));
    let host = if source.file.serve.remembers {
        host.remembering()
    } else {
        host
    };
    // A key is never copied into a run folder, so it gets a path that is valid from anywhere.
    let file = &mut source.file;
    let links = file.specimen.iter_mut().filter_map(|s| s.link.as_mut());
    let keys = links.filter_map(|link| link.key_file.as_mut());
    for named in keys.chain(&mut file.serve.key_file) {
        *named = beside(path, named).display().to_string();
    }
    if held.is_some() {
        // The thread that paces feeds the devices: it must not wait for others.
        source.file.timing.get_or_insert_default();
    }
    Ok(Served {
        host,
        source,
        key,
        transformation,
        held,
    })
}

fn host(table: &SpecimenTable, at: &KeyPath) -> Result<Host, Box<Finding>> {
    let axes = table.axes();
    let units = table.units_of(axes).into_iter();
    let units: Vec<_> = units.map(|unit| (unit.metres, unit.newtons)).collect();
    let Some((key, law)) = table.source() else {
        let text = "the specimen has neither a law nor a link";
        return Err(Box::new(Finding::error(at.clone(), text)));
    };
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
        .map(|host| host.in_units(table.units_of(axes)))
        .map_err(|text| Box::new(Finding::error(at.key(key), text)))
}
