//! Round trip of our own protocol against a raw ping-pong of the same bytes, in one process, busy-polling at both ends.
//!
//! `cargo bench --bench link`. Both ends spin, so the machine needs two free processors. The ratio is what counts: the
//! absolute times are those of the machine.
#![allow(clippy::disallowed_macros, reason = "a measurement is printed")]

use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::time::Duration;

use gusset::law::{LawSpec, LinearSpec};
use gusset::link::native::unlimited_axis;
use gusset::link::serve::{Host, ServeOptions, Server};
use gusset::link::{
    Carrier, NativeLink, NativeSetup, SocketOptions, TcpTransport, Transport, UdpTransport, Wait,
};
use gusset::rt::os::monotonic_ns;
use gusset::specimen::SpecimenLaw;
use gusset::substructure::{Command, Coupling, Measurement, Retirement, Substructure};
use gusset::time::Nanos;
use gusset::wire::handshake::{Axis, Sampling, Unit};
use gusset::wire::native::{Kind, frame_len};

const EXCHANGES: usize = 20_000;
const WARM_UP: usize = 2_000;
const AXES: usize = 3;
const FOR_EVER: Nanos = Nanos(u64::MAX);

fn spinning() -> SocketOptions {
    SocketOptions {
        wait: Wait::SPIN,
        ..SocketOptions::default()
    }
}

fn main() {
    println!("{AXES} axes, {EXCHANGES} exchanges, µs");
    println!(
        "{:<6}{:>10}{:>10}{:>10}{:>10}{:>8}",
        "", "raw p50", "raw p99", "ours p50", "ours p99", "ratio"
    );
    for carrier in [Carrier::Tcp, Carrier::Udp] {
        let raw = raw(carrier);
        let ours = ours(carrier);
        println!(
            "{:<6}{:>10.2}{:>10.2}{:>10.2}{:>10.2}{:>8.2}",
            carrier.to_string(),
            percentile(&raw, 50),
            percentile(&raw, 99),
            percentile(&ours, 50),
            percentile(&ours, 99),
            percentile(&ours, 50) / percentile(&raw, 50)
        );
    }
}

fn percentile(sorted: &[u64], percent: usize) -> f64 {
    sorted[sorted.len() * percent / 100] as f64 * 1e-3
}

fn measure(mut exchange: impl FnMut(u64)) -> Vec<u64> {
    let mut times = Vec::with_capacity(EXCHANGES);
    for sequence in 0..(WARM_UP + EXCHANGES) {
        let begun = monotonic_ns();
        exchange(sequence as u64);
        if sequence >= WARM_UP {
            times.push(monotonic_ns() - begun);
        }
    }
    times.sort_unstable();
    times
}

/// As many bytes as a command one way, as a measurement the other; nothing is looked at.
fn raw(carrier: Carrier) -> Vec<u64> {
    let (near, far): (Box<dyn Transport>, Box<dyn Transport>) = match carrier {
        Carrier::Tcp | Carrier::Tls => {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let address = listener.local_addr().unwrap().to_string();
            let near = TcpTransport::connect(&address, Duration::from_secs(5), spinning()).unwrap();
            let far = TcpTransport::from_stream(listener.accept().unwrap().0, spinning()).unwrap();
            (Box::new(near), Box::new(far))
        }
        Carrier::Udp => {
            let [a, b] = [0; 2].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
            a.connect(b.local_addr().unwrap()).unwrap();
            b.connect(a.local_addr().unwrap()).unwrap();
            let near = UdpTransport::from_socket(a, spinning()).unwrap();
            let far = UdpTransport::from_socket(b, spinning()).unwrap();
            (Box::new(near), Box::new(far))
        }
    };
    let command = vec![1; frame_len(Kind::Command, AXES, false)];
    let answer = vec![2; frame_len(Kind::Measurement, AXES, false)];
    let (there, back) = (command.len(), answer.len());
    let echo = std::thread::spawn(move || {
        let mut far = far;
        while whole(far.as_mut(), there) {
            if far.send(&answer).is_err() {
                break;
            }
        }
    });
    let mut near = near;
    let times = measure(|_| {
        near.send(&command).unwrap();
        assert!(whole(near.as_mut(), back));
    });
    if carrier == Carrier::Udp {
        // A datagram has no end of stream: this one is shorter, and ends the echo.
        near.send(&[0]).unwrap();
    }
    drop(near);
    echo.join().unwrap();
    times
}

fn whole(transport: &mut dyn Transport, length: usize) -> bool {
    let mut buffer = [0; 4096];
    let mut found = 0;
    while found < length {
        match transport.recv(&mut buffer, FOR_EVER) {
            Ok(Some(1)) | Ok(None) | Err(_) => return false,
            Ok(Some(count)) => found += count,
        }
    }
    true
}

fn axes() -> Vec<Axis> {
    (1..=AXES)
        .map(|j| unlimited_axis(format!("axis {j}"), Unit::Metre, Unit::Newton))
        .collect()
}

fn ours(carrier: Carrier) -> Vec<u64> {
    let law = SpecimenLaw::Law(LawSpec::Linear(LinearSpec {
        stiffness_n_per_m: 1e6,
        damping_n_s_per_m: 0.0,
    }));
    let build = move || law.build(AXES).map_err(|error| error.to_string());
    let options = ServeOptions {
        listen: "127.0.0.1:0".into(),
        carrier,
        key: None,
        plan: None,
        // Longer than any period here: it never sleeps while commands come.
        spin_ns: 1_000_000_000,
    };
    let host = Host::new("springs".into(), axes(), Box::new(build)).unwrap();
    let server = Server::bind(host, options).unwrap();
    let address: SocketAddr = server.local_addr();
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let thread = std::thread::spawn(move || {
        let until = async {
            let _ = stopped.await;
        };
        server.run(until, &mut |_| {}).unwrap();
    });
    let mut link = NativeLink::new(NativeSetup {
        address: address.to_string(),
        carrier,
        key: None,
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
    link.arm(0, &[0.0; AXES]).unwrap();
    let mut measured = Measurement::zeros(AXES);
    let times = measure(|sequence| {
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
    let _ = stop.send(());
    thread.join().unwrap();
    times
}
