//! Cost of a bus: an exchange over a pair of network interfaces, the start, and our share of a tick.
//!
//! `cargo bench --bench bus`, as root or where the kernel gives namespaces (it starts itself again by `unshare`). Medians of one run:
//!
//! - *exchange*: from the send to the inputs, with a peer that spins, and with one that sleeps until a frame comes. Each of the two
//!   has a processor, and the priority of a loop where the system grants it;
//! - *start*: from the first frame to OP of four devices;
//! - *share*: one tick with ten drives, without the devices: they answer from a copy.
#![allow(clippy::disallowed_macros, reason = "a measurement is printed")]

use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use gusset_ethercat::line::{Line, LineFault};
use gusset_ethercat::plan::{BusPlan, DevicePlan, DrivePlan, TimeSource};
use gusset_ethercat::simulated::{SimulatedBus, SimulatedLine};
use gusset_ethercat::{Bus, bring_up};
use gusset_quantity::time::{Nanos, SimClock};
use gusset_record::rt::packet::PacketSocket;
use gusset_record::rt::{Granted, RtPlan, apply, os};
use gusset_setup::open_bus_line;

const SOURCE: [u8; 6] = [0x10, 1, 2, 3, 4, 5];
const TICKS: usize = 20_000;

fn plan(drives: usize) -> BusPlan {
    let entries = |texts: &[&str]| texts.iter().map(|text| text.parse().unwrap()).collect();
    let device = |name: &str, code, outputs: &[&str], inputs: &[&str]| DevicePlan {
        name: name.to_owned(),
        vendor: 2,
        code,
        revision: None,
        outputs: entries(outputs),
        inputs: entries(inputs),
        assign: false,
        setup: Vec::new(),
        drive: None,
    };
    let mut devices = vec![
        device("coupler", 1, &[], &[]),
        device("cell", 2, &[], &["6000:01 u16", "6000:11 i16"]),
        device("servo", 3, &["7000:01 i16"], &[]),
    ];
    for number in 0..drives {
        let outputs = ["6040:00 u16", "607a:00 i32"];
        let inputs = ["6041:00 u16", "6064:00 i32"];
        let mut drive = device(&format!("axis {number}"), 4, &outputs, &inputs);
        drive.drive = Some(DrivePlan {
            counts_per_unit: 1e6,
            accel: 10.0,
            following_counts: None,
            accepts_free_stop: false,
        });
        devices.push(drive);
    }
    BusPlan {
        name: "rig".to_owned(),
        devices,
        period_ns: 1_000_000,
        time: TimeSource::Bus,
        watchdog_ns: 1_000_000_000,
        sample_after_ns: None,
        patience_ns: 5_000_000_000,
        stale_ticks: 3,
    }
}

/// A line that answers each frame with a copy of an earlier answer.
struct Copying {
    below: SimulatedLine,
    answer: Vec<u8>,
    copies: Arc<AtomicBool>,
    index: u8,
}

impl Line for Copying {
    fn now(&self) -> Nanos {
        Nanos(os::monotonic_ns())
    }
    fn wait_until(&mut self, at: Nanos) {
        self.below.wait_until(at);
    }
    fn send(&mut self, frame: &[u8]) -> Result<(), LineFault> {
        self.index = frame[17];
        if self.copies.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.below.send(frame)
    }
    fn receive(&mut self, buffer: &mut [u8], deadline: Nanos) -> Result<Option<usize>, LineFault> {
        if self.copies.load(Ordering::Relaxed) {
            let length = self.answer.len();
            buffer[..length].copy_from_slice(&self.answer);
            buffer[17] = self.index;
            return Ok(Some(length));
        }
        let received = self.below.receive(buffer, deadline)?;
        if let Some(length) = received {
            self.answer = buffer[..length].to_vec();
        }
        Ok(received)
    }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn time_exchanges(bus: &mut Bus, ticks: usize) -> f64 {
    // Ticks in which the system stopped one of the two threads have no exchange.
    let times = (0..ticks).filter_map(|_| {
        let began = os::monotonic_ns();
        let is_valid = bus.exchange();
        is_valid.then(|| 1e-3 * (os::monotonic_ns() - began) as f64)
    });
    median(times.collect())
}

fn share() {
    let plan = plan(10);
    let devices = SimulatedBus::new(&plan, Vec::new(), Vec::new()).unwrap();
    let below = SimulatedLine::new(
        Arc::new(std::sync::Mutex::new(devices)),
        Box::new(SimClock::new()),
    );
    let copies = Arc::new(AtomicBool::new(false));
    let line = Copying {
        below,
        answer: Vec::new(),
        copies: Arc::clone(&copies),
        index: 0,
    };
    let mut bus = bring_up(Box::new(line), plan, SOURCE).unwrap();
    bus.exchange();
    copies.store(true, Ordering::Relaxed);
    println!(
        "share, 10 drives: {:.2} µs a tick",
        time_exchanges(&mut bus, TICKS)
    );
}

/// The conditions of a loop's thread for the calling one, on this processor.
fn bind_to(processor: usize) -> Granted {
    apply(&RtPlan {
        fifo_priority: Some(80),
        cpu: Some(processor),
        lock_memory: false,
        hold_cpu_awake: true,
        spin_ns: 0,
        period_ns: 1_000_000,
        require: false,
    })
}

fn over_a_pair(near: &str, far: &str, spins: bool) {
    let over = Arc::new(AtomicBool::new(false));
    let is_over = Arc::clone(&over);
    let socket = PacketSocket::open(far).unwrap();
    let plan = plan(1);
    let mut devices = SimulatedBus::new(&plan, Vec::new(), Vec::new()).unwrap();
    let peer = std::thread::spawn(move || {
        let _awake = bind_to(0);
        let mut frame = [0; 1514];
        while !is_over.load(Ordering::Relaxed) {
            // A deadline in the past spins; a far one sleeps.
            let deadline = if spins {
                Nanos(0)
            } else {
                Nanos(os::monotonic_ns() + 20_000_000)
            };
            if let Ok(Some(length)) = socket.receive(&mut frame, deadline) {
                devices.process(&mut frame[..length], os::monotonic_ns());
                let _ = socket.send(&frame[..length]);
            }
        }
    });
    let began = os::monotonic_ns();
    let line = open_bus_line(near).unwrap();
    let mut bus = bring_up(line, plan, SOURCE).unwrap();
    bus.to_op().unwrap();
    let start = 1e-6 * (os::monotonic_ns() - began) as f64;
    let exchange = time_exchanges(&mut bus, TICKS);
    let peer_does = if spins { "spins" } else { "sleeps" };
    println!("pair, the peer {peer_does}: start to OP {start:.1} ms, exchange {exchange:.1} µs");
    over.store(true, Ordering::Relaxed);
    peer.join().unwrap();
}

fn main() {
    if std::env::var_os("GUSSET_BUS_BENCH").is_none() {
        share();
        let how = if rustix::process::geteuid().is_root() {
            "-n"
        } else {
            "-Urn"
        };
        let program = std::env::current_exe().unwrap();
        let mut again = Command::new("unshare");
        again
            .args([how, "--"])
            .arg(program)
            .env("GUSSET_BUS_BENCH", "1");
        let done = again.status().is_ok_and(|status| status.success());
        assert!(done, "this kernel gives no network namespace");
        return;
    }
    for words in [
        "link add near type veth peer name far",
        "link set near up",
        "link set far up",
    ] {
        assert!(
            Command::new("ip")
                .args(words.split(' '))
                .status()
                .unwrap()
                .success()
        );
    }
    let _awake = bind_to(1);
    over_a_pair("near", "far", true);
    over_a_pair("near", "far", false);
}
