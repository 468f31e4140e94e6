//! Displayed facts of a test, known before it runs: names, units, limits, and the place of each number in a row.

use serde::Serialize;

use super::marks::{ActuatorEnds, Mark, mark, test_marks};
use gusset_control::engine::Experiment;
use gusset_control::port::{DispZero, Exit};
use gusset_quantity::catalog::column;
use gusset_quantity::text::printable;
use gusset_record::Column;

/// Degrees of freedom that are drawn at most.
const MOST_DOFS: usize = 8;

/// Facts about a test that are not in its experiment.
#[derive(Debug, Clone, Default)]
pub struct About {
    /// Its title.
    pub title: String,
    /// The run folder, as the user knows it.
    pub run: String,
    /// Whether it runs on the real clock.
    pub real_clock: bool,
    /// λ, if the method has one.
    pub lambda: Option<LambdaUse>,
    /// The interrupted test that it resumes, if any.
    pub goes_on: Option<GoesOn>,
    /// The simulated actuator of each specimen.
    pub actuators: Vec<ActuatorEnds>,
}

/// An interrupted test that another resumes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct GoesOn {
    /// Its run folder, as the user knows it.
    pub run: String,
    /// The last step that was made there.
    pub after: u64,
}

/// λ in use and its known limit before the test.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LambdaUse {
    /// In use; null for infinite.
    pub used: f64,
    /// Largest stable one at the declared bounds: null if every λ is, 0 if none is.
    pub declared_limit: f64,
    /// Whether there is a proof at all.
    pub proven: bool,
}

/// A test that is watched.
#[derive(Debug, Clone, Serialize)]
pub struct Subject {
    /// Its title.
    pub title: String,
    /// The run folder.
    pub run: String,
    /// Whether it runs on the real clock.
    pub real_clock: bool,
    /// Steps, and Δt in s.
    pub steps: u64,
    /// Δt in s.
    pub dt: f64,
    /// Period of the controller in s of wall time.
    pub tick_s: f64,
    /// The interrupted test that it resumes.
    pub goes_on: Option<GoesOn>,
    /// Its specimens.
    pub specimens: Vec<WatchedSpecimen>,
    /// Limits that belong to no specimen alone.
    pub test: Vec<Mark>,
    /// λ.
    pub lambda: Option<LambdaUse>,
    /// Content of every bin of the history, in order: two numbers each.
    pub channels: Vec<Channel>,
    /// Places of the other values in a row.
    #[serde(skip)]
    pub places: Places,
}

/// A specimen that is watched.
#[derive(Debug, Clone, Serialize)]
pub struct WatchedSpecimen {
    /// Its name.
    pub name: String,
    /// Whether it is behind a link.
    pub remote: bool,
    /// Its shutdown when the operator ends the test, as the rest of a sentence.
    pub at_end: &'static str,
    /// Its axes.
    pub axes: Vec<WatchedAxis>,
    #[serde(skip)]
    pub(super) status: Option<usize>,
    /// Place of the number of the command that was answered last.
    #[serde(skip)]
    pub(super) newest: Option<usize>,
    /// Places of the counts of its commands and of its stale replies.
    #[serde(skip)]
    pub(super) exchanges: Option<usize>,
    #[serde(skip)]
    pub(super) stale: Option<usize>,
    /// Commanded once a step while the test runs.
    #[serde(skip)]
    pub(super) per_step: bool,
}

/// An axis that is watched, SI at the specimen's own scale.
#[derive(Debug, Clone, Serialize)]
pub struct WatchedAxis {
    /// Its limits.
    pub marks: Vec<Mark>,
    /// Whether its margin to the critical delay is estimated.
    pub has_margin: bool,
    #[serde(skip)]
    pub(super) metres: f64,
    #[serde(skip)]
    pub(super) newtons: f64,
    #[serde(skip)]
    pub(super) zero: DispZero,
    #[serde(skip)]
    pub(super) stiffness_bound: f64,
    #[serde(skip)]
    pub(super) damping_bound: f64,
    #[serde(skip)]
    pub(super) places: [Option<usize>; 10],
}

/// Something that is drawn over time.
#[derive(Debug, Clone, Serialize)]
pub struct Channel {
    /// Kind of the channel.
    pub kind: ChannelKind,
    /// Name for people.
    pub label: String,
    /// SI unit.
    pub unit: String,
    /// Specimen and axis, from 0, where it is one of theirs.
    pub axis: Option<[usize; 2]>,
}

/// Kinds of channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ChannelKind {
    /// Displacement of a degree of freedom.
    Dof,
    /// The ground.
    Ground,
    /// Command at the specimen's scale.
    Command,
    /// Measured displacement at the specimen's scale.
    Measured,
    /// Measured − commanded.
    Error,
    /// Measured force at the specimen's scale.
    Force,
    /// How late the loop woke.
    Lateness,
}

/// Places in a row of values that belong to no specimen.
#[derive(Debug, Clone, Default)]
#[expect(missing_docs, reason = "each is the place of the column of that name")]
pub struct Places {
    pub step: Option<usize>,
    pub state: Option<usize>,
    pub time: Option<usize>,
    pub grounds: Vec<usize>,
    pub release: Option<usize>,
    pub stretched: Option<usize>,
    pub dofs: Vec<usize>,
    /// Wake-up lateness, command lateness, round trip, compute.
    pub timing: [Option<usize>; 4],
    pub skipped_by_wakeup: Option<usize>,
    pub skipped_by_work: Option<usize>,
    pub overrun: Option<usize>,
}

impl Places {
    /// The places of these DOFs and of all other columns.
    fn of(dofs: &[usize], columns: &[Column]) -> Self {
        let find = |name: &str| columns.iter().position(|column| column.name == name);
        let names = columns.iter().enumerate();
        let grounds = names.filter(|(_, column)| column::is_ground(&column.name));
        Self {
            step: find(column::STEP.name()),
            state: find(column::STATE.name()),
            time: find(column::TIME.name()),
            grounds: grounds.map(|(place, _)| place).collect(),
            release: find(column::RELEASE.name()),
            stretched: find(column::STRETCHED.name()),
            dofs: dofs
                .iter()
                .filter_map(|dof| find(&column::DISP.of_dof(dof + 1)))
                .collect(),
            timing: super::latency::COLUMNS.map(&find),
            skipped_by_wakeup: find(column::SKIPPED_BY_WAKEUP.name()),
            skipped_by_work: find(column::SKIPPED_BY_WORK.name()),
            overrun: find(column::OVERRUN.name()),
        }
    }
}

/// Columns of one axis that are read: command, measured displacement, raw displacement and force, tangent stiffness and damping,
/// energy added, lag, gain and margin.
const OF_AXIS: [column::Kind; 10] = [
    column::COMMAND,
    column::MEASURED,
    column::RAW_DISP,
    column::RAW_FORCE,
    column::TANGENT,
    column::TANGENT_DAMPING,
    column::ADDED,
    column::LAG,
    column::GAIN,
    column::MARGIN,
];

impl WatchedAxis {
    /// The values of a row, in the order of the columns.
    pub(super) fn values(&self, row: &[f64]) -> [f64; 10] {
        self.places.map(|place| at(row, place))
    }
}

impl Subject {
    /// The displayed facts of `experiment`.
    #[must_use]
    pub fn new(experiment: &Experiment, about: About) -> Self {
        let columns = experiment.columns();
        let find = |name: &str| columns.iter().position(|column| column.name == name);
        let tick_s = experiment.period.value();
        let none = std::iter::repeat(ActuatorEnds::default());
        let actuators = about.actuators.into_iter().chain(none);
        let specimens: Vec<_> = (1..)
            .zip(&experiment.ports)
            .zip(actuators)
            .map(|((number, port), actuator)| WatchedSpecimen {
                name: port.name().to_owned(),
                remote: port.exchange().is_remote(),
                at_end: way_out(port.exits().after(false)),
                status: find(&column::STATUS.of_specimen(number)),
                newest: find(&column::SEQUENCE.of_specimen(number)),
                exchanges: find(&column::EXCHANGES.of_specimen(number)),
                stale: find(&column::STALE.of_specimen(number)),
                per_step: port.path().is_per_step(),
                axes: (1..)
                    .zip(
                        port.guard()
                            .declared()
                            .iter()
                            .zip(port.guard().units())
                            .zip(port.estimates().tangent_bounds())
                            .zip(port.startup().disp_zeros(port.axis_maps())),
                    )
                    .map(|(axis, (((limits, (metres, newtons)), bounds), zero))| {
                        let place = |kind: &column::Kind| find(&kind.of_axis(number, axis));
                        let judged =
                            |name: &str| find(&column::JUDGED.of_parameter(name, number, axis));
                        let marks = limits.levels().filter_map(|limit| mark(limit, judged));
                        let mut marks: Vec<_> = marks.collect();
                        marks.extend(actuator.marks(&marks));
                        WatchedAxis {
                            marks,
                            has_margin: place(&column::MARGIN).is_some(),
                            metres: *metres,
                            newtons: *newtons,
                            zero,
                            stiffness_bound: bounds.0,
                            damping_bound: bounds.1,
                            places: OF_AXIS.each_ref().map(place),
                        }
                    })
                    .collect(),
            })
            .collect();
        let dofs = some_of(&experiment.record_dofs);
        let places = Places::of(&dofs, &columns);
        Self {
            channels: channels(&dofs, &places, &columns, &specimens),
            title: printable(&about.title),
            run: printable(&about.run),
            real_clock: about.real_clock,
            goes_on: about.goes_on,
            steps: experiment.steps,
            dt: experiment.dt,
            tick_s,
            test: test_marks(experiment, &columns),
            specimens,
            lambda: about.lambda,
            places,
        }
    }

    /// Specimen, number of the axis and the axis, in the order of the test.
    pub fn axes(&self) -> impl Iterator<Item = (&WatchedSpecimen, usize, &WatchedAxis)> {
        self.specimens.iter().flat_map(|specimen| {
            let axes = specimen.axes.iter().enumerate();
            axes.map(move |(index, axis)| (specimen, index, axis))
        })
    }
}

/// End position of a specimen, as the rest of a sentence.
const fn way_out(exit: &Exit) -> &'static str {
    match exit {
        Exit::Freeze => "stays where it is",
        Exit::ZeroForce => "is led to where its forces are small",
        Exit::ZeroDisp => "is led to zero deformation",
        Exit::Safe(_) => "is led to its safe displacement",
    }
}

/// The number at a place; NaN without a place.
pub(super) fn at(row: &[f64], place: Option<usize>) -> f64 {
    let value = place.and_then(|place| row.get(place));
    value.copied().unwrap_or(f64::NAN)
}

/// A few of all DOFs (from 0), the ends among them.
fn some_of(dofs: &[usize]) -> Vec<usize> {
    if dofs.len() <= MOST_DOFS {
        return dofs.to_vec();
    }
    let last = dofs.len() - 1;
    let spread = (0..MOST_DOFS).map(|k| k * last / (MOST_DOFS - 1));
    spread
        .filter_map(|place| dofs.get(place).copied())
        .collect()
}

fn channels(
    dofs: &[usize],
    places: &Places,
    columns: &[Column],
    specimens: &[WatchedSpecimen],
) -> Vec<Channel> {
    let channel = |kind, label: String, unit: &str, axis| Channel {
        kind,
        label,
        unit: unit.to_owned(),
        axis,
    };
    let unit_of = |name: &str| {
        let column = columns.iter().find(|column| column.name == name);
        column.map_or("m", |column| column.unit.as_str())
    };
    let mut all: Vec<_> = dofs
        .iter()
        .map(|dof| {
            let unit = unit_of(&format!("x{}", dof + 1));
            channel(ChannelKind::Dof, format!("DOF {}", dof + 1), unit, None)
        })
        .collect();
    for column in places
        .grounds
        .iter()
        .filter_map(|place| columns.get(*place))
    {
        let label = column.name.replace('_', " ");
        all.push(channel(ChannelKind::Ground, label, &column.unit, None));
    }
    all.push(channel(
        ChannelKind::Lateness,
        "wake-up lateness".into(),
        "s",
        None,
    ));
    for (s, specimen) in specimens.iter().enumerate() {
        for a in 0..specimen.axes.len() {
            for (kind, label, unit) in [
                (ChannelKind::Command, "command", "m"),
                (ChannelKind::Measured, "measured", "m"),
                (ChannelKind::Error, "measured − command", "m"),
                (ChannelKind::Force, "force", "N"),
            ] {
                all.push(channel(kind, label.to_owned(), unit, Some([s, a])));
            }
        }
    }
    all
}
