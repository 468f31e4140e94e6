//! A sketch of the test: storeys or degrees of freedom, and where the specimens sit.
//!
//! Drawn from the resolved configuration. It shows connections, not the look of the specimens.

use maud::{Markup, html};

use super::chart::{Anchor, Area, Canvas, Ink, LABEL, Lettering, fitted, page_picture};
use super::text::{number, quantity};
use crate::TestFile;
use gusset_config::StructureTable;
use gusset_numerics::model::StructureSpec;

/// Width of a sketch.
const WIDE: f64 = 560.0;
/// Storeys or DOFs that are drawn one by one; of more the ends are.
const MOST: usize = 12;
/// Specimens that are drawn.
const MOST_SPECIMENS: usize = 6;

/// Which DOFs a specimen is joined to, from 1, each with its weight; DOF 0 is the ground.
#[derive(Debug, Clone, PartialEq)]
struct Joined {
    name: String,
    storey: Option<usize>,
    dofs: Vec<(usize, f64)>,
}

fn joined(test: &TestFile) -> Vec<Joined> {
    let all = test.specimen.iter().zip(1..);
    all.map(|(entry, number)| {
        let mut dofs: Vec<(usize, f64)> = Vec::new();
        for row in entry.rows.iter().flatten() {
            for (weight, dof) in row.iter().zip(1..) {
                if *weight != 0.0 && !dofs.iter().any(|(known, _)| *known == dof) {
                    dofs.push((dof, *weight));
                }
            }
        }
        Joined {
            name: test.specimen_name(number),
            storey: entry.storey,
            dofs,
        }
    })
    .collect()
}

/// The sketch; nothing where the configuration has neither structure nor specimens.
pub(super) fn sketch(test: &TestFile) -> Markup {
    let specimens = joined(test);
    let structure = test.structure.as_ref();
    let spec = structure.and_then(StructureTable::kind);
    let dofs = match spec.map(|(_, spec)| spec) {
        Some(StructureSpec::ShearBuilding(table)) => {
            return building(&table.mass_kg, &table.stiffness_n_per_m, &specimens);
        }
        Some(StructureSpec::Matrices(matrices)) => matrices.mass.as_ref().map(Vec::len),
        Some(StructureSpec::Chain(chain)) => Some(chain.dofs),
        Some(StructureSpec::Frame(frame)) => Some(frame.places().len()),
        None => None,
    };
    let highest = specimens
        .iter()
        .flat_map(|s| s.dofs.iter().map(|d| d.0))
        .max()
        .unwrap_or(0);
    match dofs.unwrap_or(highest) {
        0 if specimens.is_empty() => Markup::default(),
        n => nodes(n, &specimens),
    }
}

/// Numbers that are drawn of 1 … n; 0 represents the omitted ones.
fn shown(n: usize) -> Vec<usize> {
    if n <= MOST {
        return (1..=n).collect();
    }
    (1..=MOST / 2)
        .chain([0])
        .chain(n + 1 - MOST / 2..=n)
        .collect()
}

fn figure(height: f64, label: &str, draw: impl FnOnce(&mut Canvas)) -> Markup {
    html! { figure { (page_picture(WIDE, height, label, draw)) } }
}

/// The ground: a line with strokes below it.
pub(super) fn hatch(canvas: &mut Canvas, from: f64, to: f64, y: f64) {
    canvas.line((from, y), (to, y), Ink::Text, 2.0);
    let mut x = from + 4.0;
    while x < to {
        canvas.line((x, y), (x - 7.0, y + 8.0), Ink::Frame, 1.0);
        x += 11.0;
    }
}

fn building(masses: &[f64], stiffness: &[f64], specimens: &[Joined]) -> Markup {
    let levels = shown(masses.len());
    let high = 46.0;
    let ground = high * levels.len() as f64 + 26.0;
    let (left, right) = (150.0, 300.0);
    let level = |place: usize| ground - high * place as f64;
    let label = format!("Sketch: a shear building of {} storeys", masses.len());
    let soft = Lettering::new(Ink::Soft);
    figure(ground + 26.0, &label, |canvas| {
        hatch(canvas, left - 30.0, right + 30.0, ground);
        for (place, &storey) in levels.iter().enumerate() {
            let (below, above) = (level(place), level(place + 1));
            let middle = (below + above) / 2.0;
            if storey == 0 {
                canvas.text(
                    "⋮",
                    ((left + right) / 2.0, middle),
                    soft.anchored(Anchor::Middle),
                );
                canvas.line((left, above), (right, above), Ink::Frame, 1.5);
                continue;
            }
            let here = specimens.iter().filter(|s| s.storey == Some(storey));
            let mut words: Vec<String> = here.map(|s| s.name.clone()).collect();
            let has_specimen = !words.is_empty();
            let (ink, width) = if has_specimen {
                (Ink::Series(1), 4.0)
            } else {
                (Ink::Text, 2.0)
            };
            for x in [left + 6.0, right - 6.0] {
                canvas.line((x, below), (x, above), ink, width);
            }
            canvas.line((left, above), (right, above), Ink::Text, 5.0);
            let mass = masses.get(storey - 1).copied().unwrap_or(f64::NAN);
            let mass = format!("{storey}:  {}", quantity(mass, "kg"));
            canvas.text(&mass, (left - 12.0, above), soft.anchored(Anchor::Right));
            // A storey without stiffness rests on its specimen alone.
            let own = stiffness.get(storey - 1).filter(|k| **k > 0.0);
            words.extend(own.map(|k| quantity(*k, "N/m")));
            let words = fitted(&words.join(" + "), LABEL * 1.1, WIDE - right - 14.0);
            let style = if has_specimen {
                Lettering::new(ink).bold()
            } else {
                soft
            };
            canvas.text(&words, (right + 14.0, middle), style);
        }
        let place_of = |dof: usize| match dof {
            0 => Some(0),
            dof => levels.iter().position(|l| *l == dof).map(|p| p + 1),
        };
        let braces = specimens
            .iter()
            .filter(|s| s.storey.is_none())
            .take(MOST_SPECIMENS);
        for (i, brace) in braces.enumerate() {
            let dofs = brace.dofs.iter().map(|d| d.0);
            let top = dofs.clone().max().unwrap_or(0);
            let low = if brace.dofs.len() > 1 {
                dofs.min().unwrap_or(0)
            } else {
                0
            };
            let (Some(low), Some(top)) = (place_of(low), place_of(top)) else {
                continue;
            };
            let shift = 10.0 * i as f64;
            let (from, to) = (
                (left + 16.0 + shift, level(low)),
                (right - 16.0 - shift, level(top)),
            );
            canvas.line(from, to, Ink::Series(1), 3.0);
            let middle = ((from.0 + to.0) / 2.0, (from.1 + to.1) / 2.0 - 12.0);
            let style = Lettering::new(Ink::Series(1))
                .bold()
                .anchored(Anchor::Middle);
            canvas.text(&fitted(&brace.name, LABEL * 1.1, 120.0), middle, style);
        }
        canvas.text(
            "ground",
            (left - 40.0, ground + 2.0),
            soft.anchored(Anchor::Right),
        );
    })
}

fn nodes(n: usize, specimens: &[Joined]) -> Markup {
    let shown_dofs = shown(n);
    let drawn: Vec<&Joined> = specimens.iter().take(MOST_SPECIMENS).collect();
    let (first, y) = (if n == 0 { 10.0 } else { 70.0 }, 34.0);
    let height = first + 24.0 + 44.0 * drawn.len().max(1) as f64;
    let label = format!(
        "Sketch: {n} degrees of freedom and {} specimens",
        specimens.len()
    );
    let spacing = ((WIDE - 60.0) / shown_dofs.len().max(1) as f64).min(90.0);
    let x_of = |place: usize| 40.0 + spacing * (place as f64 + 0.5);
    let soft = Lettering::new(Ink::Soft);
    figure(height, &label, |canvas| {
        if n > 1 {
            canvas.line(
                (x_of(0), y),
                (x_of(shown_dofs.len() - 1), y),
                Ink::Grid,
                2.0,
            );
        }
        for (place, &dof) in shown_dofs.iter().enumerate() {
            let middle = soft.anchored(Anchor::Middle);
            if dof == 0 {
                canvas.text("…", (x_of(place), y), middle);
                continue;
            }
            canvas.line((x_of(place), y), (x_of(place), y), Ink::Series(0), 14.0);
            // Names of many DOFs would lie on each other.
            let name = if spacing < 50.0 {
                dof.to_string()
            } else {
                format!("DOF {dof}")
            };
            canvas.text(&name, (x_of(place), y - 20.0), middle);
        }
        for (i, specimen) in drawn.iter().enumerate() {
            let top = first + 44.0 * i as f64;
            let at = |dof: &usize| Some(x_of(shown_dofs.iter().position(|d| d == dof)?));
            let places = specimen
                .dofs
                .iter()
                .filter_map(|(dof, weight)| Some((at(dof)?, *weight)));
            let places: Vec<(f64, f64)> = places.collect();
            let sum = places.iter().map(|p| p.0).sum::<f64>();
            let middle = if places.is_empty() {
                140.0
            } else {
                sum / places.len() as f64
            };
            let middle = middle.clamp(90.0, WIDE - 90.0);
            for (x, weight) in &places {
                canvas.line((*x, y + 7.0), (middle, top), Ink::Series(1), 1.5);
                if (weight - 1.0).abs() > 1e-12 {
                    let at = ((x + middle) / 2.0 + 4.0, (y + 7.0 + top) / 2.0);
                    canvas.text(&number(*weight, 2), at, soft);
                }
            }
            canvas.block(
                Area {
                    x: middle - 80.0,
                    y: top,
                    w: 160.0,
                    h: 26.0,
                },
                Ink::Series(1),
                0.25,
            );
            let style = Lettering::new(Ink::Text).bold().anchored(Anchor::Middle);
            canvas.text(
                &fitted(&specimen.name, LABEL * 1.1, 150.0),
                (middle, top + 13.0),
                style,
            );
            if n == 0 {
                canvas.text(
                    "← prescribed displacement →",
                    (middle + 96.0, top + 13.0),
                    soft,
                );
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ResolvedTest;

    fn of(text: &str) -> String {
        sketch(&ResolvedTest::from(text).file).0
    }

    #[test]
    fn storeys_and_specimens_are_in_place() {
        let drawn = of(
            "[structure.shear_building]\nmass_kg = [1.0, 2e3]\nstiffness_n_per_m = [0.0, 9e6]\n\
            [[specimen]]\nname = \"column <b>\"\nstorey = 1\n[[specimen]]\nname = \"brace\"\nrows = [[-0.8, 0.8]]\n",
        );
        for part in [
            "column &lt;b&gt;",
            "brace",
            "2000\u{a0}kg",
            "9.00\u{a0}MN/m",
            "ground",
        ] {
            assert!(drawn.contains(part), "{part}: {drawn}");
        }
        assert_eq!(shown(3), [1, 2, 3]);
        assert_eq!(shown(100)[5..8], [6, 0, 95]);
    }

    #[test]
    fn all_structures_are_drawn() {
        let drawn = of(
            "[structure.chain]\ndofs = 5000\nmass_kg = 1.0\nstiffness_n_per_m = 1.0\n[[specimen]]\nname = \"end\"\nrows = [[0, 0.5]]\n",
        );
        assert!(drawn.contains(">5000</text>") && drawn.contains("end") && drawn.contains("0.50"));
        assert!(of("[[specimen]]\nname = \"pad\"\n").contains("prescribed displacement"));
        assert_eq!(sketch(&TestFile::default()).0, "");
        assert_eq!(of("a = 1"), "");
    }
}
