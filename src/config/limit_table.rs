//! The table `limits` of a specimen or of one of its axes, in a file.
//!
//! The catalogue names the keys; this module reads, writes, checks and merges their levels. Levels of a size have no
//! smallest value. The order of the keys is the order of the catalogue's table.

use std::borrow::Cow;
use std::fmt;
use std::sync::LazyLock;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{self, MapAccess, Visitor};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};

use super::levels::{BoundSpec, LimitsError, RangeSpec};
use gusset_quantity::catalog::limit::{AXIS_LIMITS, Kind, Limit, Row, Scope, Setting, TABLE};

/// Limits of one axis in SI units, at the specimen's own scale. A limit that is absent is not checked.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LimitsSpec {
    given: [Option<RangeSpec>; AXIS_LIMITS],
    /// Delay of the actuator in s that the following error allows for.
    pub following_time_s: f64,
    /// Motion of the command in m that is too small to change the sensors.
    pub stuck_travel_m: f64,
}

/// Rows of the limits of an axis, in the order of the file.
fn rows() -> impl Iterator<Item = &'static Row> {
    TABLE.iter().filter(|row| row.scope() == Scope::Axis)
}

/// All keys, in the order of the file.
fn keys() -> impl Iterator<Item = &'static str> {
    rows()
        .flat_map(|row| {
            [
                Some(row.key),
                row.setting.as_ref().map(|setting| setting.key),
            ]
        })
        .flatten()
}

/// Meaning of a key of the file.
enum Key {
    Limit(&'static Row),
    Setting(Limit),
}

impl Key {
    fn find(name: &str) -> Option<Self> {
        rows().find_map(|row| match &row.setting {
            _ if row.key == name => Some(Self::Limit(row)),
            Some(setting) if setting.key == name => Some(Self::Setting(row.limit)),
            _ => None,
        })
    }
}

impl<'de> Deserialize<'de> for Key {
    /// Reads the name of a key. An unknown one is refused as that of any other table, so that the reader finds its place.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Name;

        impl Visitor<'_> for Name {
            type Value = Key;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a limit")
            }

            fn visit_str<E: de::Error>(self, name: &str) -> Result<Key, E> {
                static KEYS: LazyLock<Vec<&'static str>> = LazyLock::new(|| keys().collect());
                Key::find(name).ok_or_else(|| E::unknown_field(name, &KEYS))
            }
        }

        deserializer.deserialize_identifier(Name)
    }
}

impl<'de> Deserialize<'de> for LimitsSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Table;

        impl<'de> Visitor<'de> for Table {
            type Value = LimitsSpec;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("struct LimitsSpec")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<LimitsSpec, A::Error> {
                let mut spec = LimitsSpec::default();
                while let Some(key) = map.next_key::<Key>()? {
                    match key {
                        Key::Limit(row) => {
                            let levels = match row.kind {
                                Kind::Range => map.next_value()?,
                                Kind::Size | Kind::Count => {
                                    map.next_value::<Option<BoundSpec>>()?.map(RangeSpec::from)
                                }
                            };
                            spec.set(row.limit, levels);
                        }
                        Key::Setting(limit) => {
                            let value = map.next_value()?;
                            if let Some(place) = spec.setting_mut(limit) {
                                *place = value;
                            }
                        }
                    }
                }
                Ok(spec)
            }
        }

        deserializer.deserialize_map(Table)
    }
}

impl Serialize for LimitsSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_struct("LimitsSpec", keys().count())?;
        for row in rows() {
            match (self.get(row.limit), row.kind) {
                (None, _) => table.skip_field(row.key)?,
                (Some(levels), Kind::Range) => table.serialize_field(row.key, &levels)?,
                (Some(levels), Kind::Size | Kind::Count) => {
                    table.serialize_field(row.key, &levels.upper())?;
                }
            }
            if let Some((setting, value)) = self.setting(row.limit) {
                table.serialize_field(setting.key, &value)?;
            }
        }
        table.end()
    }
}

impl JsonSchema for LimitsSpec {
    fn schema_name() -> Cow<'static, str> {
        "LimitsSpec".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut properties = Map::new();
        for row in rows() {
            let levels = match row.kind {
                Kind::Range => generator.subschema_for::<Option<RangeSpec>>(),
                Kind::Size | Kind::Count => generator.subschema_for::<Option<BoundSpec>>(),
            };
            let example = row.example.and_then(|text| serde_json::from_str(text).ok());
            properties.insert(row.key.to_owned(), described(levels, row.sentence, example));
            if let Some(setting) = &row.setting {
                let number = generator.subschema_for::<f64>();
                let example = setting.example.map(Value::from);
                let mut number = described(number, setting.sentence, example);
                number["default"] = json!(0.0);
                properties.insert(setting.key.to_owned(), number);
            }
        }
        let mut table = Map::new();
        table.insert(
            "description".to_owned(),
            "Limits of one axis in SI units, at the specimen's own scale. A limit that is absent is not checked. NaN and \
             infinity always trip. More: guide, limits."
                .into(),
        );
        table.insert("type".to_owned(), "object".into());
        table.insert("properties".to_owned(), properties.into());
        table.insert("additionalProperties".to_owned(), false.into());
        table.into()
    }
}

/// A schema with its sentence and its example.
fn described(mut schema: Schema, sentence: &str, example: Option<Value>) -> Value {
    schema.insert("description".to_owned(), sentence.into());
    if let Some(example) = example {
        schema.insert("examples".to_owned(), json!([example]));
    }
    schema.to_value()
}

impl LimitsSpec {
    /// The levels of a limit, if they are given. A size has −∞ as its smallest value.
    #[must_use]
    pub fn get(&self, limit: Limit) -> Option<RangeSpec> {
        self.given.get(limit as usize).copied().flatten()
    }

    /// The levels of a size or a count, if they are given.
    #[must_use]
    pub fn size(&self, limit: Limit) -> Option<BoundSpec> {
        self.get(limit).map(RangeSpec::upper)
    }

    /// True if a level is given.
    #[must_use]
    pub fn has(&self, limit: Limit) -> bool {
        self.get(limit).is_some()
    }

    /// The trip levels of a range, if they are given.
    #[must_use]
    pub fn trip(&self, limit: Limit) -> Option<[f64; 2]> {
        self.get(limit)?.trip
    }

    /// The trip level of a size or a count, if it is given.
    #[must_use]
    pub(crate) fn trip_size(&self, limit: Limit) -> Option<f64> {
        self.size(limit)?.trip
    }

    /// Sets the levels of a limit of an axis.
    pub fn set(&mut self, limit: Limit, levels: Option<RangeSpec>) {
        if let Some(place) = self.given.get_mut(limit as usize) {
            *place = levels;
        }
    }

    /// The table with these levels of a limit.
    #[must_use]
    pub fn with(mut self, limit: Limit, levels: impl Into<RangeSpec>) -> Self {
        self.set(limit, Some(levels.into()));
        self
    }

    /// The number that says how a limit is judged.
    #[must_use]
    pub(crate) fn setting(&self, limit: Limit) -> Option<(&'static Setting, f64)> {
        let setting = limit.row().setting.as_ref()?;
        let value = match limit {
            Limit::FollowingError => self.following_time_s,
            Limit::StuckSensor => self.stuck_travel_m,
            _ => return None,
        };
        Some((setting, value))
    }

    fn setting_mut(&mut self, limit: Limit) -> Option<&mut f64> {
        match limit {
            Limit::FollowingError => Some(&mut self.following_time_s),
            Limit::StuckSensor => Some(&mut self.stuck_travel_m),
            _ => None,
        }
    }

    /// These levels where they are given, and those of `all` elsewhere.
    #[must_use]
    pub fn over(&self, all: &Self) -> Self {
        let longer = |own: f64, all: f64| if own > 0.0 { own } else { all };
        let mut merged = Self {
            following_time_s: longer(self.following_time_s, all.following_time_s),
            stuck_travel_m: longer(self.stuck_travel_m, all.stuck_travel_m),
            ..*self
        };
        for (own, all) in merged.given.iter_mut().zip(all.given) {
            *own = RangeSpec::over(*own, all);
        }
        merged
    }

    /// Keys of the limits that are given and need a measured displacement.
    pub fn needing_measured_disp(&self) -> impl Iterator<Item = &'static str> {
        let given = rows().filter(|row| row.needs_measured_disp && self.has(row.limit));
        given.map(|row| row.key)
    }

    /// Whether each limit that is given can be kept.
    ///
    /// # Errors
    /// The first that cannot.
    pub(crate) fn check(&self) -> Result<(), LimitsError> {
        for row in rows() {
            if let Some(levels) = self.get(row.limit) {
                match row.kind {
                    Kind::Range => levels.check(row.key)?,
                    Kind::Size => levels.upper().check(row.key)?,
                    Kind::Count => levels.upper().check_count(row.key)?,
                }
            }
            if let Some((Setting { key, .. }, found)) = self.setting(row.limit) {
                let inside = found >= 0.0;
                if !inside {
                    return LimitsError::not_positive(key, found);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> LimitsSpec {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn contradicting_levels_are_named() {
        for (text, words) in [
            ("command_step_m = { warn = 2, trip = 2 }", "trip level"),
            ("command_step_m = { trip = 0 }", "greater than"),
            ("command_step_m = { warn = nan }", "greater than"),
            ("force_step_n = {}", "`warn`"),
            ("command_disp_m = { trip = [1, 1] }", "no room"),
            ("command_disp_m = { trip = [nan, 1] }", "no room"),
            (
                "measured_force_n = { warn = [-5, 1], trip = [-4, 4] }",
                "warns at -5",
            ),
            (
                "measured_force_n = { warn = [-1, 5], trip = [-4, 4] }",
                "warns at 5",
            ),
            ("sensor_disp_m = {}", "neither"),
            ("alternating_ticks = { trip = 2.7 }", "is 2.7,"),
            ("stuck_ticks = { warn = 0.5, trip = 4 }", "is 0.5"),
            ("stuck_ticks = {}", "neither"),
            ("stuck_travel_m = -1", "greater than"),
        ] {
            let error = read(text).check().unwrap_err();
            assert!(error.to_string().contains(words), "{text}: {error}");
            assert!(text.starts_with(error.key));
        }
        let good = "command_disp_m = { warn = [-0.1, 0.2], trip = [-0.2, 0.3] }\nstuck_ticks = { trip = 5 }\n";
        assert_eq!(read(good).check(), Ok(()));
    }

    /// Both levels of a limit as the file writes them.
    fn written(row: &Row) -> String {
        match row.kind {
            Kind::Range => format!("{} = {{ warn = [-1, 1], trip = [-2, 2] }}", row.key),
            Kind::Size | Kind::Count => format!("{} = {{ warn = 1, trip = 2 }}", row.key),
        }
    }

    #[test]
    fn every_axis_limit_is_read_and_written() {
        let schema = SchemaGenerator::default().into_root_schema_for::<LimitsSpec>();
        let properties = schema.get("properties").unwrap().as_object().unwrap();
        assert!(properties.keys().map(String::as_str).eq(keys()));
        for row in rows() {
            let spec = read(&written(row));
            assert_eq!(spec.check(), Ok(()), "{}", row.key);
            assert_eq!(read(&toml::to_string(&spec).unwrap()), spec, "{}", row.key);
            let trip = spec.trip_size(row.limit);
            assert_eq!(trip, Some(2.0), "{}", row.key);
            let sentence = properties[row.key]["description"].as_str();
            assert_eq!(sentence, Some(row.sentence));
            assert!(read(&format!("{} = {{}}", row.key)).check().is_err());
        }
    }

    #[test]
    fn an_unknown_key_is_refused() {
        for text in [
            "force_step = { trip = 1 }",
            "tangent_step_m = 0.0",
            "stability_used = { warn = 1 }",
        ] {
            assert!(toml::from_str::<LimitsSpec>(text).is_err(), "{text}");
        }
    }
}
