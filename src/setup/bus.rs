//! From `[bus.NAME]` and `[specimen.bus]` to a specimen on the bus. Nothing is opened here.
//!
//! On the simulated clock the devices are simulated in this process, and the stand-in of each specimen is what they move.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::site::Draft;
use super::{Refused, Site, path};
use gusset_actuator::specimen::{InProcess, InUnits, Specimen};
use gusset_config::{
    Acceptance, BusAxis, BusClock, BusCondition, BusSpec, BusTable, ClockChoice, ConfigError,
    DeviceTable, Finding, Flow, KeyPath, LinkSpec, Loaded, SpecimenTable, TimingSpec,
};
use gusset_control::port::limits::AxisLimits;
use gusset_control::port::{OnStale, WaitRules};
use gusset_ethercat::line::Line;
use gusset_ethercat::plan::{
    AxisPlan, BusPlan, Check, CommandPlan, DevicePlan, DrivePlan, EntryPlace, Scaled, SpecimenPlan,
    TimeSource,
};
use gusset_ethercat::simulated::{Plant, SimulatedBus, SimulatedLine, SimulationError};
use gusset_ethercat::{BusError, BusPort, FollowingClock, Keeper, Opener, SharedBus};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::time::SimClock;
use gusset_record::rt::clock::MonotonicClock;
use gusset_record::rt::{RtPlan, apply, os};

/// First bytes of the sender of our frames; the last two tell processes apart.
const SOURCE: [u8; 4] = [0x10, 0x47, 0x53, 0x54];

/// The sender of our frames.
#[must_use]
pub fn bus_source() -> [u8; 6] {
    let [a, b, c, d] = SOURCE;
    let [low, high, ..] = std::process::id().to_le_bytes();
    [a, b, c, d, low, high]
}

/// The place that `at` names. The check of the file has made sure that it is there.
fn place(bus: &BusTable, flow: Flow, at: &str) -> Option<EntryPlace> {
    let (device, entry) = bus.place(flow, at)?;
    Some(EntryPlace { device, entry })
}

/// The axes of a specimen, whose `units` are metres and newtons in one unit of each axis.
fn specimen_plan(bus: &BusTable, spec: &BusSpec, units: &[(f64, f64)]) -> Option<SpecimenPlan> {
    let input = |at: &str, per_count, zero_count| {
        Some(Scaled {
            at: place(bus, Flow::Inputs, at)?,
            per_count,
            zero_count,
        })
    };
    let check = |one: &BusCondition| {
        let mask = one.mask.unwrap_or(u32::MAX);
        Some(Check {
            at: place(bus, Flow::Inputs, &one.at)?,
            mask,
            equals: one.equals & mask,
        })
    };
    let axis = |(axis, (metres, newtons)): (&BusAxis, &(f64, f64))| {
        let command = match (&axis.command, &axis.drive) {
            (Some(command), _) => CommandPlan::Output(Scaled {
                at: place(bus, Flow::Outputs, &command.at)?,
                per_count: command.m_per_count / metres,
                zero_count: command.offset_count,
            }),
            (None, Some(drive)) => CommandPlan::Drive(bus.number_of(&drive.device)?),
            (None, None) => return None,
        };
        let force = &axis.force;
        let disp = match &axis.disp {
            Some(disp) => Some(input(&disp.at, disp.m_per_count / metres, disp.zero_count)?),
            None => None,
        };
        Some(AxisPlan {
            command,
            force: input(&force.at, force.n_per_count / newtons, force.zero_count)?,
            disp,
            good: axis.good.iter().map(check).collect::<Option<_>>()?,
        })
    };
    Some(SpecimenPlan {
        axes: spec
            .axis
            .iter()
            .zip(units)
            .map(axis)
            .collect::<Option<_>>()?,
        interlock: spec.interlock.iter().map(check).collect::<Option<_>>()?,
    })
}

fn device_plan(specimens: &[SpecimenTable], device: &DeviceTable) -> DevicePlan {
    DevicePlan {
        name: device.name.clone(),
        vendor: device.product.vendor,
        code: device.product.code,
        revision: device.product.revision,
        outputs: device.outputs.clone(),
        inputs: device.inputs.clone(),
        assign: device.assign,
        setup: device.setup.clone(),
        drive: drive_plan(specimens, device),
    }
}

/// The plan of a drive, from the axis that it moves.
fn drive_plan(specimens: &[SpecimenTable], device: &DeviceTable) -> Option<DrivePlan> {
    for table in specimens {
        let axes = table.bus.iter().flat_map(|bus| &bus.axis);
        for (index, axis) in axes.enumerate() {
            let Some(drive) = axis.drive.as_ref().filter(|one| one.device == device.name) else {
                continue;
            };
            let count = table.units_of(index + 1).len().max(index + 1);
            let units = table.units_of(count);
            let metres = units.get(index).map_or(1.0, |units| units.metres);
            let limits = table.limits_of(count);
            let limits = limits.get(index).map_or(AxisLimits::NONE, AxisLimits::of);
            let following = limits.size(Limit::FollowingError).trip;
            return Some(DrivePlan {
                counts_per_unit: metres / drive.m_per_count,
                accel: limits.size(Limit::CommandAccel).trip / metres,
                following_counts: following
                    .is_finite()
                    .then(|| (following / drive.m_per_count).abs()),
                accepts_free_stop: device.accept == Some(Acceptance::TorqueOff),
            });
        }
    }
    None
}

/// The bus of this name as its file says it, with the samples of the specimens on it. `period_s`: time from tick to tick in s.
pub(super) fn bus_plan(
    (specimens, period_s): (&[SpecimenTable], f64),
    (name, bus): (&str, &BusTable),
) -> BusPlan {
    let specs = || {
        let all = specimens.iter();
        all.filter_map(|table| table.bus.as_ref().filter(|spec| spec.bus == name))
    };
    // All specimens of a bus sample at one time: that was checked.
    let share = specs().next().and_then(BusSpec::samples_after);
    let patience_s = specs()
        .map(|spec| spec.connect_timeout_s)
        .fold(0.0, f64::max);
    BusPlan {
        name: name.to_owned(),
        devices: bus
            .device
            .iter()
            .map(|one| device_plan(specimens, one))
            .collect(),
        period_ns: (period_s * 1e9).round() as u64,
        time: match bus.clock {
            BusClock::Follow => TimeSource::Bus,
            BusClock::Free => TimeSource::Loop,
        },
        watchdog_ns: (bus.watchdog_s * 1e9) as u64,
        sample_after_ns: share.map(|share| (share * period_s * 1e9) as u64),
        patience_ns: (patience_s.max(1.0) * 1e9) as u64,
        stale_ticks: u32::try_from(bus.stale_ticks).unwrap_or(u32::MAX),
    }
}

/// An output that cannot say where its axis stands, or a trip level that its sensor cannot read.
pub(super) fn beyond_range(
    at: &KeyPath,
    (table, spec): (&SpecimenTable, &BusSpec),
    (bus, plan): (&BusTable, &SpecimenPlan),
    units: &[(f64, f64)],
) -> Option<Finding> {
    let entry = |flow: Flow, scaled: &Scaled| {
        let device = bus.device.get(scaled.at.device)?;
        let entries = match flow {
            Flow::Inputs => &device.inputs,
            Flow::Outputs => &device.outputs,
        };
        Some(entries.get(scaled.at.entry)?.kind.range())
    };
    let limits = table.limits_of(units.len());
    let axes = plan.axes.iter().zip(&spec.axis).zip(units).enumerate();
    for (index, ((own, axis), (metres, newtons))) in axes {
        let stands = spec.stands_at_m.as_ref().and_then(|all| all.get(index));
        if let (CommandPlan::Output(scaled), Some(stands), Some(command)) =
            (&own.command, stands, &axis.command)
            && let Some((low, high)) = entry(Flow::Outputs, scaled)
        {
            let count = scaled.count(stands / metres);
            if !(low..=high).contains(&count) {
                let text = format!(
                    "the position before the test is {stands} m, which is count {count:.0} of `{}`; it takes {low} to {high}",
                    command.at
                );
                let finding = Finding::error(at.key("bus").key("stands_at_m").index(index), text);
                return Some(finding.help("correct `m_per_count` or `stands_at_m`"));
            }
        }
        let levels = limits.get(index).map_or(AxisLimits::NONE, AxisLimits::of);
        let force = (
            &own.force,
            "force",
            &axis.force.at,
            newtons,
            Limit::MeasuredForce,
        );
        let disp = own.disp.as_ref().zip(axis.disp.as_ref());
        let disp = disp.map(|(own, of)| (own, "disp", &of.at, metres, Limit::MeasuredDisp));
        for (scaled, name, place, unit, limit) in [Some(force), disp].into_iter().flatten() {
            let Some((low, high)) = entry(Flow::Inputs, scaled) else {
                continue;
            };
            let ends = [low, high].map(|count| scaled.value(count) * unit);
            let (least, most) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            let [lower, upper] = levels.get(limit).trip;
            let is_beyond =
                (lower.is_finite() && lower <= least) || (upper.is_finite() && upper >= most);
            if is_beyond {
                let text = format!(
                    "`{place}` reads {least} to {most}, so the trip levels of `{}`, {lower} to {upper}, are never reached",
                    limit.key()
                );
                let key = at.key("bus").key("axis").index(index).key(name);
                return Some(Finding::error(key, text).help(
                    "correct the scale of the sensor, or choose trip levels within its range",
                ));
            }
        }
    }
    None
}

/// The specimens of a test, and its tick in s.
fn of_test(loaded: &Loaded) -> (&[SpecimenTable], f64) {
    (&loaded.file.specimen, loaded.time.period.value())
}

/// True if an output of this device commands an axis of this specimen.
fn carries_command(bus: &BusTable, spec: &BusSpec, device: &DeviceTable) -> bool {
    let mut commands = spec.axis.iter().filter_map(|axis| axis.command.as_ref());
    commands.any(|command| {
        let place = bus.place(Flow::Outputs, &command.at);
        let found = place.and_then(|(number, _)| bus.device.get(number));
        found.is_some_and(|found| found.name == device.name)
    })
}

/// A device that commands an axis, and may drop its outputs at the expiry of its watchdog.
pub(super) fn drops_outputs(name: &str, bus: &BusTable, spec: &BusSpec) -> Option<Finding> {
    let mut devices = bus.device.iter();
    let device = devices.find(|one| {
        carries_command(bus, spec, one)
            && one.setup.is_empty()
            && one.accept != Some(Acceptance::ZeroVolts)
    })?;
    let text = format!(
        "device \"{}\" commands an axis, and nothing says that its outputs keep their last value when its watchdog expires",
        device.name
    );
    let finding = Finding::error(path("bus").key(name).key("device"), text);
    Some(finding.help(
        "write the object that keeps the value (`setup`, see its manual); or set `accept = \"zero volts on watchdog\"` and \
         `accept_reason`",
    ))
}

/// The bus of a specimen, and the specimen on it. `units` as in [`specimen_plan`].
pub(super) fn planned<'a>(
    at: &KeyPath,
    (table, link): (&'a SpecimenTable, &LinkSpec),
    buses: &'a BTreeMap<String, BusTable>,
    units: &[(f64, f64)],
) -> Result<(&'a BusSpec, &'a BusTable, SpecimenPlan), Box<Finding>> {
    let (Some(spec), Some(bus)) = (&table.bus, buses.get(&link.address)) else {
        let text = format!("there is no `[bus.{}]`", link.address);
        return Err(Box::new(Finding::error(at.key("bus").key("bus"), text)));
    };
    let text = "an entry of this specimen is not on its bus";
    let plan = specimen_plan(bus, spec, units)
        .ok_or_else(|| Box::new(Finding::error(at.key("bus").key("axis"), text)))?;
    Ok((spec, bus, plan))
}

/// A specimen on its bus, and how it is waited for. `plant` is what a simulated bus moves.
pub(super) fn on_bus(
    site: &mut Site<'_>,
    at: &KeyPath,
    (table, link): (&SpecimenTable, &LinkSpec),
    units: &[(f64, f64)],
    plant: Option<Box<dyn Specimen>>,
) -> Result<(BusPort, WaitRules), Refused> {
    let (spec, bus, plan) = match planned(at, (table, link), &site.loaded.file.bus, units) {
        Ok(found) => found,
        Err(finding) => return site.refuse(*finding),
    };
    let mut others = site
        .loaded
        .file
        .specimen
        .iter()
        .filter_map(|one| one.bus.as_ref());
    if others.any(|one| one.bus == spec.bus && one.samples_after() != spec.samples_after()) {
        let text = "the specimens of one bus sample at different times";
        let finding = Finding::error(at.key("bus").key("sample"), text);
        return site.refuse(finding.help(
            "give all of them equal `sample` and `sample_after`: one frame reads the inputs of all devices",
        ));
    }
    if let Some(finding) = drops_outputs(&link.address, bus, spec)
        .or_else(|| beyond_range(at, (table, spec), (bus, &plan), units))
    {
        return site.refuse(finding);
    }
    let wait = WaitRules {
        reply_timeout_ns: (link.reply_timeout_s * 1e9) as u64,
        on_stale: OnStale::Hold,
        stale_in_a_row: bus.stale_ticks,
        has_clock: bus.clock == BusClock::Follow,
    };
    if site.bus.is_none() {
        site.bus = Some(draft(site, &link.address, bus));
    }
    let Some(draft) = &site.bus else {
        return Err(Refused);
    };
    if let (Some(law), Ok(mut plants)) = (plant, draft.plants.lock()) {
        let law = Box::new(InProcess::new(InUnits::around(law, units)));
        let metres = units.iter().map(|(metres, _)| metres);
        let stands = table.bus.as_ref().and_then(|spec| spec.stands_at_m.clone());
        let stands = stands.unwrap_or_else(|| vec![0.0; units.len()]);
        plants.push(Plant {
            specimen: plan.clone(),
            law,
            stands_at: stands
                .iter()
                .zip(metres)
                .map(|(disp, metres)| disp / metres)
                .collect(),
        });
    }
    Ok((BusPort::new(Arc::clone(&draft.shared), plan), wait))
}

/// True if the devices are simulated in this process, so that each specimen needs a law for them to move.
pub(super) const fn is_simulated(loaded: &Loaded) -> bool {
    matches!(loaded.time.clock, ClockChoice::Simulated)
}

fn draft(site: &Site<'_>, name: &str, bus: &BusTable) -> Draft {
    let (loaded, faults) = (site.loaded, site.bus_faults.clone());
    let plan = bus_plan(of_test(loaded), (name, bus));
    let tables = loaded.file.specimen.iter();
    let specimens = tables.filter(|table| table.bus.is_some()).count();
    let plants: Arc<Mutex<Vec<Plant>>> = Arc::default();
    let own = bus_source();
    let (opener, keeper): (Opener, Option<Keeper>) = if is_simulated(loaded) {
        let (plants, plan) = (Arc::clone(&plants), plan.clone());
        let open = move || -> Result<Box<dyn Line>, BusError> {
            let plants = plants.lock().map(|mut all| std::mem::take(&mut *all));
            let bus = SimulatedBus::new(&plan, plants.unwrap_or_default(), faults);
            let bus =
                bus.map_err(|error: SimulationError| BusError::Simulation(error.to_string()))?;
            let bus = Arc::new(Mutex::new(bus));
            Ok(Box::new(SimulatedLine::new(bus, Box::new(SimClock::new()))))
        };
        (Box::new(open), None)
    } else {
        let interface = bus.interface.clone();
        let open = move || super::bus_line::open(&interface);
        (
            Box::new(open),
            Some(keeper(&loaded.file.timing, plan.period_ns)),
        )
    };
    Draft {
        shared: SharedBus::new(plan, (own, specimens), opener, keeper),
        plants,
    }
}

/// The keeper is as urgent as the loop but for one step, on the first processor: it alone feeds drives while the operator is awaited.
pub(super) fn keeper(timing: &TimingSpec, period_ns: u64) -> Keeper {
    let plan = super::rt_plan(timing, period_ns);
    let prepare = move || {
        let cpus = os::process_cpus();
        let urgency = plan
            .fifo_priority
            .map(|priority| priority.saturating_sub(1).max(1));
        // A refusal is reported for the loop, which asks for more.
        let _ = apply(&RtPlan {
            fifo_priority: urgency,
            cpu: cpus.first().copied().or(plan.cpu),
            ..plan
        });
    };
    Keeper {
        clock: Arc::new(MonotonicClock::default()),
        prepare: Box::new(prepare),
    }
}

/// The clock of a loop that follows this bus.
pub(super) fn followed(site: &Site<'_>) -> Option<gusset_control::engine::FollowedClock> {
    let draft = site.bus.as_ref()?;
    let plan = draft.shared.plan();
    if plan.time != TimeSource::Bus {
        return None;
    }
    let (time, period_ns) = (Arc::clone(draft.shared.time()), plan.period_ns);
    Some(gusset_control::engine::FollowedClock(Box::new(
        move |below| Box::new(FollowingClock::new(below, time, period_ns)),
    )))
}

/// The bus of a test file, for commands that need no test.
///
/// # Errors
/// The file has no bus.
pub fn bus_of(loaded: &Loaded) -> Result<(BusPlan, String), ConfigError> {
    match loaded.file.bus.iter().next() {
        Some((name, bus)) => Ok((
            bus_plan(of_test(loaded), (name, bus)),
            bus.interface.clone(),
        )),
        None => {
            let text = "this file has no `[bus.NAME]`";
            Err(loaded.refuse(vec![Finding::error(path("bus"), text)]))
        }
    }
}
