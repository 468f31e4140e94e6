//! A client disconnects, holds or runs ahead during the specimen's path to a paced target: the specimen comes to rest at once.
//!
//! The rig acts for the client when a command reaches it. So nothing depends on the time that passes.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

use super::*;
use crate::inbox::Inbox;
use crate::server::acting::{Acting, PACING, TICKS};
use crate::server::{RunningServer, ServeOptions, Server};
use gusset_config::Carrier;

/// The path is interrupted at this command.
const AT: usize = 1000;
/// Ticks that 0.1 m/s² allow to slow down from the speed there: half of it slows down 10 mm in 4 s, at x = 1/4.
const SLOWS: usize = 53;

/// A client over TCP, armed at zero.
struct Caller {
    stream: TcpStream,
    inbox: Inbox,
    encoder: Encoder,
    decoder: Decoder,
    session: u64,
    out: Vec<u8>,
    server: RunningServer,
    rig: Acting,
}

impl Caller {
    fn armed() -> Self {
        let rig = Acting::default();
        let behind = rig.clone();
        let build: LinkBuild = Arc::new(move |_| Ok(Box::new(behind.clone())));
        let limits =
            "command_vel_m_per_s = { trip = 0.1 }, command_accel_m_per_s2 = { trip = 0.1 }";
        let limits = toml::from_str(&limits.replace(", ", "\n")).unwrap();
        let host = Host::gateway("far".into(), vec![axis()], vec![8e3], build, 1_000_000_000);
        let host = host.limited(vec![limits]).paced(Some(PACING));
        let options = ServeOptions {
            listen: "127.0.0.1:0".into(),
            carrier: Carrier::Tcp,
            key: None,
            plan: None,
            spin_ns: 0,
        };
        let server = Server::bind(host, options).unwrap();
        let stream = TcpStream::connect(server.local_addr()).unwrap();
        let limit = Some(Duration::from_secs(60));
        stream.set_read_timeout(limit).unwrap();
        // Else a frame waits until the one before it is acknowledged.
        stream.set_nodelay(true).unwrap();
        let mut one = Self {
            stream,
            inbox: Inbox::new(true),
            encoder: Encoder::greeting(Side::Controller),
            decoder: Decoder::greeting(Side::Specimen),
            session: 0,
            out: vec![0; LARGEST_FRAME],
            server: server.start().unwrap(),
            rig,
        };
        let Control::Welcome(welcome) = one.ask(&Control::Hello(hello(axis(), (1, 10)))) else {
            panic!("not welcome");
        };
        one.session = welcome.session;
        one.encoder = Encoder::new(Side::Controller, 1, welcome.session, None).unwrap();
        one.decoder = Decoder::new(Side::Specimen, 1, welcome.session, None).unwrap();
        let arm = Control::Arm(Arm {
            session: one.session,
            first_sequence: 0,
            disp: vec![0.0],
        });
        assert!(matches!(one.ask(&arm), Control::Arm(_)));
        // The ramp to the first target.
        let first = one.command(0, 0.0);
        one.stream.write_all(&first).unwrap();
        assert_eq!(one.answer(), (0, 0.0, Status(0)));
        one.rig.told.lock().unwrap().clear();
        one
    }

    fn ask(&mut self, control: &Control) -> Control {
        let message = handshake::encode(control).unwrap();
        let length = self.encoder.control(&message, &mut self.out).unwrap();
        self.stream.write_all(&self.out[..length]).unwrap();
        let place = self.frame().unwrap();
        match self.decoder.open(self.inbox.frame(place)).unwrap().frame {
            Frame::Control(message) => handshake::decode(message).unwrap(),
            other => panic!("{other:?}"),
        }
    }

    /// The place of the next frame; none once the server has closed the connection.
    fn frame(&mut self) -> Option<std::ops::Range<usize>> {
        loop {
            if let Some(place) = self.inbox.next().unwrap() {
                return Some(place);
            }
            match self.stream.read(self.inbox.space()) {
                Ok(0) | Err(_) => return None,
                Ok(count) => self.inbox.filled(count),
            }
        }
    }

    /// Number, displacement and status of the next measurement.
    fn answer(&mut self) -> (u64, f64, Status) {
        let place = self.frame().unwrap();
        let mut into = Measurement::zeros(1);
        match self.decoder.open(self.inbox.frame(place)).unwrap().frame {
            Frame::Measurement(measurement) => measurement.read(&mut into).unwrap(),
            other => panic!("{other:?}"),
        }
        (into.sequence, into.disp[0], into.status)
    }

    fn command(&mut self, sequence: u64, disp: f64) -> Vec<u8> {
        let command = Command {
            sequence,
            time: 10.0 * sequence as f64,
            dt: 10.0,
            disp: &[disp],
            vel: &[0.0],
        };
        let length = self.encoder.command(&command, &mut self.out).unwrap();
        self.out[..length].to_vec()
    }

    fn notice(&mut self, kind: &str, sequence: u64) -> Vec<u8> {
        let cause = Cause::Operator;
        let notice = Notice { sequence, cause };
        let out = &mut self.out;
        let written = match kind {
            "hold" => self.encoder.hold(notice, out),
            "retire" => self.encoder.retire(notice, out),
            _ => self.encoder.goodbye(notice, out),
        };
        let length = written.unwrap();
        self.out[..length].to_vec()
    }

    /// Sends a target of 10 mm with the number 1, and acts at a command of its path.
    fn goes(&mut self, target: &[u8], act: impl FnOnce() + Send + 'static) {
        self.rig.acts(AT, act);
        self.stream.write_all(target).unwrap();
    }

    /// The reason of the end of the session.
    fn ended(&self) -> String {
        loop {
            match self.server.events.recv_timeout(Duration::from_secs(60)) {
                Ok(ServerEvent::Ended { text, .. }) => return text,
                Ok(_) => {}
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Asserts that the rig slowed down from the next command on, and rests.
    fn rests(&self) -> f64 {
        let told = self.rig.told.lock().unwrap();
        assert!(
            (AT..=AT + SLOWS).contains(&told.len()),
            "{} commands",
            told.len()
        );
        let steps: Vec<f64> = told[AT - 2..]
            .windows(2)
            .map(|two| two[1] - two[0])
            .collect();
        for step in steps.windows(2) {
            // 0.1 m/s² in ticks of 1 ms.
            let change = step[1] - step[0];
            assert!(change < 0.0 && change > -1e-7, "{change}");
        }
        *told.last().unwrap()
    }
}

#[test]
fn leaving_client_ends_the_motion() {
    for kind in ["retire", "goodbye", "close"] {
        let mut caller = Caller::armed();
        let target = caller.command(1, 0.01);
        let frame = caller.notice(kind, 1);
        let mut stream = caller.stream.try_clone().unwrap();
        caller.goes(&target, move || match kind {
            "close" => stream.shutdown(Shutdown::Write).unwrap(),
            _ => stream.write_all(&frame).unwrap(),
        });
        let text = caller.ended();
        let said = match kind {
            "retire" => "retired",
            "goodbye" => "said goodbye",
            _ => "without a goodbye",
        };
        assert!(text.contains(said), "{kind}: {text}");
        caller.rests();
    }
}

#[test]
fn hold_during_a_motion_is_obeyed() {
    let mut caller = Caller::armed();
    let target = caller.command(1, 0.01);
    let frame = caller.notice("hold", 1);
    let mut stream = caller.stream.try_clone().unwrap();
    caller.goes(&target, move || stream.write_all(&frame).unwrap());
    let (sequence, disp, status) = caller.answer();
    assert_eq!((sequence, status), (1, Status::HOLDING));
    assert_eq!(disp, caller.rests());
    let left = caller.rig.told.lock().unwrap().len();
    // A repeated target does not end a hold.
    for (number, target) in [(1, 0.01), (2, 0.01)] {
        let next = caller.command(number, target);
        caller.stream.write_all(&next).unwrap();
        let answer = caller.answer();
        if number == 1 {
            assert_eq!(answer, (1, disp, Status::HOLDING));
            assert_eq!(caller.rig.told.lock().unwrap().len(), left);
        } else {
            assert_eq!(answer, (2, 0.01, Status(0)));
        }
    }
    let told = caller.rig.told.lock().unwrap();
    assert_eq!(told.len(), left + TICKS as usize);
    let steps = told[left - 1..].windows(2).map(|two| two[1] - two[0]);
    let largest = steps.fold(0.0, f64::max);
    // 15/8 of the mean speed.
    assert!(
        largest <= 1.876 * (0.01 - disp) / f64::from(TICKS),
        "{largest}"
    );
}

#[test]
fn hold_with_a_target_keeps_it_back() {
    let mut caller = Caller::armed();
    let mut both = caller.command(1, 0.01);
    both.extend(caller.notice("hold", 1));
    caller.stream.write_all(&both).unwrap();
    assert_eq!(caller.answer(), (1, 0.0, Status::HOLDING));
    assert!(caller.rig.told.lock().unwrap().is_empty());
}

#[test]
fn second_waiting_target_is_refused() {
    for further in [1, 2] {
        let mut caller = Caller::armed();
        let target = caller.command(1, 0.01);
        let mut frames = Vec::new();
        for number in 2..2 + further {
            frames.extend(caller.command(number, 0.0));
        }
        let mut stream = caller.stream.try_clone().unwrap();
        caller.goes(&target, move || stream.write_all(&frames).unwrap());
        if further == 1 {
            assert_eq!(caller.answer(), (1, 0.01, Status(0)));
            assert_eq!(caller.answer(), (2, 0.0, Status(0)));
            continue;
        }
        let text = caller.ended();
        assert!(text.contains("serve.pace"), "{text}");
        caller.rests();
    }
}

/// As many targets as the connection takes, and its end behind them.
#[test]
fn lost_client_is_seen_before_its_queue() {
    for heartbeats in [false, true] {
        let mut caller = Caller::armed();
        let target = caller.command(1, 0.01);
        let mut frames = Vec::new();
        for number in 2..20_000 {
            if heartbeats {
                let beat = Heartbeat {
                    sequence: 1,
                    time: 0.0,
                    status: Status(0),
                };
                let length = caller.encoder.heartbeat(beat, &mut caller.out).unwrap();
                frames.extend_from_slice(&caller.out[..length]);
            } else {
                frames.extend(caller.command(number, 0.0));
            }
        }
        let mut stream = caller.stream.try_clone().unwrap();
        caller.goes(&target, move || {
            stream.set_nonblocking(true).unwrap();
            let _ = stream.write(&frames).unwrap();
            stream.shutdown(Shutdown::Write).unwrap();
        });
        let text = caller.ended();
        let said = if heartbeats {
            "without a goodbye"
        } else {
            "serve.pace"
        };
        assert!(text.contains(said), "{text}");
        caller.rests();
    }
}
