//! Every format by its sample in `tests/records`: sine waves of 8 (K-NET: 20) values a cycle, made for this purpose.

use proptest::prelude::*;

use super::super::tests::FORMATS;
use super::super::{detect, parse_record};
use super::*;

/// A sample, a component of it, and what must be read.
struct Sample {
    file: &'static str,
    text: &'static str,
    format: RecordFormat,
    column: Option<&'static str>,
    /// Number of the component from 1.
    number: usize,
    unit: Unit,
    dt: f64,
    points: usize,
    /// The third value (K-NET: the sixth), which is the peak.
    peak: f64,
}

macro_rules! samples {
    ($($file:literal $format:ident $column:expr, $number:literal, $unit:ident, $dt:literal, $points:literal, $peak:expr;)*) => {
        [$(Sample {
            file: $file,
            text: include_str!(concat!("../../../../tests/records/", $file)),
            format: RecordFormat::$format,
            column: $column,
            number: $number,
            unit: Unit::$unit,
            dt: $dt,
            points: $points,
            peak: $peak,
        }),*]
    };
}

const SAMPLES: [Sample; 28] = samples! {
    "knet.NS" Knet None, 1, Gal, 0.01, 100, 123.456;
    "kiknet.UD2" Knet None, 1, Gal, 0.01, 100, 12.5;
    "cosmos.V2c" Cosmos Some("Channel 1"), 1, CentimetrePerSecond2, 0.01, 16, -98.765;
    "cosmos.V2c" Cosmos Some("90 deg"), 2, Gravity, 0.01, 16, 0.125;
    "cosmos.V2c" Cosmos Some("HNN velocity"), 3, CentimetrePerSecond, 0.01, 16, -4.5;
    "csmip.V2" Csmip Some("H1"), 1, CentimetrePerSecond2, 0.01, 16, 98.765_432;
    "csmip.V2" Csmip Some("chan 2"), 2, CentimetrePerSecond2, 0.01, 16, -45.678;
    "csmip.V2" Csmip Some("Chan 1 velocity"), 3, CentimetrePerSecond, 0.01, 16, 1.5;
    "csmip.V2" Csmip Some("Up displacement"), 6, Centimetre, 0.01, 16, 0.125;
    "csmip.V1" Csmip None, 1, Gravity, 0.01, 16, 0.25;
    "bhrc.V1" Csmip Some("L1"), 1, Gravity, 0.005, 16, 0.25;
    "bhrc.V1" Csmip Some("T3"), 2, Gravity, 0.005, 16, -0.125;
    "usc.s0a" Csmip Some("N10E"), 1, Gravity, 0.01, 16, -0.15;
    "renadic.v1" Renadic Some("EW"), 1, Gravity, 0.01, 16, 0.25;
    "renadic.v1" Renadic Some("NS"), 2, Gravity, 0.01, 16, -0.125;
    "esm.ASC" Esm None, 1, CentimetrePerSecond2, 0.01, 16, -76.543;
    "geonet.V2A" Geonet Some("N10E"), 1, MillimetrePerSecond2, 0.02, 16, -10_234.5;
    "geonet.V2A" Geonet Some("up"), 2, MillimetrePerSecond2, 0.02, 16, 1000.0;
    "geonet.V2A" Geonet Some("N10E displacement"), 5, Millimetre, 0.02, 16, 99.5;
    "geonet.V1A" Geonet None, 1, MillimetrePerSecond2, 0.005, 16, 2345.6;
    "nsmn.txt" Nsmn Some("N-S"), 1, Gal, 0.01, 16, 110.5;
    "nsmn.txt" Nsmn Some("ew"), 2, Gal, 0.01, 16, -220.5;
    "cwa.txt" Cwa Some("N"), 2, Gal, 0.01, 16, -150.25;
    "smc.smc" Smc None, 1, CentimetrePerSecond2, 0.005, 16, 84.524;
    "bbp.acc.bbp" Bbp Some("E-W"), 2, CentimetrePerSecond2, 0.025, 16, -123.25;
    "unam.asa" Unam Some("Canal 1"), 1, Gal, 0.01, 16, 33.5;
    "unam.asa" Unam Some("N90E"), 3, Gal, 0.01, 16, -66.75;
    "bbp.acc.bbp" Bbp Some("U-D"), 3, CentimetrePerSecond2, 0.025, 16, 60.0;
};

fn with_column(column: Option<Column>) -> ReadOptions {
    ReadOptions {
        column,
        ..ReadOptions::default()
    }
}

fn read(text: &str, column: Option<&str>) -> Result<Record, MotionError> {
    let options = with_column(column.map(|name| Column::Name(name.into())));
    parse_record("sample.txt", text.as_bytes(), &options)
}

fn sample(file: &str) -> &'static str {
    SAMPLES.iter().find(|s| s.file == file).unwrap().text
}

/// The error of a sample with one part replaced.
fn broken(file: &str, old: &str, new: &str) -> MotionError {
    let text = sample(file);
    assert!(text.contains(old), "{file} has no {old:?}");
    read(&text.replacen(old, new, 1), None).unwrap_err()
}

#[test]
fn each_sample_is_recognised_and_read() {
    for sample in &SAMPLES {
        let Sample { file, text, .. } = sample;
        assert_eq!(detect("any.dat", text.as_bytes()), sample.format, "{file}");
        let record = read(text, sample.column).unwrap();
        assert_eq!(record.unit, Some(sample.unit), "{file}");
        assert!(
            (record.dt - sample.dt).abs() <= 1e-15,
            "{file}: {}",
            record.dt
        );
        assert_eq!(record.values.len(), sample.points, "{file}");
        let at = if sample.points == 100 { 5 } else { 2 };
        let offset = if *file == "kiknet.UD2" {
            32_636.0 * 2000.0 / 8_388_608.0
        } else {
            0.0
        };
        // Half a count of the recorder, or half of the last digit in print.
        let slack = if sample.format == RecordFormat::Knet {
            5e-4
        } else {
            1e-12 * sample.peak.abs()
        };
        let found = record.values[at] - offset;
        assert!(
            (found - sample.peak).abs() <= slack,
            "{file}: {found} for {}",
            sample.peak
        );
        let by_number = with_column(Some(Column::Number(sample.number)));
        let again = parse_record("any.dat", text.as_bytes(), &by_number).unwrap();
        assert_eq!(again.values, record.values, "{file}");
        let warned = *file == "kiknet.UD2";
        assert_eq!(
            record.warnings.is_empty(),
            !warned,
            "{file}: {:?}",
            record.warnings
        );
    }
}

#[test]
fn all_line_ends_and_blanks_are_read() {
    for sample in &SAMPLES {
        let wanted = read(sample.text, sample.column).unwrap();
        for end in ["\r\n", "   \n", "\r\r\n"] {
            let record = read(&sample.text.replace('\n', end), sample.column).unwrap();
            assert_eq!(record, wanted, "{} with {end:?}", sample.file);
        }
    }
}

#[test]
fn several_components_need_a_choice() {
    for (file, named) in [
        ("cosmos.V2c", "2 = \"Chan 2\" (90 deg)"),
        ("csmip.V2", "1 = \"Chan 1\" (H1)"),
        ("renadic.v1", "2 = \"Chan 2\" (NS)"),
        ("geonet.V2A", "1 = \"N10E\""),
        ("nsmn.txt", "3 = \"U-D\""),
        ("cwa.txt", "1 = \"U\""),
        ("bbp.acc.bbp", "2 = \"E-W\""),
        ("unam.asa", "3 = \"Canal 3\""),
    ] {
        match read(sample(file), None).unwrap_err() {
            MotionError::ColumnChoice { available, .. } => {
                assert!(available.contains(named), "{file}: {available}");
            }
            other => panic!("{file}: {other}"),
        }
        for column in [
            Column::Name("no such".into()),
            Column::Number(0),
            Column::Number(99),
        ] {
            let options = with_column(Some(column));
            let error = parse_record(file, sample(file).as_bytes(), &options).unwrap_err();
            assert!(
                matches!(error, MotionError::ColumnUnknown { .. }),
                "{file}: {error}"
            );
        }
    }
}

/// One acceleration beside its velocity and displacement is what a ground motion means.
#[test]
fn single_acceleration_needs_no_choice() {
    let text = sample("csmip.V2");
    let end = text
        .find("Corrected accelerogram   12345-S0001-01001.01       Chan  2")
        .unwrap();
    let record = read(&text[..end], None).unwrap();
    assert_eq!(record.unit, Some(Unit::CentimetrePerSecond2));
    assert_eq!(record.values[2], 98.765_432);
}

#[test]
fn wrong_count_is_refused_with_both_numbers() {
    for (file, old, new, announced, found) in [
        (
            "knet.NS",
            "Duration Time(s)  1",
            "Duration Time(s)  2",
            200,
            100,
        ),
        (
            "cosmos.V2c",
            "   16 acceleration pts",
            "   17 acceleration pts",
            17,
            16,
        ),
        (
            "csmip.V2",
            "16 points of accel data",
            "15 points of accel data",
            15,
            16,
        ),
        (
            "csmip.V1",
            "16 POINTS OF ACCEL",
            "18 POINTS OF ACCEL",
            18,
            16,
        ),
        ("renadic.v1", "POINTS =  16", "POINTS =  17", 34, 32),
        ("esm.ASC", "NDATA: 16", "NDATA: 20", 20, 16),
        (
            "geonet.V1A",
            "Number of points    16",
            "Number of points    17",
            17,
            16,
        ),
        ("nsmn.txt", "DATA\t:\t16", "DATA\t:\t12", 12, 16),
        ("cwa.txt", "(sec): 0.16", "(sec): 0.32", 32, 16),
        ("smc.smc", "        16", "        24", 24, 16),
        ("unam.asa", "/16/16/16", "/19/19/19", 19, 16),
    ] {
        match broken(file, old, new) {
            MotionError::PointCount {
                announced: a,
                found: f,
                line,
                ..
            } => assert_eq!((a, f, line > 0), (announced, found, true), "{file}"),
            other => panic!("{file}: {other}"),
        }
    }
}

/// The duration of a header finds a step in the wrong unit, and a wrong length.
#[test]
fn stated_duration_is_compared() {
    for (file, old, new, stated, dt) in [
        (
            "cosmos.V2c",
            "  .160000   -98.765000",
            "  .320000   -98.765000",
            0.32,
            0.01,
        ),
        // A step in s where ms are due, without a length in the header.
        (
            "cosmos.V2c",
            "    10.000000      .160000",
            " 10000.000000  -999.000000",
            0.0,
            10.0,
        ),
        (
            "cosmos.V2c",
            "approx  0 secs",
            "approx 160 secs",
            160.0,
            0.01,
        ),
        ("csmip.V1", "LENGTH = 0.150", "LENGTH = 150.0", 150.0, 0.01),
        (
            "csmip.V2",
            "Record length =   .160",
            "Record length = 160.0",
            160.0,
            0.01,
        ),
        (
            "usc.s0a",
            "DURATION =    .150",
            "DURATION =    .300",
            0.3,
            0.01,
        ),
        ("renadic.v1", "LENGTH = 0.160", "LENGTH = 0.320", 0.32, 0.01),
        (
            "esm.ASC",
            "DURATION_S: 0.150000",
            "DURATION_S: 150.0",
            150.0,
            0.01,
        ),
        (
            "unam.asa",
            "ACEL. MAX.",
            "DURACION DEL REGISTRO (s), C1-C6: /1.6/1.6/1.6\nACEL. MAX.",
            1.6,
            0.01,
        ),
    ] {
        let text = sample(file).replacen(old, new, 1);
        assert_ne!(text, sample(file), "{file}");
        let mut options = with_column(Some(Column::Number(1)));
        match parse_record(file, text.as_bytes(), &options).unwrap_err() {
            MotionError::Duration {
                stated: s,
                dt: d,
                points,
                line,
                ..
            } => {
                assert_eq!((s, points, line > 0), (stated, 16, true), "{file}");
                assert!((d - dt).abs() < 1e-12, "{file}: {d}");
            }
            other => panic!("{file}: {other}"),
        }
        options.dt = Some(0.01);
        assert!(
            parse_record(file, text.as_bytes(), &options).is_ok(),
            "{file}"
        );
    }
}

#[test]
fn variants_of_a_format_are_read() {
    let end = "End-of-data for Chan  1 acceleration";
    for (file, column, old, new) in [
        (
            "cosmos.V2c",
            "Chan 1",
            end,
            "/&  --- End of data for channel 1",
        ),
        ("cosmos.V2c", "Chan 2", end, "/&"),
        (
            "csmip.V1",
            "Chan 1",
            "16 POINTS OF ACCEL DATA EQUALLY SPACED AT .010 SEC.  (UNITS: G)",
            " 16 Accelerogram points at 100 pts/sec in units of g .      Format: (8f9.6)",
        ),
        (
            "csmip.V2",
            "Chan 1",
            "at  .010 sec, in cm/sec2. (8f10.6)",
            "AT   .010 SEC.  IN UNITS CM/SEC/SEC",
        ),
        (
            "unam.asa",
            "Canal 1",
            "====",
            "************************\n====",
        ),
    ] {
        let text = sample(file).replacen(old, new, 1);
        assert_ne!(text, sample(file), "{file}");
        let (found, wanted) = (
            read(&text, Some(column)).unwrap(),
            read(sample(file), Some(column)).unwrap(),
        );
        assert_eq!(found.values, wanted.values, "{file}");
        assert_eq!((found.dt, found.unit), (wanted.dt, wanted.unit), "{file}");
        assert!(found.warnings.is_empty(), "{file}: {:?}", found.warnings);
    }
}

/// A film: 16 points of the straight line a = 10 t at unequal times. The line between them is the line itself.
#[test]
fn film_points_at_unequal_times_are_read() {
    let text = sample("usc.s0a");
    let mut head: String = text.lines().take(27).collect::<Vec<_>>().join("\n");
    let mut time = 0.0;
    let mut last = 0.0;
    for row in 0..16 {
        let end = if row % 5 == 0 { "\n" } else { "" };
        head.push_str(&format!("{end} {time:.3} {:.3}", 10.0 * time));
        last = time;
        time += if row % 8 < 4 { 0.006 } else { 0.014 };
    }
    let head = head.replacen(".150 SEC", &format!("{last:.3} SEC"), 1);
    let record = read(&head, None).unwrap();
    assert!((record.dt - last / 15.0).abs() < 1e-12, "{}", record.dt);
    for (row, value) in record.values.iter().enumerate() {
        // In g; the file is in g/10. Print rounds times and values together.
        let wanted = row as f64 * record.dt;
        assert!(
            (value - wanted).abs() < 1e-12,
            "{row}: {value} for {wanted}"
        );
    }
    let is_told = record.warnings.iter().any(|w| w.contains("unequal times"));
    assert!(is_told, "{:?}", record.warnings);
    // A point out of order is no film.
    let error = read(&head.replacen(" 0.012 ", " 0.090 ", 1), None).unwrap_err();
    assert!(matches!(error, MotionError::NotUniform { .. }), "{error}");
}

/// Cut anywhere, a file is refused, or read in whole components only.
#[test]
fn truncated_file_never_gives_a_component() {
    for sample in &SAMPLES {
        let whole = read(sample.text, sample.column).unwrap();
        for end in (1..sample.text.len()).step_by(13) {
            let options = ReadOptions {
                format: Some(sample.format),
                ..with_column(sample.column.map(|name| Column::Name(name.into())))
            };
            let cut = &sample.text.as_bytes()[..end];
            if let Ok(record) = parse_record("cut.txt", cut, &options) {
                // BBP states no count; the digits of a last value may be cut in any text.
                let is_whole = record.values.len() == whole.values.len();
                let is_counted = sample.format != RecordFormat::Bbp;
                assert!(is_whole || !is_counted, "{} at {end}", sample.file);
            }
        }
    }
}

#[test]
fn unread_variants_are_refused_with_reasons() {
    for (file, old, new, word) in [
        ("cosmos.V2c", "cm/sec2 (04)", "counts (50)", "counts"),
        ("cosmos.V2c", "cm/sec2 (04)", "deg/s (24)", "translation"),
        (
            "cosmos.V2c",
            "Corrected acceleration",
            "Response spectra",
            "spectra",
        ),
        (
            "esm.ASC",
            "DATA_TYPE: ACCELERATION",
            "DATA_TYPE: SPECTRUM",
            "spectrum",
        ),
        (
            "smc.smc",
            "2 CORRECTED ACCELEROGRAM",
            "4 RESPONSE SPECTRA",
            "spectra",
        ),
        ("smc.smc", "0.2000000E+03", "0.1700000E+39", "unequal times"),
        (
            "csmip.V2",
            "Corrected accelerogram",
            "Response and Fourier Amplitude Spectra\nCorrected accelerogram",
            "V3",
        ),
    ] {
        let error = broken(file, old, new);
        let is_named = matches!(&error, MotionError::UnsupportedRecord { reason, .. } if reason.contains(word));
        assert!(is_named, "{file}: {error}");
    }
}

#[test]
fn sac_and_mini_seed_are_refused_by_name() {
    let mut sac = vec![0_u8; 632 + 8];
    sac[304..308].copy_from_slice(&6_u32.to_le_bytes());
    sac[316..320].copy_from_slice(&2_u32.to_le_bytes());
    let mut seed = b"000001D ABC  00HNE".to_vec();
    seed.extend([0; 46]);
    for (bytes, named) in [
        (sac, "SAC"),
        (seed, "miniSEED"),
        (b"MS\x03\0".to_vec(), "miniSEED"),
    ] {
        let error = parse_record("a.bin", &bytes, &ReadOptions::default()).unwrap_err();
        let is_named =
            matches!(error, MotionError::UnsupportedRecord { format, .. } if format == named);
        assert!(is_named, "{named}");
    }
    // Text that begins like a record of miniSEED is text.
    assert!(parse_record("a.txt", b"000001D 1\n2\n", &ReadOptions::default()).is_err());
    assert!(binary::refuse("a.txt", b"000001D 1\n2\n").is_ok());
}

#[test]
fn header_fault_is_shown_with_its_line() {
    for (file, old, new, line) in [
        ("knet.NS", "3920(gal)/6170801", "3920(gal)", 14),
        ("knet.NS", "100Hz", "0Hz", 11),
        ("knet.NS", "Memo.", "Remark", 24),
        (
            "cosmos.V2c",
            "with 13 text lines",
            "with many text lines",
            1,
        ),
        ("cosmos.V2c", "(10I8)", "(free)", 14),
        (
            "geonet.V2A",
            "at 0.020 sec intervals",
            "at 0.030 sec intervals",
            26,
        ),
        ("smc.smc", "|sample", "sample", 29),
        ("cwa.txt", "#SampleRate(Hz): 100", "#SampleRate(Hz): 50", 29),
        ("unam.asa", "/.01/.01/.01", "/.01/.02/.01", 26),
        ("esm.ASC", "UNITS: cm/s^2", "UNITS: counts", 11),
        ("nsmn.txt", "SAMPLING INTERVAL", "INTERVAL", 18),
    ] {
        match broken(file, old, new) {
            MotionError::Header { line: found, .. } => assert_eq!(found, line, "{file} {new}"),
            other => panic!("{file} {new}: {other}"),
        }
    }
    let error = broken("csmip.V2", "69.837707 98.765432", "NaN       98.765432");
    assert!(
        matches!(error, MotionError::NotFinite { line: 47, .. }),
        "{error}"
    );
    let error = broken("renadic.v1", "0.030  1.768", "0.090  1.768");
    assert!(
        matches!(error, MotionError::NotUniform { line: 28, .. }),
        "{error}"
    );
    let error = broken("bbp.acc.bbp", "7.5000000e-02", "9.9000000e-02");
    assert!(
        matches!(error, MotionError::NotUniform { line: 6, .. }),
        "{error}"
    );
}

#[test]
fn unreached_stated_peak_is_a_warning() {
    for (file, old, new) in [
        ("knet.NS", "(gal)   123.456", "(gal)   12.3456"),
        ("esm.ASC", "-76.543000\n", "-7.6543\n"),
        ("smc.smc", "0.8452400E+02", "0.8452400E+03"),
        ("geonet.V1A", "2345.6 mm/s/s", "234.56 mm/s/s"),
    ] {
        let record = read(&sample(file).replacen(old, new, 1), None).unwrap();
        assert_eq!(record.warnings.len(), 1, "{file}");
        assert!(
            record.warnings[0].contains("peak"),
            "{file}: {:?}",
            record.warnings
        );
    }
}

/// K-NET leaves the offset of the recorder in: it would integrate to a drift.
#[test]
fn recorder_offset_stays_with_a_warning() {
    let record = read(sample("kiknet.UD2"), None).unwrap();
    assert!((record.values[0] - 7.781).abs() < 1e-3);
    assert!(
        record.warnings[0].contains("processing.detrend"),
        "{:?}",
        record.warnings
    );
}

#[test]
fn given_step_overrules_with_a_warning() {
    let text = sample("esm.ASC");
    let options = ReadOptions {
        dt: Some(0.02),
        ..ReadOptions::default()
    };
    let record = parse_record("a.asc", text.as_bytes(), &options).unwrap();
    assert_eq!((record.dt, record.warnings.len()), (0.02, 1));
    let options = ReadOptions {
        time_column: Some(Column::Number(1)),
        ..ReadOptions::default()
    };
    let error = parse_record("a.asc", text.as_bytes(), &options).unwrap_err();
    assert_eq!(error.key(), Some("time_column"));
}

/// Memory stays within a few times the size of a file, however many components it announces.
#[test]
fn file_of_too_many_components_is_refused() {
    let block = "1 points of accel data equally spaced at .01 sec, in g. (f5.1)\n  1.0\n";
    let text = format!("CORRECTED ACCELEROGRAM\n{}", block.repeat(1001));
    let error = read(&text, Some("Chan 1")).unwrap_err();
    assert!(
        matches!(error, MotionError::TooLarge { found: 1001, .. }),
        "{error}"
    );
}

#[test]
fn ordinary_tables_are_not_native_formats() {
    for text in [
        "# time [s] acc [g]\n0 0.1\n0.01 0.2\n",
        "Origin,Time\n0,1\n1,2\n",
        "EVENT_NAME,x\n1,2\n",
        "Corrected acceleration\n0 1\n1 2\n",
        "1 CORRECTED\n2\n3\n",
        "# N-S, E-W from COSMOS file\n0 1 2\n1 2 3\n",
        "NPTS= 2, DT= .01\n1 2\n",
        "# time(s),N-S(g),E-W(g)\n0,1,2\n0.1,2,3\n",
        "# time(s) accel(g)\n0 1\n0.1 2\n",
        "# time(s) N-S(counts)\n0 1\n0.1 2\n",
    ] {
        assert_eq!(super::detect(text), None, "{text}");
    }
}

#[test]
fn touching_numbers_split_by_width() {
    for (format, width) in [
        ("(8f10.6)", 10),
        ("Format=(6F13.6)", 13),
        ("( 10I8 )", 8),
        ("(1p5e15.7)", 15),
    ] {
        assert_eq!(lines::field_width(format), Some(width), "{format}");
    }
    assert_eq!(lines::field_width("(free)"), None);
    assert_eq!(lines::field_width("(8f0.6)"), None);
    assert_eq!(lines::number_after("LENGTH = .5 SEC", "length"), Some(0.5));
    assert_eq!(lines::leading_number("200Hz"), Some(200.0));
    assert_eq!(lines::leading_number("1.5E sec"), Some(1.5));
    assert_eq!(lines::leading_number("-"), None);
}

proptest! {
    /// A sample with a piece removed, doubled or replaced by the parsers' keywords causes no panic.
    #[test]
    fn damaged_samples_never_panic(
        which in 0..SAMPLES.len(),
        at in any::<prop::sample::Index>(),
        length in 0_usize..60,
        piece in "([0-9]{1,12}|[-+.,;:/()|#eEF =\t*]|\n|NaN|inf|é|pts|CHAN|POINTS OF|SPACED AT){0,12}",
    ) {
        let text = SAMPLES[which].text.as_bytes();
        let at = at.index(text.len());
        let end = (at + length).min(text.len());
        let damaged = [&text[..at], piece.as_bytes(), &text[end..]].concat();
        for format in [None, Some(SAMPLES[which].format)] {
            for column in [None, Some(Column::Number(1)), Some(Column::Name("N-S".into()))] {
                let options = ReadOptions { format, ..with_column(column) };
                if let Ok(record) = parse_record("damaged.txt", &damaged, &options) {
                    prop_assert!(record.dt > 0.0 && record.dt.is_finite());
                    prop_assert!(!record.values.is_empty());
                    prop_assert!(record.values.iter().all(|v| v.is_finite()));
                }
            }
        }
    }

    #[test]
    fn any_text_in_any_format_never_panics(text in "([0-9]{1,9}|[-+.:/()|#E =\t]|\n|Memo.|pts|a){0,80}") {
        for format in FORMATS {
            let options = ReadOptions { format: Some(format), ..ReadOptions::default() };
            let _ = parse_record("any.txt", text.as_bytes(), &options);
        }
    }
}

#[test]
fn values_without_a_quantity_are_refused() {
    let without = |file: &str, mark: &str| {
        let mut left_out = false;
        let is_kept = |line: &&str| {
            let is_it = !left_out && line.contains(mark);
            left_out |= is_it;
            !is_it
        };
        let lines: Vec<&str> = sample(file).lines().filter(is_kept).collect();
        let by_number = with_column(Some(Column::Number(1)));
        parse_record("any.dat", lines.join("\n").as_bytes(), &by_number)
    };
    for (file, mark, wanted) in [
        ("csmip.V2", "points of accel data", 46),
        ("renadic.v1", "NO. OF POINTS", 32),
    ] {
        match without(file, mark).map(|record| record.values.len()) {
            Err(MotionError::Header { line, .. }) => assert_eq!(line, wanted, "{file}"),
            other => panic!("{file}: {other:?}"),
        }
    }
    assert!(matches!(
        without("csmip.V2", "points of veloc data"),
        Err(MotionError::PointCount { found: 32, .. })
    ));
}
