//! Replaying a corpus of inputs.

/// Calls `$check` with every file in the corpus of the enclosing test: `__fuzz__/<module>__<test>/corpus`.
///
/// Nothing random is added, so the same files give the same result. `cargo bolero test <module>::<test>` (libFuzzer,
/// run by hand) mutates them guided by code coverage, and adds what it finds.
macro_rules! replay {
    ($check:expr) => {
        let replayed = std::sync::atomic::AtomicUsize::new(0);
        bolero::check!()
            .with_iterations(0)
            .with_test_time(std::time::Duration::MAX)
            .for_each(|input: &[u8]| {
                replayed.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                $check(input);
            });
        let replayed = replayed.into_inner();
        assert!(replayed >= 5, "the corpus has {replayed} files");
    };
}
pub(crate) use replay;
