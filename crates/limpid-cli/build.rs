//! Passes the commit that is built to the program.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-env-changed=LIMPID_COMMIT");
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok();
        let output = output.filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    // Changes with each commit, also in a worktree.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={log}");
    }
    // Packages have no repository; whoever builds them names the commit.
    let named = std::env::var("LIMPID_COMMIT").ok();
    let commit = named.or_else(|| git(&["rev-parse", "--short=12", "HEAD"]));
    println!("cargo::rustc-env=LIMPID_COMMIT={}", commit.unwrap_or_else(|| "unknown".into()));
}
