//! OpenFresco's dialects, both roles: recorded exchanges, made short and spoilt, in pieces of any size.

use std::fmt::{Debug, Write};

use gusset_quantity::substructure::{Command, Measurement};
use gusset_wire::WireError;
use gusset_wire::openfresco::{
    Actor, ActorEvent, Carrier, Client, ClientDialect, ClientEvent, ClientSettings, Counts, Event,
    Interface, Response, Server, ServerDialect, Shadow, ShadowEvent, ShadowSettings, Simulink,
    SimulinkEvent, Sizes, UdpGreeting,
};

use super::{Dice, Target, WORDS, mutate};

/// Doubles in a vector of the shortened exchanges.
const SHORT: usize = 16;
/// Messages of an exchange that are fed.
const MOST: usize = 24;
/// Vectors of 65536 doubles, the longest allowed: one each for the received and the sent vector, the command before the last, and
/// the first messages. This bound is independent of the program's own.
const ALLOCATION_LIMIT: u64 = 4 * 8 * 65_536;

#[derive(Clone, Copy, Debug)]
enum Role {
    Application,
    Controller,
    Actor,
    Simulink,
    Client,
    Adapter,
    Shadow,
}

/// An exchange as one end receives it.
struct Exchange {
    roles: &'static [Role],
    carrier: Carrier,
    messages: Vec<Vec<u8>>,
}

fn load(name: &str, from_client: bool, roles: &'static [Role]) -> Exchange {
    let path = format!("{}/tests/captures/{name}.jsonl", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
    let udp = lines.next().unwrap()["transport"] == "udp";
    let direction = if from_client { "c2s" } else { "s2c" };
    let messages = lines
        .filter(|line| line["dir"] == direction && line["what"] != "end of stream")
        .map(|line| {
            let hex = line["hex"].as_str().unwrap();
            let mut bytes: Vec<u8> = (0..hex.len() / 2)
                .map(|at| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap())
                .collect();
            bytes.resize(line["len"].as_u64().unwrap() as usize, 0);
            bytes
        });
    Exchange {
        roles,
        carrier: if udp {
            Carrier::Datagrams
        } else {
            Carrier::Stream
        },
        messages: messages.collect(),
    }
}

impl Exchange {
    /// The exchange with vectors of [`SHORT`] doubles: the rest is garbage by contract. Dialect B's vectors before its setup keep
    /// their full length.
    fn shortened(mut self) -> Self {
        for message in &mut self.messages {
            match message.len() {
                44 => message[40..].copy_from_slice(&(SHORT as i32).to_le_bytes()),
                2048 => {
                    let code = f64::from_le_bytes(message[..8].try_into().unwrap());
                    let opening = matches!(self.roles, [Role::Actor | Role::Shadow])
                        && (code == 0.0 || code == 1.0 || code == 2.0);
                    if !opening {
                        message.truncate(8 * SHORT);
                    }
                }
                _ => {}
            }
        }
        self.messages.truncate(MOST);
        self
    }
}

fn exchanges() -> Vec<Exchange> {
    const SERVERS: &[Role] = &[Role::Application, Role::Controller];
    let mut all: Vec<Exchange> = [
        ("openfresco-c-client-to-siteserver-tcp", true, SERVERS),
        ("openfresco-element-tcp", true, SERVERS),
        ("opensees-genericClient-tcp-1dof", true, SERVERS),
        ("opensees-genericClient-tcp-2dof", true, SERVERS),
        ("opensees-genericClient-udp-1dof", true, SERVERS),
        ("openfresco-generictcp-tcp", true, SERVERS),
        ("openfresco-simsimulink-tcp", true, &[Role::Simulink]),
        ("openfresco-shadow-actor-tcp", true, &[Role::Actor]),
        ("openfresco-shadow-actor-udp", true, &[Role::Actor]),
        ("openfresco-shadow-actor-tcp", false, &[Role::Shadow]),
        ("openfresco-shadow-actor-udp", false, &[Role::Shadow]),
        ("opensees-genericClient-tcp-1dof", false, &[Role::Client]),
        ("opensees-genericClient-udp-1dof", false, &[Role::Client]),
        (
            "openfresco-simfeadapter-to-opensees-adapter-tcp",
            false,
            &[Role::Adapter],
        ),
        (
            "openfresco-simfeadapter-to-opensees-adapter-udp-hello",
            false,
            &[Role::Adapter],
        ),
    ]
    .into_iter()
    .map(|(name, from_client, roles)| load(name, from_client, roles).shortened())
    .collect();
    // Lines of an init file, which were never recorded.
    let mut line = vec![0; 16_385];
    line[..7].copy_from_slice(b"\x02a line");
    let sizes = all[0].messages[0].clone();
    let command = all[0].messages[1].clone();
    all.push(Exchange {
        roles: &[Role::Controller],
        carrier: Carrier::Stream,
        messages: vec![sizes, line, command],
    });
    all
}

/// The outputs of a machine as a hash: equal courses give equal numbers, without an allocation.
struct Log(u64);

impl Write for Log {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.note(text.as_bytes());
        Ok(())
    }
}

impl Log {
    /// FNV-1a.
    fn note(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
        }
    }

    fn event(&mut self, event: &dyn Debug) {
        write!(self, "{event:?}").unwrap();
    }
}

const NUMBERS: [f64; 64] = [0.5; 64];
const MATRIX: [f64; 64] = [2.0; 64];

fn everything(n: usize) -> Response<'static> {
    let numbers = &NUMBERS[..n];
    Response {
        disp: numbers,
        vel: numbers,
        accel: numbers,
        force: numbers,
        time: 0.25,
    }
}

enum Machine {
    Server(Server, usize),
    Actor(Actor, usize),
    Simulink(Simulink, usize),
    Client(Client, usize),
    Shadow(Shadow, usize),
}

impl Machine {
    fn new(role: Role, carrier: Carrier, n: usize) -> Self {
        let interface = Interface::of_axes(n);
        let greeting = UdpGreeting {
            hello: true,
            endian: false,
        };
        let client = |dialect, daq| {
            let settings = ClientSettings {
                dialect,
                carrier,
                sizes: Sizes::new(Counts::new(n, n, n, 0, 1), daq, SHORT).unwrap(),
                greeting,
            };
            let mut client = Client::new(settings).unwrap();
            client.open().unwrap();
            Self::Client(client, n)
        };
        match role {
            Role::Application => Self::Server(
                Server::new(ServerDialect::Application, carrier, interface),
                n,
            ),
            Role::Controller => Self::Server(
                Server::new(ServerDialect::Controller, carrier, interface),
                n,
            ),
            Role::Actor => Self::Actor(Actor::new(carrier, interface, 7.0), n),
            Role::Simulink => Self::Simulink(Simulink::new(carrier, interface), 0),
            Role::Client => client(ClientDialect::Application, Counts::new(0, 0, 0, n, 0)),
            Role::Adapter => client(ClientDialect::Adapter, Counts::new(n, 0, 0, n, 0)),
            Role::Shadow => {
                let settings = ShadowSettings {
                    carrier,
                    sizes: Sizes::new(
                        Counts::new(n, 0, 0, 0, 0),
                        Counts::new(0, 0, 0, n, 0),
                        SHORT,
                    )
                    .unwrap(),
                    site: 5.0,
                    version: 2.8,
                    greeting,
                };
                let mut shadow = Shadow::new(settings).unwrap();
                shadow.open().unwrap();
                Self::Shadow(shadow, n)
            }
        }
    }

    /// An asking machine asks before each message.
    fn ask(&mut self, log: &mut Log) {
        let command = |n: usize| Command {
            sequence: 3,
            time: 0.25,
            dt: 0.01,
            disp: &NUMBERS[..n],
            vel: &NUMBERS[..n],
        };
        let bytes = match self {
            Self::Client(client, n) => client.command(&command(*n)).map(<[u8]>::len),
            Self::Shadow(shadow, n) => shadow.command(&command(*n)).map(<[u8]>::len),
            _ => return,
        };
        log.event(&bytes.is_ok());
    }

    /// Feeds the bytes, answers requests, notes the outputs; returns how many bytes were used.
    fn feed(&mut self, bytes: &[u8], log: &mut Log) -> Result<usize, WireError> {
        match self {
            Self::Server(server, n) => {
                let (used, event) = server.feed(bytes)?;
                match event {
                    Event::NeedMore => return Ok(used),
                    Event::Greeted => log.note(server.reply()),
                    Event::Trial(_) => {
                        log.event(&server.followed().map(|of| (of.trial(), of.dt())))
                    }
                    Event::Read(_) => log.note(server.answer(&everything(*n)).unwrap()),
                    Event::Matrix(_) => {
                        log.note(server.answer_matrix(&MATRIX[..*n * *n]).unwrap());
                    }
                    _ => {}
                }
                log.event(&event);
                Ok(used)
            }
            Self::Actor(actor, n) => {
                let (used, event) = actor.feed(bytes)?;
                match event {
                    ActorEvent::NeedMore => return Ok(used),
                    ActorEvent::Trial(_) => {
                        log.event(&actor.followed().map(|of| (of.trial(), of.dt())))
                    }
                    ActorEvent::Read => log.note(actor.answer(&everything(*n)).unwrap()),
                    _ => log.note(actor.reply()),
                }
                log.event(&event);
                Ok(used)
            }
            Self::Simulink(simulink, daq) => {
                let (used, event) = simulink.feed(bytes)?;
                match event {
                    SimulinkEvent::NeedMore => return Ok(used),
                    SimulinkEvent::Ready(sizes) => *daq = sizes.daq().total(),
                    SimulinkEvent::AtTarget => {
                        log.note(simulink.answer_signals(true, &NUMBERS[..*daq]).unwrap());
                    }
                    SimulinkEvent::TargetTaken | SimulinkEvent::SwitchedBack => {
                        log.note(simulink.answer_switch(true).unwrap());
                    }
                    _ => log.note(simulink.reply()),
                }
                log.event(&event);
                Ok(used)
            }
            Self::Client(client, n) => {
                let (used, event) = client.feed(bytes)?;
                match event {
                    ClientEvent::NeedMore => return Ok(used),
                    ClientEvent::Greeted => log.note(client.reply()),
                    ClientEvent::Answer(_) => {
                        let mut into = Measurement::zeros(*n);
                        client.measurement(&mut into).unwrap();
                        assert!(into.force.iter().all(|force| force.is_finite()));
                        log.event(&into);
                    }
                }
                log.event(&event);
                Ok(used)
            }
            Self::Shadow(shadow, n) => {
                let (used, event) = shadow.feed(bytes)?;
                match event {
                    ShadowEvent::NeedMore => return Ok(used),
                    ShadowEvent::Answer => {
                        let mut into = Measurement::zeros(*n);
                        shadow.measurement(&mut into).unwrap();
                        assert!(into.force.iter().all(|force| force.is_finite()));
                        log.event(&into);
                    }
                    _ => log.note(shadow.reply()),
                }
                log.event(&event);
                Ok(used)
            }
        }
    }

    /// Feeds one message in pieces, each to its end; false when the machine has failed.
    fn hear<'a>(&mut self, pieces: impl Iterator<Item = &'a [u8]>, log: &mut Log) -> bool {
        for piece in pieces {
            let mut rest = piece;
            // Every call uses something up, so it takes at most as many calls as bytes.
            while !rest.is_empty() {
                match self.feed(rest, log) {
                    Ok(used) => {
                        assert!(used > 0 && used <= rest.len(), "{used} of {}", rest.len());
                        rest = &rest[used..];
                    }
                    Err(error) => {
                        log.event(&error);
                        assert!(self.feed(rest, log).is_err(), "it must stay failed");
                        return false;
                    }
                }
            }
        }
        true
    }
}

/// Cuts `bytes` at any places.
fn pieces<'a>(dice: &mut Dice, bytes: &'a [u8], any: bool) -> Vec<&'a [u8]> {
    let mut pieces = Vec::new();
    let mut rest = bytes;
    while any && !rest.is_empty() && pieces.len() < 6 {
        let longest = if dice.one_in(2) { 9 } else { rest.len() };
        let (piece, more) = rest.split_at((1 + dice.below(longest)).min(rest.len()));
        pieces.push(piece);
        rest = more;
    }
    if !rest.is_empty() {
        pieces.push(rest);
    }
    pieces
}

pub struct OpenFresco {
    exchanges: Vec<Exchange>,
    accepted: u64,
}

impl OpenFresco {
    pub fn new() -> Self {
        Self {
            exchanges: exchanges(),
            accepted: 0,
        }
    }
}

/// An input: role, carrier, axes, then messages, each behind its length.
fn pack(role: usize, carrier: Carrier, n: usize, messages: &[Vec<u8>]) -> Vec<u8> {
    let udp = carrier == Carrier::Datagrams;
    let mut bytes = vec![role as u8, u8::from(udp), n as u8];
    for message in messages {
        bytes.extend((message.len() as u32).to_le_bytes());
        bytes.extend(message);
    }
    bytes
}

const ROLES: [Role; 7] = [
    Role::Application,
    Role::Controller,
    Role::Actor,
    Role::Simulink,
    Role::Client,
    Role::Adapter,
    Role::Shadow,
];

impl Target for OpenFresco {
    fn name(&self) -> &'static str {
        "openfresco"
    }

    fn input(&mut self, dice: &mut Dice) -> Vec<u8> {
        let exchange = dice.pick(&self.exchanges);
        let role = *dice.pick(exchange.roles);
        let mut messages = exchange.messages.clone();
        messages.truncate(1 + dice.below(messages.len()));
        // Most of an exchange stays unchanged, so that the depths are reached.
        for _ in 0..dice.below(4) {
            let place = dice.below(messages.len());
            match dice.below(7) {
                // A count, or N.
                6 => {
                    let blocks = messages.iter_mut().find(|m| m.len() == 44 || m.len() == 20);
                    if let Some(block) = blocks {
                        let at = 4 * dice.below(block.len() / 4);
                        let count = dice.pick(&WORDS).to_le_bytes();
                        block[at..at + 4].copy_from_slice(&count);
                    }
                }
                0 => {
                    messages.remove(place);
                    if messages.is_empty() {
                        messages.push(vec![dice.roll() as u8]);
                    }
                }
                1 => messages.insert(place, messages[place].clone()),
                2 => {
                    let other = dice.below(messages.len());
                    messages.swap(place, other);
                }
                _ => {
                    let other = dice.below(messages.len());
                    let other = messages[other].clone();
                    mutate(dice, &mut messages[place], &other);
                }
            }
        }
        let carrier = match (dice.one_in(8), exchange.carrier) {
            (false, carrier) => carrier,
            (true, Carrier::Stream) => Carrier::Datagrams,
            (true, Carrier::Datagrams) => Carrier::Stream,
        };
        let n = *dice.pick(&[1, 1, 1, 2, 2, 3]);
        pack(role as usize, carrier, n, &messages)
    }

    fn check(&mut self, dice: &mut Dice, input: &[u8]) {
        let role = ROLES[usize::from(input[0])];
        let carrier = match input[1] {
            0 => Carrier::Stream,
            _ => Carrier::Datagrams,
        };
        let n = usize::from(input[2]);
        let mut messages = Vec::new();
        let mut rest = &input[3..];
        while !rest.is_empty() {
            let (length, more) = rest.split_at(4);
            let length = u32::from_le_bytes(length.try_into().unwrap()) as usize;
            let (message, more) = more.split_at(length);
            messages.push(message);
            rest = more;
        }
        let (mut whole, mut right) = (Log(1), true);
        let info = allocation_counter::measure(|| {
            let mut machine = Machine::new(role, carrier, n);
            for message in &messages {
                machine.ask(&mut whole);
                right = machine.hear(std::iter::once(*message), &mut whole);
                if !right {
                    break;
                }
            }
        });
        assert!(
            info.bytes_max <= ALLOCATION_LIMIT,
            "{} bytes allocated",
            info.bytes_max
        );
        self.accepted += u64::from(right);
        if carrier == Carrier::Datagrams {
            return;
        }
        // In pieces of any size it is the same course.
        let mut cut = Log(1);
        let mut machine = Machine::new(role, carrier, n);
        for message in messages {
            machine.ask(&mut cut);
            let any = message.len() < 3000 || dice.one_in(20);
            if !machine.hear(pieces(dice, message, any).into_iter(), &mut cut) {
                break;
            }
        }
        assert_eq!(
            whole.0, cut.0,
            "{role:?}: cut in pieces it says something else"
        );
    }

    fn accepted(&self) -> u64 {
        self.accepted
    }
}
