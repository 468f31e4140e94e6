//! `gusset import`: hands the options to the importer in Python, which replaces this process.

use std::os::unix::process::CommandExt;
use std::process::Command;

use super::args::ImportArgs;
use super::exit::Exit;

/// Ends this process as the importer ends. It returns only if the importer cannot be started.
pub fn import(args: &ImportArgs) -> anyhow::Result<Exit> {
    let options = serde_json::to_string(&args.source)?;
    let named = std::env::var_os("GUSSET_PYTHON").filter(|name| !name.is_empty());
    let python = named.unwrap_or_else(|| "python3".into());
    let shown = python.display();
    let probe = Command::new(&python)
        .args(["-c", "import gusset.importer"])
        .output();
    let probe = probe.map_err(|error| {
        anyhow::anyhow!("Python cannot be started as {shown}: {error}. Install Python 3.9 or later, or set GUSSET_PYTHON to it")
    })?;
    if !probe.status.success() {
        let told = String::from_utf8_lossy(&probe.stderr);
        anyhow::bail!(
            "{shown} cannot load the importer: {}. Install it with `pip install .` in the source folder of Gusset, or set \
             GUSSET_PYTHON to the Python that has it. More: gusset guide import",
            told.trim_end().lines().last().unwrap_or("no reason given")
        );
    }
    let mut importer = Command::new(&python);
    importer.args(["-m", "gusset.importer", &options]);
    // The importer runs this program, to check what it writes.
    if std::env::var_os("GUSSET_BINARY").is_none() {
        importer.env("GUSSET_BINARY", std::env::current_exe()?);
    }
    let error = importer.exec();
    anyhow::bail!("{shown} cannot be started: {error}")
}
