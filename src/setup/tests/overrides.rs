//! Overrides, later layers, the file itself, the resolved file, and the schema.

use super::*;

#[test]
fn override_replaces_a_value() {
    let loaded = accepted(GOOD, &["time.rate_hz=512", "specimen[0].storey=2"]);
    assert_eq!(loaded.time.steps, 20 * 512);
    assert_eq!(loaded.file.specimen[0].storey, Some(2));
    let written = GOOD.with("time.rate_hz = 512\nspecimen.storey = 2");
    assert_eq!(loaded.file, accepted(&written, &[]).file);
    assert_eq!(loaded.text, GOOD);
}

#[test]
fn later_overrides_join_earlier_ones() {
    let loaded = accepted(GOOD, &["time.duration_s=4", "specimen[0].storey=2"]);
    let set = |arguments: &[&str]| {
        let sets: Vec<String> = arguments.iter().map(|s| (*s).to_owned()).collect();
        loaded.varied(&sets).unwrap()
    };
    let varied = set(&["specimen[0].storey=3", "title=varied"]);
    assert_eq!(varied.file.specimen[0].storey, Some(3));
    assert_eq!(varied.file.time.duration_s, 4.0);
    assert_eq!(varied.file.title, "varied");
    assert_eq!(set(&[]).file, loaded.file);
    let refused = loaded.varied(&["specimen[0].storey=x".to_owned()]);
    shows(
        &refused.unwrap_err().to_string(),
        "--set specimen[0].storey=x\n",
    );
}

#[test]
fn unknown_override_is_shown_in_argument() {
    let text = complaint_about_set(&["time.duration=3"]);
    shows(
        &text,
        "\
error: unknown key `duration` in `time`
 --> command line:1:12
  |
1 | --set time.duration=3
  |            ^^^^^^^^ did you mean `duration_s`?",
    );
    shows(
        &complaint_about_set(&["timng.cpu=1"]),
        "--set timng.cpu=1\n  |       ^^^^^ ",
    );
    shows(&complaint_about_set(&["timng.cpu=1"]), "`timing`");
}

#[test]
fn wrong_override_type_is_shown_in_argument() {
    let text = complaint_about_set(&["time.duration_s=2o"]);
    shows(
        &text,
        "--set time.duration_s=2o\n  |                       ^^ ",
    );
    let text = complaint_about_set(&["specimen.0.law={linear={stiffness_n_per_m=\"x\"}}"]);
    shows(&text, "`specimen[0].law.linear.stiffness_n_per_m`");
    shows(&text, "--> command line:1:49");
}

#[test]
fn contradicting_override_shows_both() {
    let text = complaint_about_set(&["time.step_s=0.5"]);
    shows(
        &text,
        "5 | rate_hz = 1024      # as the controller\n  | ^^^^^^^ ",
    );
    shows(&text, "::: command line:1:19");
}

#[test]
fn override_that_undoes_another_is_refused() {
    let text = complaint_about_set(&["time.duration_s=1", "time.duration_s=2"]);
    for part in [
        "`time.duration_s` is overridden twice",
        "--set time.duration_s=2\n  |       ^^^^^^^^^^^^^^^^^ again here",
        "--set time.duration_s=1\n",
        "first here",
    ] {
        shows(&text, part);
    }
    assert_eq!(errors(&text), 1, "{text}");
    // A table cancels overrides of its keys; a key of a given table does not conflict.
    let (whole, key) = (
        "specimen.0.law={linear={stiffness_n_per_m=2e6}}",
        "specimen[0].law.linear.stiffness_n_per_m=3e6",
    );
    let part = "specimen.0.law.bilinear.yield_force_n=4e3";
    shows(
        &complaint_about_set(&[part, whole]),
        "`specimen[0].law.bilinear.yield_force_n`",
    );
    accepted(GOOD, &[whole, key]);
}

// --- places for later layers --------------------------------------------------------------------

#[test]
fn later_layer_points_by_path() {
    let loaded = accepted(GOOD, &["specimen[0].storey=3"]);
    let path = |text: &str| KeyPath::parse(text).unwrap();
    let line = |text: &str| {
        let place = loaded.locator.locate(&path(text), Part::Value);
        place.span.map(|span| place.source.text[span].to_owned())
    };
    assert_eq!(line("structure.shear_building.mass_kg[2]").unwrap(), "1000");
    assert_eq!(line("specimen[0].storey").unwrap(), "3");
    assert_eq!(line("specimen[0].reach_disp_m").unwrap(), "[[specimen]]");
    assert_eq!(line("integrator.lambda"), None);
    let parameter = loaded
        .locator
        .beneath(&path("specimen[0].law"), "yield_force_n");
    assert_eq!(
        parameter.to_string(),
        "specimen[0].law.bilinear.yield_force_n"
    );
    let error = loaded.refuse([
        Finding::error(path("specimen[0].storey"), "there is no storey 3")
            .label("the building has 2"),
    ]);
    shows(
        &error.to_string(),
        "--set specimen[0].storey=3\n  |                          ^ ",
    );
}

// --- the file itself ----------------------------------------------------------------------------

#[test]
fn unreadable_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent.toml");
    shows(
        &load(&path, &[]).unwrap_err().to_string(),
        &format!("cannot read {}: ", path.display()),
    );
    std::fs::write(&path, b"title = 'x'\n# \xff\n").unwrap();
    shows(&load(&path, &[]).unwrap_err().to_string(), "byte 14");
    shows(&load(&path, &[]).unwrap_err().to_string(), "line 2");
    std::fs::write(&path, GOOD).unwrap();
    assert_eq!(load(&path, &[]).unwrap().file, accepted(GOOD, &[]).file);
}

// --- resolved.toml and the schema ---------------------------------------------------------------

#[test]
fn the_resolved_file_is_the_same_test() {
    let everything = format!(
        "{GOOD}mass_in_force_kg = 12\nreach_disp_m = 0.1\nstiffness_n_per_m = 2e6\naxis = [{{ sign = -1, unit_disp = \"mm\" }}]\n\
         [[specimen]]\nname = \"two\"\nrows = [[1, 0, 0], [0, 1, 0]]\ndamping_n_s_per_m = [[1, 0], [0, 1]]\n\
         laws = [{{ linear = {{ stiffness_n_per_m = 1 }} }}, {{ linear = {{ stiffness_n_per_m = 2 }} }}]\n\
         [[specimen]]\nname = \"three\"\nstorey = 2\ncoupled = {{ stiffness_n_per_m = [[1]] }}\n\
         [[excitation.nodal_force]]\ndofs = [2]\nsignal = {{ sine = {{ amplitude = 1, frequency_hz = 2 }} }}\n\
         [[structure.element]]\nfrom = 1\nto = 2\nlaw = {{ linear = {{ stiffness_n_per_m = 1 }} }}\n\
         [structure.gravity]\ninfluence = [0, 0, 1]\n[record]\ndofs = \"all\"\n"
    );
    for sets in [
        &[][..],
        &[
            "time.rate_hz=\"4096/3\"",
            "time.duration_s=3",
            "integrator.lambda=inf",
            "integrator.start=second-order",
        ],
    ] {
        let loaded = accepted(&everything, sets);
        let text = resolve(&loaded.file, None, &loaded.inputs()).unwrap();
        let again = accepted(&text, &[]);
        let mut complete = loaded.file.clone();
        complete.safety.divergence_m = Some(1000.0);
        assert_eq!(again.file, complete, "{text}");
        assert_eq!(again.time, loaded.time);
        assert_eq!(resolve(&again.file, None, &again.inputs()).unwrap(), text);
    }
}

#[test]
fn resolved_file_has_all_values() {
    let loaded = accepted(GOOD, &["time.scale=2"]);
    let text = resolve(&loaded.file, None, &loaded.inputs()).unwrap();
    for line in [
        "clock = \"real\"",
        "scale = 2",
        "method = \"gui\"",
        "start = \"published\"",
        "queue_s = 4.0",
        "require_realtime = false",
    ] {
        shows(&text, line);
    }
}

#[test]
fn lambda_number_is_beside_its_request() {
    let loaded = accepted(GOOD, &[]);
    let lambda = 3.987_654_321_012_345;
    let text = resolve(&loaded.file, Some(lambda), &loaded.inputs()).unwrap();
    shows(&text, "lambda = 3.987654321012345 # requested \"auto\"\n");
    assert_eq!(
        accepted(&text, &[]).file.integrator.lambda,
        LambdaValue::Number(lambda)
    );
    let again = accepted(&text, &["time.duration_s=3"]);
    let again = accepted(&resolve_again(&again).unwrap(), &[]);
    assert_eq!(again.file.time.duration_s, 3.0);
    shows(
        &again.text,
        "lambda = 3.987654321012345 # requested \"auto\"\n",
    );
    let asked = accepted(GOOD, &["integrator.lambda=2"]);
    let text = resolve(&asked.file, Some(2.0), &asked.inputs()).unwrap();
    shows(&text, "lambda = 2.0\n");
}

#[test]
fn resolved_inputs_are_in_the_run_folder() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("records")).unwrap();
    std::fs::write(folder.path().join("records/a.at2"), "1").unwrap();
    let path = folder.path().join("t.toml");
    let text = GOOD
        .without("excitation.ground_acceleration.signal.sine")
        .with("excitation.ground_acceleration.signal.file.path = 'records/a.at2'");
    std::fs::write(&path, text).unwrap();
    let loaded = load(&path, &[]).unwrap();
    let mut inputs = loaded.inputs();
    inputs.read("records/a.at2").unwrap();
    let text = resolve(&loaded.file, None, &inputs).unwrap();
    shows(&text, "path = \"inputs/a.at2\"");
    let mut stray = loaded.inputs();
    stray.read("t.toml").unwrap();
    let error = resolve(&loaded.file, None, &stray).unwrap_err();
    assert!(matches!(error, ResolveError::Unplaced { .. }), "{error}");
}

#[test]
fn schema_describes_every_table() {
    let schema: serde_json::Value = serde_json::from_str(&json_schema()).unwrap();
    let properties = schema["properties"].as_object().unwrap();
    for table in [
        "title",
        "time",
        "structure",
        "integrator",
        "excitation",
        "specimen",
        "safety",
        "timing",
        "record",
    ] {
        assert!(properties[table]["description"].is_string(), "{table}");
    }
    assert_eq!(schema["additionalProperties"], false);
    assert_eq!(
        schema["$defs"]["IntegratorTable"]["properties"]["lambda"]["default"],
        "auto"
    );
    let structure = &schema["$defs"]["StructureTable"]["properties"];
    assert_eq!(
        structure["shear_building"]["$ref"],
        "#/$defs/ShearBuildingSpec"
    );
    assert!(schema["$defs"]["ShearBuildingSpec"]["properties"]["mass_kg"].is_object());
    assert!(!json_schema().contains("\"null\""));
    assert!(!json_schema().contains(": null"));
    let of = |table: &str, key: &str| schema["$defs"][table]["properties"][key].clone();
    assert_eq!(of("AxisTable", "sign")["enum"], serde_json::json!([-1, 1]));
    for (table, key) in [
        ("Cyclic", "cycles_per_amplitude"),
        ("OpenFrescoSpec", "site"),
    ] {
        assert_eq!(of(table, key)["maximum"], u32::MAX, "{table} {key}");
    }
}

#[test]
fn every_key_of_the_schema_is_described() {
    fn walk(value: &serde_json::Value, path: &str) {
        if let Some(properties) = value.get("properties").and_then(|p| p.as_object()) {
            for (key, schema) in properties {
                // The key of a variant is described by the variant.
                let one_of = path.contains("oneOf");
                assert!(
                    one_of || schema.get("description").is_some(),
                    "{path}.{key} has no description"
                );
            }
        }
        match value {
            serde_json::Value::Object(object) => object
                .iter()
                .for_each(|(k, v)| walk(v, &format!("{path}.{k}"))),
            serde_json::Value::Array(items) => items.iter().for_each(|v| walk(v, path)),
            _ => {}
        }
    }
    walk(&serde_json::from_str(&json_schema()).unwrap(), "");
}
