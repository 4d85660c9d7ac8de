//! The built-in demo network.

use std::sync::Arc;

use decoupler_core::{
    dataset::Simulation,
    evaluation::{Run, RunError, RunSets, RunSettings},
    job::Job,
    machine::node_pairs_per_row,
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Indenter, Loading, Noise, Rows, Scene},
};
use decoupler_files::machine::memory_budget;

use crate::window::{
    job::{Background, Jobs},
    test_view::Skin,
    views::train::decoders::Subject,
};

/// A small network for the displayed sensor, trained quickly in the background once the user is about to press and there is
/// no other.
#[derive(Debug)]
pub(super) struct Demo {
    job: Background<Result<Subject, String>>,
    /// Settings of the network that is there or being trained; `None` for an array that is too large.
    settings: Option<RunSettings>,
    /// The network, or why it could not be trained.
    pub(super) subject: Option<Result<Subject, String>>,
}

impl Demo {
    pub(super) fn new(jobs: &Jobs) -> Self {
        Self {
            job: Background::prompt("demo network", jobs),
            settings: None,
            subject: None,
        }
    }

    /// Takes the network for the sensor of `skin` and readings with `noise`, which is trained unless that takes long.
    pub(super) fn follow(&mut self, skin: &Skin, noise: Noise) {
        let settings = demo_settings(skin, noise);
        if self.settings != settings {
            (self.settings, self.subject) = (settings, None);
            self.job.abandon();
            if let Some(settings) = settings {
                self.job.start(
                    move |report| {
                        let trained = train(settings, &Job::new(&|| report.is_cancelled()));
                        trained.map_err(|error| error.to_string())
                    },
                    |trained| trained.map_err(|error| error.to_string())?,
                );
            }
        }
        self.subject = self.job.next_event().or(self.subject.take());
    }

    /// Returns true while the network is being trained.
    pub(super) fn is_awaited(&self) -> bool {
        self.settings.is_some() && self.subject.is_none()
    }
}

fn train(settings: RunSettings, job: &Job<'_>) -> Result<Subject, RunError> {
    let sets = RunSets::draw(&settings, memory_budget(), job)?;
    let mut run = Run::new(settings, sets, None, job)?;
    run.finish(job)?;
    Ok(Subject {
        networks: Arc::new(run.network()),
        setup: settings.into(),
        problem: Arc::clone(run.problem()),
    })
}

/// Returns the settings of a small network that learns imprints of balls on the sensor of `skin` in a fraction of a second,
/// with its rows and stroke, from readings with `noise`; `None` for arrays for which training would take longer.
///
/// One network for each known row, with conductances scaled to [−1, 1], was the best choice for so few samples.
fn demo_settings(skin: &Skin, noise: Noise) -> Option<RunSettings> {
    /// Number of training samples per row.
    const SAMPLES: usize = 200;
    /// Maximum number of pairs of nodes in all samples: about a tenth of a second.
    const MAX_PAIRS: f64 = 5e7;
    /// Maximum number of unknowns and readings of all rows, with which the time of an epoch grows.
    const MAX_CHANNELS: usize = 2000;
    let (scale, rows) = (skin.sensor.scale, skin.rows.len());
    let samples = SAMPLES * rows;
    let channels = rows * (scale.nodes_per_row() + scale.columns());
    if samples as f64 * node_pairs_per_row(&skin.sensor) > MAX_PAIRS || channels > MAX_CHANNELS {
        return None;
    }
    let scene = Scene {
        rows: match skin.rows[..] {
            [row] => Rows::One(row),
            _ => Rows::Known,
        },
        loading: Loading::Indenter(Indenter::default()),
        largest_compression: skin.stroke_mm / skin.sensor.geometry.height_mm,
        noise,
        ..Scene::default()
    };
    let mut settings = RunSettings::from(Simulation {
        sensor: skin.sensor,
        scene,
        samples,
        validation_samples: 0,
        test_samples: rows,
    });
    settings.inputs = InputChoice {
        quantity: Quantity::Conductance,
        scaling: ScalingChoice::MinMax,
    };
    settings.hidden = 6;
    settings.training.stopping.epochs = 30;
    Some(settings)
}
