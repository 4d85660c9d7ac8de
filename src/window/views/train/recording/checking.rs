//! A check of the import in the background: numbers of samples, rows dropped, and warnings.

use std::{ops::ControlFlow, path::Path, sync::Arc};

use super::columns_card::in_window;
use crate::window::job::{Job, JobError, Report, Wake};
use decoupler_core::{
    dataset::{Dataset, Seed},
    evaluation::recorded::channel_remarks,
};
use decoupler_files::{
    export::describe_positions,
    import::{Dropped, FileReport, Plan, Recording},
};

/// Outcome of an import.
#[derive(Clone, Debug)]
pub(super) struct Checked {
    /// Number of samples for training, validation and test.
    pub(super) samples: [usize; 3],
    /// Number of rows of the files, dropped ones included.
    pub(super) rows: usize,
    /// Rows that are no samples, by reason.
    pub(super) dropped: Vec<Dropped>,
    /// The files, and how they are joined.
    pub(super) files: Vec<FileReport>,
    /// Positions of targets, in words.
    pub(super) positions: Option<String>,
    /// Warnings for the user.
    pub(super) warnings: Vec<String>,
}

#[derive(Debug)]
struct CheckingEvent(Result<Box<Checked>, String>);

/// Check under way, and the outcome of the last one.
#[derive(Debug)]
pub(super) struct Checking {
    job: Job<CheckingEvent>,
    asked: Option<(Arc<Plan>, Seed)>,
    /// Its outcome, once it is known.
    pub(super) checked: Option<Result<Box<Checked>, String>>,
}

impl Checking {
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Job::new("import", wake),
            asked: None,
            checked: None,
        }
    }

    /// Checks this plan, unless that is done or under way; `None` if there is nothing to check.
    pub(super) fn follow(&mut self, planned: Option<Arc<Plan>>, seed: Seed) {
        let wanted = planned.map(|planned| (planned, seed));
        let is_same = match (&wanted, &self.asked) {
            (None, None) => true,
            (Some((wanted, seed)), Some((asked, before))) => {
                seed == before && (Arc::ptr_eq(wanted, asked) || wanted == asked)
            }
            _ => false,
        };
        self.asked.clone_from(&wanted);
        if !is_same {
            self.checked = None;
            match wanted {
                None => self.job.abandon(),
                Some((plan, seed)) => self.job.start(
                    move |report| check(&plan, seed, report),
                    |checked: Result<_, JobError>| {
                        CheckingEvent(checked.unwrap_or_else(|error| Err(error.to_string())))
                    },
                ),
            }
        }
        while let Some(CheckingEvent(checked)) = self.job.next_event() {
            self.checked = Some(checked);
        }
    }

    /// Returns true while an import is being checked.
    pub(super) fn is_under_way(&self) -> bool {
        self.asked.is_some() && self.checked.is_none()
    }
}

fn check(plan: &Plan, seed: Seed, report: &Report<CheckingEvent>) -> Result<Box<Checked>, String> {
    let mut watch = |_| {
        if report.is_cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let sets = plan
        .sets(Path::new(""), seed, &mut watch)
        .map_err(|error| in_window(&error))?;
    let recordings = || std::iter::once(&sets.recording).chain(&sets.test_recording);
    let mut warnings: Vec<String> = recordings()
        .flat_map(|recording| recording.warnings.iter().cloned())
        .collect();
    warnings.extend(channels(&sets.recording));
    let validation = sets.split.validation.as_ref().map_or(0, Dataset::samples);
    Ok(Box::new(Checked {
        samples: [sets.split.training.samples(), validation, sets.test.samples()],
        rows: recordings().map(|recording| recording.rows).sum(),
        dropped: recordings()
            .flat_map(|recording| recording.dropped.iter().cloned())
            .collect(),
        files: recordings()
            .flat_map(|recording| recording.files.iter().cloned())
            .collect(),
        positions: describe_positions(&sets.recording.positions),
        warnings,
    }))
}

/// Remarks on inputs that carry little or no information.
fn channels(recording: &Recording) -> Vec<String> {
    let name = |channel: usize| recording.inputs[channel].name.clone();
    channel_remarks(&recording.set)
        .iter()
        .map(|remark| remark.sentence(name))
        .collect()
}
