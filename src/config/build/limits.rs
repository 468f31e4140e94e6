//! Which limits a test has, who checks them and what happens then: for whoever answers for the specimens.

use serde::Serialize;

use super::specimens::loading::{self, LoadingFacts};
use crate::config::{ExitChoice, SpecimenTable, TestFile};
use crate::control::Port;
use crate::control::limits::{Bound, Levels};
use crate::engine::{Limits, OnMiss, TestQuantity};
use crate::link::spec::{Protocol, StaleChoice};
use crate::substructure::Coupling;

/// All limits of a test.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct LimitFacts {
    /// Per specimen, in order.
    pub specimens: Vec<SpecimenLimits>,
    /// What belongs to no specimen alone.
    pub test: Vec<Limit>,
    /// What trips whatever the file says.
    pub always: Vec<String>,
    /// What a trip does.
    pub on_trip: String,
    /// Why a specimen behind a link may lack limits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unlimited: Option<String>,
}

/// The limits of one specimen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpecimenLimits {
    /// Its name.
    pub name: String,
    /// The loading unit whose actuators the axes are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub geometry: Option<LoadingFacts>,
    /// Who keeps them.
    pub checked_by: String,
    /// One list per axis; what is not in it is not limited.
    pub axes: Vec<Vec<Limit>>,
    /// What happens to measurements that stay away.
    pub stale: String,
}

/// One limit: a size, or a smallest and a largest value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// The key of the test file.
    pub key: &'static str,
    /// SI.
    pub unit: &'static str,
    /// Warned of beyond; empty: never.
    pub warn: Vec<f64>,
    /// Tripped beyond; empty: never.
    pub trip: Vec<f64>,
    /// Whether the specimen's end is told of it and keeps it, too.
    pub also_at_the_specimen: bool,
}

fn sizes(values: &[f64]) -> Vec<f64> {
    // Where there is no limit there is an infinite one; half a range is shown whole.
    if values.iter().any(|value| value.is_finite()) {
        values.to_vec()
    } else {
        Vec::new()
    }
}

fn of_test(quantity: TestQuantity, unit: &'static str, bound: Bound) -> Limit {
    Limit {
        key: quantity.key(),
        unit,
        warn: sizes(&[bound.warn]),
        trip: sizes(&[bound.trip]),
        also_at_the_specimen: false,
    }
}

fn of_specimen(table: &SpecimenTable, port: &Port) -> SpecimenLimits {
    let is_told = table
        .link
        .as_ref()
        .is_some_and(|link| link.protocol == Protocol::Gusset);
    let axes = port.limits().iter().map(|axis| {
        let levels = axis.levels().into_iter().map(|(quantity, levels)| {
            let (warn, trip) = match levels {
                Levels::Size(Bound { warn, trip }) => (sizes(&[warn]), sizes(&[trip])),
                Levels::Range(range) => (sizes(&range.warn), sizes(&range.trip)),
            };
            Limit {
                key: quantity.key(),
                unit: quantity.unit(),
                also_at_the_specimen: is_told && quantity.is_announced() && !trip.is_empty(),
                warn,
                trip,
            }
        });
        levels
            .filter(|limit| !(limit.warn.is_empty() && limit.trip.is_empty()))
            .collect()
    });
    let (checked_by, stale) = match &table.link {
        None => (
            "this loop, before a command leaves and with every answer".to_owned(),
            "cannot be: it is computed here".to_owned(),
        ),
        Some(link) => {
            let far = if is_told {
                "; what is announced in the handshake (*) its own end, too"
            } else {
                "; its protocol has no limits, so nobody else"
            };
            let way = match link.on_stale {
                StaleChoice::Hold => "the last force is held",
                StaleChoice::Extrapolate => "the force goes on along the estimated stiffness",
                StaleChoice::Stop => "the first one trips",
            };
            (
                format!("this loop, before a command leaves and with every fresh answer{far}"),
                match link.on_stale {
                    _ if port.coupling() == Coupling::Lockstep => format!(
                        "cannot be: an answer is waited for; after {} s without one the link is lost",
                        link.reply_timeout_s
                    ),
                    StaleChoice::Stop => way.to_owned(),
                    _ => {
                        let most = port.wait.map_or(0, |wait| wait.stale_in_a_row);
                        format!("{way}; more than {most} in a row trip")
                    }
                },
            )
        }
    };
    SpecimenLimits {
        name: port.name.clone(),
        geometry: loading::facts(table),
        checked_by,
        axes: axes.collect(),
        stale,
    }
}

/// What a choice does to the specimens.
fn way_out(choice: ExitChoice, speed: Option<f64>) -> String {
    let speed = speed.unwrap_or_default();
    let led = |to: &str| {
        format!(
            "every specimen is led to {to}, at {speed} m/s at most (while directions and zeros are being found it stays)"
        )
    };
    match choice {
        ExitChoice::Freeze => "every specimen holds its last command".to_owned(),
        ExitChoice::ZeroForce => led("where its forces are small"),
        ExitChoice::ZeroDisplacement => led("zero deformation"),
        ExitChoice::SafeDisplacement => led("its `safe_disp_m`"),
    }
}

/// All of them.
pub(super) fn facts(
    file: &TestFile,
    ports: &[Port],
    limits: &Limits,
    columns: &[TestQuantity],
) -> LimitFacts {
    let misses = limits.test.misses;
    let count = |warn: u64, trip: u64| Bound {
        warn: warn as f64,
        trip: trip as f64,
    };
    let mut test = Vec::new();
    for (quantity, bound) in [
        (TestQuantity::StabilityUsed, limits.test.stability_used),
        (TestQuantity::DelayUsed, limits.test.delay_used),
        (TestQuantity::StepAudit, limits.test.step_audit),
        (
            TestQuantity::AddedEnergyShare,
            limits.test.added_energy_share,
        ),
    ] {
        if columns.contains(&quantity) {
            test.push(of_test(quantity, "", bound));
        }
    }
    for (quantity, unit, bound) in [
        (
            TestQuantity::MissesInARow,
            "in a row",
            count(misses.warn_in_a_row, limits.misses_in_a_row),
        ),
        (
            TestQuantity::MissesInWindow,
            "in a window",
            count(misses.warn_in_window, misses.most_in_window),
        ),
        (
            TestQuantity::Misses,
            "in all",
            count(misses.warn_in_all, limits.misses_in_total),
        ),
    ] {
        test.push(of_test(quantity, unit, bound));
    }
    if limits.divergence < f64::MAX {
        test.push(Limit {
            key: "divergence_m",
            unit: "m",
            warn: Vec::new(),
            trip: vec![limits.divergence],
            also_at_the_specimen: false,
        });
    }
    let mut always =
        vec!["a command, measurement or response that is not a finite number".to_owned()];
    if file.specimen.iter().any(|table| table.link.is_some()) {
        always.push(
            "an interlock or emergency stop at a specimen's end, even if it closes again"
                .to_owned(),
        );
        always.push(
            "a sensor or actuator that its own end calls saturated; a link that fails".to_owned(),
        );
    }
    if limits.on_miss == OnMiss::Stop {
        always.push("a tick that is late by a whole period".to_owned());
    }
    let safety = &file.safety;
    LimitFacts {
        specimens: file
            .specimen
            .iter()
            .zip(ports)
            .map(|(table, port)| of_specimen(table, port))
            .collect(),
        test,
        always,
        on_trip: format!(
            "{}, the test ends and cannot go on; exit code 1, a failed link 3",
            way_out(safety.on_trip, safety.exit_speed_m_per_s)
        ),
        unlimited: safety.unlimited.clone(),
    }
}
