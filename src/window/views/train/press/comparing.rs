use std::sync::Arc;

use super::{section::Shown, state::Subject};
use crate::window::job::{Background, JobError, Report, Wake};
use decoupler_core::{
    decoupling::{Decoder, DecoderKind, Precision},
    evaluation::{DecoderSet, Pressed, PressedAnswer, RunError},
    job::Job,
};
use decoupler_files::machine::memory_budget;

/// Decoders compared with the network.
const KINDS: [DecoderKind; 5] = [
    DecoderKind::Mean,
    DecoderKind::Ridge,
    DecoderKind::RadialBasis,
    DecoderKind::Polish,
    DecoderKind::Newton,
];

/// A decoder and its latest answer.
#[derive(Debug)]
pub(super) struct Compared {
    pub(super) kind: DecoderKind,
    /// Its latest answer or why it has none; `None` before the first.
    pub(super) answer: Option<Result<PressedAnswer, String>>,
    /// True if that is the answer to the current touch.
    pub(super) is_present: bool,
}

type Fitted = (DecoderKind, Box<dyn Decoder>);

/// Events of the thread that fits decoders.
enum FitEvent {
    Fitted(DecoderKind, Result<Box<dyn Decoder>, String>),
    Ended(Result<(), JobError>),
}

/// The decoders returned by the thread, with the answers of those that were fast enough.
struct Decoded {
    decoders: Vec<Fitted>,
    answers: Vec<(DecoderKind, Result<PressedAnswer, String>)>,
}

/// The other decoders under the finger: fitted in the background once the user presses, and asked there one touch at a
/// time; the newest touch wins.
pub(super) struct Comparing {
    fits: Background<FitEvent>,
    decoding: Background<Result<Decoded, JobError>>,
    of: Option<Subject>,
    decoders: Vec<Fitted>,
    rows: Vec<Compared>,
    /// The touch being decoded or decoded last.
    asked: Option<Arc<Pressed>>,
    /// True after an internal error, with which decoders were lost; they are fitted again for the next touch.
    has_failed: bool,
}

impl Comparing {
    pub(super) fn new(wake: &Wake) -> Self {
        Self {
            fits: Background::new("fits", Arc::clone(wake)),
            decoding: Background::prompt("comparison", Arc::clone(wake)),
            of: None,
            decoders: Vec::new(),
            rows: Vec::new(),
            asked: None,
            has_failed: false,
        }
    }

    /// The decoders in the order of the table; none while the network still learns.
    pub(super) fn rows(&self) -> &[Compared] {
        &self.rows
    }

    /// Takes events, and asks the decoders about the current touch.
    pub(super) fn follow(&mut self, shown: Option<&Shown>) {
        self.take_events();
        let Some(shown) = shown else { return };
        let subject = shown.question.subject.as_ref().filter(|subject| subject.is_idle);
        if self.has_failed && self.asked.is_none() {
            // Fitting has failed; it is tried again at the next touch, not in every frame.
            self.asked = Some(Arc::clone(&shown.pressed));
        }
        let is_same = match (&self.of, subject) {
            (Some(of), Some(subject)) => of.is(subject),
            (of, subject) => of.is_none() && subject.is_none(),
        };
        if !is_same || (self.has_failed && !self.is_asked(&shown.pressed)) {
            self.begin(subject.cloned());
        }
        let is_new = !self.is_asked(&shown.pressed);
        if is_new {
            self.rows.iter_mut().for_each(|row| row.is_present = false);
        }
        let is_answered = !is_new && self.rows.iter().all(|row| row.is_present || !self.has(row.kind));
        if self.decoding.is_under_way() {
            if is_new {
                // Slow decoders give up; the answers so far arrive, and then the decoders are asked about this touch.
                self.decoding.cancel();
            }
        } else if !self.decoders.is_empty() && !is_answered {
            self.ask(Arc::clone(&shown.pressed));
        }
    }

    fn is_asked(&self, pressed: &Arc<Pressed>) -> bool {
        self.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, pressed))
    }

    fn has(&self, kind: DecoderKind) -> bool {
        self.decoders.iter().any(|(other, _)| *other == kind)
    }

    /// Fits the decoders for another network.
    fn begin(&mut self, subject: Option<Subject>) {
        self.fits.abandon();
        self.decoding.abandon();
        (self.decoders, self.asked, self.has_failed) = (Vec::new(), None, false);
        self.of.clone_from(&subject);
        let Some(subject) = subject else {
            self.rows.clear();
            return;
        };
        self.rows = KINDS
            .map(|kind| Compared {
                kind,
                answer: None,
                is_present: false,
            })
            .into();
        self.fits
            .start(move |report| fit_all(&subject, report), FitEvent::Ended);
    }

    fn ask(&mut self, pressed: Arc<Pressed>) {
        let mut decoders = std::mem::take(&mut self.decoders);
        self.asked = Some(Arc::clone(&pressed));
        self.decoding.start(
            move |report| {
                let mut answers = Vec::new();
                for (kind, decoder) in &mut decoders {
                    match pressed.answer(&mut **decoder, &Job::new(&|| report.is_cancelled())) {
                        Ok(answer) => answers.push((*kind, Ok(answer))),
                        Err(RunError::Cancelled(_)) => break,
                        Err(error) => answers.push((*kind, Err(error.to_string()))),
                    }
                }
                Decoded { decoders, answers }
            },
            |decoded| decoded,
        );
    }

    fn take_events(&mut self) {
        while let Some(event) = self.fits.next_event() {
            match event {
                FitEvent::Fitted(kind, Ok(decoder)) => self.decoders.push((kind, decoder)),
                FitEvent::Fitted(kind, Err(reason)) => self.fail(|other| other == kind, &reason),
                FitEvent::Ended(Ok(())) => {}
                FitEvent::Ended(Err(error)) => self.fail_all(&error),
            }
        }
        while let Some(decoded) = self.decoding.next_event() {
            match decoded {
                Ok(Decoded { decoders, answers }) => {
                    // Decoders fitted meanwhile come last.
                    let newer = std::mem::replace(&mut self.decoders, decoders);
                    self.decoders.extend(newer);
                    for (kind, mut answer) in answers {
                        if let Some(row) = self.rows.iter_mut().find(|row| row.kind == kind) {
                            // A touch that was left before its decoding was timed keeps the previous time.
                            if let (Ok(answer), Some(Ok(before))) = (&mut answer, &row.answer) {
                                answer.time = answer.time.or(before.time);
                            }
                            (row.answer, row.is_present) = (Some(answer), true);
                        }
                    }
                }
                Err(error) => self.fail_all(&error),
            }
        }
    }

    /// Shows an internal error for every decoder without an answer to the current touch.
    fn fail_all(&mut self, error: &JobError) {
        self.has_failed = true;
        for row in self.rows.iter_mut().filter(|row| !row.is_present) {
            (row.answer, row.is_present) = (Some(Err(error.to_string())), true);
        }
    }

    fn fail(&mut self, is_it: impl Fn(DecoderKind) -> bool, reason: &str) {
        for row in self
            .rows
            .iter_mut()
            .filter(|row| row.answer.is_none() && is_it(row.kind))
        {
            row.answer = Some(Err(reason.to_owned()));
        }
    }
}

/// Fits one decoder after the other, the fastest first.
fn fit_all(subject: &Subject, report: &Report<FitEvent>) {
    let is_cancelled = || report.is_cancelled();
    let networks = Some((*subject.networks).clone());
    let set = DecoderSet::drawn(subject.settings, networks, memory_budget(), &Job::new(&is_cancelled))
        .map_err(|error| error.to_string());
    for kind in KINDS {
        if report.is_cancelled() {
            return;
        }
        let fit = |set: &DecoderSet| match set.decoder(kind, Precision::Double) {
            Ok(decoder) => decoder.ok_or_else(|| "it needs a trained network".to_owned()),
            Err(error) => Err(error.to_string()),
        };
        report.send(FitEvent::Fitted(
            kind,
            set.as_ref().map_err(String::clone).and_then(fit),
        ));
    }
}

impl std::fmt::Debug for Comparing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Comparing")
            .field("rows", &self.rows)
            .finish_non_exhaustive()
    }
}
