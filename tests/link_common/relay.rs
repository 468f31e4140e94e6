//! A seeded relay in user space: a bad network between the real program and its peers, over UDP and TCP, both directions.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use gusset_record::rt::os::{monotonic_ns, sleep_until_ns};

/// The fate of the pieces that pass. The first four are percentages.
#[derive(Debug, Clone, Copy, Default)]
pub struct Fates {
    /// UDP only, as the next two: TCP mends them.
    pub lost: u64,
    pub twice: u64,
    /// Held back until the next one has passed.
    pub overtaken: u64,
    /// One bit is turned.
    pub damaged: u64,
    /// UDP: its end is missing. TCP: it arrives in two parts.
    pub cut: u64,
    /// Every piece is delayed by this.
    pub delay_us: u64,
    /// The largest additional random delay. Datagrams overtake each other by it.
    pub jitter_us: u64,
    /// From the piece with the first number on, nothing passes for this number of milliseconds: UDP loses it, TCP keeps it.
    pub pulled: Option<(u64, u64)>,
    /// TCP: the connection ends at that piece, which arrives by half.
    pub broken: Option<u64>,
    /// The number of pieces that pass unharmed first.
    pub spared: u64,
}

/// Counts of the pieces of one direction by their fate.
#[derive(Debug, Default)]
pub struct Done {
    pub lost: AtomicU64,
    pub twice: AtomicU64,
    pub damaged: AtomicU64,
    pub overtaken: AtomicU64,
    pub cut: AtomicU64,
}

pub struct Relay {
    pub address: String,
    pub to_specimen: Arc<Done>,
    pub to_controller: Arc<Done>,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

/// Longest sleep: the stop flag is looked at as often.
const LOOK: Duration = Duration::from_millis(20);

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

/// One direction.
struct Pass {
    dice: Dice,
    fates: Fates,
    done: Arc<Done>,
    passed: u64,
    pulled_until: u64,
    held: Option<Vec<u8>>,
    /// Pieces on their way, and when they arrive.
    flying: VecDeque<(u64, Vec<u8>)>,
}

impl Pass {
    fn new(seed: u64, fates: Fates, done: &Arc<Done>) -> Self {
        Self {
            dice: Dice(seed),
            fates,
            done: Arc::clone(done),
            passed: 0,
            pulled_until: 0,
            held: None,
            flying: VecDeque::new(),
        }
    }

    fn fly(&mut self, piece: Vec<u8>, in_order: bool) {
        let jitter = self.dice.roll() % (self.fates.jitter_us + 1);
        let mut at = monotonic_ns() + 1000 * (self.fates.delay_us + jitter);
        if in_order {
            at = at.max(self.flying.back().map_or(0, |(at, _)| *at));
        }
        let place = self.flying.partition_point(|(other, _)| *other <= at);
        self.flying.insert(place, (at, piece));
    }

    fn arrived(&mut self) -> Option<Vec<u8>> {
        let (at, _) = self.flying.front()?;
        (*at <= monotonic_ns()).then(|| self.flying.pop_front().map(|(_, piece)| piece))?
    }

    /// Until there is something to do.
    fn pause(&self) {
        let until = self.flying.front().map_or(u64::MAX, |(at, _)| *at);
        sleep_until_ns(until.min(monotonic_ns() + 50_000));
    }

    fn is_pulled(&mut self) -> bool {
        if let Some((at, ms)) = self.fates.pulled
            && self.passed == at
        {
            self.fates.pulled = None;
            self.pulled_until = monotonic_ns() + 1_000_000 * ms;
        }
        monotonic_ns() < self.pulled_until
    }

    fn damage(&mut self, piece: &mut [u8]) {
        self.done.damaged.fetch_add(1, Ordering::Relaxed);
        let place = self.dice.roll();
        piece[(place % piece.len() as u64) as usize] ^= 1 << (place >> 61);
    }

    fn datagram(&mut self, mut piece: Vec<u8>) {
        let note = |counter: &AtomicU64| counter.fetch_add(1, Ordering::Relaxed);
        let pulled = self.is_pulled();
        self.passed += 1;
        if pulled {
            note(&self.done.lost);
            return;
        }
        if self.passed <= self.fates.spared {
            return self.fly(piece, false);
        }
        let Fates {
            lost,
            twice,
            damaged,
            overtaken,
            cut,
            ..
        } = self.fates;
        let fate = self.dice.roll() % 100;
        let mut bound = lost;
        if fate < bound {
            note(&self.done.lost);
            return;
        }
        if fate < bound + twice {
            note(&self.done.twice);
            self.fly(piece.clone(), false);
        }
        bound += twice;
        if (bound..bound + damaged).contains(&fate) {
            self.damage(&mut piece);
        }
        bound += damaged;
        if (bound..bound + overtaken).contains(&fate) && self.held.is_none() {
            note(&self.done.overtaken);
            self.held = Some(piece);
            return;
        }
        bound += overtaken;
        if (bound..bound + cut).contains(&fate) && piece.len() > 1 {
            note(&self.done.cut);
            let length = 1 + self.dice.roll() as usize % (piece.len() - 1);
            piece.truncate(length);
        }
        self.fly(piece, false);
        if let Some(late) = self.held.take() {
            self.fly(late, false);
        }
    }

    fn udp(mut self, from: &UdpSocket, to: &UdpSocket, stop: &AtomicBool) {
        let mut buffer = vec![0; 65_536];
        let mut quiet_since = monotonic_ns();
        while !stop.load(Ordering::Relaxed) {
            while let Some(piece) = self.arrived() {
                let _ = to.send(&piece);
            }
            if let Ok(count) = from.recv(&mut buffer) {
                self.datagram(buffer[..count].to_vec());
                quiet_since = monotonic_ns();
                continue;
            }
            // A pause: no later piece will overtake the held one.
            if monotonic_ns() > quiet_since + 20_000_000
                && let Some(late) = self.held.take()
            {
                self.fly(late, false);
            }
            self.pause();
        }
    }

    fn tcp(mut self, mut from: TcpStream, mut to: TcpStream, stop: &AtomicBool) {
        let mut buffer = vec![0; 65_536];
        while !stop.load(Ordering::Relaxed) {
            if !self.is_pulled() {
                while let Some(piece) = self.arrived() {
                    if write_all(&mut to, &piece, stop).is_err() {
                        return close(&from, &to);
                    }
                }
            }
            match from.read(&mut buffer) {
                Ok(0) => {
                    while let Some((_, piece)) = self.flying.pop_front() {
                        let _ = write_all(&mut to, &piece, stop);
                    }
                    return close(&from, &to);
                }
                Ok(count) => {
                    self.passed += 1;
                    let mut piece = buffer[..count].to_vec();
                    if self.fates.broken == Some(self.passed) {
                        let _ = write_all(&mut to, &piece[..count / 2], stop);
                        return close(&from, &to);
                    }
                    let fate = self.dice.roll() % 100;
                    if self.passed <= self.fates.spared {
                        self.fly(piece, true);
                    } else if fate < self.fates.damaged {
                        self.damage(&mut piece);
                        self.fly(piece, true);
                    } else if fate < self.fates.damaged + self.fates.cut {
                        self.done.cut.fetch_add(1, Ordering::Relaxed);
                        let rest = piece.split_off(self.dice.roll() as usize % piece.len());
                        self.fly(piece, true);
                        self.fly(rest, true);
                    } else {
                        self.fly(piece, true);
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => self.pause(),
                Err(_) => return close(&from, &to),
            }
        }
    }
}

fn write_all(to: &mut TcpStream, mut bytes: &[u8], stop: &AtomicBool) -> std::io::Result<()> {
    while !bytes.is_empty() && !stop.load(Ordering::Relaxed) {
        match to.write(bytes) {
            Ok(count) => bytes = &bytes[count..],
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                sleep_until_ns(monotonic_ns() + 50_000);
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn close(a: &TcpStream, b: &TcpStream) {
    let _ = a.shutdown(Shutdown::Both);
    let _ = b.shutdown(Shutdown::Both);
}

impl Relay {
    fn new(address: String) -> Self {
        Self {
            address,
            to_specimen: Arc::default(),
            to_controller: Arc::default(),
            stop: Arc::default(),
            threads: Vec::new(),
        }
    }

    /// Datagrams. The relay learns its controller from the first, which passes unharmed.
    pub fn start(specimen: &str, seed: u64, fates: Fates) -> Self {
        let near = UdpSocket::bind("127.0.0.1:0").unwrap();
        let far = UdpSocket::bind("127.0.0.1:0").unwrap();
        far.connect(specimen).unwrap();
        let mut relay = Self::new(near.local_addr().unwrap().to_string());
        near.set_read_timeout(Some(LOOK)).unwrap();
        far.set_nonblocking(true).unwrap();
        let forth = Pass::new(seed, fates, &relay.to_specimen);
        let back = Pass::new(!seed, fates, &relay.to_controller);
        let stop = Arc::clone(&relay.stop);
        relay.threads.push(std::thread::spawn(move || {
            let mut first = [0; 65_536];
            let (count, peer) = loop {
                match near.recv_from(&mut first) {
                    Ok(found) => break found,
                    Err(_) if stop.load(Ordering::Relaxed) => return,
                    Err(_) => {}
                }
            };
            near.connect(peer).unwrap();
            near.set_nonblocking(true).unwrap();
            far.send(&first[..count]).unwrap();
            std::thread::scope(|scope| {
                scope.spawn(|| back.udp(&far, &near, &stop));
                forth.udp(&near, &far, &stop);
            });
        }));
        relay
    }

    /// One connection.
    pub fn stream(specimen: &str, seed: u64, fates: Fates) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut relay = Self::new(listener.local_addr().unwrap().to_string());
        let forth = Pass::new(seed, fates, &relay.to_specimen);
        let back = Pass::new(!seed, fates, &relay.to_controller);
        let stop = Arc::clone(&relay.stop);
        let specimen = specimen.to_owned();
        listener.set_nonblocking(true).unwrap();
        relay.threads.push(std::thread::spawn(move || {
            let near = loop {
                match listener.accept() {
                    Ok((near, _)) => break near,
                    Err(_) if stop.load(Ordering::Relaxed) => return,
                    Err(_) => sleep_until_ns(monotonic_ns() + 1_000_000),
                }
            };
            let far = TcpStream::connect(specimen).unwrap();
            for end in [&near, &far] {
                end.set_nonblocking(true).unwrap();
                end.set_nodelay(true).unwrap();
            }
            let (near_2, far_2) = (near.try_clone().unwrap(), far.try_clone().unwrap());
            std::thread::scope(|scope| {
                scope.spawn(|| back.tcp(far_2, near_2, &stop));
                forth.tcp(near, far, &stop);
            });
        }));
        relay
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
