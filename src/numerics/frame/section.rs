//! Cross-sections: stiffness of elastic members, and fibres.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use super::error::listed;
use super::fibre::{Fibre, Material};
use super::{FrameError, FrameSpec, SectionSpec};

/// Stiffness along and across a member: E A and E I.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rigidity {
    pub axial: f64,
    pub bending: f64,
}

/// A section that can be computed.
#[derive(Debug)]
pub(super) struct Section {
    pub fibres: Vec<Fibre>,
    /// Of its fibres, in the order of their numbers.
    pub materials: Vec<Material>,
    /// Without fibres.
    elastic: Rigidity,
}

/// Most fibres over the depth of a shape.
const MOST_LAYERS: usize = 200;

impl Section {
    /// That of an elastic member: the sum over its fibres. `None` if these bend where they are only stretched.
    pub(super) fn rigidity(&self) -> Option<Rigidity> {
        if self.fibres.is_empty() {
            return Some(self.elastic);
        }
        let [axial, first, bending] = self.virgin();
        (first.abs() <= 1e-9 * (axial * bending).sqrt()).then_some(Rigidity { axial, bending })
    }

    /// Σ E A, Σ E A y and Σ E A y² of its fibres before the first motion.
    fn virgin(&self) -> [f64; 3] {
        [0, 1, 2].map(|power| {
            let each = self.fibres.iter().map(|fibre| {
                let young =
                    (self.materials.get(fibre.material)).map_or(0.0, Material::initial_stiffness);
                young * fibre.area * fibre.y.powi(power)
            });
            each.sum()
        })
    }

    /// Largest strain of a fibre under the first axial force and moment, in parts of that at which its material yields. `None` if
    /// no material yields.
    pub(super) fn utilisation(&self, axial: f64, moment: f64, bends: bool) -> Option<f64> {
        let [a, b, c] = self.virgin();
        let det = a * c - b * b;
        let [strain, curvature] = if bends && det > 0.0 {
            [
                (c * axial + b * moment) / det,
                (a * moment + b * axial) / det,
            ]
        } else {
            [axial / a, 0.0]
        };
        let each = self.fibres.iter().filter_map(|fibre| {
            let material = self.materials.get(fibre.material)?;
            material.demand(strain - fibre.y * curvature)
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
                elastic: Rigidity {
                    axial: 0.0,
                    bending: 0.0,
                },
            },
            numbers: BTreeMap::new(),
        };
        reader.read(spec)?;
        Ok(reader.section)
    }
}

impl<'a> Reader<'a> {
    fn read(&mut self, spec: &'a SectionSpec) -> Result<(), FrameError> {
        match spec {
            SectionSpec::Elastic(s) => {
                let young = self.positive("young_pa", s.young_pa)?;
                self.section.elastic = Rigidity {
                    axial: young * self.positive("area_m2", s.area_m2)?,
                    bending: young * self.positive("inertia_m4", s.inertia_m4)?,
                };
            }
            SectionSpec::Rectangle(s) => {
                let width = self.positive("width_m", s.width_m)?;
                let depth = self.positive("depth_m", s.depth_m)?;
                let layers = self.layers(s.layers)?;
                self.shape((s.young_pa, &s.material), |to| {
                    to.strip(0.0, depth, width, layers)
                })?;
                self.elastic(width * depth, width * cube(depth) / 12.0, s.young_pa);
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
                let of_flange = layers.div_ceil(5);
                let of_web = layers.saturating_sub(2 * of_flange).max(1);
                self.shape((s.young_pa, &s.material), |to| {
                    let centre = 0.5 * (depth - flange);
                    to.strip(-centre, flange, width, of_flange);
                    to.strip(0.0, clear, web, of_web);
                    to.strip(centre, flange, width, of_flange);
                })?;
                self.elastic(
                    width * depth - beside * clear,
                    (width * cube(depth) - beside * cube(clear)) / 12.0,
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
                let centre = 0.5 * (depth - cover);
                // The cover above and below is as fine as the core.
                let few = ((cover / inside * layers as f64) as usize).max(1);
                self.with(concrete).strip(-centre, cover, width, few);
                self.with(concrete).strip(0.0, inside, 2.0 * cover, layers);
                self.with(concrete).strip(centre, cover, width, few);
                self.with(core).strip(0.0, inside, clear, layers);
                for (key, area, y) in [
                    ("bottom_area_m2", s.bottom_area_m2, -0.5 * inside),
                    ("middle_area_m2", s.middle_area_m2, 0.0),
                    ("top_area_m2", s.top_area_m2, 0.5 * inside),
                ] {
                    if area != 0.0 {
                        let area = self.positive(key, area)?;
                        self.with(steel).fibre(y, area);
                    }
                }
            }
            SectionSpec::Fibres(fibres) => {
                for fibre in fibres {
                    let material = self.number("material", &fibre.material)?;
                    let area = self.positive("area_m2", fibre.area_m2)?;
                    if !fibre.y_m.is_finite() {
                        return Err(self.wrong("y_m", fibre.y_m, "finite"));
                    }
                    self.with(material).fibre(fibre.y_m, area);
                }
                if fibres.len() < 2 {
                    let found = fibres.len() as f64;
                    return Err(self.wrong("fibres", found, "two or more of them"));
                }
            }
        }
        Ok(())
    }

    /// A circle or a tube, cut into strips of equal depth, each at its centre of area.
    fn round(
        &mut self,
        diameters: [f64; 2],
        layers: usize,
        of: (Option<f64>, &'a Option<String>),
    ) -> Result<(), FrameError> {
        let layers = self.layers(layers)?;
        self.shape(of, |to| {
            let depth = diameters[0] / layers as f64;
            for layer in 0..layers {
                let bottom = layer as f64 * depth - 0.5 * diameters[0];
                let [outer, inner] = diameters.map(|d| of_circle(0.5 * d, bottom, bottom + depth));
                let area = outer.0 - inner.0;
                to.fibre((outer.1 - inner.1) / area, area);
            }
        })?;
        let power = |d: f64| d * d * d * d;
        let [outer, inner] = diameters;
        let area = 0.25 * PI * (outer * outer - inner * inner);
        self.elastic(area, PI / 64.0 * (power(outer) - power(inner)), of.0);
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

    fn elastic(&mut self, area: f64, inertia: f64, young: Option<f64>) {
        if let Some(young) = young {
            self.section.elastic = Rigidity {
                axial: young * area,
                bending: young * inertia,
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
    fn fibre(&mut self, y: f64, area: f64) {
        let material = self.1;
        self.0.push(Fibre { y, area, material });
    }

    /// A rectangle of `depth` and `width` around `centre`, in layers.
    fn strip(&mut self, centre: f64, depth: f64, width: f64, layers: usize) {
        let each = depth / layers as f64;
        for layer in 0..layers {
            let y = centre - 0.5 * depth + (layer as f64 + 0.5) * each;
            self.fibre(y, each * width);
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
