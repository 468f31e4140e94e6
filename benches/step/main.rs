//! One step of large models: predict, forces, solve. Each section prints its goal, what was found and its opponents of the
//! same run; compare ratios of one run, not figures of two.
//!
//! * `chain`: example 4.3 of Gui et al. 2014, n = 500 … 5000, beside a dense implementation, a banded Newton, plain
//!   sweeps and the paper's Table 2;
//! * `opponent`: chains of every law beside one C program that is written for them, `opponent.c`, on both vector widths;
//! * `large`: the same with 1e5 and 1e6 degrees of freedom, beside the bandwidth of the memory;
//! * `banded`: half bandwidth 8 and 32, beside a straightforward banded Cholesky;
//! * `mesh`: plane frame and space grid of about 1e4, sparse; `tools/superlu` times SciPy's SuperLU on the same matrices.
//!
//! `cargo bench --bench step -- chain opponent large banded mesh` chooses sections, all without a word; `dense` also times
//! dense matrices beyond 3000 (24 n² bytes: 600 MB at 5000); `export DIR` writes the matrices of `mesh` in Matrix
//! Market form. Times are medians; the load of the machine is printed, since others' work is in every figure.

#![allow(clippy::disallowed_macros, reason = "a bench prints its table")]

mod banded;
mod chain;
mod large;
mod mesh;
mod opponent;
mod opponents;

use gusset_quantity::time::Clock;
use gusset_record::rt::clock::{MonotonicClock, USUAL_SPIN_NS};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let asked = |word: &str| arguments.iter().any(|a| a == word);
    let sections = ["chain", "opponent", "large", "banded", "mesh"];
    let all = !sections.iter().any(|section| asked(section)) && !asked("export");
    println!("load average {}", load());
    if all || asked("chain") {
        chain::run(asked("dense"));
    }
    if all || asked("opponent") {
        opponent::run();
    }
    if all || asked("large") {
        large::run();
    }
    if all || asked("banded") {
        banded::run();
    }
    let export = arguments.iter().position(|a| a == "export");
    let folder = export.and_then(|at| arguments.get(at + 1));
    if all || asked("mesh") || folder.is_some() {
        mesh::run(folder.map(std::path::Path::new));
    }
    println!("\nload average {}", load());
}

/// What else runs on this machine.
fn load() -> String {
    std::fs::read_to_string("/proc/loadavg").map_or_else(
        |_| "unknown".into(),
        |text| {
            let mut words = text.split_whitespace();
            format!("{} (1 min)", words.next().unwrap_or("?"))
        },
    )
}

/// Calls `step` `times` times: median and least time in µs.
fn timed(times: usize, mut step: impl FnMut(usize)) -> (f64, f64) {
    let clock = MonotonicClock::new(USUAL_SPIN_NS);
    let mut all: Vec<u64> = (0..times)
        .map(|k| {
            let start = clock.now();
            step(k);
            clock.now().since(start)
        })
        .collect();
    all.sort_unstable();
    (all[times / 2] as f64 * 1e-3, all[0] as f64 * 1e-3)
}

/// "reached" or by how much not.
fn verdict(found: f64, goal: f64) -> String {
    if found <= goal {
        "reached".to_owned()
    } else {
        format!("missed, {:.2} × the goal", found / goal)
    }
}
