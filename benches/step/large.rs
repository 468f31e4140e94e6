//! Chains beyond the caches, beside the bandwidth that the memory gives to a triad in the same run.

use crate::chain::Chain;
use crate::{timed, verdict};

/// n and goal in ms.
const GOALS: [(usize, f64); 2] = [(100_000, 0.35), (1_000_000, 7.0)];

/// Bytes that a step must move per degree of freedom, each access to a vector counted once (as a triad counts): x and v
/// read; the residual, w, x and v written, v to where the reported velocity was. All else meets them in a cache.
const BYTES: f64 = 8.0 * (2.0 + 4.0);

/// a ← b + s c over vectors that hold together what a step of `n` touches: GB/s, 24 bytes per entry.
fn triad(n: usize) -> f64 {
    // x, v, r, w and the reported velocity are five vectors.
    let entries = n * 5 / 3;
    let (mut a, b, c) = (vec![0.0; entries], vec![1.0; entries], vec![2.0; entries]);
    let (p50, _) = timed(60, |k| {
        let s = k as f64;
        for ((a, b), c) in a.iter_mut().zip(&b).zip(&c) {
            *a = *b + s * *c;
        }
        std::hint::black_box(&mut a);
    });
    24.0 * entries as f64 / (p50 * 1e3)
}

pub fn run() {
    println!("\nLong chains, one step as above; ms, p50\n");
    println!(
        "{:>9}{:>10}{:>10}{:>8}{:>13}{:>13}{:>13}{:>8}  goal",
        "n", "p50", "least", "goal", "bytes/DOF", "step GB/s", "triad GB/s", "ratio"
    );
    for (n, goal) in GOALS {
        let mut chain = Chain::new(n);
        for step in 0..10 {
            chain.step(step);
        }
        let (p50, least) = timed(100, |step| chain.step(10 + step));
        let rate = BYTES * n as f64 / (p50 * 1e3);
        let memory = triad(n);
        println!(
            "{n:>9}{:>10.3}{:>10.3}{goal:>8}{:>13}{rate:>13.1}{memory:>13.1}{:>8.2}  {}",
            p50 * 1e-3,
            least * 1e-3,
            BYTES,
            rate / memory,
            verdict(p50 * 1e-3, goal)
        );
    }
    println!(
        "bytes/DOF: what a step must read and write of its vectors; the factor of a uniform chain and the laws are stored \
         once and stay in the nearest cache. ratio: step over triad; above 1 means vectors met again in a cache."
    );
}
