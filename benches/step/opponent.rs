//! Chains with one law at every mass, beside `opponent.c`: the same method on the same chain, written for it alone.
//!
//! Both run in turns, and what is compared is the median of the rounds' medians. The C program is compiled here, for this
//! processor and without its widest registers; without a C compiler nothing is compared.

use std::path::PathBuf;
use std::process::Command;

use gusset_numerics::law::{
    BilinearSpec, BiviscousSpec, BoucWenSpec, Law, LinearSpec, Reach, SquareRootSpec,
};
use gusset_numerics::linalg::{Lanes, SymMatrix};
use gusset_numerics::model::{Element, End, Structure};

use crate::chain::Chain;
use crate::opponents::{DAMPER, DAMPING, MASS, STIFFNESS, springs};
use crate::{timed, verdict};

/// The laws; `opponent.c` numbers them the same way.
const LAWS: [&str; 7] = [
    "none",
    "linear",
    "eq. 42",
    "biviscous",
    "bilinear",
    "Bouc-Wen",
    "all five in turn",
];
/// Ours over theirs.
const GOAL: f64 = 1.5;
const ROUNDS: usize = 5;

fn law(which: usize, mass: usize) -> Option<Box<dyn Law>> {
    let elastic = (5e4, 500.0, 0.05);
    Some(match if which == 6 { mass % 5 + 1 } else { which } {
        1 => Box::new(
            LinearSpec {
                stiffness_n_per_m: 1e4,
                damping_n_s_per_m: 50.0,
            }
            .build()
            .ok()?,
        ),
        2 => Box::new(
            SquareRootSpec {
                stiffness_n_per_m: 2e4,
                hardening_per_sqrt_m: 1.0,
            }
            .build()
            .ok()?,
        ),
        3 => Box::new(
            BiviscousSpec {
                damping_n_s_per_m: DAMPER.0,
                post_yield_damping_n_s_per_m: DAMPER.1,
                yield_velocity_m_per_s: DAMPER.2,
            }
            .build()
            .ok()?,
        ),
        4 => Box::new(
            BilinearSpec {
                stiffness_n_per_m: elastic.0,
                yield_force_n: elastic.1,
                post_yield_ratio: elastic.2,
            }
            .build()
            .ok()?,
        ),
        5 => {
            let text = format!(
                "stiffness_n_per_m = {}\nyield_force_n = {}\npost_yield_ratio = {}\nbeta = 0.6\ngamma = 0.4\nexponent = 1",
                elastic.0, elastic.1, elastic.2
            );
            let spec: BoucWenSpec = toml::from_str(&text).ok()?;
            Box::new(spec.build().ok()?)
        }
        _ => return None,
    })
}

/// A chain of `n` masses with a law between each of them and what is at rest.
fn chain(n: usize, which: usize) -> Chain {
    let elements = (0..n).filter_map(|mass| {
        Some(Element {
            name: format!("element {}", mass + 1),
            from: End::Fixed,
            to: End::Dof(mass),
            law: law(which, mass)?,
            reach: Reach::default(),
            hardening_ratio: None,
            damping_ratio: None,
        })
    });
    let structure = Structure::new(
        SymMatrix::diagonal(&vec![MASS; n]),
        springs(n, DAMPING),
        springs(n, STIFFNESS),
        vec![1.0; n],
        elements,
    );
    Chain::of(structure.expect("a sound chain"))
}

/// The program for this processor, with AVX-512 only if `lanes` are those.
fn compiled(lanes: Lanes) -> Option<PathBuf> {
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/step/opponent.c");
    let name = format!("opponent-{}", lanes.to_string().to_lowercase());
    let program = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let mut compiler = Command::new("cc");
    compiler.args(["-O3", "-march=native", "-ffast-math"]);
    if lanes != Lanes::Avx512 {
        compiler.arg("-mno-avx512f");
    }
    let status = compiler
        .arg("-o")
        .arg(&program)
        .args([source, "-lm"])
        .status();
    status.is_ok_and(|s| s.success()).then_some(program)
}

/// Median and least time of a step in µs, and the displacement of the first mass at the end.
fn theirs(program: &PathBuf, n: usize, which: usize, steps: usize) -> Option<(f64, f64, f64)> {
    let arguments = [n, steps, which].map(|number| number.to_string());
    let output = Command::new(program).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let mut numbers = text.split_whitespace().map(str::parse::<f64>);
    let mut next = || numbers.next()?.ok();
    Some((next()?, next()?, next()?))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

pub fn run() {
    println!(
        "\nChains with one law at every mass, beside opponent.c; µs per step, ours / theirs in turns\n"
    );
    println!(
        "{:>9}{:>9}  {:<17}{:>10}{:>10}{:>8}{:>10}{:>10}{:>8}  goal {GOAL}",
        "n", "lanes", "law", "ours p50", "theirs", "ratio", "ours min", "theirs", "ratio"
    );
    let wide = |lanes: &Lanes| *lanes != Lanes::Portable;
    for lanes in Lanes::available().filter(wide) {
        let Some(program) = compiled(lanes) else {
            println!("no C compiler: {lanes} is compared with nothing");
            continue;
        };
        for (n, steps) in [(5000, 2000), (100_000, 200), (1_000_000, 40)] {
            for (which, name) in LAWS.iter().enumerate() {
                // The largest chain is about memory; its laws are those of the others.
                if n == 1_000_000 && which != 3 {
                    continue;
                }
                let (mut p50, mut least) = ([Vec::new(), Vec::new()], [f64::INFINITY; 2]);
                for _ in 0..ROUNDS {
                    let mut chain = chain(n, which);
                    chain.set_lanes(lanes);
                    let ours = timed(steps, |step| chain.step(step));
                    let Some(other) = theirs(&program, n, which, steps) else {
                        println!("opponent.c does not run");
                        return;
                    };
                    let apart = (chain.state.disp[0] - other.2).abs();
                    assert!(apart < 1e-6, "{name}: {} {}", chain.state.disp[0], other.2);
                    for (side, (median, min)) in [ours, (other.0, other.1)].into_iter().enumerate()
                    {
                        p50[side].push(median);
                        least[side] = least[side].min(min);
                    }
                }
                let [ours, other] = p50.map(median);
                println!(
                    "{n:>9}{:>9}  {name:<17}{ours:>10.2}{other:>10.2}{:>8.2}{:>10.2}{:>10.2}{:>8.2}  {}",
                    lanes.to_string(),
                    ours / other,
                    least[0],
                    least[1],
                    least[0] / least[1],
                    verdict(ours / other, GOAL)
                );
            }
        }
    }
}
