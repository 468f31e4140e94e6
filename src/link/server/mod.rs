//! The server: it hosts one specimen for clients of the native protocol or of OpenFresco's.
//!
//! One thread receives clients (`reception`), one thread commands the specimen (`data_thread`), and the thread of the
//! caller reports events.
//! One client at a time commands the specimen; one test follows another.
//! A second client, a stranger or malformed bytes are refused and reported, and never reach the data thread.
//! A port that other machines can reach needs a key, certificates or the name of the client's machine.
//! Every wait ends: each handshake, each session and the stop have a time limit.
//! The native protocol finds a computed specimen in its initial state unless it remembers.
//! OpenFresco's protocols find a specimen that moves where the last test left it.

#[cfg(test)]
mod acting;
mod admission;
mod backlog;
mod channel;
mod commanded;
mod connection;
mod data_thread;
mod event;
mod farewell;
mod greeter;
mod handshake;
mod handshake_step;
mod hosted;
mod listener;
mod native_codec;
mod native_handshake;
mod native_opening;
mod native_session;
mod openfresco_handshake;
mod openfresco_session;
mod reception;
mod sampling;
mod session;
mod shared;
mod silence;
mod simulated;
mod simulated_server;
mod waiting;
mod wire_end;

pub use event::ServerEvent;
pub use hosted::{Build, Conversion, Host, PortBuild};
pub use simulated::{Simulated, Tap, Tapped};

use std::any::Any;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, bounded, unbounded};
use thiserror::Error;

use super::openfresco::{Host as OpenFrescoHost, ServeSettings};
use super::tls::TlsServer;
use super::{ConnectError, socket};
use data_thread::Served;
use greeter::Greeter;
use gusset_config::Carrier;
use gusset_record::rt::{Granted, RtPlan, apply};
use gusset_wire::key::PreSharedKey;
use gusset_wire::openfresco::Carrier as Bytes;
use listener::{Access, Listener};
use native_handshake::Offer;
use reception::Reception;
use shared::{Occupancy, Shared};

/// The address of a server of the native protocol, unless the user gives another one.
pub const USUAL_LISTEN: &str = "127.0.0.1:4823";
/// The stop request of the caller is checked this often while there is no client, and while there is one.
const LOOK: Duration = Duration::from_millis(20);
const LOOK_WHILE_SERVED: Duration = Duration::from_millis(1);

/// How a server listens.
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// "host:port"; port 0 is any free port.
    pub listen: String,
    /// The transport.
    pub carrier: Carrier,
    /// Clients of the native protocol must have this key.
    pub key: Option<PreSharedKey>,
    /// Real-time conditions of the data thread.
    pub plan: Option<RtPlan>,
    /// The data thread reads in a busy loop for this time before and after the expected time of a command, ns. At other times it
    /// sleeps until bytes arrive.
    pub spin_ns: u64,
}

/// Why a server does not start.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The address has no meaning.
    #[error(transparent)]
    Address(#[from] ConnectError),
    /// The system refuses the port.
    #[error(
        "cannot listen on {address}: {source}{}",
        socket::listen_advice(source)
    )]
    Listen {
        /// The address.
        address: String,
        /// The error of the system.
        source: std::io::Error,
    },
    /// Other machines could command the specimen.
    #[error("{address} can be reached from other machines{remedy}")]
    Open {
        /// The address.
        address: SocketAddr,
        /// The possible proofs of the commanding client's identity.
        remedy: &'static str,
    },
    /// TLS has no certificate.
    #[error("TLS wants a certificate, a key and an authority")]
    Bare,
    /// Real-time conditions are required and not granted.
    #[error("real-time conditions are required and not granted")]
    NoRealTime(Granted),
    /// The system gives no thread.
    #[error("the server cannot be started: {0}")]
    Start(std::io::Error),
}

/// The remedies of an open port, for the native protocol.
const NATIVE_REMEDY: &str = ": a pre-shared key is required there (--key FILE), or --transport tls";
/// The remedies of an open port, for OpenFresco's protocols.
const OPENFRESCO_REMEDY: &str = ", and OpenFresco's protocols know no key: name the one machine that may command the specimen \
                                 (--client ADDRESS), or require certificates (--transport tls)";

/// A server that has its port.
pub struct Server {
    listener: Listener,
    greeter: Greeter,
    served: Served,
    plan: Option<RtPlan>,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server")
            .field("address", &self.listener.local_addr())
            .finish_non_exhaustive()
    }
}

impl Server {
    /// Binds the port for clients of the native protocol. Clients that connect from now on are answered once the server runs.
    ///
    /// # Errors
    /// See [`ServeError`].
    pub fn bind(host: Host, options: ServeOptions) -> Result<Self, ServeError> {
        match options.carrier {
            Carrier::Tls => Err(ServeError::Bare),
            Carrier::Tcp | Carrier::Udp => Self::native(host, options, None),
        }
    }

    /// Binds the port for clients of the native protocol over TLS. The carrier of the options has no effect.
    ///
    /// # Errors
    /// See [`ServeError`].
    pub fn bind_tls(
        host: Host,
        mut options: ServeOptions,
        tls: TlsServer,
    ) -> Result<Self, ServeError> {
        options.carrier = Carrier::Tls;
        Self::native(host, options, Some(tls))
    }

    fn native(
        host: Host,
        options: ServeOptions,
        tls: Option<TlsServer>,
    ) -> Result<Self, ServeError> {
        let access = Access {
            has_key: options.key.is_some(),
            clients: Vec::new(),
            tls,
            remedy: NATIVE_REMEDY,
        };
        let listener = Listener::bind(&options, access)?;
        let offer = Arc::new(Offer {
            host,
            key: options.key,
        });
        Ok(Self {
            greeter: Greeter::Native {
                offer: Arc::clone(&offer),
                is_stream: listener.is_stream(),
            },
            listener,
            served: Served::Native {
                offer,
                spin_ns: options.spin_ns,
            },
            plan: options.plan,
        })
    }

    /// Binds the port for clients of OpenFresco's protocols. With `clients`, the server turns all other machines away.
    ///
    /// # Errors
    /// See [`ServeError`].
    pub fn bind_openfresco(
        host: OpenFrescoHost,
        settings: ServeSettings,
        options: ServeOptions,
        clients: impl IntoIterator<Item = IpAddr>,
        tls: Option<TlsServer>,
    ) -> Result<Self, ServeError> {
        if options.carrier == Carrier::Tls && tls.is_none() {
            return Err(ServeError::Bare);
        }
        let access = Access {
            has_key: false,
            clients: clients.into_iter().collect(),
            tls,
            remedy: OPENFRESCO_REMEDY,
        };
        let listener = Listener::bind(&options, access)?;
        let carrier = if listener.is_stream() {
            Bytes::Stream
        } else {
            Bytes::Datagrams
        };
        Ok(Self {
            listener,
            greeter: Greeter::OpenFresco {
                settings,
                carrier,
                axes: host.axes(),
                nature: host.nature(),
            },
            served: Served::OpenFresco {
                host: Box::new(host),
                settings,
                is_stream: carrier == Bytes::Stream,
            },
            plan: options.plan,
        })
    }

    /// The bound address.
    #[must_use]
    pub const fn local_addr(&self) -> SocketAddr {
        self.listener.local_addr()
    }

    /// Starts the threads of the server. Clients are answered from now on.
    ///
    /// # Errors
    /// [`ServeError::Start`], [`ServeError::NoRealTime`].
    pub fn start(self) -> Result<RunningServer, ServeError> {
        let (events_in, events) = unbounded();
        // One client at a time: a second one never waits here.
        let (clients_in, clients) = bounded(1);
        let shared = Arc::new(Shared::new(events_in));
        let mut running = RunningServer {
            events,
            shared: Arc::clone(&shared),
            threads: Vec::new(),
            granted: None,
        };
        let (granted_in, granted) = bounded(1);
        let (mut served, plan, for_data) = (self.served, self.plan, Arc::clone(&shared));
        running.spawn("gusset-serve", move || {
            let granted = plan.as_ref().map(apply);
            let cpu = granted.as_ref().and_then(|granted| granted.cpu);
            served.keep_record_away_from(cpu);
            // The receiver waits for it.
            let _ = granted_in.send(granted);
            data_thread::serve(&for_data, &clients, &mut served, cpu);
        })?;
        match granted.recv() {
            Ok(Some(granted)) if granted.must_refuse() => {
                return Err(ServeError::NoRealTime(granted));
            }
            Ok(granted) => running.granted = granted,
            Err(_) => return Err(ServeError::Start(std::io::ErrorKind::BrokenPipe.into())),
        }
        let reception = Reception::new(self.listener, self.greeter, shared, clients_in);
        running.spawn("gusset-listen", move || reception.run())?;
        Ok(running)
    }

    /// Serves one test after another until `stop` returns true; a test that runs then ends with a goodbye. `tell` receives each
    /// event. Both are called on this thread.
    ///
    /// # Errors
    /// As [`Server::start`].
    pub fn run(
        self,
        stop: &dyn Fn() -> bool,
        tell: &mut dyn FnMut(&ServerEvent),
    ) -> Result<(), ServeError> {
        self.start()?.watch(stop, tell);
        Ok(())
    }
}

/// A server whose threads run. It stops when it is dropped.
pub struct RunningServer {
    events: Receiver<ServerEvent>,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
    /// Kept as long as the server runs: it keeps the processors awake.
    granted: Option<Granted>,
}

impl std::fmt::Debug for RunningServer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RunningServer")
            .field("granted", &self.granted)
            .finish_non_exhaustive()
    }
}

impl RunningServer {
    fn spawn(
        &mut self,
        name: &str,
        body: impl FnOnce() + Send + 'static,
    ) -> Result<(), ServeError> {
        let thread = std::thread::Builder::new()
            .name(name.to_owned())
            .spawn(body)
            .map_err(ServeError::Start)?;
        self.threads.push(thread);
        Ok(())
    }

    /// The real-time conditions of the data thread, if some were asked for.
    #[must_use]
    pub const fn granted(&self) -> Option<&Granted> {
        self.granted.as_ref()
    }

    /// Reports events until `stop` returns true, and ends the server.
    ///
    /// # Panics
    /// With the panic of a thread of the server: then it ends at once.
    pub(crate) fn watch(self, stop: &dyn Fn() -> bool, tell: &mut dyn FnMut(&ServerEvent)) {
        self.watch_twice(stop, &|| false, tell);
    }

    /// Reports events until `stop` returns true, and ends the server. A wiring check returns to its start meanwhile, unless
    /// `at_once` returns true.
    ///
    /// # Panics
    /// With the panic of a thread of the server: then it ends at once.
    pub fn watch_twice(
        mut self,
        stop: &dyn Fn() -> bool,
        at_once: &dyn Fn() -> bool,
        tell: &mut dyn FnMut(&ServerEvent),
    ) {
        while !stop() && !self.threads.iter().any(JoinHandle::is_finished) {
            let look = match self.shared.occupancy() {
                Occupancy::Free => LOOK,
                Occupancy::Served(_) | Occupancy::Closing => LOOK_WHILE_SERVED,
            };
            match self.events.recv_timeout(look) {
                Ok(event) => tell(&event),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        self.shared.stop();
        while !self.threads.iter().all(JoinHandle::is_finished) && !at_once() {
            if let Ok(event) = self.events.recv_timeout(LOOK) {
                tell(&event);
            }
        }
        if at_once() {
            self.shared.stop_at_once();
        }
        let panic = self.end();
        while let Ok(event) = self.events.try_recv() {
            tell(&event);
        }
        if let Some(panic) = panic {
            std::panic::resume_unwind(panic);
        }
    }

    /// Ends the threads, which check the flag many times a second. Returns the panic of one, if there was any.
    fn end(&mut self) -> Option<Box<dyn Any + Send>> {
        self.shared.stop();
        let ends: Vec<_> = self.threads.drain(..).map(JoinHandle::join).collect();
        ends.into_iter().find_map(Result::err)
    }
}

impl Drop for RunningServer {
    fn drop(&mut self) {
        let _ = self.end();
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::net::TcpStream;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;
    use crate::openfresco::{Nature, Role};
    use crate::served::ServedSpecimen;
    use gusset_quantity::substructure::{
        Command, Freshness, LinkFault, Measurement, Retirement, Substructure,
    };
    use gusset_quantity::time::Nanos;
    use gusset_quantity::units::AxisUnits;
    use gusset_record::rt::os::monotonic_ns;

    /// A specimen that panics when it is moved.
    struct Broken;

    impl Substructure for Broken {
        fn axes(&self) -> usize {
            1
        }
        fn issue(&mut self, _: &Command<'_>) -> Result<(), LinkFault> {
            panic!("the specimen is broken")
        }
        fn collect(&mut self, _: Nanos, _: &mut Measurement) -> Result<Freshness, LinkFault> {
            Ok(Freshness::Fresh)
        }
        fn retire(&mut self, _: Retirement) {}
    }

    #[test]
    fn data_thread_panic_ends_the_server() {
        let units = vec![AxisUnits::SI];
        let served = ServedSpecimen::new(
            "broken".into(),
            Box::new(Broken),
            units,
            vec![1.0],
            vec![0.0],
        );
        let host = OpenFrescoHost::of(served, Nature::Simulated, None);
        let settings = ServeSettings::new(Role::Application, None);
        let options = ServeOptions {
            listen: "127.0.0.1:0".into(),
            carrier: Carrier::Tcp,
            key: None,
            plan: None,
            spin_ns: 0,
        };
        let server = Server::bind_openfresco(host, settings, options, [], None).unwrap();
        let mut client = TcpStream::connect(server.local_addr()).unwrap();
        let sizes = [1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2_i32].map(i32::to_le_bytes);
        client.write_all(sizes.as_flattened()).unwrap();
        let command = [3.0_f64, 1e-3].map(f64::to_le_bytes);
        client.write_all(command.as_flattened()).unwrap();
        let limit_ns = monotonic_ns() + 20_000_000_000;
        let stop = || monotonic_ns() > limit_ns;
        let run = AssertUnwindSafe(|| server.run(&stop, &mut |_| {}));
        let panic = catch_unwind(run).unwrap_err();
        assert_eq!(panic.downcast_ref(), Some(&"the specimen is broken"));
    }
}
