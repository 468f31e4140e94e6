//! Limits that a resumed test widens: `--resume --set` with `--reason`.
//!
//! Nothing else of the test may differ, and no limit may become narrower. A limit that the test did not have stays absent.

use toml::Value;

use super::ResumeError;
use gusset_config::{Loaded, TestFile};
use gusset_quantity::catalog::limit::{Scope, TABLE};

/// A difference between two test files: the key with its value before and now.
type Difference = (String, Option<Value>, Option<Value>);

/// The limits that differ, in words. Errors: another key differs, or a limit is narrower.
pub(super) fn widened(old: &Loaded, new: &Loaded) -> Result<Vec<String>, ResumeError> {
    let [old, new] = [old, new].map(|loaded| value_of(&loaded.file));
    let mut found = Vec::new();
    differences("", Some(&old), Some(&new), &mut found);
    let mut words = Vec::new();
    for (key, old, new) in found {
        if !is_level(&key) {
            return Err(ResumeError::NoLimit(key));
        }
        let text = |value: &Option<Value>| {
            let number = value.as_ref().and_then(number);
            number.map_or_else(|| "none".to_owned(), |number| number.to_string())
        };
        let numbers = old.as_ref().and_then(number);
        let numbers = numbers.zip(new.as_ref().and_then(number));
        let (old, new) = (text(&old), text(&new));
        if !numbers.is_some_and(|(old, new)| is_wider(&key, old, new)) {
            return Err(ResumeError::Narrower { key, old, new });
        }
        words.push(format!("`{key}` from {old} to {new}"));
    }
    Ok(words)
}

fn value_of(file: &TestFile) -> Value {
    // A test file that was read can be written.
    Value::try_from(file).unwrap_or(Value::Table(toml::Table::new()))
}

fn number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|n| n as f64))
}

/// The smallest value of a range grows downwards.
fn is_wider(key: &str, old: f64, new: f64) -> bool {
    if key.ends_with("[0]") {
        new < old
    } else {
        new > old
    }
}

/// True of a number of a limit: of an axis, of the whole test, or of missed deadlines.
fn is_level(key: &str) -> bool {
    let of_test = |key: &str| {
        let mut rows = TABLE.iter().filter(|row| row.scope() == Scope::Test);
        let name = key.split('.').next();
        name == Some("divergence_m") || rows.any(|row| Some(row.key) == name)
    };
    (key.starts_with("specimen[") && key.contains(".limits."))
        || (key.starts_with("timing.misses.") && !key.ends_with(".window_s"))
        || key.strip_prefix("safety.").is_some_and(of_test)
}

fn differences(key: &str, old: Option<&Value>, new: Option<&Value>, into: &mut Vec<Difference>) {
    match (old, new) {
        (Some(Value::Table(old)), Some(Value::Table(new))) => {
            let added = new.keys().filter(|name| !old.contains_key(*name));
            for name in old.keys().chain(added) {
                let dot = if key.is_empty() { "" } else { "." };
                let key = format!("{key}{dot}{name}");
                differences(&key, old.get(name), new.get(name), into);
            }
        }
        (Some(Value::Array(old)), Some(Value::Array(new))) => {
            for index in 0..old.len().max(new.len()) {
                let key = format!("{key}[{index}]");
                differences(&key, old.get(index), new.get(index), into);
            }
        }
        _ if old == new => {}
        _ => into.push((key.to_owned(), old.cloned(), new.cloned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_config::parse;
    use std::path::Path;

    const TEST: &str = "[time]\nrate_hz = 200\nduration_s = 1\n[structure.shear_building]\nmass_kg = [1]\n\
        stiffness_n_per_m = [1]\n[safety]\ndivergence_m = 1\n[[specimen]]\nname = \"a\"\nstorey = 1\n\
        law.linear = { stiffness_n_per_m = 1 }\nlimits.measured_force_n = { trip = [-5, 5] }\n\
        limits.command_step_m = { trip = 0.1 }\n";

    fn widened_by(set: &str) -> Result<Vec<String>, ResumeError> {
        let load = |sets: &[String]| parse(Path::new("test.toml"), TEST.to_owned(), sets).unwrap();
        widened(&load(&[]), &load(&[set.to_owned()]))
    }

    #[test]
    fn only_limits_may_differ_and_only_wider() {
        let words = widened_by("specimen.0.limits.measured_force_n.trip=[-6, 7]").unwrap();
        assert_eq!(words.len(), 2, "{words:?}");
        for wider in [
            "specimen.0.limits.command_step_m.trip=0.2",
            "safety.divergence_m=2",
        ] {
            assert_eq!(widened_by(wider).unwrap().len(), 1, "{wider}");
        }
        assert_eq!(widened_by("safety.divergence_m=1").unwrap(), [""; 0]);
        for narrower in [
            "specimen.0.limits.measured_force_n.trip=[-6, 4]",
            "specimen.0.limits.measured_force_n.trip=[-4, 6]",
            "specimen.0.limits.command_step_m.trip=0.05",
            "specimen.0.limits.command_disp_m.trip=[-1, 1]",
            "safety.divergence_m=0.5",
        ] {
            let found = widened_by(narrower);
            assert!(
                matches!(found, Err(ResumeError::Narrower { .. })),
                "{narrower}: {found:?}"
            );
        }
        for other in [
            "time.duration_s=2",
            "safety.ramp_s=3",
            "specimen.0.name=\"b\"",
        ] {
            let found = widened_by(other);
            assert!(
                matches!(found, Err(ResumeError::NoLimit(_))),
                "{other}: {found:?}"
            );
        }
    }
}
