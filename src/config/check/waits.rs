//! Waiting times that depend on the tick: each has a maximum, so that a typing error (ms for s, one zero too many) shows before
//! anything moves and not during the motion.

use super::Findings;
use super::numbers::{OWED_S, STANDING_S};
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::echo::number;
use crate::link_table::{LinkSpec, Protocol};
use crate::steps::Time;
use crate::timetable::ClockChoice;
use crate::timing_table::TimingSpec;

/// This many ticks of warm-up are not a typing error, however long they are.
const FEW_TICKS: u64 = 200;

/// The ticks of a test, and of its warm-up.
pub(super) fn check_ticks(time: &Time, timing: &TimingSpec, findings: &mut Findings) {
    let root = KeyPath::root();
    let tick_s = time.period.value();
    if time.clock == ClockChoice::Real && tick_s > OWED_S {
        findings.push(
            Finding::error(
                root.key("time"),
                format!("a tick takes {} s of wall time", number(tick_s)),
            )
            .label(format!("at most {OWED_S} s"))
            .help(
                "a tick is scale · step / `ticks_per_step`; the simulated clock has no such limit",
            ),
        );
    }
    if let Some(ticks) = timing.warmup_ticks {
        let takes = ticks as f64 * tick_s;
        if takes > STANDING_S && ticks > FEW_TICKS {
            let at = root.key("timing").key("warmup_ticks");
            let most = (STANDING_S / tick_s).floor().max(FEW_TICKS as f64);
            findings.push(
                Finding::error(at, format!("`timing.warmup_ticks` must be at most {most}"))
                    .label(format!("found {ticks}: {} s", number(takes)))
                    .help(format!(
                        "the specimens hold during this time, at most {STANDING_S} s"
                    )),
            );
        }
    }
}

/// The watchdog of one link, in a test of this time.
pub(super) fn check_link_waits(
    link: &LinkSpec,
    time: Option<&Time>,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let (Some(watchdog_s), Some(time)) = (link.watchdog_s, time) else {
        return;
    };
    if link.protocol == Protocol::Ethercat {
        return;
    }
    let apart_s = time.between_commands_s(link);
    if watchdog_s > 0.0 && watchdog_s < apart_s {
        let at = at.key("watchdog_s");
        let headline = format!("`{at}` must be at least {} s", number(apart_s));
        let finding = Finding::error(at, headline).label(format!("found {}", number(watchdog_s)));
        let why = "the time between two commands: with less, the server would hold between them";
        findings.push(finding.help(why));
    }
}
