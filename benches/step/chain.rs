//! Example 4.3: this crate's own path, [`Structure`] and [`Gui`] as the engine calls them, beside its opponents.

use std::ops::Range;

use gusset_control::engine::Side;
use gusset_evidence::frontier::Scalable;
use gusset_numerics::integrate::{Gui, Integrator, Lambda, RowForces, Start, State};
use gusset_numerics::linalg::{Aligned, Lanes};
use gusset_numerics::model::{Base, Motion, Structure};

use crate::opponents::{DT, LAMBDA, base, dense, newton, plain_sweeps};
use crate::{timed, verdict};

const LARGEST_DENSE: usize = 3000;
/// p50 at n = 5000 in µs.
const GOAL: f64 = 10.0;
/// Steps of every program: enough for a median, and the same for all, so that their results can be compared.
const STEPS: usize = 400;

/// Table 2 of Gui et al. (2014): n, then milliseconds per step as printed.
const TABLE_2: [(usize, [f64; 6]); 8] = [
    (500, [5.6, 7.2, 6.5, 0.7, 0.9, 0.9]),
    (1000, [30.1, 36.8, 34.6, 4.3, 3.9, 3.5]),
    (1500, [85.8, 100.0, 95.4, 8.2, 7.5, 6.9]),
    (2000, [177.4, 201.9, 195.6, 12.6, 12.0, 11.4]),
    (2500, [310.1, 346.4, 338.6, 18.2, 17.5, 17.0]),
    (3000, [498.3, 553.5, 538.3, 25.3, 24.4, 23.9]),
    (4000, [1058.0, 1149.6, 1128.7, 43.4, 42.4, 41.9]),
    (5000, [1871.2, 2018.8, 1992.0, 65.5, 64.8, 64.3]),
];

/// The numerical side of one chain.
pub struct Chain {
    pub structure: Structure,
    pub gui: Gui,
    pub state: State,
    pub residual: Aligned,
    pub reported: Aligned,
}

impl Chain {
    pub fn new(n: usize) -> Self {
        let Ok(Side::Structure(numerical)) = Scalable::Chain.side(n, DT, 1) else {
            panic!("no chain of {n}");
        };
        Self::of(numerical.structure)
    }

    pub fn of(mut structure: Structure) -> Self {
        let n = structure.dofs();
        // The engine does this, too, for an explicit method.
        structure.forget_tangents();
        let gui = Gui::new(
            structure.mass(),
            &structure.reference_damping(),
            &structure.reference_stiffness(),
            DT,
            Lambda::Finite(LAMBDA),
            Start::Published,
        )
        .expect("a definite effective mass");
        Self {
            structure,
            gui,
            state: State::at_rest(n),
            residual: Aligned::zeros(n),
            reported: Aligned::zeros(n),
        }
    }

    pub fn set_lanes(&mut self, lanes: Lanes) {
        self.structure.set_lanes(lanes);
        self.gui.set_lanes(lanes);
    }

    /// Forces at this step, x and v of the next: all work between a decoded reply and the next command.
    pub fn step(&mut self, step: usize) {
        let (disp, vel) = base(step);
        let mut forces = Forces(&mut self.structure, Base { disp, vel });
        let (state, reported) = (&mut self.state, &mut self.reported);
        self.gui
            .step(state, &mut forces, &mut self.residual, reported);
    }

    pub fn forces(&mut self, step: usize) {
        let (disp, vel) = base(step);
        let (state, r) = (&self.state, &mut self.residual);
        r.fill(0.0);
        self.structure
            .subtract_internal(&state.disp, &state.vel, Base { disp, vel }, DT, r);
    }

    pub fn advance(&mut self) {
        self.gui
            .advance(&mut self.state, &self.residual, &mut self.reported);
    }
}

/// The forces of a chain that nothing but its base moves.
struct Forces<'a>(&'a mut Structure, Base);

impl RowForces for Forces<'_> {
    fn reach(&self) -> usize {
        self.0.reach()
    }

    fn fill(&mut self, rows: Range<usize>, disp: &[f64], vel: &[f64], residual: &mut [f64]) {
        let motion = Motion {
            disp,
            vel,
            base: self.1,
            dt: DT,
        };
        self.0.subtract_rows(rows, motion, residual, true);
    }
}

/// Median and least time of a step in µs, and the displacement of the first mass at the end.
fn family(n: usize, lanes: Lanes) -> (f64, f64, f64) {
    let mut chain = Chain::new(n);
    chain.set_lanes(lanes);
    let (p50, least) = timed(STEPS, |step| chain.step(step));
    (p50, least, chain.state.disp[0])
}

pub fn run(all_dense: bool) {
    println!(
        "\nChain of example 4.3, one step: forces, solve, predict; λ = 4, Δt = 0.02 s; µs, p50 of {STEPS} steps\n"
    );
    let lanes: Vec<Lanes> = Lanes::available().collect();
    print!("{:>6}", "n");
    for lanes in &lanes {
        print!("{:>11}", lanes.to_string());
    }
    println!(
        "{:>11}{:>12}{:>8}{:>12}{:>8}{:>6}{:>12}{:>12}",
        "plain", "Newton", "ratio", "dense", "ratio", "it.", "paper λ=4", "paper avg."
    );
    let (mut at_goal, mut best) = (f64::NAN, f64::NAN);
    for (n, paper) in TABLE_2 {
        let found: Vec<_> = lanes.iter().map(|lanes| family(n, *lanes)).collect();
        let (ours, least, disp) = found[found.len() - 1];
        assert!(
            found.iter().all(|f| f.2.to_bits() == disp.to_bits()),
            "all lanes give the same bits"
        );
        let (plain, same) = plain_sweeps(n, STEPS);
        assert!((same - disp).abs() < 1e-9 * 0.1, "{same} {disp}");
        let (implicit, iterations, other) = newton(n, STEPS);
        assert!(
            (other - disp).abs() < 0.02,
            "both must move alike: {disp} {other}"
        );
        print!("{n:>6}");
        for (p50, ..) in &found {
            print!("{p50:>11.2}");
        }
        print!("{plain:>11.2}{implicit:>12.1}{:>7.1}x", implicit / ours);
        if n <= LARGEST_DENSE || all_dense {
            let (full, same) = dense(n, 30);
            let mut short = Chain::new(n);
            (0..30).for_each(|step| short.step(step));
            assert!((same - short.state.disp[0]).abs() < 1e-9 * 0.1, "dense");
            print!("{full:>12.0}{:>7.0}x", full / ours);
        } else {
            print!("{:>12}{:>8}", "-", "");
        }
        println!("{iterations:>6.1}{:>10.1} ms{:>9.1} ms", paper[4], paper[0]);
        (at_goal, best) = (ours, least);
    }
    let chain = Chain::new(5000);
    println!(
        "\nplain: two fused sweeps with one recurrence each, written for this chain. The paper's figures are from its Table 2 \
         (a 2014 PC, dense matrices) and not measured here."
    );
    println!(
        "n = 5000 on {}: p50 {at_goal:.2} µs, least {best:.2} µs; goal {GOAL} µs: {}; over the paper's λ = 4: {:.0} x",
        Lanes::best(),
        verdict(at_goal, GOAL),
        64_800.0 / at_goal
    );
    parts(chain);
}

/// Times the parts of a step.
fn parts(mut chain: Chain) {
    for step in 0..STEPS {
        chain.step(step);
    }
    let (forces, _) = timed(STEPS, |step| chain.forces(step));
    let (advance, _) = timed(STEPS, |_| chain.advance());
    println!(
        "its parts one after the other, as where a step cannot go by rows: forces {forces:.2} µs, solve and predict \
         {advance:.2} µs"
    );
}
