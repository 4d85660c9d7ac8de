//! Replaying a corpus of inputs, each also damaged in ways that no format expects.

/// Calls `$check` with every file in the corpus of the enclosing test, `__fuzz__/<module>__<test>/corpus`, and with the file
/// damaged as by [`damaged`]; it returns how much of its input is accepted: at least `$least` in all.
///
/// Nothing random is added, so the same files give the same result. `cargo bolero test <module>::<test>` (libFuzzer, run by
/// hand) mutates them guided by code coverage, and adds what it finds.
macro_rules! replay {
    ($least:expr, $check:expr) => {
        use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
        let (replayed, accepted) = (AtomicUsize::new(0), AtomicUsize::new(0));
        bolero::check!()
            .with_iterations(0)
            .with_test_time(std::time::Duration::MAX)
            .for_each(|input: &[u8]| {
                replayed.fetch_add(1, Relaxed);
                accepted.fetch_add($check(input), Relaxed);
                for input in $crate::corpus::damaged(input) {
                    accepted.fetch_add($check(&input[..]), Relaxed);
                }
            });
        let (replayed, accepted): (usize, usize) = (replayed.into_inner(), accepted.into_inner());
        assert!(replayed >= 2, "the corpus has {replayed} files");
        assert!(($least..).contains(&accepted), "only {accepted} inputs are accepted");
    };
}
pub(crate) use replay;

/// Returns `valid` cut off, as zeros, in other encodings, deep in brackets, and with numbers that few formats can hold.
pub(crate) fn damaged(valid: &[u8]) -> Vec<Vec<u8>> {
    const DEEP: usize = 20_000;
    let half = valid.len() / 2;
    let utf_16 = valid.iter().flat_map(|&byte| [byte, 0]);
    let is_of_number = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let runs = valid.chunk_by(|a, b| is_of_number(a) == is_of_number(b));
    let longest = runs.filter(|run| run[0].is_ascii_digit()).max_by_key(|run| run.len());
    let with_number = |text: &str| {
        let number = longest?;
        let at = valid.windows(number.len()).position(|window| window == number)?;
        Some([&valid[..at], text.as_bytes(), &valid[at + number.len()..]].concat())
    };
    let numbers = ["1e999", "18446744073709551616", "99999999", "NaN", "null", "-0.5"];
    let numbers = numbers.into_iter().filter_map(with_number);
    [
        valid[..half].to_vec(),
        vec![0; valid.len().min(64)],
        [0xff, 0xfe].into_iter().chain(utf_16).collect(),
        [b"\xef\xbb\xbf", valid].concat(),
        [&valid[..half], b"\xb5", &valid[half..]].concat(),
        ["[".repeat(DEEP).as_bytes(), valid].concat(),
    ]
    .into_iter()
    .chain(numbers)
    .collect()
}
