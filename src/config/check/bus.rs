//! `[bus.NAME]`: numbers, devices and process data of a bus.

use super::on_bus::{check_commands, check_on_bus};
use super::{Findings, numbers};
use crate::bus_table::{Acceptance, BusTable, Buses, DeviceTable, Flow};
use crate::diagnose::Finding;
use crate::document::KeyPath;
use crate::echo::number;
use crate::specimen::SpecimenTable;
use gusset_quantity::text::{is_hidden, is_reason};
use gusset_wire::process_data::{Entry, length};

/// Most bytes of process data of a bus. One frame holds them, with a datagram for the clock and one for the states.
const MOST_BYTES: usize = 1400;
/// Most bytes of the name of a network interface in Linux.
const LONGEST_INTERFACE: usize = 15;

/// The buses of a file and the specimens on them. `tick_s`: time from tick to tick in s, if the file says it.
pub(super) fn check_buses(
    buses: &Buses,
    specimens: &[SpecimenTable],
    tick_s: Option<f64>,
    findings: &mut Findings,
) {
    let specs = || specimens.iter().filter_map(|table| table.bus.as_ref());
    let root = KeyPath::root().key("bus");
    if let [first, second, ..] = buses.keys().collect::<Vec<_>>().as_slice() {
        let text = format!(
            "this file has {} buses, but at most one is allowed",
            buses.len()
        );
        let finding = Finding::error(root.key(second), text).at_key();
        let finding = finding.label("the ticks follow the clock of one bus");
        let finding = finding.beside(root.key(first), "the first bus");
        findings.push(finding.help(
            "connect all devices to one bus, or serve the specimens of the other one with `gusset serve`",
        ));
    }
    for (name, bus) in buses {
        let at = root.key(name);
        check_bus(name, bus, tick_s, &at, findings);
        let drives: Vec<&str> = specs()
            .filter(|spec| spec.bus == *name)
            .flat_map(|spec| &spec.axis)
            .filter_map(|axis| Some(axis.drive.as_ref()?.device.as_str()))
            .collect();
        for (index, device) in bus.device.iter().enumerate() {
            let at = at.key("device").index(index);
            check_acceptance(
                device,
                drives.contains(&device.name.as_str()),
                &at,
                findings,
            );
        }
        // A specimen with an unknown bus may mean this one.
        if !specs().any(|spec| spec.bus == *name || !buses.contains_key(&spec.bus)) {
            let text = format!("no specimen uses the bus `{name}`");
            let finding = Finding::warning(at, text).at_key();
            findings.push(finding.label("`bus` in [specimen.bus] would name it"));
        }
    }
    for (index, specimen) in specimens.iter().enumerate() {
        if let Some(spec) = &specimen.bus {
            let at = KeyPath::root().key("specimen").index(index);
            check_on_bus(specimen, spec, buses, &at, findings);
        }
    }
    check_commands(buses, specimens, findings);
}

/// A bus by itself.
fn check_bus(
    name: &str,
    bus: &BusTable,
    tick_s: Option<f64>,
    at: &KeyPath,
    findings: &mut Findings,
) {
    if !is_name(name) {
        let text = format!("{name:?} cannot name a bus");
        findings.push(Finding::error(at.clone(), text).at_key().label(NAME));
    }
    findings.numbers(at, numbers::NUMBERS_OF_BUS);
    if let Some(tick_s) = tick_s
        && bus.watchdog_s > 0.0
        && bus.watchdog_s <= 3.0 * tick_s
    {
        let at = at.key("watchdog_s");
        let text = format!(
            "`{at}` must be longer than three ticks, {} s",
            number(3.0 * tick_s)
        );
        let finding = Finding::error(at, text).label(format!("found {}", number(bus.watchdog_s)));
        findings.push(finding.help("with less, the devices would stop between two ticks"));
    }
    let interface = bus.interface.as_str();
    let is_plain = |c: char| !c.is_whitespace() && !is_hidden(c) && c != '/';
    if interface.is_empty()
        || interface.len() > LONGEST_INTERFACE
        || !interface.chars().all(is_plain)
    {
        let text = format!("{interface:?} cannot be a network interface");
        findings.push(
            Finding::error(at.key("interface"), text)
                .label("a name has 1 to 15 bytes without blanks and `/`")
                .help("`ip link` lists the interfaces of this computer"),
        );
    }
    if bus.device.is_empty() {
        let text = format!("the bus `{name}` has no device");
        let finding = Finding::error(at.key("device"), text);
        findings.push(finding.help(format!(
            "`gusset bus scan {interface}` writes the [[bus.{name}.device]] tables"
        )));
    }
    for (index, device) in bus.device.iter().enumerate() {
        let here = at.key("device").index(index);
        check_device(device, &here, findings);
        let known = bus.device.iter().take(index);
        if let Some(first) = known.clone().position(|other| other.name == device.name) {
            let text = format!("two devices of this bus are called `{}`", device.name);
            let first = at.key("device").index(first).key("name");
            let finding = Finding::error(here.key("name"), text).label("again here");
            findings.push(finding.beside(first, "first here"));
        }
    }
    check_size(name, bus, at, findings);
}

/// One frame holds the process data of all devices.
fn check_size(name: &str, bus: &BusTable, at: &KeyPath, findings: &mut Findings) {
    let bytes: Vec<usize> = bus.device.iter().map(bytes_of).collect();
    let total: usize = bytes.iter().sum();
    let large = bytes
        .iter()
        .enumerate()
        .find(|(_, bytes)| **bytes > MOST_BYTES);
    let (place, text) = match large {
        Some((index, bytes)) => (
            at.key("device").index(index),
            format!("the process data of this device are {bytes} bytes"),
        ),
        None if total > MOST_BYTES => (
            at.key("device"),
            format!("the process data of the bus `{name}` are {total} bytes"),
        ),
        None => return,
    };
    let finding = Finding::error(place, text).at_key();
    findings.push(
        finding
            .label(format!("at most {MOST_BYTES} bytes are allowed: one frame for each tick"))
            .help("map fewer objects: with `assign = true` the mapping of the file is written to the device"),
    );
}

fn bytes_of(device: &DeviceTable) -> usize {
    length(&device.outputs) + length(&device.inputs)
}

const NAME: &str = "a name has 1 to 64 bytes, no dot and no hidden character";

fn is_name(name: &str) -> bool {
    let is_empty = name.trim().is_empty();
    !is_empty && name.len() <= 64 && !name.contains('.') && !name.chars().any(is_hidden)
}

/// A device by itself.
fn check_device(device: &DeviceTable, at: &KeyPath, findings: &mut Findings) {
    if !is_name(&device.name) {
        let text = format!("{:?} cannot name a device", device.name);
        let finding = Finding::error(at.key("name"), text).label(NAME);
        findings.push(finding.help("axes name process data as \"device.entry\""));
    }
    for flow in [Flow::Outputs, Flow::Inputs] {
        let entries = device.entries(flow);
        for (index, entry) in entries.iter().enumerate() {
            let here = at.key(flow.key()).index(index);
            let Some(name) = &entry.name else { continue };
            findings.printable(&here, Some(name));
            if entry.index == 0 {
                let text = format!("`{name}` names a gap: no object has the index 0");
                findings.push(Finding::error(here, text).label("a gap has no name"));
                continue;
            }
            let named = |other: &Entry| other.name.as_ref() == Some(name);
            if let Some(first) = entries.iter().take(index).position(named) {
                let text = format!("two {} of this device are called `{name}`", flow.key());
                let first = at.key(flow.key()).index(first);
                let finding = Finding::error(here, text).label("again here");
                findings.push(finding.beside(first, "first here"));
            }
        }
    }
}

/// `accept` and its reason.
fn check_acceptance(device: &DeviceTable, is_drive: bool, at: &KeyPath, findings: &mut Findings) {
    let reason = device.accept_reason.as_deref();
    findings.printable(&at.key("accept_reason"), reason);
    let Some(accept) = device.accept else {
        if reason.is_some() {
            let text = "`accept_reason` is given, but `accept` is missing";
            findings.push(Finding::error(at.key("accept_reason"), text).at_key());
        }
        return;
    };
    match reason {
        None => {
            let text = "`accept` needs `accept_reason` beside it";
            let finding = Finding::error(at.key("accept"), text).at_key();
            findings.push(finding.label("write a reason in words, which the summary repeats"));
        }
        Some(reason) if !is_reason(reason) => {
            let text = "`accept_reason` gives no reason";
            let finding = Finding::error(at.key("accept_reason"), text);
            findings.push(finding.label("write a reason in words, which the summary repeats"));
        }
        Some(_) => {}
    }
    let fits = match accept {
        Acceptance::ZeroVolts => !is_drive && !device.outputs.is_empty(),
        Acceptance::TorqueOff => is_drive,
    };
    if !fits {
        let (found, allowed) = match accept {
            Acceptance::ZeroVolts if is_drive => ("a drive", "only for an output terminal"),
            Acceptance::ZeroVolts => ("a device without outputs", "only for an output terminal"),
            Acceptance::TorqueOff => (
                "a device that no axis has as `drive`",
                "only for the `drive` of an axis",
            ),
        };
        let text = format!("`accept` has no meaning for {found}");
        findings.push(Finding::error(at.key("accept"), text).label(allowed));
    }
}
