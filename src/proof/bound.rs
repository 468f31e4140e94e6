//! The smallest critical delay of a specimen that is known, and the condition to which it belongs.

use gusset_numerics::spectral::delay::{Critical, DelayError, DiscreteLimit};
use gusset_quantity::units::duration;

/// What grows in continuous time with nothing delayed.
#[must_use]
pub fn growing(per_second: f64) -> String {
    format!(
        "it grows by a factor e in {} of continuous time",
        duration(per_second.recip())
    )
}

/// What grows in the recursion with nothing delayed.
#[must_use]
pub(crate) fn diverging(radius: f64) -> String {
    format!("it grows by a factor {radius:.6} in a step of the recursion at this Δt and λ")
}

/// Why any delay is too long.
pub const INERTIA: &str = "the inertia inside the specimen's force is as much as the mass that it acts on, and with any delay, \
     however short, it grows";

/// The state of the structure and the calculation to which a critical delay belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DelayCondition {
    /// At rest, in continuous time.
    AtRest,
    /// At rest, by the recursion at Δt and λ.
    Recursion,
    /// With K0 and C0, in continuous time.
    Closed,
}

/// The delays that are stable under one condition.
#[derive(Debug, Clone, PartialEq)]
pub enum DelayBound {
    /// None, not even without a delay, for this reason.
    Unstable(String),
    /// None, for this reason.
    NoDelay(&'static str),
    /// Those below this one, s.
    Below(f64),
    /// Those up to this one, the longest that was examined, s.
    UpTo(f64),
    /// All.
    Every,
    /// Not known, for this reason.
    Unknown(String),
}

/// The stable delays of one specimen under each condition that was examined.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayBounds(pub Vec<(DelayCondition, DelayBound)>);

impl DelayCondition {
    const fn words(self) -> &'static str {
        match self {
            Self::AtRest => "in continuous time",
            Self::Recursion => "by the recursion",
            Self::Closed => "with gaps closed and dampers at their reference",
        }
    }
}

impl DelayBound {
    /// In continuous time. `growth` in 1/s is that without any delay.
    #[must_use]
    pub(crate) fn continuous(
        growth: Option<f64>,
        found: &Result<Option<Critical>, DelayError>,
    ) -> Self {
        match (growth, found) {
            (Some(growth), _) => Self::Unstable(growing(growth)),
            (None, Ok(None)) => Self::Every,
            (None, Ok(Some(critical))) if critical.omega.is_infinite() => Self::NoDelay(INERTIA),
            (None, Ok(Some(critical))) => Self::Below(critical.delay),
            (None, Err(error)) => Self::Unknown(error.to_string()),
        }
    }

    /// By the recursion.
    #[must_use]
    pub(crate) fn recursion(found: &Result<DiscreteLimit, DelayError>) -> Self {
        match found {
            Ok(DiscreteLimit::At(delay)) => Self::Below(*delay),
            Ok(DiscreteLimit::Beyond(delay)) => Self::UpTo(*delay),
            Err(DelayError::Unstable { radius }) => Self::Unstable(diverging(*radius)),
            Err(error) => Self::Unknown(error.to_string()),
        }
    }

    /// The delay in s that is not stable; none where none is known.
    const fn critical(&self) -> Option<f64> {
        match self {
            Self::Unstable(_) | Self::NoDelay(_) => Some(0.0),
            Self::Below(delay) => Some(*delay),
            Self::UpTo(_) | Self::Every | Self::Unknown(_) => None,
        }
    }
}

impl DelayBounds {
    /// The condition with the smallest critical delay, and what was found under it; none where no critical delay is known.
    #[must_use]
    pub fn smallest(&self) -> Option<(DelayCondition, &DelayBound)> {
        let known = self
            .0
            .iter()
            .filter_map(|(condition, bound)| Some((bound.critical()?, (*condition, bound))));
        let smallest = known.min_by(|(one, _), (other, _)| one.total_cmp(other));
        smallest.map(|(_, found)| found)
    }

    /// The smallest critical delay, spelled by `spell`, with its condition. Where none is known: what is known under each.
    #[must_use]
    pub fn in_words(&self, spell: impl Fn(DelayCondition, f64) -> String) -> String {
        let Some((condition, bound)) = self.smallest() else {
            return self.without_critical();
        };
        let with = match condition {
            DelayCondition::Closed => format!(" {}", condition.words()),
            DelayCondition::AtRest | DelayCondition::Recursion => String::new(),
        };
        match bound {
            DelayBound::Unstable(why) => format!("UNSTABLE without any delay{with}: {why}"),
            DelayBound::NoDelay(why) => format!("no delay is stable{with}: {why}"),
            _ => {
                let delay = bound.critical().unwrap_or_default();
                let words = condition.words();
                format!(
                    "{} {words}{}",
                    spell(condition, delay),
                    self.unknown_closed()
                )
            }
        }
    }

    /// That the delay with gaps closed is not known, if it is not.
    fn unknown_closed(&self) -> String {
        let unknown = self.0.iter().find_map(|found| match found {
            (DelayCondition::Closed, DelayBound::Unknown(why)) => Some(why),
            _ => None,
        });
        let words = DelayCondition::Closed.words();
        unknown.map_or_else(String::new, |why| format!("; not known {words}: {why}"))
    }

    fn without_critical(&self) -> String {
        let is_every = |bound: &DelayBound| matches!(bound, DelayBound::Every);
        if self.0.iter().all(|(_, bound)| is_every(bound)) {
            return "every delay is stable".to_owned();
        }
        let each = self.0.iter().map(|(condition, bound)| {
            let words = condition.words();
            match bound {
                DelayBound::UpTo(delay) => format!("none up to {} {words}", duration(*delay)),
                DelayBound::Unknown(why) => format!("not known {words}: {why}"),
                _ => format!("every delay is stable {words}"),
            }
        });
        each.collect::<Vec<_>>().join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::DelayBound::{Below, Every, NoDelay, Unknown, Unstable, UpTo};
    use super::DelayCondition::{AtRest, Closed, Recursion};
    use super::*;

    fn words(found: &[(DelayCondition, DelayBound)]) -> String {
        let bounds = DelayBounds(found.to_vec());
        bounds.in_words(|_, delay| format!("{delay} s"))
    }

    #[test]
    fn smallest_critical_delay_is_shown() {
        let at_rest = (AtRest, Below(2.0));
        let found = [
            at_rest.clone(),
            (Recursion, Below(1.5)),
            (Closed, Below(1.0)),
        ];
        assert_eq!(
            words(&found),
            "1 s with gaps closed and dampers at their reference"
        );
        assert_eq!(words(&found[..2]), "1.5 s by the recursion");
        assert_eq!(words(&found[..1]), "2 s in continuous time");
        let found = [at_rest.clone(), (Recursion, UpTo(0.1)), (Closed, Every)];
        assert_eq!(words(&found), "2 s in continuous time");
        let unstable = [at_rest.clone(), (Closed, Unstable("it grows".to_owned()))];
        assert!(words(&unstable).starts_with("UNSTABLE"));
        let inertia = [(AtRest, NoDelay(INERTIA)), (Recursion, Below(1.0))];
        assert!(words(&inertia).starts_with("no delay"));
        let unknown = [at_rest, (Closed, Unknown("why".to_owned()))];
        assert!(words(&unknown).ends_with(": why"));
    }

    #[test]
    fn every_delay_is_stable_only_if_all_agree() {
        assert_eq!(words(&[(AtRest, Every)]), "every delay is stable");
        let found = [(AtRest, Every), (Recursion, UpTo(0.375))];
        assert_eq!(
            words(&found),
            "every delay is stable in continuous time; none up to 375 ms by the recursion"
        );
        let failed = DelayBound::recursion(&Err(DelayError::Eigenvalues));
        assert_eq!(
            words(&[(AtRest, Every), (Recursion, failed)]),
            "every delay is stable in continuous time; not known by the recursion: the eigenvalues did not converge"
        );
    }
}
