//! The EEPROM of a device (ETG.1000.6, slave information interface): words with its identity, its mailboxes and categories.

use gusset_wire::process_data::Entry;

/// Words of the fixed part.
const VENDOR: u16 = 0x08;
const CODE: u16 = 0x0a;
const REVISION: u16 = 0x0c;
const SERIAL: u16 = 0x0e;
const RECEIVE_MAILBOX: u16 = 0x18;
const SEND_MAILBOX: u16 = 0x1a;
const PROTOCOLS: u16 = 0x1c;
/// First word of the categories.
const CATEGORIES: u16 = 0x40;
/// Protocol bit of CANopen over EtherCAT.
const COE: u16 = 1 << 2;
/// Categories.
const STRINGS: u16 = 10;
const END: u16 = 0xffff;
/// Most words of all categories that are read: a faulty EEPROM has no end.
const MOST_WORDS: u16 = 0x1000;

/// The facts that a master needs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Sii {
    /// Vendor, product code, revision and serial number.
    pub vendor: u32,
    pub code: u32,
    pub revision: u32,
    pub serial: u32,
    /// Start and length of the mailbox that it receives from, and of the one that it sends by.
    pub receive: (u16, u16),
    pub send: (u16, u16),
    /// It speaks CANopen over EtherCAT.
    pub coe: bool,
    /// Its first string: usually its order number.
    pub name: String,
    /// Its sync managers, in order.
    pub managers: Vec<Manager>,
}

/// A sync manager: a window into the memory of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Manager {
    /// First address, and length in bytes.
    pub start: u16,
    pub length: u16,
    /// Control byte: direction, buffers, watchdog.
    pub control: u8,
    /// 1 and 2: the mailboxes; 3: outputs; 4: inputs; 0: the EEPROM does not say.
    pub kind: u8,
}

/// Bytes of a sync manager in the EEPROM.
const MANAGER_SIZE: usize = 8;
/// Most sync managers of a device.
const MOST_MANAGERS: usize = 8;

impl Sii {
    /// Reads an EEPROM through `word`, which reads the two words at an address. None if a read fails.
    pub(crate) fn read(mut word: impl FnMut(u16) -> Option<u32>) -> Option<Self> {
        let pair = |value: u32| (value as u16, (value >> 16) as u16);
        let mut sii = Self {
            vendor: word(VENDOR)?,
            code: word(CODE)?,
            revision: word(REVISION)?,
            serial: word(SERIAL)?,
            receive: pair(word(RECEIVE_MAILBOX)?),
            send: pair(word(SEND_MAILBOX)?),
            coe: word(PROTOCOLS)? as u16 & COE != 0,
            name: String::new(),
            managers: Vec::new(),
        };
        let mut at = CATEGORIES;
        while at < MOST_WORDS {
            let (kind, words) = pair(word(at)?);
            if kind == END {
                break;
            }
            if kind == STRINGS && words > 0 && sii.name.is_empty() {
                sii.name = first_string(at + 2, words, &mut word)?;
            }
            if kind == MANAGERS && sii.managers.is_empty() {
                sii.managers = managers(at + 2, words, &mut word)?;
            }
            let Some(next) = at.checked_add(2).and_then(|at| at.checked_add(words)) else {
                break;
            };
            at = next;
        }
        Some(sii)
    }
}

/// The first of the strings that begin at the word `at`: a count, and before each its length.
fn first_string(at: u16, words: u16, word: &mut impl FnMut(u16) -> Option<u32>) -> Option<String> {
    let mut bytes = Vec::new();
    // A string has at most 255 bytes.
    for offset in (0..words.min(129)).step_by(2) {
        bytes.extend(word(at.checked_add(offset)?)?.to_le_bytes());
    }
    let length = bytes.get(1).copied().map_or(0, usize::from);
    let text = bytes.get(2..2 + length).unwrap_or_default();
    Some(
        text.iter()
            .map(|byte| char::from(*byte))
            .filter(|letter| !letter.is_control())
            .collect(),
    )
}

/// The sync managers that begin at the word `at`.
fn managers(
    at: u16,
    words: u16,
    word: &mut impl FnMut(u16) -> Option<u32>,
) -> Option<Vec<Manager>> {
    let count = (usize::from(words) * 2 / MANAGER_SIZE).min(MOST_MANAGERS);
    let mut all = Vec::with_capacity(count);
    for index in 0..count {
        let first = at.checked_add((index * MANAGER_SIZE / 2) as u16)?;
        let (place, rest) = (word(first)?, word(first.checked_add(2)?)?);
        all.push(Manager {
            start: place as u16,
            length: (place >> 16) as u16,
            control: rest as u8,
            kind: (rest >> 24) as u8,
        });
    }
    Some(all)
}

/// Content of the EEPROM of a simulated device.
#[derive(Debug, Clone)]
pub(crate) struct Contents<'a> {
    pub sii: &'a Sii,
    pub outputs: &'a [Entry],
    pub inputs: &'a [Entry],
}

/// Categories of the memory units, the sync managers and the process data.
const GENERAL: u16 = 30;
const UNITS: u16 = 40;
const MANAGERS: u16 = 41;
const INPUTS: u16 = 50;
const OUTPUTS: u16 = 51;

impl Contents<'_> {
    /// The bytes of the EEPROM.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let sii = self.sii;
        let mut bytes = vec![0u8; 2 * usize::from(CATEGORIES)];
        let mut set = |at: u16, value: u32| {
            let at = 2 * usize::from(at);
            if let Some(place) = bytes.get_mut(at..at + 4) {
                place.copy_from_slice(&value.to_le_bytes());
            }
        };
        let pair = |(low, high): (u16, u16)| u32::from(low) | u32::from(high) << 16;
        set(VENDOR, sii.vendor);
        set(CODE, sii.code);
        set(REVISION, sii.revision);
        set(SERIAL, sii.serial);
        // The mailboxes of the bootstrap state are those of PRE-OP.
        for at in [RECEIVE_MAILBOX - 4, RECEIVE_MAILBOX] {
            set(at, pair(sii.receive));
        }
        for at in [SEND_MAILBOX - 4, SEND_MAILBOX] {
            set(at, pair(sii.send));
        }
        set(PROTOCOLS, u32::from(if sii.coe { COE } else { 0 }));
        // Size in kbit less one, and version.
        set(0x3e, 0x0001_000f);
        let mut category = |kind: u16, content: &[u8]| {
            let words = content.len().div_ceil(2);
            bytes.extend(kind.to_le_bytes());
            bytes.extend((words as u16).to_le_bytes());
            bytes.extend(content);
            bytes.resize(bytes.len().next_multiple_of(2), 0);
        };
        let name = sii.name.as_bytes();
        let mut strings = vec![1, name.len() as u8];
        strings.extend(name);
        category(STRINGS, &strings);
        let mut general = [0u8; 32];
        // Group, image, order number and name are the string 1; details of CoE: SDO, PDO assignment and configuration.
        general[..4].copy_from_slice(&[1, 0, 1, 1]);
        general[5] = if sii.coe { 0x0d } else { 0 };
        category(GENERAL, &general);
        // Unit 0 is for outputs, 1 for inputs, 2 for the state of the mailbox.
        category(UNITS, &[1, 2, 3, 0xff]);
        let rows = sii.managers.iter().flat_map(|manager| {
            let [s0, s1] = manager.start.to_le_bytes();
            let [l0, l1] = manager.length.to_le_bytes();
            let enabled = u8::from(manager.length > 0);
            [s0, s1, l0, l1, manager.control, 0, enabled, manager.kind]
        });
        category(MANAGERS, &rows.collect::<Vec<u8>>());
        for (kind, index, manager, entries) in [
            (INPUTS, 0x1a00u16, 3u8, self.inputs),
            (OUTPUTS, 0x1600, 2, self.outputs),
        ] {
            if !entries.is_empty() {
                category(kind, &pdo(index, manager, entries));
            }
        }
        bytes.extend(END.to_le_bytes());
        bytes.extend(END.to_le_bytes());
        bytes
    }
}

/// One PDO with its entries.
fn pdo(index: u16, manager: u8, entries: &[Entry]) -> Vec<u8> {
    let mut bytes = index.to_le_bytes().to_vec();
    bytes.extend([entries.len() as u8, manager, 0, 1, 0, 0]);
    for entry in entries {
        bytes.extend(entry.index.to_le_bytes());
        bytes.extend([entry.sub, 0, 0, 8 * entry.kind.bytes() as u8, 0, 0]);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn reader(bytes: &[u8]) -> impl FnMut(u16) -> Option<u32> {
        move |at| {
            let at = 2 * usize::from(at);
            let four = bytes.get(at..)?.first_chunk()?;
            Some(u32::from_le_bytes(*four))
        }
    }

    fn manager(start: u16, length: u16, control: u8, kind: u8) -> Manager {
        Manager {
            start,
            length,
            control,
            kind,
        }
    }

    #[test]
    fn contents_read_back() {
        let sii = Sii {
            vendor: 2,
            code: 0x0c1e_3052,
            revision: 0x11_0000,
            serial: 7,
            receive: (0x1000, 128),
            send: (0x1080, 128),
            coe: true,
            name: "EL3102".to_owned(),
            managers: vec![
                manager(0x1000, 128, 0x26, 1),
                manager(0x1080, 128, 0x22, 2),
                manager(0x1100, 0, 0x24, 3),
                manager(0x1180, 4, 0x20, 4),
            ],
        };
        let inputs = [
            "6000:01 u16 state".parse().unwrap(),
            "6000:11 i16 force".parse().unwrap(),
        ];
        let contents = Contents {
            sii: &sii,
            outputs: &[],
            inputs: &inputs,
        };
        let bytes = contents.bytes();
        assert_eq!(Sii::read(reader(&bytes)), Some(sii));
        // Vendor at the byte of the standard.
        assert_eq!(bytes[16..20], [2, 0, 0, 0]);
    }

    #[test]
    fn an_eeprom_without_an_end_is_read_once() {
        let mut reads = 0;
        let sii = Sii::read(|_| {
            reads += 1;
            Some(0x0000_0001)
        });
        assert!(sii.is_some() && reads < 4096, "{reads}");
        assert_eq!(Sii::read(|at| (at < 0x40).then_some(0)), None);
    }

    proptest! {
        #[test]
        fn arbitrary_words_never_panic(words in prop::collection::vec(any::<u8>(), 0..600)) {
            let _ = Sii::read(reader(&words));
        }
    }
}
