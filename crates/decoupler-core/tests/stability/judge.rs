//! Cells and their verdicts, and the check that a message has a cause and a cure.

use std::{
    fmt::Display,
    panic::{AssertUnwindSafe, catch_unwind},
};

/// The verdict on one cell.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// It agrees with an independent truth, or stays within a computed bound.
    Right,
    /// It was refused, with cause and cure.
    Refused,
    /// There is a result, and a remark with cause and cure.
    Flagged,
    /// Plausible but wrong; or a panic, a NaN, or a message without a cure.
    Wrong(String),
}

/// A job that produces one or several cells.
pub(crate) struct Job {
    sentence: String,
    run: Box<dyn Fn() -> Vec<(String, Verdict)> + Send + Sync>,
}

impl Job {
    /// A job with several cells, each with the name of its subject.
    pub(crate) fn new(sentence: String, run: impl Fn() -> Vec<(String, Verdict)> + Send + Sync + 'static) -> Self {
        Self {
            sentence,
            run: Box::new(run),
        }
    }

    /// A job with one cell.
    pub(crate) fn one(sentence: String, run: impl Fn() -> Verdict + Send + Sync + 'static) -> Self {
        Self::new(sentence, move || vec![(String::new(), run())])
    }

    /// Runs the job.
    pub(crate) fn cells(&self) -> Vec<(String, Verdict)> {
        let panicked = |cause: Box<dyn std::any::Any + Send>| {
            let text = cause.downcast_ref::<String>().cloned();
            let text = text.or_else(|| cause.downcast_ref::<&str>().map(|text| (*text).to_owned()));
            vec![(String::new(), wrong(format!("panic: {}", text.unwrap_or_default())))]
        };
        let judged = catch_unwind(AssertUnwindSafe(|| (self.run)())).unwrap_or_else(panicked);
        let cell = |(part, verdict): (String, Verdict)| (format!("{}: {part}", self.sentence), verdict);
        judged.into_iter().map(cell).collect()
    }
}

/// Returns a refusal if its message says what to change.
pub(crate) fn refused(error: &impl Display) -> Verdict {
    with_cure(error, Verdict::Refused)
}

/// Returns a remark if its message says what to change.
pub(crate) fn flagged(remark: &impl Display) -> Verdict {
    with_cure(remark, Verdict::Flagged)
}

pub(crate) fn wrong(what: impl Into<String>) -> Verdict {
    Verdict::Wrong(what.into())
}

/// Returns `verdict` if the message names a cure and is written for users.
fn with_cure(message: &impl Display, verdict: Verdict) -> Verdict {
    const CURES: &[&str] = &[
        "give", "must", "use ", "take", "lower", "raise", "set ", "draw", "train", "make", "check", "choose", "write",
        "copy", "fewer", "keep", "end rows", "name ", "need", "let ", "shift", "begin", "install", "resume", "change",
        "scale ", "correct", "press ", "try ",
    ];
    let words = message.to_string().to_lowercase();
    if !CURES.iter().any(|cure| words.contains(cure)) {
        return wrong(format!("no cure in the message: {message}"));
    }
    if words.contains("os error") || words.len() > 600 {
        return wrong(format!("not plain language: {message}"));
    }
    verdict
}

/// Returns true if the difference of two numbers is at most this fraction of the larger one.
pub(crate) fn agree(a: f64, b: f64, share: f64) -> bool {
    a == b || (a - b).abs() <= share * a.abs().max(b.abs())
}
