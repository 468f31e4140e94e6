//! `samples.bin`: one record per row, appended by [`JournalWriter`], read by [`Journal`].
//!
//! [`super::layout`] describes the layout. The reader gives every row up to the first one that is incomplete or
//! damaged, and reports why it stopped. After a kill −9 or a power cut it stops behind the last whole row. It does
//! not look for sound rows behind a damaged one. Rows that were lost before they reached the file are gaps in the
//! sequence numbers: counted, not an error.

use std::io::{self, Read};

use super::append::{Appender, Store, Unit};
use super::layout::{HEAD, MARKER, TAIL, stride};
use super::strides::{Next, Strides};
use gusset_quantity::work::Work;

/// Appends the record of one row.
#[inline]
pub fn encode(sequence: u64, values: &[f64], out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + stride(values.len()), 0);
    let (words, _) = out.get_mut(start..).unwrap_or_default().as_chunks_mut();
    let [head, places @ .., _] = &mut *words else {
        return;
    };
    *head = sequence.to_le_bytes();
    for (place, value) in places.iter_mut().zip(values) {
        *place = value.to_le_bytes();
    }
    let Some((tail, covered)) = words.split_last_mut() else {
        return;
    };
    let [a, b, c, d] = crc32fast::hash(covered.as_flattened()).to_le_bytes();
    let [e, f, g, h] = MARKER;
    *tail = [a, b, c, d, e, f, g, h];
}

/// Appends rows to a store, whole rows only, whatever the store does (see [`super::append`]).
#[derive(Debug)]
pub(crate) struct JournalWriter<S> {
    pub file: Appender<S>,
    stride: usize,
}

impl<S: Store> JournalWriter<S> {
    /// A writer of rows of `columns` values into an empty store; `bound` bytes may wait for a failing store.
    #[must_use]
    pub(crate) fn new(store: S, columns: usize, bound: usize) -> Self {
        let stride = stride(columns);
        let bound = bound.max(stride);
        Self {
            file: Appender::new(store, Unit::Stride(stride), bound),
            stride,
        }
    }

    /// Takes one row; false if it is lost: too much waits for the store, or the length is wrong.
    pub(crate) fn row(&mut self, sequence: u64, values: &[f64]) -> bool {
        stride(values.len()) == self.stride
            && self
                .file
                .offer(self.stride, |out| encode(sequence, values, out))
    }

    /// Rows in the store.
    #[must_use]
    pub(crate) fn rows(&self) -> u64 {
        self.file.length / self.stride as u64
    }
}

/// Why the rows end where they end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The file ends with a whole row.
    Clean,
    /// The file ends in the middle of a row.
    Torn {
        /// Bytes behind the last whole row.
        bytes: usize,
    },
    /// The checksum or the marker of this row (counted in the file from 0) is wrong.
    Damaged {
        /// Row in the file, from 0.
        row: u64,
    },
    /// The sequence number of this row does not grow.
    Disordered {
        /// Row in the file, from 0.
        row: u64,
        /// Its sequence number.
        sequence: u64,
    },
}

impl End {
    /// True if a row is damaged. A kill or a test that still runs leaves a torn row, and no damaged one.
    #[must_use]
    pub const fn is_damage(self) -> bool {
        matches!(self, Self::Damaged { .. } | Self::Disordered { .. })
    }
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Clean => write!(f, "the samples end with a whole row"),
            Self::Torn { bytes } => write!(
                f,
                "the samples end in the middle of a row ({bytes} bytes of it)"
            ),
            Self::Damaged { row } => write!(
                f,
                "row {row} of the samples is damaged; nothing behind it is read"
            ),
            Self::Disordered { row, sequence } => write!(
                f,
                "row {row} of the samples has the number {sequence}, which does not follow; nothing behind it is read"
            ),
        }
    }
}

/// One row as read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<'a> {
    /// Its number as the loop counted.
    pub sequence: u64,
    /// Its values, one per column.
    pub values: &'a [f64],
}

/// Reads rows one by one, without allocating per row.
#[derive(Debug)]
pub struct Journal<R> {
    records: Strides<R>,
    values: Vec<f64>,
    rows: u64,
    lost: u64,
    next: u64,
    end: Option<End>,
    work: Option<Work>,
}

/// Rows from one report of the progress to the next.
const ROWS_PER_REPORT: u64 = 1024;

impl<R: Read> Journal<R> {
    /// A reader of rows with `columns` values. No need to buffer `source`.
    #[must_use]
    pub fn new(source: R, columns: usize) -> Self {
        Self {
            records: Strides::new(source, stride(columns)),
            values: vec![0.0; columns],
            rows: 0,
            lost: 0,
            next: 0,
            end: None,
            work: None,
        }
    }

    /// Counts the rows as parts of `work`.
    #[must_use]
    pub fn watched(mut self, work: Work) -> Self {
        self.work = Some(work);
        self
    }

    /// The next row, or `None` at the end, which [`Journal::end`] then explains.
    ///
    /// # Errors
    /// The source cannot be read.
    pub fn next_row(&mut self) -> io::Result<Option<Row<'_>>> {
        if self.end.is_some() {
            return Ok(None);
        }
        let record = match self.records.next()? {
            Next::Record(record) => record,
            Next::End(left) => {
                self.end = Some(match left {
                    0 => End::Clean,
                    bytes => End::Torn { bytes },
                });
                return Ok(None);
            }
        };
        let Some(sequence) = sound(record) else {
            self.end = Some(End::Damaged { row: self.rows });
            return Ok(None);
        };
        if sequence < self.next {
            self.end = Some(End::Disordered {
                row: self.rows,
                sequence,
            });
            return Ok(None);
        }
        let body = record.get(HEAD..).unwrap_or_default();
        for (value, bytes) in self.values.iter_mut().zip(body.as_chunks::<8>().0) {
            *value = f64::from_le_bytes(*bytes);
        }
        self.lost += sequence - self.next;
        self.next = sequence.saturating_add(1);
        self.rows += 1;
        if self.rows.is_multiple_of(ROWS_PER_REPORT)
            && let Some(work) = &self.work
        {
            work.done(self.rows);
        }
        Ok(Some(Row {
            sequence,
            values: &self.values,
        }))
    }

    /// Rows given so far.
    #[must_use]
    pub const fn rows(&self) -> u64 {
        self.rows
    }

    /// Rows missing before the last one given.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost
    }

    /// Why the rows ended; `None` until they have.
    #[must_use]
    pub const fn end(&self) -> Option<End> {
        self.end
    }

    /// Reads the rest into one vector per wanted column, places counted from 0.
    ///
    /// # Errors
    /// The source cannot be read. A place beyond the row gives an empty vector.
    pub fn columns(&mut self, wanted: &[usize]) -> io::Result<Vec<Vec<f64>>> {
        let mut columns = vec![Vec::new(); wanted.len()];
        while let Some(row) = self.next_row()? {
            for (column, &place) in columns.iter_mut().zip(wanted) {
                column.extend(row.values.get(place));
            }
        }
        Ok(columns)
    }
}

/// The sequence number of a record whose checksum and marker are right.
fn sound(record: &[u8]) -> Option<u64> {
    let (covered, tail) = record.split_at_checked(record.len().checked_sub(TAIL)?)?;
    let (crc, marker) = tail.split_first_chunk::<4>()?;
    let right = marker == MARKER && crc32fast::hash(covered) == u32::from_le_bytes(*crc);
    let sequence = covered.first_chunk::<HEAD>()?;
    right.then(|| u64::from_le_bytes(*sequence))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::append::tests::SmallDisk;
    use crate::strides::BUFFER;
    use proptest::prelude::*;

    fn file_of(rows: u64, columns: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        for k in 0..rows {
            let values: Vec<f64> = (0..columns).map(|c| k as f64 + 0.1 * c as f64).collect();
            encode(k, &values, &mut bytes);
        }
        bytes
    }

    fn read(bytes: &[u8], columns: usize) -> (Vec<u64>, u64, End) {
        let mut journal = Journal::new(bytes, columns);
        let mut numbers = Vec::new();
        while let Some(row) = journal.next_row().unwrap() {
            numbers.push(row.sequence);
            assert_eq!(row.values.len(), columns);
        }
        assert_eq!(journal.rows(), numbers.len() as u64);
        (numbers, journal.lost(), journal.end().unwrap())
    }

    #[test]
    fn record_has_the_documented_bytes() {
        let mut bytes = vec![0xEE];
        encode(258, &[1.0, -2.0], &mut bytes);
        // By hand: 258 = 0x0102; 1.0 = 0x3FF0…; −2.0 = 0xC000…; CRC-32 of these 24 bytes from zlib.
        let golden: [u8; 33] = [
            0xEE,
            2,
            1,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            0xF0,
            0x3F,
            0,
            0,
            0,
            0,
            0,
            0,
            0,
            0xC0,
            GOLDEN_CRC[0],
            GOLDEN_CRC[1],
            GOLDEN_CRC[2],
            GOLDEN_CRC[3],
            b'R',
            b'O',
            b'W',
            b'\n',
        ];
        assert_eq!(bytes, golden);
    }
    const GOLDEN_CRC: [u8; 4] = [0xD1, 0xAD, 0x29, 0x9B];

    #[test]
    fn file_cut_at_any_byte_gives_whole_rows() {
        let columns = 3;
        let size = stride(columns);
        let bytes = file_of(6, columns);
        for cut in 4 * size..=6 * size {
            let (numbers, lost, end) = read(&bytes[..cut], columns);
            assert_eq!(numbers, (0..(cut / size) as u64).collect::<Vec<_>>());
            assert_eq!(lost, 0);
            let torn = cut % size;
            assert_eq!(
                end,
                if torn == 0 {
                    End::Clean
                } else {
                    End::Torn { bytes: torn }
                }
            );
        }
    }

    #[test]
    fn flipped_bit_ends_the_rows_before_it() {
        let columns = 2;
        let size = stride(columns);
        let good = file_of(4, columns);
        for bit in 2 * size * 8..3 * size * 8 {
            let mut bytes = good.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            let (numbers, _, end) = read(&bytes, columns);
            assert_eq!(
                (numbers, end),
                (vec![0, 1], End::Damaged { row: 2 }),
                "bit {bit}"
            );
        }
    }

    #[test]
    fn tail_of_zeros_is_not_a_row() {
        let mut bytes = file_of(2, 2);
        bytes.resize(bytes.len() + 5 * stride(2), 0);
        assert_eq!(read(&bytes, 2), (vec![0, 1], 0, End::Damaged { row: 2 }));
    }

    #[test]
    fn gaps_count_falling_numbers_are_damage() {
        let mut bytes = Vec::new();
        for k in [2, 3, 7] {
            encode(k, &[0.0], &mut bytes);
        }
        assert_eq!(read(&bytes, 1), (vec![2, 3, 7], 5, End::Clean));
        encode(7, &[0.0], &mut bytes);
        let (numbers, lost, end) = read(&bytes, 1);
        assert_eq!((numbers.len(), lost), (3, 5));
        assert_eq!(
            end,
            End::Disordered {
                row: 3,
                sequence: 7
            }
        );
    }

    #[test]
    fn long_files_and_slow_sources_read_alike() {
        struct Dribble<'a>(&'a [u8], usize);
        impl Read for Dribble<'_> {
            fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
                self.1 = self.1 % 97 + 1;
                let count = self.1.min(out.len()).min(self.0.len());
                let (now, later) = self.0.split_at(count);
                out[..count].copy_from_slice(now);
                self.0 = later;
                Ok(count)
            }
        }
        let bytes = file_of(9000, 5);
        assert!(bytes.len() > BUFFER);
        let from_slice = Journal::new(&bytes[..], 5).columns(&[0, 4]).unwrap();
        let dribbled = Journal::new(Dribble(&bytes, 0), 5)
            .columns(&[0, 4])
            .unwrap();
        assert_eq!(from_slice, dribbled);
        assert_eq!(
            (from_slice[0].len(), from_slice[1][8999]),
            (9000, 8999.0 + 0.1 * 4.0)
        );
    }

    #[test]
    fn full_disk_leaves_sound_rows_and_a_gap() {
        let (columns, size) = (2, stride(2));
        let disk = SmallDisk::with_room(3 * size + 11);
        let mut writer = JournalWriter::new(disk.clone(), columns, 4 * size);
        let mut lost = 0;
        for k in 0..20u64 {
            if k == 12 {
                disk.set_room(1 << 20);
            }
            lost += u64::from(!writer.row(k, &[k as f64, 0.0]));
            writer.file.flush(k * 60_000_000);
            assert_eq!(disk.bytes().len() % size, 0, "torn after row {k}");
        }
        let (numbers, gaps, end) = read(&disk.bytes(), columns);
        assert!(lost > 0);
        assert_eq!((gaps, end), (lost, End::Clean));
        assert_eq!(numbers.len() as u64, 20 - lost);
        assert_eq!((writer.rows(), writer.file.waiting_units()), (20 - lost, 0));
        assert_eq!(numbers[..3], [0, 1, 2]);
        assert_eq!(numbers.last(), Some(&19));
    }

    proptest! {
        #[test]
        fn every_double_comes_back_bit_for_bit(bits in prop::collection::vec(any::<u64>(), 1..9), first in any::<u32>()) {
            let values: Vec<f64> = bits.iter().map(|&b| f64::from_bits(b)).collect();
            let mut bytes = Vec::new();
            encode(u64::from(first), &values, &mut bytes);
            let mut journal = Journal::new(&bytes[..], values.len());
            let row = journal.next_row().unwrap().unwrap();
            prop_assert_eq!(row.sequence, u64::from(first));
            prop_assert!(row.values.iter().map(|v| v.to_bits()).eq(bits));
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200), columns in 1usize..4) {
            let mut journal = Journal::new(&bytes[..], columns);
            while journal.next_row().unwrap().is_some() {}
            prop_assert!(journal.end().is_some());
        }
    }
}
