//! "Did you mean": the allowed name that a misspelt one is closest to, or none if all are far.

/// The nearest of `allowed` to `found`, if it is near enough to be meant.
///
/// A name that lacks its unit (`duration` for `duration_s`) or has another (`step_ms` for `step_s`) is near; so is one
/// with a few wrong characters.
pub fn nearest<'a, S: AsRef<str> + ?Sized>(found: &str, allowed: &[&'a S]) -> Option<&'a S> {
    /// Below this share of right characters a suggestion would be a guess.
    const NEAR_ENOUGH: f64 = 0.6;
    let found = found.to_lowercase().replace('-', "_");
    let stem = |name: &str| name.split('_').next().unwrap_or_default().to_owned();
    let likeness = |name: &str| {
        let name = name.to_lowercase();
        let letters = strsim::normalized_damerau_levenshtein(&found, &name);
        // Longer common beginnings win among several that begin alike.
        let begins = name
            .strip_prefix(&found)
            .is_some_and(|rest| rest.starts_with('_'))
            || found
                .strip_prefix(&name)
                .is_some_and(|rest| rest.starts_with('_'));
        if begins {
            1.0 + letters
        } else if found.len() > 3 && found.contains('_') && stem(&found) == stem(&name) {
            letters.max(NEAR_ENOUGH)
        } else {
            letters
        }
    };
    allowed
        .iter()
        .map(|name| (likeness(name.as_ref()), *name))
        .filter(|(likeness, _)| *likeness >= NEAR_ENOUGH)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, name)| name)
}

/// "`a`, `b` or `c`".
pub(crate) fn listed<S: AsRef<str>>(names: &[S], last: &str) -> String {
    let quoted: Vec<_> = names.iter().map(|n| format!("`{}`", n.as_ref())).collect();
    match quoted.split_last() {
        None => "nothing".to_owned(),
        Some((only, [])) => only.clone(),
        Some((end, rest)) => format!("{} {last} {end}", rest.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_unit_and_typo_are_recognised() {
        let keys = ["step_s", "rate_hz", "duration_s", "clock", "scale"];
        assert_eq!(nearest("duration", &keys), Some("duration_s"));
        assert_eq!(nearest("step_ms", &keys), Some("step_s"));
        assert_eq!(nearest("clokc", &keys), Some("clock"));
        assert_eq!(nearest("damping", &keys), None);
    }

    #[test]
    fn closest_of_similar_names_wins() {
        let keys = ["stiffness_n_per_m", "stiffness_n_per_m3", "stiffness_ratio"];
        assert_eq!(
            nearest("stiffness_n_pr_m", &keys),
            Some("stiffness_n_per_m")
        );
    }

    #[test]
    fn lists_read_like_a_sentence() {
        assert_eq!(listed(&["a"], "or"), "`a`");
        assert_eq!(listed(&["a", "b", "c"], "or"), "`a`, `b` or `c`");
    }
}
