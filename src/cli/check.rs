//! `gusset check`: reads a test, judges it and shows its needs. Nothing moves.

mod brief;
mod damping;
mod frame;
mod json;
mod needs;
mod next;
mod reduction;
mod served;
mod verbose;

use super::args::CheckArgs;
use super::certificate;
use super::exit::Exit;
use super::spectrum;
use super::table::Table;
use super::test_file::{load, refused};
use super::{answer, tell, warn};
use gusset_actuator::transfer::BetweenTicks;
use gusset_config::Loaded;
use gusset_numerics::frame::FrameSpec;
use gusset_proof::Spectrum;
use gusset_proof::{Outcome, RecordedVerdict};
use gusset_reduction::Accuracy;
use gusset_session::Judged;
use gusset_session::certificate::Certificate;
use gusset_setup as setup;

/// Checks one test.
pub fn check(args: &CheckArgs) -> anyhow::Result<Exit> {
    if gusset_config::is_for_a_server(&args.test) {
        return served::check(args);
    }
    if args.specimen.is_some() {
        anyhow::bail!(
            "--specimen is for a file for `gusset serve`; a test is checked with all its specimens"
        );
    }
    let loaded = load(&args.test, &args.sets)?;
    let test = setup::build(&loaded).map_err(refused)?;
    warn(&test.warnings);
    for text in &test.facts.announced {
        tell(format_args!("note: {text}"));
    }
    let structure = test.facts.structure.as_ref();
    let spectrum = structure.and_then(|structure| {
        let analysis = structure.analysis.as_ref()?;
        Some(Spectrum::of(analysis, test.facts.dt, structure.lambda))
    });
    if let Some(folder) = &args.plot {
        let Some(spectrum) = spectrum.as_ref().filter(|spectrum| spectrum.is_of_family()) else {
            anyhow::bail!(
                "--plot has nothing to draw: the curves exist for the method \"gui\" and structures of up to 50000 DOFs"
            );
        };
        spectrum::plot(spectrum, folder)?;
    }
    let mut judged = Judged::without_rehearsal(test);
    if !args.no_rehearsal {
        judged = judged.rehearsed().map_err(refused)?;
    }
    let certificate = if args.rehearse {
        Some(Certificate::of(&loaded, &judged, args.trials, args.seed).map_err(refused)?)
    } else {
        None
    };
    warn(&loaded.diagnose(judged.verdict.shown(true)));
    let checked = Checked {
        args,
        loaded: &loaded,
        judged: &judged,
        spectrum: spectrum.as_ref(),
        certificate: certificate.as_ref(),
        accuracy: judged.test.facts.structure.as_ref().and_then(|structure| {
            let reduction = structure.reduction.as_ref()?;
            Some(reduction.accuracy().map_err(|error| error.to_string()))
        }),
    };
    if args.json {
        let found = json::document(&checked);
        answer(serde_json::to_string_pretty(&found)?)?;
    } else {
        answer(checked.page())?;
    }
    let go = certificate.as_ref().is_none_or(Certificate::is_go);
    Ok(if go && judged.verdict.is_clear() {
        Exit::Done
    } else {
        Exit::Stopped
    })
}

/// A checked test with all that was found.
struct Checked<'a> {
    args: &'a CheckArgs,
    loaded: &'a Loaded,
    judged: &'a Judged,
    spectrum: Option<&'a Spectrum>,
    certificate: Option<&'a Certificate>,
    /// The modes of a reduced structure beside those of its full model, or why they are not known.
    accuracy: Option<Result<Accuracy, String>>,
}

impl Checked<'_> {
    /// The frame of the file, if there is one.
    fn frame(&self) -> Option<&FrameSpec> {
        self.loaded.file.structure.as_ref()?.frame.as_ref()
    }

    /// The verdict, the findings, the test with its needs, and the next commands.
    fn page(&self) -> Table {
        let verdict = self.judged.verdict.record();
        let title = format!("{} — {}", self.judged.test.facts.title, in_words(&verdict));
        let mut table = if self.args.verbose {
            Table::new(&title)
        } else {
            Table::wrapped(&title)
        };
        for one in &verdict.findings {
            let text = format!("{} ({})", one.text, one.key);
            table.row(&one.severity, &self.loaded.locator.as_written(&text));
        }
        if self.args.verbose {
            self.in_full(&mut table);
        } else {
            brief::tabulate(self, &mut table);
        }
        if let Some(certificate) = self.certificate {
            certificate::tabulate(certificate, &mut table);
        }
        next::tabulate(self, &mut table);
        table
    }

    /// Everything that is known.
    fn in_full(&self, table: &mut Table) {
        verbose::tabulate(table, self);
        for (what, found) in self.judged.following.iter().map(|one| one.words()) {
            table.row(&what, &found);
        }
        for (name, between_ticks) in commands(self.loaded) {
            let what = match between_ticks {
                BetweenTicks::Ramped => "ramped: a straight line from tick to tick",
                BetweenTicks::Held => "held over each tick, as a D/A converter does",
            };
            table.row(&format!("command, {name}"), what);
        }
        verbose::of_errors(table, self.judged.verdict.errors.as_ref());
        brief::of_rehearsal(self, table);
    }
}

/// Each simulated actuator that lags, with the course of its command between two ticks.
fn commands(loaded: &Loaded) -> impl Iterator<Item = (&str, BetweenTicks)> {
    loaded.file.specimen.iter().filter_map(|table| {
        let transfer = table.believed_transfer(1.0)?;
        transfer
            .lags()
            .then_some((table.name.as_str(), transfer.between_ticks))
    })
}

/// The verdict in a few words.
fn in_words(verdict: &RecordedVerdict) -> &'static str {
    match (verdict.outcome, verdict.unstable) {
        (Outcome::Clear, _) if verdict.findings.is_empty() => "valid",
        (Outcome::Clear, _) => "valid, with findings",
        (Outcome::Accepted, true) => "valid, UNSTABLE and accepted",
        (Outcome::Accepted, false) => "valid, with accepted findings",
        (Outcome::Simulated, true) => {
            "NOT POSSIBLE with a specimen: UNSTABLE. A simulated run starts with a warning"
        }
        (Outcome::Simulated, false) => {
            "NOT POSSIBLE with a specimen. A simulated run starts with a warning"
        }
        (Outcome::Refused, true) => "NOT POSSIBLE: UNSTABLE",
        (Outcome::Refused, false) => "NOT POSSIBLE",
    }
}
