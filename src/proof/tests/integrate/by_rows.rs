//! A step that is made some rows at a time against forces, solve and predictor one after the other, to the bit.

use std::ops::Range;

use super::*;
use gusset_numerics::integrate::RowForces;
use gusset_numerics::law::{LawSpec, Reach};
use gusset_numerics::linalg::{Aligned, Lanes};
use gusset_numerics::model::{Base, Element, End, Motion, Structure};

/// A chain with links of two kinds, and a law that remembers and one that does not at every other mass.
fn chain(n: usize, c: f64, k: f64) -> Structure {
    let springs = |k: f64| {
        storeys(
            &(0..n)
                .map(|i| k * (1.0 + (i % 3 / 2) as f64))
                .collect::<Vec<_>>(),
        )
    };
    let specs = [
        "biviscous = { damping_n_s_per_m = 18.0, post_yield_damping_n_s_per_m = 9.0, yield_velocity_m_per_s = 0.1 }",
        "bilinear = { post_yield_ratio = 0.1, stiffness_n_per_m = 300.0, yield_force_n = 1.0 }",
        "square_root = { stiffness_n_per_m = 50.0, hardening_per_sqrt_m = 1.3 }",
    ];
    let laws = specs.map(|text| toml::from_str::<LawSpec>(text).unwrap());
    let element = |law: usize, from: End, to: usize| Element {
        name: format!("law {law} at {to}"),
        from,
        to: End::Dof(to),
        law: laws[law].build().unwrap(),
        reach: Reach::default(),
        hardening_ratio: None,
        damping_ratio: None,
    };
    let dampers = (0..n).map(|i| element(0, End::Fixed, i));
    let yielding = (0..n / 2).map(|i| element(1, End::Dof(2 * i), 2 * i + 1));
    let storeys = (1..n).map(|i| element(2, End::Dof(i - 1), i));
    Structure::new(
        SymMatrix::diagonal(&vec![15.0; n]),
        springs(c),
        springs(k),
        vec![1.0; n],
        dampers.chain(yielding).chain(storeys),
    )
    .unwrap()
}

struct Forces<'a>(&'a mut Structure, usize, Vec<Range<usize>>);

const DT: f64 = 0.02;

impl Forces<'_> {
    fn base(&self) -> Base {
        let angle = 0.1 * self.1 as f64;
        Base {
            disp: 0.1 * libm::sin(angle),
            vel: 0.5 * libm::cos(angle),
        }
    }
}

impl RowForces for Forces<'_> {
    fn reach(&self) -> usize {
        self.0.reach()
    }

    fn fill(&mut self, rows: Range<usize>, disp: &[f64], vel: &[f64], residual: &mut [f64]) {
        let base = self.base();
        self.2.push(rows.clone());
        let motion = Motion {
            disp,
            vel,
            base,
            dt: DT,
        };
        self.0.subtract_rows(rows, motion, residual, true);
    }
}

#[test]
fn rows_at_a_time_give_equal_bits() {
    // Factors in blocks whose ends do not see each other, in blocks whose ends do, and without blocks.
    // Zeros have the sign that 0 − K x − C v gives, too.
    let cases = [
        (3000, 1.0, 2.5e4, 5),
        (9000, 1.0, 1e9, 2),
        (60, 1.0, 2.5e4, 1),
        (3000, 1.0, 0.0, 1),
        (3000, 0.0, 0.0, 1),
        (3000, 0.0, 2.5e4, 5),
    ];
    for (n, c, k, blocks) in cases {
        for start in [Start::Published, Start::SecondOrder] {
            let (mut one, mut other) = (chain(n, c, k), chain(n, c, k));
            other.forget_tangents();
            let make = |s: &Structure| {
                let (c, k) = (s.reference_damping(), s.reference_stiffness());
                Gui::new(s.mass(), &c, &k, DT, Lambda::Finite(4.0), start).unwrap()
            };
            let (mut whole, mut by_rows) = (make(&one), make(&other));
            let (mut a, mut b) = (State::at_rest(n), State::at_rest(n));
            (a.vel[1], b.vel[1]) = (0.5, 0.5);
            let (mut r, mut reported) = (vec![0.0; n], vec![0.0; n]);
            let (mut r_rows, mut reported_rows) = (vec![7.0; n], Aligned::zeros(n));
            let widths: Vec<_> = Lanes::available().collect();
            for (step, lanes) in widths.into_iter().cycle().take(40).enumerate() {
                by_rows.set_lanes(lanes);
                other.set_lanes(lanes);
                r.fill(0.0);
                let base = Forces(&mut one, step, Vec::new()).base();
                one.subtract_internal(&a.disp, &a.vel, base, DT, &mut r);
                whole.advance(&mut a, &r, &mut reported);
                let mut forces = Forces(&mut other, step, Vec::new());
                by_rows.step(&mut b, &mut forces, &mut r_rows, &mut reported_rows);
                for (one, other) in [
                    (&a.disp[..], &b.disp[..]),
                    (&a.vel, &b.vel),
                    (&a.weighted_accel, &b.weighted_accel),
                    (&r, &r_rows),
                    (&reported, &reported_rows),
                ] {
                    let differs = (0..n).find(|i| one[*i].to_bits() != other[*i].to_bits());
                    assert_eq!(differs, None, "{n} {c} {k} {start:?} {step} {lanes}");
                }
                let asked = forces.2;
                assert_eq!(asked.iter().map(Range::len).sum::<usize>(), n);
                if start == Start::Published {
                    assert!(asked.len() >= blocks, "{n}: {asked:?}");
                }
            }
            assert!(a.disp[1].abs() > 1e-6);
        }
    }
}
