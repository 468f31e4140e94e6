//! The initial positions of a test's rigs, and the readings of their sensors and load cells there. Also how the test takes its
//! zeros and ends, and a record of each actuator's motion.
//!
//! All of it comes from a separate random stream: everything else in a test with that seed stays unchanged.

use std::sync::{Arc, Mutex, MutexGuard};

use gusset_actuator::specimen::{Specimen, SpecimenLaw};
use gusset_config::{
    AxisTable, DispUnit, ExitChoice, ForceUnit, LimitsSpec, Loaded, RangeSpec, ZeroChoice,
};
use gusset_link::NativeSetup;
use gusset_link::server::Host;
use gusset_numerics::law::{LawSpec, Reach};
use gusset_quantity::catalog::limit::Limit;
use gusset_quantity::state::{Stateful, Visit};

use crate::campaign::Chance;

/// The position of one rig in its own coordinate, and its readings there.
#[derive(Debug, Clone, Copy, Default)]
pub struct Place {
    pub stands_m: f64,
    /// Where its specimen has no force.
    pub slack_m: f64,
    pub disp_bias_m: f64,
    pub force_bias_n: f64,
}

/// The state of one rig seen from outside, in the unit of its commands.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    pub stood: f64,
    /// Where its actuator was driven, in this order.
    pub driven: Arc<Mutex<Vec<f64>>>,
}

/// Draws the positions of the rigs of `loaded`, and adapts the test to them.
pub fn draw(seed: u64, loaded: &Loaded) -> (Loaded, Vec<Place>) {
    let mut chance = Chance::new(seed.rotate_left(32) ^ 0x0051_A9D5);
    let mut loaded = loaded.clone();
    let mut unbounded = false;
    let reads = loaded.file.safety.zero_s.is_none_or(|zero| zero > 0.0);
    let places = (0..loaded.file.specimen.len())
        .map(|index| {
            if chance.one_in(4) {
                return Place::default();
            }
            let place = a_place(&mut chance);
            let table = &mut loaded.file.specimen[index];
            table.axis = vec![an_axis(&mut chance, &place, reads)];
            if let Some(link) = &mut table.link
                && chance.one_in(4)
            {
                link.probe_m = Some(chance.between(2e-4, 2e-3));
                link.probe_ramp_s = chance.between(0.03, 0.2);
            }
            if chance.one_in(5)
                && let Some(limits) = &mut table.limits
            {
                limits.set(Limit::CommandVel, None);
                limits.set(Limit::CommandStep, None);
                unbounded = true;
            }
            place
        })
        .collect();
    loaded.file.safety.ramp_s = match chance.below(8) {
        // The speed of a static load that nothing else bounds.
        _ if unbounded => chance.between(0.2, 1.0),
        0 => 0.0,
        1 => 1.0,
        _ => chance.between(0.02, 0.4),
    };
    if chance.one_in(2) {
        let mut exit = || match chance.below(4) {
            0 => ExitChoice::Freeze,
            1 => ExitChoice::ZeroForce,
            2 => ExitChoice::ZeroDisplacement,
            _ => ExitChoice::SafeDisplacement,
        };
        (loaded.file.safety.on_trip, loaded.file.safety.at_end) = (exit(), exit());
        loaded.file.safety.exit_speed_m_per_s = Some(chance.between(0.01, 0.1));
        for table in &mut loaded.file.specimen {
            table.safe_disp_m = Some(vec![chance.between(-0.045, 0.045)]);
        }
    }
    (loaded, places)
}

fn a_place(chance: &mut Chance) -> Place {
    let far = match chance.below(8) {
        0 => 0.0,
        1..=5 => 0.02,
        6 => 0.045,
        // A command to hold it there may exceed the limit.
        _ => 0.07,
    };
    let stands_m = chance.between(-far, far);
    let slack_m = match chance.below(4) {
        0 => 0.0,
        1 => stands_m,
        _ => stands_m + chance.between(-0.006, 0.006),
    };
    let reads = |chance: &mut Chance, most: f64| match chance.below(4) {
        0 | 1 => 0.0,
        2 => chance.between(-0.1 * most, 0.1 * most),
        _ => chance.between(-most, most),
    };
    Place {
        stands_m,
        slack_m,
        disp_bias_m: reads(chance, 0.01),
        force_bias_n: reads(chance, 1.5e5),
    }
}

/// `reads`: the sensors are read before the test, so that a zero can be taken of them.
fn an_axis(chance: &mut Chance, place: &Place, reads: bool) -> AxisTable {
    let mut zero = || {
        if reads && chance.one_in(2) {
            ZeroChoice::Relative
        } else {
            ZeroChoice::Absolute
        }
    };
    let (zero_disp, zero_force) = (zero(), zero());
    AxisTable {
        scale: if chance.one_in(3) {
            chance.between(0.8, 1.25)
        } else {
            1.0
        },
        sign: if chance.one_in(3) { -1 } else { 1 },
        offset_m: match chance.below(3) {
            0 => 0.0,
            1 => place.stands_m,
            _ => place.stands_m + chance.between(-0.01, 0.01),
        },
        offset_n: if chance.one_in(2) {
            place.force_bias_n
        } else {
            0.0
        },
        unit_disp: if chance.one_in(3) {
            DispUnit::Millimetre
        } else {
            DispUnit::Metre
        },
        unit_force: if chance.one_in(3) {
            ForceUnit::Kilonewton
        } else {
            ForceUnit::Newton
        },
        zero_disp,
        zero_force,
        ..AxisTable::default()
    }
}

/// The limits at a far end: 30 mm to either side of its position.
pub fn own_limits(place: &Place) -> LimitsSpec {
    let trip = [place.stands_m - 0.03, place.stands_m + 0.03];
    let levels = RangeSpec {
        warn: None,
        trip: Some(trip),
    };
    LimitsSpec::default().with(Limit::CommandDisp, levels)
}

/// A rig whose columns yield. It keeps its state, whichever controller is connected.
pub struct Rig {
    name: String,
    metres: f64,
    newtons: f64,
    place: Place,
    law: Arc<Mutex<Box<dyn Specimen>>>,
    seen: Seen,
}

impl Rig {
    pub fn new(loaded: &Loaded, index: usize, place: &Place) -> Self {
        let table = &loaded.file.specimen[index];
        let units = table.units_of(1)[0];
        let stiffness = if index == 0 { 15e6 } else { 2e6 };
        let text = format!(
            "bouc_wen = {{ stiffness_n_per_m = {stiffness}, yield_force_n = {}, post_yield_ratio = 0.1, beta = 0.5, \
             gamma = 0.5, exponent = 2 }}",
            stiffness * 0.008
        );
        let spec: LawSpec = toml::from_str(&text).unwrap();
        let law = SpecimenLaw::Law(spec).build(1).unwrap();
        Self {
            name: table.name.clone(),
            metres: units.metres,
            newtons: units.newtons,
            place: *place,
            law: Arc::new(Mutex::new(law)),
            seen: Seen {
                stood: place.stands_m / units.metres,
                driven: Arc::default(),
            },
        }
    }

    /// A far end in the units of the link, and the record of its motion from now on.
    pub fn host(&mut self, setup: &NativeSetup) -> (Host, Seen) {
        let last = self.seen.driven.lock().unwrap().last().copied();
        let stood = last.unwrap_or(self.seen.stood);
        self.seen = Seen {
            stood,
            driven: Arc::default(),
        };
        let (metres, newtons, place) = (self.metres, self.newtons, self.place);
        let (law, driven) = (Arc::clone(&self.law), Arc::clone(&self.seen.driven));
        let build = move || {
            Ok(Box::new(Witnessed {
                law: Arc::clone(&law),
                metres,
                newtons,
                place,
                driven: Arc::clone(&driven),
            }) as Box<dyn Specimen>)
        };
        let name = self.name.clone();
        let mut host = Host::new(name, setup.axes.clone(), Box::new(build)).unwrap();
        if stood != 0.0 {
            host = host.standing_at(&[stood]).unwrap();
        }
        // Motion before the first command does not count.
        self.seen.driven.lock().unwrap().clear();
        (host, self.seen.clone())
    }

    /// Somebody moves it while no controller is connected.
    pub fn push(&mut self, by_m: f64) {
        let mut driven = self.seen.driven.lock().unwrap();
        let place = driven.last().copied().unwrap_or(self.seen.stood);
        driven.push(place + by_m / self.metres);
    }
}

/// A specimen in a rig that writes down where it is driven.
#[derive(Debug)]
struct Witnessed {
    law: Arc<Mutex<Box<dyn Specimen>>>,
    metres: f64,
    newtons: f64,
    place: Place,
    driven: Arc<Mutex<Vec<f64>>>,
}

impl Witnessed {
    fn law(&self) -> MutexGuard<'_, Box<dyn Specimen>> {
        self.law.lock().unwrap()
    }

    fn scale(&self, matrix: &mut [f64]) {
        for value in matrix {
            *value *= self.metres / self.newtons;
        }
    }
}

impl Specimen for Witnessed {
    fn axes(&self) -> usize {
        1
    }

    fn trial(&mut self, disp: &[f64], vel: &[f64], dt: f64, force: &mut [f64]) {
        self.driven.lock().unwrap().push(disp[0]);
        let strain = self.metres * disp[0] - self.place.slack_m;
        self.law()
            .trial(&[strain], &[self.metres * vel[0]], dt, force);
        force[0] = (force[0] + self.place.force_bias_n) / self.newtons;
    }

    fn measured(&mut self, disp: &mut [f64]) {
        disp[0] += self.place.disp_bias_m / self.metres;
    }

    fn commit(&mut self) {
        self.law().commit();
    }

    fn revert(&mut self) {
        self.law().revert();
    }

    fn reference(&self, stiffness: &mut [f64], damping: &mut [f64], mass: &mut [f64]) {
        self.law().reference(stiffness, damping, mass);
        self.scale(stiffness);
    }

    fn tangent(&self, stiffness: &mut [f64]) {
        self.law().tangent(stiffness);
        self.scale(stiffness);
    }

    fn bound(
        &self,
        reach: &[Reach],
        stiffness: &mut [f64],
        damping: &mut [f64],
    ) -> Result<(), usize> {
        self.law().bound(reach, stiffness, damping)
    }
}

impl Stateful for Witnessed {
    fn visit_state(&mut self, visit: &mut dyn Visit) {
        self.law().visit_state(visit);
    }
}
