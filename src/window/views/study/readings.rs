//! What the readings of a recording determine, and a cross-validation of its network.

use std::{ops::ControlFlow, path::Path, sync::Arc, time::Instant};

use decoupler_core::{
    dataset::{Folds, SplitBy, Stream},
    evaluation::{
        CrossValidated, ErrorTable, TrainingSize, Workload,
        recorded::{Determination, channel_remarks, ridge_remarks},
    },
    job::Job,
};
use decoupler_files::{
    export::{
        Cell, describe_determinacy, describe_target, describe_warnings, error_table, format_below_one, format_duration,
    },
    import::{Plan, Recording, Setup},
    machine::memory_budget,
};

use super::{Note, Page, Report, Reporter, Row, StudyEvent, Tone};
use crate::window::shared::sentence;

/// Reads the recording of `setup`.
fn recording<'a>(setup: &'a Setup, job: &Job<'_>, reporter: &Reporter) -> Result<(&'a Plan, Recording), String> {
    let plan = setup.plan().ok_or("This is not a recording.")?;
    // The paths of the window's plans are absolute.
    let recording = plan.recording(Path::new(""), &mut |progress| {
        reporter.progress(StudyEvent::Reading(progress), |_, _| ());
        job.check().map_or(ControlFlow::Break(()), ControlFlow::Continue)
    });
    let recording = recording.map_err(|error| error.to_string())?;
    reporter.send(StudyEvent::Problem(Arc::new(recording.problem.clone())));
    Ok((plan, recording))
}

fn by_folds(folds: usize, by: SplitBy) -> String {
    format!("{folds} folds by {by}")
}

/// Measures by held-out samples how well the readings determine each target, and reports the findings.
///
/// # Errors
/// If the recording cannot be read or divided, with what to do.
pub fn find(setup: &Setup, reporter: &Reporter) -> Result<(), String> {
    let is_cancelled = || reporter.is_cancelled();
    let job = Job::new(&is_cancelled);
    let (plan, recording) = recording(setup, &job, reporter)?;
    let begun = Instant::now();
    let by = plan.division.by;
    let found = recording.findings(setup.settings(), by, &job);
    let found = found.map_err(|error| error.to_string())?;
    let mut notes = Vec::new();
    for (index, (target, of_target)) in recording.problem.targets.iter().zip(&found.targets).enumerate() {
        notes.push(Note::Line(
            Tone::Usual,
            sentence(&describe_target(&target.name, of_target)),
        ));
        if let (Ok(ridge), Some(kernel)) = (of_target.ridge, of_target.kernel) {
            let [ridge, kernel] = [ridge, kernel].map(|of| format_below_one(of.r2.value, 3));
            let text = format!("R² of ridge regression {ridge}, of kernel ridge regression {kernel}");
            notes.push(Note::Line(Tone::Dim, text));
        }
        notes.push(Note::Line(
            Tone::Dim,
            sentence(&found.comparison.sentence(index, &target.name)),
        ));
    }
    let warnings = describe_warnings(&recording, by, &found).into_iter();
    notes.extend(warnings.map(|warning| Note::Line(Tone::Warning, sentence(&warning))));
    let folds = by_folds(found.record.folds, by);
    let time = format_duration(begun.elapsed());
    reporter.send(StudyEvent::Report(Box::new(Report {
        headline: "What the readings determine".to_owned(),
        conditions: format!("{} samples, {folds}; analysed in {time}.", recording.set.samples()),
        pages: vec![Page {
            notes,
            ..Page::default()
        }],
    })));
    Ok(())
}

/// Tests on every sample with networks trained on the other folds, and reports the errors.
///
/// # Errors
/// If the recording cannot be read, divided or trained on, with what to do.
pub fn cross_validate(setup: &Setup, folds: usize, reporter: &Reporter) -> Result<(), String> {
    let is_cancelled = || reporter.is_cancelled();
    let job = Job::new(&is_cancelled);
    let (plan, Recording { set, problem, .. }) = recording(setup, &job, reporter)?;
    let (settings, by) = (setup.settings(), plan.division.by);
    let workload = Workload::of(settings, TrainingSize::of(settings, &set));
    let checked = workload.check_memory(memory_budget());
    checked.map_err(|error| error.to_string())?;
    let assigned = Folds::by(&set, folds, by, &mut settings.seed.rng(Stream::Split));
    let assigned = assigned.map_err(|error| error.to_string())?;
    let validated = CrossValidated::on_folds(settings, &set, assigned, &job);
    let validated = validated.map_err(|error| error.to_string())?;
    let mut remarks = channel_remarks(&set, by, &problem.features(), &problem.targets);
    let determined = Determination::measure(&set, validated.network.view(), by);
    remarks.extend(describe_determinacy(&problem.targets, &determined, false));
    remarks.extend(ridge_remarks(&set, &validated, by, &problem.targets));
    let table = error_table(&ErrorTable::of_scores(&problem, &validated.scores(&set), None));
    // Its first columns are the target and the decoder.
    let row = |(item, cells): (usize, &Vec<Cell>)| {
        let texts = cells.iter().map(Cell::rounded).take(2);
        let is_network = cells[1] == Cell::from("network");
        let tone = if is_network { Tone::Own } else { Tone::Usual };
        Row {
            item,
            name: Vec::from_iter(texts).join(", "),
            tones: vec![tone; cells.len()],
            ..Row::default()
        }
    };
    let (samples, folds) = (set.samples(), by_folds(folds, by));
    reporter.send(StudyEvent::Report(Box::new(Report {
        headline: "Cross-validation".to_owned(),
        conditions: format!("{samples} samples, each tested by a network trained on the other folds: {folds}."),
        pages: vec![Page {
            what: "Errors of",
            rows: table.rows.iter().enumerate().map(row).collect(),
            notes: remarks
                .iter()
                .map(|remark| Note::Line(Tone::Usual, sentence(remark)))
                .collect(),
            table,
            ..Page::default()
        }],
    })));
    Ok(())
}
