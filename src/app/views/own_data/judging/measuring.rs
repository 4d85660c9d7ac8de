use std::sync::Arc;

use super::thread::{Decoders, News, Task, Told, work};
use crate::{
    app::{
        job::{Job, Wake},
        shared::Unfinished,
    },
    evaluation::{
        DecoderSet, RunSettings,
        recorded::{FittedModel, Stage},
    },
    export::MeasuredNetworkFile,
    import::{Plan, Progress},
    sensor::counted,
};

/// Name of the work on findings.
const FINDINGS: &str = "Findings";

/// The window's end of the thread, and what it has measured.
#[derive(Debug)]
pub struct Measuring {
    job: Job<News>,
    /// The work under way.
    pub(super) under_way: Option<UnderWay>,
    /// Progress of reading a file.
    pub(super) reading: Option<Progress>,
    /// Findings on the recording, once they were measured.
    pub told: Option<Box<Told>>,
    /// Decoders measured so far.
    pub decoders: Option<Box<Decoders>>,
    /// Model to be fitted again and again; the better one if none is chosen.
    pub(super) model: Option<FittedModel>,
    /// Target of the learning curve and of the chart of decoders.
    pub(super) target: usize,
}

/// Work of the thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum UnderWay {
    Findings(Option<Stage>),
    Decoders,
}

impl Measuring {
    /// Nothing measured yet. `wake` is called when there is news.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Job::new("own data findings", wake),
            under_way: None,
            reading: None,
            told: None,
            decoders: None,
            model: None,
            target: 0,
        }
    }

    pub fn is_under_way(&self) -> bool {
        self.under_way.is_some()
    }

    /// The measurement under way.
    pub fn unfinished(&self) -> Option<Unfinished> {
        Some(match self.under_way? {
            UnderWay::Findings(None) => Unfinished::discarded(FINDINGS, "the files are being read".to_owned()),
            UnderWay::Findings(Some(stage)) => Unfinished::discarded(FINDINGS, stage.to_string()),
            UnderWay::Decoders => {
                let measured = self.decoders.as_ref();
                let done = measured.map_or(0, |decoders| decoders.reports.len() + decoders.refused.len());
                let progress = format!(
                    "{done} of {} measured",
                    counted(DecoderSet::of_targets().count(), "decoder")
                );
                Unfinished::discarded("Decoders", progress)
            }
        })
    }

    pub(super) fn find(&mut self, plan: Plan, settings: RunSettings, folds: usize) {
        self.told = None;
        self.start(
            UnderWay::Findings(None),
            Task::Findings(Box::new(plan), Box::new(settings), folds, self.model),
        );
    }

    pub(super) fn measure_decoders(&mut self, file: Arc<MeasuredNetworkFile>) {
        self.decoders = None;
        self.start(UnderWay::Decoders, Task::Decoders(file));
    }

    fn start(&mut self, under_way: UnderWay, task: Task) {
        (self.under_way, self.reading) = (Some(under_way), None);
        self.job.start(
            move |report| work(task, report),
            |ended| News::Ended(ended.unwrap_or_else(|error| Err(error.to_string()))),
        );
    }

    /// Lets go of the work under way.
    pub fn cancel(&mut self) {
        self.job.abandon();
        self.under_way = None;
    }

    /// Takes what the thread has to tell; returns why it failed, if it did.
    pub fn follow(&mut self) -> Option<String> {
        let mut failure = None;
        while let Some(news) = self.job.next_event() {
            match news {
                News::Reading(progress) => self.reading = Some(progress),
                News::Begun(stage) => self.under_way = Some(UnderWay::Findings(Some(stage))),
                News::Told(told) => self.told = Some(told),
                News::Measured(decoders) => self.decoders = Some(decoders),
                News::Ended(ended) => {
                    self.under_way = None;
                    failure = ended.err();
                }
            }
        }
        failure
    }
}
