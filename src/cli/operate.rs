//! `gusset stop`, `hold` and `continue`: what an operator says to a running test.

use std::path::Path;
use std::time::Duration;

use super::answer;
use super::args::OperateArgs;
use super::exit::{Exit, WithExit};
use crate::engine::Phase;
use crate::session::{Request, ask, pause};

/// How long the test may take to do what it is told, unless it is told to end.
const PATIENCE: Duration = Duration::from_secs(10);
/// Time between two looks.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Says it, and waits until it is so.
pub fn operate(args: &OperateArgs, request: Request) -> anyhow::Result<Exit> {
    let folder = args.run.as_path();
    let told = tell_test(folder, request)?;
    if !told.accepted {
        return Err(WithExit(
            Exit::Stopped,
            format!("{}: its queue of requests is full", folder.display()),
        )
        .into());
    }
    let mut waited = Duration::ZERO;
    loop {
        let now = ask(folder, Request::Phase).map(|answer| answer.phase);
        let word = match (request, now) {
            // The desk is closed: the test is over.
            (_, Err(_)) => Some("ended"),
            (Request::Hold, Ok(Phase::Holding)) => Some("holding"),
            (Request::Continue, Ok(Phase::Running)) => Some("running"),
            (Request::Continue, Ok(Phase::Ramping | Phase::Settling | Phase::Armed)) => {
                Some("confirmed")
            }
            (Request::Hold | Request::Continue, Ok(phase)) if waited >= PATIENCE => {
                let text = format!(
                    "{}: it is {} after {} s",
                    folder.display(),
                    phase.word(),
                    PATIENCE.as_secs()
                );
                return Err(WithExit(Exit::Stopped, text).into());
            }
            _ => None,
        };
        if let Some(word) = word {
            answer(word)?;
            return Ok(Exit::Done);
        }
        pause(LOOK_EVERY);
        waited += LOOK_EVERY;
    }
}

fn tell_test(folder: &Path, request: Request) -> anyhow::Result<crate::session::Answer> {
    ask(folder, request).map_err(|error| {
        let text = if folder.join("summary.json").exists() {
            format!("{}: this test is over", folder.display())
        } else {
            format!("{}: no test is running here: {error}", folder.display())
        };
        WithExit(Exit::Usage, text).into()
    })
}
