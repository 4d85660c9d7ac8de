//! Preview of settings before a training: their test set and the baselines.

use super::{
    job::{Background, JobError},
    test_view::{TestView, TestViewError},
};
use decoupler_core::{
    evaluation::{Baselines, RunSets, RunSettings},
    job::Job,
};
use decoupler_files::machine::memory_budget;

/// Message from the thread to the window.
#[derive(Debug)]
pub enum PreviewEvent {
    /// Test set of these settings.
    Drawn(Box<RunSettings>, Result<TestView, TestViewError>),
    /// Baselines, the last event; `None` if they take long or cannot be computed, which a training would explain.
    Compared(Result<Option<Baselines>, JobError>),
}

/// Draws the test set of these settings unless that `is_known`, and computes the baselines; replaces an earlier request.
pub fn request(job: &mut Background<PreviewEvent>, settings: RunSettings, is_known: bool) {
    job.start(
        move |report| {
            if !is_known {
                report.send(PreviewEvent::Drawn(Box::new(settings), TestView::draw(&settings)));
            }
            baselines(&settings, &Job::new(&|| report.is_cancelled()))
        },
        PreviewEvent::Compared,
    );
}

/// Returns the baselines of the settings; `None` if computing them would delay the next request.
fn baselines(settings: &RunSettings, job: &Job<'_>) -> Option<Baselines> {
    /// About a tenth of a second.
    const MAX_TERMS: usize = 50_000_000;
    let simulation = settings.simulation()?;
    let scale = simulation.sensor.scale;
    let samples = simulation.samples + simulation.validation_samples + simulation.test_samples;
    let resistances = scale.nodes_per_row() * scale.nodes_per_column() * scale.columns();
    let linear_map = scale.columns() * (scale.columns() + scale.coordinates_per_row());
    if samples.saturating_mul(resistances + linear_map) > MAX_TERMS {
        return None;
    }
    let sets = RunSets::draw(settings, memory_budget(), job).ok()?;
    Baselines::measure(settings, &sets, job).ok()
}
