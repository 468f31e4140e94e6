//! `gusset stop`, `hold` and `continue`: the operator's requests to a running test.
//!
//! A test that does not answer is not over: the command retries, and a stop or a hold waits in the socket. A continue names
//! the hold that it ends, and the test carries it out only while its sender is connected.

use std::path::Path;
use std::time::Duration;

use super::args::OperateArgs;
use super::exit::{Exit, WithExit};
use super::{answer, tell};
use gusset_control::engine::{Glimpse, Phase};
use gusset_record::Run;
use gusset_record::rt::os::monotonic_ns;
use gusset_record::summary::Status;
use gusset_session::{Answer, Request, Unanswered, ask, pause};

/// How long a test that answers may take to carry out a request other than stop.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long the command retries if a test does not answer.
const SILENCE: Duration = Duration::from_secs(60);
/// A control socket that just closes hangs up on waiting clients: shorter silences are not reported.
const WORTH_A_WORD: Duration = Duration::from_secs(1);
/// Time between two looks.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// An operator command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// End the test.
    Stop,
    /// Stop test time.
    Hold,
    /// End the hold, or confirm the sensor readings: the state of the test decides which.
    Continue,
}

/// Says it, and waits until it is so.
pub fn operate(args: &OperateArgs, order: Order) -> anyhow::Result<Exit> {
    let word = say(&args.run, order)
        .map_err(|(exit, text)| WithExit(exit, format!("{}: {text}", args.run.display())))?;
    answer(word)?;
    Ok(Exit::Done)
}

/// Why it is not so.
type Refusal = (Exit, String);

fn say(folder: &Path, order: Order) -> Result<String, Refusal> {
    // `continue` first checks the state of the test: sent blindly, it could do more than intended.
    let mut word = match order {
        Order::Stop => Some(Request::Stop),
        Order::Hold => Some(Request::Hold),
        Order::Continue => None,
    };
    let mut is_told = false;
    let (mut was_leaving, mut is_release) = (false, false);
    let mut waited = Duration::ZERO;
    let (mut silent_since, mut warned) = (None, false);
    loop {
        let began = monotonic_ns();
        // A request in the socket is not repeated: a second stop would freeze the return move.
        let asked = word.filter(|_| !is_told).unwrap_or(Request::Phase);
        match ask(folder, asked) {
            Ok(Answer { accepted, seen }) => {
                silent_since = None;
                // The phase before the request took effect: the control socket reads it first.
                was_leaving |= !is_told && seen.phase == Phase::Leaving;
                is_release |= asked == Request::Confirm && accepted && seen.awaits_release();
                match word {
                    None => {
                        word = Some(to_go_on(seen));
                        continue;
                    }
                    // Confirmed elsewhere, meanwhile.
                    Some(Request::Confirm) if !accepted && !seen.unconfirmed => is_told = true,
                    Some(Request::Continue { hold }) if !accepted && seen.hold_number != hold => {
                        return Err(another_hold(hold, seen));
                    }
                    Some(_) if !accepted => return Err(not_taken(seen.phase)),
                    Some(Request::Confirm) if is_release && !seen.unconfirmed => {
                        return Ok("confirmed: torque and outputs end".to_owned());
                    }
                    Some(_) if is_release && waited < PATIENCE => is_told = true,
                    Some(word) if is_told => {
                        if let Some(outcome) = judge(word, seen, waited >= PATIENCE) {
                            return outcome;
                        }
                    }
                    Some(_) => is_told = true,
                }
                waited += LOOK_EVERY;
            }
            Err(Unanswered::Over(_)) if is_release => return Ok("ended".to_owned()),
            Err(Unanswered::Over(_)) if is_told => {
                return over(word.unwrap_or(Request::Phase), was_leaving, || {
                    ended_otherwise(folder)
                });
            }
            Err(Unanswered::Over(_)) if folder.join("summary.json").exists() => {
                return Err((Exit::Usage, OVER.to_owned()));
            }
            Err(error @ (Unanswered::Over(_) | Unanswered::Barred(_))) => {
                return Err((Exit::Usage, error.to_string()));
            }
            Err(error @ Unanswered::Silent { left, .. }) => {
                is_told |= left && asked != Request::Phase && !asked.lets_move();
                let since = *silent_since.get_or_insert(began);
                let silent = Duration::from_nanos(monotonic_ns().saturating_sub(since));
                if silent >= SILENCE {
                    return Err((Exit::Link, given_up(is_told)));
                }
                if silent >= WORTH_A_WORD && !std::mem::replace(&mut warned, true) {
                    let (folder, most) = (folder.display(), SILENCE.as_secs());
                    tell(format_args!(
                        "{folder}: {error}, which is not its end: asked on for up to {most} s"
                    ));
                }
            }
        }
        pause(LOOK_EVERY);
    }
}

/// The request that continues a test in this state. An open confirmation is answered; during a hold only the hold ends, because
/// the operator cannot confirm a question that was not shown.
const fn to_go_on(seen: Glimpse) -> Request {
    if seen.unconfirmed && !seen.hold {
        Request::Confirm
    } else {
        Request::Continue {
            hold: seen.hold_number,
        }
    }
}

/// The hold to be ended is not the present one.
fn another_hold(named: u32, seen: Glimpse) -> Refusal {
    let latest = seen.hold_number;
    let text = format!(
        "this `continue` is for hold {named}, and hold {latest} was requested later: the test is still on hold; check it, and send \
         `gusset continue` again"
    );
    (Exit::Stopped, text)
}

const OVER: &str = "this test is over";

/// The result after the request, when the control socket has closed.
fn over(
    request: Request,
    was_leaving: bool,
    otherwise: impl FnOnce() -> Option<String>,
) -> Result<String, Refusal> {
    let too_late = match request {
        Request::Stop if was_leaving => {
            let text = "ended: the shutdown was cut short, and specimens that were still moving hold where they are";
            return Ok(text.to_owned());
        }
        Request::Stop | Request::Phase => {
            return match otherwise() {
                None => Ok("ended".to_owned()),
                Some(reason) => {
                    let text = format!("ended, but not as requested: {reason}");
                    Err((Exit::Stopped, text))
                }
            };
        }
        Request::Hold => "the test ended before it was on hold",
        Request::Continue { .. } => "the test ended before it continued",
        Request::Confirm => "the test ended before it received the confirmation",
    };
    Err((Exit::Stopped, too_late.to_owned()))
}

/// Why a test that should stop did not end cleanly, for example a trip during shutdown. `None` if it ended cleanly, or does
/// not report.
fn ended_otherwise(folder: &Path) -> Option<String> {
    let mut waited = Duration::ZERO;
    while !folder.join("summary.json").exists() {
        if waited >= PATIENCE {
            return None;
        }
        pause(LOOK_EVERY);
        waited += LOOK_EVERY;
    }
    let run = Run::open(folder).ok()?;
    let summary = run.summary()?;
    let in_order = matches!(summary.status, Status::Completed | Status::Interrupted);
    (!in_order).then(|| summary.reason.clone())
}

fn given_up(is_told: bool) -> String {
    let request = if is_told {
        "it carries out the request as soon as it can; its specimens can move until then"
    } else {
        "the request did not reach it; its specimens can move"
    };
    let seconds = SILENCE.as_secs();
    format!("the test has not answered for {seconds} s and has not ended: {request}")
}

/// It was asked, and does not take it; an end is always taken.
fn not_taken(phase: Phase) -> Refusal {
    let full = "its queue of requests is full, and this request is not in it: send it again";
    refusal(phase).unwrap_or_else(|| (Exit::Stopped, full.to_owned()))
}

/// Why a hold or `continue` is impossible in this phase; `None` if it is possible.
fn refusal(phase: Phase) -> Option<Refusal> {
    match phase {
        Phase::Leaving => {
            let text = "the test is shutting down: `hold` and `continue` have no effect; `gusset stop` freezes the specimens where they are";
            Some((Exit::Stopped, text.to_owned()))
        }
        Phase::Tripped => {
            let text = "the test has tripped: `hold` and `continue` have no effect";
            Some((Exit::Stopped, text.to_owned()))
        }
        Phase::Safe => Some((Exit::Usage, OVER.to_owned())),
        _ => None,
    }
}

/// The result of a request, in the present state; `None` if the command must still wait.
fn judge(told: Request, now: Glimpse, long_enough: bool) -> Option<Result<String, Refusal>> {
    let phase = now.phase.word();
    match told {
        Request::Stop | Request::Phase => return None,
        Request::Hold | Request::Continue { .. } | Request::Confirm
            if refusal(now.phase).is_some() =>
        {
            return refusal(now.phase).map(Err);
        }
        Request::Continue { hold } if now.hold && now.hold_number != hold => {
            return Some(Err(another_hold(hold, now)));
        }
        Request::Hold if now.phase == Phase::Holding => return Some(Ok(phase.to_owned())),
        Request::Hold if now.stands => return Some(Ok(format!("holding ({phase})"))),
        Request::Confirm if now.phase == Phase::Zeroing => {}
        Request::Confirm => {
            // From elsewhere, meanwhile.
            let held = if now.hold {
                ", and the test is on hold"
            } else {
                ""
            };
            return Some(Ok(format!("{phase}: the readings are confirmed{held}")));
        }
        // No longer held, and about to continue; or its loop does not listen yet.
        Request::Continue { .. }
            if now.hold || matches!(now.phase, Phase::Holding | Phase::Connected) => {}
        Request::Continue { .. } if now.unconfirmed => {
            let text =
                "the test is not on hold; confirm the readings with another `gusset continue`";
            return Some(Ok(format!("{phase}: {text}")));
        }
        Request::Continue { .. } if now.phase == Phase::Zeroing => {
            return Some(Ok(format!(
                "{phase}: the test is not on hold, and needs no confirmation yet"
            )));
        }
        Request::Continue { .. } => return Some(Ok(phase.to_owned())),
        Request::Hold => {}
    }
    let so_far = match (told, now.hold) {
        (Request::Hold, true) => ": the specimens are coming to rest",
        (Request::Hold, false) => {
            ": it is not on hold: it has not received the request yet, or received `continue` after it"
        }
        (Request::Confirm, _) if now.unconfirmed => ": the readings are not confirmed yet",
        _ if now.phase == Phase::Connected => ": it has not received the request yet",
        (_, true) => ": it is still on hold",
        (_, false) => "",
    };
    let text = format!("it is {phase} after {} s{so_far}", PATIENCE.as_secs());
    long_enough.then_some(Err((Exit::Stopped, text)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn seen(phase: Phase, hold: bool, stands: bool) -> Glimpse {
        Glimpse {
            hold,
            stands,
            ..Glimpse::of(phase)
        }
    }

    fn words(told: Request, now: Glimpse, long_enough: bool) -> String {
        match judge(told, now, long_enough) {
            None => "waits".to_owned(),
            Some(Ok(word)) => word,
            Some(Err((exit, text))) => format!("{exit:?}: {text}"),
        }
    }

    /// `text` holds the parts of `wanted` between `…` in this order, the first at its beginning.
    #[track_caller]
    fn shows(text: &str, wanted: &str) {
        let mut rest = text;
        for (number, part) in wanted.split(" … ").enumerate() {
            let at = rest.find(part);
            assert!(
                at.is_some_and(|at| number > 0 || at == 0),
                "{part:?}: {text}"
            );
            rest = &rest[at.unwrap_or(0) + part.len()..];
        }
        assert!(wanted.contains('…') || rest.is_empty(), "{text}");
    }

    #[test]
    fn hold_is_recognised_in_every_phase() {
        use Phase::{Holding, Leaving, Probing, Ramping, Running, Safe, Tripped, Zeroing};
        for (now, long_enough, said) in [
            (seen(Running, false, false), false, "waits"),
            (seen(Running, true, false), false, "waits"),
            (seen(Holding, true, true), false, "holding"),
            (seen(Ramping, true, false), false, "waits"),
            (seen(Ramping, true, true), false, "holding (ramping)"),
            (seen(Zeroing, true, true), true, "holding (zeroing)"),
            (
                seen(Probing, true, false),
                true,
                "Stopped: … probing … rest",
            ),
            (
                seen(Running, false, false),
                true,
                "Stopped: … running … `continue`",
            ),
            (seen(Tripped, false, false), false, "Stopped: … tripped"),
            (seen(Safe, false, false), false, "Usage: … over"),
        ] {
            shows(&words(Request::Hold, now, long_enough), said);
        }
        let late = words(Request::Hold, seen(Leaving, false, false), false);
        shows(&late, "Stopped: … shutting down");
    }

    #[test]
    fn continue_reports_hold_or_confirmation() {
        use Phase::{Armed, Connected, Holding, Leaving, Ramping, Running, Zeroing};
        let go_on = Request::Continue { hold: 0 };
        let held = |phase| seen(phase, true, true);
        let free = |phase| seen(phase, false, false);
        let asks = |seen| Glimpse {
            unconfirmed: true,
            ..seen
        };
        for (told, now, long_enough, said) in [
            (go_on, held(Holding), false, "waits"),
            (go_on, free(Holding), false, "waits"),
            (go_on, free(Running), false, "running"),
            (go_on, held(Ramping), false, "waits"),
            (go_on, free(Ramping), false, "ramping"),
            // Its loop does not listen yet: a hold may lie before this.
            (go_on, free(Connected), false, "waits"),
            (go_on, free(Connected), true, "Stopped: … connected … 10 s"),
            (go_on, asks(held(Zeroing)), false, "waits"),
            (
                go_on,
                asks(free(Zeroing)),
                false,
                "zeroing: … `gusset continue`",
            ),
            (go_on, free(Zeroing), false, "zeroing: … no confirmation"),
            (Request::Confirm, asks(free(Zeroing)), false, "waits"),
            (Request::Confirm, free(Zeroing), false, "waits"),
            (
                Request::Confirm,
                asks(free(Zeroing)),
                true,
                "Stopped: … zeroing … confirmed",
            ),
            (Request::Confirm, free(Armed), false, "armed: … confirmed"),
            (
                Request::Confirm,
                held(Ramping),
                false,
                "ramping: … confirmed … hold",
            ),
            (go_on, held(Ramping), true, "Stopped: … ramping … hold"),
        ] {
            shows(&words(told, now, long_enough), said);
        }
        let late = words(go_on, free(Leaving), false);
        shows(&late, "Stopped: … shutting down");
    }

    #[test]
    fn continue_ends_only_its_own_hold() {
        let second = Glimpse {
            hold_number: 2,
            ..seen(Phase::Holding, true, true)
        };
        let judged = |hold| judge(Request::Continue { hold }, second, false);
        assert_eq!(judged(1).unwrap().unwrap_err().0, Exit::Stopped);
        assert!(judged(2).is_none());
        assert_eq!(to_go_on(second), Request::Continue { hold: 2 });
    }

    #[test]
    fn refused_request_is_explained() {
        let said = |phase| not_taken(phase).1;
        assert!(said(Phase::Leaving).contains("shutting down"));
        assert!(said(Phase::Running).starts_with("its queue"));
    }

    #[test]
    fn stop_succeeds_only_when_the_test_ends() {
        let in_order = || None;
        assert_eq!(over(Request::Stop, false, in_order).unwrap(), "ended");
        let tripped = || Some("its interlock is open".to_owned());
        let (exit, text) = over(Request::Stop, false, tripped).unwrap_err();
        assert_eq!(exit, Exit::Stopped);
        assert!(text.ends_with("interlock is open"), "{text}");
        let cut = over(Request::Stop, true, in_order).unwrap();
        shows(&cut, "ended: … cut short");
        let go_on = Request::Continue { hold: 1 };
        for request in [Request::Hold, go_on, Request::Confirm] {
            assert_eq!(over(request, false, in_order).unwrap_err().0, Exit::Stopped);
            let told = seen(Phase::Leaving, false, false);
            assert!(judge(Request::Stop, told, true).is_none());
        }
    }
}
