//! `gusset bus`: the devices of an EtherCAT bus, real and simulated.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::Context as _;
use gusset_config::{BusTable, TimingSpec};
use gusset_ethercat::simulated::{Fault, FaultScript, Passage, SimulatedBus};
use gusset_ethercat::{BusError, Found, reset_faults, scan};
use gusset_quantity::time::Nanos;
use gusset_record::rt::packet::PacketSocket;
use gusset_record::rt::{RtPlan, apply, os};
use gusset_session::{Signals, pause};
use gusset_setup::{bus_of, bus_source, open_bus_line, rt_plan, simulated_bus};

use super::args::{BusCommand, BusResetArgs, ScanArgs, SimulateArgs};
use super::exit::{Exit, WithExit};
use super::test_file::{load, refused};
use super::{answer, tell};

/// The far end of the pair that `--pair` makes.
const FAR_END: &str = "gusset-sim";
/// Time between two looks for the end of a simulation.
const LOOK_NS: u64 = 20_000_000;
/// Set for the process inside the separate network.
const INSIDE: &str = "GUSSET_BUS_INSIDE";

/// Runs one of the commands.
pub fn bus(command: &BusCommand) -> anyhow::Result<Exit> {
    match command {
        BusCommand::Scan(args) => scan_bus(args),
        BusCommand::Simulate(args) => simulate(args),
        BusCommand::Reset(args) => reset(args),
    }
}

/// An interface that cannot be used is wrong usage; devices that do not answer are a fault of the link.
fn failed(error: &BusError) -> anyhow::Error {
    let exit = match error {
        BusError::Interface(_)
        | BusError::Identity { .. }
        | BusError::Count { .. }
        | BusError::InOperation { .. }
        | BusError::Mapping { .. } => Exit::Usage,
        _ => Exit::Link,
    };
    WithExit(exit, error.to_string()).into()
}

fn scan_bus(args: &ScanArgs) -> anyhow::Result<Exit> {
    let mut line = open_bus_line(&args.interface).map_err(|error| failed(&error))?;
    let found = scan(line.as_mut(), bus_source(), args.release).map_err(|error| failed(&error))?;
    answer(table(&args.interface, &found))?;
    Ok(Exit::Done)
}

/// The tables of a test file.
fn table(interface: &str, found: &[Found]) -> String {
    let mut text = format!("[bus.rig]\ninterface = {interface:?}\n");
    for (number, device) in (1..).zip(found) {
        let [vendor, code, revision] = device.identity;
        let state = device.state.map_or("unknown", |state| state.name());
        let name = match device.name.as_str() {
            "" => format!("device {number}"),
            name => format!("{} {number}", name.replace('.', " ")),
        };
        let _ = write!(
            text,
            "\n[[bus.rig.device]] # position {number}, found in {state}\nname = {name:?}\n\
             product = {{ vendor = {vendor:#x}, code = {code:#010x}, revision = {revision:#010x} }}\n"
        );
        for (key, entries) in [("outputs", &device.outputs), ("inputs", &device.inputs)] {
            if entries.is_empty() {
                continue;
            }
            let each = entries
                .iter()
                .map(|entry| format!("    {:?},\n", entry.to_string()));
            let _ = write!(text, "{key} = [\n{}]\n", each.collect::<String>());
        }
        if let Some(remark) = &device.remark {
            let _ = writeln!(text, "# {remark}");
        }
    }
    text.pop();
    text
}

fn reset(args: &BusResetArgs) -> anyhow::Result<Exit> {
    let loaded = load(&args.test, &[])?;
    let (plan, interface) = bus_of(&loaded).map_err(refused)?;
    let mut line = open_bus_line(&interface).map_err(|error| failed(&error))?;
    let reset = reset_faults(line.as_mut(), &plan, bus_source()).map_err(|error| failed(&error))?;
    let told = match reset.as_slice() {
        [] => "no drive has a fault".to_owned(),
        names => format!("faults were reset: {}", names.join(", ")),
    };
    answer(told)?;
    Ok(Exit::Done)
}

fn simulate(args: &SimulateArgs) -> anyhow::Result<Exit> {
    // Inside, the pair is there; outside, the process begins again in a separate network.
    let is_inside = std::env::var_os(INSIDE).is_some();
    if args.pair && !is_inside {
        return begin_again();
    }
    let faults = match &args.faults {
        Some(file) => read_faults(file)?,
        None => Vec::new(),
    };
    let mut sets = args.sets.clone();
    sets.push("time.clock=\"simulated\"".to_owned());
    let loaded = load(&args.test, &sets)?;
    let mut bus = simulated_bus(&loaded, faults).map_err(refused)?;
    if !args.pair {
        let name = args.interface.as_deref().unwrap_or_default();
        let socket = open(name)?;
        tell(format_args!(
            "simulated devices answer on {name}, until Ctrl-C"
        ));
        let signals = Signals::listen()?;
        take_a_processor();
        serve(&mut bus, &socket, || signals.seen().is_some())?;
        return Ok(Exit::Done);
    }
    let near = loaded
        .file
        .bus
        .values()
        .next()
        .map(|bus: &BusTable| bus.interface.clone());
    let near = near.context("this file has no `[bus.NAME]`")?;
    make_pair(&near)?;
    let socket = open(FAR_END)?;
    // Ctrl-C reaches the command, too: the devices answer until it has ended.
    let _signals = Signals::listen()?;
    let mut child = ours(&args.command)
        .spawn()
        .context("the command cannot be started")?;
    // The command has begun, and keeps all processors.
    take_a_processor();
    let mut ended = None;
    serve(&mut bus, &socket, || {
        ended = child.try_wait().ok().flatten();
        ended.is_some()
    })?;
    Ok(exit_of(ended.and_then(|status| status.code())))
}

/// The exit code of a command as our own.
fn exit_of(code: Option<i32>) -> Exit {
    let known = [
        Exit::Done,
        Exit::Usage,
        Exit::Link,
        Exit::NoRealTime,
        Exit::Panic,
        Exit::Interrupted,
        Exit::Terminated,
    ];
    let mut known = known.into_iter();
    let found = known.find(|exit| code == Some(i32::from(exit.code())));
    found.unwrap_or(Exit::Stopped)
}

fn open(interface: &str) -> anyhow::Result<PacketSocket> {
    let socket = PacketSocket::open(interface);
    socket.map_err(|error| WithExit(Exit::Usage, error.to_string()).into())
}

fn read_faults(file: &Path) -> anyhow::Result<Vec<Fault>> {
    let text = std::fs::read_to_string(file);
    let text = text.with_context(|| format!("{} cannot be read", file.display()))?;
    let script: Result<FaultScript, _> = toml::from_str(&text);
    let script = script.with_context(|| format!("{} is no fault script", file.display()))?;
    Ok(script.fault)
}

/// The devices answer from the first processor: the loop of a test takes the last one.
fn take_a_processor() {
    let plan = rt_plan(&TimingSpec::default(), LOOK_NS);
    if let [first, _, ..] = os::process_cpus().as_slice() {
        let _ = apply(&RtPlan {
            cpu: Some(*first),
            ..plan
        });
    }
}

/// Answers frames until `is_over`. A late frame waits in its turn.
fn serve(
    bus: &mut SimulatedBus,
    socket: &PacketSocket,
    mut is_over: impl FnMut() -> bool,
) -> anyhow::Result<()> {
    let mut frame = [0u8; 1514];
    let mut look_at = Nanos(0);
    loop {
        let now = Nanos(os::monotonic_ns());
        if now >= look_at {
            if is_over() {
                return Ok(());
            }
            look_at = now.plus(LOOK_NS);
        }
        let Some(length) = socket.receive(&mut frame, look_at)? else {
            continue;
        };
        let Some(frame) = frame.get_mut(..length) else {
            continue;
        };
        let passage = bus.process(frame, os::monotonic_ns());
        match passage {
            Passage::Lost => continue,
            Passage::Late(ns) => pause(Duration::from_nanos(ns)),
            Passage::Twice => socket.send(frame)?,
            Passage::BehindForeign => socket.send(&Passage::foreign(frame))?,
            Passage::Returns => {}
        }
        socket.send(frame)?;
    }
}

/// Starts this command again in a separate network. An ordinary user becomes its administrator.
fn begin_again() -> anyhow::Result<Exit> {
    let _signals = Signals::listen()?;
    let program = std::env::current_exe()?;
    let how = if rustix::process::geteuid().is_root() {
        "-n"
    } else {
        "-Urn"
    };
    let status = Command::new("unshare")
        .arg(how)
        .arg("--")
        .arg(program)
        .args(std::env::args_os().skip(1))
        .env(INSIDE, "1")
        .status();
    let status = status.context(
        "`unshare` cannot be started: install util-linux, or make a pair and use `--interface`",
    )?;
    Ok(exit_of(status.code()))
}

fn make_pair(near: &str) -> anyhow::Result<()> {
    let commands: [&[&str]; 4] = [
        &["link", "add", near, "type", "veth", "peer", "name", FAR_END],
        &["link", "set", near, "up"],
        &["link", "set", FAR_END, "up"],
        &["link", "set", "lo", "up"],
    ];
    for words in commands {
        let done = Command::new("ip").args(words).output();
        let done = done.context("`ip` cannot be started: install iproute2")?;
        if !done.status.success() {
            let why = String::from_utf8_lossy(&done.stderr);
            anyhow::bail!("ip {}: {}", words.join(" "), why.trim());
        }
    }
    Ok(())
}

/// The command beside the devices; `gusset` is this program.
fn ours(command: &[String]) -> Command {
    let (program, rest) = match command.split_first() {
        Some((first, rest)) => (first.clone(), rest),
        None => (String::new(), command),
    };
    let own = std::env::current_exe().ok().filter(|_| program == "gusset");
    let mut command = own.map_or_else(|| Command::new(&program), Command::new);
    command.args(rest).env_remove(INSIDE);
    command
}
