//! An OpenFresco client disconnects or runs ahead during the specimen's path to a paced target: the specimen comes to rest at
//! once.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};

use super::*;
use crate::openfresco::Host as OpenFrescoHost;
use crate::served::{LinkMaker, Whereabouts};
use crate::server::acting::{Acting, PACING, TICKS};
use crate::{SocketOptions, TcpTransport};
use gusset_control::port::WiringCheck;

/// The path to the second target is interrupted here; the first one is at the place of the specimen.
const AT: usize = TICKS as usize + 1000;
/// A quarter of a second, because no acceleration is declared.
const SLOWS: usize = 250;

fn doubles(values: &[f64]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

/// Serves a client that commands 0 and 10 mm, and sends `early` with that. During the path to 10 mm it does `act`. It
/// closes after this number of answers. Returns how its test ended, and the commands of the rig.
fn served(
    role: Role,
    early: &[u8],
    answers: usize,
    act: impl FnOnce(TcpStream) + Send + 'static,
) -> (End, Vec<f64>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    // Else bytes wait until those before them are acknowledged.
    client.set_nodelay(true).unwrap();
    let stream = listener.accept().unwrap().0;
    let rig = Acting::default();
    let acting = client.try_clone().unwrap();
    rig.acts(AT, move || act(acting));
    let behind = rig.clone();
    let links = LinkMaker::new(
        Arc::new(move |_: &Controller| Ok(Box::new(behind.clone()) as Box<dyn Substructure>)),
        Whereabouts::default(),
        1_000_000_000,
    );
    let units = vec![AxisUnits::SI];
    let specimen = ServedSpecimen::linked("rig".into(), links, units, vec![8e3], vec![0.0]);
    let limits = toml::from_str("command_disp_m = { trip = [-1, 1] }").unwrap();
    let specimen = specimen
        .checked(WiringCheck::Known, false)
        .limited(&[limits]);
    let specimen = specimen.paced(Some(PACING));
    let mut host = OpenFrescoHost::of(specimen, Nature::Physical, Some(0.01));
    let mut codec = Codec::new(role, None, Carrier::Stream, 1);
    let sizes = [1, 0, 0, 0, 0, 0, 0, 0, 1, 0, 2_i32].map(i32::to_le_bytes);
    let (_, Request::Sizes(sizes)) = codec.feed(sizes.as_flattened()).unwrap() else {
        panic!("these are the sizes");
    };
    let mut first = doubles(&[3.0, 0.0, 5.0, 0.0, 3.0, 0.01]);
    first.extend_from_slice(early);
    client.write_all(&first).unwrap();
    let opening = OpenFrescoOpening {
        codec,
        sizes,
        early: Vec::new(),
    };
    let transport = TcpTransport::from_stream(stream, SocketOptions::default()).unwrap();
    let channel = Channel {
        link: ClientLink::from(Connection::Tcp(transport)),
        peer: ([127, 0, 0, 1], 1).into(),
    };
    let (events_in, events) = unbounded();
    let shared = Arc::new(Shared::new(events_in));
    // A client that is served to the end closes behind its answer.
    let reader = std::thread::spawn({
        let mut client = client.try_clone().unwrap();
        move || {
            let mut answer = vec![0; 16 * answers];
            if client.read_exact(&mut answer).is_ok() {
                let _ = client.shutdown(Shutdown::Both);
            }
        }
    });
    let settings = ServeSettings::new(role, None);
    attend(channel, opening, &mut host, &settings, true, &shared);
    reader.join().unwrap();
    let end = events.try_iter().find_map(|event| match event {
        ServerEvent::ClientLeft(_, end, _) => Some(end),
        _ => None,
    });
    let told = rig.told.lock().unwrap().clone();
    (end.unwrap(), told)
}

#[test]
fn hurried_or_leaving_client_is_obeyed() {
    let too_far = End::Refused(ExchangeFault::TooFarAhead);
    for role in [Role::Application, Role::Controller] {
        for (kind, expected) in [
            ("goodbye", End::Finished),
            ("close", End::Vanished),
            ("queue", too_far),
            ("target", too_far),
            ("targets", too_far),
        ] {
            let early = match kind {
                "targets" => Vec::new(),
                _ => doubles(&[10.0, 0.0]),
            };
            let (end, told) = served(role, &early, 1, move |mut stream| match kind {
                "goodbye" => stream.write_all(&doubles(&[99.0, 0.0])).unwrap(),
                "close" => stream.shutdown(Shutdown::Write).unwrap(),
                "target" => stream.write_all(&doubles(&[3.0, 0.0])).unwrap(),
                "targets" => {
                    let four = doubles(&[3.0, 0.0]).repeat(4);
                    stream.write_all(&four).unwrap();
                }
                _ => {
                    stream.set_nonblocking(true).unwrap();
                    let targets = doubles(&[3.0, 0.0]).repeat(250_000);
                    let _ = stream.write(&targets).unwrap();
                    stream.shutdown(Shutdown::Write).unwrap();
                }
            });
            assert_eq!(end, expected, "{role:?} {kind}");
            assert_eq!(told.len(), AT + SLOWS, "{role:?} {kind}");
            let last: Vec<f64> = told[AT - 2..]
                .windows(2)
                .map(|two| two[1] - two[0])
                .collect();
            let is_slower = last.windows(2).all(|steps| steps[1] < steps[0]);
            assert!(is_slower, "{role:?} {kind}");
        }
    }
}

/// OpenSees commits a step and sends the next target before it asks for an answer.
#[test]
fn further_target_before_a_request_waits() {
    let early = doubles(&[5.0, 0.0, 3.0, 0.011, 10.0, 0.0]);
    let (end, told) = served(Role::Application, &early, 1, |_| {});
    assert_eq!(end, End::Vanished);
    assert!(told.contains(&0.01) && *told.last().unwrap() == 0.011);
}
