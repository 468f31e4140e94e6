//! The stability of the integration in words, for `check`, the certificate and the end of `run`.

use gusset_actuator::geometry::LawPlace;
use gusset_config::word;
use gusset_numerics::integrate::Lambda;
use gusset_proof::{Stability, grows};
use gusset_quantity::units::{compared, number};
use gusset_setup::{Facts, StructureFacts};

const NO_BOUND: &str = "no proof: a tangent has no declared bound";
const NO_PROOF: &str = "no proof is made for this method";

/// The stability in full, and the part that governs it, each with its name.
#[must_use]
pub fn in_full(facts: &Facts, structure: &StructureFacts) -> Vec<(&'static str, String)> {
    if let Some(why) = grows(structure.analysis.as_ref()) {
        return vec![("stability", why)];
    }
    let choice = match &structure.stability {
        Stability::Limit(choice) => choice,
        other => return vec![("stability", without_limit(other))],
    };
    let limit = match choice.limit {
        Some(limit) => format!("stable up to λ = {limit:.6}"),
        None => "stable for every λ".to_owned(),
    };
    let margin = if choice.margin.is_finite() {
        format!(", margin {:.4}", choice.margin)
    } else {
        String::new()
    };
    let verdict = if choice.is_stable() {
        ""
    } else {
        " — UNSTABLE at this λ"
    };
    let turning = facts.limits.specimens.iter().any(|specimen| {
        let exact = specimen.geometry.as_ref().filter(|geometry| geometry.exact);
        exact.is_some_and(|geometry| geometry.law_at == LawPlace::Actuators)
    });
    let worth = if turning {
        "which is necessary and\nsufficient at the reference pose alone: elsewhere exact actuators with separate laws \
         have other stiffnesses"
    } else {
        "which is necessary and sufficient"
    };
    let text = format!(
        "{limit}{margin}{verdict};\nby S(λ) ⪰ 0 at the declared bounds of all tangents, {worth}"
    );
    let governing = choice.governing.as_ref();
    let governing = governing.map(|governing| ("governed by", governing.to_string()));
    std::iter::once(("stability", text))
        .chain(governing)
        .collect()
}

/// The stability where no limit of λ is known.
fn without_limit(stability: &Stability) -> String {
    match stability {
        Stability::NoLambda(why) => format!("UNSTABLE: {why}"),
        Stability::NoBound => NO_BOUND.to_owned(),
        Stability::AtBounds(radius) if stability.grows() => format!(
            "UNSTABLE: with every tangent at its declared bound the response grows by a factor {radius:.6} per step"
        ),
        Stability::AtBounds(radius) => format!(
            "{NO_PROOF}; with every tangent at its declared bound its spectral radius is {radius:.6}, so the response does not grow"
        ),
        Stability::Limit(_) | Stability::NoProof => NO_PROOF.to_owned(),
    }
}

/// Method, λ and stability in one sentence.
#[must_use]
pub fn in_words(structure: &StructureFacts) -> String {
    let [lambda, limit] = lambda_and_limit(structure);
    let method = method_of(structure, &lambda);
    if let Some(why) = grows(structure.analysis.as_ref()) {
        return format!("{method}: UNSTABLE, {why}");
    }
    let choice = match &structure.stability {
        Stability::Limit(choice) => choice,
        other => return format!("{method}: {}", without_limit(other)),
    };
    match choice.limit {
        None => format!("{method}: stable for every λ, proven"),
        Some(_) if choice.is_stable() => format!("{method}: stable up to λ = {limit}, proven"),
        Some(_) => {
            format!("{method}: UNSTABLE at this λ, which is stable up to {limit} only")
        }
    }
}

/// λ and its limit, with as many digits as show which of them is larger. A missing one is empty.
fn lambda_and_limit(structure: &StructureFacts) -> [String; 2] {
    let lambda = structure.lambda.map(Lambda::value);
    let limit = structure.choice().and_then(|choice| choice.limit);
    match (lambda, limit) {
        (Some(lambda), Some(limit)) => compared(lambda, limit, ""),
        _ => [lambda, limit].map(|value| value.map_or_else(String::new, number)),
    }
}

/// The method with its λ, as `lambda` spells it, and the origin of λ.
fn method_of(structure: &StructureFacts, lambda: &str) -> String {
    if structure.lambda.is_none() {
        return word(&structure.method);
    }
    let origin = if structure.lambda_by_number {
        "given"
    } else {
        "chosen automatically"
    };
    format!("Gui-λ with λ = {lambda} ({origin})")
}
