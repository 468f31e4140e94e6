mod anything;
mod both_ends;
mod course;
mod dialects;
mod server;
mod sizes;

use proptest::prelude::*;

use super::*;
use crate::WireError;
use gusset_quantity::substructure::{Command, Measurement};

const ONE: Interface = Interface { axes: 1, forces: 1 };

fn sizes_bytes(counts: [i32; 11]) -> Vec<u8> {
    counts.into_iter().flat_map(i32::to_le_bytes).collect()
}

/// N doubles: these, and stale ones behind.
fn vector(n: usize, values: &[f64]) -> Vec<u8> {
    let stale = std::iter::repeat(1234.5);
    values
        .iter()
        .copied()
        .chain(stale)
        .take(n)
        .flat_map(f64::to_le_bytes)
        .collect()
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    bytes
        .chunks_exact(8)
        .map(|word| f64::from_le_bytes(word.try_into().unwrap()))
        .collect()
}

/// A server behind `genericClient` with one degree of freedom and N = 8.
fn generic() -> Server {
    let mut server = Server::new(ServerDialect::Application, Carrier::Stream, ONE);
    let sizes = sizes_bytes([1, 1, 1, 0, 1, 0, 0, 0, 1, 0, 8]);
    assert!(matches!(server.feed(&sizes), Ok((44, Event::Ready(_)))));
    server
}

fn message(server: &mut Server, values: &[f64]) -> Event {
    let (used, event) = server.feed(&vector(8, values)).unwrap();
    assert_eq!(used, 64);
    event
}

fn trial(server: &mut Server, disp: f64, time: f64) -> Course {
    match message(server, &[3.0, disp, 0.0, 0.0, time]) {
        Event::Trial(course) => course,
        other => panic!("{other:?}"),
    }
}

fn commit(server: &mut Server, time: f64) -> u32 {
    match message(server, &[5.0, 7.7, 7.7, 7.7, time]) {
        Event::Commit { trials } => trials,
        other => panic!("{other:?}"),
    }
}

fn command<'a>(sequence: u64, disp: &'a [f64], vel: &'a [f64]) -> Command<'a> {
    Command {
        sequence,
        time: sequence as f64 * 0.01,
        dt: 0.01,
        disp,
        vel,
    }
}

fn shadow_settings(carrier: Carrier, greeting: UdpGreeting) -> ShadowSettings {
    ShadowSettings {
        carrier,
        sizes: Sizes::new(Counts::new(1, 0, 0, 0, 1), Counts::new(1, 0, 0, 1, 0), 3).unwrap(),
        site: 5.0,
        version: 2.8,
        greeting,
    }
}

/// An actor behind its set-up, with N = 3.
fn actor() -> Actor {
    let mut actor = Actor::new(Carrier::Stream, ONE, 7.0);
    actor.feed(&[1, 0, 0, 0]).unwrap();
    actor.feed(&vector(256, &[1.0, 5.0, 2.5])).unwrap();
    assert_eq!(doubles(actor.reply())[..4], [0.0, 7.0, 2.5, 0.0]);
    actor.feed(&vector(256, &[2.0, 3.0])).unwrap();
    let block = |counts: [i32; 5]| {
        counts
            .into_iter()
            .flat_map(i32::to_le_bytes)
            .collect::<Vec<_>>()
    };
    actor.feed(&block([1, 0, 0, 0, 0])).unwrap();
    let (_, event) = actor.feed(&block([0, 0, 0, 1, 0])).unwrap();
    assert!(matches!(event, ActorEvent::Ready(_)));
    actor
}
