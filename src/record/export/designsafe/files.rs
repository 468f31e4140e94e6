//! Files of a folder: copied, listed.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};

use crate::Checksum;

/// Copies plain files, and folders with their contents.
pub(super) fn copy(from: &Path, to: &dyn Fn(&str) -> PathBuf) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let name = entry.file_name();
        let target = to(&name.to_string_lossy());
        let kind = entry.file_type()?;
        if kind.is_dir() {
            copy(&entry.path(), &|name| target.join(name))?;
        } else if kind.is_file() {
            if let Some(folder) = target.parent() {
                fs::create_dir_all(folder)?;
            }
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

/// Adds every file with its size and SHA-256.
pub(super) fn list(root: &Path, folder: &Path, files: &mut Vec<Value>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            list(root, &path, files)?;
            continue;
        }
        let (sum, bytes) = digest(&path)?;
        let path = path.strip_prefix(root).unwrap_or(&path);
        files.push(json!({"path": path, "bytes": bytes, "sha256": sum}));
    }
    Ok(())
}

fn digest(path: &Path) -> io::Result<(Checksum, u64)> {
    let (mut file, mut sum, mut bytes) = (File::open(path)?, Sha256::new(), 0);
    let mut buffer = vec![0; 1 << 18];
    loop {
        let count = file.read(&mut buffer)?;
        if count == 0 {
            return Ok((sum.into(), bytes));
        }
        bytes += count as u64;
        sum.update(buffer.get(..count).unwrap_or_default());
    }
}
