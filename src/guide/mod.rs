#![doc = include_str!("rustdoc-links.txt")]
#![doc = include_str!("README.md")]
#![allow(
    rustdoc::invalid_codeblock_attributes,
    reason = "attributes behind a fence are for the test that executes the blocks"
)]

mod entry;
mod inline;
mod manual;
mod markdown;
mod search;
mod table;
mod terminal;

pub use entry::{Entry, entries, find};
pub use manual::{MANUAL_LIST, ManualFile, manual};
pub use markdown::anchor;
pub use search::{Hit, search};
pub use terminal::plain_text;

/// A group of pages in the navigation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// For a first afternoon.
    Learn,
    /// For a laboratory that prepares a test.
    Work,
    /// To look something up.
    LookUp,
    /// Equations and sources.
    Mathematics,
}

impl Group {
    /// All groups, in the order of the navigation.
    pub const ALL: [Self; 4] = [Self::Learn, Self::Work, Self::LookUp, Self::Mathematics];

    /// The heading of the group.
    #[must_use]
    pub const fn title(self) -> &'static str {
        match self {
            Self::Learn => "Learn",
            Self::Work => "Prepare and run tests",
            Self::LookUp => "Look up",
            Self::Mathematics => "Mathematics",
        }
    }
}

/// One page of the guide.
#[derive(Debug, Clone, Copy)]
pub struct Page {
    /// Name of the page: the topic of `gusset guide`, the label of links, and the name of its file.
    pub id: &'static str,
    /// Its group in the navigation.
    pub group: Group,
    /// The Markdown text.
    pub text: &'static str,
    /// True for pages that a test writes from data in the program.
    pub is_generated: bool,
}

impl Page {
    /// The title: the first line of the page without its `#`.
    #[must_use]
    pub fn title(&self) -> &'static str {
        let first = self.text.lines().next().unwrap_or_default();
        first.trim_start_matches('#').trim()
    }
}

/// Declares the pages: one module with the page as its documentation, and one line of [`PAGES`] each.
macro_rules! pages {
    ($($module:ident = $id:literal, $file:literal, $group:ident, $generated:literal;)*) => {
        $(
            #[doc = include_str!("rustdoc-links.txt")]
            #[doc = include_str!($file)]
            pub mod $module {}
        )*

        /// Every page, in the order of the navigation.
        pub const PAGES: &[Page] = &[
            $(Page {
                id: $id,
                group: Group::$group,
                text: include_str!($file),
                is_generated: $generated,
            },)*
        ];
    };
}

pages! {
    first_test = "first-test", "first-test.md", Learn, false;
    concepts = "concepts", "concepts.md", Learn, false;
    scope = "scope", "scope.md", Learn, false;
    frames = "frames", "frames.md", Work, false;
    import = "import", "import.md", Work, false;
    devices = "devices", "devices.md", Work, false;
    excitation = "excitation", "excitation.md", Work, false;
    actuators = "actuators", "actuators.md", Work, false;
    limits = "limits", "limits.md", Work, false;
    real_time = "real-time", "real-time.md", Work, false;
    real_specimen = "real-specimen", "real-specimen.md", Work, false;
    network = "network", "network.md", Work, false;
    ethercat = "ethercat", "ethercat.md", Work, false;
    opensees = "opensees", "opensees.md", Work, false;
    gateway = "gateway", "gateway.md", Work, false;
    opensees_rig = "opensees-rig", "opensees-rig.md", Work, false;
    specimen_record = "specimen-record", "specimen-record.md", Work, false;
    operation = "operation", "operation.md", Work, false;
    run_folder = "run-folder", "run-folder.md", Work, false;
    reading_data = "reading-data", "reading-data.md", Work, false;
    python = "python", "python.md", Work, false;
    campaigns = "campaigns", "campaigns.md", Work, false;
    launchers = "launchers", "launchers.md", Work, false;
    configuration = "configuration", "configuration.md", LookUp, true;
    troubleshooting = "troubleshooting", "troubleshooting.md", LookUp, false;
    limit_table = "limit-table", "limit-table.md", LookUp, true;
    events = "events", "events.md", LookUp, true;
    columns = "columns", "columns.md", LookUp, true;
    studies = "studies", "studies.md", LookUp, true;
    mathematics_integrator = "mathematics-integrator", "mathematics-integrator.md", Mathematics, false;
    mathematics_coupling = "mathematics-coupling", "mathematics-coupling.md", Mathematics, false;
    test_errors = "test-errors", "test-errors.md", Mathematics, false;
    mathematics_errors = "mathematics-errors", "mathematics-errors.md", Mathematics, false;
}

/// The contents page.
pub const CONTENTS: &str = include_str!("README.md");

/// Pictures of the pages: their names relative to the guide, and their SVG text.
pub const PICTURES: &[(&str, &str)] = &[
    (
        "pictures/time-line.svg",
        include_str!("pictures/time-line.svg"),
    ),
    (
        "pictures/two-substructures.svg",
        include_str!("pictures/two-substructures.svg"),
    ),
];

/// The page with this id.
#[must_use]
pub fn page(id: &str) -> Option<&'static Page> {
    PAGES.iter().find(|page| page.id == id)
}

#[cfg(test)]
mod tests;
