//! Findings and files of a build so far, and how it refuses: a finding at its place in the file.

use super::reduced::Reduced;
use super::{Dial, Trial};
use gusset_config::{ConfigError, Finding, Inputs, KeyPath, Loaded};
use gusset_motion::{Corrected, RecordFacts, Scaled};
use gusset_proof::Kind;

/// The bus of a test while its specimens are made.
#[cfg(feature = "ethercat")]
pub(crate) struct Draft {
    pub shared: std::sync::Arc<gusset_ethercat::SharedBus>,
    pub plants: std::sync::Arc<std::sync::Mutex<Vec<gusset_ethercat::simulated::Plant>>>,
}

/// Findings so far, and the files read so far.
pub(super) struct Site<'a> {
    pub loaded: &'a Loaded,
    /// Makes the transports of links that are not to be connected.
    pub dial: Option<&'a mut Dial<'a>>,
    pub inputs: Inputs,
    pub errors: Vec<Finding>,
    pub warnings: Vec<Finding>,
    /// Facts about the records of motions.
    pub records: Vec<RecordFacts>,
    /// Accelerations that became displacements, with the keys of their tables.
    pub corrected: Vec<(String, Corrected)>,
    /// Result of `[excitation.scaling]`.
    pub scaled: Option<Scaled>,
    /// The reduction of the structure.
    pub reduced: Option<Reduced>,
    /// Findings of stability: they forbid a test only where it moves a specimen behind a link.
    pub doubts: Vec<(Kind, Finding)>,
    /// The bus of the specimens so far.
    #[cfg(feature = "ethercat")]
    pub bus: Option<Draft>,
    /// Faults of the devices that are simulated in this process.
    #[cfg(feature = "ethercat")]
    pub bus_faults: Vec<gusset_ethercat::simulated::Fault>,
    /// Draws of a rehearsal: a stand-in replaces every specimen behind a link, and no link is made.
    pub trial: Option<&'a Trial>,
}

/// The end of a build whose findings are in the site.
pub(super) struct Refused;

/// What `make` builds from a file, or the findings with which it refuses.
pub(super) fn build<'a, T>(
    loaded: &'a Loaded,
    trial: Option<&'a Trial>,
    dial: Option<&'a mut Dial<'a>>,
    make: impl FnOnce(&mut Site<'a>) -> Result<T, Refused>,
) -> Result<T, ConfigError> {
    let mut site = Site {
        loaded,
        dial,
        inputs: loaded.inputs(),
        errors: Vec::new(),
        warnings: Vec::new(),
        records: Vec::new(),
        corrected: Vec::new(),
        scaled: None,
        reduced: None,
        doubts: Vec::new(),
        #[cfg(feature = "ethercat")]
        bus: None,
        #[cfg(feature = "ethercat")]
        bus_faults: Vec::new(),
        trial,
    };
    make(&mut site).map_err(|Refused| loaded.refuse(std::mem::take(&mut site.errors)))
}

impl Site<'_> {
    /// Entries that a vector of the test file has, in a structure of `n` degrees of freedom.
    pub(super) fn dofs_of_file(&self, n: usize) -> usize {
        self.reduced.as_ref().map_or(n, |one| one.reduction.full())
    }

    /// A load of the test file at the degrees of freedom of the structure.
    pub(super) fn load(&self, given: Vec<f64>) -> Vec<f64> {
        match &self.reduced {
            Some(one) => one.reduction.load(&given),
            None => given,
        }
    }

    /// A motion of the test file at the degrees of freedom of the structure.
    pub(super) fn motion(&self, given: Vec<f64>) -> Vec<f64> {
        match &self.reduced {
            Some(one) => one.reduction.motion(&given),
            None => given,
        }
    }

    pub(crate) fn refuse<T>(&mut self, finding: Finding) -> Result<T, Refused> {
        self.errors.push(finding);
        Err(Refused)
    }

    /// A complaint of a lower layer about `key`, at the nearest place below `at` that is called so.
    pub(crate) fn refuse_key<T>(
        &mut self,
        at: &KeyPath,
        key: &str,
        error: &dyn std::fmt::Display,
    ) -> Result<T, Refused> {
        let path = self.loaded.locator.beneath(at, key);
        self.refuse(Finding::error(path, error.to_string()))
    }

    /// The bytes of an input, or a finding at the key that names it.
    pub(crate) fn read(&mut self, at: KeyPath, requested: &str) -> Result<Vec<u8>, Refused> {
        let bytes = self.inputs.read(requested).map(<[u8]>::to_vec);
        bytes.or_else(|error| self.refuse(error.finding(at)))
    }
}

/// Root of all paths.
pub(super) fn path(key: &str) -> KeyPath {
    KeyPath::root().key(key)
}
