//! `[specimen.bus]`: names of process data, scales, conditions and drives of a specimen on a bus.

use super::specimen::counted;
use super::{Findings, idle, numbers};
use crate::axis_table::AxisTable;
use crate::bus_spec::{BusAxis, BusCondition, BusDrive, BusSpec};
use crate::bus_table::{BusTable, Buses, Flow};
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::limit_table::LimitsSpec;
use crate::link_table::Protocol;
use crate::specimen::SpecimenTable;
use crate::suggest::{listed, nearest};
use gusset_quantity::catalog::limit::Limit;
use gusset_wire::process_data::{Entry, Kind};

/// Objects of a CiA-402 drive in position mode (ETG.6010), with their type and the list that must have them.
const OF_DRIVE: [(u16, Kind, Flow, &str); 4] = [
    (0x6040, Kind::U16, Flow::Outputs, "controlword"),
    (0x607a, Kind::I32, Flow::Outputs, "target position"),
    (0x6041, Kind::U16, Flow::Inputs, "statusword"),
    (0x6064, Kind::I32, Flow::Inputs, "actual position"),
];

/// A specimen on a bus. `at` is the place of the specimen.
pub(super) fn check_on_bus(
    specimen: &SpecimenTable,
    spec: &BusSpec,
    buses: &Buses,
    at: &KeyPath,
    findings: &mut Findings,
) {
    let here = at.key("bus");
    if let Some(link) = &specimen.link
        && link.protocol != Protocol::Ethercat
    {
        let finding = Finding::error(
            here.clone(),
            "a specimen has either `link` or `bus`, not both",
        );
        let finding = finding.at_key().label("an EtherCAT bus");
        findings.push(finding.beside(at.key("link"), "a network connection").help(
            "remove [specimen.link] if the specimen is on the bus, otherwise [specimen.bus]",
        ));
    }
    findings.numbers(&here, numbers::NUMBERS_OF_SPECIMEN_ON_BUS);
    findings.idle(&here, idle::IDLE_BUS, |when| when(spec));
    let axes = specimen.axes();
    if spec.axis.len() != axes {
        let text = format!(
            "the specimen has {}, but {} given",
            counted(axes, "axis", "axes"),
            counted(
                spec.axis.len(),
                "`bus.axis` table is",
                "`bus.axis` tables are"
            )
        );
        let finding = Finding::error(here.key("axis"), text).at_key();
        findings.push(finding.label("one table per axis"));
    }
    check_position(spec, &here, findings);
    check_units(specimen, at, findings);
    let limits = specimen.limits_of(spec.axis.len());
    for (index, (axis, limits)) in spec.axis.iter().zip(&limits).enumerate() {
        let here = here.key("axis").index(index);
        findings.exactly_one(
            &here,
            &["command", "drive"],
            "an axis is moved by one of them",
        );
        findings.numbers(&here, numbers::NUMBERS_OF_AXIS_ON_BUS);
        if axis.drive.is_some() {
            check_deceleration(limits, index, &here, findings);
        }
    }
    match buses.get(&spec.bus) {
        Some(bus) => check_places(spec, bus, &here, findings),
        None => {
            let names: Vec<&str> = buses.keys().map(String::as_str).collect();
            let text = format!("this file has no bus {:?}", spec.bus);
            let finding = Finding::error(here.key("bus"), text);
            findings.push(among(
                finding,
                &spec.bus,
                &names,
                "a [bus.NAME] table is needed",
            ));
        }
    }
}

/// The finding about an unknown name: the nearest name, and all of them.
fn among(finding: Finding, found: &str, names: &[&str], without: &str) -> Finding {
    let finding = match nearest(found, names) {
        Some(near) => finding.label(format!("did you mean {near:?}?")),
        None => finding,
    };
    finding.help(match names {
        [] => without.to_owned(),
        names => format!("allowed here: {}", listed(names, "or")),
    })
}

/// `stands_at_m` belongs to outputs, which report no position.
fn check_position(spec: &BusSpec, at: &KeyPath, findings: &mut Findings) {
    let has_command = spec.axis.iter().any(|axis| axis.command.is_some());
    let place = at.key("stands_at_m");
    match &spec.stands_at_m {
        None if has_command => {
            let text = "the position of this specimen before the test is unknown";
            let example = vec![0.0; spec.axis.len()];
            findings.push(
                Finding::error(at.clone(), text)
                    .at_key()
                    .label("an output does not report its position")
                    .help(format!(
                        "give it as `stands_at_m = {example:?}`, in m: the outputs command it when they become active"
                    )),
            );
        }
        Some(_) if spec.axis.iter().all(|axis| axis.drive.is_some()) => {
            let text = "the drives report their positions, so `stands_at_m` is not needed";
            findings.push(
                Finding::error(place, text)
                    .at_key()
                    .label("only for `command`"),
            );
        }
        _ => {}
    }
}

/// Counts are scaled to SI units by the bus.
fn check_units(specimen: &SpecimenTable, at: &KeyPath, findings: &mut Findings) {
    let usual = AxisTable::default();
    for (index, axis) in specimen.axis.iter().enumerate() {
        let at = at.key("axis").index(index);
        for (key, differs, scale) in [
            (
                "unit_disp",
                axis.unit_disp != usual.unit_disp,
                "m_per_count",
            ),
            (
                "unit_force",
                axis.unit_force != usual.unit_force,
                "n_per_count",
            ),
        ] {
            if differs {
                let text = format!("`{key}` is for a link: `{scale}` converts counts on a bus");
                findings.push(Finding::error(at.key(key), text).label("remove this key"));
            }
        }
    }
}

/// A drive comes to rest within a limit when no command follows.
fn check_deceleration(limits: &LimitsSpec, index: usize, at: &KeyPath, findings: &mut Findings) {
    let limit = Limit::CommandAccel;
    if limits.size(limit).and_then(|levels| levels.trip).is_none() {
        let key = limit.key();
        let text = format!(
            "a drive needs a trip level of `{key}` on axis {}",
            index + 1
        );
        findings.push(
            Finding::error(at.key("drive"), text)
                .at_key()
                .label("the drive comes to rest within it when the test stops")
                .help(format!(
                    "give `{key} = {{ trip = 20.0 }}` in [specimen.limits], with the number of your actuator"
                )),
        );
    }
}

/// The names of process data. `at` is `[specimen.bus]`.
fn check_places(spec: &BusSpec, bus: &BusTable, at: &KeyPath, findings: &mut Findings) {
    for (index, axis) in spec.axis.iter().enumerate() {
        let at = at.key("axis").index(index);
        let BusAxis {
            command,
            drive,
            force,
            disp,
            good,
        } = axis;
        if let Some(command) = command {
            find(
                bus,
                &command.at,
                Flow::Outputs,
                &at.key("command"),
                findings,
            );
        }
        if let Some(drive) = drive {
            check_drive(bus, drive, &at.key("drive"), findings);
        }
        find(bus, &force.at, Flow::Inputs, &at.key("force"), findings);
        if let Some(disp) = disp {
            find(bus, &disp.at, Flow::Inputs, &at.key("disp"), findings);
        }
        for (index, one) in good.iter().enumerate() {
            check_condition(bus, one, &at.key("good").index(index), findings);
        }
    }
    for (index, one) in spec.interlock.iter().enumerate() {
        check_condition(bus, one, &at.key("interlock").index(index), findings);
    }
}

/// The entry that `text` names, or a finding at `at`.
fn find<'a>(
    bus: &'a BusTable,
    text: &str,
    flow: Flow,
    at: &KeyPath,
    findings: &mut Findings,
) -> Option<&'a Entry> {
    if let Some((device, entry)) = bus.place(flow, text) {
        return bus.device.get(device)?.entries(flow).get(entry);
    }
    let at = at.key("at");
    let kind = flow.kind();
    let Some((device, entry)) = text.split_once('.') else {
        let headline = format!("{text:?} names no {kind}");
        let label = "write \"device.entry\", with the names of the bus";
        findings.push(Finding::error(at, headline).label(label));
        return None;
    };
    let Some(table) = bus.device(device) else {
        let finding = Finding::error(at, format!("the bus has no device {device:?}"));
        findings.push(unknown_device(finding, bus, device));
        return None;
    };
    if bus.place(flow.other(), text).is_some() {
        let other = flow.other().kind();
        let headline = format!("{text:?} is an {other}, but an {kind} is needed here");
        findings.push(Finding::error(at, headline).label(format!("an {other} of the device")));
        return None;
    }
    let named = table.entries(flow).iter();
    let names: Vec<&str> = named.filter_map(|entry| entry.name.as_deref()).collect();
    let headline = format!("the device {device:?} has no {kind} {entry:?}");
    let without = format!(
        "none of its {} has a name: write it behind the type",
        flow.key()
    );
    findings.push(among(Finding::error(at, headline), entry, &names, &without));
    None
}

fn unknown_device(finding: Finding, bus: &BusTable, device: &str) -> Finding {
    let names: Vec<&str> = bus.device.iter().map(|one| one.name.as_str()).collect();
    among(finding, device, &names, "the bus has no device")
}

/// A drive maps the objects of its mode.
fn check_drive(bus: &BusTable, drive: &BusDrive, at: &KeyPath, findings: &mut Findings) {
    let place = at.key("device");
    let Some(device) = bus.device(&drive.device) else {
        let finding = Finding::error(place, format!("the bus has no device {:?}", drive.device));
        findings.push(unknown_device(finding, bus, &drive.device));
        return;
    };
    for (index, kind, flow, word) in OF_DRIVE {
        let mut entries = device.entries(flow).iter();
        let found = entries.find(|entry| (entry.index, entry.sub) == (index, 0));
        if found.is_some_and(|entry| entry.kind == kind) {
            continue;
        }
        let key = flow.key();
        let found = match found {
            None => "lacks this object".to_owned(),
            Some(entry) => format!("maps it as {}", entry.kind.word()),
        };
        let text = format!(
            "the drive {:?} needs the {word} in its `{key}`",
            drive.device
        );
        let finding = Finding::error(place, text).label(format!("the device {found}"));
        let help = format!(
            "add \"{index:04x}:00 {}\" to `{key}` of the device",
            kind.word()
        );
        findings.push(finding.help(help));
        return;
    }
}

/// A condition compares bits that its input has.
fn check_condition(bus: &BusTable, one: &BusCondition, at: &KeyPath, findings: &mut Findings) {
    let Some(entry) = find(bus, &one.at, Flow::Inputs, at, findings) else {
        return;
    };
    let word = entry.kind.word();
    let bits = match entry.kind {
        Kind::U8 | Kind::I8 => u32::from(u8::MAX),
        Kind::U16 | Kind::I16 => u32::from(u16::MAX),
        Kind::U32 | Kind::I32 => u32::MAX,
        Kind::F32 | Kind::F64 => {
            let text = format!("{:?} is {word}, but a condition compares bits", one.at);
            let finding = Finding::error(at.key("at"), text);
            findings.push(finding.label("an integer type is needed"));
            return;
        }
    };
    let mask = one.mask.unwrap_or(bits);
    if mask == 0 || mask & !bits != 0 {
        let text = format!(
            "`mask` is {mask:#x}, but {:?} has the bits {bits:#x}",
            one.at
        );
        let finding = Finding::error(at.key("mask"), text);
        findings.push(finding.label("at least one bit of the input, and no other bit"));
    } else if one.equals & !mask != 0 {
        let text = format!(
            "`equals` is {:#x}, but only the bits {mask:#x} are compared",
            one.equals
        );
        let finding = Finding::error(at.key("equals"), text);
        findings.push(finding.label("the condition would never be true"));
    }
}

/// No output is commanded twice.
pub(super) fn check_commands(buses: &Buses, specimens: &[SpecimenTable], findings: &mut Findings) {
    let mut known: Vec<((&str, usize, usize), KeyPath)> = Vec::new();
    for (index, specimen) in specimens.iter().enumerate() {
        let Some(spec) = &specimen.bus else { continue };
        let Some(bus) = buses.get(&spec.bus) else {
            continue;
        };
        let at = KeyPath::root()
            .key("specimen")
            .index(index)
            .under("bus.axis");
        for (index, axis) in spec.axis.iter().enumerate() {
            let at = at.index(index);
            for (place, at) in commanded(bus, axis, &at) {
                let output = (spec.bus.as_str(), place.0, place.1);
                if let Some((_, first)) = known.iter().find(|known| known.0 == output) {
                    let text = "two axes command one output";
                    let finding = Finding::error(at, text).label("also here");
                    findings.push(finding.beside(first.clone(), "first here"));
                    break;
                }
                known.push((output, at));
            }
        }
    }
}

/// Device and entry of each output that an axis commands, with its place in the file.
fn commanded(bus: &BusTable, axis: &BusAxis, at: &KeyPath) -> Vec<((usize, usize), KeyPath)> {
    let mut found = Vec::new();
    if let Some(command) = &axis.command
        && let Some(place) = bus.place(Flow::Outputs, &command.at)
    {
        found.push((place, at.key("command").key("at")));
    }
    let Some(drive) = &axis.drive else {
        return found;
    };
    let device = bus.number_of(&drive.device);
    let Some((device, table)) = device.and_then(|index| Some((index, bus.device.get(index)?)))
    else {
        return found;
    };
    let outputs = table.outputs.iter().enumerate();
    let of_drive = outputs.filter(|(_, entry)| matches!(entry.index, 0x6040 | 0x607a));
    found.extend(of_drive.map(|(entry, _)| ((device, entry), at.key("drive").key("device"))));
    found
}
