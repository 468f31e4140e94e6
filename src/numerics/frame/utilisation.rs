//! How much of its strength each member uses under static loads, from the stiffness of the virgin frame.

use super::model::influence;
use super::{FrameError, FrameSpec, MemberKind};
use crate::linalg::{Spd, SymMatrix};

/// A member under static loads.
#[derive(Debug, Clone, PartialEq)]
pub struct MemberUse {
    /// Its name, or "member" and its number.
    pub name: String,
    /// Length between its ends in m.
    pub length: f64,
    /// Largest strain of a fibre over its yield strain, or largest moment of a hinge over its yield moment, at both ends. `None` if
    /// it has neither, or if the frame does not stand without its specimens.
    pub utilisation: Option<f64>,
}

impl FrameSpec {
    /// The members under static loads of the degrees of freedom in N and N m. Forces follow from the stiffness of all members and
    /// links at rest, and of the specimens `beside` them. Without that matrix (n × n) no utilisation is known.
    ///
    /// # Errors
    /// See [`FrameError`].
    pub fn members_under(
        &self,
        load: &[f64],
        beside: Option<&SymMatrix>,
    ) -> Result<Vec<MemberUse>, FrameError> {
        let model = self.model()?;
        let stiffness = beside.map(|beside| model.stiffness.plus(1.0, beside));
        let factor = stiffness.and_then(|stiffness| Spd::factor(&stiffness).ok());
        let disp = factor.map(|mut factor| {
            let mut disp = load.to_vec();
            factor.solve_in_place(&mut disp);
            disp
        });
        let parts = self.parts(&model, &influence(&model.dofs))?;
        let mut members = Vec::with_capacity(self.member.len());
        for (index, (spec, part)) in self.member.iter().zip(parts).enumerate() {
            let mut utilisation: Option<f64> = None;
            if let Some(disp) = &disp {
                let [axial, start, end, weak_start, weak_end, _] = part.first_forces(disp);
                let section = self.section_named(index, &spec.section)?;
                let bends = spec.kind != MemberKind::Truss;
                let hinges = [(&spec.hinge_start, start), (&spec.hinge_end, end)];
                let of_hinges = hinges.map(|(name, moment)| {
                    let yields = self.hinge.get(name.as_ref()?)?.yield_force()?;
                    Some(moment.abs() / yields)
                });
                // The moment of a section is positive where it stretches the fibres at −y.
                let of_sections = [[axial, -start, -weak_start], [axial, end, weak_end]]
                    .map(|forces| section.utilisation(forces, bends));
                let all = of_hinges.into_iter().chain(of_sections).flatten();
                utilisation = all.reduce(f64::max);
            }
            members.push(MemberUse {
                length: part.ends().map_or(0.0, |ends| ends.chord.length()),
                name: part.title.1,
                utilisation,
            });
        }
        Ok(members)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const YOUNG: f64 = 2.0e11;
    const STEEL: f64 = 3.0e8 / YOUNG;
    const LENGTH: f64 = 3.0;
    const WIDTH: f64 = 0.1;
    const DEPTH: f64 = 0.2;
    const LAYERS: f64 = 20.0;

    /// A cantilever to the right with this tip load.
    fn used(member: &str, load: &str) -> Option<f64> {
        used_beside(member, load, Some(0.0))
    }

    /// Beside specimens with `share` times the stiffness of the frame.
    fn used_beside(member: &str, load: &str, share: Option<f64>) -> Option<f64> {
        let spec: FrameSpec = toml::from_str(&format!(
            "node = [{{ name = 'a', at_m = [0, 0], fixed = ['x', 'y', 'rz'] }}, {{ name = 'b', at_m = [{LENGTH}, 0] }}]\n\
             member = [{{ nodes = ['a', 'b'], {member} }}]\n\
             load = [{{ node = 'b', {load} }}]\n\
             material.steel.menegotto_pinto = {{ young_pa = {YOUNG:e}, yield_pa = 3e8, hardening_ratio = 0.01 }}\n\
             material.concrete.concrete_01 = {{ strength_pa = 3e7, strain_at_strength = 0.002, crushing_strength_pa = 6e6, \
             crushing_strain = 0.01 }}\n\
             section.steel.rectangle = {{ material = 'steel', width_m = {WIDTH}, depth_m = {DEPTH}, layers = {LAYERS} }}\n\
             section.concrete.rectangle = {{ material = 'concrete', width_m = {WIDTH}, depth_m = {DEPTH} }}\n\
             section.plain.rectangle = {{ young_pa = {YOUNG:e}, width_m = {WIDTH}, depth_m = {DEPTH} }}\n\
             section.uneven.fibres = [{{ y_m = 0.1, area_m2 = 1e-3, material = 'steel' }}, \
             {{ y_m = -0.1, area_m2 = 3e-3, material = 'steel' }}]\n\
             hinge.end.bilinear = {{ stiffness_n_per_m = 1e7, yield_force_n = 5e4, post_yield_ratio = 0.1 }}"
        ))
        .unwrap();
        let model = spec.model().unwrap();
        let none = SymMatrix::zeros(model.load.len());
        let beside = share.map(|share| none.plus(share, &model.stiffness));
        let members = spec.members_under(&model.load, beside.as_ref()).unwrap();
        let [member] = <[MemberUse; 1]>::try_from(members).unwrap();
        member.utilisation
    }

    fn assert_used(member: &str, load: &str, expected: f64) {
        let found = used(member, load).unwrap();
        assert!(
            (found - expected).abs() < 1e-9,
            "{member}, {load}: {found} {expected}"
        );
    }

    #[test]
    fn specimens_bear_their_part() {
        let of = |share| used_beside("section = 'steel'", "x_n = -2.4e6", share);
        let alone = of(Some(0.0)).unwrap();
        assert!((of(Some(3.0)).unwrap() - 0.25 * alone).abs() < 1e-9);
        assert_eq!(of(None), None);
    }

    /// The outermost of n fibres lies at (1 − 1/n) h/2, and they have (1 − 1/n²) of the second moment of area.
    #[test]
    fn utilisation_is_the_elastic_strain_over_that_at_yield() {
        let (area, inertia) = (WIDTH * DEPTH, WIDTH * DEPTH * DEPTH * DEPTH / 12.0);
        let bent =
            |moment: f64| moment * 0.5 * DEPTH / (inertia * (1.0 + 1.0 / LAYERS)) / YOUNG / STEEL;
        for kind in ["elastic", "force_based", "displacement_based"] {
            let member = format!("section = 'steel', kind = '{kind}'");
            assert_used(&member, "x_n = -2.4e6", 2.4e6 / area / YOUNG / STEEL);
            for sign in [1.0, -1.0] {
                let load = format!("y_n = {}", sign * 2e4);
                assert_used(&member, &load, bent(2e4 * LENGTH));
                let both = format!("{load}, x_n = 1e6");
                let sum = bent(2e4 * LENGTH) + 1e6 / area / YOUNG / STEEL;
                assert_used(&member, &both, sum);
            }
        }
        assert_used(
            "section = 'steel', offset_start_m = [0.5, 0]",
            "y_n = 2e4",
            bent(5e4),
        );
        // Of two fibres 1 and 3, with the moment P L and no force, each has half of it over the distance.
        let two = 2e4 * LENGTH / 0.2 / 1e-3 / YOUNG / STEEL;
        let uneven = "section = 'uneven', kind = 'force_based'";
        assert_used(uneven, "y_n = 2e4", two);
        // A tension of 100 kN takes 50 kN off the upper fibre, which is compressed, or adds it.
        let axial = 5e4 / 1e-3 / YOUNG / STEEL;
        assert_used(uneven, "y_n = 2e4, x_n = 1e5", two - axial);
        assert_used(uneven, "y_n = -2e4, x_n = 1e5", two + axial);
    }

    #[test]
    fn concrete_and_hinges_count_at_their_strengths() {
        let concrete = "section = 'concrete', kind = 'force_based'";
        assert_used(concrete, "x_n = -3e5", 3e5 / (WIDTH * DEPTH) / 3e10 / 0.002);
        assert_used(concrete, "x_n = 3e5", 0.0);
        assert_used(
            "section = 'plain', hinge_start = 'end'",
            "y_n = -2e4",
            2e4 * LENGTH / 5e4,
        );
        assert_eq!(used("section = 'plain'", "y_n = 2e4"), None);
    }
}
