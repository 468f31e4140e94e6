//! Contradictions and values out of range in a test file that are found without building anything.
//!
//! Each error explains the consequence, not only the rule. Checks that need the structure itself (number of DOFs,
//! existence of a storey, symmetry of a matrix) are made where it is built.

mod certificate;
mod excitation;
mod geometry;
mod idle;
mod limits;
mod link;
pub mod measured;
mod safety;
mod specimen;
mod waits;
mod way;

pub(super) use certificate::check_samples;
use certificate::{check_certificate, check_known};
use excitation::check_excitation;
use idle::{check_idle, check_idle_link, check_idle_served, check_idle_specimen};
use limits::{check_limits, check_required};
use specimen::{Source, check_names, check_seeds, check_specimen};
use waits::{check_link_waits, check_record, check_waits};
use way::check_way;

use super::diagnose::Finding;
use super::document::{Datum, KeyPath, Node};
use super::schema::{Method, Start, StructureTable, TestFile};
use super::serve_table::ServeFile;
use super::specimen::SpecimenTable;
use super::steps::{Time, not_positive};
use super::suggest::listed;
use super::timetable::ClockChoice;
use super::timing_table::OnMiss;
use super::value::{DofChoice, LambdaValue};
pub use limits::missing_limits;

use gusset_quantity::text::is_hidden;

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

/// All that is wrong with `file`, in the order of its tables. `clock_is_chosen`: for this run alone, beside the file.
pub(crate) fn check(file: &TestFile, clock_is_chosen: bool) -> Vec<Finding> {
    let mut findings = Findings::default();
    let time = match Time::of(&file.time) {
        Ok(time) => Some(time),
        Err(finding) => {
            findings.0.push(*finding);
            None
        }
    };
    let tick_s = time.map(|time| time.period.value());
    let root = KeyPath::root();
    findings.printable(&root.key("title"), Some(&file.title));
    let reasons = [
        ("accept_unstable", &file.safety.accept_unstable),
        ("accept_trip", &file.safety.accept_trip),
        ("accept_wiring", &file.safety.accept_wiring),
        ("accept_speed", &file.safety.accept_speed),
        ("accept_error", &file.safety.accept_error),
    ];
    for (key, reason) in reasons {
        findings.reason(root.key("safety").key(key), reason.as_deref());
    }
    let unlimited = file.safety.unlimited.as_deref();
    findings.printable(&root.key("safety").key("unlimited"), unlimited);
    match &file.structure {
        Some(structure) => check_structure(structure, &root.key("structure"), &mut findings),
        None if file.specimen.is_empty() => findings.0.push(
            Finding::error(root.clone(), "this test has neither a `[structure]` nor a `[[specimen]]`")
                .help("a test needs a `[structure]`, or a `[[specimen]]` with a prescribed displacement, or both"),
        ),
        None => {}
    }
    check_integrator(file, &mut findings);
    check_excitation(file, &mut findings);
    for (index, specimen) in file.specimen.iter().enumerate() {
        let at = root.key("specimen").index(index);
        let source = match file.structure {
            Some(_) => Source::Structure,
            None => Source::Prescribed,
        };
        check_specimen(specimen, source, &at, &mut findings);
        check_known(specimen, &at, &mut findings);
        check_limits(specimen, tick_s, Some(&file.safety), &at, &mut findings);
        link::check_pace(specimen, file, &at, &mut findings);
        check_way(specimen, file, &at, &mut findings);
        link::check_standing(specimen, &at, &mut findings);
        measured::check_measured(specimen, &at, &mut findings);
        let with_structure = file.structure.is_some();
        check_idle_specimen(
            specimen,
            with_structure,
            Some(&file.safety),
            &at,
            &mut findings,
        );
        if let Some(link) = &specimen.link {
            check_link_waits(link, time.as_ref(), &at.key("link"), &mut findings);
            check_idle_link(link, &at.key("link"), &mut findings);
        }
    }
    measured::check_judged(file, &mut findings);
    check_required(&file.specimen, unlimited, &mut findings);
    check_names(&file.specimen, &mut findings);
    link::check_shared(&file.specimen, &mut findings);
    check_seeds(&file.specimen, &mut findings);
    let remote = file.specimen.iter().any(|specimen| specimen.link.is_some());
    if remote && file.timing.on_miss == OnMiss::CatchUp {
        let on_miss = root.key("timing").key("on_miss");
        findings.0.push(
            Finding::error(
                on_miss,
                "`on_miss = \"catch_up\"` is not allowed with a specimen behind a link",
            )
            .label("it would move the specimen faster than planned")
            .help("use \"stretch\", which never moves it faster than planned, or \"stop\""),
        );
    }
    safety::check_safety(file, &mut findings);
    check_certificate(file, &mut findings);
    let record = root.key("record");
    findings.positive(record.key("queue_s"), Some(file.record.queue_s));
    findings.positive(record.key("checkpoint_s"), Some(file.record.checkpoint_s));
    if let Some(DofChoice::Listed(dofs)) = &file.record.dofs {
        findings.dofs(&record.key("dofs"), dofs);
    }
    check_waits(file, time.as_ref(), &mut findings);
    check_idle(file, clock_is_chosen, &mut findings);
    findings.0
}

#[derive(Debug, Default)]
struct Findings(Vec<Finding>);

impl Findings {
    /// Finite and greater than zero, where given. Infinity and NaN are reported elsewhere.
    fn positive(&mut self, at: KeyPath, value: Option<f64>) {
        if let Some(found) = value
            && found <= 0.0
            && found.is_finite()
        {
            self.0.push(not_positive(at, found));
        }
    }

    /// A text that is shown to people holds nothing that a terminal would obey.
    fn printable(&mut self, at: &KeyPath, text: Option<&str>) {
        if let Some(c) = text.and_then(|text| text.chars().find(|c| is_hidden(*c))) {
            let headline = format!("`{at}` contains a character that cannot be printed");
            let finding = Finding::error(at.clone(), headline);
            self.0
                .push(finding.label(format!("{}", c.escape_unicode())));
        }
    }

    /// The user's reason must have content, in characters that can be printed.
    fn reason(&mut self, at: KeyPath, reason: Option<&str>) {
        self.printable(&at, reason);
        if reason.is_some_and(|reason| !gusset_quantity::text::is_reason(reason)) {
            let headline = format!("`{at}` gives no reason");
            self.0.push(
                Finding::error(at, headline)
                    .label("write a reason in words, which the summary repeats"),
            );
        }
    }

    /// Numbers from 1, none twice.
    fn dofs(&mut self, at: &KeyPath, dofs: &[usize]) {
        if dofs.is_empty() {
            self.0.push(
                Finding::error(at.clone(), format!("`{at}` is empty"))
                    .label("at least one DOF is needed"),
            );
        }
        for (index, dof) in dofs.iter().enumerate() {
            let here = at.index(index);
            if *dof == 0 {
                self.0.push(
                    Finding::error(here, "there is no DOF 0").label("DOFs are counted from 1"),
                );
            } else if let Some(before) = dofs[..index].iter().position(|d| d == dof) {
                let finding =
                    Finding::error(here, format!("DOF {dof} is listed twice")).label("again here");
                self.0.push(finding.beside(at.index(before), "first here"));
            }
        }
    }

    /// Exactly one of `allowed` is among `given`.
    fn exactly_one(&mut self, at: &KeyPath, given: &[&str], allowed: &[&str], why: &str) {
        let headline = || format!("`{at}` must have exactly one of {}", listed(allowed, "and"));
        match given {
            [_] => {}
            [] => self.0.push(
                Finding::error(at.clone(), headline())
                    .label("has none of them")
                    .help(why),
            ),
            [first, second, ..] => self.0.push(
                Finding::error(at.key(second), headline())
                    .at_key()
                    .label(format!("`{second}` is given"))
                    .beside(at.key(first), format!("and so is `{first}`"))
                    .help(why),
            ),
        }
    }
}

/// All that is wrong with the specimens of a file that is only served.
pub(crate) fn check_served(file: &ServeFile) -> Vec<Finding> {
    let mut findings = Findings::default();
    let root = KeyPath::root();
    if file.specimen.is_empty() {
        let text = "this file has no `[[specimen]]` to serve";
        findings.0.push(Finding::error(root.clone(), text));
    }
    for (index, specimen) in file.specimen.iter().enumerate() {
        let at = root.key("specimen").index(index);
        check_specimen(specimen, Source::Client, &at, &mut findings);
        check_known(specimen, &at, &mut findings);
        check_limits(specimen, None, None, &at, &mut findings);
        check_idle_specimen(specimen, false, None, &at, &mut findings);
        link::check_standing(specimen, &at, &mut findings);
        measured::check_measured(specimen, &at, &mut findings);
        if let Some(link) = &specimen.link {
            check_link_waits(link, None, &at.key("link"), &mut findings);
        }
        check_served_compensation(specimen, file.serve.pace.is_some(), &at, &mut findings);
    }
    let safety = file.safety.as_ref();
    let unlimited = safety.and_then(|safety| safety.unlimited.as_deref());
    findings.printable(&root.key("title"), Some(&file.title));
    findings.printable(&root.key("safety").key("unlimited"), unlimited);
    let accepted = safety.and_then(|safety| safety.accept_wiring.as_deref());
    findings.reason(root.key("safety").key("accept_wiring"), accepted);
    let accepts = safety.and_then(|safety| safety.accept_speed.as_deref());
    findings.reason(root.key("safety").key("accept_speed"), accepts);
    if let Some(record) = &file.record {
        findings.positive(root.key("record").key("queue_s"), Some(record.queue_s));
        check_record(record, &mut findings);
    }
    check_idle_served(file.timing.as_ref(), file.record.as_ref(), &mut findings);
    check_required(&file.specimen, unlimited, &mut findings);
    check_names(&file.specimen, &mut findings);
    findings.0
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
    findings.0.push(finding.label("no effect here").help(help));
}

fn check_structure(structure: &StructureTable, at: &KeyPath, findings: &mut Findings) {
    let given: Vec<_> = structure.kinds().iter().map(|(key, _)| *key).collect();
    findings.exactly_one(
        at,
        &given,
        &["shear_building", "matrices", "chain"],
        "a test has one structure",
    );
    if let Some(gravity) = &structure.gravity {
        findings.positive(
            at.key("gravity").key("accel_m_per_s2"),
            Some(gravity.accel_m_per_s2),
        );
    }
}

fn check_integrator(file: &TestFile, findings: &mut Findings) {
    let table = &file.integrator;
    let integrator = KeyPath::root().key("integrator");
    findings.positive(integrator.key("gain_bound"), table.gain_bound);
    if let LambdaValue::Number(value) = table.lambda {
        findings.positive(integrator.key("lambda"), Some(value));
    }
    if let Some(share) = table.rest_damping_share
        && !(0.0..=1.0).contains(&share)
    {
        let text = format!("`rest_damping_share` is {share}, but must be from 0 to 1");
        let at = integrator.key("rest_damping_share");
        findings.0.push(Finding::error(at, text).label("a share"));
    }
    findings.positive(integrator.key("newton_tolerance"), table.newton_tolerance);
    let method = integrator.key("method");
    let of_family = table.method == Method::Gui;
    let idle = [
        ("lambda", table.lambda != LambdaValue::Auto, of_family),
        ("gain_bound", table.gain_bound.is_some(), of_family),
        (
            "rest_damping_share",
            table.rest_damping_share.is_some(),
            of_family,
        ),
        ("start", table.start != Start::Published, of_family),
        (
            "rho_infinity",
            table.rho_infinity.is_some(),
            table.is_alpha(),
        ),
        ("weighting", table.weighting.is_some(), table.is_alpha()),
        (
            "newton_tolerance",
            table.newton_tolerance.is_some(),
            table.iterates(),
        ),
        (
            "newton_iterations",
            table.newton_iterations.is_some(),
            table.iterates(),
        ),
    ];
    for (key, given, meant) in idle {
        if given && !meant {
            let finding = Finding::error(
                integrator.key(key),
                format!("`integrator.{key}` has no effect with this method"),
            );
            findings
                .0
                .push(finding.at_key().beside(method.clone(), "the method"));
        }
    }
    match table.rho_infinity {
        Some(rho) if rho.is_finite() && !(0.0..=1.0).contains(&rho) => findings.0.push(
            Finding::error(
                integrator.key("rho_infinity"),
                format!("`integrator.rho_infinity` is {rho}, but must be from 0 to 1"),
            )
            .label("rho_infinity is a spectral radius"),
        ),
        None if table.is_alpha() => findings.0.push(
            Finding::error(method.clone(), "this method needs `rho_infinity`")
                .help("rho_infinity = 1 damps nothing, 0 damps high frequencies most"),
        ),
        _ => {}
    }
    if table.newton_iterations == Some(0) {
        findings
            .0
            .push(not_positive(integrator.key("newton_iterations"), 0.0));
    }
    let Some(reason) = table.why_no_specimen() else {
        return;
    };
    if !file.specimen.is_empty() {
        let finding = Finding::error(method, "this method cannot command a specimen")
            .label(reason)
            .beside(KeyPath::root().key("specimen").index(0), "the specimen");
        findings.0.push(finding.help(
            "use \"gui\", or \"kr_alpha\" or \"mkr_alpha\" with weighting = \"forces\": they are explicit in displacement and velocity",
        ));
    } else if file.time.clock == ClockChoice::Real {
        let finding = Finding::error(method, "this method cannot run on the real clock")
            .label(reason)
            .help("use `clock = \"simulated\"` in [time], or --clock simulated");
        findings.0.push(finding);
    }
}
