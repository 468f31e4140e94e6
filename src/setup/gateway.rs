//! A specimen that is served and is itself behind a link: the server is a gateway.
//!
//! Without conversion numbers pass through a gateway unchanged: both links count in the units of the axes. With `geometry`,
//! `similitude`, gears or units of its client the port of the gateway converts, as in a test: see [`conversion`].

mod conversion;
mod following;

use std::path::Path;
use std::sync::Arc;

use conversion::Client;
pub(super) use conversion::signal_units;
use following::Following;

use super::held::Held;
use super::links::{
    native_setup, openfresco_client, seconds, shared_key, tls_client, wire_axes, wiring_check,
};
use super::specimens::loading::at_actuators;
use gusset_config::{
    Correction, Finding, KeyPath, LinkSpec, PaceTable, Protocol, ServedFile, SpecimenTable,
};
use gusset_control::port::{Order, SlowDown, WiringCheck};
use gusset_link::announce::narrower;
use gusset_link::openfresco::Remote;
use gusset_link::served::{
    Controller, LinkBuild, LinkMaker, MOST_PREDICTED, PaceClock, Pacing, Predicting, Whereabouts,
};
use gusset_link::server::Host;
use gusset_link::{NativeLink, NativeSetup};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::units::{AxisUnits, quantity};
use gusset_wire::handshake::Sampling;

/// The specimen must hold after this silence if neither file nor controller sets another, in s.
const USUAL_WATCHDOG_S: f64 = 10.0;
/// From one exchange of the motion that shows the direction to the next, in s.
const PROBE_PERIOD_S: f64 = 0.01;

/// A gateway, and what holds its specimen from one client's test to the next.
type Gateway = (Host, Option<Arc<dyn Held>>);

/// The gateway to the specimen of `source`, which has this link.
pub(super) fn host(
    source: &ServedFile,
    table: &SpecimenTable,
    link: &LinkSpec,
    path: &Path,
) -> Result<Gateway, Box<Finding>> {
    let at = &source.place;
    if source.is_test {
        check_test_file(table, at)?;
    }
    let following = Following::of(source, table, at)?;
    let converts = source.converts() || following.is_some();
    let lead_s = following.as_ref().map_or(0.0, Following::lead_s);
    let pace = source.file.serve.pace.as_ref();
    let predict = pace.and_then(|pace| predicting(pace, table.axes(), lead_s));
    if let (Some(pace), Some(predict)) = (pace, &predict) {
        check_slow_down(pace, predict, table)?;
    }
    let step_s = source.file.serve.openfresco.step_s;
    let (build, held): (LinkBuild, Option<Arc<dyn Held>>) = match link.protocol {
        Protocol::Gusset => {
            let pace = source.file.serve.pace.as_ref();
            let paced = pace.map(|pace| (1_000_000_000, pace.period_ns()));
            let build = native(table, link, at, path, (step_s, paced, converts))?;
            (build, None)
        }
        #[cfg(feature = "ethercat")]
        Protocol::Ethercat => {
            let (build, holds) = super::lent_bus::gateway(source, (table, link))?;
            (build, Some(holds))
        }
        #[cfg(not(feature = "ethercat"))]
        Protocol::Ethercat => {
            let text = "this program was built without EtherCAT (feature `ethercat`)";
            return Err(Box::new(Finding::error(at.key("bus"), text)));
        }
        Protocol::OpenFresco | Protocol::OpenFrescoShadow | Protocol::OpenFrescoAdapter => {
            (openfresco(link, at, path, table.axes())?, None)
        }
    };
    let safety = source.file.safety.as_ref();
    let accepted = safety.and_then(|safety| safety.accept_wiring.clone());
    // On a bus a specimen gets a command in every tick.
    let on_bus = pace.filter(|_| held.is_some());
    let every = on_bus.map(|pace| pace.rate_hz.recip());
    let (host, check) = if converts {
        let client = Client {
            units: source.client_units(),
            following,
            is_paced: source.file.serve.pace.is_some(),
            accepted,
            probed_every: every,
        };
        conversion::host(table, link, at, client, build)?
    } else {
        passing((table, link, at), (accepted, every), build)?
    };
    let host = match &link.stands_at_m {
        Some(stands) => {
            let units = table.units_of(table.axes());
            let stands = stands.iter().zip(&units);
            host.said_to_stand_at(stands.map(|(disp, unit)| disp / unit.metres).collect())
        }
        None => host,
    };
    let host = if link.computed { host.computed() } else { host };
    let host = match table.force_only_link() {
        None => host,
        Some(_) => host.without_measured_disp(),
    };
    let pacing = source.file.serve.pace.as_ref().map(|pace| Pacing {
        ticks: pace.ticks_per_step,
        settle_ticks: pace.settle_ticks,
        period_ns: pace.period_ns(),
        clock: PaceClock::MACHINE,
        predict,
    });
    Ok((host.checked(check, link.computed).paced(pacing), held))
}

/// How the specimen keeps moving between the targets of its client, if this pace predicts.
fn predicting(pace: &PaceTable, axes: usize, lead_s: f64) -> Option<Predicting> {
    let given = pace.predict_within_m.as_ref().filter(|_| pace.predicts())?;
    let mut within = [0.0; MOST_PREDICTED];
    let given = given.of(axes).unwrap_or_default();
    within.iter_mut().zip(given).for_each(|(to, one)| *to = one);
    let [at, until] = pace.slows();
    let order = match pace.prediction_order {
        _ if pace.prediction_by_velocity => Order::Velocities,
        Some(0) => Order::Constant,
        Some(1) => Order::Linear,
        Some(2) => Order::Quadratic,
        _ => Order::Cubic,
    };
    let slow = SlowDown {
        ticks: pace.ticks_per_step,
        at,
        until,
    };
    Some(Predicting {
        slow,
        order,
        within,
        correct_at_most: match pace.correct {
            Correction::None => 0.0,
            Correction::InitialStiffness => pace.correct_at_most_n.unwrap_or(0.0),
        },
        lead_s,
    })
}

/// Refuses a pace that cannot slow down from the limit of speed within the limit of acceleration, or rest within the bound.
fn check_slow_down(
    pace: &PaceTable,
    predict: &Predicting,
    table: &SpecimenTable,
) -> Result<(), Box<Finding>> {
    const MOST_TICKS: u32 = 100_000;
    let at = KeyPath::root().under("serve.pace");
    let tick = 1.0 / pace.rate_hz;
    let accel = |speed: f64, slow: &SlowDown| {
        speed * (slow.steepest() / tick + predict.lead_s * slow.sharpest() / (tick * tick))
    };
    let limits = table.limits_of(table.axes());
    for (axis, limits) in (1..).zip(limits) {
        let [speed, most] = [Limit::CommandVel, Limit::CommandAccel]
            .map(|limit| limits.size(limit).and_then(|levels| levels.trip));
        let (Some(speed), Some(most)) = (speed, most) else {
            continue;
        };
        let needed = accel(speed, &predict.slow);
        if needed > most {
            let fits = |ticks: &u32| {
                accel(
                    speed,
                    &SlowDown {
                        ticks: *ticks,
                        ..predict.slow
                    },
                ) <= most
            };
            let ticks = (predict.slow.ticks..MOST_TICKS)
                .find(fits)
                .unwrap_or(MOST_TICKS);
            let text = format!(
                "axis {axis}: from the limit of speed, {}, this pace slows down with {}, the limit is {}",
                quantity(speed, "m/s"),
                quantity(needed, "m/s²"),
                quantity(most, "m/s²")
            );
            let finding = Finding::error(at.key("ticks_per_step"), text).at_key();
            let help =
                format!("set `ticks_per_step` to {ticks} or more, or change one of the two limits");
            return Err(Box::new(finding.help(help)));
        }
    }
    Ok(())
}

/// Reads the position of the specimen of `table`, a file at `path`; none where its protocol cannot report a position without a test.
///
/// # Errors
/// Its key or its certificates cannot be read.
pub fn position_reader(
    table: &SpecimenTable,
    path: &Path,
) -> Result<Option<LinkMaker>, Box<Finding>> {
    let Some(link) = table
        .link
        .as_ref()
        .filter(|link| link.protocol == Protocol::Gusset)
    else {
        return Ok(None);
    };
    let build = native(table, link, &KeyPath::root(), path, (None, None, true))?;
    let links = LinkMaker::new(build, Whereabouts::default(), reply_limit_ns(link));
    Ok(Some(links))
}

/// A gateway that passes numbers unchanged, and how it checks the wiring.
fn passing(
    (table, link, at): (&SpecimenTable, &LinkSpec, &KeyPath),
    (accepted, probed_every): (Option<String>, Option<f64>),
    build: LinkBuild,
) -> Result<(Host, WiringCheck), Box<Finding>> {
    let n = table.axes();
    let units = table.units_of(n);
    let estimate = table.stiffness_n_per_m.as_ref();
    let rows = estimate.map(|matrix| matrix.rows()).unwrap_or_default();
    let rows = match &table.geometry {
        Some(spec) if rows.len() == table.law_axes() => {
            let geometry = spec.build(table.similitude.length);
            let geometry = geometry
                .map_err(|error| Box::new(Finding::error(at.key("geometry"), error.to_string())))?;
            at_actuators(table, &geometry, rows)
        }
        _ => rows,
    };
    check_estimate(&rows, n, at)?;
    let stiffness = counted(&rows, &units);
    let gears = units.iter().map(|unit| unit.metres);
    let by_rows = (0..n).flat_map(|i| (0..n).map(move |j| j * n + i));
    let by_rows = by_rows.map(|place| stiffness[place]).collect();
    let estimate = (by_rows, accepted);
    let check = wiring_check(
        link,
        gears,
        estimate,
        probed_every.unwrap_or(PROBE_PERIOD_S),
        units.clone(),
    );
    let wire = wire_axes(table, n, None);
    let host = Host::gateway(
        table.name.clone(),
        wire,
        stiffness,
        build,
        reply_limit_ns(link),
    );
    Ok((host.in_units(units), check))
}

fn check_estimate(rows: &[Vec<f64>], n: usize, at: &KeyPath) -> Result<(), Box<Finding>> {
    if rows.len() == n && rows.iter().all(|row| row.len() == n) {
        return Ok(());
    }
    let text = format!("the estimate is not {n} × {n}, one row and column per axis");
    let at = at.key("stiffness_n_per_m");
    Err(Box::new(Finding::error(at, text)))
}

/// An estimate at the structure, by rows, as a client with these units counts it: n × n by columns.
fn counted(rows: &[Vec<f64>], units: &[AxisUnits]) -> Vec<f64> {
    let columns = units.iter().enumerate();
    let columns = columns.flat_map(|(j, of_disp)| {
        let rows = rows.iter().zip(units);
        rows.map(move |(row, of_force)| row[j] * of_disp.metres / of_force.newtons)
    });
    columns.collect()
}

fn reply_limit_ns(link: &LinkSpec) -> u64 {
    u64::try_from(seconds(link.reply_timeout_s).as_nanos()).unwrap_or(u64::MAX)
}

/// Refuses a test file whose numbers a controller converts: passed on unchanged they would be wrong for another client.
fn check_test_file(table: &SpecimenTable, at: &KeyPath) -> Result<(), Box<Finding>> {
    let gears = table.axis.iter().enumerate().flat_map(|(index, axis)| {
        let given = axis.gear().into_iter().filter(|(_, given)| *given);
        given.map(move |(key, _)| at.key("axis").index(index).key(key))
    });
    let whole = [
        ("geometry", table.geometry.is_some()),
        ("similitude", table.similitude != Default::default()),
    ];
    let whole = whole.into_iter().filter(|(_, given)| *given);
    let mut keys = whole.map(|(key, _)| at.key(key)).chain(gears);
    let Some(key) = keys.next() else {
        return Ok(());
    };
    let text = "a gateway does not convert by a test file";
    let finding = Finding::error(key, text)
        .at_key()
        .label("for the controller of this test")
        .help("copy this [[specimen]] into a file with [serve]: its gateway converts what the client commands");
    Err(Box::new(finding))
}

/// Our protocol towards the specimen: the controller's values are passed on, where the file has none.
fn native(
    table: &SpecimenTable,
    link: &LinkSpec,
    at: &KeyPath,
    path: &Path,
    (step_s, paced, converts): (Option<f64>, Option<(u64, u64)>, bool),
) -> Result<LinkBuild, Box<Finding>> {
    let key = shared_key(link, at, path)?;
    let tls = tls_client(link, at, path)?;
    let template = native_setup(link, key, wire_axes(table, table.axes(), None));
    let step_rate = step_s.map(|step| ((1e9 / step) as u64, 1_000_000_000));
    let (name, watchdog_s, timed) = (table.name.clone(), link.watchdog_s, link.sample_after);
    Ok(Arc::new(move |controller: &Controller| {
        let mut setup = NativeSetup {
            test: if controller.test.is_empty() {
                format!("gateway to {name}")
            } else {
                controller.test.clone()
            },
            ..template.clone()
        };
        // Where the gateway converts, the controller's limits are not of these axes.
        let theirs = controller.limits.iter().filter(|_| !converts);
        for (axis, theirs) in setup.axes.iter_mut().zip(theirs) {
            axis.limits = narrower(&axis.limits, theirs);
        }
        if let Some(rate) = paced.or(controller.rate).or(step_rate) {
            setup.rate = rate;
        }
        setup.watchdog_s = watchdog_s
            .or(controller.watchdog_s)
            .unwrap_or(USUAL_WATCHDOG_S);
        if timed.is_none() && controller.sampling != Sampling::Reply {
            setup.sampling = controller.sampling;
        }
        let far = match &tls {
            Some(tls) => NativeLink::over_tls(setup, tls.clone()),
            None => NativeLink::new(setup),
        };
        Ok(Box::new(far))
    }))
}

fn openfresco(
    link: &LinkSpec,
    at: &KeyPath,
    path: &Path,
    axes: usize,
) -> Result<LinkBuild, Box<Finding>> {
    let settings = openfresco_client(link, at, path, axes)?;
    let at = at.key("link");
    // Mistakes in the settings show now.
    Remote::new(settings.clone())
        .map_err(|error| Box::new(Finding::error(at.key(error.key()), error.to_string())))?;
    Ok(Arc::new(move |_: &Controller| {
        let remote = Remote::new(settings.clone()).map_err(|error| error.to_string())?;
        Ok(Box::new(remote))
    }))
}

#[cfg(test)]
mod tests;
