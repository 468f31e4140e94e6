//! The templates of `gusset new`, as files of the program.

use crate::cli::args::TemplateArg;

/// Schema of a test file, beside it.
pub const TEST_SCHEMA: &str = "gusset-schema.json";
/// Schema of a file of `gusset serve`, beside it.
pub const SERVE_SCHEMA: &str = "gusset-serve-schema.json";

/// The protocol for specimens in Python, beside them.
pub const PYTHON_PROTOCOL: &str = "gusset_specimen.py";

/// One file of a template.
#[derive(Debug, Clone, Copy)]
pub struct Piece {
    /// End of its file name, after the name of the test.
    pub suffix: &'static str,
    /// Short description.
    pub what: &'static str,
    /// Its text, with the name of the template in place of the name of the test.
    text: &'static str,
}

/// One template.
#[derive(Debug, Clone, Copy)]
pub struct Template {
    /// Its name on the command line.
    pub name: &'static str,
    /// The files that it writes, the test first.
    pub pieces: &'static [Piece],
    /// Files that these refer to and that several tests in a folder share.
    pub shared: &'static [&'static str],
    /// The next commands, with NAME in place of the name of the test.
    pub next: &'static [&'static str],
}

macro_rules! piece {
    ($suffix:literal, $what:literal, $file:literal) => {
        Piece {
            suffix: $suffix,
            what: $what,
            text: include_str!(concat!("../templates/", $file)),
        }
    };
}

const RUN: &[&str] = &[
    "gusset check NAME.toml",
    "gusset run NAME.toml --out runs/NAME",
];

const RECORD: Piece = piece!(
    ".AT2",
    "a synthetic earthquake record",
    "shear-building.AT2"
);

const SHEAR_BUILDING: Template = Template {
    name: "shear-building",
    pieces: &[piece!(".toml", "the test", "shear-building.toml"), RECORD],
    shared: &[TEST_SCHEMA],
    next: RUN,
};

const ACTUATOR: Template = Template {
    name: "actuator",
    pieces: &[piece!(".toml", "the test", "actuator.toml"), RECORD],
    shared: &[TEST_SCHEMA],
    next: RUN,
};

const PRESCRIBED: Template = Template {
    name: "prescribed",
    pieces: &[piece!(".toml", "the test", "prescribed.toml")],
    shared: &[TEST_SCHEMA],
    next: RUN,
};

const BENCHMARK: Template = Template {
    name: "benchmark",
    pieces: &[piece!(".toml", "the test", "benchmark.toml")],
    shared: &[TEST_SCHEMA],
    next: RUN,
};

const FRAME: Template = Template {
    name: "frame",
    pieces: &[piece!(".toml", "the test", "frame.toml")],
    shared: &[TEST_SCHEMA],
    next: RUN,
};

const TUNED_MASS_DAMPER: Template = Template {
    name: "tuned-mass-damper",
    pieces: &[piece!(".toml", "the test", "tuned-mass-damper.toml")],
    shared: &[TEST_SCHEMA],
    next: RUN,
};

const ISOLATED_BUILDING: Template = Template {
    name: "isolated-building",
    pieces: &[piece!(".toml", "the test", "isolated-building.toml")],
    shared: &[TEST_SCHEMA],
    next: RUN,
};

const REMOTE: Template = Template {
    name: "remote",
    pieces: &[
        piece!(".toml", "the test", "remote.toml"),
        piece!(
            "-specimen.toml",
            "the served specimen",
            "remote-specimen.toml"
        ),
    ],
    shared: &[TEST_SCHEMA, SERVE_SCHEMA],
    next: &[
        "gusset serve NAME-specimen.toml          # in another terminal",
        "gusset check NAME.toml",
        "gusset run NAME.toml --out runs/NAME",
    ],
};

const BUS: Template = Template {
    name: "bus",
    pieces: &[piece!(".toml", "the test", "bus.toml")],
    shared: &[TEST_SCHEMA],
    next: &[
        "gusset check NAME.toml",
        "gusset bus simulate NAME.toml --pair -- gusset run NAME.toml --out runs/NAME",
    ],
};

const PYTHON: Template = Template {
    name: "python",
    pieces: &[
        piece!(".toml", "the test", "python.toml"),
        piece!(".py", "the specimen: your force law", "python.py"),
    ],
    shared: &[TEST_SCHEMA, PYTHON_PROTOCOL],
    next: &[
        "python3 NAME.py                          # in another terminal",
        "gusset check NAME.toml",
        "gusset run NAME.toml --out runs/NAME",
    ],
};

const OPENSEES: Template = Template {
    name: "opensees",
    pieces: &[
        piece!(".toml", "the served specimen", "opensees.toml"),
        piece!(".py", "an OpenSeesPy model that commands it", "opensees.py"),
    ],
    shared: &[SERVE_SCHEMA],
    next: &[
        "gusset serve NAME.toml                   # in another terminal",
        "python3 NAME.py                          # needs OpenSeesPy",
    ],
};

/// Offered at the end of each test.
const ABOUT: &str = r#"
# Who tests what, for the report, `gusset list` and archives. All keys are optional.
# [about]
# operator = "A. Muster"
# laboratory = ""
# project = ""
# specimen = [{ id = "", material = "", state = "" }]
# keywords = ["hybrid simulation"]
# licence = "CC-BY-4.0"
"#;

impl Template {
    /// The template of this name.
    pub const fn of(which: TemplateArg) -> Self {
        match which {
            TemplateArg::ShearBuilding => SHEAR_BUILDING,
            TemplateArg::Actuator => ACTUATOR,
            TemplateArg::Prescribed => PRESCRIBED,
            TemplateArg::Benchmark => BENCHMARK,
            TemplateArg::Frame => FRAME,
            TemplateArg::TunedMassDamper => TUNED_MASS_DAMPER,
            TemplateArg::IsolatedBuilding => ISOLATED_BUILDING,
            TemplateArg::Remote => REMOTE,
            TemplateArg::Bus => BUS,
            TemplateArg::Python => PYTHON,
            TemplateArg::Opensees => OPENSEES,
        }
    }

    /// Every file with its text, for a test of this name.
    pub fn files(&self, name: &str) -> Vec<(String, String)> {
        let written = |piece: &Piece| {
            let text = self.pieces.iter().fold(piece.text.to_owned(), |text, one| {
                let (own, new) = (
                    format!("{}{}", self.name, one.suffix),
                    format!("{name}{}", one.suffix),
                );
                replaced(&text, &own, &new)
            });
            let offer = if piece.suffix == ".toml" { ABOUT } else { "" };
            (format!("{name}{}", piece.suffix), text + offer)
        };
        self.pieces.iter().map(written).collect()
    }
}

/// `text` with each file name `own` as `new`; longer names that end with `own` stay.
fn replaced(text: &str, own: &str, new: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(place) = rest.find(own) {
        let (before, from) = rest.split_at(place);
        out.push_str(before);
        let of_a_name = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        let is_whole = !out.chars().next_back().is_some_and(of_a_name);
        out.push_str(if is_whole { new } else { own });
        rest = &from[own.len()..];
    }
    out.push_str(rest);
    out
}
