//! Waiting times: each has a maximum, so that a typing error (ms for s, one zero too many) shows before anything moves and not
//! during the motion.

use super::Findings;
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::echo::number;
use crate::link_table::{LinkSpec, WATCHDOG_MAX_S};
use crate::safety::SafetyTable;
use crate::schema::{RecordTable, TestFile};
use crate::steps::Time;
use crate::timetable::ClockChoice;
use crate::timing_table::TimingSpec;

/// Longest time in s in which the specimens hold and nothing happens yet: zeroing, warming up, easing.
const STANDING_S: f64 = 600.0;
/// Longest time in s for an answer of one end, a ramp, or a tick.
const OWED_S: f64 = 3600.0;
/// Longest busy loop in µs, as in `[timing]`.
const SPIN_US: f64 = 1e6;
/// Slowest return move in m/s: a millimetre in a quarter of an hour.
const SLOWEST_EXIT_M_PER_S: f64 = 1e-6;
/// This many ticks of warm-up are not a typing error, however long they are.
const FEW_TICKS: u64 = 200;
/// Seconds of rows that a queue may hold in memory.
const QUEUE_S: f64 = 600.0;
/// Most trials of a certificate.
const MOST_TRIALS: u32 = 1_000_000;
/// Most iterations of a step: Newton's method needs a handful, or it has none.
const MOST_ITERATIONS: u32 = 10_000;

impl Findings {
    /// At most this, where given; infinity and NaN are reported elsewhere.
    pub(super) fn at_most(
        &mut self,
        at: &KeyPath,
        key: &str,
        value: Option<f64>,
        (most, unit): (f64, &str),
        why: &str,
    ) {
        if let Some(found) = value
            && found > most
            && found.is_finite()
        {
            let at = at.key(key);
            let headline = format!("`{at}` must be at most {} {unit}", number(most));
            let finding = Finding::error(at, headline).label(format!("found {}", number(found)));
            self.0.push(finding.help(why));
        }
    }
}

/// Everything that a test waits for, but for its links.
pub(super) fn check_waits(file: &TestFile, time: Option<&Time>, findings: &mut Findings) {
    let root = KeyPath::root();
    check_safety(&file.safety, &root.key("safety"), findings);
    check_record(&file.record, findings);
    if let Some(time) = time {
        check_ticks(time, &file.timing, &root, findings);
    }
    let trials = file.certificate.trials;
    if trials > MOST_TRIALS {
        let at = root.key("certificate").key("trials");
        findings.0.push(
            Finding::error(
                at,
                format!("`certificate.trials` must be at most {MOST_TRIALS}"),
            )
            .label(format!("found {trials}"))
            .help("each trial repeats the whole test"),
        );
    }
    if let Some(found) = file.integrator.newton_iterations
        && found > MOST_ITERATIONS
    {
        let at = root.key("integrator").key("newton_iterations");
        let headline = format!("`integrator.newton_iterations` must be at most {MOST_ITERATIONS}");
        let finding = Finding::error(at, headline).label(format!("found {found}"));
        findings
            .0
            .push(finding.help("a step that needs more iterations does not converge"));
    }
}

fn check_safety(safety: &SafetyTable, at: &KeyPath, findings: &mut Findings) {
    let standing = "the specimens hold during this time";
    for (key, value) in [("zero_s", safety.zero_s), ("ease_s", Some(safety.ease_s))] {
        findings.at_most(at, key, value, (STANDING_S, "s"), standing);
    }
    let way = "the shortest time of a motion; limits of speed make it longer where needed";
    findings.at_most(at, "ramp_s", Some(safety.ramp_s), (OWED_S, "s"), way);
    if let Some(found) = safety.exit_speed_m_per_s
        && found > 0.0
        && found < SLOWEST_EXIT_M_PER_S
    {
        let at = at.key("exit_speed_m_per_s");
        let headline = format!(
            "`{at}` must be at least {} m/s",
            number(SLOWEST_EXIT_M_PER_S)
        );
        let finding = Finding::error(at, headline).label(format!("found {}", number(found)));
        findings
            .0
            .push(finding.help("a slower specimen would not reach its end position"));
    }
}

/// The record of a test, or of a served specimen.
pub(super) fn check_record(record: &RecordTable, findings: &mut Findings) {
    let at = KeyPath::root().key("record");
    let memory = "waiting rows are kept in memory";
    findings.at_most(&at, "queue_s", Some(record.queue_s), (QUEUE_S, "s"), memory);
    let proof = "a resumed test is verified from one checkpoint to the next";
    findings.at_most(
        &at,
        "checkpoint_s",
        Some(record.checkpoint_s),
        (OWED_S, "s"),
        proof,
    );
}

fn check_ticks(time: &Time, timing: &TimingSpec, root: &KeyPath, findings: &mut Findings) {
    let tick_s = time.period.value();
    if time.clock == ClockChoice::Real && tick_s > OWED_S {
        findings.0.push(
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
            findings.0.push(
                Finding::error(at, format!("`timing.warmup_ticks` must be at most {most}"))
                    .label(format!("found {ticks}: {} s", number(takes)))
                    .help(format!(
                        "the specimens hold during this time, at most {STANDING_S} s"
                    )),
            );
        }
    }
}

/// Waits of one link and of its other end, in a test of this time.
pub(super) fn check_link_waits(
    link: &LinkSpec,
    time: Option<&Time>,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let owed = "the test waits this long for a missing reply";
    for (key, value) in [
        ("connect_timeout_s", Some(link.connect_timeout_s)),
        ("reply_timeout_s", Some(link.reply_timeout_s)),
    ] {
        findings.at_most(at, key, value, (OWED_S, "s"), owed);
    }
    let silent = "the server holds after this time without a command";
    findings.at_most(
        at,
        "watchdog_s",
        link.watchdog_s,
        (WATCHDOG_MAX_S, "s"),
        silent,
    );
    if let (Some(watchdog_s), Some(time)) = (link.watchdog_s, time) {
        let apart_s = time.between_commands_s(link);
        if watchdog_s > 0.0 && watchdog_s < apart_s {
            let at = at.key("watchdog_s");
            let headline = format!("`{at}` must be at least {} s", number(apart_s));
            let finding = Finding::error(at, headline);
            findings
                .0
                .push(finding.label(format!("found {}", number(watchdog_s))).help(
                    "the time between two commands: with less, the server would hold between them",
                ));
        }
    }
    let ramp = "the time of the motion in each direction";
    findings.at_most(
        at,
        "probe_ramp_s",
        Some(link.probe_ramp_s),
        (STANDING_S, "s"),
        ramp,
    );
    let busy = "a busy loop occupies a processor";
    findings.at_most(at, "spin_us", Some(link.spin_us), (SPIN_US, "µs"), busy);
}
