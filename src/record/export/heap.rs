//! Texts of an HDF5 file: global heaps, in which a text is found by the address of its heap and its number there.

use std::collections::HashMap;

/// Texts that one heap holds: their numbers have two bytes.
const TEXTS: usize = 4096;
/// A heap is at least so long.
const SHORTEST: usize = 4096;

/// Heaps being filled. The same text is kept once.
pub(super) struct Strings {
    begin: u64,
    bytes: Vec<u8>,
    heap: Vec<u8>,
    count: usize,
    known: HashMap<String, [u8; 16]>,
}

impl Strings {
    /// Heaps that begin at this address.
    pub fn new(begin: u64) -> Self {
        Self {
            begin,
            bytes: Vec::new(),
            heap: Vec::new(),
            count: 0,
            known: HashMap::new(),
        }
    }

    /// Where they begin.
    pub const fn begin(&self) -> u64 {
        self.begin
    }

    /// Keeps a text; what stands for it wherever it belongs: its length, the address of its heap, its number.
    pub fn keep(&mut self, text: &str) -> [u8; 16] {
        if let Some(known) = self.known.get(text) {
            return *known;
        }
        if self.count == TEXTS {
            self.close();
        }
        self.count += 1;
        let number = self.count as u16;
        // An empty text has one byte, so that it has a place.
        let bytes = if text.is_empty() {
            b"\0"
        } else {
            text.as_bytes()
        };
        self.heap.extend_from_slice(&number.to_le_bytes());
        self.heap.extend_from_slice(&[0; 6]);
        self.heap
            .extend_from_slice(&(bytes.len() as u64).to_le_bytes());
        self.heap.extend_from_slice(bytes);
        self.heap.resize(self.heap.len().next_multiple_of(8), 0);
        let at = self.begin + self.bytes.len() as u64;
        let mut stands = [0; 16];
        let parts = (bytes.len() as u32).to_le_bytes().into_iter();
        let parts = parts.chain(at.to_le_bytes());
        let parts = parts.chain(u32::from(number).to_le_bytes());
        for (to, from) in stands.iter_mut().zip(parts) {
            *to = from;
        }
        self.known.insert(text.to_owned(), stands);
        stands
    }

    /// All heaps.
    pub fn finish(mut self) -> Vec<u8> {
        self.close();
        self.bytes
    }

    fn close(&mut self) {
        if self.count == 0 {
            return;
        }
        let used = 16 + self.heap.len();
        // What is free has a head of sixteen bytes and counts it.
        let size = (used + 16).max(SHORTEST);
        self.bytes.extend_from_slice(b"GCOL\x01\0\0\0");
        self.bytes.extend_from_slice(&(size as u64).to_le_bytes());
        self.bytes.append(&mut self.heap);
        self.bytes.extend_from_slice(&[0; 8]);
        self.bytes
            .extend_from_slice(&((size - used) as u64).to_le_bytes());
        self.bytes.resize(self.bytes.len() + size - used - 16, 0);
        self.count = 0;
    }
}
