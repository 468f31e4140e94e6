//! Facts of a build, for `src/program.rs`: digests of the sources, features, target, compiler, commit.
#![allow(clippy::disallowed_macros, reason = "Cargo reads what is printed")]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

/// Files outside `src` that are part of the program.
const FURTHER: [&str; 4] = [
    "Cargo.toml",
    "tools/read_samples.m",
    "tools/read_samples.py",
    "tools/specimen.py",
];

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut files = FURTHER.map(PathBuf::from).to_vec();
    find(&root, Path::new("src"), &mut files)?;
    files.sort();
    fact("SOURCES", &digest(&root, &files)?);
    fact("LOCK", &digest(&root, &["Cargo.lock".into()])?);
    let features = env::vars().filter_map(|(name, _)| {
        let feature = name.strip_prefix("CARGO_FEATURE_")?.to_lowercase();
        (feature != "default").then_some(feature)
    });
    let mut features: Vec<String> = features.collect();
    features.sort();
    fact("FEATURES", &features.join(","));
    fact("TARGET", &env::var("TARGET").unwrap_or_default());
    let compiler = Command::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()))
        .arg("--version")
        .output()?;
    fact("COMPILER", &String::from_utf8_lossy(&compiler.stdout));
    fact("COMMIT", commit(&root).as_deref().unwrap_or("unknown"));
    Ok(())
}

fn fact(name: &str, value: &str) {
    println!("cargo:rustc-env=GUSSET_{name}={}", value.trim());
}

/// Adds all files below `folder`, which is relative to `root`.
fn find(root: &Path, folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    println!("cargo:rerun-if-changed={}", folder.display());
    for entry in fs::read_dir(root.join(folder))? {
        let entry = entry?;
        let path = folder.join(entry.file_name());
        match entry.file_type()?.is_dir() {
            true => find(root, &path, files)?,
            false => files.push(path),
        }
    }
    Ok(())
}

/// Digest of names and contents of files.
fn digest(root: &Path, files: &[PathBuf]) -> io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    for file in files {
        println!("cargo:rerun-if-changed={}", file.display());
        let name = file.to_string_lossy();
        for part in [name.as_bytes(), &fs::read(root.join(file))?] {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
    }
    Ok(hasher.finalize().to_hex().to_string())
}

/// The commit of the sources, marked if they differ from it; none without a repository.
fn commit(root: &Path) -> Option<String> {
    let git = |arguments: &[&str]| {
        let mut git = Command::new("git");
        git.args(arguments).current_dir(root);
        // A repository around an unpacked archive is another one.
        git.env("GIT_CEILING_DIRECTORIES", root.parent().unwrap_or(root));
        git.output().ok()
    };
    let text = |arguments: &[&str]| {
        let output = git(arguments).filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = text(&["rev-parse", "HEAD"])?;
    // It changes with each commit and checkout.
    let log = text(&["rev-parse", "--git-path", "logs/HEAD"])?;
    if root.join(&log).exists() {
        println!("cargo:rerun-if-changed={log}");
    }
    let files = ["diff", "--quiet", "HEAD", "--", "src", "Cargo.lock"];
    let is_same = git(&[&files[..], &FURTHER].concat())?;
    let mark = if is_same.status.success() {
        ""
    } else {
        ", modified"
    };
    Some(commit + mark)
}
