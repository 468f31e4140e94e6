//! `threads.bin` read: record by record, up to the first that is not whole and sound.

use std::io::{self, Read};

use super::{BODY, FORMAT, LOST, NAME, NOBODY, RECORD, Stamp, VERSION, What};
use crate::record::strides::{Next, Strides};

/// One record as read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ThreadRecord {
    /// A thread has entered.
    Name {
        /// Its number in this file.
        thread: u8,
        /// Its name, as /proc had it.
        name: String,
        /// The kernel's number of it.
        id: u32,
    },
    /// Something was done.
    Stamp(Stamp),
    /// So many stamps found no room before this moment.
    Lost {
        /// When that was seen, ns of CLOCK_MONOTONIC.
        at_ns: u64,
        /// How many.
        stamps: u64,
    },
}

/// Why the records end where they end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThreadEnd {
    /// The file ends with a whole record.
    Clean,
    /// The file ends in the middle of a record: so many bytes of it are there.
    Torn {
        /// Bytes behind the last whole record.
        bytes: usize,
    },
    /// The checksum of this record is wrong.
    Damaged {
        /// Record in the file, from 0.
        record: u64,
    },
    /// The file does not begin as such a file of this version does.
    Foreign,
}

impl std::fmt::Display for ThreadEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Clean => write!(f, "threads.bin ends with a whole record"),
            Self::Torn { bytes } => write!(
                f,
                "threads.bin ends in the middle of a record ({bytes} bytes of it)"
            ),
            Self::Damaged { record } => write!(
                f,
                "record {record} of threads.bin is damaged; nothing behind it is read"
            ),
            Self::Foreign => write!(
                f,
                "threads.bin does not begin with \"{FORMAT}\", version {VERSION}: nothing of it is read"
            ),
        }
    }
}

/// Reads records one by one.
#[derive(Debug)]
pub struct ThreadReader<R> {
    source: Strides<R>,
    records: u64,
    end: Option<ThreadEnd>,
}

impl<R: Read> ThreadReader<R> {
    /// A reader. No need to buffer `source`.
    #[must_use]
    pub fn new(source: R) -> Self {
        Self {
            source: Strides::new(source, RECORD),
            records: 0,
            end: None,
        }
    }

    /// The next record, or `None` at the end, which [`ThreadReader::end`] then explains. Codes that this version does not
    /// know are passed over.
    ///
    /// # Errors
    /// The source cannot be read.
    pub fn next_record(&mut self) -> io::Result<Option<ThreadRecord>> {
        while self.end.is_none() {
            let Some(body) = self.next_body()? else {
                break;
            };
            let first = self.records == 0;
            self.records += 1;
            if first {
                if !is_head(&body) {
                    self.end = Some(ThreadEnd::Foreign);
                }
                continue;
            }
            if let Some(record) = decode(&body) {
                return Ok(Some(record));
            }
        }
        Ok(None)
    }

    /// Why there is no further record; `None` while there may be one.
    #[must_use]
    pub const fn end(&self) -> Option<ThreadEnd> {
        self.end
    }

    fn next_body(&mut self) -> io::Result<Option<[u8; BODY]>> {
        let record = match self.source.next()? {
            Next::Record(record) => record,
            Next::End(left) => {
                self.end = Some(match left {
                    0 => ThreadEnd::Clean,
                    bytes => ThreadEnd::Torn { bytes },
                });
                return Ok(None);
            }
        };
        let sound = record
            .split_first_chunk::<BODY>()
            .filter(|(body, crc)| crc32fast::hash(*body).to_le_bytes() == **crc);
        if sound.is_none() {
            self.end = Some(match self.records {
                0 => ThreadEnd::Foreign,
                record => ThreadEnd::Damaged { record },
            });
        }
        Ok(sound.map(|(body, _)| *body))
    }
}

fn is_head(body: &[u8; BODY]) -> bool {
    matches!(named(body), (NOBODY, name, VERSION) if body[1] == NAME && name == FORMAT)
}

fn named(body: &[u8; BODY]) -> (u8, String, u32) {
    let [thread, _, name @ .., a, b, c] = body;
    let length = name.iter().position(|byte| *byte == 0);
    let name = name.get(..length.unwrap_or(name.len())).unwrap_or_default();
    let id = u32::from_le_bytes([*a, *b, *c, 0]);
    (*thread, String::from_utf8_lossy(name).into_owned(), id)
}

fn decode(body: &[u8; BODY]) -> Option<ThreadRecord> {
    let (numbers, _) = body.as_chunks::<4>();
    let [head, duration, low, high, amount] = *numbers else {
        return None;
    };
    let [thread, code, p, q] = head;
    let begin_ns = u64::from(u32::from_le_bytes(low)) | u64::from(u32::from_le_bytes(high)) << 32;
    let amount = u64::from(u32::from_le_bytes(amount));
    match code {
        NAME => {
            let (thread, name, id) = named(body);
            Some(ThreadRecord::Name { thread, name, id })
        }
        LOST => Some(ThreadRecord::Lost {
            at_ns: begin_ns,
            stamps: amount,
        }),
        code => Some(ThreadRecord::Stamp(Stamp {
            thread,
            what: What::of_code(code)?,
            pieces: u16::from_le_bytes([p, q]),
            begin_ns,
            duration_ns: u64::from(u32::from_le_bytes(duration)),
            amount,
        })),
    }
}
