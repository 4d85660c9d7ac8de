//! A library that is preloaded into a program and makes one of its operations on a folder fail, as the comment in `faults.c`
//! says. The program itself has no code for it.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use tempfile::TempDir;

/// How an operation fails: half of a block is written before the disk is full, or an error of the system.
pub(crate) const KINDS: [(&str, &str); 5] = [
    ("short write", "short"),
    ("full disk", "28"),
    ("input/output error", "5"),
    ("permission denied", "13"),
    ("vanished folder", "2"),
];

/// The compiled library, and the file that says which operation fails.
pub(crate) struct Faults {
    home: TempDir,
}

impl Faults {
    pub(crate) fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/support/faults.c");
        // The linker of Rust is there in any case.
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"]);
        compiler.arg(home.path().join("faults.so")).args([source, "-ldl"]);
        let compiled = compiler.output().unwrap();
        assert!(
            compiled.status.success(),
            "{}",
            String::from_utf8_lossy(&compiled.stderr)
        );
        Self { home }
    }

    /// File that says which operation fails; it is removed when that has happened.
    pub(crate) fn plan(&self) -> PathBuf {
        self.home.path().join("plan")
    }

    /// Preloads the library into a program, for operations on `folder`.
    pub(crate) fn preload(&self, command: &mut Command, folder: &Path) {
        command
            .env("LD_PRELOAD", self.home.path().join("faults.so"))
            .env("FAULT_FOLDER", folder)
            .env("FAULT_PLAN", self.plan());
    }
}

/// Makes operation number `at` from now on fail.
pub(crate) fn fail_at(plan: &Path, at: usize, kind: &str) {
    fs::write(plan, format!("{at} {kind}")).unwrap();
}

/// Returns `true` if the operation has failed; otherwise there were fewer, and none will fail any more.
pub(crate) fn has_failed(plan: &Path) -> bool {
    fs::remove_file(plan).is_err()
}
