//! Old names of keys and laws: read, noted, overridden, refused beside the new name; and removed keys.

use super::*;
use gusset_numerics::law::LawSpec;

fn law(text: &str) -> LawSpec {
    toml::from_str(text).unwrap()
}

fn with_law(text: &str) -> String {
    let (before, _) = GOOD.split_once("law = ").unwrap();
    format!("{before}law.{text}\n")
}

#[test]
fn renamed_key_is_read_and_noted() {
    let text = format!("{GOOD}[timing]\nmax_total_misses = 7\nwarn_total_misses = 3\n");
    let loaded = accepted(&text, &[]);
    let levels = loaded.file.timing.misses.in_total;
    assert_eq!((levels.warn, levels.trip), (Some(3), Some(7)));
    assert_eq!(loaded.text, text);
    let notes: Vec<String> = loaded.warnings.iter().map(|w| w.render(false)).collect();
    shows(&notes.concat(), "`timing.max_total_misses`");
    shows(&notes.concat(), "`timing.misses.in_total.trip`");
    shows(
        &notes.concat(),
        "max_total_misses = 7\n   | ^^^^^^^^^^^^^^^^",
    );
    // A variation has the new names.
    let varied = loaded.varied(&["title=varied".to_owned()]).unwrap();
    assert_eq!(varied.file.timing, loaded.file.timing);
    assert!(varied.warnings.is_empty());
}

#[test]
fn law_is_named_as_written() {
    let text = with_law("viscous = { damping_n_s_per_m = 5.0, stiff = 1 }");
    let refused = read(&text, &[]).unwrap_err().to_string();
    shows(&refused, "`stiff`");
    shows(&refused, "`specimen[0].law.viscous`");
}

#[test]
fn resolved_file_gives_no_notes() {
    let text = format!("{GOOD}[timing]\nmax_consecutive_misses = 9\n");
    let loaded = parse(Path::new("resolved.toml"), text, &[]).unwrap();
    assert!(loaded.warnings.is_empty());
    assert_eq!(loaded.file.timing.misses.max_in_a_row(), 9);
}

#[test]
fn override_accepts_old_and_new_names() {
    let file = |key: &str| format!("{GOOD}[timing]\n{key} = 7\n");
    let names = ["max_total_misses", "misses.in_total.trip"];
    for given in names {
        for overridden in names {
            let set = format!("timing.{overridden}=11");
            let loaded = accepted(&file(given), &[&set]);
            let found = loaded.file.timing.misses.in_total.trip;
            assert_eq!(found, Some(11), "{given} {overridden}");
        }
    }
    let loaded = accepted(GOOD, &["timing={max_total_misses=5}"]);
    assert_eq!(loaded.file.timing.misses.in_total.trip, Some(5));
}

#[test]
fn old_name_beside_the_new_is_refused() {
    let both = "[timing]\nmax_total_misses = 7\nmisses.in_total.trip = 8\n";
    let text = read(&format!("{GOOD}{both}"), &[]).unwrap_err().to_string();
    shows(&text, "`timing.max_total_misses`");
    shows(&text, "`timing.misses.in_total.trip`");
    // One level under its old name, and the other under its new one.
    let apart = "[timing]\nmax_total_misses = 7\nmisses.in_total.warn = 2\n";
    let levels = accepted(&format!("{GOOD}{apart}"), &[])
        .file
        .timing
        .misses
        .in_total;
    assert_eq!((levels.warn, levels.trip), (Some(2), Some(7)));
}

#[test]
fn old_law_name_is_a_special_case() {
    for (old, new) in [
        (
            "elastic_plastic = { stiffness_n_per_m = 2e6, yield_force_n = 1e3 }",
            "bilinear = { stiffness_n_per_m = 2e6, yield_force_n = 1e3, post_yield_ratio = 0.0 }",
        ),
        (
            "coulomb = { stiffness_n_per_m = 2e6, slip_force_n = 1e3 }",
            "bilinear = { stiffness_n_per_m = 2e6, yield_force_n = 1e3, post_yield_ratio = 0.0 }",
        ),
        (
            "viscous = { damping_n_s_per_m = 3e3 }",
            "linear = { stiffness_n_per_m = 0.0, damping_n_s_per_m = 3e3 }",
        ),
        (
            "parallel = [{ gap = { stiffness_n_per_m = 1, gap_m = 1, side = \"both\" } }, { viscous = { damping_n_s_per_m = 3 } }]",
            "parallel = [{ gap = { stiffness_n_per_m = 1, gap_m = 1, side = \"both\" } }, \
             { linear = { stiffness_n_per_m = 0.0, damping_n_s_per_m = 3 } }]",
        ),
    ] {
        let loaded = accepted(&with_law(old), &[]);
        let found = loaded.file.specimen[0].law.clone().unwrap();
        assert_eq!(found, law(new), "{old}");
    }
    let coulomb = with_law("coulomb = { stiffness_n_per_m = 2e6, slip_force_n = 1e3 }");
    let set = "specimen.0.law.coulomb.slip_force_n=5e3";
    let loaded = accepted(&coulomb, &[set]);
    let found = loaded.file.specimen[0].law.clone().unwrap();
    assert_eq!(found.yield_force(), Some(5e3));
    let text = read(&coulomb.replace("1e3", "-1"), &[]);
    let build = |loaded: Loaded| crate::build(&loaded).map(|_| ());
    let refused = text.and_then(build).unwrap_err().to_string();
    shows(&refused, "slip_force_n = -1");
}

const LINKED: &str = "stiffness_n_per_m = 1e6\nlink = { address = \"127.0.0.1:9\", probe = \"none\" }\n\
    limits = { command_disp_m = { trip = [-1, 1] }, measured_force_n = { trip = [-1e6, 1e6] } }\n";

#[test]
fn stand_in_is_the_law_beside_a_link() {
    let (before, _) = GOOD.split_once("law = ").unwrap();
    let file = |stand_in: &str| format!("{before}{LINKED}{stand_in}");
    let old = file(
        "stand_in.law.elastic_plastic = { stiffness_n_per_m = 1e6, yield_force_n = 10 }\n\
         stand_in_transfer.delay_s = 0.01\n[[uncertainty]]\nkey = \"specimen.0.stand_in.law.elastic_plastic.yield_force_n\"\nstd = 1\n",
    );
    let loaded = accepted(&old, &[]);
    let table = &loaded.file.specimen[0];
    assert!(table.link.is_some() && table.own_transfer().is_none());
    let (key, law) = table.stand_in().unwrap();
    assert_eq!((key, law.yield_force(0)), ("law", Some(10.0)));
    assert_eq!(table.believed_transfer(1.0).unwrap().delay_s, 0.01);
    let [uncertain] = loaded.uncertain().try_into().unwrap();
    let key = "specimen[0].law.bilinear.yield_force_n";
    assert_eq!(
        (uncertain.key.to_string().as_str(), uncertain.nominal),
        (key, 10.0)
    );
    let varied = loaded.varied(&[format!("{}=12.0", uncertain.key)]).unwrap();
    assert_eq!(
        varied.file.specimen[0].stand_in().unwrap().1.yield_force(0),
        Some(12.0)
    );

    let two =
        "law.linear = { stiffness_n_per_m = 1 }\nstand_in.law.linear = { stiffness_n_per_m = 1 }\n";
    for refused in [
        file(two),
        format!("{GOOD}stand_in.law.linear = {{ stiffness_n_per_m = 1 }}\n"),
    ] {
        let text = read(&refused, &[]).unwrap_err().to_string();
        shows(&text, "`specimen[0].stand_in` was removed");
    }
}

#[test]
fn removed_key_is_refused_in_new_files() {
    let timing = |value: &str| format!("{GOOD}[timing]\ncatch_up_remote = {value}\n");
    let touched = |value: &str| format!("{GOOD}[timing]\nprefault_stack_kb = {value}\n");
    let told =
        |value: &str| format!("{GOOD}transfer = {{ delay_s = 0.01, tell_saturation = {value} }}\n");
    let limit = |key: &str, value: &str| format!("{GOOD}limits = {{ {key} = {value} }}\n");
    let sawtooth = "specimen[0].limits.alternating_m";
    let step = "specimen[0].limits.tangent_step_m";
    let folder = tempfile::tempdir().unwrap();
    for (text, default, key, last) in [
        (limit("alternating_m", "0.0"), true, sawtooth, "0.2.0"),
        (limit("alternating_m", "1e-6"), false, sawtooth, "0.2.0"),
        (limit("tangent_step_m", "0"), true, step, "0.2.0"),
        (limit("tangent_step_m", "1e-5"), false, step, "0.2.0"),
        (timing("false"), true, "timing.catch_up_remote", "0.1.0"),
        (timing("true"), false, "timing.catch_up_remote", "0.1.0"),
        (touched("256"), true, "timing.prefault_stack_kb", "0.2.0"),
        (touched("128"), false, "timing.prefault_stack_kb", "0.2.0"),
        (
            told("true"),
            true,
            "specimen[0].transfer.tell_saturation",
            "0.2.0",
        ),
        (
            told("false"),
            false,
            "specimen[0].transfer.tell_saturation",
            "0.2.0",
        ),
    ] {
        for name in ["test.toml", "resolved.toml"] {
            let resolved = name == "resolved.toml";
            match parse(Path::new(name), text.clone(), &[]) {
                Ok(_) => assert!(resolved && default, "{name} {text}"),
                Err(error) => {
                    assert!(!(resolved && default), "{name}: {error}");
                    let error = error.to_string();
                    shows(&error, &format!("`{key}` was removed"));
                    shows(&error, &format!("version {last}"));
                }
            }
        }
        // A report reads it at any value.
        let file = folder.path().join("resolved.toml");
        std::fs::write(&file, text).unwrap();
        let read = load_recorded(&file);
        assert!(read.is_ok(), "{key}");
    }
}

#[test]
fn schema_lists_no_old_names() {
    let schema = [
        json_schema(),
        gusset_config::schema_of::<gusset_config::ServeFile>(),
    ]
    .concat();
    for key in [
        "catch_up_remote",
        "prefault_stack_kb",
        "tell_saturation",
        "udp_endian",
        "max_stale_s",
        "stand_in",
        "stand_in_transfer",
        "max_total_misses",
        "miss_window_s",
        "elastic_plastic",
        "coulomb",
        "viscous",
    ] {
        assert!(!schema.contains(&format!("\"{key}\"")), "{key}");
    }
}
