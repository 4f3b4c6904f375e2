//! A job array of Slurm.

mod rare {
    use super::super::*;

    /// A real Slurm runs the documented job array, with one task killed and one requeued in the middle.
    /// Skipped without Slurm, unless `LIMPID_REQUIRE_SLURM=1` is set.
    #[test]
    #[ignore = "rare: scripts/nightly.sh runs it"]
    #[cfg(target_os = "linux")]
    fn slurm_draws_every_frame_once() {
        let required = std::env::var("LIMPID_REQUIRE_SLURM").is_ok_and(|value| value == "1");
        let installed = ["/usr/sbin", "/usr/bin", "/usr/local/sbin"]
            .iter()
            .any(|folder| Path::new(folder).join("slurmctld").exists());
        if !adapter() || !(installed || required) {
            eprintln!("skipped: no Slurm here");
            return;
        }
        let script = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
            .join("crates/limpid-cli/tests/slurm.sh");
        let ended = Command::new(script).arg(env!("CARGO_BIN_EXE_limpid")).output().unwrap();
        let stdout = String::from_utf8_lossy(&ended.stdout);
        assert!(ended.status.success(), "{stdout}{}", String::from_utf8_lossy(&ended.stderr));
        println!("{stdout}");
    }
}
