//! From a line with devices to process data in SAFE-OP. Nothing moves: outputs are off until OP.
//!
//! The order is that of ETG.1000: count, station addresses, EEPROM, mailboxes, PRE-OP, objects, process data, clocks, SAFE-OP. Every
//! refusal names the device and what it says.

use crate::clocks;
use crate::cycle::{Bus, Member};
use crate::error::BusError;
use crate::line::Line;
use crate::plan::{BusPlan, DevicePlan, DrivePlan, TimeSource};
use crate::request::{Known, Requests, Station};
use crate::wire::coe::{NO_OBJECT, Object};
use crate::wire::datagram::{Service, at, position};
use crate::wire::drive;
use crate::wire::register as reg;
use crate::wire::register::AlState;
use crate::wire::sii::{Manager, Sii};
use gusset_wire::process_data::{Entry, SetupWrite, length};

/// Station address of the first device.
const FIRST_STATION: u16 = 0x1001;
/// Control bytes of a sync manager that the EEPROM does not give.
const OUTPUT_CONTROL: u8 = 0x64;
const INPUT_CONTROL: u8 = 0x20;
/// Bit of the control byte by which a sync manager triggers the watchdog, and the kind of a sync manager of outputs.
const WATCHED: u8 = 0x40;
const OUTPUT_KIND: u8 = 3;
/// Units of the watchdog in ns, each with its divider in units of 40 ns, less two. The first that can express the time is taken.
const WATCHDOG_UNITS: [(u64, u16); 2] = [(100_000, 2498), (1_000_000, 24_998)];
/// First word of the text by which a simulated device tells itself apart.
pub(crate) const SIMULATED: &str = "simulated ";
/// First quick-stop option (605A) after which the drive keeps its torque.
const KEEPS_TORQUE: i16 = 5;

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

/// One direction of the process data.
#[derive(Debug, Clone, Copy)]
struct Direction {
    /// Its key in the test file.
    key: &'static str,
    /// Object with the list of its PDOs, and the first of them.
    assignment: u16,
    pdo: u16,
    /// Sync manager of a device with a mailbox, its kind in the EEPROM and its control byte.
    manager: u16,
    kind: u8,
    control: u8,
}

const OUTPUTS: Direction = Direction {
    key: "outputs",
    assignment: 0x1c12,
    pdo: 0x1600,
    manager: 2,
    kind: OUTPUT_KIND,
    control: OUTPUT_CONTROL,
};

const INPUTS: Direction = Direction {
    key: "inputs",
    assignment: 0x1c13,
    pdo: 0x1a00,
    manager: 3,
    kind: 4,
    control: INPUT_CONTROL,
};

/// The entries that a device maps in this direction: its objects and their lengths in bits.
fn mapping(
    requests: &mut Requests<'_>,
    station: &mut Station,
    direction: Direction,
) -> Result<Vec<(Object, u8)>, BusError> {
    let mut all = Vec::new();
    let object = |index, sub| Object { index, sub };
    let pdos = match requests.upload_exact(station, object(direction.assignment, 0)) {
        Ok([pdos]) => pdos,
        // A device that maps nothing in this direction may leave the object out.
        Err(BusError::Object {
            abort: Some(NO_OBJECT),
            ..
        }) => 0,
        Err(error) => return Err(error),
    };
    for number in 1..=pdos {
        let pdo = requests.upload_exact(station, object(direction.assignment, number))?;
        let pdo = u16::from_le_bytes(pdo);
        let [entries] = requests.upload_exact(station, object(pdo, 0))?;
        for entry in 1..=entries {
            let [bits, sub, low, high] = requests.upload_exact(station, object(pdo, entry))?;
            all.push((object(u16::from_le_bytes([low, high]), sub), bits));
        }
    }
    Ok(all)
}

/// The mapping as entries of the test file. The dictionary does not tell signed from unsigned: a signed integer is assumed where the
/// object is no word of flags.
fn mapped(
    requests: &mut Requests<'_>,
    station: &mut Station,
    direction: Direction,
) -> Result<Vec<Entry>, BusError> {
    let entries = in_bytes(&mapping(requests, station, direction)?);
    let text = |(object, bits): &(Object, u32)| {
        let kind = match bits {
            8 => "u8",
            16 if object.sub > 1 => "i16",
            16 => "u16",
            32 => "i32",
            64 => "f64",
            _ => return Err((*object, *bits)),
        };
        let text = format!("{:04x}:{:02x} {kind}", object.index, object.sub);
        text.parse().map_err(|_| (*object, *bits))
    };
    let all: Result<Vec<Entry>, _> = entries.iter().map(text).collect();
    all.map_err(|(object, bits)| BusError::Object {
        device: station.name.clone(),
        index: object.index,
        sub: object.sub,
        abort: None,
        why: format!("it maps {bits} bits; 8, 16, 32 and 64 are supported"),
    })
}

/// Puts single bits together: bits that follow each other are one entry, named by the first of them.
fn in_bytes(entries: &[(Object, u8)]) -> Vec<(Object, u32)> {
    let mut all: Vec<(Object, u32)> = Vec::new();
    let mut is_open = false;
    for (object, bits) in entries {
        let is_whole = bits % 8 == 0;
        match all.last_mut() {
            Some((_, sum)) if is_open && (sum.wrapping_rem(8) != 0 || !is_whole) => {
                *sum += u32::from(*bits);
            }
            _ => all.push((*object, u32::from(*bits))),
        }
        is_open = is_open && all.last().is_some_and(|(_, sum)| sum % 8 != 0) || !is_whole;
    }
    all
}

/// True if the entries of the test file cover those of the device: each begins where the device has the object, and ends with an
/// entry of the device. An entry may cover several, for instance the single bits of a state.
fn covers(wanted: &[Entry], found: &[(Object, u8)]) -> bool {
    let mut rest = found.iter();
    let each = wanted.iter().all(|entry| {
        let Some((first, bits)) = rest.next() else {
            return false;
        };
        let mut missing = 8 * entry.kind.bytes() as i64 - i64::from(*bits);
        while missing > 0 {
            let Some((_, bits)) = rest.next() else {
                return false;
            };
            missing -= i64::from(*bits);
        }
        missing == 0 && (first.index, first.sub) == (entry.index, entry.sub)
    });
    each && rest.next().is_none()
}

/// Compares the mapping with the test file, or writes it.
fn map(
    requests: &mut Requests<'_>,
    station: &mut Station,
    direction: Direction,
    (entries, assign): (&[Entry], bool),
) -> Result<(), BusError> {
    if assign {
        return assign_mapping(requests, station, direction, entries);
    }
    let found = mapping(requests, station, direction)?;
    if covers(entries, &found) {
        return Ok(());
    }
    let wanted = entries.iter().map(|entry| {
        let object = Object {
            index: entry.index,
            sub: entry.sub,
        };
        (object, 8 * entry.kind.bytes() as u8)
    });
    let wanted: Vec<(Object, u8)> = wanted.collect();
    let in_words = |entries: &[(Object, u8)]| {
        let each = entries.iter().map(|(object, bits)| {
            format!("{:04x}:{:02x} of {bits} bits", object.index, object.sub)
        });
        let all: Vec<String> = each.collect();
        if all.is_empty() {
            "none".to_owned()
        } else {
            all.join(", ")
        }
    };
    Err(BusError::Mapping {
        device: station.name.clone(),
        direction: direction.key,
        found: in_words(&found),
        wanted: in_words(&wanted),
    })
}

fn assign_mapping(
    requests: &mut Requests<'_>,
    station: &mut Station,
    direction: Direction,
    entries: &[Entry],
) -> Result<(), BusError> {
    let object = |index, sub| Object { index, sub };
    let Direction {
        assignment, pdo, ..
    } = direction;
    let count = u8::try_from(entries.len()).unwrap_or(u8::MAX);
    match requests.download(station, object(assignment, 0), &[0]) {
        Err(BusError::Object {
            abort: Some(NO_OBJECT),
            ..
        }) if count == 0 => return Ok(()),
        outcome => outcome?,
    }
    if count == 0 {
        return Ok(());
    }
    requests.download(station, object(pdo, 0), &[0])?;
    for (number, entry) in (1u8..).zip(entries) {
        let [low, high] = entry.index.to_le_bytes();
        let word = [8 * entry.kind.bytes() as u8, entry.sub, low, high];
        requests.download(station, object(pdo, number), &word)?;
    }
    requests.download(station, object(pdo, 0), &[count])?;
    requests.download(station, object(assignment, 1), &pdo.to_le_bytes())?;
    requests.download(station, object(assignment, 0), &[1])
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

/// Checks and sets what a drive needs before it may have torque.
fn prepare_drive(
    requests: &mut Requests<'_>,
    station: &mut Station,
    plan: &DrivePlan,
    period_ns: u64,
) -> Result<(), BusError> {
    let object = |index, sub| Object { index, sub };
    let refuse = |why: String| BusError::Drive {
        device: station.name.clone(),
        why,
    };
    let (units, exponent) = interpolation_time(period_ns).ok_or_else(|| {
        let why = format!("60C2 cannot express a tick of {period_ns} ns: choose another rate");
        refuse(why)
    })?;
    let option: [u8; 2] = requests.upload_exact(station, object(drive::QUICK_STOP_OPTION, 0))?;
    let option = i16::from_le_bytes(option);
    if option < KEEPS_TORQUE && !plan.accepts_free_stop {
        let why = format!(
            "its quick-stop option 605A is {option}: the axis would have no torque afterwards. Set 5, 6 or 7, or accept it with \
             `accept = \"torque off at quick stop\"`"
        );
        return Err(BusError::Drive {
            device: station.name.clone(),
            why,
        });
    }
    if let Some(most) = plan.following_counts {
        let window = requests.upload_exact(station, object(drive::FOLLOWING_WINDOW, 0))?;
        let window = u32::from_le_bytes(window);
        if f64::from(window) > most {
            let why = format!(
                "its window of the following error 6065 is {window} counts, but the trip level of `following_error_m` is {most:.0}: \
                 the drive would not notice first. Set a smaller window"
            );
            return Err(BusError::Drive {
                device: station.name.clone(),
                why,
            });
        }
    }
    requests.download(station, object(drive::INTERPOLATION_TIME, 1), &[units])?;
    requests.download(
        station,
        object(drive::INTERPOLATION_TIME, 2),
        &[exponent as u8],
    )?;
    let [kept] = requests.upload_exact(station, object(drive::INTERPOLATION_TIME, 1))?;
    let [power] = requests.upload_exact(station, object(drive::INTERPOLATION_TIME, 2))?;
    if (kept, power as i8) != (units, exponent) {
        let power = power as i8;
        let why = format!(
            "its interpolation time 60C2 is {kept}·10^{power} s, but {units}·10^{exponent} s was written"
        );
        return Err(BusError::Drive {
            device: station.name.clone(),
            why,
        });
    }
    let mode = drive::CYCLIC_POSITION as u8;
    requests.download(station, object(drive::MODE, 0), &[mode])
}

/// A period as a number of units of 10^exponent s: the largest unit that divides it.
fn interpolation_time(period_ns: u64) -> Option<(u8, i8)> {
    (-9..=-1).rev().find_map(|exponent: i8| {
        let unit = 10u64.checked_pow(u32::try_from(9 + exponent).ok()?)?;
        let units = u8::try_from(period_ns / unit).ok()?;
        (period_ns.is_multiple_of(unit) && units > 0).then_some((units, exponent))
    })
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
    Bus::new(line, plan, source, (members, reference, simulated)).map(Box::new)
}

/// A drive in SAFE-OP has no fault, and the mode that was written. A mode in the process data is written in OP only.
fn check_drive(requests: &mut Requests<'_>, device: &mut Known<'_>) -> Result<(), BusError> {
    let station = &mut device.station;
    let object = |index| Object { index, sub: 0 };
    let status = requests.upload_exact(station, object(drive::STATUSWORD))?;
    if drive::DriveState::of(u16::from_le_bytes(status)).is_fault() {
        let code = requests.upload_exact(station, object(drive::ERROR_CODE))?;
        let code = u16::from_le_bytes(code);
        return Err(BusError::Drive {
            device: station.name.clone(),
            why: format!(
                "it has the fault {code:#06x} (603F): remove its cause, then `gusset bus reset`"
            ),
        });
    }
    let is_mapped = |entry: &Entry| entry.index == drive::MODE;
    if device.plan.outputs.iter().any(is_mapped) {
        return Ok(());
    }
    let [found] = requests.upload_exact(station, object(drive::MODE_DISPLAY))?;
    if found as i8 == drive::CYCLIC_POSITION {
        return Ok(());
    }
    Err(BusError::Drive {
        device: station.name.clone(),
        why: format!(
            "its mode 6061 is {}, but 8 (cyclic synchronous position) was written to 6060",
            found as i8
        ),
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A terminal of two channels: a state of single bits and a gap, then a value.
    fn terminal() -> Vec<(Object, u8)> {
        let object = |index, sub| Object { index, sub };
        let bits = [
            (1, 1),
            (2, 1),
            (3, 2),
            (5, 2),
            (7, 1),
            (0, 7),
            (15, 1),
            (16, 1),
        ];
        let mut all = Vec::new();
        for channel in [0x6000, 0x6010] {
            all.extend(bits.map(|(sub, bits)| (object(channel, sub), bits)));
            all.push((object(channel, 0x11), 16));
        }
        all
    }

    #[test]
    fn single_bits_are_one_entry() {
        let entries = |texts: &[&str]| -> Vec<Entry> {
            texts.iter().map(|text| text.parse().unwrap()).collect()
        };
        let words = [
            "6000:01 u16 state",
            "6000:11 i16",
            "6010:01 u16",
            "6010:11 i16",
        ];
        assert!(covers(&entries(&words), &terminal()));
        for (at, other) in [
            (0, "6000:01 u8"),
            (0, "6000:02 u16"),
            (1, "6000:11 i32"),
            (3, "6010:12 i16"),
        ] {
            let mut words = words;
            words[at] = other;
            assert!(!covers(&entries(&words), &terminal()), "{other}");
        }
        assert!(!covers(&entries(&words[..3]), &terminal()));
        assert!(!covers(&entries(&words), &terminal()[..17]));
        let sizes = in_bytes(&terminal());
        let sizes: Vec<_> = sizes.iter().map(|(o, bits)| (o.sub, *bits)).collect();
        assert_eq!(sizes, [(1, 16), (0x11, 16), (1, 16), (0x11, 16)]);
    }

    #[test]
    fn a_period_becomes_an_interpolation_time() {
        for (period_ns, wanted) in [
            (1_000_000, Some((1, -3))),
            (2_000_000, Some((2, -3))),
            (500_000, Some((5, -4))),
            (250_000, Some((25, -5))),
            (976_562, None),
        ] {
            assert_eq!(interpolation_time(period_ns), wanted, "{period_ns}");
        }
    }
}
