//! Contradictions and values out of range in a test file that are found without building anything.
//!
//! Each error explains the consequence, not only the rule. Checks that need the structure itself (number of DOFs,
//! existence of a storey, symmetry of a matrix) are made where it is built.

mod about;
mod bus;
mod certificate;
mod damping;
mod excitation;
mod geometry;
mod idle;
mod limits;
mod link;
pub mod measured;
mod numbers;
mod on_bus;
mod pace;
mod rules;
mod safety;
mod specimen;
mod waits;
mod way;

use certificate::check_certificate;
pub(super) use certificate::check_samples;
use damping::check_damping;
use excitation::check_excitation;
use limits::{check_limits, check_required};
use rules::Findings;
use specimen::{Source, check_names, check_seeds, check_specimen};
use waits::{check_link_waits, check_ticks};
use way::check_way;

use super::diagnose::Finding;
use super::document::{Datum, KeyPath, Node};
use super::schema::{Method, TestFile};
use super::serve_table::{PaceTable, ServeFile};
use super::specimen::SpecimenTable;
use super::steps::Time;
use super::timetable::ClockChoice;
use super::timing_table::{OnMiss, TimingSpec};
use super::value::DofChoice;
pub use limits::missing_limits;

/// Every number of the document that is not finite, but λ, which may be infinite.
pub(crate) fn not_finite(root: &Node) -> Vec<Finding> {
    let integrator = KeyPath::root().key("integrator");
    let lambda = integrator.key("lambda");
    let is_lambda = |path: &KeyPath| path.starts_with(&lambda);
    let mut findings = Vec::new();
    root.walk(&KeyPath::root(), &mut |path, node| {
        if let Datum::Float(value) = node.datum
            && !value.is_finite()
            && !(is_lambda(path) && value == f64::INFINITY)
        {
            let words = value.to_string().to_lowercase();
            let headline = format!("`{path}` must be a finite number");
            findings.push(Finding::error(path.clone(), headline).label(format!("found {words}")));
        }
    });
    findings
}

/// All that is wrong with `file`, in the order of its tables. `clock_is_chosen`: the user overrides the clock for this run, and
/// knows which keys it ignores.
pub(crate) fn check(file: &TestFile, clock_is_chosen: bool) -> Vec<Finding> {
    let mut findings = Findings::of(file);
    let time = match Time::of(&file.time) {
        Ok(time) => Some(time),
        Err(finding) => {
            findings.push(*finding);
            None
        }
    };
    let tick_s = time.map(|time| time.period.value());
    let root = KeyPath::root();
    let [of_integrator, of_safety, of_timing, of_record] =
        ["integrator", "safety", "timing", "record"].map(|key| root.key(key));
    findings.numbers(
        &root.under("structure.gravity"),
        numbers::NUMBERS_OF_GRAVITY,
    );
    findings.numbers(&of_integrator, numbers::NUMBERS_OF_INTEGRATOR);
    findings.numbers(&of_safety, numbers::NUMBERS_OF_SAFETY);
    findings.numbers(&of_record, numbers::NUMBERS_OF_RECORD);
    check_misses(&file.timing, &of_timing, &mut findings);
    findings.printable(&root.key("title"), Some(&file.title));
    about::check_about(&file.about, &mut findings);
    findings.reasons("accept_unstable accept_trip accept_wiring accept_speed accept_error");
    let unlimited = file.safety.unlimited.as_deref();
    findings.printable(&of_safety.key("unlimited"), unlimited);
    match &file.structure {
        Some(_) => findings.exactly_one(
            &root.key("structure"),
            &["shear_building", "matrices", "chain", "frame"],
            "a test has one structure",
        ),
        None if file.specimen.is_empty() => findings.push(
            Finding::error(root.clone(), "this test has neither a `[structure]` nor a `[[specimen]]`")
                .help("a test needs a `[structure]`, or a `[[specimen]]` with a prescribed displacement, or both"),
        ),
        None => {}
    }
    check_integrator(file, &mut findings);
    check_damping(file, &mut findings);
    check_excitation(file, &mut findings);
    for (index, specimen) in file.specimen.iter().enumerate() {
        let at = root.key("specimen").index(index);
        let source = match file.structure {
            Some(_) => Source::Structure,
            None => Source::Prescribed,
        };
        check_specimen(specimen, source, &at, &mut findings);
        check_limits(specimen, tick_s, Some(&file.safety), &at, &mut findings);
        link::check_pace(specimen, file, &at, &mut findings);
        check_way(specimen, file, &at, &mut findings);
        measured::check_measured(specimen, &at, &mut findings);
        findings.idle(&at, idle::IDLE_SPECIMEN_OF_TEST, |when| {
            when(specimen, file)
        });
        for (index, axis) in specimen.axis.iter().enumerate() {
            let at = at.key("axis").index(index);
            findings.idle(&at, idle::IDLE_AXIS_OF_TEST, |when| when(axis));
        }
        if let Some(link) = &specimen.link {
            check_link_waits(link, time.as_ref(), &at.key("link"), &mut findings);
            findings.idle(&at.key("link"), idle::IDLE_LINK, |when| when(link));
        }
    }
    bus::check_buses(&file.bus, &file.specimen, tick_s, &mut findings);
    measured::check_judged(file, &mut findings);
    check_required(&file.specimen, unlimited, &mut findings);
    check_names(&file.specimen, &mut findings);
    link::check_shared(&file.specimen, &mut findings);
    check_seeds(&file.specimen, &mut findings);
    let remote = file.specimen.iter().any(|specimen| specimen.link.is_some());
    if remote && file.timing.on_miss == OnMiss::CatchUp {
        let text = "`on_miss = \"catch_up\"` is not allowed with a specimen behind a link";
        let finding = Finding::error(of_timing.key("on_miss"), text)
            .label("it would move the specimen faster than planned")
            .help("use \"stretch\", which never moves it faster than planned, or \"stop\"");
        findings.push(finding);
    }
    safety::check_safety(file, &mut findings);
    check_certificate(file, &mut findings);
    if let Some(DofChoice::Listed(dofs)) = &file.record.dofs {
        findings.dofs(&of_record.key("dofs"), dofs);
    }
    if let Some(time) = time {
        check_ticks(&time, &file.timing, &mut findings);
    }
    findings.idle(&root.key("time"), idle::IDLE_TIME, |when| when(file));
    findings.idle(&of_integrator, idle::IDLE_INTEGRATOR, |when| when(file));
    findings.idle(&of_safety, idle::IDLE_SAFETY, |when| when(file));
    findings.idle(&of_timing, idle::IDLE_TIMING, |when| when(&file.timing));
    findings.idle(&of_timing, idle::IDLE_TIMING_OF_TEST, |when| {
        when(&file.timing)
    });
    if file.time.clock == ClockChoice::Simulated && !clock_is_chosen {
        check_clock(&of_timing, &mut findings);
    }
    findings.idle(&of_record, idle::IDLE_RECORD, |when| when(file));
    findings.list
}

/// The ranges of `[timing]`; a warning that would come with the end of the test, or after it, is refused.
fn check_misses(timing: &TimingSpec, at: &KeyPath, findings: &mut Findings) {
    findings.numbers(at, numbers::NUMBERS_OF_TIMING);
    for (key, levels) in timing.misses.entries() {
        if let (Some(warn), Some(most)) = (levels.warn, levels.trip)
            && warn >= most
        {
            let at = at.key("misses").key(key).key("warn");
            let text = format!("`{at}` is {warn}, but must be less than {most}");
            let finding = Finding::error(at, text);
            findings.push(finding.label("the test stops at that number"));
        }
    }
}

/// On the simulated clock no thread waits for an edge, and no request goes to the machine: one finding for all keys.
fn check_clock(at: &KeyPath, findings: &mut Findings) {
    let keys = findings.given(at, idle::REAL_CLOCK);
    let Some(first) = keys.first() else { return };
    let named = keys.iter().filter_map(KeyPath::last_key);
    let named: Vec<String> = named.map(|key| format!("`{key}`")).collect();
    let headline = format!(
        "the simulated clock needs no real-time settings and misses no deadlines, so these keys have no effect: {}",
        named.join(", ")
    );
    let finding = Finding::warning(first.clone(), headline).at_key();
    let clock = KeyPath::root().under("time.clock");
    findings.push(
        finding
            .label("only for the real clock")
            .beside(clock, "simulated here"),
    );
}

/// All that is wrong with the specimens of a file that is only served.
pub(crate) fn check_served(file: &ServeFile) -> Vec<Finding> {
    let mut findings = Findings::of(file);
    let root = KeyPath::root();
    findings.numbers(&root.key("record"), numbers::NUMBERS_OF_RECORD);
    findings.numbers(&root.key("serve"), numbers::NUMBERS_OF_SERVE);
    if let Some(pace) = &file.serve.pace {
        check_pace(pace, &mut findings);
        pace::check(pace, file, &mut findings);
    }
    if file.specimen.is_empty() {
        let text = "this file has no `[[specimen]]` to serve";
        findings.push(Finding::error(root.clone(), text));
    }
    for (index, specimen) in file.specimen.iter().enumerate() {
        let at = root.key("specimen").index(index);
        check_specimen(specimen, Source::Client, &at, &mut findings);
        check_limits(specimen, None, None, &at, &mut findings);
        findings.idle(&at, idle::IDLE_SPECIMEN_OF_SERVER, |when| when(specimen));
        if specimen.link.is_some() {
            specimen::refuse_relative_zeros(specimen, &at, &mut findings);
        } else {
            let (keys, why) = idle::IDLE_AXIS_OF_SERVER;
            for index in 0..specimen.axis.len() {
                findings.no_effect(&at.key("axis").index(index), keys, why);
            }
        }
        measured::check_measured(specimen, &at, &mut findings);
        check_served_compensation(specimen, file.serve.pace.is_some(), &at, &mut findings);
    }
    bus::check_buses(&file.bus, &file.specimen, None, &mut findings);
    let unlimited = file.safety.as_ref();
    let unlimited = unlimited.and_then(|safety| safety.unlimited.as_deref());
    findings.printable(&root.key("title"), Some(&file.title));
    about::check_about(&file.about, &mut findings);
    findings.printable(&root.under("safety.unlimited"), unlimited);
    findings.reasons("accept_wiring accept_speed");
    if let Some(timing) = &file.timing {
        let at = root.key("timing");
        check_misses(timing, &at, &mut findings);
        findings.idle(&at, idle::IDLE_TIMING, |when| when(timing));
        findings.idle(&at, idle::IDLE_TIMING_OF_SERVER, |when| when(timing));
    }
    let (keys, why) = idle::IDLE_RECORD_OF_SERVER;
    findings.no_effect(&root.key("record"), keys, why);
    check_required(&file.specimen, unlimited, &mut findings);
    check_names(&file.specimen, &mut findings);
    findings.list
}

/// Refuses a pace that takes longer to a target than a person waits.
fn check_pace(pace: &PaceTable, findings: &mut Findings) {
    /// Longest path to one target, s.
    const MOST_S: f64 = 60.0;
    let ticks = [
        ("ticks_per_step", pace.ticks_per_step),
        ("settle_ticks", pace.settle_ticks),
    ];
    for (key, ticks) in ticks {
        if f64::from(ticks) / pace.rate_hz > MOST_S {
            let at = KeyPath::root().under("serve.pace").key(key);
            let text = format!("`{at}` must be at most {MOST_S} s of ticks");
            findings.push(Finding::error(at, text).label(format!("found {ticks}")));
        }
    }
}

/// A compensator of a served specimen: only a gateway that paces has evenly spaced commands.
fn check_served_compensation(
    specimen: &SpecimenTable,
    is_paced: bool,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let (text, help) = match (&specimen.compensation, &specimen.link) {
        (None, _) => return,
        (Some(_), Some(_)) if is_paced => return,
        (Some(_), Some(_)) => (
            "a compensator needs evenly spaced commands",
            "give `pace` in [serve], for example pace = { ticks_per_step = 20, rate_hz = 1000 }, or compensate in the \
             controller's test file",
        ),
        (Some(_), None) => (
            "a computed specimen is served without compensation",
            "compensation belongs in the controller's test file",
        ),
    };
    let finding = Finding::error(at.key("compensation"), text).at_key();
    findings.push(finding.label("no effect here").help(help));
}

fn check_integrator(file: &TestFile, findings: &mut Findings) {
    let table = &file.integrator;
    let integrator = KeyPath::root().key("integrator");
    let method = integrator.key("method");
    let without_effect = match table.method {
        Method::Gui => "rho_infinity weighting newton_tolerance newton_iterations",
        _ if table.is_alpha() => {
            "lambda gain_bound rest_damping_share start newton_tolerance newton_iterations"
        }
        _ => "lambda gain_bound rest_damping_share start rho_infinity weighting",
    };
    for key in findings.given(&integrator, without_effect) {
        let headline = format!("`{key}` has no effect with this method");
        let finding = Finding::error(key, headline).at_key();
        findings.push(finding.beside(method.clone(), "the method"));
    }
    if table.is_alpha() && table.rho_infinity.is_none() {
        let finding = Finding::error(method.clone(), "this method needs `rho_infinity`");
        findings
            .push(finding.help("rho_infinity = 1 damps nothing, 0 damps high frequencies most"));
    }
    let Some(reason) = table.why_no_specimen() else {
        return;
    };
    if !file.specimen.is_empty() {
        let finding = Finding::error(method, "this method cannot command a specimen")
            .label(reason)
            .beside(KeyPath::root().key("specimen").index(0), "the specimen");
        findings.push(finding.help(
            "use \"gui\", or \"kr_alpha\" or \"mkr_alpha\" with weighting = \"forces\": they are explicit in displacement and velocity",
        ));
    } else if file.time.clock == ClockChoice::Real {
        let finding = Finding::error(method, "this method cannot run on the real clock")
            .label(reason)
            .help("use `clock = \"simulated\"` in [time], or --clock simulated");
        findings.push(finding);
    }
}

#[cfg(test)]
mod tests {
    use super::idle::*;
    use super::numbers::*;
    use super::rules::{Idle, Range, USUAL};
    use super::*;
    use crate::certificate::value_at;
    use crate::hints::Hints;

    fn keys_of<When>(rules: &[Idle<When>]) -> Vec<&'static str> {
        let keys = rules.iter().flat_map(|(keys, ..)| keys.split_whitespace());
        keys.filter(|key| *key != "*").collect()
    }

    fn numbers_of(ranges: &[Range]) -> Vec<&'static str> {
        let keys = ranges.iter().flat_map(|(keys, _)| keys.split_whitespace());
        keys.collect()
    }

    #[test]
    fn each_key_of_a_rule_is_in_the_schema() {
        let served = Hints::of::<ServeFile>();
        for key in numbers_of(NUMBERS_OF_SERVE) {
            assert!(
                served.knows(&KeyPath::root().key("serve").under(key)),
                "{key}"
            );
        }
        let test = Hints::of::<TestFile>();
        let axis_of_server = IDLE_AXIS_OF_SERVER.0.split_whitespace().collect();
        let record_of_server = IDLE_RECORD_OF_SERVER.0.split_whitespace().collect();
        for (table, keys) in [
            ("time", keys_of(IDLE_TIME)),
            ("structure.gravity", numbers_of(NUMBERS_OF_GRAVITY)),
            ("integrator", keys_of(IDLE_INTEGRATOR)),
            ("integrator", numbers_of(NUMBERS_OF_INTEGRATOR)),
            ("safety", keys_of(IDLE_SAFETY)),
            ("safety", numbers_of(NUMBERS_OF_SAFETY)),
            ("timing", keys_of(IDLE_TIMING)),
            ("timing", numbers_of(NUMBERS_OF_TIMING)),
            ("timing", keys_of(IDLE_TIMING_OF_TEST)),
            ("timing", keys_of(IDLE_TIMING_OF_SERVER)),
            ("timing", REAL_CLOCK.split_whitespace().collect()),
            ("record", keys_of(IDLE_RECORD)),
            ("record", record_of_server),
            ("record", numbers_of(NUMBERS_OF_RECORD)),
            ("certificate", numbers_of(NUMBERS_OF_CERTIFICATE)),
            ("uncertainty[0]", numbers_of(NUMBERS_OF_UNCERTAINTY)),
            ("specimen[0]", keys_of(IDLE_SPECIMEN)),
            ("specimen[0]", keys_of(IDLE_SPECIMEN_OF_TEST)),
            ("specimen[0]", keys_of(IDLE_SPECIMEN_OF_SERVER)),
            ("specimen[0]", numbers_of(NUMBERS_OF_SPECIMEN)),
            ("specimen[0].axis[0]", keys_of(IDLE_AXIS_OF_TEST)),
            ("specimen[0].axis[0]", axis_of_server),
            ("specimen[0].axis[0]", numbers_of(NUMBERS_OF_AXIS)),
            ("specimen[0].link", keys_of(IDLE_LINK)),
            ("specimen[0].link", numbers_of(NUMBERS_OF_LINK)),
            ("bus.rig", numbers_of(NUMBERS_OF_BUS)),
            ("specimen[0].bus", keys_of(IDLE_BUS)),
            ("specimen[0].bus", numbers_of(NUMBERS_OF_SPECIMEN_ON_BUS)),
            (
                "specimen[0].bus.axis[0]",
                numbers_of(NUMBERS_OF_AXIS_ON_BUS),
            ),
        ] {
            let table = KeyPath::parse(table).unwrap();
            for key in keys {
                assert!(test.knows(&table.under(key)), "{table}: {key}");
            }
        }
    }

    /// A key with a default counts as given if its default is unknown.
    #[test]
    fn the_least_file_has_every_default() {
        for path in [
            "time.prediction_order",
            "safety.ramp_s",
            "timing.misses.window_s",
            "record.checkpoint_s",
            "specimen[0].similitude.time",
            "specimen[0].axis[0].scale",
            "specimen[0].link.probe_ramp_s",
            "specimen[0].link.openfresco.site",
            "specimen[0].transfer.seed",
            "specimen[0].compensation.ats.gain",
            "specimen[0].limits.stuck_travel_m",
        ] {
            let path = KeyPath::parse(path).unwrap();
            assert!(value_at(&USUAL, &path).is_some(), "{path}");
        }
    }
}
