//! Views of a running test: the board, the live page, the status on the terminal.

use std::path::Path;
use std::sync::Arc;

use crossbeam_channel::bounded;

use super::args::RunArgs;
use gusset_config::ClockChoice;
use gusset_control::engine::PhaseCell;
use gusset_record::Onlooker;
use gusset_setup::{Facts, Prepared};
use gusset_view::live::{About, ActuatorEnds, Board, GoesOn, LambdaUse, Subject, Tap};

#[cfg(feature = "monitor")]
use {
    super::tell,
    crossbeam_channel::Sender,
    gusset_config::Carrier,
    gusset_control::engine::Operator,
    gusset_record::Note,
    gusset_session::{Attendance, Finished},
    gusset_view::live::Ended,
    gusset_view::live::page::{LivePage, Serving, Token},
};

/// A port that no server of this program uses by default.
#[cfg(feature = "monitor")]
const OTHER_PORT: u16 = 4830;
/// Notes of viewers that may wait to be written.
const NOTES: usize = 64;

/// The page, before the test has a folder; empty if it is not wanted.
pub struct Asked {
    #[cfg(feature = "monitor")]
    page: Option<LivePage>,
}

/// A refusal before anything is made or moved.
#[cfg(feature = "monitor")]
fn unmoved(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow::anyhow!("{error}\nnothing was moved")
}

impl Asked {
    /// Takes the port, and refuses one that is not free before anything is made or moved.
    #[cfg(feature = "monitor")]
    pub fn for_run(args: &RunArgs, test: &Prepared) -> anyhow::Result<Self> {
        let Some(address) = &args.live.live else {
            return Ok(Self { page: None });
        };
        let file = test.loaded.as_ref().map(|loaded| &loaded.file);
        for specimen in file.iter().flat_map(|file| &file.specimen) {
            let link = specimen.link.as_ref();
            if let Some(link) = link.filter(|link| link.needs_port(address, Carrier::Tcp)) {
                anyhow::bail!(
                    "--live {address} is also the address of specimen `{}` ([specimen.link] address = \"{}\")\n\
                     choose another port for the live page, for example --live {OTHER_PORT}\nnothing was moved",
                    specimen.name,
                    link.address
                );
            }
        }
        let view = args.live.live_token.as_deref().map(Token::read);
        let view = view.transpose().map_err(unmoved)?;
        let page = LivePage::bind(address, view).map_err(unmoved)?;
        Ok(Self { page: Some(page) })
    }

    /// Without the feature there is no live page.
    #[cfg(not(feature = "monitor"))]
    pub fn for_run(_args: &RunArgs, _test: &Prepared) -> anyhow::Result<Self> {
        Ok(Self {})
    }

    /// Whether there is one.
    pub const fn is_wanted(&self) -> bool {
        #[cfg(feature = "monitor")]
        {
            self.page.is_some()
        }
        #[cfg(not(feature = "monitor"))]
        {
            false
        }
    }
}

/// A test with its board.
pub struct Looked {
    /// State of the test.
    pub board: Arc<Board>,
    #[cfg(feature = "monitor")]
    notes: Sender<Note>,
    tap: Option<Tap>,
}

impl Looked {
    /// The board of a test that is about to run into `folder`.
    pub fn at(test: &Prepared, folder: &Path, phase: PhaseCell) -> Self {
        let facts = &test.facts;
        let about = About {
            title: facts.title.clone(),
            run: folder.display().to_string(),
            real_clock: facts.clock == ClockChoice::Real,
            lambda: lambda(facts),
            actuators: actuators(test),
            goes_on: facts.resumed.as_ref().map(|(run, after)| GoesOn {
                run: run.display().to_string(),
                after: *after,
            }),
        };
        let online = facts
            .structure
            .as_ref()
            .and_then(|structure| structure.online_limit.clone());
        let subject = Subject::new(&test.experiment, about);
        let board = Arc::new(Board::new(subject, phase, online));
        let (sender, written) = bounded(NOTES);
        // Without a page there are no notes.
        #[cfg(not(feature = "monitor"))]
        drop(sender);
        Self {
            tap: Some(Tap::new(Arc::clone(&board), written)),
            board,
            #[cfg(feature = "monitor")]
            notes: sender,
        }
    }

    /// The reader of the rows; the first call only.
    pub fn onlooker(&mut self) -> Option<Box<dyn Onlooker>> {
        let tap = self.tap.take()?;
        Some(Box::new(tap))
    }

    /// The starter of the page, and the address at which it will be.
    #[cfg(feature = "monitor")]
    pub fn page(
        &self,
        asked: Asked,
        operator: Sender<Operator>,
        served: &Served,
    ) -> Option<Attendance> {
        let page = asked.page?;
        announce(&page);
        let (board, notes) = (Arc::clone(&self.board), self.notes.clone());
        let place = Arc::clone(&served.0);
        Some(Box::new(move || {
            let serving = page.serve(board, operator, notes)?;
            // Only this thread holds the lock.
            if let Ok(mut place) = place.lock() {
                *place = Some(serving);
            }
            Ok(())
        }))
    }

    /// The end of the test, for all viewers.
    #[cfg(feature = "monitor")]
    pub fn ended(finished: &Finished, report: Option<&Path>) -> Ended {
        let status = match serde_json::to_value(finished.summary.status) {
            Ok(serde_json::Value::String(word)) => word,
            _ => String::new(),
        };
        Ended {
            status,
            reason: finished.summary.reason.clone(),
            report: report.map(|path| path.display().to_string()),
            data: finished.folder.path().display().to_string(),
        }
    }
}

/// The page that is served, from its start to the end of the test.
#[cfg(feature = "monitor")]
#[derive(Default)]
pub struct Served(Arc<std::sync::Mutex<Option<Serving>>>);

#[cfg(feature = "monitor")]
impl Served {
    /// Tells the viewers how the test ended and closes when they know.
    pub fn end(&self, ended: Ended) {
        let serving = self.0.lock().ok().and_then(|mut place| place.take());
        if let Some(serving) = serving {
            serving.end(ended);
        }
    }
}

/// Shows the address of the page and the token for operating; to stderr, since stdout belongs to the result.
#[cfg(feature = "monitor")]
fn announce(page: &LivePage) {
    tell(format_args!("live page: {}", page.link()));
    tell(format_args!(
        "control token (HOLD, CONTINUE, CONFIRM, STOP on the page): {}",
        page.control_token().text()
    ));
    if !page.is_open() {
        tell(
            "the live page is open to the network, without encryption: the address above gives read access, and the control \
             token gives control of the test",
        );
    }
}

/// Stroke and largest force of each simulated actuator.
fn actuators(test: &Prepared) -> Vec<ActuatorEnds> {
    let file = test.loaded.as_ref().map(|loaded| &loaded.file);
    let specimens = file.iter().flat_map(|file| &file.specimen);
    let infinite = |end: Option<f64>| end.unwrap_or(f64::INFINITY);
    specimens
        .map(|specimen| {
            let transfer = specimen.own_transfer();
            transfer.map_or_else(ActuatorEnds::default, |transfer| ActuatorEnds {
                stroke: infinite(transfer.stroke_m),
                force: infinite(transfer.force_limit_n),
            })
        })
        .collect()
}

fn lambda(facts: &Facts) -> Option<LambdaUse> {
    let structure = facts.structure.as_ref()?;
    let limit = structure.stability.lambda_limit();
    let declared_limit = limit.unwrap_or(f64::NAN);
    Some(LambdaUse {
        used: structure.lambda?.value(),
        declared_limit,
        proven: limit.is_some(),
    })
}
