//! No allocation, no panic, whatever comes.

use super::*;
use crate::openfresco::vector::write_vector;

#[test]
fn exchange_allocates_nothing_after_set_up() {
    let sizes = Sizes::full(2, 1).unwrap();
    let settings = ClientSettings {
        dialect: ClientDialect::Application,
        carrier: Carrier::Stream,
        sizes,
        greeting: UdpGreeting::NONE,
    };
    let mut client = Client::new(settings).unwrap();
    let mut server = Server::new(
        ServerDialect::Application,
        Carrier::Stream,
        Interface::of_axes(2),
    );
    server.feed(client.open().unwrap()).unwrap();
    let mut measured = Measurement::zeros(2);
    let mut sum = 0.0;
    let info = allocation_counter::measure(|| {
        for sequence in 1..200 {
            let disp = [sequence as f64, 0.5];
            let mut rest = client
                .command(&command(sequence, &disp, &[0.0; 2]))
                .unwrap();
            while !rest.is_empty() {
                let (used, _) = server.feed(rest).unwrap();
                rest = &rest[used..];
            }
            let response = Response {
                disp: &disp,
                vel: &[0.0; 2],
                accel: &[0.0; 2],
                force: &disp,
                time: 0.5,
            };
            client.feed(server.answer(&response).unwrap()).unwrap();
            client.measurement(&mut measured).unwrap();
            sum += measured.force[0];
            server.feed(client.commit(0.5).unwrap()).unwrap();
        }
    });
    assert_eq!(info.count_total, 0);
    assert_eq!(sum, (199 * 200 / 2) as f64);
}

/// Bytes that often begin like a message, so that the depths are reached.
fn plausible() -> impl Strategy<Value = Vec<u8>> {
    let code = prop_oneof![
        prop::sample::select(vec![
            1.0, 2.0, 3.0, 4.0, 4.1, 4.2, 4.3, 5.0, 6.0, 10.0, 12.0, 99.0
        ]),
        any::<f64>(),
    ];
    let number = prop_oneof![any::<f64>(), -1.0..1.0, Just(0.0), Just(3.0), Just(256.0)];
    let message = (code, prop::collection::vec(number, 0..8))
        .prop_map(|(code, values)| [vec![code], values].concat())
        .prop_map(|values| {
            values
                .into_iter()
                .flat_map(f64::to_le_bytes)
                .collect::<Vec<_>>()
        });
    let integers = prop::collection::vec(-2_i32..6, 1..12)
        .prop_map(|values| values.into_iter().flat_map(i32::to_le_bytes).collect());
    prop_oneof![
        4 => message,
        1 => integers,
        1 => prop::collection::vec(any::<u8>(), 0..90),
    ]
}

/// Runs bytes through a machine; whatever it makes of them, it uses them up or fails, and stays failed.
fn drain<E>(bytes: &[u8], mut feed: impl FnMut(&[u8]) -> Result<(usize, E), WireError>) {
    let mut rest = bytes;
    while !rest.is_empty() {
        match feed(rest) {
            Ok((used, _)) => {
                assert!(used > 0 && used <= rest.len());
                rest = &rest[used..];
            }
            Err(_) => {
                assert!(feed(rest).is_err());
                return;
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn arbitrary_bytes_never_panic(
        set_up: bool,
        chunks in prop::collection::vec(plausible(), 1..30),
        udp: bool,
        d_dialect: bool,
    ) {
        let carrier = if udp { Carrier::Datagrams } else { Carrier::Stream };
        let dialect = if d_dialect { ServerDialect::Controller } else { ServerDialect::Application };
        let sizes = sizes_bytes([1, 0, 0, 0, 1, 1, 0, 0, 1, 0, 4]);
        let mut server = Server::new(dialect, carrier, ONE);
        let mut simulink = Simulink::new(carrier, ONE);
        let mut site = if set_up { actor() } else { Actor::new(carrier, ONE, 1.0) };
        let settings = ClientSettings {
            dialect: ClientDialect::Application,
            carrier,
            sizes: Sizes::full(1, 1).unwrap(),
            greeting: UdpGreeting { hello: d_dialect, endian: false },
        };
        let mut client = Client::new(settings).unwrap();
        client.open().unwrap();
        let mut shadow = Shadow::new(shadow_settings(carrier, settings.greeting)).unwrap();
        shadow.open().unwrap();
        if set_up {
            server.feed(&sizes).unwrap();
            simulink.feed(&sizes).unwrap();
        }
        // 8 kB of first vectors, 44 bytes of sizes that are at most 4 kB of vectors.
        let limit = 8 * 65_536 * 4;
        let info = allocation_counter::measure(|| {
            for chunk in &chunks {
                drain(chunk, |bytes| server.feed(bytes));
                drain(chunk, |bytes| simulink.feed(bytes));
                drain(chunk, |bytes| site.feed(bytes));
                let _ = client.request(Reading::All);
                drain(chunk, |bytes| client.feed(bytes));
                drain(chunk, |bytes| shadow.feed(bytes));
                let response = Response::default();
                let _ = server.answer(&response);
                let _ = server.answer_matrix(&[1.0]);
                let _ = simulink.answer_switch(true);
                let _ = site.answer(&response);
            }
        });
        prop_assert!(info.bytes_max < limit);
    }

    #[test]
    fn commands_and_answers_come_back_unchanged(
        n in 1_usize..20,
        spare in 0_usize..20,
        disp in prop::collection::vec(-1e9_f64..1e9, 20),
        accel in prop::collection::vec(any::<f64>().prop_filter("finite", |f| f.is_finite()), 20),
        time in 0.0_f64..1e6,
        junk: u8,
    ) {
        let counts = Counts::new(n, n, n, 0, 1);
        let sizes = Sizes::new(counts, counts, 2 + 3 * n + spare).unwrap();
        let response = Response {
            disp: &disp[..n],
            vel: &accel[..n],
            accel: &accel[..n],
            force: &[],
            time,
        };
        let mut out = vec![junk; sizes.vector_len()];
        write_vector(&mut out, Some(3.0), &counts, &response).unwrap();
        let mut server = Server::new(ServerDialect::Application, Carrier::Stream, Interface::of_axes(n));
        let mut bytes = [0; 44];
        sizes.write(&mut bytes).unwrap();
        prop_assert_eq!(server.feed(&bytes).unwrap().1, Event::Ready(sizes));
        server.feed(&out).unwrap();
        prop_assert_eq!(server.followed().unwrap().trial(), response);
        prop_assert!(out[8 * (2 + 3 * n)..].iter().all(|byte| *byte == 0));
    }
}
