//! HDF5, as every version of its library since 1.8 and MATLAB, Octave, Python, Julia and R read it.
//!
//! `/samples` has a dataset per column that is the same between clocks and repeats, `/timing` those that depend on wall
//! time, each with the attributes `unit` and `meaning`; the file has the attributes `summary`, `test` and `resolved`: the
//! texts of these files. Datasets are contiguous and not compressed, so a reader maps them. Written by hand after the "HDF5 File Format Specification
//! Version 3.0", first of its layouts (superblock 0, symbol tables): what is needed of it has been the same since 1998,
//! and a library that writes columns as they come is longer than the rest of this program.

use super::ExportError;
use super::block::{Columnar, Skeleton, Table};
use super::heap::Strings;
use super::plan::Source;

/// No address.
const NONE: u64 = u64::MAX;
/// Length of the superblock.
const SUPERBLOCK: u64 = 96;
/// Children of a node of a group's tree are at most twice this; there is never more than one.
const FEW: u16 = 16;
/// Columns of which one table of symbols can hold the names: its size stands in two bytes.
const WIDEST: usize = 100_000;

/// Types of messages in an object's header.
const DATASPACE: u16 = 1;
const DATATYPE: u16 = 3;
const FILL: u16 = 5;
const LAYOUT: u16 = 8;
const ATTRIBUTE: u16 = 12;
const SYMBOLS: u16 = 17;

/// An IEEE double, little-endian: sign at bit 63, exponent of 11 bits at 52 with the bias 1023, an implied first bit.
const DOUBLE: [u8; 20] = [
    0x11, 0x20, 63, 0, 8, 0, 0, 0, 0, 0, 64, 0, 52, 11, 0, 52, 0xFF, 3, 0, 0,
];
/// A signed integer of 64 bits, little-endian.
const INTEGER: [u8; 12] = [0x10, 8, 0, 0, 8, 0, 0, 0, 0, 0, 64, 0];
/// UTF-8 text of any length: in the file a length, an address and a number in a heap.
const TEXT: [u8; 20] = [
    0x19, 1, 1, 0, 16, 0, 0, 0, 0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0,
];
/// No value stands for what was not written.
const NO_FILL: [u8; 4] = [2, 2, 2, 0];

/// Needs nothing at the end.
pub(super) struct Hdf5;

impl Columnar for Hdf5 {
    fn lay_out(table: &Table<'_>) -> Result<(Self, Skeleton), ExportError> {
        let columns = table.columns();
        if columns.len() > WIDEST {
            return Err(ExportError::TooWide {
                format: "HDF5 file",
                columns: columns.len(),
                limit: WIDEST,
            });
        }
        let size = 8 * table.rows;
        let places: Vec<u64> = (0..columns.len() as u64)
            .map(|index| SUPERBLOCK + index * size)
            .collect();
        let mut strings = Strings::new(SUPERBLOCK + columns.len() as u64 * size);
        let mut about = vec![
            ("format", strings.keep("gusset-run")),
            (
                "written_by",
                strings.keep(concat!("Gusset ", env!("CARGO_PKG_VERSION"))),
            ),
        ];
        for file in ["summary.json", "test.toml", "resolved.toml"] {
            if let (Some((name, _)), true) =
                (file.split_once('.'), table.run.path().join(file).is_file())
            {
                about.push((name, strings.keep(&table.text(file))));
            }
        }
        let described: Vec<[(&str, [u8; 16]); 2]> = columns
            .iter()
            .map(|exposed| {
                let unit = strings.keep(&exposed.column.unit);
                [
                    ("unit", unit),
                    ("meaning", strings.keep(&exposed.column.meaning)),
                ]
            })
            .collect();
        let heaps_at = strings.begin();
        let heaps = strings.finish();
        let mut tree = Tree::new(heaps_at + heaps.len() as u64, columns.len());
        let (mut samples, mut timing) = (Vec::new(), Vec::new());
        for ((exposed, place), attributes) in columns.iter().zip(&places).zip(&described) {
            let kind: &[u8] = match exposed.source {
                Source::Sequence => &INTEGER,
                Source::Place(_) | Source::Nothing => &DOUBLE,
            };
            let place = if size == 0 { NONE } else { *place };
            let made = tree.dataset(kind, table.rows, (place, size), attributes);
            let group = if exposed.column.timing {
                &mut timing
            } else {
                &mut samples
            };
            group.push((exposed.column.name.as_str(), made));
        }
        let groups = vec![
            ("samples", tree.group(samples, &[])),
            ("timing", tree.group(timing, &[])),
        ];
        let root = tree.group(groups, &about);
        let length = tree.end();
        let head = superblock(root, length, tree.leaf);
        let skeleton = Skeleton {
            pieces: vec![(0, head), (heaps_at, heaps), (tree.begin, tree.bytes)],
            places,
            length,
            checksums: Vec::new(),
        };
        Ok((Self, skeleton))
    }
}

fn superblock(root: u64, length: u64, leaf: u16) -> Vec<u8> {
    let mut out = b"\x89HDF\r\n\x1a\n".to_vec();
    // Four versions of its parts, offsets and lengths of eight bytes.
    out.extend_from_slice(&[0, 0, 0, 0, 0, 8, 8, 0]);
    out.extend_from_slice(&leaf.to_le_bytes());
    out.extend_from_slice(&FEW.to_le_bytes());
    out.extend_from_slice(&[0; 4]);
    words(&mut out, &[0, NONE, length, NONE]);
    words(&mut out, &[0, root, 0, 0, 0]);
    out
}

fn words(out: &mut Vec<u8>, values: &[u64]) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

/// What stands behind the columns: objects that know the addresses of those before them.
struct Tree {
    begin: u64,
    bytes: Vec<u8>,
    /// A table of symbols holds at most twice as many.
    leaf: u16,
}

impl Tree {
    fn new(begin: u64, widest: usize) -> Self {
        // Fits in two bytes: the width was compared with the widest.
        let leaf = (widest.div_ceil(2)).max(4) as u16;
        Self {
            begin,
            bytes: Vec::new(),
            leaf,
        }
    }

    const fn end(&self) -> u64 {
        self.begin + self.bytes.len() as u64
    }

    /// Where the bytes stand; what follows begins at a multiple of eight.
    fn put(&mut self, bytes: &[u8]) -> u64 {
        let at = self.end();
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(8), 0);
        at
    }

    /// The header of a dataset of one dimension.
    fn dataset(
        &mut self,
        kind: &[u8],
        rows: u64,
        (place, size): (u64, u64),
        attributes: &[(&str, [u8; 16])],
    ) -> u64 {
        let mut space = vec![1, 1, 0, 0, 0, 0, 0, 0];
        words(&mut space, &[rows]);
        let mut layout = vec![3, 1];
        words(&mut layout, &[place, size]);
        let mut header = Header::default();
        header.message(DATASPACE, &space);
        header.message(DATATYPE, kind);
        header.message(FILL, &NO_FILL);
        header.message(LAYOUT, &layout);
        header.attributes(attributes);
        self.put(&header.finish())
    }

    /// A group of these objects.
    fn group(&mut self, mut members: Vec<(&str, u64)>, attributes: &[(&str, [u8; 16])]) -> u64 {
        members.sort_unstable();
        // The first name of a heap is the empty one.
        let mut names = vec![0; 8];
        let mut symbols = b"SNOD\x01\x00".to_vec();
        symbols.extend_from_slice(&(members.len() as u16).to_le_bytes());
        let mut last = 0;
        for (name, object) in &members {
            last = names.len() as u64;
            words(&mut symbols, &[last, *object, 0, 0, 0]);
            names.extend_from_slice(name.as_bytes());
            names.resize((names.len() + 1).next_multiple_of(8), 0);
        }
        symbols.resize(8 + 2 * usize::from(self.leaf) * 40, 0);
        let symbols = self.put(&symbols);
        let data = self.put(&names);
        let mut heap = b"HEAP\x00\x00\x00\x00".to_vec();
        // One means that nothing is free.
        words(&mut heap, &[names.len() as u64, 1, data]);
        let heap = self.put(&heap);
        let mut node = b"TREE\x00\x00".to_vec();
        node.extend_from_slice(&u16::from(!members.is_empty()).to_le_bytes());
        words(&mut node, &[NONE, NONE, 0, symbols, last]);
        node.resize(24 + 8 * (4 * usize::from(FEW) + 1), 0);
        let node = self.put(&node);
        let mut header = Header::default();
        let mut table = Vec::new();
        words(&mut table, &[node, heap]);
        header.message(SYMBOLS, &table);
        header.attributes(attributes);
        self.put(&header.finish())
    }
}

/// The header of an object, version 1.
#[derive(Default)]
struct Header {
    count: u16,
    messages: Vec<u8>,
}

impl Header {
    fn message(&mut self, kind: u16, bytes: &[u8]) {
        self.count += 1;
        let size = bytes.len().next_multiple_of(8);
        self.messages.extend_from_slice(&kind.to_le_bytes());
        // No message here comes near to 65,535 bytes.
        self.messages
            .extend_from_slice(&(size as u16).to_le_bytes());
        self.messages.extend_from_slice(&[0; 4]);
        self.messages.extend_from_slice(bytes);
        self.messages
            .resize(self.messages.len().next_multiple_of(8), 0);
    }

    /// Single texts.
    fn attributes(&mut self, attributes: &[(&str, [u8; 16])]) {
        for (name, text) in attributes {
            let mut out = vec![1, 0];
            for size in [name.len() + 1, TEXT.len(), 8] {
                out.extend_from_slice(&(size as u16).to_le_bytes());
            }
            out.extend_from_slice(name.as_bytes());
            out.resize((out.len() + 1).next_multiple_of(8), 0);
            out.extend_from_slice(&TEXT);
            out.resize(out.len().next_multiple_of(8), 0);
            out.extend_from_slice(&[1, 0, 0, 0, 0, 0, 0, 0]);
            out.extend_from_slice(text);
            self.message(ATTRIBUTE, &out);
        }
    }

    fn finish(self) -> Vec<u8> {
        let mut out = vec![1, 0];
        out.extend_from_slice(&self.count.to_le_bytes());
        out.extend_from_slice(&1_u32.to_le_bytes());
        out.extend_from_slice(&(self.messages.len() as u32).to_le_bytes());
        out.extend_from_slice(&[0; 4]);
        out.extend_from_slice(&self.messages);
        out
    }
}
