//! A fake specimen, which keeps to the protocol until a test makes it do otherwise.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};

use gusset_quantity::substructure::{Measurement, Status};
use gusset_wire::handshake::{self, Capabilities, Control, Hello, Welcome, layout_hash};
use gusset_wire::native::{Cause, Decoder, Encoder, Frame, LARGEST_FRAME, Moment, Notice, split};
use gusset_wire::{Progress, Side};

use super::PATIENCE;

/// A specimen of one axis over TCP that keeps to the protocol until a test makes it do otherwise.
pub struct Fake {
    pub stream: TcpStream,
    pub encoder: Encoder,
    pub decoder: Decoder,
    bytes: Vec<u8>,
    /// It answers the goodbye.
    acknowledges: bool,
}

impl Fake {
    /// Serves one controller on a separate thread; returns the address.
    pub fn start(script: impl FnOnce(Fake) + Send + 'static) -> String {
        Self::start_with(4e5, script)
    }

    /// [`Self::start`] with another estimate of its stiffness.
    pub fn start_with(stiffness: f64, script: impl FnOnce(Fake) + Send + 'static) -> String {
        Self::start_when(stiffness, |_| {}, script)
    }

    /// The same; `before` is called with "welcome" and "arm" before each of the two is answered.
    pub fn start_when(
        stiffness: f64,
        before: impl Fn(&'static str) + Send + 'static,
        script: impl FnOnce(Fake) + Send + 'static,
    ) -> String {
        Self::start_as(stiffness, before, |_| {}, |arm| arm, script)
    }

    /// [`Self::start`] with a welcome that `change` has edited.
    pub fn start_welcoming(
        change: impl FnOnce(&mut Welcome) + Send + 'static,
        script: impl FnOnce(Fake) + Send + 'static,
    ) -> String {
        Self::start_as(4e5, |_| {}, change, |arm| arm, script)
    }

    /// [`Self::start`], whose answer to the request to arm is edited by `answer`.
    pub fn start_saying(
        stiffness: f64,
        before: impl Fn(&'static str) + Send + 'static,
        answer: impl FnOnce(Control) -> Control + Send + 'static,
        script: impl FnOnce(Fake) + Send + 'static,
    ) -> String {
        Self::start_as(stiffness, before, |_| {}, answer, script)
    }

    /// A machine of one axis, a spring of 4e5 N/m, for one controller after another. It reports its position, rests there without a
    /// controller, and does not report itself as computed. Returns its address and its position.
    pub fn machine() -> (String, Arc<Mutex<f64>>) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let position = Arc::new(Mutex::new(0.0));
        let stands = Arc::clone(&position);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                let standing = *stands.lock().unwrap();
                let moving = |welcome: &mut Welcome| {
                    welcome.capabilities = Capabilities::MEASURES_DISP;
                    welcome.standing = vec![standing];
                };
                let greeted = Self::greet(stream.unwrap(), 4e5, &|_| {}, moving, |arm| arm);
                if let Some(mut fake) = greeted {
                    fake.acknowledges = true;
                    let follow = |disp| {
                        *stands.lock().unwrap() = disp;
                        (disp, 4e5 * disp)
                    };
                    fake.obey(follow, |_| {});
                }
            }
        });
        (address, position)
    }

    fn start_as(
        stiffness: f64,
        before: impl Fn(&'static str) + Send + 'static,
        change: impl FnOnce(&mut Welcome) + Send + 'static,
        answer: impl FnOnce(Control) -> Control + Send + 'static,
        script: impl FnOnce(Fake) + Send + 'static,
    ) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        std::thread::spawn(move || {
            let (stream, _) = listener.accept().unwrap();
            if let Some(fake) = Fake::greet(stream, stiffness, &before, change, answer) {
                script(fake);
            }
        });
        address
    }

    fn greet(
        stream: TcpStream,
        stiffness: f64,
        before: &dyn Fn(&'static str),
        change: impl FnOnce(&mut Welcome),
        answer: impl FnOnce(Control) -> Control,
    ) -> Option<Self> {
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut fake = Self {
            stream,
            encoder: Encoder::greeting(Side::Specimen),
            decoder: Decoder::greeting(Side::Controller),
            bytes: Vec::new(),
            acknowledges: false,
        };
        let hello = match fake.control()? {
            Control::Hello(hello) => hello,
            other => panic!("{other:?}"),
        };
        before("welcome");
        let mut welcome = welcome(&hello, stiffness);
        change(&mut welcome);
        fake.say(&Control::Welcome(welcome));
        fake.encoder = Encoder::new(Side::Specimen, 1, 7, None).unwrap();
        fake.decoder = Decoder::new(Side::Controller, 1, 7, None).unwrap();
        // A controller may leave without arming.
        let arm = fake.control()?;
        if matches!(arm, Control::Bye(_)) {
            before("released");
            return None;
        }
        if matches!(arm, Control::Arm(_)) {
            before("arm");
        }
        fake.say(&answer(arm));
        Some(fake)
    }

    /// The next whole frame; `None` when the controller is gone.
    pub fn frame(&mut self) -> Option<Vec<u8>> {
        loop {
            if !self.bytes.is_empty()
                && let Progress::Frame { consumed } = split(&self.bytes).unwrap()
            {
                return Some(self.bytes.drain(..consumed).collect());
            }
            let mut more = [0; 4096];
            match self.stream.read(&mut more) {
                Ok(0) | Err(_) => return None,
                Ok(count) => self.bytes.extend(&more[..count]),
            }
        }
    }

    fn control(&mut self) -> Option<Control> {
        let frame = self.frame()?;
        match self.decoder.open(&frame).unwrap().frame {
            Frame::Control(message) => Some(handshake::decode(message).unwrap()),
            other => panic!("{other:?}"),
        }
    }

    pub fn say(&mut self, message: &Control) {
        let mut out = vec![0; LARGEST_FRAME];
        let bytes = handshake::encode(message).unwrap();
        let length = self.encoder.control(&bytes, &mut out).unwrap();
        self.stream.write_all(&out[..length]).unwrap();
    }

    /// Answers every command by the `wiring` at its displacement, and every request to arm, until the controller is gone; calls
    /// `told` with each displacement, and with `None` for each arming after the first.
    pub fn obey(
        &mut self,
        mut wiring: impl FnMut(f64) -> (f64, f64),
        mut told: impl FnMut(Option<f64>),
    ) {
        while let Some(frame) = self.frame() {
            let mut arm = None;
            let mut command = None;
            let mut retires = None;
            match self.decoder.open(&frame).unwrap().frame {
                Frame::Control(message) => arm = Some(handshake::decode(message).unwrap()),
                Frame::Command(frame) => {
                    let (mut disp, mut vel) = ([0.0], [0.0]);
                    frame.read(&mut disp, &mut vel).unwrap();
                    command = Some((frame.sequence, disp[0]));
                }
                Frame::Retire(notice) => retires = Some(notice.cause),
                _ => {}
            }
            if let Some(cause) = retires.filter(|_| self.acknowledges) {
                self.say_goodbye(cause);
            }
            if let Some(again @ Control::Arm(_)) = arm {
                told(None);
                self.say(&again);
            }
            if let Some((sequence, disp)) = command {
                told(Some(disp));
                let (disp, force) = wiring(disp);
                let frame = self.reading(sequence, disp, force, Status::default());
                self.write(&frame);
            }
        }
    }

    /// Answers every command by the `wiring` at its displacement, until it is retired.
    pub fn obey_until_retired(&mut self, wiring: impl Fn(f64) -> (f64, f64)) {
        loop {
            let frame = self.frame().unwrap();
            let mut command = None;
            match self.decoder.open(&frame).unwrap().frame {
                Frame::Command(frame) => {
                    let (mut disp, mut vel) = ([0.0], [0.0]);
                    frame.read(&mut disp, &mut vel).unwrap();
                    command = Some((frame.sequence, disp[0]));
                }
                Frame::Retire(_) => return,
                _ => {}
            }
            if let Some((sequence, disp)) = command {
                let (disp, force) = wiring(disp);
                let frame = self.reading(sequence, disp, force, Status::default());
                self.write(&frame);
            }
        }
    }

    pub fn say_goodbye(&mut self, cause: Cause) {
        let mut out = vec![0; LARGEST_FRAME];
        let notice = Notice { sequence: 0, cause };
        let length = self.encoder.goodbye(notice, &mut out).unwrap();
        self.write(&out[..length]);
    }

    /// Number and displacement of the next command.
    pub fn command(&mut self) -> Option<(u64, f64)> {
        loop {
            let frame = self.frame()?;
            if let Frame::Command(command) = self.decoder.open(&frame).unwrap().frame {
                let (mut disp, mut vel) = ([0.0], [0.0]);
                command.read(&mut disp, &mut vel).unwrap();
                return Some((command.sequence, disp[0]));
            }
        }
    }

    /// The frame that answers command `sequence`; its displacement is 0.
    pub fn answer(&mut self, sequence: u64, force: f64, status: Status) -> Vec<u8> {
        self.reading(sequence, 0.0, force, status)
    }

    /// The answer with a displacement.
    pub fn reading(&mut self, sequence: u64, disp: f64, force: f64, status: Status) -> Vec<u8> {
        let measured = Measurement {
            sequence,
            status,
            disp: vec![disp],
            force: vec![force],
            ..Measurement::zeros(1)
        };
        let mut out = vec![0; LARGEST_FRAME];
        let length = self
            .encoder
            .measurement(&measured, Moment::default(), &mut out)
            .unwrap();
        out.truncate(length);
        out
    }

    pub fn write(&mut self, bytes: &[u8]) {
        // A controller that has given up no longer reads.
        let _ = self.stream.write_all(bytes);
    }

    /// Answers as a spring of 4e5 N/m, `times` times.
    pub fn behave(&mut self, times: u32) {
        for _ in 0..times {
            let (sequence, disp) = self.command().unwrap();
            let frame = self.answer(sequence, 4e5 * disp, Status::default());
            self.write(&frame);
        }
    }
}

fn welcome(hello: &Hello, stiffness: f64) -> Welcome {
    Welcome {
        proof: [0; 32],
        nonce: [9; 32],
        layout: layout_hash(&hello.axes),
        session: 7,
        version: 1,
        keyed: false,
        capabilities: Capabilities::SIMULATED,
        watchdog_s: hello.watchdog_s,
        sampling: hello.sampling,
        stiffness: vec![stiffness],
        standing: vec![],
        software: "a test".into(),
        name: "fake".into(),
        axes: hello.axes.clone(),
    }
}
