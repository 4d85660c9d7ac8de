use std::{
    ops::ControlFlow,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use crate::{
    app::{job::Report, views::own_data::remarks::in_window},
    evaluation::Channel,
    evaluation::{
        DecoderSet, RunSettings, TargetReport, decoded_unit,
        recorded::{Findings, FittedModel, Stage},
    },
    export::MeasuredNetworkFile,
    import::{Plan, Progress},
};

/// Work for the thread.
#[derive(Debug)]
pub enum Task {
    /// Find out what the recording of this plan tells, with so many folds.
    Findings(Box<Plan>, Box<RunSettings>, usize, Option<FittedModel>),
    /// Measure decoders beside this network, on the samples with which it was trained and tested.
    Decoders(Arc<MeasuredNetworkFile>),
}

/// News from the thread.
#[derive(Debug)]
pub enum News {
    /// Progress of reading a file.
    Reading(Progress),
    /// A part of the work has begun.
    Begun(Stage),
    /// Findings on the recording.
    Told(Box<Told>),
    /// Decoders measured so far.
    Measured(Box<Decoders>),
    /// The thread has ended, and why unless it was to end.
    Ended(Result<(), String>),
}

/// Findings on a recording, with what they were measured on.
#[derive(Clone, Debug)]
pub struct Told {
    /// Import with absolute paths.
    pub plan: Plan,
    pub settings: RunSettings,
    pub folds: usize,
    pub samples: usize,
    pub inputs: Vec<Channel>,
    pub targets: Vec<Channel>,
    pub findings: Findings,
    /// Time that it took, without reading the files.
    pub time: Duration,
}

/// Decoders measured beside a network.
#[derive(Clone, Debug)]
pub struct Decoders {
    pub of: Arc<MeasuredNetworkFile>,
    /// The unit of which the decoding time is measured: "a sample", "a frame of 4 row-wires".
    pub decoded: String,
    pub reports: Vec<TargetReport>,
    /// Decoders that cannot be used, and why.
    pub refused: Vec<String>,
}

/// Does a task; ends early if it is cancelled.
pub fn work(task: Task, report: &Report<News>) -> Result<(), String> {
    match task {
        Task::Findings(plan, settings, folds, model) => find(*plan, *settings, folds, model, report),
        Task::Decoders(file) => measure(file, report),
    }
}

fn watch(progress: Progress, report: &Report<News>) -> ControlFlow<()> {
    report.progress(News::Reading(progress), |_, _| ());
    if report.is_cancelled() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

fn find(
    plan: Plan,
    settings: RunSettings,
    folds: usize,
    model: Option<FittedModel>,
    report: &Report<News>,
) -> Result<(), String> {
    let recording = plan.recording(Path::new(""), &mut |progress| watch(progress, report));
    let recording = recording.map_err(|error| in_window(&error))?;
    let begun = Instant::now();
    let found = Findings::measure(
        &settings,
        &recording.set,
        (&plan.division, folds),
        model,
        &|stage| report.send(News::Begun(stage)),
        &|| report.is_cancelled(),
    );
    if let Some(findings) = found.map_err(|error| error.to_string())? {
        report.send(News::Told(Box::new(Told {
            plan: plan.absolute(),
            settings,
            folds,
            samples: recording.set.samples(),
            inputs: recording.inputs,
            targets: recording.targets,
            findings,
            time: begun.elapsed(),
        })));
    }
    Ok(())
}

fn measure(file: Arc<MeasuredNetworkFile>, report: &Report<News>) -> Result<(), String> {
    let sets = file.plan.sets(Path::new(""), file.settings.seed, &mut |progress| {
        watch(progress, report)
    });
    let sets = sets.map_err(|error| in_window(&error))?;
    let test = &sets.test;
    let decoded = decoded_unit(test);
    let set = DecoderSet::on_set(file.settings.into(), sets.split.training, Some(file.network.clone()));
    let mut decoders = Decoders {
        of: file,
        decoded,
        reports: Vec::new(),
        refused: Vec::new(),
    };
    for (kind, precision) in DecoderSet::of_targets() {
        if report.is_cancelled() {
            return Ok(());
        }
        match set.measure_targets(kind, precision, test) {
            Ok(measured) => decoders.reports.extend(measured),
            Err(error) => decoders.refused.push(format!("{}: {error}", kind.name(precision))),
        }
        report.send(News::Measured(Box::new(decoders.clone())));
    }
    Ok(())
}
