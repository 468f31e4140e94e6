//! A peer that keeps to OpenFresco's `startSimAppElemServer` with one axis: displacement, velocity, acceleration and time are
//! answered with zero, whatever was commanded; only the force and the matrices are real.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};

/// Serves one controller in a thread, with a spring of `stiffness` N/m. Returns the address and the list of
/// commanded displacements.
pub fn start(stiffness: f64) -> (String, Arc<Mutex<Vec<f64>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let told = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&told);
    std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        serve(stream, stiffness, &into);
    });
    (address, told)
}

fn serve(mut stream: TcpStream, stiffness: f64, told: &Mutex<Vec<f64>>) {
    let _ = stream.set_nodelay(true);
    let mut sizes = [0; 44];
    if stream.read_exact(&mut sizes).is_err() {
        return;
    }
    let counts = sizes.chunks(4);
    let counts: Vec<i32> = counts
        .map(|c| i32::from_le_bytes(c.try_into().unwrap()))
        .collect();
    // A count is 0 or the number of the element's degrees of freedom.
    assert!(counts[..10].iter().all(|count| [0, 1].contains(count)));
    let force_at = 8 * counts[5..8].iter().sum::<i32>() as usize;
    let bytes = 8 * counts[10] as usize;
    let (mut vector, mut disp) = (vec![0; bytes], 0.0);
    while stream.read_exact(&mut vector).is_ok() {
        let number = |at: usize| f64::from_le_bytes(vector[at..at + 8].try_into().unwrap());
        let mut answer = vec![0; bytes];
        match number(0) {
            3.0 => {
                disp = number(8);
                told.lock().unwrap().push(disp);
                continue;
            }
            5.0 => continue,
            6.0..=11.0 => {
                let force: f64 = stiffness * disp;
                answer[force_at..force_at + 8].copy_from_slice(&force.to_le_bytes());
            }
            12.0 | 13.0 => answer[..8].copy_from_slice(&stiffness.to_le_bytes()),
            14.0 | 15.0 => {}
            99.0 => return,
            other => panic!("wrong action received: {other}"),
        }
        if stream.write_all(&answer).is_err() {
            return;
        }
    }
}
