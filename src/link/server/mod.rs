//! The far end: hosts a specimen, a formula or one across another link, for controllers that speak our own protocol.
//!
//! An asynchronous runtime on the caller's thread accepts, greets and refuses; a thread of its own commands the
//! specimen once a controller has armed it. Guarantees: one controller at a time, one test after another, each
//! with a specimen in its virgin state, or a connection of its own to it; a second controller, a stranger or nonsense is
//! refused and named, and cannot reach the data thread; beyond loopback a key or TLS is required; every wait has an end.

mod armed;
mod caller;
mod data;
mod far;
mod greet;
mod heard;
mod host;
mod line;
mod parted;
mod simulated;
mod stand;
mod tcp;
mod udp;
mod wire_end;

pub use heard::Heard;
pub use host::{Build, Host};
pub use simulated::{Simulated, Tap, Tapped};

use std::future::Future;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crossbeam_channel::Sender;
use parted::Parted;
use thiserror::Error;
use tokio::sync::mpsc::UnboundedSender;

use super::quota::{Allowance, Quota};
use super::tls::TlsServer;
use super::{ConnectError, socket};
use crate::config::Carrier;
use crate::rt::{RtPlan, os};
use crate::wire::key::PreSharedKey;

/// Where a server listens unless told otherwise.
pub const USUAL_LISTEN: &str = "127.0.0.1:4823";

/// How a server listens.
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// "host:port"; port 0: any free one.
    pub listen: String,
    /// How the bytes travel.
    pub carrier: Carrier,
    /// Controllers must have it.
    pub key: Option<PreSharedKey>,
    /// What is asked of the system for the data thread; none: nothing.
    pub plan: Option<RtPlan>,
    /// Busy loop around the moment at which the next command is expected, in ns on either side; otherwise the data thread
    /// sleeps until bytes come.
    pub spin_ns: u64,
}

/// Why nothing is served.
#[derive(Debug, Error)]
pub enum ServeError {
    /// The address means nothing.
    #[error(transparent)]
    Address(#[from] ConnectError),
    /// The port is in use or not allowed.
    #[error(
        "cannot listen on {address}: {source}{}",
        socket::listen_advice(source)
    )]
    Listen {
        /// Where.
        address: String,
        /// The system's word.
        source: std::io::Error,
    },
    /// Other machines could command the specimen.
    #[error(
        "{address} can be reached from other machines: a pre-shared key is required there (--key FILE), or --transport tls"
    )]
    Open {
        /// Where.
        address: SocketAddr,
    },
    /// TLS is wanted, and nobody gave a certificate.
    #[error("TLS wants a certificate, a key and an authority")]
    Bare,
    /// The system gives no thread or runtime.
    #[error("the server cannot be started: {0}")]
    Start(std::io::Error),
}

/// What everybody at the far end shares.
struct Desk {
    host: Host,
    key: Option<PreSharedKey>,
    tls: Option<TlsServer>,
    spin_ns: u64,
    /// A controller has armed the specimen.
    present: AtomicBool,
    stop: AtomicBool,
    sessions: Sender<armed::Session>,
    heard: UnboundedSender<Heard>,
    /// One quota for each kind of event.
    quotas: Mutex<[Quota; KINDS]>,
    /// The end of the last session.
    parted: Mutex<Option<Parted>>,
}

impl Desk {
    /// A session is over.
    fn part(&self, parted: Parted) {
        *self.parted.lock().unwrap_or_else(PoisonError::into_inner) = Some(parted);
    }

    /// What the last session's controller is told once more, if this datagram asks for it.
    fn last_words(&self, peer: SocketAddr, datagram: &[u8]) -> Vec<Vec<u8>> {
        let parted = self.parted.lock().unwrap_or_else(PoisonError::into_inner);
        let frames = parted
            .as_ref()
            .map(|parted| parted.again(peer, datagram, os::monotonic_ns()));
        frames.unwrap_or_default().to_vec()
    }

    /// Reports an event, within the quota of its kind.
    fn tell(&self, heard: Heard) {
        self.tell_at_most(kind(&heard), heard);
    }

    /// Reports a peer that was turned away for nonsense.
    fn complain(&self, peer: SocketAddr, text: String) {
        self.tell_at_most(STRANGERS, Heard::Refused { peer, text });
    }

    fn tell_at_most(&self, kind: usize, heard: Heard) {
        let allowance = {
            let mut quotas = self.quotas.lock().unwrap_or_else(PoisonError::into_inner);
            quotas
                .get_mut(kind)
                .map(|quota| quota.take(os::monotonic_ns()))
        };
        let Some(Allowance { is_told, notice }) = allowance else {
            return;
        };
        if is_told {
            self.pass(heard);
        }
        if let Some(text) = notice {
            self.pass(Heard::Told { text });
        }
    }

    fn pass(&self, heard: Heard) {
        // Nobody listens any more only when the server ends.
        let _ = self.heard.send(heard);
    }

    /// Reserves the specimen for one controller; false if another one has it.
    fn take(&self) -> bool {
        self.present
            .compare_exchange(false, true, Ordering::AcqRel, Ordering::Acquire)
            .is_ok()
    }

    fn is_taken(&self) -> bool {
        self.present.load(Ordering::Acquire)
    }

    fn give_back(&self) {
        self.present.store(false, Ordering::Release);
    }
}

/// Kinds of events. A peer can cause each of them without end.
const KINDS: usize = 10;
const STRANGERS: usize = KINDS - 1;

/// The kind of an event, below [`STRANGERS`].
const fn kind(heard: &Heard) -> usize {
    match heard {
        Heard::Hello { .. } => 0,
        Heard::Refused { .. } => 1,
        Heard::Armed { .. } => 2,
        Heard::Told { .. } => 3,
        Heard::Ended { .. } => 4,
        Heard::Tripped { .. } => 5,
        Heard::Holding { .. } => 6,
        Heard::Resumed { .. } => 7,
        Heard::NotGranted { .. } => 8,
    }
}

enum Listener {
    Tcp(std::net::TcpListener),
    Udp(std::net::UdpSocket),
}

/// A far end that has its port.
pub struct Server {
    host: Host,
    options: ServeOptions,
    tls: Option<TlsServer>,
    listener: Listener,
    address: SocketAddr,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server")
            .field("host", &self.host)
            .field("address", &self.address)
            .finish_non_exhaustive()
    }
}

impl Server {
    /// Takes the port. Controllers that connect from now on are answered as soon as [`Server::run`] runs.
    ///
    /// # Errors
    /// See [`ServeError`].
    pub fn bind(host: Host, options: ServeOptions) -> Result<Self, ServeError> {
        match options.carrier {
            Carrier::Tls => Err(ServeError::Bare),
            Carrier::Tcp | Carrier::Udp => Self::listen(host, options, None),
        }
    }

    /// The same over TLS, whatever carrier the options name. Clients must show a certificate, so no key is needed beyond
    /// loopback.
    ///
    /// # Errors
    /// See [`ServeError`].
    pub fn bind_tls(
        host: Host,
        mut options: ServeOptions,
        tls: TlsServer,
    ) -> Result<Self, ServeError> {
        options.carrier = Carrier::Tls;
        Self::listen(host, options, Some(tls))
    }

    fn listen(
        host: Host,
        options: ServeOptions,
        tls: Option<TlsServer>,
    ) -> Result<Self, ServeError> {
        let wrong = |source| ServeError::Listen {
            address: options.listen.clone(),
            source,
        };
        let addresses = socket::resolve(&options.listen)?;
        if let Some(open) = addresses.iter().find(|a| !a.ip().is_loopback())
            && options.key.is_none()
            && !tls.as_ref().is_some_and(TlsServer::requires_certificate)
        {
            return Err(ServeError::Open { address: *open });
        }
        let Some(first) = addresses.first() else {
            return Err(wrong(std::io::ErrorKind::AddrNotAvailable.into()));
        };
        let listener = match options.carrier {
            Carrier::Tcp | Carrier::Tls => std::net::TcpListener::bind(*first)
                .and_then(|listener| {
                    listener.set_nonblocking(true)?;
                    Ok(Listener::Tcp(listener))
                })
                .map_err(wrong)?,
            Carrier::Udp => udp::bind(*first).map(Listener::Udp).map_err(wrong)?,
        };
        let address = match &listener {
            Listener::Tcp(listener) => listener.local_addr(),
            Listener::Udp(socket) => socket.local_addr(),
        }
        .map_err(wrong)?;
        Ok(Self {
            host,
            options,
            tls,
            listener,
            address,
        })
    }

    /// Where it listens.
    #[must_use]
    pub const fn local_addr(&self) -> SocketAddr {
        self.address
    }

    /// Serves one test after another until `until` is done; a test that runs then is ended with a goodbye. `heard` is told
    /// everything, on the calling thread.
    ///
    /// # Errors
    /// [`ServeError::Start`].
    pub fn run(
        self,
        until: impl Future<Output = ()>,
        heard: &mut dyn FnMut(&Heard),
    ) -> Result<(), ServeError> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()
            .map_err(ServeError::Start)?;
        let (heard_in, mut heard_out) = tokio::sync::mpsc::unbounded_channel();
        // One controller at a time: more than one session never waits.
        let (sessions, from_desk) = crossbeam_channel::bounded(1);
        let desk = Arc::new(Desk {
            host: self.host,
            key: self.options.key,
            tls: self.tls,
            spin_ns: self.options.spin_ns,
            present: AtomicBool::new(false),
            stop: AtomicBool::new(false),
            sessions,
            heard: heard_in,
            quotas: Mutex::default(),
            parted: Mutex::default(),
        });
        let for_data = Arc::clone(&desk);
        let plan = self.options.plan;
        let thread = std::thread::Builder::new()
            .name("gusset-serve".into())
            .spawn(move || data::serve(&for_data, &from_desk, plan.as_ref()))
            .map_err(ServeError::Start)?;
        let served = runtime.block_on(async {
            let _accepting = match self.listener {
                Listener::Tcp(listener) => {
                    let listener = tokio::net::TcpListener::from_std(listener)?;
                    tokio::spawn(tcp::accept(listener, Arc::clone(&desk)))
                }
                Listener::Udp(socket) => {
                    let socket = tokio::net::UdpSocket::from_std(socket)?;
                    tokio::spawn(udp::receive(socket, Arc::clone(&desk)))
                }
            };
            tokio::pin!(until);
            loop {
                tokio::select! {
                    biased;
                    () = &mut until => break Ok(()),
                    Some(event) = heard_out.recv() => heard(&event),
                }
            }
        });
        desk.stop.store(true, Ordering::Release);
        // The thread looks at the flag many times a second, and ends.
        let _ = thread.join();
        while let Ok(event) = heard_out.try_recv() {
            heard(&event);
        }
        served.map_err(ServeError::Start)
    }
}
