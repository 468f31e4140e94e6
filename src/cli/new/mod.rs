//! `gusset new`: a commented test file that runs unchanged.

mod template;

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::ValueEnum;

use self::template::{PYTHON_PROTOCOL, SERVE_SCHEMA, Template};
use super::args::{NewArgs, TemplateArg};
use super::exit::Exit;
use super::{answer, tell};
use gusset_config as config;

/// Writes the files of a template into the current folder: all of them, or none.
pub fn new(args: &NewArgs) -> anyhow::Result<Exit> {
    if args.list {
        for which in TemplateArg::value_variants() {
            let help = which.to_possible_value();
            let help = help.and_then(|value| value.get_help().map(ToString::to_string));
            let name = Template::of(*which).name;
            answer(format_args!("{name:19}{}", help.unwrap_or_default()))?;
        }
        return Ok(Exit::Done);
    }
    let template = Template::of(args.template);
    let name = match &args.name {
        Some(name) => valid(name).map_err(anyhow::Error::msg)?,
        None => template.name,
    };
    let folder = Path::new("");
    let mut files = template.files(name);
    let mut kept = Vec::new();
    for shared in template.shared {
        if folder.join(shared).symlink_metadata().is_ok() {
            kept.push(*shared);
        } else {
            files.push(((*shared).to_owned(), text_of(shared)));
        }
    }
    write_all(folder, &files).map_err(anyhow::Error::msg)?;
    for shared in kept {
        let same = fs::read_to_string(folder.join(shared)).is_ok_and(|old| old == text_of(shared));
        if !same {
            tell(format_args!(
                "warning: {shared} exists and is of another version; it was kept. To renew it, remove it and repeat the command \
                 with another NAME"
            ));
        }
    }
    answer(told(&template, name, &files))?;
    Ok(Exit::Done)
}

/// The text of a file that several tests in a folder share.
fn text_of(shared: &str) -> String {
    match shared {
        SERVE_SCHEMA => config::schema_of::<config::ServeFile>() + "\n",
        PYTHON_PROTOCOL => include_str!("../../../tools/specimen.py").to_owned(),
        _ => config::json_schema() + "\n",
    }
}

/// The name of a test, without the ending of its file.
fn valid(name: &str) -> Result<&str, String> {
    let stem = name.strip_suffix(".toml").unwrap_or(name);
    let fit = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    if stem.starts_with(|c: char| c.is_ascii_alphanumeric()) && stem.chars().all(fit) {
        Ok(stem)
    } else {
        Err(format!(
            "NAME {name:?}: use letters, digits, `-`, `_` and `.`, beginning with a letter or digit. The files are written to \
             the current folder"
        ))
    }
}

/// Writes every file, or none: what is there already stays, and nothing is left of a failure.
fn write_all(folder: &Path, files: &[(String, String)]) -> Result<(), String> {
    let taken: Vec<&str> = files
        .iter()
        .map(|(name, _)| name.as_str())
        .filter(|name| folder.join(name).symlink_metadata().is_ok())
        .collect();
    if !taken.is_empty() {
        let verb = if taken.len() == 1 { "exists" } else { "exist" };
        return Err(format!(
            "{} {verb} already; nothing was written. Choose another NAME",
            taken.join(" and ")
        ));
    }
    let mut made: Vec<PathBuf> = Vec::new();
    for (name, text) in files {
        let path = folder.join(name);
        let written = File::create_new(&path).and_then(|mut file| {
            made.push(path.clone());
            file.write_all(text.as_bytes())
        });
        if let Err(error) = written {
            return Err(undone(name, &error, &made));
        }
    }
    Ok(())
}

/// Removes what was made, and says why.
fn undone(name: &str, error: &io::Error, made: &[PathBuf]) -> String {
    for path in made {
        let _it_is_ours = fs::remove_file(path);
    }
    format!("{name} cannot be written: {error}; nothing was left")
}

/// Names the written files and the next commands.
fn told(template: &Template, name: &str, files: &[(String, String)]) -> String {
    let width = files.iter().map(|(name, _)| name.len()).max().unwrap_or(0) + 2;
    let mut text = "Written to the current folder:\n".to_owned();
    for (index, (file, _)) in files.iter().enumerate() {
        let what = match template.pieces.get(index) {
            Some(piece) => piece.what,
            None if file == PYTHON_PROTOCOL => "the protocol, used by the specimen",
            None if file == SERVE_SCHEMA => "keys of a served file, for editors",
            None => "keys of a test file, for editors",
        };
        text.push_str(&format!("  {file:width$}{what}\n"));
    }
    text.push_str("\nNext:");
    for command in template.next {
        text.push_str(&format!("\n  {}", command.replace("NAME", name)));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use gusset_motion::{
        CloughPenzien, Envelope, Grid, JenningsHousner, KanaiTajimi, Motion, Quantity, Signal, Unit,
    };

    #[test]
    fn name_is_a_file_name_in_this_folder() {
        assert_eq!(valid("first"), Ok("first"));
        assert_eq!(valid("test_2.b.toml"), Ok("test_2.b"));
        for wrong in ["", "a/b", "../a", ".hidden", "-x", "a b", "é", ".toml"] {
            assert!(valid(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn failure_leaves_none_of_the_files() {
        let folder = tempfile::tempdir().unwrap();
        let files = ["one", "no-folder/two"].map(|name| (name.to_owned(), "text".to_owned()));
        assert!(write_all(folder.path(), &files).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn file_names_follow_the_name_of_the_test() {
        let files = Template::of(TemplateArg::Remote).files("my-remote");
        let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["my-remote.toml", "my-remote-specimen.toml"]);
        for (_, text) in &files {
            assert!(text.contains(" my-remote.toml") && text.contains("my-remote-specimen.toml"));
            assert!(!text.contains(" remote.toml") && !text.contains("my-my-"));
        }
    }

    /// The record that ships with the templates is the stochastic process of this program, not a measured earthquake.
    #[test]
    fn record_of_the_templates_is_synthetic() {
        let (_, text) = Template::of(TemplateArg::ShearBuilding)
            .files("a")
            .remove(1);
        assert!(text.starts_with("SYNTHETIC"));
        let values: Vec<f64> = text
            .lines()
            .skip(4)
            .flat_map(str::split_whitespace)
            .map(|number| number.parse().unwrap())
            .collect();
        let quake = KanaiTajimi {
            ground_frequency_hz: Some(2.0),
            ground_angular_frequency_rad_per_s: None,
            ground_damping_ratio: 0.6,
            clough_penzien: Some(CloughPenzien {
                angular_frequency_rad_per_s: 1.5,
                damping_ratio: 0.6,
            }),
            envelope: Envelope::JenningsHousner(JenningsHousner {
                rise_s: 2.0,
                strong_s: 8.0,
                decay_per_s: 0.5,
            }),
            duration_s: 20.0,
            seed: 2014,
            peak: Some(0.3),
            unit: Some(Unit::Gravity),
            s0_m2_per_s3: None,
            cutoff_hz: 50.0,
            start_s: 0.0,
        };
        let motion = Motion::plain(Signal::KanaiTajimi(quake));
        let grid = Grid::new(0.01, 1999).unwrap();
        let none = |_: &str| Err(io::Error::from(io::ErrorKind::NotFound));
        let series = motion
            .evaluate(Quantity::Acceleration, grid, &none)
            .unwrap();
        assert_eq!(values.len(), 2000);
        for (written, made) in values.iter().zip(&series.values) {
            // Eight digits are written.
            let made = made / 9.806_65;
            assert!(
                (written - made).abs() <= 1e-7 * made.abs() + 1e-12,
                "{written} {made}"
            );
        }
    }
}
