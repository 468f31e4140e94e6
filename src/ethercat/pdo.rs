//! The process data of a device: what it maps, compared with the test file or written to the device (ETG.1000.6, PDO mapping).

use crate::error::BusError;
use crate::request::{Requests, Station};
use crate::wire::coe::{NO_OBJECT, Object};
use gusset_wire::process_data::Entry;

/// Control bytes of a sync manager that the EEPROM does not give.
const OUTPUT_CONTROL: u8 = 0x64;
const INPUT_CONTROL: u8 = 0x20;
/// Kind of a sync manager of outputs in the EEPROM.
pub(crate) const OUTPUT_KIND: u8 = 3;

/// One direction of the process data.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Direction {
    /// Its key in the test file.
    pub key: &'static str,
    /// Object with the list of its PDOs, and the first of them.
    assignment: u16,
    pdo: u16,
    /// Sync manager of a device with a mailbox, its kind in the EEPROM and its control byte.
    pub manager: u16,
    pub kind: u8,
    pub control: u8,
}

pub(crate) const OUTPUTS: Direction = Direction {
    key: "outputs",
    assignment: 0x1c12,
    pdo: 0x1600,
    manager: 2,
    kind: OUTPUT_KIND,
    control: OUTPUT_CONTROL,
};

pub(crate) const INPUTS: Direction = Direction {
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
pub(crate) fn mapped(
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
pub(crate) fn map(
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
}
