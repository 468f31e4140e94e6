//! Runs of equal elements against the same elements one by one, to the bit, on all lanes.

use proptest::prelude::*;

use super::super::*;
use crate::law::{Law, LawSpec, Memoryless, Tangent};
use crate::linalg::{Lanes, SymMatrix};
use gusset_quantity::state::{Stateful, TestState, Visit};

/// A law that does not reveal its form: it cannot be part of a run.
#[derive(Debug)]
struct Hidden(Box<dyn Law>);

impl Law for Hidden {
    fn trial(&mut self, disp: f64, vel: f64, dt: f64) -> f64 {
        self.0.trial(disp, vel, dt)
    }

    fn commit(&mut self) {
        self.0.commit();
    }

    fn revert(&mut self) {
        self.0.revert();
    }

    fn tangent(&self) -> Tangent {
        self.0.tangent()
    }

    fn reference(&self) -> Tangent {
        self.0.reference()
    }

    fn bound(&self, reach: Reach) -> (Option<f64>, Option<f64>) {
        self.0.bound(reach)
    }

    fn memoryless(&self) -> Option<Memoryless> {
        None
    }
}

impl Stateful for Hidden {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.0.visit_state(visit);
    }
}

const LAWS: [&str; 5] = [
    "linear = { stiffness_n_per_m = 3.1, damping_n_s_per_m = 0.7 }",
    "biviscous = { damping_n_s_per_m = 180.0, post_yield_damping_n_s_per_m = 90.0, yield_velocity_m_per_s = 0.4 }",
    "square_root = { stiffness_n_per_m = 10.0, hardening_per_sqrt_m = 1.3 }",
    "cubic = { stiffness_n_per_m = 2.5, cubic_n_per_m3 = 1e2 }",
    // Has a memory: never in a run.
    "bilinear = { post_yield_ratio = 0, stiffness_n_per_m = 10.0, yield_force_n = 1.0 }",
];

fn built(text: &str, hidden: bool) -> Box<dyn Law> {
    let law = toml::from_str::<LawSpec>(text).unwrap().build().unwrap();
    if hidden { Box::new(Hidden(law)) } else { law }
}

/// `n` masses; elements of one law each: (law, from, to of the first one, how many), their ends moving on by one.
fn structure(n: usize, parts: &[(usize, Option<usize>, usize, usize)], hidden: bool) -> Structure {
    let mut elements = Vec::new();
    for (part, &(law, from, to, count)) in parts.iter().enumerate() {
        for i in 0..count {
            elements.push(Element {
                name: format!("part {part} element {}", i + 1),
                from: match from {
                    Some(from) => End::Dof(from + i),
                    None if part % 2 == 0 => End::Fixed,
                    None => End::Ground,
                },
                to: End::Dof(to + i),
                law: built(LAWS[law], hidden),
                reach: Reach {
                    disp: Some(1.0),
                    vel: Some(1.0),
                },
                hardening_ratio: None,
                damping_ratio: None,
            });
        }
    }
    let chain = |k: f64| {
        let springs = (1..n).flat_map(move |i| [(i - 1, i - 1, k), (i, i, k), (i - 1, i, -k)]);
        SymMatrix::from_triplets(n, springs.chain([(0, 0, k)]))
    };
    Structure::new(
        SymMatrix::diagonal(&vec![2.0; n]),
        chain(0.3),
        chain(7.0),
        vec![1.0; n],
        elements,
    )
    .unwrap()
}

fn motion(n: usize, salt: usize) -> Vec<f64> {
    (0..n)
        .map(|i| ((i * 37 + salt) % 101) as f64 / 50.0 - 1.0)
        .collect()
}

fn forces(structure: &mut Structure, salt: usize) -> Vec<u64> {
    let n = structure.dofs();
    let (x, v) = (motion(n, salt), motion(n, 3 * salt + 1));
    let base = Base {
        disp: 0.2,
        vel: -0.1,
    };
    let mut r: Vec<f64> = motion(n, 5);
    structure.subtract_internal(&x, &v, base, 0.01, &mut r);
    r.iter().map(|r| r.to_bits()).collect()
}

/// (law, from, to, how many) of the parts that every test uses: runs and singles mixed, ends that overlap.
const PARTS: [(usize, Option<usize>, usize, usize); 7] = [
    (1, None, 0, 3000),
    (2, None, 100, 2000),
    (0, Some(0), 1, 2999),
    (4, Some(3), 9, 40),
    (3, Some(7), 40, 1500),
    (2, None, 0, 10),
    (1, Some(0), 2, 200),
];

#[test]
fn run_has_the_bits_of_its_elements() {
    let (mut runs, mut singles) = (
        structure(3000, &PARTS, false),
        structure(3000, &PARTS, true),
    );
    for (turn, lanes) in Lanes::available().enumerate() {
        runs.set_lanes(lanes);
        assert_eq!(
            forces(&mut runs, turn),
            forces(&mut singles, turn),
            "{lanes}"
        );
    }
    runs.set_lanes(Lanes::best());
    runs.forget_tangents();
    assert_eq!(forces(&mut runs, 11), forces(&mut singles, 11));
}

#[test]
fn run_has_the_matrices_of_its_elements() {
    let (mut runs, mut singles) = (
        structure(3000, &PARTS, false),
        structure(3000, &PARTS, true),
    );
    let names = |s: &Structure| s.element_names().map(String::from).collect::<Vec<_>>();
    assert_eq!(names(&runs), names(&singles));
    assert_eq!(runs.parts().unwrap(), singles.parts().unwrap());
    assert_eq!(runs.stiffness_at_rest(), singles.stiffness_at_rest());
    let all = |s: &Structure| {
        [
            s.reference_stiffness(),
            s.reference_damping(),
            s.bound_stiffness().unwrap(),
            s.bound_damping().unwrap(),
            s.tangent_stiffness(),
            s.tangent_damping(),
        ]
    };
    assert_eq!(all(&runs), all(&singles));
    assert_eq!(forces(&mut runs, 2), forces(&mut singles, 2));
    assert_eq!(all(&runs), all(&singles), "after the forces");
    // After `forget_tangents`: the tangents at rest.
    let rest = structure(3000, &PARTS, false).tangent_damping();
    let mut forgets = structure(3000, &PARTS, false);
    forgets.forget_tangents();
    forces(&mut forgets, 2);
    assert_eq!(forgets.tangent_damping(), rest);
}

/// Those forces, `cut` rows at a time; `fresh` begins with zeros in place of other numbers.
fn by_rows(
    structure: &mut Structure,
    salt: usize,
    cut: usize,
    base: Base,
    fresh: bool,
) -> Vec<u64> {
    let n = structure.dofs();
    let (x, v) = (motion(n, salt), motion(n, 3 * salt + 1));
    let mut r: Vec<f64> = motion(n, 5);
    for start in (0..n).step_by(cut) {
        let motion = Motion {
            disp: &x,
            vel: &v,
            base,
            dt: 0.01,
        };
        structure.subtract_rows(start..(start + cut).min(n), motion, &mut r, fresh);
    }
    r.iter().map(|r| r.to_bits()).collect()
}

fn whole(structure: &mut Structure, salt: usize, base: Base, fresh: bool) -> Vec<u64> {
    let n = structure.dofs();
    let (x, v) = (motion(n, salt), motion(n, 3 * salt + 1));
    let mut r: Vec<f64> = if fresh { vec![0.0; n] } else { motion(n, 5) };
    structure.subtract_internal(&x, &v, base, 0.01, &mut r);
    r.iter().map(|r| r.to_bits()).collect()
}

#[test]
fn rows_at_a_time_have_the_bits_of_all_rows() {
    let moves = Base {
        disp: 0.2,
        vel: -0.1,
    };
    // First a run that an even chain takes along, then one that the moving base forbids, then none.
    let parts: [&[_]; 3] = [&PARTS, &PARTS[1..], &PARTS[2..5]];
    for (part, parts) in parts.into_iter().enumerate() {
        for hidden in [false, true] {
            let mut all = structure(3000, parts, hidden);
            let mut some = structure(3000, parts, hidden);
            some.forget_tangents();
            for (turn, lanes) in Lanes::available().enumerate() {
                some.set_lanes(lanes);
                for (k, cut) in [1, 7, 64, 640, 1664, 3000].into_iter().enumerate() {
                    let salt = 10 * turn + k;
                    let base = if k % 2 == 0 { moves } else { Base::default() };
                    let fresh = k % 3 == 0;
                    assert_eq!(
                        by_rows(&mut some, salt, cut, base, fresh),
                        whole(&mut all, salt, base, fresh),
                        "{part} {hidden} {lanes} {cut}"
                    );
                }
            }
        }
    }
}

/// A strip keeps its sliders out of its laws while it is stepped by rows: every reader gets them, and restored ones
/// are used.
#[test]
fn strip_behaves_like_its_elements() {
    let parts = [(4, None, 0, 40), (4, Some(40), 41, 30)];
    let (mut strips, mut singles) = (structure(120, &parts, false), structure(120, &parts, true));
    strips.forget_tangents();
    let saved = |s: &mut Structure| TestState::of(|visit| s.visit_state(visit)).unwrap();
    let mut kept = None;
    for salt in 0..40 {
        let base = Base::default();
        if salt % 3 == 1 {
            assert_eq!(
                whole(&mut strips, salt, base, false),
                whole(&mut singles, salt, base, false)
            );
        } else {
            assert_eq!(
                by_rows(&mut strips, salt, 17, base, false),
                whole(&mut singles, salt, base, false)
            );
        }
        assert_eq!(saved(&mut strips), saved(&mut singles), "{salt}");
        match salt % 7 {
            2 => kept = Some(saved(&mut strips)),
            4 => {
                strips.revert();
                singles.revert();
            }
            5 => {
                let kept = kept.take().unwrap();
                kept.restore(|visit| strips.visit_state(visit)).unwrap();
                kept.restore(|visit| singles.visit_state(visit)).unwrap();
            }
            _ => {}
        }
    }
}

#[test]
fn reach_is_the_widest_matrix_or_run() {
    let mut chain = structure(3000, &PARTS, false);
    assert_eq!(chain.reach(), usize::MAX, "tangents are kept");
    chain.forget_tangents();
    assert_eq!(chain.reach(), 33, "from 7 to 40");
    let mut bare = structure(100, &[(0, None, 0, 100)], false);
    bare.forget_tangents();
    assert_eq!(bare.reach(), 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Any mixture of runs about the shortest length, gaps between them, either kind of ends.
    #[test]
    fn any_mixture_of_elements_has_equal_bits(
        parts in prop::collection::vec((0usize..5, prop::option::of(0usize..40), 0usize..60, 1usize..40), 1..6)
    ) {
        let parts: Vec<_> = parts
            .into_iter()
            // Two different ends.
            .map(|(law, from, to, count)| (law, from, if from == Some(to) { to + 1 } else { to }, count))
            .collect();
        let (mut runs, mut singles) = (structure(120, &parts, false), structure(120, &parts, true));
        for salt in 0..3 {
            prop_assert_eq!(forces(&mut runs, salt), forces(&mut singles, salt));
        }
        runs.forget_tangents();
        for salt in 3..6 {
            let base = Base { disp: 0.2, vel: -0.1 };
            let cut = 17 * salt;
            prop_assert_eq!(by_rows(&mut runs, salt, cut, base, false), whole(&mut singles, salt, base, false));
        }
    }
}
