//! The frame of the virtual hybrid simulation benchmark: its condensed matrices, cases, and motions of its linear model.

use nalgebra::{Matrix3, Vector3};

/// Steps per second.
pub const RATE_HZ: f64 = 4096.0;
/// Length of a benchmark run in s.
pub const DURATION_S: f64 = 41.0;

/// K in N/m, the same in all cases.
const STIFFNESS: [[f64; 3]; 3] = [
    [26054883.87960384, -23133938.8771082, 5937035.46333915],
    [-23133938.8771082, 32560774.18638033, -14419970.77723698],
    [5937035.46333915, -14419970.77723698, 9267275.50622431],
];

/// Floor mass in kg and the upper triangle of C in N s/m, by case.
const CASES: [(f64, [f64; 6]); 4] = [
    (
        1000.0,
        [
            14084.2757453,
            -7873.03146091,
            440.45149884,
            14943.6229379,
            -6348.67209631,
            7223.1013168,
        ],
    ),
    (
        1100.0,
        [
            11817.42262042,
            -6606.21542331,
            369.67556223,
            12538.57756973,
            -5327.04737379,
            6060.31980985,
        ],
    ),
    (
        1300.0,
        [
            9635.01436336,
            -5386.0257742,
            301.43864014,
            10223.00681177,
            -4343.08470212,
            4941.29882487,
        ],
    ),
    (
        1000.0,
        [
            8450.56544718,
            -4723.81887655,
            264.27089931,
            8966.17376274,
            -3809.20325778,
            4333.86079008,
        ],
    ),
];

/// The experimental substructure, on floor 1: kg, N s/m, N/m.
pub(crate) const SPECIMEN: (f64, f64, f64) = (29.13, 114.22, 1.19e6);

/// One case of the benchmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Floor mass of the whole frame in kg.
    pub mass: f64,
    /// C of the whole frame.
    pub damping: Matrix3<f64>,
    /// K of the whole frame.
    pub stiffness: Matrix3<f64>,
}

impl Frame {
    /// Case 1 to 4; none for another number.
    #[must_use]
    pub fn case(number: usize) -> Option<Self> {
        let (mass, c) = CASES.get(number.checked_sub(1)?)?;
        let [a, b, d, e, f, g] = *c;
        Some(Self {
            mass: *mass,
            damping: Matrix3::new(a, b, d, b, e, f, d, f, g),
            stiffness: Matrix3::from_fn(|i, j| STIFFNESS[i][j]),
        })
    }

    /// The numerical substructure: the whole frame less the specimen at floor 1.
    #[must_use]
    pub fn numerical(&self) -> Part {
        let (mass, damping, stiffness) = SPECIMEN;
        let mut part = self.whole();
        part.mass[0] -= mass;
        part.damping[(0, 0)] -= damping;
        part.stiffness[(0, 0)] -= stiffness;
        part
    }

    /// The whole frame, which is the reference.
    #[must_use]
    pub(crate) fn whole(&self) -> Part {
        Part {
            mass: Vector3::repeat(self.mass),
            load: Vector3::repeat(-self.mass),
            damping: self.damping,
            stiffness: self.stiffness,
        }
    }
}

/// A linear structure of three floors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Diagonal of M in kg.
    pub mass: Vector3<f64>,
    /// Load per ground acceleration, in kg: the whole mass is excited.
    pub load: Vector3<f64>,
    /// C.
    pub damping: Matrix3<f64>,
    /// K.
    pub stiffness: Matrix3<f64>,
}

/// Displacement and velocity of the floors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// m.
    pub disp: Vector3<f64>,
    /// m/s.
    pub vel: Vector3<f64>,
}

impl Motion {
    /// At rest.
    pub(crate) const REST: Self = Self {
        disp: Vector3::new(0.0, 0.0, 0.0),
        vel: Vector3::new(0.0, 0.0, 0.0),
    };
}

impl Part {
    /// One step of the classical Runge–Kutta method with the ground acceleration on a straight line and the specimen's force
    /// on floor 1 held.
    #[must_use]
    pub(crate) fn runge_kutta(
        &self,
        from: Motion,
        dt: f64,
        ground: [f64; 2],
        force: f64,
    ) -> Motion {
        let held = Vector3::new(-force, 0.0, 0.0);
        let slope = |at: Motion, ground: f64| {
            let force =
                self.load * ground + held - self.damping * at.vel - self.stiffness * at.disp;
            (at.vel, force.component_div(&self.mass))
        };
        let on = |(vel, accel): (Vector3<f64>, Vector3<f64>), h: f64| Motion {
            disp: from.disp + vel * h,
            vel: from.vel + accel * h,
        };
        let middle = 0.5 * (ground[0] + ground[1]);
        let a = slope(from, ground[0]);
        let b = slope(on(a, dt / 2.0), middle);
        let c = slope(on(b, dt / 2.0), middle);
        let d = slope(on(c, dt), ground[1]);
        let mean = |a: Vector3<f64>, b, c, d| (a + (b + c) * 2.0 + d) / 6.0;
        on((mean(a.0, b.0, c.0, d.0), mean(a.1, b.1, c.1, d.1)), dt)
    }
}
