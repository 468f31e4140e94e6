//! Runs one visit script of this folder under Node and returns its findings.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

/// The scripts' modules and the browser; `None`, with a clear message, where they are missing.
///
/// # Panics
/// Where they are missing and CI=true.
pub fn installed() -> Option<(PathBuf, PathBuf)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let given = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let modules = given("GUSSET_BROWSER_MODULES").unwrap_or_else(|| root.join("target/browser"));
    let browser = given("GUSSET_BROWSER").unwrap_or_else(|| "/usr/bin/chromium".into());
    if modules.join("node_modules/playwright-core").exists() && browser.exists() {
        return Some((modules, browser));
    }
    let text =
        "SKIPPED: the browser for the tests of pages is not installed; `tools/test` installs it\n";
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{text}");
    // Past the capture of the test harness, which hides the output of a passing test.
    let _ = std::io::stderr().write_all(text.as_bytes());
    None
}

/// Runs `script` with `arguments`; what it found, or `None` where there is no browser.
///
/// # Panics
/// If the script fails or prints no JSON.
pub fn visit(script: &str, arguments: &[&str]) -> Option<Value> {
    let (modules, browser) = installed()?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/pages/browser")
        .join(script);
    let output = Command::new("node")
        .arg(path)
        .args(arguments)
        .env("GUSSET_BROWSER_MODULES", modules)
        .env("GUSSET_BROWSER", browser)
        .stdin(Stdio::null())
        .output()
        .expect("node runs");
    let stdout = String::from_utf8(output.stdout).expect("UTF-8");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{script}: {stderr}");
    let last = stdout.lines().last().unwrap_or_default();
    Some(serde_json::from_str(last).unwrap_or_else(|e| panic!("{script}: {e}\n{stdout}\n{stderr}")))
}

/// Panics unless the visit was quiet: nothing in the console, no error, no request that would have left the machine.
pub fn assert_quiet(found: &Value) {
    for what in ["console", "errors", "left"] {
        assert_eq!(found[what], serde_json::json!([]), "{what}: {found:#}");
    }
}
