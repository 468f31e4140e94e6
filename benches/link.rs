//! Round trip of our protocol against a raw ping-pong of equally many bytes, in one process, busy-polling at both ends,
//! with a recorder's writer at work beside them.
//!
//! `cargo bench --bench link`. Both ends spin, each on its own processor, so the machine needs two free ones. The
//! writer shares the server's, as in a run. Every round measures all three in turn, so that a machine that slows down
//! slows all of them. The result is the median of the rounds' ratios.
//!
//! *raw*: plain non-blocking sockets without any check. *moved*: the same bytes through our transports. *ours*: commands
//! out and measurements in, encoded, checked and decoded at both ends, with a spring at the server.
#![allow(clippy::disallowed_macros, reason = "a measurement is printed")]

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use gusset_config::Carrier;
use gusset_link::secret::read_key;
use gusset_link::server::{Host, ServeOptions, Server};
use gusset_link::{NativeLink, NativeSetup, SocketOptions, Transport, Wait, socket};
use gusset_numerics::law::{LawSpec, LinearSpec};

use gusset_actuator::specimen::SpecimenLaw;
use gusset_quantity::substructure::{Command, Coupling, Measurement, Retirement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_record::rt::os::{monotonic_ns, process_cpus};
use gusset_record::writer::{Clocks, Writer, WriterSettings};
use gusset_record::{Recorder, RingRecorder, RingSize, WhenFull, ring};
use gusset_wire::Side;
use gusset_wire::handshake::{Axis, Limits, Sampling, Unit};
use gusset_wire::key::PreSharedKey;
use gusset_wire::native::{Decoder, Encoder, Frame, Moment};

const ROUNDS: usize = 7;
const EXCHANGES: usize = 20_000;
const WARM_UP: usize = 2_000;
const AXES: usize = 3;
/// One row per this number of exchanges: some ten thousand a second.
const ROW_EVERY: usize = 10;
/// Columns of a row, as in a test of three DOFs.
const COLUMNS: usize = 40;
const FOR_EVER: Nanos = Nanos(u64::MAX);

#[derive(Clone, Copy, PartialEq)]
enum End {
    Near,
    Far,
}

/// The loop's processor is the last one, as in a run; everything else is on the first.
fn pin(end: End) {
    // Read before anybody is pinned.
    static CPUS: OnceLock<Vec<usize>> = OnceLock::new();
    let cpus = CPUS.get_or_init(process_cpus);
    let chosen = match end {
        End::Near => cpus.last(),
        End::Far => cpus.first(),
    };
    if let Some(cpu) = chosen {
        let mut set = rustix::thread::CpuSet::new();
        set.set(*cpu);
        rustix::thread::sched_setaffinity(None, &set).unwrap();
    }
}

fn spinning() -> SocketOptions {
    SocketOptions {
        wait: Wait {
            spin_first_ns: u64::MAX,
            spin_last_ns: 0,
        },
        ..SocketOptions::default()
    }
}

fn main() {
    pin(End::Near);
    let folder = tempfile::tempdir().unwrap();
    let key_file = folder.path().join("key");
    std::fs::write(&key_file, [7; 32]).unwrap();
    // A key that others can read is refused.
    std::fs::set_permissions(
        &key_file,
        std::os::unix::fs::PermissionsExt::from_mode(0o600),
    )
    .unwrap();
    let key = read_key(&key_file).unwrap();
    let (mut recorder, reader) = ring(
        COLUMNS,
        RingSize::for_rate(COLUMNS, 1e4, 4.0),
        WhenFull::Drop,
    )
    .unwrap();
    let writer = std::thread::scope(|scope| {
        let spawn = || {
            pin(End::Far);
            let store = |name| std::fs::File::create(folder.path().join(name)).unwrap();
            let clocks = Clocks {
                monotonic_ns,
                utc_ns: monotonic_ns,
            };
            let settings = WriterSettings::default();
            let (samples, events) = (store("samples.bin"), store("events.jsonl"));
            Writer::spawn(reader, samples, events, None, clocks, settings, None).unwrap()
        };
        scope.spawn(spawn).join().unwrap()
    });
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    println!("{AXES} axes, {ROUNDS} rounds of {EXCHANGES} exchanges, medians in µs; load {load}");
    println!(
        "{:<11}{:>9}{:>9}{:>9}{:>9}{:>9}{:>12}{:>12}",
        "", "raw p50", "raw p99", "moved", "ours p50", "ours p99", "ours/raw", "ours/moved"
    );
    for (carrier, key) in [
        (Carrier::Tcp, None),
        (Carrier::Udp, None),
        (Carrier::Tcp, Some(&key)),
        (Carrier::Udp, Some(&key)),
    ] {
        let mut found = Vec::new();
        for _ in 0..ROUNDS {
            let raw = raw(carrier, key.is_some(), &mut recorder);
            let moved = moved(carrier, key.is_some(), &mut recorder);
            let ours = ours(carrier, key.cloned(), &mut recorder);
            found.push((raw, moved, ours));
        }
        let middle = |what: &dyn Fn(&(Times, Times, Times)) -> f64| {
            let mut all: Vec<f64> = found.iter().map(what).collect();
            all.sort_unstable_by(f64::total_cmp);
            all[all.len() / 2]
        };
        println!(
            "{:<11}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>12.2}{:>12.2}",
            format!("{carrier}{}", if key.is_some() { ", keyed" } else { "" }),
            middle(&|(raw, _, _)| raw.p50),
            middle(&|(raw, _, _)| raw.p99),
            middle(&|(_, moved, _)| moved.p50),
            middle(&|(_, _, ours)| ours.p50),
            middle(&|(_, _, ours)| ours.p99),
            middle(&|(raw, _, ours)| ours.p50 / raw.p50),
            middle(&|(_, moved, ours)| ours.p50 / moved.p50),
        );
    }
    print_parts();
    let recorded = writer.finish().unwrap();
    println!(
        "rows written meanwhile: {}, lost: {}",
        recorded.rows_written,
        recorded.rows_lost()
    );
}

/// Prints the parts of a round trip that need no socket: ns, medians.
fn print_parts() {
    let session = |side, from| {
        let encoder = Encoder::new(side, AXES, 7, None).unwrap();
        (encoder, Decoder::new(from, AXES, 7, None).unwrap())
    };
    let (mut near, mut near_in) = session(Side::Controller, Side::Specimen);
    let (mut far, mut far_in) = session(Side::Specimen, Side::Controller);
    let (mut frame, mut measured) = ([0; 1024], Measurement::zeros(AXES));
    let (mut disp, mut vel) = ([1e-3; AXES], [0.0; AXES]);
    let codec = nanoseconds(|sequence| {
        let (time, dt) = (sequence as f64 * 1e-3, 1e-3);
        let command = Command {
            sequence,
            time,
            dt,
            disp: &[1e-3; AXES],
            vel: &[0.0; AXES],
        };
        let length = near.command(&command, &mut frame).unwrap();
        let received = far_in.open(&frame[..length]).unwrap();
        if let Frame::Command(command) = received.frame {
            command.read(&mut disp, &mut vel).unwrap();
        }
        measured.sequence = sequence;
        let length = far
            .measurement(&measured, Moment::default(), &mut frame)
            .unwrap();
        let received = near_in.open(&frame[..length]).unwrap();
        if let Frame::Measurement(found) = received.frame {
            found.read(&mut measured).unwrap();
        }
    });
    let (there, back) = lengths(false);
    let bytes = vec![3; back];
    let checksums = nanoseconds(|_| {
        for length in [there, there, back, back] {
            std::hint::black_box(crc32fast::hash(std::hint::black_box(&bytes[..length])));
        }
    });
    let clock = nanoseconds(|_| {
        std::hint::black_box(monotonic_ns());
    });
    println!(
        "of a round trip: codec at both ends {codec:.0} ns, of it checksums {checksums:.0} ns; one clock reading {clock:.0} ns"
    );
}

/// Median over rounds of the mean time of a call, in ns.
fn nanoseconds(mut call: impl FnMut(u64)) -> f64 {
    let (mut sequence, mut rounds) = (0, Vec::new());
    for _ in 0..ROUNDS {
        let begun = monotonic_ns();
        for _ in 0..EXCHANGES {
            call(sequence);
            sequence += 1;
        }
        rounds.push((monotonic_ns() - begun) as f64 / EXCHANGES as f64);
    }
    rounds.sort_unstable_by(f64::total_cmp);
    rounds[ROUNDS / 2]
}

/// In µs.
struct Times {
    p50: f64,
    p99: f64,
}

fn measure(recorder: &mut RingRecorder, mut exchange: impl FnMut(u64)) -> Times {
    let mut times = Vec::with_capacity(EXCHANGES);
    for sequence in 0..(WARM_UP + EXCHANGES) {
        let begun = monotonic_ns();
        exchange(sequence as u64);
        if sequence >= WARM_UP {
            times.push(monotonic_ns() - begun);
        }
        if sequence % ROW_EVERY == 0 {
            recorder.row(&[1.0; COLUMNS]);
        }
    }
    times.sort_unstable();
    let percentile = |percent: usize| times[times.len() * percent / 100] as f64 * 1e-3;
    Times {
        p50: percentile(50),
        p99: percentile(99),
    }
}

fn lengths(keyed: bool) -> (usize, usize) {
    // Words of the header, of what stands before the vectors, and of the vectors.
    let (command, measurement) = (4 + 3 + 2 * AXES, 4 + 4 + 2 * AXES + 4 * (1 + AXES));
    let trailer = if keyed { 20 } else { 4 };
    (8 * command + trailer, 8 * measurement + trailer)
}

/// Nothing but the system's calls.
trait Bare: Send {
    fn write(&mut self, bytes: &[u8]);
    /// None when the other end is gone.
    fn read(&mut self, bytes: &mut [u8]) -> Option<usize>;
}

fn spin(mut attempt: impl FnMut() -> std::io::Result<usize>) -> Option<usize> {
    loop {
        match attempt() {
            // A datagram of one byte ends an echo; a stream ends with nothing.
            Ok(0 | 1) => return None,
            Ok(count) => return Some(count),
            Err(error) if error.kind() == ErrorKind::WouldBlock => std::hint::spin_loop(),
            Err(_) => return None,
        }
    }
}

impl Bare for TcpStream {
    fn write(&mut self, bytes: &[u8]) {
        self.write_all(bytes).unwrap();
    }

    fn read(&mut self, bytes: &mut [u8]) -> Option<usize> {
        spin(|| Read::read(self, bytes))
    }
}

impl Bare for UdpSocket {
    fn write(&mut self, bytes: &[u8]) {
        self.send(bytes).unwrap();
    }

    fn read(&mut self, bytes: &mut [u8]) -> Option<usize> {
        spin(|| self.recv(bytes))
    }
}

fn tcp_pair() -> (TcpStream, TcpStream) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let near = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    (near, listener.accept().unwrap().0)
}

fn udp_pair() -> (UdpSocket, UdpSocket) {
    let [a, b] = [0; 2].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
    a.connect(b.local_addr().unwrap()).unwrap();
    b.connect(a.local_addr().unwrap()).unwrap();
    (a, b)
}

/// As many bytes as a command one way, as a measurement the other; nothing is checked.
fn raw(carrier: Carrier, keyed: bool, recorder: &mut RingRecorder) -> Times {
    let (near, far): (Box<dyn Bare>, Box<dyn Bare>) = match carrier {
        Carrier::Tcp | Carrier::Tls => {
            let (near, far) = tcp_pair();
            for stream in [&near, &far] {
                stream.set_nodelay(true).unwrap();
                stream.set_nonblocking(true).unwrap();
            }
            (Box::new(near), Box::new(far))
        }
        Carrier::Udp => {
            let (near, far) = udp_pair();
            for socket in [&near, &far] {
                socket.set_nonblocking(true).unwrap();
            }
            (Box::new(near), Box::new(far))
        }
    };
    ping_pong(keyed, recorder, near, far)
}

impl Bare for Box<dyn Transport> {
    fn write(&mut self, bytes: &[u8]) {
        self.send(bytes).unwrap();
    }

    fn read(&mut self, bytes: &mut [u8]) -> Option<usize> {
        match self.recv(bytes, FOR_EVER) {
            Ok(Some(1)) | Ok(None) | Err(_) => None,
            Ok(Some(count)) => Some(count),
        }
    }
}

/// Round trips through our transports.
fn moved(carrier: Carrier, keyed: bool, recorder: &mut RingRecorder) -> Times {
    let [near, far] = match carrier {
        Carrier::Tcp | Carrier::Tls => socket::tcp_pair(spinning()).unwrap(),
        Carrier::Udp => socket::udp_pair(spinning()).unwrap(),
    };
    ping_pong(keyed, recorder, Box::new(near), Box::new(far))
}

fn ping_pong(
    keyed: bool,
    recorder: &mut RingRecorder,
    mut near: Box<dyn Bare>,
    mut far: Box<dyn Bare>,
) -> Times {
    let (there, back) = lengths(keyed);
    let (command, answer) = (vec![1; there], vec![2; back]);
    let echo = std::thread::spawn(move || {
        pin(End::Far);
        while whole(far.as_mut(), there) {
            far.write(&answer);
        }
    });
    let times = measure(recorder, |_| {
        near.write(&command);
        assert!(whole(near.as_mut(), back));
    });
    near.write(&[0]);
    drop(near);
    echo.join().unwrap();
    times
}

fn whole(end: &mut dyn Bare, length: usize) -> bool {
    let mut buffer = [0; 4096];
    let mut found = 0;
    while found < length {
        match end.read(&mut buffer) {
            None => return false,
            Some(count) => found += count,
        }
    }
    true
}

fn axes() -> Vec<Axis> {
    (1..=AXES)
        .map(|j| Axis {
            name: format!("axis {j}"),
            disp_unit: Unit::Metre,
            force_unit: Unit::Newton,
            limits: Limits::NONE,
        })
        .collect()
}

fn ours(carrier: Carrier, key: Option<PreSharedKey>, recorder: &mut RingRecorder) -> Times {
    let law = SpecimenLaw::Law(LawSpec::Linear(LinearSpec {
        stiffness_n_per_m: 1e6,
        damping_n_s_per_m: 0.0,
    }));
    let build = move || law.build(AXES).map_err(|error| error.to_string());
    let options = ServeOptions {
        listen: "127.0.0.1:0".into(),
        carrier,
        key: key.clone(),
        plan: None,
        // Longer than any period here: it never sleeps while commands come.
        spin_ns: 1_000_000_000,
    };
    let host = Host::new("springs".into(), axes(), Box::new(build)).unwrap();
    let server = Server::bind(host, options).unwrap();
    let address = server.local_addr();
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let thread = std::thread::spawn(move || {
        // The server's threads inherit it.
        pin(End::Far);
        let stopped = || stopped.load(Ordering::Relaxed);
        server.run(&stopped, &mut |_| {}).unwrap();
    });
    let mut link = NativeLink::new(NativeSetup {
        address: address.to_string(),
        carrier,
        key,
        test: "bench".into(),
        axes: axes(),
        rate: (1000, 1),
        watchdog_s: 20.0,
        sampling: Sampling::Reply,
        coupling: Coupling::Sampled,
        connect_limit: Duration::from_secs(5),
        reply_timeout: Duration::from_secs(5),
        options: spinning(),
    });
    link.connect().unwrap();
    link.arm(0, &[0.0; AXES], &mut || true).unwrap();
    let mut measured = Measurement::zeros(AXES);
    let times = measure(recorder, |sequence| {
        let command = Command {
            sequence,
            time: sequence as f64 * 1e-3,
            dt: 1e-3,
            disp: &[1e-3; AXES],
            vel: &[0.0; AXES],
        };
        link.issue(&command).unwrap();
        link.collect(FOR_EVER, &mut measured).unwrap();
    });
    link.retire(Retirement::Orderly);
    stop.store(true, Ordering::Relaxed);
    thread.join().unwrap();
    times
}
