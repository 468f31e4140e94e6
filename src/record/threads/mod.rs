//! `threads.bin`: what every thread of a run but the loop's did, and when. For runs on the real clock.
//!
//! Records of 24 bytes, little-endian, appended by the writer (`log`), read by [`ThreadReader`]:
//!
//! | offset | size | type | meaning |
//! |---|---|---|---|
//! | 0 | 1 | u8 | the thread's number in this file |
//! | 1 | 1 | u8 | what it did: the code of [`What`] |
//! | 2 | 2 | u16 | pieces that were put together; 1: this is one |
//! | 4 | 4 | u32 | duration, ns; what took longer than fits is several records, one behind the other |
//! | 8 | 8 | u64 | begin, ns of CLOCK_MONOTONIC: the loop's clock |
//! | 16 | 4 | u32 | how much of it, in the unit of [`What::unit`]; the largest number also stands for more |
//! | 20 | 4 | u32 | CRC-32 (IEEE 802.3, as zlib's) of the 20 bytes before it |
//!
//! Code 0 names a thread, before its first record: its name as /proc has it in bytes 2 to 16 (filled up with zeros), its
//! kernel number in bytes 17 to 19. Code 255 says that so many stamps found no room before this moment. The first record
//! names the format: thread 255, code 0, `gusset-threads`, version 1 in place of the kernel's number.
//!
//! Records stand in order of their end, as far as threads agree on it; what is inside of something else (writing within a
//! turn of the writer) stands before it. After a kill −9 the file ends at most 25 ms before the kill, in whole records or in
//! one that is torn. It is not synced to the disk: a power cut may cost the last half minute of it.
//!
//! Threads leave their stamps in a queue ([`Roll`]) and never wait; what finds no room is counted. The loop's thread leaves
//! none: its stamps are columns of the rows.

pub(super) mod log;
mod read;
mod roll;

pub use log::ThreadLog;
pub use read::{ThreadEnd, ThreadReader, ThreadRecord};
pub use roll::{Roll, Stamper, Who};

/// Bytes of a record.
pub const RECORD: usize = 24;
/// The name of the file in a run folder.
pub const FILE: &str = "threads.bin";

/// Bytes before the checksum.
const BODY: usize = 20;
/// Code of a record that names a thread.
const NAME: u8 = 0;
/// Code of a record that counts what is missing.
const LOST: u8 = 255;
/// Number that no thread has.
const NOBODY: u8 = 255;
/// Name in the first record.
const FORMAT: &str = "gusset-threads";
/// Version in the first record.
const VERSION: u32 = 1;
/// Longest name: that of a thread in /proc.
const LONGEST_NAME: usize = 15;

macro_rules! what {
    ($($(#[$doc:meta])* $name:ident = $code:literal, $word:literal, $unit:literal;)*) => {
        /// What a thread did.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum What { $($(#[$doc])* $name,)* }

        impl What {
            /// All, in the order of their codes.
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            /// Its number in the file.
            #[must_use]
            pub const fn code(self) -> u8 {
                match self { $(Self::$name => $code,)* }
            }

            /// In words.
            #[must_use]
            pub const fn word(self) -> &'static str {
                match self { $(Self::$name => $word,)* }
            }

            /// What its amount counts; empty if there is nothing to count.
            #[must_use]
            pub const fn unit(self) -> &'static str {
                match self { $(Self::$name => $unit,)* }
            }

            fn of_code(code: u8) -> Option<Self> {
                match code { $($code => Some(Self::$name),)* _ => None }
            }
        }
    };
}

what! {
    /// A turn of the writer: rows and events from their queues.
    Drain = 1, "drain", "rows";
    /// Rows written to `samples.bin`.
    WriteRows = 2, "write rows", "bytes";
    /// Lines written to `events.jsonl`.
    WriteEvents = 3, "write events", "bytes";
    /// `samples.bin` brought to the disk.
    SyncRows = 4, "sync rows", "bytes";
    /// `events.jsonl` brought to the disk.
    SyncEvents = 5, "sync events", "bytes";
    /// The kernel's counters of the loop's thread read.
    Look = 6, "look at the scheduler", "";
    /// The live page's thread at work.
    Page = 7, "serve viewers", "bytes";
    /// A request of another program answered.
    Request = 8, "answer a request", "";
    /// A signal passed on.
    Signal = 9, "pass a signal on", "";
    /// The progress shown.
    Status = 10, "show the status", "";
    /// Something told to the operator at the terminal.
    Tell = 11, "tell the operator", "";
    /// A specimen connected.
    Connect = 12, "connect a specimen", "";
    /// A link's helper carried bytes, without a pause.
    Carry = 13, "carry", "bytes";
    /// The same in short pieces; the time at work in all of them.
    Carries = 14, "carry, in pieces", "ns at work";
    /// A load that was asked for.
    Load = 15, "load", "bytes";
}

/// One thing that a thread did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    /// The thread's number on its [`Roll`].
    pub thread: u8,
    /// What it did.
    pub what: What,
    /// Pieces that were put together; 1: this is one.
    pub pieces: u16,
    /// Begin, ns of CLOCK_MONOTONIC.
    pub begin_ns: u64,
    /// Duration in ns.
    pub duration_ns: u64,
    /// How much of it, in the unit of [`What::unit`].
    pub amount: u64,
}

fn seal(body: [u8; BODY], out: &mut Vec<u8>) {
    out.extend_from_slice(&body);
    out.extend_from_slice(&crc32fast::hash(&body).to_le_bytes());
}

fn body(
    thread: u8,
    code: u8,
    pieces: u16,
    begin_ns: u64,
    duration_ns: u32,
    amount: u64,
) -> [u8; BODY] {
    let mut body = [0; BODY];
    let amount = u32::try_from(amount).unwrap_or(u32::MAX);
    let fields = [thread, code]
        .into_iter()
        .chain(pieces.to_le_bytes())
        .chain(duration_ns.to_le_bytes())
        .chain(begin_ns.to_le_bytes())
        .chain(amount.to_le_bytes());
    for (to, from) in body.iter_mut().zip(fields) {
        *to = from;
    }
    body
}

impl Stamp {
    /// Records that it takes: more than one if it took longer than one can say.
    fn records(&self) -> usize {
        let more = self.duration_ns.saturating_sub(1) / u64::from(u32::MAX);
        1 + usize::try_from(more).unwrap_or(usize::MAX - 1)
    }

    fn encode(&self, out: &mut Vec<u8>) {
        let (mut begin, mut left, mut amount) = (self.begin_ns, self.duration_ns, self.amount);
        loop {
            let duration = u32::try_from(left).unwrap_or(u32::MAX);
            let code = self.what.code();
            seal(
                body(self.thread, code, self.pieces, begin, duration, amount),
                out,
            );
            begin += u64::from(duration);
            left -= u64::from(duration);
            // It is told once.
            amount = 0;
            if left == 0 {
                return;
            }
        }
    }
}

fn encode_name(thread: u8, name: &str, number: u32, out: &mut Vec<u8>) {
    let mut body = [0; BODY];
    let [a, b, c, _] = number.to_le_bytes();
    body[0] = thread;
    body[1] = NAME;
    for (to, from) in body[2..2 + LONGEST_NAME].iter_mut().zip(name.bytes()) {
        *to = from;
    }
    body[17..BODY].copy_from_slice(&[a, b, c]);
    seal(body, out);
}

fn encode_head(out: &mut Vec<u8>) {
    encode_name(NOBODY, FORMAT, VERSION, out);
}

fn encode_lost(now_ns: u64, lost: u64, out: &mut Vec<u8>) {
    seal(body(NOBODY, LOST, 1, now_ns, 0, lost), out);
}

#[cfg(test)]
mod tests;
