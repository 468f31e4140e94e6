//! Distributed clocks (ETG.1000.4, DC): propagation delays, offsets, SYNC0.

use crate::error::BusError;
use crate::request::{Known, Requests};
use crate::wire::datagram::{Service, at};
use crate::wire::register as reg;

/// Readings by which the clocks of the devices lock to the reference before SYNC0 starts.
const SETTLING: u32 = 500;
/// From now to the first SYNC0, and its place in the tick.
const START_NS: u64 = 300_000_000;
const SYNC_SHARE: (u64, u64) = (3, 10);
/// Value that resets the filters of a clock.
const FILTER: [u8; 2] = [0x00, 0x10];
/// Ports in the order in which a frame passes them.
const ORDER: [usize; 4] = [0, 3, 1, 2];

/// When a frame passed the ports of a device.
#[derive(Debug, Clone)]
struct Times {
    /// Arrival at the open ports, in the order of the frame.
    arrivals: Vec<u32>,
    has_clock: bool,
    /// Ports behind the first to which a device is still to be joined, as an index of `arrivals`.
    next: usize,
    /// Nearest device before it that has a clock, and the port by which it is reached, as an index of its `arrivals`.
    anchor: Option<(usize, usize)>,
    /// From the reference to its first port in ns.
    delay: u32,
}

/// Starts the clocks; the station address of the reference, whose time is that of the bus.
///
/// # Errors
/// No device has a clock, or one is silent.
pub(crate) fn start(
    requests: &mut Requests<'_>,
    known: &[Known<'_>],
    period_ns: u64,
) -> Result<u16, BusError> {
    requests.write_all(reg::DC_RECEIVE, &[0; 4])?;
    let mut times: Vec<Times> = Vec::with_capacity(known.len());
    let mut reference: Option<(u16, u64)> = None;
    for Known { station, .. } in known {
        let features = u16::from_le_bytes(requests.read(station, reg::FEATURES)?);
        let status = u16::from_le_bytes(requests.read(station, reg::DL_STATUS)?);
        let has_clock = features & reg::HAS_CLOCK != 0;
        // A device without a clock may have no such registers.
        let ports: [u8; 16] = match has_clock {
            true => requests.read(station, reg::DC_RECEIVE)?,
            false => [0; 16],
        };
        let one = joined(&mut times, arrivals(&ports, status), has_clock);
        let delay = one.delay;
        times.push(one);
        if !has_clock {
            continue;
        }
        let local = u64::from_le_bytes(requests.read(station, reg::DC_LOCAL_RECEIVE)?);
        // The loop follows a clock of 64 bits: a shorter one starts again every 4 s.
        if reference.is_none() && features & reg::HAS_LONG_CLOCK == 0 {
            continue;
        }
        let (_, first) = *reference.get_or_insert((station.address, local));
        // All clocks show that of the reference at the moment when the frame passed.
        let offset = first.wrapping_add(delay.into()).wrapping_sub(local);
        requests.write(station, reg::DC_OFFSET, &offset.to_le_bytes())?;
        requests.write(station, reg::DC_DELAY, &delay.to_le_bytes())?;
        requests.write(station, reg::DC_SPEED_START, &FILTER)?;
    }
    let (reference, _) = reference.ok_or(BusError::NoClock)?;
    let address = at(reference, reg::DC_TIME);
    let mut now = [0; 8];
    for _ in 0..SETTLING {
        now = [0; 8];
        requests.ask(Service::Frmw, address, &mut now)?;
    }
    let (part, whole) = SYNC_SHARE;
    let edge = u64::from_le_bytes(now)
        .wrapping_add(START_NS)
        .next_multiple_of(period_ns);
    let first = edge.wrapping_add(period_ns * part / whole);
    for Known { plan, station, .. } in known.iter().filter(|one| one.plan.drive.is_some()) {
        let features = u16::from_le_bytes(requests.read(station, reg::FEATURES)?);
        if features & reg::HAS_CLOCK == 0 {
            return Err(BusError::Drive {
                device: plan.name.clone(),
                why: "it has no distributed clock: use `clock = \"free\"`".to_owned(),
            });
        }
        let cycle = u32::try_from(period_ns).unwrap_or(u32::MAX);
        requests.write(station, reg::DC_ACTIVATION, &[0, 0])?;
        requests.write(station, reg::DC_START, &first.to_le_bytes())?;
        requests.write(station, reg::DC_CYCLE, &cycle.to_le_bytes())?;
        // The master writes it; the cyclic unit and SYNC0 are on.
        requests.write(station, reg::DC_ACTIVATION, &[0, 3])?;
    }
    Ok(reference)
}

/// Arrivals at the open ports in the order of the frame. Bits 9, 11, 13 and 15 of the DL status say which ports communicate.
fn arrivals(ports: &[u8; 16], status: u16) -> Vec<u32> {
    let open = |port: &usize| status & 1 << (9 + 2 * port) != 0;
    let time = |port: usize| {
        let four = ports.get(4 * port..).and_then(|rest| rest.first_chunk());
        four.map_or(0, |four| u32::from_le_bytes(*four))
    };
    ORDER.into_iter().filter(open).map(time).collect()
}

/// Joins a device to the latest one before it that has an open port left, and finds its delay.
fn joined(before: &mut [Times], arrivals: Vec<u32>, has_clock: bool) -> Times {
    let mut one = Times {
        arrivals,
        has_clock,
        next: 1,
        anchor: None,
        delay: 0,
    };
    let has_room = |(_, device): &(usize, &mut Times)| device.next < device.arrivals.len();
    let Some((index, parent)) = before.iter_mut().enumerate().rev().find(has_room) else {
        return one;
    };
    one.anchor = match parent.has_clock {
        true => Some((index, parent.next)),
        false => parent.anchor,
    };
    parent.next += 1;
    let Some((parent, port)) = one.anchor.filter(|_| has_clock) else {
        return one;
    };
    let Some(parent) = before.get(parent) else {
        return one;
    };
    let at = |index: usize| parent.arrivals.get(index).copied().unwrap_or_default();
    // The frame left the parent when it arrived at the port before, and came back at this one. Devices without a clock between the
    // two count as cable.
    let (left, back) = (at(port.saturating_sub(1)), at(port));
    let branch = back.wrapping_sub(left);
    let first = one.arrivals.first().copied().unwrap_or_default();
    let last = one.arrivals.last().copied().unwrap_or_default();
    let way = branch.wrapping_sub(last.wrapping_sub(first)) / 2;
    let since = left.wrapping_sub(at(0));
    one.delay = parent.delay.wrapping_add(since).wrapping_add(way);
    one
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device whose arrivals are all zero has no clock.
    fn delays(devices: &[&[u32]]) -> Vec<u32> {
        let mut all: Vec<Times> = Vec::new();
        for arrivals in devices {
            let has_clock = arrivals.iter().any(|at| *at != 0);
            let one = joined(&mut all, arrivals.to_vec(), has_clock);
            all.push(one);
        }
        all.iter().map(|one| one.delay).collect()
    }

    #[test]
    fn delays_of_a_line_are_found() {
        // Cables of 300 and 500 ns; every clock has its own origin.
        assert_eq!(delays(&[&[1000, 2600], &[50, 1050], &[7]]), [0, 300, 800]);
    }

    #[test]
    fn delays_of_a_branch_are_found() {
        // A junction whose second port has a device at 400 ns, and its third one at 100 ns.
        let found = delays(&[&[0, 800, 1000], &[10], &[20]]);
        assert_eq!(found, [0, 400, 900]);
    }

    #[test]
    fn a_device_without_a_clock_is_cable() {
        // 300 ns to the first terminal, 200 ns on to the second, which has no clock, and 400 ns on to the last.
        let found = delays(&[&[1000, 2800], &[50, 1250], &[0, 0], &[7]]);
        assert_eq!(found, [0, 300, 0, 900]);
        assert_eq!(delays(&[&[0, 0], &[5, 905], &[7]]), [0, 0, 450]);
    }

    #[test]
    fn closed_ports_have_no_arrival() {
        let mut ports = [0; 16];
        ports[4] = 9;
        ports[8] = 7;
        assert_eq!(arrivals(&ports, 0x5a30), [0, 9]);
        assert_eq!(arrivals(&ports, 0x5630), [0]);
    }
}
