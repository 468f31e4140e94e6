//! Rows of 40 doubles from one thread to another: rtrb, as the recorder uses it, against crossbeam-channel.
//!
//! `through` sends 4096 rows through the ring while the other thread drains it as fast as it can. `push` is the
//! loop's cost of one row while the ring has room and no thread reads. `read_back` turns the bytes of `samples.bin`
//! into checked rows. Compare the ratios of one run, not the figures of two.

use std::hint::black_box;

use crossbeam_channel::{Receiver, Sender};
use divan::Bencher;
use divan::counter::{BytesCount, ItemsCount};
use gusset_record::journal::{Journal, encode};
use gusset_record::{Recorder, RingReader, RingRecorder, RingSize, WhenFull, ring};

const COLUMNS: usize = 40;
const ROWS: usize = 4096;
const ROW: [f64; COLUMNS] = [1.25; COLUMNS];

fn main() {
    divan::main();
}

fn ends(when_full: WhenFull) -> (RingRecorder, RingReader) {
    let size = RingSize {
        rows: ROWS,
        events: 1,
    };
    ring(COLUMNS, size, when_full).expect("a ring of 4096 rows")
}

/// A channel whose pages are touched, as those of the ring are.
fn channel() -> (Sender<[f64; COLUMNS]>, Receiver<[f64; COLUMNS]>) {
    let (send, receive) = crossbeam_channel::bounded(ROWS);
    while send.try_send(ROW).is_ok() {}
    while receive.try_recv().is_ok() {}
    (send, receive)
}

#[divan::bench_group]
mod push {
    use super::*;

    #[divan::bench]
    fn rtrb_recorder(bencher: Bencher) {
        bencher
            .counter(ItemsCount::new(ROWS))
            .with_inputs(|| ends(WhenFull::Drop))
            .bench_local_values(|(mut recorder, reader)| {
                for _ in 0..ROWS {
                    black_box(recorder.row(black_box(&ROW)));
                }
                (recorder, reader)
            });
    }

    #[divan::bench]
    fn crossbeam_array(bencher: Bencher) {
        bencher
            .counter(ItemsCount::new(ROWS))
            .with_inputs(channel)
            .bench_local_values(|(send, receive)| {
                for _ in 0..ROWS {
                    black_box(send.try_send(black_box(ROW)).is_ok());
                }
                (send, receive)
            });
    }

    #[divan::bench]
    fn crossbeam_vec(bencher: Bencher) {
        bencher
            .counter(ItemsCount::new(ROWS))
            .with_inputs(|| crossbeam_channel::bounded::<Vec<f64>>(ROWS))
            .bench_local_values(|(send, receive)| {
                for _ in 0..ROWS {
                    black_box(send.try_send(black_box(&ROW).to_vec()).is_ok());
                }
                (send, receive)
            });
    }
}

#[divan::bench_group]
mod through {
    use super::*;

    #[divan::bench]
    fn rtrb_recorder(bencher: Bencher) {
        bencher
            .counter(ItemsCount::new(ROWS))
            .with_inputs(|| ends(WhenFull::Wait))
            .bench_local_values(|(mut recorder, mut reader)| {
                std::thread::scope(|scope| {
                    scope.spawn(move || {
                        for _ in 0..ROWS {
                            recorder.row(black_box(&ROW));
                        }
                    });
                    let mut left = ROWS;
                    while left > 0 {
                        match reader.row() {
                            Some(row) => {
                                black_box(row);
                                left -= 1;
                            }
                            None => std::thread::yield_now(),
                        }
                    }
                });
            });
    }

    #[divan::bench]
    fn crossbeam_array(bencher: Bencher) {
        bencher
            .counter(ItemsCount::new(ROWS))
            .with_inputs(channel)
            .bench_local_values(|(send, receive)| {
                std::thread::scope(|scope| {
                    scope.spawn(move || {
                        for _ in 0..ROWS {
                            black_box(send.send(black_box(ROW)).is_ok());
                        }
                    });
                    let mut left = ROWS;
                    while left > 0 {
                        match receive.try_recv() {
                            Ok(row) => {
                                black_box(row);
                                left -= 1;
                            }
                            Err(_) => std::thread::yield_now(),
                        }
                    }
                });
            });
    }
}

#[divan::bench]
fn read_back(bencher: Bencher) {
    let mut bytes = Vec::new();
    for sequence in 0..50_000 {
        encode(sequence, &ROW, &mut bytes);
    }
    bencher.counter(BytesCount::of_slice(&bytes)).bench(|| {
        let mut journal = Journal::new(black_box(&bytes[..]), COLUMNS);
        while let Ok(Some(row)) = journal.next_row() {
            black_box(row);
        }
        assert_eq!(journal.rows(), 50_000);
    });
}
