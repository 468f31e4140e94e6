//! A ZIP archive whose entries are stored as they are and whose places are known beforehand.
//!
//! Written by hand, because the archive crates write entry after entry and columns are written side by side. Layout
//! after PKWARE's APPNOTE 6.3.3; always with the 64-bit extra fields, so that nothing depends on sizes.

use super::block::Piece;

/// Signature, versions, method and so on before the name of an entry.
const LOCAL: u64 = 30;
/// The 64-bit extra field behind it: two sizes.
const LOCAL_EXTRA: u64 = 20;
/// Where the checksum stands in the local header.
const CHECKSUM: u64 = 14;
/// Version of the format that knows 64-bit sizes.
const VERSION: u16 = 45;
/// Names are UTF-8.
const FLAGS: u16 = 1 << 11;
/// 1980-01-01, the begin of its calendar: the same run gives the same bytes.
const DATE: u16 = 0x21;

/// An archive being laid out.
#[derive(Default)]
pub(super) struct Archive {
    entries: Vec<Entry>,
    end: u64,
}

struct Entry {
    name: String,
    offset: u64,
    size: u64,
    checksum: u32,
}

impl Archive {
    /// Where the bytes of the next entry of this name will stand.
    pub fn next(&self, name: &str) -> u64 {
        self.end + LOCAL + name.len() as u64 + LOCAL_EXTRA
    }

    /// Adds an entry of so many bytes; its header, and where its bytes are to stand.
    pub fn add(&mut self, name: &str, size: u64, checksum: u32) -> (Piece, u64) {
        let offset = self.end;
        let place = self.next(name);
        let mut head = Vec::new();
        head.extend_from_slice(b"PK\x03\x04");
        put16(&mut head, &[VERSION, FLAGS, 0, 0, DATE]);
        put32(&mut head, &[checksum, u32::MAX, u32::MAX]);
        put16(&mut head, &[name.len() as u16, LOCAL_EXTRA as u16]);
        head.extend_from_slice(name.as_bytes());
        put16(&mut head, &[1, 16]);
        put64(&mut head, &[size, size]);
        self.end = place + size;
        self.entries.push(Entry {
            name: name.to_owned(),
            offset,
            size,
            checksum,
        });
        ((offset, head), place)
    }

    /// Where the directory stands, and its length.
    pub fn directory(&self) -> (u64, u64) {
        (self.end, self.closing().len() as u64)
    }

    /// The checksum of the entry of this number, and where it stands in the file.
    pub fn amend(&mut self, index: usize, checksum: u32) -> Option<Piece> {
        let entry = self.entries.get_mut(index)?;
        entry.checksum = checksum;
        Some((entry.offset + CHECKSUM, checksum.to_le_bytes().to_vec()))
    }

    /// The directory and the end of the archive.
    pub fn closing(&self) -> Vec<u8> {
        let mut out = Vec::new();
        for entry in &self.entries {
            out.extend_from_slice(b"PK\x01\x02");
            put16(&mut out, &[VERSION, VERSION, FLAGS, 0, 0, DATE]);
            put32(&mut out, &[entry.checksum, u32::MAX, u32::MAX]);
            put16(&mut out, &[entry.name.len() as u16, 28, 0, 0, 0]);
            put32(&mut out, &[0, u32::MAX]);
            out.extend_from_slice(entry.name.as_bytes());
            put16(&mut out, &[1, 24]);
            put64(&mut out, &[entry.size, entry.size, entry.offset]);
        }
        let (count, size) = (self.entries.len() as u64, out.len() as u64);
        let at = self.end + size;
        out.extend_from_slice(b"PK\x06\x06");
        put64(&mut out, &[44]);
        put16(&mut out, &[VERSION, VERSION]);
        put32(&mut out, &[0, 0]);
        put64(&mut out, &[count, count, size, self.end]);
        out.extend_from_slice(b"PK\x06\x07");
        put32(&mut out, &[0]);
        put64(&mut out, &[at]);
        put32(&mut out, &[1]);
        out.extend_from_slice(b"PK\x05\x06");
        put16(&mut out, &[0, 0, u16::MAX, u16::MAX]);
        put32(&mut out, &[u32::MAX, u32::MAX]);
        put16(&mut out, &[0]);
        out
    }
}

fn put16(out: &mut Vec<u8>, values: &[u16]) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

fn put32(out: &mut Vec<u8>, values: &[u32]) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

fn put64(out: &mut Vec<u8>, values: &[u64]) {
    out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}
