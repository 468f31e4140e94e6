//! A seeded relay for UDP that loses, repeats, damages and overtakes datagrams in both directions.

use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Datagrams of a hundred that suffer each fate.
#[derive(Debug, Clone, Copy, Default)]
pub struct Fates {
    pub lost: u64,
    pub twice: u64,
    pub damaged: u64,
    /// Held back until the next one has passed.
    pub overtaken: u64,
}

/// What was done to the datagrams of one direction.
#[derive(Debug, Default)]
pub struct Done {
    pub lost: AtomicU64,
    pub twice: AtomicU64,
    pub damaged: AtomicU64,
    pub overtaken: AtomicU64,
}

pub struct Relay {
    pub address: String,
    pub to_specimen: Arc<Done>,
    pub to_controller: Arc<Done>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

/// Steele, Lea, Flood 2014: splitmix64.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

impl Relay {
    pub fn start(specimen: &str, seed: u64, fates: Fates) -> Self {
        let near = UdpSocket::bind("127.0.0.1:0").unwrap();
        let far = UdpSocket::bind("127.0.0.1:0").unwrap();
        far.connect(specimen).unwrap();
        let address = near.local_addr().unwrap().to_string();
        let stop = Arc::new(AtomicBool::new(false));
        let (to_specimen, to_controller) = (Arc::new(Done::default()), Arc::new(Done::default()));
        for socket in [&near, &far] {
            socket
                .set_read_timeout(Some(Duration::from_millis(20)))
                .unwrap();
        }
        // The near socket learns its peer from the first datagram, which passes unharmed.
        let mut first = [0; 65_536];
        let (near_2, far_2) = (near.try_clone().unwrap(), far.try_clone().unwrap());
        let (stop_1, stop_2) = (Arc::clone(&stop), Arc::clone(&stop));
        let (done_1, done_2) = (Arc::clone(&to_specimen), Arc::clone(&to_controller));
        let met = Arc::new(AtomicBool::new(false));
        let met_2 = Arc::clone(&met);
        let forth = std::thread::spawn(move || {
            while !stop_1.load(Ordering::Relaxed) {
                if let Ok((count, peer)) = near.recv_from(&mut first) {
                    near.connect(peer).unwrap();
                    far.send(&first[..count]).unwrap();
                    met.store(true, Ordering::Release);
                    break;
                }
            }
            pass(&near, &far, Dice(seed), fates, &done_1, &stop_1);
        });
        let back = std::thread::spawn(move || {
            while !met_2.load(Ordering::Acquire) && !stop_2.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            pass(&far_2, &near_2, Dice(!seed), fates, &done_2, &stop_2);
        });
        Self {
            address,
            to_specimen,
            to_controller,
            stop,
            threads: vec![forth, back],
        }
    }

    /// Ends it, so that the counts stand.
    pub fn stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            thread.join().unwrap();
        }
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        self.stop();
    }
}

fn pass(
    from: &UdpSocket,
    to: &UdpSocket,
    mut dice: Dice,
    fates: Fates,
    done: &Done,
    stop: &AtomicBool,
) {
    let mut buffer = [0; 65_536];
    let mut held: Option<Vec<u8>> = None;
    while !stop.load(Ordering::Relaxed) {
        let Ok(count) = from.recv(&mut buffer) else {
            // A quiet moment: nothing will overtake what is held.
            if let Some(late) = held.take() {
                let _ = to.send(&late);
            }
            continue;
        };
        let (fate, place) = (dice.roll() % 100, dice.roll());
        let datagram = &mut buffer[..count];
        let note = |counter: &AtomicU64| counter.fetch_add(1, Ordering::Relaxed);
        let mut bound = fates.lost;
        if fate < bound {
            note(&done.lost);
            continue;
        }
        bound += fates.twice;
        if fate < bound {
            note(&done.twice);
            let _ = to.send(datagram);
        } else if fate < bound + fates.damaged {
            note(&done.damaged);
            datagram[(place % count as u64) as usize] ^= 1 << (place >> 61);
        } else if fate < bound + fates.damaged + fates.overtaken && held.is_none() {
            note(&done.overtaken);
            held = Some(datagram.to_vec());
            continue;
        }
        let _ = to.send(datagram);
        if let Some(late) = held.take() {
            let _ = to.send(&late);
        }
    }
}
