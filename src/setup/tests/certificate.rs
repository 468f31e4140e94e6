//! How the file sets up a certificate.

use super::*;

const KNOWN: &str = "identified = { delay_s = 0.024, delay_std_s = 0.001, gain = 0.98, gain_std = 0.01, \
                     stiffness_n_per_m = 1e6, stiffness_std_n_per_m = 4e4, noise_disp_m = 1e-5, noise_force_n = 2 }\n\
                     capacity = { stroke_m = 0.1, velocity_m_per_s = 0.5, force_n = 9e3, power_w = 4e3 }\n";

fn with(more: &str) -> String {
    GOOD.replace("storey = 1\n", &format!("storey = 1\n{more}"))
}

#[test]
fn certificate_is_read_and_written() {
    let text = format!(
        "{}[certificate]\ntrials = 50\nresponse_error = 0.2\n\
         [[uncertainty]]\nkey = \"specimen.0.law.bilinear.yield_force_n\"\nstd_share = 0.1\n\
         [[uncertainty]]\nkey = \"excitation.ground_acceleration.processing.scale_factor\"\nrange = [0.9, 1.1]\n",
        with(KNOWN)
    );
    let loaded = accepted(&text, &[]);
    let specimen = &loaded.file.specimen[0];
    let identified = specimen.identified.unwrap();
    assert_eq!(identified.delay_s, Some(0.024));
    assert!((identified.stiffness_share() - 0.04).abs() < 1e-15);
    assert_eq!(specimen.capacity.unwrap().power_w, Some(4e3));
    assert_eq!(
        (loaded.file.certificate.trials, loaded.file.certificate.seed),
        (50, 1)
    );
    let again = resolve(&loaded.file, None, &loaded.inputs()).unwrap();
    let mut complete = loaded.file.clone();
    complete.safety.divergence_m = Some(1000.0);
    assert_eq!(accepted(&again, &[]).file, complete, "{again}");
    // A file without these keys stays unchanged.
    let plain = accepted(GOOD, &[]);
    let plain = resolve(&plain.file, None, &plain.inputs()).unwrap();
    assert!(
        !plain.contains("certificate") && !plain.contains("uncertain"),
        "{plain}"
    );
}

#[test]
fn identified_values_have_their_ranges() {
    for (change, to, words) in [
        ("delay_s = 0.024", "delay_s = -1", "must be 0 or greater"),
        (
            "gain = 0.98, ",
            "gain = 0, ",
            "`specimen[0].identified.gain` must be greater than zero",
        ),
        (
            "gain = 0.98, ",
            "",
            "`gain_std` is the spread of `gain`, which is missing",
        ),
        (
            "noise_force_n = 2",
            "noise_force_n = -2",
            "must be 0 or greater",
        ),
        (
            "delay_s = 0.024",
            "delay_ms = 24",
            "did you mean `delay_s`?",
        ),
        (
            "power_w = 4e3",
            "power_w = 0",
            "`specimen[0].capacity.power_w` must be greater than zero",
        ),
        ("power_w = 4e3", "power_kw = 4", "did you mean `power_w`?"),
    ] {
        shows(&complaint_of(&with(KNOWN), change, to), words);
    }
}

#[test]
fn uncertain_value_is_a_number_of_the_test() {
    let text = format!(
        "{GOOD}[[uncertainty]]\nkey = \"specimen.0.law.bilinear.yield_force_n\"\nstd = 100\n"
    );
    accepted(&text, &[]);
    let key = "specimen.0.law.bilinear.yield_force_n";
    for (change, to, words) in [
        (
            key,
            "specimen.0.law.bilinear.yield_forse_n",
            "did you mean `specimen[0].law.bilinear.yield_force_n`?",
        ),
        (
            key,
            "specimen.1.name",
            "this test has no `specimen[1].name`",
        ),
        (key, "specimen.0.name", "is not a number"),
        (key, "time.duration_s", "all others are decisions"),
        (key, "specimen..law", "is no dotted path"),
        (
            "std = 100",
            "std = 100\n[[uncertainty]]\nkey = \"specimen[0].law.bilinear.yield_force_n\"\nstd = 1",
            "`uncertainty[0]` would have no effect",
        ),
        ("std = 100", "std = -1", "must be greater than zero"),
        (
            "std = 100",
            "",
            "must have exactly one of `std`, `std_share` and `range`",
        ),
        ("std = 100", "std = 100\nrange = [1, 2]", "and so is `std`"),
        (
            "std = 100",
            "range = [2, 1]",
            "the smaller number comes first",
        ),
        ("std = 100", "range = [-2, -1]", "outside this range"),
    ] {
        shows(&complaint_of(&text, change, to), words);
    }
    for (set, words) in [
        ("certificate.trials=0", "must be 1 or greater"),
        (
            "certificate.trip_probability=0",
            "cannot show a probability of 0",
        ),
        ("certificate.response_error=-1", "must be greater than zero"),
    ] {
        shows(&complaint_about_set(&[set]), words);
    }
}

#[test]
fn value_without_effect_is_refused() {
    const LINK: &str = "stiffness_n_per_m = 1e6\ndamping_n_s_per_m = 1e3\nhardening_bound = 1.5\n\
        link = { address = \"127.0.0.1:9\", reply_timeout_s = 1.0 }\n\
        limits = { command_disp_m = { trip = [-1, 1] }, measured_force_n = { trip = [-1e6, 1e6] } }\n";
    let (before, _) = GOOD.split_once("law = ").unwrap();
    let remote = |more: &str| format!("{before}{LINK}{KNOWN}{more}");
    let law = "reach_disp_m = 0.1\nstiffness_n_per_m = 1e6\n";
    let stand_in = "law.linear = { stiffness_n_per_m = 1e6 }\n";
    let transfer = "transfer = { delay_s = 0.01 }\n";
    for (text, key, instead) in [
        (remote(""), "stiffness_n_per_m", None),
        (remote(""), "damping_n_s_per_m", None),
        (remote(""), "identified.delay_s", None),
        (remote(""), "identified.noise_force_n", None),
        (remote(transfer), "transfer.delay_s", None),
        (remote(stand_in), "law.linear.stiffness_n_per_m", None),
        (
            with(law),
            "stiffness_n_per_m",
            Some("vary a parameter of its law"),
        ),
        (
            with(law),
            "reach_disp_m",
            Some("vary a parameter of its law"),
        ),
        (
            with(KNOWN),
            "identified.delay_s",
            Some("vary a parameter of its `transfer`"),
        ),
        (
            remote(stand_in),
            "stiffness_n_per_m",
            Some("vary a parameter of its law"),
        ),
        (
            remote(stand_in),
            "damping_n_s_per_m",
            Some("vary a parameter of its law"),
        ),
        (
            remote(""),
            "hardening_bound",
            Some("`identified.stiffness_std_n_per_m`"),
        ),
        (
            remote(""),
            "identified.stiffness_n_per_m",
            Some("vary `stiffness_n_per_m`"),
        ),
        (
            remote(""),
            "identified.gain_std",
            Some("give the largest spread"),
        ),
        (
            remote(transfer),
            "identified.delay_s",
            Some("vary a parameter of its `transfer`"),
        ),
        (
            remote(""),
            "capacity.force_n",
            Some("the smallest capacity"),
        ),
        (
            remote(""),
            "link.reply_timeout_s",
            Some("trials use no link"),
        ),
    ] {
        let text = format!("{text}[[uncertainty]]\nkey = \"specimen.0.{key}\"\nstd = 0.1\n");
        match instead {
            None => drop(accepted(&text, &[])),
            Some(instead) => {
                let said = read(&text, &[]).unwrap_err().to_string();
                shows(&said, &format!("`specimen[0].{key}`"));
                shows(&said, instead);
            }
        }
    }
}
