//! Reading of the file of `gusset serve`. A test file works, too.

use crate::serve_table::PaceTable;
use std::path::Path;

use super::axis_table::{DispUnit, ForceUnit};
use super::document::Node;
use super::link_table::{Carrier, Offer};
use super::safety::SafetyTable;
use super::serve_table::{ServeFile, ServeTable};
use super::{
    ConfigError, Finding, KeyPath, Locator, Purpose, SpecimenTable, check, judge, open, plain,
    read_text,
};
use gusset_actuator::geometry::Geometry;

/// The served part of a file that has been read and checked.
#[derive(Debug)]
pub struct ServedFile {
    /// The file as given, byte for byte.
    pub text: String,
    /// The settings, with the one specimen that is served.
    pub file: ServeFile,
    /// True if it is a test file, whose `rows` and scales belong to the controller.
    pub is_test: bool,
    /// The file has other specimens, too.
    pub among_others: bool,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Position of each key in the file.
    pub locator: Locator,
    /// Path of the table of the specimen in the file.
    pub place: KeyPath,
}

impl ServedFile {
    /// The table of the specimen.
    #[must_use]
    pub fn specimen(&self) -> Option<&SpecimenTable> {
        self.file.specimen.first()
    }

    /// The rows of the transformation from the client's displacements to the axes. Those of a test file belong to its structure.
    #[must_use]
    pub fn rows(&self) -> Option<&Vec<Vec<f64>>> {
        self.specimen()?.rows.as_ref().filter(|_| !self.is_test)
    }

    /// Refuses keys that the chosen protocol does not support.
    ///
    /// # Errors
    /// A unit that the protocol of Gusset lacks, or a transformation, which it leaves to the controller.
    pub fn check_protocol(&self, protocol: Offer) -> Result<(), ConfigError> {
        if protocol != Offer::Gusset {
            return Ok(());
        }
        let pace = self.file.serve.pace.as_ref();
        if pace.is_some_and(PaceTable::predicts) {
            let text = "`between = \"predict\"` is for clients of OpenFresco's protocols";
            let at = KeyPath::root().under("serve.pace").key("between");
            let finding = Finding::error(at, text).at_key();
            let help = "set `protocol = \"openfresco\"` in [serve]; a controller that runs Gusset paces by its own `ticks_per_step`";
            return Err(self.locator.refusal(finding.help(help)));
        }
        if self.rows().is_some() {
            let text = "the protocol of Gusset serves axes without `rows`";
            let finding = Finding::error(self.place.key("rows"), text)
                .at_key()
                .label("only for OpenFresco's protocols: `protocol = \"openfresco\"` in [serve], or --protocol openfresco")
                .help("`rows` of the controller's test file transform its displacements");
            return Err(self.locator.refusal(finding));
        }
        if let Some(units) = self.client_units() {
            return self.check_client_units(units);
        }
        let axes = self.file.specimen.iter().flat_map(|table| &table.axis);
        for (index, gear) in axes.enumerate() {
            if let Some((key, known)) = gear.foreign_units().next() {
                let at = self.place.key("axis").index(index).key(key);
                return Err(self.foreign_unit(at, known));
            }
        }
        Ok(())
    }

    /// True for a gateway whose client commands displacements that are converted to the axes.
    #[must_use]
    pub fn converts(&self) -> bool {
        let names_units = self.file.serve.names_units();
        self.specimen().is_some_and(|table| {
            !self.is_test && table.link.is_some() && (names_units || table.converts())
        })
    }

    /// Units of the client of a gateway that converts; none if the client counts in the units of the axes.
    #[must_use]
    pub fn client_units(&self) -> Option<(DispUnit, ForceUnit)> {
        let serve = &self.file.serve;
        self.converts().then(|| {
            (
                serve.unit_disp.unwrap_or_default(),
                serve.unit_force.unwrap_or_default(),
            )
        })
    }

    /// Refuses units of the client that the protocol of Gusset lacks.
    fn check_client_units(&self, (disp, force): (DispUnit, ForceUnit)) -> Result<(), ConfigError> {
        let geometry = self.specimen().and_then(|table| table.geometry.as_ref());
        let built = geometry.and_then(|spec| spec.build(1.0).ok());
        let mut coordinates = built.iter().flat_map(Geometry::coordinates);
        let turns = coordinates.any(|one| one.is_rotation());
        let is_foreign = disp.row().wire.is_none() || (turns && disp != DispUnit::Metre);
        let (key, known) = match (is_foreign, force.row().wire) {
            (true, _) if turns => ("unit_disp", "m, beside rotations"),
            (true, _) => ("unit_disp", "m or mm"),
            (false, None) => ("unit_force", "N or kN"),
            (false, Some(_)) => return Ok(()),
        };
        Err(self.foreign_unit(KeyPath::root().key("serve").key(key), known))
    }

    /// A unit that the protocol of Gusset lacks.
    fn foreign_unit(&self, at: KeyPath, known: &str) -> ConfigError {
        let key = at.last_key().unwrap_or_default();
        let text = format!("the protocol of Gusset does not support this `{key}`");
        let help = "`protocol = \"openfresco\"` in [serve], or --protocol openfresco, serves it in this unit";
        let finding = Finding::error(at, text).label(known).help(help);
        self.locator.refusal(finding)
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

/// Reads a file of specimens, or a test file, and chooses the specimen that is called `name` (the only one if there is one).
///
/// # Errors
/// [`ConfigError`]: the file cannot be read, or everything that is wrong with it.
pub fn load_serve_file(path: &Path, name: Option<&str>) -> Result<ServedFile, ConfigError> {
    let text = read_text(path)?;
    let opened = open(Purpose::Run, path, text.clone(), &[])?;
    let locator = opened.locator.clone();
    let refuse = |finding: Finding| locator.refusal(finding);
    let of_a_test = is_test(&opened.root);
    let (mut file, warnings) = if of_a_test {
        let test = super::parse(path, text.clone(), &[])?.file;
        // The reasons that a server knows, too.
        let safety = SafetyTable {
            accept_speed: test.safety.accept_speed,
            accept_wiring: test.safety.accept_wiring,
            ..SafetyTable::default()
        };
        let file = ServeFile {
            title: test.title,
            about: test.about,
            specimen: test.specimen,
            bus: test.bus,
            serve: ServeTable::default(),
            safety: (safety != SafetyTable::default()).then_some(safety),
            timing: None,
            record: None,
        };
        (file, vec![])
    } else {
        let (mut file, told) = opened.accept(check::check_served)?;
        file.about.leave_out_empty();
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
    };
    let index = choose(&file.specimen, name).map_err(|f| refuse(*f))?;
    let at = KeyPath::root().key("specimen").index(index);
    let among_others = file.specimen.len() > 1;
    file.specimen = file.specimen.drain(..).skip(index).take(1).collect();
    if file.specimen.is_empty() {
        return Err(refuse(Finding::error(at, "there is no such specimen")));
    }
    if file.serve.remembers && file.specimen.iter().any(|table| table.link.is_some()) {
        let at = KeyPath::root().key("serve").key("remembers");
        let text = "`remembers` is for a specimen that is computed, but this one is behind a link";
        return Err(refuse(Finding::error(at, text)));
    }
    let is_computed = file.specimen.iter().any(|table| table.link.is_none());
    let openfresco = &file.serve.openfresco;
    if openfresco.iterates_within_m.is_some() && is_computed && !openfresco.physical {
        let at = KeyPath::root().key("serve").key("openfresco");
        let text =
            "`iterates_within_m` is for a specimen that moves, but this one follows each trial";
        let finding = Finding::error(at.key("iterates_within_m"), text);
        return Err(refuse(finding.help("remove it, or set `physical = true`")));
    }
    if openfresco.updates_tangent && is_computed {
        let at = KeyPath::root()
            .under("serve.openfresco")
            .key("updates_tangent");
        let text = "`updates_tangent` is for a specimen behind a link: the tangent of a computed one is known";
        return Err(refuse(Finding::error(at, text)));
    }
    if file.serve.pace.is_some() && is_computed {
        let at = KeyPath::root().key("serve").key("pace");
        let text = "`pace` is for a specimen behind a link, but this one is computed";
        return Err(refuse(Finding::error(at, text)));
    }
    Ok(ServedFile {
        text,
        file,
        is_test: of_a_test,
        among_others,
        warnings,
        locator: opened.locator,
        place: at,
    })
}

/// The specimens of a file for `gusset serve`, or of a test file.
///
/// # Errors
/// [`ConfigError`]: the file cannot be read, or everything that is wrong with it.
pub fn specimens_of(path: &Path) -> Result<Vec<SpecimenTable>, ConfigError> {
    let text = read_text(path)?;
    let opened = open(Purpose::Run, path, text.clone(), &[])?;
    if is_test(&opened.root) {
        return Ok(super::parse(path, text, &[])?.file.specimen);
    }
    let (file, findings) = judge::<ServeFile>(&opened.root, check::check_served);
    file.map(|file| file.specimen)
        .ok_or_else(|| ConfigError::Invalid(opened.locator.diagnose_all(findings)))
}

fn is_test(root: &Node) -> bool {
    root.find(&KeyPath::root().key("time")).is_some()
}

/// True for a file of `gusset serve` that is not a test file.
#[must_use]
pub fn is_for_a_server(path: &Path) -> bool {
    let opened = read_text(path).and_then(|text| open(Purpose::Run, path, text, &[]));
    opened.is_ok_and(|opened| !is_test(&opened.root) && not_a_test(&opened.root).is_some())
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
