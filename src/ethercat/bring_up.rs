//! From a line with devices to process data in SAFE-OP. Nothing moves: outputs are off until OP.
//!
//! The order is that of ETG.1000: count, station addresses, EEPROM, mailboxes, PRE-OP, objects, process data, clocks, SAFE-OP. Every
//! refusal names the device and what it says.

use crate::clocks;
use crate::cycle::{Bus, Member};
use crate::drive_setup::{check_drive, prepare_drive};
use crate::error::BusError;
use crate::line::Line;
use crate::pdo::{Direction, INPUTS, OUTPUT_KIND, OUTPUTS, map, mapped};
use crate::plan::{BusPlan, DevicePlan, TimeSource};
use crate::request::{Known, Requests, Station};
use crate::wire::coe::Object;
use crate::wire::datagram::{Service, at, position};
use crate::wire::drive;
use crate::wire::register as reg;
use crate::wire::register::AlState;
use crate::wire::sii::{Manager, Sii};
use gusset_wire::process_data::{Entry, SetupWrite, length};

/// Station address of the first device.
const FIRST_STATION: u16 = 0x1001;
/// Bit of the control byte by which a sync manager triggers the watchdog.
const WATCHED: u8 = 0x40;
/// Units of the watchdog in ns, each with its divider in units of 40 ns, less two. The first that can express the time is taken.
const WATCHDOG_UNITS: [(u64, u16); 2] = [(100_000, 2498), (1_000_000, 24_998)];
/// First word of the text by which a simulated device tells itself apart.
pub(crate) const SIMULATED: &str = "simulated ";

/// A device that was found by a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Its name from its EEPROM.
    pub name: String,
    /// Vendor, product code and revision.
    pub identity: [u32; 3],
    /// Its state.
    pub state: Option<AlState>,
    /// Its outputs and inputs as mapped; empty where it has no CoE.
    pub outputs: Vec<Entry>,
    /// See `outputs`.
    pub inputs: Vec<Entry>,
    /// Why the description is incomplete.
    pub remark: Option<String>,
}

/// How long the line is listened to before the first frame, for frames of another master.
const LISTEN_NS: u64 = 20_000_000;

/// Counts the devices and brings them to INIT with station addresses. Devices in operation are left alone, unless they are to be
/// released. The states that the devices had, in the order of the bus.
fn enumerate(
    requests: &mut Requests<'_>,
    releases: bool,
) -> Result<Vec<Option<AlState>>, BusError> {
    requests.listen(LISTEN_NS)?;
    let count = requests.ask(Service::Brd, 0, &mut [0])?;
    if count == 0 {
        return Err(BusError::NoDevice);
    }
    let mut states = Vec::with_capacity(count.into());
    for index in 0..count {
        let mut status = [0u8; 6];
        let address = at(position(index), reg::AL_STATUS);
        let counter = requests.ask(Service::Aprd, address, &mut status)?;
        let state = AlState::of(status[0]).filter(|_| counter == 1);
        if let (Some(state @ (AlState::SafeOp | AlState::Op)), false) = (state, releases) {
            return Err(BusError::InOperation {
                position: index + 1,
                state,
                code: u16::from_le_bytes([status[4], status[5]]),
            });
        }
        states.push(state);
    }
    requests.all_to_init()?;
    // No unit, manager or clock of an earlier master is left.
    requests.write_all(reg::DC_ACTIVATION, &[0, 0])?;
    for index in 0..count {
        let mut data = (FIRST_STATION + index).to_le_bytes();
        requests.ask(Service::Apwr, at(position(index), reg::STATION), &mut data)?;
        let station = Station::new(&format!("{}", index + 1), FIRST_STATION + index);
        let [units, managers] = requests.read(&station, reg::COUNTS)?;
        let zeros = |count: u8, size: u16| vec![0; usize::from(count.min(16)) * usize::from(size)];
        requests.write(&station, reg::FMMU, &zeros(units, reg::FMMU_SIZE))?;
        let managers = zeros(managers, reg::SYNC_MANAGER_SIZE);
        requests.write(&station, reg::SYNC_MANAGER, &managers)?;
    }
    Ok(states)
}

/// The devices of a plan in INIT, each with its EEPROM, whose identity is that of the plan.
fn identified<'p>(
    requests: &mut Requests<'_>,
    devices: &'p [DevicePlan],
) -> Result<Vec<Known<'p>>, BusError> {
    let found = enumerate(requests, false)?.len();
    let wanted = devices.len();
    if found != wanted {
        return Err(BusError::Count { found, wanted });
    }
    let each = (0u16..).zip(devices).map(|(index, plan)| {
        let station = Station::new(&plan.name, FIRST_STATION + index);
        requests.await_state(&station, AlState::Init)?;
        let sii = requests.sii(&station)?;
        identify(usize::from(index) + 1, plan, &sii)?;
        Ok(Known { plan, station, sii })
    });
    each.collect()
}

/// Gives a device its mailbox, if it has one.
fn open_mailbox(
    requests: &mut Requests<'_>,
    station: &mut Station,
    sii: &Sii,
) -> Result<(), BusError> {
    let mailboxes = [sii.receive, sii.send];
    if mailboxes.iter().any(|(_, length)| *length == 0) {
        return Ok(());
    }
    for (index, ((start, length), control)) in (0u16..).zip(mailboxes.into_iter().zip([0x26, 0x22]))
    {
        let manager = Manager {
            start,
            length,
            control,
            kind: 0,
        };
        set_manager(requests, station, index, manager)?;
    }
    // Without CoE the mailbox is still needed for PRE-OP.
    station.mailbox = sii.coe.then_some(mailboxes);
    Ok(())
}

fn set_manager(
    requests: &mut Requests<'_>,
    station: &Station,
    index: u16,
    manager: Manager,
) -> Result<(), BusError> {
    let [s0, s1] = manager.start.to_le_bytes();
    let [l0, l1] = manager.length.to_le_bytes();
    let enabled = u8::from(manager.length > 0);
    let register = reg::SYNC_MANAGER + index * reg::SYNC_MANAGER_SIZE;
    let bytes = [s0, s1, l0, l1, manager.control, 0, enabled, 0];
    requests.write(station, register, &bytes)
}

/// Lists the devices of a line, and what they map. Writes no process data; the devices are left in INIT. `releases`: also devices that
/// are in operation, whose outputs may then end.
///
/// # Errors
/// No device answers, or the line is down.
pub fn scan(line: &mut dyn Line, source: [u8; 6], releases: bool) -> Result<Vec<Found>, BusError> {
    let mut requests = Requests::new(line, source);
    let states = enumerate(&mut requests, releases)?;
    let mut all = Vec::with_capacity(states.len());
    for (index, state) in (0u16..).zip(states) {
        let mut station = Station::new(&format!("{}", index + 1), FIRST_STATION + index);
        let mut found = Found {
            name: String::new(),
            identity: [0; 3],
            state,
            outputs: Vec::new(),
            inputs: Vec::new(),
            remark: None,
        };
        if let Err(error) = describe(&mut requests, &mut station, &mut found) {
            found.remark = Some(error.to_string());
        }
        all.push(found);
    }
    requests.all_to_init()?;
    Ok(all)
}

fn describe(
    requests: &mut Requests<'_>,
    station: &mut Station,
    found: &mut Found,
) -> Result<(), BusError> {
    requests.await_state(station, AlState::Init)?;
    let sii = requests.sii(station)?;
    found.name.clone_from(&sii.name);
    found.identity = [sii.vendor, sii.code, sii.revision];
    open_mailbox(requests, station, &sii)?;
    if station.mailbox.is_none() {
        return Ok(());
    }
    requests.request_state(station, AlState::PreOp)?;
    requests.await_state(station, AlState::PreOp)?;
    found.outputs = mapped(requests, station, OUTPUTS)?;
    found.inputs = mapped(requests, station, INPUTS)?;
    Ok(())
}

fn set_up(
    requests: &mut Requests<'_>,
    station: &mut Station,
    writes: &[SetupWrite],
) -> Result<(), BusError> {
    for SetupWrite { entry, value } in writes {
        let mut bytes = [0; 8];
        entry.kind.write(*value, &mut bytes);
        let object = Object {
            index: entry.index,
            sub: entry.sub,
        };
        let bytes = bytes.get(..entry.kind.bytes()).unwrap_or_default();
        requests.download(station, object, bytes)?;
    }
    Ok(())
}

/// Brings the devices of `plan` to SAFE-OP. `source` is the sender of our frames.
///
/// # Errors
/// [`BusError`]: the bus cannot take part. Nothing moved.
pub fn bring_up(
    mut line: Box<dyn Line>,
    plan: BusPlan,
    source: [u8; 6],
) -> Result<Box<Bus>, BusError> {
    let mut requests = Requests::new(line.as_mut(), source);
    requests.patience_ns = plan.patience_ns;
    let mut known = identified(&mut requests, &plan.devices)?;
    for device in &mut known {
        open_mailbox(&mut requests, &mut device.station, &device.sii)?;
    }
    to_state(&mut requests, &known, AlState::PreOp)?;
    for device in &mut known {
        let Known {
            plan: own, station, ..
        } = device;
        if station.mailbox.is_some() {
            set_up(&mut requests, station, &own.setup)?;
            map(&mut requests, station, OUTPUTS, (&own.outputs, own.assign))?;
            map(&mut requests, station, INPUTS, (&own.inputs, own.assign))?;
        } else if let Some(first) = own.setup.first() {
            let entry = &first.entry;
            return Err(BusError::Object {
                device: own.name.clone(),
                index: entry.index,
                sub: entry.sub,
                abort: None,
                why: "it has no mailbox, so that nothing can be set: remove `setup`".to_owned(),
            });
        }
        if let Some(drive) = &own.drive {
            prepare_drive(&mut requests, station, drive, plan.period_ns)?;
        }
    }
    let members = process_data(&mut requests, &known, &plan)?;
    let reference = match plan.time {
        TimeSource::Bus => Some(clocks::start(&mut requests, &known, plan.period_ns)?),
        TimeSource::Loop => None,
    };
    to_state(&mut requests, &known, AlState::SafeOp)?;
    for device in &mut known {
        if device.plan.drive.is_some() {
            check_drive(&mut requests, device)?;
        }
    }
    let simulated = known
        .iter()
        .all(|device| device.sii.name.starts_with(SIMULATED));
    let mut keeps_state = simulated;
    for device in &known {
        keeps_state = keeps_state && requests.read(&device.station, reg::USER_MEMORY)? == [1];
    }
    let found = (members, reference, simulated, keeps_state);
    Bus::new(line, plan, source, found).map(Box::new)
}

fn identify(position: usize, device: &DevicePlan, sii: &Sii) -> Result<(), BusError> {
    let is_it = (sii.vendor, sii.code) == (device.vendor, device.code)
        && device.revision.is_none_or(|wanted| wanted == sii.revision);
    if is_it {
        return Ok(());
    }
    Err(BusError::Identity {
        position,
        name: device.name.clone(),
        found: [sii.vendor, sii.code, sii.revision],
        wanted: (device.vendor, device.code, device.revision),
    })
}

fn to_state(
    requests: &mut Requests<'_>,
    known: &[Known<'_>],
    wanted: AlState,
) -> Result<(), BusError> {
    for device in known {
        requests.request_state(&device.station, wanted)?;
    }
    for device in known {
        requests.await_state(&device.station, wanted)?;
    }
    Ok(())
}

/// Sets the sync managers, the memory units and the watchdogs of the process data: outputs of all devices first, then inputs.
fn process_data(
    requests: &mut Requests<'_>,
    known: &[Known<'_>],
    plan: &BusPlan,
) -> Result<Vec<Member>, BusError> {
    let outputs: usize = known.iter().map(|one| length(&one.plan.outputs)).sum();
    let (mut output, mut input) = (0, outputs);
    let mut members = Vec::with_capacity(known.len());
    for Known {
        plan: own,
        station,
        sii,
    } in known
    {
        let member = Member {
            name: own.name.clone(),
            station: station.address,
            outputs: output..output + length(&own.outputs),
            inputs: input..input + length(&own.inputs),
        };
        (output, input) = (member.outputs.end, member.inputs.end);
        let each = [(OUTPUTS, &member.outputs, 2u8), (INPUTS, &member.inputs, 1)];
        for (unit, (direction, range, kind)) in (0u16..).zip(each) {
            let bytes = range.len() as u16;
            let found = manager(sii, station, direction, bytes);
            let own_bytes = found.map_or(0, |(_, _, bytes)| bytes);
            // A device without objects says its length in its EEPROM only.
            let differs = station.mailbox.is_none() && own_bytes > 0 && own_bytes != bytes;
            let (index, manager) = match found {
                Some((index, manager, _)) if !differs => (index, manager),
                None if bytes == 0 => continue,
                _ => {
                    return Err(BusError::Mapping {
                        device: own.name.clone(),
                        direction: direction.key,
                        found: format!("{own_bytes} bytes"),
                        wanted: format!("{bytes} bytes"),
                    });
                }
            };
            set_manager(requests, station, index, manager)?;
            if bytes > 0 {
                let mut fmmu = [0u8; 16];
                let logical = range.start as u32;
                for (to, from) in fmmu.iter_mut().zip(logical.to_le_bytes()) {
                    *to = from;
                }
                let [l0, l1] = bytes.to_le_bytes();
                let [s0, s1] = manager.start.to_le_bytes();
                let rest = [l0, l1, 0, 7, s0, s1, 0, kind, 1];
                for (to, from) in fmmu.iter_mut().skip(4).zip(rest) {
                    *to = from;
                }
                requests.write(station, reg::FMMU + unit * reg::FMMU_SIZE, &fmmu)?;
            }
        }
        if !member.outputs.is_empty() {
            set_watchdog(requests, station, plan.watchdog_ns)?;
        }
        members.push(member);
    }
    Ok(members)
}

/// The sync manager of a direction, with its number, and the length that the EEPROM gives it.
fn manager(
    sii: &Sii,
    station: &Station,
    direction: Direction,
    length: u16,
) -> Option<(u16, Manager, u16)> {
    let mut all = (0u16..).zip(&sii.managers);
    let known = all.find(|(_, manager)| manager.kind == direction.kind);
    let usual = || {
        let index = direction.manager;
        let found = sii.managers.get(usize::from(index))?;
        (found.kind == 0 && station.mailbox.is_some()).then_some((index, found))
    };
    let (index, found) = known.or_else(usual)?;
    let control = match (found.control, direction.kind) {
        (0, _) => direction.control,
        // Outputs always trigger the watchdog.
        (control, OUTPUT_KIND) => control | WATCHED,
        (control, _) => control,
    };
    let manager = Manager {
        length,
        control,
        ..*found
    };
    Some((index, manager, found.length))
}

/// Sets the watchdog of the process data, and reads it back.
fn set_watchdog(
    requests: &mut Requests<'_>,
    station: &Station,
    watchdog_ns: u64,
) -> Result<(), BusError> {
    let mut units = WATCHDOG_UNITS.into_iter().filter_map(|(unit, divider)| {
        let units = u16::try_from(watchdog_ns.div_ceil(unit)).ok()?;
        Some((units, divider))
    });
    let (units, wanted) = units.next().unwrap_or((u16::MAX, WATCHDOG_UNITS[1].1));
    requests.write(station, reg::WATCHDOG_DIVIDER, &wanted.to_le_bytes())?;
    requests.write(station, reg::WATCHDOG_DATA, &units.to_le_bytes())?;
    let divider = u16::from_le_bytes(requests.read(station, reg::WATCHDOG_DIVIDER)?);
    let found = u16::from_le_bytes(requests.read(station, reg::WATCHDOG_DATA)?);
    let micros = |divider: u16, units: u16| (u64::from(divider) + 2) * 40 * u64::from(units) / 1000;
    let (found_us, wanted_us) = (micros(divider, found), micros(wanted, units));
    if found_us == wanted_us && found_us > 0 {
        return Ok(());
    }
    Err(BusError::Watchdog {
        device: station.name.clone(),
        found_us,
        wanted_us,
    })
}

/// Resets the faults of all drives of the plan, as an operator asks: nothing gets torque by it. The names of those that had one.
///
/// # Errors
/// The bus cannot take part.
pub fn reset_faults(
    line: &mut dyn Line,
    plan: &BusPlan,
    source: [u8; 6],
) -> Result<Vec<String>, BusError> {
    let mut requests = Requests::new(line, source);
    let mut reset = Vec::new();
    for mut known in identified(&mut requests, &plan.devices)? {
        let (device, station) = (known.plan, &mut known.station);
        if device.drive.is_none() {
            continue;
        }
        open_mailbox(&mut requests, station, &known.sii)?;
        requests.request_state(station, AlState::PreOp)?;
        requests.await_state(station, AlState::PreOp)?;
        let object = |index| Object { index, sub: 0 };
        let status = requests.upload_exact(station, object(drive::STATUSWORD))?;
        if drive::DriveState::of(u16::from_le_bytes(status)).is_fault() {
            for word in [
                drive::DISABLE_VOLTAGE,
                drive::FAULT_RESET,
                drive::DISABLE_VOLTAGE,
            ] {
                requests.download(station, object(drive::CONTROLWORD), &word.to_le_bytes())?;
            }
            let status = requests.upload_exact(station, object(drive::STATUSWORD))?;
            if drive::DriveState::of(u16::from_le_bytes(status)).is_fault() {
                let code = requests.upload_exact(station, object(drive::ERROR_CODE))?;
                let code = u16::from_le_bytes(code);
                return Err(BusError::Drive {
                    device: device.name.clone(),
                    why: format!("its fault {code:#06x} stands: remove its cause first"),
                });
            }
            reset.push(device.name.clone());
        }
    }
    requests.all_to_init()?;
    Ok(reset)
}
