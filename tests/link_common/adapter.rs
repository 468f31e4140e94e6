//! A peer that follows OpenSees' `adapter` from a user's view: sizes, then a displacement and a request in turn. It takes no commit
//! and no second request, answers with displacement and force, and ends with the goodbye.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};

/// Doubles in a vector.
const N: usize = 256;

/// Serves one controller on a separate thread; `wiring` makes the readings of a displacement. Returns the address.
pub fn start(mut wiring: impl FnMut(f64) -> (f64, f64) + Send + 'static) -> String {
    start_for(1, move |disp| Some(wiring(disp)))
}

/// Serves this number of controllers, one after the other. Where there is no reading the connection breaks.
pub fn start_for(
    controllers: usize,
    mut wiring: impl FnMut(f64) -> Option<(f64, f64)> + Send + 'static,
) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        for _ in 0..controllers {
            let (stream, _) = listener.accept().unwrap();
            serve(stream, &mut wiring);
        }
    });
    address
}

fn serve(mut stream: TcpStream, wiring: &mut impl FnMut(f64) -> Option<(f64, f64)>) {
    let _ = stream.set_nodelay(true);
    let mut sizes = [0; 44];
    if stream.read_exact(&mut sizes).is_err() {
        return;
    }
    let mut counts = sizes
        .chunks(4)
        .map(|c| i32::from_le_bytes(c.try_into().unwrap()));
    let counts: Vec<i32> = counts.by_ref().collect();
    assert_eq!(counts, [1, 0, 0, 0, 0, 1, 0, 0, 1, 0, N as i32]);
    let mut vector = vec![0; 8 * N];
    let mut asked = true;
    let mut disp = 0.0;
    while stream.read_exact(&mut vector).is_ok() {
        let number = |at: usize| f64::from_le_bytes(vector[at..at + 8].try_into().unwrap());
        match number(0) {
            3.0 => {
                assert!(asked, "a displacement without a request between");
                (asked, disp) = (false, number(8));
            }
            10.0 => {
                assert!(!asked, "wrong action received");
                asked = true;
                let Some((disp, force)) = wiring(disp) else {
                    return;
                };
                let mut answer = vec![0; 8 * N];
                answer[..8].copy_from_slice(&disp.to_le_bytes());
                answer[8..16].copy_from_slice(&force.to_le_bytes());
                if stream.write_all(&answer).is_err() {
                    return;
                }
            }
            99.0 => return,
            other => panic!("wrong action received: {other}"),
        }
    }
}
