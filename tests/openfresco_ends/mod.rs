//! Our own ends of OpenFresco's dialects: a server in a thread, a client's settings, and a path to drive along.

#![allow(dead_code, reason = "each test file uses its part")]

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use gusset_actuator::specimen::SpecimenLaw;
use gusset_config::{self as config, LimitsSpec};
use gusset_link::openfresco::{End, Host, Nature, RemoteSettings, Role, ServeSettings};
use gusset_link::served::{Computed, ServedSpecimen};
use gusset_link::server::{ServeError, ServeOptions, Server as Bound, ServerEvent};
use gusset_link::tls::TlsServer;
use gusset_quantity::substructure::{Command, Measurement, Substructure};
use gusset_quantity::time::Nanos;
use gusset_quantity::units::AxisUnits;
use gusset_wire::openfresco::{Carrier, Peer};

pub const BILINEAR: &str = "law = { bilinear = { stiffness_n_per_m = 8000.0, yield_force_n = 60.0, post_yield_ratio = 0.05 } }";
/// No step here takes longer unless it hangs.
pub const LONG: Duration = Duration::from_secs(20);

pub struct Server {
    pub address: SocketAddr,
    events: Receiver<ServerEvent>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// How a server listens.
pub struct Listen {
    pub options: ServeOptions,
    pub client: Option<IpAddr>,
    pub tls: Option<TlsServer>,
}

impl Listen {
    pub fn at(carrier: Carrier, address: &str) -> Self {
        let carrier = match carrier {
            Carrier::Stream => config::Carrier::Tcp,
            Carrier::Datagrams => config::Carrier::Udp,
        };
        Self {
            options: ServeOptions {
                listen: address.to_owned(),
                carrier,
                key: None,
                plan: None,
                spin_ns: 0,
            },
            client: None,
            tls: None,
        }
    }

    pub fn tls(address: &str, tls: TlsServer) -> Self {
        let mut listen = Self::at(Carrier::Stream, address);
        listen.options.carrier = config::Carrier::Tls;
        listen.tls = Some(tls);
        listen
    }

    pub fn only(mut self, client: IpAddr) -> Self {
        self.client = Some(client);
        self
    }

    pub fn bind(
        self,
        settings: ServeSettings,
        axes: usize,
        nature: Nature,
    ) -> Result<Bound, ServeError> {
        let host = host(axes, nature);
        Bound::bind_openfresco(host, settings, self.options, self.client, self.tls)
    }

    pub fn serve(self, settings: ServeSettings, axes: usize, nature: Nature) -> Server {
        Server::of(self.bind(settings, axes, nature).unwrap())
    }
}

impl Server {
    pub fn start(role: Role, carrier: Carrier, axes: usize, nature: Nature) -> Self {
        let settings = ServeSettings::new(role, Some(30.0));
        Self::with(settings, carrier, axes, nature)
    }

    pub fn with(settings: ServeSettings, carrier: Carrier, axes: usize, nature: Nature) -> Self {
        Listen::at(carrier, "127.0.0.1:0").serve(settings, axes, nature)
    }

    fn of(bound: Bound) -> Self {
        let address = bound.local_addr();
        let stop = Arc::new(AtomicBool::new(false));
        let (tell, events) = channel();
        let told = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let stop = || told.load(Ordering::Relaxed);
            bound
                .run(&stop, &mut |event| {
                    let _ = tell.send(event.clone());
                })
                .unwrap();
        });
        Self {
            address,
            events,
            stop,
            thread: Some(thread),
        }
    }

    pub fn hears(&self, wanted: impl Fn(&ServerEvent) -> bool) -> ServerEvent {
        loop {
            let event = self.events.recv_timeout(LONG).expect("no such event");
            if wanted(&event) {
                return event;
            }
        }
    }

    pub fn end(&self) -> End {
        match self.hears(|event| matches!(event, ServerEvent::ClientLeft(..))) {
            ServerEvent::ClientLeft(_, end, _) => end,
            _ => unreachable!(),
        }
    }
}

/// Clients begin where their path does, wherever the specimen is: they may take steps of up to a metre.
fn host(axes: usize, nature: Nature) -> Host {
    let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
    let law = Computed::new(law.build(axes).unwrap(), nature == Nature::Physical);
    let (stiffness, mass) = law.reference();
    let bounds: LimitsSpec = toml::from_str("command_step_m = { trip = 1.0 }").unwrap();
    let units = vec![AxisUnits::SI; axes];
    let served = ServedSpecimen::new("specimen".into(), Box::new(law), units, stiffness, mass);
    Host::of(served.limited(&vec![bounds; axes]), nature, Some(0.01))
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let result = self.thread.take().unwrap().join();
        assert!(result.is_ok() || std::thread::panicking());
    }
}

pub fn settings(peer: Peer, carrier: Carrier, address: SocketAddr, axes: usize) -> RemoteSettings {
    RemoteSettings {
        data_size: 2,
        ..RemoteSettings::new(peer, carrier, address.to_string(), axes)
    }
}

pub fn path(k: u64, axis: usize) -> f64 {
    0.03 * libm::sin(0.3 * k as f64 + axis as f64)
}

/// Drives a substructure along the path; all measurements.
pub fn drive(port: &mut dyn Substructure, steps: u64) -> Vec<(Vec<f64>, Vec<f64>)> {
    let axes = port.axes();
    let mut into = Measurement::zeros(axes);
    (0..steps)
        .map(|k| {
            let disp: Vec<f64> = (0..axes).map(|axis| path(k, axis)).collect();
            let vel = vec![0.0; axes];
            let command = Command {
                sequence: k,
                time: 0.01 * k as f64,
                dt: 0.01,
                disp: &disp,
                vel: &vel,
            };
            port.issue(&command).unwrap();
            port.collect(Nanos(0), &mut into).unwrap();
            port.accepted(k).unwrap();
            assert_eq!(into.sequence, k);
            (into.disp.clone(), into.force.clone())
        })
        .collect()
}

pub fn in_process(axes: usize, steps: u64) -> Vec<(Vec<f64>, Vec<f64>)> {
    let law: SpecimenLaw = toml::from_str(BILINEAR).unwrap();
    drive(
        &mut gusset_actuator::specimen::InProcess::new(law.build(axes).unwrap()),
        steps,
    )
}
