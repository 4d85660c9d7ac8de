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
    Refused(String),
    /// There is a result, and a remark with cause and cure.
    Flagged(String),
    /// Plausible but wrong; or a panic, a NaN, or a message without a cure.
    Wrong(String),
}

/// One judged cell.
pub(crate) struct Cell {
    pub(crate) room: &'static str,
    pub(crate) extreme: &'static str,
    pub(crate) sentence: String,
    pub(crate) verdict: Verdict,
}

/// A job that produces one or several cells.
pub(crate) struct Job {
    room: &'static str,
    extreme: &'static str,
    /// Description.
    sentence: String,
    run: Box<dyn Fn() -> Vec<(String, Verdict)> + Send + Sync>,
}

impl Job {
    /// A job with several cells, each with the name of its subject.
    pub(crate) fn new(
        room: &'static str,
        extreme: &'static str,
        sentence: impl Into<String>,
        run: impl Fn() -> Vec<(String, Verdict)> + Send + Sync + 'static,
    ) -> Self {
        Self {
            room,
            extreme,
            sentence: sentence.into(),
            run: Box::new(run),
        }
    }

    /// A job with one cell.
    pub(crate) fn one(
        room: &'static str,
        extreme: &'static str,
        sentence: impl Into<String>,
        run: impl Fn() -> Verdict + Send + Sync + 'static,
    ) -> Self {
        Self::new(room, extreme, sentence, move || vec![(String::new(), run())])
    }

    /// Runs the job.
    pub(crate) fn cells(&self) -> Vec<Cell> {
        let panicked = |cause: Box<dyn std::any::Any + Send>| {
            let text = cause.downcast_ref::<String>().cloned();
            let text = text.or_else(|| cause.downcast_ref::<&str>().map(|text| (*text).to_owned()));
            vec![(
                String::new(),
                Verdict::Wrong(format!("panic: {}", text.unwrap_or_default())),
            )]
        };
        let judged = catch_unwind(AssertUnwindSafe(|| (self.run)())).unwrap_or_else(panicked);
        let cell = |(part, verdict): (String, Verdict)| Cell {
            room: self.room,
            extreme: self.extreme,
            sentence: if part.is_empty() {
                self.sentence.clone()
            } else {
                format!("{}: {part}", self.sentence)
            },
            verdict,
        };
        judged.into_iter().map(cell).collect()
    }
}

/// Returns a refusal if its message says what to change.
pub(crate) fn refused(error: &impl Display) -> Verdict {
    match defect_of(&error.to_string()) {
        None => Verdict::Refused(error.to_string()),
        Some(defect) => Verdict::Wrong(format!("{defect} in the refusal: {error}")),
    }
}

/// Returns a remark if its message says what to change.
pub(crate) fn flagged(remark: &impl Display) -> Verdict {
    match defect_of(&remark.to_string()) {
        None => Verdict::Flagged(remark.to_string()),
        Some(defect) => Verdict::Wrong(format!("{defect} in the remark: {remark}")),
    }
}

pub(crate) fn wrong(what: impl Into<String>) -> Verdict {
    Verdict::Wrong(what.into())
}

/// Returns the defect of a message: it names no cure, or is not written for users.
fn defect_of(message: &str) -> Option<&'static str> {
    const CURES: &[&str] = &[
        "give", "must", "use ", "take", "lower", "raise", "set ", "draw", "train", "make", "check", "choose", "write",
        "copy", "fewer", "keep", "end rows", "name ", "need", "let ", "shift", "begin", "install", "resume", "change",
        "scale ", "correct", "press ",
    ];
    let words = message.to_lowercase();
    if !CURES.iter().any(|cure| words.contains(cure)) {
        return Some("no cure");
    }
    if words.contains("os error") || message.len() > 600 {
        return Some("not plain language");
    }
    None
}

/// Returns true if the difference of two numbers is at most this fraction of the larger one.
pub(crate) fn agree(a: f64, b: f64, share: f64) -> bool {
    a == b || (a - b).abs() <= share * a.abs().max(b.abs())
}
