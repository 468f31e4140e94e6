//! The live page: one server on a separate thread, off the loop's processor.
//!
//! Bound before anything moves, so that a port in use counts as wrong usage. Served once the other threads are on their
//! processors, and open until every viewer has received the end and fetched the report. It closes after 0.9 s in which no viewer
//! reads anything, and after five seconds at the latest.
//!
//! | client | may |
//! |---|---|
//! | any on this machine, if bound to loopback | view |
//! | with the viewing token, if bound to another address | view |
//! | with the control token, on any machine | HOLD, CONTINUE, CONFIRM, STOP |
//!
//! Tokens travel in a header, never in an address. There is no encryption: across a network that is not trusted the page
//! belongs into a tunnel (`ssh -L`).

mod access;
mod connections;
mod feed;
mod routes;

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener, ToSocketAddrs};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use crossbeam_channel::Sender;
use thiserror::Error;
use tokio::sync::Notify;

pub use access::{Token, TokenError};

use super::board::{Board, Ended, MARGIN_EVERY_NS};
use access::AccessRules;
use connections::WebListener;
use feed::Feed;
use gusset_control::engine::Operator;
use gusset_record::rt::os::monotonic_ns;
use gusset_record::{Event, Note};
use routes::{Refusals, Site};

/// Default port of the page.
pub(crate) const USUAL_PORT: u16 = 4824;
/// Longest time for which the server stays for viewers that have not yet received the end or fetched the report.
const GRACE: Duration = Duration::from_secs(5);
/// Time after which it stays no longer if none of them reads anything, and time between two looks.
const NOTHING_READ: Duration = Duration::from_millis(900);
const LOOK: Duration = Duration::from_millis(20);

/// Why there is no live page. Nothing was moved.
#[derive(Debug, Error)]
pub enum PageError {
    /// The address means nothing.
    #[error("the live page cannot be served at \"{address}\": {source}")]
    Address {
        /// The address as given.
        address: String,
        /// The system's word.
        source: io::Error,
    },
    /// The address is taken, or not ours.
    #[error(
        "the live page cannot be served at {address}: {source}{}",
        advice(source)
    )]
    Bind {
        /// Where.
        address: SocketAddr,
        /// The system's word.
        source: io::Error,
    },
    /// No random numbers for a token.
    #[error("no token for the live page: {0}")]
    Random(io::Error),
}

fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::AddrInUse => {
            "; another test with a live page, or a `gusset serve`, may be using this port: `--live 127.0.0.1:0` takes any free port"
        }
        io::ErrorKind::AddrNotAvailable => "; this machine has no such address",
        _ => "",
    }
}

/// Parses an address: `ADDR:PORT`, or one of the two.
///
/// # Errors
/// Why it is not an address, in words.
pub fn parse_address(text: &str) -> Result<String, String> {
    let wanted = || {
        format!(
            "wanted ADDR:PORT, an address or a port, e.g. 127.0.0.1:{USUAL_PORT} or 0.0.0.0:{USUAL_PORT}; found \"{text}\""
        )
    };
    if let Ok(port) = text.parse::<u16>() {
        return Ok(format!("127.0.0.1:{port}"));
    }
    if let Ok(ip) = text.parse::<IpAddr>() {
        return Ok(SocketAddr::new(ip, USUAL_PORT).to_string());
    }
    if text.parse::<SocketAddr>().is_ok() {
        return Ok(text.to_owned());
    }
    if std::path::Path::new(text).exists() || text.contains('/') {
        return Err(format!("{}; put the test file before `--live`", wanted()));
    }
    let (host, port) = match text.rsplit_once(':') {
        Some((host, port)) => (host, port.parse::<u16>().map_err(|_| wanted())?),
        None => (text, USUAL_PORT),
    };
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '.';
    if host.is_empty() || !host.chars().all(is_name) {
        return Err(wanted());
    }
    Ok(format!("{host}:{port}"))
}

/// A page that is bound and not served yet.
#[derive(Debug)]
pub struct LivePage {
    listener: TcpListener,
    address: SocketAddr,
    name: Option<String>,
    control: Token,
    view: Option<Token>,
}

impl LivePage {
    /// Takes the port. `address` is a result of [`parse_address`]; `view` is the viewing token beyond loopback, a fresh
    /// one if none is given.
    ///
    /// # Errors
    /// See [`PageError`].
    pub fn bind(address: &str, view: Option<Token>) -> Result<Self, PageError> {
        let wrong = |source| PageError::Address {
            address: address.to_owned(),
            source,
        };
        let mut found = address.to_socket_addrs().map_err(wrong)?;
        let first = found
            .next()
            .ok_or_else(|| wrong(io::Error::other("no address has this name")))?;
        let bind = |source| PageError::Bind {
            address: first,
            source,
        };
        let listener = TcpListener::bind(first).map_err(bind)?;
        listener.set_nonblocking(true).map_err(bind)?;
        let local = listener.local_addr().map_err(bind)?;
        let control = Token::random().map_err(PageError::Random)?;
        let view = match (view, is_loopback(local.ip())) {
            (Some(view), _) => Some(view),
            (None, true) => None,
            (None, false) => Some(Token::random().map_err(PageError::Random)?),
        };
        let (host, _) = address.rsplit_once(':').unwrap_or((address, ""));
        let name = host.parse::<IpAddr>().is_err().then(|| host.to_owned());
        Ok(Self {
            listener,
            address: local,
            name,
            control,
            view,
        })
    }

    /// Where it is.
    #[must_use]
    #[cfg(test)]
    pub(crate) const fn address(&self) -> SocketAddr {
        self.address
    }

    /// For a browser; with the viewing token behind the `#`, which no browser sends, where one is needed.
    #[must_use]
    pub fn link(&self) -> String {
        let mut shown = self.address;
        if shown.ip().is_unspecified() {
            // The page is at every address of this machine; the link is printed on this machine.
            shown.set_ip(IpAddr::V4(Ipv4Addr::LOCALHOST));
        }
        match &self.view {
            Some(view) => format!("http://{shown}/#view={}", view.text()),
            None => format!("http://{shown}/"),
        }
    }

    /// The token for operating the test.
    #[must_use]
    pub const fn control_token(&self) -> &Token {
        &self.control
    }

    /// Whether viewing needs no token.
    #[must_use]
    pub const fn is_open(&self) -> bool {
        self.view.is_none()
    }

    /// Starts to serve, on a thread that inherits the processors of the caller's.
    ///
    /// # Errors
    /// The system gives no thread or no event queue.
    pub fn serve(
        self,
        board: Arc<Board>,
        operator: Sender<Operator>,
        notes: Sender<Note>,
    ) -> io::Result<Serving> {
        let address = self.address.to_string();
        let _full = notes.try_send(Event::LivePage { address }.into());
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()?;
        let listener = {
            let _inside = runtime.enter();
            tokio::net::TcpListener::from_std(self.listener)?
        };
        let stop = Arc::new(Notify::new());
        let report_key = Token::random()?;
        let site = Site {
            feed: Arc::new(Feed::new(Arc::clone(&board), report_key.text())),
            access: AccessRules::new(self.address.ip(), self.name, self.control, self.view),
            operator,
            notes,
            refused: Refusals::default(),
        };
        let asked = Arc::clone(&stop);
        let thread = std::thread::Builder::new()
            .name("gusset-page".into())
            .spawn(move || {
                // Behind the writer, with whom it may share a processor.
                let _refused = rustix::process::setpriority_process(None, 10);
                runtime.block_on(serve(WebListener::new(listener), site, asked));
            })?;
        Ok(Serving {
            board,
            stop,
            thread: Some(thread),
        })
    }
}

async fn serve(listener: WebListener, site: Site, stop: Arc<Notify>) {
    let (ended, mut overdue) = tokio::sync::watch::channel(false);
    let shutdown = async move {
        stop.notified().await;
        let _nobody = ended.send(true);
        // Held until the server is done: a closed channel would count as an end.
        ended.closed().await;
    };
    let mut seen = overdue.clone();
    let feed = Arc::clone(&site.feed);
    let board = Arc::clone(&feed.board);
    let margin = async move {
        // Also without viewers: the smallest margin so far is that of the whole test.
        let mut beat = tokio::time::interval(Duration::from_nanos(MARGIN_EVERY_NS / 2));
        loop {
            beat.tick().await;
            board.margin(monotonic_ns());
        }
    };
    let connections = listener.connections();
    let server = routes::serve(listener, site, async move {
        drop(seen.wait_for(|ended| *ended).await);
        feed.is_done().await;
    });
    let patience = async {
        let _gone = overdue.wait_for(|ended| *ended).await;
        let ended = tokio::time::Instant::now();
        let mut progress = (connections.bytes_written(), ended);
        while ended.elapsed() < GRACE && progress.1.elapsed() < NOTHING_READ {
            tokio::time::sleep(LOOK).await;
            let written = connections.bytes_written();
            if written != progress.0 {
                progress = (written, tokio::time::Instant::now());
            }
        }
    };
    tokio::select! {
        // A listener that fails is tried again inside; the server ends only when it was asked to.
        () = server => {}
        () = patience => {}
        () = margin => {}
        () = shutdown => {}
    }
}

/// A page that is served. Dropping it ends it at once.
#[derive(Debug)]
pub struct Serving {
    board: Arc<Board>,
    stop: Arc<Notify>,
    thread: Option<JoinHandle<()>>,
}

impl Serving {
    /// Tells every viewer how the test ended, and closes when they have received it and fetched the report, within five
    /// seconds. Viewers that do not read delay this by less than a second.
    pub fn end(mut self, ended: Ended) {
        self.board.end(ended);
        self.stop.notify_one();
        if let Some(thread) = self.thread.take() {
            let _its_panic_is_not_ours = thread.join();
        }
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.stop.notify_one();
    }
}

/// Loopback, also in the dress of IPv6.
fn is_loopback(ip: IpAddr) -> bool {
    ip.to_canonical().is_loopback()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn address_may_be_a_port_or_both() {
        for (given, made) in [
            ("8080", "127.0.0.1:8080"),
            ("0.0.0.0", "0.0.0.0:4824"),
            ("::1", "[::1]:4824"),
            ("[::1]:7", "[::1]:7"),
            ("10.0.0.5:9", "10.0.0.5:9"),
            ("localhost", "localhost:4824"),
            ("lab-pc.local:81", "lab-pc.local:81"),
        ] {
            assert_eq!(parse_address(given).as_deref(), Ok(made));
        }
        for wrong in ["", ":80", "a b:1", "host:99999", "host:", "1.2.3.4:x"] {
            let said = parse_address(wrong).unwrap_err();
            assert!(said.contains("wanted ADDR:PORT"), "{wrong}: {said}");
        }
        let said = parse_address("config/frame-bouc-wen.toml").unwrap_err();
        assert!(said.contains("before `--live`"), "{said}");
    }

    #[test]
    fn taken_port_is_reported_with_a_remedy() {
        let holder = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = holder.local_addr().unwrap().to_string();
        let said = LivePage::bind(&address, None).unwrap_err().to_string();
        assert!(
            said.contains(&address) && said.contains("any free port"),
            "{said}"
        );
        let said = LivePage::bind("no-such-host.invalid:1", None).unwrap_err();
        assert!(matches!(said, PageError::Address { .. }), "{said}");
    }

    #[test]
    fn only_loopback_is_open() {
        let near = LivePage::bind("127.0.0.1:0", None).unwrap();
        assert!(near.is_open() && near.link().ends_with('/'));
        let far = LivePage::bind("0.0.0.0:0", None).unwrap();
        assert!(!far.is_open());
        assert!(far.link().starts_with("http://127.0.0.1:") && far.link().contains("/#view="));
        assert_ne!(far.control.text(), far.view.as_ref().unwrap().text());
        assert_ne!(near.control.text(), far.control.text());
    }

    /// The board of a test, and the limit of λ for a specimen of stiffness [`STIFF`].
    fn board(phase: gusset_control::engine::PhaseCell) -> (Arc<Board>, f64) {
        use crate::live::{About, Subject};

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("test.toml");
        let text = include_str!("../../../../config/paper-4-2-hardening.toml");
        std::fs::write(&path, text).unwrap();
        let loaded = gusset_config::load(&path, &[]).unwrap();
        let prepared = gusset_setup::build(&loaded).unwrap();
        let about = About {
            real_clock: true,
            ..About::default()
        };
        let subject = Subject::new(&prepared.experiment, about);
        let online = prepared.facts.structure.unwrap().online_limit.unwrap();
        let limit = online.limit([(STIFF, None)]);
        let board = Board::new(subject, phase, Some(online));
        (Arc::new(board), limit)
    }

    const STIFF: f64 = 3e7;

    /// A request that waited until its sender gave up must not move a specimen later.
    #[test]
    fn command_of_a_closed_page_is_dropped() {
        use std::io::Write;
        use std::net::TcpStream;

        use gusset_control::engine::{Glimpse, Phase, PhaseCell};

        let phase = PhaseCell::default();
        phase.show(Glimpse {
            hold: true,
            stands: true,
            unconfirmed: true,
            hold_number: 3,
            ..Glimpse::of(Phase::Zeroing)
        });
        let (board, _) = board(phase);
        let (operator, asked) = crossbeam_channel::bounded(8);
        let (notes, written) = crossbeam_channel::bounded(16);
        let page = LivePage::bind("127.0.0.1:0", None).unwrap();
        let say = |what: &str| {
            let mut stream = TcpStream::connect(page.address()).unwrap();
            let token = page.control_token().text();
            let request = format!(
                "POST /control/{what} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\n\
                 Content-Length: 0\r\n\r\n"
            );
            stream.write_all(request.as_bytes()).unwrap();
            stream
        };
        // The server does not accept yet: all requests wait, and some senders leave.
        drop([
            say("continue?hold=3"),
            say("confirm"),
            say("hold"),
            say("stop"),
        ]);
        let _waits = say("continue?hold=3");
        let serving = page.serve(board, operator, notes).unwrap();
        let told = written.iter().filter_map(|note| match note.event {
            Event::ControlRequest {
                request, accepted, ..
            } => Some((request, accepted)),
            _ => None,
        });
        let accepted = told.take(5).filter(|(_, accepted)| *accepted);
        let mut accepted: Vec<String> = accepted.map(|(request, _)| request).collect();
        accepted.sort_unstable();
        assert_eq!(accepted, ["continue", "hold", "stop"]);
        let heard: Vec<Operator> = asked.try_iter().collect();
        assert_eq!(heard.len(), 3);
        assert!(heard.contains(&Operator::EndHold(3)));
        drop(serving);
    }

    /// It has received the address of the report, and never fetches it.
    #[test]
    fn silent_viewer_delays_no_end() {
        use std::io::{Read, Write};
        use std::net::TcpStream;

        let (board, _) = board(gusset_control::engine::PhaseCell::default());
        let (operator, _asked) = crossbeam_channel::bounded(1);
        let (notes, _written) = crossbeam_channel::bounded(4);
        let page = LivePage::bind("127.0.0.1:0", None).unwrap();
        let mut viewer = TcpStream::connect(page.address()).unwrap();
        let serving = page.serve(board, operator, notes).unwrap();
        let request = b"GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
        viewer.write_all(request).unwrap();
        assert_eq!(viewer.read(&mut [0]).unwrap(), 1, "it is a viewer");
        let began_ns = monotonic_ns();
        let ended = Ended {
            status: "completed".to_owned(),
            reason: String::new(),
            report: Some("report.html".to_owned()),
            data: String::new(),
        };
        serving.end(ended);
        let waited = Duration::from_nanos(monotonic_ns() - began_ns);
        assert!(waited < GRACE, "{waited:?}");
    }

    #[test]
    fn lambda_margin_is_found_without_viewers() {
        use crate::live::{AxisView, Snapshot};

        let (board, limit) = board(gusset_control::engine::PhaseCell::default());
        let stiff = AxisView {
            command: 0.0,
            measured: 0.0,
            force: 0.0,
            error: 0.0,
            stiffness: STIFF,
            stiffest: STIFF,
            damping: f64::NAN,
            added: 0.0,
            margin: [f64::NAN; 2],
            limits: Vec::new(),
        };
        assert!(board.try_show(Snapshot {
            rows: 1,
            axes: vec![stiff],
            ..Snapshot::default()
        }));
        let (operator, _asked) = crossbeam_channel::bounded(1);
        let (notes, _written) = crossbeam_channel::bounded(1);
        let page = LivePage::bind("127.0.0.1:0", None).unwrap();
        let serving = page.serve(Arc::clone(&board), operator, notes);
        let began_ns = monotonic_ns();
        while board.known_margin().is_none() {
            let waited_ns = monotonic_ns() - began_ns;
            assert!(waited_ns < 60_000_000_000, "the margin is not found");
            std::thread::park_timeout(Duration::from_millis(5));
        }
        assert_eq!(board.known_margin().unwrap().lowest, limit);
        drop(serving);
    }
}
