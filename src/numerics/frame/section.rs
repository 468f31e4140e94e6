//! Cross-sections: stiffness of elastic members, and fibres.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use super::error::listed;
use super::fibre::{Fibre, Material};
use super::symmetric::{Sym, inverse, product};
use super::{FrameError, FrameSpec, SectionSpec};

/// Stiffness along and across a member: E A, and E I about its local axis z. In space E I about y and G J, too; 0 where they are not
/// given.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Rigidity {
    pub axial: f64,
    pub bending: f64,
    pub weak: f64,
    pub torsion: f64,
}

/// E/G of steel.
const SHEAR: f64 = 2.6;

/// A section that can be computed.
#[derive(Debug)]
pub(super) struct Section {
    pub fibres: Vec<Fibre>,
    /// Of its fibres, in the order of their numbers.
    pub materials: Vec<Material>,
    /// Without fibres; the torsion of solid shapes with fibres, too.
    elastic: Rigidity,
}

/// Most fibres over the depth of a shape.
const MOST_LAYERS: usize = 200;
/// Largest number of fibres of a section.
const MOST_FIBRES: usize = 4000;

impl Section {
    /// That of an elastic member: the sum over its fibres. `None` if these bend where they are only stretched, or about both axes at
    /// once.
    pub(super) fn rigidity(&self) -> Option<Rigidity> {
        if self.fibres.is_empty() {
            return Some(self.elastic);
        }
        let [[axial, first, aside], [_, bending, both], [.., weak]] = self.virgin();
        let vanishes = |entry: f64, a: f64, b: f64| {
            entry.abs() <= 1e-9 * (a * b).sqrt().max(f64::MIN_POSITIVE)
        };
        let is_centred = vanishes(first, axial, bending)
            && vanishes(aside, axial, weak)
            && vanishes(both, bending, weak);
        is_centred.then_some(Rigidity {
            axial,
            bending,
            weak,
            torsion: self.elastic.torsion,
        })
    }

    /// G J of a solid shape, or as an elastic section gives it; 0 of others.
    pub(super) const fn torsion(&self) -> f64 {
        self.elastic.torsion
    }

    /// Σ E A l lᵀ of its fibres before the first motion, with l = (1, −y, z).
    fn virgin(&self) -> Sym<3> {
        let mut sums = [[-0.0; 3]; 3];
        for fibre in &self.fibres {
            let young =
                (self.materials.get(fibre.material)).map_or(0.0, Material::initial_stiffness);
            let levers = [1.0, -fibre.y, fibre.z];
            for (row, a) in sums.iter_mut().zip(levers) {
                for (sum, b) in row.iter_mut().zip(levers) {
                    *sum += young * fibre.area * (a * b);
                }
            }
        }
        sums
    }

    /// Largest strain of a fibre under the first axial force and moments about z and y, in parts of that at which its material yields.
    /// `None` if no material yields.
    pub(super) fn utilisation(&self, forces: [f64; 3], bends: bool) -> Option<f64> {
        let virgin = self.virgin();
        let [[a, b, _], [_, c, _], _] = virgin;
        let [axial, moment, _] = forces;
        let in_space = inverse(&virgin).filter(|_| bends);
        let det = a * c - b * b;
        let [strain, curvature, weak] = if let Some(flexibility) = in_space {
            product(&flexibility, &forces)
        } else if bends && det > 0.0 {
            [
                (c * axial - b * moment) / det,
                (a * moment - b * axial) / det,
                0.0,
            ]
        } else {
            [axial / a, 0.0, 0.0]
        };
        let each = self.fibres.iter().filter_map(|fibre| {
            let material = self.materials.get(fibre.material)?;
            material.demand(strain - fibre.y * curvature + fibre.z * weak)
        });
        each.reduce(f64::max)
    }
}

/// Reads sections of one frame.
struct Reader<'a> {
    frame: &'a FrameSpec,
    name: &'a str,
    section: Section,
    /// Number of each material so far.
    numbers: BTreeMap<&'a str, usize>,
}

impl FrameSpec {
    /// The section `name`.
    pub(super) fn section_named(&self, index: usize, name: &str) -> Result<Section, FrameError> {
        let Some((name, spec)) = self.section.get_key_value(name) else {
            return Err(FrameError::NoSection {
                index,
                name: name.to_owned(),
                known: listed(self.section.keys()),
            });
        };
        let mut reader = Reader {
            frame: self,
            name,
            section: Section {
                fibres: Vec::new(),
                materials: Vec::new(),
                elastic: Rigidity::default(),
            },
            numbers: BTreeMap::new(),
        };
        reader.read(spec)?;
        let count = reader.section.fibres.len();
        if count > MOST_FIBRES {
            let key = match spec {
                SectionSpec::Fibres(_) => "fibres",
                _ => "layers_across",
            };
            return Err(reader.wrong(key, count as f64, "at most 4000 fibres in the section"));
        }
        Ok(reader.section)
    }
}

impl<'a> Reader<'a> {
    fn read(&mut self, spec: &'a SectionSpec) -> Result<(), FrameError> {
        match spec {
            SectionSpec::Elastic(s) => {
                let young = self.positive("young_pa", s.young_pa)?;
                let in_space = |key, given: Option<f64>| match given {
                    Some(given) => self.positive(key, given),
                    None if self.in_space() => Err(FrameError::NeededInSpace {
                        section: self.name.to_owned(),
                        key,
                    }),
                    None => Ok(0.0),
                };
                let [weak, torsion] = [
                    in_space("weak_inertia_m4", s.weak_inertia_m4)?,
                    in_space("torsion_m4", s.torsion_m4)?,
                ];
                self.section.elastic = Rigidity {
                    axial: young * self.positive("area_m2", s.area_m2)?,
                    bending: young * self.positive("inertia_m4", s.inertia_m4)?,
                    weak: young * weak,
                    torsion: young / SHEAR * torsion,
                };
            }
            SectionSpec::Rectangle(s) => {
                let width = self.positive("width_m", s.width_m)?;
                let depth = self.positive("depth_m", s.depth_m)?;
                let layers = self.layers(s.layers)?;
                let across = self.across(s.layers_across)?;
                self.shape((s.young_pa, &s.material), |to| {
                    to.strip([0.0, 0.0], [depth, width], [layers, across])
                })?;
                let (long, short) = (width.max(depth), width.min(depth));
                let slender = short / long;
                let square = slender * slender;
                // Roark's Formulas for Stress and Strain, torsion of a solid rectangle.
                let torsion = long
                    * cube(short)
                    * (1.0 / 3.0 - 0.21 * slender * (1.0 - square * square / 12.0));
                self.elastic(
                    Rigidity {
                        axial: width * depth,
                        bending: width * cube(depth) / 12.0,
                        weak: depth * cube(width) / 12.0,
                        torsion,
                    },
                    s.young_pa,
                );
            }
            SectionSpec::IShape(s) => {
                let depth = self.positive("depth_m", s.depth_m)?;
                let width = self.positive("flange_width_m", s.flange_width_m)?;
                let flange = self.positive("flange_thickness_m", s.flange_thickness_m)?;
                let web = self.positive("web_thickness_m", s.web_thickness_m)?;
                // A web remains between the flanges.
                let clear = self.positive("depth_m", depth - 2.0 * flange)?;
                let beside = self.positive("flange_width_m", width - web)?;
                let layers = self.layers(s.layers)?;
                let across = self.across(s.layers_across)?;
                let of_flange = layers.div_ceil(5);
                let of_web = layers.saturating_sub(2 * of_flange).max(1);
                self.shape((s.young_pa, &s.material), |to| {
                    let centre = 0.5 * (depth - flange);
                    to.strip([-centre, 0.0], [flange, width], [of_flange, across]);
                    to.strip([0.0, 0.0], [clear, web], [of_web, 1]);
                    to.strip([centre, 0.0], [flange, width], [of_flange, across]);
                })?;
                self.elastic(
                    Rigidity {
                        axial: width * depth - beside * clear,
                        bending: (width * cube(depth) - beside * cube(clear)) / 12.0,
                        weak: (2.0 * flange * cube(width) + clear * cube(web)) / 12.0,
                        torsion: (2.0 * width * cube(flange) + clear * cube(web)) / 3.0,
                    },
                    s.young_pa,
                );
            }
            SectionSpec::Circle(s) => {
                let diameter = self.positive("diameter_m", s.diameter_m)?;
                self.round([diameter, 0.0], s.layers, (s.young_pa, &s.material))?;
            }
            SectionSpec::Tube(s) => {
                let diameter = self.positive("diameter_m", s.diameter_m)?;
                let wall = self.positive("thickness_m", s.thickness_m)?;
                let clear = self.positive("diameter_m", diameter - 2.0 * wall)?;
                self.round([diameter, clear], s.layers, (s.young_pa, &s.material))?;
            }
            SectionSpec::RcRectangle(s) => {
                let width = self.positive("width_m", s.width_m)?;
                let depth = self.positive("depth_m", s.depth_m)?;
                let cover = self.positive("cover_m", s.cover_m)?;
                let clear = self.positive("width_m", width - 2.0 * cover)?;
                let inside = self.positive("depth_m", depth - 2.0 * cover)?;
                let layers = self.layers(s.layers)?;
                let concrete = self.number("concrete", &s.concrete)?;
                let core = s
                    .core
                    .as_ref()
                    .map_or(Ok(concrete), |name| self.number("core", name))?;
                let steel = self.number("steel", &s.steel)?;
                let across = self.across(s.layers_across)?;
                let in_space = self.in_space();
                let centre = 0.5 * (depth - cover);
                // The cover above and below is as fine as the core.
                let few = ((cover / inside * layers as f64) as usize).max(1);
                let sides = match in_space {
                    true => &[-0.5, 0.5][..],
                    false => &[0.0],
                };
                let of_side = 1.0 / sides.len() as f64;
                self.with(concrete)
                    .strip([-centre, 0.0], [cover, width], [few, across]);
                for side in sides {
                    let at = [0.0, side * (width - cover)];
                    let size = [inside, 2.0 * cover * of_side];
                    self.with(concrete).strip(at, size, [layers, 1]);
                }
                self.with(concrete)
                    .strip([centre, 0.0], [cover, width], [few, across]);
                self.with(core)
                    .strip([0.0, 0.0], [inside, clear], [layers, across]);
                for (key, area, y) in [
                    ("bottom_area_m2", s.bottom_area_m2, -0.5 * inside),
                    ("middle_area_m2", s.middle_area_m2, 0.0),
                    ("top_area_m2", s.top_area_m2, 0.5 * inside),
                ] {
                    if area != 0.0 {
                        let area = self.positive(key, area)?;
                        for side in sides {
                            self.with(steel).fibre(y, side * clear, area * of_side);
                        }
                    }
                }
            }
            SectionSpec::Fibres(fibres) => {
                for fibre in fibres {
                    let material = self.number("material", &fibre.material)?;
                    let area = self.positive("area_m2", fibre.area_m2)?;
                    for (key, found) in [("y_m", fibre.y_m), ("z_m", fibre.z_m)] {
                        if !found.is_finite() {
                            return Err(self.wrong(key, found, "finite"));
                        }
                    }
                    if fibre.z_m != 0.0 && !self.in_space() {
                        return Err(self.wrong("z_m", fibre.z_m, "0 in a plane frame"));
                    }
                    self.with(material).fibre(fibre.y_m, fibre.z_m, area);
                }
                if fibres.len() < 2 {
                    let found = fibres.len() as f64;
                    return Err(self.wrong("fibres", found, "two or more of them"));
                }
            }
        }
        Ok(())
    }

    /// True of a frame in space.
    const fn in_space(&self) -> bool {
        self.frame.dimension == 3
    }

    /// A circle or a tube, cut into strips of equal depth, each at its centre of area; in space into sectors of rings.
    fn round(
        &mut self,
        diameters: [f64; 2],
        layers: usize,
        of: (Option<f64>, &'a Option<String>),
    ) -> Result<(), FrameError> {
        let layers = self.layers(layers)?;
        let in_space = self.in_space();
        self.shape(of, |to| {
            if in_space {
                return to.sectors(diameters.map(|d| 0.5 * d), layers);
            }
            let depth = diameters[0] / layers as f64;
            for layer in 0..layers {
                let bottom = layer as f64 * depth - 0.5 * diameters[0];
                let [outer, inner] = diameters.map(|d| of_circle(0.5 * d, bottom, bottom + depth));
                let area = outer.0 - inner.0;
                to.fibre((outer.1 - inner.1) / area, 0.0, area);
            }
        })?;
        let power = |d: f64| d * d * d * d;
        let [outer, inner] = diameters;
        let inertia = PI / 64.0 * (power(outer) - power(inner));
        self.elastic(
            Rigidity {
                axial: 0.25 * PI * (outer * outer - inner * inner),
                bending: inertia,
                weak: inertia,
                torsion: 2.0 * inertia,
            },
            of.0,
        );
        Ok(())
    }

    /// A solid shape has a material or is elastic.
    fn shape(
        &mut self,
        (young, material): (Option<f64>, &'a Option<String>),
        fill: impl FnOnce(&mut With<'_>),
    ) -> Result<(), FrameError> {
        match (young, material) {
            (Some(young), None) => {
                self.positive("young_pa", young)?;
            }
            (None, Some(name)) => {
                let material = self.number("material", name)?;
                fill(&mut self.with(material));
            }
            (given, _) => {
                return Err(FrameError::OneMaterial {
                    section: self.name.to_owned(),
                    both: given.is_some(),
                });
            }
        }
        Ok(())
    }

    /// An elastic shape of this area, these second moments of area and this torsion constant. One of a material twists elastically.
    fn elastic(&mut self, shape: Rigidity, young: Option<f64>) {
        let of_material = self.section.materials.first();
        let stiffness = young.or_else(|| of_material.map(Material::initial_stiffness));
        let torsion = stiffness.unwrap_or(0.0) / SHEAR * shape.torsion;
        self.section.elastic.torsion = torsion;
        if let Some(young) = young {
            self.section.elastic = Rigidity {
                axial: young * shape.axial,
                bending: young * shape.bending,
                weak: young * shape.weak,
                torsion,
            };
        }
    }

    fn with(&mut self, material: usize) -> With<'_> {
        With(&mut self.section.fibres, material)
    }

    /// The number of a material in this section.
    fn number(&mut self, key: &'static str, name: &'a str) -> Result<usize, FrameError> {
        if let Some(number) = self.numbers.get(name) {
            return Ok(*number);
        }
        let frame = self.frame;
        let spec = frame
            .material
            .get(name)
            .ok_or_else(|| FrameError::NoMaterial {
                section: self.name.to_owned(),
                key,
                name: name.to_owned(),
                known: listed(frame.material.keys()),
            })?;
        let material = spec.build().map_err(|source| FrameError::Material {
            material: name.to_owned(),
            source,
        })?;
        let number = self.section.materials.len();
        self.section.materials.push(material);
        self.numbers.insert(name, number);
        Ok(number)
    }

    fn layers(&self, found: usize) -> Result<usize, FrameError> {
        if (2..=MOST_LAYERS).contains(&found) {
            return Ok(found);
        }
        Err(self.wrong("layers", found as f64, "2 to 200"))
    }

    /// Fibres over the width: one in a plane.
    fn across(&self, found: usize) -> Result<usize, FrameError> {
        if !(2..=MOST_LAYERS).contains(&found) {
            return Err(self.wrong("layers_across", found as f64, "2 to 200"));
        }
        Ok(if self.in_space() { found } else { 1 })
    }

    fn positive(&self, key: &'static str, found: f64) -> Result<f64, FrameError> {
        if found > 0.0 && found.is_finite() {
            return Ok(found);
        }
        Err(self.wrong(key, found, "finite and greater than 0"))
    }

    fn wrong(&self, key: &'static str, found: f64, allowed: &'static str) -> FrameError {
        FrameError::Section {
            section: self.name.to_owned(),
            key,
            found,
            allowed,
        }
    }
}

/// Where fibres of one material go.
struct With<'a>(&'a mut Vec<Fibre>, usize);

impl With<'_> {
    fn fibre(&mut self, y: f64, z: f64, area: f64) {
        let material = self.1;
        let fibre = Fibre {
            y,
            z,
            area,
            material,
        };
        self.0.push(fibre);
    }

    /// A rectangle of `depth` and `width` around y and z, in layers over both.
    fn strip(&mut self, [y, z]: [f64; 2], [depth, width]: [f64; 2], [layers, across]: [usize; 2]) {
        let each = depth / layers as f64;
        let wide = width / across as f64;
        for layer in 0..layers {
            let y = y - 0.5 * depth + (layer as f64 + 0.5) * each;
            for part in 0..across {
                let z = z + (part as f64 + 0.5 - 0.5 * across as f64) * wide;
                self.fibre(y, z, each * wide);
            }
        }
    }

    /// A ring between two radii, in this many sectors of a few rings, each at its centre of area.
    fn sectors(&mut self, [outer, inner]: [f64; 2], count: usize) {
        let rings = match inner > 0.0 {
            true => 2,
            false => count.div_ceil(4),
        };
        let half = PI / count as f64;
        for ring in 0..rings {
            let [a, b] =
                [ring, ring + 1].map(|edge| inner + (outer - inner) * edge as f64 / rings as f64);
            let radius = 2.0 / 3.0 * (cube(b) - cube(a)) / (b * b - a * a) * libm::sin(half) / half;
            for sector in 0..count {
                let angle = (2 * sector + 1) as f64 * half;
                let (y, z) = (radius * libm::cos(angle), radius * libm::sin(angle));
                self.fibre(y, z, (b * b - a * a) * half);
            }
        }
    }
}

/// Area of a circle of radius `r` between two heights, and its first moment.
fn of_circle(r: f64, bottom: f64, top: f64) -> (f64, f64) {
    if r == 0.0 {
        return (0.0, 0.0);
    }
    let at = |y: f64| {
        let y = y.clamp(-r, r);
        let half = (r * r - y * y).max(0.0).sqrt();
        (
            y * half + r * r * libm::asin(y / r),
            -2.0 / 3.0 * cube(half),
        )
    };
    let (below, above) = (at(bottom), at(top));
    (above.0 - below.0, above.1 - below.1)
}

fn cube(value: f64) -> f64 {
    value * value * value
}
